//! A tetrahedral mesh that can be edited, and restored when an edit turns out badly.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};

use super::node::SnapNode;
use crate::mesh::TET_FACES;

/// Nodes of a face in ascending order: a key that is the same from both of its elements.
pub type FaceKey = [u32; 3];

/// The key of the face with these nodes.
pub fn face_key(mut nodes: [u32; 3]) -> FaceKey {
    nodes.sort_unstable();
    nodes
}

/// Elements, their nodes, and the faces that incisions have marked.
#[derive(Clone, Debug, Default)]
pub struct Complex {
    /// All nodes. Those that no element uses any more are dropped at the end of the cut.
    pub nodes: Vec<SnapNode>,
    /// Node ids per element, positively oriented.
    tets: Vec<[u32; 4]>,
    alive: Vec<bool>,
    /// Elements around every node.
    around: Vec<Vec<u32>>,
    /// Incision per face: of a lip if the face is on the surface, else of a face that is selected but still
    /// closed.
    tags: BTreeMap<FaceKey, u32>,
    journal: Vec<Edit>,
}

/// One reversible change.
#[derive(Clone, Copy, Debug)]
enum Edit {
    Added,
    Removed(u32),
    Moved(u32, SnapNode),
    NodeAdded,
    Tagged(FaceKey, Option<u32>),
}

/// A state of the complex to return to.
#[derive(Clone, Copy, Debug)]
pub struct Mark(usize);

impl Complex {
    /// The complex of a checked mesh.
    pub fn new(nodes: Vec<SnapNode>, tets: &[[u32; 4]], tags: BTreeMap<FaceKey, u32>) -> Self {
        let mut around = vec![Vec::new(); nodes.len()];
        for (t, tet) in (0u32..).zip(tets) {
            tet.iter().for_each(|&n| around[n as usize].push(t));
        }
        let alive = vec![true; tets.len()];
        Self { nodes, tets: tets.to_vec(), alive, around, tags, journal: Vec::new() }
    }

    /// Number of element slots, including removed elements.
    pub fn n_slots(&self) -> usize {
        self.tets.len()
    }

    /// Whether element `t` has not been removed.
    pub fn is_alive(&self, t: u32) -> bool {
        self.alive[t as usize]
    }

    /// Nodes of element `t`.
    pub fn tet(&self, t: u32) -> [u32; 4] {
        self.tets[t as usize]
    }

    /// Elements around a node.
    pub fn around(&self, node: u32) -> &[u32] {
        &self.around[node as usize]
    }

    /// Elements around an edge.
    pub fn around_edge(&self, a: u32, b: u32) -> Vec<u32> {
        self.around(a).iter().copied().filter(|&t| self.tet(t).contains(&b)).collect()
    }

    /// Nodes of the face of `t` opposite its local node `k`, counter-clockwise from outside.
    pub fn face(&self, t: u32, k: usize) -> [u32; 3] {
        TET_FACES[k].map(|c| self.tet(t)[c])
    }

    /// The element across the face of `t` opposite its local node `k`.
    pub fn neighbour(&self, t: u32, k: usize) -> Option<u32> {
        let [p, q, r] = self.face(t, k);
        let shares = |&&s: &&u32| s != t && self.tet(s).contains(&q) && self.tet(s).contains(&r);
        self.around(p).iter().find(shares).copied()
    }

    /// Incision that marked a face, if any.
    pub fn tag(&self, key: &FaceKey) -> Option<u32> {
        self.tags.get(key).copied()
    }

    /// All marked faces.
    pub fn tags(&self) -> &BTreeMap<FaceKey, u32> {
        &self.tags
    }

    /// Rest positions [m] of the corners of `t`.
    pub fn rest(&self, t: u32) -> [Vector3<f64>; 4] {
        self.tet(t).map(|n| self.nodes[n as usize].rest)
    }

    /// Present positions [m] of the corners of `t`.
    pub fn now(&self, t: u32) -> [Vector3<f64>; 4] {
        self.tet(t).map(|n| self.nodes[n as usize].x)
    }

    /// Adds an element.
    pub fn add_tet(&mut self, tet: [u32; 4]) -> u32 {
        let t = self.tets.len() as u32;
        self.tets.push(tet);
        self.alive.push(true);
        tet.iter().for_each(|&n| self.around[n as usize].push(t));
        self.journal.push(Edit::Added);
        t
    }

    /// Removes an element.
    pub fn remove_tet(&mut self, t: u32) {
        self.alive[t as usize] = false;
        for n in self.tet(t) {
            self.around[n as usize].retain(|&s| s != t);
        }
        self.journal.push(Edit::Removed(t));
    }

    /// Adds a node without elements.
    pub fn add_node(&mut self, node: SnapNode) -> u32 {
        self.nodes.push(node);
        self.around.push(Vec::new());
        self.journal.push(Edit::NodeAdded);
        self.nodes.len() as u32 - 1
    }

    /// Changes a node.
    pub fn set_node(&mut self, n: u32, node: SnapNode) {
        self.journal.push(Edit::Moved(n, self.nodes[n as usize]));
        self.nodes[n as usize] = node;
    }

    /// Marks or unmarks a face.
    pub fn set_tag(&mut self, key: FaceKey, tag: Option<u32>) {
        let before = match tag {
            Some(tag) => self.tags.insert(key, tag),
            None => self.tags.remove(&key),
        };
        self.journal.push(Edit::Tagged(key, before));
    }

    /// Puts other nodes under an element and keeps its number. Not to be undone.
    pub fn rename(&mut self, t: u32, from: u32, to: u32) {
        for n in &mut self.tets[t as usize] {
            if *n == from {
                *n = to;
            }
        }
        self.around[from as usize].retain(|&s| s != t);
        self.around[to as usize].push(t);
    }

    /// Replaces all marks of faces. Not to be undone.
    pub fn replace_tags(&mut self, tags: BTreeMap<FaceKey, u32>) {
        self.tags = tags;
    }

    /// This moment.
    pub fn mark(&self) -> Mark {
        Mark(self.journal.len())
    }

    /// Undoes everything since `mark`.
    pub fn undo(&mut self, mark: Mark) {
        while self.journal.len() > mark.0 {
            match self.journal.pop() {
                Some(Edit::Added) => {
                    let t = self.tets.len() as u32 - 1;
                    for n in self.tet(t) {
                        self.around[n as usize].retain(|&s| s != t);
                    }
                    self.tets.pop();
                    self.alive.pop();
                }
                Some(Edit::Removed(t)) => {
                    self.alive[t as usize] = true;
                    for n in self.tet(t) {
                        let around = &mut self.around[n as usize];
                        let at = around.partition_point(|&s| s < t);
                        around.insert(at, t);
                    }
                }
                Some(Edit::Moved(n, node)) => self.nodes[n as usize] = node,
                Some(Edit::NodeAdded) => {
                    self.nodes.pop();
                    self.around.pop();
                }
                Some(Edit::Tagged(key, Some(tag))) => {
                    self.tags.insert(key, tag);
                }
                Some(Edit::Tagged(key, None)) => {
                    self.tags.remove(&key);
                }
                None => break,
            }
        }
    }
}

/// Six times the signed volume of the tet with corners `x` [m³].
pub fn det(x: &[Vector3<f64>; 4]) -> f64 {
    (x[1] - x[0]).dot(&(x[2] - x[0]).cross(&(x[3] - x[0])))
}

/// Barycentric coordinates of a point, which may lie outside.
pub fn barycentric(x: &[Vector3<f64>; 4], point: &Vector3<f64>) -> Option<[f64; 4]> {
    let edges = Matrix3::from_columns(&[x[1] - x[0], x[2] - x[0], x[3] - x[0]]);
    let w = edges.try_inverse()? * (point - x[0]);
    Some([1.0 - w.sum(), w.x, w.y, w.z])
}

//! A tetrahedral mesh that can be edited, and restored when an edit turns out badly.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};

use super::node::{Nodes, SnapNode};
use super::paged::Paged;
use crate::cut::ElementsAround;
use crate::mesh::TET_FACES;

/// Nodes of a face in ascending order: a key that is the same from both of its elements.
pub type FaceKey = [u32; 3];

/// The key of the face with these nodes.
pub fn face_key(mut nodes: [u32; 3]) -> FaceKey {
    nodes.sort_unstable();
    nodes
}

/// The mesh before a cut.
#[derive(Clone, Copy)]
pub struct Before<'a> {
    /// Node ids per element, positively oriented.
    pub tets: &'a [[u32; 4]],
    /// Elements around every node.
    pub around: &'a ElementsAround,
    /// Nodes in both configurations.
    pub nodes: Nodes<'a>,
}

/// Elements, their nodes, and the faces that incisions have marked: the mesh before the cut and what was
/// changed of it since. A cut costs what it changes, whatever the size of the mesh.
#[derive(Clone)]
pub struct Complex<'a> {
    before: Before<'a>,
    /// All nodes. Those that no element uses any more are dropped at the end of the cut.
    nodes: Paged<SnapNode>,
    elements: Paged<Element>,
    /// Elements around every node.
    around: Paged<Vec<u32>>,
    /// Incision per face: of a lip if the face is on the surface, else of a face that is selected but still
    /// closed.
    tags: BTreeMap<FaceKey, u32>,
    journal: Vec<Edit>,
}

/// An element.
#[derive(Clone, Copy, Debug)]
struct Element {
    /// Node ids, positively oriented.
    tet: [u32; 4],
    alive: bool,
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

impl<'a> Complex<'a> {
    /// The complex of a checked mesh.
    pub fn new(before: Before<'a>, tags: BTreeMap<FaceKey, u32>) -> Self {
        let (n_nodes, n_elements) = (before.nodes.rest.len(), before.tets.len());
        Self {
            before,
            nodes: Paged::new(n_nodes),
            elements: Paged::new(n_elements),
            around: Paged::new(n_nodes),
            tags,
            journal: Vec::new(),
        }
    }

    /// Number of element slots, including removed elements.
    pub fn n_slots(&self) -> usize {
        self.elements.len()
    }

    /// Number of nodes, including those that no element uses.
    pub fn n_nodes(&self) -> usize {
        self.nodes.len()
    }

    /// Number of elements and nodes copied in order to change them.
    pub fn copied(&self) -> usize {
        self.elements.copied() + self.nodes.copied().max(self.around.copied())
    }

    /// Whether element `t` has not been removed.
    pub fn is_alive(&self, t: u32) -> bool {
        self.elements.get(t).is_none_or(|element| element.alive)
    }

    /// Nodes of element `t`.
    pub fn tet(&self, t: u32) -> [u32; 4] {
        self.elements.get(t).map_or_else(|| self.before.tets[t as usize], |element| element.tet)
    }

    /// A node with all its data.
    pub fn node(&self, n: u32) -> SnapNode {
        self.nodes.get(n).copied().unwrap_or_else(|| self.before.nodes.node(n))
    }

    /// Rest position [m] of a node.
    pub fn rest_of(&self, n: u32) -> Vector3<f64> {
        self.nodes.get(n).map_or_else(|| self.before.nodes.rest[n as usize], |node| node.rest)
    }

    /// Present position [m] of a node.
    pub fn x_of(&self, n: u32) -> Vector3<f64> {
        self.nodes.get(n).map_or_else(|| self.before.nodes.x[n as usize], |node| node.x)
    }

    /// Positions [m] of all nodes before the cut.
    pub fn x_before(&self) -> &'a [Vector3<f64>] {
        self.before.nodes.x
    }

    /// Elements around a node.
    pub fn around(&self, node: u32) -> &[u32] {
        self.around.get(node).map_or_else(|| self.before.around.of(node), |elements| &elements[..])
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

    /// The marked faces, at the end of a cut.
    pub fn into_tags(self) -> BTreeMap<FaceKey, u32> {
        self.tags
    }

    /// All marked faces.
    pub fn tags(&self) -> &BTreeMap<FaceKey, u32> {
        &self.tags
    }

    /// Rest positions [m] of the corners of `t`.
    pub fn rest(&self, t: u32) -> [Vector3<f64>; 4] {
        self.tet(t).map(|n| self.rest_of(n))
    }

    /// Present positions [m] of the corners of `t`.
    pub fn now(&self, t: u32) -> [Vector3<f64>; 4] {
        self.tet(t).map(|n| self.x_of(n))
    }

    /// Adds an element.
    pub fn add_tet(&mut self, tet: [u32; 4]) -> u32 {
        let (t, before) = (self.elements.len() as u32, self.before);
        self.elements.push(Element { tet, alive: true }, |t| before.element(t));
        tet.iter().for_each(|&n| self.around_mut(n).push(t));
        self.journal.push(Edit::Added);
        t
    }

    /// Removes an element.
    pub fn remove_tet(&mut self, t: u32) {
        self.element_mut(t).alive = false;
        for n in self.tet(t) {
            self.around_mut(n).retain(|&s| s != t);
        }
        self.journal.push(Edit::Removed(t));
    }

    /// Adds a node without elements.
    pub fn add_node(&mut self, node: SnapNode) -> u32 {
        let before = self.before;
        self.nodes.push(node, |n| before.nodes.node(n));
        self.around.push(Vec::new(), |n| before.around.of(n).to_vec());
        self.journal.push(Edit::NodeAdded);
        self.nodes.len() as u32 - 1
    }

    /// Changes a node.
    pub fn set_node(&mut self, n: u32, node: SnapNode) {
        self.journal.push(Edit::Moved(n, self.node(n)));
        *self.node_mut(n) = node;
    }

    fn node_mut(&mut self, n: u32) -> &mut SnapNode {
        let before = self.before;
        self.nodes.change(n, |n| before.nodes.node(n))
    }

    fn element_mut(&mut self, t: u32) -> &mut Element {
        let before = self.before;
        self.elements.change(t, |t| before.element(t))
    }

    fn around_mut(&mut self, n: u32) -> &mut Vec<u32> {
        let before = self.before;
        self.around.change(n, |n| before.around.of(n).to_vec())
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
        for n in &mut self.element_mut(t).tet {
            if *n == from {
                *n = to;
            }
        }
        self.around_mut(from).retain(|&s| s != t);
        self.around_mut(to).push(t);
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
                    let t = self.elements.len() as u32 - 1;
                    for n in self.tet(t) {
                        self.around_mut(n).retain(|&s| s != t);
                    }
                    self.elements.pop();
                }
                Some(Edit::Removed(t)) => {
                    self.element_mut(t).alive = true;
                    for n in self.tet(t) {
                        let around = self.around_mut(n);
                        let at = around.partition_point(|&s| s < t);
                        around.insert(at, t);
                    }
                }
                Some(Edit::Moved(n, node)) => *self.node_mut(n) = node,
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

impl Before<'_> {
    fn element(&self, t: u32) -> Element {
        Element { tet: self.tets[t as usize], alive: true }
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

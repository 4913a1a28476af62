//! Node copies: the connected components of the pieces around a node.
//!
//! The pieces of all elements at node i are the vertices of a graph. Two pieces are linked where they share a
//! closed fragment face on an element face that contains i. Each component is one copy of i. The component
//! with the node's own material keeps the copy with the node's number, the *real* copy; the others are
//! virtual.

use nalgebra::Vector3;

use crate::element::MaterialPoint;
use crate::mesh::TetMesh;
use crate::storage::reserve::{reserve_half_again, reserved};

use super::elements_around::ElementsAround;
use super::fragments::{Fragments, NONE};
use super::pieces::PieceTable;
use super::slot::slot_of;

/// A node copy made by a cut.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct NewCopy {
    /// Id of the new copy.
    pub copy: u32,
    /// The copy it was split from, or the nearest of those that it lies between.
    pub parent: u32,
    /// The earlier copies that it lies between, where refinement placed it inside an element.
    pub between: Option<MaterialPoint>,
}

impl NewCopy {
    /// Copy `copy`, split from `parent`.
    pub fn split(copy: u32, parent: u32) -> Self {
        Self { copy, parent, between: None }
    }

    /// The value that it inherits, of any quantity with one value per copy: position, velocity, warm start.
    pub fn inherited(&self, values: &[Vector3<f64>]) -> Vector3<f64> {
        self.between.map_or_else(|| values[self.parent as usize], |between| between.position(values))
    }

    /// Gives the copies `new` the values that they inherit, at their numbers. Values behind them move up.
    pub fn inherit(new: &[NewCopy], values: &mut Vec<Vector3<f64>>) {
        for run in new.chunk_by(|a, b| b.copy == a.copy + 1) {
            let behind = values.split_off(run[0].copy as usize);
            for copy in run {
                values.push(copy.inherited(values));
            }
            values.extend(behind);
        }
    }
}

/// The copies of all nodes, and the elements around every node.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct CopyTable {
    /// Mesh node of each copy. Copies 0..n_nodes are the nodes themselves.
    pub node: Vec<u32>,
    /// Σ over pieces of ∫ N_a dV [m³] per copy.
    pub volume: Vec<f64>,
    around: ElementsAround,
    /// Pieces whose copies changed since the caller last cleared this list. A piece may appear more than
    /// once.
    pub changed: Vec<u32>,
    visited: Vec<u32>,
    stamp: u32,
    stack: Vec<u32>,
    components: Vec<Around>,
    /// Scratch: pieces of all components, one component after the other.
    members: Vec<u32>,
}

/// A component of the pieces around one node.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
struct Around {
    /// Range of its pieces in `members`.
    members: std::ops::Range<usize>,
    parent: u32,
}

impl CopyTable {
    /// One copy per node, before [`update`](Self::update) examines the connectivity.
    pub(crate) fn new(mesh: &TetMesh, pieces: &PieceTable) -> Self {
        let n = mesh.nodes.len();
        let mut volume = vec![0.0; n];
        for (tet, node_volume) in mesh.tets.iter().zip(&pieces.node_volume) {
            for (&node, v) in tet.iter().zip(node_volume) {
                volume[node as usize] += v;
            }
        }
        Self {
            node: (0..n as u32).collect(),
            volume,
            around: ElementsAround::new(n, &mesh.tets),
            ..Self::default()
        }
    }

    /// Reserves memory for cuts through a body of `n_elements` elements.
    pub(crate) fn reserve_half_again(&mut self, n_elements: usize) {
        self.visited.resize(n_elements, 0);
        self.changed = reserved(n_elements / 8, 0);
        reserve_half_again(&mut self.node);
        reserve_half_again(&mut self.volume);
        reserve_half_again(&mut self.visited);
    }

    /// The copies of node `i` whose material contains the node itself, ascending. There is one, or more where
    /// a cut passes exactly through the node and each lip has it.
    pub(crate) fn with_node(
        &self,
        mesh: &TetMesh,
        i: u32,
        fragments: &Fragments,
        pieces: &PieceTable,
    ) -> Vec<u32> {
        let mut found = Vec::new();
        for &e in self.around.of(i) {
            let Some(a) = slot_of(&mesh.tets[e as usize], i) else { continue };
            for t in fragments.of_element(e) {
                let at_node = |&v: &u32| fragments.vertices[v as usize].nodes == [i, NONE, NONE, NONE];
                if fragments.tets[t as usize].iter().any(at_node) {
                    found.push(pieces.pieces[fragments.piece[t as usize] as usize].copies[a]);
                }
            }
        }
        found.sort_unstable();
        found.dedup();
        found
    }

    /// The elements around every node.
    pub(crate) fn elements_around(&self) -> &ElementsAround {
        &self.around
    }

    /// Copies of all pieces that use this copy.
    pub(crate) fn tets_around(&self, copy: u32, pieces: &PieceTable) -> Vec<[u32; 4]> {
        let elements = self.around.of(self.node[copy as usize]);
        let all =
            elements.iter().flat_map(|&e| pieces.of_element(e)).map(|p| pieces.pieces[p as usize].copies);
        all.filter(|copies| copies.contains(&copy)).collect()
    }

    /// Recomputes the copies of node `i` and appends the new ones to `new_copies`.
    pub(crate) fn update(
        &mut self,
        mesh: &TetMesh,
        i: u32,
        fragments: &Fragments,
        pieces: &mut PieceTable,
        new_copies: &mut Vec<NewCopy>,
    ) {
        self.find_components_around(mesh, i, fragments, pieces);
        let components = std::mem::take(&mut self.components);
        for (k, component) in components.iter().enumerate() {
            let parent = component.parent;
            let mut same = (0..components.len()).filter(|&c| components[c].parent == parent);
            let first = same.clone().next();
            // A component that keeps its copy to itself needs no search for the node.
            let alone = same.clone().nth(1).is_none();
            let heir = same.find(|&c| alone || self.holds_node(&components[c], i, fragments, pieces));
            let id = if heir.or(first) == Some(k) {
                self.volume[parent as usize] = 0.0;
                parent
            } else {
                let copy = self.node.len() as u32;
                self.node.push(i);
                self.volume.push(0.0);
                new_copies.push(NewCopy::split(copy, parent));
                copy
            };
            // Pieces of a new component change their copy; the volume of a copy is summed anew.
            for k in component.members.clone() {
                let p = self.members[k];
                let piece = &mut pieces.pieces[p as usize];
                if let Some(a) = slot_of(&mesh.tets[piece.element as usize], i) {
                    if piece.copies[a] != id {
                        piece.copies[a] = id;
                        self.changed.push(p);
                    }
                    self.volume[id as usize] += pieces.node_volume[p as usize][a];
                }
            }
        }
        self.components = components;
    }

    /// Whether the material of a component contains node `i` itself.
    fn holds_node(&self, component: &Around, i: u32, fragments: &Fragments, pieces: &PieceTable) -> bool {
        self.members[component.members.clone()]
            .iter()
            .any(|&p| pieces.fragments(p, fragments).any(|t| fragments.tets[t as usize].contains(&i)))
    }

    fn find_components_around(&mut self, mesh: &TetMesh, i: u32, fragments: &Fragments, pieces: &PieceTable) {
        self.stamp += 1;
        self.visited.resize(pieces.pieces.len(), 0);
        self.components.clear();
        self.members.clear();
        for k in self.around.range(i) {
            for seed in pieces.of_element(self.around.at(k)) {
                if self.visited[seed as usize] != self.stamp {
                    let component = self.flood(mesh, i, seed, fragments, pieces);
                    self.components.push(component);
                }
            }
        }
    }

    fn flood(
        &mut self,
        mesh: &TetMesh,
        i: u32,
        seed: u32,
        fragments: &Fragments,
        pieces: &PieceTable,
    ) -> Around {
        let first = &pieces.pieces[seed as usize];
        let a = slot_of(&mesh.tets[first.element as usize], i).unwrap_or(0);
        let start = self.members.len();
        let mut component = Around { members: start..start, parent: first.copies[a] };
        self.visited[seed as usize] = self.stamp;
        self.stack.push(seed);
        while let Some(p) = self.stack.pop() {
            self.members.push(p);
            for t in pieces.fragments(p, fragments) {
                for n in fragments.neighbour[t as usize] {
                    if n == NONE {
                        continue;
                    }
                    let q = fragments.piece[n as usize];
                    if self.visited[q as usize] != self.stamp
                        && slot_of(&mesh.tets[fragments.element[n as usize] as usize], i).is_some()
                    {
                        self.visited[q as usize] = self.stamp;
                        self.stack.push(q);
                    }
                }
            }
        }
        component.members.end = self.members.len();
        self.members[start..].sort_unstable();
        component
    }
}

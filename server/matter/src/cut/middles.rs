//! Copies of the nodes that quadratic elements have in the middle of edges: the connected components of the pieces
//! around an edge.
//!
//! Two pieces are linked where they share a closed fragment face on an element face that contains the edge. So
//! two pieces that are connected across an element face share the copies of all its corners and middles, and the
//! displacement is continuous there. The component with the material at the middle itself keeps the copy with the
//! number of the edge.

use crate::element::TET_EDGES;
use crate::mesh::Tet10Mesh;
use crate::storage::disjoint::{find, join};

use super::cut_mesh::CutMesh;
use super::topology::copies::NewCopy;
use super::topology::fragments::NONE;
use super::topology::slot::slot_of;

/// The copies of all mid-edge nodes, numbered apart from those of the corners.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct MiddleCopies {
    /// Edge of every copy, as numbered in [`Tet10Mesh::edges`]. Copies 0..n_edges are those of the uncut elements;
    /// cuts append the others.
    pub edge: Vec<u32>,
    /// Copies in the middle of the [`TET_EDGES`] of every piece.
    pub of_piece: Vec<[u32; 6]>,
}

/// The connected pieces around one edge.
struct Around {
    pieces: Vec<u32>,
    parent: u32,
}

impl MiddleCopies {
    /// Copies for the present state of `cut`, whose mesh has the mid-edge nodes of `quadratic`.
    pub fn new(quadratic: &Tet10Mesh, cut: &CutMesh) -> Self {
        let n_corners = quadratic.n_corners() as u32;
        let of_element = |tet: &[u32; 10]| std::array::from_fn(|k| tet[4 + k] - n_corners);
        let mut middles = Self {
            edge: (0..quadratic.edges.len() as u32).collect(),
            of_piece: quadratic.tets.iter().map(of_element).collect(),
        };
        middles.inherit(cut);
        for edge in 0..quadratic.edges.len() as u32 {
            middles.update(quadratic, cut, edge, &mut Vec::new());
        }
        middles
    }

    /// Follows the last cut of `cut`. Returns the copies that it made, ascending.
    pub fn follow(&mut self, quadratic: &Tet10Mesh, cut: &CutMesh) -> Vec<NewCopy> {
        let mut new = Vec::new();
        self.inherit(cut);
        let n_corners = quadratic.n_corners() as u32;
        let elements = cut.changed_pieces().iter().map(|&p| cut.pieces()[p as usize].element as usize);
        let mut edges: Vec<u32> = elements.flat_map(|e| quadratic.tets[e][4..].to_vec()).collect();
        edges.sort_unstable();
        edges.dedup();
        for middle in edges {
            self.update(quadratic, cut, middle - n_corners, &mut new);
        }
        new
    }

    /// Gives pieces that are new the copies of those they were split from.
    fn inherit(&mut self, cut: &CutMesh) {
        for p in self.of_piece.len()..cut.pieces().len() {
            self.of_piece.push(self.of_piece[cut.pieces.split_from[p] as usize]);
        }
    }

    /// Recomputes the copies of one mid-edge node and appends the new ones to `new`.
    fn update(&mut self, quadratic: &Tet10Mesh, cut: &CutMesh, edge: u32, new: &mut Vec<NewCopy>) {
        let ends = quadratic.edges[edge as usize];
        let around = self.components(cut, ends);
        for (k, component) in around.iter().enumerate() {
            let parent = component.parent;
            let mut same = (0..around.len()).filter(|&c| around[c].parent == parent);
            let first = same.clone().next();
            let alone = same.clone().nth(1).is_none();
            let heir = same.find(|&c| alone || around[c].pieces.iter().any(|&p| holds_middle(cut, p, ends)));
            if heir.or(first) == Some(k) {
                continue;
            }
            let copy = self.edge.len() as u32;
            self.edge.push(edge);
            new.push(NewCopy::split(copy, parent));
            for &p in &component.pieces {
                if let Some(slot) = edge_slot(cut, p, ends) {
                    self.of_piece[p as usize][slot] = copy;
                }
            }
        }
    }

    /// The connected components of the pieces around the edge between two nodes, by their lowest piece.
    fn components(&self, cut: &CutMesh, ends: [u32; 2]) -> Vec<Around> {
        let pieces = pieces_around(cut, ends);
        let mut root: Vec<u32> = (0..pieces.len() as u32).collect();
        for (i, &p) in (0u32..).zip(&pieces) {
            for t in cut.pieces.fragments(p, &cut.fragments) {
                for n in cut.fragments.neighbour[t as usize] {
                    if n != NONE
                        && let Ok(j) = pieces.binary_search(&cut.fragments.piece[n as usize])
                    {
                        join(&mut root, i, j as u32);
                    }
                }
            }
        }
        let mut around: Vec<(u32, Around)> = Vec::new();
        for (i, &p) in (0u32..).zip(&pieces) {
            let root = find(&mut root, i);
            match around.iter_mut().find(|(known, _)| *known == root) {
                Some((_, component)) => component.pieces.push(p),
                None => {
                    let slot = edge_slot(cut, p, ends).unwrap_or(0);
                    let parent = self.of_piece[p as usize][slot];
                    around.push((root, Around { pieces: vec![p], parent }));
                }
            }
        }
        around.into_iter().map(|(_, component)| component).collect()
    }

    /// The copies of mid-edge node `edge` whose material contains its place, ascending.
    pub fn with_middle(&self, quadratic: &Tet10Mesh, cut: &CutMesh, edge: u32) -> Vec<u32> {
        let ends = quadratic.edges[edge as usize];
        let holding = pieces_around(cut, ends).into_iter().filter(|&p| holds_middle(cut, p, ends));
        let copy = |p: u32| edge_slot(cut, p, ends).map(|slot| self.of_piece[p as usize][slot]);
        let mut found: Vec<u32> = holding.filter_map(copy).collect();
        found.sort_unstable();
        found.dedup();
        found
    }
}

/// The pieces of all elements that have the edge between two nodes, ascending.
fn pieces_around(cut: &CutMesh, [a, b]: [u32; 2]) -> Vec<u32> {
    let elements = cut.elements_around().of(a).iter();
    let with_edge = elements.filter(|&&e| slot_of(&cut.mesh().tets[e as usize], b).is_some());
    let mut pieces: Vec<u32> = with_edge.flat_map(|&e| cut.pieces.of_element(e)).collect();
    pieces.sort_unstable();
    pieces
}

/// Which of the [`TET_EDGES`] of piece `p` runs between two nodes.
fn edge_slot(cut: &CutMesh, p: u32, [a, b]: [u32; 2]) -> Option<usize> {
    let tet = &cut.mesh().tets[cut.pieces()[p as usize].element as usize];
    let (a, b) = (slot_of(tet, a)?, slot_of(tet, b)?);
    TET_EDGES.iter().position(|&edge| edge == [a, b] || edge == [b, a])
}

/// How far, as a part of the edge, a cut may pass by the middle and count as exactly through it.
const ROUNDING: f64 = 1e-9;

/// Whether the material of piece `p` contains the middle between two nodes.
fn holds_middle(cut: &CutMesh, p: u32, [a, b]: [u32; 2]) -> bool {
    let fragments = &cut.fragments;
    cut.pieces.fragments(p, fragments).any(|t| {
        let (mut least, mut greatest) = (f64::INFINITY, f64::NEG_INFINITY);
        for v in fragments.tets[t as usize] {
            let vertex = &fragments.vertices[v as usize];
            let others =
                |(&node, &weight): (&u32, &f64)| node != a && node != b && node != NONE && weight != 0.0;
            if !vertex.nodes.iter().zip(&vertex.weights).any(others) {
                let along = vertex.weight_of(b);
                (least, greatest) = (least.min(along), greatest.max(along));
            }
        }
        least <= 0.5 + ROUNDING && greatest >= 0.5 - ROUNDING && least < greatest
    })
}

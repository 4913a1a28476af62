//! Material pieces: the face-connected components of the fragments of one element.

use crate::mesh::TetMesh;
use crate::storage::reserve::reserve_half_again;

use super::fragments::{Fragments, NONE};
use super::slot::slot_of;

/// One connected piece of material inside one element. Mechanics treats it as an element.
///
/// A linear tet has a constant deformation gradient per piece, so its energy, force and stiffness
/// are those of the whole element on the piece's own copies, times `fraction`.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Piece {
    /// Element of the rest mesh.
    pub element: u32,
    /// Volume of the piece over the volume of the element, in (0, 1]; Σ = 1 per element.
    pub fraction: f64,
    /// Copy of each of the four element nodes.
    pub copies: [u32; 4],
}

/// All pieces. Piece e < n_elements is the first of element e; cuts append the others.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct PieceTable {
    /// The pieces by id. No id ever changes.
    pub pieces: Vec<Piece>,
    /// ∫ N_a dV [m³] over each piece.
    pub node_volume: Vec<[f64; 4]>,
    /// First fragment of each piece; the others follow by [`Fragments::next_in_piece`].
    pub first_fragment: Vec<u32>,
    /// Next piece of the same element.
    pub next_in_element: Vec<u32>,
    /// The piece that each piece was split from; itself if it was there from the start.
    pub split_from: Vec<u32>,
    element_volume: Vec<f64>,
    label: Vec<u32>,
    stack: Vec<u32>,
    members: Vec<u32>,
    /// Scratch: present pieces of an element, each with the piece it was part of before.
    kept: Vec<[u32; 2]>,
}

impl PieceTable {
    /// One whole piece per element.
    pub(crate) fn new(mesh: &TetMesh) -> Self {
        let element_volume = mesh.volumes();
        let mut table = Self {
            pieces: (0u32..)
                .zip(&mesh.tets)
                .map(|(element, &copies)| Piece { element, fraction: 1.0, copies })
                .collect(),
            node_volume: element_volume.iter().map(|v| [v / 4.0; 4]).collect(),
            first_fragment: (0..mesh.tets.len() as u32).collect(),
            next_in_element: vec![NONE; mesh.tets.len()],
            split_from: (0..mesh.tets.len() as u32).collect(),
            element_volume,
            label: vec![NONE; mesh.tets.len()],
            stack: Vec::new(),
            members: Vec::new(),
            kept: Vec::new(),
        };
        reserve_half_again(&mut table.pieces);
        reserve_half_again(&mut table.node_volume);
        reserve_half_again(&mut table.first_fragment);
        reserve_half_again(&mut table.next_in_element);
        reserve_half_again(&mut table.split_from);
        reserve_half_again(&mut table.label);
        table
    }

    /// Pieces of element `e`, the first one first.
    pub(crate) fn of_element(&self, e: u32) -> impl Iterator<Item = u32> + '_ {
        std::iter::successors(Some(e), |&p| Some(self.next_in_element[p as usize]).filter(|&n| n != NONE))
    }

    /// Fragments of piece `p`.
    pub(crate) fn fragments<'a>(
        &'a self,
        p: u32,
        fragments: &'a Fragments,
    ) -> impl Iterator<Item = u32> + 'a {
        std::iter::successors(Some(self.first_fragment[p as usize]), |&t| {
            Some(fragments.next_in_piece[t as usize]).filter(|&n| n != NONE)
        })
    }

    /// Recomputes the pieces of element `e` from its fragments. Components only ever become finer: one
    /// component of an old piece keeps its id, and the others are appended with the same copies. Pieces that
    /// came apart are appended to `changed`, together with the parts that they became.
    pub(crate) fn update(
        &mut self,
        mesh: &TetMesh,
        e: u32,
        fragments: &mut Fragments,
        changed: &mut Vec<u32>,
    ) {
        let first = changed.len();
        let mut members = std::mem::take(&mut self.members);
        members.clear();
        members.extend(fragments.of_element(e));
        self.label.resize(fragments.tets.len(), NONE);
        for &t in &members {
            self.label[t as usize] = NONE;
        }
        let mut kept = std::mem::take(&mut self.kept);
        kept.clear();
        for &seed in &members {
            if self.label[seed as usize] != NONE {
                continue;
            }
            let old = fragments.piece[seed as usize];
            let id = if kept.iter().any(|k| k[0] == old) { self.append_like(old) } else { old };
            kept.push([id, old]);
            self.flood(seed, id, fragments);
        }
        // Only pieces that came apart have to be measured again.
        for &[p, old] in &kept {
            self.first_fragment[p as usize] = NONE;
            if kept.iter().filter(|k| k[1] == old).count() > 1 {
                changed.push(p);
            }
        }
        // In reverse, since every fragment goes to the head of the list of its piece.
        for &t in members.iter().rev() {
            let p = self.label[t as usize];
            fragments.piece[t as usize] = p;
            fragments.next_in_piece[t as usize] = self.first_fragment[p as usize];
            self.first_fragment[p as usize] = t;
        }
        for k in first..changed.len() {
            self.measure(mesh, changed[k], fragments);
        }
        (self.members, self.kept) = (members, kept);
    }

    /// Computes the fraction and ∫ N_a dV of piece `p` from its fragments.
    fn measure(&mut self, mesh: &TetMesh, p: u32, fragments: &Fragments) {
        let e = self.pieces[p as usize].element as usize;
        let nodes = mesh.tets[e];
        let (mut fraction, mut integral) = (0.0, [0.0; 4]);
        for t in self.fragments(p, fragments) {
            let part = fragments.fraction[t as usize];
            fraction += part;
            for v in fragments.tets[t as usize] {
                let vertex = &fragments.vertices[v as usize];
                let weights = vertex.nodes.into_iter().zip(vertex.weights);
                for (node, weight) in weights.take_while(|w| w.0 != NONE) {
                    if let Some(a) = slot_of(&nodes, node) {
                        integral[a] += part * weight;
                    }
                }
            }
        }
        self.pieces[p as usize].fraction = fraction;
        self.node_volume[p as usize] = integral.map(|sum| 0.25 * self.element_volume[e] * sum);
    }

    /// Labels all fragments of one element that closed faces connect with `seed`.
    fn flood(&mut self, seed: u32, id: u32, fragments: &Fragments) {
        let e = fragments.element[seed as usize];
        self.label[seed as usize] = id;
        self.stack.push(seed);
        while let Some(t) = self.stack.pop() {
            for n in fragments.neighbour[t as usize] {
                if n != NONE && fragments.element[n as usize] == e && self.label[n as usize] == NONE {
                    self.label[n as usize] = id;
                    self.stack.push(n);
                }
            }
        }
    }

    fn append_like(&mut self, old: u32) -> u32 {
        let id = self.pieces.len() as u32;
        self.pieces.push(self.pieces[old as usize]);
        self.node_volume.push([0.0; 4]);
        self.first_fragment.push(NONE);
        self.next_in_element.push(self.next_in_element[old as usize]);
        self.next_in_element[old as usize] = id;
        self.split_from.push(old);
        id
    }

    /// ∫ N_a N_b dV [m³] over piece `p`. A fragment T with corner values N(v) contributes |T|/20 Σ_v Σ_w
    /// N_a(v) N_b(w) (1 + δ_vw).
    pub(crate) fn node_products(&self, mesh: &TetMesh, p: u32, fragments: &Fragments) -> [[f64; 4]; 4] {
        let e = self.pieces[p as usize].element as usize;
        let nodes = mesh.tets[e];
        let mut M = [[0.0; 4]; 4];
        for t in self.fragments(p, fragments) {
            let N = fragments.tets[t as usize]
                .map(|v| nodes.map(|node| fragments.vertices[v as usize].weight_of(node)));
            let sum: [f64; 4] = std::array::from_fn(|a| N.iter().map(|n| n[a]).sum());
            let scale = fragments.fraction[t as usize] * self.element_volume[e] / 20.0;
            for a in 0..4 {
                for b in 0..4 {
                    let same: f64 = N.iter().map(|n| n[a] * n[b]).sum();
                    M[a][b] += scale * (sum[a] * sum[b] + same);
                }
            }
        }
        M
    }

    /// Rest volume [m³] of piece `p`.
    pub(crate) fn volume(&self, p: usize) -> f64 {
        let piece = &self.pieces[p];
        piece.fraction * self.element_volume[piece.element as usize]
    }
}

//! Material pieces: the face-connected components of the fragments of one element.

use crate::mesh::TetMesh;

use super::fragments::{Fragments, NONE};

/// One connected piece of material inside one element: what mechanics sees as an element.
///
/// A linear tet has a constant deformation gradient per piece, so its energy, force and stiffness
/// are those of the whole element on the piece's own copies, times `fraction`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    /// Element of the rest mesh.
    pub element: u32,
    /// Volume of the piece over the volume of the element, in (0, 1]; Σ = 1 per element.
    pub fraction: f64,
    /// Copy of each of the four element nodes.
    pub copies: [u32; 4],
}

/// All pieces. Piece e < n_elements is the first of element e; later ones are appended.
#[derive(Clone, Debug, Default)]
pub struct PieceTable {
    /// The pieces.
    pub pieces: Vec<Piece>,
    /// ∫ N_a dV [m³] over each piece.
    pub node_volume: Vec<[f64; 4]>,
    /// First fragment of each piece; the others follow by [`Fragments::next_in_piece`].
    pub first_fragment: Vec<u32>,
    /// Next piece of the same element.
    pub next_in_element: Vec<u32>,
    element_volume: Vec<f64>,
    label: Vec<u32>,
    stack: Vec<u32>,
}

impl PieceTable {
    /// One whole piece per element.
    pub fn new(mesh: &TetMesh) -> Self {
        let element_volume = mesh.volumes();
        Self {
            pieces: (0u32..)
                .zip(&mesh.tets)
                .map(|(element, &copies)| Piece { element, fraction: 1.0, copies })
                .collect(),
            node_volume: element_volume.iter().map(|v| [v / 4.0; 4]).collect(),
            first_fragment: (0..mesh.tets.len() as u32).collect(),
            next_in_element: vec![NONE; mesh.tets.len()],
            element_volume,
            label: Vec::new(),
            stack: Vec::new(),
        }
    }

    /// Pieces of element `e`.
    pub fn of_element(&self, e: u32) -> impl Iterator<Item = u32> + '_ {
        std::iter::successors(Some(e), |&p| Some(self.next_in_element[p as usize]).filter(|&n| n != NONE))
    }

    /// Fragments of piece `p`.
    pub fn fragments<'a>(&'a self, p: u32, fragments: &'a Fragments) -> impl Iterator<Item = u32> + 'a {
        std::iter::successors(Some(self.first_fragment[p as usize]), |&t| {
            Some(fragments.next_in_piece[t as usize]).filter(|&n| n != NONE)
        })
    }

    /// Recomputes the pieces of element `e` from its fragments. Components only ever refine: one
    /// component of an old piece keeps its id, the others are appended with the same copies.
    pub fn update(&mut self, mesh: &TetMesh, e: u32, fragments: &mut Fragments) {
        let members: Vec<u32> = fragments.of_element(e).collect();
        self.label.resize(fragments.tets.len(), NONE);
        for &t in &members {
            self.label[t as usize] = NONE;
        }
        let mut kept: Vec<u32> = Vec::new();
        for &seed in &members {
            if self.label[seed as usize] != NONE {
                continue;
            }
            let old = fragments.piece[seed as usize];
            let id = if kept.contains(&old) { self.append_like(old) } else { old };
            kept.push(id);
            self.flood(seed, id, fragments);
        }
        for &p in &kept {
            self.first_fragment[p as usize] = NONE;
            self.pieces[p as usize].fraction = 0.0;
            self.node_volume[p as usize] = [0.0; 4];
        }
        let nodes = mesh.tets[e as usize];
        for &t in members.iter().rev() {
            let p = self.label[t as usize];
            fragments.piece[t as usize] = p;
            fragments.next_in_piece[t as usize] = self.first_fragment[p as usize];
            self.first_fragment[p as usize] = t;
            let fraction = fragments.fraction[t as usize];
            self.pieces[p as usize].fraction += fraction;
            let quarter = 0.25 * fraction * self.element_volume[e as usize];
            for v in fragments.tets[t as usize] {
                for (sum, &node) in self.node_volume[p as usize].iter_mut().zip(&nodes) {
                    *sum += quarter * fragments.vertices[v as usize].weight_of(node);
                }
            }
        }
    }

    /// Labels everything reachable from `seed` inside its element through closed faces.
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
        id
    }

    /// ∫ N_a N_b dV [m³] over piece `p`: over a fragment T with corner values N(v) it is
    /// |T|/20 Σ_v Σ_w N_a(v) N_b(w) (1 + δ_vw).
    pub fn node_products(&self, mesh: &TetMesh, p: u32, fragments: &Fragments) -> [[f64; 4]; 4] {
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
    pub fn volume(&self, p: usize) -> f64 {
        let piece = &self.pieces[p];
        piece.fraction * self.element_volume[piece.element as usize]
    }
}

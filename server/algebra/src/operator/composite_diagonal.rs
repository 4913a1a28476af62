//! Diagonal blocks of TᵀA T for the copies that others are moved relative to.
//!
//! They are computed from the pieces' gradients in the new variables. The blocks of A would cancel: the
//! stiff parts of A are 1/ε times as large as what remains of them.

use scindo_matter::team::{Team, blocks};

use super::stiffness::{ElasticUpdate, Place, Stiffness};
use super::tet_batch::Block6;
use super::{StiffModes, Substitution};

/// Copies per unit of work.
const UNIT: usize = 16;

/// The blocks, and the terms they are summed from.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct CompositeDiagonal {
    copies: Vec<Copy>,
    terms: Vec<Term>,
    blocks: Vec<Block6>,
}

#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
struct Copy {
    copy: u32,
    /// Its part of `terms`.
    terms: std::ops::Range<usize>,
    /// Copies that move with it, itself included, and the squares of how far.
    moved: Vec<(u32, f64)>,
}

/// Contribution of one piece to one block.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
struct Term {
    place: Place,
    /// √(w V) times the gradient in the new variables, at rest.
    g: [f32; 3],
}

impl CompositeDiagonal {
    /// The blocks of the substitution `T` of `modes`, with the pieces arranged as in `elastic`.
    pub fn new(modes: &StiffModes, T: &Substitution, elastic: &dyn Stiffness) -> Self {
        let places = elastic.places();
        let copies = T.columns().map(|(copy, column)| {
            let moved = column.iter().map(|&(a, w)| (a, w * w)).collect();
            Copy { copy, terms: 0..0, moved }
        });
        let mut copies: Vec<Copy> = copies.collect();
        let mut terms: Vec<(usize, Term)> = Vec::new();
        let mut row = Vec::new();
        for piece in modes.near() {
            row.clear();
            row.extend(piece.copies.iter().copied().zip(piece.g));
            T.gather(&mut row);
            for (copy, g) in &row {
                if let Ok(at) = copies.binary_search_by_key(copy, |c| c.copy) {
                    let g = (piece.volume.sqrt() * g).map(|g| g as f32).into();
                    terms.push((at, Term { place: places[piece.piece as usize], g }));
                }
            }
        }
        terms.sort_by_key(|t| t.0); // stable: pieces stay in order
        for (at, copy) in copies.iter_mut().enumerate() {
            copy.terms = terms.partition_point(|t| t.0 < at)..terms.partition_point(|t| t.0 <= at);
        }
        let blocks = vec![[0.0; 8]; copies.len()];
        Self { copies, terms: terms.into_iter().map(|t| t.1).collect(), blocks }
    }

    /// Writes the blocks of TᵀA T, A = `factor` M + s K̂ as `elastic` was last updated with `with`,
    /// over those of A in `diagonal`.
    pub fn update(
        &mut self,
        team: &mut Team,
        (elastic, with): (&dyn Stiffness, &ElasticUpdate),
        (mass, factor): (&[f32], f64),
        diagonal: &mut [Block6],
    ) {
        let Self { copies, terms, blocks: results } = self;
        let (mu, ratio) = (with.lame.mu, 0.5 * with.lame.lambda / with.lame.mu);
        let two_mu = (2.0 * mu * with.scale) as f32;
        let outer = 0.5 + ratio as f32;
        team.for_blocks(blocks(results, UNIT), |unit, results| {
            for (result, copy) in results.iter_mut().zip(&copies[unit * UNIT..]) {
                let mut sum = [0.0_f32; 6];
                for term in &terms[copy.terms.clone()] {
                    let R = elastic.rotation(term.place);
                    let g = R * nalgebra::Vector3::from(term.g);
                    let isotropic = 0.5 * g.norm_squared();
                    for (k, (i, j)) in PAIRS.into_iter().enumerate() {
                        sum[k] += outer * g[i] * g[j] + if i == j { isotropic } else { 0.0 };
                    }
                }
                let moved: f64 = copy.moved.iter().map(|&(a, w)| w * f64::from(mass[a as usize])).sum();
                let m = (factor * moved) as f32;
                let [xx, xy, xz, yy, yz, zz] = sum.map(|k| two_mu * k);
                *result = [xx + m, xy, xz, 0.0, yy + m, yz, zz + m, 0.0];
            }
        });
        for (copy, block) in copies.iter().zip(results) {
            diagonal[copy.copy as usize] = *block;
        }
    }

    /// The copies whose blocks these are, ascending.
    pub fn copies(&self) -> impl Iterator<Item = u32> {
        self.copies.iter().map(|c| c.copy)
    }
}

const PAIRS: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

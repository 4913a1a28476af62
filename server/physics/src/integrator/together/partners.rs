//! Nodes that stiff springs tie together, as blocks of the preconditioner.
//!
//! # Derivation
//! A spring s k J Jᵀ between two nodes with blocks D_a and D_b adds s k to both diagonals. Where s k is several times as
//! large as D, as in contact, blocks of single nodes then take every motion for a stiff one, also that of both nodes
//! together, which the spring does not resist: conditioning falls to D / (D + s k). The block of both nodes knows the
//! difference,
//!
//!   | D_a + Σ s k w_a²   −Σ s k w_a w_b   |
//!   | −Σ s k w_a w_b     D_b + Σ s k w_b² |
//!
//! It is a principal block of the matrix, hence positive definite. Every node has one partner at most: the one to which
//! it is tied most. On a wound with 2,000 triangles on its lips this saves up to a quarter of the iterations.

use nalgebra::{Matrix3, Matrix6, Vector6};

use super::{Member, Members};
use crate::integrator::pair_springs::ActivePair;

/// No partner.
const NONE: u32 = u32::MAX;

/// Product of weights below which two nodes are not tied.
const LEAST_TIE: f64 = 0.05;

/// Ties of a spring for which room is made: those between a node and the corners of a triangle whose edges are cut.
const TIES: usize = 6;

/// A body and a node of it.
type Node = (u32, u32);

/// Nodes that are tied to each other.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Partners {
    ties: Vec<(Node, Node, f64)>,
    chosen: Vec<[Node; 2]>,
    /// Those of the present modes.
    blocks: Vec<Block>,
    /// Per body and node the number of its block, while they are made.
    number: Vec<Vec<u32>>,
}

/// Two partners.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
struct Block {
    nodes: [Node; 2],
    /// Off-diagonal block.
    off: Matrix3<f64>,
    /// Inverse of the whole block.
    inverse: Matrix6<f32>,
}

impl Partners {
    /// Chooses the partners of a step among the nodes of springs that begin it in contact, the stiffest ties first.
    pub(super) fn choose(&mut self, members: &[Member<'_>], pairs: &[ActivePair]) {
        let Self { ties, chosen, number, .. } = self;
        chosen.clear();
        ties.clear();
        // Whatever closes later in a steady motion has room.
        chosen.reserve(pairs.len());
        ties.reserve(TIES * pairs.len());
        for pair in pairs.iter().filter(|pair| pair.law.stiffness() != Matrix3::zeros()) {
            for (i, a) in pair.carriers.iter().enumerate() {
                // Weights of both signs: the nodes are on both sides of the spring.
                let others = pair.carriers[i + 1..].iter().filter(|b| a.weight * b.weight < -LEAST_TIE);
                let stiffness = pair.law.stiffness_n_m();
                ties.extend(others.map(|b| {
                    let (first, second) = ((a.body, a.copy), (b.body, b.copy));
                    (first.min(second), first.max(second), -a.weight * b.weight * stiffness)
                }));
            }
        }
        ties.sort_unstable_by_key(|(a, b, _)| (*a, *b));
        ties.dedup_by(|next, sum| {
            let same = (sum.0, sum.1) == (next.0, next.1);
            sum.2 += if same { next.2 } else { 0.0 };
            same
        });
        ties.sort_unstable_by(|a, b| b.2.total_cmp(&a.2).then((a.0, a.1).cmp(&(b.0, b.1))));
        number.resize_with(members.len(), Vec::new);
        for (of, member) in number.iter_mut().zip(members) {
            of.resize(member.state.x.len(), NONE);
        }
        for (a, b, _) in ties.iter() {
            let is_free = |node: &Node| number[node.0 as usize][node.1 as usize] == NONE;
            if is_free(a) && is_free(b) {
                for node in [a, b] {
                    number[node.0 as usize][node.1 as usize] = chosen.len() as u32;
                }
                chosen.push([*a, *b]);
            }
        }
    }

    /// Forgets the partners of the step.
    pub(super) fn end(&mut self) {
        for (body, node) in self.chosen.drain(..).flatten() {
            self.number[body as usize][node as usize] = NONE;
        }
        self.blocks.clear();
    }

    /// Makes the blocks for the present modes of `pairs`. The blocks of single nodes must be up to date; `s` is the
    /// factor of the stiffness of each body.
    pub(super) fn arrange(&mut self, members: &[Member<'_>], pairs: &[ActivePair], s: impl Fn(u32) -> f64) {
        let Self { chosen, blocks, number, .. } = self;
        blocks.clear();
        if members.iter().any(|member| !member.step.has_single_blocks()) {
            return;
        }
        let (off, inverse) = (Matrix3::zeros(), Matrix6::zeros());
        blocks.extend(chosen.iter().map(|&nodes| Block { nodes, off, inverse }));
        for pair in pairs {
            let stiffness = s(pair.main[0].0) * pair.law.stiffness();
            if stiffness == Matrix3::zeros() {
                continue;
            }
            for (i, a) in pair.carriers.iter().enumerate() {
                let Some(block) = blocks.get_mut(number[a.body as usize][a.copy as usize] as usize) else {
                    continue;
                };
                let other = block.nodes[usize::from(block.nodes[0] == (a.body, a.copy))];
                if let Some(b) = pair.carriers[i + 1..].iter().find(|b| (b.body, b.copy) == other) {
                    block.off += a.weight * b.weight * stiffness;
                }
            }
        }
        blocks.retain_mut(|block| block.off != Matrix3::zeros() && block.invert(members).is_some());
    }

    /// Replaces z = M⁻¹ r of all partners; returns by how much rᵀz changed.
    pub(super) fn precondition(&self, members: Members<'_, '_>) -> f64 {
        let mut change = 0.0;
        for Block { nodes, inverse, .. } in &self.blocks {
            let mut r = Vector6::zeros();
            for (side, &(body, node)) in nodes.iter().enumerate() {
                let of = members[body as usize].step.residual_of(node);
                (0..3).for_each(|k| r[3 * side + k] = of[k]);
            }
            let z = inverse * r;
            for (side, &(body, node)) in nodes.iter().enumerate() {
                let of = members[body as usize].step.preconditioned_of(node);
                for k in 0..3 {
                    let (r, new) = (f64::from(r[3 * side + k]), z[3 * side + k]);
                    change += r * (f64::from(new) - f64::from(of[k]));
                    of[k] = new;
                }
            }
        }
        change
    }
}

impl Block {
    /// Inverts the block by way of its Schur complement S = B − Oᵀ A⁻¹ O, of the blocks A and B of the nodes and O
    /// between them; `None` if a node is held or the numbers do not let it.
    fn invert(&mut self, members: &[Member<'_>]) -> Option<()> {
        let single = |(body, node): Node| members[body as usize].step.single_block(node);
        let ([_, a], [B, _]) = (single(self.nodes[0])?, single(self.nodes[1])?);
        let O = self.off;
        let along = a * O;
        let S = B - O.transpose() * along;
        let scale = S.trace();
        let b = (S / scale).cholesky()?.inverse() / scale;
        let across = -along * b;
        let whole = a - across * along.transpose();
        let mut write = |row: usize, column: usize, block: Matrix3<f64>| {
            self.inverse.fixed_view_mut::<3, 3>(row, column).copy_from(&block.map(|m| m as f32));
        };
        write(0, 0, whole);
        write(0, 3, across);
        write(3, 0, across.transpose());
        write(3, 3, b);
        (scale > 0.0 && self.inverse.iter().all(|m| m.is_finite())).then_some(())
    }
}

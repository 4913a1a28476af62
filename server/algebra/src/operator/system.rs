//! The matrix of one implicit step: A = (1 + hα) M + (h² + hβ) K̂ + h² Σ k J Jᵀ, with fixed copies
//! filtered out.

use scindo_matter::element::{FixedCopy, MaterialPoint};
use scindo_matter::team::{Team, blocks};

use super::stiffness::{Direction, Stiffness};
use super::{Advance, BLOCK, Block6, LinearOperator, Padded, Substitution, block_of};

/// Stiffness along `direction` between a material point and the world, or in all directions.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Spring {
    /// The material point that it pulls at.
    pub point: MaterialPoint<f32>,
    /// Unit vector of the stiff direction, or `None` if all three are stiff.
    pub direction: Option<[f32; 3]>,
    /// Factor of J Jᵀ in the operator: h² k.
    pub stiffness: f32,
}

/// A of one step, as an operator that borrows its parts.
#[derive(Debug)]
pub struct SystemOperator<'a> {
    /// (h² + hβ) K̂.
    pub elastic: &'a mut dyn Stiffness,
    /// Mass of every copy [kg].
    pub mass: &'a [f32],
    /// 1 + hα.
    pub mass_factor: f32,
    /// Springs that are under load in this step.
    pub springs: &'a [Spring],
    /// Prescribed copies.
    pub fixed: &'a [FixedCopy],
}

impl LinearOperator for SystemOperator<'_> {
    fn apply(&mut self, team: &mut Team, x: &[Padded], y: &mut [Padded]) {
        self.elastic.multiply(team, x);
        let A = &*self;
        team.for_blocks(blocks(y, BLOCK), |block, y| A.without_springs(block, block_of(x, block), y));
        for spring in self.springs {
            spring.add_to(x, y);
        }
        filter(self.fixed, y);
    }

    fn start(&mut self, team: &mut Team, x: &[Padded]) -> bool {
        debug_assert!(self.fixed.is_sorted_by_key(|f| f.copy));
        // Springs join copies of any blocks.
        let halves = self.springs.is_empty();
        if halves {
            self.elastic.multiply(team, x);
        }
        halves
    }

    fn finish(&self, block: usize, x: &[Padded], y: &mut [Padded]) {
        self.without_springs(block, x, y);
        filter_block(self.fixed, block, y);
    }

    fn advance(&mut self, team: &mut Team, beta: f32, z: &[Padded], out: Advance<'_>) -> f64 {
        let Advance { p, q, partial } = out;
        self.elastic.multiply_direction(team, z, beta);
        let elastic = &*self.elastic;
        let with = Direction { z, beta, mass: self.mass, factor: self.mass_factor };
        let state = (blocks(p, BLOCK), blocks(q, BLOCK), blocks(partial, 1));
        team.for_blocks(state, |block, (p, q, partial)| {
            partial[0] = elastic.advance(block, &with, p, q);
        });
        let springs: f64 = self.springs.iter().map(|spring| spring.add_to(p, q)).sum();
        filter(self.fixed, q); // p is 0 there
        partial.iter().sum::<f64>() + springs
    }
}

impl SystemOperator<'_> {
    /// y = A x of a block without springs and before prescribed directions are filtered out.
    #[inline(always)]
    fn without_springs(&self, block: usize, x: &[Padded], y: &mut [Padded]) {
        let factor = self.mass_factor;
        for (y, (x, &mass)) in y.iter_mut().zip(x.iter().zip(block_of(self.mass, block))) {
            *y = x.map(|v| factor * mass * v);
        }
        self.elastic.add_products(block, y);
    }

    /// Adds the springs to the diagonal blocks of (1 + hα) M + (h² + hβ) K̂, which gives those of A.
    pub fn add_springs(&self, diagonal: &mut [Block6]) {
        for spring in self.springs {
            for (copy, w) in spring.point.carriers() {
                spring.add_to_block(w, &mut diagonal[copy]);
            }
        }
    }
}

impl Spring {
    /// Σ w x of the carriers.
    fn moved(&self, x: &[Padded]) -> [f32; 3] {
        let mut p = [0.0; 3];
        for (copy, w) in self.point.carriers() {
            for (p, x) in p.iter_mut().zip(&x[copy]) {
                *p += w * x;
            }
        }
        p
    }

    /// Adds k w² n nᵀ, or k w² in all directions, to the diagonal block of a copy with weight `w`.
    pub fn add_to_block(&self, w: f32, block: &mut Block6) {
        let n = |i: usize, j: usize| match self.direction {
            Some(n) => n[i] * n[j],
            None => f32::from(u8::from(i == j)),
        };
        for (k, i, j) in [(0, 0, 0), (1, 0, 1), (2, 0, 2), (4, 1, 1), (5, 1, 2), (6, 2, 2)] {
            block[k] += self.stiffness * w * w * n(i, j);
        }
    }

    /// The copies and their weights in the variables of a substitution, each once.
    pub fn expand(&self, T: &Substitution, row: &mut Vec<(u32, f64)>) {
        row.clear();
        for (copy, w) in self.point.carriers() {
            match row.iter_mut().find(|r| r.0 as usize == copy) {
                Some(found) => found.1 += f64::from(w),
                None => row.push((copy as u32, f64::from(w))),
            }
        }
        T.gather(row);
    }

    /// y += k J Jᵀ x. Returns xᵀ k J Jᵀ x, which is k (n·p)² or k |p|² of the point's displacement p.
    #[inline]
    pub fn add_to(&self, x: &[Padded], y: &mut [Padded]) -> f64 {
        let p = self.moved(x);
        let dot = |n: &[f32; 3]| (0..3).map(|i| f64::from(n[i]) * f64::from(p[i])).sum::<f64>();
        let (f, squared) = match &self.direction {
            Some(n) => {
                let along = self.stiffness * (n[0] * p[0] + n[1] * p[1] + n[2] * p[2]);
                (n.map(|n| along * n), dot(n).powi(2))
            }
            None => (p.map(|p| self.stiffness * p), dot(&p)),
        };
        for (copy, w) in self.point.carriers() {
            for (y, f) in y[copy].iter_mut().zip(&f) {
                *y += w * f;
            }
        }
        f64::from(self.stiffness) * squared
    }
}

/// Sets the prescribed directions of `v` to 0.
pub fn filter(fixed: &[FixedCopy], v: &mut [Padded]) {
    for copy in fixed {
        copy.held.clear_padded(&mut v[copy.copy as usize]);
    }
}

/// The same of the entries `v` of block number `block`, where `fixed` is ascending.
pub fn filter_block(fixed: &[FixedCopy], block: usize, v: &mut [Padded]) {
    let (first, end) = (block * BLOCK, block * BLOCK + v.len());
    let begin = fixed.partition_point(|f| (f.copy as usize) < first);
    for copy in fixed[begin..].iter().take_while(|f| (f.copy as usize) < end) {
        copy.held.clear_padded(&mut v[copy.copy as usize - first]);
    }
}

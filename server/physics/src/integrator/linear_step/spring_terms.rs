//! Springs in the operator of a step, and the modes in which a solve takes them.

use super::{LinearStep, SPRING_PASSES, system};
use crate::integrator::active_springs::make_room;
use crate::integrator::springs::ActiveSpring;
use crate::integrator::step_inputs::LinearInputs;
use nalgebra::Matrix3;
use scindo_algebra::operator::{Block6, Spring, Stiffness};
use scindo_matter::element::MaterialPoint;

/// A spring on one node, to see on which nodes it acts in other variables.
fn at_node(copy: u32) -> Spring {
    Spring { point: MaterialPoint::new([(copy, 1.0)]), direction: None, stiffness: 1.0 }
}

/// Adds a symmetric matrix to a block of the diagonal.
fn add(matrix: Matrix3<f64>, block: &mut Block6) {
    let m = matrix.map(|m| m as f32);
    for (sum, m) in block.iter_mut().zip([m.m11, m.m12, m.m13, 0.0, m.m22, m.m23, m.m33, 0.0]) {
        *sum += m;
    }
}

impl LinearStep {
    /// Adds the springs to the operator and to the preconditioner.
    pub(super) fn complete_operator(&mut self, elastic: &mut dyn Stiffness, inputs: &LinearInputs<'_>) {
        self.terms.clear();
        // A spring has two terms at most, each on four nodes.
        let springs = self.springs.springs.len();
        make_room(&mut self.terms, springs, 2);
        make_room(&mut self.sprung, springs, 8);
        make_room(&mut self.bare, springs, 8);
        self.terms.extend(self.springs.springs.iter().flat_map(|s| s.terms(inputs.s())));
        let held_of = |copy: u32| inputs.held_of(copy);
        // Springs of the last pass leave the preconditioner.
        for &copy in &self.sprung {
            self.preconditioner.set(copy as usize, &self.diagonal[copy as usize], held_of(copy));
        }
        self.sprung.clear();
        match &mut self.stiff {
            None => {
                self.sprung.extend(self.terms.iter().flat_map(|term| term.point.copies()));
                self.sprung.extend(self.shared.iter().map(|(copy, _)| *copy));
            }
            // A spring also acts on the copies relative to which its own are moved.
            Some(stiff) => {
                let T = self.preconditioner.substitution();
                for term in
                    self.terms.iter().copied().chain(self.shared.iter().map(|(copy, _)| at_node(*copy)))
                {
                    term.expand(T, &mut stiff.row);
                    self.sprung.extend(stiff.row.iter().map(|r| r.0));
                }
            }
        }
        // Many springs act on the same nodes, and every block is inverted once.
        self.sprung.sort_unstable();
        self.sprung.dedup();
        // `diagonal` itself stays without springs: they are in it only while the blocks are inverted.
        self.bare.clear();
        self.bare.extend(self.sprung.iter().map(|&copy| self.diagonal[copy as usize]));
        if let Some(stiff) = &mut self.stiff {
            for term in &self.terms {
                term.expand(self.preconditioner.substitution(), &mut stiff.row);
                stiff
                    .row
                    .iter()
                    .for_each(|&(copy, w)| term.add_to_block(w as f32, &mut self.diagonal[copy as usize]));
            }
            for (copy, block) in &self.shared {
                at_node(*copy).expand(self.preconditioner.substitution(), &mut stiff.row);
                stiff.row.iter().for_each(|&(copy, w)| add(w * w * block, &mut self.diagonal[copy as usize]));
            }
        } else {
            system(elastic, &self.terms, inputs).add_springs(&mut self.diagonal);
            self.shared.iter().for_each(|(copy, block)| add(*block, &mut self.diagonal[*copy as usize]));
        }
        for &copy in &self.sprung {
            self.preconditioner.set(copy as usize, &self.diagonal[copy as usize], held_of(copy));
        }
        for (&copy, bare) in self.sprung.iter().zip(&self.bare) {
            self.diagonal[copy as usize] = *bare;
        }
    }

    /// Lets springs change their modes where that matters; returns whether it does.
    pub(super) fn springs_changed(&mut self, inputs: &LinearInputs<'_>, pass: usize) -> bool {
        if pass + 1 == SPRING_PASSES {
            return false;
        }
        let point = |spring: &ActiveSpring| self.point_of(spring, inputs);
        let springs = self.springs.springs.iter();
        let scale = springs.map(|s| s.law().force(point(s)).norm()).fold(0.0, f64::max);
        if !self.springs.springs.iter().any(|s| s.law().would_change(point(s), scale)) {
            return false; // and the forces stay those of the solve
        }
        for s in 0..self.springs.springs.len() {
            let point = self.point_of(&self.springs.springs[s], inputs);
            self.springs.springs[s].choose_mode(point);
        }
        true
    }
}

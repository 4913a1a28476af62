//! The coarse space of the two-level preconditioner in a step.

use scindo_algebra::operator::BlockJacobi;
use scindo_algebra::solver::Method;
use scindo_algebra::solver::two_level::{CoarseSpace, CoarseSystem, TwoLevel};
use scindo_matter::material::Law;

use super::LinearStep;
use crate::integrator::step_inputs::LinearInputs;

impl LinearStep {
    /// Brings the coarse space up to date with the operator, and makes it if the method asks for one that there is not.
    pub(super) fn complete_coarse(&mut self, inputs: &LinearInputs<'_>) {
        if self.method != Method::TwoLevelPcg || inputs.relaxes() {
            self.coarse = None;
            return;
        }
        let step = &inputs.step;
        if self.coarse.as_ref().is_none_or(|coarse| !coarse.is_made_for(inputs.material)) {
            let T = self.preconditioner.substitution();
            let body = ((step.points, inputs.material), (step.rest, step.mass));
            self.coarse = CoarseSpace::new(body.0, body.1, &|copy| T.substitutes(copy)).map(Box::new);
        }
        let Some(coarse) = &mut self.coarse else { return };
        let with = inputs.elastic_update();
        coarse.follow(&CoarseSystem {
            x: &self.predicted,
            rotates: with.law != Law::Linear,
            scale: with.scale,
            mass_factor: inputs.mass_factor(),
            diagonal: &self.diagonal,
            fixed: step.fixed,
            springs: &self.terms,
        });
    }
}

/// Block-Jacobi, with the coarse space if there is one with factors.
pub(super) fn two_level<'a>(
    jacobi: &'a mut BlockJacobi,
    coarse: &'a mut Option<Box<CoarseSpace>>,
    inputs: &LinearInputs<'a>,
) -> TwoLevel<'a> {
    let coarse = coarse.as_deref_mut().filter(|coarse| coarse.is_factored());
    TwoLevel { jacobi, coarse, fixed: inputs.step.fixed }
}

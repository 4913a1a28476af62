//! The parts of a step that a body makes when it is solved together with others.

use nalgebra::{Matrix3, Vector3};
use scindo_algebra::operator::{Padded, Stiffness, filter};
use scindo_matter::team::Team;

use super::{LinearStep, system};
use crate::integrator::state::State;
use crate::integrator::step_inputs::LinearInputs;

/// A body's own part of a step that several bodies solve together.
pub struct Own<'a, 'b> {
    /// Its threads.
    pub team: &'a mut Team,
    /// Its stiffness.
    pub elastic: &'a mut dyn Stiffness,
    /// Its state before the step.
    pub state: &'a State,
    /// What acts on it.
    pub inputs: &'a LinearInputs<'b>,
}

impl LinearStep {
    /// Whether steps of this body can be solved together with others: not where a coarse level is simulated.
    pub fn can_be_shared(&self) -> bool {
        self.simulated.is_none()
    }

    /// Prepares the step: predictor, springs, operator. Returns the number of inverted pieces.
    pub fn begin_together(&mut self, own: &mut Own<'_, '_>) -> usize {
        let Own { team, elastic, state, inputs } = own;
        self.aside = self.grid.take();
        self.coarse_aside = self.coarse.take();
        self.predict(team, state, inputs);
        self.springs.begin(&inputs.step, &self.predicted);
        self.searched = None;
        self.delta.fill([0.0; 4]);
        self.translations.restart(inputs.step.parts);
        self.update_operator(team, &mut **elastic, state, true, inputs)
    }

    /// Completes the operator of a pass. `shared` are the nodes of springs to other bodies, ascending, with their
    /// diagonal parts, which belong to the preconditioner only.
    pub fn complete_together(&mut self, own: &mut Own<'_, '_>, shared: &[(u32, Matrix3<f64>)]) {
        self.shared.clear();
        self.shared.extend_from_slice(shared);
        self.complete_operator(&mut *own.elastic, own.inputs);
    }

    /// Writes r = b − A δ without the springs to other bodies. Returns the reference of the residual on the first pass.
    pub fn residual_together(&mut self, own: &mut Own<'_, '_>, pass: usize) -> f64 {
        let Own { team, elastic, state, inputs } = own;
        self.residual(team, &mut **elastic, state, inputs, (pass, pass == 0));
        self.reference
    }

    /// Adds a force [N] on node `copy` to the residual, times `s`.
    pub fn add_to_residual(&mut self, copy: u32, force: &Vector3<f64>) {
        let r = &mut self.pcg.r[copy as usize];
        (0..3).for_each(|k| r[k] += force[k] as f32);
    }

    /// Whether the preconditioner consists of blocks of single nodes.
    pub fn has_single_blocks(&self) -> bool {
        self.preconditioner.substitution().is_empty()
    }

    /// The block of the preconditioner of one node, springs included, and its inverse; `None` if the node is held or
    /// has no mass.
    pub fn single_block(&self, copy: u32) -> Option<[Matrix3<f64>; 2]> {
        let columns = self.preconditioner.inverses()[copy as usize].columns();
        let inverse = Matrix3::from_fn(|i, j| f64::from(columns[j][i]));
        let size = inverse.trace();
        let block = (size > 0.0).then(|| inverse / size)?.try_inverse()? / size;
        Some([block, inverse])
    }

    /// Mean of the diagonal of M⁻¹ of one node.
    pub fn ease_of(&self, copy: u32) -> f64 {
        let columns = self.preconditioner.inverses()[copy as usize].columns();
        (0..3).map(|k| f64::from(columns[k][k])).sum::<f64>() / 3.0
    }

    /// The residual of one node.
    pub fn residual_of(&self, copy: u32) -> &Padded {
        &self.pcg.r[copy as usize]
    }

    /// M⁻¹ r of one node.
    pub fn preconditioned_of(&mut self, copy: u32) -> &mut Padded {
        &mut self.pcg.z[copy as usize]
    }

    /// z = M⁻¹ r after all forces are in the residual; returns rᵀz.
    pub fn precondition_together(&mut self, own: &mut Own<'_, '_>) -> f64 {
        let Self { pcg, preconditioner, terms, .. } = self;
        filter(own.inputs.step.fixed, &mut pcg.r);
        let mut A = system(&mut *own.elastic, terms, own.inputs);
        pcg.precondition(own.team, &mut A, preconditioner)
    }

    /// p ← z + β p, q = A p without the springs to other bodies; returns pᵀq.
    pub fn turn_together(&mut self, own: &mut Own<'_, '_>, beta: f64) -> f64 {
        let Self { pcg, preconditioner, terms, .. } = self;
        let mut A = system(&mut *own.elastic, terms, own.inputs);
        pcg.turn(own.team, &mut A, preconditioner, beta)
    }

    /// The search direction p and its product q.
    pub fn direction_together(&mut self) -> (&[Padded], &mut [Padded]) {
        (&self.pcg.p, &mut self.pcg.q)
    }

    /// δ ← δ + α p, r ← r − α q, z = M⁻¹ r; returns rᵀz.
    pub fn descend_together(&mut self, own: &mut Own<'_, '_>, alpha: f64) -> f64 {
        let Self { pcg, preconditioner, terms, delta, .. } = self;
        filter(own.inputs.step.fixed, &mut pcg.q);
        scindo_algebra::operator::Preconditioner::enter(preconditioner, &mut pcg.q);
        let mut A = system(&mut *own.elastic, terms, own.inputs);
        pcg.descend(own.team, &mut A, preconditioner, alpha, delta)
    }

    /// Position of a node with the present δ [m].
    pub fn position_together(&self, copy: u32, inputs: &LinearInputs<'_>) -> Vector3<f64> {
        self.position(copy as usize, inputs)
    }

    /// Lets the body's own springs change their modes; returns whether one did.
    pub fn own_springs_changed(&mut self, inputs: &LinearInputs<'_>) -> bool {
        self.springs_changed(inputs, 0)
    }

    /// The translation equations of the body's parts with the present δ, without springs to other bodies: calls
    /// `each` with the part, its matrix and the imbalance.
    pub fn imbalance(
        &mut self,
        own: &Own<'_, '_>,
        mut each: impl FnMut(usize, &Matrix3<f64>, &Vector3<f64>),
    ) {
        let (inputs, state) = (own.inputs, own.state);
        if !inputs.step.parts.any_free() {
            return;
        }
        self.gather_imbalance(state, inputs, true);
        let (parts, translations) = (inputs.step.parts, &self.translations);
        for part in (0..parts.len()).filter(|&part| parts.free[part]) {
            let (S, b) = translations.equation(part);
            each(part, S, b);
        }
    }

    /// Moves a free part.
    pub fn shift_part(&mut self, part: usize, by: &Vector3<f64>) {
        self.translations.shift[part] += by;
    }

    /// Whether δ and the translations are finite and far inside the range of single precision.
    pub fn is_finite_together(&self, inputs: &LinearInputs<'_>) -> bool {
        let n = self.delta.len();
        (0..n).all(|c| self.position(c, inputs).iter().all(|x| x.abs() < 1e15))
    }

    /// Ends the step: if `moves`, new positions and velocities, and the forces of the body's own springs. Returns
    /// whether all of it is finite; the state is unchanged otherwise.
    pub fn end_together(
        &mut self,
        (team, state): (&mut Team, &mut State),
        inputs: &LinearInputs<'_>,
        spring_forces: &mut [Vector3<f64>],
        moves: bool,
    ) -> bool {
        let finite = moves && self.move_predictor(team, inputs);
        if finite {
            self.commit(team, state, inputs, spring_forces);
        }
        self.shared.clear();
        self.grid = self.aside.take();
        self.coarse = self.coarse_aside.take();
        finite
    }
}

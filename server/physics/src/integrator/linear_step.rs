//! A step of an implicit scheme by linear solves, each linearised at its predictor.
//!
//! # Derivation
//! M a⁺ = f_ext − f_int(x⁺) − D v⁺ with a⁺ = A (x⁺ − x_a), v⁺ = B (x⁺ − x_v) (the
//! [increment](super::increment) of a scheme), x⁺ = x̂ + δ, f_int(x⁺) ≈ f_int(x̂) + K̂ δ, D = α M + β K̂,
//! s = 1/A, r = B/A and v̂ = B (x̂ − x_v) gives
//!
//!   [(1 + rα) M + (s + rβ) K̂] δ = s (f_ext − f_int(x̂) − α M v̂ − β K̂ v̂) − M (x̂ − x_a)
//!
//! The predictor is x̂ = x_a, so that the last term is 0 in the first solve. For implicit Euler s = h²,
//! r = h, x̂ = x + h v and v̂ = v. Linearised at x_n, a spinning body would gain energy; linearised at
//! the predictor it never does.
//!
//! K̂ is R K Rᵀ, plus the twists of the law where tension matters to the step (`operator/twist.rs`); these
//! enter with s alone, because they must not damp what turns.
//!
//! # Damping
//! K̂ rotates with the material, so β does not damp rigid motion. But from x to x̂ material moves along straight lines, and
//! K̂ v̂ takes that for an expansion, which β would resist: a spinning body would gain energy. So implicit Euler of a law
//! that rotates damps by the strains ε = sym(RᵀF) − I, each with the rotation of its own positions: β K̂ v̂ is the force of
//! the stress of β (ε(x̂) − ε(x))/h. In BDF2 and Newmark's method the expansions of a steady turn cancel.

mod coarse;
mod commit;
mod equations;
mod equilibrium;
mod operator;
mod spring_terms;
pub(super) mod together;

use coarse::two_level;
use equations::StepEquations;
use nalgebra::{Matrix3, Vector3};
use scindo_algebra::operator::{
    BLOCK, Block6, BlockJacobi, CompositeDiagonal, LinearOperator, Padded, Spring, StiffModes, Stiffness,
    Substitution, Sum, SystemOperator, apply_damping, block_of, filter, padded, unpadded,
};
use scindo_algebra::solver::multigrid::{CoarsestSolve, CycleShape, Hierarchy, LevelReport, Multigrid};
use scindo_algebra::solver::two_level::CoarseSpace;
use scindo_algebra::solver::{LEAST_REFERENCE, LinearReport, Method, Pcg, StopReason};
use scindo_matter::element::Held;
use scindo_matter::material::Rayleigh;
use scindo_matter::octree::Octree;
use scindo_matter::storage::reserve::resize_reserving;
use scindo_matter::team::phase::Phase;
use scindo_matter::team::{Team, blocks};

use super::ablation::Ablation;
use super::active_springs::ActiveSprings;
use super::descent::Descent;
use super::parts::Translations;
use super::simulated_level::SimulatedLevel;
use super::springs::ActiveSpring;
use super::state::{State, WEIGHTLESS, hold};
use super::step_grid::StepGrid;
use super::step_inputs::{Inertia, KnownLoads, LinearInputs, Predictor, StepOutcome};

/// Part of the residual that a solve leaves on the way to an equilibrium of a law that rotates, at most; the last
/// one reaches the tolerance.
const FORCING: f64 = 0.1;
/// Largest number of passes of a linear solve, repeated while springs open, close, slip or reach their cap.
const SPRING_PASSES: usize = 8;
/// The residual is measured against the right-hand side, but at least against this fraction of the loads.
/// A body at rest would otherwise be solved for rounding noise.
const LOAD_FLOOR: f64 = 0.01;

/// The scratch vectors of a step, one entry per copy.
#[derive(Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct LinearStep {
    /// What a mutation test leaves out.
    ablation: Ablation,
    predicted: Vec<Vector3<f64>>,
    f_int: Vec<Padded>,
    damping: Vec<Padded>,
    scratch: Vec<Padded>,
    delta: Vec<Padded>,
    /// Blocks of (1 + rα) M + (s + rβ) K̂, springs not included.
    diagonal: Vec<Block6>,
    preconditioner: BlockJacobi,
    /// State for which `diagonal` and `preconditioner` were computed: version of K̂ and mass factor.
    made_for: Option<(u64, f64)>,
    /// Prescribed directions for which they were computed.
    made_for_fixed: Vec<(u32, Held)>,
    /// Change of variables for a body with degenerate elements.
    stiff: Option<Box<Stiff>>,
    /// Copies whose entry of the preconditioner contains springs.
    sprung: Vec<u32>,
    /// Their blocks without springs, while those with springs are inverted.
    bare: Vec<Block6>,
    pcg: Pcg,
    method: Method,
    /// Multigrid, if the discretisation has levels and the method asks for it.
    grid: Option<Box<StepGrid>>,
    /// Multigrid while a step is solved together with other bodies, of which its levels know nothing.
    aside: Option<Box<StepGrid>>,
    /// The level that is simulated, if it is not the finest one; there is no `grid` then.
    simulated: Option<Box<SimulatedLevel>>,
    /// The coarse space of the two-level preconditioner; the one aside is that of a body that is solved with others.
    coarse: Option<Box<CoarseSpace>>,
    coarse_aside: Option<Box<CoarseSpace>>,
    /// One entry per block of the vector loops.
    partial: Vec<f64>,
    springs: ActiveSprings,
    terms: Vec<Spring>,
    /// Nodes of springs to other bodies with their diagonal parts, for the preconditioner of a step that is solved
    /// together.
    shared: Vec<(u32, Matrix3<f64>)>,
    translations: Translations,
    reference: f64,
    /// For equilibria: internal forces [N] and energy [J] at the predictor in double precision.
    exact: Vec<Vector3<f64>>,
    stored: f64,
    /// Line search, for equilibria of laws that rotate.
    descent: Descent,
    /// Relative residual at the start of the last solve.
    began: f64,
    /// How far the last solve moved the predictor [m].
    last: Vec<Padded>,
    /// Whether the equations of a step in motion hold.
    equations: StepEquations,
    /// For relaxation: loads that its search began with, and positions where the last step ended.
    searched: Option<KnownLoads>,
    ended: Vec<Vector3<f64>>,
}

/// The change of variables that keeps degenerate elements from costing iterations.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
struct Stiff {
    modes: StiffModes,
    /// Blocks of the preconditioner that the substitution changes.
    composite: CompositeDiagonal,
    /// Degenerate pieces that keep a stiff motion.
    left: usize,
    /// Whether the substitution has to be found anew.
    stale: bool,
    /// A spring's weights in the new variables.
    row: Vec<(u32, f64)>,
}

/// Capacity for a spring's weights in the new variables: more copies are hardly ever needed.
const SPRING_ROW: usize = 64;

impl LinearStep {
    /// An integrator without history.
    pub fn new(ablation: Ablation) -> Self {
        Self { ablation, ..Self::default() }
    }

    /// Makes room for `n` copies.
    pub fn resize(&mut self, n: usize) {
        resize_reserving(&mut self.predicted, n, Vector3::zeros());
        let vectors =
            [&mut self.f_int, &mut self.damping, &mut self.scratch, &mut self.delta, &mut self.last];
        for v in vectors {
            resize_reserving(v, n, [0.0; 4]);
        }
        resize_reserving(&mut self.diagonal, n, [0.0; 8]);
        self.partial.resize(n.div_ceil(BLOCK), 0.0);
        self.made_for = None;
        self.searched = None;
        self.coarse = None;
        self.sprung.clear();
        self.preconditioner.resize(n);
        self.pcg.resize(n);
        self.set_stiff_modes(None);
    }

    /// Sets the stiff motions of the degenerate elements of the present topology.
    pub fn set_stiff_modes(&mut self, modes: Option<StiffModes>) {
        self.preconditioner.set_substitution(Substitution::default());
        self.made_for = None;
        self.stiff = modes.map(|modes| {
            let (composite, row) = (CompositeDiagonal::default(), Vec::with_capacity(SPRING_ROW));
            Box::new(Stiff { modes, composite, left: 0, stale: true, row })
        });
    }

    /// Sets the method of linear solves; one of multigrid needs a [hierarchy](Self::set_hierarchy), too.
    pub fn set_method(&mut self, method: Method) {
        self.method = method;
        self.searched = None;
    }

    /// Lets the levels follow a cut of an octree that changed these leaves, ascending. The task `beside` is run
    /// meanwhile. Returns `false` if the levels have to be [made anew](Self::set_hierarchy).
    pub fn follow_cut(
        &mut self,
        team: &mut Team,
        cut: (&Octree, &[u32]),
        beside: &mut (dyn FnMut() + Send),
    ) -> bool {
        match (&mut self.grid, &mut self.simulated) {
            (Some(grid), _) => grid.follow_cut(team, cut, beside),
            (None, Some(level)) => level.follow_cut(team, cut, beside),
            (None, None) => {
                beside();
                false
            }
        }
    }

    /// Sets the levels of the present topology, and which of them is simulated, or the coarsest one if there are
    /// fewer. Cycles have this `shape`.
    pub fn set_hierarchy(&mut self, hierarchy: Option<Hierarchy>, simulate: usize, shape: CycleShape) {
        (self.grid, self.simulated) = (None, None);
        let Some(hierarchy) = hierarchy else { return };
        match simulate.min(hierarchy.n_levels() - 1) {
            0 => self.grid = Some(Box::new(StepGrid::new(hierarchy, shape))),
            level => self.simulated = Some(Box::new(SimulatedLevel::new(hierarchy, level, shape))),
        }
    }

    /// Figures of the levels of multigrid, and how the coarsest one is solved.
    pub fn levels(&self) -> Option<(Vec<LevelReport>, CoarsestSolve)> {
        let simulated = self.simulated.as_ref().map(|level| level.multigrid());
        self.grid.as_ref().map(|grid| grid.multigrid()).or(simulated).map(Multigrid::report)
    }

    /// Whether a step may continue the search of the one before. Cycles have no search direction.
    fn searches(&self, inputs: &LinearInputs<'_>) -> bool {
        let cycles = self.method == Method::Multigrid && self.grid.is_some();
        inputs.relaxes() && !cycles && self.simulated.is_none()
    }

    /// Of the last step: pieces of degenerate elements, copies moved relative to others for them, and
    /// pieces that keep a stiff motion.
    pub fn stiff_motions(&self) -> [usize; 3] {
        let (found, left) = self.stiff.as_ref().map_or((0, 0), |s| (s.modes.n_degenerate(), s.left));
        [found, self.preconditioner.substitution().len(), left]
    }

    /// Advances `state` by h if everything stays finite. The force of every spring is written to
    /// `spring_forces`, in the order of the inputs.
    ///
    /// Several solves are Newton's method with full steps, until the equations of the step hold. Each starts from x⁺ of
    /// the one before and measures its residual against the loads of the first.
    pub fn step(
        &mut self,
        team: &mut Team,
        elastic: &mut dyn Stiffness,
        state: &mut State,
        inputs: &LinearInputs<'_>,
        spring_forces: &mut [Vector3<f64>],
    ) -> StepOutcome {
        // Nothing has changed since the last step: its search goes on with the operator that is there.
        if self.searches(inputs) && self.goes_on(elastic, state, inputs) {
            return self.relax(team, elastic, state, inputs, spring_forces);
        }
        self.predict(team, state, inputs);
        self.springs.begin(&inputs.step, &self.predicted);
        if self.ablation.lagged_friction {
            self.springs.springs.iter_mut().for_each(ActiveSpring::lag);
        }
        // The line search compares potentials, so springs need the forces of the potential at the predictor.
        if inputs.descends() {
            self.choose_modes(inputs);
        }
        let mut solve = LinearReport::default();
        let (mut inverted_pieces, mut finite, mut solves, mut backtracks) = (0, true, 0, 0);
        self.equations.begin();
        let mut began = f64::INFINITY;
        self.descent.begin();
        for number in 0..inputs.solves.max(1) {
            let inverted = self.update_operator(team, elastic, state, number == 0, inputs);
            // Counted where the step begins, not on the way to an equilibrium; and where it ends if that is looked at.
            if number == 0 || inputs.moves() {
                inverted_pieces = inverted;
            }
            self.equations.aim(elastic, inputs);
            let known = solve.iterations;
            self.improve(team, (elastic, inputs), state, number == 0, &mut solve);
            solves += 1;
            finite = solve.stop != StopReason::NonFinite;
            // The last move went too far: half of it is taken back, and the equations are looked at again.
            if solve.stop == StopReason::NoDescent && inputs.moves() {
                backtracks += 1;
                self.take_back(0.5);
                continue;
            }
            // Compressed material may have no minimum along a direction; from then on its tangent is projected.
            if solve.stop == StopReason::NonPositiveCurvature && self.equations.project(inputs) {
                continue;
            }
            let is_last = number + 1 >= inputs.solves;
            if finite && inputs.descends() && self.descend(team, inputs, known, is_last, &mut solve) {
                break;
            }
            finite = finite && self.move_predictor(team, inputs);
            if inputs.descends() && finite && !team.told_to_stop() {
                self.choose_modes(inputs);
                continue;
            }
            // In an equilibrium each solve begins with the true residual, while the one before knew only
            // its recurrence. A true residual that has not halved is rounding.
            let none_left = solve.iterations == known;
            // In motion, the equations hold once their residual is small without another solve.
            if none_left && inputs.moves() {
                break;
            }
            let rounding = number > 0 && !none_left && self.began > 0.5 * began;
            if rounding && !inputs.moves() && solve.stop == StopReason::Converged {
                (solve.stop, solve.residual) = (StopReason::Stagnated, self.began);
            }
            let done = none_left || rounding || solve.stop == StopReason::IterationLimit;
            if !finite || team.told_to_stop() || (!inputs.moves() && done) {
                break;
            }
            began = self.began;
        }
        // No solve is left that could tell whether a part of the last move is better than none.
        if solve.stop == StopReason::NoDescent && inputs.moves() {
            self.take_back(1.0);
        }
        let judges = inputs.is_nonlinear() && finite && !team.told_to_stop();
        let rounding = if judges { self.equations.judge(inputs.solver.tolerance, &mut solve) } else { 0.0 };
        // Otherwise the state stays as it was before the step.
        let work_j = if finite { self.commit(team, state, inputs, spring_forces) } else { 0.0 };
        team.begin(Phase::Guards);
        // Relaxation may continue this search in the next step if nothing changes until then.
        self.searched = None;
        if finite && self.searches(inputs) && inputs.step.springs.is_empty() {
            self.searched.get_or_insert_default().note(inputs);
            self.ended.clone_from(&state.x);
        }
        let (refused_springs, backtracks) = (self.springs.refused(), backtracks + self.descent.backtracks);
        StepOutcome { solve, solves, rounding, inverted_pieces, refused_springs, backtracks, work_j, finite }
    }

    /// Makes one linear solve for δ, repeated while springs open, close or reach their cap in it.
    fn improve(
        &mut self,
        team: &mut Team,
        (elastic, inputs): (&mut dyn Stiffness, &LinearInputs<'_>),
        state: &State,
        first: bool,
        solve: &mut LinearReport,
    ) {
        self.delta.fill([0.0; 4]);
        self.translations.restart(inputs.step.parts);
        for pass in 0..SPRING_PASSES {
            team.begin(Phase::Operator);
            self.complete_operator(elastic, inputs);
            self.complete_grid(team, elastic, inputs, pass);
            self.complete_coarse(inputs);
            team.begin(Phase::Residual);
            self.balance_parts(state, inputs, first);
            self.residual(team, elastic, state, inputs, (pass, first));
            team.begin(Phase::Solve);
            let report = self.solve(team, elastic, inputs, (pass, first));
            self.equations.foresee(report.residual);
            // A pass with nothing left to do estimates no error, and a solve that was not made leaves the one before.
            let algebraic_error = solve.algebraic_error.max(report.algebraic_error);
            let iterations = solve.iterations + report.iterations;
            let before = *solve;
            *solve = LinearReport { iterations, algebraic_error, ..report };
            if !first && pass == 0 && report.iterations == 0 && inputs.moves() {
                *solve = before;
                if report.stop == StopReason::NoDescent {
                    solve.stop = report.stop;
                    return;
                }
            }
            self.balance_parts(state, inputs, first);
            if report.stop == StopReason::NonFinite || !self.springs_changed(inputs, pass) {
                break;
            }
        }
    }

    /// Computes the acceleration [m/s²] of every copy at `state`, from which Newmark's method starts. It
    /// is 0 in prescribed directions and where there is no mass.
    pub fn accelerate(
        &mut self,
        team: &mut Team,
        elastic: &mut dyn Stiffness,
        state: &State,
        inputs: &LinearInputs<'_>,
        acceleration: &mut [Vector3<f64>],
    ) {
        team.begin(Phase::Residual);
        self.predicted.copy_from_slice(&state.x);
        elastic.update(team, &inputs.elastic_update(), &state.x, None);
        team.for_blocks(blocks(&mut self.f_int, BLOCK), |block, f| elastic.forces(block, f));
        self.made_for = None;
        let Rayleigh { stiffness_s: beta, mass_1_s: alpha } = inputs.material.rayleigh;
        self.damping.fill([0.0; 4]);
        if beta > 0.0 {
            self.scratch.iter_mut().zip(&state.v).for_each(|(out, v)| *out = padded(v));
            apply_damping(elastic, team, &self.scratch, &mut self.damping); // scale · K̂ v
        }
        let beta = beta / inputs.elastic_update().scale;
        for (c, a) in acceleration.iter_mut().enumerate() {
            let applied =
                inputs.step.mass[c] * (inputs.step.gravity - alpha * state.v[c]) + inputs.step.load[c];
            *a = applied - unpadded(&self.f_int[c]) - beta * unpadded(&self.damping[c]);
        }
        self.springs.begin(&inputs.step, &self.predicted);
        for spring in &self.springs.springs {
            let force = spring.law().potential(spring.point(&state.x)).force;
            spring.carriers().for_each(|(c, w)| acceleration[c] += w * force);
        }
        if let Some(level) = &mut self.simulated {
            level.follow(team, elastic, inputs);
            level.accelerate(team, acceleration, inputs);
            return team.begin(Phase::Guards);
        }
        for (a, &m) in acceleration.iter_mut().zip(inputs.step.mass) {
            *a = if m > WEIGHTLESS { *a / m } else { Vector3::zeros() };
        }
        hold(inputs.step.fixed, acceleration);
        team.begin(Phase::Guards);
    }

    fn predict(&mut self, team: &mut Team, state: &State, inputs: &LinearInputs<'_>) {
        team.begin(Phase::Predict);
        team.for_blocks(blocks(&mut self.predicted, BLOCK), |block, predicted| {
            match inputs.inertia {
                Inertia::Euler => {}
                Inertia::Remembered(history) => {
                    return predicted.copy_from_slice(block_of(history.x_a, block));
                }
                Inertia::None { .. } => return predicted.copy_from_slice(block_of(&state.x, block)),
            }
            let known = block_of(&state.x, block).iter().zip(block_of(&state.v, block));
            for (predicted, (x, v)) in predicted.iter_mut().zip(known) {
                *predicted = x + inputs.step.h * v;
            }
        });
        if let Some(level) = &mut self.simulated {
            level.follow_prescribed(team, inputs.step.fixed, &mut self.predicted);
        }
        for fixed in inputs.step.fixed {
            fixed.held.place(&mut self.predicted[fixed.copy as usize], &fixed.position_m);
        }
    }

    /// Solves the translation equations of every free part for the imbalance that δ leaves.
    fn balance_parts(&mut self, state: &State, inputs: &LinearInputs<'_>, first: bool) {
        if inputs.step.parts.any_free() {
            self.gather_imbalance(state, inputs, first);
            self.translations.solve(inputs.step.parts);
        }
    }

    /// Sets up the translation equations for the imbalance that δ leaves.
    fn gather_imbalance(&mut self, state: &State, inputs: &LinearInputs<'_>, first: bool) {
        let factor = inputs.mass_factor();
        let s = inputs.s();
        self.translations.begin(inputs.step.parts, factor);
        for (c, delta) in self.delta.iter().enumerate() {
            let moved = self.translations.shift[inputs.step.parts.of_copy[c] as usize] + unpadded(delta);
            let at = Predictor { x: &self.predicted, first };
            let external = inputs.external(c, state, at) - inputs.inertia(c, state, at) / s;
            let missing = s * external - factor * inputs.step.mass[c] * moved;
            self.translations.add(inputs.step.parts, c, missing);
        }
        for spring in &self.springs.springs {
            let point = self.point_of(spring, inputs);
            let (S, f) = (s * spring.law().stiffness(), s * spring.law().force(point));
            self.translations.add_spring(inputs.step.parts, spring.main_copy(), S, f);
        }
    }

    /// Position [m] of the point of a spring with the present δ.
    fn point_of(&self, spring: &ActiveSpring, inputs: &LinearInputs<'_>) -> Vector3<f64> {
        spring.carriers().map(|(c, w)| w * self.position(c, inputs)).sum()
    }

    /// x̂ + δ of copy `c` [m].
    fn position(&self, c: usize, inputs: &LinearInputs<'_>) -> Vector3<f64> {
        let part = inputs.step.parts.of_copy[c] as usize;
        self.predicted[c] + self.translations.shift[part] + unpadded(&self.delta[c])
    }

    /// Writes r = b − A δ to the solver; on the first pass of the first solve also sets the reference
    /// from the loads.
    fn residual(
        &mut self,
        team: &mut Team,
        elastic: &mut dyn Stiffness,
        state: &State,
        inputs: &LinearInputs<'_>,
        (pass, first): (usize, bool),
    ) {
        let (s, factor) = (inputs.s(), inputs.mass_factor());
        let damped = self.damps(inputs);
        // On the first pass δ = 0.
        if pass > 0 {
            system(elastic, &[], inputs).apply(team, &self.delta, &mut self.scratch);
        }
        let (f_int, damping, solved) = (&self.f_int, &self.damping, &self.scratch);
        let at = Predictor { x: &self.predicted, first };
        // In an equilibrium the forces cancel each other, and single precision would leave mostly rounding.
        let exact = (!inputs.moves()).then_some(&self.exact);
        let (M, shift) = (&self.preconditioner, &self.translations.shift);
        let results = (blocks(&mut self.pcg.r, BLOCK), blocks(&mut self.partial, 1));
        team.for_blocks(results, |block, (r, partial)| {
            let mut load = Sum::default();
            for (i, (r, M)) in r.iter_mut().zip(M.block(block)).enumerate() {
                let c = block * BLOCK + i;
                let elastic = exact.map_or_else(|| unpadded(&f_int[c]), |exact| exact[c]);
                let mut f = inputs.external(c, state, at) - elastic;
                if damped {
                    f -= unpadded(&damping[c]);
                }
                // Moving a free part as a whole strains nothing, so only its mass counts.
                let moved = shift[inputs.step.parts.of_copy[c] as usize];
                let inertia = inputs.inertia(c, state, at);
                *r = padded(&(s * f - factor * inputs.step.mass[c] * moved - inertia));
                if pass > 0 {
                    for k in 0..4 {
                        r[k] -= solved[c][k];
                    }
                } else {
                    let weight =
                        padded(&(s * (inputs.step.mass[c] * inputs.step.gravity + inputs.step.load[c])));
                    load.add(&weight, &M.times(&weight)); // M⁻¹ is 0 where a copy is fixed
                }
            }
            partial[0] = load.total();
        });
        // A substitution and cycles mix copies, so the norm of the loads then needs a pass of its own.
        if first && pass == 0 {
            let by_copy =
                active(&mut self.grid).is_none() && self.simulated.is_none() && self.coarse.is_none();
            let loads = if self.preconditioner.substitution().is_empty() && by_copy {
                self.partial.iter().sum::<f64>().max(0.0).sqrt()
            } else {
                for (c, load) in self.scratch.iter_mut().enumerate() {
                    *load = padded(&(s * (inputs.step.mass[c] * inputs.step.gravity + inputs.step.load[c])));
                }
                filter(inputs.step.fixed, &mut self.scratch);
                let Self { pcg, preconditioner, scratch, grid, simulated, coarse, terms, .. } = self;
                let mut A = system(elastic, terms, inputs);
                match (active(grid), simulated) {
                    (_, Some(level)) => level.norm(team, scratch),
                    (None, _) => {
                        pcg.norm(team, &mut A, &mut two_level(preconditioner, coarse, inputs), scratch)
                    }
                    (Some(grid), _) => {
                        pcg.norm(team, &mut A, &mut grid.cycle(preconditioner.inverses()), scratch)
                    }
                }
            };
            self.reference = self.least_reference(loads, inputs);
            self.note_rounding(team, inputs);
        }
        // Springs reach few copies: they are added one by one.
        for spring in &self.springs.springs {
            let f = s * spring.law().force(self.point_of(spring, inputs));
            for (c, w) in spring.carriers() {
                let r = &mut self.pcg.r[c];
                (0..3).for_each(|k| r[k] += (w * f[k]) as f32);
            }
        }
        // Last, because springs pull at held copies, too.
        filter(inputs.step.fixed, &mut self.pcg.r);
    }

    /// Least reference of the residual, given the norm √(fᵀM⁻¹f) of the `loads`. For an equilibrium it is
    /// that norm, or a fraction of √(2Ψ) if displacements alone load the body. The equations of a law that is nonlinear
    /// in the stretch are judged as those of equilibria.
    fn least_reference(&self, loads: f64, inputs: &LinearInputs<'_>) -> f64 {
        if inputs.moves() {
            return if inputs.is_nonlinear() { loads } else { LOAD_FLOOR * loads };
        }
        loads.max(LEAST_REFERENCE * (2.0 * self.stored.max(0.0)).sqrt())
    }

    /// Solves for δ. The reference is the residual of the first pass of the step, or the least reference
    /// if that is larger.
    fn solve(
        &mut self,
        team: &mut Team,
        elastic: &mut dyn Stiffness,
        inputs: &LinearInputs<'_>,
        (pass, first): (usize, bool),
    ) -> LinearReport {
        let Self { pcg, preconditioner, terms, delta, grid, simulated, descent, coarse, .. } = self;
        let mut A = system(elastic, terms, inputs);
        let mut rz = match (active(grid), &mut *simulated) {
            (_, Some(level)) => level.norm(team, &pcg.r).powi(2),
            (None, _) => pcg.precondition(team, &mut A, &mut two_level(preconditioner, coarse, inputs)),
            (Some(grid), _) => pcg.precondition(team, &mut A, &mut grid.cycle(preconditioner.inverses())),
        };
        let norm = rz.max(0.0).sqrt();
        self.reference = self.reference.max(if first && pass == 0 { norm } else { 0.0 });
        if pass == 0 {
            self.began = if self.reference > 0.0 { norm / self.reference } else { 0.0 };
        }
        if let Some(level) = simulated {
            let (exact, fixed) = (!inputs.material.law.rotates(), inputs.step.fixed);
            let from = (norm, self.reference, self.equations.until(inputs), self.method);
            return level.solve(team, (&mut A, exact), fixed, delta, from);
        }
        if pass == 0
            && inputs.moves()
            && let Some(none) = self.equations.look(norm, self.reference, first, inputs)
        {
            return none;
        }
        let mut until = self.equations.until(inputs);
        // A residual that is small enough ends the search; nothing is left to solve for.
        let searches = inputs.descends() && self.began > until.tolerance;
        let corrects = searches && pass == 0;
        if corrects && descent.memory.begin(&mut pcg.r) {
            rz = match active(grid) {
                None => pcg.precondition(team, &mut A, &mut two_level(preconditioner, coarse, inputs)),
                Some(grid) => pcg.precondition(team, &mut A, &mut grid.cycle(preconditioner.inverses())),
            };
        }
        if searches {
            until.tolerance = FORCING * rz.max(0.0).sqrt() / self.reference;
        }
        let from = (rz, self.reference, until);
        let report = match active(grid) {
            None => pcg.run(team, &mut A, &mut two_level(preconditioner, coarse, inputs), delta, from),
            Some(grid) => {
                let mut V = grid.cycle(preconditioner.inverses());
                match self.method {
                    // Coarse levels have stiff springs only: cycles alone would overshoot along soft ones.
                    Method::Multigrid if terms.is_empty() => pcg.cycles(team, &mut A, &mut V, delta, from),
                    _ => pcg.run(team, &mut A, &mut V, delta, from),
                }
            }
        };
        if corrects {
            descent.memory.end(delta);
        }
        report
    }
}

/// Multigrid, if the springs of the present solve allow cycles.
fn active(grid: &mut Option<Box<StepGrid>>) -> Option<&mut StepGrid> {
    grid.as_deref_mut().filter(|grid| grid.is_active())
}

fn system<'a>(
    elastic: &'a mut dyn Stiffness,
    springs: &'a [Spring],
    inputs: &LinearInputs<'a>,
) -> SystemOperator<'a> {
    SystemOperator {
        elastic,
        mass: inputs.mass_f32,
        mass_factor: inputs.mass_factor() as f32,
        springs,
        fixed: inputs.step.fixed,
    }
}

//! Multigrid in a step by linear solves.

use scindo_algebra::operator::{Block6, Inverse3, LinearOperator, Spring, Stiffness, invert};
use scindo_algebra::solver::multigrid::{
    CellMaterial, Coefficients, Cycle, CycleShape, Hierarchy, Multigrid,
};
use scindo_matter::material::Material;
use scindo_matter::octree::Octree;
use scindo_matter::team::Team;

use super::step_inputs::LinearInputs;

/// If a spring is stiffer than this times the body at its point, all levels take the springs: corrections by levels
/// without them would overshoot along it. Softer ones are on the finest level only.
const STIFF: f64 = 1.0;
/// Springs stiffer than this times the body at their point are left to block-Jacobi: single precision spoils the cycle.
const STIFFEST: f64 = 1e4;

/// Multigrid, and what it was brought up to date with.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct StepGrid {
    multigrid: Multigrid,
    coefficients: Coefficients,
    /// Version of the stiffness at the last update.
    version: Option<u64>,
    /// λ of the finest level, where springs add to that of the last estimate; else 0.
    largest: f64,
    /// Whether the springs of the present solve allow cycles.
    active: bool,
}

impl StepGrid {
    /// Multigrid for the cells of `hierarchy`.
    pub(super) fn new(hierarchy: Hierarchy, shape: CycleShape) -> Self {
        let none = Coefficients { materials: Vec::new(), scale: 0.0, mass_factor: 0.0 };
        Self {
            multigrid: Multigrid::new(hierarchy, shape.into()),
            coefficients: none,
            version: None,
            largest: 0.0,
            active: true,
        }
    }

    /// Hierarchy and operators.
    pub(super) fn multigrid(&self) -> &Multigrid {
        &self.multigrid
    }

    /// Follows a cut of `octree`, as [`Multigrid::follow`] does.
    pub(super) fn follow_cut(
        &mut self,
        team: &mut Team,
        cut: (&Octree, &[u32]),
        beside: &mut (dyn FnMut() + Send),
    ) -> bool {
        self.version = None;
        self.multigrid.follow(team, cut, beside)
    }

    /// Follows the stiffness as it was last updated.
    pub(super) fn follow(&mut self, team: &mut Team, elastic: &dyn Stiffness, inputs: &LinearInputs<'_>) {
        let Self { multigrid, coefficients, version, .. } = self;
        set_coefficients(coefficients, multigrid.hierarchy(), inputs);
        let fixed = inputs.step.fixed;
        let now = Some(elastic.version());
        if *version == now && multigrid.is_made_for(coefficients, fixed) {
            return;
        }
        *version = now;
        let places = elastic.places();
        multigrid.update(team, (coefficients, fixed), &|cell| elastic.rotation(places[cell as usize]));
    }

    /// Decides how cycles take the `springs`, if they can; `diagonal` has the diagonal blocks without them. Returns
    /// whether all levels are to take them, and the eigenvalues are then those of the operator without springs.
    pub(super) fn sort(&mut self, springs: &[Spring], diagonal: &[Block6]) -> bool {
        let stiffness = springs.iter().map(|spring| stiffness_at_point(spring, diagonal));
        let stiffest = stiffness.fold(0.0, f64::max);
        self.active = stiffest <= STIFFEST;
        stiffest > STIFF
    }

    /// Estimates eigenvalues if they are not known for the operator `A` with the soft `springs`. Its diagonal blocks
    /// have the inverses `inverse`.
    pub(super) fn complete(
        &mut self,
        team: &mut Team,
        A: &mut dyn LinearOperator,
        inverse: &[Inverse3],
        springs: &[Spring],
    ) {
        self.multigrid.clear_springs();
        self.multigrid.estimate_eigenvalues(team, A, inverse);
        self.largest = with_springs(self.multigrid.largest_eigenvalue(), inverse, springs);
    }

    /// The same with stiff `springs`, of which `A` has none. `bare` gives the inverse of the diagonal block of a copy
    /// without springs.
    pub(super) fn complete_stiff(
        &mut self,
        team: &mut Team,
        A: &mut dyn LinearOperator,
        (inverse, bare): (&[Inverse3], &dyn Fn(u32) -> Inverse3),
        springs: &[Spring],
    ) {
        if !self.active {
            return;
        }
        self.multigrid.estimate_eigenvalues(team, A, inverse);
        let bound = self.multigrid.set_springs(springs, bare);
        (self.active, self.largest) = (bound.is_some(), bound.unwrap_or(0.0));
    }

    /// Whether the springs of the present solve allow cycles.
    pub(super) fn is_active(&self) -> bool {
        self.active
    }

    /// One cycle as a preconditioner.
    pub(super) fn cycle<'a>(&'a mut self, inverse: &'a [Inverse3]) -> Cycle<'a> {
        Cycle { multigrid: &mut self.multigrid, inverse, largest: self.largest }
    }
}

/// Writes the constants of A.
pub(super) fn set_coefficients(out: &mut Coefficients, hierarchy: &Hierarchy, inputs: &LinearInputs<'_>) {
    let of =
        |material: &Material| CellMaterial { lame: material.lame(), density_kg_m3: material.density_kg_m3 };
    out.materials.clear();
    out.materials.push(of(inputs.material));
    let regions = hierarchy.regions().iter().map(|region| of(&inputs.material.of_region(region)));
    out.materials.extend(regions);
    (out.scale, out.mass_factor) = (inputs.elastic_update().scale, inputs.mass_factor());
}

/// A bound of the largest eigenvalue of D⁻¹A with springs, where it is `known` without them; 0 without springs.
///
/// # Derivation
/// A = A₀ + Σ Sⱼ with Sⱼ = kⱼ Jⱼ Jⱼᵀ, and D = D₀ + Σ Dⱼ. Sⱼ ≤ cⱼ Dⱼ for c carriers (Cauchy–Schwarz), so that λ ≤
/// max(λ₀, cⱼ). Also Sⱼ ≤ κⱼ D with κⱼ = kⱼ Jⱼᵀ D⁻¹ Jⱼ, so that λ ≤ λ₀ + Σ κⱼ. The smaller bound counts.
fn with_springs(known: f64, inverse: &[Inverse3], springs: &[Spring]) -> f64 {
    if springs.is_empty() {
        return 0.0;
    }
    let (mut most, mut sum) = (known, known);
    for spring in springs {
        sum += compliance(spring, |copy| inverse[copy]);
        most = most.max(spring.point.weights().iter().filter(|w| **w != 0.0).count() as f64);
    }
    most.min(sum)
}

/// The stiffness of a spring over that of the body at its point: k Jᵀ D⁻¹ J with the `diagonal` of the body.
fn stiffness_at_point(spring: &Spring, diagonal: &[Block6]) -> f64 {
    compliance(spring, |copy| invert(&diagonal[copy], [false; 3]))
}

/// k Jᵀ D⁻¹ J of a spring.
fn compliance(spring: &Spring, inverse: impl Fn(usize) -> Inverse3) -> f64 {
    let mut sum = 0.0;
    for (copy, w) in spring.point.carriers().filter(|(_, w)| *w != 0.0) {
        let [x, y, z] = inverse(copy).columns();
        let along: f32 = match spring.direction {
            Some(n) => (0..3).map(|i| n[i] * (x[i] * n[0] + y[i] * n[1] + z[i] * n[2])).sum(),
            None => x[0] + y[1] + z[2],
        };
        sum += f64::from(w * w) * f64::from(along);
    }
    f64::from(spring.stiffness) * sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use scindo_matter::element::MaterialPoint;

    #[test]
    fn springs_raise_the_bound_by_no_more_than_they_can() {
        let inverse = vec![Inverse3([[1.0, 0.0, 1.0, 0.0], [0.0, 0.0, 1.0, 0.0]]); 8];
        let point = MaterialPoint::new((0..4).map(|copy| (copy, 0.25_f32)));
        let spring = |stiffness| Spring { point, direction: Some([0.0, 0.6, 0.8]), stiffness };
        assert_eq!(with_springs(2.5, &inverse, &[]), 0.0);
        assert!((with_springs(2.5, &inverse, &[spring(0.4)]) - 2.6).abs() < 1e-6);
        assert_eq!(with_springs(2.5, &inverse, &[spring(1e6)]), 4.0);
    }
}

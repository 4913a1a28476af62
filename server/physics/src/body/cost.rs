//! Costs of a step, and the choice between the two ways to apply the stiffness of tetrahedra.
//!
//! The costs are constants, of tetrahedra from the bench `bar` and of cells from shipped scenes, both on one core; they
//! are not measured at run time. The two ways
//! differ in the last bits, so a choice by the clock would make the bits of a run depend on the load of
//! the machine. Only the ratios of the costs matter. Tetrahedra that stay in the caches take 3.9 ns with AVX-512 and
//! 4.9 ns with AVX2, blocks the same with both; the constants lie between them.

use scindo_algebra::operator::OperatorChoice;
use scindo_algebra::solver::multigrid::CycleShape;
use scindo_algebra::solver::{Method, PcgSettings};
use scindo_matter::material::Law;

/// Up to this many pieces the stiffness stays in the caches from one application to the next.
const CACHED_PIECES: usize = 60_000;

/// Seconds per piece and application from rotated gradients, in the caches and beyond.
const MATRIX_FREE: [f64; 2] = [4.4e-9, 5.2e-9];

/// Seconds per piece and application from assembled blocks, in the caches and beyond.
const ASSEMBLED: [f64; 2] = [3.8e-9, 5.8e-9];

/// Seconds per piece and iteration for the vectors of the solver.
const VECTORS: f64 = 1.6e-9;

/// Seconds per piece to assemble.
const ASSEMBLY: f64 = 88e-9;

/// Seconds per piece and step for forces and other work that is not repeated; with rotations and without.
const STEP: [f64; 2] = [29e-9, 12e-9];

/// Iterations that take the residual down to a tenth, on meshes of some thousand nodes.
const ITERATIONS_PER_DECADE: f64 = 12.0;

/// The same with a two-level preconditioner, and seconds per piece and iteration for its coarse space.
const TWO_LEVEL_ITERATIONS_PER_DECADE: f64 = 5.5;
const COARSE_SPACE: f64 = 5e-9;

/// Seconds per cell and step for rotations and forces of octree cells, and with multigrid for the operators of all
/// levels.
const CELL_STEP: [f64; 2] = [0.3e-6, 0.9e-6];

/// Seconds per cell and iteration without a cycle.
const CELL_ITERATION: f64 = 50e-9;

/// Seconds per cell and iteration with a V-cycle, and with a W-cycle.
const CELL_CYCLE: [f64; 2] = [0.4e-6, 0.7e-6];

/// Iterations with a cycle that take the residual down to a tenth, in a body that is not cut much.
const CYCLES_PER_DECADE: f64 = 1.5;

/// Estimated time [s] of a step of a body of `cells` octree cells on one thread. Cuts that are yet to come add cells, and
/// iterations.
pub(super) fn cell_step_seconds(cells: usize, solver: PcgSettings, cycle: Option<CycleShape>) -> f64 {
    let with_cycle = |shape| CELL_CYCLE[usize::from(shape == CycleShape::W)];
    let (step, per_decade, iteration) = match cycle {
        Some(shape) => (CELL_STEP[1], CYCLES_PER_DECADE, with_cycle(shape)),
        None => (CELL_STEP[0], ITERATIONS_PER_DECADE, CELL_ITERATION),
    };
    cells as f64 * (step + expected_iterations(solver, per_decade) * iteration)
}

/// Estimated time [s] of a step of a body of `pieces` pieces on one thread.
pub(super) fn step_seconds(
    law: Law,
    pieces: usize,
    (solver, method): (PcgSettings, Method),
    assembled: bool,
) -> f64 {
    let beyond = usize::from(pieces > CACHED_PIECES);
    let turns = law != Law::Linear;
    let application = if assembled { ASSEMBLED[beyond] } else { MATRIX_FREE[beyond] };
    // A stiffness that does not turn is assembled once.
    let assembly = if assembled && turns { ASSEMBLY } else { 0.0 };
    let step = STEP[usize::from(!turns)] + assembly;
    let (per_decade, coarse) = match method {
        Method::TwoLevelPcg => (TWO_LEVEL_ITERATIONS_PER_DECADE, COARSE_SPACE),
        _ => (ITERATIONS_PER_DECADE, 0.0),
    };
    let iterations = expected_iterations(solver, per_decade);
    pieces as f64 * (step + iterations * (application + VECTORS + coarse))
}

/// The cheaper of the two ways.
pub(super) fn cheapest(law: Law, pieces: usize, solver: (PcgSettings, Method)) -> OperatorChoice {
    // A tangent of more terms than Hooke's law is always assembled.
    if !law.is_hookean() {
        return OperatorChoice::Assembled;
    }
    let [free, assembled] = [false, true].map(|way| step_seconds(law, pieces, solver, way));
    if assembled < free { OperatorChoice::Assembled } else { OperatorChoice::MatrixFree }
}

/// Iterations that a step is expected to make: those of the tolerance, but no more than allowed.
fn expected_iterations(solver: PcgSettings, per_decade: f64) -> f64 {
    let most = f64::from(solver.iterations);
    if solver.tolerance > 0.0 { most.min(-per_decade * solver.tolerance.log10()) } else { most }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stiffness_is_assembled_where_it_is_used_often_enough() {
        let of = |law, pieces, iterations| {
            cheapest(law, pieces, (PcgSettings { iterations, tolerance: 0.0 }, Method::Pcg))
        };
        assert_eq!(of(Law::Linear, 5_000, 1), OperatorChoice::Assembled);
        assert_eq!(of(Law::Corotational, 12_800, 10), OperatorChoice::MatrixFree);
        assert_eq!(of(Law::Corotational, 12_800, 200), OperatorChoice::Assembled);
        // Where both wait for memory, blocks are the larger part of it.
        assert_eq!(of(Law::Corotational, 500_000, 1000), OperatorChoice::MatrixFree);
        assert_eq!(of(Law::Linear, 500_000, 1000), OperatorChoice::MatrixFree);
    }

    /// Steps of the scenes three-cuts and rods on one core of a server, with the iterations that they made.
    #[test]
    fn steps_of_cells_cost_what_they_took() {
        let of = |cells, solver, cycle| cell_step_seconds(cells, solver, Some(cycle));
        let made = |iterations| PcgSettings { iterations, tolerance: 0.0 };
        let organ = of(17_459, made(4), CycleShape::V);
        let rods = of(39_836, made(8), CycleShape::V);
        assert!((organ / 51.9e-3 - 1.0).abs() < 0.2 && (rods / 156e-3 - 1.0).abs() < 0.2, "{organ} {rods}");
        assert!(of(39_836, made(8), CycleShape::W) > rods);
        // The number for a tolerance is that of a body that is not cut much.
        let expected = of(17_459, PcgSettings { iterations: 30, tolerance: 1e-3 }, CycleShape::V);
        assert!((expected / 51.9e-3 - 1.0).abs() < 0.2, "{expected}");
    }

    #[test]
    fn a_coarse_tolerance_promises_few_iterations() {
        let solver = PcgSettings { iterations: 1000, tolerance: 1e-1 };
        let of = |solver, method| cheapest(Law::Corotational, 12_800, (solver, method));
        assert_eq!(of(solver, Method::Pcg), OperatorChoice::MatrixFree);
        let solver = PcgSettings { tolerance: 1e-14, ..solver };
        assert_eq!(of(solver, Method::Pcg), OperatorChoice::Assembled);
        // So does a coarse space.
        let solver = PcgSettings { tolerance: 1e-13, ..solver };
        assert_eq!(of(solver, Method::Pcg), OperatorChoice::Assembled);
        assert_eq!(of(solver, Method::TwoLevelPcg), OperatorChoice::MatrixFree);
    }
}

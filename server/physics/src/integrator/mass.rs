//! The mass of a body, lumped or consistent, behind one interface.

use nalgebra::Vector3;
use scindo_algebra::assembly::{BlockCsr, Model};
use scindo_algebra::solver::{LinearSettings, LinearSolver, Method, Precision};
use scindo_matter::team::Team;

use super::scheme::MassKind;

/// Mass matrix M [kg].
#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct Mass {
    /// Lumped masses [kg], one per node; they form M if there is no matrix.
    pub lumped: Vec<f64>,
    /// M, if consistent, and ρ ∫ N_a dV [kg].
    pub consistent: Option<(BlockCsr<f64>, Vec<f64>)>,
    solver: LinearSolver,
}

impl Mass {
    pub(super) fn new(model: &Model, density_kg_m3: f64, kind: MassKind) -> Self {
        let lumped = model.lumped_mass(density_kg_m3);
        let consistent = (kind == MassKind::Consistent).then(|| {
            let mut M = model.pattern();
            model.consistent_mass(density_kg_m3, &mut M);
            (M, model.shape_integrals().iter().map(|v| density_kg_m3 * v).collect())
        });
        // With block-Jacobi preconditioning the condition number of M depends on the element type only.
        let linear = LinearSettings {
            method: Method::Pcg,
            precision: Precision::Double,
            iterations: 200,
            tolerance: 1e-13,
        };
        let mut solver = LinearSolver::new(linear);
        if let Some((M, _)) = &consistent {
            solver.set_matrix(M, &[]);
        }
        Self { lumped, consistent, solver }
    }

    /// Weight [N] of node `c` under gravity `g` [m/s²]: its row of M g.
    #[inline]
    pub(super) fn weight(&self, c: usize, g: Vector3<f64>) -> Vector3<f64> {
        match &self.consistent {
            None => self.lumped[c] * g,
            Some((_, integrals)) => integrals[c] * g,
        }
    }

    /// y += s M x.
    pub(super) fn add_times(&self, s: f64, x: &[Vector3<f64>], y: &mut [Vector3<f64>]) {
        for c in 0..y.len() {
            y[c] += s * self.row_times(c, x);
        }
    }

    /// Row `c` of M x.
    #[inline]
    pub(super) fn row_times(&self, c: usize, x: &[Vector3<f64>]) -> Vector3<f64> {
        match &self.consistent {
            None => self.lumped[c] * x[c],
            Some((M, _)) => {
                let mut y = Vector3::zeros();
                for k in M.row(c) {
                    // Every block is a multiple of the identity.
                    y += M.blocks[k][0] * x[M.columns[k] as usize];
                }
                y
            }
        }
    }

    /// ½ vᵀ M v [J].
    pub(super) fn kinetic(&self, v: &[Vector3<f64>]) -> f64 {
        0.5 * (0..v.len()).map(|c| v[c].dot(&self.row_times(c, v))).sum::<f64>()
    }

    /// Adds s M to a matrix with the pattern of the model.
    pub(super) fn add_to(&self, s: f64, A: &mut BlockCsr<f64>) {
        match &self.consistent {
            None => A.add_diagonal(s, &self.lumped),
            Some((M, _)) => A.add_scaled(s, M),
        }
    }

    /// a = M⁻¹ f; a node without mass does not accelerate. The caller treats held directions.
    pub(super) fn solve(&mut self, team: &mut Team, f: &[Vector3<f64>], a: &mut [Vector3<f64>]) {
        match &self.consistent {
            None => {
                for ((a, f), &m) in a.iter_mut().zip(f).zip(&self.lumped) {
                    *a = if m > 0.0 { f / m } else { Vector3::zeros() };
                }
            }
            Some((M, _)) => {
                self.solver.solve(team, M, f, a, None);
            }
        }
    }

    /// Sets the prescribed directions; M⁻¹ then acts on the others.
    pub(super) fn hold(&mut self, fixed: &[scindo_matter::element::FixedCopy]) {
        if let Some((M, _)) = &self.consistent {
            self.solver.set_matrix(M, fixed);
        }
    }
}

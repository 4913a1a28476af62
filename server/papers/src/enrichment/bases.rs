//! One cut body in several bases: the same displacements, other condition numbers and costs.

use std::time::Instant;

use nalgebra::{DMatrix, Matrix3, Vector3};
use scindo_physics::assembly::{BlockCsr, Model, Tangent, Volumetric};
use scindo_physics::cut::{BladeSweep, CutMesh};
use scindo_physics::element::FixedCopy;
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::mesh::{BoxPattern, box_mesh};
use scindo_physics::solver::{LinearSettings, LinearSolver, Method, Precision};
use scindo_physics::team::Team;
use scindo_study::report::result::{Table, Unit};

use super::basis::Enrichment;
use super::view::EnrichedView;
use crate::lab::{ExperimentBench, Trouble};

type V = Vector3<f64>;

/// The bases, with their names.
pub const BASES: [(Enrichment, &str); 3] = [
    (Enrichment::Substitution, "copies of the nodes"),
    (Enrichment::ShiftedHeaviside, "shifted, (H − H_i)/2"),
    (Enrichment::Heaviside, "H"),
];
/// Volume fractions of the slivers beside the cut.
pub const SLIVERS: [f64; 4] = [1e-1, 1e-3, 1e-6, 1e-9];
/// Cells along an edge of the cube: where eigenvalues are computed, and where systems are solved.
const CELLS: [usize; 2] = [4, 6];
const MATERIAL: Material = Material {
    young_pa: 1e5,
    poisson: 0.3,
    density_kg_m3: 1000.0,
    rayleigh: Rayleigh { mass_1_s: 0.0, stiffness_s: 0.0 },
    law: Law::Linear,
};

/// A sliced cube in every basis and for every sliver.
///
/// # Errors
/// The cube cannot be cut, or the user ended the study.
pub fn compared(bench: &mut ExperimentBench<'_>, total: usize) -> Result<Table, Trouble> {
    let mut table = Table::new(
        "One cut body in three bases",
        "A cube held at top and bottom under its weight, cut so that slivers of a fraction of an element remain beside the \
         cut. Off: distance from the displacement on copies, over the largest, both by factorisation. Condition: of the \
         stiffness, as it is and with the diagonal blocks of nodes made the identity. Iterations: conjugate gradients to \
         1e-6, alone and with block-Jacobi.",
        &[
            ("off", Unit::Number),
            ("condition", Unit::Number),
            ("with block-Jacobi", Unit::Number),
            ("blocks", Unit::Count),
            ("iterations", Unit::Count),
            ("with block-Jacobi", Unit::Count),
            ("solve", Unit::Seconds),
        ],
    );
    for fraction in SLIVERS {
        let mut on_copies = Vec::new();
        for (basis, name) in BASES {
            let what = format!("{name}, slivers of {fraction:e}");
            bench.begin(what.as_str(), total)?;
            let small = System::new(CELLS[0], fraction, basis)?;
            let [plain, scaled] = condition_numbers(&small.K, &small.fixed);
            let system = System::new(CELLS[1], fraction, basis)?;
            let u = system.displacement()?;
            if on_copies.is_empty() {
                on_copies.clone_from(&u);
            }
            let largest = on_copies.iter().map(V::norm).fold(0.0, f64::max);
            let off = u.iter().zip(&on_copies).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max) / largest;
            let alone = system.solve(Method::Cg)?.1;
            let from = Instant::now();
            let with_blocks = system.solve(Method::Pcg)?.1;
            let seconds = from.elapsed().as_secs_f64();
            let [blocks, alone, with_blocks] =
                [system.K.blocks.len() as f64, f64::from(alone), f64::from(with_blocks)];
            table.row(what, &[off, plain, scaled, blocks, alone, with_blocks, seconds].map(Some));
        }
    }
    Ok(table)
}

/// The cube under its weight along x, in the degrees of freedom of a basis.
pub(super) struct System {
    view: EnrichedView,
    /// Stiffness [N/m].
    pub(super) K: BlockCsr<f64>,
    load: Vec<V>,
    pub(super) fixed: Vec<FixedCopy>,
}

impl System {
    /// The cube of 0.1 m, held at top and bottom and cut through fraction^⅓ cells above a layer of nodes.
    pub(super) fn new(cells: usize, fraction: f64, basis: Enrichment) -> Result<Self, Trouble> {
        let mut cut = CutMesh::new(box_mesh(V::zeros(), V::repeat(0.1), [cells; 3], BoxPattern::Tet6))?;
        let z = 0.1 / cells as f64 * ((cells / 2) as f64 + fraction.cbrt());
        let blade = |x: f64| [V::new(x, -0.1, z), V::new(x, 0.2, z)];
        let rest = cut.rest_positions();
        cut.sweep(&rest, &BladeSweep { segments: vec![blade(-0.1), blade(0.2)] }, 1)?;
        let model = Model::tet4_cut(&cut, &MATERIAL, Volumetric::Full)?;
        let mut K = model.pattern();
        model.tangent(model.rest(), Tangent::Exact, &mut K);
        let is_held = |X: &V| X.z < 1e-9 || X.z > 0.1 - 1e-9;
        let held = (0u32..).zip(model.rest()).filter(|(_, X)| is_held(X));
        let fixed: Vec<FixedCopy> = held
            .map(|(copy, X)| FixedCopy { copy, held: [true; 3].into(), position_m: (*X).into() })
            .collect();
        let view = EnrichedView::new(&cut, basis);
        let weight = MATERIAL.density_kg_m3 * 9.81;
        let mut load: Vec<V> = model.shape_integrals().iter().map(|v| V::new(weight * v, 0.0, 0.0)).collect();
        view.forces(&mut load);
        let fixed = view.fixed(&fixed).ok_or("a node of the cut is held on one side")?;
        Ok(Self { K: view.matrix(&K), view, load, fixed })
    }

    /// Displacement of the copies [m], by factorisation.
    fn displacement(&self) -> Result<Vec<V>, Trouble> {
        let (mut u, _) = self.solve(Method::Cholesky)?;
        self.view.to_copies(&mut u);
        Ok(u)
    }

    /// The solution to 1e-6 of the residual, and its iterations.
    pub(super) fn solve(&self, method: Method) -> Result<(Vec<V>, u32), Trouble> {
        let settings =
            LinearSettings { method, precision: Precision::Double, iterations: 100_000, tolerance: 1e-6 };
        let mut solver = LinearSolver::new(settings);
        solver.set_matrix(&self.K, &self.fixed);
        let mut x = vec![V::zeros(); self.load.len()];
        let report = solver.solve(&mut Team::new(1)?, &self.K, &self.load, &mut x, None);
        Ok((x, report.iterations))
    }
}

/// Smallest and largest eigenvalue of the free part of A, as it is and with its 3×3 diagonal blocks made
/// the identity: their quotients.
pub(super) fn condition_numbers(A: &BlockCsr<f64>, fixed: &[FixedCopy]) -> [f64; 2] {
    let free: Vec<usize> = (0..A.n_rows()).filter(|&i| fixed.iter().all(|f| f.copy as usize != i)).collect();
    let n = free.len();
    let root = |i: usize| -> Matrix3<f64> {
        let eigen = A.diagonal(i).symmetric_eigen();
        let scale = Matrix3::from_diagonal(&eigen.eigenvalues.map(|l| 1.0 / l.sqrt()));
        eigen.eigenvectors * scale * eigen.eigenvectors.transpose()
    };
    let roots: Vec<Matrix3<f64>> = free.iter().map(|&i| root(i)).collect();
    let (mut plain, mut scaled) = (DMatrix::zeros(3 * n, 3 * n), DMatrix::zeros(3 * n, 3 * n));
    for (i, &r) in free.iter().enumerate() {
        for (j, &c) in free.iter().enumerate() {
            let block = A.block(r, c as u32);
            plain.fixed_view_mut::<3, 3>(3 * i, 3 * j).copy_from(&block);
            scaled.fixed_view_mut::<3, 3>(3 * i, 3 * j).copy_from(&(roots[i] * block * roots[j]));
        }
    }
    [plain, scaled].map(|A| {
        let values = A.symmetric_eigenvalues();
        values.max() / values.min()
    })
}

//! A cube of ν = 0.499 that its own weight compresses: linear elements with a remedy against locking
//! against quadratic tetrahedra, whose last two meshes differ by 1.5 %. A quarter of it is modelled.

use nalgebra::Vector3;
use scindo_physics::assembly::{Model, Volumetric};
use scindo_physics::element::FixedCopy;
use scindo_physics::integrator::{StaticProblem, find_equilibrium};
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::mesh::{BoxPattern, TetMesh, box_hexes, box_mesh};
use scindo_physics::solver::{
    Curvature, LinearSettings, Method, Newton, NewtonReport, NewtonSettings, Precision, StopReason,
};
use scindo_physics::team::Team;

/// Edge of the cube [m], clamped below; its middle planes are x = 0 and y = 0.
const L: f64 = 0.1;
const YOUNG: f64 = 1e4;
/// Cells along the edge: of quadratic tetrahedra, and of linear elements.
const QUADRATIC: usize = 8;
const LINEAR: usize = 12;

/// How the cube ends; lengths over L.
#[derive(Clone, Copy, Debug)]
struct End {
    /// How far a corner, the centre and the mean of the top have come down.
    top: [f64; 3],
    /// V/V₀ − 1.
    volume: f64,
    report: NewtonReport,
}

impl End {
    /// Largest difference of the top from `reference`, relative to it.
    fn tip_error(&self, reference: &End) -> f64 {
        self.top.iter().zip(reference.top).map(|(a, b)| (a / b - 1.0).abs()).fold(0.0, f64::max)
    }
}

fn extent() -> Vector3<f64> {
    Vector3::new(0.5 * L, 0.5 * L, L)
}

fn cells(n: usize) -> [usize; 3] {
    [n / 2, n / 2, n]
}

fn tets(n: usize) -> TetMesh {
    box_mesh(Vector3::zeros(), extent(), cells(n), BoxPattern::Tet5 { parity: false })
}

/// Equilibrium under a weight of `load` · E L².
fn compress(model: &Model, load: f64) -> End {
    let fixed: Vec<FixedCopy> = (0u32..)
        .zip(model.rest())
        .map(|(copy, X)| {
            let clamped = X.z < 1e-9;
            let axes = [clamped || X.x < 1e-9, clamped || X.y < 1e-9, clamped];
            FixedCopy { copy, held: axes.into(), position_m: (*X).into() }
        })
        .filter(|f| f.held.any())
        .collect();
    let weight = load * YOUNG / L;
    let load: Vec<Vector3<f64>> =
        model.shape_integrals().iter().map(|V| Vector3::new(0.0, 0.0, -weight * V)).collect();
    let linear = LinearSettings {
        method: Method::Pcg,
        precision: Precision::Double,
        iterations: 20_000,
        tolerance: 1e-2,
    };
    let settings =
        NewtonSettings { steps: 60, tolerance: 1e-6, halvings: 12, curvature: Curvature::Exact, linear };
    let mut x = model.rest().to_vec();
    let mut team = Team::new(1).unwrap();
    let mut problem = StaticProblem::new(model, &load);
    let report = find_equilibrium(&mut Newton::new(settings), &mut team, &mut problem, &fixed, &mut x);
    assert_eq!(report.stop, StopReason::Converged, "{report:?}");
    let down = |n: usize| (model.rest()[n].z - x[n].z) / L;
    let at = |X: Vector3<f64>| down(model.rest().iter().position(|rest| (rest - X).norm() < 1e-9).unwrap());
    let top: Vec<f64> = (0..x.len()).filter(|&n| model.rest()[n].z > L - 1e-9).map(down).collect();
    let mean = top.iter().sum::<f64>() / top.len() as f64;
    let volume = |x: &[Vector3<f64>]| -> f64 {
        (0..model.n_elements())
            .flat_map(|e| model.weights(e).iter().enumerate().map(move |(q, w)| (e, q, w)))
            .map(|(e, q, w)| w * model.deformation_gradient(e, q, x).determinant())
            .sum()
    };
    let volume = volume(&x) / volume(model.rest()) - 1.0;
    End { top: [at(extent()), at(Vector3::new(0.0, 0.0, L)), mean], volume, report }
}

/// Holds both remedies against quadratic tetrahedra, and against the same elements without remedy.
fn assert_remedies(law: Law, load: f64) {
    let material =
        Material { young_pa: YOUNG, poisson: 0.499, density_kg_m3: 1e3, rayleigh: Rayleigh::default(), law };
    let solve = |name: &str, model: Model| {
        let end = compress(&model, load);
        let End { top, volume, report } = &end;
        println!(
            "{law:?}, {name}: top {top:.5?} L, volume {volume:+.2e}, {} Newton steps, {} CG iterations",
            report.steps, report.linear_iterations
        );
        end
    };
    let reference = solve("Tet10", Model::tet10(&tets(QUADRATIC), &material).unwrap());
    let tet4 = |volumetric| Model::tet4(&tets(LINEAR), &material, volumetric).unwrap();
    let hexes = box_hexes(Vector3::zeros(), extent(), cells(LINEAR));
    let hex8 = |volumetric| Model::hex8(&hexes, &material, volumetric).unwrap();
    for (name, full, remedied) in [
        (
            "Tet4, node-averaged",
            solve("Tet4", tet4(Volumetric::Full)),
            solve("Tet4, node-averaged", tet4(Volumetric::NodeAveraged { kept: 0.05 })),
        ),
        (
            "Hex8, selective",
            solve("Hex8", hex8(Volumetric::Full)),
            solve("Hex8, selective", hex8(Volumetric::Selective)),
        ),
    ] {
        let errors = [full, remedied].map(|end| end.tip_error(&reference));
        println!("{law:?}, {name}: tip off by {:.4}, without remedy by {:.4}", errors[1], errors[0]);
        assert!(remedied.volume.abs() <= 0.005, "{law:?}, {name}: {remedied:?}");
        assert!(errors[1] <= 0.1, "{law:?}, {name}: {errors:?}");
        assert!(errors[1] <= 0.7 * errors[0], "{law:?}, {name}: {errors:?}");
    }
}

/// The top comes down by an eighth.
#[test]
fn remedies_free_a_strongly_compressed_neo_hookean_cube() {
    assert_remedies(Law::NeoHookean, 0.4);
}

/// Small strains, at which tr(RᵀF − I) is the change of volume.
#[test]
fn remedies_free_a_slightly_compressed_corotational_cube() {
    assert_remedies(Law::Corotational, 0.04);
}

/// Cook's membrane in plane strain: a panel that widens towards its clamp, sheared at its far end, so
/// that it bends in its plane. Returns how far the middle of that end goes up.
fn bend(model: &Model) -> f64 {
    let fixed: Vec<FixedCopy> = (0u32..)
        .zip(model.rest())
        .map(|(copy, X)| {
            let clamped = X.x < 1e-9;
            FixedCopy { copy, held: [clamped, clamped, true].into(), position_m: (*X).into() }
        })
        .collect();
    // Total force in proportion to the depth, which differs from mesh to mesh.
    let end: Vec<u32> =
        (0u32..).zip(model.rest()).filter(|(_, X)| X.x > 48.0 - 1e-9).map(|(n, _)| n).collect();
    let depth = model.rest().iter().map(|X| X.z).fold(0.0, f64::max);
    let mut load = vec![Vector3::zeros(); model.n_nodes()];
    end.iter().for_each(|&n| load[n as usize].y = 0.01 * YOUNG * depth / end.len() as f64);
    let linear = LinearSettings {
        method: Method::Cholesky,
        precision: Precision::Double,
        iterations: 20,
        tolerance: 1e-8,
    };
    let settings = NewtonSettings { steps: 10, tolerance: 1e-7, linear, ..NewtonSettings::default() };
    let mut x = model.rest().to_vec();
    let mut problem = StaticProblem::new(model, &load);
    let mut newton = Newton::new(settings);
    let report = find_equilibrium(&mut newton, &mut Team::new(1).unwrap(), &mut problem, &fixed, &mut x);
    assert!(matches!(report.stop, StopReason::Converged | StopReason::Stagnated), "{report:?}");
    let up: f64 = end.iter().map(|&n| x[n as usize].y - model.rest()[n as usize].y).sum();
    up / end.len() as f64
}

fn cook(n: usize, pattern: BoxPattern) -> TetMesh {
    let depth = 48.0 / n as f64;
    let mut mesh = box_mesh(Vector3::zeros(), Vector3::new(48.0, 1.0, depth), [n, n, 1], pattern);
    for X in &mut mesh.nodes {
        let along = X.x / 48.0;
        X.y = 44.0 * along + X.y * (44.0 - 28.0 * along);
    }
    mesh
}

/// Compression alone does not show it: in bending a share of λ that grows with λ locks.
#[test]
fn node_averaging_does_not_lock_in_bending() {
    let material = Material {
        young_pa: YOUNG,
        poisson: 0.499,
        density_kg_m3: 1e3,
        rayleigh: Rayleigh::default(),
        law: Law::Linear,
    };
    let reference = bend(&Model::tet10(&cook(12, BoxPattern::Tet5 { parity: false }), &material).unwrap());
    // What is left of locking on this mesh, and what there is without a remedy (measured: 5.3 and 11.2 %,
    // 11.9 and 64.1 %): six tetrahedra per cell lock far more than five.
    for (pattern, remains, locks) in
        [(BoxPattern::Tet5 { parity: false }, 0.06, 0.10), (BoxPattern::Tet6, 0.125, 0.50)]
    {
        let up = |volumetric| bend(&Model::tet4(&cook(16, pattern), &material, volumetric).unwrap());
        let [full, averaged] = [Volumetric::Full, Volumetric::NodeAveraged { kept: 0.05 }].map(up);
        let [full, averaged] = [full, averaged].map(|up| up / reference - 1.0);
        println!("{pattern:?}: node-averaged {:+.3}, without remedy {:+.3}", averaged, full);
        assert!(averaged.abs() < remains, "{pattern:?}: {averaged}");
        assert!(full < -locks, "{pattern:?}: the case must be one that locks, {full}");
    }
}

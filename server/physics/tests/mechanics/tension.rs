//! Stretched bodies come to rest where they balance, whatever the step.

use nalgebra::Vector3;
use scindo_physics::body::{
    Ablation, Arithmetic, Body, BodySettings, Method, Notice, Outcome, PcgSettings, Scheme,
};
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::mesh::{BoxPattern, box_mesh};
use scindo_physics::octree::{BoxShape, Octree, OctreeSettings};
use scindo_physics::space::OctreeSpace;

const DOWN: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);
const LENGTH: f64 = 0.1;

fn tissue(young_pa: f64, stiffness_s: f64) -> Material {
    let rayleigh = Rayleigh { mass_1_s: 0.0, stiffness_s };
    Material { young_pa, poisson: 0.4, density_kg_m3: 1000.0, rayleigh, law: Law::Corotational }
}

/// A strip of 100 × 20 × 2 mm in tetrahedra.
fn strip(material: Material, settings: BodySettings) -> Body {
    let size = Vector3::new(LENGTH, 0.02, 0.002);
    let mesh = box_mesh(Vector3::zeros(), size, [40, 8, 1], BoxPattern::Tet5 { parity: false });
    Body::new(mesh, material, settings).unwrap()
}

/// A strip of 100 × 20 × 2.5 mm in octree cells.
fn strip_of_cells(material: Material, settings: BodySettings) -> Body {
    let shape = BoxShape { min: Vector3::zeros(), max: Vector3::new(LENGTH, 0.02, 0.0025) };
    let octree = Octree::fill(&shape, OctreeSettings { cells: 40, levels: 0 }, &|_| 0).unwrap();
    Body::of_space(Box::new(OctreeSpace::new(octree)), material, settings).unwrap()
}

fn scheme(scheme: Scheme) -> BodySettings {
    BodySettings { scheme, ..BodySettings::default() }
}

/// How a strip ends that is clamped at both ends and drawn out in one second.
#[derive(Debug)]
struct End {
    /// Mean displacement downwards [mm] of the middle in the last second.
    sag_mm: f64,
    /// How far it moves up and down in that second [mm].
    range_mm: f64,
    /// Root of the mean square of the velocity [m/s].
    speed_m_s: f64,
    /// Steps with inverted elements.
    inverted: usize,
    /// Steps after which energy had come from nowhere.
    unbalanced: usize,
    /// Mean iterations of a step in the last second.
    iterations: f64,
}

fn nodes(body: &Body, inside: impl Fn(&Vector3<f64>) -> bool) -> Vec<u32> {
    (0..).zip(body.rest_positions()).filter(|(_, X)| inside(X)).map(|(n, _)| n).collect()
}

fn stretched(mut body: Body, stretch: f64, h: f64) -> End {
    let seconds = 6.0;
    let (left, right) = (nodes(&body, |X| X.x < 1e-9), nodes(&body, |X| X.x > LENGTH - 1e-9));
    let middle = nodes(&body, |X| (X.x - 0.5 * LENGTH).abs() < 1e-9 && (X.y - 0.01).abs() < 1e-9);
    assert_eq!(middle.len(), 2);
    body.fix(&left, [true; 3], Vector3::zeros()).unwrap();
    body.fix(&right, [true; 3], Vector3::new(stretch * LENGTH, 0.0, 0.0)).unwrap();
    let (mut sags, mut inverted, mut unbalanced, mut iterations) = (Vec::new(), 0, 0, 0);
    for k in 0..(seconds / h).round() as usize {
        let time = (k + 1) as f64 * h;
        body.set_prescribed_share(time.min(1.0));
        let report = body.step(h, DOWN, &[]);
        assert_eq!(report.outcome, Outcome::Advanced, "step {k}: {report:?}");
        inverted += usize::from(report.inverted_pieces > 0);
        unbalanced += usize::from(matches!(report.notice, Some(Notice::Unbalanced { .. })));
        if time > seconds - 1.0 {
            iterations += report.iterations;
            let sag = |&n: &u32| body.rest_positions()[n as usize].z - body.positions()[n as usize].z;
            sags.push(1e3 * middle.iter().map(sag).sum::<f64>() / 2.0);
        }
    }
    let range = sags.iter().fold([f64::INFINITY, 0.0_f64], |[low, high], s| [low.min(*s), high.max(*s)]);
    End {
        sag_mm: sags.iter().sum::<f64>() / sags.len() as f64,
        range_mm: range[1] - range[0],
        speed_m_s: (2.0 * body.kinetic_energy() / body.total_mass()).sqrt(),
        inverted,
        unbalanced,
        iterations: f64::from(iterations) / sags.len() as f64,
    }
}

/// Sag [mm] in equilibrium by stretch, of E = 10 kPa; found by Newton's method, and by steps of 2 ms.
const RESTS: [(f64, f64); 5] = [(0.0, 16.338), (0.05, 12.7365), (0.1, 9.8133), (0.2, 6.4359), (0.5, 3.46756)];
/// The same of E = 100 kPa.
const STIFF: (f64, f64) = (0.1, 1.15833);
/// The same of cells.
const CELLS: [(f64, f64); 3] = [(0.0, 16.3583), (0.1, 9.86225), (0.5, 3.47756)];

#[track_caller]
fn assert_rests(end: &End, sag_mm: f64) {
    assert!((end.sag_mm / sag_mm - 1.0).abs() < 2e-4, "not {sag_mm} mm: {end:?}");
    assert!(end.range_mm < 2e-3 && end.inverted == 0 && end.unbalanced == 0, "{end:?}");
}

#[test]
fn a_stretched_strip_rests_where_it_balances_in_steps_of_any_length() {
    for damping in [0.02, 0.0] {
        for (stretch, sag_mm) in RESTS {
            let end = stretched(strip(tissue(1e4, damping), scheme(Scheme::ImplicitEuler)), stretch, 0.02);
            assert_rests(&end, sag_mm);
            assert!(end.speed_m_s < 1e-6 && end.iterations < 60.0, "{stretch}, {damping}: {end:?}");
        }
        for h in [0.005, 0.01, 0.04] {
            let end = stretched(strip(tissue(1e4, damping), scheme(Scheme::ImplicitEuler)), 0.1, h);
            assert_rests(&end, RESTS[2].1);
        }
        let end = stretched(strip(tissue(1e5, damping), scheme(Scheme::ImplicitEuler)), STIFF.0, 0.02);
        assert_rests(&end, STIFF.1);
    }
}

#[test]
fn a_stretched_strip_of_cells_rests_where_it_balances() {
    for damping in [0.02, 0.0] {
        for (stretch, sag_mm) in CELLS {
            let body = strip_of_cells(tissue(1e4, damping), scheme(Scheme::ImplicitEuler));
            assert_rests(&stretched(body, stretch, 0.02), sag_mm);
        }
    }
}

/// Cells that are merged for the simulation carry the twists of the fine ones.
#[test]
fn a_simulated_level_rests_alike_in_steps_of_any_length() {
    let settings = BodySettings { simulate_level: 1, method: Method::MgPcg, ..scheme(Scheme::ImplicitEuler) };
    for stretch in [0.1, 0.5] {
        let ends = [0.01, 0.04].map(|h| stretched(strip_of_cells(tissue(1e4, 0.02), settings), stretch, h));
        ends.iter().for_each(|end| assert_rests(end, ends[0].sag_mm));
    }
}

#[test]
fn bdf2_rests_there_too() {
    for (stretch, sag_mm) in [RESTS[0], RESTS[2], RESTS[4]] {
        for h in [0.005, 0.02] {
            let end = stretched(strip(tissue(1e4, 0.02), scheme(Scheme::Bdf2)), stretch, h);
            assert_rests(&end, sag_mm);
        }
        let end = stretched(strip(tissue(1e4, 0.0), scheme(Scheme::Bdf2)), stretch, 0.02);
        assert_rests(&end, sag_mm);
        assert!(end.speed_m_s < 1e-5, "{end:?}");
    }
    let end = stretched(strip_of_cells(tissue(1e4, 0.02), scheme(Scheme::Bdf2)), 0.1, 0.02);
    assert_rests(&end, CELLS[1].1);
}

/// Newmark's method has no damping of its own: what damps the strip is its material, and nothing damps what solves leave.
#[test]
fn newmarks_method_rests_there_too() {
    let solver = PcgSettings { iterations: 2000, tolerance: 1e-4 };
    let newmark = BodySettings { solver, ..scheme(Scheme::Newmark { beta: 0.25, gamma: 0.5 }) };
    for (young_pa, stretch, h) in [(1e4, 0.1, 0.04), (1e5, 0.1, 0.02), (1e5, 0.5, 0.02)] {
        let tissue = tissue(young_pa, 0.02);
        let rest = stretched(strip(tissue, scheme(Scheme::ImplicitEuler)), stretch, h);
        let end = stretched(strip(tissue, newmark), stretch, h);
        let off = (end.sag_mm / rest.sag_mm - 1.0).abs();
        assert!(
            off < 0.005 && end.range_mm < 0.02 * rest.sag_mm,
            "{young_pa}, {stretch}: {end:?} of {rest:?}"
        );
        assert_eq!((end.inverted, end.unbalanced), (0, 0), "{young_pa}, {stretch}");
    }
}

/// Without the twists, the strip shakes, and says so.
#[test]
fn what_does_not_balance_is_noticed() {
    for (young_pa, damping, stretch) in [(1e4, 0.02, 0.1), (1e4, 0.0, 0.5), (1e4, 0.0, 0.0), (1e5, 0.02, 0.1)]
    {
        for name in [Scheme::ImplicitEuler, Scheme::Bdf2] {
            let ablation = Ablation { twists: true, ..Ablation::default() };
            let settings = BodySettings { ablation, ..scheme(name) };
            for make in [strip, strip_of_cells] {
                let end = stretched(make(tissue(young_pa, damping), settings), stretch, 0.02);
                assert!(end.unbalanced > 0, "{name:?} {young_pa} {damping} {stretch}: {end:?}");
            }
        }
    }
}

/// A free cube that spins is not damped by what damps strain, and never gains energy.
#[test]
fn damping_leaves_a_spinning_body_alone() {
    let h = 0.02;
    let end = |turn: f64, damping: f64| {
        let settings = scheme(Scheme::ImplicitEuler);
        let size = Vector3::repeat(0.1);
        let mesh = box_mesh(-0.5 * size, size, [3, 3, 3], BoxPattern::Tet5 { parity: false });
        let mut body = Body::new(mesh, tissue(1e5, damping * h), settings).unwrap();
        let x = body.positions().to_vec();
        let spin = Vector3::new(0.0, 0.0, turn / h);
        let v: Vec<Vector3<f64>> = x.iter().map(|x| spin.cross(x)).collect();
        body.set_state(&x, &v).unwrap();
        let start = body.kinetic_energy();
        for _ in 0..50 {
            body.step(h, Vector3::zeros(), &[]);
            let energy = body.kinetic_energy() + body.elastic_energy();
            assert!(energy <= start * (1.0 + 1e-9), "{turn} {damping}: {energy} of {start}");
        }
        body.kinetic_energy() / start
    };
    for (turn, least) in [(0.1, 0.6), (0.2, 0.36), (0.4, 0.26)] {
        let [free, damped] = [end(turn, 0.0), end(turn, 1.0)];
        assert!(free > least && (damped / free - 1.0).abs() < 0.06, "{turn}: {free} {damped}");
    }
}

/// What one linear solve per step leaves of its equations moves the tip of a falling cantilever less than the error of
/// the step does.
#[test]
fn one_solve_follows_newtons_method() {
    for (material, most) in [(tissue(1e4, 0.0), 0.06), (tissue(1e5, 0.002), 0.3)] {
        let fall = |settings: BodySettings, parts: usize| {
            let mut body = strip(material, settings);
            let held = nodes(&body, |X| X.x < 1e-9);
            let tip = nodes(&body, |X| X.x > LENGTH - 1e-9 && (X.y - 0.01).abs() < 1e-9)[0] as usize;
            body.fix(&held, [true; 3], Vector3::zeros()).unwrap();
            let mut path = Vec::new();
            for _ in 0..50 {
                for _ in 0..parts {
                    assert_eq!(body.step(0.02 / parts as f64, DOWN, &[]).outcome, Outcome::Advanced);
                }
                path.push(body.positions()[tip]);
            }
            path
        };
        let solver = PcgSettings { iterations: 2000, tolerance: 1e-6 };
        let one = BodySettings { solver, ..scheme(Scheme::ImplicitEuler) };
        let newton = BodySettings { arithmetic: Some(Arithmetic::Double), newton_steps: Some(40), ..one };
        let (one, many, exact) = (fall(one, 1), fall(newton, 1), fall(newton, 8));
        let apart = |a: &[Vector3<f64>], b: &[Vector3<f64>]| {
            (a.iter().zip(b).map(|(a, b)| (a - b).norm_squared()).sum::<f64>() / a.len() as f64).sqrt()
        };
        let (left, error) = (apart(&one, &many), apart(&many, &exact));
        assert!(left < most * error, "{}: {left} m, {error} m", material.young_pa);
    }
}

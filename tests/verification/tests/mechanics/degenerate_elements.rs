//! Needles, slivers and caps in the rest mesh cost no iterations: conjugate gradients on cubes with
//! elements of relative height 1e-2 … 1e-6, against the same cube without them.

use nalgebra::Vector3;
use scindo_physics::body::{Arithmetic, Body, BodySettings, Outcome, PcgSettings, StiffMotions};
use scindo_physics::material::Law;
use scindo_physics::mesh::{BoxPattern, TetMesh, box_mesh};

use crate::support::material;

type V = Vector3<f64>;

const SIDE: f64 = 0.1;
const STEPS: usize = 10;
/// Length of a step [s].
const H: f64 = 0.02;
const TOLERANCE: f64 = 1e-4;
const HEIGHTS: [f64; 3] = [1e-2, 1e-4, 1e-6];

/// A cube in which every so many tetrahedra have an inner node with these barycentric coordinates.
fn ruined(every: usize, weights: [f64; 4]) -> TetMesh {
    let mut mesh = box_mesh(V::zeros(), V::repeat(SIDE), [4; 3], BoxPattern::Tet6);
    let sum: f64 = weights.iter().sum();
    for e in (0..mesh.tets.len()).filter(|e| every > 0 && e % every == 0) {
        let point = mesh.corners(e).iter().zip(weights).map(|(X, w)| w / sum * X).sum();
        let (nodes, apex) = (mesh.tets[e], mesh.nodes.len() as u32);
        mesh.nodes.push(point);
        for k in 0..4 {
            let mut tet = nodes;
            tet[k] = apex;
            if k == 0 { mesh.tets[e] = tet } else { mesh.tets.push(tet) }
        }
    }
    mesh
}

/// A cube held by its top under a gravity that goes round: most iterations per linear system, where the
/// lowest corner ended, and what the solver says of the mesh.
fn hang(mesh: TetMesh, law: Law, settings: BodySettings) -> (f64, V, StiffMotions) {
    let top: Vec<u32> =
        (0u32..).zip(&mesh.nodes).filter(|(_, X)| X.z > 0.999 * SIDE).map(|(n, _)| n).collect();
    let mut body = Body::new(mesh, material(1e5, 0.33, 1000.0, law), settings).unwrap();
    body.fix(&top, [true; 3], V::zeros()).unwrap();
    let mut most = 0.0_f64;
    for step in 0..STEPS {
        let angle = 1.3 * step as f64;
        let report = body.step(H, 9.81 * V::new(angle.cos(), angle.sin(), -0.5), &[]);
        assert_eq!(report.outcome, Outcome::Advanced);
        assert!(report.iterations < 5_000, "{report:?}");
        most = most.max(f64::from(report.iterations) / f64::from(report.newton_steps));
    }
    (most, body.positions()[0], body.stiff_motions())
}

fn compare(path: &str, law: Law, arithmetic: Arithmetic) {
    let settings = BodySettings {
        solver: PcgSettings { iterations: 5_000, tolerance: TOLERANCE },
        arithmetic: Some(arithmetic),
        ..BodySettings::default()
    };
    let (clean, corner, none) = hang(ruined(0, [1.0; 4]), law, settings);
    println!("{path}, clean: {clean:.1} iterations");
    assert_eq!(none, StiffMotions::default());
    for d in HEIGHTS {
        let kinds = [
            ("caps", 7, [d, 1.0, 1.0, 1.0]),
            ("slivers", 11, [d, d, 1.0, 1.0]),
            ("needles", 13, [d, d, d, 1.0]),
        ];
        for (kind, every, weights) in kinds {
            let (most, at, stiff) = hang(ruined(every, weights), law, settings);
            let off = (at - corner).norm() / SIDE;
            println!("{path}, {kind} of {d:e}: {most:.1} iterations, corner {off:.1e} edges off, {stiff:?}");
            assert!(most <= 1.5 * clean, "{path}, {kind}, {d:e}: {most} iterations, {clean} without");
            assert!(stiff.substituted > 0 && stiff.left == 0);
            // The mesh is another one: a little softer.
            assert!(off < 0.02, "{path}, {kind}, {d:e}: {off}");
        }
    }
}

#[test]
fn fast_path() {
    compare("fast path, corotational", Law::Corotational, Arithmetic::Single);
    compare("fast path, linear", Law::Linear, Arithmetic::Single);
}

#[test]
fn general_path() {
    compare("general path, mixed", Law::Corotational, Arithmetic::Mixed);
    compare("general path, double", Law::Corotational, Arithmetic::Double);
    compare("general path, Neo-Hookean", Law::NeoHookean, Arithmetic::Mixed);
}

/// The same bits for any number of threads, also where the solver works in other variables.
#[test]
fn threads_change_nothing() {
    for arithmetic in [Arithmetic::Single, Arithmetic::Mixed] {
        let run = |threads| {
            let settings = BodySettings { threads, arithmetic: Some(arithmetic), ..BodySettings::default() };
            hang(ruined(7, [1e-4, 1.0, 1.0, 1.0]), Law::Corotational, settings)
        };
        assert_eq!(run(1), run(3));
    }
}

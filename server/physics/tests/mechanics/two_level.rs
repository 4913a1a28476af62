//! Bodies of tetrahedra stepped with a two-level preconditioner: the same motion in few iterations, whatever the mesh
//! and whatever is cut, held or touched.

use nalgebra::Vector3;
use scindo_allocations::allocations;
use scindo_physics::body::{
    Body, BodySettings, Method, PcgSettings, PointSpring, Scheme, SolveReport, SpringKind,
};
use scindo_physics::cut::BladeSweep;
use scindo_physics::element::MaterialPoint;
use scindo_physics::material::{Law, Material};
use scindo_physics::mesh::{BoxPattern, box_mesh};

use crate::{DOWN, SOFT, apart, hold_left, tumbling_blade};

fn with(method: Method, scheme: Scheme, tolerance: f64) -> BodySettings {
    let solver = PcgSettings { iterations: 3000, tolerance };
    BodySettings { solver, method, scheme, ..BodySettings::default() }
}

/// A bar five times as long as wide, held at its left.
fn bar(cells: usize, material: Material, settings: BodySettings) -> Body {
    let size = Vector3::new(1.0, 0.2, 0.2);
    let mesh =
        box_mesh(Vector3::zeros(), size, [5 * cells, cells, cells], BoxPattern::Tet5 { parity: false });
    let mut body = Body::new(mesh, material, settings).unwrap();
    assert!(body.is_fast());
    hold_left(&mut body);
    body
}

/// A blade across the bar at `x`, from above down to y = `to`.
fn slit(x: f64, to: f64) -> BladeSweep {
    let segment = |y: f64| [Vector3::new(x, y, -0.3), Vector3::new(x + 0.003, y, 0.5)];
    BladeSweep { segments: vec![segment(0.6), segment(to)] }
}

fn advance(body: &mut Body, h: f64, springs: &[PointSpring]) -> SolveReport {
    let report = body.step(h, DOWN, springs);
    assert!(!report.is_unconverged(), "{report:?}");
    report
}

#[test]
fn iterations_hardly_depend_on_the_mesh_and_on_cuts() {
    let (mut counts, mut cut_counts) = (Vec::new(), Vec::new());
    for cells in [6, 10, 16] {
        let run = |method| {
            let mut body = bar(cells, SOFT, with(method, Scheme::ImplicitEuler, 1e-6));
            let whole = (0..3).map(|_| advance(&mut body, 0.04, &[]).iterations).max().unwrap();
            for (incision, x) in [(1, 0.31), (2, 0.52), (3, 0.77)] {
                assert!(body.cut(&slit(x, 0.06), incision).unwrap().faces_opened > 0);
            }
            let cut = (0..3).map(|_| advance(&mut body, 0.04, &[]).iterations).max().unwrap();
            ([whole, cut], body)
        };
        let ((two_level, a), (pcg, b)) = (run(Method::TwoLevelPcg), run(Method::Pcg));
        let case = format!("{cells} cells: {two_level:?} iterations, {pcg:?} with block-Jacobi");
        assert!(two_level.iter().zip(&pcg).all(|(two, one)| 3 * two < *one), "{case}");
        // Block-Jacobi leaves the larger error of the two.
        assert!(apart(&a, &b) < 1e-4, "{case}: {:e} m apart", apart(&a, &b));
        counts.push(two_level[0]);
        cut_counts.push(two_level[1]);
    }
    assert!(counts[2] <= counts[0] + 6, "{counts:?}");
    // A deep cut makes the body softer than the coarse space beside it can follow.
    assert!(cut_counts[2] <= cut_counts[0] + 12, "{cut_counts:?}");
    assert!(
        cut_counts.iter().zip(&counts).all(|(cut, whole)| cut <= &(2 * whole)),
        "{counts:?} {cut_counts:?}"
    );
}

#[test]
fn stiffness_hardly_costs_iterations() {
    let run = |young_pa| {
        let mut body =
            bar(8, Material { young_pa, ..SOFT }, with(Method::TwoLevelPcg, Scheme::ImplicitEuler, 1e-5));
        (0..4).map(|_| advance(&mut body, 0.02, &[]).iterations).max().unwrap()
    };
    let counts = [1e4, 1e6, 1e8].map(run);
    assert!(counts[2] <= counts[0] + 10, "{counts:?}");
}

#[test]
fn motion_is_that_of_block_jacobi_for_all_schemes_and_laws() {
    let newmark = Scheme::Newmark { beta: 0.25, gamma: 0.5 };
    for law in [Law::Linear, Law::Corotational] {
        for scheme in [Scheme::ImplicitEuler, Scheme::Bdf2, newmark] {
            let run = |method| {
                let mut body = bar(5, Material { law, ..SOFT }, with(method, scheme, 3e-7));
                let mut iterations = 0;
                for k in 0..8 {
                    if k == 4 {
                        body.cut(&slit(0.45, 0.05), 1).unwrap();
                    }
                    let springs =
                        if k % 2 == 1 { &held_at(&body, Vector3::new(0.97, 0.1, 0.1), 1e5)[..] } else { &[] };
                    iterations += advance(&mut body, 0.02, springs).iterations;
                }
                (iterations, body)
            };
            let ((two_level, a), (pcg, b)) = (run(Method::TwoLevelPcg), run(Method::Pcg));
            let case = format!("{law:?}, {scheme:?}: {two_level} iterations, {pcg} with block-Jacobi");
            // 8 steps of a bar of 1 m, each with the error that the norm of block-Jacobi does not see.
            assert!(apart(&a, &b) < 2e-4, "{case}: {:e} m apart", apart(&a, &b));
            assert!(2 * two_level < pcg, "{case}");
        }
    }
}

#[test]
fn equilibria_of_the_linear_law_take_few_iterations() {
    let run = |method| {
        let mut body = bar(10, Material { law: Law::Linear, ..SOFT }, with(method, Scheme::Static, 1e-6));
        body.cut(&slit(0.45, 0.05), 1).unwrap();
        let report = advance(&mut body, 1.0, &[]);
        (report.iterations, body)
    };
    let ((two_level, a), (pcg, b)) = (run(Method::TwoLevelPcg), run(Method::Pcg));
    assert!(5 * two_level < pcg, "{two_level} {pcg}");
    let sag = b.positions().iter().zip(b.rest_positions()).map(|(x, X)| (x - X).norm()).fold(0.0, f64::max);
    assert!(apart(&a, &b) < 1e-3 * sag, "{:e} of {sag}", apart(&a, &b));
}

/// A spring that holds the material at a place of the bar at rest.
fn held_at(body: &Body, place: Vector3<f64>, stiffness_n_m: f64) -> [PointSpring; 1] {
    let mut at = body.locate(place, None).unwrap();
    let kind = SpringKind::Hold { target_m: place + Vector3::new(0.0, 0.02, 0.0) };
    let point = MaterialPoint::new(body.carriers(&mut at));
    [PointSpring { point, kind, stiffness_n_m, max_force_n: 1e9 }]
}

#[test]
fn a_loose_body_cut_to_pieces_keeps_few_iterations() {
    let run = |method| {
        let mesh = box_mesh(Vector3::zeros(), Vector3::repeat(0.1), [8; 3], BoxPattern::Tet6);
        let mut body = Body::new(mesh, SOFT, with(method, Scheme::ImplicitEuler, 1e-5)).unwrap();
        let mut most = 0;
        for k in 0..6 {
            body.cut(&tumbling_blade(&body, k), k + 1).unwrap();
            most = most.max(advance(&mut body, 0.01, &[]).iterations);
        }
        (most, body)
    };
    let ((two_level, a), (pcg, b)) = (run(Method::TwoLevelPcg), run(Method::Pcg));
    assert!(two_level <= pcg, "{two_level} {pcg}");
    assert!(apart(&a, &b) < 1e-5, "{:e} m apart", apart(&a, &b));
}

/// Flat elements make the solver work in other variables.
#[test]
fn flat_elements_keep_few_iterations() {
    let run = |method| {
        let mut mesh = box_mesh(Vector3::zeros(), Vector3::new(0.5, 0.1, 0.1), [30, 6, 6], BoxPattern::Tet6);
        for e in (0..mesh.tets.len()).step_by(17) {
            let weights = [1e-4, 0.3333, 0.3333, 0.3333];
            let point = mesh.corners(e).iter().zip(weights).map(|(X, w)| w * X).sum();
            let (nodes, apex) = (mesh.tets[e], mesh.nodes.len() as u32);
            mesh.nodes.push(point);
            for k in 0..4 {
                let mut tet = nodes;
                tet[k] = apex;
                if k == 0 { mesh.tets[e] = tet } else { mesh.tets.push(tet) }
            }
        }
        let mut body = Body::new(mesh, SOFT, with(method, Scheme::ImplicitEuler, 1e-5)).unwrap();
        hold_left(&mut body);
        let most = (0..4).map(|_| advance(&mut body, 0.02, &[]).iterations).max().unwrap();
        assert!(body.stiff_motions().substituted > 0);
        (most, body)
    };
    let ((two_level, a), (pcg, b)) = (run(Method::TwoLevelPcg), run(Method::Pcg));
    assert!(2 * two_level < pcg, "{two_level} {pcg}");
    assert!(apart(&a, &b) < 1e-4, "{:e} m apart", apart(&a, &b));
}

#[test]
fn steps_are_free_of_allocations_and_the_same_on_any_number_of_threads() {
    let run = |threads| {
        let settings = BodySettings { threads, ..with(Method::TwoLevelPcg, Scheme::ImplicitEuler, 1e-5) };
        let mut body = bar(8, SOFT, settings);
        body.cut(&slit(0.45, 0.05), 1).unwrap();
        let springs = held_at(&body, Vector3::new(0.97, 0.1, 0.1), 1e4);
        for _ in 0..5 {
            advance(&mut body, 0.04, &springs);
        }
        let before = allocations();
        // Long enough for the bar to turn by more than the coarse matrix tolerates.
        for _ in 0..8 {
            advance(&mut body, 0.04, &[]);
            advance(&mut body, 0.04, &springs);
        }
        assert_eq!(allocations() - before, 0, "{threads} threads");
        body.positions().to_vec()
    };
    let one = run(1);
    assert_eq!(one, run(2));
    assert_eq!(one, run(3));
}

#[test]
fn other_elements_are_refused_with_advice() {
    let mesh = box_mesh(Vector3::zeros(), Vector3::repeat(1.0), [2; 3], BoxPattern::Tet6);
    let settings = with(Method::TwoLevelPcg, Scheme::ImplicitEuler, 1e-5);
    for element in [scindo_physics::body::ElementKind::Hex8, scindo_physics::body::ElementKind::Octree] {
        let message = BodySettings { element, ..settings }.check(Law::Linear).unwrap_err().to_string();
        assert!(message.contains("two-level") && message.contains("mg-pcg"), "{message}");
    }
    assert!(Body::new(mesh, SOFT, settings).is_ok());
}

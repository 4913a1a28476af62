//! Cut quadratic tetrahedra as bodies: what a cut must keep, what it takes along, and what it can take back.

use nalgebra::Vector3;
use scindo_physics::body::{Body, BodySettings, ElementKind, Outcome, StaticSettings, StopReason};
use scindo_physics::cut::BladeSweep;
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::mesh::{BoxPattern, box_mesh};

use crate::{DOWN, SOFT, settings, tumbling_blade};

/// A blade along z that sweeps the plane x = `at` through a body of 0.1 m.
fn slice(at: f64, from_y: f64, to_y: f64) -> BladeSweep {
    let segment = |y: f64| [Vector3::new(at, y, -0.5), Vector3::new(at, y, 0.5)];
    BladeSweep { segments: vec![segment(from_y), segment(to_y)] }
}

fn quadratic() -> BodySettings {
    BodySettings { element: ElementKind::Tet10, ..settings(2000, 1e-6) }
}

/// A cube of 0.1 m.
fn cube(cells: usize, material: Material) -> Body {
    crate::cube(cells, material, quadratic())
}

/// Corners and middles on a plane of the uncut body.
fn nodes_where(body: &Body, on: impl Fn(&Vector3<f64>) -> bool) -> Vec<u32> {
    (0..body.n_nodes() as u32).filter(|&n| on(&body.rest_positions()[n as usize])).collect()
}

fn farthest(a: &[Vector3<f64>], b: &[Vector3<f64>]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
}

/// Stretched evenly, a cut keeps everything; bent, all but a little of the elastic energy, because thin pieces resist
/// curvature as thicker ones do.
#[test]
fn a_cut_keeps_mass_motion_and_energy() {
    for (curvature, off) in [(0.0, 1e-12), (3.0, 1e-3)] {
        let mut body = cube(4, Material { law: Law::Linear, ..SOFT });
        let bent = |x: &Vector3<f64>| Vector3::new(1.1 * x.x, x.y + curvature * x.x * x.x, x.z);
        let x: Vec<_> = body.positions().iter().map(bent).collect();
        let v: Vec<_> = x.iter().map(|x| Vector3::new(0.3, 5.0 * x.x, -2.0 * x.y)).collect();
        body.set_state(&x, &v).unwrap();
        let measure = |b: &Body| {
            let (L, c) = (b.angular_momentum(), b.centre_of_mass());
            [b.total_mass(), b.momentum().norm(), L.norm(), c.norm(), b.kinetic_energy(), b.volume()]
        };
        let (before, energy) = (measure(&body), body.elastic_energy());
        for (incision, at) in [(1, 0.031), (2, 0.0671), (3, 0.04)] {
            let (copies, numbers) = (body.n_copies(), body.positions().len());
            let report = body.cut(&slice(at, -0.5, 0.5), incision).unwrap();
            assert_eq!(body.positions().len(), numbers + report.new_copies.len());
            assert!(body.n_copies() > copies && body.n_copies() - copies < report.new_copies.len());
            for (found, before) in measure(&body).into_iter().zip(before) {
                assert!((found / before - 1.0).abs() < 1e-12, "{incision}: {found} {before}");
            }
            let jump = (body.elastic_energy() / energy - 1.0).abs();
            assert!(jump < off, "{incision}: {jump} of the energy");
            // Every number is where the material of its node is: the cut moves nothing.
            let there: Vec<_> = body.rest_positions().iter().map(bent).collect();
            assert!(farthest(body.positions(), &there) < 1e-15);
            let flaws = body.flaws();
            assert!(flaws.surface == 0 && flaws.parts == 0 && flaws.volume < 1e-12, "{flaws:?}");
        }
        assert_eq!(body.parts().len(), 4);
    }
}

/// Weights of thin pieces sit at nodes far outside them, and must not curve them: all numbers stay near their places.
#[test]
fn thin_pieces_bear_their_weight() {
    for thickness in [1e-2, 1e-3, 1e-5, 1e-9] {
        let mut body = cube(4, SOFT);
        let clamp = nodes_where(&body, |X| X.y == 0.0);
        body.fix(&clamp, [true; 3], Vector3::zeros()).unwrap();
        for (incision, layer) in [(1, 0.025), (2, 0.05), (3, 0.075)] {
            body.cut(&slice(layer + 0.025 * thickness, 0.03, 0.5), incision).unwrap();
        }
        for _ in 0..30 {
            let report = body.step(0.02, DOWN, &[]);
            assert_eq!(
                (report.outcome, report.stop),
                (Outcome::Advanced, StopReason::Converged),
                "{report:?}"
            );
        }
        let moved = farthest(body.positions(), body.rest_positions());
        assert!((1e-5..1e-3).contains(&moved), "{thickness}: {moved} m");
    }
}

#[test]
fn every_part_falls_with_g_without_deforming() {
    let mut body = cube(3, SOFT);
    body.cut(&slice(0.031, -0.5, 0.5), 1).unwrap();
    body.cut(&slice(0.0334, -0.5, 0.5), 2).unwrap();
    assert_eq!(body.parts().len(), 3);
    for _ in 0..20 {
        let report = body.step(0.01, DOWN, &[]);
        assert_eq!(report.outcome, Outcome::Advanced);
    }
    let fall = 0.5 * 9.81 * 0.2 * 0.21;
    let there: Vec<_> = body.rest_positions().iter().map(|X| X - fall * Vector3::y()).collect();
    assert!(farthest(body.positions(), &there) < 1e-6, "{}", farthest(body.positions(), &there));
}

/// A cut through a clamped face, exactly through a layer of its nodes or beside it: each lip keeps what it has.
#[test]
fn a_cut_through_the_clamp_leaves_its_material_clamped() {
    for (at, twice) in [(0.05, true), (0.0375, true), (0.0431, false)] {
        let mut body = cube(4, SOFT);
        let clamp = nodes_where(&body, |X| X.y == 0.0);
        assert_eq!(clamp.len(), 81);
        body.fix(&clamp, [true; 3], Vector3::zeros()).unwrap();
        body.cut(&slice(at, -0.5, 0.5), 1).unwrap();
        assert_eq!((body.parts().len(), body.parts().free.contains(&true)), (2, false));
        for _ in 0..10 {
            body.step(0.01, DOWN, &[]);
        }
        // 9 of the 81 are in the plane of the cut, which passes through nodes or middles alone.
        let still = (0..body.positions().len()).filter(|&n| body.positions()[n] == body.rest_positions()[n]);
        assert_eq!(still.count(), if twice { 81 + 9 } else { 81 }, "cut at {at}");
        let reaction = body.reaction(&clamp, DOWN);
        assert!(reaction.y > 0.3 * body.total_mass() * 9.81, "{reaction}");
    }
}

/// The totals of both kinds of loads survive cuts, and each goes to material that is there.
#[test]
fn loads_are_shared_among_copies() {
    let mut body = cube(3, SOFT);
    let clamp = nodes_where(&body, |X| X.y == 0.0);
    let top = nodes_where(&body, |X| X.y > 0.1 - 1e-9);
    body.fix(&clamp, [true; 3], Vector3::zeros()).unwrap();
    body.add_surface_force(&top, Vector3::new(0.0, 2.0, 0.0)).unwrap();
    let middle = *top.iter().find(|&&n| n as usize >= body.n_copies()).unwrap();
    body.add_nodal_force(middle, Vector3::new(0.5, 0.0, 0.0)).unwrap();
    let place = body.rest_positions()[middle as usize];
    for (incision, at) in [(1, 0.05), (2, place.x), (3, 0.021)] {
        body.cut(&slice(at, 0.03, 0.5), incision).unwrap();
        let total: Vector3<f64> = body.loads().iter().sum();
        assert!((total - Vector3::new(0.5, 2.0, 0.0)).norm() < 1e-12, "{total}");
        let loaded: Vec<usize> = (0..body.loads().len()).filter(|&n| body.loads()[n].x > 0.0).collect();
        assert_eq!(loaded.len(), 1);
        assert_eq!(body.rest_positions()[loaded[0]], place);
    }
    let report = body.solve_static(DOWN, &StaticSettings::default()).unwrap();
    assert!(report.converged, "{report:?}");
}

#[test]
fn a_cut_is_taken_back_with_the_motion_there_is() {
    let mut body = cube(3, SOFT);
    let clamp = nodes_where(&body, |X| X.y == 0.0);
    body.fix(&clamp, [true; 3], Vector3::zeros()).unwrap();
    body.cut(&slice(0.041, 0.02, 0.5), 1).unwrap();
    for _ in 0..5 {
        body.step(0.01, DOWN, &[]);
    }
    let topology = body.topology();
    let (x, v, rest) =
        (body.positions().to_vec(), body.velocities().to_vec(), body.rest_positions().to_vec());
    // Taken back at once, the cut leaves no trace.
    body.cut(&slice(0.07, 0.02, 0.5), 2).unwrap();
    body.cut(&slice(0.055, 0.06, 0.5), 3).unwrap();
    assert!(body.positions().len() > x.len() + 50);
    let momentum = body.momentum();
    body.restore(topology).unwrap();
    assert_eq!(body.rest_positions(), rest);
    assert!(farthest(body.positions(), &x) < 1e-15 && farthest(body.velocities(), &v) < 1e-15);
    assert!((body.momentum() - momentum).norm() < 1e-12 * momentum.norm());
    // After some motion the lips close where they are.
    let topology = body.topology();
    body.cut(&slice(0.07, 0.02, 0.5), 2).unwrap();
    for _ in 0..3 {
        body.step(0.01, DOWN, &[]);
    }
    body.restore(topology).unwrap();
    assert!(farthest(body.positions(), &x) < 0.05);
    for _ in 0..3 {
        assert_eq!(body.step(0.01, DOWN, &[]).outcome, Outcome::Advanced);
    }
    body.reset().unwrap();
    assert_eq!((body.positions(), body.n_copies()), (body.rest_positions(), 64));
}

#[test]
fn ten_cuts_in_all_directions_while_the_body_moves() {
    let damped = Material { rayleigh: Rayleigh { mass_1_s: 0.5, stiffness_s: 0.002 }, ..SOFT };
    let run = |threads| {
        let mesh = box_mesh(Vector3::zeros(), Vector3::repeat(0.1), [4; 3], BoxPattern::Tet6);
        let mut body = Body::new(mesh, damped, BodySettings { threads, ..quadratic() }).unwrap();
        let clamp = nodes_where(&body, |X| X.x == 0.0);
        body.fix(&clamp, [true; 3], Vector3::zeros()).unwrap();
        let mass = body.total_mass();
        for k in 0..10_u32 {
            body.cut(&tumbling_blade(&body, k), k + 1).unwrap();
            for _ in 0..3 {
                let report = body.step(0.01, DOWN, &[]);
                assert_eq!(
                    (report.outcome, report.substeps),
                    (Outcome::Advanced, 1),
                    "after cut {k}: {report:?}"
                );
                assert_eq!(report.stop, StopReason::Converged, "after cut {k}: {report:?}");
            }
            assert!((body.total_mass() / mass - 1.0).abs() < 1e-12);
        }
        assert!(body.n_pieces() > 2 * body.n_elements());
        body.positions().iter().chain(body.velocities()).flat_map(|v| [v.x, v.y, v.z]).collect::<Vec<f64>>()
    };
    let alone = run(1);
    assert!(alone.iter().all(|value| value.abs() < 50.0));
    assert_eq!(
        alone.iter().map(|v| v.to_bits()).collect::<Vec<_>>(),
        run(2).iter().map(|v| v.to_bits()).collect::<Vec<_>>()
    );
}

/// A beam of 0.03 × 0.06 × 0.2 m cut half through in its middle, inside elements: quadratic ones bend further, hence
/// truer, than linear ones with more than three times as many unknowns.
#[test]
fn a_half_cut_beam_of_few_quadratic_elements_bends_as_one_of_many_linear_ones() {
    let bend = |element, cells: [usize; 3]| {
        let size = Vector3::new(0.03, 0.06, 0.2);
        let mesh = box_mesh(Vector3::zeros(), size, cells, BoxPattern::Tet5 { parity: false });
        let rayleigh = Rayleigh::default();
        let (young_pa, poisson, density_kg_m3, law) = (3e5, 0.35, 1070.0, Law::Linear);
        let material = Material { young_pa, poisson, density_kg_m3, rayleigh, law };
        let mut body = Body::new(mesh, material, BodySettings { element, ..settings(10, 1e-3) }).unwrap();
        let clamp = nodes_where(&body, |X| X.z == 0.0);
        body.fix(&clamp, [true; 3], Vector3::zeros()).unwrap();
        let segment = |x: f64| [Vector3::new(x, -0.01, 0.0983), Vector3::new(x, 0.07, 0.0983)];
        body.cut(&BladeSweep { segments: vec![segment(-0.01), segment(0.0151)] }, 1).unwrap();
        let report = body.solve_static(Vector3::new(9.81, 0.0, 0.0), &StaticSettings::default()).unwrap();
        assert!(report.converged, "{report:?}");
        let mut tip = body.locate(Vector3::new(0.015, 0.03, 0.2), None).unwrap();
        let carriers = body.carriers(&mut tip);
        let x: Vector3<f64> = carriers.iter().map(|&(n, w)| w * body.positions()[n as usize]).sum();
        (x.x - 0.015, body.positions().len())
    };
    for (linear, quadratic) in [([6, 12, 40], [2, 4, 13]), ([12, 24, 80], [4, 8, 26])] {
        let (few, n_few) = bend(ElementKind::Tet10, quadratic);
        let (many, n_many) = bend(ElementKind::Tet4, linear);
        println!("{few} m with {n_few}, {many} m with {n_many}");
        assert!(n_many > 3 * n_few && few > 1.01 * many && few < 0.12, "{few} m, {many} m");
    }
}

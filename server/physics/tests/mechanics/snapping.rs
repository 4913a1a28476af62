//! Bodies whose mesh is cut: state, constraints and loads follow it.

use nalgebra::Vector3;
use scindo_physics::body::{Body, BodySettings, CuttingMethod, ElementKind, LooseRule, Outcome, Scheme};
use scindo_physics::cut::BladeSweep;
use scindo_physics::cut::remesh::{Moves, SnapSettings};
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::mesh::{BoxPattern, box_mesh};

fn v(x: f64, y: f64, z: f64) -> Vector3<f64> {
    Vector3::new(x, y, z)
}

fn block(law: Law, settings: BodySettings) -> Body {
    block_of([4, 4, 8], BoxPattern::Tet6, law, settings)
}

fn block_of(cells: [usize; 3], pattern: BoxPattern, law: Law, settings: BodySettings) -> Body {
    let mesh = box_mesh(Vector3::zeros(), v(0.1, 0.1, 0.2), cells, pattern);
    let rayleigh = Rayleigh::default();
    let material = Material { young_pa: 2e4, poisson: 0.3, density_kg_m3: 1e3, rayleigh, law };
    let mut body = Body::new(mesh, material, settings).unwrap();
    let base: Vec<u32> =
        (0u32..).zip(body.rest_positions()).filter(|(_, x)| x.z == 0.0).map(|(n, _)| n).collect();
    body.fix(&base, [true; 3], Vector3::zeros()).unwrap();
    body
}

fn snap() -> BodySettings {
    BodySettings { cutting: CuttingMethod::Snap, ..super::settings(100, 1e-6) }
}

/// The blade through z ≈ `z`, from outside to `x`.
fn sweep(z: f64, x: f64) -> BladeSweep {
    BladeSweep {
        segments: vec![[v(-0.1, -0.1, z), v(-0.1, 0.2, z + 0.01)], [v(x, -0.1, z), v(x, 0.2, z + 0.01)]],
    }
}

const G: Vector3<f64> = Vector3::new(9.81, 0.0, 0.0);

#[test]
fn a_moving_body_is_cut_and_goes_on() {
    let general = BodySettings { scheme: Scheme::Bdf2, ..snap() };
    for (law, settings) in [(Law::Corotational, snap()), (Law::NeoHookean, general)] {
        let mut body = block(law, settings);
        for _ in 0..5 {
            assert_eq!(body.step(0.01, G, &[]).outcome, Outcome::Advanced);
        }
        let (mass, centre, epoch) = (body.total_mass(), body.centre_of_mass(), body.epoch());
        let (nodes, held) = (body.rest_positions().len(), body.fixed_nodes().len());
        let report = body.cut(&sweep(0.107, 0.08), 1).unwrap();
        assert!(report.faces_opened > 4 && !report.new_copies.is_empty(), "{report:?}");
        assert_eq!(report.epoch, epoch + 1);
        assert!((body.total_mass() / mass - 1.0).abs() < 1e-9);
        assert!((body.centre_of_mass() - centre).norm() < 2e-4 && body.least_volume_ratio() > 0.2);
        assert!(body.rest_positions().len() > nodes && body.fixed_nodes().len() == held);
        for _ in 0..20 {
            assert_eq!(body.step(0.01, G, &[]).outcome, Outcome::Advanced);
        }
        assert!(body.least_volume_ratio() > 0.0);
        body.reset().unwrap();
        assert_eq!((body.rest_positions().len(), body.fixed_nodes().len()), (nodes, held));
        assert_eq!(body.step(0.01, G, &[]).outcome, Outcome::Advanced);
    }
}

/// A body whose elements are divided or removed moves on, keeps what held it, and returns to its start.
#[test]
fn the_baselines_go_on_after_a_cut_and_return_to_the_start() {
    for cutting in [CuttingMethod::Subdivide, CuttingMethod::Remove] {
        let mut body = block(Law::Corotational, BodySettings { cutting, ..snap() });
        for _ in 0..5 {
            assert_eq!(body.step(0.01, G, &[]).outcome, Outcome::Advanced);
        }
        let (mass, elements, held) = (body.total_mass(), body.n_elements(), body.fixed_nodes().len());
        let nodes = body.rest_positions().len();
        let report = body.cut(&sweep(0.107, 0.08), 1).unwrap();
        assert!(report.elements_cut > 4, "{cutting:?} {report:?}");
        let (now, left) = (body.n_elements(), body.total_mass() / mass);
        match cutting {
            CuttingMethod::Subdivide => assert!(now > elements && (left - 1.0).abs() < 1e-9),
            _ => assert!(now < elements && left < 0.99 && left > 0.7, "{left}"),
        }
        assert_eq!(body.fixed_nodes().len(), held);
        for _ in 0..3 {
            assert_eq!(body.step(0.01, G, &[]).outcome, Outcome::Advanced, "{cutting:?}");
        }
        body.cut(&sweep(0.157, 0.4), 2).unwrap();
        assert_eq!(body.parts().len(), 2, "{cutting:?}");
        for _ in 0..10 {
            assert_eq!(body.step(0.01, G, &[]).outcome, Outcome::Advanced, "{cutting:?}");
        }
        assert!(body.least_volume_ratio() > 0.0 && body.positions().iter().all(|x| x.norm() < 1.0));
        body.reset().unwrap();
        assert_eq!((body.rest_positions().len(), body.n_elements()), (nodes, elements));
        assert_eq!(body.step(0.01, G, &[]).outcome, Outcome::Advanced);
    }
}

#[test]
fn a_part_cut_off_falls_freely_or_is_pinned() {
    for loose in [LooseRule::Free, LooseRule::Pinned] {
        let mut body = block(Law::Corotational, BodySettings { loose, ..snap() });
        body.cut(&sweep(0.107, 0.2), 1).unwrap();
        assert_eq!(body.parts().len(), 2);
        for _ in 0..10 {
            body.step(0.01, v(0.0, 0.0, 9.81), &[]);
        }
        let top = body.positions().iter().map(|x| x.z).fold(0.0, f64::max);
        // Implicit Euler falls g h² n (n + 1)/2.
        let fallen = 9.81 * 1e-4 * 55.0;
        match loose {
            LooseRule::Free => assert!((top - 0.2 - fallen).abs() < 1e-3, "{top}"),
            LooseRule::Pinned => assert!(top < 0.25 && body.parts().free == [false, false], "{top}"),
        }
    }
}

#[test]
fn loads_keep_their_sum_and_what_does_not_go_is_refused() {
    let mut body = block(Law::Corotational, snap());
    let top: Vec<u32> =
        (0u32..).zip(body.rest_positions()).filter(|(_, x)| x.z == 0.2).map(|(n, _)| n).collect();
    body.add_surface_force(&top, v(0.0, 0.1, 0.0)).unwrap();
    let blade = BladeSweep {
        segments: vec![[v(0.047, -1.0, -1.0), v(0.047, -1.0, 1.0)], [v(0.05, 1.0, -1.0), v(0.05, 1.0, 1.0)]],
    };
    body.cut(&blade, 1).unwrap();
    assert_eq!(body.parts().len(), 2);
    // Both halves are held by the duplicates of the nodes at the base.
    assert_eq!(body.parts().free, [false, false]);
    for _ in 0..200 {
        body.step(0.02, Vector3::zeros(), &[]);
    }
    let base: Vec<u32> = body.fixed_nodes().iter().map(|f| f.node).collect();
    let held = body.reaction(&base, Vector3::zeros());
    assert!((held + v(0.0, 0.1, 0.0)).norm() < 2e-3, "{held:?}");

    let refused = |settings: BodySettings| settings.check(Law::Corotational).unwrap_err().to_string();
    assert!(refused(BodySettings { element: ElementKind::Tet10, ..snap() }).contains("tet10"));
    let xfem = BodySettings { cutting: CuttingMethod::Xfem, loose: LooseRule::Pinned, ..snap() };
    assert!(refused(xfem).contains("pinning"));
    let press = SnapSettings { moves: Moves::Press, clean: true };
    assert!(BodySettings { snap: press, ..snap() }.check(Law::Corotational).is_ok());
    for cutting in [CuttingMethod::Xfem, CuttingMethod::Subdivide, CuttingMethod::Remove] {
        assert!(refused(BodySettings { cutting, snap: press, ..snap() }).contains("moved nodes"));
    }
}

#[test]
fn a_reset_keeps_what_was_asked_for_after_the_cut_and_drops_the_pins() {
    let mut body = block(Law::Corotational, BodySettings { loose: LooseRule::Pinned, ..snap() });
    let held: Vec<u32> = body.fixed_nodes().iter().map(|f| f.node).collect();
    body.cut(&sweep(0.107, 0.2), 1).unwrap();
    assert!(body.fixed_nodes().len() > held.len(), "the part cut off is pinned");
    let origins = body.node_origins().unwrap().to_vec();
    let now = |origin: u32| origins.iter().position(|&o| o == origin).unwrap() as u32;
    // Requested on the cut body: one node held, one released, one loaded.
    let top = (0u32..).zip(body.rest_positions()).find(|(_, x)| **x == v(0.0, 0.0, 0.2)).unwrap().0;
    let pulled = origins[top as usize];
    let corner = (0u32..).zip(&origins).filter(|(n, o)| **o == pulled && *n != top).count();
    assert_eq!(corner, 0, "the corner was not cut");
    body.fix(&[top], [false, true, false], v(0.0, 0.01, 0.0)).unwrap();
    body.release(&[now(held[0])]);
    body.add_nodal_force(now(held[1]), v(0.0, 0.0, 0.5)).unwrap();
    body.cut(&sweep(0.15, 0.2), 2).unwrap();
    body.reset().unwrap();
    let mut expected: Vec<u32> = held[1..].iter().copied().chain([pulled]).collect();
    expected.sort_unstable();
    assert_eq!(body.fixed_nodes().iter().map(|f| f.node).collect::<Vec<_>>(), expected);
    let found = body.fixed_nodes().iter().find(|f| f.node == pulled).unwrap();
    assert_eq!((found.held, found.displacement_m), ([false, true, false].into(), v(0.0, 0.01, 0.0)));
    // The load is on a held node: the support carries it.
    let force = body.reaction(&expected, Vector3::zeros());
    assert!(body.step(0.01, Vector3::zeros(), &[]).outcome == Outcome::Advanced && force.norm() < 1.0);
    let lifted = body.reaction(&[held[1]], Vector3::zeros());
    body.clear_loads();
    assert!((body.reaction(&[held[1]], Vector3::zeros()) - lifted - v(0.0, 0.0, 0.5)).norm() < 1e-9);
}

/// A moving body whose cut presses elements keeps mass, loads and what holds it, and its momentum within 5 %. It moves
/// on and returns to its start, after which the same cut gives the same body.
#[test]
fn a_moving_body_whose_cut_presses_elements_goes_on() {
    let press = SnapSettings { moves: Moves::Press, clean: true };
    let settings = BodySettings { snap: press, ..snap() };
    let mut body = block_of([8, 8, 16], BoxPattern::Octahedral6, Law::Corotational, settings);
    let top: Vec<u32> =
        (0u32..).zip(body.rest_positions()).filter(|(_, x)| x.z == 0.2).map(|(n, _)| n).collect();
    body.add_surface_force(&top, v(0.0, 0.02, 0.0)).unwrap();
    let oblique = BladeSweep {
        segments: vec![
            [v(-0.05, -0.1, 0.226), v(-0.05, 0.2, 0.1)],
            [v(0.15, -0.1, 0.11), v(0.15, 0.2, -0.016)],
        ],
    };
    let mut cut = || {
        for _ in 0..5 {
            assert_eq!(body.step(0.01, G, &[]).outcome, Outcome::Advanced);
        }
        let (mass, held) = (body.total_mass(), body.fixed_nodes().len());
        let before = body.momentum();
        body.cut(&oblique, 1).unwrap();
        let report = *body.snap_report().unwrap();
        assert!(report.flattened > 20 && report.collapses > 20 && report.refused < 5, "{report:?}");
        assert!(4 * report.degenerate < report.flattened && body.fixed_nodes().len() == held, "{report:?}");
        assert!((body.total_mass() / mass - 1.0).abs() < 1e-9 && body.parts().len() == 2);
        assert!((body.momentum() - before).norm() < 0.05 * before.norm(), "{before} {}", body.momentum());
        let loads: Vector3<f64> = body.loads().iter().sum();
        assert!((loads - v(0.0, 0.02, 0.0)).norm() < 1e-12, "{loads}");
        for _ in 0..20 {
            assert_eq!(body.step(0.01, G, &[]).outcome, Outcome::Advanced);
        }
        assert!(body.least_volume_ratio() > 0.0);
        let end = body.positions().to_vec();
        body.reset().unwrap();
        end
    };
    assert_eq!(cut(), cut());
}

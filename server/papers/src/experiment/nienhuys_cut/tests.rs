//! Counts and iterations of the cuts. Times are never tested.

use scindo_physics::cut::remesh::SnapSettings;

use super::*;

/// Sound moves bring the lips to the plane without degenerate elements. So does pressing, which costs iterations; cleaning
/// gives most of them back.
#[test]
fn cleaning_a_pressed_cube_saves_iterations() {
    let plane = plane();
    let [jagged, sound, pressed, cleaned] = WAYS.map(|way| {
        let mut made = cut_cube(way, &plane).unwrap();
        let cells = made.off_m(&[plane]) * cube::CELLS as f64 / cube::EDGE_M;
        let flat = made.flat();
        let iterations = relax(&mut made.body).unwrap();
        assert_eq!(made.body.parts().len(), 2, "{}", way.name);
        (made.report, cells, flat, iterations)
    });
    assert!(jagged.1 > 0.3 && jagged.0.moved == 0);
    assert!(sound.1 < 0.1 && sound.2 == 0, "{sound:?}");
    assert!(pressed.1 < 0.25 && pressed.2 > 30 && pressed.0.collapses == 0);
    assert!(cleaned.1 < 0.25 && cleaned.2 == 0 && cleaned.0.collapses > 30);
    assert!(pressed.3[0] > 2 * cleaned.3[0], "{:?} {:?}", pressed.3, cleaned.3);
}

/// The cylinder comes apart in six slices, whole and with few elements pressed.
#[test]
fn pie_cuts_make_six_slices() {
    let cylinder = Cylinder::new(SEEDS[0]).unwrap();
    for way in WAYS {
        let whole = cylinder.body(way.snap).unwrap();
        let mass: f64 = whole.masses().iter().sum();
        let made = make(whole, &cylinder.blades(0.0)).unwrap();
        assert_eq!(made.body.parts().len(), 2 * pie::CUTS, "{}", way.name);
        assert!((made.body.masses().iter().sum::<f64>() / mass - 1.0).abs() < 1e-9);
        let off = made.off_m(&cylinder.planes(0.0)) / delaunay::SPACING_M;
        assert!(off < 0.1 || way.snap != SnapSettings::default(), "{off} {:?}", made.report);
    }
}

/// Taken literally, the rules press more elements flat than they select faces only where every edge is halved; elsewhere
/// they invert some.
#[test]
fn the_printed_rules_flatten_and_invert() {
    let mesh = cube::mesh();
    let per_face = |[point, normal]: cube::Plane| {
        let counts = printed_rules::cut(&mesh, point, normal);
        (counts.flat as f64 / counts.faces as f64, counts.inverted)
    };
    let (mut most, mut inverted) = (0.0_f64, 0);
    for turned in (0..90).step_by(15) {
        for raised in (-30..=30).step_by(15) {
            for off in [0.0, 0.03] {
                let found = per_face(cube::plane(f64::from(turned), f64::from(raised), off));
                most = most.max(found.0);
                inverted += found.1;
            }
        }
    }
    assert!((0.3..1.0).contains(&most) && inverted > 0, "{most} {inverted}");
    assert!(per_face(halving()).0 > 1.3, "{:?}", per_face(halving()));
    // Here all halved edges choose the same side, so that such a plane presses nothing.
    let whole = cuts::body(cube::mesh(), WAYS[3].snap, |X| X.y < 1e-9).unwrap();
    let made = make(whole, &[cube::blade(&halving())]).unwrap();
    assert_eq!((made.report.flattened, made.body.parts().len()), (0, 2));
}

/// In the cube the direction decides how many elements are pressed flat, in the cylinder it matters little.
#[test]
fn the_direction_matters_in_a_regular_mesh() {
    let snap = WAYS[3].snap;
    let cylinder = Cylinder::new(SEEDS[0]).unwrap();
    let rates = [0.0, 30.0, 60.0].map(|angle| {
        let whole = cuts::body(cube::mesh(), snap, |X| X.y < 1e-9).unwrap();
        let cube = make(whole, &[cube::blade(&cube::plane(angle, DIAGONAL[1], 0.0))]).unwrap().report;
        let pie =
            make(cylinder.body(snap).unwrap(), &cylinder.blades(f64::to_radians(angle))).unwrap().report;
        [cube, pie].map(|of| of.flattened as f64 / of.faces as f64)
    });
    let spread = |k: usize| {
        let of = rates.map(|rate| rate[k]);
        of.into_iter().fold(0.0, f64::max) / of.into_iter().fold(1.0, f64::min).max(1e-3)
    };
    assert!(spread(0) > 4.0 && spread(1) < 1.5, "{rates:?}");
}

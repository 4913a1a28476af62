//! A cut in parts, one incision each, opens a body as wide as the whole cut.

use nalgebra::Vector3;
use scindo_physics::body::{
    Body, BodySettings, CuttingMethod, ElementKind, FrontRule, Method, Outcome, PcgSettings, Scheme,
};
use scindo_physics::cut::BladeSweep;
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::mesh::{BoxPattern, box_mesh};
use scindo_physics::octree::{BoxShape, Octree, OctreeSettings};
use scindo_physics::space::OctreeSpace;

type V = Vector3<f64>;

const MATERIAL: Material = Material {
    young_pa: 2e4,
    poisson: 0.25,
    density_kg_m3: 1000.0,
    rayleigh: Rayleigh { mass_1_s: 0.0, stiffness_s: 0.0 },
    law: Law::Corotational,
};
const SIZE_M: f64 = 0.1;
const CELLS: usize = 6;

/// How a body is divided and cut.
#[derive(Clone, Copy, Debug)]
enum How {
    Tets(ElementKind, CuttingMethod, FrontRule),
    Cells,
}

const ALL: [How; 7] = [
    How::Tets(ElementKind::Tet4, CuttingMethod::Xfem, FrontRule::Behind),
    How::Tets(ElementKind::Tet4, CuttingMethod::Xfem, FrontRule::Calibrated),
    How::Tets(ElementKind::Tet10, CuttingMethod::Xfem, FrontRule::Behind),
    How::Tets(ElementKind::Tet4, CuttingMethod::Snap, FrontRule::Behind),
    How::Tets(ElementKind::Tet4, CuttingMethod::Subdivide, FrontRule::Behind),
    How::Tets(ElementKind::Tet4, CuttingMethod::Remove, FrontRule::Behind),
    How::Cells,
];

/// A cube that is held behind and drawn apart above and below, in equilibrium.
fn cube(how: How) -> Body {
    let solver = PcgSettings { iterations: 2000, tolerance: 1e-8 };
    let settings = BodySettings { scheme: Scheme::Static, solver, ..BodySettings::default() };
    let mut body = match how {
        How::Tets(element, cutting, front) => {
            let mesh = box_mesh(V::zeros(), V::repeat(SIZE_M), [CELLS; 3], BoxPattern::Tet6);
            Body::new(mesh, MATERIAL, BodySettings { element, cutting, front, ..settings }).unwrap()
        }
        How::Cells => {
            let shape = BoxShape { min: V::zeros(), max: V::repeat(SIZE_M) };
            let cells = OctreeSettings { cells: 2 * CELLS as u32, levels: 0 };
            let space = OctreeSpace::new(Octree::fill(&shape, cells, &|_| 0).unwrap());
            let settings = BodySettings { method: Method::MgPcg, ..settings };
            Body::of_space(Box::new(space), MATERIAL, settings).unwrap()
        }
    };
    let on = |axis: usize, at: f64| {
        let there = (0..).zip(body.rest_positions()).filter(move |(_, X)| (X[axis] - at).abs() < 1e-9);
        there.map(|(n, _)| n).collect::<Vec<u32>>()
    };
    let (back, below, above) = (on(1, 0.0), on(2, 0.0), on(2, SIZE_M));
    body.fix(&back, [true; 3], V::zeros()).unwrap();
    body.add_surface_force(&below, V::new(0.0, 0.0, -1.0)).unwrap();
    body.add_surface_force(&above, V::new(0.0, 0.0, 1.0)).unwrap();
    solve(&mut body);
    body
}

fn solve(body: &mut Body) {
    let report = body.step(1.0, V::zeros(), &[]);
    assert_eq!((report.outcome, report.is_unconverged()), (Outcome::Advanced, false), "{report:?}");
}

/// Mean distance [m] by which the drawn faces have come apart.
fn opening(body: &Body) -> f64 {
    let moved = |at: f64| {
        let there = body.positions().iter().zip(body.rest_positions()).filter(|(_, X)| X.z == at);
        let moved: Vec<f64> = there.map(|(x, X)| x.z - X.z).collect();
        moved.iter().sum::<f64>() / moved.len() as f64
    };
    moved(SIZE_M) - moved(0.0)
}

/// The parts of a cut 74 mm deep.
fn parts(n: usize) -> Vec<BladeSweep> {
    let segment = |k: usize| {
        let y = 0.11 - 0.084 * k as f64 / n as f64;
        [V::new(-0.02, y, 0.0295), V::new(0.12, y, 0.0645)]
    };
    (0..n).map(|k| BladeSweep { segments: vec![segment(k), segment(k + 1)] }).collect()
}

/// The opening [m] after these cuts, with the body in equilibrium before each of them, or only in the end.
fn opening_after(how: How, parts: &[BladeSweep], moves: bool) -> f64 {
    let mut body = cube(how);
    for (incision, part) in (1..).zip(parts) {
        body.cut(part, incision).unwrap();
        if moves {
            solve(&mut body);
        }
    }
    solve(&mut body);
    opening(&body)
}

#[test]
fn parts_of_a_cut_open_a_body_as_wide_as_the_whole() {
    for how in ALL {
        let whole = opening_after(how, &parts(1), false);
        assert!(whole > 2.0 * opening(&cube(how)), "{how:?}: {whole}");
        for n in [2, 4, 8, 20] {
            // A calibrated front runs ahead of both ends of a part. Parts that are shorter than a cell cut crumbs loose there.
            let runs_ahead = matches!(how, How::Tets(_, _, FrontRule::Calibrated));
            for moves in [false, true].into_iter().filter(|moves| !runs_ahead || !(*moves || n > 4)) {
                let mut cuts = parts(n);
                let mut openings = vec![opening_after(how, &cuts, moves)];
                if !runs_ahead {
                    cuts.reverse();
                    openings.push(opening_after(how, &cuts, moves));
                }
                println!("{how:?}, {n} parts, moves {moves}: {openings:?} of {whole:.6} m");
                for opening in openings {
                    assert!(
                        (opening / whole - 1.0).abs() < 0.03,
                        "{how:?}, {n} parts, moves {moves}: {opening} of {whole}"
                    );
                }
            }
        }
    }
}

/// A part that is taken back and made again joins again.
#[test]
fn a_part_that_is_taken_back_and_made_again_opens_alike() {
    for how in ALL {
        let cuts = parts(2);
        let (mut body, whole) = (cube(how), opening_after(how, &cuts, true));
        body.cut(&cuts[0], 1).unwrap();
        solve(&mut body);
        let before = body.topology();
        body.cut(&cuts[1], 2).unwrap();
        solve(&mut body);
        body.restore(before).unwrap();
        solve(&mut body);
        body.cut(&cuts[1], 3).unwrap();
        solve(&mut body);
        assert!((opening(&body) / whole - 1.0).abs() < 0.03, "{how:?}: {} of {whole}", opening(&body));
    }
}

//! The cuts of chapter 3 of Nienhuys' thesis: the diagonal cut of a cube without and with removal of degenerate elements,
//! and the pie-like cuts of a cylinder of Delaunay tetrahedra.
//!
//! # Source
//! Nienhuys 2003: Cutting in deformable objects, §3.3, figures 3.5 and 3.13 to 3.16.

mod cube;
mod cuts;
mod delaunay;
mod pie;
mod printed_rules;

use scindo_study::report::chart::{Chart, Line};
use scindo_study::report::result::{ExperimentResult, Plots, Table, Unit};
use scindo_study::report::view;

use crate::lab::{ExperimentBench, Trouble};
use cuts::{Made, WAYS, Way, make, relax};
use pie::Cylinder;

/// The diagonal cut: its normal is turned and raised by these angles [°], and it passes the centre at this part of the
/// edge.
const DIAGONAL: [f64; 3] = [60.0, 20.0, 0.0625];
/// Planes over whose directions degeneracies are counted: the normal is turned so far [°].
const TURNED: [f64; 7] = [0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 90.0];
/// Those of a quick study.
const QUICK: usize = 2;
/// Runs of which the fastest is told.
const RUNS: usize = 5;
/// Seeds of cylinders.
const SEEDS: [u64; 3] = [1, 2, 3];

/// The experiment.
///
/// # Errors
/// A body that does not come to rest, or the user ended the study.
pub(super) fn cuts(bench: &mut ExperimentBench<'_>) -> Result<ExperimentResult, Trouble> {
    let mut result = ExperimentResult {
        name: "nienhuys-cut",
        title: "Cuts along faces: figures 3.5 and 3.13 to 3.16 of Nienhuys".into(),
        about: "A cube of 729 nodes and 3,072 elements with ν = ¼ is held at its back face and pulled apart at its sides, cut \
            from end to end by one oblique plane, and relaxed by conjugate gradients until ‖r‖ < 1e-3 ‖f‖, from where it was \
            before the cut; and a cylinder of 891 nodes is cut three times along its axis. Each is cut in four ways: no node \
            moves; nodes move where all elements stay sound and elements are divided elsewhere, which is what a scene gets without \
            further keys; nodes move everywhere and press elements flat; and these are removed by splits and collapses. An element is degenerate if its least height is \
            below 0.01 of its longest edge, and an angle is large beyond 0.99 π, as printed."
            .into(),
        ..ExperimentResult::default()
    };
    let turned: Vec<f64> = TURNED.into_iter().step_by(if bench.is_quick() { QUICK } else { 1 }).collect();
    let seeds = if bench.is_quick() { &SEEDS[..1] } else { &SEEDS[..] };
    let total = WAYS.len() * 2 + turned.len() + 1;
    diagonal(bench, total, &mut result)?;
    bench.begin("the printed rules", total)?;
    result.tables.push(printed_rules());
    cylinder(bench, total, &mut result)?;
    angles(bench, total, (&turned, seeds), &mut result)?;
    Ok(result)
}

/// The plane of the diagonal cut.
fn plane() -> cube::Plane {
    let [turned, raised, off] = DIAGONAL;
    cube::plane(turned, raised, off)
}

/// A plane midway between two layers of nodes, which halves every edge that it crosses.
fn halving() -> cube::Plane {
    cube::plane(0.0, 0.0, 0.5 / cube::CELLS as f64)
}

fn diagonal(
    bench: &mut ExperimentBench<'_>,
    total: usize,
    result: &mut ExperimentResult,
) -> Result<(), Trouble> {
    let mut table = Table::new(
        "Figures 3.14 to 3.16: the diagonal cut of a cube",
        "The thesis prints neither the direction of its cut nor the force; here the plane \
         is turned by 30° from across the pull and its normal raised by 20° from the held face, a direction that presses many \
         elements and leaves both halves held. Degenerate: before any of them is \
         removed. Left: after that. Preconditioned: iterations with 3×3 \
         diagonal blocks, to the same ‖r‖. Off: the largest distance of a node of the lips from the plane, in edges of a cell, without held nodes, which \
         no cut moves. \
         Cleaning: what the cut takes longer with it, of the fastest of five runs. Sound moves leave no degenerate element and \
         nothing to clean. Their splits divide edges neither end of which may move. Pressing stops at 0.001 \
         of the longest edge and never inverts an element, while the thesis presses to rounding and inverts some; so \
         elements that it left degenerate cost it more iterations. It also took 13 elements out; here none is.",
        &[
            ("faces", Unit::Count),
            ("degenerate", Unit::Count),
            ("collapses", Unit::Count),
            ("splits", Unit::Count),
            ("left", Unit::Count),
            ("nodes not moved", Unit::Count),
            ("off [cells]", Unit::Number),
            ("elements", Unit::Count),
            ("nodes", Unit::Count),
            ("iterations", Unit::Count),
            ("preconditioned", Unit::Count),
            ("cut", Unit::Seconds),
            ("cleaning", Unit::Seconds),
        ],
    );
    let (plane, mut pressed_s) = (plane(), 0.0);
    for way in WAYS {
        bench.begin(format!("cube, {}", way.name), total)?;
        let mut made = cut_cube(way, &plane)?;
        let mut cut_s = made.cut_s;
        // Repeated on fresh cubes for the time alone; the first one is kept for all other figures.
        for _ in 1..RUNS {
            cut_s = cut_s.min(cut_cube(way, &plane)?.cut_s);
        }
        // Before the body relaxes, which takes the lips off the plane.
        let off = made.off_m(&[plane]) * cube::CELLS as f64 / cube::EDGE_M;
        let flat = made.flat();
        let [plain, blocks] = relax(&mut made.body)?;
        let of = made.report;
        let counts =
            [of.faces, of.flattened, of.collapses, of.splits, flat, of.refused].map(|n| Some(n as f64));
        let sizes = [made.body.n_elements(), made.body.n_nodes()].map(|n| Some(n as f64));
        // The last two ways differ by the cleaning, and so do their times.
        let cleaning_s = (way == WAYS[3]).then_some(cut_s - pressed_s);
        pressed_s = cut_s;
        let iterations = [plain, blocks].map(|n| Some(f64::from(n)));
        let row: Vec<Option<f64>> = counts
            .into_iter()
            .chain([Some(off)])
            .chain(sizes)
            .chain(iterations)
            .chain([Some(cut_s), cleaning_s])
            .collect();
        table.row(way.name, &row);
        result.pictures.push(view::body(&made.body, format!("Cube, {}, in equilibrium.", way.name)));
    }
    // The thesis has counts of its own way only, before and after elements were removed.
    let n = |n: f64| Some(n);
    table.printed(
        "thesis, not cleaned",
        &[
            n(108.0),
            n(143.0),
            None,
            None,
            n(143.0),
            n(2.0),
            None,
            n(3072.0),
            None,
            n(2439.0),
            None,
            None,
            None,
        ],
    );
    table.printed(
        "thesis, cleaned",
        &[
            n(108.0),
            n(143.0),
            n(99.0),
            None,
            n(13.0),
            n(2.0),
            None,
            n(3034.0),
            n(823.0),
            n(236.0),
            None,
            None,
            n(0.7),
        ],
    );
    result.tables.push(table);
    Ok(())
}

/// Dilates the cube and cuts it.
fn cut_cube(way: Way, plane: &cube::Plane) -> Result<Made, Trouble> {
    make(cube::dilated(way.snap)?, &[cube::blade(plane)])
}

/// The diagonal cut by the rules as they are printed.
fn printed_rules() -> Table {
    let mut table = Table::new(
        "The printed rules, taken literally",
        "Counted on the cube at rest, without any cut: every element with three nearest nodes gives its face to the cut \
         surface, whichever side its neighbours lie on, and every node of the surface is projected, whatever becomes of its \
         elements. Undecided elements have four nearest nodes. More degenerate elements than faces, as printed, were found only \
         where the plane halves all edges that it crosses. Selecting faces only between elements on different sides, and \
         refusing moves that invert, is what keeps these counts out of the table above.",
        &[
            ("faces", Unit::Count),
            ("undecided", Unit::Count),
            ("nodes not moved", Unit::Count),
            ("degenerate", Unit::Count),
            ("inverted", Unit::Count),
        ],
    );
    for (name, [point, normal]) in
        [("the same plane", plane()), ("a plane that halves every edge", halving())]
    {
        let counts = printed_rules::cut(&cube::mesh(), point, normal);
        let row = [counts.faces, counts.undecided, counts.failed, counts.flat, counts.inverted];
        table.row(name, &row.map(|n| Some(n as f64)));
    }
    table.printed("thesis", &[Some(108.0), None, Some(2.0), Some(143.0), None]);
    table
}

fn cylinder(
    bench: &mut ExperimentBench<'_>,
    total: usize,
    result: &mut ExperimentResult,
) -> Result<(), Trouble> {
    let mut table = Table::new(
        "Figure 3.13: pie-like cuts of a cylinder",
        "Delaunay tetrahedra of 27 layers of 33 points, moved at random by up to a fifth of their distance; three cuts \
         through the axis at rest. Elements and nodes are those of the uncut cylinder. The thesis prints neither its shape \
         nor its points; besides 873 faces, which 5 % of collapses refer to, it prints 45 faces for the same cuts. Nodes that \
         are not moved lie on the edges of lips that an earlier cut made, on rims, or on the round skin, where a move must \
         keep the volume; there elements also stay degenerate, or are divided where only sound moves are made.",
        &[
            ("elements", Unit::Count),
            ("nodes", Unit::Count),
            ("faces", Unit::Count),
            ("degenerate", Unit::Count),
            ("collapses", Unit::Count),
            ("collapses per face", Unit::Number),
            ("left", Unit::Count),
            ("nodes not moved", Unit::Count),
            ("off [spacings]", Unit::Number),
            ("parts", Unit::Count),
            ("cuts", Unit::Seconds),
        ],
    );
    let cylinder = Cylinder::new(SEEDS[0])?;
    for way in WAYS {
        bench.begin(format!("cylinder, {}", way.name), total)?;
        let mut made = make(cylinder.body(way.snap)?, &cylinder.blades(0.0))?;
        let of = made.report;
        let row = [
            cylinder.mesh.tets.len() as f64,
            cylinder.mesh.nodes.len() as f64,
            of.faces as f64,
            of.flattened as f64,
            of.collapses as f64,
            of.collapses as f64 / of.faces as f64,
            of.degenerate as f64,
            of.refused as f64,
            made.off_m(&cylinder.planes(0.0)) / delaunay::SPACING_M,
            made.body.parts().len() as f64,
            made.cut_s,
        ];
        table.row(way.name, &row.map(Some));
        if way == WAYS[0] || way == WAYS[3] {
            pie::spread(&mut made.body, 0.5 * delaunay::SPACING_M)?;
            let caption = format!("Cylinder, {}, its parts moved away from each other.", way.name);
            result.pictures.push(view::body(&made.body, caption));
        }
    }
    let printed = [Some(4020.0), Some(891.0), Some(873.0), None, Some(0.05 * 873.0), Some(0.05)];
    table.printed("thesis", &printed.into_iter().chain([None; 5]).collect::<Vec<_>>());
    result.tables.push(table);
    Ok(())
}

/// Degenerate elements per face over the direction of the cut: the thesis finds a strong dependence in cubes and none in
/// the cylinder.
fn angles(
    bench: &mut ExperimentBench<'_>,
    total: usize,
    (turned, seeds): (&[f64], &[u64]),
    result: &mut ExperimentResult,
) -> Result<(), Trouble> {
    let mut table = Table::new(
        "Degenerate elements over the direction of a cut",
        "Pressed and cleaned. Cube: one plane through its centre, raised by 20°, at rest. Cylinder: the three cuts, turned \
         about the axis; mean of all cylinders.",
        &[
            ("cube: faces", Unit::Count),
            ("cube: degenerate per face", Unit::Number),
            ("cube: left", Unit::Count),
            ("cylinder: faces", Unit::Count),
            ("cylinder: degenerate per face", Unit::Number),
            ("cylinder: left", Unit::Count),
        ],
    );
    let cylinders = seeds.iter().map(|seed| Cylinder::new(*seed)).collect::<Result<Vec<_>, _>>()?;
    let mut lines = ["cube", "cylinder"].map(|name| Line { name: name.into(), points: Vec::new() });
    let snap = WAYS[3].snap;
    for &angle in turned {
        bench.begin(format!("cuts turned by {angle}°"), total)?;
        let whole = cuts::body(cube::mesh(), snap, |X| X.y < 1e-9)?;
        let cube = make(whole, &[cube::blade(&cube::plane(angle, DIAGONAL[1], 0.0))])?.report;
        let [mut faces, mut degenerate, mut left] = [0.0; 3];
        for cylinder in &cylinders {
            let of = make(cylinder.body(snap)?, &cylinder.blades(angle.to_radians()))?.report;
            let share = 1.0 / cylinders.len() as f64;
            faces += share * of.faces as f64;
            degenerate += share * of.flattened as f64;
            left += share * of.degenerate as f64;
        }
        let rates = [cube.flattened as f64 / cube.faces as f64, degenerate / faces];
        for (line, rate) in lines.iter_mut().zip(rates) {
            line.points.push([angle, rate]);
        }
        let row = [cube.faces as f64, rates[0], cube.degenerate as f64, faces, rates[1], left];
        table.row(format!("{angle}°"), &row.map(Some));
    }
    let mut chart = Chart::new("Degenerate elements per face", "direction [°]", "per face");
    chart.lines.extend(lines);
    let caption =
        "In a mesh whose cells are all alike the direction decides; in one of random points it does not.";
    result.plots.push(Plots { caption: caption.into(), charts: vec![chart], ..Plots::default() });
    result.tables.push(table);
    Ok(())
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;

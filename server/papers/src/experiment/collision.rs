//! What collision detection costs: every method of broad phase on surfaces from five thousand to half a million
//! triangles.

use std::f64::consts::PI;

use nalgebra::Vector3;
use scindo_collision::{Capsule, CapsuleMotion, Method, SurfaceBvh};
use scindo_study::report::chart::{Chart, Line};
use scindo_study::report::result::Plots;
use scindo_study::report::result::{ExperimentResult, Table, Unit};
use scindo_study::trial::random::Random;

use crate::lab::least;
use crate::lab::{ExperimentBench, Trouble};

type V = Vector3<f64>;

/// Positions [m] and triangles of a surface.
pub(super) type Mesh = (Vec<[f32; 3]>, Vec<[u32; 3]>);

/// Squares across a face of the cube from which a surface is made: 12 n² triangles.
const ACROSS: [usize; 3] = [20, 65, 204];
/// Places of a tool, and of a point.
const PLACES: usize = 400;
/// Triangles that a cut replaces.
const CUTS: [usize; 2] = [100, 1_000];
/// Radius of the surface [m].
const RADIUS_M: f64 = 0.05;

/// What is measured, in the order of the columns.
const WORK: [&str; 8] = [
    "build",
    "refit",
    "cut of 100 triangles",
    "cut of 1,000 triangles",
    "triangles near a capsule",
    "closest point",
    "moving capsule",
    "pairs with itself",
];

/// The experiment.
///
/// # Errors
/// The user ended the study.
pub(super) fn collision(bench: &mut ExperimentBench<'_>) -> Result<ExperimentResult, Trouble> {
    let mut result = ExperimentResult {
        name: "collision",
        title: "Collision detection: what it costs".into(),
        about: "A closed surface with dents is built into every method of broad phase, on one thread. A refit follows \
            a smooth motion of all vertices. A cut replaces triangles in one place, which includes a refit. A capsule \
            of 2 mm radius and 20 mm length stands at the surface in 400 places. Pairs with itself are all pairs of \
            triangles without a common vertex whose boxes meet. All methods give the same results."
            .into(),
        ..ExperimentResult::default()
    };
    let sizes = if bench.is_quick() { &ACROSS[..2] } else { &ACROSS[..] };
    let mut courses: Vec<Vec<(Method, f64, [f64; 8])>> = Vec::new();
    for &across in sizes {
        let surface = dented(across);
        let triangles = &surface.1;
        let mut table = Table::new(
            &format!("{} triangles", triangles.len()),
            "Least of several times. Cuts: the time beyond that of a cut which changes nothing. Capsule, point and \
             moving capsule: per query.",
            &WORK.map(|name| (name, Unit::Seconds)),
        );
        let mut course = Vec::new();
        for method in Method::ALL {
            bench.begin(
                format!("{} of {} triangles", method.name(), triangles.len()),
                sizes.len() * Method::ALL.len(),
            )?;
            let times = measure(method, &surface)?;
            table.row(method.name(), &times.map(Some));
            course.push((method, triangles.len() as f64, times));
        }
        result.tables.push(table);
        courses.push(course);
    }
    result.plots.push(plots(&courses));
    result.notes.push(
        "the default is the tree of boxes; `world.contact.broad_phase` of a scene chooses another method"
            .into(),
    );
    Ok(result)
}

/// Times of all work [s], in the order of [`WORK`].
pub(super) fn measure(method: Method, mesh: &Mesh) -> Result<[f64; 8], Trouble> {
    let (positions, triangles) = mesh;
    let mut surface = SurfaceBvh::with_method(method, positions, triangles)?;
    let build = least(|| {
        surface.rebuild();
        Ok(())
    })?;
    let moved: Vec<Vec<[f32; 3]>> = [0.02, 0.04].map(|angle| bent(positions, angle)).into();
    let mut turn = 0;
    let refit = least(|| {
        turn = 1 - turn;
        surface.refit(&moved[turn]).map_err(Trouble::from)
    })?;
    let nothing = least(|| surface.change_topology(positions, triangles).map(|_| ()).map_err(Trouble::from))?;
    let mut cut = [0.0; 2];
    for (seconds, size) in cut.iter_mut().zip(CUTS) {
        let (opened, lips) = opened(mesh, size);
        let mut open = false;
        *seconds = least(|| {
            open = !open;
            let (p, t) = if open { (&opened, &lips) } else { (positions, triangles) };
            surface.change_topology(p, t).map(|_| ()).map_err(Trouble::from)
        })?;
        *seconds = (*seconds - nothing).max(0.0);
    }
    surface = SurfaceBvh::with_method(method, positions, triangles)?;
    surface.refit(&moved[0])?;
    let places = places(positions);
    let mut found = 0;
    let near = least(|| {
        for capsule in &places {
            surface.triangles_near(capsule, 0.001, |_| found += 1);
        }
        Ok(())
    })?;
    let closest = least(|| {
        found += places.iter().filter_map(|capsule| surface.closest_point(capsule.core[0], 0.02)).count();
        Ok(())
    })?;
    let moving = least(|| {
        for Capsule { core, radius } in &places {
            let start = core.map(|p| p + V::repeat(0.002));
            found += usize::from(
                surface.sweep_moving(&CapsuleMotion { start, end: *core, radius: *radius }).is_some(),
            );
        }
        Ok(())
    })?;
    let mut pairs = Vec::new();
    let itself = least(|| {
        surface.self_pairs(0.0, &mut pairs);
        Ok(())
    })?;
    if found == 0 {
        return Err("no query found anything".into());
    }
    let each = PLACES as f64;
    Ok([build, refit, cut[0], cut[1], near / each, closest / each, moving / each, itself])
}

/// A closed surface of 12 n² triangles: a sphere with dents, from the six faces of a cube.
pub(super) fn dented(n: usize) -> Mesh {
    let mut numbers = std::collections::BTreeMap::new();
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    let mut vertex = |at: [usize; 3]| {
        *numbers.entry(at).or_insert_with(|| {
            let cube = V::from(at.map(|i| (PI / 4.0 * (2.0 * i as f64 / n as f64 - 1.0)).tan()));
            let unit = cube.normalize();
            let dents = (7.0 * unit.x).sin() * (6.0 * unit.y + 1.0).sin() * (5.0 * unit.z).cos();
            let p = unit * RADIUS_M * (1.0 + 0.15 * dents);
            positions.push([p.x as f32, p.y as f32, p.z as f32]);
            positions.len() as u32 - 1
        })
    };
    for axis in 0..3 {
        for side in [0, n] {
            for i in 0..n {
                for j in 0..n {
                    let mut at = |u: usize, v: usize| {
                        let mut p = [0; 3];
                        (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (side, u, v);
                        vertex(p)
                    };
                    let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                    let pair = [[a, b, c], [a, c, d]];
                    triangles.extend(if side == 0 { pair.map(|[a, b, c]| [a, c, b]) } else { pair });
                }
            }
        }
    }
    (positions, triangles)
}

/// A smooth motion of a step.
fn bent(positions: &[[f32; 3]], angle: f32) -> Vec<[f32; 3]> {
    let (sin, cos) = angle.sin_cos();
    positions
        .iter()
        .map(|p| [p[0] * cos - p[1] * sin, p[0] * sin + p[1] * cos, p[2] * (1.0 + 0.1 * angle)])
        .collect()
}

/// The surface after a cut that doubles `size` neighbouring triangles: they get vertices of their own, and their
/// other side is appended.
fn opened((positions, triangles): &Mesh, size: usize) -> Mesh {
    let (mut positions, mut changed) = (positions.clone(), triangles.clone());
    for triangle in changed.iter_mut().take(size) {
        let first = positions.len() as u32;
        let corners = triangle.map(|v| positions[v as usize]);
        positions.extend(corners.map(|p| p.map(|x| 0.99 * x)));
        *triangle = [first, first + 1, first + 2];
    }
    for lip in 0..size {
        let [a, b, c] = changed[lip];
        changed.push([a, c, b]);
    }
    (positions, changed)
}

/// Capsules that touch the surface at random.
fn places(positions: &[[f32; 3]]) -> Vec<Capsule> {
    let mut random = Random(1);
    (0..PLACES)
        .map(|_| {
            let at = positions[(random.uniform() * positions.len() as f64) as usize % positions.len()];
            let tip = V::from(at.map(f64::from));
            let away = V::from_fn(|_, _| random.uniform() - 0.5).normalize();
            let out = if away.dot(&tip) < 0.0 { -away } else { away };
            Capsule { core: [tip, tip + 0.02 * out], radius: 0.002 }
        })
        .collect()
}

fn plots(courses: &[Vec<(Method, f64, [f64; 8])>]) -> Plots {
    let chart = |work: usize| {
        let mut chart = Chart::new(WORK[work], "triangles (10ⁿ)", "ms");
        chart.logarithmic = true;
        for (i, method) in Method::ALL.into_iter().enumerate() {
            let points = courses.iter().map(|course| [course[i].1.log10(), 1e3 * course[i].2[work]]);
            chart.lines.push(Line { name: method.name().into(), points: points.collect() });
        }
        chart
    };
    Plots {
        caption: "Times over the number of triangles.".into(),
        charts: (0..WORK.len()).map(chart).collect(),
        ..Plots::default()
    }
}

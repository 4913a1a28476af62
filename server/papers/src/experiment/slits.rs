//! Six ways to cut one beam by 1, 10 and 100 slits: what each does to mesh, step and answer.
//!
//! The slits are planes across the beam down to a depth inside elements, two millimetres from each other where there
//! are a hundred of them, and the elements are five wide. They come one after the other, in an order that spreads
//! them. All ways start from the same material; the truth is the equilibrium of octree cells of a millimetre, between
//! whose faces all slits lie.

use std::time::Instant;

use nalgebra::Vector3;
use scindo_physics::assembly::Model;
use scindo_physics::body::estimate::CellRecovery;
use scindo_physics::body::{
    Body, BodySettings, CuttingMethod, ElementKind, MassKind, Method, Outcome, PcgSettings, Scheme,
    StaticSettings,
};
use scindo_physics::cut::BladeSweep;
use scindo_physics::integrator::omega_max;
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::mesh::{BoxPattern, box_mesh};
use scindo_physics::octree::{BoxShape, Octree, OctreeSettings};
use scindo_physics::space::OctreeSpace;
use scindo_physics::space::Tets;
use scindo_physics::team::Team;
use scindo_study::report::chart::{Chart, Line};
use scindo_study::report::result::{ExperimentResult, Plots, Table, Unit};

use crate::lab::{ExperimentBench, Trouble, distance};

type V = Vector3<f64>;

/// Size of the beam [m]; it lies along x and is held at both ends.
const SIZE: V = V::new(0.2, 0.04, 0.04);
/// Height of the front of every slit [m]; slits come from above.
const FRONT_M: f64 = 0.018;
/// Slits after which the beam is measured.
const SLITS: [usize; 3] = [1, 10, 100];
/// Linear tetrahedra are parts of cubes of 5 mm, quadratic ones of 10 mm, which have as many nodes; octree cells are
/// 2.5 mm wide.
const CUBES: [usize; 3] = [40, 8, 8];
const QUADRATIC_CUBES: [usize; 3] = [20, 4, 4];
const CELLS: u32 = 80;
/// Cells of the truth are 1 mm wide.
const FINE_CELLS: u32 = 200;
const LEVELS: u8 = 2;
const FALL: V = V::new(0.0, 0.0, -9.81);
/// Steps that are timed after each number of slits, and their length [s].
const STEPS: usize = 5;
const STEP_S: f64 = 0.01;
/// A step ends at this relative residual.
const TOLERANCE: f64 = 1e-3;

const MATERIAL: Material = Material {
    young_pa: 1e5,
    poisson: 0.3,
    density_kg_m3: 1000.0,
    rayleigh: Rayleigh { mass_1_s: 0.0, stiffness_s: 0.01 },
    law: Law::Linear,
};

/// A way to cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Way {
    Xfem,
    Quadratic,
    Subdivide,
    Snap,
    Remove,
    Links,
}

const WAYS: [(Way, &str); 6] = [
    (Way::Xfem, "X-FEM"),
    (Way::Quadratic, "X-FEM, quadratic"),
    (Way::Subdivide, "remeshing (subdivide)"),
    (Way::Snap, "along faces (snap)"),
    (Way::Remove, "removal"),
    (Way::Links, "octree cells (links)"),
];

/// What a number of slits has made of the beam.
#[derive(Clone, Debug)]
struct Measured {
    elements: usize,
    unknowns: usize,
    /// Mean ratio of the worst element; 1 for cubes.
    quality: f64,
    critical_step_s: f64,
    iterations: f64,
    mass_lost: f64,
    cut_s: f64,
    step_s: f64,
    /// Displacement of the nodes of [`watched`] in equilibrium, or why there is none.
    sag: Result<Vec<V>, String>,
}

/// The experiment.
///
/// # Errors
/// The user ended the study, or a body could not be made.
pub(super) fn slits(bench: &mut ExperimentBench<'_>) -> Result<ExperimentResult, Trouble> {
    let [long, wide, high] = [SIZE.x, SIZE.y, SIZE.z].map(|side| 1e3 * side);
    let mut result = ExperimentResult {
        name: "slits",
        title: "Six ways to cut: 1, 10 and 100 slits".into(),
        about: format!(
            "A beam of {long} × {wide} × {high} mm is held at both ends and slit from above to {:.0} mm of its height, \
             once, ten and a hundred times. Tetrahedra are parts of cubes of 5 mm, so the fronts lie inside elements and a \
             hundred slits lie closer than elements are wide; octree cells are 2.5 mm wide. `X-FEM` keeps the mesh and \
             makes copies of nodes, which count as unknowns; quadratic tetrahedra are parts of cubes of 10 mm and have as \
             many nodes at first. `remeshing` divides elements exactly along the slit and does \
             nothing for their shape. `along faces` moves nodes onto the slit and collapses what becomes flat. `removal` \
             takes out every element that a slit touches. The truth is made of octree cells of 1 mm, which favours the \
             coarser ones.",
            1e3 * (SIZE.z - FRONT_M)
        ),
        ..ExperimentResult::default()
    };
    let total = WAYS.len() * SLITS.len() + SLITS.len();
    // The truth comes first, because all ways are measured against it. One fine beam takes all slits in turn.
    let mut truth = Vec::new();
    let mut fine = fine_beam()?;
    let mut made = 0;
    for slits in SLITS {
        bench.begin(format!("the truth, {slits} slits"), total)?;
        cut_until(&mut fine, &mut made, slits)?;
        let (sag, eta) = equilibrium_of_cells(&mut fine)?;
        truth.push(sag);
        result.notes.push(format!(
            "Truth with {slits} {}: {} cells, estimated error {:.1} % in the energy norm; that of a displacement is about its square",
            if slits == 1 { "slit" } else { "slits" },
            fine.n_elements(),
            100.0 * eta
        ));
    }
    // The fine beam is large and no longer needed.
    drop(fine);
    let mut table = Table::new(
        "After 1, 10 and 100 slits",
        "The worst element has the smallest mean ratio: 1 for a regular one, 0 for a flat one; cubes count as 1. The \
         critical step is that of explicit integration with lumped masses. Iterations and time of a step are those of \
         implicit Euler, 10 ms, to a residual of 1e-3, the mean of five steps on one thread. The error is that of the sag \
         in equilibrium, along the lower edges, in the L² norm.",
        &[
            ("elements", Unit::Count),
            ("unknowns", Unit::Count),
            ("worst element", Unit::Number),
            ("critical step", Unit::Seconds),
            ("iterations", Unit::Number),
            ("mass lost", Unit::Share),
            ("per cut", Unit::Seconds),
            ("per step", Unit::Seconds),
            ("error", Unit::Number),
        ],
    );
    let mut chart = Chart::new("Error", "slits [log₁₀]", "relative error of the sag");
    let mut steps = Chart::new("Critical step", "slits [log₁₀]", "critical step [s]");
    (chart.logarithmic, steps.logarithmic) = (true, true);
    let mut counts: Vec<(Way, usize)> = Vec::new();
    for (way, name) in WAYS {
        let mut body = beam(way)?;
        // Removal takes mass away, so what is left is weighed against the uncut beam.
        let whole: f64 = body.masses().iter().sum();
        let (mut made, mut cut_s) = (0, 0.0);
        let (mut errors, mut critical) = (Vec::new(), Vec::new());
        for (slits, truth) in SLITS.into_iter().zip(&truth) {
            bench.begin(format!("{name}, {slits} slits"), total)?;
            let begun = Instant::now();
            cut_until(&mut body, &mut made, slits)?;
            cut_s += begun.elapsed().as_secs_f64();
            // The time per cut is the mean over all slits so far.
            let found = measure(&mut body, whole, cut_s / slits as f64)?;
            if let Err(reason) = &found.sag {
                result.notes.push(format!("{name}, {slits} slits: no equilibrium, because {reason}"));
            }
            let error = found.sag.as_ref().ok().map(|sag| distance(sag, truth));
            let at = (slits as f64).log10();
            errors.extend(error.map(|error| [at, error]));
            critical.push([at, found.critical_step_s]);
            let values = [
                found.elements as f64,
                found.unknowns as f64,
                found.quality,
                found.critical_step_s,
                found.iterations,
                found.mass_lost,
                found.cut_s,
                found.step_s,
            ];
            let values: Vec<Option<f64>> = values.map(Some).into_iter().chain([error]).collect();
            // Removal tells how many elements the slits touch, remeshing what it makes of them: compared at the end.
            counts.push((way, found.elements));
            let word = if slits == 1 { "slit" } else { "slits" };
            table.row(format!("{name}, {slits} {word}"), &values);
        }
        chart.lines.push(Line { name: name.to_owned(), points: errors });
        steps.lines.push(Line { name: name.to_owned(), points: critical });
    }
    result.tables.extend([table, remeshed(&counts)]);
    let caption = "What a growing number of slits does to the answer, and to the longest explicit step.";
    result.plots.push(Plots { caption: caption.into(), charts: vec![chart, steps], ..Plots::default() });
    Ok(result)
}

/// How many elements remeshing makes of those that slits touch, which removal counts.
fn remeshed(counts: &[(Way, usize)]) -> Table {
    let mut table = Table::new(
        "Remeshing: new elements for each that is cut",
        "Elements that `remeshing` adds, those that a slit touches, which `removal` takes out, and the ratio. Jeřábková \
         cites 5.2 new elements of Mor and Kanade 2000. Elements next to a cut edge are divided, too.",
        &[("new", Unit::Count), ("touched", Unit::Count), ("new for each", Unit::Number)],
    );
    let whole = 5 * CUBES.iter().product::<usize>();
    let of = |wanted: Way| counts.iter().filter(move |(way, _)| *way == wanted).map(|(_, n)| *n);
    for ((slits, finer), fewer) in SLITS.into_iter().zip(of(Way::Subdivide)).zip(of(Way::Remove)) {
        let (new, touched) = (finer as f64 - whole as f64, whole as f64 - fewer as f64);
        table.row(slits.to_string(), &[Some(new), Some(touched), Some(new / touched)]);
    }
    table
}

/// The uncut beam.
fn beam(way: Way) -> Result<Body, Trouble> {
    let solver = PcgSettings { iterations: 5000, tolerance: TOLERANCE };
    let mut settings = BodySettings { scheme: Scheme::ImplicitEuler, solver, ..BodySettings::default() };
    let mut cubes = CUBES;
    let cutting = match way {
        Way::Xfem => CuttingMethod::Xfem,
        Way::Quadratic => {
            (settings.element, cubes) = (ElementKind::Tet10, QUADRATIC_CUBES);
            CuttingMethod::Xfem
        }
        Way::Subdivide => CuttingMethod::Subdivide,
        Way::Snap => CuttingMethod::Snap,
        Way::Remove => CuttingMethod::Remove,
        Way::Links => {
            let method = Method::MgPcg;
            return hold(cells(CELLS, BodySettings { method, ..settings })?);
        }
    };
    let mesh = box_mesh(V::zeros(), SIZE, cubes, BoxPattern::Tet5 { parity: false });
    hold(Body::new(mesh, MATERIAL, BodySettings { cutting, ..settings })?)
}

fn cells(along: u32, settings: BodySettings) -> Result<Body, Trouble> {
    let shape = BoxShape { min: V::zeros(), max: SIZE };
    let octree = Octree::fill(&shape, OctreeSettings { cells: along, levels: LEVELS }, &|_| 0)?;
    let settings = BodySettings { element: ElementKind::Octree, ..settings };
    Ok(Body::of_space(Box::new(OctreeSpace::new(octree)), MATERIAL, settings)?)
}

/// The beam of the truth, which is only solved in equilibrium.
fn fine_beam() -> Result<Body, Trouble> {
    let solver = PcgSettings { iterations: 500, tolerance: 1e-6 };
    let settings =
        BodySettings { scheme: Scheme::Static, method: Method::MgPcg, solver, ..BodySettings::default() };
    hold(cells(FINE_CELLS, settings)?)
}

fn hold(mut body: Body) -> Result<Body, Trouble> {
    let ends: Vec<u32> = (0..)
        .zip(body.rest_positions())
        .filter(|(_, X)| X.x < 1e-9 || X.x > SIZE.x - 1e-9)
        .map(|(n, _)| n)
        .collect();
    body.fix(&ends, [true; 3], V::zeros())?;
    Ok(body)
}

/// The blade of slit number `k`. Any two of the hundred planes are two millimetres apart or more, and the first ones
/// are spread over the beam.
fn slit(k: usize) -> BladeSweep {
    let place = (50 + 37 * k) % SLITS[2];
    let x = 0.001 + 0.002 * place as f64;
    let at = |z: f64| [V::new(x, -0.1 * SIZE.y, z), V::new(x, 1.1 * SIZE.y, z)];
    BladeSweep { segments: vec![at(1.1 * SIZE.z), at(FRONT_M)] }
}

/// Makes slits until there are `wanted`; `made` counts them.
fn cut_until(body: &mut Body, made: &mut usize, wanted: usize) -> Result<(), Trouble> {
    while *made < wanted {
        body.cut(&slit(*made), *made as u32 + 1)?;
        *made += 1;
    }
    Ok(())
}

fn measure(body: &mut Body, whole_kg: f64, cut_s: f64) -> Result<Measured, Trouble> {
    let rest = body.rest_positions().to_vec();
    let still = vec![V::zeros(); rest.len()];
    let mut found = Measured {
        elements: body.n_elements(),
        unknowns: 3 * rest.len(),
        quality: body.tets().map_or(1.0, |tets: &Tets| tets.mesh().quality().min_mean_ratio.0),
        critical_step_s: 0.0,
        iterations: 0.0,
        mass_lost: (1.0 - body.masses().iter().sum::<f64>() / whole_kg).max(0.0),
        cut_s,
        step_s: 0.0,
        sag: Err("Newton's method did not converge".into()),
    };
    let model: Model = body.discrete_model()?;
    let mass = (MATERIAL.density_kg_m3, MassKind::Lumped);
    found.critical_step_s = 2.0 / omega_max(&mut Team::alone(), &model, mass, &rest, &[]);
    body.set_state(&rest, &still)?;
    let begun = Instant::now();
    for _ in 0..STEPS {
        let report = body.step(STEP_S, FALL, &[]);
        if report.outcome != Outcome::Advanced {
            return Err(format!("a step was refused: {:?}", report.outcome).into());
        }
        found.iterations += f64::from(report.iterations) / STEPS as f64;
    }
    found.step_s = begun.elapsed().as_secs_f64() / STEPS as f64;
    body.set_state(&rest, &still)?;
    let settings = StaticSettings::default();
    match body.solve_static(FALL, &settings) {
        Ok(report) if report.converged => found.sag = Ok(watched(body)),
        Ok(_) => {}
        Err(error) => found.sag = Err(error.to_string()),
    }
    body.set_state(&rest, &still)?;
    Ok(found)
}

/// The equilibrium of the truth, and its estimated error in the energy norm.
fn equilibrium_of_cells(body: &mut Body) -> Result<(Vec<V>, f64), Trouble> {
    let report = body.step(1.0, FALL, &[]);
    if report.outcome != Outcome::Advanced || report.is_unconverged() {
        return Err(format!("the truth has no equilibrium: {report:?}").into());
    }
    let eta = body.cell_error(&mut CellRecovery::default()).map_or(f64::NAN, |error| error.relative);
    let sag = watched(body);
    // The next slits are made at rest.
    let rest = body.rest_positions().to_vec();
    body.set_state(&rest, &vec![V::zeros(); rest.len()])?;
    Ok((sag, eta))
}

/// Displacements [m] along both lower edges, every centimetre. No slit reaches them.
fn watched(body: &Body) -> Vec<V> {
    let moved = body.positions().iter().zip(body.rest_positions());
    let is_watched = |X: &V| {
        let centimetres = X.x / 0.01;
        let at_edge = X.y < 1e-9 || X.y > SIZE.y - 1e-9;
        X.z < 1e-9 && at_edge && (centimetres - centimetres.round()).abs() < 1e-6
    };
    let mut found: Vec<(V, V)> = moved.filter(|(_, X)| is_watched(X)).map(|(x, X)| (*X, x - X)).collect();
    found.sort_by(|a, b| a.0.x.total_cmp(&b.0.x).then(a.0.y.total_cmp(&b.0.y)));
    found.into_iter().map(|(_, u)| u).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn all_slits_are_different_and_lie_between_fine_cells() {
        let mut places: Vec<f64> = (0..SLITS[2]).map(|k| slit(k).segments[0][0].x).collect();
        places.sort_by(f64::total_cmp);
        assert!(places.windows(2).all(|pair| pair[1] - pair[0] > 0.00199));
        assert!(places.iter().all(|x| (x / 0.001 - (x / 0.001).round()).abs() < 1e-6));
        assert!(places[0] > 0.0 && places[99] < SIZE.x);
    }

    /// Against the truth: one slit is answered by every way, and each leaves the mark it is known for.
    #[test]
    fn one_slit_is_answered_by_every_way() {
        let mut fine = fine_beam().unwrap();
        cut_until(&mut fine, &mut 0, 1).unwrap();
        let (truth, eta) = equilibrium_of_cells(&mut fine).unwrap();
        assert!(truth.len() == 42 && eta < 0.2, "{} {eta}", truth.len());
        let found = WAYS.map(|(way, name)| {
            let mut body = beam(way).unwrap();
            let whole: f64 = body.masses().iter().sum();
            let elements = body.n_elements();
            cut_until(&mut body, &mut 0, 1).unwrap();
            let found = measure(&mut body, whole, 0.0).unwrap();
            let error = distance(found.sag.as_ref().unwrap(), &truth);
            println!("{name}: {error:.3} {:?}", Measured { sag: Ok(Vec::new()), ..found.clone() });
            assert!(error < 0.3, "{name}: {error}");
            (elements, found)
        });
        let [xfem, quadratic, subdivide, snap, remove, links] = found;
        assert_eq!((xfem.1.elements, quadratic.1.elements), (xfem.0, quadratic.0));
        assert!(subdivide.1.elements > subdivide.0 && subdivide.1.quality < xfem.1.quality);
        assert!(snap.1.elements <= snap.0);
        assert!(remove.1.elements < remove.0 && remove.1.mass_lost > 0.005);
        assert!(links.1.elements >= links.0);
        for whole in [&xfem.1, &quadratic.1, &subdivide.1, &snap.1, &links.1] {
            assert!(whole.mass_lost.abs() < 1e-9);
        }
    }
}

//! Masses and springs beside finite elements, on the same meshes and loads.

mod network;

use nalgebra::Vector3;
use scindo_physics::body::{Body, BodySettings, ElementKind, Outcome, PcgSettings, StaticSettings};
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::mesh::{BoxPattern, TetMesh, box_mesh};
use scindo_study::report::chart::{Chart, Line};
use scindo_study::report::result::Plots;
use scindo_study::report::result::{ExperimentResult, Table, Unit};

use crate::lab::least;
use crate::lab::{ExperimentBench, Trouble, distance, hold_left};
use network::Network;

type V = Vector3<f64>;

/// A beam that is held at its left end [m], and the distance of the points that are compared [m].
const SIZE_M: V = V::new(0.4, 0.1, 0.1);
const WATCHED_M: f64 = 0.05;
/// Cells across the beam, of five tetrahedra each; of the truth, whose elements are quadratic.
const ACROSS: [usize; 3] = [2, 4, 8];
const TRUTH_ACROSS: usize = 6;
/// Poisson's ratios: that of springs in all directions, and that of wet tissue.
const POISSON: [f64; 2] = [0.25, 0.45];
const YOUNG_PA: f64 = 2e5;
const DENSITY_KG_M3: f64 = 1000.0;
/// Accelerations that bend and stretch the beam by a few per cent of its length [m/s²].
const BENDS: V = V::new(0.0, 0.0, -0.5);
const STRETCHES: V = V::new(20.0, 0.0, 0.0);
/// Step [s] and iterations of a step whose time is taken, viscosity [s].
const STEP_S: f64 = 0.01;
const ITERATIONS: u32 = 10;
const BETA_S: f64 = 0.01;
/// A network rests when no mass moves farther than this in a step [m].
const REST: (usize, f64) = (4000, 1e-9);

/// A way to compute the beam.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Way {
    /// Linear tetrahedra under the corotational law.
    Elements,
    /// Springs as stiff as van Gelder's formula says.
    Springs,
    /// The same times a factor by which the beam bends as far as the truth on the mesh with 4 cells across.
    Calibrated(f64),
}

/// Displacements of the points that are compared [m].
struct Answer {
    bent: Vec<V>,
    stretched: Vec<V>,
}

/// The experiment.
///
/// # Errors
/// A body could not be made or has no equilibrium, or the user ended the study.
pub(super) fn springs(bench: &mut ExperimentBench<'_>) -> Result<ExperimentResult, Trouble> {
    let mut result = ExperimentResult {
        name: "springs",
        title: "Masses and springs beside finite elements".into(),
        about: format!(
            "A beam of {:.0} × {:.0} × {:.0} cm, held at one end, is bent by an acceleration across it and stretched by \
             one along it. Nodes of a mesh are masses and its edges springs (k = E Σ V / L², van Gelder 1998), or its \
             tetrahedra are finite elements. Springs in all directions behave like a material with ν = ¼, so the first \
             table is their best case. Finer meshes bring elements closer to the truth, a mesh of quadratic elements; \
             they bring springs closer to another material, which narrows by about 0.2 of what it lengthens by, \
             whatever ν is. Springs can be calibrated: then they bend right on the mesh and under the load for which \
             that was done. Steps are implicit Euler's with {ITERATIONS} iterations, on one thread: elements as \
             `scindo run` makes them, springs in plain double precision.",
            100.0 * SIZE_M.x,
            100.0 * SIZE_M.y,
            100.0 * SIZE_M.z
        ),
        ..ExperimentResult::default()
    };
    let meshes = if bench.is_quick() { &ACROSS[..2] } else { &ACROSS[..] };
    let total = POISSON.len() * (1 + 3 * meshes.len());
    for poisson in POISSON {
        bench.begin(format!("truth, ν = {poisson}"), total)?;
        // Springs know no ν: the same networks are held against another truth for each of them.
        let truth = Answer::of_body(|| beam(TRUTH_ACROSS, poisson, ElementKind::Tet10))?;
        // Calibrated on one mesh and for one load; the other rows show how far that carries.
        let factor = calibration(&truth)?;
        let mut table = Table::new(
            &format!("ν = {poisson}"),
            "Errors of the displacement in the L² norm over points 5 cm apart; what the beam narrows by over what it \
             lengthens by; and a step.",
            &[
                ("nodes", Unit::Count),
                ("error, bent", Unit::Number),
                ("error, stretched", Unit::Number),
                ("narrowing", Unit::Number),
                ("step", Unit::Seconds),
            ],
        );
        let mut chart = Chart::new(&format!("Bent, ν = {poisson}"), "time of a step [ms]", "error");
        chart.logarithmic = true;
        let ways = [
            (Way::Elements, "finite elements"),
            (Way::Springs, "springs"),
            (Way::Calibrated(factor), "calibrated springs"),
        ];
        for (way, name) in ways {
            let mut points = Vec::new();
            for &across in meshes {
                bench.begin(format!("{name}, {across} cells across, ν = {poisson}"), total)?;
                // The answer is an equilibrium, while the time is that of one step, made by a body of its own.
                let answer = way.answer(across, poisson)?;
                let seconds = way.time(across, poisson)?;
                let errors = answer.errors(&truth);
                points.push([1e3 * seconds, errors[0]]);
                let nodes = mesh(across).nodes.len() as f64;
                let values = [nodes, errors[0], errors[1], answer.narrowing(), seconds].map(Some);
                table.row(format!("{name}, {across} cells"), &values);
            }
            chart.lines.push(Line { name: name.into(), points });
        }
        // Narrowing belongs to the material and not to the mesh, so the truth has it, too.
        table.row("truth", &[None, None, None, Some(truth.narrowing()), None]);
        result.tables.push(table);
        let caption = format!(
            "What a step costs and how wrong its beam is. Calibrated springs are {factor:.2} times as stiff, so that \
             their mesh with {} cells across bends right.",
            ACROSS[1]
        );
        result.plots.push(Plots { caption, charts: vec![chart], ..Plots::default() });
    }
    Ok(result)
}

impl Way {
    fn answer(self, across: usize, poisson: f64) -> Result<Answer, Trouble> {
        match self.factor() {
            None => Answer::of_body(|| beam(across, poisson, ElementKind::Tet4)),
            Some(factor) => Answer::of_springs(across, factor),
        }
    }

    /// What the stiffness of springs is multiplied by; `None` for elements.
    fn factor(self) -> Option<f64> {
        match self {
            Self::Elements => None,
            Self::Springs => Some(1.0),
            Self::Calibrated(factor) => Some(factor),
        }
    }

    /// Time of a step [s].
    fn time(self, across: usize, poisson: f64) -> Result<f64, Trouble> {
        match self.factor() {
            None => {
                let mut body = beam(across, poisson, ElementKind::Tet4)?;
                least(|| match body.step(STEP_S, BENDS, &[]).outcome {
                    Outcome::Advanced => Ok(()),
                    other => Err(format!("a step was refused: {other:?}").into()),
                })
            }
            Some(factor) => {
                let mut network = network(across, factor);
                least(|| {
                    network.step(STEP_S, BENDS, (ITERATIONS, 0.0));
                    Ok(())
                })
            }
        }
    }
}

impl Answer {
    fn of_body(make: impl Fn() -> Result<Body, Trouble>) -> Result<Self, Trouble> {
        let solve = |gravity| {
            let mut body = make()?;
            let report = body.solve_static(gravity, &StaticSettings::default())?;
            if !report.converged {
                return Err(Trouble::from("the beam has no equilibrium"));
            }
            Ok(watched(body.rest_positions(), body.positions()))
        };
        Ok(Self { bent: solve(BENDS)?, stretched: solve(STRETCHES)? })
    }

    fn of_springs(across: usize, factor: f64) -> Result<Self, Trouble> {
        let rest = mesh(across).nodes;
        let solve = |gravity| {
            let mut network = network(across, factor);
            for _ in 0..REST.0 {
                // Long steps damp by themselves.
                if network.step(20.0 * STEP_S, gravity, (400, 1e-8)) < REST.1 {
                    return Ok(watched(&rest, network.positions()));
                }
            }
            Err(Trouble::from("the springs do not come to rest"))
        };
        Ok(Self { bent: solve(BENDS)?, stretched: solve(STRETCHES)? })
    }

    fn errors(&self, truth: &Self) -> [f64; 2] {
        [distance(&self.bent, &truth.bent), distance(&self.stretched, &truth.stretched)]
    }

    /// Strain across the beam over that along it in the middle of the stretched beam, with its sign changed.
    fn narrowing(&self) -> f64 {
        let points = watched_points();
        let at = |x: f64, y: f64| {
            let is_it = |X: &V| (X - V::new(x, y, 0.0)).norm() < 1e-9;
            points.iter().position(is_it).map_or_else(V::zeros, |i| self.stretched[i])
        };
        let middle = 0.5 * SIZE_M.x;
        let across = (at(middle, SIZE_M.y) - at(middle, 0.0)).y / SIZE_M.y;
        let along = (at(middle + WATCHED_M, 0.0) - at(middle - WATCHED_M, 0.0)).x / (2.0 * WATCHED_M);
        -across / along
    }
}

/// The factor by which springs bend as far as the truth.
fn calibration(truth: &Answer) -> Result<f64, Trouble> {
    let tip = |bent: &[V]| bent.iter().map(|u| -u.z).fold(0.0, f64::max);
    Ok(tip(&Answer::of_springs(ACROSS[1], 1.0)?.bent) / tip(&truth.bent))
}

fn mesh(across: usize) -> TetMesh {
    let cells = [4 * across, across, across];
    box_mesh(V::zeros(), SIZE_M, cells, BoxPattern::Tet5 { parity: false })
}

fn network(across: usize, factor: f64) -> Network {
    let mut network = Network::new(&mesh(across), (YOUNG_PA, DENSITY_KG_M3), BETA_S, |X| X.x < 1e-9);
    network.scale(factor);
    network
}

fn beam(across: usize, poisson: f64, element: ElementKind) -> Result<Body, Trouble> {
    let material = Material {
        young_pa: YOUNG_PA,
        poisson,
        density_kg_m3: DENSITY_KG_M3,
        rayleigh: Rayleigh { mass_1_s: 0.0, stiffness_s: BETA_S },
        law: Law::Corotational,
    };
    let solver = PcgSettings { iterations: ITERATIONS, tolerance: 1e-7 };
    let mut body =
        Body::new(mesh(across), material, BodySettings { element, solver, ..BodySettings::default() })?;
    hold_left(&mut body)?;
    Ok(body)
}

/// Points of the beam that are nodes of every mesh [m].
fn watched_points() -> Vec<V> {
    let count = SIZE_M.map(|side| (side / WATCHED_M).round() as usize + 1);
    let mut points = Vec::new();
    for k in 0..count.z {
        for j in 0..count.y {
            points.extend((0..count.x).map(|i| V::new(i as f64, j as f64, k as f64) * WATCHED_M));
        }
    }
    points
}

/// Their displacements [m].
fn watched(rest: &[V], x: &[V]) -> Vec<V> {
    let near = |point: &V| rest.iter().position(|X| (X - point).norm() < 1e-9);
    watched_points().iter().filter_map(near).map(|n| x[n] - rest[n]).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// Springs have a Poisson's ratio of their own, whatever that of the material is.
    #[test]
    fn springs_answer_for_another_material() {
        let truth = Answer::of_body(|| beam(2, 0.45, ElementKind::Tet10)).unwrap();
        let elements = Way::Elements.answer(4, 0.45).unwrap();
        let springs = Way::Springs.answer(4, 0.45).unwrap();
        assert!((truth.narrowing() - 0.45).abs() < 0.03, "{}", truth.narrowing());
        assert!((elements.narrowing() - 0.45).abs() < 0.05, "{}", elements.narrowing());
        assert!((springs.narrowing() - 0.25).abs() < 0.1, "{}", springs.narrowing());
        let [elements, springs] = [elements, springs].map(|answer| answer.errors(&truth)[1]);
        assert!(elements < 0.5 * springs, "{elements}, {springs}");
    }
}

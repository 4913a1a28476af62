//! `summary.json`: what a run did, in figures.

use std::convert::Infallible;

use scindo_physics::body::estimate::MeshError;
use serde::Serialize;
use serde_json::Value;

use super::forces::{Row, each_contact};
use super::machine::Machine;
use crate::body::{AdaptCounts, Probe, SimBody};
use crate::report::{Event, Level, StepReport};
use crate::simulation::governor::GovernorReport;
use crate::simulation::{Plan, Simulation};

/// Most events that a summary lists; the rest is counted.
const MAX_EVENTS: usize = 200;

/// The summary.
#[derive(Debug, Clone, Serialize)]
pub struct Summary {
    /// `running`, `done`, or why it stopped.
    pub status: String,
    /// Name of the scene.
    pub scene_name: String,
    /// Version of the program.
    pub version: &'static str,
    /// Seed of everything random.
    pub seed: u64,
    /// Steps done.
    pub steps: u64,
    /// Simulated time [s].
    pub time_s: f64,
    /// Simulated time per step [s].
    pub step_s: f64,
    /// Measured times.
    pub timing: Timing,
    /// Bodies in the order of the scene.
    pub bodies: Vec<BodySummary>,
    /// Final positions of the probes.
    pub probes: Vec<ProbeSummary>,
    /// Everything that touched anything during the run.
    pub contacts: Vec<ContactSummary>,
    /// Cuts that changed a body.
    pub cuts_applied: u64,
    /// Samples of tools that were refused.
    pub refused_tool_samples: u64,
    /// What happened, the first of it.
    pub events: Vec<EventSummary>,
    /// How many events there were.
    pub event_count: u64,
    /// What is odd about the scene, and what went wrong in the steps: a line for each body and kind.
    pub warnings: Vec<String>,
    /// Why the run does not count as one that succeeded.
    pub failures: Vec<String>,
    /// Effects on and off, with costs.
    pub plan: Plan,
    /// What it ran on.
    pub machine: Machine,
    /// The scene, overrides included.
    pub scene: Value,
}

/// Measured times of the steps [ms].
#[derive(Debug, Clone, Default, Serialize)]
pub struct Timing {
    /// Mean per step.
    pub mean_ms: f64,
    /// Median step.
    pub median_ms: f64,
    /// 99th percentile.
    pub p99_ms: f64,
    /// Slowest step.
    pub max_ms: f64,
    /// Mean processor time of the thread that steps: what a step costs on a machine that is not busy.
    pub processor_mean_ms: f64,
    /// Simulated over computed time.
    pub real_time_factor: f64,
    /// What the governor gave up, where the scene has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub governor: Option<GovernorReport>,
    /// Mean per stage.
    pub stages: Vec<StageSummary>,
    /// Mean per phase of the stage `deform`, over all bodies; empty if they were not measured.
    pub phases: Vec<StageSummary>,
}

/// Mean time of a stage or phase.
#[derive(Debug, Clone, Serialize)]
pub struct StageSummary {
    pub name: &'static str,
    /// Mean per step [ms].
    pub mean_ms: f64,
}

/// One body.
#[derive(Debug, Clone, Serialize)]
pub struct BodySummary {
    /// Name.
    pub id: String,
    /// Elements of the mesh.
    pub elements: usize,
    /// Nodes of the mesh.
    pub nodes: usize,
    /// Unknowns, three per copy and per node that quadratic elements add.
    pub unknowns: usize,
    /// Pieces that cuts made of the elements.
    pub pieces: usize,
    /// Copies of nodes, three unknowns each.
    pub copies: usize,
    /// Parts that hang together.
    pub parts: usize,
    /// Vertices of its surface, at the end.
    pub surface_vertices: usize,
    /// Triangles of its surface, at the end.
    pub surface_triangles: usize,
    /// What became of its cells, where they are adapted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub adaptation: Option<AdaptationSummary>,
    /// Triangles on the lips of cuts.
    pub lip_triangles: usize,
    /// Incisions that left a lip.
    pub incisions: usize,
    /// Topology epoch.
    pub epoch: u32,
    /// Mass [kg].
    pub mass_kg: f64,
    /// Volume at rest [m³].
    pub rest_volume_m3: f64,
    /// Volume now [m³].
    pub volume_m3: f64,
    /// Smallest det F of any piece.
    pub least_volume_ratio: f64,
    /// Largest displacement of a node at the end [m].
    pub max_displacement_m: f64,
    /// Largest displacement over the run of a node of a part that something holds [m].
    pub largest_displacement_m: f64,
    /// Kinetic energy [J].
    pub kinetic_j: f64,
    /// Elastic energy [J].
    pub elastic_j: f64,
    /// Force [N] that holds each group of fixed nodes, in the order of the scene.
    pub reactions_n: Vec<[f64; 3]>,
    /// Solver over the run.
    pub solver: SolverSummary,
    /// Estimate of the discretisation error at the end, with effects.error_estimate.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mesh_error: Option<MeshErrorSummary>,
    /// Whether every position and velocity is finite.
    pub finite: bool,
    /// What was found and repaired in the mesh file.
    pub mesh: Value,
}

/// Division and joining of cells over the run.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct AdaptationSummary {
    /// Steps that began with other cells than the step before ended with.
    pub changes: u64,
    /// Cells that were divided into eight, for 2:1 balance too.
    pub divided: u64,
    /// Groups of eight cells that were joined.
    pub joined: u64,
    /// Most cells at any time; `elements` are those at the end.
    pub most_cells: usize,
}

/// Estimate of the discretisation error by stress recovery (Zienkiewicz, Zhu 1987).
#[derive(Debug, Clone, Copy, Serialize)]
pub struct MeshErrorSummary {
    /// Estimated energy norm of the error [√J].
    pub eta_sqrt_j: f64,
    /// Energy norm of the solution [√J].
    pub energy_norm_sqrt_j: f64,
    /// Share of the energy norm that the mesh misses.
    pub relative: f64,
    /// Pieces left out because they are inverted or flat.
    pub left_out: usize,
}

/// The linear solver over the run.
#[derive(Debug, Clone, Default, Serialize)]
pub struct SolverSummary {
    /// Mean iterations per step.
    pub mean_iterations: f64,
    /// Most iterations of a step.
    pub max_iterations: u32,
    /// Relative preconditioned residual of the last step.
    pub last_residual: f64,
    /// Largest of any step.
    pub max_residual: f64,
    /// Why the last solve stopped.
    pub last_stop: String,
    /// Newton steps of the last step; 1 where a step is one linear solve, 0 for explicit integrators.
    pub last_newton_steps: u32,
    /// Most Newton steps of a step.
    pub max_newton_steps: u32,
    /// Halvings of all line searches.
    pub backtracks: u64,
    /// Estimated algebraic error of the last linear solve in the energy norm [√J]; 0 without estimate.
    pub last_algebraic_error: f64,
    /// Steps at which something was done differently from what was asked for.
    pub noticed_steps: u64,
    /// Steps that ended above their tolerance.
    pub unconverged_steps: u64,
    /// Steps that could not be made as asked.
    pub refused_steps: u64,
    /// Steps that failed as a whole and were made in parts.
    pub divided_steps: u64,
    /// Steps that failed in parts as well and were rolled back.
    pub rolled_back_steps: u64,
    /// Steps that held inverted elements.
    pub inverted_steps: u64,
    /// Steps after which energy had come from nowhere.
    pub unbalanced_steps: u64,
}

/// A probe at the end.
#[derive(Debug, Clone, Serialize)]
pub struct ProbeSummary {
    /// Name.
    pub id: String,
    /// Position [m].
    pub position_m: [f64; 3],
    /// Displacement from rest [m].
    pub displacement_m: [f64; 3],
}

/// Contact of two things over the run, of the kinds that `contacts.csv` lists.
#[derive(Debug, Clone, Serialize)]
pub struct ContactSummary {
    /// `tool`, `obstacle`, `body` or `itself`.
    pub kind: &'static str,
    /// The tool or body that is pushed.
    pub on: String,
    /// What pushes it; empty for a tool.
    pub by: String,
    /// Steps in which they touched.
    pub steps: u64,
    /// Pushed vertices at the end; 0 if they do not touch then.
    pub contacts: u32,
    /// Force at the end [N].
    pub force_n: [f64; 3],
    /// Sum of the normal forces at the end [N].
    pub normal_n: f64,
    /// Largest depth of a vertex at the end [m].
    pub deepest_m: f64,
    /// Largest depth of the run [m].
    pub largest_depth_m: f64,
    /// Largest force of the run [N].
    pub largest_force_n: f64,
}

/// An event.
#[derive(Debug, Clone, Serialize)]
pub struct EventSummary {
    /// Step it happened in.
    pub step: u64,
    /// `info`, `warning` or `error`.
    pub level: &'static str,
    /// Stable name.
    pub name: &'static str,
    /// The body it happened to.
    pub body: Option<String>,
    /// In words.
    pub message: String,
}

impl ContactSummary {
    fn new(row: &Row<'_>) -> Self {
        Self {
            kind: row.kind,
            on: row.on.to_owned(),
            by: row.by.to_owned(),
            steps: 0,
            contacts: 0,
            force_n: [0.0; 3],
            normal_n: 0.0,
            deepest_m: 0.0,
            largest_depth_m: 0.0,
            largest_force_n: 0.0,
        }
    }

    fn add(&mut self, row: &Row<'_>) {
        self.steps += 1;
        self.contacts = row.contacts;
        self.force_n = row.force_n.into();
        self.normal_n = row.normal_n;
        self.deepest_m = row.deepest_m;
        self.largest_depth_m = self.largest_depth_m.max(row.deepest_m);
        self.largest_force_n = self.largest_force_n.max(row.force_n.norm());
    }
}

/// Collects over the steps of a run.
#[derive(Debug, Clone, Default)]
pub(crate) struct Running {
    step_ms: Vec<f32>,
    processor_s: f64,
    /// Per body, over the run [m].
    largest_displacement_m: Vec<f64>,
    solvers: Vec<(SolverSummary, u64)>,
    contacts: Vec<ContactSummary>,
    events: Vec<EventSummary>,
    event_count: u64,
}

impl Running {
    /// Takes note of the step that `simulation` has just made.
    pub(super) fn add(&mut self, simulation: &Simulation) {
        self.add_report(simulation.report());
        self.processor_s += simulation.report().processor_s;
        self.largest_displacement_m.resize(simulation.bodies().len(), 0.0);
        for (largest, body) in self.largest_displacement_m.iter_mut().zip(simulation.bodies()) {
            *largest = largest.max(body.displacement_m());
        }
        self.add_contacts(simulation);
    }

    fn add_contacts(&mut self, simulation: &Simulation) {
        for known in &mut self.contacts {
            (known.contacts, known.force_n, known.normal_n, known.deepest_m) = (0, [0.0; 3], 0.0, 0.0);
        }
        let Ok(()) = each_contact::<Infallible>(simulation, |row| {
            let is_it =
                |known: &ContactSummary| known.kind == row.kind && known.on == row.on && known.by == row.by;
            let place = self.contacts.iter().position(is_it).unwrap_or_else(|| {
                self.contacts.push(ContactSummary::new(row));
                self.contacts.len() - 1
            });
            self.contacts[place].add(row);
            Ok(())
        });
    }

    fn add_report(&mut self, report: &StepReport) {
        use scindo_physics::body::Outcome;
        self.step_ms.push((report.seconds.total() * 1e3) as f32);
        self.solvers.resize(report.bodies.len(), Default::default());
        for ((solver, iterations), body) in self.solvers.iter_mut().zip(&report.bodies) {
            let solve = &body.solve;
            *iterations += u64::from(solve.iterations);
            solver.max_iterations = solver.max_iterations.max(solve.iterations);
            solver.last_residual = solve.residual;
            solver.max_residual = solver.max_residual.max(solve.residual);
            solver.last_stop = format!("{:?}", solve.stop);
            solver.last_newton_steps = solve.newton_steps;
            solver.max_newton_steps = solver.max_newton_steps.max(solve.newton_steps);
            solver.backtracks += u64::from(solve.backtracks);
            solver.last_algebraic_error = solve.algebraic_error;
            solver.noticed_steps += u64::from(solve.notice.is_some());
            solver.unconverged_steps += u64::from(solve.is_unconverged());
            solver.refused_steps += u64::from(solve.outcome == Outcome::Refused);
            solver.divided_steps += u64::from(solve.is_divided());
            solver.rolled_back_steps += u64::from(solve.outcome == Outcome::Held);
            solver.inverted_steps += u64::from(solve.inverted_pieces > 0);
            solver.unbalanced_steps += u64::from(solve.is_unbalanced());
        }
        self.event_count += report.events.len() as u64;
        let room = MAX_EVENTS.saturating_sub(self.events.len());
        self.events.extend(report.events.iter().take(room).map(|event| event_summary(report.step, event)));
    }

    pub(super) fn summary(&self, simulation: &Simulation, scene: Value, status: &str) -> Summary {
        let checked = simulation.scene();
        let steps = self.step_ms.len();
        let body = |(i, body): (usize, &SimBody)| {
            let (mut solver, iterations) = self.solvers.get(i).cloned().unwrap_or_default();
            solver.mean_iterations = iterations as f64 / steps.max(1) as f64;
            let mesh_error = simulation.report().bodies.get(i).and_then(|report| report.mesh_error);
            let largest_displacement_m = self.largest_displacement_m.get(i).copied().unwrap_or(0.0);
            let summary = body_summary(body, simulation, solver, mesh_error);
            BodySummary { largest_displacement_m, ..summary }
        };
        Summary {
            status: status.to_owned(),
            scene_name: checked.name.clone(),
            version: env!("CARGO_PKG_VERSION"),
            seed: checked.seed,
            steps: simulation.steps(),
            time_s: simulation.time_s(),
            step_s: checked.step_s,
            timing: self.timing(simulation),
            bodies: simulation.bodies().iter().enumerate().map(body).collect(),
            probes: simulation.probes().iter().map(|probe| probe_summary(probe, simulation)).collect(),
            contacts: self.contacts.clone(),
            cuts_applied: simulation.cuts_applied(),
            refused_tool_samples: simulation.tools().refused_samples(),
            events: self.events.clone(),
            event_count: self.event_count,
            warnings: [simulation.warnings(), &simulation.troubles()].concat(),
            failures: simulation.failures(),
            plan: simulation.plan(),
            machine: Machine::here(),
            scene,
        }
    }

    fn timing(&self, simulation: &Simulation) -> Timing {
        let mut sorted = self.step_ms.clone();
        sorted.sort_by(f32::total_cmp);
        let Some(&max) = sorted.last() else { return Timing::default() };
        let at = |share: f64| f64::from(sorted[((sorted.len() - 1) as f64 * share).round() as usize]);
        let n = sorted.len() as f64;
        let mean_ms = sorted.iter().map(|ms| f64::from(*ms)).sum::<f64>() / n;
        let (total, phases) = (simulation.total_seconds(), simulation.total_phases());
        let per_step = 1e3 / simulation.steps().max(1) as f64;
        let mean = |(name, seconds)| StageSummary { name, mean_ms: seconds * per_step };
        Timing {
            mean_ms,
            median_ms: at(0.5),
            p99_ms: at(0.99),
            max_ms: f64::from(max),
            processor_mean_ms: 1e3 * self.processor_s / n,
            real_time_factor: simulation.step_s() * 1e3 / mean_ms.max(1e-9),
            governor: simulation.governor_report(),
            stages: total.iter().map(mean).collect(),
            phases: if phases.total() > 0.0 { phases.iter().map(mean).collect() } else { Vec::new() },
        }
    }
}

fn event_summary(step: u64, event: &Event) -> EventSummary {
    EventSummary {
        step,
        level: match event.level {
            Level::Info => "info",
            Level::Warning => "warning",
            Level::Error => "error",
        },
        name: event.name,
        body: event.body.as_ref().map(|id| id.to_string()),
        message: event.message.clone(),
    }
}

fn probe_summary(probe: &Probe, simulation: &Simulation) -> ProbeSummary {
    let x = simulation.probe_position(probe);
    ProbeSummary { id: probe.id.clone(), position_m: x.into(), displacement_m: (x - probe.rest_m).into() }
}

fn body_summary(
    sim: &SimBody,
    simulation: &Simulation,
    solver: SolverSummary,
    mesh_error: Option<MeshError>,
) -> BodySummary {
    let body = &sim.body;
    let surface = body.surface();
    let mut lips: Vec<u32> = surface.tags.iter().copied().filter(|tag| *tag > 0).collect();
    let lip_triangles = lips.len();
    lips.sort_unstable();
    lips.dedup();
    let displaced = body.positions().iter().zip(body.rest_positions()).map(|(x, rest)| (x - rest).norm());
    let finite = body.positions().iter().chain(body.velocities()).all(|x| x.iter().all(|c| c.is_finite()));
    let gravity = simulation.scene().gravity_m_s2;
    BodySummary {
        id: sim.id.to_string(),
        elements: body.n_elements(),
        nodes: body.n_nodes(),
        unknowns: 3 * body.rest_positions().len(),
        pieces: body.n_pieces(),
        copies: body.rest_positions().len(),
        parts: body.components().len(),
        surface_vertices: surface.vertices.len(),
        surface_triangles: surface.triangles.len(),
        adaptation: sim.adapt_counts().map(|AdaptCounts { changes, divided, joined, most_cells }| {
            AdaptationSummary { changes, divided, joined, most_cells }
        }),
        lip_triangles,
        incisions: lips.len(),
        epoch: body.epoch(),
        mass_kg: body.total_mass(),
        rest_volume_m3: sim.rest_volume_m3,
        volume_m3: body.volume(),
        least_volume_ratio: body.least_volume_ratio(),
        max_displacement_m: displaced.fold(0.0, f64::max),
        // Known to whoever followed the run.
        largest_displacement_m: 0.0,
        kinetic_j: body.kinetic_energy(),
        elastic_j: body.elastic_energy(),
        reactions_n: sim.reactions(gravity).into_iter().map(Into::into).collect(),
        solver,
        mesh_error: mesh_error.map(|error| MeshErrorSummary {
            eta_sqrt_j: error.eta,
            energy_norm_sqrt_j: error.energy_norm,
            relative: error.relative,
            left_out: error.left_out,
        }),
        finite,
        mesh: serde_json::to_value(&sim.health).unwrap_or(Value::Null),
    }
}

//! `scindo check` reports errors, oddities, active effects and what the scene will do.

use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

use scindo_program::say;
use scindo_world::assemble::{BuildOptions, doubts};
use scindo_world::forecast::{Effort, Forecast, forecast};
use scindo_world::quantity::{coordinates, duration};
use scindo_world::scene::Scene;
use scindo_world::simulation::{Plan, SimBody, Simulation};
use serde_json::{Value, json};

use super::cli::CheckArgs;
use super::progress::Share;
use crate::error::RuntimeError;

/// The forecast is abandoned when it takes longer than this multiple of its whole budget: one step hangs.
const PATIENCE: u32 = 8;

/// Builds the scene and makes its first steps.
pub fn check(args: &CheckArgs) -> Result<ExitCode, RuntimeError> {
    let Some(path) = args.scene.as_deref().filter(|_| !args.schema) else {
        say!("{:#}", Scene::json_schema());
        return Ok(ExitCode::SUCCESS);
    };
    let scene = Scene::load_with(path, &args.set)?;
    let end_s = end_s(args, scene.checked().step_s)?;
    let progress = Arc::new(Share::begin(args.json));
    let simulation =
        Simulation::observed(&scene, scene.base_dir(), BuildOptions::default(), &|at| progress.meshing(at))?;
    progress.end();
    let mut found = Found::of(&scene, &simulation);
    found.warnings.extend(end_s.into_iter().flat_map(|end_s| doubts::after_the_end(scene.checked(), end_s)));
    if !args.json {
        found.print();
    }
    if !args.no_solve && !simulation.bodies().is_empty() {
        found.foretell(simulation, end_s, progress)?;
    }
    if args.json {
        say!("{:#}", found.as_json());
    } else {
        found.print_forecast();
    }
    Ok(ExitCode::SUCCESS)
}

fn end_s(args: &CheckArgs, step_s: f64) -> Result<Option<f64>, RuntimeError> {
    match (args.steps, args.seconds) {
        (Some(steps), _) => Ok(Some(steps as f64 * step_s)),
        (None, Some(seconds)) if !(seconds.is_finite() && seconds > 0.0) => Err(RuntimeError::Option {
            option: "--seconds",
            value: seconds.to_string(),
            reason: "a simulated time must be positive".to_owned(),
            next: "Leave it out to step until the scene comes to rest".to_owned(),
        }),
        (None, seconds) => Ok(seconds),
    }
}

/// What `scindo check` reports about a scene.
struct Found {
    file: String,
    name: String,
    description: String,
    step_s: f64,
    bodies: Vec<(String, Value)>,
    plan: Plan,
    forecast: Option<Forecast>,
    /// The reason when a forecast was asked for and none could be made.
    no_forecast: Option<String>,
    warnings: Vec<String>,
}

impl Found {
    fn of(scene: &Scene, simulation: &Simulation) -> Self {
        Self {
            file: scene.file().to_owned(),
            name: scene.name().to_owned(),
            description: scene.description().to_owned(),
            step_s: simulation.step_s(),
            bodies: simulation.bodies().iter().map(|body| (in_words(body), body_as_json(body))).collect(),
            plan: simulation.plan(),
            forecast: None,
            no_forecast: None,
            warnings: simulation.warnings().to_vec(),
        }
    }

    /// Makes the first steps on a separate thread, so that a step that never ends cannot block the command.
    fn foretell(
        &mut self,
        mut simulation: Simulation,
        end_s: Option<f64>,
        progress: Arc<Share>,
    ) -> Result<(), RuntimeError> {
        let effort = Effort { end_s, ..Effort::default() };
        let (sender, receiver) = crossbeam_channel::bounded(1);
        let told = Arc::clone(&progress);
        let work = move || {
            let made = forecast(&mut simulation, effort, &mut |share| told.at(share, "first steps"));
            // The receiver may have given up waiting.
            let _ = sender.send(made);
        };
        std::thread::Builder::new().name("forecast".into()).spawn(work).map_err(|e| {
            RuntimeError::System { what: "starting a thread".to_owned(), reason: e.to_string() }
        })?;
        let patience = PATIENCE * Duration::from_secs_f64(effort.processor_s);
        match receiver.recv_timeout(patience) {
            Ok(Ok(forecast)) => {
                self.warnings.extend(forecast.warnings.iter().cloned());
                self.forecast = Some(forecast);
            }
            Ok(Err(error)) => self.no_forecast = Some(error.to_string()),
            Err(_) => {
                self.no_forecast = Some(format!(
                    "the first steps take longer than {}; make the mesh coarser, or try a single step with \
                    scindo run --steps 1",
                    duration(patience.as_secs_f64())
                ));
            }
        }
        progress.end();
        Ok(())
    }

    fn as_json(&self) -> Value {
        json!({
            "scene": self.name,
            "description": self.description,
            "step_s": self.step_s,
            "predicted_ms": self.predicted_ms(),
            "effects": self.plan.effects,
            "bodies": self.bodies.iter().map(|(_, body)| body).collect::<Vec<_>>(),
            "forecast": self.forecast,
            "no_forecast": self.no_forecast,
            "warnings": self.warnings,
        })
    }

    /// Time per step [ms]: measured if steps were made, otherwise estimated from the table of costs.
    fn predicted_ms(&self) -> f64 {
        self.forecast.as_ref().map_or(self.plan.predicted_ms(), |forecast| forecast.cost.mean_ms)
    }

    fn print(&self) {
        say!("{}: {}", self.file, self.name);
        if !self.description.is_empty() {
            say!("  {}", self.description);
        }
        for (words, _) in &self.bodies {
            say!("{words}");
        }
        say!("{:<22} {:<4} {:>9}  why", "effect", "", "ms/step");
        for effect in &self.plan.effects {
            let (switch, cost) = if effect.on {
                ("on", format!("{:.3}", effect.predicted_ms))
            } else {
                ("off", String::new())
            };
            say!("{:<22} {switch:<4} {cost:>9}  {}", effect.name, effect.why);
        }
    }

    fn print_forecast(&self) {
        if let Some(forecast) = &self.forecast {
            say!("{forecast}");
        }
        if let Some(why) = &self.no_forecast {
            say!("no forecast: {why}");
        }
        let how = if self.forecast.is_some() { "measured" } else { "from a table of costs" };
        let (price, step) = (self.predicted_ms(), 1e3 * self.step_s);
        let pace = if price <= step {
            "keeps up with real time".to_owned()
        } else {
            format!("{:.1} times slower than real time", price / step)
        };
        say!("predicted {price:.3} ms per step of {step} ms ({how}): {pace}");
        for warning in &self.warnings {
            say!("warning: {warning}");
        }
    }
}

fn in_words(body: &SimBody) -> String {
    let (size, nodes) = (body.size(), body.body.n_copies());
    let [low, high] = body.corners_m().map(|corner| coordinates(&corner));
    let mut words = format!(
        "  body {}: {} elements, {nodes} nodes, {} surface triangles, {:.4e} m3\n    from {low} to {high} m",
        body.id, size.elements, size.triangles, body.rest_volume_m3
    );
    for line in body
        .health
        .iter()
        .flat_map(|health| health.to_string().lines().map(str::to_owned).collect::<Vec<_>>())
    {
        words += &format!("\n    {line}");
    }
    if let Some(kept) = body.body.kept() {
        let (triangles, of, percent) = (kept.triangles, kept.of, 100.0 * kept.area);
        words +=
            &format!("\n    skin: {triangles} of {of} triangles of the surface, {percent:.2} % of its area");
    }
    words
}

fn body_as_json(body: &SimBody) -> Value {
    let size = body.size();
    let [min_m, max_m] = body.corners_m();
    json!({
        "id": &*body.id,
        "elements": size.elements,
        "nodes": body.body.n_copies(),
        "surface_vertices": size.vertices,
        "surface_triangles": size.triangles,
        "min_m": min_m,
        "max_m": max_m,
        "volume_m3": body.rest_volume_m3,
        "mesh": body.health,
        "own_triangles": body.body.kept(),
    })
}

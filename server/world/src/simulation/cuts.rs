//! Cuts of a step: those the scene schedules, those clients ask for, those blades make.
//!
//! Every incision has a number, which tags its lips. A blade keeps its number until it leaves
//! cut mode; requests of one tool keep theirs while each begins where the last one ended.

use std::sync::Arc;

use nalgebra::Vector3;
use scindo_physics::cut::{BladeSweep, CutReport};
use scindo_physics::skin::Skin;

use super::body::SimBody;
use super::incision::incision_along;
use super::report::{Level, StepReport};
use crate::inputs::{CutOutcome, CutRequest};
use crate::scene::{CutPath, CutSpec, coordinates};
use crate::tool::Tools;

/// Two requests connect when the gap is below this fraction of the blade's length.
const CONNECTED: f64 = 0.02;

/// A blade cuts when it moved by this fraction of a body's element.
const LEAST_MOVE: f64 = 0.125;

/// What a cut works on.
pub(crate) struct Theatre<'a> {
    pub bodies: &'a mut [SimBody],
    pub tools: &'a mut Tools,
    pub report: &'a mut StepReport,
    /// Whether the scene allows cuts.
    pub allowed: bool,
}

/// Pending cuts and what connects them.
#[derive(Debug, Default)]
pub(crate) struct Cuts {
    /// By rising time.
    schedule: Vec<Scheduled>,
    next: usize,
    /// Where the last request of each tool ended.
    ends: Vec<RequestEnd>,
    /// A blade cuts when it moved this far [m].
    least_move_m: f64,
    applied: u64,
}

#[derive(Debug, Clone)]
struct Scheduled {
    at_s: f64,
    body: usize,
    blade: CutPath,
}

#[derive(Debug, Clone)]
struct RequestEnd {
    tool: Arc<str>,
    edge: [Vector3<f64>; 2],
    incision: u32,
}

impl Cuts {
    pub fn new(cuts: &[CutSpec], bodies: &[SimBody]) -> Self {
        let mut schedule: Vec<Scheduled> = cuts
            .iter()
            .map(|cut| Scheduled { at_s: cut.at_s, body: cut.body, blade: cut.blade.clone() })
            .collect();
        schedule.sort_by(|a, b| a.at_s.total_cmp(&b.at_s));
        let element_m = bodies.iter().map(element_size).fold(f64::INFINITY, f64::min);
        let least_move_m = if element_m.is_finite() { LEAST_MOVE * element_m } else { 0.0 };
        Self { schedule, least_move_m, ..Self::default() }
    }

    /// Back to the start of the schedule.
    pub fn reset(&mut self) {
        self.next = 0;
        self.ends.clear();
    }

    /// Sweeps that changed a body so far.
    pub fn applied(&self) -> u64 {
        self.applied
    }

    /// Cuts that the schedule has for the time up to `time_s` [s].
    pub fn apply_schedule(&mut self, time_s: f64, at: &mut Theatre<'_>) {
        while let Some(due) = self.schedule.get(self.next).filter(|cut| cut.at_s <= time_s) {
            let incision = at.tools.fresh_incision();
            let body = due.body;
            let blade = match &due.blade {
                CutPath::Sweep(segments) => Ok(BladeSweep { segments: segments.clone() }),
                CutPath::Incision { points, depth_m } => {
                    incision_along(&mut at.bodies[body], points, *depth_m, self.least_move_m)
                }
            };
            self.next += 1;
            match blade.and_then(|blade| self.sweep(body, &blade, incision, at)) {
                Ok(done) => tell_of_nothing_opened(&done, incision, &at.bodies[body], at.report),
                Err(reason) => at.report.tell(Level::Error, "cut-refused", &at.bodies[body].id, reason),
            }
        }
    }

    /// Cuts that clients asked for, each with an outcome.
    pub fn apply_requests(&mut self, requests: &[CutRequest], at: &mut Theatre<'_>) {
        for request in requests {
            let result = self.request(request, at);
            at.report.cuts.push(CutOutcome { request: request.request, result });
        }
    }

    /// Cuts that blades made by moving, through every body they meet.
    pub fn apply_blades(&mut self, at: &mut Theatre<'_>) {
        for tool in 0..at.tools.len() {
            let Some((blade, incision)) = at.tools.take_sweep(tool, self.least_move_m) else { continue };
            for body in 0..at.bodies.len() {
                if let Err(reason) = self.sweep(body, &blade, incision, at) {
                    at.report.tell(Level::Error, "cut-refused", &at.bodies[body].id, reason);
                }
            }
        }
    }

    fn request(&mut self, request: &CutRequest, at: &mut Theatre<'_>) -> Result<usize, String> {
        let wanted = |body: &SimBody| request.body.as_ref().is_none_or(|id| *id == body.id);
        if !at.bodies.iter().any(wanted) {
            let known: Vec<&str> = at.bodies.iter().map(|body| &*body.id).collect();
            let name = request.body.as_deref().unwrap_or("");
            return Err(format!("no body is called `{name}`; there are: {}", known.join(", ")));
        }
        let (Some(first), Some(last)) = (request.segments.first(), request.segments.last()) else {
            return Err("the sweep is empty; give at least two blade segments".into());
        };
        let incision = self.incision_of(&request.tool, *first, *last, at.tools);
        let blade = BladeSweep { segments: request.segments.clone() };
        let mut elements = 0;
        for body in 0..at.bodies.len() {
            if wanted(&at.bodies[body]) {
                elements += self.sweep(body, &blade, incision, at)?.elements_cut;
            }
        }
        Ok(elements)
    }

    /// The number of the incision that a request of `tool` from edge `first` to `last` belongs to.
    fn incision_of(
        &mut self,
        tool: &Arc<str>,
        first: [Vector3<f64>; 2],
        last: [Vector3<f64>; 2],
        tools: &mut Tools,
    ) -> u32 {
        let reach = CONNECTED * (first[1] - first[0]).norm();
        let joins = |end: &RequestEnd| (0..2).all(|i| (end.edge[i] - first[i]).norm() <= reach);
        if let Some(end) = self.ends.iter_mut().find(|end| end.tool == *tool) {
            if !joins(end) {
                end.incision = tools.fresh_incision();
            }
            end.edge = last;
            return end.incision;
        }
        let incision = tools.fresh_incision();
        self.ends.push(RequestEnd { tool: tool.clone(), edge: last, incision });
        incision
    }

    /// One sweep through one body; tells what it did if it did anything.
    fn sweep(
        &mut self,
        body: usize,
        blade: &BladeSweep,
        incision: u32,
        at: &mut Theatre<'_>,
    ) -> Result<CutReport, String> {
        if !at.allowed {
            return Err("cutting is switched off by effects.cutting = false".into());
        }
        let body = &mut at.bodies[body];
        let before = body.epoch();
        let fitted = body.body.skin().is_some_and(Skin::fits);
        let done = body.body.cut(blade, incision).map_err(|error| error.to_string())?;
        body.has_been_swept();
        if done.epoch != before {
            body.has_changed_topology();
            self.applied += 1;
            let (elements, copies) = (done.elements_cut, done.new_copies.len());
            let elements = if elements == 1 { "1 element".into() } else { format!("{elements} elements") };
            let copies = if copies == 1 { "1 new copy".into() } else { format!("{copies} new copies") };
            let message = format!("incision {incision}: {elements}, {copies}");
            at.report.tell(Level::Info, "cut-applied", &body.id, message);
        }
        if done.refused_edges > 0 {
            let edges = done.refused_edges;
            let message = format!(
                "incision {incision}: {edges} edges stay whole, their elements hold too many fragments"
            );
            at.report.tell(Level::Warning, "cut-incomplete", &body.id, message);
        }
        if let (true, Some(why)) = (fitted, body.body.skin().and_then(Skin::misfit)) {
            let message = format!(
                "incision {incision}: skin and wound do not fit, {why}; the boundary of the elements is shown \
                 from here to the next reset; other skin.divisions or skin.snapping = 0 may fit"
            );
            at.report.tell(Level::Warning, "skin-left", &body.id, message);
        }
        Ok(done)
    }
}

/// Doubts about scheduled cuts: those that pass beside their body, as it lies at the start.
pub(crate) fn doubts(cuts: &[CutSpec], bodies: &[SimBody]) -> Vec<String> {
    let mut doubts = Vec::new();
    for (number, cut) in cuts.iter().enumerate() {
        let (CutPath::Sweep(segments), Some(body)) = (&cut.blade, bodies.get(cut.body)) else { continue };
        let (low, high) = bounds(body.body.positions().iter());
        let (from, to) = bounds(segments.iter().flatten());
        if (0..3).any(|axis| to[axis] < low[axis] || from[axis] > high[axis]) {
            doubts.push(format!(
                "cut.{number}.sweep_m: reaches from {} to {} m and passes beside body `{}`, which lies from {} to {} m",
                coordinates(&from.into()),
                coordinates(&to.into()),
                body.id,
                coordinates(&low.into()),
                coordinates(&high.into())
            ));
        }
    }
    doubts
}

/// Corners of the box around some points.
fn bounds<'a>(points: impl Iterator<Item = &'a Vector3<f64>>) -> (Vector3<f64>, Vector3<f64>) {
    let none = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
    points.fold(none, |(low, high), point| (low.inf(point), high.sup(point)))
}

/// Warns of a cut of the scene that opened nothing, with the reason.
fn tell_of_nothing_opened(done: &CutReport, incision: u32, body: &SimBody, report: &mut StepReport) {
    if done.elements_cut > 0 || done.refused_edges > 0 {
        return;
    }
    let message = if done.pending_edges > 0 {
        let size_mm = 1e3 * element_size(body);
        format!(
            "incision {incision} is drawn on the surface and opens nothing: it ends inside the elements it \
             enters, whose cells are {size_mm:.1} mm wide; cut deeper or make the elements smaller"
        )
    } else {
        format!("incision {incision} opens nothing: its sweep crosses no edge of an element of the body")
    };
    report.tell(Level::Warning, "cut-opens-nothing", &body.id, message);
}

/// Edge [m] of a lattice cell that six elements of mean volume would fill.
fn element_size(body: &SimBody) -> f64 {
    (6.0 * body.rest_volume_m3 / body.size().elements as f64).cbrt()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::path::Path;

    use crate::inputs::Inputs;
    use crate::scene::Scene;
    use crate::simulation::{Level, Simulation};

    const SCENE: &str = r#"
        schema = 1
        [[body]]
        id = "block"
        mesh = { box = { min_m = [0, 0, 0], max_m = [0.1, 0.1, 0.1], cells = [3, 3, 3] } }
        skin = { divisions = 2 }
        young_pa = 1e5
        poisson = 0.3
        density_kg_m3 = 1000
        [[body.fix]]
        where = { box = { min_m = [-1, -1, -1], max_m = [1, 1, 1e-6] } }
        [[cut]]
        body = "block"
        at_s = 0.0
        sweep_m = [[[0.045, -0.1, -0.1], [0.045, -0.1, 0.2]], [[0.052, 0.2, -0.1], [0.052, 0.2, 0.2]]]
    "#;

    fn start(text: &str) -> Simulation {
        Simulation::new(&Scene::from_toml(text).unwrap(), Path::new("")).unwrap()
    }

    #[test]
    fn a_skin_that_is_left_is_told_once_and_comes_back_with_the_reset() {
        let mut sim = start(SCENE);
        sim.bodies[0].body.spoil_skin();
        let told = |sim: &mut Simulation| {
            let report = sim.step(&Inputs::default());
            let left = report.events.iter().filter(|event| event.name == "skin-left");
            left.map(|event| (event.level, event.message.clone())).collect::<Vec<_>>()
        };
        let first = told(&mut sim);
        assert!(
            matches!(&first[..], [(Level::Warning, message)] if message.contains("do not fit")),
            "{first:?}"
        );
        assert_eq!(told(&mut sim), []);
        assert!(!sim.bodies[0].body.skin().unwrap().fits());
        sim.reset().unwrap();
        assert!(sim.bodies[0].body.skin().unwrap().fits());
        assert_eq!(told(&mut sim), []);
    }

    #[test]
    fn a_cut_beside_its_body_is_doubted() {
        assert_eq!(start(SCENE).warnings(), [""; 0]);
        let beside = start(&SCENE.replace("0.045,", "0.45,").replace("0.052,", "0.52,"));
        let warnings = beside.warnings();
        assert!(matches!(warnings, [one] if one.contains("passes beside body `block`")), "{warnings:?}");
    }
}

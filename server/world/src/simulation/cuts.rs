//! Cuts of a step: those the scene schedules, those clients ask for, those blades make.
//!
//! Cuts of clients and of blades stand in one queue and are made in its order. A step does a counted
//! amount of [`Work`] on them; a long sweep takes several steps, and its outcome is told when it is made.
//! What it cuts is what it met where it began.
//!
//! Every incision has a number, which tags its lips. A blade keeps its number until it leaves
//! cut mode; requests of one tool keep theirs while each begins where the last one ended.

use std::collections::VecDeque;
use std::sync::Arc;

use nalgebra::{Unit, Vector3};
use scindo_physics::cut::{BladeSweep, CutReport, MAX_SEGMENTS, Work};
use scindo_physics::skin::Skin;

use super::incision::incision_along;
use super::undo::{History, Undone};
use crate::body::{SimBody, bounds};
use crate::inputs::{CutOutcome, CutRequest};
use crate::report::{Level, StepReport};
use crate::scene::{CutPath, CutSpec};
use crate::tool::Tools;

/// Two requests connect when the gap is below this fraction of the blade's length.
const CONNECTED: f64 = 0.02;

/// A blade cuts when it moved by this fraction of a body's element.
const LEAST_MOVE: f64 = 0.125;

/// A cut that opens less than this part of what its blade swept ends inside elements.
const LEAST_OPENED: f64 = 0.98;

/// Work on cuts of clients and blades that a step does, in fragments looked at: some ten milliseconds.
const WORK_PER_STEP: u64 = 100_000;

/// Nodes and elements that are looked at in the time of one fragment when a cut begins and ends.
const NODES_PER_FRAGMENT: usize = 4;

/// Most cuts in the queue. The inbox lets fewer in; blades that start anew in every step are stopped here.
const MAX_WAITING: usize = 256;

/// What a cut works on.
pub(crate) struct CutContext<'a> {
    pub bodies: &'a mut [SimBody],
    pub tools: &'a mut Tools,
    pub report: &'a mut StepReport,
    /// Whether the scene allows cuts.
    pub allowed: bool,
    /// Whether the discretisation error is estimated.
    pub estimates: bool,
}

/// Pending cuts and what connects them.
#[derive(Debug, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct Cuts {
    /// By rising time.
    schedule: Vec<Scheduled>,
    next: usize,
    /// Where the last request of each tool ended.
    ends: Vec<RequestEnd>,
    /// A blade cuts when it moved this far [m].
    least_move_m: f64,
    applied: u64,
    /// Of the scheduled cuts so far, where the error is estimated.
    swept: Vec<Swept>,
    history: History,
    /// Cuts of clients and blades, in the order in which they are made.
    waiting: VecDeque<Job>,
}

/// What a scheduled cut was to open.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
pub(crate) struct Swept {
    /// Index of the body.
    pub body: usize,
    /// Number of its incision.
    pub incision: u32,
    /// Number of the first incision of the cut that it is a part of.
    pub cut: u32,
    /// Area that the blade swept inside the body [m²].
    pub area_m2: f64,
}

/// A cut in the queue.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
struct Job {
    blade: BladeSweep,
    incision: u32,
    /// Bodies that it has still to pass through, the next one last.
    bodies: Vec<usize>,
    /// The next body is being cut.
    begun: bool,
    elements: usize,
    /// The number of the request; none for a blade.
    request: Option<u64>,
}

#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
struct Scheduled {
    at_s: f64,
    body: usize,
    blade: CutPath,
}

#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
struct RequestEnd {
    tool: Arc<str>,
    edge: [Vector3<f64>; 2],
    incision: u32,
}

impl Cuts {
    pub(super) fn new(cuts: &[CutSpec], bodies: &[SimBody]) -> Self {
        let mut schedule: Vec<Scheduled> = cuts
            .iter()
            .map(|cut| Scheduled { at_s: cut.at_s, body: cut.body, blade: cut.blade.clone() })
            .collect();
        schedule.sort_by(|a, b| a.at_s.total_cmp(&b.at_s));
        let element_m = bodies.iter().map(SimBody::cell_m).fold(f64::INFINITY, f64::min);
        let least_move_m = if element_m.is_finite() { LEAST_MOVE * element_m } else { 0.0 };
        Self { schedule, least_move_m, ..Self::default() }
    }

    /// Back to the start of the schedule.
    pub(super) fn reset(&mut self) {
        self.next = 0;
        self.ends.clear();
        self.history.clear();
        self.swept.clear();
        self.waiting.clear();
    }

    /// What the scheduled cuts so far were to open, where the error is estimated.
    pub(super) fn swept(&self) -> &[Swept] {
        &self.swept
    }

    /// Takes the last incision back. What comes next is an incision of its own.
    ///
    /// # Errors
    /// That there is none, that cuts still wait, or that a body cannot be built again.
    pub(super) fn undo(&mut self, bodies: &mut [SimBody]) -> Result<Undone, String> {
        if !self.waiting.is_empty() {
            return Err("cuts are still being made; undo the last one when they are complete".into());
        }
        let undone = self.history.undo(bodies)?;
        self.ends.retain(|end| end.incision != undone.incision);
        self.swept.retain(|swept| swept.incision != undone.incision);
        Ok(undone)
    }

    /// Forgets the cuts that wait, for a reset or the end; their outcomes say `reason`.
    pub(super) fn discard(&mut self, reason: &str) -> Vec<CutOutcome> {
        let discarded = self.waiting.drain(..).filter_map(|job| job.request);
        discarded.map(|request| CutOutcome { request, result: Err(reason.to_owned()) }).collect()
    }

    /// Sweeps that changed a body so far.
    pub(super) fn applied(&self) -> u64 {
        self.applied
    }

    /// Cuts that the schedule has for the time up to `time_s` [s].
    pub(super) fn apply_schedule(&mut self, time_s: f64, at: &mut CutContext<'_>) {
        while let Some(due) = self.schedule.get(self.next).filter(|cut| cut.at_s <= time_s) {
            if at.bodies[due.body].body.is_being_cut() {
                return;
            }
            let incision = at.tools.fresh_incision();
            let body = due.body;
            let blade = match &due.blade {
                CutPath::Sweep(segments) => Ok(BladeSweep { segments: segments.clone() }),
                CutPath::Plane { point_m, normal } => {
                    Ok(across(at.bodies[body].body.positions(), *point_m, *normal))
                }
                CutPath::Incision { points, depth_m } => {
                    incision_along(&mut at.bodies[body], points, *depth_m, self.least_move_m)
                }
            };
            self.next += 1;
            if let (true, Ok(blade)) = (at.estimates, &blade) {
                let area_m2 = at.bodies[body].body.swept_area(blade);
                self.swept.push(Swept { body, incision, cut: incision, area_m2 });
            }
            match blade.and_then(|blade| self.sweep(body, &blade, incision, at)) {
                Ok(done) => {
                    join(&mut self.swept, body, incision, &done.joined);
                    tell_of_nothing_opened(&done, incision, &at.bodies[body], at.report);
                }
                Err(reason) => at.report.tell(Level::Error, "cut-refused", &at.bodies[body].id, reason),
            }
        }
    }

    /// Queues cuts that clients asked for; each gets an outcome, in this step or a later one.
    pub(super) fn queue_requests(&mut self, requests: &[CutRequest], at: &mut CutContext<'_>) {
        for request in requests {
            match self.job_of(request, at) {
                Ok(job) => self.waiting.push_back(job),
                Err(reason) => {
                    at.report.cuts.push(CutOutcome { request: request.request, result: Err(reason) });
                }
            }
        }
    }

    /// Queues cuts that blades made by moving, through every body they meet.
    pub(super) fn queue_blades(&mut self, at: &mut CutContext<'_>) {
        for tool in 0..at.tools.len() {
            let Some((blade, incision)) = at.tools.take_sweep(tool, self.least_move_m) else { continue };
            if let Some(job) = self.waiting.iter_mut().rfind(|job| job.incision == incision)
                && job.goes_on_with(&blade)
            {
                job.blade.segments.extend_from_slice(&blade.segments[1..]);
            } else if self.waiting.len() < MAX_WAITING {
                let bodies = (0..at.bodies.len()).rev().collect();
                let job = Job { blade, incision, bodies, begun: false, elements: 0, request: None };
                self.waiting.push_back(job);
            } else if let Some(body) = at.bodies.first() {
                let reason = format!("{MAX_WAITING} cuts are waiting already; move the blade more slowly");
                at.report.tell(Level::Error, "cut-refused", &body.id, reason);
            }
        }
    }

    /// Makes queued cuts, in order, as far as the work of one step goes.
    pub(super) fn work_off(&mut self, at: &mut CutContext<'_>) {
        let mut work = Work::new(WORK_PER_STEP);
        while let Some(mut job) = self.waiting.pop_front() {
            let Some(result) = self.go_on(&mut job, &mut work, at) else {
                self.waiting.push_front(job);
                return;
            };
            if let Some(request) = job.request {
                at.report.cuts.push(CutOutcome { request, result });
            }
        }
    }

    /// Goes on with one cut; its result once it has passed through all bodies.
    fn go_on(
        &mut self,
        job: &mut Job,
        work: &mut Work,
        at: &mut CutContext<'_>,
    ) -> Option<Result<usize, String>> {
        while let Some(&body) = job.bodies.last() {
            if work.is_done() {
                return None;
            }
            match self.go_on_in(body, job, work, at) {
                Ok(None) => return None,
                Ok(Some(report)) => job.elements += report.elements_cut,
                Err(reason) if job.request.is_some() => return Some(Err(reason)),
                Err(reason) => at.report.tell(Level::Error, "cut-refused", &at.bodies[body].id, reason),
            }
            job.bodies.pop();
            job.begun = false;
        }
        Some(Ok(job.elements))
    }

    fn go_on_in(
        &mut self,
        body: usize,
        job: &mut Job,
        work: &mut Work,
        at: &mut CutContext<'_>,
    ) -> Result<Option<CutReport>, String> {
        let cut = &mut at.bodies[body].body;
        if !job.begun {
            if !at.allowed {
                return Err(SWITCHED_OFF.into());
            }
            work.book((cut.n_copies() + cut.n_elements()) / NODES_PER_FRAGMENT);
            self.history.before(body, &at.bodies[body], &job.blade, job.incision);
            let cut = &mut at.bodies[body].body;
            cut.begin_cut(&job.blade, job.incision).map_err(|error| error.to_string())?;
            job.begun = true;
        }
        let before = Before::of(&at.bodies[body]);
        let done = at.bodies[body].body.go_on_cutting(work).map_err(|error| error.to_string())?;
        if let Some(done) = &done {
            self.history.after(body, job.incision, before.epoch, done);
            self.tell(&mut at.bodies[body], &before, (done, job.incision), at.report);
            if job.request.is_some() && done.pending_edges > 0 {
                tell_of_nothing_opened(done, job.incision, &at.bodies[body], at.report);
            }
        }
        Ok(done)
    }

    /// The place in the queue for a request.
    fn job_of(&mut self, request: &CutRequest, at: &mut CutContext<'_>) -> Result<Job, String> {
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
        let bodies = (0..at.bodies.len()).rev().filter(|&body| wanted(&at.bodies[body])).collect();
        Ok(Job { blade, incision, bodies, begun: false, elements: 0, request: Some(request.request) })
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
        at: &mut CutContext<'_>,
    ) -> Result<CutReport, String> {
        if !at.allowed {
            return Err(SWITCHED_OFF.into());
        }
        let index = body;
        let body = &mut at.bodies[index];
        let before = Before::of(body);
        self.history.before(index, body, blade, incision);
        let done = body.body.cut(blade, incision).map_err(|error| error.to_string())?;
        self.history.after(index, incision, before.epoch, &done);
        self.tell(body, &before, (&done, incision), at.report);
        Ok(done)
    }

    /// Tells what a sweep did to a body that was as in `before`.
    fn tell(
        &mut self,
        body: &mut SimBody,
        before: &Before,
        (done, incision): (&CutReport, u32),
        report: &mut StepReport,
    ) {
        body.has_been_swept();
        if done.epoch != before.epoch {
            body.has_changed_topology();
            self.applied += 1;
            let (elements, copies) = (done.elements_cut, done.new_copies.len());
            let elements = if elements == 1 { "1 element".into() } else { format!("{elements} elements") };
            let copies = if copies == 1 { "1 new copy".into() } else { format!("{copies} new copies") };
            let joined = match &done.joined[..] {
                [] => String::new(),
                [one] => format!("; it goes on with incision {one}"),
                several => format!("; it goes on with incisions {}", numbers(several)),
            };
            let closed = if done.pending_edges > 0 { CLOSED } else { "" };
            let message = format!("incision {incision}: {elements}, {copies}{joined}{closed}");
            report.tell(Level::Info, "cut-applied", &body.id, message);
        }
        if done.refused_edges > 0 {
            let edges = done.refused_edges;
            let message = format!(
                "incision {incision}: {edges} edges were not cut, because their elements or the body have too \
                many fragments"
            );
            report.tell(Level::Warning, "cut-incomplete", &body.id, message);
        }
        if let (true, Some(why)) = (before.fitted, body.body.skin().and_then(Skin::misfit)) {
            let message = format!(
                "incision {incision}: skin and wound do not fit, because {why}; the boundary of the elements is \
                 shown until the next reset. Another value of skin.divisions, or skin.snapping = 0, may help"
            );
            report.tell(Level::Warning, "skin-left", &body.id, message);
        }
    }
}

/// A blade that moves along a plane, through `point` [m], past all of the positions `x` [m].
fn across(x: &[Vector3<f64>], point: Vector3<f64>, normal: Unit<Vector3<f64>>) -> BladeSweep {
    let (low, high) = bounds(x);
    let (middle, reach) = ((low + high) / 2.0, (high - low).norm());
    let foot = middle - normal.into_inner() * normal.dot(&(middle - point));
    // The axis that the plane is least inclined to.
    let axis = Vector3::ith(normal.abs().imin(), 1.0);
    let along = normal.cross(&axis).normalize() * reach;
    let across = normal.cross(&along);
    let blade = |at: Vector3<f64>| [at - across, at + across];
    BladeSweep { segments: vec![blade(foot - along), blade(foot + along)] }
}

/// What a cut says that ends inside elements.
const CLOSED: &str = "; the elements that it ends in stay closed until another cut begins at its border";

/// Numbers in a sentence.
fn numbers(numbers: &[u32]) -> String {
    numbers.iter().map(u32::to_string).collect::<Vec<_>>().join(", ")
}

/// Notes that an incision is a part of the same cut as those that it has `joined`.
fn join(swept: &mut [Swept], body: usize, incision: u32, joined: &[u32]) {
    let of_body = |of: &&mut Swept| of.body == body;
    let parts = swept.iter().filter(|of| of.body == body && joined.contains(&of.incision));
    let mut cuts: Vec<u32> = parts.map(|of| of.cut).collect();
    cuts.push(incision);
    let first = cuts.iter().copied().min().unwrap_or(incision);
    swept.iter_mut().filter(of_body).filter(|of| cuts.contains(&of.cut)).for_each(|of| of.cut = first);
}

/// Why a scene refuses cuts.
const SWITCHED_OFF: &str = "cutting is switched off by effects.cutting = false";

/// What is to be compared with after a sweep.
struct Before {
    epoch: u32,
    /// The skin fitted its wounds.
    fitted: bool,
}

impl Before {
    fn of(body: &SimBody) -> Self {
        Self { epoch: body.epoch(), fitted: body.body.skin().is_some_and(Skin::fits) }
    }
}

impl Job {
    /// Whether a blade's further sweep can be added to it.
    fn goes_on_with(&self, blade: &BladeSweep) -> bool {
        let (last, first) = (self.blade.segments.last(), blade.segments.first());
        let room = self.blade.segments.len() + blade.segments.len() <= MAX_SEGMENTS;
        self.request.is_none() && !self.begun && room && last == first
    }
}

/// Warns of a cut that opened nothing, with the reason.
fn tell_of_nothing_opened(done: &CutReport, incision: u32, body: &SimBody, report: &mut StepReport) {
    if done.elements_cut > 0 || done.refused_edges > 0 {
        return;
    }
    let message = if done.pending_edges > 0 {
        let size_mm = 1e3 * body.cell_m();
        format!(
            "incision {incision} is drawn on the surface and opens nothing, because it ends inside the elements \
             it enters; cut deeper than a cell of {size_mm:.1} mm, go on with a cut that begins at its border, or \
             make the elements smaller"
        )
    } else {
        format!("incision {incision} opens nothing: its sweep crosses no edge of an element")
    };
    report.tell(Level::Warning, "cut-opens-nothing", &body.id, message);
}

/// What the estimate of the error does not see: cuts that act on less than their blade swept, because
/// their front is rounded down to whole elements.
pub(crate) fn rounded_fronts(swept: &[Swept], bodies: &[SimBody]) -> Vec<String> {
    let mut doubts = Vec::new();
    let mut cuts: Vec<(usize, u32)> = swept.iter().map(|of| (of.body, of.cut)).collect();
    cuts.sort_unstable();
    cuts.dedup();
    for cut in cuts {
        let parts: Vec<&Swept> = swept.iter().filter(|of| (of.body, of.cut) == cut).collect();
        let body = &bodies[cut.0];
        let area_m2: f64 = parts.iter().map(|of| of.area_m2).sum();
        let opened_m2: f64 = parts.iter().map(|of| body.body.opened_area(of.incision)).sum();
        if opened_m2 < LEAST_OPENED * area_m2 {
            let share = 100.0 * opened_m2 / area_m2;
            let incisions: Vec<u32> = parts.iter().map(|of| of.incision).collect();
            let act = match &incisions[..] {
                [one] => format!("incision {one} acts"),
                several => format!("incisions {} together act", numbers(several)),
            };
            doubts.push(format!(
                "body.{}: {act} on {opened_m2:.3e} of the {area_m2:.3e} m² that the blade swept ({share:.0} %), \
                 because the front is rounded down to whole elements with cells of {:.1} mm; the error estimate \
                 does not include this. Make the elements smaller, or let element faces lie on the front",
                body.id,
                1e3 * body.cell_m()
            ));
        }
    }
    doubts
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::path::Path;

    use crate::inputs::Inputs;
    use crate::report::Level;
    use crate::scene::Scene;
    use crate::simulation::Simulation;

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

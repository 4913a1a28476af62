//! A body of the simulation: its mechanics, and the data that scene and reports attach to it.

mod adaptation;

mod counts;

mod probe;

pub mod region;

mod shown;

pub mod texture;

use std::sync::Arc;

use nalgebra::Vector3;
use scindo_physics::body::estimate::{MeshError, StressRecovery};
use scindo_physics::body::{AdaptReport, Body, BodyError, Notice, Outcome, PointSpring, SolveReport};
use scindo_physics::cut::IncisionMark;

use crate::mesh_in::MeshHealth;
use crate::report::{Energy, StepReport};
use crate::scene::Course;
pub use adaptation::AdaptCounts;
pub(crate) use adaptation::Adaptation;
pub use counts::StepCounts;
use counts::Watch;
pub use probe::Probe;
pub use shown::SurfaceTopology;
pub(crate) use shown::von_mises;
use texture::Texture;

/// A deformable body with its name and its groups of held nodes.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub struct SimBody {
    /// Name in the scene, events and messages.
    pub id: Arc<str>,
    /// Mechanics: mesh, state, material and integrator.
    pub body: Body,
    /// Held nodes, one group per `fix` of the scene, ascending.
    pub fix_groups: Vec<Vec<u32>>,
    /// The same groups before the first cut that changed the mesh.
    fix_groups_uncut: Option<Vec<Vec<u32>>>,
    /// Faults found and repaired in its mesh file. `None` for a body without a file.
    #[serde(skip)]
    pub health: Option<MeshHealth>,
    /// Image on its skin.
    #[serde(skip)]
    pub texture: Option<Arc<Texture>>,
    /// Volume at rest [m³].
    pub rest_volume_m3: f64,
    /// Whether the scene sets a fixed number of iterations and accepts any residual.
    pub fixed_iterations: bool,
    /// Steps that it makes in each step of the world.
    pub(crate) sub_steps: u32,
    /// What share of prescribed displacements is reached when.
    pub displacement: Course,
    /// What share of every force that changes over time acts when, in the order of the scene.
    pub loads: Vec<Course>,
    /// What share of every pressure acts when, in the order of the scene.
    pub pressures: Vec<Course>,
    /// Velocity at the start [m/s].
    pub velocity_m_s: Vector3<f64>,
    /// How its cells are adapted; none: they are not.
    adaptation: Option<Box<Adaptation>>,
    watch: Watch,
    /// The last notice that was reported, so that its kind is not repeated.
    pub(crate) noticed: Option<Notice>,
    recovery: StressRecovery,
    /// What is added to the epoch that others see, so that it rises when an earlier state is restored.
    #[serde(skip)]
    epochs_before: u32,
    #[serde(skip)]
    topology: Option<Arc<SurfaceTopology>>,
    #[serde(skip)]
    surface: Vec<[f32; 3]>,
    #[serde(skip, default = "yes")]
    surface_is_old: bool,
    #[serde(skip)]
    marks: Vec<IncisionMark>,
    #[serde(skip, default = "yes")]
    marks_are_old: bool,
}

fn yes() -> bool {
    true
}

/// Sizes of a body that determine its costs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BodySize {
    /// Elements, or cells of an octree.
    pub elements: usize,
    /// Node copies, including those of mid-edge nodes.
    pub nodes: usize,
    /// Surface vertices.
    pub vertices: usize,
    /// Surface triangles.
    pub triangles: usize,
    /// Most iterations of a linear solve.
    pub iterations: u32,
}

impl SimBody {
    pub(crate) fn new(id: &str, body: Body, health: Option<MeshHealth>) -> Self {
        let rest_volume_m3 = body.rest_volume();
        Self {
            id: id.into(),
            body,
            fix_groups: Vec::new(),
            fix_groups_uncut: None,
            health,
            texture: None,
            rest_volume_m3,
            fixed_iterations: false,
            sub_steps: 1,
            displacement: Course::default(),
            loads: Vec::new(),
            pressures: Vec::new(),
            velocity_m_s: Vector3::zeros(),
            adaptation: None,
            watch: Watch::default(),
            noticed: None,
            recovery: StressRecovery::default(),
            epochs_before: 0,
            topology: None,
            surface: Vec::new(),
            surface_is_old: true,
            marks: Vec::new(),
            marks_are_old: true,
        }
    }

    /// Makes one step of `h` [s] that ends at `time_s` [s], by sub-steps.
    pub(crate) fn step(
        &mut self,
        (time_s, h): (f64, f64),
        gravity_m_s2: Vector3<f64>,
        springs: &[PointSpring],
    ) -> SolveReport {
        let mut whole: Option<SolveReport> = None;
        for (end_s, h) in sub_steps(self.sub_steps, time_s, h) {
            self.prescribe(end_s);
            let part = self.body.step(h, gravity_m_s2, springs);
            whole = Some(whole.map_or(part, |whole| whole.then(&part)));
            if part.outcome != Outcome::Advanced {
                break;
            }
        }
        self.as_it_ended(whole.unwrap_or_default())
    }

    /// Sets prescribed displacements and loads to those of a step that ends at `time_s` [s].
    pub(crate) fn prescribe(&mut self, time_s: f64) {
        self.body.set_prescribed_share(self.displacement.share(time_s));
        self.body.set_load_shares(self.loads.iter().map(|load| load.share(time_s)));
        self.body.set_pressure_shares(self.pressures.iter().map(|load| load.share(time_s)));
    }

    /// Forces that hold the places of every `fix` of the scene [N].
    pub(crate) fn reactions(&self, gravity_m_s2: Vector3<f64>) -> Vec<Vector3<f64>> {
        self.body.reactions(self.fix_groups.iter().map(Vec::as_slice), gravity_m_s2)
    }

    /// From when on displacements and loads no longer change [s].
    pub(crate) fn settled_s(&self) -> f64 {
        self.loads.iter().chain(&self.pressures).map(Course::end_s).fold(self.displacement.end_s(), f64::max)
    }

    /// Gives all nodes that nothing holds the velocity of the start.
    ///
    /// # Errors
    /// A velocity out of range.
    pub(crate) fn throw(&mut self) -> Result<(), BodyError> {
        if self.velocity_m_s == Vector3::zeros() {
            return Ok(());
        }
        let x = self.body.positions().to_vec();
        let mut v = vec![self.velocity_m_s; x.len()];
        for &node in self.fix_groups.iter().flatten() {
            v[node as usize] = Vector3::zeros();
        }
        self.body.set_state(&x, &v)
    }

    /// Lets the cells be adapted between steps.
    pub(crate) fn set_adaptation(&mut self, adaptation: Adaptation) {
        self.adaptation = Some(Box::new(adaptation));
    }

    /// How the cells are adapted; none: they are not.
    pub(crate) fn adaptation(&self) -> Option<&Adaptation> {
        self.adaptation.as_deref()
    }

    /// Adapts the cells before step number `step`, with tools at these places [m].
    ///
    /// # Errors
    /// As [`Body::adapt`].
    pub(crate) fn adapt(&mut self, step: u64, tools: &[Vector3<f64>]) -> Result<AdaptReport, BodyError> {
        let Some(adaptation) = &mut self.adaptation else { return Ok(AdaptReport::default()) };
        let report = adaptation.adapt(&mut self.body, step, tools)?;
        if report.has_changed() {
            self.has_changed_topology();
        }
        Ok(report)
    }

    /// What adaptations of the cells did since the start or the last reset; none: they are not adapted.
    pub fn adapt_counts(&self) -> Option<AdaptCounts> {
        self.adaptation.as_ref().map(|adaptation| adaptation.counts)
    }

    /// Topology epoch. It rises with every cut that changed something, with every adaptation of the
    /// cells, and with every reset.
    pub fn epoch(&self) -> u32 {
        self.body.epoch()
    }

    /// The epoch that viewers and clients see: it rises with the epoch, and whenever an earlier state is restored.
    pub fn shown_epoch(&self) -> u32 {
        self.body.epoch().wrapping_add(self.epochs_before)
    }

    /// Lets the epoch that others see go on after that of `other`, in whose place this body steps.
    pub(crate) fn follow_epoch_of(&mut self, other: &Self) {
        self.epochs_before = other.shown_epoch().wrapping_add(1).wrapping_sub(self.body.epoch());
    }

    /// The sizes that determine its costs.
    pub fn size(&self) -> BodySize {
        let surface = self.body.surface();
        BodySize {
            elements: self.body.n_elements(),
            nodes: self.body.rest_positions().len(),
            vertices: surface.vertices.len(),
            triangles: surface.triangles.len(),
            iterations: self.body.settings().solver.iterations,
        }
    }

    /// Edge [m] of a lattice cell filled by six tetrahedra of mean volume, or by one hexahedron; that of the
    /// finest cells of an octree.
    pub fn cell_m(&self) -> f64 {
        self.body.element_size()
    }

    /// Corners of the box around the body in its present state [m].
    pub fn corners_m(&self) -> [[f64; 3]; 2] {
        let (low, high) = bounds(self.body.positions());
        [low.into(), high.into()]
    }

    /// Nodes of parts that something holds. Other parts fall without end, or sleep.
    pub fn held_nodes(&self) -> impl Iterator<Item = usize> + '_ {
        let (parts, sleeps) = (self.body.parts(), self.body.sleeps());
        let is_held = |part: Option<&u32>| part.is_none_or(|&part| !parts.free[part as usize]);
        (0..self.body.positions().len()).filter(move |&node| {
            is_held(parts.of_copy.get(node)) && !(sleeps && self.body.is_asleep(node as u32))
        })
    }

    /// Largest present displacement of a node in the parts that are held [m]; of any node, if nothing is
    /// held.
    pub fn displacement_m(&self) -> f64 {
        let (x, rest) = (self.body.positions(), self.body.rest_positions());
        let farthest = |nodes: &mut dyn Iterator<Item = usize>| {
            nodes.map(|node| (x[node] - rest[node]).norm_squared()).fold(0.0, f64::max).sqrt()
        };
        if self.body.parts().free.contains(&false) {
            farthest(&mut self.held_nodes())
        } else {
            farthest(&mut (0..x.len()))
        }
    }

    /// Surface positions [m]. They are recomputed at the first call after a motion.
    pub fn surface_positions(&mut self) -> &[[f32; 3]] {
        if self.surface_is_old {
            self.body.surface_positions(&mut self.surface);
            self.surface_is_old = false;
        }
        &self.surface
    }

    /// Surface positions [m], recomputed if out of date, together with the body.
    pub(crate) fn surface_now(&mut self) -> (&Body, &[[f32; 3]]) {
        self.surface_positions();
        (&self.body, &self.surface)
    }

    /// Writes the surface velocities [m/s] into `out`.
    pub fn surface_velocities(&self, out: &mut Vec<[f32; 3]>) {
        let v = self.body.velocities();
        out.clear();
        out.extend(self.body.surface().vertices.iter().map(|vertex| {
            let v = vertex.position(v);
            [v.x as f32, v.y as f32, v.z as f32]
        }));
    }

    /// Writes the von Mises stress on the surface [Pa] into `out`.
    pub fn surface_stress(&self, out: &mut Vec<f32>) {
        shown::surface_stress(&self.body, out);
    }

    /// Lines that incisions have drawn on the surface without opening it: writes their ends [m] into `out`.
    pub fn incision_marks(&mut self, out: &mut Vec<[[f32; 3]; 2]>) {
        if self.marks_are_old {
            self.marks = self.body.incision_marks();
            self.marks_are_old = false;
        }
        let x = self.body.positions();
        out.clear();
        out.extend(
            self.marks.iter().map(|mark| mark.ends.map(|end| end.position(x).map(|c| c as f32).into())),
        );
    }

    /// Counts of troubles in the steps since the start or the last reset.
    pub fn counts(&self) -> StepCounts {
        self.watch.counts
    }

    /// One line for each kind of trouble since the start or the last reset, with a remedy.
    pub fn troubles(&self) -> Vec<String> {
        self.watch.warnings(&self.id, &self.body, self.fixed_iterations)
    }

    /// Why the run counts as failed, if it does. Reasons are steps that were refused or rolled back, more
    /// than half of the steps above their tolerance, and an equilibrium that was not reached. A fixed number
    /// of iterations set by the scene excuses the last two.
    pub fn failure(&self) -> Option<String> {
        self.watch.failure(&self.id, &self.body, self.fixed_iterations)
    }

    /// The report without elements that were inverted only at the predictor, e.g. where a held place moves
    /// far in one step. Only the end of the step counts.
    pub(crate) fn as_it_ended(&self, solve: SolveReport) -> SolveReport {
        if solve.inverted_pieces == 0 || self.body.least_volume_ratio() <= 0.0 {
            return solve;
        }
        SolveReport { inverted_pieces: 0, ..solve }
    }

    /// Records the outcome of a step.
    pub(crate) fn has_stepped(&mut self, solve: &SolveReport, report: &mut StepReport) {
        self.has_moved();
        self.watch.follow(&self.id, solve, self.fixed_iterations, report);
        report.tell_of_solve(&self.id, solve, &mut self.noticed);
    }

    /// Forgets all troubles after a reset.
    pub(crate) fn has_been_reset(&mut self) {
        self.watch = Watch::default();
        if let Some(adaptation) = &mut self.adaptation {
            adaptation.counts = AdaptCounts::default();
        }
    }

    /// Present kinetic and elastic energy.
    pub fn energy(&self) -> Energy {
        Energy { kinetic_j: self.body.kinetic_energy(), elastic_j: self.body.elastic_energy() }
    }

    /// Estimate of the discretisation error. `None` for elements other than tet4.
    pub fn mesh_error(&mut self) -> Option<MeshError> {
        self.body.mesh_error(&mut self.recovery)
    }

    /// Must be called whenever the body moved.
    fn has_moved(&mut self) {
        self.surface_is_old = true;
    }

    /// Must be called whenever a blade passed through the body, even if it opened nothing.
    pub(crate) fn has_been_swept(&mut self) {
        self.marks_are_old = true;
    }

    /// Must be called whenever the body was cut, adapted or reset.
    pub(crate) fn has_changed_topology(&mut self) {
        self.topology = None;
        self.surface_is_old = true;
        self.marks_are_old = true;
        self.follow_nodes();
    }

    /// Updates the groups of held nodes after a cut that changed the mesh: a duplicate belongs to the groups
    /// of its node. An adaptation adds and removes nodes, so there the region decides.
    fn follow_nodes(&mut self) {
        if let Some(adaptation) = &self.adaptation {
            self.fix_groups.clear();
            self.fix_groups.extend(adaptation.held_nodes(&self.body));
        }
        let Some(origins) = self.body.node_origins() else { return };
        let uncut = self.fix_groups_uncut.get_or_insert_with(|| self.fix_groups.clone());
        for (now, uncut) in self.fix_groups.iter_mut().zip(uncut) {
            let from_group = |(_, origin): &(u32, &u32)| uncut.binary_search(origin).is_ok();
            *now = (0u32..).zip(origins).filter(from_group).map(|(node, _)| node).collect();
        }
    }

    /// Triangles of the present epoch, computed at the first call in an epoch.
    pub fn topology(&mut self) -> Arc<SurfaceTopology> {
        let (body, epoch) = (&self.body, self.shown_epoch());
        let topology = || Arc::new(SurfaceTopology { epoch, ..shown::topology(body) });
        self.topology.get_or_insert_with(topology).clone()
    }
}

/// When each of `parts` equal parts of a step of `h` [s] ends that ends at `time_s` [s], and how long it is [s].
fn sub_steps(parts: u32, time_s: f64, h: f64) -> impl Iterator<Item = (f64, f64)> {
    let part_s = h / f64::from(parts);
    (0..parts).rev().map(move |left| (time_s - f64::from(left) * part_s, part_s))
}

/// Corners of the box around some points [m].
pub(crate) fn bounds<'a>(points: impl IntoIterator<Item = &'a Vector3<f64>>) -> (Vector3<f64>, Vector3<f64>) {
    let none = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
    points.into_iter().fold(none, |(low, high), point| (low.inf(point), high.sup(point)))
}

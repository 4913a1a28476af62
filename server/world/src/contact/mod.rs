//! Contact of tools and bodies in a step: surfaces, proxies, springs, reactions.
//!
//! # Order in a step
//! 1. After all cuts, [`Contacts::watch`] finds which bodies can meet anything, and [`Contacts::update_surface`]
//!    gives each of them its present surface.
//! 2. [`Contacts::detect`]: proxies move, and touched points become springs.
//! 3. Per body, the integrator's solve with [`Contacts::springs`].
//! 4. Per body, [`Contacts::collect`] with the force of every spring from that solve.
//! 5. [`Contacts::react`]: each tool receives exactly minus the sum of its springs' forces, and [jaws] yield or close.
//!
//! Tissue force and reaction come from the same solve and therefore balance to rounding. Nothing here
//! allocates while topologies and tools stay the same.

pub mod model;
pub mod surface;
pub mod proxy;
pub mod rings;
pub mod press;
pub mod rub;
pub mod spring;
pub mod grab;
pub mod jaws;
pub mod compliance;
pub mod edge;
mod scalpel;
pub mod hand;
pub mod rest;
pub mod pairs;
pub mod forces;

use nalgebra::{Isometry3, Translation3, Vector3};
use scindo_collision::{Method, SurfaceError};
use scindo_physics::body::{PointSpring, SpringKind};
use scindo_physics::cut::Surface;
use scindo_physics::element::MaterialPoint;

use crate::body::SimBody;
use crate::inputs::{MAX_TOOLS, ToolMode};
use crate::tool::compound::MAX_PARTS;
use crate::tool::geometry::core_radius;
use crate::tool::obstacle::Obstacle;
use crate::tool::{Tool, Tools};
use hand::Hand;
use pairs::{PairContacts, TouchSettings};
use press::{Bearing, Press};
use rest::{RestReport, Resting};
use rings::MAX_POINTS;
use rub::Roughness;
use spring::material_points;
use surface::ContactSurface;

/// Springs for which memory is reserved per body: every tool with all its points, three springs each.
const SPRING_CAPACITY: usize = MAX_TOOLS * MAX_POINTS * 3;

/// Springs on one body, and the tools they belong to.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
struct BodyContacts {
    young_pa: f64,
    /// b = β/h: viscosity over the length of a step.
    viscous: f64,
    vertices: Vec<MaterialPoint>,
    springs: Vec<PointSpring>,
    /// What is behind every spring of a tool. The springs of obstacles come after these.
    behind: Vec<Behind>,
    /// Contacts with obstacles.
    resting: Resting,
}

/// What is behind a spring.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
struct Behind {
    tool: u32,
    /// Number of the capsule of a compound tool; 0 for others.
    limb: u8,
    /// Depth before the solve [m].
    depth_m: f64,
    /// Point of the stencil with which the tool rubs; `None` without friction.
    rubs: Option<u8>,
}

/// Sums over one tool's springs.
#[derive(Debug, Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
struct Sums {
    force: Vector3<f64>,
    /// Its part on each capsule of a compound tool.
    limbs: [Vector3<f64>; MAX_PARTS],
    normal_force: f64,
    /// Stiffness times depth before and after [N], and stiffness [N/m].
    before: f64,
    after: f64,
    stiffness: f64,
}

/// All contacts between tools and bodies in a step.
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub struct Contacts {
    broad_phase: Method,
    surfaces: Vec<ContactSurface>,
    bodies: Vec<BodyContacts>,
    /// One hand per tool, in the order of the tools.
    hands: Vec<Hand>,
    sums: Vec<Sums>,
    #[serde(skip)]
    obstacles: Vec<Obstacle>,
    /// How bodies touch bodies; `None` if they do not.
    touch: Option<TouchSettings>,
    /// Toughness of every body [J/m²]; empty: blades cut without force.
    toughness: Vec<f64>,
    pairs: PairContacts,
    ablation: ContactAblation,
}

/// Parts of contact that are taken out, for a check that their lack is noticed.
#[doc(hidden)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct ContactAblation {
    /// A body meets all of its triangles, also those that its vertices are joined to and those that do not face them.
    pub exclusion: bool,
    /// Tools jump from pose to pose instead of sweeping the way between them.
    pub continuous: bool,
}

impl Contacts {
    /// Contacts without bodies, which find triangles by `broad_phase`.
    pub fn new(broad_phase: Method) -> Self {
        Self { broad_phase, ..Self::default() }
    }

    /// Lets bodies touch each other, themselves, or both.
    pub fn set_touch(&mut self, touch: Option<TouchSettings>) {
        self.touch = touch;
    }

    /// Lets blades press on bodies of these toughnesses [J/m²] until these give way.
    pub fn set_toughness(&mut self, toughness: Vec<f64>) {
        self.toughness = toughness;
    }

    /// Presses the edges of cutting blades on what they meet, after [`detect`](Self::detect).
    pub fn press_edges(&mut self, tools: &Tools, solids: &mut [SimBody]) {
        if self.toughness.is_empty() {
            return;
        }
        let Self { surfaces, bodies, hands, toughness, .. } = self;
        for ((index, tool), hand) in (0u32..).zip(tools.iter()).zip(hands) {
            if !tool.cuts() {
                hand.edge = None;
                continue;
            }
            let edge = hand.edge.get_or_insert_default();
            edge.follow(tool, surfaces, solids, toughness, |body, spring| {
                bodies[body].springs.push(spring);
                bodies[body].behind.push(Behind { tool: index, limb: 0, depth_m: 0.0, rubs: None });
            });
        }
    }

    /// Lets the edges go on where they were pressed enough, after the solve of a step.
    pub fn settle_edges(&mut self, tools: &mut Tools, solids: &[SimBody]) {
        if self.toughness.is_empty() {
            return;
        }
        for (tool, hand) in tools.iter_mut().zip(&mut self.hands) {
            let Some(edge) = &mut hand.edge else { continue };
            edge.settle(solids, &mut tool.pressed);
            if let Some(line) = tool.pressed.at() {
                let tip = Translation3::from(line[0]);
                hand.seat(&Isometry3::from_parts(tip, tool.pose.rotation));
            }
        }
    }

    /// Lets scalpels cut the skin that they are drawn over as deep as they are pressed, after the reactions of a step.
    pub fn draw_scalpels(&self, tools: &mut Tools) {
        for (tool, hand) in tools.iter_mut().zip(&self.hands) {
            if tool.mode != ToolMode::Scalpel {
                continue;
            }
            let toughness = |body: usize| self.toughness.get(body).copied().unwrap_or(0.0);
            match scalpel::segment(tool, hand.press(), toughness) {
                Some(edge) => tool.pressed.draw(edge),
                None => tool.pressed.leave(),
            }
        }
    }

    /// Takes parts of contact out.
    #[doc(hidden)]
    pub fn ablate(&mut self, ablation: ContactAblation) {
        self.ablation = ablation;
        self.pairs.meet_the_joined(ablation.exclusion);
    }

    /// Whether bodies touch bodies.
    pub fn bodies_touch(&self) -> bool {
        self.touch.is_some()
    }

    /// Whether the surface of `body` is where an earlier step left it.
    #[cfg(test)]
    pub(crate) fn is_left(&self, body: usize) -> bool {
        self.surfaces[body].is_old()
    }

    /// Finds which bodies may meet others or themselves in a step of `h` seconds.
    pub fn watch(&mut self, bodies: &[SimBody], h: f64) {
        if let Some(touch) = self.touch {
            self.pairs.watch(bodies, (h, touch));
        }
    }

    /// Whether the surface of `body` is to be updated: a tool may meet it, or it may meet another body or itself, and
    /// it has moved since its last update. A surface that nothing can meet is left where it is.
    pub fn needs_surface(&mut self, body: usize, (tools, sleeps): (bool, bool)) -> bool {
        let is_met = tools || self.touch.is_some() && self.pairs.may_meet(body);
        let surface = &mut self.surfaces[body];
        if !is_met && !sleeps {
            surface.leave();
        }
        is_met && (!sleeps || surface.is_old())
    }

    /// Contacts of bodies with each other and with themselves.
    pub fn pairs(&self) -> &PairContacts {
        &self.pairs
    }

    /// The same, to hand over the forces of a solve.
    pub fn pairs_mut(&mut self) -> &mut PairContacts {
        &mut self.pairs
    }

    /// Finds what bodies may meet of each other and of themselves in a step of `h` seconds.
    /// Bodies that sleep, if `asleep` names any, stay as they are with each other.
    pub fn meet(&mut self, bodies: &[SimBody], asleep: &[bool], h: f64) {
        let Some(touch) = self.touch else { return };
        let Self { pairs, surfaces, bodies: own, .. } = self;
        pairs.detect((bodies, asleep), surfaces, |i| own[i].young_pa, (h, touch));
    }

    /// Evaluates what bodies did to each other in the last step.
    pub fn settle_pairs(&mut self, bodies: &[SimBody], asleep: &[bool]) {
        if self.touch.is_some() {
            self.pairs.settle(bodies, asleep);
        }
    }

    /// Puts up the obstacles of the scene.
    pub fn set_obstacles(&mut self, obstacles: Vec<Obstacle>) {
        self.obstacles = obstacles;
    }

    /// Takes over the obstacles of `other`, which belongs to the same scene.
    pub(crate) fn take_obstacles_of(&mut self, other: &mut Self) {
        self.obstacles = std::mem::take(&mut other.obstacles);
    }

    /// The obstacles of the scene.
    pub fn obstacles(&self) -> &[Obstacle] {
        &self.obstacles
    }

    /// Contact of `body` with all obstacles in the last step.
    pub fn rest_report(&self, body: usize) -> &RestReport {
        &self.bodies[body].resting.report
    }

    /// The same with each obstacle; empty before the first step.
    pub fn rest_reports(&self, body: usize) -> &[RestReport] {
        &self.bodies[body].resting.each
    }

    /// Adds the springs of what a body may meet of the obstacles in a step of `h` seconds under `gravity` [m/s²],
    /// after [`detect`](Self::detect).
    pub fn rest(&mut self, number: usize, body: &SimBody, h: f64, gravity: Vector3<f64>) {
        if self.obstacles.is_empty() {
            return;
        }
        let contacts = &mut self.bodies[number];
        let size = (contacts.young_pa, body.cell_m());
        contacts.resting.detect((&body.body, &self.obstacles), (h, gravity), size);
        contacts.springs.extend_from_slice(contacts.resting.springs());
    }

    /// Registers the next body, in the order of the scene. `young_pa` is its Young's modulus [Pa], and `on`
    /// whether tools touch it.
    pub fn add_body(&mut self, young_pa: f64, on: bool) {
        let mut surface = ContactSurface::new(self.broad_phase);
        surface.switch(on);
        self.surfaces.push(surface);
        self.bodies.push(BodyContacts {
            young_pa,
            viscous: 0.0,
            vertices: Vec::new(),
            springs: Vec::with_capacity(SPRING_CAPACITY),
            behind: Vec::with_capacity(SPRING_CAPACITY),
            resting: Resting::default(),
        });
        self.hands.reserve(MAX_TOOLS);
        self.sums.reserve(MAX_TOOLS);
    }

    /// Young's modulus of `body` [Pa].
    pub fn young_pa(&self, body: usize) -> f64 {
        self.bodies[body].young_pa
    }

    /// Sets b = β/h of `body`: its viscosity over the length of a step. The hands discard the compliance they have
    /// learned.
    pub fn set_viscosity(&mut self, body: usize, viscous: f64) {
        self.bodies[body].viscous = viscous;
        self.hands.iter_mut().for_each(Hand::forget_compliance);
    }

    /// Changes the Young's modulus of `body` [Pa]. The hands discard the compliance they have learned.
    pub fn set_stiffness(&mut self, body: usize, young_pa: f64) {
        self.bodies[body].young_pa = young_pa;
        self.hands.iter_mut().for_each(Hand::forget_compliance);
    }

    /// Takes over the present surface of `body`, and its topology if the epoch changed.
    ///
    /// # Errors
    /// If surface and positions do not belong together.
    pub fn update_surface(
        &mut self,
        body: usize,
        epoch: u32,
        (surface, rest): (&Surface, &[Vector3<f64>]),
        positions: &[[f32; 3]],
    ) -> Result<(), SurfaceError> {
        if self.surfaces[body].update(epoch, &surface.triangles, positions)? {
            self.bodies[body].vertices.clone_from(&surface.vertices);
            if self.touch.is_some() {
                let place = |v: u32| surface.vertices[v as usize].position(rest);
                self.surfaces[body].measure(surface, place);
            }
        }
        Ok(())
    }

    /// Whether a tool or an edge acts on `body` in this step.
    pub fn is_touched(&self, body: usize) -> bool {
        !self.bodies[body].behind.is_empty()
    }

    /// Forgets the last motion of `body`, e.g. after a reset.
    pub fn forget_motion(&mut self, body: usize) {
        self.surfaces[body].forget_motion();
    }

    /// Returns to the start of the scene: nothing is touched or held, and no compliance is learned.
    pub fn reset(&mut self, tools: &Tools) {
        self.keep_up_with(tools);
        for (hand, tool) in self.hands.iter_mut().zip(tools.iter()) {
            hand.let_go(&tool.pose);
            hand.forget_compliance();
        }
        self.bodies.iter_mut().for_each(|body| body.resting.forget());
        self.pairs.forget();
    }

    /// The hand on tool number `index`; `None` before the first [`detect`](Self::detect) with it.
    pub fn hand(&self, index: usize) -> Option<&Hand> {
        self.hands.get(index)
    }

    /// Moves every proxy, and converts what is touched or held to springs for a step of `h` seconds.
    pub fn detect(&mut self, tools: &Tools, h: f64) {
        for body in &mut self.bodies {
            body.springs.clear();
            body.behind.clear();
        }
        self.keep_up_with(tools);
        let Self { surfaces, bodies, hands, .. } = self;
        for ((index, tool), hand) in (0u32..).zip(tools.iter()).zip(hands) {
            if self.ablation.continuous {
                hand.jump(&tool.pose);
            }
            hand.follow(tool, surfaces, h);
            press(index, tool, hand, surfaces, bodies);
            pull(index, tool, hand, surfaces, bodies);
            if let Some(jaws) = &mut hand.jaws {
                jaws.squeeze(index, tool, surfaces, bodies);
            }
        }
    }

    /// Keeps one hand per tool. Hands of removed tools are dropped, those of new tools appended.
    fn keep_up_with(&mut self, tools: &Tools) {
        let mut left = tools.iter().peekable();
        self.hands.retain(|hand| left.next_if(|tool| hand.is_on(tool)).is_some());
        self.hands.extend(left.map(Hand::new));
    }

    /// Springs on `body` for the solve of this step.
    pub fn springs(&self, body: usize) -> &[PointSpring] {
        &self.bodies[body].springs
    }

    /// Records what the last step of a body did on the obstacles.
    pub fn settle(&mut self, number: usize, body: &SimBody) {
        if self.obstacles.is_empty() {
            return;
        }
        let contacts = &mut self.bodies[number];
        let forces = body.body.spring_forces().get(contacts.behind.len()..).unwrap_or_default();
        contacts.resting.collect(&body.body, forces, body.cell_m());
    }

    /// Records the force of each spring of a tool on `body` from the solve [N]; springs of obstacles come after
    /// them.
    pub fn collect(&mut self, body: usize, forces: &[Vector3<f64>]) {
        self.hands
            .iter_mut()
            .filter_map(|hand| hand.jaws.as_mut())
            .for_each(|jaws| jaws.collect(body, forces));
        let body = &self.bodies[body];
        for ((spring, of), force) in body.springs.iter().zip(&body.behind).zip(forces) {
            let tool = of.tool as usize;
            if self.sums.len() <= tool {
                self.sums.resize(tool + 1, Sums::default());
            }
            let sums = &mut self.sums[tool];
            sums.force += force;
            sums.limbs[usize::from(of.limb)] += force;
            let normal = match (spring.kind, of.rubs) {
                (SpringKind::OneSided { normal, .. }, _) => Some(normal),
                (SpringKind::Rough { normal, .. }, Some(point)) => {
                    self.hands[tool].rub_mut(of.limb).add(point, force, &normal, spring.stiffness_n_m);
                    Some(normal)
                }
                _ => None,
            };
            if let Some(normal) = normal {
                let along = force.dot(&normal);
                sums.normal_force += along;
                sums.before += spring.stiffness_n_m * of.depth_m;
                sums.after += along;
                sums.stiffness += spring.stiffness_n_m;
            }
        }
    }

    /// Gives every tool the reaction to the forces its springs have exerted since the last call.
    pub fn react(&mut self, tools: &mut Tools) {
        self.sums.resize(tools.len(), Sums::default());
        for ((tool, hand), sums) in tools.iter_mut().zip(&mut self.hands).zip(&self.sums) {
            tool.force_n = -sums.force;
            hand.feel(&sums.limbs);
            if tool.friction > 0.0 {
                tool.friction_n = hand.settle_rub(tool.friction);
            }
            if let Some(jaws) = &mut hand.jaws {
                jaws.settle(tool);
            }
            let Some(compliance) = hand.compliance() else { continue };
            if sums.stiffness > 0.0 && sums.normal_force < 0.95 * tool.max_force_n {
                let (before, after) = (sums.before / sums.stiffness, sums.after / sums.stiffness);
                let normal = (tool.force_n - tool.friction_n).try_normalize(1e-9).unwrap_or_else(Vector3::z);
                let place = (tool.pose.translation.vector, normal);
                compliance.learn([before, after], sums.normal_force, place);
            } else {
                compliance.release();
            }
        }
        self.sums.clear();
    }
}

/// Adds the one-sided springs of a tool that presses. The capsules of a compound share its stiffness and largest force.
fn press(index: u32, tool: &Tool, hand: &mut Hand, surfaces: &[ContactSurface], bodies: &mut [BodyContacts]) {
    let spring = (tool.stiffness_n_m, tool.max_force_n);
    if let Some(body) = hand.press().bearings().first().map(|bearing| bearing.body) {
        let of = &bodies[body];
        hand.meet(body, (of.young_pa, of.viscous), core_radius(tool.shape));
    }
    bear((index, 0), (spring, tool.friction), hand.press(), surfaces, bodies);
    let each = 1.0 / hand.limbs().len().max(1) as f64;
    for (number, limb) in (0u8..).zip(hand.limbs()) {
        let spring = (spring.0 * each, spring.1 * each);
        bear((index, number), (spring, tool.friction), limb, surfaces, bodies);
    }
}

/// Adds springs of this stiffness [N/m], largest force [N] and friction where a capsule of a tool bears on tissue.
fn bear(
    of: (u32, u8),
    (spring, friction): ((f64, f64), f64),
    press: &Press,
    surfaces: &[ContactSurface],
    bodies: &mut [BodyContacts],
) {
    let Some(normal) = press.normal() else { return };
    for bearing in press.bearings() {
        let body = &mut bodies[bearing.body];
        let Some(tree) = surfaces[bearing.body].tree() else { continue };
        let place = (tree.corners(bearing.triangle), tree.triangle(bearing.triangle));
        // The spring pushes from the tool into the tissue.
        let rough = (friction > 0.0).then(|| press.rub().roughness(friction, bearing.number));
        body.press(of, (spring, rough), -normal, bearing, place);
    }
}

/// Adds the three-axis springs of a tool that holds tissue.
fn pull(index: u32, tool: &Tool, hand: &Hand, surfaces: &[ContactSurface], bodies: &mut [BodyContacts]) {
    let (body, held) = hand.grip().held();
    if held.is_empty() {
        return;
    }
    let Some(tree) = surfaces[body].tree() else { return };
    let body = &mut bodies[body];
    let each = 1.0 / held.len() as f64;
    for point in held {
        let corners = tree.corners(point.triangle).map(|v| v as usize);
        let places = tree.triangle(point.triangle);
        let target = (tool.pose * point.in_tool).coords;
        let pulled = target - point.point;
        let (springs, behind) = (&mut body.springs, &mut body.behind);
        material_points(corners.map(|v| &body.vertices[v]), point.barycentric, |vertex, share| {
            // A corner that represents the point is pulled by the same displacement.
            let at = if share == 1.0 {
                point.point
            } else {
                places[corner_of(&vertex, corners.map(|v| &body.vertices[v]))]
            };
            springs.push(PointSpring {
                point: vertex,
                kind: SpringKind::Hold { target_m: at + pulled },
                stiffness_n_m: tool.stiffness_n_m * each * share,
                max_force_n: tool.max_force_n * each * share,
            });
            behind.push(Behind { tool: index, limb: 0, depth_m: 0.0, rubs: None });
        });
    }
}

impl BodyContacts {
    fn press(
        &mut self,
        (tool, limb): (u32, u8),
        ((stiffness, max_force), rough): ((f64, f64), Option<Roughness>),
        normal: Vector3<f64>,
        bearing: &Bearing,
        (corners, triangle): ([u32; 3], [Vector3<f64>; 3]),
    ) {
        let corners = corners.map(|v| &self.vertices[v as usize]);
        let (springs, behind) = (&mut self.springs, &mut self.behind);
        material_points(corners, bearing.barycentric, |vertex, share| {
            let at = if share == 1.0 { bearing.point } else { triangle[corner_of(&vertex, corners)] };
            let share = share * bearing.share;
            let offset_m = bearing.depth + normal.dot(&at);
            let kind = match rough {
                None => SpringKind::OneSided { normal, offset_m },
                Some(rough) => SpringKind::Rough {
                    normal,
                    offset_m,
                    anchor_m: at + rough.stretch_m,
                    friction: rough.friction,
                    tangential_n_m: stiffness * share,
                    grip_n: rough.grip_n * share,
                },
            };
            springs.push(PointSpring {
                point: vertex,
                kind,
                stiffness_n_m: stiffness * share,
                max_force_n: max_force * share,
            });
            behind.push(Behind { tool, limb, depth_m: bearing.depth, rubs: rough.map(|rough| rough.point) });
        });
    }
}

/// Index of the corner that a material point is.
fn corner_of(vertex: &MaterialPoint, corners: [&MaterialPoint; 3]) -> usize {
    corners.iter().position(|corner| *corner == vertex).unwrap_or(0)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod press_tests;

//! The local contact model. The contact thread computes it from the newest snapshot and the newest pose of a
//! tool, at 200 Hz or more, independent of the step rate.
//!
//! # Order on the contact thread
//! 1. [`ContactModels::take`] for every new snapshot: copies its surfaces and refits its own trees.
//! 2. [`ContactModels::evaluate`] for every held tool with its newest pose. The result is sent as it is.
//!
//! # Force
//! One plane represents the contact, and one each capsule of a compound tool. Its normal n is the line from device to
//! proxy at the newest pose. More planes beside it hold a tool in a groove, and end the tissue at an edge
//! ([`neighbours`]). The last solve gave the force f₀ for the pose p₀. A change of pose is answered by hand and tissue
//! in series, k_s:
//!
//! f = f₀·n + k_s (p₀ − p)·n, and k_s d at the depth d behind the surface if there was no force.
//!
//! Between snapshots the surface is extrapolated with the velocity it has without the tool: its own minus
//! what the tool imparts, v_tool (1 − k_s / k) along the normal. A model replaces the one before without a
//! step in force ([`continuity`]).

pub mod plane;
pub mod answer;
pub mod continuity;
pub mod neighbours;

use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};
use smallvec::SmallVec;

use crate::contact::press::{Nearest, followed_direction, nearest, push_direction, touch_margin, touched};
use crate::contact::proxy::Proxy;
use crate::contact::surface::ContactSurface;
use crate::inputs::{ToolMode, ToolShape};
use crate::snapshot::{LimbSnapshot, Snapshot, ToolSnapshot};
use crate::tool::compound::MAX_PARTS;
use crate::tool::geometry::{capsule, is_sane};
use answer::{Answer, Tissue};
use continuity::{FeatureNumbers, limit_step};
use neighbours::{Poses, Pushed};
pub use plane::{BLEND_FEATURE, ContactMode, ContactPlane, LocalContact};
use scindo_collision::Capsule;

/// Largest rate at which force may change from model to model beyond what the planes predict [N/s].
const SLEW_N_S: f64 = 50.0;
/// Longest time between two models for which the slew limit is scaled [s].
const LONGEST_TICK_S: f64 = 0.01;
/// Longest extrapolation of a surface after its snapshot, in intervals between snapshots.
const HORIZON: f64 = 1.5;
/// Bounds of that interval [s].
const INTERVAL_S: (f64, f64) = (1e-3, 0.1);
/// Bounds of the time for which a model is valid [s].
const VALIDITY_S: (f64, f64) = (0.03, 0.2);
/// Planes are sent this long before the tool reaches them [s], and at least within this distance [m]. It covers
/// the delay at which a client still renders force well.
const AHEAD_S: f64 = 0.15;
const LEAST_AHEAD_M: f64 = 0.002;
const MOST_AHEAD_M: f64 = 0.02;
/// Damping per stiffness [s], and its bound [N·s/m], which is well below what desktop devices absorb.
const DAMPING_S: f64 = 1e-3;
const MAX_DAMPING_NS_M: f64 = 2.0;
/// Least radius around their point within which planes are trusted [m].
const LEAST_PATCH_M: f64 = 0.003;

/// Newest state of a tool, as the contact thread received it.
#[derive(Debug, Clone)]
pub struct ToolQuery {
    /// Name of the tool.
    pub id: Arc<str>,
    /// Shape and dimensions.
    pub shape: ToolShape,
    /// Tool axes to world axes; the translation is the tip [m].
    pub pose: Isometry3<f64>,
    /// Velocity of the tip [m/s].
    pub velocity_m_s: Vector3<f64>,
    /// Touch, grab, cut or hover.
    pub mode: ToolMode,
}

/// Surfaces of the newest snapshot and one model per tool.
#[derive(Debug, Clone, Default)]
pub struct ContactModels {
    surfaces: Vec<ContactSurface>,
    velocities: Vec<Vec<[f32; 3]>>,
    tools: Vec<ToolModel>,
    /// What is known about each body's material before it is touched.
    materials: Vec<Tissue>,
    step: u64,
    time_s: f64,
    taken_s: Option<f64>,
    interval_s: f64,
    refused_poses: u64,
    refused_surfaces: u64,
}

/// State of one tool between models.
#[derive(Debug, Clone)]
struct ToolModel {
    id: Arc<str>,
    /// The tool in the newest snapshot.
    seen: Option<ToolSnapshot>,
    proxy: Proxy,
    /// Those of the capsules of a compound tool.
    limbs: Vec<Proxy>,
    features: FeatureNumbers,
    now: LocalContact,
    before: LocalContact,
    evaluated_s: f64,
}

impl ContactModels {
    /// Takes over a snapshot at time `now_s` [s] of the caller's clock. A body keeps its surface if its
    /// positions are missing or do not belong to its topology.
    pub fn take(&mut self, snapshot: &Snapshot, now_s: f64) {
        if let Some(before) = self.taken_s {
            let interval = (now_s - before).clamp(INTERVAL_S.0, INTERVAL_S.1);
            let first = self.interval_s == 0.0;
            self.interval_s = if first { interval } else { 0.8 * self.interval_s + 0.2 * interval };
        }
        self.taken_s = Some(now_s);
        (self.step, self.time_s) = (snapshot.step, snapshot.time_s);
        self.surfaces.resize_with(snapshot.bodies.len(), ContactSurface::default);
        self.surfaces.iter_mut().for_each(|surface| surface.arrange_by(snapshot.broad_phase));
        self.velocities.resize_with(snapshot.bodies.len(), Vec::new);
        self.materials.clear();
        self.materials.extend(snapshot.bodies.iter().map(|body| Tissue {
            learned: None,
            young_pa: body.young_pa,
            viscosity_s: body.viscosity_s,
            step_s: snapshot.step_s,
        }));
        for (body, seen) in snapshot.bodies.iter().enumerate() {
            if seen.positions.is_empty() {
                continue;
            }
            let (epoch, triangles) = (seen.topology.epoch, &seen.topology.triangles);
            match self.surfaces[body].update(epoch, triangles, &seen.positions) {
                Ok(_) => self.velocities[body].clone_from(&seen.velocities),
                Err(_) => self.refused_surfaces += 1,
            }
        }
        self.tools.retain(|model| snapshot.tools.iter().any(|tool| tool.id == model.id));
        for tool in &snapshot.tools {
            let index = self.model_of(&tool.id, now_s);
            let model = &mut self.tools[index];
            // The step knows on which side of the tissue the tool is, so its proxy is taken.
            model.proxy.seat(&tool.proxy);
            model.proxy.ride(tool.shape, &self.surfaces);
            model.limbs.resize_with(tool.limbs.len(), Proxy::default);
            for (proxy, limb) in model.limbs.iter_mut().zip(&tool.limbs) {
                proxy.seat(&limb.proxy);
                proxy.ride(limb.part.shape, &self.surfaces);
            }
            model.seen = Some(tool.clone());
        }
    }

    /// The model for a tool at its newest pose, at time `now_s` [s] of the caller's clock. A pose that is not
    /// finite is refused and counted, and the model of the last valid pose is returned.
    pub fn evaluate(&mut self, query: &ToolQuery, now_s: f64) -> &LocalContact {
        let index = self.model_of(&query.id, now_s);
        let finite = query.velocity_m_s.iter().all(|v| v.is_finite());
        if !(is_sane(&query.pose) && finite) {
            self.refused_poses += 1;
            return &self.tools[index].now;
        }
        let since_snapshot = self.taken_s.map_or(0.0, |taken| (now_s - taken).max(0.0));
        let frame = Frame {
            surfaces: &self.surfaces,
            velocities: &self.velocities,
            materials: &self.materials,
            ahead_s: since_snapshot.min(HORIZON * self.interval_s),
            validity_s: (HORIZON * self.interval_s).clamp(VALIDITY_S.0, VALIDITY_S.1),
            step: self.step,
            time_s: self.time_s,
        };
        let model = &mut self.tools[index];
        model.evaluate(query, &frame);
        let elapsed = (now_s - model.evaluated_s).clamp(0.0, LONGEST_TICK_S);
        model.evaluated_s = now_s;
        limit_step(&model.before, &mut model.now, SLEW_N_S * elapsed);
        &model.now
    }

    /// Number of poses refused so far.
    pub fn refused_poses(&self) -> u64 {
        self.refused_poses
    }

    /// Number of surfaces refused so far.
    pub fn refused_surfaces(&self) -> u64 {
        self.refused_surfaces
    }

    fn model_of(&mut self, id: &Arc<str>, now_s: f64) -> usize {
        self.tools.iter().position(|model| model.id == *id).unwrap_or_else(|| {
            self.tools.push(ToolModel {
                id: Arc::clone(id),
                seen: None,
                proxy: Proxy::default(),
                limbs: Vec::with_capacity(MAX_PARTS),
                features: FeatureNumbers::default(),
                now: LocalContact::default(),
                before: LocalContact::default(),
                evaluated_s: now_s,
            });
            self.tools.len() - 1
        })
    }
}

/// Data that all tools of one tick share.
struct Frame<'a> {
    surfaces: &'a [ContactSurface],
    velocities: &'a [Vec<[f32; 3]>],
    materials: &'a [Tissue],
    /// Time for which the surfaces are extrapolated [s].
    ahead_s: f64,
    validity_s: f64,
    step: u64,
    time_s: f64,
}

/// What the last step knew about the tool.
struct Anchor {
    pose: Isometry3<f64>,
    velocity: Vector3<f64>,
    /// Contact force on the tool without friction [N]; zero if it did not touch.
    force: Vector3<f64>,
    /// Friction on it [N], and its coefficient.
    rubbed: Vector3<f64>,
    friction: f64,
    /// Stiffness of the hand alone, and of hand and tissue in series [N/m].
    hand: f64,
    series: f64,
    max_force: f64,
    /// Body that the tool touched last, and the compliance of its tissue in a step [m/N].
    tissue: Option<(usize, f64)>,
}

impl Anchor {
    /// How hand and tissue of `body` answer in series. Where nothing is known the old answer stays.
    fn answer(&self, body: usize, radius_m: f64, frame: &Frame<'_>) -> Answer {
        let same = |&(touched, compliance): &(usize, f64)| (touched == body).then_some(compliance);
        let learned = self.tissue.as_ref().and_then(same);
        let known = frame.materials.get(body).map(|material| Tissue { learned, ..*material });
        let answer = known.and_then(|tissue| Answer::new(self.hand, radius_m, &tissue));
        answer.unwrap_or(Answer { in_step: self.series, at_once: 0.0, relaxed: 0.0, relaxation_s: 0.0 })
    }
}

impl Anchor {
    /// What it is for a capsule of a compound tool that has this share of its stiffness.
    fn of_limb(&self, limb: &LimbSnapshot, share: f64) -> Self {
        Self {
            pose: self.pose * limb.part.pose,
            velocity: self.velocity,
            force: limb.force_n - limb.friction_n,
            rubbed: limb.friction_n,
            friction: self.friction,
            hand: self.hand * share,
            series: self.series * share,
            max_force: self.max_force * share,
            tissue: self.tissue,
        }
    }
}

impl ToolModel {
    fn evaluate(&mut self, query: &ToolQuery, frame: &Frame<'_>) {
        std::mem::swap(&mut self.now, &mut self.before);
        let anchor = self.anchor(query);
        let now = &mut self.now;
        now.planes.clear();
        now.body = None;
        now.epoch = self.before.epoch;
        now.mode = ContactMode::Free;
        now.pose_used = query.pose;
        now.validity_s = frame.validity_s;
        now.max_force_n = anchor.max_force;
        now.max_stiffness_n_m = anchor.hand;
        (now.step, now.time_s) = (frame.step, frame.time_s);
        match query.mode {
            ToolMode::Hover => self.proxy.release(&query.pose),
            ToolMode::Grab => {
                self.proxy.release(&query.pose);
                self.hold(query, &anchor);
            }
            ToolMode::Cut if matches!(query.shape, ToolShape::Blade { .. }) => {
                self.proxy.release(&query.pose);
                self.cut(query, &anchor);
            }
            ToolMode::Touch | ToolMode::Cut | ToolMode::Scalpel => self.touch(query, &anchor, frame),
        }
        self.features.carry_over(&self.before, &mut self.now);
    }

    fn anchor(&self, query: &ToolQuery) -> Anchor {
        let Some(seen) = &self.seen else {
            return Anchor {
                pose: query.pose,
                velocity: Vector3::zeros(),
                force: Vector3::zeros(),
                rubbed: Vector3::zeros(),
                friction: 0.0,
                hand: 0.0,
                series: 0.0,
                max_force: 0.0,
                tissue: None,
            };
        };
        let known = seen.contact_stiffness_n_m > 0.0;
        let same = seen.mode == query.mode;
        Anchor {
            pose: seen.pose,
            velocity: seen.velocity_m_s,
            force: if same { seen.force_n - seen.friction_n } else { Vector3::zeros() },
            rubbed: if same { seen.friction_n } else { Vector3::zeros() },
            friction: seen.friction,
            hand: seen.stiffness_n_m,
            series: if known { seen.contact_stiffness_n_m } else { 0.5 * seen.stiffness_n_m },
            max_force: seen.max_force_n,
            tissue: seen.tissue,
        }
    }

    /// Adds the planes of a tool that touches tissue or may do so soon.
    fn touch(&mut self, query: &ToolQuery, anchor: &Anchor, frame: &Frame<'_>) {
        let Self { seen, proxy, limbs, now, .. } = self;
        let compound = seen.as_ref().filter(|seen| seen.shape == query.shape && !seen.limbs.is_empty());
        let Some(seen) = compound else {
            let met = meet(query, (proxy, anchor), frame);
            return now.add(met.as_slice(), frame);
        };
        proxy.release(&query.pose);
        let share = 1.0 / seen.limbs.len() as f64;
        let mut all: SmallVec<[Met; MAX_PARTS]> = SmallVec::new();
        for (proxy, limb) in limbs.iter_mut().zip(&seen.limbs) {
            let own = ToolQuery {
                id: Arc::clone(&query.id),
                shape: limb.part.shape,
                pose: query.pose * limb.part.pose,
                ..*query
            };
            let anchor = anchor.of_limb(limb, share);
            let met = meet(&own, (proxy, &anchor), frame);
            all.extend(met.map(|met| Met { plane: about_the_tip(met.plane, query), ..met }));
        }
        now.add(&all, frame);
    }

    /// Adds the resistance of the tissue to a blade: a plane across the load, whose force rises up to that at which the
    /// edge goes on. The hand then works against a constant force, which it does not get back.
    fn cut(&mut self, query: &ToolQuery, anchor: &Anchor) {
        self.now.mode = ContactMode::Cutting;
        let Some(seen) = self.seen.as_ref().filter(|seen| seen.resistance_n > 0.0) else { return };
        let Some(normal) = anchor.force.try_normalize(1e-6) else { return };
        let tip = query.pose.translation.vector;
        let moved = normal.dot(&(tip - anchor.pose.translation.vector));
        let most = seen.resistance_n.min(anchor.max_force);
        let force = (anchor.force.norm() - anchor.series * moved).min(most);
        self.now.max_force_n = most;
        self.now.planes.push(ContactPlane {
            point_m: tip,
            normal,
            gap_m: -force / anchor.series.max(f64::MIN_POSITIVE),
            force_n: force * normal,
            stiffness_n_m: anchor.series,
            damping_ns_m: damping(anchor.series),
            ..ContactPlane::NONE
        });
    }

    /// Adds the pull of held tissue, along all axes.
    fn hold(&mut self, query: &ToolQuery, anchor: &Anchor) {
        let Some(seen) = &self.seen else { return };
        if seen.mode != ToolMode::Grab {
            return;
        }
        let moved = query.pose.translation.vector - anchor.pose.translation.vector;
        let force = (seen.force_n - moved * anchor.series).cap_magnitude(anchor.max_force);
        self.now.mode = ContactMode::Hold;
        self.now.planes.push(ContactPlane {
            point_m: query.pose.translation.vector,
            normal: force.try_normalize(1e-9).unwrap_or_else(Vector3::z),
            gap_m: 0.0,
            force_n: force,
            stiffness_n_m: anchor.series,
            tangential_stiffness_n_m: anchor.series,
            damping_ns_m: damping(anchor.series),
            ..ContactPlane::NONE
        });
    }
}

impl LocalContact {
    /// Adds the planes of all places that were met, and then what is beside them as far as there is room.
    fn add(&mut self, met: &[Met], frame: &Frame<'_>) {
        let Some(first) = met.first() else { return };
        self.mode = ContactMode::Contact;
        self.body = Some(first.place.body);
        self.epoch = frame.surfaces[first.place.body].epoch();
        self.planes.extend(met.iter().map(|met| met.plane));
        let touched = || met.iter().enumerate().filter(|(_, met)| met.touched);
        for (_, met) in touched() {
            let margin = touch_margin(met.poses.proxy.radius);
            neighbours::walls(
                &met.place,
                &met.poses,
                (frame.surfaces, margin),
                &met.pushed(),
                &mut self.planes,
            );
        }
        for (number, met) in touched() {
            let reach = patch_radius(met.poses.device.radius);
            neighbours::edges(&met.place, &met.poses, (frame.surfaces, reach), number, &mut self.planes);
        }
    }
}

/// A place that a capsule has met.
#[derive(Debug, Clone, Copy)]
struct Met {
    /// The place, with the normal of the tissue there.
    place: Nearest,
    /// Whether the capsule touches it already.
    touched: bool,
    poses: Poses,
    plane: ContactPlane,
    /// Stiffness of the hand [N/m], the way of the tool since the last step, reversed [m], and whether that step pushed.
    hand_n_m: f64,
    back_m: Vector3<f64>,
    pressed: bool,
}

impl Met {
    fn pushed(&self) -> Pushed<'_> {
        let Self { plane, hand_n_m, back_m, pressed, .. } = self;
        Pushed { plane, hand_n_m: *hand_n_m, back_m: *back_m, pressed: *pressed }
    }
}

/// Where a capsule touches tissue or may do so soon, and the plane there.
fn meet(query: &ToolQuery, (proxy, anchor): (&mut Proxy, &Anchor), frame: &Frame<'_>) -> Option<Met> {
    proxy.follow(query.shape, &query.pose, frame.surfaces);
    let ahead = (query.velocity_m_s.norm() * AHEAD_S).clamp(LEAST_AHEAD_M, MOST_AHEAD_M);
    let at_proxy = capsule(query.shape, proxy.pose());
    let at_device = capsule(query.shape, &query.pose);
    let met = touched((&at_proxy, &at_device), frame.surfaces);
    let place = met.or_else(|| nearest(&at_proxy, frame.surfaces, ahead))?;
    let normal = match met {
        Some(place) => {
            let target = push_direction(&place, &at_proxy, &at_device);
            // The model presses in the direction of the step, and turns as the next step will.
            let held = anchor.force.try_normalize(1e-6);
            held.map_or(target, |held| followed_direction(held, target, frame.ahead_s))
        }
        None => place.normal,
    };
    let before = capsule(query.shape, &anchor.pose).core_point(place.parameter);
    Some(Met {
        place,
        touched: met.is_some(),
        poses: Poses { proxy: at_proxy, device: at_device },
        plane: plane_of(&Nearest { normal, ..place }, &at_device, query, anchor, frame),
        hand_n_m: anchor.hand,
        back_m: before - at_device.core_point(place.parameter),
        pressed: anchor.force.dot(&normal) > 0.0,
    })
}

/// The plane of a limb for clients, who measure from the tip of the tool.
fn about_the_tip(plane: ContactPlane, query: &ToolQuery) -> ContactPlane {
    let tip = query.pose.translation.vector - plane.point_m;
    let aside = (tip - plane.normal * plane.normal.dot(&tip)).norm();
    ContactPlane { patch_radius_m: plane.patch_radius_m + aside, ..plane }
}

/// Radius around the place of contact within which its plane is trusted, for a tool of this radius [m].
fn patch_radius(radius: f64) -> f64 {
    (2.0 * radius).max(LEAST_PATCH_M)
}

fn damping(stiffness: f64) -> f64 {
    (stiffness * DAMPING_S).min(MAX_DAMPING_NS_M)
}

/// The contact plane at a surface place, with its force at the newest pose.
fn plane_of(
    place: &Nearest,
    at_device: &Capsule,
    query: &ToolQuery,
    anchor: &Anchor,
    frame: &Frame<'_>,
) -> ContactPlane {
    let normal = place.normal;
    let answer = anchor.answer(place.body, at_device.radius, frame);
    let device = at_device.core_point(place.parameter);
    let before = capsule(query.shape, &anchor.pose).core_point(place.parameter);
    let force_before = anchor.force.dot(&normal);
    let pressed = force_before > 0.0;
    // The tissue yields to the tool at a share of the tool's velocity. The model adds that motion itself, so
    // it must not be extrapolated too.
    let mut by_itself = surface_velocity(place, frame);
    if pressed && anchor.hand > 0.0 {
        let yielding = 1.0 - answer.in_step / anchor.hand;
        by_itself -= normal * normal.dot(&anchor.velocity) * yielding;
    }
    let shift = by_itself * frame.ahead_s;
    let depth = at_device.radius - normal.dot(&(device - place.point - shift));
    // A contact continues the force of the last solve. A new one starts from its depth.
    let force = if pressed {
        force_before + answer.in_step * normal.dot(&(before - device + shift))
    } else {
        answer.in_step * depth
    };
    let along = force.min(anchor.max_force);
    let (across, tangential) = rub(anchor, &normal, (answer.in_step, along), before - device + shift);
    let point = place.point + shift;
    let tip = query.pose.translation.vector - point;
    let aside = (tip - normal * normal.dot(&tip)).norm();
    ContactPlane {
        point_m: point,
        normal,
        gap_m: -depth,
        force_n: normal * along + across,
        stiffness_n_m: answer.in_step,
        instant_stiffness_n_m: answer.at_once,
        relaxed_stiffness_n_m: answer.relaxed,
        relaxation_s: answer.relaxation_s,
        tangential_stiffness_n_m: tangential,
        friction: anchor.friction,
        damping_ns_m: damping(answer.in_step),
        surface_velocity_m_s: by_itself,
        // Clients measure from the tip, which may be far from the contact of a shaft.
        patch_radius_m: aside + patch_radius(at_device.radius),
        feature_id: 0,
        edge_of: None,
    }
}

/// Compliance of tissue across a contact in multiples of that along it: (2 − ν) / (2 (1 − ν)) of a circle with ν = ½
/// (Mindlin 1949, *Compliance of elastic bodies in contact*).
const ACROSS: f64 = 1.5;

/// Friction [N] at the newest pose, and its stiffness [N/m], under a tool that went `back` [m] since the last step.
/// `along` are the stiffness within a step and the force along the normal.
fn rub(
    anchor: &Anchor,
    normal: &Vector3<f64>,
    (in_step, along): (f64, f64),
    back: Vector3<f64>,
) -> (Vector3<f64>, f64) {
    if anchor.friction <= 0.0 || anchor.hand <= 0.0 || in_step <= 0.0 {
        return (Vector3::zeros(), 0.0);
    }
    let tissue = (1.0 / in_step - 1.0 / anchor.hand).max(0.0);
    let stiffness = 1.0 / (1.0 / anchor.hand + ACROSS * tissue);
    let force = anchor.rubbed + stiffness * back;
    let across = (force - normal * normal.dot(&force)).cap_magnitude(anchor.friction * along.max(0.0));
    (across, stiffness)
}

/// Velocity of the touched surface point [m/s]; zero if it is not known.
fn surface_velocity(place: &Nearest, frame: &Frame<'_>) -> Vector3<f64> {
    let Some(tree) = frame.surfaces[place.body].tree() else { return Vector3::zeros() };
    let velocities = &frame.velocities[place.body];
    let mut sum = Vector3::zeros();
    for (vertex, weight) in tree.corners(place.triangle).into_iter().zip(place.barycentric) {
        let Some(v) = velocities.get(vertex as usize) else { return Vector3::zeros() };
        sum += Vector3::new(v[0], v[1], v[2]).cast::<f64>() * weight;
    }
    if sum.iter().all(|x| x.is_finite()) { sum } else { Vector3::zeros() }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;

//! Bodies on bodies, and bodies on themselves.
//!
//! A surface vertex that may meet a triangle in a step gets a one-sided spring with friction between the two. All
//! bodies that such springs connect are solved as one system, so both sides are implicit and exchange momentum
//! exactly. A vertex remembers the place on the triangle where it sticks. Bodies that are out of reach of each other
//! have no springs and cost a comparison of boxes; their surfaces may stay where they are.
//!
//! # A body with itself
//! Every point of a body lies behind some of its faces, so depth alone says nothing. A contact has to begin outside,
//! or between the two lips of one cut, and is followed from there. Triangles count only where they face the vertex,
//! and where the material between them and the vertex is not in one piece.

mod own;
mod watch;

use nalgebra::Vector3;
use scindo_collision::ClosestPoint;
use scindo_physics::body::{Body, PairSpring, SpringKind};
use scindo_physics::element::MaterialPoint;

use super::surface::ContactSurface;
use crate::body::SimBody;
use crate::scene::CheckedScene;
use own::OwnSurface;
use watch::{NOWHERE, Watch};

/// Distance at which a vertex gets a spring beyond its path in the step, in cells of the body.
const MARGIN_CELLS: f64 = 0.1;
/// Depth up to which a vertex is still found, in cells.
const DEEPEST_CELLS: f64 = 1.0;
/// Depth at which contact of a body with itself may begin, in cells.
const BORN_CELLS: f64 = 1e-5;
/// The same between two lips of one cut.
const BORN_LIP_CELLS: f64 = 0.25;
/// Time in which a depth that a contact began with is pushed out [s].
const EASE_S: f64 = 0.1;
/// Depth above which a spring alone is too soft, in cells, and the steps after which a multiplier joins it.
const SHALLOW_CELLS: f64 = 0.02;
const DEEP_STEPS: u8 = 3;
/// Largest multiplier over the stiffness of its spring, in cells.
const MOST_CELLS: f64 = 1.0;
/// Stiffness across the normal relative to that along it.
const TANGENTIAL: f64 = 0.5;

/// How bodies touch each other and themselves.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct TouchSettings {
    /// Whether bodies touch each other.
    pub others: bool,
    /// Whether bodies touch themselves.
    pub itself: bool,
    /// Coefficient of dry friction μ.
    pub friction: f64,
    /// Stiffness of the contact in multiples of E/h.
    pub stiffness: f64,
}

impl TouchSettings {
    /// Those of a scene; `None` if its bodies touch no bodies.
    pub fn of(scene: &CheckedScene) -> Option<Self> {
        let others = scene.effects.body_collision == Some(true) && scene.bodies.len() > 1;
        let itself = scene.effects.self_collision == Some(true);
        let [friction, stiffness] = scene.body_contact;
        (others || itself).then_some(Self { others, itself, friction, stiffness })
    }
}

/// What a vertex remembers of a triangle.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
struct Kept {
    /// Bodies of vertex and triangle.
    bodies: [u32; 2],
    vertex: u32,
    triangle: u32,
    barycentric: [f64; 3],
    /// Relative place where it sticks [m].
    anchor_m: Vector3<f64>,
    grip_n: f64,
    /// Force on the vertex in the last step [N].
    force_n: Vector3<f64>,
    /// Depth that it began with and that is still left to it [m].
    eased_m: f64,
    /// Depth at the end of the last step, below the plane of that step [m].
    depth_m: f64,
    /// Multiplier over the stiffness of the spring, by which its plane is shifted towards the vertex [m].
    ahead_m: f64,
    /// Steps in a row in which it was too deep.
    deep: u8,
    /// Whether it slipped, so that it takes hold of another place.
    slipped: bool,
    /// Its spring in the last step.
    spring: u32,
}

/// Contact of two bodies in one step, or of a body with itself.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct TouchReport {
    /// Numbers of the two bodies.
    pub bodies: [u32; 2],
    /// Vertices that are pushed.
    pub contacts: u32,
    /// Largest depth of a pushed vertex [m].
    pub deepest_m: f64,
    /// Sum of the forces on the first body [N].
    pub force_n: Vector3<f64>,
    /// Sum of the normal forces [N].
    pub normal_n: f64,
}

/// The contacts of all bodies with each other and with themselves.
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub struct PairContacts {
    kept: Vec<Kept>,
    now: Vec<Kept>,
    /// The springs of this step, those of a group together, with the numbers of bodies within their group.
    springs: Vec<PairSpring>,
    /// The same with their own numbers, in the order of `now`.
    found: Vec<PairSpring>,
    /// Those of the last step.
    known: Vec<PairSpring>,
    /// Where the springs of every contact stand.
    order: Vec<u32>,
    /// Per body the first body of its group.
    group: Vec<u32>,
    /// Per body what it can meet in the step.
    watch: Vec<Watch>,
    /// Whether no topology has changed since the step before.
    same: bool,
    /// Per body the box that its surface passes through in the step, and its largest speed.
    reach: Vec<([Vector3<f64>; 2], f64)>,
    /// Per body the positions [m] and velocities [m/s] of its surface vertices.
    paths: Vec<Vec<[Vector3<f64>; 2]>>,
    epochs: Vec<u32>,
    /// Per body the size of its cells [m].
    cells: Vec<f64>,
    /// Per body how much farther than its nodes a point of its surface can move; 1, or more where some weights are
    /// negative.
    spreads: Vec<f64>,
    /// Per body and vertex: whether it is on a lip, and of which cut.
    lips: Vec<Vec<u32>>,
    reports: Vec<TouchReport>,
    /// Forces of the springs in `springs` [N].
    forces: Vec<Vector3<f64>>,
    /// Vertices meet also what they are joined to; only for a mutation test.
    meets_joined: bool,
    /// Per body what it knows about itself; empty where bodies do not touch themselves.
    own: Vec<OwnSurface>,
}

/// A vertex and what is near it.
struct Candidate<'a> {
    bodies: [usize; 2],
    vertex: u32,
    near: &'a ClosestPoint,
}

impl PairContacts {
    /// Forgets all contacts.
    pub fn forget(&mut self) {
        self.kept.clear();
        self.now.clear();
        self.springs.clear();
        self.found.clear();
        self.known.clear();
        self.reports.clear();
        self.group.clear();
    }

    /// Lets vertices meet also what they are joined to; only for a mutation test.
    pub fn meet_the_joined(&mut self, on: bool) {
        self.meets_joined = on;
    }

    /// Reports of the last step, one per pair of bodies that touched.
    pub fn reports(&self) -> &[TouchReport] {
        &self.reports
    }

    /// The first body of the group in which body number `body` steps; itself if it touches nothing.
    pub fn group_of(&self, body: usize) -> usize {
        self.group.get(body).map_or(body, |&group| group as usize)
    }

    /// Whether body number `body` may touch another body or itself in this step.
    pub fn has_company(&self, body: usize) -> bool {
        !self.range_of(self.group_of(body)).is_empty()
    }

    /// The springs of the group whose first body is `first`. Their numbers of bodies are those within the group.
    pub fn springs_of(&self, first: usize) -> &[PairSpring] {
        let range = self.range_of(first);
        &self.springs[range]
    }

    /// Takes the forces of the springs of the group whose first body is `first` [N].
    pub fn collect(&mut self, first: usize, forces: &[Vector3<f64>]) {
        let range = self.range_of(first);
        self.forces.resize(self.springs.len(), Vector3::zeros());
        if range.len() == forces.len() {
            self.forces[range].copy_from_slice(forces);
        }
    }

    fn range_of(&self, first: usize) -> std::ops::Range<usize> {
        let group = |i: &u32| self.group_of(self.now[*i as usize].bodies[0] as usize);
        let start = self.order.partition_point(|i| group(i) < first);
        start..start + self.order[start..].partition_point(|i| group(i) == first)
    }

    /// Finds what may touch in a step of `h` seconds.
    pub fn detect(
        &mut self,
        (bodies, asleep): (&[SimBody], &[bool]),
        surfaces: &[ContactSurface],
        young_pa: impl Fn(usize) -> f64,
        (h, settings): (f64, TouchSettings),
    ) {
        self.know_themselves(bodies, surfaces);
        std::mem::swap(&mut self.kept, &mut self.now);
        std::mem::swap(&mut self.known, &mut self.found);
        self.now.clear();
        self.found.clear();
        if self.watch.iter().any(Watch::may_meet) {
            self.measure(bodies, h);
        }
        for a in 0..bodies.len() {
            for b in 0..bodies.len() {
                let wanted = if a == b { !self.watch[a].apart } else { settings.others };
                if wanted && sleeps(asleep, a) && sleeps(asleep, b) {
                    self.keep([a as u32, b as u32]);
                } else if wanted && (a == b || !self.watch[a].alone && !self.watch[b].alone) {
                    let before = self.now.len();
                    self.between([a, b], bodies, surfaces, &young_pa, (h, settings));
                    if a == b {
                        self.own[a].has_looked(self.now.len() > before);
                    }
                }
            }
        }
        self.arrange(bodies.len());
    }

    /// Follows the motion of the surfaces that may touch themselves.
    fn know_themselves(&mut self, bodies: &[SimBody], surfaces: &[ContactSurface]) {
        for (i, own) in self.own.iter_mut().enumerate().filter(|(i, _)| !self.watch[*i].apart) {
            if let Some(tree) = surfaces[i].whole() {
                own.update(tree, bodies[i].body.positions(), self.same, |t| surfaces[i].tag(t) > 0);
            }
        }
    }

    /// Boxes and speeds of the surfaces that may meet anything in the step.
    fn measure(&mut self, bodies: &[SimBody], h: f64) {
        self.reach.clear();
        self.paths.resize_with(bodies.len(), Vec::new);
        for ((body, paths), watch) in bodies.iter().zip(&mut self.paths).zip(&self.watch) {
            paths.clear();
            let (x, v) = (body.body.positions(), body.body.velocities());
            let (mut bounds, mut fastest) = (NOWHERE, 0.0f64);
            let vertices = &body.body.surface().vertices;
            for vertex in vertices.iter().filter(|_| watch.may_meet()) {
                let (from, v) = (vertex.position(x), vertex.position(v));
                let to = from + h * v;
                bounds = [bounds[0].inf(&from).inf(&to), bounds[1].sup(&from).sup(&to)];
                fastest = fastest.max(v.norm());
                paths.push([from, v]);
            }
            self.reach.push((bounds, fastest));
        }
    }

    /// Springs of the vertices of body `a` against the triangles of body `b`.
    fn between(
        &mut self,
        [a, b]: [usize; 2],
        bodies: &[SimBody],
        surfaces: &[ContactSurface],
        young_pa: &impl Fn(usize) -> f64,
        (h, settings): (f64, TouchSettings),
    ) {
        let Some(tree) = surfaces[b].whole() else { return };
        let cell_m = self.cells[a].min(self.cells[b]);
        let margin = MARGIN_CELLS * cell_m;
        let ([low, high], fastest) = self.reach[b];
        let (low, high) = (low.add_scalar(-margin), high.add_scalar(margin));
        let ([own_low, own_high], _) = self.reach[a];
        // Boxes hold the whole paths of the step, so most pairs of bodies end here.
        if a != b && (0..3).any(|k| own_high[k] < low[k] || own_low[k] > high[k]) {
            return;
        }
        let (body, other) = (&bodies[a].body, &bodies[b].body);
        let surface = body.surface();
        // The harmonic mean, in which the softer side decides.
        let stiffness = {
            let [soft, hard] = [a, b].map(|i| young_pa(i) / self.cells[i]);
            settings.stiffness * 2.0 * soft * hard / (soft + hard)
        };
        let first = self.kept.partition_point(|k| k.bodies < [a as u32, b as u32]);
        let mut next = first;
        let touched = self.kept.get(first).is_some_and(|k| k.bodies == [a as u32, b as u32]);
        // A body in touch with itself is looked at in every step anyway and keeps no distance to spare.
        let spare = if touched { 0.0 } else { OwnSurface::spare_m(2.0 * h * fastest, cell_m) };
        for (vertex, point) in (0u32..).zip(&surface.vertices) {
            // Vertices and contacts ascend alike, so one pass finds what each vertex remembers.
            while next < self.kept.len() && self.kept[next].key() < ([a as u32, b as u32], vertex) {
                next += 1;
            }
            let known = self.kept.get(next).filter(|k| k.key() == ([a as u32, b as u32], vertex)).copied();
            // Against itself most vertices of a body end here, at a bound for two sides as fast as its fastest.
            let is_unmet = a == b && known.is_none();
            if is_unmet && self.own[a].is_free(vertex, (margin + 2.0 * h * fastest + spare, cell_m)) {
                continue;
            }
            let [from, velocity] = self.paths[a][vertex as usize];
            let inside = |p: &Vector3<f64>| (0..3).all(|k| p[k] >= low[k] && p[k] <= high[k]);
            let to = from + h * velocity;
            if a != b && !inside(&from) && !inside(&to) {
                continue;
            }
            let approach = h * (fastest + velocity.norm());
            let near_m = margin + approach;
            if is_unmet && self.own[a].is_free(vertex, (near_m + spare, cell_m)) {
                continue;
            }
            // Whatever is deep inside has been followed from the surface, or overlaps from the start.
            let reach = match known {
                Some(known) => near_m + known.depth_m.max(0.0),
                None if a == b => near_m.min(DEEPEST_CELLS * cell_m),
                None => near_m.max(DEEPEST_CELLS * cell_m),
            };
            let near = if a == b {
                let (own, meets_joined) = (&mut self.own[a], self.meets_joined);
                let joined = |t: u32| {
                    let corners = tree.corners(t);
                    corners.contains(&vertex)
                        || !meets_joined
                            && corners.iter().any(|&c| joined(point, &surface.vertices[c as usize]))
                };
                own.closest((vertex, from), (reach, spare, cell_m), tree, joined)
            } else {
                tree.closest_point(from, reach)
            };
            let Some(mut near) = near else { continue };
            if near.signed_distance > near_m {
                continue;
            }
            // The speed of the nearest place is known now, and counts in place of the largest of the body.
            let corners = tree.corners(near.triangle).into_iter().zip(near.barycentric);
            let meets: Vector3<f64> = corners.map(|(v, w)| w * self.paths[b][v as usize][1]).sum();
            if near.signed_distance > margin + h * (meets - velocity).norm() {
                continue;
            }
            if a == b {
                near.normal = self.own[a].push(&near, from, tree, cell_m);
            }
            let candidate = Candidate { bodies: [a, b], vertex, near: &near };
            let Some(contact) = self.contact(known, &candidate, surfaces, (cell_m, near_m), h) else {
                continue;
            };
            let corners = tree.corners(contact.triangle).map(|c| other.surface().vertices[c as usize]);
            let area = surfaces[a].vertex_area(vertex);
            let kind = Self::kind(&contact, &near, (other, &corners), settings, stiffness * area);
            self.found.push(PairSpring {
                bodies: [a as u32, b as u32],
                point: *point,
                corners,
                barycentric: contact.barycentric,
                kind,
                stiffness_n_m: stiffness * area,
                max_force_n: f64::INFINITY,
            });
            self.now.push(contact);
        }
    }

    /// Contacts of two bodies that sleep stay as they are.
    fn keep(&mut self, bodies: [u32; 2]) {
        let start = self.kept.partition_point(|contact| contact.bodies < bodies);
        let end = start + self.kept[start..].partition_point(|contact| contact.bodies == bodies);
        self.now.extend_from_slice(&self.kept[start..end]);
        self.found.extend_from_slice(&self.known[start..end]);
    }

    /// The contact of a vertex with what is near it; `None` if there is none.
    fn contact(
        &self,
        known: Option<Kept>,
        candidate: &Candidate<'_>,
        surfaces: &[ContactSurface],
        (cell_m, near_m): (f64, f64),
        h: f64,
    ) -> Option<Kept> {
        let Candidate { bodies: [a, b], vertex, near, .. } = *candidate;
        let depth = -near.signed_distance;
        let spring = self.now.len() as u32;
        // What jumps deeper than the surfaces have moved is another place of the body, not the one it touched.
        if known.is_some_and(|known| a == b && depth > known.depth_m.max(0.0) + near_m) {
            return None;
        }
        if let Some(known) = known {
            // Another plane than that of the last step must not push more: it would put in energy.
            let jump = depth.max(0.0) - known.depth_m.max(0.0);
            let eased_m = known.eased_m * (1.0 - h / EASE_S).max(0.0) + jump.max(0.0);
            let slid = known.slipped || known.grip_n == 0.0;
            let (triangle, barycentric) =
                if slid { (near.triangle, near.barycentric) } else { (known.triangle, known.barycentric) };
            return Some(Kept { triangle, barycentric, eased_m, spring, ..known });
        }
        if a == b && depth > BORN_CELLS * cell_m {
            let of = self.lips[a].get(vertex as usize).copied().unwrap_or(0);
            let lip = of > 0 && surfaces[b].tag(near.triangle) == of;
            if !lip || depth > BORN_LIP_CELLS * cell_m {
                return None;
            }
        }
        Some(Kept {
            bodies: [a as u32, b as u32],
            vertex,
            triangle: near.triangle,
            barycentric: near.barycentric,
            anchor_m: Vector3::zeros(),
            grip_n: 0.0,
            force_n: Vector3::zeros(),
            eased_m: depth.max(0.0),
            depth_m: depth,
            ahead_m: 0.0,
            deep: 0,
            slipped: true,
            spring,
        })
    }

    /// Plane and anchor of a contact in the relative position y.
    fn kind(
        contact: &Kept,
        near: &ClosestPoint,
        (other, corners): (&Body, &[MaterialPoint; 3]),
        settings: TouchSettings,
        stiffness_n_m: f64,
    ) -> SpringKind {
        let x = other.positions();
        let place = |w: [f64; 3]| corners.iter().zip(w).map(|(c, w)| w * c.position(x)).sum::<Vector3<f64>>();
        let held = place(contact.barycentric);
        // The plane goes through the closest place, which is another one than that where the vertex sticks.
        let closest = if contact.slipped || contact.grip_n == 0.0 { held } else { near.point };
        let normal = near.normal;
        let offset_m = normal.dot(&(closest - held)) - contact.eased_m + contact.ahead_m;
        match settings.friction > 0.0 {
            true => SpringKind::Rough {
                normal,
                offset_m,
                anchor_m: contact.anchor_m,
                friction: settings.friction,
                tangential_n_m: TANGENTIAL * stiffness_n_m,
                grip_n: contact.grip_n,
            },
            false => SpringKind::OneSided { normal, offset_m },
        }
    }

    /// Joins bodies into groups, and arranges the springs by group.
    fn arrange(&mut self, n: usize) {
        let Self { group, now, order, springs, found, .. } = self;
        group.clear();
        group.extend(0..n as u32);
        for contact in now.iter() {
            let [a, b] = contact.bodies.map(|i| root(group, i));
            let (low, high) = (a.min(b), a.max(b));
            group[high as usize] = low;
        }
        for i in 0..n as u32 {
            group[i as usize] = root(group, i);
        }
        order.clear();
        order.extend(0..now.len() as u32);
        order.sort_unstable_by_key(|&i| (group[now[i as usize].bodies[0] as usize], i));
        springs.clear();
        springs.extend(order.iter().map(|&i| {
            let spring = found[i as usize];
            let local = |body: u32| {
                let first = group[body as usize];
                (first..body).filter(|&other| group[other as usize] == first).count() as u32
            };
            PairSpring { bodies: spring.bodies.map(local), ..spring }
        }));
        for (place, &i) in (0u32..).zip(order.iter()) {
            now[i as usize].spring = place;
        }
    }

    /// Evaluates the last step: what sticks, what slips, and the forces. Contacts of bodies that sleep stay as they are.
    pub fn settle(&mut self, bodies: &[SimBody], asleep: &[bool]) {
        self.reports.clear();
        self.forces.resize(self.springs.len(), Vector3::zeros());
        let Self { now, found, forces, reports, cells, .. } = self;
        for (contact, spring) in now.iter_mut().zip(found) {
            let (SpringKind::Rough { normal, .. } | SpringKind::OneSided { normal, .. }) = spring.kind else {
                continue;
            };
            if !sleeps(asleep, contact.bodies[0] as usize) {
                contact.force_n = forces[contact.spring as usize];
                let x = contact.bodies.map(|i| bodies[i as usize].body.positions());
                let [a, b] = contact.bodies.map(|i| cells[i as usize]);
                contact.settle(spring, spring.relative(x), a.min(b));
            }
            let push = contact.force_n.dot(&normal);
            if push > 0.0 {
                report(reports, contact, push);
            }
        }
        forces.fill(Vector3::zeros());
    }

    /// Follows the topologies of all bodies. Contacts stay with what is still the same.
    /// Returns whether nothing is new.
    fn follow(&mut self, bodies: &[SimBody]) -> bool {
        let same = self.epochs.len() == bodies.len()
            && self.epochs.iter().zip(bodies).all(|(&epoch, body)| epoch == body.epoch());
        if same {
            return true;
        }
        self.epochs.clear();
        self.epochs.extend(bodies.iter().map(SimBody::epoch));
        self.cells.clear();
        self.cells.extend(bodies.iter().map(SimBody::cell_m));
        self.spreads.clear();
        self.spreads.extend(bodies.iter().map(watch::spread));
        self.lips.clear();
        for body in bodies {
            let surface = body.body.surface();
            let mut lips = vec![0; surface.vertices.len()];
            for (triangle, &tag) in surface.triangles.iter().zip(&surface.tags).filter(|(_, tag)| **tag > 0) {
                triangle.iter().for_each(|&v| lips[v as usize] = tag);
            }
            self.lips.push(lips);
        }
        let is_still = |contact: &Kept, spring: &PairSpring| {
            let [a, b] = contact.bodies.map(|i| bodies[i as usize].body.surface());
            let vertex = a.vertices.get(contact.vertex as usize);
            let corners = b.triangles.get(contact.triangle as usize);
            let is_corner = |(c, known): (&u32, _)| b.vertices.get(*c as usize) == Some(known);
            vertex == Some(&spring.point)
                && corners.is_some_and(|corners| corners.iter().zip(&spring.corners).all(is_corner))
        };
        let Self { now, found, .. } = self;
        let mut left = 0;
        for i in 0..now.len() {
            if is_still(&now[i], &found[i]) {
                (now[left], found[left]) = (now[i], found[i]);
                left += 1;
            }
        }
        now.truncate(left);
        found.truncate(left);
        false
    }
}

impl Kept {
    /// Evaluates a step in which the spring gave `force_n` and left the vertex at the relative place `y`.
    fn settle(&mut self, spring: &PairSpring, y: Vector3<f64>, cell_m: f64) {
        let (SpringKind::Rough { normal, offset_m, .. } | SpringKind::OneSided { normal, offset_m }) =
            spring.kind
        else {
            return;
        };
        let push = self.force_n.dot(&normal);
        self.depth_m = offset_m + self.eased_m - self.ahead_m - normal.dot(&y);
        self.augment(cell_m);
        self.slipped = true;
        self.anchor_m = Vector3::zeros();
        self.grip_n = 0.0;
        if push <= 0.0 {
            return;
        }
        if let SpringKind::Rough { anchor_m: before, tangential_n_m, friction, .. } = spring.kind {
            let across = self.force_n - push * normal;
            let anchor_m = y + across / tangential_n_m;
            let moved = (anchor_m - before) - normal * normal.dot(&(anchor_m - before));
            self.slipped = moved.norm() > 1e-3 * across.norm() / tangential_n_m + 1e-12;
            // A vertex that slipped takes hold of the place under it, with the friction it has.
            self.anchor_m = if self.slipped { across / tangential_n_m } else { before };
            self.grip_n = friction * push;
        }
    }

    /// Augments the spring by a multiplier, which takes over what the spring carries beyond a shallow depth, and gives
    /// it back where the vertex has come off.
    ///
    /// # Source
    /// Hestenes, Multiplier and gradient methods (1969): λ ← max(0, λ + k g), here with the gap g of each step.
    fn augment(&mut self, cell_m: f64) {
        let excess = self.depth_m - self.eased_m - SHALLOW_CELLS * cell_m;
        self.deep = if excess > 0.0 { self.deep.saturating_add(1) } else { 0 };
        if self.deep >= DEEP_STEPS {
            self.ahead_m = (self.ahead_m + excess).min(MOST_CELLS * cell_m);
        }
        self.ahead_m = (self.ahead_m + self.depth_m.min(0.0)).max(0.0);
    }

    fn key(&self) -> ([u32; 2], u32) {
        (self.bodies, self.vertex)
    }
}

/// Adds a contact with the normal force `push` [N] to the report of its bodies.
fn report(reports: &mut Vec<TouchReport>, contact: &Kept, push: f64) {
    let [a, b] = contact.bodies;
    let of = [a.min(b), a.max(b)];
    let place = match reports.iter().position(|report| report.bodies == of) {
        Some(place) => place,
        None => {
            reports.push(TouchReport { bodies: of, ..TouchReport::default() });
            reports.len() - 1
        }
    };
    let report = &mut reports[place];
    report.contacts += 1;
    report.deepest_m = report.deepest_m.max(contact.depth_m);
    report.force_n += if a == of[0] { 1.0 } else { -1.0 } * contact.force_n;
    report.normal_n += push;
}

/// Whether body number `i` sleeps; `asleep` is empty where none does.
fn sleeps(asleep: &[bool], i: usize) -> bool {
    asleep.get(i).copied().unwrap_or(false)
}

/// Whether two points are carried by a common node: the material between them is in one piece, however thin it is.
fn joined(a: &MaterialPoint, b: &MaterialPoint) -> bool {
    a.copies().iter().any(|copy| b.copies().contains(copy))
}

/// The first body of the group of body `i`.
fn root(group: &[u32], i: u32) -> u32 {
    let mut at = i;
    while group[at as usize] != at {
        at = group[at as usize];
    }
    at
}

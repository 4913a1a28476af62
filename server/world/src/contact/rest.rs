//! Bodies on obstacles: what lies, slides and sticks.
//!
//! Every surface vertex that may meet an obstacle in a step gets a one-sided spring with friction against the plane
//! that touches the obstacle where the vertex meets it. The springs take part in the implicit solve of the body. A
//! vertex remembers where it sticks, so that a body at rest stays where it is, and a vertex that goes on sinking in
//! is lifted by a multiplier until it no longer does.

use nalgebra::Vector3;
use scindo_physics::body::{Body, PointSpring, SpringKind};

use crate::tool::obstacle::Obstacle;

/// Distance at which a vertex gets a spring beyond its path in the step, in cells of the body.
const MARGIN_CELLS: f64 = 0.25;
/// Depth that a contact may keep, in cells of the body ...
const DEPTH_CELLS: f64 = 0.02;
/// ... and the number of steps for which it may be deeper before its multiplier grows.
const PATIENCE: u8 = 3;
/// Stiffness across the normal relative to that along it.
const TANGENTIAL: f64 = 0.5;

/// What a vertex remembers of its contact with an obstacle.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
struct Kept {
    vertex: u32,
    obstacle: u32,
    /// Where it sticks [m], and the bound of its friction [N].
    anchor_m: Vector3<f64>,
    grip_n: f64,
    /// Multiplier over stiffness: how far the plane is lifted [m].
    lift_m: f64,
    /// Steps for which it has been too deep.
    late: u8,
    /// Its spring in the last step.
    spring: u32,
}

/// A vertex that was pushed by an obstacle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pushed {
    /// The obstacle, by its place in the scene.
    pub obstacle: u32,
    /// Number of the spring that pushes.
    pub spring: u32,
    /// How far the plane of the spring is lifted [m].
    pub lift_m: f64,
}

/// Contact of a body with all obstacles in one step.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct RestReport {
    /// Vertices that are pushed.
    pub contacts: u32,
    /// Largest depth of a pushed vertex below the surface of its obstacle [m].
    pub deepest_m: f64,
    /// Sum of the forces on the body [N].
    pub force_n: Vector3<f64>,
    /// Sum of the normal forces [N].
    pub normal_n: f64,
}

impl RestReport {
    /// Adds a vertex at this depth [m] with its force and the part of it along the normal [N].
    fn add(&mut self, depth: f64, force: &Vector3<f64>, push: f64) {
        self.contacts += 1;
        self.deepest_m = self.deepest_m.max(depth);
        self.force_n += force;
        self.normal_n += push;
    }
}

/// The contacts of one body with all obstacles.
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub struct Resting {
    epoch: Option<u32>,
    /// Area of every surface vertex at rest [m²].
    areas: Vec<f64>,
    /// Contacts of the last step, by vertex and obstacle.
    kept: Vec<Kept>,
    /// Contacts of this step, in the order of their springs.
    now: Vec<Kept>,
    /// The springs of this step.
    springs: Vec<PointSpring>,
    /// Report of the last step, with all obstacles together.
    pub report: RestReport,
    /// The same with each obstacle.
    pub each: Vec<RestReport>,
}

impl Resting {
    /// Forgets all contacts, e.g. after a reset.
    pub fn forget(&mut self) {
        self.kept.clear();
        self.now.clear();
        self.springs.clear();
        self.report = RestReport::default();
        self.each.clear();
    }

    /// Finds what may touch in a step of `h` seconds under `gravity` [m/s²]. `young_pa` is Young's modulus of the
    /// body and `cell_m` the size of its elements.
    pub fn detect(
        &mut self,
        (body, obstacles): (&Body, &[Obstacle]),
        (h, gravity): (f64, Vector3<f64>),
        (young_pa, cell_m): (f64, f64),
    ) {
        self.follow(body);
        self.each.resize(obstacles.len(), RestReport::default());
        std::mem::swap(&mut self.kept, &mut self.now);
        self.now.clear();
        self.springs.clear();
        let margin = MARGIN_CELLS * cell_m + gravity.norm() * h * h;
        let (x, v) = (body.positions(), body.velocities());
        // No vertex comes farther than this in the step.
        let reach = margin + h * v.iter().map(|v| v.norm_squared()).fold(0.0, f64::max).sqrt();
        let mut kept = self.kept.iter().peekable();
        for (index, vertex) in (0u32..).zip(&body.surface().vertices) {
            let from = vertex.position(x);
            if !obstacles.iter().any(|obstacle| obstacle.shape.nearest(from, reach).is_some()) {
                continue;
            }
            let to = from + h * vertex.position(v);
            for (number, obstacle) in (0u32..).zip(obstacles) {
                let Some((seen_from, place)) = obstacle.shape.meet(from, to, margin) else { continue };
                let normal = place.normal;
                while kept.next_if(|k| (k.vertex, k.obstacle) < (index, number)).is_some() {}
                let known = kept.next_if(|k| (k.vertex, k.obstacle) == (index, number)).copied();
                let surface = seen_from - place.distance * normal;
                let fresh = Kept {
                    vertex: index,
                    obstacle: number,
                    anchor_m: surface,
                    grip_n: 0.0,
                    lift_m: 0.0,
                    late: 0,
                    spring: 0,
                };
                let contact = Kept { spring: self.springs.len() as u32, ..known.unwrap_or(fresh) };
                let area = self.areas[index as usize];
                let stiffness_n_m = obstacle.stiffness * young_pa * area / cell_m;
                let offset_m = normal.dot(&surface) + contact.lift_m;
                let kind = if obstacle.friction > 0.0 {
                    SpringKind::Rough {
                        normal,
                        offset_m,
                        anchor_m: contact.anchor_m,
                        friction: obstacle.friction,
                        tangential_n_m: TANGENTIAL * stiffness_n_m,
                        grip_n: contact.grip_n,
                    }
                } else {
                    SpringKind::OneSided { normal, offset_m }
                };
                let max_force_n = f64::INFINITY;
                self.springs.push(PointSpring { point: *vertex, kind, stiffness_n_m, max_force_n });
                self.now.push(contact);
            }
        }
    }

    /// The springs of this step, in the order in which [`collect`](Self::collect) takes their forces.
    pub fn springs(&self) -> &[PointSpring] {
        &self.springs
    }

    /// What was pushed in the last step, by ascending spring.
    pub fn pushed(&self) -> impl Iterator<Item = Pushed> + Clone {
        let pushed = |c: &Kept| Pushed { obstacle: c.obstacle, spring: c.spring, lift_m: c.lift_m };
        self.now.iter().map(pushed)
    }

    /// Takes the force of every spring from the solve [N], and keeps the contacts that exist. `cell_m` is the size of
    /// the elements.
    pub fn collect(&mut self, body: &Body, forces: &[Vector3<f64>], cell_m: f64) {
        self.report = RestReport::default();
        self.each.fill(RestReport::default());
        let x = body.positions();
        let (springs, report, reports) = (&self.springs, &mut self.report, &mut self.each);
        let mut each = springs.iter().zip(forces);
        self.now.retain_mut(|contact| {
            let Some((spring, force)) = each.next() else { return false };
            let (normal, offset_m) = match spring.kind {
                SpringKind::Rough { normal, offset_m, .. } | SpringKind::OneSided { normal, offset_m } => {
                    (normal, offset_m)
                }
                SpringKind::Hold { .. } => return false,
            };
            let push = force.dot(&normal);
            if push <= 0.0 {
                return false;
            }
            let point = spring.point.position(x);
            if let SpringKind::Rough { anchor_m, grip_n, .. } = spring.after(point, *force) {
                (contact.anchor_m, contact.grip_n) = (anchor_m, grip_n);
            }
            let depth = offset_m - contact.lift_m - normal.dot(&point);
            contact.late = if depth > DEPTH_CELLS * cell_m { contact.late.saturating_add(1) } else { 0 };
            // The force is that of the multiplier and of the depth together; the multiplier follows it.
            if contact.late >= PATIENCE || contact.lift_m > 0.0 {
                contact.lift_m = (contact.lift_m + depth).max(0.0);
            }
            report.add(depth, force, push);
            if let Some(report) = reports.get_mut(contact.obstacle as usize) {
                report.add(depth, force, push);
            }
            true
        });
    }

    /// Follows the surface of `body`. Contacts stay with the vertices that are still the same.
    fn follow(&mut self, body: &Body) {
        let epoch = Some(body.epoch());
        if self.epoch == epoch {
            return;
        }
        self.epoch = epoch;
        let (surface, rest) = (body.surface(), body.rest_positions());
        let place = |v: u32| surface.vertices[v as usize].position(rest);
        self.areas.clear();
        self.areas.resize(surface.vertices.len(), 0.0);
        for triangle in &surface.triangles {
            let [a, b, c] = triangle.map(place);
            let third = (b - a).cross(&(c - a)).norm() / 6.0;
            triangle.iter().for_each(|&v| self.areas[v as usize] += third);
        }
        let vertices = &surface.vertices;
        let springs = &self.springs;
        self.now.retain(|contact| {
            let known = springs.get(contact.spring as usize).map(|spring| &spring.point);
            known.is_some() && vertices.get(contact.vertex as usize) == known
        });
        let most = vertices.len() + vertices.len() / 4;
        for list in [&mut self.kept, &mut self.now] {
            list.reserve(most.saturating_sub(list.len()));
        }
        self.springs.reserve(most.saturating_sub(self.springs.len()));
    }
}

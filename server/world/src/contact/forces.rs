//! Forces of contact of the last step, gathered for those who ask: per tool, obstacle and body what it does to each
//! body, with the points of contact.

use nalgebra::Vector3;
use scindo_physics::body::{PairSpring, SpringKind};
use scindo_physics::element::MaterialPoint;

use super::Contacts;
use crate::body::SimBody;
use crate::snapshot::forces::{ForceKind, ForcePair, ForcePoint, Forces};

impl Contacts {
    /// Gathers the forces on `bodies` into `out`. `together` are the forces of the pair springs of a group, by its
    /// first body [N].
    pub fn forces_into<'a>(
        &self,
        bodies: &[SimBody],
        together: impl Fn(usize) -> &'a [Vector3<f64>],
        out: &mut Forces,
    ) {
        out.clear();
        out.asked = true;
        for (on, body) in bodies.iter().enumerate() {
            self.forces_of_tools((on, body), out);
            self.forces_of_obstacles((on, body), out);
        }
        self.forces_of_bodies(bodies, together, out);
        out.keep_strongest();
    }

    fn forces_of_tools(&self, (on, body): (usize, &SimBody), out: &mut Forces) {
        let own = &self.bodies[on];
        let x = body.body.positions();
        for by in 0..self.hands.len() as u32 {
            let each = own.springs.iter().zip(&own.behind).zip(body.body.spring_forces());
            let own = each.filter(|((_, behind), force)| behind.tool == by && force.norm_squared() > 0.0);
            let points = own.filter_map(|((spring, _), force)| {
                Some(point_of(&spring.kind, place(&spring.point, x)?, *force))
            });
            let pair = ForcePair { kind: ForceKind::Tool, on: on as u32, by, ..ForcePair::default() };
            let pair = points.clone().fold(pair, with);
            if pair.contacts > 0 {
                out.add(pair, points);
            }
        }
    }

    fn forces_of_obstacles(&self, (on, body): (usize, &SimBody), out: &mut Forces) {
        let own = &self.bodies[on];
        let forces = body.body.spring_forces().get(own.behind.len()..).unwrap_or_default();
        let x = body.body.positions();
        for (by, report) in (0u32..).zip(&own.resting.each).filter(|(_, report)| report.contacts > 0) {
            let points = own.resting.pushed().filter(|pushed| pushed.obstacle == by).filter_map(|pushed| {
                let spring = own.resting.springs().get(pushed.spring as usize)?;
                let force = forces.get(pushed.spring as usize)?;
                let point = point_of(&spring.kind, place(&spring.point, x)?, *force);
                Some(ForcePoint { depth_m: point.depth_m - pushed.lift_m, ..point })
            });
            let pair = ForcePair {
                kind: ForceKind::Obstacle,
                on: on as u32,
                by,
                contacts: report.contacts,
                deepest_m: report.deepest_m,
                force_n: report.force_n,
                normal_n: report.normal_n,
                ..ForcePair::default()
            };
            out.add(pair, points);
        }
    }

    fn forces_of_bodies<'a>(
        &self,
        bodies: &[SimBody],
        together: impl Fn(usize) -> &'a [Vector3<f64>],
        out: &mut Forces,
    ) {
        for report in self.pairs.reports() {
            let [on, by] = report.bodies;
            let first = self.pairs.group_of(on as usize);
            let member = |local: u32| {
                let members = (first..bodies.len()).filter(|&body| self.pairs.group_of(body) == first);
                members.clone().nth(local as usize).unwrap_or(first)
            };
            let each = self.pairs.springs_of(first).iter().zip(together(first));
            let points = each.filter_map(|(spring, force)| {
                let [of, against] = spring.bodies.map(member);
                let same = [of as u32, against as u32] == [on, by];
                let turned = [of as u32, against as u32] == [by, on];
                if !(same || turned) || force.norm_squared() == 0.0 {
                    return None;
                }
                let point = between(spring, [&bodies[of], &bodies[against]], *force)?;
                let (normal, tangential_n) = (-point.normal, -point.tangential_n);
                Some(if same { point } else { ForcePoint { normal, tangential_n, ..point } })
            });
            let pair = ForcePair {
                kind: if on == by { ForceKind::Itself } else { ForceKind::Body },
                on,
                by,
                contacts: report.contacts,
                deepest_m: report.deepest_m,
                force_n: report.force_n,
                normal_n: report.normal_n,
                ..ForcePair::default()
            };
            out.add(pair, points);
        }
    }
}

/// A vertex of one body against a triangle of another.
fn between(spring: &PairSpring, bodies: [&SimBody; 2], force: Vector3<f64>) -> Option<ForcePoint> {
    let x = bodies.map(|body| body.body.positions());
    let point_m = place(&spring.point, x[0])?;
    for corner in &spring.corners {
        place(corner, x[1])?;
    }
    // The plane stands in the relative position of the two.
    let at = point_of(&spring.kind, spring.relative(x), force);
    Some(ForcePoint { point_m, ..at })
}

/// Where `point` is [m]; `None` if a cut was undone since the step and its nodes are no more.
fn place(point: &MaterialPoint, x: &[Vector3<f64>]) -> Option<Vector3<f64>> {
    let known = point.copies().iter().all(|&copy| (copy as usize) < x.len());
    known.then(|| point.position(x))
}

/// The contact of a spring of this kind at `position` that gave `force`.
fn point_of(kind: &SpringKind, position: Vector3<f64>, force: Vector3<f64>) -> ForcePoint {
    let (normal, offset_m) = match *kind {
        SpringKind::OneSided { normal, offset_m } | SpringKind::Rough { normal, offset_m, .. } => {
            (normal, offset_m)
        }
        // What is held is pulled along its force.
        SpringKind::Hold { .. } => {
            let normal = force.try_normalize(0.0).unwrap_or_default();
            (normal, normal.dot(&position))
        }
    };
    let normal_n = force.dot(&normal);
    let depth_m = offset_m - normal.dot(&position);
    ForcePoint { point_m: position, normal, depth_m, normal_n, tangential_n: force - normal_n * normal }
}

/// A pair with one more point.
fn with(pair: ForcePair, point: ForcePoint) -> ForcePair {
    ForcePair {
        contacts: pair.contacts + 1,
        deepest_m: pair.deepest_m.max(point.depth_m),
        force_n: pair.force_n + point.force_n(),
        normal_n: pair.normal_n + point.normal_n,
        ..pair
    }
}

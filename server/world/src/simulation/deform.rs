//! Bodies deform: side by side, or together where they touch.

use nalgebra::Vector3;
use scindo_physics::body::{Body, Group, PointSpring, SolveReport};
use scindo_physics::team::blocks;
use smallvec::SmallVec;

use super::Simulation;
use crate::body::SimBody;
use crate::contact::Contacts;
use crate::report::BodyReport;

/// Bodies of a group for which nothing is allocated.
const USUAL: usize = 64;

/// Memory of the groups of bodies that touch: one for the first body of each.
#[derive(Debug, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct Groups(Vec<Group>);

impl Simulation {
    /// One step of every body. Bodies that touch nothing step side by side. Those that touch each other or themselves
    /// are one system each, solved by all threads.
    pub(super) fn deform(&mut self) {
        let (when, gravity) = ((self.time_s(), self.scene.step_s), self.scene.gravity_m_s2);
        let Self { bodies, lead, contacts, groups, report, phase_clock, dormant, .. } = self;
        let step = |i: usize, body: &mut SimBody, report: &mut BodyReport| {
            if dormant.is_asleep(i) || contacts.pairs().has_company(i) {
                return;
            }
            let _span = tracing::trace_span!("deform", body = %body.id).entered();
            phase_clock.start(i);
            report.solve = body.step(when, gravity, contacts.springs(i));
            phase_clock.end(i);
        };
        // Bodies of different groups act on each other through nothing but the springs, which this step finds as they
        // are.
        if let Some(lead) = lead {
            let each = (blocks(bodies, 1), blocks(&mut report.bodies, 1));
            lead.side_by_side(each, |i, (body, report)| step(i, &mut body[0], &mut report[0]));
        } else {
            let each = bodies.iter_mut().zip(&mut report.bodies).enumerate();
            each.for_each(|(i, (body, report))| step(i, body, report));
        }
        if contacts.bodies_touch() {
            for first in 0..bodies.len() {
                let pairs = contacts.pairs();
                let is_group = pairs.group_of(first) == first && pairs.has_company(first);
                if is_group && !dormant.is_asleep(first) {
                    phase_clock.start(first);
                    let group = groups.of(first);
                    together((group, first), bodies, contacts, (when, gravity), &mut report.bodies);
                    phase_clock.end(first);
                    contacts.pairs_mut().collect(first, groups.of(first).forces());
                }
            }
        }
        for (i, body) in bodies.iter_mut().enumerate().filter(|(i, _)| !dormant.is_asleep(*i)) {
            let solve = report.bodies[i].solve;
            body.has_stepped(&solve, report);
        }
        let reports = &mut self.report.bodies;
        dormant.settle(when, bodies, contacts, reports);
        self.sleep.look(self.steps, &mut self.bodies, &mut self.report);
    }
}

impl Groups {
    /// Forces of the pair springs of the last step that the group whose first body is `first` made together [N].
    pub(super) fn forces_of(&self, first: usize) -> &[Vector3<f64>] {
        self.0.get(first).map(Group::forces).unwrap_or_default()
    }

    /// The group whose first body is number `first`.
    fn of(&mut self, first: usize) -> &mut Group {
        if self.0.len() <= first {
            self.0.resize_with(first + 1, Group::default);
        }
        &mut self.0[first]
    }
}

/// One step of the group whose first body is number `first`.
fn together(
    (group, first): (&mut Group, usize),
    bodies: &mut [SimBody],
    contacts: &Contacts,
    ((time_s, h), gravity): ((f64, f64), Vector3<f64>),
    reports: &mut [BodyReport],
) {
    let _span = tracing::trace_span!("deform together", body = %bodies[first].id).entered();
    let is_in = |i: &usize| contacts.pairs().group_of(*i) == first;
    let mut members: SmallVec<[&mut Body; USUAL]> = SmallVec::new();
    let mut springs: SmallVec<[&[PointSpring]; USUAL]> = SmallVec::new();
    for (i, body) in bodies.iter_mut().enumerate().filter(|(i, _)| is_in(i)) {
        body.prescribe(time_s);
        springs.push(contacts.springs(i));
        members.push(&mut body.body);
    }
    let pairs = contacts.pairs().springs_of(first);
    let solved = group.step(&mut members, (h, gravity), &springs, pairs);
    let solved: SmallVec<[SolveReport; USUAL]> = solved.iter().copied().collect();
    drop(members);
    let of = (first..bodies.len()).filter(is_in);
    for (i, solve) in of.zip(solved) {
        reports[i].solve = bodies[i].as_it_ended(solve);
    }
}

//! Fills a snapshot with the present state of a simulation.

use scindo_physics::body::Body;

use super::deform::Groups;
use crate::body::{Probe, SimBody};
use crate::contact::Contacts;
use crate::contact::hand::Hand;
use crate::inputs::Wants;
use crate::report::{BodyReport, StepReport};
use crate::snapshot::{BodySnapshot, Snapshot, ToolSnapshot};
use crate::tool::{Tool, Tools};

/// What a snapshot is taken of.
pub(crate) struct Sources<'a> {
    pub bodies: &'a mut [SimBody],
    pub report: &'a StepReport,
    pub tools: &'a Tools,
    pub contacts: &'a Contacts,
    pub probes: &'a [Probe],
    pub groups: &'a Groups,
}

impl Sources<'_> {
    /// Fills bodies, probes and tools of `out`: of the surfaces only what `wants` says.
    pub(super) fn fill(self, wants: &Wants, out: &mut Snapshot) {
        out.bodies.resize_with(self.bodies.len(), BodySnapshot::default);
        for (i, (body, out)) in self.bodies.iter_mut().zip(&mut out.bodies).enumerate() {
            let asked = |flags: &[bool]| flags.get(i).copied().unwrap_or(false);
            let (surface, report) = (wants.contact || asked(&wants.surface), &self.report.bodies[i]);
            fill_body(out, body, report, surface, wants.contact);
            out.stress.clear();
            if asked(&wants.stress) {
                out.topology = body.topology();
                body.surface_stress(&mut out.stress);
            }
            out.young_pa = self.contacts.young_pa(i);
            out.viscosity_s = body.body.material().rayleigh.stiffness_s;
            out.energy = wants.measures.then(|| report.energy.unwrap_or_else(|| body.energy()));
        }
        out.probes.clear();
        if wants.measures {
            let position = |probe: &Probe| probe.position(self.bodies[probe.body].body.positions());
            out.probes.extend(self.probes.iter().map(position));
        }
        out.forces.clear();
        if wants.forces {
            let together = |first: usize| self.groups.forces_of(first);
            self.contacts.forces_into(self.bodies, together, &mut out.forces);
        }
        out.tools.resize_with(self.tools.len(), ToolSnapshot::default);
        for (i, (tool, out)) in self.tools.iter().zip(&mut out.tools).enumerate() {
            fill_tool(out, tool, self.contacts.hand(i));
        }
    }
}

fn fill_body(
    out: &mut BodySnapshot,
    body: &mut SimBody,
    report: &BodyReport,
    surface: bool,
    velocities: bool,
) {
    if out.id != body.id {
        out.id = body.id.clone();
    }
    out.epoch = body.shown_epoch();
    out.iterations = report.solve.iterations;
    out.residual = if report.solve.residual.is_finite() { report.solve.residual } else { f64::MAX };
    out.tolerance = report.solve.tolerance;
    out.unconverged = report.solve.is_unconverged();
    out.inverted = u32::try_from(report.solve.inverted_pieces).unwrap_or(u32::MAX);
    out.counts = body.counts();
    out.fixed_iterations = body.fixed_iterations;
    out.elements = body.body.n_elements() as u32;
    out.pieces = body.body.n_pieces() as u32;
    out.copies = body.body.rest_positions().len() as u32;
    out.adapted = body.adapt_counts().unwrap_or_default();
    out.rest_volume_m3 = body.rest_volume_m3;
    out.positions.clear();
    out.marks.clear();
    out.velocities.clear();
    if surface {
        out.topology = body.topology();
        out.texture.clone_from(&body.texture);
        out.positions.extend_from_slice(body.surface_positions());
        hide_sleepers(&body.body, &mut out.positions);
        body.incision_marks(&mut out.marks);
    }
    if velocities {
        body.surface_velocities(&mut out.velocities);
    }
}

/// Vertices of parts that sleep far away are put where the body was, so that no view looks for them; no
/// triangle of the topology is on them.
fn hide_sleepers(body: &Body, positions: &mut [[f32; 3]]) {
    if !body.sleeps() {
        return;
    }
    let place = body.rest_positions().first().map_or([0.0; 3], |x| [x.x as f32, x.y as f32, x.z as f32]);
    for (position, vertex) in positions.iter_mut().zip(&body.surface().vertices) {
        if body.is_asleep(vertex.copies()[0]) {
            *position = place;
        }
    }
}

fn fill_tool(out: &mut ToolSnapshot, tool: &Tool, hand: Option<&Hand>) {
    if out.id != tool.id {
        out.id = tool.id.clone();
    }
    if out.owner != tool.owner {
        out.owner = tool.owner.clone();
    }
    out.shape = tool.shape;
    out.pose = tool.pose;
    out.proxy = hand.map_or(tool.pose, |hand| *hand.proxy_pose());
    out.velocity_m_s = tool.velocity_m_s;
    out.mode = tool.mode;
    out.closed = hand.map_or(tool.closed, |hand| hand.closed(tool));
    (out.force_n, out.friction_n, out.friction) = (tool.force_n, tool.friction_n, tool.friction);
    out.limbs.clear();
    out.limbs.extend(hand.into_iter().flat_map(|hand| hand.limbs_of(tool)));
    out.stiffness_n_m = tool.stiffness_n_m;
    out.contact_stiffness_n_m =
        hand.map_or(tool.stiffness_n_m, |hand| hand.in_series_with(tool.stiffness_n_m));
    out.tissue = hand.and_then(Hand::tissue);
    out.max_force_n = tool.max_force_n;
    let edge = hand.and_then(Hand::edge).unwrap_or_default();
    out.resistance_n = edge.resistance_n;
    if edge.loaded > 0.0 {
        out.contact_stiffness_n_m = tool.stiffness_n_m * edge.loaded;
    }
    out.held_m = hand.and_then(Hand::held_point);
    out.seq = tool.seq;
    out.client_time_ns = tool.client_time_ns;
}

//! Cells that follow the tools: before contact is looked for, bodies adapt their cells.

use nalgebra::Vector3;

use super::Simulation;
use crate::inputs::MAX_TOOLS;
use crate::report::Level;
use crate::tool::Tools;
use crate::tool::geometry::core;

/// Most points that stand for a tool.
const MAX_POINTS: usize = 32;

/// Places of tools [m], for bodies that adapt to them. No memory is taken before one does.
#[derive(Debug, Default)]
pub(crate) struct ToolPlaces(Vec<Vector3<f64>>);

impl ToolPlaces {
    /// Points along the cores of all tools that somebody holds, no farther apart than `spacing_m` while that
    /// takes at most [`MAX_POINTS`] for a tool.
    fn fill(&mut self, tools: &Tools, spacing_m: f64) {
        self.0.clear();
        self.0.reserve(MAX_TOOLS * MAX_POINTS);
        for tool in tools.iter().filter(|tool| !tool.owner.is_empty()) {
            let [tip, heel] = core(tool.shape, &tool.pose);
            let parts = ((heel - tip).norm() / spacing_m).ceil().clamp(0.0, (MAX_POINTS - 1) as f64);
            self.0.push(tip);
            (1..=parts as usize).for_each(|i| self.0.push(tip.lerp(&heel, i as f64 / parts)));
        }
    }
}

impl Simulation {
    /// Divides and joins cells of the bodies whose scene asks for it.
    pub(super) fn adapt(&mut self) {
        let Self { bodies, tools, tool_places, report, probes, steps, .. } = self;
        for (i, body) in bodies.iter_mut().enumerate() {
            let Some(adaptation) = body.adaptation() else { continue };
            tool_places.0.clear();
            if let Some(near_m) = adaptation.near_m(*steps) {
                tool_places.fill(tools, near_m);
            }
            let done = body.adapt(*steps, &tool_places.0).unwrap_or_else(|error| {
                report.tell(Level::Error, "adaptation-refused", &body.id, error.to_string());
                Default::default()
            });
            report.bodies[i].adapted = done;
            if done.has_changed() {
                let of_body = probes.iter_mut().filter(|probe| probe.body == i);
                of_body.for_each(|probe| probe.follow(&body.body));
            }
        }
    }
}

//! Parts that fall for ever are put to sleep.

use nalgebra::Vector3;

use crate::body::SimBody;
use crate::report::{Level, StepReport};

/// Every so many steps somebody looks.
const EVERY: u64 = 25;

/// A part sleeps when it is so many diagonals of the scene away from it.
const FAR: f64 = 5.0;

/// What the scene takes up, where something in it is held.
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct Sleep {
    /// Corners of the box around all bodies at rest [m]; none where nothing is held: then falling is what
    /// the scene is about.
    scene: Option<[Vector3<f64>; 2]>,
    centres: Vec<Vector3<f64>>,
}

impl Sleep {
    pub(super) fn new(bodies: &[SimBody]) -> Self {
        let held = bodies.iter().any(|body| !body.body.fixed_nodes().is_empty());
        let mut points = bodies.iter().flat_map(|body| body.body.rest_positions());
        let first = points.next().copied().filter(|_| held);
        let scene = first
            .map(|first| points.fold([first; 2], |[low, high], point| [low.inf(point), high.sup(point)]));
        Self { scene, centres: Vec::new() }
    }

    /// Puts parts to sleep that are far from the scene, and tells so.
    pub(super) fn look(&mut self, step: u64, bodies: &mut [SimBody], report: &mut StepReport) {
        let Some([low, high]) = self.scene.filter(|_| step.is_multiple_of(EVERY)) else { return };
        let far_m = FAR * (high - low).norm();
        for body in bodies.iter_mut().filter(|body| body.body.parts().any_free()) {
            body.body.part_centres(&mut self.centres);
            let mut slept = 0;
            for (part, centre) in self.centres.iter().enumerate() {
                let beside = (low - centre).sup(&(centre - high)).sup(&Vector3::zeros());
                // Holding a part leaves the numbers of the others as they are.
                if beside.norm() > far_m && body.body.put_to_sleep(part) {
                    slept += 1;
                }
            }
            if slept > 0 {
                body.has_changed_topology();
                let parts = if slept == 1 { "1 part".into() } else { format!("{slept} parts") };
                let message = format!(
                    "{parts} that nothing holds fell more than {far_m:.2} m away from the scene and stay there, \
                     out of view, until a reset"
                );
                report.tell(Level::Warning, "part-asleep", &body.id, message);
            }
        }
    }
}

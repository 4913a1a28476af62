//! The springs of a step that can be used, and room for what is kept per spring.

use nalgebra::Vector3;

use super::springs::ActiveSpring;
use super::step_inputs::StepInputs;

/// Springs for which room is made when the first one acts: those of a ball that bears with all its points. A press that
/// deepens then takes no memory.
const SPRING_ROOM: usize = 64;

/// Makes room in `list` for `each` entries per spring, if there are any springs.
pub(super) fn make_room<T>(list: &mut Vec<T>, springs: usize, each: usize) {
    if springs > 0 {
        list.reserve((each * SPRING_ROOM).saturating_sub(list.len()));
    }
}

/// The springs of a step that can be used.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct ActiveSprings {
    /// Usable springs.
    pub springs: Vec<ActiveSpring>,
    /// Which springs of the inputs these are.
    accepted: Vec<bool>,
}

impl ActiveSprings {
    /// Takes the springs of `inputs`, whose points are at `x` [m] now.
    pub(super) fn begin(&mut self, inputs: &StepInputs<'_>, x: &[Vector3<f64>]) {
        self.springs.clear();
        self.accepted.clear();
        make_room(&mut self.springs, inputs.springs.len(), 1);
        make_room(&mut self.accepted, inputs.springs.len(), 1);
        for spring in inputs.springs {
            let active = ActiveSpring::new(spring, x);
            self.accepted.push(active.is_some());
            self.springs.extend(active);
        }
    }

    /// Number of springs that were left out.
    pub(super) fn refused(&self) -> usize {
        self.accepted.len() - self.springs.len()
    }

    /// Writes the force of every spring in the order of the inputs; 0 for those that were left out.
    pub(super) fn write(&self, forces: &mut [Vector3<f64>], force: impl Fn(&ActiveSpring) -> Vector3<f64>) {
        let mut active = self.springs.iter();
        for (out, &accepted) in forces.iter_mut().zip(&self.accepted) {
            let spring = if accepted { active.next() } else { None };
            *out = spring.map_or_else(Vector3::zeros, &force);
        }
    }
}

//! A second simulation that follows the states of a first one, so that the two can be compared step by step.

use scindo_physics::body::BodyError;

use super::Simulation;
use crate::body::SimBody;

impl Simulation {
    /// Goes on from the positions and velocities that `other` has now, at its time. Contacts, tools and solvers keep
    /// what they remember. False, and nothing has changed, if the bodies differ in number or in their nodes, as they
    /// do when only one of the two was cut or adapted.
    ///
    /// # Errors
    /// A state that is not finite.
    pub fn take_state_of(&mut self, other: &Simulation) -> Result<bool, BodyError> {
        let alike = |(mine, theirs): (&SimBody, &SimBody)| {
            mine.body.n_copies() == theirs.body.n_copies()
                && mine.body.rest_positions() == theirs.body.rest_positions()
        };
        if self.bodies.len() != other.bodies.len() || !self.bodies.iter().zip(&other.bodies).all(alike) {
            return Ok(false);
        }
        for (mine, theirs) in self.bodies.iter_mut().zip(&other.bodies) {
            mine.body.set_state(theirs.body.positions(), theirs.body.velocities())?;
        }
        self.steps = other.steps;
        Ok(true)
    }
}

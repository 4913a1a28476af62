//! Which threads work on which body.
//!
//! A single body has all threads to itself. Several bodies share one set of threads, on which they are stepped
//! side by side.

use scindo_physics::body::{BodyError, BodySettings};
use scindo_physics::material::Law;
use scindo_physics::team::{Lead, Team};

use crate::body::SimBody;

/// Threads that a body starts when it is made, in a scene of `bodies` bodies.
pub(super) fn of_one_body(bodies: usize, threads: usize) -> usize {
    if bodies > 1 { 1 } else { threads }
}

/// Puts several bodies on one set of threads. `None` if there is nothing to share: one body, or one thread.
///
/// # Errors
/// A number of threads out of range, or threads that cannot be started.
pub(super) fn share(bodies: &mut [SimBody], threads: usize) -> Result<Option<Lead>, BodyError> {
    if bodies.len() < 2 {
        return Ok(None);
    }
    BodySettings { threads, ..BodySettings::default() }.check(Law::Linear)?;
    if threads == 1 {
        return Ok(None);
    }
    let sizes: Vec<usize> = bodies.iter().map(|body| body.body.rest_positions().len()).collect();
    let (lead, teams) = Team::sharing(threads, &sizes).map_err(BodyError::Threads)?;
    for (body, team) in bodies.iter_mut().zip(teams) {
        body.body.set_team(team);
    }
    Ok(Some(lead))
}

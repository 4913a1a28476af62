//! Doubts about a built scene: what is allowed but hardly meant. Each is one sentence that says where, what,
//! and what to do about it.
//!
//! Nothing is solved here; what takes steps to find out is left to the forecast.

mod held;

mod cuts;

mod meshes;

mod tools;

mod touch;

mod world;

use crate::body::{SimBody, bounds};
use crate::scene::CheckedScene;
use crate::tool::obstacle::Obstacle;

pub use cuts::after_the_end;
pub(crate) use meshes::EMPTY_REGION;

/// All doubts, in the order of the scene.
pub(crate) fn of(scene: &CheckedScene, bodies: &mut [SimBody], obstacles: &[Obstacle]) -> Vec<String> {
    let mut doubts = Vec::new();
    world::doubts(scene, bodies, &mut doubts);
    for (spec, body) in scene.bodies.iter().zip(&*bodies) {
        meshes::doubts(spec, body, &mut doubts);
        let carried = touch::may_be_carried(scene, body, obstacles);
        held::doubts(scene, (spec, carried), body, &mut doubts);
    }
    cuts::doubts(&scene.cuts, bodies, &mut doubts);
    tools::doubts(&scene.tools, bodies, &mut doubts);
    touch::doubts(scene, (bodies, obstacles), &mut doubts);
    doubts
}

/// Longest side of the box around a body [m].
fn longest_side(body: &SimBody) -> f64 {
    let (low, high) = bounds(body.body.rest_positions());
    (high - low).max()
}

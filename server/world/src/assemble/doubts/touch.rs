//! Bodies that begin in each other or in an obstacle, and what carries a body that nothing holds.

use scindo_collision::SurfaceBvh;

use crate::body::SimBody;
use crate::quantity::percent;
use crate::scene::CheckedScene;
use crate::tool::obstacle::Obstacle;

/// Share of a body's surface vertices that may begin inside something.
const TOUCHING: f64 = 0.01;
/// Depth of a vertex that counts as inside, in cells.
const INSIDE_CELLS: f64 = 0.05;
/// How far a falling body is followed [m].
const FALL_M: f64 = 1e3;

/// Whether something that the body touches may stop its fall.
pub(super) fn may_be_carried(scene: &CheckedScene, body: &SimBody, obstacles: &[Obstacle]) -> bool {
    let touches = scene.effects.body_collision == Some(true) && scene.bodies.len() > 1;
    let Some(down) = scene.gravity_m_s2.try_normalize(0.0) else { return touches };
    let (low, high) = crate::body::bounds(body.body.rest_positions());
    let centre = (low + high) / 2.0;
    let stops = |obstacle: &Obstacle| obstacle.shape.meet(centre, centre + FALL_M * down, 0.0).is_some();
    touches || (scene.effects.obstacles != Some(false) && obstacles.iter().any(stops))
}

/// Says which bodies begin in each other or in an obstacle.
pub(super) fn doubts(
    scene: &CheckedScene,
    (bodies, obstacles): (&mut [SimBody], &[Obstacle]),
    doubts: &mut Vec<String>,
) {
    let obstacles = if scene.effects.obstacles == Some(false) { &[] } else { obstacles };
    for body in bodies.iter_mut() {
        let depth = INSIDE_CELLS * body.cell_m();
        for obstacle in obstacles {
            let inside = |x: &[f32; 3]| {
                let at = (*x).map(f64::from).into();
                obstacle.shape.nearest(at, depth).is_some_and(|place| place.distance < -depth)
            };
            let share = share(body.surface_positions(), inside);
            if share > TOUCHING {
                let (id, name, part) = (&body.id, &obstacle.id, percent(share));
                doubts.push(format!(
                    "body.{id}: {part} of its surface begins inside the obstacle `{name}`, which pushes it out in the \
                     first steps; move one of them"
                ));
            }
        }
    }
    if scene.effects.body_collision != Some(true) {
        return;
    }
    let trees: Vec<Option<SurfaceBvh>> = bodies
        .iter_mut()
        .map(|body| {
            let (body, positions) = body.surface_now();
            SurfaceBvh::new(positions, &body.surface().triangles).ok()
        })
        .collect();
    for a in 0..bodies.len() {
        for (b, tree) in trees.iter().enumerate().filter(|(b, _)| *b != a) {
            let Some(tree) = tree else { continue };
            let depth = INSIDE_CELLS * bodies[a].cell_m();
            let inside = |x: &[f32; 3]| {
                let at = (*x).map(f64::from).into();
                tree.contains(at) && tree.closest_point(at, depth).is_none()
            };
            let share = share(bodies[a].surface_positions(), inside);
            if share > TOUCHING {
                let (id, other, part) = (&bodies[a].id, &bodies[b].id, percent(share));
                doubts.push(format!(
                    "body.{id}: {part} of its surface begins inside `{other}`; bodies that begin in each other are \
                     torn apart or stay stuck. Move one of them"
                ));
            }
        }
    }
}

fn share(positions: &[[f32; 3]], inside: impl Fn(&[f32; 3]) -> bool) -> f64 {
    positions.iter().filter(|x| inside(x)).count() as f64 / positions.len().max(1) as f64
}

//! Obstacles, and bodies that touch bodies.

use nalgebra::Vector3;

use super::super::checked::{BodySpec, ObstacleSpec, Solid};
use super::super::raw::{RawIntegrator, RawObstacle};
use super::Check;

impl Check<'_> {
    /// One obstacle; the schema has seen to it that it has exactly one shape.
    pub(super) fn obstacle(&mut self, obstacle: &RawObstacle) -> ObstacleSpec {
        let at = format!("obstacle.{}", obstacle.id);
        let solid = self.solid(&at, obstacle);
        let RawObstacle { id, friction, stiffness, .. } = obstacle;
        ObstacleSpec { id: id.clone(), solid, friction: *friction, stiffness: *stiffness }
    }

    /// Bodies that touch are solved together, which needs steps by linear solves.
    pub(super) fn touch(&mut self, bodies: &[BodySpec]) {
        let effects = &self.raw.effects;
        let wanted = [("body_collision", effects.body_collision), ("self_collision", effects.self_collision)];
        for (effect, _) in wanted.into_iter().filter(|(_, on)| *on == Some(true)) {
            for body in bodies {
                let mechanics = &body.mechanics;
                let why =
                    if mechanics.integrator.is_explicit() || mechanics.integrator == RawIntegrator::Static {
                        Some("an implicit integrator of motion")
                    } else if body.octree.is_some_and(|octree| octree.simulate_level > 0) {
                        Some("octree.simulate_level = 0")
                    } else if mechanics.sub_steps > 1 {
                        Some("sub_steps = 1")
                    } else if !mechanics.constitutive_law().is_hookean() {
                        Some("the law linear or corotational")
                    } else {
                        mechanics.why_general().map(|_| "steps by linear solves in single precision")
                    };
                let Some(needed) = why else { continue };
                let what = format!("bodies that touch need {needed}, which body `{}` does not have", body.id);
                let next = match mechanics.why_general() {
                    Some(why) => format!("change it ({why}), or remove the effect"),
                    None => "change it, or remove the effect".into(),
                };
                self.conflict(format!("effects.{effect}"), what, &next);
            }
        }
    }

    fn solid(&mut self, at: &str, obstacle: &RawObstacle) -> Solid {
        if let Some(half) = &obstacle.half_space {
            let normal = self.direction(&format!("{at}.half_space.normal"), half.normal);
            return Solid::HalfSpace { point_m: Vector3::from(half.point_m), normal };
        }
        if let Some(block) = &obstacle.r#box {
            self.rising_corners(&format!("{at}.box"), block.min_m, block.max_m, true);
            return Solid::Box { min_m: Vector3::from(block.min_m), max_m: Vector3::from(block.max_m) };
        }
        if let Some(surface) = &obstacle.surface {
            let (path, at_m) = (surface.file.clone(), Vector3::from(surface.at_m));
            return Solid::Surface { path, scale: surface.scale, at_m };
        }
        if let Some(ball) = &obstacle.sphere {
            return Solid::Capsule { ends_m: [Vector3::from(ball.centre_m); 2], radius_m: ball.radius_m };
        }
        let (ends, radius_m) =
            obstacle.capsule.as_ref().map_or(([[0.0; 3]; 2], 1.0), |c| (c.ends_m, c.radius_m));
        Solid::Capsule { ends_m: ends.map(Vector3::from), radius_m }
    }
}

//! Obstacles.

use nalgebra::Vector3;

use super::super::checked::{ObstacleSpec, Solid};
use super::super::raw::RawObstacle;
use super::Check;

impl Check<'_> {
    /// One obstacle; the schema has seen to it that it has exactly one shape.
    pub(super) fn obstacle(&mut self, obstacle: &RawObstacle) -> ObstacleSpec {
        let at = format!("obstacle.{}", obstacle.id);
        let solid = self.solid(&at, obstacle);
        let RawObstacle { id, friction, stiffness, .. } = obstacle;
        ObstacleSpec { id: id.clone(), solid, friction: *friction, stiffness: *stiffness }
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

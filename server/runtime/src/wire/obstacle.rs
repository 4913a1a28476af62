//! Obstacles for viewers.

use bytes::{BufMut, BytesMut};
use nalgebra::Vector3;
use scindo_proto::limits::MAX_OBSTACLE_TRIANGLES;
use scindo_proto::messages::{ObstacleInfo, obstacle_info as wire};
use scindo_world::tool::obstacle::{Obstacle, Shape};

use super::convert::to_vec3;

/// Converts obstacles. Surfaces that together have more triangles than may be sent are left empty.
pub fn to_obstacles(obstacles: &[Obstacle]) -> Vec<ObstacleInfo> {
    let mut left = MAX_OBSTACLE_TRIANGLES;
    obstacles.iter().map(|obstacle| to_obstacle(obstacle, &mut left)).collect()
}

fn to_obstacle(obstacle: &Obstacle, left: &mut usize) -> ObstacleInfo {
    let vec3 = |v: &Vector3<f64>| Some(to_vec3(v));
    let shape = match &obstacle.shape {
        Shape::HalfSpace { point, normal } => {
            wire::Shape::HalfSpace(wire::HalfSpace { point_m: vec3(point), normal: vec3(normal) })
        }
        Shape::Box { min, max } => wire::Shape::Box(wire::Box { min_m: vec3(min), max_m: vec3(max) }),
        Shape::Capsule { ends, radius } => wire::Shape::Capsule(wire::Capsule {
            from_m: vec3(&ends[0]),
            to_m: vec3(&ends[1]),
            radius_m: *radius,
        }),
        Shape::Surface(surface) => {
            let fits = surface.triangle_count().max(surface.vertex_count()) <= *left;
            if !fits {
                let (id, triangles) = (&obstacle.id, surface.triangle_count());
                tracing::warn!(%id, triangles, "the obstacle has too many triangles to be shown");
            }
            *left -= if fits { surface.triangle_count().max(surface.vertex_count()) } else { 0 };
            wire::Shape::Surface(if fits {
                to_surface(surface.positions(), surface.triangles())
            } else {
                wire::Surface::default()
            })
        }
    };
    ObstacleInfo { id: obstacle.id.clone(), shape: Some(shape) }
}

fn to_surface(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> wire::Surface {
    let (mut at, mut corners) = (BytesMut::new(), BytesMut::new());
    positions.iter().flatten().for_each(|&x| at.put_f32_le(x));
    triangles.iter().flatten().for_each(|&v| corners.put_u32_le(v));
    wire::Surface { positions: at.freeze(), triangles: corners.freeze() }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use scindo_proto::WireMessage;
    use scindo_proto::messages::SessionInfo;
    use scindo_world::scene::Scene;
    use scindo_world::simulation::Simulation;

    use super::*;

    #[test]
    fn every_shape_is_sent_and_a_surface_whole_or_not_at_all() {
        let dir = tempfile::tempdir().unwrap();
        let rock = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
        std::fs::write(dir.path().join("rock.obj"), rock).unwrap();
        let shapes = [
            "half_space = { point_m = [0, 0, 0], normal = [0, 0, 2] }",
            "box = { min_m = [0, 0, 0], max_m = [1, 1, 1] }",
            "sphere = { centre_m = [0, 0, 0], radius_m = 1 }",
            "surface = { file = \"rock.obj\" }",
        ];
        let obstacle = |(i, shape): (usize, &&str)| format!("[[obstacle]]\nid = \"o{i}\"\n{shape}\n");
        let text: String = shapes.iter().enumerate().map(obstacle).collect();
        let scene = Scene::from_toml(&format!("schema = 1\n{text}")).unwrap();
        let sim = Simulation::new(&scene, dir.path()).unwrap();
        let obstacles = to_obstacles(sim.obstacles());
        assert_eq!(obstacles.len(), 4);
        let sent = |left: usize| match to_obstacle(&sim.obstacles()[3], &mut { left }).shape {
            Some(wire::Shape::Surface(found)) => (found.positions.len(), found.triangles.len()),
            other => panic!("{other:?}"),
        };
        assert_eq!((sent(4), sent(3)), ((48, 48), (0, 0)));
        let info = SessionInfo { obstacles, step_s: 0.01, ..SessionInfo::default() };
        info.check().unwrap();
    }
}

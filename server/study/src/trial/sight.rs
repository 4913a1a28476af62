//! What the regions of a scene hold and load on a mesh: number of nodes, area and volume.

use scindo_physics::body::Body;
use scindo_world::body::region::select;
use scindo_world::scene::Region;
use scindo_world::simulation::Simulation;
use serde::{Deserialize, Serialize};

/// The extent of a region on a mesh. Only whole elements and faces count.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Sight {
    /// Key of the region, such as `body.liver.fix.0`.
    pub region: String,
    /// Number of nodes in the region.
    pub nodes: usize,
    /// Area of the boundary faces whose nodes all lie in the region [m²].
    pub area_m2: f64,
    /// Volume of the elements whose nodes all lie in the region [m³].
    pub volume_m3: f64,
}

/// A relative change of a region from mesh to mesh below this is not reported.
pub const SAME: f64 = 0.02;

impl Sight {
    /// Largest relative change of area or volume between two meshes.
    fn change(&self, other: &Sight) -> f64 {
        let relative = |a: f64, b: f64| if a.max(b) > 0.0 { (a - b).abs() / a.max(b) } else { 0.0 };
        // The volume of a thin layer of whole elements says little. The area is then sufficient.
        if self.area_m2.min(other.area_m2) > 0.0 {
            relative(self.area_m2, other.area_m2)
        } else {
            relative(self.volume_m3, other.volume_m3)
        }
    }
}

/// The region that changes most between two meshes, and its change. Both lists belong to one scene.
pub fn largest_change<'a>(a: &'a [Sight], b: &'a [Sight]) -> Option<(&'a Sight, &'a Sight, f64)> {
    let changes = a.iter().zip(b).map(|(x, y)| (x, y, x.change(y)));
    changes.max_by(|x, y| x.2.total_cmp(&y.2))
}

/// The extent of all regions of a scene on its meshes.
pub fn look(simulation: &Simulation) -> Vec<Sight> {
    let mut seen = Vec::new();
    for (spec, body) in simulation.scene().bodies.iter().zip(simulation.bodies()) {
        let fixes = spec.fixes.iter().enumerate().map(|(i, fix)| (format!("fix.{i}"), &fix.region));
        let loads = spec.loads.iter().enumerate().map(|(i, load)| (format!("load.{i}"), &load.region));
        for (key, region) in fixes.chain(loads) {
            seen.push(measure(&body.body, format!("body.{}.{key}", spec.id), region));
        }
    }
    seen
}

fn measure(body: &Body, key: String, region: &Region) -> Sight {
    let rest = &body.rest_positions()[..body.n_copies()];
    let nodes = select(rest, body.bounds(), region);
    let mut inside = vec![false; rest.len()];
    nodes.iter().for_each(|n| inside[*n as usize] = true);
    let mut volume_m3 = 0.0;
    body.for_pieces(&mut |_, copies, volumes| {
        if copies.iter().all(|&copy| inside[copy as usize]) {
            volume_m3 += volumes.iter().sum::<f64>();
        }
    });
    let boundary = body.element_surface();
    let vertex = |v: u32| &boundary.vertices[v as usize];
    let whole = |face: &&[u32; 3]| face.iter().all(|&v| vertex(v).carriers().all(|(copy, _)| inside[copy]));
    let area = |face: &[u32; 3]| {
        let [a, b, c] = face.map(|v| vertex(v).position(rest));
        0.5 * (b - a).cross(&(c - a)).norm()
    };
    let area_m2 = boundary.triangles.iter().filter(whole).map(area).sum();
    Sight { region: key, nodes: nodes.len(), area_m2, volume_m3 }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use scindo_world::scene::Scene;
    use std::path::Path;

    fn seen(cells: usize) -> Vec<Sight> {
        let scene = Scene::from_toml(&format!(
            "schema = 1\n[[body]]\nid = \"b\"\nyoung_pa = 1e5\npoisson = 0.3\ndensity_kg_m3 = 1000\n\
             mesh = {{ box = {{ min_m = [0,0,0], max_m = [1,1,1], cells = [{cells},4,4] }} }}\n\
             [[body.fix]]\nwhere = {{ box = {{ min_m = [-1,-1,-1], max_m = [0.3,2,2] }} }}\n\
             [[body.load]]\nwhere = {{ slab = {{ axis = \"z\", from = 1, to = 1 }} }}\nforce_n = [0,0,1]"
        ))
        .unwrap();
        look(&Simulation::new(&scene, Path::new("")).unwrap())
    }

    #[test]
    fn areas_and_volumes_of_regions() {
        let (four, ten) = (seen(4), seen(10));
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
        near(four[0].volume_m3, 0.25);
        near(ten[0].volume_m3, 0.3);
        near(four[1].area_m2, 1.0);
        assert_eq!((four[1].volume_m3, four[1].nodes), (0.0, 25));
        let (held, _, change) = largest_change(&four, &ten).unwrap();
        assert_eq!(held.region, "body.b.fix.0");
        // Its faces: one side and four strips.
        near(change, (1.0 + 4.0 * 0.3 - 2.0) / 2.2);
    }
}

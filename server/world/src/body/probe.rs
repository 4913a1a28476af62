//! Probes: material points whose positions are recorded.
//!
//! A probe is located at rest. On a cut, `side` selects its lip: the one next to the point in that direction.

use nalgebra::Vector3;
use scindo_collision::{barycentric_point, closest_point_on_triangle};
use scindo_physics::body::Body;
use scindo_physics::space::RestPoint;

/// A material point that is recorded.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Probe {
    /// Name in the scene and in the records.
    pub id: String,
    /// Index of the body, in the order of the scene.
    pub body: usize,
    /// Rest position [m].
    pub rest_m: Vector3<f64>,
    /// Where the body finds it again after cuts.
    point: RestPoint,
    /// The copies (and further nodes of the element) that carry it, with their shape functions at the point.
    /// They change with the topology.
    pub carriers: Vec<(u32, f64)>,
}

/// A point that lies in no element, and its distance from the body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outside {
    /// The nearest point of the boundary [m].
    pub nearest_m: Vector3<f64>,
    /// Distance of the point from it [m].
    pub distance_m: f64,
}

impl Probe {
    /// Binds a point to the uncut body.
    ///
    /// # Errors
    /// The nearest point of the boundary, if the point lies in no element.
    pub fn bind(
        id: &str,
        body: usize,
        of: &Body,
        rest_m: Vector3<f64>,
        side: Option<Vector3<f64>>,
    ) -> Result<Self, Outside> {
        let mut point = of.locate(rest_m, side).ok_or_else(|| nearest(of, rest_m))?;
        let carriers = of.carriers(&mut point);
        Ok(Self { id: id.to_owned(), body, rest_m, point, carriers })
    }

    /// Updates the probe after a change of topology: takes the copies that now carry the point.
    pub fn follow(&mut self, of: &Body) {
        self.carriers = of.carriers(&mut self.point);
    }

    /// Present position [m] at the node positions `x`.
    pub fn position(&self, x: &[Vector3<f64>]) -> Vector3<f64> {
        self.carriers.iter().map(|(node, weight)| x[*node as usize] * *weight).sum()
    }
}

fn nearest(body: &Body, point: Vector3<f64>) -> Outside {
    let (surface, rest) = (body.element_surface(), body.rest_positions());
    let vertices: Vec<Vector3<f64>> = surface.vertices.iter().map(|v| v.position(rest)).collect();
    let mut best = Outside { nearest_m: point, distance_m: f64::INFINITY };
    for triangle in &surface.triangles {
        let triangle = triangle.map(|v| vertices[v as usize]);
        let candidate = barycentric_point(&triangle, closest_point_on_triangle(point, &triangle));
        let distance_m = (candidate - point).norm();
        if distance_m < best.distance_m {
            best = Outside { nearest_m: candidate, distance_m };
        }
    }
    best
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use scindo_physics::body::{BodySettings, ElementKind};
    use scindo_physics::material::{Law, Material, Rayleigh};
    use scindo_physics::mesh::{BoxPattern, box_hexes, box_mesh};

    fn block_of(element: ElementKind) -> Body {
        let law = Law::Corotational;
        let (young_pa, poisson, density_kg_m3) = (1e5, 0.3, 1e3);
        let material = Material { young_pa, poisson, density_kg_m3, rayleigh: Rayleigh::default(), law };
        let settings = BodySettings { element, ..BodySettings::default() };
        let (low, high, cells) = (Vector3::zeros(), Vector3::repeat(1.0), [2, 2, 2]);
        match element {
            ElementKind::Hex8 => Body::hex8(box_hexes(low, high, cells), material, settings).unwrap(),
            _ => Body::new(box_mesh(low, high, cells, BoxPattern::Tet6), material, settings).unwrap(),
        }
    }

    fn block() -> Body {
        block_of(ElementKind::Tet4)
    }

    #[test]
    fn a_probe_reproduces_its_point() {
        let point = Vector3::new(0.3, 0.7, 0.2);
        // A field that the element holds exactly, whatever its degree below 2.
        let moved = |x: &Vector3<f64>| Vector3::new(x.x + 0.1 * x.y * x.z, x.y, x.z);
        for element in [ElementKind::Tet4, ElementKind::Tet10, ElementKind::Hex8] {
            let body = block_of(element);
            let probe = Probe::bind("p", 0, &body, point, None).unwrap();
            assert!((probe.position(body.rest_positions()) - point).norm() < 1e-14, "{element:?}");
            let x: Vec<Vector3<f64>> = body.rest_positions().iter().map(moved).collect();
            let exact = element != ElementKind::Tet4;
            assert_eq!((probe.position(&x) - moved(&point)).norm() < 1e-14, exact, "{element:?}");
        }
    }

    #[test]
    fn side_chooses_the_element_where_the_point_lies_between_two() {
        let (body, point) = (block(), Vector3::new(0.25, 0.25, 0.5));
        let mesh = body.tets().unwrap().mesh();
        let centre_z = |side: Vector3<f64>| {
            let probe = Probe::bind("p", 0, &body, point, Some(side)).unwrap();
            assert!((probe.position(&mesh.nodes) - point).norm() < 1e-14);
            mesh.corners(probe.point.element as usize).iter().map(|x| x.z).sum::<f64>() / 4.0
        };
        assert!(centre_z(Vector3::z()) > 0.5 && centre_z(-Vector3::z()) < 0.5);
    }

    #[test]
    fn a_point_outside_is_told_the_nearest_point() {
        let outside = Probe::bind("p", 0, &block(), Vector3::new(0.5, 0.4, 1.5), None).unwrap_err();
        assert!((outside.nearest_m - Vector3::new(0.5, 0.4, 1.0)).norm() < 1e-12);
        assert!((outside.distance_m - 0.5).abs() < 1e-12);
        let corner = Probe::bind("p", 0, &block(), Vector3::new(2.0, 2.0, 2.0), None).unwrap_err();
        assert!((corner.nearest_m - Vector3::repeat(1.0)).norm() < 1e-12);
    }
}

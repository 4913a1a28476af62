//! Probes: material points whose positions are recorded.
//!
//! A probe is bound to an element and barycentric coordinates at rest. On a cut, `side` selects its piece:
//! the one next to the point in that direction.

use nalgebra::{Matrix3, Vector3};
use scindo_collision::{barycentric_point, closest_point_on_triangle};
use scindo_physics::body::Body;
use scindo_physics::mesh::TetMesh;

/// Distance, relative to the element, by which a point is moved towards its side before its piece is looked
/// up.
/// Far above rounding, far below any piece that can be seen.
const SIDE_STEP: f64 = 1e-6;

/// Distance outside an element at which a point still counts as inside, in barycentric units.
const INSIDE: f64 = 1e-9;

/// A material point that is recorded.
#[derive(Debug, Clone, PartialEq)]
pub struct Probe {
    /// Name in the scene and in the records.
    pub id: String,
    /// Index of the body, in the order of the scene.
    pub body: usize,
    /// Rest position [m].
    pub rest_m: Vector3<f64>,
    /// Element that contains it.
    pub element: u32,
    /// Barycentric coordinates of the point in that element; Σ = 1.
    pub weights: [f64; 4],
    /// Barycentric coordinates for the lookup of its piece: those of the point, moved to its side.
    pub lookup: [f64; 4],
    /// The short vector from the point to its side [m].
    towards: Vector3<f64>,
    /// The copies (and further nodes of the element) that carry it, with their shape functions at the point.
    /// They change with the topology.
    pub carriers: Vec<(u32, f64)>,
}

/// A point that lies in no element, and its distance from the mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outside {
    /// The nearest point of the mesh [m].
    pub nearest_m: Vector3<f64>,
    /// Distance of the point from it [m].
    pub distance_m: f64,
}

impl Probe {
    /// Binds a point to the uncut mesh.
    ///
    /// # Errors
    /// The nearest point of the mesh, if the point lies in no element.
    pub fn bind(
        id: &str,
        body: usize,
        of: &Body,
        rest_m: Vector3<f64>,
        side: Option<Vector3<f64>>,
    ) -> Result<Self, Outside> {
        let mesh = of.mesh();
        let towards = side.map_or(Vector3::zeros(), |side| side.normalize() * (SIDE_STEP * cell_size(mesh)));
        let aim = rest_m + towards;
        let element = element_at(mesh, aim)
            .or_else(|| element_at(mesh, rest_m))
            .ok_or_else(|| nearest(mesh, rest_m))?;
        let corners = mesh.corners(element);
        let weights = barycentric(&corners, rest_m);
        Ok(Self {
            id: id.to_owned(),
            body,
            rest_m,
            element: element as u32,
            weights,
            lookup: barycentric(&corners, aim),
            towards,
            carriers: of.carriers(element as u32, mesh.tets[element], weights),
        })
    }

    /// Updates the probe after a change of topology: takes the copies of the piece that contains the point.
    /// Where cuts change the mesh, its element is looked up first.
    pub fn follow(&mut self, of: &Body) {
        let mesh = of.mesh();
        if of.node_origins().is_some() {
            let aim = self.rest_m + self.towards;
            let element = deepest(mesh, aim);
            let corners = mesh.corners(element);
            self.element = element as u32;
            self.weights = barycentric(&corners, self.rest_m);
            self.lookup = barycentric(&corners, aim);
        }
        let copies = of.pieces()[of.piece_at(self.element, self.lookup) as usize].copies;
        self.carriers = of.carriers(self.element, copies, self.weights);
    }

    /// Present position [m] at the node positions `x`.
    pub fn position(&self, x: &[Vector3<f64>]) -> Vector3<f64> {
        self.carriers.iter().map(|(node, weight)| x[*node as usize] * *weight).sum()
    }
}

/// Mean edge length [m] of an element, from the mean volume.
fn cell_size(mesh: &TetMesh) -> f64 {
    let volume: f64 = mesh.volumes().iter().sum();
    (6.0 * volume / mesh.tets.len().max(1) as f64).cbrt()
}

/// The element that contains a point, if any.
fn element_at(mesh: &TetMesh, point: Vector3<f64>) -> Option<usize> {
    let element = deepest(mesh, point);
    (depth(mesh, point, element) >= -INSIDE).then_some(element)
}

/// The element in which a point lies deepest; of equals the first.
fn deepest(mesh: &TetMesh, point: Vector3<f64>) -> usize {
    let all = (0..mesh.tets.len()).map(|e| (depth(mesh, point, e), e));
    all.max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1))).map_or(0, |(_, e)| e)
}

/// Smallest barycentric coordinate of a point in element `e`.
fn depth(mesh: &TetMesh, point: Vector3<f64>, e: usize) -> f64 {
    barycentric(&mesh.corners(e), point).into_iter().fold(f64::INFINITY, f64::min)
}

fn barycentric(x: &[Vector3<f64>; 4], point: Vector3<f64>) -> [f64; 4] {
    let edges = Matrix3::from_columns(&[x[1] - x[0], x[2] - x[0], x[3] - x[0]]);
    let inner =
        edges.try_inverse().map_or(Vector3::repeat(f64::NEG_INFINITY), |inverse| inverse * (point - x[0]));
    [1.0 - inner.sum(), inner.x, inner.y, inner.z]
}

fn nearest(mesh: &TetMesh, point: Vector3<f64>) -> Outside {
    let mut best = Outside { nearest_m: point, distance_m: f64::INFINITY };
    for face in mesh.boundary_faces() {
        let triangle = face.nodes.map(|n| mesh.nodes[n as usize]);
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
        let mesh = body.mesh();
        let centre_z = |side: Vector3<f64>| {
            let probe = Probe::bind("p", 0, &body, point, Some(side)).unwrap();
            assert!((probe.position(&mesh.nodes) - point).norm() < 1e-14);
            mesh.corners(probe.element as usize).iter().map(|x| x.z).sum::<f64>() / 4.0
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

//! Data of a body for viewers besides the surface positions: rest positions, held parts, stress.

use nalgebra::{Matrix3, Vector3};
use scindo_physics::body::Body;
use scindo_physics::element::MaterialPoint;

use super::texture::{Corners, Texture};

/// Share of a vertex's weight on held nodes above which the vertex counts as held.
const MOSTLY: f64 = 0.5;

/// Triangles of a body's surface. It never changes; every epoch has its own object.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SurfaceTopology {
    /// Rises whenever the triangles change.
    pub epoch: u32,
    /// Number of vertices that the triangles refer to.
    pub vertex_count: u32,
    /// Vertex numbers, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Per triangle: 0 = skin, n > 0 = lip of incision n.
    pub tags: Vec<u32>,
    /// Rest positions of the vertices [m].
    pub rest: Vec<[f32; 3]>,
    /// Per vertex whether it moves with held nodes.
    pub held: Vec<bool>,
    /// Per vertex whether its part of the body contains a held node.
    pub hangs: Vec<bool>,
}

impl SurfaceTopology {
    /// Places of the skin on an image: of every triangle with tag 0, in their order.
    pub fn on_image(&self, texture: &Texture) -> Vec<Corners> {
        let skin = self.triangles.iter().zip(&self.tags).filter(|(_, tag)| **tag == 0);
        texture.coordinates(&self.rest, skin.map(|(triangle, _)| *triangle))
    }
}

/// Triangles of the present epoch, their rest positions, and what holds them. Sleeping parts are not shown.
pub(super) fn topology(body: &Body) -> SurfaceTopology {
    let surface = body.surface();
    let rest = body.rest_positions();
    let held = held_copies(body);
    let awake = |triangle: &[u32; 3]| !body.is_asleep(surface.vertices[triangle[0] as usize].copies()[0]);
    let shown = surface.triangles.iter().zip(&surface.tags).filter(|(triangle, _)| awake(triangle));
    let (triangles, tags) = shown.unzip();
    let parts = body.parts();
    let hangs = |vertex: &MaterialPoint| {
        let copy = vertex.main_copy() as usize;
        parts.of_copy.get(copy).is_some_and(|&part| !parts.free[part as usize])
    };
    let moves_with_held = |vertex: &MaterialPoint| {
        let held = vertex.carriers().filter(|(copy, _)| held[*copy]);
        held.map(|(_, weight)| weight).sum::<f64>() > MOSTLY
    };
    SurfaceTopology {
        epoch: body.epoch(),
        vertex_count: surface.vertices.len() as u32,
        triangles,
        tags,
        rest: surface.vertices.iter().map(|vertex| single(vertex.position(rest))).collect(),
        held: surface.vertices.iter().map(moves_with_held).collect(),
        hangs: surface.vertices.iter().map(hangs).collect(),
    }
}

/// Writes the von Mises stress [Pa] of every surface vertex into `out`. It is the mean over the material
/// around each copy, weighted by volume and interpolated like positions.
pub(super) fn surface_stress(body: &Body, out: &mut Vec<f32>) {
    let mut mean = vec![(0.0, 0.0); body.n_copies()];
    let stresses = body.cauchy_stresses();
    body.for_pieces(&mut |element, copies, volumes| {
        let stress = von_mises(&stresses[element]);
        for (&copy, volume) in copies.iter().zip(volumes) {
            let (sum, weight) = &mut mean[copy as usize];
            (*sum, *weight) = (*sum + stress * volume, *weight + volume);
        }
    });
    out.clear();
    out.extend(body.surface().vertices.iter().map(|vertex| {
        let carriers = vertex.carriers().filter(|(_, weight)| *weight > 0.0);
        let (sum, weights) = carriers.fold((0.0, 0.0), |(sum, weights), (copy, weight)| {
            let (stress, volume) = mean[copy];
            if volume > 0.0 { (sum + weight * stress / volume, weights + weight) } else { (sum, weights) }
        });
        let stress = if weights > 0.0 { (sum / weights) as f32 } else { 0.0 };
        if stress.is_finite() { stress } else { f32::MAX }
    }));
}

/// √(3/2 s:s) of the deviator s [Pa].
pub(crate) fn von_mises(stress: &Matrix3<f64>) -> f64 {
    let deviator = stress - Matrix3::from_diagonal_element(stress.trace() / 3.0);
    (1.5 * deviator.norm_squared()).sqrt()
}

/// Per copy whether its node is held along some axis.
fn held_copies(body: &Body) -> Vec<bool> {
    let fixed = body.fixed_nodes();
    let is_held = |node: &u32| fixed.binary_search_by_key(node, |f| f.node).is_ok();
    body.node_of_copy().iter().map(is_held).collect()
}

fn single(x: Vector3<f64>) -> [f32; 3] {
    [x.x as f32, x.y as f32, x.z as f32]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn von_mises_of_simple_states() {
        let pull = Matrix3::from_diagonal(&Vector3::new(5.0, 0.0, 0.0));
        assert!((von_mises(&pull) - 5.0).abs() < 1e-12);
        assert!(von_mises(&Matrix3::from_diagonal_element(-7.0)) < 1e-12);
        let mut shear = Matrix3::zeros();
        (shear[(0, 1)], shear[(1, 0)]) = (2.0, 2.0);
        assert!((von_mises(&shear) - 2.0 * 3.0_f64.sqrt()).abs() < 1e-12);
    }
}

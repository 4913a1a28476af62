//! The cube of figures 3.14 to 3.16 and its diagonal cut.

use nalgebra::Vector3;
use scindo_physics::body::Body;
use scindo_physics::cut::BladeSweep;
use scindo_physics::cut::remesh::SnapSettings;
use scindo_physics::mesh::{BoxPattern, TetMesh, box_mesh};

use super::cuts::{body, nodes, settle};
use crate::lab::Trouble;

type V = Vector3<f64>;

/// Edge [m].
pub(super) const EDGE_M: f64 = 0.1;
/// Cells along an edge: 9³ = 729 nodes, 6 · 8³ = 3,072 elements.
pub(super) const CELLS: usize = 8;
/// Dilating force on each side [N].
const PULL_N: f64 = 10.0;

/// A plane: a point [m] and the unit normal.
pub(super) type Plane = [V; 2];

/// The mesh, of cells that are divided as in the thesis.
pub(super) fn mesh() -> TetMesh {
    box_mesh(V::zeros(), V::repeat(EDGE_M), [CELLS; 3], BoxPattern::Octahedral6)
}

/// A plane whose normal is turned by an angle in the x–z plane, from x, and then raised from there towards y [°]. It
/// passes the centre at this distance over the edge.
pub(super) fn plane(turned: f64, raised: f64, off: f64) -> Plane {
    let (a, b) = (turned.to_radians(), raised.to_radians());
    let normal = V::new(a.cos() * b.cos(), b.sin(), a.sin() * b.cos());
    [V::repeat(0.5 * EDGE_M) + normal * (off * EDGE_M), normal]
}

/// A blade that sweeps all of a plane within the cube.
pub(super) fn blade([point, normal]: &Plane) -> BladeSweep {
    let helper = if normal.x.abs() < 0.6 { V::x() } else { V::y() };
    let u = normal.cross(&helper).normalize() * (2.0 * EDGE_M);
    let w = normal.cross(&u);
    BladeSweep { segments: vec![[point - u - w, point - u + w], [point + u - w, point + u + w]] }
}

/// The cube in equilibrium: the face y = 0 is held, and the sides across z are pulled apart. The plane of the diagonal cut
/// meets the held face, so both halves stay held.
///
/// # Errors
/// A solve that does not converge.
pub(super) fn dilated(snap: SnapSettings) -> Result<Body, Trouble> {
    let mut body = body(mesh(), snap, |X| X.y < 1e-9)?;
    for (z, force) in [(0.0, -PULL_N), (EDGE_M, PULL_N)] {
        let side = nodes(&body, |X| (X.z - z).abs() < 1e-9);
        body.add_surface_force(&side, V::new(0.0, 0.0, force))?;
    }
    settle(&mut body)?;
    Ok(body)
}

//! The cylinder of figure 3.13 and its pie-like cuts.

use std::f64::consts::PI;

use nalgebra::Vector3;
use scindo_physics::body::Body;
use scindo_physics::cut::BladeSweep;
use scindo_physics::cut::remesh::SnapSettings;
use scindo_physics::mesh::TetMesh;

use super::cube::Plane;
use super::cuts::body;
use super::delaunay;
use crate::lab::Trouble;

type V = Vector3<f64>;

/// Cuts, each through the whole cylinder along its axis.
pub(super) const CUTS: usize = 3;

/// The cylinder, its height and radius [m].
pub(super) struct Cylinder {
    pub mesh: TetMesh,
    height_m: f64,
    radius_m: f64,
}

impl Cylinder {
    /// The cylinder of the random numbers from `seed` on.
    ///
    /// # Errors
    /// Points that are not in general position.
    pub(super) fn new(seed: u64) -> Result<Self, Trouble> {
        let (mesh, [height_m, radius_m]) = delaunay::cylinder(seed)?;
        Ok(Self { mesh, height_m, radius_m })
    }

    /// The body, held at its lower end.
    ///
    /// # Errors
    /// A mesh that is none.
    pub(super) fn body(&self, snap: SnapSettings) -> Result<Body, Trouble> {
        let low = -0.5 * self.height_m;
        body(self.mesh.clone(), snap, |X| X.z < low + 1e-9)
    }

    /// The planes through the axis, the first of which is turned by an angle from x [rad].
    pub(super) fn planes(&self, from: f64) -> [Plane; CUTS] {
        std::array::from_fn(|k| {
            let angle = from + PI * k as f64 / CUTS as f64;
            [V::zeros(), V::new(-angle.sin(), angle.cos(), 0.0)]
        })
    }

    /// The blades that sweep these planes.
    pub(super) fn blades(&self, from: f64) -> [BladeSweep; CUTS] {
        let (reach, up) = (1.5 * self.radius_m, V::new(0.0, 0.0, self.height_m));
        self.planes(from).map(|[_, normal]| {
            let out = normal.cross(&V::z()) * reach;
            BladeSweep { segments: vec![[-out - up, -out + up], [out - up, out + up]] }
        })
    }
}

/// Moves the parts of a body away from the z axis, so that a picture shows their cut faces.
///
/// # Errors
/// None for a sound body.
pub(super) fn spread(body: &mut Body, by_m: f64) -> Result<(), Trouble> {
    let parts = body.parts().of_copy.clone();
    let count = parts.iter().max().map_or(0, |most| *most as usize + 1);
    let mut sums = vec![(V::zeros(), 0.0); count];
    for (x, part) in body.positions().iter().zip(&parts) {
        sums[*part as usize].0 += x;
        sums[*part as usize].1 += 1.0;
    }
    let away = |part: u32| {
        let (sum, n) = sums[part as usize];
        let middle = sum / n;
        V::new(middle.x, middle.y, 0.0).try_normalize(1e-12).unwrap_or_default() * by_m
    };
    let x: Vec<V> = body.positions().iter().zip(&parts).map(|(x, part)| x + away(*part)).collect();
    body.set_state(&x, &vec![V::zeros(); x.len()])?;
    Ok(())
}

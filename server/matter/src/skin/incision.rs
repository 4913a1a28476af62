//! Incisions as deep as a tool is pressed into the skin.
//!
//! A tool drawn over the skin is described by its contact points, the outward normals there and its
//! penetration depths. The blade of the incision reaches from that depth to just above the skin. It opens
//! only the elements that it cuts through, so the wound is never deeper than the penetration.
//!
//! # Source
//! Jeřábková 2007, 4.1.3 and fig. 4.7: cut path on the surface and depth below it make the wound.

use nalgebra::Vector3;

use crate::cut::BladeSweep;

/// Height of the blade above the skin, as a share of the largest depth. The skin between two contact points
/// may be curved.
const STANDS_OUT: f64 = 0.5;

/// One contact point of a tool on its path over the skin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Penetration {
    /// Contact point on the skin [m].
    pub point_m: Vector3<f64>,
    /// Outward normal there, of any length except zero.
    pub normal: Vector3<f64>,
    /// Depth of the tip below the skin [m]. 0 only scratches it.
    pub depth_m: f64,
}

/// The blade that cuts along `path`, for [`CutMesh::sweep`](crate::cut::CutMesh::sweep).
pub fn incision(path: &[Penetration]) -> BladeSweep {
    let above = STANDS_OUT * path.iter().map(|p| p.depth_m).fold(0.0, f64::max);
    let segment = |p: &Penetration| {
        let normal = p.normal.try_normalize(0.0).unwrap_or_default();
        [p.point_m - normal * p.depth_m, p.point_m + normal * above]
    };
    BladeSweep { segments: path.iter().map(segment).collect() }
}

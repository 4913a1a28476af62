//! Between the world of scindo (metres) and the coordinates of the peer (millimetres, RAS as 3D Slicer has them).
//!
//! RAS: x to the right of the patient, y to the front, z to the head. LPS, as DICOM and ITK have it: x to the left, y
//! to the back, z to the head. LPS and RAS differ by half a turn about z.
//!
//! A tool's own axes are those of scindo on both sides: the tip is the origin, the shaft points along +z.

#![allow(non_snake_case)] // R is a rotation, as in the literature.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use scindo_client::messages::{Pose, Vec3};

use crate::wire::content::Transform;

/// Largest deviation of RᵀR from the unit matrix: trackers send single precision, often rounded to four digits.
const RIGID_TOLERANCE: f64 = 1e-2;

/// What the axes of the scene mean to the peer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum)]
pub enum Axes {
    /// x, y, z of the scene are R, A, S.
    #[default]
    Ras,
    /// x, y, z of the scene are L, P, S: meshes that were made from DICOM images.
    Lps,
}

/// The matrix is no rotation.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "the matrix is no rotation: R^T R differs from the unit matrix by {deviation:.3}, det R = {determinant:.3}; send \
     rigid transforms, without scale or mirror"
)]
pub struct NotRigid {
    deviation: f64,
    determinant: f64,
}

impl Axes {
    /// +1 or −1 for x and y.
    fn sign(self) -> f64 {
        match self {
            Self::Ras => 1.0,
            Self::Lps => -1.0,
        }
    }

    /// A vector of the world in the axes of the peer, and back.
    pub fn turn(self, v: Vector3<f64>) -> Vector3<f64> {
        Vector3::new(self.sign() * v.x, self.sign() * v.y, v.z)
    }

    /// A point of the world [m] in the coordinates of the peer [mm].
    pub fn point_mm(self, point_m: [f32; 3]) -> [f32; 3] {
        let factor = 1000.0 * self.sign() as f32;
        [factor * point_m[0], factor * point_m[1], 1000.0 * point_m[2]]
    }

    /// A direction of the world in the axes of the peer.
    pub fn direction(self, d: [f32; 3]) -> [f32; 3] {
        let sign = self.sign() as f32;
        [sign * d[0], sign * d[1], d[2]]
    }

    /// The pose in the world that a transform of the peer means.
    ///
    /// # Errors
    /// The transform scales, shears or mirrors.
    pub fn pose(self, transform: &Transform) -> Result<Pose, NotRigid> {
        let t = transform.0.map(f64::from);
        let R = Matrix3::from_column_slice(&t[..9]);
        let (deviation, determinant) = ((R.transpose() * R - Matrix3::identity()).amax(), R.determinant());
        // Entries may be as large as single precision allows: the comparison must fail for infinities, too.
        if !(deviation <= RIGID_TOLERANCE && determinant > 0.0) {
            return Err(NotRigid { deviation, determinant });
        }
        let nearest = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(&R));
        let q = self.half_turn() * nearest;
        let p = self.turn(Vector3::new(t[9], t[10], t[11]) * 1e-3);
        let position_m = Some(Vec3 { x: p.x, y: p.y, z: p.z });
        Ok(Pose { position_m, qx: q.i, qy: q.j, qz: q.k, qw: q.w })
    }

    /// The transform of the peer that a pose in the world means.
    pub fn transform(self, pose: &Pose) -> Transform {
        let q =
            UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(pose.qw, pose.qx, pose.qy, pose.qz));
        let R = (self.half_turn() * q).to_rotation_matrix();
        let at = pose.position_m.unwrap_or_default();
        let p = 1e3 * self.turn(Vector3::new(at.x, at.y, at.z));
        let mut entries = [0.0; 12];
        for (entry, value) in entries.iter_mut().zip(R.matrix().iter().chain(p.iter())) {
            *entry = *value as f32;
        }
        Transform(entries)
    }

    /// From the world to the peer and back.
    fn half_turn(self) -> UnitQuaternion<f64> {
        match self {
            Self::Ras => UnitQuaternion::identity(),
            Self::Lps => UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(0.0, 0.0, 0.0, 1.0)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A quarter turn about z, at (10, −20, 300) mm.
    const QUARTER: Transform = Transform([0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 10.0, -20.0, 300.0]);

    #[test]
    fn millimetres_become_metres_and_lps_is_half_a_turn_away() {
        let close = |a: f64, b: f64| (a - b).abs() < 1e-7;
        for (axes, x, y) in [(Axes::Ras, 0.01, -0.02), (Axes::Lps, -0.01, 0.02)] {
            let p = axes.pose(&QUARTER).unwrap().position_m.unwrap();
            assert!(close(p.x, x) && close(p.y, y) && close(p.z, 0.3), "{axes:?}: {p:?}");
        }
        // The shaft, tool +x and the position turn together.
        let pose = Axes::Lps.pose(&QUARTER).unwrap();
        let q =
            UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(pose.qw, pose.qx, pose.qy, pose.qz));
        assert!((q * Vector3::z() - Vector3::z()).norm() < 1e-7);
        assert!((q * Vector3::x() + Vector3::y()).norm() < 1e-7, "tool +x is +y for RAS, -y for LPS");
        assert_eq!(Axes::Lps.point_mm([0.001, 0.002, 0.003]), [-1.0, -2.0, 3.0]);
        assert_eq!(Axes::Lps.direction([1.0, 0.0, 0.5]), [-1.0, 0.0, 0.5]);
    }

    #[test]
    fn what_is_no_rotation_is_refused() {
        let scaled = Transform(QUARTER.0.map(|v| 1.1 * v));
        assert!(Axes::Ras.pose(&scaled).unwrap_err().to_string().contains("without scale"));
        let mut mirror = QUARTER;
        mirror.0[8] = -1.0;
        assert!(Axes::Ras.pose(&mirror).is_err());
        assert!(Axes::Ras.pose(&Transform([f32::MAX; 12])).is_err());
        assert!(Axes::Ras.pose(&Transform([0.0; 12])).is_err());
    }

    proptest! {
        #[test]
        fn a_pose_comes_back(
            axis in prop::array::uniform3(-1.0..1.0_f64), angle in 0.0..3.0_f64, at in prop::array::uniform3(-1.0..1.0_f64),
            lps in any::<bool>(),
        ) {
            let axes = if lps { Axes::Lps } else { Axes::Ras };
            let q = UnitQuaternion::from_scaled_axis(Vector3::from(axis).normalize() * angle);
            let position_m = Some(Vec3 { x: at[0], y: at[1], z: at[2] });
            let pose = Pose { position_m, qx: q.i, qy: q.j, qz: q.k, qw: q.w };
            let back = axes.pose(&axes.transform(&pose)).unwrap();
            let other = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(back.qw, back.qx, back.qy, back.qz));
            let p = back.position_m.unwrap();
            prop_assert!(q.angle_to(&other) < 1e-6, "{}", q.angle_to(&other));
            prop_assert!((Vector3::new(p.x, p.y, p.z) - Vector3::from(at)).norm() < 1e-6);
        }
    }
}

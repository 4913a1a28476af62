//! Rigid motions that no prescribed direction resists.
//!
//! A part resists the rigid motion t + ω × (x − c) if the motion has a component along some prescribed
//! direction e_k at x. It resists all of them if Σ a aᵀ over the prescribed directions, a = (e_k, (x − c)
//! × e_k), is positive definite. The null vectors of this sum are the free motions. They are those of the
//! rest configuration: a hinge or a pendulum counts as free.

use nalgebra::{Matrix6, Vector3, Vector6};
use scindo_matter::element::FixedCopy;

use super::parts::LooseParts;

/// Eigenvalues below this fraction of the trace count as zero: rounding, or a held angle of 1e-6.
const NULL: f64 = 1e-12;

/// A rigid motion of a part of a body that no prescribed direction resists.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct FreeMotion {
    /// Index of the part in [`LooseParts`].
    pub part: u32,
    /// Its mass [kg].
    pub mass_kg: f64,
    /// Velocity of the point `about`, of length 1 for a translation.
    pub slide: Vector3<f64>,
    /// Angular velocity, of length 1 for a rotation and 0 for a translation.
    pub turn: Vector3<f64>,
    /// A point on the axis [m]; the centre of the part for a translation.
    pub about: Vector3<f64>,
}

impl FreeMotion {
    /// Whether it is a translation.
    pub fn is_translation(&self) -> bool {
        self.turn == Vector3::zeros()
    }

    /// Velocity of the point that rests at `x` [m].
    pub fn at(&self, x: &Vector3<f64>) -> Vector3<f64> {
        self.slide + self.turn.cross(&(x - self.about))
    }

    /// Whether forces `f` [N] on copies that rest at `rest` [m] drive the motion: whether they do work on
    /// it, rounding aside.
    pub fn is_driven(&self, parts: &LooseParts, rest: &[Vector3<f64>], f: &[Vector3<f64>]) -> bool {
        let (mut work, mut size) = (0.0, 0.0);
        let of_part = parts.of_copy.iter().zip(rest).zip(f).filter(|((part, _), _)| **part == self.part);
        for ((_, x), f) in of_part {
            let u = self.at(x);
            work += f.dot(&u);
            size += f.norm() * u.norm();
        }
        work.abs() > 1e-9 * size
    }
}

/// The free motions of all parts that are held somewhere; `rest` [m] and `parts` by copy.
///
/// A part without any prescribed direction is not listed: it has all six, and is marked in `parts`.
pub fn free_motions(parts: &LooseParts, rest: &[Vector3<f64>], fixed: &[FixedCopy]) -> Vec<FreeMotion> {
    let frames = frames(parts, rest);
    let mut held = vec![Matrix6::zeros(); parts.len()];
    for f in fixed {
        let part = parts.of_copy[f.copy as usize] as usize;
        let (centre, size) = frames[part];
        let arm = (rest[f.copy as usize] - centre) / size;
        for e in f.held.directions() {
            let turn = arm.cross(&e);
            let a = Vector6::new(e.x, e.y, e.z, turn.x, turn.y, turn.z);
            held[part] += a * a.transpose();
        }
    }
    let mut motions = Vec::new();
    for (part, held) in held.iter().enumerate() {
        if !parts.free[part] && held.trace() > 0.0 {
            let (centre, size) = frames[part];
            let basis = null_vectors(held);
            motions.extend(basis.iter().map(|q| motion((part, parts.mass[part]), q, (centre, size))));
        }
    }
    motions
}

/// Centre and size of every part [m].
fn frames(parts: &LooseParts, rest: &[Vector3<f64>]) -> Vec<(Vector3<f64>, f64)> {
    let nothing = [Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY)];
    let mut boxes = vec![nothing; parts.len()];
    for (&part, x) in parts.of_copy.iter().zip(rest) {
        let [low, high] = &mut boxes[part as usize];
        (*low, *high) = (low.inf(x), high.sup(x));
    }
    let frame =
        |[low, high]: [Vector3<f64>; 2]| (0.5 * (low + high), (0.5 * (high - low).norm()).max(1e-300));
    boxes.into_iter().map(frame).collect()
}

/// A basis of the null space of `held`: first the translations along the axes, then the rest.
fn null_vectors(held: &Matrix6<f64>) -> Vec<Vector6<f64>> {
    let zero = NULL * held.trace();
    let mut basis: Vec<Vector6<f64>> =
        (0..3).filter(|&axis| held[(axis, axis)] == 0.0).map(|axis| Vector6::ith(axis, 1.0)).collect();
    let eigen = held.symmetric_eigen();
    for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        if *value <= zero {
            let mut q: Vector6<f64> = vector.into();
            basis.iter().for_each(|known| q -= known * known.dot(&q));
            if q.norm() > 1e-3 {
                basis.push(q.normalize());
            }
        }
    }
    basis
}

fn motion(
    (part, mass_kg): (usize, f64),
    q: &Vector6<f64>,
    (centre, size): (Vector3<f64>, f64),
) -> FreeMotion {
    let (slide, turn) = (q.fixed_rows::<3>(0).into_owned(), q.fixed_rows::<3>(3) / size);
    let part = part as u32;
    let speed = turn.norm();
    if speed * size < 1e-6 {
        let slide = slide.normalize();
        return FreeMotion { part, mass_kg, slide, turn: Vector3::zeros(), about: centre };
    }
    // The point of the axis that is closest to the centre; what is left there goes along the axis.
    let about = centre + turn.cross(&slide) / (speed * speed);
    let (turn, along) = (turn / speed, slide / speed);
    FreeMotion { part, mass_kg, slide: turn * turn.dot(&along), turn, about }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The corners of a cube of 2 m around (5, 0, 0), of which some are held along some axes.
    fn left(held: &[(u32, [bool; 3])]) -> Vec<FreeMotion> {
        let rest: Vec<Vector3<f64>> = (0..8)
            .map(|c| Vector3::new([4.0, 6.0][c & 1], [-1.0, 1.0][c >> 1 & 1], [-1.0, 1.0][c >> 2]))
            .collect();
        let fixed: Vec<FixedCopy> = held
            .iter()
            .map(|&(copy, axes)| FixedCopy { copy, held: axes.into(), position_m: [0.0; 3] })
            .collect();
        let parts = LooseParts { of_copy: vec![0; 8], mass: vec![1.0], free: vec![held.is_empty()] };
        free_motions(&parts, &rest, &fixed)
    }

    #[test]
    fn what_is_held_enough_has_no_free_motion() {
        let all = [true; 3];
        assert!(left(&[(0, all), (1, all), (2, all)]).is_empty());
        // Six directions suffice: three, two and one.
        assert!(left(&[(0, all), (1, [false, true, true]), (2, [false, false, true])]).is_empty());
        assert!(left(&[]).is_empty(), "all six, which the parts say");
    }

    #[test]
    fn a_hinge_turns_about_its_edge() {
        let motions = left(&[(0, [true; 3]), (1, [true; 3])]);
        assert_eq!(motions.len(), 1);
        let motion = motions[0];
        assert!((motion.turn.x.abs() - 1.0).abs() < 1e-9 && motion.slide.norm() < 1e-9, "{motion:?}");
        assert!((motion.about - Vector3::new(5.0, -1.0, -1.0)).norm() < 1e-9);
        let parts = LooseParts { of_copy: vec![0; 2], mass: vec![1.0], free: vec![false] };
        let rest = [Vector3::new(4.0, -1.0, -1.0), Vector3::new(5.0, 1.0, -1.0)];
        let z = Vector3::z();
        assert!(motion.is_driven(&parts, &rest, &[z, z]));
        assert!(!motion.is_driven(&parts, &rest, &[z, Vector3::x() + 1e-14 * z]), "not about its own axis");
    }

    #[test]
    fn a_face_on_a_smooth_table_slides_and_turns() {
        let motions = left(&[0, 1, 2, 3].map(|c| (c, [false, false, true])));
        let slides = motions.iter().filter(|m| m.is_translation()).count();
        assert_eq!((motions.len(), slides), (3, 2));
        assert_eq!([motions[0].slide, motions[1].slide], [Vector3::x(), Vector3::y()]);
        assert!((motions[2].turn.z.abs() - 1.0).abs() < 1e-9);
        assert!((motions[2].about.xy() - Vector3::new(5.0, 0.0, 0.0).xy()).norm() < 1e-9);
    }

    #[test]
    fn a_point_leaves_three_rotations() {
        let motions = left(&[(7, [true; 3])]);
        assert_eq!(motions.len(), 3);
        for motion in motions {
            assert!(!motion.is_translation());
            assert!(motion.at(&Vector3::new(6.0, 1.0, 1.0)).norm() < 1e-9, "{motion:?}");
        }
    }
}

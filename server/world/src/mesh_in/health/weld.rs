//! Finds points at the same place.

use nalgebra::Vector3;

/// For every point the first point at the same place, and how many points that merges.
///
/// Points coincide when they round to the same multiple of `tolerance`. Points on two sides of a rounding
/// border stay apart. This is harmless, since exporters repeat coordinates exactly.
pub(super) fn coincident(points: &[Vector3<f64>], tolerance: f64) -> (Vec<u32>, usize) {
    let step = if tolerance > 0.0 { tolerance } else { f64::MIN_POSITIVE };
    // Adding 0.0 turns -0.0 into 0.0.
    let rounded = |p: &Vector3<f64>| [p.x, p.y, p.z].map(|c| ((c / step).round() + 0.0).to_bits());
    let mut keyed: Vec<([u64; 3], u32)> = points.iter().map(rounded).zip(0u32..).collect();
    keyed.sort_unstable();
    let mut first_of = vec![0; points.len()];
    let mut merged = 0;
    for same in keyed.chunk_by(|a, b| a.0 == b.0) {
        merged += same.len() - 1;
        for &(_, point) in same {
            first_of[point as usize] = same[0].1;
        }
    }
    (first_of, merged)
}

//! The shapes, each a signed distance.
//!
//! All have their long axis along x and their top towards +z, and are centred at x = y = 0.

use std::f64::consts::PI;

use nalgebra::Vector3;

use super::distance::{
    at, capsule, cone, ellipsoid, half_space, ring, smooth_cut, smooth_overlap, smooth_union,
};

/// A thick and a thin lobe, blended, with a groove and a notch between them and a hollow below, about
/// 160 × 104 × 63 mm; its underside is near z = 0.
pub(super) fn liver(x: &Vector3<f64>) -> f64 {
    let right = ellipsoid(x, at(0.034, 0.004, 0.029), at(0.046, 0.052, 0.033));
    let middle = ellipsoid(x, at(-0.006, 0.006, 0.027), at(0.046, 0.046, 0.025));
    let left = ellipsoid(x, at(-0.046, 0.000, 0.024), at(0.034, 0.036, 0.015));
    let body = smooth_union(smooth_union(right, middle, 0.020), left, 0.026);
    let groove = capsule(x, at(-0.024, -0.08, 0.054), at(-0.012, 0.08, 0.060), 0.010);
    let notch = capsule(x, at(-0.022, -0.060, -0.03), at(-0.020, -0.056, 0.08), 0.012);
    let hollow = ellipsoid(x, at(-0.002, -0.020, -0.030), at(0.080, 0.062, 0.040));
    let grooved = smooth_cut(smooth_cut(body, groove, 0.014), notch, 0.016);
    smooth_cut(grooved, hollow, 0.012)
}

/// A bean with a hollow on its inner side (+y) and a growth on top of one end, 112 × 66 × 48 mm, from
/// z = 0 up.
pub(super) fn kidney(x: &Vector3<f64>) -> f64 {
    // Bent about z: the ends lie farther along +y than the middle.
    let bent = at(x.x, x.y - 5.0 * x.x * x.x + 0.008, x.z);
    let bean = ellipsoid(&bent, at(0.0, 0.0, 0.022), at(0.056, 0.029, 0.022));
    let hilum = ellipsoid(x, at(0.0, 0.030, 0.022), at(0.014, 0.016, 0.009));
    let growth = ellipsoid(x, at(0.030, -0.010, 0.037), at(0.013, 0.013, 0.011));
    smooth_union(smooth_cut(bean, hilum, 0.008), growth, 0.007)
}

/// A hollow tube that forks into two, 120 × 84 × 20 mm with walls of 4 to 5 mm, open at its three ends;
/// its axis is at z = 0.
pub(super) fn vessel(x: &Vector3<f64>) -> f64 {
    const FORK: f64 = -0.004;
    let ends = [at(0.075, 0.036, 0.0), at(0.075, -0.036, 0.0)];
    let tube = |trunk: f64, branch: f64, blend: f64| {
        let [left, right] = ends.map(|end| capsule(x, at(FORK, 0.0, 0.0), end, branch));
        let trunk = capsule(x, at(-0.08, 0.0, 0.0), at(FORK, 0.0, 0.0), trunk);
        smooth_union(trunk, smooth_union(left, right, blend), blend)
    };
    let wall = tube(0.0102, 0.0090, 0.010).max(-tube(0.0056, 0.0048, 0.006));
    let trimmed = ends.iter().fold(wall, |f, end| {
        let along = end - at(FORK, 0.0, 0.0);
        f.max(half_space(x, end - 0.018 * along.normalize(), along))
    });
    trimmed.max(half_space(x, at(-0.060, 0.0, 0.0), at(-1.0, 0.0, 0.0)))
}

/// A dome 5 mm thick over a ring, with an opening beside its top, 132 × 132 × 38 mm, from z = 0 up.
pub(super) fn diaphragm(x: &Vector3<f64>) -> f64 {
    // A sphere's cap of 60 mm radius and 30 mm height.
    let (radius, centre) = (0.075, at(0.0, 0.0, -0.040));
    let shell = ((x - centre).norm() - radius).abs() - 0.0025;
    let cap = smooth_overlap(shell, half_space(x, at(0.0, 0.0, 0.004), at(0.0, 0.0, -1.0)), 0.002);
    let rim = ring(x, at(0.0, 0.0, 0.0052), 0.0605, 0.0052);
    let opening = capsule(x, at(0.020, 0.012, -0.05), at(0.020, 0.012, 0.10), 0.008);
    smooth_cut(smooth_union(cap, rim, 0.006), opening, 0.003)
}

/// A muscle's belly between two tendons, one of which divides into three, 190 × 62 × 34 mm; its axis is
/// at z = 0.
pub(super) fn tendon(x: &Vector3<f64>) -> f64 {
    let belly = ellipsoid(x, at(0.0, 0.0, 0.0), at(0.046, 0.021, 0.017));
    let single = cone(x, (at(-0.030, 0.0, 0.0), 0.010), (at(-0.090, 0.0, 0.0), 0.0070));
    let foot = ellipsoid(x, at(-0.088, 0.0, 0.0), at(0.010, 0.016, 0.012));
    let strand = |y: f64, z: f64| cone(x, (at(0.030, 0.3 * y, 0.3 * z), 0.0085), (at(0.094, y, z), 0.0056));
    let strands = [(0.024, 0.0), (0.0, 0.004), (-0.024, 0.0)].map(|(y, z)| strand(y, z));
    let body = smooth_union(smooth_union(belly, single, 0.012), foot, 0.008);
    strands.into_iter().fold(body, |f, strand| smooth_union(f, strand, 0.008))
}

/// A half dome with winding folds, 132 × 92 × 62 mm, flat below at z = 0.
pub(super) fn brain(x: &Vector3<f64>) -> f64 {
    let dome = ellipsoid(x, at(0.0, 0.0, 0.016), at(0.066, 0.046, 0.046));
    // Winding folds about 16 mm apart that meet; none on the underside.
    let k = 2.0 * PI / 0.034;
    let (u, v, w) = (k * x.x, k * x.y, k * x.z);
    let warp = 1.3 * (0.45 * u + 1.0).sin() + 0.9 * (0.6 * v).cos();
    let pattern = (u + warp).sin() * v.cos() + (v + warp).sin() * w.cos() + (w + 0.7 * warp).sin() * u.cos();
    let fold = (1.0 - pattern.abs() / 0.35).max(0.0);
    let folded = dome + 0.0042 * fold * fold * ((x.z - 0.010) / 0.010).clamp(0.0, 1.0);
    let fissure = ellipsoid(x, at(0.012, 0.052, 0.026), at(0.050, 0.016, 0.005));
    let grooved = smooth_cut(folded, fissure, 0.006);
    smooth_overlap(grooved, half_space(x, at(0.0, 0.0, 0.0), at(0.0, 0.0, -1.0)), 0.006)
}

/// The last joint of a finger, pad up, 62 × 36 × 30 mm, from z = 0 up.
pub(super) fn fingertip(x: &Vector3<f64>) -> f64 {
    let joint = cone(x, (at(-0.034, 0.0, 0.014), 0.0145), (at(0.014, 0.0, 0.014), 0.0140));
    let pad = ellipsoid(x, at(0.008, 0.0, 0.0175), at(0.024, 0.0165, 0.0135));
    let nail = ellipsoid(x, at(0.016, 0.0, -0.006), at(0.018, 0.017, 0.010));
    let finger = smooth_cut(smooth_union(joint, pad, 0.012), nail, 0.004);
    smooth_overlap(finger, half_space(x, at(-0.030, 0.0, 0.0), at(-1.0, 0.0, 0.0)), 0.004)
}

//! Keeps stable Neo-Hookean elements from staying collapsed to a point.
//!
//! F = 0 is an equilibrium of that law, and the restoring force anywhere near it is too weak to matter. Where
//! ‖F‖ < 0.05 the energy is therefore the corotational one, which pushes outwards with full force. Between
//! 0.05 and 0.1 the two *energies* are blended. The blend is twice continuously differentiable, so stress and
//! tangent remain derivatives and a line search may trust them. Nothing changes above 0.1 (at rest ‖F‖ = √3).
//!
//! # Derivation
//! ψ = ψ_N + w(I) (ψ_C − ψ_0 − ψ_N), I = ‖F‖². The constant ψ_0 is the smallest ψ_C − ψ_N on the outer bound.
//! The bracket is therefore positive and the blend falls outwards everywhere: there is no new minimum.

use nalgebra::Vector3;

use super::principal::Principal;
use super::{Corotational, Lame};

/// ‖F‖² below which only the corotational energy acts, and above which it is absent.
const INNER: f64 = 0.05 * 0.05;
const OUTER: f64 = 0.1 * 0.1;

/// Whether the guard acts at ‖F‖² = `square`.
pub(super) fn acts(square: f64) -> bool {
    square < OUTER
}

/// An energy density [J/m³] with its derivatives by the stretches.
pub(super) struct Sample {
    pub energy: f64,
    pub principal: Principal,
}

/// Blends `law`, taken at the stretches `sigma`, into the corotational law.
pub(super) fn blend(law: Sample, sigma: &Vector3<f64>, lame: Lame, energy_at_zero: f64) -> Sample {
    let square = sigma.norm_squared();
    if !acts(square) {
        return law;
    }
    let corotational = corotational(sigma, lame);
    let energy = corotational.energy - offset(lame, energy_at_zero) - law.energy;
    let (N, C) = (law.principal, corotational.principal);
    let D = Principal {
        slope: C.slope - N.slope,
        scaling: C.scaling - N.scaling,
        twist: C.twist - N.twist,
        flip: C.flip - N.flip,
    };
    let [w, dw, ddw] = weight(square);
    let mixed = sigma * D.slope.transpose();
    let principal = Principal {
        slope: N.slope + w * D.slope + 2.0 * dw * energy * sigma,
        scaling: N.scaling
            + w * D.scaling
            + 2.0 * dw * (mixed + mixed.transpose())
            + energy * 4.0 * ddw * sigma * sigma.transpose()
            + nalgebra::Matrix3::from_diagonal_element(2.0 * dw * energy),
        twist: (N.twist + w * D.twist).add_scalar(2.0 * dw * energy),
        flip: (N.flip + w * D.flip).add_scalar(2.0 * dw * energy),
    };
    Sample { energy: law.energy + w * energy, principal }
}

fn corotational(sigma: &Vector3<f64>, lame: Lame) -> Sample {
    let theta = sigma.sum() - 3.0;
    let energy = lame.mu * sigma.add_scalar(-1.0).norm_squared() + 0.5 * lame.lambda * theta * theta;
    Sample { energy, principal: Corotational(lame).principal(sigma) }
}

/// ψ_0 [J/m³]: ψ_C − ψ_N at σ_i = 0.1/√3, where it is smallest for ‖F‖ ≤ 0.1. There ψ_N differs from its
/// value at 0 by less than 1 % of the difference.
fn offset(lame: Lame, energy_at_zero: f64) -> f64 {
    let sigma = Vector3::repeat((OUTER / 3.0).sqrt());
    corotational(&sigma, lame).energy - energy_at_zero
}

/// w, dw/dI and d²w/dI² of the quintic step from 1 at `INNER` to 0 at `OUTER`.
fn weight(square: f64) -> [f64; 3] {
    let width = OUTER - INNER;
    let t = ((square - INNER) / width).clamp(0.0, 1.0);
    let step = t * t * t * (10.0 + t * (-15.0 + 6.0 * t));
    let slope = 30.0 * t * t * (1.0 - t) * (1.0 - t);
    let curvature = 60.0 * t * (1.0 - t) * (1.0 - 2.0 * t);
    [1.0 - step, -slope / width, -curvature / (width * width)]
}

//! Richardson extrapolation over three meshes (or steps), with its own error bar.
//!
//! With solutions u₁, u₂, u₃ on meshes of sizes h₁ > h₂ > h₃ and u = u* + C hᵖ, the observed order
//! p solves ‖u₁−u₂‖/‖u₂−u₃‖ = (h₁ᵖ−h₂ᵖ)/(h₂ᵖ−h₃ᵖ), and u* = u₃ + (u₃−u₂) h₃ᵖ/(h₂ᵖ−h₃ᵖ).
//! Error bar: 1.25 |u*−u₃| where p is plausible, 3 |u*−u₃| with p = 1 where it is not
//! (grid convergence index, Roache 1994).

use crate::trial::series::Series;

/// Credible orders.
const PLAUSIBLE: std::ops::RangeInclusive<f64> = 0.5..=4.5;

/// The limit of a sequence of refinements.
#[derive(Debug, Clone, PartialEq)]
pub struct Limit {
    /// Extrapolated values.
    pub value: Series,
    /// Observed order in h; 1 if none could be observed.
    pub order: f64,
    /// Whether the observed order lies in the plausible range.
    pub plausible: bool,
    /// Half-width of the error bar, relative to the norm of the limit.
    pub error_bar: f64,
}

/// Extrapolates three solutions on meshes (or with steps) of size `sizes`, coarse to fine. `None` if they
/// have no common instant or the sizes do not descend.
pub fn extrapolate(sizes: [f64; 3], [u1, u2, u3]: [&Series; 3]) -> Option<Limit> {
    let [h1, h2, h3] = sizes;
    if !(h1 > h2 && h2 > h3 && h3 > 0.0) {
        return None;
    }
    let (coarse, fine) = (u1.minus(u2).norm(), u2.minus(u3).norm());
    let (order, plausible) = match observed_order(sizes, coarse, fine) {
        Some(order) => (order, true),
        None => (1.0, false),
    };
    let factor = h3.powf(order) / (h2.powf(order) - h3.powf(order));
    let correction = u3.minus(u2).combine(factor, u3, 0.0);
    let value = u3.combine(1.0, &correction, 1.0);
    let norm = value.norm();
    if value.frames.is_empty() || norm == 0.0 || !value.is_finite() {
        return None;
    }
    let safety = if plausible { 1.25 } else { 3.0 };
    Some(Limit { error_bar: safety * correction.norm() / norm, value, order, plausible })
}

/// The order p that explains how the differences fall, found by bisection; `None` if not plausible.
pub fn observed_order([h1, h2, h3]: [f64; 3], coarse: f64, fine: f64) -> Option<f64> {
    if !(coarse > 0.0 && fine > 0.0) {
        return None;
    }
    let ratio = |p: f64| (h1.powf(p) - h2.powf(p)) / (h2.powf(p) - h3.powf(p));
    let (mut low, mut high) = (*PLAUSIBLE.start(), *PLAUSIBLE.end());
    let wanted = coarse / fine;
    if !(ratio(low)..=ratio(high)).contains(&wanted) {
        return None;
    }
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if ratio(middle) < wanted { low = middle } else { high = middle }
    }
    Some(0.5 * (low + high))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn solution(h: f64, p: f64) -> Series {
        let u = |limit: f64, c: f64| limit + c * h.powf(p);
        Series {
            frames: vec![0],
            displacement_m: vec![u(1.0, -0.3), u(-2.0, 0.7)],
            energy_j: vec![u(3.0, -1.0)],
        }
    }

    #[test]
    fn a_pure_power_is_extrapolated_exactly() {
        for p in [1.0, 1.6, 2.0, 3.0] {
            let sizes = [1.0 / 8.0, 1.0 / 12.0, 1.0 / 16.0];
            let [a, b, c] = sizes.map(|h| solution(h, p));
            let limit = extrapolate(sizes, [&a, &b, &c]).unwrap();
            assert!((limit.order - p).abs() < 1e-6 && limit.plausible, "{p}: {}", limit.order);
            assert!((limit.value.displacement_m[0] - 1.0).abs() < 1e-9);
            assert!((limit.value.displacement_m[1] + 2.0).abs() < 1e-9);
            assert!((limit.value.energy_j[0] - 3.0).abs() < 1e-9);
            let true_error = c.minus(&limit.value).norm() / limit.value.norm();
            assert!((limit.error_bar - 1.25 * true_error).abs() < 1e-9);
        }
    }

    #[test]
    fn what_does_not_converge_gets_a_wide_bar() {
        let sizes = [4.0, 2.0, 1.0];
        let of = |u: f64| Series { frames: vec![0], displacement_m: vec![u], energy_j: vec![1.0] };
        let limit = extrapolate(sizes, [&of(1.0), &of(1.1), &of(1.3)]).unwrap();
        assert!(!limit.plausible && limit.order == 1.0);
        assert!((limit.value.displacement_m[0] - 1.5).abs() < 1e-12, "first order assumed");
        assert!((limit.error_bar - 3.0 * 0.2 / 1.5).abs() < 1e-12);
    }

    #[test]
    fn useless_input_is_refused() {
        let a = solution(1.0, 2.0);
        assert!(extrapolate([1.0, 1.0, 0.5], [&a, &a, &a]).is_none());
        let other = Series { frames: vec![7], ..a.clone() };
        assert!(extrapolate([4.0, 2.0, 1.0], [&a, &other, &a]).is_none());
    }
}

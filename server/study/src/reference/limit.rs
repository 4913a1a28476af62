//! The limit of a sequence of refinements by least squares, with an honest error bar.
//!
//! The model u_i = u* + c h_iᵖ is fitted to solutions u_i on levels of size h_i. u* and c are fitted
//! component by component; one order p for all of them is found by scanning. Let σ be the standard deviation
//! of the fit and u_n the finest solution. Then the error bar is
//!
//! - 1.25 ‖u* − u_n‖ + σ, and at least the distance to the limit without the finest level, where the
//!   observed order is plausible; at least 1.25 ‖u_n − u_{n−1}‖ where that is more than the change before it;
//! - 1.25 max‖u_i − u_n‖ / min(1, r − 1) with r = h_first / h_n, where it is not, or only two levels
//!   ended: the spread of the levels, as if they converged by first order. Nothing is extrapolated then.
//!
//! # Source
//! Eça, Hoekstra, *A procedure for the estimation of the numerical uncertainty of CFD calculations
//! based on grid refinement studies*, J. Comput. Phys. 262 (2014), 104–130; safety factors there.

use crate::trial::series::Series;

/// Range of orders that are searched. A higher order, seen on few levels, is chance: 2 is then assumed.
const ORDERS: [f64; 2] = [0.5, 2.0];

/// Number of levels that are fitted, counted from the finest.
const LEVELS: usize = 4;

/// Factor between the estimated error and the bar.
const SAFETY: f64 = 1.25;

/// Largest credible σ of a fit, relative to the change by the last refinement.
const SCATTER: f64 = 0.5;

/// Error bar of a single run, whose own error is unknown.
pub const UNKNOWN: f64 = 1.0;

/// The limit of a sequence of refinements.
#[derive(Debug, Clone, PartialEq)]
pub struct Limit {
    /// Best value: the extrapolated solution, or the finest one.
    pub value: Series,
    /// Observed order; `None` if no plausible order shows.
    pub order: Option<f64>,
    /// Half-width of the error bar, relative to the norm of the value.
    pub error_bar: f64,
}

/// The limit of `levels` (size h and solution, coarse to fine). `smooth`: the levels solve the same problem,
/// so that an order can be expected. `None` if they share no instant or nothing moves.
pub fn limit(levels: &[(f64, &Series)], smooth: bool) -> Option<Limit> {
    let levels = &levels[levels.len().saturating_sub(LEVELS)..];
    let shared = at_common_instants(levels);
    let sizes: Vec<f64> = levels.iter().map(|(h, _)| *h).collect();
    let finest = shared.last()?;
    if finest.frames.is_empty() || finest.norm() == 0.0 || !shared.iter().all(Series::is_finite) {
        return None;
    }
    let fitted = if smooth { extrapolated(&sizes, &shared) } else { None };
    Some(fitted.unwrap_or_else(|| spread(&sizes, &shared)))
}

/// All series, restricted to their common instants.
fn at_common_instants(levels: &[(f64, &Series)]) -> Vec<Series> {
    let Some(((_, first), rest)) = levels.split_first() else { return Vec::new() };
    let common = rest.iter().fold((*first).clone(), |common, (_, next)| common.at_instants_of(next));
    levels.iter().map(|(_, series)| series.at_instants_of(&common)).collect()
}

/// The fitted limit; `None` if its order is not plausible.
fn extrapolated(sizes: &[f64], levels: &[Series]) -> Option<Limit> {
    let n = levels.len();
    if n < 3 || !sizes.windows(2).all(|pair| pair[0] > pair[1] && pair[1] > 0.0) {
        return None;
    }
    let order = best_order(sizes, levels)?;
    let (value, sigma) = fit(sizes, levels, order);
    let finest = &levels[n - 1];
    let last_change = finest.minus(&levels[n - 2]).norm();
    let change_before = levels[n - 2].minus(&levels[n - 3]).norm();
    if sigma > SCATTER * last_change || !value.is_finite() || value.norm() == 0.0 {
        return None;
    }
    let mut bar = SAFETY * value.minus(finest).norm() + sigma;
    if last_change > change_before {
        bar = bar.max(SAFETY * last_change);
    }
    if n > 3 {
        let before = &levels[..n - 1];
        let (earlier, _) = fit(&sizes[..n - 1], before, best_order(&sizes[..n - 1], before).unwrap_or(1.0));
        bar = bar.max(earlier.minus(&value).norm());
    }
    Some(Limit { error_bar: bar / value.norm(), value, order: Some(order) })
}

/// The order with the smallest residual; `None` at the lower end of the range.
fn best_order(sizes: &[f64], levels: &[Series]) -> Option<f64> {
    let steps = 60;
    let order = |i: usize| ORDERS[0] + (ORDERS[1] - ORDERS[0]) * i as f64 / steps as f64;
    let residuals = (0..=steps).map(|i| fit(sizes, levels, order(i)).1);
    let (best, _) = residuals.enumerate().min_by(|a, b| a.1.total_cmp(&b.1))?;
    // Differences that do not fall at all give a best fit at the lower bound.
    (best > 0).then(|| order(best))
}

/// u* for a given order, and the standard deviation of the fit.
fn fit(sizes: &[f64], levels: &[Series], order: f64) -> (Series, f64) {
    let n = sizes.len() as f64;
    let x: Vec<f64> = sizes.iter().map(|h| h.powf(order)).collect();
    let mean = x.iter().sum::<f64>() / n;
    let variance: f64 = x.iter().map(|x| (x - mean).powi(2)).sum();
    // u* = Σ w_i u_i, the intercept of the line through (x_i, u_i).
    let weights: Vec<f64> = x.iter().map(|x| 1.0 / n - mean * (x - mean) / variance).collect();
    let slopes: Vec<f64> = x.iter().map(|x| (x - mean) / variance).collect();
    let sum = |weights: &[f64]| {
        let nothing = levels[0].combine(0.0, &levels[0], 0.0);
        levels.iter().zip(weights).fold(nothing, |sum, (u, w)| sum.combine(1.0, u, *w))
    };
    let (value, slope) = (sum(&weights), sum(&slopes));
    let residual = |(u, x): (&Series, &f64)| u.minus(&value.combine(1.0, &slope, *x)).norm().powi(2);
    let sum_squared: f64 = levels.iter().zip(&x).map(residual).sum();
    (value, (sum_squared / (n - 2.0).max(1.0)).sqrt())
}

/// The finest solution, with the spread of the levels as its error bar.
fn spread(sizes: &[f64], levels: &[Series]) -> Limit {
    let n = levels.len();
    let value = levels[n - 1].clone();
    if n == 1 {
        return Limit { value, order: None, error_bar: UNKNOWN };
    }
    let far = levels.iter().map(|u| u.minus(&value).norm()).fold(0.0, f64::max);
    let ratio = sizes[0] / sizes[n - 1];
    let bar = SAFETY * far / (ratio - 1.0).clamp(1e-3, 1.0);
    Limit { error_bar: bar / value.norm(), value, order: None }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn of(u: &[f64]) -> Series {
        Series { frames: vec![0], displacement_m: u.to_vec(), energy_j: vec![u[0]] }
    }

    fn power(h: f64, p: f64) -> Series {
        of(&[1.0 - 0.3 * h.powf(p), -2.0 + 0.7 * h.powf(p), 0.0])
    }

    #[test]
    fn a_pure_power_is_extrapolated_and_the_bar_holds_its_error() {
        for p in [1.0, 1.5, 2.0] {
            let sizes = [1.0, 0.7, 0.5];
            let series = sizes.map(|h| power(h, p));
            let levels: Vec<_> = sizes.iter().copied().zip(&series).collect();
            let found = limit(&levels, true).unwrap();
            assert!((found.order.unwrap() - p).abs() < 0.03, "{p}: {:?}", found.order);
            let exact = of(&[1.0, -2.0, 0.0]);
            let error = found.value.minus(&exact).norm() / exact.norm();
            assert!(error < 0.01 && error < found.error_bar, "{p}: {error} ± {}", found.error_bar);
        }
    }

    #[test]
    fn noise_is_not_extrapolated_and_the_bar_is_its_spread() {
        let sizes = [1.0, 0.7, 0.5, 0.35];
        let series = [1.0, 1.2, 0.9, 1.1].map(|u| of(&[u, 0.0, 0.0]));
        let levels: Vec<_> = sizes.iter().copied().zip(&series).collect();
        let found = limit(&levels, true).unwrap();
        assert_eq!((found.order, &found.value), (None, &series[3]));
        assert!((found.error_bar - 1.25 * 0.2 / 1.1).abs() < 1e-12, "{}", found.error_bar);
    }

    #[test]
    fn levels_that_solve_different_problems_are_not_extrapolated() {
        let sizes = [1.0, 0.5, 0.25];
        let series = sizes.map(|h| power(h, 1.0));
        let levels: Vec<_> = sizes.iter().copied().zip(&series).collect();
        assert!(limit(&levels, false).unwrap().order.is_none());
    }

    /// A region is selected a little differently on every level: the levels approach the limit unevenly.
    #[test]
    fn changes_that_grow_again_are_within_the_bar() {
        let sizes = [1.0, 0.66, 0.5, 0.33];
        let series = [0.9912, 1.0018, 1.0014, 1.0042].map(|u| of(&[u, -0.3 * u, 0.0]));
        let levels: Vec<_> = sizes.iter().copied().zip(&series).collect();
        let found = limit(&levels, true).unwrap();
        let last = series[3].minus(&series[2]).norm() / series[3].norm();
        assert!(found.error_bar > 1.2 * last, "{last} ± {}", found.error_bar);
    }

    #[test]
    fn few_levels_have_wide_bars() {
        let (a, b) = (power(1.0, 1.0), power(0.7, 1.0));
        let two = limit(&[(1.0, &a), (0.7, &b)], true).unwrap();
        let error = b.minus(&of(&[1.0, -2.0, 0.0])).norm() / b.norm();
        assert!(two.order.is_none() && two.error_bar > error, "{} ± {}", error, two.error_bar);
        assert_eq!(limit(&[(1.0, &a)], true).unwrap().error_bar, UNKNOWN);
        assert!(limit(&[], true).is_none());
        let still = of(&[0.0; 3]);
        assert!(limit(&[(1.0, &still), (0.5, &still)], true).is_none(), "nothing moves");
    }

    #[test]
    fn a_faster_fall_than_second_order_is_taken_for_second() {
        let sizes = [1.0, 0.7, 0.5];
        let series = sizes.map(|h| power(h, 3.5));
        let levels: Vec<_> = sizes.iter().copied().zip(&series).collect();
        let found = limit(&levels, true).unwrap();
        assert_eq!(found.order, Some(2.0));
        let exact = of(&[1.0, -2.0, 0.0]);
        assert!(found.value.minus(&exact).norm() / exact.norm() < found.error_bar);
    }
}

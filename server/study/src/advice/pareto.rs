//! The Pareto front: configurations such that no other one tried is both as fast and as accurate.

/// An error counts as smaller only if it is smaller by this fraction. Less is lost in the noise of times.
const WORTH: f64 = 0.01;

/// Indices of the points (cost, error) on the front, by rising cost and falling error. Points that are not
/// finite are never on it. Of equal points only the first is.
pub fn front(points: &[(f64, f64)]) -> Vec<usize> {
    let usable = |i: &usize| points[*i].0.is_finite() && points[*i].1.is_finite();
    let mut order: Vec<usize> = (0..points.len()).filter(usable).collect();
    order.sort_by(|&a, &b| {
        points[a].0.total_cmp(&points[b].0).then(points[a].1.total_cmp(&points[b].1)).then(a.cmp(&b))
    });
    let mut best = f64::INFINITY;
    order.retain(|&i| {
        let better = points[i].1 < best * (1.0 - WORTH);
        if better {
            best = points[i].1;
        }
        better
    });
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_nothing_beats() {
        let points = [(1.0, 0.5), (2.0, 0.6), (3.0, 0.1), (0.5, 0.9), (3.0, 0.05), (9.0, 0.05)];
        assert_eq!(front(&points), [3, 0, 4]);
    }

    #[test]
    fn failures_and_twins() {
        let points = [(f64::NAN, 0.0), (1.0, f64::INFINITY), (1.0, 0.2), (1.0, 0.2), (f64::INFINITY, 0.1)];
        assert_eq!(front(&points), [2]);
        assert!(front(&[]).is_empty());
        assert_eq!(front(&[(1.0, 0.2), (2.0, 0.1999), (3.0, 0.19)]), [0, 2], "too little to be worth it");
    }

    /// Compares with the definition on points of a fixed congruential sequence.
    #[test]
    fn agrees_with_the_definition() {
        let mut state = 1_u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(1 + (state >> 26))
        };
        // Integers up to 64 differ by more than the threshold.
        let points: Vec<(f64, f64)> = (0..300).map(|_| (next(), next())).collect();
        let front = front(&points);
        for (i, p) in points.iter().enumerate() {
            let beaten = points.iter().any(|q| q.0 <= p.0 && q.1 <= p.1 && (q.0 < p.0 || q.1 < p.1));
            let on_front = front.iter().any(|&j| points[j] == *p);
            assert_eq!(on_front, !beaten, "{i} {p:?}");
        }
    }
}

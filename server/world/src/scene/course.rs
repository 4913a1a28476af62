//! How a load or a displacement changes over time.

/// The share of a full value that acts at each time: linear between given points, constant before the first and after
/// the last. Without points the whole value acts always.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Course {
    /// Times [s], rising, and the share there.
    points: Vec<[f64; 2]>,
}

impl Course {
    /// Grows from nothing to the whole within `ramp_s` [s] from the start of the run; 0: the whole always.
    pub fn ramp(ramp_s: f64) -> Self {
        Self { points: if ramp_s > 0.0 { vec![[0.0, 0.0], [ramp_s, 1.0]] } else { Vec::new() } }
    }

    /// Through these `points`, whose times rise.
    pub fn table(points: Vec<[f64; 2]>) -> Self {
        Self { points }
    }

    /// Whether the whole value acts always.
    pub fn is_constant(&self) -> bool {
        self.points.is_empty()
    }

    /// The share at `time_s` [s].
    pub fn share(&self, time_s: f64) -> f64 {
        let after = self.points.partition_point(|[t, _]| *t <= time_s);
        match (after.checked_sub(1).map(|at| self.points[at]), self.points.get(after)) {
            (Some([from_s, from]), Some(&[to_s, to])) => {
                from + (to - from) * ((time_s - from_s) / (to_s - from_s))
            }
            (Some([_, share]), None) | (None, Some(&[_, share])) => share,
            (None, None) => 1.0,
        }
    }

    /// From when on it no longer changes [s].
    pub fn end_s(&self) -> f64 {
        self.points.last().map_or(0.0, |point| point[0])
    }
}

#[cfg(test)]
mod tests {
    use super::Course;

    #[test]
    fn shares_lie_between_those_of_the_points() {
        let ramp = Course::ramp(0.4);
        assert_eq!([-1.0, 0.0, 0.1, 0.4, 9.0].map(|t| ramp.share(t)), [0.0, 0.0, 0.25, 1.0, 1.0]);
        assert_eq!((ramp.end_s(), Course::ramp(0.0).share(0.0)), (0.4, 1.0));
        let there_and_back = Course::table(vec![[0.5, 0.0], [1.0, 2.0], [2.0, -2.0]]);
        let shares = [0.0, 0.75, 1.0, 1.5, 2.0, 3.0].map(|t| there_and_back.share(t));
        assert_eq!(shares, [0.0, 1.0, 2.0, 0.0, -2.0, -2.0]);
        assert!(Course::default().is_constant() && Course::default().share(7.0) == 1.0);
    }
}

//! Data of a run for comparison: displacements of the probes and energy, at one or more instants.

use serde::{Deserialize, Serialize};

/// Displacements and energy at some instants. A static solution has one instant.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Series {
    /// Instants, as frame numbers of the case.
    pub frames: Vec<u32>,
    /// Displacement of every probe [m]: x, y, z of each probe, instant after instant.
    pub displacement_m: Vec<f64>,
    /// Elastic energy [J] at every instant.
    pub energy_j: Vec<f64>,
}

impl Series {
    /// Number of displacement components per instant.
    pub fn width(&self) -> usize {
        self.displacement_m.len().checked_div(self.frames.len()).unwrap_or(0)
    }

    /// Displacements at instant `i`.
    pub fn at(&self, i: usize) -> &[f64] {
        let width = self.width();
        &self.displacement_m[i * width..(i + 1) * width]
    }

    /// a·self + b·other at the common instants.
    pub fn combine(&self, a: f64, other: &Series, b: f64) -> Series {
        let mut out = Series::default();
        for (i, j) in common(self, other) {
            out.frames.push(self.frames[i]);
            let mixed = self.at(i).iter().zip(other.at(j)).map(|(x, y)| a * x + b * y);
            out.displacement_m.extend(mixed);
            out.energy_j.push(a * self.energy_j[i] + b * other.energy_j[j]);
        }
        out
    }

    /// self − other at the common instants.
    pub fn minus(&self, other: &Series) -> Series {
        self.combine(1.0, other, -1.0)
    }

    /// √Σ|u|² over probes and instants [m].
    pub fn norm(&self) -> f64 {
        self.displacement_m.iter().map(|u| u * u).sum::<f64>().sqrt()
    }

    /// √ΣΨ² over the instants [J].
    pub fn energy_norm(&self) -> f64 {
        self.energy_j.iter().map(|e| e * e).sum::<f64>().sqrt()
    }

    /// The same restricted to the instants of `other`.
    pub fn at_instants_of(&self, other: &Series) -> Series {
        self.combine(1.0, other, 0.0)
    }

    /// Whether every number is finite.
    pub fn is_finite(&self) -> bool {
        self.displacement_m.iter().chain(&self.energy_j).all(|x| x.is_finite())
    }
}

/// Indices of the common instants. Both lists ascend.
fn common(a: &Series, b: &Series) -> Vec<(usize, usize)> {
    let find = |(i, frame): (usize, &u32)| Some((i, b.frames.binary_search(frame).ok()?));
    a.frames.iter().enumerate().filter_map(find).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_common_instants_are_compared() {
        let a = Series { frames: vec![1, 2, 4], displacement_m: vec![1.0, 2.0, 4.0], energy_j: vec![1.0; 3] };
        let b = Series { frames: vec![2, 3, 4], displacement_m: vec![2.5, 9.0, 4.0], energy_j: vec![0.5; 3] };
        let d = a.minus(&b);
        assert_eq!(d.frames, [2, 4]);
        assert_eq!(d.displacement_m, [-0.5, 0.0]);
        assert_eq!(d.energy_j, [0.5, 0.5]);
        assert_eq!(a.at_instants_of(&b).displacement_m, [2.0, 4.0]);
    }
}

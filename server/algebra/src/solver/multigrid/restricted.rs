//! Springs on a coarse level: k PᵀJ JᵀP.

use crate::operator::{Block6, Inverse3, Padded, Spring};

/// Springs by the vertices of a level. Prescribed directions make the weights of x, y and z differ.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct RestrictedSprings {
    springs: Vec<Restricted>,
    /// Vertices and weights of all springs, one after the other.
    entries: Vec<(u32, [f32; 3])>,
}

#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
struct Restricted {
    /// First of its entries.
    first: usize,
    /// Unit vector of the stiff direction, or `None` if all three are stiff.
    direction: Option<[f32; 3]>,
    /// Factor of J Jᵀ.
    stiffness: f32,
}

impl RestrictedSprings {
    /// Forgets all springs.
    pub(super) fn clear(&mut self) {
        self.springs.clear();
        self.entries.clear();
    }

    /// Begins the next spring, without weights.
    pub(super) fn begin(&mut self, spring: &Spring) {
        let Spring { direction, stiffness, .. } = *spring;
        self.springs.push(Restricted { first: self.entries.len(), direction, stiffness });
    }

    /// Adds a weight of vertex `v` to the last spring.
    pub(super) fn add(&mut self, v: u32, weight: [f32; 3]) {
        let first = self.springs.last().map_or(0, |spring| spring.first);
        match self.entries[first..].iter_mut().find(|e| e.0 == v) {
            Some((_, known)) => known.iter_mut().zip(weight).for_each(|(known, w)| *known += w),
            None => self.entries.push((v, weight)),
        }
    }

    /// Sets the weights of prescribed directions, one bit each, to 0.
    pub(super) fn hold(&mut self, held: &[u8]) {
        for (v, weight) in &mut self.entries {
            (0..3).filter(|k| held[*v as usize] >> k & 1 == 1).for_each(|k| weight[k] = 0.0);
        }
    }

    /// Whether there are none.
    pub(super) fn is_empty(&self) -> bool {
        self.springs.is_empty()
    }

    /// Calls `visit` with every vertex of every spring.
    pub(super) fn for_vertices(&self, visit: impl FnMut(u32)) {
        self.entries.iter().map(|e| e.0).for_each(visit);
    }

    fn of(&self, s: usize) -> (&Restricted, &[(u32, [f32; 3])]) {
        let end = self.springs.get(s + 1).map_or(self.entries.len(), |next| next.first);
        (&self.springs[s], &self.entries[self.springs[s].first..end])
    }

    /// y += Σ k PᵀJ JᵀP x.
    pub(super) fn add_to(&self, x: &[Padded], y: &mut [Padded]) {
        for s in 0..self.springs.len() {
            let (spring, entries) = self.of(s);
            let mut p = [0.0; 3];
            for (v, w) in entries {
                (0..3).for_each(|k| p[k] += w[k] * x[*v as usize][k]);
            }
            let f = match spring.direction {
                Some(n) => {
                    let along = spring.stiffness * (n[0] * p[0] + n[1] * p[1] + n[2] * p[2]);
                    n.map(|n| along * n)
                }
                None => p.map(|p| spring.stiffness * p),
            };
            for (v, w) in entries {
                (0..3).for_each(|k| y[*v as usize][k] += w[k] * f[k]);
            }
        }
    }

    /// Adds the springs at vertex `v` to its diagonal block.
    pub(super) fn add_to_block(&self, v: u32, block: &mut Block6) {
        for s in 0..self.springs.len() {
            let (spring, entries) = self.of(s);
            let Some((_, w)) = entries.iter().find(|e| e.0 == v) else { continue };
            for (k, i, j) in [(0, 0, 0), (1, 0, 1), (2, 0, 2), (4, 1, 1), (5, 1, 2), (6, 2, 2)] {
                let n = spring.direction.map_or(f32::from(u8::from(i == j)), |n| n[i] * n[j]);
                block[k] += spring.stiffness * w[i] * w[j] * n;
            }
        }
    }

    /// k JᵀP D⁻¹ PᵀJ of spring `s`, with the inverse blocks of D.
    pub(super) fn compliance(&self, s: usize, inverse: impl Fn(u32) -> Inverse3) -> f64 {
        let (spring, entries) = self.of(s);
        let mut sum = 0.0;
        for &(v, w) in entries {
            let [x, y, z] = inverse(v).columns();
            let along: f32 = match spring.direction {
                Some(n) => {
                    let n = [0, 1, 2].map(|k| w[k] * n[k]);
                    (0..3).map(|i| n[i] * (x[i] * n[0] + y[i] * n[1] + z[i] * n[2])).sum()
                }
                None => w[0] * w[0] * x[0] + w[1] * w[1] * y[1] + w[2] * w[2] * z[2],
            };
            sum += f64::from(along);
        }
        f64::from(spring.stiffness) * sum
    }

    /// A bound of the largest eigenvalue of D⁻¹A with springs, where it is `known` without them and `inverse` has
    /// them; 0 without springs.
    ///
    /// # Derivation
    /// For a spring with c vertices S ≤ c D (Cauchy–Schwarz) and S ≤ κ D with κ its [compliance](Self::compliance);
    /// the smaller bound of the sums counts.
    pub(super) fn raise(&self, known: f64, inverse: impl Fn(u32) -> Inverse3) -> f64 {
        if self.is_empty() {
            return 0.0;
        }
        let (mut most, mut sum) = (known, known);
        for s in 0..self.springs.len() {
            sum += self.compliance(s, &inverse);
            most = most.max(self.of(s).1.len() as f64);
        }
        most.min(sum)
    }
}

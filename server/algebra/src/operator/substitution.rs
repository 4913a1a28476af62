//! A change of variables u = T û in which degenerate elements are no longer stiff: the displacement
//! of some copies is written relative to that of others.
//!
//! A needle, sliver or cap of relative height ε resists one motion 1/ε times as much as a sound element:
//! that of some copy a against a mean Σ λ_b u_b of the others. All diagonal blocks around it are that
//! stiff, and no block-diagonal preconditioner can see the soft motions, in which these copies move
//! together. With u_a = û_a + Σ λ_b û_b only the block of û_a is stiff, and conjugate gradients
//! preconditioned by M⁻¹ = T diag(TᵀA T)⁻¹ Tᵀ take as many iterations as on a sound mesh.
//!
//! # Source
//! Hierarchical bases as preconditioners: Yserentant 1986; the substitution of degrees of freedom is
//! that of Jeřábková 2007, ch. 3, here only inside the solver.

use nalgebra::Vector3;

use super::Padded;

/// Entries of the vectors that T can be applied to.
pub trait Substitutable: Copy {
    /// self += factor · other.
    fn add_scaled(&mut self, other: &Self, factor: f64);
}

impl Substitutable for Padded {
    #[inline]
    fn add_scaled(&mut self, other: &Self, factor: f64) {
        for (v, o) in self.iter_mut().zip(other) {
            *v += factor as f32 * o;
        }
    }
}

impl Substitutable for Vector3<f64> {
    #[inline]
    fn add_scaled(&mut self, other: &Self, factor: f64) {
        *self += factor * other;
    }
}

impl Substitutable for Vector3<f32> {
    #[inline]
    fn add_scaled(&mut self, other: &Self, factor: f64) {
        *self += factor as f32 * other;
    }
}

impl Substitutable for f64 {
    #[inline]
    fn add_scaled(&mut self, other: &Self, factor: f64) {
        *self += factor * other;
    }
}

/// T, as a product of steps u_a = û_a + Σ λ_b û_b; empty where nothing is substituted.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Substitution {
    /// Copy a of every step, and the end of its entries in `leaders`.
    steps: Vec<(u32, u32)>,
    /// b and λ_b of all steps.
    leaders: Vec<(u32, f64)>,
    /// Step of every copy, `NONE` if it has none; empty if no copy has one.
    step_of: Vec<u32>,
    /// Copies b that some step refers to, ascending, and the end of their entries in `entries`.
    columns: Vec<(u32, u32)>,
    /// Columns of T of these copies: copy a and T_ab.
    entries: Vec<(u32, f64)>,
}

const NONE: u32 = u32::MAX;

impl Substitution {
    /// The identity on `n` copies; [`push`](Self::push) adds steps.
    pub fn new(n: usize) -> Self {
        Self { step_of: vec![NONE; n], ..Self::default() }
    }

    /// Whether T = 1.
    pub fn is_empty(&self) -> bool {
        self.steps.is_empty()
    }

    /// Number of copies whose displacement is relative to that of others.
    pub fn len(&self) -> usize {
        self.steps.len()
    }

    /// Whether the displacement of `copy` is relative to that of others.
    pub fn substitutes(&self, copy: u32) -> bool {
        self.step_of.get(copy as usize).is_some_and(|&step| step != NONE)
    }

    /// Adds the step u_a = û_a + Σ λ_b û_b. Neither `a` nor any b may have a step.
    pub fn push(&mut self, a: u32, leaders: impl Iterator<Item = (u32, f64)>) {
        self.step_of[a as usize] = self.steps.len() as u32;
        self.leaders.extend(leaders);
        self.steps.push((a, self.leaders.len() as u32));
    }

    /// Computes the columns of T; call it after the last [`push`](Self::push).
    pub fn finish(&mut self) {
        let mut entries: Vec<(u32, u32, f64)> = Vec::new();
        let mut row = Vec::new();
        for &(a, _) in &self.steps {
            row.clear();
            row.push((a, 1.0));
            self.gather(&mut row);
            entries.extend(row.iter().filter(|&&(b, _)| b != a).map(|&(b, w)| (b, a, w)));
        }
        let mut led: Vec<u32> = entries.iter().map(|e| e.0).collect();
        led.sort_unstable();
        led.dedup();
        entries.extend(led.iter().map(|&b| (b, b, 1.0)));
        entries.sort_unstable_by_key(|e| (e.0, e.1));
        self.columns.clear();
        let ends = led.iter().map(|&b| (b, entries.partition_point(|e| e.0 <= b) as u32));
        self.columns.extend(ends);
        self.entries = entries.into_iter().map(|(_, a, w)| (a, w)).collect();
    }

    /// Columns of T with more than their diagonal entry, ascending: copy b, and all a with T_ab ≠ 0.
    pub fn columns(&self) -> impl Iterator<Item = (u32, &[(u32, f64)])> {
        let first = |c: usize| if c == 0 { 0 } else { self.columns[c - 1].1 as usize };
        let column = move |(c, &(b, end)): (usize, &(u32, u32))| (b, &self.entries[first(c)..end as usize]);
        self.columns.iter().enumerate().map(column)
    }

    /// Multiplies a row vector on a few copies by T. Copies that steps refer to are added or appended.
    pub fn gather<V: Substitutable>(&self, row: &mut Vec<(u32, V)>) {
        let mut from = 0;
        loop {
            let steps = row.iter().map(|r| self.step_of.get(r.0 as usize).copied().unwrap_or(NONE));
            let Some(step) = steps.filter(|&step| step != NONE && step >= from).min() else { return };
            let (a, leaders) = self.step(step as usize);
            let Some(value) = row.iter().find(|r| r.0 == a).map(|r| r.1) else { return };
            for &(b, lambda) in leaders {
                match row.iter_mut().find(|r| r.0 == b) {
                    Some(found) => found.1.add_scaled(&value, lambda),
                    None => {
                        let mut scaled = value;
                        scaled.add_scaled(&value, lambda - 1.0);
                        row.push((b, scaled));
                    }
                }
            }
            from = step + 1;
        }
    }

    fn step(&self, step: usize) -> (u32, &[(u32, f64)]) {
        let first = if step == 0 { 0 } else { self.steps[step - 1].1 as usize };
        let (a, end) = self.steps[step];
        (a, &self.leaders[first..end as usize])
    }

    /// r ← Tᵀ r: forces on the new variables.
    pub fn fold<V: Substitutable>(&self, r: &mut [V]) {
        for step in 0..self.steps.len() {
            let (a, leaders) = self.step(step);
            let force = r[a as usize];
            leaders.iter().for_each(|&(b, lambda)| r[b as usize].add_scaled(&force, lambda));
        }
    }

    /// z ← T z: displacements of the copies.
    pub fn unfold<V: Substitutable>(&self, z: &mut [V]) {
        for step in (0..self.steps.len()).rev() {
            let (a, leaders) = self.step(step);
            let mut moved = z[a as usize];
            leaders.iter().for_each(|&(b, lambda)| moved.add_scaled(&z[b as usize], lambda));
            z[a as usize] = moved;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// u_3 = û_3 + ½ û_1 + ½ û_2, then u_2 = û_2 + û_0.
    fn chain() -> Substitution {
        let mut T = Substitution::new(5);
        T.push(3, [(1, 0.5), (2, 0.5)].into_iter());
        T.push(2, [(0, 1.0)].into_iter());
        T.finish();
        T
    }

    #[test]
    fn columns_rows_and_both_products_are_those_of_one_matrix() {
        let T = chain();
        let n = 5;
        let mut matrix = vec![vec![0.0; n]; n]; // by columns
        for (b, column) in matrix.iter_mut().enumerate() {
            column[b] = 1.0;
            T.unfold(column);
        }
        assert_eq!(matrix[0], [1.0, 0.0, 1.0, 0.5, 0.0]);
        for a in 0..n {
            let mut row = vec![0.0; n];
            row[a] = 1.0;
            T.fold(&mut row);
            let mut sparse = vec![(a as u32, 1.0)];
            T.gather(&mut sparse);
            for b in 0..n {
                assert_eq!(row[b], matrix[b][a]);
                let found = sparse.iter().find(|s| s.0 as usize == b).map_or(0.0, |s| s.1);
                assert_eq!(found, matrix[b][a], "{a} {b}");
            }
        }
        let columns: Vec<(u32, Vec<(u32, f64)>)> = T.columns().map(|(b, c)| (b, c.to_vec())).collect();
        assert_eq!(columns[0], (0, vec![(0, 1.0), (2, 1.0), (3, 0.5)]));
        assert_eq!(columns[1], (1, vec![(1, 1.0), (3, 0.5)]));
        assert_eq!(columns[2], (2, vec![(2, 1.0), (3, 0.5)]));
        assert!(T.substitutes(2) && T.substitutes(3) && !T.substitutes(0) && T.len() == 2);
    }

    #[test]
    fn nothing_is_nothing() {
        let T = Substitution::default();
        let mut v = [[1.0_f32, 2.0, 3.0, 0.0]];
        T.fold(&mut v);
        T.unfold(&mut v);
        assert!(T.is_empty() && v == [[1.0, 2.0, 3.0, 0.0]] && T.columns().count() == 0);
    }
}

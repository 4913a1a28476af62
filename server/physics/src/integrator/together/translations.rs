//! The translations of all free parts of a group, balanced exactly.

use nalgebra::{Matrix3, Vector3};

use super::Member;
use crate::integrator::pair_springs::ActivePair;

/// Relative residual at which the translations are found.
const TOLERANCE: f64 = 1e-14;

/// The translation equations of the free parts of a group: their masses and springs, and the springs between them.
#[derive(Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct SharedTranslations {
    /// Number of the first part of every member, and of the last one's end.
    first: Vec<usize>,
    /// Whether a part is free.
    free: Vec<bool>,
    matrix: Vec<Matrix3<f64>>,
    /// Springs between two parts, at least one of them free.
    links: Vec<(usize, usize, Matrix3<f64>)>,
    b: Vec<Vector3<f64>>,
    t: Vec<Vector3<f64>>,
    r: Vec<Vector3<f64>>,
    z: Vec<Vector3<f64>>,
    p: Vec<Vector3<f64>>,
    q: Vec<Vector3<f64>>,
    inverse: Vec<Matrix3<f64>>,
}

impl SharedTranslations {
    /// Moves every free part to where its momentum is balanced with the present δ, places and modes of springs.
    /// Returns whether any part is free.
    pub(super) fn balance(&mut self, members: &mut [Member<'_>], pairs: &[ActivePair]) -> bool {
        if !members.iter().any(|member| member.inputs.step.parts.any_free()) {
            return false;
        }
        self.gather(members, pairs);
        self.solve();
        for (member, first) in members.iter_mut().zip(&self.first) {
            let parts = member.inputs.step.parts.len();
            for part in 0..parts {
                member.step.shift_part(part, &self.t[first + part]);
            }
        }
        true
    }

    fn gather(&mut self, members: &mut [Member<'_>], pairs: &[ActivePair]) {
        self.first.clear();
        let mut n = 0;
        for member in members.iter() {
            self.first.push(n);
            n += member.inputs.step.parts.len();
        }
        self.free.clear();
        self.matrix.clear();
        self.matrix.resize(n, Matrix3::zeros());
        for v in [&mut self.b, &mut self.t, &mut self.r, &mut self.z, &mut self.p, &mut self.q] {
            v.clear();
            v.resize(n, Vector3::zeros());
        }
        for (member, &first) in members.iter_mut().zip(&self.first) {
            self.free.extend_from_slice(&member.inputs.step.parts.free);
            let (matrix, b) = (&mut self.matrix, &mut self.b);
            let (step, own) = member.split();
            step.imbalance(&own, |part, S, imbalance| {
                matrix[first + part] = *S;
                b[first + part] = *imbalance;
            });
        }
        self.links.clear();
        for pair in pairs {
            let part = |(body, copy): (u32, u32)| {
                let member = &members[body as usize];
                self.first[body as usize] + member.inputs.step.parts.of_copy[copy as usize] as usize
            };
            let [a, c] = pair.main.map(part);
            let s = members[pair.main[0].0 as usize].inputs.s();
            let f = s * pair.law.force(pair.y);
            self.b[a] += f;
            self.b[c] -= f;
            if a != c && (self.free[a] || self.free[c]) {
                self.links.push((a, c, s * pair.law.stiffness()));
            }
        }
        self.inverse.clear();
        self.inverse.extend_from_slice(&self.matrix);
        for (a, c, S) in &self.links {
            self.inverse[*a] += S;
            self.inverse[*c] += S;
        }
        for (inverse, free) in self.inverse.iter_mut().zip(&self.free) {
            *inverse = inverse.try_inverse().filter(|_| *free).unwrap_or_else(Matrix3::zeros);
        }
    }

    /// Conjugate gradients on the few equations, with 3×3 block-Jacobi.
    fn solve(&mut self) {
        let n = self.b.len();
        for i in 0..n {
            self.r[i] = if self.free[i] { self.b[i] } else { Vector3::zeros() };
            self.z[i] = self.inverse[i] * self.r[i];
            self.p[i] = self.z[i];
        }
        let mut rz = dot(&self.r, &self.z);
        let target = TOLERANCE * TOLERANCE * rz;
        for _ in 0..6 * n {
            if rz <= target || !rz.is_finite() {
                break;
            }
            for i in 0..n {
                self.q[i] = self.matrix[i] * self.p[i];
            }
            for (a, c, S) in &self.links {
                let f = S * (self.p[*a] - self.p[*c]);
                self.q[*a] += f;
                self.q[*c] -= f;
            }
            for (q, free) in self.q.iter_mut().zip(&self.free) {
                if !free {
                    *q = Vector3::zeros();
                }
            }
            let alpha = rz / dot(&self.p, &self.q);
            for i in 0..n {
                self.t[i] += alpha * self.p[i];
                self.r[i] -= alpha * self.q[i];
                self.z[i] = self.inverse[i] * self.r[i];
            }
            let next = dot(&self.r, &self.z);
            let beta = next / rz;
            rz = next;
            for i in 0..n {
                self.p[i] = self.z[i] + beta * self.p[i];
            }
        }
        if !self.t.iter().all(|t| t.iter().all(|c| c.is_finite())) {
            self.t.fill(Vector3::zeros());
        }
    }
}

fn dot(a: &[Vector3<f64>], b: &[Vector3<f64>]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(b)).sum()
}

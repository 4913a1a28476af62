//! K̂ = Σ R K_e Rᵀ: the small-strain stiffness, rotated with each element. Rayleigh damping uses it for
//! every law, as a viscosity that does not resist rigid motion.
//!
//! With rotated gradients g′ = R ∇N at every quadrature point
//! K̂_ab = Σ w (λ g′_a g′_bᵀ + μ g′_b g′_aᵀ + μ (g′_a·g′_b) I).
//!
//! # Source
//! Müller, Gross 2004; Jeřábková 2007, (3.51), whose diagonal damping (2.35) is not objective.

use nalgebra::{Matrix3, Vector3};
use scindo_matter::element::polar_rotation;
use scindo_matter::material::{Corotational, Lame, Law};

use super::{BlockCsr, Model};

/// Largest number of nodes per element, that of Tet10.
const MOST_NODES: usize = 10;

impl Model {
    /// K̂ [N/m] at the positions `x` [m]; overwrites the blocks of `K`, which has the model's pattern.
    pub fn rotated_stiffness(&self, x: &[Vector3<f64>], K: &mut BlockCsr<f64>) {
        K.clear();
        self.for_rotated_gradients(x, |nodes, (w, lame), g| {
            for (&i, g_a) in nodes.iter().zip(g) {
                for (&j, g_b) in nodes.iter().zip(g) {
                    let Some(at) = K.position(i as usize, j) else { continue };
                    let (lambda, mu) = (w * lame.lambda, w * lame.mu);
                    let trace = mu * g_a.dot(g_b);
                    let block = &mut K.blocks[at];
                    for r in 0..3 {
                        for c in 0..3 {
                            block[3 * r + c] += lambda * g_a[r] * g_b[c] + mu * g_b[r] * g_a[c];
                        }
                        block[4 * r] += trace;
                    }
                }
            }
        });
    }

    /// f += s K̂ v with K̂ at the positions `x` [m], without assembling it.
    pub fn add_rotated_stiffness_times(
        &self,
        s: f64,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
        f: &mut [Vector3<f64>],
    ) {
        self.for_rotated_gradients(x, |nodes, (w, lame), g| {
            let mut H = Matrix3::zeros();
            for (&i, g_a) in nodes.iter().zip(g) {
                H += v[i as usize] * g_a.transpose();
            }
            let stress = s
                * w
                * (lame.mu * (H + H.transpose()) + Matrix3::from_diagonal_element(lame.lambda * H.trace()));
            for (&i, g_a) in nodes.iter().zip(g) {
                f[i as usize] += stress * g_a;
            }
        });
    }

    /// K += the [twists](Corotational::twists) of the stretches at `from` [m], turned by the rotations at `x`. Only the
    /// corotational law has them.
    pub fn add_twists(&self, x: &[Vector3<f64>], from: &[Vector3<f64>], K: &mut BlockCsr<f64>) {
        if self.law() != Law::Corotational {
            return;
        }
        self.for_points_rotated(x, |(e, q), R, (w, lame), g| {
            let Q = w * R * Corotational(lame).twists(&self.deformation_gradient(e, q, from)) * R.transpose();
            let nodes = self.element(e);
            for (&i, g_a) in nodes.iter().zip(g) {
                let across = -0.5 * g_a.cross_matrix() * Q;
                for (&j, g_b) in nodes.iter().zip(g) {
                    let Some(at) = K.position(i as usize, j) else { continue };
                    let block = across * g_b.cross_matrix();
                    for (entry, k) in K.blocks[at].iter_mut().enumerate() {
                        *k += block[(entry / 3, entry % 3)];
                    }
                }
            }
        });
    }

    /// f += K̂ at `x` times what its product with `from` [m] misses of the strain there: strains ε = sym(RᵀF) − I know
    /// their own rotation, and K̂ takes a turn for an expansion. So K̂ (x − from) − f is the force of the change of strain.
    pub fn add_turned_strain(&self, x: &[Vector3<f64>], from: &[Vector3<f64>], f: &mut [Vector3<f64>]) {
        if self.law() == Law::Linear {
            return;
        }
        self.for_points_rotated(x, |(e, q), R, (w, lame), g| {
            let F = self.deformation_gradient(e, q, from);
            let own = polar_rotation(&F, &Matrix3::identity()).transpose() * F;
            let turned = R.transpose() * F;
            let missed = 0.5 * (own + own.transpose() - turned - turned.transpose());
            let stress = R
                * (2.0 * lame.mu * missed + Matrix3::from_diagonal_element(lame.lambda * missed.trace()))
                * R.transpose();
            for (&i, g_a) in self.element(e).iter().zip(g) {
                f[i as usize] += w * stress * g_a;
            }
        });
    }

    /// Calls `visit(nodes, (weight, Lamé constants), R ∇N)` at every quadrature point, in order.
    fn for_rotated_gradients(
        &self,
        x: &[Vector3<f64>],
        mut visit: impl FnMut(&[u32], (f64, Lame), &[Vector3<f64>]),
    ) {
        self.for_points_rotated(x, |(e, _), _, constants, g| visit(self.element(e), constants, g));
    }

    /// Calls `visit((element, point), R, (weight, Lamé constants), R ∇N)` at every quadrature point, in order.
    fn for_points_rotated(
        &self,
        x: &[Vector3<f64>],
        mut visit: impl FnMut((usize, usize), &Matrix3<f64>, (f64, Lame), &[Vector3<f64>]),
    ) {
        let mut rotated = [Vector3::zeros(); MOST_NODES];
        for e in 0..self.n_elements() {
            let lame = self.point_of(e).lame;
            for (q, &w) in self.weights(e).iter().enumerate() {
                let g = self.gradients(e, q);
                let R = match self.law() {
                    Law::Linear => Matrix3::identity(),
                    _ => polar_rotation(&self.deformation_gradient(e, q, x), &Matrix3::identity()),
                };
                rotated.iter_mut().zip(g).for_each(|(r, g)| *r = R * g);
                visit((e, q), &R, (w, lame), &rotated[..g.len()]);
            }
        }
    }
}

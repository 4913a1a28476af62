//! Energy, internal forces and tangent of a model.

use nalgebra::{Matrix3, SMatrix, Vector3};
use scindo_matter::element::{ElementKind, deformation_gradient};
use scindo_matter::material::{Law, Split, Tangent};

use super::kernel::{add_forces, add_green_blocks, add_upper_blocks, mirror};
use super::point::projected;
use super::scratch::Buffers;
use super::{BlockCsr, Model, Volumetric};

/// Where and how a tangent is taken.
#[derive(Clone, Copy, Debug)]
pub(super) struct Linearisation<'a> {
    pub x: &'a [Vector3<f64>],
    pub kind: Tangent,
    /// Positions from which the stress is extrapolated, in place of its value at `x`.
    pub from: Option<&'a [Vector3<f64>]>,
}

impl Model {
    /// Elastic energy Ψ(x) = Σ w ψ(F) \[J\], springs included.
    pub fn energy(&self, x: &[Vector3<f64>]) -> f64 {
        let mut buffers = self.scratch.take();
        let averaged = self.average_volume(x, &mut buffers, false);
        let elements: f64 = match self.kind {
            ElementKind::Tet4 => (0..self.n_elements()).map(|e| self.element_energy::<4>(e, x)).sum(),
            ElementKind::Tet10 => (0..self.n_elements()).map(|e| self.element_energy::<10>(e, x)).sum(),
            ElementKind::Hex8 | ElementKind::Octree => {
                (0..self.n_elements()).map(|e| self.element_energy::<8>(e, x)).sum()
            }
        };
        elements + averaged + self.spring_energy(x)
    }

    /// Internal forces f = ∂Ψ/∂x [N], to be subtracted from the loads. Returns Ψ \[J\].
    pub fn internal_forces(&self, x: &[Vector3<f64>], f: &mut [Vector3<f64>]) -> f64 {
        let mut buffers = self.scratch.take();
        let averaged = self.average_volume(x, &mut buffers, false);
        f.fill(Vector3::zeros());
        let energy = match self.kind {
            ElementKind::Tet4 => self.scatter_forces::<4>(x, &buffers, f),
            ElementKind::Tet10 => self.scatter_forces::<10>(x, &buffers, f),
            ElementKind::Hex8 | ElementKind::Octree => self.scatter_forces::<8>(x, &buffers, f),
        };
        energy + averaged + self.add_spring_forces(x, f)
    }

    /// Tangent ∂²Ψ/∂x² [N/m]; overwrites the blocks of `K`, which has the model's pattern.
    /// [`Tangent::Projected`] and [`Tangent::Held`] are positive semidefinite.
    pub fn tangent(&self, x: &[Vector3<f64>], kind: Tangent, K: &mut BlockCsr<f64>) {
        self.linearised(&Linearisation { x, kind, from: None }, K);
    }

    pub(super) fn linearised(&self, at: &Linearisation<'_>, K: &mut BlockCsr<f64>) {
        let Linearisation { x, kind, .. } = *at;
        let mut buffers = self.scratch.take();
        self.average_volume(x, &mut buffers, true);
        K.clear();
        match self.kind {
            ElementKind::Tet4 => self.scatter_tangent::<4>(at, &buffers, K),
            ElementKind::Tet10 => self.scatter_tangent::<10>(at, &buffers, K),
            ElementKind::Hex8 | ElementKind::Octree => self.scatter_tangent::<8>(at, &buffers, K),
        }
        if let (Some(averaging), Some(split)) = (&self.averaging, self.point.split()) {
            for i in 0..self.n_nodes() {
                let row = self.pattern.row(i);
                averaging.add_to_row(
                    i,
                    split.lambda(),
                    &buffers.star_gradient,
                    &self.pattern,
                    &mut K.blocks[row],
                );
            }
        }
        self.add_spring_tangent(x, kind, K);
    }

    pub(super) fn spring_energy(&self, x: &[Vector3<f64>]) -> f64 {
        self.springs.iter().map(|s| s.energy(&x[s.a as usize], &x[s.b as usize])).sum()
    }

    pub(super) fn add_spring_forces(&self, x: &[Vector3<f64>], f: &mut [Vector3<f64>]) -> f64 {
        for spring in &self.springs {
            let (a, b) = (spring.a as usize, spring.b as usize);
            let force = spring.force(&x[a], &x[b]);
            f[a] -= force;
            f[b] += force;
        }
        self.spring_energy(x)
    }

    pub(super) fn add_spring_tangent(&self, x: &[Vector3<f64>], kind: Tangent, K: &mut BlockCsr<f64>) {
        for spring in &self.springs {
            let (a, b) = (spring.a as usize, spring.b as usize);
            let S = spring.stiffness(&x[a], &x[b], kind);
            for (i, j, sign) in [(a, a, 1.0), (b, b, 1.0), (a, b, -1.0), (b, a, -1.0)] {
                if let Some(at) = K.position(i, j as u32) {
                    for (entry, k) in K.blocks[at].iter_mut().enumerate() {
                        *k += sign * S[(entry / 3, entry % 3)];
                    }
                }
            }
        }
    }

    /// Computes θ̄ of every node, and with `gradients` its derivatives. Returns the averaged energy \[J\].
    pub(super) fn average_volume(&self, x: &[Vector3<f64>], buffers: &mut Buffers, gradients: bool) -> f64 {
        let (Some(averaging), Some(split)) = (&self.averaging, self.point.split()) else {
            return 0.0;
        };
        let Buffers { theta, theta_bar, theta_gradient, star_gradient, .. } = buffers;
        theta.clear();
        theta_gradient.clear();
        for e in 0..self.n_elements() {
            let F = deformation_gradient::<4>(&self.positions(e, x), self.gradients(e, 0));
            theta.push(split.theta(&F));
            if gradients {
                theta_gradient.push(split.theta_gradient(&F));
            }
        }
        theta_bar.clear();
        theta_bar.extend((0..self.n_nodes()).map(|n| averaging.average(n, theta, &self.volumes)));
        if gradients {
            star_gradient.resize(averaging.star_entries(), Vector3::zeros());
            for n in 0..self.n_nodes() {
                averaging.gradient(n, theta_gradient, &self.volumes, &self.gradients, star_gradient);
            }
        }
        averaging.energy(split.lambda(), theta_bar)
    }

    /// Volumetric factor λ θ [Pa] of an element, and the share κ of λ/2 θ² that stays with it. `None` if
    /// nothing is averaged.
    fn averaged_element(&self, e: usize, split: &Split, theta: f64, buffers: &Buffers) -> Option<(f64, f64)> {
        let averaging = self.averaging.as_ref()?;
        let pressure =
            averaging.pressure(split.lambda(), &self.connectivity[4 * e..][..4], &buffers.theta_bar);
        Some((pressure + averaging.kept * split.lambda() * theta, averaging.kept))
    }

    pub(super) fn element_energy<const N: usize>(&self, e: usize, x: &[Vector3<f64>]) -> f64 {
        let x = self.positions::<N>(e, x);
        let point = |q: usize, psi: &dyn Fn(&Matrix3<f64>) -> f64| {
            self.weights(e)[q] * psi(&deformation_gradient::<N>(&x, self.gradients(e, q)))
        };
        let Q = self.kind.points();
        let law = self.point_of(e);
        let fibres: f64 = match self.fibres.is_empty() {
            true => 0.0,
            false => (0..Q).map(|q| point(q, &|F| self.fibres.energy(law.law, F))).sum(),
        };
        let spring = |q: usize| self.viscous.spring(e * Q + q, law.lame.mu);
        let springs: f64 = match self.viscous.is_off() {
            true => 0.0,
            false => (0..Q).map(|q| point(q, &|F| spring(q).energy(law.law, F))).sum(),
        };
        let more = fibres + springs;
        let Some(split) = self.remedy(e) else {
            return more + (0..Q).map(|q| point(q, &|F| law.energy(F))).sum::<f64>();
        };
        let shear: f64 = more + (0..Q).map(|q| point(q, &|F| split.shear_energy(F))).sum::<f64>();
        let (F, share) = match &self.averaging {
            Some(averaging) => (deformation_gradient::<N>(&x, self.gradients(e, 0)), averaging.kept),
            None => (self.mean_gradient::<N>(e, &x), 1.0),
        };
        shear + self.volumes[e] * share * 0.5 * split.lambda() * split.theta(&F).powi(2)
    }

    fn holds_rotation(&self, kind: Tangent) -> bool {
        kind == Tangent::Held && self.point.law == Law::Corotational
    }

    /// The split law of element `e` if the volumetric energy is integrated by itself.
    fn remedy(&self, e: usize) -> Option<Split> {
        if self.volumetric == Volumetric::Full { None } else { self.point_of(e).split() }
    }

    fn mean_gradient<const N: usize>(&self, e: usize, x: &[Vector3<f64>; N]) -> Matrix3<f64> {
        deformation_gradient::<N>(x, &self.mean_gradients[e * N..][..N])
    }

    fn scatter_forces<const N: usize>(
        &self,
        x: &[Vector3<f64>],
        buffers: &Buffers,
        f: &mut [Vector3<f64>],
    ) -> f64 {
        let mut energy = 0.0;
        for e in 0..self.n_elements() {
            let mut f_e = [Vector3::zeros(); N];
            energy += self.element_forces::<N>(e, x, buffers, &mut f_e);
            for (f_a, &a) in f_e.iter().zip(self.element(e)) {
                f[a as usize] += f_a;
            }
        }
        energy
    }

    pub(super) fn element_forces<const N: usize>(
        &self,
        e: usize,
        x: &[Vector3<f64>],
        buffers: &Buffers,
        f: &mut [Vector3<f64>; N],
    ) -> f64 {
        let x = self.positions::<N>(e, x);
        let weights = self.weights(e);
        let (law, split) = (self.point_of(e), self.remedy(e));
        let mut energy = 0.0;
        for q in 0..self.kind.points() {
            let (g, w) = (self.gradients(e, q), weights[q]);
            let F = deformation_gradient::<N>(&x, g);
            let mut P = match &split {
                None => {
                    let (psi, P) = law.energy_and_stress(&F);
                    energy += w * psi;
                    P
                }
                Some(split) => {
                    energy += w * split.shear_energy(&F);
                    let shear = split.shear_stress(&F);
                    let theta = split.theta(&F);
                    match self.averaged_element(e, split, theta, buffers) {
                        Some((pressure, kept)) => {
                            energy += w * kept * 0.5 * split.lambda() * theta * theta;
                            shear + pressure * split.theta_gradient(&F)
                        }
                        None => shear,
                    }
                }
            };
            if !self.fibres.is_empty() {
                energy += w * self.fibres.energy(law.law, &F);
                P += self.fibres.stress(law.law, &F);
            }
            if !self.viscous.is_off() {
                let spring = self.viscous.spring(e * self.kind.points() + q, law.lame.mu);
                energy += w * spring.energy(law.law, &F);
                P += spring.stress(law.law, &F);
            }
            add_forces(&P, g, w, f);
        }
        // Volume at one point: at all eight it would lock.
        if let (Volumetric::Selective, Some(split)) = (self.volumetric, split) {
            let F = self.mean_gradient::<N>(e, &x);
            let (theta, lambda) = (split.theta(&F), split.lambda());
            energy += self.volumes[e] * 0.5 * lambda * theta * theta;
            let P = lambda * theta * split.theta_gradient(&F);
            add_forces(&P, &self.mean_gradients[e * N..][..N], self.volumes[e], f);
        }
        energy
    }

    fn scatter_tangent<const N: usize>(
        &self,
        at: &Linearisation<'_>,
        buffers: &Buffers,
        K: &mut BlockCsr<f64>,
    ) {
        let mut blocks = [[0.0; 9]; 100];
        let blocks = &mut blocks[..N * N];
        for e in 0..self.n_elements() {
            self.element_tangent::<N>(e, at, buffers, blocks);
            for (block, &slot) in blocks.iter().zip(&self.slots[e * N * N..][..N * N]) {
                for (k, b) in K.blocks[slot as usize].iter_mut().zip(block) {
                    *k += b;
                }
            }
        }
    }

    pub(super) fn element_tangent<const N: usize>(
        &self,
        e: usize,
        at: &Linearisation<'_>,
        buffers: &Buffers,
        K: &mut [[f64; 9]],
    ) {
        K.fill([0.0; 9]);
        let kind = at.kind;
        let x = self.positions::<N>(e, at.x);
        let from = at.from.map(|from| self.positions::<N>(e, from));
        let weights = self.weights(e);
        let (law, split) = (self.point_of(e), self.remedy(e));
        // With selective integration only the sum of shear and volume is (nearly) semidefinite, so the
        // sum is projected at the end.
        let selective = self.volumetric == Volumetric::Selective;
        let held = self.holds_rotation(kind);
        let point_kind = if selective && !held { Tangent::Exact } else { kind };
        for q in 0..self.kind.points() {
            let g = self.gradients(e, q);
            let F = deformation_gradient::<N>(&x, g);
            if !self.fibres.is_empty() {
                add_upper_blocks::<N>(&self.fibres.tangent(law.law, &F), g, weights[q], K);
            }
            if !self.viscous.is_off() {
                let spring = self.viscous.spring(e * self.kind.points() + q, law.lame.mu);
                add_upper_blocks::<N>(&spring.tangent(law.law, &F, point_kind), g, weights[q], K);
            }
            if kind == Tangent::Exact {
                let D = from.map_or(Matrix3::zeros(), |from| F - deformation_gradient::<N>(&from, g));
                if let Some([_, S]) = law.green(&F, &D) {
                    add_green_blocks::<N>((&F, &S), law.lame, g, weights[q], K);
                    continue;
                }
            }
            let A = match &split {
                None => law.tangent(&F, kind),
                Some(split) if selective => split.shear_tangent(&F, point_kind),
                Some(split) => self.averaged_tangent(e, split, &F, kind, buffers),
            };
            add_upper_blocks::<N>(&A, g, weights[q], K);
        }
        if let (true, Some(split)) = (selective, split) {
            let F = self.mean_gradient::<N>(e, &x);
            let d = vec9(&split.theta_gradient(&F));
            let mut A = split.lambda() * d * d.transpose();
            if !held {
                A += split.lambda() * split.theta(&F) * split.theta_hessian(&F);
            }
            add_upper_blocks::<N>(&A, &self.mean_gradients[e * N..][..N], self.volumes[e], K);
        }
        mirror::<N>(K);
        if selective && !held && kind != Tangent::Exact && self.point.law != Law::Linear {
            project_hexahedron(K);
        }
    }

    /// Tangent ∂P/∂F of an element with averaged volume, without the coupling of its nodes through θ̄.
    fn averaged_tangent(
        &self,
        e: usize,
        split: &Split,
        F: &Matrix3<f64>,
        kind: Tangent,
        buffers: &Buffers,
    ) -> SMatrix<f64, 9, 9> {
        let d = vec9(&split.theta_gradient(F));
        let (pressure, kept) = self.averaged_element(e, split, buffers.theta[e], buffers).unwrap_or_default();
        let own = kept * split.lambda() * d * d.transpose();
        if self.holds_rotation(kind) {
            return split.shear_tangent(F, Tangent::Held) + own;
        }
        let exact = split.shear_tangent(F, Tangent::Exact) + own + pressure * split.theta_hessian(F);
        if kind == Tangent::Exact || self.point.law == Law::Linear { exact } else { projected(&exact) }
    }
}

fn vec9(A: &Matrix3<f64>) -> SMatrix<f64, 9, 1> {
    SMatrix::<f64, 9, 1>::from_column_slice(A.as_slice())
}

/// Sets the negative eigenvalues of the 24×24 matrix of a hexahedron to zero. A Cholesky factorisation
/// tells first whether there are any beyond rounding.
fn project_hexahedron(K: &mut [[f64; 9]]) {
    let mut A = SMatrix::<f64, 24, 24>::zeros();
    for a in 0..8 {
        for b in 0..8 {
            for (entry, k) in K[8 * a + b].iter().enumerate() {
                A[(3 * a + entry / 3, 3 * b + entry % 3)] = *k;
            }
        }
    }
    let shift = 1e-12 * A.trace().abs();
    if (A + SMatrix::<f64, 24, 24>::from_diagonal_element(shift)).cholesky().is_some() {
        return;
    }
    let A = projected(&A);
    for a in 0..8 {
        for b in 0..8 {
            for (entry, k) in K[8 * a + b].iter_mut().enumerate() {
                *k = A[(3 * a + entry / 3, 3 * b + entry % 3)];
            }
        }
    }
}

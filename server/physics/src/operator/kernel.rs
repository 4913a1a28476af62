//! The two loops over pieces that a step spends its time in: [`Batches::update`] once,
//! [`Batches::apply`] once per solver iteration.
//!
//! Because the law is isotropic, R K Rᵀ applied to a displacement equals: rotate and scale the
//! *gradients* once per step, g′_a = √(2μ w V s) R g_a; then H = Σ du_a ⊗ g′_a,
//! σ = sym H + λ/2μ tr(H) I, f_a = σ g′_a. That is half the arithmetic and a third of the memory of
//! multiplying by R K Rᵀ: 44 bytes per piece.

#![allow(unsafe_code)] // vector instructions behind run-time detection, and unchecked gathers

use nalgebra::Matrix3;

use super::Padded;
use super::shared_lanes::Merged;
use crate::element::{Batched, Ids, LANES, Lanes, Mat3, Simd, Vector, Vector8, polar_newton, polar_rotation};
use crate::mesh::TetMesh;

/// Data that one application streams, per batch of eight pieces.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
#[repr(C)]
struct Batch {
    /// Rotated gradients √(2μ w V s) R g_k, k = 1, 2, 3, with s the factor of K̂ in the operator;
    /// the one of corner 0 is minus their sum.
    g: [[Lanes; 3]; 3],
    /// Local numbers of the four copies.
    nodes: [Ids; 4],
}

/// Data that only an update needs, per batch.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
#[repr(C)]
pub struct RestBatch {
    /// Rest gradients g_1, g_2, g_3 [1/m].
    pub g: [[Lanes; 3]; 3],
    /// w V [m³]; 0 in unused lanes.
    pub volume: Lanes,
    /// Rotation R of the last update, also the warm start of the next.
    pub rotation: Mat3<Lanes>,
    /// Number of pieces that each lane integrates.
    pub pieces: [u32; LANES],
}

impl RestBatch {
    /// A batch without pieces: zero volume, R = I.
    pub fn empty() -> Self {
        let mut rotation: Mat3<Lanes> = Default::default();
        for i in 0..3 {
            rotation[4 * i] = Lanes([1.0; LANES]);
        }
        Self { g: Default::default(), volume: Lanes::default(), rotation, pieces: [0; LANES] }
    }

    /// Fills a lane: gradients, volume, and the rotation if that is known.
    pub fn set(&mut self, lane: usize, mesh: &TetMesh, merged: &Merged, rotation: Option<&Matrix3<f32>>) {
        let g = mesh.gradients(merged.piece.element as usize);
        for k in 0..3 {
            for i in 0..3 {
                self.g[k][i].0[lane] = g[k + 1][i] as f32;
            }
        }
        self.set_volume(lane, mesh, merged);
        if let Some(R) = rotation {
            for i in 0..9 {
                self.rotation[i].0[lane] = R[(i / 3, i % 3)];
            }
        }
    }

    /// Changes how much material a lane integrates.
    pub fn set_volume(&mut self, lane: usize, mesh: &TetMesh, merged: &Merged) {
        let Merged { piece, count } = merged;
        self.volume.0[lane] = (piece.fraction * mesh.volume(piece.element as usize)) as f32;
        self.pieces[lane] = *count;
    }
}

/// Symmetric 3×3 block (xx, xy, xz, 0, yy, yz, zz, 0): the sum of s K̂ over the pieces around a copy.
pub type Block6 = [f32; 8];

/// Constants of one update.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Coefficients {
    /// μ [Pa].
    pub mu: f32,
    /// λ [Pa].
    pub lambda: f32,
    /// s, the factor of K̂ in the operator (h² + hβ in a step) [s²].
    pub scale: f32,
    /// Whether pieces rotate (corotational) or keep R = I (linear).
    pub rotates: bool,
}

/// Constants of an energy.
#[derive(Clone, Copy, Debug)]
pub struct EnergyCoefficients {
    /// μ [Pa].
    pub mu: f32,
    /// λ [Pa].
    pub lambda: f32,
    /// Whether pieces rotate (corotational) or keep R = I (linear).
    pub rotates: bool,
}

/// Vectors of one chunk, one entry per local number and one for the waste bin.
pub struct Locals<'a> {
    /// Current positions [m] in double precision.
    pub x: &'a [[f64; 4]],
    /// Out: internal forces f_int [N], added to.
    pub f: &'a mut [Padded],
    /// Out: diagonal blocks of s K̂, added to.
    pub blocks: &'a mut [Block6],
}

/// The batches of one chunk. Their local numbers are checked once, here.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct Batches {
    live: Vec<Batch>,
    rest: Vec<RestBatch>,
    /// λ/2μ at the last update.
    ratio: f32,
    /// Length of the local vectors, the waste bin included.
    n_locals: usize,
}

impl Batches {
    /// Batches with the local numbers `nodes`, all below `n_locals`, and their rest states.
    pub fn new(nodes: &[[Ids; 4]], rest: Vec<RestBatch>, n_locals: usize) -> Self {
        assert_eq!(nodes.len(), rest.len());
        assert!(nodes.iter().flatten().flatten().all(|&id| (id as usize) < n_locals));
        let zero = Lanes::default();
        let mut live = Vec::with_capacity(rest.capacity());
        live.extend(nodes.iter().map(|&nodes| Batch { g: [[zero; 3]; 3], nodes }));
        Self { live, rest, ratio: 0.0, n_locals }
    }

    /// Grows to `n_batches` batches, the new ones empty, and to local numbers below `n_locals`. The last
    /// local number becomes the waste bin.
    pub fn grow(&mut self, n_batches: usize, n_locals: usize) {
        assert!(n_batches >= self.live.len() && n_locals >= self.n_locals);
        let [before, waste] = [self.n_locals, n_locals].map(|n| (n - 1) as u16);
        for id in self.live.iter_mut().flat_map(|b| b.nodes.as_flattened_mut()).filter(|id| **id == before) {
            *id = waste;
        }
        let empty = Batch { g: [[Lanes::default(); 3]; 3], nodes: [[waste; LANES]; 4] };
        self.live.resize(n_batches, empty);
        self.rest.resize(n_batches, RestBatch::empty());
        self.n_locals = n_locals;
    }

    /// Gives one lane other local numbers.
    pub fn set_nodes(&mut self, batch: usize, lane: usize, ids: [u16; 4]) {
        assert!(ids.iter().all(|&id| (id as usize) < self.n_locals));
        for (nodes, id) in self.live[batch].nodes.iter_mut().zip(ids) {
            nodes[lane] = id;
        }
    }

    /// The rest state of one batch.
    pub fn rest_mut(&mut self, batch: usize) -> &mut RestBatch {
        &mut self.rest[batch]
    }

    /// λ/2μ at the last update.
    pub fn ratio(&self) -> f32 {
        self.ratio
    }

    /// Gradients √(2μ w V s) R g_a and local numbers of the four corners of one lane.
    pub fn gradients(&self, batch: usize, lane: usize) -> ([[f32; 3]; 4], [u16; 4]) {
        let b = &self.live[batch];
        let g: [[f32; 3]; 3] = [0, 1, 2].map(|k| [0, 1, 2].map(|i| b.g[k][i].0[lane]));
        let g0 = [0, 1, 2].map(|i| -(g[0][i] + g[1][i] + g[2][i]));
        ([g0, g[0], g[1], g[2]], [0, 1, 2, 3].map(|a| b.nodes[a][lane]))
    }

    /// Local numbers of the four corners of one lane.
    pub fn ids(&self, batch: usize, lane: usize) -> [u16; 4] {
        self.live[batch].nodes.each_ref().map(|ids| ids[lane])
    }

    /// Number of batches.
    pub fn n_batches(&self) -> usize {
        self.live.len()
    }

    /// Local numbers are below this; the last is the waste bin.
    pub fn n_locals(&self) -> usize {
        self.n_locals
    }

    /// Bytes that one application streams.
    pub fn bytes(&self) -> usize {
        self.live.len() * size_of::<Batch>()
    }

    /// Rest states and rotations.
    pub fn rest(&self) -> &[RestBatch] {
        &self.rest
    }

    /// y += s K̂ x. `x` and `y` have one entry per local number and the waste bin.
    pub fn apply(&self, simd: Simd, x: &[Padded], y: &mut [Padded]) {
        assert!(x.len() == self.n_locals && y.len() == self.n_locals);
        match simd {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: these come from `Simd::detect` only.
            Simd::Avx2 => unsafe { avx2::apply(&self.live, self.ratio, x, y) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above.
            Simd::Avx512 => unsafe { avx512::apply(&self.live, self.ratio, x, y) },
            _ => apply_with::<Lanes, 1>(self.live.as_chunks().0, self.ratio, x, y),
        }
    }

    /// Computes rotations, internal forces, rotated gradients and diagonal blocks at the positions in
    /// `locals`. Returns the number of pieces with det F ≤ 0.
    pub fn update(&mut self, simd: Simd, c: &Coefficients, locals: &mut Locals<'_>) -> usize {
        let n = self.n_locals;
        self.ratio = 0.5 * c.lambda / c.mu;
        assert!(locals.x.len() == n && locals.f.len() == n && locals.blocks.len() == n);
        let (rest, live) = (&mut self.rest[..], &mut self.live[..]);
        match simd {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: these come from `Simd::detect` only.
            Simd::Avx2 => unsafe { avx2::update(c, rest, live, locals) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above.
            Simd::Avx512 => unsafe { avx512::update(c, rest, live, locals) },
            _ => update_with::<Lanes, 1>(c, rest.as_chunks_mut().0, live.as_chunks_mut().0, locals),
        }
    }

    /// Elastic energy [J] at the displacements `u` [m], one per local number, with the rotations of the last
    /// update.
    pub fn energy(&self, simd: Simd, c: EnergyCoefficients, u: &[[f64; 4]]) -> f64 {
        assert!(u.len() == self.n_locals);
        match simd {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: both come from `Simd::detect` only.
            Simd::Avx2 | Simd::Avx512 => unsafe { avx2::energy(c, &self.rest, &self.live, u) },
            _ => energy_with::<Lanes>(c, &self.rest, &self.live, u),
        }
    }
}

// Loops instead of closures below: see `Vector`. Closures that only name a field are none of those.

#[inline(always)]
fn load<V: Vector8>(l: &[Lanes; 3]) -> [V; 3] {
    [V::load(&l[0]), V::load(&l[1]), V::load(&l[2])]
}

/// Reads three vectors of every batch.
#[inline(always)]
fn read<V: Batched<N>, const N: usize, B>(
    from: &[B; N],
    field: impl Fn(&B) -> &[[Lanes; 3]; 3],
) -> [[V; 3]; 3] {
    let mut out = [[V::splat(0.0); 3]; 3];
    for k in 0..3 {
        for i in 0..3 {
            out[k][i] = V::read(from, |b| &field(b)[k][i]);
        }
    }
    out
}

#[inline(always)]
fn product<V: Vector>(A: &[[V; 3]; 3], v: &[V; 3]) -> [V; 3] {
    [dot(&A[0], v), dot(&A[1], v), dot(&A[2], v)]
}

#[inline(always)]
fn dot<V: Vector>(a: &[V; 3], b: &[V; 3]) -> V {
    a[0].mul_add(b[0], a[1].mul_add(b[1], a[2] * b[2]))
}

/// The vector of corner 0, given that the vectors of all corners sum to 0.
#[inline(always)]
fn minus_sum<V: Vector>(v: &[[V; 3]; 3]) -> [V; 3] {
    [-(v[0][0] + v[1][0] + v[2][0]), -(v[0][1] + v[1][1] + v[2][1]), -(v[0][2] + v[1][2] + v[2][2])]
}

/// H_ij = Σ_k d_k,i g_k,j.
#[inline(always)]
fn sum_of_outer_products<V: Vector>(d: &[[V; 3]; 3], g: &[[V; 3]; 3]) -> [[V; 3]; 3] {
    let mut H = *d;
    for i in 0..3 {
        for j in 0..3 {
            H[i][j] = d[0][i].mul_add(g[0][j], d[1][i].mul_add(g[1][j], d[2][i] * g[2][j]));
        }
    }
    H
}

#[inline(always)]
fn apply_with<V: Batched<N>, const N: usize>(
    batches: &[[Batch; N]],
    ratio: f32,
    x: &[Padded],
    y: &mut [Padded],
) {
    let (half, ratio) = (V::splat(0.5), V::splat(ratio));
    for b in batches {
        let g: [[V; 3]; 3] = read(b, |b| &b.g);
        // SAFETY: local numbers are below the length of local vectors, checked by `Batches`.
        let (u0, mut d) = unsafe {
            let d = [
                V::gather_all(x, b, |b| &b.nodes[1]),
                V::gather_all(x, b, |b| &b.nodes[2]),
                V::gather_all(x, b, |b| &b.nodes[3]),
            ];
            (V::gather_all(x, b, |b| &b.nodes[0]), d)
        };
        for k in 0..3 {
            for i in 0..3 {
                d[k][i] = d[k][i] - u0[i];
            }
        }
        let H = sum_of_outer_products(&d, &g);
        let pressure = ratio * (H[0][0] + H[1][1] + H[2][2]);
        let (sxx, syy, szz) = (H[0][0] + pressure, H[1][1] + pressure, H[2][2] + pressure);
        let sxy = half * (H[0][1] + H[1][0]);
        let sxz = half * (H[0][2] + H[2][0]);
        let syz = half * (H[1][2] + H[2][1]);
        let sigma = [[sxx, sxy, sxz], [sxy, syy, syz], [sxz, syz, szz]];
        let f = [product(&sigma, &g[0]), product(&sigma, &g[1]), product(&sigma, &g[2])];
        for batch in 0..N {
            scatter_forces(y, &b[batch].nodes, &parts(&f, batch));
        }
    }
}

/// The vectors of one batch.
#[inline(always)]
fn parts<V: Batched<N>, const N: usize>(f: &[[V; 3]; 3], batch: usize) -> [[V::Part; 3]; 3] {
    let mut out = [[V::Part::splat(0.0); 3]; 3];
    for k in 0..3 {
        for i in 0..3 {
            out[k][i] = f[k][i].part(batch);
        }
    }
    out
}

/// Adds f_1, f_2, f_3 and f_0 = −(f_1 + f_2 + f_3).
#[inline(always)]
fn scatter_forces<V: Vector8>(y: &mut [Padded], nodes: &[Ids; 4], f: &[[V; 3]; 3]) {
    // SAFETY: local numbers are below the length of local vectors, checked by `Batches`.
    unsafe {
        V::scatter(y, &nodes[0], minus_sum(f));
        V::scatter(y, &nodes[1], f[0]);
        V::scatter(y, &nodes[2], f[1]);
        V::scatter(y, &nodes[3], f[2]);
    }
}

#[inline(always)]
fn update_with<V: Batched<N>, const N: usize>(
    c: &Coefficients,
    rest: &mut [[RestBatch; N]],
    live: &mut [[Batch; N]],
    locals: &mut Locals<'_>,
) -> usize {
    let mut inverted = 0;
    let ratio = V::splat(0.5 * c.lambda / c.mu);
    for (rest, live) in rest.iter_mut().zip(live) {
        let g: [[V; 3]; 3] = read(rest, |rest| &rest.g);
        // SAFETY: local numbers are below the length of local vectors, checked by `Batches`.
        let e: [[V; 3]; 3] = unsafe {
            [
                V::gather_all_edges(locals.x, live, |b| [&b.nodes[0], &b.nodes[1]]),
                V::gather_all_edges(locals.x, live, |b| [&b.nodes[0], &b.nodes[2]]),
                V::gather_all_edges(locals.x, live, |b| [&b.nodes[0], &b.nodes[3]]),
            ]
        };
        let F = sum_of_outer_products(&e, &g);
        // The linear law keeps R = I.
        if c.rotates {
            inverted += rotate(&F, rest);
        }
        let mut R = g;
        for i in 0..3 {
            for j in 0..3 {
                R[i][j] = V::read(rest, |rest| &rest.rotation[3 * i + j]);
            }
        }
        let two_mu_volume = V::splat(2.0 * c.mu) * V::read(rest, |rest| &rest.volume);
        let P = piola_stress(&F, &R, two_mu_volume, ratio);
        let f = [product(&P, &g[0]), product(&P, &g[1]), product(&P, &g[2])];
        for batch in 0..N {
            scatter_forces(locals.f, &live[batch].nodes, &parts(&f, batch));
        }

        // R and √(2μ w V s) go into the gradients here, so that an application needs neither.
        let root = (two_mu_volume * V::splat(c.scale)).sqrt();
        let mut turned = [product(&R, &g[0]), product(&R, &g[1]), product(&R, &g[2])];
        for k in 0..3 {
            for i in 0..3 {
                turned[k][i] = turned[k][i] * root;
                turned[k][i].write(live, |b| &mut b.g[k][i]);
            }
        }
        for batch in 0..N {
            let (nodes, turned, ratio) = (&live[batch].nodes, parts(&turned, batch), ratio.part(batch));
            scatter_block(locals.blocks, &nodes[0], &minus_sum(&turned), ratio);
            for k in 0..3 {
                scatter_block(locals.blocks, &nodes[k + 1], &turned[k], ratio);
            }
        }
    }
    inverted
}

/// Σ w V (μ |D|² + λ/2 (R : D)²), where D = F − R, or sym(F) − I without rotations. F is I plus the gradient of
/// the displacement, so that the error of D is relative to D where little turns.
#[inline(always)]
fn energy_with<V: Vector8>(c: EnergyCoefficients, rest: &[RestBatch], live: &[Batch], u: &[[f64; 4]]) -> f64 {
    let (one, half) = (V::splat(1.0), V::splat(0.5));
    let (mu, half_lambda) = (V::splat(c.mu), V::splat(0.5 * c.lambda));
    let mut sums = [0.0; LANES];
    for (rest, live) in rest.iter().zip(live) {
        let g: [[V; 3]; 3] = [load(&rest.g[0]), load(&rest.g[1]), load(&rest.g[2])];
        let nodes = &live.nodes;
        // SAFETY: local numbers are below the length of local vectors, checked by `Batches`.
        let e: [[V; 3]; 3] = unsafe {
            [
                V::gather_edges(u, &nodes[0], &nodes[1]),
                V::gather_edges(u, &nodes[0], &nodes[2]),
                V::gather_edges(u, &nodes[0], &nodes[3]),
            ]
        };
        let mut D = sum_of_outer_products(&e, &g);
        let (square, trace);
        if c.rotates {
            let (mut sum, mut along) = (V::splat(0.0), V::splat(0.0));
            for i in 0..3 {
                for j in 0..3 {
                    let R = V::load(&rest.rotation[3 * i + j]);
                    let unit = if i == j { one - R } else { -R };
                    D[i][j] = D[i][j] + unit;
                    sum = D[i][j].mul_add(D[i][j], sum);
                    along = D[i][j].mul_add(R, along);
                }
            }
            (square, trace) = (sum, along);
        } else {
            let [xy, xz, yz] = [D[0][1] + D[1][0], D[0][2] + D[2][0], D[1][2] + D[2][1]];
            let shear = half * xy.mul_add(xy, xz.mul_add(xz, yz * yz));
            square = D[0][0].mul_add(D[0][0], D[1][1].mul_add(D[1][1], D[2][2].mul_add(D[2][2], shear)));
            trace = D[0][0] + D[1][1] + D[2][2];
        }
        let energy = V::load(&rest.volume) * mu.mul_add(square, half_lambda * trace * trace);
        let energy = energy.store();
        for lane in 0..LANES {
            sums[lane] += f64::from(energy.0[lane]);
        }
    }
    let mut total = 0.0;
    for sum in sums {
        total += sum;
    }
    total
}

/// Updates the rotation of every used lane; returns how many have det F ≤ 0.
#[inline(always)]
fn rotate<V: Batched<N>, const N: usize>(F: &[[V; 3]; 3], rest: &mut [RestBatch; N]) -> usize {
    let F = [F[0][0], F[0][1], F[0][2], F[1][0], F[1][1], F[1][2], F[2][0], F[2][1], F[2][2]];
    let (R, trusted) = polar_newton(&F);
    // Lanes that Newton's method cannot handle are rare and leave the hot loop.
    if trusted == V::ALL {
        for i in 0..9 {
            R[i].write(rest, |rest| &mut rest.rotation[i]);
        }
        return 0;
    }
    let mut inverted = 0;
    for batch in 0..N {
        let (mut stored_F, mut stored_R) = ([Lanes::default(); 9], [Lanes::default(); 9]);
        for i in 0..9 {
            (stored_F[i], stored_R[i]) = (F[i].part(batch).store(), R[i].part(batch).store());
        }
        inverted += rotate_guarded(&stored_F, &stored_R, trusted >> (8 * batch), &mut rest[batch]);
    }
    inverted
}

#[cold]
#[inline(never)]
fn rotate_guarded(F: &Mat3<Lanes>, R: &Mat3<Lanes>, trusted: u16, rest: &mut RestBatch) -> usize {
    let mut inverted = 0;
    for lane in 0..LANES {
        if trusted >> lane & 1 == 1 {
            for i in 0..9 {
                rest.rotation[i].0[lane] = R[i].0[lane];
            }
        } else if rest.volume.0[lane] > 0.0 {
            let F = Matrix3::from_fn(|i, j| f64::from(F[3 * i + j].0[lane]));
            let warm = Matrix3::from_fn(|i, j| f64::from(rest.rotation[3 * i + j].0[lane]));
            let R = polar_rotation(&F, &warm);
            for i in 0..9 {
                rest.rotation[i].0[lane] = R[(i / 3, i % 3)] as f32;
            }
            inverted += if F.determinant() <= 0.0 { rest.pieces[lane] as usize } else { 0 };
        }
    }
    inverted
}

/// w V P = w V R (2μ ε + λ tr(ε) I), ε = sym(RᵀF) − I.
#[inline(always)]
fn piola_stress<V: Vector>(F: &[[V; 3]; 3], R: &[[V; 3]; 3], two_mu_volume: V, ratio: V) -> [[V; 3]; 3] {
    // RᵀF column by column
    let mut S = *F;
    for i in 0..3 {
        for j in 0..3 {
            S[i][j] = R[0][i].mul_add(F[0][j], R[1][i].mul_add(F[1][j], R[2][i] * F[2][j]));
        }
    }
    let (one, half) = (V::splat(1.0), V::splat(0.5));
    let (exx, eyy, ezz) = (S[0][0] - one, S[1][1] - one, S[2][2] - one);
    let pressure = ratio * (exx + eyy + ezz);
    let shear = half * two_mu_volume;
    let sxy = shear * (S[0][1] + S[1][0]);
    let sxz = shear * (S[0][2] + S[2][0]);
    let syz = shear * (S[1][2] + S[2][1]);
    let sxx = two_mu_volume * (exx + pressure);
    let syy = two_mu_volume * (eyy + pressure);
    let szz = two_mu_volume * (ezz + pressure);
    let sigma = [[sxx, sxy, sxz], [sxy, syy, syz], [sxz, syz, szz]]; // symmetric: rows are columns
    let mut P = sigma;
    for i in 0..3 {
        for j in 0..3 {
            P[i][j] = dot(&R[i], &sigma[j]);
        }
    }
    P
}

/// Adds ½ (|g|² I + g gᵀ) + λ/2μ g gᵀ, the diagonal block of one copy; g contains √(2μ w V s).
#[inline(always)]
fn scatter_block<V: Vector8>(blocks: &mut [Block6], ids: &Ids, g: &[V; 3], ratio: V) {
    let half = V::splat(0.5);
    let outer = half + ratio;
    let isotropic = half * dot(g, g);
    let t = [outer * g[0], outer * g[1], outer * g[2]];
    let block = [
        t[0].mul_add(g[0], isotropic),
        t[0] * g[1],
        t[0] * g[2],
        t[1].mul_add(g[1], isotropic),
        t[1] * g[2],
        t[2].mul_add(g[2], isotropic),
    ];
    // SAFETY: local numbers are below the length of local vectors, checked by `Batches`.
    unsafe { V::scatter_blocks(blocks, ids, block) }
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    //! The same loops compiled for AVX2 and FMA.

    use super::{Batch, Coefficients, EnergyCoefficients, Locals, Padded, RestBatch};
    use crate::element::avx2::Register;

    #[target_feature(enable = "avx2,fma")]
    pub fn apply(batches: &[Batch], ratio: f32, x: &[Padded], y: &mut [Padded]) {
        super::apply_with::<Register, 1>(batches.as_chunks().0, ratio, x, y);
    }

    #[target_feature(enable = "avx2,fma")]
    pub fn update(
        c: &Coefficients,
        rest: &mut [RestBatch],
        live: &mut [Batch],
        locals: &mut Locals<'_>,
    ) -> usize {
        super::update_with::<Register, 1>(c, rest.as_chunks_mut().0, live.as_chunks_mut().0, locals)
    }

    #[target_feature(enable = "avx2,fma")]
    pub fn energy(c: EnergyCoefficients, rest: &[RestBatch], live: &[Batch], u: &[[f64; 4]]) -> f64 {
        super::energy_with::<Register>(c, rest, live, u)
    }
}

#[cfg(target_arch = "x86_64")]
mod avx512 {
    //! The same loops for two batches at once; one that is left over takes AVX2.

    use super::{Batch, Coefficients, Locals, Padded, RestBatch};
    use crate::element::avx2::Register;
    use crate::element::avx512::Register512;

    #[target_feature(enable = "avx512f,avx2,fma")]
    pub fn apply(batches: &[Batch], ratio: f32, x: &[Padded], y: &mut [Padded]) {
        let (pairs, last) = batches.as_chunks();
        super::apply_with::<Register512, 2>(pairs, ratio, x, y);
        super::apply_with::<Register, 1>(last.as_chunks().0, ratio, x, y);
    }

    #[target_feature(enable = "avx512f,avx2,fma")]
    pub fn update(
        c: &Coefficients,
        rest: &mut [RestBatch],
        live: &mut [Batch],
        locals: &mut Locals<'_>,
    ) -> usize {
        let ((rest, last_rest), (live, last_live)) = (rest.as_chunks_mut(), live.as_chunks_mut());
        super::update_with::<Register512, 2>(c, rest, live, locals)
            + super::update_with::<Register, 1>(
                c,
                last_rest.as_chunks_mut().0,
                last_live.as_chunks_mut().0,
                locals,
            )
    }
}

//! The two loops over pieces that a step spends its time in: [`Batches::update`] once,
//! [`Batches::apply`] once per solver iteration.

#![allow(unsafe_code)] // vector instructions behind run-time detection, and unchecked gathers

use scindo_matter::element::{Batched, Ids, LANES, Lanes, Simd, Vector8, prefetch, prefetch_at};

use super::hyperelastic::{self, LawTet};
use super::law_coefficients::LawCoefficients;
use super::tet_batch::{Batch, Block6, Coefficients, EnergyCoefficients, Locals, RestBatch};
use super::tet_lanes::{
    Found, Three, UpdatedTet, edges, forces, load, note_start, read, scatter_block, sum_of_outer_products,
    tet_edges, twist_blocks, update_tet, update_twist,
};
use super::twist::{TwistBatch, TwistCoefficients, read_twist};
use super::{Padded, strip_kernel};

/// Tets that are in no strip are asked for so many turns ahead; see [`strip_kernel::AHEAD`].
const AHEAD: usize = 4;

/// The batches of one chunk. Their local numbers are checked once, here.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct Batches {
    /// Those of strips first.
    live: Vec<Batch>,
    rest: Vec<RestBatch>,
    /// For every six batches of strips, whether their tets still have faces in common.
    joined: Vec<bool>,
    /// λ/2μ at the last update.
    ratio: f32,
    /// Twists of every batch, where they have once mattered.
    twists: Vec<TwistBatch>,
    /// Whether they matter now.
    twisted: bool,
    /// Length of the local vectors, the waste bin included.
    n_locals: usize,
}

impl Batches {
    /// Batches with the local numbers `nodes`, all below `n_locals`, and their rest states. The first `n_in_strips` of
    /// them, a multiple of [`strip_kernel::BATCHES`], make up strips.
    pub(super) fn new(nodes: &[[Ids; 4]], rest: Vec<RestBatch>, n_locals: usize, n_in_strips: usize) -> Self {
        assert_eq!(nodes.len(), rest.len());
        assert!(nodes.iter().flatten().flatten().all(|&id| (id as usize) < n_locals));
        let zero = Lanes::default();
        let mut live = Vec::with_capacity(rest.capacity());
        live.extend(nodes.iter().map(|&nodes| Batch { g: [[zero; 3]; 3], nodes }));
        // Room for twists is made here, so that a step in which they begin to matter allocates nothing.
        let twists = Vec::with_capacity(live.capacity());
        let joined = live[..n_in_strips].as_chunks().0.iter().map(strip_kernel::is_joined).collect();
        Self { live, rest, joined, ratio: 0.0, twists, twisted: false, n_locals }
    }

    /// Grows to `n_batches` batches, the new ones empty, and to local numbers below `n_locals`. The last
    /// local number becomes the waste bin.
    pub(super) fn grow(&mut self, n_batches: usize, n_locals: usize) {
        assert!(n_batches >= self.live.len() && n_locals >= self.n_locals);
        let [before, waste] = [self.n_locals, n_locals].map(|n| (n - 1) as u16);
        for id in self.live.iter_mut().flat_map(|b| b.nodes.as_flattened_mut()).filter(|id| **id == before) {
            *id = waste;
        }
        let empty = Batch { g: [[Lanes::default(); 3]; 3], nodes: [[waste; LANES]; 4] };
        self.live.resize(n_batches, empty);
        self.rest.resize(n_batches, RestBatch::empty());
        self.twisted = false;
        self.twists.reserve(n_batches.saturating_sub(self.twists.len()));
        self.n_locals = n_locals;
    }

    /// Gives one lane other local numbers.
    pub(super) fn set_nodes(&mut self, batch: usize, lane: usize, ids: [u16; 4]) {
        assert!(ids.iter().all(|&id| (id as usize) < self.n_locals));
        for (nodes, id) in self.live[batch].nodes.iter_mut().zip(ids) {
            nodes[lane] = id;
        }
        let strip = batch / strip_kernel::BATCHES;
        if let (Some(joined), Some(batches)) =
            (self.joined.get_mut(strip), self.live.as_chunks().0.get(strip))
        {
            *joined = strip_kernel::is_joined(batches);
        }
    }

    /// The rest state of one batch.
    pub(super) fn rest_mut(&mut self, batch: usize) -> &mut RestBatch {
        &mut self.rest[batch]
    }

    /// λ/2μ at the last update.
    pub(super) fn ratio(&self) -> f32 {
        self.ratio
    }

    /// Gradients √(2μ w V s) R g_a and local numbers of the four corners of one lane.
    pub(super) fn gradients(&self, batch: usize, lane: usize) -> ([[f32; 3]; 4], [u16; 4]) {
        let b = &self.live[batch];
        let g: [[f32; 3]; 3] = [0, 1, 2].map(|k| [0, 1, 2].map(|i| b.g[k][i].0[lane]));
        let g0 = [0, 1, 2].map(|i| -(g[0][i] + g[1][i] + g[2][i]));
        ([g0, g[0], g[1], g[2]], [0, 1, 2, 3].map(|a| b.nodes[a][lane]))
    }

    /// Q of one lane as it goes with its gradients, if twists matter.
    pub(super) fn twist(&self, batch: usize, lane: usize) -> Option<[f32; 6]> {
        self.twisted.then(|| self.twists[batch].q.map(|q| q.0[lane]))
    }

    /// Whether twists matter.
    pub(super) fn is_twisted(&self) -> bool {
        self.twisted
    }

    /// Local numbers of the four corners of one lane.
    pub(super) fn ids(&self, batch: usize, lane: usize) -> [u16; 4] {
        self.live[batch].nodes.each_ref().map(|ids| ids[lane])
    }

    /// Number of batches.
    pub(super) fn n_batches(&self) -> usize {
        self.live.len()
    }

    /// Local numbers are below this; the last is the waste bin.
    pub(super) fn n_locals(&self) -> usize {
        self.n_locals
    }

    /// Bytes that one application streams.
    pub(super) fn bytes(&self) -> usize {
        let twist = if self.twisted { size_of::<TwistBatch>() } else { 0 };
        self.live.len() * (size_of::<Batch>() + twist)
    }

    /// Asks for what [`Self::apply`] reads first.
    #[inline(always)]
    pub(super) fn ask_for_first(&self) {
        let n = strip_kernel::AHEAD * strip_kernel::BATCHES;
        prefetch(self.live.get(..n).unwrap_or(&self.live));
    }

    /// Rest states and rotations.
    pub(super) fn rest(&self) -> &[RestBatch] {
        &self.rest
    }

    /// y += s K̂ x, `with_twists` where these matter. `x` and `y` have one entry per local number and the waste bin.
    pub(super) fn apply(&self, simd: Simd, with_twists: bool, x: &[Padded], y: &mut [Padded]) {
        assert!(x.len() == self.n_locals && y.len() == self.n_locals);
        let twisted = with_twists && self.twisted;
        assert!(!twisted || self.twists.len() == self.live.len());
        match simd {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: these come from `Simd::detect` only.
            Simd::Avx2 => unsafe { avx2::apply(self, twisted, x, y) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above.
            Simd::Avx512 => unsafe { avx512::apply(self, twisted, x, y) },
            _ => apply_all::<Lanes, 1>(self, twisted, x, y),
        }
    }

    /// Computes rotations, internal forces, rotated gradients and diagonal blocks at the positions in
    /// `locals`. Twists do not count until they are [found](Self::find_twists).
    pub(super) fn update(&mut self, simd: Simd, c: &Coefficients, locals: &mut Locals<'_>) -> Found {
        let n = self.n_locals;
        self.twisted = false;
        self.ratio = 0.5 * c.lambda / c.mu;
        assert!(locals.x.len() == n && locals.f.len() == n && locals.blocks.len() == n);
        match simd {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: these come from `Simd::detect` only.
            Simd::Avx2 => unsafe { avx2::update(self, c, locals) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above.
            Simd::Avx512 => unsafe { avx512::update(self, c, locals) },
            _ => update_all::<Lanes, 1>(self, c, locals),
        }
    }

    /// Begins an update with a law that is nonlinear in the stretch.
    pub(super) fn begin_law(&mut self, c: &Coefficients, locals: &Locals<'_>) {
        let n = self.n_locals;
        assert!(locals.x.len() == n && locals.f.len() == n && locals.blocks.len() == n);
        (self.twisted, self.ratio) = (false, 0.5 * c.lambda / c.mu);
    }

    /// Makes it for batch number `t`.
    pub(super) fn update_law(
        &mut self,
        simd: Simd,
        c: (&Coefficients, &LawCoefficients),
        t: usize,
        locals: &mut Locals<'_>,
    ) -> LawTet {
        let (live, rest) = (&mut self.live[t], &mut self.rest[t]);
        match simd {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: both come from `Simd::detect` only.
            Simd::Avx2 | Simd::Avx512 => unsafe { avx2::update_law(c, locals, rest, live) },
            _ => update_law_with::<Lanes>(c, locals, rest, live),
        }
    }

    /// Notes the strains at the positions `x` [m], where a step starts.
    pub(super) fn note_start(&mut self, simd: Simd, x: &[[f64; 4]]) {
        assert!(x.len() == self.n_locals);
        match simd {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: both come from `Simd::detect` only.
            Simd::Avx2 | Simd::Avx512 => unsafe { avx2::note_start(self, x) },
            _ => note_start_with::<Lanes>(self, x),
        }
    }

    /// Computes the twists at the positions `x` [m], perhaps others than those of the last update. If they matter
    /// anywhere, or if `they_do` elsewhere, all of them count from now on, and their diagonal blocks are added to `to`.
    pub(super) fn find_twists(
        &mut self,
        simd: Simd,
        c: &TwistCoefficients,
        x: &[[f64; 4]],
        to: &mut [Block6],
        they_do: bool,
    ) {
        assert!(x.len() == self.n_locals && to.len() == self.n_locals);
        self.twists.resize(self.live.len(), TwistBatch::default());
        self.twisted = match simd {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: both come from `Simd::detect` only.
            Simd::Avx2 | Simd::Avx512 => unsafe { avx2::find_twists(self, c, x, to, they_do) },
            _ => find_twists_with::<Lanes>(self, c, x, to, they_do),
        };
    }

    /// Elastic energy [J] at the displacements `u` [m], one per local number, with the rotations of the last
    /// update.
    pub(super) fn energy(&self, simd: Simd, c: EnergyCoefficients, u: &[[f64; 4]]) -> f64 {
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

/// y += s K̂ x for tets that are in no strip.
#[inline(always)]
fn apply_with<V: Batched<N>, const N: usize, const TWISTED: bool>(
    batches: &[[Batch; N]],
    twists: &[[TwistBatch; N]],
    ratio: f32,
    x: &[Padded],
    y: &mut [Padded],
) {
    let ratio = V::splat(ratio);
    for (k, b) in batches.iter().enumerate() {
        prefetch_at(batches, k + AHEAD);
        let twist = if TWISTED { Some(read_twist(&twists[k])) } else { None };
        // SAFETY: local numbers are below the length of local vectors, checked by `Batches`.
        let u = unsafe {
            [
                V::gather_all(x, b, |b| &b.nodes[0]),
                V::gather_all(x, b, |b| &b.nodes[1]),
                V::gather_all(x, b, |b| &b.nodes[2]),
                V::gather_all(x, b, |b| &b.nodes[3]),
            ]
        };
        let f = forces(&read(b, |b| &b.g), &edges(u[0], u[1], u[2], u[3]), ratio, twist);
        scatter_forces(y, b, &f);
    }
}

#[inline(always)]
fn scatter_forces<V: Batched<N>, const N: usize>(y: &mut [Padded], b: &[Batch; N], f: &[Three<V>; 4]) {
    // SAFETY: local numbers are below the length of local vectors, checked by `Batches`.
    unsafe { V::scatter_all(y, |batch| b[batch].nodes.each_ref(), f) };
}

/// Updates tets that are in no strip.
#[inline(always)]
fn update_with<V: Batched<N>, const N: usize>(
    c: &Coefficients,
    rest: &mut [[RestBatch; N]],
    live: &mut [[Batch; N]],
    locals: &mut Locals<'_>,
    found: &mut Found,
) {
    for (rest, live) in rest.iter_mut().zip(live) {
        let tet: UpdatedTet<V> = update_tet(c, &tet_edges(locals.x, live), rest, live);
        found.add(&tet);
        scatter_forces(locals.f, live, &tet.f);
        scatter_corner_blocks(locals.blocks, live, &tet.blocks);
    }
}

/// Adds diagonal blocks of the four corners.
#[inline(always)]
fn scatter_corner_blocks<V: Batched<N>, const N: usize>(
    to: &mut [Block6],
    live: &[Batch; N],
    blocks: &[[V; 6]; 4],
) {
    for batch in 0..N {
        for k in 0..4 {
            scatter_block(to, &live[batch].nodes[k], &blocks[k], batch);
        }
    }
}

/// Updates one batch of tets of a nonlinear law.
#[inline(always)]
fn update_law_with<V: Vector8>(
    c: (&Coefficients, &LawCoefficients),
    locals: &mut Locals<'_>,
    rest: &mut RestBatch,
    live: &mut Batch,
) -> LawTet {
    let edges = tet_edges::<V, 1>(locals.x, std::array::from_ref(live));
    let tet = hyperelastic::update_tet::<V>(c.0, c.1, &edges, rest, live);
    for (ids, f) in live.nodes.iter().zip(&tet.f) {
        // SAFETY: local numbers are below the length of local vectors, checked by `Batches`.
        unsafe { V::scatter(locals.f, ids, load(f)) };
    }
    tet
}

#[inline(always)]
fn note_start_with<V: Vector8>(of: &mut Batches, x: &[[f64; 4]]) {
    for (live, rest) in of.live.as_chunks::<1>().0.iter().zip(of.rest.as_chunks_mut().0) {
        note_start::<V>(&tet_edges(x, live), rest);
    }
}

/// Twists of all tets at the positions `x`. If they matter anywhere, or if `they_do` elsewhere, their blocks are added to
/// `to`; returns whether.
#[inline(always)]
fn find_twists_with<V: Vector8>(
    of: &mut Batches,
    c: &TwistCoefficients,
    x: &[[f64; 4]],
    to: &mut [Block6],
    they_do: bool,
) -> bool {
    let live = of.live.as_chunks::<1>().0;
    let mut matter = 0;
    for ((live, rest), twist) in live.iter().zip(of.rest.as_chunks().0).zip(of.twists.as_chunks_mut().0) {
        matter |= update_twist::<V, 1>(c, &tet_edges(x, live), rest, twist);
    }
    let count = they_do || matter != 0;
    if count {
        for (live, twist) in live.iter().zip(of.twists.as_chunks().0) {
            scatter_corner_blocks::<V, 1>(to, live, &twist_blocks(live, twist));
        }
    }
    count
}

#[inline(always)]
fn apply_all<V: Batched<N>, const N: usize>(of: &Batches, twisted: bool, x: &[Padded], y: &mut [Padded]) {
    match twisted {
        true => apply_some::<V, N, true>(of, &of.twists, x, y),
        false => apply_some::<V, N, false>(of, &[], x, y),
    }
}

/// y += s K̂ x, as many batches at once as V holds; one that is left over alone.
#[inline(always)]
fn apply_some<V: Batched<N>, const N: usize, const TWISTED: bool>(
    of: &Batches,
    twists: &[TwistBatch],
    x: &[Padded],
    y: &mut [Padded],
) {
    let n = strip_kernel::BATCHES * of.joined.len();
    let (strips, single) = of.live.split_at(n);
    let strips: &[[Batch; strip_kernel::BATCHES]] = strips.as_chunks().0;
    let (twists, single_twists) = twists.split_at(if TWISTED { n } else { 0 });
    let twists: &[[TwistBatch; strip_kernel::BATCHES]] = twists.as_chunks().0;
    for (k, (strip, &joined)) in strips.iter().zip(&of.joined).enumerate() {
        let twists: &[TwistBatch] = if TWISTED { &twists[k] } else { &[] };
        match joined {
            true => {
                let soon = strips.get(k + strip_kernel::AHEAD).unwrap_or(strip);
                strip_kernel::apply::<V, N, TWISTED>([strip, soon], twists, of.ratio, x, y);
            }
            false => {
                let (batches, twists) = (strip.as_chunks().0, twists.as_chunks().0);
                apply_with::<V, N, TWISTED>(batches, twists, of.ratio, x, y);
            }
        }
    }
    let ((whole, last), (whole_twists, last_twist)) = (single.as_chunks(), single_twists.as_chunks());
    apply_with::<V, N, TWISTED>(whole, whole_twists, of.ratio, x, y);
    let (last, last_twist) = (last.as_chunks().0, last_twist.as_chunks().0);
    apply_with::<V::Part, 1, TWISTED>(last, last_twist, of.ratio, x, y);
}

/// Updates them in the same way.
#[inline(always)]
fn update_all<V: Batched<N>, const N: usize>(
    of: &mut Batches,
    c: &Coefficients,
    locals: &mut Locals<'_>,
) -> Found {
    let n = strip_kernel::BATCHES * of.joined.len();
    let ((strips, single), (strips_rest, single_rest)) = (of.live.split_at_mut(n), of.rest.split_at_mut(n));
    let strips = strips.as_chunks_mut().0.iter_mut().zip(strips_rest.as_chunks_mut().0);
    let mut found = Found::default();
    for ((live, rest), &joined) in strips.zip(&of.joined) {
        match joined {
            true => strip_kernel::update::<V, N>(c, rest, live, locals, &mut found),
            false => {
                let (rest, live) = (rest.as_chunks_mut().0, live.as_chunks_mut().0);
                update_with::<V, N>(c, rest, live, locals, &mut found);
            }
        }
    }
    let ((whole, last), (whole_rest, last_rest)) = (single.as_chunks_mut(), single_rest.as_chunks_mut());
    update_with::<V, N>(c, whole_rest, whole, locals, &mut found);
    let (last_rest, last) = (last_rest.as_chunks_mut().0, last.as_chunks_mut().0);
    update_with::<V::Part, 1>(c, last_rest, last, locals, &mut found);
    found
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

#[cfg(target_arch = "x86_64")]
mod avx2 {
    //! The same loops compiled for AVX2 and FMA.

    use super::{
        Batch, Batches, Block6, Coefficients, EnergyCoefficients, Found, LawCoefficients, LawTet, Locals,
        Padded, RestBatch, TwistCoefficients,
    };
    use scindo_matter::element::avx2::Register;

    #[target_feature(enable = "avx2,fma")]
    pub(super) fn apply(of: &Batches, twisted: bool, x: &[Padded], y: &mut [Padded]) {
        super::apply_all::<Register, 1>(of, twisted, x, y);
    }

    #[target_feature(enable = "avx2,fma")]
    pub(super) fn update(of: &mut Batches, c: &Coefficients, locals: &mut Locals<'_>) -> Found {
        super::update_all::<Register, 1>(of, c, locals)
    }

    #[target_feature(enable = "avx2,fma")]
    pub(super) fn update_law(
        c: (&Coefficients, &LawCoefficients),
        locals: &mut Locals<'_>,
        rest: &mut RestBatch,
        live: &mut Batch,
    ) -> LawTet {
        super::update_law_with::<Register>(c, locals, rest, live)
    }

    #[target_feature(enable = "avx2,fma")]
    pub(super) fn note_start(of: &mut Batches, x: &[[f64; 4]]) {
        super::note_start_with::<Register>(of, x);
    }

    #[target_feature(enable = "avx2,fma")]
    pub(super) fn find_twists(
        of: &mut Batches,
        c: &TwistCoefficients,
        x: &[[f64; 4]],
        to: &mut [Block6],
        they_do: bool,
    ) -> bool {
        super::find_twists_with::<Register>(of, c, x, to, they_do)
    }

    #[target_feature(enable = "avx2,fma")]
    pub(super) fn energy(c: EnergyCoefficients, rest: &[RestBatch], live: &[Batch], u: &[[f64; 4]]) -> f64 {
        super::energy_with::<Register>(c, rest, live, u)
    }
}

#[cfg(target_arch = "x86_64")]
mod avx512 {
    //! The same loops for two batches at once; one that is left over takes AVX2.

    use super::{Batches, Coefficients, Found, Locals, Padded};
    use scindo_matter::element::avx512::Register512;

    #[target_feature(enable = "avx512f,avx2,fma")]
    pub(super) fn apply(of: &Batches, twisted: bool, x: &[Padded], y: &mut [Padded]) {
        super::apply_all::<Register512, 2>(of, twisted, x, y);
    }

    #[target_feature(enable = "avx512f,avx2,fma")]
    pub(super) fn update(of: &mut Batches, c: &Coefficients, locals: &mut Locals<'_>) -> Found {
        super::update_all::<Register512, 2>(of, c, locals)
    }
}

//! The loops over strips: three tets of each lane at once, in six batches.
//!
//! Two batches of strips lie one beside the other, so that both fit into the registers of AVX-512: their first tets
//! are batches 0 and 1, the second ones 2 and 3, the third ones 4 and 5. Sums have the order of one batch of strips
//! after the other.

#![allow(unsafe_code)] // unchecked gathers

use std::array::{from_mut, from_ref};

use super::Padded;
use super::strips::{NODES, TETS};
use super::tet_batch::{Batch, Coefficients, Locals, RestBatch};
use super::tet_lanes::{Three, forces, read, scatter_block, tet_edges, update_tet};
use crate::element::{Batched, Ids, Vector, Vector8};

/// Batches of tets that two batches of strips consist of.
pub const BATCHES: usize = 2 * TETS;

/// Whether the tets in every lane of these batches still have a face in common: a cut may have taken them apart.
pub fn is_joined(batches: &[Batch; BATCHES]) -> bool {
    let follows = |before: &Batch, after: &Batch| before.nodes[1..] == after.nodes[..3];
    (0..BATCHES - 2).all(|b| follows(&batches[b], &batches[b + 2]))
}

/// y += s K̂ x for two batches of strips at once.
#[inline(always)]
pub fn apply_pair<V: Batched<2>>(batches: &[Batch; BATCHES], ratio: f32, x: &[Padded], y: &mut [Padded]) {
    if let [first, second, third] = batches.as_chunks().0 {
        apply::<V, 2>([first, second, third], ratio, x, y);
    }
}

/// The same for one batch of strips after the other.
#[inline(always)]
pub fn apply_each<V: Vector8>(batches: &[Batch; BATCHES], ratio: f32, x: &[Padded], y: &mut [Padded]) {
    let [a, b, c, d, e, f] = batches;
    apply::<V, 1>([from_ref(a), from_ref(c), from_ref(e)], ratio, x, y);
    apply::<V, 1>([from_ref(b), from_ref(d), from_ref(f)], ratio, x, y);
}

/// Local numbers of the copies of the strips in one batch.
#[inline(always)]
fn nodes<'a>(first: &'a Batch, second: &'a Batch, third: &'a Batch) -> [&'a Ids; NODES] {
    let [a, b, c, d] = &first.nodes;
    [a, b, c, d, &second.nodes[3], &third.nodes[3]]
}

#[inline(always)]
fn apply<V: Batched<N>, const N: usize>(
    [first, second, third]: [&[Batch; N]; TETS],
    ratio: f32,
    x: &[Padded],
    y: &mut [Padded],
) {
    let ratio = V::splat(ratio);
    // SAFETY: local numbers are below the length of local vectors, checked by `Batches`.
    let u = unsafe {
        [
            V::gather_all(x, first, |b| &b.nodes[0]),
            V::gather_all(x, first, |b| &b.nodes[1]),
            V::gather_all(x, first, |b| &b.nodes[2]),
            V::gather_all(x, first, |b| &b.nodes[3]),
            V::gather_all(x, second, |b| &b.nodes[3]),
            V::gather_all(x, third, |b| &b.nodes[3]),
        ]
    };
    let p = forces(&read(first, |b| &b.g), &edges(u[0], u[1], u[2], u[3]), ratio);
    let q = forces(&read(second, |b| &b.g), &edges(u[1], u[2], u[3], u[4]), ratio);
    let r = forces(&read(third, |b| &b.g), &edges(u[2], u[3], u[4], u[5]), ratio);
    scatter([first, second, third], y, &joined(p, q, r));
}

/// The vectors from one point to three others.
#[inline(always)]
fn edges<V: Vector>(from: Three<V>, a: Three<V>, b: Three<V>, c: Three<V>) -> [Three<V>; 3] {
    let mut d = [a, b, c];
    for k in 0..3 {
        for i in 0..3 {
            d[k][i] = d[k][i] - from[i];
        }
    }
    d
}

/// What corners of three tets have, summed up by the copies of their strip.
#[inline(always)]
fn joined<V: Vector, const M: usize>(p: [[V; M]; 4], q: [[V; M]; 4], r: [[V; M]; 4]) -> [[V; M]; NODES] {
    let mut out = [p[0], p[1], p[2], p[3], q[3], r[3]];
    for i in 0..M {
        out[1][i] = p[1][i] + q[0][i];
        out[2][i] = p[2][i] + q[1][i] + r[0][i];
        out[3][i] = p[3][i] + q[2][i] + r[1][i];
        out[4][i] = q[3][i] + r[2][i];
    }
    out
}

#[inline(always)]
fn scatter<V: Batched<N>, const N: usize>(
    [first, second, third]: [&[Batch; N]; TETS],
    y: &mut [Padded],
    f: &[Three<V>; NODES],
) {
    // SAFETY: local numbers are below the length of local vectors, checked by `Batches`.
    unsafe { V::scatter_all(y, |batch| nodes(&first[batch], &second[batch], &third[batch]), f) };
}

/// Updates two batches of strips at once. Returns the number of pieces with det F ≤ 0.
#[inline(always)]
pub fn update_pair<V: Batched<2>>(
    c: &Coefficients,
    rest: &mut [RestBatch; BATCHES],
    live: &mut [Batch; BATCHES],
    locals: &mut Locals<'_>,
) -> usize {
    match (rest.as_chunks_mut().0, live.as_chunks_mut().0) {
        ([p, q, r], [first, second, third]) => update::<V, 2>(c, [p, q, r], [first, second, third], locals),
        _ => 0,
    }
}

/// The same for one batch of strips after the other.
#[inline(always)]
pub fn update_each<V: Vector8>(
    c: &Coefficients,
    rest: &mut [RestBatch; BATCHES],
    live: &mut [Batch; BATCHES],
    locals: &mut Locals<'_>,
) -> usize {
    let ([p, s, q, t, r, u], [a, b, d, e, f, g]) = (rest, live);
    let (p, q, r) = (from_mut(p), from_mut(q), from_mut(r));
    let (s, t, u) = (from_mut(s), from_mut(t), from_mut(u));
    update::<V, 1>(c, [p, q, r], [from_mut(a), from_mut(d), from_mut(f)], locals)
        + update::<V, 1>(c, [s, t, u], [from_mut(b), from_mut(e), from_mut(g)], locals)
}

#[inline(always)]
fn update<V: Batched<N>, const N: usize>(
    c: &Coefficients,
    [rest_1, rest_2, rest_3]: [&mut [RestBatch; N]; TETS],
    [first, second, third]: [&mut [Batch; N]; TETS],
    locals: &mut Locals<'_>,
) -> usize {
    let p = update_tet(c, &tet_edges(locals.x, first), rest_1, first);
    let q = update_tet(c, &tet_edges(locals.x, second), rest_2, second);
    let r = update_tet(c, &tet_edges(locals.x, third), rest_3, third);
    scatter([first, second, third], locals.f, &joined(p.f, q.f, r.f));
    let blocks: [[V; 6]; NODES] = joined(p.blocks, q.blocks, r.blocks);
    for batch in 0..N {
        let nodes = nodes(&first[batch], &second[batch], &third[batch]);
        for node in 0..NODES {
            scatter_block(locals.blocks, nodes[node], &blocks[node], batch);
        }
    }
    p.inverted + q.inverted + r.inverted
}

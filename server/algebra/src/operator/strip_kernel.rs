//! The loops over strips: three tets of each lane at once, in six batches.
//!
//! Two batches of strips lie one beside the other, so that both fit into the registers of AVX-512: their first tets
//! are batches 0 and 1, the second ones 2 and 3, the third ones 4 and 5. Sums have the order of one batch of strips
//! after the other.

#![allow(unsafe_code)] // unchecked gathers

use scindo_matter::element::{Batched, Ids, Vector, prefetch};

use super::Padded;
use super::strips::{NODES, TETS};
use super::tet_batch::{Batch, Coefficients, Locals, RestBatch};
use super::tet_lanes::{Found, Three, edges, forces, read, scatter_block, tet_edges, update_tet};
use super::twist::{TwistBatch, read_twist};

/// Batches of tets that two batches of strips consist of.
pub(super) const BATCHES: usize = 2 * TETS;

/// How many pairs of batches of strips ahead stiffness is asked for: a body of half a million tets streams it from memory.
pub(super) const AHEAD: usize = 2;

/// Whether the tets in every lane of these batches still have a face in common: a cut may have taken them apart.
pub(super) fn is_joined(batches: &[Batch; BATCHES]) -> bool {
    let follows = |before: &Batch, after: &Batch| before.nodes[1..] == after.nodes[..3];
    (0..BATCHES - 2).all(|b| follows(&batches[b], &batches[b + 2]))
}

/// y += s K̂ x, as many batches of strips at once as V holds.
#[inline(always)]
pub(super) fn apply<V: Batched<N>, const N: usize, const TWISTED: bool>(
    [batches, soon]: [&[Batch; BATCHES]; 2],
    twists: &[TwistBatch],
    ratio: f32,
    x: &[Padded],
    y: &mut [Padded],
) {
    let [first, second, third] = batches.as_chunks::<2>().0 else { return };
    let tets = first.as_chunks().0.iter().zip(second.as_chunks().0).zip(third.as_chunks().0);
    let [soon_1, soon_2, soon_3] = soon.as_chunks::<2>().0 else { return };
    let soon = soon_1.as_chunks().0.iter().zip(soon_2.as_chunks().0).zip(soon_3.as_chunks().0);
    for (k, (((first, second), third), ((soon_1, soon_2), soon_3))) in tets.zip(soon).enumerate() {
        let (tets, soon) = ([first, second, third], [soon_1, soon_2, soon_3]);
        let twists = if TWISTED { twists_of(twists, k) } else { None };
        apply_strips::<V, N>(tets, soon, twists, ratio, x, y);
    }
}

/// Q of the first, second and third tets in turn number `k`.
#[inline(always)]
fn twists_of<V: Batched<N>, const N: usize>(twists: &[TwistBatch], k: usize) -> Option<[[V; 6]; TETS]> {
    let [first, second, third] = twists.as_chunks::<2>().0 else { return None };
    let [first, second, third] = [&first.as_chunks().0[k], &second.as_chunks().0[k], &third.as_chunks().0[k]];
    Some([read_twist(first), read_twist(second), read_twist(third)])
}

/// Local numbers of the copies of the strips in one batch.
#[inline(always)]
fn nodes<'a>(first: &'a Batch, second: &'a Batch, third: &'a Batch) -> [&'a Ids; NODES] {
    let [a, b, c, d] = &first.nodes;
    [a, b, c, d, &second.nodes[3], &third.nodes[3]]
}

#[inline(always)]
fn apply_strips<V: Batched<N>, const N: usize>(
    [first, second, third]: [&[Batch; N]; TETS],
    soon: [&[Batch; N]; TETS],
    twists: Option<[[V; 6]; TETS]>,
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
    let (mut first_twist, mut second_twist, mut third_twist) = (None, None, None);
    if let Some([p, q, r]) = twists {
        (first_twist, second_twist, third_twist) = (Some(p), Some(q), Some(r));
    }
    prefetch(soon[0]);
    let p = forces(&read(first, |b| &b.g), &edges(u[0], u[1], u[2], u[3]), ratio, first_twist);
    prefetch(soon[1]);
    let q = forces(&read(second, |b| &b.g), &edges(u[1], u[2], u[3], u[4]), ratio, second_twist);
    prefetch(soon[2]);
    let r = forces(&read(third, |b| &b.g), &edges(u[2], u[3], u[4], u[5]), ratio, third_twist);
    scatter([first, second, third], y, &joined(p, q, r));
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

/// Updates them in the same way.
#[inline(always)]
pub(super) fn update<V: Batched<N>, const N: usize>(
    c: &Coefficients,
    rest: &mut [RestBatch; BATCHES],
    live: &mut [Batch; BATCHES],
    locals: &mut Locals<'_>,
    found: &mut Found,
) {
    let [first, second, third] = live.as_chunks_mut::<2>().0 else { return };
    let [p, q, r] = rest.as_chunks_mut::<2>().0 else { return };
    let tets = first.as_chunks_mut().0.iter_mut().zip(second.as_chunks_mut().0).zip(third.as_chunks_mut().0);
    let rest = p.as_chunks_mut().0.iter_mut().zip(q.as_chunks_mut().0).zip(r.as_chunks_mut().0);
    for (((first, second), third), ((p, q), r)) in tets.zip(rest) {
        update_strips::<V, N>(c, [p, q, r], [first, second, third], locals, found);
    }
}

#[inline(always)]
fn update_strips<V: Batched<N>, const N: usize>(
    c: &Coefficients,
    [rest_1, rest_2, rest_3]: [&mut [RestBatch; N]; TETS],
    [first, second, third]: [&mut [Batch; N]; TETS],
    locals: &mut Locals<'_>,
    found: &mut Found,
) {
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
    [p, q, r].iter().for_each(|tet| found.add(tet));
}

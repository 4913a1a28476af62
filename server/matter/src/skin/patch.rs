//! Gives the triangles of a surface to the skin between its edges: where each skin point rests.
//!
//! The edges of an [`Overlay`] divide the skin into patches. A patch whose border is that of one triangle becomes it.
//! Points on its border rest on the edges, and points inside it at a weighted mean of their neighbours. With
//! positive weights and a convex border no part of the triangle is turned over; with mean value weights the parts keep
//! their shape where the boundary is flat. All other patches are places where surface and boundary do not go together;
//! their points rest where those of a skin without triangles of its own do.
//!
//! # Source
//! Tutte 1963, "How to draw a graph"; Floater 2003, "Mean value coordinates", eq. 2.1.

use nalgebra::{DMatrix, Matrix3, Vector3};

use super::overlay::Overlay;
use super::own::{Kept, OwnSurface};
use super::sheet::{Sheet, SkinShape};
use crate::cut::topology::fragments::NONE;

/// Most points inside a patch whose places are found by elimination. More are found by relaxation.
const ELIMINATED: usize = 96;
/// Sweeps of relaxation.
const SWEEPS: usize = 400;
/// Area of a part that may be turned over by rounding, relative to its triangle.
const TURNED: f64 = 1e-12;

/// Part of the skin between edges of a surface.
struct Patch {
    triangles: Vec<u32>,
    /// Its half-edges along edges of the surface, in no order.
    border: Vec<u32>,
}

/// Lets the skin rest on the surface, and its other points where `shape` says. Returns how much of the surface it took.
pub(super) fn rest_on(
    own: &OwnSurface<'_>,
    overlay: &Overlay,
    nodes: &[Vector3<f64>],
    sheet: &mut Sheet,
    shape: &mut SkinShape<'_>,
) -> Kept {
    let mut at: Vec<Option<Vector3<f64>>> = vec![None; sheet.points.len()];
    for (edge, path) in overlay.edges.iter().zip(&overlay.paths) {
        along(edge.ends.map(|v| own.vertices[v as usize]), path, nodes, sheet, &mut at);
    }
    // Number of edges of each triangle that have been drawn, and of their parts.
    let mut drawn = vec![(0, 0); own.triangles.len()];
    for (edge, path) in overlay.edges.iter().zip(&overlay.paths).filter(|(_, path)| !path.is_empty()) {
        for &t in edge.beside.iter().flatten() {
            let (edges, parts) = &mut drawn[t as usize];
            (*edges, *parts) = (*edges + 1, *parts + path.len() - 1);
        }
    }
    let mut kept = Kept { of: own.triangles.len(), triangles: 0, area: 0.0 };
    let whole: f64 = (0..own.triangles.len() as u32).map(|t| own.area_normal(t).norm()).sum();
    for patch in patches(sheet) {
        let Some(t) = owner(&patch, overlay, sheet) else { continue };
        let normal = own.area_normal(t);
        if drawn[t as usize] == (3, patch.border.len()) && fill(&patch, &normal, nodes, sheet, &mut at) {
            kept.triangles += 1;
            kept.area += normal.norm() / whole;
        }
    }
    for (p, normal) in sheet.normals(nodes).iter().enumerate() {
        let flat = sheet.flat(p as u32, nodes);
        sheet.points[p].place = at[p].unwrap_or_else(|| shape(&flat, normal));
    }
    kept
}

/// Lets the points of a path rest on its edge, whose ends are at `ends` [m], in proportion to the way between them.
fn along(
    ends: [Vector3<f64>; 2],
    path: &[u32],
    nodes: &[Vector3<f64>],
    sheet: &Sheet,
    at: &mut [Option<Vector3<f64>>],
) {
    let flat: Vec<Vector3<f64>> = path.iter().map(|&p| sheet.flat(p, nodes)).collect();
    let whole: f64 = flat.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum();
    let mut gone = 0.0;
    for (k, &point) in path.iter().enumerate() {
        if k > 0 {
            gone += (flat[k] - flat[k - 1]).norm();
        }
        at[point as usize] =
            Some(if k + 1 == path.len() { ends[1] } else { ends[0].lerp(&ends[1], gone / whole) });
    }
}

/// The parts into which the marked half-edges divide the skin.
fn patches(sheet: &Sheet) -> Vec<Patch> {
    let mut seen = vec![false; sheet.corners.len()];
    let mut patches = Vec::new();
    for first in 0..sheet.corners.len() as u32 {
        if std::mem::replace(&mut seen[first as usize], true) {
            continue;
        }
        let mut patch = Patch { triangles: vec![first], border: Vec::new() };
        let mut next = 0;
        while let Some(&t) = patch.triangles.get(next) {
            next += 1;
            for h in 3 * t..3 * t + 3 {
                let beside = sheet.twin[h as usize] / 3;
                if sheet.chain[h as usize] != NONE {
                    patch.border.push(h);
                } else if !std::mem::replace(&mut seen[beside as usize], true) {
                    patch.triangles.push(beside);
                }
            }
        }
        patches.push(patch);
    }
    patches
}

/// The triangle of the surface whose edges are the whole border of the patch, seen from inside. None if the border belongs
/// to several, or the patch is no disk.
fn owner(patch: &Patch, overlay: &Overlay, sheet: &Sheet) -> Option<u32> {
    let beside = |&h: &u32| {
        let number = sheet.chain[h as usize] as usize;
        let ends = [sheet.from(h), sheet.to(h)];
        let forward = overlay.paths[number].windows(2).any(|pair| pair == ends);
        overlay.edges[number].beside[usize::from(!forward)]
    };
    let t = patch.border.first().and_then(beside)?;
    let mut points: Vec<u32> = patch.triangles.iter().flat_map(|&t| sheet.corners[t as usize]).collect();
    points.sort_unstable();
    points.dedup();
    let (faces, sides) = (patch.triangles.len(), patch.border.len());
    let disk = points.len() + faces == (3 * faces + sides) / 2 + 1;
    (disk && patch.border.iter().all(|h| beside(h) == Some(t))).then_some(t)
}

/// Finds places for the points inside a patch that becomes the triangle with this area normal. Returns whether no part of
/// it is turned over.
fn fill(
    patch: &Patch,
    normal: &Vector3<f64>,
    nodes: &[Vector3<f64>],
    sheet: &Sheet,
    at: &mut [Option<Vector3<f64>>],
) -> bool {
    let mut border: Vec<u32> = patch.border.iter().map(|&h| sheet.from(h)).collect();
    border.sort_unstable();
    let mut inner: Vec<u32> = patch.triangles.iter().flat_map(|&t| sheet.corners[t as usize]).collect();
    inner.sort_unstable();
    inner.dedup();
    inner.retain(|p| border.binary_search(p).is_err());
    let weights = mean_value_weights(patch, &inner, nodes, sheet);
    let places = if inner.len() <= ELIMINATED {
        eliminated(&inner, &weights, at)
    } else {
        Some(relaxed(&inner, &weights, &border, nodes, sheet, at))
    };
    let Some(places) = places else { return false };
    let place = |p: u32| match inner.binary_search(&p) {
        Ok(i) => places[i],
        Err(_) => at[p as usize].unwrap_or_default(),
    };
    let upright = |&t: &u32| {
        let [a, b, c] = sheet.corners[t as usize].map(place);
        (b - a).cross(&(c - a)).dot(normal) >= -TURNED * normal.norm_squared()
    };
    let upright = patch.triangles.iter().all(upright);
    if upright {
        inner.iter().zip(&places).for_each(|(&p, place)| at[p as usize] = Some(*place));
    }
    upright
}

/// Neighbours of each inner point, with positive weights whose sum is 1.
fn mean_value_weights(
    patch: &Patch,
    inner: &[u32],
    nodes: &[Vector3<f64>],
    sheet: &Sheet,
) -> Vec<Vec<(u32, f64)>> {
    let mut weights: Vec<Vec<(u32, f64)>> = vec![Vec::new(); inner.len()];
    for corners in patch.triangles.iter().map(|&t| sheet.corners[t as usize]) {
        let flat = corners.map(|p| sheet.flat(p, nodes));
        for k in 0..3 {
            let Ok(i) = inner.binary_search(&corners[k]) else { continue };
            let (next, last) = ((k + 1) % 3, (k + 2) % 3);
            let (u, v) = (flat[next] - flat[k], flat[last] - flat[k]);
            // tan(α/2) = sin α / (1 + cos α)
            let (lengths, sine) = (u.norm() * v.norm(), u.cross(&v).norm());
            let tangent = (sine / (lengths + u.dot(&v)).max(f64::MIN_POSITIVE)).clamp(1e-9, 1e9);
            for (corner, length) in [(next, u.norm()), (last, v.norm())] {
                let weight = tangent / length.max(f64::MIN_POSITIVE);
                match weights[i].iter_mut().find(|(p, _)| *p == corners[corner]) {
                    Some((_, sum)) => *sum += weight,
                    None => weights[i].push((corners[corner], weight)),
                }
            }
        }
    }
    for weights in &mut weights {
        let sum: f64 = weights.iter().map(|(_, weight)| weight).sum();
        weights.iter_mut().for_each(|(_, weight)| *weight /= sum);
    }
    weights
}

/// Places of the inner points by Gaussian elimination.
fn eliminated(
    inner: &[u32],
    weights: &[Vec<(u32, f64)>],
    at: &[Option<Vector3<f64>>],
) -> Option<Vec<Vector3<f64>>> {
    if inner.is_empty() {
        return Some(Vec::new());
    }
    let n = inner.len();
    let mut matrix = DMatrix::<f64>::identity(n, n);
    let mut right = DMatrix::<f64>::zeros(n, 3);
    for (i, weights) in weights.iter().enumerate() {
        for &(p, weight) in weights {
            match inner.binary_search(&p) {
                Ok(j) => matrix[(i, j)] -= weight,
                Err(_) => {
                    let known = at[p as usize].unwrap_or_default() * weight;
                    (0..3).for_each(|axis| right[(i, axis)] += known[axis]);
                }
            }
        }
    }
    let found = matrix.lu().solve(&right)?;
    let places: Vec<Vector3<f64>> =
        found.row_iter().map(|row| Vector3::new(row[0], row[1], row[2])).collect();
    places.iter().all(|x| x.iter().all(|c| c.is_finite())).then_some(places)
}

/// Places of the inner points by relaxation. It starts from the affine map that fits the border best, so it stays in the
/// plane of the triangle, and is done at once where the boundary is flat.
fn relaxed(
    inner: &[u32],
    weights: &[Vec<(u32, f64)>],
    border: &[u32],
    nodes: &[Vector3<f64>],
    sheet: &Sheet,
    at: &[Option<Vector3<f64>>],
) -> Vec<Vector3<f64>> {
    let place = |p: u32| at[p as usize].unwrap_or_default();
    let mean =
        |points: &mut dyn Iterator<Item = Vector3<f64>>| points.sum::<Vector3<f64>>() / border.len() as f64;
    let flat_mean = mean(&mut border.iter().map(|&p| sheet.flat(p, nodes)));
    let place_mean = mean(&mut border.iter().map(|&p| place(p)));
    let (mut moments, mut mixed) = (Matrix3::zeros(), Matrix3::zeros());
    for &p in border {
        let flat = sheet.flat(p, nodes) - flat_mean;
        moments += flat * flat.transpose();
        mixed += (place(p) - place_mean) * flat.transpose();
    }
    let inverse = moments.pseudo_inverse(1e-9 * moments.norm()).unwrap_or_default();
    let map = mixed * inverse;
    let start = |&p: &u32| place_mean + map * (sheet.flat(p, nodes) - flat_mean);
    let mut places: Vec<Vector3<f64>> = inner.iter().map(start).collect();
    for _ in 0..SWEEPS {
        for (i, weights) in weights.iter().enumerate() {
            let neighbour = |p: u32| inner.binary_search(&p).map_or_else(|_| place(p), |j| places[j]);
            places[i] = weights.iter().map(|&(p, weight)| neighbour(p) * weight).sum();
        }
    }
    places
}

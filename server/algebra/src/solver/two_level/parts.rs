//! Stiffness of the parts of a body in the coarse unknowns, at rest, to be rotated with each part.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use scindo_matter::element::Points;
use scindo_matter::material::Material;

use super::interpolation::Interpolation;
use crate::assembly::BlockCsr;

/// Iterations for the rotation of a part, and its accuracy [rad]. They start from that of the last update.
const POLAR: (usize, f32) = (5, 1e-3);

/// Stiffness of every part for s = 1, and what its rotation follows from.
///
/// All elements of a part take its mean rotation. This is exact for rigid motions and where a part is not bent. A
/// preconditioner need not be more accurate.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Parts {
    /// Pairs of coarse unknowns of part p: `first_pair[p]..first_pair[p + 1]`.
    first_pair: Vec<u32>,
    pairs: Vec<Pair>,
    /// Nodes of its elements, likewise.
    first_node: Vec<u32>,
    nodes: Vec<Share>,
    /// Rotation of every part at the last update.
    pub rotations: Vec<UnitQuaternion<f32>>,
}

/// A block of the stiffness of a part.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
struct Pair {
    /// Place of the block in the coarse matrix.
    at: u32,
    block: [f32; 9],
}

/// Part of a node in the mean deformation of a part: F = Σ x bᵀ.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
struct Share {
    node: u32,
    b: [f32; 3],
}

/// The coarse unknowns of a part, ascending, with the blocks of the lower triangle by rows.
#[derive(Default)]
struct Dense {
    unknowns: Vec<u32>,
    blocks: Vec<[f32; 9]>,
    nodes: Vec<u32>,
    b: Vec<Vector3<f64>>,
}

impl Parts {
    /// Parts of a body with nodes at `rest` [m], and a coarse matrix with their pattern.
    pub(super) fn new(
        interpolation: &Interpolation,
        (points, material): (&dyn Points, &Material),
        rest: &[Vector3<f64>],
    ) -> (Self, BlockCsr<f64>) {
        let dense = stiffness(interpolation, (points, material), rest);
        let matrix = BlockCsr::with_rows(pattern(interpolation, &dense));
        let mut parts = Self { first_pair: vec![0], first_node: vec![0], ..Self::default() };
        for part in &dense {
            for (i, j, block) in part.lower() {
                if let Some(at) = matrix.position(i as usize, j) {
                    parts.pairs.push(Pair { at: at as u32, block: *block });
                }
            }
            let shares = part.nodes.iter().zip(&part.b);
            parts.nodes.extend(shares.map(|(&node, b)| Share { node, b: b.map(|b| b as f32).into() }));
            parts.first_pair.push(parts.pairs.len() as u32);
            parts.first_node.push(parts.nodes.len() as u32);
        }
        parts.rotations = vec![UnitQuaternion::identity(); dense.len()];
        (parts, matrix)
    }

    /// Finds the mean rotations with the nodes at `x` [m].
    pub(super) fn rotate(&mut self, x: &[Vector3<f64>]) {
        for (part, rotation) in self.rotations.iter_mut().enumerate() {
            let nodes = &self.nodes[self.first_node[part] as usize..self.first_node[part + 1] as usize];
            let Some(origin) = nodes.first().map(|share| x[share.node as usize]) else { continue };
            let mut F = Matrix3::<f32>::zeros();
            for Share { node, b } in nodes {
                let x = (x[*node as usize] - origin).map(|v| v as f32);
                F += x * nalgebra::RowVector3::from(*b);
            }
            let size = F.amax();
            if size > 0.0 && size.is_finite() {
                let turned = UnitQuaternion::from_matrix_eps(&(F / size), POLAR.1, POLAR.0, *rotation);
                if turned.coords.iter().all(|c| c.is_finite()) {
                    *rotation = turned;
                }
            }
        }
    }

    /// Adds s Σ R K Rᵀ to the blocks of the coarse matrix.
    pub(super) fn add_to(&self, scale: f64, blocks: &mut [[f64; 9]]) {
        for (part, rotation) in self.rotations.iter().enumerate() {
            let R = rotation.to_rotation_matrix().into_inner();
            let pairs = &self.pairs[self.first_pair[part] as usize..self.first_pair[part + 1] as usize];
            for Pair { at, block } in pairs {
                let B = R * Matrix3::from_row_slice(block) * R.transpose();
                let sum = &mut blocks[*at as usize];
                for r in 0..3 {
                    for c in 0..3 {
                        sum[3 * r + c] += scale * f64::from(B[(r, c)]);
                    }
                }
            }
        }
    }
}

impl Dense {
    /// The blocks (i, j), j ≤ i, that are not 0.
    fn lower(&self) -> impl Iterator<Item = (u32, u32, &[f32; 9])> {
        let rows = self.unknowns.iter().enumerate();
        let places = rows.flat_map(|(at, &i)| self.unknowns[..=at].iter().map(move |&j| (i, j)));
        places.zip(&self.blocks).map(|((i, j), block)| (i, j, block)).filter(|(.., b)| **b != [0.0; 9])
    }
}

/// Columns of every row of the lower triangle of the coarse matrix.
fn pattern(interpolation: &Interpolation, dense: &[Dense]) -> Vec<Vec<u32>> {
    let mut rows = vec![Vec::new(); interpolation.n_coarse()];
    for part in dense {
        part.lower().for_each(|(i, j, _)| rows[i as usize].push(j));
    }
    // Masses and springs connect all corners of a part.
    for part in 0..dense.len() as u32 {
        let corners = interpolation.corners(part);
        for &i in corners {
            rows[i as usize].extend(corners.iter().filter(|&&j| j < i));
        }
    }
    for row in &mut rows {
        row.sort_unstable();
        row.dedup();
    }
    rows
}

/// Stiffness of every part at rest for s = 1, and the nodes of its elements.
fn stiffness(
    interpolation: &Interpolation,
    (points, material): (&dyn Points, &Material),
    rest: &[Vector3<f64>],
) -> Vec<Dense> {
    let mut dense: Vec<Dense> = (0..interpolation.n_parts()).map(|_| Dense::default()).collect();
    points.for_points(rest, &mut |point| {
        let part = &mut dense[part_of(interpolation, point.nodes)];
        for &node in point.nodes {
            insert(&mut part.nodes, node);
            for (corner, _) in corners(interpolation, node) {
                insert(&mut part.unknowns, corner);
            }
        }
    });
    for part in &mut dense {
        let m = part.unknowns.len();
        part.blocks = vec![[0.0; 9]; m * (m + 1) / 2];
        part.b = vec![Vector3::zeros(); part.nodes.len()];
    }
    // Gradients of the coarse shape functions in an element, by place in the unknowns of its part.
    let mut gradients: Vec<(usize, Vector3<f32>)> = Vec::new();
    points.for_points(rest, &mut |point| {
        let part = &mut dense[part_of(interpolation, point.nodes)];
        gradients.clear();
        for (&node, g) in point.nodes.iter().zip(point.gradients) {
            if let Ok(at) = part.nodes.binary_search(&node) {
                part.b[at] += point.weight * g;
            }
            let g = g.map(|g| g as f32);
            for (corner, w) in corners(interpolation, node) {
                let Ok(at) = part.unknowns.binary_search(&corner) else { continue };
                match gradients.iter_mut().find(|known| known.0 == at) {
                    Some(known) => known.1 += w * g,
                    None => gradients.push((at, w * g)),
                }
            }
        }
        let lame = points.lame(point.region, material);
        let (mu, lambda) = ((lame.mu * point.weight) as f32, (lame.lambda * point.weight) as f32);
        for &(i, gi) in &gradients {
            let (along, across) = (lambda * gi, mu * gi);
            for &(j, gj) in gradients.iter().filter(|known| known.0 <= i) {
                let block = &mut part.blocks[i * (i + 1) / 2 + j];
                let dot = across.dot(&gj);
                for r in 0..3 {
                    for c in 0..3 {
                        block[3 * r + c] += along[r] * gj[c] + gj[r] * across[c];
                    }
                    block[4 * r] += dot;
                }
            }
        }
    });
    dense
}

/// Coarse unknowns that move a node, with their weights.
fn corners(interpolation: &Interpolation, node: u32) -> impl Iterator<Item = (u32, f32)> + '_ {
    let corners = interpolation.corners_of_node(node).iter().copied();
    corners.zip(interpolation.weights(node as usize)).filter(|(_, w)| *w > 0.0)
}

/// The part that an element with these nodes belongs to: that of most of them, the first one where several have most.
fn part_of(interpolation: &Interpolation, nodes: &[u32]) -> usize {
    let count = |part: u32| nodes.iter().filter(|&&node| interpolation.part(node) == part).count();
    let (mut best, mut most) = (0, 0);
    for &node in nodes {
        let part = interpolation.part(node);
        let n = count(part);
        if n > most {
            (best, most) = (part as usize, n);
        }
    }
    best
}

fn insert(sorted: &mut Vec<u32>, item: u32) {
    if let Err(at) = sorted.binary_search(&item) {
        sorted.insert(at, item);
    }
}

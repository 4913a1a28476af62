//! P, the interpolation from the coarse unknowns to the nodes of a body.

use nalgebra::Vector3;
use scindo_matter::storage::disjoint::{find, join};
use scindo_matter::team::{Team, blocks};

use super::lattice::{Lattice, weights};
use crate::operator::Padded;

/// Calls what it is given with the nodes of one element after another.
pub(super) type ForGroups<'a> = &'a dyn Fn(&mut dyn FnMut(&[u32]));

/// Parts per task of a parallel restriction.
const PARTS: usize = 16;

/// Trilinear interpolation in the cells of a lattice, with unknowns of their own for the sides of a cut.
///
/// The nodes of one cell that elements within the cell connect are a *part*. A part has eight corners, and parts of
/// neighbouring cells share theirs where an element reaches from one to the other.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Interpolation {
    /// Part of every node, and its place in the cell.
    nodes: Vec<Node>,
    /// Coarse unknowns at the corners of every part.
    corners: Vec<[u32; 8]>,
    /// Nodes of every part: its own are `members[first[part]..first[part + 1]]`, ascending.
    first: Vec<u32>,
    members: Vec<u32>,
    /// Corners (8 · part + corner) of every coarse unknown, likewise.
    first_corner: Vec<u32>,
    corners_of: Vec<u32>,
    /// Scratch: a vector per corner of every part.
    at_corners: Vec<[Padded; 8]>,
}

/// The applied part of nodes that are left out.
const NONE: u32 = u32::MAX;

#[derive(Clone, Copy, Debug, Default, serde::Serialize, serde::Deserialize)]
struct Node {
    part: u32,
    /// The same, or [`NONE`] if the node is left out.
    applied: u32,
    place: [f32; 3],
}

impl Interpolation {
    /// The interpolation to nodes at `points` [m]. `for_groups` hands over the nodes of one element after another.
    /// Nodes for which `left_out` holds have weights, but P applies neither to them nor to forces on them.
    pub(super) fn new(
        lattice: &Lattice,
        points: &[Vector3<f64>],
        (for_groups, left_out): (ForGroups<'_>, &dyn Fn(u32) -> bool),
    ) -> Self {
        let located: Vec<_> = points.iter().map(|point| lattice.locate(point)).collect();
        let cell = |node: u32| located[node as usize].0;
        // Nodes of a cell are one part only where elements connect them, so the sides of a cut stay apart.
        let mut root: Vec<u32> = (0..points.len() as u32).collect();
        for_groups(&mut |group| {
            for (i, &a) in group.iter().enumerate() {
                let same = group[i + 1..].iter().find(|&&b| cell(b) == cell(a));
                if let Some(&b) = same
                    && root[a as usize] != root[b as usize]
                {
                    join(&mut root, a, b);
                }
            }
        });
        // The smallest node represents its part, so parts are numbered in that order.
        let (mut nodes, mut cells) = (Vec::with_capacity(points.len()), Vec::new());
        for node in 0..points.len() as u32 {
            let smallest = find(&mut root, node);
            let part = if smallest == node {
                cells.push(cell(node));
                cells.len() as u32 - 1
            } else {
                let Node { part, .. } = nodes[smallest as usize];
                part
            };
            nodes.push(Node { part, applied: part, place: located[node as usize].1 });
        }
        let part = |node: u32| nodes[node as usize].part;
        // Corners of neighbouring cells are united in the same way: no coarse unknown reaches across a cut.
        let mut root: Vec<u32> = (0..8 * cells.len() as u32).collect();
        for_groups(&mut |group| {
            for (i, &a) in group.iter().enumerate() {
                for &b in &group[i + 1..] {
                    let (a, b) = (part(a), part(b));
                    if a != b {
                        share_corners(&mut root, [a, b], [cells[a as usize], cells[b as usize]]);
                    }
                }
            }
        });
        let (mut corners, mut number, mut n) = (vec![[0; 8]; cells.len()], vec![0; root.len()], 0);
        for at in 0..root.len() as u32 {
            let smallest = find(&mut root, at);
            if smallest == at {
                number[at as usize] = n;
                n += 1;
            }
            corners[at as usize / 8][at as usize % 8] = number[smallest as usize];
        }
        // Not before: nodes that are left out connect parts like all others, and keep their weights.
        for (node, known) in (0..).zip(&mut nodes) {
            if left_out(node) {
                known.applied = NONE;
            }
        }
        let (first, members) = grouped(cells.len(), nodes.iter().map(|node| node.applied));
        let (first_corner, corners_of) = grouped(n as usize, corners.iter().flatten().copied());
        let at_corners = vec![[[0.0; 4]; 8]; cells.len()];
        Self { nodes, corners, first, members, first_corner, corners_of, at_corners }
    }

    /// Number of coarse unknowns.
    pub(super) fn n_coarse(&self) -> usize {
        self.first_corner.len().saturating_sub(1)
    }

    /// Number of parts.
    pub(super) fn n_parts(&self) -> usize {
        self.corners.len()
    }

    /// Part of a node.
    pub(super) fn part(&self, node: u32) -> u32 {
        self.nodes[node as usize].part
    }

    /// Coarse unknowns at the corners of a part.
    pub(super) fn corners(&self, part: u32) -> &[u32; 8] {
        &self.corners[part as usize]
    }

    /// Coarse unknowns at the corners of the part of a node.
    pub(super) fn corners_of_node(&self, node: u32) -> &[u32; 8] {
        self.corners(self.part(node))
    }

    /// Weights of the corners of its part in the displacement of a node.
    #[inline(always)]
    pub(super) fn weights(&self, node: usize) -> [f32; 8] {
        weights(self.nodes[node].place)
    }

    /// b = Pᵀ r.
    pub(super) fn restrict(&mut self, team: &mut Team, r: &[Padded], b: &mut [Padded]) {
        let Self { nodes, first, members, first_corner, corners_of, at_corners, .. } = self;
        let (nodes, first, members) = (&*nodes, &*first, &*members);
        team.for_blocks(blocks(at_corners, PARTS), |block, at_corners| {
            for (i, at_corners) in at_corners.iter_mut().enumerate() {
                let part = block * PARTS + i;
                let mut sums = [[0.0; 4]; 8];
                for &node in &members[first[part] as usize..first[part + 1] as usize] {
                    spread(&r[node as usize], nodes[node as usize].place, &mut sums);
                }
                *at_corners = sums;
            }
        });
        for (i, b) in b.iter_mut().enumerate() {
            let mut sum = [0.0; 4];
            for &at in &corners_of[first_corner[i] as usize..first_corner[i + 1] as usize] {
                let part = &at_corners[at as usize / 8][at as usize % 8];
                (0..4).for_each(|k| sum[k] += part[k]);
            }
            *b = sum;
        }
    }

    /// Takes the coarse displacements `u` for [`displacement`](Self::displacement).
    pub(super) fn set(&mut self, u: &[Padded]) {
        for (at, corners) in self.at_corners.iter_mut().zip(&self.corners) {
            *at = corners.map(|c| u[c as usize]);
        }
    }

    /// The interpolated displacement of a node.
    #[inline(always)]
    pub(super) fn displacement(&self, node: usize) -> Padded {
        let Node { applied, place, .. } = self.nodes[node];
        self.at_corners.get(applied as usize).map_or([0.0; 4], |corners| interpolate(corners, place))
    }
}

/// Adds w r to each corner, with its trilinear weight w at `place`. Taking one axis after another needs fewer operations
/// than eight weights do.
#[inline(always)]
fn spread(r: &Padded, [x, y, z]: [f32; 3], corners: &mut [Padded; 8]) {
    let split = |r: &Padded, t: f32| -> [Padded; 2] {
        let far = r.map(|r| t * r);
        [std::array::from_fn(|k| r[k] - far[k]), far]
    };
    for (i, r) in split(r, z).iter().enumerate() {
        for (j, r) in split(r, y).iter().enumerate() {
            for (l, r) in split(r, x).iter().enumerate() {
                let sum = &mut corners[4 * i + 2 * j + l];
                (0..4).for_each(|k| sum[k] += r[k]);
            }
        }
    }
}

/// Trilinear interpolation between the corners, likewise.
#[inline(always)]
fn interpolate(u: &[Padded; 8], [x, y, z]: [f32; 3]) -> Padded {
    let between =
        |a: &Padded, b: &Padded, t: f32| -> Padded { std::array::from_fn(|k| a[k] + t * (b[k] - a[k])) };
    let [a, b, c, d] = std::array::from_fn(|i| between(&u[2 * i], &u[2 * i + 1], x));
    between(&between(&a, &b, y), &between(&c, &d, y), z)
}

/// Unites the corners that two parts in these cells have in common.
fn share_corners(root: &mut [u32], parts: [u32; 2], [cell, other]: [[u32; 3]; 2]) {
    for corner in 0..8 {
        if let Some(own) = Lattice::shared(cell, other, corner) {
            let (a, b) = (8 * parts[0] + own as u32, 8 * parts[1] + corner as u32);
            if root[a as usize] != root[b as usize] {
                join(root, a, b);
            }
        }
    }
}

/// Items by the group that each is in, if any, as start of every group and items.
fn grouped(n: usize, of: impl Iterator<Item = u32> + Clone) -> (Vec<u32>, Vec<u32>) {
    let mut first = vec![0; n + 1];
    of.clone().filter(|&group| group != NONE).for_each(|group| first[group as usize + 1] += 1);
    (0..n).for_each(|group| first[group + 1] += first[group]);
    let (mut next, mut items) = (first.clone(), vec![0; first[n] as usize]);
    for (item, group) in (0..).zip(of).filter(|&(_, group)| group != NONE) {
        items[next[group as usize] as usize] = item;
        next[group as usize] += 1;
    }
    (first, items)
}

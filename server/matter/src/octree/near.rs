//! The leaves near a box in the deformed body.
//!
//! A leaf may meet a box unless all its vertices are beyond one face of it. Leaves with following numbers lie near
//! each other, so whole runs of them are passed over by the boxes of the vertices that carry them. A search reads every
//! position once, and looks at leaves only where the box is.

use nalgebra::Vector3;

use super::cells::Octree;
use crate::storage::jagged::Jagged;
use crate::team::{Team, blocks};

/// Leaves of a run.
const RUN: usize = 64;
/// Vertices with one box.
const BLOCK: usize = 64;
/// Blocks per unit of work.
const BLOCKS: usize = 64;
/// Positions that are compared at once.
const AT_ONCE: usize = 2;

/// Which blocks of vertices carry each run of leaves.
#[derive(Clone, Debug)]
pub struct LeafRuns(Jagged<u32>);

/// Boxes around blocks of vertices in the deformed body.
#[derive(Clone, Debug)]
pub struct VertexBoxes<'a> {
    /// Positions of the vertices [m].
    x: &'a [Vector3<f64>],
    /// Corners of the box of each block [m].
    boxes: Vec<[Vector3<f64>; 2]>,
}

impl<'a> VertexBoxes<'a> {
    /// The boxes with the vertices at `x` [m]; `None` if a position is not finite.
    pub fn new(team: &mut Team, x: &'a [Vector3<f64>]) -> Option<Self> {
        let mut boxes = vec![[Vector3::zeros(); 2]; x.len().div_ceil(BLOCK)];
        let mut finite = vec![true; boxes.len().div_ceil(BLOCKS)];
        team.for_blocks((blocks(&mut boxes, BLOCKS), blocks(&mut finite, 1)), |k, (boxes, finite)| {
            for (i, bounds) in boxes.iter_mut().enumerate() {
                let first = (k * BLOCKS + i) * BLOCK;
                let found = bounds_of(&x[first..x.len().min(first + BLOCK)]);
                finite[0] &= found.is_some();
                *bounds = found.unwrap_or_default();
            }
        });
        finite.iter().all(|&finite| finite).then_some(Self { x, boxes })
    }

    /// Positions of the vertices [m].
    pub fn positions(&self) -> &'a [Vector3<f64>] {
        self.x
    }
}

impl LeafRuns {
    /// The runs of all leaves.
    pub fn new(octree: &Octree) -> Self {
        let mut runs = Self(Jagged::default());
        runs.0.grow(octree.cells().len().div_ceil(RUN));
        (0..runs.0.len()).for_each(|run| runs.renew(octree, run));
        runs
    }

    /// Follows a change of these leaves, ascending, that left the numbers of all others.
    pub fn follow(&mut self, octree: &Octree, changed: &[u32]) {
        self.0.grow(octree.cells().len().div_ceil(RUN));
        for leaves in changed.chunk_by(|&a, &b| a as usize / RUN == b as usize / RUN) {
            self.renew(octree, leaves[0] as usize / RUN);
        }
    }

    fn renew(&mut self, octree: &Octree, run: usize) {
        let vertices = octree.vertices();
        let leaves = &vertices[run * RUN..vertices.len().min((run + 1) * RUN)];
        // Each corner of the leaves mostly stays in a block from one leaf to the next.
        let (mut blocks, mut last) = (Vec::new(), [u32::MAX; 8]);
        for vertices in leaves {
            for (v, last) in vertices.iter().zip(&mut last) {
                let block = v / BLOCK as u32;
                if block != *last {
                    blocks.push(block);
                    *last = block;
                }
            }
        }
        blocks.sort_unstable();
        blocks.dedup();
        self.0.set(run, &blocks);
    }

    /// Leaves that may meet the box between two corners [m], ascending; those of [`Octree::leaves_near`].
    pub fn leaves_near(
        &self,
        octree: &Octree,
        vertices: &VertexBoxes<'_>,
        [low, high]: &[Vector3<f64>; 2],
    ) -> Vec<u32> {
        // One bit for each face of the box that a whole block is beyond.
        let beyond = |[from, to]: &[Vector3<f64>; 2]| {
            (0..3).fold(0_u8, |code, k| {
                code | u8::from(to[k] < low[k]) << k | u8::from(from[k] > high[k]) << (3 + k)
            })
        };
        let codes: Vec<u8> = vertices.boxes.iter().map(beyond).collect();
        let mut leaves = Vec::new();
        for run in 0..self.0.len() {
            if self.0.get(run).iter().fold(!0, |all, &block| all & codes[block as usize]) == 0 {
                leaves.extend((run * RUN) as u32..octree.cells().len().min((run + 1) * RUN) as u32);
            }
        }
        octree.leaves_near_of(&leaves, vertices.x, &[*low, *high])
    }
}

/// The same coordinates of several positions: x, y, z of the first, then of the next.
type Coordinates = [f64; 3 * AT_ONCE];

/// Least and largest coordinates so far, and sums that are 0 unless a number is not finite.
struct Extent {
    low: Coordinates,
    high: Coordinates,
    sums: Coordinates,
}

impl Extent {
    #[inline(always)]
    fn add(&mut self, at: &Coordinates) {
        for i in 0..3 * AT_ONCE {
            self.low[i] = if at[i] < self.low[i] { at[i] } else { self.low[i] };
            self.high[i] = if at[i] > self.high[i] { at[i] } else { self.high[i] };
            self.sums[i] += 0.0 * at[i];
        }
    }
}

/// Corners of the box around these positions [m]; `None` if one is not finite.
fn bounds_of(x: &[Vector3<f64>]) -> Option<[Vector3<f64>; 2]> {
    let zeros = [0.0; 3 * AT_ONCE];
    let mut all =
        Extent { low: zeros.map(|_| f64::INFINITY), high: zeros.map(|_| f64::NEG_INFINITY), sums: zeros };
    let (whole, rest) = x.as_chunks::<AT_ONCE>();
    for x in whole {
        all.add(&std::array::from_fn(|i| x[i / 3][i % 3]));
    }
    for x in rest {
        all.add(&std::array::from_fn(|i| x[i % 3]));
    }
    let at = |all: &Coordinates, i: usize| Vector3::new(all[3 * i], all[3 * i + 1], all[3 * i + 2]);
    let corners = (0..AT_ONCE).map(|i| [at(&all.low, i), at(&all.high, i)]);
    let corners = corners.reduce(|a, b| [a[0].inf(&b[0]), a[1].sup(&b[1])]);
    corners.filter(|_| all.sums == zeros)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::cut::BladeSweep;
    use crate::octree::{BoxShape, OctreeSettings};

    #[test]
    fn runs_find_the_leaves_that_a_search_of_all_leaves_finds() {
        let shape = BoxShape { min: Vector3::zeros(), max: Vector3::new(1.0, 0.7, 0.8) };
        let mut octree = Octree::fill(&shape, OctreeSettings { cells: 20, levels: 2 }, &|_| 0).unwrap();
        let mut runs = LeafRuns::new(&octree);
        let mut team = Team::new(2).unwrap();
        let mut number = 0.0_f64;
        let mut random = || {
            number = (number + 0.754_877_666) % 1.0;
            number
        };
        let (mut found, mut cuts) = (0, 0);
        for round in 0..12 {
            let bend = |p: Vector3<f64>| p + Vector3::new(0.3 * p.z * p.z, 0.2 * p.x * p.z, -0.1 * p.y);
            let x: Vec<Vector3<f64>> = octree.rest_positions().into_iter().map(bend).collect();
            let boxes = VertexBoxes::new(&mut team, &x).unwrap();
            for _ in 0..20 {
                let low = Vector3::from_fn(|_, _| 1.4 * random() - 0.2);
                let high = low + Vector3::from_fn(|_, _| 0.3 * random());
                let near = runs.leaves_near(&octree, &boxes, &[low, high]);
                assert_eq!(near, octree.leaves_near(&x, &[low, high]), "round {round}");
                found += near.len();
            }
            let at = 0.05 + 0.9 * random();
            let edge = |z: f64| [Vector3::new(at, -0.2, z), Vector3::new(at + 0.1, 1.2, z)];
            let blade = BladeSweep { segments: vec![edge(1.2), edge(random())] };
            let change = octree.cut_along(&mut team, &octree.rest_positions(), &[blade]).unwrap();
            cuts += usize::from(!change.cells.is_empty());
            runs.follow(&octree, &change.cells);
        }
        assert!(found > 1000 && cuts > 6, "{found} leaves, {cuts} cuts");
    }

    #[test]
    fn positions_that_are_not_finite_have_no_boxes() {
        let mut x = vec![Vector3::repeat(-2.0); 150];
        x[149] = Vector3::new(3.0, -5.0, 1.0);
        let boxes = VertexBoxes::new(&mut Team::alone(), &x).unwrap().boxes;
        assert_eq!(boxes.len(), 3);
        assert_eq!(boxes[1], [Vector3::repeat(-2.0); 2]);
        assert_eq!(boxes[2], [Vector3::new(-2.0, -5.0, -2.0), Vector3::new(3.0, -2.0, 1.0)]);
        for bad in [f64::NAN, f64::INFINITY] {
            x[70].z = bad;
            assert!(VertexBoxes::new(&mut Team::alone(), &x).is_none());
        }
    }
}

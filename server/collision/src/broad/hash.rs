//! A spatial hash with one grid per size of triangle.
//!
//! The edge of a grid's cells is a power of two. A triangle lies in the finest grid whose cells are no smaller
//! than its box, in the cell of its centre; it reaches out of that cell by at most half an edge. So every
//! triangle has one entry, and large and small ones do not disturb each other. When a triangle moves to
//! another cell, its entry is moved.
//!
//! # Source
//! Teschner et al., Optimized spatial hashing for collision detection of deformable objects (2003), for the hash
//! function; Ericson, Real-Time Collision Detection (2005), §7.2.1, for grids of several sizes.

use super::BroadPhase;
use super::aabb::Aabb;
use super::probe::{NearBox, Probe};
use super::tree::NONE;

/// Finest and coarsest grid: cells of 2^-40 m and 2^60 m.
const FINEST: i32 = -40;
const GRIDS: usize = 101;
/// Number of bits of a cell's coordinates: finer grids are not used far from the origin.
const BITS: i32 = 20;

/// A cell: its grid, and its coordinates there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
struct Cell {
    grid: i32,
    at: [i32; 3],
}

impl Cell {
    /// Bucket of the cell in a table of `mask` + 1 buckets.
    fn bucket(&self, mask: usize) -> usize {
        const PRIMES: [u32; 3] = [73_856_093, 19_349_663, 83_492_791];
        let mixed = |i: usize| (self.at[i] as u32).wrapping_mul(PRIMES[i]);
        let h = mixed(0) ^ mixed(1) ^ mixed(2) ^ (self.grid as u32).wrapping_mul(0x9e37_79b9);
        // The low bits of the products repeat along the axes, so the high ones are mixed in.
        (h ^ (h >> 15)) as usize & mask
    }
}

/// A spatial hash.
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct SpatialHash {
    /// First triangle of each bucket.
    heads: Vec<u32>,
    /// Neighbours of each triangle in the list of its bucket.
    next: Vec<u32>,
    previous: Vec<u32>,
    /// Cell of each triangle.
    cells: Vec<Cell>,
    /// Number of triangles per grid.
    counts: Vec<u32>,
    /// Around all triangles.
    bounds: Option<Aabb>,
    /// Finest grid in use at this distance from the origin.
    finest: i32,
}

impl SpatialHash {
    /// The cell of a box.
    fn cell(&self, aabb: &Aabb) -> Cell {
        let extent = aabb.extents().into_iter().fold(0.0, f32::max);
        let grid = exponent(extent).max(self.finest);
        let inverse = power_of_two(-grid);
        Cell { grid, at: aabb.centre().map(|x| floor(f64::from(x) * inverse)) }
    }

    fn measure(&mut self, boxes: &[Aabb]) {
        let bounds = boxes.iter().fold(Aabb::EMPTY, |sum, aabb| sum.merged(aabb));
        let far = bounds.min.iter().chain(&bounds.max).fold(0.0f32, |far, x| far.max(x.abs()));
        self.finest = (exponent(far) - BITS).clamp(FINEST, FINEST + GRIDS as i32 - 1);
        self.bounds = (!boxes.is_empty()).then_some(bounds);
    }

    fn link(&mut self, triangle: u32, cell: Cell) {
        let mask = self.heads.len() - 1;
        let head = &mut self.heads[cell.bucket(mask)];
        let t = triangle as usize;
        (self.next[t], self.previous[t], self.cells[t]) = (*head, NONE, cell);
        if *head != NONE {
            self.previous[*head as usize] = triangle;
        }
        *head = triangle;
        self.counts[(cell.grid - FINEST) as usize] += 1;
    }

    fn unlink(&mut self, triangle: u32) {
        let t = triangle as usize;
        let (next, previous, cell) = (self.next[t], self.previous[t], self.cells[t]);
        if next != NONE {
            self.previous[next as usize] = previous;
        }
        if previous == NONE {
            let mask = self.heads.len() - 1;
            self.heads[cell.bucket(mask)] = next;
        } else {
            self.next[previous as usize] = next;
        }
        self.counts[(cell.grid - FINEST) as usize] -= 1;
    }

    /// Visits what costs at most `limit`, once each.
    fn visit<P: Probe>(
        &self,
        boxes: &[Aabb],
        probe: &P,
        limit: &mut f64,
        visit: &mut impl FnMut(u32, &mut f64),
    ) {
        let Some(bounds) = &self.bounds else { return };
        let mut test = |t: u32, limit: &mut f64| {
            if probe.to_box(&boxes[t as usize]) <= *limit {
                visit(t, limit);
            }
        };
        let region = Aabb::outside(probe.region(*limit));
        let region = Aabb {
            min: super::aabb::upper(region.min, bounds.min),
            max: super::aabb::lower(region.max, bounds.max),
        };
        if region.extents().iter().any(|&x| x < 0.0) {
            return;
        }
        if self.lookups(&region, P::NEAREST) > boxes.len() as f64 {
            // Looking at every triangle is quicker.
            (0..boxes.len() as u32).for_each(|t| test(t, limit));
            return;
        }
        for grid in self.grids() {
            let [low, high] = self.range(grid, &region);
            let edge = power_of_two(grid) as f32;
            // Layers and columns of cells that the search does not reach are skipped as a whole.
            let reached = |from: [i32; 3], to: [i32; 3], limit: f64| {
                let min = from.map(|i| (i as f32 - 0.501) * edge);
                let max = to.map(|i| (i as f32 + 1.501) * edge);
                probe.to_box(&Aabb { min, max }) <= limit
            };
            for x in low[0]..=high[0] {
                if !reached([x, low[1], low[2]], [x, high[1], high[2]], *limit) {
                    continue;
                }
                for y in low[1]..=high[1] {
                    if !reached([x, y, low[2]], [x, y, high[2]], *limit) {
                        continue;
                    }
                    for z in low[2]..=high[2] {
                        let cell = Cell { grid, at: [x, y, z] };
                        let mut t = self.heads[cell.bucket(self.heads.len() - 1)];
                        if t == NONE || !reached(cell.at, cell.at, *limit) {
                            continue;
                        }
                        while t != NONE {
                            if self.cells[t as usize] == cell {
                                test(t, limit);
                            }
                            t = self.next[t as usize];
                        }
                    }
                }
            }
        }
    }

    /// The grids with triangles.
    fn grids(&self) -> impl Iterator<Item = i32> {
        (FINEST..).zip(&self.counts).filter(|(_, n)| **n > 0).map(|(grid, _)| grid)
    }

    /// Lowest and highest cell of a grid whose triangles can reach into `region`.
    fn range(&self, grid: i32, region: &Aabb) -> [[i32; 3]; 2] {
        let inverse = power_of_two(-grid);
        // A triangle is centred at most half an edge away, and the centre is rounded.
        let cell = |x: f32, side: f64| floor(f64::from(x) * inverse + side * 0.501);
        [region.min.map(|x| cell(x, -1.0)), region.max.map(|x| cell(x, 1.0))]
    }

    /// Number of cells that a search in `region` looks into. A search for the `nearest` reaches few of the cells
    /// of a large region, so only the columns of cells are counted.
    fn lookups(&self, region: &Aabb, nearest: bool) -> f64 {
        let axes = if nearest { 2 } else { 3 };
        let in_grid = |grid: i32| {
            let [low, high] = self.range(grid, region);
            (0..axes).map(|i| f64::from(high[i]) - f64::from(low[i]) + 1.0).product::<f64>()
        };
        self.grids().map(in_grid).sum()
    }
}

/// The smallest grid whose cells are at least `extent` [m] wide.
fn exponent(extent: f32) -> i32 {
    let bits = extent.max(0.0).to_bits();
    let (below, mantissa) = ((bits >> 23) as i32 - 127, bits & ((1 << 23) - 1));
    (below + i32::from(mantissa > 0)).clamp(FINEST, FINEST + GRIDS as i32 - 1)
}

/// 2 to the power of `exponent`, which is within the range of normal numbers.
fn power_of_two(exponent: i32) -> f64 {
    f64::from_bits(((1023 + exponent) as u64) << 52)
}

/// The largest whole number that is at most `x`, within the range of its type. Many processors for which this is
/// compiled have no instruction for it, so [`f64::floor`] is a call.
fn floor(x: f64) -> i32 {
    let towards_zero = x as i32;
    towards_zero.saturating_sub(i32::from(f64::from(towards_zero) > x))
}

impl BroadPhase for SpatialHash {
    fn rebuild(&mut self, boxes: &[Aabb]) {
        let n = boxes.len();
        self.heads.clear();
        self.heads.resize((2 * n).next_power_of_two().max(16), NONE);
        self.next.resize(n, NONE);
        self.previous.resize(n, NONE);
        self.cells.resize(n, Cell::default());
        self.counts.clear();
        self.counts.resize(GRIDS, 0);
        self.measure(boxes);
        for (t, aabb) in (0..).zip(boxes) {
            self.link(t, self.cell(aabb));
        }
    }

    fn refit(&mut self, boxes: &[Aabb]) {
        self.measure(boxes);
        for (t, aabb) in (0..).zip(boxes) {
            let cell = self.cell(aabb);
            if cell != self.cells[t as usize] {
                self.unlink(t);
                self.link(t, cell);
            }
        }
    }

    fn replace(&mut self, removed: &[u32], inserted: &[u32], boxes: &[Aabb]) {
        if boxes.len() > self.heads.len() {
            self.rebuild(boxes);
            return;
        }
        removed.iter().for_each(|&t| self.unlink(t));
        self.next.resize(boxes.len(), NONE);
        self.previous.resize(boxes.len(), NONE);
        self.cells.resize(boxes.len(), Cell::default());
        for &t in inserted {
            self.link(t, self.cell(&boxes[t as usize]));
        }
    }

    fn search<P: Probe>(&self, boxes: &[Aabb], probe: &P, limit: f64, mut visit: impl FnMut(u32, &mut f64)) {
        let mut limit = limit;
        if P::NEAREST
            && let Some(bounds) = &self.bounds
        {
            // The nearest is sought in regions that grow, until it lies inside the region.
            let mut distance = self.grids().next().map_or(0.0, power_of_two);
            let farthest = bounds.extents().into_iter().fold(0.0, f32::max);
            while distance < f64::from(farthest) && probe.limit_at(distance) < limit {
                let mut near = probe.limit_at(distance);
                let mut found = None;
                self.visit(boxes, probe, &mut near, &mut |t, limit: &mut f64| {
                    visit(t, limit);
                    found = Some(*limit);
                });
                if found.is_some_and(|found| found < probe.limit_at(distance)) {
                    return;
                }
                distance *= 3.0;
            }
        }
        self.visit(boxes, probe, &mut limit, &mut visit);
    }

    fn pairs(&self, boxes: &[Aabb], margin: f32, mut visit: impl FnMut(u32, u32)) {
        for (a, aabb) in (0..).zip(boxes) {
            self.search(boxes, &NearBox(*aabb, margin), 0.0, |b, _| {
                if a < b {
                    visit(a, b);
                }
            });
        }
    }

    fn quality(&self) -> f64 {
        1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grid_is_as_wide_as_a_box() {
        let grids = [(1.0, 0), (1.0f32.next_up(), 1), (0.75, 0), (0.5, -1), (3.0, 2), (2.0e-3, -8)];
        for (extent, grid) in grids {
            assert_eq!(exponent(extent), grid, "{extent}");
        }
        for extent in [0.0, -1.0, f32::MIN_POSITIVE / 2.0, f32::MIN_POSITIVE] {
            assert_eq!(exponent(extent), FINEST);
        }
        assert_eq!(exponent(f32::MAX), FINEST + GRIDS as i32 - 1);
        for grid in [FINEST, -3, 0, 7, FINEST + GRIDS as i32 - 1] {
            assert_eq!(power_of_two(grid), f64::from(grid).exp2());
        }
    }

    #[test]
    fn whole_numbers_are_rounded_down() {
        for x in [-2.5, -2.0, -0.1, -0.0, 0.0, 0.9, 1.0, 12_345.6, -12_345.6] {
            assert_eq!(f64::from(floor(x)), x.floor(), "{x}");
        }
        assert_eq!([floor(1e300), floor(-1e300)], [i32::MAX, i32::MIN]);
    }
}

//! The regular lattice of the finest cells, and which leaf of the octree covers each of them.

use nalgebra::Vector3;

/// Integer coordinates of a finest cell or of a lattice point, in sides of a finest cell.
pub type At = [i32; 3];

/// The six directions of links: −x, +x, −y, +y, −z, +z.
pub const DIRECTIONS: [At; 6] = [[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]];

/// The six neighbours of a cell, in the order of [`DIRECTIONS`].
pub(super) fn neighbours(at: At) -> [At; 6] {
    DIRECTIONS.map(|d| [0, 1, 2].map(|k| at[k] + d[k]))
}

/// No leaf: the cell is outside the body.
pub const OUTSIDE: u32 = u32::MAX;

/// Side of a brick of [`LeafMap`], in finest cells, as a power of 2.
const BRICK: u32 = 3;
/// Entries of a brick.
const BRICK_CELLS: usize = 1 << (3 * BRICK);
/// Marks a brick that one leaf covers.
const WHOLE: u32 = 1 << 31;

/// Size of the cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OctreeSettings {
    /// Finest cells along the longest side of the solid.
    pub cells: u32,
    /// The coarsest leaves have sides of 2^levels finest cells.
    pub levels: u8,
}

/// Place and size of the finest cells.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Lattice {
    /// Position of lattice point (0, 0, 0) [m].
    pub origin: Vector3<f64>,
    /// Side of a finest cell [m].
    pub h: f64,
    /// Number of finest cells along each axis, a multiple of 2^levels.
    pub size: [u32; 3],
    /// The coarsest leaves have sides of 2^levels finest cells.
    pub levels: u8,
}

impl Lattice {
    /// Rest position of a lattice point [m].
    pub fn point(&self, at: At) -> Vector3<f64> {
        self.origin + self.h * Vector3::new(f64::from(at[0]), f64::from(at[1]), f64::from(at[2]))
    }

    /// Centre of a finest cell [m].
    pub fn centre(&self, at: At) -> Vector3<f64> {
        self.point(at) + Vector3::repeat(0.5 * self.h)
    }

    /// Position `p` [m] in sides of finest cells from lattice point (0, 0, 0).
    pub fn coordinates(&self, p: &Vector3<f64>) -> Vector3<f64> {
        (p - self.origin) / self.h
    }

    /// Whether a finest cell is in the lattice.
    pub fn holds(&self, at: At) -> bool {
        (0..3).all(|k| (0..self.size[k] as i32).contains(&at[k]))
    }
}

/// The leaf that covers each finest cell, in bricks of 8³.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct LeafMap {
    size: [u32; 3],
    bricks_along: [usize; 3],
    /// Per brick [`OUTSIDE`], the only leaf with [`WHOLE`], or the number of its entries in `leaves`.
    bricks: Vec<u32>,
    #[serde(with = "crate::storage::saved::arrays")]
    leaves: Vec<[u32; BRICK_CELLS]>,
    /// Entries of `leaves` that no brick uses, since one leaf covers it again.
    free: Vec<u32>,
}

impl LeafMap {
    /// A map without leaves.
    pub fn new(size: [u32; 3]) -> Self {
        let bricks_along = size.map(|n| (n as usize).div_ceil(1 << BRICK));
        let bricks = vec![OUTSIDE; bricks_along.iter().product()];
        Self { size, bricks_along, bricks, leaves: Vec::new(), free: Vec::new() }
    }

    /// The leaf that covers the finest cell `at`, or [`OUTSIDE`].
    #[inline]
    pub fn leaf(&self, at: At) -> u32 {
        if (0..3).any(|k| at[k] < 0 || at[k] as u32 >= self.size[k]) {
            return OUTSIDE;
        }
        match self.bricks[self.brick(at)] {
            OUTSIDE => OUTSIDE,
            whole if whole & WHOLE != 0 => whole & !WHOLE,
            brick => self.leaves[brick as usize][entry(at)],
        }
    }

    /// Enters a leaf with its low corner at `at` and sides of 2^level.
    pub fn set(&mut self, at: At, level: u8, leaf: u32) {
        let side = 1 << level;
        if u32::from(level) >= BRICK {
            for_cube(side >> BRICK, |d| {
                let brick = self.brick([0, 1, 2].map(|k| at[k] + (d[k] << BRICK)));
                let known = std::mem::replace(&mut self.bricks[brick], leaf | WHOLE);
                if known & WHOLE == 0 {
                    self.free.push(known);
                }
            });
            return;
        }
        let brick = self.brick(at);
        let known = self.bricks[brick];
        if known & WHOLE != 0 {
            let filled = if known == OUTSIDE { OUTSIDE } else { known & !WHOLE };
            self.bricks[brick] = self.free.pop().unwrap_or(self.leaves.len() as u32);
            let own = self.bricks[brick] as usize;
            self.leaves.resize(self.leaves.len().max(own + 1), [OUTSIDE; BRICK_CELLS]);
            self.leaves[own] = [filled; BRICK_CELLS];
        }
        let leaves = &mut self.leaves[self.bricks[brick] as usize];
        for_cube(side, |d| leaves[entry([0, 1, 2].map(|k| at[k] + d[k]))] = leaf);
    }

    /// Bytes in use.
    pub fn bytes(&self) -> usize {
        self.bricks.len() * 4 + self.leaves.len() * BRICK_CELLS * 4
    }

    fn brick(&self, at: At) -> usize {
        let [i, j, k] = at.map(|c| (c >> BRICK) as usize);
        i + self.bricks_along[0] * (j + self.bricks_along[1] * k)
    }
}

#[inline]
fn entry(at: At) -> usize {
    let [i, j, k] = at.map(|c| (c & ((1 << BRICK) - 1)) as usize);
    i | j << BRICK | k << (2 * BRICK)
}

/// Calls `visit` for every cell of a cube of side `n`.
fn for_cube(n: i32, mut visit: impl FnMut(At)) {
    for k in 0..n {
        for j in 0..n {
            for i in 0..n {
                visit([i, j, k]);
            }
        }
    }
}

/// Number of a cell along Morton's curve, whose coordinates are not negative.
pub fn morton_code(at: At) -> u64 {
    let [x, y, z] = at.map(|c| spread(c as u32));
    x | y << 1 | z << 2
}

/// The lower 21 bits of `x`, two zeros between any two.
fn spread(x: u32) -> u64 {
    let mut x = u64::from(x) & 0x1f_ffff;
    for (shift, mask) in [
        (32, 0x1f_0000_0000_ffff),
        (16, 0x1f_0000_ff00_00ff),
        (8, 0x100f_00f0_0f00_f00f),
        (4, 0x10c3_0c30_c30c_30c3),
        (2, 0x1249_2492_4924_9249),
    ] {
        x = (x | x << shift) & mask;
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn leaves_are_found_where_they_were_set() {
        let mut map = LeafMap::new([32, 16, 16]);
        map.set([16, 0, 0], 4, 7);
        assert_eq!((map.leaf([15, 0, 0]), map.leaf([16, 0, 0]), map.leaf([31, 15, 15])), (OUTSIDE, 7, 7));
        assert_eq!(
            (map.leaf([-1, 0, 0]), map.leaf([32, 0, 0]), map.leaf([0, 16, 0])),
            (OUTSIDE, OUTSIDE, OUTSIDE)
        );
        map.set([16, 0, 0], 1, 8);
        map.set([19, 2, 5], 0, 9);
        assert_eq!([[16, 0, 0], [17, 1, 1], [18, 0, 0], [19, 2, 5]].map(|at| map.leaf(at)), [8, 8, 7, 9]);
        // What a coarse leaf covers again is used for the next brick that is divided.
        let bytes = map.bytes();
        for round in 0..3 {
            map.set([16, 0, 0], 3, 10);
            assert_eq!([[16, 0, 0], [19, 2, 5], [24, 0, 0]].map(|at| map.leaf(at)), [10, 10, 7]);
            map.set([24, 8, 8], 0, 11 + round);
            assert_eq!([[24, 8, 8], [25, 8, 8]].map(|at| map.leaf(at)), [11 + round, 7]);
            map.set([24, 8, 8], 3, 7);
            map.set([16, 0, 0], 0, 12);
        }
        assert_eq!(map.bytes(), bytes);
    }
}

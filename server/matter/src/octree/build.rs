//! Fills a solid with cells: finest ones at its boundary and between materials, coarse ones inside.
//!
//! # Source
//! Dick, Georgii, Westermann 2011, §4.1 and §4.2.

use nalgebra::Vector3;

use super::cells::{Cell, Octree, OctreeError};
use super::lattice::{At, Lattice, LeafMap, OUTSIDE, OctreeSettings, morton_code, neighbours};
use super::link_map::CutLink;
use super::shape::Shape;

/// Largest number of finest cells of the lattice.
const MOST_FINEST: u64 = 1 << 30;

/// Membership of finest cells, one bit each.
#[derive(Clone, Debug)]
pub struct Bits {
    size: [u32; 3],
    words: Vec<u64>,
}

impl Bits {
    /// No member among `size` cells.
    pub fn new(size: [u32; 3]) -> Self {
        let n: u64 = size.iter().map(|&n| u64::from(n)).product();
        Self { size, words: vec![0; n.div_ceil(64) as usize] }
    }

    /// Whether `at` is a member; cells out of range are not.
    #[inline]
    pub fn has(&self, at: At) -> bool {
        self.index(at).is_some_and(|i| self.words[i / 64] >> (i % 64) & 1 == 1)
    }

    /// Makes `at` a member. Returns whether it was none; cells out of range stay none.
    #[inline]
    pub fn insert(&mut self, at: At) -> bool {
        let Some(i) = self.index(at) else { return false };
        let (word, bit) = (&mut self.words[i / 64], 1 << (i % 64));
        let new = *word & bit == 0;
        *word |= bit;
        new
    }

    #[inline]
    fn index(&self, [i, j, k]: At) -> Option<usize> {
        let [nx, ny, nz] = self.size;
        let inside = (i as u32) < nx && (j as u32) < ny && (k as u32) < nz;
        inside.then(|| i as usize + nx as usize * (j as usize + ny as usize * k as usize))
    }

    /// Calls `visit` for every member, in order.
    pub fn for_each(&self, mut visit: impl FnMut(At)) {
        let [nx, ny, _] = self.size.map(|n| n as usize);
        for (w, &word) in self.words.iter().enumerate() {
            let mut left = word;
            while left != 0 {
                let i = w * 64 + left.trailing_zeros() as usize;
                visit([(i % nx) as i32, (i / nx % ny) as i32, (i / (nx * ny)) as i32]);
                left &= left - 1;
            }
        }
    }
}

impl Lattice {
    /// The lattice for a solid between the corners `bounds`.
    pub fn around(bounds: [Vector3<f64>; 2], settings: OctreeSettings) -> Result<Self, OctreeError> {
        let extent = bounds[1] - bounds[0];
        let longest = extent.max();
        if !(longest > 0.0 && extent.iter().chain(bounds[0].iter()).all(|x| x.is_finite())) {
            return Err(OctreeError::Empty);
        }
        if !(1..=4096).contains(&settings.cells) || settings.levels > 8 {
            return Err(OctreeError::Settings(settings));
        }
        let h = longest / f64::from(settings.cells);
        // An extent that is a whole number of cells up to rounding gets no further cell.
        let across = extent.map(|x| ((x / h - 1e-6).ceil().max(1.0)) as u32);
        let root = 1u32 << settings.levels;
        let size = [0, 1, 2].map(|k| across[k].div_ceil(root) * root);
        let finest: u64 = size.iter().map(|&n| u64::from(n)).product();
        if finest > MOST_FINEST {
            return Err(OctreeError::TooMany { finest, limit: MOST_FINEST });
        }
        // Cells lie symmetrically about the middle of the solid.
        let slack = across.zip_map(&extent, |n, x| f64::from(n) * h - x);
        Ok(Self { origin: bounds[0] - 0.5 * slack, h, size, levels: settings.levels })
    }
}

impl Octree {
    /// Fills `shape` with cells. `material` gives the number of the material at the centre of a finest cell.
    ///
    /// # Errors
    /// Settings out of range, a shape without extent, or one so thin that no centre of a cell is inside.
    pub fn fill(
        shape: &dyn Shape,
        settings: OctreeSettings,
        material: &dyn Fn(&Vector3<f64>) -> u16,
    ) -> Result<Self, OctreeError> {
        let lattice = Lattice::around(shape.bounds(), settings)?;
        let mut inside = Bits::new(lattice.size);
        let [nx, ny, nz] = lattice.size.map(|n| n as i32);
        let mut row = vec![false; nx as usize];
        for k in 0..nz {
            for j in 0..ny {
                shape.contains_row(&|i| lattice.centre([i as i32, j, k]), &mut row);
                for (i, _) in (0..nx).zip(&row).filter(|(_, inside)| **inside) {
                    inside.insert([i, j, k]);
                }
            }
        }
        let mut octree = Self::of_cells(lattice, &inside, &|at| material(&lattice.centre(at)))?;
        octree.cross_boundary(shape);
        Ok(octree)
    }

    /// Finds where the links that lead out of the body meet the boundary of `shape`.
    pub fn cross_boundary(&mut self, shape: &dyn Shape) {
        for cell in self.cells.iter().filter(|cell| cell.cut != 0) {
            for (d, outer) in neighbours(cell.at).into_iter().enumerate() {
                if cell.cut >> d & 1 == 0 || self.map.leaf(outer) != OUTSIDE {
                    continue;
                }
                let [a, b] = [cell.at, outer].map(|at| self.lattice.centre(at));
                let Some((fraction, normal)) = shape.crossing(&a, &b) else { continue };
                let up = d % 2 == 1;
                let (lower, along) = if up { (cell.at, fraction) } else { (outer, 1.0 - fraction) };
                let cut = CutLink { at: [along; 2], normal: [normal; 2], incision: 0 };
                self.boundary.insert((lower, (d / 2) as u8), cut);
            }
        }
    }

    /// The octree whose finest cells are those `inside`; `material` gives the number of their material.
    pub fn of_cells(
        lattice: Lattice,
        inside: &Bits,
        material: &dyn Fn(At) -> u16,
    ) -> Result<Self, OctreeError> {
        let mut fine = Bits::new(lattice.size);
        inside.for_each(|at| {
            let own = material(at);
            let alone = |near: &At| !inside.has(*near) || material(*near) != own;
            if lattice.levels > 0 && neighbours(at).iter().any(alone) {
                fine.insert(at);
            }
        });
        let split = split_cells(&lattice, &fine);
        let mut cells = Vec::new();
        let root = 1i32 << lattice.levels;
        // Leaves, and the vertices numbered with them, are near in memory where they are near in the body.
        let [nx, ny, nz] = lattice.size.map(|n| n as i32 / root);
        let all = (0..nx * ny * nz).map(|n| [n % nx, n / nx % ny, n / (nx * ny)]);
        let mut roots: Vec<At> = all.collect();
        roots.sort_by_cached_key(|&at| morton_code(at));
        for at in roots {
            emit(at.map(|c| c * root), lattice.levels, &split, &mut |at, level| {
                // A cell that is not split is inside or outside as a whole.
                if inside.has(at) {
                    cells.push(Cell::new(at, level, material(at)));
                }
            });
        }
        if cells.is_empty() {
            return Err(OctreeError::NoCell { h: lattice.h });
        }
        let mut map = LeafMap::new(lattice.size);
        (0u32..).zip(&cells).for_each(|(id, cell)| map.set(cell.at, cell.level, id));
        Ok(Self::of_leaves(lattice, map, cells))
    }
}

/// By level, the cells to be divided so that those of `fine` become leaves, and leaves that touch, even in a
/// point, differ by one level at most.
fn split_cells(lattice: &Lattice, fine: &Bits) -> Vec<Bits> {
    let size = |level: u8| lattice.size.map(|n| n >> level);
    let mut split = vec![Bits::new(lattice.size)];
    for level in 1..=lattice.levels {
        let mut here = Bits::new(size(level));
        fine.for_each(|at| {
            here.insert(at.map(|c| c >> level));
        });
        if level > 1 {
            split[usize::from(level) - 1].for_each(|at| {
                for_around(at, |near| {
                    // Cells out of range at the finer level are out of range here.
                    if (0..3).all(|k| (0..size(level - 1)[k] as i32).contains(&near[k])) {
                        here.insert(near.map(|c| c >> 1));
                    }
                });
            });
        }
        split.push(here);
    }
    split
}

/// Calls `visit` for a cell and the 26 around it.
pub(super) fn for_around(at: At, mut visit: impl FnMut(At)) {
    for dz in -1..=1 {
        for dy in -1..=1 {
            for dx in -1..=1 {
                visit([at[0] + dx, at[1] + dy, at[2] + dz]);
            }
        }
    }
}

fn emit(at: At, level: u8, split: &[Bits], leaf: &mut impl FnMut(At, u8)) {
    if level == 0 || !split[usize::from(level)].has(at.map(|c| c >> level)) {
        return leaf(at, level);
    }
    for child in 0..8 {
        emit(child_corner(at, level, child), level - 1, split, leaf);
    }
}

/// Low corner of child `child` of a cell with sides of 2^level; bit k of `child` is its half along axis k.
pub(super) fn child_corner(at: At, level: u8, child: usize) -> At {
    let half = 1 << (level - 1);
    [0, 1, 2].map(|k| at[k] + half * (child >> k & 1) as i32)
}

//! How the triangles of a node are divided among its children: in halves, or in the octants of a cell.

use super::aabb::Aabb;

/// Children of a node: how many triangles each has, and its cell.
pub(crate) struct Groups<C> {
    sizes: [usize; 8],
    cells: [C; 8],
    len: usize,
}

impl<C: Copy> Groups<C> {
    fn new(cell: C) -> Self {
        Self { sizes: [0; 8], cells: [cell; 8], len: 0 }
    }

    fn push(&mut self, size: usize, cell: C) {
        (self.sizes[self.len], self.cells[self.len]) = (size, cell);
        self.len += 1;
    }

    /// Number of children.
    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// Size and cell of each child, in the order of the items.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (usize, C)> {
        self.sizes.into_iter().zip(self.cells).take(self.len)
    }
}

/// A rule that divides triangles.
pub(crate) trait Split {
    /// The part of space that belongs to a node.
    type Cell: Copy;

    /// The cell of a root whose triangles have their centres within `bounds`.
    fn cell(bounds: &Aabb) -> Self::Cell;

    /// Sorts at least two `items` into two to eight groups, none of them empty. `deep`: divide evenly, because
    /// the tree has become deep.
    fn split(
        cell: Self::Cell,
        items: &mut [u32],
        centres: &[[f32; 3]],
        boxes: &[Aabb],
        deep: bool,
    ) -> Groups<Self::Cell>;
}

/// Two halves, divided where the surface area heuristic expects the least work.
///
/// # Source
/// Wald, On fast construction of SAH-based bounding volume hierarchies (2007).
#[derive(Debug, Clone, Copy)]
pub(crate) struct Halves;

const BINS: usize = 16;

impl Split for Halves {
    type Cell = ();

    fn cell(_: &Aabb) {}

    fn split(_: (), items: &mut [u32], centres: &[[f32; 3]], boxes: &[Aabb], deep: bool) -> Groups<()> {
        let bounds = items.iter().fold(Aabb::EMPTY, |sum, &t| {
            let c = centres[t as usize];
            sum.merged(&Aabb { min: c, max: c })
        });
        let extents = bounds.extents();
        let axis = (1..3).fold(0, |best, i| if extents[i] > extents[best] { i } else { best });
        let scale = BINS as f32 / extents[axis];
        let left = if deep || !(scale.is_finite() && extents[axis] > 0.0) {
            items.len() / 2
        } else {
            let bin = |t: u32| {
                let along = (centres[t as usize][axis] - bounds.min[axis]) * scale;
                (along as usize).min(BINS - 1)
            };
            let below = best_plane(items, boxes, bin);
            let left = partition(items, |t| bin(t) < below);
            if left == 0 || left == items.len() { items.len() / 2 } else { left }
        };
        let mut groups = Groups::new(());
        groups.push(left, ());
        groups.push(items.len() - left, ());
        groups
    }
}

/// Number of bins on the lower side of the plane with the least expected work.
fn best_plane(items: &[u32], boxes: &[Aabb], bin: impl Fn(u32) -> usize) -> usize {
    let mut bins = [(Aabb::EMPTY, 0usize); BINS];
    for &t in items {
        let (bound, count) = &mut bins[bin(t)];
        *bound = bound.merged(&boxes[t as usize]);
        *count += 1;
    }
    let mut above = [0.0f32; BINS];
    let (mut bound, mut count) = (Aabb::EMPTY, 0);
    for i in (1..BINS).rev() {
        (bound, count) = (bound.merged(&bins[i].0), count + bins[i].1);
        above[i] = bound.half_area() * count as f32;
    }
    let (mut bound, mut count) = (Aabb::EMPTY, 0);
    let (mut best, mut least) = (BINS / 2, f32::INFINITY);
    for i in 1..BINS {
        (bound, count) = (bound.merged(&bins[i - 1].0), count + bins[i - 1].1);
        let work = bound.half_area() * count as f32 + above[i];
        if work < least && count > 0 && count < items.len() {
            (best, least) = (i, work);
        }
    }
    best
}

/// Moves items for which `first` holds to the front and returns their number.
fn partition(items: &mut [u32], first: impl Fn(u32) -> bool) -> usize {
    let (mut low, mut high) = (0, items.len());
    while low < high {
        if first(items[low]) {
            low += 1;
        } else {
            high -= 1;
            items.swap(low, high);
        }
    }
    low
}

/// The octants of a cube. A triangle belongs to the octant of its centre.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Octants;

/// A cube: its middle and half its edge [m].
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cube {
    middle: [f32; 3],
    half: f32,
}

impl Cube {
    fn octant(&self, p: [f32; 3]) -> usize {
        (0..3).map(|i| usize::from(p[i] > self.middle[i]) << i).sum()
    }

    fn child(&self, octant: usize) -> Self {
        let half = 0.5 * self.half;
        let towards = |i: usize| if octant >> i & 1 == 1 { half } else { -half };
        Self { middle: [0, 1, 2].map(|i| self.middle[i] + towards(i)), half }
    }
}

/// Most times that a cube is halved in search of octants that divide the triangles.
const MAX_HALVINGS: usize = 24;

impl Split for Octants {
    type Cell = Cube;

    fn cell(bounds: &Aabb) -> Cube {
        let half = bounds.extents().into_iter().fold(0.0, f32::max) * 0.5;
        Cube { middle: bounds.centre(), half }
    }

    fn split(cell: Cube, items: &mut [u32], centres: &[[f32; 3]], _: &[Aabb], deep: bool) -> Groups<Cube> {
        let mut cell = cell;
        let mut groups = Groups::new(cell);
        let centre = |t: u32| centres[t as usize];
        for _ in 0..if deep { 0 } else { MAX_HALVINGS } {
            let octant = cell.octant(centre(items[0]));
            if items.iter().all(|&t| cell.octant(centre(t)) == octant) {
                cell = cell.child(octant);
                continue;
            }
            let mut begin = 0;
            for octant in 0..8 {
                let size = partition(&mut items[begin..], |t| cell.octant(centre(t)) == octant);
                if size > 0 {
                    groups.push(size, cell.child(octant));
                }
                begin += size;
            }
            return groups;
        }
        // All centres are in one place: any division will do.
        groups.push(items.len() / 2, cell);
        groups.push(items.len() - items.len() / 2, cell);
        groups
    }
}

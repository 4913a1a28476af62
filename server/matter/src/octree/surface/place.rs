//! Places the vertex of a patch where the planes of its cuts meet, and binds it to the nearest of its cells.

use nalgebra::{Matrix3, Vector3};

use super::super::cells::Octree;
use super::super::lattice::{At, DIRECTIONS};
use crate::element::MaterialPoint;

/// Eigenvalues of the normals' Σ n nᵀ below this part of the largest count as zero: planes that meet at less than
/// about 25° are one smooth surface.
const SMOOTH: f64 = 0.05;
/// Planes that all pass this close to a point meet in it, in sides of finest cells.
const AGREE: f64 = 0.02;
/// Where planes meet, the vertex may be this far from the lattice point along every axis: beyond the dual cell by
/// half the side of a cell.
const REACH: f64 = 1.0;
/// Sweeps of the search for the best place within the dual cell.
const SWEEPS: usize = 20;

/// Where a link is cut on one of its sides.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Crossing {
    /// Distance from the centre of the cell, in sides of finest cells.
    pub distance: f64,
    /// Unit normal.
    pub normal: Vector3<f64>,
}

/// A vertex of the surface at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Placed {
    /// Position at rest [m].
    pub at: Vector3<f64>,
    /// The same place in the material.
    pub point: MaterialPoint,
}

impl Crossing {
    /// The cut of `face` (6·leaf + direction), and its incision. Halfway and across the link if nothing is known
    /// of it.
    pub(super) fn of(octree: &Octree, face: u32) -> (Self, u32) {
        let (cell, d) = (&octree.cells()[face as usize / 6], face as usize % 6);
        let (axis, up) = (d / 2, d % 2 == 1);
        let mut lower = cell.at;
        lower[axis] -= i32::from(!up);
        let key = (lower, axis as u8);
        let half = Self { distance: 0.5, normal: Vector3::from(DIRECTIONS[d].map(f64::from)) };
        let Some(cut) = octree.links.get(&key).or_else(|| octree.boundary.get(&key)) else {
            return (half, 0);
        };
        let (distance, normal) =
            if up { (cut.at[0], cut.normal[0]) } else { (1.0 - cut.at[1], cut.normal[1]) };
        (Self { distance: distance.clamp(0.0, 1.0), normal }, cut.incision)
    }
}

/// The vertex of a patch in the dual cell around lattice point `p`. `faces` (6·leaf + direction) ascend.
pub(super) fn place(octree: &Octree, p: At, faces: &[u32], crossing: impl Fn(u32) -> Crossing) -> Placed {
    let centre = |leaf: u32| {
        let at = octree.cells()[leaf as usize].at;
        Vector3::from([0, 1, 2].map(|k| f64::from(at[k] - p[k]) + 0.5))
    };
    let planes = |face: &u32| {
        let cut = crossing(*face);
        let out = Vector3::from(DIRECTIONS[*face as usize % 6].map(f64::from));
        (centre(face / 6) + cut.distance * out, cut.normal)
    };
    let x = meet(faces.iter().map(planes));
    // Nearest cell; of several at the same distance the first.
    let mut nearest = (f64::INFINITY, 0);
    for leaf in faces.iter().map(|face| face / 6) {
        let distance = (x - centre(leaf)).norm_squared();
        if distance < nearest.0 {
            nearest = (distance, leaf);
        }
    }
    bind(octree, nearest.1, octree.lattice().point(p) + octree.lattice().h * x)
}

/// Binds the point `at` [m] to a leaf.
pub(super) fn bind(octree: &Octree, leaf: u32, at: Vector3<f64>) -> Placed {
    let cell = &octree.cells()[leaf as usize];
    let local = octree.lattice().coordinates(&at);
    let xi = [0, 1, 2].map(|k| (local[k] - f64::from(cell.at[k])) / f64::from(cell.side()));
    Placed { at, point: octree.point_in(leaf, xi) }
}

/// The point nearest to planes through these points with these unit normals, in the least-squares sense, near the
/// cube of side 1 around 0. In directions that the planes leave free it keeps the mean of their points.
fn meet(planes: impl Iterator<Item = (Vector3<f64>, Vector3<f64>)> + Clone) -> Vector3<f64> {
    let (sum, n) = planes.clone().fold((Vector3::zeros(), 0.0), |(sum, n), (p, _)| (sum + p, n + 1.0));
    let mean = sum / n;
    let (mut A, mut b) = (Matrix3::zeros(), Vector3::zeros());
    for (p, normal) in planes.clone() {
        A += normal * normal.transpose();
        b += normal * normal.dot(&(p - mean));
    }
    let x = mean + solve(A, b);
    // An edge may pass outside the dual cell, if no link there tells of it.
    let agree = |reach: f64| x.amax() <= reach && planes.clone().all(|(p, n)| n.dot(&(x - p)).abs() < AGREE);
    if x.amax() <= 0.5 || agree(REACH) { x } else { within(x, mean, A, b) }
}

/// The shortest solution of A y = b with A = Σ n nᵀ, for the eigenvalues of A that are not small.
fn solve(A: Matrix3<f64>, b: Vector3<f64>) -> Vector3<f64> {
    let eigen = A.symmetric_eigen();
    let least = SMOOTH * eigen.eigenvalues.max();
    let mut y = Vector3::zeros();
    for (v, &value) in eigen.eigenvectors.column_iter().zip(eigen.eigenvalues.iter()) {
        if value > least {
            y += v * (v.dot(&b) / value);
        }
    }
    y
}

/// Minimises (x − mean)ᵀA(x − mean)/2 − b·(x − mean) in the cube by cyclic coordinate descent from `x`.
fn within(x: Vector3<f64>, mean: Vector3<f64>, A: Matrix3<f64>, b: Vector3<f64>) -> Vector3<f64> {
    let inside = |c: f64| if c.is_nan() { 0.0 } else { c.clamp(-0.5, 0.5) };
    let mut x = x.map(inside);
    for _ in 0..SWEEPS {
        for k in 0..3 {
            if A[(k, k)] > SMOOTH {
                x[k] = inside(x[k] + (b[k] - A.row(k).transpose().dot(&(x - mean))) / A[(k, k)]);
            }
        }
    }
    x
}

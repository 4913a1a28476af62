//! Stiff springs in the smoother and in the operator of a level.
//!
//! # Derivation
//! Springs add S = U Uᵀ to the operator A of a level, where each column of U is √k F J n of one spring and direction,
//! and F leaves out prescribed directions. The Galerkin product of the next level is PᵀS P = (PᵀU)(PᵀU)ᵀ.
//!
//! Block-Jacobi would see of S only the diagonal blocks. It then hardly moves the vertices of a stiff spring against
//! each other, and its largest eigenvalue grows to the number of these vertices. So the smoother takes D + S instead,
//! with D the diagonal blocks of A alone. From A ≤ λ D with λ ≥ 1 follows A + S ≤ λ (D + S): springs of any stiffness
//! leave λ as it is. The inverse is that of Sherman, Morrison and Woodbury,
//! (D + U Uᵀ)⁻¹ = D⁻¹ − D⁻¹U (1 + UᵀD⁻¹U)⁻¹ UᵀD⁻¹, in double precision.

use nalgebra::{Matrix3, Vector3};

use super::transfer::Transfer;
use crate::operator::{Inverse3, Padded, Spring};

/// The columns of U, each as vertices and their weights.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Columns {
    /// Where each column ends.
    ends: Vec<usize>,
    entries: Vec<(u32, [f64; 3])>,
}

impl Columns {
    /// Forgets all columns.
    pub(super) fn clear(&mut self) {
        self.ends.clear();
        self.entries.clear();
    }

    /// Becomes a copy of `other` in the memory that it has.
    pub(super) fn copy_from(&mut self, other: &Self) {
        self.ends.clone_from(&other.ends);
        self.entries.clone_from(&other.entries);
    }

    /// Number of columns.
    pub(super) fn len(&self) -> usize {
        self.ends.len()
    }

    /// Whether there are none.
    pub(super) fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    fn first(&self, j: usize) -> usize {
        j.checked_sub(1).map_or(0, |before| self.ends[before])
    }

    /// Column `j`.
    pub(super) fn get(&self, j: usize) -> &[(u32, [f64; 3])] {
        &self.entries[self.first(j)..self.ends[j]]
    }

    /// All columns.
    pub(super) fn iter(&self) -> impl Iterator<Item = &[(u32, [f64; 3])]> {
        (0..self.len()).map(|j| self.get(j))
    }

    /// The columns of `springs`; `free` leaves out the prescribed directions of a vertex.
    pub(super) fn set(&mut self, springs: &[Spring], free: impl Fn(u32, [f64; 3]) -> [f64; 3]) {
        self.clear();
        for spring in springs {
            let directions = match spring.direction {
                Some(n) => [Some(n.map(f64::from)), None, None],
                None => [0, 1, 2].map(|k| Some([0, 1, 2].map(|i| f64::from(u8::from(i == k))))),
            };
            let root = f64::from(spring.stiffness).sqrt();
            for n in directions.into_iter().flatten() {
                let first = self.entries.len();
                for (copy, w) in spring.point.carriers().filter(|(_, w)| *w != 0.0) {
                    self.add(first, copy as u32, free(copy as u32, n.map(|n| root * f64::from(w) * n)));
                }
                self.ends.push(self.entries.len());
            }
        }
    }

    /// PᵀU of the columns of the next finer level. `inner` calls a function with the coarse vertices and the blocks of
    /// P of a fine vertex that come to its trilinear weights.
    pub(super) fn restrict(
        &mut self,
        fine: &Self,
        P: &Transfer,
        inner: impl Fn(u32, &mut dyn FnMut(u32, Matrix3<f32>)),
    ) {
        self.clear();
        for j in 0..fine.len() {
            let first = self.entries.len();
            for (v, u) in fine.get(j) {
                for (coarse, p) in P.row(*v as usize) {
                    self.add(first, coarse, u.map(|u| f64::from(p) * u));
                }
                inner(*v, &mut |coarse, D| {
                    let u = D.map(f64::from).tr_mul(&Vector3::from(*u));
                    self.add(first, coarse, u.into());
                });
            }
            self.ends.push(self.entries.len());
        }
    }

    /// Adds `weight` at vertex `v` to the column whose entries begin at `first`.
    fn add(&mut self, first: usize, v: u32, weight: [f64; 3]) {
        match self.entries[first..].iter_mut().find(|e| e.0 == v) {
            Some((_, known)) => known.iter_mut().zip(weight).for_each(|(known, w)| *known += w),
            None => self.entries.push((v, weight)),
        }
    }

    /// Writes the vertices of all columns, ascending and each once.
    fn list_vertices(&self, out: &mut Vec<u32>) {
        out.clear();
        out.extend(self.entries.iter().map(|e| e.0));
        out.sort_unstable();
        out.dedup();
    }

    /// y += U Uᵀx.
    pub(super) fn add_to(&self, x: &[Padded], y: &mut [Padded]) {
        for j in 0..self.len() {
            let column = self.get(j);
            let along: f64 = column.iter().map(|(v, u)| dot(u, &wide(&x[*v as usize]))).sum();
            for (v, u) in column {
                (0..3).for_each(|k| y[*v as usize][k] += (along * u[k]) as f32);
            }
        }
    }
}

/// (D + S)⁻¹ on the vertices of the springs of a level.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct SpringBlocks {
    /// Ascending.
    vertices: Vec<u32>,
    /// D⁻¹ there.
    inverse: Vec<Inverse3>,
    capacitance: Capacitance,
    /// One entry per vertex.
    y: Vec<[f64; 3]>,
}

/// Springs of a level: U and (D + U Uᵀ)⁻¹.
#[derive(Debug)]
pub(super) struct Sprung<'a> {
    pub columns: &'a Columns,
    pub blocks: &'a mut SpringBlocks,
}

impl SpringBlocks {
    /// Prepares (D + U Uᵀ)⁻¹; `inverse` gives D⁻¹ of a vertex. Returns whether it exists.
    pub(super) fn prepare(&mut self, columns: &Columns, inverse: impl Fn(u32) -> Inverse3) -> bool {
        columns.list_vertices(&mut self.vertices);
        self.inverse.clear();
        self.inverse.extend(self.vertices.iter().map(|&v| inverse(v)));
        self.y.resize(self.vertices.len(), [0.0; 3]);
        let Self { vertices, inverse, capacitance, .. } = self;
        capacitance.set(columns, |v, u| times(&inverse[place(vertices, v)], u))
    }

    /// Calls `visit` with every vertex of the springs and the difference of (D + S)⁻¹r to `M` r there.
    pub(super) fn correct(
        &mut self,
        columns: &Columns,
        (M, r): (&[Inverse3], &[Padded]),
        mut visit: impl FnMut(usize, Padded),
    ) {
        let Self { vertices, inverse, capacitance, y } = self;
        for ((y, D), &v) in y.iter_mut().zip(&*inverse).zip(&*vertices) {
            *y = times(D, &wide(&r[v as usize]));
        }
        let t = capacitance.solve(columns, |v| y[place(vertices, v)]);
        for (j, t) in t.iter().enumerate() {
            for (v, u) in columns.get(j) {
                let at = place(vertices, *v);
                let Du = times(&inverse[at], u);
                (0..3).for_each(|k| y[at][k] -= t * Du[k]);
            }
        }
        for (y, &v) in y.iter().zip(&*vertices) {
            let v = v as usize;
            let jacobi = M[v].times(&r[v]);
            visit(v, [0, 1, 2, 3].map(|k| if k < 3 { (y[k] - f64::from(jacobi[k])) as f32 } else { 0.0 }));
        }
    }
}

/// The Cholesky factor of 1 + UᵀD⁻¹U.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
struct Capacitance {
    /// Number of columns.
    n: usize,
    /// The lower triangle, row by row.
    L: Vec<f64>,
    t: Vec<f64>,
}

impl Capacitance {
    /// Factorises for these columns. `product` gives D⁻¹ w of a vertex and a vector w. Returns whether the matrix is
    /// positive definite and finite.
    fn set(&mut self, columns: &Columns, product: impl Fn(u32, &[f64; 3]) -> [f64; 3]) -> bool {
        let n = columns.len();
        self.n = n;
        self.L.resize(n * n, 0.0);
        self.t.resize(n, 0.0);
        let L = &mut self.L;
        for j in 0..n {
            for i in j..n {
                L[i * n + j] = f64::from(u8::from(i == j));
            }
            for (v, u) in columns.get(j) {
                let Du = product(*v, u);
                for i in j..n {
                    let shared = columns.get(i).iter().find(|(other, _)| other == v);
                    L[i * n + j] += shared.map_or(0.0, |(_, w)| dot(w, &Du));
                }
            }
        }
        for j in 0..n {
            for i in j..n {
                let (row_i, row_j) = (i * n, j * n);
                let sum = L[row_i + j] - (0..j).map(|k| L[row_i + k] * L[row_j + k]).sum::<f64>();
                if i > j {
                    L[row_i + j] = sum / L[row_j + j];
                } else if sum > 0.0 && sum.is_finite() {
                    L[row_j + j] = sum.sqrt();
                } else {
                    return false;
                }
            }
        }
        true
    }

    /// (1 + UᵀD⁻¹U)⁻¹ Uᵀy of a vector by vertex.
    fn solve(&mut self, columns: &Columns, y: impl Fn(u32) -> [f64; 3]) -> &[f64] {
        let Self { n, L, t } = self;
        for (j, t) in t.iter_mut().enumerate() {
            *t = columns.get(j).iter().map(|(v, u)| dot(u, &y(*v))).sum();
        }
        for i in 0..*n {
            let known: f64 = (0..i).map(|k| L[i * *n + k] * t[k]).sum();
            t[i] = (t[i] - known) / L[i * *n + i];
        }
        for i in (0..*n).rev() {
            let known: f64 = (i + 1..*n).map(|k| L[k * *n + i] * t[k]).sum();
            t[i] = (t[i] - known) / L[i * *n + i];
        }
        t
    }
}

/// Where `v` is in an ascending list that has it.
fn place(vertices: &[u32], v: u32) -> usize {
    vertices.partition_point(|&known| known < v)
}

fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn wide(x: &Padded) -> [f64; 3] {
    [0, 1, 2].map(|k| f64::from(x[k]))
}

/// D⁻¹ u.
fn times(inverse: &Inverse3, u: &[f64; 3]) -> [f64; 3] {
    let columns = inverse.columns();
    [0, 1, 2].map(|i| (0..3).map(|j| f64::from(columns[j][i]) * u[j]).sum())
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use scindo_matter::element::MaterialPoint;

    fn spring(first: u32, direction: Option<[f32; 3]>, stiffness: f32) -> Spring {
        let weights = [0.3, 0.2, 0.4, 0.1_f32];
        let point = MaterialPoint::new((first..).zip(weights));
        Spring { point, direction, stiffness }
    }

    /// (D + S) times what the smoother makes of r is r.
    #[test]
    fn the_inverse_is_that_of_blocks_and_springs() {
        let held = |v: u32, w: [f64; 3]| if v == 2 { [0.0, w[1], w[2]] } else { w };
        let springs = [
            spring(0, Some([0.6, 0.0, 0.8]), 2e3),
            spring(2, None, 1e4),
            spring(1, Some([0.0, 1.0, 0.0]), 0.5),
        ];
        let mut columns = Columns::default();
        columns.set(&springs, held);
        assert_eq!(columns.len(), 5);
        // D = diag(2, 4, 8), D⁻¹ with 0 in the direction that is held.
        let inverse = |v: u32| {
            let x = if v == 2 { 0.0 } else { 0.5 };
            Inverse3([[x, 0.0, 0.25, 0.0], [0.0, 0.0, 0.125, 0.0]])
        };
        let mut blocks = SpringBlocks::default();
        assert!(blocks.prepare(&columns, inverse));
        let r: Vec<Padded> = (0..6).map(|v| [v as f32 - 1.0, 2.0, 0.5 * v as f32, 0.0]).collect();
        let r: Vec<Padded> =
            r.iter().enumerate().map(|(v, r)| if v == 2 { [0.0, r[1], r[2], 0.0] } else { *r }).collect();
        let M: Vec<Inverse3> = (0..6).map(inverse).collect();
        let mut z: Vec<Padded> = M.iter().zip(&r).map(|(M, r)| M.times(r)).collect();
        blocks.correct(&columns, (&M, &r), |v, change| (0..4).for_each(|k| z[v][k] += change[k]));
        let mut product: Vec<Padded> = z.iter().map(|z| [2.0 * z[0], 4.0 * z[1], 8.0 * z[2], 0.0]).collect();
        columns.add_to(&z, &mut product);
        for (product, r) in product.iter().zip(&r) {
            assert!((0..3).all(|k| (product[k] - r[k]).abs() < 5e-3), "{product:?} instead of {r:?}");
        }
    }
}

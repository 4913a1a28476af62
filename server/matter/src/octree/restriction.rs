//! Carries motion from the vertices before a coarsening to those after it.
//!
//! Positions are sampled: the vertices that stay keep theirs, so the field changes in the joined leaves only.
//! Velocities are projected: those of the vertices around joined leaves minimise Σ m |P v − v₀|² over the vertices
//! before, where P interpolates the ones that vanished. The masses after are Pᵀ m, so the projection keeps
//! momentum. A field that coarse cells can represent stays. The moment of momentum changes a little, because masses
//! are lumped: a coarse cell has its mass farther out.
//!
//! # Source
//! Farrell, Piggott, Pain, Gorman, Wilson 2009: Conservative interpolation between unstructured meshes via supermesh
//! construction, §2 (Galerkin projection); here the meshes are nested and masses are lumped.

use nalgebra::Vector3;

use super::coarsen::Coarsening;
use crate::element::FixedCopy;
use crate::storage::disjoint::{find, join};

/// The solver stops at this part of its first right-hand side.
const TOLERANCE: f64 = 1e-15;
/// The matrix is as well conditioned as a mass matrix: this many iterations are never needed.
const MOST_ITERATIONS: usize = 200;

/// A vertex that vanished.
#[derive(Clone, Copy, Debug)]
struct Row {
    /// Its number before.
    vertex: u32,
    mass: f64,
    /// Entries of the unknowns that carry it, and their weights.
    carriers: [(u32, f64); 8],
    n: usize,
}

impl Row {
    fn carriers(&self) -> &[(u32, f64)] {
        &self.carriers[..self.n]
    }
}

/// The projection of one coarsening, for any number of fields.
#[derive(Clone, Debug)]
pub struct Restriction<'a> {
    change: &'a Coarsening,
    rows: Vec<Row>,
    /// Vertices that carry vanished ones, by their numbers before.
    unknowns: Vec<u32>,
    /// Mass of each before [kg].
    mass: Vec<f64>,
    /// Mass of each after [kg].
    mass_after: Vec<f64>,
    /// Diagonal of the matrix [kg].
    diagonal: Vec<f64>,
    /// Directions in which each is held; its velocity there stays.
    held: Vec<[bool; 3]>,
    /// Unknowns that belong together have one representative.
    cluster: Vec<u32>,
}

impl<'a> Restriction<'a> {
    /// The projection for `change`. `mass` [kg] and `fixed` are those of the vertices before it.
    pub fn new(change: &'a Coarsening, mass: &[f64], fixed: &[FixedCopy]) -> Self {
        let mut before = vec![0; change.vertex_of.len() - change.vanished.len()];
        for (old, &new) in (0u32..).zip(&change.vertex_of) {
            if let Some(before) = before.get_mut(new as usize) {
                *before = old;
            }
        }
        let carriers = change.vanished.iter().flat_map(|(_, point)| point.copies());
        let mut unknowns: Vec<u32> = carriers.map(|&new| before[new as usize]).collect();
        unknowns.sort_unstable();
        unknowns.dedup();
        let entry = |new: usize| unknowns.binary_search(&before[new]).unwrap_or(0) as u32;
        let mass_before: Vec<f64> = unknowns.iter().map(|&v| mass[v as usize]).collect();
        let (mut mass_after, mut diagonal) = (mass_before.clone(), mass_before.clone());
        let mut cluster: Vec<u32> = (0..unknowns.len() as u32).collect();
        let mut rows = Vec::with_capacity(change.vanished.len());
        for (vertex, point) in &change.vanished {
            let (vertex, mass) = (*vertex, mass[*vertex as usize]);
            let mut row = Row { vertex, mass, carriers: [(0, 0.0); 8], n: 0 };
            for (new, w) in point.carriers() {
                let at = entry(new);
                row.carriers[row.n] = (at, w);
                row.n += 1;
                mass_after[at as usize] += w * mass;
                diagonal[at as usize] += w * w * mass;
                join(&mut cluster, row.carriers[0].0, at);
            }
            rows.push(row);
        }
        let cluster = (0..unknowns.len() as u32).map(|at| find(&mut cluster, at)).collect();
        let mut held = vec![[false; 3]; unknowns.len()];
        for fixed in fixed {
            if let Ok(at) = unknowns.binary_search(&fixed.copy) {
                // A velocity in an inclined plane stays as it is.
                held[at] = fixed.held.axes().unwrap_or([true; 3]);
            }
        }
        Self { change, rows, unknowns, mass: mass_before, mass_after, diagonal, held, cluster }
    }

    /// What coarsening did to cells and vertices.
    pub fn change(&self) -> &Coarsening {
        self.change
    }

    /// Samples a field, e.g. positions [m].
    pub fn sample(&self, values: &mut Vec<Vector3<f64>>) {
        self.change.keep(values);
    }

    /// Projects a field, e.g. velocities [m/s].
    pub fn project(&self, values: &mut Vec<Vector3<f64>>) {
        for axis in 0..3 {
            let projected = self.solve(axis, values);
            for (&vertex, y) in self.unknowns.iter().zip(projected) {
                values[vertex as usize][axis] = y;
            }
        }
        self.change.keep(values);
    }

    /// The projected component of the field at the unknowns.
    fn solve(&self, axis: usize, values: &[Vector3<f64>]) -> Vec<f64> {
        let free = |at: usize| !self.held[at][axis];
        let mut y: Vec<f64> = self.unknowns.iter().map(|&v| values[v as usize][axis]).collect();
        // The residual of the values before is that of the vertices that vanish, which have to be caught.
        let mut r = vec![0.0; y.len()];
        let mut size = 0.0;
        for row in &self.rows {
            let own = values[row.vertex as usize][axis];
            let at = |y: &[f64]| row.carriers().iter().map(|&(at, w)| w * y[at as usize]).sum::<f64>();
            let missing = own - at(&y);
            row.carriers().iter().for_each(|&(at, w)| r[at as usize] += w * row.mass * missing);
            size += row.mass * own * own;
        }
        size += self.mass.iter().zip(&y).map(|(m, y)| m * y * y).sum::<f64>();
        self.conjugate_gradients((&mut y, &mut r), size, &free);
        self.give_back((axis, values), &mut y, &free);
        y
    }

    /// Solves (M + Σ m w wᵀ) δ = r for the free unknowns and adds δ to `y`, by conjugate gradients with the
    /// diagonal as preconditioner.
    fn conjugate_gradients(
        &self,
        (y, r): (&mut [f64], &mut [f64]),
        size: f64,
        free: &impl Fn(usize) -> bool,
    ) {
        let n = y.len();
        let mask = |r: &mut [f64]| (0..n).filter(|&at| !free(at)).for_each(|at| r[at] = 0.0);
        mask(r);
        let norm = |r: &[f64]| r.iter().zip(&self.diagonal).map(|(r, d)| r * r / d).sum::<f64>();
        let mut p: Vec<f64> = r.iter().zip(&self.diagonal).map(|(r, d)| r / d).collect();
        let mut rho = norm(r);
        let mut q = vec![0.0; n];
        for _ in 0..MOST_ITERATIONS {
            // Not finite or done.
            if rho.is_nan() || rho <= TOLERANCE * TOLERANCE * size {
                break;
            }
            q.iter_mut().zip(&self.mass).zip(&p).for_each(|((q, m), p)| *q = m * p);
            for row in &self.rows {
                let at: f64 = row.carriers().iter().map(|&(at, w)| w * p[at as usize]).sum();
                row.carriers().iter().for_each(|&(c, w)| q[c as usize] += w * row.mass * at);
            }
            mask(&mut q);
            let alpha = rho / p.iter().zip(&q).map(|(p, q)| p * q).sum::<f64>();
            for at in 0..n {
                y[at] += alpha * p[at];
                r[at] -= alpha * q[at];
            }
            let next = norm(r);
            let beta = next / rho;
            rho = next;
            for at in 0..n {
                p[at] = r[at] / self.diagonal[at] + beta * p[at];
            }
        }
    }

    /// Gives the free unknowns of every cluster the momentum that held ones and rounding cost it.
    fn give_back(
        &self,
        (axis, values): (usize, &[Vector3<f64>]),
        y: &mut [f64],
        free: &impl Fn(usize) -> bool,
    ) {
        let mut missing = vec![0.0; y.len()];
        let mut mass = vec![0.0; y.len()];
        for row in &self.rows {
            let of = self.cluster[row.carriers[0].0 as usize] as usize;
            missing[of] += row.mass * values[row.vertex as usize][axis];
        }
        for at in 0..y.len() {
            let of = self.cluster[at] as usize;
            let before = values[self.unknowns[at] as usize][axis];
            missing[of] += self.mass[at] * before - self.mass_after[at] * y[at];
            mass[of] += if free(at) { self.mass_after[at] } else { 0.0 };
        }
        for at in (0..y.len()).filter(|&at| free(at)) {
            let of = self.cluster[at] as usize;
            if mass[of] > 0.0 {
                y[at] += missing[of] / mass[of];
            }
        }
    }
}

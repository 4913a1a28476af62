//! Estimates the discretisation error of cubical cells by stress recovery.
//!
//! The stress of a trilinear cell is most accurate as its mean. Means are averaged to the vertices, weighted by
//! volume, and interpolated by the cell, also at hanging corners: η_e² = ∫_e (σ* − σ_h) : C⁻¹ : (σ* − σ_h).
//! Cells on the two sides of a cut have vertices of their own, so averages never reach across it.
//!
//! # Source
//! As for [`StressRecovery`](super::StressRecovery); for hexahedra and corotation Bui, Tomar, Courtecuisse, Cotin,
//! Bordas 2018.

use nalgebra::{Matrix3, Vector3};
use scindo_matter::element::{Points, quadrature};
use scindo_matter::material::Material;
use scindo_matter::octree::{Octree, corner_weights};

use super::stress_recovery::{MeshError, cauchy, complementary};

/// Recovers stress from cells. It reuses its memory from call to call.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct CellRecovery {
    /// Mean stress [Pa] of every cell and its present volume [m³].
    mean: Vec<(Matrix3<f64>, f64)>,
    recovered: Vec<Matrix3<f64>>,
    weight: Vec<f64>,
    eta: Vec<f64>,
    flat: Vec<bool>,
}

impl CellRecovery {
    /// Estimates the error of the cells with vertices at `x` [m] in a body of `material`. Cells that are flat or
    /// inverted at a quadrature point are left out.
    pub fn estimate(&mut self, octree: &Octree, x: &[Vector3<f64>], material: &Material) -> MeshError {
        let (n, law) = (octree.cells().len(), material.law);
        self.mean.clear();
        self.mean.resize(n, (Matrix3::zeros(), 0.0));
        self.flat.clear();
        self.flat.resize(n, false);
        self.recovered.clear();
        self.recovered.resize(octree.n_vertices(), Matrix3::zeros());
        self.weight.clear();
        self.weight.resize(octree.n_vertices(), 0.0);
        self.eta.clear();
        self.eta.resize(n, 0.0);
        octree.for_points(x, &mut |point| {
            let lame = octree.lame(point.region, material);
            let (stress, volume) = cauchy(&point.F, point.weight, law, lame);
            let (mean, sum) = &mut self.mean[point.element];
            *mean += volume * stress;
            *sum += volume;
            self.flat[point.element] |= volume == 0.0;
        });
        for (id, (mean, volume)) in self.mean.iter_mut().enumerate().filter(|(id, _)| !self.flat[*id]) {
            *mean /= *volume;
            let share = *volume / octree.cell_volume(id);
            for (&v, N) in octree.vertices()[id].iter().zip(octree.shape_integrals(id)) {
                self.recovered[v as usize] += share * N * *mean;
                self.weight[v as usize] += share * N;
            }
        }
        for (stress, &weight) in self.recovered.iter_mut().zip(&self.weight) {
            if weight > 0.0 {
                *stress /= weight;
            }
        }
        self.compare(octree, x, material)
    }

    /// η_e of every cell from the recovered stress, and the sums.
    fn compare(&mut self, octree: &Octree, x: &[Vector3<f64>], material: &Material) -> MeshError {
        // Shape functions of the corners at the points, which come in the same order in every cell.
        let rule = quadrature::cube_gauss(2);
        let shapes: Vec<[f64; 8]> = rule
            .iter()
            .map(|(xi, _)| {
                let side = |c: usize, k: usize| if c >> k & 1 == 1 { 1.0 + xi[k] } else { 1.0 - xi[k] };
                std::array::from_fn(|c| (0..3).map(|k| 0.5 * side(c, k)).product())
            })
            .collect();
        let (mut q, mut last) = (0, usize::MAX);
        let mut corners = [Matrix3::zeros(); 8];
        let (mut error, mut energy) = (MeshError::default(), 0.0);
        let Self { recovered, flat, eta, .. } = self;
        octree.for_points(x, &mut |point| {
            let e = point.element;
            if std::mem::replace(&mut last, e) != e {
                q = 0;
                let W = corner_weights(&octree.cells()[e], octree.hanging()[e]);
                let at = |v: u32| recovered[v as usize];
                corners = W.map(|row| point.nodes.iter().zip(row).map(|(&v, w)| at(v) * w).sum());
            }
            let N = shapes[q];
            q += 1;
            if flat[e] {
                return;
            }
            let lame = octree.lame(point.region, material);
            let (stress, volume) = cauchy(&point.F, point.weight, material.law, lame);
            let better: Matrix3<f64> = corners.iter().zip(N).map(|(corner, N)| corner * N).sum();
            eta[e] += volume * complementary(&(better - stress), lame);
            energy += volume * complementary(&stress, lame);
        });
        let sum: f64 = eta.iter().sum();
        eta.iter_mut().for_each(|eta| *eta = eta.sqrt());
        error.eta = sum.sqrt();
        error.energy_norm = energy.sqrt();
        let whole = (sum + energy).sqrt();
        error.relative = if whole > 0.0 { error.eta / whole } else { 0.0 };
        error.left_out = flat.iter().filter(|flat| **flat).count();
        error
    }

    /// η_e [√J] of every cell, of the last estimate.
    pub fn eta(&self) -> &[f64] {
        &self.eta
    }

    /// Stress σ* [Pa] of every vertex, of the last estimate.
    pub fn recovered(&self) -> &[Matrix3<f64>] {
        &self.recovered
    }
}

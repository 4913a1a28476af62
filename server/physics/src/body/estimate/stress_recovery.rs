//! Estimates the discretisation error by stress recovery.
//!
//! A linear tetrahedron has constant stress. The stress σ*, averaged to the copies and interpolated linearly,
//! is more accurate than σ_h itself. Their difference estimates the error: η_e² = ∫_e (σ* − σ_h) : C⁻¹ : (σ*
//! − σ_h). Averages belong to *copies*, so they never reach across a cut. Where regions of different materials
//! meet, each has its own, because stress jumps there.
//!
//! # Source
//! Zienkiewicz, Zhu 1987, *A simple error estimator and adaptive procedure*; on deforming tissue:
//! Bui, Tomar, Courtecuisse, Cotin, Bordas 2018.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};
use scindo_matter::material::{Lame, Law};

use super::tets::Tets;

/// Estimate of the discretisation error.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct MeshError {
    /// η = √Σ η_e² [√J]: estimate of ‖u − u_h‖_E, where ‖e‖²_E = ∫ σ(e) : C⁻¹ : σ(e).
    pub eta: f64,
    /// ‖u_h‖_E = √∫ σ_h : C⁻¹ : σ_h [√J].
    pub energy_norm: f64,
    /// η / √(‖u_h‖²_E + η²): the part of the energy norm that the mesh misses.
    pub relative: f64,
    /// Pieces left out because they are inverted or flat. Their stress has no meaning.
    pub left_out: usize,
}

/// Recovers stress. It reuses its memory from call to call.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct StressRecovery {
    stress: Vec<Matrix3<f64>>,
    recovered: Vec<Matrix3<f64>>,
    weight: Vec<f64>,
    eta_squared: Vec<f64>,
    slots: Slots,
}

/// Where the stress of a copy is averaged: in the entry of its number for the first region that is seen there, in an
/// additional one for every other.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
struct Slots {
    n_copies: usize,
    first: Vec<Option<u16>>,
    further: BTreeMap<(u32, u16), u32>,
}

impl Slots {
    fn renew(&mut self, tets: &impl Tets) {
        self.n_copies = tets.n_copies();
        self.further.clear();
        if !tets.has_regions() {
            return;
        }
        self.first.clear();
        self.first.resize(self.n_copies, None);
        for e in 0..tets.count() {
            let region = tets.region(e);
            for copy in tets.tet(e).0 {
                if *self.first[copy as usize].get_or_insert(region) != region {
                    let next = (self.n_copies + self.further.len()) as u32;
                    self.further.entry((copy, region)).or_insert(next);
                }
            }
        }
    }

    fn len(&self) -> usize {
        self.n_copies + self.further.len()
    }

    #[inline]
    fn of(&self, copy: u32, region: u16) -> usize {
        if self.further.is_empty() {
            return copy as usize;
        }
        self.further.get(&(copy, region)).map_or(copy as usize, |&slot| slot as usize)
    }
}

/// Pieces flatter than this are left out of the estimate.
const FLATTEST: f64 = 0.05;

impl StressRecovery {
    /// Estimates the error of the mesh at the positions `x` [m], one per copy. `lame` are the constants outside
    /// regions.
    ///
    /// The stress is that of Cauchy, σ = P Fᵀ / det F, in world axes. The linear law does not distinguish the
    /// two, so P itself is used.
    pub fn estimate(&mut self, tets: &impl Tets, x: &[Vector3<f64>], law: Law, lame: Lame) -> MeshError {
        let mut error = MeshError::default();
        self.stress.clear();
        self.eta_squared.clear();
        self.slots.renew(tets);
        self.recovered.clear();
        self.recovered.resize(self.slots.len(), Matrix3::zeros());
        self.weight.clear();
        self.weight.resize(self.slots.len(), 0.0);
        for e in 0..tets.count() {
            let (copies, gradients, volume) = tets.tet(e);
            let region = tets.region(e);
            let lame = tets.lame(region, lame);
            let F: Matrix3<f64> =
                copies.iter().zip(&gradients).map(|(&c, g)| x[c as usize] * g.transpose()).sum();
            let (stress, volume) = cauchy(&F, volume, law, lame);
            error.left_out += usize::from(volume == 0.0);
            // The volume is stored where the estimate will be.
            self.stress.push(stress);
            self.eta_squared.push(volume);
            for slot in copies.map(|c| self.slots.of(c, region)) {
                self.recovered[slot] += volume * stress;
                self.weight[slot] += volume;
            }
        }
        // From sums weighted by volume to means: the recovered stress of each copy.
        for (stress, &weight) in self.recovered.iter_mut().zip(&self.weight) {
            if weight > 0.0 {
                *stress /= weight;
            }
        }
        let (mut eta_squared, mut energy) = (0.0, 0.0);
        for e in 0..tets.count() {
            let (copies, _, _) = tets.tet(e);
            let region = tets.region(e);
            let lame = tets.lame(region, lame);
            let (volume, stress) = (self.eta_squared[e], &self.stress[e]);
            let d: [Matrix3<f64>; 4] = copies.map(|c| self.recovered[self.slots.of(c, region)] - stress);
            // ∫ N_a N_b dV = V (1 + δ_ab) / 20: Σ_ab d_a : C⁻¹ : d_b of a linear field.
            let sum = d[0] + d[1] + d[2] + d[3];
            let own: f64 = d.iter().map(|d| complementary(d, lame)).sum();
            self.eta_squared[e] = volume / 20.0 * (complementary(&sum, lame) + own);
            eta_squared += self.eta_squared[e];
            energy += volume * complementary(stress, lame);
        }
        error.eta = eta_squared.sqrt();
        error.energy_norm = energy.sqrt();
        let whole = (eta_squared + energy).sqrt();
        error.relative = if whole > 0.0 { error.eta / whole } else { 0.0 };
        error
    }

    /// η_e² \[J\] of every piece, of the last estimate: where the mesh is too coarse.
    pub fn eta_squared(&self) -> &[f64] {
        &self.eta_squared
    }

    /// Stress σ* [Pa] of every copy, of the last estimate; where regions meet, that of one of them.
    pub fn recovered(&self) -> &[Matrix3<f64>] {
        &self.recovered[..self.slots.n_copies]
    }
}

/// Cauchy stress [Pa] and present volume [m³]; both zero for a piece that is flat or inverted.
pub(super) fn cauchy(F: &Matrix3<f64>, volume: f64, law: Law, lame: Lame) -> (Matrix3<f64>, f64) {
    let P = law.stress(F, lame);
    if law == Law::Linear {
        return (P, volume);
    }
    let J = F.determinant();
    if J > FLATTEST { (P * F.transpose() / J, J * volume) } else { (Matrix3::zeros(), 0.0) }
}

/// σ : C⁻¹ : σ [J/m³] of an isotropic material.
pub(super) fn complementary(stress: &Matrix3<f64>, Lame { mu, lambda }: Lame) -> f64 {
    let trace = stress.trace();
    (stress.norm_squared() - lambda / (3.0 * lambda + 2.0 * mu) * trace * trace) / (2.0 * mu)
}

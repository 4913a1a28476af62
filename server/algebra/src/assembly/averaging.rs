//! Node-averaged volumetric strain for linear tetrahedra.
//!
//! θ̄_n = Σ_e (V_e/4) θ_e / V_n over the pieces e at copy n, V_n = Σ_e V_e/4. The energy
//! (1 − κ) λ/2 Σ_n V_n θ̄_n² gives each element the pressure-like factor
//! (1 − κ) λ · mean of θ̄ over its four copies, and couples every two copies around a third.
//!
//! # Source
//! Bonet, Burton 1998, "A simple average nodal pressure tetrahedral element".
//!
//! Puso, Solberg 2006, "A stabilized nodally integrated tetrahedral": the share κ that stays with the
//! elements, taken of λ, or of 25 μ where λ is larger. A fixed share of λ itself would lock again as ν
//! approaches ½.

use nalgebra::{Matrix3, Vector3};
use scindo_matter::material::Lame;

use super::BlockCsr;

/// Upper bound of λ / μ in the energy that partly stays with the elements.
const STIFFEST: f64 = 25.0;

/// Incidence of pieces around copies, and of copies around copies.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct NodeAverage {
    /// Share κ of the volumetric energy that stays with the elements, 0 … 1.
    pub kept: f64,
    /// V_n [m³].
    volume: Vec<f64>,
    /// Elements at node n are `around[around_first[n]..around_first[n + 1]]`.
    around_first: Vec<u32>,
    around: Vec<u32>,
    /// Star of node n, the nodes of these elements, sorted: `star[star_first[n]..star_first[n + 1]]`.
    star_first: Vec<u32>,
    star: Vec<u32>,
    /// For each entry of `around`: position in the star of the element's four nodes.
    star_position: Vec<[u16; 4]>,
    /// For every node n in the star of i: position of i in the star of n; same layout as `star`. The
    /// relation is symmetric, so i is in the star of n.
    position_in_star_of: Vec<u16>,
}

impl NodeAverage {
    /// κ for the setting `kept`: that share of λ, or of 25 μ if λ is larger.
    pub(super) fn share(kept: f64, Lame { mu, lambda }: Lame) -> f64 {
        if lambda > STIFFEST * mu { kept * STIFFEST * mu / lambda } else { kept }
    }

    pub(super) fn new(connectivity: &[u32], volumes: &[f64], n_nodes: usize, kept: f64) -> Self {
        let mut lists: Vec<Vec<u32>> = vec![Vec::new(); n_nodes];
        for (e, nodes) in (0u32..).zip(connectivity.chunks_exact(4)) {
            nodes.iter().for_each(|&n| lists[n as usize].push(e));
        }
        let mut table = Self {
            kept,
            volume: vec![0.0; n_nodes],
            around_first: vec![0],
            around: Vec::new(),
            star_first: vec![0],
            star: Vec::new(),
            star_position: Vec::new(),
            position_in_star_of: Vec::new(),
        };
        // Positions in a star are found once, so that gradients are added without a search.
        for (n, list) in lists.iter().enumerate() {
            let tet = |e: u32| &connectivity[4 * e as usize..][..4];
            let mut star: Vec<u32> = list.iter().flat_map(|&e| tet(e)).copied().collect();
            star.sort_unstable();
            star.dedup();
            for &e in list {
                table.volume[n] += volumes[e as usize] / 4.0;
                let tet = tet(e);
                table
                    .star_position
                    .push(std::array::from_fn(|a| star.partition_point(|s| *s < tet[a]) as u16));
            }
            table.around.extend_from_slice(list);
            table.around_first.push(table.around.len() as u32);
            table.star.extend_from_slice(&star);
            table.star_first.push(table.star.len() as u32);
        }
        // The transposed positions: a row of the tangent gathers from the stars it is in.
        let position =
            |i: usize, n: u32| table.star(n as usize).partition_point(|s| (*s as usize) < i) as u16;
        let positions: Vec<u16> = (0..n_nodes)
            .flat_map(|i| table.star(i).iter().map(move |&n| (i, n)))
            .map(|(i, n)| position(i, n))
            .collect();
        table.position_in_star_of = positions;
        table
    }

    fn star_range(&self, n: usize) -> std::ops::Range<usize> {
        self.star_first[n] as usize..self.star_first[n + 1] as usize
    }

    /// Nodes of the elements around node `n`, sorted; `n` itself among them.
    pub(super) fn star(&self, n: usize) -> &[u32] {
        &self.star[self.star_range(n)]
    }

    /// Total length of all stars: the length of the gradients `c`.
    pub(super) fn star_entries(&self) -> usize {
        self.star.len()
    }

    /// θ̄_n from the θ_e of the elements; zero for a node without volume.
    pub(super) fn average(&self, n: usize, theta: &[f64], volumes: &[f64]) -> f64 {
        if self.volume[n] == 0.0 {
            return 0.0;
        }
        let around = &self.around[self.around_first[n] as usize..self.around_first[n + 1] as usize];
        let sum: f64 = around.iter().map(|&e| volumes[e as usize] / 4.0 * theta[e as usize]).sum();
        sum / self.volume[n]
    }

    /// (1 − κ) λ/2 Σ V_n θ̄_n² \[J\].
    pub(super) fn energy(&self, lambda: f64, theta_bar: &[f64]) -> f64 {
        let sum: f64 = self.volume.iter().zip(theta_bar).map(|(v, t)| v * t * t).sum();
        0.5 * (1.0 - self.kept) * lambda * sum
    }

    /// (1 − κ) λ · mean of θ̄ over the nodes of an element [Pa].
    pub(super) fn pressure(&self, lambda: f64, nodes: &[u32], theta_bar: &[f64]) -> f64 {
        let sum: f64 = nodes.iter().map(|&n| theta_bar[n as usize]).sum();
        (1.0 - self.kept) * lambda * sum / 4.0
    }

    /// c_i = ∂(V_n θ̄_n)/∂x_i [m²] for every i in the star of `n`, from ∂θ_e/∂F of the elements.
    pub(super) fn gradient(
        &self,
        n: usize,
        theta_gradient: &[Matrix3<f64>],
        volumes: &[f64],
        shape_gradients: &[Vector3<f64>],
        c: &mut [Vector3<f64>],
    ) {
        let c = &mut c[self.star_range(n)];
        c.fill(Vector3::zeros());
        for k in self.around_first[n] as usize..self.around_first[n + 1] as usize {
            let e = self.around[k] as usize;
            let P = volumes[e] / 4.0 * theta_gradient[e];
            for (a, &position) in self.star_position[k].iter().enumerate() {
                c[position as usize] += P * shape_gradients[4 * e + a];
            }
        }
    }

    /// Adds (1 − κ) λ Σ_n c_i c_jᵀ / V_n to row `i` of the tangent, whose blocks are `row`.
    pub(super) fn add_to_row(
        &self,
        i: usize,
        lambda: f64,
        c: &[Vector3<f64>],
        pattern: &BlockCsr<f64>,
        row: &mut [[f64; 9]],
    ) {
        let columns = &pattern.columns[pattern.row(i)];
        for k in self.star_range(i) {
            let n = self.star[k] as usize;
            if self.volume[n] == 0.0 {
                continue;
            }
            let star = self.star_range(n);
            let factor = (1.0 - self.kept) * lambda / self.volume[n];
            let c_i = factor * c[star.start + self.position_in_star_of[k] as usize];
            let mut at = 0;
            // Star and columns are both sorted, so the columns are walked once.
            for (j, c_j) in self.star[star.clone()].iter().zip(&c[star]) {
                while columns[at] < *j {
                    at += 1;
                }
                for r in 0..3 {
                    for s in 0..3 {
                        row[at][3 * r + s] += c_i[r] * c_j[s];
                    }
                }
            }
        }
    }
}

//! Mass matrices and consistent loads.

use nalgebra::Vector3;
use scindo_matter::element::ElementKind;
use scindo_matter::element::tet10::HRZ;

use super::mass::{MassSharing, Products};
use super::{BlockCsr, Model};

/// Part of its even share that a node has at least. ω² grows by 1/FLOOR at most, so the critical step is at least
/// √FLOOR = 0.71 of that of the uncut element.
const FLOOR: f64 = 0.5;

impl Model {
    /// Shares the mass of every piece among its nodes otherwise than by ∫ N_a dV. Other elements than linear
    /// tetrahedra keep theirs.
    pub fn share_mass(&mut self, sharing: MassSharing) {
        if self.kind != ElementKind::Tet4 {
            return;
        }
        self.sharing = Some(sharing);
        self.lumped.fill(0.0);
        for (e, (nodes, volume)) in self.connectivity.chunks_exact(4).zip(&self.volumes).enumerate() {
            let share = self.regions.relative_density(e, self.density_kg_m3) * volume / 4.0;
            nodes.iter().for_each(|&node| self.lumped[node as usize] += share);
        }
        match sharing {
            MassSharing::Even => {
                self.integrals.clone_from(&self.lumped);
                self.products = Products::linear_tet();
            }
            MassSharing::Floored => {
                let shares = self.lumped.iter_mut().zip(&self.integrals);
                shares.for_each(|(even, exact)| *even = exact.max(FLOOR * *even));
            }
        }
    }

    /// Sums the volumes of the nodes again, those of regions by their mass; nothing to do without regions.
    pub(super) fn weigh_regions(&mut self) {
        if self.regions.is_empty() {
            return;
        }
        self.lumped.fill(0.0);
        self.integrals.fill(0.0);
        let N = self.kind.nodes();
        let packed = N * (N + 1) / 2;
        let mut shares = vec![[0.0; 2]; N];
        for e in 0..self.n_elements() {
            let heavier = self.regions.relative_density(e, self.density_kg_m3);
            let (products, scale) = match &self.products {
                Products::Scaled(products) => (&products[..], heavier * self.volumes[e]),
                Products::PerElement(products) => (&products[e * packed..][..packed], heavier),
            };
            element_shares(self.kind, products, &mut shares);
            for (&node, [lumped, integral]) in self.connectivity[e * N..][..N].iter().zip(&shares) {
                self.lumped[node as usize] += scale * lumped;
                self.integrals[node as usize] += scale * integral;
            }
        }
    }

    /// Mass [kg] of every node for a density [kg/m³].
    ///
    /// Tet4: ρ ∫ N_a dV over the pieces of the copy, unless [`share_mass`](Self::share_mass) has changed it; Tet10:
    /// diagonal scaling (HRZ), corner m/36, edge 4m/27, of every piece; Hex8: row sums; octree: shares of the cells.
    /// Exact in sum and, without `share_mass` and but for pieces of Tet10, in centre of mass.
    pub fn lumped_mass(&self, density_kg_m3: f64) -> Vec<f64> {
        self.lumped.iter().map(|v| density_kg_m3 * v).collect()
    }

    /// ∫ N_a dV [m³] of every node: times ρ g it is the consistent load of gravity. Negative at the
    /// corners of Tet10. Regions of another density count by their mass.
    pub fn shape_integrals(&self) -> &[f64] {
        &self.integrals
    }

    /// M_ab = ρ ∫ N_a N_b dV I [kg]; overwrites the blocks of `M`, which has the model's pattern.
    pub fn consistent_mass(&self, density_kg_m3: f64, M: &mut BlockCsr<f64>) {
        M.clear();
        let N = self.kind.nodes();
        let packed = N * (N + 1) / 2;
        for e in 0..self.n_elements() {
            let density = density_kg_m3 * self.regions.relative_density(e, self.density_kg_m3);
            let (products, scale) = match &self.products {
                Products::Scaled(products) => (&products[..], density * self.volumes[e]),
                Products::PerElement(products) => (&products[e * packed..][..packed], density),
            };
            let slots = &self.slots[e * N * N..][..N * N];
            let mut next = products.iter();
            for a in 0..N {
                for b in a..N {
                    let m = scale * next.next().copied().unwrap_or_default();
                    let sides = if a == b { 1 } else { 2 };
                    for slot in [slots[a * N + b], slots[b * N + a]].into_iter().take(sides) {
                        for i in [0, 4, 8] {
                            M.blocks[slot as usize][i] += m;
                        }
                    }
                }
            }
        }
    }

    /// Centre of mass [m] at the positions `x` [m].
    pub fn centre_of_mass(&self, x: &[Vector3<f64>]) -> Vector3<f64> {
        let volume: f64 = self.integrals.iter().sum();
        x.iter().zip(&self.integrals).map(|(x, v)| *v * x).sum::<Vector3<f64>>() / volume
    }
}

/// What the nodes of an element get of its mass, lumped and by ∫ N_a dV, from the packed products ∫ N_a N_b dV. The
/// shape functions sum to one, so integrals are the row sums of the products.
fn element_shares(kind: ElementKind, products: &[f64], shares: &mut [[f64; 2]]) {
    let n = shares.len();
    shares.fill([0.0; 2]);
    let mut next = products.iter();
    for a in 0..n {
        for b in a..n {
            let m = next.next().copied().unwrap_or_default();
            shares[a][1] += m;
            if b != a {
                shares[b][1] += m;
            }
        }
    }
    let whole: f64 = shares.iter().map(|share| share[1]).sum();
    for (a, share) in shares.iter_mut().enumerate() {
        // Diagonal scaling (HRZ), because row sums are negative at the corners of quadratic tetrahedra.
        share[0] = if kind == ElementKind::Tet10 { HRZ[a] * whole } else { share[1] };
    }
}

//! The same energies, forces and tangents on all threads of a team, with the same bits for any number of
//! threads. Elements write their contributions into blocks of their own; then every node gathers its
//! share in the order of the elements. The serial version adds in the same order.

use nalgebra::Vector3;
use scindo_matter::element::ElementKind;
use scindo_matter::material::{Law, Tangent};
use scindo_matter::team::{Team, blocks, ranges};

use super::elastic::Linearisation;
use super::scratch::{Buffers, Work};
use super::{BlockCsr, Model};

/// Elements per task.
const CHUNK: usize = 32;
/// Nodes per task.
pub(super) const ROWS: usize = 64;
/// Blocks that elements write before the nodes gather them: about 1 MB.
const BATCH_BLOCKS: usize = 16_384;

impl Model {
    /// [`energy`](Self::energy) on all threads of a team.
    pub fn energy_by(&self, team: &mut Team, x: &[Vector3<f64>]) -> f64 {
        if team.threads() == 1 {
            return self.energy(x);
        }
        match self.kind {
            ElementKind::Tet4 => self.energies_by::<4>(team, x),
            ElementKind::Tet10 => self.energies_by::<10>(team, x),
            ElementKind::Hex8 | ElementKind::Octree => self.energies_by::<8>(team, x),
        }
    }

    /// [`internal_forces`](Self::internal_forces) on all threads of a team.
    pub fn internal_forces_by(&self, team: &mut Team, x: &[Vector3<f64>], f: &mut [Vector3<f64>]) -> f64 {
        if team.threads() == 1 {
            return self.internal_forces(x, f);
        }
        match self.kind {
            ElementKind::Tet4 => self.forces_by::<4>(team, x, f),
            ElementKind::Tet10 => self.forces_by::<10>(team, x, f),
            ElementKind::Hex8 | ElementKind::Octree => self.forces_by::<8>(team, x, f),
        }
    }

    /// [`tangent`](Self::tangent) on all threads of a team.
    pub fn tangent_by(&self, team: &mut Team, x: &[Vector3<f64>], kind: Tangent, K: &mut BlockCsr<f64>) {
        self.linearised_by(team, &Linearisation { x, kind, from: None }, K);
    }

    /// The exact tangent at `x` [m], except that the stress in it is that of `from` [m] extrapolated linearly
    /// to `x`. Only St. Venant–Kirchhoff's law has one; for the others `K` stays as it is. Returns whether
    /// it was computed.
    ///
    /// # Source
    /// Magisano, Leonetti, Garcea 2017, "How to improve efficiency and robustness of the Newton method in
    /// geometrically non-linear structural problem discretized via displacement-based finite elements".
    pub fn extrapolated_tangent_by(
        &self,
        team: &mut Team,
        from: &[Vector3<f64>],
        x: &[Vector3<f64>],
        K: &mut BlockCsr<f64>,
    ) -> bool {
        let known = self.point.law == Law::StVenantKirchhoff;
        if known {
            self.linearised_by(team, &Linearisation { x, kind: Tangent::Exact, from: Some(from) }, K);
        }
        known
    }

    fn linearised_by(&self, team: &mut Team, at: &Linearisation<'_>, K: &mut BlockCsr<f64>) {
        if team.threads() == 1 {
            return self.linearised(at, K);
        }
        match self.kind {
            ElementKind::Tet4 => self.blocks_by::<4>(team, at, K),
            ElementKind::Tet10 => self.blocks_by::<10>(team, at, K),
            ElementKind::Hex8 | ElementKind::Octree => self.blocks_by::<8>(team, at, K),
        }
    }

    fn energies_by<const N: usize>(&self, team: &mut Team, x: &[Vector3<f64>]) -> f64 {
        let mut buffers = self.scratch.take();
        let averaged = self.average_volume(x, &mut buffers, false);
        let energies = &mut buffers.work.energies;
        energies.resize(self.n_elements(), 0.0);
        team.for_blocks(blocks(energies, CHUNK), |chunk, energies| {
            for (i, energy) in energies.iter_mut().enumerate() {
                *energy = self.element_energy::<N>(chunk * CHUNK + i, x);
            }
        });
        energies.iter().sum::<f64>() + averaged + self.spring_energy(x)
    }

    fn forces_by<const N: usize>(&self, team: &mut Team, x: &[Vector3<f64>], f: &mut [Vector3<f64>]) -> f64 {
        let mut buffers = self.scratch.take();
        let averaged = self.average_volume(x, &mut buffers, false);
        let mut work = std::mem::take(&mut buffers.work);
        let Work { energies, forces, .. } = &mut work;
        energies.resize(self.n_elements(), 0.0);
        forces.resize(self.n_elements() * N, Vector3::zeros());
        let shared: &Buffers = &buffers;
        team.for_blocks((blocks(energies, CHUNK), blocks(forces, CHUNK * N)), |chunk, (energies, forces)| {
            for (i, (energy, f)) in energies.iter_mut().zip(forces.chunks_exact_mut(N)).enumerate() {
                let mut f_e = [Vector3::zeros(); N];
                *energy = self.element_forces::<N>(chunk * CHUNK + i, x, shared, &mut f_e);
                f.copy_from_slice(&f_e);
            }
        });
        // Each node adds in the order of the elements, whichever thread computed them.
        let forces = &*forces;
        team.for_blocks(blocks(f, ROWS), |chunk, f| {
            for (i, f) in f.iter_mut().enumerate() {
                let entries = &self.incident[self.incidence(chunk * ROWS + i)];
                *f = entries.iter().fold(Vector3::zeros(), |sum, &k| sum + forces[k as usize]);
            }
        });
        let energy = energies.iter().fold(0.0, |sum, e| sum + e);
        buffers.work = work;
        energy + averaged + self.add_spring_forces(x, f)
    }

    fn blocks_by<const N: usize>(&self, team: &mut Team, at: &Linearisation<'_>, K: &mut BlockCsr<f64>) {
        let mut buffers = self.scratch.take();
        self.average_volume(at.x, &mut buffers, true);
        K.clear();
        let mut work = std::mem::take(&mut buffers.work);
        let Work { blocks: handed, next, .. } = &mut work;
        let per_batch = BATCH_BLOCKS / (N * N);
        handed.resize(per_batch * N * N, [0.0; 9]);
        next.clear();
        next.extend_from_slice(&self.incident_first[..self.n_nodes()]);
        let shared: &Buffers = &buffers;
        // In batches, so that the blocks of all elements never have to be stored at once.
        for first in (0..self.n_elements()).step_by(per_batch) {
            let end = (first + per_batch).min(self.n_elements());
            let batch = &mut handed[..(end - first) * N * N];
            team.for_blocks(blocks(batch, CHUNK * N * N), |chunk, parts| {
                for (i, part) in parts.chunks_exact_mut(N * N).enumerate() {
                    self.element_tangent::<N>(first + chunk * CHUNK + i, at, shared, part);
                }
            });
            // A task owns its rows. Every node goes on in its list where the last batch ended.
            let batch = &*batch;
            let rows = (ranges(&mut K.blocks, &self.row_bounds), blocks(next, ROWS));
            team.for_blocks(rows, |chunk, (rows, next)| {
                let offset = self.row_bounds[chunk];
                for (i, next) in next.iter_mut().enumerate() {
                    let last = self.incidence(chunk * ROWS + i).end as u32;
                    while *next < last && (self.incident[*next as usize] as usize) < end * N {
                        let entry = self.incident[*next as usize] as usize;
                        let slots = &self.slots[entry * N..][..N];
                        for (part, slot) in batch[(entry - first * N) * N..][..N].iter().zip(slots) {
                            let block = &mut rows[(slot - offset) as usize];
                            block.iter_mut().zip(part).for_each(|(k, b)| *k += b);
                        }
                        *next += 1;
                    }
                }
            });
        }
        // Averaging couples nodes across elements, so it is added by row.
        if let (Some(averaging), Some(split)) = (&self.averaging, self.point.split()) {
            team.for_blocks(ranges(&mut K.blocks, &self.row_bounds), |chunk, rows| {
                let offset = self.row_bounds[chunk] as usize;
                for i in (chunk * ROWS)..((chunk + 1) * ROWS).min(self.n_nodes()) {
                    let row = self.pattern.row(i);
                    let row = &mut rows[row.start - offset..row.end - offset];
                    averaging.add_to_row(i, split.lambda(), &shared.star_gradient, &self.pattern, row);
                }
            });
        }
        buffers.work = work;
        self.add_spring_tangent(at.x, at.kind, K);
    }

    pub(super) fn incidence(&self, n: usize) -> std::ops::Range<usize> {
        self.incident_first[n] as usize..self.incident_first[n + 1] as usize
    }

    /// Lists for every node its entries in the elements, by counting.
    pub(super) fn find_incidence(&mut self) {
        let n = self.n_nodes();
        let mut first = vec![0_u32; n + 1];
        self.connectivity.iter().for_each(|&node| first[node as usize + 1] += 1);
        for i in 0..n {
            first[i + 1] += first[i];
        }
        let mut fill = first.clone();
        self.incident = vec![0; self.connectivity.len()];
        for (entry, &node) in (0_u32..).zip(&self.connectivity) {
            self.incident[fill[node as usize] as usize] = entry;
            fill[node as usize] += 1;
        }
        self.incident_first = first;
    }

    /// Divides the rows of the tangent among tasks.
    pub(super) fn find_row_bounds(&mut self) {
        let n = self.n_nodes();
        let starts = self.pattern.first[..n].iter().step_by(ROWS);
        self.row_bounds = starts.chain(self.pattern.first.last()).copied().collect();
    }
}

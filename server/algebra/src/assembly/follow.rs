//! How the model of a cut body follows a cut, at the cost of what the cut changed and of a few passes over
//! index lists. The result is that of building the model anew, to the bit.

use scindo_matter::cut::CutMesh;
use scindo_matter::material::Regions;

use super::averaging::NodeAverage;
use super::mass::{Products, pack};
use super::{BlockCsr, Model, ModelError, Volumetric};

impl Model {
    /// Follows the last cut of `cut`, from which the model was built; `regions` are those of its tetrahedra.
    pub fn follow_cut(&mut self, cut: &CutMesh, regions: &Regions) {
        let (mesh, known, n_known) = (cut.mesh(), self.volumes.len(), self.rest.len());
        let node_of_copy = &cut.copy_node()[n_known..];
        self.rest.extend(node_of_copy.iter().map(|&node| mesh.nodes[node as usize]));
        let mut touched = vec![false; cut.n_copies()];
        touched[n_known..].fill(true);
        let mut products = match std::mem::replace(&mut self.products, Products::linear_tet()) {
            Products::PerElement(products) => products,
            Products::Scaled(_) => Vec::new(),
        };
        let packed = products.len() / known.max(1);
        for &p in cut.changed_pieces() {
            let (p, piece) = (p as usize, &cut.pieces()[p as usize]);
            let volume = piece.fraction * mesh.volume(piece.element as usize);
            if p < known {
                // Copies that it has left lose neighbours.
                self.element(p).iter().for_each(|&copy| touched[copy as usize] = true);
                self.connectivity[4 * p..][..4].copy_from_slice(&piece.copies);
                (self.weights[p], self.volumes[p]) = (volume, volume);
                if packed > 0 {
                    let new = cut.piece_node_products(p);
                    products[packed * p..][..packed].iter_mut().zip(pack(&new)).for_each(|(m, new)| *m = new);
                }
            } else {
                self.connectivity.extend_from_slice(&piece.copies);
                self.gradients.extend_from_slice(&mesh.gradients(piece.element as usize));
                self.weights.push(volume);
                self.volumes.push(volume);
                self.regions.push(regions.of(piece.element as usize));
                if packed > 0 {
                    products.extend(pack(&cut.piece_node_products(p)));
                }
            }
            piece.copies.iter().for_each(|&copy| touched[copy as usize] = true);
        }
        if packed > 0 {
            self.products = Products::PerElement(products);
        }
        self.sum_piece_volumes(cut);
        if let Volumetric::NodeAveraged { kept } = self.volumetric {
            let kept = NodeAverage::share(kept, self.point.lame);
            self.averaging = Some(NodeAverage::new(&self.connectivity, &self.volumes, self.rest.len(), kept));
            return self.find_pattern();
        }
        self.find_incidence();
        self.follow_pattern(&touched);
        self.find_row_bounds();
    }

    /// Gives the pieces of `cut`, from which the model was built, the constants of the `regions` of its tetrahedra.
    ///
    /// # Errors
    /// As [`with_regions`](Self::with_regions).
    pub fn with_regions_of_tets(mut self, cut: &CutMesh, regions: &Regions) -> Result<Self, ModelError> {
        let of_pieces = regions.of_pieces(cut.pieces().iter().map(|piece| piece.element));
        self = self.with_regions(of_pieces)?;
        if !regions.is_empty() {
            self.sum_piece_volumes(cut);
        }
        Ok(self)
    }

    /// Sums the volumes of the nodes again, in the order in which they were summed at first.
    fn sum_piece_volumes(&mut self, cut: &CutMesh) {
        for sum in [&mut self.lumped, &mut self.integrals] {
            sum.clear();
            sum.resize(cut.n_copies(), 0.0);
        }
        for (p, piece) in cut.pieces().iter().enumerate() {
            let relative = self.regions.relative_density(p, self.density_kg_m3);
            for (&copy, v) in piece.copies.iter().zip(cut.piece_node_volume(p)) {
                self.lumped[copy as usize] += relative * v;
                self.integrals[copy as usize] += relative * v;
            }
        }
        if let Some(sharing) = self.sharing {
            self.share_mass(sharing);
        }
    }

    /// Finds the columns of the `touched` rows again; the others keep theirs.
    fn follow_pattern(&mut self, touched: &[bool]) {
        let n = self.n_nodes();
        let old = std::mem::take(&mut self.pattern);
        let mut pattern: BlockCsr<f64> = BlockCsr { first: vec![0], ..BlockCsr::default() };
        pattern.first.reserve(n);
        pattern.columns.reserve(old.columns.len() + old.columns.len() / 4);
        let mut row: Vec<u32> = Vec::new();
        for i in 0..n {
            if touched[i] {
                row.clear();
                row.push(i as u32);
                let entries = &self.incident[self.incidence(i)];
                entries.iter().for_each(|&k| row.extend_from_slice(self.element(k as usize / 4)));
                row.sort_unstable();
                row.dedup();
                pattern.columns.extend_from_slice(&row);
            } else {
                pattern.columns.extend_from_slice(&old.columns[old.row(i)]);
            }
            pattern.first.push(pattern.columns.len() as u32);
        }
        let known = self.slots.len();
        self.slots.resize(4 * self.connectivity.len(), 0);
        for (entry, slots) in self.slots.chunks_exact_mut(4).enumerate() {
            let a = self.connectivity[entry] as usize;
            if touched[a] || 4 * entry >= known {
                let start = pattern.first[a];
                let columns = &pattern.columns[pattern.row(a)];
                let nodes = &self.connectivity[4 * (entry / 4)..][..4];
                for (slot, b) in slots.iter_mut().zip(nodes) {
                    *slot = start + columns.partition_point(|column| column < b) as u32;
                }
            } else {
                let moved = pattern.first[a].wrapping_sub(old.first[a]);
                slots.iter_mut().for_each(|slot| *slot = slot.wrapping_add(moved));
            }
        }
        self.pattern = pattern;
    }
}

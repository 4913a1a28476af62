//! Builds a model from a mesh, a material and an element.

use nalgebra::Vector3;
use scindo_matter::cut::CutMesh;
use scindo_matter::element::{ElementKind, Points, hex8, quadrature};
use scindo_matter::material::{Fibres, Material, Regions};
use scindo_matter::mesh::{HexMesh, MeshError, Tet10Mesh, TetMesh};
use scindo_matter::octree::{Octree, corner_weights};

use super::averaging::NodeAverage;
use super::mass::{Products, pack};
use super::point::PointLaw;
use super::quadratic::QuadraticPiece;
use super::scratch::Scratch;
use super::viscous::Viscous;
use super::{BlockCsr, Model, ModelError, Volumetric};

impl Model {
    /// Linear tetrahedra of an uncut mesh.
    pub fn tet4(mesh: &TetMesh, material: &Material, volumetric: Volumetric) -> Result<Self, ModelError> {
        mesh.check()?;
        let mut model = Self::begin(ElementKind::Tet4, mesh.nodes.clone(), material, volumetric)?;
        for (e, tet) in mesh.tets.iter().enumerate() {
            let volume = mesh.volume(e);
            model.push_tet4(tet, &mesh.gradients(e), volume, &[volume / 4.0; 4]);
        }
        model.products = Products::linear_tet();
        model.finish()
    }

    /// Linear tetrahedra of a cut mesh: one element per material piece, with the piece's copies as nodes.
    pub fn tet4_cut(cut: &CutMesh, material: &Material, volumetric: Volumetric) -> Result<Self, ModelError> {
        let mesh = cut.mesh();
        let mut model = Self::begin(ElementKind::Tet4, cut.rest_positions(), material, volumetric)?;
        let mut products = Vec::new();
        for (p, piece) in cut.pieces().iter().enumerate() {
            let e = piece.element as usize;
            let volume = piece.fraction * mesh.volume(e);
            model.push_tet4(&piece.copies, &mesh.gradients(e), volume, &cut.piece_node_volume(p));
            products.extend(pack(&cut.piece_node_products(p)));
        }
        model.products = Products::PerElement(products);
        model.finish()
    }

    /// Straight-sided quadratic tetrahedra on the corners of `mesh`; nodes as in [`Tet10Mesh`].
    pub fn tet10(mesh: &TetMesh, material: &Material) -> Result<Self, ModelError> {
        mesh.check()?;
        let quadratic = Tet10Mesh::new(mesh);
        let points = quadrature::tet_degree_2();
        let piece = |(e, &nodes): (usize, &[u32; 10])| {
            let (volume, linear_gradients) = (mesh.volume(e), mesh.gradients(e));
            QuadraticPiece { nodes, linear_gradients, volume, points, products: None }
        };
        let pieces: Vec<QuadraticPiece> = quadratic.tets.iter().enumerate().map(piece).collect();
        Self::tet10_pieces(quadratic.nodes, &pieces, material)
    }

    /// Trilinear hexahedra.
    pub fn hex8(mesh: &HexMesh, material: &Material, volumetric: Volumetric) -> Result<Self, ModelError> {
        mesh.check()?;
        let mut model = Self::begin(ElementKind::Hex8, mesh.nodes.clone(), material, volumetric)?;
        let rule = quadrature::cube_gauss(2);
        let mut products = Vec::new();
        for (e, hex) in mesh.hexes.iter().enumerate() {
            let X = mesh.corners(e);
            model.connectivity.extend_from_slice(hex);
            let (mut volume, mut sum) = (0.0, [Vector3::zeros(); 8]);
            // The map from the reference cube is not affine: gradients and det J differ between the points.
            for (xi, w) in &rule {
                let (g, det) = hex8::gradients(&X, xi).ok_or(MeshError::Degenerate {
                    tet: e,
                    volume_m3: 0.0,
                    least_m3: f64::MIN_POSITIVE,
                })?;
                model.gradients.extend_from_slice(&g);
                model.weights.push(w * det);
                volume += w * det;
                for (sum, g) in sum.iter_mut().zip(&g) {
                    *sum += w * det * g;
                }
            }
            model.volumes.push(volume);
            if volumetric == Volumetric::Selective {
                model.mean_gradients.extend(sum.map(|g| g / volume));
            }
            let M = hex8::shape_products(&X);
            // The shape functions sum to one, so row sums of their products are their integrals.
            for (row, &node) in M.iter().zip(hex) {
                let integral: f64 = row.iter().sum();
                model.lumped[node as usize] += integral;
                model.integrals[node as usize] += integral;
            }
            products.extend(pack(&M));
        }
        model.products = Products::PerElement(products);
        model.finish()
    }

    /// The cells of an octree, on the vertices that carry them: N_a = Σ_c W_ca N_c, with the weights W of the
    /// hanging corners.
    pub fn octree(octree: &Octree, material: &Material, volumetric: Volumetric) -> Result<Self, ModelError> {
        let mut model = Self::begin(ElementKind::Octree, Vec::new(), material, volumetric)?;
        model.regions = Regions::without_elements(octree.regions().to_vec());
        model.fill_octree(octree, material.density_kg_m3);
        Ok(model)
    }

    /// Takes the cells of `octree` in place of those there are. `density_kg_m3` is that of the body.
    pub fn fill_octree(&mut self, octree: &Octree, density_kg_m3: f64) {
        let rest = octree.rest_positions();
        for list in [&mut self.gradients, &mut self.mean_gradients] {
            list.clear();
        }
        for list in [&mut self.weights, &mut self.volumes] {
            list.clear();
        }
        self.connectivity.clear();
        octree.for_points(&rest, &mut |point| {
            self.gradients.extend_from_slice(point.gradients);
            self.weights.push(point.weight);
        });
        self.rest = rest;
        // ∫ N_a N_b over the unit cube.
        let unit = hex8::shape_products(&std::array::from_fn(|c| 0.5 * hex8::corner(c)));
        let mut products = Vec::with_capacity(36 * octree.cells().len());
        for (e, (cell, nodes)) in octree.cells().iter().zip(octree.vertices()).enumerate() {
            let (volume, W) = (octree.cell_volume(e), corner_weights(cell, octree.hanging()[e]));
            self.connectivity.extend_from_slice(nodes);
            self.volumes.push(volume);
            if self.volumetric == Volumetric::Selective {
                let points = &self.gradients[64 * e..];
                let mean = |a: usize| (0..8).map(|q| points[8 * q + a]).sum::<Vector3<f64>>() / 8.0;
                let mean: [Vector3<f64>; 8] = std::array::from_fn(mean);
                self.mean_gradients.extend(mean);
            }
            let product = |a: usize, b: usize| -> f64 {
                let row = |c: usize| (0..8).map(|d| unit[c][d] * W[d][b]).sum::<f64>();
                volume * (0..8).map(|c| W[c][a] * row(c)).sum::<f64>()
            };
            let M: [[f64; 8]; 8] = std::array::from_fn(|a| std::array::from_fn(|b| product(a, b)));
            products.extend(pack(&M));
        }
        self.regions.refill(octree.cells().iter().map(|cell| cell.material));
        self.density_kg_m3 = density_kg_m3;
        self.lumped = octree.vertex_masses(density_kg_m3).into_iter().map(|m| m / density_kg_m3).collect();
        self.integrals.clone_from(&self.lumped);
        self.products = Products::PerElement(products);
        self.find_pattern();
    }

    pub(super) fn begin(
        kind: ElementKind,
        rest: Vec<Vector3<f64>>,
        material: &Material,
        volumetric: Volumetric,
    ) -> Result<Self, ModelError> {
        material.check()?;
        let point = PointLaw { law: material.law, lame: material.lame() };
        // A remedy belongs to one element and needs a law with a separate volumetric part.
        match (volumetric, kind) {
            (Volumetric::Full, _)
            | (Volumetric::NodeAveraged { .. }, ElementKind::Tet4)
            | (Volumetric::Selective, ElementKind::Hex8 | ElementKind::Octree) => {}
            (remedy, element) => return Err(ModelError::Remedy { element, remedy }),
        }
        if volumetric != Volumetric::Full && point.split().is_none() {
            return Err(ModelError::NoSplit { law: material.law, remedy: volumetric });
        }
        if let Volumetric::NodeAveraged { kept } = volumetric
            && !(0.0..=1.0).contains(&kept)
        {
            return Err(ModelError::Kept { kept });
        }
        let n = rest.len();
        Ok(Self {
            kind,
            volumetric,
            point,
            fibres: Fibres::default(),
            viscous: Viscous::default(),
            regions: Regions::default(),
            density_kg_m3: material.density_kg_m3,
            rest,
            connectivity: Vec::new(),
            gradients: Vec::new(),
            weights: Vec::new(),
            volumes: Vec::new(),
            mean_gradients: Vec::new(),
            averaging: None,
            springs: Vec::new(),
            lumped: vec![0.0; n],
            integrals: vec![0.0; n],
            products: Products::linear_tet(),
            sharing: None,
            pattern: BlockCsr::default(),
            slots: Vec::new(),
            incident_first: Vec::new(),
            incident: Vec::new(),
            row_bounds: Vec::new(),
            scratch: Scratch::default(),
        })
    }

    fn push_tet4(&mut self, nodes: &[u32; 4], g: &[Vector3<f64>; 4], volume: f64, node_volume: &[f64; 4]) {
        self.connectivity.extend_from_slice(nodes);
        self.gradients.extend_from_slice(g);
        self.weights.push(volume);
        self.volumes.push(volume);
        for (&node, v) in nodes.iter().zip(node_volume) {
            self.lumped[node as usize] += v;
            self.integrals[node as usize] += v;
        }
    }

    fn finish(mut self) -> Result<Self, ModelError> {
        if let Volumetric::NodeAveraged { kept } = self.volumetric {
            let kept = NodeAverage::share(kept, self.point.lame);
            self.averaging = Some(NodeAverage::new(&self.connectivity, &self.volumes, self.rest.len(), kept));
        }
        self.find_pattern();
        Ok(self)
    }
}

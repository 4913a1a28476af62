//! The model of quadratic tetrahedra, whole or in pieces.

use nalgebra::Vector3;
use scindo_matter::element::ElementKind;
use scindo_matter::element::quadrature::QuadraturePoint;
use scindo_matter::element::tet10::{self, HRZ};
use scindo_matter::material::{Material, Regions};

use super::mass::{Products, pack};
use super::{Model, ModelError, Volumetric};

/// A quadratic tetrahedron, or a piece of one. Its nodes are copies of its own.
#[derive(Clone, Debug)]
pub struct QuadraticPiece {
    /// Copies of the corners, then those of the mid-edge nodes.
    pub nodes: [u32; 10],
    /// Gradients [1/m] of the linear shape functions of the element.
    pub linear_gradients: [Vector3<f64>; 4],
    /// Volume of the piece [m³].
    pub volume: f64,
    /// Quadrature points in reference coordinates; the weights sum to 1.
    pub points: [QuadraturePoint; 4],
    /// ∫ N_a N_b dV [m³] over the piece; `None` for a whole element. The lumped mass does not follow from it: every
    /// piece shares its mass among its nodes as a whole element does, which keeps the momentum when an element is cut
    /// and the critical time step about what it was.
    pub products: Option<Box<[[f64; 10]; 10]>>,
}

impl QuadraticPiece {
    /// ∫ N_a dV [m³] of its nodes. The shape functions sum to one, so these are the row sums of their products.
    pub fn integrals(&self) -> [f64; 10] {
        match &self.products {
            Some(M) => M.map(|row| row.iter().sum()),
            None => tet10::INTEGRALS.map(|integral| integral * self.volume),
        }
    }
}

impl Model {
    /// Quadratic tetrahedra cut into `pieces`, one element each, on nodes that rest at `rest` [m].
    pub fn tet10_pieces(
        rest: Vec<Vector3<f64>>,
        pieces: &[QuadraticPiece],
        material: &Material,
    ) -> Result<Self, ModelError> {
        let mut model = Self::begin(ElementKind::Tet10, Vec::new(), material, Volumetric::Full)?;
        model.fill_quadratic(rest, pieces, Regions::default());
        Ok(model)
    }

    /// Takes `pieces` in place of the elements there are, with the `regions` of their materials, one entry per piece.
    pub fn fill_quadratic(&mut self, rest: Vec<Vector3<f64>>, pieces: &[QuadraticPiece], regions: Regions) {
        self.rest = rest;
        for list in [&mut self.gradients, &mut self.mean_gradients] {
            list.clear();
        }
        for list in [&mut self.weights, &mut self.volumes] {
            list.clear();
        }
        for sum in [&mut self.lumped, &mut self.integrals] {
            sum.clear();
            sum.resize(self.rest.len(), 0.0);
        }
        self.connectivity.clear();
        let whole = tet10::shape_products();
        let mut products = Vec::new();
        let any_cut = pieces.iter().any(|piece| piece.products.is_some());
        for piece in pieces {
            self.connectivity.extend_from_slice(&piece.nodes);
            self.volumes.push(piece.volume);
            for (xi, w) in &piece.points {
                self.gradients.extend(tet10::gradients(xi, &piece.linear_gradients));
                self.weights.push(w * piece.volume);
            }
            for ((&node, lumped), integral) in piece.nodes.iter().zip(HRZ).zip(piece.integrals()) {
                self.lumped[node as usize] += lumped * piece.volume;
                self.integrals[node as usize] += integral;
            }
            match &piece.products {
                Some(M) => products.extend(pack(M)),
                None if any_cut => products.extend(pack(&whole).map(|m| piece.volume * m)),
                None => {}
            }
        }
        self.products =
            if any_cut { Products::PerElement(products) } else { Products::Scaled(pack(&whole).collect()) };
        self.regions = regions;
        self.weigh_regions();
        self.find_pattern();
    }
}

//! Quadratic tetrahedra, cut or not: every piece of a cut one is an element on copies of corners and mid-edge nodes.

use std::sync::Arc;

use nalgebra::Vector3;
use scindo_algebra::assembly::{Model, ModelError, QuadraticPiece, Volumetric};
use scindo_algebra::operator::StiffModes;
use scindo_matter::cut::middles::MiddleCopies;
use scindo_matter::cut::{CutMesh, NewCopy, Piece};
use scindo_matter::element::ElementKind;
use scindo_matter::element::{Point, TET_EDGES, deformation_gradient, piece_rule, quadrature, tet10};
use scindo_matter::material::{Material, Regions};
use scindo_matter::mesh::{Tet10Mesh, TetMesh};

use super::element::Element;

/// A corner counts as far from its copy's material below this mean of its linear shape function there.
const FAR: f64 = 0.125;

/// Quadratic tetrahedra and the copies of their mid-edge nodes, which are numbered after all copies of corners.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct QuadraticTets {
    mesh: Tet10Mesh,
    middles: MiddleCopies,
    /// ∫ N_a dV [m³] of every copy of a mid-edge node.
    volumes: Vec<f64>,
}

impl Element for QuadraticTets {
    fn kind(&self) -> ElementKind {
        ElementKind::Tet10
    }

    fn rest_positions(&self, cut: &CutMesh) -> Vec<Vector3<f64>> {
        let mut rest = cut.rest_positions();
        let n_corners = self.mesh.n_corners();
        rest.extend(self.middles.edge.iter().map(|&edge| self.mesh.nodes[n_corners + edge as usize]));
        rest
    }

    fn n_nodes(&self, _: &TetMesh) -> usize {
        self.mesh.nodes.len()
    }

    fn n_added(&self) -> usize {
        self.middles.edge.len()
    }

    fn node_of_added(&self, added: usize) -> u32 {
        self.mesh.n_corners() as u32 + self.middles.edge[added]
    }

    fn added_with_node(&self, cut: &CutMesh, node: u32) -> Vec<u32> {
        self.middles.with_middle(&self.mesh, cut, node - self.mesh.n_corners() as u32)
    }

    fn added_volumes(&self) -> &[f64] {
        &self.volumes
    }

    fn modes(&self, cut: &CutMesh) -> Option<StiffModes> {
        StiffModes::of_middles(cut.n_copies() + self.n_added(), self.far_middles(cut))
    }

    fn follow_cut(&self, cut: &CutMesh) -> Option<(Arc<dyn Element>, Vec<NewCopy>)> {
        let mut element = self.clone();
        let mut new = element.middles.follow(&self.mesh, cut);
        element.measure(cut);
        let n_copies = cut.n_copies() as u32;
        new.iter_mut().for_each(|new| *new = NewCopy::split(n_copies + new.copy, n_copies + new.parent));
        Some((Arc::new(element), new))
    }

    fn uncut(&self, cut: &CutMesh) -> Option<Arc<dyn Element>> {
        Some(Arc::new(Self::on(self.mesh.clone(), cut)))
    }

    fn model(&self, cut: &CutMesh, material: &Material, how: Volumetric) -> Result<Model, ModelError> {
        if how != Volumetric::Full {
            return Err(ModelError::Remedy { element: ElementKind::Tet10, remedy: how });
        }
        Model::tet10_pieces(self.rest_positions(cut), &self.pieces(cut), material)
    }

    fn follow_model(&self, model: &mut Model, cut: &CutMesh, regions: Regions) {
        model.fill_quadratic(self.rest_positions(cut), &self.pieces(cut), regions);
    }

    fn areas(&self, mesh: &TetMesh, selected: &[bool]) -> Vec<f64> {
        let mut area = vec![0.0; selected.len()];
        let chosen = |nodes: &[u32; 3]| nodes.iter().all(|&n| selected[n as usize]);
        for face in mesh.boundary_faces() {
            let middles = self.middles(&mesh.tets[face.tet as usize], face.tet, &face.nodes);
            if chosen(&face.nodes) && chosen(&middles) {
                // On a straight-sided face ∫ N dA is 0 at corners and A/3 at middles.
                let third = mesh.face_area(&face) / 3.0;
                middles.iter().for_each(|&n| area[n as usize] += third);
            }
        }
        area
    }

    fn volumes(&self, mesh: &TetMesh, selected: &[bool]) -> Vec<f64> {
        let mut volume = vec![0.0; selected.len()];
        for (e, tet) in self.mesh.tets.iter().enumerate() {
            for (a, &n) in tet.iter().enumerate().filter(|(_, n)| selected[**n as usize]) {
                let integral = if a < 4 { tet10::INTEGRAL_CORNER } else { tet10::INTEGRAL_EDGE };
                volume[n as usize] += integral * mesh.volume(e);
            }
        }
        volume
    }

    fn carriers(&self, cut: &CutMesh, piece: u32, weights: [f64; 4]) -> Vec<(u32, f64)> {
        let N = tet10::shape(&Vector3::new(weights[1], weights[2], weights[3]));
        self.nodes(cut, piece as usize).into_iter().zip(N).collect()
    }

    fn for_groups(&self, cut: &CutMesh, visit: &mut dyn FnMut(&[u32])) {
        (0..cut.pieces().len()).for_each(|p| visit(&self.nodes(cut, p)));
    }

    fn for_points(&self, cut: &CutMesh, x: &[Vector3<f64>], visit: &mut dyn FnMut(Point<'_>)) {
        for element in 0..cut.pieces().len() {
            let QuadraticPiece { nodes, linear_gradients, volume, points, .. } = self.piece(cut, element);
            for (xi, w) in &points {
                let gradients = tet10::gradients(xi, &linear_gradients);
                visit(Point {
                    element,
                    nodes: &nodes,
                    gradients: &gradients,
                    weight: w * volume,
                    F: deformation_gradient(&nodes.map(|n| x[n as usize]), &gradients),
                    region: 0,
                });
            }
        }
    }
}

impl QuadraticTets {
    /// Quadratic tetrahedra on the pieces of `cut`.
    pub fn new(cut: &CutMesh) -> Self {
        Self::on(Tet10Mesh::new(cut.mesh()), cut)
    }

    fn on(mesh: Tet10Mesh, cut: &CutMesh) -> Self {
        let middles = MiddleCopies::new(&mesh, cut);
        let mut element = Self { mesh, middles, volumes: Vec::new() };
        element.measure(cut);
        element
    }

    /// Sums the volumes of the copies of mid-edge nodes.
    fn measure(&mut self, cut: &CutMesh) {
        let mut volumes = vec![0.0; self.middles.edge.len()];
        for (p, middles) in self.middles.of_piece.iter().enumerate() {
            let linear = cut.piece_node_products(p);
            for (&middle, [a, b]) in middles.iter().zip(TET_EDGES) {
                // N = 4 L_a L_b.
                volumes[middle as usize] += 4.0 * linear[a][b];
            }
        }
        self.volumes = volumes;
    }

    /// Copies of the corners of piece `p`, then those of its mid-edge nodes.
    fn nodes(&self, cut: &CutMesh, p: usize) -> [u32; 10] {
        let (corners, middles) = (&cut.pieces()[p].copies, &self.middles.of_piece[p]);
        std::array::from_fn(|a| if a < 4 { corners[a] } else { cut.n_copies() as u32 + middles[a - 4] })
    }

    /// The mid-edge nodes between a corner that is far from all material of its copy and one that is not, ascending,
    /// each with the far corner.
    fn far_middles(&self, cut: &CutMesh) -> Vec<[u32; 2]> {
        let mut carried = vec![0.0; cut.n_copies()];
        for piece in cut.pieces() {
            let volume = piece.fraction * cut.mesh().volume(piece.element as usize);
            piece.copies.iter().for_each(|&copy| carried[copy as usize] += volume);
        }
        // Σ ∫ L_b dV / Σ ∫ dV is ¼ where no element is cut.
        let is_far = |copy: u32| cut.copy_volume()[copy as usize] < FAR * carried[copy as usize];
        let mut middles = Vec::new();
        for (p, piece) in cut.pieces().iter().enumerate().filter(|(_, piece)| piece.fraction < 1.0) {
            for (edge, [a, b]) in TET_EDGES.into_iter().enumerate() {
                let middle = cut.n_copies() as u32 + self.middles.of_piece[p][edge];
                match [piece.copies[a], piece.copies[b]].map(|copy| (copy, is_far(copy))) {
                    [(far, true), (_, false)] | [(_, false), (far, true)] => middles.push([middle, far]),
                    _ => {}
                }
            }
        }
        middles.sort_unstable();
        middles.dedup();
        middles
    }

    /// Piece `p` without its mass.
    fn piece(&self, cut: &CutMesh, p: usize) -> QuadraticPiece {
        let piece = &cut.pieces()[p];
        let (e, whole) = (piece.element as usize, piece.fraction == 1.0);
        let points = match whole {
            true => quadrature::tet_degree_2(),
            false => piece_rule::piece_degree_2(&|| cut.piece_fragments(p)),
        };
        QuadraticPiece {
            nodes: self.nodes(cut, p),
            linear_gradients: cut.mesh().gradients(e),
            volume: piece.fraction * cut.mesh().volume(e),
            points,
            products: None,
        }
    }

    /// All pieces with their masses.
    fn pieces(&self, cut: &CutMesh) -> Vec<QuadraticPiece> {
        let with_mass = |p: usize| {
            let (piece, &Piece { element, fraction, .. }) = (self.piece(cut, p), &cut.pieces()[p]);
            let products = (fraction != 1.0).then(|| {
                let volume = cut.mesh().volume(element as usize);
                let M = piece_rule::piece_products(cut.piece_fragments(p));
                Box::new(M.map(|row| row.map(|m| volume * m)))
            });
            QuadraticPiece { products, ..piece }
        };
        (0..cut.pieces().len()).map(with_mass).collect()
    }

    /// Mid-edge nodes of the three edges of a face.
    fn middles(&self, corners: &[u32; 4], tet: u32, face: &[u32; 3]) -> [u32; 3] {
        let local = face.map(|n| corners.iter().position(|&c| c == n).unwrap_or(0));
        [[0, 1], [1, 2], [2, 0]].map(|[i, j]| {
            let (a, b) = (local[i].min(local[j]), local[i].max(local[j]));
            let edge = TET_EDGES.iter().position(|e| [e[0].min(e[1]), e[0].max(e[1])] == [a, b]).unwrap_or(0);
            self.mesh.tets[tet as usize][4 + edge]
        })
    }
}

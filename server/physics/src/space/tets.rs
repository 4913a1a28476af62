//! Elements on a tetrahedral mesh, with pieces and copies.

use std::any::Any;
use std::sync::Arc;

use nalgebra::Vector3;

use super::{Element, Hexahedra, LinearTets, QuadraticTets, Space};
use crate::assembly::{ElementKind, Model, ModelError, Volumetric};
use crate::cut::{
    BladeSweep, Components, CutError, CutLimits, CutMesh, CutReport, Flaws, IncisionMark, Piece, Solid,
    Surface, SweepUnderWay, Work,
};
use crate::element::{Point, Points, Simd};
use crate::material::Material;
use crate::mesh::{HexMesh, MeshError, Tet10Mesh, TetMesh};
use crate::operator::{Elastic, StiffModes, Stiffness, degenerate_elements};
use crate::skin::{Skin, SkinError, SkinSettings, SkinShape};
use crate::snap::{Nodes, SnapCut, SnapReport, Snapper};

/// Linear or quadratic tetrahedra, or hexahedra that are divided into tetrahedra. Only linear ones are cut.
#[derive(Clone, Debug)]
pub struct Tets {
    cut: CutMesh,
    element: Arc<dyn Element>,
    skin: Option<Skin>,
    /// A cut that was begun, and the positions it began with [m].
    under_way: Option<(SweepUnderWay, Vec<Vector3<f64>>)>,
    /// Degenerate linear tetrahedra of the mesh, ascending.
    degenerate: Vec<u32>,
}

impl Tets {
    /// Linear tetrahedra whose uncut or cut state is `cut`.
    pub fn linear(cut: CutMesh) -> Self {
        let degenerate = degenerate_elements(cut.mesh());
        Self { cut, element: Arc::new(LinearTets), skin: None, under_way: None, degenerate }
    }

    /// Quadratic tetrahedra on the corners of `mesh`.
    pub fn quadratic(mesh: TetMesh) -> Result<Self, MeshError> {
        mesh.check()?;
        let element = Arc::new(QuadraticTets(Tet10Mesh::new(&mesh)));
        Self::with_element(mesh, element)
    }

    /// Trilinear hexahedra.
    pub fn hexahedra(mesh: HexMesh) -> Result<Self, MeshError> {
        mesh.check()?;
        Self::with_element(mesh.to_tets(), Arc::new(Hexahedra(mesh)))
    }

    fn with_element(mesh: TetMesh, element: Arc<dyn Element>) -> Result<Self, MeshError> {
        let cut = CutMesh::new(mesh)?;
        Ok(Self { cut, element, skin: None, under_way: None, degenerate: Vec::new() })
    }

    /// Whether the signs of a sweep are exact; see [`CutMesh::set_exact`].
    #[doc(hidden)]
    pub fn set_exact(&mut self, exact: bool) {
        self.cut.set_exact(exact);
    }

    fn renew_skin(&mut self) {
        if let Some(skin) = &mut self.skin {
            skin.follow(&self.cut);
        }
    }
}

impl Points for Tets {
    fn for_points(&self, x: &[Vector3<f64>], visit: &mut dyn FnMut(Point<'_>)) {
        self.element.for_points(&self.cut, x, visit);
    }
}

impl Space for Tets {
    fn kind(&self) -> ElementKind {
        self.element.kind()
    }

    fn n_elements(&self) -> usize {
        self.element.n_elements(self.cut.mesh())
    }

    fn n_nodes(&self) -> usize {
        self.element.n_nodes(self.cut.mesh())
    }

    fn node_of_copy(&self) -> &[u32] {
        self.cut.copy_node()
    }

    fn copies_with_node(&self, node: u32) -> Vec<u32> {
        self.cut.copies_with_node(node)
    }

    fn rest_positions(&self) -> Vec<Vector3<f64>> {
        self.element.rest_positions(&self.cut)
    }

    fn copy_volumes(&self) -> &[f64] {
        self.cut.copy_volume()
    }

    fn areas(&self, selected: &[bool]) -> Vec<f64> {
        self.element.areas(self.cut.mesh(), selected)
    }

    fn volumes(&self, selected: &[bool]) -> Vec<f64> {
        self.element.volumes(self.cut.mesh(), selected)
    }

    fn mesh(&self) -> &TetMesh {
        self.cut.mesh()
    }

    fn pieces(&self) -> &[Piece] {
        self.cut.pieces()
    }

    fn has_changed(&self) -> bool {
        !self.cut.changed_pieces().is_empty()
    }

    fn for_changed_groups(&self, visit: &mut dyn FnMut(&[u32])) {
        self.cut.changed_pieces().iter().for_each(|&p| visit(&self.cut.pieces()[p as usize].copies));
    }

    fn for_groups_around(&self, copy: u32, visit: &mut dyn FnMut(&[u32])) {
        self.cut.tets_around(copy).iter().for_each(|copies| visit(copies));
    }

    fn piece_volumes(&self, p: usize) -> [f64; 4] {
        self.cut.piece_node_volume(p)
    }

    fn element_of(&self, p: usize) -> usize {
        self.element.element_of(p)
    }

    fn piece_at(&self, tet: u32, barycentric: [f64; 4]) -> u32 {
        self.cut.piece_at(tet, barycentric)
    }

    fn carriers(&self, tet: u32, copies: [u32; 4], weights: [f64; 4]) -> Vec<(u32, f64)> {
        self.element.carriers(tet, copies, weights)
    }

    fn for_groups(&self, visit: &mut dyn FnMut(&[u32])) {
        self.element.for_groups(&self.cut, visit);
    }

    fn components(&self) -> Components {
        self.cut.components()
    }

    fn solid(&self) -> Solid {
        self.cut.solid()
    }

    fn flaws(&self) -> Flaws {
        Flaws::of(&self.cut)
    }

    fn epoch(&self) -> u32 {
        self.cut.epoch()
    }

    fn set_epoch(&mut self, epoch: u32) {
        self.cut.set_epoch(epoch);
        if let Some(skin) = &mut self.skin {
            skin.set_epoch(epoch);
        }
    }

    fn surface(&self) -> &Surface {
        self.skin.as_ref().map_or(self.cut.surface(), Skin::surface)
    }

    fn element_surface(&self) -> &Surface {
        self.cut.surface()
    }

    fn incision_marks(&self) -> Vec<IncisionMark> {
        match &self.skin {
            Some(skin) => skin.incision_marks(&self.cut),
            None => self.cut.incision_marks(),
        }
    }

    fn skin(&self) -> Option<&Skin> {
        self.skin.as_ref()
    }

    fn put_on_skin(&mut self, settings: SkinSettings, shape: &mut SkinShape<'_>) -> Result<(), SkinError> {
        self.skin = Some(Skin::new(&self.cut, settings, shape)?);
        Ok(())
    }

    fn spoil_skin(&mut self) {
        self.skin.iter_mut().for_each(Skin::spoil);
    }

    fn cut(&mut self, x: &[Vector3<f64>], blade: &BladeSweep, incision: u32) -> Result<CutReport, CutError> {
        let report = self.cut.sweep(x, blade, incision)?;
        self.renew_skin();
        Ok(report)
    }

    fn begin_cut(&mut self, x: &[Vector3<f64>], blade: &BladeSweep, incision: u32) -> Result<(), CutError> {
        let mesh = self.cut.mesh();
        let limits = CutLimits::of_mesh(mesh.tets.len(), mesh.nodes.len());
        let sweep = self.cut.begin_sweep(x, blade, incision, limits)?;
        self.under_way = Some((sweep, x.to_vec()));
        Ok(())
    }

    fn go_on_cutting(&mut self, work: &mut Work) -> Option<CutReport> {
        let (mut sweep, x) = self.under_way.take()?;
        if !self.cut.detect(&x, &mut sweep, work) {
            self.under_way = Some((sweep, x));
            return None;
        }
        let report = self.cut.complete(sweep, work);
        self.renew_skin();
        Some(report)
    }

    fn is_being_cut(&self) -> bool {
        self.under_way.is_some()
    }

    fn cut_along_faces(
        &mut self,
        snapper: &mut Snapper,
        nodes: Nodes<'_>,
        blade: &BladeSweep,
        incision: u32,
    ) -> Result<(SnapReport, Option<SnapCut>), CutError> {
        snapper.cut(&mut self.cut, nodes, blade, incision)
    }

    fn reset(&mut self) -> Result<(), MeshError> {
        self.under_way = None;
        self.cut.reset()?;
        self.renew_skin();
        Ok(())
    }

    fn boxed_clone(&self) -> Box<dyn Space> {
        Box::new(Self { under_way: None, ..self.clone() })
    }

    fn stiffness(&self, portable: bool) -> Option<Box<dyn Stiffness>> {
        let simd = if portable { Simd::Baseline } else { Simd::detect() };
        let elastic = || Elastic::new(simd, self.cut.mesh(), self.cut.pieces(), self.cut.n_copies());
        (self.kind() == ElementKind::Tet4).then(|| Box::new(elastic()) as Box<dyn Stiffness>)
    }

    fn follow_stiffness(&self, stiffness: &mut dyn Stiffness) {
        if let Some(elastic) = (stiffness as &mut dyn Any).downcast_mut::<Elastic>() {
            let Self { cut, .. } = self;
            elastic.follow(cut.mesh(), cut.pieces(), cut.changed_pieces(), cut.n_copies());
        }
    }

    fn stiff_modes(&self) -> Option<StiffModes> {
        let Self { cut, degenerate, .. } = self;
        StiffModes::new(cut.mesh(), cut.pieces(), cut.n_copies(), degenerate)
    }

    fn model(&self, material: &Material, volumetric: Volumetric) -> Result<Model, ModelError> {
        self.element.model(&self.cut, material, volumetric)
    }

    fn follow_model(&self, model: &mut Model, _: &Material) {
        model.follow_cut(&self.cut);
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::mesh::{BoxPattern, box_hexes, box_mesh};

    const SIZE: Vector3<f64> = Vector3::new(1.0, 2.0, 3.0);

    fn spaces() -> [Tets; 3] {
        let tets = box_mesh(Vector3::zeros(), SIZE, [2, 2, 3], BoxPattern::Tet6);
        let hexes = box_hexes(Vector3::zeros(), SIZE, [2, 2, 3]);
        let linear = Tets::linear(CutMesh::new(tets.clone()).unwrap());
        [linear, Tets::quadratic(tets).unwrap(), Tets::hexahedra(hexes).unwrap()]
    }

    #[test]
    fn loads_on_a_face_have_its_area_and_its_middle() {
        for space in spaces() {
            let rest = space.rest_positions();
            let top: Vec<bool> = rest.iter().map(|X| X.z > 3.0 - 1e-9).collect();
            let area = space.areas(&top);
            assert!((area.iter().sum::<f64>() - 2.0).abs() < 1e-12, "{:?}", space.kind());
            let middle: Vector3<f64> = area.iter().zip(&rest).map(|(a, X)| *a * X).sum();
            assert!((middle / 2.0 - Vector3::new(0.5, 1.0, 3.0)).norm() < 1e-12, "{:?}", space.kind());
        }
    }

    #[test]
    fn shape_functions_and_quadrature_points_fill_the_volume() {
        for space in spaces() {
            let rest = space.rest_positions();
            let volume: f64 = space.volumes(&vec![true; rest.len()]).iter().sum();
            let (mut weights, mut nodes) = (0.0, 0);
            space.for_points(&rest, &mut |point| {
                weights += point.weight;
                assert!((point.F - nalgebra::Matrix3::identity()).norm() < 1e-12);
            });
            space.for_groups(&mut |group| nodes += group.len());
            assert!((volume - 6.0).abs() < 1e-12 && (weights - 6.0).abs() < 1e-12, "{:?}", space.kind());
            assert_eq!(nodes, space.n_elements() * space.kind().nodes());
        }
    }

    #[test]
    fn carriers_reproduce_the_point_they_carry() {
        for space in spaces() {
            let (rest, mesh) = (space.rest_positions(), space.mesh());
            for (e, tet) in mesh.tets.iter().enumerate().step_by(7) {
                let weights = [0.1, 0.2, 0.3, 0.4];
                let X: Vector3<f64> = mesh.corners(e).iter().zip(weights).map(|(X, w)| w * X).sum();
                let carriers = space.carriers(e as u32, *tet, weights);
                let found: Vector3<f64> = carriers.iter().map(|(n, N)| *N * rest[*n as usize]).sum();
                assert!((found - X).norm() < 1e-12, "{:?} {e}", space.kind());
            }
        }
    }
}

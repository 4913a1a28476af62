//! Elements on a tetrahedral mesh, with pieces and copies.

use std::any::Any;
use std::sync::Arc;

use nalgebra::Vector3;
use scindo_algebra::assembly::{Model, ModelError, Volumetric};
use scindo_algebra::operator::cells::CellStiffness;
use scindo_algebra::operator::{Elastic, StiffModes, Stiffness, degenerate_elements};
use scindo_algebra::solver::multigrid::Hierarchy;
use scindo_matter::cut::remesh::{Nodes, SnapCut, SnapReport, Snapper};
use scindo_matter::cut::{
    BladeSweep, Components, CutError, CutLimits, CutMesh, CutReport, Flaws, FrontRule, IncisionMark, Piece,
    Solid, Surface, SweepUnderWay, Work, swept_area,
};
use scindo_matter::element::ElementKind;
use scindo_matter::element::{MaterialPoint, Point, Points, Simd};
use scindo_matter::material::{Lame, Material, Region, Regions, RegionsError};
use scindo_matter::mesh::{HexMesh, MeshError, TetMesh};
use scindo_matter::octree::Octree;
use scindo_matter::skin::{OwnSurface, Skin, SkinError, SkinSettings, SkinShape};
use scindo_matter::team::Team;

use super::deepest::{self, Bounds, deepest_of};
use super::{Element, Hexahedra, LinearTets, QuadraticTets, RestPoint, Space, VisitPiece};

/// Distance, relative to the element, by which a point is moved towards its side before its piece is looked
/// up. Far above rounding, far below any piece that can be seen.
const SIDE_STEP: f64 = 1e-6;

/// Distance outside an element at which a point still counts as inside, in barycentric units.
const INSIDE: f64 = 1e-9;

/// Bytes per piece, surface triangle and skin triangle, measured on the demonstration's organ and rounded
/// up.
const PIECE_BYTES: usize = 2000;
const TRIANGLE_BYTES: usize = 400;

/// Linear or quadratic tetrahedra, which are cut, or hexahedra that are divided into tetrahedra.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct Tets {
    pub(super) cut: CutMesh,
    #[serde(with = "super::saved_element")]
    element: Arc<dyn Element>,
    skin: Option<Skin>,
    /// A cut that was begun, and the positions it began with [m].
    under_way: Option<(SweepUnderWay, Vec<Vector3<f64>>)>,
    /// Degenerate linear tetrahedra of the mesh, ascending.
    degenerate: Vec<u32>,
    /// Regions of other materials, by element.
    regions: Regions,
}

impl Tets {
    /// Linear tetrahedra whose uncut or cut state is `cut`.
    pub fn linear(cut: CutMesh) -> Self {
        let degenerate = degenerate_elements(cut.mesh());
        let (element, regions) = (Arc::new(LinearTets), Regions::default());
        Self { cut, element, skin: None, under_way: None, degenerate, regions }
    }

    /// Quadratic tetrahedra on the corners of `mesh`.
    pub fn quadratic(mesh: TetMesh) -> Result<Self, MeshError> {
        mesh.check()?;
        let cut = CutMesh::new(mesh)?;
        let element = Arc::new(QuadraticTets::new(&cut));
        Ok(Self::with_element(cut, element))
    }

    /// Trilinear hexahedra.
    pub fn hexahedra(mesh: HexMesh) -> Result<Self, MeshError> {
        mesh.check()?;
        Ok(Self::with_element(CutMesh::new(mesh.to_tets())?, Arc::new(Hexahedra(mesh))))
    }

    fn with_element(cut: CutMesh, element: Arc<dyn Element>) -> Self {
        let (degenerate, regions) = (Vec::new(), Regions::default());
        Self { cut, element, skin: None, under_way: None, degenerate, regions }
    }

    /// Gives elements of other materials theirs; `regions` has one entry per element.
    ///
    /// # Errors
    /// Another number of elements.
    pub fn set_regions(&mut self, regions: Regions) -> Result<(), RegionsError> {
        regions.check_length(self.n_elements())?;
        self.regions = regions;
        Ok(())
    }

    /// Regions of other materials, by element.
    pub fn regions(&self) -> &Regions {
        &self.regions
    }

    fn regions_of_pieces(&self) -> Regions {
        self.regions.of_pieces(self.cut.pieces().iter().map(|piece| piece.element))
    }

    /// Equal cubes as cells of an octree.
    fn cubes(&self) -> Option<Octree> {
        let mut cubes = self.element.cubes()?;
        cubes.set_materials(&self.regions);
        Some(cubes)
    }

    /// Whether the signs of a sweep are exact; see [`CutMesh::set_exact`].
    #[doc(hidden)]
    pub fn set_exact(&mut self, exact: bool) {
        self.cut.set_exact(exact);
    }

    /// Says how far incisions go on ahead of the blade.
    pub fn set_front_rule(&mut self, rule: FrontRule) {
        self.cut.set_front_reach(rule.reach(self.kind()));
    }

    /// Whether these are linear tetrahedra.
    pub fn is_linear(&self) -> bool {
        self.kind() == ElementKind::Tet4
    }

    /// Whether every piece of a tetrahedron is a finite element; six tetrahedra make a hexahedron.
    fn pieces_are_elements(&self) -> bool {
        self.kind() != ElementKind::Hex8
    }

    /// The tetrahedra at rest that are cut and drawn: the elements, or six for every hexahedron. Only cuts
    /// along faces change them.
    pub fn mesh(&self) -> &TetMesh {
        self.cut.mesh()
    }

    /// Material pieces of the tetrahedra of [`mesh`](Self::mesh). Ids are stable; cuts append.
    pub fn pieces(&self) -> &[Piece] {
        self.cut.pieces()
    }

    /// ∫ N_a dV [m³] over piece `p`, for its four copies.
    pub fn piece_volumes(&self, p: usize) -> [f64; 4] {
        self.cut.piece_node_volume(p)
    }

    /// The piece of tetrahedron `tet` that holds the point with these barycentric coordinates.
    pub fn piece_at(&self, tet: u32, barycentric: [f64; 4]) -> u32 {
        self.cut.piece_at(tet, barycentric)
    }

    /// Finds a material point again after the mesh was replaced: in the tetrahedron in which it lies deepest.
    pub fn locate_again(&self, point: &RestPoint) -> RestPoint {
        let element = deepest(self.cut.mesh(), point.rest_m + point.towards_m) as u32;
        RestPoint { element, ..*point }
    }

    /// Finds the mesh that a cut along its faces makes of this one, for `snapper` and the state of its nodes;
    /// `None` if nothing comes apart yet. The mesh itself stays.
    pub fn cut_along_faces(
        &mut self,
        snapper: &mut Snapper,
        nodes: Nodes<'_>,
        blade: &BladeSweep,
        incision: u32,
    ) -> Result<(SnapReport, Option<SnapCut>), CutError> {
        snapper.cut(&mut self.cut, nodes, blade, incision)
    }

    /// Follows a cut with skin and added nodes.
    fn follow_cut(&mut self, mut report: CutReport) -> CutReport {
        if let Some((element, new)) = self.element.follow_cut(&self.cut) {
            self.element = element;
            report.new_copies.extend(new);
        }
        self.renew_skin();
        report
    }

    fn renew_skin(&mut self) {
        if let Some(skin) = &mut self.skin {
            skin.follow(&self.cut);
        }
    }
}

impl Points for Tets {
    fn for_points(&self, x: &[Vector3<f64>], visit: &mut dyn FnMut(Point<'_>)) {
        if self.regions.is_empty() {
            return self.element.for_points(&self.cut, x, visit);
        }
        let (pieces, of_pieces) = (self.cut.pieces(), self.pieces_are_elements());
        self.element.for_points(&self.cut, x, &mut |point| {
            let element = if of_pieces { pieces[point.element].element as usize } else { point.element };
            visit(Point { region: self.regions.of(element), ..point });
        });
    }

    fn regions(&self) -> &[Region] {
        self.regions.constants()
    }
}

impl Space for Tets {
    fn kind(&self) -> ElementKind {
        self.element.kind()
    }

    fn can_be_cut(&self) -> bool {
        self.pieces_are_elements()
    }

    fn can_carry_skin(&self, _own: bool) -> bool {
        self.is_linear()
    }

    fn skin_ground(&self) -> (Vec<Vector3<f64>>, Vec<[u32; 3]>) {
        let mesh = self.mesh();
        (mesh.nodes.clone(), mesh.boundary_faces().iter().map(|face| face.nodes).collect())
    }

    fn tets(&self) -> Option<&Tets> {
        Some(self)
    }

    fn tets_mut(&mut self) -> Option<&mut Tets> {
        Some(self)
    }

    fn bounds(&self) -> [Vector3<f64>; 2] {
        self.cut.mesh().bounds()
    }

    fn element_size(&self) -> f64 {
        // The mesh that is cut has six tetrahedra for every hexahedron.
        self.cut.cell_m()
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

    fn n_added(&self) -> usize {
        self.element.n_added()
    }

    fn node_of(&self, number: u32) -> u32 {
        let added = || self.element.node_of_added(number as usize - self.cut.n_copies());
        self.cut.copy_node().get(number as usize).copied().unwrap_or_else(added)
    }

    fn first_copy(&self, node: u32) -> u32 {
        let n_corners = self.cut.mesh().nodes.len() as u32;
        if node < n_corners { node } else { self.cut.n_copies() as u32 + (node - n_corners) }
    }

    fn copies_with_node(&self, node: u32) -> Vec<u32> {
        if (node as usize) < self.cut.mesh().nodes.len() {
            return self.cut.copies_with_node(node);
        }
        let mut added = self.element.added_with_node(&self.cut, node);
        added.iter_mut().for_each(|number| *number += self.cut.n_copies() as u32);
        added
    }

    fn added_volumes(&self) -> &[f64] {
        self.element.added_volumes()
    }

    fn rest_positions(&self) -> Vec<Vector3<f64>> {
        self.element.rest_positions(&self.cut)
    }

    fn copy_volumes(&self) -> &[f64] {
        self.cut.copy_volume()
    }

    fn copy_masses(&self, density_kg_m3: f64) -> Vec<f64> {
        if !self.regions.is_empty() && self.is_linear() {
            let mut mass = vec![0.0; self.cut.n_copies()];
            for (p, piece) in self.cut.pieces().iter().enumerate() {
                let relative = self.regions.relative_density(piece.element as usize, density_kg_m3);
                for (&copy, volume) in piece.copies.iter().zip(self.cut.piece_node_volume(p)) {
                    mass[copy as usize] += relative * density_kg_m3 * volume;
                }
            }
            return mass;
        }
        if !self.regions.is_empty()
            && let Some(cubes) = self.cubes()
        {
            return cubes.vertex_masses(density_kg_m3);
        }
        if self.kind() == ElementKind::Hex8 {
            // The tetrahedra that a hexahedron is split into share it unevenly among its corners.
            let all = vec![true; self.cut.n_copies()];
            return self.volumes(&all).iter().map(|v| density_kg_m3 * v).collect();
        }
        self.copy_volumes().iter().map(|v| density_kg_m3 * v).collect()
    }

    fn areas(&self, selected: &[bool]) -> Vec<f64> {
        self.element.areas(self.cut.mesh(), selected)
    }

    fn for_skin_faces(&self, selected: &[bool], visit: &mut dyn FnMut(&[MaterialPoint])) {
        self.element.for_skin_faces(&self.cut, &|copy| selected[self.node_of(copy) as usize], visit);
    }

    fn volumes(&self, selected: &[bool]) -> Vec<f64> {
        self.element.volumes(self.cut.mesh(), selected)
    }

    fn n_pieces(&self) -> usize {
        if self.pieces_are_elements() { self.cut.pieces().len() } else { self.n_elements() }
    }

    fn for_pieces(&self, visit: &mut VisitPiece<'_>) {
        for (p, piece) in self.cut.pieces().iter().enumerate() {
            visit(self.element.element_of(p), &piece.copies, &self.cut.piece_node_volume(p));
        }
    }

    fn for_groups(&self, visit: &mut dyn FnMut(&[u32])) {
        self.element.for_groups(&self.cut, visit);
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

    fn locate(&self, point: Vector3<f64>, side: Option<Vector3<f64>>) -> Option<RestPoint> {
        let mesh = self.cut.mesh();
        let step = |side: Vector3<f64>| side.normalize() * (SIDE_STEP * mean_edge(mesh));
        let towards_m = side.map_or(Vector3::zeros(), step);
        let element = element_at(mesh, point + towards_m).or_else(|| element_at(mesh, point))?;
        Some(RestPoint { rest_m: point, towards_m, element: element as u32 })
    }

    fn material_at(
        &mut self,
        x: &[Vector3<f64>],
        points: &[Vector3<f64>],
        found: &mut Vec<Option<MaterialPoint>>,
    ) {
        found.clear();
        let Some(bounds) = Bounds::of(points) else { return };
        self.cut.pieces_near(x, &bounds);
        let (cut, near) = (&self.cut, self.cut.candidates());
        found.extend(points.iter().map(|point| {
            deepest_of(near.iter().map(|&p| cut.pieces()[p as usize].copies), x, point, |k, inside| {
                let piece = near[k];
                cut.piece_at(cut.pieces()[piece as usize].element, inside) == piece
            })
        }));
    }

    fn carriers(&self, point: &RestPoint) -> Vec<(u32, f64)> {
        let corners = self.cut.mesh().corners(point.element as usize);
        let lookup = barycentric(&corners, point.rest_m + point.towards_m);
        let piece = self.cut.piece_at(point.element, lookup);
        self.element.carriers(&self.cut, piece, barycentric(&corners, point.rest_m))
    }

    fn components(&self) -> Components {
        self.cut.components()
    }

    fn solid(&self) -> Solid {
        let mut solid = self.cut.solid();
        for cell in &mut solid.origins {
            cell.stress = self.element.element_of(cell.piece as usize) as u32;
        }
        solid
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

    fn put_on_skin(
        &mut self,
        settings: SkinSettings,
        own: Option<&OwnSurface<'_>>,
        shape: &mut SkinShape<'_>,
    ) -> Result<(), SkinError> {
        self.skin = Some(Skin::new(&self.cut, settings, own, shape)?);
        Ok(())
    }

    fn spoil_skin(&mut self) {
        self.skin.iter_mut().for_each(Skin::spoil);
    }

    fn swept_area(&self, x: &[Vector3<f64>], blade: &BladeSweep) -> f64 {
        let mut seen = vec![false; self.cut.mesh().tets.len()];
        let first_of_element = |p: &&Piece| !std::mem::replace(&mut seen[p.element as usize], true);
        let pieces = self.cut.pieces().iter().filter(first_of_element);
        let tets: Vec<[u32; 4]> = pieces.map(|piece| piece.copies).collect();
        swept_area(&tets, x, blade)
    }

    fn cut(
        &mut self,
        _: &mut Team,
        x: &[Vector3<f64>],
        blade: &BladeSweep,
        incision: u32,
    ) -> Result<CutReport, CutError> {
        let report = self.cut.sweep(&x[..self.cut.n_copies()], blade, incision)?;
        Ok(self.follow_cut(report))
    }

    fn begin_cut(
        &mut self,
        _: &mut Team,
        x: &[Vector3<f64>],
        blade: &BladeSweep,
        incision: u32,
    ) -> Result<(), CutError> {
        let mesh = self.cut.mesh();
        let limits = CutLimits::of_mesh(mesh.tets.len(), mesh.nodes.len());
        let x = &x[..self.cut.n_copies()];
        let sweep = self.cut.begin_sweep(x, blade, incision, limits)?;
        self.under_way = Some((sweep, x.to_vec()));
        Ok(())
    }

    fn go_on_cutting(&mut self, _: &mut Team, work: &mut Work) -> Option<CutReport> {
        let (mut sweep, x) = self.under_way.take()?;
        if !self.cut.detect(&x, &mut sweep, work) {
            self.under_way = Some((sweep, x));
            return None;
        }
        let report = self.cut.complete(&x, sweep, work);
        Some(self.follow_cut(report))
    }

    fn is_being_cut(&self) -> bool {
        self.under_way.is_some()
    }

    fn reset(&mut self) -> Result<(), MeshError> {
        self.under_way = None;
        self.cut.reset()?;
        if let Some(element) = self.element.uncut(&self.cut) {
            self.element = element;
        }
        self.renew_skin();
        Ok(())
    }

    fn boxed_clone(&self) -> Box<dyn Space> {
        Box::new(Self { under_way: None, ..self.clone() })
    }

    fn bytes(&self) -> usize {
        let skin = self.skin.as_ref().map_or(0, |skin| skin.surface().triangles.len());
        PIECE_BYTES * self.cut.pieces().len() + TRIANGLE_BYTES * (skin + self.cut.surface().triangles.len())
    }

    fn stiffness(&self, simd: Simd) -> Option<Box<dyn Stiffness>> {
        let simd = simd.min(Simd::detect());
        let mesh = (self.cut.mesh(), &self.regions);
        let elastic = || Elastic::with_regions(simd, mesh, self.cut.pieces(), self.cut.n_copies());
        if let Some(cubes) = self.cubes() {
            let lame: Vec<Lame> = self.regions.constants().iter().map(Region::lame).collect();
            return Some(Box::new(CellStiffness::new(simd, &cubes, &lame)));
        }
        self.is_linear().then(|| Box::new(elastic()) as Box<dyn Stiffness>)
    }

    fn is_of_cubes(&self) -> bool {
        self.element.cubes().is_some()
    }

    fn hierarchy(&self, least: usize) -> Option<Hierarchy> {
        self.cubes().map(|cubes| Hierarchy::with_level(&cubes, least))
    }

    fn follow_stiffness(&self, stiffness: &mut dyn Stiffness) {
        if let Some(elastic) = (stiffness as &mut dyn Any).downcast_mut::<Elastic>() {
            let Self { cut, .. } = self;
            elastic.follow(cut.mesh(), cut.pieces(), cut.changed_pieces(), cut.n_copies());
        }
    }

    fn stiff_modes(&self) -> Option<StiffModes> {
        let Self { cut, degenerate, .. } = self;
        if !self.is_linear() {
            return self.element.modes(cut);
        }
        StiffModes::new(cut.mesh(), cut.pieces(), cut.n_copies(), degenerate)
    }

    fn model(&self, material: &Material, volumetric: Volumetric) -> Result<Model, ModelError> {
        let model = self.element.model(&self.cut, material, volumetric)?;
        match self.kind() {
            ElementKind::Tet4 => model.with_regions_of_tets(&self.cut, &self.regions),
            ElementKind::Tet10 => model.with_regions(self.regions_of_pieces()),
            _ => model.with_regions(self.regions.clone()),
        }
    }

    fn follow_model(&self, model: &mut Model, _: &Material) {
        if self.is_linear() {
            model.follow_cut(&self.cut, &self.regions);
        } else {
            self.element.follow_model(model, &self.cut, self.regions_of_pieces());
        }
    }
}

/// Mean edge length [m] of an element, from the mean volume.
fn mean_edge(mesh: &TetMesh) -> f64 {
    let volume: f64 = mesh.volumes().iter().sum();
    (6.0 * volume / mesh.tets.len().max(1) as f64).cbrt()
}

/// The tetrahedron that contains a point, if any.
fn element_at(mesh: &TetMesh, point: Vector3<f64>) -> Option<usize> {
    let element = deepest(mesh, point);
    (depth(mesh, point, element) >= -INSIDE).then_some(element)
}

/// The tetrahedron in which a point lies deepest; of equals the first.
fn deepest(mesh: &TetMesh, point: Vector3<f64>) -> usize {
    let all = (0..mesh.tets.len()).map(|e| (depth(mesh, point, e), e));
    all.max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1))).map_or(0, |(_, e)| e)
}

/// Smallest barycentric coordinate of a point in tetrahedron `e`.
fn depth(mesh: &TetMesh, point: Vector3<f64>, e: usize) -> f64 {
    barycentric(&mesh.corners(e), point).into_iter().fold(f64::INFINITY, f64::min)
}

fn barycentric(x: &[Vector3<f64>; 4], point: Vector3<f64>) -> [f64; 4] {
    deepest::barycentric(x, &point).unwrap_or([f64::NEG_INFINITY; 4])
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use scindo_matter::mesh::{BoxPattern, box_hexes, box_mesh};

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
    fn pieces_fill_the_volume_and_the_solid_tells_their_elements() {
        for space in spaces() {
            let (mut volume, mut elements) = (0.0, 0);
            space.for_pieces(&mut |element, copies, volumes| {
                assert_eq!(copies.len(), volumes.len());
                volume += volumes.iter().sum::<f64>();
                elements = elements.max(element + 1);
            });
            assert!((volume - 6.0).abs() < 1e-12 && elements == space.n_elements(), "{:?}", space.kind());
            let origins = space.solid().origins;
            assert_eq!(origins.iter().map(|cell| cell.stress).max(), Some(elements as u32 - 1));
        }
    }

    #[test]
    fn carriers_reproduce_the_point_they_carry() {
        for space in spaces() {
            let (rest, mesh) = (space.rest_positions(), space.mesh());
            for e in (0..mesh.tets.len()).step_by(7) {
                let weights = [0.1, 0.2, 0.3, 0.4];
                let X: Vector3<f64> = mesh.corners(e).iter().zip(weights).map(|(X, w)| w * X).sum();
                let point = space.locate(X, None).unwrap();
                assert_eq!(point.element, e as u32);
                let carriers = space.carriers(&point);
                let found: Vector3<f64> = carriers.iter().map(|(n, N)| *N * rest[*n as usize]).sum();
                assert!((found - X).norm() < 1e-12, "{:?} {e}", space.kind());
            }
        }
    }
}

//! The octree as a discretisation of a body.

mod adapt;
mod skin_faces;

pub use adapt::OctreeRefinement;

use std::any::Any;
use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::Vector3;

use crate::space::deepest::{Bounds, deepest_of};
use crate::space::{RestPoint, Space, VisitPiece};
use scindo_algebra::assembly::{Model, ModelError, Volumetric};
use scindo_algebra::operator::cells::CellStiffness;
use scindo_algebra::operator::{StiffModes, Stiffness};
use scindo_algebra::solver::multigrid::Hierarchy;
use scindo_matter::cut::{
    BladeSweep, BorderEdge, Borders, Components, CutError, CutReport, Flaws, Front, IncisionMark, JoinSizes,
    NewCopy, Solid, Surface, Surroundings, Work, border_edges, sweep_from_behind, swept_area,
};
use scindo_matter::element::ElementKind;
use scindo_matter::element::{MaterialPoint, Point, Points, Simd};
use scindo_matter::material::{Lame, Material, Region};
use scindo_matter::mesh::MeshError;
use scindo_matter::octree::near::{LeafRuns, VertexBoxes};
use scindo_matter::octree::{
    CutLink, LinkKey, OUTSIDE, Octree, OctreeChange, OctreeSurface, OwnSkin, swept_box,
};
use scindo_matter::skin::{Kept, OwnSurface, Skin, SkinError, SkinSettings, SkinShape};
use scindo_matter::team::Team;

/// Most leaves that cuts by clients may make of one.
const MOST_GROWTH: usize = 8;
/// Links that cost as much work as one fragment of a tetrahedron.
const LINKS_PER_FRAGMENT: usize = 4;

/// Corners of six tetrahedra that fill a cube.
const TETS_OF_CUBE: [[u32; 4]; 6] =
    [[0, 1, 3, 7], [0, 1, 5, 7], [0, 2, 3, 7], [0, 2, 6, 7], [0, 4, 5, 7], [0, 4, 6, 7]];
/// Bytes per triangle of the surface.
const TRIANGLE_BYTES: usize = 100;
/// Distance, in finest cells, by which a point is moved towards its side before its cell is looked up.
const SIDE_STEP: f64 = 1e-6;
/// Distance, in finest cells, by which a sweep begins behind the last one of its incision. A link between two centres is
/// straight and no line of the material, so it may pass the front where the body deforms.
const BEHIND: f64 = 0.25;

/// The links that a sweep crosses, and the earlier incisions that it joins.
type Crossed = (Vec<(LinkKey, CutLink)>, Vec<u32>);

/// An octree that is cut, with everything that a body asks of it.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct OctreeSpace {
    pub(crate) octree: Octree,
    /// The uncut state.
    initial: Arc<Octree>,
    /// The first vertex at the lattice point of each vertex.
    node_of_copy: Vec<u32>,
    volumes: Vec<f64>,
    /// Leaves that the last cut changed.
    changed: Vec<u32>,
    /// Vertices whose volume the last cut changed.
    reweighed: Vec<u32>,
    /// Whether the last change was a cut, which leaves the numbers of all earlier leaves.
    only_cut: bool,
    fronts: BTreeMap<u32, Front>,
    borders: Borders,
    pub(crate) surface: OctreeSurface,
    /// The skin of the triangles of a surface, if the body has one.
    pub(crate) own: Option<OwnSkin>,
    epoch: u32,
    under_way: Option<Crossed>,
    /// Made by the first cut after leaves got other numbers.
    #[serde(skip)]
    runs: Option<LeafRuns>,
}

impl OctreeSpace {
    /// The uncut state of `octree`.
    pub fn new(octree: Octree) -> Self {
        let n = octree.n_vertices() as u32;
        let mut space = Self {
            initial: Arc::new(octree.clone()),
            octree,
            node_of_copy: (0..n).collect(),
            volumes: Vec::new(),
            changed: Vec::new(),
            reweighed: Vec::new(),
            only_cut: false,
            fronts: BTreeMap::new(),
            borders: Borders::default(),
            surface: OctreeSurface::default(),
            own: None,
            epoch: 0,
            under_way: None,
            runs: None,
        };
        space.renew();
        space
    }

    /// The cells, links and vertices.
    pub fn octree(&self) -> &Octree {
        &self.octree
    }

    /// The octree and the leaves that the last change of it changed, ascending, if that was a cut: all others have
    /// their numbers from before.
    pub fn last_cut(&self) -> Option<(&Octree, &[u32])> {
        self.only_cut.then_some((&self.octree, &self.changed[..]))
    }

    fn renew(&mut self) {
        self.runs = None;
        self.volumes = self.octree.vertex_volumes();
        self.surface = OctreeSurface::build(&self.octree);
        if let Some(own) = &mut self.own {
            own.begin_anew(&self.octree, &self.surface);
        }
    }

    /// Remembers the last position of the blade, and the `edges` of its sweep, by the material around them. `leaves`
    /// are all near the box `swept`.
    fn remember(
        &mut self,
        blade: &BladeSweep,
        edges: &[BorderEdge],
        incision: u32,
        vertices: &VertexBoxes<'_>,
        (leaves, swept): (&[u32], &[Vector3<f64>; 2]),
    ) {
        let x = vertices.positions();
        let Some(last) = blade.segments.last() else { return };
        let edge = [last[0].inf(&last[1]), last[0].sup(&last[1])];
        // The sweep ends at the last position, unless it has no triangles yet.
        let near = if (0..3).all(|k| swept[0][k] <= edge[0][k] && edge[1][k] <= swept[1][k]) {
            self.octree.leaves_near_of(leaves, x, &edge)
        } else {
            self.leaves_near(vertices, &edge)
        };
        let near: Vec<[u32; 4]> = near.into_iter().flat_map(|id| self.tets_of(id)).collect();
        let around = |vertex: u32| {
            let mut tets = Vec::new();
            self.for_leaves_around(vertex, |id| tets.extend(self.tets_of(id)));
            tets
        };
        let front = Front::remember(last, &Surroundings { near: &near, around: &around, x });
        self.fronts.insert(incision, front);
        let mut borders = std::mem::take(&mut self.borders);
        let tets = |corners: &[Vector3<f64>; 2]| {
            let near = self.octree.leaves_near_of(leaves, x, corners);
            near.into_iter().flat_map(|id| self.tets_of(id)).collect()
        };
        borders.remember(edges, incision, &tets, x);
        self.borders = borders;
    }

    /// Six tetrahedra on the vertices of a leaf, which fill it where no corner hangs.
    fn tets_of(&self, id: u32) -> [[u32; 4]; 6] {
        let v = self.octree.vertices()[id as usize];
        TETS_OF_CUBE.map(|tet| tet.map(|c| v[c as usize]))
    }

    /// Calls `visit` for the leaves around the lattice point of `vertex`.
    fn for_leaves_around(&self, vertex: u32, mut visit: impl FnMut(u32)) {
        let octants = self.octree.octants(self.octree.points()[vertex as usize]);
        let mut leaves = octants.leaf;
        leaves.sort_unstable();
        let mut last = OUTSIDE;
        for leaf in leaves {
            if leaf != OUTSIDE && leaf != last {
                visit(leaf);
            }
            last = leaf;
        }
    }

    /// What a blade crosses, after the checks of a cut.
    fn search(
        &mut self,
        team: &mut Team,
        x: &[Vector3<f64>],
        blade: &BladeSweep,
        incision: u32,
    ) -> Result<Crossed, CutError> {
        blade.check()?;
        if incision == 0 {
            return Err(CutError::ReservedIncision);
        }
        let expected = self.octree.n_vertices();
        if x.len() != expected {
            return Err(CutError::PositionCount { found: x.len(), expected });
        }
        let Some(vertices) = VertexBoxes::new(team, x) else {
            let finite = |p: &Vector3<f64>| p.iter().all(|x| x.is_finite());
            let copy = x.iter().position(|p| !finite(p)).unwrap_or(0);
            return Err(CutError::NonFinitePosition { copy });
        };
        let limit = MOST_GROWTH * self.initial.cells().len() + 100_000;
        let found = self.octree.cells().len();
        if found >= limit {
            return Err(CutError::Full { what: "cells", found, limit });
        }
        let (front, cell_m) = (self.fronts.get(&incision), self.octree.lattice().h);
        let back_m = BEHIND * cell_m;
        let mut triangles = sweep_from_behind(front, blade, x, back_m);
        let edges = border_edges(front, blade, x);
        let mut joined = self.borders.join(&edges, &triangles, incision, x, JoinSizes { cell_m, back_m });
        triangles.append(&mut joined.triangles);
        let swept = swept_box(&triangles);
        let leaves = self.leaves_near(&vertices, &swept);
        let cuts = self.octree.crossed_links_in(team, &leaves, x, (&triangles, incision));
        self.remember(blade, &edges, incision, &vertices, (&leaves, &swept));
        Ok((cuts, joined.incisions))
    }

    /// Leaves that may meet the box between two corners [m] with the vertices at `x` [m], by the runs if there are any.
    fn leaves_at(&self, x: &[Vector3<f64>], bounds: &[Vector3<f64>; 2]) -> Vec<u32> {
        let by_runs = |runs: &LeafRuns| {
            let vertices = VertexBoxes::new(&mut Team::alone(), x)?;
            Some(runs.leaves_near(&self.octree, &vertices, bounds))
        };
        self.runs.as_ref().and_then(by_runs).unwrap_or_else(|| self.octree.leaves_near(x, bounds))
    }

    /// The same of a cut, which makes the runs if there are none.
    fn leaves_near(&mut self, vertices: &VertexBoxes<'_>, bounds: &[Vector3<f64>; 2]) -> Vec<u32> {
        let runs = self.runs.get_or_insert_with(|| LeafRuns::new(&self.octree));
        runs.leaves_near(&self.octree, vertices, bounds)
    }

    /// Enters the new vertices of `change`; `known` were there before.
    fn number_copies(&mut self, known: u32, change: &OctreeChange) -> Vec<NewCopy> {
        let mut new_copies = Vec::with_capacity(change.new_vertices.len());
        for (copy, between) in (known..).zip(&change.new_vertices) {
            let parent = between.main_copy();
            let split = between.copies().len() == 1;
            let between = (!split).then_some(*between);
            // Vertices that refinement made are nodes of their own.
            self.node_of_copy.push(if split { self.node_of_copy[parent as usize] } else { copy });
            new_copies.push(NewCopy { copy, parent, between });
        }
        new_copies
    }

    /// Cuts these links and brings everything up to date.
    fn open(&mut self, team: &mut Team, (cuts, joined): Crossed) -> CutReport {
        let known = self.octree.n_vertices() as u32;
        let change = self.octree.cut(&cuts);
        let new_copies = self.number_copies(known, &change);
        let Self { octree, volumes, surface, own, .. } = self;
        let mut follow_volumes = || {
            if change.links > 0 || change.divided > 0 {
                octree.follow_volumes(&change, volumes);
            }
        };
        // Another cut of a link that was cut before may show at another place.
        let shows = !change.moved.is_empty() || !change.cells.is_empty();
        let mut follow_surface = || {
            if shows {
                surface.follow(octree, &change.cells, &change.moved);
                own.iter_mut().for_each(|own| own.follow(octree, surface, &change.cells));
            }
        };
        team.run(&mut [&mut follow_volumes, &mut follow_surface]);
        if let Some(runs) = &mut self.runs {
            runs.follow(&self.octree, &change.cells);
        }
        let now = change.cells.iter().flat_map(|&id| self.octree.vertices()[id as usize]);
        let all = change.earlier.iter().flat_map(|leaf| leaf.vertices).chain(now);
        self.reweighed.clear();
        self.reweighed.extend(all);
        self.reweighed.sort_unstable();
        self.reweighed.dedup();
        self.changed = change.cells;
        self.only_cut = true;
        self.epoch += u32::from(shows);
        CutReport {
            new_copies,
            elements_cut: self.changed.len(),
            faces_opened: change.links,
            joined,
            epoch: self.epoch,
            ..CutReport::default()
        }
    }
}

impl Points for OctreeSpace {
    fn for_points(&self, x: &[Vector3<f64>], visit: &mut dyn FnMut(Point<'_>)) {
        self.octree.for_points(x, visit);
    }

    fn regions(&self) -> &[Region] {
        self.octree.regions()
    }
}

impl Space for OctreeSpace {
    fn kind(&self) -> ElementKind {
        ElementKind::Octree
    }

    fn can_be_cut(&self) -> bool {
        true
    }

    fn can_carry_skin(&self, own: bool) -> bool {
        own
    }

    fn skin_ground(&self) -> (Vec<Vector3<f64>>, Vec<[u32; 3]>) {
        (self.surface.rest().to_vec(), self.surface.ground())
    }

    fn octree(&self) -> Option<&OctreeSpace> {
        Some(self)
    }

    fn octree_mut(&mut self) -> Option<&mut OctreeSpace> {
        Some(self)
    }

    fn bounds(&self) -> [Vector3<f64>; 2] {
        self.octree.bounds()
    }

    fn element_size(&self) -> f64 {
        self.octree.lattice().h
    }

    fn n_elements(&self) -> usize {
        self.octree.cells().len()
    }

    fn n_nodes(&self) -> usize {
        self.octree.n_vertices()
    }

    fn node_of_copy(&self) -> &[u32] {
        &self.node_of_copy
    }

    fn copies_with_node(&self, node: u32) -> Vec<u32> {
        self.octree.vertices_at(node)
    }

    fn rest_positions(&self) -> Vec<Vector3<f64>> {
        self.octree.rest_positions()
    }

    fn copy_volumes(&self) -> &[f64] {
        &self.volumes
    }

    fn copy_masses(&self, density_kg_m3: f64) -> Vec<f64> {
        if self.octree.regions().is_empty() {
            return self.volumes.iter().map(|v| density_kg_m3 * v).collect();
        }
        self.octree.vertex_masses(density_kg_m3)
    }

    fn reweighed(&self) -> Option<&[u32]> {
        (self.only_cut && self.octree.regions().is_empty()).then_some(&self.reweighed[..])
    }

    fn areas(&self, selected: &[bool]) -> Vec<f64> {
        self.octree.areas(selected)
    }

    fn for_skin_faces(&self, selected: &[bool], visit: &mut dyn FnMut(&[MaterialPoint])) {
        self.for_boundary_faces(selected, visit);
    }

    fn volumes(&self, selected: &[bool]) -> Vec<f64> {
        self.volumes.iter().zip(selected).map(|(v, &chosen)| if chosen { *v } else { 0.0 }).collect()
    }

    fn for_pieces(&self, visit: &mut VisitPiece<'_>) {
        for (id, vertices) in self.octree.vertices().iter().enumerate() {
            visit(id, vertices, &self.octree.shape_integrals(id));
        }
    }

    fn for_groups(&self, visit: &mut dyn FnMut(&[u32])) {
        self.octree.vertices().iter().for_each(|vertices| visit(vertices));
    }

    fn has_changed(&self) -> bool {
        !self.changed.is_empty()
    }

    fn for_changed_groups(&self, visit: &mut dyn FnMut(&[u32])) {
        self.changed.iter().for_each(|&id| visit(&self.octree.vertices()[id as usize]));
    }

    fn for_groups_around(&self, copy: u32, visit: &mut dyn FnMut(&[u32])) {
        self.for_leaves_around(copy, |id| visit(&self.octree.vertices()[id as usize]));
    }

    fn locate(&self, point: Vector3<f64>, side: Option<Vector3<f64>>) -> Option<RestPoint> {
        let step = |side: Vector3<f64>| side.normalize() * (SIDE_STEP * self.octree.lattice().h);
        let towards_m = side.map_or(Vector3::zeros(), step);
        let (element, _) = self.octree.locate(&(point + towards_m)).or_else(|| self.octree.locate(&point))?;
        Some(RestPoint { rest_m: point, towards_m, element })
    }

    fn material_at(
        &mut self,
        x: &[Vector3<f64>],
        points: &[Vector3<f64>],
        found: &mut Vec<Option<MaterialPoint>>,
    ) {
        found.clear();
        let Some(bounds) = Bounds::of(points) else { return };
        let near = self.leaves_at(x, &bounds);
        let tets: Vec<[u32; 4]> = near.into_iter().flat_map(|id| self.tets_of(id)).collect();
        found.extend(points.iter().map(|point| deepest_of(tets.iter().copied(), x, point, |_, _| true)));
    }

    fn carriers(&self, point: &RestPoint) -> Vec<(u32, f64)> {
        let aim = point.rest_m + point.towards_m;
        let found = self.octree.locate(&aim).or_else(|| self.octree.locate(&point.rest_m));
        found.map_or_else(Vec::new, |(leaf, _)| {
            self.octree.carriers(self.octree.on_side_of_cuts(leaf, &aim), &point.rest_m)
        })
    }

    fn components(&self) -> Components {
        self.octree.components()
    }

    fn solid(&self) -> Solid {
        self.octree.solid()
    }

    fn flaws(&self) -> Flaws {
        let total: f64 = (0..self.octree.cells().len()).map(|id| self.octree.cell_volume(id)).sum();
        let copies: f64 = self.volumes.iter().sum();
        Flaws {
            surface: self.surface().n_defects(),
            volume: (copies / total - 1.0).abs(),
            ..Flaws::default()
        }
    }

    fn epoch(&self) -> u32 {
        self.epoch
    }

    fn set_epoch(&mut self, epoch: u32) {
        self.epoch = epoch;
    }

    fn surface(&self) -> &Surface {
        self.own.as_ref().map_or(self.surface.surface(), OwnSkin::surface)
    }

    fn element_surface(&self) -> &Surface {
        self.surface.surface()
    }

    fn incision_marks(&self) -> Vec<IncisionMark> {
        Vec::new()
    }

    fn skin(&self) -> Option<&Skin> {
        None
    }

    fn kept(&self) -> Option<Kept> {
        self.own.as_ref().map(OwnSkin::kept)
    }

    fn put_on_skin(
        &mut self,
        _: SkinSettings,
        own: Option<&OwnSurface<'_>>,
        shape: &mut SkinShape<'_>,
    ) -> Result<(), SkinError> {
        let Some(own) = own else { return Ok(()) };
        if !self.octree.cut_links().is_empty() {
            return Err(SkinError::AlreadyCut);
        }
        self.own = Some(OwnSkin::new(&self.octree, &self.surface, own, shape)?);
        Ok(())
    }

    fn spoil_skin(&mut self) {}

    fn swept_area(&self, x: &[Vector3<f64>], blade: &BladeSweep) -> f64 {
        let ends = blade.segments.iter().flatten();
        let none = [Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY)];
        let bounds = ends.fold(none, |[low, high], end| [low.inf(end), high.sup(end)]);
        let (mut corners, mut tets) = (Vec::new(), Vec::new());
        for id in self.leaves_at(x, &bounds) {
            let first = corners.len() as u32;
            corners.extend(self.octree.corners(id, x));
            tets.extend(TETS_OF_CUBE.map(|tet| tet.map(|c| first + c)));
        }
        swept_area(&tets, &corners, blade)
    }

    fn cut(
        &mut self,
        team: &mut Team,
        x: &[Vector3<f64>],
        blade: &BladeSweep,
        incision: u32,
    ) -> Result<CutReport, CutError> {
        let crossed = self.search(team, x, blade, incision)?;
        Ok(self.open(team, crossed))
    }

    fn begin_cut(
        &mut self,
        team: &mut Team,
        x: &[Vector3<f64>],
        blade: &BladeSweep,
        incision: u32,
    ) -> Result<(), CutError> {
        self.under_way = Some(self.search(team, x, blade, incision)?);
        Ok(())
    }

    fn go_on_cutting(&mut self, team: &mut Team, work: &mut Work) -> Option<CutReport> {
        let crossed = self.under_way.take()?;
        work.book(crossed.0.len() / LINKS_PER_FRAGMENT);
        Some(self.open(team, crossed))
    }

    fn is_being_cut(&self) -> bool {
        self.under_way.is_some()
    }

    fn reset(&mut self) -> Result<(), MeshError> {
        self.under_way = None;
        self.fronts.clear();
        self.borders = Borders::default();
        self.changed.clear();
        self.only_cut = false;
        self.octree = (*self.initial).clone();
        self.node_of_copy.truncate(self.octree.n_vertices());
        self.epoch += 1;
        self.renew();
        Ok(())
    }

    fn boxed_clone(&self) -> Box<dyn Space> {
        Box::new(Self { under_way: None, ..self.clone() })
    }

    fn bytes(&self) -> usize {
        let own = self.own.as_ref().map_or(0, |own| own.surface().triangles.len());
        // The uncut state is shared.
        self.octree.bytes()
            + 16 * self.node_of_copy.len()
            + TRIANGLE_BYTES * (self.surface.surface().triangles.len() + own)
    }

    fn stiffness(&self, simd: Simd) -> Option<Box<dyn Stiffness>> {
        let simd = simd.min(Simd::detect());
        let lame: Vec<Lame> = self.octree.regions().iter().map(Region::lame).collect();
        Some(Box::new(CellStiffness::new(simd, &self.octree, &lame)))
    }

    fn follow_stiffness(&self, stiffness: &mut dyn Stiffness) {
        if let Some(cells) = (stiffness as &mut dyn Any).downcast_mut::<CellStiffness>() {
            match self.only_cut {
                true => cells.follow_cut(&self.octree, &self.changed),
                false => cells.follow(&self.octree),
            }
        }
    }

    fn hierarchy(&self, least: usize) -> Option<Hierarchy> {
        Some(Hierarchy::with_level(&self.octree, least))
    }

    fn stiff_modes(&self) -> Option<StiffModes> {
        None
    }

    fn model(&self, material: &Material, volumetric: Volumetric) -> Result<Model, ModelError> {
        Model::octree(&self.octree, material, volumetric)
    }

    fn follow_model(&self, model: &mut Model, material: &Material) {
        model.fill_octree(&self.octree, material.density_kg_m3);
    }
}

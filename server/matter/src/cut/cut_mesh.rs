//! The cut state of one body: rest mesh, fragments, pieces, copies and surface.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use crate::mesh::{MeshError, TET_FACES, TetMesh};
use crate::storage::reserve::reserve_half_again;

use super::drawn::pending::{Pending, PendingFace, Pieces};
use super::drawn::traces::{TraceLine, Traces};
use super::shell::surface::Surface;
use super::shell::surface_builder::{Change, Material, SurfaceBuilder};
use super::sweep::bit_marks::Ascending;
use super::sweep::blade::{BladeSweep, CutError, CutLimits, CutReport, Work};
use super::sweep::borders::{Adjoining, Borders, JoinSizes, edges};
use super::sweep::detect::{Deformed, Detector, Place, Record};
use super::sweep::front::{Front, Surroundings, sweep_triangles};
use super::sweep::front_elements::{FrontElements, Meeting};
use super::sweep::separate::{Separator, Sheet};
use super::sweep::sweep_triangle::SweepTriangle;
use super::topology::components::Components;
use super::topology::copies::CopyTable;
use super::topology::crossings::Crossings;
use super::topology::elements_around::ElementsAround;
use super::topology::fragments::{Fragments, NONE};
use super::topology::incision_sets::IncisionSets;
use super::topology::locate::piece_at;
use super::topology::pieces::{Piece, PieceTable};
use super::topology::runs::Runs;

/// Cost of separating a fragment and updating pieces, copies and surface, in fragments examined.
const SEPARATION: usize = 20;

/// A sweep that is taken in parts, between [`CutMesh::begin_sweep`] and [`CutMesh::complete`].
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct SweepUnderWay {
    triangles: Vec<SweepTriangle>,
    incision: u32,
    joined: Adjoining,
    place: Place,
    most_fragments: usize,
}

impl SweepUnderWay {
    /// The incision that this sweep continues.
    pub fn incision(&self) -> u32 {
        self.incision
    }
}

/// A tet mesh with the topology that cuts have given it.
///
/// Copies 0..n_nodes are the nodes of the rest mesh; further ones are appended and never removed. Material is
/// connected only through faces. A rest mesh whose parts meet only in a node or an edge therefore gets extra
/// copies from the start.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct CutMesh {
    mesh: TetMesh,
    runs: Runs,
    pub(crate) fragments: Fragments,
    pub(crate) pieces: PieceTable,
    copies: CopyTable,
    surface: Surface,
    pub(super) builder: SurfaceBuilder,
    pub(super) sets: IncisionSets,
    pub(super) crossings: Crossings,
    pending: Pending,
    fronts: BTreeMap<u32, Front>,
    borders: Borders,
    traces: Traces,
    detector: Detector,
    separator: Separator,
    order: Ascending,
    epoch: u32,
    inexact: bool,
    front_reach: f64,
    front_elements: FrontElements,
}

impl CutMesh {
    /// Whether signs are exact. They are by default; only a test of the tests turns this off.
    #[doc(hidden)]
    pub fn set_exact(&mut self, exact: bool) {
        self.inexact = !exact;
    }

    /// Sets how far incisions go on ahead of the blade, over the mean length of an element's edges; see
    /// [`FrontRule`](super::FrontRule). They do not go ahead unless this is called.
    pub fn set_front_reach(&mut self, reach: f64) {
        self.front_reach = reach;
    }

    /// The uncut state of a mesh.
    pub fn new(mesh: TetMesh) -> Result<Self, MeshError> {
        Self::with_lips(mesh, &BTreeMap::new(), 0)
    }

    /// The state of a mesh that was cut along its faces. `lips` gives the incision of boundary faces, by
    /// their nodes in ascending order; 0 or absent is skin.
    pub fn with_lips(mesh: TetMesh, lips: &BTreeMap<[u32; 3], u32>, epoch: u32) -> Result<Self, MeshError> {
        mesh.check()?;
        let mut fragments = Fragments::new(&mesh);
        fragments.tag_boundary(&mesh, lips);
        let mut pieces = PieceTable::new(&mesh);
        let mut copies = CopyTable::new(&mesh, &pieces);
        let mut new_copies = Vec::new();
        // Vertices beyond those of the nodes belong to parts that meet only in a node or an edge.
        for v in mesh.nodes.len()..fragments.vertices.len() {
            let [node, ..] = fragments.vertices[v].nodes;
            copies.update(&mesh, node, &fragments, &mut pieces, &mut new_copies);
        }
        copies.changed.clear();
        copies.reserve_half_again(mesh.tets.len());
        let (builder, mut surface) =
            SurfaceBuilder::build(&Material { mesh: &mesh, fragments: &fragments, pieces: &pieces });
        reserve_half_again(&mut surface.vertices);
        reserve_half_again(&mut surface.triangles);
        reserve_half_again(&mut surface.tags);
        let (n_nodes, n_elements) = (mesh.nodes.len(), mesh.tets.len());
        Ok(Self {
            runs: Runs::new(&mesh),
            mesh,
            fragments,
            pieces,
            copies,
            surface,
            builder,
            sets: IncisionSets::default(),
            crossings: Crossings::with_capacity(n_nodes),
            pending: Pending::default(),
            fronts: BTreeMap::new(),
            borders: Borders::default(),
            traces: Traces::default(),
            detector: Detector::with_capacity(n_nodes, n_elements),
            separator: Separator::with_capacity(n_elements),
            order: Ascending::default(),
            epoch,
            inexact: false,
            front_reach: 0.0,
            front_elements: FrontElements::default(),
        })
    }

    /// The rest mesh. Cuts do not change it.
    pub fn mesh(&self) -> &TetMesh {
        &self.mesh
    }

    /// Material pieces, one computational element each. Ids are stable; cuts append.
    pub fn pieces(&self) -> &[Piece] {
        &self.pieces.pieces
    }

    /// Pieces that the last sweep split, created or gave other copies, ascending.
    pub fn changed_pieces(&self) -> &[u32] {
        &self.copies.changed
    }

    /// Fragments that the last sweep created, bisected or opened.
    pub(crate) fn changed_fragments(&self) -> &[u32] {
        &self.separator.changed
    }

    /// Number of node copies, each with three degrees of freedom.
    pub fn n_copies(&self) -> usize {
        self.copies.node.len()
    }

    /// Mesh node of every copy. The rest position of a copy is that of its node.
    pub fn copy_node(&self) -> &[u32] {
        &self.copies.node
    }

    /// The copies of `node` whose material contains the node itself, ascending. There is one, or more where a
    /// cut passes exactly through the node.
    pub fn copies_with_node(&self, node: u32) -> Vec<u32> {
        self.copies.with_node(&self.mesh, node, &self.fragments, &self.pieces)
    }

    /// Copies of all pieces that use this copy.
    pub fn tets_around(&self, copy: u32) -> Vec<[u32; 4]> {
        self.copies.tets_around(copy, &self.pieces)
    }

    /// The elements around every node.
    pub(crate) fn elements_around(&self) -> &ElementsAround {
        self.copies.elements_around()
    }

    /// Pieces whose tet may meet the box between two corners [m], ascending, and how many elements were looked
    /// at to find them. `x` is the position [m] of every copy.
    pub fn pieces_near(&mut self, x: &[Vector3<f64>], corners: &[Vector3<f64>; 2]) -> (&[u32], usize) {
        let body = Deformed { mesh: &self.mesh, pieces: &self.pieces, x };
        self.detector.find_candidates(&body, (&self.runs, &self.copies.node), corners);
        (&self.detector.near, self.detector.examined)
    }

    /// The pieces of the last search.
    pub fn candidates(&self) -> &[u32] {
        &self.detector.near
    }

    /// Remembers a blade position by the material around it at the positions `x` [m] of the copies.
    pub fn front(&mut self, segment: &[Vector3<f64>; 2], x: &[Vector3<f64>]) -> Front {
        self.pieces_near(x, &[segment[0].inf(&segment[1]), segment[0].sup(&segment[1])]);
        self.front_among_candidates(segment, x)
    }

    /// The same if the last search for pieces was at these positions, in a box that holds the segment.
    pub(crate) fn front_among_candidates(&self, segment: &[Vector3<f64>; 2], x: &[Vector3<f64>]) -> Front {
        let near = self.candidates_near(&[segment[0].inf(&segment[1]), segment[0].sup(&segment[1])]);
        let around = |copy| self.copies.tets_around(copy, &self.pieces);
        Front::remember(segment, &Surroundings { near: &near, around: &around, x })
    }

    /// Copies of the pieces of the last search that may meet the box between two corners [m].
    pub(crate) fn candidates_near(&self, corners: &[Vector3<f64>; 2]) -> Vec<[u32; 4]> {
        self.detector.tets_near(corners, &self.pieces)
    }

    /// Side [m] of the cube that six elements of mean volume fill.
    pub fn cell_m(&self) -> f64 {
        (6.0 * self.copy_volume().iter().sum::<f64>() / self.mesh.tets.len() as f64).cbrt()
    }

    /// Σ over pieces of ∫ N_a dV [m³] per copy. The mass of a copy is the density times this.
    pub fn copy_volume(&self) -> &[f64] {
        &self.copies.volume
    }

    /// ∫ N_a dV [m³] over piece `p`, for the nodes of its element.
    pub fn piece_node_volume(&self, p: usize) -> [f64; 4] {
        self.pieces.node_volume[p]
    }

    /// ∫ N_a N_b dV [m³] over piece `p`, for the nodes of its element.
    pub fn piece_node_products(&self, p: usize) -> [[f64; 4]; 4] {
        self.pieces.node_products(&self.mesh, p as u32, &self.fragments)
    }

    /// The fragments of piece `p`: the barycentric coordinates of their corners in the element, and their volumes as
    /// fractions of it.
    pub fn piece_fragments(&self, p: usize) -> impl Iterator<Item = ([[f64; 4]; 4], f64)> + '_ {
        let (fragments, nodes) = (&self.fragments, self.mesh.tets[self.pieces()[p].element as usize]);
        self.pieces.fragments(p as u32, fragments).map(move |t| {
            let corner = |v: u32| nodes.map(|node| fragments.vertices[v as usize].weight_of(node));
            (fragments.tets[t as usize].map(corner), fragments.fraction[t as usize])
        })
    }

    /// The faces of piece `p` on the skin, without lips of cuts: the barycentric coordinates of their corners in the
    /// element, counter-clockwise from outside.
    pub fn skin_fragments(&self, p: usize) -> impl Iterator<Item = [[f64; 4]; 3]> + '_ {
        self.piece_faces(p, |neighbour, tag| neighbour == NONE && tag == 0)
    }

    /// The faces of piece `p` on lips of cuts, like [`skin_fragments`](Self::skin_fragments).
    pub fn lip_fragments(&self, p: usize) -> impl Iterator<Item = [[f64; 4]; 3]> + '_ {
        self.piece_faces(p, |_, tag| tag > 0)
    }

    /// The faces of the fragments of piece `p` that are chosen by their neighbour and their tag.
    fn piece_faces(
        &self,
        p: usize,
        chosen: fn(u32, u32) -> bool,
    ) -> impl Iterator<Item = [[f64; 4]; 3]> + '_ {
        let (fragments, nodes) = (&self.fragments, self.mesh.tets[self.pieces()[p].element as usize]);
        let of_fragment = move |t: u32| {
            let t = t as usize;
            let is_chosen = move |k: &usize| chosen(fragments.neighbour[t][*k], fragments.tag[t][*k]);
            (0..4).filter(is_chosen).map(move |k| {
                let corner = |v: u32| nodes.map(|node| fragments.vertices[v as usize].weight_of(node));
                TET_FACES[k].map(|slot| corner(fragments.tets[t][slot]))
            })
        };
        self.pieces.fragments(p as u32, fragments).flat_map(of_fragment)
    }

    /// Topology epoch: rises whenever the topology or its surface changes.
    pub fn epoch(&self) -> u32 {
        self.epoch
    }

    /// Sets the epoch, because the displayed mesh changed without a cut or is an earlier one again.
    pub fn set_epoch(&mut self, epoch: u32) {
        self.epoch = epoch;
    }

    /// Skin and cut faces, closed and 2-manifold.
    pub fn surface(&self) -> &Surface {
        &self.surface
    }

    /// Where incisions have entered elements that they have not cut apart yet. Shown together with the
    /// [`surface`](Self::surface), which lags the blade by these faces.
    pub fn pending_faces(&self) -> Vec<PendingFace> {
        self.pending.faces(&self.pending_pieces())
    }

    /// Lines where blades passed over the boundary without opening it.
    pub(crate) fn trace_lines(&self) -> Vec<TraceLine> {
        self.traces.lines(&self.fragments, |vertices, incision| {
            let on = vertices.map(|v| self.sets.contains(self.fragments.on[v as usize], incision));
            let is_crossed = |(i, j): (usize, usize)| {
                let crossing = || self.crossings.get(vertices[i], vertices[j], incision);
                !on[i] && !on[j] && crossing().is_some()
            };
            on.contains(&true) && ![(0, 1), (1, 2), (2, 0)].into_iter().any(is_crossed)
        })
    }

    fn pending_pieces(&self) -> Pieces<'_> {
        let Self { mesh, fragments, pieces, crossings, sets, .. } = self;
        Pieces { mesh, fragments, pieces, crossings, sets }
    }

    /// Loose parts of the body and their rest volumes.
    pub fn components(&self) -> Components {
        Components::of(&self.fragments, &self.pieces)
    }

    /// Rest position [m] of every copy.
    pub fn rest_positions(&self) -> Vec<Vector3<f64>> {
        self.copies.node.iter().map(|&n| self.mesh.nodes[n as usize]).collect()
    }

    /// The piece of an element that contains the point with these barycentric coordinates.
    pub fn piece_at(&self, element: u32, barycentric: [f64; 4]) -> u32 {
        piece_at(&self.mesh, &self.fragments, element, barycentric)
    }

    /// Undoes all cuts. The epoch keeps rising.
    pub fn reset(&mut self) -> Result<(), MeshError> {
        let (epoch, inexact, front_reach) = (self.epoch + 1, self.inexact, self.front_reach);
        *self = Self::new(std::mem::take(&mut self.mesh))?;
        (self.epoch, self.inexact, self.front_reach) = (epoch, inexact, front_reach);
        Ok(())
    }

    /// Cuts along the surface the blade swept, given the current position [m] of every copy.
    ///
    /// Successive sweeps with the same incision id continue one incision: the last blade position moves with
    /// the material, and the next sweep starts there. An incision never cuts its own lips, so a stroke that
    /// crosses itself needs a new id at the crossing.
    pub fn sweep(
        &mut self,
        x: &[Vector3<f64>],
        blade: &BladeSweep,
        incision: u32,
    ) -> Result<CutReport, CutError> {
        let mut sweep = self.begin_sweep(x, blade, incision, CutLimits::NONE)?;
        let mut work = Work::unlimited();
        self.detect(x, &mut sweep, &mut work);
        Ok(self.complete(x, sweep, &mut work))
    }

    /// Begins a sweep that is taken in parts. [`sweep`](Self::sweep) does the same in one call. Next come
    /// calls of [`detect`](Self::detect) with the same positions until it returns `true`, then
    /// [`complete`](Self::complete). No other sweep may begin before that. The result has the same bits,
    /// however many parts there are.
    pub fn begin_sweep(
        &mut self,
        x: &[Vector3<f64>],
        blade: &BladeSweep,
        incision: u32,
        limits: CutLimits,
    ) -> Result<SweepUnderWay, CutError> {
        blade.check()?;
        if incision == 0 {
            return Err(CutError::ReservedIncision);
        }
        limits.check(self.fragments.tets.len(), self.pieces.pieces.len(), self.n_copies())?;
        if x.len() != self.n_copies() {
            return Err(CutError::PositionCount { found: x.len(), expected: self.n_copies() });
        }
        if let Some(copy) = x.iter().position(|p| !p.iter().all(|c| c.is_finite())) {
            return Err(CutError::NonFinitePosition { copy });
        }
        // The sweep starts where the material has carried the last blade position of this incision.
        let front = self.fronts.get(&incision);
        let mut triangles = sweep_triangles(front, blade, x);
        let edges = edges(front, blade, x);
        let reach = JoinSizes { cell_m: self.cell_m(), back_m: 0.0 };
        let mut joined = self.borders.join(&edges, &triangles, incision, x, reach);
        triangles.append(&mut joined.triangles);
        triangles.iter_mut().for_each(|triangle| triangle.exact = !self.inexact);
        let bounds = sweep_bounds(&triangles, blade);
        let body = Deformed { mesh: &self.mesh, pieces: &self.pieces, x };
        self.detector.find_candidates(&body, (&self.runs, &self.copies.node), &bounds);
        if let Some(last) = blade.segments.last() {
            let front = self.front_among_candidates(last, x);
            self.fronts.insert(incision, front);
        }
        let near = |corners: &[Vector3<f64>; 2]| self.detector.tets_near(corners, &self.pieces);
        self.borders.remember(&edges, incision, &near, x);
        let place = self.detector.begin(&self.fragments);
        Ok(SweepUnderWay { triangles, incision, joined, place, most_fragments: limits.fragments })
    }

    /// Searches for crossings of the sweep with the body at the positions `x` [m] it began with. Returns
    /// `true` when the search is complete.
    pub fn detect(&mut self, x: &[Vector3<f64>], sweep: &mut SweepUnderWay, work: &mut Work) -> bool {
        let body = Deformed { mesh: &self.mesh, pieces: &self.pieces, x };
        let (fragments, sets, crossings) = (&mut self.fragments, &mut self.sets, &mut self.crossings);
        let (traces, incision) = (&mut self.traces, sweep.incision);
        let joined = &sweep.joined.parts[..];
        let mut record = Record { fragments, sets, crossings, traces, incision, joined };
        self.detector.run(&body, &sweep.triangles, &mut record, (&mut sweep.place, work))
    }

    /// Separates everything that the detection found to be cut, in one call, with the positions `x` [m] the sweep began
    /// with.
    pub fn complete(&mut self, x: &[Vector3<f64>], sweep: SweepUnderWay, work: &mut Work) -> CutReport {
        let SweepUnderWay { triangles, incision, joined, most_fragments, .. } = sweep;
        // What the sweep has taken over is pending in its name alone.
        for &t in &self.detector.touched {
            joined.parts.iter().for_each(|&other| self.pending.set(other, t, false));
        }
        let (fragments, sets, crossings) = (&mut self.fragments, &mut self.sets, &mut self.crossings);
        let (waiting, traces) = (&mut self.pending, &mut self.traces);
        let mut sheet = Sheet { fragments, sets, crossings, waiting, traces, incision, most_fragments };
        let body = Deformed { mesh: &self.mesh, pieces: &self.pieces, x };
        let meeting = Meeting { body: &body, triangles: &triangles, incision };
        let (ahead, reach) = (&mut self.front_elements, self.front_reach);
        let front = (reach > 0.0).then_some((ahead, reach, meeting));
        self.separator.run((&self.detector.touched, &self.detector.near), front, &mut sheet);
        let mut report = self.follow_separation();
        if !self.traces.is_empty() {
            let opened = self.builder.faces_beside_lips(&self.surface, incision);
            for face in opened {
                let incisions = joined.parts.iter().chain([&incision]);
                incisions.for_each(|&incision| self.traces.open(face, incision, &self.fragments));
            }
        }
        report.joined = joined.incisions;
        work.book(SEPARATION * (self.detector.touched.len() + self.separator.changed.len()));
        report
    }

    /// Updates pieces, copies and surface after a separation.
    fn follow_separation(&mut self) -> CutReport {
        let mut report = CutReport {
            elements_cut: self.separator.elements.len(),
            faces_opened: self.separator.faces_opened,
            pending_edges: self.separator.pending.len(),
            refused_edges: self.separator.refused.len(),
            ..CutReport::default()
        };
        self.copies.changed.clear();
        for &e in &self.separator.elements {
            self.pieces.update(&self.mesh, e, &mut self.fragments, &mut self.copies.changed);
        }
        let mut nodes: Vec<u32> =
            self.separator.elements.iter().flat_map(|&e| self.mesh.tets[e as usize]).collect();
        self.order.sort(&mut nodes);
        for node in nodes {
            self.copies.update(&self.mesh, node, &self.fragments, &mut self.pieces, &mut report.new_copies);
        }
        self.order.sort(&mut self.copies.changed);
        if !self.separator.changed.is_empty() {
            // Faces that are halved or opened without splitting a piece change only the surface.
            self.epoch += 1;
            let material = Material { mesh: &self.mesh, fragments: &self.fragments, pieces: &self.pieces };
            let Separator { changed, moved, .. } = &self.separator;
            let change = Change { fragments: changed, moved, pieces: &self.copies.changed };
            self.builder.update(&material, &change, &mut self.surface);
        }
        report.epoch = self.epoch;
        report
    }
}

/// Box around the sweep and the last blade segment [m].
pub(crate) fn sweep_bounds(triangles: &[SweepTriangle], blade: &BladeSweep) -> [Vector3<f64>; 2] {
    let mut low = Vector3::repeat(f64::INFINITY);
    let mut high = Vector3::repeat(f64::NEG_INFINITY);
    for triangle in triangles {
        low = low.inf(&triangle.low);
        high = high.sup(&triangle.high);
    }
    for point in blade.segments.last().into_iter().flatten() {
        low = low.inf(point);
        high = high.sup(point);
    }
    [low, high]
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::mesh::{BoxPattern, box_mesh};

    #[test]
    fn the_uncut_state_is_the_mesh_itself() {
        let mesh = box_mesh(Vector3::zeros(), Vector3::new(3.0, 2.0, 1.0), [3, 2, 2], BoxPattern::Tet6);
        let cut = CutMesh::new(mesh.clone()).unwrap();
        assert_eq!(cut.n_copies(), mesh.nodes.len());
        assert_eq!(cut.pieces().len(), mesh.tets.len());
        assert!(cut.pieces().iter().zip(&mesh.tets).all(|(p, t)| p.copies == *t && p.fraction == 1.0));
        assert_eq!(cut.surface().triangles.len(), mesh.boundary_faces().len());
        let x = cut.rest_positions();
        assert!((cut.surface().volume(&x) - 6.0).abs() < 1e-12);
        assert!((cut.copy_volume().iter().sum::<f64>() - 6.0).abs() < 1e-12);
        assert_eq!(cut.components().len(), 1);
        assert!((cut.components().volume[0] - 6.0).abs() < 1e-12);
    }

    #[test]
    fn tets_that_meet_only_in_an_edge_do_not_share_copies() {
        let p = |x: f64, y: f64, z: f64| Vector3::new(x, y, z);
        let nodes =
            vec![p(0., 0., 0.), p(0., 0., 1.), p(1., 0., 0.), p(1., 1., 0.), p(-1., 0., 0.), p(-1., -1., 0.)];
        let (mesh, _) = TetMesh::repaired(nodes, vec![[0, 1, 2, 3], [0, 1, 4, 5]]).unwrap();
        let cut = CutMesh::new(mesh).unwrap();
        assert_eq!(cut.n_copies(), 8);
        assert_eq!(cut.surface().vertices.len(), 8);
        assert_eq!(cut.components().len(), 2);
        assert_eq!(&cut.copy_node()[6..], &[0, 1]);
    }
}

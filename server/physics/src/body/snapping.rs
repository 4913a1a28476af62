//! Cuts that change the mesh itself; all data on it follows.

use nalgebra::Vector3;
use scindo_matter::cut::remesh::{MeshCut, Nodes, SnapCut, SnapNode, SnapReport, SnapSettings, Snapper};
use scindo_matter::cut::{BladeSweep, CutMesh, CutReport, NewCopy};
use scindo_matter::mesh::TetMesh;

use super::boundary::Boundary;
use super::{Body, BodyError};
use crate::space::Tets;

/// How cuts are made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum CuttingMethod {
    /// Pieces and copies inside the elements ([`scindo_matter::cut`]).
    #[default]
    Xfem,
    /// Along element faces, with nodes moved onto the sweep ([`scindo_matter::cut::remesh`]); tet4 only.
    Snap,
    /// Elements are divided along the sweep ([`scindo_matter::cut::remesh::subdivide`]); tet4 only. A baseline for comparisons.
    Subdivide,
    /// Elements that the sweep touches are removed ([`scindo_matter::cut::remesh::remove`]); tet4 only. A baseline for comparisons.
    Remove,
}

impl CuttingMethod {
    /// How it changes the mesh; `None` if it leaves the elements alone.
    pub fn mesh_cut(self) -> Option<MeshCut> {
        match self {
            Self::Xfem => None,
            Self::Snap => Some(MeshCut::Snap),
            Self::Subdivide => Some(MeshCut::Subdivide),
            Self::Remove => Some(MeshCut::Remove),
        }
    }
}

/// What happens to a part that a cut leaves without any held node, where cuts change the mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum LooseRule {
    /// It becomes a free body.
    #[default]
    Free,
    /// It is held where it is at the nodes of its largest skin face (Nienhuys 2003, §3.3).
    Pinned,
}

/// State of a body whose mesh is cut.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct SnapState {
    snapper: Snapper,
    start: Start,
    /// Constraints and loads after the last cut, including pins of loose parts.
    carried: Boundary,
    report: SnapReport,
    /// For every node, the node of the uncut mesh that it was, or [`scindo_matter::cut::remesh::node::NEW`].
    origins: Vec<u32>,
}

/// A cut along faces that was begun.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct FaceCut {
    pub blade: BladeSweep,
    pub incision: u32,
}

/// The body before its first cut.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
struct Start {
    mesh: TetMesh,
    /// Set by the first cut; later requests are added to it.
    boundary: Option<Boundary>,
}

impl SnapState {
    pub(super) fn new(mesh: &TetMesh, how: MeshCut, settings: SnapSettings) -> Self {
        Self::of(mesh, Snapper::new(how, settings))
    }

    fn of(mesh: &TetMesh, snapper: Snapper) -> Self {
        Self {
            snapper,
            origins: (0..mesh.nodes.len() as u32).collect(),
            start: Start { mesh: mesh.clone(), boundary: None },
            carried: Boundary::default(),
            report: SnapReport::default(),
        }
    }

    /// Adds the requests made since the last cut to those that a reset restores.
    fn take_changes(&mut self, now: &Boundary) {
        let n = self.start.mesh.nodes.len();
        if let Some(start) = &mut self.start.boundary {
            start.take_changes(&self.carried, now, &self.origins, n);
        }
    }
}

impl Body {
    /// Report of the last cut of the mesh; `None` if cuts leave it alone.
    pub fn snap_report(&self) -> Option<&SnapReport> {
        self.snap.as_deref().map(|snap| &snap.report)
    }

    /// For every node, the node of the uncut mesh that it was, or [`scindo_matter::cut::remesh::node::NEW`]. `None` if
    /// cuts leave the mesh of the body alone.
    pub fn node_origins(&self) -> Option<&[u32]> {
        self.snap.as_deref().map(|snap| &snap.origins[..])
    }

    /// Cuts the mesh. Held nodes stay in place, and all their duplicates are held. Loads of a
    /// duplicated node are shared by volume.
    pub(super) fn snap_cut(&mut self, blade: &BladeSweep, incision: u32) -> Result<CutReport, BodyError> {
        let Some(mut snap) = self.snap.take() else { return Ok(CutReport::default()) };
        let before = snap.snapper.clone();
        let result = self.snap_with(&mut snap.snapper, blade, incision);
        // A refused cut leaves the body as it was.
        let (report, cut) = match result {
            Ok(done) => done,
            Err(error) => {
                snap.snapper = before;
                self.snap = Some(snap);
                return Err(error);
            }
        };
        let mut told = CutReport {
            elements_cut: report.elements,
            faces_opened: report.faces,
            pending_edges: report.pending,
            joined: snap.snapper.joined().to_vec(),
            epoch: self.space.epoch(),
            ..CutReport::default()
        };
        snap.report = report;
        // Nothing came apart yet: only the report is new.
        let Some(cut) = cut else {
            self.snap = Some(snap);
            return Ok(told);
        };
        told.new_copies = cut.duplicates.iter().map(|d| NewCopy::split(d.node, d.parent)).collect();
        // A reset must restore requests made since the last cut, but not the pins.
        snap.take_changes(&self.boundary);
        if snap.start.boundary.is_none() {
            snap.start.boundary = Some(self.boundary.clone());
        }
        let origin = |node: &SnapNode| snap.origins.get(node.origin as usize).copied();
        snap.origins = cut.nodes.iter().map(|node| origin(node).unwrap_or(node.origin)).collect();
        self.snap = Some(snap);
        self.boundary = Boundary::of_nodes(&cut.nodes);
        self.asleep.clear();
        self.state.x = cut.nodes.iter().map(|node| node.x).collect();
        self.state.v = cut.nodes.iter().map(|node| node.v).collect();
        self.follow_mesh()?;
        if self.settings.loose == LooseRule::Pinned {
            self.pin_loose_parts()?;
        }
        if let Some(snap) = &mut self.snap {
            snap.carried = self.boundary.clone();
        }
        Ok(told)
    }

    /// Returns to the uncut mesh. Constraints and loads stay, on the nodes that theirs came from. Pins of
    /// loose parts are removed, and so are requests on nodes that cuts made.
    pub(super) fn snap_reset(&mut self) -> Result<(), BodyError> {
        let Some(snap) = &mut self.snap else { return Ok(()) };
        let epoch = self.space.epoch() + 1;
        let mesh = snap.start.mesh.clone();
        snap.take_changes(&self.boundary);
        if let Some(boundary) = snap.start.boundary.take() {
            self.boundary = boundary;
        }
        **snap = SnapState::of(&mesh, snap.snapper.afresh());
        let cut_mesh = CutMesh::with_lips(mesh, snap.snapper.tags(), epoch)?;
        self.space = Box::new(Tets::linear(cut_mesh));
        self.return_to_rest();
        self.follow_mesh()
    }

    /// Updates everything derived from the mesh after it was replaced.
    fn follow_mesh(&mut self) -> Result<(), BodyError> {
        self.dynamics.rebuild(&*self.space)?;
        self.follow_topology();
        Ok(())
    }

    /// Runs `snapper` on the mesh of this body, and replaces the mesh by the new one if there is one.
    fn snap_with(
        &mut self,
        snapper: &mut Snapper,
        blade: &BladeSweep,
        incision: u32,
    ) -> Result<(SnapReport, Option<SnapCut>), BodyError> {
        let (epoch, boundary) = (self.space.epoch() + 1, &self.boundary);
        let data = |n: u32, node: &mut SnapNode| boundary.onto_node(n, node);
        let nodes = Nodes { rest: &self.rest, x: &self.state.x, v: &self.state.v, data: &data };
        let Some(tets) = self.space.tets_mut() else { return Ok((SnapReport::default(), None)) };
        let (report, mut cut) = tets.cut_along_faces(snapper, nodes, blade, incision)?;
        if let Some(cut) = &mut cut {
            let mut cut_mesh = CutMesh::with_lips(std::mem::take(&mut cut.mesh), snapper.tags(), epoch)?;
            let x: Vec<Vector3<f64>> = cut.nodes.iter().map(|node| node.x).collect();
            snapper.follow(&mut cut_mesh, &x, cut);
            self.space = Box::new(Tets::linear(cut_mesh));
        }
        Ok((report, cut))
    }

    /// Holds every part that is held nowhere at its largest skin face, in its present position.
    fn pin_loose_parts(&mut self) -> Result<(), BodyError> {
        let Some(mesh) = self.space.tets().map(Tets::mesh) else { return Ok(()) };
        let mut largest: Vec<Option<(f64, [u32; 3])>> = vec![None; self.parts.len()];
        for face in mesh.boundary_faces() {
            let area = mesh.face_area(&face);
            let slot = &mut largest[self.parts.of_copy[face.nodes[0] as usize] as usize];
            if slot.is_none_or(|(most, _)| area > most) {
                *slot = Some((area, face.nodes));
            }
        }
        let loose = largest.iter().zip(&self.parts.free).filter(|(_, free)| **free);
        let pins: Vec<(u32, Vector3<f64>)> = loose
            .flat_map(|(face, _)| face.iter().flat_map(|(_, nodes)| *nodes).collect::<Vec<u32>>())
            .map(|n| (n, self.state.x[n as usize] - self.rest[n as usize]))
            .collect();
        for (node, displacement_m) in pins {
            self.fix(&[node], [true; 3], displacement_m)?;
        }
        Ok(())
    }
}

//! A cut along element faces, from the blade sweep to the new mesh.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector3;

use super::clean::clean;
use super::complex::{Before, Complex, FaceKey};
use super::dissect::{Duplicate, dissect};
use super::memory::Memory;
use super::node::{NEW, Nodes, SnapNode};
use super::relocate::relocate_all;
use super::select::{Selection, cross, select};
use crate::cut::{BladeSweep, CutError, CutMesh, ElementsAround, Front, sweep_bounds, sweep_triangles};
use crate::mesh::TetMesh;

/// Counts of what one cut did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct SnapReport {
    /// Faces selected by this sweep.
    pub faces: usize,
    /// Elements next to these faces.
    pub elements: usize,
    /// Nodes moved onto the sweep.
    pub moved: usize,
    /// Nodes of the cut surface that could not move and stay off the sweep.
    pub refused: usize,
    /// Nodes duplicated.
    pub duplicated: usize,
    /// Edges collapsed.
    pub collapses: usize,
    /// Nodes added on edges and faces in order to collapse degenerate elements.
    pub splits: usize,
    /// Degenerate elements that remain because they could not be collapsed.
    pub degenerate: usize,
    /// Crossed edges that no selected face represents yet. The cut lags there.
    pub pending: usize,
    /// Work: elements looked at in search of those near the sweep.
    pub examined: usize,
    /// Work: elements and nodes copied in order to change some of them.
    pub copied: usize,
}

/// The mesh after a cut.
#[derive(Clone, Debug)]
pub struct SnapCut {
    /// Elements and rest positions.
    pub mesh: TetMesh,
    /// State and origin of every node of the mesh.
    pub nodes: Vec<SnapNode>,
    /// Nodes that were split off others by this cut.
    pub duplicates: Vec<Duplicate>,
    /// Last blade position [m] of every incision, for [`Snapper::follow`].
    pub fronts: Vec<(u32, [Vector3<f64>; 2])>,
}

/// Cuts one body along its faces, and remembers unfinished incisions.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct Snapper {
    memories: BTreeMap<u32, Memory>,
    fronts: BTreeMap<u32, Front>,
    tags: BTreeMap<FaceKey, u32>,
}

impl Snapper {
    /// A copy of the mesh in which only elements that share a face share nodes, as after a cut.
    pub fn prepared(mesh: &TetMesh) -> TetMesh {
        let (rest, v) = (&mesh.nodes[..], vec![Vector3::zeros(); mesh.nodes.len()]);
        let around = ElementsAround::new(rest.len(), &mesh.tets);
        let nodes = Nodes { rest, x: rest, v: &v, data: &|_, _| () };
        let before = Before { tets: &mesh.tets, around: &around, nodes };
        let mut complex = Complex::new(before, BTreeMap::new());
        dissect(&mut complex, &(0..mesh.nodes.len() as u32).collect(), &mut []);
        let tets = (0..mesh.tets.len() as u32).map(|t| complex.tet(t)).collect();
        TetMesh { nodes: (0..complex.n_nodes() as u32).map(|n| complex.rest_of(n)).collect(), tets }
    }

    /// Incision of every surface face that is a lip, and of selected faces that are still closed.
    pub fn tags(&self) -> &BTreeMap<FaceKey, u32> {
        &self.tags
    }

    /// Cuts `mesh` along the surface that the blade swept, in the present configuration of `nodes`. Returns no
    /// mesh as long as nothing can be cut. A mesh that is returned must come back in [`follow`](Self::follow).
    ///
    /// # Errors
    /// Those of [`crate::cut::CutMesh::sweep`]. Nothing is changed then.
    pub fn cut(
        &mut self,
        mesh: &mut CutMesh,
        nodes: Nodes<'_>,
        blade: &BladeSweep,
        incision: u32,
    ) -> Result<(SnapReport, Option<SnapCut>), CutError> {
        blade.check()?;
        if incision == 0 {
            return Err(CutError::ReservedIncision);
        }
        if let Some(copy) = nodes.x.iter().position(|x| !x.iter().all(|c| c.is_finite())) {
            return Err(CutError::NonFinitePosition { copy });
        }
        let triangles = sweep_triangles(self.fronts.get(&incision), blade, nodes.x);
        let (near, examined) = mesh.pieces_near(nodes.x, &sweep_bounds(&triangles, blade));
        // Nothing is cut inside the elements of this mesh, so its pieces are its elements.
        let near = near.to_vec();
        let before = Before { tets: &mesh.mesh().tets, around: mesh.elements_around(), nodes };
        let complex = Complex::new(before, std::mem::take(&mut self.tags));
        let memory = self.memories.entry(incision).or_default();
        cross(&complex, &near, &triangles, memory);
        let selection = select(&complex, memory);
        if selection.faces.is_empty() {
            self.tags = complex.into_tags();
            let report = SnapReport { pending: memory.crossings.len(), examined, ..SnapReport::default() };
            if let Some(last) = blade.segments.last() {
                self.fronts.insert(incision, mesh.front_among_candidates(last, nodes.x));
            }
            return Ok((report, None));
        }
        let (report, cut) = self.open(complex, &selection, blade, incision);
        Ok((SnapReport { examined, ..report }, Some(cut)))
    }

    /// Remembers the last blade positions by the material of the mesh after a cut, at the positions `x` [m] of
    /// its nodes.
    pub fn follow(&mut self, mesh: &mut CutMesh, x: &[Vector3<f64>], cut: &SnapCut) {
        self.fronts = cut.fronts.iter().map(|(incision, ends)| (*incision, mesh.front(ends, x))).collect();
    }

    /// Moves nodes, opens the selected faces and removes degenerate elements.
    fn open(
        &mut self,
        mut complex: Complex<'_>,
        selection: &Selection,
        blade: &BladeSweep,
        incision: u32,
    ) -> (SnapReport, SnapCut) {
        let fronts = self.last_blades(&complex, blade, incision);
        let mut report = SnapReport { faces: selection.faces.len(), ..SnapReport::default() };
        let surface: BTreeSet<u32> = selection.faces.iter().flatten().copied().collect();
        // Nodes move before the faces open: a node still has all of its elements then, and moves for both
        // lips.
        let wanted: Vec<u32> = surface.iter().copied().filter(|n| selection.marks.contains_key(n)).collect();
        report.moved = wanted.len();
        report.refused = relocate_all(&mut complex, wanted, &selection.marks);
        report.moved -= report.refused;
        let mut beside = BTreeSet::new();
        for &key in &selection.faces {
            complex.set_tag(key, Some(incision));
            beside.extend(around_face(&complex, key));
        }
        report.elements = beside.len();
        // A marked face with elements on both sides is still closed, and its nodes may have to be split.
        let closed: BTreeSet<u32> = complex
            .tags()
            .keys()
            .filter(|key| around_face(&complex, **key).len() == 2)
            .flatten()
            .copied()
            .collect();
        if let Some(memory) = self.memories.get_mut(&incision) {
            memory.settle(surface.iter().filter_map(|n| Some((*n, selection.marks.get(n)?.normal))));
        }
        let mut memories: Vec<&mut Memory> = self.memories.values_mut().collect();
        let duplicates = dissect(&mut complex, &closed, &mut memories);
        report.duplicated = duplicates.len();
        let touched = surface.iter().chain(duplicates.iter().map(|d| &d.node));
        let region = touched.flat_map(|&n| complex.around(n).iter().copied()).collect();
        let cleaned = clean(&mut complex, region);
        report.collapses = cleaned.collapses;
        report.splits = cleaned.splits;
        report.degenerate = cleaned.left;

        // Nodes that no element uses are dropped, so everything remembered by node number has to follow.
        let number = numbers(&complex);
        let find = |mut n: u32| {
            while let Some(&kept) = cleaned.merged.get(&n) {
                n = kept;
            }
            number[n as usize]
        };
        for memory in self.memories.values_mut() {
            memory.renumber(&complex, find);
        }
        self.memories
            .retain(|id, memory| *id == incision || !memory.crossings.is_empty() || !memory.on.is_empty());
        report.copied = complex.copied();
        let cut = SnapCut { fronts, ..compact(&complex, &number, &duplicates) };
        self.tags = tags_of(&complex, &number);
        report.pending = self.memories.get(&incision).map_or(0, |memory| memory.crossings.len());
        (report, cut)
    }

    /// The last blade position [m] of every incision, at present. The fronts are bound to elements, which have
    /// other numbers after a cut.
    fn last_blades(
        &self,
        complex: &Complex<'_>,
        blade: &BladeSweep,
        incision: u32,
    ) -> Vec<(u32, [Vector3<f64>; 2])> {
        let others = self.fronts.iter().filter(|(id, _)| **id != incision);
        let others = others.map(|(id, front)| (*id, front.ends(complex.x_before())));
        others.chain(blade.segments.last().map(|last| (incision, *last))).collect()
    }
}

fn around_face(complex: &Complex, [p, q, r]: FaceKey) -> Vec<u32> {
    let holds = |t: &u32| complex.tet(*t).contains(&q) && complex.tet(*t).contains(&r);
    complex.around(p).iter().copied().filter(holds).collect()
}

/// The new number of every node that an element still uses.
fn numbers(complex: &Complex) -> Vec<Option<u32>> {
    let mut next = 0;
    let mut number = |n: usize| {
        let used = !complex.around(n as u32).is_empty();
        next += u32::from(used);
        used.then(|| next - 1)
    };
    (0..complex.n_nodes()).map(&mut number).collect()
}

fn compact(complex: &Complex, number: &[Option<u32>], duplicates: &[Duplicate]) -> SnapCut {
    let of = |n: u32| number[n as usize].unwrap_or(NEW);
    let used = (0u32..).zip(number).filter(|(_, number)| number.is_some());
    let nodes: Vec<SnapNode> = used.map(|(n, _)| complex.node(n)).collect();
    let alive = (0..complex.n_slots() as u32).filter(|&t| complex.is_alive(t));
    let tets = alive.map(|t| complex.tet(t).map(of)).collect();
    let there = duplicates.iter().map(|d| Duplicate { node: of(d.node), parent: of(d.parent) });
    let duplicates = there.filter(|d| d.node != NEW && d.parent != NEW).collect();
    let mesh = TetMesh { nodes: nodes.iter().map(|n| n.rest).collect(), tets };
    SnapCut { mesh, nodes, duplicates, fronts: Vec::new() }
}

fn tags_of(complex: &Complex, number: &[Option<u32>]) -> BTreeMap<FaceKey, u32> {
    let there = complex.tags().iter().filter(|(key, _)| !around_face(complex, **key).is_empty());
    there
        .map(|(key, &tag)| {
            let mut key = key.map(|n| number[n as usize].unwrap_or(NEW));
            key.sort_unstable();
            (key, tag)
        })
        .collect()
}

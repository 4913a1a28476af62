//! A cut along element faces, from the blade sweep to the new mesh.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector3;

use super::clean::clean;
use super::complex::{Complex, FaceKey};
use super::dissect::{Duplicate, dissect};
use super::memory::Memory;
use super::node::{NEW, SnapNode};
use super::relocate::relocate_all;
use super::select::{Selection, cross, select};
use crate::cut::{BladeSweep, CutError, Front, Surroundings, sweep_triangles};
use crate::mesh::TetMesh;

/// Counts of what one cut did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
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
}

/// Cuts one body along its faces, and remembers unfinished incisions.
#[derive(Clone, Debug, Default)]
pub struct Snapper {
    memories: BTreeMap<u32, Memory>,
    fronts: BTreeMap<u32, Front>,
    tags: BTreeMap<FaceKey, u32>,
}

impl Snapper {
    /// A copy of the mesh in which only elements that share a face share nodes, as after a cut.
    pub fn prepared(mesh: &TetMesh) -> TetMesh {
        let nodes = (0u32..).zip(&mesh.nodes).map(|(n, &rest)| SnapNode::at_rest(rest, n)).collect();
        let mut complex = Complex::new(nodes, &mesh.tets, BTreeMap::new());
        dissect(&mut complex, &(0..mesh.nodes.len() as u32).collect(), &mut []);
        let tets = (0..mesh.tets.len() as u32).map(|t| complex.tet(t)).collect();
        TetMesh { nodes: complex.nodes.iter().map(|n| n.rest).collect(), tets }
    }

    /// Incision of every surface face that is a lip, and of selected faces that are still closed.
    pub fn tags(&self) -> &BTreeMap<FaceKey, u32> {
        &self.tags
    }

    /// Cuts along the surface that the blade swept, in the present configuration of `nodes`. Returns no mesh
    /// as long as nothing can be cut.
    ///
    /// # Errors
    /// Those of [`crate::cut::CutMesh::sweep`]. Nothing is changed then.
    pub fn cut(
        &mut self,
        tets: &[[u32; 4]],
        nodes: Vec<SnapNode>,
        blade: &BladeSweep,
        incision: u32,
    ) -> Result<(SnapReport, Option<SnapCut>), CutError> {
        blade.check()?;
        if incision == 0 {
            return Err(CutError::ReservedIncision);
        }
        if let Some(copy) = nodes.iter().position(|n| !n.x.iter().all(|c| c.is_finite())) {
            return Err(CutError::NonFinitePosition { copy });
        }
        let x: Vec<Vector3<f64>> = nodes.iter().map(|n| n.x).collect();
        let triangles = sweep_triangles(self.fronts.get(&incision), blade, &x);
        let complex = Complex::new(nodes, tets, std::mem::take(&mut self.tags));
        let memory = self.memories.entry(incision).or_default();
        cross(&complex, &triangles, memory);
        let selection = select(&complex, memory);
        if selection.faces.is_empty() {
            self.tags = complex.tags().clone();
            let report = SnapReport { pending: memory.crossings.len(), ..SnapReport::default() };
            self.remember(blade, incision, &complex, &x);
            return Ok((report, None));
        }
        let (report, cut) = self.open(complex, &selection, blade, incision, &x);
        Ok((report, Some(cut)))
    }

    /// Moves nodes, opens the selected faces and removes degenerate elements.
    fn open(
        &mut self,
        mut complex: Complex,
        selection: &Selection,
        blade: &BladeSweep,
        incision: u32,
        x: &[Vector3<f64>],
    ) -> (SnapReport, SnapCut) {
        let ends: Vec<(u32, [Vector3<f64>; 2])> =
            self.fronts.iter().filter(|(id, _)| **id != incision).map(|(id, f)| (*id, f.ends(x))).collect();
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
        let cut = compact(&complex, &number, &duplicates);
        // The fronts are bound to elements, which have new numbers as well.
        self.tags = tags_of(&complex, &number);
        report.pending = self.memories.get(&incision).map_or(0, |memory| memory.crossings.len());
        let complex = Complex::new(cut.nodes.clone(), &cut.mesh.tets, BTreeMap::new());
        let x: Vec<Vector3<f64>> = cut.nodes.iter().map(|n| n.x).collect();
        self.fronts.clear();
        for (id, ends) in ends {
            self.remember(&BladeSweep { segments: vec![ends] }, id, &complex, &x);
        }
        self.remember(blade, incision, &complex, &x);
        (report, cut)
    }

    /// Remembers the last blade position by the material it passed through.
    fn remember(&mut self, blade: &BladeSweep, incision: u32, complex: &Complex, x: &[Vector3<f64>]) {
        let Some(last) = blade.segments.last() else { return };
        let (from, to) = (last[0].inf(&last[1]), last[0].sup(&last[1]));
        let overlaps = |&t: &u32| {
            let [a, b, c, d] = complex.now(t);
            let (low, high) = (a.inf(&b).inf(&c.inf(&d)), a.sup(&b).sup(&c.sup(&d)));
            (0..3).all(|k| from[k] <= high[k] && low[k] <= to[k])
        };
        let all = 0..complex.n_slots() as u32;
        let near: Vec<[u32; 4]> = all.filter(overlaps).map(|t| complex.tet(t)).collect();
        let around = |n: u32| complex.around(n).iter().map(|&t| complex.tet(t)).collect();
        self.fronts
            .insert(incision, Front::remember(last, &Surroundings { near: &near, around: &around, x }));
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
    (0..complex.nodes.len()).map(&mut number).collect()
}

fn compact(complex: &Complex, number: &[Option<u32>], duplicates: &[Duplicate]) -> SnapCut {
    let of = |n: u32| number[n as usize].unwrap_or(NEW);
    let nodes: Vec<SnapNode> =
        complex.nodes.iter().zip(number).filter(|(_, used)| used.is_some()).map(|(node, _)| *node).collect();
    let alive = (0..complex.n_slots() as u32).filter(|&t| complex.is_alive(t));
    let tets = alive.map(|t| complex.tet(t).map(of)).collect();
    let there = duplicates.iter().map(|d| Duplicate { node: of(d.node), parent: of(d.parent) });
    let duplicates = there.filter(|d| d.node != NEW && d.parent != NEW).collect();
    SnapCut { mesh: TetMesh { nodes: nodes.iter().map(|n| n.rest).collect(), tets }, nodes, duplicates }
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

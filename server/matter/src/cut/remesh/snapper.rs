//! A cut that changes the mesh, from the blade sweep to the new mesh.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector3;

use super::clean::{Cleaned, clean, spare_crumbs};
use super::complex::{Before, Complex, FaceKey};
use super::dissect::{Duplicate, dissect};
use super::memory::Memory;
use super::node::{NEW, Nodes, SnapNode};
use super::relocate::{Moves, SOUND, relocate_all, relocate_ends};
use super::remove::remove;
use super::select::{Selection, cross, select};
use super::subdivide::{INSIDE, edges_of_parted, settle_ends, subdivide};
use crate::cut::{
    BladeSweep, Borders, CutError, CutMesh, ElementsAround, Front, JoinSizes, border_edges, bounds,
    sweep_bounds, sweep_triangles,
};
use crate::mesh::TetMesh;

/// How the mesh is changed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum MeshCut {
    /// It comes apart along its faces, whose nodes are moved onto the sweep.
    #[default]
    Snap,
    /// Elements are divided where the sweep parts them.
    Subdivide,
    /// Elements that the sweep touches are removed.
    Remove,
}

/// What a cut along faces does besides opening them. The defaults make smooth cuts without degenerate elements.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct SnapSettings {
    /// Which nodes of the cut surface move.
    pub moves: Moves,
    /// Elements that became degenerate are removed by splits and collapses. Without it they stay, and iterative solvers
    /// need more iterations.
    pub clean: bool,
}

impl Default for SnapSettings {
    fn default() -> Self {
        Self { moves: Moves::default(), clean: true }
    }
}

/// A node that may not move counts as lying on a sweep that crosses one of its edges closer to it than this part of the
/// edge. Dividing the edge there would make flat elements.
const CLOSE: f64 = 0.05;

/// Counts of what one cut did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct SnapReport {
    /// Faces selected by this sweep.
    pub faces: usize,
    /// Elements next to these faces, or removed elements.
    pub elements: usize,
    /// Nodes moved onto the sweep.
    pub moved: usize,
    /// Nodes of the cut surface that could not move and stay off the sweep, or edges that could not be divided.
    pub refused: usize,
    /// Nodes duplicated.
    pub duplicated: usize,
    /// Edges collapsed.
    pub collapses: usize,
    /// Nodes added on edges and faces: in order to collapse degenerate elements, or where the sweep crosses edges.
    pub splits: usize,
    /// Degenerate elements at the cut surface before any was collapsed.
    pub flattened: usize,
    /// Degenerate elements that remain, because they could not be collapsed or were not to be.
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
    /// Where the points of the borders of all sweeps are [m], for [`Snapper::follow`].
    pub borders: Vec<Vec<Vector3<f64>>>,
}

/// Cuts the mesh of one body, and remembers unfinished incisions.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct Snapper {
    how: MeshCut,
    settings: SnapSettings,
    /// By [`Borders::cut_of`].
    memories: BTreeMap<u32, Memory>,
    fronts: BTreeMap<u32, Front>,
    borders: Borders,
    joined: Vec<u32>,
    tags: BTreeMap<FaceKey, u32>,
}

impl Snapper {
    /// Cuts in this way. The settings matter to [`MeshCut::Snap`] alone.
    pub fn new(how: MeshCut, settings: SnapSettings) -> Self {
        Self { how, settings, ..Self::default() }
    }

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

    /// Earlier incisions that the last sweep goes on with, ascending.
    pub fn joined(&self) -> &[u32] {
        &self.joined
    }

    /// This snapper before its first cut.
    pub fn afresh(&self) -> Self {
        Self::new(self.how, self.settings)
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
        let front = self.fronts.get(&incision);
        let mut triangles = sweep_triangles(front, blade, nodes.x);
        let edges = border_edges(front, blade, nodes.x);
        let reach = JoinSizes { cell_m: mesh.cell_m(), back_m: 0.0 };
        let mut joined = self.borders.join(&edges, &triangles, incision, nodes.x, reach);
        triangles.append(&mut joined.triangles);
        self.joined = joined.incisions;
        let (near, examined) = mesh.pieces_near(nodes.x, &sweep_bounds(&triangles, blade));
        // Nothing is cut inside the elements of this mesh, so its pieces are its elements.
        let near = near.to_vec();
        self.borders.remember(&edges, incision, &|corners| mesh.candidates_near(corners), nodes.x);
        let before = Before { tets: &mesh.mesh().tets, around: mesh.elements_around(), nodes };
        let mut complex = Complex::new(before, std::mem::take(&mut self.tags));
        // Nodes may move before the faces open, so last blade positions are looked up first.
        let fronts = self.last_blades(&complex, blade, incision);
        let n_elements = mesh.mesh().tets.len();
        let mut memory = self.memory_of(incision);
        cross(&complex, &near, &triangles, &mut memory);
        let opened = match (self.how, self.settings.moves) {
            (MeshCut::Snap, Moves::Sound) => smooth(&mut complex, &mut memory),
            (MeshCut::Snap, moves) => snap(&mut complex, &mut memory, moves),
            (MeshCut::Subdivide, _) => {
                let edges = edges_of_parted(&complex, &memory);
                settle_ends(&mut memory, &edges, INSIDE);
                divide(&mut complex, &mut memory)
            }
            (MeshCut::Remove, _) => take_out(&mut complex, &mut memory, (incision, n_elements)),
        };
        let pending = memory.crossings.len();
        self.memories.insert(self.borders.cut_of(incision), memory);
        let Some(opened) = opened else {
            self.tags = complex.into_tags();
            let report = SnapReport { pending, examined, ..SnapReport::default() };
            if let Some(last) = blade.segments.last() {
                self.fronts.insert(incision, mesh.front_among_candidates(last, nodes.x));
            }
            return Ok((report, None));
        };
        let borders = self.borders.places(nodes.x);
        let (report, cut) = self.open(complex, opened, incision);
        Ok((SnapReport { examined, ..report }, Some(SnapCut { fronts, borders, ..cut })))
    }

    /// Remembers the last blade positions by the material of the mesh after a cut, at the positions `x` [m] of
    /// its nodes.
    pub fn follow(&mut self, mesh: &mut CutMesh, x: &[Vector3<f64>], cut: &SnapCut) {
        self.fronts = cut.fronts.iter().map(|(incision, ends)| (*incision, mesh.front(ends, x))).collect();
        mesh.pieces_near(x, &bounds(cut.borders.iter().flatten()));
        self.borders.bind_again(&cut.borders, &|corners| mesh.candidates_near(corners), x);
    }

    /// Takes out what the cut that the incision is a part of has crossed, in the order of the incisions.
    fn memory_of(&mut self, incision: u32) -> Memory {
        let cut = self.borders.cut_of(incision);
        let parts = self.memories.extract_if(.., |id, _| self.borders.cut_of(*id) == cut);
        parts.map(|(_, memory)| memory).reduce(Memory::joined).unwrap_or_default()
    }

    /// Opens the selected faces, and removes degenerate elements where nodes were moved.
    fn open(&mut self, mut complex: Complex<'_>, opened: Opened, incision: u32) -> (SnapReport, SnapCut) {
        let Opened { mut report, faces, nodes: mut surface } = opened;
        let mut beside = BTreeSet::new();
        for &key in &faces {
            complex.set_tag(key, Some(incision));
            beside.extend(around_face(&complex, key));
        }
        report.elements = report.elements.max(beside.len());
        let pressed = self.clean_pressed(&mut complex, &mut surface);
        // A marked face with elements on both sides is still closed, and its nodes may have to be split. So may the
        // nodes of elements that were taken out.
        let tagged = complex.tags().keys().filter(|key| around_face(&complex, **key).len() == 2).flatten();
        let taken = surface.iter().filter(|_| self.how == MeshCut::Remove);
        let closed: BTreeSet<u32> = tagged.chain(taken).copied().collect();
        let mut memories: Vec<&mut Memory> = self.memories.values_mut().collect();
        let duplicates = dissect(&mut complex, &closed, &mut memories);
        report.duplicated = duplicates.len();
        let mut cleaned = match self.how {
            MeshCut::Snap => {
                let touched = surface.iter().chain(duplicates.iter().map(|d| &d.node));
                let region = touched.flat_map(|&n| complex.around(n).iter().copied()).collect();
                match self.settings.clean {
                    true => clean(&mut complex, region),
                    false => Cleaned::nothing(&complex, &region),
                }
            }
            MeshCut::Subdivide | MeshCut::Remove => Cleaned::default(),
        };
        cleaned.follow(pressed);
        (report.collapses, report.flattened) = (cleaned.collapses, cleaned.found);
        (report.splits, report.degenerate) = (report.splits + cleaned.splits, cleaned.left);

        // Nodes that no element uses are dropped, so everything remembered by node number has to follow.
        let number = numbers(&complex);
        let find = |n: u32| number[cleaned.kept(n) as usize];
        for memory in self.memories.values_mut() {
            memory.renumber(&complex, find);
        }
        self.memories.retain(|_, memory| !memory.crossings.is_empty() || !memory.on.is_empty());
        report.copied = complex.copied();
        let cut = compact(&complex, &number, &duplicates);
        self.tags = tags_of(&complex, &number);
        report.pending =
            self.memories.get(&self.borders.cut_of(incision)).map_or(0, |memory| memory.crossings.len());
        (report, cut)
    }

    /// Removes what [`Moves::Press`] has pressed flat, before the faces open: it lies inside the body then, where a
    /// collapse keeps the volume. The nodes of the cut `surface` change with the mesh, and so does what incisions remember.
    fn clean_pressed(&mut self, complex: &mut Complex, surface: &mut BTreeSet<u32>) -> Cleaned {
        let SnapSettings { moves, clean: wanted } = self.settings;
        if self.how != MeshCut::Snap || moves != Moves::Press || !wanted {
            return Cleaned::default();
        }
        let n_nodes = complex.n_nodes() as u32;
        let region = surface.iter().flat_map(|&n| complex.around(n).iter().copied()).collect();
        let cleaned = clean(complex, region);
        let kept = |n: u32| Some(cleaned.kept(n));
        self.memories.values_mut().for_each(|memory| memory.renumber(complex, kept));
        *surface = surface.iter().map(|&n| cleaned.kept(n)).collect();
        spare_crumbs(complex, surface);
        // Nodes added on faces of a cut surface lie on it too.
        while let Some((tag, n, normal)) = self.added_on_surface(complex, n_nodes) {
            surface.insert(n);
            self.memories.entry(self.borders.cut_of(tag)).or_default().on.insert(n, normal);
        }
        cleaned
    }

    /// A node from number `from` on that lies on the cut surface of an incision, which does not know it yet, and the
    /// normal of a node beside it.
    fn added_on_surface(&self, complex: &Complex<'_>, from: u32) -> Option<(u32, u32, Vector3<f64>)> {
        complex.tags().iter().filter(|(key, _)| key.iter().any(|n| *n >= from)).find_map(|(key, &tag)| {
            let on = &self.memories.get(&self.borders.cut_of(tag))?.on;
            let n = key.iter().find(|n| **n >= from && !on.contains_key(n))?;
            Some((tag, *n, *key.iter().find_map(|n| on.get(n))?))
        })
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

/// What a cut is about to open.
#[derive(Default)]
struct Opened {
    report: SnapReport,
    /// Faces that open; none where elements were taken out.
    faces: BTreeSet<FaceKey>,
    /// Nodes of the cut surface.
    nodes: BTreeSet<u32>,
}

/// Selects faces and moves their nodes; `None` if nothing can be cut. Nodes move before the faces open: a node still has
/// all of its elements then, and moves for both lips.
fn snap(complex: &mut Complex, memory: &mut Memory, moves: Moves) -> Option<Opened> {
    let Selection { marks, faces } = select(complex, memory);
    if faces.is_empty() {
        return None;
    }
    let mut report = SnapReport { faces: faces.len(), ..SnapReport::default() };
    let nodes: BTreeSet<u32> = faces.iter().flatten().copied().collect();
    let wanted: Vec<u32> = nodes.iter().copied().filter(|n| marks.contains_key(n)).collect();
    if moves != Moves::None {
        report.moved = wanted.len();
        report.refused = relocate_all(complex, wanted, &marks);
        report.moved -= report.refused;
    }
    memory.settle(nodes.iter().filter_map(|n| Some((*n, marks.get(n)?.normal))));
    Some(Opened { report, faces, nodes })
}

/// Moves nodes as far as elements stay sound, and divides the edges both ends of which would have to stay; `None` if
/// nothing can be cut.
fn smooth(complex: &mut Complex, memory: &mut Memory) -> Option<Opened> {
    let edges = edges_of_parted(complex, memory);
    let mut moved = 0;
    for bound in SOUND {
        let now = relocate_ends(complex, &edges, memory, bound);
        moved += now.len();
        memory.settle(now.into_iter());
    }
    let off = settle_ends(memory, &edges, CLOSE);
    let opened = divide(complex, memory);
    if moved == 0 && opened.is_none() {
        return None;
    }
    let mut opened = opened.unwrap_or_default();
    opened.report.moved = moved;
    opened.report.refused += off;
    Some(opened)
}

/// Divides the elements that the incision has parted; `None` if there are none.
fn divide(complex: &mut Complex, memory: &mut Memory) -> Option<Opened> {
    let divided = subdivide(complex, memory);
    if divided.splits == 0 && divided.faces.is_empty() {
        return None;
    }
    let nodes = divided.faces.iter().flatten().copied().collect();
    let (splits, refused) = (divided.splits, divided.refused);
    let report = SnapReport { faces: divided.faces.len(), splits, refused, ..SnapReport::default() };
    Some(Opened { report, faces: divided.faces, nodes })
}

/// Takes out the elements that the sweep touches; `None` if there are none.
fn take_out(
    complex: &mut Complex,
    memory: &mut Memory,
    (incision, n_elements): (u32, usize),
) -> Option<Opened> {
    let removed = remove(complex, memory, incision, n_elements);
    // What was crossed is gone: nothing is left for the next sweep.
    *memory = Memory::default();
    if removed.elements == 0 {
        return None;
    }
    let report = SnapReport { elements: removed.elements, ..SnapReport::default() };
    Some(Opened { report, faces: BTreeSet::new(), nodes: removed.nodes })
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
    SnapCut { mesh, nodes, duplicates, fronts: Vec::new(), borders: Vec::new() }
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

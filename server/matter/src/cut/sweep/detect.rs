//! Where a sweep crosses fragment edges, passes through vertices and runs along faces.

use nalgebra::Vector3;

use crate::mesh::{TET_EDGES, TET_FACES, TetMesh};
use crate::storage::reserve::{reserved, resize_reserving};

use super::bit_marks::{Ascending, BitMarks};
use super::blade::Work;
use super::sweep_triangle::SweepTriangle;
use crate::cut::drawn::traces::{Traces, line_across};
use crate::cut::topology::crossings::{Crossings, EdgeSet, SNAP, edge_key};
use crate::cut::topology::fragments::{Fragments, NONE};
use crate::cut::topology::incision_sets::IncisionSets;
use crate::cut::topology::pieces::PieceTable;
use crate::cut::topology::runs::Runs;
use crate::cut::topology::slot::slot_of;

/// Mark of fragments that the sweep touches.
const TOUCHED: u8 = 1;

/// Number of box comparisons that cost as much as examining one fragment.
const CANDIDATES_PER_FRAGMENT: usize = 16;

/// Progress of the search for the crossings of a sweep.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub(crate) struct Place {
    triangle: usize,
    candidate: usize,
    touched: usize,
}

/// The parts of the body that detection reads.
pub(crate) struct Deformed<'a> {
    /// Rest mesh.
    pub mesh: &'a TetMesh,
    /// Pieces and their copies.
    pub pieces: &'a PieceTable,
    /// Position [m] of every copy.
    pub x: &'a [Vector3<f64>],
}

impl Deformed<'_> {
    /// Position [m] of fragment vertex `v`, seen from piece `p`.
    pub(crate) fn vertex(&self, fragments: &Fragments, p: u32, v: u32) -> Vector3<f64> {
        let piece = &self.pieces.pieces[p as usize];
        let nodes = &self.mesh.tets[piece.element as usize];
        let vertex = &fragments.vertices[v as usize];
        let mut position = Vector3::zeros();
        for (&node, &weight) in vertex.nodes.iter().zip(&vertex.weights) {
            if let Some(a) = slot_of(nodes, node) {
                position += self.x[piece.copies[a] as usize] * weight;
            }
        }
        position
    }
}

/// Result of the detection, the fragments to examine, and its scratch arrays.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct Detector {
    /// Fragments that the sweep touches, ascending.
    pub touched: Vec<u32>,
    /// Pieces whose tet may meet the sweep, with the box around it [m].
    candidates: Vec<(u32, Vector3<f64>, Vector3<f64>)>,
    /// Per copy one bit for each face of the box around the sweep beyond which the copy lies.
    beyond: Vec<u8>,
    /// The same per node; a bit is set where it is set for all copies of the node.
    node_beyond: Vec<u8>,
    /// Ids of the candidate pieces, ascending.
    pub near: Vec<u32>,
    /// Number of elements whose nodes the last search for candidates looked at.
    pub examined: usize,
    marks: BitMarks,
    order: Ascending,
    position: Vec<Vector3<f64>>,
    position_stamp: Vec<u32>,
    side: Vec<f64>,
    side_stamp: Vec<u32>,
    tested: EdgeSet,
    sweep_stamp: u32,
    triangle_stamp: u32,
}

/// The state of the fragment mesh in which detection records a sweep.
pub(crate) struct Record<'a> {
    /// Fragment mesh. Vertices and faces get marked.
    pub fragments: &'a mut Fragments,
    /// Table of incision sets.
    pub sets: &'a mut IncisionSets,
    /// Crossings of edges.
    pub crossings: &'a mut Crossings,
    /// Lines that blades drew on the boundary.
    pub traces: &'a mut Traces,
    /// Incision of the sweep.
    pub incision: u32,
    /// Earlier incisions that are parts of the same cut.
    pub joined: &'a [u32],
}

impl Record<'_> {
    fn is_on(&self, v: u32) -> bool {
        self.sets.contains(self.fragments.on[v as usize], self.incision)
    }

    /// Whether the incision has opened along an edge of a boundary face of `t`.
    fn is_open_beside(&self, t: u32, face: usize) -> bool {
        let f = &*self.fragments;
        let on = TET_FACES[face].map(|k| self.is_on(f.tets[t as usize][k]));
        (0..3).any(|edge| {
            on[edge] && on[(edge + 1) % 3] && {
                let (beside, slot, _) = f.around_edge(t, face, edge);
                f.tag[beside as usize][slot] == self.incision
            }
        })
    }

    /// Whether another incision has entered fragment `t` without cutting it apart.
    fn is_unfinished(&self, other: u32, t: u32) -> bool {
        let f = &*self.fragments;
        let tet = f.tets[t as usize];
        let along = |face: usize| {
            f.neighbour[t as usize][face] != NONE && self.sets.contains(f.along[t as usize][face], other)
        };
        (0..4).any(along)
            || TET_EDGES.iter().any(|&[i, j]| self.crossings.get(tet[i], tet[j], other).is_some())
    }

    /// Takes over what other parts of the cut have crossed in fragment `t` and not cut apart.
    fn take_over(&mut self, t: u32) {
        let Self { joined, incision, .. } = *self;
        for &other in joined {
            if !self.is_unfinished(other, t) {
                continue;
            }
            let tet = self.fragments.tets[t as usize];
            for v in tet {
                let on = &mut self.fragments.on[v as usize];
                if self.sets.contains(*on, other) {
                    *on = self.sets.with(*on, incision);
                }
            }
            for [a, b] in TET_EDGES.map(|[i, j]| [tet[i], tet[j]]) {
                if let Some(s) = self.crossings.get(a, b, other) {
                    self.crossings.insert(a, b, incision, s);
                }
            }
            for face in 0..4 {
                let along = &mut self.fragments.along[t as usize][face];
                if self.sets.contains(*along, other) {
                    *along = self.sets.with(*along, incision);
                    self.mark_along(t, face);
                }
            }
        }
    }

    fn mark_along(&mut self, t: u32, face: usize) {
        let n = self.fragments.neighbour[t as usize][face];
        let Some(back) = (n != NONE).then(|| self.fragments.face_towards(n, t)).flatten() else { return };
        for (t, face) in [(t, face), (n, back)] {
            let along = &mut self.fragments.along[t as usize][face];
            *along = self.sets.with(*along, self.incision);
        }
    }
}

impl Detector {
    /// Reserves memory for an uncut body and for what cuts add.
    pub(crate) fn with_capacity(n_nodes: usize, n_elements: usize) -> Self {
        let mut detector = Self { marks: BitMarks::with_capacity(n_elements), ..Self::default() };
        resize_reserving(&mut detector.beyond, n_nodes, 0);
        resize_reserving(&mut detector.node_beyond, n_nodes, 0);
        detector.make_room(n_nodes);
        detector.candidates = reserved(n_elements / 16, (0, Vector3::zeros(), Vector3::zeros()));
        detector.near = reserved(n_elements / 16, 0);
        detector.touched = reserved(n_elements / 8, 0);
        detector
    }

    fn make_room(&mut self, n_vertices: usize) {
        resize_reserving(&mut self.position, n_vertices, Vector3::zeros());
        resize_reserving(&mut self.position_stamp, n_vertices, 0);
        resize_reserving(&mut self.side, n_vertices, 0.0);
        resize_reserving(&mut self.side_stamp, n_vertices, 0);
    }

    /// Copies of those candidate pieces whose bounding box overlaps the box between two corners [m].
    pub(crate) fn tets_near(&self, [from, to]: &[Vector3<f64>; 2], pieces: &PieceTable) -> Vec<[u32; 4]> {
        let overlaps = |(_, low, high): &&(u32, Vector3<f64>, Vector3<f64>)| {
            (0..3).all(|k| from[k] <= high[k] && low[k] <= to[k])
        };
        self.candidates.iter().filter(overlaps).map(|c| pieces.pieces[c.0 as usize].copies).collect()
    }

    /// Finds the pieces whose tet may meet the box between two corners [m]: those whose four corners are not
    /// all beyond the same face of the box. `runs` and the node of every copy rule out most elements early.
    pub(crate) fn find_candidates(
        &mut self,
        body: &Deformed,
        (runs, copy_node): (&Runs, &[u32]),
        [low, high]: &[Vector3<f64>; 2],
    ) {
        let Deformed { mesh, pieces, x } = body;
        let beyond = |x: &Vector3<f64>| {
            (0..3).fold(0, |faces, k| faces << 2 | u8::from(x[k] < low[k]) << 1 | u8::from(x[k] > high[k]))
        };
        self.beyond.clear();
        self.beyond.extend(x.iter().map(beyond));
        let n_nodes = mesh.nodes.len();
        let (of_nodes, further) = self.beyond.split_at(n_nodes);
        self.node_beyond.clear();
        self.node_beyond.extend_from_slice(of_nodes);
        // A node is beyond a face only if all of its copies are.
        for (&node, beyond) in copy_node[n_nodes..].iter().zip(further) {
            self.node_beyond[node as usize] &= beyond;
        }
        self.near.clear();
        self.examined = 0;
        let elements = runs.within_reach(&self.node_beyond).inspect(|_| self.examined += 1);
        self.near.extend(elements.flat_map(|e| pieces.of_element(e)).filter(|&p| {
            let [a, b, c, d] = pieces.pieces[p as usize].copies.map(|c| self.beyond[c as usize]);
            a & b & c & d == 0
        }));
        self.order.sort(&mut self.near);
        self.candidates.clear();
        self.candidates.extend(self.near.iter().map(|&p| {
            let [a, b, c, d] = pieces.pieces[p as usize].copies.map(|c| &x[c as usize]);
            (p, a.inf(b).inf(&c.inf(d)), a.sup(b).sup(&c.sup(d)))
        }));
    }

    /// Starts the search for a sweep among the candidates.
    pub(crate) fn begin(&mut self, fragments: &Fragments) -> Place {
        self.touched.clear();
        self.sweep_stamp += 1;
        self.marks.restart(fragments.tets.len());
        self.make_room(fragments.vertices.len());
        Place::default()
    }

    /// Records crossings, vertices on the sheet and faces along it, starting at `place`. Returns `true` when
    /// `touched` is complete, `false` when the budget ran out first. The number of parts has no influence on
    /// the result.
    pub(crate) fn run(
        &mut self,
        body: &Deformed,
        triangles: &[SweepTriangle],
        record: &mut Record,
        (place, work): (&mut Place, &mut Work),
    ) -> bool {
        while let Some(triangle) = triangles.get(place.triangle) {
            if place.candidate == 0 {
                self.triangle_stamp += 1;
                self.tested.clear();
            }
            let from = place.candidate;
            while let Some(&(p, low, high)) = self.candidates.get(place.candidate) {
                if work.is_done() {
                    return false;
                }
                place.candidate += 1;
                if triangle.overlaps(&low, &high) && triangle.may_cross(&low, &high) {
                    work.book(self.test_piece(body, triangle, p, record));
                }
            }
            work.book(1 + (place.candidate - from) / CANDIDATES_PER_FRAGMENT);
            (place.triangle, place.candidate) = (place.triangle + 1, 0);
        }
        if !self.mark_faces_at_the_sheet(body, triangles, record, (place, work)) {
            return false;
        }
        // The order in which fragments are separated must not depend on the order of the triangles.
        self.order.sort(&mut self.touched);
        true
    }

    /// Tests all fragments of piece `p` against one triangle and returns their number.
    fn test_piece(
        &mut self,
        body: &Deformed,
        triangle: &SweepTriangle,
        p: u32,
        record: &mut Record,
    ) -> usize {
        let mut t = body.pieces.first_fragment[p as usize];
        let mut looked_at = 0;
        while t != NONE {
            looked_at += 1;
            let tet = record.fragments.tets[t as usize];
            let side = tet.map(|v| self.side_of(body, triangle, p, v, record.fragments));
            if !(side.iter().all(|&s| s > 0.0) || side.iter().all(|&s| s < 0.0)) {
                self.touch(t, record);
                for [i, j] in TET_EDGES {
                    if side[i] * side[j] <= 0.0 && (side[i] != 0.0 || side[j] != 0.0) {
                        self.test_edge(triangle, t, [tet[i], tet[j]], [side[i], side[j]], record);
                    }
                }
                self.test_flat_faces(body, triangle, t, &side, record);
                self.draw_lines(triangle, t, &side, record);
            }
            t = record.fragments.next_in_piece[t as usize];
        }
        looked_at
    }

    /// Records the lines in which the triangle crosses the boundary faces of fragment `t`.
    fn draw_lines(&self, triangle: &SweepTriangle, t: u32, side: &[f64; 4], record: &mut Record) {
        for (face, corners) in TET_FACES.iter().enumerate() {
            if record.fragments.neighbour[t as usize][face] != NONE {
                continue;
            }
            let Some(line) = line_across(corners.map(|k| side[k])) else { continue };
            let x = corners.map(|k| self.position[record.fragments.tets[t as usize][k] as usize]);
            let segment = line.map(|w| x[0] * w[0] + x[1] * w[1] + x[2] * w[2]);
            if let Some(part) = triangle.part_of(&segment)
                && !record.is_open_beside(t, face)
            {
                let ends = part.map(|s| line[0].lerp(&line[1], s));
                record.traces.draw(4 * t + face as u32, record.incision, ends);
            }
        }
    }

    fn touch(&mut self, t: u32, record: &mut Record) {
        if self.marks.insert(t, TOUCHED) {
            self.touched.push(t);
            record.take_over(t);
        }
    }

    fn side_of(&mut self, body: &Deformed, triangle: &SweepTriangle, p: u32, v: u32, f: &Fragments) -> f64 {
        let k = v as usize;
        let position = self.locate(body, f, p, v);
        if self.side_stamp[k] != self.triangle_stamp {
            self.side_stamp[k] = self.triangle_stamp;
            self.side[k] = triangle.side(&position);
        }
        self.side[k]
    }

    /// Tests one edge. Its ends lie on different sides of the plane, or one of them lies on it.
    fn test_edge(
        &mut self,
        triangle: &SweepTriangle,
        t: u32,
        [a, b]: [u32; 2],
        [side_a, side_b]: [f64; 2],
        record: &mut Record,
    ) {
        if !self.tested.insert(edge_key(a, b)) || record.is_on(a) || record.is_on(b) {
            return;
        }
        if record.crossings.get(a, b, record.incision).is_some()
            || !triangle.holds_line(&self.position[a as usize], &self.position[b as usize])
        {
            return;
        }
        let s = side_a / (side_a - side_b);
        if s <= SNAP {
            self.put_on_sheet(t, a, record);
        } else if s >= 1.0 - SNAP {
            self.put_on_sheet(t, b, record);
        } else {
            record.crossings.insert(a, b, record.incision, s);
        }
    }

    /// Puts a vertex on the sheet and touches all fragments around it.
    fn put_on_sheet(&mut self, t: u32, v: u32, record: &mut Record) {
        let on = &mut record.fragments.on[v as usize];
        *on = record.sets.with(*on, record.incision);
        let mut star = Vec::new();
        record.fragments.star(t, v, &mut star);
        for t in star {
            self.touch(t, record);
        }
    }

    /// Marks the faces in the plane of the triangle that the sweep passes through.
    fn test_flat_faces(
        &mut self,
        body: &Deformed,
        triangle: &SweepTriangle,
        t: u32,
        side: &[f64; 4],
        record: &mut Record,
    ) {
        let x = record.fragments.tets[t as usize].map(|v| self.position[v as usize]);
        let longest = TET_EDGES.iter().map(|&[i, j]| (x[i] - x[j]).norm_squared()).fold(0.0, f64::max).sqrt();
        let flat = side.map(|s| s.abs() <= SNAP * triangle.double_area * longest);
        for (face, corners) in TET_FACES.iter().enumerate() {
            if corners.iter().all(|&k| flat[k]) {
                self.test_face(body, std::slice::from_ref(triangle), t, face, record);
            }
        }
    }

    /// Marks a closed face if a triangle passes between the centres of the two fragments it joins.
    fn test_face(
        &mut self,
        body: &Deformed,
        triangles: &[SweepTriangle],
        t: u32,
        face: usize,
        record: &mut Record,
    ) {
        let n = record.fragments.neighbour[t as usize][face];
        if n == NONE || record.sets.contains(record.fragments.along[t as usize][face], record.incision) {
            return;
        }
        let tet = record.fragments.tets[t as usize];
        let far = record.fragments.tets[n as usize];
        let f = &*record.fragments;
        let near_centre =
            tet.map(|v| self.locate(body, f, f.piece[t as usize], v)).iter().sum::<Vector3<f64>>() / 4.0;
        let far_centre =
            far.map(|v| self.locate(body, f, f.piece[n as usize], v)).iter().sum::<Vector3<f64>>() / 4.0;
        let face_centre =
            TET_FACES[face].iter().map(|&k| self.position[tet[k] as usize]).sum::<Vector3<f64>>() / 3.0;
        if triangles.iter().any(|s| s.meets(&near_centre, &face_centre) || s.meets(&face_centre, &far_centre))
        {
            record.mark_along(t, face);
        }
    }

    /// Tests all faces with a vertex on the sheet. A bent sheet may run through the three vertices of a face
    /// that lies in the plane of no triangle. Returns `true` when all touched fragments were examined.
    fn mark_faces_at_the_sheet(
        &mut self,
        body: &Deformed,
        triangles: &[SweepTriangle],
        record: &mut Record,
        (place, work): (&mut Place, &mut Work),
    ) -> bool {
        while let Some(&t) = self.touched.get(place.touched) {
            if work.is_done() {
                return false;
            }
            place.touched += 1;
            let on = record.fragments.tets[t as usize].map(|v| record.is_on(v));
            if !on.contains(&true) {
                continue;
            }
            for (face, corners) in TET_FACES.iter().enumerate() {
                if corners.iter().any(|&k| on[k]) {
                    self.test_face(body, triangles, t, face, record);
                    work.book(1 + triangles.len() / CANDIDATES_PER_FRAGMENT);
                }
            }
        }
        true
    }

    fn locate(&mut self, body: &Deformed, fragments: &Fragments, p: u32, v: u32) -> Vector3<f64> {
        if self.position_stamp[v as usize] != self.sweep_stamp {
            self.position_stamp[v as usize] = self.sweep_stamp;
            self.position[v as usize] = body.vertex(fragments, p, v);
        }
        self.position[v as usize]
    }
}

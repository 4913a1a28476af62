//! The boundary of the uncut mesh: its faces, and the edges and corners that connected faces share.

use crate::cut::topology::fragments::{Fragments, NONE};
use crate::mesh::{TET_FACES, TetMesh};

/// One boundary face of the uncut body.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct BaseFace {
    /// Element it belongs to, or [`NONE`] if the boundary is a surface of its own.
    pub element: u32,
    /// Its nodes, counter-clockwise seen from outside.
    pub nodes: [u32; 3],
    /// Edge from node k to the next, shared with the face beside it.
    pub edges: [u32; 3],
    /// Whether the shared edge runs in the direction of this face.
    pub forward: [bool; 3],
    /// Corner at node k, shared by the faces of one fan around the node.
    pub corners: [u32; 3],
}

/// All boundary faces of the uncut mesh.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Base {
    pub faces: Vec<BaseFace>,
    /// Number of distinct edges.
    pub n_edges: usize,
    /// Number of distinct corners.
    pub n_corners: usize,
    /// Face per 4·element + slot of the opposite node, or [`NONE`].
    face_at: Vec<u32>,
}

impl Base {
    /// The boundary of a fragment mesh without cuts.
    pub(super) fn new(mesh: &TetMesh, fragments: &Fragments) -> Self {
        let mut base = Self { face_at: vec![NONE; 4 * mesh.tets.len()], ..Self::default() };
        let mut place = Vec::new();
        for (e, tet) in (0u32..).zip(&mesh.tets) {
            for (k, corners) in TET_FACES.iter().enumerate() {
                if fragments.neighbour[e as usize][k] == NONE {
                    base.face_at[4 * e as usize + k] = base.faces.len() as u32;
                    place.push((e, k));
                    base.faces.push(BaseFace {
                        element: e,
                        nodes: corners.map(|c| tet[c]),
                        edges: [NONE; 3],
                        forward: [true; 3],
                        corners: [NONE; 3],
                    });
                }
            }
        }
        // Half-edges are paired through the solid, so parts that meet only in a node or an edge stay apart.
        let beside = |h: usize| {
            let (e, k) = place[h / 3];
            let (far, slot, edge) = fragments.around_edge(e, k, h % 3);
            3 * base.face_at[4 * far as usize + slot] as usize + edge
        };
        let twin: Vec<usize> = (0..3 * base.faces.len()).map(beside).collect();
        base.join(&twin);
        base
    }

    /// Any closed surface. `twin` is the opposite of half-edge 3·face + k, which runs from corner k to the next.
    pub(super) fn of_surface(triangles: &[[u32; 3]], twin: &[usize]) -> Self {
        let face = |&nodes: &[u32; 3]| BaseFace {
            element: NONE,
            nodes,
            edges: [NONE; 3],
            forward: [true; 3],
            corners: [NONE; 3],
        };
        let mut base = Self { faces: triangles.iter().map(face).collect(), ..Self::default() };
        base.join(twin);
        base
    }

    /// Numbers edges and corners.
    fn join(&mut self, twin: &[usize]) {
        for h in 0..twin.len() {
            if self.faces[h / 3].edges[h % 3] == NONE {
                for (half, forward) in [(h, true), (twin[h], false)] {
                    self.faces[half / 3].edges[half % 3] = self.n_edges as u32;
                    self.faces[half / 3].forward[half % 3] = forward;
                }
                self.n_edges += 1;
            }
            // A corner is shared by all faces of one fan; the walk numbers the whole fan.
            let mut corner = h;
            if self.faces[h / 3].corners[h % 3] == NONE {
                while self.faces[corner / 3].corners[corner % 3] == NONE {
                    self.faces[corner / 3].corners[corner % 3] = self.n_corners as u32;
                    corner = twin[corner / 3 * 3 + (corner + 2) % 3];
                }
                self.n_corners += 1;
            }
        }
    }

    /// Boundary faces of element `e`.
    pub(super) fn faces_of(&self, e: u32) -> impl Iterator<Item = u32> {
        let at = 4 * e as usize;
        self.face_at[at..at + 4].iter().copied().filter(|&f| f != NONE)
    }

    /// The two faces at each edge.
    pub(super) fn across(&self) -> Vec<[u32; 2]> {
        let mut across = vec![[NONE; 2]; self.n_edges];
        for (f, face) in (0u32..).zip(&self.faces) {
            for (&edge, &forward) in face.edges.iter().zip(&face.forward) {
                across[edge as usize][usize::from(forward)] = f;
            }
        }
        across
    }

    /// The faces at each corner.
    pub(super) fn faces_at_corners(&self) -> Vec<Vec<u32>> {
        let mut faces = vec![Vec::new(); self.n_corners];
        for (f, face) in (0u32..).zip(&self.faces) {
            face.corners.iter().for_each(|&corner| faces[corner as usize].push(f));
        }
        faces
    }

    /// The boundary face that contains the face of fragment `t` opposite its vertex `face`, if that face is
    /// part of the skin.
    pub(super) fn under(&self, mesh: &TetMesh, fragments: &Fragments, t: u32, face: usize) -> Option<u32> {
        let e = fragments.element[t as usize] as usize;
        let nodes = mesh.tets[e];
        let corners = TET_FACES[face].map(|c| &fragments.vertices[fragments.tets[t as usize][c] as usize]);
        (0..4).find_map(|slot| {
            let base = self.face_at[4 * e + slot];
            (base != NONE && corners.iter().all(|v| v.weight_of(nodes[slot]) == 0.0)).then_some(base)
        })
    }
}

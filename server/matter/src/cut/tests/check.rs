//! Independent checks of a cut state. Where it matters they do not use the code under test: the surface is
//! checked from its triangle list alone, the copies by union-find over all fragment faces.

use std::collections::{BTreeMap, BTreeSet};

use fastrand::Rng;
use nalgebra::{Matrix4, Vector3};

use crate::cut::shell::surface_builder::{Material, SurfaceBuilder};
use crate::cut::topology::fragments::NONE;
use crate::cut::{CutMesh, SolidCells};
use crate::mesh::TET_FACES;
use crate::testing::{Vectors as _, surface_is_closed_and_manifold};

/// Runs all checks.
pub(super) fn everything(cut: &CutMesh) {
    surface_is_closed_and_manifold(cut.surface());
    volumes(cut);
    fragments_conform(cut);
    copies_are_components(cut);
    material_hangs_together(cut);
    surface_is_that_of_a_new_build(cut);
    solid_fills_the_surface(cut);
}

/// The tetrahedra of the solid are positive at rest and fill the surface, wherever its copies are.
pub(super) fn solid_fills_the_surface(cut: &CutMesh) {
    let solid = cut.solid();
    let SolidCells::Tets(tets) = &solid.cells else { panic!("tetrahedra are filled by tetrahedra") };
    let volumes = |x: &[Vector3<f64>]| -> Vec<f64> {
        let points: Vec<_> = solid.vertices.iter().map(|vertex| vertex.position(x)).collect();
        let volume = |tet: &[u32; 4]| {
            let [a, b, c, d] = tet.map(|v| points[v as usize]);
            (b - a).dot(&(c - a).cross(&(d - a))) / 6.0
        };
        tets.iter().map(volume).collect()
    };
    let rest = cut.rest_positions();
    let total: f64 = cut.mesh().volumes().iter().sum();
    let at_rest = volumes(&rest);
    assert!(at_rest.iter().all(|&volume| volume > -1e-12 * total));
    assert!((at_rest.iter().sum::<f64>() - total).abs() < 1e-10 * total);
    let mut random = Rng::with_seed(7);
    let shift = 0.3 * total.cbrt();
    let moved: Vec<_> = rest.iter().map(|x| x + random.vector(shift)).collect();
    let (filled, enclosed) = (volumes(&moved).iter().sum::<f64>(), cut.surface().volume(&moved));
    assert!((filled - enclosed).abs() < 1e-9 * total, "solid fills {filled}, surface encloses {enclosed}");
    let mut of_pieces = vec![0.0; cut.pieces().len()];
    for (origin, volume) in solid.origins.iter().zip(at_rest) {
        of_pieces[origin.piece as usize] += volume;
    }
    for (p, volume) in of_pieces.into_iter().enumerate() {
        assert!((volume - cut.pieces.volume(p)).abs() < 1e-12 * total);
    }
}

/// Fractions sum to one per element, node volumes to those of the mesh, the surface encloses them.
pub(super) fn volumes(cut: &CutMesh) {
    let mesh = cut.mesh();
    let element_volume = mesh.volumes();
    let total: f64 = element_volume.iter().sum();
    let mut fraction = vec![0.0; mesh.tets.len()];
    for piece in cut.pieces() {
        assert!(piece.fraction > 0.0);
        fraction[piece.element as usize] += piece.fraction;
    }
    assert!(fraction.iter().all(|f| (f - 1.0).abs() < 1e-12), "fractions do not sum to one");
    let mut node_volume = vec![0.0; mesh.nodes.len()];
    for (tet, volume) in mesh.tets.iter().zip(&element_volume) {
        tet.iter().for_each(|&n| node_volume[n as usize] += volume / 4.0);
    }
    let mut of_copies = vec![0.0; mesh.nodes.len()];
    for (&node, &volume) in cut.copy_node().iter().zip(cut.copy_volume()) {
        assert!(volume >= 0.0);
        of_copies[node as usize] += volume;
    }
    for (expected, found) in node_volume.iter().zip(&of_copies) {
        assert!((expected - found).abs() < 1e-12 * total, "copy volume {found} instead of {expected}");
    }
    let enclosed = cut.surface().volume(&cut.rest_positions());
    assert!((enclosed - total).abs() < 1e-10 * total, "surface encloses {enclosed}, material is {total}");
    let parts: f64 = cut.components().volume.iter().sum();
    assert!((parts - total).abs() < 1e-10 * total);
}

/// Fragments have the volume that their weights give, never negative. Neighbours share exactly one face.
pub(super) fn fragments_conform(cut: &CutMesh) {
    let f = &cut.fragments;
    for t in 0..f.tets.len() {
        let nodes = cut.mesh().tets[f.element[t] as usize];
        let weights = f.tets[t].map(|v| nodes.map(|n| f.vertices[v as usize].weight_of(n)));
        let det = Matrix4::from_fn(|row, column| weights[column][row]).determinant();
        assert!(f.fraction[t] >= 0.0 && (det - f.fraction[t]).abs() < 1e-13, "fragment {t}: {det}");
        for v in f.tets[t] {
            let vertex = &f.vertices[v as usize];
            assert!(vertex.weights.iter().all(|&w| w >= 0.0));
            assert!((vertex.weights.iter().sum::<f64>() - 1.0).abs() < 1e-13);
            assert!(vertex.nodes.iter().all(|&n| n == NONE || nodes.contains(&n)));
        }
        for (k, &n) in f.neighbour[t].iter().enumerate() {
            if n != NONE {
                let back = f.face_towards(n, t as u32).unwrap();
                let face = |t: usize, k: usize| {
                    let mut face = TET_FACES[k].map(|c| f.tets[t][c]);
                    face.sort_unstable();
                    face
                };
                assert_eq!(face(t, k), face(n as usize, back), "fragments {t} and {n} share no face");
            }
        }
    }
}

struct UnionFind(Vec<usize>);

impl UnionFind {
    fn root(&mut self, i: usize) -> usize {
        if self.0[i] != i {
            self.0[i] = self.root(self.0[i]);
        }
        self.0[i]
    }

    fn join(&mut self, i: usize, j: usize) {
        let (i, j) = (self.root(i), self.root(j));
        self.0[i.max(j)] = i.min(j);
    }
}

/// Pieces are the face-connected parts of an element; copies of a node those of the pieces around it.
pub(super) fn copies_are_components(cut: &CutMesh) {
    let f = &cut.fragments;
    let mut part = UnionFind((0..f.tets.len()).collect());
    for t in 0..f.tets.len() {
        for n in f.neighbour[t] {
            if n != NONE && f.element[n as usize] == f.element[t] {
                part.join(t, n as usize);
            }
        }
    }
    let mut piece_of_part: BTreeMap<usize, u32> = BTreeMap::new();
    for t in 0..f.tets.len() {
        let piece = *piece_of_part.entry(part.root(t)).or_insert(f.piece[t]);
        assert_eq!(piece, f.piece[t], "a connected part has two pieces");
    }
    assert_eq!(piece_of_part.len(), cut.pieces().len(), "a piece is not connected");
    let mut around: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (p, piece) in cut.pieces().iter().enumerate() {
        for node in cut.mesh().tets[piece.element as usize] {
            around.entry(node).or_default().push(p);
        }
    }
    let mut links: BTreeMap<usize, BTreeSet<usize>> = BTreeMap::new();
    for t in 0..f.tets.len() {
        for n in f.neighbour[t] {
            if n != NONE && f.element[n as usize] != f.element[t] {
                links.entry(f.piece[t] as usize).or_default().insert(f.piece[n as usize] as usize);
            }
        }
    }
    let mut n_copies = 0;
    for (node, pieces) in around {
        let mut group = UnionFind((0..pieces.len()).collect());
        for (i, p) in pieces.iter().enumerate() {
            for (j, q) in pieces.iter().enumerate() {
                if links.get(p).is_some_and(|l| l.contains(q)) {
                    group.join(i, j);
                }
            }
        }
        let copy = |p: usize| {
            let piece = &cut.pieces()[p];
            let a = cut.mesh().tets[piece.element as usize].iter().position(|&n| n == node).unwrap();
            piece.copies[a]
        };
        for (i, &p) in pieces.iter().enumerate() {
            assert_eq!(cut.copy_node()[copy(p) as usize], node);
            for (j, &q) in pieces.iter().enumerate() {
                assert_eq!(group.root(i) == group.root(j), copy(p) == copy(q), "copies of node {node}");
            }
        }
        n_copies += (0..pieces.len()).filter(|&i| group.root(i) == i).count();
        let holder = (0..f.tets.len()).find(|&t| f.tets[t].contains(&node)).unwrap();
        assert_eq!(copy(f.piece[holder] as usize), node, "the real copy holds the node's material");
    }
    assert_eq!(n_copies, cut.n_copies(), "unused copies");
}

/// However the copies move, all fragments agree on the position of a vertex, and so does the surface.
pub(super) fn material_hangs_together(cut: &CutMesh) {
    let f = &cut.fragments;
    let mut random = Rng::with_seed(7);
    let x: Vec<Vector3<f64>> = (0..cut.n_copies()).map(|_| random.vector(1.0)).collect();
    let mut place: Vec<Option<Vector3<f64>>> = vec![None; f.vertices.len()];
    for t in 0..f.tets.len() {
        let piece = &cut.pieces()[f.piece[t] as usize];
        let nodes = cut.mesh().tets[piece.element as usize];
        for v in f.tets[t] {
            let at: Vector3<f64> = (0..4)
                .map(|a| x[piece.copies[a] as usize] * f.vertices[v as usize].weight_of(nodes[a]))
                .sum();
            let known = *place[v as usize].get_or_insert(at);
            assert!((known - at).norm() < 1e-12, "vertex {v} is in two places");
        }
    }
}

/// The surface kept up to date cut by cut has the same connectivity as one built from the fragments alone,
/// and its vertices lie where the fragments are.
pub(super) fn surface_is_that_of_a_new_build(cut: &CutMesh) {
    let f = &cut.fragments;
    let (fresh, _) = SurfaceBuilder::build(&Material { mesh: cut.mesh(), fragments: f, pieces: &cut.pieces });
    assert!(fresh.joints() == cut.builder.joints(), "half-edges are paired differently");
    assert_eq!(fresh.counts(), cut.builder.counts(), "vertices and edges between the same vertices");
    let mut random = Rng::with_seed(8);
    let x: Vec<Vector3<f64>> = (0..cut.n_copies()).map(|_| random.vector(1.0)).collect();
    for (id, (t, v)) in cut.builder.corners(f) {
        let piece = &cut.pieces()[f.piece[t as usize] as usize];
        let nodes = cut.mesh().tets[piece.element as usize];
        let at: Vector3<f64> =
            (0..4).map(|a| x[piece.copies[a] as usize] * f.vertices[v as usize].weight_of(nodes[a])).sum();
        let bound = cut.surface().vertices[id as usize].position(&x);
        assert!((bound - at).norm() < 1e-12, "surface vertex {id} is not where its fragment is");
    }
}

//! Connectivity of the tets of a mesh.

use std::collections::BTreeMap;

use scindo_physics::mesh::{TET_FACES, TetMesh};

/// Counts over the faces and boundary edges of a mesh.
pub(crate) struct Connectivity {
    /// Parts connected through faces.
    pub components: usize,
    /// Faces with more than two tets.
    pub overfull_faces: usize,
    /// Boundary edges without exactly two boundary faces.
    pub non_manifold_edges: usize,
}

/// Computes the counts for a mesh.
pub(crate) fn of(mesh: &TetMesh) -> Connectivity {
    let faces = sorted_faces(mesh);
    let overfull_faces = faces.chunk_by(|a, b| a.0 == b.0).filter(|same| same.len() > 2).count();
    let mut edges: BTreeMap<[u32; 2], usize> = BTreeMap::new();
    for face in mesh.boundary_faces() {
        for k in 0..3 {
            let (a, b) = (face.nodes[k], face.nodes[(k + 1) % 3]);
            *edges.entry([a.min(b), a.max(b)]).or_default() += 1;
        }
    }
    Connectivity {
        components: components(mesh).1,
        overfull_faces,
        non_manifold_edges: edges.values().filter(|&&n| n != 2).count(),
    }
}

/// Component of every tet, numbered by first appearance, and the number of components.
pub(crate) fn components(mesh: &TetMesh) -> (Vec<u32>, usize) {
    let neighbours = face_neighbours(mesh);
    let mut component: Vec<Option<u32>> = vec![None; mesh.tets.len()];
    let mut count = 0;
    for start in 0..mesh.tets.len() {
        if component[start].is_some() {
            continue;
        }
        component[start] = Some(count);
        let mut open = vec![start as u32];
        while let Some(tet) = open.pop() {
            for &other in &neighbours[tet as usize] {
                if component[other as usize].is_none() {
                    component[other as usize] = Some(count);
                    open.push(other);
                }
            }
        }
        count += 1;
    }
    (component.into_iter().flatten().collect(), count as usize)
}

/// For every tet the tets across its faces.
fn face_neighbours(mesh: &TetMesh) -> Vec<Vec<u32>> {
    let mut neighbours = vec![Vec::with_capacity(4); mesh.tets.len()];
    for same in sorted_faces(mesh).chunk_by(|a, b| a.0 == b.0) {
        if let [(_, a), (_, b)] = same {
            neighbours[*a as usize].push(*b);
            neighbours[*b as usize].push(*a);
        }
    }
    neighbours
}

/// Every face of every tet as sorted nodes and the tet, in ascending order.
fn sorted_faces(mesh: &TetMesh) -> Vec<([u32; 3], u32)> {
    let mut faces = Vec::with_capacity(4 * mesh.tets.len());
    for (e, tet) in mesh.tets.iter().enumerate() {
        for face in TET_FACES {
            let mut key = face.map(|a| tet[a]);
            key.sort_unstable();
            faces.push((key, e as u32));
        }
    }
    faces.sort_unstable();
    faces
}

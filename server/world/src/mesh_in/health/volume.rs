//! Checks and repairs a tetrahedral mesh from a file, and reports every repair.

use std::collections::BTreeSet;

use nalgebra::Vector3;
use scindo_physics::mesh::{DEGENERATE_VOLUME, TetMesh};
use serde::Serialize;

use super::{connectivity, weld};
use crate::format::{CellGroup, MeshInError, VolumeMesh, keep_tets};

/// Largest share of useless tetrahedra that is removed. A mesh with more is refused.
pub(crate) const MAX_DEGENERATE_TETS: f64 = 0.01;

/// Faults of a volume mesh, and its measures after repair.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct VolumeHealth {
    /// Nodes of the repaired mesh.
    pub nodes: usize,
    /// Tetrahedra of the repaired mesh.
    pub tets: usize,
    /// Inverted tetrahedra, reversed.
    pub flipped_tets: usize,
    /// Tetrahedra without volume, removed.
    pub degenerate_tets: usize,
    /// Tetrahedra on the same four nodes as another one, removed.
    pub duplicate_tets: usize,
    /// Nodes merged with another at the same place.
    pub welded_nodes: usize,
    /// Nodes that no tetrahedron uses, dropped.
    pub unused_nodes: usize,
    /// Faces with more than two tetrahedra: overlapping elements.
    pub overfull_faces: usize,
    /// Edges of the boundary that do not have exactly two boundary faces.
    pub non_manifold_edges: usize,
    /// Parts that are not connected over faces.
    pub components: usize,
    /// Smallest dihedral angle [degrees].
    pub min_dihedral_deg: f64,
    /// Smallest mean ratio (1: regular).
    pub min_mean_ratio: f64,
    /// Volume [m³].
    pub volume_m3: f64,
    /// Smallest corner of the bounding box [m].
    pub min_m: [f64; 3],
    /// Largest corner of the bounding box [m].
    pub max_m: [f64; 3],
    /// Groups that the file puts its tetrahedra into.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub groups: Vec<CellGroup>,
    /// Contents of the file that are not used.
    pub notes: Vec<String>,
}

/// Turns a volume mesh from a file into one that can be simulated. `scale` converts its unit to metres.
/// `weld` merges nodes at the same place; a mesh generated with a cut in it has such nodes on purpose.
pub fn repair_volume(
    volume: &VolumeMesh,
    scale: f64,
    weld: bool,
) -> Result<(TetMesh, VolumeHealth), MeshInError> {
    if !(scale.is_finite() && scale > 0.0) {
        return Err(MeshInError::Scale { file: volume.file.clone(), scale });
    }
    let (notes, groups) = (volume.notes.clone(), volume.groups.clone());
    let mut health = VolumeHealth { notes, groups, ..VolumeHealth::default() };
    let nodes: Vec<Vector3<f64>> = volume.nodes.iter().map(|x| x * scale).collect();
    let mut mesh = TetMesh { nodes, tets: volume.tets.clone() };
    if weld {
        let [low, high] = mesh.bounds();
        let (first_of, welded) = weld::coincident(&mesh.nodes, 1e-9 * (high - low).norm());
        health.welded_nodes = welded;
        mesh.tets.iter_mut().flatten().for_each(|n| *n = first_of[*n as usize]);
    }

    remove_useless(&mut mesh, &mut health);
    let (bad, total) = (health.degenerate_tets, volume.tets.len());
    if mesh.tets.is_empty() || bad as f64 > MAX_DEGENERATE_TETS * total as f64 {
        return Err(MeshInError::TooManyDegenerate {
            file: volume.file.clone(),
            element: "tetrahedra",
            bad,
            total,
            limit_percent: 100.0 * MAX_DEGENERATE_TETS,
        });
    }
    for e in 0..mesh.tets.len() {
        if mesh.volume(e) < 0.0 {
            mesh.tets[e].swap(2, 3);
            health.flipped_tets += 1;
        }
    }
    // Merged nodes are now unused too, but are already counted.
    health.unused_nodes = mesh.drop_unused_nodes().saturating_sub(health.welded_nodes);
    measure(&mesh, &mut health);
    Ok((mesh, health))
}

/// Removes tets that repeat a node, have no volume, or duplicate another tet.
fn remove_useless(mesh: &mut TetMesh, health: &mut VolumeHealth) {
    let mut seen = BTreeSet::new();
    let mut kept = Vec::with_capacity(mesh.tets.len());
    let mut numbers = Vec::with_capacity(mesh.tets.len());
    for e in 0..mesh.tets.len() {
        let mut key = mesh.tets[e];
        key.sort_unstable();
        let repeats_node = key.windows(2).any(|w| w[0] == w[1]);
        if repeats_node || mesh.volume(e).abs() <= DEGENERATE_VOLUME * mesh.longest_edge(e).powi(3) {
            health.degenerate_tets += 1;
        } else if seen.insert(key) {
            kept.push(mesh.tets[e]);
            numbers.push(e as u32);
        } else {
            health.duplicate_tets += 1;
        }
    }
    mesh.tets = kept;
    keep_tets(&mut health.groups, &numbers);
}

fn measure(mesh: &TetMesh, health: &mut VolumeHealth) {
    let quality = mesh.quality();
    health.nodes = mesh.nodes.len();
    health.tets = mesh.tets.len();
    health.min_dihedral_deg = quality.min_dihedral_rad.to_degrees();
    health.min_mean_ratio = quality.min_mean_ratio.0;
    health.volume_m3 = mesh.volumes().iter().sum();
    let [low, high] = mesh.bounds();
    (health.min_m, health.max_m) = (low.into(), high.into());
    let connectivity = connectivity::of(mesh);
    health.components = connectivity.components;
    health.overfull_faces = connectivity.overfull_faces;
    health.non_manifold_edges = connectivity.non_manifold_edges;
}

#[cfg(test)]
mod tests {
    use super::*;
    use scindo_physics::mesh::{BoxPattern, box_mesh};

    fn from_box() -> VolumeMesh {
        let mesh = box_mesh(Vector3::zeros(), Vector3::repeat(1.0), [4; 3], BoxPattern::Tet6);
        VolumeMesh {
            file: "box.msh".into(),
            nodes: mesh.nodes,
            tets: mesh.tets,
            groups: Vec::new(),
            notes: Vec::new(),
        }
    }

    #[test]
    fn a_good_mesh_is_untouched() {
        let volume = from_box();
        let (mesh, health) = repair_volume(&volume, 1.0, true).unwrap();
        assert_eq!((mesh.nodes, mesh.tets), (volume.nodes, volume.tets));
        let counts = [health.flipped_tets, health.degenerate_tets, health.welded_nodes, health.unused_nodes];
        assert_eq!((counts, health.components, health.non_manifold_edges), ([0; 4], 1, 0));
        assert!((health.volume_m3 - 1.0).abs() < 1e-12);
    }

    #[test]
    fn every_repair_is_made_and_counted() {
        let mut volume = from_box();
        volume.tets[5].swap(0, 1);
        volume.tets[9].swap(2, 3);
        volume.tets.push(volume.tets[20]);
        let [a, b, c, _] = volume.tets[30];
        volume.tets.push([a, b, c, c]);
        // Tet 0 gets its own copy of a node. Two nodes belong to no tet.
        let own = volume.nodes.len() as u32;
        volume.nodes.push(volume.nodes[volume.tets[0][1] as usize]);
        volume.tets[0][1] = own;
        volume.nodes.extend([Vector3::repeat(3.0), Vector3::repeat(4.0)]);
        let (mesh, health) = repair_volume(&volume, 0.01, true).unwrap();
        mesh.check().unwrap();
        assert_eq!((health.flipped_tets, health.duplicate_tets, health.degenerate_tets), (2, 1, 1));
        assert_eq!((health.welded_nodes, health.unused_nodes, health.components), (1, 2, 1));
        assert!((health.volume_m3 - 1e-6).abs() < 1e-15);
    }

    #[test]
    fn a_mesh_that_was_made_with_its_cut_keeps_it() {
        let mut volume = from_box();
        let n = volume.nodes.len() as u32;
        let beyond = |x: &Vector3<f64>| x.x > 0.5 + 1e-9;
        // The side beyond x = 0.5 gets its own nodes there.
        let nodes = volume.nodes.clone();
        volume.nodes.extend(nodes.iter());
        for tet in &mut volume.tets {
            if tet.iter().any(|&k| beyond(&nodes[k as usize])) {
                tet.iter_mut().for_each(|k| *k += n);
            }
        }
        let (_, apart) = repair_volume(&volume, 1.0, false).unwrap();
        assert_eq!((apart.components, apart.welded_nodes), (2, 0));
        let (_, joined) = repair_volume(&volume, 1.0, true).unwrap();
        assert_eq!((joined.components, joined.welded_nodes), (1, n as usize));
    }

    #[test]
    fn a_mesh_of_slivers_is_refused_with_counts() {
        let mut volume = from_box();
        for tet in volume.tets.iter_mut().step_by(10) {
            tet[3] = tet[0];
        }
        let message = repair_volume(&volume, 1.0, true).unwrap_err().to_string();
        assert!(message.contains("box.msh") && message.contains("39 of 384 tetrahedra"), "{message}");
    }

    #[test]
    fn parts_that_share_only_an_edge_are_reported() {
        let mesh = box_mesh(Vector3::zeros(), Vector3::repeat(1.0), [1; 3], BoxPattern::Tet6);
        let mut volume = VolumeMesh {
            file: "two".into(),
            nodes: mesh.nodes.clone(),
            tets: mesh.tets.clone(),
            groups: Vec::new(),
            notes: vec![],
        };
        let first = volume.nodes.len() as u32;
        let shift = Vector3::new(1.0, 1.0, 0.0);
        volume.nodes.extend(mesh.nodes.iter().map(|x| x + shift));
        volume.tets.extend(mesh.tets.iter().map(|t| t.map(|n| n + first)));
        let (_, health) = repair_volume(&volume, 1.0, true).unwrap();
        assert_eq!((health.components, health.welded_nodes, health.non_manifold_edges), (2, 2, 1));
    }
}

//! Makes the boundary a closed 2-manifold, and removes crumbs.
//!
//! Where the boundary touches itself in a node or an edge, parts would be connected by a hinge that no
//! material has. Nodes are doubled where the tets around them fall into groups without common faces. In the
//! remaining cases an edge or a node has two fans of boundary faces although the material is connected; the
//! smaller fan is removed.

use std::collections::{BTreeMap, BTreeSet};

use scindo_physics::mesh::TetMesh;

use super::LatticeReport;
use crate::mesh_in::health::connectivity::components;

/// Most rounds of repair. Each removes tets; two or three are typical.
const ROUNDS: usize = 64;

/// Doubles nodes and removes tets until the boundary is 2-manifold.
pub(super) fn make_manifold(mesh: &mut TetMesh, report: &mut LatticeReport) {
    for _ in 0..ROUNDS {
        report.split_nodes += split_nodes(mesh);
        let doomed = pinching_tets(mesh);
        if doomed.is_empty() {
            break;
        }
        report.removed_tets += doomed.len();
        remove(mesh, |tet| doomed.contains(&tet));
    }
    mesh.drop_unused_nodes();
}

/// Drops face-connected components below `share` of the largest one's volume.
pub(super) fn drop_crumbs(mesh: &mut TetMesh, share: f64, report: &mut LatticeReport) {
    let (component, count) = components(mesh);
    let mut volumes = vec![0.0; count];
    for (e, &c) in component.iter().enumerate() {
        volumes[c as usize] += mesh.volume(e);
    }
    let least = share * volumes.iter().copied().fold(0.0, f64::max);
    report.dropped_components = volumes.iter().filter(|v| **v < least).count();
    report.components = count - report.dropped_components;
    if report.dropped_components > 0 {
        remove(mesh, |tet| volumes[component[tet as usize] as usize] < least);
        mesh.drop_unused_nodes();
    }
}

fn remove(mesh: &mut TetMesh, doomed: impl Fn(u32) -> bool) {
    let mut number = 0u32;
    mesh.tets.retain(|_| {
        number += 1;
        !doomed(number - 1)
    });
}

/// Gives every group of tets around a node its own copy of the node, where a group is connected over faces at
/// that node. Returns the number of new nodes.
fn split_nodes(mesh: &mut TetMesh) -> usize {
    let boundary: BTreeSet<u32> = mesh.boundary_faces().iter().flat_map(|f| f.nodes).collect();
    let mut stars: BTreeMap<u32, Vec<u32>> = boundary.into_iter().map(|n| (n, Vec::new())).collect();
    for (e, tet) in mesh.tets.iter().enumerate() {
        for node in tet {
            if let Some(star) = stars.get_mut(node) {
                star.push(e as u32);
            }
        }
    }
    let mut added = 0;
    for (&node, star) in &stars {
        let groups = groups_around(mesh, node, star);
        for group in groups.iter().skip(1) {
            let copy = mesh.nodes.len() as u32;
            mesh.nodes.push(mesh.nodes[node as usize]);
            added += 1;
            for &tet in group {
                mesh.tets[tet as usize].iter_mut().filter(|n| **n == node).for_each(|n| *n = copy);
            }
        }
    }
    added
}

/// Groups of tets of a star that are connected over faces at the node.
fn groups_around(mesh: &TetMesh, node: u32, star: &[u32]) -> Vec<Vec<u32>> {
    // Seen from the node, a tet is the triangle of its other three nodes, and its faces are the edges of that
    // triangle.
    let others = |tet: u32| mesh.tets[tet as usize].iter().copied().filter(|&n| n != node);
    let mut edges: BTreeMap<[u32; 2], Vec<u32>> = BTreeMap::new();
    for &tet in star {
        let ring: Vec<u32> = others(tet).collect();
        for [a, b] in [[0, 1], [1, 2], [0, 2]] {
            edges.entry([ring[a].min(ring[b]), ring[a].max(ring[b])]).or_default().push(tet);
        }
    }
    connected(star, edges.values().map(Vec::as_slice))
}

/// Connected groups of `members`, where each link joins all members it lists. Groups are ordered by their
/// first member.
fn connected<'a>(members: &[u32], links: impl Iterator<Item = &'a [u32]>) -> Vec<Vec<u32>> {
    let index = |m: u32| members.binary_search(&m).unwrap_or(0);
    let mut parent: Vec<usize> = (0..members.len()).collect();
    fn root(parent: &mut [usize], mut i: usize) -> usize {
        while parent[i] != i {
            parent[i] = parent[parent[i]];
            i = parent[i];
        }
        i
    }
    for link in links {
        for pair in link.windows(2) {
            let (a, b) = (root(&mut parent, index(pair[0])), root(&mut parent, index(pair[1])));
            parent[a.max(b)] = a.min(b);
        }
    }
    let mut groups: BTreeMap<usize, Vec<u32>> = BTreeMap::new();
    for (i, &member) in members.iter().enumerate() {
        groups.entry(root(&mut parent, i)).or_default().push(member);
    }
    groups.into_values().collect()
}

/// Tets to remove because the boundary touches itself in an edge or a node.
fn pinching_tets(mesh: &TetMesh) -> BTreeSet<u32> {
    let skin = mesh.boundary_faces();
    let mut by_edge: BTreeMap<[u32; 2], Vec<u32>> = BTreeMap::new();
    let mut by_node: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for (f, face) in skin.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (face.nodes[k], face.nodes[(k + 1) % 3]);
            by_edge.entry([a.min(b), a.max(b)]).or_default().push(f as u32);
            by_node.entry(a).or_default().push(f as u32);
        }
    }
    let mut doomed = BTreeSet::new();
    for ([a, b], _) in by_edge.iter().filter(|(_, faces)| faces.len() > 2) {
        // Of the wedges of tets around the edge, remove the smallest.
        let wedges = wedges_around(mesh, *a, *b);
        let volume = |w: &Vec<u32>| w.iter().map(|&t| mesh.volume(t as usize)).sum::<f64>();
        let smallest = wedges.iter().min_by(|x, y| volume(x).total_cmp(&volume(y)).then(x.cmp(y)));
        doomed.extend(smallest.into_iter().flatten());
    }
    // Edges first: removing them may already resolve the nodes.
    if !doomed.is_empty() {
        return doomed;
    }
    for (node, faces) in &by_node {
        let mut spokes: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for &f in faces {
            for &n in skin[f as usize].nodes.iter().filter(|n| *n != node) {
                spokes.entry(n).or_default().push(f);
            }
        }
        let fans = connected(faces, spokes.values().map(Vec::as_slice));
        if fans.len() > 1 {
            let smallest = fans.iter().min_by_key(|fan| (fan.len(), fan[0]));
            doomed.extend(smallest.into_iter().flatten().map(|&f| skin[f as usize].tet));
        }
    }
    doomed
}

/// Face-connected groups of the tets around edge `a`–`b` (all tets with both nodes).
fn wedges_around(mesh: &TetMesh, a: u32, b: u32) -> Vec<Vec<u32>> {
    let star: Vec<u32> = (0..mesh.tets.len() as u32)
        .filter(|&t| mesh.tets[t as usize].contains(&a) && mesh.tets[t as usize].contains(&b))
        .collect();
    let mut by_third: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for &tet in &star {
        for &n in mesh.tets[tet as usize].iter().filter(|&&n| n != a && n != b) {
            by_third.entry(n).or_default().push(tet);
        }
    }
    connected(&star, by_third.values().map(Vec::as_slice))
}

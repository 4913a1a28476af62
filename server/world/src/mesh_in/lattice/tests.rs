//! Tests of the lattice: closed 2-manifold boundaries, volumes that converge, dirty surfaces.

use std::collections::BTreeMap;

use super::*;
use crate::mesh_in::shapes::{cube, sphere};

fn fill(vertices: Vec<Vector3<f64>>, triangles: Vec<[u32; 3]>, cells: usize) -> (TetMesh, LatticeReport) {
    let surface = SurfaceMesh { file: "test.obj".into(), vertices, triangles, notes: Vec::new() };
    lattice_from_surface(&surface, cells, 1.0).unwrap()
}

/// Every boundary edge has two faces that run through it in opposite directions, and the faces around every
/// boundary node form one fan.
fn assert_closed_manifold(mesh: &TetMesh) {
    mesh.check().unwrap();
    let skin = mesh.boundary_faces();
    let mut directed: BTreeMap<(u32, u32), usize> = BTreeMap::new();
    let mut ring: BTreeMap<u32, BTreeMap<u32, u32>> = BTreeMap::new();
    for face in &skin {
        for k in 0..3 {
            let [a, b, c] = [0, 1, 2].map(|i| face.nodes[(k + i) % 3]);
            *directed.entry((a, b)).or_default() += 1;
            assert!(ring.entry(a).or_default().insert(b, c).is_none(), "two fans at node {a}");
        }
    }
    for (&(a, b), &count) in &directed {
        assert_eq!((count, directed.get(&(b, a))), (1, Some(&1)), "edge {a} {b}");
    }
    for (node, next) in &ring {
        let start = *next.keys().next().unwrap();
        let (mut at, mut steps) = (next[&start], 1);
        while at != start {
            at = next[&at];
            steps += 1;
        }
        assert_eq!(steps, next.len(), "two fans at node {node}");
    }
}

#[test]
fn a_sphere_converges_and_keeps_its_angles() {
    let (vertices, triangles) = sphere(40, 0.1);
    let mut errors = Vec::new();
    for cells in [6, 12, 24] {
        let (mesh, report) = fill(vertices.clone(), triangles.clone(), cells);
        assert_closed_manifold(&mesh);
        assert!(report.min_dihedral_deg > 8.0 && report.max_dihedral_deg < 166.0, "{report:?}");
        assert_eq!((report.hole_crossings, report.components, report.removed_tets), (0, 1, 0));
        errors.push(report.volume_error.abs());
    }
    assert!(errors[0] < 0.06 && errors[2] < 0.004, "{errors:?}");
    assert!(errors[1] < 0.4 * errors[0] && errors[2] < 0.4 * errors[1], "{errors:?}");
}

#[test]
fn a_cube_on_lattice_planes_is_filled_to_its_edges() {
    let (vertices, triangles) = cube();
    for cells in [3, 4, 7, 10] {
        let (mesh, report) = fill(vertices.clone(), triangles.clone(), cells);
        assert_closed_manifold(&mesh);
        assert!(report.volume_error.abs() < 0.5 / cells as f64, "{report:?}");
        assert!(report.min_dihedral_deg > 5.0, "{report:?}");
    }
}

#[test]
fn dirty_cubes_give_nearly_the_same_body() {
    let (vertices, triangles) = cube();
    let (_, clean) = fill(vertices.clone(), triangles.clone(), 12);

    let mut missing = triangles.clone();
    missing.truncate(11); // half a face
    let (mesh, report) = fill(vertices.clone(), missing, 12);
    assert_closed_manifold(&mesh);
    assert!(report.surface.holes == 1 && report.hole_crossings > 0, "{report:?}");
    assert!((report.volume_m3 - clean.volume_m3).abs() < 0.15, "{report:?}");

    let mut flipped = triangles.clone();
    flipped[2].swap(0, 1);
    flipped[8].swap(1, 2);
    flipped.extend_from_slice(&triangles[4..6]);
    let (mesh, report) = fill(vertices.clone(), flipped, 12);
    assert_closed_manifold(&mesh);
    assert_eq!((report.surface.flipped_triangles, report.surface.duplicate_triangles), (2, 2));
    assert!((report.volume_m3 - clean.volume_m3).abs() < 1e-6, "{report:?}");

    let loose: Vec<Vector3<f64>> = triangles.iter().flatten().map(|&v| vertices[v as usize]).collect();
    let (_, report) = fill(loose, (0..12).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(), 12);
    assert!((report.volume_m3 - clean.volume_m3).abs() < 1e-6, "{report:?}");
}

#[test]
fn overlapping_and_touching_parts_stay_manifold() {
    let two = |shift: Vector3<f64>| {
        let (mut vertices, mut triangles) = cube();
        let moved: Vec<Vector3<f64>> = vertices.iter().map(|v| v + shift).collect();
        triangles.extend(cube().1.iter().map(|t| t.map(|v| v + 8)));
        vertices.extend(moved);
        fill(vertices, triangles, 14)
    };
    let (mesh, report) = two(Vector3::new(0.5, 0.4, 0.3));
    assert_closed_manifold(&mesh);
    assert!((report.volume_m3 - (2.0 - 0.5 * 0.6 * 0.7)).abs() < 0.08, "{report:?}");
    // Cubes that share an edge, a corner, and lie a fraction of a cell apart.
    for shift in [Vector3::new(1.0, 1.0, 0.0), Vector3::repeat(1.0), Vector3::new(1.02, 0.0, 0.0)] {
        let (mesh, report) = two(shift);
        assert_closed_manifold(&mesh);
        assert!((report.volume_m3 - 2.0).abs() < 0.2, "{report:?}");
    }
}

#[test]
fn a_cavity_stays_empty() {
    let (mut vertices, mut triangles) = sphere(20, 1.0);
    let (inner, inner_triangles) = sphere(20, 0.5);
    let first = vertices.len() as u32;
    vertices.extend(inner);
    triangles.extend(inner_triangles.iter().map(|&[a, b, c]| [a + first, c + first, b + first]));
    let (mesh, report) = fill(vertices, triangles, 16);
    assert_closed_manifold(&mesh);
    let exact = 4.0 / 3.0 * std::f64::consts::PI * (1.0 - 0.125);
    assert!((report.volume_m3 / exact - 1.0).abs() < 0.03, "{report:?}");
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads() {
    let (vertices, triangles) = sphere(20, 1.0);
    let surface = SurfaceMesh { file: "s".into(), vertices, triangles, notes: Vec::new() };
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| lattice_from_surface(&surface, 10, 1.0).unwrap())
    };
    assert_eq!(with(1), with(4));
}

#[test]
fn scale_is_exact_and_small_bodies_mesh_like_large_ones() {
    let (vertices, triangles) = sphere(16, 50.0);
    let surface = SurfaceMesh { file: "s".into(), vertices, triangles, notes: Vec::new() };
    let (large, _) = lattice_from_surface(&surface, 8, 1.0).unwrap();
    let (small, report) = lattice_from_surface(&surface, 8, 0.001).unwrap();
    assert_eq!(large.tets, small.tets);
    assert!((report.surface.max_m[0] - 0.05).abs() < 1e-3);
}

#[test]
fn impossible_requests_are_refused() {
    let (vertices, triangles) = cube();
    let surface = SurfaceMesh { file: "c.obj".into(), vertices, triangles, notes: Vec::new() };
    assert!(matches!(lattice_from_surface(&surface, 1, 1.0), Err(MeshInError::Cells { .. })));
    assert!(matches!(lattice_from_surface(&surface, 9, 0.0), Err(MeshInError::Scale { .. })));
    let sheet = SurfaceMesh { triangles: surface.triangles[..2].to_vec(), ..surface };
    let message = lattice_from_surface(&sheet, 9, 1.0).unwrap_err().to_string();
    assert!(message.contains("c.obj") && message.contains("encloses no"), "{message}");
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig { cases: 96, failure_persistence: None, ..Default::default() })]

    /// Unordered soups of triangles give a valid mesh, or an error message.
    #[test]
    fn any_soup_gives_a_manifold_or_an_error(
        points in proptest::collection::vec(proptest::array::uniform3(-1.0f64..1.0), 4..14),
        picks in proptest::collection::vec(proptest::array::uniform3(0usize..14), 4..60),
        cells in 2usize..9,
    ) {
        let vertices: Vec<Vector3<f64>> = points.iter().map(|&p| Vector3::from(p)).collect();
        let triangles = picks.iter().map(|t| t.map(|i| (i % vertices.len()) as u32)).collect();
        let surface = SurfaceMesh { file: "soup".into(), vertices, triangles, notes: Vec::new() };
        if let Ok((mesh, report)) = lattice_from_surface(&surface, cells, 1.0) {
            assert_closed_manifold(&mesh);
            assert!(report.min_dihedral_deg > 1.0, "{report:?}");
        }
    }
}

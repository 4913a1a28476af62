//! Tests of the readers as a whole: surface formats, and damaged files of every format.

use nalgebra::Vector3;
use proptest::prelude::*;

use super::*;
use crate::format::{SurfaceMesh, read_mesh};

const OBJ: &str = "# cube\nmtllib cube.mtl\no cube\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n\
    vn 0 0 1\ng bottom\nusemtl red\nf 1//1 4//1 3//1 2//1\ng rest\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf -8 -4 -1\nf 1 8 4\n";
const PLY: &str = "ply\nformat ascii 1.0\ncomment made by hand\nelement vertex 4\nproperty float x\nproperty float y\n\
    property float z\nproperty uchar red\nelement face 3\nproperty list uchar int vertex_indices\nend_header\n\
    0 0 0 1\n1 0 0 2\n0 1 0 3\n0 0 1 4\n3 0 2 1\n3 0 1 3\n4 1 2 3 0\n";
const STL: &str = "solid wedge\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n\
    facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 0 1 0\nvertex 0 0 1\nendloop\nendfacet\nendsolid wedge\n";
const VTK: &str = "# vtk DataFile Version 3.0\nt\nASCII\nDATASET POLYDATA\nPOINTS 4 float\n0 0 0 1 0 0 1 1 0 0 1 0\n\
    POLYGONS 2 8\n3 0 1 2\n3 0 2 3\n";
const MSH: &str = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n$EndNodes\n\
    $Elements\n1\n1 4 2 1 1 1 2 3 4\n$EndElements\n";

fn binary_stl() -> Vec<u8> {
    // The header is misleading: it starts like a text file.
    let mut bytes = b"solid by a liar".to_vec();
    bytes.resize(80, b' ');
    bytes.extend(2u32.to_le_bytes());
    for triangle in [[[0., 0., 0.], [1., 0., 0.], [0., 1., 0.]], [[0., 0., 0.], [0., 1., 0.], [0., 0., 1.]]] {
        bytes.extend([0; 12]);
        triangle.iter().flatten().for_each(|c: &f32| bytes.extend(c.to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}

fn binary_ply() -> Vec<u8> {
    let mut bytes =
        PLY[..PLY.find("0 0 0 1\n").unwrap()].replace("ascii", "binary_little_endian").into_bytes();
    for (i, point) in [[0f32, 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.]].iter().enumerate() {
        point.iter().for_each(|c| bytes.extend(c.to_le_bytes()));
        bytes.push(i as u8);
    }
    for face in [[0i32, 2, 1].as_slice(), &[0, 1, 3], &[1, 2, 3, 0]] {
        bytes.push(face.len() as u8);
        face.iter().for_each(|c| bytes.extend(c.to_le_bytes()));
    }
    bytes
}

fn surface(file: &str, bytes: &[u8]) -> SurfaceMesh {
    match read_mesh_bytes(file, bytes).unwrap() {
        MeshFile::Surface(surface) => surface,
        MeshFile::Volume(_) => panic!("a volume"),
    }
}

#[test]
fn obj_groups_quads_and_negative_indices() {
    let mesh = surface("cube.obj", OBJ.as_bytes());
    assert_eq!(mesh.triangles.len(), 12);
    let volume: f64 = mesh
        .triangles
        .iter()
        .map(|t| t.map(|v| mesh.vertices[v as usize]))
        .map(|[a, b, c]| a.dot(&b.cross(&c)) / 6.0)
        .sum();
    assert!((volume - 1.0).abs() < 1e-12, "{volume}");
}

#[test]
fn stl_text_and_binary_agree() {
    let text = surface("a.stl", STL.as_bytes());
    let binary = surface("a.STL", &binary_stl());
    assert_eq!(text.vertices, binary.vertices);
    assert_eq!(text.triangles, [[0, 1, 2], [3, 4, 5]]);
    assert_eq!(text.triangles, binary.triangles);
    let two = format!("{}\n{}", STL.to_uppercase(), STL.replace("solid wedge", "solid"));
    assert_eq!(surface("a.stl", two.as_bytes()).triangles.len(), 4);
    assert!(read_mesh_bytes("a.stl", STL.replace("endsolid wedge", "").as_bytes()).is_err());
    let mut short = binary_stl();
    short.truncate(170);
    let message = read_mesh_bytes("a.stl", &short).unwrap_err().to_string();
    assert!(message.contains("a.stl"), "{message}");
}

#[test]
fn ply_text_and_binary_agree() {
    let text = surface("a.ply", PLY.as_bytes());
    let binary = surface("a.ply", &binary_ply());
    assert_eq!(text.triangles, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [1, 3, 0]]);
    assert_eq!((&text.triangles, &text.vertices), (&binary.triangles, &binary.vertices));
    assert_eq!(text.vertices[3], Vector3::z());
}

#[test]
fn surfaces_name_file_and_line_of_a_fault() {
    let message =
        read_mesh_bytes("x.obj", OBJ.replace("v 1 1 0", "v 1 one 0").as_bytes()).unwrap_err().to_string();
    assert!(message.contains("x.obj") && message.contains("line 6"), "{message}");
    let message =
        read_mesh_bytes("x.ply", PLY.replace("element face 3", "element face 3000000000").as_bytes())
            .unwrap_err()
            .to_string();
    assert!(message.contains("3000000000"), "{message}");
    let message =
        read_mesh_bytes("x.ply", PLY.replace("4 1 2 3 0", "4 1 2 3 9").as_bytes()).unwrap_err().to_string();
    assert!(message.contains("triangle 3 uses node 9"), "{message}");
    assert!(matches!(read_mesh(Path::new("/nowhere/liver.msh")), Err(MeshInError::Io { .. })));
    assert!(matches!(read_mesh_bytes("x.blend", b"BLENDER"), Err(MeshInError::UnknownFormat { .. })));
}

fn samples() -> Vec<(&'static str, Vec<u8>)> {
    vec![
        ("s.obj", OBJ.into()),
        ("s.ply", PLY.into()),
        ("b.ply", binary_ply()),
        ("s.stl", STL.into()),
        ("b.stl", binary_stl()),
        ("s.vtk", VTK.into()),
        ("s.msh", MSH.into()),
    ]
}

#[test]
fn every_truncation_is_read_or_refused_without_panic() {
    for (file, bytes) in samples() {
        for length in 0..bytes.len() {
            let _ = read_mesh_bytes(file, &bytes[..length]);
        }
        assert!(read_mesh_bytes(file, &bytes[..bytes.len() / 3]).is_err(), "{file}");
        assert!(read_mesh_bytes(file, b"").is_err(), "{file}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    /// Garbage in the middle of a valid file: an error or a mesh whose indices are in range.
    #[test]
    fn mutated_files_never_panic(
        which in 0usize..7,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        digits in any::<bool>(),
    ) {
        let (file, mut bytes) = samples().swap_remove(which);
        for (index, value) in changes {
            let at = index.index(bytes.len());
            bytes[at] = if digits { b"0123456789- .e\n"[usize::from(value) % 15] } else { value };
        }
        match read_mesh_bytes(file, &bytes) {
            Ok(MeshFile::Volume(v)) => prop_assert!(v.tets.iter().flatten().all(|&n| (n as usize) < v.nodes.len())),
            Ok(MeshFile::Surface(s)) => prop_assert!(s.triangles.iter().flatten().all(|&n| (n as usize) < s.vertices.len())),
            Err(error) => prop_assert!(error.to_string().contains(file)),
        }
    }
}

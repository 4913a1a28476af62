//! Tests of the Gmsh reader: every format gives the same two tetrahedra, and damaged files give errors with
//! their place.

use nalgebra::Vector3;

use crate::format::{MeshFile, MeshInError, VolumeMesh, read_mesh_bytes};

const V1: &str = "$NOD\n5\n10 0 0 0\n20 1 0 0\n30 0 1 0\n40 0 0 1\n7 1 1 1\n$ENDNOD\n\
    $ELM\n3\n1 2 1 1 3 10 20 30\n2 4 1 1 4 10 20 30 40\n3 4 1 1 4 20 30 40 7\n$ENDELM\n";
const V22: &str = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n3 1 \"liver\"\n$EndPhysicalNames\n\
    $Nodes\n5\n10 0 0 0\n20 1 0 0\n30 0 1 0\n40 0 0 1\n7 1 1 1\n$EndNodes\n\
    $Elements\n3\n1 2 2 1 1 10 20 30\n2 4 2 1 1 10 20 30 40\n3 4 2 1 1 20 30 40 7\n$EndElements\n";
const V41: &str = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n2 5 7 40\n0 1 0 1\n10\n0 0 0\n3 1 0 4\n20\n30\n40\n7\n\
    1 0 0\n0 1 0\n0 0 1\n1 1 1\n$EndNodes\n$Elements\n2 3 1 3\n2 1 2 1\n1 10 20 30\n3 1 4 2\n2 10 20 30 40\n3 20 30 40 7\n$EndElements\n";

fn volume(bytes: &[u8]) -> VolumeMesh {
    match read_mesh_bytes("part.msh", bytes).unwrap() {
        MeshFile::Volume(volume) => volume,
        MeshFile::Surface(_) => panic!("a surface"),
    }
}

fn assert_two_tets(mesh: &VolumeMesh) {
    let corners: Vec<Vec<Vector3<f64>>> =
        mesh.tets.iter().map(|t| t.iter().map(|&n| mesh.nodes[n as usize]).collect()).collect();
    let (o, x, y, z) = (Vector3::zeros(), Vector3::x(), Vector3::y(), Vector3::z());
    assert_eq!(corners, vec![vec![o, x, y, z], vec![x, y, z, Vector3::repeat(1.0)]]);
    assert_eq!(mesh.nodes.len(), 5);
    assert_eq!(mesh.notes, ["1 faces beside the tetrahedra not used"]);
}

/// Binary 2.2 and 4.1 in the given byte order.
fn binary(version: &str, big: bool) -> Vec<u8> {
    let int = |v: i32| if big { v.to_be_bytes() } else { v.to_le_bytes() };
    let size = |v: i64| if big { v.to_be_bytes() } else { v.to_le_bytes() };
    let real = |v: f64| if big { v.to_be_bytes() } else { v.to_le_bytes() };
    let points = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.], [1., 1., 1.]];
    let tags = [10i32, 20, 30, 40, 7];
    let mut out = format!("$MeshFormat\n{version} 1 8\n").into_bytes();
    out.extend(int(1));
    out.extend(b"\n$EndMeshFormat\n$Nodes\n");
    if version == "4.1" {
        [1, 5, 7, 40].iter().for_each(|&v| out.extend(size(v)));
        [3, 1, 0].iter().for_each(|&v| out.extend(int(v)));
        out.extend(size(5));
        tags.iter().for_each(|&v| out.extend(size(v.into())));
        points.iter().flatten().for_each(|&v| out.extend(real(v)));
        out.extend(b"\n$EndNodes\n$Elements\n");
        [2, 3, 1, 3].iter().for_each(|&v| out.extend(size(v)));
        [2, 1, 2].iter().for_each(|&v| out.extend(int(v)));
        [1, 1, 10, 20, 30].iter().for_each(|&v| out.extend(size(v)));
        [3, 1, 4].iter().for_each(|&v| out.extend(int(v)));
        [2, 2, 10, 20, 30, 40, 3, 20, 30, 40, 7].iter().for_each(|&v| out.extend(size(v)));
    } else {
        out.extend(b"5\n");
        for (tag, point) in tags.iter().zip(points) {
            out.extend(int(*tag));
            point.iter().for_each(|&v| out.extend(real(v)));
        }
        out.extend(b"\n$EndNodes\n$Elements\n3\n");
        [2, 1, 2, 1, 1, 1, 10, 20, 30].iter().for_each(|&v| out.extend(int(v)));
        [4, 2, 2, 2, 1, 1, 10, 20, 30, 40, 3, 1, 1, 20, 30, 40, 7].iter().for_each(|&v| out.extend(int(v)));
    }
    out.extend(b"\n$EndElements\n");
    out
}

#[test]
fn all_formats_give_the_same_tetrahedra() {
    for text in [V1, V22, V41] {
        assert_two_tets(&volume(text.as_bytes()));
        assert_two_tets(&volume(text.replace('\n', "\r\n").as_bytes()));
    }
    for version in ["2.2", "4.1"] {
        for big in [false, true] {
            assert_two_tets(&volume(&binary(version, big)));
        }
    }
}

/// Array, number, name and tetrahedra of every group.
fn groups(bytes: &[u8]) -> Vec<(i64, Option<String>, Vec<u32>)> {
    let groups = volume(bytes).groups.into_iter();
    groups.map(|group| (group.number, group.name, group.tets)).collect()
}

#[test]
fn physical_groups_of_volumes_become_groups_of_tetrahedra() {
    let liver = |tets: &[u32]| (1, Some("liver".to_owned()), tets.to_vec());
    assert_eq!(groups(V1.as_bytes()), [(1, None, vec![0, 1])]);
    assert_eq!(groups(V22.as_bytes()), [liver(&[0, 1])]);
    let two = V22
        .replace("$PhysicalNames\n1\n3 1 \"liver\"", "$PhysicalNames\n2\n3 1 \"liver\"\n3 9 \"a tumour\"")
        .replace("3 4 2 1 1 20 30 40 7", "3 4 2 9 1 20 30 40 7");
    assert_eq!(groups(two.as_bytes()), [liver(&[0]), (9, Some("a tumour".into()), vec![1])]);
    // A face's group of the same number is another group, and 0 is none.
    let faces = V22.replace("3 1 \"liver\"", "2 1 \"skin\"").replace("3 4 2 1 1 20", "3 4 2 0 1 20");
    assert_eq!(groups(faces.as_bytes()), [(1, None, vec![0])]);
    assert!(groups(V41.as_bytes()).is_empty());
    // A point, a surface in group 5, and two volumes, the second in two groups.
    let entities = "$PhysicalNames\n2\n3 5 \"shell\"\n3 6 \"core\"\n$EndPhysicalNames\n$Entities\n1 0 1 2\n\
        1 0 0 0 0\n1 0 0 0 1 1 1 1 5 2 1 -1\n1 0 0 0 1 1 1 1 5 1 -1\n2 0 0 0 1 1 1 2 5 6 1 1\n$EndEntities\n$Nodes\n2 5";
    let two = V41
        .replace("$Nodes\n2 5", entities)
        .replace("$Elements\n2 3 1 3", "$Elements\n3 3 1 3")
        .replace("3 1 4 2\n2 10 20 30 40\n3 20 30 40 7", "3 1 4 1\n2 10 20 30 40\n3 2 4 1\n3 20 30 40 7");
    let (shell, core) = (Some("shell".to_owned()), Some("core".to_owned()));
    assert_eq!(groups(two.as_bytes()), [(5, shell, vec![0, 1]), (6, core, vec![1])]);
    for big in [false, true] {
        assert_eq!(groups(&binary("2.2", big)), [(1, None, vec![0, 1])]);
    }
}

#[test]
fn faces_alone_are_a_surface() {
    let text = V22
        .replace("$Elements\n3\n", "$Elements\n1\n")
        .replace("2 4 2 1 1 10 20 30 40\n3 4 2 1 1 20 30 40 7\n", "");
    assert!(
        matches!(read_mesh_bytes("a.msh", text.as_bytes()), Ok(MeshFile::Surface(s)) if s.triangles.len() == 1)
    );
}

#[test]
fn errors_name_the_file_the_place_and_what_was_expected() {
    let error = |text: String| read_mesh_bytes("dir/part.msh", text.as_bytes()).unwrap_err().to_string();
    let message = error(V22.replace("30 0 1 0", "30 0 one 0"));
    assert!(
        message.contains("dir/part.msh")
            && message.contains("line 12")
            && message.contains("expected y, found 'one"),
        "{message}"
    );
    let message = error(V22.replace("$Nodes\n5\n", "$Nodes\n4000000000\n"));
    assert!(message.contains("announces 4000000000 nodes"), "{message}");
    let message = error(V1.replace("20 30 40 7\n$", "20 30 40 8\n$"));
    assert!(message.contains("tetrahedron 1 uses node 8"), "{message}");
    let message = error(V22.replace("2.2 0 8", "4.0 0 8"));
    assert!(message.contains("msh41"), "{message}");
    let message = error(V22.replace("2 4 2 1 1 10 20 30 40", "2 5 2 1 1 10 20 30 40 10 20 30 40"));
    assert!(message.contains("hexahedron"), "{message}");
    assert!(matches!(
        read_mesh_bytes("a.msh", V1.replace("1 1 1\n$ENDNOD", "1 nan 1\n$ENDNOD").as_bytes()),
        Err(MeshInError::NonFinite { node: 4, .. })
    ));
}

#[test]
fn truncated_and_mutated_binaries_never_panic() {
    for version in ["2.2", "4.1"] {
        let whole = binary(version, false);
        for at in 0..whole.len() {
            let _ = read_mesh_bytes("a.msh", &whole[..at]);
            for value in [0x00, 0x7f, 0x80, 0xff, b'9'] {
                let mut bytes = whole.clone();
                bytes[at] = value;
                let _ = read_mesh_bytes("a.msh", &bytes);
            }
        }
    }
}

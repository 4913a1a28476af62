//! Files: scenes, meshes in every format, recordings.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use mcap::Message;
use mcap::records::MessageHeader;
use scindo::record::reader::Recording;
use scindo::record::recorder::RecordSettings;
use scindo::sim::engine::Engine;
use scindo_fuzz::attack;
use scindo_tests::scene::{WORLD, block, held};
use scindo_world::body::texture::{Atlas, Image, Mapping, Texture};
use scindo_world::format::{MeshFile, read_mesh_bytes, read_textured_bytes};
use scindo_world::inputs::Inputs;
use scindo_world::scene::Scene;
use scindo_world::simulation::Simulation;

/// Recipes per target in an ordinary run of the tests.
const RECIPES: usize = 10_000;

fn scenes() -> Vec<Vec<u8>> {
    let folder = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../server/world/scenes"));
    let mut files: Vec<PathBuf> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.retain(|file| file.extension().is_some_and(|end| end == "toml"));
    files.sort_unstable();
    assert!(!files.is_empty(), "no scenes");
    files.iter().map(|file| fs::read(file).unwrap()).collect()
}

/// A scene is taken or refused with words; nothing is built.
#[test]
fn scene_toml() {
    attack!(scenes(), RECIPES, |bytes: &[u8]| {
        let Ok(text) = std::str::from_utf8(bytes) else { return };
        if let Err(error) = Scene::from_toml(text) {
            assert!(!error.to_string().trim().is_empty());
        }
    });
}

#[test]
fn scene_json() {
    let block = r#"{"schema":1,"name":"a","world":{"step_s":0.01},"body":[{"id":"b","young_pa":5e4,"poisson":0.4,
        "density_kg_m3":1000,"mesh":{"box":{"min_m":[0,0,0],"max_m":[1,1,1],"cells":[1,1,1]}}}]}"#;
    attack!(vec![block.as_bytes().to_vec()], RECIPES, |bytes: &[u8]| {
        let Ok(text) = std::str::from_utf8(bytes) else { return };
        if let Err(error) = Scene::from_json(text) {
            assert!(!error.to_string().trim().is_empty());
        }
    });
}

/// What a reader takes has finite points, no node that is not there, and groups of tetrahedra that are.
fn read(file: &str) -> impl Fn(&[u8]) + use<'_> {
    move |bytes: &[u8]| match read_mesh_bytes(file, bytes) {
        Ok(mesh) => {
            assert!(mesh.points().iter().all(|p| p.iter().all(|x| x.is_finite())));
            if let MeshFile::Volume(volume) = mesh {
                let (tets, mut named) =
                    (volume.tets.len(), volume.groups.iter().flat_map(|group| &group.tets));
                assert!(named.all(|&tet| (tet as usize) < tets));
            }
        }
        Err(error) => assert!(!error.to_string().trim().is_empty()),
    }
}

const OBJ: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvn 0 0 1\nf 1 2 3\nf 1//1 2//1 4//1\nf -1 -2 -3\n";

#[test]
fn obj() {
    attack!(vec![OBJ.as_bytes().to_vec()], RECIPES, read("a.obj"));
}

/// What is taken has coordinates at every corner, and makes no trouble when a body asks where it lies on the image.
#[test]
fn obj_with_texture_coordinates() {
    let square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\nf 1/1/1 2/2/1 3/3/1 4/4/1\nf -4/-4 -3/-3 -2/-2\n";
    attack!(vec![square.as_bytes().to_vec()], RECIPES, |bytes: &[u8]| match read_textured_bytes(
        "a.obj", bytes
    ) {
        Ok(surface) => {
            assert_eq!(surface.coordinates.len(), surface.triangles.len());
            let image = Image { media_type: "image/png", bytes: Default::default() };
            let Ok(atlas) = Atlas::new(&surface, 1.0) else { return };
            let texture = Texture::new(image, Mapping::Atlas(Box::new(atlas)));
            let rest = [[0.0, 0.0, 0.1], [1.0, 0.0, 0.0], [0.5, 2.0, 0.0]];
            let found = texture.coordinates(&rest, [[0, 1, 2]].into_iter());
            assert!(found.iter().flatten().flatten().all(|c| c.is_finite()), "{found:?}");
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    });
}

#[test]
fn stl() {
    let text = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\n\
                endfacet\nendsolid a\n";
    let mut binary = vec![0u8; 80];
    binary.extend(2u32.to_le_bytes());
    binary.extend([0u8; 100]);
    attack!(vec![text.as_bytes().to_vec(), binary], RECIPES, read("a.stl"));
}

#[test]
fn ply() {
    let header = |format: &str| {
        format!(
            "ply\nformat {format} 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
             element face 1\nproperty list uchar int vertex_indices\nend_header\n"
        )
    };
    let text = header("ascii") + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    let mut binary = header("binary_little_endian").into_bytes();
    binary.extend([0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|x| x.to_le_bytes()));
    binary.push(3);
    binary.extend([0i32, 1, 2].iter().flat_map(|i| i.to_le_bytes()));
    attack!(vec![text.into_bytes(), binary], RECIPES, read("a.ply"));
}

#[test]
fn gmsh() {
    let old = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n3 7 \"a\"\n$EndPhysicalNames\n$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n$EndNodes\n\
               $Elements\n1\n1 4 2 7 1 1 2 3 4\n$EndElements\n";
    let new = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Entities\n1 0 0 1\n1 0 0 0 0\n1 0 0 0 1 1 1 1 7 0\n\
               $EndEntities\n$Nodes\n1 4 1 4\n3 1 0 4\n1\n2\n3\n4\n0 0 0\n1 0 0\n0 1 0\n\
               0 0 1\n$EndNodes\n$Elements\n1 1 1 1\n3 1 4 1\n1 1 2 3 4\n$EndElements\n";
    attack!(vec![old.as_bytes().to_vec(), new.as_bytes().to_vec()], RECIPES, read("a.msh"));
}

#[test]
fn vtk() {
    let text = "# vtk DataFile Version 3.0\na\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 double\n0 0 0 1 0 0 0 1 0 \
                0 0 1\nCELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n10\nPOINT_DATA 4\nSCALARS a float\nLOOKUP_TABLE default\n1 2 3 4\nCELL_DATA 1\n\
                SCALARS part int 1\nLOOKUP_TABLE default\n7\nVECTORS v float\n1 2 3\nFIELD f 1\nb 1 1 int\n2\n";
    let poly = "# vtk DataFile Version 3.0\na\nASCII\nDATASET POLYDATA\nPOINTS 3 float\n0 0 0 1 0 0 0 1 0\n\
                POLYGONS 1 4\n3 0 1 2\n";
    attack!(vec![text.as_bytes().to_vec(), poly.as_bytes().to_vec()], RECIPES, read("a.vtk"));
}

#[test]
fn vtu() {
    let text = r#"<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" header_type="UInt64">
<UnstructuredGrid><Piece NumberOfPoints="4" NumberOfCells="1"><Points>
<DataArray type="Float64" NumberOfComponents="3" format="ascii">0 0 0 1 0 0 0 1 0 0 0 1</DataArray></Points>
<Cells><DataArray type="Int64" Name="connectivity" format="ascii">0 1 2 3</DataArray>
<DataArray type="Int64" Name="offsets" format="ascii">4</DataArray>
<DataArray type="UInt8" Name="types" format="ascii">10</DataArray></Cells><CellData>
<DataArray type="Int32" Name="part" format="ascii">7</DataArray></CellData></Piece></UnstructuredGrid></VTKFile>"#;
    attack!(vec![text.as_bytes().to_vec()], RECIPES, read("a.vtu"));
}

/// A recording of four steps with one checkpoint, that of its beginning. Checkpoints follow the clock, so a busy machine
/// would write more of them if the next one were due within the test.
fn recorded(folder: &Path) -> Vec<u8> {
    let file = folder.join("seed.mcap");
    let block = block("block", [[0.0; 3], [0.2, 0.1, 0.1]], [2, 1, 1], &held("z"));
    let scene = Scene::from_toml(&(WORLD.to_owned() + &block)).unwrap();
    let mut engine = Engine::new(Simulation::new(&scene, Path::new("")).unwrap(), None).unwrap();
    let checkpoint = Duration::from_secs(3600);
    let settings =
        RecordSettings { file: file.clone(), checkpoint, surfaces: false, patient: true, threads: 1 };
    engine.record(settings).unwrap();
    for _ in 0..4 {
        engine.step(&Inputs::default());
    }
    engine.finish("done").unwrap();
    fs::read(file).unwrap()
}

/// The messages of a recording without the words that describe them, which are most of a short file. Packed as a server
/// writes them, or loose: the checksums of packed ones keep most changes from what decodes messages.
fn rewritten(recording: &[u8], packed: bool) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let compression = packed.then_some(mcap::Compression::Zstd);
    let options = mcap::WriteOptions::new().use_chunks(packed).compression(compression);
    let mut writer = options.create(&mut bytes).unwrap();
    let mut channels = HashMap::new();
    for message in mcap::MessageStream::new(recording).unwrap() {
        let Message { channel, sequence, log_time, publish_time, data } = message.unwrap();
        let id = *channels.entry(channel.id).or_insert_with(|| {
            writer.add_channel(0, &channel.topic, &channel.message_encoding, &channel.metadata).unwrap()
        });
        let header = MessageHeader { channel_id: id, sequence, log_time, publish_time };
        writer.write_to_known_channel(&header, &data).unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    bytes.into_inner()
}

/// Messages until the end or the first one that cannot be decoded; the scene is one.
fn read_all(bytes: &[u8]) -> usize {
    let mut recording = Recording::read(bytes, "a.mcap".to_owned());
    if let Err(error) = recording.scene() {
        assert!(!error.to_string().trim().is_empty());
    }
    1 + std::iter::from_fn(|| recording.next_message().ok().flatten()).count()
}

/// A recording is read to its end, to its first broken record, or refused with words.
#[test]
fn recording() {
    let folder = tempfile::tempdir().unwrap();
    let original = recorded(folder.path());
    let seeds = [false, true].map(|packed| rewritten(&original, packed));
    for seed in &seeds {
        assert_eq!(read_all(seed), read_all(&original));
        assert!(seed.len() < 20_000, "a seed of {} bytes", seed.len());
    }
    attack!(seeds.to_vec(), RECIPES, |bytes: &[u8]| {
        read_all(bytes);
    });
}

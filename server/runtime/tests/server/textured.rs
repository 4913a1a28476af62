//! The image on a skin, over the network and in a glTF file.

use std::fs;
use std::path::Path;

use scindo::record::gltf::Gltf;
use scindo::server::{Server, ServerConfig};
use scindo::sim::engine::Engine;
use scindo::wire::session::{NetworkConfig, Sessions};
use scindo_client::{Link, LinkConfig, LinkError, Role};
use scindo_tests::scene::{WORLD, block, cut, held};
use scindo_tests::{PATIENCE, free_pair};
use scindo_world::inputs::Inputs;
use scindo_world::scene::Scene;
use scindo_world::simulation::Simulation;
use serde_json::Value;

/// Two by two pixels: an odd number of bytes, after which numbers have to be aligned again.
const PNG: &[u8] = include_bytes!("../../../../tests/browser/quarters.png");

fn simulation(folder: &Path) -> Simulation {
    fs::write(folder.join("skin.png"), PNG).unwrap();
    let look = "look = { colour = \"#ff8080\", texture = { image = \"skin.png\", repeat_m = 0.05 } }\n";
    let text = [
        WORLD,
        &block("block", [[0.0; 3], [0.1; 3]], [4; 3], &(held("z") + look)),
        &block("plain", [[0.2, 0.0, 0.0], [0.3, 0.1, 0.1]], [2; 3], ""),
        &cut(
            "block",
            0.015,
            [[[0.05, -0.1, 0.04], [0.05, -0.1, 0.2]], [[0.05, 0.2, 0.04], [0.05, 0.2, 0.2]]],
        ),
    ];
    Simulation::new(&Scene::from_toml(&text.concat()).unwrap(), folder).unwrap()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_client_gets_the_image_and_the_places_on_it() {
    let folder = tempfile::tempdir().unwrap();
    let endpoint = format!("tcp/127.0.0.1:{}", free_pair());
    let network = NetworkConfig { listen: vec![endpoint.clone()], ..NetworkConfig::default() };
    let engine = Engine::new(simulation(folder.path()), None).unwrap();
    let server =
        Server::start(engine, Some(Sessions::open(&network).unwrap()), &ServerConfig::default()).unwrap();
    let config = LinkConfig::new(Role::Viewer, "eye").with_connect([endpoint]);
    let link = Link::connect(LinkConfig { timeout: PATIENCE, ..config }).await.unwrap();

    let info = link.info().await.unwrap();
    let textured: Vec<bool> = info.bodies.iter().map(|body| body.look.as_ref().unwrap().textured).collect();
    assert_eq!(textured, [true, false]);
    let texture = link.texture("block").await.unwrap();
    assert_eq!((texture.media_type.as_str(), &texture.image[..]), ("image/png", PNG));
    for (body, code) in [("plain", "no-texture"), ("none", "no-texture"), ("No body", "out-of-range")] {
        match link.texture(body).await.unwrap_err() {
            LinkError::Refused { code: found, .. } => assert_eq!(found, code, "{body}"),
            other => panic!("{other}"),
        }
    }

    let surface = link.mirror("block").await.unwrap().next().await.unwrap();
    let skin = surface.topology.tags.chunks(4).filter(|tag| **tag == [0; 4]).count();
    assert_eq!(surface.topology.texture_coordinates.len(), 24 * skin);
    let plain = link.mirror("plain").await.unwrap().next().await.unwrap();
    assert!(plain.topology.texture_coordinates.is_empty(), "a body without an image pays nothing");
    server.stop();
    server.join().unwrap();
}

#[test]
fn a_gltf_file_holds_the_image_once_and_the_places_on_it() {
    let folder = tempfile::tempdir().unwrap();
    let mut simulation = simulation(folder.path());
    let mut gltf = Gltf::new();
    gltf.add(&mut simulation);
    for _ in 0..4 {
        simulation.step(&Inputs::default());
        gltf.add(&mut simulation);
    }
    let file = folder.path().join("scene.glb");
    gltf.save(&file).unwrap();
    let bytes = fs::read(&file).unwrap();
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    let (json, data) = (&bytes[20..20 + word(12)], &bytes[28 + word(12)..]);
    let root: Value = serde_json::from_slice(json).unwrap();
    let number = |value: &Value, key: &str| value[key].as_u64().unwrap_or(0) as usize;
    let view = |index: usize| {
        let view = &root["bufferViews"][index];
        &data[number(view, "byteOffset")..][..number(view, "byteLength")]
    };
    assert_eq!(root["images"].as_array().unwrap().len(), 1);
    assert_eq!(view(number(&root["images"][0], "bufferView")), PNG);

    let meshes = root["meshes"].as_array().unwrap();
    let primitives = |mesh: &Value| mesh["primitives"].as_array().unwrap().clone();
    let parts: Vec<usize> = meshes.iter().map(|mesh| primitives(mesh).len()).collect();
    assert_eq!(parts, [1, 1, 1, 1, 1, 1, 2, 1, 2, 1], "the lips of a cut are drawn without the image");
    for (index, mesh) in meshes.iter().enumerate() {
        for primitive in primitives(mesh) {
            let accessor = |key: &str| &root["accessors"][number(&primitive["attributes"], key)];
            let vertices = number(accessor("POSITION"), "count");
            for key in ["POSITION", "TEXCOORD_0"] {
                let offset = number(&root["bufferViews"][number(accessor(key), "bufferView")], "byteOffset");
                assert_eq!(offset % 4, 0, "{key} is aligned");
            }
            let is_textured = index % 2 == 0;
            assert_eq!(primitive["attributes"].get("TEXCOORD_0").is_some(), is_textured);
            if is_textured {
                assert_eq!(number(accessor("TEXCOORD_0"), "count"), vertices);
            }
            let indices = &root["accessors"][number(&primitive, "indices")];
            let triangles = view(number(indices, "bufferView"));
            let most = triangles.chunks(4).map(|i| u32::from_le_bytes(i.try_into().unwrap())).max().unwrap();
            assert!((most as usize) < vertices);
        }
    }
}

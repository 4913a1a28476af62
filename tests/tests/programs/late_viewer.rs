//! A viewer that joins after three cuts sees the surface that one sees who was there from the start.

use std::sync::Arc;

use scindo_client::messages::{BladeSegment, Vec3, cut_ack};
use scindo_client::{BodyMirror, Link, LinkConfig, LinkError, Role, Surface};
use scindo_tests::{PATIENCE, Running, free_pair};

const SCENE: &str = r#"
schema = 1
name = "pulled block"
[world]
gravity_m_s2 = [0.0, 0.0, 0.0]
step_s = 0.01
[[body]]
id = "block"
mesh = { box = { min_m = [0,0,0], max_m = [0.12,0.06,0.06], cells = [12,6,6], pattern = "tet6" } }
law = "corotational"
young_pa = 2e4
poisson = 0.4
density_kg_m3 = 1000
[[body.fix]]
where = { box = { min_m = [-1,-1,-1], max_m = [1e-6,1,1] } }
[[body.fix]]
where = { box = { min_m = [0.119999,-1,-1], max_m = [1,1,1] } }
displacement_m = [0.01, 0, 0]
"#;

fn segment(x: f64, y: f64) -> BladeSegment {
    let at = |z| Some(Vec3 { x, y, z });
    BladeSegment { tip_m: at(0.03), heel_m: at(0.08) }
}

async fn join(endpoint: &str, id: &str) -> Result<Link, LinkError> {
    let config = LinkConfig::new(Role::Viewer, id).with_connect([endpoint.to_owned()]);
    Link::connect(LinkConfig { timeout: PATIENCE, ..config }).await
}

#[tokio::test(flavor = "multi_thread")]
async fn late_viewer_sees_the_same_surface() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let scene = directory.path().join("block.toml");
    std::fs::write(&scene, SCENE).expect("written");
    let endpoint = format!("tcp/127.0.0.1:{}", free_pair());
    let _server = Running::start("scindo", &["run", &scene.display().to_string(), "--listen", &endpoint])
        .expect("starts");

    let early = join(&endpoint, "early").await.expect("the server answers");
    let mut early_mirror = early.mirror("block").await.expect("mirrors");
    let tool = early.tool("scalpel-of-early").await.expect("a tool");
    let first = early_mirror.next().await.expect("a surface");
    let first_epoch = first.topology.epoch;

    for x in [0.031, 0.0605, 0.0917] {
        let ack = tool
            .cutter
            .cut("block", vec![segment(x, -0.01), segment(x + 0.002, 0.03), segment(x, 0.07)])
            .await;
        let ack = ack.expect("acknowledged");
        assert_eq!(ack.outcome(), cut_ack::Outcome::Applied, "{ack:?}");
        assert!(ack.elements_cut > 0, "{ack:?}");
    }
    early.pause(true).await.expect("paused");
    let late = join(&endpoint, "late").await.expect("the server answers");
    let mut late_mirror = late.mirror("block").await.expect("mirrors");
    let seen_late = late_mirror.next().await.expect("a surface");
    let seen_early = at_step(&mut early_mirror, seen_late.frame.sim_step).await;

    assert!(seen_late.topology.epoch > first_epoch);
    assert_eq!(seen_early.topology.epoch, seen_late.topology.epoch);
    assert_eq!(seen_early.topology.vertex_count, seen_late.topology.vertex_count);
    assert_eq!(seen_early.topology.triangles, seen_late.topology.triangles);
    assert_eq!(seen_early.topology.tags, seen_late.topology.tags);
    assert_eq!(seen_early.frame.positions, seen_late.frame.positions);
    assert!(seen_late.topology.triangle_count > first.topology.triangle_count, "the cuts have lips");
}

/// The surface of a step that is the last one of a paused server.
async fn at_step(mirror: &mut BodyMirror, step: u64) -> Arc<Surface> {
    let seen = async {
        loop {
            match mirror.latest().filter(|surface| surface.frame.sim_step == step) {
                Some(surface) => return surface,
                None => drop(mirror.next().await.expect("a surface")),
            }
        }
    };
    tokio::time::timeout(PATIENCE, seen).await.expect("the last surface arrives")
}

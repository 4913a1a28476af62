//! A viewer that joins after three cuts sees the surface that one sees who was there from the start.

use std::sync::Arc;
use std::time::Duration;

use scindo_client::messages::{BladeSegment, Vec3, cut_ack};
use scindo_client::{Link, LinkConfig, LinkError, Role, Surface};
use scindo_tests::{Running, free_port};

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
    let mut last = None;
    for _ in 0..20 {
        match Link::connect(LinkConfig::new(Role::Viewer, id).with_connect([endpoint.to_owned()])).await {
            Ok(link) => return Ok(link),
            Err(error) => last = Some(error),
        }
        tokio::time::sleep(Duration::from_millis(250)).await;
    }
    Err(last.expect("tried"))
}

#[tokio::test(flavor = "multi_thread")]
async fn late_viewer_sees_the_same_surface() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let scene = directory.path().join("block.toml");
    std::fs::write(&scene, SCENE).expect("written");
    // The bulk session listens one port above the haptic one.
    let port = free_port().expect("a free port");
    let endpoint = format!("tcp/127.0.0.1:{port}");
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
    let seen_late = settled(&mut late_mirror).await;
    let seen_early = settled(&mut early_mirror).await;

    assert!(seen_late.topology.epoch > first_epoch);
    assert_eq!(seen_early.topology.epoch, seen_late.topology.epoch);
    assert_eq!(seen_early.topology.vertex_count, seen_late.topology.vertex_count);
    assert_eq!(seen_early.topology.triangles, seen_late.topology.triangles);
    assert_eq!(seen_early.topology.tags, seen_late.topology.tags);
    assert_eq!(seen_early.frame.sim_step, seen_late.frame.sim_step);
    assert_eq!(seen_early.frame.positions, seen_late.frame.positions);
    assert!(seen_late.topology.triangle_count > first.topology.triangle_count, "the cuts have lips");
}

/// The newest surface once the paused server has sent what it had.
async fn settled(mirror: &mut scindo_client::BodyMirror) -> Arc<Surface> {
    let mut last = mirror.latest();
    while let Ok(Ok(surface)) = tokio::time::timeout(Duration::from_millis(800), mirror.next()).await {
        let same = last.as_ref().is_some_and(|l| l.frame.seq == surface.frame.seq);
        last = Some(surface);
        if same {
            break;
        }
    }
    last.expect("a surface arrived")
}

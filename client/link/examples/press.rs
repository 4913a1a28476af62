//! A client that presses a tool onto a body, reads the force, and cuts.
//!
//! `cargo run -- run server/world/scenes/first-cut.toml --fast` in one terminal, then
//! `cargo run -p scindo-client --example press [ENDPOINT]` in another.

use std::time::Duration;

use scindo_client::messages::tool_sample::Mode;
use scindo_client::messages::tool_shape::{Kind, Sphere};
use scindo_client::messages::{BladeSegment, Pose, ToolSample, ToolShape, Vec3};
use scindo_client::{Link, LinkConfig, LinkError, Role};

#[tokio::main(flavor = "multi_thread", worker_threads = 2)]
async fn main() -> Result<(), LinkError> {
    let config = LinkConfig::new(Role::Haptic, "press-example").with_connect(std::env::args().nth(1));
    let link = Link::connect(config).await?;
    let body = link.info().await?.bodies.swap_remove(0);
    let mut mirror = link.mirror(&body.id).await?;
    let surface = mirror.next().await?;
    let coordinates =
        surface.frame.positions.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let coordinates: Vec<f64> = coordinates.map(f64::from).collect(); // x, y, z of every vertex [m]
    let (mut low, mut high) = ([f64::MAX; 3], [f64::MIN; 3]);
    for (i, &coordinate) in coordinates.iter().enumerate() {
        (low[i % 3], high[i % 3]) = (low[i % 3].min(coordinate), high[i % 3].max(coordinate));
    }
    let top = [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), high[2]];
    println!("body {}: {} vertices, from {low:.3?} to {high:.3?} m", body.id, coordinates.len() / 3);
    let above = |x: f64, z: f64| Vec3 { x: top[0] + x, y: top[1], z: top[2] + z };

    // A sphere of 5 mm comes down onto the middle of the body at 1 cm/s.
    let mut tool = link.tool("press-example").await?;
    for millisecond in 0..1500_u32 {
        let height = 0.010 - 1e-5 * f64::from(millisecond); // of the sphere's centre
        let sphere = Kind::Sphere(Sphere { radius_m: 0.005 });
        tool.poses.send(ToolSample {
            pose: Some(Pose { position_m: Some(above(0.0, height)), qw: 1.0, ..Pose::default() }),
            velocity_m_s: Some(Vec3 { z: -0.01, ..Vec3::default() }),
            mode: Mode::Touch.into(),
            shape: Some(ToolShape { kind: Some(sphere) }),
            ..ToolSample::default()
        })?;
        if millisecond % 250 == 0 {
            let contacts = &tool.contacts.latest().message.contacts;
            println!("{millisecond:4} ms: {} contact planes in the local model", contacts.len());
        }
        tokio::time::sleep(Duration::from_millis(1)).await;
    }

    // A blade across the body through the same place, from above to the middle; applied exactly once.
    let middle = 0.5 * (low[2] + high[2]);
    let at = |y: f64, z: f64| Some(Vec3 { x: top[0], y, z });
    let edge = |z: f64| BladeSegment { tip_m: at(low[1] - 0.01, z), heel_m: at(high[1] + 0.01, z) };
    let answer = tool.cutter.cut(&body.id, vec![edge(high[2] + 0.01), edge(middle)]).await?;
    println!("cut: {}, {} elements", answer.outcome().as_str_name(), answer.elements_cut);
    Ok(())
}

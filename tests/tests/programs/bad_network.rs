//! Real processes over a bad network: every cut is made once, and everything is well when the network is.

use std::collections::BTreeSet;
use std::time::{Duration, Instant};

use scindo_client::messages::{BladeSegment, CutAck, CutCommand, Vec3, cut_ack};
use scindo_client::{Link, LinkConfig, Role};
use scindo_tests::relay::Relay;
use scindo_tests::{PATIENCE, Running, free_pair};

const SCENE: &str = r#"
schema = 1
name = "far away"
[world]
gravity_m_s2 = [0, 0, 0]
step_s = 0.01
[[body]]
id = "block"
mesh = { box = { min_m = [0, 0, 0], max_m = [0.2, 0.04, 0.04], cells = [20, 4, 4] } }
young_pa = 2e4
poisson = 0.4
density_kg_m3 = 1000
[[body.fix]]
where = { slab = { axis = "z", from = 0, to = 0 } }
"#;

const CUTS: u64 = 15;

async fn join(port: u16, id: &str) -> Link {
    let config = LinkConfig::new(Role::Haptic, id).with_connect([format!("tcp/127.0.0.1:{port}")]);
    Link::connect(LinkConfig { timeout: PATIENCE, ..config }).await.unwrap()
}

fn command(seq: u64) -> CutCommand {
    let x = 0.2 * (seq as f64 - 0.37) / CUTS as f64;
    let at = |y, z| Some(Vec3 { x, y, z });
    let segment = |y| BladeSegment { tip_m: at(y, 0.02), heel_m: at(y, 0.06) };
    CutCommand {
        client_id: "far".into(),
        tool_id: "knife".into(),
        body_id: "block".into(),
        seq,
        sweep: vec![segment(-0.01), segment(0.05)],
        ..CutCommand::default()
    }
}

/// Whether a cut is made, now or by an earlier copy whose answer was lost.
fn is_made(ack: &CutAck) -> bool {
    matches!(ack.outcome(), cut_ack::Outcome::Applied | cut_ack::Outcome::Duplicate)
}

#[tokio::test(flavor = "multi_thread")]
async fn every_cut_is_made_once_over_a_network_that_stops_and_breaks() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("scene.toml");
    std::fs::write(&scene, SCENE).unwrap();
    let (port, far) = (free_pair(), free_pair());
    let endpoint = format!("tcp/127.0.0.1:{port}");
    let _server = Running::start("scindo", &["run", scene.to_str().unwrap(), "--listen", &endpoint]).unwrap();
    let near = join(port, "near").await;
    let stats = near.stats().await.unwrap();
    // Poses and cuts suffer; the relay passes nothing of the second port, so all of it goes through the first.
    let relay = Relay::start(far, port, 7).unwrap();
    let client = join(far, "far").await;
    let tool = client.tool("knife").await.unwrap();

    let mut answered = BTreeSet::new();
    let begun = Instant::now();
    for round in 0.. {
        if round > 0 {
            relay.calm();
        }
        for seq in 1..=CUTS {
            if answered.contains(&seq) {
                continue;
            }
            match tool.cutter.send(command(seq)).await {
                Ok(ack) if is_made(&ack) => {
                    answered.insert(seq);
                }
                // Its token was away with its connection: it may send the cut again.
                Ok(ack) => assert_eq!(ack.error.as_ref().map(|e| &*e.code), Some("no-token"), "{ack:?}"),
                Err(error) => assert!(round == 0 || begun.elapsed() < PATIENCE, "{error}"),
            }
        }
        if answered.len() as u64 == CUTS {
            break;
        }
        assert!(begun.elapsed() < 2 * PATIENCE, "{answered:?} of {CUTS} were answered");
    }
    println!("delayed, silent, cut off, half open: {:?} in {:.1?}", relay.faults().counts(), begun.elapsed());
    assert!(relay.faults().counts().iter().sum::<u64>() > 0, "a network without faults");

    // The relay and a repetition of every cut have changed nothing.
    relay.calm();
    for seq in 1..=CUTS {
        let end = Instant::now() + PATIENCE;
        while !matches!(tool.cutter.send(command(seq)).await, Ok(ack) if is_made(&ack)) {
            assert!(Instant::now() < end, "cut {seq} is answered again");
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
    }
    let end = Instant::now() + PATIENCE;
    while stats.get().is_none_or(|stats| stats.cuts_applied < CUTS) {
        assert!(Instant::now() < end, "{:?}", stats.get().map(|stats| stats.cuts_applied));
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    tokio::time::sleep(Duration::from_millis(500)).await;
    assert_eq!(stats.get().unwrap().cuts_applied, CUTS);
}

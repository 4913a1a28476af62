//! Many viewers in one process, each with a link of its own, spread over several endpoints.
//!
//! `cargo run -p scindo-client --example crowd COUNT SECONDS ENDPOINT…` beside a running server. Says `watching` once
//! every viewer has a surface, and prints what they received as JSON when the time is over. Each viewer mirrors the
//! first body as the page's relay does: it decodes and checks every frame.

use std::time::{Duration, Instant};

use scindo_client::{BodyMirror, Link, LinkConfig, LinkError, Role};

/// What one viewer received.
struct Received {
    frames: u64,
    /// Frames that came again.
    repeated: u64,
    bytes: u64,
    vertices: u32,
    longest_gap: Duration,
}

/// Viewers that join at the same time.
const AT_ONCE: usize = 16;

/// Joins, and waits for the first surface.
async fn join(number: usize, endpoint: Option<String>) -> Result<(Link, BodyMirror), LinkError> {
    let mut config = LinkConfig::new(Role::Viewer, &format!("crowd-{number}"));
    config.timeout = Duration::from_secs(60);
    let config = if endpoint.is_some() { config.with_connect(endpoint) } else { config };
    let link = Link::connect(config).await?;
    let body = link.info().await?.bodies.swap_remove(0);
    let mut mirror = link.mirror(&body.id).await?;
    mirror.next().await?;
    Ok((link, mirror))
}

#[tokio::main(flavor = "multi_thread", worker_threads = 2)]
async fn main() -> Result<(), LinkError> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |i: usize| arguments.get(i).and_then(|text| text.parse::<u32>().ok());
    let (Some(count), Some(seconds)) = (number(0), number(1)) else {
        eprintln!("usage: crowd COUNT SECONDS ENDPOINT...");
        std::process::exit(2);
    };
    let endpoints = arguments.get(2..).filter(|given| !given.is_empty());
    let mut viewers = Vec::new();
    let numbers: Vec<usize> = (0..count as usize).collect();
    for some in numbers.chunks(AT_ONCE) {
        let endpoint = |number: usize| endpoints.map(|all| all[number % all.len()].clone());
        let joining: Vec<_> =
            some.iter().map(|&number| tokio::spawn(join(number, endpoint(number)))).collect();
        for one in joining {
            viewers.push(one.await.map_err(|_| LinkError::Closed)??);
        }
    }
    eprintln!("watching");
    let end = Instant::now() + Duration::from_secs(seconds.into());
    let tasks = viewers.into_iter().map(|(link, mut mirror)| {
        tokio::spawn(async move {
            let mut received =
                Received { frames: 0, repeated: 0, bytes: 0, vertices: 0, longest_gap: Duration::ZERO };
            let (mut last, mut newest) = (Instant::now(), 0);
            while let Some(left) = end.checked_duration_since(Instant::now()) {
                let Ok(surface) = tokio::time::timeout(left, mirror.next()).await else { break };
                let frame = &surface?.frame;
                received.frames += 1;
                // Not by number: a keyframe has that of the last frame, though it may be newer.
                received.repeated += u64::from(frame.publish_unix_ns <= newest);
                newest = newest.max(frame.publish_unix_ns);
                received.bytes += (frame.positions.len() + frame.marks.len()) as u64;
                received.vertices = frame.vertex_count;
                received.longest_gap = received.longest_gap.max(last.elapsed());
                last = Instant::now();
            }
            received.longest_gap = received.longest_gap.max(last.elapsed());
            drop(link);
            Ok::<_, LinkError>(received)
        })
    });
    let mut all = Vec::new();
    for task in tasks.collect::<Vec<_>>() {
        all.push(task.await.map_err(|_| LinkError::Closed)??);
    }
    let frames: Vec<u64> = all.iter().map(|one| one.frames).collect();
    println!(
        "{{\"viewers\": {}, \"seconds\": {seconds}, \"vertices\": {}, \"frames_least\": {}, \"frames_mean\": {:.1}, \"repeated\": {}, \
         \"bytes\": {}, \"longest_gap_ms\": {}}}",
        all.len(),
        all.iter().map(|one| one.vertices).max().unwrap_or(0),
        frames.iter().min().unwrap_or(&0),
        frames.iter().sum::<u64>() as f64 / frames.len().max(1) as f64,
        all.iter().map(|one| one.repeated).sum::<u64>(),
        all.iter().map(|one| one.bytes).sum::<u64>(),
        all.iter().map(|one| one.longest_gap.as_millis()).max().unwrap_or(0),
    );
    Ok(())
}

//! A stand-in for Haply's Inverse Service with a hand that presses and lifts, to try `--device haply` without hardware.
//!
//! `cargo run -p scindo-haptic --example haply_service [HOST:PORT]` in one terminal, then
//! `scindo-haptic --device haply:HOST:PORT --tool probe` in another. Every 50 ms it prints a line: height of the hand
//! above its start [m], and the force that it was told [N].

use std::io::Write as _;
use std::time::{Duration, Instant};

#[path = "../src/device/haply/fake.rs"]
#[allow(dead_code, clippy::unwrap_used)] // It serves tests, which end where it fails.
mod fake;

use fake::{FakeService, Version};

/// How far the hand goes down [m], and how long each part of its round takes [s].
const DEPTH_M: f64 = 0.021;
const PART_S: f64 = 1.0;

/// Height of the hand `t` seconds after the start of a round: at rest, down, held, up.
fn height_m(t: f64) -> f64 {
    match t.rem_euclid(4.0 * PART_S) / PART_S {
        part if part < 1.0 => 0.0,
        part if part < 2.0 => -DEPTH_M * (part - 1.0),
        part if part < 3.0 => -DEPTH_M,
        part => -DEPTH_M * (4.0 - part),
    }
}

fn main() {
    let address = std::env::args().nth(1).unwrap_or_else(|| "127.0.0.1:10001".to_owned());
    let service = FakeService::at(&address, Version::New);
    let mut out = std::io::stdout();
    let _ = writeln!(out, "Inverse3 at {}", service.address);
    let mut started = None;
    let mut next_line = Instant::now();
    loop {
        std::thread::sleep(Duration::from_millis(1));
        let seen = service.seen();
        // The hand begins when somebody reads it.
        let from = if seen.messages > 0 { *started.get_or_insert_with(Instant::now) } else { continue };
        let height_m = height_m(from.elapsed().as_secs_f64());
        service.set(|world| world.position_m[2] = 0.15 + height_m);
        if Instant::now() >= next_line {
            next_line += Duration::from_millis(50);
            // Whoever started it may have stopped to read.
            if writeln!(out, "{height_m:.4} {:.3}", seen.force_n[2]).and_then(|()| out.flush()).is_err() {
                return;
            }
        }
    }
}

//! Hard cases that need a haptic client, beside those of `scindo-study`.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use nalgebra::Vector3;
use scindo_drill::device::{AMPLIFIER_S, BenchDevice, DAMPING_NS_M, HANDS, Hand};
use scindo_haptic::constants::{DEFAULT_SLEW_N_S, PERIOD_S};
use scindo_haptic::contact::model::{ContactInbox, contact_slot};
use scindo_haptic::device::ToolMode;
use scindo_haptic::tick::{HapticTick, Ports, TickTime};
use scindo_proto::messages::{Contact, HapticContact, Pose, Vec3, Vec3f, haptic_contact};
use scindo_study::report::chart::{Chart, Line as Curve};

use super::link::{Faults, Line};
use super::measures::Sample;
use super::trial::{LIMITS, PERIOD_OF_PRESSES_MS, press_over};
use crate::lab::Trouble;
use crate::stress::{Case, Evidence, Setting};

/// Cases of the truth table, in its order.
pub const CASES: &[Case] = &[PACKETS, WALL];

/// One millisecond [ns].
const MS: u64 = 1_000_000;
/// Largest step of force in a tick [N], with room for rounding.
const STEP_N: f64 = DEFAULT_SLEW_N_S * PERIOD_S * (1.0 + 1e-9);
/// Most energy that a hand may receive beyond what it gave [J].
const GAIN_J: f64 = 2e-3;

/// Case 25.
const PACKETS: Case = Case {
    number: Some(25),
    name: "packet-loss",
    title: "A tool's packets get lost",
    set_up: "A hand presses on a pad of tissue five times, over a link of 20 ms. Each way 30 % of the messages are \
             lost, nothing passes for 200 ms of every 1.4 s, 10 % arrive 30 ms late, so that others overtake \
             them, and 10 % arrive twice. All five hands of the haptic table.",
    rule: "No step of force is above the slew limit. In no press the hand receives more than 2 mJ beyond what it gave. The \
           force is never above the largest force of the client.",
    source: "contract of the haptic client",
    quick: true,
    run: packets,
};

/// Case 27.
const WALL: Case = Case {
    number: Some(27),
    name: "haptic-wall",
    title: "A wall at the limit of passivity",
    set_up: "A hand with hardly any damping is pushed into a wall of which the server tells the force and no stiffness, \
             every 1 ms and 10 ms late. A device of damping b renders a wall of stiffness K passively up to \
             K = b / (T/2 + τ), where τ is all latency. The wall has 0.9 and 1.5 times that.",
    rule: "The first wall comes to rest. The second is bounded: neither gives more than 2 mJ beyond what the hand gave, and \
           no step of force is above the slew limit.",
    source: "Colgate and Schenkel 1997, eq. 8; Diolaiti, Niemeyer, Barbagli, Salisbury 2006",
    quick: true,
    run: wall,
};

fn packets(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let faults = Faults { gaps_ns: Some((1400 * MS, 200 * MS)), late: (0.1, 30 * MS), twice: 0.1 };
    let mut chart = Chart::new("What the hand feels", "time [s]", "force [N]");
    for hand in HANDS {
        let lines = (Line::new(10 * MS, 0.3, 3).with(faults), Line::new(10 * MS, 0.3, 4).with(faults));
        let (samples, report) = press_over(hand, lines, setting.open_tank)?;
        let gain = samples.chunks(PERIOD_OF_PRESSES_MS).map(given).fold(0.0, f64::max);
        evidence.at_most(
            format!("{}: largest step of force", hand.name),
            report.max_force_step_n,
            STEP_N,
            "N",
        );
        evidence.at_most(format!("{}: energy given to the hand in a press", hand.name), gain, GAIN_J, "J");
        evidence.at_most(
            format!("{}: largest force", hand.name),
            report.max_force_n,
            LIMITS.max_force_n,
            "N",
        );
        evidence.at_least(format!("{}: ticks with force", hand.name), report.touch_ticks as f64, 500.0, "");
        evidence.tell(format!("{}: lowest energy of the observer", hand.name), report.min_energy_j, "J");
        let points = samples.iter().map(|sample| [sample.time_s, sample.felt_n.norm()]).collect();
        chart.lines.push(Curve { name: hand.name.to_owned(), points });
    }
    evidence.charts.push(chart);
    Ok(evidence)
}

/// Most energy that the hand has received since the first of these ticks [J].
fn given(samples: &[Sample]) -> f64 {
    let before = samples.first().map_or(0.0, |sample| sample.work_j);
    samples.iter().map(|sample| sample.work_j - before).fold(0.0, f64::max)
}

/// Latency of the wall, beyond the amplifier's [ms].
const LATENCY_MS: u64 = 10;
/// A hand that damps the device as little as a hand can.
const SLACK: Hand = Hand { name: "slack", stiffness_n_m: 40.0, damping_ns_m: 0.2, mass_kg: 0.05 };
/// Depth to which the hand wants to go, and from where [m].
const DEPTH_M: f64 = 0.02;
const CLEARANCE_M: f64 = 0.01;

/// Where the hand wants to be: in the wall from 0.7 s on.
fn into_the_wall(t: f64) -> Vector3<f64> {
    let s = ((t - 0.5) / 0.2).clamp(0.0, 1.0);
    Vector3::z() * (CLEARANCE_M - (CLEARANCE_M + DEPTH_M) * s * s * (3.0 - 2.0 * s))
}

fn wall(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let limit = DAMPING_NS_M / (PERIOD_S / 2.0 + LATENCY_MS as f64 * 1e-3 + AMPLIFIER_S);
    evidence.tell("passivity limit of the device", limit, "N/m");
    let mut chart = Chart::new("How deep the hand is in the wall", "time [s]", "depth [mm]");
    for ratio in [0.9, 1.5] {
        let course = against_wall(ratio * limit, setting.open_tank);
        let amplitude = |from: f64| {
            let depths = || course.iter().filter(|tick| tick.time_s >= from).map(|tick| tick.depth_m);
            0.5 * (depths().fold(f64::MIN, f64::max) - depths().fold(f64::MAX, f64::min))
        };
        let gain = course.iter().map(|tick| tick.work_j).fold(0.0, f64::max);
        let step = course.windows(2).map(|w| (w[1].force_n - w[0].force_n).abs()).fold(0.0, f64::max);
        if ratio < 1.0 {
            evidence.at_most("0.9: amplitude in the last half second", amplitude(2.5), 1e-4, "m");
        } else {
            evidence.at_most("1.5: amplitude in the last half second", amplitude(2.5), 5e-3, "m");
        }
        evidence.at_most(format!("{ratio}: energy given to the hand"), gain, GAIN_J, "J");
        evidence.at_most(format!("{ratio}: largest step of force"), step, STEP_N, "N");
        let points = course.iter().map(|tick| [tick.time_s, 1e3 * tick.depth_m]).collect();
        chart.lines.push(Curve { name: format!("{ratio} of the limit"), points });
    }
    evidence.charts.push(chart);
    Ok(evidence)
}

/// One tick against a wall.
struct WallTick {
    time_s: f64,
    depth_m: f64,
    force_n: f64,
    work_j: f64,
}

/// Three seconds of a hand against a wall of this stiffness [N/m].
fn against_wall(stiffness_n_m: f64, open_tank: bool) -> Vec<WallTick> {
    let (device, probe) = BenchDevice::new(SLACK, into_the_wall, |_| ToolMode::Touch);
    let (slot, contacts) = contact_slot();
    let server_alive = Arc::new(AtomicBool::new(true));
    let ports = Ports { contacts, server_alive, poses: None, log: None, meter: None };
    let mut tick = HapticTick::new(Box::new(device), LIMITS, ports);
    if open_tank {
        tick.open_tank();
    }
    let mut inbox = ContactInbox::new(slot, "");
    let mut poses: VecDeque<Vector3<f64>> = VecDeque::new();
    let one = |ms: u64| {
        let now_ns = ms * MS;
        if poses.len() as u64 >= LATENCY_MS
            && let Some(tip_m) = poses.pop_front()
        {
            inbox.accept(&of_wall(tip_m, stiffness_n_m, ms), now_ns, now_ns);
        }
        let output = tick.tick(TickTime { now_ns, elapsed_s: PERIOD_S });
        let body = probe.body();
        poses.push_back(body.measured_m);
        let depth_m = -body.position_m.z;
        WallTick { time_s: now_ns as f64 * 1e-9, depth_m, force_n: output.force_n.z, work_j: body.work_j }
    };
    (1..=3000).map(one).collect()
}

/// The server's message about the wall z < 0: a force, and no stiffness.
fn of_wall(tip_m: Vector3<f64>, stiffness_n_m: f64, seq: u64) -> HapticContact {
    let force_n = stiffness_n_m * (-tip_m.z).max(0.0);
    let z = |z: f64| Some(Vec3f { x: 0.0, y: 0.0, z: z as f32 });
    let mode = if force_n > 0.0 { haptic_contact::Mode::Contact } else { haptic_contact::Mode::Free };
    let plane = Contact { point_m: z(0.0), normal: z(1.0), force_n: z(force_n), ..Contact::default() };
    let position_m = Some(Vec3 { x: tip_m.x, y: tip_m.y, z: tip_m.z });
    HapticContact {
        seq,
        sim_step: seq,
        sim_time_s: seq as f64 * PERIOD_S,
        publish_unix_ns: seq * MS,
        tool_pose_used: Some(Pose { position_m, qw: 1.0, ..Pose::default() }),
        mode: mode.into(),
        contacts: if force_n > 0.0 { vec![plane] } else { Vec::new() },
        ..HapticContact::default()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::stress::{Mutation, Status, run_case, select};

    #[test]
    fn the_cases_pass_and_are_found_in_their_place() {
        for case in CASES {
            let report = run_case(case, &Setting::default());
            for figure in &report.evidence.figures {
                println!("{}", figure.words());
            }
            assert_eq!(report.status, Status::Passed, "{}: {:#?}", case.name, report.failures());
        }
        let all = select(&[], CASES).unwrap();
        let numbers: Vec<u8> = all.iter().filter_map(|case| case.number).collect();
        assert_eq!(numbers, (1..=numbers.len() as u8).collect::<Vec<u8>>());
        assert_eq!(select(&["27".into()], CASES).unwrap()[0].name, "haptic-wall");
    }

    #[test]
    fn without_the_tank_a_named_case_fails() {
        for name in Mutation::Tank.named() {
            let case = select(&[(*name).to_owned()], CASES).unwrap()[0];
            let report = run_case(case, &Mutation::Tank.setting());
            assert_eq!(report.status, Status::Failed, "{name} must notice");
        }
    }
}

//! A tick allocates nothing, in free space, in contact, while ramping down, with the log on.

#![allow(clippy::unwrap_used)]

use nalgebra::Vector3;
use scindo_allocations::{Counting, allocations};
use scindo_haptic::contact::model::{ContactModel, contact_slot};
use scindo_haptic::device::HapticDevice as _;
use scindo_haptic::device::haply::{HaplyAddress, HaplyDevice};
use scindo_haptic::device::path::{Path, Touch};
use scindo_haptic::device::simulated::{Hand, SimulatedDevice};
use scindo_haptic::log::recorder::Recorder;
use scindo_haptic::tick::{HapticTick, Limits, Ports, TickTime};
use scindo_proto::messages::{Contact, HapticContact, Pose, Vec3, Vec3f, haptic_contact};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

/// The service that Haply's device talks to in tests.
#[path = "../src/device/haply/fake.rs"]
#[allow(dead_code)]
mod fake;

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Two planes of the same tissue, stiff enough to need the coupling.
fn message(seq: u64) -> HapticContact {
    let plane = |x: f32, z: f32| Contact {
        point_m: Some(Vec3f::default()),
        normal: Some(Vec3f { x, y: 0.0, z }),
        force_n: Some(Vec3f::default()),
        stiffness_n_m: 3000.0,
        damping_ns_m: 1.0,
        ..Contact::default()
    };
    HapticContact {
        seq,
        epoch: (seq / 100) as u32,
        mode: haptic_contact::Mode::Contact.into(),
        tool_pose_used: Some(Pose { position_m: Some(Vec3::default()), qw: 1.0, ..Pose::default() }),
        contacts: vec![plane(0.0, 1.0), plane(0.6, 0.8)],
        validity_ms: 50.0,
        ..HapticContact::default()
    }
}

#[test]
fn a_tick_allocates_nothing() {
    let touch =
        Touch { point_m: Vector3::zeros(), direction: -Vector3::z(), depth_m: 0.004, clearance_m: 0.02 };
    let device = SimulatedDevice::new(Path::circle(&touch), Hand::default());
    let (mut slot, contacts) = contact_slot();
    let file = std::env::temp_dir().join(format!("scindo-haptic-alloc-{}.csv", std::process::id()));
    let (log, recorder) = Recorder::create(Some(&file), None).unwrap();
    let server_alive = Arc::new(AtomicBool::new(true));
    let meter = Some(Arc::default());
    let ports = Ports { contacts, server_alive, poses: None, log: Some(log), meter };
    let limits = Limits { max_force_n: 2.5, slew_n_s: 50.0 };
    let mut tick = HapticTick::new(Box::new(device), limits, ports);
    let (mut allocated, mut largest_n) = (0, 0.0f64);
    for ms in 0..8000u64 {
        let now_ns = ms * 1_000_000;
        if ms % 5 == 0 && ms < 5000 {
            slot.write(ContactModel::parse(&message(1 + ms / 5), now_ns).unwrap());
        }
        let before = allocations();
        let output = tick.tick(TickTime { now_ns, elapsed_s: 1e-3 });
        allocated += allocations() - before;
        largest_n = largest_n.max(output.force_n.norm());
    }
    drop(tick);
    recorder.finish().unwrap();
    std::fs::remove_file(file).unwrap();
    assert!(largest_n > 0.3, "the hand must have touched: {largest_n} N");
    assert_eq!(allocated, 0);
}

#[test]
fn a_haply_device_is_read_and_written_without_allocation() {
    let service = fake::FakeService::start(fake::Version::New);
    let address = HaplyAddress { address: service.address.clone(), id: None };
    let mut device = HaplyDevice::start(address, Vector3::zeros(), &Vector3::y()).unwrap();
    let (end, mut reads, mut allocated) = (Instant::now() + Duration::from_secs(20), 0, 0);
    while reads < 500 && Instant::now() < end {
        std::thread::sleep(Duration::from_millis(1));
        let before = allocations();
        let state = device.read(1e-3);
        device.write(Vector3::z());
        allocated += allocations() - before;
        reads += u64::from(state.is_ok());
    }
    assert_eq!((reads, allocated), (500, 0));
    // Up in the scene is y there and z here, so z there is -y here.
    let seen = service.seen();
    assert!((seen.force_n[1] + 1.0).abs() < 1e-9 && seen.messages > 10, "{seen:?}");
}

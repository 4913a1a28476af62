//! The device against a service that speaks the documented format.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use nalgebra::Vector3;

use super::fake::{FakeService, Version, World};
use super::*;
use crate::contact::model::{ContactInbox, contact_slot};
use crate::device::ToolMode;
use crate::safety::flag;
use crate::tick::fixture::{LIMITS, MS, contact, free};
use crate::tick::{HapticTick, Ports, TickOutput, TickTime};

const START: Vector3<f64> = Vector3::new(0.1, 0.2, 0.3);

fn device_at(address: &str) -> HaplyDevice {
    let address = HaplyAddress { address: address.to_owned(), id: None };
    HaplyDevice::start(address, START, &Vector3::z()).unwrap()
}

/// Asks until it is so. Only a thread that hangs makes it take long.
fn until<T>(what: &str, mut ask: impl FnMut() -> Option<T>) -> T {
    let end = Instant::now() + Duration::from_secs(20);
    loop {
        if let Some(answer) = ask() {
            return answer;
        }
        assert!(Instant::now() < end, "{what}");
        std::thread::sleep(Duration::from_millis(1));
    }
}

fn state_when(device: &mut HaplyDevice, what: &str, is_so: impl Fn(&DeviceState) -> bool) -> DeviceState {
    until(what, || device.read(1e-3).ok().filter(|state| is_so(state)))
}

fn seen_when(service: &FakeService, what: &str, is_so: impl Fn(&World) -> bool) -> World {
    until(what, || Some(service.seen()).filter(|world| is_so(world)))
}

#[test]
fn state_and_force_pass_in_the_format_of_either_version() {
    for version in [Version::Old, Version::New] {
        let service = FakeService::start(version);
        let mut device = device_at(&service.address);
        let first = state_when(&mut device, "a state", |_| true);
        assert_eq!(
            (first.position_m, first.mode),
            (START, ToolMode::Touch),
            "the hand starts at the start point"
        );
        assert_eq!(first.orientation, [0.5; 4]);
        service.set(|world| {
            world.position_m[0] += 0.01;
            world.velocity_m_s = [0.5, 0.0, 0.0];
            world.buttons = [false, true];
        });
        let moved = state_when(&mut device, "a moved hand", |state| state.mode == ToolMode::Cut);
        assert!((moved.position_m - START - Vector3::new(0.01, 0.0, 0.0)).norm() < 1e-12);
        assert_eq!(moved.velocity_m_s, Vector3::new(0.5, 0.0, 0.0));
        let force = Vector3::new(0.25, -0.5, 1.5);
        let felt = until("the force arrives", || {
            device.write(force);
            Some(service.seen()).filter(|world| world.force_n == [0.25, -0.5, 1.5])
        });
        let named = if version == Version::New { felt.sessions } else { 0 };
        assert_eq!((felt.wrong, felt.named), (0, named));
        drop(device);
        assert_eq!(service.seen().force_n, [0.0; 3], "zero at the end");
    }
}

#[test]
fn axes_turn_with_up_of_the_scene_and_so_does_the_force() {
    let service = FakeService::start(Version::New);
    let address = HaplyAddress { address: service.address.clone(), id: Some("049D".into()) };
    let mut device = HaplyDevice::start(address, START, &Vector3::y()).unwrap();
    state_when(&mut device, "a state", |_| true);
    service.set(|world| world.position_m[2] += 0.02);
    state_when(&mut device, "up is y", |s| {
        (s.position_m - START - Vector3::new(0.0, 0.02, 0.0)).norm() < 1e-12
    });
    let up = |world: &World| world.force_n[2] > 0.999 && world.force_n[1].abs() < 1e-9;
    until("force along y pushes the device up", || {
        device.write(Vector3::y());
        Some(()).filter(|()| up(&service.seen()))
    });
    let down = Frame::new(START, &-Vector3::z()).turn * Vector3::z();
    assert!((down + Vector3::z()).norm() < 1e-12, "up may be down");
}

#[test]
fn a_tick_that_stands_still_leaves_no_force_on() {
    let service = FakeService::start(Version::New);
    let mut device = device_at(&service.address);
    until("force", || {
        device.write(Vector3::z());
        Some(()).filter(|()| service.seen().force_n[2] == 1.0)
    });
    // Nothing is written any more; the exchange goes on and says zero.
    let before = service.seen().messages;
    let zero = seen_when(&service, "zero force", |world| world.force_n == [0.0; 3]);
    assert!(zero.messages > before);
    let (now, at) = (Instant::now(), Duration::from_millis);
    let said = Commanded { force_n: Vector3::z(), at: Some(now) };
    assert_eq!(exchange::present(&said, now + at(19)), Vector3::z());
    assert_eq!(exchange::present(&said, now + at(20)), Vector3::zeros());
    device.write(Vector3::new(0.0, 0.0, f64::NAN));
    std::thread::sleep(Duration::from_millis(10));
    assert_eq!(service.seen().force_n, [0.0; 3], "what is not finite is zero");
}

#[test]
fn a_device_or_service_that_was_away_comes_back() {
    let service = FakeService::start(Version::New);
    let mut device = device_at(&service.address);
    let gone = |device: &mut HaplyDevice, why: &str| until(why, || device.read(1e-3).err());
    let back = |device: &mut HaplyDevice, why: &str| state_when(device, why, |_| true);
    back(&mut device, "a state");
    // Unplugged; the service stays.
    service.set(|world| world.is_there = false);
    gone(&mut device, "unplugged");
    service.set(|world| (world.is_there, world.position_m[0]) = (true, 0.03));
    let moved = back(&mut device, "plugged in");
    assert!(
        (moved.position_m - START - Vector3::new(0.03, 0.0, 0.0)).norm() < 1e-12,
        "the start point is kept"
    );
    service.set(|world| world.is_ready = false);
    gone(&mut device, "not ready");
    service.set(|world| world.is_ready = true);
    back(&mut device, "ready");
    // A service that keeps the connection and says nothing.
    service.set(|world| world.answers = false);
    gone(&mut device, "silent");
    service.set(|world| world.answers = true);
    back(&mut device, "it answers again");
    assert!(service.seen().sessions >= 2, "over a new connection");
    // A service that ends and starts again.
    let address = service.address.clone();
    drop(service);
    gone(&mut device, "the service ended");
    let service = FakeService::at(&address, Version::Old);
    back(&mut device, "the service is back, as an older version");
    until("force in its own field", || {
        device.write(Vector3::z());
        Some(()).filter(|()| service.seen().force_n[2] == 1.0)
    });
    assert_eq!(service.seen().wrong, 0);
}

/// The loop on the real device, with contact messages made by the test.
struct Rig {
    tick: HapticTick,
    inbox: ContactInbox,
    now_ns: u64,
    seq: u64,
}

impl Rig {
    fn new(device: HaplyDevice) -> Self {
        let (input, contacts) = contact_slot();
        let server_alive = Arc::new(AtomicBool::new(true));
        let ports = Ports { contacts, server_alive, poses: None, log: None, meter: None };
        let tick = HapticTick::new(Box::new(device), LIMITS, ports);
        Self { tick, inbox: ContactInbox::new(input, ""), now_ns: MS, seq: 0 }
    }

    /// A tick of a millisecond, with a fresh contact.
    fn step(&mut self, pressed: bool) -> TickOutput {
        std::thread::sleep(Duration::from_millis(1));
        self.now_ns += MS;
        self.seq += 1;
        let message = if pressed { contact(self.seq, 0.0, 300.0) } else { free(self.seq) };
        self.inbox.accept(&message, self.now_ns, 0);
        self.tick.tick(TickTime { now_ns: self.now_ns, elapsed_s: 1e-3 })
    }
}

#[test]
fn a_lost_device_costs_the_force_at_once_and_gets_it_back_only_from_free_space() {
    let service = FakeService::start(Version::New);
    let address = HaplyAddress { address: service.address.clone(), id: None };
    let device = HaplyDevice::start(address, Vector3::zeros(), &Vector3::z()).unwrap();
    let mut rig = Rig::new(device);
    // Until it succeeds: a machine that is busy elsewhere for 50 ms counts as a device that is gone.
    let press = |rig: &mut Rig, what: &str| {
        until(what, || {
            service.set(|world| world.position_m[2] = 0.15);
            until("engaged in free space", || Some(()).filter(|()| rig.step(false).flags == 0));
            for _ in 0..250 {
                rig.step(false);
            }
            // The hand goes 5 mm into a wall of 300 N/m, slowly enough to pay for it.
            for i in 0..300 {
                service.set(|world| world.position_m[2] = 0.15 - 5e-5 * f64::from(i / 3));
                rig.step(true);
            }
            let is_felt = |output: &TickOutput| output.force_n.z > 1.2 && service.seen().force_n[2] > 1.0;
            (0..100).map(|_| rig.step(true)).find(is_felt)
        });
        assert!(service.seen().force_n[2] <= LIMITS.max_force_n);
    };
    press(&mut rig, "a firm press that the hand feels");

    service.set(|world| world.answers = false);
    let lost = until("the loss is noticed", || Some(rig.step(true)).filter(|o| o.flags & flag::GONE != 0));
    assert_eq!(lost.force_n, Vector3::zeros(), "at once");
    service.set(|world| world.answers = true);
    until("the device is back", || Some(()).filter(|()| rig.step(true).flags & flag::GONE == 0));
    // It comes back inside the tissue.
    for _ in 0..300 {
        let output = rig.step(true);
        assert!(output.force_n == Vector3::zeros() && output.flags & flag::WAITING != 0, "{output:?}");
    }
    assert_eq!(service.seen().force_n, [0.0; 3]);
    press(&mut rig, "a firm press again");
}

#[test]
fn addresses_have_defaults() {
    let parse = |text: &str| HaplyAddress::parse(text).map(|a| (a.address, a.id));
    assert_eq!(parse(""), Ok(("127.0.0.1:10001".into(), None)));
    assert_eq!(parse("desk"), Ok(("desk:10001".into(), None)));
    assert_eq!(parse("desk:1234/049D"), Ok(("desk:1234".into(), Some("049D".into()))));
    assert_eq!(parse("/049D"), Ok(("127.0.0.1:10001".into(), Some("049D".into()))));
    assert_eq!(parse("[::1]"), Ok(("[::1]:10001".into(), None)));
    for bad in ["desk:0", "desk:port", "desk:70000"] {
        assert!(parse(bad).is_err(), "{bad}");
    }
}

#[test]
fn what_is_no_update_is_told() {
    for text in ["", "[1]", "{\"inverse3\": 1}", "{\"inverse3\": [{}]}"] {
        assert!(service::Update::read(text).is_err(), "{text}");
    }
    let bare = service::Update::read("{\"inverse3\": [{\"device_id\": \"1\"}]}").unwrap();
    let device = bare.device(None).unwrap();
    assert!(
        bare.hand(device).is_none() && device.force_field().is_none() && bare.device(Some("2")).is_none()
    );
}

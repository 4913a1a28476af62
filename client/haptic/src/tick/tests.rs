use super::fixture::{LIMITS, MS, Rig, contact, free};
use super::*;
use proptest::prelude::*;
use scindo_proto::messages::{Contact, HapticContact, Pose, Vec3, Vec3f};

fn largest_step(outputs: &[TickOutput]) -> f64 {
    outputs.windows(2).map(|w| (w[1].force_n - w[0].force_n).norm()).fold(0.0, f64::max)
}

/// Depth at which the wall of [`firm`] gives 2 N [m].
const TWO_NEWTONS_M: f64 = 2.0 / 300.0;

fn firm(seq: u64) -> HapticContact {
    contact(seq, 0.0, 300.0)
}

#[test]
fn a_model_that_brings_force_from_nowhere_is_taken_over_slowly() {
    let mut rig = Rig::engaged(LIMITS);
    let outputs = rig.run(3000, Some(&|seq| contact(seq, 1.5, 300.0)));
    let at = |ms: usize| outputs[ms].force_n.z;
    assert!(at(200) < 1.0 && outputs[200].flags & flag::UNPAID != 0, "{}", at(200));
    assert!((at(2999) - 1.5).abs() < 1e-9, "{}", at(2999));
}

#[test]
fn a_press_is_felt_as_the_law_says() {
    let mut rig = Rig::engaged(LIMITS);
    let outputs = rig.press(0.002, &|seq| contact(seq, 0.6, 300.0));
    assert!((outputs.last().unwrap().force_n.z - 1.2).abs() < 1e-6);
    assert_eq!(rig.device.given(), outputs.last().unwrap().force_n);
    assert!(largest_step(&outputs) <= 0.05 + 1e-12);
}

#[test]
fn no_force_before_free_space() {
    let mut rig = Rig::new(LIMITS);
    let pressed = rig.run(1000, Some(&|seq| contact(seq, 1.0, 300.0)));
    assert!(pressed.iter().all(|o| o.force_n == Vector3::zeros() && o.flags & flag::WAITING != 0));
}

#[test]
fn a_server_that_is_killed_is_felt_as_zero_within_200_ms() {
    let mut rig = Rig::engaged(LIMITS);
    rig.press(TWO_NEWTONS_M, &firm);
    rig.device.place(Vector3::z() * -TWO_NEWTONS_M, Vector3::new(0.0, 0.0, -0.05));
    let silent = rig.run(1000, None);
    assert!(silent[30].force_n.z > 1.9, "held within the validity");
    assert!(largest_step(&silent) <= 0.05 + 1e-12);
    assert!(silent[200..].iter().all(|o| o.force_n == Vector3::zeros()), "{:?}", silent[200]);
    assert!(silent[600].flags & flag::LOST != 0);
    let back = rig.run(500, Some(&firm));
    assert!(back.iter().all(|o| o.force_n == Vector3::zeros()), "only from free space");
    rig.run(500, Some(&free));
    let again = rig.press(TWO_NEWTONS_M, &firm);
    assert!(again.last().unwrap().force_n.z > 1.9);
}

#[test]
fn the_token_of_the_server_counts_as_the_stream_does() {
    let mut rig = Rig::engaged(LIMITS);
    rig.run(400, Some(&|seq| contact(seq, 2.0, 300.0)));
    rig.alive.store(false, Ordering::Relaxed);
    let outputs = rig.run(200, Some(&|seq| contact(seq, 2.0, 300.0)));
    assert_eq!(outputs.last().unwrap().force_n, Vector3::zeros());
    assert!(largest_step(&outputs) <= 0.05 + 1e-12);
}

#[test]
fn a_device_that_is_unplugged_gets_no_force_and_comes_back_through_free_space() {
    let mut rig = Rig::engaged(LIMITS);
    let pressed = rig.press(TWO_NEWTONS_M, &firm);
    assert!(pressed.last().unwrap().force_n.z > 1.9);
    rig.device.unplug(true);
    let gone = rig.run(300, Some(&|seq| contact(seq, 2.0, 300.0)));
    assert!(gone.iter().all(|o| o.force_n == Vector3::zeros() && o.flags & flag::GONE != 0));
    // It comes back somewhere else, which is no jump; first without force, then as before.
    rig.device.place(Vector3::new(0.0, 0.1, 0.0), Vector3::zeros());
    rig.device.unplug(false);
    let back = rig.run(300, Some(&|seq| contact(seq, 2.0, 300.0)));
    assert!(back.iter().all(|o| o.force_n == Vector3::zeros() && o.flags & flag::DEVICE_FAULTS == 0));
    rig.device.place(Vector3::zeros(), Vector3::zeros());
    rig.run(1, Some(&free)); // the way back in one tick is a jump
    rig.run(600, Some(&free));
    let again = rig.press(TWO_NEWTONS_M, &firm);
    assert!(again.last().unwrap().force_n.z > 1.9);
}

#[test]
fn a_jump_or_nan_of_the_device_cuts_the_force_at_once() {
    for bad in [Vector3::new(0.0, 0.0, 0.03), Vector3::new(f64::NAN, 0.0, 0.0)] {
        let mut rig = Rig::engaged(LIMITS);
        rig.run(400, Some(&|seq| contact(seq, 2.0, 300.0)));
        rig.device.place(bad, Vector3::zeros());
        let output = rig.step();
        assert_eq!(output.force_n, Vector3::zeros());
        assert!(output.flags & flag::DEVICE_FAULTS != 0);
        assert_eq!(rig.tick.report().device_faults, 1);
    }
}

#[test]
fn a_cut_changes_the_force_over_twenty_milliseconds() {
    let mut rig = Rig::engaged(Limits { max_force_n: 2.5, slew_n_s: 1000.0 });
    rig.run(400, Some(&|seq| contact(seq, 1.0, 300.0)));
    let opened = rig.run(30, Some(&|seq| HapticContact { epoch: 2, ..contact(seq, 0.0, 300.0) }));
    assert!(opened[9].force_n.z > 0.45, "{}", opened[9].force_n.z);
    assert_eq!(opened[25].force_n, Vector3::zeros());
}

#[test]
fn stiff_tissue_on_a_hand_does_not_chatter() {
    use crate::device::path::{Path, Touch};
    use crate::device::simulated::{Hand, SimulatedDevice};
    let touch =
        Touch { point_m: Vector3::zeros(), direction: -Vector3::z(), depth_m: 0.005, clearance_m: 0.02 };
    let device = SimulatedDevice::new(Path::press(&touch), Hand::default());
    let (mut input, contacts) = crate::contact::model::contact_slot();
    let alive = Arc::new(AtomicBool::new(true));
    let mut tick = HapticTick::new(
        Box::new(device),
        LIMITS,
        Ports { contacts, server_alive: alive, poses: None, log: None, meter: Some(Arc::default()) },
    );
    let mut late = Vec::new();
    for ms in 0..2600u64 {
        if ms % 5 == 0 {
            let message = contact(ms / 5 + 1, 0.0, 20_000.0);
            input.write(crate::contact::model::ContactModel::parse(&message, ms * MS).unwrap());
        }
        let output = tick.tick(TickTime { now_ns: ms * MS, elapsed_s: 1e-3 });
        if ms > 2300 {
            late.push(output.force_n.z);
        }
    }
    let (low, high) = late.iter().fold((f64::MAX, 0.0f64), |(l, h), f| (l.min(*f), h.max(*f)));
    assert!(low > 0.8 && high < 1.2 && high - low < 0.05, "held force {low} to {high} N");
}

/// Any message that a broken or hostile server may send.
fn garbage() -> impl Strategy<Value = HapticContact> {
    let number = prop_oneof![
        3 => -10.0..10.0f64,
        1 => prop_oneof![Just(f64::NAN), Just(f64::INFINITY), Just(-1e300), Just(1e5), Just(0.0)],
    ];
    let vec3 = (number.clone(), number.clone(), number.clone()).prop_map(|(x, y, z)| Vec3 { x, y, z });
    let single = vec3.clone().prop_map(|v| Vec3f { x: v.x as f32, y: v.y as f32, z: v.z as f32 });
    let unit = prop_oneof![Just(Vec3f { x: 0.0, y: 0.0, z: 1.0 }), Just(Vec3f { x: 0.6, y: -0.8, z: 0.0 })];
    let plane = (unit, single.clone(), number.clone(), number.clone(), single, 0.0..0.02f32).prop_map(
        |(normal, force, stiffness, damping, velocity, patch_radius_m)| Contact {
            point_m: Some(Vec3f::default()),
            normal: Some(normal),
            force_n: Some(force),
            stiffness_n_m: (stiffness * 1e3) as f32,
            damping_ns_m: damping as f32,
            surface_velocity_m_s: Some(velocity),
            patch_radius_m,
            tangential_stiffness_n_m: (damping * 1e3) as f32,
            ..Contact::default()
        },
    );
    (0..200u64, proptest::collection::vec(plane, 0..10), number.clone(), number, 0..3u32, vec3).prop_map(
        |(seq, contacts, validity, max_force, epoch, used)| HapticContact {
            epoch,
            contacts,
            relaxed_stiffness_n_m: validity as f32,
            relaxation_s: max_force as f32,
            validity_ms: (validity * 20.0) as f32,
            max_force_n: max_force as f32,
            tool_pose_used: Some(Pose { position_m: Some(used), qw: 1.0, ..Pose::default() }),
            ..free(seq)
        },
    )
}

#[derive(Debug, Clone)]
enum Arrival {
    Nothing,
    Free,
    Contact(f64, f32),
    Garbage(Box<HapticContact>),
    Token(bool),
}

fn arrival() -> impl Strategy<Value = Arrival> {
    prop_oneof![
        8 => Just(Arrival::Nothing),
        2 => Just(Arrival::Free),
        4 => (0.0..20.0f64, 0.0..1e5f32).prop_map(|(f, k)| Arrival::Contact(f, k)),
        2 => garbage().prop_map(|m| Arrival::Garbage(Box::new(m))),
        1 => any::<bool>().prop_map(Arrival::Token),
    ]
}

/// A force far above the clamp, then silence: the force is zero in time, although the slew is slow.
#[test]
fn silence_is_followed_however_large_the_force_was() {
    let mut rig = Rig::engaged(Limits { max_force_n: 3.5, slew_n_s: 55.0 });
    // Nothing before the limits may be needed for it.
    rig.tick.open_tank();
    rig.seq += 1;
    rig.inbox.accept(&contact(rig.seq, 1e3, 0.0), rig.now_ns, 0);
    rig.device.place(Vector3::zeros(), Vector3::zeros());
    let highest = (0..195).map(|_| rig.step().force_n.norm()).fold(0.0, f64::max);
    assert!(highest > 0.5, "{highest} N");
    assert!(rig.step().force_n.norm() < 0.06, "one tick of the slew limit");
    assert_eq!(rig.step().force_n.norm(), 0.0);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    /// Messages may be lost, late or corrupt. The force stays finite and within the clamp, and it never
    /// changes faster than the slew limit.
    #[test]
    fn clamp_and_slew_hold_for_any_stream(
        arrivals in proptest::collection::vec((arrival(), -0.004..0.004f64, -0.5..0.5f64), 1..400),
        max_force_n in 0.1..7.9f64,
        slew_n_s in 10.0..500.0f64,
    ) {
        let mut rig = Rig::engaged(Limits { max_force_n, slew_n_s });
        let mut last = Vector3::zeros();
        for (arrival, z, v) in arrivals {
            rig.seq += 1;
            match arrival {
                Arrival::Nothing => {}
                Arrival::Free => rig.inbox.accept(&free(rig.seq), rig.now_ns, 0),
                Arrival::Contact(f, k) => rig.inbox.accept(&contact(rig.seq, f, k), rig.now_ns, 0),
                Arrival::Garbage(message) => rig.inbox.accept(&message, rig.now_ns, 0),
                Arrival::Token(alive) => rig.alive.store(alive, Ordering::Relaxed),
            }
            rig.device.place(Vector3::new(0.0, 0.0, z), Vector3::new(0.0, 0.0, v));
            let force = rig.step().force_n;
            prop_assert!(force.iter().all(|f| f.is_finite()));
            prop_assert!(force.norm() <= max_force_n * (1.0 + 1e-12), "{} above {max_force_n}", force.norm());
            prop_assert!((force - last).norm() <= slew_n_s * PERIOD_S * (1.0 + 1e-9));
            last = force;
        }
        for _ in 0..200 {
            rig.step();
        }
        prop_assert_eq!(rig.step().force_n.norm() <= 1e-12 || slew_n_s < max_force_n * 10.0, true);
    }
}

//! Forces of contact for clients: they balance, and they are gathered only for those who ask.

use nalgebra::Vector3;
use scindo_tests::scene::{FLOOR, WORLD, ball, block};
use scindo_world::inputs::{Inputs, Wants};
use scindo_world::simulation::Simulation;
use scindo_world::snapshot::Snapshot;
use scindo_world::snapshot::forces::{ForceKind, ForcePair, MAX_FORCE_POINTS};

use crate::start;

const G: f64 = 9.81;

/// A block of 1 kg on a floor, one of half that mass on top of it, and a ball that presses on the upper one.
fn stack() -> String {
    let keys = "young_pa = 1e5\npoisson = 0.3\nrayleigh = { mass_1_s = 20.0, stiffness_s = 0.01 }";
    [
        WORLD,
        "effects = { body_collision = true }\n",
        &block("lower", [[0.0; 3], [0.1; 3]], [6; 3], keys),
        &block("upper", [[0.0, 0.0, 0.1], [0.1, 0.1, 0.15]], [6, 6, 3], keys),
        "[[obstacle]]\nid = \"ceiling\"\nhalf_space = { point_m = [0, 0, 1], normal = [0, 0, -1] }\n",
        FLOOR,
        &ball("ball", 0.02, &[(0.0, [0.05, 0.05, 0.3]), (0.5, [0.05, 0.05, 0.165])]),
    ]
    .concat()
}

fn stepped(steps: u32) -> (Simulation, Snapshot) {
    let mut sim = start(&stack());
    let wants = Wants { forces: true, ..Wants::default() };
    for _ in 0..steps {
        sim.step(&Inputs { wants: wants.clone(), ..Inputs::default() });
    }
    let mut snapshot = Snapshot::default();
    sim.snapshot_into(&wants, &mut snapshot);
    (sim, snapshot)
}

#[test]
fn forces_balance_with_weights_and_tools() {
    let (sim, snapshot) = stepped(300);
    let forces = &snapshot.forces;
    let find = |kind: ForceKind, on: u32, by: u32| -> &ForcePair {
        let is_it = |pair: &&ForcePair| (pair.kind, pair.on, pair.by) == (kind, on, by);
        forces.pairs.iter().find(is_it).unwrap_or_else(|| panic!("{kind:?} {on} {by}: {:?}", forces.pairs))
    };
    assert_eq!(forces.pairs.len(), 3, "{:?}", forces.pairs);
    let (tool, floor) = (find(ForceKind::Tool, 1, 0), find(ForceKind::Obstacle, 0, 1));
    let between = find(ForceKind::Body, 0, 1);
    assert!(tool.force_n.z < -0.5, "the ball presses downwards: {tool:?}");
    assert!((tool.force_n + sim.tools().iter().next().unwrap().force_n).norm() < 1e-9, "action and reaction");
    // At rest each contact carries what stands on it.
    let near = |found: f64, wanted: f64| assert!((found / wanted - 1.0).abs() < 0.02, "{found} {wanted}");
    near(-between.force_n.z, 0.5 * G - tool.force_n.z);
    near(floor.force_n.z, 1.5 * G - tool.force_n.z);
    for pair in &forces.pairs {
        let points = forces.points_of(pair);
        assert_eq!(points.len(), MAX_FORCE_POINTS.min(pair.contacts as usize), "{pair:?}");
        let sum: Vector3<f64> = points.iter().map(|point| point.force_n()).sum();
        if points.len() == pair.contacts as usize {
            assert!((sum - pair.force_n).norm() < 1e-9 * pair.force_n.norm(), "{sum} {pair:?}");
        }
        // The strongest are kept: they carry more than their share.
        let share = points.len() as f64 / f64::from(pair.contacts);
        let carried: f64 = points.iter().map(|point| point.normal_n).sum();
        assert!(carried >= 0.999 * share * pair.normal_n, "{carried} of {pair:?}");
        for point in points {
            assert!((point.normal.norm() - 1.0).abs() < 1e-9 && point.normal_n > 0.0, "{point:?}");
            assert!(point.tangential_n.dot(&point.normal).abs() < 1e-9 * point.size_n(), "{point:?}");
            assert!(point.depth_m <= pair.deepest_m + 1e-9, "{point:?} {pair:?}");
            assert!(point.normal.z.abs() > 0.9, "{point:?}");
        }
    }
}

#[test]
fn nobody_asks_nothing_is_gathered() {
    let (mut sim, mut snapshot) = stepped(60);
    assert!(!snapshot.forces.pairs.is_empty() && sim.plan().is_on("force publication"));
    sim.snapshot_into(&Wants::default(), &mut snapshot);
    assert!(!snapshot.forces.asked && snapshot.forces.pairs.is_empty() && snapshot.forces.points.is_empty());
    sim.step(&Inputs::default());
    assert!(!sim.plan().is_on("force publication"));
    sim.reset().unwrap();
    sim.snapshot_into(&Wants { forces: true, ..Wants::default() }, &mut snapshot);
    assert!(snapshot.forces.pairs.is_empty(), "{:?}", snapshot.forces.pairs);
}

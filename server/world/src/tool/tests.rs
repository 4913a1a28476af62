//! Ownership of tools, and what happens when it changes.

use nalgebra::Unit;

use super::*;
use crate::scene::checked::PathPoint;

const BLADE: ToolShape = ToolShape::Blade { length_m: 0.04, thickness_m: 0.001 };

fn scripted() -> ToolSpec {
    let key = |at_s: f64, mode| PathPoint {
        at_s,
        tip_m: Vector3::new(at_s, 0.0, 0.0),
        toward: Unit::new_normalize(Vector3::z()),
        across: None,
        mode,
    };
    ToolSpec {
        id: "scalpel".into(),
        shape: BLADE,
        stiffness_n_m: 800.0,
        max_force_n: 8.0,
        friction: 0.0,
        path: vec![key(0.0, ToolMode::Cut), key(1.0, ToolMode::Cut)],
        repeat_s: Some(1.0),
    }
}

fn sample(id: &str, x: f64, shape: Option<ToolShape>) -> ToolInput {
    ToolInput {
        id: Arc::from(id),
        owner: Arc::from("someone"),
        pose: Isometry3::translation(x, 0.0, 0.0),
        passed: Vec::new(),
        velocity_m_s: Vector3::x(),
        mode: ToolMode::Touch,
        closed: None,
        shape,
        seq: 7,
        client_time_ns: 3,
    }
}

#[test]
fn a_script_gives_way_to_a_hand_and_takes_over_again() {
    let mut tools = Tools::new(&[scripted()], false);
    tools.advance(0.25, &[]);
    let tool = tools.iter().next().unwrap();
    assert_eq!((&*tool.owner, tool.mode), ("script", ToolMode::Cut));
    tools.advance(0.27, &[sample("scalpel", 5.0, None)]);
    let tool = tools.iter().next().unwrap();
    assert_eq!((&*tool.owner, tool.mode, tool.seq), ("someone", ToolMode::Touch, 7));
    assert_eq!(tool.pose.translation.x, 5.0);
    assert_eq!(tool.hand_overs(), 2, "from nobody to the script, and on to the hand");
    tools.advance(0.5, &[]);
    let tool = tools.iter().next().unwrap();
    assert_eq!(&*tool.owner, "script");
    assert!((tool.pose.translation.x - 0.5).abs() < 1e-9);
    assert_eq!(tool.velocity_m_s, Vector3::zeros(), "the jump is no velocity");
    tools.advance(0.51, &[]);
    assert!(tools.iter().next().unwrap().velocity_m_s.x > 0.5);
}

#[test]
fn a_new_round_of_a_script_is_a_new_incision() {
    let mut tools = Tools::new(&[scripted()], false);
    let mut incisions = Vec::new();
    for step in 0..20 {
        tools.advance(0.1 * f64::from(step) + 0.05, &[]);
        if let Some((sweep, incision)) = tools.take_sweep(0, 0.01) {
            let [from, to] = [sweep.segments[0][0], sweep.segments[1][0]];
            assert!((to - from).norm() < 0.3, "no cut back to the start");
            incisions.push(incision);
        }
    }
    incisions.dedup();
    assert_eq!(incisions, [1, 2]);
    assert_eq!(tools.fresh_incision(), 3);
}

#[test]
fn guests_come_with_a_shape_while_there_is_room_and_leave_when_they_fall_silent() {
    let mut tools = Tools::new(&[scripted()], false);
    let shape = Some(ToolShape::Sphere { radius_m: 0.01 });
    tools.advance(0.0, &[sample("finger", 1.0, shape), sample("ghost", 1.0, None)]);
    assert_eq!(tools.len(), 2, "a guest without a shape is refused");
    assert_eq!(tools.refused_samples(), 1);
    let crowd: Vec<_> = (0..MAX_TOOLS + 4).map(|i| sample(&format!("guest-{i}"), 0.0, shape)).collect();
    tools.advance(0.1, &crowd);
    assert_eq!(tools.len(), MAX_TOOLS);
    tools.advance(0.2, &[]);
    assert_eq!(tools.len(), 1);
}

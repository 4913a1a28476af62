//! Tools against a slab whose motion the tests prescribe.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use scindo_physics::cut::CutMesh;
use scindo_physics::mesh::{BoxPattern, box_mesh};
use std::sync::Arc;

use super::*;
use crate::inputs::{ToolInput, ToolMode, ToolShape};
use crate::scene::checked::ToolSpec;

type V = Vector3<f64>;

const BALL: ToolShape = ToolShape::Sphere { radius_m: 0.002 };
const ROD: ToolShape = ToolShape::Capsule { radius_m: 0.002, length_m: 0.04 };

/// A slab, 200 x 200 x 10 mm, its top at z = 0, with one tool above it.
struct Bench {
    body: CutMesh,
    x: Vec<V>,
    positions: Vec<[f32; 3]>,
    tools: Tools,
    contacts: Contacts,
    owner: Arc<str>,
    time_s: f64,
}

impl Bench {
    fn new(shape: ToolShape) -> Self {
        let mesh = box_mesh(
            V::new(-0.1, -0.1, -0.01),
            V::new(0.1, 0.1, 0.0),
            [20, 20, 2],
            BoxPattern::Tet5 { parity: false },
        );
        let x = mesh.nodes.clone();
        let spec = ToolSpec {
            id: "probe".into(),
            shape,
            stiffness_n_m: 500.0,
            max_force_n: 5.0,
            friction: 0.0,
            path: Vec::new(),
            repeat_s: None,
        };
        let mut contacts = Contacts::default();
        contacts.add_body(1e4, true);
        let body = CutMesh::new(mesh).unwrap();
        let tools = Tools::new(&[spec], false);
        Self { body, x, positions: Vec::new(), tools, contacts, owner: Arc::from("test"), time_s: 0.0 }
    }

    fn step(&mut self, tip: V, mode: ToolMode) -> &Tool {
        self.step_posed(Isometry3::translation(tip.x, tip.y, tip.z), mode)
    }

    /// One step without the solve.
    fn step_posed(&mut self, pose: Isometry3<f64>, mode: ToolMode) -> &Tool {
        self.time_s += 0.005;
        let sample = ToolInput { mode, ..ToolInput::new("probe", &self.owner, pose) };
        self.tools.advance(self.time_s, &[sample]);
        let surface = self.body.surface();
        self.positions.clear();
        let places = surface.vertices.iter().map(|v| v.position(&self.x));
        self.positions.extend(places.map(|p| [p.x as f32, p.y as f32, p.z as f32]));
        self.contacts.update_surface(0, self.body.epoch(), (surface, &self.x), &self.positions).unwrap();
        self.contacts.detect(&self.tools, 0.005);
        self.tools.iter().next().unwrap()
    }

    fn proxy(&self) -> Isometry3<f64> {
        *self.contacts.hand(0).unwrap().proxy_pose()
    }

    /// Forces of all springs at the present node positions.
    fn forces(&self) -> Vec<V> {
        let force = |spring: &PointSpring| {
            let x: V = spring.point.position(&self.x);
            let force = match spring.kind {
                SpringKind::OneSided { normal, offset_m } | SpringKind::Rough { normal, offset_m, .. } => {
                    normal * spring.stiffness_n_m * (offset_m - normal.dot(&x)).max(0.0)
                }
                SpringKind::Hold { target_m } => (target_m - x) * spring.stiffness_n_m,
            };
            force.cap_magnitude(spring.max_force_n)
        };
        self.contacts.springs(0).iter().map(force).collect()
    }

    /// Reactions if the nodes do not move.
    fn solve(&mut self) -> V {
        let forces = self.forces();
        self.contacts.collect(0, &forces);
        self.contacts.react(&mut self.tools);
        forces.iter().sum()
    }
}

#[test]
fn a_jab_of_ten_metres_per_second_does_not_pass() {
    // 50 mm per 5 ms, from above to far below the 10 mm slab and back, at many places.
    for i in 0..40 {
        let mut bench = Bench::new(BALL);
        let aside = V::new(0.0017 * f64::from(i), -0.0011 * f64::from(i), 0.0);
        bench.step(V::new(0.0, 0.0, 0.02) + aside, ToolMode::Touch);
        bench.step(V::new(0.003, 0.0, -0.03) + aside, ToolMode::Touch);
        let proxy = bench.proxy();
        assert!((proxy.translation.z - 0.002).abs() < 1e-5, "{proxy}");
        let force = bench.solve();
        assert!(force.z < -4.9 && force.norm() < 5.0 + 1e-9, "capped: {force}");
        bench.step(V::new(0.0, 0.01, -0.08) + aside, ToolMode::Touch);
        let proxy = bench.proxy();
        assert!(proxy.translation.z > 0.0019);
        let pose = bench.step(V::new(0.0, 0.0, 0.02) + aside, ToolMode::Touch).pose;
        assert_eq!(bench.proxy(), pose, "free again");
        assert_eq!(bench.solve(), V::zeros());
    }
}

#[test]
fn a_teleport_through_the_body_stays_on_its_side() {
    let mut bench = Bench::new(ROD);
    bench.step(V::new(0.01, 0.02, 0.05), ToolMode::Touch);
    for _ in 0..10 {
        bench.step(V::new(-0.02, 0.0, -0.5), ToolMode::Touch);
        let proxy = bench.proxy();
        assert!(proxy.translation.z > 0.0019, "{proxy}");
    }
}

#[test]
fn a_hand_over_does_not_drag_the_proxy_along() {
    let mut bench = Bench::new(BALL);
    let (above, below) = (V::new(0.0, 0.0, 0.02), V::new(0.0, 0.0, -0.05));
    bench.step(above, ToolMode::Touch);
    bench.owner = Arc::from("another");
    let pose = bench.step(below, ToolMode::Touch).pose;
    assert_eq!(bench.proxy(), pose);
    bench.step(above, ToolMode::Touch);
    assert!(bench.proxy().translation.z < -0.0119, "stopped at the lower side");
}

#[test]
fn hands_stay_with_their_tools_when_a_guest_leaves() {
    let mut bench = Bench::new(BALL);
    let guest = |id: &str, x: f64| ToolInput {
        shape: Some(BALL),
        ..ToolInput::new(id, id, Isometry3::translation(x, 0.0, 0.03))
    };
    let proxies = |bench: &Bench| -> Vec<f64> {
        (0..bench.tools.len()).map(|i| bench.contacts.hand(i).unwrap().proxy_pose().translation.x).collect()
    };
    bench.tools.advance(0.005, &[guest("a", 0.01), guest("b", 0.02), guest("c", 0.03)]);
    bench.contacts.detect(&bench.tools, 0.005);
    assert_eq!(proxies(&bench), [0.0, 0.01, 0.02, 0.03]);
    bench.tools.advance(0.01, &[guest("b", 0.02), guest("c", 0.03), guest("d", 0.04)]);
    bench.contacts.detect(&bench.tools, 0.005);
    assert_eq!(proxies(&bench), [0.0, 0.02, 0.03, 0.04]);
}

#[test]
fn the_proxy_slides_on_a_plane() {
    let mut bench = Bench::new(BALL);
    bench.step(V::new(-0.05, 0.0, 0.01), ToolMode::Touch);
    for i in 0..=100 {
        let x = -0.05 + 0.001 * f64::from(i);
        bench.step(V::new(x, 0.5 * x, -0.003), ToolMode::Touch);
        let proxy = bench.proxy();
        let tip = proxy.translation.vector;
        assert!((tip - V::new(x, 0.5 * x, 0.002)).norm() < 1e-5, "{tip} at {x}");
    }
}

#[test]
fn a_rising_surface_carries_the_proxy() {
    let mut bench = Bench::new(BALL);
    let tip = V::new(0.013, 0.007, 0.004);
    bench.step(tip, ToolMode::Touch);
    for _ in 0..6 {
        for x in &mut bench.x {
            x.z += 0.02;
        }
        let top = bench.x.iter().map(|x| x.z).fold(f64::MIN, f64::max);
        bench.step(tip, ToolMode::Touch);
        let proxy = bench.proxy();
        assert!((proxy.translation.z - top - 0.002).abs() < 2e-5, "{proxy} above {top}");
    }
}

#[test]
fn a_turning_shaft_stops_at_the_surface() {
    let mut bench = Bench::new(ROD);
    let tip = Translation3::new(0.0, 0.0, 0.012);
    for i in 0..8 {
        // The shaft tilts over into the slab, 20 degrees per step.
        let turn = UnitQuaternion::from_axis_angle(&V::x_axis(), 0.35 * f64::from(i));
        let shape = bench.step_posed(Isometry3::from_parts(tip, turn), ToolMode::Touch).shape;
        let heel = crate::tool::geometry::core(shape, &bench.proxy())[1];
        assert!(heel.z > 0.002 - 2e-4, "step {i}: heel at {heel}");
    }
    assert!(bench.solve().z < -0.5);
}

#[test]
fn force_and_reaction_balance_and_grow_with_depth() {
    for shape in [BALL, ROD, ToolShape::Blade { length_m: 0.04, thickness_m: 0.001 }] {
        let radius = core_radius(shape);
        let mut bench = Bench::new(shape);
        // Lying on its side.
        let lying = UnitQuaternion::from_axis_angle(&V::y_axis(), std::f64::consts::FRAC_PI_2);
        let at = |depth: f64| Isometry3::from_parts(Translation3::new(-0.02, 0.003, radius - depth), lying);
        bench.step_posed(at(-0.001), ToolMode::Touch);
        assert_eq!(bench.solve(), V::zeros());
        for depth in [0.0005, 0.001, 0.002, 0.004] {
            bench.step_posed(at(depth), ToolMode::Touch);
            let on_tissue = bench.solve();
            let on_tool = bench.tools.iter().next().unwrap().force_n;
            assert!((on_tissue + on_tool).norm() < 1e-12);
            // The springs of a shaft add up to that of the tool. The edges of a ball lie less deep.
            let full = 500.0 * depth;
            assert!(on_tool.z > 0.5 * full && on_tool.z < 1.02 * full, "{on_tool} of {full}");
            assert!(on_tool.xy().norm() < 0.05 * full, "{on_tool}");
        }
    }
}

#[test]
fn a_grip_pulls_what_it_took_and_lets_go() {
    let mut bench = Bench::new(BALL);
    bench.step(V::new(0.0, 0.0, 0.003), ToolMode::Hover);
    bench.step(V::new(0.0, 0.0, 0.003), ToolMode::Grab);
    assert!(bench.solve().norm() < 1e-4, "a closing grip does not pull");
    bench.step(V::new(0.001, 0.0, 0.006), ToolMode::Grab);
    let force = bench.solve();
    assert!((force - V::new(0.5, 0.0, 1.5)).norm() < 1e-4, "{force}");
    bench.step(V::new(0.001, 0.0, 0.006), ToolMode::Hover);
    assert!(bench.contacts.springs(0).is_empty());
    // Too far away to grip anything.
    bench.step(V::new(0.0, 0.0, 0.05), ToolMode::Grab);
    assert!(bench.contacts.springs(0).is_empty());
}

#[test]
fn a_sample_that_is_not_finite_is_ignored_and_counted() {
    let mut bench = Bench::new(BALL);
    let good = bench.step(V::new(0.0, 0.0, 0.01), ToolMode::Touch).pose;
    for bad in [f64::NAN, f64::INFINITY, 1e300] {
        let pose = bench.step(V::new(0.0, bad, 0.01), ToolMode::Touch).pose;
        assert_eq!((pose, bench.proxy()), (good, good));
    }
    assert_eq!(bench.tools.refused_samples(), 3);
}

#[test]
fn a_tool_that_starts_inside_is_put_outside() {
    let mut bench = Bench::new(BALL);
    bench.step(V::new(0.004, 0.0, -0.002), ToolMode::Touch);
    let proxy = bench.proxy();
    assert!((proxy.translation.vector - V::new(0.004, 0.0, 0.002)).norm() < 1e-5, "{proxy}");
}

#[test]
fn a_body_that_is_switched_off_is_not_touched() {
    let mut bench = Bench::new(BALL);
    bench.contacts = Contacts::default();
    bench.contacts.add_body(1e4, false);
    let pose = bench.step(V::new(0.0, 0.0, -0.002), ToolMode::Touch).pose;
    assert_eq!(bench.proxy(), pose);
    assert!(bench.contacts.springs(0).is_empty());
}

//! Tools against a body that deforms.

use super::*;
use crate::inputs::{ToolInput, ToolMode, ToolShape};
use crate::scene::checked::ToolSpec;
use nalgebra::{Isometry3, Vector3};
use scindo_physics::body::{Body, BodySettings, PcgSettings};
use scindo_physics::cut::BladeSweep;
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::mesh::{BoxPattern, box_mesh};

type V = Vector3<f64>;

const STEP_S: f64 = 0.01;

/// A soft block, 80 x 80 x 40 mm, on a table, its top at z = 0, and one tool.
struct Table {
    body: Body,
    tools: Tools,
    contacts: Contacts,
    positions: Vec<[f32; 3]>,
    steps: u32,
}

impl Table {
    fn new(shape: ToolShape) -> Self {
        let (lower, upper) = (V::new(-0.04, -0.04, -0.04), V::new(0.04, 0.04, 0.0));
        let mesh = box_mesh(lower, upper, [10, 10, 5], BoxPattern::Tet5 { parity: false });
        let bottom: Vec<u32> =
            (0u32..).zip(&mesh.nodes).filter(|(_, x)| x.z < -0.0399).map(|(i, _)| i).collect();
        let material = Material {
            young_pa: 8e3,
            poisson: 0.4,
            density_kg_m3: 1000.0,
            rayleigh: Rayleigh { mass_1_s: 0.5, stiffness_s: 0.01 },
            law: Law::Corotational,
        };
        let solver = PcgSettings { iterations: 100, tolerance: 1e-4 };
        let mut body = Body::new(mesh, material, BodySettings { solver, ..Default::default() }).unwrap();
        body.fix(&bottom, [true; 3], V::zeros()).unwrap();
        let spec = ToolSpec {
            id: "probe".into(),
            shape,
            stiffness_n_m: 400.0,
            max_force_n: 3.0,
            friction: 0.0,
            path: Vec::new(),
            repeat_s: None,
        };
        let mut contacts = Contacts::default();
        contacts.add_body(8e3, true);
        Self { body, tools: Tools::new(&[spec], false), contacts, positions: Vec::new(), steps: 0 }
    }

    /// Makes one whole step and returns the force on the tool.
    fn step(&mut self, pose: Isometry3<f64>, mode: ToolMode) -> V {
        self.steps += 1;
        let sample = ToolInput { mode, seq: u64::from(self.steps), ..ToolInput::new("probe", "test", pose) };
        self.tools.advance(f64::from(self.steps) * STEP_S, &[sample]);
        if let Some((sweep, incision)) = self.tools.take_sweep(0, 0.002) {
            self.body.cut(&sweep, incision).unwrap();
        }
        self.body.surface_positions(&mut self.positions);
        let body = &self.body;
        let surface = (body.surface(), body.rest_positions());
        self.contacts.update_surface(0, body.epoch(), surface, &self.positions).unwrap();
        self.contacts.detect(&self.tools, STEP_S);
        self.body.step(STEP_S, V::zeros(), self.contacts.springs(0));
        self.contacts.collect(0, self.body.spring_forces());
        self.contacts.react(&mut self.tools);
        let on_tool = self.tools.iter().next().unwrap().force_n;
        let on_body: V = self.body.spring_forces().iter().sum();
        assert!((on_tool + on_body).norm() <= 1e-12 * on_body.norm());
        assert!(on_tool.norm() < 3.0 + 1e-6, "{on_tool}");
        assert!(self.body.positions().iter().flatten().all(|x| x.is_finite()));
        on_tool
    }

    fn hand(&self) -> &Hand {
        self.contacts.hand(0).unwrap()
    }

    fn at(&mut self, x: f64, y: f64, z: f64) -> V {
        self.step(Isometry3::translation(x, y, z), ToolMode::Touch)
    }
}

#[test]
fn pressing_builds_up_a_steady_force_that_vanishes_on_release() {
    for radius_m in [0.003, 0.012] {
        let mut table = Table::new(ToolShape::Sphere { radius_m });
        let mut force = V::zeros();
        for i in 0..=50 {
            force = table.at(0.003, 0.002, radius_m + 0.005 - 0.0003 * f64::from(i));
        }
        let mut steady = Vec::new();
        for _ in 0..60 {
            force = table.at(0.003, 0.002, radius_m - 0.01);
            steady.push(force.z);
        }
        // Ten millimetres into 8 kPa: less than the hand's spring, more than a tenth of it.
        assert!(force.z > 0.3 && force.z < 4.0, "{force}");
        // The small ball rests in the dent of a single node, on its slope.
        assert!(radius_m < 0.01 || force.xy().norm() < 0.15 * force.z, "{force}");
        let late = &steady[35..];
        let spread =
            late.iter().fold(f64::MIN, |a, &f| a.max(f)) - late.iter().fold(f64::MAX, |a, &f| a.min(f));
        assert!(spread < 0.02 * force.z, "{spread} of {force}");
        let series = table.hand().in_series_with(400.0);
        assert!(series > 10.0 && series < 400.0, "{series}");
        assert_eq!(table.at(0.003, 0.002, radius_m + 0.02), V::zeros());
    }
}

#[test]
fn a_jab_is_capped_and_forgotten_within_a_second() {
    let mut table = Table::new(ToolShape::Sphere { radius_m: 0.002 });
    let rest = table.body.positions().to_vec();
    table.at(0.0, 0.0, 0.03);
    // 80 mm in one step, to the far side of the block; held there, and out again.
    for _ in 0..5 {
        table.at(0.001, 0.001, -0.05);
        let proxy = table.hand().proxy_pose().translation.z;
        let floor = table.body.positions().iter().map(|x| x.z).fold(f64::MAX, f64::min);
        assert!(proxy > floor + 0.002, "{proxy} {floor}");
    }
    for _ in 0..100 {
        assert_eq!(table.at(0.0, 0.0, 0.05), V::zeros());
    }
    let x = table.body.positions();
    let off = x.iter().zip(&rest).map(|(x, r)| (x - r).norm()).fold(0.0, f64::max);
    assert!(off < 1e-3, "{off}");
}

#[test]
fn an_open_wound_lets_the_tool_in_and_closed_skin_does_not() {
    let mut table = Table::new(ToolShape::Sphere { radius_m: 0.002 });
    assert!(table.at(0.001, 0.0, 0.01) == V::zeros());
    assert!(table.at(0.001, 0.0, -0.01).z > 0.5);
    let mut table = Table::new(ToolShape::Sphere { radius_m: 0.002 });
    let edge = |y: f64| [V::new(0.001, y, -0.03), V::new(0.001, y, 0.01)];
    let sweep = BladeSweep { segments: (0..=20).map(|i| edge(-0.05 + 0.005 * f64::from(i))).collect() };
    table.body.cut(&sweep, 1).unwrap();
    // Pulled open by hand: the halves of the top move apart.
    let opened: Vec<V> = opened_by(&table.body, 0.008);
    let rest = vec![V::zeros(); opened.len()];
    table.body.set_state(&opened, &rest).unwrap();
    let above = Isometry3::translation(0.001, 0.0, 0.01);
    let inside = Isometry3::translation(0.001, 0.0, -0.008);
    for pose in [above, inside] {
        table.body.set_state(&opened, &rest).unwrap();
        let force = table.step(pose, ToolMode::Touch);
        let proxy = *table.hand().proxy_pose();
        assert!((proxy.translation.vector - pose.translation.vector).norm() < 1e-9, "{proxy}");
        assert_eq!(force, V::zeros());
    }
}

/// Positions with the two sides of the cut at x = 1 mm moved apart by `gap` each, more at the top.
fn opened_by(body: &Body, gap: f64) -> Vec<V> {
    let mut x = body.positions().to_vec();
    let mut side = vec![0.0f64; x.len()];
    let surface = body.surface();
    // The normal of a lip triangle tells its side, and its copies move with it.
    for (triangle, _) in surface.triangles.iter().zip(&surface.tags).filter(|(_, tag)| **tag > 0) {
        let [p, q, r] = triangle.map(|v| surface.vertices[v as usize].position(&x));
        let normal = (q - p).cross(&(r - p));
        for v in triangle {
            let vertex = surface.vertices[*v as usize];
            for (copy, w) in vertex.carriers() {
                if w > 0.0 {
                    side[copy] = -normal.x.signum();
                }
            }
        }
    }
    for (x, side) in x.iter_mut().zip(side) {
        let side = if side == 0.0 { (x.x - 0.001).signum() } else { side };
        x.x += side * gap * (1.0 + x.z / 0.04).max(0.0);
    }
    x
}

#[test]
fn a_blade_cuts_what_it_passes_and_feels_nothing() {
    let mut table = Table::new(ToolShape::Blade { length_m: 0.03, thickness_m: 0.0005 });
    let uncut = table.body.n_copies();
    for i in 0..60 {
        let pose = Isometry3::translation(0.001, -0.045 + 0.0015 * f64::from(i), -0.012);
        assert_eq!(table.step(pose, ToolMode::Cut), V::zeros());
    }
    assert!(table.body.n_copies() > uncut + 10);
    let tags: std::collections::BTreeSet<u32> = table.body.surface().tags.iter().copied().collect();
    assert_eq!(tags.into_iter().collect::<Vec<_>>(), [0, 1], "one incision");
}

//! A 1 kHz client on models at 200 Hz of tissue stepped at 50 Hz.

use nalgebra::Translation3;
use scindo_physics::cut::CutMesh;
use scindo_physics::element::MaterialPoint;
use scindo_physics::mesh::{BoxPattern, box_mesh};

use super::*;
use crate::snapshot::{BodySnapshot, SurfaceTopology};

type V = Vector3<f64>;

const BALL: ToolShape = ToolShape::Sphere { radius_m: 0.004 };
/// Hand and tissue [N/m].
const HAND: f64 = 800.0;
const TISSUE: f64 = 500.0;

/// A slab whose top yields like a spring to a tool pressed on it.
struct Tissue {
    vertices: Vec<MaterialPoint>,
    rest: Vec<V>,
    snapshot: Snapshot,
    tip: V,
    force: f64,
}

impl Tissue {
    fn new(contact_stiffness_n_m: f64) -> Self {
        let (lower, upper) = (V::new(-0.06, -0.06, -0.03), V::new(0.06, 0.06, 0.0));
        let mesh = box_mesh(lower, upper, [12, 12, 3], BoxPattern::Tet6);
        let rest = mesh.nodes.clone();
        let body = CutMesh::new(mesh).unwrap();
        let topology = SurfaceTopology {
            epoch: 1,
            vertex_count: body.surface().vertices.len() as u32,
            triangles: body.surface().triangles.clone(),
            tags: body.surface().tags.clone(),
            ..SurfaceTopology::default()
        };
        let mut snapshot = Snapshot::default();
        snapshot.bodies.push(BodySnapshot { topology: Arc::new(topology), ..Default::default() });
        snapshot.tools.push(ToolSnapshot {
            id: Arc::from("probe"),
            shape: BALL,
            mode: ToolMode::Touch,
            stiffness_n_m: HAND,
            contact_stiffness_n_m,
            max_force_n: 8.0,
            ..Default::default()
        });
        let vertices = body.surface().vertices.clone();
        Self { vertices, rest, snapshot, tip: V::zeros(), force: 0.0 }
    }

    /// Force with the tip at height `z`, tissue and hand in series [N].
    fn true_force(z: f64) -> f64 {
        (0.004 - z).max(0.0) / (1.0 / HAND + 1.0 / TISSUE)
    }

    fn step(&mut self, tip: V, dt: f64) {
        let before = self.force;
        self.force = Self::true_force(tip.z);
        let sunk = self.force / TISSUE;
        let speed = (before - self.force) / TISSUE / dt;
        let body = &mut self.snapshot.bodies[0];
        body.positions.clear();
        body.velocities.clear();
        for vertex in &self.vertices {
            let p = vertex.position(&self.rest) - V::z() * sunk;
            body.positions.push([p.x as f32, p.y as f32, p.z as f32]);
            body.velocities.push([0.0, 0.0, speed as f32]);
        }
        let tool = &mut self.snapshot.tools[0];
        tool.pose = pose(tip);
        tool.proxy = pose(V::new(tip.x, tip.y, tip.z.max(0.004 - sunk)));
        tool.velocity_m_s = (tip - self.tip) / dt;
        tool.force_n = V::z() * self.force;
        self.tip = tip;
        self.snapshot.step += 1;
        self.snapshot.time_s += dt;
    }
}

fn pose(tip: V) -> Isometry3<f64> {
    Isometry3::from_parts(Translation3::from(tip), nalgebra::UnitQuaternion::identity())
}

fn query(tip: V, velocity: V, mode: ToolMode) -> ToolQuery {
    ToolQuery { id: Arc::from("probe"), shape: BALL, pose: pose(tip), velocity_m_s: velocity, mode }
}

/// The force that a client renders each millisecond, and the true force.
fn press(contact_stiffness: f64, tip_at: impl Fn(f64) -> V) -> Vec<(V, f64)> {
    let mut tissue = Tissue::new(contact_stiffness);
    let mut models = ContactModels::default();
    let mut felt = Vec::new();
    let mut model = LocalContact::default();
    for ms in 0..1200u32 {
        let t = f64::from(ms) * 1e-3;
        let tip = tip_at(t);
        if ms % 20 == 0 {
            tissue.step(tip_at(t - 0.004), 0.02);
            models.take(&tissue.snapshot, t);
        }
        if ms % 5 == 0 {
            // The pose the server knows is 2 ms old.
            let old = tip_at(t - 0.002);
            let velocity = (tip_at(t) - old) / 0.002;
            model.clone_from(models.evaluate(&query(old, velocity, ToolMode::Touch), t));
        }
        felt.push((model.force_at(tip), Tissue::true_force(tip.z)));
    }
    felt
}

#[test]
fn force_starts_from_zero_and_stays_continuous_while_pressing() {
    let tip_at = |t: f64| {
        let phase = std::f64::consts::TAU * 1.5 * t;
        V::new(0.01 * (0.5 * phase).sin(), 0.002, 0.004 + 0.006 * phase.cos())
    };
    let series = 1.0 / (1.0 / HAND + 1.0 / TISSUE);
    // Known compliance, unknown compliance, and a wrong one.
    for (stiffness, error) in [(series, 0.12), (0.0, 0.3), (0.8 * HAND, 0.8)] {
        let felt = press(stiffness, tip_at);
        let peak = felt.iter().map(|(_, truth)| *truth).fold(0.0, f64::max);
        assert!(peak > 1.5);
        for (i, pair) in felt.windows(2).enumerate() {
            let step = (pair[1].0 - pair[0].0).norm();
            // The step caused by the hand's own motion within a tick, plus the slew limit of a model.
            assert!(step < HAND * 6e-5 + SLEW_N_S * 0.005, "{step} N at {i} ms");
            if pair[0].0 == V::zeros() {
                assert!(step < 0.06, "pop of {step} N at {i} ms");
            }
        }
        for (i, (force, truth)) in felt.iter().enumerate().skip(40) {
            assert!((force.z - truth).abs() < error * peak, "{force} for {truth} at {i} ms");
            assert!(force.xy().norm() < 1e-3, "{force}");
        }
    }
}

#[test]
fn at_the_pose_of_the_step_the_model_tells_the_force_of_the_step() {
    let mut tissue = Tissue::new(300.0);
    let mut models = ContactModels::default();
    let tip = V::new(0.003, 0.001, 0.001);
    tissue.step(V::new(0.003, 0.001, 0.02), 0.02);
    models.take(&tissue.snapshot, 0.0);
    for i in 1..60 {
        tissue.step(tip, 0.02);
        models.take(&tissue.snapshot, 0.02 * f64::from(i));
        let touch = query(tip, V::zeros(), ToolMode::Touch);
        models.evaluate(&touch, 0.02 * f64::from(i));
    }
    let now = 0.02 * 60.0;
    let model = models.evaluate(&query(tip, V::zeros(), ToolMode::Touch), now).clone();
    assert!((model.force_at(tip).z - tissue.force).abs() < 1e-3);
    let deeper = model.force_at(tip - V::z() * 1e-3).z - model.force_at(tip).z;
    assert!((deeper - 0.3).abs() < 1e-6);
    assert_eq!(model.mode, ContactMode::Contact);
    assert_eq!((model.body, model.epoch), (Some(0), 1));
    // The feature keeps its number while the tool slides.
    let feature = model.planes[0].feature_id;
    for i in 1..20 {
        let aside = tip + V::x() * 1e-4 * f64::from(i);
        let slid = models.evaluate(&query(aside, V::zeros(), ToolMode::Touch), now + 0.005);
        assert_eq!(slid.planes[0].feature_id, feature);
    }
}

#[test]
fn hover_and_cut_are_free_and_what_was_felt_fades() {
    let mut tissue = Tissue::new(300.0);
    let mut models = ContactModels::default();
    let tip = V::new(0.0, 0.0, 0.0);
    let mut now = 0.0;
    for _ in 0..100 {
        tissue.step(tip, 0.02);
        models.take(&tissue.snapshot, now);
        now += 0.02;
        models.evaluate(&query(tip, V::zeros(), ToolMode::Touch), now);
    }
    let mut force = models.evaluate(&query(tip, V::zeros(), ToolMode::Touch), now).force_at(tip).z;
    assert!(force > 1.0);
    for _ in 0..50 {
        now += 0.005;
        let faded = models.evaluate(&query(tip, V::zeros(), ToolMode::Hover), now).force_at(tip).z;
        assert!(faded <= force + 1e-12 && faded > force - 0.26);
        force = faded;
    }
    assert_eq!(force, 0.0);
    let free = models.evaluate(&query(tip, V::zeros(), ToolMode::Hover), now);
    assert_eq!((free.mode, free.planes.len()), (ContactMode::Free, 0));
}

#[test]
fn a_pose_that_is_not_finite_is_refused_and_counted() {
    let mut tissue = Tissue::new(300.0);
    let mut models = ContactModels::default();
    tissue.step(V::new(0.0, 0.0, 0.003), 0.02);
    models.take(&tissue.snapshot, 0.0);
    let good = models.evaluate(&query(V::zeros(), V::zeros(), ToolMode::Touch), 0.01).clone();
    let bad = query(V::new(f64::NAN, 0.0, 0.0), V::zeros(), ToolMode::Touch);
    let answer = models.evaluate(&bad, 0.02).clone();
    assert_eq!(answer.pose_used, good.pose_used);
    assert_eq!(models.refused_poses(), 1);
    assert!(answer.force_at(V::zeros()).iter().all(|f| f.is_finite()));
}

#[test]
fn held_tissue_pulls_back() {
    let mut tissue = Tissue::new(300.0);
    let mut models = ContactModels::default();
    tissue.step(V::zeros(), 0.02);
    tissue.snapshot.tools[0].mode = ToolMode::Grab;
    tissue.snapshot.tools[0].force_n = V::new(0.0, 0.0, -0.2);
    let mut now = 0.0;
    for _ in 0..100 {
        now += 0.005;
        models.take(&tissue.snapshot, now);
        models.evaluate(&query(V::z() * 1e-3, V::zeros(), ToolMode::Grab), now);
    }
    let model = models.evaluate(&query(V::z() * 1e-3, V::zeros(), ToolMode::Grab), now);
    assert_eq!(model.mode, ContactMode::Hold);
    assert!((model.force_at(V::z() * 1e-3) - V::z() * -0.5).norm() < 1e-6);
}

/// A blade that cuts with force: the plane resists by what the hand moves on, up to the force at which it cuts.
#[test]
fn the_resistance_of_a_cut_is_bounded_and_given_back_by_no_one() {
    let mut tissue = Tissue::new(1000.0);
    tissue.step(V::zeros(), 0.02);
    let blade = ToolShape::Blade { length_m: 0.03, thickness_m: 0.001 };
    let tool = &mut tissue.snapshot.tools[0];
    (tool.shape, tool.mode, tool.force_n) = (blade, ToolMode::Cut, V::new(0.0, 0.0, 2.0));
    (tool.contact_stiffness_n_m, tool.resistance_n) = (1000.0, 3.0);
    let ask = |snapshot: &Snapshot, z: f64| {
        let mut models = ContactModels::default();
        models.take(snapshot, 0.0);
        let asked = ToolQuery { shape: blade, ..query(V::new(0.0, 0.0, z), V::zeros(), ToolMode::Cut) };
        models.evaluate(&asked, 0.0).clone()
    };
    for (z, expected) in [(0.0, 2.0), (-0.0005, 2.5), (-0.002, 3.0), (0.001, 1.0), (0.003, 0.0)] {
        let model = ask(&tissue.snapshot, z);
        assert_eq!(model.mode, ContactMode::Cutting);
        assert_eq!(model.max_force_n, 3.0);
        // Without the plane that hides the change from no contact to this one.
        let force = model.planes[0].force_at(V::zeros());
        assert!((force - V::new(0.0, 0.0, expected)).norm() < 1e-12, "{force:?} at {z}");
    }
    tissue.snapshot.tools[0].resistance_n = 0.0;
    assert!(ask(&tissue.snapshot, 0.0).planes.is_empty(), "a free blade");
}

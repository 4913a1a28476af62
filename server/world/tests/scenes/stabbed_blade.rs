//! A blade that the mouse stabs in along its own length and then draws aside cuts on against the toughness, whichever
//! way it goes.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use scindo_collision::{CapsuleMotion, SurfaceBvh};
use scindo_world::inputs::{Inputs, ToolInput, ToolMode, ToolShape};
use scindo_world::simulation::Simulation;

use crate::start;

type V = Vector3<f64>;

/// Time of a step, and of a picture of the page, each of which sends a pose [s].
const STEP_S: f64 = 0.02;
const PICTURE_S: f64 = 1.0 / 60.0;
/// Time in which a press enters the tissue [s], and the largest depth of the blade below the skin [m].
const PRESS_S: f64 = 0.14;
const DEPTH_M: f64 = 0.0105;
const TOUGHNESS: f64 = 50.0;

/// An upright sheet 4 mm thick with a slit from its upper edge.
fn sheet() -> Simulation {
    let text = format!(
        r#"
        schema = 1
        [world]
        gravity_m_s2 = [0, 0, 0]
        step_s = {STEP_S}
        [[body]]
        id = "sheet"
        mesh = {{ box = {{ min_m = [-0.002, -0.04, 0], max_m = [0.002, 0.04, 0.05], cells = [2, 24, 15] }} }}
        young_pa = 80e3
        poisson = 0.42
        density_kg_m3 = 1050
        rayleigh = {{ mass_1_s = 1.0, stiffness_s = 0.004 }}
        cutting = {{ toughness_j_m2 = {TOUGHNESS:?} }}
        [[body.fix]]
        where = {{ slab = {{ axis = "z", from = 0, to = 0.05 }} }}
        [[cut]]
        body = "sheet"
        sweep_m = [[[-0.01, 0.0005, 0.06], [0.01, 0.0005, 0.06]], [[-0.01, 0.0005, 0.03], [0.01, 0.0005, 0.03]]]
        "#
    );
    start(&text)
}

/// The page's hand: the blade lies along the line of sight and follows the skin under the cursor.
struct Mouse {
    eye: V,
    /// Distance of the skin last seen under the blade, and time since the button went down.
    reach_m: f64,
    pressed_s: f64,
    seq: u64,
}

impl Mouse {
    fn sight(&self, cursor: V) -> V {
        (cursor - self.eye).normalize()
    }

    /// Distance of what the cursor points at, and whether it is skin.
    fn hit(&self, sim: &Simulation, cursor: V) -> Option<(f64, bool)> {
        let body = &sim.bodies()[0].body;
        let surface = body.surface();
        let place = |p: V| p.map(|x| x as f32).into();
        let positions: Vec<[f32; 3]> =
            surface.vertices.iter().map(|v| place(v.position(body.positions()))).collect();
        let tree = SurfaceBvh::new(&positions, &surface.triangles).unwrap();
        let way = 0.3 * self.sight(cursor);
        let ray = CapsuleMotion { start: [self.eye; 2], end: [self.eye + way; 2], radius: 0.0 };
        let impact = tree.sweep_moving(&ray)?;
        let corners = tree.triangle(impact.triangle);
        let on: V = corners.iter().zip(impact.barycentric).map(|(p, w)| p * w).sum();
        Some(((on - self.eye).norm(), surface.tags[impact.triangle as usize] == 0))
    }

    /// The pose that the next picture sends.
    fn picture(&mut self, sim: &Simulation, cursor: V) -> Isometry3<f64> {
        if let Some((reach_m, true)) = self.hit(sim, cursor) {
            self.reach_m += 0.5 * (reach_m - self.reach_m);
        }
        let part = (self.pressed_s / PRESS_S).min(1.0);
        self.pressed_s += PICTURE_S;
        let sight = self.sight(cursor);
        let tip = self.eye + (self.reach_m + DEPTH_M * part * (2.0 - part)) * sight;
        let turn = UnitQuaternion::rotation_between(&V::z(), &-sight).unwrap();
        Isometry3::from_parts(Translation3::from(tip), turn)
    }

    fn sample(&mut self, poses: &[Isometry3<f64>], mode: ToolMode) -> ToolInput {
        self.seq += 1;
        let (last, passed) = poses.split_last().unwrap();
        ToolInput {
            passed: passed.to_vec(),
            mode,
            shape: Some(ToolShape::Blade { length_m: 0.0425, thickness_m: 0.0002 }),
            seq: self.seq,
            ..ToolInput::new("blade", "page", *last)
        }
    }
}

/// Area [m²] that a drag over `ways` opens, the first of which is where the button goes down. Pictures come in bursts of
/// `burst`.
fn drag(eye: V, ways: &[V], burst: usize) -> f64 {
    let mut sim = sheet();
    let mut mouse = Mouse { eye, reach_m: 0.0, pressed_s: 0.0, seq: 0 };
    let hover = |mouse: &mut Mouse, sim: &Simulation| {
        mouse.reach_m = mouse.hit(sim, ways[0]).unwrap().0;
        let sight = mouse.sight(ways[0]);
        let turn = UnitQuaternion::rotation_between(&V::z(), &-sight).unwrap();
        Isometry3::from_parts(Translation3::from(mouse.eye + (mouse.reach_m - 0.0025) * sight), turn)
    };
    let (mut time_s, mut pictures, mut cursors) = (0.0, 0, vec![ways[0]; 18]);
    // 14 small ones per 10 mm, and four pictures each.
    for pair in ways.windows(2) {
        let steps = ((pair[1] - pair[0]).norm() / 0.0007).ceil() as usize;
        let each = (1..=steps).map(|i| pair[0] + (pair[1] - pair[0]) * (i as f64 / steps as f64));
        cursors.extend(each.flat_map(|at| [at; 4]));
    }
    let mut last = hover(&mut mouse, &sim);
    for _ in 0..3 {
        let tools = vec![mouse.sample(&[last], ToolMode::Hover)];
        sim.step(&Inputs { tools, ..Inputs::default() });
    }
    while pictures < cursors.len() {
        time_s += STEP_S;
        let mut poses = Vec::new();
        while pictures < cursors.len() && ((pictures / burst * burst + burst) as f64) * PICTURE_S <= time_s {
            for _ in 0..burst.min(cursors.len() - pictures) {
                poses.push(mouse.picture(&sim, cursors[pictures]));
                pictures += 1;
            }
        }
        last = *poses.last().unwrap_or(&last);
        if poses.is_empty() {
            poses.push(last);
        }
        let tools = vec![mouse.sample(&poses, ToolMode::Cut)];
        sim.step(&Inputs { tools, ..Inputs::default() });
    }
    opened(&sim)
}

fn opened(sim: &Simulation) -> f64 {
    let body = &sim.bodies()[0].body;
    (2..20).map(|incision| body.opened_area(incision)).sum()
}

#[test]
fn it_cuts_on_to_every_side() {
    let eye = V::new(0.16, -0.03, 0.045);
    let start = V::new(0.002, 0.001, 0.012);
    for (what, way, burst) in [
        ("left", V::new(0.0, -0.012, 0.0), 3),
        ("right", V::new(0.0, 0.012, 0.0), 1),
        ("up", V::new(0.0, 0.0, 0.012), 1),
        ("down", V::new(0.0, 0.0, -0.010), 3),
    ] {
        let area = drag(eye, &[start, start + way], burst);
        let whole = 0.004 * way.norm();
        // The edge lags 3 mm behind the hand, and the element in which it is has not opened.
        assert!(area > 0.35 * whole, "{what}, bursts of {burst}: {area} of {whole} m²");
    }
}

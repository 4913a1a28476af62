//! Cuts that are taken back: the surface of before, the momentum of now, and no more than was cut.

use std::sync::Arc;

use nalgebra::Vector3;
use scindo_tests::scene;
use scindo_world::inputs::{CutRequest, Inputs};
use scindo_world::simulation::{MAX_UNDO, Simulation};

use crate::{run, start};

/// A block that flies and turns, so that there is momentum to be kept.
fn block(how: &str) -> Simulation {
    block_with(how, "[world]\n", "")
}

fn block_with(how: &str, world: &str, more: &str) -> Simulation {
    let keys = format!(
        "{how}\nyoung_pa = 1e4\npoisson = 0.3\nsolver = {{ tolerance = 1e-5 }}\n\
         rayleigh = {{ stiffness_s = 0.01 }}\n{more}"
    );
    let block = scene::block("block", [[0.0; 3], [0.08, 0.04, 0.04]], [8, 4, 4], &keys);
    start(&format!("schema = 1\n{world}step_s = 0.01\n{block}"))
}

const SNAP: &str = "cutting = { method = \"snap\" }";
/// A force [N] on the end of a block, upwards.
const PUSHED: &str =
    "load = [{ where = { slab = { axis = \"x\", from = 1, to = 1 } }, force_n = [0, 0, 0.02] }]";
const GENERAL: &str = "law = \"neo-hookean\"";
const QUADRATIC: &str = "element = \"tet10\"";

/// Half through the block at `x`, where it is now.
fn cut(sim: &mut Simulation, number: u64, x: f64) {
    let middle = sim.bodies()[0].body.centre_of_mass() - Vector3::new(0.04, 0.02, 0.02);
    let at = |y: f64| [middle + Vector3::new(x, y, -0.01), middle + Vector3::new(x, y, 0.025)];
    let request = CutRequest {
        request: number,
        tool: Arc::from(format!("tool-{number}")),
        body: None,
        segments: vec![at(-0.01), at(0.05)],
    };
    let report = sim.step(&Inputs { cuts: vec![request], ..Inputs::default() });
    assert!(*report.cuts[0].result.as_ref().unwrap() > 0, "{report:?}");
}

/// Largest distance between points of the same number [m].
fn furthest(a: &[Vector3<f64>], b: &[Vector3<f64>]) -> f64 {
    a.iter().zip(b).map(|(x, y)| (x - y).norm()).fold(0.0, f64::max)
}

fn surface(sim: &Simulation) -> (Vec<[u32; 3]>, Vec<u32>) {
    let surface = sim.bodies()[0].body.surface();
    (surface.triangles.clone(), surface.tags.clone())
}

#[test]
fn a_cut_that_is_taken_back_leaves_the_surface_the_mass_and_the_momentum() {
    for how in ["", "skin = { divisions = 2 }", SNAP, GENERAL, QUADRATIC] {
        // Pushed at one end, it flies and turns.
        let mut sim = block(&format!("{how}\n{PUSHED}"));
        run(&mut sim, 10);
        let (whole, epoch, mass) =
            (surface(&sim), sim.bodies()[0].epoch(), sim.bodies()[0].body.total_mass());
        cut(&mut sim, 1, 0.0337);
        run(&mut sim, 15);
        let once = surface(&sim);
        assert_ne!(once, whole, "{how}");
        cut(&mut sim, 2, 0.0552);
        run(&mut sim, 5);
        let body = &sim.bodies()[0].body;
        let (p, c) = (body.momentum(), body.centre_of_mass());
        assert!(p.norm() > 1e-3 && body.angular_momentum().norm() > 1e-4, "{how}: {p}");
        for left in [once, whole] {
            sim.undo().unwrap();
            let body = &sim.bodies()[0].body;
            assert_eq!(surface(&sim), left, "{how}");
            assert!((body.total_mass() / mass - 1.0).abs() < 1e-12, "{how}");
            assert!((body.momentum() - p).norm() < 1e-9 * p.norm(), "{how}: {} from {p}", body.momentum());
            assert!((body.centre_of_mass() - c).norm() < 1e-12, "{how}");
        }
        assert!(sim.bodies()[0].epoch() > epoch + 2, "{how}");
        assert!(sim.undo().unwrap_err().contains("no cut to undo"));
        run(&mut sim, 40);
        let body = &sim.bodies()[0].body;
        assert!(body.least_volume_ratio() > 0.5, "{how}: {}", body.least_volume_ratio());
        cut(&mut sim, 3, 0.0337);
        assert_eq!(sim.undo().unwrap().left, 0);
    }
}

#[test]
fn the_last_cuts_are_kept_and_no_more() {
    let mut sim = block("");
    assert_eq!(sim.undo().unwrap_err(), "there is no cut to undo");
    for number in 1..=MAX_UNDO as u64 + 2 {
        cut(&mut sim, number, 0.005 + 0.0067 * number as f64);
    }
    for left in (0..MAX_UNDO).rev() {
        assert_eq!(sim.undo().unwrap().left, left);
    }
    assert!(sim.undo().unwrap_err().contains("the last 8 are kept"));
    cut(&mut sim, 20, 0.0337);
    sim.reset().unwrap();
    assert_eq!(sim.undo().unwrap_err(), "there is no cut to undo");
}

#[test]
fn a_cut_in_the_air_is_none_and_a_scratch_is_one() {
    let mut sim = block("");
    let request = |number, z: f64| {
        let at = |y: f64| [Vector3::new(0.0337, y, z), Vector3::new(0.0337, y, z + 0.03)];
        CutRequest { request: number, tool: Arc::from("t"), body: None, segments: vec![at(0.006), at(0.033)] }
    };
    sim.step(&Inputs { cuts: vec![request(1, 0.06)], ..Inputs::default() });
    assert!(sim.undo().is_err(), "nothing was touched");
    sim.step(&Inputs { cuts: vec![request(2, 0.038)], ..Inputs::default() });
    assert!(!sim.bodies()[0].body.incision_marks().is_empty());
    sim.undo().unwrap();
    assert!(sim.bodies()[0].body.incision_marks().is_empty());
}

#[test]
fn a_part_that_was_cut_off_and_fell_comes_back() {
    for how in ["", SNAP, QUADRATIC] {
        let held = "[world]\ngravity_m_s2 = [0, 0, -9.81]\n";
        let fix = "[[body.fix]]\nwhere = { slab = { axis = \"x\", from = 0, to = 0 } }\n";
        let mut sim = block_with(how, held, fix);
        run(&mut sim, 20);
        let whole = surface(&sim);
        let at = |y: f64| [Vector3::new(0.0552, y, -0.05), Vector3::new(0.0552, y, 0.09)];
        let segments = vec![at(-0.02), at(0.06)];
        let cut = CutRequest { request: 1, tool: Arc::from("t"), body: None, segments };
        sim.step(&Inputs { cuts: vec![cut], ..Inputs::default() });
        assert_eq!(sim.bodies()[0].body.parts().len(), 2, "{how}");
        run(&mut sim, 60);
        let fallen = sim.bodies()[0].body.positions().iter().map(|x| x.z).fold(0.0, f64::min);
        assert!(fallen < -0.5, "{how}: {fallen}");
        sim.undo().unwrap();
        run(&mut sim, 1);
        assert_eq!(surface(&sim), whole);
        let rest = sim.bodies()[0].body.rest_positions().to_vec();
        let sag = |sim: &Simulation| furthest(sim.bodies()[0].body.positions(), &rest);
        let back = sag(&sim);
        // A body that was never cut, for as long: it swings and comes to rest, and so does the one that was
        // joined again.
        let mut uncut = block_with(how, held, fix);
        let mut swings: f64 = 0.0;
        for _ in 0..182 {
            run(&mut uncut, 1);
            swings = swings.max(sag(&uncut));
        }
        assert!(back <= swings, "{how}: {back} m from its rest shape, and never more than {swings} m uncut");
        run(&mut sim, 100);
        let hangs = sag(&uncut);
        let off = furthest(sim.bodies()[0].body.positions(), uncut.bodies()[0].body.positions());
        assert!(
            off < 0.01 * hangs,
            "{how}: {off} m from where it hangs uncut, {hangs} m below its rest shape"
        );
    }
}

//! Case 26: input without meaning.

use std::path::Path;
use std::sync::Arc;

use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use scindo_physics::body::{Body, Outcome, PointSpring, SpringKind};
use scindo_physics::cut::BladeSweep;
use scindo_physics::element::MaterialPoint;
use scindo_physics::material::Material;
use scindo_physics::mesh::TetMesh;
use scindo_world::format::read_mesh_bytes;
use scindo_world::inputs::{CutRequest, Inputs, ToolInput, ToolMode, ToolShape};
use scindo_world::scene::Scene;
use scindo_world::simulation::Simulation;

use super::support::{DOWN, L, SOFT, V, clamp_left, cube, plane};
use crate::lab::Trouble;
use crate::stress::case::{Case, Setting};
use crate::stress::evidence::Evidence;

/// Case 26.
pub(super) const CASE: Case = Case {
    number: Some(26),
    name: "bad-input",
    title: "NaN, infinity, denormal and absurd numbers",
    set_up: "NaN, ±∞, 1e300 and the smallest denormal number, in: steps, gravity, springs, forces, \
             displacements, states, blades, materials, meshes, mesh files, scene files, tool poses and cuts of \
             clients.",
    rule: "Invalid requests are refused with an error, and the body or simulation stays as it was, bit for bit. \
           Valid requests are carried out. Every number stays finite.",
    source: "own",
    quick: true,
    run,
};

const BAD: [f64; 4] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300];
const TINY: f64 = 5e-324;

fn bits(body: &Body) -> Vec<u64> {
    let state = body.positions().iter().chain(body.velocities());
    state.flat_map(|v| v.iter().map(|c| c.to_bits())).chain([u64::from(body.epoch())]).collect()
}

fn is_finite(body: &Body) -> bool {
    body.positions().iter().chain(body.velocities()).all(|v| v.iter().all(|c| c.is_finite()))
}

/// Requests that were refused, that were carried out, or that changed the body or made it non-finite.
#[derive(Default)]
struct Tally {
    refused: usize,
    accepted: Vec<String>,
    changed: Vec<String>,
    not_finite: Vec<String>,
}

impl Tally {
    /// Makes a request that must be refused and must leave the body as it is.
    fn refuse(&mut self, what: &str, body: &mut Body, ask: impl FnOnce(&mut Body) -> bool) {
        let before = bits(body);
        if ask(body) {
            self.accepted.push(what.to_owned());
        } else {
            self.refused += 1;
        }
        if bits(body) != before {
            self.changed.push(what.to_owned());
        }
        if !is_finite(body) {
            self.not_finite.push(what.to_owned());
        }
    }

    /// Makes a request without a body that must be refused.
    fn expect(&mut self, what: &str, refused: bool) {
        if refused {
            self.refused += 1;
        } else {
            self.accepted.push(what.to_owned());
        }
    }
}

fn run(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let mut tally = Tally::default();
    let mut body = setting.body(cube(3), SOFT, 100, 1e-5)?;
    clamp_left(&mut body)?;
    body.cut(&plane(V::repeat(0.5 * L), V::x(), L), 1)?;
    for _ in 0..5 {
        body.step(0.01, DOWN, &[]);
    }
    of_the_body(&mut tally, &mut body);
    of_materials_and_meshes(setting, &mut tally);
    of_files_and_scenes(&mut tally);
    of_clients(&mut tally)?;
    // Tiny numbers are valid: almost nothing happens.
    let before = body.positions().to_vec();
    body.add_nodal_force(5, V::repeat(TINY))?;
    let step = body.step(TINY, V::repeat(TINY), &[]);
    let moved = before.iter().zip(body.positions()).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    if !is_finite(&body) {
        tally.not_finite.push("a step of 5e-324 s".into());
    }
    evidence.tell(
        "outcome of a step of 5e-324 s: advanced",
        f64::from(u8::from(step.outcome == Outcome::Advanced)),
        "",
    );
    evidence.at_most("way of a step of 5e-324 s", moved, 1e-9, "m");
    evidence.at_least("requests refused", tally.refused as f64, 60.0, "");
    evidence.exactly("invalid requests that were carried out", tally.accepted.len(), 0);
    evidence.exactly("requests that were refused and changed something", tally.changed.len(), 0);
    evidence.exactly("requests after which a number was not finite", tally.not_finite.len(), 0);
    for (what, list) in
        [("Carried out", &tally.accepted), ("Changed", &tally.changed), ("Not finite", &tally.not_finite)]
    {
        if !list.is_empty() {
            evidence.notes.push(format!("{what}: {}.", list.join("; ")));
        }
    }
    // The body still works afterwards.
    let end = body.step(0.01, DOWN, &[]);
    evidence.exactly("steps that fail afterwards", usize::from(end.outcome != Outcome::Advanced), 0);
    Ok(evidence)
}

fn of_the_body(tally: &mut Tally, body: &mut Body) {
    for bad in BAD {
        let advances = |outcome: Outcome| outcome == Outcome::Advanced;
        // 1e300 s is a finite number but an impossible step: the body is held, at rest, where it was.
        if !bad.is_finite() {
            tally.refuse(&format!("a step of {bad} s"), body, |b| advances(b.step(bad, DOWN, &[]).outcome));
        }
        tally.refuse(&format!("gravity {bad}"), body, |b| {
            advances(b.step(0.01, V::new(0.0, bad, 0.0), &[]).outcome)
        });
        tally.refuse(&format!("force {bad}"), body, |b| b.add_nodal_force(3, V::new(bad, 0.0, 0.0)).is_ok());
        tally.refuse(&format!("surface force {bad}"), body, |b| {
            b.add_surface_force(&[0, 1, 2, 3], V::repeat(bad)).is_ok()
        });
        tally.refuse(&format!("volume force {bad}"), body, |b| {
            b.add_volume_force(&[0, 1], V::repeat(bad)).is_ok()
        });
        tally
            .refuse(&format!("displacement {bad}"), body, |b| b.fix(&[7], [true; 3], V::repeat(bad)).is_ok());
        tally.refuse(&format!("position {bad}"), body, |b| {
            let mut x = b.positions().to_vec();
            x[4].y = bad;
            let v = b.velocities().to_vec();
            b.set_state(&x, &v).is_ok()
        });
        tally.refuse(&format!("velocity {bad}"), body, |b| {
            let x = b.positions().to_vec();
            let mut v = b.velocities().to_vec();
            v[4].z = bad;
            b.set_state(&x, &v).is_ok()
        });
        if !bad.is_finite() {
            tally.refuse(&format!("blade at {bad}"), body, |b| {
                let blade = [[V::new(0.05, bad, 0.0), V::repeat(L)], [V::zeros(), V::x()]];
                b.cut(&BladeSweep { segments: blade.to_vec() }, 9).is_ok()
            });
        }
        // An invalid spring is left out of the step and counted.
        let target_m = V::new(0.0, bad, 0.0);
        let spring = PointSpring {
            point: MaterialPoint::in_tet([0, 1, 2, 3], [0.25; 4]),
            kind: SpringKind::Hold { target_m },
            stiffness_n_m: 100.0,
            max_force_n: 1.0,
        };
        if !bad.is_finite() {
            let left_out = body.step(0.001, DOWN, &[spring]).refused_springs == 1;
            tally.expect(&format!("spring to {bad}"), left_out && is_finite(body));
        }
    }
    let n = body.rest_positions().len() as u32;
    tally.refuse("a node that is not there", body, |b| b.add_nodal_force(n + 9, V::x()).is_ok());
    tally.refuse("no blade", body, |b| b.cut(&BladeSweep::default(), 9).is_ok());
    tally.refuse("incision 0", body, |b| b.cut(&plane(V::zeros(), V::x(), L), 0).is_ok());
    tally.refuse("a state too short", body, |b| b.set_state(&[V::zeros()], &[V::zeros()]).is_ok());
}

fn of_materials_and_meshes(setting: &Setting, tally: &mut Tally) {
    for bad in BAD.into_iter().chain([TINY, -1.0]) {
        let materials = [
            ("young_pa", Material { young_pa: bad, ..SOFT }),
            ("density_kg_m3", Material { density_kg_m3: bad, ..SOFT }),
        ];
        for (what, material) in materials {
            tally.expect(&format!("{what} {bad}"), setting.body(cube(1), material, 10, 1e-3).is_err());
        }
        let mut mesh = cube(1);
        if !(bad.is_finite() && bad.abs() < 2.0) {
            mesh.nodes[3].x = bad;
            tally.expect(&format!("node at {bad}"), setting.body(mesh, SOFT, 10, 1e-3).is_err());
        }
    }
    for poisson in [f64::NAN, 0.5, -1.0, f64::INFINITY] {
        let refused = setting.body(cube(1), Material { poisson, ..SOFT }, 10, 1e-3).is_err();
        tally.expect(&format!("poisson {poisson}"), refused);
    }
    let flat = TetMesh { nodes: vec![V::zeros(), V::x(), V::y(), V::x() + V::y()], tets: vec![[0, 1, 2, 3]] };
    tally.expect("a flat element", setting.body(flat, SOFT, 10, 1e-3).is_err());
    let missing = TetMesh { nodes: vec![V::zeros(), V::x(), V::y(), V::z()], tets: vec![[0, 1, 2, 4]] };
    tally.expect("an element with a node that is not there", setting.body(missing, SOFT, 10, 1e-3).is_err());
}

const SCENE: &str = r#"
schema = 1
name = "block"
[world]
gravity_m_s2 = [0.0, -9.81, 0.0]
step_s = 0.01
[[body]]
id = "block"
mesh = { box = { min_m = [0, 0, 0], max_m = [0.1, 0.1, 0.1], cells = [3, 3, 3], pattern = "tet6" } }
young_pa = 1e5
poisson = 0.3
density_kg_m3 = 1000
[[body.fix]]
where = { box = { min_m = [-1, -1, -1], max_m = [1, 0.001, 1] } }
"#;

fn of_files_and_scenes(tally: &mut Tally) {
    for bad in ["nan", "inf", "-inf", "1e300"] {
        for (key, value) in [
            ("young_pa = 1e5", "young_pa"),
            ("density_kg_m3 = 1000", "density_kg_m3"),
            ("step_s = 0.01", "step_s"),
        ] {
            let text = SCENE.replace(key, &format!("{value} = {bad}"));
            tally.expect(&format!("scene with {value} = {bad}"), Scene::from_toml(&text).is_err());
        }
        let text = SCENE.replace("-9.81", bad);
        if bad != "1e300" {
            tally.expect(&format!("scene with gravity {bad}"), Scene::from_toml(&text).is_err());
        }
        let vtk = format!(
            "# vtk DataFile Version 2.0\nx\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 double\n0 0 0\n{bad} 0 0\n0 1 0\n0 0 1\nCELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n10\n"
        );
        let obj = format!("v 0 0 0\nv {bad} 0 0\nv 0 1 0\nf 1 2 3\n");
        for (name, text) in [("tet.vtk", vtk), ("face.obj", obj)] {
            // 1e300 is a finite number. A mesh scaled by it is refused later, when a body is made of it.
            if bad != "1e300" {
                let read = read_mesh_bytes(name, text.as_bytes());
                tally.expect(&format!("{name} with a node at {bad}"), read.is_err());
            }
        }
    }
}

/// Poses and cuts of clients: the simulation goes on as if they had not arrived.
fn of_clients(tally: &mut Tally) -> Result<(), Trouble> {
    let scene = Scene::from_toml(SCENE)?;
    let mut plain = Simulation::new(&scene, Path::new("."))?;
    for _ in 0..20 {
        plain.step(&Inputs::default());
    }
    for bad in BAD {
        let tip = V::new(0.05, bad, 0.05);
        let pose = Isometry3::from_parts(Translation3::from(tip), UnitQuaternion::identity());
        let tool = |mode: ToolMode| ToolInput {
            id: Arc::from("probe"),
            owner: Arc::from("client"),
            pose,
            passed: Vec::new(),
            velocity_m_s: V::repeat(bad),
            mode,
            closed: None,
            shape: Some(ToolShape::Sphere { radius_m: 0.01 }),
            seq: 1,
            client_time_ns: 0,
        };
        let request = CutRequest {
            request: 1,
            tool: Arc::from("blade"),
            body: None,
            segments: vec![[tip, V::zeros()], [V::x(), tip]],
        };
        for mode in [ToolMode::Touch, ToolMode::Grab, ToolMode::Cut] {
            let mut simulation = Simulation::new(&scene, Path::new("."))?;
            let mut refused = true;
            for _ in 0..20 {
                let cuts = if bad.is_finite() { Vec::new() } else { vec![request.clone()] };
                let asked = cuts.len();
                let inputs = Inputs { tools: vec![tool(mode)], cuts, ..Inputs::default() };
                let report = simulation.step(&inputs);
                refused &= report.cuts.iter().filter(|cut| cut.result.is_err()).count() == asked;
            }
            let same = bits(&simulation.bodies()[0].body) == bits(&plain.bodies()[0].body);
            let what = format!("tool pose {bad}, {mode:?}");
            tally.expect(&what, refused && same);
            if !is_finite(&simulation.bodies()[0].body) {
                tally.not_finite.push(what);
            }
        }
    }
    Ok(())
}

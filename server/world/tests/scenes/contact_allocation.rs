//! Detection and local contact models do not allocate while topologies and tools stay the same.

use std::sync::Arc;
use std::time::Instant;

use nalgebra::{Isometry3, Vector3};
use scindo_allocations::allocations;
use scindo_physics::cut::CutMesh;
use scindo_physics::mesh::{BoxPattern, box_mesh};
use scindo_world::contact::Contacts;
use scindo_world::contact::model::{ContactModels, ToolQuery};
use scindo_world::inputs::{ToolInput, ToolMode, ToolShape};
use scindo_world::scene::checked::ToolSpec;
use scindo_world::snapshot::{BodySnapshot, Snapshot, SurfaceTopology, ToolSnapshot};
use scindo_world::tool::Tools;

type V = Vector3<f64>;

const ROD: ToolShape = ToolShape::Capsule { radius_m: 0.003, length_m: 0.03 };
const BALL: ToolShape = ToolShape::Sphere { radius_m: 0.004 };
const JAWS: ToolShape = ToolShape::Forceps {
    radius_m: 0.002,
    length_m: 0.05,
    opening_m: 0.008,
    grip_force_n: 1.0,
    friction: 0.5,
};
const HOOK: ToolShape = ToolShape::Hook { radius_m: 0.002, length_m: 0.05, reach_m: 0.01, point_m: 0.006 };

/// Where tool `i` is in round `round`: pressed in and moving along.
fn pose(i: usize, round: usize) -> Isometry3<f64> {
    let x = 0.02 * i as f64 - 0.01 + 0.0004 * round as f64;
    Isometry3::translation(x, 0.003, 0.004 - 0.0003 * (round % 12) as f64)
}

fn waving(rest: &[V], round: usize) -> Vec<V> {
    let wave = |x: &V| x + V::z() * 0.001 * (40.0 * x.x + 0.3 * round as f64).sin();
    rest.iter().map(wave).collect()
}

#[test]
fn steady_contact_does_not_allocate() {
    let (lower, upper) = (V::new(-0.06, -0.06, -0.03), V::new(0.06, 0.06, 0.0));
    let mesh = box_mesh(lower, upper, [48, 48, 12], BoxPattern::Tet6);
    let rest = mesh.nodes.clone();
    let body = CutMesh::new(mesh).unwrap();
    let surface = body.surface();
    let rounds: Vec<Vec<[f32; 3]>> = (0..24)
        .map(|round| {
            let x = waving(&rest, round);
            let at = |v: V| [v.x as f32, v.y as f32, v.z as f32];
            surface.vertices.iter().map(|vertex| at(vertex.position(&x))).collect()
        })
        .collect();

    let spec = |id: &str, shape| ToolSpec {
        id: id.into(),
        shape,
        stiffness_n_m: 500.0,
        max_force_n: 5.0,
        friction: 0.0,
        path: Vec::new(),
        repeat_s: None,
    };
    let specs =
        [spec("rod", ROD), spec("ball", BALL), spec("grip", BALL), spec("jaws", JAWS), spec("hook", HOOK)];
    let modes = [ToolMode::Touch, ToolMode::Touch, ToolMode::Grab, ToolMode::Grab, ToolMode::Touch];
    let mut tools = Tools::new(&specs, false);
    let mut contacts = Contacts::default();
    contacts.add_body(1e4, true);
    let mut inputs: Vec<ToolInput> = specs
        .iter()
        .zip(modes)
        .map(|(spec, mode)| ToolInput {
            mode,
            ..ToolInput::new(spec.id.as_str(), "test", Isometry3::identity())
        })
        .collect();
    let forces = vec![V::z() * -0.01; 256];

    let mut snapshot = Snapshot::default();
    let topology = SurfaceTopology {
        epoch: body.epoch(),
        vertex_count: surface.vertices.len() as u32,
        triangles: surface.triangles.clone(),
        tags: surface.tags.clone(),
        ..SurfaceTopology::default()
    };
    let velocities = vec![[0.0; 3]; surface.vertices.len()];
    snapshot.bodies.push(BodySnapshot { topology: Arc::new(topology), velocities, ..Default::default() });
    for (spec, mode) in specs.iter().zip(modes) {
        snapshot.tools.push(ToolSnapshot {
            id: Arc::from(spec.id.as_str()),
            shape: spec.shape,
            mode,
            stiffness_n_m: 500.0,
            max_force_n: 5.0,
            friction: 0.0,
            ..Default::default()
        });
    }
    let mut models = ContactModels::default();
    let mut queries: Vec<ToolQuery> = inputs
        .iter()
        .zip(&specs)
        .map(|(input, spec)| ToolQuery {
            id: input.id.clone(),
            shape: spec.shape,
            pose: input.pose,
            velocity_m_s: V::zeros(),
            mode: input.mode,
        })
        .collect();

    let (mut springs, mut planes, mut steady) = (0, 0, 0);
    let rest = body.rest_positions();
    let (mut in_step, mut in_take, mut in_models) = (0.0, 0.0, 0.0);
    for (round, positions) in rounds.iter().enumerate() {
        for (i, (input, query)) in inputs.iter_mut().zip(&mut queries).enumerate() {
            input.pose = pose(i, round);
            query.pose = input.pose;
            snapshot.tools[i].pose = input.pose;
            snapshot.tools[i].proxy = input.pose;
        }
        snapshot.bodies[0].positions.clone_from(positions);
        snapshot.step += 1;

        let before = allocations();
        let start = Instant::now();
        tools.advance(0.02 * round as f64, &inputs);
        contacts.update_surface(0, body.epoch(), (surface, &rest), positions).unwrap();
        contacts.detect(&tools, 0.02);
        contacts.collect(0, &forces[..contacts.springs(0).len()]);
        contacts.react(&mut tools);
        in_step += start.elapsed().as_secs_f64();
        let start = Instant::now();
        models.take(&snapshot, 0.02 * round as f64);
        in_take += start.elapsed().as_secs_f64();
        let start = Instant::now();
        for tick in 0..4 {
            for query in &queries {
                let now_s = 0.02 * round as f64 + 0.005 * f64::from(tick);
                planes += models.evaluate(query, now_s).planes.len();
            }
        }
        in_models += start.elapsed().as_secs_f64();
        springs += contacts.springs(0).len();
        // The first rounds build trees and grow scratch to size.
        steady += if round < 2 { 0 } else { allocations() - before };
    }
    let rounds = rounds.len() as f64;
    println!(
        "{} triangles, 5 tools: detection {:.3} ms per step, snapshot {:.3} ms, model {:.4} ms",
        surface.triangles.len(),
        1e3 * in_step / rounds,
        1e3 * in_take / rounds,
        1e3 * in_models / rounds / 20.0,
    );
    assert!(springs > 100 && planes > 100, "{springs} {planes}");
    assert_eq!(steady, 0);
}

//! Bodies that touch are solved as one system.

use nalgebra::Vector3;
use scindo_physics::body::{
    Body, BodySettings, Group, Notice, Outcome, PairSpring, PointSpring, Scheme, SpringKind,
};
use scindo_physics::element::MaterialPoint;
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::mesh::{BoxPattern, box_mesh};

use crate::{DOWN, SOFT, settings};

const DAMPED: Material = Material { rayleigh: Rayleigh { mass_1_s: 0.0, stiffness_s: 0.01 }, ..SOFT };

/// A cube of 0.1 m whose lowest nodes are at `y` [m].
fn block_at(y: f64, cells: usize, material: Material, settings: BodySettings) -> Body {
    let mesh =
        box_mesh(Vector3::new(0.0, y, 0.0), Vector3::new(0.1, y + 0.1, 0.1), [cells; 3], BoxPattern::Tet6);
    Body::new(mesh, material, settings).unwrap()
}

/// Nodes of a body at this height [m].
fn layer(body: &Body, y: f64) -> Vec<u32> {
    let at = |n: &u32| (body.rest_positions()[*n as usize].y - y).abs() < 1e-9;
    (0..body.rest_positions().len() as u32).filter(at).collect()
}

fn node(n: u32) -> MaterialPoint {
    MaterialPoint::new([(n, 1.0)])
}

/// The kind of contact on a plane below, or between two bodies whose places coincide.
fn above(offset_m: f64) -> SpringKind {
    SpringKind::OneSided { normal: Vector3::y(), offset_m }
}

/// Springs that hold every pair of nodes at the same place of two bodies with this kind.
fn pairs(lower: &Body, upper: &Body, y: f64, kind: SpringKind, stiffness_n_m: f64) -> Vec<PairSpring> {
    let below = layer(lower, y);
    let same = |n: u32| {
        let x = upper.rest_positions()[n as usize];
        let near = |m: &&u32| (lower.rest_positions()[**m as usize] - x).norm() < 1e-9;
        *below.iter().find(near).unwrap()
    };
    let pair = |n: u32| PairSpring {
        bodies: [1, 0],
        point: node(n),
        corners: [node(same(n)); 3],
        barycentric: [0.2, 0.3, 0.5],
        kind,
        stiffness_n_m,
        max_force_n: f64::INFINITY,
    };
    layer(upper, y).into_iter().map(pair).collect()
}

#[test]
fn a_stack_comes_to_rest_and_exchanges_momentum_exactly() {
    let (mut lower, mut upper) =
        (block_at(0.0, 3, DAMPED, settings(100, 1e-6)), block_at(0.1, 3, DAMPED, settings(100, 1e-6)));
    let floor: Vec<PointSpring> = layer(&lower, 0.0)
        .into_iter()
        .map(|n| PointSpring { point: node(n), kind: above(0.0), stiffness_n_m: 2e3, max_force_n: 1e3 })
        .collect();
    let between = pairs(&lower, &upper, 0.1, above(0.0), 2e3);
    let mut group = Group::default();
    for _ in 0..300 {
        let before = [lower.momentum(), upper.momentum()];
        let reports = group.step(&mut [&mut lower, &mut upper], (0.01, DOWN), &[&floor, &[]], &between);
        assert!(reports.iter().all(|r| r.outcome == Outcome::Advanced && r.notice.is_none()), "{reports:?}");
        let pushed: Vector3<f64> = group.forces().iter().sum();
        let floor: Vector3<f64> = lower.spring_forces().iter().sum();
        let gained = [lower.momentum() - before[0], upper.momentum() - before[1]];
        let weight = [lower.total_mass() * DOWN, upper.total_mass() * DOWN];
        let off = [gained[0] - 0.01 * (weight[0] + floor - pushed), gained[1] - 0.01 * (weight[1] + pushed)];
        assert!(off.iter().all(|off| off.norm() < 1e-9), "{off:?}");
        assert!(group.forces().iter().all(|f| f.y >= -1e-6), "a contact does not pull");
    }
    let pushed: Vector3<f64> = group.forces().iter().sum();
    let weight = upper.total_mass() * DOWN;
    assert!((pushed + weight).norm() < 1e-4 * weight.norm(), "{pushed} {weight}");
    let speed = lower.momentum().norm() + upper.momentum().norm();
    assert!(speed < 1e-6, "{speed}");
}

#[test]
fn two_halves_that_are_joined_move_like_one_body() {
    for law in [Law::Linear, Law::Corotational] {
        let material = Material { law, ..DAMPED };
        let tight = settings(400, 1e-7);
        let (mut lower, mut upper) = (block_at(0.0, 4, material, tight), block_at(0.1, 4, material, tight));
        let mesh = box_mesh(Vector3::zeros(), Vector3::new(0.1, 0.2, 0.1), [4, 8, 4], BoxPattern::Tet6);
        let mut whole = Body::new(mesh, material, tight).unwrap();
        for body in [&mut lower, &mut whole] {
            let held = layer(body, 0.0);
            body.fix(&held, [true; 3], Vector3::zeros()).unwrap();
        }
        let joined = SpringKind::Hold { target_m: Vector3::zeros() };
        let between = pairs(&lower, &upper, 0.1, joined, 1e6);
        let gravity = Vector3::new(20.0, 0.0, 5.0);
        let mut group = Group::default();
        for _ in 0..40 {
            group.step(&mut [&mut lower, &mut upper], (0.01, gravity), &[&[], &[]], &between);
            whole.step(0.01, gravity, &[]);
        }
        let top = |body: &Body| {
            let nodes = layer(body, 0.2);
            nodes.iter().map(|&n| body.positions()[n as usize]).sum::<Vector3<f64>>() / nodes.len() as f64
        };
        let moved = (top(&whole) - Vector3::new(0.05, 0.2, 0.05)).norm();
        let apart = (top(&whole) - top(&upper)).norm();
        assert!(moved > 1e-3 && apart < 2e-3 * moved, "{law:?}: {moved} {apart}");
    }
}

#[test]
fn a_body_touches_itself_with_the_same_springs() {
    let mut body = block_at(0.0, 3, DAMPED, settings(100, 1e-6));
    let (low, high) = (layer(&body, 0.0)[0], layer(&body, 0.1)[0]);
    let rest = body.rest_positions()[high as usize] - body.rest_positions()[low as usize];
    let pull = PairSpring {
        bodies: [0, 0],
        point: node(high),
        corners: [node(low); 3],
        barycentric: [1.0, 0.0, 0.0],
        kind: SpringKind::Hold { target_m: 0.8 * rest },
        stiffness_n_m: 500.0,
        max_force_n: 10.0,
    };
    let mut group = Group::default();
    for _ in 0..100 {
        group.step(&mut [&mut body], (0.01, Vector3::zeros()), &[&[]], &[pull]);
        assert!(body.momentum().norm() < 1e-12, "inner forces move no centre of mass");
    }
    let now = body.positions()[high as usize] - body.positions()[low as usize];
    assert!(now.norm() < 0.92 * rest.norm(), "{now}");
}

#[test]
fn bodies_that_cannot_take_part_step_alone_and_say_so() {
    let nonlinear = Material { law: Law::NeoHookean, ..DAMPED };
    let still = BodySettings { scheme: Scheme::SymplecticEuler, ..settings(100, 1e-6) };
    for (material, of) in [(nonlinear, settings(100, 1e-6)), (DAMPED, still)] {
        let (mut lower, mut upper) =
            (block_at(0.0, 2, DAMPED, settings(100, 1e-6)), block_at(0.1, 2, material, of));
        let between = pairs(&lower, &upper, 0.1, above(0.0), 1e3);
        let mut group = Group::default();
        let reports = group.step(&mut [&mut lower, &mut upper], (1e-4, DOWN), &[&[], &[]], &between);
        assert!(reports.iter().all(|r| r.notice == Some(Notice::Parted)), "{reports:?}");
        assert!(group.forces().iter().all(|f| *f == Vector3::zeros()));
    }
}

#[test]
fn threads_change_no_bit() {
    let run = |threads: usize| {
        let of = BodySettings { threads, ..settings(60, 1e-6) };
        let (mut lower, mut upper) = (block_at(0.0, 8, DAMPED, of), block_at(0.1, 8, DAMPED, of));
        let held = layer(&lower, 0.0);
        lower.fix(&held, [true; 3], Vector3::zeros()).unwrap();
        let between = pairs(&lower, &upper, 0.1, above(0.0), 1e3);
        let mut group = Group::default();
        for _ in 0..10 {
            group.step(&mut [&mut lower, &mut upper], (0.01, DOWN), &[&[], &[]], &between);
        }
        [lower.positions().to_vec(), upper.positions().to_vec()]
    };
    let one = run(1);
    assert!(one == run(2) && one == run(3));
}

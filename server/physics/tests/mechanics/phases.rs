//! A step announces its phases, and announcing them changes nothing.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

use scindo_allocations::allocations;
use scindo_physics::body::{Arithmetic, Body, BodySettings, PcgSettings, Scheme};
use scindo_physics::material::{Law, Material};
use scindo_physics::team::phase::Phase;

use crate::{DOWN, SOFT, apart, cube, hold_left};

/// A cube held at its left, of this law and scheme.
fn held(law: Law, scheme: Scheme) -> Body {
    held_with(law, BodySettings { scheme, ..BodySettings::default() })
}

fn held_with(law: Law, settings: BodySettings) -> Body {
    let settings = BodySettings { solver: PcgSettings { iterations: 200, tolerance: 1e-4 }, ..settings };
    let mut body = cube(3, Material { law, ..SOFT }, settings);
    hold_left(&mut body);
    body
}

/// Bodies of every path: fast, general with Newton's method, explicit.
const PATHS: [(Law, Scheme, f64); 5] = [
    (Law::Corotational, Scheme::ImplicitEuler, 0.01),
    (Law::Corotational, Scheme::AVERAGE_ACCELERATION, 0.01),
    (Law::NeoHookean, Scheme::ImplicitEuler, 0.01),
    (Law::NeoHookean, Scheme::Bdf2, 0.01),
    (Law::NeoHookean, Scheme::SymplecticEuler, 1e-4),
];

/// The phases of one step, without repetitions of the one under way.
fn phases(body: &mut Body, h: f64) -> Vec<Phase> {
    let heard = Arc::new(Mutex::new(Vec::new()));
    let writes = Arc::clone(&heard);
    body.set_phase_mark(Some(Box::new(move |phase| writes.lock().unwrap().push(phase))));
    body.step(h, DOWN, &[]);
    body.set_phase_mark(None);
    let mut phases = heard.lock().unwrap().clone();
    phases.dedup();
    phases
}

#[test]
fn a_step_by_one_linear_solve_announces_its_phases_in_order() {
    use Phase::{Commit, Guards, Operator, Predict, Residual, Solve};
    let mut body = held(Law::Corotational, Scheme::ImplicitEuler);
    assert_eq!(phases(&mut body, 0.01), [Guards, Predict, Operator, Residual, Solve, Commit, Guards]);
}

#[test]
fn newtons_method_returns_to_operator_solve_and_search() {
    let settings = BodySettings { arithmetic: Some(Arithmetic::Double), ..BodySettings::default() };
    let mut body = held_with(Law::NeoHookean, settings);
    let heard = phases(&mut body, 0.01);
    assert!(Phase::ALL.iter().all(|phase| heard.contains(phase)), "{heard:?}");
    let steps = body.step(0.01, DOWN, &[]).newton_steps as usize;
    let again = phases(&mut body, 0.01);
    let searches = again.iter().filter(|&&phase| phase == Phase::Search).count();
    assert!(steps > 1 && searches > 1, "{steps} Newton steps, then {again:?}");
}

#[test]
fn an_explicit_step_announces_forces_and_new_positions_for_each_part() {
    use Phase::{Commit, Guards, Residual, Solve};
    let mut body = held(Law::NeoHookean, Scheme::SymplecticEuler);
    let heard = phases(&mut body, 1e-4);
    assert_eq!(heard, [Guards, Residual, Solve, Commit, Guards]);
    let parts = body.step(0.01, DOWN, &[]).substeps as usize;
    let again = phases(&mut body, 0.01);
    assert!(parts > 1, "{parts} parts");
    assert_eq!(again.iter().filter(|&&phase| phase == Residual).count(), parts);
}

#[test]
fn announcing_phases_changes_no_bit_and_allocates_nothing() {
    for (law, scheme, h) in PATHS {
        let (mut silent, mut told) = (held(law, scheme), held(law, scheme));
        let calls = Arc::new(AtomicUsize::new(0));
        let counts = Arc::clone(&calls);
        told.set_phase_mark(Some(Box::new(move |_| {
            counts.fetch_add(1, Ordering::Relaxed);
        })));
        (0..10).for_each(|_| {
            silent.step(h, DOWN, &[]);
            told.step(h, DOWN, &[]);
        });
        let heard = calls.load(Ordering::Relaxed);
        assert!(heard >= 10 * 4, "{law:?} {scheme:?}: {heard} calls");
        for body in [&mut silent, &mut told] {
            let before = allocations();
            (0..5).for_each(|_| {
                body.step(h, DOWN, &[]);
            });
            assert_eq!(allocations() - before, 0, "{law:?} {scheme:?}");
        }
        assert_eq!(apart(&silent, &told), 0.0, "{law:?} {scheme:?}");
        assert_eq!(silent.velocities(), told.velocities(), "{law:?} {scheme:?}");
    }
}

#[test]
fn nobody_is_called_once_the_mark_is_taken_off() {
    let mut body = held(Law::Corotational, Scheme::ImplicitEuler);
    let calls = Arc::new(AtomicUsize::new(0));
    let counts = Arc::clone(&calls);
    body.set_phase_mark(Some(Box::new(move |_| {
        counts.fetch_add(1, Ordering::Relaxed);
    })));
    body.step(0.01, DOWN, &[]);
    let during = calls.load(Ordering::Relaxed);
    body.set_phase_mark(None);
    body.step(0.01, DOWN, &[]);
    assert!(during > 0);
    assert_eq!(calls.load(Ordering::Relaxed), during);
    assert_eq!(Arc::strong_count(&calls), 1, "the mark is gone");
}

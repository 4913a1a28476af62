//! Some seconds of the campaign, and that each safeguard is missed.

use std::sync::atomic::AtomicBool;

use crate::campaign::{Extent, run};
use crate::drill;
use crate::episode;
use crate::guarantees::{GUARANTEES, row};
use crate::table::Mutant;

const SOME: Extent = Extent { first: 1, seeds: Some(60), time: None, threads: 2 };

#[test]
fn no_rule_is_broken_and_every_fault_is_tried() {
    let totals = run(episode::run, &SOME, None, &AtomicBool::new(false), &|_| ()).unwrap();
    assert_eq!(totals.broken, []);
    assert_eq!(totals.seeds, 60);
    for (class, count) in totals.hits.classes() {
        assert!(count > 10, "{class}: {count}");
    }
    assert!(totals.cuts > 300 && totals.touched > 10_000 && totals.refused > 1000, "{totals:?}");
}

#[test]
fn a_seed_repeats_itself_on_any_number_of_threads() {
    let once = episode::run(77, None).unwrap();
    assert_eq!(
        serde_json::to_string(&once).unwrap(),
        serde_json::to_string(&episode::run(77, None).unwrap()).unwrap()
    );
    let few = Extent { seeds: Some(6), ..SOME };
    let of = |threads| {
        let totals =
            run(episode::run, &Extent { threads, ..few }, None, &AtomicBool::new(false), &|_| ()).unwrap();
        serde_json::to_string(&totals).unwrap()
    };
    assert_eq!(of(1), of(3));
}

#[test]
fn every_safeguard_that_is_taken_out_is_missed() {
    for mutant in Mutant::ALL {
        let totals = run(episode::run, &SOME, Some(mutant), &AtomicBool::new(false), &|_| ()).unwrap();
        assert!(totals.violations > 0, "{mutant:?} goes unnoticed");
    }
}

#[test]
fn made_up_contacts_break_no_rule_of_the_force_unless_a_safeguard_is_missing() {
    let totals = run(drill::run, &SOME, None, &AtomicBool::new(false), &|_| ()).unwrap();
    assert_eq!(totals.broken, []);
    assert_eq!(totals.ticks, 60 * drill::TICKS);
    assert!(totals.touched > totals.ticks / 10 && totals.hits.restarts > 60, "{totals:?}");
    let totals = run(drill::run, &SOME, Some(Mutant::NoValidity), &AtomicBool::new(false), &|_| ()).unwrap();
    assert!(totals.violations > 30, "{totals:?}");
}

#[test]
fn the_page_of_promises_is_that_of_the_program() {
    let page = include_str!("../../../deploy/RELIABILITY.md");
    for guarantee in GUARANTEES {
        let row = row(&guarantee);
        assert!(
            page.contains(&row),
            "missing in deploy/RELIABILITY.md, see `scindo reliability --write`: {row}"
        );
    }
}

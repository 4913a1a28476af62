//! The list of printed numbers, the verdicts, and a book of one part.

use std::collections::BTreeSet;

use serde_json::json;

use super::catalogue::{Good, papers};
use super::part::{Kind, parts};
use super::verdict::{Verdict, judge};
use super::*;
use crate::experiment;
use crate::stress::cases;

/// Every number is judged by something that exists, or says why it is not.
#[test]
fn every_printed_number_has_a_source_or_a_reason() {
    let parts: BTreeSet<String> = parts(false).into_iter().map(|part| part.name).collect();
    let papers = papers().unwrap();
    assert_eq!(papers.len(), 5);
    for paper in &papers {
        let mut seen = BTreeSet::new();
        for number in &paper.number {
            let name = format!("{}: {}, {}", paper.id, number.place, number.what);
            assert!(seen.insert((&number.place, &number.what)), "{name}: twice");
            assert!(
                number.good != Good::Told || number.because.is_some(),
                "{name}: why is it another value?"
            );
            assert!(number.from.is_some() || number.open.is_some() || number.refuted.is_some(), "{name}");
            assert!(
                number.printed.is_finite() && (number.printed != 0.0 || number.good == Good::Zero),
                "{name}"
            );
            let sources = [number.source(false), number.source(true), number.source_on_fewer_cores()];
            for source in sources.iter().flatten() {
                match source[..] {
                    ["stress", case, _] => {
                        assert!(cases::ALL.iter().any(|known| known.name == case), "{name}: {case}");
                    }
                    [part, _, _, _] => {
                        assert!(parts.contains(part) && experiment::NAMES.contains(&part), "{name}: {part}");
                    }
                    _ => panic!("{name}: {source:?}"),
                }
            }
        }
    }
}

/// A paper with these numbers, of a core four times as slow as one of today.
fn paper(numbers: &str) -> catalogue::Paper {
    let head = r#"
        id = "a"
        title = ""
        authors = ""
        year = 2000
        machine = ""
        core = 4.0
        about = ""
    "#;
    toml::from_str(&format!("{head}{numbers}")).unwrap()
}

#[test]
fn verdicts_follow_the_values() {
    let paper = paper(
        r#"
        [[number]]
        place = ""
        what = "time"
        printed = 8.0
        unit = "s"
        good = "less"
        [[number]]
        place = ""
        what = "error"
        printed = 0.5
        unit = "1"
        good = "same"
        within = 0.1
        refuted = "because"
        [[number]]
        place = ""
        what = "ratio"
        printed = 2.0
        unit = "times"
        good = "more"
        [[number]]
        place = ""
        what = "count"
        printed = 100.0
        unit = "count"
        good = "told"
        because = "another mesh"
    "#,
    );
    let verdicts = |number: usize, values: &[f64]| -> Vec<Verdict> {
        values.iter().map(|v| judge(&paper, &paper.number[number], Some(*v))).collect()
    };
    // Twice as fast is worse than the same code on a core four times as fast.
    assert_eq!(verdicts(0, &[4.0, 2.05, 1.0]), [Verdict::Worse, Verdict::Reproduced, Verdict::Better]);
    assert_eq!(verdicts(1, &[0.52, 0.6]), [Verdict::Reproduced, Verdict::Refuted]);
    assert_eq!(verdicts(0, &[f64::NAN]), [Verdict::NotYet]);
    assert_eq!(verdicts(2, &[1.5, 1.95, 3.0]), [Verdict::Worse, Verdict::Reproduced, Verdict::Better]);
    assert_eq!(
        verdicts(3, &[104.0, 80.0, 120.0]),
        [Verdict::Reproduced, Verdict::Explained, Verdict::Explained]
    );
    assert_eq!(verdict::reason(&paper.number[3], Verdict::Explained), Some("another mesh"));
    assert_eq!(verdict::reason(&paper.number[3], Verdict::Reproduced), None);
    assert_eq!(judge(&paper, &paper.number[0], None), Verdict::NotYet);
    assert_eq!(judge(&paper, &paper.number[1], None), Verdict::Refuted);
}

/// A number of elements that fewer cores reach is reached; one that they miss was not measured.
#[test]
fn fewer_cores_may_be_enough() {
    let paper = paper(
        r#"
        [[number]]
        place = ""
        what = "elements on 4 cores"
        printed = 10.0
        unit = "count"
        good = "more"
        core_scales = true
        from = "threads / Bar / 4 threads / elements"
        fewer_cores = "threads / Bar / 2 threads / elements"
    "#,
    );
    let number = &paper.number[0];
    let measured = |rows: &[(&str, f64)]| {
        let row = |(name, value): &(&str, f64)| json!({ "name": name, "printed": false, "values": [value] });
        let rows: Vec<_> = rows.iter().map(row).collect();
        let table = json!({ "title": "Bar", "columns": [{ "name": "elements" }], "rows": rows });
        Measured::of_report("threads", json!({ "experiments": [{ "name": "threads", "tables": [table] }] }))
    };
    let found = |rows: &[(&str, f64)]| {
        let measured = measured(rows);
        (measured.of(&paper, number, false), measured.on_fewer_cores(&paper, number, false).is_some())
    };
    assert_eq!(found(&[("2 threads", 50.0)]), (Some(50.0), true));
    assert_eq!(found(&[("2 threads", 30.0)]), (None, false));
    assert_eq!(found(&[("2 threads", 50.0), ("4 threads", 30.0)]), (Some(30.0), false));
}

/// Every part can be run: its study or scene exists.
#[test]
fn every_part_exists() {
    for quick in [false, true] {
        for part in parts(quick) {
            let exists = match part.kind {
                Kind::Accuracy => {
                    let name = part.name.as_str();
                    experiment::NAMES.contains(&name) || crate::cases::NAMES.contains(&name)
                }
                Kind::Effects => part.scene().and_then(scindo_world::scene::ShippedScene::of_name).is_some(),
                Kind::Stress | Kind::Haptics => true,
            };
            assert!(exists, "{}", part.name);
        }
    }
}

/// A value is found in the report of its part, and its row says so.
#[test]
fn a_book_of_one_part() {
    let directory = tempfile::tempdir().unwrap();
    let all = parts(true);
    let relaxation = all.iter().find(|part| part.name == "nienhuys").unwrap();
    assert_eq!(relaxation.kind, Kind::Accuracy);
    let origin = Origin::here();
    let before = write(directory.path(), &all, &origin, true).unwrap();
    assert!(!relaxation.is_done(directory.path(), &origin, true));
    let study = json!({ "cases": [], "experiments": [{
        "name": "nienhuys",
        "trouble": null,
        "tables": [{
            "title": "Figure 3.12: the dilated cube",
            "columns": [{ "name": "nodes", "unit": "count" }, { "name": "iterations per second", "unit": "count" }],
            "rows": [
                { "name": "one thread", "printed": true, "values": [1728, 55] },
                { "name": "one thread", "printed": false, "values": [1728, 16500] },
            ],
        }],
    }] });
    std::fs::create_dir_all(relaxation.folder(directory.path())).unwrap();
    std::fs::write(relaxation.report(directory.path()), study.to_string()).unwrap();
    relaxation.finish(directory.path(), &origin, true, 12.0).unwrap();
    assert!(relaxation.is_done(directory.path(), &origin, true));
    assert!(!relaxation.is_done(directory.path(), &origin, false));
    let after = write(directory.path(), &all, &origin, true).unwrap();
    let best = |tallies: &[Tally]| {
        let tally = tallies.iter().find(|tally| tally.paper == "nienhuys-2003").unwrap();
        [tally.counts[0], tally.counts[1]]
    };
    // The number of nodes is reproduced, the rate is better: 300 times, on cores 15 times as fast.
    assert_eq!((best(&before), best(&after)), ([0, 0], [1, 1]));
    let page = std::fs::read_to_string(directory.path().join("paper-nienhuys-2003.html")).unwrap();
    assert!(page.contains("16,500") && page.contains("300 ×") && page.contains("20 ×"), "{page}");
    let index = std::fs::read_to_string(directory.path().join("index.html")).unwrap();
    assert!(index.contains("nienhuys/index.html") && index.contains("12.0 s"));
}

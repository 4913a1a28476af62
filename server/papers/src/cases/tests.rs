//! What holds of every case, and what the study tells of known cases.

use scindo_study::advice::sources::{Source, peel};
use scindo_study::bench::forecast::Forecast;
use scindo_study::case::Truth;
use scindo_study::design::axes::{Factor, step};
use scindo_study::design::{Configuration, design};
use scindo_study::reference::Reference;
use scindo_study::trial::series::Series;
use scindo_study::trial::{Status, Trial};

use super::*;

#[test]
fn every_case_has_a_base_and_a_bounded_number_of_points() {
    for name in NAMES {
        for quick in [false, true] {
            let case = builtin(name, quick).expect(name);
            let all = design(&case.axes, &case.blocks);
            assert!((10..=160).contains(&all.len()), "{name}: {} points", all.len());
            let law = case.axes.iter().find(|axis| axis.factor == Factor::Law).expect("law");
            assert!(law.find(case.truth.law()).is_some(), "{name}: the reference has a law of the axis");
            if let Truth::Known { series, .. } = &case.truth {
                assert_eq!(series.width(), 3 * case.scene.checked().probes.len(), "{name}");
            }
        }
    }
}

/// u = 1 + mesh error + c Δt + law error + tolerance.
fn model(configuration: &Configuration) -> Trial {
    let law = if configuration.label(Factor::Law) == "linear" { 0.2 } else { 0.0 };
    let h = configuration.setting(Factor::Step).map_or(0.0, |step| step.size);
    let t = configuration.setting(Factor::Tolerance).unwrap().size;
    let u = 1.0 + 0.01 + 5.0 * h + law + t;
    let series = Series { frames: vec![1], displacement_m: vec![u, 0.0, 0.0], energy_j: vec![1.0] };
    Trial { status: Status::Done, series, ..Trial::refused(String::new()) }
}

#[test]
fn every_source_is_told_apart() {
    let case = builtin("bar-motion", true).unwrap();
    let base = Configuration::base(&case.axes);
    let linear = case.axes.iter().find(|a| a.factor == Factor::Law).unwrap().find("linear").unwrap().clone();
    let configuration = base.with(Factor::Law, &linear);
    let reference = Reference {
        series: Series { frames: vec![1], displacement_m: vec![1.0, 0.0, 0.0], energy_j: vec![1.0] },
        goal: None,
        error_bar: 0.0,
        law: "corotational".into(),
        source: String::new(),
    };
    let series = model(&configuration).series;
    let found = peel(&case, &configuration, &series, &reference, &mut |c| Some(model(c)));
    let near = |source, size: f64| (found.of(source).unwrap() - size).abs() < 1e-9;
    assert!(near(Source::Rounding, 0.0) && near(Source::Algebraic, 1e-4 - 1e-10));
    assert!(near(Source::Time, 5.0 * 0.04), "{found:?}");
    assert!(near(Source::Model, 0.2), "{found:?}");
    assert!(near(Source::Discretisation, 0.01), "{found:?}");
}

#[test]
fn what_cannot_be_run_is_left_out() {
    let case = builtin("r1", true).unwrap();
    let configuration = Configuration::base(&case.axes);
    let series = model(&configuration).series;
    let reference = Reference {
        series: series.clone(),
        goal: None,
        error_bar: 0.0,
        law: "linear".into(),
        source: String::new(),
    };
    let found = peel(&case, &configuration, &series, &reference, &mut |_| None);
    assert_eq!(found.of(Source::Algebraic), None);
    assert_eq!(found.of(Source::Model), Some(0.0));
    assert_eq!(found.of(Source::Discretisation), Some(0.0));
}

#[test]
fn a_run_of_the_same_kind_tells_most() {
    let case = builtin("bar-motion", true).unwrap();
    let base = Configuration::base(&case.axes);
    let mut forecast = Forecast::default();
    assert_eq!(forecast.seconds(&case, &base), None);
    forecast.learn(&case, &base, 2.0);
    let frame_s = base.setting(Factor::Step).unwrap().size;
    let finer = base.with(Factor::Step, &step(0.25 * frame_s));
    assert!((forecast.seconds(&case, &finer).unwrap() - 8.0).abs() < 1e-9);
    let element = case.axes.iter().find(|a| a.factor == Factor::Element).unwrap();
    let other = base.with(Factor::Element, element.settings.iter().find(|s| s.label == "tet10").unwrap());
    forecast.learn(&case, &other, 100.0);
    assert!((forecast.seconds(&case, &finer).unwrap() - 8.0).abs() < 1e-9);
}

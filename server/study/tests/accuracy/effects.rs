//! `scindo effects`: every effect has a figure or a reason.
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use scindo_study::study::effects::{EffectsReport, Off, Request, Saving, measure};
use scindo_world::scene::Scene;

const BLOCK: &str = r#"
schema = 1
name = "block on a floor"
world = { gravity_m_s2 = [0, 0, -9.81], step_s = 0.01 }
effects = { error_estimate = true }
[[body]]
id = "block"
mesh = { box = { min_m = [0, 0, 0.001], max_m = [0.1, 0.1, 0.101], cells = [6, 6, 6] } }
law = "corotational"
young_pa = 1e4
poisson = 0.3
density_kg_m3 = 1000
rayleigh = { mass_1_s = 1.0, stiffness_s = 0.0 }
[[obstacle]]
id = "floor"
half_space = { point_m = [0, 0, 0], normal = [0, 0, 1] }
[[tool]]
id = "probe"
shape = { sphere = { radius_m = 0.01 } }
path = [{ at_s = 0, tip_m = [0.05, 0.05, 0.3] }, { at_s = 1, tip_m = [0.05, 0.05, 0.2] }]
"#;

fn report(text: &str, steps: u32) -> EffectsReport {
    let request = Request { steps, stop: Arc::new(AtomicBool::new(false)) };
    let mut told = 0;
    let report = measure(&Scene::from_toml(text).unwrap(), &request, &mut |_, done, total| {
        assert!(done >= told && done < total, "{told} {done} {total}");
        told = done;
    });
    report.unwrap()
}

fn off<'a>(report: &'a EffectsReport, name: &str) -> &'a Off {
    &report.effects.iter().find(|row| row.name == name).expect(name).off
}

fn saving<'a>(report: &'a EffectsReport, name: &str) -> &'a Saving {
    match off(report, name) {
        Off::Measured(saving) => saving,
        other => panic!("{name}: {other:?}"),
    }
}

#[test]
fn every_effect_has_a_figure_or_a_reason() {
    let report = report(BLOCK, 12);
    assert_eq!((report.steps, report.interrupted), (12, false));
    assert!(report.step_ms > 0.0);
    for name in ["gravity", "large rotation", "damping", "obstacles", "error estimate"] {
        let saving = saving(&report, name);
        let same = if name == "gravity" { 0 } else { 12 };
        assert_eq!((saving.pairs, saving.same_state), (12, same), "{name}: {saving:?}");
        assert!(saving.without_ms > 0.0 && saving.saves_ms.is_finite(), "{name}: {saving:?}");
    }
    // The estimate costs as much as forces in double precision: no machine is too noisy for that.
    let estimate = saving(&report, "error estimate");
    assert!(estimate.saves_ms > 0.0 && estimate.keys == ["effects.error_estimate=false"], "{estimate:?}");
    for (name, word) in [("deformation block", "there for"), ("contact probe x block", "the tool has a path")]
    {
        let Off::Impossible { reason } = off(&report, name) else { panic!("{name}: {report:?}") };
        assert!(reason.contains(word), "{reason}");
    }
    for row in &report.effects {
        assert_eq!(row.on, row.off != Off::AlreadyOff, "{row:?}");
        assert_ne!(row.off, Off::NotMeasured, "{row:?}");
    }
}

#[test]
fn an_interruption_leaves_a_report() {
    let stop = Arc::new(AtomicBool::new(false));
    let request = Request { steps: 5, stop: stop.clone() };
    let scene = Scene::from_toml(BLOCK).unwrap();
    let report =
        measure(&scene, &request, &mut |_, done, _| stop.store(done == 4, Ordering::Relaxed)).unwrap();
    assert!(report.interrupted && report.steps == 5, "{report:?}");
    assert_eq!(off(&report, "gravity"), &Off::NotMeasured);
}

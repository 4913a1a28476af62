//! Tests of the quick cases, of their list, and of the written files.
#![allow(clippy::unwrap_used)]

use super::*;

#[test]
fn every_case_of_the_list_is_there_once() {
    let mut names: Vec<&str> = cases::ALL.iter().map(|case| case.name).collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), cases::ALL.len());
    // Cases 25 and 27 need a haptic client.
    let numbers: Vec<u8> = cases::ALL.iter().filter_map(|case| case.number).collect();
    assert!(numbers.is_sorted());
    assert_eq!((1..=31).filter(|number| !numbers.contains(number)).collect::<Vec<u8>>(), [25, 27]);
}

#[test]
fn cases_are_found_by_name_and_number() {
    let find = |name: &str| select(&[name.to_owned()], &[]).map(|found| found[0].name);
    assert_eq!(find("8").unwrap(), "free-fall");
    assert_eq!(find("free-fall").unwrap(), "free-fall");
    assert!(find("no-such-case").unwrap_err().to_string().contains("free-fall"));
}

/// The quick cases pass, and a second run gives the same JSON. `SCINDO_LONG_TESTS=1` runs all of them.
#[test]
fn cases_pass_and_are_the_same_on_every_run() {
    let long = std::env::var_os("SCINDO_LONG_TESTS").is_some();
    let chosen = cases::ALL.iter().filter(|case| case.quick || long);
    let settings =
        Settings { cases: chosen.map(|case| case.name.to_owned()).collect(), ..Settings::default() };
    let first = run(&settings, &mut |_| {}).unwrap();
    let directory = tempfile::tempdir().unwrap();
    write(directory.path(), &first, None).unwrap();
    if let Some(to) = std::env::var_os("SCINDO_STRESS_OUT") {
        write(Path::new(&to), &first, None).unwrap();
    }
    let mut wrong = Vec::new();
    for (report, seconds) in first.cases.iter().zip(&first.case_seconds) {
        println!("{:8} {:16} {seconds:.1} s", report.status.name(), report.case.name);
        if report.status == Status::Failed {
            wrong.push(format!("{}: {:#?}", report.case.name, report.failures()));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    let again = run_case(select(&["free-fall".into()], &[]).unwrap()[0], &Setting::default());
    let before = first.cases.iter().find(|report| report.case.name == "free-fall").unwrap();
    assert_eq!(json::case(before).to_string(), json::case(&again).to_string());
    let page = std::fs::read_to_string(directory.path().join("index.html")).unwrap();
    assert!(page.contains("free-fall") && !page.contains("MNaN") && !page.contains("LNaN"));
}

/// Every mutation is noticed by the cases named for it. Those of clients are tested where clients are known.
#[test]
fn every_mutation_is_caught_by_its_named_cases() {
    let mut missed = Vec::new();
    for mutation in Mutation::ALL.into_iter().filter(|mutation| *mutation != Mutation::Tank) {
        for name in mutation.named() {
            let report = run_case(select(&[(*name).to_owned()], &[]).unwrap()[0], &mutation.setting());
            println!("without {}: {name} {}: {:?}", mutation.name(), report.status.name(), report.failures());
            if report.status != Status::Failed {
                missed.push(format!("{} passes without {}", name, mutation.name()));
            }
        }
    }
    assert!(missed.is_empty(), "{missed:?}");
}

/// No scene can select a mutation.
#[test]
fn bodies_of_scenes_are_whole() {
    let settings = scindo_physics::body::BodySettings::default();
    assert_eq!(settings.ablation, scindo_physics::body::Ablation::default());
    let scene = scindo_world::scene::Scene::from_toml(include_str!("../../../world/scenes/first-cut.toml"));
    let simulation = scindo_world::simulation::Simulation::new(&scene.unwrap(), Path::new(".")).unwrap();
    assert!(simulation.bodies().iter().all(|body| body.body.settings().ablation == settings.ablation));
}

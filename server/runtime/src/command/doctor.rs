//! `scindo doctor` says what works on this machine and what does not.

use std::fs;
use std::path::Path;
use std::process::ExitCode;

use scindo_program::say;
use scindo_proto::endpoint::bulk_endpoint;

use super::cli::DoctorArgs;
use crate::error::RuntimeError;
use crate::monitor::doctor::{Finding, State, listen, machine, papers};
use crate::wire::session::{NetworkConfig, load};

/// Looks at everything and prints it. Exit code 1 if something is wrong.
pub fn doctor(args: &DoctorArgs) -> Result<ExitCode, RuntimeError> {
    let findings = examine(args);
    let worst = findings.iter().map(|finding| finding.state).max().unwrap_or(State::Ok);
    if args.json {
        say!("{}", serde_json::json!({ "state": worst, "findings": findings }));
    } else {
        for Finding { state, about, found, next } in &findings {
            say!("{:<8} {about:<12} {found}", state.as_str());
            if !next.is_empty() {
                say!("{:22}{next}", "");
            }
        }
    }
    Ok(if worst == State::Wrong { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

fn examine(args: &DoctorArgs) -> Vec<Finding> {
    let mut findings = Vec::new();
    let config = args.zenoh.as_deref().map(load).transpose().unwrap_or_else(|error| {
        findings.push(Finding::wrong("zenoh", error.to_string(), "Correct the file or its name"));
        None
    });
    let config = config.unwrap_or_default();
    findings.extend(papers::files(&config));
    let readable = findings.is_empty() || findings.iter().all(|finding| finding.about != "zenoh");
    let network = NetworkConfig {
        listen: args.listen.clone(),
        connect: args.connect.clone(),
        zenoh_file: args.zenoh.clone().filter(|_| readable),
        ..NetworkConfig::default()
    };
    let guard = papers::guard(&config);
    for endpoint in network.settled().map(|network| network.listen).unwrap_or_default() {
        findings.extend(listen::endpoint(&endpoint, guard));
        findings.extend(bulk_endpoint(&endpoint).iter().flat_map(|bulk| listen::endpoint(bulk, guard)));
    }
    findings.extend(args.connect.iter().map(|endpoint| listen::connect(endpoint)));
    findings.extend(args.viewer.into_iter().flat_map(listen::page));
    findings.extend(machine::inside());
    findings.extend(machine::processor());
    findings.extend(machine::limits(&fs::read_to_string("/proc/self/limits").unwrap_or_default()));
    findings.extend(machine::devices(Path::new("/dev")));
    findings.push(machine::disk(&args.record));
    findings
}

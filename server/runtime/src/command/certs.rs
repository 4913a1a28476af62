//! `scindo certs` sets up a laboratory with certificates, and admits clients to it.

use std::collections::BTreeMap;
use std::process::ExitCode;
use std::time::Duration;

use super::cli::CertsArgs;
use super::say::say;
use crate::error::RuntimeError;
use crate::lab::folder::{Folder, Lab, LabError};
use crate::lab::roles::SERVER;

/// Makes what is missing, and prints how to use it.
pub fn certs(args: &CertsArgs) -> Result<ExitCode, RuntimeError> {
    let life = Duration::from_secs(86_400 * u64::from(args.days));
    let mut folder = match Folder::open(&args.dir)? {
        None => Folder::create(&args.dir, wanted(args)?, life)?,
        Some(folder) => {
            agree(folder.lab(), args)?;
            folder
        }
    };
    for (id, role) in &args.client {
        folder.admit(id, *role, life)?;
    }
    let (lab, path) = (folder.lab(), folder.path().display());
    if args.json {
        say!("{}", serde_json::json!({ "folder": folder.path(), "lab": lab }));
        return Ok(ExitCode::SUCCESS);
    }
    say!("laboratory '{}' in {path}", lab.lab);
    say!("  server   scindo run SCENE --zenoh {path}/{SERVER}.json5 --listen tls/0.0.0.0:7447");
    let host = lab.server.first().map_or("HOST", String::as_str);
    for (id, role) in &lab.clients {
        let program = if role.touches() { "scindo-haptic" } else { "scindo-view" };
        say!("  {role:<8} {program} --zenoh {path}/{id}.json5 --id {id} --connect tls/{host}:7447");
    }
    say!(
        "Give each client its own three files and ca.pem, and keep ca.key off line. Start the server anew after"
    );
    say!("a client was added.");
    Ok(ExitCode::SUCCESS)
}

fn wanted(args: &CertsArgs) -> Result<Lab, RuntimeError> {
    let Some(lab) = args.lab.clone() else {
        return Err(RuntimeError::Option {
            option: "DIR",
            value: args.dir.display().to_string(),
            reason: "there is no laboratory".to_owned(),
            next: "Set one up with --lab NAME --server HOST".to_owned(),
        });
    };
    let (realm, session) = (args.realm.clone(), args.session.clone());
    Ok(Lab { lab, realm, session, server: args.server.clone(), clients: BTreeMap::new() })
}

/// What is given for a laboratory that exists must be what it was set up with.
fn agree(lab: &Lab, args: &CertsArgs) -> Result<(), RuntimeError> {
    let differs = |option: &'static str, value: String, known: String| {
        Err(RuntimeError::Option {
            option,
            value,
            reason: format!("the laboratory was set up with {known}"),
            next: "Leave it out, or set up another laboratory in an empty folder".to_owned(),
        })
    };
    if let Some(name) = args.lab.as_ref().filter(|name| **name != lab.lab) {
        return differs("--lab", name.clone(), lab.lab.clone());
    }
    if !args.server.is_empty() && args.server != lab.server {
        return differs("--server", args.server.join(", "), lab.server.join(", "));
    }
    Ok(())
}

impl From<LabError> for RuntimeError {
    fn from(error: LabError) -> Self {
        match error {
            LabError::Key(error) => Self::Key(error),
            LabError::Request(reason) | LabError::Certificate { reason, .. } => Self::Lab(reason),
            error => Self::System { what: "setting up the laboratory".to_owned(), reason: error.to_string() },
        }
    }
}

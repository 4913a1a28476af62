//! `scindo certs` sets up a laboratory with certificates, and admits clients to it; or a house of laboratories, and
//! admits guests.

use std::collections::BTreeMap;
use std::process::ExitCode;
use std::time::Duration;

use scindo_program::say;

use super::cli::CertsArgs;
use crate::error::RuntimeError;
use crate::lab::folder::{Folder, LabError};
use crate::lab::house::House;
use crate::lab::members::Lab;
use crate::lab::roles::{ROUTER, SERVER};

/// Makes what is missing, and prints how to use it.
pub fn certs(args: &CertsArgs) -> Result<ExitCode, RuntimeError> {
    let life = Duration::from_secs(86_400 * u64::from(args.days));
    let house = House::open(&args.dir)?;
    if house.is_some() || args.house.is_some() || !args.guest.is_empty() {
        return certs_of_house(args, house, life);
    }
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
    let house = folder.house()?;
    let router = house.as_ref().and_then(|house| house.residents().router.first());
    let (link, realm) = match router {
        Some(host) => (format!("--connect quic/{host}:7447"), format!(" --realm {}", lab.realm)),
        None => ("--listen quic/0.0.0.0:7447".to_owned(), String::new()),
    };
    say!("  server   scindo run SCENE --zenoh {path}/{SERVER}.json5{realm} {link}");
    let host = router.or(lab.server.first()).map_or("HOST", String::as_str);
    for (id, role) in &lab.clients {
        let program = if role.touches() { "scindo-haptic" } else { "scindo-view" };
        say!("  {role:<8} {program} --zenoh {path}/{id}.json5 --id {id}{realm} --connect quic/{host}:7447");
    }
    say!(
        "Give each client its own three files and ca.pem, and keep ca.key off line. After a client was added,"
    );
    say!("start the server anew{}.", if router.is_some() { ", and the router of the house" } else { "" });
    Ok(ExitCode::SUCCESS)
}

/// The same for a house.
fn certs_of_house(args: &CertsArgs, house: Option<House>, life: Duration) -> Result<ExitCode, RuntimeError> {
    let wrong = |reason: &str, next: &str| RuntimeError::Option {
        option: "DIR",
        value: args.dir.display().to_string(),
        reason: reason.to_owned(),
        next: next.to_owned(),
    };
    let mut house = match (house, &args.house) {
        (Some(house), None) => house,
        (Some(house), Some(name)) if *name == house.residents().house && args.router.is_empty() => house,
        (Some(_), Some(_)) => {
            return Err(wrong(
                "there is a house already",
                "Leave --house and --router out, or take an empty folder",
            ));
        }
        (None, Some(_)) if args.router.is_empty() => {
            return Err(wrong("a new house needs the names of its router", "Add --router HOST"));
        }
        (None, Some(name)) => House::create(&args.dir, name, &args.router, life)?,
        (None, None) => {
            return Err(wrong("there is no house", "Set one up with --house NAME --router HOST"));
        }
    };
    for (id, realms) in &args.guest {
        house.welcome(id, realms, life)?;
    }
    let (residents, path) = (house.residents(), house.path().display());
    if args.json {
        let labs = house.labs()?;
        say!("{}", serde_json::json!({ "folder": house.path(), "house": residents, "labs": labs }));
        return Ok(ExitCode::SUCCESS);
    }
    say!("house '{}' in {path}", residents.house);
    say!("  router   scindo router --zenoh {path}/{ROUTER}.json5 --listen quic/0.0.0.0:7447");
    for lab in house.labs()? {
        say!("  lab      '{}', realm {}, {} clients", lab.lab, lab.realm, lab.clients.len());
    }
    let host = residents.router.first().map_or("HOST", String::as_str);
    for (id, realms) in &residents.guests {
        for realm in realms {
            say!(
                "  guest    scindo-view --zenoh {path}/{id}.json5 --id {id} --realm {realm} --connect quic/{host}:7447"
            );
        }
    }
    say!(
        "Add a laboratory: scindo certs {path}/NAME --lab NAME --client ID=ROLE. Start the router anew afterwards."
    );
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
    let realm = match (&args.realm, House::around(&args.dir)?) {
        (Some(realm), _) => realm.clone(),
        (None, Some(_)) => lab.clone(),
        (None, None) => "scindo".to_owned(),
    };
    let session = args.session.clone();
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

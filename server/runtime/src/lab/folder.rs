//! The folder of a laboratory: certificates, private keys, and zenoh configurations that are ready for use.
//!
//! ```text
//! lab.json              who belongs to the laboratory
//! ca.pem, ca.key        its own certificate; the key signs others, keep it off line
//! server.pem, .key, server.json5     scindo run SCENE --zenoh server.json5 --listen tls/0.0.0.0:7447
//! ID.pem, ID.key, ID.json5           scindo-haptic --zenoh ID.json5 --id ID --connect tls/HOST:7447
//! ```

use std::collections::BTreeMap;
use std::fs::{self, OpenOptions};
use std::io::{self, Write as _};
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

use scindo_proto::{Chunk, KeyError, KeySpace};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use thiserror::Error;

use super::issue::{Holder, Papers, authority, issue};
use super::roles::{LabRole, SERVER};
use super::rules::access_control;

/// Who belongs to a laboratory, as `lab.json` keeps it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Lab {
    /// Name of the laboratory.
    pub lab: String,
    /// First chunk of every key.
    pub realm: String,
    /// Session within the realm.
    pub session: String,
    /// Host names and addresses of the server.
    pub server: Vec<String>,
    /// Clients by id.
    pub clients: BTreeMap<String, LabRole>,
}

/// Why a laboratory cannot be set up.
#[derive(Debug, Error)]
pub enum LabError {
    /// A file.
    #[error("{path}: {source}", path = .path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's message.
        source: io::Error,
    },
    /// `lab.json` cannot be read.
    #[error("{path}: {reason}. Restore it, or set the laboratory up in an empty folder", path = .path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// A request that contradicts the folder.
    #[error("{0}")]
    Request(String),
    /// Cryptography.
    #[error("certificate of '{name}': {reason}")]
    Certificate {
        /// Common name.
        name: String,
        /// What is wrong.
        reason: String,
    },
    /// A name that cannot stand in a key.
    #[error(transparent)]
    Key(#[from] KeyError),
}

/// The folder of a laboratory.
#[derive(Debug, Clone)]
pub struct Folder {
    path: PathBuf,
    lab: Lab,
    authority: Papers,
}

impl Folder {
    /// The laboratory in `path`; `None` if there is none.
    ///
    /// # Errors
    /// If its files cannot be read.
    pub fn open(path: &Path) -> Result<Option<Self>, LabError> {
        let file = path.join("lab.json");
        if !file.exists() {
            return Ok(None);
        }
        let text = read(&file)?;
        let unreadable =
            |error: serde_json::Error| LabError::Unreadable { path: file, reason: error.to_string() };
        let lab: Lab = serde_json::from_str(&text).map_err(unreadable)?;
        let path = path.to_owned();
        let authority = Papers { certificate: read(&path.join("ca.pem"))?, key: read(&path.join("ca.key"))? };
        Ok(Some(Self { path, lab, authority }))
    }

    /// Sets up a laboratory without clients in `path`. Certificates are valid for `life`.
    ///
    /// # Errors
    /// If it exists, a name is wrong, or a file cannot be written.
    pub fn create(path: &Path, lab: Lab, life: Duration) -> Result<Self, LabError> {
        KeySpace::new(&lab.realm, &lab.session)?;
        if lab.server.is_empty() {
            return Err(LabError::Request(
                "a new laboratory needs the names and addresses of its server: --server HOST".into(),
            ));
        }
        fs::create_dir_all(path).map_err(|source| LabError::Io { path: path.to_owned(), source })?;
        // Configurations name their files by the whole path, so that programs find them from anywhere.
        let path = path.canonicalize().map_err(|source| LabError::Io { path: path.to_owned(), source })?;
        let authority = authority(&lab.lab, life).map_err(wrong(&lab.lab))?;
        let of_server =
            issue(&authority, SERVER, Holder::Server(&lab.server), life).map_err(wrong(SERVER))?;
        let folder = Self { path, lab: Lab { clients: BTreeMap::new(), ..lab }, authority };
        folder.put_papers("ca", &folder.authority)?;
        folder.put_papers(SERVER, &of_server)?;
        folder.put_lists()?;
        Ok(folder)
    }

    /// Admits a client: makes its certificate and configuration, and the server's configuration anew.
    ///
    /// # Errors
    /// If there is a client of this id, or a file cannot be written.
    pub fn admit(&mut self, id: &str, role: LabRole, life: Duration) -> Result<(), LabError> {
        if let Some(known) = self.lab.clients.get(id) {
            return Err(LabError::Request(format!(
                "'{id}' belongs to the laboratory already, as {known}. Choose another id, or remove {id}.pem and \
                 {id}.key and the line in lab.json of {}",
                self.path.display()
            )));
        }
        Chunk::new("client id", id)?;
        let papers = issue(&self.authority, id, Holder::Client, life).map_err(wrong(id))?;
        self.put_papers(id, &papers)?;
        self.put(&format!("{id}.json5"), &of_client(&self.path, id))?;
        self.lab.clients.insert(id.to_owned(), role);
        self.put_lists()
    }

    /// Who belongs to it.
    pub fn lab(&self) -> &Lab {
        &self.lab
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes the lists that change when a client is admitted.
    fn put_lists(&self) -> Result<(), LabError> {
        let keys = KeySpace::new(&self.lab.realm, &self.lab.session)?;
        let ids = self.lab.clients.iter().map(|(id, role)| Ok((Chunk::new("client id", id)?, *role)));
        let ids: Vec<(Chunk, LabRole)> = ids.collect::<Result<_, KeyError>>()?;
        let rules = access_control(&keys, ids.iter().map(|(id, role)| (id, *role)));
        self.put("server.json5", &of_server(&self.path, rules))?;
        self.put("lab.json", &json!(self.lab))
    }

    fn put(&self, name: &str, content: &Value) -> Result<(), LabError> {
        let path = self.path.join(name);
        let draft = self.path.join(format!("{name}.part"));
        let written = fs::write(&draft, format!("{content:#}\n")).and_then(|()| fs::rename(&draft, &path));
        written.map_err(|source| LabError::Io { path, source })
    }

    /// Writes a certificate and its key, which nobody else may read. Neither may exist.
    fn put_papers(&self, name: &str, papers: &Papers) -> Result<(), LabError> {
        for (end, text, mode) in [("key", &papers.key, 0o600), ("pem", &papers.certificate, 0o644)] {
            let path = self.path.join(format!("{name}.{end}"));
            let file = OpenOptions::new().write(true).create_new(true).mode(mode).open(&path);
            file.and_then(|mut file| file.write_all(text.as_bytes()))
                .map_err(|source| LabError::Io { path, source })?;
        }
        Ok(())
    }
}

fn read(path: &Path) -> Result<String, LabError> {
    fs::read_to_string(path).map_err(|source| LabError::Io { path: path.to_owned(), source })
}

fn wrong(name: &str) -> impl FnOnce(rcgen::Error) -> LabError {
    let name = name.to_owned();
    move |error| LabError::Certificate { name, reason: error.to_string() }
}

/// Files of a TLS link, both directions.
fn tls(path: &Path, name: &str) -> Value {
    let file = |name: String| path.join(name).display().to_string();
    json!({
        "root_ca_certificate": file("ca.pem".into()),
        "listen_certificate": file(format!("{name}.pem")),
        "listen_private_key": file(format!("{name}.key")),
        "connect_certificate": file(format!("{name}.pem")),
        "connect_private_key": file(format!("{name}.key")),
        "enable_mtls": true,
        "verify_name_on_connect": true,
        "close_link_on_expiration": true,
    })
}

/// What all sessions of a laboratory share: no discovery, and no memory shared with others on the machine, which
/// access control does not see.
fn quiet(path: &Path, name: &str) -> Value {
    json!({
        "scouting": { "multicast": { "enabled": false }, "gossip": { "enabled": false }, "delay": 50 },
        "transport": {
            "link": { "protocols": ["tls"], "tls": tls(path, name), "tx": { "lease": 2000, "keep_alive": 4 } },
            "shared_memory": { "enabled": false },
        },
    })
}

fn of_server(path: &Path, rules: Value) -> Value {
    let mut config = quiet(path, SERVER);
    config["mode"] = json!("router");
    config["access_control"] = rules;
    config
}

fn of_client(path: &Path, id: &str) -> Value {
    let mut config = quiet(path, id);
    config["mode"] = json!("client");
    config["connect"] =
        json!({ "retry": { "period_init_ms": 100, "period_max_ms": 1000, "period_increase_factor": 2 } });
    config
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::os::unix::fs::PermissionsExt as _;

    use super::*;

    const YEAR: Duration = Duration::from_secs(365 * 86400);

    fn lab() -> Lab {
        Lab {
            lab: "anatomy".into(),
            realm: "scindo".into(),
            session: "main".into(),
            server: vec!["localhost".into(), "10.0.0.1".into()],
            clients: BTreeMap::new(),
        }
    }

    #[test]
    fn a_client_is_added_later_and_nothing_is_overwritten() {
        let dir = tempfile::tempdir().unwrap();
        assert!(Folder::open(dir.path()).unwrap().is_none());
        let mut folder = Folder::create(dir.path(), lab(), YEAR).unwrap();
        folder.admit("anna", LabRole::Haptic, YEAR).unwrap();
        let before = fs::read_to_string(dir.path().join("anna.pem")).unwrap();
        let mut again = Folder::open(dir.path()).unwrap().unwrap();
        assert_eq!(again.lab(), folder.lab());
        again.admit("beamer", LabRole::Viewer, YEAR).unwrap();
        let refused = again.admit("anna", LabRole::Viewer, YEAR).unwrap_err().to_string();
        assert!(refused.contains("'anna' belongs to the laboratory already, as haptic"), "{refused}");
        assert_eq!(fs::read_to_string(dir.path().join("anna.pem")).unwrap(), before);
        assert!(Folder::create(dir.path(), lab(), YEAR).is_err(), "its keys are there");
        for key in ["ca.key", "server.key", "anna.key", "beamer.key"] {
            let mode = fs::metadata(dir.path().join(key)).unwrap().permissions().mode();
            assert_eq!(mode & 0o777, 0o600, "{key}");
        }
        for config in ["server.json5", "anna.json5", "beamer.json5"] {
            zenoh::Config::from_file(dir.path().join(config)).unwrap();
        }
    }

    #[test]
    fn a_laboratory_without_a_server_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let nowhere = Lab { server: vec![], ..lab() };
        let refused = Folder::create(dir.path(), nowhere, YEAR).unwrap_err().to_string();
        assert!(refused.contains("--server HOST"), "{refused}");
        let spoiled = Lab { realm: "a/b".into(), ..lab() };
        assert!(Folder::create(dir.path(), spoiled, YEAR).is_err());
        fs::write(dir.path().join("lab.json"), "{").unwrap();
        let unreadable = Folder::open(dir.path()).unwrap_err().to_string();
        assert!(unreadable.contains("lab.json") && unreadable.contains("empty folder"), "{unreadable}");
    }
}

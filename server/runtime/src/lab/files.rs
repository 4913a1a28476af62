//! Files of a laboratory: papers that nobody else may read, and zenoh configurations that name them.

use std::fs::{self, OpenOptions};
use std::io::{self, Write as _};
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::{Path, PathBuf};

use scindo_proto::KeyError;
use serde_json::{Value, json};
use thiserror::Error;

use super::issue::Papers;

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

/// Writes `content` whole, or not at all.
///
/// # Errors
/// If the file cannot be written.
pub fn put(folder: &Path, name: &str, content: &Value) -> Result<(), LabError> {
    let path = folder.join(name);
    let draft = folder.join(format!("{name}.part"));
    let written = fs::write(&draft, format!("{content:#}\n")).and_then(|()| fs::rename(&draft, &path));
    written.map_err(|source| LabError::Io { path, source })
}

/// Writes a certificate and its key, which nobody else may read. Neither may exist.
///
/// # Errors
/// If a file exists or cannot be written.
pub fn put_papers(folder: &Path, name: &str, papers: &Papers) -> Result<(), LabError> {
    put_new(folder, &format!("{name}.key"), &papers.key, 0o600)?;
    put_new(folder, &format!("{name}.pem"), &papers.certificate, 0o644)
}

/// Writes a file that does not exist yet.
///
/// # Errors
/// If it exists or cannot be written.
pub fn put_new(folder: &Path, name: &str, text: &str, mode: u32) -> Result<(), LabError> {
    let path = folder.join(name);
    let file = OpenOptions::new().write(true).create_new(true).mode(mode).open(&path);
    file.and_then(|mut file| file.write_all(text.as_bytes())).map_err(|source| LabError::Io { path, source })
}

/// Makes a folder; its whole path, by which configurations name their files, so that programs find them from anywhere.
///
/// # Errors
/// If it cannot be made.
pub fn make(path: &Path) -> Result<PathBuf, LabError> {
    let made = fs::create_dir_all(path).and_then(|()| path.canonicalize());
    made.map_err(|source| LabError::Io { path: path.to_owned(), source })
}

/// The text of a file.
///
/// # Errors
/// If it cannot be read.
pub fn read(path: &Path) -> Result<String, LabError> {
    fs::read_to_string(path).map_err(|source| LabError::Io { path: path.to_owned(), source })
}

/// The JSON of a file.
///
/// # Errors
/// If it cannot be read.
pub fn read_json<T: serde::de::DeserializeOwned>(path: PathBuf) -> Result<T, LabError> {
    let text = read(&path)?;
    serde_json::from_str(&text).map_err(|error| LabError::Unreadable { path, reason: error.to_string() })
}

/// Certificate `name` and its key.
///
/// # Errors
/// If they cannot be read.
pub fn read_papers(folder: &Path, name: &str) -> Result<Papers, LabError> {
    let of = |end: &str| read(&folder.join(format!("{name}.{end}")));
    Ok(Papers { certificate: of("pem")?, key: of("key")? })
}

/// An error of the cryptography for the certificate of `name`.
pub fn wrong(name: &str) -> impl FnOnce(rcgen::Error) -> LabError {
    let name = name.to_owned();
    move |error| LabError::Certificate { name, reason: error.to_string() }
}

/// Files of an encrypted link, both directions.
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
            "link": { "protocols": ["quic"], "tls": tls(path, name), "tx": { "lease": 2000, "keep_alive": 4 } },
            "shared_memory": { "enabled": false },
        },
    })
}

/// Configuration of a server or router, whose papers are called `name`.
pub fn of_server(path: &Path, name: &str, rules: Value) -> Value {
    let mut config = quiet(path, name);
    config["mode"] = json!("router");
    config["access_control"] = rules;
    config
}

/// Configuration of a client.
pub fn of_client(path: &Path, id: &str) -> Value {
    let mut config = quiet(path, id);
    config["mode"] = json!("client");
    config["connect"] =
        json!({ "retry": { "period_init_ms": 100, "period_max_ms": 1000, "period_increase_factor": 2 } });
    config
}

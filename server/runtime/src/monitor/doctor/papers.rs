//! Certificates and private keys that a zenoh configuration names: present, in date, belonging together, and keys that
//! nobody else reads.

use std::fs;
use std::os::unix::fs::PermissionsExt as _;
use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

use x509_parser::pem::Pem;

use super::Finding;
use super::listen::Guard;

/// A certificate that ends within this time is reported [days].
const SOON: i64 = 30;
const DAY: i64 = 86_400;

/// Files of an encrypted link by certificate and key. Both names of a pair often are the same file.
const PAIRS: [(&str, &str); 2] =
    [("listen_certificate", "listen_private_key"), ("connect_certificate", "connect_private_key")];

/// What protects the endpoints of `config`.
pub fn guard(config: &zenoh::Config) -> Guard {
    Guard {
        certificates: flag(config, "transport/link/tls/enable_mtls"),
        access_control: flag(config, "access_control/enabled"),
    }
}

/// Looks at all files that `config` names.
pub fn files(config: &zenoh::Config) -> Vec<Finding> {
    let mut findings = Vec::new();
    if let Some(root) = file(config, "root_ca_certificate") {
        findings.extend(certificate(&root).1);
    }
    let mut seen = Vec::new();
    for (public, private) in PAIRS {
        let pair = (file(config, public), file(config, private));
        if seen.contains(&pair) {
            continue;
        }
        let holder = pair.0.as_deref().and_then(|path| {
            let (key, found) = certificate(path);
            findings.extend(found);
            key
        });
        if let Some(path) = &pair.1 {
            findings.extend(private_key(path, holder.as_deref()));
        }
        seen.push(pair);
    }
    findings
}

fn flag(config: &zenoh::Config, key: &str) -> bool {
    config.get_json(key).is_ok_and(|value| value.trim() == "true")
}

fn file(config: &zenoh::Config, name: &str) -> Option<String> {
    let value = config.get_json(&format!("transport/link/tls/{name}")).ok()?;
    serde_json::from_str::<Option<String>>(&value).ok()?
}

/// Looks at the certificates in a file. Also returns the public key of the first.
fn certificate(path: &str) -> (Option<Vec<u8>>, Vec<Finding>) {
    let wrong = |reason: String| {
        let next = "Copy it from the folder that scindo certs made, or correct the path in the zenoh file";
        (None, vec![Finding::wrong("certificate", format!("{path}: {reason}"), next)])
    };
    let text = match fs::read(path) {
        Ok(text) => text,
        Err(error) => return wrong(error.to_string()),
    };
    let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.as_secs());
    let now = i64::try_from(now).unwrap_or(i64::MAX);
    let (mut key, mut findings) = (None, Vec::new());
    for pem in Pem::iter_from_buffer(&text) {
        let pem = match pem {
            Ok(pem) => pem,
            Err(error) => return wrong(error.to_string()),
        };
        let parsed = match pem.parse_x509() {
            Ok(parsed) => parsed,
            Err(error) => return wrong(error.to_string()),
        };
        key.get_or_insert_with(|| parsed.public_key().subject_public_key.data.to_vec());
        findings.push(in_date(path, parsed.validity(), now));
    }
    if findings.is_empty() { wrong("holds no certificate".to_owned()) } else { (key, findings) }
}

/// `now` is in seconds since 1970.
fn in_date(path: &str, validity: &x509_parser::certificate::Validity, now: i64) -> Finding {
    let (from, to) = (validity.not_before, validity.not_after);
    let days = to.timestamp().saturating_sub(now) / DAY;
    let renew = "Make new ones with scindo certs in an empty folder, and give each client its files";
    if from.timestamp() > now {
        let next = "Set the clock of this machine, or wait";
        Finding::wrong("certificate", format!("{path}: valid only from {from}"), next)
    } else if to.timestamp() <= now {
        Finding::wrong("certificate", format!("{path}: expired on {to}"), renew)
    } else if days < SOON {
        Finding::warning("certificate", format!("{path}: expires in {days} days, on {to}"), renew)
    } else {
        Finding::ok("certificate", format!("{path}: expires in {days} days, on {to}"))
    }
}

/// Looks at a private key. `holder` is the public key of the certificate that it should belong to.
fn private_key(path: &str, holder: Option<&[u8]>) -> Vec<Finding> {
    let wrong = |reason: String, next: &str| Finding::wrong("key", format!("{path}: {reason}"), next);
    let restore = "Copy it from the folder that scindo certs made, beside its certificate";
    let (mode, text) = match fs::metadata(path).and_then(|about| Ok((about, fs::read_to_string(path)?))) {
        Ok((about, text)) => (about.permissions().mode() & 0o777, text),
        Err(error) => return vec![wrong(error.to_string(), restore)],
    };
    let mut findings = Vec::new();
    if mode & 0o077 != 0 {
        let next = format!("chmod 600 {}", Path::new(path).display());
        findings.push(wrong(format!("others can read or write it (mode {mode:04o})"), &next));
    }
    match rcgen::KeyPair::from_pem(&text) {
        Err(error) => findings.push(wrong(error.to_string(), restore)),
        Ok(key) if holder.is_some_and(|holder| holder != key.public_key_raw()) => {
            findings.push(wrong("is not the key of its certificate".to_owned(), restore));
        }
        Ok(_) if findings.is_empty() => {
            findings.push(Finding::ok("key", format!("{path}: readable only by its owner")));
        }
        Ok(_) => {}
    }
    findings
}

//! What a client of a laboratory may do.

use std::collections::BTreeSet;
use std::fmt;

use scindo_proto::Chunk;
use serde::{Deserialize, Serialize};

/// What a client may do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LabRole {
    /// Watches: surfaces, tools, forces, reports, and questions.
    Viewer,
    /// Watches, moves tools, touches and cuts.
    Haptic,
    /// Watches, and gives orders: pause, step, reset, undo, set, load.
    Operator,
    /// All of these.
    Teacher,
}

impl LabRole {
    /// All roles.
    pub const ALL: [Self; 4] = [Self::Viewer, Self::Haptic, Self::Operator, Self::Teacher];

    /// Its name.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Viewer => "viewer",
            Self::Haptic => "haptic",
            Self::Operator => "operator",
            Self::Teacher => "teacher",
        }
    }

    /// Whether it may move tools, touch and cut.
    pub fn touches(self) -> bool {
        matches!(self, Self::Haptic | Self::Teacher)
    }

    /// Whether it may give orders.
    pub fn orders(self) -> bool {
        matches!(self, Self::Operator | Self::Teacher)
    }
}

impl fmt::Display for LabRole {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.as_str())
    }
}

/// Longest id of a client: names of the mice of its pages are appended to it.
const MAX_CLIENT_BYTES: usize = 48;

/// Parses `ID=ROLE`.
///
/// # Errors
/// What is wrong, and what is allowed.
pub fn parse_client(text: &str) -> Result<(String, LabRole), String> {
    let (id, role) = text.split_once('=').ok_or("expected ID=ROLE, such as anna=haptic")?;
    let known = LabRole::ALL.into_iter().find(|known| known.as_str() == role);
    let names = LabRole::ALL.map(LabRole::as_str).join(", ");
    let role = known.ok_or_else(|| format!("'{role}' is no role; the roles are {names}"))?;
    Chunk::new("client id", id).map_err(|error| error.to_string())?;
    if id.len() > MAX_CLIENT_BYTES || id == SERVER {
        return Err(format!(
            "'{id}' cannot be the id of a client: at most {MAX_CLIENT_BYTES} characters, and not '{SERVER}'"
        ));
    }
    Ok((id.to_owned(), role))
}

/// Parses `ID=REALM,REALM…`: a guest of a house, and the laboratories that it watches.
///
/// # Errors
/// What is wrong, and what is allowed.
pub fn parse_guest(text: &str) -> Result<(String, BTreeSet<String>), String> {
    let (id, realms) =
        text.split_once('=').ok_or("expected ID=REALM,REALM such as beamer=anatomy,surgery")?;
    let (id, _) = parse_client(&format!("{id}=viewer"))?;
    let realms: BTreeSet<String> = realms.split(',').map(str::to_owned).collect();
    if realms.iter().any(String::is_empty) {
        return Err("expected the realms that the guest watches, such as beamer=anatomy,surgery".to_owned());
    }
    Ok((id, realms))
}

/// Common name of the server's own certificate.
pub const SERVER: &str = "server";

/// Common name of the router of a house.
pub const ROUTER: &str = "router";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clients_are_an_id_and_a_role() {
        assert_eq!(parse_client("anna=haptic"), Ok(("anna".into(), LabRole::Haptic)));
        for (text, says) in [
            ("anna", "ID=ROLE"),
            ("anna=boss", "viewer, haptic, operator, teacher"),
            ("Anna=viewer", "a-z, 0-9"),
            ("server=viewer", "server"),
            (&format!("{}=viewer", "a".repeat(49)), "at most 48"),
        ] {
            let error = parse_client(text).expect_err(text);
            assert!(error.contains(says), "{text}: {error}");
        }
    }
}

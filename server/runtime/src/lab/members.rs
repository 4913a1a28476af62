//! Who belongs to a laboratory.

use std::collections::BTreeMap;

use scindo_proto::{Chunk, KeyError, KeySpace};
use serde::{Deserialize, Serialize};

use super::roles::{LabRole, SERVER};

/// Who belongs to a laboratory, as `lab.json` keeps it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Lab {
    /// Name of the laboratory.
    pub lab: String,
    /// First chunk of every key.
    pub realm: String,
    /// Session within the realm.
    pub session: String,
    /// Host names and addresses of the server. In a house there may be none: clients then come through its router.
    pub server: Vec<String>,
    /// Clients by id.
    pub clients: BTreeMap<String, LabRole>,
}

impl Lab {
    /// Its keys.
    ///
    /// # Errors
    /// If realm or session cannot stand in a key.
    pub fn keys(&self) -> Result<KeySpace, KeyError> {
        KeySpace::new(&self.realm, &self.session)
    }

    /// Common name of the server's certificate in a house: no two laboratories have the same.
    pub fn server_name(&self) -> String {
        format!("{SERVER}-{}", self.realm)
    }

    /// Its clients as rules need them.
    ///
    /// # Errors
    /// If an id cannot stand in a key.
    pub fn chunks(&self) -> Result<Vec<(Chunk, LabRole)>, KeyError> {
        self.clients.iter().map(|(id, role)| Ok((Chunk::new("client id", id)?, *role))).collect()
    }
}

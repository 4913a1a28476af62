//! The folder of a house: several laboratories behind one router.
//!
//! ```text
//! house.json            router and guests
//! ca.pem, ca.key        the certificate of the house; the key signs all others, keep it off line
//! router.pem, .key, router.json5     scindo router --zenoh router.json5 --listen quic/0.0.0.0:7447
//! LAB/                  a laboratory, as in `folder.rs`
//! ID.pem, ID.key, ID.json5           a guest, who watches several laboratories
//! ```
//!
//! A name in a certificate is one person, one server or the router of the whole house: it is given once.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use scindo_proto::Chunk;
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::files::{LabError, make, of_client, of_server, put, put_papers, read_json, read_papers, wrong};
use super::issue::{Holder, Papers, authority, issue};
use super::members::Lab;
use super::roles::{LabRole, ROUTER, SERVER};
use super::rules::{Seats, router_access_control};

/// What `house.json` keeps.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Residents {
    /// Name of the house.
    pub house: String,
    /// Host names and addresses of the router.
    pub router: Vec<String>,
    /// Guests by id, and the realms that they watch.
    pub guests: BTreeMap<String, BTreeSet<String>>,
}

/// The folder of a house.
#[derive(Debug, Clone)]
pub struct House {
    path: PathBuf,
    residents: Residents,
    authority: Papers,
}

impl House {
    /// The house in `path`; `None` if there is none.
    ///
    /// # Errors
    /// If its files cannot be read.
    pub fn open(path: &Path) -> Result<Option<Self>, LabError> {
        let file = path.join("house.json");
        if !file.exists() {
            return Ok(None);
        }
        let residents = read_json(file)?;
        let path = make(path)?;
        let authority = read_papers(&path, "ca")?;
        Ok(Some(Self { path, residents, authority }))
    }

    /// The house whose folder contains `lab`.
    ///
    /// # Errors
    /// If its files cannot be read.
    pub fn around(lab: &Path) -> Result<Option<Self>, LabError> {
        let io = |source| LabError::Io { path: lab.to_owned(), source };
        let whole = std::path::absolute(lab).map_err(io)?;
        whole.parent().map_or(Ok(None), Self::open)
    }

    /// Sets up a house without laboratories in `path`, whose router is reached at `router`. Certificates are valid for
    /// `life`.
    ///
    /// # Errors
    /// If it exists or a file cannot be written.
    pub fn create(path: &Path, house: &str, router: &[String], life: Duration) -> Result<Self, LabError> {
        let path = make(path)?;
        let authority = authority(house, life).map_err(wrong(house))?;
        let papers = issue(&authority, ROUTER, Holder::Server(router), life).map_err(wrong(ROUTER))?;
        put_papers(&path, "ca", &authority)?;
        put_papers(&path, ROUTER, &papers)?;
        let residents =
            Residents { house: house.to_owned(), router: router.to_vec(), guests: BTreeMap::new() };
        let house = Self { path, residents, authority };
        house.put_lists()?;
        Ok(house)
    }

    /// Admits a guest who watches the laboratories of `realms`.
    ///
    /// # Errors
    /// If the id is taken, a realm is unknown, or a file cannot be written.
    pub fn welcome(&mut self, id: &str, realms: &BTreeSet<String>, life: Duration) -> Result<(), LabError> {
        Chunk::new("client id", id)?;
        self.is_free(id)?;
        let known: BTreeSet<String> = self.labs()?.into_iter().map(|lab| lab.realm).collect();
        if let Some(unknown) = realms.difference(&known).next() {
            let known = known.iter().map(String::as_str).collect::<Vec<_>>().join(", ");
            let reason = format!("'{unknown}' is no realm of the house; its realms are: {known}");
            return Err(LabError::Request(reason));
        }
        let papers = issue(&self.authority, id, Holder::Client, life).map_err(wrong(id))?;
        put_papers(&self.path, id, &papers)?;
        put(&self.path, &format!("{id}.json5"), &of_client(&self.path, id))?;
        self.residents.guests.insert(id.to_owned(), realms.clone());
        self.put_lists()
    }

    /// Whether nobody in the house has this name.
    ///
    /// # Errors
    /// Who has it.
    pub fn is_free(&self, id: &str) -> Result<(), LabError> {
        let taken = |by: String| {
            let reason = format!(
                "'{id}' is {by}, and a name is given once in a house: with the same name in two laboratories, one could \
                 do what the other may. Choose another, such as {id}-2"
            );
            Err(LabError::Request(reason))
        };
        if id == ROUTER || id == SERVER || id.starts_with(&format!("{SERVER}-")) {
            return taken("kept for the router and the servers".to_owned());
        }
        if self.residents.guests.contains_key(id) {
            return taken("a guest of the house".to_owned());
        }
        match self.labs()?.into_iter().find(|lab| lab.clients.contains_key(id)) {
            Some(lab) => taken(format!("a client of the laboratory '{}'", lab.lab)),
            None => Ok(()),
        }
    }

    /// Whether the realm of a new laboratory is its own.
    ///
    /// # Errors
    /// Which laboratory has it.
    pub fn has_room_for(&self, new: &Lab) -> Result<(), LabError> {
        match self.labs()?.into_iter().find(|lab| lab.realm == new.realm) {
            Some(lab) => Err(LabError::Request(format!(
                "the realm '{}' is that of the laboratory '{}'. Give each laboratory of a house its own: --realm NAME",
                new.realm, lab.lab
            ))),
            None => Ok(()),
        }
    }

    /// The certificate that signs all others.
    pub fn authority(&self) -> &Papers {
        &self.authority
    }

    /// Who belongs to it.
    pub fn residents(&self) -> &Residents {
        &self.residents
    }

    /// The folder on disk.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Its laboratories, by folder.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn labs(&self) -> Result<Vec<Lab>, LabError> {
        let io = |source| LabError::Io { path: self.path.clone(), source };
        let mut files = Vec::new();
        for entry in fs::read_dir(&self.path).map_err(io)? {
            let file = entry.map_err(io)?.path().join("lab.json");
            if file.exists() {
                files.push(file);
            }
        }
        files.sort();
        files.into_iter().map(read_json).collect()
    }

    /// Writes the configuration of the router anew.
    ///
    /// # Errors
    /// If a file cannot be read or written.
    pub fn put_router(&self) -> Result<(), LabError> {
        let mut seats = Vec::new();
        for lab in self.labs()? {
            let mut clients = lab.chunks()?;
            for (id, realms) in &self.residents.guests {
                if realms.contains(&lab.realm) {
                    clients.push((Chunk::new("client id", id)?, LabRole::Viewer));
                }
            }
            seats.push(Seats { keys: lab.keys()?, trusted: vec![lab.server_name()], clients });
        }
        put(&self.path, "router.json5", &of_server(&self.path, ROUTER, router_access_control(&seats)))
    }

    fn put_lists(&self) -> Result<(), LabError> {
        put(&self.path, "house.json", &json!(self.residents))?;
        self.put_router()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::lab::folder::Folder;

    const YEAR: Duration = Duration::from_secs(365 * 86400);

    fn lab(name: &str) -> Lab {
        Lab {
            lab: name.into(),
            realm: name.into(),
            session: "main".into(),
            server: vec![],
            clients: BTreeMap::new(),
        }
    }

    #[test]
    fn names_and_realms_are_given_once() {
        let dir = tempfile::tempdir().unwrap();
        let mut house = House::create(dir.path(), "campus", &["localhost".into()], YEAR).unwrap();
        let mut anatomy = Folder::create(&dir.path().join("anatomy"), lab("anatomy"), YEAR).unwrap();
        let mut surgery = Folder::create(&dir.path().join("surgery"), lab("surgery"), YEAR).unwrap();
        anatomy.admit("anna", LabRole::Haptic, YEAR).unwrap();
        let both = BTreeSet::from(["anatomy".to_owned(), "surgery".into()]);
        house.welcome("beamer", &both, YEAR).unwrap();
        let words = |error: LabError| error.to_string();
        for (id, says) in
            [("anna", "laboratory 'anatomy'"), ("beamer", "guest"), ("server-x", "kept"), ("router", "kept")]
        {
            let refused = words(surgery.admit(id, LabRole::Viewer, YEAR).unwrap_err());
            assert!(refused.contains(says), "{id}: {refused}");
        }
        let elsewhere = BTreeSet::from(["chemistry".to_owned()]);
        let refused = words(house.welcome("wall", &elsewhere, YEAR).unwrap_err());
        assert!(refused.contains("anatomy, surgery"), "{refused}");
        let twice = Folder::create(&dir.path().join("third"), lab("surgery"), YEAR).map(|_| ()).unwrap_err();
        assert!(words(twice).contains("--realm"));
        assert!(!dir.path().join("surgery/ca.key").exists(), "the key of the house stays where it is");
        assert_eq!(Folder::open(&dir.path().join("anatomy")).unwrap().unwrap().lab(), anatomy.lab());
        assert_eq!(House::open(dir.path()).unwrap().unwrap().residents(), house.residents());
        for config in ["router.json5", "beamer.json5", "anatomy/server.json5", "anatomy/anna.json5"] {
            zenoh::Config::from_file(dir.path().join(config)).unwrap();
        }
    }
}

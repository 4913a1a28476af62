//! The folder of a laboratory: certificates, private keys, and zenoh configurations that are ready for use.
//!
//! ```text
//! lab.json              who belongs to the laboratory
//! ca.pem, ca.key        its own certificate; the key signs others, keep it off line
//! server.pem, .key, server.json5     scindo run SCENE --zenoh server.json5 --listen quic/0.0.0.0:7447
//! ID.pem, ID.key, ID.json5           scindo-haptic --zenoh ID.json5 --id ID --connect quic/HOST:7447
//! ```
//!
//! In the folder of a [house](super::house), the house signs, and has `ca.key`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use scindo_proto::Chunk;
use serde_json::json;

pub use super::files::LabError;
use super::files::{make, of_client, of_server, put, put_new, put_papers, read_json, read_papers, wrong};
use super::house::House;
use super::issue::{Holder, Papers, authority, issue};
use super::members::Lab;
use super::roles::{LabRole, ROUTER, SERVER};
use super::rules::{Seats, access_control};

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
        let lab: Lab = read_json(file)?;
        let path = make(path)?;
        let house = House::around(&path)?;
        let authority = match &house {
            Some(house) => house.authority().clone(),
            None => read_papers(&path, "ca")?,
        };
        Ok(Some(Self { path, lab, authority }))
    }

    /// Sets up a laboratory without clients in `path`. Certificates are valid for `life`.
    ///
    /// # Errors
    /// If it exists, a name is wrong, or a file cannot be written.
    pub fn create(path: &Path, lab: Lab, life: Duration) -> Result<Self, LabError> {
        lab.keys()?;
        let house = House::around(path)?;
        if lab.server.is_empty() && house.is_none() {
            return Err(LabError::Request(
                "a new laboratory needs the names and addresses of its server: --server HOST".into(),
            ));
        }
        if let Some(house) = &house {
            house.has_room_for(&lab)?;
        }
        let path = make(path)?;
        let (authority, name) = match &house {
            Some(house) => (house.authority().clone(), lab.server_name()),
            None => (authority(&lab.lab, life).map_err(wrong(&lab.lab))?, SERVER.to_owned()),
        };
        let of_server = issue(&authority, &name, Holder::Server(&lab.server), life).map_err(wrong(&name))?;
        if house.is_some() {
            put_new(&path, "ca.pem", &authority.certificate, 0o644)?;
        } else {
            put_papers(&path, "ca", &authority)?;
        }
        put_papers(&path, SERVER, &of_server)?;
        let folder = Self { path, lab: Lab { clients: BTreeMap::new(), ..lab }, authority };
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
        if let Some(house) = self.house()? {
            house.is_free(id)?;
        }
        let papers = issue(&self.authority, id, Holder::Client, life).map_err(wrong(id))?;
        put_papers(&self.path, id, &papers)?;
        put(&self.path, &format!("{id}.json5"), &of_client(&self.path, id))?;
        self.lab.clients.insert(id.to_owned(), role);
        self.put_lists()
    }

    /// Who belongs to it.
    pub fn lab(&self) -> &Lab {
        &self.lab
    }

    /// The folder on disk.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The house it is in, if any, as its files are now.
    ///
    /// # Errors
    /// If they cannot be read.
    pub fn house(&self) -> Result<Option<House>, LabError> {
        House::around(&self.path)
    }

    /// Writes the lists that change when a client is admitted.
    fn put_lists(&self) -> Result<(), LabError> {
        let house = self.house()?;
        let trusted = match house {
            // The router has held its clients to their rights already.
            Some(_) => vec![self.lab.server_name(), ROUTER.to_owned()],
            None => vec![SERVER.to_owned()],
        };
        let seats = Seats { keys: self.lab.keys()?, trusted, clients: self.lab.chunks()? };
        put(&self.path, "server.json5", &of_server(&self.path, SERVER, access_control(&seats)))?;
        put(&self.path, "lab.json", &json!(self.lab))?;
        house.as_ref().map_or(Ok(()), House::put_router)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::fs;
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

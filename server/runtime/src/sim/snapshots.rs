//! States that clients have kept under a name, in memory.

use std::collections::BTreeMap;

/// Most snapshots at a time.
pub const MAX_SNAPSHOTS: usize = 16;
/// Most bytes of all of them.
pub const MAX_SNAPSHOT_BYTES: usize = 1 << 30;
/// Longest name.
const MAX_NAME: usize = 64;

/// Named states.
#[derive(Debug, Default)]
pub struct Snapshots {
    kept: BTreeMap<String, Vec<u8>>,
}

impl Snapshots {
    /// Keeps `state` as `name`, in place of an earlier one with this name.
    ///
    /// # Errors
    /// Why there is no room for it; everything that was kept stays.
    pub fn keep(&mut self, name: &str, state: Vec<u8>) -> Result<(), String> {
        check(name)?;
        if !self.kept.contains_key(name) && self.kept.len() >= MAX_SNAPSHOTS {
            return Err(format!(
                "{MAX_SNAPSHOTS} snapshots are kept already ({}), and no more than that; use one of these names again",
                self.names()
            ));
        }
        let others = self.kept.iter().filter(|(known, _)| *known != name);
        let bytes = others.map(|(_, state)| state.len()).sum::<usize>() + state.len();
        if bytes > MAX_SNAPSHOT_BYTES {
            return Err(format!(
                "the snapshots would take {} MiB, and {} MiB are allowed; use one of the names {} again",
                bytes >> 20,
                MAX_SNAPSHOT_BYTES >> 20,
                self.names()
            ));
        }
        self.kept.insert(name.to_owned(), state);
        Ok(())
    }

    /// The state that is kept as `name`.
    ///
    /// # Errors
    /// There is none.
    pub fn get(&self, name: &str) -> Result<&[u8], String> {
        check(name)?;
        self.kept.get(name).map(Vec::as_slice).ok_or_else(|| match self.kept.is_empty() {
            true => format!("no snapshot is called `{name}`, and none is kept; send rpc/snapshot first"),
            false => format!("no snapshot is called `{name}`; there are: {}", self.names()),
        })
    }

    fn names(&self) -> String {
        self.kept.keys().map(String::as_str).collect::<Vec<_>>().join(", ")
    }
}

/// What may be a name.
///
/// # Errors
/// What is wrong with it.
pub fn check(name: &str) -> Result<(), String> {
    let allowed = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || "-_".contains(c);
    if (1..=MAX_NAME).contains(&name.len()) && name.chars().all(allowed) {
        return Ok(());
    }
    let shown: String = name.chars().filter(|c| !c.is_control()).take(MAX_NAME).collect();
    Err(format!("`{shown}` cannot be the name of a snapshot: give 1 to {MAX_NAME} of a-z, 0-9, - and _"))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn names_number_and_bytes_are_bounded() {
        let mut snapshots = Snapshots::default();
        assert!(snapshots.get("a").unwrap_err().contains("rpc/snapshot"));
        for bad in ["", "A", "a b", "ä", &"x".repeat(65)] {
            assert!(snapshots.keep(bad, vec![1]).unwrap_err().contains("cannot be the name"), "{bad}");
        }
        for k in 0..MAX_SNAPSHOTS {
            snapshots.keep(&format!("s{k}"), vec![k as u8]).unwrap();
        }
        assert!(snapshots.keep("more", vec![1]).unwrap_err().contains("16 snapshots"));
        snapshots.keep("s3", vec![9]).unwrap();
        assert_eq!(snapshots.get("s3").unwrap(), [9]);
        assert!(snapshots.get("s99").unwrap_err().contains("s0, s1"));
        assert!(snapshots.keep("s3", vec![0; MAX_SNAPSHOT_BYTES]).unwrap_err().contains("MiB"));
        assert_eq!(snapshots.get("s3").unwrap(), [9]);
    }
}

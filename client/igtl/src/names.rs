//! Names of devices (20 bytes of anything) and ids of tools and bodies (64 of a–z, 0–9, `_`, `-`).

use crate::wire::encode::start_of;
use crate::wire::header::{NAME_BYTES, check_sum};

/// Longest id of scindo [bytes].
const ID_BYTES: usize = 64;

/// The device name of an id. One that does not fit is cut, and ends with a check sum of the whole, so that different
/// ids have different names.
pub fn device_of(prefix: &str, id: &str) -> String {
    if prefix.len() + id.len() <= NAME_BYTES {
        return format!("{prefix}{id}");
    }
    let sum = format!("~{:04x}", check_sum(id.as_bytes()) & 0xffff);
    format!("{prefix}{}{sum}", start_of(id, NAME_BYTES - sum.len() - prefix.len()))
}

/// The id that a device name stands for: in small letters, with `-` for all that an id may not contain; `None` if
/// nothing of it may.
pub fn id_of(device: &str) -> Option<String> {
    let letter = |c: char| match c.to_ascii_lowercase() {
        c @ ('a'..='z' | '0'..='9' | '_' | '-') => c,
        _ => '-',
    };
    let id: String = device.trim().chars().map(letter).take(ID_BYTES).collect();
    id.chars().any(|c| c != '-').then_some(id)
}

/// A tool that a device moves, as the command line says it: `DEVICE=ID`, or `DEVICE` alone.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Assigned {
    /// Name of the device.
    pub device: String,
    /// Id of the tool.
    pub tool: String,
}

/// Reads `DEVICE=ID` or `DEVICE`.
///
/// # Errors
/// A device name that no message can have, or an id that no tool can have.
pub fn parse_assigned(text: &str) -> Result<Assigned, String> {
    let (device, tool) = match text.rsplit_once('=') {
        Some((device, tool)) => (device, Some(tool.to_owned())),
        None => (text, id_of(text)),
    };
    if device.is_empty() || device.len() > NAME_BYTES {
        return Err(format!("a device name has 1 to {NAME_BYTES} bytes, this one {}", device.len()));
    }
    match tool {
        Some(tool) if scindo_proto::Chunk::new("tool id", &tool).is_ok() => {
            Ok(Assigned { device: device.to_owned(), tool })
        }
        _ => Err("expected DEVICE=TOOL, where TOOL has 1 to 64 characters of a-z, 0-9, _ and -".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_fit_and_stay_apart() {
        assert_eq!(device_of("scindo-", "probe"), "scindo-probe");
        let (left, right) = ("a-long-name-of-a-tool-left", "a-long-name-of-a-tool-right");
        let names = [device_of("scindo-", left), device_of("scindo-", right)];
        assert!(
            names[0] != names[1] && names.iter().all(|n| n.len() == 20 && n.starts_with("scindo-a-long"))
        );
    }

    #[test]
    fn device_names_become_ids() {
        assert_eq!(id_of("Stylus Tip"), Some("stylus-tip".into()));
        assert_eq!(id_of("  \u{fffd} "), None);
        assert_eq!(id_of(""), None);
        let assigned = |device: &str, tool: &str| Assigned { device: device.into(), tool: tool.into() };
        assert_eq!(parse_assigned("Stylus=probe"), Ok(assigned("Stylus", "probe")));
        assert_eq!(parse_assigned("Stylus"), Ok(assigned("Stylus", "stylus")));
        for bad in ["", "=probe", "Stylus=Probe", "Stylus=", "a name with more than twenty bytes=probe"] {
            assert!(parse_assigned(bad).is_err(), "{bad}");
        }
    }
}

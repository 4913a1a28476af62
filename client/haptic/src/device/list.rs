//! What there is to touch with: devices that are found, and what is missing, in plain words.

use std::fmt;
use std::fs::{self, OpenOptions};
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::haply::exchange::{Lost, Session};

/// Folder of raw HID devices in sysfs.
const SYS: &str = "/sys/class/hidraw";

/// Folder of their nodes.
const DEV: &str = "/dev";

/// Most nodes that are looked at.
const MAX_NODES: usize = 64;

/// Vendors whose HID devices are haptic, by their USB number in lower-case hexadecimal. 3D Systems: Touch HID and Touch.
const VENDORS: [(&str, &str); 1] = [("2988", "3D Systems")];

/// A line of the list.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Found {
    /// What to say to `--device`, or the node.
    pub device: String,
    /// Whether it can be used now.
    pub is_ready: bool,
    /// What it is, and what is missing.
    pub words: String,
}

/// Everything that is there.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct DeviceList {
    /// One entry per device.
    pub devices: Vec<Found>,
}

impl DeviceList {
    /// Looks for devices. `haply` is where Haply's service should be. It takes a second at most, unless a name has to be
    /// looked up.
    pub fn look(haply: &str) -> Self {
        let mut devices = vec![simulated(), mouse()];
        devices.extend(haply_service(haply));
        devices.extend(hidraw(Path::new(SYS), Path::new(DEV)));
        Self { devices }
    }
}

impl fmt::Display for DeviceList {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = self.devices.iter().map(|found| found.device.chars().count()).max().unwrap_or(0);
        for (number, Found { device, is_ready, words }) in self.devices.iter().enumerate() {
            let end = if number + 1 < self.devices.len() { "\n" } else { "" };
            let state = if *is_ready { "ready  " } else { "missing" };
            write!(f, "{device:width$}  {state}  {words}{end}")?;
        }
        Ok(())
    }
}

fn simulated() -> Found {
    let words = "a simulated hand that follows --path and feels the force";
    Found { device: "sim".into(), is_ready: true, words: words.into() }
}

fn mouse() -> Found {
    let words =
        "in the page of `scindo --viewer` or `scindo-view`, without force; not a --device of this program";
    Found { device: "mouse".into(), is_ready: true, words: words.into() }
}

fn haply_service(address: &str) -> Vec<Found> {
    let missing = |words: String| vec![Found { device: "haply".into(), is_ready: false, words }];
    match Session::open(address) {
        Ok((_, inventory)) if inventory.inverse3.is_empty() => missing(format!(
            "the Inverse Service answers at {address}, but has no Inverse3: plug it in, switch it on"
        )),
        Ok((_, inventory)) => {
            let found = |device: &super::haply::service::Inverse3| {
                let status = device.status;
                let lacks = [
                    (status.ready, "is not ready"),
                    (status.calibrated, "is not calibrated (Haply Hub does it)"),
                    (status.power_supply, "has no power supply, so no force"),
                ];
                let lacks: Vec<&str> =
                    lacks.iter().filter(|(is_so, _)| !is_so).map(|(_, words)| *words).collect();
                let words = match lacks.is_empty() {
                    true => format!("Inverse3 at {address}"),
                    false => format!("Inverse3 at {address} {}", lacks.join(", ")),
                };
                let id: String = device.device_id.chars().filter(|c| !c.is_control()).take(64).collect();
                Found { device: format!("haply:{address}/{id}"), is_ready: status.ready, words }
            };
            inventory.inverse3.iter().map(found).collect()
        }
        Err(Lost::Unreachable { source, .. }) => missing(format!(
            "no Inverse Service at {address} ({source}): install and start it, or say where it is with --haply HOST:PORT"
        )),
        Err(error) => missing(format!("what answers at {address} is no Inverse Service: {error}")),
    }
}

/// Raw HID devices: those of vendors of haptic devices, and how many others there are.
fn hidraw(sys: &Path, dev: &Path) -> Vec<Found> {
    let mut nodes: Vec<PathBuf> = match fs::read_dir(sys) {
        Ok(folder) => folder.flatten().map(|entry| entry.path()).take(MAX_NODES).collect(),
        Err(_) => {
            let words =
                format!("{} cannot be read: no HID devices, or a container without them", sys.display());
            return vec![Found { device: "hidraw".into(), is_ready: false, words }];
        }
    };
    nodes.sort();
    if nodes.is_empty() {
        let words = "no HID device is plugged in".to_owned();
        return vec![Found { device: "hidraw".into(), is_ready: false, words }];
    }
    nodes.iter().filter_map(|node| Some(hid_node(node, &dev.join(node.file_name()?)))).collect()
}

fn hid_node(sys: &Path, node: &Path) -> Found {
    let about = fs::read_to_string(sys.join("device/uevent")).unwrap_or_default();
    let value = |key: &str| about.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix('='));
    let name = value("HID_NAME").unwrap_or("without a name");
    // HID_ID=BUS:VENDOR:PRODUCT, hexadecimal with leading zeros.
    let id = value("HID_ID").and_then(|id| id.split(':').nth(1)).unwrap_or_default().to_ascii_lowercase();
    let vendor = VENDORS.iter().find(|(number, _)| id.trim_start_matches('0') == *number);
    let rights = match OpenOptions::new().read(true).write(true).open(node) {
        Ok(_) => "may be read and written".to_owned(),
        Err(error) if error.kind() == std::io::ErrorKind::PermissionDenied => {
            "no right to open it: a udev rule should give it to your group, such as KERNEL==\"hidraw*\", \
             ATTRS{idVendor}==\"VENDOR\", MODE=\"0660\", TAG+=\"uaccess\""
                .replace("VENDOR", id.get(id.len().saturating_sub(4)..).unwrap_or("...."))
        }
        Err(error) => format!("cannot be opened: {error}"),
    };
    let what = match vendor {
        Some((_, vendor)) => {
            format!("HID device '{name}' of {vendor}; {rights}; this program has no driver for it")
        }
        None => format!("HID device '{name}', not known as haptic; {rights}"),
    };
    Found { device: node.display().to_string(), is_ready: false, words: what }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::haply::fake::{FakeService, Version};

    fn node(sys: &Path, name: &str, uevent: &str) {
        fs::create_dir_all(sys.join(name).join("device")).unwrap();
        fs::write(sys.join(name).join("device/uevent"), uevent).unwrap();
    }

    #[test]
    fn hid_nodes_have_names_vendors_and_rights() {
        let folder = tempfile::tempdir().unwrap();
        let (sys, dev) = (folder.path().join("sys"), folder.path().join("dev"));
        assert!(hidraw(&sys, &dev)[0].words.contains("cannot be read"));
        fs::create_dir_all(&sys).unwrap();
        fs::create_dir_all(&dev).unwrap();
        assert!(hidraw(&sys, &dev)[0].words.contains("no HID device"));
        node(&sys, "hidraw1", "HID_ID=0003:00002988:00000301\nHID_NAME=Touch HID\n");
        node(&sys, "hidraw0", "HID_ID=0003:0000046D:0000C077\nHID_NAME=Mouse\n");
        fs::write(dev.join("hidraw1"), "").unwrap();
        let found = hidraw(&sys, &dev);
        assert!(found[0].words.contains("'Mouse', not known as haptic; cannot be opened"), "{:?}", found[0]);
        assert!(
            found[1].words.contains("'Touch HID' of 3D Systems; may be read and written"),
            "{:?}",
            found[1]
        );
        assert!(found[1].device.ends_with("dev/hidraw1") && !found[1].is_ready);
    }

    #[test]
    fn the_service_of_haply_and_its_device_are_told() {
        let service = FakeService::start(Version::New);
        let found = haply_service(&service.address);
        assert_eq!(found[0].device, format!("haply:{}/049D", service.address));
        assert!(found[0].is_ready && found.len() == 1, "{found:?}");
        service.set(|world| world.is_ready = false);
        assert!(haply_service(&service.address)[0].words.contains("is not ready"));
        service.set(|world| world.is_there = false);
        assert!(haply_service(&service.address)[0].words.contains("has no Inverse3"));
        let address = service.address.clone();
        drop(service);
        let gone = haply_service(&address);
        assert!(!gone[0].is_ready && gone[0].words.contains("install and start it"), "{gone:?}");
    }

    #[test]
    fn the_list_is_aligned_text() {
        let list = DeviceList { devices: vec![simulated(), mouse()] };
        let lines: Vec<String> = list.to_string().lines().map(String::from).collect();
        assert!(
            lines[0].starts_with("sim    ready    a simulated") && lines[1].starts_with("mouse  ready    in")
        );
    }
}

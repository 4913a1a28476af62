//! What the machine offers: cores and instructions, limits of real time, devices, room on the disk.

use std::fs::{self, OpenOptions};
use std::path::Path;
use std::thread::available_parallelism;

use super::Finding;

/// Memory that a haptic client locks [bytes], with room to spare.
const LOCKED: u64 = 64 << 20;
/// Room for about an hour of a small recording, and what a recording needs at least [bytes].
const ROOMY: u64 = 1 << 30;
const TIGHT: u64 = 64 << 20;

/// Cores and vector instructions.
pub fn processor() -> Vec<Finding> {
    let cores = available_parallelism().map_or(1, usize::from);
    let cores = if cores >= 2 {
        Finding::ok("cores", format!("{cores}"))
    } else {
        let next = "Give this machine two: the step and the contact with hands run side by side";
        Finding::warning("cores", "1", next)
    };
    vec![cores, instructions()]
}

#[cfg(target_arch = "x86_64")]
fn instructions() -> Finding {
    if std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma") {
        let wide = std::arch::is_x86_feature_detected!("avx512f");
        return Finding::ok("processor", if wide { "has AVX-512" } else { "has AVX2 and FMA" });
    }
    let next = "Expect longer steps. In a virtual machine, pass the processor of the host through";
    Finding::warning("processor", "lacks AVX2 or FMA", next)
}

#[cfg(not(target_arch = "x86_64"))]
fn instructions() -> Finding {
    Finding::ok("processor", format!("{}: kernels for any processor are used", std::env::consts::ARCH))
}

/// Limits of real-time priority and locked memory, from the text of `/proc/self/limits`.
pub fn limits(text: &str) -> Vec<Finding> {
    let soft = |name: &str| -> Option<u64> {
        let value = text.lines().find_map(|line| line.strip_prefix(name))?.split_whitespace().next()?;
        if value == "unlimited" { Some(u64::MAX) } else { value.parse().ok() }
    };
    let one = |name: &str, about: &'static str, least: u64, line: &str| match soft(name) {
        Some(value) if value >= least => {
            let value = if value == u64::MAX { "unlimited".to_owned() } else { value.to_string() };
            Finding::ok(about, value)
        }
        value => {
            let found = value.map_or("cannot be read".to_owned(), |value| value.to_string());
            let next = format!(
                "On a machine with a haptic device, add '{line}' to /etc/security/limits.d/scindo.conf"
            );
            Finding::warning(about, format!("{found}; a haptic device wants {least}"), next)
        }
    };
    vec![
        one("Max realtime priority", "rtprio", 50, "@audio - rtprio 50"),
        one("Max locked memory", "memlock", LOCKED, "@audio - memlock unlimited"),
    ]
}

/// Human-interface devices in `dev`, which is `/dev` but in tests.
pub fn devices(dev: &Path) -> Vec<Finding> {
    let Ok(entries) = fs::read_dir(dev) else {
        return vec![Finding::warning("device", format!("{} cannot be read", dev.display()), "Mount it")];
    };
    let mut nodes: Vec<_> = entries.flatten().map(|entry| entry.path()).collect();
    nodes.retain(|path| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("hidraw")));
    nodes.sort();
    if nodes.is_empty() {
        return vec![Finding::ok("device", "no hidraw node; only haptic devices on USB need one")];
    }
    let look = |path: &Path| match OpenOptions::new().read(true).write(true).open(path) {
        Ok(_) => Finding::ok("device", format!("{}: may be used", path.display())),
        Err(error) => Finding::warning(
            "device",
            format!("{}: {error}", path.display()),
            "If it is the haptic device, add KERNEL==\"hidraw*\", TAG+=\"uaccess\" with its idVendor to \
             /etc/udev/rules.d/70-scindo.rules and plug it in again",
        ),
    };
    nodes.iter().map(|path| look(path)).collect()
}

/// Room for recordings in the folder `path`.
pub fn disk(path: &Path) -> Finding {
    let shown = path.display();
    match rustix::fs::statvfs(path) {
        Err(error) => Finding::wrong("disk", format!("{shown}: {error}"), "Name a folder that exists"),
        Ok(disk) => room(&shown.to_string(), disk.f_bavail.saturating_mul(disk.f_frsize)),
    }
}

fn room(path: &str, free: u64) -> Finding {
    let found = format!("{path}: {} MiB free for recordings", free >> 20);
    let next = "Make room, or record elsewhere: --record DIR of doctor looks at another folder";
    match free {
        0..TIGHT => Finding::wrong("disk", found, next),
        TIGHT..ROOMY => Finding::warning("disk", found, next),
        _ => Finding::ok("disk", found),
    }
}

/// Scenes and page, which stand inside the program.
pub fn inside() -> Vec<Finding> {
    let scenes = scindo_world::scene::SHIPPED.len();
    let scenes = Finding::ok("scenes", format!("{scenes} inside the program; scindo demo --list names them"));
    let page = if scindo_view::page_is_built() {
        Finding::ok("page", "inside the program")
    } else {
        let next = "Install Node.js 18 or newer with npm and build again, or use a package";
        Finding::warning("page", "not inside the program: it was built without npm", next)
    };
    vec![scenes, page]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::monitor::doctor::State;

    #[test]
    fn limits_of_the_system_are_read() {
        let text = "Limit Soft Hard Units\nMax locked memory         8388608    8388608   bytes\n\
                    Max realtime priority     0     0\n";
        let states = |text| limits(text).into_iter().map(|finding| finding.state).collect::<Vec<_>>();
        assert_eq!(states(text), [State::Warning, State::Warning]);
        let text =
            "Max locked memory         unlimited    unlimited   bytes\nMax realtime priority     99     99\n";
        assert_eq!(states(text), [State::Ok, State::Ok]);
        assert_eq!(states(""), [State::Warning, State::Warning]);
    }

    #[test]
    fn a_full_disk_is_noticed() {
        let state = |free| room("/data", free).state;
        assert_eq!(
            [state(1 << 20), state(100 << 20), state(5 << 30)],
            [State::Wrong, State::Warning, State::Ok]
        );
    }
}

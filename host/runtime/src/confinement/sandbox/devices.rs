//! Devices: those that every plugin may use, and those that the host's user grants.
//!
//! A granted device is used through its driver, which is a large part of the kernel, and by ways of which neither
//! time nor memory is counted: docs/isolation.md says what that weakens.

use std::fs;
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::path::{Path, PathBuf};

use super::Level;
use crate::Fault;

/// Devices that every plugin may use.
pub(super) const DEVICES: [&str; 5] = [
    "/dev/null",
    "/dev/zero",
    "/dev/full",
    "/dev/random",
    "/dev/urandom",
];

/// Names that stand for the devices of a driver: the beginnings of their names in `/dev`.
const DRIVERS: [(&str, &[&str]); 3] = [
    ("nvidia", &["nvidia", "nvidia-caps/nvidia"]),
    ("dri", &["dri/card", "dri/renderD"]),
    ("amd", &["kfd", "dri/card", "dri/renderD"]),
];

/// Numbers of devices that no plugin gets: memory and messages of the kernel (but for the usual five), and
/// terminals.
const KERNEL: u32 = 1;
const USUAL: [u32; 5] = [3, 5, 7, 8, 9];
const TERMINALS: [u32; 10] = [4, 5, 136, 137, 138, 139, 140, 141, 142, 143];

/// The devices that a name of a driver or a path stands for. Under `strict` only a path will do, so that
/// whoever reads the command knows what is granted.
///
/// Fails if there is none, or if it is not one to grant.
pub fn devices(name: &str, level: Level) -> Result<Vec<PathBuf>, Fault> {
    let refused = |reason: String, hint: String| Fault::Refused {
        reason,
        hint: Some(hint),
    };
    let Some((_, begins)) = DRIVERS.iter().find(|(driver, _)| *driver == name) else {
        let path = fs::canonicalize(name).map_err(|error| {
            let drivers = DRIVERS.map(|(driver, _)| format!("`{driver}`"));
            let hint = format!("name {}, or the path of a device", drivers.join(", "));
            refused(format!("device {name}: {error}"), hint)
        })?;
        return match reason_against(&path) {
            None => Ok(vec![path]),
            Some(reason) => Err(refused(
                format!("{name} {reason}"),
                "a device is a character device, such as /dev/nvidia0".into(),
            )),
        };
    };
    let mut found: Vec<PathBuf> = begins.iter().flat_map(|begin| beginning(begin)).collect();
    found.retain(|path| reason_against(path).is_none());
    found.sort();
    if found.is_empty() {
        let hint = "its nodes in /dev are made when the driver is loaded".into();
        return Err(refused(
            format!("this machine has no device of `{name}`"),
            hint,
        ));
    }
    if level == Level::Strict {
        let options = found
            .iter()
            .map(|path| format!("--allow-device {}", path.display()));
        let options: Vec<String> = options.collect();
        return Err(refused(
            format!("`{name}` stands for several devices, and `strict` grants what is named"),
            options.join(" "),
        ));
    }
    Ok(found)
}

/// Entries of `/dev` that begin so, and go on with digits or a word of the driver's.
fn beginning(begin: &str) -> Vec<PathBuf> {
    let whole = Path::new("/dev").join(begin);
    let (Some(folder), Some(name)) = (whole.parent(), whole.file_name()) else {
        return Vec::new();
    };
    let name = name.to_string_lossy().into_owned();
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries
        .filter(|entry| entry.file_name().to_string_lossy().starts_with(&name))
        .map(|entry| entry.path())
        .collect()
}

/// The reason why a path is no device for plugins, if it is none.
fn reason_against(path: &Path) -> Option<&'static str> {
    let Ok(meta) = fs::symlink_metadata(path) else {
        return Some("cannot be looked at");
    };
    if !meta.file_type().is_char_device() {
        return Some("is no character device");
    }
    let (major, minor) = (libc::major(meta.rdev()), libc::minor(meta.rdev()));
    if major == KERNEL && !USUAL.contains(&minor) {
        return Some("is the kernel's memory or log");
    }
    TERMINALS.contains(&major).then_some("is a terminal")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(name: &str, level: Level) -> String {
        devices(name, level).expect_err("a fault").to_string()
    }

    #[test]
    fn what_is_no_device_for_plugins_is_refused_with_the_reason() {
        assert!(refused("/dev", Level::Auto).contains("no character device"));
        assert!(refused("/etc/passwd", Level::Auto).contains("no character device"));
        assert!(refused("/no/such/node", Level::Auto).contains("/no/such/node"));
        assert!(refused("nvidia2000", Level::Auto).contains("No such file"));
        for (path, reason) in [
            ("/dev/kmsg", "kernel's memory or log"),
            ("/dev/mem", "kernel's memory or log"),
            ("/dev/tty", "is a terminal"),
        ] {
            if Path::new(path).exists() {
                assert!(refused(path, Level::Auto).contains(reason), "{path}");
            }
        }
        let zero = vec![PathBuf::from("/dev/zero")];
        assert_eq!(devices("/dev/zero", Level::Strict).unwrap(), zero);
    }
}

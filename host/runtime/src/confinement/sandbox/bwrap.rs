//! The way in through the program `bwrap` (bubblewrap), for machines where it holds
//! a right to make namespaces that is refused to everybody else: set-user-identifier
//! on old or hardened systems, an AppArmor profile on Ubuntu.
//!
//! It makes the namespaces and the tree of files; the host then runs itself inside,
//! as the init, and goes on as if it had made them itself.

use std::convert::Infallible;
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd, RawFd};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::Command;

use rustix::io::Errno;
use serde::{Deserialize, Serialize};

use super::Layer;
use super::devices::DEVICES;
use super::grants::{SCRATCH, find_program};
use super::init::Inside;
use super::launch::Launch;
use super::refusal::as_errno;
use super::root::{OF_KERNEL, not_for_plugins};
use crate::confinement::child::goes_first;
use crate::confinement::target::Target;

/// First argument of the host's own program inside of what `bwrap` made.
pub(crate) const INSIDE_ARGUMENT: &str = "__inside";

/// Path of the host's program inside.
const EXECUTABLE: &str = "/run/fleetyard";

/// The arguments of the init on its command line.
#[derive(Debug, Serialize, Deserialize)]
struct Handed {
    launch: Launch,
    wanted: Vec<Layer>,
    link: RawFd,
    gate: RawFd,
}

/// True if there is such a program.
pub(super) fn exists() -> bool {
    find_program("bwrap").is_some()
}

/// Starts the init in it; the process that is returned is `bwrap` itself, which ends
/// when the init does and takes it along.
pub(super) fn spawn(
    launch: &Launch,
    wanted: &[Layer],
    link: &OwnedFd,
    gate: &OwnedFd,
) -> Result<i32, Errno> {
    let program = find_program("bwrap").ok_or(Errno::NOENT)?;
    let handed = Handed {
        launch: launch.clone(),
        wanted: wanted.to_vec(),
        link: link.as_raw_fd(),
        gate: gate.as_raw_fd(),
    };
    let text = serde_json::to_string(&handed).map_err(|_| Errno::INVAL)?;
    let own = std::env::current_exe().map_err(|error| as_errno(&error))?;
    let mut command = Command::new(program);
    command.args(["--unshare-user-try", "--unshare-pid", "--unshare-ipc"]);
    command.args(["--unshare-uts", "--unshare-cgroup-try", "--as-pid-1"]);
    command.args(["--die-with-parent", "--new-session"]);
    if !launch.policy.network {
        command.arg("--unshare-net");
    }
    // As in our own tree: the scratch folder first, some grants may be below it. Its
    // size is watched, not fixed: `--size` is refused to those for whom bwrap is there.
    command.args(["--tmpfs", SCRATCH]);
    command.args(["--proc", "/proc"]);
    cover_proc(&mut command);
    for path in &launch.grants.read {
        match std::fs::read_link(path) {
            Ok(to) => command.arg("--symlink").arg(to).arg(path),
            Err(_) => command.arg("--ro-bind").arg(path).arg(path),
        };
    }
    for device in DEVICES {
        command.args(["--dev-bind-try", device, device]);
    }
    for device in &launch.policy.devices {
        command.arg("--dev-bind-try").args([device, device]);
    }
    command.arg("--ro-bind").arg(own).arg(EXECUTABLE);
    command.args(["--remount-ro", "/proc", "--remount-ro", "/"]);
    command.args(["--chdir", SCRATCH, "--", EXECUTABLE]);
    command.arg(INSIDE_ARGUMENT).arg(text);
    let descriptors = [link.as_raw_fd(), gate.as_raw_fd()];
    // SAFETY: `fcntl` and writing to a file are async-signal-safe; only the child's copies
    // of the descriptors stay open.
    unsafe {
        command.pre_exec(move || {
            // It may not be written to once `bwrap` has more rights than we; what became
            // of it is looked at later.
            let _ = goes_first(c"/proc/self/oom_score_adj");
            for descriptor in descriptors {
                if libc::fcntl(descriptor, libc::F_SETFD, 0) < 0 {
                    return Err(std::io::Error::last_os_error());
                }
            }
            Ok(())
        });
    }
    let child = command.spawn().map_err(|error| as_errno(&error))?;
    Ok(child.id() as i32)
}

/// As in our own tree: of `/proc` the processes, and what runtimes go by.
fn cover_proc(command: &mut Command) {
    for (name, is_folder) in not_for_plugins("/proc").unwrap_or_default() {
        let at = format!("/proc/{name}");
        if !is_folder {
            command.args(["--ro-bind", "/dev/null", &at]);
            continue;
        }
        command.args(["--tmpfs", &at]);
        if name == "sys" {
            for name in OF_KERNEL {
                let file = format!("{at}/{name}");
                command.args(["--ro-bind-try", &file, &file]);
            }
        }
        command.args(["--remount-ro", &at]);
    }
}

/// The init's life inside of what `bwrap` made. Never returns.
pub(crate) fn enter(
    mut arguments: impl Iterator<Item = String>,
    become_plugin: &dyn Fn(&Target) -> Infallible,
) -> ! {
    let handed = arguments
        .next()
        .and_then(|text| serde_json::from_str::<Handed>(&text).ok())
        .filter(|handed| handed.link > 2 && handed.gate > 2);
    let Some(handed) = handed else {
        eprintln!("{INSIDE_ARGUMENT} is how the host starts itself; it is not a command");
        std::process::exit(2);
    };
    // SAFETY: the supervisor left these open for us alone.
    let (link, gate) = unsafe {
        (
            OwnedFd::from_raw_fd(handed.link),
            OwnedFd::from_raw_fd(handed.gate),
        )
    };
    for descriptor in [&link, &gate] {
        // They are not for the plugin, should it be a program.
        let _ = rustix::io::fcntl_setfd(descriptor, rustix::io::FdFlags::CLOEXEC);
    }
    let inside = Inside {
        launch: &handed.launch,
        wanted: &handed.wanted,
        scratch: Path::new(SCRATCH),
        link: &link,
        gate: &gate,
        become_user: None,
    };
    inside.run(None, &|| become_plugin(&handed.launch.target))
}

//! Layers and limits of a sandbox, and what became of them in a run.

use std::path::PathBuf;

use fleetyard_core::words;
use serde::{Deserialize, Serialize};

use crate::usage::Limit;

/// The answer to layers that the machine refuses.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Level {
    /// Refuse to run unless every required layer is active, and the kernel enforces the
    /// limit of memory and counts processor time where that is limited.
    Strict,
    /// As many layers as the machine grants; each loss is recorded.
    #[default]
    Auto,
    /// No layer. Budgets hold, and the process tree is still ended; results are
    /// unranked.
    None,
}

words!(Level {
    Strict = "strict", "Refuse to run unless every required layer is active and the limit of memory enforced";
    Auto = "auto", "As many layers as the machine grants; each loss is in the record";
    None = "none", "No layer; results are unranked";
});

/// One thing that is taken away from a plugin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Layer {
    /// Rights over the other namespaces without rights over the machine.
    UserNamespace,
    /// Other processes cannot be seen or signalled, and all of the plugin's end
    /// with the first one.
    PidNamespace,
    /// A tree of files with nothing but what the plugin may read.
    MountNamespace,
    /// No network but an unused loopback.
    NetworkNamespace,
    /// No System V or POSIX message queues, semaphores and memory of others.
    IpcNamespace,
    /// A `/proc` that shows the plugin's own processes alone.
    OwnProc,
    /// A user identifier that nobody else has, when the host is root.
    OwnUser,
    /// Control groups: exact accounting, limits by the kernel where there are controllers,
    /// and a way to end everybody.
    Cgroup,
    /// Limits on core files, file sizes, descriptors, processes, locked memory and pending
    /// signals; first to go when the machine's memory runs out.
    ResourceLimits,
    /// Every capability is given up, for good.
    Capabilities,
    /// Set-user-identifier programs give no rights.
    NoNewPrivileges,
    /// Files, sockets and signals outside of the grants are refused by the kernel,
    /// whatever the namespaces are.
    Landlock,
    /// System calls that no planner needs are refused.
    Seccomp,
}

words!(Layer {
    UserNamespace = "user-namespace";
    PidNamespace = "pid-namespace";
    MountNamespace = "mount-namespace";
    NetworkNamespace = "network-namespace";
    IpcNamespace = "ipc-namespace";
    OwnProc = "own-proc";
    OwnUser = "own-user";
    Cgroup = "cgroup";
    ResourceLimits = "resource-limits";
    Capabilities = "capabilities";
    NoNewPrivileges = "no-new-privileges";
    Landlock = "landlock";
    Seccomp = "seccomp";
});

impl Layer {
    /// True if `strict` insists on it. A control group and a user of its own are
    /// not for everybody to have.
    pub fn is_required(self) -> bool {
        !matches!(self, Self::Cgroup | Self::OwnUser)
    }

    /// The loss without it.
    pub fn cost_of_missing(self) -> &'static str {
        match self {
            Self::UserNamespace => "the namespaces below, unless the host is root",
            Self::PidNamespace => {
                "a plugin sees other processes; its tree is ended by a search of /proc, and \
                 memory and processor limits are watched less often"
            }
            Self::MountNamespace => {
                "files are guarded by Landlock alone, and the scratch folder has no fixed size"
            }
            Self::NetworkNamespace => "the network is guarded by seccomp and Landlock alone",
            Self::IpcNamespace => "System V memory is guarded by seccomp alone",
            Self::OwnProc => "a plugin that needs /proc does not find it",
            Self::OwnUser => {
                "the plugin runs as root without rights; the kernel's own limit on processes \
                 does not bind it"
            }
            Self::Cgroup => {
                "limits of processor time and memory are watched, not enforced: /proc is read \
                 every few milliseconds, and a plugin can hide from that"
            }
            Self::ResourceLimits => "core files and open descriptors are unlimited",
            Self::Capabilities => "the plugin keeps the rights of the host over the machine",
            Self::NoNewPrivileges => "set-user-identifier programs give the plugin rights",
            Self::Landlock => "files are guarded by the mount namespace alone",
            Self::Seccomp => {
                "sockets, tracing and rarely used parts of the kernel are open to the plugin"
            }
        }
    }
}

/// The way in which a user comes by a control group.
const OWN_GROUP: &str = "start the host in a group of its own: \
                         `systemd-run --user --scope -p Delegate=yes fleetyard ...`";

impl Layer {
    /// Advice to a user about a refusal by this error.
    pub fn advice(self, errno: &str) -> &'static str {
        match (self, errno) {
            (
                Self::UserNamespace
                | Self::PidNamespace
                | Self::MountNamespace
                | Self::NetworkNamespace
                | Self::IpcNamespace,
                "ENOSPC" | "EUSERS",
            ) => {
                "the machine's number of namespaces is used up or 0: \
                 `sysctl user.max_user_namespaces=10000` as root, or install bubblewrap"
            }
            (
                Self::UserNamespace
                | Self::PidNamespace
                | Self::MountNamespace
                | Self::NetworkNamespace
                | Self::IpcNamespace,
                _,
            ) => {
                "on Debian `sysctl kernel.unprivileged_userns_clone=1`, on Ubuntu \
                 `sysctl kernel.apparmor_restrict_unprivileged_userns=0` as root, or install \
                 bubblewrap; a container needs `--security-opt seccomp=unconfined \
                 --security-opt apparmor=unconfined`"
            }
            (Self::OwnProc, _) => {
                "a container that hides parts of /proc needs \
                 `--security-opt systempaths=unconfined`"
            }
            (Self::OwnUser, _) => {
                "let others read the plugin's files: `chmod -R o+rX` on its folder, and \
                 `chmod o+x` on the folders above"
            }
            (Self::Cgroup, "ENOENT") => {
                "mount control groups of version 2: boot with \
                 `systemd.unified_cgroup_hierarchy=1`"
            }
            (Self::Cgroup, _) => OWN_GROUP,
            (Self::Landlock, _) => {
                "a kernel of 5.13 or later with `landlock` in the list of its boot option \
                 `lsm=`; `cat /sys/kernel/security/lsm` shows the list"
            }
            (Self::Seccomp, _) => "a kernel with CONFIG_SECCOMP_FILTER",
            (Self::ResourceLimits | Self::Capabilities | Self::NoNewPrivileges, _) => {
                "whoever started the host has set limits of its own: try from a login shell"
            }
        }
    }
}

/// True if a layer was active, and if not, why.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct LayerState {
    /// The layer.
    pub layer: Layer,
    /// True if it was active when the plugin's first code ran.
    pub active: bool,
    /// The error by which the kernel refused it.
    #[serde(default)]
    pub errno: Option<String>,
    /// The reason why it was refused or not asked for; of an active layer, the part that it cannot
    /// do on this machine.
    #[serde(default)]
    pub reason: Option<String>,
}

/// The reading of the table of system calls.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Profile {
    /// Refuses the calls that are listed as refused.
    DenyList,
    /// Refuses the calls that are not listed as needed.
    AllowList,
}

words!(Profile {
    DenyList = "deny-list";
    AllowList = "allow-list";
});

/// The filter of system calls.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Filter {
    /// The reading of the table.
    pub profile: Profile,
    /// The reason why the stricter reading was asked for and not used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
}

impl Filter {
    /// A filter that was not chosen for want of another.
    pub(crate) fn of(profile: Profile) -> Self {
        Self {
            profile,
            reason: None,
        }
    }
}

/// The holder of a limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Keeper {
    /// The kernel does not give more.
    Kernel,
    /// The host or the supervisor looks, and stops the plugin.
    Host,
}

/// The strength of a limit.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct LimitState {
    /// The limit.
    pub limit: Limit,
    /// True if nothing that a plugin does gets past it; otherwise it is watched as well as
    /// this machine allows.
    pub enforced: bool,
    /// The holder of the limit.
    pub by: Keeper,
    /// The reason why it is only watched.
    #[serde(default)]
    pub reason: Option<String>,
}

impl LimitState {
    /// Advice to the user about a limit that is only watched, if there is any.
    pub fn advice(&self) -> Option<&'static str> {
        let by_group = matches!(self.limit, Limit::Cpu | Limit::Memory);
        (by_group && !self.enforced).then_some(OWN_GROUP)
    }
}

/// The layers and the limits of one run.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SandboxReport {
    /// The configuration.
    pub level: Level,
    /// The maker of the namespaces: this host, or the program `bwrap`.
    #[serde(default)]
    pub backend: Option<Backend>,
    /// The filter of system calls, where that layer is active.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seccomp: Option<Filter>,
    /// Every layer, in the order of their declaration.
    pub layers: Vec<LayerState>,
    /// Every limit, whether one was set or not.
    #[serde(default)]
    pub limits: Vec<LimitState>,
    /// Devices that the plugin was granted: their time and memory are nobody's to count.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub devices: Vec<PathBuf>,
}

impl SandboxReport {
    /// True if a layer was active.
    pub fn has(&self, layer: Layer) -> bool {
        let mut layers = self.layers.iter();
        layers.any(|state| state.layer == layer && state.active)
    }

    /// True if a plugin can send no signal to its supervisor.
    pub(crate) fn keeps_signals_in(&self) -> bool {
        // Where Landlock does not keep them back, it is remarked.
        let landlock = |state: &LayerState| {
            state.layer == Layer::Landlock && state.active && state.reason.is_none()
        };
        self.has(Layer::PidNamespace)
            || self.has(Layer::OwnUser)
            || self.layers.iter().any(landlock)
    }

    /// The limits that are only watched.
    pub fn watched(&self) -> impl Iterator<Item = &LimitState> {
        self.limits.iter().filter(|state| !state.enforced)
    }

    /// True if a limit is only watched.
    pub fn only_watches(&self, limit: Limit) -> bool {
        self.watched().any(|state| state.limit == limit)
    }

    /// The layers that were asked for and refused.
    pub fn refused(&self) -> impl Iterator<Item = &LayerState> {
        let refused = |state: &&LayerState| !state.active && state.errno.is_some();
        self.layers.iter().filter(refused)
    }
}

/// The maker of the namespaces.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Backend {
    /// This host, by system calls.
    Own,
    /// The program `bwrap`, where only it is allowed to.
    Bwrap,
}

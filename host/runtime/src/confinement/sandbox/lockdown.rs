//! The rights that the plugin's own process gives up before it becomes the plugin.

use std::path::{Path, PathBuf};

use landlock::{
    ABI, Access, AccessFs, AccessNet, BitFlags, CompatLevel, Compatible, PathBeneath, PathFd,
    Ruleset, RulesetAttr, RulesetCreatedAttr, RulesetStatus, Scope,
};
use rustix::io::Errno;
use rustix::process::{
    DumpableBehavior, Resource, Rlimit, getrlimit, set_dumpable_behavior, setrlimit,
};
use rustix::thread::{CapabilitySet, CapabilitySets, capabilities, set_capabilities};

use super::devices::DEVICES;
use super::refusal::as_errno;
use super::{Layer, Profile, Refusal, Remark, syscalls};

/// Rights that the plugin's process keeps; all others are given up.
pub(super) struct Lockdown<'a> {
    /// Paths that may be read and executed, folders with what is in them.
    pub(super) read: &'a [PathBuf],
    /// Folders whose names may be listed.
    pub(super) list: &'a [PathBuf],
    /// The folder that may be written to.
    pub(super) scratch: &'a Path,
    pub(super) network: bool,
    /// Devices that may be used beside the usual ones.
    pub(super) devices: &'a [PathBuf],
    /// The system calls that pass.
    pub(super) profile: Profile,
    /// True if other processes are out of reach of signals anyway.
    pub(super) alone: bool,
    /// Most bytes of a file.
    pub(super) file_bytes: u64,
    /// Most processes and threads.
    pub(super) processes: u64,
    /// True if the kernel counts the processes of this user for this sandbox alone.
    pub(super) counted_alone: bool,
    /// A user to become, when that was not done by a user namespace.
    pub(super) become_user: Option<u32>,
}

impl Lockdown<'_> {
    /// Gives everything up. What could not be given up is returned, and what that leaves
    /// open; the rest is.
    pub(super) fn apply(&self) -> (Vec<Refusal>, Vec<Remark>) {
        let mut refused = Vec::new();
        let mut remarks = Vec::new();
        let mut note = |result: Result<(), Refusal>| refused.extend(result.err());
        note(self.resource_limits());
        note(self.change_user());
        note(drop_capabilities());
        // Not before: who has rights is given as many as it likes.
        note(self.bound_processes());
        note(no_new_privileges());
        let landlock = self.landlock();
        if let Ok(version) = landlock
            && version < SCOPE_OF_SIGNALS
            && !self.alone
        {
            remarks.push(Remark {
                layer: Layer::Landlock,
                text: format!(
                    "version {version} does not keep signals to processes of the same user back; \
                     Linux 6.12 does"
                ),
            });
        }
        note(landlock.map(|_| ()));
        // Giving up rights made this process unreadable for the supervisor, which
        // has to measure it. The filters let nobody change that.
        let _ = set_dumpable_behavior(DumpableBehavior::Dumpable);
        // Last: nothing that comes later should need any call that is refused.
        note(
            syscalls::install(self.network, self.profile)
                .map_err(|(errno, reason)| Refusal::new(Layer::Seccomp, errno, reason)),
        );
        (refused, remarks)
    }

    fn resource_limits(&self) -> Result<(), Refusal> {
        let refused = Refusal::of(Layer::ResourceLimits, "setting resource limits");
        let limits = [
            // Where a program takes core files from a pipe, only the limit of 1 keeps them from it
            // (core(5)); no file of a core is so short.
            (Resource::Core, 1),
            (Resource::Fsize, self.file_bytes),
            // What processes write into sockets is in no process: fewer hold less.
            (Resource::Nofile, 1024),
            (Resource::Memlock, 64 << 10),
            (Resource::Msgqueue, 0),
            (Resource::Rtprio, 0),
            (Resource::Nice, 0),
            // They are counted for the user: too many of ours, and nobody else has one.
            (Resource::Sigpending, 1024),
        ];
        let processes = self
            .counted_alone
            .then_some((Resource::Nproc, self.processes));
        for (resource, most) in limits.into_iter().chain(processes) {
            let now = getrlimit(resource);
            // Nobody may raise what somebody before us has lowered.
            let most = now.maximum.map_or(most, |maximum| maximum.min(most));
            let limit = Rlimit {
                current: Some(now.current.map_or(most, |current| current.min(most))),
                maximum: Some(most),
            };
            let limit = if resource == Resource::Nofile {
                limit
            } else {
                Rlimit {
                    current: Some(most),
                    ..limit
                }
            };
            setrlimit(resource, limit).map_err(&refused)?;
        }
        Ok(())
    }

    /// Bounds the processes of a plugin that the kernel counts with others of the user: it may have as
    /// many beside those that there are now, and some for what the user starts meanwhile. That is no
    /// limit of the plugin, which is watched; one that forks without end would else take all the
    /// processes that the user may have, and keep the supervisor from ending it in time.
    fn bound_processes(&self) -> Result<(), Refusal> {
        if self.counted_alone {
            return Ok(());
        }
        let refused = Refusal::of(Layer::ResourceLimits, "setting a limit of processes");
        let own = getrlimit(Resource::Nproc);
        let set = |current: Option<u64>, maximum: Option<u64>| {
            setrlimit(Resource::Nproc, Rlimit { current, maximum }).map_err(&refused)
        };
        // The kernel tells nobody how many it counts; but it refuses the first that is too many.
        let allows = |most: u64| {
            set(Some(most), own.maximum)?;
            let thread = std::thread::Builder::new().stack_size(1 << 16).spawn(|| ());
            Ok(thread.map(|thread| drop(thread.join())).is_ok())
        };
        let highest = own.current.unwrap_or(u64::MAX).min(1 << 22);
        let (mut least, mut enough) = (0, highest);
        while least + 1 < enough {
            let middle = least.midpoint(enough);
            if allows(middle)? {
                enough = middle;
            } else {
                least = middle;
            }
        }
        // Of root the kernel refuses none.
        let is_counted = least > 0 && enough < highest;
        let most = enough + self.processes + self.processes.max(256);
        let most = own.current.map_or(most, |own| own.min(most));
        if is_counted {
            set(
                Some(most),
                Some(own.maximum.map_or(most, |own| own.min(most))),
            )
        } else {
            set(own.current, own.maximum)
        }
    }

    fn change_user(&self) -> Result<(), Refusal> {
        let Some(user) = self.become_user else {
            return Ok(());
        };
        // SAFETY: plain system calls; this process has one thread.
        let result = unsafe {
            if libc::setgroups(0, std::ptr::null()) != 0
                || libc::setresgid(user, user, user) != 0
                || libc::setresuid(user, user, user) != 0
            {
                Err(std::io::Error::last_os_error())
            } else {
                Ok(())
            }
        };
        result.map_err(|error| {
            let errno = Errno::from_io_error(&error).unwrap_or(Errno::PERM);
            Refusal::new(Layer::OwnUser, errno, "changing the user")
        })
    }

    /// The version of it that is in force.
    fn landlock(&self) -> Result<i64, Refusal> {
        // The crate tells what was enforced, not why nothing was.
        // SAFETY: asks for the version, touches no memory.
        let version = unsafe {
            libc::syscall(
                libc::SYS_landlock_create_ruleset,
                std::ptr::null::<u8>(),
                0,
                1,
            )
        };
        if version < 0 {
            let errno = Errno::from_io_error(&std::io::Error::last_os_error());
            let reason = "the kernel has no Landlock, or it is not switched on";
            return Err(Refusal::new(
                Layer::Landlock,
                errno.unwrap_or(Errno::NOSYS),
                reason,
            ));
        }
        let refused = |error: &dyn std::fmt::Display| {
            Refusal::new(Layer::Landlock, Errno::INVAL, error.to_string())
        };
        self.restrict()
            .map_err(|error| refused(&error))
            .and_then(|status| match status {
                RulesetStatus::NotEnforced => Err(refused(&"nothing was enforced")),
                _ => Ok(version),
            })
    }

    fn restrict(&self) -> Result<RulesetStatus, landlock::RulesetError> {
        let abi = ABI::V9;
        let mut ruleset = Ruleset::default()
            .set_compatibility(CompatLevel::BestEffort)
            .handle_access(AccessFs::from_all(abi))?
            .scope(Scope::Signal)?;
        if !self.network {
            ruleset = ruleset
                .handle_access(AccessNet::from_all(abi))?
                .scope(Scope::AbstractUnixSocket)?;
        }
        let mut ruleset = ruleset.create()?;
        let device =
            AccessFs::ReadFile | AccessFs::WriteFile | AccessFs::Truncate | AccessFs::IoctlDev;
        let mut allow = |path: &Path, access: BitFlags<AccessFs>| {
            // What does not exist need not be allowed, and what a link leads to is granted
            // by itself or not at all.
            let link = path.symlink_metadata().is_ok_and(|meta| meta.is_symlink());
            let followed = !link || path.starts_with("/proc");
            let Some(fd) = PathFd::new(path).ok().filter(|_| followed) else {
                return Ok(());
            };
            let access = if path.is_dir() {
                access
            } else {
                access & AccessFs::from_file(abi)
            };
            (&mut ruleset)
                .add_rule(PathBeneath::new(fd, access))
                .map(|_| ())
        };
        // Nowhere below `/proc` is anything for a plugin to write: threads are named by a
        // call, and the rest is how the kernel is to treat it.
        for path in self.read {
            allow(path, AccessFs::from_read(abi))?;
        }
        for path in self.list {
            allow(path, AccessFs::ReadDir.into())?;
        }
        allow(self.scratch, AccessFs::from_all(abi))?;
        for path in DEVICES
            .iter()
            .map(Path::new)
            .chain(self.devices.iter().map(PathBuf::as_path))
        {
            allow(path, device)?;
        }
        ruleset.restrict_self().map(|status| status.ruleset)
    }
}

/// The first version of Landlock that keeps signals in.
const SCOPE_OF_SIGNALS: i64 = 6;

/// Gives up every capability, and the means to get one by starting a program.
pub(super) fn drop_capabilities() -> Result<(), Refusal> {
    let refused = Refusal::of(Layer::Capabilities, "giving up capabilities");
    let had = capabilities(None).map_err(&refused)?;
    // Whoever may not bound has nothing to bound.
    let may_bound = had.effective.contains(CapabilitySet::SETPCAP);
    let mut bounded = Ok(());
    for capability in (0..64).take_while(|_| may_bound) {
        // SAFETY: a plain system call on this process.
        if unsafe { libc::prctl(libc::PR_CAPBSET_DROP, capability, 0, 0, 0) } != 0 {
            match as_errno(&std::io::Error::last_os_error()) {
                // The kernel knows no more.
                Errno::INVAL => break,
                error => bounded = Err(refused(error)),
            }
        }
    }
    let none = CapabilitySets {
        effective: CapabilitySet::empty(),
        permitted: CapabilitySet::empty(),
        inheritable: CapabilitySet::empty(),
    };
    set_capabilities(None, none).map_err(&refused)?;
    let left = capabilities(None).map_err(&refused)?;
    if left.permitted.is_empty() {
        bounded
    } else {
        Err(refused(Errno::PERM))
    }
}

fn no_new_privileges() -> Result<(), Refusal> {
    rustix::thread::set_no_new_privs(true).map_err(Refusal::of(
        Layer::NoNewPrivileges,
        "refusing new privileges",
    ))
}

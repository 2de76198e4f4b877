//! The inside of the sandbox: its first process, the *init*, and the plugin's process
//! until it becomes the plugin.

use std::ffi::OsString;
use std::fs;
use std::io::ErrorKind;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, poll};
use rustix::fs::{Access, Mode, OFlags};
use rustix::io::Errno;
use rustix::process::{
    DumpableBehavior, Signal, WaitOptions, set_dumpable_behavior, set_parent_process_death_signal,
    wait,
};
use rustix::time::Timespec;

use super::grants::SCRATCH;
use super::launch::Launch;
use super::lockdown::{Lockdown, drop_capabilities};
use super::packets::{Ended, Packet, send};
use super::refusal::as_errno;
use super::root::{INSIDE_USER, OF_KERNEL, OF_MACHINE, Root, Trees};
use super::{Layer, Level, Refusal, attempts};
use crate::confinement::child::{self, patiently};
use crate::confinement::process_tree::kill_descendants;
use crate::confinement::state;
use crate::confinement::target::Target;

/// The knowledge of the init and of the plugin's process.
pub(super) struct Inside<'a> {
    pub(super) launch: &'a Launch,
    pub(super) wanted: &'a [Layer],
    /// On disk, for when there is no tree of our own.
    pub(super) scratch: &'a Path,
    pub(super) link: &'a OwnedFd,
    pub(super) gate: &'a OwnedFd,
    pub(super) become_user: Option<u32>,
}

impl Inside<'_> {
    fn wants(&self, layer: Layer) -> bool {
        self.wanted.contains(&layer)
    }

    /// The init's life. `trees` is absent when somebody else has built the tree of
    /// files already.
    pub(super) fn run(
        &self,
        trees: Option<&Trees>,
        become_plugin: &dyn Fn() -> std::convert::Infallible,
    ) -> ! {
        if !wait_at(self.gate) {
            exit(1);
        }
        // As long as this process has rights, nobody may look into it. Not before the
        // user was mapped, which needs to.
        let _ = set_dumpable_behavior(DumpableBehavior::NotDumpable);
        if self.wants(Layer::UserNamespace) && trees.is_some() {
            become_mapped_user(self.wants(Layer::OwnUser))
                .unwrap_or_else(|refusal| self.fail(refusal));
        }
        let mount = self.wants(Layer::MountNamespace);
        let mut lost = Vec::new();
        if mount && let Some(trees) = trees {
            let root = Root {
                read: &self.launch.grants.read,
                devices: &self.launch.policy.devices,
                trees,
                // A little more than the limit, so that reaching it can be seen.
                disk_bytes: self.launch.policy.disk_bytes.max(4096) + (64 << 10),
                files: self.launch.policy.files + 64,
                proc: self.wants(Layer::OwnProc),
            };
            match root.enter() {
                Ok(also) => lost = also,
                Err(refusal) => self.fail(refusal),
            }
        }
        let scratch = if mount {
            Path::new(SCRATCH)
        } else {
            self.scratch
        };
        self.tell_ready(lost, scratch);
        start_plugin(self, scratch, become_plugin)
    }

    fn tell_ready(&self, lost: Vec<Refusal>, scratch: &Path) {
        let open = |path: &Path| {
            let flags = OFlags::RDONLY | OFlags::DIRECTORY | OFlags::CLOEXEC;
            rustix::fs::open(path, flags, Mode::empty())
        };
        let new_proc = self.wants(Layer::OwnProc) && lost.is_empty();
        let proc = new_proc.then(|| open(Path::new("/proc")).ok()).flatten();
        let folder = match open(scratch) {
            Ok(folder) => folder,
            // Below a folder that nobody but the host's user may enter.
            Err(Errno::ACCESS) if self.wants(Layer::OwnUser) => {
                let reason = format!("{} cannot be entered by another user", scratch.display());
                self.fail(Refusal::new(Layer::OwnUser, Errno::ACCESS, reason))
            }
            Err(error) => self.give_up("opening the scratch folder", &error),
        };
        let descriptors: Vec<BorrowedFd<'_>> =
            proc.iter().chain([&folder]).map(AsFd::as_fd).collect();
        if !send(self.link, &Packet::Ready(lost), &descriptors) {
            exit(1);
        }
    }

    fn fail(&self, refusal: Refusal) -> ! {
        let _ = send(self.link, &Packet::Failed(refusal), &[]);
        exit(1)
    }

    /// Something failed without which there is no sandbox, and it is no layer.
    fn give_up(&self, what: &str, error: &dyn std::fmt::Display) -> ! {
        let _ = send(
            self.link,
            &Packet::HostFailed(format!("{what}: {error}")),
            &[],
        );
        exit(1)
    }
}

/// Becomes the user that was mapped, for a host that is root: until then this is
/// nobody in the new namespace, and still in root's groups. `of_root` when it is one, and has to
/// leave them; others may not, and their groups are their own.
fn become_mapped_user(of_root: bool) -> Result<(), Refusal> {
    // SAFETY: plain system calls; this process has one thread.
    let changed = unsafe {
        (libc::setgroups(0, std::ptr::null()) == 0 || !of_root)
            && libc::setresgid(INSIDE_USER, INSIDE_USER, INSIDE_USER) == 0
            && libc::setresuid(INSIDE_USER, INSIDE_USER, INSIDE_USER) == 0
    };
    if changed {
        return Ok(());
    }
    let errno = as_errno(&std::io::Error::last_os_error());
    Err(Refusal::new(
        Layer::UserNamespace,
        errno,
        "becoming the mapped user",
    ))
}

/// Starts the plugin's process and is its init from then on.
fn start_plugin(
    inside: &Inside<'_>,
    scratch: &Path,
    become_plugin: &dyn Fn() -> std::convert::Infallible,
) -> ! {
    // SAFETY: plain system call that makes orphans ours where there is no
    // namespace that does.
    if unsafe { libc::prctl(libc::PR_SET_CHILD_SUBREAPER, 1) } != 0 {
        inside.give_up("orphans cannot be found", &std::io::Error::last_os_error());
    }
    let fork = || {
        // SAFETY: this process has one thread, so the copy may do anything.
        match unsafe { libc::fork() } {
            -1 => Err(std::io::Error::last_os_error()),
            child => Ok(child),
        }
    };
    let forked = patiently(fork, |error| error.kind() == ErrorKind::WouldBlock);
    match forked.unwrap_or_else(|error| inside.give_up("making the plugin's process", &error)) {
        0 => plugin(inside, scratch, become_plugin),
        child => {
            child::release_stdio();
            // Everything is made; what is left needs no rights, but for ending processes of
            // another user where there is no namespace in which this one may.
            if inside.become_user.is_none() {
                let _ = drop_capabilities();
            }
            // The supervisor's end is noticed on the link; this is for the case
            // that somebody else holds it open.
            let _ = set_parent_process_death_signal(Some(Signal::KILL));
            init(child, inside.link)
        }
    }
}

/// The plugin's process: locks itself and becomes the plugin.
fn plugin(
    inside: &Inside<'_>,
    scratch: &Path,
    become_plugin: &dyn Fn() -> std::convert::Infallible,
) -> ! {
    let launch = inside.launch;
    let grants = &launch.grants;
    if let Err(error) = child::child_setup() {
        inside.give_up("making a session for the plugin", &error);
    }
    // Relative paths of a plugin mean its scratch folder.
    let _ = std::env::set_current_dir(scratch);
    let (refused, remarks) = if launch.policy.level == Level::None {
        (Vec::new(), Vec::new())
    } else {
        Lockdown {
            read: &readable(inside),
            // A tree that holds nothing else is readable as a whole.
            list: if inside.wants(Layer::MountNamespace) {
                &[]
            } else {
                &grants.list
            },
            scratch,
            network: launch.policy.network,
            devices: &launch.policy.devices,
            profile: launch.filter.profile,
            alone: inside.wants(Layer::PidNamespace),
            file_bytes: launch.policy.disk_bytes + (64 << 10),
            processes: u64::from(launch.policy.processes) + 2,
            counted_alone: counts_alone(inside.wanted),
            become_user: inside.become_user,
        }
        .apply()
    };
    if inside.wants(Layer::OwnUser)
        && let Some(file) = grants
            .needed
            .iter()
            .find(|file| rustix::fs::access(file.as_path(), Access::READ_OK) == Err(Errno::ACCESS))
    {
        let reason = format!("{} cannot be read by another user", file.display());
        inside.fail(Refusal::new(Layer::OwnUser, Errno::ACCESS, reason));
    }
    if !send(inside.link, &Packet::Locked(refused, remarks), &[]) {
        exit(1);
    }
    if !wait_at(inside.gate) {
        inside.give_up("waiting for the supervisor", &"it does not answer");
    }
    // While it is known that none of its code has run: a machine that has no thread to give is not
    // the plugin's fault.
    let thread = || std::thread::Builder::new().stack_size(1 << 16).spawn(|| ());
    match patiently(thread, |error| error.kind() == ErrorKind::WouldBlock) {
        Ok(thread) => drop(thread.join()),
        Err(error) => inside.give_up("making a thread for the plugin", &error),
    }
    let mut env = grants.env.clone();
    env.insert(state::RUN.into(), OsString::from(&launch.run));
    if scratch != Path::new(SCRATCH) {
        for value in env.values_mut() {
            if value == SCRATCH {
                *value = scratch.into();
            }
        }
    }
    match &launch.target {
        Target::Nothing => exit(0),
        Target::Attempts(victims) => {
            attempts::make(victims);
            exit(0)
        }
        Target::Program(argv) => {
            let program = grants.program.clone().unwrap_or_default();
            let mut command = Command::new(program);
            command.args(argv.iter().skip(1)).env_clear().envs(env);
            if let Some(name) = argv.first() {
                command.arg0(name);
            }
            close_descriptors(libc::CLOSE_RANGE_CLOEXEC)
                .unwrap_or_else(|error| inside.give_up("closing descriptors", &error));
            // Only returns when it failed; the link closes when it did not.
            let error = command.exec();
            let _ = send(inside.link, &Packet::CannotStart(error.to_string()), &[]);
            exit(127)
        }
        Target::Library(_) | Target::BuiltIn | Target::Adapter(_) => {
            // SAFETY: this process has one thread, and nobody holds on to the old
            // environment.
            unsafe {
                for (name, _) in std::env::vars_os() {
                    std::env::remove_var(name);
                }
                for (name, value) in env {
                    std::env::set_var(name, value);
                }
            }
            close_descriptors(0)
                .unwrap_or_else(|error| inside.give_up("closing descriptors", &error));
            match become_plugin() {}
        }
    }
}

/// Closes everything but the standard streams: the plugin must not speak for its init,
/// nor hold on to what the supervisor has open.
fn close_descriptors(flags: libc::c_uint) -> std::io::Result<()> {
    // SAFETY: this process ends without using any of them again, but for sending
    // that a program could not be started, for which they are still open.
    if unsafe { libc::syscall(libc::SYS_close_range, 3, u32::MAX, flags) } == 0 {
        return Ok(());
    }
    Err(std::io::Error::last_os_error())
}

/// True if the kernel counts the processes of a sandbox with these layers apart from all
/// others of the user.
pub(super) fn counts_alone(layers: &[Layer]) -> bool {
    let release = fs::read_to_string("/proc/sys/kernel/osrelease")
        .or_else(|_| {
            let name = rustix::system::uname();
            Ok::<_, std::io::Error>(name.release().to_string_lossy().into_owned())
        })
        .unwrap_or_default();
    let mut numbers = release
        .split(['.', '-'])
        .map_while(|part| part.parse::<u32>().ok());
    let version = (numbers.next().unwrap_or(0), numbers.next().unwrap_or(0));
    let has = |layer| layers.contains(&layer);
    has(Layer::OwnUser) || (has(Layer::UserNamespace) && version >= (5, 14))
}

/// Paths that may be read: everything in a tree that holds nothing else; otherwise the grants, and
/// of everybody's `/proc` the files about the machine and the process itself.
fn readable(inside: &Inside<'_>) -> Vec<PathBuf> {
    if inside.wants(Layer::MountNamespace) {
        return vec!["/".into()];
    }
    let of_proc = OF_MACHINE.iter().map(|name| Path::new("/proc").join(name));
    let of_sys = OF_KERNEL
        .iter()
        .map(|name| Path::new("/proc/sys").join(name));
    let granted = inside.launch.grants.read.iter().cloned();
    granted
        .chain([PathBuf::from("/proc/self")])
        .chain(of_proc)
        .chain(of_sys)
        .collect()
}

/// Waits for the supervisor's word; false when it is gone.
fn wait_at(gate: &OwnedFd) -> bool {
    let mut word = [0_u8; 1];
    loop {
        match rustix::io::read(gate, &mut word[..]) {
            Ok(read) => return read == 1,
            Err(Errno::INTR) => {}
            Err(_) => return false,
        }
    }
}

/// Waits for the plugin's process, for a word of the supervisor or for its end; then
/// ends everybody, reports, and ends.
fn init(child: i32, link: &OwnedFd) -> ! {
    let mut status = Status {
        child,
        ..Status::default()
    };
    let children = signals_of_children();
    loop {
        status.reap(WaitOptions::NOHANG);
        if status.over {
            break;
        }
        let mut waiting = vec![PollFd::new(link, PollFlags::IN)];
        if let Some(children) = &children {
            waiting.push(PollFd::new(children, PollFlags::IN));
        }
        // Without a descriptor for signals, looking now and then has to do.
        let now_and_then = Timespec {
            tv_sec: 0,
            tv_nsec: 2_000_000,
        };
        let timeout = children.is_none().then_some(&now_and_then);
        match poll(&mut waiting, timeout) {
            Ok(_) if !waiting[0].revents().is_empty() => break,
            Ok(_) => {
                if let Some(children) = &children {
                    let mut news = [0_u8; 1024];
                    let _ = rustix::io::read(children, &mut news[..]);
                }
            }
            Err(Errno::INTR) => {}
            // The plugin goes on whatever keeps this process from waiting; looking has to do.
            Err(_) => std::thread::sleep(Duration::from_millis(2)),
        }
    }
    reap_descendants(Some(&mut status));
    // Who does not hear it sees that this process ends.
    let _ = send(link, &Packet::Ended(status.ended()), &[]);
    exit(0)
}

/// A descriptor that is readable when a child has ended.
fn signals_of_children() -> Option<OwnedFd> {
    use std::os::fd::FromRawFd;
    // SAFETY: the sets live on the stack; the descriptor is owned by nobody else.
    unsafe {
        let mut set: libc::sigset_t = std::mem::zeroed();
        libc::sigemptyset(&raw mut set);
        libc::sigaddset(&raw mut set, libc::SIGCHLD);
        libc::sigprocmask(libc::SIG_BLOCK, &raw const set, std::ptr::null_mut());
        let fd = libc::signalfd(-1, &raw const set, libc::SFD_CLOEXEC | libc::SFD_NONBLOCK);
        (fd >= 0).then(|| OwnedFd::from_raw_fd(fd))
    }
}

/// The plugin's process, as the init knows it.
#[derive(Default)]
pub(super) struct Status {
    child: i32,
    over: bool,
    code: Option<i32>,
    signal: Option<i32>,
}

impl Status {
    /// Waits for whoever has ended; false when nobody is left.
    fn reap(&mut self, options: WaitOptions) -> bool {
        loop {
            match wait(options) {
                Ok(Some((pid, status))) => {
                    if pid.as_raw_nonzero().get() == self.child {
                        self.over = true;
                        self.code = status.exit_status();
                        self.signal = status.terminating_signal();
                    }
                }
                Ok(None) => return true,
                Err(Errno::INTR) => {}
                Err(_) => return false,
            }
        }
    }

    fn ended(&self) -> Ended {
        // SAFETY: an all-zero structure is valid, and the call fills it in.
        let usage = unsafe {
            let mut usage: libc::rusage = std::mem::zeroed();
            libc::getrusage(libc::RUSAGE_CHILDREN, &raw mut usage);
            usage
        };
        let micros = |time: libc::timeval| time.tv_sec as u64 * 1_000_000 + time.tv_usec as u64;
        Ended {
            code: self.code,
            signal: self.signal,
            user_us: micros(usage.ru_utime),
            system_us: micros(usage.ru_stime),
            max_rss_kb: usage.ru_maxrss as u64,
            voluntary_switches: usage.ru_nvcsw as u64,
            involuntary_switches: usage.ru_nivcsw as u64,
            minor_faults: usage.ru_minflt as u64,
            major_faults: usage.ru_majflt as u64,
        }
    }
}

/// Kills and reaps until this process has no children left.
pub(super) fn reap_descendants(status: Option<&mut Status>) {
    let mut nobody = Status::default();
    let status = status.unwrap_or(&mut nobody);
    let first = std::process::id() == 1;
    while status.reap(WaitOptions::NOHANG) {
        if first {
            // SAFETY: reaches everybody in this namespace but this process, at once.
            unsafe { libc::kill(-1, libc::SIGKILL) };
            // They are dying: waiting for them is all there is to do.
            if !status.reap(WaitOptions::empty()) {
                return;
            }
        } else {
            if !kill_descendants() {
                // Whoever waits for this process has other means, and has to hear of it.
                return;
            }
            // Killed processes need a moment to die.
            std::thread::sleep(Duration::from_micros(200));
        }
    }
}

/// Ends this process without running what the parent left to run.
fn exit(code: i32) -> ! {
    // SAFETY: ends the process.
    unsafe { libc::_exit(code) }
}

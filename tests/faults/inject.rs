//! Lets a system call of the host fail: a tracer that follows the command, the supervisors that
//! it starts, their first processes inside, and plugins' processes until they become the
//! plugin, counts the calls of [`CLASSES`] in each, and spoils one of them.
//!
//! The host makes some of its calls without the C library, so that nothing that is loaded
//! before it would see them all; a tracer does, and the product is tested as it is.

#![allow(
    unsafe_code,
    reason = "tracing another process is system calls with pointers"
)]

use std::collections::BTreeMap;
use std::fmt;
use std::fs;
use std::mem::{MaybeUninit, size_of};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Command, ExitStatus};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

use libc::{c_int, c_long, c_void, pid_t};

/// A process that has not ended by then hangs. No wait of the host is that long in a scenario
/// without a fault.
const HANGING: Duration = Duration::from_mins(1);

/// The fault of a call.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Wrong {
    /// It is not made, and fails.
    Fails(Errno),
    /// It is made, and says that it has failed.
    Lies(Errno),
    /// One byte is read or written, if more were asked for.
    Short,
    /// The host and its supervisors are killed just before it.
    Killed,
}

/// An error by its name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Errno(i32, &'static str);

macro_rules! errors {
    ($($name:ident)*) => { $(const $name: Wrong = Wrong::Fails(Errno(libc::$name, stringify!($name)));)* };
}
errors!(EAGAIN EINTR EIO EMFILE ENOLCK ENOMEM ENOSPC EPERM);

/// `close` gives the descriptor back whatever it says.
const CLOSED: Wrong = Wrong::Lies(Errno(libc::EINTR, "EINTR"));

impl fmt::Display for Wrong {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fails(Errno(_, name)) | Self::Lies(Errno(_, name)) => f.write_str(name),
            Self::Short => f.write_str("short"),
            Self::Killed => f.write_str("killed"),
        }
    }
}

macro_rules! calls {
    ($($name:ident)*) => { &[$((concat!(stringify!($name)), number::$name)),*] };
}

/// The numbers of system calls; those that an architecture does not have are -1.
#[allow(non_upper_case_globals, reason = "named as the calls are")]
mod number {
    macro_rules! everywhere {
        ($($name:ident $number:ident)*) => { $(pub(super) const $name: i64 = libc::$number as i64;)* };
    }
    macro_rules! of_old {
        ($($name:ident $number:ident)*) => { $(
            #[cfg(target_arch = "x86_64")]
            pub(super) const $name: i64 = libc::$number as i64;
            #[cfg(not(target_arch = "x86_64"))]
            pub(super) const $name: i64 = -1;
        )* };
    }
    of_old! {
        access SYS_access chmod SYS_chmod chown SYS_chown creat SYS_creat dup2 SYS_dup2 fork SYS_fork
        getdents SYS_getdents lstat SYS_lstat mkdir SYS_mkdir
        open SYS_open pipe SYS_pipe poll SYS_poll readlink SYS_readlink rename SYS_rename
        rmdir SYS_rmdir stat SYS_stat symlink SYS_symlink unlink SYS_unlink vfork SYS_vfork
    }
    everywhere! {
        capget SYS_capget capset SYS_capset chdir SYS_chdir clone SYS_clone clone3 SYS_clone3
        close SYS_close close_range SYS_close_range dup SYS_dup dup3 SYS_dup3
        eventfd2 SYS_eventfd2 execve SYS_execve faccessat SYS_faccessat faccessat2 SYS_faccessat2
        fallocate SYS_fallocate fchdir SYS_fchdir fchmod SYS_fchmod fchmodat SYS_fchmodat
        fchown SYS_fchown fchownat SYS_fchownat fcntl SYS_fcntl fdatasync SYS_fdatasync
        flock SYS_flock fstat SYS_fstat fstatfs SYS_fstatfs fsync SYS_fsync
        ftruncate SYS_ftruncate getcwd SYS_getcwd getdents64 SYS_getdents64 ioctl SYS_ioctl
        kill SYS_kill landlock_add_rule SYS_landlock_add_rule
        landlock_create_ruleset SYS_landlock_create_ruleset
        landlock_restrict_self SYS_landlock_restrict_self linkat SYS_linkat lseek SYS_lseek
        mkdirat SYS_mkdirat mmap SYS_mmap mount SYS_mount mount_setattr SYS_mount_setattr
        move_mount SYS_move_mount newfstatat SYS_newfstatat open_tree SYS_open_tree openat SYS_openat openat2 SYS_openat2
        pidfd_open SYS_pidfd_open pidfd_send_signal SYS_pidfd_send_signal pipe2 SYS_pipe2
        pivot_root SYS_pivot_root ppoll SYS_ppoll prctl SYS_prctl pread64 SYS_pread64
        prlimit64 SYS_prlimit64 pwrite64 SYS_pwrite64 pwritev SYS_pwritev read SYS_read
        readlinkat SYS_readlinkat readv SYS_readv recvfrom SYS_recvfrom recvmsg SYS_recvmsg
        renameat2 SYS_renameat2 rt_sigprocmask SYS_rt_sigprocmask
        sched_getaffinity SYS_sched_getaffinity sched_setaffinity SYS_sched_setaffinity
        seccomp SYS_seccomp sendmsg SYS_sendmsg sendto SYS_sendto setgroups SYS_setgroups
        setns SYS_setns setpriority SYS_setpriority setresgid SYS_setresgid
        setresuid SYS_setresuid setrlimit SYS_setrlimit setsid SYS_setsid
        setsockopt SYS_setsockopt shutdown SYS_shutdown signalfd4 SYS_signalfd4
        sigaltstack SYS_sigaltstack socketpair SYS_socketpair statfs SYS_statfs statx SYS_statx
        symlinkat SYS_symlinkat umount2 SYS_umount2 unlinkat SYS_unlinkat unshare SYS_unshare
        utimensat SYS_utimensat wait4 SYS_wait4 waitid SYS_waitid write SYS_write
        writev SYS_writev
    }
}

type Class = (&'static [(&'static str, i64)], &'static [Wrong]);

/// The calls that go wrong, and their faults: errors that the kernel may give for them, or that a
/// filter of system calls does. Calls that ask for nothing that could be missing are left out, and
/// memory: a process that cannot grow is ended by its language.
#[rustfmt::skip]
pub(crate) const CLASSES: &[Class] = &[
    (calls!(open openat openat2 creat), &[EMFILE, EINTR]),
    (calls!(read pread64 readv recvfrom), &[EIO, EINTR, Wrong::Short]),
    (calls!(write pwrite64 writev pwritev), &[ENOSPC, EINTR, Wrong::Short]),
    (calls!(sendto), &[ENOMEM, EINTR, Wrong::Short]),
    (calls!(sendmsg recvmsg poll ppoll), &[ENOMEM, EINTR]),
    (calls!(wait4 waitid), &[EINTR]),
    (calls!(clone clone3 fork vfork), &[EAGAIN]),
    (calls!(execve), &[ENOMEM]),
    (calls!(pipe pipe2 socketpair eventfd2 signalfd4 pidfd_open dup dup2 dup3), &[EMFILE]),
    (calls!(fcntl), &[ENOMEM, EINTR]),
    (calls!(flock), &[ENOLCK, EINTR]),
    (calls!(mount umount2 move_mount open_tree mount_setattr pivot_root), &[ENOMEM, EPERM]),
    (calls!(mkdir mkdirat rename renameat2 unlink unlinkat rmdir symlink symlinkat linkat
            ftruncate fallocate), &[ENOSPC, EIO]),
    (calls!(chmod chown fchmod fchmodat fchown fchownat utimensat), &[EIO]),
    (calls!(fsync fdatasync), &[EIO, EINTR]),
    (calls!(stat lstat fstat newfstatat statx readlink readlinkat access faccessat faccessat2
            getdents getdents64 lseek fstatfs statfs getcwd ioctl), &[EIO]),
    (calls!(unshare setns chdir fchdir setsid setresuid setresgid setgroups setrlimit prlimit64 prctl
            capset capget seccomp landlock_create_ruleset landlock_add_rule landlock_restrict_self
            sched_setaffinity sched_getaffinity setpriority kill pidfd_send_signal close_range
            rt_sigprocmask setsockopt shutdown), &[EPERM]),
    (calls!(mmap), &[ENOMEM]),
    (calls!(close), &[CLOSED]),
];

/// The name of a call that may go wrong, and how.
fn class(number: i64) -> Option<(&'static str, &'static [Wrong])> {
    CLASSES.iter().find_map(|(calls, wrong)| {
        let call = calls.iter().find(|(_, known)| *known == number)?;
        Some((call.0, *wrong))
    })
}

/// One call of a command, and how it goes wrong.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Point {
    /// The process: `host`, or the number of one that it has started, counted from 1.
    pub(crate) process: String,
    pub(crate) call: &'static str,
    pub(crate) wrong: Wrong,
    /// Number of the call among these calls, from 1.
    pub(crate) nth: u32,
}

impl fmt::Display for Point {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}/{}/{}/{}",
            self.process, self.call, self.wrong, self.nth
        )
    }
}

/// Number of calls of each name, by process.
pub(crate) type Census = BTreeMap<(String, &'static str), u32>;

/// Every point of a command whose calls were counted.
pub(crate) fn points(census: &Census) -> Vec<Point> {
    let mut found = Vec::new();
    for ((process, call), count) in census {
        let numbers = CLASSES.iter().flat_map(|(calls, wrong)| {
            let known = calls.iter().any(|(name, _)| name == call);
            wrong.iter().filter(move |_| known)
        });
        for wrong in numbers {
            found.extend((1..=*count).map(|nth| Point {
                process: process.clone(),
                call,
                wrong: *wrong,
                nth,
            }));
        }
    }
    found
}

/// Every call at which the host and its supervisors may be killed.
pub(crate) fn kills(census: &Census) -> Vec<Point> {
    let each = census.iter().flat_map(|((process, call), count)| {
        (1..=*count).map(|nth| Point {
            process: process.clone(),
            call,
            wrong: Wrong::Killed,
            nth,
        })
    });
    each.collect()
}

/// The reason why this machine cannot do it, if it cannot.
pub(crate) fn refused() -> Option<String> {
    if !cfg!(any(target_arch = "x86_64", target_arch = "aarch64")) {
        return Some("registers of this architecture are not known".into());
    }
    let mut command = Command::new("true");
    prepare(&mut command);
    match command.spawn() {
        Ok(child) => {
            let outcome = Tracer::new(child.id() as pid_t, None).map(Tracer::follow);
            outcome.err().map(|error| error.to_string())
        }
        Err(error) => Some(error.to_string()),
    }
}

/// Lets the process that a command becomes be traced by the thread that starts it.
pub(crate) fn prepare(command: &mut Command) {
    // SAFETY: a plain system call.
    unsafe {
        command.pre_exec(|| {
            if libc::ptrace(libc::PTRACE_TRACEME, 0, 0, 0) < 0 {
                return Err(std::io::Error::last_os_error());
            }
            Ok(())
        });
    }
}

/// Result of following a command.
pub(crate) struct Followed {
    pub(crate) status: Option<ExitStatus>,
    /// Calls until the one that went wrong.
    pub(crate) census: Census,
    /// True if the point came up.
    pub(crate) spoiled: bool,
}

/// Follows a [prepared](prepare) command of this thread to its end, and lets one of its calls go
/// wrong; from there on it is left alone. `stop` is called, from another thread, when it hangs.
pub(crate) fn follow(
    root: u32,
    point: Option<&Point>,
    stop: impl FnOnce() + Send,
) -> std::io::Result<Followed> {
    let tracer = Tracer::new(root as pid_t, point)?;
    let (ended, waiting) = channel::<()>();
    thread::scope(|scope| {
        scope.spawn(move || {
            if waiting.recv_timeout(HANGING) == Err(RecvTimeoutError::Timeout) {
                stop();
            }
        });
        let followed = tracer.follow();
        drop(ended);
        Ok(followed)
    })
}

/// A process that is followed.
struct Process {
    name: String,
    kind: Kind,
    /// Processes that it has started so far.
    children: u32,
    /// Seen once in the language's preparations, twice where they end.
    prepared: u32,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Host,
    /// Started by the host, and not another program yet.
    Spawned,
    Supervisor,
    /// Started by a supervisor: the first process of a sandbox, or a helper for mounts.
    Inside,
    /// Started by the first process of a sandbox.
    Plugin,
}

/// A thread that is followed.
struct Task {
    process: usize,
    /// The result that the call gets which it is in.
    result: Option<i64>,
    /// Its first stop was seen.
    begun: bool,
}

struct Tracer<'a> {
    root: pid_t,
    point: Option<&'a Point>,
    processes: Vec<Process>,
    tasks: BTreeMap<pid_t, Task>,
    /// Threads that stopped before who started them said so.
    early: Vec<pid_t>,
    census: Census,
    spoiled: bool,
    spawned: u32,
    supervisors: u32,
}

fn ptrace(request: c_int, pid: pid_t, address: usize, data: usize) -> std::io::Result<c_long> {
    // SAFETY: what is behind the pointers, if they are any, belongs to the caller and
    // outlives the call.
    let result = unsafe {
        libc::ptrace(
            request as _,
            pid,
            address as *mut c_void,
            data as *mut c_void,
        )
    };
    if result < 0 {
        return Err(std::io::Error::last_os_error());
    }
    Ok(result)
}

impl<'a> Tracer<'a> {
    /// Of a child that stops as it becomes the command.
    fn new(root: pid_t, point: Option<&'a Point>) -> std::io::Result<Self> {
        let mut status = 0;
        // SAFETY: `status` outlives the call.
        let waited = unsafe { libc::waitpid(root, &raw mut status, libc::__WALL) };
        if waited != root || !libc::WIFSTOPPED(status) {
            return Err(std::io::Error::other(
                "the command does not stop to be traced",
            ));
        }
        let options = libc::PTRACE_O_TRACESYSGOOD
            | libc::PTRACE_O_EXITKILL
            | libc::PTRACE_O_TRACEFORK
            | libc::PTRACE_O_TRACEVFORK
            | libc::PTRACE_O_TRACECLONE
            | libc::PTRACE_O_TRACEEXEC;
        ptrace(libc::PTRACE_SETOPTIONS as c_int, root, 0, options as usize)?;
        let host = Process {
            name: "host".into(),
            kind: Kind::Host,
            children: 0,
            prepared: 0,
        };
        let mut tracer = Self {
            root,
            point,
            processes: vec![host],
            tasks: BTreeMap::new(),
            early: Vec::new(),
            census: Census::new(),
            spoiled: false,
            spawned: 0,
            supervisors: 0,
        };
        tracer.adopt(root, 0, true);
        go_on(root, 0);
        Ok(tracer)
    }

    fn adopt(&mut self, pid: pid_t, process: usize, begun: bool) {
        let task = Task {
            process,
            result: None,
            begun,
        };
        self.tasks.insert(pid, task);
    }

    fn follow(mut self) -> Followed {
        let mut ended = None;
        while ended.is_none() || !self.tasks.is_empty() {
            let mut status = 0;
            // SAFETY: `status` outlives the call.
            let pid =
                unsafe { libc::waitpid(-1, &raw mut status, libc::__WALL | libc::__WNOTHREAD) };
            if pid < 0 {
                if std::io::Error::last_os_error().raw_os_error() == Some(libc::EINTR) {
                    continue;
                }
                break;
            }
            if libc::WIFSTOPPED(status) {
                self.stopped(pid, status);
            } else {
                self.tasks.remove(&pid);
                if pid == self.root {
                    ended = Some(ExitStatus::from_raw(status));
                }
            }
        }
        Followed {
            status: ended,
            census: self.census,
            spoiled: self.spoiled,
        }
    }

    fn stopped(&mut self, pid: pid_t, status: c_int) {
        let signal = libc::WSTOPSIG(status);
        let event = status >> 16;
        if !self.tasks.contains_key(&pid) {
            // The first stop of somebody whose parent's stop comes later.
            self.early.push(pid);
            return;
        }
        let mut deliver = 0;
        match event {
            libc::PTRACE_EVENT_FORK | libc::PTRACE_EVENT_VFORK | libc::PTRACE_EVENT_CLONE => {
                self.started(pid, event);
            }
            libc::PTRACE_EVENT_EXEC => {
                if !self.executed(pid) {
                    return self.leave(pid, 0);
                }
            }
            _ if signal == libc::SIGTRAP | 0x80 => {
                if !self.call(pid) {
                    return self.leave(pid, 0);
                }
            }
            _ => {
                let task = self.tasks.get_mut(&pid);
                let first = task.is_some_and(|task| !std::mem::replace(&mut task.begun, true));
                if !(first && signal == libc::SIGSTOP) {
                    deliver = signal;
                }
            }
        }
        if self.spoiled
            && self
                .tasks
                .get(&pid)
                .is_none_or(|task| task.result.is_none())
        {
            return self.leave(pid, deliver);
        }
        go_on(pid, deliver);
    }

    /// Follows somebody no longer.
    fn leave(&mut self, pid: pid_t, signal: c_int) {
        if ptrace(libc::PTRACE_DETACH as c_int, pid, 0, signal as usize).is_ok() {
            self.tasks.remove(&pid);
        }
    }

    /// Somebody has started a process or a thread.
    fn started(&mut self, parent: pid_t, event: c_int) {
        let mut message: libc::c_ulong = 0;
        let told = ptrace(
            libc::PTRACE_GETEVENTMSG as c_int,
            parent,
            0,
            &raw mut message as usize,
        );
        let (Ok(_), Some(task)) = (told, self.tasks.get(&parent)) else {
            return;
        };
        let child = message as pid_t;
        let mut process = task.process;
        if event != libc::PTRACE_EVENT_CLONE {
            process = self.processes.len();
            let parent = &mut self.processes[task.process];
            let (kind, name) = match parent.kind {
                Kind::Host => {
                    self.spawned += 1;
                    (Kind::Spawned, format!("spawned-{}", self.spawned))
                }
                Kind::Supervisor => {
                    parent.children += 1;
                    let number = parent.name.trim_start_matches("supervisor-");
                    (Kind::Inside, format!("inside-{number}.{}", parent.children))
                }
                Kind::Inside => {
                    let number = parent.name.trim_start_matches("inside-");
                    (Kind::Plugin, format!("plugin-{number}"))
                }
                other => (other, parent.name.clone()),
            };
            self.processes.push(Process {
                name,
                kind,
                children: 0,
                prepared: 2,
            });
        }
        let early = self.early.iter().position(|pid| *pid == child);
        self.adopt(child, process, early.is_some());
        if let Some(index) = early {
            self.early.remove(index);
            if self.spoiled {
                self.leave(child, 0);
            } else {
                go_on(child, 0);
            }
        }
    }

    /// Somebody has become another program; whether it is still to be followed.
    fn executed(&mut self, pid: pid_t) -> bool {
        let Some(task) = self.tasks.get_mut(&pid) else {
            return false;
        };
        // The call that did it has a stop of its own.
        let words = fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
        let supervises = words.split(|byte| *byte == 0).nth(1) == Some(b"__supervise");
        if !supervises {
            return false;
        }
        self.supervisors += 1;
        self.processes[task.process] = Process {
            name: format!("supervisor-{}", self.supervisors),
            kind: Kind::Supervisor,
            children: 0,
            prepared: 0,
        };
        true
    }

    /// At the beginning or the end of a call; whether somebody is still to be followed.
    fn call(&mut self, pid: pid_t) -> bool {
        let Some(task) = self.tasks.get_mut(&pid) else {
            return false;
        };
        let mut info = MaybeUninit::<libc::ptrace_syscall_info>::zeroed();
        let size = size_of::<libc::ptrace_syscall_info>();
        if ptrace(
            libc::PTRACE_GET_SYSCALL_INFO as c_int,
            pid,
            size,
            info.as_mut_ptr() as usize,
        )
        .is_err()
        {
            return true;
        }
        // SAFETY: all zero is a value, and the call has filled it in.
        let info = unsafe { info.assume_init() };
        let of = task.process;
        let process = &mut self.processes[of];
        if info.op == libc::PTRACE_SYSCALL_INFO_EXIT {
            if let Some(result) = task.result.take() {
                set_result(pid, result);
            }
            return true;
        }
        if info.op != libc::PTRACE_SYSCALL_INFO_ENTRY {
            return true;
        }
        // SAFETY: this member is the one of such a stop.
        let entry = unsafe { info.u.entry };
        let number = entry.nr as i64;
        if process.prepared < 2 {
            // What loader and language do before `main` is theirs.
            process.prepared += u32::from(number == number::sigaltstack);
            return true;
        }
        let Some((name, _)) = class(number).filter(|_| is_ours(number, &entry)) else {
            return true;
        };
        let nth = self.census.entry((process.name.clone(), name)).or_insert(0);
        *nth += 1;
        if let Some(point) = self.point.filter(|point| {
            !self.spoiled
                && (point.process == process.name)
                && point.call == name
                && point.nth == *nth
        }) {
            self.spoiled = true;
            match point.wrong {
                Wrong::Fails(Errno(errno, _)) => {
                    skip(pid);
                    task.result = Some(-i64::from(errno));
                }
                Wrong::Lies(Errno(errno, _)) => task.result = Some(-i64::from(errno)),
                Wrong::Short if entry.args[2] > 1 && !is_taken_whole(pid, entry.args[0]) => {
                    set_length(pid, 1);
                }
                Wrong::Short => {}
                Wrong::Killed => self.kill_all(),
            }
        }
        let (process, task) = (&self.processes[of], &self.tasks[&pid]);
        // What comes after that is the plugin's.
        !(process.kind == Kind::Plugin && number == number::close_range) || task.result.is_some()
    }
}

impl Tracer<'_> {
    /// Kills the host and all that are, or are about to be, its supervisors.
    fn kill_all(&self) {
        for (pid, task) in &self.tasks {
            let kind = self.processes[task.process].kind;
            if matches!(kind, Kind::Host | Kind::Spawned | Kind::Supervisor) {
                // SAFETY: a plain system call; who is traced keeps its number until it is
                // waited for.
                unsafe { libc::kill(*pid, libc::SIGKILL) };
            }
        }
    }
}

/// Lets a process go on to its next system call.
fn go_on(pid: pid_t, signal: c_int) {
    // One that was killed meanwhile is reported as such.
    let _ = ptrace(libc::PTRACE_SYSCALL as c_int, pid, 0, signal as usize);
}

/// A file of a control group takes what is written as a whole or not at all, and the first digit of a
/// process's number is another process.
fn is_taken_whole(pid: pid_t, descriptor: u64) -> bool {
    fs::read_link(format!("/proc/{pid}/fd/{descriptor}"))
        .is_ok_and(|file| file.starts_with("/sys/fs/cgroup"))
}

/// Leaves out memory that is no file's, and the eight bytes by which the standard library hears
/// whether a process could be started: it takes no error for an answer.
fn is_ours(number: i64, entry: &libc::__c_anonymous_ptrace_syscall_info_entry) -> bool {
    match number {
        number::mmap => i32::try_from(entry.args[4] as u32).is_ok(),
        number::recvfrom => entry.args[2] != 8,
        _ => true,
    }
}

#[cfg(target_arch = "x86_64")]
fn change(pid: pid_t, change: impl FnOnce(&mut libc::user_regs_struct)) {
    let mut registers = MaybeUninit::<libc::user_regs_struct>::zeroed();
    let address = registers.as_mut_ptr() as usize;
    if ptrace(libc::PTRACE_GETREGS as c_int, pid, 0, address).is_ok() {
        // SAFETY: the call has filled it in.
        change(unsafe { registers.assume_init_mut() });
        let _ = ptrace(libc::PTRACE_SETREGS as c_int, pid, 0, address);
    }
}

/// The call that somebody is about to make is made no more.
#[cfg(target_arch = "x86_64")]
fn skip(pid: pid_t) {
    change(pid, |registers| registers.orig_rax = u64::MAX);
}

#[cfg(target_arch = "x86_64")]
fn set_result(pid: pid_t, result: i64) {
    change(pid, |registers| registers.rax = result as u64);
}

#[cfg(target_arch = "x86_64")]
fn set_length(pid: pid_t, bytes: u64) {
    change(pid, |registers| registers.rdx = bytes);
}

#[cfg(target_arch = "aarch64")]
fn change(pid: pid_t, change: impl FnOnce(&mut libc::user_regs_struct)) {
    let mut registers = MaybeUninit::<libc::user_regs_struct>::zeroed();
    let mut vector = libc::iovec {
        iov_base: registers.as_mut_ptr().cast(),
        iov_len: size_of::<libc::user_regs_struct>(),
    };
    let (set, address) = (libc::NT_PRSTATUS as usize, &raw mut vector as usize);
    if ptrace(libc::PTRACE_GETREGSET as c_int, pid, set, address).is_ok() {
        // SAFETY: the call has filled it in.
        change(unsafe { registers.assume_init_mut() });
        let _ = ptrace(libc::PTRACE_SETREGSET as c_int, pid, set, address);
    }
}

/// The call that somebody is about to make is made no more.
#[cfg(target_arch = "aarch64")]
fn skip(pid: pid_t) {
    const NT_ARM_SYSTEM_CALL: usize = 0x404;
    let mut none: c_int = -1;
    let mut vector = libc::iovec {
        iov_base: (&raw mut none).cast(),
        iov_len: size_of::<c_int>(),
    };
    let address = &raw mut vector as usize;
    let _ = ptrace(
        libc::PTRACE_SETREGSET as c_int,
        pid,
        NT_ARM_SYSTEM_CALL,
        address,
    );
}

#[cfg(target_arch = "aarch64")]
fn set_result(pid: pid_t, result: i64) {
    change(pid, |registers| registers.regs[0] = result as u64);
}

#[cfg(target_arch = "aarch64")]
fn set_length(pid: pid_t, bytes: u64) {
    change(pid, |registers| registers.regs[2] = bytes);
}

#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
fn skip(_: pid_t) {}

#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
fn set_result(_: pid_t, _: i64) {}

#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
fn set_length(_: pid_t, _: u64) {}

//! State of the process that a library called in the host's own process must not change.
//!
//! A library's code may change what belongs to the whole process or to the thread that
//! calls it: how numbers are rounded, which signals arrive, where files go. One that was
//! linked with `-ffast-math` does so by being loaded. Whatever the host computes later would
//! come out otherwise, in silence. So around every call this is looked at, put back, and
//! what was found is kept for the record.
//!
//! The thread's own state is looked at around every call, which costs a microsecond or two. The
//! process's takes ten times as long, so that calls that follow each other at once are looked at
//! together, once in a millisecond.

use std::ffi::{CStr, CString, OsStr, c_char};
use std::os::fd::{AsRawFd, BorrowedFd, OwnedFd, RawFd};
use std::os::unix::ffi::OsStrExt;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

use fleetyard_abi::monotonic_ns;
use rustix::fs::{CWD, Mode, OFlags, Stat, fstat, openat, stat};
use serde::Serialize;

use self::arithmetic::Arithmetic;
use crate::fault::signal_name;

/// The time for which nobody looks at the process again while one call follows the other.
const PAUSE_NS: u64 = 1_000_000;

/// Something of the host's process that a library did not leave as it found it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct BrokenPromise {
    /// The call after which it was found.
    pub during: String,
    /// The thing that was changed.
    pub what: String,
    /// True if it is as it was again.
    pub undone: bool,
    /// True if it was this plugin and no other: several may be called at the same time.
    pub certain: bool,
}

impl std::fmt::Display for BrokenPromise {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { during, what, .. } = self;
        write!(f, "`{during}`")?;
        if !self.certain {
            f.write_str(", or another plugin beside it,")?;
        }
        write!(f, " did not leave {what} as it was")?;
        if !self.undone {
            f.write_str(", and it cannot be put back")?;
        }
        Ok(())
    }
}

/// Something that was found changed.
struct Change {
    what: String,
    undone: bool,
}

impl Change {
    fn new(what: impl Into<String>, undone: bool) -> Self {
        Self {
            what: what.into(),
            undone,
        }
    }
}

/// Stands around the calls into one library.
#[derive(Debug)]
pub(crate) struct Promises {
    /// Number of the library.
    owner: u64,
    broken: Vec<BrokenPromise>,
}

impl Promises {
    /// For a library that was not called yet.
    pub(crate) fn new() -> Self {
        static OWNERS: AtomicU64 = AtomicU64::new(0);
        Self {
            owner: OWNERS.fetch_add(1, Ordering::Relaxed),
            broken: Vec::new(),
        }
    }

    /// Makes a call into the library, and puts back what it changed.
    pub(crate) fn around<T>(&mut self, during: &'static str, call: impl FnOnce() -> T) -> T {
        shared().enter((self.owner, during));
        let thread = Thread::take();
        let result = call();
        // Before anything is computed here.
        let arithmetic = thread.arithmetic.restore();
        let mut changes: Vec<Change> = arithmetic
            .into_iter()
            .map(|what| Change::new(what, true))
            .collect();
        let blocked = thread.blocked();
        shared().leave((self.owner, during), blocked);
        // After the handlers: a signal that was blocked arrives now.
        thread.restore(blocked, &mut changes);
        for Change { what, undone } in changes {
            self.keep(BrokenPromise {
                during: during.into(),
                what,
                undone,
                certain: true,
            });
        }
        result
    }

    /// Looks at the process if nobody did since the last call.
    pub(crate) fn settle(&mut self) {
        let mut shared = shared();
        if shared
            .suspects
            .iter()
            .any(|(owner, _)| *owner == self.owner)
        {
            shared.look();
        }
        let found = shared
            .found
            .extract_if(.., |(owner, _)| *owner == self.owner);
        let found: Vec<_> = found.collect();
        drop(shared);
        for (_, broken) in found {
            self.keep(broken);
        }
    }

    fn keep(&mut self, broken: BrokenPromise) {
        if !self.broken.contains(&broken) {
            self.broken.push(broken);
        }
    }

    /// Promises found broken until they were settled, each once.
    pub(crate) fn broken(&self) -> &[BrokenPromise] {
        &self.broken
    }
}

impl Drop for Promises {
    fn drop(&mut self) {
        // Nobody will ask for what is found, but it has to be put back.
        self.settle();
    }
}

// ---- What is the process's ---------------------------------------------------------

/// A library and the call into it.
type Caller = (u64, &'static str);

/// The process as it was found, for all libraries together: of two that are called at the
/// same time, the one that ends last must not take for its own what the other has changed.
struct Shared {
    before: Option<Process>,
    /// Calls that are under way.
    calls: Vec<Caller>,
    /// The last call of each library since the process was looked at.
    suspects: Vec<Caller>,
    /// The broken promises, with the library that may have done it, until they are collected.
    found: Vec<(u64, BrokenPromise)>,
    looked_ns: u64,
    /// True if the process was looked at when the calls that are under way began, so that
    /// it has to be when they end.
    watched: bool,
}

static SHARED: Mutex<Shared> = Mutex::new(Shared {
    before: None,
    calls: Vec::new(),
    suspects: Vec::new(),
    found: Vec::new(),
    looked_ns: 0,
    watched: false,
});

fn shared() -> MutexGuard<'static, Shared> {
    // Whoever panicked here left plain values behind.
    SHARED.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Shared {
    fn enter(&mut self, caller: Caller) {
        if self.calls.is_empty() && self.is_due() {
            if self.suspects.is_empty() {
                self.before = Some(Process::take());
                self.watched = true;
            } else {
                // One call follows the other: what the last ones left is looked for, and
                // nothing is known of the host's own changes in between.
                self.look();
            }
        }
        self.calls.push(caller);
    }

    fn leave(&mut self, caller: Caller, now: bool) {
        if let Some(at) = self.calls.iter().position(|call| *call == caller) {
            self.calls.swap_remove(at);
        }
        self.suspects.retain(|(owner, _)| *owner != caller.0);
        self.suspects.push(caller);
        if now || self.watched || self.is_due() {
            self.look();
        }
    }

    fn is_due(&self) -> bool {
        monotonic_ns().saturating_sub(self.looked_ns) >= PAUSE_NS
    }

    /// Puts back what has changed; whoever was called since, or is, may have done it.
    fn look(&mut self) {
        let mut changes = Vec::new();
        if let Some(before) = &self.before {
            before.restore(&mut changes);
        }
        if changes.iter().any(|change| !change.undone) {
            // It stays, and is told once.
            self.before = Some(Process::take());
        }
        let mut suspects = std::mem::take(&mut self.suspects);
        suspects.extend(&self.calls);
        for Change { what, undone } in changes {
            for (owner, during) in &suspects {
                let broken = BrokenPromise {
                    during: (*during).into(),
                    what: what.clone(),
                    undone,
                    certain: suspects.iter().all(|(other, _)| other == owner),
                };
                self.found.push((*owner, broken));
            }
        }
        self.watched = !self.calls.is_empty();
        self.looked_ns = monotonic_ns();
    }
}

struct Process {
    handlers: Vec<(i32, libc::sigaction)>,
    umask: libc::mode_t,
    folder: Option<(OwnedFd, Stat)>,
    locale: Option<CString>,
    environment: Vec<u8>,
    limits: Vec<(Limit, libc::rlimit)>,
    timers: [bool; 3],
    streams: [Option<Stat>; 3],
}

impl Process {
    fn take() -> Self {
        let folder = || {
            let flags = OFlags::PATH | OFlags::DIRECTORY | OFlags::CLOEXEC;
            let folder = openat(CWD, ".", flags, Mode::empty()).ok()?;
            let is = fstat(&folder).ok()?;
            Some((folder, is))
        };
        Self {
            handlers: signals().collect(),
            umask: known_umask(),
            folder: folder(),
            locale: locale().map(CStr::to_owned),
            environment: environment()
                .flat_map(CStr::to_bytes_with_nul)
                .copied()
                .collect(),
            limits: LIMITS
                .iter()
                .filter_map(|limit| Some((*limit, limit.get()?)))
                .collect(),
            timers: TIMERS.map(|(which, _)| is_armed(which)),
            streams: [0, 1, 2].map(|number| keep_streams()[number].as_ref().and(stream(number))),
        }
    }

    fn restore(&self, changes: &mut Vec<Change>) {
        self.restore_signals(changes);
        // One call that asks and answers, so that no other thread sees the plugin's for
        // longer than need be.
        // SAFETY: it has no precondition.
        let umask = unsafe { libc::umask(self.umask) };
        if umask != self.umask {
            let what = format!("the umask ({umask:04o} instead of {:04o})", self.umask);
            changes.push(Change::new(what, true));
        }
        if let Some((folder, is)) = &self.folder
            && !stat(".").is_ok_and(|now| is_same(&now, is))
        {
            let undone = rustix::process::fchdir(folder).is_ok();
            changes.push(Change::new("the working directory", undone));
        }
        if let Some(old) = &self.locale
            && locale() != Some(old)
        {
            // SAFETY: the name is the one that the locale had.
            let undone = !unsafe { libc::setlocale(libc::LC_ALL, old.as_ptr()) }.is_null();
            changes.push(Change::new("the locale", undone));
        }
        self.restore_environment(changes);
        for (limit, old) in &self.limits {
            match limit.get() {
                Some(now) if (now.rlim_cur, now.rlim_max) != (old.rlim_cur, old.rlim_max) => {
                    let undone = limit.set(old);
                    if !undone {
                        // The hard limit is lost, but not what there is below it.
                        limit.set(&libc::rlimit {
                            rlim_cur: old.rlim_cur.min(now.rlim_max),
                            rlim_max: now.rlim_max,
                        });
                    }
                    changes.push(Change::new(format!("the limit of {}", limit.name), undone));
                }
                _ => {}
            }
        }
        for ((which, name), was_armed) in TIMERS.into_iter().zip(self.timers) {
            if !was_armed && is_armed(which) {
                changes.push(Change::new(name, disarm(which)));
            }
        }
        for (number, old) in self.streams.iter().enumerate() {
            if let (Some(old), Some(kept)) = (old, &keep_streams()[number])
                && !stream(number).is_some_and(|now| is_same(&now, old))
            {
                // SAFETY: it takes numbers; what had the number is nobody's any more.
                let undone = unsafe { libc::dup2(kept.as_raw_fd(), number as RawFd) } >= 0;
                changes.push(Change::new(STREAMS[number], undone));
            }
        }
    }

    fn restore_signals(&self, changes: &mut Vec<Change>) {
        let mut names: Vec<String> = Vec::new();
        for ((signal, old), (_, now)) in self.handlers.iter().zip(signals()) {
            if !is_same_action(old, &now) {
                // SAFETY: the action is the one that the signal had.
                unsafe { libc::sigaction(*signal, old, std::ptr::null_mut()) };
                names.push(match signal_name(*signal) {
                    "a signal" => format!("signal {signal}"),
                    name => name.into(),
                });
            }
        }
        let what = match names.as_slice() {
            [] => return,
            [name] => format!("the handler of {name}"),
            [first, more @ ..] if more.len() > 3 => {
                format!("the handlers of {first} and {} other signals", more.len())
            }
            names => format!("the handlers of {}", names.join(", ")),
        };
        changes.push(Change::new(what, true));
    }

    fn restore_environment(&self, changes: &mut Vec<Change>) {
        let mut rest = self.environment.as_slice();
        let same = environment().all(|now| {
            let now = now.to_bytes_with_nul();
            let same = rest.starts_with(now);
            rest = &rest[if same { now.len() } else { 0 }..];
            same
        });
        if same && rest.is_empty() {
            return;
        }
        let split = |variable: &[u8]| {
            // A name may begin with `=`.
            let at = variable.iter().skip(1).position(|byte| *byte == b'=')? + 1;
            Some((variable[..at].to_vec(), variable[at + 1..].to_vec()))
        };
        let old: Vec<_> = self
            .environment
            .split(|byte| *byte == 0)
            .filter_map(split)
            .collect();
        let now: Vec<_> = environment()
            .filter_map(|variable| split(variable.to_bytes()))
            .collect();
        let mut names = Vec::new();
        for (name, value) in old.iter().filter(|variable| !now.contains(variable)) {
            // SAFETY: the library has just done the same, and is no longer running.
            unsafe { std::env::set_var(OsStr::from_bytes(name), OsStr::from_bytes(value)) };
            names.push(name);
        }
        for (name, _) in &now {
            if !old.iter().any(|(old, _)| old == name) {
                // SAFETY: as above.
                unsafe { std::env::remove_var(OsStr::from_bytes(name)) };
                names.push(name);
            }
        }
        let Some(first) = names.first() else { return };
        let first = String::from_utf8_lossy(first);
        let first: String = first.escape_debug().take(60).collect();
        let what = match names.len() - 1 {
            0 => format!("the environment variable {first}"),
            more => format!("the environment variable {first} and {more} more"),
        };
        changes.push(Change::new(what, true));
    }
}

/// Every signal whose handling can be changed, with how it is handled.
fn signals() -> impl Iterator<Item = (i32, libc::sigaction)> {
    const LAST: i32 = 64;
    (1..=LAST).filter_map(|signal| {
        // SAFETY: zero is a valid action, and is filled.
        unsafe {
            let mut action: libc::sigaction = std::mem::zeroed();
            let known = libc::sigaction(signal, std::ptr::null(), &raw mut action) == 0;
            known.then_some((signal, action))
        }
    })
}

fn is_same_action(one: &libc::sigaction, other: &libc::sigaction) -> bool {
    // Set by the C library, whenever it sets an action.
    const RESTORER: i32 = 0x0400_0000;
    let parts = |action: &libc::sigaction| {
        let mask = word(&action.sa_mask);
        (action.sa_sigaction, action.sa_flags & !RESTORER, mask)
    };
    parts(one) == parts(other)
}

/// The part of a set of signals that the kernel knows.
fn word(set: &libc::sigset_t) -> u64 {
    const { assert!(size_of::<libc::sigset_t>() >= size_of::<u64>()) };
    // SAFETY: a set has at least that many bytes, of which any are a value.
    unsafe { std::ptr::from_ref(set).cast::<u64>().read_unaligned() }
}

/// The umask of the host, which does not change it.
fn known_umask() -> libc::mode_t {
    static KNOWN: OnceLock<libc::mode_t> = OnceLock::new();
    *KNOWN.get_or_init(|| {
        let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        let line = status.lines().find_map(|line| line.strip_prefix("Umask:"));
        let told = line.and_then(|text| libc::mode_t::from_str_radix(text.trim(), 8).ok());
        told.unwrap_or_else(|| {
            // SAFETY: it has no precondition. In between files are for nobody but us.
            unsafe {
                let umask = libc::umask(0o077);
                libc::umask(umask);
                umask
            }
        })
    })
}

fn is_same(one: &Stat, other: &Stat) -> bool {
    (one.st_dev, one.st_ino, one.st_rdev) == (other.st_dev, other.st_ino, other.st_rdev)
}

fn locale() -> Option<&'static CStr> {
    // SAFETY: the text lives until the locale changes, and is looked at before.
    unsafe {
        let name = libc::setlocale(libc::LC_ALL, std::ptr::null());
        (!name.is_null()).then(|| CStr::from_ptr(name))
    }
}

fn environment() -> impl Iterator<Item = &'static CStr> {
    unsafe extern "C" {
        static mut environ: *const *const c_char;
    }
    // SAFETY: the C library's array of texts, whose last one is null; the host does not
    // change it, and no library is running that would.
    let mut next = unsafe { environ };
    std::iter::from_fn(move || {
        // SAFETY: as above.
        unsafe {
            if next.is_null() || (*next).is_null() {
                return None;
            }
            let text = CStr::from_ptr(*next);
            next = next.add(1);
            Some(text)
        }
    })
}

/// A resource of the process.
#[derive(Clone, Copy)]
struct Limit {
    // The C libraries do not agree on its type.
    resource: i32,
    name: &'static str,
}

macro_rules! limits {
    ($($resource:ident $name:literal)*) => {
        const LIMITS: &[Limit] = &[$(Limit { resource: libc::$resource as i32, name: $name },)*];
    };
}

limits! {
    RLIMIT_CPU "processor time"
    RLIMIT_FSIZE "the size of files"
    RLIMIT_DATA "data"
    RLIMIT_STACK "the stack"
    RLIMIT_CORE "core files"
    RLIMIT_RSS "resident memory"
    RLIMIT_NPROC "processes"
    RLIMIT_NOFILE "open files"
    RLIMIT_MEMLOCK "locked memory"
    RLIMIT_AS "addresses"
    RLIMIT_LOCKS "file locks"
    RLIMIT_SIGPENDING "pending signals"
    RLIMIT_MSGQUEUE "message queues"
    RLIMIT_NICE "nice values"
    RLIMIT_RTPRIO "real-time priorities"
    RLIMIT_RTTIME "real-time processor time"
}

impl Limit {
    fn get(self) -> Option<libc::rlimit> {
        // SAFETY: the structure is valid, and filled.
        unsafe {
            let mut limit: libc::rlimit = std::mem::zeroed();
            (libc::getrlimit(self.resource as _, &raw mut limit) == 0).then_some(limit)
        }
    }

    fn set(self, limit: &libc::rlimit) -> bool {
        // SAFETY: the structure is valid.
        unsafe { libc::setrlimit(self.resource as _, limit) == 0 }
    }
}

/// Timers that end in a signal, by their numbers in the kernel.
const TIMERS: [(libc::c_long, &str); 3] = [
    (0, "the timer of wall time"),
    (1, "the timer of its processor time"),
    (2, "the timer of all processor time"),
];

/// Seconds and microseconds of a timer's interval and of what is left of it.
type Timer = [libc::c_long; 4];

fn is_armed(which: libc::c_long) -> bool {
    let mut timer: Timer = [0; 4];
    // SAFETY: the room is as large as what is written.
    let code = unsafe { libc::syscall(libc::SYS_getitimer, which, timer.as_mut_ptr()) };
    code == 0 && timer[2..] != [0, 0]
}

fn disarm(which: libc::c_long) -> bool {
    let never: Timer = [0; 4];
    let nothing = std::ptr::null_mut::<Timer>();
    // SAFETY: the timer is valid, and nothing is written.
    unsafe { libc::syscall(libc::SYS_setitimer, which, never.as_ptr(), nothing) == 0 }
}

const STREAMS: [&str; 3] = ["standard input", "standard output", "standard error"];

/// Copies of the standard streams, made before the first call.
fn keep_streams() -> &'static [Option<OwnedFd>; 3] {
    static KEPT: OnceLock<[Option<OwnedFd>; 3]> = OnceLock::new();
    KEPT.get_or_init(|| {
        [0, 1, 2].map(|number| {
            // SAFETY: it is only copied, and one that is closed is no stream.
            let stream = unsafe { BorrowedFd::borrow_raw(number) };
            rustix::io::fcntl_dupfd_cloexec(stream, 3).ok()
        })
    })
}

fn stream(number: usize) -> Option<Stat> {
    // SAFETY: it is only asked about, and one that is closed is an error.
    fstat(unsafe { BorrowedFd::borrow_raw(number as RawFd) }).ok()
}

// ---- What is the thread's ----------------------------------------------------------

/// The thread that makes a call, as it was.
struct Thread {
    arithmetic: Arithmetic,
    mask: libc::sigset_t,
    locale: libc::locale_t,
    nice: i32,
    policy: i32,
    cpus: libc::cpu_set_t,
    name: [u8; 16],
}

impl Thread {
    fn take() -> Self {
        // SAFETY: plain system calls that ask; zero is a valid value of what they fill.
        unsafe {
            let mut cpus: libc::cpu_set_t = std::mem::zeroed();
            libc::sched_getaffinity(0, size_of::<libc::cpu_set_t>(), &raw mut cpus);
            let mut name = [0; 16];
            libc::prctl(libc::PR_GET_NAME, name.as_mut_ptr());
            Self {
                mask: mask(),
                locale: libc::uselocale(std::ptr::null_mut()),
                nice: libc::getpriority(libc::PRIO_PROCESS, 0),
                policy: libc::sched_getscheduler(0),
                cpus,
                name,
                // Last, so that nothing of ours is between it and the call.
                arithmetic: Arithmetic::take(),
            }
        }
    }

    /// True if another set of signals is blocked now.
    fn blocked(&self) -> bool {
        word(&mask()) != word(&self.mask)
    }

    /// Puts back all but the arithmetic.
    fn restore(&self, blocked: bool, changes: &mut Vec<Change>) {
        let mut changed = |what: &str, undone: bool| changes.push(Change::new(what, undone));
        if blocked {
            // SAFETY: the set is the one that was blocked before.
            let code = unsafe {
                libc::pthread_sigmask(
                    libc::SIG_SETMASK,
                    &raw const self.mask,
                    std::ptr::null_mut(),
                )
            };
            changed("the signal mask", code == 0);
        }
        let now = Self::take();
        if now.locale != self.locale {
            // SAFETY: the locale is the one that the thread had.
            let undone = !unsafe { libc::uselocale(self.locale) }.is_null();
            changed("the thread's locale", undone);
        }
        if now.policy != self.policy {
            // SAFETY: the structure is valid; only real-time policies have a priority.
            let undone = unsafe {
                let parameters: libc::sched_param = std::mem::zeroed();
                libc::sched_setscheduler(0, self.policy, &raw const parameters) == 0
            };
            changed("the scheduling policy", undone);
        }
        if now.nice != self.nice {
            // SAFETY: it takes numbers.
            let undone = unsafe { libc::setpriority(libc::PRIO_PROCESS, 0, self.nice) } == 0;
            changed("the nice value", undone);
        }
        // SAFETY: both sets are valid.
        if !unsafe { libc::CPU_EQUAL(&now.cpus, &self.cpus) } {
            let size = size_of::<libc::cpu_set_t>();
            // SAFETY: the set is valid, and as long as it is said to be.
            let undone = unsafe { libc::sched_setaffinity(0, size, &raw const self.cpus) } == 0;
            changed("the processors that the thread may run on", undone);
        }
        if now.name != self.name {
            // SAFETY: the name ends with a zero.
            let undone = unsafe { libc::prctl(libc::PR_SET_NAME, self.name.as_ptr()) } == 0;
            changed("the thread's name", undone);
        }
    }
}

/// The signals that this thread has blocked.
fn mask() -> libc::sigset_t {
    // SAFETY: zero is a valid set, and is filled.
    unsafe {
        let mut mask: libc::sigset_t = std::mem::zeroed();
        libc::pthread_sigmask(libc::SIG_BLOCK, std::ptr::null(), &raw mut mask);
        mask
    }
}

/// The floating-point state of this thread.
#[cfg(target_arch = "x86_64")]
mod arithmetic {
    use std::arch::asm;

    /// Denormal operands and results that count as zero.
    const FLUSHED: u32 = 1 << 15 | 1 << 6;
    const ROUNDING: u32 = 0b11 << 13;
    const MASKS: u32 = 0b11_1111 << 7;
    const X87_MASKS: u16 = 0b11_1111;
    const X87_PRECISION: u16 = 0b11 << 8;
    const X87_ROUNDING: u16 = 0b11 << 10;
    /// Strings backwards, and a trap for every address that is not aligned.
    const FLAGS: u64 = 1 << 10 | 1 << 18;

    pub(super) struct Arithmetic {
        mxcsr: u32,
        x87: u16,
        flags: u64,
    }

    impl Arithmetic {
        pub(super) fn take() -> Self {
            let (mut mxcsr, mut x87, flags) = (0_u32, 0_u16, 0_u64);
            let flags = {
                let mut read = flags;
                // SAFETY: the registers are stored, into values that are as large.
                unsafe {
                    asm!("stmxcsr [{}]", in(reg) &raw mut mxcsr, options(nostack, preserves_flags));
                    asm!("fnstcw [{}]", in(reg) &raw mut x87, options(nostack, preserves_flags));
                    asm!("pushfq", "pop {}", out(reg) read, options(preserves_flags));
                }
                read
            };
            Self {
                mxcsr,
                x87,
                flags: flags & FLAGS,
            }
        }

        /// Puts it back, and says what was changed. To be called before anything else is
        /// computed.
        pub(super) fn restore(&self) -> Vec<&'static str> {
            let now = Self::take();
            if now.flags != self.flags {
                let (mut flags, wanted) = (0_u64, self.flags);
                // SAFETY: but for these two, which were so before, the flags stay.
                unsafe {
                    asm!("pushfq", "pop {}", inout(reg) flags);
                    asm!("push {}", "popfq", in(reg) flags & !FLAGS | wanted);
                }
            }
            let control = FLUSHED | ROUNDING | MASKS;
            if (now.mxcsr ^ self.mxcsr) & control != 0 {
                // SAFETY: the value is the one that the register had.
                unsafe {
                    asm!("ldmxcsr [{}]", in(reg) &raw const self.mxcsr, options(nostack));
                }
            }
            if now.x87 != self.x87 {
                // SAFETY: as above. Nothing is on the stack of the x87 between calls, and
                // an exception that waits there would be a trap at the load.
                unsafe {
                    asm!("fninit", "fldcw [{}]", in(reg) &raw const self.x87, options(nostack));
                }
            }
            let sse = now.mxcsr ^ self.mxcsr;
            let x87 = now.x87 ^ self.x87;
            [
                (sse & FLUSHED != 0, "flush-to-zero of denormal numbers"),
                (
                    sse & ROUNDING != 0 || x87 & X87_ROUNDING != 0,
                    "the rounding of floating-point numbers",
                ),
                (
                    sse & MASKS != 0 || x87 & X87_MASKS != 0,
                    "the traps of floating-point exceptions",
                ),
                (x87 & X87_PRECISION != 0, "the precision of the x87"),
                (
                    now.flags != self.flags,
                    "the processor's direction and alignment flags",
                ),
            ]
            .into_iter()
            .filter_map(|(changed, what)| changed.then_some(what))
            .collect()
        }
    }
}

/// The floating-point state of this thread.
#[cfg(target_arch = "aarch64")]
mod arithmetic {
    use std::arch::asm;

    const FLUSHED: u64 = 1 << 24 | 1 << 19;
    const ROUNDING: u64 = 0b11 << 22;
    const TRAPS: u64 = 1 << 15 | 0b1_1111 << 8;
    const OTHERS: u64 = 0b11 << 25;

    pub(super) struct Arithmetic {
        fpcr: u64,
    }

    impl Arithmetic {
        pub(super) fn take() -> Self {
            let fpcr: u64;
            // SAFETY: the register is read.
            unsafe { asm!("mrs {}, fpcr", out(reg) fpcr, options(nostack, preserves_flags)) };
            Self { fpcr }
        }

        /// Puts it back, and says what was changed. To be called before anything else is
        /// computed.
        pub(super) fn restore(&self) -> Vec<&'static str> {
            let changed = Self::take().fpcr ^ self.fpcr;
            if changed != 0 {
                // SAFETY: the value is the one that the register had.
                unsafe { asm!("msr fpcr, {}", in(reg) self.fpcr, options(nostack)) };
            }
            [
                (FLUSHED, "flush-to-zero of denormal numbers"),
                (ROUNDING, "the rounding of floating-point numbers"),
                (TRAPS, "the traps of floating-point exceptions"),
                (OTHERS, "the form of numbers that are none"),
            ]
            .into_iter()
            .filter_map(|(bits, what)| (changed & bits != 0).then_some(what))
            .collect()
        }
    }
}

/// The floating-point state of this thread is not known here.
#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
mod arithmetic {
    pub(super) struct Arithmetic;

    impl Arithmetic {
        pub(super) fn take() -> Self {
            Self
        }

        pub(super) fn restore(&self) -> Vec<&'static str> {
            Vec::new()
        }
    }
}

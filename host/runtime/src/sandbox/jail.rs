//! Makes the namespaces, and is the first process in them.
//!
//! Three processes take part. The *supervisor*, outside, starts the *init* in new
//! namespaces and tells the kernel who it is there. The init builds the tree of
//! files, starts the *plugin's* process, waits for whoever loses its parent, and ends
//! everybody when it is told to or when the supervisor goes away: as the first
//! process of its namespace it can reach everybody in it at once, and none of them
//! can reach it. The plugin's process locks itself and becomes the plugin.
//!
//! A layer that the kernel refuses half-way is left out, and everything is tried
//! again without it.

use std::ffi::OsString;
use std::fs;
use std::io::{IoSlice, IoSliceMut};
use std::mem::MaybeUninit;
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, OwnedFd};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::Command;

use fleetyard_core::Digest;
use rustix::event::{PollFd, PollFlags, poll};
use rustix::fs::{Access, Mode, OFlags};
use rustix::io::Errno;
use rustix::net::{
    AddressFamily, RecvAncillaryBuffer, RecvAncillaryMessage, RecvFlags, SendAncillaryBuffer,
    SendAncillaryMessage, SendFlags, SocketFlags, SocketType, recvmsg, sendmsg, socketpair,
};
use rustix::pipe::{PipeFlags, pipe_with};
use rustix::process::{
    DumpableBehavior, Pid, PidfdFlags, Signal, WaitOptions, pidfd_open, pidfd_send_signal,
    set_dumpable_behavior, set_parent_process_death_signal, wait,
};
use rustix::time::Timespec;
use serde::{Deserialize, Serialize};

use super::grants::Grants;
use super::lock::{Lock, drop_capabilities};
use super::root::{INSIDE_USER, Root, SCRATCH, Trees, as_errno, take_as_root};
use super::{Backend, Layer, LayerState, Level, Policy, Refusal, SandboxReport, bwrap, errno_name};
use crate::cgroup::Cgroup;
use crate::measure::Cpus;
use crate::python::Python;
use crate::state;
use crate::supervisor::Target;
use crate::tree::{View, kill_descendants};

/// Users of sandboxes when the host is root: one per supervisor, far from those
/// that people and containers are given.
const FIRST_USER: u32 = 0x7000_0000;

/// What the host wants to be started.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Launch {
    pub(crate) target: Target,
    pub(crate) policy: Policy,
    /// For numerical libraries, which read it from the environment.
    pub(crate) threads: u32,
    /// The processors that the plugin may run on.
    pub(crate) cpus: Option<Cpus>,
    /// The memory limit until a call has one of its own; 0 for none.
    pub(crate) memory_bytes: u64,
    /// The interpreter of a program that is a script for it.
    pub(crate) python: Option<Python>,
    /// Stands for this run in the environment of all its processes.
    pub(crate) run: String,
}

/// What comes out of the sandbox; a packet is one message.
#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Packet {
    /// A layer was refused and the rest cannot stand as it is: try again without.
    Failed(Refusal),
    /// The tree stands; with it come descriptors of `/proc`, if it is a new one, and
    /// of the scratch folder.
    Ready(Vec<Refusal>),
    /// The plugin's process has locked itself, but for these.
    Locked(Vec<Refusal>),
    /// The plugin could not be started.
    CannotStart(String),
    /// Nobody is left.
    Ended(Ended),
}

/// How the plugin's process ended, and what all processes used.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
pub(crate) struct Ended {
    pub(crate) code: Option<i32>,
    pub(crate) signal: Option<i32>,
    pub(crate) user_us: u64,
    pub(crate) system_us: u64,
    pub(crate) max_rss_kb: u64,
    pub(crate) voluntary_switches: u64,
    pub(crate) involuntary_switches: u64,
    pub(crate) minor_faults: u64,
    pub(crate) major_faults: u64,
}

/// A plugin that was started.
pub(crate) struct Jail {
    init: Pid,
    init_fd: OwnedFd,
    link: OwnedFd,
    pub(crate) report: SandboxReport,
    pub(crate) cgroup: Option<Cgroup>,
    /// Stands for the plugin's whole environment.
    pub(crate) environment: Digest,
    /// Where its processes are seen.
    pub(crate) view: View,
    /// Its scratch folder.
    pub(crate) scratch: OwnedFd,
    /// Kept open for `view`.
    _proc: Option<OwnedFd>,
}

/// Why nothing was started.
pub(crate) struct NotStarted {
    pub(crate) report: SandboxReport,
    pub(crate) reason: String,
}

/// What is being tried.
struct Attempt<'a> {
    launch: &'a Launch,
    grants: &'a Grants,
    /// Layers that are asked for, without those that were refused.
    wanted: Vec<Layer>,
    refused: Vec<Refusal>,
    /// Layers that were not asked for, and why.
    left_out: Vec<(Layer, &'static str)>,
    /// A scratch folder on disk, for when there is no tree of our own.
    scratch: &'a Path,
    trees: Trees,
    backend: Backend,
}

impl Attempt<'_> {
    fn wants(&self, layer: Layer) -> bool {
        self.wanted.contains(&layer)
    }

    /// Leaves out a layer, and those that cannot be had without it.
    fn leave_out(&mut self, refusal: Refusal) {
        let with_it: &[Layer] = match refusal.layer {
            Layer::UserNamespace if !is_root() => &[
                Layer::PidNamespace,
                Layer::MountNamespace,
                Layer::NetworkNamespace,
                Layer::IpcNamespace,
                Layer::OwnProc,
            ],
            Layer::PidNamespace | Layer::MountNamespace => &[Layer::OwnProc],
            _ => &[],
        };
        for layer in with_it {
            if self.wants(*layer) {
                self.wanted.retain(|wanted| wanted != layer);
                let reason = format!("needs the {}", refusal.layer);
                self.refused.push(Refusal {
                    layer: *layer,
                    reason,
                    ..refusal
                });
            }
        }
        self.wanted.retain(|wanted| *wanted != refusal.layer);
        self.refused.push(refusal);
    }

    fn flags(&self) -> i32 {
        let all = [
            (Layer::UserNamespace, libc::CLONE_NEWUSER),
            (Layer::PidNamespace, libc::CLONE_NEWPID),
            (
                Layer::MountNamespace,
                libc::CLONE_NEWNS | libc::CLONE_NEWUTS,
            ),
            (Layer::NetworkNamespace, libc::CLONE_NEWNET),
            (Layer::IpcNamespace, libc::CLONE_NEWIPC),
        ];
        let wanted = all.into_iter().filter(|(layer, _)| self.wants(*layer));
        wanted.fold(0, |flags, (_, flag)| flags | flag)
    }

    fn report(&self) -> SandboxReport {
        let layers = Layer::ALL.map(|layer| {
            let refusal = self.refused.iter().find(|refusal| refusal.layer == layer);
            let left_out = self.left_out.iter().find(|(known, _)| *known == layer);
            LayerState {
                layer,
                active: self.wants(layer),
                errno: refusal.map(|refusal| errno_name(refusal.errno)),
                reason: refusal
                    .map(|refusal| refusal.reason.clone())
                    .or(left_out.map(|(_, reason)| (*reason).to_owned())),
            }
        });
        SandboxReport {
            level: self.launch.policy.level,
            backend: self.wants(Layer::PidNamespace).then_some(self.backend),
            layers: layers.into(),
        }
    }

    fn not_started(&self, reason: impl Into<String>) -> NotStarted {
        NotStarted {
            report: self.report(),
            reason: reason.into(),
        }
    }
}

fn is_root() -> bool {
    rustix::process::geteuid().is_root()
}

/// How one try ended.
enum Tried {
    Started(Jail),
    /// To be tried again without a layer.
    Refused(Refusal),
    /// Never mind the layers: this does not start.
    Hopeless(String),
}

/// Starts the plugin in as many layers as the machine grants. `become_plugin` is
/// called in the plugin's own process when everything is locked, for targets that
/// are not programs.
pub(crate) fn start(
    launch: &Launch,
    scratch: &Path,
    become_plugin: &dyn Fn() -> std::convert::Infallible,
) -> Result<Jail, NotStarted> {
    let grants = Grants::new(launch, Path::new(SCRATCH));
    let level = launch.policy.level;
    let mut left_out = Vec::new();
    let mut wanted: Vec<Layer> = Layer::ALL.to_vec();
    if level == Level::None {
        left_out.extend(wanted.drain(..).map(|layer| (layer, "level none")));
    } else {
        if launch.policy.network {
            wanted.retain(|layer| *layer != Layer::NetworkNamespace);
            left_out.push((Layer::NetworkNamespace, "the network was granted"));
        }
        if !is_root() {
            wanted.retain(|layer| *layer != Layer::OwnUser);
            left_out.push((Layer::OwnUser, "only root can give a user away"));
        }
    }
    let mut attempt = Attempt {
        launch,
        grants: &grants,
        wanted,
        refused: Vec::new(),
        left_out,
        scratch,
        trees: Trees::new(),
        backend: Backend::Own,
    };
    // What was refused to us before bwrap was tried.
    let mut own: Option<Refusal> = None;
    // Every refusal takes a layer away, so this ends.
    loop {
        let refusal = match attempt.once(become_plugin) {
            Tried::Started(jail) => return Ok(jail),
            Tried::Hopeless(reason) => return Err(attempt.not_started(reason)),
            Tried::Refused(refusal) => refusal,
        };
        let first = !attempt
            .refused
            .iter()
            .any(|known| known.layer == refusal.layer);
        if level == Level::Strict && refusal.layer.is_required() {
            attempt.leave_out(refusal);
            return Err(attempt.not_started(missing(&attempt.refused)));
        }
        let namespace = matches!(
            refusal.layer,
            Layer::UserNamespace | Layer::PidNamespace | Layer::MountNamespace
        );
        if namespace && first && attempt.backend == Backend::Own && !is_root() && bwrap::exists() {
            attempt.backend = Backend::Bwrap;
            own = Some(refusal);
            continue;
        }
        if let Some(Refusal { reason, .. }) = own.as_mut().filter(|_| namespace) {
            // It is not allowed to either: what was refused to us is what counts.
            attempt.backend = Backend::Own;
            reason.push_str("; bwrap did not start either");
        }
        let refusal = own.take().filter(|_| namespace).unwrap_or(refusal);
        attempt.leave_out(refusal);
    }
}

/// What `strict` says.
fn missing(refused: &[Refusal]) -> String {
    let layers: Vec<String> = refused
        .iter()
        .filter(|refusal| refusal.layer.is_required())
        .map(|refusal| {
            let errno = errno_name(refusal.errno);
            format!("{} ({errno}, {})", refusal.layer, refusal.reason)
        })
        .collect();
    format!(
        "this machine refuses layers of the sandbox: {}",
        layers.join("; ")
    )
}

impl Attempt<'_> {
    fn once(&mut self, become_plugin: &dyn Fn() -> std::convert::Infallible) -> Tried {
        let launch = self.launch;
        let own_user = FIRST_USER + std::process::id();
        if self.wants(Layer::Cgroup) {
            match Cgroup::create(&launch.run) {
                Ok(group) => {
                    group.limit(launch.memory_bytes, launch.policy.processes);
                    return self.with_group(Some(group), own_user, become_plugin);
                }
                Err((errno, reason)) => {
                    self.leave_out(Refusal::new(Layer::Cgroup, errno, reason));
                }
            }
        }
        self.with_group(None, own_user, become_plugin)
    }

    fn with_group(
        &mut self,
        cgroup: Option<Cgroup>,
        own_user: u32,
        become_plugin: &dyn Fn() -> std::convert::Infallible,
    ) -> Tried {
        let root = is_root();
        let hopeless = |error: Errno| Tried::Hopeless(error.to_string());
        if root && self.wants(Layer::OwnUser) {
            if self.wants(Layer::MountNamespace) && self.trees.is_empty() {
                self.trees = take_as_root(&self.grants.read, own_user);
            }
            // Where files are not remapped, the scratch folder has to be theirs.
            let _ = std::os::unix::fs::chown(self.scratch, Some(own_user), Some(own_user));
        }
        let pair = socketpair(
            AddressFamily::UNIX,
            SocketType::SEQPACKET,
            SocketFlags::CLOEXEC,
            None,
        );
        let (link, theirs) = match pair {
            Ok(pair) => pair,
            Err(error) => return hopeless(error),
        };
        let (gate, opener) = match pipe_with(PipeFlags::CLOEXEC) {
            Ok(pair) => pair,
            Err(error) => return hopeless(error),
        };
        let inside = Inside {
            launch: self.launch,
            grants: self.grants,
            wanted: &self.wanted,
            scratch: self.scratch,
            link: &theirs,
            gate: &gate,
            become_user: (root && self.wants(Layer::OwnUser) && !self.wants(Layer::UserNamespace))
                .then_some(own_user),
        };
        let child = if self.backend == Backend::Bwrap {
            bwrap::spawn(self.launch, self.grants, &self.wanted, &theirs, &gate)
        } else {
            match copy_process(self.flags(), cgroup.as_ref()) {
                Ok(0) => {
                    drop((link, opener));
                    inside.run(Some(&self.trees), become_plugin)
                }
                other => other,
            }
        };
        let layer = if self.wants(Layer::UserNamespace) {
            Layer::UserNamespace
        } else {
            Layer::PidNamespace
        };
        let child = match child {
            Ok(child) => child,
            Err(errno) if self.flags() == 0 => return hopeless(errno),
            Err(errno) => return self.refuse_namespaces(layer, errno),
        };
        drop((theirs, gate));
        let Some(init) = Pid::from_raw(child) else {
            return Tried::Hopeless("the child has no identifier".into());
        };
        let mut child = Child {
            init: Some(init),
            link,
        };
        if let Some(group) = &cgroup
            && !group.has(init.as_raw_nonzero().get())
            && let Err(error) = group.add(init.as_raw_nonzero().get())
        {
            return Tried::Refused(Refusal::new(
                Layer::Cgroup,
                as_errno(&error),
                "moving the plugin into its group",
            ));
        }
        if self.wants(Layer::UserNamespace) && self.backend == Backend::Own {
            let outside = if !root {
                (
                    rustix::process::geteuid().as_raw(),
                    rustix::process::getegid().as_raw(),
                )
            } else if self.wants(Layer::OwnUser) {
                (own_user, own_user)
            } else {
                (0, 0)
            };
            if let Err(error) = map_user(init, outside) {
                return Tried::Refused(Refusal::new(
                    Layer::UserNamespace,
                    as_errno(&error),
                    "mapping the user",
                ));
            }
        }
        if rustix::io::write(&opener, b"g").is_err() {
            return self.silent();
        }
        self.attend(&mut child, cgroup, opener)
    }

    /// Nobody answers: `bwrap` says on standard error why, if it was asked.
    fn silent(&self) -> Tried {
        if self.backend == Backend::Bwrap {
            let what = "bwrap did not start";
            return Tried::Refused(Refusal::new(Layer::UserNamespace, Errno::PERM, what));
        }
        Tried::Hopeless("the sandbox ended before the plugin began".into())
    }

    /// Without user namespaces, root may still make the others.
    fn refuse_namespaces(&mut self, layer: Layer, errno: Errno) -> Tried {
        if layer == Layer::PidNamespace {
            for also in [
                Layer::MountNamespace,
                Layer::NetworkNamespace,
                Layer::IpcNamespace,
            ] {
                if self.wants(also) {
                    self.leave_out(Refusal::new(also, errno, "making namespaces"));
                }
            }
        }
        Tried::Refused(Refusal::new(layer, errno, "making namespaces"))
    }

    /// Follows what the init says until the plugin has started.
    fn attend(&mut self, child: &mut Child, cgroup: Option<Cgroup>, gate: OwnedFd) -> Tried {
        let mut proc = None;
        let mut scratch = None;
        loop {
            let Some((packet, mut descriptors)) = receive(&child.link) else {
                return self.silent();
            };
            match packet {
                Packet::Failed(refusal) => return Tried::Refused(refusal),
                Packet::CannotStart(reason) => return Tried::Hopeless(reason),
                Packet::Ended(_) => {
                    return Tried::Hopeless("the plugin ended before it began".into());
                }
                Packet::Ready(lost) => {
                    lost.into_iter().for_each(|refusal| self.leave_out(refusal));
                    scratch = descriptors.pop();
                    proc = descriptors.pop();
                }
                Packet::Locked(refused) => {
                    refused
                        .into_iter()
                        .for_each(|refusal| self.leave_out(refusal));
                    if self.launch.policy.level == Level::Strict
                        && self
                            .refused
                            .iter()
                            .any(|refusal| refusal.layer.is_required())
                    {
                        return Tried::Hopeless(missing(&self.refused));
                    }
                    break;
                }
            }
        }
        let (Some(init), Some(scratch)) = (child.init, scratch) else {
            return Tried::Hopeless("the sandbox has no scratch folder".into());
        };
        let Ok(init_fd) = pidfd_open(init, PidfdFlags::empty()) else {
            return Tried::Hopeless("the sandbox is gone".into());
        };
        let view = match &proc {
            Some(proc) => View::Inside(format!("/proc/self/fd/{}", proc.as_raw_fd()).into()),
            None => View::Below(init.as_raw_nonzero().get()),
        };
        let Ok(link) = child.link.try_clone() else {
            return Tried::Hopeless("no descriptors are left".into());
        };
        if rustix::io::write(&gate, b"g").is_err() {
            return Tried::Hopeless("the sandbox is gone".into());
        }
        child.init = None;
        Tried::Started(Jail {
            init,
            init_fd,
            link,
            report: self.report(),
            environment: self.grants.environment_digest(),
            cgroup,
            view,
            scratch,
            _proc: proc,
        })
    }
}

/// The init while it is not known to have started; ended with the value.
struct Child {
    init: Option<Pid>,
    link: OwnedFd,
}

impl Drop for Child {
    fn drop(&mut self) {
        if let Some(init) = self.init {
            let _ = rustix::process::kill_process(init, Signal::KILL);
            let _ = rustix::process::waitpid(Some(init), WaitOptions::empty());
        }
    }
}

impl Jail {
    /// To be polled: readable when the init has something to say.
    pub(crate) fn link(&self) -> BorrowedFd<'_> {
        self.link.as_fd()
    }

    /// The next thing that the init has to say, once `link` is readable: that the
    /// plugin could not be started, or that nobody is left. `Err` when it is gone.
    pub(crate) fn hear(&self) -> Result<News, Gone> {
        match receive(&self.link) {
            Some((Packet::Ended(ended), _)) => Ok(News::Ended(ended)),
            Some((Packet::CannotStart(reason), _)) => Ok(News::CannotStart(reason)),
            Some(_) => Ok(News::Other),
            None => Err(Gone),
        }
    }

    /// Ends everybody: softly first, so that what they used is known, then hard.
    /// What the init reported, if it came to.
    pub(crate) fn end(&self) -> Option<Ended> {
        const SOFT: Timespec = Timespec {
            tv_sec: 0,
            tv_nsec: 100_000_000,
        };
        let mut ended = None;
        if rustix::io::write(&self.link, b"stop").is_ok() {
            let until = fleetyard_abi::monotonic_ns() + SOFT.tv_nsec as u64;
            while ended.is_none() {
                let left = until.saturating_sub(fleetyard_abi::monotonic_ns());
                let left = Timespec {
                    tv_sec: 0,
                    tv_nsec: left as i64,
                };
                let mut waiting = [PollFd::new(&self.link, PollFlags::IN)];
                match poll(&mut waiting, Some(&left)) {
                    Err(Errno::INTR) => {}
                    Ok(count) if count > 0 => match self.hear() {
                        Ok(News::Ended(report)) => ended = Some(report),
                        Ok(_) => {}
                        Err(Gone) => break,
                    },
                    _ => break,
                }
            }
        }
        self.bury();
        ended
    }

    /// Makes sure that nobody is left, and waits for the init.
    pub(crate) fn bury(&self) {
        if let Some(group) = &self.cgroup {
            group.kill();
        }
        let _ = pidfd_send_signal(&self.init_fd, Signal::KILL);
        let _ = rustix::process::waitpid(Some(self.init), WaitOptions::empty());
        // Where there is no namespace of processes, orphans come to us.
        reap_descendants(None);
    }
}

/// What an init can say after the plugin has started.
pub(crate) enum News {
    Ended(Ended),
    CannotStart(String),
    Other,
}

/// The init is no more.
pub(crate) struct Gone;

/// Like `fork`, into new namespaces, and into the group at once where the kernel can:
/// moving a process later makes it wait for every processor.
fn copy_process(flags: i32, cgroup: Option<&Cgroup>) -> Result<i32, Errno> {
    const INTO_CGROUP: u64 = 0x2_0000_0000;
    let group = cgroup.and_then(|group| {
        let flags = OFlags::PATH | OFlags::DIRECTORY | OFlags::CLOEXEC;
        rustix::fs::open(group.folder(), flags, Mode::empty()).ok()
    });
    if let Some(group) = &group {
        // SAFETY: zero is what all the other fields should be.
        let mut arguments: libc::clone_args = unsafe { std::mem::zeroed() };
        arguments.flags = flags as u64 | INTO_CGROUP;
        arguments.exit_signal = libc::SIGCHLD as u64;
        arguments.cgroup = group.as_raw_fd() as u64;
        // SAFETY: this process has one thread, so the copy may do anything; the
        // structure outlives the call.
        let child = unsafe {
            libc::syscall(
                libc::SYS_clone3,
                &raw const arguments,
                size_of::<libc::clone_args>(),
            )
        };
        if child >= 0 {
            return Ok(child as i32);
        }
    }
    // SAFETY: this process has one thread, so the copy may do anything.
    let child = unsafe { libc::syscall(libc::SYS_clone, flags | libc::SIGCHLD, 0, 0, 0, 0) };
    if child >= 0 {
        Ok(child as i32)
    } else {
        Err(as_errno(&std::io::Error::last_os_error()))
    }
}

fn map_user(init: Pid, (user, group): (u32, u32)) -> std::io::Result<()> {
    let proc = format!("/proc/{}", init.as_raw_nonzero());
    if !is_root() {
        // Who may not change groups outside may not do it inside either.
        fs::write(format!("{proc}/setgroups"), "deny")?;
    }
    fs::write(
        format!("{proc}/uid_map"),
        format!("{INSIDE_USER} {user} 1\n"),
    )?;
    fs::write(
        format!("{proc}/gid_map"),
        format!("{INSIDE_USER} {group} 1\n"),
    )
}

/// Becomes the user that was mapped, for a host that is root: until then this is
/// nobody in the new namespace, and still in root's groups.
fn become_mapped_user() -> Result<(), Refusal> {
    // SAFETY: plain system calls; this process has one thread.
    let changed = unsafe {
        // Refused to those who are not root, whose groups are their own.
        libc::setgroups(0, std::ptr::null());
        libc::setresgid(INSIDE_USER, INSIDE_USER, INSIDE_USER) == 0
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

fn send(link: &OwnedFd, packet: &Packet, descriptors: &[BorrowedFd<'_>]) {
    let Ok(text) = serde_json::to_vec(packet) else {
        return;
    };
    let mut space = [MaybeUninit::uninit(); rustix::cmsg_space!(ScmRights(2))];
    let mut ancillary = SendAncillaryBuffer::new(&mut space);
    if !descriptors.is_empty() {
        ancillary.push(SendAncillaryMessage::ScmRights(descriptors));
    }
    // A supervisor that is gone is noticed elsewhere.
    let _ = sendmsg(
        link,
        &[IoSlice::new(&text)],
        &mut ancillary,
        SendFlags::NOSIGNAL,
    );
}

fn receive(link: &OwnedFd) -> Option<(Packet, Vec<OwnedFd>)> {
    let mut text = vec![0; 1 << 16];
    let mut space = [MaybeUninit::uninit(); rustix::cmsg_space!(ScmRights(2))];
    let mut ancillary = RecvAncillaryBuffer::new(&mut space);
    let received = loop {
        let mut into = [IoSliceMut::new(&mut text)];
        match recvmsg(link, &mut into, &mut ancillary, RecvFlags::CMSG_CLOEXEC) {
            Err(Errno::INTR) => {}
            other => break other.ok()?,
        }
    };
    let mut descriptors = Vec::new();
    for message in ancillary.drain() {
        if let RecvAncillaryMessage::ScmRights(rights) = message {
            descriptors.extend(rights);
        }
    }
    let packet = serde_json::from_slice(&text[..received.bytes]).ok()?;
    Some((packet, descriptors))
}

/// What the init and the plugin's process know.
struct Inside<'a> {
    launch: &'a Launch,
    grants: &'a Grants,
    wanted: &'a [Layer],
    /// On disk, for when there is no tree of our own.
    scratch: &'a Path,
    link: &'a OwnedFd,
    gate: &'a OwnedFd,
    become_user: Option<u32>,
}

impl Inside<'_> {
    fn wants(&self, layer: Layer) -> bool {
        self.wanted.contains(&layer)
    }

    /// The init's life. `trees` is absent when somebody else has built the tree of
    /// files already.
    fn run(
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
            become_mapped_user().unwrap_or_else(|refusal| self.fail(refusal));
        }
        let mount = self.wants(Layer::MountNamespace);
        let mut lost = Vec::new();
        if mount && let Some(trees) = trees {
            let root = Root {
                read: &self.grants.read,
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
        if self.wants(Layer::OwnUser)
            && let Some(file) = &self.grants.file
            && self.become_user.is_none()
            && rustix::fs::access(file, Access::READ_OK) == Err(Errno::ACCESS)
        {
            let reason = format!("{} cannot be read by another user", file.display());
            self.fail(Refusal::new(Layer::OwnUser, Errno::ACCESS, reason));
        }
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
        let folder = open(scratch).ok();
        let descriptors: Vec<BorrowedFd<'_>> = [proc.as_ref(), folder.as_ref()]
            .into_iter()
            .flatten()
            .map(AsFd::as_fd)
            .collect();
        send(self.link, &Packet::Ready(lost), &descriptors);
    }

    fn fail(&self, refusal: Refusal) -> ! {
        send(self.link, &Packet::Failed(refusal), &[]);
        exit(1)
    }
}

/// The init's life where `bwrap` made namespaces and tree.
pub(super) fn enter(
    handed: &bwrap::Handed,
    link: &OwnedFd,
    gate: &OwnedFd,
    scratch: &Path,
    become_plugin: &dyn Fn() -> std::convert::Infallible,
) -> ! {
    let inside = Inside {
        launch: &handed.launch,
        grants: &handed.grants,
        wanted: &handed.wanted,
        scratch,
        link,
        gate,
        become_user: None,
    };
    inside.run(None, become_plugin)
}

/// Starts the plugin's process and is its init from then on.
fn start_plugin(
    inside: &Inside<'_>,
    scratch: &Path,
    become_plugin: &dyn Fn() -> std::convert::Infallible,
) -> ! {
    // SAFETY: plain system call that makes orphans ours where there is no
    // namespace that does.
    unsafe { libc::prctl(libc::PR_SET_CHILD_SUBREAPER, 1) };
    // SAFETY: this process has one thread, so the copy may do anything.
    match unsafe { libc::fork() } {
        -1 => {
            let reason = std::io::Error::last_os_error().to_string();
            send(inside.link, &Packet::CannotStart(reason), &[]);
            exit(1)
        }
        0 => plugin(inside, scratch, become_plugin),
        child => {
            crate::supervisor::release_stdio();
            // Everything is made; what is left needs no rights.
            let _ = drop_capabilities();
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
    let (launch, grants) = (inside.launch, inside.grants);
    crate::supervisor::child_setup();
    // Relative paths of a plugin mean its scratch folder.
    let _ = std::env::set_current_dir(scratch);
    if launch.policy.level != Level::None {
        let read = readable(inside);
        let refused = Lock {
            read: &read,
            scratch,
            network: launch.policy.network,
            file_bytes: launch.policy.disk_bytes + (64 << 10),
            processes: counts_alone(inside).then_some(u64::from(launch.policy.processes) + 2),
            become_user: inside.become_user,
        }
        .apply();
        send(inside.link, &Packet::Locked(refused), &[]);
    } else {
        send(inside.link, &Packet::Locked(Vec::new()), &[]);
    }
    if !wait_at(inside.gate) {
        exit(1);
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
        Target::Program(argv) => {
            let program = grants.program.clone().unwrap_or_default();
            let mut command = Command::new(program);
            command.args(argv.iter().skip(1)).env_clear().envs(env);
            if let Some(name) = argv.first() {
                command.arg0(name);
            }
            close_descriptors(libc::CLOSE_RANGE_CLOEXEC);
            // Only returns when it failed; the link closes when it did not.
            let error = command.exec();
            send(inside.link, &Packet::CannotStart(error.to_string()), &[]);
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
            close_descriptors(0);
            match become_plugin() {}
        }
    }
}

/// Closes everything but the standard streams: the plugin must not speak for its init,
/// nor hold on to what the supervisor has open.
fn close_descriptors(flags: libc::c_uint) {
    // SAFETY: this process ends without using any of them again, but for sending
    // that a program could not be started, for which they are still open.
    unsafe { libc::syscall(libc::SYS_close_range, 3, u32::MAX, flags) };
}

/// Whether the kernel counts this sandbox's processes apart from all others of the
/// user.
fn counts_alone(inside: &Inside<'_>) -> bool {
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
    inside.wants(Layer::OwnUser) || (inside.wants(Layer::UserNamespace) && version >= (5, 14))
}

/// What may be read: everything in a tree that holds nothing else; otherwise what was
/// granted, and of everybody's `/proc` what tells about the machine and the process
/// itself.
fn readable(inside: &Inside<'_>) -> Vec<PathBuf> {
    if inside.wants(Layer::MountNamespace) {
        return vec!["/".into(), "/proc".into()];
    }
    let of_proc = [
        "/proc/self",
        "/proc/cpuinfo",
        "/proc/meminfo",
        "/proc/stat",
        "/proc/filesystems",
        "/proc/sys/vm/overcommit_memory",
        "/proc/sys/kernel/osrelease",
    ];
    let granted = inside.grants.read.iter().cloned();
    granted.chain(of_proc.map(PathBuf::from)).collect()
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
            Err(_) => break,
        }
    }
    reap_descendants(Some(&mut status));
    send(link, &Packet::Ended(status.ended()), &[]);
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

/// What the init knows of the plugin's process.
#[derive(Default)]
struct Status {
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
fn reap_descendants(status: Option<&mut Status>) {
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
            kill_descendants();
            // Killed processes need a moment to die.
            std::thread::sleep(std::time::Duration::from_micros(200));
        }
    }
}

/// Ends this process without running what the parent left to run.
fn exit(code: i32) -> ! {
    // SAFETY: ends the process.
    unsafe { libc::_exit(code) }
}

/// A scratch folder on disk, for sandboxes without a tree of their own; it is
/// removed with the value.
pub(crate) struct ScratchFolder(PathBuf);

impl ScratchFolder {
    pub(crate) fn create(run: &str) -> std::io::Result<Self> {
        let folder = state::folder("scratch")?.join(run);
        fs::create_dir(&folder)?;
        Ok(Self(folder))
    }

    pub(crate) fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for ScratchFolder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

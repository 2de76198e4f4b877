//! The supervisor's side of the sandbox: makes the namespaces, and what is between them
//! and the host.
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

use std::fs;
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, OwnedFd};
use std::path::{Path, PathBuf};

use fleetyard_core::{Digest, Words as _};
use rustix::event::{PollFd, PollFlags, poll};
use rustix::fs::{Mode, OFlags};
use rustix::io::Errno;
use rustix::net::{AddressFamily, SocketFlags, SocketType, socketpair};
use rustix::pipe::{PipeFlags, pipe_with};
use rustix::process::{
    DumpableBehavior, Pid, PidfdFlags, Signal, WaitOptions, pidfd_open, pidfd_send_signal,
    set_dumpable_behavior,
};
use rustix::time::Timespec;

use super::init::{Inside, counts_alone, reap_descendants};
use super::launch::Launch;
pub(crate) use super::packets::Ended;
use super::packets::{Packet, receive};
use super::refusal::{as_errno, errno_name};
use super::root::{INSIDE_USER, Trees, take_as_root};
use super::{
    Backend, Keeper, Layer, LayerState, Level, LimitState, Refusal, Remark, SandboxReport, bwrap,
};
use crate::confinement::cgroup::{Cgroup, Places};
use crate::confinement::child::{GOES_FIRST, goes_first, patiently};
use crate::confinement::counter::Counter;
use crate::confinement::process_tree::View;
use crate::confinement::remove::remove_tree;
use crate::usage::Limit;
use crate::user_folder;

/// Users of sandboxes when the host is root: one per supervisor, far from those
/// that people and containers are given.
const FIRST_USER: u32 = 0x7000_0000;

/// A plugin that was started.
pub(crate) struct Jail {
    init: Pid,
    init_fd: OwnedFd,
    link: OwnedFd,
    pub(crate) report: SandboxReport,
    pub(crate) cgroup: Option<Cgroup>,
    /// Processor time of its group before the plugin began, in user mode and in the kernel.
    cpu_before_us: Option<(u64, u64)>,
    /// Counts its processor time where no group does.
    counter: Option<Counter>,
    /// Stands for the plugin's whole environment.
    pub(crate) environment: Digest,
    /// The place where its processes are seen.
    pub(crate) view: View,
    /// Its scratch folder.
    pub(crate) scratch: OwnedFd,
    /// Kept open for `view`.
    _proc: Option<OwnedFd>,
}

/// The reason why nothing was started.
pub(crate) struct NotStarted {
    pub(crate) report: Box<SandboxReport>,
    pub(crate) reason: String,
    /// True if it is what the caller asked for, rather than something that failed.
    pub(crate) by_policy: bool,
}

/// An attempt to build the sandbox.
struct Attempt<'a> {
    launch: &'a Launch,
    /// Layers that are asked for, without those that were refused.
    wanted: Vec<Layer>,
    refused: Vec<Refusal>,
    /// Layers that were not asked for, and why.
    left_out: Vec<(Layer, &'static str)>,
    /// Gaps of active layers.
    remarks: Vec<Remark>,
    /// A scratch folder on disk, for when there is no tree of our own.
    scratch: &'a Path,
    groups: &'a Places,
    trees: Trees,
    backend: Backend,
    kept: Kept,
}

/// The limits that control groups hold.
#[derive(Default)]
struct Kept {
    cpu: bool,
    memory: bool,
    processes: bool,
    /// The reason why they do not hold the others.
    why_not: String,
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
        let layers = Layer::ALL.iter().copied().map(|layer| {
            let refusal = self.refused.iter().find(|refusal| refusal.layer == layer);
            let left_out = self.left_out.iter().find(|(known, _)| *known == layer);
            let remark = self.remarks.iter().find(|remark| remark.layer == layer);
            LayerState {
                layer,
                active: self.wants(layer),
                errno: refusal.map(|refusal| errno_name(refusal.errno)),
                reason: refusal
                    .map(|refusal| refusal.reason.clone())
                    .or(left_out.map(|(_, reason)| (*reason).to_owned()))
                    .or(remark.map(|remark| remark.text.clone())),
            }
        });
        SandboxReport {
            level: self.launch.policy.level,
            backend: self.wants(Layer::PidNamespace).then_some(self.backend),
            seccomp: self
                .wants(Layer::Seccomp)
                .then(|| self.launch.filter.clone()),
            layers: layers.collect(),
            limits: self.limits(),
            devices: self.launch.policy.devices.clone(),
        }
    }

    /// The keeper of each limit.
    fn limits(&self) -> Vec<LimitState> {
        let kept = &self.kept;
        let state = |limit, by, watched: Option<String>| LimitState {
            limit,
            enforced: watched.is_none(),
            by,
            reason: watched,
        };
        let unless = |held: bool, why: &str| (!held).then(|| why.to_owned());
        let cpu = format!(
            "processes that nobody waits for are counted in a control group alone; {}",
            kept.why_not
        );
        let memory = format!(
            "the kernel limits memory in a control group alone; {}",
            kept.why_not
        );
        let by_number = self.wants(Layer::ResourceLimits) && counts_alone(&self.wanted);
        let own_disk = self.wants(Layer::MountNamespace) && self.backend == Backend::Own;
        let by_kernel = |held| if held { Keeper::Kernel } else { Keeper::Host };
        let processes = kept.processes || by_number;
        vec![
            state(Limit::Wall, Keeper::Host, None),
            state(Limit::Cpu, Keeper::Host, unless(kept.cpu, &cpu)),
            state(
                Limit::Memory,
                by_kernel(kept.memory),
                unless(kept.memory, &memory),
            ),
            state(
                Limit::Processes,
                by_kernel(processes),
                unless(
                    processes,
                    "the kernel does not count this plugin's processes apart from others",
                ),
            ),
            state(Limit::Output, Keeper::Host, None),
            state(
                Limit::Disk,
                by_kernel(own_disk),
                unless(own_disk, "the scratch folder has no size of its own"),
            ),
        ]
    }

    /// Sets the limits that a group can hold, and notes which those are.
    fn keep(&mut self, group: Option<&Cgroup>) {
        let launch = self.launch;
        let processes = u64::from(launch.policy.processes);
        let (refused, left_out) = (&self.refused, &self.left_out);
        let of_group = group.and_then(|group| group.refused().first());
        let of_group = of_group.map(|(errno, why)| (errno.raw_os_error(), why.as_str()));
        let of_layer = refused.iter().find(|known| known.layer == Layer::Cgroup);
        let of_layer = of_layer.map(|known| (known.errno, known.reason.as_str()));
        let not_asked = left_out.iter().find(|(layer, _)| *layer == Layer::Cgroup);
        let why_not = match (of_group.or(of_layer), not_asked) {
            (Some((errno, why)), _) => format!("{}, {why}", errno_name(errno)),
            (None, Some((_, why))) => (*why).to_owned(),
            (None, None) => "no group here has the controller".to_owned(),
        };
        self.kept = Kept {
            cpu: group.is_some_and(|group| group.cpu_us().is_some()),
            memory: group.is_some_and(|group| group.limit_memory(launch.memory_bytes)),
            processes: group.is_some_and(|group| group.limit_processes(processes)),
            why_not,
        };
    }

    /// The reason why `strict` does not run here: required layers that were refused, and limits
    /// that are only watched.
    fn too_little(&self) -> Option<String> {
        let layers: Vec<String> = self
            .refused
            .iter()
            .filter(|refusal| refusal.layer.is_required())
            .map(|refusal| {
                let errno = errno_name(refusal.errno);
                format!("{} ({errno}, {})", refusal.layer, refusal.reason)
            })
            .collect();
        let limits: Vec<String> = self
            .limits()
            .into_iter()
            .filter(|state| match state.limit {
                Limit::Memory => !state.enforced,
                Limit::Cpu => !state.enforced && self.launch.cpu_is_limited,
                _ => false,
            })
            .map(|state| format!("{} ({})", state.limit, state.reason.unwrap_or_default()))
            .collect();
        let parts = [
            ("refuses layers of the sandbox", layers),
            ("only watches limits that it should enforce", limits),
        ];
        let parts = parts.into_iter().filter(|(_, which)| !which.is_empty());
        let parts: Vec<String> = parts
            .map(|(what, which)| format!("this machine {what}: {}", which.join("; ")))
            .collect();
        (!parts.is_empty()).then(|| parts.join("; "))
    }

    fn not_started(&self, reason: impl Into<String>, by_policy: bool) -> NotStarted {
        NotStarted {
            report: Box::new(self.report()),
            reason: reason.into(),
            by_policy,
        }
    }
}

fn is_root() -> bool {
    rustix::process::geteuid().is_root()
}

/// The end of one try.
enum Tried {
    Started(Box<Jail>),
    /// To be tried again without a layer.
    Refused(Refusal),
    /// Without these layers it must not start.
    TooLittle(String),
    /// Never mind the layers: this does not start.
    Hopeless(String),
}

/// Starts the plugin in as many layers as the machine grants. `become_plugin` is
/// called in the plugin's own process when everything is locked, for targets that
/// are not programs.
pub(crate) fn start(
    launch: &Launch,
    scratch: &Path,
    groups: &Places,
    become_plugin: &dyn Fn() -> std::convert::Infallible,
) -> Result<Jail, NotStarted> {
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
        wanted,
        refused: Vec::new(),
        left_out,
        remarks: Vec::new(),
        scratch,
        groups,
        trees: Trees::new(),
        backend: Backend::Own,
        kept: Kept::default(),
    };
    // What was refused to us before bwrap was tried.
    let mut own: Option<Refusal> = None;
    // Every refusal takes a layer away, so this ends.
    loop {
        let refusal = match attempt.once(become_plugin) {
            Tried::Started(jail) => return Ok(*jail),
            Tried::TooLittle(reason) => return Err(attempt.not_started(reason, true)),
            Tried::Hopeless(reason) => return Err(attempt.not_started(reason, false)),
            Tried::Refused(refusal) => refusal,
        };
        let first = !attempt
            .refused
            .iter()
            .any(|known| known.layer == refusal.layer);
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
        let refusal = if namespace { own.take() } else { None }.unwrap_or(refusal);
        if !attempt.wants(refusal.layer) {
            return Err(attempt.not_started(refusal.reason, false));
        }
        if level == Level::Strict && refusal.layer.is_required() {
            attempt.leave_out(refusal);
            let reason = attempt.too_little().unwrap_or_default();
            return Err(attempt.not_started(reason, true));
        }
        attempt.leave_out(refusal);
    }
}

impl Attempt<'_> {
    fn once(&mut self, become_plugin: &dyn Fn() -> std::convert::Infallible) -> Tried {
        let own_user = FIRST_USER + std::process::id();
        let mut group = None;
        if self.wants(Layer::Cgroup) {
            match Cgroup::create(self.groups) {
                Ok(made) => group = Some(made),
                Err((errno, reason)) => {
                    self.leave_out(Refusal::new(Layer::Cgroup, errno, reason));
                }
            }
        }
        self.keep(group.as_ref());
        self.with_group(group, own_user, become_plugin)
    }

    fn with_group(
        &mut self,
        cgroup: Option<Cgroup>,
        own_user: u32,
        become_plugin: &dyn Fn() -> std::convert::Infallible,
    ) -> Tried {
        let root = is_root();
        let hopeless = |what: &str, error: Errno| Tried::Hopeless(format!("{what}: {error}"));
        if root && self.wants(Layer::OwnUser) {
            if self.wants(Layer::MountNamespace) && self.trees.is_empty() {
                self.trees = take_as_root(&self.launch.grants, own_user);
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
            Err(error) => return hopeless("making a socket", error),
        };
        let (gate, opener) = match pipe_with(PipeFlags::CLOEXEC) {
            Ok(pair) => pair,
            Err(error) => return hopeless("making a pipe", error),
        };
        let inside = Inside {
            launch: self.launch,
            wanted: &self.wanted,
            scratch: self.scratch,
            link: &theirs,
            gate: &gate,
            become_user: (root && self.wants(Layer::OwnUser) && !self.wants(Layer::UserNamespace))
                .then_some(own_user),
        };
        let child = if self.backend == Backend::Bwrap {
            let child = bwrap::spawn(self.launch, &self.wanted, &theirs, &gate);
            child.map(|child| (child, false))
        } else {
            let copied = patiently(
                || copy_process(self.flags(), cgroup.as_ref()),
                |error| *error == Errno::AGAIN,
            );
            match copied {
                Ok((0, _)) => {
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
        let (child, grouped) = match child {
            Ok(child) => child,
            // Too many processes: no layer was refused, and none is left out for it.
            Err(errno) if self.flags() == 0 || errno == Errno::AGAIN => {
                return hopeless("making a process", errno);
            }
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
        if self.wants(Layer::ResourceLimits)
            && let Err(refusal) = self.let_go_first(init)
        {
            self.leave_out(refusal);
        }
        if let Some(group) = &cgroup
            && let Err(error) = group.add(init.as_raw_nonzero().get(), grouped)
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
        // Before it makes any process, and while it may be looked at.
        let counter = (!self.kept.cpu).then(|| Counter::of(init)).flatten();
        if rustix::io::write(&opener, b"g").is_err() {
            return self.silent();
        }
        self.attend(&mut child, cgroup, counter, &opener)
    }

    /// When the machine's memory runs out, the plugin goes first, and it cannot change that:
    /// a value that is set with the right to lower it is the lowest from then on, and
    /// nobody inside may write to the file. Everybody inherits it.
    fn let_go_first(&self, init: Pid) -> Result<(), Refusal> {
        let refused = |errno: Errno| {
            let what = "saying that it goes first when memory runs out";
            Refusal::new(Layer::ResourceLimits, errno, what)
        };
        let path = format!("/proc/{}/oom_score_adj", init.as_raw_nonzero());
        if self.backend == Backend::Own {
            let path = std::ffi::CString::new(path.as_str()).map_err(|_| refused(Errno::INVAL))?;
            goes_first(&path).map_err(refused)?;
        }
        let found = fs::read_to_string(path).map_err(|error| refused(as_errno(&error)))?;
        if found.trim().as_bytes() == GOES_FIRST {
            Ok(())
        } else {
            Err(refused(Errno::PERM))
        }
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
    fn attend(
        &mut self,
        child: &mut Child,
        cgroup: Option<Cgroup>,
        mut counter: Option<Counter>,
        gate: &OwnedFd,
    ) -> Tried {
        let mut proc = None;
        let mut scratch = None;
        loop {
            let Some((packet, mut descriptors)) = receive(&child.link) else {
                return self.silent();
            };
            match packet {
                Packet::Failed(refusal) => return Tried::Refused(refusal),
                Packet::CannotStart(reason) | Packet::HostFailed(reason) => {
                    return Tried::Hopeless(reason);
                }
                Packet::Ended(_) => {
                    return Tried::Hopeless("the plugin ended before it began".into());
                }
                Packet::Ready(lost) => {
                    for refusal in lost {
                        self.leave_out(refusal);
                    }
                    scratch = descriptors.pop();
                    proc = descriptors.pop();
                }
                Packet::Locked(refused, remarks) => {
                    self.remarks = remarks;
                    for refusal in refused {
                        self.leave_out(refusal);
                    }
                    if self.launch.policy.level == Level::Strict
                        && let Some(reason) = self.too_little()
                    {
                        return Tried::TooLittle(reason);
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
        // From here on somebody may want to look into this process, or to write to its files
        // in `/proc`. Not before: telling the kernel who the init is needs the latter.
        let _ = set_dumpable_behavior(DumpableBehavior::NotDumpable);
        let cpu_before_us = cgroup.as_ref().and_then(Cgroup::cpu_parts_us);
        if let Some(counter) = &mut counter {
            counter.begin();
        }
        if rustix::io::write(gate, b"g").is_err() {
            return Tried::Hopeless("the sandbox is gone".into());
        }
        child.init = None;
        Tried::Started(Box::new(Jail {
            init,
            init_fd,
            link,
            report: self.report(),
            environment: self.launch.grants.environment_digest(),
            cgroup,
            cpu_before_us,
            counter,
            view,
            scratch,
            _proc: proc,
        }))
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
            Some((Packet::HostFailed(reason), _)) => Ok(News::HostFailed(reason)),
            Some(_) => Ok(News::Other),
            None => Err(Gone),
        }
    }

    /// Processor time of the plugin in user mode and in the kernel, where its group
    /// counts it.
    pub(crate) fn cpu_parts_us(&self) -> Option<(u64, u64)> {
        let (user, system) = self.cgroup.as_ref()?.cpu_parts_us()?;
        let (user_before, system_before) = self.cpu_before_us?;
        let since = |now: u64, before: u64| now.saturating_sub(before);
        Some((since(user, user_before), since(system, system_before)))
    }

    /// Processor time of the plugin where no group counts it, of processes as well whose end nobody was
    /// told.
    pub(crate) fn counted_us(&self) -> Option<u64> {
        self.counter.as_ref().and_then(Counter::cpu_us)
    }

    /// Ends everybody: softly first, so that what they used is known, then hard.
    /// Returns the report of the init, if there is one.
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

/// Messages of an init after the plugin has started.
pub(crate) enum News {
    Ended(Ended),
    CannotStart(String),
    HostFailed(String),
    Other,
}

/// The init is no more.
pub(crate) struct Gone;

/// Like `fork`, into new namespaces, and into the group of version 2 at once where the
/// kernel can: moving a process later makes it wait for every processor. Whether it is in
/// that group comes with it.
fn copy_process(flags: i32, cgroup: Option<&Cgroup>) -> Result<(i32, bool), Errno> {
    const INTO_CGROUP: u64 = 0x2_0000_0000;
    let group = cgroup.and_then(|group| {
        let flags = OFlags::PATH | OFlags::DIRECTORY | OFlags::CLOEXEC;
        rustix::fs::open(group.unified()?, flags, Mode::empty()).ok()
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
            return Ok((child as i32, true));
        }
    }
    // SAFETY: this process has one thread, so the copy may do anything.
    let child = unsafe { libc::syscall(libc::SYS_clone, flags | libc::SIGCHLD, 0, 0, 0, 0) };
    if child >= 0 {
        Ok((child as i32, false))
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

/// A scratch folder on disk, for sandboxes without a tree of their own; it is
/// removed with the value.
pub(crate) struct ScratchFolder(PathBuf);

impl ScratchFolder {
    /// Path of the scratch folder that a run is going to have.
    pub(crate) fn path_of(run: &str) -> std::io::Result<PathBuf> {
        let folder = user_folder::folder("scratch").map_err(std::io::Error::other)?;
        Ok(folder.path.join(run))
    }

    pub(crate) fn create(path: PathBuf) -> std::io::Result<Self> {
        fs::create_dir(&path)?;
        Ok(Self(path))
    }

    pub(crate) fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for ScratchFolder {
    fn drop(&mut self) {
        // What could not be removed is tried again by nobody: it was not the plugin's.
        let _ = remove_tree(&self.0);
    }
}

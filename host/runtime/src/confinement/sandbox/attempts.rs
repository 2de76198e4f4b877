//! Attempts of the host in a sandbox of its own, in the plugin's place, to say what the sandbox
//! keeps: a promise is tested, not concluded from the layers.
//!
//! Nothing here changes anything if it succeeds: files are opened and not written, signals are
//! signal 0, limits are read, priorities are set to what they are.

use std::fs::{self, OpenOptions};
use std::io::{self, Write};
use std::net::{SocketAddr, TcpListener, TcpStream, UdpSocket};
use std::os::linux::net::SocketAddrExt;
use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::{SocketAddr as LocalAddress, UnixListener, UnixStream};
use std::path::PathBuf;
use std::time::Duration;

use rustix::thread::capabilities;
use serde::{Deserialize, Serialize};
use tempfile::TempDir;

/// Targets of the attempts, made by the host for the occasion.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Victims {
    /// A file that its owner alone may read, and may write.
    pub file: PathBuf,
    /// A folder with that file in it.
    pub folder: PathBuf,
    /// A listener for TCP; the same port stands for UDP.
    pub tcp: SocketAddr,
    /// A listening socket with a path.
    pub unix: PathBuf,
    /// The name of a listening socket without one.
    pub name: String,
    /// A process of the host's user.
    pub pid: i32,
}

/// The victims themselves: they are there as long as the value is.
pub(crate) struct Targets {
    pub(crate) victims: Victims,
    _folder: TempDir,
    _tcp: TcpListener,
    _udp: UdpSocket,
    _unix: UnixListener,
    _name: UnixListener,
}

impl Targets {
    /// Makes them, as files, sockets and process of this one's user.
    pub(crate) fn make() -> io::Result<Self> {
        let folder = tempfile::tempdir()?;
        let file = folder.path().join("file");
        fs::write(&file, "of the host")?;
        fs::set_permissions(&file, fs::Permissions::from_mode(0o600))?;
        let tcp = TcpListener::bind("127.0.0.1:0")?;
        let address = tcp.local_addr()?;
        let udp = UdpSocket::bind(address)?;
        let unix = folder.path().join("socket");
        let listener = UnixListener::bind(&unix)?;
        let name = folder.path().display().to_string();
        let abstracted = UnixListener::bind_addr(&LocalAddress::from_abstract_name(&name)?)?;
        Ok(Self {
            victims: Victims {
                file,
                folder: folder.path().to_owned(),
                tcp: address,
                unix,
                name,
                pid: std::process::id() as i32,
            },
            _folder: folder,
            _tcp: tcp,
            _udp: udp,
            _unix: listener,
            _name: abstracted,
        })
    }
}

/// One thing that a plugin must not get done.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Attempt {
    /// To read a file of the host's user.
    ReadFile,
    /// To open it for writing.
    WriteFile,
    /// To list a folder of the host's user.
    ListFolder,
    /// To connect to a port of this machine by TCP.
    ConnectTcp,
    /// To send to one by UDP.
    ConnectUdp,
    /// To connect to a local socket with a path.
    ConnectUnix,
    /// To connect to a local socket with a name in the abstract.
    ConnectAbstract,
    /// To find another process in `/proc`.
    SeeProcess,
    /// To signal it.
    Signal,
    /// To trace it.
    Trace,
    /// To read its limits, as one who would set them.
    Limits,
    /// To set its priority.
    Priority,
    /// To make a namespace, with all rights in it.
    Namespace,
    /// To have a capability.
    Capability,
    /// To get at parts of the kernel with a record of holes.
    Kernel,
    /// To make memory that outlives it.
    SystemV,
    /// To use the keys of the user.
    Keys,
    /// To go last, not first, when memory runs out.
    OutOfMemory,
}

impl Attempt {
    /// All of them.
    pub const ALL: [Self; 18] = [
        Self::ReadFile,
        Self::WriteFile,
        Self::ListFolder,
        Self::ConnectTcp,
        Self::ConnectUdp,
        Self::ConnectUnix,
        Self::ConnectAbstract,
        Self::SeeProcess,
        Self::Signal,
        Self::Trace,
        Self::Limits,
        Self::Priority,
        Self::Namespace,
        Self::Capability,
        Self::Kernel,
        Self::SystemV,
        Self::Keys,
        Self::OutOfMemory,
    ];

    /// The attempt in words, after "to".
    pub fn as_str(self) -> &'static str {
        match self {
            Self::ReadFile => "read another file of the user",
            Self::WriteFile => "write to another file of the user",
            Self::ListFolder => "list another folder of the user",
            Self::ConnectTcp => "connect by TCP",
            Self::ConnectUdp => "send by UDP",
            Self::ConnectUnix => "connect to a local socket",
            Self::ConnectAbstract => "connect to an abstract socket",
            Self::SeeProcess => "see another process",
            Self::Signal => "signal another process",
            Self::Trace => "trace another process",
            Self::Limits => "reach the limits of another process",
            Self::Priority => "set the priority of another process",
            Self::Namespace => "make a namespace",
            Self::Capability => "hold a capability",
            Self::Kernel => "use bpf, perf_event_open, userfaultfd or io_uring",
            Self::SystemV => "make System V memory",
            Self::Keys => "use the user's keys",
            Self::OutOfMemory => "avoid being the first to go when memory runs out",
        }
    }
}

/// Tries one in this process; true when it succeeded.
fn succeeds(attempt: Attempt, victims: &Victims) -> bool {
    let pid = victims.pid;
    match attempt {
        Attempt::ReadFile => fs::read(&victims.file).is_ok(),
        Attempt::WriteFile => OpenOptions::new().append(true).open(&victims.file).is_ok(),
        Attempt::ListFolder => {
            fs::read_dir(&victims.folder).is_ok_and(|mut entries| entries.next().is_some())
        }
        Attempt::ConnectTcp => {
            TcpStream::connect_timeout(&victims.tcp, Duration::from_secs(1)).is_ok()
        }
        Attempt::ConnectUdp => UdpSocket::bind("127.0.0.1:0")
            .and_then(|socket| socket.send_to(b"?", victims.tcp))
            .is_ok_and(|_| shares_the_network(victims)),
        Attempt::ConnectUnix => UnixStream::connect(&victims.unix).is_ok(),
        Attempt::ConnectAbstract => LocalAddress::from_abstract_name(&victims.name)
            .and_then(|address| UnixStream::connect_addr(&address))
            .is_ok(),
        Attempt::SeeProcess => fs::metadata(format!("/proc/{pid}")).is_ok(),
        // SAFETY: signal 0 asks whether one may be sent.
        Attempt::Signal => unsafe { libc::kill(pid, 0) == 0 },
        Attempt::Trace => traces(pid),
        Attempt::Limits => {
            // SAFETY: an all-zero structure is valid, and the call fills it in.
            let result = unsafe {
                let mut old: libc::rlimit64 = std::mem::zeroed();
                libc::prlimit64(pid, libc::RLIMIT_CORE, std::ptr::null(), &raw mut old)
            };
            result == 0
        }
        // SAFETY: plain system calls; the priority is set to what it is.
        Attempt::Priority => unsafe {
            let now = libc::getpriority(libc::PRIO_PROCESS, pid as libc::id_t);
            libc::setpriority(libc::PRIO_PROCESS, pid as libc::id_t, now) == 0
        },
        // SAFETY: this process has one thread, and ends soon.
        Attempt::Namespace => unsafe { libc::unshare(libc::CLONE_NEWUSER) == 0 },
        Attempt::Capability => capabilities(None).is_ok_and(|sets| !sets.permitted.is_empty()),
        Attempt::Kernel => [
            libc::SYS_bpf,
            libc::SYS_perf_event_open,
            libc::SYS_userfaultfd,
            libc::SYS_io_uring_setup,
        ]
        .into_iter()
        .any(is_open),
        // SAFETY: a segment of its own, removed at once.
        Attempt::SystemV => unsafe {
            let segment = libc::shmget(libc::IPC_PRIVATE, 4096, libc::IPC_CREAT | 0o600);
            segment >= 0 && libc::shmctl(segment, libc::IPC_RMID, std::ptr::null_mut()) == 0
        },
        // SAFETY: asks for the number of the session's keyring; makes none.
        Attempt::Keys => unsafe { libc::syscall(libc::SYS_keyctl, 0, -3, 0) >= 0 },
        Attempt::OutOfMemory => {
            let lowered = fs::write("/proc/self/oom_score_adj", "0").is_ok();
            let score = fs::read_to_string("/proc/self/oom_score_adj");
            lowered || score.is_ok_and(|score| score.trim() != "1000")
        }
    }
}

/// A packet of UDP leaves without anybody there: it got somewhere only where the listener
/// for TCP can be seen as well.
fn shares_the_network(victims: &Victims) -> bool {
    UdpSocket::bind(victims.tcp).is_err_and(|error| error.kind() == io::ErrorKind::AddrInUse)
}

fn traces(pid: i32) -> bool {
    let null = std::ptr::null_mut::<libc::c_void>();
    // SAFETY: touches no memory; whoever was seized is let go at once.
    unsafe {
        let seized = libc::ptrace(libc::PTRACE_SEIZE, pid, null, null) == 0;
        if seized {
            libc::ptrace(libc::PTRACE_DETACH, pid, null, null);
        }
        seized
    }
}

/// True if a system call is answered by anything but a refusal, when all its arguments
/// are wrong.
fn is_open(call: libc::c_long) -> bool {
    // SAFETY: with null pointers and impossible flags none of them does anything.
    let result = unsafe { libc::syscall(call, -1_i64, 0, 0, -1_i64, -1_i64) };
    let errno = io::Error::last_os_error().raw_os_error();
    result >= 0 || !matches!(errno, Some(libc::EPERM | libc::ENOSYS | libc::EACCES))
}

/// Tries everything in this process, which is locked; what succeeded is written to
/// standard output.
pub(super) fn make(victims: &Victims) {
    let succeeded: Vec<Attempt> = Attempt::ALL
        .into_iter()
        .filter(|attempt| succeeds(*attempt, victims))
        .collect();
    if let Ok(text) = serde_json::to_string(&succeeded) {
        // A host that is gone needs no answer.
        let _ = writeln!(io::stdout(), "{text}");
    }
}

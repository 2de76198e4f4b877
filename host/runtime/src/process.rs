//! A supervised process: its pipes, its end, and what it used.

use std::io::Read;
use std::os::fd::{AsRawFd, OwnedFd};
use std::os::unix::net::UnixStream;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, ChildStderr, ChildStdin, ChildStdout, Command, Stdio};
use std::time::Duration;

use serde::Serialize;

use crate::Fault;
use crate::supervisor::{ARGUMENT, Report, Target};

/// Resources that a plugin's process tree used, as the kernel counted them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Usage {
    /// CPU time in user mode.
    pub user_us: u64,
    /// CPU time in the kernel.
    pub system_us: u64,
    /// Largest resident set of any process of the tree.
    pub max_rss_kb: u64,
}

/// A plugin's process under its supervisor.
pub(crate) struct Process {
    supervisor: Child,
    control: UnixStream,
    pub(crate) stdin: Option<ChildStdin>,
    pub(crate) stdout: ChildStdout,
    pub(crate) stderr: ChildStderr,
    report: Option<Report>,
}

impl Process {
    /// Starts `target` under a supervisor; `executable` calls
    /// [`intercept`](crate::supervisor::intercept) first of all.
    pub(crate) fn start(executable: &Path, target: &Target) -> Result<Self, Fault> {
        let spawn_fault = |error: &dyn std::fmt::Display| Fault::Spawn {
            program: executable.display().to_string(),
            reason: error.to_string(),
            hint: None,
        };
        let (control, theirs) = UnixStream::pair().map_err(|error| spawn_fault(&error))?;
        let text = serde_json::to_string(target).map_err(|error| spawn_fault(&error))?;
        let theirs = OwnedFd::from(theirs);
        let descriptor = theirs.as_raw_fd();
        let mut command = Command::new(executable);
        command
            .arg(ARGUMENT)
            .arg(text)
            .arg(descriptor.to_string())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        // SAFETY: `fcntl` is async-signal-safe; only the child's copy of the
        // descriptor survives the exec.
        unsafe {
            command.pre_exec(move || {
                if libc::fcntl(descriptor, libc::F_SETFD, 0) < 0 {
                    return Err(std::io::Error::last_os_error());
                }
                Ok(())
            });
        }
        let mut supervisor = command.spawn().map_err(|error| spawn_fault(&error))?;
        drop(theirs);
        let streams = (
            supervisor.stdin.take(),
            supervisor.stdout.take(),
            supervisor.stderr.take(),
        );
        let (Some(stdin), Some(stdout), Some(stderr)) = streams else {
            return Err(spawn_fault(&"the pipes are missing"));
        };
        for descriptor in [stdin.as_raw_fd(), stdout.as_raw_fd(), stderr.as_raw_fd()] {
            // SAFETY: plain system calls on descriptors that we own.
            unsafe {
                let flags = libc::fcntl(descriptor, libc::F_GETFL);
                libc::fcntl(descriptor, libc::F_SETFL, flags | libc::O_NONBLOCK);
                // Larger pipes mean fewer wake-ups; refusal costs only speed.
                libc::fcntl(descriptor, libc::F_SETPIPE_SZ, 1 << 20);
            }
        }
        Ok(Self {
            supervisor,
            control,
            stdin: Some(stdin),
            stdout,
            stderr,
            report: None,
        })
    }

    /// Waits up to `patience` for the plugin to end by itself, then kills its
    /// whole tree. Nothing of it is left when this returns.
    pub(crate) fn end(&mut self, patience: Duration) -> Report {
        if let Some(report) = &self.report {
            return report.clone();
        }
        let mut text = Vec::new();
        if !patience.is_zero() {
            // The supervisor writes when the plugin has ended.
            let _ = self.control.set_read_timeout(Some(patience));
            let mut buffer = [0; 1024];
            if let Ok(read) = self.control.read(&mut buffer) {
                text.extend_from_slice(&buffer[..read]);
            }
        }
        let _ = self.control.shutdown(std::net::Shutdown::Write);
        let _ = self.control.set_read_timeout(None);
        let _ = self.control.read_to_end(&mut text);
        let _ = self.supervisor.wait();
        // A supervisor that was killed itself could not report.
        let report: Report = serde_json::from_slice(&text).unwrap_or_default();
        self.report = Some(report.clone());
        report
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.end(Duration::ZERO);
    }
}

impl From<&Report> for Usage {
    fn from(report: &Report) -> Self {
        Self {
            user_us: report.user_us,
            system_us: report.system_us,
            max_rss_kb: report.max_rss_kb,
        }
    }
}

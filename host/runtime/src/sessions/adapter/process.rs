//! A solver's process: started, watched, stopped, and what it wrote.
//!
//! One thread and one `poll`: it takes what arrives on standard output and error,
//! and looks often whether the call should end. Nothing that the solver writes can
//! take more memory than the limits say.

use std::io::{self, ErrorKind, Read};
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Command, ExitStatus, Stdio};
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, poll};
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use rustix::process::{
    Pid, PidfdFlags, Signal, WaitId, WaitIdOptions, kill_process_group, pidfd_open, waitid,
};
use rustix::time::Timespec;

use crate::fault::signal_name;

/// The pause between two looks at a solver when nothing happens.
const GLANCE: Duration = Duration::from_millis(10);

/// Most reads of a pipe before the rest is looked at again, so that a flood cannot hide the
/// deadline.
const ROUNDS: usize = 16;

/// The end of a solver.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum End {
    /// By itself.
    Exited(i32),
    /// By a signal that was not ours.
    Signalled(i32),
    /// By us: the call should end.
    Stopped,
}

impl std::fmt::Display for End {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            // Shells end so when a signal ended what they started.
            Self::Exited(code @ 129..=192) => {
                let name = signal_name(*code - 128);
                write!(f, "exited with code {code}, which stands for {name}")
            }
            Self::Exited(code) => write!(f, "exited with code {code}"),
            Self::Signalled(signal) => {
                write!(f, "was ended by {} (signal {signal})", signal_name(*signal))
            }
            Self::Stopped => f.write_str("was stopped"),
        }
    }
}

impl From<ExitStatus> for End {
    fn from(status: ExitStatus) -> Self {
        match status.code() {
            Some(code) => Self::Exited(code),
            None => Self::Signalled(status.signal().unwrap_or_default()),
        }
    }
}

/// The beginning and the end of what a solver wrote.
#[derive(Debug)]
pub(super) struct Captured {
    head: Vec<u8>,
    tail: Vec<u8>,
    most_head: usize,
    most_tail: usize,
    /// Bytes between head and tail that were not kept.
    pub(super) dropped: u64,
}

impl Captured {
    pub(super) fn new(most_head: usize, most_tail: usize) -> Self {
        Self {
            head: Vec::new(),
            tail: Vec::new(),
            most_head,
            most_tail,
            dropped: 0,
        }
    }

    fn push(&mut self, bytes: &[u8]) {
        let room = self.most_head - self.head.len();
        let (head, tail) = bytes.split_at(room.min(bytes.len()));
        self.head.extend_from_slice(head);
        self.tail.extend_from_slice(tail);
        // Dropped in large portions, for each costs time in proportion to the tail.
        if self.tail.len() > 2 * self.most_tail {
            self.shorten();
        }
    }

    fn shorten(&mut self) {
        let surplus = self.tail.len().saturating_sub(self.most_tail);
        self.tail.drain(..surplus);
        self.dropped += surplus as u64;
    }

    /// The kept output, as one text.
    pub(super) fn into_bytes(mut self) -> Vec<u8> {
        self.shorten();
        if self.dropped > 0 {
            // No pattern may match across the gap.
            self.head.push(b'\n');
        }
        self.head.append(&mut self.tail);
        self.head
    }
}

/// Splits what arrives into lines.
struct Splitter {
    partial: Vec<u8>,
}

impl Splitter {
    /// A longer line is two.
    const LONGEST: usize = 16 << 10;

    fn push(&mut self, bytes: &[u8], each: &mut dyn FnMut(&str)) {
        for part in bytes.split_inclusive(|byte| *byte == b'\n') {
            self.partial.extend_from_slice(part);
            if part.ends_with(b"\n") || self.partial.len() > Self::LONGEST {
                self.flush(each);
            }
        }
    }

    fn flush(&mut self, each: &mut dyn FnMut(&str)) {
        let line = self.partial.trim_ascii_end();
        if !line.is_empty() {
            each(&String::from_utf8_lossy(line));
        }
        self.partial.clear();
    }
}

/// One of the solver's two outputs.
struct Stream<'a, R> {
    pipe: R,
    open: bool,
    captured: Captured,
    splitter: Splitter,
    each: &'a mut dyn FnMut(&str),
}

impl<'a, R: Read + AsFd> Stream<'a, R> {
    fn new(pipe: R, captured: Captured, each: &'a mut dyn FnMut(&str)) -> io::Result<Self> {
        let flags = fcntl_getfl(&pipe)?;
        fcntl_setfl(&pipe, flags | OFlags::NONBLOCK)?;
        Ok(Self {
            pipe,
            open: true,
            captured,
            splitter: Splitter {
                partial: Vec::new(),
            },
            each,
        })
    }

    /// Takes what has arrived; whether there may be more.
    fn take(&mut self, buffer: &mut [u8]) -> bool {
        for _ in 0..ROUNDS {
            if !self.open {
                return false;
            }
            match self.pipe.read(buffer) {
                Ok(0) => self.open = false,
                Ok(read) => {
                    self.captured.push(&buffer[..read]);
                    self.splitter.push(&buffer[..read], self.each);
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) if error.kind() == ErrorKind::WouldBlock => return false,
                Err(_) => self.open = false,
            }
        }
        true
    }

    fn waiting(&self) -> Option<PollFd<'_>> {
        self.open.then(|| PollFd::new(&self.pipe, PollFlags::IN))
    }
}

/// The destinations of a solver's two outputs.
pub(super) struct Outputs<'a> {
    pub(super) stdout: Captured,
    pub(super) stderr: Captured,
    /// Lines of standard output, as they come.
    pub(super) stdout_line: &'a mut dyn FnMut(&str),
    /// Lines of standard error, as they come.
    pub(super) stderr_line: &'a mut dyn FnMut(&str),
}

/// The end of a solver, and its output.
pub(super) struct Ended {
    pub(super) end: End,
    pub(super) stdout: Captured,
    pub(super) stderr: Captured,
}

/// Runs a solver to its end, or until `stop` says so. Its process group does not
/// outlive it.
pub(super) fn run(
    command: &mut Command,
    outputs: Outputs<'_>,
    stop: &dyn Fn() -> bool,
) -> io::Result<Ended> {
    let mut child = command
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .process_group(0)
        .spawn()?;
    let pid = Pid::from_child(&child);
    let result = watch(&mut child, pid, outputs, stop);
    // Whatever else it started ends with it; a group that is empty is as good.
    let _ = kill_process_group(pid, Signal::KILL);
    let status = child.wait()?;
    let (stopped, stdout, stderr) = result?;
    Ok(Ended {
        end: if stopped { End::Stopped } else { status.into() },
        stdout,
        stderr,
    })
}

/// True if the process has ended. It is not reaped, so that its group keeps its
/// number.
fn has_ended(pid: Pid) -> bool {
    let options = WaitIdOptions::EXITED | WaitIdOptions::NOHANG | WaitIdOptions::NOWAIT;
    !matches!(waitid(WaitId::Pid(pid), options), Ok(None))
}

fn watch(
    child: &mut std::process::Child,
    pid: Pid,
    outputs: Outputs<'_>,
    stop: &dyn Fn() -> bool,
) -> io::Result<(bool, Captured, Captured)> {
    let missing = || io::Error::other("the pipes are missing");
    let stdout = child.stdout.take().ok_or_else(missing)?;
    let stderr = child.stderr.take().ok_or_else(missing)?;
    let mut stdout = Stream::new(stdout, outputs.stdout, outputs.stdout_line)?;
    let mut stderr = Stream::new(stderr, outputs.stderr, outputs.stderr_line)?;
    // Old kernels and some sandboxes have none; then the glances must do.
    let ended = pidfd_open(pid, PidfdFlags::empty()).ok();
    let mut buffer = vec![0; 1 << 16];
    let stopped = loop {
        if has_ended(pid) {
            break false;
        }
        if stop() {
            break true;
        }
        wait(
            [stdout.waiting(), stderr.waiting()],
            ended.as_ref().map(AsFd::as_fd),
        );
        stdout.take(&mut buffer);
        stderr.take(&mut buffer);
    };
    // The last words. A grandchild may hold the pipes open and write on for ever.
    if stopped {
        let _ = kill_process_group(pid, Signal::KILL);
    }
    while !stop() && (stdout.take(&mut buffer) | stderr.take(&mut buffer)) {}
    for (splitter, each) in [
        (&mut stdout.splitter, &mut stdout.each),
        (&mut stderr.splitter, &mut stderr.each),
    ] {
        splitter.flush(each);
    }
    Ok((stopped, stdout.captured, stderr.captured))
}

/// Waits for a moment, or until something arrives or the process ends.
fn wait(pipes: [Option<PollFd<'_>>; 2], ended: Option<BorrowedFd<'_>>) {
    let mut waiting: Vec<PollFd<'_>> = pipes.into_iter().flatten().collect();
    if let Some(ended) = &ended {
        waiting.push(PollFd::new(ended, PollFlags::IN));
    }
    let glance = Timespec {
        tv_sec: 0,
        tv_nsec: GLANCE.as_nanos() as i64,
    };
    // An interrupted wait is a short one.
    let _ = poll(&mut waiting, Some(&glance));
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

    use super::*;

    fn shell(script: &str, limit: Duration) -> (End, String, Vec<String>) {
        let mut lines = Vec::new();
        let begun = Instant::now();
        let ended = run(
            Command::new("sh").args(["-c", script]),
            Outputs {
                stdout: Captured::new(10, 10),
                stderr: Captured::new(1000, 0),
                stdout_line: &mut |_| {},
                stderr_line: &mut |line| lines.push(line.to_owned()),
            },
            &|| begun.elapsed() > limit,
        )
        .expect("a shell");
        let text = String::from_utf8_lossy(&ended.stdout.into_bytes()).into_owned();
        (ended.end, text, lines)
    }

    const LONG: Duration = Duration::from_mins(5);

    #[test]
    fn ends_are_told_apart() {
        assert_eq!(shell("exit 3", LONG).0, End::Exited(3));
        assert_eq!(shell("kill -9 $$", LONG).0, End::Signalled(9));
        assert_eq!(shell("sleep 600", Duration::ZERO).0, End::Stopped);
    }

    #[test]
    fn beginning_and_end_are_kept() {
        let (_, text, lines) = shell("seq 1000; printf 'a\\n\\nb\\r\\nc' >&2", LONG);
        assert_eq!(text, "1\n2\n3\n4\n5\n\n\n999\n1000\n");
        assert_eq!(lines, ["a", "b", "c"]);
    }

    #[test]
    fn a_grandchild_that_holds_the_pipes_is_not_waited_for() {
        let (end, text, _) = shell("sleep 600 & echo done", LONG);
        assert_eq!((end, text.as_str()), (End::Exited(0), "done\n"));
    }
}

//! One command of a job: the command itself, in a process of its own.

use std::io::{self, BufRead, BufReader, Read, Write};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::Path;
use std::process::{Child, ChildStderr, ChildStdin, ChildStdout, ExitStatus, Stdio};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use fleetyard_runtime::as_companion;
use rustix::process::{Pid, Signal, kill_process, kill_process_group, test_kill_process_group};

use super::ask::Command;

/// This program, also where its file was replaced meanwhile.
const PROGRAM: &str = "/proc/self/exe";

/// The speed of live fleets until somebody says otherwise: people watch, and a second takes a second.
pub(crate) const USUAL_SPEED: f64 = 1.0;

/// Longest line of standard output: a record with its violations.
const LINE_BYTES: u64 = 64 << 20;
/// Most bytes of standard output that are no lines of their own.
const OUTPUT_BYTES: usize = 64 << 20;
/// The end of standard error that is kept.
const STDERR_BYTES: usize = 16 << 10;

/// The time that supervisors have to end what a killed command has started. It takes
/// milliseconds, and a process that cannot be killed takes longer.
const ENDING: Duration = Duration::from_secs(30);
/// Between two looks.
const PAUSE: Duration = Duration::from_millis(2);

/// A command that runs.
#[derive(Debug)]
pub(crate) struct Process {
    child: Mutex<Child>,
    stdin: Mutex<Option<ChildStdin>>,
    group: Pid,
}

/// The end of a command.
#[derive(Debug)]
pub(crate) struct Ended {
    /// The exit code, or 128 and the signal.
    pub(crate) code: i32,
    /// The signal that ended it, if one did.
    pub(crate) signal: Option<i32>,
    /// The end of standard error.
    pub(crate) stderr: String,
    /// The command said more than can be kept, and was ended for it.
    pub(crate) too_much: bool,
}

/// The streams of a process.
pub(crate) struct Streams {
    stdout: ChildStdout,
    stderr: ChildStderr,
}

impl Process {
    /// Starts a command in a folder. It ends with the thread that calls this.
    pub(crate) fn start(command: &Command, folder: &Path) -> io::Result<(Arc<Self>, Streams)> {
        let mut process = std::process::Command::new(PROGRAM);
        process
            .arg0("fleetyard")
            .args(&command.words)
            .current_dir(folder)
            .stdin(if command.live {
                Stdio::piped()
            } else {
                Stdio::null()
            })
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        let mut child = as_companion(&mut process).spawn()?;
        let group = Pid::from_child(&child);
        let streams = (child.stdout.take(), child.stderr.take());
        let stdin = child.stdin.take();
        // A fleet that hears nothing does not keep the studio waiting.
        let stdin = stdin.filter(|stdin| rustix::io::ioctl_fionbio(stdin, true).is_ok());
        let process = Arc::new(Self {
            child: Mutex::new(child),
            stdin: Mutex::new(stdin),
            group,
        });
        let (Some(stdout), Some(stderr)) = streams else {
            process.kill();
            return Err(io::Error::other("the pipes are missing"));
        };
        if command.live {
            process.say(&format!("{{\"speed\":{USUAL_SPEED}}}"));
        }
        Ok((process, Streams { stdout, stderr }))
    }

    fn child(&self) -> MutexGuard<'_, Child> {
        self.child.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// As a person does at a terminal: what there is so far is kept.
    pub(crate) fn interrupt(&self) {
        let mut child = self.child();
        // One that has ended and was waited for has lost its number.
        if matches!(child.try_wait(), Ok(None)) {
            let _ = kill_process(Pid::from_child(&child), Signal::INT);
        }
    }

    /// At once. The supervisors of its plugins notice, and end these and themselves.
    pub(crate) fn kill(&self) {
        let _ = self.child().kill();
    }

    /// Tells a live fleet something; false where nobody hears it.
    pub(crate) fn say(&self, line: &str) -> bool {
        let mut stdin = self.stdin.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(pipe) = stdin.as_mut() else {
            return false;
        };
        let said = writeln!(pipe, "{line}").and_then(|()| pipe.flush()).is_ok();
        if !said {
            *stdin = None;
        }
        said
    }

    /// Reads what it says until it ends, then waits until nothing of it is left. `line` takes a line
    /// of standard output as it comes, and false ends the process.
    pub(crate) fn follow(
        &self,
        streams: Streams,
        line: &mut dyn FnMut(&[u8]) -> bool,
    ) -> io::Result<Ended> {
        let Streams { stdout, stderr } = streams;
        let (stderr, too_much) = thread::scope(|scope| {
            let stderr = scope.spawn(|| tail(stderr));
            let mut stdout = BufReader::new(stdout);
            let mut text = Vec::new();
            let mut too_much = false;
            loop {
                text.clear();
                let read = (&mut stdout).take(LINE_BYTES).read_until(b'\n', &mut text);
                match read {
                    Ok(0) | Err(_) => break,
                    Ok(_) if text.len() as u64 >= LINE_BYTES || !line(&text) => {
                        too_much = true;
                        self.kill();
                        break;
                    }
                    Ok(_) => {}
                }
            }
            // Until its other end is closed: a process that waits to be read does not end.
            let _ = io::copy(&mut stdout, &mut io::sink());
            (stderr.join().unwrap_or_default(), too_much)
        });
        let status = self.wait()?;
        self.bury();
        let signal = status.signal();
        Ok(Ended {
            code: status
                .code()
                .or(signal.map(|signal| 128 + signal))
                .unwrap_or(-1),
            signal,
            stderr,
            too_much,
        })
    }

    fn wait(&self) -> io::Result<ExitStatus> {
        loop {
            if let Some(status) = self.child().try_wait()? {
                return Ok(status);
            }
            thread::sleep(PAUSE);
        }
    }

    /// Waits for what it has started: supervisors are of its group, end by themselves, and leave
    /// nothing. Those that do not are killed.
    fn bury(&self) {
        let until = Instant::now() + ENDING;
        while test_kill_process_group(self.group).is_ok() {
            if Instant::now() >= until {
                let _ = kill_process_group(self.group, Signal::KILL);
                return;
            }
            thread::sleep(PAUSE);
        }
    }
}

/// The end of what a stream says.
fn tail(mut stream: impl Read) -> String {
    let mut kept = Vec::new();
    let mut buffer = [0; 4096];
    while let Ok(read @ 1..) = stream.read(&mut buffer) {
        kept.extend_from_slice(&buffer[..read]);
        if kept.len() > 2 * STDERR_BYTES {
            kept.drain(..kept.len() - STDERR_BYTES);
        }
    }
    let begin = kept.len().saturating_sub(STDERR_BYTES);
    String::from_utf8_lossy(&kept[begin..]).into_owned()
}

/// Standard output that is one document, within bounds.
#[derive(Debug, Default)]
pub(crate) struct Document(Vec<u8>);

impl Document {
    /// Takes a line; false where it is too much.
    pub(crate) fn push(&mut self, line: &[u8]) -> bool {
        self.0.extend_from_slice(line);
        self.0.len() <= OUTPUT_BYTES
    }

    pub(crate) fn json(&self) -> Option<serde_json::Value> {
        serde_json::from_slice(&self.0).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::tail;

    #[test]
    fn the_end_of_standard_error_is_kept() {
        let text = format!("{}the end", "x".repeat(100_000));
        let kept = tail(text.as_bytes());
        assert!(kept.len() <= 16 << 10 && kept.ends_with("the end"));
        assert_eq!(tail(&b"all"[..]), "all");
    }
}

//! The `fleetyard` command as a user runs it, on files in a folder of its own. Afterwards
//! tests look for what must not be left: processes and half-written files.
//!
//! Nothing here measures time; the limits are there so that a hang fails.

use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::fs;
use std::io::Read;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::places::{built, fleetyard, kept, root};

// The exit codes that users rely on; written out, so that a change shows.

/// All went well.
pub const SUCCESS: i32 = 0;
/// There is no plan.
pub const NO_PLAN: i32 = 1;
/// The command line is wrong.
pub const USAGE: i32 = 2;
/// A file is wrong.
pub const INPUT: i32 = 3;
/// A plan breaks a rule.
pub const INVALID_PLAN: i32 = 4;
/// A plugin is at fault.
pub const PLUGIN: i32 = 5;
/// The host failed.
pub const INTERNAL: i32 = 70;

/// A command that takes longer hangs.
const HANGING: Duration = Duration::from_mins(5);

/// Set for every command under test, inherited by all that it starts.
const MARK: &str = "FLEETYARD_TEST_MARK";

/// Arguments from a line of text.
pub fn words(line: &str) -> Vec<String> {
    line.split_whitespace().map(str::to_owned).collect()
}

/// The end of a command.
#[derive(Debug)]
pub struct Ended {
    /// The exit code; absent after a signal.
    pub code: Option<i32>,
    /// Standard output.
    pub stdout: String,
    /// Standard error.
    pub stderr: String,
    /// Processes that the command left running. They were killed.
    pub left: Vec<String>,
    /// State of its processes when they were taken to hang, and killed.
    pub hanging: Vec<String>,
}

impl Ended {
    /// Standard output as JSON.
    #[track_caller]
    pub fn json(&self) -> Value {
        serde_json::from_str(&self.stdout).unwrap_or_else(|error| panic!("{error}: {self}"))
    }

    /// Fails unless the exit code is right and nothing is left running.
    #[track_caller]
    #[expect(clippy::return_self_not_must_use, reason = "most callers ask no more")]
    pub fn expect(self, code: i32) -> Self {
        assert_eq!(self.code, Some(code), "{self}");
        assert!(
            self.left.is_empty(),
            "left running: {:?}\n{self}",
            self.left
        );
        self
    }
}

impl std::fmt::Display for Ended {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "exit code {:?}\n--- stdout\n{}\n--- stderr\n{}",
            self.code, self.stdout, self.stderr
        )
    }
}

/// The command under test, in a folder of its own.
#[must_use]
pub struct Yard {
    folder: tempfile::TempDir,
    variables: Vec<(String, String)>,
    own_group: bool,
}

impl Yard {
    /// An empty folder.
    #[expect(clippy::new_without_default, reason = "it makes a folder on disk")]
    pub fn new() -> Self {
        Self {
            folder: tempfile::tempdir().unwrap(),
            variables: Vec::new(),
            own_group: false,
        }
    }

    /// Starts the commands that follow as a shell does: as the leader of a process
    /// group. Otherwise an interrupt of the tests ends them too.
    pub fn in_own_group(mut self) -> Self {
        self.own_group = true;
        self
    }

    /// Sets an environment variable for the commands that follow.
    pub fn set(mut self, name: &str, value: &str) -> Self {
        self.variables.push((name.into(), value.into()));
        self
    }

    /// Lets cargo find what it needs on this machine, and nothing on the network.
    pub fn with_cargo(self) -> Self {
        let home = PathBuf::from(std::env::var_os("HOME").unwrap_or_default());
        let folder = |variable: &str, usual: &str| {
            let set = std::env::var_os(variable).map(PathBuf::from);
            set.unwrap_or(home.join(usual)).display().to_string()
        };
        self.set("CARGO_HOME", &folder("CARGO_HOME", ".cargo"))
            .set("RUSTUP_HOME", &folder("RUSTUP_HOME", ".rustup"))
            .set("CARGO_TARGET_DIR", &kept("packages").display().to_string())
            .set("CARGO_NET_OFFLINE", "true")
            // As quick to build as can be: that it works is what tests ask.
            .set("CARGO_PROFILE_RELEASE_OPT_LEVEL", "0")
    }

    /// A path in the folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes a file into the folder.
    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path(name);
        fs::write(&path, content).unwrap();
        path
    }

    /// The content of a file in the folder.
    pub fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    /// The names of all files in the folder, hidden ones included.
    pub fn files(&self) -> BTreeSet<String> {
        let entries = fs::read_dir(self.folder.path()).unwrap();
        entries
            .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
            .collect()
    }

    /// Starts the command without waiting for it.
    pub fn start<S: AsRef<OsStr>>(&self, arguments: &[S]) -> Started {
        self.start_program(fleetyard(), arguments)
    }

    fn start_program<S: AsRef<OsStr>>(
        &self,
        program: impl AsRef<OsStr>,
        arguments: &[S],
    ) -> Started {
        self.start_with(program, arguments, |_| ())
    }

    /// Starts the command after a last word about how.
    pub fn start_with<S: AsRef<OsStr>>(
        &self,
        program: impl AsRef<OsStr>,
        arguments: &[S],
        last: impl FnOnce(&mut Command),
    ) -> Started {
        static SERIAL: AtomicU32 = AtomicU32::new(0);
        let serial = SERIAL.fetch_add(1, Ordering::Relaxed);
        let mark = format!("{}-{serial}", std::process::id());
        let here = self.folder.path();
        let mut command = Command::new(program);
        command
            .args(arguments)
            .current_dir(here)
            // Plugins of the person who runs the tests have no say.
            .env_remove("FLEETYARD_PLUGIN_PATH")
            // As if the Python package were installed.
            .env("PYTHONPATH", root().join("abi/python"))
            .env("HOME", here)
            .env_remove("XDG_CACHE_HOME")
            .env("XDG_DATA_HOME", here)
            .env("XDG_DATA_DIRS", here)
            .env("TMPDIR", here)
            .env("PYTHONDONTWRITEBYTECODE", "1")
            .env("RUST_BACKTRACE", "0")
            .env(MARK, &mark)
            .envs(self.variables.iter().map(|(name, value)| (name, value)))
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        if self.own_group {
            command.process_group(0);
        }
        last(&mut command);
        Started {
            child: command.spawn().unwrap(),
            mark,
            hanging: Vec::new(),
        }
    }

    /// Runs the command to its end.
    pub fn run<S: AsRef<OsStr>>(&self, arguments: &[S]) -> Ended {
        self.start(arguments).wait()
    }

    /// Runs a line of shell, in which `fleetyard` is the command under test.
    pub fn shell(&self, line: &str) -> Ended {
        let line = format!("PATH='{}':\"$PATH\"\n{line}", built().display());
        self.start_program("sh", &["-c", &line]).wait()
    }

    /// The same with a path in a variable, for this one command.
    pub fn line_with(&self, line: &str, variable: &str, path: &Path) -> Ended {
        let here = self.folder.path().display().to_string();
        let maps = root().join("maps").display().to_string();
        let line = line.replace("{here}", &here).replace("{maps}", &maps);
        let path = path.display().to_string();
        let fleetyard = fleetyard().display().to_string();
        let mut arguments = vec![format!("{variable}={path}"), fleetyard];
        arguments.extend(words(&line));
        self.start_program("env", &arguments).wait()
    }

    /// Runs `fleetyard` with a line of arguments; `{here}` stands for the folder,
    /// `{maps}` for the maps of the repository.
    pub fn line(&self, line: &str) -> Ended {
        let here = self.folder.path().display().to_string();
        let maps = root().join("maps").display().to_string();
        let line = line.replace("{here}", &here).replace("{maps}", &maps);
        self.run(&words(&line))
    }
}

/// A command that is running.
pub struct Started {
    /// The process that was started.
    pub child: Child,
    mark: String,
    hanging: Vec<String>,
}

impl Started {
    /// Waits for the end.
    pub fn wait(self) -> Ended {
        let ended = self.wait_by(|started| {
            let mut status = None;
            until(|| {
                status = started.child.try_wait().unwrap();
                status.is_some()
            });
            if status.is_none() {
                started.stop();
                status = started.child.wait().ok();
            }
            status
        });
        assert!(ended.hanging.is_empty(), "the command hangs: {ended}");
        ended
    }

    /// Ends a command that hangs: all its processes, with a note of where each was.
    pub fn stop(&mut self) {
        for process in self.processes() {
            let where_it_is = |name: &str| {
                let path = format!("/proc/{}/{name}", process.id);
                fs::read_to_string(path)
                    .unwrap_or_default()
                    .trim()
                    .to_owned()
            };
            let call = where_it_is("syscall");
            self.hanging
                .push(format!("{process} in {} ({call})", where_it_is("wchan")));
            process.signal("KILL");
        }
    }

    /// Collects what the command says while `wait` waits for its end.
    pub fn wait_by(mut self, wait: impl FnOnce(&mut Self) -> Option<ExitStatus>) -> Ended {
        let stdout = reader(self.child.stdout.take().unwrap());
        let stderr = reader(self.child.stderr.take().unwrap());
        let status = wait(&mut self);
        let left = self.processes();
        // What is left may hold the pipes open.
        for process in &left {
            process.signal("KILL");
        }
        let (stdout, stderr) = (stdout.join().unwrap(), stderr.join().unwrap());
        Ended {
            code: status.and_then(|status| status.code()),
            stdout,
            stderr,
            left: left.iter().map(ToString::to_string).collect(),
            hanging: self.hanging,
        }
    }

    /// Every living process that inherited this command's mark, the command included.
    pub fn processes(&self) -> Vec<Process> {
        let wanted = format!("{MARK}={}", self.mark);
        let mut found: Vec<Process> = Vec::new();
        let mut closed = Vec::new();
        for entry in fs::read_dir("/proc").unwrap().flatten() {
            let Some(id) = entry
                .file_name()
                .to_str()
                .and_then(|name| name.parse().ok())
            else {
                continue;
            };
            let text = |name: &str| {
                let bytes = fs::read(entry.path().join(name)).unwrap_or_default();
                let text = String::from_utf8_lossy(&bytes).replace('\0', " ");
                text.trim().to_owned()
            };
            let process = || Process {
                id,
                name: text("comm"),
                command: text("cmdline"),
            };
            match fs::read(entry.path().join("environ")) {
                Ok(environment) => {
                    let mut variables = environment.split(|byte| *byte == 0);
                    if variables.any(|variable| variable == wanted.as_bytes()) {
                        found.push(process());
                    }
                }
                // A supervisor lets nobody look into it, but its parent is known.
                Err(error) if error.kind() == std::io::ErrorKind::PermissionDenied => {
                    let status = text("status");
                    let parent = status.lines().find_map(|line| line.strip_prefix("PPid:"));
                    let parent = parent.and_then(|parent| parent.trim().parse::<u32>().ok());
                    closed.push((parent, process()));
                }
                // It has just ended.
                Err(_) => {}
            }
        }
        for (parent, process) in closed {
            if found.iter().any(|known| Some(known.id) == parent) {
                found.push(process);
            }
        }
        found.sort_by_key(|process: &Process| process.id);
        found
    }
}

/// A process of a command under test.
#[derive(Debug)]
pub struct Process {
    /// Its number.
    pub id: u32,
    /// Its name, cut to 15 letters.
    pub name: String,
    /// Its command line.
    pub command: String,
}

impl Process {
    /// Sends a signal, such as `TERM`.
    pub fn signal(&self, signal: &str) {
        send(signal, &self.id.to_string());
    }

    /// As the terminal does: to everybody in the group that this process leads.
    pub fn signal_group(&self, signal: &str) {
        send(signal, &format!("-{}", self.id));
    }
}

fn send(signal: &str, to: &str) {
    // Gone already is as good.
    let _ = Command::new("kill")
        .args(["-s", signal, "--", to])
        .stderr(Stdio::null())
        .status();
}

impl std::fmt::Display for Process {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {} ({})", self.id, self.name, self.command)
    }
}

/// Asks again until the answer is yes; whether it came to be.
pub fn until(mut condition: impl FnMut() -> bool) -> bool {
    let started = Instant::now();
    while !condition() {
        if started.elapsed() > HANGING {
            return false;
        }
        thread::sleep(Duration::from_millis(5));
    }
    true
}

fn reader(mut stream: impl Read + Send + 'static) -> thread::JoinHandle<String> {
    thread::spawn(move || {
        let mut bytes = Vec::new();
        let _ = stream.read_to_end(&mut bytes);
        String::from_utf8_lossy(&bytes).into_owned()
    })
}

/// True if a program can be started; tests that need one say so when it is missing.
pub fn have(program: &str) -> bool {
    let found = Command::new(program).arg("--version").output().is_ok();
    if !found {
        eprintln!("skipped: {program} is not installed");
    }
    found
}

/// True if this process ignores a signal, as a shell has it for jobs in the background and `nohup`
/// for its commands; processes that are started from here inherit that. Says so.
pub fn is_ignored(signal: &str) -> bool {
    let number = match signal {
        "HUP" => 1,
        "INT" => 2,
        "QUIT" => 3,
        _ => return false,
    };
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = u64::from_str_radix(mask.unwrap().trim(), 16).unwrap();
    let ignored = (mask >> (number - 1)) & 1 == 1;
    if ignored {
        eprintln!("skipped: SIG{signal} is ignored here, and so by the command");
    }
    ignored
}

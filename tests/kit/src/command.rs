//! The common part of the end-to-end tests: they run the `fleetyard` command as a user does, on
//! files in a folder of their own, and afterwards look for things that must not be left: processes
//! and half-written files.
//!
//! Nothing here measures time; the limits are there so that a hang fails.

#![allow(
    dead_code,
    reason = "every test binary has its own copy and uses a part of it"
)]

use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::fs;
use std::io::Read;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use serde_json::Value;

/// The exit codes that users rely on; written out, so that a change shows.
pub(crate) const SUCCESS: i32 = 0;
pub(crate) const NO_PLAN: i32 = 1;
pub(crate) const USAGE: i32 = 2;
pub(crate) const INPUT: i32 = 3;
pub(crate) const INVALID_PLAN: i32 = 4;
pub(crate) const PLUGIN: i32 = 5;

/// A command that takes longer hangs.
const HANGING: Duration = Duration::from_mins(5);

/// Set for every command under test, inherited by all that it starts.
const MARK: &str = "FLEETYARD_TEST_MARK";

/// The repository.
pub(crate) fn root() -> PathBuf {
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR"));
    manifest.join("../..").canonicalize().unwrap()
}

/// A file of `maps/`, as text for arguments.
pub(crate) fn map(name: &str) -> String {
    root().join("maps").join(name).display().to_string()
}

/// Arguments that name an instance of `maps/`.
pub(crate) fn instance(name: &str, agents: usize) -> Vec<String> {
    let (map, scen) = (
        map(&format!("{name}.map")),
        map(&format!("{name}-random-1.scen")),
    );
    [
        "--map",
        &map,
        "--scen",
        &scen,
        "--agents",
        &agents.to_string(),
    ]
    .map(str::to_owned)
    .to_vec()
}

/// Arguments from a line of text.
pub(crate) fn words(line: &str) -> Vec<String> {
    line.split_whitespace().map(str::to_owned).collect()
}

/// The end of a command.
#[derive(Debug)]
pub(crate) struct Ended {
    /// The exit code; absent after a signal.
    pub(crate) code: Option<i32>,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
    /// Processes that the command left running. They were killed.
    pub(crate) left: Vec<String>,
    /// State of its processes when they were taken to hang, and killed.
    pub(crate) hanging: Vec<String>,
}

impl Ended {
    /// Standard output as JSON.
    #[track_caller]
    pub(crate) fn json(&self) -> Value {
        serde_json::from_str(&self.stdout).unwrap_or_else(|error| panic!("{error}: {self}"))
    }

    /// Fails unless the exit code is right and nothing is left running.
    #[track_caller]
    pub(crate) fn expect(self, code: i32) -> Self {
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
pub(crate) struct Yard {
    folder: tempfile::TempDir,
    variables: Vec<(String, String)>,
    own_group: bool,
}

impl Yard {
    pub(crate) fn new() -> Self {
        Self {
            folder: tempfile::tempdir().unwrap(),
            variables: Vec::new(),
            own_group: false,
        }
    }

    /// Starts the commands that follow as a shell does: as the leader of a process
    /// group. Otherwise an interrupt of the tests ends them too.
    pub(crate) fn in_own_group(mut self) -> Self {
        self.own_group = true;
        self
    }

    /// Sets an environment variable for the commands that follow.
    pub(crate) fn set(mut self, name: &str, value: &str) -> Self {
        self.variables.push((name.into(), value.into()));
        self
    }

    /// Lets cargo find what it needs on this machine, and nothing on the network.
    pub(crate) fn with_cargo(self) -> Self {
        let home = PathBuf::from(std::env::var_os("HOME").unwrap_or_default());
        let folder = |variable: &str, usual: &str| {
            let set = std::env::var_os(variable).map(PathBuf::from);
            set.unwrap_or(home.join(usual)).display().to_string()
        };
        self.set("CARGO_HOME", &folder("CARGO_HOME", ".cargo"))
            .set("RUSTUP_HOME", &folder("RUSTUP_HOME", ".rustup"))
            .set("CARGO_TARGET_DIR", &packages_target().display().to_string())
            .set("CARGO_NET_OFFLINE", "true")
            // As quick to build as can be: that it works is what tests ask.
            .set("CARGO_PROFILE_RELEASE_OPT_LEVEL", "0")
    }

    /// A path in the folder.
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes a file into the folder.
    pub(crate) fn write(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path(name);
        fs::write(&path, content).unwrap();
        path
    }

    pub(crate) fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    /// The names of all files in the folder, hidden ones included.
    pub(crate) fn files(&self) -> BTreeSet<String> {
        let entries = fs::read_dir(self.folder.path()).unwrap();
        entries
            .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
            .collect()
    }

    /// Starts the command without waiting for it.
    pub(crate) fn start<S: AsRef<OsStr>>(&self, arguments: &[S]) -> Started {
        self.start_program(env!("CARGO_BIN_EXE_fleetyard"), arguments)
    }

    fn start_program<S: AsRef<OsStr>>(&self, program: &str, arguments: &[S]) -> Started {
        self.start_with(program, arguments, |_| ())
    }

    /// Starts the command after a last word about how.
    pub(crate) fn start_with<S: AsRef<OsStr>>(
        &self,
        program: &str,
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
    pub(crate) fn run<S: AsRef<OsStr>>(&self, arguments: &[S]) -> Ended {
        self.start(arguments).wait()
    }

    /// Runs a line of shell, in which `fleetyard` is the command under test.
    pub(crate) fn shell(&self, line: &str) -> Ended {
        let beside = Path::new(env!("CARGO_BIN_EXE_fleetyard")).parent().unwrap();
        let line = format!("PATH='{}':\"$PATH\"\n{line}", beside.display());
        self.start_program("sh", &["-c", &line]).wait()
    }

    /// The same with a path in a variable, for this one command.
    pub(crate) fn line_with(&self, line: &str, variable: &str, path: &Path) -> Ended {
        let here = self.folder.path().display().to_string();
        let maps = root().join("maps").display().to_string();
        let line = line.replace("{here}", &here).replace("{maps}", &maps);
        let path = path.display().to_string();
        let fleetyard = env!("CARGO_BIN_EXE_fleetyard");
        let mut arguments = vec![format!("{variable}={path}"), fleetyard.to_owned()];
        arguments.extend(words(&line));
        self.start_program("env", &arguments).wait()
    }

    /// Runs `fleetyard` with a line of arguments; `{here}` stands for the folder,
    /// `{maps}` for the maps of the repository.
    pub(crate) fn line(&self, line: &str) -> Ended {
        let here = self.folder.path().display().to_string();
        let maps = root().join("maps").display().to_string();
        let line = line.replace("{here}", &here).replace("{maps}", &maps);
        self.run(&words(&line))
    }
}

/// A command that is running.
pub(crate) struct Started {
    pub(crate) child: Child,
    mark: String,
    hanging: Vec<String>,
}

impl Started {
    pub(crate) fn wait(self) -> Ended {
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
    pub(crate) fn stop(&mut self) {
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
    pub(crate) fn wait_by(mut self, wait: impl FnOnce(&mut Self) -> Option<ExitStatus>) -> Ended {
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
    pub(crate) fn processes(&self) -> Vec<Process> {
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
pub(crate) struct Process {
    pub(crate) id: u32,
    pub(crate) name: String,
    pub(crate) command: String,
}

impl Process {
    pub(crate) fn signal(&self, signal: &str) {
        send(signal, &self.id.to_string());
    }

    /// As the terminal does: to everybody in the group that this process leads.
    pub(crate) fn signal_group(&self, signal: &str) {
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
pub(crate) fn until(mut condition: impl FnMut() -> bool) -> bool {
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

/// Compiles a C or C++ file of the repository to a shared library, unless that was
/// done since it changed last. `variant` is the value of the macro `VARIANT`.
pub(crate) fn c_library(source: &str, variant: Option<&str>) -> PathBuf {
    // One at a time: tests of one process ask for the same library at once.
    static COMPILER: Mutex<()> = Mutex::new(());
    let _only = COMPILER.lock().unwrap_or_else(PoisonError::into_inner);
    let source = root().join(source);
    let include = root().join("abi/include");
    let cpp = source
        .extension()
        .is_some_and(|extension| extension == "cpp");
    let name = match variant {
        Some(variant) => variant.to_lowercase(),
        None => source.file_stem().unwrap().to_string_lossy().into_owned(),
    } + if cpp { "_cpp" } else { "" };
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("plugins");
    fs::create_dir_all(&folder).unwrap();
    let library = folder.join(format!("{name}.so"));
    let modified = |path: &Path| fs::metadata(path).and_then(|meta| meta.modified()).ok();
    let built = modified(&library);
    // Headers beside the source are a part of it.
    let headers = [source.parent().unwrap(), &include]
        .into_iter()
        .flat_map(|folder| fs::read_dir(folder).unwrap().flatten())
        .map(|entry| entry.path())
        .filter(|path| {
            let extension = path.extension().and_then(OsStr::to_str);
            matches!(extension, Some("h" | "hpp"))
        });
    let newest = headers.chain([source.clone()]).map(|path| modified(&path));
    if built.is_some() && built > newest.max().flatten() {
        return library;
    }
    // Another test process may use the old one, and sees the new one when it is whole.
    let unfinished = folder.join(format!("{name}.so.{}", std::process::id()));
    let (variable, usual, standard) = if cpp {
        ("CXX", "c++", "-std=c++17")
    } else {
        ("CC", "cc", "-std=c11")
    };
    let compiler = std::env::var_os(variable).unwrap_or_else(|| usual.into());
    let mut command = Command::new(compiler);
    command
        .args([standard, "-O1", "-fPIC", "-shared", "-fvisibility=hidden"])
        .arg("-pthread")
        .args(variant.map(|variant| format!("-DVARIANT={variant}")))
        .arg("-I")
        .arg(&include)
        .arg("-o")
        .arg(&unfinished)
        .arg(&source);
    let output = command.output().expect("a compiler is needed");
    let messages = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?}: {messages}");
    fs::rename(&unfinished, &library).unwrap();
    library
}

/// The planner that misbehaves on request, as a shared library.
pub(crate) fn faulty_library() -> PathBuf {
    c_library("plugins/faulty/faulty.c", None)
}

/// Its relative that throws exceptions; nothing without a C++ compiler.
pub(crate) fn faulty_cpp_library() -> Option<PathBuf> {
    let compiler = std::env::var("CXX").unwrap_or_else(|_| "c++".into());
    have(&compiler).then(|| c_library("plugins/faulty/faulty.cpp", None))
}

/// A planner in Rust that misbehaves on request, as a shared library.
pub(crate) fn faulty_rust_library() -> PathBuf {
    build("fleetyard-faulty").library.unwrap()
}

/// The same as a program.
pub(crate) fn faulty_program() -> PathBuf {
    root().join("plugins/faulty/faulty.py")
}

/// Gives a new package outside of the workspace the workspace's versions, which are on this
/// machine, and a build folder that stays, so that dependencies are built once.
pub(crate) fn prepare_package(folder: &Path) {
    if !folder.join("target").exists() {
        fs::create_dir_all(packages_target()).unwrap();
        fs::copy(root().join("Cargo.lock"), folder.join("Cargo.lock")).unwrap();
        std::os::unix::fs::symlink(packages_target(), folder.join("target")).unwrap();
    }
}

fn packages_target() -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join("packages")
}

/// Products of `cargo build` for a package: its shared library and its program.
#[derive(Debug, Clone, Default)]
pub(crate) struct Built {
    pub(crate) library: Option<PathBuf>,
    pub(crate) program: Option<PathBuf>,
}

/// Builds a package of the workspace beside the command under test, with the same
/// profile. Cargo holds no lock while tests run.
pub(crate) fn build(package: &str) -> Built {
    let beside = Path::new(env!("CARGO_BIN_EXE_fleetyard")).parent().unwrap();
    let profile = match beside.file_name().and_then(OsStr::to_str).unwrap() {
        "debug" => "dev",
        other => other,
    };
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command
        .args(["build", "--quiet", "--message-format=json"])
        .args(["--package", package, "--profile", profile])
        .arg("--target-dir")
        .arg(beside.parent().unwrap())
        .current_dir(root());
    let output = command.output().unwrap();
    let messages = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?}: {messages}");
    let mut built = Built::default();
    let stdout = String::from_utf8_lossy(&output.stdout);
    for message in stdout.lines() {
        let Ok(message) = serde_json::from_str::<Value>(message) else {
            continue;
        };
        let identifier = message["package_id"].as_str().unwrap_or_default();
        if !identifier.contains(&format!("#{package}@")) {
            continue;
        }
        for file in message["filenames"].as_array().into_iter().flatten() {
            let file = PathBuf::from(file.as_str().unwrap());
            if file.extension().is_some_and(|extension| extension == "so") {
                built.library = Some(file);
            }
        }
        if let Some(program) = message["executable"].as_str() {
            built.program = Some(program.into());
        }
    }
    built
}

/// True if a program can be started; tests that need one say so when it is missing.
pub(crate) fn have(program: &str) -> bool {
    let found = Command::new(program).arg("--version").output().is_ok();
    if !found {
        eprintln!("skipped: {program} is not installed");
    }
    found
}

/// True if this process ignores a signal, as a shell has it for jobs in the background and `nohup`
/// for its commands; processes that are started from here inherit that. Says so.
pub(crate) fn is_ignored(signal: &str) -> bool {
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

/// The part of a row that does not depend on the clock.
pub(crate) fn lasting(row: &fleetyard_bench::Row) -> String {
    format!(
        "{} {} {} {} {} {} {:?} {:?} {:?}",
        row.key,
        row.trial,
        row.planner,
        row.agents,
        row.termination,
        row.success,
        row.soc_steps,
        row.plan_digest,
        row.trace_digest
    )
}

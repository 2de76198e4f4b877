//! True if the runtimes of this machine run when only the listed system calls pass.
//!
//! The allow list is used where it does no harm: its test is that this program's own
//! worker and every usual interpreter that is found start in a sandbox with it and do
//! what planners do. Otherwise the deny list holds, and the record says why.

use std::fs;
use std::io::Read;
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::sync::OnceLock;
use std::time::Duration;

use fleetyard_core::{Hasher, write_atomically};

use crate::Fault;
use crate::confinement::control::Report;
use crate::confinement::process::Process;
use crate::confinement::sandbox::{Filter, Profile, find_program};
use crate::confinement::target::Target;
use crate::confinement::transport::Transport;
use crate::user_folder;

/// Interpreters by name, and what each is asked to do: threads, processes, files, pipes,
/// timers, and what its numerical libraries do when they are loaded.
const INTERPRETERS: [(&str, &[&str]); 5] = [
    (
        "sh",
        &["-c", "set -e; echo one >a; cat a | grep -q one; rm a"],
    ),
    ("python3", &["-c", PYTHON]),
    ("node", &["-e", NODE]),
    ("java", &["-version"]),
    ("julia", &["--startup-file=no", "-e", "print(sum(rand(9)))"]),
];

const PYTHON: &str = r#"
import asyncio, ctypes, heapq, json, math, multiprocessing, os, random, select, socket
import subprocess, sys, tempfile, threading, time
try:
    import numpy
    numpy.dot(numpy.ones((64, 64)), numpy.ones((64, 64)))
except ImportError:
    pass
def work(pipe):
    pipe.send(random.random())
thread = threading.Thread(target=time.sleep, args=(0,))
thread.start(), thread.join()
subprocess.run(["true"], check=True)
here, there = multiprocessing.get_context("fork").Pipe()
child = multiprocessing.get_context("fork").Process(target=work, args=(there,))
child.start(), here.recv(), child.join()
asyncio.run(asyncio.sleep(0))
with tempfile.TemporaryFile() as file:
    file.write(json.dumps([os.getpid()]).encode())
a, b = socket.socketpair()
a.sendall(b"x"), b.recv(1)
sys.exit(child.exitcode)
"#;

const NODE: &str = r#"
const { execFileSync } = require("child_process"), fs = require("fs");
const { Worker } = require("worker_threads");
fs.writeFileSync("a", "one"), execFileSync("cat", ["a"]);
new Worker("require('worker_threads').parentPort.postMessage(1)", { eval: true })
  .on("message", () => setTimeout(() => process.exit(0), 1))
  .on("error", () => process.exit(1));
"#;

/// The filter for `strict`, found out once in the life of this process, or by an earlier
/// one with the same runtimes. `try_worker` lets a worker introduce itself under a filter,
/// `start` starts a program under one, which has `patience` to end.
pub(crate) fn strictest(
    try_worker: impl Fn(Filter) -> Result<(), Fault>,
    start: impl Fn(Target, Filter) -> Result<Process, Fault>,
    patience: Duration,
) -> Filter {
    static FOUND: OnceLock<Filter> = OnceLock::new();
    let found = FOUND.get_or_init(|| {
        let passed = user_folder::folder("allow-list").ok().zip(circumstances());
        let passed = passed.map(|(folder, name)| folder.path.join(name));
        if passed.as_deref().is_some_and(Path::exists) {
            return Filter::of(Profile::AllowList);
        }
        if let Err(reason) = try_all(try_worker, start, patience) {
            // Not kept: what failed for want of time may pass the next time.
            return Filter {
                profile: Profile::DenyList,
                reason: Some(format!("the allow list failed its test: {reason}")),
            };
        }
        if let Some(passed) = passed {
            // Where it cannot be kept, it is tried again.
            let _ = write_atomically(&passed, b"");
        }
        Filter::of(Profile::AllowList)
    });
    found.clone()
}

/// Stands for all that the outcome depends on; `None` where that is not known.
fn circumstances() -> Option<String> {
    let mut hasher = Hasher::new("fleetyard allow list");
    let mut file = |path: &Path| {
        let meta = fs::metadata(path).ok()?;
        hasher.bytes(path.as_os_str().as_encoded_bytes());
        for number in [meta.dev(), meta.ino(), meta.size()] {
            hasher.bytes(&number.to_le_bytes());
        }
        hasher.bytes(&meta.mtime_nsec().to_le_bytes());
        hasher.bytes(&meta.mtime().to_le_bytes());
        Some(())
    };
    file(Path::new("/proc/self/exe"))?;
    for program in INTERPRETERS
        .iter()
        .filter_map(|(name, _)| find_program(name))
    {
        file(&program)?;
    }
    hasher.bytes(rustix::system::uname().release().to_bytes());
    Some(hasher.finish().to_string())
}

fn try_all(
    try_worker: impl Fn(Filter) -> Result<(), Fault>,
    start: impl Fn(Target, Filter) -> Result<Process, Fault>,
    patience: Duration,
) -> Result<(), String> {
    try_worker(Filter::of(Profile::AllowList)).map_err(|fault| format!("a worker {fault}"))?;
    for (name, arguments) in INTERPRETERS {
        if find_program(name).is_none() {
            continue;
        }
        let words = [name].into_iter().chain(arguments.iter().copied());
        let target = Target::Program(words.map(str::to_owned).collect());
        let process = start(target, Filter::of(Profile::AllowList));
        let process = process.map_err(|fault| fault.to_string())?;
        run(process, patience).map_err(|reason| format!("{name} {reason}"))?;
    }
    Ok(())
}

/// Waits for a program that ends by itself.
fn run(mut process: Process, patience: Duration) -> Result<(), String> {
    let report = process.end(patience);
    let how = match report {
        Report { code: Some(0), .. } => return Ok(()),
        Report {
            disturbed: Some(reason),
            ..
        }
        | Report {
            start_error: Some(reason),
            ..
        } => return Err(format!("did not start: {reason}")),
        Report { killed: true, .. } => "took too long".to_owned(),
        Report {
            signal: Some(signal),
            ..
        } => format!("ended by signal {signal}"),
        Report { code, .. } => format!("ended with code {}", code.unwrap_or_default()),
    };
    let mut said = Vec::new();
    // The pipe is not waited for: what is in it is all that there is.
    let _ = process.stderr.read_to_end(&mut said);
    let said = String::from_utf8_lossy(&said);
    let last = said.lines().rev().find(|line| !line.trim().is_empty());
    Err(match last {
        Some(last) => format!("{how}: {}", last.chars().take(200).collect::<String>()),
        None => how,
    })
}

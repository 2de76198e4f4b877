//! Faults that a planner does to its process and to the machine. Names and meaning are those of
//! `mischief.h`, as far as safe Rust without further crates goes.
//!
//! Attempts say in the metric `reached` whether they succeeded; faults that take something without
//! end stop where it is refused. After both the planner is honest.

use std::ffi::OsStr;
use std::fs::{self, File, OpenOptions};
use std::hint::black_box;
use std::io::{self, Read as _, Write};
use std::net::{SocketAddr, TcpStream, UdpSocket};
use std::os::linux::net::SocketAddrExt as _;
use std::os::unix::ffi::OsStrExt as _;
use std::os::unix::net::{SocketAddr as LocalAddress, UnixStream};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use fleetyard_abi::LogLevel;
use fleetyard_abi::sdk::Sink;

use crate::{Fault, FaultyOptions};

const MIB: u64 = 1 << 20;
const GIB: u64 = 1 << 30;
const PAGE: usize = 4096;

/// Does the fault of the options, if it is one of these. Many do not return.
pub(crate) fn run(options: &FaultyOptions, sink: &dyn Sink) {
    let size = |usual| or_else(options.size, usual);
    let count = |usual| or_else(options.count, usual);
    let target = |usual| match options.target.as_str() {
        "" => usual,
        target => target,
    };
    match options.fault {
        Fault::Panic => panic!("panicked as asked"),
        Fault::OutOfBounds => {
            let cells = black_box([0_u8; 3]);
            sink.metric("cell", f64::from(cells[black_box(3)]));
        }
        Fault::PanicThread => panic_in_thread(sink),
        Fault::PanicTwice => {
            let _worse = PanicsWhenDropped;
            panic!("panicked as asked");
        }
        Fault::Never => sleep_for_ever(),
        Fault::Spin => spin(),
        Fault::Deadlock => deadlock(),
        Fault::Abort => std::process::abort(),
        Fault::Exit0 => std::process::exit(0),
        Fault::Exit3 => std::process::exit(3),
        Fault::StackOverflow => sink.metric("depth", deeper(0) as f64),
        Fault::AllocationTooLarge => {
            let memory: Vec<u8> = Vec::with_capacity(black_box(isize::MAX as usize));
            sink.metric("obtained", memory.capacity() as f64);
        }
        Fault::Grandchild => leave_grandchild(sink),
        Fault::ThreadBomb => thread_bomb(sink, count(5000)),
        Fault::SpinThreads => spin_threads(count(16)),
        Fault::Hog => loop {
            leak(64 * MIB);
        },
        Fault::Allocate => {
            let memory = touched(size(8 * GIB));
            sink.metric("obtained", memory.len() as f64);
            attempt(sink, "memory", Ok(()));
        }
        Fault::Leak => {
            let wanted = size(8 * GIB);
            for _ in 0..wanted / MIB {
                leak(MIB);
            }
            sink.metric("obtained", wanted as f64);
            attempt(sink, "memory", Ok(()));
        }
        Fault::Garbage => {
            print!("solving...\n{{\"jsonrpc\":\"2.0\",\n[1,2\n");
            eprint!("solving...\n{{\"jsonrpc\":\"2.0\",\n[1,2\n");
        }
        Fault::Flood => flood(io::stdout().lock(), size(GIB)),
        Fault::FloodStderr => flood(io::stderr().lock(), size(GIB)),
        Fault::LogFlood => {
            let line = "x".repeat(1024);
            for _ in 0..size(GIB) / 1024 {
                sink.log(LogLevel::Info, &line);
            }
        }
        Fault::Nan => {
            sink.metric("not-a-number", f64::NAN);
            sink.metric("infinity", f64::INFINITY);
        }
        Fault::HugeFile => fill_file(sink, size(GIB), false),
        Fault::UnlinkedFile => fill_file(sink, size(GIB), true),
        Fault::ManyFiles => many_files(sink, count(100_000)),
        Fault::WriteOutside => {
            let path = target("/var/tmp/fy-outside");
            let file = OpenOptions::new().append(true).create(true).open(path);
            let written = file.and_then(|mut file| file.write_all(b"faulty was here\n"));
            attempt(sink, path, written);
        }
        Fault::RemoveOutside => {
            let path = target("/var/tmp/fy-outside");
            attempt(sink, path, fs::remove_file(path));
        }
        Fault::ReadFile => {
            let path = target("/etc/shadow");
            let read = File::open(path).and_then(|mut file| file.read_exact(&mut [0]));
            attempt(sink, path, read);
        }
        Fault::ListFolder => list_folder(sink, target("/root")),
        Fault::Getenv => {
            let name = target("HOST_SECRET");
            let found = std::env::var_os(name).is_some();
            attempt(sink, name, if found { Ok(()) } else { missing() });
        }
        Fault::ReadEnvironment => read_environment(sink, target("HOST_SECRET")),
        Fault::ConnectTcp => connect_tcp(sink, target("127.0.0.1:9")),
        Fault::ConnectUdp => connect_udp(sink, target("127.0.0.1:9")),
        Fault::ConnectUnix => {
            let path = target("/run/fy-nobody");
            attempt(sink, path, UnixStream::connect(path).and_then(greet));
        }
        Fault::ConnectAbstract => {
            let name = target("fy-nobody");
            let address = LocalAddress::from_abstract_name(name);
            let connected = address.and_then(|address| UnixStream::connect_addr(&address));
            attempt(sink, name, connected.and_then(greet));
        }
        // Those of plans and answers.
        Fault::None
        | Fault::Fails
        | Fault::Late
        | Fault::Twice
        | Fault::TooFewAgents
        | Fault::ClaimsSolvedWithoutPlan
        | Fault::ExitAfterPlan
        | Fault::CrashAfter => {}
    }
}

// ---- Help for the faults -----------------------------------------------------------

fn or_else(value: u64, usual: u64) -> u64 {
    if value == 0 { usual } else { value }
}

fn missing() -> io::Result<()> {
    Err(io::ErrorKind::NotFound.into())
}

/// Says whether an attempt succeeded.
fn attempt(sink: &dyn Sink, what: &str, outcome: io::Result<()>) {
    let (reached, text) = match outcome {
        Ok(()) => (1.0, format!("{what}: reached")),
        Err(error) => (0.0, format!("{what}: {error}")),
    };
    sink.log(LogLevel::Info, &text);
    sink.metric("reached", reached);
}

fn scratch() -> PathBuf {
    std::env::temp_dir()
}

fn greet(mut stream: impl Write) -> io::Result<()> {
    stream.write_all(b"faulty\n")
}

fn sleep_for_ever() {
    loop {
        thread::sleep(Duration::from_hours(1));
    }
}

fn spin() {
    let mut turns = 0_u64;
    loop {
        turns = black_box(turns.wrapping_add(1));
    }
}

// ---- Time and ends -----------------------------------------------------------------

/// A thread's panic is its own, until somebody asks for its result.
fn panic_in_thread(sink: &dyn Sink) {
    let outcome = thread::spawn(|| panic!("panicked in a thread, as asked")).join();
    sink.metric("survived", f64::from(u8::from(outcome.is_err())));
}

struct PanicsWhenDropped;

impl Drop for PanicsWhenDropped {
    fn drop(&mut self) {
        panic!("panicked while panicking, as asked");
    }
}

fn deadlock() {
    let cells = Mutex::new(0);
    let first = cells.lock().unwrap_or_else(PoisonError::into_inner);
    let second = cells.lock().unwrap_or_else(PoisonError::into_inner);
    drop((first, second));
}

/// Deeper and deeper; the sum keeps it from becoming a loop.
#[allow(unconditional_recursion, reason = "that is the fault")]
fn deeper(depth: u64) -> u64 {
    let room = black_box([depth; 512]);
    deeper(depth + 1) + room[depth as usize % room.len()]
}

// ---- Processes, threads, memory ----------------------------------------------------

/// A shell in another session that ignores polite signals, keeps the pipes open and is
/// known by its name.
fn leave_grandchild(sink: &dyn Sink) {
    let script = "trap '' TERM HUP PIPE; printf fy-orphan >/proc/$$/comm; sleep 120; :";
    // Where there is no `setsid`, the same group, but another parent.
    let started = Command::new("sh")
        .arg("-c")
        .arg(r#"(command -v setsid >/dev/null && exec setsid sh -c "$0" || eval "$0") & :"#)
        .arg(script)
        .stdin(Stdio::inherit())
        .status();
    let text = match started {
        Ok(status) if status.success() => "left a grandchild behind".into(),
        Ok(status) => format!("could not leave a grandchild behind: {status}"),
        Err(error) => format!("could not start a shell: {error}"),
    };
    sink.log(LogLevel::Info, &text);
}

fn small_thread(work: fn()) -> io::Result<thread::JoinHandle<()>> {
    thread::Builder::new().stack_size(1 << 16).spawn(work)
}

fn thread_bomb(sink: &dyn Sink, most: u64) {
    let (mut threads, mut told) = (0_u64, false);
    loop {
        if threads < most && small_thread(sleep_for_ever).is_ok() {
            threads += 1;
            continue;
        }
        if !told {
            sink.metric("obtained", threads as f64);
        }
        told = true;
        thread::sleep(Duration::from_millis(1));
    }
}

fn spin_threads(threads: u64) {
    for _ in 1..threads {
        // Refused or not, this thread spins too.
        let _ = small_thread(spin);
    }
    spin();
}

/// Memory of which every page was written to.
fn touched(size: u64) -> Vec<u8> {
    let mut memory = vec![0; size as usize];
    for byte in memory.iter_mut().step_by(PAGE) {
        *byte = 1;
    }
    black_box(memory)
}

fn leak(size: u64) {
    black_box(touched(size).leak());
}

// ---- Output and files --------------------------------------------------------------

fn flood(mut stream: impl Write, size: u64) {
    let mut lines = ["x"; 127].concat();
    lines.push('\n');
    let lines = lines.repeat(512);
    for _ in 0..size.div_ceil(lines.len() as u64) {
        if stream.write_all(lines.as_bytes()).is_err() {
            break;
        }
    }
}

fn fill_file(sink: &dyn Sink, size: u64, unlinked: bool) {
    let path = scratch().join(format!("fy-huge-{}", std::process::id()));
    let mut obtained = 0;
    let outcome = File::create(&path).and_then(|mut file| {
        if unlinked {
            fs::remove_file(&path)?;
        }
        let block = vec![b'x'; MIB as usize];
        let mut outcome = Ok(());
        while obtained < size && outcome.is_ok() {
            outcome = file.write(&block).map(|written| obtained += written as u64);
        }
        if unlinked {
            // It takes room as long as it is open.
            thread::sleep(Duration::from_millis(500));
        }
        outcome
    });
    sink.metric("obtained", obtained as f64);
    attempt(sink, &path.display().to_string(), outcome);
}

fn many_files(sink: &dyn Sink, wanted: u64) {
    let folder = scratch().join(format!("fy-many-{}", std::process::id()));
    let mut outcome = fs::create_dir(&folder);
    let mut made = 0;
    while made < wanted && outcome.is_ok() {
        outcome = fs::write(folder.join(made.to_string()), "x");
        made += u64::from(outcome.is_ok());
    }
    sink.metric("obtained", made as f64);
    attempt(sink, &folder.display().to_string(), outcome);
}

fn list_folder(sink: &dyn Sink, path: &str) {
    let outcome = fs::read_dir(path).and_then(|entries| {
        let entries = entries.count();
        sink.metric("entries", entries as f64);
        // An empty one was put in its place.
        if entries > 0 { Ok(()) } else { missing() }
    });
    attempt(sink, path, outcome);
}

/// Looks for a variable in the environments of all processes that can be seen.
fn read_environment(sink: &dyn Sink, name: &str) {
    let wanted = format!("{name}=");
    let (mut readable, mut found) = (0_u32, false);
    for entry in fs::read_dir("/proc").into_iter().flatten().flatten() {
        let is_process = |name: &OsStr| name.as_bytes().iter().all(u8::is_ascii_digit);
        if !is_process(&entry.file_name()) {
            continue;
        }
        let path: &Path = &entry.path().join("environ");
        let Ok(environment) = fs::read(path) else {
            continue;
        };
        readable += 1;
        let mut variables = environment.split(|byte| *byte == 0);
        found |= variables.any(|variable| variable.starts_with(wanted.as_bytes()));
    }
    sink.metric("readable", f64::from(readable));
    attempt(sink, name, if found { Ok(()) } else { missing() });
}

// ---- Network -----------------------------------------------------------------------

fn address(target: &str) -> io::Result<SocketAddr> {
    target
        .parse()
        .map_err(|error| io::Error::new(io::ErrorKind::InvalidInput, error))
}

fn connect_tcp(sink: &dyn Sink, target: &str) {
    let connect = |address| TcpStream::connect_timeout(&address, Duration::from_secs(1));
    attempt(
        sink,
        target,
        address(target).and_then(connect).and_then(greet),
    );
}

fn connect_udp(sink: &dyn Sink, target: &str) {
    let send = |address| UdpSocket::bind("0.0.0.0:0")?.send_to(b"faulty\n", address);
    attempt(sink, target, address(target).and_then(send).map(drop));
}

//! `fleetyard studio`: worlds are edited, planned for and watched in a browser on this machine.

use std::net::IpAddr;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::thread;

use clap::Args;
use fleetyard_runtime::{LOCK_FILE, on_interrupt};
use fleetyard_studio::{Config, Server};

use crate::args::TrustArgs;
use crate::exit::{Exit, Result, internal};
use crate::output;
use crate::setup::{runtime, trust};

/// Edit a world with its robots, plan with any planner, and watch executions, in a browser.
///
/// Serves a page on this machine alone until it is interrupted, and prints its address with the
/// secret that lets a browser in.
#[derive(Debug, Args)]
pub(crate) struct Studio {
    /// A task, a world, a map or a scenario to begin with, traces to watch, and the store of a suite, or a
    /// folder with one, whose trials to open
    #[arg(value_name = "FILE")]
    files: Vec<PathBuf>,
    /// The trial of the suite that is opened at once: its task or map, and its plan where the suite keeps
    /// plans
    #[arg(long, value_name = "ID", requires = "files")]
    trial: Option<String>,
    /// Port of the page; 0 is one that is free
    #[arg(long, value_name = "N", default_value_t = 0)]
    port: u16,
    /// Start no browser. Where standard input is a pipe, the studio ends when that is closed
    #[arg(long)]
    no_open: bool,
    /// Address to listen at. Any other than 127.0.0.1 is unwise: whoever reads the traffic, which is not
    /// encrypted, learns the secret and can run planners as you. A tunnel is better: ssh -L PORT:127.0.0.1:PORT
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1")]
    bind: IpAddr,
    #[command(flatten)]
    trust: TrustArgs,
}

pub(crate) fn studio(arguments: &Studio) -> Result<Exit> {
    fleetyard_runtime::allow_open_files();
    if !arguments.bind.is_loopback() {
        output::warning(&format!(
            "the studio listens at {}: whoever reads the traffic can do here what you can",
            arguments.bind
        ));
    }
    let server = Server::bind(Config {
        files: arguments.files.clone(),
        trial: arguments.trial.clone(),
        address: arguments.bind,
        port: arguments.port,
        runtime: runtime(trust(&arguments.trust)?)?,
        trust: trust_words(&arguments.trust),
        tell: output::note,
    })?;
    for note in server.notes() {
        output::note(note);
    }
    let stop = server.stopper();
    if let Err(error) = on_interrupt(move |_| stop.stop()) {
        output::warning(&format!(
            "an interrupt will end the studio at once: {error}"
        ));
    }
    output::print(&server.printed())?;
    if arguments.no_open {
        server.stopper().when_input_closes().map_err(internal)?;
    } else {
        open(server.for_browser());
    }
    server.serve().map_err(internal)?;
    Ok(Exit::Success)
}

/// The arguments of jobs, which run in other folders, that say which plugins may run.
fn trust_words(arguments: &TrustArgs) -> Vec<String> {
    let usual = PathBuf::from(LOCK_FILE);
    let lock = arguments
        .lock
        .clone()
        .or_else(|| usual.exists().then_some(usual));
    let lock = lock.map(|lock| std::path::absolute(&lock).unwrap_or(lock));
    let lock = lock.map(|lock| format!("--lock={}", lock.display()));
    let locked = arguments.locked.then(|| "--locked".to_owned());
    lock.into_iter().chain(locked).collect()
}

/// Starts the user's browser, and says where there is none.
fn open(address: String) {
    let program = if cfg!(target_os = "macos") {
        "open"
    } else {
        "xdg-open"
    };
    thread::spawn(move || {
        let status = Command::new(program)
            .arg(address)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .status();
        if !status.is_ok_and(|status| status.success()) {
            output::note("no browser could be started: open the address above in one");
        }
    });
}

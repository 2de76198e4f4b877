//! Workers: copies of the supervisor that serve a library's plugins, or a solver.

use std::convert::Infallible;
use std::io::Write;

use fleetyard_abi::wire::{self, Response};
use fleetyard_abi::{c, serve};

use crate::Fault;
use crate::confinement::supervisor;
use crate::confinement::target::Target;
use crate::sessions::adapter::Adapter;
use crate::sessions::library::Library;

/// Call first in `main`: becomes a supervisor and never returns when the process
/// was started as one. `built_in` are the entries that are linked in.
pub fn intercept(built_in: &'static [&'static c::PluginEntry]) {
    supervisor::intercept(&|target| -> Infallible { worker(target, built_in) });
}

/// Becomes the worker: serves a library's plugins on private descriptors.
fn worker(target: &Target, built_in: &'static [&'static c::PluginEntry]) -> ! {
    let (input, output) = match serve::private_stdio() {
        Ok(streams) => streams,
        Err(error) => {
            eprintln!("cannot set up the worker's streams: {error}");
            std::process::exit(1);
        }
    };
    let input = std::io::BufReader::with_capacity(1 << 16, input);
    let gone = || std::process::exit(0);
    let library = match target {
        Target::Adapter(path) => {
            match Adapter::open(path) {
                Ok(adapter) => serve::serve(&adapter, input, output, gone),
                Err(fault) => refuse(&fault, output),
            }
            std::process::exit(0)
        }
        Target::Library(path) => Library::open(path),
        _ => Library::from_entries(built_in),
    };
    match library {
        Ok(library) => {
            serve::serve(&library, input, output, gone);
            library.deinit();
        }
        Err(fault) => refuse(&fault, output),
    }
    std::process::exit(0)
}

/// Answers the host's first request, which is number 1, by a fault that explains
/// itself.
fn refuse(fault: &Fault, mut output: std::fs::File) {
    let hint = fault
        .hint()
        .map(|hint| format!("\n{hint}"))
        .unwrap_or_default();
    let answer = Response::error(Some(1), wire::REFUSED, format!("{fault}{hint}"));
    // A host that is gone needs no answer.
    let _ = output.write_all(&wire::line(&answer));
}

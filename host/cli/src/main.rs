//! The `fleetyard` command: arguments in, results on standard output, everything
//! else on standard error, and an exit code that says how it went.

#![forbid(unsafe_code)]

mod args;
mod commands;
mod exit;
mod output;
mod setup;

use clap::Parser;

use crate::args::{Cli, Command, Maps, Plugins, Trace};
use crate::exit::{Exit, Result};

/// The plugins that are linked in, by the same entry that a shared library has.
static BUILT_IN: &[&fleetyard_abi::c::PluginEntry] =
    &[&fleetyard_plugins::fleetyard_plugin_entry_v1];

fn main() {
    // Does not return in the processes that this program starts for plugins.
    fleetyard_runtime::supervisor::intercept(BUILT_IN);
    let exit = match dispatch(Cli::parse().command) {
        Ok(exit) => exit,
        Err(failure) => {
            eprintln!("{}", output::plain(&failure.to_string()));
            failure.exit
        }
    };
    std::process::exit(exit.code());
}

fn dispatch(command: Command) -> Result<Exit> {
    match command {
        Command::Run(arguments) => commands::run::run(&arguments),
        Command::Fleet(arguments) => commands::fleet::fleet(&arguments),
        Command::Compare(arguments) => commands::compare::compare(&arguments),
        Command::Bench(arguments) => commands::bench::bench(&arguments),
        Command::Store(what) => commands::store::stores(&what),
        Command::Report(arguments) => commands::report::report(&arguments),
        Command::Convert(arguments) => commands::convert::convert(&arguments),
        Command::Validate(arguments) => commands::validate::validate(&arguments),
        Command::Simulate(arguments) => commands::simulate::simulate(&arguments),
        Command::Trace(Trace::Info { file, format }) => commands::trace::info(&file, format),
        Command::Trace(Trace::Diff(arguments)) => commands::trace::diff(&arguments),
        Command::Trace(Trace::Export(arguments)) => commands::trace::export(&arguments),
        Command::Jobs(what) => commands::jobs::jobs(&what),
        Command::Plugins(Plugins::New(arguments)) => commands::new::new(&arguments),
        Command::Plugins(Plugins::List { trust, format }) => {
            commands::plugins::list(&trust, format)
        }
        Command::Plugins(Plugins::Check(arguments)) => commands::check::check(&arguments),
        Command::Plugins(Plugins::Info {
            plugin,
            trust,
            format,
        }) => commands::plugins::info(&plugin, &trust, format),
        Command::Plugins(Plugins::Pin(arguments)) => commands::pin::pin(&arguments),
        Command::Maps(Maps::Generate(what)) => commands::maps::generate(&what),
        Command::Maps(Maps::Scenario {
            map,
            agents,
            seed,
            out,
        }) => commands::maps::scenario(&map, agents, seed, &out),
        Command::Maps(Maps::Info { map, format }) => commands::maps::info(&map, format),
        Command::Doctor {
            security: true,
            sandbox,
            format,
        } => commands::security::security(sandbox, format),
        Command::Doctor {
            sandbox, format, ..
        } => commands::doctor::doctor(sandbox, format),
        Command::Completions { shell } => commands::completions(shell),
    }
}

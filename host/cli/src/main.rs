//! The `fleetyard` command: arguments in, results on standard output, everything
//! else on standard error, and an exit code that says how it went.

#![forbid(unsafe_code)]

mod args;
mod commands;
mod exit;
mod files;
mod output;
mod setup;

use std::path::PathBuf;

use clap::{ArgMatches, CommandFactory, FromArgMatches, Parser, Subcommand};
use clap_complete::Shell;
use fleetyard_core::short_numbers;

use crate::commands::bench::{Bench, bench};
use crate::commands::compare::{Compare, compare};
use crate::commands::completions::completions;
use crate::commands::convert::{Convert, convert};
use crate::commands::doctor::{Doctor, doctor};
use crate::commands::fleet::{Fleet, fleet};
use crate::commands::jobs::{Jobs, jobs};
use crate::commands::man::man;
use crate::commands::maps::{Maps, maps};
use crate::commands::plugins::{Plugins, plugins};
use crate::commands::report::{ReportArgs, report};
use crate::commands::run::{Run, run};
use crate::commands::security::security;
use crate::commands::simulate::{Simulate, simulate};
use crate::commands::store::{Stores, stores};
use crate::commands::studio::{Studio, studio};
use crate::commands::trace::{Trace, trace};
use crate::commands::validate::{Validate, validate};
use crate::commands::world::{Worlds, worlds};
use crate::exit::{Exit, Result};

/// Runs, executes and judges multi-robot planners.
#[derive(Debug, Parser)]
#[command(name = "fleetyard", version, about, after_help = exit::HELP, propagate_version = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Run(Run),
    Compare(Compare),
    Fleet(Box<Fleet>),
    Bench(Bench),
    /// Look at the stores of suites, join them, write them in other formats
    #[command(subcommand)]
    Store(Stores),
    Report(ReportArgs),
    Validate(Validate),
    Simulate(Simulate),
    Convert(Convert),
    Studio(Studio),
    /// Look at traces of executions
    #[command(subcommand)]
    Trace(Trace),
    /// Look at suites that run on a cluster, and go on with them
    #[command(subcommand)]
    Jobs(Jobs),
    /// Make and look at plugins
    #[command(subcommand)]
    Plugins(Plugins),
    /// Make and look at maps
    #[command(subcommand)]
    Maps(Maps),
    /// Derive grids and roadmaps of a task's world
    #[command(subcommand, name = "world")]
    Worlds(Worlds),
    Doctor(Doctor),
    /// Print a completion script for a shell
    Completions {
        /// The shell
        shell: Shell,
    },
    /// Write the manual, a page for each command
    #[command(hide = true)]
    Man {
        /// The folder for the pages
        folder: PathBuf,
    },
}

fn main() {
    // Does not return in the processes that this program starts for plugins.
    fleetyard_runtime::supervisor::intercept(setup::BUILT_IN);
    let matches = Cli::command().try_get_matches();
    let matches = matches.unwrap_or_else(|error| args::explained(error).exit());
    let cli = Cli::from_arg_matches(&matches);
    let cli = cli.unwrap_or_else(|error| error.format(&mut Cli::command()).exit());
    let exit = match dispatch(&cli.command, &matches) {
        Ok(exit) => exit,
        Err(failure) => {
            let message = short_numbers(failure.to_string());
            eprintln!("{}", output::plain(&message));
            failure.exit
        }
    };
    std::process::exit(exit.code());
}

fn dispatch(command: &Command, matches: &ArgMatches) -> Result<Exit> {
    let given = matches.subcommand().map_or(matches, |(_, given)| given);
    match command {
        Command::Run(arguments) => run(arguments),
        Command::Compare(arguments) => compare(arguments),
        Command::Fleet(arguments) => fleet(arguments, given),
        Command::Bench(arguments) => bench(arguments),
        Command::Store(what) => stores(what),
        Command::Report(arguments) => report(arguments),
        Command::Validate(arguments) => validate(arguments),
        Command::Simulate(arguments) => simulate(arguments),
        Command::Convert(arguments) => convert(arguments),
        Command::Studio(arguments) => studio(arguments),
        Command::Trace(what) => trace(what),
        Command::Jobs(what) => jobs(what),
        Command::Plugins(what) => plugins(what),
        Command::Maps(what) => maps(what, given),
        Command::Worlds(what) => worlds(what),
        Command::Doctor(arguments) if arguments.security => security(arguments),
        Command::Doctor(arguments) => doctor(arguments),
        Command::Completions { shell } => completions(*shell, Cli::command()),
        Command::Man { folder } => man(folder, Cli::command()),
    }
}

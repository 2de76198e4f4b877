//! The command line, defined once: help, completions and checks follow from it.

use std::ffi::OsStr;
use std::path::PathBuf;
use std::str::FromStr;
use std::time::Duration;

use bytesize::ByteSize;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::error::ErrorKind;
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Args, FromArgMatches, Parser, Subcommand, ValueEnum};
use clap_complete::Shell;
use fleetyard_abi::{Kind, Motion};
use fleetyard_check::PathRule;
use fleetyard_core::Connectivity;
use fleetyard_core::PathEncoding;
use fleetyard_core::formats::Format as FileFormat;
use fleetyard_fleet::{Assign, Clock, CutBy};
use fleetyard_runtime::{Attach, Level};
use fleetyard_sim::noise::{Delay, Disturbance, Messages, VelocityNoise};
use fleetyard_sim::{Policy, SimError, Tier};

use crate::commands::bench::Bench;
use crate::commands::jobs::Jobs;
use crate::commands::report::ReportArgs;
use crate::commands::store::Stores;
use crate::exit;

/// Runs, executes and judges multi-robot planners.
#[derive(Debug, Parser)]
#[command(name = "fleetyard", version, about, after_help = exit::HELP, propagate_version = true)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Run a planner on an instance under a budget and judge its plan
    Run(Run),
    /// Run several planners on the same instances and show who did better
    Compare(Compare),
    /// Run a fleet that never ends: robots drive, reach goals and get new ones, while a planner
    /// plans their next ways
    Fleet(Box<Fleet>),
    /// Run a suite: every planner on every instance
    Bench(Bench),
    /// Look at the stores of suites, join them, write them in other formats
    #[command(subcommand)]
    Store(Stores),
    /// Show what the trials of a suite say: who is best, by how much, and how sure that is
    Report(ReportArgs),
    /// Say whether a plan is valid, and what it costs
    Validate(Validate),
    /// Execute a plan in the simulator
    Simulate(Simulate),
    /// Convert an instance or a plan from one format to another
    Convert(Convert),
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
    /// Say what this machine grants to this user, and what to do about what it does not
    Doctor {
        /// Say instead which promises about plugins hold on this machine, and what would
        /// restore the others; the exit code is 1 when one is broken
        #[arg(long)]
        security: bool,
        /// The level that is needed; the exit code is 1 when it cannot be had
        #[arg(long, value_enum, default_value = "auto", value_name = "LEVEL")]
        sandbox: LevelArg,
        /// How to print the result
        #[arg(long, value_enum, default_value = "text")]
        format: Format,
    },
    /// Print a completion script for a shell
    Completions {
        /// The shell
        shell: Shell,
    },
}

/// How results are printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Format {
    /// For people
    Text,
    /// For programs: one JSON document on standard output
    Json,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum AttachArg {
    /// A library in the host's own process: no isolation, results are unranked
    InProcess,
    /// A library in a process of its own
    Worker,
    /// A program that speaks JSON over standard input and output
    Stdio,
    /// A command-line solver that a planner.toml describes
    Command,
}

impl From<AttachArg> for Attach {
    fn from(attach: AttachArg) -> Self {
        match attach {
            AttachArg::InProcess => Self::InProcess,
            AttachArg::Worker => Self::Worker,
            AttachArg::Stdio => Self::Stdio,
            AttachArg::Command => Self::Command,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum PathRuleArg {
    /// Unit moves in unit time, for any number of agents
    Steps,
    /// Straight lines whose Bresenham cells are free, for one agent
    Bresenham,
    /// Straight lines that touch free cells alone, for one agent
    Supercover,
}

impl From<PathRuleArg> for PathRule {
    fn from(rule: PathRuleArg) -> Self {
        match rule {
            PathRuleArg::Steps => Self::Steps,
            PathRuleArg::Bresenham => Self::Bresenham,
            PathRuleArg::Supercover => Self::Supercover,
        }
    }
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum TierArg {
    /// Own engine: exact swept tests, scales to large fleets
    Kinematic,
    /// rapier2d
    Contact,
}

impl From<TierArg> for Tier {
    fn from(tier: TierArg) -> Self {
        match tier {
            TierArg::Kinematic => Self::Kinematic,
            TierArg::Contact => Self::Contact,
        }
    }
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum EncodingArg {
    /// `[[row, col], …]`
    Pairs,
    /// Cell indices, `row * cols + col`
    Cells,
    /// A start and a letter per move
    Moves,
}

impl From<EncodingArg> for PathEncoding {
    fn from(encoding: EncodingArg) -> Self {
        match encoding {
            EncodingArg::Pairs => Self::Pairs,
            EncodingArg::Cells => Self::Cells,
            EncodingArg::Moves => Self::Moves,
        }
    }
}

fn connectivity(text: &str) -> Result<Connectivity, String> {
    match text {
        "4" => Ok(Connectivity::Four),
        "8" => Ok(Connectivity::Eight),
        _ => Err("grids have 4 or 8 neighbours".into()),
    }
}

/// A file format by its name.
fn file_format(text: &str) -> Result<FileFormat, String> {
    FileFormat::by_name(text).ok_or_else(|| {
        let known: Vec<&str> = FileFormat::ALL.iter().map(|format| format.name()).collect();
        format!("formats are {}", known.join(", "))
    })
}

/// A file for a picture; its name says the format.
fn picture(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    let known = |end: &OsStr| end.eq_ignore_ascii_case("svg") || end.eq_ignore_ascii_case("png");
    if path.extension().is_none_or(known) {
        Ok(path)
    } else {
        Err("pictures are drawn as .svg or .png".into())
    }
}

pub(crate) fn duration(text: &str) -> Result<Duration, String> {
    let duration = humantime::parse_duration(text)
        .map_err(|_| "write a duration with its unit, such as 500ms, 10s or 2m".to_owned())?;
    // Deadlines are 64-bit nanoseconds; a year is plenty.
    if duration.is_zero() || duration > Duration::from_hours(366 * 24) {
        return Err("a budget is longer than nothing and shorter than a year".into());
    }
    Ok(duration)
}

// Headings of the help, each of them named at each of its arguments: one that is set for a whole
// structure would hold for all that follow, too.
const INSTANCE: &str = "Instance";
const PLANNER: &str = "Planner";
const BUDGET: &str = "Budget";
const EXECUTION: &str = "Execution";
const RECORDS: &str = "Results and records";
const LIMITS: &str = "Sandbox and limits";
/// For arguments that decide which code may run.
const TRUST: &str = "Trust";
const FLEET: &str = "Planning";
const GOALS: &str = "Goals";
const ROBOTS: &str = "Robots";

#[derive(Debug, Args)]
pub(crate) struct MapArgs {
    /// MovingAI map file
    #[arg(long, short, help_heading = INSTANCE, value_name = "FILE")]
    pub(crate) map: PathBuf,
    /// Neighbours of a cell: 4 or 8
    #[arg(long, help_heading = INSTANCE, value_name = "N", default_value = "4", value_parser = connectivity)]
    pub(crate) connectivity: Connectivity,
}

#[derive(Debug, Args)]
pub(crate) struct InstanceArgs {
    #[command(flatten)]
    pub(crate) map: MapArgs,
    /// MovingAI scenario file
    #[arg(long, short, help_heading = INSTANCE, value_name = "FILE")]
    pub(crate) scen: PathBuf,
    /// How many of the scenario's entries to use, from the first
    #[arg(long, short = 'n', help_heading = INSTANCE, value_name = "N")]
    pub(crate) agents: usize,
}

#[derive(Debug, Args)]
pub(crate) struct BudgetArgs {
    /// Wall-clock budget of a plan
    #[arg(long, short, help_heading = BUDGET, value_name = "DURATION", default_value = "10s", value_parser = duration)]
    pub(crate) budget: Duration,
    /// Wall-clock budget for learning the map [default: the plan's]
    #[arg(long, help_heading = BUDGET, value_name = "DURATION", value_parser = duration)]
    pub(crate) prepare_budget: Option<Duration>,
    /// How long a planner may take to start and be made
    #[arg(long, help_heading = BUDGET, value_name = "DURATION", default_value = "1m", value_parser = duration)]
    pub(crate) startup: Duration,
    /// How long a planner may go on after the deadline once it was told to stop;
    /// plans that come meanwhile do not count
    #[arg(long, help_heading = BUDGET, value_name = "DURATION", value_parser = duration)]
    pub(crate) grace: Option<Duration>,
    /// Most search nodes, for planners that count them [default: no limit]
    #[arg(long, help_heading = BUDGET, value_name = "N", default_value_t = 0, hide_default_value = true)]
    pub(crate) nodes: u64,
    /// Most threads a planner may use
    #[arg(long, help_heading = BUDGET, value_name = "N", default_value_t = 1,
          value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub(crate) threads: u32,
    /// Seed of every random choice
    #[arg(long, help_heading = BUDGET, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
    #[command(flatten)]
    pub(crate) sandbox: SandboxArgs,
}

/// A number of bytes with its unit.
pub(crate) fn size(text: &str) -> Result<u64, String> {
    let size: ByteSize = text
        .parse()
        .map_err(|_| "write a size with its unit, such as 512MiB or 4GiB".to_owned())?;
    if size.as_u64() < 1 << 12 {
        return Err("a limit is at least 4KiB".into());
    }
    Ok(size.as_u64())
}

/// A variable with its value, or the value that the host has.
fn variable(text: &str) -> Result<(String, String), String> {
    let (name, value) = match text.split_once('=') {
        Some((name, value)) => (name, value.to_owned()),
        None => match std::env::var(text) {
            Ok(value) => (text, value),
            Err(_) => return Err(format!("`{text}` is not set; write NAME=VALUE to set it")),
        },
    };
    if name.is_empty() || text.contains('\0') {
        return Err("write NAME or NAME=VALUE".into());
    }
    Ok((name.to_owned(), value))
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum LevelArg {
    /// Refuse to run unless every required layer is active and the limit of memory enforced
    Strict,
    /// As many layers as the machine grants; each loss is in the record
    Auto,
    /// No layer; results are unranked
    None,
}

impl From<LevelArg> for Level {
    fn from(level: LevelArg) -> Self {
        match level {
            LevelArg::Strict => Self::Strict,
            LevelArg::Auto => Self::Auto,
            LevelArg::None => Self::None,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum PinArg {
    /// A physical core for each thread of the budget and one left for the host,
    /// where the machine has so many that nobody else has reserved
    Auto,
    /// Let the kernel move the planner
    Off,
}

/// What a plugin may use and see.
#[derive(Debug, Args)]
pub(crate) struct SandboxArgs {
    #[command(flatten)]
    pub(crate) grants: GrantArgs,
    /// Processor time of a plan, over all processes and threads [default: no limit]
    #[arg(long, help_heading = LIMITS, value_name = "DURATION", value_parser = duration)]
    pub(crate) cpu: Option<Duration>,
    /// Processor time for learning the map [default: the plan's]
    #[arg(long, help_heading = LIMITS, value_name = "DURATION", value_parser = duration)]
    pub(crate) prepare_cpu: Option<Duration>,
    /// Memory of all processes together [default: half of the machine's]
    #[arg(long, help_heading = LIMITS, value_name = "SIZE", value_parser = size)]
    pub(crate) memory: Option<u64>,
    /// Memory for learning the map [default: the plan's]
    #[arg(long, help_heading = LIMITS, value_name = "SIZE", value_parser = size)]
    pub(crate) prepare_memory: Option<u64>,
    /// Whether the planner has processor cores of its own
    #[arg(long, help_heading = LIMITS, value_enum, default_value = "auto", value_name = "HOW")]
    pub(crate) pin: PinArg,
}

/// Whose code may run.
#[derive(Debug, Args)]
pub(crate) struct TrustArgs {
    /// The lock file with the digests of pinned plugins [default: fleetyard.lock in the
    /// current folder, if it is there]
    #[arg(long, help_heading = TRUST, value_name = "FILE", env = "FLEETYARD_LOCK", hide_env_values = true)]
    pub(crate) lock: Option<PathBuf>,
    /// Refuse plugins that are not in the lock file
    #[arg(long, help_heading = TRUST)]
    pub(crate) locked: bool,
}

/// What a plugin may use and see in every call, whoever makes it.
#[derive(Debug, Args)]
pub(crate) struct GrantArgs {
    #[command(flatten)]
    pub(crate) trust: TrustArgs,
    /// How much of the sandbox is required
    #[arg(long, help_heading = LIMITS, value_enum, default_value = "auto", value_name = "LEVEL")]
    pub(crate) sandbox: LevelArg,
    /// Most processes and threads
    #[arg(long, help_heading = LIMITS, value_name = "N", default_value_t = 256,
          value_parser = clap::value_parser!(u32).range(2..=100_000))]
    pub(crate) processes: u32,
    /// Most output that is no message: standard error, stray lines
    #[arg(long, help_heading = LIMITS, value_name = "SIZE", default_value = "64MiB", value_parser = size)]
    pub(crate) output_limit: u64,
    /// Size of the scratch folder, which is empty at the start of every run
    #[arg(long, help_heading = LIMITS, value_name = "SIZE", default_value = "256MiB", value_parser = size)]
    pub(crate) disk: u64,
    /// Let the plugin read a file or folder; may be given several times
    #[arg(long, help_heading = LIMITS, value_name = "PATH")]
    pub(crate) allow_read: Vec<PathBuf>,
    /// Let the plugin use the network
    #[arg(long, help_heading = LIMITS)]
    pub(crate) allow_network: bool,
    /// Set an environment variable for the plugin, or pass the host's on; may be given
    /// several times. Variables that begin with FLEETYARD_ are passed on anyway
    #[arg(long, help_heading = LIMITS, value_name = "NAME[=VALUE]", value_parser = variable)]
    pub(crate) env: Vec<(String, String)>,
}

#[derive(Debug, Args)]
pub(crate) struct WorldArgs {
    /// Side of a cell in metres
    #[arg(long, help_heading = EXECUTION, value_name = "METRES", default_value_t = 1.0)]
    pub(crate) cell_size: f64,
    /// Duration of one step of a plan in seconds
    #[arg(long, help_heading = EXECUTION, value_name = "SECONDS", default_value_t = 1.0)]
    pub(crate) step: f64,
    /// Radius of an agent in metres [default: 0.35 cells; of robots with a model the
    /// preset's footprint, or 0.3 cells]
    #[arg(long, help_heading = EXECUTION, value_name = "METRES")]
    pub(crate) radius: Option<f64>,
    /// Simulator ticks per second
    #[arg(long, help_heading = EXECUTION, value_name = "N", default_value_t = 60)]
    pub(crate) ticks_hz: u32,
    /// Substeps per tick
    #[arg(long, help_heading = EXECUTION, value_name = "N", default_value_t = 4)]
    pub(crate) substeps: u32,
    /// How bodies move and contacts are found
    #[arg(long, help_heading = EXECUTION, value_enum, default_value = "kinematic")]
    pub(crate) tier: TierArg,
}

/// Run a planner on an instance under a budget and judge its plan.
#[derive(Debug, Args)]
pub(crate) struct Run {
    #[command(flatten)]
    pub(crate) instance: InstanceArgs,
    /// A plugin's identifier, or the path of a library, a program or their folder; PATH:ID
    /// picks one of several. Its options may follow
    #[arg(long, short, help_heading = PLANNER, value_names = ["PLUGIN", "NAME=VALUE"], num_args = 1.., required = true,
          action = ArgAction::Set)]
    pub(crate) planner: Vec<String>,
    /// An option of the planner; may be given several times
    #[arg(long = "option", help_heading = PLANNER, value_name = "NAME=VALUE")]
    pub(crate) options: Vec<String>,
    /// What may lie between two cells of a path
    #[arg(long, help_heading = INSTANCE, value_enum, default_value = "steps")]
    pub(crate) path_rule: PathRuleArg,
    #[command(flatten)]
    pub(crate) budget: BudgetArgs,
    /// How the plugin is attached [default: worker for libraries, stdio for
    /// programs, command for a planner.toml]
    #[arg(long, help_heading = PLANNER, value_enum)]
    pub(crate) attach: Option<AttachArg>,
    /// Execute the plan in the simulator
    #[arg(long, help_heading = EXECUTION)]
    pub(crate) execute: bool,
    #[command(flatten)]
    pub(crate) world: WorldArgs,
    /// Write the plan to a file
    #[arg(long, help_heading = RECORDS, value_name = "FILE")]
    pub(crate) plan_out: Option<PathBuf>,
    /// How paths are written in the plan file
    #[arg(long, help_heading = RECORDS, value_enum, default_value = "pairs")]
    pub(crate) plan_encoding: EncodingArg,
    /// Write the execution's trace to a file (implies --execute)
    #[arg(long, help_heading = RECORDS, value_name = "FILE")]
    pub(crate) trace_out: Option<PathBuf>,
    /// Draw map, paths, starts and goals to a file, SVG or PNG by its name
    #[arg(long, help_heading = RECORDS, value_name = "FILE", value_parser = picture)]
    pub(crate) picture: Option<PathBuf>,
    /// Show what the planner wrote to its log and to standard error
    #[arg(long, short)]
    pub(crate) verbose: bool,
    /// How to print the result
    #[arg(long, value_enum, default_value = "text")]
    pub(crate) format: Format,
}

/// A duration in seconds, which may be nothing.
fn seconds(text: &str) -> Result<f64, String> {
    let duration = humantime::parse_duration(text)
        .map_err(|_| "write a duration with its unit, such as 500ms, 10s or 10m".to_owned())?;
    Ok(duration.as_secs_f64())
}

fn positive_seconds(text: &str) -> Result<f64, String> {
    match seconds(text)? {
        0.0 => Err("this has to be longer than nothing".to_owned()),
        seconds => Ok(seconds),
    }
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum MotionArg {
    /// A step takes a robot to an adjacent cell, whatever its heading
    Pebble,
    /// Turning by 90° takes a step too
    Rotation,
}

impl From<MotionArg> for Motion {
    fn from(motion: MotionArg) -> Self {
        match motion {
            MotionArg::Pebble => Self::Pebble,
            MotionArg::Rotation => Self::Rotation,
        }
    }
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum ClockArg {
    /// Just the limit after the call, in simulated time: runs are the same everywhere
    Lockstep,
    /// When it is there, while simulated time follows the wall clock
    Realtime,
}

/// How far robots are committed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum CutArg {
    /// To what they can begin before the answer takes effect: those that turn or wait to
    /// less than those that drive
    Time,
    /// To the same number of actions each
    Actions,
}

impl From<CutArg> for CutBy {
    fn from(cut: CutArg) -> Self {
        match cut {
            CutArg::Time => Self::Time,
            CutArg::Actions => Self::Actions,
        }
    }
}

impl From<ClockArg> for Clock {
    fn from(clock: ClockArg) -> Self {
        match clock {
            ClockArg::Lockstep => Self::Lockstep,
            ClockArg::Realtime => Self::Realtime,
        }
    }
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum AssignArg {
    /// Tasks if a file names some, roles if the map has them, random cells else
    Auto,
    /// Free cells at random
    Random,
    /// Workstations and endpoints of the map in turn
    Roles,
    /// The tasks of --tasks
    Tasks,
}

impl From<AssignArg> for Assign {
    fn from(assign: AssignArg) -> Self {
        match assign {
            AssignArg::Auto => Self::Auto,
            AssignArg::Random => Self::Random,
            AssignArg::Roles => Self::Roles,
            AssignArg::Tasks => Self::Tasks,
        }
    }
}

/// Run a fleet that never ends: robots drive, reach goals and get new ones, while a planner
/// plans their next ways.
///
/// The invocation policy says when to plan, the instance generator what, the fail policy what
/// to do where the planner has no plan that may be driven. docs/fleet.md says what happens
/// when.
#[derive(Debug, Args)]
pub(crate) struct Fleet {
    /// MovingAI or LSMART map [with --replay and --resume: the one that was recorded]
    #[arg(long, short, value_name = "FILE", required_unless_present_any = ["replay", "resume"])]
    pub(crate) map: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) asked: FleetAsked,
    /// Write what plugins answer to a file, from which the run can be had again
    #[arg(long, help_heading = RECORDS, value_name = "FILE", conflicts_with_all = ["replay", "resume"])]
    pub(crate) record: Option<PathBuf>,
    /// Run again what was recorded, without any plugin
    #[arg(long, help_heading = RECORDS, value_name = "FILE", conflicts_with = "resume")]
    pub(crate) replay: Option<PathBuf>,
    /// Go on with a run whose host was killed or interrupted, and with its recording
    #[arg(long, help_heading = RECORDS, value_name = "FILE")]
    pub(crate) resume: Option<PathBuf>,
    /// Write the trace to a file
    #[arg(long, help_heading = RECORDS, value_name = "FILE")]
    pub(crate) trace: Option<PathBuf>,
    /// Ticks between the states in the trace; 0 records events only
    #[arg(long, help_heading = RECORDS, value_name = "N", default_value_t = 1, requires = "trace")]
    pub(crate) trace_every: u32,
    /// Draw throughput over time, and where robots waited, to a file, SVG or PNG by its name
    #[arg(long, help_heading = RECORDS, value_name = "FILE", value_parser = picture)]
    pub(crate) picture: Option<PathBuf>,
    /// Show what plugins wrote to their logs and to standard error
    #[arg(long, short)]
    pub(crate) verbose: bool,
    /// How to print the result
    #[arg(long, value_enum, default_value = "text")]
    pub(crate) format: Format,
    /// Threads of the simulator; results do not depend on it [default: a processor each, but for
    /// those of the planner]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,
    /// How long a plugin may take to start and be made
    #[arg(long, help_heading = LIMITS, value_name = "DURATION", default_value = "1m", value_parser = duration)]
    pub(crate) startup: Duration,
    #[command(flatten)]
    pub(crate) grants: GrantArgs,
}

/// What decides about a run; a recording has it all.
#[derive(Debug, Args)]
pub(crate) struct FleetAsked {
    /// Number of robots
    #[arg(long, short = 'n', value_name = "N", required_unless_present_any = ["replay", "resume"],
          value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub(crate) agents: Option<u32>,
    /// How long to go on, in simulated time
    #[arg(long, value_name = "DURATION", default_value = "10m", value_parser = positive_seconds)]
    pub(crate) duration: f64,
    /// Seed of every random choice: starts, goals, plugins, disturbances
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
    /// The planner: a plugin's identifier, or the path of a library, a program or their folder;
    /// PATH:ID picks one of several. Its options may follow
    #[arg(long, short, help_heading = FLEET, value_names = ["PLUGIN", "NAME=VALUE"], num_args = 1..,
          action = ArgAction::Set, required_unless_present_any = ["replay", "resume"])]
    pub(crate) planner: Vec<String>,
    /// The instance generator: who is sent where
    #[arg(long, help_heading = FLEET, value_names = ["PLUGIN", "NAME=VALUE"], num_args = 1..,
          action = ArgAction::Set, default_value = "windowed-multi-goals")]
    pub(crate) generator: Vec<String>,
    /// The invocation policy: when to plan
    #[arg(long, help_heading = FLEET, value_names = ["PLUGIN", "NAME=VALUE"], num_args = 1..,
          action = ArgAction::Set, default_value = "periodic")]
    pub(crate) invocation: Vec<String>,
    /// The fail policy: what to do without a plan
    #[arg(long, help_heading = FLEET, value_names = ["PLUGIN", "NAME=VALUE"], num_args = 1..,
          action = ArgAction::Set, default_value = "pibt")]
    pub(crate) fail_policy: Vec<String>,
    /// Time between two calls, for an invocation policy with the option `period_s`
    /// [default: the policy's]
    #[arg(long, help_heading = FLEET, value_name = "DURATION", value_parser = positive_seconds)]
    pub(crate) period: Option<f64>,
    /// How far ahead plans are free of collisions; 0s for plans to the end
    #[arg(long, help_heading = FLEET, value_name = "DURATION", default_value = "10s",
          value_parser = seconds)]
    pub(crate) window: f64,
    /// How long the planner may take
    #[arg(long, help_heading = FLEET, value_name = "DURATION", default_value = "1s",
          value_parser = positive_seconds)]
    pub(crate) limit: f64,
    /// How planners see robots move; robots turn in any case
    #[arg(long, help_heading = FLEET, value_enum, default_value = "pebble")]
    pub(crate) motion: MotionArg,
    /// When an answer takes effect
    #[arg(long, help_heading = FLEET, value_enum, default_value = "lockstep")]
    pub(crate) clock: ClockArg,

    /// How far robots are committed when the planner is called
    #[arg(long, value_name = "CUT", default_value = "time")]
    pub(crate) cut: CutArg,
    /// An option of the planner; may be given several times
    #[arg(long = "option", help_heading = FLEET, value_name = "NAME=VALUE")]
    pub(crate) options: Vec<String>,
    /// An option of the instance generator
    #[arg(long = "generator-option", help_heading = FLEET, value_name = "NAME=VALUE")]
    pub(crate) generator_options: Vec<String>,
    /// An option of the invocation policy
    #[arg(long = "invocation-option", help_heading = FLEET, value_name = "NAME=VALUE")]
    pub(crate) invocation_options: Vec<String>,
    /// An option of the fail policy
    #[arg(long = "fail-option", help_heading = FLEET, value_name = "NAME=VALUE")]
    pub(crate) fail_options: Vec<String>,
    /// How libraries are attached, the built-in one among them: in the host's own process or in
    /// processes of their own
    #[arg(long, help_heading = FLEET, value_name = "HOW", value_enum, default_value = "worker")]
    pub(crate) attach: LibraryAttachArg,
    /// The host calls by itself when nobody had anything to do for so long
    #[arg(long, help_heading = FLEET, value_name = "DURATION", default_value = "10s",
          value_parser = positive_seconds)]
    pub(crate) watchdog: f64,
    /// Where goals come from
    #[arg(long, help_heading = GOALS, value_enum, default_value = "auto")]
    pub(crate) assign: AssignArg,
    /// Tasks, in the format of the League of Robot Runners
    #[arg(long, help_heading = GOALS, value_name = "FILE")]
    pub(crate) tasks: Option<PathBuf>,
    /// How many tasks are known at a time, per robot
    #[arg(long, help_heading = GOALS, value_name = "RATIO", default_value_t = 1.5)]
    pub(crate) reveal: f64,
    /// How long a robot stays where it reached a goal
    #[arg(long, help_heading = GOALS, value_name = "DURATION", default_value = "0s",
          value_parser = seconds)]
    pub(crate) dwell: f64,
    /// Motion model or preset of all robots, such as agv or lsmart-effective; pebble for discs
    /// that move by one cell per step. docs/execution.md lists them
    #[arg(long, help_heading = ROBOTS, value_name = "NAME", default_value = "agv",
          conflicts_with = "fleet")]
    pub(crate) model: String,
    /// Footprints, models and limits of all robots, a fleetyard.fleet/1 file
    #[arg(long, help_heading = ROBOTS, value_name = "FILE", conflicts_with = "radius")]
    pub(crate) fleet: Option<PathBuf>,
    /// Radius of a robot in metres [default: the preset's footprint, or 0.3 cells]
    #[arg(long, help_heading = ROBOTS, value_name = "METRES")]
    pub(crate) radius: Option<f64>,
    /// Most actions that a robot has been sent and has not done
    #[arg(long, help_heading = ROBOTS, value_name = "N", default_value_t = 5)]
    pub(crate) queue: u32,
    #[command(flatten)]
    pub(crate) disturbance: DisturbanceArgs,
    /// Side of a cell in metres
    #[arg(long, help_heading = ROBOTS, value_name = "METRES", default_value_t = 1.0)]
    pub(crate) cell_size: f64,
    /// Duration of one step of a plan in seconds, the least time of an action [default: a cell's
    /// side at the top speed of the slowest robot, or 1]
    #[arg(long, help_heading = ROBOTS, value_name = "SECONDS")]
    pub(crate) step: Option<f64>,
    /// Simulator ticks per second
    #[arg(long, help_heading = ROBOTS, value_name = "N", default_value_t = 60)]
    pub(crate) ticks_hz: u32,
    /// Substeps per tick
    #[arg(long, help_heading = ROBOTS, value_name = "N", default_value_t = 4)]
    pub(crate) substeps: u32,
    /// How bodies move and contacts are found
    #[arg(long, help_heading = ROBOTS, value_enum, default_value = "kinematic")]
    pub(crate) tier: TierArg,
    /// Wall-clock time of a plugin for learning the map
    #[arg(long, help_heading = LIMITS, value_name = "DURATION", default_value = "1m",
          value_parser = positive_seconds)]
    pub(crate) prepare_budget: f64,
    /// Wall-clock time of a call of any plugin but the planner
    #[arg(long, help_heading = LIMITS, value_name = "DURATION", default_value = "10s",
          value_parser = positive_seconds)]
    pub(crate) call_budget: f64,
    /// Most threads a plugin may use
    #[arg(long, help_heading = LIMITS, value_name = "N", default_value_t = 1,
          value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub(crate) plugin_threads: u32,
    /// Most search nodes, for planners that count them [default: no limit]
    #[arg(long, help_heading = LIMITS, value_name = "N", default_value_t = 0,
          hide_default_value = true)]
    pub(crate) nodes: u64,
    /// Memory of all processes of a plugin together [default: half of the machine's]
    #[arg(long, help_heading = LIMITS, value_name = "SIZE", value_parser = size)]
    pub(crate) memory: Option<u64>,
}

impl FleetAsked {
    /// The first of these arguments that is on the command line: a recording says all of
    /// it, and would contradict.
    pub(crate) fn given(matches: &ArgMatches) -> Option<String> {
        let all = Self::augment_args(clap::Command::new("fleet"));
        let given = |argument: &&Arg| {
            matches.value_source(argument.get_id().as_str()) == Some(ValueSource::CommandLine)
        };
        let first = all.get_arguments().find(given)?;
        first.get_long().map(|long| format!("--{long}"))
    }
}

/// How a library is attached.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum LibraryAttachArg {
    /// In the host's own process: no isolation
    InProcess,
    /// In a process of its own
    Worker,
}

/// Run several planners on the same instances and show who did better.
#[derive(Debug, Args)]
pub(crate) struct Compare {
    /// MovingAI scenario files, of one map or of several
    #[arg(long, short, help_heading = INSTANCE, value_name = "FILE", required = true, num_args = 1..)]
    pub(crate) scen: Vec<PathBuf>,
    /// Where the maps are that the scenarios name: map files, or folders with NAME.map
    /// [default: the folder of each scenario]
    #[arg(long, short, help_heading = INSTANCE, value_name = "PATH", num_args = 1..)]
    pub(crate) map: Vec<PathBuf>,
    /// Neighbours of a cell: 4 or 8
    #[arg(long, help_heading = INSTANCE, value_name = "N", default_value = "4", value_parser = connectivity)]
    pub(crate) connectivity: Connectivity,
    /// Team sizes
    #[arg(long, short = 'n', help_heading = INSTANCE, value_name = "N,…", required = true, value_delimiter = ',')]
    pub(crate) agents: Vec<usize>,
    /// What may lie between two cells of a path
    #[arg(long, help_heading = INSTANCE, value_enum, default_value = "steps")]
    pub(crate) path_rule: PathRuleArg,
    #[command(flatten)]
    pub(crate) planners: PlannerArgs,
    #[command(flatten)]
    pub(crate) budget: BudgetArgs,
    #[command(flatten)]
    pub(crate) world: WorldArgs,
    /// Do not execute the plans: no real-time factor, no contacts
    #[arg(long, help_heading = EXECUTION)]
    pub(crate) no_execute: bool,
    /// How to print the result
    #[arg(long, value_enum, default_value = "text")]
    pub(crate) format: Format,
}

/// A plugin that is asked for, and its options.
#[derive(Debug, Clone)]
pub(crate) struct PluginArg {
    pub(crate) plugin: String,
    /// `NAME=VALUE` each.
    pub(crate) options: Vec<String>,
}

/// Every `--planner PLUGIN [NAME=VALUE]…`, in order. The parser's derive keeps no
/// occurrences apart.
#[derive(Debug)]
pub(crate) struct PlannerArgs(pub(crate) Vec<PluginArg>);

impl PlannerArgs {
    const ID: &str = "planner";
}

impl PluginArg {
    /// The words after `--planner` or its like, and options that were given otherwise.
    pub(crate) fn new(words: &[String], options: &[String]) -> Result<Self, exit::Failure> {
        let (plugin, own) = words
            .split_first()
            .map_or(("", words), |(first, own)| (&**first, own));
        if let Some(wrong) = own.iter().find(|option| !option.contains('=')) {
            let message = format!("`{wrong}` after the plugin `{plugin}` is no option NAME=VALUE");
            let hint = "`fleetyard compare` runs several, and every planner has a --planner of its \
                        own";
            return Err(exit::Failure::new(exit::Exit::Usage, message).hint(hint));
        }
        Ok(Self {
            plugin: plugin.to_owned(),
            options: own.iter().chain(options).cloned().collect(),
        })
    }
}

impl FromArgMatches for PlannerArgs {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let given = matches.get_occurrences::<String>(Self::ID);
        let mut planners = Vec::new();
        for words in given.into_iter().flatten() {
            let words: Vec<String> = words.cloned().collect();
            let planner = PluginArg::new(&words, &[]).map_err(|failure| {
                let hint = failure.hint.unwrap_or_default();
                let message = format!("{}\n\n  tip: {hint}\n", failure.message);
                clap::Error::raw(ErrorKind::ValueValidation, message)
            })?;
            planners.push(planner);
        }
        Ok(Self(planners))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

impl Args for PlannerArgs {
    fn augment_args(command: clap::Command) -> clap::Command {
        command.arg(
            Arg::new(Self::ID)
                .long(Self::ID)
                .short('p')
                .help_heading(PLANNER)
                .value_names(["PLUGIN", "NAME=VALUE"])
                .num_args(1..)
                .action(ArgAction::Append)
                .required(true)
                .help(
                    "A planner, by identifier or path, and its options; may be given several times",
                ),
        )
    }

    fn augment_args_for_update(command: clap::Command) -> clap::Command {
        Self::augment_args(command)
    }
}

/// Say whether a plan is valid, and what it costs.
///
/// A plan on a grid is judged by the rules of its instance. With --radius or --fleet a plan
/// is judged in the plane, where footprints must not overlap at any time.
#[derive(Debug, Args)]
pub(crate) struct Validate {
    /// MovingAI map file
    #[arg(long, value_name = "FILE", required_unless_present = "world")]
    pub(crate) map: Option<PathBuf>,
    /// Neighbours of a cell: 4 or 8
    #[arg(long, value_name = "N", default_value = "4", value_parser = connectivity)]
    pub(crate) connectivity: Connectivity,
    /// MovingAI scenario file, with starts and goals
    #[arg(
        long,
        value_name = "FILE",
        requires = "map",
        required_unless_present = "robots"
    )]
    pub(crate) scen: Option<PathBuf>,
    /// How many of the scenario's entries to use, from the first
    #[arg(
        long,
        value_name = "N",
        requires = "scen",
        required_unless_present = "robots"
    )]
    pub(crate) agents: Option<usize>,
    /// What may lie between two cells of a path
    #[arg(long, value_enum, default_value = "steps")]
    pub(crate) path_rule: PathRuleArg,
    /// World file with bounds and obstacles in the plane
    #[arg(long, value_name = "FILE", requires = "robots")]
    pub(crate) world: Option<PathBuf>,
    /// Robots are discs of this radius in metres
    #[arg(long, value_name = "METRES", group = "robots")]
    pub(crate) radius: Option<f64>,
    /// Fleet file with the robots' footprints and limits
    #[arg(long, value_name = "FILE", group = "robots")]
    pub(crate) fleet: Option<PathBuf>,
    /// Side of a cell in metres
    #[arg(long, value_name = "METRES", default_value_t = 1.0)]
    pub(crate) cell_size: f64,
    /// Duration of one step in seconds, for a plan on a grid that is judged in the plane
    #[arg(long, value_name = "SECONDS", default_value_t = 1.0)]
    pub(crate) step: f64,
    /// The plan, in any format that `fleetyard convert --list` lists
    pub(crate) plan: PathBuf,
    /// List all violations, not only the first of them
    #[arg(long)]
    pub(crate) all: bool,
    /// The format of the plan [default: what the file looks like]
    #[arg(long, value_name = "FORMAT", value_parser = file_format)]
    pub(crate) from: Option<FileFormat>,
    /// How to print the result
    #[arg(long, value_enum, default_value = "text")]
    pub(crate) format: Format,
}

/// Convert an instance or a plan from one format to another.
///
/// Formats are guessed from content and name. What FROM lacks and TO needs is given
/// with options: a file of paths has no map, a schedule has no goals.
#[derive(Debug, Args)]
pub(crate) struct Convert {
    /// The file to read, - for standard input
    #[arg(
        value_name = "FROM",
        required_unless_present = "list",
        requires = "output"
    )]
    pub(crate) input: Option<PathBuf>,
    /// The file to write, - for standard output
    #[arg(value_name = "TO")]
    pub(crate) output: Option<PathBuf>,
    /// List the formats and what each carries
    #[arg(long, conflicts_with = "input")]
    pub(crate) list: bool,
    /// The format of FROM [default: what the file looks like]
    #[arg(long, value_name = "FORMAT", value_parser = file_format)]
    pub(crate) from: Option<FileFormat>,
    /// The format of TO [default: what its name says]
    #[arg(long, value_name = "FORMAT", value_parser = file_format)]
    pub(crate) to: Option<FileFormat>,
    /// The map, where FROM has none
    #[arg(long, value_name = "FILE")]
    pub(crate) map: Option<PathBuf>,
    /// Starts and goals, where FROM has none: a scenario, or another instance
    #[arg(long, value_name = "FILE")]
    pub(crate) scen: Option<PathBuf>,
    /// How many agents to use, from the first [default: those of the plan, or all]
    #[arg(long, value_name = "N")]
    pub(crate) agents: Option<usize>,
    /// Neighbours of a cell: 4 or 8
    #[arg(long, value_name = "N", default_value = "4", value_parser = connectivity)]
    pub(crate) connectivity: Connectivity,
    /// How paths are written in a plan file [default: pairs]
    #[arg(long, value_enum)]
    pub(crate) plan_encoding: Option<EncodingArg>,
    /// Side of a cell in metres, where a plan on a grid becomes trajectories
    #[arg(long, value_name = "METRES", default_value_t = 1.0)]
    pub(crate) cell_size: f64,
    /// Duration of one step in seconds, where a plan on a grid becomes trajectories
    #[arg(long, value_name = "SECONDS", default_value_t = 1.0)]
    pub(crate) step: f64,
}

/// Execute a plan in the simulator.
#[derive(Debug, Args)]
pub(crate) struct Simulate {
    /// MovingAI map file; plans on grids need one
    #[arg(long, value_name = "FILE")]
    pub(crate) map: Option<PathBuf>,
    /// Workspace with obstacles in continuous space, a fleetyard.world/1 file
    #[arg(long = "world", value_name = "FILE")]
    pub(crate) workspace: Option<PathBuf>,
    /// The plan, in any format that `fleetyard convert --list` lists
    pub(crate) plan: PathBuf,
    /// The format of the plan [default: what the file looks like]
    #[arg(long, value_name = "FORMAT", value_parser = file_format)]
    pub(crate) from: Option<FileFormat>,
    /// How a path on a grid is meant: in unit moves, or (bresenham, supercover) as a list
    /// of cells between which the robot goes in straight lines, a cell a step
    #[arg(long, value_enum, default_value = "steps")]
    pub(crate) path_rule: PathRuleArg,
    #[command(flatten)]
    pub(crate) world: WorldArgs,
    #[command(flatten)]
    pub(crate) robots: RobotArgs,
    #[command(flatten)]
    pub(crate) conduct: ConductArgs,
    /// Threads that do the work; results do not depend on it [default: one per processor]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,
    /// Write the trace to a file
    #[arg(long, value_name = "FILE", alias = "trace-out")]
    pub(crate) trace: Option<PathBuf>,
    /// Ticks between the states in the trace; 0 records events only
    #[arg(long, value_name = "N", default_value_t = 1, requires = "trace")]
    pub(crate) trace_every: u32,
    /// Write contacts and arrivals to a file, one JSON object a line
    #[arg(long, value_name = "FILE")]
    pub(crate) events: Option<PathBuf>,
    /// Draw map, paths, starts and goals to a file, SVG or PNG by its name
    #[arg(long, value_name = "FILE", value_parser = picture)]
    pub(crate) picture: Option<PathBuf>,
    /// End with exit code 4 when one of these happened; several are separated by commas
    #[arg(long, value_enum, value_name = "WHAT", value_delimiter = ',')]
    pub(crate) fail_on: Vec<Mishap>,
    /// How to print the result
    #[arg(long, value_enum, default_value = "text")]
    pub(crate) format: Format,
}

/// Something in an execution that its user may not want.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Mishap {
    /// Somebody touched somebody or something
    Contacts,
    /// Two agents touched
    AgentContacts,
    /// An agent touched an obstacle, one that stands or one that moves
    ObstacleContacts,
    /// An agent did not arrive
    Unfinished,
}

/// What is on the move.
#[derive(Debug, Args)]
pub(crate) struct RobotArgs {
    /// Motion model or preset of all robots, such as pebble, agv, holonomic or go2;
    /// docs/execution.md lists them [default: pebble]
    #[arg(
        long,
        help_heading = "Robots",
        value_name = "NAME",
        conflicts_with = "fleet"
    )]
    pub(crate) model: Option<String>,
    /// Footprints, models and limits of all robots, a fleetyard.fleet/1 file
    #[arg(
        long,
        help_heading = "Robots",
        value_name = "FILE",
        conflicts_with = "radius"
    )]
    pub(crate) fleet: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum PolicyArg {
    /// When the plan says, whatever the others do
    Time,
    /// In the order of the plan: who comes second waits (an action dependency graph)
    Adg,
}

impl From<PolicyArg> for Policy {
    fn from(policy: PolicyArg) -> Self {
        match policy {
            PolicyArg::Time => Self::Time,
            PolicyArg::Adg => Self::Adg,
        }
    }
}

/// What goes wrong meanwhile.
#[derive(Debug, Args)]
pub(crate) struct DisturbanceArgs {
    /// How robots are late: none, bernoulli:P,SECONDS, uniform:MIN,MAX,
    /// gaussian:MEAN,STD or bursts:RATE,SECONDS
    #[arg(long, help_heading = EXECUTION, value_name = "DELAY", default_value = "none",
          value_parser = disturbance::<Delay>)]
    pub(crate) delay: Delay,
    /// How uneven speeds are: STD,FLOOR as parts of the speed [default: even]
    #[arg(long, help_heading = EXECUTION, value_name = "STD,FLOOR",
          value_parser = disturbance::<VelocityNoise>)]
    pub(crate) velocity_noise: Option<VelocityNoise>,
    /// How long messages take and how many are lost: MIN,MAX,LOSS [default: none and none]
    #[arg(long, help_heading = EXECUTION, value_name = "MIN,MAX,LOSS",
          value_parser = disturbance::<Messages>)]
    pub(crate) messages: Option<Messages>,
}

/// A disturbance from its text; an error says how to write it.
fn disturbance<T: FromStr<Err = SimError>>(text: &str) -> Result<T, String> {
    text.parse().map_err(|error: SimError| match error.hint() {
        Some(hint) => format!("{error}; {hint}"),
        None => error.to_string(),
    })
}

impl DisturbanceArgs {
    /// The same for the simulator.
    pub(crate) fn with_seed(&self, seed: u64) -> Disturbance {
        Disturbance {
            seed,
            delay: self.delay,
            velocity: self.velocity_noise.unwrap_or_default(),
            messages: self.messages.unwrap_or_default(),
        }
    }
}

/// How the plan is carried out, and what goes wrong meanwhile.
#[derive(Debug, Args)]
pub(crate) struct ConductArgs {
    /// When a robot may go on
    #[arg(long, help_heading = EXECUTION, value_enum, default_value = "time")]
    pub(crate) policy: PolicyArg,
    #[command(flatten)]
    pub(crate) disturbance: DisturbanceArgs,
    /// Seconds between two exchanges of messages
    #[arg(long, help_heading = EXECUTION, value_name = "SECONDS", default_value_t = 0.1)]
    pub(crate) message_period: f64,
    /// Metres that robots keep from each other's ways beyond what their controllers need
    #[arg(long, help_heading = EXECUTION, value_name = "METRES", default_value_t = 0.0)]
    pub(crate) margin: f64,
    /// Seed of all delays, noise and losses
    #[arg(long, help_heading = EXECUTION, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
    /// Go on until everybody has arrived (always so with --policy adg)
    #[arg(long, help_heading = EXECUTION)]
    pub(crate) until_done: bool,
    /// End at this simulated time at the latest
    #[arg(long, help_heading = EXECUTION, value_name = "SECONDS")]
    pub(crate) time_limit: Option<f64>,
    /// Heading of robots at the start, in degrees from east, where the plan gives none
    #[arg(long, help_heading = EXECUTION, value_name = "DEGREES", default_value_t = 90.0,
          allow_negative_numbers = true)]
    pub(crate) start_heading: f64,
    /// Execute also what begins with robots in obstacles or in each other
    #[arg(long, help_heading = EXECUTION)]
    pub(crate) allow_overlaps: bool,
}

impl ConductArgs {
    /// Whether the execution goes on until everybody has arrived.
    pub(crate) fn goes_on(&self) -> bool {
        self.until_done || matches!(self.policy, PolicyArg::Adg)
    }
}

#[derive(Debug, Subcommand)]
pub(crate) enum Trace {
    /// Say what a trace is about and whether it is whole; the exit code is 3 if not
    Info {
        /// The trace
        file: PathBuf,
        /// How to print the result
        #[arg(long, value_enum, default_value = "text")]
        format: Format,
    },
    /// Find where two traces differ first; the exit code is 1 if they do
    Diff(TraceDiff),
    /// Write states and events of a trace to other files
    Export(TraceExport),
}

/// Find where two traces differ first; the exit code is 1 if they do.
#[derive(Debug, Args)]
pub(crate) struct TraceDiff {
    /// A trace
    #[arg(value_name = "A")]
    pub(crate) a: PathBuf,
    /// Another one
    #[arg(value_name = "B")]
    pub(crate) b: PathBuf,
    /// How far apart values may be, in metres, radians and seconds
    #[arg(long, value_name = "DISTANCE", default_value_t = 0.0, value_parser = tolerance)]
    pub(crate) tolerance: f64,
    /// How to print the result
    #[arg(long, value_enum, default_value = "text")]
    pub(crate) format: Format,
}

/// Write states and events of a trace to other files.
#[derive(Debug, Args)]
#[command(group(clap::ArgGroup::new("targets").required(true).multiple(true)))]
pub(crate) struct TraceExport {
    /// The trace
    pub(crate) file: PathBuf,
    /// Write states as CSV, a line for every body at every tick
    #[arg(long, value_name = "FILE", group = "targets")]
    pub(crate) csv: Option<PathBuf>,
    /// Write events as CSV
    #[arg(long, value_name = "FILE", group = "targets")]
    pub(crate) events: Option<PathBuf>,
    /// Write goals, calls and notices of a fleet as CSV
    #[arg(long, value_name = "FILE", group = "targets")]
    pub(crate) journal: Option<PathBuf>,
    /// Write everything as one JSON document
    #[arg(long, value_name = "FILE", group = "targets")]
    pub(crate) json: Option<PathBuf>,
    /// Leave out all states but those of every n-th tick, in CSV and JSON
    #[arg(long, value_name = "N", default_value_t = 1,
          value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) every: u32,
    /// Draw all ways and contacts, or a moment (--at), as SVG
    #[arg(long, value_name = "FILE", group = "targets")]
    pub(crate) svg: Option<PathBuf>,
    /// The same as PNG
    #[arg(long, value_name = "FILE", group = "targets")]
    pub(crate) png: Option<PathBuf>,
    /// The moment to draw, in simulated seconds
    #[arg(long, value_name = "SECONDS", value_parser = moment)]
    pub(crate) at: Option<f64>,
    /// Width of a PNG in pixels
    #[arg(long, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(1..=16_384))]
    pub(crate) width: Option<u32>,
    /// Write an animated replay as one HTML page
    #[arg(long, value_name = "FILE", group = "targets")]
    pub(crate) html: Option<PathBuf>,
    /// States per simulated second on the page
    #[arg(long, value_name = "HZ", default_value_t = 10.0)]
    pub(crate) rate: f64,
    /// Agents to show on the page, such as 0,3,7-12 [default: all]
    #[arg(long, value_name = "LIST", value_parser = agent_list)]
    pub(crate) agents: Option<AgentList>,
}

/// Numbers of agents.
#[derive(Debug, Clone)]
pub(crate) struct AgentList(pub(crate) Vec<u32>);

/// Reads numbers and ranges of numbers, separated by commas.
fn agent_list(text: &str) -> Result<AgentList, String> {
    let mut agents = Vec::new();
    for part in text.split(',') {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        let number = |text: &str| text.trim().parse::<u32>();
        let (Ok(first), Ok(last)) = (number(first), number(last)) else {
            return Err("write numbers and ranges, such as 0,3,7-12".to_owned());
        };
        if first > last {
            return Err(format!("the range {part} ends before it begins"));
        }
        if agents.len() + (last - first) as usize >= 1 << 24 {
            return Err("these are more agents than a page can show".to_owned());
        }
        agents.extend(first..=last);
    }
    Ok(AgentList(agents))
}

fn moment(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "write a number".to_owned())?;
    if value.is_finite() && value >= 0.0 {
        Ok(value)
    } else {
        Err("a time is finite and not negative".to_owned())
    }
}

fn tolerance(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "write a number".to_owned())?;
    if value.is_finite() && value >= 0.0 {
        Ok(value)
    } else {
        Err("a tolerance is finite and not negative".to_owned())
    }
}

#[derive(Debug, Subcommand)]
pub(crate) enum Plugins {
    /// List every plugin, where it comes from, and why one was refused
    List {
        #[command(flatten)]
        trust: TrustArgs,
        /// How to print the result
        #[arg(long, value_enum, default_value = "text")]
        format: Format,
    },
    /// Write a new plugin that works, for you to change
    New(New),
    /// Ask a plugin what the contract promises, and show where it does otherwise
    Check(Box<Check>),
    /// Describe a plugin: what it can do and its options
    Info {
        /// A plugin's identifier, or the path of a library or program
        plugin: String,
        #[command(flatten)]
        trust: TrustArgs,
        /// How to print the result
        #[arg(long, value_enum, default_value = "text")]
        format: Format,
    },
    /// Write down the digests of plugins' code: what is pinned runs unchanged or not at all
    Pin(Pin),
}

/// Write down the digests of plugins' code: what is pinned runs unchanged or not at all.
#[derive(Debug, Args)]
#[allow(clippy::struct_excessive_bools, reason = "what to do, one flag each")]
pub(crate) struct Pin {
    /// Plugins, by identifier or path
    #[arg(value_name = "PLUGIN", required_unless_present_any = ["list", "check"])]
    pub(crate) plugins: Vec<String>,
    /// Accept what has changed since a plugin was pinned
    #[arg(long, conflicts_with_all = ["list", "check", "remove"])]
    pub(crate) update: bool,
    /// Take plugins out of the lock
    #[arg(long, conflicts_with_all = ["list", "check"])]
    pub(crate) remove: bool,
    /// Show what is pinned
    #[arg(long, conflicts_with_all = ["check", "plugins"])]
    pub(crate) list: bool,
    /// Say whether everything that is pinned is unchanged; nothing is started
    #[arg(long, conflicts_with = "plugins")]
    pub(crate) check: bool,
    /// The lock file [default: fleetyard.lock in the current folder]
    #[arg(
        long,
        value_name = "FILE",
        env = "FLEETYARD_LOCK",
        hide_env_values = true
    )]
    pub(crate) lock: Option<PathBuf>,
    /// How to print the result
    #[arg(long, value_enum, default_value = "text")]
    pub(crate) format: Format,
}

/// A kind by its name on the wire; help and completions show them all.
fn kind() -> impl TypedValueParser<Value = Kind> {
    let names = PossibleValuesParser::new(Kind::ALL.map(Kind::as_str));
    names.try_map(|name| {
        let named = Kind::ALL.into_iter().find(|kind| kind.as_str() == name);
        named.ok_or("there is no such kind")
    })
}

/// What a new plugin is written in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum LangArg {
    /// A shared library on the Rust SDK
    Rust,
    /// A shared library on the header alone
    C,
    /// A shared library on the C++ wrapper of the header
    Cpp,
    /// A program on the Python package
    Python,
    /// A manifest for a program that reads MovingAI files and writes paths
    Command,
}

/// Write a new plugin that works, for you to change.
#[derive(Debug, Args)]
pub(crate) struct New {
    /// Its name: the plugin's identifier, and the folder that is written
    pub(crate) name: String,
    /// What it is written in
    #[arg(long, value_enum)]
    pub(crate) lang: LangArg,
    /// Its kind
    #[arg(long, value_parser = kind(), default_value = Kind::Planner.as_str())]
    pub(crate) kind: Kind,
    /// Where the folder goes
    #[arg(long, value_name = "FOLDER", default_value = ".")]
    pub(crate) out: PathBuf,
}

/// Ask a plugin what the contract promises, and show where it does otherwise.
#[derive(Debug, Args)]
pub(crate) struct Check {
    /// A plugin's identifier, or the path of a library or program, of which all
    /// plugins are checked; PATH:ID picks one of several
    #[arg(required_unless_present = "list")]
    pub(crate) plugin: Option<String>,
    /// Run this case alone; may be given several times
    #[arg(long, value_name = "CASE")]
    pub(crate) only: Vec<String>,
    /// Check plugins of this kind alone
    #[arg(long, value_parser = kind())]
    pub(crate) kind: Option<Kind>,
    /// Check plugins with this identifier alone
    #[arg(long, value_name = "ID")]
    pub(crate) id: Option<String>,
    /// An option of the plugin in every case; may be given several times
    #[arg(long = "option", value_name = "NAME=VALUE")]
    pub(crate) options: Vec<String>,
    /// How the plugin is attached [default: worker for libraries, stdio for
    /// programs]
    #[arg(long, value_enum)]
    pub(crate) attach: Option<AttachArg>,
    /// Seed of the whole run: of all instances, and of the plugin's random choices
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) seed: u64,
    /// Ask one case again, by the seed that it showed
    #[arg(long, value_name = "SEED", conflicts_with = "seed")]
    pub(crate) reproduce: Option<u64>,
    /// Wall-clock budget of a call; a tenth for those who use all of it
    #[arg(long, value_name = "DURATION", default_value = "5s", value_parser = duration)]
    pub(crate) budget: Duration,
    /// How long a plugin may go on after the deadline once it was told to stop
    #[arg(long, value_name = "DURATION", default_value = "2s", value_parser = duration)]
    pub(crate) grace: Duration,
    /// How long a plugin may take to start and be made
    #[arg(long, value_name = "DURATION", default_value = "1m", value_parser = duration)]
    pub(crate) startup: Duration,
    #[command(flatten)]
    pub(crate) grants: GrantArgs,
    /// Show the cases and what they ask
    #[arg(long)]
    pub(crate) list: bool,
    /// How to print the result
    #[arg(long, value_enum, default_value = "text")]
    pub(crate) format: Format,
    /// Write the report of one case to a file: how the command asks a plugin in the
    /// process of a host that may be lost
    #[arg(long, value_name = "FILE", hide = true, requires = "reproduce")]
    pub(crate) report_to: Option<PathBuf>,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Maps {
    /// Make a map, and a scenario for it
    #[command(subcommand)]
    Generate(Generate),
    /// Make a scenario for a map: random starts and goals
    Scenario {
        /// MovingAI map file
        map: PathBuf,
        /// Number of agents
        #[arg(long, value_name = "N")]
        agents: u32,
        /// Seed of starts and goals
        #[arg(long, value_name = "N", default_value_t = 1)]
        seed: u64,
        /// Folder to write to
        #[arg(long, value_name = "FOLDER", default_value = ".")]
        out: PathBuf,
    },
    /// Describe a map
    Info {
        /// MovingAI map file
        map: PathBuf,
        /// How to print the result
        #[arg(long, value_enum, default_value = "text")]
        format: Format,
    },
}

/// Where a generated map goes, and its scenario.
#[derive(Debug, Args)]
pub(crate) struct OutArgs {
    /// Folder to write to
    #[arg(long, value_name = "FOLDER", default_value = ".")]
    pub(crate) out: PathBuf,
    /// Name of the map, and of its file without `.map` [default: after its parameters]
    #[arg(long, value_name = "NAME")]
    pub(crate) name: Option<String>,
    /// Also write a scenario for so many agents
    #[arg(long, value_name = "N")]
    pub(crate) scenario_agents: Option<u32>,
    /// Seed of the scenario
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) scenario_seed: u64,
}

#[derive(Debug, Args)]
pub(crate) struct SizeArgs {
    /// Rows of the map
    #[arg(long, value_name = "N")]
    pub(crate) rows: u32,
    /// Columns of the map
    #[arg(long, value_name = "N")]
    pub(crate) cols: u32,
}

/// A maze's size: that of the map, or that of the maze.
#[derive(Debug, Args)]
pub(crate) struct MazeSizeArgs {
    /// Rows of the map
    #[arg(long, value_name = "N", required_unless_present_any = ["width", "height"])]
    pub(crate) rows: Option<u32>,
    /// Columns of the map
    #[arg(long, value_name = "N", required_unless_present_any = ["width", "height"])]
    pub(crate) cols: Option<u32>,
    /// Width in maze cells, instead of --cols: the map is closed on all sides
    #[arg(long, value_name = "N", requires = "height", conflicts_with_all = ["rows", "cols"],
        value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) width: Option<u32>,
    /// Height in maze cells, instead of --rows
    #[arg(long, value_name = "N", requires = "width", conflicts_with_all = ["rows", "cols"],
        value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) height: Option<u32>,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum MazeArg {
    /// Depth-first: long winding corridors
    Backtracker,
    /// Randomised Prim: many short dead ends
    Prim,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum MazeRandomArg {
    /// Those of this program's other generators
    #[value(name = "chacha")]
    ChaCha,
    /// Those of Python's random module: the mazes of the grid-maze benchmark
    Python,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Generate {
    /// No obstacles
    Empty {
        #[command(flatten)]
        size: SizeArgs,
        #[command(flatten)]
        out: OutArgs,
    },
    /// Obstacles strewn at random, the free cells connected
    Random {
        #[command(flatten)]
        size: SizeArgs,
        /// Share of blocked cells, from 0 to below 1
        #[arg(long, value_name = "SHARE")]
        obstacle_density: f64,
        /// Seed of the map
        #[arg(long, value_name = "N", default_value_t = 1)]
        seed: u64,
        #[command(flatten)]
        out: OutArgs,
    },
    /// Rooms with doors
    Room {
        #[command(flatten)]
        size: SizeArgs,
        /// Distance from wall to wall: a room has one row and column less
        #[arg(long, value_name = "N")]
        room_size: u32,
        /// Doors per wall between two rooms
        #[arg(long, value_name = "N", default_value_t = 1)]
        doors: u32,
        /// Seed of the map
        #[arg(long, value_name = "N", default_value_t = 1)]
        seed: u64,
        #[command(flatten)]
        out: OutArgs,
    },
    /// A maze
    Maze {
        #[command(flatten)]
        size: MazeSizeArgs,
        /// Width of corridors in cells
        #[arg(long, value_name = "N", default_value_t = 1)]
        corridor: u32,
        /// How it is carved
        #[arg(long, value_enum, default_value = "backtracker")]
        algorithm: MazeArg,
        /// Whose random numbers carve it
        #[arg(long, value_enum, default_value = "chacha")]
        random: MazeRandomArg,
        /// Seed of the map
        #[arg(long, value_name = "N", default_value_t = 1)]
        seed: u64,
        /// Also write a scenario with the maze's own task: from its north-west cell to
        /// the one in its middle
        #[arg(long)]
        scenario: bool,
        #[command(flatten)]
        out: OutArgs,
    },
    /// Shelves and aisles: warehouse-A-B-C-D-E of the MovingAI benchmarks
    Warehouse {
        /// Blocks of shelves beside each other (A)
        #[arg(long, value_name = "A")]
        blocks_across: u32,
        /// Blocks of shelves above each other (B)
        #[arg(long, value_name = "B")]
        blocks_down: u32,
        /// Width of a block in cells (C)
        #[arg(long, value_name = "C")]
        block_cols: u32,
        /// Height of a block in cells (D)
        #[arg(long, value_name = "D")]
        block_rows: u32,
        /// Width of aisles in cells (E)
        #[arg(long, value_name = "E")]
        aisle: u32,
        /// Free columns at the left and right [default: A * C / 4]
        #[arg(long, value_name = "N")]
        margin: Option<u32>,
        /// Height of the aisles between blocks above each other [default: E]
        #[arg(long, value_name = "N")]
        aisle_rows: Option<u32>,
        /// Free rows at the top and bottom [default: as between blocks]
        #[arg(long, value_name = "N")]
        edge_rows: Option<u32>,
        /// Without the wall all around
        #[arg(long)]
        open: bool,
        /// Make the free cells above and below shelves endpoints (letter e)
        #[arg(long)]
        endpoints: bool,
        /// Make every Nth cell of the outermost free columns a workstation (letter w)
        #[arg(long, value_name = "N")]
        workstations: Option<u32>,
        #[command(flatten)]
        out: OutArgs,
    },
}

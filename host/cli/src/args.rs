//! Arguments that several commands have, and readers of values. What one command alone has
//! stands in its own file; help, completions, man pages and checks follow from both.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Duration;

use bytesize::ByteSize;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Arg, ArgMatches, Args, FromArgMatches, ValueEnum, value_parser};
use fleetyard_bench::{BudgetOptions, SandboxOptions};
use fleetyard_core::formats::Format as FileFormat;
use fleetyard_core::{Connectivity, Grid, InputError, Words, load_map};
use fleetyard_runtime::{Level, Policy};
use fleetyard_sim::noise::{Delay, Disturbance, Messages, VelocityNoise};
use fleetyard_sim::{SimConfig, SimError, Tier};

use crate::exit::{Exit, Failure, Result};
use crate::output;

/// The form in which results are printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Format {
    /// For people
    Text,
    /// For programs: one JSON document on standard output
    Json,
}

impl Format {
    const ID: &str = "format";
}

impl FromArgMatches for Format {
    fn from_arg_matches(matches: &ArgMatches) -> std::result::Result<Self, clap::Error> {
        Ok(matches.get_one(Self::ID).copied().unwrap_or(Self::Text))
    }

    fn update_from_arg_matches(
        &mut self,
        matches: &ArgMatches,
    ) -> std::result::Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

impl Args for Format {
    fn augment_args(command: clap::Command) -> clap::Command {
        command.arg(
            Arg::new(Self::ID)
                .long(Self::ID)
                .value_name("FORMAT")
                .value_parser(value_parser!(Self))
                .default_value("text")
                .help("Format of the result"),
        )
    }

    fn augment_args_for_update(command: clap::Command) -> clap::Command {
        Self::augment_args(command)
    }
}

/// An error of the parser, with a tip where it met a word that belongs somewhere else.
pub(crate) fn explained(mut error: clap::Error) -> clap::Error {
    let Some(ContextValue::String(word)) = error.get(ContextKind::InvalidArg) else {
        return error;
    };
    let tip = match error.kind() {
        ErrorKind::UnknownArgument if !word.starts_with('-') => stray(word),
        _ => None,
    };
    if let Some(tip) = tip {
        let tips = ContextValue::StyledStrs(vec![tip.into()]);
        error.insert(ContextKind::Suggested, tips);
    }
    error
}

/// The place of a word that stands alone, where its look tells it.
fn stray(word: &str) -> Option<String> {
    let ends = |end: &str| word.len() > end.len() && word.ends_with(end);
    let flag = if ends(".scen") {
        "--scen"
    } else if ends(".task.json") {
        "--task"
    } else if ends(".map") || ends(".grid.json") {
        "--map"
    } else {
        let (name, _) = word.split_once('=')?;
        let is_name = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
        let tip = "options of a plugin stand right behind its name, as in '--planner PLUGIN";
        return (!name.is_empty() && name.chars().all(is_name)).then(|| format!("{tip} {word}'"));
    };
    Some(format!("name it with {flag}, as in '{flag} {word}'"))
}

/// A value that was read, or the reason why the text is none.
type Read<T> = std::result::Result<T, String>;

/// A value by its word. Help, completions and suggestions are those of the declaration.
pub(crate) fn word<T: Words + Send + Sync>() -> impl TypedValueParser<Value = T> {
    one_of(T::ALL)
}

/// One of some values, by its word.
pub(crate) fn one_of<T: Words + Send + Sync>(
    values: &'static [T],
) -> impl TypedValueParser<Value = T> {
    let known = values.iter().map(|value| {
        let named = PossibleValue::new(value.name());
        match value.help() {
            "" => named,
            help => named.help(help),
        }
    });
    PossibleValuesParser::new(known.collect::<Vec<_>>())
        .try_map(|name| T::from_name(&name).ok_or("there is no such word"))
}

pub(crate) fn connectivity(text: &str) -> Read<Connectivity> {
    match text {
        "4" => Ok(Connectivity::Four),
        "8" => Ok(Connectivity::Eight),
        _ => Err("grids have 4 or 8 neighbours".into()),
    }
}

/// A file format by its name.
pub(crate) fn file_format(text: &str) -> Read<FileFormat> {
    FileFormat::by_name(text).ok_or_else(|| {
        let known: Vec<&str> = FileFormat::ALL.iter().map(|format| format.name()).collect();
        format!("formats are {}", known.join(", "))
    })
}

/// A kind of file that is written whatever its name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Written {
    Csv,
    Html,
    Json,
    JsonLines,
    Markdown,
    Parquet,
    Png,
    Svg,
    Trace,
}

impl Written {
    /// Its name for people, and the ends of file names that are its own, the usual one first.
    fn known(self) -> (&'static str, &'static [&'static str]) {
        match self {
            Self::Csv => ("CSV", &["csv"]),
            Self::Html => ("an HTML page, which a browser shows,", &["html", "htm"]),
            Self::Json => ("JSON", &["json"]),
            Self::JsonLines => ("JSON Lines", &["jsonl", "ndjson", "json"]),
            Self::Markdown => ("Markdown", &["md", "markdown"]),
            Self::Parquet => ("Parquet", &["parquet"]),
            Self::Png => ("a PNG picture", &["png"]),
            Self::Svg => ("an SVG picture", &["svg"]),
            Self::Trace => (
                "a trace, of which `fleetyard trace export` makes other files,",
                &["trace"],
            ),
        }
    }

    /// A path to write to, unless its name promises a file of another kind.
    pub(crate) fn path(self, text: &str) -> Read<PathBuf> {
        const OTHERS: &[&str] = &[
            "avi", "csv", "gif", "htm", "html", "jpeg", "jpg", "json", "jsonl", "markdown", "md",
            "mkv", "mov", "mp4", "ndjson", "parquet", "pdf", "png", "svg", "trace", "tsv", "webm",
            "webp", "xlsx", "xml", "yaml", "yml",
        ];
        let path = PathBuf::from(text);
        let end = path.extension().and_then(OsStr::to_str);
        let end = end.unwrap_or_default().to_ascii_lowercase();
        let (what, own) = self.known();
        if own.contains(&end.as_str()) || !OTHERS.contains(&end.as_str()) {
            return Ok(path);
        }
        let better = path.with_extension(own[0]);
        Err(format!(
            "this writes {what} and no .{end} file: name it {}",
            better.display()
        ))
    }
}

/// A file for a picture; its name says the format.
pub(crate) fn picture(text: &str) -> Read<PathBuf> {
    let path = PathBuf::from(text);
    let known = |end: &OsStr| end.eq_ignore_ascii_case("svg") || end.eq_ignore_ascii_case("png");
    if path.extension().is_none_or(known) {
        Ok(path)
    } else {
        Err("pictures are drawn as .svg or .png".into())
    }
}

pub(crate) fn duration(text: &str) -> Read<Duration> {
    let duration = humantime::parse_duration(text)
        .map_err(|_| "write a duration with its unit, such as 500ms, 10s or 2m".to_owned())?;
    // Deadlines are 64-bit nanoseconds; a year is plenty.
    if duration.is_zero() || duration > Duration::from_hours(366 * 24) {
        return Err("a budget is longer than nothing and shorter than a year".into());
    }
    Ok(duration)
}

/// A number of bytes with its unit.
pub(crate) fn size(text: &str) -> Read<u64> {
    let size: ByteSize = text
        .parse()
        .map_err(|_| "write a size with its unit, such as 512MiB or 4GiB".to_owned())?;
    if size.as_u64() < 1 << 12 {
        return Err("a limit is at least 4KiB".into());
    }
    Ok(size.as_u64())
}

/// A limit of search nodes.
pub(crate) fn nodes(text: &str) -> Read<u64> {
    let nodes = text
        .parse()
        .map_err(|_| "write a whole number".to_owned())?;
    if nodes == 0 {
        return Err("nothing can be searched without nodes; leave --nodes out for no limit".into());
    }
    Ok(nodes)
}

/// A duration as users write it: help shows defaults so.
pub(crate) fn duration_text(duration: Duration) -> String {
    humantime::format_duration(duration).to_string()
}

/// A number of bytes as users write it.
pub(crate) fn size_text(bytes: u64) -> String {
    let units = [(30, "GiB"), (20, "MiB"), (10, "KiB")];
    let whole = |(power, _): &(u32, _)| bytes.trailing_zeros() >= *power;
    match units.into_iter().find(whole) {
        Some((power, unit)) => format!("{}{unit}", bytes >> power),
        None => format!("{bytes}B"),
    }
}

/// A number that is not negative; `what` is what it counts.
pub(crate) fn not_negative(text: &str, what: &str) -> Read<f64> {
    let value: f64 = text.parse().map_err(|_| "write a number".to_owned())?;
    if value.is_finite() && value >= 0.0 {
        Ok(value)
    } else {
        Err(format!("a {what} is finite and not negative"))
    }
}

/// A variable with its value, or the value that the host has.
fn variable(text: &str) -> Read<(String, String)> {
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

// Headings of the help, each of them named at each of its arguments: one that is set for a whole
// structure would hold for all that follow, too.
pub(crate) const INSTANCE: &str = "Instance";
pub(crate) const PLANNER: &str = "Planner";
const BUDGET: &str = "Budget";
pub(crate) const ROBOTS: &str = "Robots";
pub(crate) const EXECUTION: &str = "Execution";
pub(crate) const VIEW: &str = "View of a task";
pub(crate) const RECORDS: &str = "Results and records";
pub(crate) const LIMITS: &str = "Sandbox and limits";
/// For arguments that decide which code may run.
const TRUST: &str = "Trust";

/// The name of a map in scenarios.
#[derive(Debug, Args)]
pub(crate) struct MapNameArgs {
    /// Name of the map in scenarios, where its file has another
    #[arg(long, help_heading = INSTANCE, value_name = "NAME", requires = "map")]
    map_name: Option<String>,
}

impl MapNameArgs {
    /// Reads the map under the name that is asked for.
    pub(crate) fn load(&self, map: &Path) -> Result<Grid> {
        let grid = load_map(map)?;
        Ok(match &self.map_name {
            Some(name) => grid.named(name),
            None => grid,
        })
    }

    /// Warns of a scenario of a map with another name, of which `found` is the refusal. Its size is
    /// known to be right.
    pub(crate) fn warn(found: std::result::Result<(), InputError>) {
        let Err(error) = found else { return };
        output::warning(&format!("{error}; it is used all the same"));
        output::hint("if it is the right one, say so with --map-name NAME");
    }
}

#[derive(Debug, Args)]
pub(crate) struct BudgetArgs {
    /// Wall-clock budget of a plan
    #[arg(long, short, help_heading = BUDGET, value_name = "DURATION", value_parser = duration,
          default_value = duration_text(BudgetOptions::default().wall))]
    pub(crate) budget: Duration,
    /// Wall-clock budget for learning the map [default: the plan's]
    #[arg(long, help_heading = BUDGET, value_name = "DURATION", value_parser = duration)]
    pub(crate) prepare_budget: Option<Duration>,
    /// Time in which a planner has to start and be made
    #[arg(long, help_heading = BUDGET, value_name = "DURATION", value_parser = duration,
          default_value = duration_text(BudgetOptions::default().startup))]
    pub(crate) startup: Duration,
    /// Time for which a planner may go on after the deadline once it was told to stop; plans that
    /// come meanwhile do not count
    #[arg(long, help_heading = BUDGET, value_name = "DURATION", value_parser = duration)]
    pub(crate) grace: Option<Duration>,
    /// Most search nodes, for planners that count them [default: no limit]
    #[arg(long, help_heading = BUDGET, value_name = "N", value_parser = nodes)]
    pub(crate) nodes: Option<u64>,
    /// Most threads a planner may use
    #[arg(long, help_heading = BUDGET, value_name = "N", default_value_t = BudgetOptions::default().threads,
          value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub(crate) threads: u32,
    /// Seed of every random choice
    #[arg(long, help_heading = BUDGET, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
    #[command(flatten)]
    pub(crate) sandbox: SandboxArgs,
}

/// The grants and limits of a plugin.
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
    /// Processor cores of the planner's own
    #[arg(long, help_heading = LIMITS, value_enum, default_value = "auto", value_name = "HOW")]
    pub(crate) pin: PinArg,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum PinArg {
    /// A physical core for each thread of the budget and one left for the host,
    /// where the machine has so many that nobody else has reserved
    Auto,
    /// Let the kernel move the planner
    Off,
}

/// The code that may run.
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

/// The grants and limits of a plugin in every call, whoever makes it.
#[derive(Debug, Args)]
pub(crate) struct GrantArgs {
    #[command(flatten)]
    pub(crate) trust: TrustArgs,
    /// Strictness of the sandbox: the layers that are required
    #[arg(long, help_heading = LIMITS, value_name = "LEVEL", value_parser = word::<Level>(), default_value_t)]
    pub(crate) sandbox: Level,
    /// Most processes and threads
    #[arg(long, help_heading = LIMITS, value_name = "N", default_value_t = Policy::default().processes,
          value_parser = clap::value_parser!(u32).range(2..=100_000))]
    pub(crate) processes: u32,
    /// Most output that is no message: standard error, stray lines
    #[arg(long, help_heading = LIMITS, value_name = "SIZE", value_parser = size,
          default_value = size_text(SandboxOptions::default().output_bytes))]
    pub(crate) output_limit: u64,
    /// Size of the scratch folder, which is empty at the start of every run
    #[arg(long, help_heading = LIMITS, value_name = "SIZE", value_parser = size,
          default_value = size_text(Policy::default().disk_bytes))]
    pub(crate) disk: u64,
    /// Let the plugin read a file or folder; may be given several times
    #[arg(long, help_heading = LIMITS, value_name = "PATH")]
    pub(crate) allow_read: Vec<PathBuf>,
    /// Let the plugin use a device: `nvidia`, `dri` or `amd` for all of a driver's, or a path; may be given
    /// several times
    #[arg(long, help_heading = LIMITS, value_name = "DEVICE")]
    pub(crate) allow_device: Vec<String>,
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
    #[arg(long, help_heading = EXECUTION, value_name = "METRES", default_value_t = SimConfig::default().cell_size_m)]
    pub(crate) cell_size: f64,
    /// Duration of one step of a plan in seconds [default: 1; for the grid of a task the time that
    /// its slowest robot needs for a cell]
    #[arg(long, help_heading = EXECUTION, value_name = "SECONDS")]
    pub(crate) step: Option<f64>,
    /// Radius of an agent in metres [default: 0.35 cells; of robots with a model the
    /// preset's footprint, or 0.3 cells]
    #[arg(long, help_heading = EXECUTION, value_name = "METRES")]
    pub(crate) radius: Option<f64>,
    /// Simulator ticks per second
    #[arg(long, help_heading = EXECUTION, value_name = "N", default_value_t = SimConfig::default().ticks_hz)]
    pub(crate) ticks_hz: u32,
    /// Substeps per tick
    #[arg(long, help_heading = EXECUTION, value_name = "N", default_value_t = SimConfig::default().substeps)]
    pub(crate) substeps: u32,
    /// Motion of bodies, and detection of contacts
    #[arg(long, help_heading = EXECUTION, value_parser = word::<Tier>(), default_value_t)]
    pub(crate) tier: Tier,
}

/// Disturbances of the execution.
#[derive(Debug, Clone, Args)]
pub(crate) struct DisturbanceArgs {
    /// Delays of robots: none, bernoulli:P,SECONDS, uniform:MIN,MAX, gaussian:MEAN,STD or
    /// bursts:RATE,SECONDS
    #[arg(long, help_heading = EXECUTION, value_name = "DELAY", value_parser = disturbance::<Delay>, default_value_t)]
    pub(crate) delay: Delay,
    /// Unevenness of speeds: STD,FLOOR as parts of the speed [default: even]
    #[arg(long, help_heading = EXECUTION, value_name = "STD,FLOOR",
          value_parser = disturbance::<VelocityNoise>)]
    pub(crate) velocity_noise: Option<VelocityNoise>,
    /// Delay of messages in seconds and share of lost ones: MIN,MAX,LOSS [default: none and none]
    #[arg(long, help_heading = EXECUTION, value_name = "MIN,MAX,LOSS",
          value_parser = disturbance::<Messages>)]
    pub(crate) messages: Option<Messages>,
}

/// A disturbance from its text; an error says how to write it.
pub(crate) fn disturbance<T: FromStr<Err = SimError>>(text: &str) -> Read<T> {
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
            ..Disturbance::default()
        }
    }
}

/// A plugin that is asked for, and its options.
#[derive(Debug, Clone)]
pub(crate) struct PluginArg {
    pub(crate) plugin: String,
    /// `NAME=VALUE` each.
    pub(crate) options: Vec<String>,
}

impl PluginArg {
    /// The words after `--planner` or its like, and options that were given otherwise.
    pub(crate) fn new(words: &[String], options: &[String]) -> Result<Self> {
        let (plugin, own) = words
            .split_first()
            .map_or(("", words), |(first, own)| (&**first, own));
        if let Some(wrong) = own.iter().find(|option| !option.contains('=')) {
            let message = format!("`{wrong}` after the plugin `{plugin}` is no option NAME=VALUE");
            let several = || {
                "`fleetyard compare` runs several, and every planner has a --planner of its own"
                    .to_owned()
            };
            let hint = stray(wrong).unwrap_or_else(several);
            return Err(Failure::new(Exit::Usage, message).hint(hint));
        }
        Ok(Self {
            plugin: plugin.to_owned(),
            options: own.iter().chain(options).cloned().collect(),
        })
    }
}

//! `fleetyard fleet`: robots that drive on and on, and a planner that plans meanwhile.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicI32, Ordering};
use std::time::Duration;

use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Args};
use fleetyard_abi::c::GUIDANCE_ID;
use fleetyard_abi::{Kind, Motion};
use fleetyard_bench::{BudgetOptions, GivenOptions, Host, Robots, SandboxOptions};
use fleetyard_bench::{half_of_memory, number, start_modules};
use fleetyard_core::formats::{TaskList, load_league, load_lorr_tasks};
use fleetyard_core::{Grid, InputError, load_guidance, load_map};
use fleetyard_fleet::{
    Allowance, Assign, CallTimes, Clock, ClosureRate, CutBy, End, Ended, FleetConfig, FleetOutcome,
    Ground, Intervened, Intervention, ModuleInfo, Modules, Notice, Point, Recorder, Recording,
    Round, Rules, Watch, replay, resume, run,
};
use fleetyard_runtime::{Attach, Closing, LogLine, on_interrupt};
use fleetyard_sim::trace::TraceOptions;
use fleetyard_sim::{Fleet as Bodies, SimConfig, Tier, TraceSink};
use fleetyard_view::FleetPicture;
use indicatif::ProgressBar;
use serde::{Deserialize, Serialize};

use super::live::{Line, Live, Tee, say};
use super::run::check_folder;
use super::simulate::available_memory_bytes;
use crate::args::{
    DisturbanceArgs, Format, GrantArgs, LIMITS, PluginArg, RECORDS, ROBOTS, Written, duration,
    duration_text, nodes, one_of, picture as picture_file, size, word,
};
use crate::exit::{Exit, Failure, Result, internal};
use crate::files::{draw_document, keep, trace_file};
use crate::output;
use crate::setup::{BUILT_IN, bodies, find_plugin, policy, robots, trust, warn_of_cell_size};

const PLANNING: &str = "Planning";
const GOALS: &str = "Goals";

/// Run a fleet that never ends: robots drive, reach goals and get new ones, while a planner
/// plans their next ways.
///
/// The invocation policy says when to plan, the instance generator what, the fail policy what
/// to do where the planner has no plan that may be driven. docs/fleet.md says what happens
/// when.
#[derive(Debug, Args)]
#[command(
    mut_arg("agents", |arg| arg.required_unless_present_any(["instance", "replay", "resume"])),
    mut_arg("planner", |arg| arg.required_unless_present_any(["replay", "resume"])),
)]
pub(crate) struct Fleet {
    /// Map file: MovingAI, fleetyard.grid/1 or LSMART [with --replay and --resume: the one that was recorded]
    #[arg(long, short, value_name = "FILE", required_unless_present_any = ["instance", "replay", "resume"])]
    map: Option<PathBuf>,
    /// Instance of the League of Robot Runners: its map, starts, tasks, and numTasksReveal; robots
    /// look east at first [with --replay and --resume: the one that was recorded]
    #[arg(long, short, value_name = "FILE", conflicts_with_all = ["map", "tasks"])]
    instance: Option<PathBuf>,
    /// Guidance graph of the map, a fleetyard.guidance/1 file, for plugins that read one
    #[arg(long, help_heading = PLANNING, value_name = "FILE", conflicts_with_all = ["replay", "resume"])]
    guidance: Option<PathBuf>,
    #[command(flatten)]
    asked: FleetAsked,
    /// Write what plugins answer to a file, from which the run can be had again
    #[arg(long, help_heading = RECORDS, value_name = "FILE", conflicts_with_all = ["replay", "resume"])]
    record: Option<PathBuf>,
    /// Run again what was recorded, without any plugin
    #[arg(long, help_heading = RECORDS, value_name = "FILE", conflicts_with = "resume")]
    replay: Option<PathBuf>,
    /// Go on with a run whose host was killed or interrupted, and with its recording
    #[arg(long, help_heading = RECORDS, value_name = "FILE")]
    resume: Option<PathBuf>,
    /// Write the trace to a file
    #[arg(long, help_heading = RECORDS, value_name = "FILE", value_parser = |text: &str| Written::Trace.path(text))]
    trace: Option<PathBuf>,
    /// Ticks between the states in the trace; 0 records events only
    #[arg(long, help_heading = RECORDS, value_name = "N", default_value_t = TraceOptions::default().every,
          requires = "trace")]
    trace_every: u32,
    /// Draw throughput over time, and where robots waited, to a file, SVG or PNG by its name
    #[arg(long, help_heading = RECORDS, value_name = "FILE", value_parser = picture_file)]
    picture: Option<PathBuf>,
    /// Hear commands while the fleet drives, lines of JSON on standard input, and tell where it is, lines of
    /// JSON on standard output; docs/fleet.md lists them. What is done to the fleet goes into --record
    #[arg(long, help_heading = RECORDS)]
    live: bool,
    /// Show what plugins wrote to their logs and to standard error
    #[arg(long, short)]
    verbose: bool,
    #[command(flatten)]
    format: Format,
    /// Threads of the simulator; results do not depend on it [default: a processor each, but for
    /// those of the planner]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Time in which a plugin has to start and be made
    #[arg(long, help_heading = LIMITS, value_name = "DURATION", value_parser = duration,
          default_value = duration_text(BudgetOptions::default().startup))]
    startup: Duration,
    #[command(flatten)]
    grants: GrantArgs,
}

/// The settings that decide about a run; a recording has them all.
#[derive(Debug, Clone, Args)]
pub(super) struct FleetAsked {
    /// Number of robots [default: all of --instance]
    #[arg(long, short = 'n', value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    agents: Option<u32>,
    /// Simulated time to go on
    #[arg(long, value_name = "DURATION", default_value = seconds_text(FleetConfig::default().duration_s), value_parser = positive_seconds)]
    duration: f64,
    /// Seed of every random choice: starts, goals, plugins, disturbances
    #[arg(long, value_name = "N", default_value_t = FleetConfig::default().seed)]
    seed: u64,
    /// Rules of execution. Synchronous ones change defaults: --model rotation, or pebble if that is
    /// asked for, --motion by it, --fail-policy all-wait, --period of a step, --ticks-hz 10
    #[arg(long, value_parser = word::<Rules>(), default_value_t)]
    rules: Rules,
    /// The planner: a plugin's identifier, or the path of a library, a program or their folder;
    /// PATH:ID picks one of several. Its options may follow
    #[arg(long, short, help_heading = PLANNING, value_names = ["PLUGIN", "NAME=VALUE"], num_args = 1..,
          action = ArgAction::Set)]
    pub(super) planner: Vec<String>,
    /// The instance generator: who is sent where
    #[arg(long, help_heading = PLANNING, value_names = ["PLUGIN", "NAME=VALUE"], num_args = 1..,
          action = ArgAction::Set, default_value = "windowed-multi-goals")]
    generator: Vec<String>,
    /// The invocation policy: when to plan
    #[arg(long, help_heading = PLANNING, value_names = ["PLUGIN", "NAME=VALUE"], num_args = 1..,
          action = ArgAction::Set, default_value = "periodic")]
    invocation: Vec<String>,
    /// The fail policy: what to do without a plan
    #[arg(long, help_heading = PLANNING, value_names = ["PLUGIN", "NAME=VALUE"], num_args = 1..,
          action = ArgAction::Set, default_value = "pibt")]
    fail_policy: Vec<String>,
    /// Time between two calls, for an invocation policy with the option `period_s`
    /// [default: the policy's]
    #[arg(long, help_heading = PLANNING, value_name = "DURATION", value_parser = positive_seconds)]
    period: Option<f64>,
    /// Time ahead for which plans are free of collisions; 0s for plans to the end
    #[arg(long, help_heading = PLANNING, value_name = "DURATION", default_value = seconds_text(FleetConfig::default().window_s),
          value_parser = seconds)]
    window: f64,
    /// Time limit of the planner
    #[arg(long, help_heading = PLANNING, value_name = "DURATION", default_value = seconds_text(FleetConfig::default().limit_s),
          value_parser = positive_seconds)]
    limit: f64,
    /// Motion of robots as planners see it; robots turn in any case. With stop-go and slower they plan
    /// in continuous time
    #[arg(long, help_heading = PLANNING, value_parser = one_of(FleetConfig::MOTIONS),
          default_value_t = FleetConfig::default().motion)]
    motion: Motion,
    /// When an answer takes effect
    #[arg(long, help_heading = PLANNING, value_parser = word::<Clock>(), default_value_t)]
    clock: Clock,
    /// Extent to which robots are committed when the planner is called
    #[arg(long, value_name = "CUT", value_parser = word::<CutBy>(), default_value_t)]
    cut: CutBy,
    /// An option of the planner; may be given several times
    #[arg(long = "option", help_heading = PLANNING, value_name = "NAME=VALUE")]
    options: Vec<String>,
    /// An option of the instance generator
    #[arg(long = "generator-option", help_heading = PLANNING, value_name = "NAME=VALUE")]
    generator_options: Vec<String>,
    /// An option of the invocation policy
    #[arg(long = "invocation-option", help_heading = PLANNING, value_name = "NAME=VALUE")]
    invocation_options: Vec<String>,
    /// An option of the fail policy
    #[arg(long = "fail-option", help_heading = PLANNING, value_name = "NAME=VALUE")]
    fail_options: Vec<String>,
    /// Attachment of libraries, the built-in one among them: in the host's own process or in
    /// processes of their own
    #[arg(long, help_heading = PLANNING, value_name = "HOW",
          value_parser = one_of(&[Attach::InProcess, Attach::Worker]), default_value_t = Attach::Worker)]
    attach: Attach,
    /// The host calls by itself when nobody had anything to do for so long
    #[arg(long, help_heading = PLANNING, value_name = "DURATION", default_value = seconds_text(FleetConfig::default().watchdog_s),
          value_parser = positive_seconds)]
    watchdog: f64,
    /// Origin of goals
    #[arg(long, help_heading = GOALS, value_parser = word::<Assign>(), default_value_t)]
    assign: Assign,
    /// Tasks, in the format of the League of Robot Runners
    #[arg(long, help_heading = GOALS, value_name = "FILE")]
    pub(super) tasks: Option<PathBuf>,
    /// Number of tasks that are known at a time, per robot
    #[arg(long, help_heading = GOALS, value_name = "RATIO", default_value_t = FleetConfig::default().reveal)]
    reveal: f64,
    /// Time for which a robot stays where it reached a goal
    #[arg(long, help_heading = GOALS, value_name = "DURATION", default_value = seconds_text(FleetConfig::default().dwell_s),
          value_parser = seconds)]
    dwell: f64,
    /// Motion model or preset of all robots, such as agv or lsmart-effective; pebble for discs
    /// that move by one cell per step. docs/execution.md lists them
    #[arg(long, help_heading = ROBOTS, value_name = "NAME", default_value = "agv",
          conflicts_with = "fleet")]
    model: String,
    /// Footprints, models and limits of all robots, a fleetyard.fleet/1 file
    #[arg(long, help_heading = ROBOTS, value_name = "FILE", conflicts_with = "radius")]
    pub(super) fleet: Option<PathBuf>,
    /// Radius of a robot in metres [default: the preset's footprint, or 0.3 cells]
    #[arg(long, help_heading = ROBOTS, value_name = "METRES")]
    radius: Option<f64>,
    /// Most actions that a robot has been sent and has not done
    #[arg(long, help_heading = ROBOTS, value_name = "N", default_value_t = FleetConfig::default().queue)]
    queue: u32,
    #[command(flatten)]
    disturbance: DisturbanceArgs,
    /// Close free cells where no robot is: so many per second on average, each for so long, such as 0.1,30s. The planner is
    /// called when cells close or open
    #[arg(long, help_heading = ROBOTS, value_name = "RATE,DURATION", value_parser = closing)]
    closures: Option<ClosureRate>,
    /// Side of a cell in metres
    #[arg(long, help_heading = ROBOTS, value_name = "METRES", default_value_t = SimConfig::default().cell_size_m)]
    cell_size: f64,
    /// Duration of one step of a plan in seconds, the least time of an action [default: a cell's
    /// side at the top speed of the slowest robot, or 1]
    #[arg(long, help_heading = ROBOTS, value_name = "SECONDS")]
    step: Option<f64>,
    /// Simulator ticks per second
    #[arg(long, help_heading = ROBOTS, value_name = "N", default_value_t = SimConfig::default().ticks_hz)]
    ticks_hz: u32,
    /// Substeps per tick
    #[arg(long, help_heading = ROBOTS, value_name = "N", default_value_t = SimConfig::default().substeps)]
    substeps: u32,
    /// Motion of bodies, and detection of contacts
    #[arg(long, help_heading = ROBOTS, value_parser = word::<Tier>(), default_value_t)]
    tier: Tier,
    /// Wall-clock time of a plugin for learning the map
    #[arg(long, help_heading = LIMITS, value_name = "DURATION", default_value = seconds_text(FleetConfig::default().allowance.prepare_s),
          value_parser = positive_seconds)]
    prepare_budget: f64,
    /// Wall-clock time of a call of any plugin but the planner
    #[arg(long, help_heading = LIMITS, value_name = "DURATION", default_value = seconds_text(FleetConfig::default().allowance.call_s),
          value_parser = positive_seconds)]
    call_budget: f64,
    /// Time for which the planner may go on after its limit. What it answers then is dropped, but it
    /// keeps its process and what it has learnt; whoever is still not done is killed
    #[arg(long, help_heading = LIMITS, value_name = "DURATION", default_value = seconds_text(FleetConfig::default().allowance.grace_s),
          value_parser = seconds)]
    grace: f64,
    /// Most threads a plugin may use
    #[arg(long, help_heading = LIMITS, value_name = "N", default_value_t = FleetConfig::default().allowance.threads,
          value_parser = clap::value_parser!(u32).range(1..=4096))]
    plugin_threads: u32,
    /// Most search nodes, for planners that count them [default: no limit]
    #[arg(long, help_heading = LIMITS, value_name = "N", value_parser = nodes)]
    nodes: Option<u64>,
    /// Memory of all processes of a plugin together [default: half of the machine's]
    #[arg(long, help_heading = LIMITS, value_name = "SIZE", value_parser = size)]
    memory: Option<u64>,
}

impl FleetAsked {
    /// The first of these arguments that is on the command line: a recording says all of
    /// it, and would contradict.
    fn given(matches: &ArgMatches) -> Option<String> {
        let all = Self::augment_args(clap::Command::new("fleet"));
        let given = |argument: &&Arg| {
            matches.value_source(argument.get_id().as_str()) == Some(ValueSource::CommandLine)
        };
        let first = all.get_arguments().find(given)?;
        first.get_long().map(|long| format!("--{long}"))
    }

    /// The same with the defaults of its rules.
    pub(super) fn by_its_rules(&self, matches: &ArgMatches) -> Self {
        let mut asked = self.clone();
        if asked.rules != Rules::Synchronous {
            return asked;
        }
        let is_given = |argument| matches.value_source(argument) == Some(ValueSource::CommandLine);
        if !is_given("model") && !is_given("fleet") {
            asked.model = "rotation".into();
        }
        if !is_given("motion") {
            asked.motion = match &*asked.model {
                PEBBLE => Motion::Pebble,
                _ => Motion::Rotation,
            };
        }
        if !is_given("fail_policy") {
            asked.fail_policy = vec!["all-wait".into()];
        }
        if !is_given("ticks_hz") {
            asked.ticks_hz = 10;
        }
        if !is_given("invocation") && asked.period.is_none() {
            asked.period = Some(asked.step.unwrap_or(1.0));
        }
        asked
    }
}

/// The model of discs that follow their orders exactly.
const PEBBLE: &str = "pebble";

/// A duration in seconds, which may be nothing.
fn seconds(text: &str) -> std::result::Result<f64, String> {
    let duration = humantime::parse_duration(text)
        .map_err(|_| "write a duration with its unit, such as 500ms, 10s or 10m".to_owned())?;
    Ok(duration.as_secs_f64())
}

fn seconds_text(seconds: f64) -> String {
    duration_text(Duration::from_secs_f64(seconds))
}

fn closing(text: &str) -> std::result::Result<ClosureRate, String> {
    let wrong = || "write closures per second and a duration, such as 0.1,30s".to_owned();
    let (rate, duration) = text.split_once(',').ok_or_else(wrong)?;
    Ok(ClosureRate {
        per_s: rate.parse().map_err(|_| wrong())?,
        for_s: positive_seconds(duration)?,
    })
}

fn positive_seconds(text: &str) -> std::result::Result<f64, String> {
    match seconds(text)? {
        0.0 => Err("this has to be longer than nothing".to_owned()),
        seconds => Ok(seconds),
    }
}

/// The signal that told this process to end; 0 if none did.
static SIGNAL: AtomicI32 = AtomicI32::new(0);

/// The files and plugins that a replay or a continuation needs again.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Setup {
    pub(super) map: PathBuf,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    instance: Option<PathBuf>,
    model: String,
    fleet: Option<PathBuf>,
    tasks: Option<PathBuf>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    guidance: Option<PathBuf>,
    in_process: bool,
    plugins: Vec<Plugin>,
}

impl Setup {
    /// The model of all robots; `None` for pebbles.
    pub(super) fn model(&self) -> Option<&str> {
        (self.model != PEBBLE).then_some(&*self.model)
    }
}

/// A plugin as the user names it.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Plugin {
    kind: Kind,
    name: String,
    options: Vec<String>,
}

/// Runs a fleet. `given` are the arguments as they stand on the command line.
pub(crate) fn fleet(arguments: &Fleet, given: &ArgMatches) -> Result<Exit> {
    for path in [&arguments.picture, &arguments.record]
        .into_iter()
        .flatten()
    {
        check_folder(path)?;
    }
    let recorded = arguments.replay.as_ref().or(arguments.resume.as_ref());
    if recorded.is_some()
        && let Some(given) = FleetAsked::given(given)
    {
        let message = format!("`{given}` cannot be given with --replay and --resume");
        return Err(Failure::new(Exit::Usage, message)
            .hint("all that decides about the run is in its recording"));
    }
    let asked = arguments.asked.by_its_rules(given);
    let recording = recorded.map(|path| Recording::open(path)).transpose()?;
    let mut setup = match &recording {
        Some(recording) => {
            let setup = recording.header().setup.clone();
            serde_json::from_value(setup).map_err(|error| {
                let reason = format!("`setup` is not what this command writes: {error}");
                InputError::new(recording.name(), reason)
                    .at_line(1)
                    .hint("it was not recorded by `fleetyard fleet --record`")
            })?
        }
        None => Setup {
            guidance: arguments.guidance.as_deref().map(absolute),
            ..asked_setup(&asked)?
        },
    };
    match (&arguments.map, &arguments.instance, recorded) {
        (Some(_), _, Some(_)) if setup.instance.is_some() => {
            let message = "`--map` cannot be given where an instance was recorded";
            return Err(Failure::new(Exit::Usage, message)
                .hint("name the new place of the instance with --instance"));
        }
        (_, Some(_), Some(_)) if setup.instance.is_none() => {
            let message = "`--instance` cannot be given where a map was recorded";
            return Err(
                Failure::new(Exit::Usage, message).hint("name the new place of the map with --map")
            );
        }
        (Some(map), ..) => setup.map.clone_from(map),
        (_, Some(instance), _) => setup.instance = Some(absolute(instance)),
        _ => {}
    }
    let scene = Scene::load(&setup)?;
    let grid = &scene.grid;
    let robots = robots(setup.fleet.as_deref(), setup.model())?;
    let (config, bodies) = if let Some(recording) = &recording {
        let config = recording.header().config.clone();
        let bodies = bodies(&robots, config.agents as usize, &config.sim)?;
        (config, bodies)
    } else {
        scene.remark(asked.rules);
        warn_of_cell_size(&setup.map, grid, asked.cell_size);
        asked_config(&asked, &scene, given, &robots)?
    };
    let config = with_host(config, arguments);
    if arguments.live && config.clock == Clock::Realtime {
        let message = "--live cannot be used with --clock realtime";
        return Err(Failure::new(Exit::Usage, message)
            .hint("a planner would plan on while the fleet is paused: leave out --clock"));
    }
    let guidance = setup.guidance.as_ref();
    let guidance = guidance.map(|path| load_guidance(path, grid)).transpose()?;
    let guidance = guidance.map(Arc::new);
    let ground = Ground {
        grid,
        fleet: bodies.as_ref(),
        tasks: scene.tasks.as_ref(),
        starts: scene.starts.as_deref(),
        guidance: guidance.as_ref(),
    };
    if let Some(recording) = &recording {
        about(recording);
    }
    let modules = if arguments.replay.is_some() {
        None
    } else {
        Some(modules(arguments, &scene.files, &setup, &config)?)
    };
    if let (Some(path), Some(modules)) = (&arguments.guidance, &modules) {
        let mut infos = modules.infos().into_iter();
        if !infos.any(|info| info.memory.iter().any(|part| part == GUIDANCE_ID)) {
            output::warning(&format!(
                "nobody reads {}: no plugin of the run lists `part:{GUIDANCE_ID}`",
                path.display()
            ));
        }
    }
    let mut watcher = Watcher::new(arguments, &config)?;
    let outcome = match (recording, modules) {
        (Some(recording), Some(modules)) => {
            let path = Path::new(recording.name()).to_owned();
            watcher.recorder = Some(Recorder::go_on(&path, &recording)?);
            let recording = recording.with_host(&config);
            resume(&ground, recording, modules, &mut watcher)
        }
        (Some(recording), None) => {
            let recording = recording.with_host(&config);
            replay(&ground, recording, &mut watcher)
        }
        (None, Some(modules)) => {
            if let Some(path) = &arguments.record {
                setup.map = absolute(&setup.map);
                let setup = serde_json::to_value(&setup).map_err(internal)?;
                let header = ground.header(&config, modules.infos(), setup);
                watcher.recorder = Some(Recorder::create(path, &header)?);
            }
            run(&ground, &config, modules, &mut watcher)
        }
        (None, None) => return Err(internal("there is nothing to run")),
    };
    watcher.bar.finish_and_clear();
    let outcome = outcome?;
    watcher.finish()?;
    if let Some(path) = &arguments.picture {
        draw_document(path, &picture(&outcome, grid).svg())?;
    }
    report(arguments, &outcome)?;
    let signal = SIGNAL.load(Ordering::SeqCst);
    if outcome.ended == Ended::Interrupted && signal != 0 {
        // As a shell says it of a process that a signal has ended.
        std::process::exit(128 + signal);
    }
    Ok(Exit::Success)
}

/// Map, tasks and starts of a run.
pub(super) struct Scene {
    pub(super) grid: Arc<Grid>,
    pub(super) tasks: Option<TaskList>,
    starts: Option<Vec<u32>>,
    /// Tasks that are known at a time, ticks of an action, and the presence of delays: an instance
    /// alone says so.
    reveal: Option<Revealed>,
    ticks: u32,
    delays: bool,
    /// The files that were read and are named nowhere else.
    files: Vec<PathBuf>,
}

/// Tasks that are known at a time, per robot, and the instance that says so.
struct Revealed {
    instance: PathBuf,
    per_robot: f64,
}

impl Revealed {
    fn per_robot(&self) -> Result<f64> {
        if (1.0..=1e6).contains(&self.per_robot) {
            return Ok(self.per_robot);
        }
        let reason = format!("numTasksReveal is {}", self.per_robot);
        Err(InputError::new(self.instance.display().to_string(), reason)
            .hint("write at least one known task per robot, or say it with --reveal")
            .into())
    }
}

impl Scene {
    pub(super) fn load(setup: &Setup) -> Result<Self> {
        let Some(instance) = &setup.instance else {
            let grid = Arc::new(load_map(&setup.map)?);
            let tasks = setup.tasks.as_ref();
            let tasks = tasks.map(|path| load_lorr_tasks(path, &grid));
            return Ok(Self {
                tasks: tasks.transpose()?,
                grid,
                starts: None,
                reveal: None,
                ticks: 1,
                delays: false,
                files: Vec::new(),
            });
        };
        let league = load_league(instance)?;
        Ok(Self {
            grid: Arc::new(league.grid),
            tasks: Some(league.tasks),
            starts: Some(league.starts),
            reveal: Some(Revealed {
                instance: instance.clone(),
                per_robot: league.reveal,
            }),
            ticks: league.ticks,
            delays: league.delays,
            files: league.files,
        })
    }

    /// Says what of an instance is left out.
    fn remark(&self, rules: Rules) {
        if rules != Rules::Synchronous {
            return;
        }
        if self.ticks != 1 {
            output::note(&format!(
                "an action takes a step, not the {} ticks of agentCounter",
                self.ticks
            ));
        }
        if self.delays {
            output::note("nobody is delayed: delayConfig is left out");
        }
    }
}

fn absolute(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.to_owned())
}

/// Prints remarks on a recording before it is used.
fn about(recording: &Recording) {
    let (name, header) = (recording.name(), recording.header());
    if recording.is_torn() {
        output::warning(&format!(
            "{name}: the last line is torn and is left out: the host was killed when it wrote it"
        ));
    }
    if header.fleetyard != env!("CARGO_PKG_VERSION") {
        output::warning(&format!(
            "{name}: it was recorded by version {}, this is {}",
            header.fleetyard,
            env!("CARGO_PKG_VERSION")
        ));
    }
}

/// The files and plugins that the arguments name, but for the map.
pub(super) fn asked_setup(asked: &FleetAsked) -> Result<Setup> {
    let plugin = |kind, words: &[String], options: &[String]| {
        let PluginArg { plugin, options } = PluginArg::new(words, options)?;
        Ok(Plugin {
            kind,
            name: plugin,
            options,
        })
    };
    let mut invocation_options = asked.invocation_options.clone();
    invocation_options.extend(asked.period.map(|period| format!("period_s={period}")));
    let plugins = [
        (Kind::Planner, &asked.planner, &asked.options),
        (
            Kind::InstanceGenerator,
            &asked.generator,
            &asked.generator_options,
        ),
        (
            Kind::InvocationPolicy,
            &asked.invocation,
            &invocation_options,
        ),
        (Kind::FailPolicy, &asked.fail_policy, &asked.fail_options),
    ];
    let plugins = plugins
        .into_iter()
        .map(|(kind, words, options)| plugin(kind, words, options));
    Ok(Setup {
        map: PathBuf::new(),
        instance: None,
        model: asked.model.clone(),
        fleet: asked.fleet.as_deref().map(absolute),
        tasks: asked.tasks.as_deref().map(absolute),
        guidance: None,
        in_process: asked.attach == Attach::InProcess,
        plugins: plugins.collect::<Result<_>>()?,
    })
}

/// The numbers that the arguments ask for, and the robots.
pub(super) fn asked_config(
    asked: &FleetAsked,
    scene: &Scene,
    given: &ArgMatches,
    robots: &Robots,
) -> Result<(FleetConfig, Option<Bodies>)> {
    let team = scene
        .starts
        .as_ref()
        .map_or(1, |starts| starts.len() as u32);
    let reveal_given = given.value_source("reveal") == Some(ValueSource::CommandLine);
    let reveal = scene.reveal.as_ref().filter(|_| !reveal_given);
    let reveal = reveal.map_or(Ok(asked.reveal), Revealed::per_robot)?;
    let mut config = FleetConfig {
        agents: asked.agents.unwrap_or(team),
        duration_s: asked.duration,
        window_s: asked.window,
        limit_s: asked.limit,
        clock: asked.clock,
        cut: asked.cut,
        seed: asked.seed,
        motion: asked.motion,
        queue: asked.queue,
        dwell_s: asked.dwell,
        assign: asked.assign,
        reveal,
        watchdog_s: asked.watchdog,
        closing: asked.closures,
        allowance: Allowance {
            prepare_s: asked.prepare_budget,
            call_s: asked.call_budget,
            grace_s: asked.grace,
            threads: asked.plugin_threads,
            memory_bytes: asked.memory.unwrap_or_else(half_of_memory),
            nodes: asked
                .nodes
                .unwrap_or(FleetConfig::default().allowance.nodes),
        },
        sim: SimConfig {
            cell_size_m: asked.cell_size,
            step_s: asked.step.unwrap_or(1.0),
            radius_m: asked.radius,
            ticks_hz: asked.ticks_hz,
            substeps: asked.substeps,
            tier: asked.tier,
            disturbance: asked.disturbance.with_seed(asked.seed),
            ..SimConfig::default()
        },
        ..FleetConfig::default()
    };
    let bodies = bodies(robots, config.agents as usize, &config.sim)?;
    if asked.step.is_none() {
        config.sim.step_s = fleetyard_fleet::step_s(bodies.as_ref(), asked.cell_size);
    }
    if asked.rules == Rules::Synchronous {
        config = config.synchronous();
    }
    Ok((config, bodies))
}

/// Adds the numbers of this machine, which decide about nothing.
fn with_host(mut config: FleetConfig, arguments: &Fleet) -> FleetConfig {
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    let planner = config.allowance.threads as usize;
    config.sim.threads = arguments
        .threads
        .map_or_else(|| processors.saturating_sub(planner).max(1), usize::from);
    config.sim.memory_limit_bytes = available_memory_bytes();
    config
}

/// The files that the command itself reads and writes.
fn own_files(arguments: &Fleet, setup: &Setup, more: &[PathBuf]) -> Vec<PathBuf> {
    let files = [
        &arguments.map,
        &arguments.instance,
        &arguments.record,
        &arguments.replay,
        &arguments.resume,
        &arguments.trace,
        &arguments.picture,
        &arguments.asked.tasks,
        &arguments.asked.fleet,
        &setup.guidance,
    ];
    files.into_iter().flatten().chain(more).cloned().collect()
}

/// The host of a run's plugins, for which files are hidden.
pub(super) fn host(
    config: &FleetConfig,
    startup: Duration,
    grants: &GrantArgs,
    hidden: Vec<PathBuf>,
) -> Result<Host> {
    let allowance = &config.allowance;
    let budget = BudgetOptions {
        startup,
        memory_bytes: Some(allowance.memory_bytes),
        threads: allowance.threads,
        ..BudgetOptions::default()
    };
    let sandbox = SandboxOptions {
        policy: policy(grants, hidden)?,
        output_bytes: grants.output_limit,
        trust: trust(&grants.trust)?,
        pin: false,
    };
    Host::new(BUILT_IN, budget, sandbox, true).map_err(internal)
}

/// Finds the plugins: planner, generator, invocation policy and fail policy.
pub(super) fn plugins(host: &Host, setup: &Setup) -> Result<[fleetyard_bench::Plugin; 4]> {
    let find = |kind| {
        let plugin = setup.plugins.iter().find(|plugin| plugin.kind == kind);
        let plugin = plugin.ok_or_else(|| {
            Failure::new(Exit::Input, format!("the recording names no {kind}"))
                .hint("it was not recorded by `fleetyard fleet --record`")
        })?;
        let found = find_plugin(&host.runtime, kind, &plugin.name)?;
        let in_process = setup.in_process && found.attach() == Attach::Worker;
        Ok::<_, Failure>(
            found
                .attached(in_process.then_some(Attach::InProcess))
                .with_options(GivenOptions::Texts(plugin.options.clone())),
        )
    };
    Ok([
        find(Kind::Planner)?,
        find(Kind::InstanceGenerator)?,
        find(Kind::InvocationPolicy)?,
        find(Kind::FailPolicy)?,
    ])
}

/// Starts the plugins.
fn modules(
    arguments: &Fleet,
    read: &[PathBuf],
    setup: &Setup,
    config: &FleetConfig,
) -> Result<Modules> {
    let hidden = own_files(arguments, setup, read);
    let host = host(config, arguments.startup, &arguments.grants, hidden)?;
    Ok(start_modules(
        &host.runtime,
        plugins(&host, setup)?.each_ref(),
    )?)
}

/// Lets an interrupt end runs with what they have.
pub(super) fn listen() {
    let installed = on_interrupt(|signal| SIGNAL.store(signal, Ordering::SeqCst));
    if let Err(error) = installed {
        output::warning(&format!(
            "an interrupt will end the run without results: {error}"
        ));
    }
}

/// True if a signal told this process to end.
pub(super) fn interrupted() -> bool {
    SIGNAL.load(Ordering::SeqCst) != 0
}

/// Shows the run on a terminal, keeps its records, and ends it when it is told to.
struct Watcher {
    tee: Tee,
    recorder: Option<Recorder>,
    bar: ProgressBar,
    verbose: bool,
}

impl Watcher {
    fn new(arguments: &Fleet, config: &FleetConfig) -> Result<Self> {
        let (trace, every) = (arguments.trace.as_deref(), arguments.trace_every);
        listen();
        Ok(Self {
            tee: Tee {
                trace: trace.map(|path| trace_file(path, every)).transpose()?,
                live: arguments.live.then(Live::start).transpose()?,
            },
            recorder: None,
            bar: output::bar(
                config.duration_s.ceil() as u64,
                "{bar:30} {pos}/{len} s simulated, {elapsed} elapsed  {msg}",
            ),
            verbose: arguments.verbose,
        })
    }

    fn finish(self) -> Result<()> {
        let trace = self.tee.trace;
        trace.map_or(Ok(()), |trace| keep(trace.into_inner()))
    }
}

impl Watch for Watcher {
    fn sink(&mut self) -> Option<&mut dyn TraceSink> {
        let any = self.tee.trace.is_some() || self.tee.live.is_some();
        any.then_some(&mut self.tee as &mut dyn TraceSink)
    }

    fn point(&mut self, point: &Point, rtf: f64) {
        if self.tee.live.is_some() {
            say(&Line::Point(point));
        }
        if !self.bar.is_hidden() {
            let throughput = point.goals_reached as f64 / point.time_s.max(1e-9);
            self.bar.set_position(point.time_s as u64);
            self.bar
                .set_message(format!("{throughput:.2} goals/s, RTF {rtf:.1}"));
        }
    }

    fn round(&mut self, round: &Round) -> std::result::Result<(), InputError> {
        match &mut self.recorder {
            Some(recorder) => recorder.round(round),
            None => Ok(()),
        }
    }

    fn end(&mut self, end: &End) -> std::result::Result<(), InputError> {
        match &mut self.recorder {
            Some(recorder) => recorder.end(end),
            None => Ok(()),
        }
    }

    fn interventions(&mut self) -> Vec<Intervention> {
        let live = self.tee.live.as_ref();
        live.map(Live::interventions).unwrap_or_default()
    }

    fn intervened(&mut self, intervened: &Intervened) -> std::result::Result<(), InputError> {
        if let Some(live) = &self.tee.live {
            say(&Line::Intervened {
                at_s: live.now_s(),
                what: intervened,
            });
        }
        match &mut self.recorder {
            Some(recorder) => recorder.intervened(intervened),
            None => Ok(()),
        }
    }

    fn refused(&mut self, what: Intervention, reason: &str) {
        let what = serde_json::to_string(&what).unwrap_or_default();
        say(&Line::Refused { what, reason });
    }

    fn pace(&mut self, period_s: f64) {
        if let Some(live) = &mut self.tee.live {
            live.pace(period_s);
        }
    }

    fn doubt(&mut self, notice: &Notice) {
        if self.tee.live.is_some() {
            say(&Line::Doubt(notice));
        }
        output::warning(&format!("{}: {}", notice.module, notice.message));
    }

    fn closed(&mut self, info: &ModuleInfo, closing: Closing) {
        for promise in &closing.broken_promises {
            output::warning(&format!("{}: {promise}", info.id));
        }
        if !self.verbose {
            return;
        }
        for LogLine { level, text } in &closing.log {
            eprintln!("[{} {level:?}] {}", info.id, output::plain(text));
        }
        for line in closing.stderr.lines() {
            eprintln!("[{} stderr] {}", info.id, output::plain(line));
        }
    }

    fn is_interrupted(&self) -> bool {
        interrupted() || self.tee.live.as_ref().is_some_and(Live::is_stopped)
    }
}

fn picture<'a>(outcome: &'a FleetOutcome, grid: &'a Grid) -> FleetPicture<'a> {
    let over_time = |of: fn(&Point) -> u64| {
        let points = outcome.series.iter();
        points
            .map(|point| [point.time_s, of(point) as f64])
            .collect()
    };
    let planner = outcome.modules.first().map_or("", |module| &module.id);
    FleetPicture {
        title: format!(
            "{}: {} robots, {planner}",
            outcome.map, outcome.config.agents
        ),
        grid,
        waiting_s: &outcome.waiting_s_per_cell,
        goals: over_time(|point| point.goals_reached),
        recoveries: over_time(|point| point.fail_calls),
    }
}

/// Prints what came of the run.
fn report(arguments: &Fleet, outcome: &FleetOutcome) -> Result<()> {
    match arguments.format {
        Format::Json if arguments.live => {
            output::print_json_line(&serde_json::json!({"record": outcome}))?;
        }
        Format::Json => output::print_json(outcome)?,
        Format::Text => output::print(&output::plain(&text(outcome)))?,
    }
    if outcome.ended == Ended::Interrupted {
        output::note("interrupted; these are the results until then");
        if let Some(path) = arguments.record.as_ref().or(arguments.resume.as_ref()) {
            let path = fleetyard_core::quoted(&path.display().to_string());
            output::hint(&format!("go on with `fleetyard fleet --resume {path}`"));
        }
    }
    if let Format::Text = arguments.format {
        if let Some(held) = outcome.metrics.held_back.filter(|held| *held >= 1.0) {
            output::note(&format!(
                "the planner holds back {held:.0} of {} robots on average, since too many want through the \
                 same passages: fewer robots deliver as much",
                outcome.config.agents
            ));
        }
        if let Some(late) = &outcome.metrics.late {
            output::warning(&format!(
                "{} of {} calls of the planner took longer than its limit of {}, by {:.0} % in the median, \
                 so that the fail policy decided or an earlier plan counted",
                late.calls,
                outcome.metrics.planner_calls,
                seconds_text(outcome.config.limit_s),
                100.0 * (late.time_ms.p50 / (outcome.config.limit_s * 1e3) - 1.0)
            ));
            output::hint(&format!(
                "`--limit {}` would have sufficed for 95 % of them",
                seconds_text(late.limit_s).replace(' ', "")
            ));
        }
        if let Some(excess) = outcome.metrics.planner_work().excess() {
            output::warning(&format!(
                "the planner worked when it was not asked: {excess}"
            ));
        }
        if let Some(decay) = &outcome.metrics.decay {
            output::warning(&format!(
                "throughput fell from {} goals per second in the best fifth of the run to {} in the \
                 last, in which {:.0} % of the robots stood still: they are in each other's way",
                number(decay.best_per_s),
                number(decay.last_per_s),
                100.0 * decay.still_share
            ));
            output::hint("fewer robots may reach more goals: compare with `--agents`");
        }
        for (kind, count) in &outcome.metrics.event_counts {
            let first = outcome.events.iter().find(|event| event.kind == *kind);
            if let Some(event) = first {
                output::warning(&format!(
                    "{} ({count} times, first at {} s): {}: {}",
                    kind.name(),
                    number(event.time_s),
                    event.module,
                    event.message
                ));
            }
        }
    }
    Ok(())
}

fn text(outcome: &FleetOutcome) -> String {
    let FleetOutcome {
        config,
        metrics,
        execution,
        ..
    } = outcome;
    let figures = &execution.figures;
    let mut out = String::new();
    let mut line = |label: &str, value: String| output::labelled(&mut out, label, value);
    line(
        "fleet",
        format!("{} robots on {}", config.agents, outcome.map),
    );
    for module in &outcome.modules {
        let label = module.kind.as_str().replace('-', " ");
        line(&label, format!("{} {}", module.id, module.version));
    }
    line(
        "simulated",
        format!(
            "{} s in {} s (RTF {})",
            number(figures.simulated_s),
            number(execution.wall_s),
            number(figures.rtf)
        ),
    );
    line(
        "goals",
        format!(
            "{} reached, {} per second; {} committed",
            metrics.goals_reached,
            number(metrics.throughput_per_s),
            metrics.goals_committed
        ),
    );
    if let Some(tasks) = metrics.tasks_done {
        line("tasks", format!("{tasks} done"));
    }
    if let Some(metrics) = &metrics.synchronous {
        let tasks = metrics.tasks_per_step;
        let tasks = tasks.map_or(String::new(), |tasks| {
            format!("{} tasks and ", number(tasks))
        });
        line(
            "steps",
            format!(
                "{}, of which {} had no plan of the planner; {tasks}{} goals per step",
                metrics.steps,
                metrics.unplanned,
                number(metrics.goals_per_step)
            ),
        );
    }
    line(
        "calls",
        format!(
            "{}, of which {} fell to the fail policy (ratio {}), {} to nobody",
            metrics.planner_calls,
            metrics.fail_calls,
            number(metrics.fail_policy_ratio),
            metrics.all_waits
        ),
    );
    let times = |times: &CallTimes| {
        format!(
            "{} ms mean, {} median, {} 95 %, {} max",
            number(times.mean),
            number(times.p50),
            number(times.p95),
            number(times.max)
        )
    };
    line("planner time", times(&metrics.planner_time_ms));
    if let Some(cpu) = &metrics.planner_cpu_ms {
        line("planner CPU time", times(cpu));
    }
    if let Some(between) = metrics.planner_cpu_between_calls_ms {
        line("CPU between calls", format!("{} ms", number(between)));
    }
    if metrics.fail_calls > 0 {
        line("fail policy time", times(&metrics.fail_policy_time_ms));
    }
    line(
        "standing still",
        format!("{:.1} % of robots' time", 100.0 * metrics.waiting_share),
    );
    line(
        "graph",
        format!(
            "{} actions at most, {} rings cut",
            metrics.adg_nodes_max, metrics.rings_cut
        ),
    );
    line(
        "contacts",
        format!(
            "{} ({} between robots, {} with obstacles)",
            figures.contacts, figures.contacts_agent_agent, figures.contacts_agent_obstacle
        ),
    );
    if let Some(nearest) = figures.nearest_approach_m {
        line(
            "nearest approach",
            format!(
                "{nearest:.3} m between centres (radius {:.3} m)",
                figures.radius_m
            ),
        );
    }
    line("trace digest", figures.trace_digest.to_string());
    out.push('\n');
    out.push_str(&over_time(&outcome.series));
    out
}

/// The run in at most six parts.
fn over_time(series: &[Point]) -> String {
    let parts = series.len().min(6);
    let mut before: Option<&Point> = None;
    let rows = (1..=parts).map(|part| {
        let point = &series[series.len() * part / parts - 1];
        let since = |of: fn(&Point) -> f64| of(point) - before.map_or(0.0, of);
        let seconds = since(|point| point.time_s);
        let goals = since(|point| point.goals_reached as f64);
        let row = vec![
            number(point.time_s),
            point.goals_reached.to_string(),
            format!("{:.2}", goals / seconds.max(1e-9)),
            point.waiting.to_string(),
            since(|point| point.planner_calls as f64).to_string(),
            since(|point| point.fail_calls as f64).to_string(),
        ];
        before = Some(point);
        row
    });
    output::table(
        &[
            "until s",
            "goals",
            "goals/s",
            "still",
            "calls",
            "fail policy",
        ],
        rows.collect(),
        &[0, 1, 2, 3, 4, 5],
    )
}

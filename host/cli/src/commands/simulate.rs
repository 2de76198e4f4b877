//! `fleetyard simulate`: executes a plan file.

use std::cell::Cell;
use std::fmt::Write as _;
use std::io::{self, BufWriter, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::{Args, ValueEnum};
use fleetyard_bench::{ExecutionInfo, execute, number};
use fleetyard_check::PathRule;
use fleetyard_core::formats::{
    AnyPlan, Format as FileFormat, Known, grid_size, load_plan_and_roadmap,
};
use fleetyard_core::{Grid, InputError, Roadmap, TrajectoryPlan, load_map};
use fleetyard_sim::noise::TwistNoise;
use fleetyard_sim::trace::{Header, States, Summary, TraceOptions, Waiting};
use fleetyard_sim::{
    Event, Fleet, Plan, Policy, SimConfig, SimError, Simulator, TraceSink, TraceWriter,
};
use fleetyard_view::{Picture, World};
use fleetyard_world::{Bounds, Workspace, load_workspace};
use indicatif::ProgressBar;
use serde::Serialize;

use super::task::{Report, TaskArgs};
use crate::args::{
    DisturbanceArgs, EXECUTION, Format, ROBOTS, WorldArgs, Written, disturbance, file_format,
    picture as picture_file, word,
};
use crate::exit::{Exit, Failure, Result};
use crate::files::{Unnamed, draw, keep, trace_file};
use crate::output;
use crate::setup::{bodies, check_rule, robots, sim_config, warn_of_cell_size};

/// Execute a plan in the simulator.
///
/// With --task a plan of any view is executed with the task's robots in the task's world.
#[derive(Debug, Args)]
pub(crate) struct Simulate {
    /// Map file: MovingAI, fleetyard.grid/1 or LSMART; plans on grids need one
    #[arg(long, short, value_name = "FILE")]
    map: Option<PathBuf>,
    /// Workspace with obstacles in continuous space, a fleetyard.world/1 file
    #[arg(long = "world", value_name = "FILE")]
    workspace: Option<PathBuf>,
    /// The plan, in any format that `fleetyard convert --list` lists
    plan: PathBuf,
    /// The format of the plan [default: what the file looks like]
    #[arg(long, value_name = "FORMAT", value_parser = file_format)]
    from: Option<FileFormat>,
    /// Meaning of a path on a grid: unit moves, or (bresenham, supercover) a list of cells between
    /// which the robot goes in straight lines, a cell a step
    #[arg(long, value_parser = word::<PathRule>(), default_value_t)]
    path_rule: PathRule,
    #[command(flatten)]
    task: TaskArgs,
    #[command(flatten)]
    world: WorldArgs,
    #[command(flatten)]
    robots: RobotArgs,
    #[command(flatten)]
    conduct: ConductArgs,
    /// Threads that do the work; results do not depend on it [default: one per processor]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Write the trace to a file
    #[arg(long, value_name = "FILE", value_parser = |text: &str| Written::Trace.path(text), alias = "trace-out")]
    trace: Option<PathBuf>,
    /// Ticks between the states in the trace; 0 records events only
    #[arg(long, value_name = "N", default_value_t = TraceOptions::default().every, requires = "trace")]
    trace_every: u32,
    /// Write contacts and arrivals to a file, one JSON object a line
    #[arg(long, value_name = "FILE", value_parser = |text: &str| Written::JsonLines.path(text))]
    events: Option<PathBuf>,
    /// Draw map, paths, starts and goals to a file, SVG or PNG by its name
    #[arg(long, value_name = "FILE", value_parser = picture_file)]
    picture: Option<PathBuf>,
    /// End with exit code 4 when one of these happened; several are separated by commas
    #[arg(long, value_enum, value_name = "WHAT", value_delimiter = ',')]
    fail_on: Vec<Mishap>,
    #[command(flatten)]
    format: Format,
}

/// Something in an execution that its user may not want.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Mishap {
    /// Somebody touched somebody or something
    Contacts,
    /// Two agents touched
    AgentContacts,
    /// An agent touched an obstacle, one that stands or one that moves
    ObstacleContacts,
    /// An agent did not arrive
    Unfinished,
}

/// The robots that move.
#[derive(Debug, Args)]
struct RobotArgs {
    /// Motion model or preset of all robots, such as pebble, agv, holonomic or go2;
    /// docs/execution.md lists them [default: pebble]
    #[arg(
        long,
        help_heading = ROBOTS,
        value_name = "NAME",
        conflicts_with = "fleet"
    )]
    model: Option<String>,
    /// Footprints, models and limits of all robots, a fleetyard.fleet/1 file
    #[arg(
        long,
        help_heading = ROBOTS,
        value_name = "FILE",
        conflicts_with = "radius"
    )]
    fleet: Option<PathBuf>,
}

/// The execution of the plan, and its disturbances.
#[derive(Debug, Args)]
struct ConductArgs {
    /// When a robot may go on
    #[arg(long, help_heading = EXECUTION, value_parser = word::<Policy>(), default_value_t)]
    policy: Policy,
    #[command(flatten)]
    disturbance: DisturbanceArgs,
    /// Errors of the velocities that robots are asked for: STD,TURN as a share of the speed and in
    /// radians per metre [default: none]
    #[arg(long, help_heading = EXECUTION, value_name = "STD,TURN", value_parser = disturbance::<TwistNoise>)]
    twist_noise: Option<TwistNoise>,
    /// Seconds between two exchanges of messages
    #[arg(long, help_heading = EXECUTION, value_name = "SECONDS", default_value_t = SimConfig::default().message_period_s)]
    message_period: f64,
    /// Metres that robots keep from each other's ways beyond what their controllers need
    #[arg(long, help_heading = EXECUTION, value_name = "METRES", default_value_t = SimConfig::default().margin_m)]
    margin: f64,
    /// Round the plan's corners by Bézier curves, so that no point of a robot is farther than this from
    /// where the plan has it at that time: plan with twice as much room between robots
    #[arg(long, help_heading = EXECUTION, value_name = "METRES", default_value_t = SimConfig::default().smooth_m)]
    smooth: f64,
    /// Keep the plan's order also where it leaves less room than controllers need: robots may touch
    #[arg(long, help_heading = EXECUTION)]
    tight: bool,
    /// Seed of all delays, noise and losses
    #[arg(long, help_heading = EXECUTION, value_name = "N", default_value_t = SimConfig::default().disturbance.seed)]
    seed: u64,
    /// Go on until everybody has arrived (always so with --policy adg)
    #[arg(long, help_heading = EXECUTION)]
    until_done: bool,
    /// End at this simulated time at the latest
    #[arg(long, help_heading = EXECUTION, value_name = "SECONDS")]
    time_limit: Option<f64>,
    /// Heading of robots at the start, in degrees from east, where the plan gives none
    #[arg(long, help_heading = EXECUTION, value_name = "DEGREES", allow_negative_numbers = true,
          default_value_t = SimConfig::default().start_heading_rad.to_degrees())]
    start_heading: f64,
    /// Execute also what begins with robots in obstacles or in each other
    #[arg(long, help_heading = EXECUTION)]
    allow_overlaps: bool,
}

impl ConductArgs {
    /// True if the execution goes on until all robots have arrived.
    fn goes_on(&self) -> bool {
        self.until_done || self.policy == Policy::Adg
    }
}

/// A plan with the world and the robots that execute it.
struct Scene {
    grid: Option<Grid>,
    workspace: Option<Workspace>,
    fleet: Option<Fleet>,
    /// Headings of a task's robots at their starts, where it gives them.
    headings: Vec<Option<f64>>,
    /// The same of their trailers.
    trailers: Vec<Option<f64>>,
    roadmap: Option<Arc<Roadmap>>,
    plan: AnyPlan,
    /// The plan on a grid as straight lines, if it is meant so.
    lines: Option<TrajectoryPlan>,
    /// The verdicts on a plan of a task's view.
    report: Option<Report>,
}

impl Scene {
    fn load(arguments: &Simulate, config: &SimConfig) -> Result<Self> {
        let asked = &arguments.robots;
        let others = [
            ("--map", arguments.map.is_some()),
            ("--world", arguments.workspace.is_some()),
            ("--radius", arguments.world.radius.is_some()),
            ("--fleet", asked.fleet.is_some()),
            ("--model", asked.model.is_some()),
        ];
        if let Some(task) = arguments.task.task(&others)? {
            return Self::of_task(arguments, task);
        }
        let grid = arguments.map.as_deref().map(load_map).transpose()?;
        if let (Some(map), Some(grid)) = (&arguments.map, &grid) {
            warn_of_cell_size(map, grid, config.cell_size_m);
        }
        let workspace = arguments.workspace.as_deref();
        let workspace = workspace.map(load_workspace).transpose()?;
        let (plan, roadmap) = load_plan(arguments, grid.as_ref())?;
        let lines = along_lines(arguments, grid.as_ref(), &plan, config)?;
        let robots = robots(asked.fleet.as_deref(), asked.model.as_deref())?;
        let fleet = bodies(&robots, plan_of(&plan).agents(), config)?;
        Ok(Self {
            grid,
            workspace,
            fleet,
            headings: Vec::new(),
            trailers: Vec::new(),
            roadmap,
            plan,
            lines,
            report: None,
        })
    }

    /// A plan of a view in the world of its task, by the task's robots.
    fn of_task(arguments: &Simulate, task: &Path) -> Result<Self> {
        let (plan, format) = (&arguments.plan, arguments.from);
        let judgement =
            arguments
                .task
                .judge(task, plan, format, arguments.world.step, DESCRIBED)?;
        Ok(Self {
            grid: None,
            plan: AnyPlan::Trajectories(judgement.lifted(plan)?),
            roadmap: judgement.roadmap(),
            headings: judgement.problem.start_headings(),
            trailers: judgement.problem.trailer_headings(),
            workspace: Some(judgement.problem.world),
            fleet: Some(judgement.problem.fleet),
            lines: None,
            report: Some(judgement.report),
        })
    }
}

/// Violations of either judge that are described beside an execution.
const DESCRIBED: usize = 100;

pub(crate) fn simulate(arguments: &Simulate) -> Result<Exit> {
    let config = config(arguments);
    let scene = Scene::load(arguments, &config)?;
    let mut simulator = Simulator::new(&config)
        .facing(&scene.headings)
        .towing(&scene.trailers);
    if let Some(grid) = &scene.grid {
        simulator = simulator.on_grid(grid);
    }
    if let Some(workspace) = &scene.workspace {
        simulator = simulator.in_workspace(workspace);
    }
    if let Some(fleet) = &scene.fleet {
        simulator = simulator.with_fleet(fleet);
    }
    if let Some(roadmap) = &scene.roadmap {
        simulator = simulator.over_roadmap(roadmap);
    }
    let mut sinks = Sinks::create(
        arguments.trace.as_deref(),
        arguments.trace_every,
        arguments.events.as_deref(),
        output::spinner("0 s simulated"),
    )?;
    let lines = scene.lines.as_ref();
    let executed = lines.map_or(plan_of(&scene.plan), Plan::Trajectories);
    let execution = execute(&simulator, executed, &mut sinks)
        .map_err(|error| of_plan(error, &arguments.plan))?;
    sinks.finish()?;
    if let Some(path) = &arguments.picture {
        picture(
            path,
            scene.grid.as_ref(),
            scene.workspace.as_ref(),
            (&scene.plan, scene.roadmap.as_deref()),
            config.cell_size_m,
        )?;
    }
    match arguments.format {
        Format::Json => output::print_json(&Told {
            execution: &execution,
            judged: scene.report.as_ref(),
        })?,
        Format::Text => output::print(&text(&execution, scene.report.as_ref()))?,
    }
    if execution.arrived < execution.agents && arguments.conduct.goes_on() {
        output::note(&format!(
            "only {} of {} robots arrived: the time limit was reached, or nobody moved any more",
            execution.arrived, execution.agents
        ));
    }
    let happened: Vec<String> = arguments
        .fail_on
        .iter()
        .filter_map(|mishap| happened(*mishap, &execution))
        .collect();
    if happened.is_empty() {
        return Ok(Exit::Success);
    }
    output::error(&format!("the execution had {}", happened.join(" and ")));
    Ok(Exit::InvalidPlan)
}

/// A refusal of the plan's order names the plan.
fn of_plan(error: SimError, plan: &Path) -> Failure {
    match &error {
        SimError::Gate(reason) => {
            let refused = InputError::new(plan.display().to_string(), reason.to_string());
            match reason.hint() {
                Some(hint) => refused.hint(hint).into(),
                None => refused.into(),
            }
        }
        _ => error.into(),
    }
}

/// An execution as programs read it.
#[derive(Serialize)]
struct Told<'a> {
    #[serde(flatten)]
    execution: &'a ExecutionInfo,
    #[serde(skip_serializing_if = "Option::is_none")]
    judged: Option<&'a Report>,
}

/// Number of mishaps that the user forbids, in words, if there were any.
fn happened(mishap: Mishap, execution: &ExecutionInfo) -> Option<String> {
    let figures = &execution.figures;
    let (count, what) = match mishap {
        Mishap::Contacts => (figures.contacts, "contact"),
        Mishap::AgentContacts => (figures.contacts_agent_agent, "contact between agents"),
        Mishap::ObstacleContacts => (figures.contacts_agent_obstacle, "contact with obstacles"),
        Mishap::Unfinished => (
            u64::from(execution.agents - execution.arrived),
            "robot that did not arrive",
        ),
    };
    let what = match count {
        0 => return None,
        1 => what.to_owned(),
        _ => what
            .replacen("contact", "contacts", 1)
            .replacen("robot", "robots", 1),
    };
    Some(format!("{count} {what}"))
}

/// The plan, of which one on a grid has to fit the map, and the roadmap that it goes along.
fn load_plan(arguments: &Simulate, grid: Option<&Grid>) -> Result<(AnyPlan, Option<Arc<Roadmap>>)> {
    let (path, format) = (&arguments.plan, arguments.from);
    let (plan, roadmap) = load_plan_and_roadmap(path, format, Known::size(grid.map(grid_size)))?;
    if let AnyPlan::Grid(file) = &plan {
        let Some(grid) = grid else {
            let name = arguments.plan.display().to_string();
            return Err(
                InputError::new(name, "a plan on a grid needs the map that it is for")
                    .hint("name the map with --map")
                    .into(),
            );
        };
        file.check_map(grid)?;
    }
    Ok((plan, roadmap))
}

/// A plan on a grid whose cells are joined by straight lines, if it is meant so.
fn along_lines(
    arguments: &Simulate,
    grid: Option<&Grid>,
    plan: &AnyPlan,
    config: &SimConfig,
) -> Result<Option<TrajectoryPlan>> {
    let rule = arguments.path_rule;
    let (AnyPlan::Grid(file), Some(grid)) = (plan, grid) else {
        return Ok(None);
    };
    if rule == PathRule::Steps {
        return Ok(None);
    }
    check_rule(rule, file.plan.agents())?;
    let lines = TrajectoryPlan::along_lines(&file.plan, grid, config.cell_size_m, config.step_s)
        .map_err(|error| InputError::new(file.source.as_str(), error.to_string()))?;
    Ok(Some(lines))
}

fn plan_of(plan: &AnyPlan) -> Plan<'_> {
    match plan {
        AnyPlan::Grid(file) => Plan::Grid(&file.plan),
        AnyPlan::Trajectories(file) => Plan::Trajectories(&file.plan),
    }
}

fn config(arguments: &Simulate) -> SimConfig {
    let conduct = &arguments.conduct;
    let mut config = SimConfig {
        policy: conduct.policy,
        message_period_s: conduct.message_period,
        margin_m: conduct.margin,
        smooth_m: conduct.smooth,
        tight: conduct.tight,
        until_done: conduct.until_done,
        time_limit_s: conduct.time_limit,
        start_heading_rad: conduct.start_heading.to_radians(),
        overlapping_starts: conduct.allow_overlaps,
        memory_limit_bytes: available_memory_bytes(),
        threads: arguments.threads.map_or_else(
            || std::thread::available_parallelism().map_or(1, usize::from),
            usize::from,
        ),
        ..sim_config(&arguments.world)
    };
    config.disturbance = conduct.disturbance.with_seed(conduct.seed);
    config.disturbance.twist = conduct.twist_noise.unwrap_or_default();
    config
}

/// Memory in bytes that the kernel could give without swapping, where it tells.
pub(super) fn available_memory_bytes() -> Option<u64> {
    let meminfo = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = meminfo
        .lines()
        .find_map(|line| line.strip_prefix("MemAvailable:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib << 10)
}

fn picture(
    path: &Path,
    grid: Option<&Grid>,
    workspace: Option<&Workspace>,
    (plan, roadmap): (&AnyPlan, Option<&Roadmap>),
    cell_size_m: f64,
) -> Result<()> {
    let world = match (grid, workspace) {
        (None, Some(workspace)) => World::of_workspace(workspace),
        (Some(grid), None) => World::of_grid(grid, cell_size_m),
        (Some(grid), Some(workspace)) => World::of_grid(grid, cell_size_m).workspace(workspace),
        (None, None) => World {
            name: String::new(),
            bounds: bounds(plan, roadmap),
            cells: None,
            polygons: Vec::new(),
            outline: Vec::new(),
            roadmap: Vec::new(),
        },
    };
    let world = match roadmap {
        Some(roadmap) => world.roadmap(roadmap),
        None => world,
    };
    let picture = Picture::new(&world);
    let picture = match (plan, grid) {
        (AnyPlan::Grid(file), Some(grid)) => picture.plan(grid, &file.plan),
        (AnyPlan::Trajectories(file), _) => picture.trajectories(&file.plan),
        (AnyPlan::Grid(_), None) => picture,
    };
    draw(path, &picture)
}

/// The area of a plan without a map, with its roadmap, and a metre around it.
fn bounds(plan: &AnyPlan, roadmap: Option<&Roadmap>) -> Bounds {
    let mut points = Vec::new();
    for [x, y] in roadmap.into_iter().flat_map(Roadmap::lines).flatten() {
        points.push([x - 1.0, y - 1.0]);
        points.push([x + 1.0, y + 1.0]);
    }
    if let AnyPlan::Trajectories(file) = plan {
        for knots in file.plan.paths() {
            for (x, y) in knots.x_m.iter().zip(knots.y_m) {
                points.push([x - 1.0, y - 1.0]);
                points.push([x + 1.0, y + 1.0]);
            }
        }
    }
    Bounds::of(&points)
}

/// Receivers of the progress of an execution: files and a terminal.
pub(super) struct Sinks {
    trace: Option<TraceWriter<BufWriter<Unnamed>>>,
    events: Option<BufWriter<Unnamed>>,
    bar: ProgressBar,
    /// Ticks per second, once they are known.
    ticks_hz: Cell<f64>,
}

impl Sinks {
    /// A trace with the states of every so many ticks, and events.
    pub(super) fn create(
        trace: Option<&Path>,
        every: u32,
        events: Option<&Path>,
        bar: ProgressBar,
    ) -> Result<Self> {
        Ok(Self {
            trace: trace.map(|path| trace_file(path, every)).transpose()?,
            events: events.map(Unnamed::beside).transpose()?,
            bar,
            ticks_hz: Cell::new(1.0),
        })
    }

    pub(super) fn finish(self) -> Result<()> {
        self.bar.finish_and_clear();
        self.events.map_or(Ok(()), keep)?;
        let trace = self.trace.map(TraceWriter::into_inner);
        trace.map_or(Ok(()), keep)
    }
}

impl TraceSink for Sinks {
    fn wants_scene(&self) -> bool {
        self.trace.is_some()
    }

    fn wants_state(&self, tick: u64) -> bool {
        // Called at every tick, which is often enough to say where things are.
        if tick.is_multiple_of(64) && !self.bar.is_hidden() {
            let seconds = tick as f64 / self.ticks_hz.get();
            self.bar.set_message(format!("{seconds:.0} s simulated"));
        }
        let trace = self.trace.as_ref();
        trace.is_some_and(|trace| trace.wants_state(tick))
    }

    fn begin(&mut self, header: &Header) -> io::Result<()> {
        self.ticks_hz.set(f64::from(header.ticks_hz));
        match &mut self.trace {
            Some(trace) => trace.begin(header),
            None => Ok(()),
        }
    }

    fn state(&mut self, tick: u64, states: &States<'_>) -> io::Result<()> {
        match &mut self.trace {
            Some(trace) => trace.state(tick, states),
            None => Ok(()),
        }
    }

    fn events(&mut self, events: &[Event]) -> io::Result<()> {
        if let Some(file) = &mut self.events {
            for event in events {
                serde_json::to_writer(&mut *file, event)?;
                file.write_all(b"\n")?;
            }
        }
        match &mut self.trace {
            Some(trace) => trace.events(events),
            None => Ok(()),
        }
    }

    fn waits(&mut self, changes: &[Waiting]) -> io::Result<()> {
        match &mut self.trace {
            Some(trace) => trace.waits(changes),
            None => Ok(()),
        }
    }

    fn end(&mut self, summary: &Summary) -> io::Result<()> {
        if let Some(file) = &mut self.events {
            file.flush()?;
        }
        match &mut self.trace {
            Some(trace) => trace.end(summary),
            None => Ok(()),
        }
    }
}

fn text(execution: &ExecutionInfo, report: Option<&Report>) -> String {
    let figures = &execution.figures;
    let mut out = String::new();
    if let Some(report) = report {
        let _ = writeln!(out, "plan              {}", report.summary());
    }
    let (simulated, rtf) = (number(figures.simulated_s), number(figures.rtf));
    let wall = number(execution.wall_ms);
    // Writing to a string cannot fail.
    let _ = writeln!(
        out,
        "simulated         {simulated} s in {wall} ms (RTF {rtf})"
    );
    let _ = match execution.makespan_s {
        Some(makespan) => writeln!(
            out,
            "arrived           all {}, the last at {} s",
            execution.agents,
            number(makespan)
        ),
        None => writeln!(
            out,
            "arrived           {} of {}",
            execution.arrived, execution.agents
        ),
    };
    let _ = writeln!(
        out,
        "contacts          {} ({} between agents, {} with obstacles)",
        figures.contacts, figures.contacts_agent_agent, figures.contacts_agent_obstacle
    );
    if let Some(nearest) = figures.nearest_approach_m {
        let radius = figures.radius_m;
        let _ = writeln!(
            out,
            "nearest approach  {nearest:.3} m between centres (radius {radius:.3} m)"
        );
    }
    let _ = writeln!(
        out,
        "tracking error    {:.4} m at most",
        execution.tracking_error_max_m
    );
    if let Some(angle) = execution.tracking_error_max_rad {
        let degrees = angle.to_degrees();
        let _ = writeln!(out, "heading error     {degrees:.2}° at most");
    }
    let _ = write!(out, "trace digest      {}", figures.trace_digest);
    out
}

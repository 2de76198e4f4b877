//! `fleetyard maps guide`: searches for a guidance graph with which a fleet reaches more goals.

use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use clap::{ArgMatches, Args};
use fleetyard_abi::Guidance;
use fleetyard_abi::c::GUIDANCE_ID;
use fleetyard_bench::statistics::{Interval, mean, mean_interval};
use fleetyard_bench::{BudgetOptions, Host, Plugin, number, start_modules};
use fleetyard_core::{Grid, save_guidance};
use fleetyard_fleet::guide::{Cmaes, PARAMETERS, UpdateModel, Usage};
use fleetyard_fleet::{Ended, EventKind, FleetConfig, Ground, Watch, run};
use fleetyard_sim::Fleet as Bodies;
use serde::Serialize;

use super::fleet::{
    FleetAsked, Scene, asked_config, asked_setup, host, interrupted, listen, plugins,
};
use super::run::check_folder;
use crate::args::{Format, GrantArgs, LIMITS, duration, duration_text};
use crate::exit::{Exit, Failure, Result, internal};
use crate::output;
use crate::setup::robots;

/// Standard deviation of the update model's parameters at first.
const SIGMA: f64 = 0.2;

/// Seeds of tests are so far from the first one of the search.
const TEST_SEEDS: u64 = 1 << 32;

/// Search for a guidance graph of a map: factors on what moves and waits cost, with which a fleet
/// reaches more goals (Zhang et al., IJCAI 2024).
///
/// Fleets are simulated, and what they did is made factors by a model with a few parameters, for which
/// CMA-ES searches. At the end fleets with and without the factors are compared on seeds that the search
/// has not seen. The same arguments make the same file on any number of threads, as long as the planner
/// keeps its limit. After an interrupt the file has the factors of the last whole generation.
#[derive(Debug, Args)]
#[command(
    mut_arg("agents", |arg| arg.required(true).help("Number of robots")),
    mut_arg("planner", |arg| arg.default_value("pibt")),
)]
pub(crate) struct Guide {
    /// Map file: MovingAI, fleetyard.grid/1 or LSMART
    #[arg(long, short, value_name = "FILE")]
    map: PathBuf,
    #[command(flatten)]
    asked: FleetAsked,
    /// File to write [default: the map's name with .guidance.json, in the current folder]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Number of parameters that are tried
    #[arg(long, value_name = "N", default_value_t = 120, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    evaluations: u32,
    /// Fleets that are simulated for each of them
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..=1000))]
    runs: u32,
    /// Searches one after the other, each from what fleets do with the factors of the last
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=100))]
    updates: u32,
    /// Pairs of fleets, with and without the factors, that are compared at the end
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(2..=10_000))]
    tests: u32,
    #[command(flatten)]
    format: Format,
    /// Fleets that are simulated at a time; results do not depend on it [default: a processor each]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Time in which a plugin has to start and be made
    #[arg(long, help_heading = LIMITS, value_name = "DURATION", value_parser = duration,
          default_value = duration_text(BudgetOptions::default().startup))]
    startup: Duration,
    #[command(flatten)]
    grants: GrantArgs,
}

/// Searches, compares and writes. `given` are the arguments as they stand on the command line.
pub(crate) fn guide(arguments: &Guide, given: &ArgMatches) -> Result<Exit> {
    let asked = arguments.asked.by_its_rules(given);
    let mut setup = asked_setup(&asked)?;
    setup.map.clone_from(&arguments.map);
    let scene = Scene::load(&setup)?;
    let model = setup.model();
    let robots = robots(asked.fleet.as_deref(), model)?;
    let (mut config, bodies) = asked_config(&asked, &scene, given, &robots)?;
    // Fleets run beside each other.
    config.sim.threads = 1;
    let out = arguments
        .out
        .clone()
        .unwrap_or_else(|| PathBuf::from(format!("{}.guidance.json", scene.grid.name())));
    check_folder(&out)?;
    let hidden = [
        Some(arguments.map.clone()),
        Some(out.clone()),
        asked.tasks.clone(),
        asked.fleet.clone(),
    ];
    let hidden = hidden.into_iter().flatten().collect();
    let host = host(&config, arguments.startup, &arguments.grants, hidden)?;
    listen();
    let threads = arguments.threads.map_or_else(
        || std::thread::available_parallelism().map_or(1, NonZero::get),
        usize::from,
    );
    let yard = Yard {
        plugins: plugins(&host, &setup)?,
        host,
        scene: &scene,
        bodies,
        config,
        threads,
        late: AtomicUsize::new(0),
    };
    let guidance = match search(arguments, &yard, &out)? {
        Some(guidance) => Arc::new(guidance),
        None => return Ok(Exit::Interrupted),
    };
    let seeds = (0..u64::from(arguments.tests)).map(|at| yard.seed(TEST_SEEDS + at));
    let jobs = seeds.flat_map(|seed| [(None, seed), (Some(Arc::clone(&guidance)), seed)]);
    let Some(driven) = yard.drive_all(&jobs.collect::<Vec<_>>())? else {
        output::note(&format!(
            "interrupted before the comparison; {} is whole",
            out.display()
        ));
        return Ok(Exit::Interrupted);
    };
    let late = yard.late.load(Ordering::Relaxed);
    if late > 0 {
        output::warning(&format!(
            "the planner was late or failed in {late} runs: the same command may find other factors"
        ));
        output::hint("raise `--limit`, or take fewer `--threads`");
    }
    let comparison = Comparison::of(arguments, &yard, &driven, &out);
    match arguments.format {
        Format::Json => output::print_json(&comparison)?,
        Format::Text => output::print(&output::plain(&comparison.text()))?,
    }
    if !comparison.better {
        output::warning(
            "the guidance is not better: the interval of the difference has 0 or less in it",
        );
        output::hint("try more `--evaluations` and `--runs`, or longer ones, or do without");
    }
    Ok(Exit::Success)
}

/// The place where fleets are simulated.
struct Yard<'a> {
    host: Host,
    plugins: [Plugin; 4],
    scene: &'a Scene,
    bodies: Option<Bodies>,
    config: FleetConfig,
    threads: usize,
    /// Runs in which the planner was late or failed.
    late: AtomicUsize,
}

/// The result of a run.
struct Driven {
    throughput_per_s: f64,
    moves: Vec<u32>,
    waiting_s: Vec<f64>,
}

/// A run to be made: its guidance and its seed.
type Job = (Option<Arc<Guidance>>, u64);

/// Ends runs when the command is told to end.
struct UntilInterrupted;

impl Watch for UntilInterrupted {
    fn is_interrupted(&self) -> bool {
        interrupted()
    }
}

impl Yard<'_> {
    fn grid(&self) -> &Grid {
        &self.scene.grid
    }

    /// The seed of a run, by its number.
    fn seed(&self, number: u64) -> u64 {
        self.config.seed.wrapping_add(number)
    }

    /// Makes a run; `None` if it was interrupted.
    fn drive(&self, (guidance, seed): &Job) -> Result<Option<Driven>> {
        let mut config = self.config.clone();
        config.seed = *seed;
        config.sim.disturbance.seed = *seed;
        let modules = start_modules(&self.host.runtime, self.plugins.each_ref())?;
        let ground = Ground {
            grid: &self.scene.grid,
            fleet: self.bodies.as_ref(),
            tasks: self.scene.tasks.as_ref(),
            starts: None,
            guidance: guidance.as_ref(),
        };
        let planner = modules.planner.info();
        if !planner.memory.iter().any(|part| part == GUIDANCE_ID) {
            let message = format!("planner `{}` reads no guidance", planner.name);
            return Err(Failure::new(Exit::NoPlan, message).hint(format!(
                "take `pibt` or `epibt`, or another that lists `part:{GUIDANCE_ID}`"
            )));
        }
        let outcome = run(&ground, &config, modules, &mut UntilInterrupted)?;
        let faults = &outcome.metrics.event_counts;
        if faults.contains_key(&EventKind::PlannerFault) {
            self.late.fetch_add(1, Ordering::Relaxed);
        }
        Ok((outcome.ended == Ended::Duration).then_some(Driven {
            throughput_per_s: outcome.metrics.throughput_per_s,
            moves: outcome.moves,
            waiting_s: outcome.waiting_s_per_cell,
        }))
    }

    /// Makes runs, several at a time; their results in the order of the jobs, `None` if some were
    /// interrupted.
    fn drive_all(&self, jobs: &[Job]) -> Result<Option<Vec<Driven>>> {
        let next = AtomicUsize::new(0);
        let results: Vec<Mutex<Option<Result<Option<Driven>>>>> =
            jobs.iter().map(|_| Mutex::new(None)).collect();
        let work = || {
            while let Some(at) =
                Some(next.fetch_add(1, Ordering::Relaxed)).filter(|at| *at < jobs.len())
            {
                if interrupted() {
                    break;
                }
                let result = self.drive(&jobs[at]);
                if result.is_err() {
                    // Others would only fail as well.
                    next.store(jobs.len(), Ordering::Relaxed);
                }
                *results[at].lock().unwrap_or_else(PoisonError::into_inner) = Some(result);
            }
        };
        std::thread::scope(|scope| {
            for _ in 1..self.threads.min(jobs.len()) {
                scope.spawn(work);
            }
            work();
        });
        let results: Vec<_> = results
            .into_iter()
            .map(|result| result.into_inner().unwrap_or_else(PoisonError::into_inner))
            .collect();
        let mut driven = Vec::with_capacity(jobs.len());
        let mut complete = true;
        for result in results {
            match result {
                Some(Ok(Some(run))) => driven.push(run),
                Some(Err(failure)) => return Err(failure),
                Some(Ok(None)) | None => complete = false,
            }
        }
        if !complete && !interrupted() {
            return Err(internal("a run ended before its time"));
        }
        Ok(complete.then_some(driven))
    }
}

/// Searches, and keeps the factors found so far in the file; `None` if it was interrupted.
fn search(arguments: &Guide, yard: &Yard<'_>, out: &Path) -> Result<Option<Guidance>> {
    let grid = yard.grid();
    let cells = grid.cell_count() as usize;
    let runs = u64::from(arguments.runs);
    let mut numbers = 0_u64..;
    let mut seeds = || -> Vec<u64> {
        numbers
            .by_ref()
            .take(runs as usize)
            .map(|at| yard.seed(at))
            .collect()
    };
    let bar = output::bar(
        arguments.evaluations.into(),
        "{bar:30} {pos}/{len} evaluations, {elapsed} elapsed  {msg}",
    );
    let model = UpdateModel::new(grid);
    let mut found = Guidance::neutral(4 * cells, cells);
    let mut written = false;
    let interrupted = |written: bool| {
        bar.finish_and_clear();
        if written {
            output::note(&format!(
                "interrupted; {} has the factors of the last whole generation, which are not tested",
                out.display()
            ));
        } else {
            output::note("interrupted; nothing was found so far");
        }
        Ok(None)
    };
    let mut left = arguments.evaluations;
    for update in 0..arguments.updates {
        let before = Arc::new(found.clone());
        let jobs: Vec<Job> = seeds()
            .into_iter()
            .map(|seed| (Some(Arc::clone(&before)), seed))
            .collect();
        let Some(driven) = yard.drive_all(&jobs)? else {
            return interrupted(written);
        };
        let mut usage = Usage::none(cells);
        for run in &driven {
            usage.add(&run.moves, &run.waiting_s);
        }
        let throughput = |driven: &[Driven]| {
            driven.iter().map(|run| run.throughput_per_s).sum::<f64>() / driven.len() as f64
        };
        let begun = throughput(&driven);
        let seed = yard.seed(u64::from(update));
        let mut search = Cmaes::new(PARAMETERS, SIGMA, seed);
        // What is left over is the last one's.
        let mut share = left / (arguments.updates - update);
        while share > 0 {
            let mut points = search.ask();
            points.truncate(share as usize);
            let evaluated = points.len() as u32;
            (share, left) = (share - evaluated, left - evaluated);
            let seeds = seeds();
            let jobs: Vec<Job> = points
                .iter()
                .flat_map(|point| {
                    let guidance = Arc::new(model.guidance(&before, &usage, point));
                    seeds
                        .iter()
                        .map(move |seed| (Some(Arc::clone(&guidance)), *seed))
                })
                .collect();
            let Some(driven) = yard.drive_all(&jobs)? else {
                return interrupted(written);
            };
            let values: Vec<f64> = driven.chunks(seeds.len()).map(throughput).collect();
            search.tell(&points, &values);
            // Values are noisy: the middle is worth more than the luckiest point.
            found = model.guidance(&before, &usage, search.mean());
            save_guidance(&found, grid, out)?;
            written = true;
            bar.inc(evaluated.into());
            let best = values.iter().copied().fold(f64::MIN, f64::max);
            let state = format!(
                "{} goals/s on average, {} at best, {} before",
                number(mean(&values).unwrap_or(0.0)),
                number(best),
                number(begun)
            );
            if bar.is_hidden() {
                let done = arguments.evaluations - left;
                eprintln!("{done}/{} evaluations: {state}", arguments.evaluations);
            } else {
                bar.set_message(state);
            }
        }
    }
    bar.finish_and_clear();
    Ok(Some(found))
}

/// A mean with its 95 % interval.
#[derive(Debug, Clone, Copy, Serialize)]
struct Estimate {
    mean: f64,
    low: f64,
    high: f64,
}

impl Estimate {
    fn of(values: &[f64]) -> Self {
        let mean = mean(values).unwrap_or(0.0);
        let Interval { low, high } = mean_interval(values).unwrap_or(Interval {
            low: mean,
            high: mean,
        });
        Self { mean, low, high }
    }

    fn text(&self) -> String {
        let Self { mean, low, high } = self;
        format!("{mean:.3} [{low:.3}, {high:.3}]")
    }
}

/// Fleets with and without the factors, on seeds that the search has not seen.
#[derive(Debug, Serialize)]
struct Comparison {
    map: String,
    agents: u32,
    planner: String,
    file: PathBuf,
    evaluations: u32,
    runs: u32,
    updates: u32,
    simulated_s: f64,
    tests: u32,
    /// Goals per second.
    without: Estimate,
    with: Estimate,
    /// Of the runs with the same seed.
    difference: Estimate,
    /// True if the interval of the difference is above 0.
    better: bool,
}

impl Comparison {
    fn of(arguments: &Guide, yard: &Yard<'_>, driven: &[Driven], out: &Path) -> Self {
        let pairs = driven.as_chunks::<2>().0.iter();
        let pairs: Vec<[f64; 2]> = pairs
            .map(|pair| pair.each_ref().map(|run| run.throughput_per_s))
            .collect();
        let column = |of: &dyn Fn(&[f64; 2]) -> f64| -> Vec<f64> { pairs.iter().map(of).collect() };
        let difference = Estimate::of(&column(&|[without, with]| with - without));
        Self {
            map: yard.grid().name().to_owned(),
            agents: yard.config.agents,
            planner: arguments.asked.planner.join(" "),
            file: out.to_owned(),
            evaluations: arguments.evaluations,
            runs: arguments.runs,
            updates: arguments.updates,
            simulated_s: yard.config.duration_s,
            tests: arguments.tests,
            without: Estimate::of(&column(&|pair| pair[0])),
            with: Estimate::of(&column(&|pair| pair[1])),
            difference,
            better: difference.low > 0.0,
        }
    }

    fn text(&self) -> String {
        let mut out = String::new();
        let mut line = |label: &str, value: String| output::labelled(&mut out, label, value);
        line(
            "map",
            format!("{}, {} robots, {}", self.map, self.agents, self.planner),
        );
        line(
            "search",
            format!(
                "{} evaluations of {} runs over {} s",
                self.evaluations, self.runs, self.simulated_s
            ),
        );
        line("goals/s without", self.without.text());
        line("goals/s with", self.with.text());
        let change = 100.0 * self.difference.mean / self.without.mean.max(1e-9);
        line(
            "difference",
            format!(
                "{} ({change:+.1} %), of {} pairs",
                self.difference.text(),
                self.tests
            ),
        );
        line("file", self.file.display().to_string());
        out
    }
}

//! Plans of robots with dynamics: `sampling PLANNER TASKS [N [SECONDS [SEED [TOLERANCE [OPTIONS]]]]]` for the first N robots of a file
//! of tasks in the plane, or for `corridor`, `congested` or `empty` of K-CBS's authors, with a goal tolerance in m and rad, and
//! options as JSON. Prints a line for each plan, and figures; seconds are those of the processor.

#[path = "../../bundle/tests/it/kinodynamic/tasks.rs"]
mod tasks;

use std::error::Error;
use std::fs;
use std::sync::Arc;

use fleetyard_abi::sdk::{Failure, Options, Planner, Plugin, Rejected, Sink};
use fleetyard_abi::{Budget, LogLevel, PlanRef, Request, monotonic_ns};
use fleetyard_plugin_kinodynamic::plugin::db_astar::DbAstar;
use fleetyard_plugin_kinodynamic::plugin::db_cbs::DbCbs;
use fleetyard_plugin_kinodynamic::plugin::db_lacam::DbLacam;
use fleetyard_plugin_kinodynamic::plugin::k_cbs::KCbs;
use fleetyard_plugin_kinodynamic::plugin::rrt_star::RrtStar;
use fleetyard_plugin_kinodynamic::plugin::sst::Sst;

/// Prints what a planner says, for so many seconds.
struct Lines(f64);

/// Seconds that the processor has worked for this thread.
fn spent() -> f64 {
    let told = fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let nanoseconds = told.split(' ').next().and_then(|word| word.parse().ok());
    nanoseconds.map_or(0.0, |nanoseconds: f64| nanoseconds / 1e9)
}

impl Sink for Lines {
    fn submit_plan(&self, plan: PlanRef<'_>) -> Result<(), Rejected> {
        if let PlanRef::Trajectories(plan) = plan
            && let Some(controls) = plan.controls
        {
            let seconds: f64 = controls.durations_s().iter().flatten().sum();
            println!("{:.4} s: {seconds:.6} s", spent());
        }
        Ok(())
    }
    fn submit_request(&self, _: &Request) -> Result<(), Rejected> {
        Err(Rejected::Malformed)
    }
    fn metric(&self, name: &str, value: f64) {
        println!("{name} {value}");
    }
    fn note(&self, name: &str, text: &str) {
        println!("{name} {text}");
    }
    fn log(&self, _: LogLevel, text: &str) {
        println!("{text}");
    }
    fn progress(&self, _: u64, _: u64) {}
    fn cancelled(&self) -> bool {
        spent() >= self.0
    }
}

/// Plans, and says what became of it.
fn plan<P: Plugin + Planner>(
    problem: &tasks::Problem,
    seconds: f64,
    seed: u64,
    options: &str,
) -> Result<(), Box<dyn Error>> {
    let lines = Lines(seconds);
    let mut budget = Budget::lasting(monotonic_ns(), u64::MAX / 2);
    budget.seed = seed;
    let failed = |failure: Failure| failure.message;
    let mut planner = P::create(Options::new(options)).map_err(failed)?;
    let environment = Arc::new(problem.environment());
    let mut map = planner
        .prepare(&environment, &budget, &lines)
        .map_err(failed)?;
    if let Err(failure) = planner.plan(&mut map, &problem.instance, &budget, &lines) {
        println!("{:?}: {}", failure.status, failure.message);
    }
    println!("{:.4} s in all", spent());
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [planner, file, rest @ ..] = words.as_slice() else {
        return Err("sampling PLANNER TASKS [N [SECONDS [SEED [TOLERANCE [OPTIONS]]]]]".into());
    };
    let number = |at: usize, default| rest.get(at).map_or(Ok(default), |word| word.parse());
    let (count, seconds, seed) = (number(0, 1.0)?, number(1, 2.0)?, number(2, 1.0)?);
    let problem = match tasks::Problem::of_k_cbs(file) {
        Some(problem) => problem,
        None => tasks::Problem::read(file.as_ref(), count as usize)?.within(number(3, 1e-6)?),
    };
    let options = rest.get(4).map_or("{}", String::as_str);
    match &**planner {
        "db-astar" => plan::<DbAstar>(&problem, seconds, seed as u64, options),
        "db-cbs" => plan::<DbCbs>(&problem, seconds, seed as u64, options),
        "db-lacam" => plan::<DbLacam>(&problem, seconds, seed as u64, options),
        "rrt-star" => plan::<RrtStar>(&problem, seconds, seed as u64, options),
        "k-cbs" => plan::<KCbs>(&problem, seconds, seed as u64, options),
        "sst" => plan::<Sst>(&problem, seconds, seed as u64, options),
        other => Err(format!("there is no planner `{other}` here").into()),
    }
}

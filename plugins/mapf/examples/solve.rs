//! Solves a MovingAI scenario and prints the sum of costs and the makespan:
//! `solve MAP SCEN AGENTS [--first] [--seconds S] [--seed K] [--nodes N] [--samples K] [--threads T]
//! [--margin M] [--pibt] [--cpu] [--check] [--trace]`.

use std::error::Error;
use std::time::{Duration, Instant};

use fleetyard_abi::GridPlan;
use fleetyard_plugin_mapf::{Algorithm, Observer, Options, Outcome};

#[path = "../../bundle/tests/it/mapf/support.rs"]
mod support;

struct Console {
    begin: Instant,
    limit: Duration,
    trace: bool,
    /// Count this process's processor time (Linux) instead of wall time.
    cpu: bool,
}

impl Console {
    fn elapsed(&self) -> Duration {
        if self.cpu
            && let Ok(text) = std::fs::read_to_string("/proc/self/schedstat")
            && let Some(Ok(nanos)) = text.split(' ').next().map(str::parse)
        {
            return Duration::from_nanos(nanos);
        }
        self.begin.elapsed()
    }
}

impl Observer for Console {
    fn incumbent(&mut self, _: &GridPlan, sum_of_costs: u64) {
        if self.trace {
            println!(
                "incumbent {sum_of_costs} at {:.3} s",
                self.elapsed().as_secs_f64()
            );
        }
    }
    fn stop(&mut self) -> bool {
        self.elapsed() >= self.limit
    }
    fn metric(&mut self, name: &str, value: f64) {
        if self.trace {
            println!("{name} {value} at {:.3} s", self.elapsed().as_secs_f64());
        }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut words = Vec::new();
    let mut options = Options::default();
    let mut console = Console {
        begin: Instant::now(),
        limit: Duration::from_secs(10),
        trace: false,
        cpu: false,
    };
    let mut seed = 0;
    let mut check = false;
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().ok_or("an option lacks its value");
        match argument.as_str() {
            "--first" => options.anytime = false,
            "--pibt" => options.algorithm = Algorithm::Pibt,
            "--trace" => console.trace = true,
            "--cpu" => console.cpu = true,
            "--check" => check = true,
            "--seconds" => console.limit = Duration::from_secs_f64(value()?.parse()?),
            "--seed" => seed = value()?.parse()?,
            "--nodes" => options.node_limit = Some(value()?.parse()?),
            "--threads" => options.threads = value()?.parse()?,
            "--samples" => options.samples = value()?.parse()?,
            "--margin" => {
                let margin: i64 = value()?.parse()?;
                options.scatter_margin = u32::try_from(margin).ok();
            }
            _ => words.push(argument),
        }
    }
    let [map, scen, agents] = words.as_slice() else {
        return Err("give a map, a scenario and a number of agents".into());
    };
    let problem = fleetyard_testkit::Case::read(map.as_ref(), scen.as_ref(), agents.parse()?)?;
    match support::solve(&problem, &options, seed, &mut console)? {
        Outcome::Solved {
            plan,
            sum_of_costs,
            lower_bound,
        } => {
            println!(
                "soc={sum_of_costs} makespan={} lb={lower_bound}",
                plan.horizon()
            );
            if check {
                support::verify(&problem, &plan)?;
                println!("valid");
            }
        }
        Outcome::Infeasible => println!("infeasible"),
        Outcome::GaveUp(limit) => println!("gave up: {limit:?}"),
    }
    Ok(())
}

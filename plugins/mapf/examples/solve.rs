//! Solves a MovingAI scenario and prints the sum of costs and the makespan:
//! `solve MAP SCEN AGENTS [--first] [--seconds S] [--seed K] [--nodes N] [--samples K] [--threads T]
//! [--margin M] [--pibt] [--check] [--trace]`.

use std::error::Error;
use std::time::{Duration, Instant};

use fleetyard_plugin_mapf::{Algorithm, Observer, Options, Outcome, Plan, Problem, solve};

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
    fn incumbent(&mut self, _: &Plan, sum_of_costs: u64) {
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
    let problem = read(map, scen, agents.parse()?)?;
    match solve(&problem, &options, seed, &mut console)? {
        Outcome::Solved {
            plan,
            sum_of_costs,
            lower_bound,
        } => {
            println!(
                "soc={sum_of_costs} makespan={} lb={lower_bound}",
                plan.makespan()
            );
            if check {
                println!("{}", verify(&problem, &plan));
            }
        }
        Outcome::Infeasible => println!("infeasible"),
        Outcome::GaveUp(limit) => println!("gave up: {limit:?}"),
    }
    Ok(())
}

fn read(map: &str, scen: &str, agents: usize) -> Result<Problem, Box<dyn Error>> {
    let map = std::fs::read_to_string(map)?;
    let (head, body) = map.split_once("map\n").ok_or("the map has no body")?;
    let number = |key: &str| {
        let line = head.lines().find_map(|l| l.strip_prefix(key));
        line.and_then(|l| l.trim().parse::<u32>().ok())
            .ok_or("the map has no size")
    };
    let (rows, cols) = (number("height")?, number("width")?);
    let passable = body
        .lines()
        .flat_map(|l| l.trim_end().bytes())
        .map(|c| c == b'.')
        .collect();
    let mut problem = Problem {
        rows,
        cols,
        passable,
        starts: Vec::new(),
        goals: Vec::new(),
    };
    for line in std::fs::read_to_string(scen)?.lines().skip(1).take(agents) {
        let fields: Vec<&str> = line.split('\t').collect();
        let cell = |x: usize| -> Result<u32, Box<dyn Error>> {
            let at = |k: usize| fields.get(k).ok_or("a scenario line is too short");
            Ok(at(x + 1)?.parse::<u32>()? * cols + at(x)?.parse::<u32>()?)
        };
        problem.starts.push(cell(4)?);
        problem.goals.push(cell(6)?);
    }
    Ok(problem)
}

/// Independent of the planner's own tables.
fn verify(problem: &Problem, plan: &Plan) -> String {
    let at = |agent: usize, t: usize| {
        let path = plan.path(agent);
        path[t.min(path.len() - 1)]
    };
    let agents = problem.starts.len();
    let mut here = vec![usize::MAX; problem.passable.len()];
    for t in 0..=plan.makespan() as usize {
        let mut next = vec![usize::MAX; problem.passable.len()];
        for agent in 0..agents {
            let (v, u) = (at(agent, t), at(agent, t + 1));
            let cols = problem.cols;
            let moved = v.abs_diff(u) == cols || (v.abs_diff(u) == 1 && v / cols == u / cols);
            if !problem.passable[u as usize] || (v != u && !moved) {
                return format!("invalid: agent {agent} at time {t}");
            }
            if next[u as usize] != usize::MAX {
                return format!("invalid: vertex conflict of agent {agent} at time {t}");
            }
            next[u as usize] = agent;
            if t == 0 {
                here[v as usize] = agent;
            }
        }
        for agent in 0..agents {
            let other = here[at(agent, t + 1) as usize];
            if other != usize::MAX && other != agent && at(other, t + 1) == at(agent, t) {
                return format!("invalid: swap of agents {agent} and {other} at time {t}");
            }
        }
        here = next;
    }
    for agent in 0..agents {
        let path = plan.path(agent);
        let ends = (path.first(), path.last());
        if ends != (Some(&problem.starts[agent]), Some(&problem.goals[agent])) {
            return format!("invalid: ends of agent {agent}");
        }
    }
    "valid".into()
}

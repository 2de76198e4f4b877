//! Time to the first plan of MovingAI scenarios:
//! `cargo run --example repair -- MAP SCENARIO AGENTS [SECONDS [SEED]]`.

use std::error::Error;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use fleetyard_plugin_neighborhood::repair::{Control, repair};
use fleetyard_plugin_spacetime::plan::sum_of_costs;
use fleetyard_plugin_spacetime::problem::{GoalRule, Ground};
use fleetyard_testkit::Case;

fn main() -> Result<(), Box<dyn Error>> {
    let given: Vec<String> = std::env::args().skip(1).collect();
    let [map, scenario, agents, rest @ ..] = &given[..] else {
        return Err("MAP SCENARIO AGENTS [SECONDS [SEED]]".into());
    };
    let seconds = rest.first().map_or(Ok(60), |text| text.parse())?;
    let seed = rest.get(1).map_or(Ok(0), |text| text.parse())?;
    let (map, scenario) = (PathBuf::from(map), PathBuf::from(scenario));
    let case = Case::read(&map, &scenario, agents.parse()?)?;
    let begin = Instant::now();
    let problem =
        Ground::new(&case.map, 1 << 30)?.problem(&case.instance, GoalRule::Stay, &mut || false)?;
    let tables = begin.elapsed();
    let deadline = begin + Duration::from_secs(seconds);
    let mut control = Control {
        stop: &mut || Instant::now() > deadline,
        nodes: u64::MAX,
    };
    let repaired = repair(&problem, 8, seed, &mut control);
    println!(
        "{} agents: {}valid after {:.0} ms (tables {:.0} ms), {} pairs at first, {} repairs, \
         sum of costs {}, lower bound {}",
        problem.agents(),
        if repaired.valid { "" } else { "not " },
        begin.elapsed().as_secs_f64() * 1e3,
        tables.as_secs_f64() * 1e3,
        repaired.pairs_at_first,
        repaired.neighborhoods,
        sum_of_costs(&repaired.paths),
        problem.lower_bound(),
    );
    Ok(())
}

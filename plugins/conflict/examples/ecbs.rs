//! Solves scenarios of MovingAI and says what it took:
//! `ecbs MAP SCENARIO AGENTS WEIGHT SECONDS [turning]`.

use std::error::Error;
use std::path::Path;
use std::time::{Duration, Instant};

use fleetyard_plugin_conflict::{Settings, solve};
use fleetyard_plugin_spacetime::problem::{GoalRule, Ground};
use fleetyard_testkit::Case;

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [map, scenario, agents, weight, seconds, rest @ ..] = words.as_slice() else {
        return Err("ecbs MAP SCENARIO AGENTS WEIGHT SECONDS [turning]".into());
    };
    let mut case = Case::read(Path::new(map), Path::new(scenario), agents.parse()?)?;
    if rest.iter().any(|word| word == "turning") {
        case = case.turning();
    }
    let begin = Instant::now();
    let limit = Duration::from_secs_f64(seconds.parse()?);
    let problem =
        Ground::new(&case.map, 1 << 30)?.problem(&case.instance, GoalRule::Stay, &mut || false)?;
    let settings = Settings {
        weight: weight.parse()?,
        ..Settings::default()
    };
    let result = solve(&problem, &settings, &mut || begin.elapsed() > limit);
    let plan = problem.plan(&result.paths);
    let paths: Vec<Vec<u32>> = plan.paths().map(<[u32]>::to_vec).collect();
    let verdict = case.judge(&paths, 0).err();
    println!(
        "{:?} cost {} bound {} conflicts {} expanded {} generated {} bypassed {} low {} time {:.3} {}",
        result.end,
        result.cost,
        result.lower_bound,
        result.conflicts.len(),
        result.expanded,
        result.generated,
        result.bypassed,
        result.low_level,
        begin.elapsed().as_secs_f64(),
        verdict.unwrap_or_default(),
    );
    Ok(())
}

//! Conflict-based search for the first N discs of a file of tasks on a roadmap: `ccbs TASKS N [WEIGHT [SECONDS [WORDS]]]`.
//!
//! Words switch parts off: `no-pairs`, `no-bypass`, `no-disjoint`, `original`.

#[path = "../../bundle/tests/it/roadmap/support.rs"]
mod support;

use std::error::Error;
use std::time::{Duration, Instant};

use fleetyard_plugin_roadmap::closeness::Closeness;
use fleetyard_plugin_roadmap::conflict::{Branching, Settings, solve};

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [tasks, agents, rest @ ..] = words.as_slice() else {
        return Err("ccbs TASKS N [WEIGHT [SECONDS]]".into());
    };
    let number = |at: usize, default| rest.get(at).map_or(Ok(default), |word| word.parse::<f64>());
    let (weight, seconds) = (number(0, 1.0)?, number(1, 10.0)?);
    let case = support::Case::read(tasks.as_ref(), agents.parse()?)?;
    let begin = Instant::now();
    let closeness = Closeness::new(case.roadmap.clone());
    let on = |word: &str| !rest.iter().any(|given| given == word);
    let settings = Settings {
        weight,
        pairs: on("no-pairs"),
        bypass: on("no-bypass"),
        disjoint: on("no-disjoint"),
        branching: if on("original") {
            Branching::Sound
        } else {
            Branching::Original
        },
        ..Settings::default()
    };
    let limit = Duration::from_secs_f64(seconds);
    let outcome = solve(&closeness, &case.tasks, &settings, &mut || {
        begin.elapsed() > limit
    });
    let apart = support::least_distance(&case.roadmap, &outcome.paths);
    println!(
        "{:?} cost {:.4} bound {:.4} expanded {} generated {} bypassed {} low level {} searches {} seconds {:.4} least distance {apart:.9}",
        outcome.end,
        outcome.cost,
        outcome.lower_bound,
        outcome.expanded,
        outcome.generated,
        outcome.bypassed,
        outcome.low_level,
        outcome.searches,
        begin.elapsed().as_secs_f64(),
    );
    Ok(())
}

//! Plans in space and time for the first N robots of a file of tasks in the plane: `team TASKS N [SECONDS [SEED]]`.

#[path = "../../bundle/tests/it/plane/support.rs"]
mod support;

use std::error::Error;
use std::time::Instant;

use fleetyard_plugin_plane::prioritised::World;
use fleetyard_plugin_plane::team::plan::{Effort, plan};
use fleetyard_plugin_plane::team::search::Control;
use fleetyard_plugin_plane::timing::Stop;

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [tasks, discs, rest @ ..] = words.as_slice() else {
        return Err("team TASKS N [SECONDS [SEED]]".into());
    };
    let seconds: f64 = rest.first().map_or(Ok(0.0), |word| word.parse())?;
    let seed: u64 = rest.get(1).map_or(Ok(1), |word| word.parse())?;
    let case = support::Case::read(tasks.as_ref(), discs.parse()?)?;
    let world = World {
        polygons: case.polygons,
        bounds: case.bounds,
        movers: Vec::new(),
    };
    let effort = Effort {
        clearance: 0.0,
        neighborhood: 8,
        rounds: if seconds > 0.0 { u64::MAX } else { 0 },
        memory: 0,
        seed,
    };
    let begin = Instant::now();
    let mut plans: Vec<Vec<Stop>> = Vec::new();
    let mut control = Control {
        stop: &mut || seconds > 0.0 && begin.elapsed().as_secs_f64() > seconds,
        nodes: u64::MAX,
        searches: 0,
        expanded: 0,
    };
    let cost = |plans: &[Vec<Stop>]| -> f64 {
        let arrivals = plans.iter().map(|stops| stops[stops.len() - 1].arrival);
        arrivals.sum()
    };
    let mut first = String::new();
    let (outcome, figures) = plan(&world, &case.discs, effort, &mut control, &mut |better| {
        if first.is_empty() {
            first = format!(
                "{:.3} at {:.4} s",
                cost(better),
                begin.elapsed().as_secs_f64()
            );
        }
        plans = better.to_vec();
    });
    let took = begin.elapsed().as_secs_f64();
    let (cost, least) = (cost(&plans), support::least_clearance(&case.discs, &plans));
    println!(
        "{outcome:?} first {first}, cost {cost:.3}, {took:.4} s, clearance {least:.9} m, {figures:?}, {} expanded",
        control.expanded
    );
    Ok(())
}

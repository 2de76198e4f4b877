//! Plans for the first N discs of a file of tasks on a roadmap: `ctc TASKS N [ORDERS [SEED]]`.

#[path = "../../bundle/tests/it/roadmap/support.rs"]
mod support;

use std::error::Error;
use std::time::Instant;

use fleetyard_plugin_plane::orders::End;
use fleetyard_plugin_roadmap::closeness::Closeness;
use fleetyard_plugin_roadmap::priority::sum_of_costs;

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [tasks, agents, rest @ ..] = words.as_slice() else {
        return Err("ctc TASKS N [ORDERS [SEED]]".into());
    };
    let number = |at: usize, default| rest.get(at).map_or(Ok(default), |word| word.parse());
    let (orders, seed) = (number(0, 1000)?, number(1, 1)?);
    let case = support::Case::read(tasks.as_ref(), agents.parse()?)?;
    let begin = Instant::now();
    let closeness = Closeness::new(case.roadmap.clone());
    let outcome = support::planned(&closeness, &case.tasks, orders, seed);
    let seconds = begin.elapsed().as_secs_f64();
    let (orders, expanded) = (outcome.orders, outcome.expanded);
    match outcome.end {
        End::Solved(paths) => {
            let cost = sum_of_costs(&paths);
            let apart = support::least_distance(&case.roadmap, &paths);
            println!(
                "cost {cost:.3} orders {orders} expanded {expanded} seconds {seconds:.4} least distance {apart:.9}"
            );
        }
        other => println!("{other:?} orders {orders} expanded {expanded} seconds {seconds:.4}"),
    }
    Ok(())
}

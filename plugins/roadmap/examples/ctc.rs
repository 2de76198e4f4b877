//! Plans for the first N discs of a file of tasks on a roadmap: `ctc TASKS N [ORDERS [SEED [SECONDS [REPEATS]]]]`; no orders:
//! priorities alone. Repeats know what is close on the roadmap from before.

#[path = "../../bundle/tests/it/roadmap/support.rs"]
mod support;

use std::error::Error;
use std::time::{Duration, Instant};

use fleetyard_plugin_roadmap::closeness::Closeness;
use fleetyard_plugin_roadmap::ctc::{Ended, Settings, plan};
use fleetyard_plugin_roadmap::pbs::{Control, End};
use fleetyard_plugin_roadmap::priority::sum_of_costs;
use fleetyard_plugin_roadmap::rest::Known;
use fleetyard_plugin_spacetime::order::Prefer;

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [tasks, agents, rest @ ..] = words.as_slice() else {
        return Err("ctc TASKS N [ORDERS [SEED [SECONDS [REPEATS]]]]".into());
    };
    let number = |at: usize, default| rest.get(at).map_or(Ok(default), |word| word.parse());
    let settings = Settings {
        orders: number(0, 20)?,
        seed: number(1, 1)?,
        prefer: Prefer::default(),
    };
    let limit = Duration::from_secs(number(2, 10)?);
    let case = support::Case::read(tasks.as_ref(), agents.parse()?)?;
    let closeness = Closeness::new(case.roadmap.clone());
    let discs = support::discs(&case.tasks);
    let team = (discs.as_slice(), f64::INFINITY);
    for _ in 0..number(3, 1)? {
        let begin = Instant::now();
        let mut control = Control {
            stop: &mut || begin.elapsed() > limit,
            nodes: u64::MAX,
            memory: 1 << 30,
        };
        let outcome = plan(
            &closeness,
            &mut Known::default(),
            team,
            settings,
            &mut control,
            &mut |paths| {
                let seconds = begin.elapsed().as_secs_f64();
                print!("{:.3} after {seconds:.4} s; ", sum_of_costs(paths));
            },
        );
        let seconds = begin.elapsed().as_secs_f64();
        let (orders, nodes, expanded) = (outcome.orders, outcome.nodes, outcome.expanded);
        let work =
            format!("orders {orders} nodes {nodes} expanded {expanded} seconds {seconds:.4}");
        match outcome.end {
            Ended::Tried(End::Solved(paths)) => {
                let apart = support::least_distance(&case.roadmap, &paths);
                println!("{work} least distance {apart:.9}");
            }
            other => println!("{other:?} {work}"),
        }
    }
    Ok(())
}

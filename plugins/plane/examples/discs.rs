//! Plans for the first N robots of a file of tasks in the plane: `discs TASKS N [ORDERS [SEED]]`.

#[path = "../../bundle/tests/it/plane/support.rs"]
mod support;

use std::error::Error;
use std::time::Instant;

use fleetyard_plugin_plane::orders::End;
use fleetyard_plugin_plane::prioritised::{Effort, Outcome, World, plan};

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [tasks, discs, rest @ ..] = words.as_slice() else {
        return Err("discs TASKS N [ORDERS [SEED]]".into());
    };
    let number = |at: usize, default| rest.get(at).map_or(Ok(default), |word| word.parse());
    let (limit, seed) = (number(0, 1000)?, number(1, 1)?);
    let case = support::Case::read(tasks.as_ref(), discs.parse()?)?;
    let begin = Instant::now();
    let effort = Effort {
        clearance: 0.0,
        limit,
        seed,
    };
    let world = World {
        polygons: case.polygons,
        bounds: case.bounds,
        movers: Vec::new(),
    };
    let outcome = plan(&world, &case.discs, effort, &mut || false);
    let seconds = begin.elapsed().as_secs_f64();
    match outcome {
        Outcome::Ordered {
            end: End::Solved(plans),
            orders,
        } => {
            let cost: f64 = plans
                .iter()
                .map(|stops| stops[stops.len() - 1].arrival)
                .sum();
            let least = support::least_clearance(&case.discs, &plans);
            println!(
                "cost {cost:.3}, {orders} orders, {seconds:.4} s, least clearance {least:.9} m"
            );
        }
        other => println!("{other:?}, {seconds:.4} s"),
    }
    Ok(())
}

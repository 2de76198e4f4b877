//! Works out everything that is close to each other on the roadmap of a file of tasks: `closeness TASKS`.

#[path = "../../bundle/tests/it/roadmap/support.rs"]
mod support;

use std::error::Error;
use std::time::Instant;

use fleetyard_plugin_roadmap::closeness::Closeness;

fn main() -> Result<(), Box<dyn Error>> {
    let tasks = std::env::args().nth(1).ok_or("closeness TASKS")?;
    let case = support::Case::read(tasks.as_ref(), 0)?;
    let begin = Instant::now();
    let closeness = Closeness::new(case.roadmap.clone());
    closeness.annotate();
    let seconds = begin.elapsed().as_secs_f64();
    let edges = 0..case.roadmap.edges() as u32;
    let pairs: usize = edges
        .map(|edge| closeness.edges_of_edge(edge).count())
        .sum();
    println!(
        "{} directed edges, {pairs} pairs of them: {seconds:.4} s",
        case.roadmap.edges()
    );
    Ok(())
}

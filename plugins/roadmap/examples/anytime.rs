//! Plans for the first N discs of a file of tasks on a roadmap, and makes plans shorter: `anytime METHOD TASKS N [SECONDS [SEED]]`, where
//! the method is `lns` or `lacam`, or either with `-first` for the first plan alone.

#[path = "../../bundle/tests/it/roadmap/support.rs"]
mod support;

use std::error::Error;
use std::time::{Duration, Instant};

use fleetyard_plugin_roadmap::anytime::{Begin, Control, Settings, plan};
use fleetyard_plugin_roadmap::closeness::Closeness;
use fleetyard_plugin_roadmap::priority::sum_of_costs;
use fleetyard_plugin_roadmap::rest::Known;

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [method, tasks, agents, rest @ ..] = words.as_slice() else {
        return Err("anytime METHOD TASKS N [SECONDS [SEED]]".into());
    };
    let seconds: f64 = rest.first().map_or(Ok(10.0), |word| word.parse())?;
    let seed = rest.get(1).map_or(Ok(1), |word| word.parse())?;
    let settings = Settings {
        begin: if method.starts_with("lacam") {
            Begin::Steps
        } else {
            Begin::Repair
        },
        neighborhood: 8,
        anytime: !method.ends_with("-first"),
        seed,
    };
    let case = support::Case::read(tasks.as_ref(), agents.parse()?)?;
    let begin = Instant::now();
    let limit = Duration::from_secs_f64(seconds);
    let closeness = Closeness::new(case.roadmap.clone());
    let mut control = Control {
        stop: &mut || begin.elapsed() > limit,
        nodes: u64::MAX,
        memory: 1 << 30,
    };
    let discs = support::discs(&case.tasks);
    let (mut last, mut plans) = (Vec::new(), 0);
    let outcome = plan(
        &closeness,
        &mut Known::default(),
        &discs,
        settings,
        &mut control,
        &mut |paths| {
            plans += 1;
            if plans == 1 {
                let seconds = begin.elapsed().as_secs_f64();
                print!("{:.3} after {seconds:.4} s; ", sum_of_costs(paths));
            }
            last = paths.to_vec();
        },
    );
    let seconds = begin.elapsed().as_secs_f64();
    let work = outcome.work;
    println!("{:?}, {plans} plans, {work:?}, {seconds:.4} s", outcome.end);
    if !last.is_empty() {
        let cost = sum_of_costs(&last);
        let bound = work.lower_bound;
        let apart = if last.len() <= 200 {
            support::least_distance(&case.roadmap, &last)
        } else {
            f64::NAN
        };
        println!(
            "cost {cost:.3}, {:.3} times the lower bound, least distance {apart:.9}",
            cost / bound
        );
    }
    Ok(())
}

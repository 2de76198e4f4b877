//! A fleet driven by EPIBT, or WPPL, which does the first step of each plan exactly, with goals drawn
//! at random: `epibt MAP AGENTS [STEPS [TRIES [LANE_CHARGE [GOALS_KNOWN]]]] [--pebbles] [--wppl=DEPTH]`.
//!
//! Says how many goals are reached and how long a step takes.

use std::error::Error;
use std::time::{Duration, Instant};

use fleetyard_testkit::grid;

#[path = "../../bundle/tests/it/mapf/floor.rs"]
mod floor;

use floor::{Floor, Manner, Patient, Planner};

fn main() -> Result<(), Box<dyn Error>> {
    let given: Vec<String> = std::env::args().skip(1).collect();
    let (flags, given): (Vec<String>, Vec<String>) =
        given.into_iter().partition(|word| word.starts_with("--"));
    let turning = !flags.iter().any(|flag| flag == "--pebbles");
    let depth = flags.iter().find_map(|flag| flag.strip_prefix("--wppl="));
    let planner = match depth {
        Some(depth) => Planner::Wppl {
            depth: depth.parse()?,
        },
        None => Planner::Epibt,
    };
    let [map, agents, rest @ ..] = &given[..] else {
        return Err(
            "MAP AGENTS [STEPS [TRIES [LANE_CHARGE [GOALS_KNOWN]]]] [--pebbles] [--wppl=DEPTH]"
                .into(),
        );
    };
    let number = |at: usize, default: u32| -> Result<u32, Box<dyn Error>> {
        Ok(rest.get(at).map_or(Ok(default), |text| text.parse())?)
    };
    let steps = number(0, 300)?;
    let manner = Manner {
        horizon: 3 + usize::from(turning),
        tries: Some(number(1, 5)?),
        window: 1,
        threads: 1,
        planner,
    };
    let (charge, known) = (number(2, 0)?, number(3, 1)?);
    let text = std::fs::read_to_string(map)?;
    let (_, body) = text.split_once("map\n").ok_or("the map has no body")?;
    let free = |letter: char| if "@T".contains(letter) { '@' } else { '.' };
    let rows = body.lines().map(|row| row.trim_end().chars().map(free));
    let rows: Vec<String> = rows.map(Iterator::collect).collect();
    let map = grid::drawn(&rows);
    let mut floor = Floor::new(map, agents.parse()?, turning, known.into(), charge, 1);
    let mut reached = 0;
    let mut times = Vec::new();
    for _ in 0..steps {
        let begin = Instant::now();
        let (plan, _) = floor.plan(manner, &mut Patient);
        times.push(begin.elapsed());
        floor.judge(&plan)?;
        reached += floor.follow(&plan);
    }
    let first = times[0];
    times.sort_unstable();
    let mean = times.iter().sum::<Duration>() / steps;
    println!(
        "{agents} agents: {:.2} goals a step; a step takes {mean:.2?}, the median {:.2?}, the first \
         {first:.0?}, the worst {:.0?}",
        reached as f64 / f64::from(steps),
        times[times.len() / 2],
        times[times.len() - 1],
    );
    Ok(())
}

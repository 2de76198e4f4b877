//! A fleet driven by PIBT call after call, with goals drawn at random:
//! `cargo run --example lifelong -- MAP AGENTS [WINDOW [CALLS]]`.
//!
//! Robots do exactly what is planned, at once; says how long the calls take and how many
//! goals are reached.

use std::error::Error;
use std::sync::Arc;
use std::time::Instant;

use fleetyard_abi::Goals;
use fleetyard_plugin_mapf::lifelong::{ByDistance, Lifelong, Query};
use fleetyard_plugin_spacetime::graph::Graph;

/// Mixes the bits of a number.
fn mix(mut x: u64) -> u64 {
    x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ x >> 31
}

fn main() -> Result<(), Box<dyn Error>> {
    let given: Vec<String> = std::env::args().skip(1).collect();
    let [map, agents, rest @ ..] = &given[..] else {
        return Err("MAP AGENTS [WINDOW [CALLS]]".into());
    };
    let agents: usize = agents.parse()?;
    let window: u32 = rest.first().map_or(Ok(10), |text| text.parse())?;
    let calls: u32 = rest.get(1).map_or(Ok(60), |text| text.parse())?;
    let text = std::fs::read_to_string(map)?;
    let (_, body) = text.split_once("map\n").ok_or("the map has no body")?;
    let rows: Vec<&str> = body.lines().map(str::trim_end).collect();
    let cols = rows.first().map_or(0, |row| row.len());
    let passable: Vec<bool> = rows
        .iter()
        .flat_map(|row| row.bytes())
        .map(|c| c != b'@' && c != b'T')
        .collect();
    let graph = Graph::new(rows.len(), cols, &passable);
    let mut planner = Lifelong::new(Arc::new(graph), 512 << 20);
    let free: Vec<u32> = (0..passable.len() as u32)
        .filter(|&cell| passable[cell as usize])
        .collect();
    let goal = |agent: usize, index: u32| {
        free[(mix((agent as u64) << 32 | u64::from(index)) % free.len() as u64) as usize]
    };
    let mut cells = free.clone();
    cells.sort_by_key(|&cell| mix(u64::from(cell)));
    cells.truncate(agents);
    let mut next = vec![0_u32; agents];
    let mut since = vec![0_u32; agents];
    let (mut reached, mut longest, mut times) = (0_u64, 0, Vec::new());
    for call in 0..calls {
        let list = |agent: usize| [0, 1, 2].map(|k| goal(agent, next[agent] + k));
        let goals: Goals = (0..agents).map(list).collect();
        let query = Query {
            starts: &cells,
            goals: &goals,
            headings: None,
            window: Some(window),
            step_limit: 0,
            swap: true,
            rings: false,
            memory_limit: 0,
            samples: 1,
            retries: 0,
            seed: u64::from(call),
        };
        let begin = Instant::now();
        let (plan, _) = planner.run(&query, &mut ByDistance, &mut || false)?;
        times.push(begin.elapsed().as_secs_f64() * 1e3);
        let mut here = Vec::with_capacity(agents);
        for (agent, path) in plan.paths().enumerate() {
            let before = next[agent];
            for &cell in path {
                while next[agent] < before + 3 && goal(agent, next[agent]) == cell {
                    next[agent] += 1;
                }
            }
            reached += u64::from(next[agent] - before);
            since[agent] = if next[agent] > before {
                0
            } else {
                since[agent] + window
            };
            longest = longest.max(since[agent]);
            here.push(path[path.len() - 1]);
        }
        cells = here;
    }
    let first = times[0];
    times.sort_by(f64::total_cmp);
    println!(
        "{agents} agents, windows of {window}: first call {first:.1} ms, median {:.2}, worst {:.1}; \
         {:.3} goals per step, {:.1} each, longest way {longest} steps",
        times[times.len() / 2],
        times[times.len() - 1],
        reached as f64 / f64::from(calls * window),
        reached as f64 / agents as f64,
    );
    Ok(())
}

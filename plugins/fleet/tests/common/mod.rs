//! A host that listens, maps, and a checker of plans that shares nothing with the plugins.

#![allow(dead_code, reason = "each test file uses a part")]

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex};

use fleetyard_abi::sdk::{Rejected, Sink};
use fleetyard_abi::{
    Budget, Environment, GridEnvironment, Heading, Instance, LogLevel, Motion, Plan, PlanRef,
    SharedEnvironment,
};

pub(crate) const BUDGET: Budget = Budget {
    deadline_monotonic_ns: u64::MAX,
    wall_ns: 1_000_000_000,
    nodes: 0,
    memory_bytes: 0,
    threads: 1,
    seed: 7,
};

/// Keeps what is submitted last.
#[derive(Default)]
pub(crate) struct Host {
    pub(crate) plan: Mutex<Option<Plan>>,
    pub(crate) instance: Mutex<Option<Instance>>,
}

impl Sink for Host {
    fn submit_plan(&self, plan: PlanRef<'_>) -> Result<(), Rejected> {
        *self.plan.lock().unwrap() = Some(plan.to_plan());
        Ok(())
    }
    fn submit_instance(&self, instance: &Instance) -> Result<(), Rejected> {
        *self.instance.lock().unwrap() = Some(instance.clone());
        Ok(())
    }
    fn metric(&self, _: &str, _: f64) {}
    fn log(&self, _: LogLevel, _: &str) {}
    fn progress(&self, _: u64, _: u64) {}
    fn cancelled(&self) -> bool {
        false
    }
}

pub(crate) fn map(rows: u32, cols: u32, free: impl Fn(u32) -> bool) -> SharedEnvironment {
    let passable: Vec<u8> = (0..rows * cols).map(|cell| free(cell).into()).collect();
    Arc::new(Environment::Grid(GridEnvironment::four_connected(
        rows, cols, passable,
    )))
}

pub(crate) fn drawn(rows: &[&str]) -> SharedEnvironment {
    let text = rows.concat().into_bytes();
    let (height, width) = (rows.len() as u32, rows[0].len() as u32);
    map(height, width, |cell| text[cell as usize] == b'.')
}

/// What is wrong with a plan, if anything: paths, collisions, rings, and turns.
pub(crate) fn fault(
    environment: &SharedEnvironment,
    instance: &Instance,
    plan: PlanRef<'_>,
) -> Option<String> {
    let grid = environment.grid().unwrap();
    let paths: Vec<&[u32]> = plan.paths().collect();
    if paths.len() != instance.starts.len() {
        return Some(format!("{} paths", paths.len()));
    }
    let at = |agent: usize, time: usize| paths[agent][time.min(paths[agent].len() - 1)];
    for (agent, path) in paths.iter().enumerate() {
        if path.first() != Some(&instance.starts[agent]) {
            return Some(format!("agent {agent} begins elsewhere"));
        }
        if path
            .iter()
            .any(|cell| grid.passable.get(*cell as usize) != Some(&1))
        {
            return Some(format!("agent {agent} is in a wall: {path:?}"));
        }
        let position = |cell: u32| (i64::from(cell / grid.cols), i64::from(cell % grid.cols));
        let mut heading = instance.headings.as_ref().map(|all| all[agent].code());
        let mut waited = 0;
        for (time, pair) in (1..).zip(path.windows(2)) {
            let ((from_row, from_col), (row, col)) = (position(pair[0]), position(pair[1]));
            let towards = match (row - from_row, col - from_col) {
                (0, 0) => {
                    waited += 1;
                    continue;
                }
                (0, 1) => Heading::East,
                (1, 0) => Heading::South,
                (0, -1) => Heading::West,
                (-1, 0) => Heading::North,
                _ => return Some(format!("agent {agent} jumps at {time}: {path:?}")),
            };
            if let (Motion::Rotation, Some(heading)) = (instance.motion, &mut heading) {
                let apart = (*heading - towards.code()).rem_euclid(4);
                if waited < apart.min(4 - apart) {
                    return Some(format!(
                        "agent {agent} moves at {time} before it has turned"
                    ));
                }
                *heading = towards.code();
            }
            waited = 0;
        }
    }
    let horizon = paths.iter().map(|path| path.len()).max().unwrap_or(0);
    let end = match instance.window_steps {
        0 => horizon,
        window => window as usize,
    };
    for time in 0..=end {
        let mut here: BTreeMap<u32, usize> = BTreeMap::new();
        for agent in 0..paths.len() {
            if let Some(other) = here.insert(at(agent, time), agent) {
                return Some(format!("agents {other} and {agent} collide at {time}"));
            }
        }
        if time == 0 {
            continue;
        }
        let before: BTreeMap<u32, usize> = (0..paths.len())
            .map(|agent| (at(agent, time - 1), agent))
            .collect();
        let ahead = |agent: usize| {
            let (from, to) = (at(agent, time - 1), at(agent, time));
            if from == to {
                None
            } else {
                before.get(&to).copied()
            }
        };
        for agent in 0..paths.len() {
            let mut met = BTreeSet::new();
            let mut next = ahead(agent);
            while let Some(one) = next {
                if one == agent {
                    let length = met.len() + 1;
                    if length == 2 || !instance.allows_cycles {
                        return Some(format!("a ring of {length} with agent {agent} at {time}"));
                    }
                    break;
                }
                if !met.insert(one) {
                    break;
                }
                next = ahead(one);
            }
        }
    }
    None
}

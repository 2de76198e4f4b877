//! What tests, example and benchmark share: maps, problems, and a checker of plans that
//! knows nothing of the planner's tables.
#![allow(dead_code, reason = "each user takes what it needs")]

use std::error::Error;
use std::path::Path;

use fleetyard_abi::{GridEnvironment, Instance};
use fleetyard_plugin_spacetime::graph::Vertex;
use fleetyard_plugin_spacetime::problem::{GoalRule, Ground, Problem, ProblemError};

/// A map, and agents with a start and a goal each.
#[derive(Debug, Clone)]
pub(crate) struct Scene {
    pub(crate) rows: u32,
    pub(crate) cols: u32,
    pub(crate) passable: Vec<u8>,
    pub(crate) starts: Vec<u32>,
    pub(crate) goals: Vec<u32>,
    pub(crate) cycles: bool,
}

impl Scene {
    pub(crate) fn environment(&self) -> GridEnvironment {
        GridEnvironment::four_connected(self.rows, self.cols, self.passable.clone())
    }

    pub(crate) fn instance(&self) -> Instance {
        Instance {
            allows_cycles: self.cycles,
            ..Instance::one_shot(self.starts.clone(), self.goals.clone())
        }
    }

    pub(crate) fn problem(&self) -> Result<Problem, ProblemError> {
        let mut ground = Ground::new(&self.environment(), 1 << 30)?;
        ground.problem(&self.instance(), GoalRule::Stay, &mut || false)
    }

    /// An open square with agents at places that follow from a seed.
    pub(crate) fn open(side: u32, agents: usize, blocked: u64, seed: u64) -> Self {
        let size = side * side;
        let passable: Vec<u8> = (0..size)
            .map(|cell| u8::from(mix(seed ^ u64::from(cell)) % 16 >= blocked))
            .collect();
        // The largest part that hangs together, or at least one cell.
        let mut best: Vec<u32> = Vec::new();
        let mut seen = vec![false; size as usize];
        for first in 0..size {
            let mut part = vec![first];
            if passable[first as usize] == 0 || std::mem::replace(&mut seen[first as usize], true) {
                continue;
            }
            let mut next = 0;
            while let Some(&cell) = part.get(next) {
                next += 1;
                let (row, col) = (cell / side, cell % side);
                let around = [
                    (row > 0).then(|| cell - side),
                    (row + 1 < side).then(|| cell + side),
                    (col > 0).then(|| cell - 1),
                    (col + 1 < side).then(|| cell + 1),
                ];
                for other in around.into_iter().flatten() {
                    if passable[other as usize] == 1
                        && !std::mem::replace(&mut seen[other as usize], true)
                    {
                        part.push(other);
                    }
                }
            }
            if part.len() > best.len() {
                best = part;
            }
        }
        let pick = |salt: u64| {
            let mut cells = best.clone();
            cells.sort_by_key(|&cell| mix(seed ^ salt ^ u64::from(cell)));
            cells.truncate(agents);
            cells
        };
        Self {
            rows: side,
            cols: side,
            starts: pick(1 << 40),
            goals: pick(1 << 41),
            passable,
            cycles: true,
        }
    }
}

/// Mixes the bits of a number.
pub(crate) fn mix(mut x: u64) -> u64 {
    x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ x >> 31
}

/// The first agents of a MovingAI scenario.
pub(crate) fn read(map: &Path, scenario: &Path, agents: usize) -> Result<Scene, Box<dyn Error>> {
    let map = std::fs::read_to_string(map)?;
    let (head, body) = map.split_once("map\n").ok_or("the map has no body")?;
    let number = |key: &str| {
        let line = head.lines().find_map(|line| line.strip_prefix(key));
        line.and_then(|l| l.trim().parse::<u32>().ok())
            .ok_or("the map has no size")
    };
    let (rows, cols) = (number("height")?, number("width")?);
    let letters = body.lines().flat_map(|l| l.trim_end().bytes());
    let passable = letters.map(|c| u8::from(c == b'.')).collect();
    let (mut starts, mut goals) = (Vec::new(), Vec::new());
    for line in std::fs::read_to_string(scenario)?
        .lines()
        .skip(1)
        .take(agents)
    {
        let fields: Vec<&str> = line.split('\t').collect();
        let cell = |x: usize| -> Result<u32, Box<dyn Error>> {
            let at = |k: usize| fields.get(k).ok_or("a scenario line is too short");
            Ok(at(x + 1)?.parse::<u32>()? * cols + at(x)?.parse::<u32>()?)
        };
        starts.push(cell(4)?);
        goals.push(cell(6)?);
    }
    Ok(Scene {
        rows,
        cols,
        passable,
        starts,
        goals,
        cycles: true,
    })
}

/// How often agents collide on their paths: in cells, on edges, and in rings if these are
/// not allowed; or what else is wrong with the paths.
pub(crate) fn collisions(problem: &Problem, paths: &[Vec<Vertex>]) -> Result<usize, String> {
    if paths.len() != problem.agents() {
        return Err(format!("{} paths", paths.len()));
    }
    for (agent, (path, route)) in paths.iter().zip(&problem.routes).enumerate() {
        if path.first() != Some(&route.start) || path.last() != route.goals.last() {
            return Err(format!("agent {agent} has another start or goal"));
        }
        let jump = |step: &[Vertex]| {
            step[0] != step[1] && !problem.graph.neighbors(step[0]).any(|u| u == step[1])
        };
        if path.windows(2).any(jump) {
            return Err(format!("agent {agent} jumps"));
        }
        if path.len() > 1 && path[path.len() - 2] == path[path.len() - 1] {
            return Err(format!("agent {agent} goes on after its arrival"));
        }
    }
    let at = |agent: usize, t: usize| *paths[agent].get(t).or(paths[agent].last()).unwrap();
    let makespan = paths.iter().map(Vec::len).max().unwrap_or(0);
    let mut count = 0;
    for t in 0..makespan {
        let mut before = vec![usize::MAX; problem.graph.len()];
        let mut after = before.clone();
        for agent in 0..paths.len() {
            before[at(agent, t) as usize] = agent;
            count += usize::from(after[at(agent, t + 1) as usize] != usize::MAX);
            after[at(agent, t + 1) as usize] = agent;
        }
        for agent in 0..paths.len() {
            let (mut next, mut length) = (agent, 0);
            while at(next, t) != at(next, t + 1) && length <= paths.len() {
                next = before[at(next, t + 1) as usize];
                length += 1;
                if next == usize::MAX {
                    break;
                }
                if next == agent {
                    count += usize::from(length == 2 || !problem.cycles);
                    break;
                }
            }
        }
    }
    Ok(count)
}

//! What tests, example and benchmark share: problems, and a judge that knows nothing of the
//! planners' tables.
#![allow(dead_code, reason = "each user takes what it needs")]

use std::error::Error;
use std::path::Path;

use fleetyard_abi::{Goals, GridEnvironment, Heading, Instance, Motion};
use fleetyard_plugin_spacetime::problem::{GoalRule, Ground, Problem};

/// A map and who has to go where on it.
#[derive(Debug, Clone)]
pub(crate) struct Case {
    pub(crate) rows: u32,
    pub(crate) cols: u32,
    pub(crate) passable: Vec<bool>,
    pub(crate) instance: Instance,
}

impl Case {
    /// Rows of text, `.` passable, and (start, goal) cells.
    pub(crate) fn new(map: &[&str], agents: &[(u32, u32)]) -> Self {
        let cells = map.iter().flat_map(|row| row.bytes());
        Self {
            rows: map.len() as u32,
            cols: map.first().map_or(0, |row| row.len() as u32),
            passable: cells.map(|c| c == b'.').collect(),
            instance: Instance::one_shot(
                agents.iter().map(|agent| agent.0).collect(),
                agents.iter().map(|agent| agent.1).collect(),
            ),
        }
    }

    /// The first agents of a MovingAI scenario.
    pub(crate) fn read(map: &Path, scenario: &Path, agents: usize) -> Result<Self, Box<dyn Error>> {
        let map = std::fs::read_to_string(map)?;
        let (_, body) = map.split_once("map\n").ok_or("the map has no body")?;
        let rows: Vec<&str> = body.lines().map(str::trim_end).collect();
        let cols = rows.first().map_or(0, |row| row.len()) as u32;
        let mut pairs = Vec::new();
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
            pairs.push((cell(4)?, cell(6)?));
        }
        Ok(Self::new(&rows, &pairs))
    }

    /// Everybody looks to the east and takes a step to turn.
    pub(crate) fn turning(mut self) -> Self {
        self.instance.motion = Motion::Rotation;
        self.instance.headings = Some(vec![Heading::East; self.instance.agents()]);
        self
    }

    /// Nobody may move round in a ring.
    pub(crate) fn without_rings(mut self) -> Self {
        self.instance.allows_cycles = false;
        self
    }

    /// Only so many steps matter, and agents have several goals.
    pub(crate) fn windowed(mut self, window: u32, goals: Vec<Vec<u32>>) -> Self {
        let mut offsets = vec![0];
        let mut cells = Vec::new();
        for list in goals {
            cells.extend(list);
            offsets.push(cells.len() as u64);
        }
        self.instance.goals = Goals::from_flat(offsets, cells).expect("lists that fit");
        self.instance.window_steps = window;
        self
    }

    pub(crate) fn environment(&self) -> GridEnvironment {
        GridEnvironment::four_connected(
            self.rows,
            self.cols,
            self.passable.iter().map(|free| u8::from(*free)).collect(),
        )
    }

    pub(crate) fn problem(&self) -> Problem {
        let mut ground = Ground::new(&self.environment(), 1 << 30).expect("a grid");
        let problem = ground.problem(&self.instance, GoalRule::Stay, &mut || false);
        problem.expect("a problem that is well formed")
    }

    /// The cells next to one.
    pub(crate) fn near(&self, cell: u32) -> impl Iterator<Item = u32> + '_ {
        let (rows, cols) = (self.rows, self.cols);
        let around = [
            (cell >= cols).then(|| cell - cols),
            (cell % cols + 1 < cols).then(|| cell + 1),
            (cell / cols + 1 < rows).then(|| cell + cols),
            (!cell.is_multiple_of(cols)).then(|| cell - 1),
        ];
        around
            .into_iter()
            .flatten()
            .filter(|&cell| self.passable[cell as usize])
    }

    /// Why cells at steps are no plan for the instance, if so.
    pub(crate) fn judge(&self, paths: &[Vec<u32>], delay: u32) -> Result<(), String> {
        let instance = &self.instance;
        let at = |agent: usize, time: usize| {
            let path = &paths[agent];
            path[time.min(path.len() - 1)]
        };
        let longest = paths.iter().map(Vec::len).max().unwrap_or(0);
        let last = match instance.window_steps {
            0 => longest + delay as usize,
            window => window as usize,
        };
        for (agent, path) in paths.iter().enumerate() {
            if path.first() != Some(&instance.starts[agent]) {
                return Err(format!("agent {agent} does not begin at its start"));
            }
            for step in path.windows(2) {
                if step[0] != step[1] && !self.near(step[0]).any(|cell| cell == step[1]) {
                    return Err(format!(
                        "agent {agent} goes from {} to {}",
                        step[0], step[1]
                    ));
                }
            }
            let goals = instance.goals.get(agent);
            if instance.window_steps == 0 && goals.last() != path.last() {
                return Err(format!("agent {agent} does not arrive"));
            }
            self.turns(agent, path)?;
        }
        for time in 0..=last {
            for a in 0..paths.len() {
                for b in (0..paths.len()).filter(|&b| b != a) {
                    let later = time..=(time + delay as usize).min(last);
                    if later.clone().any(|later| at(a, time) == at(b, later)) {
                        return Err(format!("{a} and {b} are in cell {} at {time}", at(a, time)));
                    }
                    let swap = at(a, time) == at(b, time + 1) && at(b, time) == at(a, time + 1);
                    if time < last && swap {
                        return Err(format!("{a} and {b} change places at {time}"));
                    }
                }
            }
            if !instance.allows_cycles && time < last {
                rings(
                    &(0..paths.len())
                        .map(|a| (at(a, time), at(a, time + 1)))
                        .collect::<Vec<_>>(),
                )?;
            }
        }
        Ok(())
    }

    fn turns(&self, agent: usize, path: &[u32]) -> Result<(), String> {
        let Some(headings) = &self.instance.headings else {
            return Ok(());
        };
        let mut heading = headings[agent].code();
        let mut waited = 0;
        for step in path.windows(2) {
            let towards = match i64::from(step[1]) - i64::from(step[0]) {
                0 => {
                    waited += 1;
                    continue;
                }
                d if d == i64::from(self.cols) => 1,
                d if d == -i64::from(self.cols) => 3,
                1 => 0,
                _ => 2,
            };
            let apart = (heading - towards).rem_euclid(4);
            if waited < apart.min(4 - apart) {
                return Err(format!("agent {agent} turns in no time"));
            }
            (heading, waited) = (towards, 0);
        }
        Ok(())
    }
}

/// Whether agents with such moves go round in a ring.
fn rings(moves: &[(u32, u32)]) -> Result<(), String> {
    for start in 0..moves.len() {
        let mut now = start;
        for _ in 0..moves.len() {
            let (from, to) = moves[now];
            let next = moves
                .iter()
                .position(|&(other, after)| other == to && after != to);
            match next {
                Some(next) if from != to => now = next,
                _ => break,
            }
            if now == start {
                return Err(format!("a ring through cell {from}"));
            }
        }
    }
    Ok(())
}

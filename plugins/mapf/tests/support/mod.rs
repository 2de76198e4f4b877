//! What tests, example and benchmark share: a validity checker that knows nothing of
//! the planner's tables, a reader of MovingAI files, and an observer.
#![allow(dead_code, reason = "each user takes what it needs")]

use std::error::Error;
use std::path::Path;

use fleetyard_plugin_mapf::{Observer, Options, Outcome, Plan, Problem, ProblemError, solve};
use fleetyard_plugin_spacetime::graph::Graph;

/// Never stops; remembers the sums of costs it is told.
#[derive(Debug, Default)]
pub(crate) struct Patient {
    pub(crate) sums: Vec<u64>,
    pub(crate) plans: Vec<Plan>,
    pub(crate) metrics: Vec<(String, f64)>,
}

impl Observer for Patient {
    fn incumbent(&mut self, plan: &Plan, sum_of_costs: u64) {
        self.sums.push(sum_of_costs);
        self.plans.push(plan.clone());
    }
    fn stop(&mut self) -> bool {
        false
    }
    fn metric(&mut self, name: &str, value: f64) {
        self.metrics.push((name.to_owned(), value));
    }
}

/// A map, and a start and a goal cell for each agent.
#[derive(Debug, Clone)]
pub(crate) struct Case {
    pub(crate) rows: u32,
    pub(crate) cols: u32,
    /// One entry per cell, row by row.
    pub(crate) passable: Vec<bool>,
    pub(crate) starts: Vec<u32>,
    pub(crate) goals: Vec<u32>,
}

impl Case {
    pub(crate) fn graph(&self) -> Graph {
        Graph::new(self.rows as usize, self.cols as usize, &self.passable)
    }

    pub(crate) fn solve(
        &self,
        options: &Options,
        seed: u64,
        observer: &mut dyn Observer,
    ) -> Result<Outcome, ProblemError> {
        let problem = Problem {
            graph: &self.graph(),
            starts: &self.starts,
            goals: &self.goals,
        };
        solve(&problem, options, seed, observer)
    }
}

/// A case from rows of text, `.` passable, and (start, goal) cells.
pub(crate) fn problem(map: &[&str], agents: &[(u32, u32)]) -> Case {
    Case {
        rows: map.len() as u32,
        cols: map.first().map_or(0, |row| row.len() as u32),
        passable: map
            .iter()
            .flat_map(|row| row.bytes())
            .map(|c| c == b'.')
            .collect(),
        starts: agents.iter().map(|a| a.0).collect(),
        goals: agents.iter().map(|a| a.1).collect(),
    }
}

/// The first agents of a MovingAI scenario.
pub(crate) fn read(map: &Path, scenario: &Path, agents: usize) -> Result<Case, Box<dyn Error>> {
    let map = std::fs::read_to_string(map)?;
    let (head, body) = map.split_once("map\n").ok_or("the map has no body")?;
    let number = |key: &str| {
        let line = head.lines().find_map(|line| line.strip_prefix(key));
        line.and_then(|l| l.trim().parse::<u32>().ok())
            .ok_or("the map has no size")
    };
    let (rows, cols) = (number("height")?, number("width")?);
    let passable = body
        .lines()
        .flat_map(|l| l.trim_end().bytes())
        .map(|c| c == b'.')
        .collect();
    let mut problem = Case {
        rows,
        cols,
        passable,
        starts: Vec::new(),
        goals: Vec::new(),
    };
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
        problem.starts.push(cell(4)?);
        problem.goals.push(cell(6)?);
    }
    Ok(problem)
}

/// Says what is wrong with a plan, if anything is.
pub(crate) fn verify(problem: &Case, plan: &Plan) -> Result<(), String> {
    let agents = problem.starts.len();
    if plan.agents() != agents || plan.offsets().len() != agents + 1 {
        return Err(format!("{} paths for {agents} agents", plan.agents()));
    }
    for agent in 0..agents {
        let path = plan.path(agent);
        if path.first() != Some(&problem.starts[agent]) {
            return Err(format!("agent {agent} does not begin at its start"));
        }
        if path.last() != Some(&problem.goals[agent]) {
            return Err(format!("agent {agent} does not end at its goal"));
        }
        if path.len() > 1 && path[path.len() - 2] == path[path.len() - 1] {
            return Err(format!(
                "the path of agent {agent} goes on after its arrival"
            ));
        }
    }
    let at = |agent: usize, t: usize| {
        let path = plan.path(agent);
        path[t.min(path.len() - 1)]
    };
    let nobody = usize::MAX;
    let mut here = vec![nobody; problem.passable.len()];
    for agent in 0..agents {
        here[at(agent, 0) as usize] = agent;
    }
    for t in 0..=plan.makespan() as usize {
        let mut next = vec![nobody; problem.passable.len()];
        for agent in 0..agents {
            let (v, u) = (at(agent, t), at(agent, t + 1));
            let cols = problem.cols;
            let step = v.abs_diff(u) == cols || (v.abs_diff(u) == 1 && v / cols == u / cols);
            if !problem.passable[u as usize] || (v != u && !step) {
                return Err(format!("agent {agent} jumps at time {t}"));
            }
            if next[u as usize] != nobody {
                return Err(format!(
                    "agent {agent} meets {} at time {t}",
                    next[u as usize]
                ));
            }
            next[u as usize] = agent;
        }
        for agent in 0..agents {
            let other = here[at(agent, t + 1) as usize];
            if other != nobody && other != agent && at(other, t + 1) == at(agent, t) {
                return Err(format!("agents {agent} and {other} swap at time {t}"));
            }
        }
        here = next;
    }
    Ok(())
}

/// Whether somebody moves round in a ring of three or more in one step.
pub(crate) fn rings(plan: &Plan) -> bool {
    let at = |agent: usize, t: usize| {
        let path = plan.path(agent);
        path[t.min(path.len() - 1)]
    };
    let agents = plan.agents();
    (1..=plan.makespan() as usize).any(|t| {
        let moves = |agent: usize| at(agent, t) != at(agent, t - 1);
        (0..agents).filter(|&agent| moves(agent)).any(|agent| {
            let mut next = agent;
            (0..agents).any(|_| {
                let to = at(next, t);
                let ahead = (0..agents).find(|&other| at(other, t - 1) == to && moves(other));
                next = ahead.unwrap_or(next);
                ahead == Some(agent)
            })
        })
    })
}

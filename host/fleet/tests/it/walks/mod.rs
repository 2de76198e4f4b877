//! Valid plans without a planner: everybody walks at random and makes room for others.

use fleetyard_abi::{Heading, Instance};
use fleetyard_core::{Connectivity, Grid, GridPlan};
use fleetyard_fleet::batch::{Batch, judge};
use fleetyard_world::SeededRandom;

const NONE: u32 = u32::MAX;

pub(crate) struct Walks {
    pub(crate) grid: Grid,
    pub(crate) random: SeededRandom,
    /// Probability that three or more agents go round in a ring where they could.
    pub(crate) rings: f64,
    /// Probability that an agent waits for a step.
    pub(crate) waits: f64,
    now: Vec<u32>,
    next: Vec<u32>,
    claimed: Vec<u32>,
    occupant: Vec<u32>,
    path: Vec<u32>,
}

impl Walks {
    pub(crate) fn new(grid: Grid, seed: u64) -> Self {
        let cells = grid.cell_count() as usize;
        Self {
            grid,
            random: SeededRandom::new("walks", seed),
            rings: 0.0,
            waits: 0.3,
            now: Vec::new(),
            next: Vec::new(),
            claimed: vec![NONE; cells],
            occupant: vec![NONE; cells],
            path: Vec::new(),
        }
    }

    /// So many steps from there, judged.
    pub(crate) fn batch(&mut self, starts: &[u32], steps: usize, window_steps: u32) -> Batch {
        let mut instance = Instance::one_shot(starts.to_vec(), starts.to_vec());
        instance.window_steps = window_steps;
        let plan = self.plan(starts, steps);
        judge(&self.grid, &instance, plan).expect("walks are valid")
    }

    pub(crate) fn plan(&mut self, starts: &[u32], steps: usize) -> GridPlan {
        let mut paths: Vec<Vec<u32>> = starts.iter().map(|start| vec![*start]).collect();
        self.now = starts.to_vec();
        let mut order: Vec<u32> = (0..starts.len() as u32).collect();
        for _ in 0..steps {
            self.next = vec![NONE; starts.len()];
            self.occupant.fill(NONE);
            self.claimed.fill(NONE);
            for (agent, cell) in self.now.iter().enumerate() {
                self.occupant[*cell as usize] = agent as u32;
            }
            self.random.shuffle(&mut order);
            for agent in &order {
                if self.next[*agent as usize] == NONE {
                    self.path.clear();
                    self.decide(*agent);
                }
            }
            for (path, next) in paths.iter_mut().zip(&self.next) {
                path.push(*next);
            }
            std::mem::swap(&mut self.now, &mut self.next);
        }
        GridPlan::from_paths(paths)
    }

    /// Decides; true if the agent leaves its cell.
    fn decide(&mut self, agent: u32) -> bool {
        self.path.push(agent);
        let leaves = self.choose(agent);
        self.path.pop();
        leaves
    }

    fn choose(&mut self, agent: u32) -> bool {
        let here = self.now[agent as usize];
        let mut to: Vec<u32> = self.grid.neighbors(here, Connectivity::Four).collect();
        self.random.shuffle(&mut to);
        if self.random.unit() < self.waits {
            to.clear();
        }
        for cell in to {
            if self.next[agent as usize] != NONE {
                // It was taken along in a ring.
                return true;
            }
            if self.claimed[cell as usize] != NONE {
                continue;
            }
            let there = self.occupant[cell as usize];
            if there == NONE {
                self.go(agent, cell);
                return true;
            }
            if let Some(at) = self.path.iter().position(|other| *other == there) {
                // Whoever is being asked: a ring, or a swap.
                if self.path.len() - at > 2 && self.random.unit() < self.rings {
                    let ring = self.path[at..].to_vec();
                    for (behind, ahead) in ring.iter().zip(ring.iter().cycle().skip(1)) {
                        let cell = self.now[*ahead as usize];
                        self.go(*behind, cell);
                    }
                    return true;
                }
                continue;
            }
            let decided = self.next[there as usize];
            let leaves = if decided == NONE {
                self.decide(there)
            } else {
                decided != cell
            };
            if self.next[agent as usize] != NONE {
                return true;
            }
            let swaps = self.next[there as usize] == here;
            if leaves && !swaps && self.claimed[cell as usize] == NONE {
                self.go(agent, cell);
                return true;
            }
        }
        if self.next[agent as usize] == NONE {
            self.go(agent, here);
        }
        self.next[agent as usize] != here
    }

    fn go(&mut self, agent: u32, cell: u32) {
        self.next[agent as usize] = cell;
        self.claimed[cell as usize] = agent;
    }
}

pub(crate) fn north(agents: usize) -> Vec<Heading> {
    vec![Heading::North; agents]
}

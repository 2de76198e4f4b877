//! Random scenarios: distinct starts and distinct goals within reach.

use fleetyard_core::{Connectivity, Grid, InputError, Scenario};

use crate::SeededRandom;

/// A scenario of random starts and goals, like MovingAI's `random` ones.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ScenarioSpec {
    /// Number of entries.
    pub agents: u32,
    /// Chooses starts and goals.
    pub seed: u64,
}

impl ScenarioSpec {
    /// The scenario on `grid`; its entries name the map `NAME.map`, and are those of
    /// [`ScenarioSpec::draw`].
    pub fn generate(&self, grid: &Grid) -> Result<Scenario, InputError> {
        let map = format!("{}.map", grid.name());
        Ok(Scenario::of(grid, &map, self.draw(grid)?))
    }

    /// The most agents of a scenario on `grid`: its free cells that have a free neighbour.
    pub fn most(grid: &Grid) -> usize {
        let (_, pools) = pieces(grid);
        let rooms = pools.iter().map(Vec::len).filter(|cells| *cells > 1);
        rooms.sum()
    }

    /// Starts and goals, as cells of `grid`.
    ///
    /// Starts are drawn uniformly from the free cells that have a free
    /// neighbour, goals uniformly from the same piece of the map. No start occurs
    /// twice, no goal occurs twice, and nobody's goal is its own start.
    pub fn draw(&self, grid: &Grid) -> Result<Vec<(u32, u32)>, InputError> {
        let (component, mut pools) = pieces(grid);
        let mut random = SeededRandom::new("scenario", self.seed);
        // A piece of one cell has no goal to go to.
        let mut starts: Vec<u32> = pools
            .iter()
            .filter(|pool| pool.len() > 1)
            .flatten()
            .copied()
            .collect();
        let agents = self.agents as usize;
        if agents == 0 || agents > starts.len() {
            let reason = format!(
                "a scenario of {agents} agents on {}, which has room for {}",
                grid.name(),
                starts.len()
            );
            return Err(InputError::new("agents", reason).hint(match starts.len() {
                0 => "no free cell of the map has a free neighbour".to_owned(),
                most => format!("ask for 1 to {most} agents"),
            }));
        }
        random.shuffle(&mut starts);
        starts.truncate(agents);
        for pool in &mut pools {
            random.shuffle(pool);
        }
        let goals = draw_goals(&starts, &component, pools);
        Ok(starts.into_iter().zip(goals).collect())
    }
}

/// The number of each cell's piece of the map, 0 for blocked cells, and the cells of each piece.
fn pieces(grid: &Grid) -> (Vec<u32>, Vec<Vec<u32>>) {
    let component = grid.components(Connectivity::Four);
    let pieces = component.iter().copied().max().unwrap_or(0) as usize;
    let mut pools: Vec<Vec<u32>> = vec![Vec::new(); pieces + 1];
    for (cell, label) in (0..).zip(&component).filter(|(_, label)| **label > 0) {
        pools[*label as usize].push(cell);
    }
    (component, pools)
}

/// A goal for every start from the shuffled pool of its piece. A pool has as
/// many cells as its piece, so it never runs out.
fn draw_goals(starts: &[u32], component: &[u32], mut pools: Vec<Vec<u32>>) -> Vec<u32> {
    let mut goals: Vec<u32> = Vec::with_capacity(starts.len());
    // Per piece, the last agent that got a goal there.
    let mut latest: Vec<Option<usize>> = vec![None; pools.len()];
    for (agent, start) in starts.iter().copied().enumerate() {
        let piece = component[start as usize] as usize;
        let pool = &mut pools[piece];
        let mut goal = pool.pop().unwrap_or(start);
        if goal == start {
            if let Some(other) = pool.last_mut() {
                std::mem::swap(&mut goal, other);
            } else if let Some(earlier) = latest[piece] {
                // Only the own start is left: the earlier agent, who starts
                // elsewhere, takes it.
                std::mem::swap(&mut goal, &mut goals[earlier]);
            }
        }
        latest[piece] = Some(agent);
        goals.push(goal);
    }
    goals
}

//! Small worlds and plans from seeds, for all tests of this crate.
#![allow(dead_code, reason = "every test binary uses a part of it")]

pub(crate) mod passing;

use fleetyard_core::{Connectivity, Grid, GridPlan};
use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};

/// Uniform in `0..n`, close enough.
pub(crate) fn below(rng: &mut ChaCha8Rng, n: usize) -> usize {
    ((u64::from(rng.next_u32()) * n as u64) >> 32) as usize
}

/// A map on which every cell is solid with the given chance in percent.
pub(crate) fn random_grid(rng: &mut ChaCha8Rng, rows: u32, cols: u32, percent: usize) -> Grid {
    let terrain = (0..rows * cols)
        .map(|_| {
            if below(rng, 100) < percent {
                b'@'
            } else {
                b'.'
            }
        })
        .collect();
    Grid::new("random", rows, cols, terrain).expect("a valid map")
}

/// Distinct free cells.
pub(crate) fn starts(rng: &mut ChaCha8Rng, grid: &Grid, agents: usize) -> Vec<u32> {
    let mut free: Vec<u32> = (0..grid.cell_count())
        .filter(|cell| grid.is_passable(*cell))
        .collect();
    let agents = agents.min(free.len());
    for at in 0..agents {
        let pick = at + below(rng, free.len() - at);
        free.swap(at, pick);
    }
    free.truncate(agents);
    free
}

/// Random walks that obey the standard four-connected rules: no two agents in
/// a cell, no swaps; following into a cell that is being left is allowed.
pub(crate) fn valid_walks(
    rng: &mut ChaCha8Rng,
    grid: &Grid,
    agents: usize,
    steps: usize,
) -> GridPlan {
    let mut now = starts(rng, grid, agents);
    let mut paths: Vec<Vec<u32>> = now.iter().map(|cell| vec![*cell]).collect();
    let mut occupant = vec![usize::MAX; grid.cell_count() as usize];
    let mut claimed = vec![false; grid.cell_count() as usize];
    for (agent, cell) in now.iter().enumerate() {
        occupant[*cell as usize] = agent;
    }
    for _ in 0..steps {
        claimed.fill(false);
        let mut next: Vec<Option<u32>> = vec![None; now.len()];
        let mut order: Vec<usize> = (0..now.len()).collect();
        for at in 0..order.len() {
            let pick = at + below(rng, order.len() - at);
            order.swap(at, pick);
        }
        for agent in order {
            let from = now[agent];
            let options: Vec<u32> = grid.neighbors(from, Connectivity::Four).collect();
            let mut to = from;
            if !options.is_empty() {
                let wish = options[below(rng, options.len())];
                let holder = occupant[wish as usize];
                let leaves = match holder {
                    usize::MAX => true,
                    holder => next[holder].is_some_and(|to| to != wish && to != from),
                };
                if leaves && !claimed[wish as usize] {
                    to = wish;
                }
            }
            claimed[to as usize] = true;
            next[agent] = Some(to);
        }
        occupant.fill(usize::MAX);
        for (agent, to) in next.into_iter().enumerate() {
            let to = to.expect("everyone decides");
            now[agent] = to;
            occupant[to as usize] = agent;
            paths[agent].push(to);
        }
    }
    GridPlan::from_paths(paths)
}

/// Like [`valid_walks`], but agents mostly go straight on, as robots that have
/// somewhere to go.
pub(crate) fn valid_drives(
    rng: &mut ChaCha8Rng,
    grid: &Grid,
    agents: usize,
    steps: usize,
) -> GridPlan {
    const FREE: u32 = u32::MAX;
    let mut now = starts(rng, grid, agents);
    let agents = now.len();
    let mut occupant = vec![FREE; grid.cell_count() as usize];
    for (agent, cell) in now.iter().enumerate() {
        occupant[*cell as usize] = agent as u32;
    }
    let mut headings = vec![0i64; agents];
    let mut cells: Vec<Vec<u32>> = vec![now.clone()];
    let mut options: Vec<u32> = Vec::new();
    for _ in 0..steps {
        // One after the other, so that nobody ever enters a cell that is not
        // free: no swaps, and no rings.
        let mut next = now.clone();
        for agent in 0..agents {
            let from = now[agent];
            options.clear();
            options.extend(
                grid.neighbors(from, Connectivity::Four)
                    .filter(|to| occupant[*to as usize] == FREE),
            );
            let ahead = options
                .iter()
                .copied()
                .find(|to| i64::from(*to) - i64::from(from) == headings[agent]);
            let to = match ahead {
                Some(ahead) if below(rng, 20) > 0 => ahead,
                _ if options.is_empty() => from,
                _ => options[below(rng, options.len())],
            };
            if to != from {
                headings[agent] = i64::from(to) - i64::from(from);
                occupant[to as usize] = agent as u32;
                next[agent] = to;
            }
        }
        // What was left is free in the next step only: there is a gap behind everyone.
        for (from, to) in now.iter().zip(&next) {
            if from != to {
                occupant[*from as usize] = FREE;
            }
        }
        now = next;
        cells.push(now.clone());
    }
    let mut plan = GridPlan::with_capacity(agents, agents * (steps + 1));
    for agent in 0..agents {
        plan.push_path(cells.iter().map(|cells| cells[agent]));
    }
    plan
}

/// Random walks that ignore each other and, if `through_walls`, the obstacles;
/// with `teleports` percent of the steps going anywhere.
pub(crate) fn wild_walks(
    rng: &mut ChaCha8Rng,
    grid: &Grid,
    agents: usize,
    steps: usize,
    through_walls: bool,
    teleports: usize,
) -> GridPlan {
    let open = Grid::new(
        "open",
        grid.rows(),
        grid.cols(),
        vec![b'.'; grid.cell_count() as usize],
    )
    .expect("a valid map");
    let walk_on = if through_walls { &open } else { grid };
    let begin = starts(rng, walk_on, agents);
    GridPlan::from_paths(begin.into_iter().map(|start| {
        let length = below(rng, steps + 1);
        let mut path = vec![start];
        for _ in 0..length {
            let from = path[path.len() - 1];
            let to = if below(rng, 100) < teleports {
                below(rng, grid.cell_count() as usize) as u32
            } else {
                let options: Vec<u32> = walk_on.neighbors(from, Connectivity::Eight).collect();
                if options.is_empty() || below(rng, 5) == 0 {
                    from
                } else {
                    options[below(rng, options.len())]
                }
            };
            path.push(to);
        }
        path
    }))
}

/// Blocks of two by two cells turn, whoever is in them; everybody obeys the rules.
pub(crate) fn turning_blocks(
    rng: &mut ChaCha8Rng,
    grid: &Grid,
    agents: usize,
    steps: usize,
) -> GridPlan {
    let mut now = starts(rng, grid, agents);
    let mut paths: Vec<Vec<u32>> = now.iter().map(|cell| vec![*cell]).collect();
    for _ in 0..steps {
        let mut to: Vec<u32> = (0..grid.cell_count()).collect();
        let (row0, col0) = (below(rng, 2) as u32, below(rng, 2) as u32);
        for row in (row0..grid.rows() - 1).step_by(2) {
            for col in (col0..grid.cols() - 1).step_by(2) {
                let cell = |r: u32, c: u32| (row + r) * grid.cols() + col + c;
                let mut block = [cell(0, 0), cell(0, 1), cell(1, 1), cell(1, 0)];
                if below(rng, 3) == 0 || !block.iter().all(|cell| grid.is_passable(*cell)) {
                    continue;
                }
                if below(rng, 2) == 0 {
                    block.reverse();
                }
                for at in 0..4 {
                    to[block[at] as usize] = block[(at + 1) % 4];
                }
            }
        }
        for (cell, path) in now.iter_mut().zip(&mut paths) {
            *cell = to[*cell as usize];
            path.push(*cell);
        }
    }
    GridPlan::from_paths(paths)
}

/// A generator for one test case.
pub(crate) fn rng(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

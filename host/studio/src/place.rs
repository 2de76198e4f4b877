//! Places for robots: drawn at random, or the nearest that a view takes.
//!
//! Both choose among the middles of free cells of the grid view: a disc of the largest robot is free
//! there, and two of them in two cells are clear of each other.

use std::collections::BTreeMap;
use std::sync::Arc;

use fleetyard_core::{Grid, InputError, cell_center_m, cell_of_point};
use fleetyard_views::{Agent, End, Free, Representation, State, WorldCells};
use fleetyard_world::{ScenarioSpec, Workspace, common_radius_m};

use crate::artefacts::check_cells;
use crate::document::{Document, MOST_AGENTS, too_many};
use crate::edit::Refusal;

/// Two discs that reach over each other by less than this touch, in metres.
const TOUCH_M: f64 = 1e-9;

/// Random starts and goals by a seed, in parts of the ground that are connected, and clear of the
/// agents that are there.
pub(crate) fn scatter(
    document: &Document,
    count: u32,
    kind: u32,
    seed: u64,
    place: &str,
) -> Result<Vec<Agent>, Refusal> {
    let agents = document.agents.len() + count as usize;
    if agents > MOST_AGENTS {
        return Err(too_many("/agents", "agents", agents, MOST_AGENTS));
    }
    let refuse = |error: InputError| Refusal::at(format!("{place}/count"), error);
    let radii = radii(document).map_err(refuse)?;
    let own = radii[kind as usize];
    let largest = document
        .agents
        .iter()
        .map(|agent| radii[agent.robot as usize]);
    let cells = Cells::new(document, largest.fold(own, f64::max)).map_err(refuse)?;
    let taken = [End::Start, End::Goal].map(|end| {
        let places = document.agents.iter().map(|agent| {
            let at = end.of(agent).at_m();
            (at, radii[agent.robot as usize])
        });
        Taken::of(places, cells.side_m)
    });
    // A robot is near nine cells at most, each of which may be the start or the goal of an entry.
    let drawn = count as usize + 18 * document.agents.len();
    let room = ScenarioSpec::most(&cells.grid);
    let agents = drawn.min(room).max(count.min(1) as usize) as u32;
    let pairs = if room == 0 || count == 0 {
        Vec::new()
    } else {
        let spec = ScenarioSpec { agents, seed };
        spec.draw(&cells.grid).map_err(refuse)?
    };
    let pairs = pairs
        .into_iter()
        .map(|(start, goal)| [start, goal].map(|cell| cells.center_m(cell)));
    let free = pairs
        .filter(|[start, goal]| taken[0].is_clear(*start, own) && taken[1].is_clear(*goal, own));
    let rest = |[x_m, y_m]: [f64; 2]| State {
        x_m,
        y_m,
        heading_rad: None,
        trailer_rad: None,
    };
    let agents = free.take(count as usize).map(|[start, goal]| Agent {
        robot: kind,
        start: rest(start),
        goal: rest(goal),
    });
    let agents: Vec<Agent> = agents.collect();
    if agents.len() < count as usize {
        let reason = format!("there is room for {} of {count} robots", agents.len());
        let hint = "scatter fewer or smaller robots, or give them more space";
        return Err(Refusal::new(format!("{place}/count"), reason, hint));
    }
    Ok(agents)
}

/// All agents at places that a view takes: the middles of their cells for a grid; places at which the
/// largest robot's disc is free for a roadmap, the robot's own for the plane. Who is at such a place
/// already stays there, and the others go to the nearest that is left.
pub(crate) fn snap(
    document: &Document,
    view: Representation,
    place: &str,
) -> Result<Vec<Agent>, Refusal> {
    let refuse = |error: InputError| Refusal::at(format!("{place}/view"), error);
    let mut agents = document.agents.to_vec();
    if agents.is_empty() {
        return Ok(agents);
    }
    let radii = radii(document).map_err(refuse)?;
    let of_agents = agents.iter().map(|agent| radii[agent.robot as usize]);
    let largest = of_agents.fold(0.0, f64::max);
    let cells = Cells::new(document, largest).map_err(refuse)?;
    let free = Free::new(&cells.world);
    let of_agents = agents.iter().map(|agent| radii[agent.robot as usize]);
    let smallest = of_agents.fold(f64::INFINITY, f64::min);
    for end in [End::Start, End::Goal] {
        let mut open = Open::new(&cells);
        let mut taken = Taken::of([], 2.0 * largest);
        let mut others = Vec::new();
        for (number, agent) in agents.iter_mut().enumerate() {
            let own = radii[agent.robot as usize];
            let state = match end {
                End::Start => &mut agent.start,
                End::Goal => &mut agent.goal,
            };
            let here = state.at_m();
            let stays = match view {
                Representation::Grid => cells.free_at(here),
                Representation::Roadmap => free.holds(here, largest).then_some(here),
                Representation::Continuous => free.holds(here, own).then_some(here),
            };
            match stays.filter(|at| taken.is_clear(*at, own)) {
                Some(at) => {
                    [state.x_m, state.y_m] = at;
                    taken.add(at, own);
                }
                None => others.push(number),
            }
        }
        for number in others {
            let agent = &mut agents[number];
            let own = radii[agent.robot as usize];
            let state = match end {
                End::Start => &mut agent.start,
                End::Goal => &mut agent.goal,
            };
            let is_clear = |at: [f64; 2]| taken.is_clear(at, own);
            let Some(cell) = open.nearest(state.at_m(), own <= smallest, is_clear) else {
                let reason = format!("no free place is left for the {end} of agent {number}");
                let hint = "remove some robots, make them smaller, or give them more space";
                return Err(Refusal::new(
                    format!("/agents/{number}/{end}"),
                    reason,
                    hint,
                ));
            };
            let at = cells.center_m(cell);
            [state.x_m, state.y_m] = at;
            taken.add(at, own);
            open.close(cell);
        }
    }
    Ok(agents)
}

/// Effective radius of each kind of robots, in metres.
pub(crate) fn radii(document: &Document) -> Result<Vec<f64>, InputError> {
    let shapes = document.robots.iter().map(|(name, profile)| {
        let shape = profile.footprint.shape();
        let shape =
            shape.map_err(|error| InputError::new(name, error.to_string()).hint(error.hint()))?;
        Ok(common_radius_m([&shape]))
    });
    shapes.collect()
}

/// Cells in whose middles robots are placed.
struct Cells {
    world: Arc<Workspace>,
    grid: Arc<Grid>,
    side_m: f64,
    corner_m: [f64; 2],
}

impl Cells {
    /// Those of the grid view, for discs of a radius.
    fn new(document: &Document, radius_m: f64) -> Result<Self, InputError> {
        let (world, spec) = (document.world()?, document.views.grid);
        check_cells(&world, radius_m, spec)?;
        let cells = WorldCells::new(&world, radius_m, spec, "grid")?;
        Ok(Self {
            world,
            grid: cells.grid,
            side_m: cells.cell_m,
            corner_m: cells.corner_m,
        })
    }

    fn center_m(&self, cell: u32) -> [f64; 2] {
        let (x, y) = cell_center_m(&self.grid, self.side_m, cell);
        [self.corner_m[0] + x, self.corner_m[1] + y]
    }

    /// The cell at a place of the world; the border's belong to its last cells.
    fn at(&self, [x, y]: [f64; 2]) -> u32 {
        let within = |value: f64, corner: f64, count: u32| {
            (value - corner).clamp(0.0, (f64::from(count) - 0.5) * self.side_m)
        };
        let x = within(x, self.corner_m[0], self.grid.cols());
        let y = within(y, self.corner_m[1], self.grid.rows());
        cell_of_point(&self.grid, self.side_m, x, y).unwrap_or(0)
    }

    /// The middle of the cell at a place, if that is free.
    fn free_at(&self, place: [f64; 2]) -> Option<[f64; 2]> {
        let cell = self.at(place);
        self.grid.is_passable(cell).then(|| self.center_m(cell))
    }
}

/// Cells that are open, by rows: of each cell the next that is, in either direction. Cells that were
/// closed point past themselves, and ways along them are shortened as they are gone.
struct Open<'a> {
    cells: &'a Cells,
    /// A row has one place more, which ends it.
    right: Vec<u32>,
    left: Vec<u32>,
}

impl<'a> Open<'a> {
    fn new(cells: &'a Cells) -> Self {
        let places = cells.grid.rows() * (cells.grid.cols() + 1);
        let mut open = Self {
            cells,
            right: (0..places).collect(),
            left: (0..places).collect(),
        };
        let blocked = (0..cells.grid.cell_count()).filter(|cell| !cells.grid.is_passable(*cell));
        blocked.for_each(|cell| open.close(cell));
        open
    }

    fn close(&mut self, cell: u32) {
        let (row, col) = self.cells.grid.row_col(cell);
        let at = row * (self.cells.grid.cols() + 1) + col;
        self.right[at as usize] = at + 1;
        // Here the place that ends a row is its first.
        self.left[at as usize + 1] = at;
    }

    fn next(ways: &mut [u32], mut at: u32) -> u32 {
        while ways[at as usize] != at {
            let beyond = ways[ways[at as usize] as usize];
            ways[at as usize] = beyond;
            at = beyond;
        }
        at
    }

    /// The open cell whose middle is nearest to a place, the first among equals, of those where a disc
    /// would be clear. Cells that are clear for `none` of the discs that are to come are closed.
    fn nearest(
        &mut self,
        place: [f64; 2],
        none: bool,
        is_clear: impl Fn([f64; 2]) -> bool,
    ) -> Option<u32> {
        let cells = self.cells;
        let (rows, cols) = (cells.grid.rows(), cells.grid.cols());
        let (row, col) = cells.grid.row_col(cells.at(place));
        let far = |cell: u32| {
            let at = cells.center_m(cell);
            let (x, y) = (at[0] - place[0], at[1] - place[1]);
            (x * x + y * y, at)
        };
        let mut best = (f64::INFINITY, u32::MAX);
        for step in 0..rows {
            let least = (f64::from(step) - 1.0).max(0.0) * cells.side_m;
            if least * least > best.0 {
                break;
            }
            let both = [
                row.checked_sub(step),
                row.checked_add(step).filter(|_| step > 0),
            ];
            for row in both.into_iter().flatten().filter(|row| *row < rows) {
                let first = row * (cols + 1);
                for is_right in [true, false] {
                    let mut at = first + col + u32::from(!is_right);
                    loop {
                        let cell = if is_right {
                            at = Self::next(&mut self.right, at);
                            (at < first + cols).then(|| row * cols + at - first)
                        } else {
                            at = Self::next(&mut self.left, at);
                            (at > first).then(|| row * cols + at - first - 1)
                        };
                        let Some(cell) = cell else { break };
                        let (square, middle) = far(cell);
                        if (square, cell) >= best {
                            break;
                        }
                        if is_clear(middle) {
                            best = (square, cell);
                            break;
                        }
                        if none {
                            self.close(cell);
                        }
                        at = if is_right { at + 1 } else { at - 1 };
                    }
                }
            }
        }
        (best.1 != u32::MAX).then_some(best.1)
    }
}

/// Discs that stand somewhere, by place.
struct Taken {
    side_m: f64,
    largest_m: f64,
    of_tile: BTreeMap<[i64; 2], Vec<([f64; 2], f64)>>,
}

impl Taken {
    fn of(discs: impl IntoIterator<Item = ([f64; 2], f64)>, side_m: f64) -> Self {
        let mut taken = Self {
            side_m,
            largest_m: 0.0,
            of_tile: BTreeMap::new(),
        };
        for (at, radius_m) in discs {
            taken.add(at, radius_m);
        }
        taken
    }

    fn tile(&self, at: [f64; 2]) -> [i64; 2] {
        at.map(|value| (value / self.side_m).floor() as i64)
    }

    fn add(&mut self, at: [f64; 2], radius_m: f64) {
        let tile = self.tile(at);
        self.of_tile.entry(tile).or_default().push((at, radius_m));
        self.largest_m = self.largest_m.max(radius_m);
    }

    /// True if a disc would be clear of all others.
    fn is_clear(&self, at: [f64; 2], radius_m: f64) -> bool {
        let reach = radius_m + self.largest_m;
        let low = self.tile(at.map(|value| value - reach));
        let high = self.tile(at.map(|value| value + reach));
        let mut rows = low[1]..=high[1];
        rows.all(|row| {
            (low[0]..=high[0]).all(|col| {
                let discs = self.of_tile.get(&[col, row]);
                discs.into_iter().flatten().all(|(other, other_m)| {
                    let (x, y) = (at[0] - other[0], at[1] - other[1]);
                    let apart = radius_m + other_m - TOUCH_M;
                    x * x + y * y >= apart * apart
                })
            })
        })
    }
}

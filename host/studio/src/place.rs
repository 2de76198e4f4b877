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
    for end in [End::Start, End::Goal] {
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
            let nearest = cells.nearest(state.at_m(), |at| taken.is_clear(at, own));
            let Some(at) = nearest else {
                let reason = format!("no free place is left for the {end} of agent {number}");
                let hint = "remove some robots, make them smaller, or give them more space";
                return Err(Refusal::new(
                    format!("/agents/{number}/{end}"),
                    reason,
                    hint,
                ));
            };
            [state.x_m, state.y_m] = at;
            taken.add(at, own);
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

    /// The middle of a free cell that is nearest to a place, among those that are clear. Cells are
    /// searched ring by ring around the one at the place.
    fn nearest(&self, place: [f64; 2], is_clear: impl Fn([f64; 2]) -> bool) -> Option<[f64; 2]> {
        let (rows, cols) = (self.grid.rows(), self.grid.cols());
        let (row, col) = self.grid.row_col(self.at(place));
        let mut best: Option<(f64, [f64; 2])> = None;
        let mut found_in = None;
        for ring in 0..rows.max(cols) {
            // A cell of a ring may be farther than one of the next, by a factor of √2.
            if found_in.is_some_and(|first: u32| ring > first + first / 2 + 2) {
                break;
            }
            let mut look = |row: u32, col: u32| {
                let cell = row * cols + col;
                if !self.grid.is_passable(cell) {
                    return;
                }
                let at = self.center_m(cell);
                let (x, y) = (at[0] - place[0], at[1] - place[1]);
                let square = x * x + y * y;
                if best.is_none_or(|(least, _)| square < least) && is_clear(at) {
                    best = Some((square, at));
                }
            };
            let span = |middle: u32, count: u32| {
                middle.saturating_sub(ring)..=(middle + ring).min(count - 1)
            };
            for other in span(row, rows) {
                if other.abs_diff(row) == ring {
                    span(col, cols).for_each(|col| look(other, col));
                } else {
                    let ends = [col.checked_sub(ring), Some(col + ring)];
                    let ends = ends.into_iter().flatten().filter(|col| *col < cols);
                    ends.for_each(|col| look(other, col));
                }
            }
            if found_in.is_none() && best.is_some() {
                found_in = Some(ring);
            }
        }
        best.map(|(_, at)| at)
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

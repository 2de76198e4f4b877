//! Instances for plugins: small ones, drawn by hand where the answer is to be known, made from a
//! seed where many are wanted, and one that no planner can finish. They are on grids, from which
//! those on roadmaps and in the plane can be made.

pub(crate) mod roadmap;
pub(crate) mod robots;
pub(crate) mod workspace;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::sync::Arc;

use fleetyard_abi::{
    FleetState, Heading, Instance, Motion, Objective, Plan, Request, Robot, SharedEnvironment, Task,
};
use fleetyard_core::{Connectivity, Grid, GridInstance};
use fleetyard_world::SeededRandom;
use fleetyard_world::{
    EmptySpec, MapSpec, MazeAlgorithm, MazeRandom, MazeSpec, RandomSpec, RoomSpec,
};

use crate::judge;
use crate::question::Question;
use crate::rules::{Rules, other_form};
use crate::stop::{Step, Stop};

const CELL_SIZE_M: f64 = 1.0;
const STEP_S: f64 = 1.0;

/// Radius of robots: discs that keep clear of each other where one follows another round a corner.
pub(crate) const RADIUS_M: f64 = 0.35;

/// All headings, by their numbers.
pub(crate) const HEADINGS: [Heading; 4] =
    [Heading::East, Heading::South, Heading::West, Heading::North];

/// An instance with a name.
#[derive(Debug, Clone)]
pub(crate) struct Scene {
    pub(crate) name: String,
    pub(crate) grid: Arc<Grid>,
    pub(crate) connectivity: Connectivity,
    pub(crate) starts: Vec<u32>,
    pub(crate) goals: Vec<Vec<u32>>,
    pub(crate) headings: Option<Vec<Heading>>,
    pub(crate) motion: Motion,
    pub(crate) objective: Objective,
    pub(crate) window_steps: u32,
    /// True if agents may move round in a ring.
    pub(crate) allows_cycles: bool,
    /// The least sum of costs, where it is known.
    pub(crate) best: Option<u64>,
    pub(crate) demand: Demand,
    /// That it cannot be solved is because there are several agents.
    pub(crate) crowded: bool,
    /// The radius of every agent's disc, where they differ.
    pub(crate) radii_m: Vec<f64>,
}

/// The work that the fleet of a scene has, for instance generators.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Demand {
    /// Every third agent has still to reach its goal, and there are tasks for about
    /// half of the fleet.
    Some,
    /// No goals, no tasks.
    Nothing,
    /// Everybody has a goal, and there are no tasks.
    Everything,
}

/// Cells of the letters of a drawing, by letter.
fn lettered(rows: &[&str]) -> Vec<u32> {
    let mut found: Vec<(u8, u32)> = rows
        .concat()
        .bytes()
        .zip(0..)
        .filter(|(letter, _)| letter.is_ascii_lowercase())
        .collect();
    found.sort_unstable();
    found.into_iter().map(|(_, cell)| cell).collect()
}

impl Scene {
    /// From two drawings of the same map: agents are small letters where they
    /// start, and where they have to go.
    pub(crate) fn drawn(name: &str, starts: &[&str], goals: &[&str]) -> Step<Self> {
        let text = starts.concat();
        let ground = |letter: u8| {
            if letter.is_ascii_lowercase() {
                b'.'
            } else {
                letter
            }
        };
        let cols = starts.first().map_or(0, |row| row.len());
        let grid = Grid::new(
            name,
            starts.len() as u32,
            cols as u32,
            text.bytes().map(ground).collect(),
        )?;
        Ok(Self::new(name, grid, lettered(starts), lettered(goals)))
    }

    pub(crate) fn new(name: &str, grid: Grid, starts: Vec<u32>, goals: Vec<u32>) -> Self {
        Self {
            name: name.into(),
            grid: Arc::new(grid),
            connectivity: Connectivity::Four,
            starts,
            goals: goals.into_iter().map(|goal| vec![goal]).collect(),
            headings: None,
            motion: Motion::Pebble,
            objective: Objective::SumOfCosts,
            window_steps: 0,
            allows_cycles: true,
            best: None,
            demand: Demand::Some,
            crowded: false,
            radii_m: Vec::new(),
        }
    }

    /// Two agents at their goals.
    pub(crate) fn pair() -> Step<Self> {
        Self::drawn("pair", &["ab"], &["ab"])
    }

    /// The same on one-way streets: a drawing of the map in which an arrow, one of `^>v<`, is the
    /// only way out of its cell.
    pub(crate) fn one_way(mut self, arrows: &[&str]) -> Step<Self> {
        let arrows = arrows.concat();
        let masks = arrows.bytes().zip(0..).map(|(arrow, cell)| {
            let all = self.grid.move_mask(cell, Connectivity::Eight);
            let only = b"^>v<".iter().position(|known| *known == arrow);
            only.map_or(all, |bit| all & (1 << bit))
        });
        let masks = masks.collect();
        let grid = Grid::clone(&self.grid).with_moves(masks);
        let grid = grid.map_err(|error| Stop::failed(format!("the kit has no map: {error}")))?;
        self.grid = Arc::new(grid);
        Ok(self)
    }

    /// The models of robots and the model of every agent, where they differ.
    fn robots(&self) -> (Vec<Robot>, Vec<u32>) {
        let mut radii = self.radii_m.clone();
        radii.sort_by(f64::total_cmp);
        radii.dedup();
        let model = |radius: &f64| {
            radii
                .iter()
                .position(|known| known.total_cmp(radius).is_eq())
        };
        let robot_of = self.radii_m.iter().filter_map(model);
        let robots = radii.iter().map(|radius| robots::disc(*radius));
        (
            robots.collect(),
            robot_of.map(|model| model as u32).collect(),
        )
    }

    /// Nobody can solve it, though each agent alone would arrive.
    pub(crate) fn crowded(mut self) -> Self {
        self.crowded = true;
        self
    }

    /// The first agent alone: for planners that plan for one.
    fn alone(&self) -> Self {
        let mut alone = self.clone();
        alone.starts.truncate(1);
        alone.goals.truncate(1);
        alone.radii_m.truncate(1);
        if let Some(headings) = &mut alone.headings {
            headings.truncate(1);
        }
        if self.agents() > 1 {
            alone.best = None;
        }
        alone
    }

    /// The least sum of costs.
    pub(crate) fn best(mut self, best: u64) -> Self {
        self.best = Some(best);
        self
    }

    /// A map of a random sort and size, and agents on it who can reach their goals:
    /// the goals are where the agents end when they go for random walks, one after
    /// the other. So there is always a plan.
    pub(crate) fn random(name: &str, random: &mut SeededRandom, agents: usize) -> Step<Self> {
        let grid = random_map(random)?;
        let room = grid.passable_count() as usize / 4;
        let agents = 1 + random.below(agents.min(room).max(1));
        Ok(Self::with_walks(name, grid, agents, random))
    }

    /// As many agents as possible up to a number, without walls.
    pub(crate) fn open(
        name: &str,
        side: u32,
        agents: usize,
        random: &mut SeededRandom,
    ) -> Step<Self> {
        let grid = EmptySpec {
            rows: side,
            cols: side,
        }
        .generate()?;
        Ok(Self::with_walks(name, grid, agents, random))
    }

    fn with_walks(name: &str, grid: Grid, agents: usize, random: &mut SeededRandom) -> Self {
        let mut cells = free_cells(&grid);
        random.shuffle(&mut cells);
        cells.truncate(agents);
        let walked = walks(&grid, &cells, random);
        let goals = walked.iter().filter_map(|path| path.last().copied());
        let goals = goals.collect();
        Self::new(name, grid, cells, goals)
    }

    /// Two agents at the end of a blind alley of three cells would have to change
    /// places, which is impossible, beside a crowd that has room for more positions
    /// than anybody can go through: proving it takes ages unless one looks at the
    /// alley alone.
    pub(crate) fn jam(random: &mut SeededRandom) -> Step<Self> {
        const SIDE: usize = 16;
        const CROWD: usize = 40;
        let mut terrain = vec![b'.'; SIDE * SIDE];
        terrain.extend([b'@'; SIDE]);
        let alley = terrain.len() as u32;
        terrain.extend(b"...");
        terrain.extend([b'@'; SIDE - 3]);
        let grid = Grid::new("jam", SIDE as u32 + 2, SIDE as u32, terrain)?;
        let mut draw = || {
            let mut cells: Vec<u32> = (0..(SIDE * SIDE) as u32).collect();
            random.shuffle(&mut cells);
            cells.truncate(CROWD);
            cells
        };
        let (mut starts, mut goals) = (draw(), draw());
        starts.extend([alley, alley + 1]);
        goals.extend([alley + 1, alley]);
        Ok(Self::new("jam", grid, starts, goals).crowded())
    }

    /// A map of 256 × 256 cells with one agent in it: a lot to learn.
    pub(crate) fn large(random: &mut SeededRandom) -> Step<Self> {
        let grid = RandomSpec {
            rows: 256,
            cols: 256,
            obstacle_density: 0.2,
            seed: random.below(1 << 31) as u64,
        }
        .generate()?;
        Ok(Self::with_walks("large", grid, 1, random))
    }

    /// Two agents whose ways cross in the middle of a large open map.
    pub(crate) fn vast() -> Step<Self> {
        const SIDE: u32 = 1000;
        let grid = EmptySpec {
            rows: SIDE,
            cols: SIDE,
        }
        .generate()?;
        let cell = |row: u32, col: u32| row * SIDE + col;
        let starts = vec![cell(200, 350), cell(350, 800)];
        let goals = vec![cell(800, 650), cell(650, 200)];
        Ok(Self::new("vast", grid, starts, goals))
    }

    /// The same, where agents have to turn before they go another way.
    pub(crate) fn turning(mut self) -> Self {
        let headings = (0..self.starts.len()).map(|agent| HEADINGS[agent % 4]);
        self.headings = Some(headings.collect());
        self.motion = Motion::Rotation;
        self.best = None;
        self
    }

    /// The first agent alone, which goes in straight lines.
    pub(crate) fn straight(&self) -> Self {
        let mut alone = self.alone();
        alone.motion = Motion::AnyAngle;
        alone.best = None;
        alone
    }

    pub(crate) fn agents(&self) -> usize {
        self.starts.len()
    }

    /// The same agents, all at home: what any map allows.
    pub(crate) fn home(&self) -> Result<GridInstance, String> {
        let starts = self.starts.clone();
        GridInstance::new(
            Arc::clone(&self.grid),
            self.connectivity,
            starts.clone(),
            starts,
        )
        .map_err(|error| error.to_string())
    }
}

impl Question for Scene {
    fn name(&self) -> &str {
        &self.name
    }

    fn environment(&self) -> Step<SharedEnvironment> {
        Ok(fleetyard_runtime::environment_of(
            &self.grid,
            self.connectivity,
            CELL_SIZE_M,
            STEP_S,
        ))
    }

    fn instance(&self) -> Instance {
        let (robots, robot_of) = self.robots();
        Instance {
            starts: self.starts.clone(),
            robots,
            robot_of,
            headings: self.headings.clone(),
            goals: self.goals.iter().cloned().collect(),
            motion: self.motion,
            objective: self.objective,
            window_steps: self.window_steps,
            radius_m: RADIUS_M,
            allows_cycles: self.allows_cycles,
            ..Instance::default()
        }
    }

    fn state(&self) -> FleetState {
        let open = |(agent, goals): (usize, &Vec<u32>)| match self.demand {
            Demand::Everything => goals.clone(),
            Demand::Some if agent % 3 == 0 => goals.clone(),
            Demand::Some | Demand::Nothing => Vec::new(),
        };
        let goals: Vec<Vec<u32>> = self.goals.iter().enumerate().map(open).collect();
        // Within reach of the first agent, and so of all but in a jam.
        let component = self.grid.components(Connectivity::Four);
        let home = self
            .starts
            .first()
            .map_or(0, |start| component[*start as usize]);
        let cells: Vec<u32> = free_cells(&self.grid)
            .into_iter()
            .filter(|cell| home == 0 || component[*cell as usize] == home)
            .collect();
        let tasks = match self.demand {
            Demand::Some => self.agents() / 2 + 1,
            Demand::Nothing | Demand::Everything => 0,
        };
        let task = |index: usize| Task {
            id: 100 + index as u64,
            places: [index * 7, index * 11 + 3]
                .into_iter()
                .filter_map(|at| cells.get(at % cells.len().max(1)).copied())
                .collect(),
            released_s: index as f64,
        };
        FleetState {
            time_s: 12.5,
            next: Instance {
                goals: goals.into_iter().collect(),
                ..self.instance()
            },
            tasks: (0..tasks).map(task).collect(),
            parts: Vec::new(),
        }
    }

    fn first_agent(&self) -> Box<dyn Question> {
        Box::new(self.alone())
    }

    fn pair(&self) -> Step<Option<Box<dyn Question>>> {
        let several = self.motion == Motion::Pebble;
        let pair = several.then(Self::pair).transpose()?;
        Ok(pair.map(|pair| Box::new(pair) as Box<dyn Question>))
    }

    fn is_crowded(&self) -> bool {
        self.crowded
    }

    fn best(&self) -> Option<f64> {
        self.best.map(|best| best as f64)
    }

    fn judge(&self, plan: &Plan, rules: Rules) -> Result<f64, String> {
        let cells = plan.cells().ok_or_else(|| other_form("paths", plan))?;
        if rules.may_collide {
            judge::paths(self, cells)?;
            return Ok(cells.sum_of_costs() as f64);
        }
        let cost = judge::plan(self, cells, rules.arrival, rules.delay)?;
        Ok(cost as f64)
    }

    fn judge_request(&self, request: &Request) -> Result<(), String> {
        judge::request(self, request)
    }

    fn picture(&self) -> String {
        let (rows, cols) = (self.grid.rows() as usize, self.grid.cols() as usize);
        if rows > 20 || cols > 36 || self.agents() > 26 {
            return String::new();
        }
        let ground: Vec<u8> = self
            .grid
            .terrain()
            .iter()
            .map(|letter| {
                if Grid::letter_is_passable(*letter) {
                    b'.'
                } else {
                    b'@'
                }
            })
            .collect();
        let letters = |cells: &mut dyn Iterator<Item = u32>| {
            let mut drawing = ground.clone();
            for (cell, letter) in cells.zip(b'a'..) {
                if let Some(place) = drawing.get_mut(cell as usize) {
                    *place = letter;
                }
            }
            drawing
        };
        let starts = letters(&mut self.starts.iter().copied());
        let last = |goals: &Vec<u32>| goals.last().copied().unwrap_or(u32::MAX);
        let goals = letters(&mut self.goals.iter().map(last));
        let mut text = format!("\n{:cols$}   goals", "starts");
        for (from, to) in starts.chunks(cols).zip(goals.chunks(cols)) {
            let (from, to) = (String::from_utf8_lossy(from), String::from_utf8_lossy(to));
            // Writing to a string cannot fail.
            let _ = write!(text, "\n{from:6}   {to}");
        }
        text
    }
}

/// The middle of a cell in the plane: x goes right and y up from the lower left corner of the map.
fn middle_m(grid: &Grid, cell: u32) -> [f64; 2] {
    let (row, col) = grid.row_col(cell);
    let up = grid.rows().saturating_sub(row + 1);
    [col, up].map(|cells| (f64::from(cells) + 0.5) * CELL_SIZE_M)
}

/// Agents as lines, if they are few enough to be of use.
fn listed(agents: impl ExactSizeIterator<Item = String>) -> String {
    if agents.len() > 26 {
        return String::new();
    }
    let lines = agents.enumerate();
    lines.fold(String::new(), |mut text, (agent, way)| {
        // Writing to a string cannot fail.
        let _ = write!(text, "\nagent {agent}: {way}");
        text
    })
}

pub(crate) fn free_cells(grid: &Grid) -> Vec<u32> {
    (0..grid.cell_count())
        .filter(|cell| grid.is_passable(*cell))
        .collect()
}

/// A map of a random sort, of 6 to 14 rows and columns, whose free cells are in one piece.
pub(crate) fn random_map(random: &mut SeededRandom) -> Step<Grid> {
    let (rows, cols) = (6 + random.below(9) as u32, 6 + random.below(9) as u32);
    let seed = random.below(1 << 31) as u64;
    let spec = match random.below(4) {
        0 => MapSpec::Empty(EmptySpec { rows, cols }),
        1 => MapSpec::Random(RandomSpec {
            rows,
            cols,
            obstacle_density: 0.2,
            seed,
        }),
        2 => MapSpec::Room(RoomSpec {
            rows,
            cols,
            room_size: 4,
            doors: 1,
            seed,
        }),
        _ => MapSpec::Maze(MazeSpec {
            rows: rows | 1,
            cols: cols | 1,
            corridor: 1,
            algorithm: MazeAlgorithm::Backtracker,
            random: MazeRandom::ChaCha,
            loops: 0,
            seed,
        }),
    };
    Ok(spec.generate()?)
}

/// Paths of agents that go for walks one after the other, round those that stand: a plan for whoever has to
/// go where they end.
pub(crate) fn walks(grid: &Grid, starts: &[u32], random: &mut SeededRandom) -> Vec<Vec<u32>> {
    const ROUNDS: usize = 2;
    let mut paths: Vec<Vec<u32>> = starts.iter().map(|start| vec![*start]).collect();
    let end = |path: &Vec<u32>| path.last().copied().unwrap_or_default();
    let mut order: Vec<usize> = (0..paths.len()).collect();
    for _ in 0..ROUNDS {
        random.shuffle(&mut order);
        for agent in &order {
            let standing: BTreeSet<u32> = paths.iter().map(end).collect();
            let mut reached = vec![end(&paths[*agent])];
            let mut came: BTreeMap<u32, u32> = reached.iter().map(|from| (*from, *from)).collect();
            let mut next = 0;
            while let Some(cell) = reached.get(next).copied() {
                next += 1;
                for near in grid.neighbors(cell, Connectivity::Four) {
                    if !standing.contains(&near) && !came.contains_key(&near) {
                        came.insert(near, cell);
                        reached.push(near);
                    }
                }
            }
            let mut way = vec![reached[random.below(reached.len())]];
            while let Some(from) = way.last().and_then(|cell| came.get(cell)) {
                if way.last() == Some(from) {
                    break;
                }
                way.push(*from);
            }
            way.reverse();
            let steps = way.len() - 1;
            for (other, path) in paths.iter_mut().enumerate() {
                let stay = end(path);
                if other == *agent {
                    path.extend_from_slice(&way[1..]);
                } else {
                    path.extend(std::iter::repeat_n(stay, steps));
                }
            }
        }
    }
    paths
}

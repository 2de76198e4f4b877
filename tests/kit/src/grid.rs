//! Grid cases, and a judge of plans that knows nothing of any planner's tables.

use std::error::Error;
use std::path::{Path, PathBuf};

use fleetyard_abi::SharedEnvironment;
use fleetyard_abi::{Environment, Goals, GridEnvironment, Heading, Instance, Motion, c};

const NOBODY: usize = usize::MAX;

/// A four-connected map from rows of text, `.` passable.
pub fn drawn(rows: &[impl AsRef<str>]) -> GridEnvironment {
    let letters = rows.iter().flat_map(|row| row.as_ref().bytes());
    let passable = letters.map(|letter| u8::from(letter == b'.')).collect();
    let cols = rows.first().map_or(0, |row| row.as_ref().len());
    GridEnvironment::four_connected(rows.len() as u32, cols as u32, passable)
}

/// The passable cells, in order.
pub fn free(map: &GridEnvironment) -> Vec<u32> {
    let cells = (0..).zip(&map.passable);
    cells
        .filter_map(|(cell, free)| (*free != 0).then_some(cell))
        .collect()
}

/// The passable cells beside one to which a move may lead: north, east, south, west.
pub fn near(map: &GridEnvironment, cell: u32) -> impl Iterator<Item = u32> + '_ {
    let (rows, cols) = (map.rows, map.cols);
    let around = [
        (cell >= cols).then(|| cell - cols),
        (cell % cols + 1 < cols).then(|| cell + 1),
        (cell / cols + 1 < rows).then(|| cell + cols),
        (!cell.is_multiple_of(cols)).then(|| cell - 1),
    ];
    let may = move |d: usize| map.moves[cell as usize] >> d & 1 == 1;
    let around = around.into_iter().enumerate();
    let around = around.filter_map(move |(d, beside)| beside.filter(|_| may(d)));
    around.filter(|beside| map.passable[*beside as usize] != 0)
}

/// Shelves of ten by two cells with aisles of one cell between them.
pub fn warehouse(rows: u32, cols: u32) -> GridEnvironment {
    let free = |row: u32, col: u32| {
        row.is_multiple_of(3)
            || col.is_multiple_of(11)
            || !(4..cols - 4).contains(&col)
            || row >= rows - 1
    };
    let cells = (0..rows).flat_map(|row| (0..cols).map(move |col| u8::from(free(row, col))));
    GridEnvironment::four_connected(rows, cols, cells.collect())
}

/// Streets of one cell's width that lead one way each: rows east and west in turn, columns north and
/// south, and those at the edge round the map, so that every cell can be reached from every other one.
/// `side` is even.
pub fn one_way(side: u32) -> GridEnvironment {
    let mut map = GridEnvironment::four_connected(side, side, vec![1; (side * side) as usize]);
    for (cell, moves) in (0..).zip(&mut map.moves) {
        let (row, col) = (cell / side, cell % side);
        let row = if row % 2 == 0 {
            c::MOVE_EAST
        } else {
            c::MOVE_WEST
        };
        let col = if col % 2 == 0 {
            c::MOVE_NORTH
        } else {
            c::MOVE_SOUTH
        };
        *moves &= row | col;
    }
    map
}

/// The passable cells that can be reached from one, in order.
pub fn region(map: &GridEnvironment, from: u32) -> Vec<u32> {
    let mut seen = vec![false; map.passable.len()];
    let mut open = vec![from];
    while let Some(cell) = open.pop() {
        if !std::mem::replace(&mut seen[cell as usize], true) {
            open.extend(near(map, cell));
        }
    }
    let cells = (0..).zip(seen);
    cells
        .filter_map(|(cell, seen)| seen.then_some(cell))
        .collect()
}

/// Lists of goals, one per agent.
pub fn goals(lists: &[impl AsRef<[u32]>]) -> Goals {
    let lists = lists.iter().map(AsRef::as_ref);
    lists.map(|list| list.iter().copied()).collect()
}

/// The goals of a list that a path visits in their order.
pub fn visited(goals: &[u32], path: &[u32]) -> usize {
    let mut next = 0;
    for cell in path {
        while goals.get(next) == Some(cell) {
            next += 1;
        }
    }
    next
}

/// Mixes the bits of a number: the step of SplitMix64 (Steele, Lea and Flood, 2014).
pub fn mix(mut x: u64) -> u64 {
    x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ x >> 31
}

/// Map and scenario `NAME-random-NUMBER.scen` of MovingAI below `FLEETYARD_DATA`; says so where
/// there are none.
pub fn movingai(name: &str, number: u32) -> Option<(PathBuf, PathBuf)> {
    let folder = std::env::var_os("FLEETYARD_DATA").map(PathBuf::from);
    let folder = folder.map(|data| data.join("movingai").join(name));
    let Some(folder) = folder.filter(|folder| folder.exists()) else {
        println!("skipped: FLEETYARD_DATA has no movingai/{name}");
        return None;
    };
    let scenario = folder.join(format!("{name}-random-{number}.scen"));
    Some((folder.join(format!("{name}.map")), scenario))
}

/// A map, and the agents' tasks on it.
#[derive(Debug, Clone)]
pub struct Case {
    /// The map.
    pub map: GridEnvironment,
    /// The tasks.
    pub instance: Instance,
}

impl Case {
    /// Rows of text, `.` passable, and (start, goal) cells.
    pub fn new(map: &[&str], agents: &[(u32, u32)]) -> Self {
        let (starts, goals) = agents.iter().copied().unzip();
        Self {
            map: drawn(map),
            instance: Instance::one_shot(starts, goals),
        }
    }

    /// Two drawings with `@` blocked: letters are starts in the first and goals in the second.
    pub fn lettered(from: &[&str], to: &[&str]) -> Self {
        let places = |rows: &[&str]| -> Vec<u32> {
            let letters = rows.concat().into_bytes().into_iter().zip(0..);
            let mut found: Vec<(u8, u32)> =
                letters.filter(|(b, _)| b.is_ascii_lowercase()).collect();
            found.sort_unstable();
            found.into_iter().map(|(_, cell)| cell).collect()
        };
        let free = |row: &&str| row.replace(|letter| letter != '@', ".");
        Self {
            map: drawn(&from.iter().map(free).collect::<Vec<_>>()),
            instance: Instance::one_shot(places(from), places(to)),
        }
    }

    /// The first agents of a MovingAI scenario.
    pub fn read(map: &Path, scenario: &Path, agents: usize) -> Result<Self, Box<dyn Error>> {
        let map = std::fs::read_to_string(map)?;
        let (_, body) = map.split_once("map\n").ok_or("the map has no body")?;
        let rows: Vec<&str> = body.lines().map(str::trim_end).collect();
        let cols = rows.first().map_or(0, |row| row.len()) as u32;
        let mut pairs = Vec::new();
        let scenario = std::fs::read_to_string(scenario)?;
        for line in scenario.lines().skip(1).take(agents) {
            let fields: Vec<&str> = line.split('\t').collect();
            let cell = |x: usize| -> Result<u32, Box<dyn Error>> {
                let at = |k: usize| fields.get(k).ok_or("a scenario line is too short");
                Ok(at(x + 1)?.parse::<u32>()? * cols + at(x)?.parse::<u32>()?)
            };
            pairs.push((cell(4)?, cell(6)?));
        }
        Ok(Self::new(&rows, &pairs))
    }

    /// A square with so many sixteenths of its cells blocked, and agents with starts and goals
    /// in its largest connected part, all by a seed.
    pub fn square(side: u32, agents: usize, blocked: u64, seed: u64) -> Self {
        let passable = (0..side * side)
            .map(|cell| u8::from(mix(seed ^ u64::from(cell)) % 16 >= blocked))
            .collect();
        let map = GridEnvironment::four_connected(side, side, passable);
        let mut left = free(&map);
        let mut largest = Vec::new();
        while let Some(&from) = left.first() {
            let part = region(&map, from);
            left.retain(|cell| part.binary_search(cell).is_err());
            if part.len() > largest.len() {
                largest = part;
            }
        }
        let pick = |salt: u64| {
            let mut cells = largest.clone();
            cells.sort_by_key(|&cell| mix(seed ^ salt ^ u64::from(cell)));
            cells.truncate(agents);
            cells
        };
        Self {
            instance: Instance::one_shot(pick(1 << 40), pick(1 << 41)),
            map,
        }
    }

    /// Everybody looks to the east and takes a step to turn.
    #[must_use]
    pub fn turning(mut self) -> Self {
        self.instance.motion = Motion::Rotation;
        self.instance.headings = Some(vec![Heading::East; self.instance.agents()]);
        self
    }

    /// Nobody may move round in a ring.
    #[must_use]
    pub fn without_rings(mut self) -> Self {
        self.instance.allows_cycles = false;
        self
    }

    /// Only so many steps matter, and agents have several goals.
    #[must_use]
    pub fn windowed(mut self, window: u32, lists: &[Vec<u32>]) -> Self {
        self.instance.goals = goals(lists);
        self.instance.window_steps = window;
        self
    }

    /// The map as a host hands it to a plugin.
    pub fn environment(&self) -> SharedEnvironment {
        Environment::from(self.map.clone()).into()
    }

    /// The reason why paths are no plan for the instance: [`motions`](Self::motions),
    /// [`arrivals`](Self::arrivals) unless there is a window, [`collisions`](Self::collisions).
    pub fn judge(&self, paths: &[impl AsRef<[u32]>], delay: u32) -> Result<(), String> {
        self.motions(paths)?;
        if self.instance.window_steps == 0 {
            self.arrivals(paths)?;
        }
        self.collisions(paths, delay)
    }

    /// The reason why agents that are alone cannot follow the paths: starts, walls, jumps, turns.
    pub fn motions(&self, paths: &[impl AsRef<[u32]>]) -> Result<(), String> {
        let agents = self.instance.agents();
        if paths.len() != agents {
            return Err(format!("{} paths for {agents} agents", paths.len()));
        }
        for (agent, path) in paths.iter().enumerate() {
            let path = path.as_ref();
            if path.first() != Some(&self.instance.starts[agent]) {
                return Err(format!("agent {agent} does not begin at its start"));
            }
            for (time, step) in (1..).zip(path.windows(2)) {
                let [from, to] = [step[0], step[1]];
                if from != to && !near(&self.map, from).any(|cell| cell == to) {
                    return Err(format!("agent {agent} goes from {from} to {to} at {time}"));
                }
            }
            self.turns(agent, path)?;
        }
        Ok(())
    }

    fn turns(&self, agent: usize, path: &[u32]) -> Result<(), String> {
        let (Motion::Rotation, Some(headings)) = (self.instance.motion, &self.instance.headings)
        else {
            return Ok(());
        };
        let mut heading = headings[agent].code();
        let mut waited = 0;
        for (time, step) in (1..).zip(path.windows(2)) {
            let by = i64::from(step[1]) - i64::from(step[0]);
            if by == 0 {
                waited += 1;
                continue;
            }
            let towards = self.towards(by).code();
            let apart = (heading - towards).rem_euclid(4);
            if waited < apart.min(4 - apart) {
                return Err(format!(
                    "agent {agent} moves at {time} before it has turned"
                ));
            }
            (heading, waited) = (towards, 0);
        }
        Ok(())
    }

    /// The heading of a move to a cell beside, from the difference of the cells' numbers.
    pub fn towards(&self, by: i64) -> Heading {
        match by {
            by if by == i64::from(self.map.cols) => Heading::South,
            by if by == -i64::from(self.map.cols) => Heading::North,
            1 => Heading::East,
            _ => Heading::West,
        }
    }

    /// Refuses paths of an agent that does not visit its goals in their order, or does not end its
    /// path at once when it is at the last one.
    pub fn arrivals(&self, paths: &[impl AsRef<[u32]>]) -> Result<(), String> {
        for (agent, path) in paths.iter().enumerate() {
            let (goals, path) = (&self.instance.goals[agent], path.as_ref());
            if visited(goals, path) < goals.len() {
                return Err(format!("agent {agent} does not visit its goals"));
            }
            if !goals.is_empty() && path.last() != goals.last() {
                return Err(format!("agent {agent} does not stay at its goal"));
            }
            if path.len() > 1 && path[path.len() - 2] == path[path.len() - 1] {
                return Err(format!(
                    "the path of agent {agent} goes on after its arrival"
                ));
            }
        }
        Ok(())
    }

    /// Refuses agents that are where another one was or will be within so many steps of delay, that
    /// change places, or that go round in a ring where that is not allowed. Agents stay where their
    /// paths end.
    pub fn collisions(&self, paths: &[impl AsRef<[u32]>], delay: u32) -> Result<(), String> {
        let agents = paths.len();
        let at = |agent: usize, time: usize| {
            let path = paths[agent].as_ref();
            path[time.min(path.len() - 1)]
        };
        let longest = paths.iter().map(|path| path.as_ref().len()).max();
        let last = match self.instance.window_steps {
            0 => longest.unwrap_or(0) + delay as usize,
            window => window as usize,
        };
        // Who is in each cell, now and in the steps before that matter.
        let mut recent: Vec<Vec<usize>> = Vec::new();
        for time in 0..=last {
            let mut here = vec![NOBODY; self.map.passable.len()];
            for agent in 0..agents {
                let cell = at(agent, time);
                let other = std::mem::replace(&mut here[cell as usize], agent);
                if other != NOBODY {
                    return Err(format!(
                        "agents {other} and {agent} are in {cell} at {time}"
                    ));
                }
                let before = recent.iter().rev().take(delay as usize);
                for (ago, before) in (1..).zip(before) {
                    let other = before[cell as usize];
                    if other != NOBODY && other != agent {
                        return Err(format!(
                            "agents {other} and {agent} are in {cell} at {} and {time}",
                            time - ago
                        ));
                    }
                }
            }
            if let Some(before) = recent.last() {
                let ahead = |agent: usize| {
                    let (from, to) = (at(agent, time - 1), at(agent, time));
                    let ahead = before[to as usize];
                    (from != to && ahead != NOBODY).then_some(ahead)
                };
                self.rings(agents, ahead)
                    .map_err(|ring| format!("{ring} at {time}"))?;
            }
            recent.push(here);
            if recent.len() > delay.max(1) as usize {
                recent.remove(0);
            }
        }
        Ok(())
    }

    /// Agents that enter each other's cells all round.
    fn rings(&self, agents: usize, ahead: impl Fn(usize) -> Option<usize>) -> Result<(), String> {
        for agent in 0..agents {
            let (mut next, mut length) = (ahead(agent), 1);
            while let Some(one) = next.filter(|one| *one != agent && length <= agents) {
                (next, length) = (ahead(one), length + 1);
            }
            match next {
                Some(other) if other == agent && length == 2 => {
                    let other = ahead(agent).unwrap_or(agent);
                    return Err(format!("agents {agent} and {other} change places"));
                }
                Some(other) if other == agent && !self.instance.allows_cycles => {
                    return Err(format!("agent {agent} is in a ring of {length}"));
                }
                _ => {}
            }
        }
        Ok(())
    }
}

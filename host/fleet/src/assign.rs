//! Starts of the agents, and the goals that they have after one another.
//!
//! Goals are drawn or come from tasks. A drawn goal is a function of the seed, the agent,
//! its start and the goal's index alone, so that every planner and every generator works
//! for the same goals; what is kept of them is a cache.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, VecDeque};

use fleetyard_abi::{GoalTasks, Goals, Task};
use fleetyard_core::formats::TaskList;
use fleetyard_core::{Connectivity, Grid, InputError, OFF_MAP, Role};
use fleetyard_sim::trace::Errand;
use fleetyard_world::SeededRandom;

use crate::Assign;

/// Most tasks that are known at a time.
const MOST_KNOWN: f64 = 4_194_304.0;

/// Most goals of an agent that are told at a time, however large the window is.
const MOST_UPCOMING: usize = 1000;

/// Origin of the goals.
#[derive(Debug, Clone, PartialEq)]
pub enum Source {
    /// Free cells at random, uniformly, but never the same twice in a row, nor the start
    /// as the first one.
    Random,
    /// Workstations and endpoints of the map in turn, each at random, uniformly. Who
    /// starts on a workstation begins with an endpoint, everybody else with a workstation.
    Roles,
    /// Tasks in the order of a list, from its beginning again after its end. As many as
    /// `reveal` times the agents are known and not done at a time, at least one.
    ///
    /// They are given to agents as [`Giving`] says.
    Tasks {
        /// The tasks; all cells are in one part of the map.
        list: TaskList,
        /// Known tasks per agent.
        reveal: f64,
    },
}

impl Source {
    /// The source that is asked for, if there are tasks for it, or the map has roles.
    pub fn new(
        assign: Assign,
        grid: &Grid,
        tasks: Option<TaskList>,
        reveal: f64,
    ) -> Result<Self, InputError> {
        let has = |role| grid.cells_with(role).next().is_some();
        let has_roles = has(Role::Workstation) && has(Role::Endpoint);
        match (assign, tasks) {
            (Assign::Auto | Assign::Tasks | Assign::Generator, Some(list)) => {
                Ok(Self::Tasks { list, reveal })
            }
            (Assign::Tasks | Assign::Generator, None) => {
                Err(InputError::new("assign", "there are no tasks")
                    .hint("give a file of tasks, or assign random goals"))
            }
            (Assign::Random | Assign::Roles, Some(list)) => {
                let reason = "tasks are given, but goals do not come from tasks";
                Err(InputError::new(list.source, reason)
                    .hint("leave the file of tasks out, or assign tasks"))
            }
            (Assign::Roles, None) if !has_roles => {
                let reason = "the map has not both workstations (w) and endpoints (e)";
                Err(InputError::new(grid.name(), reason)
                    .hint("take a map with these letters, or assign random goals"))
            }
            (Assign::Auto | Assign::Roles, None) if has_roles => Ok(Self::Roles),
            _ => Ok(Self::Random),
        }
    }
}

/// The agents that the host gives tasks to, and the tasks that they get. Ways are Manhattan
/// distances; of several tasks that fit, agents get the oldest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Giving {
    /// An agent that has no goals any more, or so few that its way through them ends within
    /// the planning window, gets the task that begins nearest: the agent with the shortest
    /// way first.
    #[default]
    Ahead,
    /// An agent that has no task gets the one with the shortest way from where it is through
    /// all its places; agents in their order. So does the League's own scheduler, with lengths of
    /// ways on the map.
    Shortest,
    /// Nobody gets any: the instance generator gives all.
    Nobody,
}

/// Cells by the part of the map that they are in.
#[derive(Debug, Clone)]
struct Pool {
    /// By parts, ascending within each.
    cells: Vec<u32>,
    /// Index of the first cell of each part, and at last the end.
    begins: Vec<usize>,
}

impl Pool {
    /// `part` labels cells from 1; 0 is no part.
    fn new(part: &[u32], parts: usize, cells: impl Iterator<Item = u32> + Clone) -> Self {
        let mut begins = vec![0; parts + 2];
        let label = |cell: u32| part[cell as usize] as usize;
        for cell in cells.clone() {
            begins[label(cell) + 1] += 1;
        }
        // Blocked cells are in no part, which is the first one here.
        for at in 1..begins.len() {
            begins[at] += begins[at - 1];
        }
        let mut next = begins.clone();
        let mut sorted = vec![0; begins[parts + 1]];
        for cell in cells {
            let slot = &mut next[label(cell)];
            sorted[*slot] = cell;
            *slot += 1;
        }
        Self {
            cells: sorted,
            begins,
        }
    }

    fn of(&self, part: u32) -> &[u32] {
        let part = part as usize;
        &self.cells[self.begins[part]..self.begins[part + 1]]
    }
}

/// The source of goals.
#[derive(Debug, Clone)]
enum Draw {
    Random(Pool),
    Roles { workstations: Pool, endpoints: Pool },
    Tasks(Tasks),
}

/// An agent's goals as far as they are known and not reached.
#[derive(Debug, Clone)]
struct Stream {
    start: u32,
    /// The part of the map that it is in.
    part: u32,
    /// The last goal that was forgotten, or the start.
    before: u32,
    /// Index of the first goal that is not forgotten.
    base: u32,
    goals: VecDeque<u32>,
    /// Since when that goal is the agent's current one.
    since_s: f64,
}

impl Stream {
    fn end(&self) -> u32 {
        self.base + self.goals.len() as u32
    }

    fn last(&self) -> u32 {
        self.goals.back().copied().unwrap_or(self.before)
    }

    /// The goals from an index on.
    fn from(&self, index: u32) -> impl Iterator<Item = u32> {
        let skipped = index.saturating_sub(self.base) as usize;
        self.goals.iter().copied().skip(skipped)
    }
}

#[derive(Debug, Clone)]
struct Tasks {
    list: Vec<Vec<u32>>,
    /// The part of the map that they are in.
    home: u32,
    /// Most tasks that are revealed and not done at a time, and their number now.
    reveal: usize,
    ongoing: usize,
    /// The identifier of the next one to be revealed.
    next: u64,
    /// Those that nobody has, by identifier.
    open: Vec<Open>,
    /// Per agent, its tasks, and the indices of the goals with which they are done.
    given: Vec<VecDeque<Given>>,
}

#[derive(Debug, Clone, Copy)]
struct Open {
    id: u64,
    row: u32,
    col: u32,
    /// The way from its first place through the others.
    way: u64,
    released_s: f64,
}

#[derive(Debug, Clone, Copy)]
struct Given {
    id: u64,
    end: u32,
    released_s: f64,
    since_s: f64,
}

impl Tasks {
    fn cells(&self, id: u64) -> &[u32] {
        &self.list[(id % self.list.len() as u64) as usize]
    }

    fn reveal(&mut self, cols: u32, released_s: f64) {
        while self.ongoing < self.reveal {
            let id = self.next;
            let cells = self.cells(id);
            let (row, col) = (cells[0] / cols, cells[0] % cols);
            let steps = cells.windows(2);
            let way = steps.map(|step| u64::from(manhattan(step[0], step[1], cols)));
            self.open.push(Open {
                id,
                row,
                col,
                way: way.sum(),
                released_s,
            });
            self.next += 1;
            self.ongoing += 1;
        }
    }

    /// Gives the open task at a place of the list to an agent.
    fn give(&mut self, at: usize, agent: usize, stream: &mut Stream, given_s: f64) {
        let task = self.open.remove(at);
        stream.goals.extend(self.cells(task.id));
        let end = stream.end() - 1;
        self.given[agent].push_back(Given {
            id: task.id,
            end,
            released_s: task.released_s,
            since_s: given_s,
        });
    }

    /// The open task that begins nearest to a cell, or with `through` has the shortest way
    /// from there through its places; the oldest of several.
    fn nearest(&self, (row, col): (u32, u32), through: bool) -> Option<usize> {
        let way = |open: &Open| {
            let begin = row.abs_diff(open.row) + col.abs_diff(open.col);
            u64::from(begin) + if through { open.way } else { 0 }
        };
        (0..self.open.len()).min_by_key(|at| way(&self.open[*at]))
    }
}

/// Starts, and a stream of goals for every agent.
///
/// Goals are numbered from 0 by agent. Those that were reached are forgotten
/// ([`Assigner::reached`]), so that memory does not grow with time.
#[derive(Debug, Clone)]
pub struct Assigner {
    cols: u32,
    /// The part of the map that each cell is in, from 1; 0 for blocked ones.
    part: Vec<u32>,
    random: SeededRandom,
    draw: Draw,
    giving: Giving,
    streams: Vec<Stream>,
    /// Simulated time.
    now_s: f64,
}

impl Assigner {
    /// Agents at starts that are drawn uniformly from the cells where there are goals to
    /// go to: no two the same, and the first of more agents are those of fewer.
    pub fn new(grid: &Grid, source: Source, agents: usize, seed: u64) -> Result<Self, InputError> {
        let part = grid.components(Connectivity::Four);
        let draw = Draw::new(grid, &part, source, agents)?;
        let mut starts: Vec<u32> = (0..grid.cell_count())
            .filter(|cell| draw.can_start(part[*cell as usize]))
            .collect();
        if agents == 0 || agents > starts.len() {
            let reason = format!(
                "{agents} agents on {}, which has room for {}",
                grid.name(),
                starts.len()
            );
            return Err(InputError::new("agents", reason).hint(match starts.len() {
                0 => format!("no part of the map has {}", draw.needs()),
                most => format!("ask for 1 to {most} agents"),
            }));
        }
        SeededRandom::new("fleet starts", seed).shuffle(&mut starts);
        starts.truncate(agents);
        Ok(Self::build(grid, &part, draw, &starts, seed))
    }

    /// Agents at the starts that are given.
    pub fn with_starts(
        grid: &Grid,
        source: Source,
        starts: &[u32],
        seed: u64,
    ) -> Result<Self, InputError> {
        let part = grid.components(Connectivity::Four);
        let draw = Draw::new(grid, &part, source, starts.len())?;
        let fault = |reason: String| Err(InputError::new("starts", reason));
        let mut first = vec![OFF_MAP; part.len()];
        for (agent, start) in starts.iter().copied().enumerate() {
            let Some(label) = part.get(start as usize).filter(|label| **label != 0) else {
                return fault(format!("agent {agent} starts in no free cell"));
            };
            let (row, col) = grid.row_col(start);
            let place = format!("row {row}, column {col}");
            if !draw.can_start(*label) {
                let reason = format!("agent {agent} starts at {place}, with no goals to go to");
                return Err(InputError::new("starts", reason).hint(format!(
                    "start in a part of the map that has {}",
                    draw.needs()
                )));
            }
            let first = std::mem::replace(&mut first[start as usize], agent as u32);
            if first != OFF_MAP {
                return fault(format!("agents {first} and {agent} both start at {place}"));
            }
        }
        if starts.is_empty() {
            return fault("there are no agents".into());
        }
        Ok(Self::build(grid, &part, draw, starts, seed))
    }

    fn build(grid: &Grid, part: &[u32], draw: Draw, starts: &[u32], seed: u64) -> Self {
        let stream = |start: &u32| Stream {
            start: *start,
            part: part[*start as usize],
            before: *start,
            base: 0,
            goals: VecDeque::new(),
            since_s: 0.0,
        };
        Self {
            now_s: 0.0,
            cols: grid.cols(),
            part: part.to_vec(),
            random: SeededRandom::new("fleet goals", seed),
            draw,
            giving: Giving::default(),
            streams: starts.iter().map(stream).collect(),
        }
    }

    /// Tasks are given like this.
    #[must_use]
    pub fn giving(mut self, giving: Giving) -> Self {
        self.giving = giving;
        self
    }

    /// Number of agents.
    pub fn agents(&self) -> usize {
        self.streams.len()
    }

    /// The reason why an agent cannot be [sent](Self::send) to a cell, if there is one.
    pub fn can_send(&self, agent: u32, cell: u32) -> Result<(), String> {
        let (agents, part) = (self.streams.len(), self.part.get(cell as usize));
        let Some(stream) = self.streams.get(agent as usize) else {
            return Err(format!("there is no robot {agent} among {agents}"));
        };
        match part {
            _ if matches!(self.draw, Draw::Tasks(_)) => {
                Err("robots of this fleet get their goals from tasks".into())
            }
            None | Some(0) => Err(format!("{cell} is no free cell of the map")),
            Some(part) if *part != stream.part => {
                Err(format!("robot {agent} cannot reach cell {cell}"))
            }
            _ if stream.last() == cell => Err(format!("robot {agent} goes to cell {cell} already")),
            _ if stream.goals.len() >= MOST_UPCOMING => {
                Err(format!("robot {agent} has {MOST_UPCOMING} goals already"))
            }
            _ => Ok(()),
        }
    }

    /// Gives an agent a goal after those that it has. Goals that are drawn come after it.
    pub fn send(&mut self, agent: u32, cell: u32) {
        self.streams[agent as usize].goals.push_back(cell);
    }

    /// Says what time it is: tasks are released and given, and goals reached, from now on then.
    pub fn set_time(&mut self, now_s: f64) {
        self.now_s = now_s;
    }

    /// Start cells of the agents. They look to the north.
    pub fn starts(&self) -> Vec<u32> {
        self.streams.iter().map(|stream| stream.start).collect()
    }

    /// The cell of an agent's goal; [`OFF_MAP`] if it was reached, or no task that was
    /// given to the agent has it.
    pub fn goal(&mut self, agent: usize, index: u32) -> u32 {
        let stream = &mut self.streams[agent];
        if index < stream.base {
            return OFF_MAP;
        }
        while stream.end() <= index {
            let Some(goal) = self.draw.next(&mut self.random, agent, stream) else {
                return OFF_MAP;
            };
            stream.goals.push_back(goal);
        }
        stream.goals[(index - stream.base) as usize]
    }

    /// The place in a task of an agent's goal that is not reached, if goals come from tasks.
    pub fn errand(&self, agent: usize, index: u32) -> Option<Errand> {
        let (task, at, of) = self.given(agent, index)?;
        let task = task.id;
        Some(Errand { task, at, of })
    }

    /// An agent has reached a goal and all before it: they are forgotten, and tasks that
    /// are done by it make room for others.
    pub fn reached(&mut self, agent: usize, index: u32) {
        while self.streams[agent].base <= index {
            if self.goal(agent, self.streams[agent].base) == OFF_MAP {
                break;
            }
            let stream = &mut self.streams[agent];
            if let Some(goal) = stream.goals.pop_front() {
                stream.before = goal;
                if let Draw::Tasks(tasks) = &mut self.draw
                    && tasks.given[agent].front().map(|task| task.end) == Some(stream.base)
                {
                    tasks.given[agent].pop_front();
                    tasks.ongoing -= 1;
                }
                stream.base += 1;
                stream.since_s = self.now_s;
            }
        }
        if let Draw::Tasks(tasks) = &mut self.draw {
            tasks.reveal(self.cols, self.now_s);
        }
    }

    /// The tasks of goals as [`upcoming`](Self::upcoming) lists them for agents with these next
    /// ones.
    pub fn goal_tasks(&self, goals: &Goals, next_goal: &[u32]) -> GoalTasks {
        let time_s = self.now_s;
        let mut all = GoalTasks {
            time_s,
            ..GoalTasks::default()
        };
        for (agent, (goals, next)) in goals.iter().zip(next_goal).enumerate() {
            let stream = &self.streams[agent];
            for index in (*next..).take(goals.len()) {
                let current = index == stream.base && index < stream.end();
                let since_s = if current { stream.since_s } else { time_s };
                match self.given(agent, index) {
                    Some((task, at, _)) => {
                        all.push(Some((task.id, at)), task.released_s, task.since_s);
                    }
                    None => all.push(None, since_s, since_s),
                }
            }
        }
        all
    }

    /// The task of a goal that is not reached, which of its places that is, and of how many.
    fn given(&self, agent: usize, index: u32) -> Option<(Given, u32, u32)> {
        let Draw::Tasks(tasks) = &self.draw else {
            return None;
        };
        let given = tasks.given[agent].iter().find(|task| task.end >= index)?;
        let of = tasks.cells(given.id).len() as u32;
        let at = (index + of).checked_sub(given.end + 1)?;
        Some((*given, at, of))
    }

    /// The goals of every agent that will be in `cells` and has `next_goal` as its next
    /// one: as many as it takes for the Manhattan way through them to be longer than the
    /// window, and at least two.
    ///
    /// Tasks are given to agents here ([`Giving`]). An agent may have fewer goals then; if it has
    /// none, because nobody has a task for it, its only goal here is the cell where it will be. It has
    /// none here if the generator gives all tasks.
    pub fn upcoming(&mut self, cells: &[u32], next_goal: &[u32], window_steps: u32) -> Goals {
        self.give_tasks(cells, next_goal, window_steps);
        let mut goals = Goals::with_capacity(cells.len(), 2 * cells.len());
        for (agent, (&cell, &next)) in cells.iter().zip(next_goal).enumerate() {
            let (mut at, mut way) = (cell, 0);
            for index in next.. {
                let known = goals.open_list().len();
                if known == MOST_UPCOMING || (known >= 2 && way > window_steps) {
                    break;
                }
                let goal = self.goal(agent, index);
                if goal == OFF_MAP {
                    break;
                }
                way = u32::saturating_add(way, manhattan(at, goal, self.cols));
                at = goal;
                goals.push_item(goal);
            }
            if goals.open_list().is_empty() && self.giving != Giving::Nobody {
                goals.push_item(cell);
            }
            goals.end_list();
        }
        goals
    }

    fn give_tasks(&mut self, cells: &[u32], next_goal: &[u32], window_steps: u32) {
        let Draw::Tasks(tasks) = &mut self.draw else {
            return;
        };
        let cols = self.cols;
        match self.giving {
            Giving::Nobody => return,
            Giving::Shortest => {
                for (agent, stream) in self.streams.iter_mut().enumerate() {
                    if next_goal[agent] < stream.end() {
                        continue;
                    }
                    let at = (cells[agent] / cols, cells[agent] % cols);
                    let Some(nearest) = tasks.nearest(at, true) else {
                        break;
                    };
                    tasks.give(nearest, agent, stream, self.now_s);
                }
                return;
            }
            Giving::Ahead => {}
        }
        // The way of an agent through the goals that it has, if it may need more.
        let way_left = |agent: usize, stream: &Stream| {
            let (mut at, mut way) = (cells[agent], 0);
            for goal in stream.from(next_goal[agent]) {
                way += u64::from(manhattan(at, goal, cols));
                at = goal;
            }
            let has_none = next_goal[agent] >= stream.end();
            (has_none || (way <= u64::from(window_steps) && window_steps > 0)).then_some((way, at))
        };
        let mut waiting: BinaryHeap<_> = (0..self.streams.len())
            .filter_map(|agent| {
                let (way, at) = way_left(agent, &self.streams[agent])?;
                Some(Reverse((way, agent, at)))
            })
            .collect();
        while let Some(Reverse((_, agent, at))) = waiting.pop() {
            let Some(nearest) = tasks.nearest((at / cols, at % cols), false) else {
                break;
            };
            let stream = &mut self.streams[agent];
            tasks.give(nearest, agent, stream, self.now_s);
            if let Some((way, at)) = way_left(agent, stream) {
                waiting.push(Reverse((way, agent, at)));
            }
        }
    }

    /// True per agent that has a task which is not done, if goals come from tasks.
    pub fn busy(&self) -> Vec<bool> {
        match &self.draw {
            Draw::Tasks(tasks) => tasks.given.iter().map(|given| !given.is_empty()).collect(),
            _ => Vec::new(),
        }
    }

    /// The tasks that are known and given to nobody, by identifier.
    pub fn open_tasks(&self) -> Vec<Task> {
        let Draw::Tasks(tasks) = &self.draw else {
            return Vec::new();
        };
        let task = |open: &Open| Task {
            id: open.id,
            places: tasks.cells(open.id).to_vec(),
            released_s: open.released_s,
        };
        tasks.open.iter().map(task).collect()
    }

    /// The number of tasks that are done, if goals come from tasks.
    pub fn tasks_done(&self) -> Option<u64> {
        match &self.draw {
            Draw::Tasks(tasks) => Some(tasks.next - tasks.ongoing as u64),
            _ => None,
        }
    }

    /// Gives an open task to an agent: its cells come after the goals that the agent has.
    /// The error is the reason why it cannot have it.
    pub fn give(&mut self, agent: u32, task: u64) -> Result<(), String> {
        let agents = self.streams.len();
        let Some(stream) = self.streams.get_mut(agent as usize) else {
            return Err(format!(
                "task {task} is given to agent {agent}, there are {agents} agents"
            ));
        };
        let open = |tasks: &Tasks| tasks.open.binary_search_by_key(&task, |open| open.id).ok();
        match &mut self.draw {
            Draw::Tasks(tasks) if let Some(at) = open(tasks) => {
                tasks.give(at, agent as usize, stream, self.now_s);
                Ok(())
            }
            _ => Err(format!(
                "task {task} is given to agent {agent}, but it is not open"
            )),
        }
    }
}

impl Draw {
    fn new(grid: &Grid, part: &[u32], source: Source, agents: usize) -> Result<Self, InputError> {
        let parts = part.iter().copied().max().unwrap_or(0) as usize;
        let with = |role| {
            let cells: Vec<u32> = grid.cells_with(role).collect();
            Pool::new(part, parts, cells.iter().copied())
        };
        Ok(match source {
            Source::Random => Self::Random(Pool::new(part, parts, 0..grid.cell_count())),
            Source::Roles => Self::Roles {
                workstations: with(Role::Workstation),
                endpoints: with(Role::Endpoint),
            },
            Source::Tasks { list, reveal } => {
                let home = part_of_tasks(grid, part, &list)?;
                let known = (reveal * agents as f64).floor();
                // Written so that NaN is out of range.
                if !(reveal > 0.0 && known <= MOST_KNOWN) {
                    let reason = format!("{reveal} known tasks per agent, of {agents} agents");
                    return Err(InputError::new("reveal", reason).hint(format!(
                        "give a number above 0; at most {MOST_KNOWN} tasks are known at a time"
                    )));
                }
                let mut tasks = Tasks {
                    list: list.tasks,
                    home,
                    reveal: (known as usize).max(1),
                    ongoing: 0,
                    next: 0,
                    open: Vec::new(),
                    given: vec![VecDeque::new(); agents],
                };
                tasks.reveal(grid.cols(), 0.0);
                Self::Tasks(tasks)
            }
        })
    }

    /// True if there are always goals to go to in a part of the map.
    fn can_start(&self, part: u32) -> bool {
        part != 0
            && match self {
                Self::Random(pool) => pool.of(part).len() > 1,
                Self::Roles {
                    workstations,
                    endpoints,
                } => !workstations.of(part).is_empty() && !endpoints.of(part).is_empty(),
                Self::Tasks(tasks) => part == tasks.home,
            }
    }

    /// The requirement on a part of the map.
    fn needs(&self) -> &'static str {
        match self {
            Self::Random(_) => "two free cells beside each other",
            Self::Roles { .. } => "both a workstation (w) and an endpoint (e)",
            Self::Tasks(_) => "the cells of the tasks",
        }
    }

    /// The goal after those of a stream.
    fn next(&self, random: &mut SeededRandom, agent: usize, stream: &Stream) -> Option<u32> {
        let index = stream.end();
        let mut below = |bound: usize| {
            random.go_to(agent as u64, u64::from(index));
            random.below(bound)
        };
        match self {
            Self::Random(pool) => {
                let cells = pool.of(stream.part);
                let at = cells.binary_search(&stream.last()).ok()?;
                // Any but the last one is equally far.
                Some(cells[(at + 1 + below(cells.len() - 1)) % cells.len()])
            }
            Self::Roles {
                workstations,
                endpoints,
            } => {
                let on_workstation = workstations.of(stream.part).binary_search(&stream.start);
                let turn = index + u32::from(on_workstation.is_ok());
                let pool = if turn.is_multiple_of(2) {
                    workstations
                } else {
                    endpoints
                };
                let cells = pool.of(stream.part);
                Some(cells[below(cells.len())])
            }
            Self::Tasks(_) => None,
        }
    }
}

fn manhattan(a: u32, b: u32, cols: u32) -> u32 {
    (a / cols).abs_diff(b / cols) + (a % cols).abs_diff(b % cols)
}

/// The part of the map that all tasks are in.
fn part_of_tasks(grid: &Grid, part: &[u32], list: &TaskList) -> Result<u32, InputError> {
    let mut home = None;
    for (at, task) in list.tasks.iter().enumerate() {
        let fault = |reason: String| {
            let error = InputError::new(&list.source, reason);
            match list.lines.get(at) {
                Some(line) => error.at_line(*line),
                None => error,
            }
        };
        if task.is_empty() {
            return Err(fault(format!("task {at} has no cell")));
        }
        for cell in task {
            let label = part.get(*cell as usize).copied().unwrap_or(0);
            if label == 0 {
                let reason = format!("cell {cell} of task {at} is no free cell of the map");
                return Err(fault(reason));
            }
            if *home.get_or_insert(label) != label {
                let (row, col) = grid.row_col(*cell);
                let reason = format!(
                    "cell {cell} (row {row}, column {col}) of task {at} cannot be reached from \
                     the tasks before it"
                );
                return Err(fault(reason).hint("keep the tasks of one part of the map"));
            }
        }
    }
    home.ok_or_else(|| InputError::new(&list.source, "there are no tasks"))
}

//! The memory of a run, which the host keeps so that modules keep none.
//!
//! It follows from what is committed and executed, and from what recordings have: a replay has the
//! same without a plugin, on any number of threads. Only what some module reads is kept.

use std::borrow::Cow;
use std::sync::Arc;

use fleetyard_abi::{
    Assignment, FleetState, GoalTasks, Guidance, Heading, Instance, Kept, Kind, Part, RestOfPlan,
    Snapshot, Traffic, c,
};
use fleetyard_core::{Digest, Grid, Hasher};

use crate::ModuleInfo;
use crate::recording::KeptBytes;

/// Simulated time from a snapshot of traffic to the next.
pub const PERIOD_S: f64 = 20.0;
/// Time constant of the averages of traffic.
pub const TIME_CONSTANT_S: f64 = 50.0;

/// The parts of a run's memory that a plugin with these features reads.
pub fn memory_of(features: &[String]) -> Vec<String> {
    let kept = [
        c::TRAFFIC_ID,
        c::REST_OF_PLAN_ID,
        c::GOAL_TASKS_ID,
        c::GUIDANCE_ID,
        c::KEPT_ID,
    ];
    let reads = |part: &&str| {
        let names = features
            .iter()
            .filter_map(|feature| feature.strip_prefix("part:"));
        names.into_iter().any(|name| name == *part)
    };
    kept.into_iter().filter(reads).map(str::to_owned).collect()
}

/// Number of a move from a cell to one beside it, in the order of [`Snapshot::flow`].
pub(crate) fn number_of_move(from: u32, to: u32, cols: u32) -> usize {
    // Headings are numbered from the east on, moves from the north on.
    let heading = Heading::of_move(from, to, cols).code() as usize;
    4 * from as usize + (heading + 1) % 4
}

/// An average of 1.
const ONE: u32 = 1 << 24;
/// The share that stays of an average from a snapshot to the next, e^(-20/50), and 1, both in units
/// of 2^-16.
const STAYS: u64 = 43930;
const WHOLE: u64 = 1 << 16;

/// Exponential averages in whole numbers, so that they are the same on every machine.
#[derive(Debug, Clone)]
struct Averages {
    /// Averages as of the last snapshot, in units of 1 / [`ONE`].
    before: Vec<u32>,
    /// Counts since then.
    counts: Vec<u32>,
    /// The share of a period that a count stands for, in the same units.
    unit: u64,
    /// The last two snapshots in units of 1/255, the last one first.
    shots: [Vec<u8>; 2],
}

impl Averages {
    fn new(len: usize, share: f64) -> Self {
        Self {
            before: vec![0; len],
            counts: vec![0; len],
            unit: (share * f64::from(ONE)).round() as u64,
            shots: [vec![0; len], vec![0; len]],
        }
    }

    /// Takes a snapshot.
    fn close(&mut self) {
        self.shots.swap(0, 1);
        let columns = self.before.iter_mut().zip(&mut self.counts);
        for ((before, count), shot) in columns.zip(&mut self.shots[0]) {
            let new = (u64::from(*count) * self.unit).min(u64::from(ONE));
            let mean = u64::from(*before) * STAYS + new * (WHOLE - STAYS) + WHOLE / 2;
            *before = (mean / WHOLE) as u32;
            *count = 0;
            let quantised = u64::from(*before) * 255 + u64::from(ONE) / 2;
            *shot = (quantised / u64::from(ONE)) as u8;
        }
    }
}

/// Averages of where robots wait, and which way they go.
///
/// A robot waits at the end of what it is committed to while that stays the same from one call to
/// the next, and its goal is elsewhere. A move counts when it is known to be done.
#[derive(Debug, Clone)]
struct Traffics {
    cols: u32,
    /// Blocks from a snapshot to the next, the seconds of a block, and the flow that 1 stands for.
    period: u64,
    block_s: f64,
    flow_unit_per_s: f64,
    waiting: Averages,
    flow: Averages,
    /// Number of the last snapshot of each.
    waited: u64,
    flowed: u64,
    /// Cells where robots were last known.
    at: Vec<u32>,
    /// The block of the last call, and where robots ended then.
    ends: Option<(u64, Vec<u32>)>,
    /// Stands for all snapshots so far.
    digest: Option<Digest>,
}

impl Traffics {
    fn new(grid: &Grid, starts: &[u32], block_s: f64, step_s: f64) -> Self {
        let cells = grid.cell_count() as usize;
        Self {
            cols: grid.cols(),
            period: ((PERIOD_S / block_s).round() as u64).max(1),
            block_s,
            flow_unit_per_s: 1.0 / (255.0 * step_s),
            waiting: Averages::new(cells, block_s / PERIOD_S),
            flow: Averages::new(4 * cells, step_s / PERIOD_S),
            waited: 0,
            flowed: 0,
            at: starts.to_vec(),
            ends: None,
            digest: None,
        }
    }

    /// A robot is in a cell.
    fn done(&mut self, agent: usize, cell: u32) {
        let from = std::mem::replace(&mut self.at[agent], cell);
        if from != cell {
            self.flow.counts[number_of_move(from, cell, self.cols)] += 1;
        }
    }

    /// A block begins, whose news are in.
    fn block(&mut self, block: u64) {
        if block > 0 && block.is_multiple_of(self.period) {
            self.flow.close();
            self.flowed += 1;
        }
    }

    /// A call is made: robots end there, and those with a goal elsewhere wait if they did before.
    fn call(&mut self, block: u64, ends: &[u32], waits: impl Fn(usize, u32) -> bool) {
        let (mut from, before) = self.ends.take().unwrap_or((block, Vec::new()));
        let pairs = before.iter().zip(ends).enumerate();
        let waiting: Vec<u32> = pairs
            .filter(|(agent, (before, end))| before == end && waits(*agent, **end))
            .map(|(_, (_, end))| *end)
            .collect();
        while self.waited < self.flowed {
            let boundary = (self.waited + 1) * self.period;
            self.wait(&waiting, boundary.saturating_sub(from));
            from = from.max(boundary);
            self.waiting.close();
            self.waited += 1;
            let mut hasher = Hasher::new("fleetyard.traffic/1");
            hasher.value(&self.digest);
            hasher.bytes(&self.waiting.shots[0]);
            hasher.bytes(&self.flow.shots[0]);
            self.digest = Some(hasher.finish());
        }
        self.wait(&waiting, block - from);
        self.ends = Some((block, ends.to_vec()));
    }

    fn wait(&mut self, cells: &[u32], blocks: u64) {
        for cell in cells {
            self.waiting.counts[*cell as usize] += blocks as u32;
        }
    }

    fn part(&self, block: u64) -> Traffic {
        let shot = |at: usize| Snapshot {
            number: self.waited.saturating_sub(at as u64),
            waiting: self.waiting.shots[at].clone(),
            flow: self.flow.shots[at].clone(),
        };
        Traffic {
            period_s: PERIOD_S,
            time_constant_s: TIME_CONSTANT_S,
            since_s: (block - self.waited * self.period) as f64 * self.block_s,
            flow_unit_per_s: self.flow_unit_per_s,
            last: shot(0),
            before: shot(1),
        }
    }
}

/// The memory of a run.
#[derive(Debug)]
pub(crate) struct Keeper {
    traffic: Option<Traffics>,
    goal_tasks: bool,
    rest_of_plan: bool,
    /// The same in the whole run.
    guidance: Option<Arc<Guidance>>,
    kept: bool,
    /// Bytes that modules kept last.
    bytes: Bytes,
}

/// Bytes that modules kept last, and their digests.
#[derive(Debug, Clone, Default)]
struct Bytes(Vec<(Kind, Arc<Kept>, Digest)>);

impl Bytes {
    fn of(&self, kind: Kind) -> Option<&Arc<Kept>> {
        let mut all = self.0.iter();
        all.find(|(of, ..)| *of == kind).map(|(_, bytes, _)| bytes)
    }
}

impl Keeper {
    /// Of a run whose modules read some parts, with the guidance graph of the map, if there is one.
    pub(crate) fn new(
        modules: &[ModuleInfo],
        (grid, guidance): (&Grid, Option<&Arc<Guidance>>),
        starts: &[u32],
        (block_s, step_s): (f64, f64),
    ) -> Self {
        let reads = |part: &str| modules.iter().any(|module| module.reads(part));
        Self {
            traffic: reads(c::TRAFFIC_ID).then(|| Traffics::new(grid, starts, block_s, step_s)),
            rest_of_plan: reads(c::REST_OF_PLAN_ID),
            goal_tasks: reads(c::GOAL_TASKS_ID),
            guidance: guidance.filter(|_| reads(c::GUIDANCE_ID)).cloned(),
            kept: reads(c::KEPT_ID),
            bytes: Bytes::default(),
        }
    }

    /// True if cuts have to say what they drop.
    pub(crate) fn wants_rest(&self) -> bool {
        self.rest_of_plan
    }

    /// True if somebody asks about goals.
    pub(crate) fn wants_goal_tasks(&self) -> bool {
        self.goal_tasks
    }

    /// A robot has done the move into a cell.
    pub(crate) fn done(&mut self, agent: usize, cell: u32) {
        if let Some(traffic) = &mut self.traffic {
            traffic.done(agent, cell);
        }
    }

    /// A block begins, whose news are in.
    pub(crate) fn block(&mut self, block: u64) {
        if let Some(traffic) = &mut self.traffic {
            traffic.block(block);
        }
    }

    /// A call is made: robots end there, and those with a goal elsewhere wait.
    pub(crate) fn call(&mut self, block: u64, ends: &[u32], waits: impl Fn(usize, u32) -> bool) {
        if let Some(traffic) = &mut self.traffic {
            traffic.call(block, ends, waits);
        }
    }

    /// Takes over the bytes that were kept for an answer which takes effect.
    pub(crate) fn keep(&mut self, kept: &[KeptBytes]) {
        for KeptBytes { kind, bytes } in kept.iter().filter(|_| self.kept) {
            let mut hasher = Hasher::new("fleetyard.kept/1");
            hasher.bytes(&bytes.bytes);
            self.bytes.0.retain(|(of, ..)| of != kind);
            let kept = (*kind, Arc::new(bytes.clone()), hasher.finish());
            self.bytes.0.push(kept);
            self.bytes.0.sort_unstable_by_key(|(of, ..)| *of);
        }
    }

    /// The memory for a call at a block.
    pub(crate) fn recall(
        &self,
        block: u64,
        rest: Vec<String>,
        goal_tasks: Option<GoalTasks>,
    ) -> Memory {
        let traffic = self.traffic.as_ref();
        Memory {
            traffic: traffic.map(|traffic| traffic.part(block).into()),
            rest: self.rest_of_plan.then(|| RestOfPlan { paths: rest }.into()),
            goal_tasks: goal_tasks.map(Arc::new),
            guidance: self.guidance.clone(),
            bytes: self.bytes.clone(),
        }
    }

    /// Adds to the digest of a state what of the memory goes into answers; nothing if nobody reads
    /// any. Guidance is the same in the whole run, which has its digest.
    pub(crate) fn hash(&self, memory: &Memory, hasher: &mut Hasher) {
        if let Some(traffic) = &self.traffic {
            hasher.value(&traffic.digest);
            hasher.u64(traffic.waited);
        }
        if let Some(rest) = &memory.rest {
            hasher.value(&rest.paths);
        }
        if let Some(tasks) = &memory.goal_tasks {
            hasher.value(tasks.as_ref());
        }
        for (kind, _, digest) in &self.bytes.0 {
            hasher.value(&(kind, digest));
        }
    }
}

/// The memory that goes with a call.
#[derive(Debug, Clone, Default)]
pub(crate) struct Memory {
    traffic: Option<Arc<Traffic>>,
    rest: Option<Arc<RestOfPlan>>,
    /// Of the goals of the state.
    goal_tasks: Option<Arc<GoalTasks>>,
    guidance: Option<Arc<Guidance>>,
    bytes: Bytes,
}

impl Memory {
    /// The state as a generator gets it.
    pub(crate) fn of_state<'a>(
        &self,
        state: &'a FleetState,
        module: &ModuleInfo,
    ) -> Cow<'a, FleetState> {
        let parts = self.parts(module, self.goal_tasks.clone());
        let mut state = Cow::Borrowed(state);
        if !parts.is_empty() {
            state.to_mut().parts = parts;
        }
        state
    }

    /// An instance as a planner or a fail policy gets it, for which these tasks were given.
    pub(crate) fn of_instance<'a>(
        &self,
        instance: &'a Instance,
        state: &FleetState,
        assignments: &[Assignment],
        module: &ModuleInfo,
    ) -> Cow<'a, Instance> {
        let known = self.goal_tasks.as_ref();
        let known = known.filter(|_| module.reads(c::GOAL_TASKS_ID));
        let goal_tasks = known.map(|known| matched(instance, state, known, assignments));
        let parts = self.parts(module, goal_tasks.map(Arc::new));
        let mut instance = Cow::Borrowed(instance);
        if !parts.is_empty() {
            instance.to_mut().parts = parts;
        }
        instance
    }

    /// The bytes that a module kept, if it reads them and they are others than before.
    pub(crate) fn news(&self, module: &ModuleInfo, kept: Option<Vec<u8>>) -> Option<KeptBytes> {
        let bytes = Kept {
            bytes: kept.filter(|_| module.reads(c::KEPT_ID))?,
        };
        let kind = module.kind;
        let before = self.bytes.of(kind);
        let same = before.is_some_and(|before| **before == bytes);
        (!same).then_some(KeptBytes { kind, bytes })
    }

    fn parts(&self, module: &ModuleInfo, goal_tasks: Option<Arc<GoalTasks>>) -> Vec<Part> {
        let traffic = self.traffic.clone().map(Part::from);
        let rest = self.rest.clone().map(Part::from);
        let goal_tasks = goal_tasks.map(Part::from);
        let guidance = self.guidance.clone().map(Part::from);
        let kept = self.bytes.of(module.kind).cloned().map(Part::from);
        let parts = [traffic, rest, goal_tasks, guidance, kept];
        let parts = parts.into_iter().flatten();
        parts.filter(|part| module.reads(&part.id)).collect()
    }
}

/// The tasks of an instance's goals: an agent's own goals are met in their order, those of the state
/// first, then those of tasks that it was given with this instance. Others are nobody's.
fn matched(
    instance: &Instance,
    state: &FleetState,
    known: &GoalTasks,
    assignments: &[Assignment],
) -> GoalTasks {
    let time_s = known.time_s;
    let mut all = GoalTasks {
        time_s,
        ..GoalTasks::default()
    };
    for (agent, goals) in instance.goals.iter().enumerate() {
        let first = state.next.goals.offsets()[agent] as usize;
        let own = state.next.goals[agent].iter().enumerate();
        let own = own.map(|(at, cell)| {
            let goal = first + at;
            let errand = known.tasks[goal].zip(known.errands[goal]);
            (*cell, (errand, known.released_s[goal], known.given_s[goal]))
        });
        let given = assignments
            .iter()
            .filter(|given| given.agent as usize == agent);
        let tasks = given.filter_map(|given| state.tasks.iter().find(|task| task.id == given.task));
        let more = tasks.flat_map(|task| {
            let places = task.places.iter().zip(0..);
            places.map(|(cell, at)| (*cell, (Some((task.id, at)), task.released_s, time_s)))
        });
        let mut own = own.chain(more).peekable();
        for goal in goals {
            let found = own.next_if(|(cell, _)| cell == goal);
            let (errand, released_s, given_s) = found.map_or((None, time_s, time_s), |own| own.1);
            all.push(errand, released_s, given_s);
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use fleetyard_abi::Goals;
    use fleetyard_world::SeededRandom;
    use proptest::prelude::*;

    use super::*;

    const BLOCK_S: f64 = 0.1;
    const PERIOD: u64 = 200;

    /// Robots that stand or move, and calls, as a trace has them.
    #[derive(Default)]
    struct Trace {
        /// Block, cell and direction of a move.
        moves: Vec<(u64, usize, usize)>,
        /// Block of the call before, block of a call, and a cell where somebody waited meanwhile.
        waits: Vec<(u64, u64, usize)>,
    }

    impl Trace {
        /// The average at a snapshot of what comes to so much in each period.
        fn average(&self, number: u64, amount: impl Fn(&Self, u64) -> f64) -> f64 {
            let stays = (-PERIOD_S / TIME_CONSTANT_S).exp();
            let periods = (1..=number).map(|period| {
                let share = amount(self, period).min(1.0);
                stays.powi((number - period) as i32) * (1.0 - stays) * share
            });
            periods.sum()
        }

        fn waiting(&self, number: u64, cell: usize) -> f64 {
            self.average(number, |trace, period| {
                let (begin, end) = ((period - 1) * PERIOD, period * PERIOD);
                let waits = trace.waits.iter().filter(|wait| wait.2 == cell);
                let blocks = waits.map(|wait| wait.1.min(end).saturating_sub(wait.0.max(begin)));
                blocks.sum::<u64>() as f64 / PERIOD as f64
            })
        }

        fn flow(&self, number: u64, cell: usize, direction: usize, step_s: f64) -> f64 {
            self.average(number, |trace, period| {
                let within = |block: u64| block > (period - 1) * PERIOD && block <= period * PERIOD;
                let moves = trace.moves.iter();
                let moves =
                    moves.filter(|made| within(made.0) && (made.1, made.2) == (cell, direction));
                moves.count() as f64 * step_s / PERIOD_S
            })
        }
    }

    fn near(byte: u8, average: f64) -> bool {
        (f64::from(byte) - 255.0 * average).abs() <= 0.51
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            cases: 24,
            failure_persistence: None,
            ..ProptestConfig::default()
        })]

        /// Snapshots are what a trace says, recomputed without a trick, within their unit.
        #[test]
        fn averages_are_those_of_the_trace(
            seed in any::<u64>(),
            step_s in 0.3..2.0_f64,
            every in 1_u64..450,
            blocks in 1_u64..1500,
        ) {
            let grid = Grid::new("open", 4, 5, vec![b'.'; 20]).unwrap();
            let mut chance = SeededRandom::new("traffic", seed);
            let mut at = vec![0_u32, 7, 19];
            let mut ends = at.clone();
            let mut traffic = Traffics::new(&grid, &at, BLOCK_S, step_s);
            let mut trace = Trace::default();
            let mut called: Option<(u64, Vec<u32>)> = None;
            for block in 0..=blocks {
                for (agent, here) in at.iter_mut().enumerate() {
                    if block > 0 && chance.unit() < 0.1 {
                        let cell = *here;
                        let (row, col) = grid.row_col(cell);
                        let (direction, to) = match chance.below(4) {
                            0 if row > 0 => (0, cell - 5),
                            1 if col < 4 => (1, cell + 1),
                            2 if row < 3 => (2, cell + 5),
                            3 if col > 0 => (3, cell - 1),
                            _ => (0, cell),
                        };
                        traffic.done(agent, to);
                        if to != cell {
                            trace.moves.push((block, cell as usize, direction));
                        }
                        *here = to;
                    }
                }
                traffic.block(block);
                if block.is_multiple_of(every) {
                    for end in &mut ends {
                        if chance.unit() < 0.3 {
                            *end = chance.below(20) as u32;
                        }
                    }
                    let goals: Vec<bool> = ends.iter().map(|_| chance.unit() < 0.8).collect();
                    if let Some((before, stood)) = &called {
                        for agent in (0..at.len()).filter(|agent| goals[*agent]) {
                            if stood[agent] == ends[agent] {
                                trace.waits.push((*before, block, ends[agent] as usize));
                            }
                        }
                    }
                    traffic.call(block, &ends, |agent, _| goals[agent]);
                    called = Some((block, ends.clone()));
                }
            }
            // Snapshots are complete when a call comes after them.
            let last = called.as_ref().map_or(0, |(block, _)| block / PERIOD);
            let now = called.map_or(0, |(block, _)| block);
            let part = traffic.part(now);
            prop_assert_eq!(part.last.number, last);
            prop_assert_eq!(part.before.number, last.saturating_sub(1));
            prop_assert!(part.since_s >= 0.0 && part.since_s < PERIOD_S);
            let whole = traffic.flowed == traffic.waited;
            for cell in 0..20 {
                for shot in [&part.last, &part.before] {
                    let waiting = trace.waiting(shot.number, cell);
                    prop_assert!(near(shot.waiting[cell], waiting), "{cell}: {waiting}");
                    for direction in (0..4).filter(|_| whole) {
                        let flow = trace.flow(shot.number, cell, direction, step_s);
                        let byte = shot.flow[4 * cell + direction];
                        prop_assert!(near(byte, flow), "{cell} {direction}: {byte} {flow}");
                    }
                }
            }
        }
    }

    fn goal_tasks(errands: &[Option<(u64, u32)>]) -> GoalTasks {
        let mut tasks = GoalTasks {
            time_s: 9.0,
            ..GoalTasks::default()
        };
        for (errand, at) in errands.iter().zip(0..) {
            tasks.push(*errand, f64::from(at), f64::from(at) + 0.5);
        }
        tasks
    }

    #[test]
    fn goals_are_their_agents_own_in_their_order() {
        let lists =
            |lists: &[&[u32]]| -> Goals { lists.iter().map(|list| list.iter().copied()).collect() };
        let state = FleetState {
            time_s: 9.0,
            next: Instance {
                starts: vec![0, 1],
                goals: lists(&[&[5, 6], &[1]]),
                ..Instance::default()
            },
            tasks: vec![fleetyard_abi::Task {
                id: 4,
                places: vec![8, 9],
                released_s: 2.5,
            }],
            parts: Vec::new(),
        };
        let known = goal_tasks(&[Some((3, 1)), None, None]);
        // The first agent makes a detour, the second is given a task.
        let instance = Instance {
            goals: lists(&[&[7, 5, 6], &[1, 8, 9]]),
            ..state.next.clone()
        };
        let given = [Assignment { agent: 1, task: 4 }];
        let found = matched(&instance, &state, &known, &given);
        assert_eq!(found.tasks, [None, Some(3), None, None, Some(4), Some(4)]);
        assert_eq!(found.errands[4..], [Some(0), Some(1)]);
        assert_eq!(found.released_s, [9.0, 0.0, 1.0, 2.0, 2.5, 2.5]);
        assert_eq!(found.given_s, [9.0, 0.5, 1.5, 2.5, 9.0, 9.0]);
    }

    #[test]
    fn modules_get_what_they_list_and_keep_what_is_new() {
        let grid = Grid::new("open", 1, 2, vec![b'.'; 2]).unwrap();
        let module = |kind, parts: &[&str]| ModuleInfo {
            kind,
            name: "test".into(),
            id: "test".into(),
            version: String::new(),
            attach: "worker".into(),
            digest: None,
            options: serde_json::Map::new(),
            memory: memory_of(
                &parts
                    .iter()
                    .map(|part| format!("part:{part}"))
                    .collect::<Vec<_>>(),
            ),
        };
        let planner = module(
            Kind::Planner,
            &[c::KEPT_ID, c::TRAFFIC_ID, "org.example.x/1"],
        );
        let policy = module(Kind::FailPolicy, &[c::REST_OF_PLAN_ID]);
        let nobody = module(Kind::InstanceGenerator, &[]);
        assert_eq!(planner.memory, [c::TRAFFIC_ID, c::KEPT_ID]);
        let all = [planner.clone(), policy.clone(), nobody.clone()];
        let mut keeper = Keeper::new(&all, (&grid, None), &[0], (BLOCK_S, 0.5));
        assert!(keeper.wants_rest() && !keeper.wants_goal_tasks());
        let kept = |bytes: &[u8]| Some(bytes.to_vec());
        let memory = keeper.recall(0, vec!["E".into()], None);
        let ids = |module| -> Vec<String> {
            let parts = memory.parts(module, None);
            parts.iter().map(|part| part.id.clone()).collect()
        };
        assert_eq!(ids(&planner), [c::TRAFFIC_ID]);
        assert_eq!(ids(&policy), [c::REST_OF_PLAN_ID]);
        assert_eq!(ids(&nobody), [""; 0]);
        assert_eq!(memory.news(&policy, kept(b"x")), None);
        let news = memory
            .news(&planner, kept(b"x"))
            .expect("it reads what it keeps");
        let digest = |keeper: &Keeper, memory: &Memory| {
            let mut hasher = Hasher::new("test");
            keeper.hash(memory, &mut hasher);
            hasher.finish()
        };
        let before = digest(&keeper, &memory);
        keeper.keep(&[news]);
        let memory = keeper.recall(0, vec!["E".into()], None);
        assert_ne!(digest(&keeper, &memory), before);
        assert_eq!(
            memory.news(&planner, kept(b"x")),
            None,
            "the same as before"
        );
        assert_eq!(memory.news(&planner, None), None);
        let parts = memory.parts(&planner, None);
        assert_eq!(parts.len(), 2);
        assert_eq!(parts[1].id, c::KEPT_ID);
    }
}

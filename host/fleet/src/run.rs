//! The loop: robots drive what planners plan meanwhile.
//!
//! Time goes in blocks of [`Live::period_s`]. At the beginning of each the host learns
//! what robots have done, lets an answer take effect that is due, asks the invocation
//! policy if no call is under way, and sends the robots what they may do next. Calls are
//! answered on a thread of their own, so that planning and simulation overlap.

use std::collections::{BTreeMap, VecDeque};
use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;
use std::time::{Duration, Instant};

use fleetyard_abi::{
    Capability, FleetState, FleetStatus, Guidance, Heading, Instance, Motion, Robot,
    SharedEnvironment,
};
use fleetyard_core::formats::TaskList;
use fleetyard_core::{Connectivity, Digest, Grid, GridPlan, Hasher, InputError, OFF_MAP};
use fleetyard_runtime::{Closing, Fault};
use fleetyard_sim::motion::Model;
use fleetyard_sim::trace::{Entry, Goal, Happening, Remark, WaitLog};
use fleetyard_sim::{Fleet, Live, NoTrace, SimError, TraceSink};

use crate::adg::{Adg, Costs, Cut};
use crate::answers::{Answers, Plugins, Replay, broken};
use crate::assign::{Assigner, Giving, Source};
use crate::batch::{Batch, Refused, judge, judge_first};
use crate::call::{Answer, Call, Pipeline, ask};
use crate::closures::Closures;
use crate::course::Course;
use crate::memory::Keeper;
use crate::modules::{Module, ModuleInfo, Modules};
use crate::recording::{End, Header, Notice, Recording, Round, from_moves, to_moves};
use crate::series::Tally;
use crate::steps::Steps;
use crate::timed::{Timed, is_timed};
use crate::{
    Assign, Clock, Ended, EventKind, FleetConfig, FleetError, FleetExecution, FleetOutcome,
    Intervened, Intervention, Point,
};

/// The map and the fleet of a run.
#[derive(Debug, Clone, Copy)]
pub struct Ground<'a> {
    /// The map.
    pub grid: &'a Arc<Grid>,
    /// The robots; discs that move by one cell per step if there are none.
    pub fleet: Option<&'a Fleet>,
    /// The tasks, where there are some.
    pub tasks: Option<&'a TaskList>,
    /// Cells in which the first robots of the run start, looking east; without them they start
    /// in cells that are drawn, looking north.
    pub starts: Option<&'a [u32]>,
    /// The guidance graph of the map, for modules that read one.
    pub guidance: Option<&'a Arc<Guidance>>,
}

impl Ground<'_> {
    /// Digest of robots, tasks, starts and guidance.
    pub fn digest(&self) -> Digest {
        let mut hasher = Hasher::new("fleetyard.ground/2");
        hasher.value(&self.fleet.map(Fleet::profiles));
        hasher.u32s(self.fleet.map_or(&[], Fleet::profile_of));
        // A file of tasks is the same wherever it lies.
        let tasks = self.tasks.map(|list| &list.tasks);
        hasher.value(&tasks);
        // Runs without starts of their own keep their digests.
        if let Some(starts) = self.starts {
            hasher.u32s(starts);
        }
        if let Some(digest) = self.guidance_digest() {
            hasher.value(&digest);
        }
        hasher.finish()
    }

    /// Digest of the guidance graph, if there is one.
    fn guidance_digest(&self) -> Option<Digest> {
        self.guidance.map(|guidance| {
            let mut hasher = Hasher::new("fleetyard.guidance/1");
            hasher.value(guidance.as_ref());
            hasher.finish()
        })
    }

    /// The source of starts and goals, and the heading of all robots at the start.
    fn assigner(&self, config: &FleetConfig) -> Result<(Assigner, Heading), FleetError> {
        let source = Source::new(config.assign, self.grid, self.tasks.cloned(), config.reveal)?;
        let agents = config.agents as usize;
        let (assigner, heading) = if let Some(starts) = self.starts {
            let first = starts.get(..agents).ok_or_else(|| {
                let reason = format!("{agents} robots, but {} starts", starts.len());
                InputError::new("agents", reason)
                    .hint(format!("ask for 1 to {} robots", starts.len()))
            })?;
            let assigner = Assigner::with_starts(self.grid, source, first, config.seed)?;
            (assigner, Heading::East)
        } else {
            let assigner = Assigner::new(self.grid, source, agents, config.seed)?;
            (assigner, Heading::North)
        };
        let giving = match (config.assign, config.is_synchronous()) {
            (Assign::Generator, _) => Giving::Nobody,
            (_, true) => Giving::Shortest,
            (_, false) => Giving::Ahead,
        };
        Ok((assigner.giving(giving), heading))
    }

    /// True if turns take steps by synchronous rules. Refuses robots that do not do a step in a
    /// step, and planners that are told otherwise.
    fn turns_in_steps(&self, config: &FleetConfig) -> Result<bool, InputError> {
        let models = self.fleet.map_or(&[][..], Fleet::profiles);
        let turning = models
            .iter()
            .all(|profile| matches!(profile.model, Model::Rotation(_)));
        let turning = turning && !models.is_empty();
        let wrong = |reason: String, hint: &str| Err(InputError::new("rules", reason).hint(hint));
        let ideal = models.is_empty() || turning;
        if !ideal {
            let reason = "by synchronous rules robots are pebbles, or all of the model `rotation`";
            return wrong(reason.into(), "take the model `rotation` or `pebble`");
        }
        let motion = if turning {
            Motion::Rotation
        } else {
            Motion::Pebble
        };
        if config.motion != motion {
            let reason = format!(
                "planners are told the motion `{}`, but robots have `{}`",
                config.motion.as_str(),
                motion.as_str()
            );
            return wrong(reason, "leave the motion out, or take the other model");
        }
        Ok(turning)
    }

    /// The header of a recording of a run here.
    pub fn header(
        &self,
        config: &FleetConfig,
        modules: Vec<ModuleInfo>,
        setup: serde_json::Value,
    ) -> Header {
        Header::new(
            (self.grid.name().to_owned(), self.grid.digest()),
            self.digest(),
            modules,
            config.clone(),
            setup,
        )
    }
}

/// Is told of a run while it goes on.
pub trait Watch {
    /// The sink of the trace, if there is one.
    fn sink(&mut self) -> Option<&mut dyn TraceSink> {
        None
    }

    /// There is a new point in the series.
    fn point(&mut self, point: &Point, rtf: f64) {
        let _ = (point, rtf);
    }

    /// A plugin's answer took effect that is in no recording yet.
    fn round(&mut self, round: &Round) -> Result<(), InputError> {
        let _ = round;
        Ok(())
    }

    /// The run is over. Not told of a replay.
    fn end(&mut self, end: &End) -> Result<(), InputError> {
        let _ = end;
        Ok(())
    }

    /// The rest of the run is worth less, for this reason.
    fn doubt(&mut self, notice: &Notice) {
        let _ = notice;
    }

    /// A plugin was ended.
    fn closed(&mut self, info: &ModuleInfo, closing: Closing) {
        let _ = (info, closing);
    }

    /// A plugin ran without its supervisor for a while, or the host failed: what it did then counts for
    /// nothing.
    fn unsupervised(&mut self, info: &ModuleInfo, fault: &Fault) {
        let _ = (info, fault);
    }

    /// Interventions at the beginning of a block. Not asked in a replay, which has
    /// what was done then.
    fn interventions(&mut self) -> Vec<Intervention> {
        Vec::new()
    }

    /// An intervention takes effect that is in no recording yet.
    fn intervened(&mut self, intervened: &Intervened) -> Result<(), InputError> {
        let _ = intervened;
        Ok(())
    }

    /// An intervention makes no sense, for this reason.
    fn refused(&mut self, what: Intervention, reason: &str) {
        let _ = (what, reason);
    }

    /// A block of so many seconds is about to be driven; returns when it may be.
    fn pace(&mut self, period_s: f64) {
        let _ = period_s;
    }

    /// True to end the run before its time.
    fn is_interrupted(&self) -> bool {
        false
    }
}

/// Runs a fleet.
pub fn run(
    ground: &Ground<'_>,
    config: &FleetConfig,
    modules: Modules,
    watch: &mut dyn Watch,
) -> Result<FleetOutcome, FleetError> {
    Run::new(ground, config, Answers::Live(modules))?.go(watch)
}

/// Runs a fleet again as it was recorded, without any plugin.
pub fn replay(
    ground: &Ground<'_>,
    recording: Recording,
    watch: &mut dyn Watch,
) -> Result<FleetOutcome, FleetError> {
    let config = checked(ground, &recording)?;
    let answers = Answers::Recorded(Replay::new(recording)?);
    Run::new(ground, &config, answers)?.go(watch)
}

/// Runs a fleet again as it was recorded, and goes on from where the recording ends.
pub fn resume(
    ground: &Ground<'_>,
    recording: Recording,
    modules: Modules,
    watch: &mut dyn Watch,
) -> Result<FleetOutcome, FleetError> {
    let config = checked(ground, &recording)?;
    let answers = Answers::RecordedThenLive(Replay::new(recording)?, modules);
    Run::new(ground, &config, answers)?.go(watch)
}

/// The configuration of a recording, if it is of a run here.
fn checked(ground: &Ground<'_>, recording: &Recording) -> Result<FleetConfig, FleetError> {
    let header = recording.header();
    let wrong = |what: &str, hint: &str| {
        Err(
            InputError::new(recording.name(), format!("it was recorded with {what}"))
                .hint(hint)
                .into(),
        )
    };
    if header.map_digest != ground.grid.digest() {
        return wrong("another map", "name the map that it was recorded with");
    }
    if header.ground_digest != ground.digest() {
        return wrong(
            "other robots, tasks, starts or guidance",
            "the file of the fleet, the tasks, the starts or the guidance was changed since, or is another one",
        );
    }
    Ok(header.config.clone())
}

/// A call whose answer has not taken effect.
struct OpenCall {
    number: u64,
    block: u64,
    state: Digest,
    /// Starts of the agents in the answer.
    cut: Cut,
    /// Notices of the host when it decided to call.
    opening: Vec<Notice>,
}

/// Entries for the trace about the fleet.
#[derive(Default)]
struct Log {
    entries: Vec<Entry>,
    remarks: Vec<Remark>,
    notices: u64,
    /// Those who have no goal that is known, and its number.
    aimless: Vec<(usize, u32)>,
}

impl Log {
    /// Says that somebody has a goal, if it is known. Otherwise it is asked for later.
    fn aim(&mut self, tick: u64, assigner: &mut Assigner, agent: usize, number: u32) {
        match assigner.goal(agent, number) {
            OFF_MAP => self.aimless.push((agent, number)),
            cell => self.entries.push(Entry {
                tick,
                what: Happening::Goal(Goal {
                    agent: agent as u32,
                    number,
                    cell,
                    errand: assigner.errand(agent, number),
                }),
            }),
        }
    }

    fn notice(&mut self, tick: u64, call: u64, notice: &Notice) {
        let number = self.notices;
        self.notices += 1;
        self.entries.push(Entry {
            tick,
            what: Happening::Notice {
                number,
                call,
                name: notice.kind.name().to_owned(),
                module: beginning(&notice.module, Happening::MOST_NAME),
            },
        });
        self.remarks.push(Remark::Said {
            number,
            message: beginning(&notice.message, Remark::MOST_TEXT),
        });
    }
}

/// A text, or its beginning if it is longer than so many bytes.
fn beginning(text: &str, most: usize) -> String {
    text[..text.floor_char_boundary(most)].to_owned()
}

struct Run<'a> {
    ground: &'a Ground<'a>,
    config: &'a FleetConfig,
    live: Live<'a>,
    course: Course,
    assigner: Assigner,
    keeper: Keeper,
    tally: Tally,
    log: Log,
    infos: Vec<ModuleInfo>,
    answers: Answers<Plugins>,
    /// The model of the robots as planners are told it. Fleets of several models go without: not
    /// every planner takes them.
    robots: Vec<Robot>,
    /// Notices that belong to the next call, which was not made yet.
    early: Vec<Notice>,
    /// Cells that close, if some do.
    closures: Option<Closures>,
    /// Waits of robots, as the trace has them so far.
    waits: WaitLog,
    /// Robots that are held, and until when, in seconds.
    held: BTreeMap<u32, f64>,
    /// Interventions of the recording that were not made again yet.
    done_then: VecDeque<Intervened>,
    /// The map has changed since the last call, and since plugins were told of it.
    changed: bool,
    untold: bool,
    /// Blocks in all, and from a call to its effect in `lockstep`: of a planner's limit, but by
    /// synchronous rules none.
    blocks: u64,
    limit: u64,
    block: u64,
    /// Block in which the last batch was appended.
    appended: u64,
    calls: u64,
    called: u64,
    open: Option<OpenCall>,
    /// Blocks in which nobody had anything to do.
    idle: u64,
    /// The instant and the block at which simulated time began to follow the wall clock.
    pace: Option<(Instant, u64)>,
}

impl<'a> Run<'a> {
    fn new(
        ground: &'a Ground<'a>,
        config: &'a FleetConfig,
        answers: Answers<Modules>,
    ) -> Result<Self, FleetError> {
        config.validate()?;
        let grid = ground.grid;
        if let Some(guidance) = ground.guidance {
            let cells = grid.cell_count() as usize;
            let fits = guidance.check().and(guidance.check_size(4 * cells, cells));
            fits.map_err(|reason| InputError::new("guidance", reason))?;
        }
        let (assigner, heading) = ground.assigner(config)?;
        let starts = assigner.starts();
        let heading_rad = match heading {
            Heading::North => FRAC_PI_2,
            heading => heading.radians(),
        };
        let poses: Vec<(u32, f64)> = starts.iter().map(|cell| (*cell, heading_rad)).collect();
        let mut live = Live::new(&config.sim, grid, ground.fleet, &poses)?;
        let mut course = if config.is_synchronous() {
            let turning = ground.turns_in_steps(config)?;
            if turning {
                live = live.with_headings();
            }
            Course::Synchronous(Steps::new(grid.cols(), &starts, heading, turning))
        } else {
            let headings = vec![heading; starts.len()];
            let costs = Costs {
                quarter_turn: u32::from(turns(ground.fleet)),
                dwell: (config.dwell_s / config.sim.step_s).ceil() as u32,
            };
            let adg = Adg::new(grid, &starts, &headings, costs);
            live = live.with_waits();
            Course::Driven(adg.map_err(|error| FleetError::Broken(error.to_string()))?)
        };
        let period_s = live.period_s();
        let in_blocks = |seconds: f64| (seconds / period_s - 1e-9).ceil().max(1.0) as u64;
        let blocks = in_blocks(config.duration_s);
        let infos = match &answers {
            Answers::Live(modules) | Answers::RecordedThenLive(_, modules) => modules.infos(),
            Answers::Recorded(replay) => replay.recording().header().modules.clone(),
        };
        let recording = answers.replay().map(Replay::recording);
        let keeper = Keeper::new(
            recording.map_or(&infos, |recording| &recording.header().modules),
            (grid, ground.guidance),
            &starts,
            (period_s, config.sim.step_s),
        );
        if keeper.wants_rest() {
            course.tell_rest();
        }
        // An answer that is in effect after the last block is never waited for.
        if let Some(recording) = recording.filter(|recording| recording.last_block() > blocks) {
            let reason = "it goes on after the time that the run was to take";
            return Err(InputError::new(recording.name(), reason)
                .hint("the file was changed after it was written")
                .into());
        }
        let blocks = match &answers {
            // Without plugins there is nothing behind the recording.
            Answers::Recorded(replay) => {
                replay.recording().end().map_or(u64::MAX, |end| end.blocks)
            }
            Answers::Live(_) | Answers::RecordedThenLive(..) => blocks,
        };
        let done_then = recording.map_or(&[][..], Recording::interventions);
        let done_then = done_then.iter().copied().collect();
        let answers = answers.start(|modules| start(ground, config, modules))?;
        Ok(Self {
            tally: Tally::new(config, period_s, grid, &starts),
            limit: if config.is_synchronous() {
                0
            } else {
                in_blocks(config.limit_s)
            },
            ground,
            config,
            live,
            course,
            assigner,
            keeper,
            log: Log {
                aimless: (0..config.agents as usize)
                    .map(|agent| (agent, 0))
                    .collect(),
                ..Log::default()
            },
            infos,
            answers,
            robots: robots(ground.fleet),
            early: Vec::new(),
            closures: config
                .closing
                .map(|closing| Closures::new(closing, grid, config.seed)),
            waits: WaitLog::default(),
            held: BTreeMap::new(),
            done_then,
            changed: false,
            untold: false,
            blocks,
            block: 0,
            appended: 0,
            calls: 0,
            called: 0,
            open: None,
            idle: 0,
            pace: None,
        })
    }

    fn go(mut self, watch: &mut dyn Watch) -> Result<FleetOutcome, FleetError> {
        let started = Instant::now();
        let ended = self.operate(watch, started);
        let wall_s = started.elapsed().as_secs_f64();
        // Whoever is interrupted does not wait for a planner: it ends with this process.
        let waits = self.open.is_some() && matches!(ended, Ok(Ended::Interrupted));
        let closed = self.answers.close(watch, !waits);
        let ended = ended?;
        closed?;
        self.finish(watch, ended, wall_s)
    }

    fn operate(&mut self, watch: &mut dyn Watch, started: Instant) -> Result<Ended, FleetError> {
        self.live.begin(watch.sink().unwrap_or(&mut NoTrace))?;
        loop {
            self.learn();
            self.intervene(watch)?;
            self.close();
            let over = if self.is_over() {
                Some(Ended::Duration)
            } else if watch.is_interrupted() || !self.take_answer(watch)? {
                Some(Ended::Interrupted)
            } else {
                self.decide()?;
                // Where the robots stand while the planner plans, its answer is due at once.
                let goes_on = self.limit > 0 || self.take_answer(watch)?;
                (!goes_on).then_some(Ended::Interrupted)
            };
            self.tell(watch)?;
            if let Some(ended) = over {
                return Ok(ended);
            }
            self.tally.adg_nodes(self.course.pending());
            self.drive(watch, started)?;
        }
    }

    fn is_over(&self) -> bool {
        if self.block >= self.blocks {
            return true;
        }
        // A recording without an end ends with its last answer.
        let replayed = match &self.answers {
            Answers::Recorded(replay) => replay.next().is_none(),
            Answers::Live(_) | Answers::RecordedThenLive(..) => false,
        };
        replayed && self.blocks == u64::MAX && self.open.is_none()
    }

    /// Takes in what robots have done in the last block.
    fn learn(&mut self) {
        let Self {
            live,
            course,
            assigner,
            keeper,
            tally,
            log,
            ..
        } = self;
        let tick = live.tick();
        assigner.set_time(live.now_s());
        let mut reached = |assigner: &mut Assigner, agent: usize, goal: u32| {
            tally.goals_reached += 1;
            assigner.reached(agent, goal);
            log.entries.push(Entry {
                tick,
                what: Happening::Reached {
                    agent: agent as u32,
                    number: goal,
                },
            });
            log.aim(tick, assigner, agent, goal + 1);
        };
        match course {
            Course::Driven(adg) => {
                for &agent in live.news() {
                    let agent = agent as usize;
                    adg.complete(agent, live.done(agent), live.left(agent), &mut |node| {
                        keeper.done(agent, node.cell);
                        tally.moves.done(agent, node.cell);
                        if let Some(goal) = node.goal {
                            reached(assigner, agent, goal);
                        }
                    });
                }
            }
            Course::Synchronous(steps) => steps.learn(&mut |agent, cell, goal, moved| {
                if moved {
                    keeper.done(agent, cell);
                    tally.moves.done(agent, cell);
                }
                let is_there = assigner.goal(agent, goal) == cell;
                if is_there {
                    reached(assigner, agent, goal);
                }
                is_there
            }),
        }
        keeper.block(self.block);
    }

    /// Does to the fleet what somebody does, or did when it was recorded.
    fn intervene(&mut self, watch: &mut dyn Watch) -> Result<(), FleetError> {
        let now_s = self.live.now_s();
        self.held.retain(|_, until_s| *until_s > now_s);
        while let Some(done) = self.done_then.pop_front_if(|done| done.block <= self.block) {
            if let Err(reason) = self.can_do(done.what) {
                let name = self
                    .answers
                    .replay()
                    .map_or("", |replay| replay.recording().name());
                return Err(InputError::new(name, reason)
                    .hint("the file was changed after it was written")
                    .into());
            }
            self.apply(done.what, now_s);
        }
        if matches!(self.answers, Answers::Recorded(_)) || self.answers.recorded().is_some() {
            return Ok(());
        }
        for what in watch.interventions() {
            if let Err(reason) = self.can_do(what) {
                watch.refused(what, &reason);
                continue;
            }
            // First on record, as answers are.
            watch.intervened(&Intervened {
                block: self.block,
                what,
            })?;
            self.apply(what, now_s);
        }
        Ok(())
    }

    /// The reason why something cannot be done to the fleet, if there is one.
    fn can_do(&self, what: Intervention) -> Result<(), String> {
        what.check(self.ground.grid, self.config)?;
        match what {
            Intervention::Send { agent, cell } => self.assigner.can_send(agent, cell),
            _ => Ok(()),
        }
    }

    fn apply(&mut self, what: Intervention, now_s: f64) {
        match what {
            Intervention::Close { cell, for_s } => {
                let by_hand = || Closures::by_hand(self.ground.grid);
                self.closures.get_or_insert_with(by_hand).close(cell, for_s);
            }
            Intervention::Open { cell } => {
                if let Some(closures) = &mut self.closures {
                    closures.open(cell, now_s);
                }
            }
            Intervention::Hold { agent, for_s } => {
                self.held.insert(agent, now_s + for_s);
            }
            Intervention::Release { agent } => {
                self.held.remove(&agent);
            }
            Intervention::Send { agent, cell } => self.assigner.send(agent, cell),
        }
    }

    /// Closes and opens cells. Robots give up what they were not told to do yet where that leads into a closed one.
    fn close(&mut self) {
        let (Some(closures), Course::Driven(adg)) = (&mut self.closures, &mut self.course) else {
            return;
        };
        let now_s = self.live.now_s();
        // The answer to a call that was made begins where robots are committed to be.
        let called = self.open.is_some();
        let (closed, opened) = closures.go_on(now_s, &mut |cell| adg.is_held(cell, called));
        if closed + opened == 0 {
            return;
        }
        if adg.leads_into(&|cell| closures.is_closed(cell)) {
            adg.cut(0);
        }
        (self.changed, self.untold) = (true, true);
        if self.answers.recorded().is_none() {
            self.early.push(Notice {
                kind: EventKind::MapChanged,
                module: "host".into(),
                message: format!("cells closed: {closed}, opened: {opened}"),
            });
        }
    }

    /// Tells the trace what the fleet did at the beginning of the block.
    fn tell(&mut self, watch: &mut dyn Watch) -> Result<(), FleetError> {
        let (log, tick) = (&mut self.log, self.live.tick());
        for (agent, number) in std::mem::take(&mut log.aimless) {
            log.aim(tick, &mut self.assigner, agent, number);
        }
        let mut nobody = NoTrace;
        let sink = watch.sink().unwrap_or(&mut nobody);
        if !log.entries.is_empty() {
            sink.journal(&log.entries).map_err(SimError::from)?;
            log.entries.clear();
        }
        if !log.remarks.is_empty() {
            sink.remarks(&log.remarks).map_err(SimError::from)?;
            log.remarks.clear();
        }
        Ok(())
    }

    /// Lets the answer take effect that is due. False if the run was told to end while it
    /// waited for it.
    fn take_answer(&mut self, watch: &mut dyn Watch) -> Result<bool, FleetError> {
        let Some(open) = &self.open else {
            return Ok(true);
        };
        if let Some(round) = self.answers.recorded() {
            if round.effect != self.block {
                return Ok(true);
            }
            let plugins = self.answers.asked_again();
            if let Some(plugins) = plugins {
                let Some(answer) = plugins.wait(watch)? else {
                    return Ok(false);
                };
                let doubt = self.doubt(round, &answer);
                if let Some(doubt) = &doubt {
                    watch.doubt(doubt);
                }
                self.early.extend(doubt);
            }
            let batch = recorded_batch(self.ground.grid, self.config, &open.cut, round)
                .map_err(|reason| self.answers.wrong(round, reason))?;
            let round = self.answers.advance()?;
            self.open = None;
            self.effect(&round, batch)?;
            return Ok(true);
        }
        let plugins = self.answers.plugins()?;
        let answer = match self.config.clock {
            Clock::Lockstep if self.block < open.block + self.limit => return Ok(true),
            Clock::Lockstep => match plugins.wait(watch)? {
                Some(answer) => answer,
                None => return Ok(false),
            },
            Clock::Realtime => match plugins.answer()? {
                Some(answer) => answer,
                None => return Ok(true),
            },
        };
        let open = self.open.take().ok_or_else(broken)?;
        let mut notices = open.opening;
        notices.extend(answer.notices);
        let plan = answer.batch.as_ref().map(Batch::plan);
        let round = Round {
            call: open.number,
            block: open.block,
            effect: self.block,
            state: open.state,
            window_steps: answer.window_steps,
            motion: answer.motion,
            assignments: answer.assignments,
            by: answer.by,
            paths: plan.and_then(|plan| to_moves(plan, self.ground.grid.cols())),
            planner_ms: answer.planner_ms,
            planner_cpu_ms: answer.planner_cpu_ms,
            planner_cpu_before_ms: answer.planner_cpu_before_ms,
            expansions: answer.expansions,
            held_back: answer.held_back,
            recovery_ms: answer.recovery_ms,
            kept: answer.kept,
            notices,
            line: 0,
        };
        // First on record, then in the world: a host that is killed in between says the
        // same again.
        watch.round(&round)?;
        self.effect(&round, answer.batch)?;
        Ok(true)
    }

    /// The notice of an answer that differs from the one that was recorded.
    fn doubt(&self, round: &Round, answer: &Answer) -> Option<Notice> {
        let plan = answer.batch.as_ref().map(Batch::plan);
        let paths = plan.and_then(|plan| to_moves(plan, self.ground.grid.cols()));
        let same = answer.by == round.by
            && answer.assignments == round.assignments
            && answer.window_steps == round.window_steps
            && paths == round.paths
            && answer.kept == round.kept;
        (!same).then(|| Notice {
            kind: EventKind::ResumedOtherwise,
            module: self
                .infos
                .first()
                .map_or("host".into(), |info| info.id.clone()),
            message: format!(
                "started anew and asked call {} again, it answered otherwise than recorded: the \
                 planner or the generator remembers earlier calls, or depends on the clock, and \
                 the run goes on otherwise than it would have",
                round.call
            ),
        })
    }

    /// Lets an answer take effect.
    fn effect(&mut self, round: &Round, batch: Option<Batch>) -> Result<(), FleetError> {
        self.tally.round(round);
        self.keeper.keep(&round.kept);
        let (tick, call) = (self.live.tick(), round.call);
        self.log.entries.push(Entry {
            tick,
            what: Happening::Answered { call, by: round.by },
        });
        self.log.remarks.push(Remark::Took {
            call,
            planner_ms: round.planner_ms,
            fail_policy_ms: round.recovery_ms,
        });
        for notice in &round.notices {
            self.log.notice(tick, call, notice);
        }
        for assignment in &round.assignments {
            self.assigner
                .give(assignment.agent, assignment.task)
                .map_err(|reason| self.answers.wrong(round, reason))?;
        }
        let Some(batch) = batch else {
            return Ok(());
        };
        self.appended = self.block;
        let assigner = &mut self.assigner;
        let appended = self
            .course
            .append(batch, &mut |agent, index| assigner.goal(agent, index))
            .map_err(|error| FleetError::Broken(error.to_string()))?;
        let (rings, stopped) = (appended.rings_cut, appended.stopped);
        if let (Some(closures), Course::Driven(adg)) = (&self.closures, &mut self.course)
            && adg.leads_into(&|cell| closures.is_closed(cell))
        {
            // Closed since the call was made; the next one is due.
            adg.cut(0);
        }
        if rings > 0 {
            let notice = Notice {
                kind: EventKind::RingsCut,
                module: "host".into(),
                message: format!(
                    "{stopped} robots stop before moves in {rings} rings, or behind those who do"
                ),
            };
            self.tally.rings_cut += rings as u64;
            self.tally.notice(self.block, &notice);
            self.log.notice(tick, call, &notice);
        }
        // A tenth of a millisecond per thousand robots; a sample is enough of it.
        if round.call.is_multiple_of(16) && !self.course.is_acyclic() {
            return Err(FleetError::Broken(format!(
                "the dependency graph has a cycle after call {}",
                round.call
            )));
        }
        Ok(())
    }

    /// Calls the planner if it is time to.
    fn decide(&mut self) -> Result<(), FleetError> {
        let period_s = self.live.period_s();
        self.idle = if self.course.pending() == 0 {
            self.idle + 1
        } else {
            0
        };
        if self.open.is_some() {
            self.idle = 0;
            return Ok(());
        }
        if let Some(round) = self.answers.recorded() {
            if round.block < self.block {
                let reason = "the call is made before the answer to the last one";
                return Err(self.answers.wrong(round, reason.into()));
            }
            if round.block == self.block {
                self.call(Vec::new())?;
            }
            return Ok(());
        }
        // An answer that would take effect after the end is not asked for.
        let replays = matches!(self.answers, Answers::Recorded(_));
        if replays || self.block + self.limit >= self.blocks {
            return Ok(());
        }
        let mut opening = std::mem::take(&mut self.early);
        let invoke = self.calls == 0 || self.changed || self.policy_invokes(&mut opening)?;
        let idle_s = (self.idle.saturating_sub(1)) as f64 * period_s;
        if !invoke && idle_s >= self.config.watchdog_s {
            opening.push(Notice {
                kind: EventKind::Watchdog,
                module: "host".into(),
                message: format!(
                    "nobody had anything to do for {} s and the invocation policy did not call",
                    self.config.watchdog_s
                ),
            });
        } else if !invoke {
            self.early = opening;
            return Ok(());
        }
        self.call(opening)
    }

    /// Asks the invocation policy. Where it fails, the host calls.
    fn policy_invokes(&mut self, opening: &mut Vec<Notice>) -> Result<bool, FleetError> {
        let agents = 0..self.course.agents();
        let status = FleetStatus {
            time_s: self.live.now_s(),
            since_last_call_s: (self.block - self.called) as f64 * self.live.period_s(),
            planning_limit_s: self.config.limit_s,
            action_s: self.config.sim.step_s,
            actions_left: agents
                .map(|agent| self.course.actions_left(agent))
                .collect(),
        };
        let plugins = self.answers.plugins_mut()?;
        let wall_s = self.config.allowance.call_s;
        let asked = ask(
            &mut plugins.invocation,
            &plugins.environment,
            self.config,
            opening,
            (EventKind::InvocationFault, self.calls, wall_s),
            |session, _| session.should_invoke(&status, Duration::from_secs_f64(wall_s)),
        );
        Ok(asked.unwrap_or(true))
    }

    /// Drops what nobody is committed to.
    fn cut(&mut self) -> Cut {
        let (config, fleet) = (self.config, self.ground.fleet);
        let since_s = (self.block - self.appended) as f64 * self.live.period_s();
        self.course.cut(config, fleet, since_s)
    }

    /// Cuts what is planned, and asks about what is behind the cut.
    fn call(&mut self, opening: Vec<Notice>) -> Result<(), FleetError> {
        let config = self.config;
        let mut cut = self.cut();
        let number = self.calls;
        self.changed = false;
        let assigner = &mut self.assigner;
        // Tasks that are given only now have kept nobody waiting.
        let current: Vec<u32> = (cut.next_goal.iter().enumerate())
            .map(|(agent, next)| assigner.goal(agent, *next))
            .collect();
        self.keeper.call(self.block, &cut.cells, |agent, end| {
            current[agent] != OFF_MAP && current[agent] != end
        });
        let window_steps = config.window_steps();
        // Tasks are given to agents by it.
        let goals = self
            .assigner
            .upcoming(&cut.cells, &cut.next_goal, window_steps);
        let asked = self.keeper.wants_goal_tasks();
        let goal_tasks = asked.then(|| self.assigner.goal_tasks(&goals, &cut.next_goal));
        let rest = std::mem::take(&mut cut.rest);
        let memory = self.keeper.recall(self.block, rest, goal_tasks);
        let mut hasher = hasher(number, self.block, &cut);
        self.keeper.hash(&memory, &mut hasher);
        let state = hasher.finish();
        let plugins = match self.answers.recorded() {
            Some(round) if round.state != state => {
                let reason = "the fleet is in another state than when this was recorded";
                return Err(self.answers.wrong(round, reason.into()));
            }
            Some(_) => self.answers.asked_again(),
            None => Some(self.answers.plugins()?),
        };
        if let Some(plugins) = plugins {
            let map = match &self.closures {
                Some(closures) if std::mem::take(&mut self.untold) => {
                    let map = closures.map(self.ground.grid)?;
                    let environment = environment(&map, config);
                    Some((map, environment))
                }
                _ => None,
            };
            plugins.call(Call {
                number,
                memory,
                map,
                state: FleetState {
                    time_s: self.live.now_s(),
                    next: Instance {
                        starts: cut.cells.clone(),
                        headings: Some(cut.headings.clone()),
                        goals,
                        window_steps,
                        motion: config.motion_in_steps(),
                        radius_m: radius_m(self.ground.fleet, config),
                        robots: self.robots.clone(),
                        // Robots that are driven would wait for each other.
                        allows_cycles: config.is_synchronous(),
                        ..Instance::default()
                    },
                    tasks: self.assigner.open_tasks(),
                    parts: Vec::new(),
                },
                // One task at a time, as the League has it.
                busy: if config.is_synchronous() {
                    self.assigner.busy()
                } else {
                    Vec::new()
                },
            })?;
        }
        self.log.entries.push(Entry {
            tick: self.live.tick(),
            what: Happening::Asked { call: number },
        });
        self.open = Some(OpenCall {
            number,
            block: self.block,
            state,
            cut,
            opening,
        });
        self.calls += 1;
        self.called = self.block;
        Ok(())
    }

    /// Sends robots what they may do, and lets them drive for one block.
    fn drive(&mut self, watch: &mut dyn Watch, started: Instant) -> Result<(), FleetError> {
        let Self {
            live,
            course,
            config,
            held,
            waits,
            ..
        } = self;
        // Whoever is sent more now waits no longer, unless messages take time.
        if let Some(sink) = watch.sink() {
            let awaited = |agent| live.awaited(agent, course.ahead(agent));
            let changes = waits.changes(live.tick(), live.agents(), awaited);
            if !changes.is_empty() {
                sink.waits(&changes).map_err(SimError::from)?;
            }
        }
        course.send(config, &|agent| held.contains_key(&(agent as u32)), live);
        let period_s = live.period_s();
        watch.pace(period_s);
        if self.config.clock == Clock::Realtime && self.answers.recorded().is_none() {
            // What is repeated takes no time.
            let (began, first) = *self.pace.get_or_insert((Instant::now(), self.block));
            let due = Duration::from_secs_f64((self.block + 1 - first) as f64 * period_s);
            std::thread::sleep(due.saturating_sub(began.elapsed()));
        }
        self.live.advance(watch.sink().unwrap_or(&mut NoTrace))?;
        self.course.check(&self.live)?;
        self.block += 1;
        let (live, grid) = (&self.live, self.ground.grid);
        let cell_size_m = self.config.sim.cell_size_m;
        let still = (0..self.course.agents())
            .filter(|agent| !live.is_moving(*agent))
            .map(|agent| {
                let pose = live.pose(agent);
                fleetyard_core::cell_of_point(grid, cell_size_m, pose.x, pose.y)
            });
        self.tally.block(still);
        if let Some(point) = self.tally.point(self.block, false) {
            let rtf = point.time_s / started.elapsed().as_secs_f64().max(1e-9);
            watch.point(&point, rtf);
        }
        Ok(())
    }

    fn finish(
        mut self,
        watch: &mut dyn Watch,
        ended: Ended,
        wall_s: f64,
    ) -> Result<FleetOutcome, FleetError> {
        self.tally.adg_nodes(self.course.pending());
        if let Some(point) = self.tally.point(self.block, true) {
            watch.point(&point, point.time_s / wall_s.max(1e-9));
        }
        let agents = self.course.agents();
        let committed = self.cut();
        let committed = committed.next_goal.iter().map(|goals| u64::from(*goals));
        let metrics = self.tally.metrics(
            agents,
            self.block,
            committed.sum(),
            self.assigner.tasks_done(),
        );
        let waiting_s_per_cell = self.tally.waiting_s_per_cell();
        let simulated = self.live.finish(watch.sink().unwrap_or(&mut NoTrace))?;
        let end = End {
            blocks: self.block,
            trace_digest: simulated.trace_digest,
        };
        match &self.answers {
            // Nothing is said of a replay that did not come to its end.
            Answers::Recorded(_) if ended == Ended::Interrupted => {}
            Answers::Recorded(replay) => replay.came_out(&end)?,
            Answers::Live(_) | Answers::RecordedThenLive(..) => watch.end(&end)?,
        }
        Ok(FleetOutcome {
            fleetyard: env!("CARGO_PKG_VERSION"),
            map: self.ground.grid.name().to_owned(),
            map_digest: self.ground.grid.digest(),
            guidance_digest: self.ground.guidance_digest(),
            modules: self.infos,
            config: self.config.clone(),
            ended,
            metrics,
            execution: FleetExecution {
                figures: simulated.figures(wall_s),
                wall_s,
            },
            moves: self.tally.moves.counts,
            series: self.tally.series,
            events: self.tally.events,
            closures: self
                .closures
                .map_or_else(Vec::new, |closures| closures.past),
            waiting_s_per_cell,
        })
    }
}

/// Teaches the plugins the map and lets them wait for calls.
fn start(
    ground: &Ground<'_>,
    config: &FleetConfig,
    modules: Modules,
) -> Result<Plugins, FleetError> {
    let Modules {
        planner,
        generator,
        invocation,
        fail_policy,
    } = modules;
    let environment = environment(ground.grid, config);
    let timed = is_timed(config.motion).then(|| timed(ground, config, &planner));
    let mut pipeline = Pipeline {
        grid: Arc::clone(ground.grid),
        timed: timed.transpose()?,
        components: ground.grid.components(Connectivity::Four),
        environment: SharedEnvironment::clone(&environment),
        config: config.clone(),
        planner,
        generator,
        fail_policy,
    };
    pipeline.check_capabilities()?;
    pipeline.prepare()?;
    Plugins::start(pipeline, invocation, environment)
}

/// The map as a roadmap, with the models of robots: all of them for a planner that takes several.
fn timed(ground: &Ground<'_>, config: &FleetConfig, planner: &Module) -> Result<Timed, FleetError> {
    let radius_m = radius_m(ground.fleet, config);
    let timed = Timed::new(ground.grid, &config.sim, radius_m, config.motion)?;
    let quarter_turn_s = config.pace(ground.fleet).quarter_turn_s;
    let several = ground
        .fleet
        .filter(|_| planner.capabilities().has(Capability::Heterogeneous))
        .filter(|fleet| fleet.profiles().len() > 1);
    Ok(match several {
        Some(fleet) => timed.with_robots(
            fleetyard_views::robots_of(fleet, |_| String::new()),
            fleet.profile_of().to_vec(),
            quarter_turn_s,
        ),
        None => timed.with_robots(robots(ground.fleet), Vec::new(), quarter_turn_s),
    })
}

/// The plan of a recorded call, judged anew: a file may say anything.
fn recorded_batch(
    grid: &Grid,
    config: &FleetConfig,
    cut: &Cut,
    round: &Round,
) -> Result<Option<Batch>, String> {
    let Some(paths) = &round.paths else {
        return Ok(None);
    };
    if round.window_steps > config.window_steps() {
        return Err("the window is longer than that of the run".into());
    }
    let plan = from_moves(paths, &cut.cells, grid.rows(), grid.cols())?;
    let instance = Instance {
        headings: Some(cut.headings.clone()),
        motion: round.motion,
        window_steps: round.window_steps,
        allows_cycles: config.is_synchronous(),
        ..Instance::one_shot(cut.cells.clone(), cut.cells.clone())
    };
    match judge_by(config)(grid, &instance, plan) {
        Ok(batch) => Ok(Some(batch)),
        Err(refused) => Err(format!("the plan may not be executed: {refused}")),
    }
}

/// The judge of plans by the rules of a run.
pub(crate) fn judge_by(
    config: &FleetConfig,
) -> fn(&Grid, &Instance, GridPlan) -> Result<Batch, Box<Refused>> {
    if config.is_synchronous() {
        judge_first
    } else {
        judge
    }
}

/// The model of all robots, if they have the same.
fn robots(fleet: Option<&Fleet>) -> Vec<Robot> {
    let one = fleet.filter(|fleet| fleet.profiles().len() == 1);
    one.map_or_else(Vec::new, |fleet| {
        fleetyard_views::robots_of(fleet, |_| String::new())
    })
}

/// True if all robots have to turn before they can move another way.
fn turns(fleet: Option<&Fleet>) -> bool {
    fleet.is_some_and(|fleet| {
        fleet
            .profiles()
            .iter()
            .all(|profile| profile.model.max_turn_rate_rad_per_s().is_finite())
    })
}

/// The usual length of a step: a cell's side at the top speed of the slowest robot, one
/// second for robots that are as fast as they are told to be.
pub fn step_s(fleet: Option<&Fleet>, cell_size_m: f64) -> f64 {
    let profiles = fleet.map_or(&[][..], Fleet::profiles);
    let speeds = profiles
        .iter()
        .map(|profile| profile.model.max_speed_m_per_s());
    let slowest = speeds.fold(f64::INFINITY, f64::min);
    if slowest.is_finite() {
        cell_size_m / slowest
    } else {
        1.0
    }
}

fn radius_m(fleet: Option<&Fleet>, config: &FleetConfig) -> f64 {
    fleet.map_or(config.sim.radius_m(), |fleet| {
        let radii = fleet
            .shapes()
            .iter()
            .map(fleetyard_world::Shape::effective_radius_m);
        radii.fold(0.0, f64::max)
    })
}

/// The beginning of a digest of what an answer depends on, as far as the host is concerned.
fn hasher(number: u64, block: u64, cut: &Cut) -> Hasher {
    let mut hasher = Hasher::new("fleetyard.fleet-state/1");
    hasher.u64(number);
    hasher.u64(block);
    hasher.u32s(&cut.cells);
    hasher.u32s(&cut.next_goal);
    let quarters = cut.headings.iter().map(|heading| heading.code() as u8);
    hasher.bytes(&quarters.collect::<Vec<_>>());
    hasher
}

/// The map as plugins are told it.
fn environment(grid: &Grid, config: &FleetConfig) -> SharedEnvironment {
    fleetyard_runtime::environment_of(
        grid,
        Connectivity::Four,
        config.sim.cell_size_m,
        config.sim.step_s,
    )
}

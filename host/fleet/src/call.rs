//! A call: from where the fleet will be to a plan that may be executed.
//!
//! The generator makes an instance, the planner solves it, the plan is judged, and the
//! fail policy is asked where there is nothing that may be executed. Whatever goes wrong
//! with a plugin ends here: a call has an answer, if only that everybody waits.

use std::borrow::Cow;
use std::sync::Arc;

use fleetyard_abi::{
    Assignment, Capabilities, Capability, FleetState, Goals, Instance, Kind, Motion, Plan, Request,
    SharedEnvironment, Status,
};
use fleetyard_core::{Connectivity, Grid, GridPlan};
use fleetyard_runtime::{Fault, Generated, PlanRun, Termination};

use crate::batch::Batch;
use crate::memory::Memory;
use crate::modules::{Module, budget};
use crate::recording::{KeptBytes, Notice};
use crate::run::judge_by;
use crate::timed::{Ordered, Timed};
use crate::{By, EventKind, FleetConfig, FleetError};

/// The name of the figure by which a planner tells how much it searched.
const EXPANSIONS: &str = "expansions";

/// The name of the figure by which a planner tells how many robots it holds back.
const HELD_BACK: &str = "held_back";

/// A call.
#[derive(Debug)]
pub(crate) struct Call {
    /// The number of the call, from 0.
    pub(crate) number: u64,
    /// The fleet's state, of which the generator makes an instance.
    pub(crate) state: FleetState,
    /// The memory that goes with it to those who read it.
    pub(crate) memory: Memory,
    /// The map as it is from now on, where it has changed since the last call.
    pub(crate) map: Option<(Arc<Grid>, SharedEnvironment)>,
    /// True per agent that may be given no task, for it has one; none if that does not matter.
    pub(crate) busy: Vec<bool>,
}

/// The answer to a call.
#[derive(Debug)]
pub(crate) struct Answer {
    /// The window of the instance.
    pub(crate) window_steps: u32,
    /// Tasks that the generator gave to agents.
    pub(crate) assignments: Vec<Assignment>,
    /// The plan that may be executed.
    pub(crate) batch: Option<Batch>,
    /// The module that made the plan.
    pub(crate) by: By,
    /// The motion by which the plan was judged: the host may ask a fail policy that knows no turns for a
    /// plan without them.
    pub(crate) motion: Motion,
    /// Wall-clock time of the planner, if it was asked.
    pub(crate) planner_ms: Option<f64>,
    /// Processor time of the planner, if it was asked and that is known.
    pub(crate) planner_cpu_ms: Option<f64>,
    /// The same since the planner's call before, until this one began.
    pub(crate) planner_cpu_before_ms: Option<f64>,
    /// Expansions of its search, as it says.
    pub(crate) expansions: Option<f64>,
    /// Robots that the planner says it holds back.
    pub(crate) held_back: Option<f64>,
    /// Wall-clock time of the fail policy, if it was asked.
    pub(crate) recovery_ms: Option<f64>,
    /// Bytes that modules kept, where they are others than before.
    pub(crate) kept: Vec<KeptBytes>,
    /// Faults and other events.
    pub(crate) notices: Vec<Notice>,
}

/// The modules that answer a call, one after the other, and the rules for what they say.
#[derive(Debug)]
pub(crate) struct Pipeline {
    pub(crate) grid: Arc<Grid>,
    /// Per cell the number of its component; cells of different ones have no way to each
    /// other.
    pub(crate) components: Vec<u32>,
    pub(crate) environment: SharedEnvironment,
    /// The map as the planner is told it, if it plans in continuous time.
    pub(crate) timed: Option<Timed>,
    pub(crate) config: FleetConfig,
    pub(crate) planner: Module,
    pub(crate) generator: Module,
    pub(crate) fail_policy: Module,
}

const ALONG_THE_GRID: &str = "fleets move along the grid: use the motion `pebble` or `rotation`, or in continuous time \
                              `stop-go` or `slower`";

const IN_STEPS: &str = "plan in steps, as with the motion `pebble`";

/// Refuses a plugin that does not claim what is needed of it: the first thing, each with another way
/// out than a plugin that does.
fn check_claims(module: &Module, needs: &[(Capability, &str)]) -> Result<(), FleetError> {
    let claims = module.capabilities();
    let Some((missing, way_out)) = needs.iter().find(|(needed, _)| !claims.has(*needed)) else {
        return Ok(());
    };
    let needed: Vec<Capability> = needs.iter().map(|(needed, _)| *needed).collect();
    let able = module.able(Capabilities::of(&needed));
    let hint = match *way_out {
        "" => able.to_string(),
        way_out => format!("{way_out}; {able}"),
    };
    Err(FleetError::Incapable {
        kind: module.info().kind,
        name: module.info().name.clone(),
        missing: *missing,
        hint,
    })
}

impl Pipeline {
    /// Refuses a planner or a fail policy that cannot do what the run needs.
    pub(crate) fn check_capabilities(&self) -> Result<(), FleetError> {
        let can = self.planner.capabilities();
        let unlimited = self.config.window_steps() == 0;
        let (motion, hint) = match self.config.motion {
            Motion::Pebble => (Capability::Pebble, ""),
            Motion::Rotation => (
                Capability::Rotation,
                "let it plan as for pebbles: robots turn all the same",
            ),
            Motion::StopGo => (Capability::StopGo, IN_STEPS),
            Motion::Slower => (Capability::Slower, IN_STEPS),
            Motion::AnyAngle => (Capability::AnyAngle, ALONG_THE_GRID),
            Motion::Dynamics => (Capability::Dynamics, ALONG_THE_GRID),
        };
        let map = self
            .timed
            .as_ref()
            .map_or(&self.environment, Timed::environment);
        let on_the_map = if self.timed.is_some() {
            IN_STEPS
        } else if can.has(Capability::Roadmap) {
            "let it plan in continuous time with the motion `stop-go`"
        } else {
            ""
        };
        let mut needs: Vec<_> = map
            .needs()
            .iter()
            .map(|needed| (needed, on_the_map))
            .collect();
        needs.push((motion, hint));
        if unlimited
            && self
                .generator
                .capabilities()
                .has(Capability::DuplicateGoals)
        {
            let hint =
                "the instance generator lets several robots have one goal: use `distinct-one-goal`";
            needs.push((Capability::DuplicateGoals, hint));
        } else if !unlimited {
            let hint = "it plans to the end: give it no window with `--window 0s`";
            needs.push((Capability::Windowed, hint));
        }
        check_claims(&self.planner, &needs)?;
        if self.config.is_synchronous() && self.config.motion == Motion::Rotation {
            let hint = "by synchronous rules robots turn in steps of the plan";
            check_claims(&self.fail_policy, &[(Capability::Rotation, hint)])?;
        }
        Ok(())
    }

    /// Teaches everybody the map.
    pub(crate) fn prepare(&mut self) -> Result<(), FleetError> {
        let allowance = &self.config.allowance;
        for module in [
            &mut self.planner,
            &mut self.generator,
            &mut self.fail_policy,
        ] {
            let kind = module.info().kind;
            let timed = self.timed.as_ref().filter(|_| kind == Kind::Planner);
            let environment = timed.map_or(&self.environment, Timed::environment);
            let seed = self.config.call_seed(kind, u64::MAX);
            let budget = budget(allowance.prepare_s, allowance, 0, seed);
            if let Err(fault) = module.ready(environment, &budget) {
                return Err(FleetError::Start {
                    kind,
                    name: module.info().name.clone(),
                    fault,
                });
            }
        }
        Ok(())
    }

    /// Answers a call.
    pub(crate) fn answer(&mut self, call: &Call) -> Answer {
        if let Some((grid, environment)) = &call.map {
            self.components = grid.components(Connectivity::Four);
            self.grid = Arc::clone(grid);
            self.environment = SharedEnvironment::clone(environment);
            for module in [
                &mut self.planner,
                &mut self.generator,
                &mut self.fail_policy,
            ] {
                module.forget_map();
            }
        }
        let state = &call.state;
        let mut answer = Answer {
            window_steps: state.next.window_steps,
            assignments: Vec::new(),
            batch: None,
            by: By::Nobody,
            motion: state.next.motion,
            planner_ms: None,
            planner_cpu_ms: None,
            planner_cpu_before_ms: None,
            expansions: None,
            held_back: None,
            recovery_ms: None,
            kept: Vec::new(),
            notices: Vec::new(),
        };
        let mut failed = None;
        let instance = match self.generate(call, &mut answer) {
            Some(request) => {
                let instance = state.instance(&request);
                answer.window_steps = request.window_steps;
                answer.assignments = request.assignments;
                failed = self.plan(call, &instance, &mut answer);
                instance
            }
            // The fail policy gets everybody to where they are to go next.
            None => Instance {
                goals: {
                    let goals = state.next.goals.iter().zip(&state.next.starts);
                    let current = goals.map(|(own, start)| *own.first().unwrap_or(start));
                    Goals::single(current.collect())
                },
                ..state.next.clone()
            },
        };
        if answer.batch.is_none() {
            self.recover(call, instance, failed.as_ref(), &mut answer);
        }
        if answer.batch.is_none() {
            answer.notices.push(Notice {
                kind: EventKind::AllWait,
                module: "host".into(),
                message: "there is no plan: robots wait where their ways end".into(),
            });
        }
        answer
    }

    /// The request for the next instance, if there is one that may be asked.
    fn generate(&mut self, call: &Call, answer: &mut Answer) -> Option<Request> {
        let wall_s = self.config.allowance.call_s;
        let state = call.memory.of_state(&call.state, self.generator.info());
        let Generated {
            request: made,
            kept,
        } = ask(
            &mut self.generator,
            &self.environment,
            &self.config,
            &mut answer.notices,
            (EventKind::GeneratorFault, call.number, wall_s),
            |session, budget| session.generate(&state, budget),
        )?;
        let kept = call.memory.news(self.generator.info(), kept);
        answer.kept.extend(kept);
        match self.check(call, &made) {
            Ok(()) => Some(made),
            Err(message) => {
                answer.notices.push(Notice {
                    kind: EventKind::InvalidInstance,
                    module: self.generator.info().id.clone(),
                    message,
                });
                None
            }
        }
    }

    /// Refuses a request for an instance that the planner may not be asked.
    fn check(&self, call: &Call, request: &Request) -> Result<(), String> {
        let state = &call.state;
        let (next, agents) = (&state.next, state.next.agents());
        request.check(agents, self.grid.cell_count() as usize)?;
        if request.window_steps > next.window_steps {
            return Err(format!(
                "the request has a window of {} steps, longer than the {} that are asked for",
                request.window_steps, next.window_steps
            ));
        }
        let planner = self.planner.capabilities();
        let mut lists = request.goals.iter();
        if let Some(agent) = lists.position(<[u32]>::is_empty)
            && !planner.has(Capability::Idle)
        {
            return Err(format!(
                "agent {agent} has no goal, which planner `{}` does not support",
                self.planner.info().id
            ));
        }
        let place = |cell: u32| {
            let (row, col) = self.grid.row_col(cell);
            format!("cell {cell} (row {row}, column {col})")
        };
        let may_go = |agent: usize, cell: u32| {
            if !self.grid.is_passable(cell) {
                return Err(format!(
                    "agent {agent} is to go to {}, which is blocked",
                    place(cell)
                ));
            }
            let component = |cell: u32| self.components[cell as usize];
            if component(cell) != component(next.starts[agent]) {
                return Err(format!(
                    "agent {agent} is to go to {}, to which there is no way",
                    place(cell)
                ));
            }
            Ok(())
        };
        for (agent, goals) in request.goals.iter().enumerate() {
            goals.iter().try_for_each(|cell| may_go(agent, *cell))?;
        }
        if request.window_steps == 0 && !planner.has(Capability::DuplicateGoals) {
            let lists = request.goals.iter().enumerate();
            let mut last: Vec<(u32, usize)> = lists
                .filter_map(|(agent, goals)| Some((*goals.last()?, agent)))
                .collect();
            last.sort_unstable();
            if let Some(pair) = last.windows(2).find(|pair| pair[0].0 == pair[1].0) {
                return Err(format!(
                    "agents {} and {} are to stay in {}, which planner `{}` does not support",
                    pair[0].1,
                    pair[1].1,
                    place(pair[0].0),
                    self.planner.info().id
                ));
            }
        }
        let mut given: Vec<u64> = Vec::new();
        let mut busy = call.busy.clone();
        for Assignment { agent, task } in &request.assignments {
            let agent = *agent as usize;
            let open = state.tasks.iter().find(|open| open.id == *task);
            let Some(open) = open.filter(|_| agent < agents) else {
                return Err(format!(
                    "task {task} is given to agent {agent}, but one of them does not exist or is \
                     not open"
                ));
            };
            open.places
                .iter()
                .try_for_each(|cell| may_go(agent, *cell))?;
            if let Some(busy) = busy.get_mut(agent)
                && std::mem::replace(busy, true)
            {
                return Err(format!(
                    "task {task} is given to agent {agent}, which has one: by synchronous rules \
                     agents have one task at a time"
                ));
            }
            given.push(*task);
        }
        given.sort_unstable();
        match given.windows(2).find(|pair| pair[0] == pair[1]) {
            Some(pair) => Err(format!("task {} is given away twice", pair[0])),
            None => Ok(()),
        }
    }

    /// Asks the planner. Returns what is left to the fail policy where no plan may be executed:
    /// paths that collide, where they are paths.
    fn plan(&mut self, call: &Call, instance: &Instance, answer: &mut Answer) -> Option<Plan> {
        let wall_s = self.config.limit_s;
        let given = &answer.assignments;
        let info = self.planner.info();
        let timed = self.timed.as_ref();
        let asked = match timed {
            None => Ok(call.memory.of_instance(instance, &call.state, given, info)),
            // Memory is about cells, which such a planner does not know.
            Some(timed) => timed.instance(instance).map(Cow::Owned),
        };
        let instance = match asked {
            Ok(instance) => instance,
            Err(message) => {
                answer.notices.push(Notice {
                    kind: EventKind::InvalidInstance,
                    module: self.generator.info().id.clone(),
                    message,
                });
                return None;
            }
        };
        let mut run = ask_for_plan(
            &mut self.planner,
            timed.map_or(&self.environment, Timed::environment),
            &self.config,
            &mut answer.notices,
            (EventKind::PlannerFault, call.number, wall_s),
            |session, budget| session.plan(&instance, budget),
        )?;
        let kept = call.memory.news(self.planner.info(), run.kept.take());
        answer.kept.extend(kept);
        answer.planner_ms = Some(milliseconds(&run));
        let expansions = run.metrics.get(EXPANSIONS).copied();
        answer.expansions = expansions.filter(|count| count.is_finite() && *count >= 0.0);
        // A claim of more robots than there are, or of fewer than none, means nothing.
        let agents = call.state.next.agents() as f64;
        let held = run.metrics.get(HELD_BACK).copied();
        answer.held_back = held.filter(|held| (0.0..=agents).contains(held));
        let ms = |us: u64| us as f64 / 1000.0;
        answer.planner_cpu_ms = run.usage.cpu_us.map(ms);
        answer.planner_cpu_before_ms = run.usage.before_us.map(ms);
        let mut notice = |kind, message| {
            answer.notices.push(Notice {
                kind,
                module: self.planner.info().id.clone(),
                message,
            });
        };
        let fault_told = run.fault.is_some();
        if !fault_told && run.termination == Termination::TimedOut {
            let message = format!("answered after its limit of {wall_s} s");
            notice(EventKind::PlannerFault, message);
        }
        let judged = match (timed, run.plan()) {
            (Some(timed), Some(Plan::Visits(visits))) => {
                let judged = timed.judge(&self.grid, &instance, visits);
                judged.map_err(|reason| (reason, None))
            }
            (None, Some(Plan::Cells(plan))) => {
                let judged = judge_by(&self.config)(&self.grid, &instance, plan.clone());
                let judged = judged.map(|batch| Ordered {
                    batch,
                    circles: Vec::new(),
                });
                judged.map_err(|refused| (refused.to_string(), Some(refused.plan)))
            }
            _ => {
                if !fault_told && run.termination != Termination::TimedOut {
                    notice(EventKind::PlannerGaveUp, claim(&run));
                }
                return None;
            }
        };
        match judged {
            Ok(Ordered { batch, circles }) => {
                answer.batch = Some(batch);
                answer.by = By::Planner;
                if timed.is_some() {
                    // Its order is recorded as steps, which have no window any more.
                    answer.window_steps = 0;
                }
                answer.notices.extend(circles.iter().map(|circle| Notice {
                    kind: EventKind::RingsCut,
                    module: "host".into(),
                    message: format!(
                        "robots {circle:?} would wait for each other: they stop before that"
                    ),
                }));
                None
            }
            Err((refused, plan)) => {
                if run.claim == Some(Status::Solved) {
                    notice(EventKind::InvalidBatch, refused);
                } else if !fault_told {
                    notice(
                        EventKind::PlannerGaveUp,
                        format!("{}; its paths collide: {refused}", claim(&run)),
                    );
                }
                let plan = plan.filter(|plan| self.are_paths(&instance, plan));
                plan.map(Plan::from)
            }
        }
    }

    /// True if a fail policy can make something of a plan: everybody has a path that
    /// begins at its start and leads over free cells that are next to each other.
    fn are_paths(&self, instance: &Instance, plan: &GridPlan) -> bool {
        let free = |cell: u32| cell < self.grid.cell_count() && self.grid.is_passable(cell);
        let steps = |from: u32, to: u32| {
            from == to
                || self
                    .grid
                    .neighbors(from, Connectivity::Four)
                    .any(|next| next == to)
        };
        plan.agents() == instance.agents()
            && plan.paths().zip(&instance.starts).all(|(path, start)| {
                path.first() == Some(start)
                    && path.iter().all(|cell| free(*cell))
                    && path.windows(2).all(|step| steps(step[0], step[1]))
            })
    }

    /// Asks the fail policy.
    fn recover(
        &mut self,
        call: &Call,
        mut instance: Instance,
        failed: Option<&Plan>,
        answer: &mut Answer,
    ) {
        if !self.fail_policy.capabilities().has(Capability::Rotation) {
            // Robots turn whether a plan has steps for it or not.
            instance.motion = Motion::Pebble;
        }
        let wall_s = self.config.allowance.call_s;
        let given = &answer.assignments;
        let info = self.fail_policy.info();
        let instance = call.memory.of_instance(&instance, &call.state, given, info);
        let mut run = ask_for_plan(
            &mut self.fail_policy,
            &self.environment,
            &self.config,
            &mut answer.notices,
            (EventKind::FailPolicyFault, call.number, wall_s),
            |session, budget| session.recover(&instance, failed, budget),
        );
        let kept = run.as_mut().and_then(|run| run.kept.take());
        let kept = call.memory.news(self.fail_policy.info(), kept);
        answer.kept.extend(kept);
        answer.recovery_ms = Some(run.as_ref().map_or(0.0, milliseconds));
        let Some(run) = run else { return };
        let mut notice = |kind, message| {
            answer.notices.push(Notice {
                kind,
                module: self.fail_policy.info().id.clone(),
                message,
            });
        };
        let Some(plan) = run.cells().cloned() else {
            if run.fault.is_none() {
                notice(EventKind::FailPolicyFault, claim(&run));
            }
            return;
        };
        match judge_by(&self.config)(&self.grid, &instance, plan) {
            Ok(batch) => {
                answer.batch = Some(batch);
                answer.by = By::FailPolicy;
                answer.motion = instance.motion;
            }
            Err(refused) => notice(EventKind::InvalidRecovery, refused.to_string()),
        }
    }

    /// Ends the plugins.
    pub(crate) fn into_modules(self) -> [Module; 3] {
        [self.planner, self.generator, self.fail_policy]
    }
}

fn milliseconds(run: &PlanRun) -> f64 {
    run.planning.as_secs_f64() * 1000.0
}

/// The claim of a plugin that has no plan to show, or not one that it believes in.
fn claim(run: &PlanRun) -> String {
    let claim = run.claim.map_or("it has no plan".to_owned(), |claim| {
        format!("it says `{claim}`")
    });
    match &run.message {
        Some(message) => format!("{claim}: {message}"),
        None => claim,
    }
}

/// The kind of trouble that a fault of the plugin is, the number of the call, and the
/// wall-clock seconds that it may take.
type Terms = (EventKind, u64, f64);

/// Makes a call, starting the plugin again if it has died, and says what went wrong.
pub(crate) fn ask<T>(
    module: &mut Module,
    environment: &SharedEnvironment,
    config: &FleetConfig,
    notices: &mut Vec<Notice>,
    (trouble, number, wall_s): Terms,
    call: impl FnOnce(&mut fleetyard_runtime::Session, &fleetyard_abi::Budget) -> Result<T, Fault>,
) -> Option<T> {
    let id = module.info().id.clone();
    let kind = module.info().kind;
    let mut notice = |kind, message| {
        notices.push(Notice {
            kind,
            module: id.clone(),
            message,
        });
    };
    let was_down = module.is_down();
    let grace = module.patience(config.allowance.grace_s);
    let allowance = &config.allowance;
    let seed = config.call_seed(kind, number);
    let nodes = if kind == Kind::Planner {
        allowance.nodes
    } else {
        0
    };
    let made = match module.ready(
        environment,
        &budget(allowance.prepare_s, allowance, 0, seed),
    ) {
        Ok(session) => {
            if was_down {
                notice(EventKind::Restarted, "it was started again".into());
            }
            if kind == Kind::Planner {
                session.set_grace(grace);
            }
            call(session, &budget(wall_s, allowance, nodes, seed))
        }
        Err(fault) => {
            notice(EventKind::NotRestarted, fault.to_string());
            return None;
        }
    };
    match made {
        Ok(made) => {
            module.answered();
            Some(made)
        }
        Err(fault) => {
            let message = match module.after(&fault) {
                Some(words) => format!("{fault}; its last words were: {words}"),
                None => fault.to_string(),
            };
            // A generator that finds a goal closed or cut off is not at fault.
            let is_refused = matches!(
                fault,
                Fault::Reported {
                    status: Status::InvalidInput,
                    ..
                }
            );
            notice(
                match trouble {
                    EventKind::GeneratorFault if is_refused => EventKind::InvalidInstance,
                    trouble => trouble,
                },
                message,
            );
            None
        }
    }
}

/// The same for calls whose plans count although they ended in a fault.
fn ask_for_plan(
    module: &mut Module,
    environment: &SharedEnvironment,
    config: &FleetConfig,
    notices: &mut Vec<Notice>,
    terms: Terms,
    call: impl FnOnce(&mut fleetyard_runtime::Session, &fleetyard_abi::Budget) -> PlanRun,
) -> Option<PlanRun> {
    let mut kept = None;
    ask(
        module,
        environment,
        config,
        notices,
        terms,
        |session, budget| {
            let run = call(session, budget);
            let fault = run.fault.clone();
            kept = Some(run);
            fault.map_or(Ok(()), Err)
        },
    );
    kept
}

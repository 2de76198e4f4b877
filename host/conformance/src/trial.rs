//! One case and one plugin: sessions, calls, answers, and what is noted on
//! the way.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use fleetyard_abi::{
    Budget, Capability, Descriptor, FleetStatus, GridPlan, Kind, Knot, KnotPlan, Motion, Objective,
    Part, Plan, Request, SharedEnvironment, Status,
};
use fleetyard_runtime::{Attach, Closing, Fault, PlanRun, Runtime, Session};
use fleetyard_world::SeededRandom;
use serde_json::{Map, Value};

use crate::question::Question;
use crate::report::milliseconds;
use crate::representation::Representation;
use crate::rules::{Arrival, Rules, broken_rule};
use crate::scene::Scene;
use crate::scene::robots::DYNAMICS;
use crate::stop::{Failure, Step, Stop};
use crate::subject::{Config, Subject};

/// Knowledge of the kit about an instance.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Expectation {
    /// There is a plan.
    Plan,
    /// There is a plan, and it is no wonder when it is not found.
    Perhaps,
    /// There is none.
    NoPlan,
    /// The kit does not know: there is a plan or there is none.
    Unknown,
    /// Nothing but that the plugin has to live through it: the input is nonsense.
    Survival,
}

/// The budget and the input of a call.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Call<'a> {
    pub(crate) wall: Duration,
    pub(crate) nodes: u64,
    pub(crate) threads: u32,
    /// The plan that a planner left, for fail policies.
    pub(crate) failed: Option<&'a Plan>,
    /// A part that the input has besides.
    pub(crate) part: Option<&'a Part>,
    /// Memory that goes with the instance or the state.
    pub(crate) memory: &'a [Part],
}

impl Call<'_> {
    pub(crate) fn of(wall: Duration) -> Self {
        Self {
            wall,
            nodes: 0,
            threads: 1,
            failed: None,
            part: None,
            memory: &[],
        }
    }
}

/// The answer of a plugin.
#[derive(Debug, Clone)]
pub(crate) struct Answer {
    pub(crate) status: Status,
    pub(crate) message: Option<String>,
    pub(crate) said: Said,
    /// Metrics that it reported.
    pub(crate) figures: BTreeMap<String, f64>,
    /// Bytes that it kept.
    pub(crate) kept: Option<Vec<u8>>,
    /// Number of annotations, where they were wanted.
    pub(crate) annotations: usize,
    /// Wall time of the call.
    pub(crate) wall: Duration,
    /// Time between the deadline and the return of the call.
    pub(crate) late: Duration,
    /// True if the clock had a say in the answer.
    pub(crate) by_clock: bool,
}

/// The content of an answer besides its status.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Said {
    /// Plans that came in time, in order.
    Plans(Vec<Plan>),
    Request(Request),
    Invoke(bool),
    Nothing,
}

impl Answer {
    /// The plans, if the answer has some.
    pub(crate) fn plans(&self) -> &[Plan] {
        match &self.said {
            Said::Plans(plans) => plans,
            _ => &[],
        }
    }

    /// For people: the status and what the plugin said about it.
    pub(crate) fn shown(&self) -> String {
        match &self.message {
            Some(message) => format!("`{}` ({message})", self.status),
            None => format!("`{}`", self.status),
        }
    }
}

/// Compares two answers to the same input, as far as they can be compared: the last plan when time
/// is up is chance, the first is not, unless it is what a search left that found none.
pub(crate) fn same(one: &Answer, other: &Answer) -> Result<(), String> {
    let differ = |what: &str| Err(format!("{what} differs from one time to the next"));
    if one.by_clock || other.by_clock {
        let solved = [one, other].map(|answer| answer.status == Status::Solved);
        if solved != [true, true] {
            return Ok(());
        }
        return match (one.plans().first(), other.plans().first()) {
            (Some(one), Some(other)) if !same_plan(one, other) => differ("the first plan"),
            _ => Ok(()),
        };
    }
    if one.status != other.status {
        return differ(&format!("the status ({}, {})", one.status, other.status));
    }
    match (&one.said, &other.said) {
        (Said::Plans(one), Said::Plans(other)) => match (one.last(), other.last()) {
            (Some(one), Some(other)) if !same_plan(one, other) => differ("the plan"),
            _ => Ok(()),
        },
        (one, other) if one != other => differ("the answer"),
        _ => Ok(()),
    }
}

/// True if two plans say the same. Who has no heading has the same one.
fn same_plan(one: &Plan, other: &Plan) -> bool {
    match (one, other) {
        (Plan::Cells(one), Plan::Cells(other)) => one.trimmed() == other.trimmed(),
        (Plan::Trajectories(one), Plan::Trajectories(other)) => {
            let numbers = |knot: &Knot| {
                [knot.time_s, knot.x_m, knot.y_m, knot.heading_rad].map(|number| {
                    let number = if number.is_nan() { f64::NAN } else { number };
                    number.to_bits()
                })
            };
            let bits = |plan: &KnotPlan| -> Vec<_> { plan.items().iter().map(numbers).collect() };
            one.knots().offsets() == other.knots().offsets()
                && bits(one.knots()) == bits(other.knots())
                && one.controls() == other.controls()
        }
        (one, other) => one == other,
    }
}

/// Figures of a case: answers that were expected to have a plan, and those of them in which the plugin
/// gave up.
pub const EXPECTED: &str = "expected_plans";
/// See [`EXPECTED`].
pub const GIVEN_UP: &str = "given_up";

/// One case in progress.
pub(crate) struct Trial<'a> {
    runtime: &'a Runtime,
    config: Config,
    pub(crate) subject: &'a Subject,
    pub(crate) seed: u64,
    warnings: Vec<String>,
    notes: Vec<String>,
    figures: BTreeMap<String, f64>,
    /// In the host's process a library is loaded and initialised once.
    kept: Option<Session>,
    /// Number of steps of delay that plans have to tolerate.
    pub(crate) delay: u32,
    /// True if it is a planner for one agent; known after the first need of it.
    alone: Option<bool>,
    /// Number of answers that were judged.
    judged: usize,
    /// Scenes of which the plugin does not know the robots or the obstacles, as it may.
    unknown: Vec<String>,
}

impl<'a> Trial<'a> {
    pub(crate) fn new(
        runtime: &'a Runtime,
        config: Config,
        subject: &'a Subject,
        seed: u64,
    ) -> Self {
        Self {
            runtime,
            config,
            subject,
            seed,
            warnings: Vec::new(),
            notes: Vec::new(),
            figures: BTreeMap::new(),
            kept: None,
            delay: 0,
            alone: None,
            judged: 0,
            unknown: Vec::new(),
        }
    }

    /// The end of a case: one in which the plugin knew none of the robots is skipped, and those that it
    /// did not know are named.
    pub(crate) fn end(&mut self) -> Step<()> {
        let Some(first) = self.unknown.first() else {
            return Ok(());
        };
        if self.judged == 0 {
            return Err(Stop::Skipped(format!(
                "the plugin knows none of the robots or obstacles, as it may: {first}"
            )));
        }
        for unknown in std::mem::take(&mut self.unknown) {
            self.note(format!("not known, as it may be: {unknown}"));
        }
        Ok(())
    }

    /// True if there was a scene of which the plugin does not know the robots.
    pub(crate) fn is_ignorant(&self) -> bool {
        !self.unknown.is_empty()
    }

    /// True if it was found out to be a planner for one agent.
    pub(crate) fn is_alone(&self) -> bool {
        self.alone == Some(true)
    }

    /// Forgets findings beside outcomes, for those who ask without end, and gives the figures.
    pub(crate) fn forget(&mut self) -> BTreeMap<String, f64> {
        self.warnings.clear();
        self.notes.clear();
        self.unknown.clear();
        std::mem::take(&mut self.figures)
    }

    /// Findings beside the outcome: warnings, notes and figures.
    pub(crate) fn into_findings(self) -> (Vec<String>, Vec<String>, BTreeMap<String, f64>) {
        (self.warnings, self.notes, self.figures)
    }

    pub(crate) fn config(&self) -> &Config {
        &self.config
    }

    pub(crate) fn descriptor(&self) -> &'a Descriptor {
        &self.subject.descriptor
    }

    pub(crate) fn kind(&self) -> Kind {
        self.subject.descriptor.kind
    }

    /// Something that is odd but allowed.
    pub(crate) fn warn(&mut self, text: impl Into<String>) {
        let text = text.into();
        if !self.warnings.contains(&text) {
            self.warnings.push(text);
        }
    }

    /// Something that is as it may be, and worth knowing.
    pub(crate) fn note(&mut self, text: impl Into<String>) {
        let text = text.into();
        if !self.notes.contains(&text) {
            self.notes.push(text);
        }
    }

    /// Counts one more of something.
    fn count(&mut self, name: &str) {
        *self.figures.entry(name.into()).or_default() += 1.0;
    }

    pub(crate) fn figure(&mut self, name: &str, value: f64) {
        self.figures.insert(name.into(), value);
    }

    /// Random numbers that follow from the seed of the case.
    pub(crate) fn random(&self) -> SeededRandom {
        SeededRandom::new("conformance", self.seed)
    }

    /// True if the plugin claims a capability. Plugins other than planners have often nothing to
    /// claim; they are asked about pebbles on grids.
    pub(crate) fn claims(&self, capability: Capability) -> bool {
        let claimed = self.descriptor().capabilities;
        let nothing = claimed.bits() == 0 && self.kind() != Kind::Planner;
        let common = matches!(capability, Capability::Grid | Capability::Pebble);
        claimed.has(capability) || (nothing && common)
    }

    /// Skips a case that is for plugins of other kinds, or of capabilities that this plugin does not claim.
    pub(crate) fn needs(&self, kinds: &[Kind], capabilities: &[Capability]) -> Step<()> {
        let kind = self.kind();
        if !kinds.contains(&kind) {
            return Err(Stop::Skipped(format!("is not for a plugin of kind {kind}")));
        }
        let missing = capabilities.iter().find(|needed| !self.claims(**needed));
        match missing {
            Some(missing) => Err(Stop::Skipped(format!(
                "the plugin does not claim `{}`",
                missing.as_str()
            ))),
            None => Ok(()),
        }
    }

    /// The representations in which the plugin plans for several agents, and so can be asked about
    /// any scene.
    pub(crate) fn representations(&self) -> Step<Vec<Representation>> {
        let mut all = Vec::new();
        if self.claims(Capability::Grid) && self.claims(Capability::Pebble) {
            all.push(Representation::Grid);
        }
        if self.claims(Capability::Roadmap) {
            all.push(Representation::Roadmap(self.pace()));
        }
        if self.claims(Capability::Continuous) {
            all.push(Representation::Plane);
        }
        if all.is_empty() {
            return Err(Stop::Skipped(
                "the plugin claims neither pebbles on grids nor roadmaps nor the plane".into(),
            ));
        }
        Ok(all)
    }

    /// The same, or one in which it plans otherwise.
    pub(crate) fn any_representation(&self) -> Vec<Representation> {
        let otherwise = if self.claims(Capability::AnyAngle) {
            Representation::Straight
        } else {
            Representation::Turning
        };
        self.representations().unwrap_or(vec![otherwise])
    }

    /// A scene in every representation that the plugin claims.
    pub(crate) fn shown(&self, scene: &Scene) -> Step<Vec<Box<dyn Question>>> {
        let all = self.representations()?.into_iter();
        Ok(all.map(|representation| representation.of(scene)).collect())
    }

    /// The motion on roadmaps that the plugin is asked about unless a case is about another one.
    pub(crate) fn pace(&self) -> Motion {
        if !self.claims(Capability::StopGo) && self.claims(Capability::Slower) {
            Motion::Slower
        } else {
            Motion::StopGo
        }
    }

    /// The budget of a call: whoever takes all of it gets a part.
    pub(crate) fn wall(&self) -> Duration {
        if self.claims(Capability::Anytime) {
            self.config().slice()
        } else {
            self.config().budget
        }
    }

    // ---- Sessions ----------------------------------------------------------------

    /// A session in which nothing has been made yet.
    pub(crate) fn open(&mut self) -> Step<Session> {
        match self.kept.take() {
            Some(session) => Ok(session),
            None => Ok(self.runtime.open(&self.subject.file, self.subject.attach)?),
        }
    }

    /// Ends a session.
    pub(crate) fn close(&mut self, mut session: Session) -> Closing {
        let closing = session.close();
        if self.is_in_process() {
            self.kept = Some(session);
        }
        closing
    }

    pub(crate) fn is_in_process(&self) -> bool {
        self.subject.attach == Attach::InProcess
    }

    /// Makes the plugin, with more options than it always gets.
    pub(crate) fn create_with(
        &self,
        session: &mut Session,
        more: &Map<String, Value>,
    ) -> Result<(), Fault> {
        let mut options = self.subject.options.clone();
        options.extend(more.clone());
        let Descriptor { kind, id, .. } = self.descriptor();
        session.create(*kind, id, Value::Object(options))
    }

    pub(crate) fn create(&self, session: &mut Session) -> Step<()> {
        Ok(self.create_with(session, &Map::new())?)
    }

    /// Tells the plugin a map, if its kind wants to know.
    pub(crate) fn prepare(&self, session: &mut Session, scene: &dyn Question) -> Step<()> {
        if self.kind() == Kind::InvocationPolicy {
            return Ok(());
        }
        match self.learn(session, &scene.environment()?) {
            Err(Fault::Reported {
                status: Status::Unsupported,
                message,
                ..
            }) if scene.may_be_unknown() => Err(Stop::Skipped(format!(
                "the plugin does not know the map, as it may: {}: {message}",
                scene.name()
            ))),
            learnt => Ok(learnt?),
        }
    }

    /// Tells the plugin a map as it is.
    pub(crate) fn learn(
        &self,
        session: &mut Session,
        environment: &SharedEnvironment,
    ) -> Result<(), Fault> {
        let budget = self.budget(&Call::of(self.config().budget));
        session.prepare(environment, &budget).map(|_| ())
    }

    /// A plugin that knows the map of a scene.
    pub(crate) fn ready(&mut self, scene: &dyn Question) -> Step<Session> {
        let mut session = self.open()?;
        self.create(&mut session)?;
        self.prepare(&mut session, scene)?;
        Ok(session)
    }

    // ---- Calls -------------------------------------------------------------------

    pub(crate) fn budget(&self, call: &Call<'_>) -> Budget {
        Budget {
            nodes: call.nodes,
            threads: call.threads,
            seed: self.seed,
            ..Budget::lasting(0, call.wall.as_nanos() as u64)
        }
    }

    /// Asks what the plugin is for. The answer is not judged yet, but one that came
    /// by force is none. A planner for one agent is asked about the first.
    pub(crate) fn ask(
        &mut self,
        session: &mut Session,
        scene: &dyn Question,
        call: &Call<'_>,
    ) -> Step<Answer> {
        let answer = self.put_fitting(session, scene, call)?;
        let in_question = self.alone.is_none()
            && self.kind() == Kind::Planner
            && scene.instance().agents() > 1
            && answer.status == Status::Unsupported;
        let Some(pair) = in_question.then(|| scene.pair()).transpose()?.flatten() else {
            return Ok(answer);
        };
        self.prepare(session, &*pair)?;
        let alone = self
            .put_fitting(
                session,
                &*pair,
                &Call {
                    part: None,
                    ..*call
                },
            )?
            .status
            == Status::Unsupported;
        self.alone = Some(alone);
        self.prepare(session, scene)?;
        if !alone {
            return Ok(answer);
        }
        let only = self.put_fitting(session, scene, call)?;
        if only.status == Status::Unsupported && scene.may_be_unknown() {
            // It is no matter of how many there are.
            self.alone = None;
            return Ok(answer);
        }
        Ok(only)
    }

    /// The scene that is asked in place of another: robots with dynamics that the plugin lists, if it lists any,
    /// and the first agent alone, if it plans for one.
    fn in_place_of(&self, scene: &dyn Question) -> Option<Box<dyn Question>> {
        let moved = self
            .dynamics()
            .first()
            .and_then(|name| scene.moved_by(name));
        let is_alone = self.alone == Some(true);
        let whole = moved.as_deref().unwrap_or(scene);
        if is_alone {
            Some(whole.first_agent())
        } else {
            moved
        }
    }

    /// The dynamics of robots that the plugin lists, as far as the host can judge them.
    pub(crate) fn dynamics(&self) -> Vec<&'static str> {
        let features = &self.descriptor().features;
        let lists = |name: &&str| {
            let mut features = features.iter();
            features.any(|feature| feature.strip_prefix("dynamics:") == Some(*name))
        };
        DYNAMICS.into_iter().filter(lists).collect()
    }

    /// Asks it once, as much of the scene as it plans for.
    fn put_fitting(
        &self,
        session: &mut Session,
        scene: &dyn Question,
        call: &Call<'_>,
    ) -> Step<Answer> {
        match self.in_place_of(scene) {
            Some(other) => self.put(session, &*other, call),
            None => self.put(session, scene, call),
        }
    }

    /// Asks it once, as it is.
    fn put(&self, session: &mut Session, scene: &dyn Question, call: &Call<'_>) -> Step<Answer> {
        let budget = self.budget(call);
        let more = || call.part.cloned();
        let mut instance = scene.instance();
        instance.parts.extend(more());
        instance.parts.extend_from_slice(call.memory);
        let started = Instant::now();
        let answer = match self.kind() {
            Kind::Planner => Self::planned(session.plan(&instance, &budget), call),
            Kind::FailPolicy => {
                let run = session.recover(&instance, call.failed, &budget);
                Self::planned(run, call)
            }
            Kind::InstanceGenerator => {
                let mut state = scene.state();
                state.parts.extend(more());
                state.next.parts.extend(more());
                state.parts.extend_from_slice(call.memory);
                let mut kept = None;
                let said = session.generate(&state, &budget).map(|made| {
                    kept = made.kept;
                    Said::Request(made.request)
                });
                let answer = answered_by(said, started.elapsed(), call);
                answer.map(|answer| Answer { kept, ..answer })
            }
            Kind::InvocationPolicy => invoke(session, &scene.status(), call.wall),
        }?;
        self.in_time(answer)
    }

    /// An answer that came within the grace.
    pub(crate) fn in_time(&self, answer: Answer) -> Step<Answer> {
        // Who has a process of its own was stopped already.
        if answer.late > self.config().grace {
            let reason = format!(
                "it returned {:.0} ms after the deadline",
                milliseconds(answer.late)
            );
            return Err(Stop::failed(Failure::new("late", reason)));
        }
        Ok(answer)
    }

    fn planned(run: PlanRun, call: &Call<'_>) -> Step<Answer> {
        let PlanRun {
            claim,
            message,
            fault,
            incumbents,
            planning,
            metrics,
            kept,
            annotations,
            ..
        } = run;
        let (status, message) = match fault {
            Some(Fault::Reported {
                status, message, ..
            }) => (status, Some(message)),
            Some(fault) => return Err(fault.into()),
            None => (claim.unwrap_or(Status::InternalError), message),
        };
        let plans: Vec<Plan> = incumbents
            .into_iter()
            .filter_map(|incumbent| incumbent.plan)
            .collect();
        let too_late = status == Status::Solved && plans.is_empty();
        Ok(Answer {
            status: if too_late { Status::TimedOut } else { status },
            message,
            said: if plans.is_empty() {
                Said::Nothing
            } else {
                Said::Plans(plans)
            },
            figures: metrics,
            kept,
            annotations: annotations.kept().len(),
            wall: planning,
            late: planning.saturating_sub(call.wall),
            by_clock: is_long(planning, call.wall),
        })
    }

    // ---- Answers -----------------------------------------------------------------

    /// Judges an answer.
    pub(crate) fn judge(
        &mut self,
        scene: &dyn Question,
        answer: &Answer,
        expectation: Expectation,
    ) -> Step<()> {
        self.judge_as(scene, answer, expectation, Arrival::Stay)
    }

    pub(crate) fn judge_as(
        &mut self,
        scene: &dyn Question,
        answer: &Answer,
        expectation: Expectation,
        arrival: Arrival,
    ) -> Step<()> {
        if self.alone == Some(true) && scene.is_crowded() {
            return Err(Stop::Skipped(
                "asks about several agents, and this is a planner for one".into(),
            ));
        }
        let other = self.in_place_of(scene);
        let scene = other.as_deref().unwrap_or(scene);
        let failed = |failure: Failure| {
            let (name, picture) = (scene.name(), scene.picture());
            let told = failure.told(|reason| format!("{name}: {reason}{picture}"));
            Err(Stop::Failed(told))
        };
        let lies = |reason: String| {
            failed(Failure::new(
                format!("false-claim {}", answer.status),
                reason,
            ))
        };
        if expectation == Expectation::Survival {
            self.judge_survival(scene, answer);
            return Ok(());
        }
        match &answer.said {
            Said::Plans(plans) => {
                if let Err(failure) = self.judge_plans(scene, plans, answer.status, arrival) {
                    return failed(failure);
                }
            }
            Said::Request(request) => {
                if let Err(reason) = scene.judge_request(request) {
                    return failed(Failure::new("invalid-request", reason));
                }
                self.note_request(scene, request);
            }
            Said::Invoke(_) | Said::Nothing => {}
        }
        let shown = answer.shown();
        if answer.status == Status::Unsupported && scene.may_be_unknown() {
            self.unknown.push(format!("{}: {shown}", scene.name()));
            return Ok(());
        }
        self.judged += 1;
        if expectation == Expectation::Plan {
            self.count(EXPECTED);
        }
        // The host cancels a call when its time is up.
        let status = match answer.status {
            Status::Cancelled if answer.by_clock => Status::TimedOut,
            status => status,
        };
        match (expectation, status) {
            (Expectation::NoPlan, Status::Solved) => {
                lies("claims `solved`, but there is no plan".into())
            }
            (Expectation::NoPlan, Status::InternalError) => lies(format!("claims {shown}")),
            (Expectation::Plan | Expectation::Perhaps, Status::Infeasible) => {
                lies(format!("claims {shown}, but there is a plan"))
            }
            // Nobody promises that goals can be reached.
            (Expectation::Unknown, Status::InvalidInput) => Ok(()),
            (
                Expectation::Plan | Expectation::Perhaps | Expectation::Unknown,
                Status::Unsupported
                | Status::InvalidInput
                | Status::InternalError
                | Status::Cancelled,
            ) => lies(format!(
                "claims {shown}, but the instance is one that the plugin says it can handle, and \
                 nobody cancelled the call"
            )),
            // What is left by one who may leave collisions was not judged as a plan.
            (Expectation::Plan, Status::GaveUp | Status::TimedOut)
                if answer.plans().is_empty() || self.claims(Capability::CollidingPlans) =>
            {
                let late = match answer.late {
                    Duration::ZERO => String::new(),
                    late => format!(", {:.0} ms after the deadline", milliseconds(late)),
                };
                self.note(format!("{}: no answer: {shown}{late}", scene.name()));
                self.count(GIVEN_UP);
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// Holds figures that a planner reported against its plans, and the lower bound against a cost that
    /// some plan has. What collides, as it may, is no plan.
    pub(crate) fn judge_figures(&self, answer: &Answer, known_cost: Option<u64>) -> Step<()> {
        let wrong = |reason| Err(Stop::failed(Failure::new("wrong-figure", reason)));
        let claimed = |name: &str| answer.figures.get(name).copied();
        let may_collide = self.may_collide(answer.status);
        let plans = answer.plans().iter().filter(|_| !may_collide);
        let cells = || plans.clone().filter_map(Plan::cells);
        let costs = || cells().map(GridPlan::sum_of_costs);
        if let Some(bound) = claimed("lower_bound") {
            if let Some(best) = costs().min().filter(|best| bound > *best as f64) {
                return wrong(format!(
                    "reports a `lower_bound` of {bound}, and its plan costs {best}"
                ));
            }
            if let Some(known) = known_cost.filter(|known| bound > *known as f64) {
                return wrong(format!(
                    "reports a `lower_bound` of {bound}, and there is a plan that costs {known}"
                ));
            }
        }
        if let (Some(cost), Some(last)) = (claimed("claimed_sum_of_costs"), costs().next_back())
            && (cost - last as f64).abs() > 1e-6
        {
            return wrong(format!(
                "reports a `claimed_sum_of_costs` of {cost}, and its plan costs {last}"
            ));
        }
        Ok(())
    }

    fn judge_survival(&mut self, scene: &dyn Question, answer: &Answer) {
        let shown = answer.shown();
        match answer.status {
            Status::Solved if self.kind() == Kind::Planner => self.warn(format!(
                "{}: claims `solved`; better say `invalid-input`",
                scene.name()
            )),
            Status::InternalError => self.warn(format!(
                "{}: claims {shown}; better say `invalid-input`",
                scene.name()
            )),
            _ => {}
        }
    }

    /// True if plans that came with this status need not be valid.
    fn may_collide(&self, status: Status) -> bool {
        status != Status::Solved && self.claims(Capability::CollidingPlans)
    }

    fn judge_plans(
        &mut self,
        scene: &dyn Question,
        plans: &[Plan],
        status: Status,
        arrival: Arrival,
    ) -> Result<(), Failure> {
        let is_policy = self.kind() == Kind::FailPolicy;
        let arrival = if is_policy { Arrival::Free } else { arrival };
        let rules = Rules {
            arrival,
            delay: self.delay,
            may_collide: self.may_collide(status),
        };
        // What a fail policy improves is its own affair, and so is what a planner does in a window,
        // or about an objective that no capability names.
        let asked = scene.instance();
        let whole = asked.window_steps == 0 && asked.window_s == 0.0;
        let comparable = !is_policy && whole && asked.objective == Objective::SumOfCosts;
        let mut before: Option<f64> = None;
        for (plan, number) in plans.iter().zip(1..) {
            let name = match plans.len() {
                1 => "the plan".to_owned(),
                _ => format!("plan {number}"),
            };
            let cost = scene.judge(plan, rules).map_err(|reason| {
                let verdict = if rules.may_collide { "" } else { " is invalid" };
                let rule = broken_rule(&reason).unwrap_or("form");
                let kind = format!("invalid-plan {rule}");
                Failure::new(kind, format!("{name}{verdict}: {reason}"))
            })?;
            if rules.may_collide {
                continue;
            }
            if let Some(before) = before.filter(|_| comparable) {
                if cost > before {
                    let reason = format!(
                        "{name} costs {cost}, the one before it {before}: each has to be better"
                    );
                    return Err(Failure::new("worse-plan", reason));
                }
                if cost.total_cmp(&before).is_eq() {
                    self.warn(format!(
                        "{}: {name} costs as much as the one before it",
                        scene.name()
                    ));
                }
            }
            before = Some(cost);
        }
        if let (Some(cost), Some(best)) = (before, scene.best()) {
            self.figure("cost", cost);
            self.figure("best_cost", best);
        }
        Ok(())
    }

    fn note_request(&mut self, scene: &dyn Question, request: &Request) {
        let mut last: Vec<u32> = request
            .goals
            .iter()
            .filter_map(|goals| goals.last().copied())
            .collect();
        last.sort_unstable();
        if last.windows(2).any(|pair| pair[0] == pair[1])
            && !self.claims(Capability::DuplicateGoals)
        {
            self.warn(
                "agents share goals, which planners need not support; claim `duplicate-goals`",
            );
        }
        let asked = scene.instance().window_steps;
        if request.window_steps != asked {
            self.warn(format!(
                "the request has a window of {} steps, asked was {asked}",
                request.window_steps
            ));
        }
    }

    /// Makes, prepares, asks, judges and ends: what most cases are.
    pub(crate) fn solve(&mut self, scene: &dyn Question) -> Step<Answer> {
        self.solve_expecting(scene, Expectation::Plan, self.wall())
    }

    /// The same of a scene in every representation that the plugin claims.
    pub(crate) fn solve_shown(&mut self, scene: &Scene) -> Step<()> {
        for question in self.shown(scene)? {
            self.solve(&*question)?;
        }
        Ok(())
    }

    pub(crate) fn solve_expecting(
        &mut self,
        scene: &dyn Question,
        expectation: Expectation,
        wall: Duration,
    ) -> Step<Answer> {
        let mut session = self.ready(scene)?;
        let answer = self.ask(&mut session, scene, &Call::of(wall))?;
        self.judge(scene, &answer, expectation)?;
        self.close(session);
        Ok(answer)
    }
}

/// Asks an invocation policy.
pub(crate) fn invoke(session: &mut Session, status: &FleetStatus, wall: Duration) -> Step<Answer> {
    let started = Instant::now();
    let said = session.should_invoke(status, wall).map(Said::Invoke);
    answered_by(said, started.elapsed(), &Call::of(wall))
}

/// True if a call took so long that the clock ended it: a plugin that watches the clock stops a
/// little before the deadline.
fn is_long(taken: Duration, wall: Duration) -> bool {
    taken >= wall.mul_f64(0.8)
}

/// An answer from a call that gives one thing or a reason.
fn answered_by(said: Result<Said, Fault>, wall: Duration, call: &Call<'_>) -> Step<Answer> {
    let (status, message, said) = match said {
        Ok(said) => (Status::Solved, None, said),
        Err(Fault::Reported {
            status, message, ..
        }) => (status, Some(message), Said::Nothing),
        Err(fault) => return Err(fault.into()),
    };
    Ok(Answer {
        status,
        message,
        said,
        figures: BTreeMap::new(),
        kept: None,
        annotations: 0,
        wall,
        late: wall.saturating_sub(call.wall),
        by_clock: is_long(wall, call.wall),
    })
}

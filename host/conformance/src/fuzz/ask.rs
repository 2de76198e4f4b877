//! Probes asked: of a process that lives on, or of a fresh one.

use std::time::{Duration, Instant};

use fleetyard_abi::{Capability, Kind, Plan, Status};
use fleetyard_runtime::{Fault, Session};

use super::probe::{Call, Probe, View};
use crate::representation::Representation;
use crate::rules::Arrival;
use crate::scene::Scene;
use crate::stop::{Failure, Step, Stop};
use crate::trial::{self, Answer, Expectation, Said, Trial, invoke, same};

/// Budget of a call that has the usual one, unless the configuration has less: short, so that many fit.
const USUAL: Duration = Duration::from_millis(500);

/// Asks probes.
pub(crate) struct Asker<'t, 'a> {
    trial: &'t mut Trial<'a>,
    /// Calls that were made.
    pub(crate) calls: usize,
    /// Processes that were started.
    pub(crate) processes: usize,
}

impl<'t, 'a> Asker<'t, 'a> {
    /// For the plugin of a trial. A planner for one agent is found out first; who cannot even be asked that is no
    /// such planner, and fails with an instance.
    pub(crate) fn new(trial: &'t mut Trial<'a>) -> Result<Self, Fault> {
        if trial.kind() == Kind::Planner {
            for representation in trial.any_representation() {
                if let Err(Stop::Host(fault)) = ask_for_two(trial, representation) {
                    return Err(fault);
                }
            }
            trial.forget();
        }
        Ok(Self {
            trial,
            calls: 0,
            processes: 0,
        })
    }

    pub(crate) fn trial(&self) -> &Trial<'a> {
        self.trial
    }

    pub(crate) fn forget(&mut self) -> std::collections::BTreeMap<String, f64> {
        self.trial.forget()
    }

    /// A process in which the plugin was made.
    pub(crate) fn open(&mut self) -> Step<Session> {
        self.processes += 1;
        let mut session = self.trial.open()?;
        self.trial.create(&mut session)?;
        Ok(session)
    }

    pub(crate) fn close(&mut self, session: Session) {
        self.trial.close(session);
    }

    /// Asks probes one after the other in a fresh process; the end is that of the first that does not pass.
    pub(crate) fn fresh(&mut self, probes: &[Probe]) -> Step<()> {
        let mut session = self.open()?;
        for probe in probes {
            self.one(&mut session, &mut probe.clone())?;
        }
        self.close(session);
        Ok(())
    }

    /// True if probes that are asked in a fresh process fail in the way of this kind.
    pub(crate) fn fails_so(&mut self, probes: &[Probe], kind: &str) -> Result<bool, Fault> {
        match self.fresh(probes) {
            Ok(()) | Err(Stop::Skipped(_)) => Ok(false),
            Err(Stop::Failed(failure) | Stop::Crashed(failure)) => Ok(failure.kind == kind),
            Err(Stop::Host(fault)) => Err(fault),
        }
    }

    /// Asks a probe. Of calls that begin where a plan led it says afterwards where that was.
    pub(crate) fn one(&mut self, session: &mut Session, probe: &mut Probe) -> Step<()> {
        self.trial.seed = probe.seed;
        if !probe.twice {
            return self.answers(session, probe).map(drop);
        }
        // Nobody promises that what was asked before has no say.
        let mut answers = Vec::new();
        for _ in 0..2 {
            let mut session = self.open()?;
            answers.push(self.answers(&mut session, probe)?);
            self.close(session);
        }
        for (call, (one, other)) in (1..).zip(answers[0].iter().zip(&answers[1])) {
            same(one, other).map_err(|reason| {
                let reason = format!("fuzz {}: in call {call} {reason}", probe.seed);
                Stop::failed(Failure::new("not-deterministic", reason))
            })?;
        }
        Ok(())
    }

    fn answers(&mut self, session: &mut Session, probe: &mut Probe) -> Step<Vec<Answer>> {
        let mut answers: Vec<Answer> = Vec::new();
        for number in 0..probe.calls.len() {
            let before = answers.last();
            follow(
                probe,
                number,
                before,
                self.trial.claims(Capability::DuplicateGoals),
            );
            let call = &probe.calls[number];
            self.calls += 1;
            let answer = if probe.view == View::Status {
                self.status(session, call)
            } else {
                self.on_map(session, probe, call, number == 0)
            };
            let told = |reason: String| match (probe.calls.len(), call.hurry()) {
                (1, hurry) if hurry.is_empty() => reason,
                (1, hurry) => format!("{hurry}: {reason}"),
                (calls, hurry) if hurry.is_empty() => {
                    format!("call {} of {calls}: {reason}", number + 1)
                }
                (calls, hurry) => format!("call {} of {calls}, {hurry}: {reason}", number + 1),
            };
            answers.push(answer.map_err(|stop| stop.told(told))?);
        }
        Ok(answers)
    }

    fn status(&mut self, session: &mut Session, call: &Call) -> Step<Answer> {
        let answer = invoke(session, &call.status(), self.wall(call))?;
        let answer = self.trial.in_time(answer)?;
        if answer.said == Said::Nothing && !answer.by_clock {
            let reason = format!("answers {}\n{:?}", answer.shown(), call.status());
            return Err(Stop::failed(Failure::new("false-claim status", reason)));
        }
        Ok(answer)
    }

    fn wall(&self, call: &Call) -> Duration {
        let usual = USUAL.min(self.trial.config().budget);
        let takes_all = self.trial.claims(Capability::Anytime);
        let usual = if takes_all { usual / 10 } else { usual };
        call.wall_ns.map_or(usual, Duration::from_nanos)
    }

    fn on_map(
        &mut self,
        session: &mut Session,
        probe: &Probe,
        call: &Call,
        is_first: bool,
    ) -> Step<Answer> {
        let question = probe.question(call)?;
        if let Some(ns) = call.prepare_ns {
            self.hurried_prepare(session, &*question, Duration::from_nanos(ns))?;
        }
        if is_first || call.prepare_ns.is_some() {
            self.trial.prepare(session, &*question)?;
        }
        let failed: Option<Plan> = call.failed().map(Plan::from);
        let asked = trial::Call {
            nodes: call.nodes,
            threads: 1 + call.more_threads,
            failed: failed.as_ref(),
            ..trial::Call::of(self.wall(call))
        };
        let answer = self.trial.ask(session, &*question, &asked)?;
        let kind = self.trial.kind();
        let expectation = probe.expectation(call, kind)?;
        let arrival = if call.shares_goals() {
            Arrival::Visit
        } else {
            Arrival::Stay
        };
        self.trial
            .judge_as(&*question, &answer, expectation, arrival)?;
        let counts_steps = kind == Kind::Planner
            && matches!(probe.view, View::Grid | View::Turning)
            && call.window == 0
            && expectation != Expectation::Survival;
        // Turns cost steps, and who moves diagonally may need fewer.
        if counts_steps {
            let known = if probe.view == View::Grid && !call.shares_goals() {
                probe.known_cost(call)?
            } else {
                None
            };
            self.trial.judge_figures(&answer, known)?;
        }
        Ok(answer)
    }

    /// Tells the plugin a map in next to no time: it may have learned it, or say that it could not.
    fn hurried_prepare(
        &mut self,
        session: &mut Session,
        question: &dyn crate::question::Question,
        wall: Duration,
    ) -> Step<()> {
        let environment = question.environment()?;
        let budget = self.trial.budget(&trial::Call::of(wall));
        let started = Instant::now();
        match session.prepare(&environment, &budget) {
            Ok(_) | Err(Fault::Reported { .. }) => {}
            Err(fault) => return Err(fault.into()),
        }
        let late = started.elapsed().saturating_sub(wall);
        if late <= self.trial.config().grace {
            return Ok(());
        }
        let reason = format!(
            "`prepare` returned {:.0} ms after its deadline",
            late.as_secs_f64() * 1e3
        );
        Err(Stop::failed(Failure::new("late", reason)))
    }
}

/// Asks a planner about two agents.
fn ask_for_two(trial: &mut Trial<'_>, representation: Representation) -> Step<()> {
    let question = representation.of(&Scene::pair()?);
    let mut session = trial.ready(&*question)?;
    trial.ask(&mut session, &*question, &trial::Call::of(trial.wall()))?;
    trial.close(session);
    Ok(())
}

/// Puts the agents of a call where the plan before has led them, each to its goal unless it has arrived there, and
/// says so in the call.
fn follow(probe: &mut Probe, number: usize, before: Option<&Answer>, may_share: bool) {
    let steps = std::mem::take(&mut probe.calls[number].after) as usize;
    let plan = before.filter(|answer| answer.status == Status::Solved);
    let plan = plan.and_then(|answer| answer.plans().last()?.cells());
    let (Some(plan), true) = (plan, steps > 0 && number > 0) else {
        return;
    };
    let (earlier, later) = probe.calls.split_at_mut(number);
    let (Some(earlier), Some(call)) = (earlier.last(), later.first_mut()) else {
        return;
    };
    if plan.agents() != call.agents.len() {
        return;
    }
    for (agent, (member, was)) in call.agents.iter_mut().zip(&earlier.agents).enumerate() {
        member.start = plan.at(agent, steps);
        member.known.clear();
        let on_the_way = (0..=steps).map(|step| plan.at(agent, step));
        let has_arrived = was
            .goals
            .last()
            .is_none_or(|goal| on_the_way.clone().any(|cell| cell == *goal));
        if !has_arrived {
            member.goals.clone_from(&was.goals);
        }
    }
    // A new goal that somebody else is still on the way to.
    while call.shares_goals() && !may_share {
        let last: Vec<Option<u32>> = call
            .agents
            .iter()
            .map(|member| member.goals.last().copied())
            .collect();
        let shared = (0..last.len())
            .find(|agent| last[*agent].is_some() && last[..*agent].contains(&last[*agent]));
        let cells = (0..probe.map.iter().map(String::len).sum::<usize>() as u32).rev();
        let free = cells.into_iter().find(|cell| {
            let (row, col) = (
                cell / probe.map[0].len() as u32,
                cell % probe.map[0].len() as u32,
            );
            probe.map[row as usize].as_bytes()[col as usize] == b'.' && !last.contains(&Some(*cell))
        });
        let (Some(agent), Some(free)) = (shared, free) else {
            return;
        };
        call.agents[agent].goals = vec![free];
    }
}

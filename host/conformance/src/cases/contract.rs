//! Cases of what the contract says about inputs of every representation.

use std::time::Instant;

use fleetyard_abi::{
    Capability, Environment, GoalTasks, Guidance, Kept, Kind, Motion, Part, RestOfPlan,
    SharedEnvironment, Snapshot, Status, Traffic, View, c,
};
use fleetyard_runtime::{Fault, Session};
use serde_json::json;

use super::answers::{CROSSING, ONE_CELL, draw, easy};
use crate::question::Question;
use crate::representation::Representation;
use crate::stop::{Step, Stop};
use crate::trial::{Answer, Call, Expectation, Trial, same};

/// A part that no plugin knows.
fn part(critical: bool) -> Part {
    Part {
        id: "org.example.conformance/1".into(),
        critical,
        data: json!({ "level": [0.5, 1.0] }).into(),
    }
}

/// The map of a question with that part.
fn with(part: &Part, question: &dyn Question) -> Step<SharedEnvironment> {
    let mut environment = Environment::clone(&*question.environment()?);
    environment.parts.push(part.clone());
    Ok(SharedEnvironment::new(environment))
}

pub(crate) fn unknown_part(trial: &mut Trial<'_>) -> Step<()> {
    let (scene, part) = (easy(trial)?, part(false));
    for representation in trial.any_representation() {
        let question = representation.of(&scene);
        let mut answers = Vec::new();
        for part in [None, Some(&part)] {
            let mut session = trial.open()?;
            trial.create(&mut session)?;
            trial.prepare(&mut session, &*question)?;
            let call = Call {
                part,
                ..Call::of(trial.wall())
            };
            if let Some(part) = part {
                trial.learn(&mut session, &with(part, &*question)?)?;
            }
            let answer = trial.ask(&mut session, &*question, &call)?;
            trial.judge(&*question, &answer, Expectation::Plan)?;
            trial.close(session);
            answers.push(answer);
        }
        if trial.claims(Capability::Deterministic) {
            same(&answers[0], &answers[1]).map_err(|reason| {
                let name = question.name();
                Stop::failed(format!(
                    "{name}: with a part that it need not know, {reason}"
                ))
            })?;
        }
    }
    Ok(())
}

pub(crate) fn annotations_off(trial: &mut Trial<'_>) -> Step<()> {
    let scene = draw(CROSSING)?;
    for representation in trial.any_representation() {
        let question = representation.of(&scene);
        let mut answers = Vec::new();
        for wanted in [false, true] {
            let mut session = trial.ready(&*question)?;
            session.want_annotations(wanted);
            let answer = trial.ask(&mut session, &*question, &Call::of(trial.wall()))?;
            trial.judge(&*question, &answer, Expectation::Plan)?;
            // In the host's process the session is used again.
            session.want_annotations(false);
            trial.close(session);
            answers.push(answer);
        }
        trial.figure("annotations", answers[1].annotations as f64);
        if trial.claims(Capability::Deterministic) {
            same(&answers[0], &answers[1]).map_err(|reason| {
                let name = question.name();
                Stop::failed(format!("{name}: asked for annotations, {reason}"))
            })?;
        }
    }
    Ok(())
}

pub(crate) fn critical_part(trial: &mut Trial<'_>) -> Step<()> {
    let (scene, part) = (easy(trial)?, part(true));
    for representation in trial.any_representation() {
        let question = representation.of(&scene);
        let mut session = trial.open()?;
        trial.create(&mut session)?;
        let learnt = trial.learn(&mut session, &with(&part, &*question)?);
        unsupported(trial, "a map with a critical part", &part.id, learnt)?;
        trial.prepare(&mut session, &*question)?;
        let call = Call {
            part: Some(&part),
            ..Call::of(trial.wall())
        };
        let Answer {
            status, message, ..
        } = trial.ask(&mut session, &*question, &call)?;
        let message = message.unwrap_or_default();
        refused(trial, "a critical part", &part.id, status, &message)?;
        let answer = trial.ask(&mut session, &*question, &Call::of(trial.wall()))?;
        trial.judge(&*question, &answer, Expectation::Plan)?;
        trial.close(session);
    }
    Ok(())
}

/// Checks that a map was refused as one that the plugin does not support.
fn unsupported(
    trial: &mut Trial<'_>,
    what: &str,
    name: &str,
    learnt: Result<(), Fault>,
) -> Step<()> {
    match learnt {
        Ok(()) => refused(trial, what, name, Status::Solved, ""),
        Err(Fault::Reported {
            status, message, ..
        }) => refused(trial, what, name, status, &message),
        Err(fault) => Err(fault.into()),
    }
}

/// Checks the answer to what the plugin does not support, in whose message there should be a name.
fn refused(
    trial: &mut Trial<'_>,
    what: &str,
    name: &str,
    status: Status,
    message: &str,
) -> Step<()> {
    if status != Status::Unsupported {
        return Err(Stop::failed(format!(
            "answers `{status}` to {what}, `{name}`, which it does not know: the answer is \
             `unsupported`"
        )));
    }
    if !message.contains(name) {
        trial.warn(format!("refuses {what} without its name, `{name}`"));
    }
    Ok(())
}

/// Other calls before a question is asked again.
const OTHERS: u32 = 100;

/// Memory of a fleet that has been on its way for a while, for a question with places, as far as
/// the plugin reads it.
fn memory(trial: &Trial<'_>, question: &dyn Question, kept: &[u8]) -> Step<Vec<Part>> {
    let environment = question.environment()?;
    let instance = match trial.kind() {
        Kind::InstanceGenerator => question.state().next,
        _ => question.instance(),
    };
    let moves = match &environment.view {
        View::Grid(grid) => grid.passable.len() * grid.connectivity as usize,
        View::Roadmap(roadmap) => roadmap.edges.items().len(),
        View::Workspace(_) => 0,
    };
    let averages = |len: usize, every: usize| -> Vec<u8> {
        let average = |at: usize| {
            if at.is_multiple_of(every) {
                (at % 256) as u8
            } else {
                0
            }
        };
        (0..len).map(average).collect()
    };
    let snapshot = |number: u64, every: usize| Snapshot {
        number,
        waiting: averages(environment.places().unwrap_or(0), every),
        flow: averages(moves, every),
    };
    let mut goal_tasks = GoalTasks {
        time_s: 105.5,
        ..GoalTasks::default()
    };
    for (agent, goals) in instance.goals.iter().enumerate() {
        for at in 0..goals.len() as u32 {
            let task = (agent % 2 == 0).then_some((agent as u64, at));
            // The last agents have had their goals for longest.
            let given_s = 100.0 - agent as f64;
            goal_tasks.push(task, given_s / 2.0, given_s);
        }
    }
    let all = [
        Part::from(Traffic {
            period_s: 20.0,
            time_constant_s: 50.0,
            since_s: 5.5,
            flow_unit_per_s: 0.5 / 255.0,
            last: snapshot(5, 3),
            before: snapshot(4, 5),
        }),
        Part::from(RestOfPlan {
            paths: vec!["..".into(); instance.agents()],
        }),
        Part::from(goal_tasks),
        Part::from(Guidance {
            moves: (0..moves).map(|at| 100 + (at % 7) as u16).collect(),
            ..Guidance::neutral(0, environment.places().unwrap_or(0))
        }),
        Part::from(Kept {
            bytes: kept.to_vec(),
        }),
    ];
    Ok(all
        .into_iter()
        .filter(|part| reads(trial, &part.id))
        .collect())
}

/// True if the plugin reads a part.
fn reads(trial: &Trial<'_>, part: &str) -> bool {
    let mut features = trial.descriptor().features.iter();
    features.any(|feature| feature.strip_prefix("part:") == Some(part))
}

/// An answer to a question with memory.
fn with_memory(
    trial: &mut Trial<'_>,
    session: &mut Session,
    question: &dyn Question,
    memory: &[Part],
) -> Step<Answer> {
    let call = Call {
        memory,
        ..Call::of(trial.wall())
    };
    let answer = trial.ask(session, question, &call)?;
    trial.judge(question, &answer, Expectation::Plan)?;
    Ok(answer)
}

pub(crate) fn memory_replayed(trial: &mut Trial<'_>) -> Step<()> {
    let scene = easy(trial)?;
    let parts = [
        c::TRAFFIC_ID,
        c::REST_OF_PLAN_ID,
        c::GOAL_TASKS_ID,
        c::GUIDANCE_ID,
        c::KEPT_ID,
    ];
    if !parts.iter().any(|part| reads(trial, part)) {
        return Err(Stop::Skipped("it reads no memory".into()));
    }
    for representation in trial.any_representation() {
        let question = representation.of(&scene);
        let parts = memory(trial, &*question, &[])?;
        let mut session = trial.ready(&*question)?;
        let first = with_memory(trial, &mut session, &*question, &parts)?;
        trial.close(session);
        let kept = first.kept.clone().unwrap_or_default();
        let others = [Vec::new(), memory(trial, &*question, &kept)?];
        let mut session = trial.ready(&*question)?;
        let started = Instant::now();
        for (_, other) in (0..OTHERS).zip(others.iter().cycle()) {
            with_memory(trial, &mut session, &*question, other)?;
            // Those who take all of their time are asked less often.
            if started.elapsed() > 4 * trial.wall() {
                break;
            }
        }
        let again = with_memory(trial, &mut session, &*question, &parts)?;
        trial.close(session);
        if trial.claims(Capability::Deterministic) {
            let mut found = same(&first, &again);
            if found.is_ok() && first.kept != again.kept && !first.by_clock {
                found = Err("what it keeps differs from one time to the next".into());
            }
            found.map_err(|reason| {
                let name = question.name();
                Stop::failed(format!("{name}: with the same memory, {reason}"))
            })?;
        }
    }
    Ok(())
}

pub(crate) fn kept_bytes(trial: &mut Trial<'_>) -> Step<()> {
    let scene = easy(trial)?;
    if !reads(trial, c::KEPT_ID) {
        return Err(Stop::Skipped("it keeps no bytes".into()));
    }
    for representation in trial.any_representation() {
        let question = representation.of(&scene);
        let mut session = trial.ready(&*question)?;
        let answer = with_memory(trial, &mut session, &*question, &[])?;
        match &answer.kept {
            Some(kept) => {
                let parts = memory(trial, &*question, kept)?;
                with_memory(trial, &mut session, &*question, &parts)?;
            }
            None => trial.warn(format!("{}: it kept nothing", question.name())),
        }
        let mut random = trial.random();
        let mut garbage = vec![0_u8; c::KEPT_LIMIT as usize];
        for byte in &mut garbage {
            *byte = random.below(256) as u8;
        }
        for bytes in [&garbage[..1], &garbage[..7], &garbage] {
            let parts = memory(trial, &*question, bytes)?;
            with_memory(trial, &mut session, &*question, &parts)?;
        }
        trial.close(session);
    }
    Ok(())
}

pub(crate) fn other_representation(trial: &mut Trial<'_>) -> Step<()> {
    const ALL: [Representation; 3] = [
        Representation::Grid,
        Representation::Roadmap(Motion::StopGo),
        Representation::Plane,
    ];
    let scene = draw(ONE_CELL)?;
    let mut session = trial.open()?;
    trial.create(&mut session)?;
    for representation in ALL {
        let claim = representation.capability();
        if trial.claims(claim) {
            continue;
        }
        let environment = representation.of(&scene).environment()?;
        let learnt = trial.learn(&mut session, &environment);
        unsupported(trial, "a map of a representation", claim.as_str(), learnt)?;
    }
    trial.close(session);
    Ok(())
}

pub(crate) fn seed_53(trial: &mut Trial<'_>) -> Step<()> {
    trial.seed = (1 << 53) - 1;
    let scene = easy(trial)?;
    for representation in trial.any_representation() {
        trial.solve(&*representation.of(&scene))?;
    }
    Ok(())
}

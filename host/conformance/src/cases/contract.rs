//! Cases of what the contract says about inputs of every representation.

use fleetyard_abi::{Capability, Environment, Motion, Part, SharedEnvironment, Status};
use fleetyard_runtime::Fault;
use serde_json::json;

use super::answers::{ONE_CELL, draw, easy};
use crate::question::{Question, Representation};
use crate::trial::{Answer, Call, Expectation, Step, Stop, Trial, same};

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
                Stop::Failed(format!(
                    "{name}: with a part that it need not know, {reason}"
                ))
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
        return Err(Stop::Failed(format!(
            "answers `{status}` to {what}, `{name}`, which it does not know: the answer is \
             `unsupported`"
        )));
    }
    if !message.contains(name) {
        trial.warn(format!("refuses {what} without its name, `{name}`"));
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

//! The cases of starting, describing, making and ending a plugin.

use std::time::{Duration, Instant};

use fleetyard_abi::{Capability, Descriptor, Kind};
use fleetyard_runtime::{Fault, check_options};
use serde_json::{Map, Value, json};

use super::answers;
use crate::report::milliseconds;
use crate::stop::{Step, Stop};
use crate::trial::{Call, Trial};

pub(crate) fn handshake(trial: &mut Trial<'_>) -> Step<()> {
    let session = trial.open()?;
    let Descriptor { kind, id, .. } = trial.descriptor();
    let offered = session
        .descriptors()
        .iter()
        .any(|offered| offered.kind == *kind && offered.id == *id);
    trial.close(session);
    if !offered {
        return Err(Stop::failed(format!(
            "it offered a {kind} `{id}` before, and does not now"
        )));
    }
    Ok(())
}

pub(crate) fn scan_time(trial: &mut Trial<'_>) -> Step<()> {
    // A scan that takes longer than plugins may take to start ends by force.
    const SLOW: Duration = Duration::from_secs(2);
    let started = Instant::now();
    let session = trial.open()?;
    let taken = started.elapsed();
    trial.close(session);
    trial.figure("scan_ms", milliseconds(taken));
    if taken > SLOW {
        trial.warn(format!(
            "took {:.1} s to describe itself: every listing waits for it",
            taken.as_secs_f64()
        ));
    }
    Ok(())
}

pub(crate) fn descriptor(trial: &mut Trial<'_>) -> Step<()> {
    let session = trial.open()?;
    let first = session.descriptors().to_vec();
    trial.close(session);
    let session = trial.open()?;
    let second = session.descriptors().to_vec();
    trial.close(session);
    let about = trial.descriptor();
    let (kind, id) = (about.kind, &about.id);
    let own = |all: &[Descriptor]| -> Vec<Descriptor> {
        let own = all.iter().filter(|one| one.kind == kind && one.id == *id);
        own.cloned().collect()
    };
    let names = |all: &[Descriptor]| -> Vec<(Kind, String)> {
        all.iter().map(|one| (one.kind, one.id.clone())).collect()
    };
    if own(&first) != own(&second) || names(&first) != names(&second) {
        return Err(Stop::failed(
            "it describes itself differently from one start to the next",
        ));
    }
    let namesakes = own(&first).len();
    if namesakes > 1 {
        return Err(Stop::failed(format!(
            "it has {namesakes} of kind {kind} named `{id}`"
        )));
    }
    for (what, text) in [
        ("version", &about.version),
        ("name", &about.name),
        ("description", &about.description),
    ] {
        if text.trim().is_empty() {
            trial.warn(format!("has no {what}"));
        }
    }
    claims_fit(trial)?;
    let mut defaults = defaults(about);
    defaults.extend(trial.subject.options.clone());
    check_options(&defaults, &about.options_schema).map_err(|error| {
        Stop::failed(format!(
            "its defaults do not satisfy its own schema: {error}"
        ))
    })?;
    check_options(&trial.subject.options, &about.options_schema).map_err(|error| {
        Stop::failed(format!(
            "it cannot be made without further options: {error}; leave them out of `required` \
             or give them with --option"
        ))
    })
}

/// Checks that the claimed capabilities belong together.
fn claims_fit(trial: &mut Trial<'_>) -> Step<()> {
    use Capability as C;
    let claims = |capability: C| trial.claims(capability);
    let needs_one = [
        (C::EightConnected, &[C::Grid][..]),
        (C::Grid, &[C::Pebble, C::Rotation, C::AnyAngle]),
        (C::Roadmap, &[C::StopGo, C::Slower]),
        (C::Continuous, &[C::Dynamics]),
    ];
    let pairs = needs_one
        .into_iter()
        .find(|(claim, one_of)| claims(*claim) && !one_of.iter().any(|one| claims(*one)));
    if let Some((claim, one_of)) = pairs {
        let names: Vec<&str> = one_of.iter().map(|one| one.as_str()).collect();
        return Err(Stop::failed(format!(
            "claims `{}` without {}",
            claim.as_str(),
            names.join(" or ")
        )));
    }
    let about = trial.descriptor();
    let somewhere = [C::Grid, C::Roadmap, C::Continuous];
    if trial.kind() == Kind::Planner && !somewhere.iter().any(|claim| claims(*claim)) {
        return Err(Stop::failed(
            "claims no representation (grid, roadmap, continuous): it can be asked nothing",
        ));
    }
    if claims(C::KRobust) && about.options_schema.pointer("/properties/k").is_none() {
        return Err(Stop::failed(
            "claims `k-robust`, but its schema has no option `k`",
        ));
    }
    if trial.kind() == Kind::InvocationPolicy {
        let idle: Vec<&str> = about
            .capabilities
            .iter()
            .filter(|claim| *claim != C::Deterministic)
            .map(C::as_str)
            .collect();
        if !idle.is_empty() {
            trial.warn(format!(
                "claims that mean nothing here: {}",
                idle.join(", ")
            ));
        }
    }
    Ok(())
}

/// The defaults of the schema, by name.
fn defaults(about: &Descriptor) -> Map<String, Value> {
    properties(about)
        .filter_map(|(name, property)| Some((name.clone(), property.get("default")?.clone())))
        .collect()
}

fn properties(about: &Descriptor) -> impl Iterator<Item = (&String, &Value)> {
    let properties = about.options_schema.get("properties");
    properties.and_then(Value::as_object).into_iter().flatten()
}

pub(crate) fn default_options(trial: &mut Trial<'_>) -> Step<()> {
    let mut defaults = defaults(trial.descriptor());
    // What the user wants otherwise stays as it is.
    defaults.retain(|name, _| !trial.subject.options.contains_key(name));
    let mut session = trial.open()?;
    trial.create(&mut session)?;
    let one = |(name, value): (&String, &Value)| Map::from_iter([(name.clone(), value.clone())]);
    let together = std::iter::once(defaults.clone());
    for options in defaults.iter().map(one).chain(together) {
        trial
            .create_with(&mut session, &options)
            .map_err(|fault| with_options(fault, &options))?;
    }
    trial.close(session);
    Ok(())
}

fn with_options(fault: Fault, options: &Map<String, Value>) -> Stop {
    let options = Value::Object(options.clone());
    Stop::from(fault).told(|reason| format!("with {options} it {reason}"))
}

pub(crate) fn unknown_option(trial: &mut Trial<'_>) -> Step<()> {
    const NAME: &str = "an-option-of-no-plugin";
    let mut session = trial.open()?;
    let options = Map::from_iter([(NAME.to_owned(), json!(1))]);
    match trial.create_with(&mut session, &options) {
        Ok(()) => trial.note("accepts an option that it does not have: the host refuses it first"),
        Err(Fault::Reported { .. }) => {}
        Err(fault) => return Err(with_options(fault, &options)),
    }
    trial.create(&mut session)?;
    trial.close(session);
    Ok(())
}

pub(crate) fn invalid_options(trial: &mut Trial<'_>) -> Step<()> {
    const EACH: usize = 3;
    let about = trial.descriptor();
    let candidates = [
        json!(-1),
        json!("no such value"),
        json!(1e300),
        json!(u64::MAX),
        json!([]),
        json!({}),
        json!(true),
        Value::Null,
    ];
    let mut session = trial.open()?;
    let mut accepted = Vec::new();
    for (name, _) in properties(about) {
        let given = |value: &Value| Map::from_iter([(name.clone(), value.clone())]);
        let forbidden = candidates
            .iter()
            .map(given)
            .filter(|options| check_options(options, &about.options_schema).is_err());
        for options in forbidden.take(EACH) {
            match trial.create_with(&mut session, &options) {
                Ok(()) => accepted.push(Value::Object(options).to_string()),
                Err(Fault::Reported { .. }) => {}
                Err(fault) => return Err(with_options(fault, &options)),
            }
        }
    }
    if let Some(first) = accepted.first() {
        let more = match accepted.len() - 1 {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        trial.note(format!(
            "accepts what its schema forbids: {first}{more}; the host refuses it first"
        ));
    }
    trial.create(&mut session)?;
    trial.close(session);
    Ok(())
}

pub(crate) fn output(trial: &mut Trial<'_>) -> Step<()> {
    const LOG_LINES: usize = 1000;
    const LOG_BYTES: usize = 1 << 20;
    let closing = answers::work(trial)?;
    if closing.stray_lines > 0 {
        trial.warn(format!(
            "wrote {} lines to standard output that are no messages",
            closing.stray_lines
        ));
    }
    if closing.stderr_dropped > 0 {
        trial.warn(format!(
            "wrote {} bytes to standard error",
            closing.stderr.len() as u64 + closing.stderr_dropped
        ));
    }
    let (lines, bytes) = closing.log.iter().fold((0, 0), |(lines, bytes), line| {
        (lines + 1, bytes + line.text.len())
    });
    if lines > LOG_LINES || bytes > LOG_BYTES {
        trial.warn(format!("logged {lines} lines, {bytes} bytes, in one call"));
    }
    Ok(())
}

pub(crate) fn ending(trial: &mut Trial<'_>) -> Step<()> {
    let scene = answers::small(trial)?;
    let mut session = trial.ready(&*scene)?;
    trial.ask(&mut session, &*scene, &Call::of(trial.wall()))?;
    let started = Instant::now();
    let closing = trial.close(session);
    let taken = started.elapsed();
    trial.figure("ending_ms", milliseconds(taken));
    if let Some(fault) = closing.fault {
        let stop = Stop::from(fault);
        return Err(stop.told(|reason| format!("after its last answer it {reason}")));
    }
    if taken >= trial.config().ending() {
        return Err(Stop::failed(format!(
            "it did not end within {:?} after it was told to, and was killed",
            trial.config().ending()
        )));
    }
    Ok(())
}

pub(crate) fn host_process(trial: &mut Trial<'_>) -> Step<()> {
    if !trial.is_in_process() {
        return Err(Stop::Skipped(
            "a plugin in a process of its own leaves nothing to the host; `--attach in-process` \
             asks a library"
                .into(),
        ));
    }
    let broken = answers::work(trial)?.broken_promises;
    if broken.is_empty() {
        return Ok(());
    }
    let broken: Vec<String> = broken.iter().map(ToString::to_string).collect();
    Err(Stop::failed(broken.join("; ")))
}

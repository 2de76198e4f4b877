//! Many calls, wrong calls, and calls that take too long or too much.

use std::time::{Duration, Instant};

use fleetyard_abi::{Capability, Kind};
use fleetyard_runtime::{Fault, PluginFile, Session, Usage};

use super::answers::{at_least, easy, small};
use crate::question::Question;
use crate::report::milliseconds;
use crate::representation::Representation;
use crate::scene::Scene;
use crate::stop::{Step, Stop};
use crate::trial::{Call, Expectation, Trial, same};

pub(crate) fn repeated_calls(trial: &mut Trial<'_>) -> Step<()> {
    let scene = easy(trial)?;
    let mut other = scene.clone();
    other.name = "the way back".into();
    for (start, goals) in other.starts.iter_mut().zip(&mut other.goals) {
        if let Some(goal) = goals.last_mut() {
            std::mem::swap(start, goal);
        }
    }
    for representation in trial.any_representation() {
        let (there, back) = (representation.of(&scene), representation.of(&other));
        let mut session = trial.ready(&*there)?;
        let mut answers = Vec::new();
        for asked in [&there, &back, &there] {
            let answer = trial.ask(&mut session, &**asked, &Call::of(trial.wall()))?;
            trial.judge(&**asked, &answer, Expectation::Plan)?;
            answers.push(answer);
        }
        trial.close(session);
        // A generator may remember what it gave out, and a policy what it was told.
        let plans = !answers[0].plans().is_empty();
        if plans && trial.claims(Capability::Deterministic) {
            same(&answers[0], &answers[2]).map_err(|reason| {
                let name = there.name();
                Stop::failed(format!("{name}: asked the same in one session, {reason}"))
            })?;
        }
    }
    Ok(())
}

pub(crate) fn other_map(trial: &mut Trial<'_>) -> Step<()> {
    let mut random = trial.random();
    let first = Scene::open("first map", 8, 6, &mut random)?;
    let smaller = Scene::open("smaller map", 4, 3, &mut random)?;
    let larger = Scene::open("larger map", 15, 20, &mut random)?;
    let representations = trial.representations()?;
    let mut session = trial.open()?;
    trial.create(&mut session)?;
    for scene in [&first, &smaller, &larger, &first] {
        // From one representation to the other as well.
        for representation in &representations {
            let question = representation.of(scene);
            trial.prepare(&mut session, &*question)?;
            let answer = trial.ask(&mut session, &*question, &Call::of(trial.wall()))?;
            trial.judge(&*question, &answer, Expectation::Plan)?;
        }
    }
    trial.close(session);
    Ok(())
}

pub(crate) fn made_again(trial: &mut Trial<'_>) -> Step<()> {
    let scene = small(trial)?;
    let mut session = trial.open()?;
    for _ in 0..3 {
        trial.create(&mut session)?;
        trial.prepare(&mut session, &*scene)?;
        let answer = trial.ask(&mut session, &*scene, &Call::of(trial.wall()))?;
        trial.judge(&*scene, &answer, Expectation::Plan)?;
    }
    trial.close(session);
    Ok(())
}

pub(crate) fn bad_input(trial: &mut Trial<'_>) -> Step<()> {
    const OBSTACLE: u32 = 3;
    let good = Scene::drawn("good", &["a..@", "...b"], &["..a@", "b..."])?;
    let spoiled = |name: &str, spoil: &dyn Fn(&mut Scene)| {
        let mut scene = good.clone();
        scene.name = name.into();
        spoil(&mut scene);
        scene
    };
    let bad = [
        spoiled("start on an obstacle", &|scene| scene.starts[0] = OBSTACLE),
        spoiled("goal on an obstacle", &|scene| {
            scene.goals[0] = vec![OBSTACLE];
        }),
        spoiled("two agents in one cell", &|scene| {
            scene.starts[1] = scene.starts[0];
        }),
    ];
    for representation in trial.representations()? {
        let good = representation.of(&good);
        let mut session = trial.ready(&*good)?;
        for scene in &bad {
            let bad = representation.of(scene);
            let answer = trial.ask(&mut session, &*bad, &Call::of(trial.config().slice()))?;
            trial.judge(&*bad, &answer, Expectation::Survival)?;
            let answer = trial.ask(&mut session, &*good, &Call::of(trial.wall()))?;
            trial.judge(&*good, &answer, Expectation::Plan)?;
        }
        trial.close(session);
    }
    Ok(())
}

pub(crate) fn deadline(trial: &mut Trial<'_>) -> Step<()> {
    let wall = at_least(trial.config().slice(), 100);
    // What came in time has to be right all the same.
    let expectation = if trial.kind() == Kind::Planner {
        Expectation::NoPlan
    } else {
        Expectation::Perhaps
    };
    for jam in trial.shown(&Scene::jam(&mut trial.random())?)? {
        let mut session = trial.ready(&*jam)?;
        let answer = trial.ask(&mut session, &*jam, &Call::of(wall))?;
        trial.figure("budget_ms", milliseconds(wall));
        trial.figure("returned_ms", milliseconds(answer.wall));
        note_lateness(trial, answer.late);
        if trial.kind() != Kind::InstanceGenerator {
            trial.judge(&*jam, &answer, expectation)?;
        }
        trial.close(session);
    }
    Ok(())
}

fn note_lateness(trial: &mut Trial<'_>, late: Duration) {
    trial.figure("late_ms", milliseconds(late));
    if late > trial.config().grace / 4 {
        trial.warn(format!(
            "returned {:.0} ms after the deadline: without a grace it would have been killed",
            milliseconds(late)
        ));
    }
}

pub(crate) fn cancelled(trial: &mut Trial<'_>) -> Step<()> {
    let (jam, scene) = (Scene::jam(&mut trial.random())?, easy(trial)?);
    for representation in trial.representations()? {
        let jam = representation.of(&jam);
        let mut session = trial.ready(&*jam)?;
        // Over before it has begun: the plugin is cancelled while it reads the request.
        let answer = trial.ask(&mut session, &*jam, &Call::of(Duration::from_nanos(1)))?;
        note_lateness(trial, answer.late);
        solve_next(trial, &mut session, &*representation.of(&scene))?;
        trial.close(session);
    }
    Ok(())
}

/// Asks in a session that has been used.
fn solve_next(trial: &mut Trial<'_>, session: &mut Session, question: &dyn Question) -> Step<()> {
    trial.prepare(session, question)?;
    let answer = trial.ask(session, question, &Call::of(trial.wall()))?;
    trial.judge(question, &answer, Expectation::Plan)
}

pub(crate) fn prepare_deadline(trial: &mut Trial<'_>) -> Step<()> {
    let (large, scene) = (Scene::large(&mut trial.random())?, easy(trial)?);
    for representation in trial.representations()? {
        let environment = representation.of(&large).environment()?;
        let mut session = trial.open()?;
        trial.create(&mut session)?;
        let wall = Duration::from_millis(1);
        let started = Instant::now();
        let prepared = session.prepare(&environment, &trial.budget(&Call::of(wall)));
        let late = started.elapsed().saturating_sub(wall);
        match prepared {
            // It may have learned the map, or say that it could not.
            Ok(_) | Err(Fault::Reported { .. }) => {}
            Err(fault) => return Err(fault.into()),
        }
        if late > trial.config().grace {
            return Err(Stop::failed(format!(
                "`prepare` returned {:.0} ms after its deadline",
                milliseconds(late)
            )));
        }
        note_lateness(trial, late);
        solve_next(trial, &mut session, &*representation.of(&scene))?;
        trial.close(session);
    }
    Ok(())
}

fn not_measured() -> Stop {
    Stop::Skipped("what a plugin uses in the host's own process is not measured".into())
}

/// Resources that a session used.
struct Used {
    cpu: Duration,
    memory_kb: u64,
    /// The last call.
    wall: Duration,
}

/// Makes some calls in a session of their own.
fn used(trial: &mut Trial<'_>, scene: &dyn Question, call: &Call<'_>, calls: usize) -> Step<Used> {
    let mut session = trial.ready(scene)?;
    let mut wall = Duration::ZERO;
    for _ in 0..calls {
        wall = trial.ask(&mut session, scene, call)?.wall;
    }
    let usage = trial.close(session).usage;
    let used = usage.and_then(|usage: Usage| {
        let cpu_us = usage.user_us? + usage.system_us?;
        Some(Used {
            cpu: Duration::from_micros(cpu_us),
            memory_kb: usage.max_rss_kb?,
            wall,
        })
    });
    used.ok_or_else(not_measured)
}

pub(crate) fn memory_growth(trial: &mut Trial<'_>) -> Step<()> {
    /// Time for all calls together, about.
    const WHOLE: Duration = Duration::from_secs(1);
    const MIB: u64 = 1 << 10;
    if trial.is_in_process() {
        return Err(not_measured());
    }
    let scene = small(trial)?;
    let call = if trial.claims(Capability::Anytime) {
        Call::of(at_least(trial.config().slice() / 5, 10))
    } else {
        Call::of(trial.wall())
    };
    let started = Instant::now();
    let mut session = trial.ready(&*scene)?;
    let ready = started.elapsed();
    trial.ask(&mut session, &*scene, &call)?;
    let one = started.elapsed().saturating_sub(ready);
    trial.close(session);
    let fitting = WHOLE.as_secs_f64() / (5.0 * one.as_secs_f64().max(1e-6));
    let calls = fitting.clamp(3.0, 20.0) as usize;
    let few = used(trial, &*scene, &call, calls)?.memory_kb;
    let many = used(trial, &*scene, &call, 4 * calls)?.memory_kb;
    trial.figure("calls", calls as f64);
    trial.figure("memory_mib", few as f64 / MIB as f64);
    trial.figure("memory_of_four_times_mib", many as f64 / MIB as f64);
    if many > few + few / 2 + 32 * MIB {
        return Err(Stop::failed(format!(
            "{calls} calls need {} MiB, {} calls {} MiB",
            few / MIB,
            4 * calls,
            many / MIB
        )));
    }
    Ok(())
}

/// Memory and time follow what agents touch. Of a planner that others made it is a warning where memory
/// does not, and a note where it has no time for so large a map: those that kept the contract before there
/// was this case keep it.
pub(crate) fn large_case(trial: &mut Trial<'_>) -> Step<()> {
    /// Largest memory of the plugin's processes, in MB.
    const MOST_MB: f64 = 300.0;
    if trial.is_in_process() {
        return Err(not_measured());
    }
    let strict = trial.subject.file == PluginFile::BuiltIn;
    let vast = Scene::vast()?;
    let representation = if trial.claims(Capability::Pebble) {
        Representation::Grid
    } else {
        trial.any_representation()[0]
    };
    let mb = match cross(trial, &*representation.of(&vast), strict) {
        Err(Stop::Failed(failure) | Stop::Crashed(failure)) if !strict => {
            trial.note(failure.reason);
            return Ok(());
        }
        ended => ended?,
    };
    if mb <= MOST_MB {
        return Ok(());
    }
    let reason = format!(
        "two agents on 1000 × 1000 cells need {mb:.0} MB of memory, more than {MOST_MB:.0} MB: memory has to \
         follow what agents touch, not the cells of the map by their steps"
    );
    if strict {
        return Err(Stop::failed(reason));
    }
    trial.warn(reason);
    Ok(())
}

/// Asks about a large map, and gives the largest memory of the plugin's processes in MB.
fn cross(trial: &mut Trial<'_>, vast: &dyn Question, strict: bool) -> Step<f64> {
    let wall = if strict {
        at_least(trial.wall(), 2000)
    } else {
        trial.wall().min(Duration::from_secs(1))
    };
    let call = Call::of(wall);
    let mut session = trial.open()?;
    trial.create(&mut session)?;
    let started = Instant::now();
    // Reading the map is work, too.
    let budget = trial.budget(&Call::of(at_least(wall, 5000)));
    session.prepare(&vast.environment()?, &budget)?;
    trial.figure("prepare_ms", milliseconds(started.elapsed()));
    let answer = trial.ask(&mut session, vast, &call)?;
    trial.figure("plan_ms", milliseconds(answer.wall));
    trial.judge(vast, &answer, Expectation::Plan)?;
    let usage = trial.close(session).usage;
    let kb = usage
        .and_then(|usage: Usage| usage.max_rss_kb)
        .ok_or_else(not_measured)?;
    let mb = kb as f64 * 1024.0 / 1e6;
    trial.figure("memory_mb", mb);
    Ok(mb)
}

pub(crate) fn thread_limit(trial: &mut Trial<'_>) -> Step<()> {
    if trial.is_in_process() {
        return Err(not_measured());
    }
    let jam = Scene::jam(&mut trial.random())?;
    let shown = trial.shown(&jam).unwrap_or_default().into_iter().next();
    let scene = match shown {
        Some(jam) => jam,
        None => small(trial)?,
    };
    let call = Call::of(at_least(trial.config().slice() * 2, 500));
    let mut measure = || -> Step<(Duration, Duration)> {
        // Starting, and learning the map, are no matter of this budget.
        let idle = used(trial, &*scene, &call, 0)?;
        let Used { cpu, wall, .. } = used(trial, &*scene, &call, 1)?;
        Ok((cpu.saturating_sub(idle.cpu), wall))
    };
    let is_more =
        |(cpu, wall): (Duration, Duration)| cpu > wall.mul_f64(1.25) + Duration::from_millis(50);
    let mut spent = measure()?;
    if is_more(spent) {
        // Who works with more threads does so each time; a start may cost more than another one.
        spent = measure()?;
    }
    let (cpu, wall) = spent;
    trial.figure("cpu_ms", milliseconds(cpu));
    trial.figure("wall_ms", milliseconds(wall));
    if is_more(spent) {
        return Err(Stop::failed(format!(
            "allowed one thread, it spent {:.0} ms of CPU time in {:.0} ms",
            milliseconds(cpu),
            milliseconds(wall)
        )));
    }
    Ok(())
}

//! The fuzzer: random instances and hostile timing, and the smallest instance of every kind of failure.
//!
//! An instance, a [`Probe`], follows from a seed alone: a map in one of the views that the plugin claims, agents,
//! and calls with their budgets and limits. What is asked is what the contract lets a host ask, and answers are
//! judged as in the cases. Many probes are asked of one process. One that fails is asked again in a fresh process,
//! then after those that were asked before it, and is made smaller as long as it fails in the same way.

mod ask;
mod draw;
mod probe;
mod shrink;

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use fleetyard_core::InputError;
use fleetyard_core::json::{self, read_object};
use fleetyard_runtime::{Fault, Session};
use fleetyard_world::SeededRandom;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

pub use self::probe::{Call, Member, Probe, Size, View};

use self::ask::Asker;
use crate::kit::Kit;
use crate::report::{Outcome, milliseconds};
use crate::stop::{Failure, Stop};
use crate::subject::Subject;
use crate::trial::{EXPECTED, GIVEN_UP, Trial};

/// Probes that are asked of one process before another one is started.
const OF_ONE_PROCESS: usize = 32;

/// Times that a failure is asked again to see how often it fails.
const AGAIN: usize = 3;

/// Times that a candidate is asked where the failure does not come every time.
const TRIES: usize = 5;

/// Times that the probes of a file are asked until they fail.
const FROM_FILE: usize = 20;

/// Most candidates of the shrinker, and the longest time for them, of one failure.
const CANDIDATES: usize = 2000;
const SHRINKING: Duration = Duration::from_mins(2);

/// Kinds of failures after which no more are looked for.
const KINDS: usize = 20;

/// The end of a run of the fuzzer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Extent {
    /// So many instances.
    Instances(u64),
    /// No new instance after so long.
    Lasting(Duration),
}

/// A run of the fuzzer.
#[derive(Debug, Clone, Copy)]
pub struct Fuzz {
    /// Its end.
    pub extent: Extent,
    /// Seed from which the seeds of instances follow.
    pub seed: u64,
    /// The seed of the one instance that is asked in place of others, again and again.
    pub reproduce: Option<u64>,
}

/// Results of a run of the fuzzer.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct FuzzReport {
    /// Instances that were asked.
    pub instances: usize,
    /// The same by view.
    pub by_view: BTreeMap<View, usize>,
    /// Calls about them; those of the shrinker are not counted.
    pub calls: usize,
    /// Processes of the plugin, all of them.
    pub processes: usize,
    /// Wall time of the instances.
    pub time_ms: f64,
    /// Calls of them in a second.
    pub calls_per_s: f64,
    /// Calls about instances with a plan that the fuzzer knows.
    pub expected_plans: usize,
    /// Those of them in which the plugin gave up.
    pub given_up: usize,
    /// Instances whose robots or obstacles the plugin does not know, as it may.
    pub unknown: usize,
    /// Failures, one of each kind.
    #[serde(skip)]
    pub findings: Vec<Finding>,
}

/// A failure of one kind.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// Its kind in a few words.
    pub kind: String,
    /// [`Outcome::Failed`] or [`Outcome::Crashed`].
    pub outcome: Outcome,
    /// The reason, for people, of the smallest instance.
    pub reason: String,
    /// The seed of the instance that failed first.
    pub seed: u64,
    /// Its number in the run, from 1.
    pub number: usize,
    /// The form in which it was shown.
    pub view: View,
    /// Instances of the run that failed in this way.
    pub times: usize,
    /// Attempts to let the smallest instances fail again, in a fresh process each, and those of them in which they
    /// did.
    pub asked_again: usize,
    /// See [`Finding::asked_again`].
    pub failed_again: usize,
    /// True if budgets of it are so short that the answer may depend on the speed of the machine.
    pub is_hurried: bool,
    /// Size before shrinking.
    pub before: Size,
    /// Size after it.
    pub after: Size,
    /// Candidates that the shrinker asked.
    pub candidates: usize,
    /// True if nothing can be left out of what is left.
    pub is_smallest: bool,
    /// The smallest instances: the last one fails after those before it.
    #[serde(skip)]
    pub probes: Vec<Probe>,
}

/// The value of `format` in files of the fuzzer.
pub const FUZZED_FORMAT: &str = "fleetyard.fuzzed/1";

/// Largest such file that is read, in bytes.
pub const FUZZED_FILE_LIMIT: u64 = 1 << 26;

/// Content of a file with what the fuzzer found.
#[allow(
    clippy::manual_non_exhaustive,
    reason = "the format is a key of the file"
)]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fuzzed {
    #[serde(deserialize_with = "the_format", serialize_with = "as_the_format")]
    format: (),
    /// Identifier of the plugin that failed.
    pub plugin: String,
    /// Options with which it was made.
    #[serde(default)]
    pub options: Map<String, Value>,
    /// The kind of the failure.
    pub kind: String,
    /// The instances; the last one fails after those before it.
    pub probes: Vec<Probe>,
}

fn the_format<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<(), D::Error> {
    json::format(deserializer, FUZZED_FORMAT)
}

#[allow(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde hands over references"
)]
fn as_the_format<S: serde::Serializer>((): &(), serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(FUZZED_FORMAT)
}

impl Fuzzed {
    /// A failure of a plugin as a file has it.
    pub fn of(finding: &Finding, subject: &Subject) -> Self {
        Self {
            format: (),
            plugin: subject.descriptor.id.clone(),
            options: subject.options.clone(),
            kind: finding.kind.clone(),
            probes: finding.probes.clone(),
        }
    }

    /// Reads a file; errors name `source`.
    pub fn parse(source: &str, bytes: &[u8]) -> Result<Self, InputError> {
        const HINT: &str = "`fleetyard plugins check PLUGIN --fuzz 1m` writes such files";
        let fuzzed: Self = read_object(source, bytes, HINT).map_err(|error| error.or_hint(HINT))?;
        let wrong = |reason: String| InputError::new(source, reason).hint(HINT);
        if fuzzed.probes.is_empty() {
            return Err(wrong("there are no probes".into()));
        }
        for (number, probe) in fuzzed.probes.iter().enumerate() {
            let checked = probe.check();
            checked.map_err(|reason| wrong(format!("probe {number}: {reason}")))?;
        }
        Ok(fuzzed)
    }
}

/// Nanoseconds for people.
fn seconds(ns: u64) -> String {
    format!("{:?}", Duration::from_nanos(ns))
}

impl Kit {
    /// Asks a plugin random instances, and tells of every failure of a new kind once it is as small as can be. An
    /// error is a fault of the host, which says nothing of the plugin.
    pub fn fuzz(
        &self,
        subject: &Subject,
        fuzz: &Fuzz,
        mut tell: impl FnMut(&Finding),
    ) -> Result<FuzzReport, Fault> {
        let mut trial = Trial::new(self.runtime(), *self.config(), subject, fuzz.seed);
        let mut run = Run::new(Asker::new(&mut trial)?);
        let views = match draw::views(run.asker.trial()) {
            Ok(views) => views,
            Err(stop) => return Run::without(stop),
        };
        let started = Instant::now();
        let mut seeds = SeededRandom::new("fuzz seeds", fuzz.seed);
        let goes_on = |asked: u64| match fuzz.extent {
            Extent::Instances(most) => asked < most,
            Extent::Lasting(time) => started.elapsed() < time,
        };
        let mut asked = 0;
        while goes_on(asked) && run.report.findings.len() < KINDS {
            asked += 1;
            let seed = fuzz
                .reproduce
                .unwrap_or_else(|| seeds.below(1 << 32) as u64);
            let probe = match draw::probe(run.asker.trial(), &views, seed) {
                Ok(probe) => probe,
                Err(stop) => return Run::without(stop),
            };
            run.ask(probe, fuzz.reproduce.is_some(), &mut tell)?;
        }
        Ok(run.end())
    }

    /// Asks what a file has until it fails, at most twenty times.
    pub fn fuzzed(&self, subject: &Subject, fuzzed: &Fuzzed) -> Result<FuzzReport, Fault> {
        let seed = fuzzed.probes.last().map_or(0, |probe| probe.seed);
        let mut trial = Trial::new(self.runtime(), *self.config(), subject, seed);
        let mut run = Run::new(Asker::new(&mut trial)?);
        run.ask_file(&fuzzed.probes)?;
        Ok(run.end())
    }
}

/// A run of the fuzzer in progress.
struct Run<'t, 'a> {
    asker: Asker<'t, 'a>,
    report: FuzzReport,
    session: Option<Session>,
    /// Probes that the present process was asked.
    history: Vec<Probe>,
    /// Wall time of instances.
    taken: Duration,
}

impl<'t, 'a> Run<'t, 'a> {
    fn new(asker: Asker<'t, 'a>) -> Self {
        Self {
            asker,
            report: FuzzReport::default(),
            session: None,
            history: Vec::new(),
            taken: Duration::ZERO,
        }
    }

    /// The report where the plugin could not be asked about instances.
    fn without(stop: Stop) -> Result<FuzzReport, Fault> {
        let mut report = FuzzReport::default();
        match stop {
            Stop::Skipped(_) => {}
            Stop::Failed(failure) => report.findings.push(Finding::of(failure, Outcome::Failed)),
            Stop::Crashed(failure) => report.findings.push(Finding::of(failure, Outcome::Crashed)),
            Stop::Host(fault) => return Err(fault),
        }
        Ok(report)
    }

    fn end(mut self) -> FuzzReport {
        self.restart();
        self.report.processes = self.asker.processes;
        self.report.time_ms = milliseconds(self.taken);
        let seconds = self.taken.as_secs_f64();
        if seconds > 0.0 {
            self.report.calls_per_s = self.report.calls as f64 / seconds;
        }
        self.report
    }

    /// Ends the present process.
    fn restart(&mut self) {
        if let Some(session) = self.session.take() {
            self.asker.close(session);
        }
        self.history.clear();
    }

    /// Asks a probe in the present process or, if it is to be alone, in one of its own.
    fn ask(
        &mut self,
        mut probe: Probe,
        is_alone: bool,
        tell: &mut impl FnMut(&Finding),
    ) -> Result<(), Fault> {
        let started = Instant::now();
        let calls = self.asker.calls;
        if is_alone || self.history.len() >= OF_ONE_PROCESS {
            self.restart();
        }
        let session = match self.session.take() {
            Some(session) => Ok(session),
            None => self.asker.open(),
        };
        let ended = session.and_then(|mut session| {
            self.asker.one(&mut session, &mut probe)?;
            self.session = Some(session);
            Ok(())
        });
        self.taken += started.elapsed();
        self.report.calls += self.asker.calls - calls;
        self.report.instances += 1;
        *self.report.by_view.entry(probe.view).or_default() += 1;
        self.report.unknown += usize::from(self.asker.trial().is_ignorant());
        let figures = self.asker.forget();
        let figure = |name| figures.get(name).map_or(0, |count| *count as usize);
        self.report.expected_plans += figure(EXPECTED);
        self.report.given_up += figure(GIVEN_UP);
        let (failure, outcome) = match ended {
            Ok(()) => {
                self.history.push(probe);
                return Ok(());
            }
            Err(Stop::Skipped(_)) => {
                self.report.unknown += 1;
                self.restart();
                return Ok(());
            }
            Err(Stop::Host(fault)) => return Err(fault),
            Err(Stop::Failed(failure)) => (failure, Outcome::Failed),
            Err(Stop::Crashed(failure)) => (failure, Outcome::Crashed),
        };
        let mut known = self.report.findings.iter_mut();
        if let Some(known) = known.find(|known| known.kind == failure.kind) {
            known.times += 1;
        } else {
            let number = self.report.instances;
            let mut finding = Finding::of(failure, outcome);
            (finding.number, finding.seed, finding.view) = (number, probe.seed, probe.view);
            let mut probes = std::mem::take(&mut self.history);
            probes.push(probe);
            self.attribute(&mut finding, probes)?;
            self.asker.forget();
            tell(&finding);
            self.report.findings.push(finding);
        }
        self.restart();
        Ok(())
    }

    /// Finds out what a failure needs: the instance alone or some before it, and how little of them.
    fn attribute(&mut self, finding: &mut Finding, probes: Vec<Probe>) -> Result<(), Fault> {
        let alone = probes[probes.len() - 1..].to_vec();
        let mut needed = alone.clone();
        let mut failed = self.times(&needed, &finding.kind, AGAIN)?;
        if failed == 0 && probes.len() > 1 {
            needed = probes;
            failed = self.times(&needed, &finding.kind, AGAIN)?;
        }
        finding.before = Size::of(if failed == 0 { &alone } else { &needed });
        if failed > 0 {
            let tries = if failed == AGAIN { 1 } else { TRIES };
            let started = Instant::now();
            let kind = finding.kind.clone();
            let fails = |probes: &[Probe]| {
                for _ in 0..tries {
                    if self.asker.fails_so(probes, &kind)? {
                        return Ok(true);
                    }
                }
                Ok(false)
            };
            let may_go_on = |asked| asked < CANDIDATES && started.elapsed() < SHRINKING;
            let shrunk = shrink::shrink(needed, fails, may_go_on)?;
            (finding.candidates, finding.is_smallest) = (shrunk.asked, shrunk.is_smallest);
            needed = shrunk.probes;
        }
        finding.asked_again = TRIES;
        for _ in 0..TRIES {
            match self.asker.fresh(&needed) {
                Err(Stop::Failed(failure) | Stop::Crashed(failure))
                    if failure.kind == finding.kind =>
                {
                    finding.failed_again += 1;
                    finding.reason = failure.reason;
                }
                Err(Stop::Host(fault)) => return Err(fault),
                _ => {}
            }
        }
        finding.after = Size::of(&needed);
        finding.is_hurried = needed.iter().any(Probe::is_hurried);
        finding.probes = needed;
        Ok(())
    }

    /// Times out of so many that probes fail in this way, each in a fresh process.
    fn times(&mut self, probes: &[Probe], kind: &str, of: usize) -> Result<usize, Fault> {
        let mut failed = 0;
        for _ in 0..of {
            failed += usize::from(self.asker.fails_so(probes, kind)?);
        }
        Ok(failed)
    }

    fn ask_file(&mut self, probes: &[Probe]) -> Result<(), Fault> {
        let started = Instant::now();
        let mut tries = 0;
        let mut ended = Ok(());
        while ended.is_ok() && tries < FROM_FILE {
            tries += 1;
            ended = self.asker.fresh(probes);
        }
        self.taken = started.elapsed();
        self.report.instances = tries * probes.len();
        self.report.calls = self.asker.calls;
        for probe in probes {
            *self.report.by_view.entry(probe.view).or_default() += tries;
        }
        let (failure, outcome) = match ended {
            Ok(()) => return Ok(()),
            Err(Stop::Skipped(_)) => {
                self.report.unknown = 1;
                return Ok(());
            }
            Err(Stop::Host(fault)) => return Err(fault),
            Err(Stop::Failed(failure)) => (failure, Outcome::Failed),
            Err(Stop::Crashed(failure)) => (failure, Outcome::Crashed),
        };
        let mut finding = Finding::of(failure, outcome);
        if let Some(last) = probes.last() {
            (finding.seed, finding.view) = (last.seed, last.view);
        }
        (finding.asked_again, finding.failed_again, finding.number) = (tries, 1, 1);
        (finding.before, finding.after) = (Size::of(probes), Size::of(probes));
        finding.is_hurried = probes.iter().any(Probe::is_hurried);
        finding.probes = probes.to_vec();
        self.report.findings.push(finding);
        Ok(())
    }
}

impl Finding {
    fn of(Failure { kind, reason }: Failure, outcome: Outcome) -> Self {
        Self {
            kind,
            outcome,
            reason,
            seed: 0,
            number: 0,
            view: View::Status,
            times: 1,
            asked_again: 0,
            failed_again: 0,
            is_hurried: false,
            before: Size::default(),
            after: Size::default(),
            candidates: 0,
            is_smallest: false,
            probes: Vec::new(),
        }
    }
}

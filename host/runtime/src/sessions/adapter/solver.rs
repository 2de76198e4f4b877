//! The planner that an adapter makes: files out, a program run, an answer in.

use std::ffi::OsString;
use std::fs::{self, OpenOptions};
use std::io::{self, Read};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::time::Duration;

use fleetyard_abi::object::{Planner, Prepare};
use fleetyard_abi::sdk::{Failure, Sink};
use fleetyard_abi::{
    Budget, Capability, Instance, LogLevel, Part, Plan, SharedEnvironment, Status, monotonic_ns,
};
use fleetyard_core::formats::{Format, PATHS_LIMIT};
use regex::bytes::Regex;
use serde_json::{Map, Value as Json};
use tempfile::TempDir;

use super::input::{MAP_NAME, PROBLEM_NAME, ROADMAP_NAME, SCEN_NAME, TASK_NAME};
use super::installed::Installed;
use super::manifest::{Condition, Searched};
use super::problem::{self, Problem, seed31, told, unsupported};
use super::process::{self, Captured, End, Ended, Outputs};
use super::template::Slot;

/// Bytes of the beginning and of the end of a solver's log that patterns see.
const LOG_HEAD: usize = 1 << 20;
const LOG_TAIL: usize = 3 << 20;

/// Most bytes of a solver's output that go to the run's log.
const FORWARDED: usize = 1 << 20;

/// A solver, ready to be asked.
pub(super) struct Solver {
    installed: Arc<Installed>,
    /// The options that were given, and the defaults of others.
    options: Map<String, Json>,
    /// Removed with the solver.
    scratch: TempDir,
    /// The map with which it was prepared, in its own terms.
    problem: Option<Box<dyn Problem>>,
}

/// The output that a solver left behind.
struct Left {
    stdout: Vec<u8>,
    stderr: Vec<u8>,
    answer: Answer,
}

enum Answer {
    Stdout,
    File(Vec<u8>),
    Missing,
}

impl Left {
    fn answer(&self) -> Option<&[u8]> {
        match &self.answer {
            Answer::Stdout => Some(&self.stdout),
            Answer::File(bytes) => Some(bytes),
            Answer::Missing => None,
        }
    }

    fn texts(&self, from: Searched) -> [Option<&[u8]>; 2] {
        match from {
            Searched::Log => [Some(&self.stdout), Some(&self.stderr)],
            Searched::Stdout => [Some(&self.stdout), None],
            Searched::Stderr => [Some(&self.stderr), None],
            Searched::Output => [self.answer(), None],
        }
    }

    /// The line in which a pattern matches first.
    fn line(&self, pattern: &Regex, from: Searched) -> Option<String> {
        let texts = self.texts(from);
        texts.into_iter().flatten().find_map(|text| {
            let at = pattern.find(text)?.start();
            let newline = |byte: &u8| *byte == b'\n';
            let begin = text[..at].iter().rposition(newline).map_or(0, |at| at + 1);
            let rest = &text[begin..];
            let end = rest.iter().position(newline).unwrap_or(rest.len());
            Some(excerpt(&rest[..end]))
        })
    }

    /// For the end of a message: what the solver said last, on standard error
    /// rather than standard output.
    fn last_words(&self) -> String {
        let words = [&self.stderr, &self.stdout].into_iter().find_map(|text| {
            let mut lines = text.rsplit(|byte| *byte == b'\n');
            let last = lines.find(|line| !line.trim_ascii().is_empty())?;
            Some(excerpt(last))
        });
        words.map_or_else(String::new, |words| {
            format!("; its last words were: {words}")
        })
    }
}

/// A line for a message.
fn excerpt(line: &[u8]) -> String {
    const LONGEST: usize = 200;
    let line = line.trim_ascii();
    let text = String::from_utf8_lossy(&line[..line.len().min(4 * LONGEST)]);
    let mut shown: String = text.chars().take(LONGEST).collect();
    if text.chars().nth(LONGEST).is_some() {
        shown.push('…');
    }
    shown
}

fn internal(what: &str, error: impl std::fmt::Display) -> Failure {
    Failure::new(Status::InternalError, format!("{what}: {error}"))
}

/// The end of a solver as a claim; `None` when it solved the instance.
type Claim = Option<Failure>;

impl Solver {
    pub(super) fn new(
        installed: Arc<Installed>,
        mut options: Map<String, Json>,
    ) -> Result<Self, Failure> {
        let scratch = tempfile::Builder::new()
            .prefix("fleetyard-")
            .tempdir()
            .map_err(|error| internal("cannot make a folder for the solver's files", error))?;
        let known = installed.manifest.options.get("properties");
        for (name, property) in known.and_then(Json::as_object).into_iter().flatten() {
            if let (false, Some(default)) = (options.contains_key(name), property.get("default")) {
                options.insert(name.clone(), default.clone());
            }
        }
        Ok(Self {
            installed,
            options,
            scratch,
            problem: None,
        })
    }

    /// Refuses parts that have to be understood: solvers are not told of any.
    fn refuse_critical(&self, parts: &[Part]) -> Result<(), Failure> {
        match parts.iter().find(|part| part.critical) {
            Some(part) => Err(unsupported(
                &self.installed.manifest,
                &format!("does not know the critical part `{}`", part.id),
            )),
            None => Ok(()),
        }
    }

    /// Writes files into the scratch folder.
    fn write<'a>(
        &self,
        files: impl IntoIterator<Item = (&'a str, Vec<u8>)>,
    ) -> Result<(), Failure> {
        for (name, bytes) in files {
            fs::write(self.scratch.path().join(name), bytes)
                .map_err(|error| internal(&format!("cannot write {name}"), error))?;
        }
        Ok(())
    }

    /// The time that the solver is thought to take before its own clock starts.
    fn preparation_ns(&self, agents: usize, places: u64) -> u64 {
        let each = self.installed.manifest.program.reserve_per_agent_cell;
        each.saturating_mul(agents as u64).saturating_mul(places)
    }

    /// The solver's part of what is left of the budget.
    fn time(&self, agents: usize, places: u64, budget: &Budget) -> Duration {
        let left = budget.deadline_monotonic_ns.saturating_sub(monotonic_ns());
        let left = Duration::from_nanos(left);
        let reserve = self.installed.manifest.program.reserve.unwrap_or_else(|| {
            let share = Duration::from_nanos(budget.wall_ns) / 20;
            share.clamp(Duration::from_millis(20), Duration::from_secs(1))
        });
        let preparation = Duration::from_nanos(self.preparation_ns(agents, places));
        left.saturating_sub(reserve + preparation)
            .max(Duration::from_millis(1))
    }

    /// The value of a placeholder, for so many agents and places.
    fn value(&self, slot: &Slot, (agents, time): (usize, Duration), budget: &Budget) -> OsString {
        let Installed {
            manifest, folder, ..
        } = &*self.installed;
        let scratch = self.scratch.path();
        match slot {
            Slot::Map => scratch.join(MAP_NAME).into(),
            Slot::Scen => scratch.join(SCEN_NAME).into(),
            Slot::Roadmap => scratch.join(ROADMAP_NAME).into(),
            Slot::Task => scratch.join(TASK_NAME).into(),
            Slot::Problem => scratch.join(PROBLEM_NAME).into(),
            Slot::Output => match &manifest.output.file {
                Some(file) => scratch.join(file).into(),
                None => OsString::new(),
            },
            Slot::Scratch => scratch.into(),
            Slot::ManifestDir => folder.into(),
            Slot::Agents => agents.to_string().into(),
            Slot::Seconds => seconds(time).into(),
            Slot::WholeSeconds => time.as_secs().max(1).to_string().into(),
            Slot::Milliseconds => time.as_millis().to_string().into(),
            Slot::Seed => budget.seed.to_string().into(),
            Slot::Seed31 => seed31(budget.seed).to_string().into(),
            Slot::Threads => budget.threads.max(1).to_string().into(),
            Slot::MemoryMb => (budget.memory_bytes >> 20).to_string().into(),
            Slot::Nodes => budget.nodes.to_string().into(),
            Slot::Option(name) => match self.options.get(name) {
                Some(Json::String(text)) => text.into(),
                Some(value) => value.to_string().into(),
                None => OsString::new(),
            },
        }
    }

    fn command(&self, value: &dyn Fn(&Slot) -> OsString, budget: &Budget) -> Command {
        let Installed {
            manifest, program, ..
        } = &*self.installed;
        let holds = |condition: &Condition| match condition {
            Condition::Memory => budget.memory_bytes > 0,
            Condition::Nodes => budget.nodes > 0,
            Condition::OneThread => budget.threads <= 1,
            Condition::Threads => budget.threads > 1,
            Condition::Option(name) => !matches!(
                self.options.get(name),
                None | Some(Json::Null | Json::Bool(false))
            ),
        };
        let mut command = Command::new(program);
        for argument in &manifest.program.arguments {
            if argument.when.as_ref().is_none_or(holds) {
                let rendered = argument.templates.iter().map(|one| one.render(value));
                command.args(rendered);
            }
        }
        for (name, template) in &manifest.program.environment {
            command.env(name, template.render(value));
        }
        let cwd = manifest.program.cwd.as_ref();
        command
            .current_dir(cwd.map_or_else(|| self.scratch.path().into(), |cwd| cwd.render(value)));
        command
    }

    /// Runs the solver, its output going to the log as it comes.
    fn run(&self, mut command: Command, sink: &dyn Sink) -> Result<Ended, Failure> {
        let answer_on_stdout = self.installed.manifest.output.file.is_none();
        let forward = |level: LogLevel, left: &mut Option<usize>, line: &str| {
            let Some(room) = left else {
                return;
            };
            if let Some(rest) = room.checked_sub(line.len() + 1) {
                *room = rest;
                sink.log(level, line);
            } else {
                *left = None;
                let text =
                    format!("the solver wrote more than {FORWARDED} bytes; the rest is not kept");
                sink.log(LogLevel::Warning, &text);
            }
        };
        let (mut stdout_left, mut stderr_left) = (Some(FORWARDED), Some(FORWARDED));
        let outputs = Outputs {
            stdout: if answer_on_stdout {
                Captured::new(PATHS_LIMIT as usize, 0)
            } else {
                Captured::new(LOG_HEAD, LOG_TAIL)
            },
            stderr: Captured::new(LOG_HEAD, LOG_TAIL),
            stdout_line: &mut |line| {
                if !answer_on_stdout {
                    forward(LogLevel::Debug, &mut stdout_left, line);
                }
            },
            stderr_line: &mut |line| forward(LogLevel::Info, &mut stderr_left, line),
        };
        process::run(&mut command, outputs, &|| sink.cancelled()).map_err(|error| {
            let program = self.installed.program.display();
            internal(&format!("{program} cannot be started"), error)
        })
    }

    /// The claim that follows from the end of the solver, by the manifest's patterns, then its exit
    /// codes.
    fn claim(&self, end: End, left: &Left) -> Claim {
        let exit = &self.installed.manifest.exit;
        for rule in &exit.patterns {
            let Some(line) = left.line(&rule.pattern, rule.from) else {
                continue;
            };
            if rule.status == Status::Solved {
                return None;
            }
            let message = match &rule.message {
                Some(message) => format!("{message} (the solver wrote: {line})"),
                None => format!("the solver wrote: {line}"),
            };
            return Some(Failure::new(rule.status, message));
        }
        let code = match end {
            End::Exited(code) => Some(code),
            End::Signalled(_) | End::Stopped => None,
        };
        let rule = exit.codes.iter().find(|(known, _)| Some(*known) == code);
        let status = match (rule, code) {
            (Some((_, status)), _) => *status,
            (None, Some(0)) => Status::Solved,
            (None, _) => Status::InternalError,
        };
        if status == Status::Solved {
            return None;
        }
        let words = left.last_words();
        Some(Failure::new(status, format!("the solver {end}{words}")))
    }

    fn report_metrics(&self, left: &Left, sink: &dyn Sink) {
        for metric in &self.installed.manifest.metrics {
            let texts = left.texts(metric.from).into_iter().flatten();
            let found = texts.flat_map(|text| metric.pattern.captures_iter(text));
            // The last one is that of the answer.
            let Some(value) = found.last().and_then(|found| found.get(1)) else {
                continue;
            };
            let text = String::from_utf8_lossy(value.as_bytes());
            match text.trim().parse::<f64>() {
                Ok(value) if value.is_finite() => sink.metric(&metric.name, value),
                _ => {
                    let shown = excerpt(value.as_bytes());
                    let text = format!("the figure `{}` is no number: {shown}", metric.name);
                    sink.log(LogLevel::Warning, &text);
                }
            }
        }
    }

    /// Takes what the solver left, and the answer in it.
    fn left(&self, ended: Ended) -> Result<Left, Failure> {
        let output = &self.installed.manifest.output;
        let answer = match &output.file {
            Some(name) => read_answer(&self.scratch.path().join(name)),
            None if ended.stdout.dropped > 0 => Err(too_large()),
            None => Ok(Answer::Stdout),
        };
        let broken = |error| Failure::broke_contract(format!("{}: {error}", output.source()));
        Ok(Left {
            answer: answer.map_err(broken)?,
            stdout: ended.stdout.into_bytes(),
            stderr: ended.stderr.into_bytes(),
        })
    }
}

fn too_large() -> io::Error {
    let reason = format!("the answer is larger than {PATHS_LIMIT} bytes");
    io::Error::other(reason)
}

/// Reads the answer's file, if there is one. What the solver put there may be
/// anything: links are not followed, and pipes not waited for.
fn read_answer(path: &Path) -> io::Result<Answer> {
    let opened = OpenOptions::new()
        .read(true)
        .custom_flags(libc::O_NOFOLLOW | libc::O_NONBLOCK)
        .open(path);
    let file = match opened {
        Ok(file) => file,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Answer::Missing),
        Err(error) => return Err(error),
    };
    let meta = file.metadata()?;
    if !meta.is_file() {
        return Err(io::Error::other("the answer is not a regular file"));
    }
    if meta.len() > PATHS_LIMIT {
        return Err(too_large());
    }
    let mut bytes = Vec::with_capacity(meta.len() as usize);
    file.take(PATHS_LIMIT + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > PATHS_LIMIT {
        return Err(too_large());
    }
    Ok(Answer::File(bytes))
}

/// Seconds with as many decimals as they need, milliseconds at most.
fn seconds(time: Duration) -> String {
    let text = format!("{}.{:03}", time.as_secs(), time.subsec_millis());
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

impl Prepare for Solver {
    fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        _: &Budget,
        _: &dyn Sink,
    ) -> Result<(), Failure> {
        self.problem = None;
        self.refuse_critical(&environment.parts)?;
        let (problem, files) = problem::prepare(&self.installed.manifest, environment)?;
        self.write(files)?;
        self.problem = Some(problem);
        Ok(())
    }
}

impl Planner for Solver {
    fn plan(
        &mut self,
        instance: &Instance,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        let manifest = &self.installed.manifest;
        let problem = self
            .problem
            .as_deref()
            .ok_or_else(|| Failure::new(Status::InvalidInput, "`plan` came before `prepare`"))?;
        self.refuse_critical(&instance.parts)?;
        problem.check(manifest, instance)?;
        let scratch = self.scratch.path();
        self.write(problem.files(manifest, instance, budget.seed, scratch)?)?;
        let agents = instance.agents();
        let time = self.time(agents, problem.places(), budget);
        let value = |slot: &Slot| self.value(slot, (agents, time), budget);
        let settings = manifest.input.files.iter();
        self.write(settings.map(|(name, template)| {
            let text = template.render(value);
            (name.as_str(), text.into_encoded_bytes())
        }))?;
        if let Some(fact) = problem.fact() {
            sink.note("units", &fact);
        }
        let output = &manifest.output;
        if let Some(file) = &output.file {
            // The answer of the last call is none of this one's.
            match fs::remove_file(scratch.join(file)) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => {
                    return Err(internal("cannot remove the last answer", error));
                }
                _ => {}
            }
        }
        let ended = self.run(self.command(&value, budget), sink)?;
        if ended.end == End::Stopped {
            let reason = "the solver did not end in time and was stopped";
            return Err(Failure::new(Status::TimedOut, reason));
        }
        let end = ended.end;
        let left = self.left(ended)?;
        // Such a file may say `solved=0` of itself.
        let is_lacam = self.installed.manifest.format() == Some(Format::Lacam);
        let result = match (self.claim(end, &left), left.answer()) {
            (None, Some(answer)) if is_lacam && says_unsolved(answer) => {
                let reason = "the solver found no solution: its answer says `solved=0`";
                Err(Failure::new(Status::GaveUp, reason))
            }
            (None, Some(answer)) => problem
                .plan_in(manifest, answer, instance)
                .map_err(|error| Failure::broke_contract(told(&error)))
                .and_then(|plan| submit(&plan, sink)),
            (None, None) => {
                let reason = format!(
                    "the solver {end} but wrote no {}{}",
                    output.source(),
                    left.last_words()
                );
                Err(Failure::new(Status::InternalError, reason))
            }
            (Some(failure), answer) => {
                let may_collide = self.installed.manifest.capabilities;
                let answer = answer.filter(|_| may_collide.has(Capability::CollidingPlans));
                // A solver that failed may have left anything, or nothing.
                match answer.map(|answer| problem.plan_in(manifest, answer, instance)) {
                    Some(Ok(plan)) => submit(&plan, sink)?,
                    Some(Err(error)) => sink.log(LogLevel::Debug, &told(&error)),
                    None => {}
                }
                Err(failure)
            }
        };
        self.report_metrics(&left, sink);
        result
    }
}

fn submit(plan: &Plan, sink: &dyn Sink) -> Result<(), Failure> {
    sink.submit(plan).map_err(|rejected| {
        if sink.cancelled() {
            Failure::new(Status::TimedOut, "the answer was read after the deadline")
        } else {
            rejected.into()
        }
    })
}

/// True if the head of a `lacam` answer says that there is no solution.
fn says_unsolved(answer: &[u8]) -> bool {
    answer
        .split(|byte| *byte == b'\n')
        .map(<[u8]>::trim_ascii)
        .take_while(|line| *line != b"solution=")
        .any(|line| line == b"solved=0")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_plain_file_is_an_answer() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let told = |name: &str| match read_answer(&path(name)) {
            Ok(Answer::File(bytes)) => format!("{} bytes", bytes.len()),
            Ok(_) => "missing".into(),
            Err(error) => error.to_string(),
        };
        assert_eq!(told("nothing"), "missing");
        fs::write(path("plain"), "text").unwrap();
        assert_eq!(told("plain"), "4 bytes");
        std::os::unix::fs::symlink(path("plain"), path("link")).unwrap();
        assert!(told("link").contains("symbolic links"), "{}", told("link"));
        fs::create_dir(path("folder")).unwrap();
        assert_eq!(told("folder"), "the answer is not a regular file");
        let pipe = Command::new("mkfifo").arg(path("pipe")).status();
        if pipe.is_ok_and(|status| status.success()) {
            assert_eq!(told("pipe"), "the answer is not a regular file");
        }
        let huge = fs::File::create(path("huge")).unwrap();
        huge.set_len(PATHS_LIMIT + 1).unwrap();
        assert_eq!(told("huge"), "the answer is larger than 268435456 bytes");
    }

    #[test]
    fn seconds_have_the_digits_that_they_need() {
        for (ms, text) in [
            (0, "0"),
            (1, "0.001"),
            (1500, "1.5"),
            (10_000, "10"),
            (9_876, "9.876"),
        ] {
            assert_eq!(seconds(Duration::from_millis(ms)), text);
        }
    }

    #[test]
    fn an_unsolved_answer_says_so_in_its_head() {
        assert!(says_unsolved(b"agents=2\r\nsolved=0\r\nsolution=\r\n"));
        assert!(!says_unsolved(b"solved=1\nsolution=\nsolved=0\n"));
    }
}

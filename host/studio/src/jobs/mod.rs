//! Jobs: whatever takes long, as commands of this program in processes of their own.
//!
//! So a result is what the command line gives, a planner that crashes hurts nobody, and a job can be
//! stopped or ended at any time. A few run at once, others wait. Each has a folder with the document
//! as it was when the job was asked for, which goes with the job. Nothing outlives the studio, however
//! that ends: see [`as_companion`](fleetyard_runtime::as_companion) and [`Scratch`](crate::scratch).

pub(crate) mod ask;
mod process;

use std::collections::{BTreeMap, VecDeque};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Instant;

use axum::http::StatusCode;
use fleetyard_core::{Digest, quoted, words};
use fleetyard_views::Representation;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use self::ask::{ANNOTATIONS, Command, Kind, Order, PLAN, TRACE};
use self::process::{Document, Process, USUAL_SPEED};
use crate::answer::{Refused, Result};

/// Jobs that run at once.
const AT_ONCE: usize = 2;
/// Most jobs that are known, those that wait and those that have ended among them.
const KNOWN: usize = 256;
/// Most plans of a run that are told of; the newest is always among them.
const INCUMBENTS: usize = 2000;

/// Most points of a fleet over time that are kept: of more every second one, every fourth, and so on.
const POINTS: usize = 512;

/// Most interventions in a live fleet that are told of, the newest.
const INTERVENTIONS: usize = 256;

/// The document of which a job is.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Origin {
    pub(crate) version: u64,
    pub(crate) digest: Digest,
    /// Parameters of its views.
    #[serde(skip)]
    pub(crate) views: Value,
}

/// The course of a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum State {
    Queued,
    Running,
    Stopping,
    Done,
    Failed,
    Cancelled,
}

words!(State {
    Queued = "queued", "It waits for others";
    Running = "running", "A command of it runs";
    Stopping = "stopping", "It was told to end with what it has";
    Done = "done", "Its commands have ended; their exit code says how";
    Failed = "failed", "A command could not be run to its end";
    Cancelled = "cancelled", "Somebody ended it, and it left nothing";
});

impl State {
    fn is_over(self) -> bool {
        matches!(self, Self::Done | Self::Failed | Self::Cancelled)
    }
}

/// A line of `run --follow` or `fleet --live`.
#[derive(Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Line {
    Incumbent(Value),
    Record(Value),
    Point(Value),
    Clip(String),
    Doing(Doing),
    #[serde(untagged)]
    Said(Said),
}

/// A line of a live fleet about what it is, and what was done to it.
#[derive(Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Said {
    Meta(Value),
    Intervened(Value),
    Refused(Value),
}

/// Goals and waits of the robots of a live fleet.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
struct Doing {
    /// The time since which it is so.
    at_s: f64,
    /// By the number of a robot the cell of its goal.
    goals: BTreeMap<String, Value>,
    /// By the number of a robot that of the one that it waits for, or `message`.
    waits: BTreeMap<String, Value>,
}

impl Doing {
    /// Takes in what is new; null is nothing any more.
    fn follow(&mut self, new: Self) {
        self.at_s = new.at_s;
        for (all, changes) in [(&mut self.goals, new.goals), (&mut self.waits, new.waits)] {
            all.extend(changes);
            all.retain(|_, value| !value.is_null());
        }
    }
}

/// A live fleet as far as it has said.
#[derive(Debug, Serialize)]
struct Live {
    /// Its description for the viewer, before the first clip.
    #[serde(skip)]
    scene: Option<Arc<[u8]>>,
    #[serde(skip)]
    doing: Doing,
    paused: bool,
    /// Simulated seconds per second; 0 for as many as can be.
    speed: f64,
    interventions: VecDeque<Value>,
    /// The number of commands that were refused, and the last of them with the reason.
    refused: u64,
    refusal: Option<Value>,
}

impl Live {
    fn new() -> Self {
        Self {
            scene: None,
            doing: Doing::default(),
            paused: false,
            speed: USUAL_SPEED,
            interventions: VecDeque::new(),
            refused: 0,
            refusal: None,
        }
    }

    fn hear(&mut self, said: Said) {
        match said {
            Said::Meta(meta) => self.scene = serde_json::to_vec(&meta).ok().map(Arc::from),
            Said::Intervened(what) => {
                if self.interventions.len() >= INTERVENTIONS {
                    self.interventions.pop_front();
                }
                self.interventions.push_back(what);
            }
            Said::Refused(what) => {
                self.refused += 1;
                self.refusal = Some(what);
            }
        }
    }

    /// Notes a command that was sent.
    fn sent(&mut self, what: &Value) {
        if let Some(paused) = what["pause"].as_bool() {
            self.paused = paused;
        }
        if let Some(speed) = what["speed"].as_f64() {
            self.speed = speed;
        }
    }
}

/// The figures of a fleet over time, thinned out as they become more.
#[derive(Debug, Default)]
struct Points {
    kept: Vec<Value>,
    seen: u64,
    /// Of so many one is kept, less one.
    pass: u64,
}

impl Points {
    fn push(&mut self, point: Value) {
        if self.kept.len() == POINTS {
            let mut at = 0;
            self.kept.retain(|_| {
                at += 1;
                at % 2 == 1
            });
            self.pass = 2 * self.pass + 1;
        }
        if self.seen.is_multiple_of(self.pass + 1) {
            self.kept.push(point);
        }
        self.seen += 1;
    }
}

#[derive(Debug)]
struct Job {
    order: Order,
    group: Option<u32>,
    origin: Origin,
    folder: PathBuf,
    state: State,
    process: Option<Arc<Process>>,
    /// Somebody wants it to end with what it has, or at once.
    stop: bool,
    cancel: bool,
    began: Option<Instant>,
    elapsed_ms: Option<u64>,
    incumbents: Vec<Value>,
    /// The newest figures of a live fleet.
    point: Option<Value>,
    points: Points,
    live: Option<Live>,
    results: BTreeMap<&'static str, Value>,
    exit: Option<i32>,
    error: Option<String>,
    stderr: String,
}

impl Job {
    /// The job but for what is long.
    fn summary(&self, id: u32) -> Value {
        let now = self.began.map(|began| began.elapsed().as_millis() as u64);
        let commands = self.order.commands.iter();
        let commands: Vec<Vec<String>> = commands.map(whole_line).collect();
        let lines: Vec<String> = commands.iter().map(|words| shell_line(words)).collect();
        let has = |name: &str| self.folder.join(name).is_file();
        json!({
            "id": id,
            "group": self.group,
            "kind": self.order.kind,
            "planner": self.order.planner,
            "view": self.order.view,
            "opened": self.order.opened,
            "state": self.state,
            "document": self.origin,
            "command": commands,
            "line": lines.join(" && "),
            "elapsed_ms": self.elapsed_ms.or(now),
            "exit": self.exit,
            "error": self.error,
            "incumbents": self.incumbents,
            "point": self.point,
            "live": self.live,
            "has": {
                "plan": has(PLAN),
                "trace": has(TRACE),
                "annotations": has(ANNOTATIONS),
                "scene": self.live.as_ref().is_some_and(|live| live.scene.is_some()),
            },
        })
    }

    fn whole(&self, id: u32) -> Value {
        let mut value = self.summary(id);
        for (key, result) in &self.results {
            value[key] = result.clone();
        }
        if self.point.is_some() {
            value["points"] = self.points.kept.as_slice().into();
        }
        value["stderr"] = self.stderr.as_str().into();
        value
    }
}

/// A command as a shell is given it.
fn whole_line(command: &Command) -> Vec<String> {
    let words = command.words.iter().cloned();
    ["fleetyard".to_owned()].into_iter().chain(words).collect()
}

fn shell_line(words: &[String]) -> String {
    let words: Vec<String> = words.iter().map(|word| quoted(word)).collect();
    words.join(" ")
}

#[derive(Debug, Default)]
struct Known {
    last: u32,
    jobs: BTreeMap<u32, Job>,
    queue: VecDeque<u32>,
    closing: bool,
}

type Tell = Box<dyn Fn(u32, News) + Send + Sync>;

/// News of a job.
pub(crate) enum News {
    /// It is another than it was.
    Changed,
    /// A live fleet has moved.
    Clip(Arc<[u8]>),
}

struct Shared {
    folder: PathBuf,
    known: Mutex<Known>,
    work: Condvar,
    tell: Tell,
}

/// All jobs.
pub(crate) struct Jobs {
    shared: Arc<Shared>,
    workers: Mutex<Vec<JoinHandle<()>>>,
}

impl Jobs {
    /// With folders in `folder`; `tell` is told what changes.
    pub(crate) fn new(folder: &Path, tell: Tell) -> std::io::Result<Self> {
        let shared = Arc::new(Shared {
            folder: folder.to_owned(),
            known: Mutex::default(),
            work: Condvar::new(),
            tell,
        });
        let workers = (0..AT_ONCE).map(|number| {
            let shared = Arc::clone(&shared);
            thread::Builder::new()
                .name(format!("job {number}"))
                .spawn(move || while shared.work() {})
        });
        let workers = workers.collect::<std::io::Result<_>>()?;
        Ok(Self {
            shared,
            workers: Mutex::new(workers),
        })
    }

    /// A number that no job and no recording has.
    pub(crate) fn number(&self) -> u32 {
        let mut known = self.shared.known();
        known.last += 1;
        known.last
    }

    /// The folder of a number.
    pub(crate) fn folder(&self, id: u32) -> PathBuf {
        self.shared.folder.join(id.to_string())
    }

    /// Puts a job into the queue. Its folder, which has its files, is removed where it is refused.
    pub(crate) fn add(
        &self,
        id: u32,
        order: Order,
        group: Option<u32>,
        origin: Origin,
    ) -> Result<Value> {
        let folder = self.folder(id);
        let mut known = self.shared.known();
        if known.closing || known.jobs.len() >= KNOWN {
            drop(known);
            let _ = fs::remove_dir_all(&folder);
            return Err(Refused::new(
                StatusCode::TOO_MANY_REQUESTS,
                format!("there are {KNOWN} jobs"),
            )
            .hint("delete some that have ended"));
        }
        let is_live = order.commands.iter().any(|command| command.live);
        let job = Job {
            live: is_live.then(Live::new),
            order,
            group,
            origin,
            folder,
            state: State::Queued,
            process: None,
            stop: false,
            cancel: false,
            began: None,
            elapsed_ms: None,
            incumbents: Vec::new(),
            point: None,
            points: Points::default(),
            results: BTreeMap::new(),
            exit: None,
            error: None,
            stderr: String::new(),
        };
        let summary = job.summary(id);
        known.jobs.insert(id, job);
        known.queue.push_back(id);
        drop(known);
        self.shared.work.notify_one();
        self.shared.changed(id);
        Ok(summary)
    }

    /// All jobs, oldest first.
    pub(crate) fn all(&self) -> Vec<Value> {
        let known = self.shared.known();
        known
            .jobs
            .iter()
            .map(|(id, job)| job.summary(*id))
            .collect()
    }

    /// A job, without what is long.
    pub(crate) fn summary(&self, id: u32) -> Option<Value> {
        self.shared.known().jobs.get(&id).map(|job| job.summary(id))
    }

    /// A job with all that it said.
    pub(crate) fn whole(&self, id: u32) -> Result<Value> {
        self.with(id, |job| Ok(job.whole(id)))
    }

    fn with<T>(&self, id: u32, ask: impl FnOnce(&mut Job) -> Result<T>) -> Result<T> {
        let mut known = self.shared.known();
        let job = known.jobs.get_mut(&id);
        job.map_or_else(|| Err(Refused::unknown("job")), ask)
    }

    /// The document of which a job is, and its view.
    pub(crate) fn origin(&self, id: u32) -> Result<(Origin, Option<Representation>)> {
        self.with(id, |job| Ok((job.origin.clone(), job.order.view)))
    }

    /// A file that a job has written, if it is there.
    pub(crate) fn file(&self, id: u32, name: &str) -> Result<PathBuf> {
        let path = self.with(id, |job| Ok(job.folder.join(name)))?;
        if path.is_file() {
            return Ok(path);
        }
        Err(Refused::unknown("file of this job"))
    }

    /// The description of a live fleet, if it has begun to drive.
    pub(crate) fn scene(&self, id: u32) -> Option<Arc<[u8]>> {
        let known = self.shared.known();
        known.jobs.get(&id)?.live.as_ref()?.scene.clone()
    }

    /// Goals and waits of the robots of a live fleet.
    pub(crate) fn doing(&self, id: u32) -> Result<Value> {
        self.with(id, |job| match &job.live {
            Some(live) => Ok(json!(live.doing)),
            None => Err(Refused::new(
                StatusCode::CONFLICT,
                "the job is no live fleet",
            )),
        })
    }

    /// The plan of a job that has ended, and its view.
    pub(crate) fn plan(&self, id: u32) -> Result<(PathBuf, Representation)> {
        let (view, is_over) = self.with(id, |job| Ok((job.order.view, job.state.is_over())))?;
        let path = self.file(id, PLAN)?;
        match view {
            Some(view) if is_over => Ok((path, view)),
            _ => Err(Refused::new(
                StatusCode::CONFLICT,
                "the job has not ended yet",
            )),
        }
    }

    /// Has a job end with what it has.
    pub(crate) fn stop(&self, id: u32) -> Result<Value> {
        let mut known = self.shared.known();
        let Some(job) = known.jobs.get_mut(&id) else {
            return Err(Refused::unknown("job"));
        };
        match job.state {
            State::Queued => {
                job.state = State::Cancelled;
                known.queue.retain(|queued| *queued != id);
            }
            State::Running => {
                job.state = State::Stopping;
                job.stop = true;
                if let Some(process) = &job.process {
                    process.interrupt();
                }
            }
            _ => {}
        }
        drop(known);
        self.told(id)
    }

    /// Ends a job at once. Its folder is removed.
    pub(crate) fn cancel(&self, id: u32) -> Result<Value> {
        self.shared.cancel(id)?;
        self.told(id)
    }

    /// Tells a live fleet something.
    pub(crate) fn control(&self, id: u32, what: &Value) -> Result<()> {
        let process = self.with(id, |job| {
            Ok(job.process.clone().filter(|_| job.live.is_some()))
        })?;
        if !process.is_some_and(|process| process.say(&what.to_string())) {
            let reason = "the job is no live fleet that runs";
            return Err(Refused::new(StatusCode::CONFLICT, reason));
        }
        self.with(id, |job| {
            if let Some(live) = &mut job.live {
                live.sent(what);
            }
            Ok(())
        })?;
        self.shared.changed(id);
        Ok(())
    }

    /// Forgets a job that has ended, and removes its folder.
    pub(crate) fn delete(&self, id: u32) -> Result<()> {
        let mut known = self.shared.known();
        match known.jobs.get(&id).map(|job| job.state.is_over()) {
            None => return Err(Refused::unknown("job")),
            Some(false) => {
                return Err(
                    Refused::new(StatusCode::CONFLICT, "the job has not ended yet")
                        .hint("cancel it first"),
                );
            }
            Some(true) => {}
        }
        known.jobs.remove(&id);
        drop(known);
        let _ = fs::remove_dir_all(self.folder(id));
        self.shared.changed(id);
        Ok(())
    }

    fn told(&self, id: u32) -> Result<Value> {
        self.shared.changed(id);
        self.with(id, |job| Ok(job.summary(id)))
    }

    /// Ends all jobs, and waits until nothing of them is left.
    pub(crate) fn close(&self) {
        let ids: Vec<u32> = {
            let mut known = self.shared.known();
            known.closing = true;
            known.jobs.keys().copied().collect()
        };
        for id in ids {
            let _ = self.shared.cancel(id);
        }
        self.shared.work.notify_all();
        let mut workers = self.workers.lock().unwrap_or_else(PoisonError::into_inner);
        for worker in workers.drain(..) {
            let _ = worker.join();
        }
    }
}

impl Shared {
    fn known(&self) -> MutexGuard<'_, Known> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn changed(&self, id: u32) {
        (self.tell)(id, News::Changed);
    }

    fn cancel(&self, id: u32) -> Result<()> {
        let mut known = self.known();
        let Some(job) = known.jobs.get_mut(&id) else {
            return Err(Refused::unknown("job"));
        };
        if job.state.is_over() {
            return Ok(());
        }
        job.cancel = true;
        if let Some(process) = &job.process {
            process.kill();
        }
        if job.state == State::Queued {
            job.state = State::Cancelled;
            let folder = job.folder.clone();
            known.queue.retain(|queued| *queued != id);
            drop(known);
            let _ = fs::remove_dir_all(folder);
        }
        Ok(())
    }

    /// Runs the next job; false once there will be none.
    fn work(&self) -> bool {
        let mut known = self.known();
        let id = loop {
            if known.closing {
                return false;
            }
            if let Some(id) = known.queue.pop_front() {
                break id;
            }
            known = self
                .work
                .wait(known)
                .unwrap_or_else(PoisonError::into_inner);
        };
        let Some(job) = known.jobs.get_mut(&id) else {
            return true;
        };
        job.state = State::Running;
        job.began = Some(Instant::now());
        let (commands, folder) = (job.order.commands.clone(), job.folder.clone());
        drop(known);
        self.changed(id);
        let mut ended = Ok(());
        for command in &commands {
            ended = self.command(id, command, &folder);
            if ended.is_err() {
                break;
            }
        }
        let mut known = self.known();
        let mut cancelled = false;
        if let Some(job) = known.jobs.get_mut(&id) {
            cancelled = job.cancel;
            job.elapsed_ms = job.began.map(|began| began.elapsed().as_millis() as u64);
            job.state = match &ended {
                _ if cancelled => State::Cancelled,
                Err(Some(_)) => State::Failed,
                Ok(()) | Err(None) => State::Done,
            };
            if let (Err(Some(error)), false) = (ended, cancelled) {
                job.error = Some(error);
            }
        }
        drop(known);
        if cancelled {
            let _ = fs::remove_dir_all(&folder);
        }
        self.changed(id);
        true
    }

    /// Runs a command of a job. No other follows one that gave no plan, or that could not be run,
    /// for which there is a reason.
    fn command(
        &self,
        id: u32,
        command: &Command,
        folder: &Path,
    ) -> std::result::Result<(), Option<String>> {
        let failed = |error: std::io::Error| Some(format!("the command cannot be run: {error}"));
        let (process, streams) = {
            // So that nobody who wants it to end misses it.
            let mut known = self.known();
            let Some(job) = known.jobs.get_mut(&id).filter(|job| !job.cancel) else {
                return Err(None);
            };
            let (process, streams) = Process::start(command, folder).map_err(failed)?;
            job.process = Some(Arc::clone(&process));
            if job.stop && command.kind != Kind::Simulate {
                process.interrupt();
            }
            (process, streams)
        };
        let mut document = Document::default();
        let ended = process.follow(streams, &mut |line| {
            self.line(id, command, line, &mut document)
        });
        let mut known = self.known();
        let Some(job) = known.jobs.get_mut(&id) else {
            return Err(None);
        };
        job.process = None;
        let ended = ended.map_err(failed)?;
        if let Some(value) = document.json() {
            job.results.insert(result_key(command.kind), value);
        }
        job.exit = Some(ended.code);
        job.stderr.push_str(&ended.stderr);
        if ended.too_much {
            return Err(Some("the command said more than can be kept".into()));
        }
        if let Some(signal) = ended.signal {
            return Err(Some(format!("the command was ended by signal {signal}")));
        }
        let has_plan = folder.join(PLAN).is_file();
        if command.kind == Kind::Run && !has_plan {
            return Err(None);
        }
        Ok(())
    }

    /// Takes a line of a command; false where it is too much.
    fn line(&self, id: u32, command: &Command, line: &[u8], document: &mut Document) -> bool {
        if command.kind == Kind::Simulate || (command.kind == Kind::Fleet && !command.live) {
            return document.push(line);
        }
        let Ok(read) = serde_json::from_slice(line) else {
            return true;
        };
        let mut known = self.known();
        let Some(job) = known.jobs.get_mut(&id) else {
            return false;
        };
        match read {
            Line::Incumbent(plan) => {
                job.incumbents.truncate(INCUMBENTS - 1);
                job.incumbents.push(plan);
            }
            Line::Record(record) => {
                job.results.insert(result_key(command.kind), record);
            }
            Line::Point(point) => {
                job.points.push(point.clone());
                job.point = Some(point);
            }
            Line::Said(said) => {
                if let Some(live) = &mut job.live {
                    live.hear(said);
                }
            }
            Line::Doing(new) => {
                // Whoever wants to know it asks.
                if let Some(live) = &mut job.live {
                    live.doing.follow(new);
                }
                return true;
            }
            Line::Clip(clip) => {
                drop(known);
                if let Some(clip) = from_base64(&clip) {
                    (self.tell)(id, News::Clip(clip.into()));
                }
                return true;
            }
        }
        drop(known);
        self.changed(id);
        true
    }
}

/// The bytes of a text in base64, padded.
fn from_base64(text: &str) -> Option<Vec<u8>> {
    let value = |letter: u8| match letter {
        b'A'..=b'Z' => Some(letter - b'A'),
        b'a'..=b'z' => Some(letter - b'a' + 26),
        b'0'..=b'9' => Some(letter - b'0' + 52),
        b'+' => Some(62),
        b'/' => Some(63),
        _ => None,
    };
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3);
    for four in text.as_bytes().chunks(4) {
        let kept = four.iter().take_while(|letter| **letter != b'=').count();
        let (mut bits, mut length) = (0_u32, 0);
        for letter in &four[..kept] {
            bits = bits << 6 | u32::from(value(*letter)?);
            length += 6;
        }
        while length >= 8 {
            length -= 8;
            bytes.push((bits >> length) as u8);
        }
    }
    Some(bytes)
}

/// The name of what a command prints at its end.
fn result_key(kind: Kind) -> &'static str {
    match kind {
        Kind::Run => "record",
        Kind::Simulate => "execution",
        Kind::Fleet => "fleet",
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::{POINTS, Points, from_base64};

    #[test]
    fn points_of_a_long_run_are_kept_at_equal_distances() {
        let mut points = Points::default();
        for time in 0..5 * POINTS {
            points.push(json!(time));
            assert!(points.kept.len() <= POINTS);
        }
        assert!(points.kept.len() > POINTS / 2);
        let expected = (0..5 * POINTS).step_by(8).map(|time| json!(time));
        assert!(points.kept.iter().cloned().eq(expected));
    }

    #[test]
    fn clips_are_read_back() {
        for length in 0..20_u8 {
            let bytes: Vec<u8> = (0..length).map(|byte| byte.wrapping_mul(37)).collect();
            let text = fleetyard_view::base64(&bytes);
            assert_eq!(from_base64(&text), Some(bytes));
        }
        assert_eq!(from_base64("a-c="), None);
    }
}

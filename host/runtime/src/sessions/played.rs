//! Calls that are played: a plugin, its supervisor and the clock take turns that a seed
//! decides, in time that is not real.
//!
//! The client and what a session makes of a call run as they are. The [`World`] under
//! them writes in pieces of any size, is late, interrupts, says nothing, says too much,
//! ends, is stopped for a limit, or loses its supervisor; and it knows what was written,
//! what was read, and when. From that, not from the code under test, [`Expectation`]
//! says what the outcome may be.
//!
//! A seed that fails is printed; `FLEETYARD_SEED=n` plays it alone, and
//! `FLEETYARD_SEEDS=n` plays so many.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::io;
use std::rc::Rc;

use std::collections::BTreeMap;
use std::time::Duration;

use fleetyard_abi::{Budget, GridEnvironment, Instance, PathEncoding};

use super::attachment::Attachment;
use super::client::{Client, Deadline};
use super::limits::Limits;
use super::plan_run::{PlanCall, Solver, Termination};
use crate::Fault;
use crate::confinement::control::Report;
use crate::confinement::sandbox::SandboxReport;
use crate::confinement::transport::{Interest, Output, Transport};
use crate::usage::{CallLimits, CallUsage, Limit};

const MS: u64 = 1_000_000;

/// The number of seeds that are played unless told otherwise.
const SEEDS: u64 = 6000;

/// More turns than any session takes.
const TURNS: u64 = 200_000;

/// Most bytes that are no messages, in these sessions.
const OUTPUT: u64 = 4096;

const ROWS: u32 = 4;
const COLS: u32 = 5;
const STARTS: [u32; 2] = [0, 7];

/// Numbers that follow from a seed: SplitMix64.
struct Dice(u64);

impl Dice {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, end: u64) -> u64 {
        self.next() % end
    }

    /// One time in so many.
    fn one_in(&mut self, times: u64) -> bool {
        self.below(times) == 0
    }

    /// Mostly short, sometimes long.
    fn pause(&mut self, usual: u64) -> u64 {
        match self.below(12) {
            0 => self.below(40 * MS),
            1..4 => self.below(4 * MS),
            _ => self.below(usual),
        }
    }
}

/// The kind of a line, as who wrote it knows.
#[derive(Debug, Clone, PartialEq)]
enum What {
    /// A plan for everybody, or for a wrong number of agents.
    Plan { agents: usize },
    /// An answer to a request, with a plan or without.
    Answer { id: u64, plan: bool, error: bool },
    /// Neither.
    Other,
    /// It breaks the protocol whoever reads it.
    Broken,
}

/// A line that was written, as a range of all that was.
#[derive(Debug, Clone)]
struct Written {
    what: What,
    begin: u64,
    end: u64,
    /// Time at which its last byte could be read.
    at_ns: u64,
}

/// The end of a plugin.
#[derive(Debug, Clone, Copy, PartialEq)]
enum End {
    Code(i32),
    Signal(i32),
}

/// A request that the host began to write.
#[derive(Debug, Clone)]
struct Asked {
    id: u64,
    /// The bytes that the host had read until then.
    read: u64,
    /// The deadline that it tells the plugin.
    deadline_ns: Option<u64>,
}

struct State {
    dice: Dice,
    now_ns: u64,
    turns: u64,
    /// Bytes that the host has written and the plugin has not taken.
    input: Vec<u8>,
    input_open: bool,
    /// Bytes that the plugin has written, in pieces that come at their times.
    pieces: VecDeque<(u64, Vec<u8>)>,
    errors: VecDeque<(u64, Vec<u8>)>,
    /// Time by which the plugin has done all its work until now.
    busy_ns: u64,
    /// Time at which its outputs close, and its end; an end that never comes is to be ended.
    closes_ns: Option<u64>,
    end: Option<End>,
    written: Vec<Written>,
    written_bytes: u64,
    /// The last line has no end yet.
    half: bool,
    idle_bytes: u64,
    /// The bytes that the host read of standard error.
    errors_read: u64,
    read_bytes: u64,
    /// The bytes that were read by a time: the one that the host saw on its clock next.
    reads: Vec<(u64, u64)>,
    asked: Vec<Asked>,
    /// A limit that is exceeded at a time.
    over: Option<(u64, Limit)>,
    /// The supervisor has said so, or it is gone.
    told: Option<Limit>,
    lost_ns: Option<u64>,
    /// Time at which the host is told to end.
    interrupted_ns: Option<u64>,
    grace_ns: u64,
    report: Option<Report>,
}

/// The other end of a [`Transport`].
#[derive(Clone)]
struct World(Rc<RefCell<State>>);

impl World {
    fn new(seed: u64) -> Self {
        let mut dice = Dice(seed);
        let now_ns = 1 + dice.below(1 << 40);
        let lost = dice.one_in(12).then(|| now_ns + dice.below(60 * MS));
        let interrupted = dice.one_in(12).then(|| now_ns + dice.below(200 * MS));
        Self(Rc::new(RefCell::new(State {
            dice,
            now_ns,
            turns: 0,
            input: Vec::new(),
            input_open: true,
            pieces: VecDeque::new(),
            errors: VecDeque::new(),
            busy_ns: now_ns,
            closes_ns: None,
            end: None,
            written: Vec::new(),
            written_bytes: 0,
            half: false,
            idle_bytes: 0,
            errors_read: 0,
            read_bytes: 0,
            reads: Vec::new(),
            asked: Vec::new(),
            over: None,
            told: None,
            lost_ns: lost,
            interrupted_ns: interrupted,
            grace_ns: 0,
            report: None,
        })))
    }
}

impl State {
    fn turn(&mut self) {
        self.turns += 1;
        assert!(self.turns < TURNS, "it hangs");
        self.supervise();
    }

    /// The supervisor ends a plugin that is over a limit when its grace is over.
    fn supervise(&mut self) {
        if let Some((at_ns, limit)) = self.over
            && self.now_ns >= at_ns + self.grace_ns
            && self
                .lost_ns
                .is_none_or(|lost_ns| lost_ns > at_ns + self.grace_ns)
        {
            self.kill(at_ns + self.grace_ns, Some(limit));
        }
    }

    /// The supervisor has gone, and not because it had reported.
    fn is_lost(&self) -> bool {
        let reported = self
            .report
            .as_ref()
            .is_some_and(|report| *report != Report::default());
        !reported && self.lost_ns.is_some_and(|ns| ns <= self.now_ns)
    }

    /// Nothing more comes of the plugin.
    fn kill(&mut self, at_ns: u64, over: Option<Limit>) {
        if self.report.is_some()
            || self
                .closes_ns
                .is_some_and(|ns| ns <= at_ns && self.end.is_some())
        {
            return;
        }
        self.pieces.retain(|(ns, _)| *ns <= at_ns);
        self.errors.retain(|(ns, _)| *ns <= at_ns);
        self.closes_ns = Some(self.closes_ns.map_or(at_ns, |ns| ns.min(at_ns)));
        self.end = Some(End::Signal(9));
        self.report = Some(Report {
            killed: true,
            over,
            ..Report::default()
        });
    }

    /// Writes a line, or the beginning of one if there is no end.
    fn emit(&mut self, text: &[u8], mut what: What) {
        let begin_of_text = self.written_bytes;
        let mut begin = begin_of_text;
        let mut end = begin + text.len() as u64;
        if self.half {
            // What was begun is not completed by another line, but for one.
            let completes = text.first().is_some_and(u8::is_ascii_digit);
            if let Some(half) = self.written.pop() {
                begin = half.begin;
            }
            if !completes {
                what = What::Broken;
                // It is read up to its own end.
                let newline = text.iter().position(|byte| *byte == b'\n');
                end = newline.map_or(end, |at| begin_of_text + at as u64 + 1);
            }
        }
        self.half = !text.ends_with(b"\n");
        self.written_bytes += text.len() as u64;
        let mut rest = text;
        while !rest.is_empty() {
            let size = match self.dice.below(3) {
                0 => 1 + self.dice.below(8) as usize,
                1 => 1 + self.dice.below(200) as usize,
                _ => rest.len(),
            };
            let (piece, more) = rest.split_at(size.min(rest.len()));
            self.pieces.push_back((self.busy_ns, piece.to_vec()));
            rest = more;
            if !rest.is_empty() {
                self.busy_ns += self.dice.pause(20_000);
            }
        }
        self.written.push(Written {
            what,
            begin,
            end,
            at_ns: self.busy_ns,
        });
    }

    fn say(&mut self, text: &str, what: What) {
        self.emit(format!("{text}\n").as_bytes(), what);
    }

    fn idle(&mut self, text: &str) {
        self.idle_bytes += text.len() as u64;
        self.emit(text.as_bytes(), What::Other);
    }

    fn paths(&mut self, agents: usize) -> String {
        let paths: Vec<String> = (0..agents)
            .map(|_| match self.dice.below(3) {
                0 => "\"E.W\"".to_owned(),
                1 => format!("[{},1,2]", self.dice.below(20)),
                _ => "[[0, 0],\t[1,1]]".to_owned(),
            })
            .collect();
        format!("[{}]", paths.join(","))
    }

    fn answer(&mut self, id: u64) {
        let plan = self.dice.one_in(2);
        let paths = if plan {
            format!(",\"paths\":{}", self.paths(STARTS.len()))
        } else {
            String::new()
        };
        // Fields in any order.
        let (id_field, result) = (
            format!("\"id\":{id}"),
            format!("\"result\":{{\"status\":\"gave-up\"{paths}}}"),
        );
        let text = if self.dice.one_in(2) {
            format!("{{\"jsonrpc\":\"2.0\",{id_field},{result}}}")
        } else {
            format!("{{{result},{id_field},\"jsonrpc\":\"2.0\"}}")
        };
        let error = false;
        self.say(&text, What::Answer { id, plan, error });
    }

    fn refuse(&mut self, id: u64) {
        let text = format!(
            "{{\"jsonrpc\":\"2.0\",\"id\":{id},\"error\":{{\"code\":-32603,\"message\":\"no\"}}}}"
        );
        let (plan, error) = (false, true);
        self.say(&text, What::Answer { id, plan, error });
    }

    fn plan(&mut self, agents: usize) {
        let paths = self.paths(agents);
        self.incumbent(&paths, What::Plan { agents });
    }

    fn incumbent(&mut self, paths: &str, what: What) {
        let text = format!(
            "{{\"jsonrpc\":\"2.0\",\"method\":\"incumbent\",\"params\":{{\"paths\":{paths}}}}}"
        );
        self.say(&text, what);
    }

    fn close(&mut self, end: Option<End>) {
        self.closes_ns = Some(self.busy_ns);
        self.end = end;
    }

    /// The plugin has read a request and does something about it.
    fn react(&mut self, id: u64, method: &str, deadline_ns: Option<u64>) {
        self.busy_ns = self.busy_ns.max(self.now_ns) + self.dice.pause(200_000);
        if self.closes_ns.is_some() {
            return;
        }
        if method != "plan" {
            if self.dice.one_in(60) {
                return self.close(Some(End::Code(3)));
            }
            self.answer(id);
            match self.dice.below(30) {
                0 => self.answer(id),
                1 => self.answer(id + 1),
                2 => {
                    let step = self.dice.below(1 << 20);
                    self.answer(id + step);
                }
                3 => self.plan(STARTS.len()),
                4 => self.emit(
                    br#"{"jsonrpc":"2.0","result":{"status":"gave-up"},"id":"#,
                    What::Other,
                ),
                _ => {}
            }
            return;
        }
        if self.half && self.dice.one_in(2) {
            let (plan, error) = (false, false);
            self.say(&format!("{id}}}"), What::Answer { id, plan, error });
        }
        for _ in 0..self.dice.below(8) {
            self.busy_ns += self.dice.pause(MS);
            if self.dice.one_in(10) {
                // Just before the deadline, or before the grace is over.
                let before_ns = self.dice.below(MS / 4);
                let end_ns = deadline_ns.unwrap_or_default() + self.grace_ns * self.dice.below(2);
                self.busy_ns = self.busy_ns.max(end_ns.saturating_sub(before_ns));
            }
            match self.dice.below(16) {
                0..6 => self.plan(STARTS.len()),
                6 => self.say(
                    r#"{"jsonrpc":"2.0","method":"metric","params":{"name":"n","value":1}}"#,
                    What::Other,
                ),
                7 => self.say(
                    r#"{"jsonrpc":"2.0","method":"log","params":{"level":"info","text":"t"}}"#,
                    What::Other,
                ),
                8 => self.idle("\n \r\n\n"),
                9 => self.idle("printed by a library\n"),
                10 => {
                    let size = self.dice.below(3000);
                    self.idle_bytes += size;
                    self.errors
                        .push_back((self.busy_ns, vec![b'e'; size as usize]));
                }
                11 if self.dice.one_in(4) => self.plan(STARTS.len() + 1),
                12 if self.dice.one_in(4) => self.say("{\"jsonrpc\":}", What::Broken),
                13 if self.dice.one_in(4) => {
                    let step = 1 + self.dice.below(9);
                    self.answer(id + step);
                }
                14 if self.dice.one_in(4) => self.incumbent("[[0,{}],[7]]", What::Broken),
                15 if self.dice.one_in(4) => {
                    let blanks = " ".repeat(50_000);
                    let agents = STARTS.len();
                    self.incumbent(&format!("[[0],{blanks}[7]]"), What::Plan { agents });
                }
                _ => {}
            }
        }
        self.busy_ns += self.dice.pause(MS);
        if self.dice.one_in(10) && self.over.is_none() {
            let limit = [Limit::Cpu, Limit::Memory, Limit::Disk][self.dice.below(3) as usize];
            let at_ns = self.now_ns + self.dice.below(30 * MS);
            self.over = Some((at_ns, limit));
        }
        match self.dice.below(20) {
            0 => self.close(Some(End::Code(0))),
            1 => self.close(Some(End::Signal(11))),
            2 => self.close(None),
            3 => {}
            4 => self.emit(br#"{"jsonrpc":"2.0","id":"#, What::Other),
            5 => self.refuse(id),
            6 => {
                self.answer(id);
                self.answer(id);
            }
            7 => {
                self.answer(id);
                self.plan(STARTS.len());
            }
            8 => {
                self.answer(id);
                self.close(Some(End::Code(0)));
            }
            _ => self.answer(id),
        }
    }

    /// The plugin takes whole lines of its input.
    fn take_input(&mut self) {
        while let Some(end) = self.input.iter().position(|byte| *byte == b'\n') {
            let line: Vec<u8> = self.input.drain(..=end).collect();
            let message: serde_json::Value = serde_json::from_slice(&line).expect("a message");
            let method = message["method"].as_str().expect("a method").to_owned();
            match message["id"].as_u64() {
                Some(id) => {
                    let deadline_ns = message["params"]["budget"]["deadline_monotonic_ns"].as_u64();
                    self.react(id, &method, deadline_ns);
                }
                None if method == "exit" && self.closes_ns.is_none() => {
                    self.busy_ns = self.busy_ns.max(self.now_ns);
                    self.close(Some(End::Code(0)));
                }
                None => {}
            }
        }
    }

    /// A request of which the host writes the first byte now.
    fn note_request(&mut self, bytes: &[u8]) {
        let text = String::from_utf8_lossy(bytes);
        for part in text.split("\"jsonrpc\":\"2.0\",\"id\":").skip(1) {
            let Some((id, rest)) = part.split_once(",\"method\":\"") else {
                continue;
            };
            let id: u64 = id.parse().expect("a number");
            if self.asked.last().is_none_or(|asked| asked.id < id) {
                self.asked.push(Asked {
                    id,
                    read: self.read_bytes,
                    deadline_ns: rest
                        .split_once("\"deadline_monotonic_ns\":")
                        .and_then(|(_, rest)| rest.split(',').next()?.parse().ok()),
                });
            }
        }
    }

    /// Time at which the host read up to an offset, by its own clock.
    fn read_at(&self, offset: u64) -> Option<u64> {
        let reads = self.reads.iter();
        let mut reads = reads.filter(|(read, _)| *read >= offset);
        reads.next().map(|(_, at_ns)| *at_ns)
    }
}

impl Transport for World {
    fn now_ns(&self) -> u64 {
        let mut state = self.0.borrow_mut();
        let stall = if state.dice.one_in(100) { 5 * MS } else { 2000 };
        state.now_ns += state.dice.below(stall);
        let (read, now_ns) = (state.read_bytes, state.now_ns);
        if state.reads.last().is_none_or(|(last, _)| *last < read) {
            state.reads.push((read, now_ns));
        }
        now_ns
    }

    fn secret(&mut self) -> u64 {
        self.0.borrow_mut().dice.next()
    }

    fn wait(&mut self, interest: Interest, most_ns: u64) {
        let mut state = self.0.borrow_mut();
        state.turn();
        let mut until = state.now_ns.saturating_add(most_ns);
        if interest.stdin {
            until = state.now_ns;
        }
        let closes = state.closes_ns;
        for (wanted, pieces) in [
            (interest.stdout, &state.pieces),
            (interest.stderr, &state.errors),
        ] {
            let next = pieces.front().map(|(ns, _)| *ns).or(closes);
            until = until.min(next.filter(|_| wanted).unwrap_or(until));
        }
        let said = state
            .over
            .map(|(ns, _)| ns)
            .filter(|_| state.told.is_none());
        let gone = state.lost_ns.filter(|_| state.report.is_none());
        until = until.min(said.unwrap_or(until)).min(gone.unwrap_or(until));
        until = until.min(state.interrupted_ns.unwrap_or(until));
        if state.dice.one_in(20) && until > state.now_ns {
            let most_ns = until - state.now_ns;
            until = state.now_ns + state.dice.below(most_ns);
        }
        state.now_ns = state.now_ns.max(until);
        state.supervise();
        let now_ns = state.now_ns;
        if let Some((at_ns, limit)) = state.over.filter(|(ns, _)| *ns <= now_ns)
            && state.grace_ns > 0
            && state.lost_ns.is_none_or(|lost_ns| lost_ns > at_ns)
        {
            state.told = Some(limit);
        }
        if state.lost_ns.is_some_and(|ns| ns <= now_ns) && state.report.is_none() {
            state.report = Some(Report::default());
        }
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut state = self.0.borrow_mut();
        state.turn();
        state.note_request(bytes);
        match state.dice.below(10) {
            0 => return Err(io::ErrorKind::Interrupted.into()),
            1 => return Err(io::ErrorKind::WouldBlock.into()),
            _ => {}
        }
        let gone = state.closes_ns.is_some_and(|ns| ns <= state.now_ns) && state.end.is_some();
        if gone || !state.input_open {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        let size = match state.dice.below(3) {
            0 => 1 + state.dice.below(bytes.len() as u64) as usize,
            _ => bytes.len(),
        };
        state.input.extend_from_slice(&bytes[..size]);
        state.take_input();
        Ok(size)
    }

    fn close_stdin(&mut self) {
        self.0.borrow_mut().input_open = false;
    }

    fn read(&mut self, output: Output, buffer: &mut [u8]) -> io::Result<usize> {
        let mut state = self.0.borrow_mut();
        state.turn();
        if state.dice.one_in(20) {
            return Err(io::ErrorKind::Interrupted.into());
        }
        let most = 1 + state.dice.below(4000) as usize;
        let most = most.min(buffer.len());
        let State {
            pieces,
            errors,
            now_ns,
            closes_ns,
            ..
        } = &mut *state;
        let pieces = match output {
            Output::Stdout => pieces,
            Output::Stderr => errors,
        };
        let mut read = 0;
        while read < most
            && let Some((_, piece)) = pieces.front_mut().filter(|(ns, _)| ns <= now_ns)
        {
            let part = piece.len().min(most - read);
            buffer[read..read + part].copy_from_slice(&piece[..part]);
            piece.drain(..part);
            read += part;
            if piece.is_empty() {
                pieces.pop_front();
            }
        }
        if read == 0 && (!pieces.is_empty() || closes_ns.is_none_or(|ns| ns > *now_ns)) {
            return Err(io::ErrorKind::WouldBlock.into());
        }
        match output {
            Output::Stdout => state.read_bytes += read as u64,
            Output::Stderr => state.errors_read += read as u64,
        }
        Ok(read)
    }

    fn begin(&mut self, _: CallLimits, grace: Duration) {
        let mut state = self.0.borrow_mut();
        state.grace_ns = grace.as_nanos() as u64;
        state.told = None;
    }

    fn finish(&mut self) -> Option<CallUsage> {
        let mut state = self.0.borrow_mut();
        state.turn();
        state.now_ns += state.dice.below(MS);
        if state.lost_ns.is_some_and(|ns| ns <= state.now_ns) {
            state.report.get_or_insert_default();
            return None;
        }
        Some(CallUsage::default())
    }

    fn interrupted(&self) -> bool {
        let state = self.0.borrow();
        state.interrupted_ns.is_some_and(|ns| ns <= state.now_ns)
    }

    fn over(&self) -> Option<Limit> {
        let state = self.0.borrow();
        let report = state.report.as_ref();
        report.and_then(|report| report.over).or(state.told)
    }

    fn give_up(&mut self, reason: String) {
        unreachable!("a pipe of this world failed: {reason}");
    }

    fn sandbox(&self) -> Option<&SandboxReport> {
        None
    }

    fn disturbed(&self) -> Option<String> {
        let state = self.0.borrow();
        // It is noticed when it is looked for.
        let noticed = state.is_lost() && state.report.is_some();
        noticed.then(|| "it was played so".into())
    }

    fn end(&mut self, patience: Duration) -> Report {
        let mut state = self.0.borrow_mut();
        state.turn();
        let until = state.now_ns.saturating_add(patience.as_nanos() as u64);
        if state.lost_ns.is_some_and(|ns| ns <= state.now_ns) {
            state.report.get_or_insert_default();
        }
        if state.report.is_none()
            && let (Some(closes_ns), Some(end)) = (state.closes_ns, state.end)
            && closes_ns <= until
        {
            state.now_ns = state.now_ns.max(closes_ns);
            let (code, signal) = match end {
                End::Code(code) => (Some(code), None),
                End::Signal(signal) => (None, Some(signal)),
            };
            state.report = Some(Report {
                code,
                signal,
                ..Report::default()
            });
        }
        if state.report.is_none() {
            state.now_ns = until;
            if state.lost_ns.is_some_and(|ns| ns <= until) {
                state.report = Some(Report::default());
            }
            let over = state
                .over
                .filter(|(ns, _)| *ns <= until)
                .map(|(_, limit)| limit);
            state.kill(until, over);
        }
        state.report.clone().unwrap_or_default()
    }
}

// ---- What may come of it -------------------------------------------------------------

/// The sum of the lines that the host read in a call.
#[derive(Debug, PartialEq)]
enum Expectation {
    /// One of them breaks the protocol.
    Broken,
    /// One is the answer: an error, or not, and whether a plan in it is in time.
    Answered { error: bool, arrives: Option<bool> },
    /// None is.
    Nothing,
}

/// A session that is played, and how far its lines were taken.
struct Play {
    world: World,
    client: Client<World>,
    grace_ns: u64,
    /// Lines that earlier calls took.
    taken: usize,
    /// Requests that were made.
    calls: usize,
    /// The ends of calls for a plan.
    ends: Vec<Termination>,
}

impl Play {
    fn new(seed: u64) -> Self {
        let world = World::new(seed);
        let grace = if seed.is_multiple_of(3) { 10 * MS } else { 0 };
        let limits = Limits {
            grace: Duration::from_nanos(grace),
            output_bytes: OUTPUT,
            ..Limits::default()
        };
        let client = Client::new(world.clone(), limits);
        Self {
            client,
            world,
            grace_ns: grace,
            taken: 0,
            calls: 0,
            ends: Vec::new(),
        }
    }

    /// The sum of the next call's lines, the times at which its plans were read, and how
    /// many of them were late.
    fn expect(&mut self, deadline_ns: u64, plans: bool) -> (Expectation, Vec<u64>, u64) {
        let state = self.world.0.borrow();
        let asked = state.asked.get(self.calls);
        self.calls += 1;
        // What was never asked was not answered.
        let (id, before) = asked.map_or((0, u64::MAX), |asked| (asked.id, asked.read));
        let until_ns = deadline_ns + self.grace_ns;
        let (mut times, mut late) = (Vec::new(), 0);
        while let Some(line) = state.written.get(self.taken) {
            let open = state.half && self.taken + 1 == state.written.len();
            let Some(at_ns) = state.read_at(line.end).filter(|_| !open) else {
                break;
            };
            let foreseen = at_ns < line.at_ns && line.what != What::Broken;
            assert!(!foreseen, "it was read before it was written");
            let early = line.begin < before;
            if !early && at_ns >= until_ns {
                break;
            }
            self.taken += 1;
            let mut arrives = || {
                if at_ns <= deadline_ns {
                    times.push(at_ns);
                } else {
                    late += 1;
                }
            };
            match line.what {
                What::Other => {}
                What::Plan { agents } if !early && plans && agents == STARTS.len() => arrives(),
                What::Answer {
                    id: answered,
                    plan,
                    error,
                } if !early && answered == id => {
                    let arrives = (plan && plans && !error).then(|| {
                        arrives();
                        at_ns <= deadline_ns
                    });
                    return (Expectation::Answered { error, arrives }, times, late);
                }
                What::Plan { .. } | What::Answer { .. } | What::Broken => {
                    return (Expectation::Broken, times, late);
                }
            }
        }
        (Expectation::Nothing, times, late)
    }

    /// The fault is one that the world knows of.
    fn check_fault(&self, fault: Option<&Fault>, expected: &Expectation, until_ns: u64) {
        let state = self.world.0.borrow();
        let lost = state.is_lost();
        let over = |limit| {
            let over = state.over;
            over.is_some_and(|(ns, of)| ns <= state.now_ns && of == limit)
        };
        let read_all = state.pieces.is_empty() && state.closes_ns.is_some();
        let right = match (expected, fault) {
            (_, Some(Fault::Unsupervised { .. })) => lost,
            (Expectation::Answered { error: false, .. }, None)
            | (Expectation::Answered { error: true, .. }, Some(Fault::Reported { .. }))
            | (Expectation::Broken, Some(Fault::Protocol { .. })) => true,
            (
                Expectation::Answered { .. },
                Some(Fault::OverLimit {
                    limit: Limit::Output,
                    ..
                }),
            ) => state.idle_bytes > OUTPUT,
            (Expectation::Nothing, Some(fault)) => match fault {
                Fault::TimedOut { .. } => state.now_ns >= until_ns,
                Fault::Interrupted { .. } => {
                    state.interrupted_ns.is_some_and(|ns| ns <= state.now_ns)
                }
                Fault::OverLimit {
                    limit: Limit::Output,
                    ..
                } => state.idle_bytes > OUTPUT,
                Fault::OverLimit { limit, .. } => over(*limit),
                Fault::Exited { code, .. } => read_all && state.end == Some(End::Code(*code)),
                Fault::Crashed { signal, .. } => {
                    read_all && state.end == Some(End::Signal(*signal))
                }
                Fault::Protocol { reason, .. } => read_all && reason.contains("went on running"),
                _ => false,
            },
            (Expectation::Nothing, None)
            | (Expectation::Answered { .. } | Expectation::Broken, _) => false,
        };
        assert!(right, "{expected:?} is {fault:?}");
        let evaded = fault.is_none() && state.errors_read > OUTPUT;
        assert!(!evaded, "a limit is evaded in silence");
        // Half a second for a plugin that closed its output, and whatever the host stalls.
        let most_ns = until_ns + 500 * MS + 100 * MS;
        assert!(state.now_ns <= most_ns, "it took too long");
    }

    /// A call that asks for no plan; it may be the last one.
    fn ask(&mut self, method: &str) -> Option<()> {
        let deadline = Deadline::after(self.client.now_ns(), Duration::from_millis(50));
        let asked = self.client.ask(method, (), deadline);
        let (expected, ..) = self.expect(deadline.at_ns, false);
        let until_ns = deadline.at_ns + self.grace_ns;
        self.check_fault(asked.as_ref().err(), &expected, until_ns);
        asked.ok().map(drop)
    }

    /// A call that asks for a plan.
    fn plan(&mut self) {
        let passable = vec![1; (ROWS * COLS) as usize];
        let grid = GridEnvironment::four_connected(ROWS, COLS, passable).into();
        let instance = Instance::one_shot(STARTS.to_vec(), STARTS.to_vec());
        let wall_ns = (30 + self.world.0.borrow_mut().dice.below(60)) * MS;
        let budget = Budget::lasting(0, wall_ns);
        let broken = self.client.fault().cloned();
        let before = self.world.0.borrow().read_bytes;
        let earliest_ns = self.world.0.borrow().now_ns + wall_ns;
        let call = PlanCall {
            solver: Solver::Planner,
            instance: &instance,
            environment: Some(&grid),
            encoding: PathEncoding::default(),
            wants_annotations: false,
            follower: None,
        };
        let solve = self.client.solve(&call, &budget);
        if broken.is_some() {
            assert_eq!(solve.fault, broken, "nothing is taken after a fault");
            assert!(solve.incumbents.is_empty() && self.world.0.borrow().read_bytes == before);
            return;
        }
        let asked = self.world.0.borrow().asked.get(self.calls).cloned();
        let deadline_ns = asked.and_then(|asked| asked.deadline_ns);
        // One that the plugin was not told was not much later.
        let deadline_ns = deadline_ns.unwrap_or(earliest_ns);
        let (expected, mut times, mut late) = self.expect(deadline_ns, true);
        if let (Expectation::Answered { arrives, .. }, Some(Fault::OverLimit { .. })) =
            (&expected, &solve.fault)
        {
            // It was stopped with its answer.
            match arrives {
                Some(true) => drop(times.pop()),
                Some(false) => late -= 1,
                None => {}
            }
        }
        let until_ns = deadline_ns + self.grace_ns;
        self.check_fault(solve.fault.as_ref(), &expected, until_ns);
        let arrived = solve
            .incumbents
            .iter()
            .map(|plan| plan.arrived.as_nanos() as u64);
        let began_ns = deadline_ns.saturating_sub(wall_ns);
        let counted: Vec<u64> = times.iter().map(|at_ns| at_ns - began_ns).collect();
        assert_eq!(
            arrived.collect::<Vec<_>>(),
            counted,
            "the plans that counted"
        );
        assert_eq!(solve.late, late);
        assert!(solve.incumbents.iter().all(|plan| plan.plan.is_some()));
        let in_time = solve.termination != Termination::TimedOut;
        match &solve.fault {
            None => assert!(in_time || (times.is_empty() && late > 0)),
            Some(fault) => assert_eq!(solve.termination, Termination::from(fault)),
        }
        self.ends.push(solve.termination);
        let state = self.world.0.borrow();
        match solve.limit {
            None => {}
            Some(Limit::Wall) => assert!(state.now_ns >= deadline_ns),
            Some(Limit::Output) => assert!(state.idle_bytes > OUTPUT),
            Some(limit) => assert_eq!(state.over.map(|(_, limit)| limit), Some(limit)),
        }
        let lost = state.is_lost();
        assert!(
            !lost || solve.termination != Termination::Completed,
            "nobody watched"
        );
    }
}

/// Plays a session; how its calls for a plan ended.
fn play(seed: u64) -> Vec<Termination> {
    let mut play = Play::new(seed);
    let introduced = ["initialize", "create", "prepare"];
    let ready = introduced
        .into_iter()
        .try_for_each(|method| play.ask(method));
    if ready.is_some() {
        for _ in 0..4 {
            play.plan();
        }
    }
    play.client.shut_down(Duration::from_millis(20));
    let held = play.client.held_bytes();
    assert!(held < 1 << 20, "{held} bytes are held");
    play.ends
}

#[test]
fn whatever_the_order_of_things_a_call_ends_rightly() {
    let number = |name| -> Option<u64> { std::env::var(name).ok()?.parse().ok() };
    let seeds = match (number("FLEETYARD_SEED"), number("FLEETYARD_SEEDS")) {
        (Some(seed), _) => seed..seed + 1,
        (None, seeds) => 0..seeds.unwrap_or(SEEDS),
    };
    let mut ends: BTreeMap<Termination, usize> = BTreeMap::new();
    let many = seeds.end - seeds.start >= SEEDS;
    for seed in seeds {
        match std::panic::catch_unwind(|| play(seed)) {
            Ok(ended) => ended
                .into_iter()
                .for_each(|end| *ends.entry(end).or_default() += 1),
            Err(panic) => {
                eprintln!("this was played with FLEETYARD_SEED={seed}");
                std::panic::resume_unwind(panic);
            }
        }
    }
    println!("{ends:?}");
    // All but what a plugin claims that can do nothing.
    assert!(!many || ends.len() == 8, "{ends:?}");
}

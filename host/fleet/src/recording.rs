//! Recordings: what plugins answered in a run, so that it can be had again without them.
//!
//! A file of lines, each a JSON object: the header, then one line per call in the order
//! in which answers took effect, then the end if the run came to one. A host that is
//! killed leaves at most a torn last line, which is left out.

use std::fs::File;
use std::io::{BufRead, BufReader, BufWriter, Read, Seek, SeekFrom, Write};
use std::ops::RangeInclusive;
use std::path::Path;

use fleetyard_abi::{Assignment, Kept, Kind, Motion};
use fleetyard_core::json::{format, read_object};
use fleetyard_core::{Digest, GridPlan, InputError, create_output, moves, open_regular, unmarked};
use fleetyard_sim::trace::By;
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::Value;

use crate::{EventKind, FleetConfig, Intervened, ModuleInfo};

/// The format's name in the first line.
pub const RECORDING_FORMAT: &str = "fleetyard.fleet-recording/1";

/// Possible durations of a call, in milliseconds: no run takes longer than a year.
const CALL_MS: RangeInclusive<f64> = 0.0..=366.0 * 86_400_000.0;

/// The longest line that is read: a batch of a million robots.
const LINE_LIMIT: u64 = 1 << 30;

/// Most interventions of a run that are read.
const INTERVENTIONS: usize = 1 << 20;

const HINT: &str = "a recording is written by `fleetyard fleet --record FILE`";

/// Something that went wrong in a call.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Notice {
    /// The kind.
    pub kind: EventKind,
    /// The culprit: the identifier of a plugin, or `host`.
    pub module: String,
    /// For people.
    pub message: String,
}

/// The first line: what has to be the same for the rest to mean the same.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Header {
    #[serde(deserialize_with = "is_recording")]
    format: String,
    /// Version of the program that wrote it.
    pub fleetyard: String,
    /// Name of the map.
    pub map: String,
    /// Digest of the map.
    pub map_digest: Digest,
    /// Digest of the robots and of the tasks.
    pub ground_digest: Digest,
    /// The plugins.
    pub modules: Vec<ModuleInfo>,
    /// The configuration.
    pub config: FleetConfig,
    /// Further values of the caller.
    #[serde(default)]
    pub setup: Value,
}

impl Header {
    /// Of a run with a map of this name and digest.
    pub fn new(
        (map, map_digest): (String, Digest),
        ground_digest: Digest,
        modules: Vec<ModuleInfo>,
        config: FleetConfig,
        setup: Value,
    ) -> Self {
        Self {
            format: RECORDING_FORMAT.to_owned(),
            fleetyard: env!("CARGO_PKG_VERSION").to_owned(),
            map,
            map_digest,
            ground_digest,
            modules,
            config,
            setup,
        }
    }
}

fn is_recording<'de, D: Deserializer<'de>>(deserializer: D) -> Result<String, D::Error> {
    format(deserializer, RECORDING_FORMAT)?;
    Ok(RECORDING_FORMAT.to_owned())
}

/// The bytes that a module kept in a call.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeptBytes {
    /// The module.
    pub kind: Kind,
    /// Its bytes.
    pub bytes: Kept,
}

/// A call and its answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Round {
    /// Number of the call, from 0.
    pub call: u64,
    /// The block at whose beginning the call was made.
    pub block: u64,
    /// The block at whose beginning the answer took effect.
    pub effect: u64,
    /// Digest of the state that was asked about.
    pub state: Digest,
    /// The window of the instance.
    pub window_steps: u32,
    /// The motion by which the plan was judged.
    pub motion: Motion,
    /// Tasks that were given to agents.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub assignments: Vec<Assignment>,
    /// The author of the plan.
    pub by: By,
    /// The plan, a string of moves per agent from where the state has it; absent if there
    /// is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub paths: Option<Vec<String>>,
    /// Wall-clock time of the planner, if it was asked.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub planner_ms: Option<f64>,
    /// Processor time of the planner, if it was asked and that is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub planner_cpu_ms: Option<f64>,
    /// The same since the planner's call before, until this one began.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub planner_cpu_before_ms: Option<f64>,
    /// Expansions of the planner's search, as it says; absent if it says nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub expansions: Option<f64>,
    /// Robots that the planner says it holds back; absent if it says nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub held_back: Option<f64>,
    /// Wall-clock time of the fail policy, if it was asked.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub recovery_ms: Option<f64>,
    /// Bytes that modules kept, where they are others than before.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub kept: Vec<KeptBytes>,
    /// Faults and other events.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notices: Vec<Notice>,
    /// Line of the file; 0 for a record that was not read.
    #[serde(skip)]
    pub line: u64,
}

/// The strings that a plan is recorded as.
pub(crate) fn to_moves(plan: &GridPlan, cols: u32) -> Option<Vec<String>> {
    plan.paths().map(|path| moves::encode(path, cols)).collect()
}

/// The plan of strings from where agents start.
pub(crate) fn from_moves(
    paths: &[String],
    starts: &[u32],
    rows: u32,
    cols: u32,
) -> Result<GridPlan, String> {
    if paths.len() != starts.len() {
        return Err(format!(
            "there are {} paths for {} agents",
            paths.len(),
            starts.len()
        ));
    }
    let mut plan = GridPlan::with_capacity(paths.len(), 0);
    for (agent, (path, start)) in paths.iter().zip(starts).enumerate() {
        let cells = moves::decode(*start, path, rows, cols)
            .map_err(|error| format!("the path of agent {agent}: {error}"))?;
        plan.push_path(cells);
    }
    Ok(plan)
}

/// The last line of a run that ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct End {
    /// The number of blocks that were executed.
    pub blocks: u64,
    /// Digest of everything that happened.
    pub trace_digest: Digest,
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Line {
    Round(Box<Round>),
    Intervened(Intervened),
    End(End),
}

#[derive(Serialize)]
#[serde(rename_all = "kebab-case")]
enum LineRef<'a> {
    Round(&'a Round),
    Intervened(&'a Intervened),
    End(&'a End),
}

/// Writes a recording, line by line, each of them at once.
#[derive(Debug)]
pub struct Recorder {
    name: String,
    file: BufWriter<File>,
}

impl Recorder {
    /// Begins a new file.
    pub fn create(path: &Path, header: &Header) -> Result<Self, InputError> {
        let file = create_output(path).map_err(|error| {
            cannot_write(&path.display().to_string(), &error)
                .hint("does its folder exist, and may you write to it?")
        })?;
        let mut recorder = Self {
            name: path.display().to_string(),
            file: BufWriter::new(file),
        };
        recorder.write(header)?;
        Ok(recorder)
    }

    /// Goes on with a file after its last call; its end and a torn line are cut off.
    pub fn go_on(path: &Path, recording: &Recording) -> Result<Self, InputError> {
        let name = path.display().to_string();
        let open = || {
            let mut file = File::options().write(true).open(path)?;
            file.set_len(recording.bytes)?;
            file.seek(SeekFrom::End(0))?;
            Ok(file)
        };
        match open() {
            Ok(file) => Ok(Self {
                name,
                file: BufWriter::new(file),
            }),
            Err(error) => Err(cannot_write(&name, &error)),
        }
    }

    /// Appends a call.
    pub fn round(&mut self, round: &Round) -> Result<(), InputError> {
        self.write(&LineRef::Round(round))
    }

    /// Appends an intervention.
    pub fn intervened(&mut self, intervened: &Intervened) -> Result<(), InputError> {
        self.write(&LineRef::Intervened(intervened))
    }

    /// Appends the end.
    pub fn end(&mut self, end: &End) -> Result<(), InputError> {
        self.write(&LineRef::End(end))
    }

    fn write(&mut self, line: &impl Serialize) -> Result<(), InputError> {
        let mut write = || -> std::io::Result<()> {
            serde_json::to_writer(&mut self.file, line)?;
            self.file.write_all(b"\n")?;
            self.file.flush()
        };
        write().map_err(|error| cannot_write(&self.name, &error))
    }
}

fn cannot_write(name: &str, error: &std::io::Error) -> InputError {
    InputError::new(name, format!("cannot be written: {error}"))
}

/// A recording that was looked through: every line is one.
#[derive(Debug)]
pub struct Recording {
    name: String,
    header: Header,
    file: BufReader<File>,
    /// Offset of the first call in the file, and the end of the last one, in bytes.
    first: u64,
    bytes: u64,
    line: u64,
    rounds: u64,
    /// The block at whose beginning the last answer took effect.
    effect: u64,
    interventions: Vec<Intervened>,
    end: Option<End>,
    torn: bool,
}

impl Recording {
    /// Reads a recording once, to know that it can be read.
    pub fn open(path: &Path) -> Result<Self, InputError> {
        let name = path.display().to_string();
        let file = open_regular(path)?;
        let mut lines = Lines {
            name: &name,
            file: &mut BufReader::new(file),
            number: 0,
            left: u64::MAX,
        };
        let Some((text, true)) = lines.next()? else {
            return Err(InputError::new(name.as_str(), "this is no recording").hint(HINT));
        };
        let header: Header = read_object(&name, unmarked(&name, &text)?, HINT)?;
        let first = text.len() as u64;
        let (mut bytes, mut rounds, mut end, mut torn) = (first, 0, None, false);
        let mut last: Option<(u64, u64)> = None;
        let mut interventions: Vec<Intervened> = Vec::new();
        while let Some((text, whole)) = lines.next()? {
            if !whole {
                torn = true;
                break;
            }
            let number = lines.number;
            let wrong = |reason: String| {
                InputError::new(name.as_str(), reason)
                    .at_line(number)
                    .hint("the file was changed after it was written")
            };
            if end.is_some() {
                return Err(wrong("the recording goes on after its end".into()));
            }
            match parse(&name, number, &text)? {
                Line::Round(round) => {
                    let follows = last.map_or(round.call == 0, |(call, effect)| {
                        round.call == call + 1 && round.block >= effect
                    });
                    if !follows || round.effect < round.block {
                        return Err(wrong(format!(
                            "call {} at block {} with its effect at block {} does not follow what \
                             was before",
                            round.call, round.block, round.effect
                        )));
                    }
                    for (key, time_ms) in [
                        ("planner_ms", round.planner_ms),
                        ("planner_cpu_ms", round.planner_cpu_ms),
                        ("planner_cpu_before_ms", round.planner_cpu_before_ms),
                        ("recovery_ms", round.recovery_ms),
                    ] {
                        if let Some(time_ms) = time_ms.filter(|time| !CALL_MS.contains(time)) {
                            return Err(wrong(format!(
                                "{key} of call {} is {time_ms}",
                                round.call
                            )));
                        }
                    }
                    last = Some((round.call, round.effect));
                    rounds += 1;
                    bytes += text.len() as u64;
                }
                Line::Intervened(intervened) => {
                    let before = interventions.last().map_or(0, |last| last.block);
                    if intervened.block < before || interventions.len() >= INTERVENTIONS {
                        return Err(wrong(
                            "the intervention does not follow what was before".into(),
                        ));
                    }
                    interventions.push(intervened);
                    bytes += text.len() as u64;
                }
                Line::End(found) => {
                    if last.is_some_and(|(_, effect)| found.blocks < effect) {
                        return Err(wrong("the end is before the last call".into()));
                    }
                    end = Some(found);
                }
            }
        }
        let mut file = open_regular(path)?;
        file.seek(SeekFrom::Start(first))
            .map_err(|error| InputError::new(name.as_str(), format!("cannot be read: {error}")))?;
        Ok(Self {
            header,
            file: BufReader::new(file),
            first,
            bytes,
            line: 1,
            rounds,
            effect: last.map_or(0, |(_, effect)| effect),
            interventions,
            end,
            torn,
            name,
        })
    }

    /// The file's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The header: what has to be the same.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// The same with what of the numbers is a machine's: threads and memory, which decide
    /// about nothing.
    #[must_use]
    pub fn with_host(mut self, config: &FleetConfig) -> Self {
        let sim = &mut self.header.config.sim;
        sim.threads = config.sim.threads;
        sim.memory_limit_bytes = config.sim.memory_limit_bytes;
        self
    }

    /// The number of calls.
    pub fn rounds(&self) -> u64 {
        self.rounds
    }

    /// The block at which the run was that was recorded, as far as the recording says.
    pub(crate) fn last_block(&self) -> u64 {
        self.end.map_or(self.effect, |end| end.blocks)
    }

    /// The interventions, in order.
    pub fn interventions(&self) -> &[Intervened] {
        &self.interventions
    }

    /// The end, if the run came to one.
    pub fn end(&self) -> Option<End> {
        self.end
    }

    /// True if the last line is torn: the host was killed when it wrote it.
    pub fn is_torn(&self) -> bool {
        self.torn
    }

    /// The next call.
    pub(crate) fn next(&mut self) -> Result<Option<Round>, InputError> {
        let mut lines = Lines {
            name: &self.name,
            file: &mut self.file,
            number: self.line,
            left: self.bytes - self.first,
        };
        while let Some((text, _)) = lines.next()? {
            self.line = lines.number;
            self.first += text.len() as u64;
            match parse(&self.name, self.line, &text)? {
                Line::Round(mut round) => {
                    round.line = self.line;
                    return Ok(Some(*round));
                }
                Line::Intervened(_) => {}
                Line::End(_) => break,
            }
        }
        Ok(None)
    }
}

fn parse(name: &str, number: u64, text: &[u8]) -> Result<Line, InputError> {
    read_object(name, text, HINT).map_err(|error| InputError {
        line: Some(number),
        ..error
    })
}

/// Lines of a file that may be of any length and are not to be trusted.
struct Lines<'a> {
    name: &'a str,
    file: &'a mut BufReader<File>,
    /// The number of the line that was read last.
    number: u64,
    /// The number of bytes that may be read.
    left: u64,
}

impl Lines<'_> {
    /// The next line, and whether it is whole.
    fn next(&mut self) -> Result<Option<(Vec<u8>, bool)>, InputError> {
        let mut text = Vec::new();
        let read = self
            .file
            .by_ref()
            .take(self.left.min(LINE_LIMIT))
            .read_until(b'\n', &mut text)
            .map_err(|error| InputError::new(self.name, format!("cannot be read: {error}")))?;
        if read == 0 {
            return Ok(None);
        }
        self.left -= read as u64;
        self.number += 1;
        let whole = text.ends_with(b"\n");
        if !whole && read as u64 == LINE_LIMIT {
            return Err(InputError::new(self.name, "the line is longer than 1 GiB")
                .at_line(self.number)
                .hint(HINT));
        }
        Ok(Some((text, whole)))
    }
}

//! A planner that misbehaves on request, option `fault`, as one can that is written in
//! Rust on the SDK and without unsafe code: it panics, blocks itself, takes memory,
//! threads and files without end, and looks around. The rest is in `faulty.c` and
//! `faulty.py`; the lists of faults are in the README of the folder above. A fixture for
//! tests of the host, and nothing to learn from.
//!
//! With `none` it is honest: the agents go to their goals one after the other while all
//! others stand.

mod mischief;

use std::collections::VecDeque;
use std::time::Duration;

use fleetyard_abi::sdk::{Failure, Options, Planner, Plugin, Rejected, Sink, options_schema};
use fleetyard_abi::{
    Budget, Capabilities, Capability, Descriptor, GridPlan, Instance, Kind, LogLevel, PlanRef,
    Request, SharedEnvironment, Status, monotonic_ns,
};
use schemars::JsonSchema;
use serde::Deserialize;

/// Misbehaves on request.
pub struct Faulty {
    options: FaultyOptions,
}

/// The map, on which an honest plan is made.
pub struct Map {
    cols: usize,
    passable: Vec<u8>,
}

/// The fault. Those of plans and answers are done here, the others in `mischief`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[schemars(inline)]
enum Fault {
    #[default]
    None,
    // Plans and answers.
    Fails,
    Late,
    Twice,
    TooFewAgents,
    ClaimsSolvedWithoutPlan,
    ExitAfterPlan,
    CrashAfter,
    // Time and ends.
    Panic,
    OutOfBounds,
    PanicThread,
    PanicTwice,
    Never,
    Spin,
    Deadlock,
    Abort,
    #[serde(rename = "exit-0")]
    Exit0,
    #[serde(rename = "exit-3")]
    Exit3,
    StackOverflow,
    AllocationTooLarge,
    // Processes, threads, memory.
    Grandchild,
    ThreadBomb,
    SpinThreads,
    Hog,
    Allocate,
    Leak,
    // Output.
    Garbage,
    Flood,
    FloodStderr,
    LogFlood,
    Nan,
    // Files and the environment.
    HugeFile,
    UnlinkedFile,
    ManyFiles,
    WriteOutside,
    RemoveOutside,
    ReadFile,
    ListFolder,
    Getenv,
    ReadEnvironment,
    // Network.
    ConnectTcp,
    ConnectUdp,
    ConnectUnix,
    ConnectAbstract,
}

/// The call that fails.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[schemars(inline)]
enum During {
    Create,
    Prepare,
    #[default]
    Plan,
    Destroy,
}

#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct FaultyOptions {
    /// The fault [default: none].
    fault: Fault,
    /// The call that fails.
    during: During,
    /// Bytes to take or to write; 0 for what the fault is usually done with.
    size: u64,
    /// Most processes, threads or files; 0 for what the fault is usually done with.
    count: u64,
    /// The target of an attempt: a path, HOST:PORT, the name of a variable.
    target: String,
}

impl FaultyOptions {
    /// Does the fault if it is one of the process and of this call.
    fn misbehave(&self, during: During, sink: &dyn Sink) {
        if self.during == during {
            mischief::run(self, sink);
        }
    }
}

/// The sink of `create` and `destroy`, where there is no call to answer.
struct StandardError;

impl Sink for StandardError {
    fn submit_plan(&self, _: PlanRef<'_>) -> Result<(), Rejected> {
        Err(Rejected::Malformed)
    }

    fn submit_request(&self, _: &Request) -> Result<(), Rejected> {
        Err(Rejected::Malformed)
    }

    fn note(&self, name: &str, text: &str) {
        eprintln!("faulty: {name}: {text}");
    }

    fn metric(&self, name: &str, value: f64) {
        eprintln!("faulty: {name} = {value}");
    }

    fn log(&self, _: LogLevel, text: &str) {
        eprintln!("faulty: {text}");
    }

    fn progress(&self, _: u64, _: u64) {}

    fn cancelled(&self) -> bool {
        false
    }
}

impl Plugin for Faulty {
    fn descriptor() -> Descriptor {
        Descriptor {
            name: "Faulty in Rust".into(),
            version: env!("CARGO_PKG_VERSION").into(),
            license: env!("CARGO_PKG_LICENSE").into(),
            capabilities: Capabilities::of(&[
                Capability::Grid,
                Capability::Pebble,
                Capability::Deterministic,
            ]),
            options_schema: options_schema::<FaultyOptions>(),
            ..Descriptor::new(
                Kind::Planner,
                "faulty-rust",
                "Misbehaves on request. For tests of the host.",
            )
        }
    }

    fn create(options: Options<'_>) -> Result<Self, Failure> {
        let options: FaultyOptions = options.parse()?;
        options.misbehave(During::Create, &StandardError);
        Ok(Self { options })
    }
}

impl Planner for Faulty {
    type Map = Map;

    fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        _: &Budget,
        sink: &dyn Sink,
    ) -> Result<Map, Failure> {
        self.options.misbehave(During::Prepare, sink);
        let grid = environment.grid().filter(|grid| grid.connectivity == 4);
        let grid =
            grid.ok_or_else(|| Failure::new(Status::Unsupported, "grids with 4 neighbours only"))?;
        Ok(Map {
            cols: grid.cols as usize,
            passable: grid.passable.clone(),
        })
    }

    fn plan(
        &mut self,
        map: &mut Map,
        instance: &Instance,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        self.options.misbehave(During::Plan, sink);
        let fault = match self.options.during {
            During::Plan => self.options.fault,
            _ => Fault::None,
        };
        match fault {
            Fault::Fails => return Err(Failure::new(Status::InternalError, "failed as asked")),
            Fault::ClaimsSolvedWithoutPlan => return Ok(()),
            Fault::Late => {
                let now = monotonic_ns();
                let left = budget.deadline_monotonic_ns.saturating_sub(now);
                std::thread::sleep(Duration::from_nanos(left) + Duration::from_millis(500));
            }
            _ => {}
        }
        let mut paths = map.honest(instance)?;
        if fault == Fault::TooFewAgents {
            paths.pop();
        }
        let plan = GridPlan::from_paths(paths);
        sink.submit(&plan)?;
        match fault {
            Fault::Twice => sink.submit(&plan)?,
            Fault::ExitAfterPlan => std::process::exit(0),
            Fault::CrashAfter => {
                std::thread::spawn(|| {
                    std::thread::sleep(Duration::from_millis(100));
                    std::process::abort();
                });
            }
            _ => {}
        }
        Ok(())
    }
}

impl Drop for Faulty {
    fn drop(&mut self) {
        if self.options.fault == Fault::CrashAfter {
            // So that the thread has its time.
            std::thread::sleep(Duration::from_secs(1));
        }
        self.options.misbehave(During::Destroy, &StandardError);
    }
}

impl Map {
    /// One agent after the other goes to its last goal, whoever has a way.
    fn honest(&self, instance: &Instance) -> Result<Vec<Vec<u32>>, Failure> {
        let mut paths: Vec<Vec<u32>> = instance.starts.iter().map(|start| vec![*start]).collect();
        let mut waiting: Vec<usize> = (0..paths.len()).collect();
        while !waiting.is_empty() {
            let before = waiting.len();
            waiting.retain(|agent| {
                let goal = instance.goals[*agent].last().copied();
                let standing: Vec<u32> = paths.iter().filter_map(|p| p.last().copied()).collect();
                let way = goal.and_then(|goal| self.way(&standing, standing[*agent], goal));
                let Some(way) = way else { return true };
                for (other, path) in paths.iter_mut().enumerate() {
                    if other == *agent {
                        path.extend(&way);
                    } else {
                        path.extend(std::iter::repeat_n(standing[other], way.len()));
                    }
                }
                false
            });
            if waiting.len() == before {
                return Err(Failure::new(Status::GaveUp, "too crowded for this planner"));
            }
        }
        Ok(paths)
    }

    /// The steps of a shortest way around those that stand, by breadth-first search.
    fn way(&self, standing: &[u32], start: u32, goal: u32) -> Option<Vec<u32>> {
        let mut came_from = vec![None; self.passable.len()];
        *came_from.get_mut(start as usize)? = Some(start);
        let mut queue = VecDeque::from([start]);
        while let Some(cell) = queue.pop_front() {
            if cell == goal {
                let mut way = vec![cell];
                while let Some(before) = came_from[way[way.len() - 1] as usize] {
                    if before == way[way.len() - 1] {
                        break;
                    }
                    way.push(before);
                }
                way.pop();
                way.reverse();
                return Some(way);
            }
            let (at, col) = (cell as usize, cell as usize % self.cols);
            let near = [
                at.checked_sub(self.cols),
                (col + 1 < self.cols).then_some(at + 1),
                Some(at + self.cols).filter(|next| *next < self.passable.len()),
                (col > 0).then(|| at - 1),
            ];
            for next in near.into_iter().flatten() {
                let free = self.passable[next] != 0 && !standing.contains(&(next as u32));
                if free && came_from[next].is_none() {
                    came_from[next] = Some(cell);
                    queue.push_back(next as u32);
                }
            }
        }
        None
    }
}

fleetyard_abi::export! { planners: [Faulty] }

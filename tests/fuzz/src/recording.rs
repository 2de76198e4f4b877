//! Recordings of fleets: read, written again, gone on with, and replayed.

use std::cell::Cell;
use std::fs;
use std::io::Write;
use std::path::Path;
use std::sync::{Arc, LazyLock};

use fleetyard_bench::Robots;
use fleetyard_core::formats::{TaskList, read_lorr_tasks};
use fleetyard_core::{Grid, read_map};
use fleetyard_fleet::{FleetError, FleetOutcome, Ground, Recorder, Recording, Watch, replay};
use tempfile::TempDir;

use super::check_error;

/// Twenty cells, and the same with roles.
const OPEN: &[u8] = b"type octile\nheight 4\nwidth 5\nmap\n.....\n.@.@.\n.....\n....@\n";
const ROLES: &[u8] = b"type octile\nheight 4\nwidth 5\nmap\nw...e\n.@.@.\ne...w\n....@\n";

const TASKS: &[u8] = b"3\n0,4\n10,2\n14,15\n";

/// A replay is broken off after so many blocks, each of which has at most so many ticks:
/// a recording may be of a year.
const BLOCKS: u32 = 150;
const TICKS: f64 = 20.0;

/// Of more tasks than this per robot the list alone is most of the time.
const REVEAL: f64 = 100.0;

struct Place {
    grid: Arc<Grid>,
    tasks: Option<TaskList>,
}

/// The maps and tasks with which seeds were recorded.
static PLACES: LazyLock<Vec<Place>> = LazyLock::new(|| {
    let place = |name: &str, map: &[u8], tasks: Option<&[u8]>| {
        let grid = Arc::new(read_map(name, map).expect("a map"));
        let tasks = tasks.map(|tasks| read_lorr_tasks("a.tasks", tasks, &grid).expect("tasks"));
        Place { grid, tasks }
    };
    vec![
        place("a.map", OPEN, None),
        place("a.map", OPEN, Some(TASKS)),
        place("r.map", ROLES, None),
    ]
});

/// Reads a recording, goes on with it, and replays it on the maps of its name.
pub fn run(data: &[u8]) {
    let folder = TempDir::new().expect("a folder");
    let path = folder.path().join("a.rec");
    fs::write(&path, data).expect("a file");
    let recording = match Recording::open(&path) {
        Ok(recording) => recording,
        Err(error) => return check_error(&error, &path.display().to_string(), data),
    };
    assert!(recording.rounds() as usize <= data.len());
    assert_eq!(recording.is_torn(), !data.ends_with(b"\n"));
    go_on(&path, data, &recording);
    let name = &recording.header().map;
    for place in PLACES.iter().filter(|place| place.grid.name() == name) {
        let [one, other] = [1, 2].map(|threads| replayed(place, &path, data, threads));
        match (one, other) {
            (None, None) => {}
            (Some(Ok(one)), Some(Ok(other))) => same(&one, &other),
            (Some(Err(one)), Some(Err(other))) => {
                assert_eq!(one.to_string(), other.to_string());
                assert!(!matches!(one, FleetError::Broken(_)), "{one}");
            }
            outcomes => panic!("threads make a difference: {outcomes:?}"),
        }
    }
}

/// Whoever goes on with a recording keeps its calls and drops what is behind them.
fn go_on(path: &Path, data: &[u8], recording: &Recording) {
    let copy = path.with_extension("copy");
    fs::write(&copy, data).expect("a file");
    let mut recorder = Recorder::go_on(&copy, recording).expect("it can be written");
    let kept = Recording::open(&copy).expect("what was read before");
    assert_eq!(kept.header(), recording.header());
    assert_eq!(kept.rounds(), recording.rounds());
    assert_eq!((kept.end(), kept.is_torn()), (None, false));
    if let Some(end) = recording.end() {
        recorder.end(&end).expect("it can be written");
        let whole = Recording::open(&copy).expect("what was read before");
        assert_eq!((whole.rounds(), whole.end()), (kept.rounds(), Some(end)));
    }
    // What a header says survives being written.
    Recorder::create(&copy, recording.header()).expect("it can be written");
    let empty = Recording::open(&copy).expect("a header");
    assert_eq!(empty.header(), recording.header());
    assert_eq!((empty.rounds(), empty.end()), (0, None));
}

/// A replay in a place, if it does not take long. Digests of the place are put right:
/// without them next to nothing behind them would be reached.
fn replayed(
    place: &Place,
    path: &Path,
    data: &[u8],
    threads: usize,
) -> Option<Result<FleetOutcome, FleetError>> {
    let recording = Recording::open(path).expect("what was read before");
    let header = recording.header();
    let mut config = header.config.clone();
    if f64::from(config.sim.ticks_hz) * config.sim.message_period_s > TICKS
        || config.reveal > REVEAL
    {
        return None;
    }
    let model = header.setup["model"].as_str();
    let robots = model.map_or(Robots::Pebbles, |model| Robots::Model(model.to_owned()));
    // As many at most as there are cells.
    let agents = config.agents.min(place.grid.cell_count()) as usize;
    let bodies = robots.fleet(agents, &config.sim).ok()?;
    let ground = Ground {
        grid: &place.grid,
        fleet: bodies.as_ref(),
        tasks: place.tasks.as_ref(),
        starts: None,
        guidance: None,
    };
    let here = path.with_extension("here");
    let header = ground.header(&config, header.modules.clone(), header.setup.clone());
    Recorder::create(&here, &header).expect("it can be written");
    let rounds = data.iter().position(|byte| *byte == b'\n')? + 1;
    let file = fs::File::options().append(true).open(&here);
    file.and_then(|mut file| file.write_all(&data[rounds..]))
        .expect("it can be written");
    let again = Recording::open(&here).expect("the same but for digests");
    assert_eq!(again.rounds(), recording.rounds());
    // As the command does.
    config.sim.threads = threads;
    config.sim.memory_limit_bytes = Some(1 << 28);
    let outcome = replay(&ground, again.with_host(&config), &mut Patience::default());
    match &outcome {
        // The graph keeps those who follow orders exactly apart, whatever was planned.
        Ok(outcome) if bodies.is_none() && config.sim.radius_m.is_none() => {
            assert_eq!(outcome.execution.figures.contacts, 0);
        }
        // Numbers of the configuration are named by themselves.
        Err(FleetError::Input(error)) if error.source == here.display().to_string() => {
            check_error(error, &error.source, data);
        }
        _ => {}
    }
    Some(outcome)
}

/// Ends a replay that takes long.
#[derive(Default)]
struct Patience {
    asked: Cell<u32>,
}

impl Watch for Patience {
    fn is_interrupted(&self) -> bool {
        self.asked.set(self.asked.get() + 1);
        self.asked.get() > BLOCKS
    }
}

/// However many threads do the work, a replay comes to the same.
fn same(one: &FleetOutcome, other: &FleetOutcome) {
    assert_eq!(one.ended, other.ended);
    assert_eq!(
        one.execution.figures.trace_digest,
        other.execution.figures.trace_digest
    );
    assert_eq!(one.metrics, other.metrics);
    assert_eq!(one.series, other.series);
    assert_eq!(one.events, other.events);
    let metrics = &one.metrics;
    assert!((0.0..=1.0).contains(&metrics.waiting_share));
    assert!(metrics.goals_reached <= metrics.goals_committed);
    for times in [metrics.planner_time_ms, metrics.fail_policy_time_ms] {
        assert!(times.mean >= 0.0 && times.mean.is_finite() && times.p50 <= times.max);
    }
    assert!(one.events.len() <= FleetOutcome::EVENTS);
}

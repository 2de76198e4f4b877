//! Findings of `fleetyard plugins check --fuzz` as files, and the commands that ask them again.

use std::io;
use std::path::{Path, PathBuf};

use fleetyard_abi::Kind;
use fleetyard_conformance::{Call, Finding, Fuzzed, Probe, Subject, View};
use fleetyard_core::{
    Connectivity, InputError, Scenario, map_bytes, write_atomically, write_roadmap, write_scen,
};
use fleetyard_sim::motion::{Model, Profile, SingleIntegrator};
use fleetyard_views::{Agent, Fleets, Place, State, Task, write_task};
use fleetyard_world::{DYNAMICS_TOLERANCE, Footprint, write_workspace};

use crate::exit::{Result, internal};

/// Most folders of one name that are looked for.
const FOLDERS: usize = 10_000;

/// The file that the fuzzer itself reads.
const FUZZED: &str = "fuzzed.json";

/// Distances from goals that planners in the plane are allowed.
const GOAL_TOLERANCE_M: f64 = 0.05;

/// A finding that was written.
pub(super) struct Written {
    /// The file with all of it.
    pub(super) fuzzed: PathBuf,
    /// Arguments of `fleetyard run` that ask its last call, where they can say what it asks; without the planner.
    pub(super) run: Option<Vec<String>>,
}

/// Writes a finding to a new folder in `findings`: as the fuzzer reads it, and map and agents of its last call in
/// the formats of other commands. Nothing is written over.
pub(super) fn write(findings: &Path, finding: &Finding, subject: &Subject) -> Result<Written> {
    let letter = |letter: char| {
        if letter.is_ascii_alphanumeric() {
            letter
        } else {
            '-'
        }
    };
    let id = &subject.descriptor.id;
    let name: String = format!("{id}-{}-{}", finding.kind, finding.seed);
    let name: String = name.chars().map(letter).collect();
    let folder = new_folder(findings, &name)?;
    let fuzzed = folder.join(FUZZED);
    let text = serde_json::to_vec_pretty(&Fuzzed::of(finding, subject)).map_err(internal)?;
    write_atomically(&fuzzed, &text)?;
    let last = finding.probes.last();
    let last = last.and_then(|probe| Some((probe, probe.calls.last()?)));
    let run = match last {
        Some((probe, call)) => {
            let (files, words) = shown(&folder, probe, call).map_err(internal)?;
            for (path, bytes) in files {
                write_atomically(&path, &bytes)?;
            }
            words.filter(|_| subject.descriptor.kind == Kind::Planner)
        }
        None => None,
    };
    Ok(Written { fuzzed, run })
}

fn cannot_write(path: &Path, error: &io::Error) -> InputError {
    InputError::new(path.display().to_string(), format!("cannot write: {error}"))
        .hint("--findings FOLDER names a folder in which you may write")
}

/// Makes a folder of this name, or with a number after it where there is one already.
fn new_folder(parent: &Path, name: &str) -> Result<PathBuf> {
    std::fs::create_dir_all(parent).map_err(|error| cannot_write(parent, &error))?;
    let mut folder = parent.join(name);
    for number in 2..FOLDERS {
        match std::fs::create_dir(&folder) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
                folder = parent.join(format!("{name}-{number}"));
            }
            made => {
                made.map_err(|error| cannot_write(&folder, &error))?;
                return Ok(folder);
            }
        }
    }
    Err(cannot_write(&folder, &io::ErrorKind::AlreadyExists.into()).into())
}

/// Files of a finding, and arguments of `run`.
type Shown = (Vec<(PathBuf, Vec<u8>)>, Option<Vec<String>>);

/// Map and agents of a call in the formats of other commands, with the arguments of `run` that ask it: windows,
/// headings, agents without a goal and robots other than discs of one size these commands do not know.
fn shown(folder: &Path, probe: &Probe, call: &Call) -> std::result::Result<Shown, String> {
    let ways = probe.ways(call).filter(|_| probe.radii_m.is_empty());
    let file = |name: &str| folder.join(name);
    let word = |path: PathBuf| path.display().to_string();
    let mut words = match probe.view {
        View::Status => return Ok((Vec::new(), None)),
        View::Grid | View::Turning | View::Straight => {
            let grid = probe.grid()?;
            let name = if grid.has_move_masks() {
                "map.json"
            } else {
                "instance.map"
            };
            let mut files = vec![(file(name), map_bytes(&grid))];
            let Some(ways) = ways else {
                return Ok((files, None));
            };
            let scen = Scenario::of(&grid, name, ways);
            files.push((file("instance.scen"), write_scen(&scen)));
            let rule = match probe.view {
                View::Turning => return Ok((files, None)),
                View::Straight => vec!["--path-rule", "bresenham"],
                _ if probe.connectivity() == Connectivity::Eight => vec!["--connectivity", "8"],
                _ => Vec::new(),
            };
            let agents = if probe.view == View::Straight {
                1
            } else {
                call.agents.len()
            };
            let mut words = vec![
                "--map".to_owned(),
                word(file(name)),
                "--scen".to_owned(),
                word(file("instance.scen")),
                "--agents".to_owned(),
                agents.to_string(),
            ];
            words.extend(rule.into_iter().map(str::to_owned));
            (files, words)
        }
        View::RoadmapStopGo | View::RoadmapSlower | View::Plane => in_world(folder, probe, ways)?,
    };
    let has_words = !words.1.is_empty();
    let mut add = |name: &str, value: String| words.1.extend([format!("--{name}"), value]);
    add("seed", probe.seed.to_string());
    let wall = call.wall_ns.map_or(USUAL_MS, |ns| (ns / 1_000_000).max(1));
    add("budget", format!("{wall}ms"));
    if call.nodes > 0 {
        add("nodes", call.nodes.to_string());
    }
    if call.more_threads > 0 {
        add("threads", (1 + call.more_threads).to_string());
    }
    Ok((words.0, has_words.then_some(words.1)))
}

/// Budget of `run` for what had the usual one, in milliseconds.
const USUAL_MS: u64 = 5000;

/// Files with their content, and arguments that name them.
type Named = (Vec<(PathBuf, Vec<u8>)>, Vec<String>);

/// A task in a world, and its roadmap.
fn in_world(
    folder: &Path,
    probe: &Probe,
    ways: Option<Vec<(u32, u32)>>,
) -> std::result::Result<Named, String> {
    let file = |name: &str| folder.join(name);
    let roadmap = probe.roadmap()?;
    let mut files = vec![(file("world.json"), write_workspace(&probe.workspace()?))];
    let is_plane = probe.view == View::Plane;
    if !is_plane {
        files.push((file("roadmap.json"), write_roadmap(&roadmap)));
    }
    // Of robots in the plane a task has those with the first of the dynamics as they are here.
    let dynamics = probe.dynamics.as_deref();
    let is_simple = !is_plane || dynamics == Some("fleetyard.single-integrator/1");
    let Some(ways) = ways.filter(|_| is_simple) else {
        return Ok((files, Vec::new()));
    };
    let state = |vertex: u32| {
        let (x_m, y_m) = roadmap.position_m(vertex);
        State {
            x_m,
            y_m,
            heading_rad: None,
            trailer_rad: None,
        }
    };
    let agents = ways.iter().map(|(start, goal)| Agent {
        robot: 0,
        start: state(*start),
        goal: state(*goal),
    });
    let disc = Profile {
        footprint: Footprint::Disc { radius_m: 0.35 },
        model: Model::SingleIntegrator(SingleIntegrator::default()),
    };
    let exact = DYNAMICS_TOLERANCE;
    let task = Task {
        source: String::new(),
        name: String::new(),
        place: Place::World("world.json".into()),
        fleet: Fleets::Kinds(vec![("disc".into(), disc)]),
        agents: agents.collect(),
        goal_tolerance_m: if is_plane { GOAL_TOLERANCE_M } else { exact },
        goal_tolerance_rad: exact,
        goal_tolerance_rate: exact,
        dynamics_tolerance: Task::BESIDE_KNOTS,
        seed: probe.seed,
    };
    files.push((file("instance.task.json"), write_task(&task)));
    let word = |name: &str| file(name).display().to_string();
    let mut words = vec!["--task".to_owned(), word("instance.task.json")];
    if is_plane {
        words.extend(["--representation", "continuous"].map(str::to_owned));
    } else {
        words.extend(["--roadmap".to_owned(), word("roadmap.json")]);
        if probe.view == View::RoadmapSlower {
            words.extend(["--pace", "slower"].map(str::to_owned));
        }
    }
    Ok((files, words))
}

//! The work of every standard planner on a dozen instances is what `tests/expected/work.csv` says: the
//! figures that it reports and its looks at the clock exactly, the memory that it asks for within a tenth.
//!
//! A map that is learnt for nothing, or a table of all cells where a few would do, is seen here before
//! anybody waits for it. Limits are nodes; no clock has a say. `FLEETYARD_UPDATE=1` writes the file.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use allocation_counter::measure;
use fleetyard_abi::object::Object;
use fleetyard_abi::sdk::{Annotations, Catalog, Options, Rejected, Sink};
use fleetyard_abi::{
    Budget, Capabilities, Descriptor, GridEnvironment, GridPlan, Instance, Kind, LogLevel, Motion,
    PlanRef, Request, SharedEnvironment, Status,
};
use fleetyard_testkit::{Case, grid, root};

use crate::questions::{hall, planners, streets};

/// A planner that its nodes do not end is told to stop after so long, and fails this test.
const LONGEST: Duration = Duration::from_mins(2);
/// Planners whose nodes are expansions, and expansions for a node of others.
const EXPANDING: [&str; 2] = ["pp", "pbs"];
const EXPANSIONS: u64 = 1000;
/// Part by which blocks and bytes may be others.
const TENTH: f64 = 0.1;

/// Figures and plans of a call.
#[derive(Default)]
struct Told {
    figures: BTreeMap<String, f64>,
    plan: Option<GridPlan>,
    plans: u64,
    /// Cells of the last plan on a grid.
    length: u64,
}

struct Listener {
    started: Instant,
    looks: AtomicU64,
    told: Mutex<Told>,
}

impl Listener {
    fn new() -> Self {
        Self {
            started: Instant::now(),
            looks: AtomicU64::new(0),
            told: Mutex::default(),
        }
    }

    /// Notes of the host are no memory of the planner.
    fn keep(&self, keep: impl FnOnce(&mut Told)) {
        allocation_counter::opt_out(|| keep(&mut self.told.lock().unwrap()));
    }

    fn is_late(&self) -> bool {
        self.started.elapsed() > LONGEST
    }
}

impl Sink for Listener {
    fn submit_plan(&self, plan: PlanRef<'_>) -> Result<(), Rejected> {
        self.keep(|told| {
            told.plans += 1;
            if let PlanRef::Cells(plan) = plan {
                told.length = plan.cells().len() as u64;
                told.plan = Some(plan.clone());
            }
        });
        Ok(())
    }

    fn submit_request(&self, _: &Request) -> Result<(), Rejected> {
        Err(Rejected::Malformed)
    }

    fn metric(&self, name: &str, value: f64) {
        self.keep(|told| {
            told.figures.insert(name.to_owned(), value);
        });
    }

    fn note(&self, _: &str, _: &str) {}

    fn log(&self, _: LogLevel, _: &str) {}

    fn progress(&self, _: u64, _: u64) {}

    fn cancelled(&self) -> bool {
        self.looks.fetch_add(1, Ordering::Relaxed);
        self.is_late()
    }

    fn annotations(&self) -> Option<&dyn Annotations> {
        None
    }
}

/// A map and an instance for all planners that take them.
struct Question {
    name: &'static str,
    map: SharedEnvironment,
    instance: Instance,
    /// The same of questions on grids, to judge plans of.
    case: Option<Case>,
    nodes: u64,
    /// One after the other, each from where the last plan has led.
    calls: usize,
}

impl Question {
    fn of(name: &'static str, case: &Case, nodes: u64) -> Self {
        Self {
            name,
            map: case.environment(),
            instance: case.instance.clone(),
            case: Some(case.clone()),
            nodes,
            calls: 1,
        }
    }
}

/// Agents of a scenario of the repository.
fn scenario(name: &str, agents: usize) -> Case {
    let maps = root().join("maps");
    let scenario = maps.join(format!("{name}-random-1.scen"));
    Case::read(&maps.join(format!("{name}.map")), &scenario, agents).unwrap()
}

/// A fleet under way: each robot has three goals.
fn fleet(map: GridEnvironment, robots: usize, window: u32) -> Case {
    let mut cells = grid::free(&map);
    let goal = |robot: usize, number: usize| {
        let drawn = grid::mix((robot as u64) << 32 | number as u64);
        cells[(drawn % cells.len() as u64) as usize]
    };
    let goals: Vec<Vec<u32>> = (0..robots)
        .map(|robot| (0..3).map(|number| goal(robot, number)).collect())
        .collect();
    cells.sort_by_key(|&cell| grid::mix(u64::from(cell)));
    cells.truncate(robots);
    let instance = Instance::one_shot(cells.clone(), cells);
    Case { map, instance }.windowed(window, &goals)
}

fn questions() -> Vec<Question> {
    let windowed = |name, case: &Case, calls| Question {
        calls,
        ..Question::of(name, case, 100)
    };
    let asked = |name, (map, instance), nodes| Question {
        name,
        map,
        instance,
        case: None,
        nodes,
        calls: 1,
    };
    let crossing = (0..8).map(|at| 143 - (at * 5) % 8);
    let pillars = [[2.0, 2.0], [5.0, 2.0], [2.0, 5.0], [5.0, 5.0]];
    let discs = |count: usize| {
        let lane = |at: usize| 1.0 + 2.5 * at as f64;
        let ends: Vec<_> = (0..count)
            .map(|at| [[0.8, lane(at)], [7.2, lane(count - 1 - at)]])
            .collect();
        hall("fleetyard.single-integrator/1", [8.0, 8.0], &pillars, &ends).unwrap()
    };
    let crossing_streets = Case {
        instance: Instance::one_shot((0..8).collect(), (0..8).map(|at| 143 - 12 * at).collect()),
        map: grid::one_way(12),
    };
    let mut straight = Case::square(64, 1, 3, 1 << 50);
    straight.instance.motion = Motion::AnyAngle;
    vec![
        Question::of("empty-8-8 with 6 agents", &scenario("empty-8-8", 6), 300),
        Question::of(
            "random-32-32-20 with 20 agents",
            &scenario("random-32-32-20", 20),
            100,
        ),
        Question::of(
            "maze-32-32-3 with 6 agents",
            &scenario("maze-32-32-3", 6),
            100,
        ),
        Question::of(
            "room-33-33-8 with 15 agents",
            &scenario("room-33-33-8", 15),
            100,
        ),
        Question::of(
            "dense 16 × 16 with 90 agents",
            &Case::square(16, 90, 1, 2),
            30,
        ),
        Question::of(
            "large 300 × 300 with 2 agents",
            &Case::square(300, 2, 2, 3),
            30,
        ),
        Question::of(
            "large 300 × 300 with 1 agent",
            &Case::square(300, 1, 2, 1 << 50),
            1_000_000,
        ),
        Question::of("straight 64 × 64 with 1 agent", &straight, 1_000_000),
        Question::of(
            "turning 24 × 24 with 20 agents",
            &Case::square(24, 20, 2, 4).turning(),
            100,
        ),
        windowed(
            "fleet of 100 in windows",
            &fleet(grid::warehouse(22, 42), 100, 8),
            3,
        ),
        Question::of("one-way 12 × 12 with 8 agents", &crossing_streets, 100),
        windowed(
            "fleet of 30 on one-way streets",
            &fleet(grid::one_way(12), 30, 8),
            10,
        ),
        windowed(
            "fleet of 2500 in windows",
            &fleet(grid::warehouse(91, 170), 2500, 5),
            2,
        ),
        asked(
            "roadmap of 144 vertices with 8 discs",
            streets(12, 12, (0..8).collect(), crossing.collect()),
            500,
        ),
        asked("hall with 3 discs", discs(3), 300),
        asked("hall with 1 disc", discs(1), 300),
    ]
}

/// Columns that are compared exactly, and within a tenth.
const EXACT: [&str; 6] = [
    "ended",
    "plans",
    "length",
    "prepare_looks",
    "plan_looks",
    "figures",
];
const NEAR: [&str; 4] = ["prepare_blocks", "plan_blocks", "asked_bytes", "peak_bytes"];

/// The work of one planner on one question, by the columns above, as it is written down.
type Work = BTreeMap<&'static str, String>;
/// The same of all, by planner and question.
type Works = BTreeMap<(String, String), Work>;

/// Lets a planner work; none if it does not take the question.
fn work(id: &str, question: &Question) -> Option<Work> {
    let budget = Budget {
        deadline_monotonic_ns: u64::MAX,
        answer_by_ns: u64::MAX,
        memory_bytes: 1 << 30,
        nodes: question.nodes
            * if EXPANDING.contains(&id) {
                EXPANSIONS
            } else {
                1
            },
        threads: 1,
        seed: 1,
        ..Budget::lasting(0, u64::MAX)
    };
    let listener = Listener::new();
    let made = fleetyard_plugins::catalog().create(Kind::Planner, id, Options::new(""), &listener);
    let mut object = made.unwrap_or_else(|failure| panic!("{id}: {failure}"));
    let mut learnt = Ok(());
    let prepared = measure(|| {
        let known = object.prepare(&question.map, &budget, &listener);
        learnt = known.expect("a planner");
    });
    learnt.ok()?;
    let prepare_looks = listener.looks.into_inner();
    let mut instance = question.instance.clone();
    let (mut held, mut peak) = (prepared.bytes_current, prepared.bytes_max);
    let (mut looks, mut blocks, mut asked) = (0, 0, prepared.bytes_total);
    let (mut plans, mut length) = (0, 0);
    let (mut figures, mut ended) = (BTreeMap::<String, f64>::new(), Status::Solved);
    for _ in 0..question.calls {
        let Object::Planner(planner) = &mut object else {
            panic!("{id} is no planner");
        };
        let listener = Listener::new();
        let mut answer = Ok(());
        let call = measure(|| answer = planner.plan(&instance, &budget, &listener));
        let freed = measure(|| object.free_leftovers());
        ended = answer.map_or_else(|failure| failure.status, |()| Status::Solved);
        if ended == Status::Unsupported {
            return None;
        }
        let late = listener.is_late();
        assert!(!late, "{id} on {}: no node ends it", question.name);
        peak = peak.max(held.unsigned_abs() + call.bytes_max);
        held += call.bytes_current + freed.bytes_current;
        looks += listener.looks.into_inner();
        blocks += call.count_total;
        asked += call.bytes_total;
        let told = listener.told.into_inner().unwrap();
        plans += told.plans;
        length += told.length;
        for (name, value) in told.figures {
            *figures.entry(name).or_default() += value;
        }
        if ended != Status::Solved {
            break;
        }
        if let Some(plan) = told.plan {
            if let Some(case) = &question.case {
                judge(case, &instance, &plan)
                    .unwrap_or_else(|reason| panic!("{id} on {}: {reason}", question.name));
            }
            instance.starts = plan.paths().map(|path| path[path.len() - 1]).collect();
        }
    }
    let figures = figures.iter().map(|(name, sum)| format!("{name}={sum}"));
    Some(BTreeMap::from([
        ("ended", ended.to_string()),
        ("plans", plans.to_string()),
        ("length", length.to_string()),
        ("prepare_looks", prepare_looks.to_string()),
        ("prepare_blocks", prepared.count_total.to_string()),
        ("plan_looks", looks.to_string()),
        ("plan_blocks", blocks.to_string()),
        ("figures", figures.collect::<Vec<_>>().join(" ")),
        ("asked_bytes", asked.to_string()),
        ("peak_bytes", peak.to_string()),
    ]))
}

/// The reason why a plan on a grid is none.
fn judge(case: &Case, instance: &Instance, plan: &GridPlan) -> Result<(), String> {
    let case = Case {
        map: case.map.clone(),
        instance: instance.clone(),
    };
    let paths: Vec<&[u32]> = plan.paths().collect();
    match instance.motion {
        Motion::AnyAngle => case.arrivals(&paths),
        _ => case.judge(&paths, 0),
    }
}

/// True if a planner has what a question needs. What else it does not take it refuses itself.
fn takes(planner: &Descriptor, question: &Question) -> bool {
    let needs = [question.map.needs(), question.instance.needs()];
    let features = question.instance.needs_features();
    let has = |needs: &Capabilities| needs.iter().all(|need| planner.capabilities.has(need));
    needs.iter().all(has) && features.iter().all(|need| planner.features.contains(need))
}

/// Columns that are others than before.
fn changes(before: &Work, now: &Work) -> Vec<String> {
    let is_near = |before: &str, now: &str| {
        let [before, now] = [before, now].map(|count| count.parse::<f64>().expect("a number"));
        (now - before).abs() <= TENTH * before
    };
    let exact = EXACT.iter().filter(|name| before[*name] != now[*name]);
    let near = NEAR
        .iter()
        .filter(|name| !is_near(&before[*name], &now[*name]));
    exact
        .chain(near)
        .map(|name| format!("{name} {} → {}", before[name], now[name]))
        .collect()
}

fn read(file: &Path) -> Works {
    let mut rows = csv::Reader::from_path(file).expect("a file of counts");
    let row = |row: BTreeMap<String, String>| {
        let work = EXACT
            .iter()
            .chain(&NEAR)
            .map(|name| (*name, row[*name].clone()));
        (
            (row["planner"].clone(), row["instance"].clone()),
            work.collect(),
        )
    };
    rows.deserialize()
        .map(|found| row(found.expect("a row")))
        .collect()
}

fn write(file: &Path, works: &Works) {
    let names = EXACT.iter().chain(&NEAR);
    let mut rows = csv::Writer::from_path(file).expect("a file of counts");
    let head = ["planner", "instance"]
        .into_iter()
        .chain(names.clone().copied());
    rows.write_record(head).unwrap();
    for ((planner, instance), work) in works {
        let row = names.clone().map(|name| &work[name]);
        rows.write_record([planner, instance].into_iter().chain(row))
            .unwrap();
    }
    rows.flush().unwrap();
}

#[test]
fn the_work_of_every_planner_is_what_it_was() {
    let planners = planners();
    let questions = questions();
    let pairs: Vec<_> = (questions.iter())
        .flat_map(|question| planners.iter().map(move |planner| (planner, question)))
        .filter(|(planner, question)| takes(planner, question))
        .collect();
    let now = Mutex::new(Works::new());
    let next = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                while let Some((planner, question)) =
                    pairs.get(next.fetch_add(1, Ordering::Relaxed))
                {
                    let started = Instant::now();
                    let Some(work) = work(&planner.id, question) else {
                        continue;
                    };
                    // Shown with --nocapture.
                    println!(
                        "{} on {}: {:?}",
                        planner.id,
                        question.name,
                        started.elapsed()
                    );
                    let name = (planner.id.clone(), question.name.to_owned());
                    now.lock().unwrap().insert(name, work);
                }
            });
        }
    });
    let now = now.into_inner().unwrap();
    for planner in &planners {
        let is_asked = now.keys().any(|(id, _)| *id == planner.id);
        assert!(is_asked, "{} takes no question", planner.id);
    }
    let file = root().join("tests/expected/work.csv");
    if std::env::var_os("FLEETYARD_UPDATE").is_some() {
        return write(&file, &now);
    }
    let before = read(&file);
    let mut told = String::new();
    for (name, work) in &now {
        let changes = match before.get(name) {
            Some(before) => changes(before, work),
            None => vec!["is new".to_owned()],
        };
        if !changes.is_empty() {
            let _ = writeln!(told, "{} on {}: {}", name.0, name.1, changes.join("; "));
        }
    }
    for name in before.keys().filter(|name| !now.contains_key(name)) {
        let _ = writeln!(told, "{} on {}: is gone", name.0, name.1);
    }
    assert!(
        told.is_empty(),
        "{told}Who changes a count changes the file in the same commit and says why in its message: \
         FLEETYARD_UPDATE=1 cargo test -p fleetyard-plugins --test planners work"
    );
}

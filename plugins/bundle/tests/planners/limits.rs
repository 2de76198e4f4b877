//! Every standard planner comes to an end soon after it is told to, whatever it is asked, and leaves what
//! takes long to free until it has answered; and it says which limit ended it.
//!
//! The clock is the processor time of the thread, which no other work on the machine moves.

use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

use fleetyard_abi::object::Object;
use fleetyard_abi::sdk::{Annotations, Catalog, Failure, Options, Rejected, Sink};
use fleetyard_abi::{
    Budget, Capability, Descriptor, Environment, GridEnvironment, Instance, Kind, LogLevel, Motion,
    PlanRef, Request, SharedEnvironment, Status,
};

use crate::questions::{Question, hall, planners, streets};

/// Processor time that a planner may take from being told until it returns, in a build that is hardly
/// optimised.
const SLACK_NS: u64 = 250_000_000;

/// Processor time of this thread.
fn cpu_ns() -> u64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").expect("schedstat");
    let first = text.split_whitespace().next().expect("a number");
    first.parse().expect("a number")
}

/// Tells a planner to stop when its thread has run for so long.
struct Clock {
    stop_ns: u64,
    plans: AtomicU64,
}

impl Clock {
    fn after(limit_ns: u64) -> Self {
        Self {
            stop_ns: cpu_ns().saturating_add(limit_ns),
            plans: AtomicU64::new(0),
        }
    }
}

impl Sink for Clock {
    fn submit_plan(&self, _: PlanRef<'_>) -> Result<(), Rejected> {
        self.plans.fetch_add(1, Ordering::Relaxed);
        Ok(())
    }

    fn submit_request(&self, _: &Request) -> Result<(), Rejected> {
        Err(Rejected::Malformed)
    }

    fn metric(&self, _: &str, _: f64) {}

    fn note(&self, _: &str, _: &str) {}

    fn log(&self, _: LogLevel, _: &str) {}

    fn progress(&self, _: u64, _: u64) {}

    fn cancelled(&self) -> bool {
        cpu_ns() >= self.stop_ns
    }

    fn annotations(&self) -> Option<&dyn Annotations> {
        None
    }
}

/// Numbers that look drawn.
fn numbers(mut seed: u64) -> impl FnMut(usize) -> usize {
    move |below| {
        seed = seed
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) as usize % below
    }
}

/// So many of some places in an order that looks drawn.
fn drawn(mut places: Vec<u32>, count: usize, seed: u64) -> Vec<u32> {
    let mut number = numbers(seed);
    for at in 0..count {
        let other = at + number(places.len() - at);
        places.swap(at, other);
    }
    places.truncate(count);
    places
}

/// Agents that have to pass each other in a corridor, or one whose goal is walled in; and many agents on
/// a large map, or one.
fn on_grid(motion: Motion, alone: bool) -> [Question; 2] {
    let question = |rows: u32, cols: u32, passable: Vec<u8>, starts: Vec<u32>, goals: Vec<u32>| {
        let map = GridEnvironment::four_connected(rows, cols, passable);
        let mut instance = Instance::one_shot(starts, goals);
        instance.motion = motion;
        (SharedEnvironment::new(Environment::from(map)), instance)
    };
    let side = 256_u32;
    let mut number = numbers(7);
    let mut free: Vec<u8> = (0..side * side).map(|_| u8::from(number(10) > 0)).collect();
    let region = {
        let map = GridEnvironment::four_connected(side, side, free.clone());
        let from = (0..side * side).find(|cell| free[*cell as usize] != 0);
        fleetyard_testkit::grid::region(&map, from.expect("a free cell"))
    };
    let agents = if alone { 1 } else { 200 };
    let huge = question(
        side,
        side,
        free.clone(),
        drawn(region.clone(), agents, 1),
        drawn(region, agents, 2),
    );
    if alone {
        for cell in [side + 1, 2 * side, 2 * side + 2, 3 * side + 1] {
            free[cell as usize] = 0;
        }
        free[(2 * side + 1) as usize] = 1;
        free[(side * side - 1) as usize] = 1;
        let walled = question(side, side, free, vec![side * side - 1], vec![2 * side + 1]);
        return [walled, huge];
    }
    let cols = 14;
    let ends = [0, 1, 2, cols - 3, cols - 2, cols - 1];
    let goals = [cols - 1, cols - 2, cols - 3, 2, 1, 0];
    let stuck = question(1, cols, vec![1; cols as usize], ends.into(), goals.into());
    [stuck, huge]
}

/// The same on roadmaps: a line, and a square of streets.
fn on_roadmap() -> [Question; 2] {
    let all: Vec<u32> = (0..400).collect();
    let (starts, goals) = (drawn(all.clone(), 60, 3), drawn(all, 60, 4));
    [
        streets(10, 1, vec![0, 1, 8, 9], vec![9, 8, 1, 0]),
        streets(20, 20, starts, goals),
    ]
}

/// The same in the plane: a corridor and a hall with pillars.
fn in_plane(dynamics: &str, agents: usize) -> Option<[Question; 2]> {
    let pillars: Vec<[f64; 2]> = (0..144_u32)
        .map(|at| [at % 12, at / 12].map(|at| 1.7 + 2.0 * f64::from(at)))
        .collect();
    let lane = |at: usize| 1.0 + 2.0 * at as f64;
    let across: Vec<_> = (0..agents)
        .map(|at| [[1.0, lane(at)], [25.0, lane(agents - 1 - at)]])
        .collect();
    let huge = hall(dynamics, [26.0, 26.0], &pillars, &across)?;
    let stuck = if agents > 1 {
        let ends = [[[1.0, 0.4], [7.0, 0.4]], [[7.0, 0.4], [1.0, 0.4]]];
        hall(dynamics, [8.0, 0.8], &[], &ends)?
    } else {
        let wall: Vec<_> = (0..14)
            .map(|at| [3.7, -0.1 + 0.6 * f64::from(at)])
            .collect();
        hall(dynamics, [8.0, 8.0], &wall, &[[[1.0, 4.0], [7.0, 4.0]]])?
    };
    Some([stuck, huge])
}

/// The instance that a planner is asked: the first that it takes.
fn questions(descriptor: &Descriptor) -> Vec<[Question; 2]> {
    let has = |capability| descriptor.capabilities.has(capability);
    if has(Capability::Grid) {
        let motion = if has(Capability::Pebble) {
            Motion::Pebble
        } else {
            Motion::AnyAngle
        };
        return vec![on_grid(motion, false), on_grid(motion, true)];
    }
    if has(Capability::Roadmap) {
        return vec![on_roadmap()];
    }
    let features = descriptor.features.iter();
    let known = features.filter_map(|feature| feature.strip_prefix("dynamics:"));
    known
        .flat_map(|dynamics| {
            [10, 1]
                .into_iter()
                .filter_map(|agents| in_plane(dynamics, agents))
        })
        .collect()
}

fn made(id: &str) -> Object {
    let sink = Clock::after(u64::MAX);
    let made = fleetyard_plugins::catalog().create(Kind::Planner, id, Options::new(""), &sink);
    made.unwrap_or_else(|failure| panic!("{id}: {failure}"))
}

/// Asks a planner for a plan within so much time and so many nodes.
fn ask(
    (name, object): (&str, &mut Object),
    question: &Question,
    limit_ns: u64,
    nodes: u64,
) -> Result<(), Failure> {
    let (environment, instance) = question;
    let budget = Budget {
        deadline_monotonic_ns: u64::MAX,
        answer_by_ns: u64::MAX,
        memory_bytes: 1 << 30,
        nodes,
        ..Budget::lasting(0, u64::MAX)
    };
    let clock = Clock::after(u64::MAX);
    object
        .prepare(environment, &budget, &clock)
        .expect("a planner")?;
    let clock = Clock::after(limit_ns);
    let Object::Planner(planner) = object else {
        panic!("no planner");
    };
    let result = planner.plan(instance, &budget, &clock);
    let late_ns = cpu_ns().saturating_sub(clock.stop_ns);
    assert!(
        late_ns <= SLACK_NS,
        "{name} returned {} ms after it was told to",
        late_ns / 1_000_000
    );
    object.free_leftovers();
    assert!(!object.has_leftovers());
    if result.is_ok() {
        assert!(
            clock.plans.load(Ordering::Relaxed) > 0,
            "solved without a plan"
        );
    }
    result
}

/// Asks a planner both questions for a short and a longer time; false if it takes none of those that
/// there are.
fn holds(descriptor: &Descriptor) -> bool {
    let id = &descriptor.id;
    questions(descriptor).into_iter().any(|questions| {
        for limit_ns in [100_000_000, 1_000_000_000] {
            for (number, question) in questions.iter().enumerate() {
                match ask((id, &mut made(id)), question, limit_ns, 0) {
                    Err(failure) if failure.status == Status::Unsupported => return false,
                    Err(failure) => assert!(
                        !matches!(failure.status, Status::InternalError | Status::InvalidInput),
                        "{id}: {failure}"
                    ),
                    // Where nobody can pass nobody has a plan.
                    Ok(()) => assert!(number == 1, "{id} solved what has no solution"),
                }
            }
        }
        true
    })
}

#[test]
fn every_planner_ends_when_it_is_told() {
    let all = planners();
    assert!(all.len() > 40, "{} planners", all.len());
    let next = AtomicUsize::new(0);
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                while let Some(descriptor) = all.get(next.fetch_add(1, Ordering::Relaxed)) {
                    assert!(holds(descriptor), "{} takes no question", descriptor.id);
                }
            });
        }
    });
}

/// A limit of nodes ends a search as given up, long before its time is over.
#[test]
fn a_limit_of_nodes_is_not_said_to_be_the_clock() {
    let mut ended = Vec::new();
    for descriptor in planners() {
        let id = &descriptor.id;
        for questions in questions(&descriptor) {
            let Err(failure) = ask((id, &mut made(id)), &questions[1], 10_000_000_000, 2) else {
                break;
            };
            if failure.status == Status::Unsupported {
                continue;
            }
            assert_ne!(failure.status, Status::TimedOut, "{id}: {failure}");
            ended.push(id.clone());
            break;
        }
    }
    for id in ["astar", "pp", "pbs", "cbs", "mapf-lns2", "ccbs"] {
        assert!(
            ended.iter().any(|other| other == id),
            "{id} did not end: {ended:?}"
        );
    }
}

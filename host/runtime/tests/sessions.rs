//! All four kinds of plugin through all attachments: the same answers.
//!
//! This program is host, supervisor, worker and plugin at once, by its arguments.

#![allow(missing_docs, unsafe_code)]

use std::time::Duration;

use fleetyard_abi::leftovers::Leftover;
use fleetyard_abi::sdk::{
    FailPolicy, Failure, InstanceGenerator, InvocationPolicy, Options, Planner, Plugin, Sink,
};
use fleetyard_abi::{
    Assignment, Budget, Capabilities, Capability, ControlPlan, Descriptor, Environment, FleetState,
    FleetStatus, Footprint, Goals, GridEnvironment, GridPlan, Heading, Instance, Kind, Knot,
    KnotPlan, Lists, LogLevel, Motion, MotionPlan, Mover, Objective, Part, PathEncoding, Plan,
    Request, RoadmapEnvironment, Robot, SharedEnvironment, State, Status, Task, View, Visit,
    VisitPlan, WorkspaceEnvironment, c, serve,
};
use fleetyard_core::OFF_MAP;
use fleetyard_runtime::{
    Attach, Fault, Limits, PluginFile, Runtime, Session, Termination, supervisor,
};
use libtest_mimic::{Arguments, Trial};

/// Answers every question with what it was told, so that nothing can get lost on
/// the way unseen.
struct Echo;

const DYNAMICS: &str = "fleetyard.unicycle/1";
const PART: &str = "org.example.dust/1";

/// Claims whatever a map or an instance may need.
fn described(kind: Kind) -> Descriptor {
    Descriptor {
        capabilities: Capabilities::of(Capability::ALL),
        features: vec![format!("dynamics:{DYNAMICS}"), format!("part:{PART}")],
        ..Descriptor::new(kind, "echo", "")
    }
}

impl Echo {
    fn plan_of(instance: &Instance) -> GridPlan {
        let goals = instance.goals.iter();
        GridPlan::from_paths(instance.starts.iter().zip(goals).map(|(start, goals)| {
            let mut path = vec![*start];
            path.extend_from_slice(goals);
            path
        }))
    }
}

impl Plugin for Echo {
    fn descriptor() -> Descriptor {
        Descriptor {
            path_encoding: PathEncoding::Cells,
            ..described(Kind::Planner)
        }
    }

    fn create(_: Options<'_>) -> Result<Self, Failure> {
        Ok(Self)
    }
}

impl Planner for Echo {
    type Map = SharedEnvironment;

    fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        _: &Budget,
        sink: &dyn Sink,
    ) -> Result<SharedEnvironment, Failure> {
        sink.log(LogLevel::Info, "prepared");
        Ok(environment.clone())
    }

    fn plan(
        &mut self,
        map: &mut SharedEnvironment,
        instance: &Instance,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        let sample = match &map.view {
            View::Grid(_) => None,
            View::Roadmap(_) => Some(roads()),
            View::Workspace(_) => Some(floor()),
        };
        if let Some(sample) = sample {
            assert_eq!(**map, *sample.environment);
            assert_eq!(shown(instance), shown(&sample.instance));
            sink.submit(&sample.plan)?;
            return Ok(());
        }
        assert_eq!(**map, *environment());
        sink.metric("seed", budget.seed as f64);
        sink.metric("not a number", f64::NAN);
        sink.log(LogLevel::Warning, "ümläut");
        // Two plans: the first worse than the second.
        sink.submit(&GridPlan::from_paths(instance.starts.iter().map(|s| [*s])))?;
        sink.submit(&Self::plan_of(instance))?;
        match budget.nodes {
            0 => Ok(()),
            1 => Err(Failure::new(Status::GaveUp, "as asked")),
            2 => panic!("as asked"),
            4 => {
                drop(Leftover::new(Slow(true)));
                Ok(())
            }
            _ => {
                sink.submit(&GridPlan::from_paths([[0u32]]))?;
                Ok(())
            }
        }
    }
}

/// Takes longer to free than [`leftovers`] gives to a call.
#[derive(Default)]
struct Slow(bool);

impl Drop for Slow {
    fn drop(&mut self) {
        if self.0 {
            std::thread::sleep(Duration::from_millis(1500));
        }
    }
}

struct EchoPolicy;

impl Plugin for EchoPolicy {
    fn descriptor() -> Descriptor {
        Descriptor {
            path_encoding: PathEncoding::Moves,
            ..described(Kind::FailPolicy)
        }
    }

    fn create(_: Options<'_>) -> Result<Self, Failure> {
        Ok(Self)
    }
}

impl FailPolicy for EchoPolicy {
    type Map = ();

    fn prepare(&mut self, _: &SharedEnvironment, _: &Budget, _: &dyn Sink) -> Result<(), Failure> {
        Ok(())
    }

    fn recover(
        &mut self,
        (): &mut (),
        instance: &Instance,
        failed: Option<&Plan>,
        _: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        let own = || Plan::from(Echo::plan_of(instance));
        let plan = failed.map_or_else(own, Plan::clone);
        sink.submit(&plan)?;
        Ok(())
    }
}

struct EchoGenerator;

impl Plugin for EchoGenerator {
    fn descriptor() -> Descriptor {
        described(Kind::InstanceGenerator)
    }

    fn create(_: Options<'_>) -> Result<Self, Failure> {
        Ok(Self)
    }
}

impl InstanceGenerator for EchoGenerator {
    type Map = ();

    fn prepare(&mut self, _: &SharedEnvironment, _: &Budget, _: &dyn Sink) -> Result<(), Failure> {
        Ok(())
    }

    fn generate(
        &mut self,
        (): &mut (),
        state: &FleetState,
        _: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        if state.tasks.is_empty() {
            return Err(Failure::new(Status::GaveUp, "there are no tasks"));
        }
        let mut lists = Goals::default();
        for (goals, task) in state.next.goals.iter().zip(&state.tasks) {
            lists.push([goals, &[task.id as u32], &task.places].concat());
        }
        let given = state.tasks.iter().map(|task| Assignment {
            agent: task.places.len() as u32,
            task: u64::MAX - task.id,
        });
        sink.submit_request(&Request {
            window_steps: state.next.window_steps + state.time_s as u32,
            assignments: given.collect(),
            ..state.request(lists)
        })?;
        Ok(())
    }
}

struct EchoInvocation;

impl Plugin for EchoInvocation {
    fn descriptor() -> Descriptor {
        Descriptor::new(Kind::InvocationPolicy, "echo", "")
    }

    fn create(_: Options<'_>) -> Result<Self, Failure> {
        Ok(Self)
    }
}

impl InvocationPolicy for EchoInvocation {
    fn should_invoke(&mut self, status: &FleetStatus, _: &dyn Sink) -> Result<bool, Failure> {
        let all =
            status.time_s + status.since_last_call_s + status.planning_limit_s - status.action_s;
        if all < 0.0 {
            return Err(Failure::new(Status::InvalidInput, "time runs backwards"));
        }
        Ok(f64::from(status.actions_left.iter().sum::<u32>()) < all)
    }
}

fleetyard_abi::export! {
    planners: [Echo],
    fail_policies: [EchoPolicy],
    instance_generators: [EchoGenerator],
    invocation_policies: [EchoInvocation],
}

static BUILT_IN: &[&c::PluginEntry] = &[&fleetyard_plugin_entry_v1];
const SERVE: &str = "__serve";

fn environment() -> SharedEnvironment {
    let grid = GridEnvironment {
        cell_size_m: 0.1,
        step_s: 0.3,
        terrain: b"ew@.S.".to_vec(),
        ..GridEnvironment::four_connected(2, 3, vec![1, 1, 0, 1, 1, 1])
    };
    SharedEnvironment::new(Environment::from(grid).named("tiny \"map\""))
}

fn budget(nodes: u64) -> Budget {
    Budget {
        deadline_monotonic_ns: 0,
        answer_by_ns: 0,
        wall_ns: 20_000_000_000,
        nodes,
        memory_bytes: 1 << 40,
        threads: 3,
        seed: (1 << 53) - 1,
    }
}

fn instance() -> Instance {
    Instance {
        starts: vec![0, 5],
        headings: Some(vec![Heading::North, Heading::East]),
        goals: [vec![1, 4], vec![4]].into_iter().collect(),
        motion: Motion::Rotation,
        objective: Objective::Makespan,
        window_steps: 7,
        radius_m: 0.25,
        ..Instance::default()
    }
}

/// An environment, an instance and a plan of one representation.
struct Sample {
    environment: SharedEnvironment,
    instance: Instance,
    plan: Plan,
}

/// For comparisons: NaN is not equal to itself.
fn shown(value: &impl std::fmt::Debug) -> String {
    format!("{value:?}")
}

fn parts() -> Vec<Part> {
    let part = |id: &str, critical| Part {
        id: id.into(),
        critical,
        data: serde_json::json!({ "level": [0.1, null, "ä"] }).into(),
    };
    vec![part(PART, true), part("org.example.nobody/2", false)]
}

fn robot(footprint: Footprint, has_heading: bool) -> Robot {
    let limits = vec![[Some(-0.1), Some(0.3)], [None, None], [Some(-1.5), None]];
    Robot {
        name: "ü \"robot\"".into(),
        footprint,
        dynamics: DYNAMICS.into(),
        has_heading,
        polar_state: false,
        polar_control: has_heading,
        state_limits: limits.clone(),
        control_limits: limits[..2].to_vec(),
        parameters: vec![0.7],
    }
}

fn hall() -> WorkspaceEnvironment {
    let triangle = vec![[0.0, 0.0], [1.0, 0.1], [0.5, 0.7]];
    WorkspaceEnvironment {
        min_m: [-1.0, -2.5],
        max_m: [9.0, 1.0 / 3.0],
        obstacles: [triangle.clone()].into_iter().collect(),
        movers: vec![Mover {
            footprint: Footprint {
                radius_m: 0.9,
                corners_m: triangle,
            },
            knots: vec![[0.5, 0.1, 0.2, 0.3], [1.5, 0.1, 0.7, -0.3]],
        }],
    }
}

fn roads() -> Sample {
    // One edge is a way back that takes longer than its length says.
    let edges: Lists<u32> = [vec![1, 2], vec![0], vec![]].into_iter().collect();
    let mut roadmap = RoadmapEnvironment::straight(
        vec![0.1, 3.0, 3.0],
        vec![0.0, 0.2, 0.3],
        edges,
        0.7,
        1.0 / 3.0,
    );
    roadmap.duration_s[2] += 1.0;
    roadmap.workspace = Some(hall());
    let mut environment = Environment::from(roadmap).named("tiny roads");
    environment.digest = "00ff".into();
    environment.parts = parts();
    let visit = |vertex, arrival_s, departure_s| Visit {
        vertex,
        arrival_s,
        departure_s,
    };
    let visits: VisitPlan = [
        vec![visit(0, 0.0, 0.1), visit(1, 4.3, 4.3)],
        vec![visit(2, 0.0, 0.0), visit(OFF_MAP, 1.0 / 3.0, 2.0)],
    ]
    .into_iter()
    .collect();
    Sample {
        environment: SharedEnvironment::new(environment),
        instance: Instance {
            starts: vec![0, 2],
            goals: [vec![1], vec![]].into_iter().collect(),
            robots: vec![
                robot(Footprint::disc(0.1), false),
                robot(Footprint::disc(0.2), false),
            ],
            robot_of: vec![1, 0],
            motion: Motion::Slower,
            window_s: 2.5,
            radius_m: 1.0 / 6.0,
            parts: parts(),
            ..Instance::default()
        },
        plan: visits.into(),
    }
}

fn floor() -> Sample {
    let mut environment = Environment::from(hall()).named("tiny floor");
    environment.parts = parts();
    let knot = |time_s, heading_rad| Knot {
        time_s,
        x_m: 0.1,
        y_m: 0.2,
        heading_rad,
    };
    let knots: KnotPlan = [
        vec![knot(0.0, f64::NAN), knot(1.0 / 3.0, f64::NAN)],
        vec![knot(0.0, 7.0)],
    ]
    .into_iter()
    .collect();
    let mut controls = ControlPlan::default();
    let segments = [(0.25, [2.0, -0.5]), (1.0 / 7.0, [0.0, 0.1])];
    controls.push_agent(segments).expect("of one length");
    controls.push_agent::<[f64; 0]>([]).expect("none");
    let square = vec![[0.2, 0.2], [-0.2, 0.2], [-0.2, -0.2], [0.2, -0.2]];
    let square = Footprint {
        radius_m: 0.3,
        corners_m: square,
    };
    let goal = State(vec![0.1, f64::NAN, 0.3]);
    Sample {
        environment: SharedEnvironment::new(environment),
        instance: Instance {
            start_states: vec![State(vec![0.5, 0.6, 0.7]), State(vec![1.5, 1.6, -1.7])],
            goal_states: [vec![], vec![goal]].into_iter().collect(),
            robots: vec![robot(Footprint::disc(0.1), false), robot(square, true)],
            robot_of: vec![0, 1],
            motion: Motion::Dynamics,
            radius_m: 0.3,
            goal_tolerance_m: 0.05,
            goal_tolerance_rad: 0.1,
            goal_tolerance_rate: 0.2,
            dynamics_tolerance: 0.3,
            parts: parts(),
            ..Instance::default()
        },
        plan: MotionPlan::new(knots, controls)
            .expect("of two agents")
            .into(),
    }
}

/// Whatever the representation, environments, instances and plans arrive as they were sent.
fn representations(attach: Attach) {
    for sample in [roads(), floor()] {
        let mut session = open(attach, Kind::Planner);
        session
            .prepare(&sample.environment, &budget(0))
            .expect("it is prepared");
        let run = session.plan(&sample.instance, &budget(0));
        assert_eq!((run.fault, run.claim), (None, Some(Status::Solved)));
        let plans: Vec<_> = run.incumbents.iter().map(|one| one.plan.as_ref()).collect();
        assert_eq!(shown(&plans), shown(&[Some(&sample.plan)]));
        session.close();
        let mut session = open(attach, Kind::FailPolicy);
        session
            .prepare(&sample.environment, &budget(0))
            .expect("it is prepared");
        let run = session.recover(&sample.instance, Some(&sample.plan), &budget(0));
        assert_eq!(run.fault, None);
        assert_eq!(shown(&run.incumbents[0].plan), shown(&Some(&sample.plan)));
        session.close();
    }
}

fn open(attach: Attach, kind: Kind) -> Session {
    let runtime = Runtime::new(BUILT_IN, Limits::default()).expect("a runtime");
    let itself = std::env::current_exe().expect("a path");
    let argv = vec![itself.display().to_string(), SERVE.to_owned()];
    let file = match attach {
        Attach::Stdio => PluginFile::Program(itself, argv),
        _ => PluginFile::BuiltIn,
    };
    let mut session = runtime.open(&file, attach).expect("it starts");
    assert_eq!(session.descriptors().len(), 4);
    session
        .create(kind, "echo", serde_json::json!({}))
        .expect("it is made");
    if kind != Kind::InvocationPolicy {
        session
            .prepare(&environment(), &budget(0))
            .expect("it is prepared");
    }
    session
}

fn planner(attach: Attach) {
    let mut session = open(attach, Kind::Planner);
    let expected = GridPlan::from_paths([vec![0, 1, 4], vec![5, 4]]);
    let run = session.plan(&instance(), &budget(0));
    assert_eq!(run.fault, None);
    assert_eq!(run.termination, Termination::Completed);
    assert_eq!(run.claim, Some(Status::Solved));
    assert_eq!(run.incumbents.len(), 2);
    assert_eq!(run.cells(), Some(&expected));
    assert_eq!(
        run.metrics,
        [("seed".to_owned(), 9_007_199_254_740_991.0)].into()
    );
    assert!(run.incumbents[0].arrived <= run.incumbents[1].arrived);

    // A failure after plans: the plans count.
    let run = session.plan(&instance(), &budget(1));
    assert_eq!(
        (run.termination, run.claim),
        (Termination::Completed, Some(Status::GaveUp))
    );
    assert_eq!(run.message.as_deref(), Some("as asked"));
    assert_eq!(run.cells(), Some(&expected));

    // A panic is a reported failure, and the session goes on.
    let run = session.plan(&instance(), &budget(2));
    assert_eq!(run.termination, Termination::Failed);
    assert!(
        run.fault
            .unwrap()
            .to_string()
            .contains("panicked: as asked")
    );
    assert_eq!(
        session.plan(&instance(), &budget(0)).termination,
        Termination::Completed
    );

    // A plan for too few agents breaks the protocol.
    let run = session.plan(&instance(), &budget(3));
    assert_eq!(run.termination, Termination::ProtocolError);
    let fault = run.fault.unwrap().to_string();
    assert!(
        fault.contains("the plan has 1 paths, but the instance has 2 agents"),
        "{fault}"
    );

    let closing = session.close();
    let texts: Vec<&str> = closing.log.iter().map(|line| line.text.as_str()).collect();
    assert_eq!(texts[..2], ["prepared", "ümläut"]);
    assert_eq!(closing.usage.is_none(), attach == Attach::InProcess);
}

/// Memory that takes long to free is freed when the call has been answered, and before the next one begins.
fn leftovers(attach: Attach) {
    let mut session = open(attach, Kind::Planner);
    let short = |nodes| Budget {
        wall_ns: 1_000_000_000,
        ..budget(nodes)
    };
    for nodes in [4, 0, 4] {
        let run = session.plan(&instance(), &short(nodes));
        assert_eq!(run.fault, None);
        assert_eq!(run.termination, Termination::Completed);
        assert_eq!(run.claim, Some(Status::Solved));
    }
    // It is not waited for when nothing more is asked.
    assert_eq!(session.close().fault, None);
}

fn fail_policy(attach: Attach) {
    let mut session = open(attach, Kind::FailPolicy);
    let run = session.recover(&instance(), None, &budget(0));
    assert_eq!(
        run.cells(),
        Some(&GridPlan::from_paths([vec![0, 1, 4], vec![5, 4]]))
    );
    // Colliding, jumping, empty and off the map: everything arrives as it was.
    for paths in [
        vec![vec![0, 1, 4], vec![5, 4, 4]],
        vec![vec![0, 5], vec![]],
        vec![vec![3], vec![5, OFF_MAP]],
    ] {
        let failed = GridPlan::from_paths(&paths).into();
        let run = session.recover(&instance(), Some(&failed), &budget(0));
        assert_eq!(run.fault, None);
        assert_eq!(run.cells(), Some(&GridPlan::from_paths(&paths)));
    }
    session.close();
}

fn instance_generator(attach: Attach) {
    let mut session = open(attach, Kind::InstanceGenerator);
    let mut state = FleetState {
        time_s: 2.5,
        next: Instance {
            starts: vec![0, 5],
            headings: Some(vec![Heading::West, Heading::South]),
            goals: [vec![], vec![3]].into_iter().collect(),
            window_steps: 5,
            motion: Motion::Rotation,
            objective: Objective::Makespan,
            radius_m: 0.125,
            ..Instance::default()
        },
        tasks: vec![
            Task {
                id: 1,
                places: vec![4],
                released_s: 0.5,
            },
            Task {
                id: 4,
                places: vec![],
                released_s: 1.0 / 3.0,
            },
        ],
        parts: Vec::new(),
    };
    let next = session.generate(&state, &budget(0)).expect("a request");
    let next = next.request;
    let expected = Request {
        goals: [[1, 4], [3, 4]].into_iter().collect(),
        window_steps: 7,
        window_s: 0.0,
        assignments: vec![
            Assignment {
                agent: 1,
                task: u64::MAX - 1,
            },
            Assignment {
                agent: 0,
                task: u64::MAX - 4,
            },
        ],
    };
    assert_eq!(next, expected);
    state.tasks.clear();
    let fault = session.generate(&state, &budget(0)).expect_err("no tasks");
    assert!(
        matches!(
            &fault,
            Fault::Reported {
                status: Status::GaveUp,
                ..
            }
        ),
        "{fault}"
    );
    session.close();
}

fn invocation_policy(attach: Attach) {
    let mut session = open(attach, Kind::InvocationPolicy);
    let limit = Duration::from_secs(20);
    let mut status = FleetStatus {
        time_s: 1.0,
        since_last_call_s: 2.0,
        planning_limit_s: 4.0,
        action_s: 0.5,
        actions_left: vec![2, 4],
    };
    assert_eq!(session.should_invoke(&status, limit), Ok(true));
    status.actions_left.push(1);
    assert_eq!(session.should_invoke(&status, limit), Ok(false));
    status.time_s = -10.0;
    let fault = session.should_invoke(&status, limit).expect_err("a fault");
    assert!(fault.to_string().contains("time runs backwards"), "{fault}");
    session.close();
}

type Case = fn(Attach);

fn main() {
    supervisor::intercept(BUILT_IN);
    if std::env::args().nth(1).as_deref() == Some(SERVE) {
        std::process::exit(serve::serve_stdio(catalog()));
    }
    let cases: [(&str, Case); 6] = [
        ("planner", planner),
        ("leftovers", leftovers),
        ("representations", representations),
        ("fail_policy", fail_policy),
        ("instance_generator", instance_generator),
        ("invocation_policy", invocation_policy),
    ];
    let attachments = [
        ("in_process", Attach::InProcess),
        ("worker", Attach::Worker),
        ("stdio", Attach::Stdio),
    ];
    let mut trials = Vec::new();
    for (kind, case) in cases {
        for (name, attach) in attachments {
            trials.push(Trial::test(format!("{kind}::{name}"), move || {
                case(attach);
                Ok(())
            }));
        }
    }
    libtest_mimic::run(&Arguments::from_args(), trials).exit();
}

//! Environments, instances and plans of all representations arrive as they were sent, by the C
//! structures and by JSON.

#![allow(unsafe_code)]

use std::sync::Arc;

use fleetyard_abi::convert::{CEnvironment, CFleetState, CInstance};
use fleetyard_abi::moves::OFF_MAP;
use fleetyard_abi::paths::{PlanContext, WritePlan};
use fleetyard_abi::wire::PlanText;
use fleetyard_abi::{
    Annotation, ControlPlan, Environment, FleetState, Footprint, GoalTasks, GridEnvironment,
    GridPlan, Guidance, Heading, Instance, Kept, Knot, KnotPlan, Limit, Lists, Motion, MotionPlan,
    Mover, Objective, Part, PathEncoding, Plan, PlanRef, RestOfPlan, RoadmapEnvironment, Robot,
    Snapshot, State, Task, Traffic, View, Visit, VisitPlan, WorkspaceEnvironment,
};
use proptest::collection::{btree_set, vec};
use proptest::option;
use proptest::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;

fn metres() -> impl Strategy<Value = f64> {
    -1e3..1e3
}

fn points(most: usize) -> impl Strategy<Value = Vec<[f64; 2]>> {
    vec([metres(), metres()], 3..most)
}

fn parts() -> impl Strategy<Value = Vec<Part>> {
    let data = prop_oneof![
        Just(serde_json::Value::Null),
        any::<bool>().prop_map(Into::into),
        metres().prop_map(Into::into),
        vec(any::<u32>(), 0..3).prop_map(Into::into),
        "[a-z \"\u{e4}]{0,5}".prop_map(|text| serde_json::json!({ "text": text })),
    ];
    let part = ("[a-z.]{1,8}/1", any::<bool>(), data);
    let other = part.prop_map(|(id, critical, data): (_, _, serde_json::Value)| Part {
        id,
        critical,
        data: data.into(),
    });
    vec(prop_oneof![other, memory()], 0..4)
}

/// Bytes of which many are 0.
fn averages(len: usize) -> impl Strategy<Value = Vec<u8>> {
    vec(prop_oneof![3 => Just(0), 1 => any::<u8>()], len)
}

fn traffic() -> impl Strategy<Value = Traffic> {
    (0_usize..200, 0_usize..9).prop_flat_map(|(places, lanes)| {
        let snapshot = || {
            let snapshot = (0_u64..1 << 53, averages(places), averages(places * lanes));
            snapshot.prop_map(|(number, waiting, flow)| Snapshot {
                number,
                waiting,
                flow,
            })
        };
        let times = [metres(), metres(), metres(), metres()];
        (times, snapshot(), snapshot()).prop_map(
            |([period_s, time_constant_s, since_s, flow_unit_per_s], last, before)| Traffic {
                period_s,
                time_constant_s,
                since_s,
                flow_unit_per_s,
                last,
                before,
            },
        )
    })
}

/// A part that this version knows.
fn memory() -> impl Strategy<Value = Part> {
    let rest = vec("[.NESWnesw]{0,5}", 0..4).prop_map(|paths| RestOfPlan { paths });
    let errand = option::of((0_u64..1 << 53, 0_u32..9));
    let goals = (metres(), vec((errand, metres(), metres()), 0..4));
    let goals = goals.prop_map(|(time_s, goals)| {
        let mut tasks = GoalTasks {
            time_s,
            ..GoalTasks::default()
        };
        for (errand, released_s, given_s) in goals {
            tasks.push(errand, released_s, given_s);
        }
        tasks
    });
    let factors = || vec(10_u16..=10_000, 0..40);
    let guidance = (factors(), factors()).prop_map(|(moves, waits)| Guidance { moves, waits });
    let kept = vec(any::<u8>(), 0..300).prop_map(|bytes| Kept { bytes });
    prop_oneof![
        traffic().prop_map(Part::from),
        rest.prop_map(Part::from),
        goals.prop_map(Part::from),
        guidance.prop_map(Part::from),
        kept.prop_map(Part::from),
    ]
}

fn grid() -> impl Strategy<Value = GridEnvironment> {
    (1_u32..5, 1_u32..5, any::<bool>()).prop_flat_map(|(rows, cols, four)| {
        let cells = (rows * cols) as usize;
        let lists = (
            vec(0_u8..2, cells),
            vec(prop::sample::select(&b".@TSEW"[..]), cells),
            vec(any::<u8>(), cells),
        );
        let numbers = [metres(), metres(), metres(), metres()];
        (lists, numbers, any::<bool>()).prop_map(move |(lists, numbers, is_plain)| {
            let (passable, terrain, masks) = lists;
            let [cell_size_m, step_s, x, y] = numbers;
            let connectivity = if four { 4 } else { 8 };
            let mut grid = GridEnvironment::new(rows, cols, connectivity, passable);
            if !is_plain {
                for (own, mask) in grid.moves.iter_mut().zip(masks) {
                    *own &= mask;
                }
            }
            GridEnvironment {
                cell_size_m,
                step_s,
                origin_m: [x, y],
                terrain,
                ..grid
            }
        })
    })
}

fn footprint() -> impl Strategy<Value = Footprint> {
    let corners = prop_oneof![Just(Vec::new()), points(6)];
    (0.1..2.0, corners).prop_map(|(radius_m, corners_m)| Footprint {
        radius_m,
        corners_m,
    })
}

fn workspace() -> impl Strategy<Value = WorkspaceEnvironment> {
    let mover = (
        footprint(),
        vec([metres(), metres(), metres(), metres()], 1..4),
    );
    let mover = mover.prop_map(|(footprint, mut knots)| {
        knots.sort_by(|one, other| one[0].total_cmp(&other[0]));
        Mover { footprint, knots }
    });
    let bounds = [[metres(), metres()], [metres(), metres()]];
    (bounds, vec(points(6), 0..4), vec(mover, 0..3)).prop_map(
        |([min_m, max_m], obstacles, movers)| WorkspaceEnvironment {
            min_m,
            max_m,
            obstacles: obstacles.into_iter().collect(),
            movers,
        },
    )
}

fn roadmap() -> impl Strategy<Value = RoadmapEnvironment> {
    (1_usize..6).prop_flat_map(|vertices| {
        let edges = vec(btree_set(0..vertices as u32, 0..vertices), vertices);
        let places = (vec(metres(), vertices), vec(metres(), vertices));
        let sizes = (0.1..9.0, 0.1..9.0);
        let own = option::of((0.1..9.0, 0.1..9.0));
        (edges, places, sizes, own, option::of(workspace())).prop_map(
            |(edges, (x_m, y_m), (speed, separation), own, workspace)| {
                let edges: Lists<u32> = edges.into_iter().collect();
                let mut roadmap = RoadmapEnvironment::straight(x_m, y_m, edges, speed, separation);
                if let Some((length, duration)) = own {
                    roadmap.length_m.iter_mut().for_each(|own| *own += length);
                    roadmap
                        .duration_s
                        .iter_mut()
                        .for_each(|own| *own += duration);
                }
                RoadmapEnvironment {
                    workspace,
                    ..roadmap
                }
            },
        )
    })
}

fn environment() -> impl Strategy<Value = Environment> {
    let view = prop_oneof![
        grid().prop_map(View::Grid),
        roadmap().prop_map(View::Roadmap),
        workspace().prop_map(View::Workspace),
    ];
    ("[a-z \"\u{e4}]{0,5}", "[a-f0-9]{0,4}", view, parts()).prop_map(
        |(name, digest, view, parts)| Environment {
            name,
            digest,
            view,
            parts,
        },
    )
}

fn limits() -> impl Strategy<Value = Vec<[Limit; 2]>> {
    vec([option::of(metres()), option::of(metres())], 0..4)
}

fn robot() -> impl Strategy<Value = Robot> {
    let texts = ("[a-z]{0,4}", "[a-z/1]{0,6}");
    let flags = any::<[bool; 3]>();
    let numbers = (limits(), limits(), vec(metres(), 0..3));
    (texts, footprint(), flags, numbers).prop_map(
        |((name, dynamics), footprint, flags, (state_limits, control_limits, parameters))| {
            let [has_heading, polar_state, polar_control] = flags;
            Robot {
                name,
                footprint,
                dynamics,
                has_heading,
                polar_state,
                polar_control,
                state_limits,
                control_limits,
                parameters,
            }
        },
    )
}

/// The part that instances of all representations share.
fn frame(agents: usize) -> impl Strategy<Value = Instance> {
    let robots = (vec(robot(), 0..3), vec(any::<u32>(), agents));
    let codes = (
        prop::sample::select(Motion::ALL),
        prop::sample::select(Objective::ALL),
        any::<[bool; 2]>(),
    );
    let numbers = (any::<u32>(), [metres(), metres(), metres(), metres()]);
    (robots, codes, numbers, parts()).prop_map(
        |((robots, robot_of), (motion, objective, flags), (window_steps, numbers), parts)| {
            let [window_s, radius_m, goal_tolerance_m, goal_tolerance_rad] = numbers;
            let (goal_tolerance_rate, dynamics_tolerance) = (radius_m, window_s);
            let robot_of = if robots.len() > 1 {
                robot_of
            } else {
                Vec::new()
            };
            Instance {
                robots,
                robot_of,
                motion,
                objective,
                window_steps,
                window_s,
                radius_m,
                goal_tolerance_m,
                goal_tolerance_rad,
                goal_tolerance_rate,
                dynamics_tolerance,
                allows_cycles: flags[0],
                strict: flags[1],
                parts,
                ..Instance::default()
            }
        },
    )
}

/// With places, and with states, both with agents that have no goal.
fn instance() -> impl Strategy<Value = Instance> {
    (1_usize..4).prop_flat_map(|agents| {
        let headings = option::of(vec(prop::sample::select(Heading::ALL), agents));
        let goals = vec(vec(any::<u32>(), 0..3), agents);
        let places = (frame(agents), vec(any::<u32>(), agents), headings, goals);
        let places = places.prop_map(|(frame, starts, headings, goals)| Instance {
            starts,
            headings,
            goals: goals.into_iter().collect(),
            ..frame
        });
        let number = prop_oneof![metres(), Just(f64::NAN)];
        let goals = vec(vec(vec(number, 2..5).prop_map(State), 0..3), agents);
        let starts = vec(vec(metres(), 2..5).prop_map(State), agents);
        let states = (frame(agents), starts, goals);
        let states = states.prop_map(|(frame, start_states, goals)| Instance {
            start_states,
            goal_states: goals.into_iter().collect(),
            ..frame
        });
        prop_oneof![places, states]
    })
}

fn state() -> impl Strategy<Value = FleetState> {
    let task = (0_u64..1 << 53, vec(any::<u32>(), 0..3), metres());
    let task = task.prop_map(|(id, places, released_s)| Task {
        id,
        places,
        released_s,
    });
    (metres(), instance(), vec(task, 0..3), parts()).prop_map(|(time_s, next, tasks, parts)| {
        FleetState {
            time_s,
            next,
            tasks,
            parts,
        }
    })
}

fn visits() -> impl Strategy<Value = VisitPlan> {
    let vertex = prop_oneof![0..9_u32, Just(OFF_MAP)];
    let visit = (vertex, metres(), metres()).prop_map(|(vertex, arrival_s, departure_s)| Visit {
        vertex,
        arrival_s,
        departure_s,
    });
    vec(vec(visit, 0..4), 0..4).prop_map(|lists| lists.into_iter().collect())
}

/// Of robots with a heading and without one.
fn knots() -> impl Strategy<Value = KnotPlan> {
    let heading = prop_oneof![metres(), Just(f64::NAN)];
    let knot = (metres(), metres(), metres(), heading);
    let knot = knot.prop_map(|(time_s, x_m, y_m, heading_rad)| Knot {
        time_s,
        x_m,
        y_m,
        heading_rad,
    });
    vec(vec(knot, 0..4), 0..4).prop_map(|lists| lists.into_iter().collect())
}

/// Controls of agents of which some have knots too.
fn motions() -> impl Strategy<Value = MotionPlan> {
    let agent = (0..4_usize).prop_flat_map(|size| vec((metres(), vec(metres(), size)), 0..4));
    (knots(), vec(agent, 4)).prop_map(|(knots, agents)| {
        let mut controls = ControlPlan::default();
        for segments in agents.into_iter().take(knots.len()) {
            controls.push_agent(segments).unwrap();
        }
        MotionPlan::new(knots, controls).unwrap()
    })
}

/// The same plan from the message that has it.
#[track_caller]
fn motions_by_json(sent: &MotionPlan) {
    let most = PlanRef::from(sent).entries();
    let written = WritePlan {
        plan: sent.into(),
        context: PlanContext::Trajectories(most),
        encoding: PathEncoding::default(),
    };
    let text = serde_json::to_string(&written).unwrap();
    let message: PlanText<'_> = serde_json::from_str(&text).unwrap();
    let arrived = PlanContext::Trajectories(most).read(&message).unwrap();
    let sent = Some(Plan::from(sent.clone()));
    assert_eq!(format!("{arrived:?}"), format!("{sent:?}"), "{text}");
    if let Some(fewer) = most.checked_sub(1) {
        let refused = PlanContext::Trajectories(fewer).read(&message).unwrap_err();
        assert!(
            refused.contains("too long in the motion of agent"),
            "{refused}"
        );
    }
}

fn cells() -> impl Strategy<Value = GridPlan> {
    vec(vec(any::<u32>(), 0..4), 0..4).prop_map(GridPlan::from_paths)
}

/// The same value from its JSON. Compared is what is shown, for NaN is not equal to itself.
#[track_caller]
fn by_json<T: Serialize + DeserializeOwned + std::fmt::Debug>(sent: &T) {
    let text = serde_json::to_string(sent).unwrap();
    let arrived: T = serde_json::from_str(&text).unwrap_or_else(|error| panic!("{error}: {text}"));
    assert_eq!(format!("{arrived:?}"), format!("{sent:?}"), "{text}");
}

#[track_caller]
fn same<T: std::fmt::Debug>(arrived: Result<T, fleetyard_abi::sdk::Failure>, sent: &T) {
    assert_eq!(format!("{:?}", arrived.unwrap()), format!("{sent:?}"));
}

#[track_caller]
fn plan_by_c(sent: &Plan) {
    let (agents, entries) = (sent.agents(), sent.as_ref().entries());
    // SAFETY: a plan in its C form is whole.
    let read = |most| {
        sent.as_ref()
            .with_c(|raw| unsafe { Plan::from_c(raw, Some(agents), most) })
    };
    same(read(entries), sent);
    assert!(entries == 0 || read(entries - 1).is_err());
    // SAFETY: as above.
    let other = sent
        .as_ref()
        .with_c(|raw| unsafe { Plan::from_c(raw, Some(agents + 1), entries) });
    assert!(other.is_err());
}

fn annotation() -> impl Strategy<Value = Annotation> {
    let lists = || vec(vec([metres(), metres()], 0..4), 0..4);
    let shapes = prop_oneof![
        lists().prop_map(|lines| Annotation::lines("a", lines)),
        lists().prop_map(|rings| Annotation::rings("ä b", rings)),
        points(5).prop_map(|points| Annotation::points("a", points)),
        vec(vec(0_u32..9, 0..4), 0..4).prop_map(|places| Annotation::places("a", places)),
    ];
    let times = (0.0..9.0, option::of(9.0..20.0));
    let about = (
        option::of(0_u32..4),
        times,
        "[a-z \"\u{e4}]{0,5}",
        any::<bool>(),
    );
    (shapes, about).prop_map(
        |(shapes, (agent, (from_s, to_s), text, valued))| Annotation {
            agent,
            from_s,
            to_s,
            text,
            values: std::vec![0.5; if valued { shapes.shapes() } else { 0 }],
            ..shapes
        },
    )
}

proptest! {
    #[test]
    fn environments_arrive_as_they_were_sent(sent in environment()) {
        by_json(&sent);
        let shared = Arc::new(sent.clone());
        let raw = CEnvironment::new(&shared);
        // SAFETY: an environment in its C form is whole.
        same(unsafe { Environment::from_c(raw.raw()) }, &sent);
    }

    #[test]
    fn annotations_arrive_as_they_were_sent(sent in annotation()) {
        by_json(&sent);
        // SAFETY: an annotation in its C form is whole.
        let arrived = sent.with_c(|raw| unsafe { Annotation::from_c(raw, 4, 9) });
        same(arrived.unwrap(), &sent);
    }

    #[test]
    fn instances_arrive_as_they_were_sent(sent in instance()) {
        by_json(&sent);
        let raw = CInstance::new(&sent, std::ptr::null());
        // SAFETY: an instance in its C form is whole.
        same(unsafe { Instance::from_c(raw.raw()) }, &sent);
    }

    #[test]
    fn states_of_fleets_arrive_as_they_were_sent(sent in state()) {
        by_json(&sent);
        let raw = CFleetState::new(&sent, std::ptr::null());
        // SAFETY: a state in its C form is whole.
        same(unsafe { FleetState::from_c(raw.raw()) }, &sent);
    }

    #[test]
    fn plans_arrive_as_they_were_sent(
        cells in cells(),
        visits in visits(),
        knots in knots(),
        motions in motions(),
    ) {
        // Cells in JSON are for the module `paths`.
        by_json(&visits);
        by_json(&knots);
        motions_by_json(&motions);
        for plan in [cells.into(), visits.into(), knots.into(), Plan::from(motions)] {
            plan_by_c(&plan);
        }
    }
}

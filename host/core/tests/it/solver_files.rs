//! Problems as programs on roadmaps and in the plane read them, and the way back of their answers.

#![allow(clippy::float_cmp, reason = "what is kept is kept exactly")]

use fleetyard_core::formats::{
    DynobenchProblem, Format, Known, read_psipp_plan, write_ccbs_task, write_dynobench_problem,
    write_psipp_problem,
};
use fleetyard_core::{InputError, Knot, Roadmap, RoadmapPlan, TrajectoryPlan};
use proptest::prelude::*;

fn corner() -> Roadmap {
    let edges = [(0, 1), (1, 0), (1, 2)];
    Roadmap::new(vec![0.0, 3.0, 3.0], vec![0.0, 0.1, 4.0], edges).unwrap()
}

#[test]
fn problems_on_roadmaps() {
    assert_eq!(
        String::from_utf8(write_ccbs_task(&[0, 2], &[1, 0])).unwrap(),
        "<?xml version=\"1.0\" ?>\n<root>\n    <agent start_id=\"0\" goal_id=\"1\"/>\n    \
         <agent start_id=\"2\" goal_id=\"0\"/>\n</root>\n"
    );
    assert_eq!(
        String::from_utf8(write_psipp_problem(&corner(), &[0], &[2], 0.25)).unwrap(),
        "3 3 1\n0 0\n3 0.1\n3 4\n0 1\n1 0\n1 2\n0 2\n0.25\n"
    );
}

#[test]
fn problems_in_the_plane() {
    let problem = DynobenchProblem {
        min_m: [0.0, -1.0],
        max_m: [5.0, 5.5],
        boxes_m: vec![[[1.0, 2.0], [2.0, 4.0]]],
        robots: vec![("unicycle_first_order_0", &[1.0, 2.5, 0.0], &[4.0, 2.5, 0.1])],
    };
    assert_eq!(
        String::from_utf8(write_dynobench_problem(&problem)).unwrap(),
        "environment:\n  min: [0, -1]\n  max: [5, 5.5]\n  obstacles:\n    - type: box\n      \
         center: [1.5, 3]\n      size: [1, 2]\nrobots:\n  - type: unicycle_first_order_0\n    \
         start: [1, 2.5, 0]\n    goal: [4, 2.5, 0.1]\n"
    );
    let empty = write_dynobench_problem(&DynobenchProblem::default());
    let text = String::from_utf8(empty).unwrap();
    assert!(text.contains("\n  obstacles: []\n"), "{text}");
}

const PLAN: &str =
    "2 0.500000\n3\n0.000000\n0.000000 0.000000\n1.5\n0 0\n4.501666\n3 0.1\n1\n0\n3 4\n";

#[test]
fn plans_of_psipp() {
    let read = |text: &str| read_psipp_plan("plan.txt", text.as_bytes());
    let plan = read(PLAN).unwrap();
    assert_eq!(plan.knots(0).time_s, [0.0, 1.5, 4.501_666]);
    assert_eq!(
        (plan.knots(1).x_m, plan.knots(1).y_m),
        (&[3.0][..], &[4.0][..])
    );
    let contents = fleetyard_core::formats::Contents::read(
        std::path::Path::new("plan.txt"),
        PLAN.as_bytes(),
        Some(Format::PsippPlan),
        Known::default(),
    );
    assert_eq!(contents.unwrap().trajectories.unwrap().plan, plan);
    let told = |text: &str| {
        let error: InputError = read(text).expect_err(text);
        let hint = error.hint.clone().unwrap_or_default();
        format!("{error} | {hint}")
    };
    let cases = [
        (
            "",
            "plan.txt:1:1: the plan ends before the number of agents | the program was stopped",
        ),
        (
            "0 1\n",
            "plan.txt:1:1: the number of agents is 0, not 1 to ",
        ),
        (
            "1 1\n2\n0\n0 0\n",
            "plan.txt:4:4: the plan ends before a time | ",
        ),
        ("1 1\n1\n0\n0 x\n", "plan.txt:4:3: expected y, found 'x' | "),
        (
            "1 1\n1\n0\n0 nan\n",
            "plan.txt:3:1: knot 0 of agent 0 has y NaN, which is not finite | ",
        ),
        ("1 1\n0\n", "plan.txt:2:1: agent 0 has no knots | "),
        (
            "1 1\n99999999999999999\n0\n0 0\n",
            "plan.txt:4:4: the plan ends before a time | ",
        ),
        (
            "1 1\n-1\n",
            "plan.txt:2:1: expected the points of agent 0, found '-1' | ",
        ),
        (
            "1 1\n2\n0\n0 0\n0\n1 0\n",
            "plan.txt:5:1: there is a gap at knot 1 of agent 0",
        ),
        (
            "1 1\n1\n0\n0 0\n1 1\n",
            "plan.txt:5:1: the text goes on after the last agent's path | the program appends",
        ),
    ];
    for (text, expected) in cases {
        let told = told(text);
        assert!(told.starts_with(expected), "{text:?}: {told}");
    }
}

fn knots(places: &[(f64, f64, f64)]) -> TrajectoryPlan {
    let mut plan = TrajectoryPlan::default();
    let path = places.iter().map(|(time_s, x_m, y_m)| Knot {
        time_s: *time_s,
        x_m: *x_m,
        y_m: *y_m,
        heading_rad: None,
    });
    plan.push_path(path).unwrap();
    plan
}

#[test]
fn a_plan_in_the_plane_becomes_visits_where_it_goes_along_edges() {
    let visits = |places: &[(f64, f64, f64)], starts: &[u32]| {
        RoadmapPlan::of_trajectories(&knots(places), &corner(), starts, 1e-6)
            .map_err(|error| error.to_string())
    };
    let way = [
        (0.0, 0.0, 0.0),
        (1.0, 0.0, 0.0),
        (4.0, 3.0, 0.100_000_4),
        (8.0, 3.0, 4.0),
    ];
    let found = visits(&way, &[0]).unwrap();
    let path: Vec<(u32, f64, f64)> = found.path(0).iter().map(|at| (*at).into()).collect();
    assert_eq!(path, [(0, 0.0, 1.0), (1, 4.0, 4.0), (2, 8.0, 8.0)]);
    let faults = [
        (
            visits(&way, &[1]),
            "agent 0 is at (0, 0) at 0 s, which is neither vertex 1 nor an end",
        ),
        (
            visits(&way, &[0, 1]),
            "there are paths for 1 agents, but 2 starts",
        ),
        (
            visits(&way, &[3]),
            "visit 0 of agent 0 is to vertex 3, but the roadmap has 3",
        ),
        // Edges are driven one way, and only to their ends.
        (
            visits(&[(0.0, 3.0, 4.0), (4.0, 3.0, 0.1)], &[2]),
            "agent 0 is at (3, 0.1) at 4 s, which is neither vertex 2 nor an end of an edge from there",
        ),
        (
            visits(&[(0.0, 0.0, 0.0), (4.0, 3.0, 0.1001)], &[0]),
            "agent 0 is at (3, 0.1001) at 4 s",
        ),
    ];
    for (found, reason) in faults {
        let told = found.expect_err(reason);
        assert!(told.starts_with(reason), "{told}");
    }
}

proptest! {
    /// Every box that is written covers the one that was asked for, and by no more than rounding.
    #[test]
    fn boxes_are_covered(low in -1e3..1e3, length in 1e-3..1e3, other in -1e3..1e3) {
        let problem = DynobenchProblem {
            boxes_m: vec![[[low, other], [low + length, other + length]]],
            ..DynobenchProblem::default()
        };
        let text = String::from_utf8(write_dynobench_problem(&problem)).unwrap();
        let row = |key: &str| -> Vec<f64> {
            let line = text.lines().find(|line| line.trim_start().starts_with(key)).unwrap();
            let (_, row) = line.split_once('[').unwrap();
            row.trim_end_matches(']').split(", ").map(|number| number.parse().unwrap()).collect()
        };
        let (center, size) = (row("center"), row("size"));
        for (axis, from) in [low, other].into_iter().enumerate() {
            let to = from + length;
            let ends = (center[axis] - size[axis] / 2.0, center[axis] + size[axis] / 2.0);
            prop_assert!(ends.0 <= from && ends.1 >= to);
            prop_assert!(from - ends.0 < 1e-12 && ends.1 - to < 1e-12);
        }
    }
}

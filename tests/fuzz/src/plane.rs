//! Plans in the plane, roadmaps, plans on them, and the files of other planners there.

#![allow(clippy::float_cmp, reason = "what is kept is kept exactly")]

use fleetyard_abi::Footprint;
use fleetyard_core::formats::{
    CcbsPlaces, MapSize, read_ccbs_log, read_ccbs_roadmap, read_dynobench, read_psipp_plan,
    write_ccbs_roadmap,
};
use fleetyard_core::{
    ControlPlan, InputError, Knot, Knots, Roadmap, RoadmapPlanFile, Robot, TrajectoryFile,
    TrajectoryPlan, read_roadmap, read_roadmap_plan, read_trajectories, write_roadmap,
    write_roadmap_plan, write_trajectories,
};
use fleetyard_sim::motion::Model;
use fleetyard_world::{ControlModel, Dynamics};

use super::check_error;

const SOURCE: &str = "folder/a.json";

const SIZE: MapSize = MapSize { rows: 3, cols: 4 };

/// Reads a file in every format of what is in the plane.
pub fn run(data: &[u8]) {
    if let Some(file) = read(data, read_trajectories) {
        if let Some(digest) = file.plan_digest {
            assert_eq!(digest, file.plan.digest());
        }
        trajectories(&file.plan, data);
        let again = read_trajectories(SOURCE, &write_trajectories(&file));
        assert_eq!(again.as_ref(), Ok(&file));
    }
    let roadmap = read(data, read_roadmap);
    for roadmap in [roadmap, read(data, read_ccbs_roadmap)]
        .into_iter()
        .flatten()
    {
        self::roadmap(&roadmap, data);
    }
    if let Some(file) = read(data, read_roadmap_plan) {
        roadmap_plan(&file, data);
    }
    let plans = [
        read(data, |source, data| {
            read_ccbs_log(source, data, CcbsPlaces::Unknown)
        }),
        read(data, |source, data| {
            read_ccbs_log(source, data, CcbsPlaces::Grid(SIZE))
        }),
        read(data, read_psipp_plan),
        read(data, read_dynobench),
    ];
    for plan in plans.into_iter().flatten() {
        assert!(plan.agents() > 0);
        trajectories(&plan, data);
        let file = TrajectoryFile {
            source: SOURCE.to_owned(),
            ..TrajectoryFile::new(plan)
        };
        let again = read_trajectories(SOURCE, &write_trajectories(&file));
        assert_eq!(again.as_ref(), Ok(&file));
    }
}

fn read<T>(data: &[u8], reader: impl Fn(&str, &[u8]) -> Result<T, InputError>) -> Option<T> {
    let read = reader(SOURCE, data);
    read.map_err(|error| check_error(&error, SOURCE, data)).ok()
}

/// Dynamics, and numbers of a state and of a control.
const MODELS: [(&str, usize, usize); 7] = [
    ("single-integrator", 2, 2),
    ("double-integrator", 4, 2),
    ("unicycle", 3, 2),
    ("differential-drive", 3, 2),
    ("unicycle-2", 5, 2),
    ("holonomic", 3, 3),
    ("holonomic-2", 6, 3),
];

/// Whatever controls lead to is a path, and not longer than it may be.
fn driven(controls: &ControlPlan) {
    const MOST: usize = 1 << 10;
    for (name, states, numbers) in MODELS {
        let free = |count: usize| vec![[None; 2]; count];
        let robot = Robot {
            name: String::new(),
            footprint: Footprint::disc(0.25),
            dynamics: format!("fleetyard.{name}/1"),
            has_heading: !name.ends_with("integrator"),
            polar_state: false,
            polar_control: false,
            state_limits: free(states),
            control_limits: free(numbers),
            parameters: if name.starts_with("differential") {
                vec![0.5, 1.0]
            } else {
                Vec::new()
            },
        };
        let model = ControlModel::new(&robot).expect("a model");
        for agent in 0..controls.agents() {
            let start = vec![0.25; states];
            match model.drive(&start, controls.of(agent), MOST) {
                Ok(driven) => {
                    assert!(driven.knots.len() <= MOST && driven.end.len() == states);
                    let mut plan = TrajectoryPlan::default();
                    plan.push_path(driven.knots).expect("a path");
                }
                Err(error) => assert!(!error.to_string().is_empty()),
            }
        }
    }
}

/// Properties of every plan.
fn trajectories(plan: &TrajectoryPlan, data: &[u8]) {
    // A knot is several bytes.
    assert!(plan.knot_count() <= data.len() && plan.agents() <= data.len());
    assert_eq!(plan.offsets().last(), Some(&plan.knot_count()));
    assert!(plan.horizon_s() >= 0.0);
    if let Some(controls) = plan.controls() {
        assert!(controls.agents() == plan.agents() && controls.segments() <= data.len());
        driven(controls);
    }
    for (knots, fastest) in plan.paths().zip(plan.fastest()) {
        assert_eq!(knots.time_s[0], 0.0);
        assert!(knots.time_s.is_sorted_by(|one, next| one < next));
        assert_eq!(knots.heading_rad.is_some(), plan.has_headings());
        let near = |value: &f64| value.abs() <= TrajectoryPlan::LARGEST;
        assert!(knots.x_m.iter().chain(knots.y_m).all(near));
        // It is where its knots say.
        for knot in knots.iter() {
            assert_eq!(knots.at(knot.time_s), knot);
        }
        let last = knots.get(knots.len() - 1);
        assert!(knots.arrival() < knots.len());
        assert_eq!(knots.at(1e12).x_m, last.x_m);
        assert!(knots.length_m().is_finite());
        assert!(fastest.speed_knot < knots.len() && fastest.turn_knot < knots.len());
        assert!(fastest.speed_m_per_s >= 0.0 && fastest.turn_rad_per_s >= 0.0);
        // Bodies that can do anything can do this; of others it says by how much they cannot.
        assert_eq!(Dynamics::UNLIMITED.excesses(knots), []);
        for name in [
            "unicycle-2",
            "double-integrator",
            "go2",
            "single-integrator",
        ] {
            let model: Model = name.parse().expect("a model");
            for excess in model.dynamics().excesses(knots) {
                assert!(
                    excess.value.is_finite() && excess.value > excess.limit,
                    "{excess:?}"
                );
                assert!(excess.knot < knots.len() && excess.time_s <= knots.end_s());
            }
        }
    }
    let column = |pick: fn(&Knot) -> f64| -> Vec<f64> {
        let knots = plan.paths().flat_map(Knots::iter);
        knots.map(|knot| pick(&knot)).collect()
    };
    let headings = plan
        .has_headings()
        .then(|| column(|knot| knot.heading_rad.unwrap_or(0.0)));
    let again = TrajectoryPlan::from_columns(
        plan.offsets().to_vec(),
        column(|knot| knot.time_s),
        column(|knot| knot.x_m),
        column(|knot| knot.y_m),
        headings,
    );
    let again = again.and_then(|again| match plan.controls() {
        Some(controls) => again.with_controls(controls.clone()),
        None => Ok(again),
    });
    assert_eq!(again.as_ref(), Ok(plan));
}

fn roadmap(roadmap: &Roadmap, data: &[u8]) {
    assert!(roadmap.vertices() <= data.len() && roadmap.edge_count() <= data.len());
    let again = read_roadmap(SOURCE, &write_roadmap(roadmap)).expect("a roadmap");
    assert_eq!(again, *roadmap);
    assert_eq!(again.digest(), roadmap.digest());
    let again = read_ccbs_roadmap(SOURCE, &write_ccbs_roadmap(roadmap)).expect("a roadmap");
    assert_eq!(again, *roadmap);
    assert_eq!(roadmap.edges().count(), roadmap.edge_count());
    assert!(
        roadmap
            .edges()
            .all(|(from, to)| from != to && roadmap.has_edge(from, to))
    );
}

fn roadmap_plan(file: &RoadmapPlanFile, data: &[u8]) {
    assert!(file.plan.visit_count() <= data.len());
    let again = read_roadmap_plan(SOURCE, &write_roadmap_plan(file));
    assert_eq!(again.as_ref(), Ok(file));
    // Any plan can be held against a roadmap, also one that is for another.
    let square = Roadmap::new(
        vec![0.0, 1.0, 1.0, 0.0],
        vec![0.0, 0.0, 1.0, 1.0],
        [(0, 1), (1, 2), (2, 3), (3, 0)],
    );
    let square = square.expect("a roadmap");
    let fits = file.plan.check(&square).is_ok();
    let plan = file.plan.to_trajectories(&square);
    assert_eq!(plan.is_ok(), fits, "{plan:?}");
    if let Ok(plan) = plan {
        assert_eq!(plan.horizon_s(), file.plan.horizon_s());
        assert!(plan.knot_count() <= 2 * file.plan.visit_count());
    }
}

//! Questions to planners of all kinds.

use fleetyard_abi::sdk::Catalog;
use fleetyard_abi::{
    Descriptor, Environment, Footprint, Instance, Kind, Motion, RoadmapEnvironment, Robot,
    SharedEnvironment, State, WorkspaceEnvironment,
};

/// A map and what is asked on it.
pub(crate) type Question = (SharedEnvironment, Instance);

/// All standard planners that plan.
pub(crate) fn planners() -> Vec<Descriptor> {
    let mut all = fleetyard_plugins::catalog().descriptors();
    all.retain(|planner| planner.kind == Kind::Planner && planner.id != "empty");
    all
}

/// Streets of one metre between crossings in columns and rows, for discs.
pub(crate) fn streets(cols: u32, rows: u32, starts: Vec<u32>, goals: Vec<u32>) -> Question {
    let at = |v: u32| [f64::from(v % cols), f64::from(v / cols)];
    let targets = |v: u32| {
        let (col, row) = (v % cols, v / cols);
        let mut near = Vec::new();
        near.extend((row > 0).then(|| v - cols));
        near.extend((col > 0).then(|| v - 1));
        near.extend((col + 1 < cols).then(|| v + 1));
        near.extend((row + 1 < rows).then(|| v + cols));
        near
    };
    let vertices = 0..cols * rows;
    let map = RoadmapEnvironment::straight(
        vertices.clone().map(|v| at(v)[0]).collect(),
        vertices.clone().map(|v| at(v)[1]).collect(),
        vertices.map(targets).collect(),
        1.0,
        0.6,
    );
    let mut instance = Instance::one_shot(starts, goals);
    instance.motion = Motion::StopGo;
    instance.radius_m = 0.3;
    (SharedEnvironment::new(Environment::from(map)), instance)
}

/// A hall with square pillars, each given by its lower left corner, and discs with starts and goals.
/// None for dynamics that no disc here has.
pub(crate) fn hall(
    dynamics: &str,
    size: [f64; 2],
    pillars: &[[f64; 2]],
    ends: &[[[f64; 2]; 2]],
) -> Option<Question> {
    let (robot, numbers) = disc(dynamics)?;
    let state = |[x, y]: [f64; 2]| {
        let mut state = vec![x, y];
        state.resize(numbers, 0.0);
        State(state)
    };
    let square = |[x, y]: [f64; 2]| vec![[x, y], [x + 0.6, y], [x + 0.6, y + 0.6], [x, y + 0.6]];
    let map = WorkspaceEnvironment {
        min_m: [0.0, 0.0],
        max_m: size,
        obstacles: pillars.iter().map(|at| square(*at)).collect(),
        movers: Vec::new(),
    };
    let goals = ends.iter().map(|[_, goal]| vec![state(*goal)]);
    let instance = Instance {
        start_states: ends.iter().map(|[start, _]| state(*start)).collect(),
        goal_states: goals.collect(),
        robots: vec![robot],
        robot_of: Vec::new(),
        motion: Motion::Dynamics,
        radius_m: 0.3,
        goal_tolerance_m: 0.05,
        goal_tolerance_rad: 0.2,
        goal_tolerance_rate: 0.05,
        dynamics_tolerance: 0.01,
        ..Instance::one_shot(Vec::new(), Vec::new())
    };
    Some((SharedEnvironment::new(Environment::from(map)), instance))
}

/// A disc that moves so, and the numbers of its states.
fn disc(dynamics: &str) -> Option<(Robot, usize)> {
    let (numbers, heading) = match dynamics {
        "fleetyard.single-integrator/1" => (2, false),
        "fleetyard.double-integrator/1" => (4, false),
        "fleetyard.unicycle/1" => (3, true),
        "fleetyard.unicycle-2/1" => (5, true),
        _ => return None,
    };
    let pose = if heading { 3 } else { 2 };
    let limits = |at: usize| (at >= pose).then_some(1.0);
    let robot = Robot {
        name: "disc".into(),
        footprint: Footprint::disc(0.3),
        dynamics: dynamics.into(),
        has_heading: heading,
        polar_state: false,
        polar_control: !heading,
        state_limits: (0..numbers)
            .map(|at| [limits(at).map(|most| -most), limits(at)])
            .collect(),
        control_limits: vec![[Some(-1.0), Some(1.0)]; 2],
        parameters: Vec::new(),
    };
    Some((robot, numbers))
}

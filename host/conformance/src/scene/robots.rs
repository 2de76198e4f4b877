//! Robots of scenes.

use fleetyard_abi::{Footprint, Robot};

/// The dynamics that the host can judge. Planners that know several are asked about the first unless
/// a case is about others.
pub(crate) const DYNAMICS: [&str; 7] = [
    "fleetyard.single-integrator/1",
    "fleetyard.double-integrator/1",
    "fleetyard.unicycle/1",
    "fleetyard.differential-drive/1",
    "fleetyard.holonomic/1",
    "fleetyard.unicycle-2/1",
    "fleetyard.holonomic-2/1",
];

/// A disc that moves in any way.
pub(crate) fn disc(radius_m: f64) -> Robot {
    robot(Footprint::disc(radius_m), false)
}

/// A rectangle about its middle that moves in any way, turned or not.
pub(crate) fn rectangle(length_m: f64, width_m: f64) -> Robot {
    let (x, y) = (length_m / 2.0, width_m / 2.0);
    let footprint = Footprint {
        radius_m: x.hypot(y),
        corners_m: vec![[x, y], [-x, y], [-x, -y], [x, -y]],
    };
    robot(footprint, true)
}

fn robot(footprint: Footprint, has_heading: bool) -> Robot {
    let numbers = if has_heading { 3 } else { 2 };
    Robot {
        name: String::new(),
        footprint,
        dynamics: String::new(),
        has_heading,
        polar_state: false,
        polar_control: false,
        state_limits: vec![[None; 2]; numbers],
        control_limits: vec![[None; 2]; numbers],
        parameters: Vec::new(),
    }
}

/// The same robot with dynamics of this name, and limits: at most so fast ahead, in m/s.
pub(crate) fn moved_by(robot: Robot, dynamics: &str, speed_m_per_s: f64) -> Robot {
    let speed = [Some(-speed_m_per_s), Some(speed_m_per_s)];
    let ([slow, turn], [push, twist]) = (
        [0.5 * speed_m_per_s, 1.5].map(|most| [Some(-most), Some(most)]),
        [2.0, 4.0].map(|most| [Some(-most), Some(most)]),
    );
    let turns_axes = !dynamics.contains("integrator");
    let has_heading = robot.has_heading || turns_axes;
    let sideways = !dynamics.contains("unicycle") && !dynamics.contains("drive");
    let rates = [
        Some(speed),
        sideways.then_some(if turns_axes { slow } else { speed }),
        has_heading.then_some(turn),
    ];
    let changes = [
        Some(push),
        sideways.then_some(push),
        has_heading.then_some(twist),
    ];
    let pose = [
        Some([None; 2]),
        Some([None; 2]),
        has_heading.then_some([None; 2]),
    ];
    let is_second = dynamics.contains("double-") || dynamics.contains("-2/");
    let (state, control) = if is_second {
        (pose.into_iter().chain(rates).flatten().collect(), changes)
    } else {
        (pose.into_iter().flatten().collect(), rates)
    };
    Robot {
        dynamics: dynamics.into(),
        has_heading,
        polar_control: dynamics == DYNAMICS[0],
        state_limits: state,
        control_limits: control.into_iter().flatten().collect(),
        parameters: if dynamics.contains("drive") {
            // The track, and what the wheels do at full speed in a gentle bend.
            vec![0.4, 1.1 * speed_m_per_s]
        } else {
            Vec::new()
        },
        ..robot
    }
}

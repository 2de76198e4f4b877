//! The motions that controls lead to are the same in every build and on every target.

use fleetyard_abi::{ControlPlan, Robot};
use fleetyard_core::TrajectoryPlan;
use fleetyard_world::ControlModel;
use serde_json::json;

/// Name, numbers of a state, numbers of a control.
const MODELS: [(&str, usize, usize); 7] = [
    ("single-integrator", 3, 3),
    ("double-integrator", 6, 3),
    ("unicycle", 3, 2),
    ("differential-drive", 3, 2),
    ("unicycle-2", 5, 2),
    ("holonomic", 3, 3),
    ("holonomic-2", 6, 3),
];

#[test]
fn motions_by_controls_are_golden() {
    let segments = [
        (0.7, [0.9, 0.3, -0.4]),
        (1.3, [-0.2, 0.8, 1.1]),
        (0.1, [0.0, 0.0, 0.0]),
        (2.9, [0.35, -0.6, 0.0]),
    ];
    let mut plan = TrajectoryPlan::default();
    for (name, states, numbers) in MODELS {
        let robot: Robot = serde_json::from_value(json!({
            "footprint": {"radius_m": 0.3}, "dynamics": format!("fleetyard.{name}/1"),
            "has_heading": true, "state_limits": vec![[free(), free()]; states],
            "control_limits": vec![[free(), free()]; numbers],
            "parameters": if name == "differential-drive" { vec![0.5, 1.0] } else { Vec::new() },
        }))
        .unwrap();
        let mut controls = ControlPlan::default();
        let own = segments.map(|(duration_s, control)| (duration_s, control[..numbers].to_vec()));
        controls.push_agent(own).unwrap();
        let start = [1.5, -0.25, 0.75, 0.4, -0.3, 0.2];
        let model = ControlModel::new(&robot).unwrap();
        let driven = model
            .drive(&start[..states], controls.of(0), 1 << 12)
            .unwrap();
        plan.push_path(driven.knots).unwrap();
    }
    assert_eq!(
        plan.digest().to_string(),
        "bd5dcc3fe5efec729f4319aa007f4a01"
    );
}

fn free() -> Option<f64> {
    None
}

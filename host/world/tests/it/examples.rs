//! The world, the roadmap and the plans in `maps/` that were written by hand.

use std::path::PathBuf;

use fleetyard_core::formats::{AnyPlan, Contents, Known, Parts, load_any_plan};
use fleetyard_core::{Knot, TrajectoryPlan};
use fleetyard_world::{
    Footprint, Placement, Polygon, Pose, Shape, Workspace, load_workspace, separation_m,
    write_workspace,
};

fn file(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../../maps")
        .join(name)
}

/// Set `FLEETYARD_REGENERATE=1` to write the files as they would be written now, digests
/// and all, instead of comparing them.
fn check_content(name: &str, bytes: &[u8]) {
    if std::env::var_os("FLEETYARD_REGENERATE").is_some() {
        fleetyard_core::write_atomically(&file(name), bytes).unwrap();
    }
    let found = std::fs::read(file(name)).unwrap();
    assert!(found == bytes, "{name} is not what would be written");
}

#[test]
fn they_are_as_they_would_be_written() {
    let world = load_workspace(file("two-rooms.world.json")).unwrap();
    check_content("two-rooms.world.json", &write_workspace(&world));
    for name in [
        "two-rooms.roadmap.json",
        "two-rooms.roadmap-plan.json",
        "turning.trajectories.json",
    ] {
        let contents = Contents::load(&file(name), None, Known::default()).unwrap();
        let parts = Parts {
            roadmap: contents.roadmap,
            roadmap_plan: contents.roadmap_plan,
            trajectories: contents.trajectories,
            ..Parts::default()
        };
        let written = parts.write(contents.format, "two-rooms").unwrap();
        check_content(name, &written.bytes);
    }
}

/// The least separation of robots of one shape, from each other and from what stands.
fn clearance_m(world: &Workspace, plan: &TrajectoryPlan, shape: &Shape) -> (f64, f64) {
    let pose = |knot: Knot| Pose::new(knot.x_m, knot.y_m, knot.heading_rad.unwrap_or(0.0));
    let (mut between, mut around) = (f64::INFINITY, f64::INFINITY);
    for step in 0..=(plan.horizon_s() * 50.0) as usize {
        let poses = plan.paths().map(|knots| pose(knots.at(step as f64 / 50.0)));
        let poses: Vec<Placement> = poses.map(Placement::from).collect();
        for (at, one) in poses.iter().enumerate() {
            for other in &poses[..at] {
                between = between.min(separation_m(shape, *one, shape, *other));
            }
            for (at, part) in world.obstacles.iter().flat_map(Polygon::parts) {
                around = around.min(separation_m(shape, *one, part, Placement::from(*at)));
            }
        }
    }
    (between, around)
}

#[test]
fn the_plans_are_free_of_contacts() {
    let world = load_workspace(file("two-rooms.world.json")).unwrap();
    let disc = Footprint::Disc { radius_m: 0.3 };
    let rectangle = Footprint::Rectangle {
        length_m: 0.8,
        width_m: 0.4,
    };
    for (name, footprint, agents) in [
        ("two-rooms.roadmap-plan.json", disc, 3),
        ("turning.trajectories.json", rectangle, 2),
    ] {
        let AnyPlan::Trajectories(file) =
            load_any_plan(&file(name), None, Known::default()).unwrap()
        else {
            panic!("{name} is a plan in the plane");
        };
        assert_eq!(file.plan.agents(), agents);
        let (between, around) = clearance_m(&world, &file.plan, &footprint.shape().unwrap());
        assert!(between > 0.1 && around > 0.1, "{name}: {between}, {around}");
        for fastest in file.plan.fastest() {
            assert!(fastest.speed_m_per_s <= 1.0 + 1e-9, "{name}: {fastest:?}");
            let eighth = std::f64::consts::FRAC_PI_4;
            assert!(
                fastest.turn_rad_per_s <= eighth + 1e-9,
                "{name}: {fastest:?}"
            );
        }
    }
}

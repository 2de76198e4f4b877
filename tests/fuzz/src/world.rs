//! World files: bounds, obstacles and moving obstacles.

use fleetyard_world::{Workspace, read_workspace, write_workspace};

use super::check_error;

const SOURCE: &str = "a.world.json";

/// Reads a world file.
pub fn run(data: &[u8]) {
    let workspace = match read_workspace(SOURCE, data) {
        Ok(workspace) => workspace,
        Err(error) => return check_error(&error, SOURCE, data),
    };
    let Workspace {
        bounds,
        boundary,
        obstacles,
        movers,
        ..
    } = &workspace;
    assert!(bounds.contains(bounds.min) && bounds.contains(bounds.max));
    for obstacle in obstacles {
        let area = obstacle.area_m2();
        assert!(area.is_finite() && area > 0.0, "{obstacle:?}");
        assert!(obstacle.vertices().len() >= 3);
    }
    if let Some(boundary) = boundary {
        assert_eq!(boundary.polygon().bounds(), *bounds);
        // The frame around it is covered but for what is too thin to be a shape.
        assert!(boundary.outside().len() <= 2 * boundary.polygon().vertices().len() + 8);
    }
    for mover in movers {
        assert!(mover.times_s().is_sorted());
        for time_s in [-1.0, 0.0, 0.5, 1e300] {
            assert!(mover.pose_at(time_s).is_finite(), "{mover:?}");
        }
    }
    // Written once, a world does not change any more.
    let written = write_workspace(&workspace);
    let again = read_workspace(SOURCE, &written).expect("what was written can be read");
    assert_eq!(again.obstacles.len(), obstacles.len());
    assert_eq!(again.movers.len(), movers.len());
    assert_eq!(again.bounds, *bounds);
    assert_eq!(write_workspace(&again), written);
}

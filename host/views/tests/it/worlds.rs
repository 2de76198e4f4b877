//! Worlds of grids cover exactly the blocked cells.

use fleetyard_core::{Connectivity, Grid, load_map};
use fleetyard_views::{Free, grid_to_roadmap, grid_to_world};
use proptest::prelude::*;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn merged_obstacles_cover_the_blocked_cells(
        rows in 1..9u32,
        cols in 1..9u32,
        blocked in proptest::collection::vec(any::<bool>(), 64),
        cell_m in 0.05..3.0f64,
        origin in (-5.0..5.0f64, -5.0..5.0f64),
    ) {
        let cells = (rows * cols) as usize;
        let letters = blocked[..cells].iter().map(|blocked| if *blocked { b'@' } else { b'.' });
        let grid = Grid::new("random", rows, cols, letters.collect()).unwrap();
        let origin = [origin.0, origin.1];
        let world = grid_to_world(&grid, cell_m, origin).unwrap().world;
        let covered: f64 = world.obstacles.iter().map(fleetyard_world::Polygon::area_m2).sum();
        let solid = grid.cell_count() - grid.passable_count();
        // Together with the places below: disjoint, and nothing else.
        prop_assert!((covered - f64::from(solid) * cell_m * cell_m).abs() < 1e-9 * covered.max(1.0));
        prop_assert!(world.obstacles.len() <= solid as usize);
        let free = Free::new(&world);
        for cell in 0..grid.cell_count() {
            let (row, col) = grid.row_col(cell);
            for (x, y) in [(0.5, 0.5), (0.01, 0.02), (0.98, 0.03), (0.02, 0.99), (0.99, 0.97)] {
                let point = [
                    origin[0] + (f64::from(col) + x) * cell_m,
                    origin[1] + (f64::from(rows - 1 - row) + y) * cell_m,
                ];
                prop_assert_eq!(free.is_inside(point), grid.is_passable(cell));
            }
        }
    }
}

/// Digests of the world and of the roadmap of a map, equal in every build and on every machine.
#[test]
fn worlds_and_roadmaps_of_grids_are_golden() {
    let map = load_map(crate::tasks::maps("room-33-33-8.map")).unwrap();
    let world = grid_to_world(&map, 0.3, [0.1, -7.7]).unwrap().world;
    let [four, eight] = [Connectivity::Four, Connectivity::Eight].map(|connectivity| {
        let view = grid_to_roadmap(&map, connectivity, 0.3, [0.1, -7.7]).unwrap();
        view.roadmap.digest()
    });
    let found = [world.digest(), four, eight].map(|digest| digest.to_string());
    assert_eq!(found, GOLDEN);
}

const GOLDEN: [&str; 3] = [
    "9fd35cd4ec4c4b78acd822b303d2fd41",
    "792aa4c854ea23d9d72dbc9fc719613b",
    "84053bb727bf5300a4d2fb23bfe35025",
];

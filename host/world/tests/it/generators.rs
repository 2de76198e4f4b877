//! Promises of generated maps and scenarios, and the files in `maps/`.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;

use fleetyard_core::{
    Connectivity, Grid, InputError, Role, load_map, read_map, read_scen, write_map, write_scen,
};
use fleetyard_world::{
    EmptySpec, MapSpec, MazeAlgorithm, MazeRandom, MazeSpec, RandomSpec, RoomSpec, ScenarioSpec,
    WarehouseSpec,
};
use proptest::prelude::*;

fn pieces(grid: &Grid) -> u32 {
    grid.components(Connectivity::Four)
        .into_iter()
        .max()
        .unwrap_or(0)
}

#[track_caller]
fn fails(spec: &MapSpec, expected: &str) {
    let InputError {
        source,
        reason,
        hint,
        ..
    } = spec.generate().expect_err("bad parameters");
    let hint = hint.unwrap_or_default();
    assert_eq!(format!("{source}: {reason}; {hint}"), expected);
}

#[test]
fn bad_parameters() {
    let empty = |rows, cols| MapSpec::Empty(EmptySpec { rows, cols });
    fails(
        &empty(0, 3),
        "rows: rows is 0; rows is a whole number of 1 or more",
    );
    fails(
        &empty(3, 0),
        "cols: cols is 0; cols is a whole number of 1 or more",
    );
    fails(
        &empty(u32::MAX, u32::MAX),
        "rows: a map of 4294967295 rows and 4294967295 columns is too large; \
         a map has at most 1073741824 cells",
    );
    for density in [-0.1, 1.0, f64::NAN, f64::INFINITY] {
        fails(
            &MapSpec::Random(RandomSpec {
                rows: 3,
                cols: 3,
                obstacle_density: density,
                seed: 0,
            }),
            &format!(
                "obstacle-density: the obstacle density is {density}; \
                 the obstacle density is from 0 to below 1, such as 0.2"
            ),
        );
    }
    let room = RoomSpec {
        rows: 9,
        cols: 9,
        room_size: 4,
        doors: 1,
        seed: 0,
    };
    fails(
        &MapSpec::Room(RoomSpec {
            room_size: 1,
            ..room.clone()
        }),
        "room-size: room-size is 1; room-size is a whole number of 2 or more",
    );
    fails(
        &MapSpec::Room(RoomSpec { doors: 0, ..room }),
        "doors: doors is 0; doors is a whole number of 1 or more",
    );
    let maze = MazeSpec::lattice(0, 3, MazeAlgorithm::Prim, MazeRandom::ChaCha, 0);
    fails(
        &MapSpec::Maze(maze),
        "rows: rows is 1; rows is a whole number of 2 or more",
    );
    let maze = MazeSpec {
        corridor: 0,
        ..MazeSpec::lattice(3, 3, MazeAlgorithm::Prim, MazeRandom::ChaCha, 0)
    };
    fails(
        &MapSpec::Maze(maze),
        "corridor: corridor is 0; corridor is a whole number of 1 or more",
    );
    let house = warehouse([1, 1, 1, 1, 1], None);
    fails(
        &MapSpec::Warehouse(house.clone()),
        "margin: the warehouse has no free margin; give a margin of 1 or more, or more shelves",
    );
    fails(
        &MapSpec::Warehouse(WarehouseSpec {
            aisle: 0,
            ..house.clone()
        }),
        "aisle: aisle is 0; aisle is a whole number of 1 or more",
    );
    let most = u32::MAX;
    fails(
        &MapSpec::Warehouse(warehouse([most; 5], Some(most))),
        "blocks-across: a warehouse of 36893488134534201347 rows and 36893488134534201347 columns \
         is too large; a map has at most 1073741824 cells",
    );
    let grid = EmptySpec { rows: 2, cols: 2 }.generate().unwrap();
    for agents in [0, 5] {
        let error = ScenarioSpec { agents, seed: 0 }
            .generate(&grid)
            .unwrap_err();
        assert_eq!(
            error.to_string(),
            format!("agents: a scenario of {agents} agents on empty-2-2, which has room for 4")
        );
        assert_eq!(error.hint.as_deref(), Some("ask for 1 to 4 agents"));
    }
    let alone = Grid::new("alone", 1, 3, b".@.".to_vec()).unwrap();
    let error = ScenarioSpec { agents: 1, seed: 0 }
        .generate(&alone)
        .unwrap_err();
    assert_eq!(
        error.hint.as_deref(),
        Some("no free cell of the map has a free neighbour")
    );
}

fn warehouse(numbers: [u32; 5], margin: Option<u32>) -> WarehouseSpec {
    let [blocks_across, blocks_down, block_cols, block_rows, aisle] = numbers;
    WarehouseSpec {
        blocks_across,
        blocks_down,
        block_cols,
        block_rows,
        aisle,
        margin,
        ..WarehouseSpec::default()
    }
}

#[test]
fn warehouses_are_those_of_the_benchmark() {
    let Some(data) = std::env::var_os("FLEETYARD_DATA") else {
        return;
    };
    for numbers in [[10, 20, 10, 2, 1], [20, 40, 10, 2, 2]] {
        let spec = warehouse(numbers, None);
        let name = spec.name();
        let path = PathBuf::from(&data).join(format!("movingai/{name}/{name}.map"));
        let published = std::fs::read(path).unwrap();
        assert!(write_map(&spec.generate().unwrap()) == published, "{name}");
    }
}

/// The parameters of LSMART's warehouse-33-36.
fn warehouse_33_36() -> WarehouseSpec {
    WarehouseSpec {
        aisle_rows: Some(3),
        edge_rows: Some(2),
        open: true,
        endpoints: true,
        workstations: Some(3),
        ..warehouse([3, 8, 10, 1, 1], Some(2))
    }
}

#[test]
fn warehouse_with_roles_is_that_of_lsmart() {
    let grid = warehouse_33_36().generate().unwrap();
    assert_eq!(grid.name(), "warehouse-3-8-10-1-1-m2-a3-b2-open-e-w3");
    assert_eq!((grid.rows(), grid.cols()), (33, 36));
    assert_eq!(grid.cells_with(Role::Endpoint).count(), 480);
    assert_eq!(grid.cells_with(Role::Workstation).count(), 22);
    let Some(data) = std::env::var_os("FLEETYARD_DATA") else {
        return;
    };
    let published = load_map(PathBuf::from(data).join("lsmart/kiva_large_w_mode.json")).unwrap();
    assert!(grid.terrain() == published.terrain());
}

#[test]
fn roles_change_no_wall_and_no_shelf() {
    for (numbers, every) in [([10, 20, 10, 2, 1], 3), ([20, 40, 10, 2, 2], 5)] {
        let plain = warehouse(numbers, None);
        let with_roles = WarehouseSpec {
            endpoints: true,
            workstations: Some(every),
            ..plain.clone()
        };
        let (plain, with_roles) = (plain.generate().unwrap(), with_roles.generate().unwrap());
        assert_eq!(plain.digest(), with_roles.digest());
        let endpoints: Vec<u32> = with_roles.cells_with(Role::Endpoint).collect();
        assert!(!endpoints.is_empty());
        for cell in endpoints {
            let beside = [cell - plain.cols(), cell + plain.cols()];
            assert!(beside.iter().any(|cell| !plain.is_passable(*cell)));
        }
        let stations: Vec<u32> = with_roles.cells_with(Role::Workstation).collect();
        let columns = stations.iter().map(|cell| with_roles.row_col(*cell).1);
        let columns: BTreeSet<u32> = columns.collect();
        assert_eq!(columns, BTreeSet::from([1, plain.cols() - 2]));
        // As far from the upper wall as from the lower one, to a cell.
        let rows = stations.iter().map(|cell| with_roles.row_col(*cell).0);
        let (first, last) = (rows.clone().min().unwrap(), rows.max().unwrap());
        assert!(
            (plain.rows() - 1 - last).abs_diff(first) <= 1,
            "{first} {last}"
        );
    }
    let open = WarehouseSpec {
        open: true,
        endpoints: true,
        workstations: Some(2),
        ..warehouse([1, 2, 2, 1, 1], Some(1))
    };
    assert_eq!(open.generate().unwrap().terrain(), b"weew.@@.weew.@@.weew");
}

#[test]
fn warehouse_without_data() {
    let small = warehouse([2, 2, 2, 1, 1], None).generate().unwrap();
    let expected = "TTTTTTTTT\nT.......T\nT.TT.TT.T\nT.......T\nT.TT.TT.T\nT.......T\nTTTTTTTTT\n";
    let text = write_map(&small);
    assert!(String::from_utf8(text).unwrap().ends_with(expected));
}

#[test]
fn scenarios_have_the_columns_of_the_benchmark() {
    let grid = EmptySpec { rows: 16, cols: 16 }.generate().unwrap();
    let scenario = ScenarioSpec {
        agents: 256,
        seed: 1,
    }
    .generate(&grid)
    .unwrap();
    for entry in &scenario.entries {
        let (rows, cols) = (
            entry.start.0.abs_diff(entry.goal.0),
            entry.start.1.abs_diff(entry.goal.1),
        );
        let diagonal = f64::from(rows.min(cols));
        let expected = diagonal * std::f64::consts::SQRT_2 + f64::from(rows.abs_diff(cols));
        assert!((entry.optimal_length - expected).abs() < 1e-9);
        assert_eq!(entry.bucket, (expected / 4.0) as u32);
        assert_eq!(
            (entry.map.as_str(), entry.map_rows, entry.map_cols),
            ("empty-16-16.map", 16, 16)
        );
    }
}

fn specs() -> impl Strategy<Value = MapSpec> {
    let size = || (2u32..24, 2u32..24);
    let algorithm = prop_oneof![Just(MazeAlgorithm::Backtracker), Just(MazeAlgorithm::Prim)];
    let random = prop_oneof![Just(MazeRandom::ChaCha), Just(MazeRandom::Python)];
    prop_oneof![
        size().prop_map(|(rows, cols)| MapSpec::Empty(EmptySpec { rows, cols })),
        (size(), 0.0..0.99, any::<u64>()).prop_map(|((rows, cols), obstacle_density, seed)| {
            MapSpec::Random(RandomSpec {
                rows,
                cols,
                obstacle_density,
                seed,
            })
        }),
        (size(), 2u32..9, 1u32..4, any::<u64>()).prop_map(
            |((rows, cols), room_size, doors, seed)| {
                MapSpec::Room(RoomSpec {
                    rows,
                    cols,
                    room_size,
                    doors,
                    seed,
                })
            }
        ),
        (size(), 1u32..6, (algorithm, random, 0u32..9), any::<u64>()).prop_map(
            |((rows, cols), corridor, (algorithm, random, loops), seed)| {
                MapSpec::Maze(MazeSpec {
                    rows,
                    cols,
                    corridor,
                    algorithm,
                    random,
                    loops,
                    seed,
                })
            }
        ),
        (
            [1u32..5, 1u32..5, 1u32..5, 1u32..5, 1u32..4],
            1u32..4,
            (any::<Option<bool>>(), any::<[bool; 2]>(), 1u32..5)
        )
            .prop_map(|(numbers, margin, (aisles, [open, endpoints], every))| {
                MapSpec::Warehouse(WarehouseSpec {
                    aisle_rows: aisles.map(|wide| if wide { 3 } else { 1 }),
                    edge_rows: (aisles == Some(true)).then_some(every),
                    open,
                    endpoints,
                    workstations: open.then_some(every),
                    ..warehouse(numbers, Some(margin))
                })
            }),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 500, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn maps_are_connected_and_reproducible(spec in specs()) {
        let grid = spec.generate().unwrap();
        prop_assert_eq!(&spec.generate().unwrap(), &grid);
        prop_assert_eq!(grid.name(), spec.name());
        prop_assert_eq!(pieces(&grid), 1);
        let cells = grid.cell_count();
        match spec {
            MapSpec::Empty(_) => prop_assert_eq!(grid.passable_count(), cells),
            MapSpec::Random(spec) => {
                let blocked = (spec.obstacle_density * f64::from(cells)).round() as u32;
                prop_assert_eq!(cells - grid.passable_count(), blocked.min(cells - 1));
            }
            MapSpec::Maze(spec) if spec.corridor == 1 => {
                // A spanning tree has one passage less than it has cells; every other wall closes a loop.
                let (high, wide) = (spec.rows / 2, spec.cols / 2);
                let loops = spec.loops.min((high - 1) * (wide - 1));
                prop_assert_eq!(grid.passable_count(), 2 * high * wide - 1 + loops);
            }
            _ => {}
        }
    }

    #[test]
    fn scenarios_are_instances(spec in specs(), seed: u64, share in 0.0..=1.0) {
        let grid = Arc::new(spec.generate().unwrap());
        prop_assume!(grid.passable_count() > 1);
        let agents = 1 + (share * f64::from(grid.passable_count() - 1)) as u32;
        let spec = ScenarioSpec { agents, seed };
        let scenario = spec.generate(&grid).unwrap();
        prop_assert_eq!(&spec.generate(&grid).unwrap(), &scenario);
        let instance = scenario.instance(Arc::clone(&grid), agents as usize, Connectivity::Eight);
        let instance = instance.unwrap();
        prop_assert!(instance.starts().iter().zip(instance.goals()).all(|(start, goal)| start != goal));
        let read = read_scen("again.scen", &write_scen(&scenario)).unwrap();
        let again = read.instance(grid, agents as usize, Connectivity::Eight).unwrap();
        prop_assert_eq!(again.digest(), instance.digest());
    }
}

#[test]
fn scenarios_on_broken_maps_stay_within_pieces() {
    let map = b"type octile\nheight 3\nwidth 5\nmap\n..@.@\n@@@.@\n.@..@\n";
    let grid = Arc::new(read_map("broken.map", map).unwrap());
    for seed in 0..50 {
        let scenario = ScenarioSpec { agents: 6, seed }.generate(&grid).unwrap();
        let instance = scenario
            .instance(Arc::clone(&grid), 6, Connectivity::Four)
            .unwrap();
        assert_eq!(instance.starts().iter().collect::<BTreeSet<_>>().len(), 6);
    }
}

/// The maps and scenarios in the repository, as `maps/SOURCES.md` lists them.
fn shipped() -> Vec<(MapSpec, ScenarioSpec)> {
    let algorithm = MazeAlgorithm::Backtracker;
    vec![
        (
            MapSpec::Empty(EmptySpec { rows: 8, cols: 8 }),
            ScenarioSpec {
                agents: 32,
                seed: 1,
            },
        ),
        (
            MapSpec::Empty(EmptySpec { rows: 16, cols: 16 }),
            ScenarioSpec {
                agents: 128,
                seed: 1,
            },
        ),
        (
            MapSpec::Random(RandomSpec {
                rows: 32,
                cols: 32,
                obstacle_density: 0.2,
                seed: 1,
            }),
            ScenarioSpec {
                agents: 200,
                seed: 1,
            },
        ),
        (
            MapSpec::Room(RoomSpec {
                rows: 33,
                cols: 33,
                room_size: 8,
                doors: 1,
                seed: 1,
            }),
            ScenarioSpec {
                agents: 100,
                seed: 1,
            },
        ),
        (
            MapSpec::Maze(MazeSpec {
                rows: 32,
                cols: 32,
                corridor: 3,
                algorithm,
                random: MazeRandom::ChaCha,
                loops: 0,
                seed: 1,
            }),
            ScenarioSpec {
                agents: 100,
                seed: 1,
            },
        ),
        (
            MapSpec::Maze(MazeSpec::lattice(
                10,
                10,
                MazeAlgorithm::Prim,
                MazeRandom::ChaCha,
                1,
            )),
            ScenarioSpec {
                agents: 10,
                seed: 1,
            },
        ),
        (
            MapSpec::Warehouse(WarehouseSpec {
                open: true,
                endpoints: true,
                workstations: Some(3),
                aisle_rows: Some(2),
                ..warehouse([3, 4, 5, 1, 1], Some(2))
            }),
            ScenarioSpec {
                agents: 60,
                seed: 1,
            },
        ),
        (
            MapSpec::Warehouse(warehouse([4, 6, 6, 2, 1], None)),
            ScenarioSpec {
                agents: 200,
                seed: 1,
            },
        ),
    ]
}

/// Set `FLEETYARD_REGENERATE=1` to write the files instead of comparing them.
#[test]
fn shipped_maps_are_what_the_generators_make() {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../maps");
    let sources = std::fs::read_to_string(folder.join("SOURCES.md")).unwrap_or_default();
    let regenerate = std::env::var_os("FLEETYARD_REGENERATE").is_some();
    let mut files = BTreeSet::new();
    for (map, scenario) in shipped() {
        let grid = map.generate().unwrap();
        let scenario = scenario.generate(&grid).unwrap();
        let name = grid.name();
        for (file, bytes) in [
            (format!("{name}.map"), write_map(&grid)),
            (format!("{name}-random-1.scen"), write_scen(&scenario)),
        ] {
            let path = folder.join(&file);
            if regenerate {
                fleetyard_core::write_atomically(&path, &bytes).unwrap();
            }
            let found = std::fs::read(&path).unwrap_or_default();
            assert!(found == bytes, "{file} is not what its generator makes");
            files.insert(file);
        }
        assert!(
            sources.contains(&format!("{name}.map")),
            "SOURCES.md does not name {name}.map"
        );
    }
    let found: BTreeSet<String> = std::fs::read_dir(&folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| {
            path.extension()
                .is_some_and(|kind| kind == "map" || kind == "scen")
        })
        .map(|path| path.file_name().unwrap().to_str().unwrap().to_owned())
        .collect();
    assert_eq!(found, files);
}

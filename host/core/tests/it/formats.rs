//! Round trips of every file format, move strings, and shortest lengths; and
//! every public benchmark file where `FLEETYARD_DATA` names a folder of them.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use fleetyard_core::formats::{load_lorr, write_grid, write_lsmart};
use fleetyard_core::{
    Connectivity, Digest, Grid, GridInstance, GridPlan, GridSearch, OFF_MAP, PathEncoding,
    PlanFile, Role, Scenario, ScenarioEntry, load_map, load_scen, map_bytes, move_bit, moves,
    read_map, read_plan, read_scen, save_plan, write_map, write_plan, write_scen,
};
use proptest::prelude::*;

fn grids() -> impl Strategy<Value = Grid> {
    (1u32..9, 1u32..9)
        .prop_flat_map(|(rows, cols)| {
            let letter = proptest::sample::select(Grid::LETTERS.to_vec());
            let terrain = proptest::collection::vec(letter, (rows * cols) as usize);
            (Just(rows), Just(cols), terrain)
        })
        .prop_map(|(rows, cols, terrain)| Grid::new("a", rows, cols, terrain).unwrap())
}

/// The same, some with masks of moves.
fn masked_grids() -> impl Strategy<Value = Grid> {
    (grids(), proptest::collection::vec(any::<u8>(), 64), 0..4u8).prop_map(|(grid, noise, thin)| {
        let masks = grid.move_masks(Connectivity::Eight);
        let masks = masks.iter().zip(noise).map(|(mask, noise)| match thin {
            0 => *mask,
            1 => mask & noise & 0x0f,
            _ => mask & noise,
        });
        let masks = masks.collect();
        grid.with_moves(masks).unwrap()
    })
}

/// Any paths, legal or not, on and off the map.
fn plans(cells: u32) -> impl Strategy<Value = GridPlan> {
    let cell = prop_oneof![8 => 0..cells, 1 => Just(OFF_MAP)];
    let path = proptest::collection::vec(cell, 0..12);
    proptest::collection::vec(path, 0..6).prop_map(GridPlan::from_paths)
}

fn entries() -> impl Strategy<Value = ScenarioEntry> {
    let position = || (any::<u32>(), any::<u32>());
    let numbers = (any::<u32>(), any::<u32>(), any::<u32>(), 0u64..1 << 40);
    (
        numbers,
        "[a-z/]{1,6}( [a-z]{1,3})?\\.map",
        position(),
        position(),
    )
        .prop_map(
            |((bucket, map_cols, map_rows, length), map, start, goal)| ScenarioEntry {
                line: 0,
                bucket,
                map,
                map_cols,
                map_rows,
                start,
                goal,
                // Eight digits are what the format keeps.
                optimal_length: format!("{:.8}", length as f64 / 1e6).parse().unwrap(),
            },
        )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 500, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn maps(grid in masked_grids()) {
        prop_assert_eq!(read_map("x/a.map", &map_bytes(&grid)), Ok(grid.clone()));
        prop_assert_eq!(read_map("x/a.json", &write_grid(&grid)), Ok(grid.clone()));
        let plain = read_map("a.map", &write_map(&grid)).unwrap();
        prop_assert_eq!(plain == grid, !grid.has_move_masks());
        prop_assert_eq!(plain.digest() == grid.digest(), !grid.has_move_masks());
    }

    /// Masks are what neighbours say, and a mask with a bit more than the terrain leaves is refused.
    #[test]
    fn masks_of_moves(grid in masked_grids(), cell in any::<u32>(), bit in 0..8u32) {
        for connectivity in [Connectivity::Four, Connectivity::Eight] {
            let masks = grid.move_masks(connectivity);
            for (cell, mask) in (0..).zip(&masks) {
                let near: Vec<u32> = grid.neighbors(cell, connectivity).collect();
                prop_assert_eq!(near.len() as u32, mask.count_ones());
                let at = grid.row_col(cell);
                let bits = near.iter().map(|to| 1 << move_bit(at, grid.row_col(*to)).unwrap());
                prop_assert_eq!(bits.sum::<u8>(), *mask);
            }
        }
        let cell = cell % grid.cell_count();
        let plain = read_map("a.map", &write_map(&grid)).unwrap();
        let is_open = plain.move_mask(cell, Connectivity::Eight) & (1 << bit) != 0;
        let has_bit = grid.move_mask(cell, Connectivity::Eight) & (1 << bit) != 0;
        prop_assert_eq!(grid.forbids_move(cell, bit), is_open && !has_bit);
        let mut masks = grid.move_masks(Connectivity::Eight);
        masks[cell as usize] |= 1 << bit;
        prop_assert_eq!(plain.with_moves(masks).is_ok(), is_open);
    }

    /// Two cells are in one part exactly if each can be reached from the other.
    #[test]
    fn parts_are_strongly_connected(grid in masked_grids(), eight: bool) {
        let connectivity = if eight { Connectivity::Eight } else { Connectivity::Four };
        let part = grid.components(connectivity);
        let mut search = GridSearch::new(&grid);
        let mut last = 0;
        for from in 0..grid.cell_count() {
            prop_assert_eq!(part[from as usize] == 0, !grid.is_passable(from));
            // Numbered in the order of their first cells.
            prop_assert!(part[from as usize] <= last + 1);
            last = last.max(part[from as usize]);
            for to in (0..from).filter(|to| grid.is_passable(from) && grid.is_passable(*to)) {
                let there = search.steps(from, to, connectivity).is_some();
                let both = there && search.steps(to, from, connectivity).is_some();
                prop_assert_eq!(part[from as usize] == part[to as usize], both);
                let instance =
                    GridInstance::new(Arc::new(grid.clone()), connectivity, vec![from], vec![to]);
                prop_assert_eq!(instance.is_ok(), there);
            }
        }
    }

    #[test]
    fn scenarios(entries in proptest::collection::vec(entries(), 1..8)) {
        let mut scenario = Scenario { source: "a.scen".into(), entries };
        let bytes = write_scen(&scenario);
        for (at, entry) in scenario.entries.iter_mut().enumerate() {
            entry.line = at as u64 + 2;
        }
        prop_assert_eq!(read_scen("a.scen", &bytes), Ok(scenario));
    }

    #[test]
    fn plan_files(
        (rows, cols, plan) in (1u32..6, 1u32..6)
            .prop_flat_map(|(rows, cols)| (Just(rows), Just(cols), plans(rows * cols))),
        planner in proptest::option::of("\\PC{0,8}"),
        with_digest: bool,
    ) {
        for encoding in PathEncoding::ALL {
            let file = PlanFile {
                source: "a.plan".into(),
                planner: planner.clone(),
                instance_digest: None,
                plan_digest: with_digest.then(|| Digest::of_plan(&plan)),
                map: planner.clone(),
                rows,
                cols,
                encoding,
                plan: plan.clone(),
            };
            let bytes = write_plan(&file);
            let mut read = read_plan("a.plan", &bytes).unwrap();
            if encoding == PathEncoding::Moves {
                // Pairs stand in where there are no move strings.
                read.encoding = encoding;
            }
            prop_assert_eq!(read, file);
        }
    }

    #[test]
    fn move_strings(
        rows in 1u32..6, cols in 1u32..6, start in 0u32..40, letters in "[.NESWnesw]{0,20}",
    ) {
        let cells = moves::decode(start, &letters, rows, cols).unwrap();
        prop_assert_eq!(cells.len(), letters.len() + 1);
        let on_map = cells.iter().take_while(|cell| **cell < rows * cols).count();
        prop_assert!(cells[on_map..].iter().all(|cell| *cell == OFF_MAP));
        let encoded = moves::encode(&cells, cols);
        if on_map == cells.len() {
            prop_assert_eq!(encoded, Some(letters));
        } else {
            prop_assert_eq!(encoded, None);
        }
    }

    #[test]
    fn jumps_have_no_letter(cols in 1u32..6, from in 0u32..30, to in 0u32..30) {
        let unit = (from / cols).abs_diff(to / cols) <= 1 && (from % cols).abs_diff(to % cols) <= 1;
        prop_assert_eq!(moves::encode(&[from, to], cols).is_some(), unit);
    }

    /// A* against breadth-first and Bellman–Ford searches.
    #[test]
    fn shortest_lengths(grid in masked_grids(), seeds in any::<[u32; 2]>()) {
        let [from, to] = seeds.map(|seed| seed % grid.cell_count());
        let mut search = GridSearch::new(&grid);
        for connectivity in [Connectivity::Four, Connectivity::Eight] {
            let weight = |a: u32, b: u32, diagonal: f64| {
                let (a, b) = (grid.row_col(a), grid.row_col(b));
                if a.0 != b.0 && a.1 != b.1 { diagonal } else { 1.0 }
            };
            let relax = |diagonal: f64| {
                let mut length = vec![f64::INFINITY; grid.cell_count() as usize];
                if grid.is_passable(from) {
                    length[from as usize] = 0.0;
                }
                for _ in 0..grid.cell_count() {
                    for cell in 0..grid.cell_count() {
                        for next in grid.neighbors(cell, connectivity) {
                            let through = length[cell as usize] + weight(cell, next, diagonal);
                            if grid.is_passable(cell) && through < length[next as usize] {
                                length[next as usize] = through;
                            }
                        }
                    }
                }
                Some(length[to as usize]).filter(|length| length.is_finite())
            };
            let steps = search.steps(from, to, connectivity);
            prop_assert_eq!(steps.map(f64::from), relax(1.0));
            if connectivity == Connectivity::Eight {
                let found = search.octile(from, to).map(fleetyard_core::OctileLength::cells);
                match (found, relax(std::f64::consts::SQRT_2)) {
                    (Some(found), Some(expected)) => prop_assert!((found - expected).abs() < 1e-9),
                    (found, expected) => prop_assert_eq!(found, expected),
                }
            }
        }
    }
}

#[test]
fn positions_outside_the_map_are_read_for_the_validator() {
    let read = |encoding: &str, path: &str| {
        let text = format!(
            "{{\"paths\": [{path}], \"cols\": 4, \"rows\": 3, \"encoding\": \"{encoding}\",
             \"format\": \"fleetyard.plan/1\"}}"
        );
        read_plan("a.plan", text.as_bytes())
            .unwrap()
            .plan
            .path(0)
            .to_vec()
    };
    let off = OFF_MAP;
    assert_eq!(
        read(
            "pairs",
            "[[2, 3], [3, 0], [0, 4], [-1, 0], [0, -9999999999], [18446744073709551615, 1]]"
        ),
        [11, off, off, off, off, off]
    );
    assert_eq!(
        read("cells", "[11, 12, -1, 4294967295, 99999999999]"),
        [11, off, off, off, off]
    );
    assert_eq!(
        read("moves", "{\"moves\": \"ESES\", \"start\": [1, 3]}"),
        [7, off, off, off, off]
    );
    assert_eq!(
        read("moves", "{\"moves\": \"E\", \"start\": [-1, 3]}"),
        [off, off]
    );
    assert_eq!(read("pairs", "[]"), [0; 0]);
}

#[test]
fn a_plan_file_belongs_to_its_instance() {
    let grid = Arc::new(Grid::new("room", 2, 3, vec![b'.'; 6]).unwrap());
    let instance = |goal| {
        GridInstance::new(Arc::clone(&grid), Connectivity::Four, vec![0], vec![goal]).unwrap()
    };
    let file = PlanFile {
        planner: Some("by hand".into()),
        encoding: PathEncoding::Moves,
        ..PlanFile::new(&instance(2), GridPlan::from_paths([[0, 1, 1, 2]]))
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.plan");
    save_plan(&file, &path).unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    let digests = [instance(2).digest(), Digest::of_plan(&file.plan)];
    let expected = format!(
        "{{\n  \"format\": \"fleetyard.plan/1\",\n  \"planner\": \"by hand\",\n  \
         \"instance_digest\": \"{}\",\n  \"plan_digest\": \"{}\",\n  \"map\": \"room\",\n  \
         \"rows\": 2,\n  \"cols\": 3,\n  \"encoding\": \"moves\",\n  \"paths\": [\n    \
         {{\"start\": [0, 0], \"moves\": \"E.E\"}}\n  ]\n}}\n",
        digests[0], digests[1]
    );
    assert_eq!(text, expected);
    let read = fleetyard_core::load_plan(&path).unwrap();
    assert_eq!(read.plan, file.plan);
    read.check_for(&instance(2)).unwrap();
    let error = read.check_for(&instance(3)).unwrap_err();
    assert!(
        error.reason.starts_with("the plan is for instance "),
        "{error}"
    );
    let other = Arc::new(Grid::new("hall", 3, 3, vec![b'.'; 9]).unwrap());
    let other = GridInstance::new(other, Connectivity::Four, vec![0], vec![2]).unwrap();
    let error = read.check_for(&other).unwrap_err();
    assert_eq!(
        error.reason,
        "the plan is for a map of 2 rows and 3 columns, but hall has 3 and 3"
    );
    assert_eq!(error.hint.as_deref(), Some("the plan names the map room"));
}

/// Files below a folder, sorted.
fn files(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let Ok(entries) = std::fs::read_dir(folder) else {
        return found;
    };
    for entry in entries.flatten() {
        let path = entry.path();
        if path.is_dir() {
            found.extend(files(&path, extension));
        } else if path.extension().is_some_and(|found| found == extension) {
            found.push(path);
        }
    }
    found.sort();
    found
}

#[test]
fn public_benchmark_files() {
    let Some(data) = std::env::var_os("FLEETYARD_DATA") else {
        return;
    };
    let data = PathBuf::from(data);
    // Files after bug reports are not as their formats say.
    let is_public = |path: &PathBuf| !path.starts_with(data.join("cases"));
    for path in files(&data, "map").into_iter().filter(is_public) {
        let grid = load_map(&path).unwrap();
        assert_eq!(
            write_map(&grid),
            std::fs::read(&path).unwrap(),
            "{}",
            path.display()
        );
        if path.starts_with(data.join("movingai")) {
            let roles = (0..grid.cell_count()).filter_map(|cell| grid.role(cell));
            assert_eq!(roles.count(), 0, "{}", path.display());
        }
    }
    let mut lengths = 0;
    for path in files(&data, "scen").into_iter().filter(is_public) {
        let scenario = load_scen(&path).unwrap();
        assert_eq!(
            write_scen(&scenario),
            std::fs::read(&path).unwrap(),
            "{}",
            path.display()
        );
        let folder = path.parent().unwrap();
        let grid = Arc::new(load_map(folder.join(&scenario.entries[0].map)).unwrap());
        let all = scenario.entries.len();
        scenario
            .instance(Arc::clone(&grid), all, Connectivity::Four)
            .unwrap();
        let mut search = GridSearch::new(&grid);
        // One scenario per map is enough to compare lengths.
        if !path.to_string_lossy().ends_with("-random-1.scen") {
            continue;
        }
        for entry in &scenario.entries {
            let [start, goal] = [entry.start, entry.goal].map(|at| grid.cell(at.0, at.1).unwrap());
            let found = search.octile(start, goal).unwrap().cells();
            assert!(
                (found - entry.optimal_length).abs() < 1e-6,
                "{}:{}",
                path.display(),
                entry.line
            );
            lengths += 1;
        }
    }
    println!("compared {lengths} optimal lengths");
}

#[test]
fn league_instances_are_read() {
    let Some(folder) = std::env::var_os("FLEETYARD_DATA").map(PathBuf::from) else {
        eprintln!("skipped: FLEETYARD_DATA is not set");
        return;
    };
    for (file, tasks, agents) in [
        ("random.domain/random-example_400.json", 3200, 400),
        ("warehouse.domain/fulfill-example_2500.json", 22_500, 2500),
    ] {
        let path = folder.join("lorr").join(file);
        if !path.is_file() {
            eprintln!("skipped: {} is not there", path.display());
            continue;
        }
        let league = load_lorr(&path).unwrap();
        assert_eq!((league.tasks, league.agents.agents.len()), (tasks, agents));
        assert!(league.errands > league.tasks);
        let instance = league
            .agents
            .instance(Arc::new(league.grid), None, Connectivity::Four)
            .unwrap();
        assert_eq!(instance.agents(), agents);
    }
}

/// The map that LSMART's experiments use most, if `FLEETYARD_DATA` says where it is.
#[test]
fn a_map_of_lsmart_is_read_and_written() {
    let Some(data) = std::env::var_os("FLEETYARD_DATA") else {
        return;
    };
    let path = Path::new(&data).join("lsmart/kiva_large_w_mode.json");
    let grid = load_map(&path).unwrap();
    assert_eq!(
        (grid.name(), grid.rows(), grid.cols()),
        ("kiva_large_w_mode", 33, 36)
    );
    assert_eq!(grid.cells_with(Role::Endpoint).count(), 480);
    assert_eq!(grid.cells_with(Role::Workstation).count(), 22);
    let written = write_lsmart(&grid);
    assert_eq!(
        read_map("kiva_large_w_mode.json", &written).as_ref(),
        Ok(&grid)
    );
    let published: serde_json::Value =
        serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    let ours: serde_json::Value = serde_json::from_slice(&written).unwrap();
    assert_eq!(ours, published);
}

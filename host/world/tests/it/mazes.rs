//! Promises of mazes; those of the benchmark come out cell by cell.

use std::collections::BTreeSet;

use fleetyard_core::{Connectivity, Grid};
use fleetyard_world::{Maze, MazeAlgorithm, MazeRandom, MazeSeeds, MazeSpec};
use proptest::prelude::*;
use sha2::{Digest, Sha256};

/// A lattice as the benchmark prints it.
fn text(grid: &Grid) -> String {
    let mut text = String::new();
    for row in grid.terrain().chunks(grid.cols() as usize) {
        for letter in row {
            text.push(if Grid::letter_is_passable(*letter) {
                '.'
            } else {
                '#'
            });
        }
        text.push('\n');
    }
    text
}

#[test]
fn mazes_of_the_benchmark_come_out_cell_by_cell() {
    // Found by running the benchmark's own generator.
    for (algorithm, seed, prefix) in [
        (MazeAlgorithm::Backtracker, 7, "af5b77d62f132e5c"),
        (MazeAlgorithm::Backtracker, 8, "ff2ae594e5f33278"),
        (MazeAlgorithm::Backtracker, 56, "2d7273a27ddc78cb"),
        (MazeAlgorithm::Prim, 7, "54b91fba5c84ec22"),
    ] {
        let maze = Maze::carve(15, 15, algorithm, MazeRandom::Python, seed).unwrap();
        let lattice = maze.lattice("maze").unwrap();
        assert_eq!((lattice.rows(), lattice.cols()), (31, 31));
        let digest = Sha256::digest(text(&lattice));
        let first = u64::from_be_bytes(digest[..8].try_into().unwrap());
        assert_eq!(
            format!("{first:016x}"),
            prefix,
            "{algorithm:?} {seed}\n{}",
            text(&lattice)
        );
        let spec = MazeSpec::lattice(15, 15, algorithm, MazeRandom::Python, seed);
        assert_eq!(spec.maze().unwrap(), maze);
        assert_eq!(spec.generate().unwrap().terrain(), lattice.terrain());
    }
}

/// With 4-connected moves there is one simple path, so that the mean over the
/// benchmark's mazes is what its Table III says of every cardinal planner.
#[test]
fn shortest_ways_are_as_long_as_table_iii_says() {
    let steps = |index| {
        let seed = MazeSeeds::Benchmark.seed(7, index).unwrap();
        let random = MazeRandom::Python;
        let maze = Maze::carve(15, 15, MazeAlgorithm::Backtracker, random, seed).unwrap();
        // Two steps on the lattice for one between cells.
        2 * (maze.shortest_path(maze.start(), maze.goal()).unwrap().len() - 1)
    };
    assert_eq!((0..50).map(steps).sum::<usize>(), 50 * 14272 / 100);
}

#[test]
fn seeds_follow_the_schedules() {
    let seeds =
        |schedule: MazeSeeds, base| [0, 1, 2, 49].map(|index| schedule.seed(base, index).unwrap());
    assert_eq!(seeds(MazeSeeds::Benchmark, 7), [7, 8, 9, 56]);
    assert_eq!(seeds(MazeSeeds::Episodes, 42), [43, 45, 47, 141]);
    for schedule in [MazeSeeds::Benchmark, MazeSeeds::Episodes] {
        assert_eq!(schedule.seed(u64::MAX, 1), None);
        assert_eq!(schedule.seed(1, u64::MAX), None);
    }
}

#[test]
fn mazes_of_impossible_size_are_refused() {
    let carve = |width, height| {
        let (algorithm, random) = (MazeAlgorithm::Prim, MazeRandom::Python);
        Maze::carve(width, height, algorithm, random, 1).map(|maze| maze.cell_count())
    };
    assert_eq!(carve(1, 1).unwrap(), 1);
    let message = |width, height| {
        let error = carve(width, height).unwrap_err();
        format!(
            "{}: {}; {}",
            error.source,
            error.reason,
            error.hint.unwrap()
        )
    };
    assert_eq!(
        message(0, 3),
        "width: width is 0; width is a whole number of 1 or more"
    );
    assert_eq!(
        message(3, 0),
        "height: height is 0; height is a whole number of 1 or more"
    );
    assert_eq!(
        message(1 << 15, 1 << 15),
        "rows: a map of 65537 rows and 65537 columns is too large; \
         a map has at most 1073741824 cells"
    );
    assert!(carve(u32::MAX, u32::MAX).is_err());
}

fn mazes() -> impl Strategy<Value = (u32, u32, MazeAlgorithm, MazeRandom, u64)> {
    let algorithm = prop_oneof![Just(MazeAlgorithm::Backtracker), Just(MazeAlgorithm::Prim)];
    let random = prop_oneof![Just(MazeRandom::ChaCha), Just(MazeRandom::Python)];
    (1u32..20, 1u32..20, algorithm, random, any::<u64>())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    /// The contract: all cells within reach, a way from start to goal, and no
    /// passage more than a tree has.
    #[test]
    fn every_maze_is_a_spanning_tree((width, height, algorithm, random, seed) in mazes()) {
        let maze = Maze::carve(width, height, algorithm, random, seed).unwrap();
        prop_assert_eq!(maze.cell_count(), width * height);
        let mut reached = BTreeSet::from([maze.start()]);
        let mut open = vec![maze.start()];
        let mut passages = 0;
        while let Some(cell) = open.pop() {
            for to in maze.neighbors(cell) {
                prop_assert!(maze.passage(cell, to) && maze.passage(to, cell));
                passages += 1;
                if reached.insert(to) {
                    open.push(to);
                }
            }
        }
        prop_assert_eq!(reached.len() as u32, maze.cell_count());
        prop_assert_eq!(passages, 2 * (maze.cell_count() - 1));

        let path = maze.shortest_path(maze.start(), maze.goal()).unwrap();
        prop_assert_eq!((path[0], path[path.len() - 1]), (maze.start(), maze.goal()));
        prop_assert!(path.windows(2).all(|step| maze.passage(step[0], step[1])));
        prop_assert_eq!(maze.shortest_path(0, maze.cell_count()), None);
    }

    /// A lattice says the same as the walls.
    #[test]
    fn lattices_are_the_mazes((width, height, algorithm, random, seed) in mazes()) {
        let maze = Maze::carve(width, height, algorithm, random, seed).unwrap();
        let lattice = maze.lattice("maze").unwrap();
        prop_assert_eq!((lattice.rows(), lattice.cols()), (2 * height + 1, 2 * width + 1));
        let free = |row: u32, col: u32| lattice.is_passable(lattice.cell(row, col).unwrap());
        for cell in 0..maze.cell_count() {
            let (x, y) = maze.position(cell);
            prop_assert_eq!(maze.cell(x, y), Some(cell));
            let (row, col) = maze.on_lattice(cell);
            prop_assert_eq!((row, col), (2 * y + 1, 2 * x + 1));
            prop_assert!(free(row, col));
            prop_assert!(!free(row + 1, col + 1) && !free(row - 1, col - 1));
            let open = |x, y| maze.cell(x, y).is_some_and(|to| maze.passage(cell, to));
            prop_assert_eq!(free(row, col + 1), open(x + 1, y));
            prop_assert_eq!(free(row + 1, col), open(x, y + 1));
        }
        prop_assert!((0..lattice.cols()).all(|col| !free(0, col)));
        prop_assert!((0..lattice.rows()).all(|row| !free(row, 0)));

        let spec = MazeSpec::lattice(height, width, algorithm, random, seed);
        let instance = spec.instance(Connectivity::Four).unwrap();
        prop_assert_eq!(instance.grid().terrain(), lattice.terrain());
        let at = |cell| lattice.row_col(cell);
        prop_assert_eq!(at(instance.starts()[0]), maze.on_lattice(maze.start()));
        prop_assert_eq!(at(instance.goals()[0]), maze.on_lattice(maze.goal()));
    }
}

#[test]
fn wide_corridors_begin_and_end_on_free_cells() {
    for (rows, cols, corridor) in [
        (32, 32, 3),
        (32, 32, 4),
        (2, 2, 1),
        (7, 30, 9),
        (5, 5, u32::MAX),
    ] {
        let spec = MazeSpec {
            rows,
            cols,
            corridor,
            ..MazeSpec::lattice(1, 1, MazeAlgorithm::Prim, MazeRandom::Python, 5)
        };
        let instance = spec.instance(Connectivity::Eight).unwrap();
        assert_eq!(instance.grid().rows(), rows);
        assert_eq!(instance.starts(), [cols + 1]);
    }
}

/// A tree of c cells has c − 1 passages, and every other wall between two cells closes a loop.
#[test]
fn loops_are_walls_of_the_same_maze_that_are_opened() {
    let tree = MazeSpec::lattice(9, 7, MazeAlgorithm::Backtracker, MazeRandom::Python, 7);
    let free = |loops| {
        let spec = MazeSpec {
            loops,
            ..tree.clone()
        };
        let grid = spec.generate().unwrap();
        let cells = 0..grid.cell_count();
        (
            grid.name().to_owned(),
            cells
                .filter(|cell| grid.is_passable(*cell))
                .collect::<Vec<_>>(),
        )
    };
    let (name, without) = free(0);
    assert_eq!(name, "maze-19-15-1-backtracker-7");
    assert_eq!(without.len(), 63 + 62);
    let (name, with) = free(12);
    assert_eq!(name, "maze-19-15-1-backtracker-7-loops-12");
    assert_eq!(with.len(), without.len() + 12);
    assert!(without.iter().all(|cell| with.contains(cell)));
    assert_eq!(free(12), (name, with));
    // All walls between two of 9 × 7 cells: no pillar falls.
    assert_eq!(free(u32::MAX).1.len(), 63 + 8 * 7 + 9 * 6);
    // Files of before have none.
    let written = serde_json::to_string(&tree).unwrap();
    assert!(!written.contains("loops"), "{written}");
}

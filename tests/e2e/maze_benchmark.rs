//! The planners of one agent on the mazes of the grid-maze benchmark (Contreras 2026):
//! expansions and path lengths of its Table III, exactly.
//!
//! This is where the generators of `fleetyard-world` and the planners of
//! `fleetyard-plugin-search` meet: neither knows the other.

use fleetyard_core::Connectivity;
use fleetyard_plugin_search::{
    Beam, BestFirst, Bfs, BidirectionalAstar, BidirectionalBfs, Corners, Dijkstra, Done, Fringe,
    Grid, Heuristic, IdaStar, Incremental, JumpPoint, Limit, Looks, Memory, Method, Neighbors,
    Order, Outcome, Replanner, Search, ThetaStar, TieBreaking,
};
use fleetyard_world::{MazeAlgorithm, MazeRandom, MazeSeeds, MazeSpec};

const MAZES: u64 = 50;
const BASE_SEED: u64 = 7;

struct Problem {
    grid: Grid,
    start: u32,
    goal: u32,
}

fn mazes(algorithm: MazeAlgorithm, side: u32, count: u64) -> Vec<Problem> {
    let seeds = (0..count).filter_map(|index| MazeSeeds::Benchmark.seed(BASE_SEED, index));
    seeds
        .map(|seed| {
            let spec = MazeSpec::lattice(side, side, algorithm, MazeRandom::Python, seed);
            let instance = spec.instance(Connectivity::Four).expect("an instance");
            let map = instance.grid();
            let free: Vec<bool> = (0..map.cell_count())
                .map(|cell| map.is_passable(cell))
                .collect();
            let grid = Grid::new(map.rows(), map.cols(), &free, Neighbors::Four);
            Problem {
                grid: grid.expect("a map"),
                start: instance.starts()[0],
                goal: instance.goals()[0],
            }
        })
        .collect()
}

/// Total expansions, and the total length by the benchmark's rule: the cells of a
/// Bresenham line, one for every row or column of the longer side.
fn totals(search: &mut dyn Search, problems: &[Problem]) -> (u64, u64) {
    let (mut expansions, mut length) = (0, 0);
    let mut path = Vec::new();
    for Problem { grid, start, goal } in problems {
        let answer = search.search(grid, *start, *goal, &mut Limit::none(), &mut path);
        assert_eq!(answer.outcome, Outcome::Found);
        expansions += answer.expansions;
        let at = |cell: u32| (cell / grid.cols(), cell % grid.cols());
        for pair in path.windows(2) {
            let ((row, col), (next_row, next_col)) = (at(pair[0]), at(pair[1]));
            length += u64::from(row.abs_diff(next_row).max(col.abs_diff(next_col)));
        }
    }
    (expansions, length)
}

/// Every planner with the defaults of its plugin.
fn planners() -> Vec<(&'static str, Box<dyn Search>)> {
    let theta = |looks| {
        let ties = TieBreaking::Fifo;
        Box::new(ThetaStar::new(
            looks,
            Heuristic::Euclidean,
            ties,
            Corners::OneFree,
        ))
    };
    let both_ends = BidirectionalAstar::new(None, TieBreaking::LowG, Done::Both);
    let weighted = BestFirst::weighted(None, 1.5, TieBreaking::Fifo, true, Order::RowsFirst);
    vec![
        ("weighted-astar", Box::new(weighted)),
        ("beam-search", Box::new(Beam::new(None, 32))),
        (
            "jump-point-search",
            Box::new(JumpPoint::new(None, TieBreaking::LowG)),
        ),
        (
            "greedy-best-first",
            Box::new(BestFirst::greedy(None, TieBreaking::Fifo)),
        ),
        ("fringe-search", Box::new(Fringe::new(None))),
        ("astar", Box::new(BestFirst::astar(None, TieBreaking::LowH))),
        ("dijkstra", Box::new(Dijkstra::default())),
        ("bidirectional-bfs", Box::new(BidirectionalBfs::default())),
        ("bidirectional-astar", Box::new(both_ends)),
        ("theta-star", theta(Looks::Early)),
        ("lpa-star", Box::new(Incremental::new(Method::LpaStar))),
        ("idastar", Box::new(IdaStar::new(None, Memory::Costs))),
        ("bfs", Box::new(Bfs::default())),
        ("d-star-lite", Box::new(Incremental::new(Method::DStarLite))),
        ("lazy-theta-star", theta(Looks::Late)),
    ]
}

/// A mean with two decimals, as tables have it.
fn mean(total: u64, count: usize) -> String {
    format!("{:.2}", total as f64 / count as f64)
}

/// Planner, mean expansions and mean length.
fn means(problems: &[Problem]) -> Vec<String> {
    planners()
        .into_iter()
        .map(|(name, mut search)| {
            let totals = totals(&mut *search, problems);
            let [expansions, length] = [totals.0, totals.1].map(|one| mean(one, problems.len()));
            format!("{name} {expansions} {length}")
        })
        .collect()
}

#[test]
fn expansions_and_lengths_of_table_iii() {
    let problems = mazes(MazeAlgorithm::Backtracker, 15, MAZES);
    assert_eq!(
        means(&problems),
        [
            "weighted-astar 187.16 142.72",
            "beam-search 198.36 142.72",
            "jump-point-search 57.26 142.72",
            "greedy-best-first 171.96 142.72",
            "fringe-search 190.30 142.72",
            "astar 189.06 142.72",
            "dijkstra 200.52 142.72",
            "bidirectional-bfs 201.52 142.72",
            "bidirectional-astar 468.02 142.72",
            "theta-star 189.18 97.96",
            // The paper has 295.10: see the next but one test.
            "lpa-star 190.56 142.72",
            "idastar 7061.34 142.72",
            // Not in the paper.
            "bfs 200.52 142.72",
            "d-star-lite 301.56 142.72",
            "lazy-theta-star 189.26 97.96",
        ]
    );
}

#[test]
fn expansions_on_mazes_by_prim() {
    // The paper has no table of these; its own program expands as many.
    let problems = mazes(MazeAlgorithm::Prim, 15, MAZES);
    let expected = [
        "weighted-astar 70.28",
        "beam-search 173.32",
        "jump-point-search 28.36",
        "greedy-best-first 114.70",
        "fringe-search 79.76",
        "astar 77.84",
        "dijkstra 189.74",
        "bidirectional-bfs 112.18",
        "bidirectional-astar 73.14",
        "theta-star 89.24",
        "lpa-star 101.00",
        "idastar 157.18",
    ];
    let found = means(&problems);
    for (found, expected) in found.iter().zip(expected) {
        // Lengths are those of shortest paths, but for Theta*.
        assert!(
            found.starts_with(&format!("{expected} ")),
            "{found}, {expected}"
        );
    }
}

#[test]
fn nothing_is_cut_short_where_both_cells_beside_a_corner_have_to_be_free() {
    let problems = mazes(MazeAlgorithm::Backtracker, 15, MAZES);
    let (ties, corners) = (TieBreaking::Fifo, Corners::BothFree);
    let mut theta = ThetaStar::new(Looks::Early, Heuristic::Euclidean, ties, corners);
    let (_, length) = totals(&mut theta, &problems);
    assert_eq!(mean(length, problems.len()), "142.72");
}

/// The benchmark's program keeps the tree of its LPA* from one maze to the next, since
/// they are of one size and have the same ends: what it counts are repairs. Emptied for
/// every maze, it expands 190.56 places, as ours does. A tree that is carried along
/// expands fewer here than there (295.10), for it forgets what a cell cost that becomes
/// blocked.
#[test]
fn a_tree_that_is_carried_from_maze_to_maze() {
    let problems = mazes(MazeAlgorithm::Backtracker, 15, MAZES);
    let Problem { grid, start, goal } = &problems[0];
    let mut robot =
        Replanner::new(Method::LpaStar, grid.clone(), *start, *goal).expect("both are cells");
    let (mut expansions, mut path) = (0, Vec::new());
    for Problem { grid, .. } in &problems {
        let cells = 0..grid.rows() * grid.cols();
        robot.set_free(cells.map(|cell| (cell, grid.is_free(cell))));
        let answer = robot.plan(&mut Limit::none(), &mut path);
        assert_eq!(answer.outcome, Outcome::Found);
        expansions += answer.expansions;
    }
    assert_eq!(mean(expansions, problems.len()), "266.94");
}

#[test]
fn ida_finishes_mazes_that_are_much_larger() {
    for problem in mazes(MazeAlgorithm::Backtracker, 63, 2) {
        let mut ida = IdaStar::new(None, Memory::Costs);
        let (expansions, length) = totals(&mut ida, &[problem]);
        assert!(expansions > length);
    }
}

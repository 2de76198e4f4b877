//! Every planner against a plain Dijkstra search on random maps.

#![allow(clippy::single_match_else, reason = "two answers side by side")]

use fleetyard_plugin_search::{
    Answer, Beam, BestFirst, Bfs, BidirectionalAstar, BidirectionalBfs, Corners, Dijkstra, Done,
    Fringe, Grid, Heuristic, IdaStar, Incremental, JumpPoint, Limit, Looks, Memory, Method,
    Neighbors, Order, Outcome, Replanner, Search, Stop, ThetaStar, TieBreaking,
};
use proptest::prelude::*;
use proptest::test_runner::TestCaseError;

/// A map with the two ends of a question, both free.
#[derive(Debug, Clone)]
struct Scene {
    rows: u32,
    cols: u32,
    free: Vec<bool>,
    start: u32,
    goal: u32,
}

impl Scene {
    fn grid(&self, neighbors: Neighbors) -> Grid {
        Grid::new(self.rows, self.cols, &self.free, neighbors).expect("a map")
    }

    fn is_free(&self, row: i64, col: i64) -> bool {
        (0..i64::from(self.rows)).contains(&row)
            && (0..i64::from(self.cols)).contains(&col)
            && self.free[(row * i64::from(self.cols) + col) as usize]
    }

    fn at(&self, cell: u32) -> (i64, i64) {
        (i64::from(cell / self.cols), i64::from(cell % self.cols))
    }

    /// True if a robot may go from one cell to another in one move.
    fn adjacent(&self, from: u32, to: u32, neighbors: Neighbors) -> bool {
        let ((row, col), (next_row, next_col)) = (self.at(from), self.at(to));
        let (rows, cols) = (next_row - row, next_col - col);
        self.is_free(next_row, next_col)
            && match (rows.abs(), cols.abs()) {
                (0, 1) | (1, 0) => true,
                (1, 1) => {
                    neighbors == Neighbors::Eight
                        && self.is_free(row + rows, col)
                        && self.is_free(row, col + cols)
                }
                _ => false,
            }
    }

    /// Least lengths from the start by the textbook: the nearest of all is next. `unit`
    /// says whether a diagonal move costs as much as a straight one.
    fn distance(&self, neighbors: Neighbors, unit: bool) -> Option<f64> {
        let cells = self.free.len();
        let mut nearest = vec![f64::INFINITY; cells];
        let mut done = vec![false; cells];
        nearest[self.start as usize] = 0.0;
        loop {
            let open = (0..cells).filter(|cell| !done[*cell] && nearest[*cell].is_finite());
            let cell = open.min_by(|a, b| nearest[*a].total_cmp(&nearest[*b]))?;
            if cell as u32 == self.goal {
                return Some(nearest[cell]);
            }
            done[cell] = true;
            let (row, col) = self.at(cell as u32);
            for (rows, cols) in (-1..=1).flat_map(|r| (-1..=1).map(move |c| (r, c))) {
                let (row, col) = (row + rows, col + cols);
                if !self.is_free(row, col) {
                    continue;
                }
                let next = (row * i64::from(self.cols) + col) as usize;
                if self.adjacent(cell as u32, next as u32, neighbors) {
                    let diagonal = rows != 0 && cols != 0 && !unit;
                    let step = if diagonal { 2_f64.sqrt() } else { 1.0 };
                    nearest[next] = nearest[next].min(nearest[cell] + step);
                }
            }
        }
    }
}

fn scenes() -> impl Strategy<Value = Scene> {
    scenes_below(14)
}

/// With fewer rows and columns than that.
fn scenes_below(side: u32) -> impl Strategy<Value = Scene> {
    (1..side, 1..side, 0_u32..60).prop_flat_map(|(rows, cols, blocked)| {
        let cells = rows * cols;
        let free =
            proptest::collection::vec((0_u32..100).prop_map(move |n| n >= blocked), cells as usize);
        (free, 0..cells, 0..cells).prop_map(move |(mut free, start, goal)| {
            free[start as usize] = true;
            free[goal as usize] = true;
            Scene {
                rows,
                cols,
                free,
                start,
                goal,
            }
        })
    })
}

fn ask(search: &mut dyn Search, grid: &Grid, scene: &Scene) -> (Answer, Vec<u32>) {
    let mut path = vec![77];
    let answer = search.search(grid, scene.start, scene.goal, &mut Limit::none(), &mut path);
    (answer, path)
}

const TIES: [TieBreaking; 4] = [
    TieBreaking::LowH,
    TieBreaking::HighG,
    TieBreaking::LowG,
    TieBreaking::Fifo,
];
const ADMISSIBLE: [Option<Heuristic>; 4] = [
    None,
    Some(Heuristic::Euclidean),
    Some(Heuristic::Chebyshev),
    Some(Heuristic::Octile),
];

/// Planners of shortest paths in every variety.
fn optimal() -> Vec<(String, Box<dyn Search>)> {
    let mut all: Vec<(String, Box<dyn Search>)> =
        vec![("dijkstra".into(), Box::new(Dijkstra::default()))];
    for heuristic in ADMISSIBLE {
        for ties in TIES {
            let named = |name: &str| format!("{name} {heuristic:?} {ties:?}");
            all.push((named("astar"), Box::new(BestFirst::astar(heuristic, ties))));
            all.push((named("jump"), Box::new(JumpPoint::new(heuristic, ties))));
            for done in [Done::Both, Done::Either] {
                let both = BidirectionalAstar::new(heuristic, ties, done);
                all.push((named(&format!("bidirectional {done:?}")), Box::new(both)));
            }
        }
        let named = |name: &str| format!("{name} {heuristic:?}");
        all.push((named("fringe"), Box::new(Fringe::new(heuristic))));
        all.push((
            named("ida"),
            Box::new(IdaStar::new(heuristic, Memory::Costs)),
        ));
    }
    for method in [Method::LpaStar, Method::DStarLite] {
        all.push((format!("{method:?}"), Box::new(Incremental::new(method))));
    }
    all
}

/// The length of a path, which has to be one.
fn walked(scene: &Scene, grid: &Grid, path: &[u32], name: &str) -> Result<f64, TestCaseError> {
    prop_assert_eq!(path.first(), Some(&scene.start), "{}", name);
    prop_assert_eq!(path.last(), Some(&scene.goal), "{}", name);
    for pair in path.windows(2) {
        let fits = scene.adjacent(pair[0], pair[1], grid.neighbors());
        prop_assert!(fits, "{}: {:?}", name, pair);
    }
    Ok(grid.length(path))
}

const BOTH: [Neighbors; 2] = [Neighbors::Four, Neighbors::Eight];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]

    #[test]
    fn shortest_paths_are_shortest(all in proptest::collection::vec(scenes(), 1..4)) {
        // Arrays are used again on maps of other sizes.
        for (name, mut search) in optimal() {
            for scene in &all {
                for neighbors in BOTH {
                    let grid = scene.grid(neighbors);
                    let best = scene.distance(neighbors, false);
                    let (answer, path) = ask(&mut *search, &grid, scene);
                    match best {
                        Some(best) => {
                            prop_assert_eq!(answer.outcome, Outcome::Found, "{}", name);
                            let length = walked(scene, &grid, &path, &name)?;
                            prop_assert!((length - best).abs() < 1e-9, "{} {} {}", name, length, best);
                        }
                        None => {
                            prop_assert_eq!(answer.outcome, Outcome::NoPath, "{}", name);
                            prop_assert!(path.is_empty());
                        }
                    }
                    let again = ask(&mut *search, &grid, scene);
                    prop_assert_eq!((answer, path), again, "{}", name);
                }
            }
        }
    }

    #[test]
    fn fewest_moves_are_fewest(scene in scenes()) {
        let searches: [(&str, Box<dyn Search>); 2] = [
            ("bfs", Box::new(Bfs::default())),
            ("bidirectional bfs", Box::new(BidirectionalBfs::default())),
        ];
        for (name, mut search) in searches {
            for neighbors in BOTH {
                let grid = scene.grid(neighbors);
                let (answer, path) = ask(&mut *search, &grid, &scene);
                match scene.distance(neighbors, true) {
                    Some(best) => {
                        prop_assert_eq!(answer.outcome, Outcome::Found);
                        walked(&scene, &grid, &path, name)?;
                        prop_assert_eq!(path.len() - 1, best as usize, "{}", name);
                    }
                    None => prop_assert_eq!(answer.outcome, Outcome::NoPath),
                }
            }
        }
    }

    #[test]
    fn bounds_are_kept_and_paths_are_paths(
        scene in scenes(),
        weight in prop_oneof![Just(1.0), Just(1.5), Just(1.1), 1.0..20.0_f64],
        width in 1_usize..40,
    ) {
        let searches: [(&str, f64, Box<dyn Search>); 7] = [
            ("again", weight, Box::new(BestFirst::weighted(
                None, weight, TieBreaking::Fifo, true, Order::RowsFirst))),
            ("once", weight, Box::new(BestFirst::weighted(
                None, weight, TieBreaking::LowH, false, Order::Clockwise))),
            ("euclidean", weight, Box::new(BestFirst::weighted(
                Some(Heuristic::Euclidean), weight, TieBreaking::HighG, true, Order::RowsFirst))),
            ("greedy", f64::MAX, Box::new(BestFirst::greedy(None, TieBreaking::Fifo))),
            ("too much", f64::MAX, Box::new(BestFirst::astar(
                Some(Heuristic::Manhattan), TieBreaking::LowH))),
            ("jumps too much", f64::MAX, Box::new(JumpPoint::new(
                Some(Heuristic::Manhattan), TieBreaking::LowH))),
            ("beam", f64::MAX, Box::new(Beam::new(None, width))),
        ];
        for (name, bound, mut search) in searches {
            for neighbors in BOTH {
                let grid = scene.grid(neighbors);
                let (answer, path) = ask(&mut *search, &grid, &scene);
                match (scene.distance(neighbors, false), answer.outcome) {
                    (Some(best), Outcome::Found) => {
                        let length = walked(&scene, &grid, &path, name)?;
                        prop_assert!(length <= bound * best + 1e-9, "{} {} {}", name, length, best);
                    }
                    (_, Outcome::GaveUp) => prop_assert_eq!(name, "beam"),
                    (best, outcome) => {
                        prop_assert!(best.is_none(), "{}", name);
                        prop_assert_eq!(outcome, Outcome::NoPath, "{}", name);
                    }
                }
            }
        }
    }

    #[test]
    fn any_angle_paths_are_seen_and_no_longer_than_grid_paths(scene in scenes()) {
        for corners in [Corners::OneFree, Corners::BothFree] {
            for (looks, heuristic) in [
                (Looks::Early, Heuristic::Euclidean),
                (Looks::Early, Heuristic::Chebyshev),
                (Looks::Late, Heuristic::Euclidean),
            ] {
                let grid = scene.grid(Neighbors::Eight);
                let mut search = ThetaStar::new(looks, heuristic, TieBreaking::Fifo, corners);
                let (answer, path) = ask(&mut search, &grid, &scene);
                let best = scene.distance(Neighbors::Eight, false);
                if answer.outcome == Outcome::NoPath {
                    prop_assert!(best.is_none());
                    continue;
                }
                prop_assert_eq!(answer.outcome, Outcome::Found);
                prop_assert_eq!(path.first(), Some(&scene.start));
                prop_assert_eq!(path.last(), Some(&scene.goal));
                for pair in path.windows(2) {
                    prop_assert!(seen(&scene, pair[0], pair[1], corners), "{:?}", pair);
                }
                if let (Some(best), Looks::Early) = (best, looks) {
                    let length = grid.length(&path);
                    prop_assert!(length <= best + 1e-6, "{} {}", length, best);
                }
            }
        }
    }

    #[test]
    fn ida_without_memory_agrees_where_maps_are_small(scene in scenes_below(6)) {
        let grid = scene.grid(Neighbors::Four);
        let mut path = IdaStar::new(None, Memory::Path);
        let mut costs = IdaStar::new(None, Memory::Costs);
        let (one, along) = ask(&mut path, &grid, &scene);
        let (other, by) = ask(&mut costs, &grid, &scene);
        prop_assert_eq!(one.outcome, other.outcome);
        prop_assert_eq!(along.len(), by.len());
        prop_assert!(other.expansions <= one.expansions);
    }

    #[test]
    fn replanning_agrees_with_planning_anew(
        scene in scenes(),
        changes in proptest::collection::vec((0_u32..200, any::<bool>(), 0_u8..4), 1..30),
        method in prop_oneof![Just(Method::LpaStar), Just(Method::DStarLite)],
        eight in any::<bool>(),
    ) {
        let neighbors = BOTH[usize::from(eight)];
        let (mut now, mut path) = (scene.clone(), Vec::new());
        let mut robot = Replanner::new(method, scene.grid(neighbors), scene.start, scene.goal)
            .expect("both ends are on the map");
        let cells = scene.free.len() as u32;
        for (cell, free, what) in changes {
            let cell = cell % cells;
            if what == 0 {
                robot.move_to(cell);
                now.start = cell;
            } else {
                robot.set_free([(cell, free), (cells, true)]);
                now.free[cell as usize] = free;
            }
            if what == 3 {
                continue;
            }
            let answer = robot.plan(&mut Limit::none(), &mut path);
            let open = now.free[now.start as usize] && now.free[now.goal as usize];
            let best = if open { now.distance(neighbors, false) } else { None };
            match best {
                Some(best) => {
                    prop_assert_eq!(answer.outcome, Outcome::Found);
                    let length = walked(&now, &now.grid(neighbors), &path, "replanned")?;
                    prop_assert!((length - best).abs() < 1e-9, "{} {}", length, best);
                }
                None => prop_assert_eq!(answer.outcome, Outcome::NoPath),
            }
        }
    }

    /// As a planner is asked: a map, a start and a goal in each call.
    #[test]
    fn trees_that_are_kept_find_paths_as_short_as_those_that_are_not(
        scene in scenes(),
        changes in proptest::collection::vec((0_u32..200, any::<bool>(), 0_u8..8), 1..30),
        method in prop_oneof![Just(Method::LpaStar), Just(Method::DStarLite)],
        eight in any::<bool>(),
    ) {
        let neighbors = BOTH[usize::from(eight)];
        let mut kept = Incremental::new(method).keeping();
        let (mut now, mut path) = (scene.clone(), Vec::new());
        let cells = scene.free.len() as u32;
        for (cell, free, what) in changes {
            let cell = cell % cells;
            match what {
                0 => now.start = cell,
                1 => now.goal = cell,
                _ => now.free[cell as usize] = free,
            }
            if what == 3 {
                continue;
            }
            let grid = now.grid(neighbors);
            let answer = kept.search(&grid, now.start, now.goal, &mut Limit::none(), &mut path);
            let open = now.free[now.start as usize] && now.free[now.goal as usize];
            match if open { now.distance(neighbors, false) } else { None } {
                Some(best) => {
                    prop_assert_eq!(answer.outcome, Outcome::Found);
                    let length = walked(&now, &grid, &path, "kept")?;
                    prop_assert!((length - best).abs() < 1e-9, "{} {}", length, best);
                }
                None => prop_assert_eq!(answer.outcome, Outcome::NoPath),
            }
        }
    }

    #[test]
    fn limits_end_searches(scene in scenes(), nodes in 1_u64..60) {
        let others: Vec<(String, Box<dyn Search>)> = vec![
            ("bfs".into(), Box::new(Bfs::default())),
            ("bidirectional bfs".into(), Box::new(BidirectionalBfs::default())),
            ("beam".into(), Box::new(Beam::new(None, 8))),
            ("theta".into(), Box::new(ThetaStar::new(
                Looks::Early, Heuristic::Euclidean, TieBreaking::Fifo, Corners::OneFree))),
        ];
        for (name, mut search) in optimal().into_iter().chain(others) {
            let grid = scene.grid(Neighbors::Four);
            let (whole, path) = ask(&mut *search, &grid, &scene);
            let mut never = || false;
            let mut part = vec![77];
            let answer = search.search(
                &grid, scene.start, scene.goal, &mut Limit::new(Some(nodes), &mut never), &mut part);
            prop_assert!(answer.expansions <= nodes, "{}", name);
            if whole.expansions <= nodes {
                prop_assert_eq!(answer, whole, "{}", name);
                prop_assert_eq!(&part, &path);
            } else {
                prop_assert_eq!(answer.outcome, Outcome::Stopped(Stop::Nodes), "{}", name);
                prop_assert!(part.is_empty());
            }
            let mut always = || true;
            let told = search.search(
                &grid, scene.start, scene.goal, &mut Limit::new(None, &mut always), &mut part);
            let at_once = Answer { outcome: Outcome::Stopped(Stop::Told), expansions: 0 };
            prop_assert!(told == at_once || scene.start == scene.goal && whole.expansions == 0, "{}", name);
        }
    }
}

/// True if the straight line between two cells' centres crosses free cells alone, by the crossings
/// of the line with the sides of all cells, in exact fractions.
fn seen(scene: &Scene, from: u32, to: u32, corners: Corners) -> bool {
    let ((row, col), (last_row, last_col)) = (scene.at(from), scene.at(to));
    let (rows, cols) = (last_row - row, last_col - col);
    for at_row in row.min(last_row)..=row.max(last_row) {
        for at_col in col.min(last_col)..=col.max(last_col) {
            // The line's offset from the cell's four corners, doubled: it crosses the
            // inside if they are on different sides of it.
            let side = |r: i64, c: i64| {
                (rows * (2 * (at_col - col) + c) - cols * (2 * (at_row - row) + r)).signum()
            };
            let signs = [side(-1, -1), side(-1, 1), side(1, 1), side(1, -1)];
            let crosses = signs.contains(&1) && signs.contains(&-1);
            if crosses && !scene.is_free(at_row, at_col) {
                return false;
            }
        }
    }
    if rows == 0 || cols == 0 {
        return true;
    }
    // Corners that the line passes exactly through.
    let (down, right) = (rows.signum(), cols.signum());
    for past_rows in 0..rows.abs() {
        // The line is half a cell past `past_rows` rows, at this many half columns.
        let halves = (2 * past_rows + 1) * cols.abs();
        if halves % rows.abs() == 0 && (halves / rows.abs()) % 2 == 1 {
            let past_cols = (halves / rows.abs() - 1) / 2;
            let (r, c) = (row + down * past_rows, col + right * past_cols);
            let beside = [scene.is_free(r + down, c), scene.is_free(r, c + right)];
            let open = match corners {
                Corners::OneFree => beside[0] || beside[1],
                Corners::BothFree => beside[0] && beside[1],
            };
            if !open {
                return false;
            }
        }
    }
    true
}

//! The planners beside the `pathfinding` crate on the same maps in the same run:
//! mazes without loops of 15 × 15 and 255 × 255 cells on their lattices, and an open
//! map with scattered obstacles. At the end a table of the ratios.
//!
//! `cargo bench -p fleetyard-plugin-search`, and with `-- PATTERN` some of it. Mazes are
//! made here, in the way of the benchmark's but from numbers of our own: a plugin does
//! not know the host's generators.

use std::hint::black_box;
use std::time::{Duration, Instant};

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use fleetyard_plugin_search::{
    Beam, BestFirst, Bfs, BidirectionalAstar, BidirectionalBfs, Corners, Dijkstra, Done, Fringe,
    Grid, Heuristic, IdaStar, Incremental, JumpPoint, Limit, Looks, Memory, Method, Neighbors,
    Order, Outcome, Search, ThetaStar, TieBreaking,
};
use pathfinding::prelude::{astar, bfs, dijkstra, fringe, idastar};

/// A sequence of numbers without a pattern that matters here.
struct Noise(u64);

impl Noise {
    fn below(&mut self, bound: usize) -> usize {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        ((self.0 >> 33) as usize) % bound
    }
}

struct Problem {
    rows: i32,
    cols: i32,
    free: Vec<bool>,
    grid: Grid,
    start: u32,
    goal: u32,
}

impl Problem {
    fn new(rows: usize, cols: usize, free: Vec<bool>, start: usize, goal: usize) -> Self {
        let grid = Grid::new(rows as u32, cols as u32, &free, Neighbors::Four);
        Self {
            rows: rows as i32,
            cols: cols as i32,
            grid: grid.expect("a map"),
            free,
            start: start as u32,
            goal: goal as u32,
        }
    }

    /// A maze by a recursive backtracker, from its corner to its middle.
    fn maze(side: usize, seed: u64) -> Self {
        let mut noise = Noise(seed);
        let cols = 2 * side + 1;
        let mut free = vec![false; cols * cols];
        let place = |x: usize, y: usize| (2 * y + 1) * cols + 2 * x + 1;
        free[place(0, 0)] = true;
        let mut stack = vec![(0_usize, 0_usize)];
        while let Some((x, y)) = stack.last().copied() {
            let mut near = Vec::new();
            for (there, next) in [
                (y > 0, (x, y.wrapping_sub(1))),
                (x + 1 < side, (x + 1, y)),
                (y + 1 < side, (x, y + 1)),
                (x > 0, (x.wrapping_sub(1), y)),
            ] {
                if there && !free[place(next.0, next.1)] {
                    near.push(next);
                }
            }
            if near.is_empty() {
                stack.pop();
                continue;
            }
            let next = near[noise.below(near.len())];
            let (from, to) = (place(x, y), place(next.0, next.1));
            free[usize::midpoint(from, to)] = true;
            free[to] = true;
            stack.push(next);
        }
        let goal = place(side / 2, side / 2);
        Self::new(cols, cols, free, place(0, 0), goal)
    }

    /// An open map with obstacles, from corner to corner.
    fn open(side: usize, blocked_percent: usize, seed: u64) -> Self {
        let mut noise = Noise(seed);
        loop {
            let mut free: Vec<bool> = (0..side * side)
                .map(|_| noise.below(100) >= blocked_percent)
                .collect();
            free[0] = true;
            free[side * side - 1] = true;
            let made = Self::new(side, side, free, 0, side * side - 1);
            let mut path = Vec::new();
            if made.ask(&mut Bfs::default(), &mut path) == Outcome::Found {
                return made;
            }
        }
    }

    fn ask(&self, search: &mut dyn Search, path: &mut Vec<u32>) -> Outcome {
        let answer = search.search(&self.grid, self.start, self.goal, &mut Limit::none(), path);
        answer.outcome
    }

    fn at(&self, cell: u32) -> (i32, i32) {
        (cell as i32 / self.cols, cell as i32 % self.cols)
    }

    fn near(&self, (row, col): (i32, i32)) -> impl Iterator<Item = (i32, i32)> {
        let all = [
            (row - 1, col),
            (row, col + 1),
            (row + 1, col),
            (row, col - 1),
        ];
        let open = all.map(|(row, col)| {
            let inside = (0..self.rows).contains(&row) && (0..self.cols).contains(&col);
            inside && self.free[(row * self.cols + col) as usize]
        });
        all.into_iter()
            .zip(open)
            .filter(|(_, open)| *open)
            .map(|(at, _)| at)
    }

    /// The path's length by the crate's search of that name.
    fn peer(&self, name: &str) -> usize {
        let (start, goal) = (self.at(self.start), self.at(self.goal));
        let left = |at: &(i32, i32)| at.0.abs_diff(goal.0) + at.1.abs_diff(goal.1);
        let steps = |at: &(i32, i32)| self.near(*at).map(|at| (at, 1)).collect::<Vec<_>>();
        let done = |at: &(i32, i32)| *at == goal;
        let found = match name {
            "astar" => astar(&start, steps, left, done).map(|(path, _)| path),
            "dijkstra" => dijkstra(&start, steps, done).map(|(path, _)| path),
            "bfs" => bfs(&start, |at| self.near(*at).collect::<Vec<_>>(), done),
            "idastar" => idastar(&start, steps, left, done).map(|(path, _)| path),
            _ => fringe(&start, steps, left, done).map(|(path, _)| path),
        };
        found.map_or(0, |path| path.len())
    }
}

/// Every planner with the defaults of its plugin, and its counterpart.
fn planners() -> Vec<(&'static str, Option<&'static str>, Box<dyn Search>)> {
    let theta = |looks| {
        let ties = TieBreaking::Fifo;
        Box::new(ThetaStar::new(
            looks,
            Heuristic::Euclidean,
            ties,
            Corners::OneFree,
        ))
    };
    let weighted = BestFirst::weighted(None, 1.5, TieBreaking::Fifo, true, Order::RowsFirst);
    let both_ends = BidirectionalAstar::new(None, TieBreaking::LowG, Done::Both);
    vec![
        (
            "astar",
            Some("astar"),
            Box::new(BestFirst::astar(None, TieBreaking::LowH)),
        ),
        ("dijkstra", Some("dijkstra"), Box::new(Dijkstra::default())),
        (
            "greedy-best-first",
            None,
            Box::new(BestFirst::greedy(None, TieBreaking::Fifo)),
        ),
        ("weighted-astar", None, Box::new(weighted)),
        ("bidirectional-astar", None, Box::new(both_ends)),
        ("theta-star", None, theta(Looks::Early)),
        (
            "idastar",
            Some("idastar"),
            Box::new(IdaStar::new(None, Memory::Costs)),
        ),
        (
            "jump-point-search",
            None,
            Box::new(JumpPoint::new(None, TieBreaking::LowG)),
        ),
        (
            "lpa-star",
            None,
            Box::new(Incremental::new(Method::LpaStar)),
        ),
        ("beam-search", None, Box::new(Beam::new(None, 32))),
        ("fringe-search", Some("fringe"), Box::new(Fringe::new(None))),
        (
            "bidirectional-bfs",
            None,
            Box::new(BidirectionalBfs::default()),
        ),
        ("bfs", Some("bfs"), Box::new(Bfs::default())),
        (
            "d-star-lite",
            None,
            Box::new(Incremental::new(Method::DStarLite)),
        ),
        ("lazy-theta-star", None, theta(Looks::Late)),
    ]
}

/// True for searches that take too long to be measured again and again: depth-first ones where
/// there are many rounds.
fn too_long(map: &str, planner: &str) -> bool {
    planner == "idastar" && map != "maze-15"
}

/// The least mean time of some rounds over all problems.
fn least(problems: &[Problem], mut solve: impl FnMut(&Problem)) -> Duration {
    const WHOLE: Duration = Duration::from_millis(300);
    let mut best = Duration::MAX;
    let begun = Instant::now();
    while begun.elapsed() < WHOLE {
        let started = Instant::now();
        problems.iter().for_each(&mut solve);
        best = best.min(started.elapsed());
    }
    best / problems.len() as u32
}

fn microseconds(time: Duration) -> f64 {
    time.as_secs_f64() * 1e6
}

fn searches(criterion: &mut Criterion) {
    let maps: [(&str, Vec<Problem>); 3] = [
        (
            "maze-15",
            (7..57).map(|seed| Problem::maze(15, seed)).collect(),
        ),
        (
            "maze-255",
            (7..9).map(|seed| Problem::maze(255, seed)).collect(),
        ),
        (
            "open-256",
            (7..11).map(|seed| Problem::open(256, 20, seed)).collect(),
        ),
    ];
    let mut table = Vec::new();
    for (map, problems) in &maps {
        let mut group = criterion.benchmark_group(*map);
        group
            .sample_size(10)
            .warm_up_time(Duration::from_millis(100));
        group.measurement_time(Duration::from_millis(500));
        for (name, peer, mut search) in planners() {
            if too_long(map, name) {
                continue;
            }
            let mut path = Vec::new();
            group.bench_function(BenchmarkId::new(name, problems.len()), |bencher| {
                bencher.iter(|| {
                    for problem in problems {
                        black_box(problem.ask(&mut *search, &mut path));
                    }
                });
            });
            let ours = least(problems, |problem| {
                black_box(problem.ask(&mut *search, &mut path));
            });
            let theirs = peer.map(|peer| {
                least(problems, |problem| {
                    black_box(problem.peer(peer));
                })
            });
            table.push((*map, name, ours, theirs));
        }
        group.finish();
    }
    println!(
        "{:10} {:20} {:>10} {:>14} {:>7}",
        "map", "planner", "µs", "pathfinding µs", "ratio"
    );
    for (map, name, ours, theirs) in table {
        let ours = microseconds(ours);
        let (theirs, ratio) = match theirs.map(microseconds) {
            Some(theirs) => (format!("{theirs:.1}"), format!("{:.1}", theirs / ours)),
            None => (String::new(), String::new()),
        };
        println!("{map:10} {name:20} {ours:>10.2} {theirs:>14} {ratio:>7}");
    }
}

criterion_group!(benches, searches);
criterion_main!(benches);

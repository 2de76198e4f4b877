//! D\* Lite beside A\* from nothing while cells close and open: `replan MAP [CLOSED]`, where CLOSED is the share of free cells that are
//! closed at a time, 0.006 if it is left out.
//!
//! A robot goes a cell a step to twenty random goals. At every change of the map both plan, and the time of each search alone is
//! taken; lengths have to be the same.

use std::error::Error;
use std::time::{Duration, Instant};

use fleetyard_plugin_search::{
    BestFirst, Grid, Limit, Method, Neighbors, Outcome, Replanner, Search, TieBreaking,
};

const GOALS: usize = 20;
/// Steps for which a cell is closed.
const STEPS: usize = 100;

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

#[derive(Default)]
struct Tally {
    took: Duration,
    expansions: u64,
}

impl Tally {
    fn told(&self, name: &str, searches: u64) {
        let each = searches.max(1) as f64;
        let micros = self.took.as_secs_f64() * 1e6 / each;
        let expansions = self.expansions as f64 / each;
        println!("{name}: {expansions:.1} expansions, {micros:.2} µs a search");
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let file = arguments.next().ok_or("replan MAP [CLOSED]")?;
    let share: f64 = arguments.next().map_or(Ok(0.006), |text| text.parse())?;
    let text = std::fs::read_to_string(file)?;
    let (_, rows) = text.split_once("map\n").ok_or("this is no map")?;
    let rows: Vec<&str> = rows.lines().collect();
    let free: Vec<bool> = rows.concat().chars().map(|letter| letter == '.').collect();
    let cells: Vec<u32> = (0..free.len() as u32)
        .filter(|cell| free[*cell as usize])
        .collect();
    let (height, width) = (rows.len() as u32, rows[0].len() as u32);
    let mut grid = Grid::new(height, width, &free, Neighbors::Four).ok_or("this is no map")?;
    let mut noise = Noise(7);
    let mut astar = BestFirst::astar(None, TieBreaking::LowH);
    let (mut first, mut kept, mut anew) = (Tally::default(), Tally::default(), Tally::default());
    let (mut searches, mut closed) = (0, Vec::new());
    let mut at = cells[noise.below(cells.len())];
    let mut time = 0;
    for _ in 0..GOALS {
        let goal = loop {
            let goal = cells[noise.below(cells.len())];
            if goal != at && grid.is_free(goal) {
                break goal;
            }
        };
        let mut robot = Replanner::new(Method::DStarLite, grid.clone(), at, goal).ok_or("cells")?;
        let mut path = Vec::new();
        let begin = Instant::now();
        first.expansions += robot.plan(&mut Limit::none(), &mut path).expansions;
        first.took += begin.elapsed();
        while at != goal {
            time += 1;
            let mut changes = Vec::new();
            closed.retain(|(cell, until)| {
                let stays = *until > time;
                if !stays {
                    changes.push((*cell, true));
                }
                stays
            });
            // As many a step as keeps the share.
            let per_step = share * cells.len() as f64 / STEPS as f64;
            let whole = per_step.floor() as usize;
            let more =
                usize::from((noise.below(1 << 20) as f64) < per_step.fract() * f64::from(1 << 20));
            for _ in 0..whole + more {
                let cell = cells[noise.below(cells.len())];
                let next = path.get(1).copied().unwrap_or(at);
                if ![at, next, goal].contains(&cell) && grid.is_free(cell) {
                    closed.push((cell, time + STEPS));
                    changes.push((cell, false));
                }
            }
            if !changes.is_empty() {
                for (cell, free) in &changes {
                    grid.set_free(*cell, *free);
                }
                searches += 1;
                let begin = Instant::now();
                robot.set_free(changes);
                robot.move_to(at);
                let answer = robot.plan(&mut Limit::none(), &mut path);
                kept.took += begin.elapsed();
                kept.expansions += answer.expansions;
                let mut other = Vec::new();
                let begin = Instant::now();
                let beside = astar.search(&grid, at, goal, &mut Limit::none(), &mut other);
                anew.took += begin.elapsed();
                anew.expansions += beside.expansions;
                if answer.outcome != beside.outcome || path.len() != other.len() {
                    return Err(format!("{} cells, but {}", path.len(), other.len()).into());
                }
                if answer.outcome != Outcome::Found {
                    path.clear();
                }
            }
            if path.len() > 1 {
                path.remove(0);
                at = path[0];
            }
        }
    }
    println!("{GOALS} goals in {time} steps, {searches} searches after changes");
    first.told("D* Lite to a new goal", GOALS as u64);
    kept.told("D* Lite after a change", searches);
    anew.told("A* after a change", searches);
    Ok(())
}

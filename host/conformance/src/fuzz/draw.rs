//! Probes from seeds.

use fleetyard_abi::{Capability, Kind, Motion};
use fleetyard_core::{Connectivity, Grid};
use fleetyard_world::SeededRandom;

use super::probe::{Call, Member, Probe, View, Work};
use crate::scene::{RADIUS_M, free_cells, random_map, walks};
use crate::stop::{Step, Stop};
use crate::trial::Trial;

/// Nodes of a search that is asked twice: few enough that planners which count them stop by themselves.
const FEW_NODES: u64 = 1000;

/// Most agents.
const AGENTS: usize = 12;

/// Most metres in x and in y of a vertex from the middle of its cell: robots that stand keep clear of those that
/// pass.
const BESIDE_M: f64 = 0.1;

/// True in so many of a hundred draws.
fn chance(random: &mut SeededRandom, percent: usize) -> bool {
    random.below(100) < percent
}

/// A number of nanoseconds whose size is drawn: from 10 to the power of `least` to that of `most`.
fn any_size(random: &mut SeededRandom, [least, most]: [f64; 2]) -> u64 {
    (least + random.unit() * (most - least)).exp2() as u64
}

/// Sizes as powers of two: of hostile budgets in nanoseconds, of those of `prepare`, and of limits of nodes.
const SHORT: [f64; 2] = [0.0, 26.0];
const SHORT_PREPARE: [f64; 2] = [0.0, 23.0];
const NODES: [f64; 2] = [0.0, 10.0];
/// The same of crowds, for those who have no map to put them on.
const CROWD: [f64; 2] = [0.0, 12.0];

/// The views that a plugin claims.
pub(crate) fn views(trial: &Trial<'_>) -> Step<Vec<View>> {
    use Capability as C;
    let claims = |claim| trial.claims(claim);
    let is_planner = trial.kind() == Kind::Planner;
    if trial.kind() == Kind::InvocationPolicy {
        return Ok(vec![View::Status]);
    }
    let all = [
        (View::Grid, claims(C::Grid) && claims(C::Pebble)),
        (View::Turning, claims(C::Grid) && claims(C::Rotation)),
        (
            View::Straight,
            is_planner && claims(C::Grid) && claims(C::AnyAngle),
        ),
        (
            View::RoadmapStopGo,
            claims(C::Roadmap) && trial.pace() == Motion::StopGo,
        ),
        (View::RoadmapSlower, claims(C::Roadmap) && claims(C::Slower)),
        (View::Plane, claims(C::Continuous)),
    ];
    let claimed = all.into_iter().filter(|(_, is_claimed)| *is_claimed);
    let views: Vec<View> = claimed.map(|(view, _)| view).collect();
    if views.is_empty() {
        return Err(Stop::Skipped(
            "the plugin claims no map and motion of which the fuzzer has instances".into(),
        ));
    }
    Ok(views)
}

/// The probe of a seed for the plugin of a trial, in one of its views.
pub(crate) fn probe(trial: &Trial<'_>, views: &[View], seed: u64) -> Step<Probe> {
    let mut random = SeededRandom::new("fuzz", seed);
    let view = views[random.below(views.len())];
    let mut probe = if view == View::Status {
        statuses(seed, &mut random)
    } else {
        Draw { trial }.on_map(seed, view, &mut random)?
    };
    let is_policy = trial.kind() == Kind::InvocationPolicy;
    let is_twice = is_policy || trial.claims(Capability::Deterministic);
    if is_twice && chance(&mut random, 15) {
        probe.twice = true;
        for call in &mut probe.calls {
            (call.prepare_ns, call.wall_ns, call.nodes) = (None, None, FEW_NODES);
        }
    }
    Ok(probe)
}

/// Draws for one plugin.
struct Draw<'a, 'b> {
    trial: &'a Trial<'b>,
}

impl Draw<'_, '_> {
    fn on_map(&self, seed: u64, view: View, random: &mut SeededRandom) -> Step<Probe> {
        let claims = |claim| self.trial.claims(claim);
        let is_grid = matches!(view, View::Grid | View::Turning);
        let is_roadmap = matches!(view, View::RoadmapStopGo | View::RoadmapSlower);
        let is_planner = self.trial.kind() == Kind::Planner;
        let grid = if chance(random, 60) {
            small_map(random)?
        } else {
            random_map(random)?
        };
        let cols = grid.cols() as usize;
        let letter = |letter: &u8| {
            if Grid::letter_is_passable(*letter) {
                '.'
            } else {
                '@'
            }
        };
        let rows = grid.terrain().chunks(cols);
        let mut probe = Probe {
            map: rows.map(|row| row.iter().map(letter).collect()).collect(),
            eight: view == View::Grid && claims(Capability::EightConnected) && chance(random, 40),
            ..Probe::new(seed, view)
        };
        // Generators are judged by the parts of the map.
        let is_directed = is_roadmap || (is_grid && claims(Capability::MoveMask));
        if is_directed && self.trial.kind() != Kind::InstanceGenerator && chance(random, 30) {
            let connectivity = probe.connectivity();
            for from in 0..grid.cell_count() {
                for to in grid.neighbors(from, connectivity) {
                    if chance(random, 15) {
                        probe.closed.push([from, to]);
                    }
                }
            }
        }
        if is_roadmap && chance(random, 50) {
            // Whole centimetres are easy to read.
            let mut beside = || (random.below(21) as f64 - 10.0) * BESIDE_M / 10.0;
            let places = (0..grid.cell_count()).map(|_| [beside(), beside()]);
            probe.beside_m = places.collect();
        }
        let dynamics = self.trial.dynamics();
        if view == View::Plane && !dynamics.is_empty() {
            probe.dynamics = Some(dynamics[random.below(dynamics.len())].to_owned());
        }
        let grid = probe.grid();
        let grid = grid.map_err(|error| Stop::failed(format!("the kit has no map: {error}")))?;
        let room = (grid.passable_count() as usize).div_ceil(2);
        let most = if self.trial.is_alone() || view == View::Straight {
            1
        } else {
            AGENTS
        };
        let agents = 1 + random.below(most.min(room));
        if claims(Capability::Heterogeneous) && is_planner && chance(random, 30) {
            let radius = |_| {
                if random.below(2) == 0 {
                    RADIUS_M
                } else {
                    RADIUS_M / 2.0
                }
            };
            probe.radii_m = (0..agents).map(radius).collect();
        }
        let has_windows = is_grid && claims(Capability::Windowed);
        let calls = if has_windows && chance(random, 40) {
            self.fleet(&probe, &grid, agents, random)
        } else {
            self.one_shot(&probe, &grid, agents, random)
        };
        probe.calls = calls;
        Ok(probe)
    }

    /// Calls about instances that have nothing to do with each other, the last of which has time.
    fn one_shot(
        &self,
        probe: &Probe,
        grid: &Grid,
        agents: usize,
        random: &mut SeededRandom,
    ) -> Vec<Call> {
        let number = if chance(random, 60) {
            1
        } else {
            2 + random.below(2)
        };
        let mut calls = Vec::new();
        for _ in 0..number {
            let mut call = self.call(probe, grid, agents, random);
            self.limit(&mut call, random);
            calls.push(call);
        }
        let is_hostile = |call: &Call| call.wall_ns.is_some() || call.prepare_ns.is_some();
        if calls.last().is_some_and(is_hostile) && chance(random, 70) {
            calls.push(self.call(probe, grid, agents, random));
        }
        calls
    }

    /// Calls as in a fleet: in windows, each from where the plan before led.
    fn fleet(
        &self,
        probe: &Probe,
        grid: &Grid,
        agents: usize,
        random: &mut SeededRandom,
    ) -> Vec<Call> {
        let window = 1 + random.below(12) as u32;
        let mut calls = Vec::new();
        for number in 0..2 + random.below(4) {
            let mut call = self.call(probe, grid, agents, random);
            call.window = window;
            for member in &mut call.agents {
                if chance(random, 20) && !member.goals.is_empty() {
                    member.goals.insert(0, member.start);
                }
            }
            if number > 0 && probe.view == View::Grid {
                call.after = 1 + random.below(window as usize) as u32;
            }
            self.limit(&mut call, random);
            calls.push(call);
        }
        calls
    }

    /// Limits of a call, most of them the usual ones.
    fn limit(&self, call: &mut Call, random: &mut SeededRandom) {
        match random.below(100) {
            0..25 => call.wall_ns = Some(any_size(random, SHORT)),
            25..40 => call.nodes = any_size(random, NODES),
            _ => {}
        }
        if chance(random, 10) {
            call.prepare_ns = Some(any_size(random, SHORT_PREPARE));
        }
        if self.trial.claims(Capability::Threads) && chance(random, 10) {
            call.more_threads = 1;
        }
    }

    /// Agents on a map, and where they have to go.
    fn call(&self, probe: &Probe, grid: &Grid, agents: usize, random: &mut SeededRandom) -> Call {
        let claims = |claim| self.trial.claims(claim);
        let mut cells = free_cells(grid);
        random.shuffle(&mut cells);
        let starts = &cells[..agents.min(cells.len())];
        let walked = walks(grid, starts, random);
        let mut members: Vec<Member> = walked
            .into_iter()
            .map(|known| Member {
                start: known[0],
                goals: known.last().copied().into_iter().collect(),
                heading: random.below(4) as u8,
                known,
                ..Member::default()
            })
            .collect();
        // Perhaps out of reach, and certainly without a plan that is known.
        if chance(random, 15) {
            random.shuffle(&mut cells);
            for (member, goal) in members.iter_mut().zip(&cells) {
                (member.goals, member.known) = (vec![*goal], Vec::new());
            }
        }
        if claims(Capability::Idle) && chance(random, 20) {
            for member in &mut members {
                if chance(random, 30) {
                    member.goals.clear();
                }
            }
        }
        if claims(Capability::DuplicateGoals) && members.len() > 1 && chance(random, 15) {
            let shared = members[0].goals.clone();
            members[1].goals = shared;
        }
        // Nonsense, which a plugin has to live through.
        if members.len() > 1 && chance(random, 3) {
            members[1].start = members[0].start;
        }
        if self.trial.kind() == Kind::FailPolicy && chance(random, 75) {
            for member in &mut members {
                member.failed = stroll(grid, member.start, probe.connectivity(), random);
            }
        }
        Call {
            agents: members,
            work: [Work::Some, Work::Nothing, Work::Everything][random.below(3)],
            ..Call::default()
        }
    }
}

/// A way of some steps to anywhere.
fn stroll(
    grid: &Grid,
    start: u32,
    connectivity: Connectivity,
    random: &mut SeededRandom,
) -> Vec<u32> {
    let mut way = vec![start];
    for _ in 0..random.below(8) {
        let at = way[way.len() - 1];
        let near: Vec<u32> = grid.neighbors(at, connectivity).chain([at]).collect();
        way.push(near[random.below(near.len())]);
    }
    way
}

/// A map of at most 36 cells, in any number of pieces.
fn small_map(random: &mut SeededRandom) -> Step<Grid> {
    let (rows, cols) = (1 + random.below(6) as u32, 1 + random.below(6) as u32);
    let percent = [0, 0, 15, 30][random.below(4)];
    let mut terrain: Vec<u8> = (0..rows * cols)
        .map(|_| if chance(random, percent) { b'@' } else { b'.' })
        .collect();
    // Somebody has to stand somewhere.
    terrain[0] = b'.';
    Ok(Grid::new("small", rows, cols, terrain)?)
}

/// Statuses of fleets, one after the other.
fn statuses(seed: u64, random: &mut SeededRandom) -> Probe {
    let agents = if chance(random, 5) {
        any_size(random, CROWD) as usize
    } else {
        1 + random.below(AGENTS)
    };
    let mut calls = Vec::new();
    let mut time_s = 0.0;
    for _ in 0..=random.below(8) {
        let mut some = |most: f64| {
            if chance(random, 20) {
                0.0
            } else {
                random.unit() * most
            }
        };
        let (since_s, limit_s, action_s) = (some(30.0), some(10.0), 0.1 + some(2.0));
        time_s += some(100.0);
        let mut left = || match random.below(10) {
            0 => u32::MAX,
            1..4 => 0,
            _ => random.below(20) as u32,
        };
        let members = (0..agents).map(|_| Member {
            actions_left: left(),
            ..Member::default()
        });
        calls.push(Call {
            agents: members.collect(),
            times_s: Some([time_s, since_s, limit_s, action_s]),
            ..Call::default()
        });
    }
    Probe {
        calls,
        ..Probe::new(seed, View::Status)
    }
}

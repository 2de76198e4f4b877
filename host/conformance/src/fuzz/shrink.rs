//! The shrinker: makes instances that fail smaller as long as they fail.
//!
//! Delta debugging (Zeller and Hildebrandt, "Simplifying and Isolating Failure-Inducing Input", TSE 2002) over
//! parts of several sorts: instances before the last, calls, agents, rows and columns, obstacles, closed moves,
//! goals, limits. Of each sort first all, then halves, then single parts are left out, until no single part of
//! any sort can be. It asks a predicate and knows nothing of plugins.

use std::collections::HashSet;
use std::ops::Range;

use super::probe::{Call, Probe, Work};

/// The end of a search for the smallest instances that fail.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Shrunk {
    pub(crate) probes: Vec<Probe>,
    /// Candidates that were asked.
    pub(crate) asked: usize,
    /// True if no single part can be left out; false if it had to end before.
    pub(crate) is_smallest: bool,
}

/// Makes probes smaller while `fails` says that they fail. It goes on as long as `may_go_on` says so of the number
/// of candidates that were asked.
pub(crate) fn shrink<E>(
    probes: Vec<Probe>,
    fails: impl FnMut(&[Probe]) -> Result<bool, E>,
    may_go_on: impl Fn(usize) -> bool,
) -> Result<Shrunk, E> {
    let mut search = Search {
        best: probes,
        fails,
        may_go_on,
        asked: 0,
        known: HashSet::new(),
        is_out: false,
    };
    while search.round()? && !search.is_out {}
    Ok(Shrunk {
        probes: search.best,
        asked: search.asked,
        is_smallest: !search.is_out,
    })
}

/// A sort of parts that can be left out: their number, and the same without some of them, unless
/// something is left that cannot be.
struct Sort {
    count: fn(&[Probe]) -> usize,
    without: fn(&[Probe], Range<usize>) -> Option<Vec<Probe>>,
}

/// The sorts, those first that make most of an instance go away.
const SORTS: &[Sort] = &[
    Sort {
        count: |probes| probes.len().saturating_sub(1),
        without: |probes, range| Some(left(probes, &range)),
    },
    Sort {
        count: |probes| probes.iter().map(|probe| probe.calls.len()).sum(),
        without: without_calls,
    },
    Sort {
        count: |probes| probes.iter().map(Probe::agents).sum(),
        without: |probes, range| each(probes, range, Probe::agents, without_agents),
    },
    Sort {
        count: |probes| probes.iter().map(|probe| probe.map.len()).sum(),
        without: |probes, range| each(probes, range, |probe| probe.map.len(), without_rows),
    },
    Sort {
        count: |probes| probes.iter().map(|probe| probe.cols() as usize).sum(),
        without: |probes, range| each(probes, range, |probe| probe.cols() as usize, without_cols),
    },
    Sort {
        count: |probes| probes.iter().map(|probe| probe.blocked().len()).sum(),
        without: |probes, range| {
            each(
                probes,
                range,
                |probe| probe.blocked().len(),
                |probe, range| Some(freed(probe, range)),
            )
        },
    },
    Sort {
        count: |probes| probes.iter().map(|probe| probe.closed.len()).sum(),
        without: |probes, range| {
            let opened = |probe: &Probe, range: Range<usize>| {
                let closed = left(&probe.closed, &range);
                Some(Probe {
                    closed,
                    ..probe.clone()
                })
            };
            each(probes, range, |probe| probe.closed.len(), opened)
        },
    },
    Sort {
        count: |probes| probes.iter().map(displaced).sum(),
        without: |probes, range| {
            each(probes, range, displaced, |probe, range| {
                Some(put_back(probe, range))
            })
        },
    },
    Sort {
        count: |probes| probes.iter().map(ways).sum(),
        without: |probes, range| each(probes, range, ways, without_ways),
    },
];

/// A list without a range of its entries.
fn left<T: Clone>(list: &[T], range: &Range<usize>) -> Vec<T> {
    let rest = list[..range.start].iter().chain(&list[range.end..]);
    rest.cloned().collect()
}

/// Leaves parts out that are counted from probe to probe.
fn each(
    probes: &[Probe],
    range: Range<usize>,
    count: impl Fn(&Probe) -> usize,
    without: impl Fn(&Probe, Range<usize>) -> Option<Probe>,
) -> Option<Vec<Probe>> {
    let mut first = 0;
    let mut smaller = Vec::with_capacity(probes.len());
    for probe in probes {
        let parts = count(probe);
        let own = range.start.clamp(first, first + parts)..range.end.clamp(first, first + parts);
        smaller.push(if own.is_empty() {
            probe.clone()
        } else {
            without(probe, own.start - first..own.end - first)?
        });
        first += parts;
    }
    Some(smaller)
}

fn without_calls(probes: &[Probe], range: Range<usize>) -> Option<Vec<Probe>> {
    each(
        probes,
        range,
        |probe| probe.calls.len(),
        |probe, range| {
            let calls = left(&probe.calls, &range);
            (!calls.is_empty()).then(|| Probe {
                calls,
                ..probe.clone()
            })
        },
    )
}

fn without_agents(probe: &Probe, range: Range<usize>) -> Option<Probe> {
    if range.len() == probe.agents() {
        return None;
    }
    let mut smaller = probe.clone();
    for call in &mut smaller.calls {
        call.agents = left(&call.agents, &range);
    }
    if !smaller.radii_m.is_empty() {
        smaller.radii_m = left(&smaller.radii_m, &range);
    }
    Some(smaller)
}

/// The number of a row or column after some were left out: what was there is in the one before them then, or in the
/// first.
fn moved(number: u32, gone: &Range<usize>) -> u32 {
    let (start, end) = (gone.start as u32, gone.end as u32);
    match number {
        number if number >= end => number - (end - start),
        number if number < start => number,
        _ => start.saturating_sub(1),
    }
}

fn without_rows(probe: &Probe, range: Range<usize>) -> Option<Probe> {
    let map = left(&probe.map, &range);
    let cols = probe.cols();
    cut(probe, map, move |cell| {
        let (row, col) = (cell / cols, cell % cols);
        let stays = !range.contains(&(row as usize));
        (moved(row, &range) * cols + col, stays)
    })
}

fn without_cols(probe: &Probe, range: Range<usize>) -> Option<Probe> {
    let rows = probe.map.iter();
    let map = rows.map(|row| [&row[..range.start], &row[range.end..]].concat());
    let (cols, fewer) = (probe.cols(), range.len() as u32);
    cut(probe, map.collect(), move |cell| {
        let (row, col) = (cell / cols, cell % cols);
        let stays = !range.contains(&(col as usize));
        (row * (cols - fewer) + moved(col, &range), stays)
    })
}

/// The probe on a smaller map. `to` has the new number of every cell, and whether it is still there: who was in
/// one that is not is beside it now, where there has to be room.
fn cut(probe: &Probe, map: Vec<String>, to: impl Fn(u32) -> (u32, bool)) -> Option<Probe> {
    if map.first().is_none_or(String::is_empty) {
        return None;
    }
    let mut smaller = Probe {
        map,
        ..probe.clone()
    };
    for cell in smaller
        .calls
        .iter_mut()
        .flat_map(|call| &mut call.agents)
        .flat_map(|member| {
            let places = member.goals.iter_mut().chain([&mut member.start]);
            places.chain(&mut member.known).chain(&mut member.failed)
        })
    {
        *cell = to(*cell).0;
    }
    let still = |cell: u32| {
        Some(to(cell))
            .filter(|(_, stays)| *stays)
            .map(|(cell, _)| cell)
    };
    let moves = probe.closed.iter();
    let moves = moves.filter_map(|[from, target]| Some([still(*from)?, still(*target)?]));
    smaller.closed = moves.collect();
    let beside = probe.beside_m.iter().zip(0..);
    smaller.beside_m = beside
        .filter_map(|(beside, cell)| still(cell).map(|_| *beside))
        .collect();
    let blocked = smaller.blocked();
    let calls = smaller.calls.iter().zip(&probe.calls);
    let has_room = calls.into_iter().all(|(now, before)| {
        let mut members = now.agents.iter();
        let is_free = |cell: &u32| !blocked.contains(cell);
        now.shares_goals() == before.shares_goals()
            && now.shares_starts() == before.shares_starts()
            && members.all(|member| is_free(&member.start) && member.goals.iter().all(is_free))
    });
    has_room.then_some(smaller)
}

fn freed(probe: &Probe, range: Range<usize>) -> Probe {
    let mut smaller = probe.clone();
    let cols = probe.cols();
    for cell in &probe.blocked()[range] {
        let (row, col) = ((cell / cols) as usize, (cell % cols) as usize);
        smaller.map[row].replace_range(col..=col, ".");
    }
    smaller
}

/// Vertices beside the middle of their cells.
fn displaced(probe: &Probe) -> usize {
    let places = probe.beside_m.iter();
    places.filter(|beside| is_beside(beside)).count()
}

fn is_beside(beside: &[f64; 2]) -> bool {
    beside.iter().any(|metres| metres.abs() > 0.0)
}

fn put_back(probe: &Probe, range: Range<usize>) -> Probe {
    let mut smaller = probe.clone();
    let places = smaller
        .beside_m
        .iter_mut()
        .filter(|beside| is_beside(beside));
    for beside in places.skip(range.start).take(range.len()) {
        *beside = [0.0; 2];
    }
    if displaced(&smaller) == 0 {
        smaller.beside_m.clear();
    }
    smaller
}

/// True if an agent has to go somewhere.
fn goes(member: &super::probe::Member) -> bool {
    member.goals.iter().any(|goal| *goal != member.start) || member.goals.len() > 1
}

/// Agents of all calls that have to go somewhere.
fn ways(probe: &Probe) -> usize {
    let members = probe.calls.iter().flat_map(|call| &call.agents);
    members.filter(|member| goes(member)).count()
}

/// The probe in which some agents of calls are at their goals. A cell that is the goal of somebody else is nobody
/// else's.
fn without_ways(probe: &Probe, range: Range<usize>) -> Option<Probe> {
    let mut smaller = probe.clone();
    let mut number = 0;
    for call in &mut smaller.calls {
        let shared = call.shares_goals();
        for member in call.agents.iter_mut().filter(|member| goes(member)) {
            if range.contains(&number) {
                member.goals = vec![member.start];
                member.known.truncate(1);
            }
            number += 1;
        }
        if !shared && call.shares_goals() {
            return None;
        }
    }
    Some(smaller)
}

/// The calls of a probe with one limit less each, the whole probe where a limit is one of it.
fn simpler(probe: &Probe) -> Vec<Probe> {
    let mut all = Vec::new();
    let mut whole = |change: &dyn Fn(&mut Probe)| {
        let mut changed = probe.clone();
        change(&mut changed);
        if changed != *probe {
            all.push(changed);
        }
    };
    whole(&|probe| probe.twice = false);
    whole(&|probe| probe.eight = false);
    whole(&|probe| probe.radii_m.clear());
    let changes: [fn(&mut Call); 10] = [
        |call| call.prepare_ns = None,
        |call| call.wall_ns = None,
        |call| call.nodes = 0,
        |call| call.more_threads = 0,
        |call| {
            // Lists of goals are for windows.
            if call.agents.iter().all(|member| member.goals.len() < 2) {
                call.window = 0;
            }
        },
        |call| call.window = call.window.min(1),
        |call| call.window -= u32::from(call.window > 1),
        |call| call.after = 0,
        |call| call.work = Work::default(),
        |call| {
            call.agents
                .iter_mut()
                .for_each(|member| member.failed.clear());
        },
    ];
    for at in 0..probe.calls.len() {
        for change in changes {
            whole(&|probe| change(&mut probe.calls[at]));
        }
        for agent in 0..probe.agents() {
            whole(&|probe| {
                let goals = &mut probe.calls[at].agents[agent].goals;
                goals.drain(..goals.len().saturating_sub(1));
            });
            // Half of the way, and a step less.
            for part in [2, 1] {
                whole(&|probe| probe.calls[at].agents[agent].halt(part));
            }
            whole(&|probe| probe.calls[at].agents[agent].heading = 0);
            whole(&|probe| probe.calls[at].agents[agent].failed.truncate(1));
            whole(&|probe| {
                let left = &mut probe.calls[at].agents[agent].actions_left;
                *left = (*left).min(1);
            });
        }
    }
    all
}

struct Search<F, G> {
    best: Vec<Probe>,
    fails: F,
    may_go_on: G,
    asked: usize,
    /// Candidates that did not fail, or were asked already.
    known: HashSet<String>,
    is_out: bool,
}

impl<E, F, G> Search<F, G>
where
    F: FnMut(&[Probe]) -> Result<bool, E>,
    G: Fn(usize) -> bool,
{
    /// Asks about a candidate, which is the best from now on if it fails.
    fn attempt(&mut self, mut candidate: Vec<Probe>) -> Result<bool, E> {
        let calls = candidate.iter_mut().flat_map(|probe| &mut probe.calls);
        calls.for_each(Call::tidy);
        if candidate == self.best || self.is_out {
            return Ok(false);
        }
        if !self.known.insert(format!("{candidate:?}")) {
            return Ok(false);
        }
        if !(self.may_go_on)(self.asked) {
            self.is_out = true;
            return Ok(false);
        }
        self.asked += 1;
        let fails = (self.fails)(&candidate)?;
        if fails {
            self.best = candidate;
        }
        Ok(fails)
    }

    /// Tries everything once; true if something could be left out.
    fn round(&mut self) -> Result<bool, E> {
        let mut is_smaller = false;
        for sort in SORTS {
            is_smaller |= self.leave_out(sort)?;
        }
        for at in (0..self.best.len()).rev() {
            let mut number = 0;
            while let Some(probe) = simpler(&self.best[at]).into_iter().nth(number) {
                let mut candidate = self.best.clone();
                candidate[at] = probe;
                if self.attempt(candidate)? {
                    is_smaller = true;
                } else {
                    number += 1;
                }
            }
        }
        Ok(is_smaller)
    }

    fn leave_out(&mut self, sort: &Sort) -> Result<bool, E> {
        let mut is_smaller = false;
        let mut size = (sort.count)(&self.best);
        while size > 0 {
            let mut at = 0;
            while at < (sort.count)(&self.best) && !self.is_out {
                let end = (at + size).min((sort.count)(&self.best));
                let candidate = (sort.without)(&self.best, at..end);
                let fails = match candidate {
                    Some(candidate) => self.attempt(candidate)?,
                    None => false,
                };
                is_smaller |= fails;
                if !fails {
                    at += size;
                }
            }
            size /= 2;
        }
        Ok(is_smaller)
    }
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;

    use fleetyard_world::SeededRandom;

    use super::super::probe::{Member, Size, View};
    use super::*;
    use crate::scene::{free_cells, random_map, walks};

    fn drawn(seed: u64, agents: usize, calls: usize) -> Probe {
        let mut random = SeededRandom::new("shrink", seed);
        let grid = random_map(&mut random).unwrap_or_else(|_| panic!("a map"));
        let rows = grid.terrain().chunks(grid.cols() as usize);
        let map = rows
            .map(|row| String::from_utf8_lossy(row).into_owned())
            .collect();
        let mut call = || {
            let mut cells = free_cells(&grid);
            random.shuffle(&mut cells);
            cells.truncate(agents);
            let walked = walks(&grid, &cells, &mut random).into_iter();
            let agents = walked.map(|known| Member {
                start: known[0],
                goals: known.last().copied().into_iter().collect(),
                known,
                ..Member::default()
            });
            Call {
                agents: agents.collect(),
                nodes: 7,
                window: 9,
                wall_ns: Some(1000),
                ..Call::default()
            }
        };
        Probe {
            calls: (0..calls).map(|_| call()).collect(),
            map,
            ..Probe::new(seed, View::Grid)
        }
    }

    /// All that can be left out in one step.
    fn single(probes: &[Probe]) -> Vec<Vec<Probe>> {
        let mut all = Vec::new();
        for sort in SORTS {
            let parts = 0..(sort.count)(probes);
            all.extend(parts.filter_map(|part| (sort.without)(probes, part..part + 1)));
        }
        for (at, probe) in probes.iter().enumerate() {
            for simpler in simpler(probe) {
                let mut changed = probes.to_vec();
                changed[at] = simpler;
                all.push(changed);
            }
        }
        let calls = all.iter_mut().flatten().flat_map(|probe| &mut probe.calls);
        calls.for_each(Call::tidy);
        all.retain(|candidate| candidate != probes);
        all
    }

    /// Shrinks and checks that the end fails and that nothing can be left out of it.
    fn smallest(probes: Vec<Probe>, fails: impl Fn(&[Probe]) -> bool) -> Vec<Probe> {
        assert!(fails(&probes));
        let asked = |probes: &[Probe]| Ok::<_, Infallible>(fails(probes));
        let Ok(shrunk) = shrink(probes, asked, |_| true);
        assert!(shrunk.is_smallest && fails(&shrunk.probes));
        for candidate in single(&shrunk.probes) {
            assert!(!fails(&candidate), "{candidate:?}");
        }
        for probe in &shrunk.probes {
            assert_eq!(probe.check(), Ok(()), "{probe:?}");
        }
        shrunk.probes
    }

    #[test]
    fn what_fails_always_becomes_an_agent_in_a_cell() {
        for seed in 0..20 {
            let probes = vec![drawn(seed, 3, 2), drawn(seed + 50, 9, 3)];
            let probes = smallest(probes, |_| true);
            let wanted = Size {
                instances: 1,
                calls: 1,
                agents: 1,
                rows: 1,
                cols: 1,
                blocked: 0,
            };
            assert_eq!(Size::of(&probes), wanted, "{seed}: {probes:?}");
            let call = &probes[0].calls[0];
            assert_eq!((call.nodes, call.window, call.wall_ns), (0, 0, None));
        }
    }

    #[test]
    fn two_agents_that_go_are_left_of_many() {
        let go = |probes: &[Probe]| {
            let call = |call: &Call| call.agents.iter().filter(|member| goes(member)).count() >= 2;
            probes.iter().any(|probe| probe.calls.iter().any(call))
        };
        for seed in 0..20 {
            let probes = smallest(vec![drawn(seed, 12, 3)], go);
            let size = Size::of(&probes);
            assert_eq!((size.calls, size.agents, size.blocked), (1, 2, 0), "{size}");
            // Two starts and two goals, of which one may be the other one's start.
            assert!(size.rows * size.cols <= 8, "{size}: {probes:?}");
        }
    }

    #[test]
    fn a_known_plan_stays_one_where_the_map_is_cut() {
        let has_plan = |probes: &[Probe]| {
            let mut calls = probes
                .iter()
                .flat_map(|probe| probe.calls.iter().map(move |call| (probe, call)));
            calls.any(|(probe, call)| {
                let goes = call.agents.iter().any(goes);
                goes && matches!(probe.known_cost(call), Ok(Some(_)))
            })
        };
        for seed in 0..20 {
            let probes = smallest(vec![drawn(seed, 8, 1)], has_plan);
            let size = Size::of(&probes);
            assert_eq!(size.agents, 1, "{size}");
            assert!(size.rows * size.cols <= 4, "{size}: {probes:?}");
        }
    }

    #[test]
    fn the_history_that_is_needed_stays() {
        let needed = |probes: &[Probe]| {
            let has = |seed: u64| probes.iter().position(|probe| probe.seed == seed);
            let order = has(3) < has(8);
            order && has(3).is_some() && probes.last().is_some_and(|last| last.seed == 19)
        };
        let probes = (0..20).map(|seed| drawn(seed, 4, 1)).collect();
        let probes = smallest(probes, needed);
        let seeds: Vec<u64> = probes.iter().map(|probe| probe.seed).collect();
        assert_eq!(seeds, [3, 8, 19]);
    }

    #[test]
    fn obstacles_that_matter_stay() {
        let walled = |probes: &[Probe]| {
            probes.iter().all(|probe| {
                let cols = probe.cols();
                let beside = |cell: &u32| {
                    !cell.is_multiple_of(cols) && !probe.blocked().contains(&(cell - 1))
                };
                probe.calls[0]
                    .agents
                    .iter()
                    .any(|member| member.start % cols > 0 && !beside(&member.start))
            })
        };
        for seed in 0..40 {
            let probe = drawn(seed, 12, 1);
            if !walled(std::slice::from_ref(&probe)) {
                continue;
            }
            let size = Size::of(&smallest(vec![probe], walled));
            assert_eq!(
                (size.agents, size.rows, size.cols, size.blocked),
                (1, 1, 2, 1)
            );
        }
    }

    #[test]
    fn it_ends_when_it_may_not_go_on() {
        let asked = |_: &[Probe]| Ok::<_, Infallible>(true);
        let Ok(shrunk) = shrink(vec![drawn(1, 12, 3)], asked, |asked| asked < 2);
        assert_eq!((shrunk.asked, shrunk.is_smallest), (2, false));
    }

    #[test]
    fn an_error_of_the_host_ends_it() {
        let failed = |_: &[Probe]| Err("the host failed");
        assert_eq!(
            shrink(vec![drawn(1, 2, 1)], failed, |_| true),
            Err("the host failed")
        );
    }
}

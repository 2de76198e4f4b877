//! Conflicts between the paths of a team, kept up to date while paths change one at a time.
//!
//! Conflicts are defined as in Stern et al., "Multi-agent pathfinding: definitions, variants,
//! and benchmarks" (SoCS 2019): two agents in a cell, two agents that exchange cells, and,
//! where [`Rules::rings`] asks for it, three or more that move round in a ring in the same
//! step. With [`Rules::delay`] above zero a cell has to be left alone for so many steps
//! after a visit (k-robust plans: Atzmon et al., JAIR 2020).
//!
//! A path is a vertex per step; its agent stays at the last one for ever.

use crate::graph::Vertex;

/// End of a visit that does not end.
pub const FOREVER: u32 = u32::MAX;

/// The conflicts that count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rules {
    /// The last step at which agents may collide; [`FOREVER`] where there is no window.
    pub until: u32,
    /// Steps for which a cell has to be left alone after a visit: k of k-robust plans.
    pub delay: u32,
    /// Forbids agents to move round in a ring.
    pub rings: bool,
}

impl Default for Rules {
    /// Everything up to the end of time, no delays, rings allowed.
    fn default() -> Self {
        Self {
            until: FOREVER,
            delay: 0,
            rings: false,
        }
    }
}

/// A stay of one agent in a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Visit {
    /// The agent.
    pub agent: u32,
    /// First step in the cell.
    pub from: u32,
    /// Last step in the cell; [`FOREVER`] where the path ends here.
    pub until: u32,
    /// The agent's cell at `until + 1`; the same cell where the path ends here.
    pub next: Vertex,
}

/// A collision of two or more agents.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Conflict {
    /// The step at which it happens; for moves the one at which they begin. In a cell that
    /// is entered too early after a visit, the step of the visit.
    pub time: u32,
    /// The agents, the lower number first; in a ring the lowest two.
    pub agents: [u32; 2],
    /// Kind of the conflict, with its cells.
    pub kind: Kind,
}

/// Moves that are looked at in search of rings, however few agents there are.
const LEAST_MOVES: usize = 64;

/// Kind of a [`Conflict`], with its cells.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// Both are in a cell, within [`Rules::delay`] steps.
    Cell(Vertex),
    /// The first goes from the first cell to the second, and the other one back.
    Swap([Vertex; 2]),
    /// Each leaves its cell for that of the agent that is listed next.
    Ring(Box<[(u32, Vertex)]>),
}

impl Conflict {
    /// True if an agent takes part.
    pub fn involves(&self, agent: u32) -> bool {
        match &self.kind {
            Kind::Ring(members) => members.iter().any(|(member, _)| *member == agent),
            _ => self.agents.contains(&agent),
        }
    }
}

/// The stays of a path: `(vertex, from, until, next)`.
pub fn stays(path: &[Vertex]) -> impl Iterator<Item = (Vertex, u32, u32, Vertex)> + '_ {
    let mut from = 0;
    std::iter::from_fn(move || {
        let &v = path.get(from)?;
        let begin = from as u32;
        let left = path[from..].iter().position(|&u| u != v);
        from = left.map_or(path.len(), |steps| from + steps);
        Some(match left {
            Some(_) => (v, begin, from as u32 - 1, path[from]),
            None => (v, begin, FOREVER, v),
        })
    })
}

/// The paths of a team, who is in which cell when, and all conflicts between them.
///
/// To change one path costs the visits that others pay to its cells, plus the number of
/// conflicts there are.
#[derive(Debug, Clone)]
pub struct Conflicts {
    rules: Rules,
    visits: Vec<Vec<Visit>>,
    paths: Vec<Vec<Vertex>>,
    found: Vec<Conflict>,
    /// Some rings were not looked for: see [`Conflicts::rings`].
    cut: bool,
}

impl Conflicts {
    /// Nobody is anywhere, on a graph of so many vertices.
    pub fn new(vertices: usize, agents: usize, rules: Rules) -> Self {
        Self {
            rules,
            visits: vec![Vec::new(); vertices],
            paths: vec![Vec::new(); agents],
            found: Vec::new(),
            cut: false,
        }
    }

    /// The rules that conflicts follow.
    pub fn rules(&self) -> Rules {
        self.rules
    }

    /// The path of an agent; empty while it is nowhere.
    pub fn path(&self, agent: usize) -> &[Vertex] {
        &self.paths[agent]
    }

    /// All conflicts, in no particular order; sort them for one that does not depend on the
    /// way here. Where many agents are in the same cells, some of the rings that pass these may be
    /// missing; where there is no other conflict none is.
    pub fn all(&self) -> &[Conflict] {
        &self.found
    }

    /// The stays of agents in a cell, in no particular order.
    pub fn visits(&self, v: Vertex) -> &[Visit] {
        &self.visits[v as usize]
    }

    /// Gives an agent a path in place of the one that it has.
    pub fn set(&mut self, agent: usize, path: &[Vertex]) {
        self.take_away(agent);
        let mut found = std::mem::take(&mut self.found);
        self.cut |= !self.visit_conflicts(agent, path, &mut |conflict| found.push(conflict));
        self.found = found;
        for (v, from, until, next) in stays(path) {
            let agent = agent as u32;
            self.visits[v as usize].push(Visit {
                agent,
                from,
                until,
                next,
            });
        }
        self.paths[agent].extend_from_slice(path);
        self.look_again();
    }

    /// Takes an agent away.
    pub fn clear(&mut self, agent: usize) {
        self.take_away(agent);
        self.look_again();
    }

    fn take_away(&mut self, agent: usize) {
        if self.paths[agent].is_empty() {
            return;
        }
        let number = agent as u32;
        for (v, from, ..) in stays(&self.paths[agent]) {
            let visits = &mut self.visits[v as usize];
            let position = visits
                .iter()
                .position(|visit| visit.agent == number && visit.from == from);
            if let Some(position) = position {
                visits.swap_remove(position);
            }
        }
        self.paths[agent].clear();
        self.found.retain(|conflict| !conflict.involves(number));
    }

    /// Looks for rings that were cut, once no other conflict is left: then nobody shares a cell, and
    /// each move has at most one ring.
    fn look_again(&mut self) {
        if !self.cut || !self.found.is_empty() {
            return;
        }
        let mut found = Vec::new();
        self.cut = false;
        for (agent, path) in self.paths.iter().enumerate() {
            self.cut |= !self.visit_conflicts(agent, path, &mut |conflict| found.push(conflict));
        }
        // Each member of a ring told of it.
        found.sort_unstable();
        found.dedup();
        self.found = found;
    }

    /// Number of conflicts that an agent has with the others.
    pub fn count(&self, agent: usize) -> usize {
        let conflicts = self.found.iter();
        conflicts.filter(|c| c.involves(agent as u32)).count()
    }

    /// Number of conflicts that an agent would have with the others on a path.
    pub fn count_on(&self, agent: usize, path: &[Vertex]) -> usize {
        let mut count = 0;
        self.visit_conflicts(agent, path, &mut |_| count += 1);
        count
    }

    /// True if an agent other than `agent` moves from `to` to `from` in the step that begins at
    /// `time`.
    #[inline]
    pub fn swaps(&self, agent: u32, from: Vertex, to: Vertex, time: u32) -> bool {
        self.visits[to as usize]
            .iter()
            .any(|visit| visit.until == time && visit.next == from && visit.agent != agent)
    }

    /// A ring that a move of an agent would close: where agents are in the same cell there
    /// may be several.
    pub fn ring(
        &self,
        agent: u32,
        from: Vertex,
        to: Vertex,
        time: u32,
    ) -> Option<Box<[(u32, Vertex)]>> {
        let mut first = None;
        self.rings((agent, from, to), time, &mut |ring| {
            first = Some(ring);
            false
        });
        first
    }

    /// Tells of rings that a move of an agent from a cell to another would close, as long as `tell` says to go on. With
    /// `k` agents in each of `n` cells there are `k` to the power of `n` of them, so that the search is cut after looking at
    /// twice as many moves as there are agents: more are only looked at where agents share cells, which is a conflict
    /// of its own. False if it was cut.
    fn rings(
        &self,
        (agent, from, to): (u32, Vertex, Vertex),
        time: u32,
        tell: &mut dyn FnMut(Box<[(u32, Vertex)]>) -> bool,
    ) -> bool {
        let leaving = |at: Vertex| {
            let visits = self.visits[at as usize].iter();
            visits.filter(move |visit| visit.until == time && visit.agent != agent)
        };
        // Who may be next, where it comes from and goes to, behind how many others.
        let mut open: Vec<(usize, u32, Vertex, Vertex)> = Vec::new();
        let follow = |open: &mut Vec<_>, behind: usize, at: Vertex| {
            let begin = open.len();
            open.extend(leaving(at).map(|visit| (behind, visit.agent, at, visit.next)));
            open[begin..].sort_unstable_by_key(|next| std::cmp::Reverse(next.1));
        };
        follow(&mut open, 1, to);
        if open.is_empty() {
            return true;
        }
        let mut members = vec![(agent, from)];
        let mut patience = LEAST_MOVES + 2 * self.paths.len();
        while let Some((behind, next, at, then)) = open.pop() {
            if patience == 0 {
                return false;
            }
            patience -= 1;
            members.truncate(behind);
            members.push((next, at));
            if then == from {
                if members.len() >= 3 {
                    let mut ring = members.clone();
                    let lowest = (0..ring.len()).min_by_key(|&i| ring[i].0);
                    ring.rotate_left(lowest.unwrap_or(0));
                    if !tell(ring.into()) {
                        return true;
                    }
                }
            } else if members.iter().all(|(_, v)| *v != then) {
                // Others run into a ring without being part of it.
                follow(&mut open, members.len(), then);
            }
        }
        true
    }

    /// Tells of every conflict that an agent would have with others on a path; false if rings were cut.
    fn visit_conflicts(
        &self,
        agent: usize,
        path: &[Vertex],
        tell: &mut dyn FnMut(Conflict),
    ) -> bool {
        let agent = agent as u32;
        let mut whole = true;
        let Rules {
            until: last,
            delay,
            rings,
        } = self.rules;
        let pair = |other: u32| [agent.min(other), agent.max(other)];
        for (v, from, until, next) in stays(path) {
            if from > last {
                break;
            }
            for other in &self.visits[v as usize] {
                let later = from.max(other.from);
                let together = from <= other.until.saturating_add(delay)
                    && other.from <= until.saturating_add(delay);
                if together && later <= last && other.agent != agent {
                    tell(Conflict {
                        time: later.min(until).min(other.until),
                        agents: pair(other.agent),
                        kind: Kind::Cell(v),
                    });
                }
            }
            if until == FOREVER || until >= last {
                break;
            }
            // With a delay, whoever exchanges cells has met in both already.
            if delay > 0 {
                continue;
            }
            for other in &self.visits[next as usize] {
                if other.until == until && other.next == v && other.agent != agent {
                    let cells = if agent < other.agent {
                        [v, next]
                    } else {
                        [next, v]
                    };
                    tell(Conflict {
                        time: until,
                        agents: pair(other.agent),
                        kind: Kind::Swap(cells),
                    });
                }
            }
            if rings {
                whole &= self.rings((agent, v, next), until, &mut |members| {
                    let mut numbers: Vec<u32> = members.iter().map(|(member, _)| *member).collect();
                    numbers.sort_unstable();
                    tell(Conflict {
                        time: until,
                        agents: [numbers[0], numbers[1]],
                        kind: Kind::Ring(members),
                    });
                    true
                });
            }
        }
        whole
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const COLS: u32 = 4;

    fn team(paths: &[Vec<Vertex>], rules: Rules) -> Conflicts {
        let mut team = Conflicts::new(16, paths.len(), rules);
        for (agent, path) in paths.iter().enumerate() {
            team.set(agent, path);
        }
        team
    }

    fn at(path: &[Vertex], time: u32) -> Vertex {
        path.get(time as usize)
            .or(path.last())
            .copied()
            .unwrap_or(0)
    }

    /// Three values, one per kind of conflict: true if there is one, found by looking at every
    /// step.
    fn by_steps(paths: &[Vec<Vertex>], rules: Rules) -> [bool; 3] {
        let horizon = paths.iter().map(Vec::len).max().unwrap_or(0) as u32 + rules.delay;
        let last = horizon.min(rules.until);
        let mut found = [false; 3];
        for time in 0..=last {
            for a in 0..paths.len() {
                for b in (0..paths.len()).filter(|&b| a != b) {
                    for later in time..=(time + rules.delay).min(last) {
                        found[0] |= at(&paths[a], time) == at(&paths[b], later);
                    }
                    let moves = at(&paths[a], time) != at(&paths[a], time + 1);
                    found[1] |= moves
                        && time < last
                        && rules.delay == 0
                        && at(&paths[a], time) == at(&paths[b], time + 1)
                        && at(&paths[b], time) == at(&paths[a], time + 1);
                }
            }
            if time == last || !rules.rings || rules.delay > 0 {
                continue;
            }
            // Follow everybody to whoever leaves the cell that it enters.
            for a in 0..paths.len() {
                let (mut now, mut length) = (a, 0);
                while length <= paths.len() {
                    let to = at(&paths[now], time + 1);
                    let next = (0..paths.len())
                        .find(|&b| at(&paths[b], time) == to && at(&paths[b], time + 1) != to);
                    match next {
                        Some(next) if at(&paths[now], time) != to => now = next,
                        _ => break,
                    }
                    length += 1;
                    if now == a {
                        found[2] |= length > 2;
                        break;
                    }
                }
            }
        }
        found
    }

    fn kinds(conflicts: &[Conflict]) -> [bool; 3] {
        let mut found = [false; 3];
        for conflict in conflicts {
            match conflict.kind {
                Kind::Cell(_) => found[0] = true,
                Kind::Swap(_) => found[1] = true,
                Kind::Ring(_) => found[2] = true,
            }
        }
        found
    }

    fn walk() -> impl Strategy<Value = Vec<Vertex>> {
        (0_u32..16, prop::collection::vec(0_u32..5, 0..6)).prop_map(|(start, moves)| {
            let mut path = vec![start];
            for step in moves {
                let v = at(&path, u32::MAX);
                let (row, col) = (v / COLS, v % COLS);
                path.push(match step {
                    0 if row > 0 => v - COLS,
                    1 if row + 1 < COLS => v + COLS,
                    2 if col > 0 => v - 1,
                    3 if col + 1 < COLS => v + 1,
                    _ => v,
                });
            }
            path
        })
    }

    proptest! {
        /// The conflicts kept up to date are those found from scratch, and those found by looking
        /// at every step.
        #[test]
        fn incremental_is_from_scratch(
            paths in prop::collection::vec(walk(), 2..6),
            changes in prop::collection::vec((0_usize..6, walk()), 0..6),
            until in prop::sample::select(vec![0, 1, 2, 4, FOREVER]),
            delay in 0_u32..3,
            rings: bool,
        ) {
            let rules = Rules { until, delay, rings };
            let mut paths = paths;
            let mut kept = team(&paths, rules);
            for (agent, path) in changes {
                let agent = agent % paths.len();
                let expected = kept.all().len() - kept.count(agent) + kept.count_on(agent, &path);
                kept.set(agent, &path);
                prop_assert_eq!(kept.all().len(), expected);
                paths[agent] = path;
            }
            let mut kept = kept.all().to_vec();
            kept.sort();
            let scratch = team(&paths, rules);
            let mut scratch = scratch.all().to_vec();
            scratch.sort();
            let cells_are_shared = scratch.iter().any(|c| matches!(c.kind, Kind::Cell(_)));
            let steps = by_steps(&paths, rules);
            prop_assert_eq!(kinds(&scratch)[..2].to_vec(), steps[..2].to_vec());
            // Of several agents in a cell that leave it together one stands for all.
            if !cells_are_shared {
                prop_assert_eq!(kinds(&scratch), steps);
                prop_assert_eq!(kept, scratch);
            }
        }
    }

    #[test]
    fn a_ring_is_a_conflict_of_all_its_members() {
        let paths = [vec![1, 0], vec![0, 4], vec![4, 5], vec![5, 1]];
        let ring = Rules {
            rings: true,
            ..Rules::default()
        };
        assert!(team(&paths, Rules::default()).all().is_empty());
        let mut team = team(&paths, ring);
        let members = [(0, 1), (1, 0), (2, 4), (3, 5)];
        let expected = Conflict {
            time: 0,
            agents: [0, 1],
            kind: Kind::Ring(members.into()),
        };
        assert_eq!(team.all(), [expected]);
        team.set(2, &[4, 4, 5]);
        assert_eq!(team.all().len(), 1, "{:?}", team.all());
        assert!(matches!(team.all()[0].kind, Kind::Cell(4)));
    }

    #[test]
    fn rings_through_a_cell_with_several_agents_are_all_found() {
        // Agents 1 and 4 are both in cell 0 and both go to cell 4.
        let paths = [vec![1, 0], vec![0, 4], vec![4, 5], vec![5, 1], vec![0, 4]];
        let rules = Rules {
            rings: true,
            ..Rules::default()
        };
        let mut team = team(&paths, rules);
        let rings = |team: &Conflicts| {
            let kinds = team.all().iter().map(|conflict| &conflict.kind);
            kinds.filter(|kind| matches!(kind, Kind::Ring(_))).count()
        };
        assert_eq!(rings(&team), 2);
        assert!(team.ring(9, 1, 0, 0).is_some());
        // One of the two goes elsewhere: the other still turns with the rest.
        team.set(1, &[8]);
        assert_eq!(rings(&team), 1);
        team.set(4, &[9]);
        assert!(team.all().is_empty());
    }

    /// Twelve cells in a circle with six agents each had more rings than anybody can wait for.
    #[test]
    fn rings_of_crowds_are_not_all_told_but_the_last_one_is_found() {
        let circle = [0, 1, 2, 3, 7, 11, 15, 14, 13, 12, 8, 4];
        let rules = Rules {
            rings: true,
            ..Rules::default()
        };
        let step = |at: usize| vec![circle[at], circle[(at + 1) % circle.len()]];
        let paths: Vec<Vec<Vertex>> = (0..72).map(|agent| step(agent % 12)).collect();
        let mut team = team(&paths, rules);
        assert!(team.all().len() > 72);
        for agent in 12..72 {
            team.clear(agent);
        }
        let kinds: Vec<&Kind> = team.all().iter().map(|conflict| &conflict.kind).collect();
        assert!(matches!(kinds[..], [Kind::Ring(members)] if members.len() == 12));
        team.clear(3);
        assert!(team.all().is_empty());
    }

    #[test]
    fn whoever_is_parked_is_met_at_any_time() {
        let paths = [vec![3], vec![0, 1, 2, 3, 7], vec![12, 8, 4]];
        let found = team(&paths, Rules::default());
        let expected = Conflict {
            time: 3,
            agents: [0, 1],
            kind: Kind::Cell(3),
        };
        assert_eq!(found.all(), [expected]);
        let window = Rules {
            until: 2,
            ..Rules::default()
        };
        assert!(team(&paths, window).all().is_empty());
    }

    #[test]
    fn with_a_delay_cells_stay_taken() {
        let rules = |delay| Rules {
            delay,
            ..Rules::default()
        };
        let paths = [vec![1, 2, 3], vec![0, 0, 1, 2]];
        assert!(team(&paths, rules(0)).all().is_empty());
        assert!(team(&paths, rules(1)).all().is_empty());
        let found = team(&paths, rules(2));
        assert_eq!(found.all().len(), 2, "{:?}", found.all());
        assert_eq!(found.all()[0].time, 0);
    }
}

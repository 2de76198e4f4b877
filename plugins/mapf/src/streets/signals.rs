//! Signals before passages that are driven in both directions.
//!
//! Two crowds that meet at a door push each other for ever: where robots cannot move in chains at
//! once, each of them moves only after the one before has left. So a passage is open in one direction
//! at a time, in turn where both sides want it, and who is inside goes first and is let out. The cells
//! straight ahead of its ends, its approaches, are part of it: a crowd would close them. A dead end
//! takes one agent at a time.

use fleetyard_abi::Traffic;
use fleetyard_plugin_spacetime::graph::{DIRECTIONS, Graph, Vertex};

use super::passages::{NONE, Passage};

/// Agents want a passage that is on their way within so many moves.
pub(super) const SIGHT: usize = 20;
/// The turn of an end is two periods of averages long, and two more for every so many cells.
const CELLS_PER_PERIOD: usize = 5;
/// Most cells straight ahead of a passage that make up its approach.
const APPROACH: usize = 12;

/// The passages of a map that have signals, and their approaches: the cells straight ahead of their
/// ends. Who waits leaves them clear, so that those who come out get away; who may enter joins where
/// it stands, so that robots turn there at the same time and not one after the other in the door.
#[derive(Debug)]
pub(super) struct Crossings {
    list: Vec<Passage>,
    /// Per vertex the passage that it is in.
    at: Box<[u32]>,
    /// Per vertex the approach that it is in, and the cells between it and the end of the approach.
    approach: Box<[Option<(Gate, u8)>]>,
    /// Per vertex true if it is beside an approach.
    beside: Box<[bool]>,
}

/// An agent enters a passage at an end, or leaves it there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Gate {
    passage: u32,
    end: u8,
}

impl Crossings {
    /// Of the given passages those that agents drive through in both directions, before which
    /// there is room to wait. `may` says if a move is allowed.
    pub(super) fn new(
        graph: &Graph,
        passages: Vec<Passage>,
        may: impl Fn(Vertex, usize) -> bool,
    ) -> Self {
        let both_ways = |passage: &Passage| {
            let mut moves = passage.through(graph, 0);
            moves.extend(passage.through(graph, 1));
            passage.has_room(graph) && moves.into_iter().all(|(v, d)| may(v, d))
        };
        let list: Vec<Passage> = passages.into_iter().filter(both_ways).collect();
        let mut at = vec![NONE; graph.len()].into_boxed_slice();
        for (number, passage) in (0..).zip(&list) {
            for &cell in &passage.cells {
                at[cell as usize] = number;
            }
        }
        let mut approach = vec![None; graph.len()].into_boxed_slice();
        for (number, passage) in (0..).zip(&list) {
            for end in [0, 1] {
                // The last move of those who leave here.
                let Some(&(last, out)) = passage.through(graph, 1 - end).last() else {
                    continue;
                };
                let mut next = graph.around(last)[out];
                if next != passage.mouths[end] {
                    continue;
                }
                let mut cells: Vec<Vertex> = Vec::new();
                while cells.len() < APPROACH
                    && next != graph.wall()
                    && at[next as usize] == NONE
                    && approach[next as usize].is_none()
                {
                    cells.push(next);
                    next = graph.around(next)[out];
                }
                let gate = Gate {
                    passage: number,
                    end: end as u8,
                };
                for (left, &cell) in cells.iter().rev().enumerate() {
                    approach[cell as usize] = Some((gate, left as u8));
                }
            }
        }
        let mut beside = vec![false; graph.len()].into_boxed_slice();
        for v in (0..graph.len() as Vertex).filter(|v| approach[*v as usize].is_some()) {
            for u in graph.neighbors(v) {
                beside[u as usize] = true;
            }
        }
        Self {
            list,
            at,
            approach,
            beside,
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Passages that have signals.
    pub(super) fn len(&self) -> usize {
        self.list.len()
    }

    /// The passage that a vertex is in.
    #[inline]
    pub(super) fn at(&self, v: Vertex) -> Option<u32> {
        Some(self.at[v as usize]).filter(|passage| *passage != NONE)
    }

    /// True if an agent at `v` is in nobody's way: others get round it on all sides, and it is not
    /// before a passage.
    pub(super) fn can_wait(&self, graph: &Graph, v: Vertex) -> bool {
        let corner = |d: usize| {
            let side = graph.around(v)[d];
            graph.around(side)[(d + 1) % DIRECTIONS]
        };
        let free = |u: Vertex| u != graph.wall();
        let before = self.contains(v) || self.approach[v as usize].is_some();
        !before
            && !self.beside[v as usize]
            && graph.around(v).iter().all(|u| free(*u))
            && (0..DIRECTIONS).all(|d| free(corner(d)))
    }

    #[inline]
    pub(super) fn contains(&self, v: Vertex) -> bool {
        self.at[v as usize] != NONE
    }

    /// Steps that a move from `v` to `u` is charged since it joins an approach from its side, or
    /// leaves it there: the more, the nearer to the passage.
    pub(super) fn charge(&self, v: Vertex, u: Vertex) -> u32 {
        if self.contains(v) || self.contains(u) {
            return 0;
        }
        match (self.approach[v as usize], self.approach[u as usize]) {
            (Some((from, _)), Some((to, _))) if from == to => 0,
            (from, to) => {
                let ends = from.into_iter().chain(to);
                ends.map(|(_, left)| u32::from(left)).sum()
            }
        }
    }

    /// The passage that a move from `v` to `u` enters, or leaves.
    #[inline]
    fn crossed(&self, v: Vertex, u: Vertex) -> (Option<Gate>, Option<Gate>) {
        let (from, to) = (self.at[v as usize], self.at[u as usize]);
        if from == to {
            return (None, None);
        }
        let gate = |passage: u32, mouth: Vertex, inside: Vertex| {
            let Passage { cells, mouths } = self.list.get(passage as usize)?;
            let is =
                |end: usize, cell: Option<&Vertex>| mouths[end] == mouth && cell == Some(&inside);
            let end = if is(0, cells.first()) {
                0
            } else if is(1, cells.last()) {
                1
            } else {
                return None;
            };
            Some(Gate { passage, end })
        };
        (gate(to, v, u), gate(from, u, v))
    }
}

/// Agents at a passage.
#[derive(Debug, Clone, Copy, Default)]
struct Crowd {
    /// Inside, by the end that they leave at; in a dead end all of them.
    inside: [u32; 2],
    /// On the approach to an end, about to enter there.
    coming: [u32; 2],
    /// Elsewhere, about to enter at an end.
    waiting: [u32; 2],
    /// The first to get to the passage, with the moves that it needs.
    first: Option<(usize, usize)>,
}

impl Crowd {
    /// The ends at which agents may enter, and those at which others may join them. It is the turn
    /// of an end, and towards the end of the turn nobody joins, so that the approach is left.
    fn open(&self, passage: &Passage, turn: Option<Turn>) -> [[bool; 2]; 2] {
        if passage.is_dead_end() {
            return [[self.inside == [0, 0]; 2]; 2];
        }
        let wanted = [0, 1].map(|end| self.coming[end] + self.waiting[end]);
        let (of, last) = match (turn, wanted) {
            (_, [0, 0]) => return [[true; 2]; 2],
            (_, [_, 0]) => (0, false),
            (_, [0, _]) => (1, false),
            // Nobody comes any more.
            (Some(Turn { of, last: true }), _) if self.coming[of] == 0 => (1 - of, false),
            (Some(Turn { of, last }), _) => (of, last),
            (None, [first, second]) => (usize::from(second > first), false),
        };
        let (mut enter, mut join) = ([false; 2], [false; 2]);
        // Those who leave at this end have entered at the other.
        if self.inside[of] == 0 {
            enter[of] = true;
            join[of] = !last;
        }
        [enter, join]
    }
}

/// The end whose turn it is.
#[derive(Debug, Clone, Copy)]
struct Turn {
    of: usize,
    /// True if only those who are already coming may still enter.
    last: bool,
}

impl Turn {
    fn at(number: usize, passage: &Passage, traffic: &Traffic) -> Self {
        let periods = 1 + (passage.cells.len() / CELLS_PER_PERIOD) as u64;
        let turn = traffic.last.number / periods + number as u64;
        Self {
            of: (turn / 2 % 2) as usize,
            last: turn % 2 == 1,
        }
    }
}

/// The agents that may go through passages in a call.
#[derive(Debug)]
pub(super) struct Signals {
    /// Per passage: agents may enter at the end.
    open: Vec<[bool; 2]>,
    /// Per agent the end at which it has to wait.
    held: Vec<Option<Gate>>,
}

impl Signals {
    /// `routes` are the next cells of agents on their ways, the first of which is where they are.
    /// Passages change their directions with the periods of averages, or with the numbers of agents
    /// at their ends where the time is not known.
    pub(super) fn new(
        crossings: &Crossings,
        routes: impl Iterator<Item = [Vertex; SIGHT]>,
        traffic: Option<&Traffic>,
    ) -> Self {
        let mut crowds = vec![Crowd::default(); crossings.list.len()];
        // The end at which an agent wants to enter, and if it is on its approach.
        let mut wants = Vec::new();
        for (agent, route) in routes.enumerate() {
            let here = crossings.at[route[0] as usize];
            let (mut wanted, mut left) = (None, None);
            for (moves, step) in route.windows(2).enumerate() {
                let (enters, leaves) = crossings.crossed(step[0], step[1]);
                if here != NONE && left.is_none() {
                    left = leaves;
                }
                if let Some(gate) = enters.filter(|_| wanted.is_none()) {
                    let first = &mut crowds[gate.passage as usize].first;
                    *first = Some(first.map_or((moves, agent), |first| first.min((moves, agent))));
                    wanted = enters;
                }
            }
            if here != NONE && crossings.list[here as usize].is_dead_end() {
                crowds[here as usize].inside[0] += 1;
            } else if let Some(Gate { passage, end }) = left {
                crowds[passage as usize].inside[usize::from(end)] += 1;
            }
            let wanted = wanted.map(|gate| {
                let on = crossings.approach[route[0] as usize];
                (gate, on.is_some_and(|(approach, _)| approach == gate))
            });
            if let Some((Gate { passage, end }, comes)) = wanted {
                let crowd = &mut crowds[passage as usize];
                let count = if comes {
                    &mut crowd.coming
                } else {
                    &mut crowd.waiting
                };
                count[usize::from(end)] += 1;
            }
            // Whoever is inside gets out first.
            wants.push(wanted.filter(|_| here == NONE));
        }
        let columns = crossings.list.iter().zip(&crowds).enumerate();
        let open: Vec<[[bool; 2]; 2]> = columns
            .map(|(number, (passage, crowd))| {
                let turn = traffic.map(|traffic| Turn::at(number, passage, traffic));
                crowd.open(passage, turn)
            })
            .collect();
        let held = wants.iter().enumerate().map(|(agent, wants)| {
            let (gate, comes) = (*wants)?;
            let passage = gate.passage as usize;
            let [enter, join] = open[passage].map(|ends| ends[usize::from(gate.end)]);
            let mut may = if comes { enter } else { join };
            if crossings.list[passage].is_dead_end() {
                may &= crowds[passage]
                    .first
                    .is_some_and(|(_, first)| first == agent);
            }
            (!may).then_some(gate)
        });
        Self {
            held: held.collect(),
            open: open.into_iter().map(|[enter, _]| enter).collect(),
        }
    }

    /// True if an agent has to wait at a passage.
    #[inline]
    pub(super) fn holds(&self, agent: usize) -> bool {
        self.held.get(agent).is_some_and(Option::is_some)
    }

    /// The weight of the reason for which an agent had better not move from `v` to `u`, or stay if they
    /// are the same; 0 for none. An agent that waits leaves the approach clear, and the cells beside
    /// it, without which nobody could be pushed off the approach.
    #[inline]
    pub(super) fn closed(&self, crossings: &Crossings, agent: usize, v: Vertex, u: Vertex) -> u32 {
        let held = self.held.get(agent).copied().flatten();
        let (enters, _) = crossings.crossed(v, u);
        let shut = |gate: Gate| {
            held == Some(gate) || !self.open[gate.passage as usize][usize::from(gate.end)]
        };
        if enters.is_some_and(shut) {
            3
        } else if held.is_none() {
            0
        } else if crossings.approach[u as usize].is_some() {
            2
        } else {
            u32::from(crossings.beside[u as usize])
        }
    }
}

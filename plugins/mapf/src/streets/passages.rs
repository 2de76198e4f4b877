//! Passages of one cell's width that are driven in both directions, such as doors and aisles between
//! rooms, and who may enter them.
//!
//! Two crowds that meet at a door push each other for ever: where robots cannot move in chains at
//! once, each of them moves only after the one before has left. So a passage is open in one direction
//! at a time, in turn where both sides want it, and who is inside goes first and is let out.

use fleetyard_plugin_spacetime::graph::{DIRECTIONS, Graph, Vertex};

use super::ways::Moves;

/// No passage.
const NONE: u32 = u32::MAX;
/// Agents want a passage that is on their way within so many moves.
pub(super) const SIGHT: usize = 10;
/// A passage stays open for a period of the averages, and for another one per so many cells.
const CELLS_PER_PERIOD: usize = 20;

/// Its cells in a row, none of which leaves room for two, and the cells before its ends.
#[derive(Debug)]
struct Passage {
    cells: Vec<Vertex>,
    mouths: [Vertex; 2],
}

/// The passages of a map.
#[derive(Debug)]
pub(super) struct Passages {
    list: Vec<Passage>,
    /// Per vertex the passage that it is in.
    at: Box<[u32]>,
}

/// An agent enters a passage at an end, or leaves it there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Gate {
    passage: u32,
    end: u8,
}

impl Passages {
    pub(super) fn new(graph: &Graph, moves: &Moves) -> Self {
        let count = graph.len();
        let narrow: Vec<bool> = (0..count as Vertex)
            .map(|v| is_narrow(graph, moves, v))
            .collect();
        let mut at = vec![NONE; count].into_boxed_slice();
        let mut list: Vec<Passage> = Vec::new();
        for v in 0..count as Vertex {
            if !narrow[v as usize] || at[v as usize] != NONE {
                continue;
            }
            // From any of its cells to both ends; a passage that is none comes up again.
            let mut cells = std::collections::VecDeque::from([v]);
            let mut mouths = [v; 2];
            let mut seen = vec![v];
            for (end, first) in graph.neighbors(v).enumerate().take(2) {
                let mut next = first;
                let mut last = v;
                while narrow[next as usize] && !seen.contains(&next) {
                    seen.push(next);
                    if end == 0 {
                        cells.push_front(next);
                    } else {
                        cells.push_back(next);
                    }
                    let on = graph.neighbors(next).find(|u| *u != last);
                    last = next;
                    next = on.unwrap_or(last);
                }
                mouths[end] = next;
            }
            // Where nothing but passages meet nobody has a place to wait in.
            let waits = |mouth: &Vertex| {
                let beside = graph.neighbors(*mouth);
                beside.filter(|u| !narrow[*u as usize]).count() > 1
            };
            if !mouths.iter().all(waits) {
                continue;
            }
            for &cell in &cells {
                at[cell as usize] = list.len() as u32;
            }
            list.push(Passage {
                cells: cells.into(),
                mouths,
            });
        }
        Self { list, at }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    #[inline]
    pub(super) fn contains(&self, v: Vertex) -> bool {
        self.at[v as usize] != NONE
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

/// True if nobody gets past an agent at `v`, and everybody may drive through in both directions.
fn is_narrow(graph: &Graph, moves: &Moves, v: Vertex) -> bool {
    let around = graph.around(v);
    let ends: Vec<usize> = (0..DIRECTIONS)
        .filter(|d| around[*d] != graph.wall())
        .collect();
    let &[a, b] = &ends[..] else {
        return false;
    };
    // Round a corner that leads past it there is another way.
    let past = b - a != 2 && graph.around(around[a])[b] != graph.wall();
    let both = |d: usize| {
        moves.away(v, d).is_some() && moves.away(around[d], (d + 2) % DIRECTIONS).is_some()
    };
    !past && both(a) && both(b)
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
    /// `period` is the number of the period, if the time is known.
    pub(super) fn new(
        passages: &Passages,
        routes: impl Iterator<Item = [Vertex; SIGHT]>,
        period: Option<u64>,
    ) -> Self {
        let count = passages.list.len();
        // Agents inside by the end that they leave at, and agents that want to enter at an end.
        let (mut inside, mut wanted) = (vec![[0_u32; 2]; count], vec![[0_u32; 2]; count]);
        let mut leaves = Vec::new();
        let mut held: Vec<Option<Gate>> = routes
            .map(|route| {
                let here = passages.at[route[0] as usize];
                let mut wants = None;
                let mut left = None;
                for step in route.windows(2) {
                    let (enters, leaves) = passages.crossed(step[0], step[1]);
                    if here != NONE && left.is_none() {
                        left = leaves;
                    }
                    if wants.is_none() {
                        wants = enters;
                    }
                }
                if let Some(Gate { passage, end }) = left {
                    inside[passage as usize][usize::from(end)] += 1;
                }
                if let Some(Gate { passage, end }) = wants {
                    wanted[passage as usize][usize::from(end)] += 1;
                }
                leaves.push(left);
                wants
            })
            .collect();
        let columns = passages.list.iter().zip(&inside).zip(&wanted).enumerate();
        let open: Vec<[bool; 2]> = columns
            .map(|(number, ((passage, inside), wanted))| {
                let turns = 1 + (passage.cells.len() / CELLS_PER_PERIOD) as u64;
                let first = match period {
                    Some(period) => (period / turns + number as u64) % 2,
                    None => u64::from(wanted[1] > wanted[0]),
                } as usize;
                let mut open = [false; 2];
                match inside {
                    [0, 0] if wanted[0] > 0 && wanted[1] > 0 => open[first] = true,
                    [0, 0] => open = [true; 2],
                    // Those who leave at one end have entered at the other.
                    [_, 0] => open[1] = first == 1 || wanted[0] == 0,
                    [0, _] => open[0] = first == 0 || wanted[1] == 0,
                    _ => {}
                }
                open
            })
            .collect();
        for gate in &mut held {
            *gate = gate.filter(|gate| !open[gate.passage as usize][usize::from(gate.end)]);
        }
        Self { open, held }
    }

    /// True if an agent has to wait at a passage.
    #[inline]
    pub(super) fn holds(&self, agent: usize) -> bool {
        self.held.get(agent).is_some_and(Option::is_some)
    }

    /// True if an agent had better not move from `v` to `u`, or stay if they are the same: into a
    /// passage that is closed, or before it.
    #[inline]
    pub(super) fn closed(&self, passages: &Passages, agent: usize, v: Vertex, u: Vertex) -> bool {
        let held = self.held.get(agent).copied().flatten();
        if let Some(Gate { passage, end }) = held
            && passages.list[passage as usize].mouths[usize::from(end)] == u
        {
            return true;
        }
        let (enters, _) = passages.crossed(v, u);
        enters.is_some_and(|Gate { passage, end }| !self.open[passage as usize][usize::from(end)])
    }
}

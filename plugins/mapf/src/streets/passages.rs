//! Passages of one cell's width, such as doors and aisles between rooms, and dead ends.

use std::collections::VecDeque;

use fleetyard_plugin_spacetime::graph::{DIRECTIONS, Graph, Vertex};

/// No passage, or no mouth.
pub(super) const NONE: u32 = u32::MAX;

/// Cells in a row, none of which leaves room for two, and the cells before its ends.
#[derive(Debug)]
pub(super) struct Passage {
    pub(super) cells: Vec<Vertex>,
    /// Before the first of the cells and after the last; [`NONE`] where a dead end ends.
    pub(super) mouths: [Vertex; 2],
}

impl Passage {
    /// The passages of a map, but for those that lead nowhere else but to themselves.
    pub(super) fn all(graph: &Graph) -> Vec<Self> {
        let count = graph.len() as Vertex;
        let narrow: Vec<bool> = (0..count).map(|v| is_narrow(graph, v)).collect();
        let mut seen = vec![false; graph.len()];
        let mut list: Vec<Self> = Vec::new();
        for v in (0..count).filter(|v| narrow[*v as usize]) {
            if std::mem::replace(&mut seen[v as usize], true) {
                continue;
            }
            let mut cells = VecDeque::from([v]);
            let mut mouths = [NONE; 2];
            for (end, first) in graph.neighbors(v).enumerate() {
                let (mut last, mut next) = (v, Some(first));
                while let Some(u) = next.filter(|u| narrow[*u as usize] && !seen[*u as usize]) {
                    seen[u as usize] = true;
                    if end == 0 {
                        cells.push_front(u);
                    } else {
                        cells.push_back(u);
                    }
                    next = graph.neighbors(u).find(|on| *on != last);
                    last = u;
                }
                mouths[end] = next.unwrap_or(NONE);
            }
            let is_open = |mouth: &Vertex| *mouth == NONE || !narrow[*mouth as usize];
            if mouths != [NONE; 2] && mouths.iter().all(is_open) {
                list.push(Self {
                    cells: cells.into(),
                    mouths,
                });
            }
        }
        list
    }

    pub(super) fn is_dead_end(&self) -> bool {
        self.mouths.contains(&NONE)
    }

    /// True if agents before an end have places to wait in: where nothing but passages meet they
    /// have none.
    pub(super) fn has_room(&self, graph: &Graph) -> bool {
        let mouths = self.mouths.iter().filter(|mouth| **mouth != NONE);
        mouths.copied().all(|mouth| {
            let beside = graph.neighbors(mouth);
            beside.filter(|u| !is_narrow(graph, *u)).count() > 1
        })
    }

    /// The moves through it of those who enter at an end.
    pub(super) fn through(&self, graph: &Graph, end: usize) -> Vec<(Vertex, usize)> {
        let mut way: Vec<Vertex> = vec![self.mouths[0]];
        way.extend(&self.cells);
        way.push(self.mouths[1]);
        if end == 1 {
            way.reverse();
        }
        let steps = way.windows(2).filter(|step| !step.contains(&NONE));
        let moves = steps.filter_map(|step| {
            let mut around = graph.around(step[0]).iter();
            Some((step[0], around.position(|u| *u == step[1])?))
        });
        moves.collect()
    }
}

/// True if nobody gets past an agent at `v`.
fn is_narrow(graph: &Graph, v: Vertex) -> bool {
    let around = graph.around(v);
    let mut ends = (0..DIRECTIONS).filter(|d| around[*d] != graph.wall());
    match (ends.next(), ends.next(), ends.next()) {
        (Some(_), None, _) => true,
        // Round a corner there may be another way that leads past it.
        (Some(a), Some(b), None) => b - a == 2 || graph.around(around[a])[b] == graph.wall(),
        _ => false,
    }
}

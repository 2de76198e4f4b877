//! Scatter: individual paths that avoid one another, as guidance for PIBT.
//!
//! Space utilisation optimisation of K. Okumura, "Engineering LaCAM*: towards
//! real-time, large-scale, and near-optimal multi-agent pathfinding", AAMAS 2024:
//! every agent gets a path at most `margin` longer than its shortest one that
//! collides as little as it can with those of the others; PIBT then prefers the
//! next vertex of that path whenever the agent stands on it.
//!
//! The paths may still collide: they are advice, not a plan.

use fleetyard_plugin_spacetime::distance::Distances;
use fleetyard_plugin_spacetime::graph::{DIRECTIONS, Graph, Vertex};
use fleetyard_plugin_spacetime::random::Random;

/// Longest detour: more takes memory and gains nothing.
const MAX_MARGIN: u32 = 100;
/// Above this much memory for the occupancy table no guidance is computed.
const MEMORY_LIMIT: usize = 1 << 30;
/// Most rounds of replanning everybody.
const ROUNDS: usize = 10;
/// No further round after so many expansions per step of the shortest paths: on large
/// maps the ellipses are wide.
const WORK: u64 = 60;
/// Not parked.
const NEVER: u32 = u32::MAX;

/// Per agent and vertex, a direction to prefer: one small hash table per agent.
#[derive(Debug, Clone, Default)]
pub(crate) struct Guide {
    /// `vertex · 8 + direction + 1`, or zero for an empty slot.
    slots: Vec<u32>,
    /// Index of the first slot of an agent's table, and the table's size less one.
    tables: Vec<(usize, usize)>,
}

impl Guide {
    fn new(graph: &Graph, paths: &[Vec<Vertex>]) -> Self {
        let mut guide = Self::default();
        for path in paths {
            let size = (2 * path.len()).next_power_of_two();
            let begin = guide.slots.len();
            guide.tables.push((begin, size - 1));
            guide.slots.resize(begin + size, 0);
            for step in path.windows(2) {
                let around = graph.around(step[0]);
                if let Some(d) = around.iter().position(|&u| u == step[1]) {
                    let mut at = Self::slot(step[0]);
                    while guide.slots[begin + (at & (size - 1))] != 0 {
                        at += 1;
                    }
                    guide.slots[begin + (at & (size - 1))] = step[0] << 3 | (d as u32 + 1);
                }
            }
        }
        guide
    }

    fn slot(v: Vertex) -> usize {
        (v.wrapping_mul(0x9e37_79b1) >> 12) as usize
    }

    /// Direction plus one, or zero.
    #[inline]
    pub(crate) fn direction(&self, agent: usize, v: Vertex) -> u8 {
        let Some(&(begin, mask)) = self.tables.get(agent) else {
            return 0;
        };
        let mut at = Self::slot(v);
        loop {
            let slot = self.slots[begin + (at & mask)];
            if slot == 0 {
                return 0;
            }
            if slot >> 3 == v {
                return (slot & 7) as u8;
            }
            at += 1;
        }
    }
}

/// A vertex to expand.
#[derive(Debug, Clone, Copy)]
struct Open {
    v: Vertex,
    g: u32,
    /// Direction of the vertex it is entered from, plus one.
    via: u8,
}

/// Not expanded; otherwise the direction by which a vertex was entered plus one, or
/// [`ROOT`].
const UNSEEN: u8 = 0;
const ROOT: u8 = DIRECTIONS as u8 + 1;

/// Computes the guidance. `stop` is asked between paths; a stopped computation gives
/// what it has, which makes no difference to validity.
pub(crate) fn scatter(
    distances: &mut Distances<'_>,
    starts: &[Vertex],
    goals: &[Vertex],
    margin: u32,
    random: &mut Random,
    stop: &mut dyn FnMut() -> bool,
) -> Guide {
    let graph = distances.graph();
    let margin = margin.min(MAX_MARGIN);
    let shortest = (0..starts.len()).map(|agent| u64::from(distances.get(agent, starts[agent])));
    let (lengths, longest) = shortest.fold((0, 0), |(sum, max), d| (sum + d, d.max(max)));
    let stride = graph.len() + 1;
    let cells = stride * (longest as usize + margin as usize + 2);
    if cells * (1 + DIRECTIONS) > MEMORY_LIMIT {
        return Guide::default();
    }
    let mut search = Scatter {
        graph,
        distances,
        margin,
        standing: vec![0; cells],
        entered_from: vec![[0; DIRECTIONS]; cells],
        stride,
        parked: vec![NEVER; stride],
        buckets: Vec::new(),
        entered: vec![UNSEEN; stride],
        touched: Vec::new(),
        expansions: 0,
    };
    let mut paths: Vec<Vec<Vertex>> = vec![Vec::new(); starts.len()];
    let mut order: Vec<usize> = (0..starts.len()).collect();
    let mut before = u64::MAX;
    for _ in 0..ROUNDS {
        random.shuffle(&mut order);
        for &agent in &order {
            if stop() {
                break;
            }
            search.improve(agent, starts[agent], goals[agent], &mut paths[agent]);
        }
        let collisions = paths.iter().map(|path| search.collisions(path, 1)).sum();
        let enough = search.expansions > WORK * lengths;
        if collisions == 0 || collisions >= before || enough {
            break;
        }
        before = collisions;
    }
    drop(search);

    Guide::new(graph, &paths)
}

/// Single-agent search in the occupancy of the others.
struct Scatter<'a, 'g> {
    graph: &'g Graph,
    distances: &'a mut Distances<'g>,
    margin: u32,
    /// Number of agents at `v` at `t`, at `t · stride + v`, and the number of those that have come
    /// from each direction. Counts may wrap: this is advice. They are apart because the search
    /// reads many of the first and few of the second.
    standing: Vec<u8>,
    entered_from: Vec<[u8; DIRECTIONS]>,
    stride: usize,
    /// Time at which an agent arrives at this vertex to stay.
    parked: Vec<u32>,
    /// Open vertices by (collisions, detour): a monotone bucket queue.
    buckets: Vec<Vec<Open>>,
    entered: Vec<u8>,
    touched: Vec<Vertex>,
    expansions: u64,
}

impl Scatter<'_, '_> {
    /// Replaces the path of an agent by the one with the fewest collisions.
    fn improve(&mut self, agent: usize, start: Vertex, goal: Vertex, path: &mut Vec<Vertex>) {
        let shortest = self.distances.get(agent, start);
        self.count(path, u8::wrapping_sub);
        let perfect =
            !path.is_empty() && path.len() as u32 == shortest + 1 && self.collisions(path, 0) == 0;
        if !perfect {
            self.search(agent, start, goal, shortest);
            path.clear();
            path.push(goal);
            let mut v = goal;
            while let Some(d) = self.entered[v as usize].checked_sub(1) {
                if d as usize >= DIRECTIONS {
                    break;
                }
                v = self.graph.sources(v)[d as usize];
                path.push(v);
            }
            path.reverse();
            for v in self.touched.drain(..) {
                self.entered[v as usize] = UNSEEN;
            }
        }
        self.count(path, u8::wrapping_add);
    }

    /// A* over vertices, each expanded once, in the order of (collisions, length).
    /// Leaves in `entered` the way back from the goal.
    fn search(&mut self, agent: usize, start: Vertex, goal: Vertex, shortest: u32) {
        let detours = self.margin as usize / 2 + 1;
        for bucket in &mut self.buckets {
            bucket.clear();
        }
        let mut current = 0;
        if self.buckets.is_empty() {
            self.buckets.push(Vec::new());
        }
        self.buckets[0].push(Open {
            v: start,
            g: 0,
            via: ROOT,
        });
        while current < self.buckets.len() {
            let Some(Open { v, g, via }) = self.buckets[current].pop() else {
                current += 1;
                continue;
            };
            if self.entered[v as usize] != UNSEEN {
                continue;
            }
            self.entered[v as usize] = via;
            self.touched.push(v);
            self.expansions += 1;
            if v == goal {
                break;
            }
            let collisions = current / detours;
            let now = (g + 1) as usize * self.stride;
            let entered_here = if self.standing[now + v as usize] == 0 {
                [0; DIRECTIONS]
            } else {
                self.entered_from[now + v as usize]
            };
            for (d, &u) in self.graph.around(v).iter().enumerate() {
                // The sentinel has no distance within bounds, so it falls out here.
                if self.entered[u as usize] != UNSEEN {
                    continue;
                }
                // On one-way streets a goal may be out of reach from here, at a distance without bounds.
                let f = self.distances.get(agent, u).saturating_add(g + 1);
                if f > shortest + self.margin {
                    continue;
                }
                let more = usize::from(self.standing[now + u as usize])
                    + usize::from(entered_here[d])
                    + usize::from(self.parked[u as usize] <= g);
                let key = (collisions + more) * detours + (f - shortest) as usize / 2;
                if key >= self.buckets.len() {
                    self.buckets.resize_with(key + 1, Vec::new);
                }
                let via = ((d + 2) % DIRECTIONS) as u8 + 1;
                self.buckets[key].push(Open {
                    v: u,
                    g: g + 1,
                    via,
                });
            }
        }
    }

    /// Adds a path to the occupancy, or takes it away.
    fn count(&mut self, path: &[Vertex], change: fn(u8, u8) -> u8) {
        let Some((&goal, last)) = path.last().zip(path.len().checked_sub(1)) else {
            return;
        };
        let added = change(0, 1) == 1;
        self.parked[goal as usize] = if added { last as u32 } else { NEVER };
        for (t, &v) in path.iter().enumerate() {
            let at = t * self.stride + v as usize;
            self.standing[at] = change(self.standing[at], 1);
            if t > 0 {
                let from = path[t - 1];
                if let Some(d) = self.graph.sources(v).iter().position(|&u| u == from) {
                    self.entered_from[at][d] = change(self.entered_from[at][d], 1);
                }
            }
        }
    }

    /// Collisions of a path with the counted ones; `own` is one if it is counted.
    fn collisions(&self, path: &[Vertex], own: u8) -> u64 {
        let mut sum = 0;
        for (t, step) in path.windows(2).enumerate() {
            let now = (t + 1) * self.stride;
            let standing = self.standing[now + step[1] as usize].wrapping_sub(own);
            sum += u64::from(standing);
            sum += u64::from(self.parked[step[1] as usize] <= t as u32);
            if let Some(d) = self
                .graph
                .around(step[0])
                .iter()
                .position(|&u| u == step[1])
            {
                sum += u64::from(self.entered_from[now + step[0] as usize][d]);
            }
        }
        sum
    }
}

//! PIBT: one step for all agents by priority inheritance with backtracking.
//!
//! K. Okumura, M. Machida, X. Défago, Y. Tamura, "Priority inheritance with
//! backtracking for iterative multi-agent path finding", Artificial Intelligence
//! 310 (2022). The swap operation, which lets two agents change places at the end
//! of a corridor, is in [`swap`].
//!
//! | paper | here |
//! | --- | --- |
//! | configuration at time t, `v_i(t)` | [`Pibt::load`], `Pibt::from`; by vertex: `occupant` |
//! | next vertices, `v_i(t+1)` | [`Pibt::step`], `Pibt::to`; by vertex: `claimant` |
//! | the loop over agents in order of priority | [`Pibt::sample`]; its caller orders them |
//! | function `PIBT(a_i, a_j)` | [`Pibt::decide`]; each call is a [`Frame`] of its stack |
//! | `C_i`: neighbours and `v_i`, sorted by distance to the goal | [`Pibt::frame`], [`Wishes`] |
//! | `a_k` at the vertex, which inherits the priority | `pushed` in [`Pibt::decide`] |
//! | `valid`, `invalid` | the `answer` to the frame below |
//! | no candidate is left: stay, return `invalid` | the last branch of [`Pibt::decide`] |
//! | (not in the paper) rings of moves may be forbidden | [`closes_ring`] |
//!
//! This module makes single steps, as LaCAM's configuration generator wants them;
//! [`crate::one_shot`] iterates them into a planner of its own.
//!
//! The grid is bipartite, so a neighbour is either one closer to the goal or one
//! further: preferences need no sorting. A four-bit mask of the closer directions
//! and a random permutation of the directions, looked up together in a table, give
//! "closer ones in random order, staying, the others in random order".

pub(crate) mod swap;

use fleetyard_plugin_spacetime::distance::Distances;
use fleetyard_plugin_spacetime::graph::{DIRECTIONS, Graph, Vertex};
use fleetyard_plugin_spacetime::random::Random;

use self::swap::Will;
use crate::scatter::Guide;

/// No agent.
const NOBODY: u32 = u32::MAX;
/// Undecided vertex.
const UNDECIDED: Vertex = Vertex::MAX;
/// Permutations of the four directions.
const PERMUTATIONS: usize = 24;
/// Bits of a preference code that hold the closer directions.
const CLOSER: u8 = 0b1111;

/// Preferences of the agents among the vertices where they can be next.
pub(crate) trait Wishes: Will {
    /// The directions that lead `agent` from `v` nearer to where it wants to be, a bit
    /// each, and in the upper half the direction to prefer to them all plus one, if there
    /// is one.
    fn preference(&mut self, graph: &Graph, agent: usize, v: Vertex) -> u8;
    /// The last word about the order in which `agent` tries the vertices where it can be
    /// next, best first. Gives how many of them, at the end, it tries only when it has to leave
    /// `here`.
    #[inline]
    fn rank(
        &mut self,
        _graph: &Graph,
        _agent: usize,
        _here: Vertex,
        _candidates: &mut [Vertex],
    ) -> usize {
        0
    }
}

/// One goal per agent, distances to it, and paths that avoid one another as advice.
pub(crate) struct OneGoal<'a, 'g> {
    pub(crate) goals: &'a [Vertex],
    pub(crate) distances: &'a mut Distances<'g>,
    pub(crate) guide: &'a Guide,
}

impl Wishes for OneGoal<'_, '_> {
    fn preference(&mut self, graph: &Graph, agent: usize, v: Vertex) -> u8 {
        let here = self.distances.get(agent, v);
        let mut code = self.guide.direction(agent, v) << DIRECTIONS;
        for (d, &u) in graph.around(v).iter().enumerate() {
            if u != graph.wall() && self.distances.get(agent, u) < here {
                code |= 1 << d;
            }
        }
        code
    }
}

impl Will for OneGoal<'_, '_> {
    #[inline]
    fn nearer(&mut self, _: &Graph, agent: usize, a: Vertex, b: Vertex) -> bool {
        self.distances.get(agent, a) < self.distances.get(agent, b)
    }

    #[inline]
    fn rests(&self, agent: usize, v: Vertex) -> bool {
        self.goals[agent] == v
    }
}

/// Step generator with its scratch memory.
#[derive(Debug)]
pub(crate) struct Pibt<'g> {
    graph: &'g Graph,
    swap: bool,
    /// True if agents may move round in a ring, each into the cell that the next one
    /// leaves.
    rings: bool,
    /// The loaded configuration, and who stands where in it.
    from: Vec<Vertex>,
    occupant: Vec<u32>,
    loaded: bool,
    /// Per agent: mask of closer directions, and the guide's direction plus one
    /// in the upper half.
    preferences: Vec<u8>,
    /// The step under construction, and who will stand where.
    to: Vec<Vertex>,
    claimant: Vec<u32>,
    stack: Vec<Frame>,
    orders: Box<[[u8; PERMUTATIONS]; 16]>,
}

/// An agent that is choosing its next vertex, waiting for the one it pushes.
#[derive(Debug, Clone, Copy)]
struct Frame {
    agent: u32,
    candidates: [Vertex; DIRECTIONS + 1],
    count: u8,
    next: u8,
    /// The agent to pull into the vertex left behind, if the first choice is won.
    pulled: u32,
}

impl<'g> Pibt<'g> {
    pub(crate) fn new(graph: &'g Graph, agents: usize, swap: bool, rings: bool) -> Self {
        let vertices = graph.len() + 1;
        Self {
            graph,
            // Who changes places goes back where it came from.
            swap: swap && !graph.is_directed(),
            rings,
            from: vec![UNDECIDED; agents],
            occupant: vec![NOBODY; vertices],
            loaded: false,
            preferences: vec![0; agents],
            to: vec![UNDECIDED; agents],
            claimant: vec![NOBODY; vertices],
            stack: Vec::new(),
            orders: direction_orders(),
        }
    }

    /// Sets the configuration that the next steps start from. What an agent wants may
    /// change only when it has moved.
    pub(crate) fn load(&mut self, from: &[Vertex], wishes: &mut impl Wishes) {
        if self.loaded {
            for &v in &self.from {
                self.occupant[v as usize] = NOBODY;
            }
        }
        self.loaded = true;
        for (agent, &v) in from.iter().enumerate() {
            self.occupant[v as usize] = agent as u32;
            if self.from[agent] != v {
                self.from[agent] = v;
                self.preferences[agent] = wishes.preference(self.graph, agent, v);
            }
        }
    }

    /// The step made last.
    pub(crate) fn step(&self) -> &[Vertex] {
        &self.to
    }

    /// Tries to make one step from the loaded configuration: agents choose in the
    /// given order, those in `fixed` go where they are told. False when the fixed
    /// moves collide or leave somebody without a place.
    pub(crate) fn sample(
        &mut self,
        order: &[u32],
        fixed: &[(u32, Vertex)],
        wishes: &mut impl Wishes,
        random: &mut Random,
    ) -> bool {
        self.to.fill(UNDECIDED);
        let mut possible = true;
        for &(agent, v) in fixed {
            let occupant = self.occupant[v as usize];
            let swaps = occupant != NOBODY
                && occupant != agent
                && self.to[occupant as usize] == self.from[agent as usize];
            let here = self.from[agent as usize];
            let ring = !self.rings && closes_ring(&self.occupant, &self.to, here, v);
            if self.claimant[v as usize] != NOBODY || swaps || ring {
                possible = false;
                break;
            }
            self.claimant[v as usize] = agent;
            self.to[agent as usize] = v;
        }
        if possible {
            possible = order.iter().all(|&agent| {
                self.to[agent as usize] != UNDECIDED || self.decide(agent, wishes, random)
            });
        }
        for &v in &self.to {
            if v != UNDECIDED {
                self.claimant[v as usize] = NOBODY;
            }
        }
        possible
    }

    /// The recursion of the paper, on a stack of its own: thousands of agents may
    /// push one another in a chain.
    fn decide(&mut self, agent: u32, wishes: &mut impl Wishes, random: &mut Random) -> bool {
        self.stack.clear();
        let frame = self.frame(agent, wishes, random);
        self.stack.push(frame);
        // What the frame above has just answered, if one has.
        let mut answer: Option<bool> = None;
        while let Some(top) = self.stack.last_mut() {
            let here = self.from[top.agent as usize];
            let mut won = answer.take() == Some(true);
            let mut pushed = NOBODY;
            while !won && top.next < top.count {
                let v = top.candidates[top.next as usize];
                top.next += 1;
                if self.claimant[v as usize] != NOBODY {
                    continue;
                }
                let occupant = self.occupant[v as usize];
                if occupant != NOBODY && self.to[occupant as usize] == here {
                    continue;
                }
                if !self.rings && closes_ring(&self.occupant, &self.to, here, v) {
                    continue;
                }
                self.claimant[v as usize] = top.agent;
                self.to[top.agent as usize] = v;
                if occupant != NOBODY
                    && occupant != top.agent
                    && self.to[occupant as usize] == UNDECIDED
                {
                    pushed = occupant;
                    break;
                }
                won = true;
            }
            if won {
                let pulled = top.pulled;
                let from = self.from.get(pulled as usize).copied().unwrap_or(here);
                if top.next == 1
                    && pulled != NOBODY
                    && self.to[pulled as usize] == UNDECIDED
                    && self.claimant[here as usize] == NOBODY
                    && (self.rings || !closes_ring(&self.occupant, &self.to, from, here))
                {
                    self.claimant[here as usize] = pulled;
                    self.to[pulled as usize] = here;
                }
                self.stack.pop();
                answer = Some(true);
            } else if pushed != NOBODY {
                let frame = self.frame(pushed, wishes, random);
                self.stack.push(frame);
            } else {
                self.claimant[here as usize] = top.agent;
                self.to[top.agent as usize] = here;
                self.stack.pop();
                answer = Some(false);
            }
        }
        answer == Some(true)
    }

    /// The candidates of an agent in its order of preference.
    #[inline]
    fn frame(&mut self, agent: u32, wishes: &mut impl Wishes, random: &mut Random) -> Frame {
        let here = self.from[agent as usize];
        let around = self.graph.around(here);
        let wall = self.graph.wall();
        let code = self.preferences[agent as usize];
        let closer = code & CLOSER;
        let permutation = (random.byte() * PERMUTATIONS) >> 8;
        let mut order = self.orders[closer as usize][permutation];
        let mut candidates = [here; DIRECTIONS + 1];
        let mut count = 0;
        let guided = (code >> DIRECTIONS).wrapping_sub(1);
        if guided < DIRECTIONS as u8 {
            candidates[0] = around[guided as usize];
            count = 1;
        }
        let stay_after = closer.count_ones();
        for k in 0..=DIRECTIONS as u32 {
            if k == stay_after {
                candidates[count] = here;
                count += 1;
            }
            if k == DIRECTIONS as u32 {
                break;
            }
            let d = order & 3;
            order >>= 2;
            let v = around[d as usize];
            if v != wall && d != guided {
                candidates[count] = v;
                count += 1;
            }
        }
        let refused = wishes.rank(self.graph, agent as usize, here, &mut candidates[..count]);
        let mut pulled = NOBODY;
        if self.swap {
            pulled = self.swap_partner(agent, here, candidates[0], wishes);
            if pulled != NOBODY {
                candidates[..count - refused].reverse();
            }
        }
        Frame {
            agent,
            candidates,
            count: count as u8,
            next: 0,
            pulled,
        }
    }
}

/// True if a move from `here` to `v` would be the last of a ring of moves that are
/// decided. Whoever moves into an occupied cell waits for its occupant to decide, so a
/// ring comes about with the last of its moves.
#[inline]
fn closes_ring(occupants: &[u32], to: &[Vertex], here: Vertex, v: Vertex) -> bool {
    let mut at = v;
    while at != here {
        let occupant = occupants[at as usize];
        if occupant == NOBODY {
            return false;
        }
        let next = to[occupant as usize];
        if next == UNDECIDED || next == at {
            return false;
        }
        at = next;
    }
    v != here
}

/// For each mask of closer directions and each permutation: the directions, two bits
/// each from the lowest, closer ones first.
fn direction_orders() -> Box<[[u8; PERMUTATIONS]; 16]> {
    let mut permutations = Vec::with_capacity(PERMUTATIONS);
    for code in 0..256_usize {
        let p = [code & 3, code >> 2 & 3, code >> 4 & 3, code >> 6 & 3];
        let seen = p.iter().fold(0, |seen, d| seen | 1 << d);
        if seen == 0b1111 {
            permutations.push(p);
        }
    }
    let mut orders = Box::new([[0; PERMUTATIONS]; 16]);
    for (mask, row) in orders.iter_mut().enumerate() {
        for (entry, p) in row.iter_mut().zip(&permutations) {
            let closer = p.iter().filter(|&&d| mask >> d & 1 == 1);
            let further = p.iter().filter(|&&d| mask >> d & 1 == 0);
            for (k, d) in closer.chain(further).enumerate() {
                *entry |= (d << (2 * k)) as u8;
            }
        }
    }
    orders
}

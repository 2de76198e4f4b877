//! The swap operation of PIBT: two agents change places at the end of a corridor.
//!
//! K. Okumura, "Improving LaCAM for scalable eventually optimal multi-agent pathfinding", IJCAI
//! 2023, section "PIBT with swap". `swap_required_and_possible` of the paper is
//! [`Pibt::swap_partner`]: the agent *pulls* the one that it changes places with, so it tries its
//! candidates in reverse order and leaves its cell to the other (`Frame::pulled`). Both checks
//! walk along the corridor in which the two stand, without moving anybody:
//!
//! | paper | here |
//! | --- | --- |
//! | *is swap required?* emulate pushing until the corridor ends | [`Corridors::swap_required`] |
//! | *is swap possible?* emulate pulling until degree > 2 | [`Corridors::way_back`] |
//! | neighbours that count in the emulation | [`Corridors::exits`] |
//! | the case of an agent behind, at a cell of degree > 2 | the loop in [`Pibt::swap_partner`] |

use fleetyard_plugin_spacetime::graph::{Graph, Vertex};

use super::{NOBODY, Pibt, UNDECIDED, Wishes};

/// The way on in a corridor.
#[derive(Debug, Clone, Copy)]
enum Exits {
    None,
    One(Vertex),
    Several,
}

/// Wishes of agents, as far as they matter for who gives way.
pub(crate) trait Will {
    /// True if `a` is nearer to where `agent` wants to be than its neighbour `b`.
    fn nearer(&mut self, graph: &Graph, agent: usize, a: Vertex, b: Vertex) -> bool;
    /// True if `agent` at `b` has nothing against changing places with whoever is at `a`.
    #[inline]
    fn willing(&mut self, graph: &Graph, agent: usize, a: Vertex, b: Vertex) -> bool {
        self.nearer(graph, agent, a, b)
    }
    /// True if `v` is where `agent` wants to stay.
    fn rests(&self, agent: usize, v: Vertex) -> bool;
}

/// Corridors, and the agents that stand in them.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Corridors<'a> {
    pub(crate) graph: &'a Graph,
    /// The agent in each vertex.
    pub(crate) occupant: &'a [u32],
}

impl Pibt<'_> {
    /// The agent to change places with, when `agent` at `here` wants to go to `first`.
    pub(super) fn swap_partner(
        &self,
        agent: u32,
        here: Vertex,
        first: Vertex,
        wishes: &mut impl Wishes,
    ) -> u32 {
        if first == here {
            return NOBODY;
        }
        let occupant = self.occupant[first as usize];
        let corridors = Corridors {
            graph: self.graph,
            occupant: &self.occupant,
        };
        if occupant != NOBODY
            && self.to[occupant as usize] == UNDECIDED
            && corridors.swap_required(agent, occupant, here, first, wishes)
            && corridors.way_back(first, here, wishes, |_| {})
        {
            return occupant;
        }
        // Somebody behind may need to pass: make room one step ahead of the need.
        for behind in self.graph.neighbors(here) {
            let other = self.occupant[behind as usize];
            if other != NOBODY
                && behind != first
                && corridors.swap_required(other, agent, here, first, wishes)
                && corridors.way_back(first, here, wishes, |_| {})
            {
                return other;
            }
        }
        NOBODY
    }
}

impl Corridors<'_> {
    /// True if `pusher`, following `puller` along a corridor, would stand in its way
    /// at the end of it.
    pub(crate) fn swap_required(
        &self,
        pusher: u32,
        puller: u32,
        pusher_at: Vertex,
        puller_at: Vertex,
        wishes: &mut impl Will,
    ) -> bool {
        let (pusher, puller) = (pusher as usize, puller as usize);
        let (mut behind, mut ahead) = (pusher_at, puller_at);
        // The end of the corridor first: most lead to a wide place, which takes no table to
        // see. One that leads back here has no end.
        let rests = loop {
            if wishes.rests(pusher, behind) {
                break true;
            }
            match self.exits(ahead, behind, wishes) {
                Exits::Several => return false,
                Exits::None => break false,
                Exits::One(exit) if exit == pusher_at => return false,
                Exits::One(exit) => (behind, ahead) = (ahead, exit),
            }
        };
        let end = behind;
        if !wishes.willing(self.graph, puller, behind, ahead) {
            return false;
        }
        // Now whether the pusher wants to go there.
        (behind, ahead) = (pusher_at, puller_at);
        while !(rests && behind == end) {
            if !wishes.nearer(self.graph, pusher, ahead, behind) {
                return false;
            }
            match self.exits(ahead, behind, wishes) {
                Exits::One(exit) => (behind, ahead) = (ahead, exit),
                _ => break,
            }
        }
        true
    }

    /// True if pulling leads to a place wide enough to change places. Tells the cells on the way there,
    /// which begins with that of the puller and ends with that place.
    pub(crate) fn way_back(
        &self,
        pusher_at: Vertex,
        puller_at: Vertex,
        wishes: &impl Will,
        mut tell: impl FnMut(Vertex),
    ) -> bool {
        let (mut behind, mut ahead) = (pusher_at, puller_at);
        for _ in 0..self.graph.len() {
            if ahead == pusher_at {
                return false;
            }
            tell(ahead);
            match self.exits(ahead, behind, wishes) {
                Exits::Several => return true,
                Exits::None => return false,
                Exits::One(exit) => {
                    behind = ahead;
                    ahead = exit;
                }
            }
        }
        false
    }

    /// Ways on from `v` when coming from `back`. A dead end whose occupant is at its
    /// goal is no way.
    #[inline]
    fn exits(&self, v: Vertex, back: Vertex, wishes: &impl Will) -> Exits {
        if self.graph.is_open(v) {
            return Exits::Several;
        }
        let mut found = Exits::None;
        for u in self.graph.neighbors(v) {
            if u == back {
                continue;
            }
            if self.graph.degree(u) == 1 {
                let occupant = self.occupant[u as usize];
                if occupant != NOBODY && wishes.rests(occupant as usize, u) {
                    continue;
                }
            }
            match found {
                Exits::None => found = Exits::One(u),
                _ => return Exits::Several,
            }
        }
        found
    }
}

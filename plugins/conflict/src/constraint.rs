//! Constraints of the nodes of the constraint tree, each of which some agents have to keep.

use std::hash::{DefaultHasher, Hash, Hasher};

use fleetyard_plugin_spacetime::conflict::FOREVER;
use fleetyard_plugin_spacetime::constraints::Constraints;
use fleetyard_plugin_spacetime::graph::Vertex;

/// A constraint that a child adds to its parent.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum Constraint {
    /// The agent is not in the cell from the first to the last step.
    Cell {
        /// The agent.
        agent: u32,
        /// The cell.
        v: Vertex,
        /// The first step.
        begin: u32,
        /// The last one, [`FOREVER`] where it does not end.
        end: u32,
    },
    /// The agent is in none of these cells at the step given with it: one side of a rectangle.
    Barrier {
        /// The agent.
        agent: u32,
        /// Cells with their steps.
        cells: Box<[(Vertex, u32)]>,
    },
    /// The agent does not begin this move at `time`.
    Move {
        /// The agent.
        agent: u32,
        /// The cell that it leaves.
        from: Vertex,
        /// The cell that it enters.
        to: Vertex,
        /// The step at which the move begins.
        time: u32,
    },
    /// The agent arrives at its goal for good after `time`.
    ArriveAfter {
        /// The agent.
        agent: u32,
        /// The step.
        time: u32,
    },
    /// The agent arrives at its goal for good by `time`, and nobody else is there from step
    /// `others` on.
    ArriveBy {
        /// The agent.
        agent: u32,
        /// Its goal.
        goal: Vertex,
        /// The step by which it arrives.
        time: u32,
        /// The step from which on nobody else is there.
        others: u32,
    },
}

impl Constraint {
    /// Adds what the constraint means for an agent.
    pub(crate) fn apply(&self, to: u32, table: &mut Constraints) {
        match self {
            Self::Cell {
                agent,
                v,
                begin,
                end,
            } if *agent == to => table.forbid(*v, *begin, *end),
            Self::Barrier { agent, cells } if *agent == to => {
                for &(v, time) in cells {
                    table.forbid(v, time, time);
                }
            }
            Self::Move {
                agent,
                from,
                to: into,
                time,
            } if *agent == to => table.forbid_move(*from, *into, *time),
            Self::ArriveAfter { agent, time } if *agent == to => table.arrive_from(*time + 1),
            Self::ArriveBy {
                agent,
                time,
                goal,
                others,
            } => {
                if *agent == to {
                    table.arrive_by(*time);
                } else {
                    table.forbid(*goal, *others, FOREVER);
                }
            }
            _ => {}
        }
    }

    /// The agent that it is about; others may have to keep it as well.
    pub fn agent(&self) -> u32 {
        match self {
            Self::Cell { agent, .. }
            | Self::Barrier { agent, .. }
            | Self::Move { agent, .. }
            | Self::ArriveAfter { agent, .. }
            | Self::ArriveBy { agent, .. } => *agent,
        }
    }

    /// True if an agent has to keep it.
    pub(crate) fn binds(&self, agent: u32) -> bool {
        matches!(self, Self::ArriveBy { .. }) || self.agent() == agent
    }

    /// Two independent hash values, to be added up over a set.
    pub(crate) fn hash(&self) -> u128 {
        let half = |salt: u64| {
            let mut hasher = DefaultHasher::new();
            (salt, self).hash(&mut hasher);
            u128::from(hasher.finish())
        };
        half(1) << 64 | half(2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pairs of agents are searched anew under the constraints that bind them, and no others.
    #[test]
    fn who_is_bound_has_something_to_keep() {
        let kinds = [
            Constraint::Cell {
                agent: 1,
                v: 2,
                begin: 3,
                end: 4,
            },
            Constraint::Barrier {
                agent: 1,
                cells: vec![(2, 3), (3, 4)].into(),
            },
            Constraint::Move {
                agent: 1,
                from: 0,
                to: 1,
                time: 2,
            },
            Constraint::ArriveAfter { agent: 1, time: 3 },
            Constraint::ArriveBy {
                agent: 1,
                time: 3,
                goal: 2,
                others: 5,
            },
        ];
        let none = format!("{:?}", Constraints::new(4));
        for constraint in &kinds {
            assert_eq!(constraint.agent(), 1);
            let of_all = matches!(constraint, Constraint::ArriveBy { .. });
            for agent in 0..3 {
                let mut table = Constraints::new(4);
                constraint.apply(agent, &mut table);
                let is_bound = format!("{table:?}") != none;
                assert_eq!(constraint.binds(agent), is_bound, "{constraint:?} {agent}");
                assert_eq!(is_bound, agent == 1 || of_all);
            }
        }
        // Each of them says something of its own.
        let told = |constraint: &Constraint, agent: u32| {
            let mut table = Constraints::new(4);
            constraint.apply(agent, &mut table);
            let mut forbidden = Vec::new();
            for time in 0..7 {
                for (from, to) in [(0, 1), (2, 2), (3, 3)] {
                    if table.forbids(from, to, time) {
                        forbidden.push((to, time));
                    }
                }
            }
            (forbidden, table.earliest(), table.latest())
        };
        assert_eq!(told(&kinds[0], 1), (vec![(2, 3), (2, 4)], 0, FOREVER));
        assert_eq!(told(&kinds[1], 1), (vec![(2, 3), (3, 4)], 0, FOREVER));
        assert_eq!(told(&kinds[2], 1), (vec![(1, 3)], 0, FOREVER));
        assert_eq!(told(&kinds[3], 1), (vec![], 4, FOREVER));
        assert_eq!(told(&kinds[4], 1), (vec![], 0, 3));
        assert_eq!(told(&kinds[4], 0), (vec![(2, 5), (2, 6)], 0, FOREVER));
        // A set is known by its hash: no two of these are the same.
        let hashes: std::collections::BTreeSet<u128> = kinds.iter().map(Constraint::hash).collect();
        assert_eq!(hashes.len(), kinds.len());
    }
}

//! The answer of the validator: rules, violations, verdict.

use std::fmt;

use fleetyard_core::words;
use serde::{Deserialize, Serialize};

/// A rule that a plan can break.
///
/// The order is the order in which violations of equal time and agents are
/// listed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Rule {
    /// The plan has paths for more or fewer agents than the instance has.
    AgentCount,
    /// An agent has no position at all.
    EmptyPath,
    /// A path does not begin at its agent's start.
    WrongStart,
    /// A path does not end at its agent's goal.
    WrongGoal,
    /// An agent leaves the map.
    OutOfBounds,
    /// An agent enters a blocked cell.
    Obstacle,
    /// An agent's next cell is not one that a move reaches.
    NotAdjacent,
    /// A diagonal move passes a blocked cell at its side.
    CornerCut,
    /// An agent makes a move that the terrain allows and the map's mask does not.
    MoveNotAllowed,
    /// An agent moves another way before it has stayed for the steps that turning takes.
    Turn,
    /// Two agents are in one cell, both on their way.
    VertexConflict,
    /// An agent is in a cell where another one stays for good.
    ParkedConflict,
    /// Two agents exchange cells in one step.
    SwapConflict,
    /// Two diagonal moves cross in one step.
    DiagonalCrossing,
    /// A diagonal move passes a corner while a straight move crosses an edge
    /// that ends there.
    CornerMeet,
    /// An agent enters a cell that another one leaves at a right angle in the same step; where
    /// agents keep strictly apart.
    CornerFollow,
}

words!(Rule {
    AgentCount = "agent-count";
    EmptyPath = "empty-path";
    WrongStart = "wrong-start";
    WrongGoal = "wrong-goal";
    OutOfBounds = "out-of-bounds";
    Obstacle = "obstacle";
    NotAdjacent = "not-adjacent";
    CornerCut = "corner-cut";
    MoveNotAllowed = "move-not-allowed";
    Turn = "turn";
    VertexConflict = "vertex-conflict";
    ParkedConflict = "parked-conflict";
    SwapConflict = "swap-conflict";
    DiagonalCrossing = "diagonal-crossing";
    CornerMeet = "corner-meet";
    CornerFollow = "corner-follow";
});

/// Row and column of a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct CellPosition {
    /// Row, growing down.
    pub row: u32,
    /// Column, growing right.
    pub col: u32,
}

impl fmt::Display for CellPosition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "({}, {})", self.row, self.col)
    }
}

/// One broken rule.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Violation {
    /// The rule.
    pub rule: Rule,
    /// The agents at fault, counted from 0, in increasing order.
    pub agents: Vec<u32>,
    /// The time step; for a move, the time at which it ends.
    pub time: u32,
    /// The cells in question: where the agents are, or for moves of the first
    /// agent and then of the second, from and to. Positions outside the map
    /// have no cell.
    pub cells: Vec<CellPosition>,
    /// All of it as a sentence.
    pub sentence: String,
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.sentence)
    }
}

/// The validator's verdict on a plan.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Verdict {
    /// True if the plan breaks no rule.
    pub valid: bool,
    /// The first violations by time, then agents, as many as were asked for.
    pub violations: Vec<Violation>,
    /// Number of violations in all.
    pub violation_count: u64,
}

/// Keeps the first `limit` violations by time, then agents, then rule.
pub(crate) fn keep_first<V, R: Ord>(
    violations: &mut Vec<V>,
    limit: usize,
    key: impl Fn(&V) -> (f64, &[u32], R),
) {
    violations.sort_by(|one, two| {
        let ((one_s, one_agents, one_rule), (two_s, two_agents, two_rule)) = (key(one), key(two));
        one_s
            .total_cmp(&two_s)
            .then_with(|| one_agents.cmp(two_agents))
            .then(one_rule.cmp(&two_rule))
    });
    violations.truncate(limit);
}

/// A sentence for each count that is given and is another one than the plan's `agents`.
pub(crate) fn other_counts<const N: usize>(
    agents: usize,
    counts: [(&'static str, Option<usize>); N],
) -> impl Iterator<Item = String> {
    counts.into_iter().filter_map(move |(what, count)| {
        let count = count.filter(|count| *count != agents)?;
        Some(format!(
            "the plan has {agents} agents, but there are {count} {what}"
        ))
    })
}

//! Path rules: what lies between two cells of a path that are not neighbours.
//!
//! The classical rules ([`crate::validate`]) know only unit moves. Planners of any-angle
//! paths return a list of cells between whose centres their robot goes in straight
//! lines. Two rules say which cells such a line may not meet. Both are decided in
//! integers, with (r, c) the difference of two cells' rows and columns and
//! n = max(|r|, |c|).
//!
//! # Bresenham
//!
//! The rule of the grid-maze benchmark (Contreras 2026, equations 16 and 17): of every
//! segment the cells of a Bresenham line are free. The line has n + 1 cells; cell k is
//! k·|r|/n rows and k·|c|/n columns from the segment's start, each rounded to the
//! nearest integer, halves *towards the start*. So the two directions of a segment
//! may have different cells, and a path may be valid while its reverse is not. What lies
//! beside the line's cells does not matter: a line may cut corners, and even pass
//! between two blocked cells that touch in a corner.
//!
//! # Supercover
//!
//! Every cell that the segment touches is free, in one point or more: cells are closed
//! squares of side 1 about their centres. Where a segment passes through a corner it
//! touches all four cells there, and both at its sides have to be free, as for a diagonal
//! move on an eight-connected grid. A path of unit moves is valid under this rule exactly
//! if its moves are those of an eight-connected grid; and what is valid under this rule
//! is valid under Bresenham's, in both directions, since every cell of a Bresenham line
//! is touched.
//!
//! # Allowed moves
//!
//! On a map with masks of moves the mask of each cell that a segment leaves has to allow the move
//! to the next cell of its line, under Supercover through a corner the diagonal one. What
//! the terrain forbids anyway is left to the rules above.
//!
//! # Length
//!
//! The benchmark measures the number of cells of all lines, without the first of each:
//! n per segment ([`PlanMetrics::length_cells`](crate::PlanMetrics::length_cells)). It is
//! the same under every rule. A diagonal counts as much as a straight move, so that it is
//! not the length of the way in metres, which stands beside it.
//!
//! # One robot
//!
//! Such paths have no times, so nothing can be said of who meets whom: both rules are for
//! instances of one agent. Judging takes time in proportion to the path's length in cells.

use fleetyard_core::{Grid, GridInstance, GridPlan, move_bit, words};

use crate::{CellPosition, Rule, Verdict, Violation, validate};

/// The rule by which paths are judged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum PathRule {
    /// Unit moves in unit time: the classical rules, for any number of agents.
    #[default]
    Steps,
    /// Straight lines whose Bresenham cells are free.
    Bresenham,
    /// Straight lines that touch free cells alone.
    Supercover,
}

words!(PathRule {
    Steps = "steps", "Unit moves in unit time, for any number of agents";
    Bresenham = "bresenham", "Straight lines whose Bresenham cells are free, for one agent";
    Supercover = "supercover", "Straight lines that touch free cells alone, for one agent";
});

impl PathRule {
    /// True if instances of so many agents can be judged.
    pub fn allows_agents(self, agents: usize) -> bool {
        self == Self::Steps || agents == 1
    }
}

/// Judges a plan by a path rule; at most `limit` violations are described, all are
/// counted.
///
/// Under [`PathRule::Steps`] this is [`validate`]. Under the others the time of a
/// violation is the number of the path's cell at fault, or of the one at which the
/// segment at fault ends; a segment breaks at most one rule, the first on its way.
/// A cell may follow itself. A plan for more than one agent is never valid
/// ([`Rule::AgentCount`]).
pub fn validate_paths(
    instance: &GridInstance,
    plan: &GridPlan,
    rule: PathRule,
    limit: usize,
) -> Verdict {
    if rule == PathRule::Steps {
        return validate(instance, plan, limit);
    }
    let mut findings = Findings {
        limit,
        kept: Vec::new(),
        count: 0,
    };
    if !rule.allows_agents(instance.agents()) {
        findings.add(Rule::AgentCount, 0, &[], || {
            format!(
                "the path rule {rule} is for one agent, the instance has {}",
                instance.agents()
            )
        });
    } else if plan.agents() != 1 {
        findings.add(Rule::AgentCount, 0, &[], || {
            format!(
                "the plan has {} paths, the instance 1 agents",
                plan.agents()
            )
        });
    } else {
        judge(instance, plan.path(0), rule, &mut findings);
    }
    Verdict {
        valid: findings.count == 0,
        violations: findings.kept,
        violation_count: findings.count,
    }
}

struct Findings {
    limit: usize,
    kept: Vec<Violation>,
    count: u64,
}

impl Findings {
    fn add(
        &mut self,
        rule: Rule,
        at: usize,
        cells: &[CellPosition],
        sentence: impl FnOnce() -> String,
    ) {
        self.count += 1;
        if self.kept.len() < self.limit {
            let agents = if rule == Rule::AgentCount {
                vec![]
            } else {
                vec![0]
            };
            self.kept.push(Violation {
                rule,
                agents,
                time: u32::try_from(at).unwrap_or(u32::MAX),
                cells: cells.to_vec(),
                sentence: sentence(),
            });
        }
    }
}

fn judge(instance: &GridInstance, path: &[u32], rule: PathRule, findings: &mut Findings) {
    let grid: &Grid = instance.grid();
    let on_map = |cell: u32| (cell < grid.cell_count()).then(|| position(grid, cell));
    let (Some(&first), Some(&last)) = (path.first(), path.last()) else {
        findings.add(Rule::EmptyPath, 0, &[], || {
            "agent 0 has an empty path".into()
        });
        return;
    };
    let end = |rule, at, cell, wanted, does: &str, what: &str, findings: &mut Findings| {
        if cell == wanted {
            return;
        }
        let (found, wanted) = (on_map(cell), position(grid, wanted));
        let cells: Vec<_> = found.into_iter().chain([wanted]).collect();
        findings.add(rule, at, &cells, || match found {
            Some(found) => format!("agent 0 {does} at {found}, its {what} is {wanted}"),
            None => format!("agent 0 {does} outside the map, its {what} is {wanted}"),
        });
    };
    let (start, goal) = (instance.starts()[0], instance.goals()[0]);
    end(
        Rule::WrongStart,
        0,
        first,
        start,
        "begins",
        "start",
        findings,
    );
    let mut before = None;
    for (at, cell) in path.iter().copied().enumerate() {
        let from = before.replace(cell);
        if from == Some(cell) {
            continue;
        }
        let Some(place) = on_map(cell) else {
            findings.add(Rule::OutOfBounds, at, &[], || {
                format!("cell {at} of the path of agent 0 is outside the map")
            });
            continue;
        };
        if !grid.is_passable(cell) {
            findings.add(Rule::Obstacle, at, &[place], || {
                format!("cell {at} of the path of agent 0, {place}, is an obstacle")
            });
        }
        // Being outside is reported; how one got there or back is not.
        let Some(from) = from.and_then(on_map) else {
            continue;
        };
        let segment = Segment::new(from, place);
        let fault = segment.first_fault(rule, grid);
        if let Some((rule, blocked)) = fault {
            findings.add(rule, at, &[from, place, blocked], || {
                let does = match rule {
                    Rule::CornerCut => "touches the corner of an obstacle at",
                    Rule::MoveNotAllowed => "makes a move that the map does not allow to",
                    _ => "crosses an obstacle at",
                };
                format!("agent 0 {does} {blocked} on its way from {from} to {place}")
            });
        }
    }
    let at = path.len() - 1;
    end(Rule::WrongGoal, at, last, goal, "ends", "goal", findings);
}

fn position(grid: &Grid, cell: u32) -> CellPosition {
    let (row, col) = grid.row_col(cell);
    CellPosition { row, col }
}

/// Cells that a Bresenham line between two cells has besides its first.
pub(crate) fn line_length(from: (u32, u32), to: (u32, u32)) -> u32 {
    from.0.abs_diff(to.0).max(from.1.abs_diff(to.1))
}

/// The straight way between the centres of two cells of a map.
struct Segment {
    from: CellPosition,
    to: CellPosition,
    /// Differences of rows and columns, without sign.
    rows: u32,
    cols: u32,
}

impl Segment {
    fn new(from: CellPosition, to: CellPosition) -> Self {
        Self {
            from,
            to,
            rows: from.row.abs_diff(to.row),
            cols: from.col.abs_diff(to.col),
        }
    }

    /// The cell so many rows and columns from the first, towards the last.
    fn cell(&self, rows: u32, cols: u32) -> CellPosition {
        let go = |from: u32, to: u32, by: u32| if from < to { from + by } else { from - by };
        CellPosition {
            row: go(self.from.row, self.to.row, rows),
            col: go(self.from.col, self.to.col, cols),
        }
    }

    /// The first rule that the segment breaks on its way, and the cell at fault.
    fn first_fault(&self, rule: PathRule, grid: &Grid) -> Option<(Rule, CellPosition)> {
        let cell = |at: CellPosition| at.row * grid.cols() + at.col;
        let is_free = |at: CellPosition| grid.is_passable(cell(at));
        let mut from = self.from;
        let mut fault_on = |to: CellPosition, touches_corners: bool| {
            let from = std::mem::replace(&mut from, to);
            let is_diagonal = from.row != to.row && from.col != to.col;
            if touches_corners && is_diagonal {
                // The cells at both sides of the corner, that in the next row first.
                let sides = [(to.row, from.col), (from.row, to.col)];
                let mut sides = sides
                    .into_iter()
                    .map(|(row, col)| CellPosition { row, col });
                if let Some(side) = sides.find(|side| !is_free(*side)) {
                    return Some((Rule::CornerCut, side));
                }
            }
            if to != self.to && !is_free(to) {
                return Some((Rule::Obstacle, to));
            }
            let bit = move_bit((from.row, from.col), (to.row, to.col))?;
            grid.forbids_move(cell(from), bit)
                .then_some((Rule::MoveNotAllowed, to))
        };
        match rule {
            PathRule::Steps | PathRule::Bresenham => self.line().find_map(|to| fault_on(to, false)),
            PathRule::Supercover => self.touched().find_map(|to| fault_on(to, true)),
        }
    }

    /// The cells of the Bresenham line after the first.
    fn line(&self) -> impl Iterator<Item = CellPosition> {
        let length = u64::from(self.rows.max(self.cols));
        // k·d/n, rounded to the nearest, halves down.
        let part = move |k: u64, d: u32| (2 * k * u64::from(d) + length - 1) / (2 * length);
        (1..=length).map(move |k| self.cell(part(k, self.rows) as u32, part(k, self.cols) as u32))
    }

    /// The cells that the segment enters in turn after the first; through a corner it goes
    /// diagonally.
    fn touched(&self) -> impl Iterator<Item = CellPosition> {
        let (rows, cols) = (u64::from(self.rows), u64::from(self.cols));
        let (mut row, mut col) = (0, 0);
        std::iter::from_fn(move || {
            if (row, col) == (self.rows, self.cols) {
                return None;
            }
            // The segment leaves the cell at the share (2·row + 1) / (2·rows) of its way
            // if over the edge to the next row, at (2·col + 1) / (2·cols) if over that to
            // the next column.
            let over_row = (2 * u64::from(row) + 1) * cols;
            let over_col = (2 * u64::from(col) + 1) * rows;
            row += u32::from(over_row <= over_col);
            col += u32::from(over_col <= over_row);
            Some(self.cell(row, col))
        })
    }
}

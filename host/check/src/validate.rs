//! The validator: one pass over time, linear in the number of cells of all paths.
//!
//! # Four-connected grids
//!
//! The rules are those of classical MAPF (Stern et al. 2019): paths start and
//! end where the instance says, keep to passable cells and unit moves, and no
//! two agents are in one cell at one time or exchange cells in one step. An
//! agent whose path has ended stays in its last cell for good. Following (into
//! a cell that is being left) is allowed, also round a corner: discs of a radius
//! of half a cell would then come as near as √2 radii, which the classical rules
//! do not forbid.
//!
//! [`Separation::Strict`] forbids it: in one step one agent enters a cell that another one leaves
//! at a right angle. With the offset d₀ and the difference w of their moves as below, the offset of
//! two agents is nearest at |d₀ × w| / |w|, and with w of the length 1, √2 or 2 this is between 0
//! and 1 for |d₀ × w| = 1 and |w| = √2 alone, which is that case. So centres stay a whole cell
//! apart, 2r in cells of side 2r.
//!
//! # Eight-connected grids
//!
//! The rules are those that GRACE (section III-D) names: co-occupancy, opposing
//! swaps, diagonal crossings and corner-meets. With cells of side a = 2√2·r they
//! are to keep the centres of discs of radius r at 2r or more while everybody
//! moves in a straight line. Which pairs of moves that forbids follows from
//! geometry, in units of cells, where 2r = 1/√2:
//!
//! Let d₀ be the offset from one agent to the other before the step and w the
//! difference of their moves, both integer vectors. The offset at time t of the
//! step is d₀ + t·w. At t = 0 and t = 1 it is an integer vector, so its length is
//! 0 (co-occupancy) or at least 1. In between, the nearest point is at the
//! distance |d₀ × w| / |w| if the foot of the perpendicular lies inside, and
//! with |w|² ∈ {1, 2, 4, 5, 8} this is below 1/√2 exactly when 2·(d₀ × w)² < |w|²:
//!
//! - **d₀ × w = 0** with the foot inside: the agents meet in a point. They come
//!   from opposite sides (w = −2·d₀), which is a swap, straight (|w|² = 4) or
//!   diagonal (8), or two diagonals of one square of four cells (4), which is a
//!   *diagonal crossing*. Distance 0.
//! - **|d₀ × w| = 1** needs |w|² > 2. For |w|² = 4 and 8 both components of w are
//!   even, and so is the product: impossible. There remains |w|² = 5: a diagonal
//!   and a straight move in opposite directions along one axis. With the foot
//!   inside, the diagonal mover passes a corner of cells while the other one
//!   crosses one of the four edges that end in this corner. This is a
//!   *corner-meet*: distance 1/√5 cells = 2√(2/5)·r ≈ 1.26 r.
//! - **|d₀ × w| ≥ 2** needs |w|² > 8: impossible.
//!
//! So exactly four kinds of pairs are forbidden, as the paper has it. Everything
//! else keeps 2r, with equality for a diagonal move past an agent that waits at
//! its side, for following round a corner, and for opposite parallel diagonals.
//! [`Separation::Strict`] has nothing to add. A test compares every pair of moves with the
//! distance.
//!
//! A diagonal move also needs both cells at its side free, as in the MovingAI
//! benchmarks. A map with masks of moves allows those alone; whether two moves conflict does
//! not depend on masks.
//!
//! # Windows and turning
//!
//! [`Terms`] may ask for less than an instance: that agents arrive nowhere, and that
//! they do not collide during a number of steps only. They may ask for more, that
//! robots have the time to turn: whoever goes another way than it looks has to stay
//! for a step per 90 degrees before, and looks that way then. Steps in which it stays
//! count from its last move on, whatever they were meant for.
//!
//! # What is counted
//!
//! Outside and obstacle violations count once when entering, conflicts once per
//! time step. In a cell with several agents each is reported against the lowest
//! numbered one, and of several agents that make the same move (who are in a
//! vertex conflict anyway) only the lowest numbered one is checked against moves
//! of others: so the number of violations is linear, and a plan without vertex
//! conflicts has every violating pair reported. Moves that are not unit moves
//! take no part in swaps, crossings and corner-meets.

use fleetyard_core::{Connectivity, Grid, GridInstance, GridPlan, Heading, Separation, move_bit};

use crate::{CellPosition, Rule, Verdict, Violation};

const NONE: u32 = u32::MAX;

/// The terms that a plan has to keep.
#[derive(Debug, Clone, Copy)]
pub struct Terms<'a> {
    /// The map.
    pub grid: &'a Grid,
    /// The moves that are allowed.
    pub connectivity: Connectivity,
    /// The cell in which each agent begins.
    pub starts: &'a [u32],
    /// The cell in which each agent has to end, if that matters.
    pub goals: Option<&'a [u32]>,
    /// The first heading of each agent, if turning takes steps.
    pub headings: Option<&'a [Heading]>,
    /// Number of steps that have to be free of collisions; 0 for all.
    pub window_steps: u32,
    /// The distance that agents keep.
    pub separation: Separation,
}

impl<'a> From<&'a GridInstance> for Terms<'a> {
    fn from(instance: &'a GridInstance) -> Self {
        Self {
            grid: instance.grid(),
            connectivity: instance.connectivity(),
            starts: instance.starts(),
            goals: Some(instance.goals()),
            headings: None,
            window_steps: 0,
            separation: Separation::Rules,
        }
    }
}

/// Judges a plan; at most `limit` violations are described, all are counted.
///
/// Paths may have waits at their end: they mean the same plan without them.
pub fn validate(instance: &GridInstance, plan: &GridPlan, limit: usize) -> Verdict {
    validate_terms(&instance.into(), plan, limit)
}

/// Judges a plan as [`validate`] does, by terms of which some may be looser or tighter
/// than those of an instance.
pub fn validate_terms(terms: &Terms<'_>, plan: &GridPlan, limit: usize) -> Verdict {
    let mut sweep = Sweep::new(*terms, plan, limit);
    sweep.run();
    let valid = sweep.count == 0;
    let violations = sweep.kept.iter().map(|found| sweep.describe(found));
    Verdict {
        valid,
        violations: violations.collect(),
        violation_count: sweep.count,
    }
}

/// A violation before it gets its sentence. Agents are in increasing order, and
/// `NONE` where there are fewer.
#[derive(Debug, Clone, Copy)]
struct Found {
    time: u32,
    first: u32,
    second: u32,
    rule: Rule,
}

/// The agents in a cell during one time step. One struct per cell, so that a look-up costs one
/// cache line.
#[derive(Clone, Copy)]
struct CellState {
    /// Index into `Sweep::moves_from` if an agent moves away in this step.
    leaving: u32,
    /// Lowest numbered agent on its way that is here after this step.
    arrived: u32,
    /// First agent whose path ended here.
    parked: u32,
}

/// An agent on its way.
#[derive(Clone, Copy)]
struct Active {
    agent: u32,
    /// Last time of the trimmed path.
    end: u32,
    /// Index of the path's first cell in the plan.
    offset: usize,
    /// Position before this step; `row` is `NONE` when outside.
    row: u32,
    col: u32,
    /// Move of this step as in [`direction`]; `STAY` if there is none to check.
    direction: u8,
    from: u32,
    to: u32,
    /// The agent's heading, if that matters, and the step of its last move.
    heading: Option<Heading>,
    moved: u32,
}

/// Moves are numbered by row and column step, so that the opposite of `d` is
/// `8 - d`.
fn direction(row_step: i64, col_step: i64) -> Option<u8> {
    let unit = -1..=1;
    (unit.contains(&row_step) && unit.contains(&col_step))
        .then(|| ((row_step + 1) * 3 + col_step + 1) as u8)
}
const STAY: u8 = 4;

/// Row and column step of a direction.
fn step_of(direction: u8) -> (i64, i64) {
    let direction = i64::from(direction);
    (direction / 3 - 1, direction % 3 - 1)
}

fn is_diagonal(direction: u8) -> bool {
    matches!(direction, 0 | 2 | 6 | 8)
}

struct Sweep<'a> {
    terms: Terms<'a>,
    grid: &'a Grid,
    plan: &'a GridPlan,
    cells: Vec<CellState>,
    /// Per cell that somebody leaves in this step: the lowest numbered agent
    /// in each direction.
    moves_from: Vec<[u32; 9]>,
    active: Vec<Active>,
    time: u32,
    /// Violations of this time step.
    step: Vec<Found>,
    kept: Vec<Found>,
    limit: usize,
    count: u64,
}

impl<'a> Sweep<'a> {
    fn new(terms: Terms<'a>, plan: &'a GridPlan, limit: usize) -> Self {
        let grid = terms.grid;
        let nobody = CellState {
            leaving: NONE,
            arrived: NONE,
            parked: NONE,
        };
        Self {
            terms,
            grid,
            plan,
            cells: vec![nobody; grid.cell_count() as usize],
            moves_from: Vec::new(),
            active: Vec::with_capacity(plan.agents()),
            time: 0,
            step: Vec::new(),
            kept: Vec::new(),
            limit,
            count: 0,
        }
    }

    fn run(&mut self) {
        if self.plan.agents() != self.terms.starts.len() {
            self.report(Rule::AgentCount, NONE, NONE);
            // Before all others, which it may well explain.
            self.flush();
        }
        for agent in 0..self.plan.agents() {
            self.enter_map(agent);
        }
        self.occupy();
        self.retire();
        self.flush();
        while !self.active.is_empty() {
            self.time += 1;
            self.advance();
            if self.is_in_window() {
                self.check_pairs();
                self.occupy();
            }
            self.retire();
            self.flush();
        }
    }

    /// True if collisions matter now.
    fn is_in_window(&self) -> bool {
        self.terms.window_steps == 0 || self.time <= self.terms.window_steps
    }

    fn report(&mut self, rule: Rule, a: u32, b: u32) {
        self.count += 1;
        // Times only grow, so what does not fit now never will.
        if self.kept.len() < self.limit {
            self.step.push(Found {
                time: self.time,
                first: a.min(b),
                second: a.max(b),
                rule,
            });
        }
    }

    fn flush(&mut self) {
        // By agents, and one agent before the pairs that it is the first of.
        self.step
            .sort_unstable_by_key(|found| (found.first, found.second.wrapping_add(1), found.rule));
        let room = self.limit - self.kept.len();
        self.kept.extend(self.step.drain(..).take(room));
    }

    /// Position on the map, or `NONE` twice.
    fn position(&self, cell: u32) -> (u32, u32) {
        if cell < self.grid.cell_count() {
            self.grid.row_col(cell)
        } else {
            (NONE, NONE)
        }
    }

    /// Time 0 of one agent.
    fn enter_map(&mut self, agent: usize) {
        let path = self.plan.path(agent);
        let name = agent as u32;
        let Some((&first, &last)) = path.first().zip(path.last()) else {
            self.report(Rule::EmptyPath, name, NONE);
            return;
        };
        let end = path
            .iter()
            .rposition(|cell| *cell != last)
            .map_or(0, |at| at + 1);
        let start = self.terms.starts.get(agent);
        if start.is_some_and(|start| *start != first) {
            self.report(Rule::WrongStart, name, NONE);
        }
        self.check_cell(name, first);
        let (row, col) = self.position(first);
        self.active.push(Active {
            agent: name,
            end: u32::try_from(end).unwrap_or(u32::MAX),
            offset: self.plan.lists().range(agent).start,
            row,
            col,
            direction: STAY,
            from: first,
            to: first,
            heading: self
                .terms
                .headings
                .and_then(|headings| headings.get(agent).copied()),
            moved: 0,
        });
    }

    fn check_cell(&mut self, agent: u32, cell: u32) {
        if cell >= self.grid.cell_count() {
            self.report(Rule::OutOfBounds, agent, NONE);
        } else if !self.grid.is_passable(cell) {
            self.report(Rule::Obstacle, agent, NONE);
        }
    }

    /// Moves everybody by one step and checks each move by itself.
    fn advance(&mut self) {
        self.moves_from.clear();
        for at in 0..self.active.len() {
            let mut mover = self.active[at];
            mover.from = mover.to;
            mover.to = self.plan.cells()[mover.offset + self.time as usize];
            mover.direction = STAY;
            if mover.to != mover.from {
                self.step_of_one(&mut mover);
            }
            self.active[at] = mover;
        }
    }

    fn step_of_one(&mut self, mover: &mut Active) {
        self.check_cell(mover.agent, mover.to);
        let before = (mover.row, mover.col);
        let after = self.position(mover.to);
        (mover.row, mover.col) = after;
        // Being outside is reported; how one got there or back is not.
        if before.0 == NONE || after.0 == NONE {
            return;
        }
        let row_step = i64::from(after.0) - i64::from(before.0);
        let col_step = i64::from(after.1) - i64::from(before.1);
        let eight = self.terms.connectivity == Connectivity::Eight;
        let Some(direction) =
            direction(row_step, col_step).filter(|direction| eight || !is_diagonal(*direction))
        else {
            self.report(Rule::NotAdjacent, mover.agent, NONE);
            return;
        };
        mover.direction = direction;
        if is_diagonal(direction) {
            let (one, other) = self.sides(mover);
            if !(self.grid.is_passable(one) && self.grid.is_passable(other)) {
                self.report(Rule::CornerCut, mover.agent, NONE);
            }
        }
        let is_forbidden = |bit| self.grid.forbids_move(mover.from, bit);
        if self.grid.has_move_masks() && move_bit(before, after).is_some_and(is_forbidden) {
            self.report(Rule::MoveNotAllowed, mover.agent, NONE);
        }
        if let Some(heading) = &mut mover.heading {
            let before = std::mem::replace(heading, self.towards(mover.from, mover.to));
            let stayed = self.time - 1 - std::mem::replace(&mut mover.moved, self.time);
            if stayed < before.quarters_to(*heading) {
                self.report(Rule::Turn, mover.agent, NONE);
            }
        }
        if !self.is_in_window() {
            return;
        }
        let cell = &mut self.cells[mover.from as usize];
        if cell.leaving == NONE {
            cell.leaving = self.moves_from.len() as u32;
            self.moves_from.push([NONE; 9]);
        }
        let owner = &mut self.moves_from[cell.leaving as usize][usize::from(direction)];
        // Agents come in increasing order.
        if *owner == NONE {
            *owner = mover.agent;
        }
    }

    fn towards(&self, from: u32, to: u32) -> Heading {
        Heading::of_move(from, to, self.grid.cols())
    }

    /// The cells at the sides of a diagonal move: in its target's row, and in
    /// its target's column.
    fn sides(&self, mover: &Active) -> (u32, u32) {
        let cols = i64::from(self.grid.cols());
        let (row_step, col_step) = step_of(mover.direction);
        let from = i64::from(mover.from);
        ((from + row_step * cols) as u32, (from + col_step) as u32)
    }

    /// The lowest numbered agent that moves from `cell` in `direction` now.
    fn mover_from(&self, cell: u32, direction: u8) -> u32 {
        match self.cells[cell as usize].leaving {
            NONE => NONE,
            slot => self.moves_from[slot as usize][usize::from(direction)],
        }
    }

    /// Checks moves of this step against each other.
    fn check_pairs(&mut self) {
        let corners = self.terms.separation == Separation::Strict
            && self.terms.connectivity == Connectivity::Four;
        for at in 0..self.active.len() {
            let mover = self.active[at];
            let (agent, direction) = (mover.agent, mover.direction);
            if direction == STAY || self.mover_from(mover.from, direction) != agent {
                continue;
            }
            let opposite = self.mover_from(mover.to, 8 - direction);
            // Both see each other; the lower numbered one reports.
            if opposite != NONE && agent < opposite {
                self.report(Rule::SwapConflict, agent, opposite);
            }
            if is_diagonal(direction) {
                self.check_diagonal(&mover);
            }
            if corners {
                self.check_corner(&mover);
            }
        }
        for mover in &self.active {
            if mover.direction != STAY {
                self.cells[mover.from as usize].leaving = NONE;
            }
        }
    }

    /// Agents that leave the cell that this one enters, to a side of its way.
    fn check_corner(&mut self, mover: &Active) {
        let (row_step, col_step) = step_of(mover.direction);
        // The steps of a straight move are units, and so are those at a right angle to it.
        let left = direction(-col_step, row_step).unwrap_or(STAY);
        for side in [left, 8 - left] {
            let leader = self.mover_from(mover.to, side);
            if leader != NONE {
                self.report(Rule::CornerFollow, leader, mover.agent);
            }
        }
    }

    /// Crossings and corner-meets with a diagonal move; see the module's head.
    fn check_diagonal(&mut self, mover: &Active) {
        let (row_side, col_side) = self.sides(mover);
        let (row_step, col_step) = step_of(mover.direction);
        let to_direction = |row_step: i64, col_step: i64| {
            // The steps of a diagonal move are units.
            direction(row_step, col_step).unwrap_or(STAY)
        };
        let across = to_direction(-row_step, col_step);
        for other in [
            self.mover_from(row_side, across),
            self.mover_from(col_side, 8 - across),
        ] {
            if other != NONE && mover.agent < other {
                self.report(Rule::DiagonalCrossing, mover.agent, other);
            }
        }
        // Straight moves over the four edges at the corner that this move
        // passes, but for those that begin where it begins or end where it
        // ends, which are vertex conflicts.
        let back_by_row = to_direction(-row_step, 0);
        let back_by_col = to_direction(0, -col_step);
        for other in [
            self.mover_from(mover.to, back_by_row),
            self.mover_from(mover.to, back_by_col),
            self.mover_from(row_side, back_by_row),
            self.mover_from(col_side, back_by_col),
        ] {
            if other != NONE {
                self.report(Rule::CornerMeet, mover.agent, other);
            }
        }
    }

    /// Vertex conflicts and parked conflicts after this step.
    fn occupy(&mut self) {
        for at in 0..self.active.len() {
            let Active { agent, to, .. } = self.active[at];
            let Some(cell) = self.cells.get_mut(to as usize) else {
                continue;
            };
            let (parked, first) = (cell.parked, cell.arrived);
            if first == NONE {
                cell.arrived = agent;
            } else {
                self.report(Rule::VertexConflict, first, agent);
            }
            if parked != NONE {
                self.report(Rule::ParkedConflict, parked, agent);
            }
        }
        for mover in &self.active {
            if let Some(cell) = self.cells.get_mut(mover.to as usize) {
                cell.arrived = NONE;
            }
        }
    }

    /// Parks the agents whose paths end now.
    fn retire(&mut self) {
        let time = self.time;
        for at in 0..self.active.len() {
            let Active { agent, end, to, .. } = self.active[at];
            if end > time {
                continue;
            }
            let goal = self.terms.goals.and_then(|goals| goals.get(agent as usize));
            if goal.is_some_and(|goal| *goal != to) {
                self.report(Rule::WrongGoal, agent, NONE);
            }
            if let Some(cell) = self.cells.get_mut(to as usize)
                && cell.parked == NONE
            {
                cell.parked = agent;
            }
        }
        self.active.retain(|mover| mover.end > time);
    }

    fn describe(&self, found: &Found) -> Violation {
        let Found {
            time,
            first,
            second,
            rule,
        } = *found;
        let pair = [first, second];
        let agents: Vec<u32> = pair.into_iter().filter(|agent| *agent != NONE).collect();
        let at = |agent: u32, time: u32| self.at(agent, time);
        let before = time.saturating_sub(1);
        // Positions of the agents, and of their moves.
        let stand = |agent: u32| vec![at(agent, time)];
        let moves = |agent: u32| vec![at(agent, before), at(agent, time)];
        let (first_move, second_move) = match second {
            NONE => (String::new(), String::new()),
            _ => (
                format!(
                    "agent {first} from {} to {}",
                    at(first, before),
                    at(first, time)
                ),
                format!(
                    "agent {second} from {} to {}",
                    at(second, before),
                    at(second, time)
                ),
            ),
        };
        let (places, sentence) = match rule {
            Rule::AgentCount => {
                let (paths, agents) = (self.plan.agents(), self.terms.starts.len());
                let sentence = format!("the plan has {paths} paths, the instance {agents} agents");
                (vec![], sentence)
            }
            Rule::EmptyPath => (vec![], format!("agent {first} has an empty path")),
            Rule::WrongStart => {
                let start = self.place(self.terms.starts[first as usize]);
                let found = at(first, 0);
                let sentence = format!("agent {first} begins at {found}, its start is {start}");
                (vec![found, start], sentence)
            }
            Rule::WrongGoal => {
                let goals = self.terms.goals.unwrap_or_default();
                let goal = self.place(goals[first as usize]);
                let found = at(first, time);
                let sentence =
                    format!("agent {first} ends at {found} at time {time}, its goal is {goal}");
                (vec![found, goal], sentence)
            }
            Rule::OutOfBounds => (
                vec![],
                format!("agent {first} is outside the map at time {time}"),
            ),
            Rule::Obstacle => {
                let place = at(first, time);
                let sentence = format!("agent {first} is on an obstacle at {place} at time {time}");
                (stand(first), sentence)
            }
            Rule::NotAdjacent => {
                let (from, to) = (at(first, before), at(first, time));
                let sentence = format!(
                    "agent {first} jumps from {from} to {to} between times {before} and {time}"
                );
                (moves(first), sentence)
            }
            Rule::CornerCut => {
                let (from, to) = (at(first, before), at(first, time));
                let sentence = format!(
                    "agent {first} cuts an obstacle's corner from {from} to {to} \
                     between times {before} and {time}"
                );
                (moves(first), sentence)
            }
            Rule::MoveNotAllowed => {
                let (from, to) = (at(first, before), at(first, time));
                let sentence = format!(
                    "agent {first} moves from {from} to {to} between times {before} and {time}, \
                     which the map does not allow"
                );
                (moves(first), sentence)
            }
            Rule::Turn => {
                let (from, to) = (at(first, before), at(first, time));
                let (heading, needed, stayed) = self.turn(first, time);
                let looks = heading.map_or("", Heading::as_str);
                let steps = if needed == 1 { "step" } else { "steps" };
                let sentence = format!(
                    "agent {first} looks {looks} and moves from {from} to {to} between times \
                     {before} and {time}: it needs {needed} {steps} to turn and had {stayed}"
                );
                (moves(first), sentence)
            }
            Rule::VertexConflict => {
                let place = at(first, time);
                let sentence =
                    format!("agents {first} and {second} are both at {place} at time {time}");
                (stand(first), sentence)
            }
            Rule::ParkedConflict => {
                // The one whose path ended earlier is the one that stays.
                let (parked, passer) = if self.end(first) < self.end(second) {
                    (first, second)
                } else {
                    (second, first)
                };
                let place = at(passer, time);
                let since = self.end(parked);
                let sentence = format!(
                    "agent {passer} is at {place} at time {time}, \
                     where agent {parked} stays from time {since}"
                );
                (stand(passer), sentence)
            }
            Rule::SwapConflict => {
                let (from, to) = (at(first, before), at(first, time));
                let sentence = format!(
                    "agents {first} and {second} exchange {from} and {to} \
                     between times {before} and {time}"
                );
                (moves(first), sentence)
            }
            Rule::CornerFollow => {
                let leads = self.plan.at(first as usize, before as usize)
                    == self.plan.at(second as usize, time as usize);
                let (leader, follower) = if leads {
                    (first, second)
                } else {
                    (second, first)
                };
                let corner = at(leader, before);
                let sentence = format!(
                    "agent {follower} follows agent {leader} round a corner at {corner} \
                     between times {before} and {time}: {first_move}, {second_move}"
                );
                ([moves(first), moves(second)].concat(), sentence)
            }
            Rule::DiagonalCrossing | Rule::CornerMeet => {
                let what = match rule {
                    Rule::CornerMeet => "meet at a corner",
                    _ => "cross diagonally",
                };
                let sentence = format!(
                    "agents {first} and {second} {what} between times {before} and {time}: \
                     {first_move}, {second_move}"
                );
                ([moves(first), moves(second)].concat(), sentence)
            }
        };
        let cells = places.into_iter().filter_map(Place::cell).collect();
        Violation {
            rule,
            agents,
            time,
            cells,
            sentence,
        }
    }

    fn at(&self, agent: u32, time: u32) -> Place {
        self.place(self.plan.at(agent as usize, time as usize))
    }

    fn place(&self, cell: u32) -> Place {
        Place((cell < self.grid.cell_count()).then(|| self.grid.row_col(cell)))
    }

    /// The heading of an agent before its move at a time, the quarter turns that it needs for that
    /// move, and the number of steps for which it has stayed.
    fn turn(&self, agent: u32, time: u32) -> (Option<Heading>, u32, u32) {
        let path = self.plan.path(agent as usize);
        let time = time as usize;
        let is_move = |at: usize| {
            let (from, to) = (self.place(path[at - 1]), self.place(path[at]));
            let steps = |(a, b): ((u32, u32), (u32, u32))| a.0.abs_diff(b.0) + a.1.abs_diff(b.1);
            from.0.zip(to.0).is_some_and(|ends| steps(ends) == 1)
        };
        let moved = (1..time).rev().find(|at| is_move(*at));
        let heading = match moved {
            Some(at) => Some(self.towards(path[at - 1], path[at])),
            None => self.terms.headings.map(|headings| headings[agent as usize]),
        };
        let towards = self.towards(path[time - 1], path[time]);
        let needed = heading.map_or(0, |heading| heading.quarters_to(towards));
        (heading, needed, (time - 1 - moved.unwrap_or(0)) as u32)
    }

    /// Last time of an agent's trimmed path.
    fn end(&self, agent: u32) -> usize {
        let path = self.plan.path(agent as usize);
        let moved = path.iter().rposition(|cell| Some(cell) != path.last());
        moved.map_or(0, |at| at + 1)
    }
}

/// A position for sentences: a cell, or outside the map.
#[derive(Clone, Copy)]
struct Place(Option<(u32, u32)>);

impl Place {
    fn cell(self) -> Option<CellPosition> {
        self.0.map(|(row, col)| CellPosition { row, col })
    }
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.cell() {
            Some(cell) => cell.fmt(f),
            None => f.write_str("outside the map"),
        }
    }
}

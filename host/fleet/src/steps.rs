//! Synchronous execution: all robots do one step of the plan at a time, just as it says.
//!
//! These are the rules of standard MAPF, and of the League of Robot Runners: a step moves a
//! robot to an adjacent cell, turns it by 90°, or leaves it where it is. A cell may be entered
//! in the step in which it is left, and robots may go round in rings; plans are judged before
//! ([`judge_first`](crate::batch::judge_first)), so that no two robots are in one cell or change
//! places. Nobody is ever late, so that there is no order of passing to keep.

use std::f64::consts::FRAC_PI_2;

use fleetyard_abi::Heading;
use fleetyard_core::moves;
use fleetyard_sim::{Live, Order};

use crate::adg::Cut;
use crate::batch::Batch;

/// A robot's part of a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Act {
    /// It stays as it is.
    Wait,
    /// It moves to an adjacent cell.
    Move(u32),
    /// It turns by 90° to the left.
    Left,
    /// It turns by 90° to the right.
    Right,
}

/// The part of a step of a robot that looks somewhere, from the cell of its path at a step on.
///
/// A path has cells and no turns. Where turns take steps, a robot that stays turns towards the next
/// move of its path as soon as it can, to the right if that is behind it; what is behind the part
/// of the path that was judged (`judged` cells) counts for this, too.
pub fn act(path: &[u32], judged: usize, at: usize, looks: Option<Heading>, cols: u32) -> Act {
    let (Some(here), Some(next)) = (path.get(at), path[..judged].get(at + 1)) else {
        return Act::Wait;
    };
    if here != next {
        return Act::Move(*next);
    }
    let mut ahead = path[at..].windows(2);
    let (Some(looks), Some(step)) = (looks, ahead.find(|step| step[0] != step[1])) else {
        return Act::Wait;
    };
    let towards = Heading::of_move(step[0], step[1], cols);
    // Headings are numbered clockwise.
    match (towards.code() - looks.code()).rem_euclid(4) {
        0 => Act::Wait,
        3 => Act::Left,
        _ => Act::Right,
    }
}

/// A robot between two steps.
#[derive(Debug, Clone, Copy)]
struct Robot {
    cell: u32,
    heading: Heading,
    /// The heading in quarter turns to the left from the east, past a whole turn, too.
    quarters: i32,
    next_goal: u32,
    /// True if the last step took it to another cell.
    moved: bool,
}

/// The robots, and the plan that they follow.
#[derive(Debug)]
pub(crate) struct Steps {
    cols: u32,
    robots: Vec<Robot>,
    /// True if turns take steps.
    turning: bool,
    /// True if cuts tell what they drop.
    tells_rest: bool,
    batch: Option<Batch>,
    /// Steps of it that were done.
    at: usize,
    /// True if a step was done whose goals were not looked for.
    is_news: bool,
}

impl Steps {
    /// Robots in cells.
    pub(crate) fn new(cols: u32, starts: &[u32], heading: Heading, turning: bool) -> Self {
        let robot = |cell: &u32| Robot {
            cell: *cell,
            heading,
            quarters: -heading.code(),
            next_goal: 0,
            moved: false,
        };
        Self {
            cols,
            robots: starts.iter().map(robot).collect(),
            turning,
            tells_rest: false,
            batch: None,
            at: 0,
            is_news: false,
        }
    }

    /// Lets cuts tell what they drop.
    pub(crate) fn tell_rest(&mut self) {
        self.tells_rest = true;
    }

    /// Number of robots.
    pub(crate) fn agents(&self) -> usize {
        self.robots.len()
    }

    /// Follows a plan that begins where robots are.
    pub(crate) fn follow(&mut self, batch: Batch) {
        debug_assert!(
            (0..self.agents())
                .all(|agent| { batch.path(agent).first() == Some(&self.robots[agent].cell) })
        );
        (self.batch, self.at) = (Some(batch), 0);
    }

    /// The rest of a robot's path as far as it was judged, its cell first.
    fn rest(&self, agent: usize) -> &[u32] {
        let path = self
            .batch
            .as_ref()
            .map_or(&[][..], |batch| batch.path(agent));
        &path[self.at.min(path.len())..]
    }

    /// Steps of the plan that a robot has not done.
    pub(crate) fn steps_left(&self, agent: usize) -> u32 {
        self.rest(agent).len().saturating_sub(1) as u32
    }

    /// Number of robots whose paths go on.
    pub(crate) fn pending(&self) -> usize {
        let agents = 0..self.agents();
        agents.filter(|agent| self.steps_left(*agent) > 0).count()
    }

    /// Drops the rest of the plan, and says where robots are.
    pub(crate) fn cut(&mut self) -> Cut {
        let rest = |agent| moves::encode(self.rest(agent), self.cols).unwrap_or_default();
        let rest = if self.tells_rest {
            (0..self.agents()).map(rest).collect()
        } else {
            Vec::new()
        };
        let dropped = self.pending();
        self.batch = None;
        let robots = &self.robots;
        Cut {
            cells: robots.iter().map(|robot| robot.cell).collect(),
            headings: robots.iter().map(|robot| robot.heading).collect(),
            next_goal: robots.iter().map(|robot| robot.next_goal).collect(),
            dropped,
            rest,
        }
    }

    /// Sends every robot its part of the next step.
    pub(crate) fn send(&mut self, live: &mut Live<'_>) {
        for (agent, robot) in self.robots.iter_mut().enumerate() {
            let act = self.batch.as_ref().map_or(Act::Wait, |batch| {
                let looks = batch.turning().then_some(robot.heading);
                let judged = batch.path(agent).len();
                act(batch.plan().path(agent), judged, self.at, looks, self.cols)
            });
            robot.moved = false;
            match act {
                Act::Wait => continue,
                Act::Move(cell) => {
                    robot.heading = Heading::of_move(robot.cell, cell, self.cols);
                    (robot.cell, robot.moved) = (cell, true);
                }
                Act::Left => robot.turn(1),
                Act::Right => robot.turn(-1),
            }
            let heading_rad = FRAC_PI_2 * f64::from(robot.quarters);
            live.send(
                agent,
                Order {
                    heading_rad: self.turning.then_some(heading_rad),
                    ..Order::to(robot.cell)
                },
            );
        }
        self.at += 1;
        self.is_news = true;
    }

    /// A step is over: tells of every robot with its cell, its next goal, and if it came there in
    /// this step. The goal is reached if `tell` says so; it is one a step at most, as in the League.
    pub(crate) fn learn(&mut self, tell: &mut dyn FnMut(usize, u32, u32, bool) -> bool) {
        if !std::mem::take(&mut self.is_news) {
            return;
        }
        for (agent, robot) in self.robots.iter_mut().enumerate() {
            let reached = tell(agent, robot.cell, robot.next_goal, robot.moved);
            robot.next_goal += u32::from(reached);
        }
    }
}

impl Robot {
    fn turn(&mut self, left: i32) {
        self.quarters += left;
        self.heading = match (-self.quarters).rem_euclid(4) {
            0 => Heading::East,
            1 => Heading::South,
            2 => Heading::West,
            _ => Heading::North,
        };
    }
}

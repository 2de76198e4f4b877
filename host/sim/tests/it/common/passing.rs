//! A server that keeps the order of passing, for tests and benches of live executions.

use std::collections::VecDeque;

use fleetyard_core::{Connectivity, Grid};
use fleetyard_sim::{Live, Order};
use rand_chacha::ChaCha8Rng;

use super::below;

/// The order in which robots pass each cell.
///
/// Moves are planned one after the other, each into a cell where nobody is when all
/// earlier ones are done: so some order of passing exists. A move may be sent when
/// everybody who is to be in its cell before has left it.
pub(crate) struct Passing {
    /// Per cell, robots and the numbers of the orders that bring them there.
    visits: Vec<VecDeque<(u32, u32)>>,
    /// The robot that is in each cell when everything that is planned is done.
    occupant: Vec<u32>,
    robots: Vec<Robot>,
    /// Robots that may have something to send.
    ready: Vec<u32>,
    /// True if a cell is free when its robot has left it; otherwise it is free when the robot has
    /// done the order that leaves it.
    early: bool,
}

struct Robot {
    /// The orders that are not known to be done, and the number of the first.
    first: u32,
    orders: VecDeque<Order>,
    /// The last order of which it is known that its robot has left the cell before.
    left: u32,
    /// The cell of the last order that is known to be done, and of the last one of all.
    at: u32,
    end: u32,
    /// The last order that was sent.
    sent: u32,
    /// Difference of the cell's number and that of the cell before the last move.
    way: i64,
}

const FREE: u32 = u32::MAX;

impl Passing {
    pub(crate) fn new(grid: &Grid, starts: &[u32], early: bool) -> Self {
        let mut visits = vec![VecDeque::new(); grid.cell_count() as usize];
        let mut occupant = vec![FREE; visits.len()];
        for (robot, cell) in starts.iter().enumerate() {
            visits[*cell as usize].push_back((robot as u32, 0));
            occupant[*cell as usize] = robot as u32;
        }
        let robot = |cell: &u32| Robot {
            first: 1,
            orders: VecDeque::new(),
            left: 0,
            at: *cell,
            end: *cell,
            sent: 0,
            way: 0,
        };
        Self {
            visits,
            occupant,
            robots: starts.iter().map(robot).collect(),
            ready: Vec::new(),
            early,
        }
    }

    /// Plans an order of a robot, into a cell where nobody is in the end.
    pub(crate) fn plan(&mut self, robot: usize, order: Order) {
        let of = &mut self.robots[robot];
        let number = of.first + of.orders.len() as u32;
        if order.cell != of.end {
            let (from, to) = (of.end as usize, order.cell as usize);
            assert_eq!(self.occupant[to], FREE, "somebody is there");
            self.occupant[from] = FREE;
            self.occupant[to] = robot as u32;
            self.visits[to].push_back((robot as u32, number));
            of.way = i64::from(order.cell) - i64::from(of.end);
            of.end = order.cell;
        }
        of.orders.push_back(order);
        self.ready.push(robot as u32);
    }

    /// Plans so many orders ahead for everybody, mostly straight on.
    pub(crate) fn wander(&mut self, rng: &mut ChaCha8Rng, grid: &Grid, ahead: usize, dwell_s: f64) {
        let mut free: Vec<u32> = Vec::new();
        for robot in 0..self.robots.len() {
            while self.robots[robot].orders.len() < ahead {
                let Robot { end, way, .. } = self.robots[robot];
                free.clear();
                free.extend(
                    grid.neighbors(end, Connectivity::Four)
                        .filter(|to| self.occupant[*to as usize] == FREE),
                );
                let on = |to: &u32| i64::from(*to) - i64::from(end) == way;
                let cell = match free.iter().copied().find(on) {
                    Some(on) if below(rng, 20) > 0 => on,
                    _ if free.is_empty() => break,
                    _ => free[below(rng, free.len())],
                };
                let stays = dwell_s > 0.0 && below(rng, 10) == 0;
                let dwell_s = if stays { dwell_s } else { 0.0 };
                self.plan(
                    robot,
                    Order {
                        dwell_s,
                        ..Order::to(cell)
                    },
                );
            }
        }
    }

    /// Takes note of what is done, and sends what may be sent.
    pub(crate) fn serve(&mut self, live: &mut Live<'_>) {
        for robot in live.news() {
            let of = &mut self.robots[*robot as usize];
            while of.first <= live.done(*robot as usize) {
                let Some(order) = of.orders.pop_front() else {
                    panic!("robot {robot} has done what nobody sent");
                };
                if order.cell != of.at {
                    leave(of, *robot, &mut self.visits, &mut self.ready);
                    of.at = order.cell;
                }
                of.first += 1;
            }
            let next = of.orders.front().map(|order| order.cell);
            if self.early && live.left(*robot as usize) >= of.first && next != Some(of.at) {
                leave(of, *robot, &mut self.visits, &mut self.ready);
            }
        }
        let mut ready = std::mem::take(&mut self.ready);
        ready.sort_unstable();
        ready.dedup();
        for robot in ready.drain(..) {
            let of = &mut self.robots[robot as usize];
            let mut before = match (of.sent + 1).checked_sub(of.first) {
                Some(0) | None => of.at,
                Some(at) => of.orders[at as usize - 1].cell,
            };
            while let Some(order) = of.orders.get((of.sent + 1 - of.first) as usize) {
                let number = of.sent + 1;
                let next = self.visits[order.cell as usize].front();
                if order.cell != before && next != Some(&(robot, number)) {
                    break;
                }
                live.send(robot as usize, *order);
                before = order.cell;
                of.sent = number;
            }
        }
        self.ready = ready;
    }

    /// True if everything that was planned is done.
    pub(crate) fn is_idle(&self) -> bool {
        self.robots.iter().all(|robot| robot.orders.is_empty())
    }

    /// Number of orders that are known to be done.
    pub(crate) fn done(&self) -> u64 {
        self.robots.iter().map(|of| u64::from(of.first - 1)).sum()
    }

    /// Cell of the last order of a robot.
    pub(crate) fn end(&self, robot: usize) -> u32 {
        self.robots[robot].end
    }
}

/// The robot has left the cell where it was: whoever is next may come.
fn leave(of: &mut Robot, robot: u32, visits: &mut [VecDeque<(u32, u32)>], ready: &mut Vec<u32>) {
    if of.left < of.first {
        of.left = of.first;
        let visits = &mut visits[of.at as usize];
        let left = visits.pop_front();
        assert_eq!(left.map(|(robot, _)| robot), Some(robot));
        ready.extend(visits.front().map(|(next, _)| next));
    }
}

//! An execution without an end, in which robots drive orders that arrive meanwhile.

use std::collections::VecDeque;

use fleetyard_core::{Grid, Hasher, cell_center_m};
use fleetyard_world::Pose;
use rayon::ThreadPool;

use crate::chunk::{CHUNK, Chunk};
use crate::config::{Policy, SimConfig};
use crate::control::Releases;
use crate::engine::{Engine, Guide};
use crate::error::SimError;
use crate::event::Contacts;
use crate::gate::{Channel, Routes};
use crate::motion::Fleet;
use crate::outcome::{Approach, Outcome};
use crate::route::Place;
use crate::simulator::{Crowd, Simulator};
use crate::trace::{Awaited, Header, TraceSink};
use crate::track::Span;
use crate::workers::Workers;

/// A robot's next move.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Order {
    /// Target cell: next to the cell of the order before, or the same.
    pub cell: u32,
    /// Dwell of the robot there, in seconds.
    pub dwell_s: f64,
    /// Heading there, in radians, which a robot without a controller has turned to by the end
    /// of the order, as far as that is, and the way round that it is; without one it
    /// turns by itself before it moves another way. All orders of an execution have one
    /// ([`Live::with_headings`]), or none.
    pub heading_rad: Option<f64>,
}

impl Order {
    /// An order to a cell, and no more.
    pub fn to(cell: u32) -> Self {
        Self {
            cell,
            dwell_s: 0.0,
            heading_rad: None,
        }
    }
}

/// An execution that goes on as long as it is asked to: robots drive what they are sent.
///
/// Orders of a robot are numbered 1, 2, 3 …; order 0 is to be where it begins. Those that
/// a robot has, that lie in one straight line, and between which it does not stay, are
/// driven as one leg with one stop at its end. A robot that gets more of them while it
/// drives goes on without stopping. An order is done when the robot has passed the middle
/// of its cell, or has arrived there within the tolerances of its model.
///
/// Whoever sends the orders decides who goes first: a robot goes wherever it is sent.
/// Nobody touches anybody, whatever the delays, if an order into a cell is sent when all who
/// are to be there before [have left it](Live::left), and if discs have a radius below half a
/// cell less [their tolerances](crate::motion::Model).
///
/// Time goes in blocks of [`SimConfig::message_period_s`]. What is sent between two of
/// them is on its way from the beginning of the next one, what is done in a block is known
/// after it, or both later, if messages take time or are lost
/// ([`Messages`](crate::noise::Messages)).
///
/// Finished orders are forgotten: memory is that of the robots, of what they still have
/// to do and of the crowding, however long the execution goes on.
///
/// ```
/// use fleetyard_core::Grid;
/// use fleetyard_sim::{Live, NoTrace, Order, SimConfig};
///
/// let grid = Grid::new("tiny", 1, 4, b"....".to_vec())?;
/// let config = SimConfig::default();
/// let mut live = Live::new(&config, &grid, None, &[(0, 0.0)])?;
/// live.begin(&mut NoTrace)?;
/// for cell in [1, 2, 3] {
///     live.send(0, Order::to(cell));
/// }
/// while live.done(0) < 3 {
///     live.advance(&mut NoTrace)?;
/// }
/// assert!((live.now_s() - 3.0).abs() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Live<'a> {
    engine: Engine<'a>,
    orders: Orders<'a>,
    /// Number of each robot's last order, as sent and as received.
    sent: Channel,
    /// Progress of each robot, as the robot and as the server knows it: twice the number
    /// of the last finished order, plus one if the robot has left its cell.
    reports: Channel,
    /// Distance from the centre of a cell at which a robot has left it, in metres.
    clear_m: f64,
    news: Vec<u32>,
    /// Number of finished blocks.
    blocks: u64,
    header: Option<Header>,
    /// The first order that was not accepted.
    fault: Option<SimError>,
    /// Thread pool, if there is more than one thread.
    pool: Option<ThreadPool>,
    /// True if whoever sends the orders records what robots wait for.
    waits: bool,
}

impl<'a> Live<'a> {
    /// Robots at rest at the centres of cells: for each its cell and its heading in
    /// radians. Without a fleet they are discs that move by one cell per step.
    ///
    /// `config.policy`, `config.until_done` and `config.time_limit_s` are ignored.
    pub fn new(
        config: &'a SimConfig,
        grid: &'a Grid,
        fleet: Option<&'a Fleet>,
        starts: &[(u32, f64)],
    ) -> Result<Self, SimError> {
        let mut world = Simulator::new(config).on_grid(grid);
        if let Some(fleet) = fleet {
            world = world.with_fleet(fleet);
        }
        world.check_agents(starts.len())?;
        if let Some(agent) = world.first_car(starts.len()) {
            let reason = "orders on a grid";
            return Err(SimError::Car { agent, reason });
        }
        let mut hasher = Hasher::new("fleetyard.starts/1");
        for (agent, (cell, heading_rad)) in starts.iter().enumerate() {
            if *cell >= grid.cell_count() {
                return Err(SimError::OffMap { agent, time: 0 });
            }
            if !heading_rad.is_finite() {
                return Err(SimError::Config {
                    field: "heading_rad",
                    value: format!("{heading_rad} of agent {agent}"),
                    reason: "is no angle",
                    hint: "give finite radians",
                });
            }
            hasher.u64(u64::from(*cell));
            hasher.f64(*heading_rad);
        }
        let workers = Workers::new(config.threads);
        let start = |agent: usize| {
            let (cell, heading_rad) = starts[agent];
            let (x, y) = cell_center_m(grid, config.cell_size_m, cell);
            Place {
                x,
                y,
                heading: Some(heading_rad),
            }
        };
        let crowd = Crowd {
            agents: starts.len(),
            policy: Policy::Adg,
            exact: false,
            headings: false,
            plan: hasher.finish(),
            start: &start,
        };
        let engine = world.engine(workers, &crowd)?;
        let clock = engine.setup.clock;
        let models = engine.setup.models.iter().flatten();
        let off_m = models
            .map(|model| model.arrival_tolerance_m() + model.lateral_tolerance_m())
            .fold(0.0, f64::max);
        let clear_m = 2.0 * (engine.shapes.largest_radius_m() + off_m);
        let channel = |direction| {
            let disturbance = &config.disturbance;
            Channel::new(vec![0; starts.len()]).over(
                direction,
                &disturbance.messages,
                disturbance.seed,
                clock.period_s(),
            )
        };
        Ok(Self {
            orders: Orders {
                grid,
                cell_size_m: config.cell_size_m,
                step_s: clock.substeps_per_step / clock.substeps_per_s,
                ways: starts.iter().map(|start| Way::new(*start)).collect(),
                headings: false,
            },
            sent: channel("release"),
            reports: channel("report"),
            clear_m,
            news: Vec::new(),
            blocks: 0,
            header: None,
            fault: None,
            pool: workers.pool()?,
            waits: false,
            engine,
        })
    }

    /// Orders have headings, so that a turn in place is an order, too.
    #[must_use]
    pub fn with_headings(mut self) -> Self {
        self.orders.headings = true;
        self
    }

    /// Says in the header of traces that they have what robots wait for ([`TraceSink::waits`]), which
    /// whoever sends the orders records.
    #[must_use]
    pub fn with_waits(mut self) -> Self {
        self.waits = true;
        self
    }

    /// Sends the header to `sink`, and refuses robots that start in obstacles or
    /// overlapping each other. [`Live::advance`] and [`Live::finish`] call it if it was
    /// left out.
    pub fn begin(&mut self, sink: &mut dyn TraceSink) -> Result<(), SimError> {
        if self.header.is_some() {
            return Ok(());
        }
        let engine = &self.engine;
        let mut header = engine
            .setup
            .header(&engine.shapes, None, sink.wants_scene());
        header.waits = self.waits;
        sink.begin(&header)?;
        self.header = Some(header);
        self.with_engine(|engine, guide| engine.start(guide, sink))?;
        self.engine.check_starts(false)
    }

    /// Duration of a block in seconds.
    pub fn period_s(&self) -> f64 {
        self.engine.setup.clock.period_s()
    }

    /// Simulated time in seconds.
    pub fn now_s(&self) -> f64 {
        self.moment(self.blocks) / self.engine.setup.clock.substeps_per_s
    }

    /// First tick of the next block.
    pub fn tick(&self) -> u64 {
        self.blocks * self.engine.setup.clock.ticks_per_period
    }

    /// Number of robots.
    pub fn agents(&self) -> usize {
        self.engine.setup.agents
    }

    /// Appends an order to a robot's queue.
    ///
    /// An invalid order aborts the execution: [`Live::advance`] returns the error.
    /// Neither it nor any later order is driven. A robot can have 2³¹ − 1 orders in all.
    pub fn send(&mut self, agent: usize, order: Order) {
        if self.fault.is_some() {
            return;
        }
        match self.orders.append(agent, order) {
            Ok(number) => {
                self.sent.say(agent as u32, number);
            }
            Err(fault) => self.fault = Some(fault),
        }
    }

    /// Number of orders sent to a robot.
    pub fn sent(&self, agent: usize) -> u32 {
        self.sent.latest()[agent]
    }

    /// The last finished order of a robot, as far as the server knows.
    pub fn done(&self, agent: usize) -> u32 {
        self.reports.known()[agent] / 2
    }

    /// The last order for which a robot has left the cell of the order before, as far as
    /// the server knows: the last finished one, or the next one once no agent in the cell
    /// behind can touch the robot, at twice the largest radius and tolerances.
    pub fn left(&self, agent: usize) -> u32 {
        self.reports.known()[agent].div_ceil(2)
    }

    /// The reason why a robot stands at the end of the orders that it has. `ahead` is the robot that
    /// has to go on before it gets another one, and the order with which that robot leaves the way,
    /// if it has one.
    pub fn awaited(&self, agent: usize, ahead: Option<(u32, Option<u32>)>) -> Awaited {
        let (chunk, lane) = self.lane(agent);
        let received = self.sent.known()[agent];
        if chunk.pilots[lane].done < received {
            return Awaited::Nothing;
        }
        let is_under_way = received < self.sent.latest()[agent];
        let has_left = |(other, order): (u32, Option<u32>)| {
            let left = self.reports.latest()[other as usize].div_ceil(2);
            order.is_some_and(|order| order <= left)
        };
        match ahead {
            _ if is_under_way => Awaited::Message,
            None => Awaited::Nothing,
            Some(ahead) if has_left(ahead) => Awaited::Message,
            Some((other, _)) => Awaited::Agent(other),
        }
    }

    /// Robots whose [`Live::done`] or [`Live::left`] changed in the last block,
    /// ascending.
    pub fn news(&self) -> &[u32] {
        &self.news
    }

    /// Executes one block.
    pub fn advance(&mut self, sink: &mut dyn TraceSink) -> Result<(), SimError> {
        if let Some(fault) = self.fault.take() {
            return Err(fault);
        }
        self.begin(sink)?;
        let number = self.blocks;
        let block = Span {
            start: self.moment(number),
            end: self.moment(number + 1),
        };
        self.engine.setup.clock.ticks_until(block.end)?;
        self.sent.exchange(number, |_, _| {});
        self.with_engine(|engine, guide| engine.advance(block, number, guide, sink))?;
        self.blocks += 1;
        for chunk in &self.engine.chunks {
            for (lane, pilot) in chunk.pilots.iter().enumerate() {
                let agent = chunk.first + lane as u32;
                let left = pilot.leg > pilot.done && {
                    let at = (chunk.x[lane], chunk.y[lane]);
                    self.orders.on_way_m(agent as usize, pilot.done, at) >= self.clear_m
                };
                if self.reports.say(agent, 2 * pilot.done + u32::from(left)) {
                    self.orders.forget(agent as usize, pilot.done);
                }
            }
        }
        let news = &mut self.news;
        news.clear();
        self.reports
            .exchange(self.blocks, |agent, _| news.push(agent));
        news.sort_unstable();
        Ok(())
    }

    /// True if a robot moved or turned in the last block.
    pub fn is_moving(&self, agent: usize) -> bool {
        let (chunk, lane) = self.lane(agent);
        chunk.has_moved(lane)
    }

    /// Pose of a robot.
    pub fn pose(&self, agent: usize) -> Pose {
        let (chunk, lane) = self.lane(agent);
        Pose::new(chunk.x[lane], chunk.y[lane], chunk.heading[lane])
    }

    /// The contacts so far.
    pub fn contacts(&self) -> &Contacts {
        &self.engine.log.contacts
    }

    /// Nearest approach of any two robots so far, between centres. Takes time linear in
    /// the number of robots.
    pub fn nearest_approach(&self) -> Option<Approach> {
        self.engine.nearest()
    }

    /// Memory of the execution in bytes, without the map and the bodies of the contact
    /// tier. It does not grow with time.
    pub fn memory_bytes(&self) -> usize {
        self.engine.memory_bytes()
            + self.orders.memory_bytes()
            + self.sent.memory_bytes()
            + self.reports.memory_bytes()
            + self.news.capacity() * size_of::<u32>()
    }

    /// Ends the execution. Routes have no ends, so that no agent counts as arrived.
    pub fn finish(mut self, sink: &mut dyn TraceSink) -> Result<Outcome, SimError> {
        self.begin(sink)?;
        let (now, number) = (self.moment(self.blocks), self.blocks);
        self.with_engine(|engine, guide| engine.end(now, number, guide, sink))?;
        let Some(header) = self.header else {
            return Err(SimError::NoAgents);
        };
        let arrivals = std::iter::repeat_n(f64::INFINITY, self.engine.setup.agents);
        self.engine.outcome(&header, arrivals, sink)
    }

    /// Start of a block, in substeps.
    fn moment(&self, block: u64) -> f64 {
        let clock = self.engine.setup.clock;
        clock.tick_start(block * clock.ticks_per_period)
    }

    fn lane(&self, agent: usize) -> (&Chunk, usize) {
        (&self.engine.chunks[agent / CHUNK], agent % CHUNK)
    }

    /// Runs `job` with the engine and the robots' routes, in the thread pool if there is
    /// one.
    fn with_engine<R: Send>(
        &mut self,
        job: impl FnOnce(&mut Engine<'a>, &Guide<'_>) -> R + Send,
    ) -> R {
        let guide = Guide::Drive {
            routes: &self.orders,
            headings: self.orders.headings,
            chase: false,
            releases: Releases::Order(self.sent.known()),
        };
        let engine = &mut self.engine;
        match &self.pool {
            Some(pool) => pool.install(|| job(engine, &guide)),
            None => job(engine, &guide),
        }
    }
}

/// The unfinished orders of robots: the routes that they drive.
struct Orders<'a> {
    grid: &'a Grid,
    cell_size_m: f64,
    /// Duration of a move of a robot without a controller.
    step_s: f64,
    ways: Vec<Way>,
    /// Set if the headings of orders are meaningful.
    headings: bool,
}

/// Orders of a robot.
struct Way {
    /// Number of the first order kept: the last finished one.
    first: u32,
    orders: VecDeque<Order>,
}

impl Way {
    fn new((cell, heading_rad): (u32, f64)) -> Self {
        let start = Order {
            heading_rad: Some(heading_rad),
            ..Order::to(cell)
        };
        Self {
            first: 0,
            orders: VecDeque::from([start]),
        }
    }

    /// The order of a number, or the nearest one that is kept.
    fn order(&self, number: usize) -> Order {
        let at = number.saturating_sub(self.first as usize);
        self.orders[at.min(self.orders.len() - 1)]
    }
}

impl Orders<'_> {
    /// Appends a valid order, and returns its number.
    fn append(&mut self, agent: usize, order: Order) -> Result<u32, SimError> {
        let agents = self.ways.len();
        let Some(way) = self.ways.get_mut(agent) else {
            return Err(SimError::NoSuchAgent { agent, agents });
        };
        let before = way.order(usize::MAX).cell;
        let number = way.first as usize + way.orders.len();
        let refused = |reason: String, hint| {
            Err(SimError::Order {
                agent,
                number,
                reason,
                hint,
            })
        };
        let cells = self.grid.cell_count();
        if order.cell >= cells {
            let reason = format!("goes to cell {}, of {cells}", order.cell);
            return refused(reason, "cells are row * width + column");
        }
        let [from, to] = [before, order.cell].map(|cell| {
            let cols = self.grid.cols();
            (cell / cols, cell % cols)
        });
        if from.0.abs_diff(to.0) + from.1.abs_diff(to.1) > 1 {
            let reason = format!("goes from cell {before} to cell {}", order.cell);
            return refused(reason, "send robots from cell to adjacent cell");
        }
        if !(0.0..=MOST_DWELL_S).contains(&order.dwell_s) {
            let reason = format!("stays for {} s", order.dwell_s);
            return refused(reason, "give seconds from 0 to 1e9");
        }
        if order
            .heading_rad
            .is_some_and(|heading| !heading.is_finite())
            || order.heading_rad.is_some() != self.headings
        {
            let reason = format!("has the heading {:?}", order.heading_rad);
            return refused(reason, "give finite radians where orders have headings");
        }
        if number > MOST_ORDERS {
            let reason = "is beyond the last number that an order can have".to_owned();
            return refused(reason, "begin a new execution");
        }
        way.orders.push_back(order);
        Ok(number as u32)
    }

    fn memory_bytes(&self) -> usize {
        let orders: usize = self.ways.iter().map(|way| way.orders.capacity()).sum();
        orders * size_of::<Order>() + self.ways.capacity() * size_of::<Way>()
    }

    /// Distance of a robot at a point from the cell of a finished order towards the next
    /// cell, in metres.
    fn on_way_m(&self, agent: usize, done: u32, (x, y): (f64, f64)) -> f64 {
        let way = &self.ways[agent];
        let [from, to] = [done, done + 1].map(|number| {
            let cell = way.order(number as usize).cell;
            cell_center_m(self.grid, self.cell_size_m, cell)
        });
        let (along_x, along_y) = (to.0 - from.0, to.1 - from.1);
        (along_x * (x - from.0) + along_y * (y - from.1)) / self.cell_size_m
    }

    /// Drops the orders before a finished one.
    fn forget(&mut self, agent: usize, done: u32) {
        let way = &mut self.ways[agent];
        while way.first < done && way.orders.len() > 1 {
            way.orders.pop_front();
            way.first += 1;
        }
    }
}

/// Reports are twice an order's number, plus one.
const MOST_ORDERS: usize = (u32::MAX / 2) as usize;

/// Longest dwell of an order, in seconds.
const MOST_DWELL_S: f64 = 1e9;

impl Routes for Orders<'_> {
    fn agents(&self) -> usize {
        self.ways.len()
    }

    /// Routes never end.
    fn actions(&self, _agent: usize) -> usize {
        u32::MAX as usize
    }

    fn pose(&self, agent: usize, knot: usize) -> Pose {
        let order = self.ways[agent].order(knot);
        let (x, y) = cell_center_m(self.grid, self.cell_size_m, order.cell);
        Pose::new(x, y, order.heading_rad.unwrap_or(0.0))
    }

    fn time_s(&self, _agent: usize, knot: usize) -> f64 {
        knot as f64 * self.step_s
    }

    fn stay_s(&self, agent: usize, knot: usize) -> f64 {
        self.ways[agent].order(knot).dwell_s
    }
}

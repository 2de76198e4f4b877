//! Executions without an end, in which robots drive orders as they come.

use std::io;

use crate::common::passing::Passing;
use crate::common::{random_grid, rng, starts, valid_drives};
use fleetyard_core::{Digest, Grid};
use fleetyard_sim::motion::{DifferentialDrive, Model, Rotation};
use fleetyard_sim::noise::Disturbance;
use fleetyard_sim::trace::{States, Summary};
use fleetyard_sim::{
    Event, Fleet, Live, NoTrace, Order, Other, Outcome, Policy, Profile, SimConfig, SimError,
    Simulator, Tier, TraceReader, TraceSink, TraceWriter,
};
use fleetyard_world::Footprint;

fn open(rows: u32, cols: u32) -> Grid {
    Grid::new("open", rows, cols, vec![b'.'; (rows * cols) as usize]).expect("a valid map")
}

fn disc(radius_m: f64, model: Model) -> Profile {
    let footprint = Footprint::Disc { radius_m };
    Profile { footprint, model }
}

fn uniform(profile: Profile, agents: usize) -> Fleet {
    Fleet::uniform(profile, agents).expect("a fleet")
}

fn preset(name: &str, agents: usize) -> Fleet {
    uniform(Profile::preset(name).expect("a preset"), agents)
}

fn go(cell: u32) -> Order {
    Order::to(cell)
}

fn stay(cell: u32, dwell_s: f64) -> Order {
    Order {
        dwell_s,
        ..Order::to(cell)
    }
}

fn turn(cell: u32, heading_rad: f64) -> Order {
    Order {
        heading_rad: Some(heading_rad),
        ..Order::to(cell)
    }
}

fn disturbed(delay: &str, velocity: &str, messages: &str, seed: u64) -> Disturbance {
    Disturbance {
        seed,
        delay: delay.parse().expect("a delay"),
        velocity: velocity.parse().expect("a noise"),
        messages: messages.parse().expect("messages"),
        ..Disturbance::default()
    }
}

/// A robot in cell 0 of a map that looks east, and has these orders at once.
fn begin<'a>(
    config: &'a SimConfig,
    grid: &'a Grid,
    fleet: Option<&'a Fleet>,
    orders: &[Order],
) -> Live<'a> {
    let mut live = Live::new(config, grid, fleet, &[(0, 0.0)]).expect("a start");
    live.begin(&mut NoTrace).expect("a beginning");
    for order in orders {
        live.send(0, *order);
    }
    live
}

fn advance(live: &mut Live<'_>) {
    live.advance(&mut NoTrace).expect("a block");
}

/// Goes on until so many orders of the only robot are known to be done. When that is.
fn until_done(live: &mut Live<'_>, orders: u32) -> f64 {
    while live.done(0) < orders {
        advance(live);
        assert!(live.now_s() < 1000.0, "nothing happens");
    }
    live.now_s()
}

/// Measured on the program itself: one cell 2.6 s, four 6.2 to 6.5 s, eighteen 22.7 s, 90°
/// in 0.9 s. Its robots fetch actions once a second, so a fifth of a second is not known.
#[test]
fn orders_take_as_long_as_they_do_in_lsmart() {
    let (grid, config, fleet) = (
        open(3, 20),
        SimConfig::default(),
        preset("lsmart-effective", 1),
    );
    for (cells, measured) in [(1, 2.6), (4, 6.35), (18, 22.7)] {
        let orders: Vec<Order> = (1..=cells).map(go).collect();
        let mut live = begin(&config, &grid, Some(&fleet), &orders);
        let time = until_done(&mut live, cells);
        let error: f64 = time - measured;
        assert!(error.abs() <= 0.1 * measured, "{time} s for {cells} cells");
    }
    // South of cell 0 is cell 20: a turn and a cell.
    let mut live = begin(&config, &grid, Some(&fleet), &[go(20)]);
    let time = until_done(&mut live, 1);
    assert!((time - 3.5).abs() <= 0.35, "{time} s");
}

/// A leg of n metres of the published AGV: up and down at 2 m/s² and at 2 m/s between.
fn leg_s(metres: f64) -> f64 {
    if metres >= 2.0 {
        metres / 2.0 + 1.0
    } else {
        2.0 * (metres / 2.0).sqrt()
    }
}

#[test]
fn orders_in_a_straight_line_are_one_leg() {
    let (grid, config, fleet) = (open(3, 20), SimConfig::default(), preset("agv", 1));
    for cells in [1, 2, 3, 10] {
        let orders: Vec<Order> = (1..=cells).map(go).collect();
        let mut live = begin(&config, &grid, Some(&fleet), &orders);
        let (time, ideal) = (until_done(&mut live, cells), leg_s(f64::from(cells)));
        assert!((time - ideal).abs() < 0.2, "{time} s instead of {ideal} s");
    }
}

/// A robot that always knows the next three cells, in time to brake from full speed in one, drives
/// as one that knows all of them.
#[test]
fn orders_that_come_on_the_way_make_the_leg_longer() {
    let (grid, config, fleet) = (open(1, 40), SimConfig::default(), preset("agv", 1));
    let mut live = begin(&config, &grid, Some(&fleet), &[go(1), go(2), go(3)]);
    for next in 4..40 {
        let mut before = until_done(&mut live, next - 3);
        live.send(0, go(next));
        while live.done(0) < next - 2 {
            advance(&mut live);
            assert!(live.is_moving(0), "it stands at {before} s");
            before = live.now_s();
        }
    }
    let time = until_done(&mut live, 39);
    assert!((time - leg_s(39.0)).abs() < 0.2, "{time} s");
    assert_eq!(live.sent(0), 39);
}

#[test]
fn a_robot_stays_where_it_is_told_to() {
    let (grid, config) = (open(3, 20), SimConfig::default());
    let agv = preset("agv", 1);
    for fleet in [None, Some(&agv)] {
        let cell_s = if fleet.is_some() { leg_s(1.0) } else { 1.0 };
        // In passing, and where it is already.
        for stop in [[1, 2, 3], [1, 1, 2]] {
            let orders = stop.map(|cell| stay(cell, 2.0));
            let mut live = begin(&config, &grid, fleet, &orders);
            let moves = f64::from(stop[2]);
            let times = [1, 2, 3].map(|number| until_done(&mut live, number));
            // An order is done when the robot is there, and not when it may go on.
            assert!((times[0] - cell_s).abs() < 0.2, "{times:?}");
            let whole = moves * cell_s + 2.0 * 2.0;
            assert!(
                (times[2] - whole).abs() < 0.5,
                "{times:?} instead of {whole}"
            );
            let rests = times[2] + 1.5;
            while live.now_s() < rests {
                advance(&mut live);
            }
            live.send(0, go(stop[2] + 1));
            let time = until_done(&mut live, 4);
            assert!(
                (time - times[2] - 2.0 - cell_s).abs() < 0.3,
                "{time}, {times:?}"
            );
        }
    }
}

/// A delay belongs to an agent and the number of its order, whenever that is sent.
#[test]
fn delays_are_those_of_the_order() {
    let (grid, fleet) = (open(3, 20), preset("agv", 1));
    let config = SimConfig {
        disturbance: disturbed("uniform:1s,3s", "0,0.5", "0s,0s,0", 7),
        ..SimConfig::default()
    };
    let way = [1, 2, 3, 4, 5].map(go);
    let mut at_once = begin(&config, &grid, Some(&fleet), &way);
    let mut one_by_one = begin(&config, &grid, Some(&fleet), &[]);
    let mut last = [0.0; 2];
    for number in 1..=5 {
        one_by_one.send(0, way[number - 1]);
        let times = [&mut at_once, &mut one_by_one].map(|live| until_done(live, number as u32));
        let took = [times[0] - last[0], times[1] - last[1]];
        assert!((took[0] - took[1]).abs() < 0.15, "{took:?}");
        assert!(took[0] > 1.0 + leg_s(1.0) - 0.1 && took[0] < 3.0 + leg_s(1.0) + 0.2);
        last = times;
    }
}

/// A small robot is out of the way long before it has arrived, a large one hardly.
#[test]
fn a_cell_is_left_when_nobody_there_can_touch_the_robot() {
    let grid = open(3, 20);
    for (name, clear_m) in [("lsmart-effective", 2.0 * (0.085 + 0.063)), ("agv", 0.642)] {
        let fleet = preset(name, 1);
        let config = SimConfig::default();
        let mut live = begin(&config, &grid, Some(&fleet), &[go(1), go(1), go(2)]);
        let mut before = live.pose(0).x;
        while live.left(0) < 1 {
            before = live.pose(0).x;
            assert_eq!(live.done(0), 0);
            advance(&mut live);
        }
        assert_eq!((live.news(), live.done(0)), ([0].as_slice(), 0));
        let gone = [before, live.pose(0).x].map(|x| x - 0.5);
        assert!(
            gone[0] < clear_m && clear_m <= gone[1] + 1e-9,
            "{name}: {gone:?}"
        );
        // To stay is to leave nothing.
        while live.done(0) < 2 {
            advance(&mut live);
            assert!(live.left(0) <= live.done(0).max(1));
        }
        until_done(&mut live, 3);
        assert_eq!(live.left(0), 3);
    }
}

/// An order takes half a second to the robot, and the news of it half a second back.
#[test]
fn messages_are_late_in_both_directions() {
    let grid = open(3, 20);
    let config = SimConfig {
        disturbance: disturbed("none", "0,0.5", "0.5s,0.5s,0", 1),
        ..SimConfig::default()
    };
    let mut live = begin(&config, &grid, None, &[go(1)]);
    let mut started = None;
    while live.done(0) < 1 {
        assert!(live.news().is_empty());
        advance(&mut live);
        if live.is_moving(0) {
            started.get_or_insert(live.now_s() - live.period_s());
        }
    }
    assert_eq!(live.news(), [0]);
    assert!((started.expect("it moves") - 0.5).abs() < 1e-9);
    assert!((live.now_s() - 2.0).abs() < 1e-9, "{}", live.now_s());
    advance(&mut live);
    assert!(live.news().is_empty() && !live.is_moving(0));

    let config = SimConfig {
        disturbance: disturbed("none", "0,0.5", "0s,0.3s,0.9", 1),
        ..SimConfig::default()
    };
    let mut live = begin(&config, &grid, None, &[1, 2, 3, 4].map(go));
    assert!(until_done(&mut live, 4) > 4.3);
}

/// Outcome of robots that wander about for a while.
fn wander(
    config: &SimConfig,
    grid: &Grid,
    fleet: Option<&Fleet>,
    cells: &[u32],
    [drive_s, seed]: [u64; 2],
    dwell_s: f64,
) -> (Outcome, u64) {
    let begins: Vec<(u32, f64)> = cells.iter().map(|cell| (*cell, 0.0)).collect();
    let mut live = Live::new(config, grid, fleet, &begins).expect("starts");
    live.begin(&mut NoTrace).expect("a beginning");
    let mut passing = Passing::new(grid, cells, true);
    let mut rng = rng(seed);
    while live.now_s() < drive_s as f64 {
        passing.wander(&mut rng, grid, 6, dwell_s);
        passing.serve(&mut live);
        advance(&mut live);
    }
    // Nobody is left short of the last order.
    let patience = live.now_s() + 600.0;
    while !passing.is_idle() {
        passing.serve(&mut live);
        advance(&mut live);
        assert!(live.now_s() < patience, "somebody waits for ever");
    }
    for robot in 0..cells.len() {
        let (col, row) = (
            passing.end(robot) % grid.cols(),
            passing.end(robot) / grid.cols(),
        );
        let (x, y) = (f64::from(col) + 0.5, f64::from(grid.rows() - row) - 0.5);
        let pose = live.pose(robot);
        let (dx, dy) = (pose.x - x, pose.y - y);
        let far = (dx * dx + dy * dy).sqrt();
        assert!(far < 0.06, "robot {robot} is {far} m from its last cell");
    }
    assert_eq!(live.contacts().total(), 0, "{:?}", live.contacts().first);
    let nearest = live.nearest_approach();
    let outcome = live.finish(&mut NoTrace).expect("an end");
    assert_eq!(nearest, outcome.nearest_approach);
    (outcome, passing.done())
}

/// Whatever goes wrong, nobody touches anybody, everybody gets there, and everything is
/// the same to the bit on any number of threads.
#[test]
fn robots_that_keep_the_order_never_touch() {
    let agv = |radius_m| {
        disc(
            radius_m,
            Model::DifferentialDrive(DifferentialDrive::default()),
        )
    };
    // Half a cell less twice the lateral tolerance.
    let wide = agv(0.5 - 0.011);
    let law = disc(0.3, "waypoint-law".parse().expect("a model"));
    let rotation = disc(0.5, "rotation".parse().expect("a model"));
    let named = |name| Profile::preset(name).expect("a preset");
    let noises = [
        disturbed("none", "0,0.5", "0s,0s,0", 1),
        disturbed("bernoulli:0.2,1s", "0.3,0.2", "50ms,0.4s,0.3", 2),
        disturbed("bursts:0.2,2s", "0,0.5", "0s,0.3s,0.1", 3),
    ];
    let kinds = [
        (Some(wide), 100),
        (Some(named("lsmart-effective")), 100),
        (Some(named("dynobench-unicycle-1-sphere")), 60),
        (Some(law), 60),
        (Some(rotation), 100),
        (None, 100),
    ];
    let mut digests = Vec::new();
    for (kind, (profile, time)) in kinds.into_iter().enumerate() {
        for (noise, disturbance) in noises.into_iter().enumerate() {
            let seed = (10 * kind + noise) as u64;
            let mut random = rng(seed);
            let grid = random_grid(&mut random, 13, 17, 10);
            let cells = starts(&mut random, &grid, 90);
            let fleet = profile.clone().map(|profile| uniform(profile, cells.len()));
            let dwell_s = noise as f64 * 0.7;
            let drive = |threads, seed| {
                let config = SimConfig {
                    threads,
                    radius_m: Some(0.5),
                    disturbance,
                    ..SimConfig::default()
                };
                wander(
                    &config,
                    &grid,
                    fleet.as_ref(),
                    &cells,
                    [time, seed],
                    dwell_s,
                )
            };
            let (outcome, done) = drive(1, seed);
            assert!(
                done > 5 * cells.len() as u64,
                "only {done} orders of kind {kind}"
            );
            let apart_m = outcome.nearest_approach_m.expect("somebody came near");
            assert!(apart_m > 2.0 * outcome.radius_m - 1e-6, "{apart_m}");
            let again = drive(3, seed);
            assert_eq!((&outcome, done), (&again.0, again.1));
            digests.push(outcome.trace_digest.0);
        }
    }
    let runs = digests.len();
    digests.sort_unstable();
    digests.dedup();
    assert_eq!(digests.len(), runs);
}

/// Ten hours of ten robots, each up and down an aisle of its own.
#[test]
fn memory_does_not_grow_with_time() {
    let grid = open(10, 8);
    let config = SimConfig {
        message_period_s: 0.5,
        ticks_hz: 20,
        disturbance: disturbed("none", "0,0.5", "0s,0.8s,0.1", 1),
        ..SimConfig::default()
    };
    let fleet = preset("agv", 10);
    let starts: Vec<(u32, f64)> = (0..10).map(|row| (8 * row, 0.0)).collect();
    let mut live = Live::new(&config, &grid, Some(&fleet), &starts).expect("starts");
    let column = |number: u32| 7 - (number % 14).abs_diff(7);
    let mut after_an_hour = 0;
    for hour in 1..=10 {
        while live.now_s() < 3600.0 * f64::from(hour) {
            for robot in 0..10 {
                while live.sent(robot) < live.done(robot) + 5 {
                    let col = column(live.sent(robot) + 1);
                    live.send(robot, go(8 * robot as u32 + col));
                }
            }
            advance(&mut live);
        }
        if hour == 1 {
            after_an_hour = live.memory_bytes();
        }
    }
    assert!(live.done(0) > 10_000, "{}", live.done(0));
    // But for the messages that are under way.
    assert!(live.memory_bytes() < after_an_hour + 2000);
    assert!(after_an_hour < 200_000, "{after_an_hour} bytes");
}

/// Robots that push each other have nothing to push.
#[test]
fn live_executions_have_a_contact_tier() {
    let grid = open(6, 7);
    let config = SimConfig {
        tier: Tier::Contact,
        ..SimConfig::default()
    };
    let cells = starts(&mut rng(1), &grid, 8);
    let fleet = preset("agv", 8);
    let (outcome, done) = wander(&config, &grid, Some(&fleet), &cells, [20, 1], 0.0);
    assert!(outcome.contacts.total() == 0 && done > 50, "{done} orders");
}

/// A sink that keeps states and their digest.
#[derive(Default)]
struct StatesOnly {
    digest: Option<Digest>,
    states: Vec<Vec<f64>>,
}

impl TraceSink for StatesOnly {
    fn state(&mut self, _: u64, states: &States<'_>) -> io::Result<()> {
        let heading = states.heading_rad.unwrap_or(&[]);
        self.states.push([states.x_m, states.y_m, heading].concat());
        Ok(())
    }

    fn events(&mut self, events: &[Event]) -> io::Result<()> {
        assert!(events.iter().all(|event| event.other == Other::Goal));
        Ok(())
    }

    fn end(&mut self, summary: &Summary) -> io::Result<()> {
        self.digest = Some(summary.states_digest);
        Ok(())
    }
}

/// A plan by order, and the same plan sent order by order by a server that keeps the order,
/// are the same motion to the bit, noise and all.
#[test]
fn a_plan_sent_order_by_order_is_executed_as_the_plan() {
    for (seed, delay, velocity) in [
        (1, "none", "0,0.5"),
        (2, "bernoulli:0.3,2s", "0.2,0.3"),
        (3, "bursts:0.3,1s", "0.1,0.5"),
    ] {
        let mut random = rng(seed);
        let grid = random_grid(&mut random, 12, 15, 8);
        let plan = valid_drives(&mut random, &grid, 70, 30).trimmed();
        let config = SimConfig {
            policy: Policy::Adg,
            disturbance: disturbed(delay, velocity, "0s,0s,0", seed),
            ..SimConfig::default()
        };
        let fleet = preset("agv", plan.agents());
        let simulator = Simulator::new(&config).on_grid(&grid).with_fleet(&fleet);
        let mut whole = StatesOnly::default();
        let outcome = simulator.run(&plan, &mut whole).expect("an execution");
        assert_eq!(outcome.arrived, outcome.agents);

        let cells: Vec<u32> = plan.paths().map(|path| path[0]).collect();
        let begins: Vec<(u32, f64)> = cells
            .iter()
            .map(|cell| (*cell, config.start_heading_rad))
            .collect();
        let mut live = Live::new(&config, &grid, Some(&fleet), &begins).expect("starts");
        let mut passing = Passing::new(&grid, &cells, false);
        // Who leaves goes before who comes, as in a plan without rings.
        for step in 1..=plan.horizon() {
            let mut movers: Vec<usize> = (0..plan.agents())
                .filter(|agent| step < plan.path(*agent).len())
                .collect();
            while !movers.is_empty() {
                let before = movers.len();
                movers.retain(|agent| {
                    let cell = plan.at(*agent, step);
                    let taken = (0..plan.agents())
                        .any(|other| other != *agent && passing.end(other) == cell);
                    if !taken {
                        passing.plan(*agent, go(cell));
                    }
                    taken
                });
                assert!(movers.len() < before, "a ring");
            }
        }
        let mut sent = StatesOnly::default();
        live.begin(&mut sent).expect("a beginning");
        while live.now_s() < outcome.simulated_s {
            passing.serve(&mut live);
            live.advance(&mut sent).expect("a block");
        }
        let end = live.finish(&mut sent).expect("an end");
        assert_eq!(end.ticks, outcome.ticks);
        for (tick, (one, other)) in whole.states.iter().zip(&sent.states).enumerate() {
            assert_eq!(one, other, "seed {seed}, tick {tick}");
        }
        assert_eq!(whole.digest, sent.digest, "seed {seed}");
        assert_eq!(outcome.nearest_approach, end.nearest_approach);
        let errors = [outcome.tracking_error_max_m, end.tracking_error_max_m];
        assert_eq!(errors[0].to_bits(), errors[1].to_bits());
    }
}

#[test]
fn traces_of_live_executions_can_be_read() {
    let (grid, config) = (open(3, 20), SimConfig::default());
    let fleet = preset("agv", 1);
    let drive = |sink: &mut dyn TraceSink| {
        let mut live = begin_with(&config, &grid, &fleet, sink);
        while live.done(0) < 2 {
            live.advance(sink).expect("a block");
        }
        live.finish(sink).expect("an end")
    };
    let mut writer = TraceWriter::new(Vec::new(), 1);
    let outcome = drive(&mut writer);
    let file = writer.into_inner();
    assert_eq!(outcome.trace_digest, drive(&mut NoTrace).trace_digest);
    assert_eq!((outcome.arrived, outcome.makespan_s), (0, None));
    let reader = TraceReader::open(&file[..], "memory").expect("a trace");
    assert_eq!(reader.header().policy, "adg");
    // Reading compares the digests of states and events.
    let mut kept = StatesOnly::default();
    reader.replay(&mut kept).expect("a whole trace");
    assert_eq!(kept.states.len() as u64, outcome.ticks + 1);
}

fn begin_with<'a>(
    config: &'a SimConfig,
    grid: &'a Grid,
    fleet: &'a Fleet,
    sink: &mut dyn TraceSink,
) -> Live<'a> {
    let mut live = Live::new(config, grid, Some(fleet), &[(0, 0.0)]).expect("a start");
    live.begin(sink).expect("a beginning");
    live.send(0, go(1));
    live.send(0, go(21));
    live
}

#[test]
fn what_cannot_be_driven_is_refused() {
    let (grid, config) = (open(3, 20), SimConfig::default());
    let start = |starts: &[(u32, f64)]| {
        let mut live = Live::new(&config, &grid, None, starts)?;
        live.begin(&mut NoTrace)
    };
    assert!(start(&[(0, 0.0), (1, 1.0)]).is_ok());
    assert!(matches!(start(&[]), Err(SimError::NoAgents)));
    assert!(matches!(
        start(&[(60, 0.0)]),
        Err(SimError::OffMap { agent: 0, .. })
    ));
    assert!(matches!(
        start(&[(0, f64::NAN)]),
        Err(SimError::Config { .. })
    ));
    let overlap = start(&[(0, 0.0), (0, 0.0)]);
    assert!(matches!(
        overlap,
        Err(SimError::StartOverlap { agent: 0, .. })
    ));
    let fleet = preset("agv", 2);
    let other = Live::new(&config, &grid, Some(&fleet), &[(0, 0.0)]);
    assert!(matches!(other.err(), Some(SimError::OtherFleet { .. })));

    let orders = [
        (0, go(2), "order 2 of agent 0 goes from cell 21 to cell 2"),
        (0, go(40), "order 2 of agent 0 goes from cell 21 to cell 40"),
        (0, go(60), "order 2 of agent 0 goes to cell 60, of 60"),
        (1, go(0), "there is no agent 1: there are 1"),
        (0, stay(21, -1.0), "order 2 of agent 0 stays for -1 s"),
        (0, stay(21, f64::NAN), "order 2 of agent 0 stays for NaN s"),
        (
            0,
            turn(21, 0.0),
            "order 2 of agent 0 has the heading Some(0.0)",
        ),
    ];
    for (agent, order, message) in orders {
        let mut live = Live::new(&config, &grid, None, &[(20, 0.0)]).expect("a start");
        live.send(0, go(21));
        live.send(agent, order);
        live.send(0, go(22));
        let error = live.advance(&mut NoTrace).expect_err("it is refused");
        assert_eq!(error.to_string(), message);
        assert!(error.hint().is_some());
        // What came before can still be driven.
        assert_eq!(live.sent(0), 1);
        assert!((until_done(&mut live, 1) - 1.0).abs() < 1e-9);
    }
}

/// A robot of the League of Robot Runners: forwards, a quarter to the left, one to the right and
/// again, each in a second, with turns past a whole one.
#[test]
fn orders_with_headings_turn_robots_in_place_in_a_step() {
    use std::f64::consts::FRAC_PI_2;
    let model = Model::Rotation(Rotation::default());
    let (grid, fleet) = (open(3, 5), uniform(disc(0.3, model), 2));
    let config = SimConfig {
        message_period_s: 1.0,
        ..SimConfig::default()
    };
    let starts = [(5, 0.0), (14, 3.0 * FRAC_PI_2)];
    let live = Live::new(&config, &grid, Some(&fleet), &starts).expect("a start");
    let mut live = live.with_headings();
    let steps = [
        [(6, 0.0), (14, 4.0 * FRAC_PI_2)],
        [(6, FRAC_PI_2), (14, 5.0 * FRAC_PI_2)],
        [(1, FRAC_PI_2), (9, 5.0 * FRAC_PI_2)],
        [(1, 0.0), (4, 5.0 * FRAC_PI_2)],
        [(1, -FRAC_PI_2), (4, 4.0 * FRAC_PI_2)],
        [(6, -FRAC_PI_2), (4, 3.0 * FRAC_PI_2)],
    ];
    for (at, step) in steps.iter().enumerate() {
        for (agent, (cell, heading)) in step.iter().enumerate() {
            live.send(agent, turn(*cell, *heading));
        }
        advance(&mut live);
        for (agent, (cell, heading)) in step.iter().enumerate() {
            assert_eq!(live.done(agent), at as u32 + 1);
            let pose = live.pose(agent);
            let (x, y) = fleetyard_core::cell_center_m(&grid, 1.0, *cell);
            assert_eq!((pose.x, pose.y, pose.heading), (x, y, *heading));
        }
    }
    assert_eq!(live.contacts().total(), 0);
    live.send(0, Order::to(6));
    let error = live.advance(&mut NoTrace).expect_err("it has no heading");
    assert_eq!(error.to_string(), "order 7 of agent 0 has the heading None");
}

//! Costs of a trace, as a table: bytes for an agent at a tick (24 before compression, 16 without
//! headings), and megabytes of states that are written and read in a second, for several motions,
//! fleets and levels of compression. Seconds are those of the processor where the kernel tells
//! them, so that a busy machine does not matter much.

#![allow(missing_docs, reason = "a program")]
#![allow(clippy::disallowed_methods, reason = "it measures time")]

use std::fs;
use std::time::Instant;

use fleetyard_core::Digest;
use fleetyard_sim::motion::{Model, State, Target};
use fleetyard_sim::trace::{
    Bounds, Digests, EventsDigest, Header, Outline, Profile, Scene, States, StatesDigest, Summary,
    TraceOptions, read_trace,
};
use fleetyard_sim::{TraceSink, TraceWriter};

const TICKS_HZ: usize = 60;
/// Ticks of a block, for which a speed is drawn.
const BLOCK: usize = 6;
const SIDE: f64 = 100.0;

/// `SplitMix64`: the choices of the motions.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    fn below(&mut self, count: u64) -> u64 {
        self.next() % count
    }
}

/// The time of the processor that this thread has used, or else the time that has passed.
fn used_s(begin: Instant) -> f64 {
    let told = fs::read_to_string("/proc/thread-self/schedstat").ok();
    let used = told.and_then(|told| told.split(' ').next()?.parse::<f64>().ok());
    used.map_or_else(|| begin.elapsed().as_secs_f64(), |used| used / 1e9)
}

/// Poses tick by tick: x, y and perhaps headings of all agents.
struct Motion {
    name: &'static str,
    agents: usize,
    headings: bool,
    ticks: Vec<Vec<f64>>,
}

fn cell(random: &mut Random) -> f64 {
    random.below(SIDE as u64) as f64 + 0.5
}

/// Steps of one cell in a second, or waits, each with equal chance.
fn replay(agents: usize, seconds: usize) -> Motion {
    let mut random = Random(1);
    let mut at: Vec<[f64; 2]> = (0..agents)
        .map(|_| [cell(&mut random), cell(&mut random)])
        .collect();
    let mut ticks = Vec::new();
    for _ in 0..seconds {
        let next: Vec<[f64; 2]> = at
            .iter()
            .map(|[x, y]| match random.below(5) {
                0 => [x + 1.0, *y],
                1 => [x - 1.0, *y],
                2 => [*x, y + 1.0],
                3 => [*x, y - 1.0],
                _ => [*x, *y],
            })
            .collect();
        for tick in 0..TICKS_HZ {
            let part = tick as f64 / TICKS_HZ as f64;
            let along = |axis: usize| {
                let both = at.iter().zip(&next);
                both.map(move |(a, b)| a[axis] + (b[axis] - a[axis]) * part)
            };
            ticks.push(along(0).chain(along(1)).collect());
        }
        at = next;
    }
    Motion {
        name: "grid replay",
        agents,
        headings: false,
        ticks,
    }
}

/// Legs of one to five metres along the axes, driven by a model, at times at a speed that
/// is drawn for every block.
fn driven(name: &'static str, model: &str, noise: f64, agents: usize, seconds: usize) -> Motion {
    let model: Model = model.parse().expect("a preset");
    let mut random = Random(2);
    let mut states: Vec<(State, Target)> = (0..agents)
        .map(|_| {
            let (x, y) = (cell(&mut random), cell(&mut random));
            let heading = None;
            (State::at_rest(x, y, 0.0), Target { x, y, heading })
        })
        .collect();
    let mut ticks = vec![vec![0.0; 3 * agents]; seconds * TICKS_HZ];
    for block in ticks.chunks_mut(BLOCK) {
        for (agent, (state, target)) in states.iter_mut().enumerate() {
            if model.has_arrived(state, target) {
                let length = (1 + random.below(5)) as f64;
                match random.below(4) {
                    0 => target.x += length,
                    1 => target.x -= length,
                    2 => target.y += length,
                    _ => target.y -= length,
                }
            }
            let factor = 1.0 - noise * random.unit();
            let mut tick = 0;
            let dt = 1.0 / TICKS_HZ as f64;
            model.run(state, target, block.len(), dt, factor, &mut |now| {
                block[tick][agent] = now.x;
                block[tick][agents + agent] = now.y;
                block[tick][2 * agents + agent] = now.heading;
                tick += 1;
            });
        }
    }
    Motion {
        name,
        agents,
        headings: true,
        ticks,
    }
}

impl Motion {
    fn header(&self) -> Header {
        Header {
            program: "bench".into(),
            agents: self.agents as u32,
            movers: 0,
            ticks_hz: TICKS_HZ as u32,
            substeps: 4,
            tier: "kinematic".into(),
            policy: "time".into(),
            seed: 0,
            headings: self.headings,
            progress: false,
            waits: false,
            cars: Vec::new(),
            state_every: 0,
            bounds_m: Bounds {
                min_x: 0.0,
                min_y: 0.0,
                max_x: SIDE,
                max_y: SIDE,
            },
            profiles: vec![Profile {
                name: "disc".into(),
                model: String::new(),
                outline: Outline::Disc { radius_m: 0.35 },
            }],
            digests: Digests {
                world: Digest(0),
                plan: Digest(0),
                fleet: Digest(0),
                config: Digest(0),
            },
            scene: Scene {
                profile_of_body: vec![0; self.agents],
                ..Scene::default()
            },
        }
    }

    fn states(&self) -> impl Iterator<Item = States<'_>> {
        self.ticks.iter().map(|values| States {
            x_m: &values[..self.agents],
            y_m: &values[self.agents..2 * self.agents],
            heading_rad: self.headings.then(|| &values[2 * self.agents..]),
            progress: None,
        })
    }

    fn measure(&self, level: i32) {
        let header = self.header();
        let mut digest = StatesDigest::new(self.agents);
        self.states().for_each(|states| digest.update(&states));
        let summary = Summary {
            ticks: self.ticks.len() as u64 - 1,
            simulated_s: 0.0,
            contacts_agent_agent: 0,
            contacts_agent_obstacle: 0,
            nearest_approach_m: None,
            tracking_error_max_m: 0.0,
            tracking_error_mean_m: 0.0,
            states_digest: digest.finish(),
            events_digest: EventsDigest::default().finish(),
            trace_digest: Digest(0),
        }
        .sealed(&header);
        let options = TraceOptions {
            level,
            ..TraceOptions::default()
        };
        let begin = Instant::now();
        let started = used_s(begin);
        let mut writer = TraceWriter::with_options(Vec::new(), options);
        writer.begin(&header).expect("a header");
        for (tick, states) in self.states().enumerate() {
            writer.state(tick as u64, &states).expect("states");
        }
        writer.end(&summary).expect("a summary");
        let written = used_s(begin) - started;
        let bytes = writer.into_inner();
        let started = used_s(begin);
        let contents = read_trace(&bytes[..], "bench").expect("a trace");
        let read = used_s(begin) - started;
        assert_eq!(contents.damage, None);
        let each = (self.ticks.len() * self.agents) as f64;
        let width = if self.headings { 24.0 } else { 16.0 };
        let speed = |seconds: f64| each * width / seconds / 1e6;
        println!(
            "{:<34} {:>7} {level:>5} {:>6.2} {:>6.1} {:>10.0} {:>9.1} {:>9.0} {:>8.1}",
            self.name,
            self.agents,
            bytes.len() as f64 / each,
            width * each / bytes.len() as f64,
            speed(written),
            written / each * 1e9,
            speed(read),
            read / each * 1e9,
        );
    }
}

fn main() {
    println!(
        "{:<34} {:>7} {:>5} {:>6} {:>6} {:>10} {:>9} {:>9} {:>8}",
        "motion",
        "agents",
        "level",
        "bytes",
        "ratio",
        "write MB/s",
        "write ns",
        "read MB/s",
        "read ns"
    );
    for (agents, seconds) in [(1000, 30), (100_000, 1)] {
        for motion in [
            replay(agents, seconds),
            driven("differential drive", "agv", 0.0, agents, seconds),
            driven(
                "differential drive, noisy speed",
                "agv",
                0.3,
                agents,
                seconds,
            ),
            driven(
                "unicycle of second order",
                "unicycle-2",
                0.0,
                agents,
                seconds,
            ),
        ] {
            let levels: &[i32] = if agents == 1000 { &[1, 3, 9] } else { &[1] };
            for level in levels {
                motion.measure(*level);
            }
        }
    }
}

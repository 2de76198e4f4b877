//! Trace files: what is written is read; damage is found, named and confined.

use crate::common;
use std::io::{self, Cursor};

use fleetyard_core::{Digest, Grid, GridPlan, Role};
use fleetyard_sim::motion::{Fleet, Profile as Robot};
use fleetyard_sim::trace::{
    Awaited, Bounds, By, Cells, Digests, Entry, Errand, EventsDigest, Frame, Goal, Happening,
    Header, Outline, Profile, Remark, Scene, Standing, States, StatesDigest, Summary, TraceOptions,
    Waiting, Waits, read_trace,
};
use fleetyard_sim::{
    Event, EventKind, NoTrace, Other, Outcome, SimConfig, SimError, Simulator, Tier, TraceReader,
    TraceSink, TraceWriter,
};
use xxhash_rust::xxh3::xxh3_64;

fn world() -> (Grid, GridPlan) {
    let mut rng = common::rng(7);
    let grid = common::random_grid(&mut rng, 8, 8, 15);
    let plan = common::wild_walks(&mut rng, &grid, 8, 4, true, 10);
    (grid, plan)
}

fn config() -> SimConfig {
    SimConfig {
        ticks_hz: 10,
        overlapping_starts: true,
        ..SimConfig::default()
    }
}

fn written(options: TraceOptions) -> (Vec<u8>, Outcome) {
    let (grid, plan) = world();
    let mut writer = TraceWriter::with_options(Vec::new(), options);
    let outcome = Simulator::new(&config())
        .on_grid(&grid)
        .run(&plan, &mut writer)
        .expect("can be executed");
    (writer.into_inner(), outcome)
}

fn every(every: u32) -> TraceOptions {
    TraceOptions {
        every,
        ..TraceOptions::default()
    }
}

/// Small groups and many keys, so that a short trace has all there is.
fn small_groups() -> TraceOptions {
    TraceOptions {
        every: 1,
        group: 4,
        key_every: 8,
        ..TraceOptions::default()
    }
}

/// States as bits, which can be compared whatever they are.
#[derive(Debug, Clone, PartialEq)]
struct Kept {
    tick: u64,
    values: Vec<Vec<u64>>,
    progress: Option<Vec<u32>>,
}

/// Keeps all that it is told.
#[derive(Debug, Default, PartialEq)]
struct Memory {
    header: Option<Header>,
    states: Vec<Kept>,
    events: Vec<Event>,
    journal: Vec<Entry>,
    remarks: Vec<Remark>,
    waits: Vec<Waiting>,
    summary: Option<Summary>,
}

impl TraceSink for Memory {
    fn begin(&mut self, header: &Header) -> io::Result<()> {
        self.header = Some(header.clone());
        Ok(())
    }
    fn state(&mut self, tick: u64, states: &States<'_>) -> io::Result<()> {
        let channels = [Some(states.x_m), Some(states.y_m), states.heading_rad];
        let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect();
        self.states.push(Kept {
            tick,
            values: channels.into_iter().flatten().map(bits).collect(),
            progress: states.progress.map(<[u32]>::to_vec),
        });
        Ok(())
    }
    fn events(&mut self, events: &[Event]) -> io::Result<()> {
        self.events.extend(events);
        Ok(())
    }
    fn journal(&mut self, entries: &[Entry]) -> io::Result<()> {
        self.journal.extend_from_slice(entries);
        Ok(())
    }
    fn remarks(&mut self, remarks: &[Remark]) -> io::Result<()> {
        self.remarks.extend_from_slice(remarks);
        Ok(())
    }
    fn waits(&mut self, changes: &[Waiting]) -> io::Result<()> {
        self.waits.extend_from_slice(changes);
        Ok(())
    }
    fn end(&mut self, summary: &Summary) -> io::Result<()> {
        self.summary = Some(summary.clone());
        Ok(())
    }
}

fn read(bytes: &[u8]) -> Memory {
    let mut memory = Memory::default();
    let reader = TraceReader::open(bytes, "memory").unwrap();
    let contents = reader.replay(&mut memory).unwrap();
    assert_eq!(contents.damage, None);
    assert_eq!(contents.intact_bytes, bytes.len() as u64);
    memory
}

#[test]
fn what_is_written_is_read() {
    let (grid, plan) = world();
    let mut memory = Memory::default();
    let outcome = Simulator::new(&config())
        .on_grid(&grid)
        .run(&plan, &mut memory)
        .unwrap();
    assert_eq!(memory.states.len() as u64, outcome.ticks + 1);
    assert!(!memory.events.is_empty());
    let order = |e: &Event| (e.substep, e.agent);
    assert!(memory.events.is_sorted_by_key(order));

    for options in [every(0), every(1), every(7), small_groups()] {
        let (bytes, with_trace) = written(options);
        assert_eq!(with_trace, outcome, "a trace changes nothing");
        let kept = read(&bytes);
        let header = kept.header.unwrap();
        let expected = Header {
            state_every: options.every,
            ..memory.header.clone().unwrap()
        };
        assert_eq!(header, expected);
        assert_eq!(header.digests.world, grid.digest());
        assert_eq!(header.digests.plan, Digest::of_plan(&plan));
        let is_recorded = |state: &&Kept| {
            options.every > 0 && state.tick.is_multiple_of(u64::from(options.every))
        };
        let wanted: Vec<_> = memory.states.iter().filter(is_recorded).cloned().collect();
        assert!(kept.states == wanted);
        assert_eq!(kept.events, memory.events);
        assert_eq!(kept.summary, memory.summary);
        assert_eq!(kept.summary.unwrap().trace_digest, outcome.trace_digest);
    }
}

#[test]
fn robots_that_turn_have_headings_and_a_digest_that_is_found_again() {
    let mut rng = common::rng(9);
    let grid = common::random_grid(&mut rng, 12, 12, 10);
    let plan = common::valid_walks(&mut rng, &grid, 70, 6);
    let profile = Robot::preset("agv").unwrap();
    let fleet = Fleet::uniform(profile, plan.agents()).unwrap();
    for tier in [Tier::Kinematic, Tier::Contact] {
        let config = SimConfig {
            tier,
            ..SimConfig::default()
        };
        let mut writer = TraceWriter::new(Vec::new(), 1);
        let simulator = Simulator::new(&config).on_grid(&grid).with_fleet(&fleet);
        let outcome = simulator.run(&plan, &mut writer).unwrap();
        // Reading compares the digests of states, of more than one chunk, and events.
        let memory = read(&writer.into_inner());
        let header = memory.header.unwrap();
        assert!(header.headings);
        assert_eq!(header.profiles[0].model, "differential-drive");
        assert_eq!(memory.states.len() as u64, outcome.ticks + 1);
        let turned = |state: &Kept| state.values[2].iter().any(|bits| *bits != 0);
        assert!(memory.states.iter().any(turned));
        assert_eq!(memory.summary.unwrap().trace_digest, outcome.trace_digest);
    }
}

#[test]
fn a_trace_is_written_again_as_it_was() {
    let (bytes, _) = written(small_groups());
    let mut writer = TraceWriter::with_options(Vec::new(), small_groups());
    let reader = TraceReader::open(&bytes[..], "t").unwrap();
    assert_eq!(reader.replay(&mut writer).unwrap().damage, None);
    assert!(writer.into_inner() == bytes);
}

/// The waits of a trace of everything.
fn waits() -> Vec<Waiting> {
    let change = |tick, agent, awaited| Waiting {
        tick,
        agent,
        awaited,
    };
    vec![
        change(0, 1, Awaited::Agent(0)),
        change(3, 0, Awaited::Message),
        change(3, 1, Awaited::Nothing),
        change(8, 0, Awaited::Agent(1)),
        change(17, 0, Awaited::Nothing),
    ]
}

/// A trace of everything that a header and states can have: headings, progress,
/// moving obstacles, polygons, profiles, every kind of event.
fn of_everything() -> Vec<u8> {
    let cells = Grid::new("m", 2, 3, b".@@..@".to_vec()).unwrap();
    let square = vec![[-0.2, -0.1], [0.2, -0.1], [0.2, 0.1], [-0.2, 0.1]];
    let profile = |name: &str, model: &str, outline| Profile {
        name: name.into(),
        model: model.into(),
        outline,
    };
    let header = Header {
        program: "test \u{1f916} 1".into(),
        agents: 2,
        movers: 1,
        ticks_hz: 60,
        substeps: 4,
        tier: "kinematic".into(),
        policy: "gated".into(),
        seed: u64::MAX,
        headings: true,
        progress: true,
        waits: true,
        cars: Vec::new(),
        state_every: 0,
        bounds_m: Bounds {
            min_x: -1.0 / 3.0,
            min_y: 0.0,
            max_x: 3.1,
            max_y: 2.000_000_000_000_000_4,
        },
        profiles: vec![
            profile("disc", "holonomic", Outline::Disc { radius_m: 0.1 }),
            profile(
                "box",
                "differential-drive",
                Outline::Polygon { vertices_m: square },
            ),
        ],
        digests: Digests {
            world: Digest(1),
            plan: Digest(u128::MAX),
            fleet: Digest(3),
            config: Digest(4),
        },
        scene: Scene {
            cells: Some(Cells::new(&cells, 1.0)),
            polygons_m: vec![vec![[0.5, 0.5], [1.0, 0.5], [0.7, 0.9]]],
            outline_m: vec![[0.0, 0.0], [3.0, 0.0], [2.0, 2.0], [0.0, 2.0]],
            roadmap_m: vec![[[0.5, 0.5], [2.5, 0.5]], [[2.5, 0.5], [1.5, 1.0]]],
            profile_of_body: vec![1, 0, 0],
            goals_m: vec![[2.5, 1.5], [0.1 + 0.2, 1.0]],
            ..Scene::default()
        },
    };
    let mut writer = TraceWriter::with_options(Vec::new(), small_groups());
    writer.begin(&header).unwrap();
    let (mut states, mut events) = (StatesDigest::new(3), EventsDigest::default());
    for tick in 0..20u32 {
        let own = |wait: &Waiting| wait.tick == u64::from(tick);
        let changes: Vec<Waiting> = waits().into_iter().filter(own).collect();
        writer.waits(&changes).unwrap();
        let t = f64::from(tick) / 60.0;
        let now = States {
            x_m: &[0.5 + t, 2.5 - t * t, 1.5],
            y_m: &[0.5, 0.5 + 0.3 * t, 1.0 - t],
            heading_rad: Some(&[0.0, -t, 7.0 + t]),
            progress: Some(&[tick / 5, tick / 7, 0]),
        };
        states.update(&now);
        writer.state(u64::from(tick), &now).unwrap();
        let told = |kind, agent, other| Event {
            substep: u64::from(4 * tick),
            time_s: t,
            kind,
            agent,
            other,
        };
        let new = match tick {
            3 => vec![told(EventKind::Begin, 0, Other::Agent(1))],
            5 => vec![
                told(EventKind::End, 0, Other::Agent(1)),
                told(EventKind::Begin, 1, Other::Mover(0)),
                told(EventKind::Begin, 1, Other::Obstacle { cell: 5 }),
                told(EventKind::Begin, 1, Other::Polygon(1)),
            ],
            19 => vec![told(EventKind::Arrive, 1, Other::Goal)],
            _ => vec![],
        };
        events.update(&new);
        writer.events(&new).unwrap();
    }
    let summary = Summary {
        ticks: 19,
        simulated_s: 19.0 / 60.0,
        contacts_agent_agent: 1,
        contacts_agent_obstacle: 3,
        nearest_approach_m: None,
        tracking_error_max_m: 0.25,
        tracking_error_mean_m: 0.1 + 0.2,
        states_digest: states.finish(),
        events_digest: events.finish(),
        trace_digest: Digest(0),
    };
    writer.end(&summary.sealed(&header)).unwrap();
    writer.into_inner()
}

#[test]
fn everything_that_a_trace_can_have_comes_back() {
    let bytes = of_everything();
    let memory = read(&bytes);
    let header = memory.header.unwrap();
    assert_eq!(header.program, "test \u{1f916} 1");
    assert_eq!(
        header.bounds_m.max_y.to_bits(),
        2.000_000_000_000_000_4f64.to_bits()
    );
    assert_eq!(header.seed, u64::MAX);
    assert_eq!(header.profiles[1].model, "differential-drive");
    let bits = |point: [f64; 2]| point.map(f64::to_bits);
    assert_eq!(bits(header.scene.goals_m[1]), bits([0.1 + 0.2, 1.0]));
    assert_eq!(bits(header.scene.polygons_m[0][2]), bits([0.7, 0.9]));
    assert_eq!(bits(header.scene.outline_m[2]), bits([2.0, 2.0]));
    assert_eq!(bits(header.scene.roadmap_m[1][1]), bits([1.5, 1.0]));
    let solid: Vec<_> = header.scene.cells.unwrap().in_rows().collect();
    assert_eq!(solid, [(0, 1, 2), (1, 2, 1)]);
    assert_eq!(memory.states.len(), 20);
    let last = memory.states.last().unwrap();
    assert_eq!(last.values[2][1], (-19.0f64 / 60.0).to_bits());
    assert_eq!(last.progress, Some(vec![3, 2, 0]));
    assert_eq!(memory.waits, waits());
    assert_eq!(memory.events.len(), 6);
    assert_eq!(memory.events[5].other, Other::Goal);
    assert_eq!(memory.summary.unwrap().nearest_approach_m, None);
}

#[test]
fn reading_begins_anywhere() {
    let bytes = of_everything();
    let all = read(&bytes);
    for tick in [0, 1, 7, 8, 9, 15, 16, 19, 1000] {
        let mut reader = TraceReader::open(Cursor::new(&bytes), "t").unwrap();
        // Also after some of it was read.
        reader.next_frame().unwrap();
        reader.seek(tick).unwrap();
        let first = tick.min(16) / 8 * 8;
        let mut expected = first;
        let mut memory = Memory::default();
        while let Some(frame) = reader.next_frame().unwrap() {
            match frame {
                Frame::State { tick, states } => {
                    assert_eq!(tick, expected);
                    expected += 1;
                    memory.state(tick, &states).unwrap();
                }
                Frame::Events(events) => memory.events.extend(events),
                Frame::Journal(entries) => memory.journal(entries).unwrap(),
                Frame::Remarks(remarks) => memory.remarks(remarks).unwrap(),
                Frame::Waits(changes) => memory.waits(changes).unwrap(),
                Frame::End(summary) => memory.summary = Some(summary.clone()),
            }
        }
        assert_eq!(memory.states, all.states[first as usize..]);
        // Changes until the first states only as far as they still hold.
        let (before, after): (Vec<_>, Vec<_>) =
            waits().into_iter().partition(|wait| wait.tick <= first);
        let mut standing = Waits::default();
        for wait in &before {
            standing.note(wait);
        }
        let expected: Vec<Waiting> = standing.iter().copied().chain(after).collect();
        assert_eq!(memory.waits, expected, "from tick {tick}");
        assert_eq!(memory.summary, all.summary);
        assert!(all.events.ends_with(&memory.events));
    }
    let (bytes, _) = written(every(0));
    let mut reader = TraceReader::open(Cursor::new(&bytes), "t").unwrap();
    let error = reader.seek(3).unwrap_err();
    assert!(error.reason.contains("no states"), "{error}");
    let cut = &bytes[..bytes.len() - 1];
    let error = TraceReader::open(Cursor::new(cut), "t")
        .unwrap()
        .seek(3)
        .unwrap_err();
    assert!(error.hint.unwrap().contains("from its beginning"));
}

/// Entries of robot 1 for 20 ticks: a task of two goals, and calls that are answered, the second
/// one by the fail policy. Robot 0 has a goal from the beginning to the end.
fn fleet_entries() -> Vec<Entry> {
    let at = |tick, what| Entry { tick, what };
    let goal = |agent, number, cell, errand| {
        Happening::Goal(Goal {
            agent,
            number,
            cell,
            errand,
        })
    };
    let errand = |at| {
        let (task, of) = (1 << 40, 2);
        Some(Errand { task, at, of })
    };
    let reached = |number| Happening::Reached { agent: 1, number };
    vec![
        at(0, goal(0, 0, 3, None)),
        at(0, Happening::Asked { call: 0 }),
        at(
            3,
            Happening::Answered {
                call: 0,
                by: By::Planner,
            },
        ),
        at(3, goal(1, 0, 6, errand(0))),
        at(5, Happening::Asked { call: 1 }),
        at(7, reached(0)),
        at(7, goal(1, 1, 0, errand(1))),
        at(
            9,
            Happening::Answered {
                call: 1,
                by: By::FailPolicy,
            },
        ),
        at(
            9,
            Happening::Notice {
                number: 0,
                call: 1,
                name: "planner-gave-up".to_owned(),
                module: "a/planner".to_owned(),
            },
        ),
        at(12, reached(1)),
        at(15, Happening::Asked { call: 2 }),
        at(
            19,
            Happening::Answered {
                call: 2,
                by: By::Nobody,
            },
        ),
    ]
}

fn fleet_remarks() -> Vec<Remark> {
    let took = |call, planner_ms, fail_policy_ms| Remark::Took {
        call,
        planner_ms,
        fail_policy_ms,
    };
    vec![
        took(0, Some(12.25), None),
        took(1, Some(1000.0), Some(0.1 + 0.2)),
        Remark::Said {
            number: 0,
            message: "it has no plan, \"yet\"\n\u{1f916}".to_owned(),
        },
        took(2, None, None),
    ]
}

fn of_a_fleet(options: TraceOptions) -> Vec<u8> {
    let grid = Grid::new("m", 2, 4, b"we@e..w.".to_vec()).unwrap();
    let header = read(&of_everything()).header.unwrap();
    let header = Header {
        agents: 2,
        movers: 0,
        headings: false,
        progress: false,
        waits: false,
        scene: Scene {
            cells: Some(Cells::new(&grid, 0.5)),
            endpoints: Cells::with_role(&grid, 0.5, Role::Endpoint),
            workstations: Cells::with_role(&grid, 0.5, Role::Workstation),
            profile_of_body: vec![0, 0],
            ..Scene::default()
        },
        ..header
    };
    let mut writer = TraceWriter::with_options(Vec::new(), options);
    writer.begin(&header).unwrap();
    let mut states = StatesDigest::new(2);
    for tick in 0..20u32 {
        let own = |entry: &Entry| entry.tick == u64::from(tick);
        let entries: Vec<Entry> = fleet_entries().into_iter().filter(own).collect();
        writer.journal(&entries).unwrap();
        let remarks = fleet_remarks();
        writer
            .remarks(match tick {
                3 => &remarks[..1],
                9 => &remarks[1..3],
                19 => &remarks[3..],
                _ => &[],
            })
            .unwrap();
        let x = [0.5 + f64::from(tick) / 60.0, 2.5];
        let now = States {
            x_m: &x,
            y_m: &[0.5, 0.5],
            heading_rad: None,
            progress: None,
        };
        states.update(&now);
        writer.state(u64::from(tick), &now).unwrap();
    }
    let summary = Summary {
        ticks: 19,
        simulated_s: 19.0 / 60.0,
        contacts_agent_agent: 0,
        contacts_agent_obstacle: 0,
        nearest_approach_m: None,
        tracking_error_max_m: 0.0,
        tracking_error_mean_m: 0.0,
        states_digest: states.finish(),
        events_digest: EventsDigest::default().finish(),
        trace_digest: Digest(0),
    };
    writer.end(&summary.sealed(&header)).unwrap();
    writer.into_inner()
}

#[test]
fn what_a_fleet_did_comes_back_and_does_not_enter_the_digest() {
    for options in [every(0), every(1), small_groups()] {
        let bytes = of_a_fleet(options);
        let memory = read(&bytes);
        assert_eq!(memory.journal, fleet_entries());
        assert_eq!(memory.remarks, fleet_remarks());
        let scene = memory.header.as_ref().unwrap().scene.clone();
        let cells = |cells: Option<Cells>| cells.unwrap().in_rows().collect::<Vec<_>>();
        assert_eq!(cells(scene.endpoints), [(0, 1, 1), (0, 3, 1)]);
        assert_eq!(cells(scene.workstations), [(0, 0, 1), (1, 2, 1)]);
        let contents = read_trace(&bytes[..], "t").unwrap();
        assert_eq!((contents.entries, contents.remarks), (12, 4));
        let summary = memory.summary.unwrap();
        assert_eq!(
            summary.digest(&memory.header.unwrap()),
            summary.trace_digest
        );
        assert_eq!(summary.events_digest, EventsDigest::default().finish());
    }
}

#[test]
fn who_begins_in_the_middle_knows_the_goals_and_the_call_that_are_open() {
    let bytes = of_a_fleet(small_groups());
    for tick in 0..20 {
        let mut reader = TraceReader::open(Cursor::new(&bytes), "t").unwrap();
        reader.seek(tick).unwrap();
        let mut memory = Memory::default();
        let mut first = None;
        while let Some(frame) = reader.next_frame().unwrap() {
            match frame {
                Frame::State { tick, .. } => first = first.or(Some(tick)),
                Frame::Journal(entries) => memory.journal(entries).unwrap(),
                _ => {}
            }
        }
        // What was told before the group, told again if it was open, comes first.
        let all = fleet_entries();
        let begins = first.unwrap();
        let open_at = |end: u64| {
            let mut standing = Standing::new(2);
            let told = all.iter().filter(|entry| entry.tick < end);
            told.for_each(|entry| standing.note(entry));
            standing
        };
        let mut standing = Standing::new(2);
        let told = memory.journal.iter();
        told.clone()
            .filter(|entry| entry.tick < begins)
            .for_each(|entry| standing.note(entry));
        assert_eq!(standing, open_at(begins), "from tick {tick}");
        let rest: Vec<&Entry> = told.filter(|entry| entry.tick >= begins).collect();
        let expected: Vec<&Entry> = all.iter().filter(|entry| entry.tick >= begins).collect();
        assert_eq!(rest, expected, "from tick {tick}");
    }
    assert_eq!(read(&bytes).journal.len(), fleet_entries().len());
}

#[test]
fn what_a_fleet_cannot_have_done_is_refused() {
    let header = read(&of_a_fleet(every(1))).header.unwrap();
    let writer = || {
        let mut writer = TraceWriter::new(Vec::new(), 1);
        writer.begin(&header).unwrap();
        writer
    };
    let goal = |agent, cell, errand| {
        Happening::Goal(Goal {
            agent,
            number: 0,
            cell,
            errand,
        })
    };
    let errand = Some(Errand {
        task: 0,
        at: 2,
        of: 2,
    });
    let notice = |name: &str| Happening::Notice {
        number: 0,
        call: 0,
        name: name.to_owned(),
        module: "host".to_owned(),
    };
    for what in [
        goal(2, 0, None),
        goal(0, 8, None),
        goal(0, 0, errand),
        Happening::Reached {
            agent: 2,
            number: 0,
        },
        notice(&"n".repeat(256)),
    ] {
        let error = writer().journal(&[Entry { tick: 0, what }]).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::InvalidInput);
    }
    let mut late = writer();
    let asked = |tick| Entry {
        tick,
        what: Happening::Asked { call: 0 },
    };
    late.journal(&[asked(5)]).unwrap();
    assert!(late.journal(&[asked(4)]).is_err());
    let long = "m".repeat(Remark::MOST_TEXT + 1);
    for remark in [
        Remark::Said {
            number: 0,
            message: long,
        },
        Remark::Took {
            call: 0,
            planner_ms: Some(f64::NAN),
            fail_policy_ms: None,
        },
    ] {
        assert!(writer().remarks(&[remark]).is_err());
    }
    // More than a frame can have, in one and in many pieces.
    let many: Vec<Entry> = (0..10_000).map(asked).collect();
    let long = Remark::Said {
        number: 1,
        message: "m".repeat(Remark::MOST_TEXT),
    };
    let mut writer = writer();
    writer.journal(&many[..1]).unwrap();
    writer.journal(&many[1..]).unwrap();
    writer.remarks(&vec![long.clone(); 40]).unwrap();
    writer
        .end(&read(&of_a_fleet(every(1))).summary.unwrap())
        .unwrap();
    let bytes = writer.into_inner();
    let mut memory = Memory::default();
    let reader = TraceReader::open(&bytes[..], "t").unwrap();
    reader.replay(&mut memory).unwrap();
    assert_eq!(memory.journal, many);
    assert_eq!(memory.remarks, vec![long; 40]);
}

/// Offset of the first frame after the bodies.
fn beginning_of_frames(bytes: &[u8]) -> usize {
    let reader = TraceReader::open(bytes, "t").unwrap();
    reader.offset() as usize
}

fn kept_of_damaged(bytes: &[u8]) -> (Memory, fleetyard_sim::trace::TraceContents) {
    let mut memory = Memory::default();
    let reader = TraceReader::open(bytes, "t").unwrap();
    let contents = reader.replay(&mut memory).unwrap();
    (memory, contents)
}

#[test]
fn a_cut_file_gives_what_is_left() {
    for bytes in [
        written(small_groups()).0,
        written(every(5)).0,
        of_everything(),
        of_a_fleet(small_groups()),
    ] {
        let whole = read(&bytes);
        let beginning = beginning_of_frames(&bytes);
        let mut least = 0;
        for length in 0..bytes.len() {
            if length < beginning {
                let error = read_trace(&bytes[..length], "t").unwrap_err();
                assert!(error.hint.is_some(), "{error}");
                continue;
            }
            let (memory, contents) = kept_of_damaged(&bytes[..length]);
            let damage = contents.damage.expect("a cut is damage");
            assert!(damage.reason.contains("ends within"), "{damage}");
            assert!(damage.hint.is_some());
            assert!(contents.intact_bytes <= length as u64);
            assert!(whole.events.starts_with(&memory.events));
            assert!(whole.journal.starts_with(&memory.journal));
            assert!(whole.states.starts_with(&memory.states));
            assert_eq!(contents.states, memory.states.len() as u64);
            let got = contents.states + contents.events;
            assert!(got >= least, "more bytes, less content");
            least = got;
        }
        assert_eq!(least, (whole.states.len() + whole.events.len()) as u64);
    }
}

#[test]
fn every_damaged_byte_is_found() {
    for bytes in [
        written(every(0)).0,
        written(every(9)).0,
        of_everything(),
        of_a_fleet(every(1)),
    ] {
        let whole = read(&bytes);
        let beginning = beginning_of_frames(&bytes);
        for at in 0..bytes.len() {
            for bit in 0..8 {
                let mut bad = bytes.clone();
                bad[at] ^= 1 << bit;
                if at < beginning {
                    // A header may have become one of a kind that is passed over.
                    match read_trace(&bad[..], "t") {
                        Ok(part) => assert!(part.damage.is_some(), "byte {at} went unnoticed"),
                        Err(error) => assert!(error.hint.is_some(), "{error}"),
                    }
                    continue;
                }
                let (memory, contents) = kept_of_damaged(&bad);
                let damage = contents
                    .damage
                    .unwrap_or_else(|| panic!("byte {at} unnoticed"));
                assert!(damage.reason.contains("byte"), "{damage}");
                assert!(whole.events.starts_with(&memory.events));
                assert!(whole.states.starts_with(&memory.states));
            }
        }
    }
}

#[test]
fn exchanged_frames_and_trailing_bytes_are_found() {
    let (bytes, _) = written(every(0));
    let mut longer = bytes.clone();
    longer.push(0);
    let contents = read_trace(&longer[..], "t").unwrap();
    let damage = contents.damage.unwrap();
    assert!(damage.reason.contains("after the end"), "{damage}");
    assert!(contents.end.is_some(), "everything else is there");
    // Leave out the first frame: every frame is fine, the file is not.
    let at = beginning_of_frames(&bytes);
    let length = u32::from_le_bytes(bytes[at + 1..at + 5].try_into().unwrap()) as usize;
    let mut shorter = bytes[..at].to_vec();
    shorter.extend(&bytes[at + 13 + length..]);
    let damage = read_trace(&shorter[..], "t").unwrap().damage.unwrap();
    assert!(damage.reason.contains("missing or exchanged"), "{damage}");
}

#[test]
fn other_versions_and_other_files_are_named() {
    let (mut bytes, _) = written(every(0));
    for (version, hint) in [(1, "again"), (3, "newer release")] {
        bytes[8] = version;
        let error = read_trace(&bytes[..], "t").unwrap_err();
        assert!(
            error.to_string().contains(&format!("version {version}")),
            "{error}"
        );
        assert!(error.hint.unwrap().contains(hint));
    }
    for other in [
        &b""[..],
        b"type octile\nheight 4\n",
        b"\x89PNG\r\n\x1a\n........",
    ] {
        assert!(read_trace(other, "t").unwrap_err().hint.is_some());
    }
}

#[test]
fn states_that_the_header_does_not_announce_are_refused() {
    let header = read(&of_everything()).header.unwrap();
    let mut writer = TraceWriter::new(Vec::new(), 1);
    writer.begin(&header).unwrap();
    let without = States {
        x_m: &[0.0; 3],
        y_m: &[0.0; 3],
        heading_rad: None,
        progress: Some(&[0; 3]),
    };
    let error = writer.state(0, &without).unwrap_err();
    assert_eq!(error.kind(), io::ErrorKind::InvalidInput);
    let mut empty = header;
    empty.scene = Scene::default();
    let error = TraceWriter::new(Vec::new(), 1).begin(&empty).unwrap_err();
    assert!(error.to_string().contains("profile"), "{error}");
}

/// A disk that fills up.
struct Full(usize);

impl io::Write for Full {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if bytes.len() > self.0 {
            return Err(io::Error::from(io::ErrorKind::StorageFull));
        }
        self.0 -= bytes.len();
        Ok(bytes.len())
    }
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[test]
fn a_full_disk_is_an_error() {
    let (grid, plan) = world();
    let length = written(every(1)).0.len();
    for room in [0, 100, length / 2, length - 1] {
        let mut writer = TraceWriter::new(Full(room), 1);
        let error = Simulator::new(&config())
            .on_grid(&grid)
            .run(&plan, &mut writer)
            .unwrap_err();
        assert!(matches!(error, SimError::Trace(_)));
    }
    let mut writer = TraceWriter::new(Full(length), 1);
    assert!(
        Simulator::new(&config())
            .on_grid(&grid)
            .run(&plan, &mut writer)
            .is_ok()
    );
    assert!(
        Simulator::new(&config())
            .on_grid(&grid)
            .run(&plan, &mut NoTrace)
            .is_ok()
    );
}

/// A frame with its check.
fn frame(kind: u8, payload: &[u8]) -> Vec<u8> {
    let mut bytes = vec![kind];
    bytes.extend((payload.len() as u32).to_le_bytes());
    bytes.extend(payload);
    let check = xxh3_64(&bytes);
    bytes.extend(check.to_le_bytes());
    bytes
}

/// A trace up to its states with so many agents in the header, and fewer in the file.
fn beginning(agents: u32, bodies_there: usize) -> Vec<u8> {
    let text = serde_json::to_string(&read(&of_everything()).header.unwrap()).unwrap();
    let text = text.replace("\"agents\":2", &format!("\"agents\":{agents}"));
    let text = text.replace("\"movers\":1", "\"movers\":0");
    let text = text.replace("{\"program\"", "{\"later\":[1,{}],\"program\"");
    let mut bytes = b"\x89FYT\r\n\x1a\n\x02\0\0\0".to_vec();
    bytes.extend(frame(b'H', text.as_bytes()));
    bytes.extend(frame(b'B', &[0; 20].repeat(bodies_there)));
    bytes
}

fn group(tick: u64, ticks: u32, is_key: u8, planes: &[u8]) -> Vec<u8> {
    let mut payload = tick.to_le_bytes().to_vec();
    payload.extend(ticks.to_le_bytes());
    payload.push(is_key);
    payload.extend(zstd::bulk::compress(planes, 1).unwrap());
    frame(b'S', &payload)
}

/// A frame of a journal or of remarks that says that it has so many.
fn rows(kind: u8, flags: u8, count: u32, bytes: &[u8]) -> Vec<u8> {
    let mut payload = vec![flags];
    payload.extend(count.to_le_bytes());
    payload.extend((bytes.len() as u32).to_le_bytes());
    payload.extend(zstd::bulk::compress(bytes, 1).unwrap());
    frame(kind, &payload)
}

#[test]
fn claims_that_nothing_stands_behind_are_refused() {
    // 28 bytes for an agent at a tick.
    let reason = |mut bytes: Vec<u8>, rest: &[u8]| {
        bytes.extend(rest);
        match read_trace(&bytes[..], "t") {
            Ok(contents) => contents.damage.expect("it is cut at the least").reason,
            Err(error) => error.reason,
        }
    };
    let cut = "ends within";
    assert!(reason(beginning(2, 2), b"").contains(cut));
    assert!(reason(beginning(2, 2), &group(0, 1, 1, &[0; 56])).contains(cut));
    let bomb = zstd::bulk::compress(&vec![0; 64 << 20], 19).unwrap();
    assert!(bomb.len() < 10_000);
    let with_bomb = |ticks: u32| {
        let mut payload = 0u64.to_le_bytes().to_vec();
        payload.extend(ticks.to_le_bytes());
        payload.push(1);
        payload.extend(&bomb);
        frame(b'S', &payload)
    };
    for (start, rest, expected) in [
        (beginning(1 << 26, 3), vec![], "one profile per body"),
        (beginning(1 << 31, 3), vec![], "more bodies than"),
        (beginning(0, 0), vec![], "no agents"),
        (beginning(2, 2), with_bomb(1), "cannot be decompressed"),
        (beginning(2, 2), with_bomb(70_000), "cannot be decompressed"),
        (beginning(2, 2), with_bomb(1_200_000), "size of a group"),
        (beginning(2, 2), group(0, 0, 1, &[]), "size of a group"),
        (
            beginning(2, 2),
            group(0, u32::MAX, 1, &[]),
            "size of a group",
        ),
        (beginning(2, 2), group(0, 1, 2, &[0; 56]), "size of a group"),
        (beginning(2, 2), group(0, 1, 1, &[0; 55]), "shorter than"),
        (
            beginning(2, 2),
            group(0, 1, 0, &[0; 56]),
            "needs one before it",
        ),
        (beginning(2, 2), group(5, 1, 1, &[0; 56]), "another tick"),
        (beginning(2, 2), frame(b'S', b"short"), "too short"),
        (beginning(2, 2), frame(b'E', &[0; 4]), "number of events"),
        (
            beginning(2, 2),
            frame(b'E', &[1, 0, 0, 0, 9]),
            "cannot be decompressed",
        ),
        (beginning(2, 2), frame(b'Z', b""), "summary makes no sense"),
        (beginning(2, 2), frame(b'H', b""), "no such kind"),
        (beginning(2, 2), frame(b'Q', b""), "no such kind"),
        (
            beginning(2, 2),
            [&b"Z"[..], &[0xff; 4]].concat(),
            "longer than it can be",
        ),
        (
            beginning(2, 2),
            frame(b'j', b""),
            "flags of entries make no",
        ),
        (
            beginning(2, 2),
            frame(b'j', &[2; 9]),
            "flags of entries make no",
        ),
        (beginning(2, 2), frame(b'r', &[1; 9]), "the remarks make no"),
        // No such agent, one that waits for itself, for nobody there, for too large a number.
        (
            beginning(2, 2),
            rows(b'd', 0, 1, &[0, 2, 0]),
            "an entry makes no",
        ),
        (
            beginning(2, 2),
            rows(b'd', 0, 1, &[0, 1, 3]),
            "an entry makes no",
        ),
        (
            beginning(2, 2),
            rows(b'd', 0, 1, &[0, 1, 4]),
            "an entry makes no",
        ),
        (
            beginning(2, 2),
            rows(b'd', 0, 1, &[0, 1, 0xff, 0xff, 0xff, 0xff, 0xff, 1]),
            "an entry makes no",
        ),
        (
            beginning(2, 2),
            [rows(b'd', 0, 1, &[5, 1, 0]), rows(b'd', 0, 1, &[4, 1, 0])].concat(),
            "not in order",
        ),
        (beginning(2, 2), rows(b'j', 0, 0, &[]), "number of entries"),
        (
            beginning(2, 2),
            rows(b'j', 0, 5000, &vec![0; 15_000]),
            "number of entries",
        ),
        (
            beginning(2, 2),
            rows(b'j', 0, 1, &vec![0; 70_000]),
            "number of entries",
        ),
        // No such agent, no map, trailing bytes, an unknown kind, cut text.
        (
            beginning(2, 2),
            rows(b'j', 0, 1, &[0, 1, 2, 0]),
            "an entry makes no",
        ),
        (
            beginning(2, 2),
            rows(b'j', 0, 1, &[0, 0, 0, 0, 0, 0]),
            "an entry makes no",
        ),
        (
            beginning(2, 2),
            rows(b'j', 0, 1, &[0, 2, 0, 0]),
            "an entry makes no",
        ),
        (
            beginning(2, 2),
            rows(b'j', 0, 1, &[0, 9]),
            "an entry makes no",
        ),
        (
            beginning(2, 2),
            rows(b'r', 0, 1, &[1, 0, 9, b'a']),
            "an entry makes no",
        ),
        (
            beginning(2, 2),
            [
                rows(b'j', 0, 1, &[9, 2, 0]),
                rows(b'j', 1, 1, &[0, 2, 0]),
                rows(b'j', 0, 1, &[8, 2, 1]),
            ]
            .concat(),
            "not in order",
        ),
        // A kind that a later release may add is passed over.
        (beginning(2, 2), frame(b'q', b"whatever"), cut),
        (beginning(2, 2), [&b"q"[..], &[0xff; 4]].concat(), cut),
    ] {
        let got = reason(start, &rest);
        assert!(got.contains(expected), "{got}, not {expected}");
    }
}

//! Robots that keep the headings of a plan: they stay within what their footprints sweep
//! along it, as far inflated as the dependency graph takes them to be, and so pass each
//! other as closely as rectangles can.

use crate::common;
use std::f64::consts::{FRAC_PI_2, PI};
use std::io;

use crate::common::below;
use fleetyard_core::{Knot, TrajectoryPlan};
use fleetyard_sim::motion::{Holonomic, Model, PRESETS, smooth};
use fleetyard_sim::trace::States;
use fleetyard_sim::{Fleet, NoTrace, Policy, Profile, SimConfig, Simulator, Tier, TraceSink};
use fleetyard_world::Footprint;
use rand_chacha::ChaCha8Rng;

/// Looks at every tick whether bodies are within their tolerances of the plan.
struct Watch<'a> {
    plan: &'a TrajectoryPlan,
    model: Model,
    /// Tolerances in terms of the model's.
    slack: f64,
    wrong: Vec<String>,
}

impl Watch<'_> {
    /// True if a pose is near the motion from one knot to the next: at one fraction of it, in place
    /// and heading.
    fn is_near(&self, from: Knot, to: Knot, [x, y, heading]: [f64; 3]) -> bool {
        const ROUNDING: f64 = 1e-7;
        let near = self.slack * self.model.lateral_tolerance_m() + ROUNDING;
        let turned = self.slack * self.model.heading_tolerance_rad() + ROUNDING;
        let (wx, wy) = (to.x_m - from.x_m, to.y_m - from.y_m);
        let (px, py) = (x - from.x_m, y - from.y_m);
        let turn = to.heading_rad.unwrap() - from.heading_rad.unwrap();
        let off = heading - from.heading_rad.unwrap();
        // |p − f·w| ≤ near and |off − f·turn| ≤ turned for one f.
        let (mut low, mut high): (f64, f64) = (0.0, 1.0);
        let (ww, pw) = (wx * wx + wy * wy, px * wx + py * wy);
        let pp = px * px + py * py - near * near;
        if ww > 0.0 {
            let root = pw * pw - ww * pp;
            if root < 0.0 {
                return false;
            }
            low = low.max((pw - root.sqrt()) / ww);
            high = high.min((pw + root.sqrt()) / ww);
        } else if pp > 0.0 {
            return false;
        }
        if turn != 0.0 {
            let ends = [(off - turned) / turn, (off + turned) / turn];
            low = low.max(ends[0].min(ends[1]));
            high = high.min(ends[0].max(ends[1]));
        } else if off.abs() > turned {
            return false;
        }
        low <= high
    }
}

impl TraceSink for Watch<'_> {
    fn state(&mut self, tick: u64, states: &States<'_>) -> io::Result<()> {
        for agent in 0..self.plan.agents() {
            let heading = states.heading_rad.unwrap()[agent];
            let pose = [states.x_m[agent], states.y_m[agent], heading];
            let knots = self.plan.knots(agent);
            let end = knots.get(knots.len() - 1);
            let near = (1..knots.len())
                .any(|to| self.is_near(knots.get(to - 1), knots.get(to), pose))
                || self.is_near(end, end, pose);
            if !near && self.wrong.len() < 3 {
                self.wrong
                    .push(format!("agent {agent} at tick {tick}: {pose:?}"));
            }
        }
        Ok(())
    }
}

/// Two agents a place that drive the same way one after the other: by order the second is
/// released bit by bit.
fn ways(rng: &mut ChaCha8Rng, places: usize) -> TrajectoryPlan {
    let mut plan = TrajectoryPlan::default();
    for place in 0..places {
        let base = 40.0 * place as f64;
        let mut unit = |low: f64, high: f64| low + (high - low) * below(rng, 1001) as f64 / 1000.0;
        let mut middle = Vec::new();
        let (mut x, mut y, mut heading): (f64, f64, f64) = (0.0, 0.0, unit(-PI, PI));
        for _ in 0..9 {
            let kind = unit(0.0, 5.0);
            if kind < 1.0 {
                heading += unit(-2.0, 2.0);
            } else {
                let (length, way) = (unit(0.02, 2.5), unit(-PI, PI));
                let way = if kind < 2.0 {
                    (way / FRAC_PI_2).round() * FRAC_PI_2
                } else {
                    way
                };
                let to = (x + length * libm::cos(way), y + length * libm::sin(way));
                (x, y) = (to.0.clamp(-3.0, 3.0), to.1.clamp(-3.0, 3.0));
                if kind > 3.5 {
                    heading += unit(-2.0, 2.0);
                }
            }
            middle.push((base + x, y, heading));
        }
        let mut path = |first: Option<f64>, last: Option<f64>, begin_s: f64| {
            let mut knots: Vec<(f64, f64, f64)> = Vec::new();
            knots.extend(first.map(|x| (base + x, 0.0, middle[0].2)));
            knots.extend(&middle);
            knots.extend(last.map(|x| (base + x, 0.0, middle[8].2)));
            let mut time_s = 0.0;
            let knots = knots
                .into_iter()
                .enumerate()
                .map(|(at, (x_m, y_m, heading))| {
                    time_s += if at == 1 { begin_s } else { 10.0 };
                    let time_s = if at == 0 { 0.0 } else { time_s };
                    Knot {
                        time_s,
                        x_m,
                        y_m,
                        heading_rad: Some(heading),
                    }
                });
            plan.push_path(knots).expect("a path");
        };
        path(None, Some(9.0), 10.0);
        path(Some(-9.0), None, 1000.0);
    }
    plan
}

/// Those that keep headings, and one that brakes much better ahead than aside.
fn models() -> Vec<(&'static str, Model)> {
    let lopsided = Model::Holonomic(Holonomic {
        max_forward_acceleration_m_per_s2: 4.0,
        max_lateral_acceleration_m_per_s2: 0.5,
        ..Holonomic::default()
    });
    let presets = PRESETS.iter().map(|preset| (preset.name, (preset.model)()));
    presets
        .filter(|(_, model)| model.keeps_headings())
        .chain([("lopsided", lopsided)])
        .collect()
}

fn robots(model: &Model, agents: usize) -> Fleet {
    let footprint = Footprint::Rectangle {
        length_m: 0.7,
        width_m: 0.31,
    };
    let model = *model;
    Fleet::uniform(Profile { footprint, model }, agents).expect("a fleet")
}

#[test]
fn robots_stay_within_what_the_plan_sweeps() {
    for seed in 0..24 {
        let mut rng = common::rng(seed);
        let plan = ways(&mut rng, 6);
        // Round corners are ways like others, for ticks of a twentieth of a second nearly so.
        let (plan, slack) = match seed % 4 {
            3 => (smooth(&plan, 0.06, &|_| 0.38).unwrap(), 1.1),
            _ => (plan, 1.0),
        };
        for (name, model) in models() {
            let mut config = SimConfig {
                policy: Policy::Adg,
                ticks_hz: [60, 20, 240][seed as usize % 3],
                ..SimConfig::default()
            };
            config.disturbance.seed = seed;
            if seed > 2 {
                config.disturbance.delay = "bernoulli:0.3,1s".parse().unwrap();
                config.disturbance.velocity = "0.4,0.1".parse().unwrap();
                config.disturbance.messages = "0s,0.4s,0.2".parse().unwrap();
            }
            let fleet = robots(&model, plan.agents());
            let mut watch = Watch {
                plan: &plan,
                model,
                slack,
                wrong: Vec::new(),
            };
            let outcome = Simulator::new(&config)
                .with_fleet(&fleet)
                .run(&plan, &mut watch)
                .unwrap_or_else(|error| panic!("{name}, seed {seed}: {error}"));
            assert!(
                watch.wrong.is_empty(),
                "{name}, seed {seed}: {:?}",
                watch.wrong
            );
            assert_eq!(outcome.contacts.total(), 0, "{name}, seed {seed}");
            assert_eq!(
                outcome.arrived as usize,
                plan.agents(),
                "{name}, seed {seed}"
            );
        }
    }
}

/// Two ways side by side, in opposite directions and half a metre apart, with headings or without.
fn lanes(headings: bool) -> TrajectoryPlan {
    let mut plan = TrajectoryPlan::default();
    let knot = |time_s: f64, x_m: f64, y_m: f64, heading: f64| Knot {
        time_s,
        x_m,
        y_m,
        heading_rad: headings.then_some(heading),
    };
    plan.push_path([knot(0.0, 0.0, 0.0, 0.0), knot(5.0, 5.0, 0.0, 0.0)])
        .unwrap();
    plan.push_path([knot(0.0, 5.0, 0.5, PI), knot(5.0, 0.0, 0.5, PI)])
        .unwrap();
    plan
}

/// Side by side, each in its lane, the two are never nearer than 0.19 m; the discs around
/// them overlap.
#[test]
fn two_quadrupeds_pass_half_a_metre_apart() {
    let config = SimConfig {
        policy: Policy::Adg,
        ..SimConfig::default()
    };
    let dogs = Fleet::uniform(Profile::preset("go2").unwrap(), 2).unwrap();
    let ahead = [Some(0.0), Some(PI)];
    // A plan on a roadmap says nothing about headings: they keep those of their starts.
    for (plan, headings) in [(lanes(true), &[][..]), (lanes(false), &ahead)] {
        let outcome = Simulator::new(&config)
            .with_fleet(&dogs)
            .facing(headings)
            .run(&plan, &mut NoTrace)
            .unwrap();
        assert_eq!(outcome.contacts.total(), 0);
        // Nobody waits for the other: 5 m take 3 s at 2.5 m/s and 2.5 m/s², backwards 5 s.
        assert!(
            outcome.makespan_s.is_some_and(|makespan| makespan < 3.5),
            "{outcome:?}"
        );
    }
    // Across their lanes they do not get past each other.
    let across = [Some(FRAC_PI_2), Some(FRAC_PI_2)];
    let refused = Simulator::new(&config)
        .with_fleet(&dogs)
        .facing(&across)
        .run(&lanes(false), &mut NoTrace)
        .unwrap_err()
        .to_string();
    assert!(
        refused.starts_with("agents 0 and 1 collide at 2."),
        "{refused}"
    );
    assert!(
        refused.ends_with("of the plan, near (2.500, 0.250) m"),
        "{refused}"
    );
    // Wheels turn to where they drive, whatever headings say: for them discs count.
    let wheels = robots(&"agv".parse().unwrap(), 2);
    let refused = Simulator::new(&config)
        .with_fleet(&wheels)
        .run(&lanes(true), &mut NoTrace);
    assert!(refused.is_err());
}

/// One way through bends, which the second goes behind the first at a distance of its width.
fn at_the_heels(gap_s: f64, radius_m: f64) -> TrajectoryPlan {
    let bends = [(0.0, 0.0), (1.3, 0.2), (2.1, 0.9), (3.4, 1.1), (5.0, 0.8)];
    let mut way = vec![(0.0, bends[0])];
    for pair in bends.windows(2) {
        let (dx, dy) = (pair[1].0 - pair[0].0, pair[1].1 - pair[0].1);
        let time_s = way.last().unwrap().0 + f64::sqrt(dx * dx + dy * dy);
        way.push((time_s, pair[1]));
    }
    let knot = |time_s: f64, (x_m, y_m): (f64, f64)| Knot {
        time_s,
        x_m,
        y_m,
        heading_rad: None,
    };
    let end_s = way.last().unwrap().0;
    let mut plan = TrajectoryPlan::default();
    let first = way.iter().map(|(time_s, at)| knot(*time_s, *at));
    let ahead = knot(
        end_s + 2.0 * radius_m + gap_s,
        (5.0 + 2.0 * radius_m + gap_s, 0.8),
    );
    plan.push_path(first.chain([ahead])).unwrap();
    // Its knots are between those of the first.
    let late_s = 2.0 * radius_m + gap_s;
    let second = way.iter().map(|(time_s, at)| knot(late_s + *time_s, *at));
    plan.push_path([knot(0.0, (-late_s, 0.0))].into_iter().chain(second))
        .unwrap();
    plan
}

#[test]
fn robots_follow_each_other_at_their_heels() {
    // In bends the chord is shorter than the way.
    let plan = at_the_heels(0.05, 0.25);
    for (model, tight) in [("single-integrator", false), ("agv", true)] {
        let profile = Profile {
            footprint: Footprint::Disc { radius_m: 0.25 },
            model: model.parse().unwrap(),
        };
        let fleet = Fleet::uniform(profile, 2).unwrap();
        let config = SimConfig {
            policy: Policy::Adg,
            tight,
            ..SimConfig::default()
        };
        let outcome = Simulator::new(&config)
            .with_fleet(&fleet)
            .run(&plan, &mut NoTrace)
            .unwrap_or_else(|error| panic!("{model}: {error}"));
        assert_eq!(outcome.contacts.total(), 0, "{model}");
        assert_eq!(outcome.arrived, 2, "{model}");
    }
    // By time exact bodies go through every bend, whatever the ticks and the periods are.
    let exact = Profile {
        footprint: Footprint::Disc { radius_m: 0.25 },
        model: "single-integrator".parse().unwrap(),
    };
    let config = SimConfig {
        message_period_s: 0.5,
        ticks_hz: 10,
        until_done: true,
        ..SimConfig::default()
    };
    let outcome = Simulator::new(&config)
        .with_fleet(&Fleet::uniform(exact, 2).unwrap())
        .run(&plan, &mut NoTrace)
        .unwrap();
    assert_eq!(outcome.contacts.total(), 0);
    assert!(outcome.tracking_error_max_m < 1e-9, "{outcome:?}");
}

/// Discs on lanes of their own width: exactly driven they pass each other, with tolerances they
/// need room.
#[test]
fn discs_that_touch_pass_each_other_if_they_are_exact() {
    let knot = |time_s: f64, x_m: f64, y_m: f64| Knot {
        time_s,
        x_m,
        y_m,
        heading_rad: None,
    };
    let mut plan = TrajectoryPlan::default();
    plan.push_path([knot(0.0, 0.0, 0.0), knot(4.0, 4.0, 0.0)])
        .unwrap();
    plan.push_path([knot(0.0, 2.0, 0.5)]).unwrap();
    // Round the corner behind the first, at 0.35 m from centre to centre in time.
    plan.push_path([
        knot(0.0, -0.5, 0.0),
        knot(0.5, 0.0, 0.0),
        knot(1.0, 0.0, 0.5),
    ])
    .unwrap();
    let run = |model: &str, tight: bool, tier: Tier| {
        let profile = Profile {
            footprint: Footprint::Disc { radius_m: 0.25 },
            model: model.parse().unwrap(),
        };
        let fleet = Fleet::uniform(profile, 3).unwrap();
        let config = SimConfig {
            policy: Policy::Adg,
            tight,
            tier,
            ..SimConfig::default()
        };
        let simulator = Simulator::new(&config).with_fleet(&fleet);
        simulator.run(&plan, &mut NoTrace)
    };
    for model in ["single-integrator", "pebble"] {
        let outcome = run(model, false, Tier::Kinematic).unwrap();
        assert_eq!(outcome.contacts.total(), 0, "{model}");
        // Planned are 4 s.
        let makespan_s = outcome.makespan_s.unwrap();
        assert!((3.99..4.2).contains(&makespan_s), "{model}: {makespan_s} s");
        let solved = run(model, false, Tier::Contact).unwrap();
        assert_eq!(solved.arrived, 3, "{model}");
        let makespan_s = solved.makespan_s.unwrap();
        assert!(makespan_s < 5.5, "{model}: {makespan_s} s");
    }
    for (model, room) in [("double-integrator", "11 mm"), ("agv", "22 mm")] {
        let error = run(model, false, Tier::Kinematic).unwrap_err();
        let sentence = error.to_string();
        assert!(sentence.contains(room), "{sentence}");
        assert!(sentence.contains(" pass each other at "), "{sentence}");
        assert!(error.hint().is_some_and(|hint| hint.contains("room")));
        let outcome = run(model, true, Tier::Kinematic).unwrap();
        assert_eq!(outcome.arrived, 3, "{model}");
    }
}

//! Three ways to find contacts agree: the kinematic tier, the event-driven
//! checker, and rapier, which shares no line with either.
//!
//! rapier looks 240 times a second, so it misses contacts that fall between two
//! looks, and says when contacts begin and end to a look. The checker wants an
//! overlap of a micrometre. What only one of them sees must be such a graze.

#[path = "common/rapier_observer.rs"]
mod rapier_observer;

use crate::common;
use std::collections::BTreeMap;

use fleetyard_core::{Grid, GridPlan, Knot, TrajectoryPlan};
use fleetyard_sim::{Fleet, NoTrace, Other, Outcome, Profile, SimConfig, Simulator};
use fleetyard_world::exact::{ContactSearch, Obstacles, Touched, contacts};
use fleetyard_world::{Footprint, Pose, Shape};
use rapier_observer::{CELLS, RapierObserver};

const LOOK_S: f64 = 1.0 / 240.0;
/// A look, and what a micrometre makes on a grazing course: a millimetre of way,
/// which takes up to two milliseconds here.
const GRAZE_S: f64 = LOOK_S + 2e-3;
/// Stands for the end of a contact that does not end.
const NEVER: f64 = 1e12;

type Contacts = BTreeMap<(u32, u32), Vec<(f64, f64)>>;

fn by_rapier(plan: &TrajectoryPlan, shapes: &[&Shape], grid: &Grid) -> Contacts {
    let poses = |look: usize| -> Vec<Pose> {
        let at = |agent| {
            let knot = plan.knots(agent).at(look as f64 * LOOK_S);
            Pose::new(knot.x_m, knot.y_m, knot.heading_rad.unwrap_or(0.0))
        };
        (0..plan.agents()).map(at).collect()
    };
    let mut observer = RapierObserver::new(shapes, &poses(0), Some((grid, 1.0)));
    let mut found = Contacts::new();
    let looks = (plan.horizon_s() / LOOK_S).ceil() as usize + 2;
    for look in 0..looks {
        for (begins, one, two) in observer.step(&poses(look + 1), LOOK_S) {
            let spans = found.entry((one, two)).or_default();
            let now = look as f64 * LOOK_S;
            match spans.last_mut() {
                Some(last) if !begins => last.1 = now,
                _ => spans.push((now, NEVER)),
            }
        }
    }
    found
}

fn by_checker(plan: &TrajectoryPlan, shapes: &[&Shape], grid: &Grid) -> Contacts {
    let cells = Obstacles::cells(grid, 1.0).expect("a valid grid");
    let mut found = Contacts::new();
    for contact in contacts(plan, shapes, &cells, &ContactSearch::default()).contacts {
        let other = match contact.other {
            Touched::Agent(other) => other,
            Touched::Cell(_) => CELLS,
            _ => continue,
        };
        let span = (contact.begin_s, contact.end_s.unwrap_or(NEVER));
        found.entry((contact.agent, other)).or_default().push(span);
    }
    found
}

fn by_kinematic_tier(grid: &Grid, plan: &GridPlan, radius_m: f64) -> Contacts {
    let config = SimConfig {
        radius_m: Some(radius_m),
        max_contacts_kept: usize::MAX,
        overlapping_starts: true,
        ..SimConfig::default()
    };
    let outcome = Simulator::new(&config)
        .on_grid(grid)
        .run(plan, &mut NoTrace)
        .expect("the plan can be executed");
    of_outcome(&outcome)
}

/// The same of robots of several shapes.
fn by_kinematic_tier_of(grid: &Grid, plan: &TrajectoryPlan, fleet: &Fleet) -> Contacts {
    let config = SimConfig {
        max_contacts_kept: usize::MAX,
        overlapping_starts: true,
        ..SimConfig::default()
    };
    let outcome = Simulator::new(&config)
        .on_grid(grid)
        .with_fleet(fleet)
        .run(plan, &mut NoTrace)
        .expect("the plan can be executed");
    of_outcome(&outcome)
}

fn of_outcome(outcome: &Outcome) -> Contacts {
    let mut found = Contacts::new();
    for contact in &outcome.contacts.first {
        let other = match contact.other {
            Other::Agent(other) => other,
            _ => CELLS,
        };
        let span = (contact.begin_s, contact.end_s.unwrap_or(NEVER));
        found.entry((contact.agent, other)).or_default().push(span);
    }
    found
}

/// Every contact of one side that lasts is one of the other, at the same time
/// but for `off_s`.
fn assert_seen(what: &str, those: &Contacts, these: &Contacts, off_s: f64) -> usize {
    let mut compared = 0;
    for (pair, spans) in those {
        let seen = these.get(pair).map_or(&[][..], Vec::as_slice);
        for (begin, end) in spans.iter().filter(|(begin, end)| end - begin > GRAZE_S) {
            compared += 1;
            let is_same = |other: &&(f64, f64)| {
                (other.0 - begin).abs() <= off_s && (other.1 - end).abs() <= off_s
            };
            // A graze in the middle may divide what another sees whole.
            let covers = || {
                let near: Vec<_> = seen.iter().filter(|s| s.1 > *begin && s.0 < *end).collect();
                let gaps = near.windows(2).all(|two| two[1].0 - two[0].1 <= GRAZE_S);
                gaps && near.first().is_some_and(|s| (s.0 - begin).abs() <= off_s)
                    && near.last().is_some_and(|s| (s.1 - end).abs() <= off_s)
            };
            assert!(
                seen.iter().any(|other| is_same(&other)) || covers(),
                "{what}: {pair:?} from {begin} to {end} among {seen:?}"
            );
        }
    }
    compared
}

#[test]
fn three_ways_find_the_same_contacts_in_100_worlds() {
    let mut compared = 0;
    for seed in 0..100 {
        let mut rng = common::rng(seed);
        let grid = common::random_grid(&mut rng, 12, 12, 12);
        let radius_m = [0.3, 0.35, 0.45][(seed % 3) as usize];
        let plan = common::wild_walks(&mut rng, &grid, 16, 12, seed % 2 == 0, 0);
        let shape = Footprint::Disc { radius_m }
            .shape()
            .expect("a valid footprint");
        let shapes = vec![&shape; plan.agents()];
        let motions = TrajectoryPlan::from_grid(&plan, &grid, 1.0, 1.0).expect("a valid plan");

        let tier = by_kinematic_tier(&grid, &plan, radius_m);
        let checker = by_checker(&motions, &shapes, &grid);
        let rapier = by_rapier(&motions, &shapes, &grid);
        let name = format!("seed {seed}");
        compared += assert_seen(&format!("{name}, tier → checker"), &tier, &checker, 2e-3);
        compared += assert_seen(&format!("{name}, checker → tier"), &checker, &tier, 2e-3);
        compared += assert_seen(
            &format!("{name}, checker → rapier"),
            &checker,
            &rapier,
            GRAZE_S,
        );
        compared += assert_seen(
            &format!("{name}, rapier → checker"),
            &rapier,
            &checker,
            GRAZE_S,
        );
    }
    assert!(compared > 5000, "{compared} contacts");
}

/// Rectangles, polygons and discs that turn: the checker, rapier, and the kinematic tier.
#[test]
fn turning_footprints_touch_alike() {
    let mut compared = 0;
    for seed in 500..530 {
        let mut rng = common::rng(seed);
        let grid = common::random_grid(&mut rng, 10, 10, 8);
        let shapes = [
            Footprint::Rectangle {
                length_m: 0.9,
                width_m: 0.4,
            },
            Footprint::Disc { radius_m: 0.3 },
            Footprint::Polygon {
                vertices_m: vec![[0.5, 0.0], [-0.3, 0.35], [-0.3, -0.35]],
            },
        ];
        let exact = |footprint: &Footprint| Profile {
            footprint: footprint.clone(),
            model: "pebble".parse().expect("a model"),
        };
        let profiles = shapes.iter().map(exact).collect();
        let shapes = shapes.map(|footprint| footprint.shape().expect("a valid footprint"));
        let mut plan = TrajectoryPlan::with_capacity(12, 12 * 8);
        let (mut of_agents, mut kinds) = (Vec::new(), Vec::new());
        for _ in 0..12 {
            let mut number = |below: usize| common::below(&mut rng, below) as f64;
            let mut knots = Vec::new();
            for knot in 0..8 {
                knots.push(Knot {
                    time_s: f64::from(knot) * 4.0,
                    x_m: number(1_000_003) * 1e-5,
                    y_m: number(1_000_003) * 1e-5,
                    heading_rad: Some(number(628) * 0.01),
                });
            }
            plan.push_path(knots).expect("a valid path");
            let kind = number(3) as usize;
            of_agents.push(&shapes[kind]);
            kinds.push(kind as u32);
        }
        let fleet = Fleet::new(profiles, kinds).expect("a fleet");
        let tier = by_kinematic_tier_of(&grid, &plan, &fleet);
        let checker = by_checker(&plan, &of_agents, &grid);
        let rapier = by_rapier(&plan, &of_agents, &grid);
        let name = format!("seed {seed}");
        compared += assert_seen(
            &format!("{name}, checker → rapier"),
            &checker,
            &rapier,
            GRAZE_S,
        );
        compared += assert_seen(
            &format!("{name}, rapier → checker"),
            &rapier,
            &checker,
            GRAZE_S,
        );
        for (what, those, these) in [
            ("tier → checker", &tier, &checker),
            ("checker → tier", &checker, &tier),
        ] {
            compared += assert_seen(&format!("{name}, {what}"), those, these, 2e-3);
        }
    }
    assert!(compared > 2000, "{compared} contacts");
}

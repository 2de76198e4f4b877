//! The planner `cbs-mp`: teams of several sizes keep clear of everything, and plans get cheaper as roadmaps grow.

use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_plane::obstacles::Obstacles;
use fleetyard_plugin_plane::prioritised::{Disc, World};
use fleetyard_plugin_plane::tangent::Tangents;
use fleetyard_plugin_plane::timing::Stop;
use fleetyard_plugin_roadmap::growing::{Control, End, Figures, Settings, plan};
use proptest::prelude::*;

use crate::plane::teams::{discs, judge, polygons, world};

const SETTINGS: Settings = Settings {
    vertices: 40,
    clearance: 0.0,
    anytime: true,
    memory: 1 << 26,
    seed: 1,
};

/// The end, and the plans that were told of.
fn planned(
    world: &World,
    discs: &[Disc],
    settings: Settings,
    nodes: u64,
) -> (End, Figures, Vec<Vec<Vec<Stop>>>) {
    let mut told = Vec::new();
    let mut control = Control {
        stop: &mut || false,
        nodes,
        made: 0,
    };
    let (end, figures) = plan(world, discs, settings, &mut control, &mut |plans| {
        told.push(plans.to_vec());
    });
    assert!(control.made <= nodes);
    (end, figures, told)
}

fn cost(plans: &[Vec<Stop>]) -> f64 {
    let arrivals = plans.iter().map(|stops| stops[stops.len() - 1].arrival);
    arrivals.sum()
}

/// Seconds that a disc needs alone.
fn alone(world: &World, disc: &Disc) -> Option<f64> {
    let obstacles = Obstacles::new(world.polygons.clone(), world.bounds, disc.radius);
    let way = Tangents::new(&obstacles).shortest(disc.start, disc.goal, &mut || false);
    way.map(|way| way.length / disc.speed)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(8))]

    #[test]
    fn every_plan_keeps_clear_and_is_cheaper_than_the_one_before(discs in discs(), seed in 0..3_u64) {
        let world = world(polygons());
        let settings = Settings {
            clearance: if seed == 2 { 0.01 } else { 0.0 },
            seed,
            ..SETTINGS
        };
        let found = planned(&world, &discs, settings, 250);
        prop_assert_eq!(&found, &planned(&world, &discs, settings, 250));
        let (end, figures, told) = found;
        let least: Option<f64> = discs.iter().map(|disc| alone(&world, disc)).sum();
        match end {
            End::Solved => {
                let least = least.expect("who has a plan has a way");
                let mut before = f64::INFINITY;
                for plans in &told {
                    judge(&world, &discs, plans)?;
                    let now = cost(plans);
                    prop_assert!(now < before && now >= least * (1.0 - 1e-9));
                    before = now;
                }
                prop_assert_eq!(figures.first_cost, cost(&told[0]));
                // One disc alone has its way from the beginning.
                prop_assert!(discs.len() > 1 || before <= least * 1.004);
            }
            End::NoWay(disc) => prop_assert!(alone(&world, &discs[disc]).is_none()),
            End::Spent | End::Grown => prop_assert!(discs.len() > 1 && told.is_empty()),
        }
    }
}

/// A large slow disc and four small fast ones cross: each kind goes on roadmaps of its own, and plans on larger ones cost less.
#[test]
fn kinds_of_discs_have_roadmaps_of_their_own() {
    let disc = |radius: f64, speed: f64, start: (f64, f64), goal: (f64, f64)| Disc {
        radius,
        speed,
        start: Vector::new(start.0, start.1),
        goal: Vector::new(goal.0, goal.1),
    };
    let team = [
        disc(0.5, 0.5, (1.0, 5.0), (7.0, 5.0)),
        disc(0.15, 1.0, (7.5, 5.0), (1.0, 3.0)),
        disc(0.15, 1.0, (7.5, 4.5), (0.5, 5.0)),
        disc(0.15, 1.0, (3.0, 3.0), (5.0, 1.0)),
        disc(0.15, 1.0, (5.0, 2.6), (3.0, 5.0)),
    ];
    let world = world(polygons());
    let (end, figures, told) = planned(&world, &team, SETTINGS, 1000);
    assert_eq!(end, End::Solved);
    for plans in &told {
        judge(&world, &team, plans).unwrap();
    }
    assert!(figures.growths > 1, "{figures:?}");
    let (first, last) = (cost(&told[0]), cost(&told[told.len() - 1]));
    assert!(told.len() > 1 && last < first, "{first} s, then {last} s");
    // The first plan is enough, if that is asked for.
    let quick = Settings {
        anytime: false,
        ..SETTINGS
    };
    let (end, _, only) = planned(&world, &team, quick, 1000);
    assert_eq!((end, only.len()), (End::Solved, 1));
    assert_eq!(only[0], told[0]);
    // Two that cross have the best plan of their roadmaps.
    let (end, figures, _) = planned(&world, &team[1..3], SETTINGS, 300);
    assert!(end == End::Solved && figures.optimal > 0, "{figures:?}");
}

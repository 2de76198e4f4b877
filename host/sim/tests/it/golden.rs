//! Golden digests of a dozen worlds: the same bits in every run, in every build and
//! on any number of threads. `scripts/determinism.sh` runs them in debug and release,
//! for the processor at hand, and on 32-bit and WebAssembly targets.
//!
//! A change of any of these constants means that executions of the past can no
//! longer be compared with those of today; it needs a note in the changelog and,
//! if what is hashed changes, a new version in the domain string of the trace digest.

use crate::common;
use std::collections::BTreeSet;

use fleetyard_core::{Grid, GridPlan, Knot, TrajectoryPlan};
use fleetyard_sim::{Fleet, NoTrace, Plan, Policy, Profile, SimConfig, Simulator, Tier};
use fleetyard_world::{Footprint, Mover, Polygon, Pose, Workspace};

/// Something to execute.
struct World {
    grid: Option<Grid>,
    workspace: Option<Workspace>,
    fleet: Option<Fleet>,
    plan: OwnedPlan,
    config: SimConfig,
}

enum OwnedPlan {
    Grid(GridPlan),
    Trajectories(TrajectoryPlan),
}

impl World {
    fn on_grid(grid: Grid, plan: GridPlan) -> Self {
        Self {
            grid: Some(grid),
            workspace: None,
            fleet: None,
            plan: OwnedPlan::Grid(plan),
            config: SimConfig {
                overlapping_starts: true,
                ..SimConfig::default()
            },
        }
    }

    fn digest(&self, threads: usize) -> String {
        let config = SimConfig {
            threads,
            ..self.config.clone()
        };
        let mut simulator = Simulator::new(&config);
        if let Some(grid) = &self.grid {
            simulator = simulator.on_grid(grid);
        }
        if let Some(workspace) = &self.workspace {
            simulator = simulator.in_workspace(workspace);
        }
        if let Some(fleet) = &self.fleet {
            simulator = simulator.with_fleet(fleet);
        }
        let plan = match &self.plan {
            OwnedPlan::Grid(plan) => Plan::Grid(plan),
            OwnedPlan::Trajectories(plan) => Plan::Trajectories(plan),
        };
        let outcome = simulator.run(plan, &mut NoTrace).expect("can be executed");
        outcome.trace_digest.to_string()
    }
}

fn discs(model: &str, agents: usize) -> Fleet {
    let profile = Profile {
        footprint: Footprint::Disc { radius_m: 0.3 },
        model: model.parse().expect("a model"),
    };
    Fleet::uniform(profile, agents).expect("a fleet")
}

fn valid() -> World {
    let mut rng = common::rng(1);
    let grid = common::random_grid(&mut rng, 16, 16, 20);
    let plan = common::valid_walks(&mut rng, &grid, 60, 25);
    World::on_grid(grid, plan)
}

fn collisions() -> World {
    let mut rng = common::rng(2);
    let grid = common::random_grid(&mut rng, 11, 17, 10);
    let plan = common::wild_walks(&mut rng, &grid, 30, 25, false, 0);
    let mut world = World::on_grid(grid, plan);
    world.config.cell_size_m = 0.37;
    world.config.step_s = 0.731;
    world.config.radius_m = Some(0.17);
    world
}

fn teleports() -> World {
    let mut rng = common::rng(3);
    let grid = common::random_grid(&mut rng, 20, 9, 25);
    let plan = common::wild_walks(&mut rng, &grid, 20, 25, true, 10);
    World::on_grid(grid, plan)
}

/// Many chunks of agents.
fn crowd() -> World {
    let mut rng = common::rng(4);
    let grid = common::random_grid(&mut rng, 60, 60, 10);
    let plan = common::valid_walks(&mut rng, &grid, 700, 12);
    World::on_grid(grid, plan)
}

fn driven(model: &str, policy: Policy) -> World {
    let mut rng = common::rng(5);
    let grid = common::random_grid(&mut rng, 24, 24, 15);
    let plan = common::valid_drives(&mut rng, &grid, 150, 15);
    let mut world = World::on_grid(grid, plan);
    world.fleet = Some(discs(model, 150));
    world.config.policy = policy;
    world
}

fn disturbed(model: &str, delay: &str) -> World {
    let mut world = driven(model, Policy::Adg);
    let disturbance = &mut world.config.disturbance;
    disturbance.seed = 99;
    disturbance.delay = delay.parse().expect("a delay");
    disturbance.velocity = "0.2,0.2".parse().expect("a noise");
    disturbance.messages = "0s,0.4s,0.2".parse().expect("messages");
    world
}

fn mixed_fleet() -> World {
    let mut world = driven("agv", Policy::Time);
    world.config.until_done = true;
    world.config.time_limit_s = Some(60.0);
    world.config.cell_size_m = 1.5;
    let names = ["agv", "go2", "waypoint-law", "unicycle-2", "rotation"];
    let profiles = names.iter().map(|name| {
        Profile::preset(name).unwrap_or_else(|_| Profile {
            footprint: Footprint::Polygon {
                vertices_m: vec![[0.0, 0.0], [0.8, 0.1], [0.5, 0.6]],
            },
            model: name.parse().expect("a model"),
        })
    });
    let of_agent = (0..150).map(|agent| agent % 5).collect();
    world.fleet = Some(Fleet::new(profiles.collect(), of_agent).expect("a fleet"));
    world
}

/// Rectangles and discs among polygons, and an obstacle that comes across.
fn in_the_plane() -> World {
    let mut rng = common::rng(6);
    let mut plan = TrajectoryPlan::default();
    for _ in 0..40 {
        let mut unit = || common::below(&mut rng, 1000) as f64 / 1000.0;
        let knots: Vec<Knot> = (0..12)
            .map(|knot| Knot {
                time_s: f64::from(knot) * 1.3,
                x_m: 1.0 + 18.0 * unit(),
                y_m: 1.0 + 18.0 * unit(),
                heading_rad: Some(6.0 * unit()),
            })
            .collect();
        plan.push_path(knots).expect("a plan");
    }
    let profiles = [
        Footprint::Rectangle {
            length_m: 0.9,
            width_m: 0.4,
        },
        Footprint::Disc { radius_m: 0.3 },
    ]
    .map(|footprint| Profile {
        footprint,
        model: "pebble".parse().expect("a model"),
    });
    let of_agent = (0..40).map(|agent| agent % 2).collect();
    let across = [
        (2.0, Pose::new(0.0, 10.0, 0.0)),
        (14.0, Pose::new(20.0, 11.0, 3.0)),
    ];
    let workspace = Workspace {
        name: "polygons".to_owned(),
        bounds: fleetyard_world::Bounds {
            min: [0.0, 0.0],
            max: [20.0, 20.0],
        },
        boundary: None,
        obstacles: vec![
            Polygon::new(&[[4.0, 4.0], [7.0, 4.5], [5.0, 5.0], [4.5, 8.0]]).expect("a polygon"),
            Polygon::rectangle([14.0, 12.0], [3.0, 1.0], 0.5).expect("a polygon"),
        ],
        movers: vec![Mover::new(Footprint::Disc { radius_m: 1.0 }, &across).expect("a mover")],
    };
    World {
        grid: None,
        workspace: Some(workspace),
        fleet: Some(Fleet::new(profiles.to_vec(), of_agent).expect("a fleet")),
        plan: OwnedPlan::Trajectories(plan),
        config: SimConfig {
            overlapping_starts: true,
            ..SimConfig::default()
        },
    }
}

fn pushing(mut world: World) -> World {
    world.config.tier = Tier::Contact;
    world
}

type Case = (&'static str, fn() -> World, &'static str);

const WORLDS: &[Case] = &[
    ("valid plan", valid, "0e11fc11c59a491bb2704891405affe6"),
    (
        "collisions, odd parameters",
        collisions,
        "e3a37496d9768b74e37dec7de91e9525",
    ),
    (
        "teleports through walls",
        teleports,
        "7bfdaed548ea4168fcf13d13df407c9e",
    ),
    ("crowd", crowd, "a3f4827c967c093b94d1d881b8c19218"),
    (
        "differential drives by time",
        || driven("agv", Policy::Time),
        "90fbf4e0d332ee5f751f05aafee4c55f",
    ),
    (
        "differential drives by order",
        || driven("agv", Policy::Adg),
        "a0cff36455b73be379e17fa10f8494e9",
    ),
    (
        "disturbed, bernoulli",
        || disturbed("agv", "bernoulli:0.2,3s"),
        "a8b064489a1219099ec0b4be69e98724",
    ),
    (
        "disturbed, gaussian",
        || disturbed("holonomic", "gaussian:0.5s,0.5s"),
        "4525ceb166ca02c8716b8a2ce39e7b62",
    ),
    (
        "disturbed, bursts",
        || disturbed("unicycle-1", "bursts:0.05,4s"),
        "a834fb914198547da425ac39ae4ed9b6",
    ),
    (
        "disturbed pebbles",
        || disturbed("pebble", "uniform:0s,2s"),
        "b99e887a4aeb457ef8e9579ba23a43f5",
    ),
    (
        "mixed fleet by time",
        mixed_fleet,
        "65a6467feee3198c5d65797af613a63e",
    ),
    (
        "trajectories among polygons",
        in_the_plane,
        "f96b8fdea3edbb3ea3d46801d23bcf99",
    ),
    (
        "contact tier, valid plan",
        || pushing(valid()),
        "a98d0d306427487c5185c6a288b14782",
    ),
    (
        "contact tier, collisions",
        || pushing(collisions()),
        "2a1f1978b4b323db3205cbd3622958c7",
    ),
    (
        "contact tier, mixed fleet",
        || pushing(mixed_fleet()),
        "35baa5335990693adb7b928d6ad0a8b9",
    ),
    (
        "contact tier, by order",
        || pushing(driven("agv", Policy::Adg)),
        "9ce941ce564ef3fcd3630e9a24c899bd",
    ),
];

/// Numbers of threads that a target can have.
fn thread_counts() -> &'static [usize] {
    if cfg!(target_family = "wasm") {
        &[1]
    } else {
        &[1, 2, 3, 8]
    }
}

#[test]
fn digests_do_not_change() {
    let mut wrong = Vec::new();
    for (name, world, golden) in WORLDS {
        let world = world();
        for threads in thread_counts() {
            let digest = world.digest(*threads);
            if digest != *golden {
                wrong.push(format!("(\"{name}\", \"{digest}\") on {threads}"));
            }
        }
    }
    assert!(wrong.is_empty(), "other digests than before: {wrong:#?}");
}

#[test]
fn everything_that_matters_changes_the_digest() {
    let mut rng = common::rng(4);
    let grid = common::random_grid(&mut rng, 10, 10, 10);
    let plan = common::wild_walks(&mut rng, &grid, 10, 10, false, 0);
    let original = plan.clone();
    let base = World::on_grid(grid, plan);
    let digest = |config: &SimConfig, plan: Option<GridPlan>| {
        let world = World {
            grid: base.grid.clone(),
            plan: OwnedPlan::Grid(plan.unwrap_or_else(|| original.clone())),
            config: config.clone(),
            workspace: None,
            fleet: None,
        };
        world.digest(1)
    };
    let with = |change: fn(&mut SimConfig)| {
        let mut config = base.config.clone();
        change(&mut config);
        config
    };
    let configs = [
        base.config.clone(),
        with(|config| config.radius_m = Some(0.3)),
        with(|config| config.step_s = 2.0),
        with(|config| config.substeps = 5),
        with(|config| config.tier = Tier::Contact),
        with(|config| config.every_substep = true),
        with(|config| config.max_speed_cells_per_step = 2.0),
        with(|config| config.disturbance.seed = 1),
        with(|config| config.message_period_s = 0.2),
    ];
    let mut seen: BTreeSet<String> = configs.iter().map(|config| digest(config, None)).collect();
    let other = common::wild_walks(
        &mut rng,
        base.grid.as_ref().expect("a map"),
        10,
        10,
        false,
        0,
    );
    seen.insert(digest(&base.config, Some(other)));
    assert_eq!(seen.len(), configs.len() + 1);
    // What is only kept, not done, changes nothing.
    let less = with(|config| config.max_contacts_kept = 0);
    assert_eq!(digest(&less, None), digest(&base.config, None));
}

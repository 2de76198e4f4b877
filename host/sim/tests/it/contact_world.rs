//! The contact tier obeys mechanics, and does so reproducibly.

use crate::common;
use fleetyard_core::Grid;
use fleetyard_sim::contact::{
    Agent, ContactError, ContactEvent, ContactWorld, Drive, Mass, Material, Settings, Twist,
};
use fleetyard_sim::{EventKind, Other};
use fleetyard_world::{Bounds, Footprint, Mover, Polygon, Pose};

const DT: f64 = 1.0 / 60.0;
const DRIVE: Drive = Drive {
    acceleration: 2.0,
    lateral: None,
    angular: 4.0,
};
const SLIPPERY: Material = Material {
    friction: 0.0,
    restitution: 0.0,
};

fn world() -> ContactWorld {
    let walls = SLIPPERY;
    ContactWorld::new(Settings {
        walls,
        ..Settings::default()
    })
    .expect("valid settings")
}

fn disc(radius_m: f64) -> Footprint {
    Footprint::Disc { radius_m }
}

fn add(world: &mut ContactWorld, footprint: &Footprint, pose: Pose, mass: f64, drive: Drive) {
    add_moving(world, footprint, pose, mass, drive, Twist::default());
}

fn add_moving(
    world: &mut ContactWorld,
    footprint: &Footprint,
    pose: Pose,
    mass: f64,
    drive: Drive,
    velocity: Twist,
) {
    let shape = footprint.shape().expect("a valid footprint");
    world
        .add_agent(&Agent {
            shape: &shape,
            pose,
            velocity,
            mass: Mass::Total(mass),
            drive,
            material: SLIPPERY,
        })
        .expect("a valid agent");
}

fn along(vx: f64) -> Twist {
    Twist {
        vx,
        ..Twist::default()
    }
}

fn steps(world: &mut ContactWorld, commands: &[Twist], ticks: usize) {
    for _ in 0..ticks {
        world.step(commands, DT).expect("a finite step");
    }
}

fn corridor(length: u32) -> Grid {
    let rows = [b'@', b'.', b'@'];
    let terrain = rows
        .iter()
        .flat_map(|row| (0..length).map(move |col| if col + 1 == length { b'@' } else { *row }));
    Grid::new("corridor", 3, length, terrain.collect()).expect("a valid map")
}

/// With nothing in the way: the velocity asked for at the end of every tick that
/// does not ask for too much, and the way of a body whose velocity changes in
/// equal steps, one per substep.
#[test]
fn free_driving_is_exact() {
    let mut world = world();
    add(&mut world, &disc(0.3), Pose::at(0.0, 0.0), 40.0, DRIVE);
    let (mut x, mut v) = (0.0, 0.0f64);
    for tick in 0..240 {
        let wanted = match tick {
            0..60 => (v + DRIVE.acceleration * DT).min(2.0),
            60..120 => 2.0,
            _ => (v - 0.7 * DRIVE.acceleration * DT).max(0.0),
        };
        let turn = 0.5 * (f64::from(tick) * 0.05);
        let omega = turn.min(DRIVE.angular * DT * f64::from(tick + 1)).min(0.7);
        let command = Twist {
            omega,
            ..along(wanted)
        };
        world.step(&[command], DT).expect("a finite step");
        for substep in 1..=4 {
            x += (v + (wanted - v) * f64::from(substep) / 4.0) * DT / 4.0;
        }
        v = wanted;
        let (pose, velocity) = (world.pose(0), world.velocity(0));
        assert!((pose.x - x).abs() < 1e-9, "tick {tick}: {} not {x}", pose.x);
        assert!(pose.y.abs() < 1e-9);
        assert!((velocity.vx - v).abs() < 1e-9, "tick {tick}: {velocity:?}");
        assert!((velocity.omega - omega).abs() < 1e-9, "tick {tick}");
    }
    assert_eq!(world.drain_events().count(), 0);
}

/// A kinematic body that takes on the new velocity at the beginning of a tick is
/// ahead by 3/8 of a tick's change, and level again when it stands.
#[test]
fn free_driving_is_near_the_kinematic_motion() {
    let mut world = world();
    add(&mut world, &disc(0.3), Pose::at(0.0, 0.0), 40.0, DRIVE);
    let (mut x, mut v, mut most) = (0.0, 0.0f64, 0.0f64);
    for tick in 0..180 {
        let change = DRIVE.acceleration * DT;
        v = if tick < 90 {
            (v + change).min(2.0)
        } else {
            (v - change).max(0.0)
        };
        x += v * DT;
        world.step(&[along(v)], DT).expect("a finite step");
        most = most.max((world.pose(0).x - x).abs());
    }
    assert!(most <= 2.0 * DT * 0.375 + 1e-9, "{most} m apart");
    assert!((world.pose(0).x - x).abs() < 1e-9, "level at rest");
}

/// A velocity that cannot be had at once comes at the greatest acceleration.
#[test]
fn drives_are_bounded() {
    let mut world = world();
    add(&mut world, &disc(0.3), Pose::at(0.0, 0.0), 40.0, DRIVE);
    let command = Twist {
        vx: 30.0,
        vy: 40.0,
        omega: 100.0,
    };
    steps(&mut world, &[command], 30);
    let velocity = world.velocity(0);
    assert!((velocity.vx - 0.6 * 2.0 * 0.5).abs() < 1e-9, "{velocity:?}");
    assert!((velocity.vy - 0.8 * 2.0 * 0.5).abs() < 1e-9);
    assert!((velocity.omega - 4.0 * 0.5).abs() < 1e-9);
    // Headings are not wrapped.
    steps(&mut world, &[command], 600);
    let turned = 0.5 * 4.0 * (630.0 * DT) * (630.0 * DT);
    assert!((world.pose(0).heading - turned).abs() < 0.02 * turned);
}

/// Robots without a drive to speak of.
#[test]
fn collisions_keep_momentum() {
    let idle = Drive {
        acceleration: 1e-12,
        lateral: None,
        angular: 1e-12,
    };
    for (heavy, light) in [(50.0, 50.0), (400.0, 10.0), (10.0, 400.0)] {
        let mut world = world();
        let pose = Pose::at(0.0, 0.0);
        add_moving(&mut world, &disc(0.3), pose, heavy, idle, along(1.0));
        add(&mut world, &disc(0.3), Pose::at(1.6, 0.0), light, idle);
        steps(&mut world, &[along(0.0), along(0.0)], 90);
        let (a, b) = (world.velocity(0).vx, world.velocity(1).vx);
        let after = heavy * a + light * b;
        assert!(
            (after - heavy).abs() < 1e-9 * heavy,
            "{heavy} N s became {after}"
        );
        // Nothing bounces.
        let common = heavy / (heavy + light);
        assert!(
            (a - common).abs() < 0.01 * common,
            "{a} and {b}, not {common}"
        );
        assert!(
            (b - common).abs() < 0.01 * common,
            "{a} and {b}, not {common}"
        );
    }
}

/// Both exert all they have: what is left accelerates both masses.
#[test]
fn a_heavy_robot_pushes_a_light_one() {
    let mut world = world();
    add(&mut world, &disc(0.3), Pose::at(0.0, 0.0), 100.0, DRIVE);
    add(&mut world, &disc(0.3), Pose::at(0.6, 0.0), 25.0, DRIVE);
    steps(&mut world, &[along(10.0), along(0.0)], 60);
    let v = world.velocity(1).vx;
    let expected = (100.0 - 25.0) * 2.0 / 125.0;
    assert!(
        (v - expected).abs() < 0.02 * expected,
        "{v} m/s, not {expected}"
    );

    // The other way around nothing moves, once the brakes have answered.
    for (pusher, pushed) in [(45.0, 50.0), (25.0, 100.0)] {
        let mut world = self::world();
        add(&mut world, &disc(0.3), Pose::at(0.0, 0.0), pusher, DRIVE);
        add(&mut world, &disc(0.3), Pose::at(0.6, 0.0), pushed, DRIVE);
        steps(&mut world, &[along(10.0), along(0.0)], 120);
        let moved = world.pose(1).x - 0.6;
        assert!(
            moved.abs() < 2e-3,
            "{pusher} kg moved {pushed} kg by {moved} m"
        );
    }
}

#[test]
fn a_blocked_robot_draws_a_bounded_force() {
    let mut world = world();
    world.add_grid(&corridor(5), 1.0).expect("a valid grid");
    add(&mut world, &disc(0.35), Pose::at(3.5, 1.5), 60.0, DRIVE);
    let mut most = 0.0f64;
    for _ in 0..600 {
        world.step(&[along(2.0)], DT).expect("a finite step");
        let ([x, y], _) = world.effort(0);
        most = most.max((x * x + y * y).sqrt());
    }
    assert!(most <= 120.0 * (1.0 + 1e-12), "{most} N");
    assert!(
        (world.effort(0).0[0] - 120.0).abs() < 1e-9,
        "it still pushes"
    );
    let depth = world.pose(0).x + 0.35 - 4.0;
    assert!(depth.abs() < 1e-3, "{depth} m in the wall");
    assert!(world.velocity(0).vx.abs() < 1e-3);
}

/// Twelve robots press into a dead end, which is a load of twelve drives on the
/// wall: nobody is more than 5 mm in a wall or in another robot.
#[test]
fn a_jam_stays_between_its_walls() {
    let mut world = world();
    world.add_grid(&corridor(14), 1.0).expect("a valid grid");
    let radius = 0.4;
    for agent in 0..12 {
        let y = if agent % 2 == 0 { 1.45 } else { 1.55 };
        let pose = Pose::at(0.5 + f64::from(agent), y);
        add(&mut world, &disc(radius), pose, 50.0, DRIVE);
    }
    let commands = [along(1.5); 12];
    let (mut in_wall, mut in_robot) = (0.0f64, 0.0f64);
    for _ in 0..900 {
        world.step(&commands, DT).expect("a finite step");
        for agent in 0..12 {
            let pose = world.pose(agent);
            in_wall = in_wall.max(pose.x + radius - 13.0);
            in_wall = in_wall.max((pose.y - 1.5).abs() + radius - 0.5);
            if agent > 0 {
                let before = world.pose(agent - 1);
                let (dx, dy) = (pose.x - before.x, pose.y - before.y);
                in_robot = in_robot.max(2.0 * radius - (dx * dx + dy * dy).sqrt());
            }
        }
    }
    assert!(in_wall < 5e-3, "{in_wall} m in a wall");
    assert!(in_robot < 5e-3, "{in_robot} m in a robot");
    assert!(
        (0..12).all(|agent| world.velocity(agent).vx.abs() < 0.01),
        "jammed"
    );
    let events: Vec<ContactEvent> = world.drain_events().collect();
    let begun = |agent, other| {
        let is = |e: &&ContactEvent| e.agent == agent && e.other == other;
        let last = events.iter().rfind(is).map(|event| event.kind);
        last == Some(EventKind::Begin)
    };
    for agent in 0..11 {
        assert!(
            begun(agent, Other::Agent(agent + 1)),
            "{agent} pushes the next"
        );
    }
    assert!(begun(11, Other::Obstacle { cell: 14 + 13 }), "{events:?}");
}

#[test]
fn a_moving_obstacle_pushes_a_robot() {
    let mut world = world();
    let door = Footprint::Rectangle {
        length_m: 0.2,
        width_m: 2.0,
    };
    let path = [(1.0, Pose::at(0.0, 0.0)), (3.0, Pose::at(2.0, 0.0))];
    let door = Mover::new(door, &path).expect("a valid mover");
    assert_eq!(world.add_mover(&door), Ok(0));
    add(&mut world, &disc(0.3), Pose::at(0.9, 0.1), 60.0, DRIVE);
    steps(&mut world, &[along(0.0)], 60);
    assert_eq!(world.drain_events().count(), 0, "it has not moved yet");
    steps(&mut world, &[along(0.0)], 240);
    let x = world.pose(0).x;
    // Its brakes stop it within v²/2a of where the door lets it go.
    assert!(
        (2.4 - 1e-3..2.4 + 0.25 + 0.02).contains(&x),
        "pushed to {x}"
    );
    let events: Vec<ContactEvent> = world.drain_events().collect();
    assert_eq!(events[0].other, Other::Mover(0));
    assert_eq!(events[0].kind, EventKind::Begin);
    // 0.9 − 0.3 − 0.1 m at 1 m/s from second 1 on.
    assert!((88..=91).contains(&events[0].tick), "{events:?}");
    assert_eq!(events.last().map(|event| event.kind), Some(EventKind::End));
}

/// A door that turns sweeps with its whole length.
#[test]
fn a_turning_obstacle_pushes_a_robot() {
    let mut world = world();
    let arm = Footprint::Rectangle {
        length_m: 4.0,
        width_m: 0.2,
    };
    let path = [
        (0.0, Pose::new(0.0, 0.0, 0.0)),
        (4.0, Pose::new(0.0, 0.0, std::f64::consts::PI)),
    ];
    let arm = Mover::new(arm, &path).expect("a valid mover");
    world.add_mover(&arm).expect("a valid mover");
    add(&mut world, &disc(0.2), Pose::at(1.0, 0.5), 20.0, DRIVE);
    steps(&mut world, &[along(0.0)], 96);
    let pose = world.pose(0);
    let (sin, cos) = libm::sincos(96.0 * DT * std::f64::consts::FRAC_PI_4);
    let distance = pose.y * cos - pose.x * sin;
    assert!(
        (distance - 0.3).abs() < 2e-3,
        "{distance} m from the middle of the arm"
    );
    assert!(pose.x < 0.3 && pose.y > 1.7, "{pose:?}");
}

/// Thin walls, small and fast robots, straight on and at a slant, cells,
/// polygons and borders: nobody comes through.
#[test]
fn nothing_tunnels() {
    let thin = Polygon::rectangle([2.0, 0.0], [0.1, 8.0], 0.0).expect("a valid wall");
    let cells: Vec<u8> = (0..50 * 21)
        .map(|at| if at % 50 == 20 { b'@' } else { b'.' })
        .collect();
    let cells = Grid::new("thin", 21, 50, cells).expect("a valid map");
    let fast = Drive {
        acceleration: 20.0,
        ..DRIVE
    };
    for radius in [0.05, 0.1, 0.35] {
        for (speed, drive) in [(2.0, DRIVE), (2.0, fast), (12.0, fast)] {
            for slant in [0.0, 0.4] {
                for kind in 0..3 {
                    let mut world = world();
                    let y = match kind {
                        0 => {
                            world.add_obstacle(&thin).expect("a valid obstacle");
                            0.0
                        }
                        1 => {
                            world.add_grid(&cells, 0.1).expect("a valid grid");
                            0.9
                        }
                        _ => {
                            let max = [1.95, 3.0];
                            world.add_border(Bounds {
                                min: [-1.0, -3.0],
                                max,
                            });
                            0.0
                        }
                    };
                    add(&mut world, &disc(radius), Pose::at(0.5, y), 30.0, drive);
                    let command = Twist {
                        vy: slant * speed * 0.2,
                        ..along(speed)
                    };
                    for tick in 0..120 {
                        world.step(&[command], DT).expect("a finite step");
                        let x = world.pose(0).x;
                        if world.pose(0).y.abs() > 1.8 {
                            break;
                        }
                        let wall = if kind == 1 { 2.0 } else { 1.95 };
                        // Far above the speeds of robots a wall is soft.
                        let depth = if speed > 2.0 { radius } else { 0.01 };
                        assert!(
                            x + radius < wall + depth,
                            "radius {radius}, {speed} m/s, slant {slant}, wall {kind}: x {x} in tick {tick}"
                        );
                    }
                }
            }
        }
    }
}

/// Wheels hold sideways what their tyres hold, and no more.
#[test]
fn wheels_grip_sideways() {
    let moved = |lateral: Option<f64>, push: f64| {
        let mut world = world();
        let drive = Drive { lateral, ..DRIVE };
        add(
            &mut world,
            &disc(0.3),
            Pose::new(0.0, 0.0, 0.0),
            50.0,
            drive,
        );
        let pusher = Drive {
            acceleration: push,
            ..DRIVE
        };
        add(&mut world, &disc(0.3), Pose::at(0.0, -0.6), 50.0, pusher);
        let up = Twist {
            vy: 5.0,
            ..Twist::default()
        };
        steps(&mut world, &[Twist::default(), up], 60);
        world.pose(0).y
    };
    assert!(moved(None, 4.0) > 0.3, "the drive alone does not hold it");
    assert!(moved(Some(6.0), 4.0) < 5e-3, "the tyres do");
    assert!(moved(Some(6.0), 12.0) > 0.3, "not against everything");

    // And they do not drive sideways beyond it either.
    let mut world = world();
    let lateral = Some(0.5);
    add(
        &mut world,
        &disc(0.3),
        Pose::new(0.0, 0.0, std::f64::consts::FRAC_PI_2),
        50.0,
        Drive { lateral, ..DRIVE },
    );
    steps(&mut world, &[along(1.0)], 60);
    assert!((world.velocity(0).vx - 0.5).abs() < 1e-9);
}

/// A blow beside the centre turns a long robot.
#[test]
fn rectangles_turn_when_pushed_off_centre() {
    let mut world = world();
    let long = Footprint::Rectangle {
        length_m: 1.6,
        width_m: 0.5,
    };
    let weak = Drive {
        acceleration: 0.2,
        lateral: None,
        angular: 0.2,
    };
    add(&mut world, &long, Pose::at(0.0, 0.0), 40.0, weak);
    add(&mut world, &disc(0.2), Pose::at(0.7, -1.0), 40.0, DRIVE);
    let up = Twist {
        vy: 1.0,
        ..Twist::default()
    };
    steps(&mut world, &[Twist::default(), up], 90);
    assert!(world.pose(0).heading > 0.3, "{:?}", world.pose(0));
}

/// Sleeping bodies are woken by bodies that touch them, and by their controllers.
#[test]
fn sleepers_wake() {
    for sleeping in [false, true] {
        let mut world = ContactWorld::new(Settings {
            sleeping,
            walls: SLIPPERY,
            ..Settings::default()
        })
        .expect("valid settings");
        add(&mut world, &disc(0.3), Pose::at(0.0, 0.0), 20.0, DRIVE);
        add(&mut world, &disc(0.3), Pose::at(3.0, 0.0), 100.0, DRIVE);
        steps(&mut world, &[along(0.0), along(0.0)], 120);
        steps(&mut world, &[along(0.0), along(-2.0)], 240);
        assert!(
            world.pose(0).x < -1.0,
            "sleeping {sleeping}: {:?}",
            world.pose(0)
        );
        steps(&mut world, &[along(0.0), along(0.0)], 240);
        let x = world.pose(0).x;
        steps(&mut world, &[along(-1.0), along(0.0)], 60);
        assert!(
            (world.velocity(0).vx + 1.0).abs() < 1e-9,
            "sleeping {sleeping}"
        );
        assert!(world.pose(0).x < x - 0.5, "sleeping {sleeping}");
    }
}

/// Robots that pass at a centimetre do not touch, and robots that rub do.
#[test]
fn contacts_are_touches() {
    for (gap, touch) in [(0.01, false), (-0.01, true)] {
        let mut world = world();
        add(&mut world, &disc(0.3), Pose::at(0.0, 0.0), 50.0, DRIVE);
        add(
            &mut world,
            &disc(0.3),
            Pose::at(1.5, 0.6 + gap),
            50.0,
            DRIVE,
        );
        steps(&mut world, &[along(1.0), along(0.0)], 240);
        let events: Vec<ContactEvent> = world.drain_events().collect();
        assert_eq!(!events.is_empty(), touch, "{events:?}");
        let kinds = [EventKind::Begin, EventKind::End];
        for (event, kind) in events.iter().zip(kinds.into_iter().cycle()) {
            assert_eq!((event.agent, event.other), (0, Other::Agent(1)));
            assert_eq!(event.kind, kind, "{events:?}");
        }
        assert!(events.len().is_multiple_of(2), "{events:?}");
    }
}

/// A slide along a wall of many cells is one contact.
#[test]
fn cells_are_one_wall() {
    let mut world = world();
    let terrain: Vec<u8> = (0..3 * 40)
        .map(|at| match (at / 40, at % 40) {
            (0 | 1, _) => b'.',
            // Ragged below, so that the wall is many rectangles.
            _ => b'@',
        })
        .collect();
    let grid = Grid::new("wall", 3, 40, terrain).expect("a valid map");
    world.add_grid(&grid, 1.0).expect("a valid grid");
    add(&mut world, &disc(0.4), Pose::at(2.0, 1.5), 50.0, DRIVE);
    let down = Twist {
        vx: 1.0,
        vy: -0.5,
        omega: 0.0,
    };
    steps(&mut world, &[down], 900);
    let events: Vec<ContactEvent> = world.drain_events().collect();
    assert_eq!(events.len(), 1, "{events:?}");
    assert!(matches!(events[0].other, Other::Obstacle { cell } if cell / 40 == 2));
    assert!(world.pose(0).x > 12.0, "the wall does not hold it");
    assert!((world.pose(0).y - 1.4).abs() < 2e-3);
}

fn random_world(seed: u64) -> (ContactWorld, Vec<Twist>) {
    let mut rng = common::rng(seed);
    let grid = common::random_grid(&mut rng, 12, 12, 20);
    let mut world = ContactWorld::new(Settings::default()).expect("valid settings");
    world.add_grid(&grid, 1.0).expect("a valid grid");
    let max = [12.0, 12.0];
    world.add_border(Bounds {
        min: [0.0, 0.0],
        max,
    });
    let footprints = [
        disc(0.3),
        Footprint::Rectangle {
            length_m: 0.7,
            width_m: 0.4,
        },
        Footprint::Polygon {
            vertices_m: vec![[0.35, 0.0], [-0.2, 0.3], [-0.2, -0.3]],
        },
    ];
    let mut commands = Vec::new();
    for cell in common::starts(&mut rng, &grid, 40) {
        let (x, y) = fleetyard_sim::cell_center_m(&grid, 1.0, cell);
        let heading = common::below(&mut rng, 628) as f64 * 0.01;
        let shape = footprints[common::below(&mut rng, 3)]
            .shape()
            .expect("a valid footprint");
        let lateral = (common::below(&mut rng, 2) == 0).then_some(6.0);
        world
            .add_agent(&Agent {
                shape: &shape,
                pose: Pose::new(x, y, heading),
                velocity: Twist::default(),
                mass: Mass::Density(100.0 + common::below(&mut rng, 300) as f64),
                drive: Drive { lateral, ..DRIVE },
                material: Material::default(),
            })
            .expect("a valid agent");
        let number = |rng: &mut _| common::below(rng, 300) as f64 * 0.01 - 1.5;
        commands.push(Twist {
            vx: number(&mut rng),
            vy: number(&mut rng),
            omega: number(&mut rng),
        });
    }
    (world, commands)
}

fn run(mut world: ContactWorld, commands: &[Twist], ticks: usize) -> (u128, Vec<ContactEvent>) {
    let mut events = Vec::new();
    for _ in 0..ticks {
        world.step(commands, DT).expect("a finite step");
        let before = events.len();
        events.extend(world.drain_events());
        let key = |e: &ContactEvent| match e.other {
            Other::Agent(other) => (e.tick, e.agent, 0, other),
            Other::Obstacle { .. } => (e.tick, e.agent, 1, 0),
            Other::Polygon(other) => (e.tick, e.agent, 2, other),
            Other::Mover(other) => (e.tick, e.agent, 3, other),
            Other::Goal => (e.tick, e.agent, 4, 0),
        };
        assert!(
            events[before..].is_sorted_by(|a, b| key(a) < key(b)),
            "events in order"
        );
    }
    (world.digest(), events)
}

fn jam() -> (ContactWorld, Vec<Twist>) {
    let mut world = world();
    world.add_grid(&corridor(12), 1.0).expect("a valid grid");
    for agent in 0..10 {
        let y = if agent % 3 == 0 { 1.45 } else { 1.53 };
        add(
            &mut world,
            &disc(0.4),
            Pose::at(0.5 + f64::from(agent), y),
            50.0,
            DRIVE,
        );
    }
    (world, vec![along(1.5); 10])
}

fn chain() -> (ContactWorld, Vec<Twist>) {
    let mut world = world();
    for agent in 0..8 {
        let pose = Pose::new(f64::from(agent), 0.003 * f64::from(agent), 0.1);
        let square = Footprint::Rectangle {
            length_m: 0.6,
            width_m: 0.5,
        };
        add(
            &mut world,
            &square,
            pose,
            if agent == 0 { 500.0 } else { 20.0 },
            DRIVE,
        );
    }
    let mut commands = vec![along(0.0); 8];
    commands[0] = along(1.0);
    (world, commands)
}

fn sweep() -> (ContactWorld, Vec<Twist>) {
    let mut world = world();
    let blade = Footprint::Rectangle {
        length_m: 0.3,
        width_m: 5.0,
    };
    let path = [
        (0.0, Pose::new(-1.0, 2.0, 0.0)),
        (6.0, Pose::new(5.0, 2.0, 0.6)),
    ];
    let blade = Mover::new(blade, &path).expect("a valid mover");
    world.add_mover(&blade).expect("a valid mover");
    for agent in 0..25 {
        let pose = Pose::at(f64::from(agent / 5), f64::from(agent % 5));
        add(
            &mut world,
            &disc(0.35),
            pose,
            30.0 + f64::from(agent),
            DRIVE,
        );
    }
    (world, vec![along(0.0); 25])
}

/// Two runs agree, and with every other build and machine.
#[test]
fn digests_do_not_change() {
    type Make = fn() -> (ContactWorld, Vec<Twist>);
    let cases: [(&str, Make, usize, &str); 3] = [
        ("jam", jam, 600, "26691d426a3f36252ca2abea62b5cc8c"),
        ("chain", chain, 400, "4f56a0c3885a22640bd32eb311ec161e"),
        ("sweep", sweep, 400, "45d4ce577ffa3c054decc25d9fae2ad7"),
    ];
    let mut wrong = Vec::new();
    for (name, make, ticks, golden) in cases {
        let (world, commands) = make();
        let one = run(world, &commands, ticks);
        let (world, commands) = make();
        assert_eq!(one, run(world, &commands, ticks), "{name}: two runs");
        assert!(!one.1.is_empty(), "{name}: something touches");
        if format!("{:032x}", one.0) != golden {
            wrong.push(format!("{name}: {:032x}", one.0));
        }
    }
    let mut all = 0u128;
    for seed in 0..100 {
        let (world, commands) = random_world(seed);
        let (digest, events) = run(world, &commands, 60);
        assert!(!events.is_empty(), "seed {seed}: something touches");
        all = all.rotate_left(7) ^ digest;
    }
    if format!("{all:032x}") != "8fde816b0a566e0ba10f52a3e4045013" {
        wrong.push(format!("random: {all:032x}"));
    }
    assert!(wrong.is_empty(), "other digests than before: {wrong:#?}");
}

/// Not NaN, not nothing, not the wrong number: an error that says what to do.
#[test]
fn bad_input_is_refused() {
    let refused = |settings: Settings| ContactWorld::new(settings).err().map(|e| e.to_string());
    for substeps in [0, 65] {
        let text = refused(Settings {
            substeps,
            ..Settings::default()
        });
        assert!(
            text.is_some_and(|text| text.contains("hint:")),
            "{substeps}"
        );
    }
    for (friction, restitution) in [(-1.0, 0.0), (f64::NAN, 0.0), (0.0, 1.5), (0.0, f64::NAN)] {
        let walls = Material {
            friction,
            restitution,
        };
        let settings = Settings {
            walls,
            ..Settings::default()
        };
        assert!(refused(settings).is_some(), "{walls:?}");
    }
    let mut world = world();
    for cell in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(world.add_grid(&corridor(4), cell).is_err(), "{cell}");
    }
    let shape = disc(0.3).shape().expect("a valid footprint");
    let good = Agent {
        shape: &shape,
        pose: Pose::at(0.0, 0.0),
        velocity: Twist::default(),
        mass: Mass::Total(1.0),
        drive: DRIVE,
        material: SLIPPERY,
    };
    let bad = [
        Agent {
            pose: Pose::at(f64::NAN, 0.0),
            ..good.clone()
        },
        Agent {
            mass: Mass::Total(0.0),
            ..good.clone()
        },
        Agent {
            mass: Mass::Density(f64::INFINITY),
            ..good.clone()
        },
        Agent {
            drive: Drive {
                acceleration: -1.0,
                ..DRIVE
            },
            ..good.clone()
        },
        Agent {
            drive: Drive {
                angular: f64::NAN,
                ..DRIVE
            },
            ..good.clone()
        },
        Agent {
            drive: Drive {
                lateral: Some(0.0),
                ..DRIVE
            },
            ..good.clone()
        },
    ];
    for agent in &bad {
        let error = world.add_agent(agent).expect_err("a bad agent");
        assert!(error.to_string().contains("hint:"), "{error}");
    }
    assert_eq!(world.agents(), 0, "none was added");
    world.add_agent(&good).expect("a good agent");
    let error = world.step(&[], DT).expect_err("a command is missing");
    assert_eq!(
        error,
        ContactError::Commands {
            commands: 0,
            agents: 1
        }
    );
    assert!(world.step(&[along(f64::NAN)], DT).is_err());
    assert!(world.step(&[along(0.0)], 0.0).is_err());
    assert!(world.step(&[along(0.0)], f64::NAN).is_err());
    assert_eq!(world.time_s().to_bits(), 0, "nothing happened");
    world.step(&[along(0.0)], DT).expect("a good step");
}

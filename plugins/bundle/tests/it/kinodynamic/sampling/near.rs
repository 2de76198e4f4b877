//! The nearest of many points, beside all of them.

use fleetyard_plugin_kinodynamic::sampling::near::{Found, Near, lifted};
use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_plane::bins::Rectangle;
use fleetyard_plugin_spacetime::random::Random;
use proptest::prelude::*;

fn numbers(mut found: Vec<Found>) -> Vec<u32> {
    found.sort_by(|one, other| one.square.total_cmp(&other.square));
    found.iter().map(|one| one.number).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Points crowd around one place, lie anywhere, and a few beyond the bounds; some leave again.
    #[test]
    fn points_that_are_found_are_the_nearest(
        seed in any::<u64>(), count in 1..2000_usize, round in prop_oneof![Just(0.0), 0.5..20.0_f64], wanted in 1..60_usize,
    ) {
        let mut random = Random::new(seed, 0);
        let bounds = Rectangle { min: Vector::new(-3.0, 1.0), max: Vector::new(7.0, 4.0) };
        let mut near: Near<4> = Near::new(bounds, round);
        let mut points: Vec<(u32, [f64; 4])> = Vec::new();
        let draw = |random: &mut Random| {
            let size = if random.one_in(3) { 0.01 } else { 12.0 };
            let mut number = || (random.share() - 0.5) * size;
            let (x, y, other) = (2.0 + number(), 2.5 + number(), number());
            [x, y, lifted(number(), 1.0) * round / std::f64::consts::TAU, other]
        };
        for number in 0..count as u32 {
            let point = draw(&mut random);
            near.insert(point, number);
            points.push((number, point));
            if random.one_in(4) {
                let (number, point) = points.swap_remove(random.below(points.len()));
                near.remove(&point, number);
            }
        }
        prop_assert_eq!(near.len(), points.len());
        let mut found = Vec::new();
        for _ in 0..10 {
            let asked = draw(&mut random);
            let square = |point: &[f64; 4]| -> f64 {
                let around = (point[2] - asked[2]).abs();
                let around = around.min(round - around);
                (point[0] - asked[0]).powi(2) + (point[1] - asked[1]).powi(2) + around * around + (point[3] - asked[3]).powi(2)
            };
            let mut all: Vec<Found> = points.iter().map(|(number, point)| Found { square: square(point), number: *number }).collect();
            all.sort_by(|one, other| one.square.total_cmp(&other.square));
            near.nearest(&asked, wanted, &mut found);
            let nearest: Vec<u32> = all.iter().take(wanted).map(|one| one.number).collect();
            prop_assert_eq!(numbers(found.clone()), nearest);
            let distance = random.share() * 3.0;
            near.within(&asked, distance, &mut found);
            let close: Vec<u32> = all.iter().filter(|one| one.square <= distance * distance).map(|one| one.number).collect();
            prop_assert_eq!(numbers(found.clone()), close);
        }
    }
}

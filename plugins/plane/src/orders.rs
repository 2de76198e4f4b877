//! Orders of priority: who is planned first goes as if alone, and who is last has to do with what is left.
//!
//! An order in which somebody finds no path is given up, and the next one begins with who found none (M. Bennewitz,
//! W. Burgard, S. Thrun, "Finding and optimizing solvable priority schemes for decoupled path planning techniques for teams
//! of mobile robots", Robotics and Autonomous Systems 41, 2002, search among orders too). One that was tried is shuffled.

use std::collections::HashSet;

use fleetyard_plugin_spacetime::random::Random;

/// Shuffles after which a small team is taken to have no order that was not tried.
const SHUFFLES: u32 = 64;

/// Result of planning in one order.
#[derive(Debug, Clone, PartialEq)]
pub enum Attempt<T> {
    /// Everybody has a path.
    Solved(T),
    /// The disc at this place of the order finds no path.
    Blocked(usize),
    /// It was told to stop.
    Stopped,
}

/// Result of all orders.
#[derive(Debug, Clone, PartialEq)]
pub enum End<T> {
    /// Everybody has a path.
    Solved(T),
    /// No order that was tried gives everybody a path.
    GaveUp,
    /// It was told to stop.
    Stopped,
}

/// Tries orders from `first` on until one solves, at most `limit`, and says how many were tried.
pub fn try_orders<T>(
    first: Vec<u32>,
    limit: u64,
    seed: u64,
    mut attempt: impl FnMut(&[u32]) -> Attempt<T>,
) -> (End<T>, u64) {
    let (mut order, mut random, mut tried) = (first, Random::new(seed, 0), HashSet::new());
    for number in 1..=limit {
        let mut shuffles = 0;
        while !tried.insert(order.clone()) {
            if shuffles == SHUFFLES {
                return (End::GaveUp, number - 1);
            }
            random.shuffle(&mut order);
            shuffles += 1;
        }
        match attempt(&order) {
            Attempt::Solved(paths) => return (End::Solved(paths), number),
            Attempt::Stopped => return (End::Stopped, number),
            Attempt::Blocked(place) => order[..=place].rotate_right(1),
        }
    }
    (End::GaveUp, limit)
}

/// Agents by the length of their way, the longest first.
pub fn longest_first(ways: &[f64]) -> Vec<u32> {
    let mut order: Vec<u32> = (0..ways.len() as u32).collect();
    order.sort_by(|a, b| ways[*b as usize].total_cmp(&ways[*a as usize]));
    order
}

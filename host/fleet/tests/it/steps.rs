//! Steps of plans as they are executed by synchronous rules.

use fleetyard_abi::Heading;
use fleetyard_fleet::steps::{Act, act};
use proptest::prelude::*;

const COLS: u32 = 5;

/// Acts of a robot along a path, of which so many cells were judged, and where it looks at last.
fn acts(path: &[u32], judged: usize, mut looks: Heading, steps: usize) -> (Vec<Act>, Heading) {
    let acts = (0..steps).map(|at| {
        let act = act(path, judged, at, Some(looks), COLS);
        looks = match act {
            Act::Wait => looks,
            Act::Left => turned(looks, 3),
            Act::Right => turned(looks, 1),
            // It has to look that way already.
            Act::Move(to) => {
                assert_eq!(Heading::of_move(path[at], to, COLS), looks);
                looks
            }
        };
        act
    });
    let acts = acts.collect();
    (acts, looks)
}

fn turned(looks: Heading, clockwise: i32) -> Heading {
    Heading::from_code((looks.code() + clockwise).rem_euclid(4)).expect("a heading")
}

#[test]
fn robots_turn_as_soon_as_they_can() {
    use Act::{Left, Move, Right, Wait};
    // North from cell 12: one turn to the left from the east, then waiting.
    let (done, looks) = acts(&[12, 12, 12, 7, 7], 5, Heading::East, 4);
    assert_eq!(done, [Left, Wait, Move(7), Wait]);
    assert_eq!(looks, Heading::North);
    // Behind it: to the right.
    let (done, looks) = acts(&[12, 12, 12, 11], 4, Heading::East, 3);
    assert_eq!((done, looks), (vec![Right, Right, Move(11)], Heading::West));
    // A move behind the window says where to turn, and is not made.
    let (done, looks) = acts(&[12, 12, 17], 2, Heading::East, 3);
    assert_eq!((done, looks), (vec![Right, Wait, Wait], Heading::South));
    // Nothing is ahead, or nothing turns.
    assert_eq!(acts(&[12, 12], 2, Heading::East, 2).0, [Wait, Wait]);
    assert_eq!(act(&[12, 12, 17], 3, 0, None, COLS), Wait);
    assert_eq!(act(&[12, 12, 17], 3, 1, None, COLS), Move(17));
}

proptest! {
    /// Whatever the path, with as many waits before each move as turning takes at least, every
    /// step ends in the cell of the path.
    #[test]
    fn executed_steps_are_those_of_the_path(
        start in 0u32..25,
        looks in 0i32..4,
        legs in prop::collection::vec((0i32..4, 0u32..3), 0..12),
    ) {
        let mut path = vec![start];
        let first = Heading::from_code(looks).expect("a heading");
        let mut heading = first;
        for (way, more) in legs {
            let (towards, here) = (Heading::from_code(way).expect("a heading"), path[path.len() - 1]);
            let (row, col) = (here / COLS, here % COLS);
            let to = match towards {
                Heading::East if col + 1 < COLS => here + 1,
                Heading::West if col > 0 => here - 1,
                Heading::South if row + 1 < COLS => here + COLS,
                Heading::North if row > 0 => here - COLS,
                _ => continue,
            };
            let waits = heading.quarters_to(towards) + more;
            path.extend(std::iter::repeat_n(here, waits as usize));
            path.push(to);
            heading = towards;
        }
        let (acts, last) = acts(&path, path.len(), first, path.len());
        let mut cell = start;
        for (at, act) in acts.iter().enumerate() {
            prop_assert_eq!(cell, path[at]);
            if let Act::Move(to) = act {
                cell = *to;
            }
        }
        prop_assert_eq!(last, heading);
    }
}

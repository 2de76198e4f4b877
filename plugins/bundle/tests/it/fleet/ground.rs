//! Searches on a map.

use fleetyard_abi::GridEnvironment;
use fleetyard_plugin_fleet::ground::{Ground, Learn, Search};
use fleetyard_plugin_spacetime::graph::Vertex;
use proptest::prelude::*;

fn ground(rows: u32, cols: u32, blocked: &[bool]) -> Ground {
    let passable: Vec<u8> = blocked.iter().map(|blocked| u8::from(!blocked)).collect();
    let environment = GridEnvironment::four_connected(rows, cols, passable).into();
    Ground::learn(&environment).unwrap()
}

proptest! {
    /// Both searches find what is there, and distances are those of the shortest ways.
    #[test]
    fn distances_are_shortest(blocked in prop::collection::vec(prop::bool::weighted(0.3), 63)) {
        let ground = ground(7, 9, &blocked);
        let mut search = Search::new(&ground);
        let free = ground.graph().len() as Vertex;
        for from in 0..free {
            // Distances by levels, found without any of the code above.
            let mut steps = vec![None; free as usize];
            steps[from as usize] = Some(0);
            for level in 0..free {
                for v in 0..free {
                    if steps[v as usize] == Some(level) {
                        for near in ground.graph().neighbors(v) {
                            steps[near as usize].get_or_insert(level + 1);
                        }
                    }
                }
            }
            for to in 0..free {
                let apart = steps[to as usize];
                prop_assert_eq!(search.distance(from, to, u32::MAX), apart);
                if let Some(apart) = apart.filter(|apart| *apart > 0) {
                    prop_assert_eq!(search.distance(from, to, apart - 1), None);
                }
                prop_assert_eq!(search.nearest(from, |v| v == to).is_some(), apart.is_some());
            }
        }
    }
}

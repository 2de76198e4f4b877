//! Paths on the wire: the same plan whatever the encoding, also where it is no good.

#![allow(missing_docs, reason = "a test")]

use fleetyard_abi::moves::OFF_MAP;
use fleetyard_abi::paths::{PathContext, WritePaths};
use fleetyard_abi::{Environment, PathEncoding, Plan};
use serde::de::DeserializeSeed;

fn context(rows: u32, cols: u32) -> PathContext<'static> {
    PathContext {
        rows,
        cols,
        starts: &[0, 8],
        max_cells: 100,
    }
}

fn read(context: PathContext<'_>, text: &str) -> serde_json::Result<Plan> {
    context.deserialize(&mut serde_json::Deserializer::from_str(text))
}

#[track_caller]
fn arrives(context: PathContext<'_>, plan: &[&[u32]], expected: &[&[u32]]) {
    let plan = Plan::from_paths(plan);
    for encoding in PathEncoding::ALL {
        let paths = WritePaths {
            plan: plan.as_ref(),
            context,
            encoding,
        };
        let text = serde_json::to_string(&paths).unwrap();
        let read = read(context, &text).unwrap();
        assert_eq!(read, Plan::from_paths(expected), "{text}");
    }
}

#[test]
fn a_walk_past_the_last_row_and_back_is_the_same_by_every_encoding() {
    arrives(
        context(3, 4),
        &[&[0, 1, 5], &[8, 12, 8]],
        &[&[0, 1, 5], &[8, OFF_MAP, 8]],
    );
}

#[test]
fn paths_on_a_map_without_columns_can_be_written() {
    arrives(context(3, 0), &[&[0], &[]], &[&[OFF_MAP], &[]]);
}

#[test]
fn a_coordinate_is_outside_the_map_however_large_it_is() {
    let text = "[[18446744073709551615, [0, 1]], [[18446744073709551615, 0], [0, -1]]]";
    assert!(
        read(context(3, 4), text)
            .is_ok_and(|plan| { plan == Plan::from_paths([&[OFF_MAP, 1], &[OFF_MAP, OFF_MAP]]) })
    );
    for text in ["[[[0, \"1\"]]]", "[[[0, 0.5]]]"] {
        let error = read(context(3, 4), text).unwrap_err().to_string();
        assert!(error.contains("expected a row or column"), "{error}");
    }
}

#[test]
fn a_grid_without_cells_is_refused() {
    for (rows, cols, passable) in [(2, 0, r#"["",""]"#), (0, 2, "[]"), (0, 0, "[]")] {
        let text = format!(
            r#"{{"representation":"grid","map_name":"m","rows":{rows},"cols":{cols},
            "connectivity":4,"cell_size_m":1.0,"step_s":1.0,"passable":{passable}}}"#
        );
        let error = serde_json::from_str::<Environment>(&text).unwrap_err();
        let expected = format!("a grid of {rows} rows and {cols} columns has no cell");
        assert!(error.to_string().starts_with(&expected), "{error}");
    }
}

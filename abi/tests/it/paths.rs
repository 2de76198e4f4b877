//! Paths on the wire: the same plan whatever the encoding, also where it is no good.

use fleetyard_abi::moves::OFF_MAP;
use fleetyard_abi::paths::{PathContext, PathsError, PathsReader, WritePaths};
use fleetyard_abi::{Environment, GridPlan, PathEncoding};
use serde::de::DeserializeSeed;

fn context(rows: u32, cols: u32) -> PathContext<'static> {
    PathContext {
        rows,
        cols,
        starts: &[0, 8],
        max_cells: 100,
    }
}

fn read(context: PathContext<'_>, text: &str) -> serde_json::Result<GridPlan> {
    context.deserialize(&mut serde_json::Deserializer::from_str(text))
}

#[track_caller]
fn arrives(context: PathContext<'_>, plan: &[&[u32]], expected: &[&[u32]]) {
    let plan = GridPlan::from_paths(plan);
    for encoding in PathEncoding::ALL {
        let paths = WritePaths {
            plan: &plan,
            context,
            encoding,
        };
        let text = serde_json::to_string(&paths).unwrap();
        let read = read(context, &text).unwrap();
        assert_eq!(read, GridPlan::from_paths(expected), "{text}");
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
        read(context(3, 4), text).is_ok_and(|plan| {
            plan == GridPlan::from_paths([&[OFF_MAP, 1], &[OFF_MAP, OFF_MAP]])
        })
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
            r#"{{"representation":"grid","grid":{{"rows":{rows},"cols":{cols},
            "connectivity":4,"cell_size_m":1.0,"step_s":1.0,"passable":{passable}}}}}"#
        );
        let error = serde_json::from_str::<Environment>(&text).unwrap_err();
        let expected = format!("a grid of {rows} rows and {cols} columns has no cell");
        assert!(error.to_string().starts_with(&expected), "{error}");
    }
}

/// Reads a text in pieces of so many bytes; the plan of all paths that have an agent.
fn in_pieces(
    context: PathContext<'_>,
    text: &str,
    size: usize,
) -> Result<(GridPlan, usize), String> {
    let mut paths = PathsReader::new();
    for piece in text.as_bytes().chunks(size) {
        match paths.feed(&context, piece) {
            Ok(read) if !piece[read..].trim_ascii().is_empty() => return Err("goes on".into()),
            Ok(_) => {}
            Err(error) => return Err(format!("{error:?}")),
        }
    }
    if paths.is_done() {
        paths.finish()
    } else {
        Err("ends".into())
    }
}

#[test]
fn paths_that_come_in_pieces_are_those_that_come_at_once() {
    let texts = [
        "[]",
        "[[],[]]",
        " [ [ 0 , 1 ,\t5 ] , \"E.S\" ] ",
        "[[[0,0],[0,1]],[[2,0],[2,1],[1,1]]]",
        "[[[ 0 , 0 ] , 3],[8]]",
        "[\"NNNN\",\"SSSSnesw.\"]",
        r#"["\u0045\u002e","E"]"#,
        "[[-1,4294967295,18446744073709551615,99999999999999999],[[-1,0],[0,18446744073709551615]]]",
        // More paths than agents are counted.
        "[[0],[8],[3],[4,5]]",
        // What is no plan.
        "",
        "[",
        "[[0,1]",
        "[[0,1],]",
        "[[0,1,],[]]",
        "[[0 1],[]]",
        "[[01],[]]",
        "[[NaN],[]]",
        "[[1.5],[1e3]]",
        "[[0.0000000000000000000000000000000000000000001],[]]",
        "[[null],[]]",
        "[null,null]",
        "[5,6]",
        "[true]",
        "[{\"a\":[1]},[]]",
        "[[\"here\",\"the\\\"re\"],[]]",
        "[[{}],[]]",
        "[[[0]],[]]",
        "[[[]],[]]",
        "[[[0,1,2]],[]]",
        "[[[0,\"1\"]],[]]",
        "[[[0,[1]]],[]]",
        "[[[0,0.5]],[]]",
        "[\"NOWHERE\",\"\"]",
        r#"["\u00e4",""]"#,
        r#"["\ud83d\ude00",""]"#,
        "[\"ä\",\"\"]",
        "[[0],[8],\"E\"]",
        "{}",
        "7",
    ];
    for text in texts {
        let whole = read(context(3, 4), text);
        for size in [1, 2, 3, 7, 1000] {
            let pieces = in_pieces(context(3, 4), text, size);
            match (&whole, &pieces) {
                (Ok(whole), Ok((plan, paths))) => {
                    assert_eq!(whole.agents(), *paths, "{text}");
                    let kept = GridPlan::from_paths(whole.paths().take(2));
                    assert_eq!(*plan, kept, "{text}");
                }
                (Err(_), Err(_)) => {}
                _ => panic!("{text} by {size}: {whole:?} {pieces:?}"),
            }
        }
    }
}

#[test]
fn paths_are_read_no_further_than_there_may_be_cells() {
    let few = PathContext {
        max_cells: 3,
        ..context(3, 4)
    };
    for text in [
        "[[0,1,2],[8]]",
        "[\"EE\",\"\"]",
        "[[],[[0,0],[0,1],[0,2],[0,3]]]",
    ] {
        let mut paths = PathsReader::new();
        let fed = paths.feed(&few, text.as_bytes());
        assert_eq!(fed, Err(PathsError::TooLong { agent: 1 }), "{text}");
    }
    assert!(in_pieces(few, "[[0,1],[8]]", 1).is_ok());
}

#[test]
fn what_is_no_path_is_named_and_passed_over() {
    for (text, reason) in [
        (
            "[[\"here\"],[[[]]]]",
            "invalid type: a string, expected a cell index or [row, col]",
        ),
        (
            "[[[0,null]],{}]",
            "invalid type: null, expected a row or column",
        ),
        ("[[[0]],[]]", "a position is [row, col]"),
        (
            "[{\"a\":\"]\"}]",
            "invalid type: an object, expected the path of agent 0",
        ),
        ("[\"EO\\\"\",[]]", "unknown move 'O' at position 1"),
    ] {
        let found = in_pieces(context(3, 4), text, 1).unwrap_err();
        assert!(found.starts_with(reason), "{text}: {found}");
    }
}

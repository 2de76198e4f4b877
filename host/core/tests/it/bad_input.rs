//! Messages of readers about bad files: place, reason and hint, read as a user would.

use std::sync::Arc;

use fleetyard_core::formats::MapSize;
use fleetyard_core::plan_file::read_plan_on;
use fleetyard_core::{
    Connectivity, Grid, GridPlan, InputError, load_map, load_plan, load_scen, read_map, read_plan,
    read_scen, write_atomically,
};
use proptest::prelude::*;

/// The error as the command line prints it.
fn text(error: &InputError) -> String {
    match &error.hint {
        Some(hint) => format!("{error}\nhint: {hint}"),
        None => error.to_string(),
    }
}

#[track_caller]
fn map_fails(bytes: impl AsRef<[u8]>, expected: &str) {
    let error = read_map("a.map", bytes.as_ref()).expect_err("the map is bad");
    assert_eq!(text(&error), expected);
}

#[test]
fn bad_maps() {
    let header_hint = "hint: the header is 'type octile', 'height H', 'width W', 'map'";
    map_fails(
        "",
        "a.map: the file is empty\nhint: a map file begins with the line 'type octile'",
    );
    map_fails(
        "\r\n \n",
        "a.map: the file is empty\nhint: a map file begins with the line 'type octile'",
    );
    map_fails(
        "depth 3\n",
        "a.map:1:1: expected 'type octile', found 'depth 3'\nhint: is this a MovingAI .map file?",
    );
    map_fails(
        "# mine\ntype octile\n",
        "a.map:1:1: expected 'type octile', found '# mine'\n\
         hint: map files have no comments: remove the line",
    );
    map_fails(
        "type octile\rheight 1\rwidth 1\rmap\r.\r",
        "a.map:1: the lines end with carriage returns alone, as on old Macs\nhint: save it with line \
         ends of Unix or Windows, or run `tr '\\r' '\\n' < OLD > NEW`",
    );
    // JSON is a map of LSMART.
    map_fails("{\"rows\": 3}\n", "a.map:1:11: missing field `layout`");
    map_fails(
        "type tile\n",
        "a.map:1:6: map type 'tile' is not supported\nhint: the only type is 'octile'",
    );
    map_fails("type\n", "a.map:1:5: the type has no value");
    map_fails(
        "type octile\ntype octile\n",
        "a.map:2:1: type given twice, first on line 1",
    );
    map_fails(
        "type octile\nheight 2\nheight 3\n",
        "a.map:3:1: height given twice, first on line 2",
    );
    map_fails(
        "type octile\nwidth 2\nheight 1\nwidth 3\n",
        "a.map:4:1: width given twice, first on line 2",
    );
    map_fails(
        "type octile\nwidth 2\nmap\n..\n",
        "a.map:3:1: the header has no height\nhint: add a line 'height NUMBER' before 'map'",
    );
    map_fails(
        "type octile\nheight 2\nmap\n..\n",
        "a.map:3:1: the header has no width\nhint: add a line 'width NUMBER' before 'map'",
    );
    map_fails(
        "type octile\nheight 0\n",
        "a.map:2:8: the height is 0\nhint: the height is a whole number of 1 or more",
    );
    for value in ["-1", "+1", "2.5", "x", "½"] {
        map_fails(
            format!("type octile\nheight {value}\n"),
            &format!(
                "a.map:2:8: the height '{value}' is not a number\n\
                 hint: the height is a whole number of 1 or more"
            ),
        );
    }
    map_fails(
        "type octile\nheight\n",
        "a.map:2:7: the height has no value",
    );
    for value in ["1073741825", "4294967296", "99999999999999999999999"] {
        map_fails(
            format!("type octile\nheight {value}\n"),
            &format!(
                "a.map:2:8: the height '{value}' is too large\n\
                 hint: a map has at most 1073741824 cells"
            ),
        );
    }
    map_fails(
        "type octile\nheight 1000000\nwidth 1000000\nmap\n",
        "a.map:3: a map of 1000000 rows and 1000000 columns is too large\n\
         hint: a map has at most 1073741824 cells",
    );
    map_fails(
        "type octile\nheight 1 2\n",
        "a.map:2:10: unexpected '2' in the header",
    );
    map_fails(
        "type octile\nheight 1\nwidth 1\nmap x\n",
        "a.map:4:5: unexpected 'x' after 'map'",
    );
    map_fails(
        "type octile\ndepth 2\n",
        &format!("a.map:2:1: unknown header line 'depth'\n{header_hint}"),
    );
    map_fails(
        "type octile\n\nheight 1\n",
        &format!("a.map:2:1: blank line in the header\n{header_hint}"),
    );
    map_fails(
        "type octile\nheight 1\n",
        "a.map:3:1: the file ends before the line 'map'\nhint: the file is truncated, or not a map",
    );
    let header = "type octile\nheight 2\nwidth 3\nmap\n";
    let truncated = "hint: the file is truncated, or its height is wrong";
    map_fails(
        header,
        &format!("a.map:5:1: the map ends after 0 of 2 rows\n{truncated}"),
    );
    map_fails(
        format!("{header}...\n\n\n"),
        &format!("a.map:6:1: the map ends after 1 of 2 rows\n{truncated}"),
    );
    // Claims a gigabyte, brings a few bytes: refused at once.
    map_fails(
        "type octile\nheight 32768\nwidth 32768\nmap\n...",
        "a.map:5:4: map row 0 has 3 letters, but the width is 32768",
    );
    map_fails(
        format!("{header}...\n..\n"),
        "a.map:6:3: map row 1 has 2 letters, but the width is 3",
    );
    map_fails(
        format!("{header}....\n...\n"),
        "a.map:5:4: map row 0 has 4 letters, but the width is 3",
    );
    map_fails(
        format!("{header}... \n...\n"),
        "a.map:5:4: map row 0 has 4 letters, but the width is 3\n\
         hint: remove the blanks at the end of the line",
    );
    map_fails(
        format!("{header}...\n\n...\n"),
        "a.map:6:1: map row 1 has 0 letters, but the width is 3",
    );
    map_fails(
        "height 1\nwidth 2\nmap\n..\n..\n",
        "a.map:5:1: the map goes on after its 1 rows with '..'\n\
         hint: the header's height is wrong, or lines were added at the end: remove them",
    );
    map_fails(
        "type octile\nheight 4\nwidth 3\nmap\n....\n....\n....\n",
        "a.map:5:4: map row 0 has 4 letters, but the width is 3\n\
         hint: are height and width in the header exchanged?",
    );
    let letters = "hint: terrain letters are .GSEew, which are free, and @OTW, which are not";
    map_fails(
        format!("{header}...\n.x.\n"),
        &format!("a.map:6:2: unknown terrain letter 'x' in map row 1\n{letters}"),
    );
    map_fails(
        format!("{header}.é.\n...\n"),
        &format!("a.map:5:2: unknown terrain letter 'é' in map row 0\n{letters}"),
    );
    map_fails(
        [header.as_bytes(), b"\0..\n...\n"].concat(),
        &format!("a.map:5:1: unknown terrain letter '\\0' in map row 0\n{letters}"),
    );
    map_fails(
        [header.as_bytes(), b".\xff.\n...\n"].concat(),
        &format!("a.map:5:2: unknown terrain letter '\u{fffd}' in map row 0\n{letters}"),
    );
    map_fails(
        format!("{header}...\n...\n\n...\n"),
        "a.map:8:1: the map goes on after its 2 rows with '...'\n\
         hint: the header's height is wrong, or lines were added at the end: remove them",
    );
}

#[test]
fn tolerated_maps() {
    let plain = read_map(
        "m/a.map",
        b"type octile\nheight 1\nwidth 10\nmap\n.GSEew@OTW\n",
    )
    .unwrap();
    assert_eq!(plain.name(), "a");
    assert_eq!(plain.passable_count(), 6);
    for other in [
        "type octile\r\nheight 1\r\nwidth 10\r\nmap\r\n.GSEew@OTW\r\n",
        "type octile\nwidth 10\nheight 1\nmap\n.GSEew@OTW",
        "type octile\nheight 1\nwidth 10\nmap\n.GSEew@OTW\n\n\r\n  \n",
        "type octile \nheight\t1\nwidth  10\nmap\n.GSEew@OTW\n",
        "height 1\nwidth 10\nmap\n.GSEew@OTW\n",
        "Width 10\nTYPE Octile\nHEIGHT 1\nMap\n.GSEew@OTW\n",
    ] {
        assert_eq!(
            read_map("a.map", other.as_bytes()).as_ref(),
            Ok(&plain),
            "{other:?}"
        );
    }
}

const ENTRY: &str = "1\ta.map\t4\t3\t0\t0\t2\t1\t3.0";

#[track_caller]
fn scen_fails(bytes: impl AsRef<[u8]>, expected: &str) {
    let error = read_scen("a.scen", bytes.as_ref()).expect_err("the scenario is bad");
    assert_eq!(text(&error), expected);
}

#[test]
fn bad_scenarios() {
    let form = "hint: a scenario has a line 'version 1' and then one line of nine fields per agent";
    scen_fails("", &format!("a.scen: the file is empty\n{form}"));
    scen_fails(
        "version 1\n",
        &format!("a.scen: the scenario has no entries\n{form}"),
    );
    for version in ["2", "1.1", ""] {
        scen_fails(
            format!("version {version}\n{ENTRY}\n"),
            &format!(
                "a.scen:1:1: scenario version '{version}' is not supported\n\
                 hint: supported is 'version 1', or no version line"
            ),
        );
    }
    let fields = "hint: the fields are bucket, map, width, height, start x, start y, goal x, \
                  goal y, optimal length";
    scen_fails(
        "version 1\n1\ta.map\t4\t3\t0\t0\t2\n",
        &format!("a.scen:2:18: a scenario line has 9 fields, found 7\n{fields}"),
    );
    scen_fails(
        format!("{ENTRY}\t7\n"),
        &format!("a.scen:1:1: a scenario line has 9 fields, found 10\n{fields}"),
    );
    scen_fails(
        format!("{ENTRY}\nversion 1\n"),
        "a.scen:2:1: another version line, which scenarios do not have here\nhint: remove the line",
    );
    scen_fails(
        format!("# mine\n{ENTRY}\n"),
        "a.scen:1:1: a comment, which scenarios do not have here\nhint: remove the line",
    );
    scen_fails(
        ENTRY.replace("3.0", "3,5"),
        "a.scen:1:21: the optimal length '3,5' is not a number of 0 or more\n\
         hint: write a point before its decimals",
    );
    scen_fails(
        format!("{ENTRY}\n\n{ENTRY}\n"),
        "a.scen:2:1: blank line between entries\nhint: remove the line",
    );
    let bad = |at: usize, value: &str, place: u32, reason: &str| {
        let mut parts: Vec<&str> = ENTRY.split('\t').collect();
        parts[at] = value;
        scen_fails(
            format!("version 1\n{}\n", parts.join("\t")),
            &format!("a.scen:2:{place}: {reason}"),
        );
    };
    bad(
        0,
        "x",
        1,
        "the bucket 'x' is not a whole number of 0 or more",
    );
    bad(1, "", 3, "the map name is empty");
    bad(
        1,
        "ä\rb.map",
        4,
        "the map name 'ä\\rb.map' has a control character",
    );
    bad(
        2,
        "4.0",
        9,
        "the map width '4.0' is not a whole number of 0 or more",
    );
    bad(
        3,
        "99999999999",
        11,
        "the map height '99999999999' is too large",
    );
    bad(
        4,
        "-3",
        13,
        "the start x '-3' is not a whole number of 0 or more",
    );
    bad(
        5,
        "+0",
        15,
        "the start y '+0' is not a whole number of 0 or more",
    );
    bad(
        6,
        "",
        17,
        "the goal x '' is not a whole number of 0 or more",
    );
    bad(
        7,
        "1e3",
        19,
        "the goal y '1e3' is not a whole number of 0 or more",
    );
    for length in ["nan", "inf", "-1", "x"] {
        bad(
            8,
            length,
            21,
            &format!("the optimal length '{length}' is not a number of 0 or more"),
        );
    }
    scen_fails(
        b"version 1\n1\ta\xff.map\n",
        "a.scen:2:4: the line is not UTF-8 text",
    );
}

#[test]
fn tolerated_scenarios() {
    let plain = read_scen("a.scen", format!("version 1\n{ENTRY}\n").as_bytes()).unwrap();
    assert_eq!(
        (plain.entries[0].start, plain.entries[0].goal),
        ((0, 0), (1, 2))
    );
    let with_blanks = ENTRY.replace('\t', "  ");
    for other in [
        format!("version 1.0\r\n{ENTRY}\r\n\r\n"),
        format!("version\t1\n{ENTRY}"),
        format!("Version 1\n{ENTRY}"),
        format!("version 1\n{with_blanks} \n"),
        format!("version 1\n {ENTRY}\t\n"),
    ] {
        assert_eq!(
            read_scen("a.scen", other.as_bytes()).as_ref(),
            Ok(&plain),
            "{other:?}"
        );
    }
    let headerless = read_scen("a.scen", ENTRY.as_bytes()).unwrap();
    assert_eq!(headerless.entries[0].line, 1);
    let spaced = read_scen(
        "a.scen",
        ENTRY.replace("a.map", "my maps/a b.map").as_bytes(),
    )
    .unwrap();
    assert_eq!(spaced.entries[0].map, "my maps/a b.map");
}

#[track_caller]
fn instance_fails(lines: &[&str], agents: usize, expected: &str) {
    let map = "type octile\nheight 3\nwidth 4\nmap\n...@\n..@.\n....\n";
    let map = map.replace("....", "..@.");
    let grid = Arc::new(read_map("maps/a.map", map.as_bytes()).unwrap());
    let file = format!("version 1\n{}\n", lines.join("\n"));
    let scenario = read_scen(
        "a.scen",
        file.replace(' ', "\t")
            .replace("version\t", "version ")
            .as_bytes(),
    );
    let error = scenario
        .and_then(|scenario| scenario.instance(grid, agents, Connectivity::Four))
        .expect_err("the scenario is bad");
    assert_eq!(text(&error), expected);
}

#[test]
fn bad_instances() {
    let fine = "1 some/where/a.map 4 3 0 0 1 1 2";
    instance_fails(
        &[fine],
        0,
        "a.scen: an instance needs at least one agent\nhint: ask for 1 to 1 agents",
    );
    instance_fails(
        &[fine],
        2,
        "a.scen: 2 agents asked for, but the scenario has 1\nhint: ask for at most 1 agents",
    );
    instance_fails(
        &["1 maps\\b.map 0 0 0 0 1 1 2"],
        1,
        "a.scen:2: the scenario is for a map of 0 rows and 0 columns, but a has 3 and 4\n\
         hint: use the map maps\\b.map; if this is it, write its width 4 and height 3 as the third and \
         fourth field",
    );
    instance_fails(
        &["1 a.map 3 4 0 0 1 1 2"],
        1,
        "a.scen:2: the scenario is for a map of 4 rows and 3 columns, but a has 3 and 4\n\
         hint: scenario files give the width before the height",
    );
    instance_fails(
        &["1 a.map 4 3 0 3 1 1 2"],
        1,
        "a.scen:2: the start at row 3, column 0 is outside the map of 3 rows and 4 columns\n\
         hint: scenario files give x (the column) before y (the row)",
    );
    instance_fails(
        &["1 a.map 4 3 0 0 4000000000 1 2"],
        1,
        "a.scen:2: the goal at row 1, column 4000000000 is outside the map of 3 rows and 4 columns\n\
         hint: scenario files give x (the column) before y (the row)",
    );
    instance_fails(
        &["1 a.map 4 3 3 0 0 0 1"],
        1,
        "a.scen:2: the start of agent 0 at row 0, column 3 is on an obstacle",
    );
    instance_fails(
        &[fine, "1 a.map 4 3 1 0 2 1 1"],
        2,
        "a.scen:3: the goal of agent 1 at row 1, column 2 is on an obstacle",
    );
    instance_fails(
        &[fine, "1 a.map 4 3 1 0 0 0 1", "1 a.map 4 3 0 0 2 0 1"],
        3,
        "a.scen:4: agents 0 and 2 have the same start at row 0, column 0 (agent 0 is on line 2)",
    );
    instance_fails(
        &[fine, "1 a.map 4 3 1 0 1 1 1"],
        2,
        "a.scen:3: agents 0 and 1 have the same goal at row 1, column 1 (agent 0 is on line 2)",
    );
    instance_fails(
        &[fine, "1 a.map 4 3 1 0 3 1 1"],
        2,
        "a.scen:3: agent 1 cannot reach its goal: start and goal are in separate parts of the map",
    );
}

#[test]
fn a_map_of_another_name_is_for_the_caller_to_refuse() {
    let grid = Arc::new(read_map("a.map", b"height 1\nwidth 2\nmap\n..\n").unwrap());
    let lines = b"0\ta.map\t2\t1\t0\t0\t1\t0\t1\n0\tmaps\\b.map\t2\t1\t1\t0\t0\t0\t1\n";
    let scenario = read_scen("a.scen", lines).unwrap();
    let instance = scenario.instance(Arc::clone(&grid), 2, Connectivity::Four);
    assert_eq!(instance.unwrap().starts(), [0, 1]);
    assert_eq!(
        text(&scenario.check_name(&grid).unwrap_err()),
        "a.scen:2: the scenario is for map b, not for a\nhint: use the map maps\\b.map"
    );
    let one = Grid::clone(&grid).named("b");
    assert!(
        scenario
            .check_name(&one)
            .unwrap_err()
            .reason
            .contains("map a")
    );
}

/// As `docs/commands.md` has it.
#[test]
fn a_plan_of_paths_alone_is_read_where_the_map_is_known() {
    let bytes = b"{\"paths\": [[[0, 0], [0, 1]], [[1, 2]]]}";
    let size = MapSize { rows: 2, cols: 3 };
    let file = read_plan_on("a.plan", bytes, Some(size)).unwrap();
    assert_eq!((file.rows, file.cols), (2, 3));
    assert_eq!(file.plan, GridPlan::from_paths([&[0, 1][..], &[5]]));
    plan_fails(
        bytes,
        "a.plan: the file does not say how large its map is\n\
         hint: name the map with --map FILE, or give the file `rows` and `cols`",
    );
}

#[track_caller]
fn plan_fails(content: impl AsRef<[u8]>, expected: &str) {
    let error = read_plan("a.plan", content.as_ref()).expect_err("the plan is bad");
    assert_eq!(text(&error), expected);
}

#[test]
fn bad_plans() {
    let plan = |rest: &str| {
        format!("{{\"format\": \"fleetyard.plan/1\", \"rows\": 3, \"cols\": 4, {rest}}}")
    };
    let paths = |paths: &str| plan(&format!("\n\"paths\": {paths}"));
    plan_fails(
        " \n",
        "a.plan: the file is empty\nhint: a plan file is a JSON object with paths, and with rows and cols of its map",
    );
    plan_fails(
        "{\"format\"",
        "a.plan:1:9: EOF while parsing an object\nhint: the file is truncated",
    );
    // Columns are characters, not bytes.
    plan_fails(
        "{\n\"planner\": \"äöü",
        "a.plan:2:15: EOF while parsing a string\nhint: the file is truncated",
    );
    let object = "hint: a plan file is a JSON object with paths, and with rows and cols of its map";
    plan_fails(
        "hello",
        &format!("a.plan:1:1: this is not a JSON object\n{object}"),
    );
    plan_fails(
        " \n\n  []",
        &format!("a.plan:3:3: this is not a JSON object\n{object}"),
    );
    plan_fails(
        "{format: 1}",
        "a.plan:1:2: key must be a string\nhint: the file is not valid JSON",
    );
    plan_fails(
        paths("[]") + "x",
        "a.plan:2:13: trailing characters\nhint: the file is not valid JSON",
    );
    plan_fails(
        "{\"format\": \"fleetyard.plan/2\"}",
        "a.plan:1:30: format is \"fleetyard.plan/2\", expected \"fleetyard.plan/1\"",
    );
    plan_fails(
        plan("\"x\": 1"),
        "a.plan:1:56: unknown field `x`, expected one of `format`, \
        `planner`, `instance_digest`, `plan_digest`, `map`, `rows`, `cols`, `encoding`, `paths`",
    );
    plan_fails(plan("\"rows\": 1"), "a.plan:1:59: duplicate field `rows`");
    plan_fails(
        "{\"format\": \"fleetyard.plan/1\"}",
        "a.plan:1:30: missing field `paths`",
    );
    plan_fails(
        "{\"format\": \"fleetyard.plan/1\", \"rows\": -1}",
        "a.plan:1:41: invalid value: integer `-1`, expected u32",
    );
    plan_fails(
        "{\"format\": \"fleetyard.plan/1\", \"rows\": 0, \"cols\": 3, \"paths\": []}",
        "a.plan: a map of 0 rows and 3 columns is empty or too large\n\
         hint: a map has between 1 and 1073741824 cells",
    );
    plan_fails(
        plan("\"encoding\": \"zip\""),
        "a.plan:1:70: unknown variant `zip`, expected one of `pairs`, `cells`, `moves`",
    );
    plan_fails(
        plan("\"plan_digest\": \"12\""),
        "a.plan:1:73: a digest has 32 hexadecimal digits",
    );
    plan_fails(
        paths("7"),
        "a.plan:2:10: invalid type: integer `7`, expected a list with one path per agent",
    );
    plan_fails(
        paths("[7]"),
        "a.plan:2:11: invalid type: integer `7`, expected a path: a list of [row, column], \
         a list of cells, or an object with moves",
    );
    plan_fails(
        paths("[[[0, 0],\n[1]]]"),
        "a.plan:3:3: a position is a pair [row, column], found one number",
    );
    plan_fails(
        paths("[[[]]]"),
        "a.plan:2:13: a position is a pair [row, column], found an empty list",
    );
    plan_fails(
        paths("[[[1, 2, 3]]]"),
        "a.plan:2:20: a position is a pair [row, column], found more than two entries",
    );
    plan_fails(
        paths("[[[0, 0.5]]]"),
        "a.plan:2:18: invalid type: floating point `0.5`, expected an integer",
    );
    plan_fails(
        paths("[[[0, \"1\"]]]"),
        "a.plan:2:18: invalid type: string \"1\", expected an integer",
    );
    plan_fails(
        paths("[[[0, 0], 4]]"),
        "a.plan:2:20: invalid type: integer `4`, expected a pair [row, column]",
    );
    plan_fails(
        paths("[[4, [0, 0]]]"),
        "a.plan:2:14: invalid type: sequence, expected an integer",
    );
    plan_fails(
        paths("[[[0, 0]], [3, 4]]"),
        "a.plan: the encoding is pairs, but path 1 is a list of cells\n\
         hint: set \"encoding\" to pairs, cells or moves, as the paths are",
    );
    plan_fails(
        paths("[{\"start\": [0, 0], \"moves\": \"NXE\"}]"),
        "a.plan:2:43: unknown move 'X' at position 1, expected one of .NESWnesw",
    );
    plan_fails(
        paths("[{\"start\": [0, 0]}]"),
        "a.plan:2:27: missing field `moves`",
    );
    plan_fails(
        paths("[{\"start\": [0, 0], \"path\": 1}]"),
        "a.plan:2:34: unknown field `path`, expected `start` or `moves`",
    );
    plan_fails(
        plan("\"plan_digest\": \"00000000000000000000000000000000\", \"paths\": [[]]"),
        "a.plan: plan_digest is 00000000000000000000000000000000, but the paths have \
         25b6923db188b8c8854e4dfd3731c6a9\n\
         hint: the file was changed after it was written; remove plan_digest if that was on purpose",
    );
    // Deep nesting ends in an error and not in a stack overflow.
    let deep = "[".repeat(1_000_000);
    let error = read_plan("a.plan", paths(&deep).as_bytes()).unwrap_err();
    assert!(error.line.is_some(), "{error}");
}

#[test]
fn missing_and_oversized_files() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let shown = |name: &str| path(name).display().to_string();
    write_atomically(&path("room-32.map"), b"type").unwrap();
    write_atomically(&path("other.txt"), b"").unwrap();
    let error = load_map(path("rooom-32.map")).unwrap_err();
    assert_eq!(
        text(&error),
        format!(
            "{}: no such file\nhint: did you mean {}?",
            shown("rooom-32.map"),
            shown("room-32.map")
        )
    );
    let error = load_scen(path("nothing-like-it")).unwrap_err();
    assert_eq!(
        text(&error),
        format!("{}: no such file", shown("nothing-like-it"))
    );
    let error = load_plan(path("no/folder/a.plan")).unwrap_err();
    assert_eq!(
        text(&error),
        format!(
            "{}: no such file\nhint: the folder {} does not exist",
            shown("no/folder/a.plan"),
            shown("no/folder")
        )
    );
    let error = load_map(folder.path()).unwrap_err();
    assert_eq!(error.reason, "this is a folder, not a file");
    let error = fleetyard_core::read_file(&path("room-32.map"), 3).unwrap_err();
    assert_eq!(error.reason, "the file is larger than the limit of 3 bytes");
    assert_eq!(
        fleetyard_core::read_file(&path("room-32.map"), 4).unwrap(),
        b"type"
    );
    let error = write_atomically(&path("no/such/file"), b"").unwrap_err();
    assert_eq!(
        error.hint.as_deref(),
        Some("the folder does not exist; create it first")
    );
}

#[test]
fn writing_replaces_as_a_whole_and_leaves_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("file");
    write_atomically(&path, b"one").unwrap();
    write_atomically(&path, b"two").unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), b"two");
    // A folder cannot be replaced by a file; the attempt leaves no trace.
    std::fs::create_dir(folder.path().join("folder")).unwrap();
    write_atomically(&folder.path().join("folder"), b"x").unwrap_err();
    let mut names: Vec<_> = std::fs::read_dir(folder.path())
        .unwrap()
        .map(|entry| entry.unwrap().file_name())
        .collect();
    names.sort();
    assert_eq!(names, ["file", "folder"]);
}

/// Bytes near valid files: pieces of them in any order, with noise.
fn hostile() -> impl Strategy<Value = Vec<u8>> {
    let pieces = [
        "type octile\n",
        "height 3\n",
        "width 4\n",
        "height 99999999\n",
        "map\n",
        "....\n",
        "..@.\r\n",
        "version 1\n",
        "1\ta.map\t4\t3\t0\t0\t2\t1\t3.0\n",
        "1 a.map 4 3",
        "\t",
        " ",
        "\n",
        "\r",
        "{\"format\": \"fleetyard.plan/1\", \"rows\": 3, \"cols\": 4, ",
        "\"encoding\": \"moves\", ",
        "\"paths\": ",
        "[",
        "]",
        "[0, 1]",
        ",",
        "{\"start\": [0, 0], \"moves\": \"NESW\"}",
        "}",
        "-1",
        "1e9",
        "\u{e9}",
        "\"",
    ];
    let piece = prop_oneof![
        12 => proptest::sample::select(pieces.to_vec()).prop_map(|piece| piece.as_bytes().to_vec()),
        1 => proptest::collection::vec(any::<u8>(), 0..8),
    ];
    proptest::collection::vec(piece, 0..30).prop_map(|pieces| pieces.concat())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_bytes_panic(bytes in hostile()) {
        let empty: Grid = Grid::new("a", 3, 4, vec![b'.'; 12]).unwrap();
        for error in [
            read_map("a.map", &bytes).err(),
            read_plan("a.plan", &bytes).err(),
            read_scen("a.scen", &bytes)
                .and_then(|scen| scen.instance(Arc::new(empty), 1, Connectivity::Eight).map(drop))
                .err(),
        ].into_iter().flatten() {
            prop_assert!(!error.reason.is_empty() && error.reason.len() < 400);
            prop_assert!(error.line != Some(0) && error.column != Some(0));
        }
    }
}

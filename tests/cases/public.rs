//! Files in the manner of public bug reports, `tests/files/NN-name`: each folder's README says where they
//! are from and what is right.

use std::fs;

use fleetyard_testkit::{INPUT, INVALID_PLAN, SUCCESS, Yard};

use crate::{Tests, says};

/// A folder with the files of a case.
fn yard(case: &str) -> Yard {
    let folder = format!("{}/../../tests/files/{case}", env!("CARGO_MANIFEST_DIR"));
    let yard = Yard::new();
    for entry in fs::read_dir(&folder).expect("the folder of the case") {
        let entry = entry.expect("a file of the case");
        let name = entry.file_name().into_string().expect("a plain name");
        yard.write(&name, fs::read(entry.path()).expect("the file"));
    }
    yard
}

/// Case, name, command, exit code, and what is said: of a success on standard output, else on
/// standard error.
type Row = (
    &'static str,
    &'static str,
    &'static str,
    i32,
    &'static [&'static str],
);

pub(crate) fn add(tests: &mut Tests) {
    for (case, name, line, code, texts) in ROWS.iter().copied() {
        tests.add(&format!("public::{case}::{name}"), move || {
            let ended = yard(case).line(line).expect(code);
            if code != SUCCESS {
                return says(&ended, texts);
            }
            for text in texts {
                assert!(ended.stdout.contains(text), "no `{text}`: {ended}");
            }
        });
    }
    judged(tests);
    same(tests);
    tests.add("public::06-text-oddities::another name", || {
        let yard = yard("06-text-oddities");
        let line = "run --map lf.map --scen upname.scen --agents 1 --planner lacam";
        let ended = yard.line(line).expect(SUCCESS);
        says(
            &ended,
            &["the scenario is for map LF, not for lf", "--map-name NAME"],
        );
        let ended = yard.line(&format!("{line} --map-name LF")).expect(SUCCESS);
        assert!(!ended.stderr.contains("warning"), "{ended}");
    });
}

const ROWS: &[Row] = &[
    (
        "01-map-without-type",
        "run",
        "run --map yard.map --scen yard.scen --agents 2 --planner lacam",
        SUCCESS,
        &["valid"],
    ),
    (
        "01-map-without-type",
        "pibt2",
        "convert inst.txt team.scen --map yard.map",
        SUCCESS,
        &["team.scen"],
    ),
    (
        "02-yaml-tuple-tags",
        "convert",
        "convert four.yaml four.scen",
        SUCCESS,
        &["four.scen", "four.map"],
    ),
    (
        "16-ros-map",
        "world",
        "world convert map.yaml o.world.json",
        INPUT,
        &[
            "map.yaml: this is a map of ROS's map_server",
            "hint: write a map of letters",
        ],
    ),
    (
        "16-ros-map",
        "as a task",
        "world info map.yaml",
        INPUT,
        &["map.yaml: this is a map of ROS's map_server"],
    ),
    (
        "16-ros-map",
        "map",
        "convert map.yaml o.map",
        INPUT,
        &[
            "map.yaml: this is a map of ROS's map_server",
            "world convert",
        ],
    ),
    (
        "16-ros-map",
        "nan",
        "convert nan.yaml o.map",
        INPUT,
        &["nan.yaml: this is a map of ROS's map_server"],
    ),
    (
        "16-ros-map",
        "yaw",
        "maps info yaw.yaml",
        INPUT,
        &["yaw.yaml: this is a map of ROS's map_server"],
    ),
    (
        "16-ros-map",
        "binary picture",
        "convert map.pgm o.map",
        INPUT,
        &["map.pgm: this is a picture in PGM", "a letter per pixel"],
    ),
    (
        "16-ros-map",
        "plain picture",
        "maps info map2.pgm",
        INPUT,
        &["map2.pgm: this is a picture in PGM"],
    ),
    (
        "19-instances-of-continuous-solvers",
        "map",
        "convert map.xml o.map",
        SUCCESS,
        &["o.map"],
    ),
    (
        "19-instances-of-continuous-solvers",
        "task",
        "convert task.xml o.scen --map map.xml",
        SUCCESS,
        &["o.scen"],
    ),
    (
        "19-instances-of-continuous-solvers",
        "task as a plan",
        "validate task.xml --map map.xml",
        INPUT,
        &["task.xml: this is no plan but ccbs-task"],
    ),
    (
        "19-instances-of-continuous-solvers",
        "task on a roadmap",
        "convert roadmap_task.xml o.scen",
        INPUT,
        &[
            "roadmap_task.xml:3:5: this is a task of Continuous-CBS on a roadmap",
            "docs/worlds.md",
        ],
    ),
    (
        "19-instances-of-continuous-solvers",
        "roadmap in YAML",
        "convert roadmap.yaml o.scen",
        INPUT,
        &["roadmap.yaml: this is an instance of libMultiRobotPlanning on a roadmap"],
    ),
    (
        "19-instances-of-continuous-solvers",
        "db-CBS",
        "convert dyn.yaml o.task.json",
        INPUT,
        &["dyn.yaml: this is a problem of db-CBS", "run --task"],
    ),
    (
        "20-mapf-tracker-csv",
        "validate",
        "validate --map m.map --scen m.scen --agents 2 t.csv",
        SUCCESS,
        &["valid", "sum of costs 6 steps"],
    ),
    (
        "20-mapf-tracker-csv",
        "convert",
        "convert t.csv plan.json --map m.map --scen m.scen",
        SUCCESS,
        &["plan.json"],
    ),
    (
        "20-mapf-tracker-csv",
        "without starts",
        "convert t.csv plan.json --map m.map",
        INPUT,
        &["does not say where its agents start", "--scen FILE"],
    ),
    (
        "06-text-oddities",
        "utf16",
        "maps info utf16.map",
        INPUT,
        &["utf16.map: the file is text in UTF-16", "iconv -f UTF-16"],
    ),
    (
        "06-text-oddities",
        "old Mac",
        "maps info cr.map",
        INPUT,
        &["cr.map:1: the lines end with carriage returns alone", "tr "],
    ),
    (
        "06-text-oddities",
        "comment",
        "maps info comment.map",
        INPUT,
        &["comment.map:1:1: ", "no comments: remove the line"],
    ),
    (
        "06-text-oddities",
        "exchanged",
        "maps info swapped.map",
        INPUT,
        &[
            "swapped.map:5:4: ",
            "height and width in the header exchanged?",
        ],
    ),
    (
        "06-text-oddities",
        "end of file mark",
        "maps info ctrlz.map",
        INPUT,
        &[
            "ctrlz.map:8:1: ",
            "goes on after its 3 rows with '\\u{1a}'",
            "remove them",
        ],
    ),
    (
        "06-text-oddities",
        "blanks",
        "maps info trail.map",
        INPUT,
        &["trail.map:5:5: ", "remove the blanks"],
    ),
    (
        "06-text-oddities",
        "hash",
        "maps info hash.map",
        INPUT,
        &["hash.map:6:2: ", "@OTW, which are not"],
    ),
    (
        "06-text-oddities",
        "sizes of nothing",
        "run --map lf.map --scen zerowh.scen --agents 1 --planner lacam",
        INPUT,
        &["zerowh.scen:2: ", "write its width 4 and height 3"],
    ),
    (
        "06-text-oddities",
        "decimal comma",
        "run --map lf.map --scen comma.scen --agents 1 --planner lacam",
        INPUT,
        &["comma.scen:2:", "write a point before its decimals"],
    ),
    (
        "06-text-oddities",
        "scenario with a comment",
        "run --map lf.map --scen comment.scen --agents 1 --planner lacam",
        INPUT,
        &["comment.scen:2:1: a comment", "remove the line"],
    ),
    (
        "06-text-oddities",
        "two versions",
        "run --map lf.map --scen dup.scen --agents 1 --planner lacam",
        INPUT,
        &["dup.scen:2:1: another version line", "remove the line"],
    ),
    (
        "06-text-oddities",
        "suite",
        "bench bom.toml --dry-run",
        INPUT,
        // Read as far as to the scenarios, which are elsewhere.
        &["bom.toml:", "random-32-32-20-random-1.scen"],
    ),
    (
        "06-text-oddities",
        "task",
        "world grid bom.task.json",
        INPUT,
        &["two-rooms.world.json: no such file"],
    ),
    (
        "06-text-oddities",
        "YAML",
        "convert bom.yaml o.scen",
        SUCCESS,
        &["o.scen"],
    ),
    (
        "27-python-yaml-schedules",
        "many agents",
        "validate --map row.map --scen row.scen --agents 12 sorted.yaml",
        SUCCESS,
        &["valid"],
    ),
    (
        "27-python-yaml-schedules",
        "gap",
        "validate --map m.map --scen follow.scen --agents 2 gap.yaml",
        INPUT,
        &["gap.yaml:7:5: a move that takes from time 0 to 5"],
    ),
];

/// Files that are read the same.
fn same(tests: &mut Tests) {
    let maps = [
        "bom", "blank", "crlf", "nonl", "renamed", "tab", "upper", "wh",
    ];
    tests.add("public::06-text-oddities::same map", move || {
        let yard = yard("06-text-oddities");
        let digest = |name: &str| {
            let ended = yard.line(&format!("maps info {name} --format json"));
            ended.expect(SUCCESS).json()["digest"].clone()
        };
        let plain = digest("lf.map");
        assert!(plain.is_string(), "{plain}");
        for name in maps {
            assert_eq!(digest(&format!("{name}.map")), plain, "{name}");
        }
        assert_eq!(digest("lf.txt"), plain);
    });
    let scenarios = [
        "bom",
        "bomnov",
        "crlf",
        "exp",
        "noversion",
        "ok",
        "spaces",
        "unixpath",
        "upper",
        "v10",
        "winpath",
    ];
    tests.add("public::06-text-oddities::same scenario", move || {
        let yard = yard("06-text-oddities");
        for name in scenarios {
            let line = format!("validate --map lf.map --scen {name}.scen --agents 1 one.json");
            yard.write(
                "one.json",
                "{\"paths\": [[[0,0],[0,1],[0,2],[0,3],[1,3],[2,3]]]}",
            );
            yard.line(&line).expect(SUCCESS);
        }
    });
    let plans = [
        "bom-plan.json",
        "bom-paths.txt",
        "crlf.json",
        "crlf-paths.txt",
        "crlf-lacam.txt",
    ];
    let schedules = ["a", "comment", "doc", "float", "flow", "names", "quoted"];
    for (case, files) in [
        ("06-text-oddities", plans.map(str::to_owned).to_vec()),
        (
            "27-python-yaml-schedules",
            schedules.map(|name| format!("{name}.yaml")).to_vec(),
        ),
    ] {
        tests.add(&format!("public::{case}::same plan"), move || {
            let yard = yard(case);
            yard.write(
                "follow.scen",
                "version 1\n0\tm.map\t4\t3\t0\t0\t2\t0\t2\n0\tm.map\t4\t3\t1\t0\t3\t0\t2\n",
            );
            yard.write(
                "m.map",
                "type octile\nheight 3\nwidth 4\nmap\n....\n.@..\n....\n",
            );
            let digests: Vec<_> = files
                .iter()
                .map(|file| {
                    let line = format!(
                        "validate --map m.map --scen follow.scen --agents 2 {file} --format json"
                    );
                    yard.line(&line).expect(SUCCESS).json()["plan_digest"].clone()
                })
                .collect();
            assert!(
                digests.iter().all(|digest| *digest == digests[0]),
                "{digests:?}"
            );
        });
    }
}

/// Plans that keep or break one rule each: agents, connectivity, whether it is valid, and what the
/// verdict says of it: costs, or the place and time.
fn judged(tests: &mut Tests) {
    let cases: [(&str, u32, u32, bool, &[&str]); 18] = [
        ("follow", 2, 4, true, &["sum of costs 4 steps"]),
        ("cycle", 4, 4, true, &["sum of costs 4 steps"]),
        (
            "wait",
            1,
            4,
            true,
            &["sum of costs 3 steps", "makespan     3 steps"],
        ),
        ("diag", 1, 8, false, &["corner-cut"]),
        ("cut", 1, 8, false, &["corner-cut"]),
        ("x8", 2, 8, false, &["diagonal-crossing"]),
        ("swap", 2, 4, false, &["swap-conflict", "times 0 and 1"]),
        (
            "parked",
            2,
            4,
            false,
            &["parked-conflict", "(0, 1) at time 2"],
        ),
        ("before", 2, 4, false, &["both at (1, 0) at time 3"]),
        ("jump", 1, 4, false, &["not-adjacent", "times 0 and 1"]),
        ("wrapcol", 1, 4, false, &["not-adjacent", "times 0 and 1"]),
        ("neg", 1, 4, false, &["outside the map at time 1"]),
        ("out", 1, 4, false, &["outside the map at time 1"]),
        ("obst", 1, 4, false, &["an obstacle at (1, 1) at time 1"]),
        (
            "start",
            1,
            4,
            false,
            &["begins at (0, 1), its start is (0, 0)"],
        ),
        ("short", 1, 4, false, &["ends at (0, 1) at time 1"]),
        (
            "few",
            2,
            4,
            false,
            &["the plan has 1 paths, the instance 2 agents"],
        ),
        ("diag", 1, 4, false, &["not-adjacent"]),
    ];
    for (name, agents, neighbours, valid, texts) in cases {
        tests.add(&format!("public::05-validator-semantics::{name} {neighbours}"), move || {
            let line = format!(
                "validate --map m.map --scen {name}.scen --agents {agents} --connectivity {neighbours} \
                 {name}.json"
            );
            let ended = yard("05-validator-semantics").line(&line);
            let ended = ended.expect(if valid { SUCCESS } else { INVALID_PLAN });
            for text in texts {
                assert!(ended.stdout.contains(text), "no `{text}`: {ended}");
            }
        });
    }
}

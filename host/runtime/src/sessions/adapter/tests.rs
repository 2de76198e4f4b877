//! Manifests that the reader takes and refuses.

use serde_json::json;

use super::input::{Agents, ProblemInput, Unit};
use super::manifest::{Condition, Manifest, Searched};

const MINIMAL: &str = r#"manifest = 1
id = "solver"
[program]
command = "solver"
args = ["{map}", "{scen}", "{output}"]
[output]
format = "lacam"
"#;

#[track_caller]
fn read(text: &str) -> Manifest {
    Manifest::read(text, "p.toml").unwrap_or_else(|error| panic!("{error}\n{text}"))
}

#[test]
fn the_smallest_manifest() {
    let manifest = read(MINIMAL);
    assert_eq!(manifest.id(), "solver");
    assert_eq!(manifest.options, serde_json::Value::Null);
    assert_eq!(manifest.output.source(), "output.txt");
    let here = manifest.program.place.error("here").to_string();
    assert_eq!(here, "p.toml:4:11: here");
}

/// An instance of pibt2 names its map, and one of libMultiRobotPlanning has it in it.
#[test]
fn a_solver_of_pibt2_instances_needs_no_argument_for_the_map() {
    for (word, expected) in [("pibt2", Agents::Pibt2), ("libmrp", Agents::Libmrp)] {
        let text = MINIMAL.replace("\"{map}\", ", "");
        let text = text.replace("[output]", &format!("[input]\nscen = \"{word}\"\n[output]"));
        let ProblemInput::Grid(input) = read(&text).input.problem else {
            panic!("a grid");
        };
        assert_eq!(input.scen, expected);
    }
}

#[test]
fn everything_that_a_manifest_may_say() {
    let manifest = read(
        r#"
manifest = 1
id = "my-solver.v2"
name = "My Solver"
description = "Solves."
license = "MIT"
homepage = "https://example.org"

[version]
args = ["--version"]
pattern = 'version (\S+)'
seconds = 2
otherwise = "2.x"

[program]
command = "bin/solver"
variable = "MY_SOLVER_V2"
args = [
    "-m={map}", "-i", "{scen}", "{{literal}}",
    { when = "option.greedy", args = ["--greedy"] },
    { when = "option.bound", args = ["-w", "{option.bound}"] },
    { when = "memory_mb", args = ["--memory", "{memory_mb}"] },
    { when = "nodes", args = ["--nodes", "{nodes}"] },
]
env = { OMP_NUM_THREADS = "{threads}" }
cwd = "{manifest_dir}/data"
install = "build it"
reserve_ms = 250
reserve_ns_per_agent_cell = 100

[options.greedy]
type = "boolean"
default = false

[options.bound]
type = "number"
description = "Suboptimality"
minimum = 1
maximum = 2.5

[options.mode]
type = "string"
enum = ["fast", "good"]
default = "good"

[input]
map = "movingai"
scen = "movingai"
letters = "all"
order = "row-col"

[output]
from = "stdout"
format = "custom"

[output.custom]
layout = "agent-major"
line = "Agent {agent}: {path}"
position = "[{row} {col}]"
separator = "; "
coordinates_from = 1
index_from = 1
skip_lines = 2
begin = "^paths$"
end = "^done"
ignore = "^#"

[exit]
codes = { 0 = "solved", 3 = "timed-out" }

[[exit.patterns]]
pattern = "(?i)no solution"
from = "stderr"
status = "infeasible"
message = "it proved that there is none"

[metrics]
expanded = { pattern = 'expanded: (\d+)' }
runtime = { pattern = 'took ([0-9.]+) ?ms', from = "output", unit = "ms" }

[capabilities]
deterministic = true
threads = false
eight-connected = true

[files]
read = ["/opt/solver", "weights"]
"#,
    );
    let program = &manifest.program;
    assert_eq!(
        program.arguments[5].when,
        Some(Condition::Option("bound".into()))
    );
    assert_eq!(
        manifest.options["properties"]["bound"],
        json!({ "type": "number", "description": "Suboptimality", "minimum": 1, "maximum": 2.5 })
    );
    assert_eq!(manifest.options["additionalProperties"], json!(false));
    assert_eq!(manifest.output.source(), "standard output");
    assert_eq!(manifest.exit.codes.len(), 2);
    assert_eq!(manifest.exit.patterns[0].from, Searched::Stderr);
    let names: Vec<&str> = manifest
        .metrics
        .iter()
        .map(|metric| metric.name.as_str())
        .collect();
    assert_eq!(names, ["expanded", "runtime_ms"]);
    assert_eq!(
        claimed(&manifest),
        ["grid", "eight-connected", "pebble", "deterministic"]
    );
    assert_eq!(manifest.head.files.read.len(), 2);
}

const ROADMAPS: &str = r#"manifest = 1
id = "solver"
[program]
command = "solver"
args = ["{roadmap}", "{task}", "{scratch}/config.xml"]
[input]
roadmap = "ccbs"
radius = 0.5
[input.files]
"config.xml" = "<limit>{seconds}</limit>"
[output]
file = "task_log.xml"
format = "ccbs-log"
"#;

const PLANE: &str = r#"manifest = 1
id = "solver"
[program]
command = "solver"
args = ["{problem}", "{output}"]
[input]
plane = "dynobench"
[[input.robots]]
type = "unicycle_first_order_0"
dynamics = "fleetyard.unicycle/1"
rectangle_m = [0.5, 0.25]
controls = [[-0.5, 0.5], [-0.5, 0.5]]
[output]
format = "dynobench"
"#;

fn claimed(manifest: &Manifest) -> Vec<&'static str> {
    let capabilities = manifest.capabilities.iter();
    capabilities
        .map(fleetyard_abi::Capability::as_str)
        .collect()
}

#[test]
fn solvers_of_roadmaps_and_of_the_plane() {
    let manifest = read(ROADMAPS);
    let ProblemInput::Roadmap(input) = &manifest.input.problem else {
        panic!("a roadmap");
    };
    assert_eq!(input.unit, Unit::Radius(0.5));
    assert_eq!(manifest.input.files[0].0, "config.xml");
    assert_eq!(claimed(&manifest), ["roadmap", "stop-go"]);
    assert!(manifest.input.problem.features().is_empty());
    // The problem's name may stand in a file alone.
    let text = ROADMAPS
        .replace("\"ccbs\"\nradius = 0.5", "\"psipp\"\nunits_per_m = 1024")
        .replace("\"{roadmap}\", \"{task}\", ", "")
        .replace("{seconds}", "{problem}")
        .replace("ccbs-log", "psipp-plan");
    let manifest = read(&text);
    assert!(matches!(
        &manifest.input.problem,
        ProblemInput::Roadmap(input) if input.unit == Unit::PerM(1024.0)
    ));
    let manifest = read(PLANE);
    assert_eq!(claimed(&manifest), ["continuous", "dynamics"]);
    assert_eq!(
        manifest.input.problem.features(),
        ["dynamics:fleetyard.unicycle/1"]
    );
}

#[test]
fn faults_of_inputs_say_where_and_what_to_do() {
    let cases = [
        (
            ROADMAPS,
            "radius = 0.5",
            "radius = 0.5\nunits_per_m = 2",
            "p.toml:9:15: `radius` and `units_per_m` both say",
            "remove one of them",
        ),
        (
            ROADMAPS,
            "radius = 0.5",
            "radius = 0",
            "p.toml:8:10: `radius` is not between 1e-6 and 1e6",
            "above 0",
        ),
        (
            ROADMAPS,
            "radius = 0.5",
            "letters = \"all\"",
            "p.toml:8:1: unknown key `letters` in [input]",
            "known keys: roadmap, radius, units_per_m, files",
        ),
        (
            ROADMAPS,
            "\"{task}\", ",
            "",
            "p.toml:3:1: no argument uses `{task}`",
            "what to solve",
        ),
        (
            ROADMAPS,
            "\"{task}\", ",
            "\"{task}\", \"{map}\", ",
            "p.toml:3:1: `{map}` is no file of this input",
            "`{roadmap}` and `{task}`",
        ),
        (
            ROADMAPS,
            "\"config.xml\" =",
            "\"task.xml\" =",
            "p.toml:10:1: \"task.xml\" is no name for a file of the input",
            "without folders",
        ),
        (
            ROADMAPS,
            "task_log.xml",
            "config.xml",
            "p.toml:12:8: config.xml is a file of the input",
            "another file",
        ),
        (
            ROADMAPS,
            "ccbs-log",
            "lacam",
            "p.toml:13:10: `format` cannot be \"lacam\"",
            "it is one of trajectories, roadmap-plan, ccbs-log, psipp-plan",
        ),
        (
            ROADMAPS,
            "<limit>",
            "{option.limit}",
            "p.toml:10:16: there is no option `limit`",
            "[options.limit]",
        ),
        (
            PLANE,
            "rectangle_m = [0.5, 0.25]",
            "",
            "p.toml:8:1: the robot `unicycle_first_order_0` has no footprint or two",
            "rectangle_m",
        ),
        (
            PLANE,
            "[[-0.5, 0.5], [",
            "[[0.5, -0.5], [",
            "p.toml:12:13: `controls` has limits that are none",
            "[least, most]",
        ),
        (
            PLANE,
            "fleetyard.unicycle/1",
            "unicycle",
            "p.toml:10:12: \"unicycle\" is no name of dynamics",
            "fleetyard.unicycle/1",
        ),
        (
            PLANE,
            "unicycle_first_order_0",
            "a: b",
            "p.toml:9:8: \"a: b\" is no type of robots",
            "letters",
        ),
    ];
    for (text, old, new, reason, hint) in cases {
        assert!(text.contains(old), "{old}");
        let error = Manifest::read(&text.replacen(old, new, 1), "p.toml").expect_err(new);
        let told = error.to_string();
        assert!(told.starts_with(reason), "{new}: {told}");
        let found = error.hint.unwrap_or_default();
        assert!(found.contains(hint), "{new}: {found}");
    }
}

/// In `MINIMAL`, `old` becomes `new`; the error and its hint begin and contain.
#[test]
fn faults_say_where_and_what_to_do() {
    let cases = [
        (
            "manifest = 1",
            "manifest = 2",
            "p.toml:1:12: this manifest is written for a newer",
            "manifest = 1",
        ),
        (
            "manifest = 1",
            "",
            "p.toml:1:1: the key `manifest` is missing",
            "add `manifest = …`",
        ),
        (
            "manifest = 1",
            "manifest = one",
            "p.toml:1:12: this is not TOML",
            "",
        ),
        (
            "manifest = 1",
            "manifest = \"1\"",
            "p.toml:1:12: `manifest` is a string, expected an integer",
            "",
        ),
        (
            "manifest = 1",
            "manifest = 1\nid = \"x\"",
            "p.toml:3:1: this is not TOML: duplicate key",
            "",
        ),
        (
            "id = \"solver\"",
            "id = \"My Solver\"",
            "p.toml:2:6: \"My Solver\" is no identifier",
            "begins with a-z",
        ),
        (
            "id = \"solver\"",
            "id = \"x\"\nlisence = \"MIT\"",
            "p.toml:3:1: unknown key `lisence`",
            "did you mean `license`?",
        ),
        (
            "id = \"solver\"",
            "id = \"x\"\nzzzzzzzz = 1",
            "p.toml:3:1: unknown key `zzzzzzzz`",
            "known keys: manifest, id",
        ),
        (
            "id = \"solver\"",
            "id = \"x\"\nversion = 2",
            "p.toml:3:11: `version` is an integer, expected a string",
            "",
        ),
        (
            "id = \"solver\"",
            "id = \"x\"\nversion = { args = [] }",
            "p.toml:3:11: the key `pattern` is missing in [version]",
            "",
        ),
        (
            "id = \"solver\"",
            "id = \"x\"\nversion = { args = [], pattern = 'v' }",
            "p.toml:3:34: the pattern has 0 groups in parentheses, expected 1",
            "",
        ),
        (
            "id = \"solver\"",
            "id = \"x\"\nversion = { args = [], pattern = '(v' }",
            "p.toml:3:34: the pattern cannot be used: unclosed group",
            "crate `regex`",
        ),
        (
            "id = \"solver\"",
            "id = \"x\"\nversion = { args = ['{map}'], pattern = '(v)' }",
            "p.toml:3:21: here the only placeholder is",
            "",
        ),
        (
            "id = \"solver\"",
            "id = \"x\"\nversion = { args = [], pattern = '(v)', supported = '(1' }",
            "p.toml:3:53: the pattern cannot be used: unclosed group",
            "crate `regex`",
        ),
        (
            "id = \"solver\"",
            "id = \"x\"\nversion = { args = [], pattern = '(v)', supported = '(1)' }",
            "p.toml:3:53: the pattern has 1 groups in parentheses, expected 0",
            "(?:…)",
        ),
        (
            "id = \"solver\"",
            "id = \"x\"\nversion = { args = [], pattern = '(v)', supported = '1', otherwise = '2' }",
            "p.toml:3:70: `otherwise` lets any program pass",
            "remove one of them",
        ),
        (
            "command = \"solver\"",
            "comand = \"solver\"",
            "p.toml:4:1: unknown key `comand` in [program]",
            "did you mean `command`?",
        ),
        (
            "command = \"solver\"",
            "command = \" \"",
            "p.toml:4:11: `command` is empty",
            "",
        ),
        (
            "command = \"solver\"",
            "command = \"s\\u0000\"",
            "p.toml:4:11: a NUL character",
            "",
        ),
        (
            "command = \"solver\"",
            "",
            "p.toml:3:1: the key `command` is missing in [program]",
            "add `command = …`",
        ),
        (
            "args = [\"{map}\"",
            "args = [\"{mapp}\"",
            "p.toml:5:9: unknown placeholder `{mapp}`",
            "did you mean `{map}`?",
        ),
        (
            "args = [\"{map}\"",
            "args = [\"{map\"",
            "p.toml:5:9: a single `{`",
            "write {{",
        ),
        (
            "\"{map}\", \"{scen}\"",
            "\"{map}\"",
            "p.toml:3:1: no argument uses `{scen}`",
            "what to solve",
        ),
        (
            "\"{output}\"",
            "3",
            "p.toml:5:28: `args` is an integer, expected a string",
            "",
        ),
        (
            "\"{output}\"",
            "{ wen = \"nodes\" }",
            "p.toml:5:30: unknown key `wen` in [[program.args]]",
            "`when`",
        ),
        (
            "\"{output}\"",
            "{ when = \"option.x\", args = [] }",
            "p.toml:5:37: \"option.x\" is no condition",
            "[options]",
        ),
        (
            "\"{output}\"",
            "\"{option.x}\"",
            "p.toml:5:28: there is no option `x`",
            "[options.x]",
        ),
        (
            "[output]",
            "variable = \"A-B\"\n[output]",
            "p.toml:6:12: `A-B` cannot be the name of an environment",
            "",
        ),
        (
            "[output]",
            "reserve_ms = -1\n[output]",
            "p.toml:6:14: `reserve_ms` is not between 0 and 60000",
            "",
        ),
        (
            "[output]",
            "reserve_ns_per_agent_cell = 0.5\n[output]",
            "p.toml:6:29: `reserve_ns_per_agent_cell` is a number, expected an integer",
            "",
        ),
        (
            "[output]",
            "cwd = \"{map}\"\n[output]",
            "p.toml:6:7: the working folder is made from",
            "",
        ),
        (
            "[output]",
            "[options.x]\ntype = \"list\"\n[output]",
            "p.toml:7:8: `type` cannot be \"list\"",
            "integer, number, boolean, string",
        ),
        (
            "[output]",
            "[options.x]\ntype = \"integr\"\n[output]",
            "p.toml:7:8: `type` cannot be \"integr\"",
            "did you mean \"integer\"?",
        ),
        (
            "[output]",
            "[options.X]\ntype = \"integer\"\n[output]",
            "p.toml:6:10: `X` cannot be the name of an option",
            "a-z",
        ),
        (
            "[output]",
            "[options.x]\ntype = \"integer\"\ndefault = 1.5\n[output]",
            "p.toml:8:11: the default of option `x`: 1.5 is not of type",
            "integer",
        ),
        (
            "[output]",
            "[options.x]\ntype = \"integer\"\ndefault = 0\nminimum = 1\n[output]",
            "p.toml:8:11: the default of option `x`: 0 is less than",
            "",
        ),
        (
            "[output]",
            "[options.x]\ntype = \"string\"\nminimum = 1\n[output]",
            "p.toml:8:11: `minimum` is a number, for options",
            "",
        ),
        (
            "[output]",
            "[options.x]\ntype = \"number\"\ndefault = nan\n[output]",
            "p.toml:8:11: `default` is not a finite number",
            "",
        ),
        (
            "[output]",
            "[options.x]\ntype = \"string\"\nenum = []\n[output]",
            "p.toml:8:8: `enum` is empty",
            "",
        ),
        (
            "[output]",
            "[input]\nmap = \"yaml\"\n[output]",
            "p.toml:7:7: `map` cannot be \"yaml\"",
            "movingai",
        ),
        (
            "[output]",
            "[input]\norder = \"rowcol\"\n[output]",
            "p.toml:7:9: `order` cannot be \"rowcol\"",
            "did you mean \"row-col\"?",
        ),
        (
            "[output]",
            "[input]\nscen = \"pibt2\"\norder = \"row-col\"\n[output]",
            "p.toml:8:9: the order in instances of pibt2 and libMultiRobotPlanning is fixed",
            "remove `order`",
        ),
        (
            "format = \"lacam\"",
            "format = \"lacam2\"",
            "p.toml:7:10: `format` cannot be \"lacam2\"",
            "did you mean \"lacam\"?",
        ),
        (
            "format = \"lacam\"",
            "",
            "p.toml:6:1: the key `format` is missing in [output]",
            "",
        ),
        (
            "format = \"lacam\"",
            "format = \"custom\"",
            "p.toml:7:10: a custom format is described in [output.custom]",
            "",
        ),
        (
            "format = \"lacam\"",
            "format = \"lacam\"\nfile = \"../x\"",
            "p.toml:8:8: \"../x\" is no name for a file",
            "without folders",
        ),
        (
            "format = \"lacam\"",
            "format = \"lacam\"\nfile = \"map.map\"",
            "p.toml:8:8: \"map.map\" is no name",
            "",
        ),
        (
            "format = \"lacam\"",
            "format = \"lacam\"\nfrom = \"stdout\"",
            "p.toml:3:1: an argument uses `{output}`, but",
            "{scratch}",
        ),
        (
            "format = \"lacam\"",
            "format = \"lacam\"\nfrom = \"stdout\"\nfile = \"x\"",
            "p.toml:9:8: there is no file",
            "",
        ),
        (
            "format = \"lacam\"",
            "format = \"lacam\"\ncustom = {}",
            "p.toml:8:10: the format is a named one",
            "",
        ),
        (
            "format = \"lacam\"",
            "format = \"lacam\"\n[metrics]\nsoc = { pattern = 'soc' }",
            "p.toml:9:19: the pattern has 0 groups in parentheses, expected 1",
            "one group",
        ),
        (
            "format = \"lacam\"",
            "format = \"lacam\"\n[metrics]\nsoc = { pattern = '(s)', unit = 'µ' }",
            "p.toml:9:33: \"µ\" is no unit",
            "\"ms\"",
        ),
        (
            "format = \"lacam\"",
            "format = \"lacam\"\n[metrics]\nsoc = { pattern = '(s)', from = 'logs' }",
            "p.toml:9:33: `from` cannot be \"logs\"",
            "\"log\"",
        ),
        (
            "format = \"lacam\"",
            "format = \"lacam\"\n[exit]\ncodes = { 256 = \"solved\" }",
            "p.toml:9:11: `256` is no exit code",
            "0 to 255",
        ),
        (
            "format = \"lacam\"",
            "format = \"lacam\"\n[exit]\ncodes = { 2 = \"timeout\" }",
            "p.toml:9:15: `2` cannot be \"timeout\"",
            "timed-out",
        ),
        (
            "format = \"lacam\"",
            "format = \"lacam\"\n[[exit.patterns]]\npattern = '(x)'\nstatus = 'solved'",
            "p.toml:9:11: the pattern has 1 groups",
            "(?:…)",
        ),
        (
            "format = \"lacam\"",
            "format = \"lacam\"\n[[exit.patterns]]\npattern = 'x'",
            "p.toml:8:1: the key `status` is missing in [[exit.patterns]]",
            "",
        ),
        (
            "format = \"lacam\"",
            "format = \"lacam\"\n[capabilities]\nanytime = true",
            "p.toml:9:1: an adapter cannot claim `anytime`",
            "it may claim eight-connected",
        ),
        (
            "format = \"lacam\"",
            "format = \"lacam\"\n[capabilities]\nfast = true",
            "p.toml:9:1: unknown capability `fast`",
            "deterministic",
        ),
        (
            "format = \"lacam\"",
            "format = \"lacam\"\n[capabilities]\nthreads = 4",
            "p.toml:9:11: `threads` is an integer, expected true or false",
            "",
        ),
        (
            "format = \"lacam\"",
            "format = \"lacam\"\n[files]\nread = \"/opt\"",
            "p.toml:9:8: `read` is a string, expected a list",
            "",
        ),
    ];
    for (old, new, reason, hint) in cases {
        assert!(MINIMAL.contains(old), "{old}");
        let text = MINIMAL.replacen(old, new, 1);
        let error = Manifest::read(&text, "p.toml").expect_err(&text);
        assert!(error.to_string().starts_with(reason), "{text}\n{error}");
        let told = error.hint.unwrap_or_default();
        assert!(told.contains(hint), "{text}\n{reason}: {told}");
    }
}

#[test]
fn faults_in_custom_formats() {
    let cases = [
        ("", "p.toml:8:1: the key `layout` is missing"),
        (
            "layout = 'columns'",
            "p.toml:9:10: `layout` cannot be \"columns\"",
        ),
        (
            "layout = 'rows'\norder = 'x-y'\nline = '{agent} {position}'",
            "p.toml:11:8: the line needs `{time}` once",
        ),
        (
            "layout = 'rows'\norder = 'x-y'\nline = '{agent},{time}: {path}'",
            "p.toml:11:8: unknown placeholder `{path}`",
        ),
        (
            "layout = 'rows'\norder = 'x-y'\nseparator = ';'",
            "p.toml:11:13: a row has one position",
        ),
        (
            "layout = 'agent-major'",
            "p.toml:8:1: neither `order` nor `position` says",
        ),
        (
            "layout = 'agent-major'\norder = 'xy'",
            "p.toml:10:9: `order` cannot be \"xy\"",
        ),
        (
            "layout = 'agent-major'\norder = 'x-y'\nposition = '{cell}'",
            "p.toml:11:12: `order` and `position` say",
        ),
        (
            "layout = 'agent-major'\nposition = '({row},{row})'",
            "p.toml:10:12: the position needs a row and a column",
        ),
        (
            "layout = 'agent-major'\nposition = '({row},{z})'",
            "p.toml:10:12: unknown placeholder `{z}`",
        ),
        (
            "layout = 'agent-major'\nposition = '({row'",
            "p.toml:10:12: a single brace",
        ),
        (
            "layout = 'agent-major'\nposition = '{row}{col}'",
            "p.toml:10:12: nothing stands between",
        ),
        (
            "layout = 'agent-major'\norder = 'cell'\nline = '{agent}'",
            "p.toml:11:8: the line needs `{path}` once",
        ),
        (
            "layout = 'agent-major'\norder = 'cell'\nline = '{agent}{path}'",
            "p.toml:11:8: nothing stands between",
        ),
        (
            "layout = 'agent-major'\norder = 'cell'\nline = '{time}:{path}'",
            "p.toml:11:8: unknown placeholder `{time}`",
        ),
        (
            "layout = 'time-major'\norder = 'cell'\nline = '{time}:{time}:{path}'",
            "p.toml:11:8: the line has `{time}` twice",
        ),
        (
            "layout = 'time-major'\norder = 'cell'\nseparator = '1'",
            "p.toml:11:13: the separator reads like a number",
        ),
        (
            "layout = 'time-major'\norder = 'cell'\ncoordinates_from = 2",
            "p.toml:11:20: `coordinates_from` is not between 0 and 1",
        ),
        (
            "layout = 'time-major'\norder = 'cell'\nskip = 1",
            "p.toml:11:1: unknown key `skip` in [output.custom]",
        ),
        (
            "layout = 'time-major'\norder = 'cell'\nbegin = '('",
            "p.toml:11:9: the pattern cannot be used",
        ),
    ];
    for (custom, reason) in cases {
        let described = format!("format = \"custom\"\n[output.custom]\n{custom}\n");
        let text = MINIMAL.replace("format = \"lacam\"", &described);
        let error = Manifest::read(&text, "p.toml").expect_err(&text);
        assert!(error.to_string().starts_with(reason), "{text}\n{error}");
    }
}

#[test]
fn rows_of_agent_time_and_position_are_paths() {
    let described = |more: &str| {
        let output = format!("format = \"custom\"\n[output.custom]\nlayout = 'rows'\n{more}\n");
        read(&MINIMAL.replace("format = \"lacam\"", &output))
    };
    let answer = |manifest: &Manifest, text: &str, agents| {
        let plan = manifest.read_answer(text.as_bytes(), (3, 4), agents);
        let plan = plan.map_err(|error| error.to_string())?;
        let paths = plan.paths().map(<[u32]>::to_vec);
        Ok::<_, String>(paths.collect::<Vec<_>>())
    };
    let plain = described("order = 'x-y'\nignore = '^agent'");
    let both = Ok(vec![vec![1, 5], vec![11, 11, 7]]);
    let text = "agent,t,x,y\n0,0,1,0\n1,0,3,2\n0,1,1,1\n1,1,3,2\n1,2,3,1\n";
    assert_eq!(answer(&plain, text, 2), both);
    let lines: Vec<&str> = text.lines().rev().collect();
    assert_eq!(answer(&plain, &lines.join("\r\n"), 2), both);
    let written = "position = '[{row} {col}]'\nline = 't={time} a{agent} {position};'\n\
                   coordinates_from = 1\nindex_from = 1";
    let text = "t=1 a2 [3 4];\nt=2 a2 [3 4];\nt=3 a2 [2 4];\nt=1 a1 [1 2];\nt=2 a1[2 2] ;\n";
    assert_eq!(answer(&described(written), text, 2), both);
    let cells = described("order = 'cell'");
    assert_eq!(
        answer(&cells, "0,0,9\n0,1,99\n", 1),
        Ok(vec![vec![9, u32::MAX]])
    );
    for (text, reason) in [
        ("", "output.txt:1: there is no row for agent 0 of 2"),
        ("0,0,1\n", "output.txt:2: there is no row for agent 1 of 2"),
        (
            "1,0,1\n",
            "output.txt:1: there is no row for agent 0, but one for 1",
        ),
        (
            "0,0,1\n2,0,1\n",
            "output.txt:2:1: a path for agent 2, but there are 2 agents",
        ),
        (
            "0,0,1\n0,-1,1\n",
            "output.txt:2:1: time step -1 is out of range",
        ),
        (
            "0,0,1\n1,1,1\n1,0,1\n0,2,1\n",
            "output.txt:4: of the rows for agent 0 there is none for time step 1",
        ),
        (
            "1,0,1\n0,0,1\n1,0,2\n",
            "output.txt:3: of the rows for agent 1 there is a second one for time step 0",
        ),
        (
            "0,0,1\n0,1\n",
            "output.txt:2:4: expected ',', found the end",
        ),
        ("0,0,1,2\n", "output.txt:1:6: expected the end of the line"),
        (
            "0,999999999,1\n",
            "output.txt:1:1: time step 999999999 is out of range",
        ),
    ] {
        let error = answer(&cells, text, 2).expect_err(text);
        assert!(error.starts_with(reason), "{text}\n{error}");
    }
}

#[test]
fn an_answer_of_another_map_or_team_is_refused() {
    let manifest = read(&MINIMAL.replace("lacam", "plan"));
    let answer =
        r#"{"format": "fleetyard.plan/1", "rows": 3, "cols": 4, "paths": [[[0, 0], [0, 1]]]}"#;
    let read = |size, agents| {
        let plan = manifest.read_answer(answer.as_bytes(), size, agents);
        plan.map(|plan| plan.cells().to_vec())
            .map_err(|error| error.to_string())
    };
    assert_eq!(read((3, 4), 1), Ok(vec![0, 1]));
    let other = read((4, 3), 1).unwrap_err();
    assert!(
        other.contains("a map of 3 × 4 cells, but the map has 4 × 3"),
        "{other}"
    );
    assert!(
        read((3, 4), 2)
            .unwrap_err()
            .contains("1 paths for 2 agents")
    );
}

#[test]
fn a_manifest_is_bounded() {
    let text = format!("{MINIMAL}# {}", "x".repeat(1 << 20));
    let error = Manifest::read(&text, "p.toml").expect_err("too long");
    assert!(
        error.to_string().contains("at most 1048576 bytes"),
        "{error}"
    );
    let deep = format!("x = {}1{}", "[".repeat(100_000), "]".repeat(100_000));
    assert!(Manifest::read(&deep, "p.toml").is_err());
    // A pattern that would need much memory is refused before it does.
    let pattern = r"format = 'lacam'
[metrics]
x = { pattern = '((a{1000}){1000}){1000}' }";
    let text = MINIMAL.replace("format = \"lacam\"", pattern);
    assert!(Manifest::read(&text, "p.toml").is_err());
}

proptest::proptest! {
    /// Whatever is cut out of a manifest, or put into it, it is read or refused.
    #[test]
    fn no_manifest_panics(at in 0..400_usize, length in 0..40_usize, put in "\\PC{0,8}") {
        let at = MINIMAL.floor_char_boundary(at.min(MINIMAL.len()));
        let end = MINIMAL.floor_char_boundary((at + length).min(MINIMAL.len()));
        let text = format!("{}{put}{}", &MINIMAL[..at], &MINIMAL[end..]);
        let _ = Manifest::read(&text, "p.toml");
    }
}

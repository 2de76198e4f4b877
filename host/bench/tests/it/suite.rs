//! Suite files: what they mean, and what is said about those that mean nothing.

use std::collections::BTreeSet;
use std::path::Path;

use fleetyard_bench::suite::{Question, Suite, SuiteInstance, load_suite};
use fleetyard_bench::{BudgetOptions, Robots};
use fleetyard_core::document::Setting;
use fleetyard_core::{Connectivity, InputError, Separation};
use fleetyard_testkit::each;

/// Reads a suite whose paths are relative to the folder of the repository's own maps.
fn read(text: &str) -> Result<Suite, InputError> {
    read_with(text, &[])
}

fn read_with(text: &str, settings: &[&str]) -> Result<Suite, InputError> {
    let settings: Result<Vec<Setting>, InputError> = settings
        .iter()
        .map(|setting| Setting::new("--set", setting))
        .collect();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../maps");
    let variable = |name: &str| (name == "PLACE").then(|| ".".to_owned());
    Suite::read("s.toml", text, &settings?, &folder, &variable)
}

/// A suite with these instances.
fn with(instances: &str) -> String {
    format!("name = \"test\"\nplanner = [{{ plugin = \"lacam\" }}]\n[[instances]]\n{instances}\n")
}

fn instances(text: &str) -> Result<Vec<SuiteInstance>, InputError> {
    read(text)?.instances()
}

fn told(instances: &[SuiteInstance]) -> Vec<String> {
    instances.iter().map(ToString::to_string).collect()
}

#[test]
fn scenarios_by_team_size_and_connectivity() {
    let text = with(
        "scen = \"${PLACE}/random-32-32-20-random-?.scen\"\nagents = [20, 10]\nconnectivity = [4, 8]",
    );
    let instances = instances(&text).unwrap();
    let first = "random-32-32-20, random-32-32-20-random-1.scen";
    assert_eq!(
        told(&instances),
        [
            format!("{first}, 20 agents"),
            format!("{first}, 10 agents"),
            format!("{first}, 20 agents, 8-connected"),
            format!("{first}, 10 agents, 8-connected"),
        ]
    );
    let large = instances[0].grid_instance().unwrap();
    let small = instances[3].grid_instance().unwrap();
    assert_eq!(small.connectivity(), Connectivity::Eight);
    assert_eq!(instances[3].connectivity(), Some(Connectivity::Eight));
    assert_eq!(small.starts(), &large.starts()[..10]);
    assert!(std::sync::Arc::ptr_eq(small.grid(), large.grid()));
    assert_eq!(instances[3].digest().unwrap(), small.digest());
}

#[test]
fn mazes_of_the_paper() {
    let text = with("maze = { width = 15, height = 15, random = \"python\", count = 50 }");
    let instances = instances(&text).unwrap();
    assert_eq!(instances.len(), 50);
    let last = instances[49].origin();
    let maze = last.maze.unwrap();
    assert_eq!((maze.index, maze.seed, maze.width), (49, 56, 15));
    assert_eq!(last.map, "maze-31-31-1-backtracker");
    assert_eq!(last.scenario, "python seed 56");
    let instance = instances[49].grid_instance().unwrap();
    let grid = instance.grid();
    assert_eq!((grid.rows(), grid.cols()), (31, 31));
    assert_eq!(grid.row_col(instance.starts()[0]), (1, 1));
    assert_eq!(grid.row_col(instance.goals()[0]), (15, 15));
}

#[test]
fn generated_maps_by_seed() {
    let text = with(
        "generate = { kind = \"random\", rows = 16, cols = 16, obstacle_density = 0.2, \
         seeds = { from = 3, count = 2 }, scenario_seeds = [1, 9] }\nagents = { from = 5, to = 15, step = 5 }",
    );
    let instances = instances(&text).unwrap();
    assert_eq!(instances.len(), 2 * 2 * 3);
    assert_eq!(
        instances[4].to_string(),
        "random-16-16-20, map seed 3, agents seed 9, 10 agents"
    );
    let digests: std::collections::BTreeSet<_> = instances
        .iter()
        .map(|instance| instance.digest().unwrap())
        .collect();
    assert_eq!(digests.len(), instances.len());
    // In any order, and however often it is asked for.
    let again = read(&text).unwrap().instances().unwrap();
    assert_eq!(again[4].digest(), instances[4].digest());
    let grids = [0, 1].map(|at| instances[at].grid_instance().unwrap().grid().clone());
    assert!(std::sync::Arc::ptr_eq(&grids[0], &grids[1]));
}

#[test]
fn a_hundred_thousand_mazes_are_not_made_before_they_are_asked_for() {
    let text =
        with("maze = { size = 255, algorithm = [\"backtracker\", \"prim\"], count = 50_000 }");
    let instances = instances(&text).unwrap();
    assert_eq!(instances.len(), 100_000);
    let maze = instances[99_999].origin().maze.unwrap();
    assert_eq!((maze.index, maze.seed), (49_999, 50_006));
    assert_eq!(maze.algorithm.name(), "prim");
}

#[test]
fn other_formats_name_their_agents_and_maps() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name);
    std::fs::write(
        place("m.map"),
        "type octile\nheight 1\nwidth 4\nmap\n....\n",
    )
    .unwrap();
    std::fs::write(
        place("a.txt"),
        "map_file=m.map\nagents=1\nseed=0\nrandom_problem=0\nmax_timestep=9\nmax_comp_time=9\n0,0,3,0\n",
    )
    .unwrap();
    let text = with("scen = \"a.txt\"");
    let suite = Suite::read("s.toml", &text, &[], folder.path(), &|_| None).unwrap();
    let instances = suite.instances().unwrap();
    assert_eq!(told(&instances), ["m, a.txt, 1 agent"]);
    assert_eq!(instances[0].grid_instance().unwrap().goals(), [3]);
}

const FULL: &str = r#"
name = "full"
description = "Everything"

[protocol]
repeats = 3
warm_ups = 1
retry_contended = 2
keep_plans = true
seeds = { from = 0, to = 4 }
reuse = "planner"
clock = "call"
path_rule = "supercover"
ranking = "appendix"

[budget]
wall = "1500ms"
memory = "2GiB"
nodes = 18446744073709551615
threads = 2

[sandbox]
level = "strict"
disk = "1MiB"
read = ["more", "/usr"]
env = { OMP_NUM_THREADS = "1" }
pin = false

[execution]
model = "agv"
cell_size_m = 0.5
policy = "adg"
delay = "bernoulli:0.1,2s"
start_heading_deg = 180

[[planner]]
label = "R1"
plugin = "weighted-astar"
options = { weight = 1.5 }

[[planner]]
plugin = "${PLACE}/vendor.so:theirs"
attach = "in-process"
options = { mode = "fast", deep = { list = [1, 2.5] } }

[[instances]]
maze = { size = [3, 5], seeds = [1, 2] }
"#;

#[test]
fn everything_that_a_suite_may_say() {
    let suite = read(FULL).unwrap();
    let protocol = &suite.protocol;
    assert_eq!((protocol.repeats, protocol.warm_ups), (3, 1));
    assert_eq!(protocol.retry_contended, 2);
    assert!(protocol.keep_plans);
    assert_eq!(protocol.seeds, [0, 1, 2, 3, 4]);
    let names = [
        protocol.reuse.name(),
        protocol.clock.name(),
        protocol.path_rule.name(),
        protocol.ranking.name(),
    ];
    assert_eq!(names, ["planner", "call", "supercover", "appendix"]);
    let budget = &suite.budget;
    assert_eq!(budget.wall.as_millis(), 1500);
    assert_eq!(budget.memory_bytes, Some(2 << 30));
    assert_eq!((budget.nodes, budget.threads), (u64::MAX, 2));
    assert_eq!(budget.startup, BudgetOptions::default().startup);
    let policy = &suite.sandbox.policy;
    assert_eq!(policy.disk_bytes, 1 << 20);
    assert!(policy.read[0].ends_with("maps/more"));
    assert_eq!(policy.read[1], Path::new("/usr"));
    assert_eq!(policy.env, [("OMP_NUM_THREADS".to_owned(), "1".to_owned())]);
    assert!(!suite.sandbox.pin);
    assert!(matches!(&suite.robots, Some(Robots::Model(name)) if name == "agv"));
    assert!((suite.config.cell_size_m - 0.5).abs() < 1e-12);
    let [one, other] = suite.planners.as_slice() else {
        panic!("two planners");
    };
    assert_eq!(
        (one.label.as_str(), one.plugin.as_str()),
        ("R1", "weighted-astar")
    );
    assert_eq!(
        one.options,
        *serde_json::json!({ "weight": 1.5 }).as_object().unwrap()
    );
    assert_eq!(other.label, "theirs deep={\"list\":[1,2.5]} mode=fast");
    assert!(
        other.plugin.ends_with("maps/./vendor.so:theirs"),
        "{}",
        other.plugin
    );
    assert_eq!(other.attach, Some(fleetyard_runtime::Attach::InProcess));
    let place = one.plugin_place.error("there is no planner").to_string();
    assert_eq!(place, "s.toml:38:10: there is no planner");
    let place = one.options_place.error("no such option").to_string();
    assert_eq!(place, "s.toml:39:11: no such option");
    assert_eq!(suite.instances().unwrap().len(), 4);
}

#[test]
fn the_digest_is_of_what_is_said() {
    let suite = read(FULL).unwrap();
    let other = FULL
        .replace("repeats = 3", "repeats=3 # as always")
        .replace("\"full\"", "\"x\"");
    assert_eq!(read(&other).unwrap().digest(), suite.digest());
    let other = read_with(FULL, &["protocol.repeats=4"]).unwrap();
    assert_ne!(other.digest(), suite.digest());
    assert_eq!(other.protocol.repeats, 4);
    assert!(
        other.normal().contains("\"repeats\": 4"),
        "{}",
        other.normal()
    );
}

#[test]
fn scenarios_that_are_too_small_may_be_left_out() {
    let text = with(
        "scen = \"empty-8-8-random-1.scen\"\nagents = [10, 10000]\ntoo_many_agents = \"skip\"",
    );
    assert_eq!(instances(&text).unwrap().len(), 1);
    let none = text.replace("[10, 10000]", "10000");
    let error = instances(&none).unwrap_err().to_string();
    assert!(error.ends_with("the suite has no instance: every team is larger than its scenario"));
}

/// The error of a text, shown as the command shows it.
fn fault(text: &str) -> String {
    let error = read(text)
        .and_then(|suite| suite.instances().map(drop))
        .expect_err(text);
    let hint = error
        .hint
        .clone()
        .map_or(String::new(), |hint| format!(" | {hint}"));
    let folder = format!("{}/../../maps/", env!("CARGO_MANIFEST_DIR"));
    format!("{error}{hint}").replace(&folder, "")
}

#[test]
fn faults_of_a_suite_have_places_and_hints() {
    let scen = "scen = \"empty-8-8-random-1.scen\"\nagents = [10]";
    let top = |lines: &str| format!("{lines}\n{}", with(scen));
    let suite = |lines: &str| format!("{}\n{lines}", with(scen));
    let cases = [
        // The file as a whole.
        ("name = ".to_owned(), "s.toml:1:8: this is not TOML: "),
        (
            with(scen).replace("name = \"test\"", ""),
            "s.toml:1:1: the key `name` is missing | add `name = …`",
        ),
        (
            with(scen).replace("test", "../test"),
            "s.toml:1:8: \"../test\" cannot be the name of a suite | files are named after it",
        ),
        (
            suite("[protocl]\nrepeats = 2"),
            "s.toml:7:2: unknown key `protocl` | did you mean `protocol`?",
        ),
        (
            suite("[protocol]\nrepeat = 2"),
            "s.toml:8:1: unknown key `repeat` in [protocol] | did you mean `repeats`?",
        ),
        (
            top("zigzag = 3"),
            "s.toml:1:1: unknown key `zigzag` | known keys: name, description",
        ),
        // Axes without values.
        (
            "name = \"x\"\n[[instances]]\nmaze = { size = 3, count = 1 }".into(),
            "s.toml:1:1: the key `planner` is missing",
        ),
        (
            "name = \"x\"\nplanner = []\n[[instances]]\nmaze = { size = 3, count = 1 }".into(),
            "s.toml:2:11: `planner` is empty, so there is nothing to run",
        ),
        (
            "name = \"x\"\ninstances = []\n[[planner]]\nplugin = \"pibt\"".into(),
            "s.toml:2:13: `instances` is empty, so there is nothing to run",
        ),
        (with("scen = []"), "s.toml:4:8: `scen` is empty"),
        (
            with(&scen.replace("[10]", "[]")),
            "s.toml:5:10: `agents` is empty",
        ),
        (
            suite("[protocol]\nseeds = []"),
            "s.toml:8:9: `seeds` is empty",
        ),
        (
            with("maze = { size = 3, count = 0 }"),
            "s.toml:4:28: `count` is not between 1 and 1000000",
        ),
        (
            with("maze = { size = 3, seeds = [] }"),
            "s.toml:4:28: `seeds` is empty",
        ),
        (
            with("scen = \"no-*.scen\"\nagents = 1"),
            "s.toml:4:8: no file matches no-*.scen",
        ),
        // Budgets.
        (
            suite("[budget]\nwall = \"0s\""),
            "s.toml:8:8: `wall` is zero, so nobody could do anything",
        ),
        (
            suite("[budget]\nwall = 10"),
            "s.toml:8:8: `wall` is an integer, expected a string | write it with its unit",
        ),
        (
            suite("[budget]\nwall = \"soon\""),
            "s.toml:8:8: `wall` is \"soon\", which is no duration | write it with its unit",
        ),
        (
            suite("[budget]\nmemory = \"1B\""),
            "s.toml:8:10: `memory` is less than 4KiB",
        ),
        (
            suite("[budget]\nnodes = 0"),
            "s.toml:8:9: `nodes` is not between 1 and",
        ),
        (
            suite("[budget]\nthreads = -1"),
            "s.toml:8:11: `threads` is not between 1 and 4096",
        ),
        // Sandbox and execution.
        (
            suite("[sandbox]\nlevel = \"stric\""),
            "s.toml:8:9: `level` cannot be \"stric\" | did you mean \"strict\"?",
        ),
        (
            suite("[execution]\nmodel = \"agx\""),
            "s.toml:8:9: model = \"agx\" is not a model or a preset",
        ),
        (
            suite("[execution]\ncell_size_m = -1"),
            "s.toml:8:15: cell_size_m = -1 is out of range | give metres between",
        ),
        (
            suite("[execution]\ndelay = \"often\""),
            "s.toml:8:9: delay = ",
        ),
        (
            suite("[execution]\nfleet = \"none.fleet.json\""),
            "s.toml:8:9: none.fleet.json: no such file",
        ),
        (
            suite("[execution]\nfleet = \"x\"\nmodel = \"agv\""),
            "s.toml:8:9: `model` and `fleet` are two ways",
        ),
        // Planners.
        (
            with(scen).replace(
                "{ plugin = \"lacam\" }",
                "{ plugin = \"pibt\" }, { plugin = \"pibt\" }",
            ),
            "s.toml:2:33: two planners are called \"pibt\" | give each a `label` of its own",
        ),
        (
            with(scen).replace("{ plugin = \"lacam\" }", "{ label = \"L\" }"),
            "s.toml:2:12: the key `plugin` is missing in [[planner]]",
        ),
        (
            with(scen).replace("\"lacam\"", "\"lacam\", attach = \"worke\""),
            "s.toml:2:41: `attach` cannot be \"worke\" | did you mean \"worker\"?",
        ),
        // Protocol.
        (
            suite("[protocol]\nrepeats = -3"),
            "s.toml:8:11: `repeats` is not between 1 and 1000000",
        ),
        (
            suite("[protocol]\nrepeats = 99999999999999999999"),
            "s.toml:8:11: `repeats` is not between 1 and 1000000",
        ),
        (
            suite("[protocol]\nseeds = [1, 2, 1]"),
            "s.toml:8:16: `seeds` has 1 twice | remove one of them",
        ),
        (
            suite("[protocol]\nseeds = { from = 1, to = 2_000_000 }"),
            "s.toml:8:26: `seeds` has more than 1000000 numbers",
        ),
        (
            suite("[protocol]\nseeds = { from = 1 }"),
            "s.toml:8:9: `seeds` has no end | add `to = …` or `count = …`",
        ),
        (
            suite("[protocol]\nseeds = { from = 0, count = 1_000_000 }\nrepeats = 1_000_000"),
            "s.toml:1:1: the suite has 1 planner × 1 instance × 1000000 seeds × 1000000 repeats = \
             1000000000000 trials | a suite has at most 1000000 instances and 10000000 trials",
        ),
        (
            suite("[protocol]\npath_rule = \"bresenham\""),
            "s.toml:5:10: empty-8-8, empty-8-8-random-1.scen, 10 agents: path rule bresenham is \
             for one agent | write `agents = 1`",
        ),
        // Instances.
        (
            with("agents = 3"),
            "s.toml:3:1: the instances have no source | write `scen = […]`",
        ),
        (
            with("scen = \"a.scen\"\nmaze = { size = 3 }"),
            "s.toml:5:8: `scen` and `maze` are two sources | write another [[instances]]",
        ),
        (
            with(
                "scen = [\n  \"empty-8-8-random-1.scen\",\n  \"empty-8-8-random-2.scen\",\n]\nagents = 1",
            ),
            "s.toml:6:3: empty-8-8-random-2.scen: no such file | did you mean \
             empty-8-8-random-1.scen?",
        ),
        (
            with(&scen.replace("[10]", "[10, 1000]")),
            "s.toml:5:10: 1000 agents asked for, but empty-8-8-random-1.scen has 32 | ask for at \
             most 32 agents, or write `too_many_agents = \"skip\"`",
        ),
        (
            with(&format!("map = \"nowhere\"\n{scen}")),
            "s.toml:5:8: nowhere: no such file",
        ),
        (
            with(&format!("map = [\"nowhere\", \"elsewhere\"]\n{scen}")),
            "s.toml:5:8: empty-8-8-random-1.scen: the scenario is for map empty-8-8, which was \
             not found | name its file by `map` as well",
        ),
        (
            with("scen = \"SOURCES.md\""),
            "s.toml:4:8: SOURCES.md: this is in no format that is known",
        ),
        (
            with("scen = \"empty-8-8.map\""),
            "s.toml:4:8: empty-8-8.map: the file has no starts and goals | formats that have them",
        ),
        (
            with("scen = \"${NOWHERE}/a.scen\""),
            "s.toml:4:8: the environment variable `NOWHERE` is not set | set it",
        ),
        (
            with("scen = \"${NOWHERE/a.scen\""),
            "s.toml:4:8: `scen` has a variable without an end | write ${NAME}",
        ),
        (
            format!("{}[[instances]]\n{scen}", with(scen)),
            "s.toml:6:1: the suite asks twice for empty-8-8, empty-8-8-random-1.scen, 10 agents",
        ),
        (
            with("maze = { count = 3 }"),
            "s.toml:4:8: the maze has no size | add `size = …`",
        ),
        (with("maze = { size = 30000, count = 3 }"), "s.toml:4:8: "),
        (
            with("maze = { size = 3, count = 3 }\nagents = 1"),
            "s.toml:5:10: a maze of a series has one agent | leave out `agents`",
        ),
        (
            with("maze = { size = 3, count = 3, base_seed = 18446744073709551614 }"),
            "s.toml:4:28: the last seeds are more than a seed can be",
        ),
        (
            with("maze = { size = 3, seeds = [1], count = 3 }"),
            "s.toml:4:41: `count` belongs to a schedule, and `seeds` are numbers",
        ),
        (
            with(
                "generate = { kind = \"random\", rows = 4, cols = 4, obstacle_density = 2 }\nagents = 1",
            ),
            "s.toml:4:12: the obstacle density is 2 | the obstacle density is from 0",
        ),
        (
            with("generate = { kind = \"empty\", rows = 2, cols = 2 }\nagents = 5"),
            "s.toml:4:12: a scenario of 5 agents on empty-2-2, which has room for 4 | ask for 1 \
             to 4 agents",
        ),
        (
            with("generate = { kind = \"empty\", rows = 2, cols = 2, seeds = 3 }\nagents = 1"),
            "s.toml:4:50: unknown key `seeds` in `generate` of kind \"empty\"",
        ),
        (
            with("generate = { kind = \"empty\", rows = 2, cols = 2 }"),
            "s.toml:3:1: the key `agents` is missing in [[instances]]",
        ),
        (
            with(&format!("{scen}\nconnectivity = 6")),
            "s.toml:6:16: grids have 4 or 8 neighbours",
        ),
        (
            with(&format!("{scen}\nviews = [\"grid\"]")),
            "s.toml:6:9: `views` are those of a `task`",
        ),
    ];
    let wrong: Vec<String> = cases
        .iter()
        .map(|(text, expected)| (fault(text), expected))
        .filter(|(told, expected)| !told.starts_with(*expected))
        .map(|(told, expected)| format!("told      {told}\nexpected  {expected}\n"))
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_suite_on_the_command_line_is_blamed_there() {
    let text = with("scen = \"empty-8-8-random-1.scen\"\nagents = [10]");
    let error = read_with(&text, &["protocol.repeats=0"]).unwrap_err();
    assert_eq!(
        error.to_string(),
        "--set protocol.repeats=0: `repeats` is not between 1 and 1000000"
    );
    let suite = read_with(&text, &["budget.wall=2s", "protocol.clock=call"]).unwrap();
    assert_eq!(suite.budget.wall.as_secs(), 2);
}

const ROOMS: &str = "task = \"two-rooms.task.json\"\n";

#[test]
fn tasks_by_view_and_team_size() {
    let views = r#"views = ["grid", "S", "continuous",
        { representation = "grid", connectivity = 8, separation = "strict", step = 0.5 },
        { representation = "roadmap", density = "S", roadmap_seed = 2, label = "another" }]
agents = [3, 2]"#;
    let found = instances(&with(&format!("{ROOMS}{views}"))).unwrap();
    let rooms = "two-rooms, two-rooms.task.json";
    let views = [
        "grid",
        "S",
        "continuous",
        "grid connectivity=8 separation=strict step=0.5",
        "another",
    ];
    let expected = views
        .iter()
        .flat_map(|view| [3, 2].map(|agents| format!("{rooms}, {agents} agents, view {view}")));
    assert_eq!(told(&found), expected.collect::<Vec<_>>());
    let digests: BTreeSet<_> = found
        .iter()
        .map(|instance| instance.digest().unwrap())
        .collect();
    assert_eq!(digests.len(), found.len(), "each is another question");
    let moves: Vec<_> = found.iter().map(SuiteInstance::connectivity).collect();
    let (four, eight) = (Some(Connectivity::Four), Some(Connectivity::Eight));
    assert_eq!(moves[..4], [four, four, None, None]);
    assert_eq!(moves[6], eight);
    let asked = |at: usize| match found[at].question().unwrap() {
        Question::View(asked) => asked,
        Question::Grid(_) => panic!("{at} is a view"),
    };
    // Fewer agents are the first ones, and the same robots.
    let (all, two) = (asked(0), asked(1));
    assert_eq!(two.problem.task.agents, all.problem.task.agents[..2]);
    assert_eq!(two.problem.fleet.agents(), 2);
    // A step of a cell's side at 1 m/s, unless the view says otherwise.
    assert!((all.terms.step_s - 0.5).abs() < 1e-12);
    assert_eq!(asked(6).terms.separation, Separation::Strict);
    let parameters = |at: usize| {
        let (asked, view) = (asked(at), found[at].view().unwrap());
        serde_json::Value::Object(view.spec.parameters(&asked.problem, asked.terms)).to_string()
    };
    // What follows from the task stands beside what was given.
    assert_eq!(
        parameters(8),
        r#"{"builder":"prm","neighbors":5,"pace":"stop-go","representation":"roadmap","roadmap_seed":2,"sampling":"uniform","spacing":0.5,"speed":1.0,"vertices":160}"#
    );
    assert_eq!(parameters(4), r#"{"representation":"continuous"}"#);
    // The suite's planners do not read them.
    let suite = read(&with(&format!("{ROOMS}views = [\"grid\"]"))).unwrap();
    let files = suite.files().unwrap().into_iter();
    let mut names: Vec<_> = files
        .map(|file| file.file_name().unwrap().to_owned())
        .collect();
    names.sort();
    assert_eq!(names, ["two-rooms.task.json", "two-rooms.world.json"]);
}

#[test]
fn what_is_wrong_with_views_has_its_place() {
    let view = |view: &str| with(&format!("{ROOMS}views = [{{ {view} }}]"));
    let crowded = "task = \"crowded.task.json\"\n";
    let cases = [
        (
            with(ROOMS),
            "s.toml:3:1: the key `views` is missing in [[instances]]",
        ),
        (
            with(&format!("{ROOMS}views = []")),
            "s.toml:5:9: `views` is empty, so there is nothing to run",
        ),
        (with(&format!("{ROOMS}views = [\"XL\"]")), "s.toml:5:10: "),
        (
            with(&format!("{ROOMS}views = [\"S\", \"S\"]")),
            "s.toml:5:15: two views are called \"S\" | give each a `label` of its own",
        ),
        (
            with(&format!(
                "{ROOMS}views = [\"S\", {{ representation = \"roadmap\", density = \"S\" }}]"
            )),
            "s.toml:3:1: the suite asks twice for two-rooms, two-rooms.task.json, 3 agents, view \
             roadmap density=S",
        ),
        (
            view("connectivity = 4"),
            "s.toml:5:10: the key `representation` is missing in [[instances.views]]",
        ),
        (
            view("representation = \"grid\", vertices = 5"),
            "s.toml:5:37: unknown key `vertices` in a view of the representation `grid`",
        ),
        (
            view("representation = \"grid\", step = 0"),
            "s.toml:5:44: `step` is 0 | give a duration above 0",
        ),
        (
            view("representation = \"roadmap\", builder = \"lattice\""),
            "s.toml:5:10: the key `side` is missing in a view of the representation `roadmap`",
        ),
        (
            view("representation = \"roadmap\", builder = \"tangent\", vertices = 5"),
            "s.toml:5:72: `vertices` is no parameter of the builder `tangent` | its parameters are sides",
        ),
        (
            view("representation = \"roadmap\", density = \"S\", vertices = 5"),
            "s.toml:5:66: `vertices` is no parameter of a density, which has all of its own",
        ),
        (
            view("representation = \"roadmap\", density = \"XL\""),
            "s.toml:5:50: \"XL\" is no density | densities are S, D, SD",
        ),
        (
            with(&format!("{ROOMS}views = [\"S\"]\nconnectivity = 8")),
            "s.toml:6:16: `connectivity` belongs to the view of a task that is a grid",
        ),
        (
            with(&format!("{ROOMS}views = [\"S\"]\nagents = 4")),
            "s.toml:6:10: 4 agents asked for, but ",
        ),
        (
            with("task = \"nowhere.task.json\"\nviews = [\"S\"]"),
            "s.toml:4:8: ",
        ),
        (
            format!(
                "protocol.clock = \"call\"\n{}",
                with(&format!("{ROOMS}views = [\"S\"]"))
            ),
            "s.toml:5:8: empty calls, which the clock `call` leaves out, are made on maps alone",
        ),
        (
            format!(
                "protocol.path_rule = \"supercover\"\n{}",
                with(&format!("{ROOMS}views = [\"S\"]"))
            ),
            "s.toml:5:8: another path rule than `steps` is for grids with one agent",
        ),
        (
            format!(
                "execution.radius_m = 0.2\n{}",
                with(&format!("{ROOMS}views = [\"S\"]"))
            ),
            "s.toml:1:22: `radius_m` is not for tasks, which name their worlds and robots",
        ),
    ];
    let wrong: Vec<String> = cases
        .iter()
        .map(|(text, expected)| (fault(text), expected))
        .filter(|(told, expected)| !told.starts_with(*expected))
        .map(|(told, expected)| format!("told      {told}\nexpected  {expected}\n"))
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    // Two starts in one cell: refused at the view, unless its trials are to fail.
    let folder = tempfile::tempdir().unwrap();
    let task = r#"{"format": "fleetyard.task/1", "map": "hall.map", "cell_size_m": 1,
        "robots": {"disc": {"footprint": {"disc": {"radius_m": 0.25}},
                            "model": {"single-integrator": {"speed_m_per_s": 1}}}},
        "agents": [{"start": [0.52, 0.52], "goal": [3, 3]}, {"start": [0.98, 0.98], "goal": [3, 1]}]}"#;
    let map = "type octile\nheight 4\nwidth 4\nmap\n....\n....\n....\n....\n";
    std::fs::write(folder.path().join("crowded.task.json"), task).unwrap();
    std::fs::write(folder.path().join("hall.map"), map).unwrap();
    let digest = |more: &str| {
        let text = with(&format!("{crowded}views = [\"grid\", \"S\"]\n{more}"));
        let suite = Suite::read("s.toml", &text, &[], folder.path(), &|_| None).unwrap();
        let instances = suite.instances().unwrap();
        instances[0].question().unwrap_err();
        instances[1].question().unwrap();
        instances[0].digest()
    };
    let error = digest("").unwrap_err();
    assert!(
        error.to_string().starts_with("s.toml:5:10: ")
            && error.reason.contains("the starts of agents 0 and 1 snap"),
        "{error}"
    );
    assert!(digest("no_view = \"fail\"").is_ok());
}

/// The part of a page under a heading.
fn section<'p>(page: &'p str, heading: &str) -> &'p str {
    let start = page
        .find(&format!("\n## {heading}\n"))
        .unwrap_or_else(|| panic!("no section {heading}"));
    let part = &page[start + 4..];
    &part[..part.find("\n## ").unwrap_or(part.len())]
}

#[test]
fn the_page_has_every_key_and_no_other() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/suites.md");
    let page = std::fs::read_to_string(page).unwrap();
    let keys = |text: String| -> BTreeSet<String> {
        let error = read(&text.replace("UNKNOWN", "zzzzzzzzzz = 1")).expect_err(&text);
        let hint = error.hint.expect(&text);
        let keys = hint.strip_prefix("known keys: ").expect(&hint);
        keys.split(", ").map(str::to_owned).collect()
    };
    let kinds = ["empty", "random", "room", "maze", "warehouse"];
    let generate =
        kinds.map(|kind| format!("agents = 1\ngenerate = {{ kind = \"{kind}\", UNKNOWN }}"));
    let planner = "planner = [{ UNKNOWN }]";
    let planner = with("").replace("planner = [{ plugin = \"lacam\" }]", planner);
    let table = |name: &str| vec![format!("{}[{name}]\nUNKNOWN", with("scen = \"a.scen\""))];
    let tables = [
        ("The whole file", vec![format!("UNKNOWN\n{}", with(""))]),
        ("`[protocol]`", table("protocol")),
        ("`[budget]`", table("budget")),
        ("`[sandbox]`", table("sandbox")),
        ("`[execution]`", table("execution")),
        ("`[fleet]`", table("fleet")),
        ("`[[planner]]`", vec![planner]),
        ("`[[instances]]`", vec![with("UNKNOWN")]),
        ("Numbers", vec![with("maze = { size = { UNKNOWN } }")]),
        ("`maze`", vec![with("maze = { UNKNOWN }")]),
        ("`generate`", generate.map(|made| with(&made)).to_vec()),
        (
            "`views`",
            ["grid", "roadmap", "continuous"]
                .map(|representation| {
                    with(&format!(
                        "{ROOMS}views = [{{ representation = \"{representation}\", UNKNOWN }}]"
                    ))
                })
                .to_vec(),
        ),
    ];
    for (heading, texts) in tables {
        let documented: BTreeSet<String> = section(&page, heading)
            .lines()
            .filter_map(|line| line.strip_prefix("| `")?.split_once('`'))
            .map(|(key, _)| key.to_owned())
            .collect();
        let known: BTreeSet<String> = texts.into_iter().flat_map(keys).collect();
        assert_eq!(documented, known, "{heading}");
    }
    let examples: Vec<&str> = page
        .split("```toml\n")
        .skip(1)
        .filter_map(|rest| rest.split("```").next())
        .collect();
    assert_eq!(examples.len(), 5);
    for example in examples {
        let known = |_: &str| Some("/data".to_owned());
        Suite::read("docs/suites.md", example, &[], Path::new(""), &known).unwrap();
    }
}

#[test]
fn the_suites_of_the_repository_can_be_read() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scripts/suites");
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let suite = load_suite(&path).unwrap_or_else(|error| panic!("{error} {:?}", error.hint));
        assert!(!suite.instances().unwrap().is_empty(), "{}", path.display());
        names.push(suite.name);
    }
    names.sort();
    assert!(names.contains(&"first".to_owned()) && names.contains(&"views".to_owned()));
}

const FLEET: &str = r#"
name = "fleets"
[execution]
radius_m = 0.25
delay = "bernoulli:0.1,2s"
[fleet]
duration = "2m"
limit = "500ms"
window = "0s"
period = "2s"
[[planner]]
label = "a"
plugin = "pibt"
[[planner]]
label = "b"
plugin = "pibt"
fleet = { motion = "rotation", window = "3s", model = "pebble", delay = "none", generator = { plugin = "one-goal", options = { x = 1 } } }
[[instances]]
map = "warehouse-3-4-*.map"
agents = [5, 9]
"#;

#[test]
fn fleets_are_read_setup_by_setup() {
    let suite = read(FLEET).unwrap();
    let [a, b] = [0, 1].map(|index| suite.planners[index].fleet.clone().unwrap());
    assert_eq!((a.config.duration_s, a.config.limit_s), (120.0, 0.5));
    assert_eq!((a.config.window_s, b.config.window_s), (0.0, 3.0));
    // A cell in half a second, as fast as the robots of the paper are; discs take a second.
    assert_eq!((a.config.sim.step_s, b.config.sim.step_s), (0.5, 1.0));
    assert_eq!(a.config.sim.radius_m, Some(0.25));
    assert_ne!(
        a.config.sim.disturbance.delay,
        b.config.sim.disturbance.delay
    );
    assert_eq!(b.generator.plugin, "one-goal");
    assert_eq!(b.generator.options["x"], 1);
    assert_eq!(a.generator.plugin, "windowed-multi-goals");
    assert_eq!(b.invocation.options["period_s"], 2.0);
    let instances = suite.instances().unwrap();
    let hall = "warehouse-3-4-5-1-1-m2-a2-open-e-w3, lifelong";
    assert_eq!(
        told(&instances),
        [format!("{hall}, 5 agents"), format!("{hall}, 9 agents")]
    );
    assert_ne!(
        instances[0].digest().unwrap(),
        instances[1].digest().unwrap()
    );
    // Roles decide where goals are: they are a part of what is asked.
    let plain = FLEET.replace(
        "map = \"warehouse-3-4-*.map\"",
        "generate = { kind = \"warehouse\", blocks_across = 3, blocks_down = 4, block_cols = 5, \
         block_rows = 1, aisle = 1, margin = 2, aisle_rows = 2, open = true }",
    );
    let plain = self::instances(&plain).unwrap();
    assert_eq!(
        plain[0].grid().unwrap().digest(),
        instances[0].grid().unwrap().digest()
    );
    assert_ne!(plain[0].digest().unwrap(), instances[0].digest().unwrap());
}

#[test]
fn what_is_wrong_with_a_fleet_has_its_place() {
    let told = |from: &str, to: &str| {
        assert!(FLEET.contains(from), "{from}");
        let text = FLEET.replace(from, to);
        let error = match read(&text) {
            Ok(suite) => suite.instances().expect_err(to),
            Err(error) => error,
        };
        let hint = error.hint.clone().unwrap_or_default();
        format!("{error}; {hint}")
    };
    let rows = [
        (
            "limit = \"500ms\"",
            "limit = \"0s\"",
            "s.toml:8:9: limit_s is out of range: 0",
        ),
        ("limit = \"500ms\"", "limit = 3", "s.toml:8:9"),
        (
            "limit = \"500ms\"",
            "limits = \"3s\"",
            "did you mean `limit`?",
        ),
        ("period = \"2s\"", "period = \"0s\"", "`period` is zero"),
        ("\"rotation\"", "\"rotating\"", "s.toml:17:"),
        ("model = \"pebble\"", "model = \"tank\"", "tank"),
        ("delay = \"none\"", "delay = \"often\"", "s.toml:17:"),
        (
            "[fleet]\nduration = \"2m\"\nlimit = \"500ms\"\nwindow = \"0s\"\nperiod = \"2s\"\n",
            "",
            "write a table [fleet]",
        ),
        ("map = \"ware", "scen = \"ware", "`scen` is not for fleets"),
        ("agents = [5, 9]", "", "agents"),
        (
            "agents = [5, 9]",
            "agents = [5, 900]",
            "the map has 234 free cells",
        ),
        ("warehouse-3-4-*.map", "nowhere.map", "no such file"),
        (
            "plugin = \"pibt\"\nfleet = {",
            "plugin = \"pibt\"\nfleet = { invocation = { plugin = \"periodic\", options = { period_s = 1 } }, period = \"1s\",",
            "`period` is the option `period_s`",
        ),
    ];
    each(rows, |(from, to, expected)| {
        let said = told(from, to);
        assert!(said.contains(expected), "{to}: {said}");
    });
}

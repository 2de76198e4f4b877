//! Command lines and numbers that nobody can mean.

use fleetyard_testkit::{INPUT, USAGE};

use crate::files::good_files;
use crate::{Tests, says};

const RUN: &str = "run -m good.map -s good.scen -n 2 --planner lacam";

/// A name, a line in which `RUN` stands for that one, and what is said of it.
const WRONG: &[(&str, &str, &[&str])] = &[
    ("nothing", "", &["Usage: fleetyard"]),
    ("unknown command", "walk", &["walk"]),
    (
        "missing arguments",
        "run --map good.map",
        &["--scen", "--agents", "--planner"],
    ),
    ("budget without unit", "RUN --budget 10", &["with its unit"]),
    (
        "budget below nothing",
        "RUN --budget=-1s",
        &["'-1s'", "with its unit"],
    ),
    (
        "budget like an argument",
        "RUN --budget -1s",
        &["unexpected argument"],
    ),
    (
        "budget of nothing",
        "RUN --budget 0s",
        &["longer than nothing"],
    ),
    (
        "budget of years",
        "RUN --budget 10years",
        &["shorter than a year"],
    ),
    (
        "budget in words",
        "RUN --budget soon",
        &["'soon'", "with its unit"],
    ),
    (
        "prepare budget without unit",
        "RUN --prepare-budget 5",
        &["--prepare-budget", "with its unit"],
    ),
    ("no threads", "RUN --threads 0", &["--threads", "0"]),
    ("negative seed", "RUN --seed -1", &["-1"]),
    ("hexagons", "RUN --connectivity 6", &["4 or 8 neighbours"]),
    (
        "unknown attachment",
        "RUN --attach telepathy",
        &["telepathy", "worker"],
    ),
    ("unknown format", "RUN --format xml", &["xml", "json"]),
    (
        "picture of another kind",
        "RUN --picture plan.jpg",
        &["plan.jpg", ".svg or .png"],
    ),
    (
        "video of a trace",
        "trace export run.trace --html run.mp4",
        &["an HTML page", "no .mp4 file: name it run.html"],
    ),
    (
        "plan of another kind",
        "RUN --plan-out plan.yaml",
        &["this writes JSON", "name it plan.json"],
    ),
    (
        "option of a planner that stands alone",
        "RUN --budget 5s anytime=true",
        &[
            "unexpected argument 'anytime=true'",
            "right behind its name, as in '--planner PLUGIN anytime=true'",
        ],
    ),
    (
        "map that stands alone",
        "RUN --budget 5s good.map",
        &["unexpected argument 'good.map'", "'--map good.map'"],
    ),
    (
        "scenario after the planner",
        "RUN good.scen",
        &["`good.scen` after the plugin", "'--scen good.scen'"],
    ),
    (
        "half a delay",
        "fleet --map good.map --agents 2 --planner pibt --delay bernoulli:0.1",
        &["bernoulli:0.1", "for example bernoulli:0.1,2s"],
    ),
    (
        "plugin option without value",
        "RUN anytime",
        &["`anytime` after the plugin `lacam` is no option NAME=VALUE"],
    ),
    (
        "unknown plugin option",
        "RUN anytme=true",
        &["anytme", "did you mean `anytime`?"],
    ),
    (
        "unknown option",
        "RUN --option anytme=true",
        &["anytme", "did you mean `anytime`?"],
    ),
    (
        "option like no other",
        "RUN --option zzzzzzzz=1",
        &["zzzzzzzz", "hint: "],
    ),
    (
        "option that is no boolean",
        "RUN --option anytime=maybe",
        &["option `anytime`", "maybe"],
    ),
    (
        "option that is a number",
        "RUN --option anytime=3",
        &["option `anytime`", "boolean"],
    ),
    (
        "option without value",
        "RUN --option anytime",
        &["`anytime` has no value", "hint: "],
    ),
    ("option without name", "RUN --option =true", &["hint: "]),
    (
        "planner nearly of that name",
        "run --map good.map --scen good.scen --agents 2 --planner lacan",
        &["there is no planner `lacan`", "hint: did you mean `lacam`?"],
    ),
    (
        "planner as its paper writes it",
        "run --map good.map --scen good.scen --agents 2 --planner LaCAM",
        &["there is no planner `LaCAM`", "hint: did you mean `lacam`?"],
    ),
    (
        "planners in a list",
        "run --map good.map --scen good.scen --agents 2 --planner lacam,pibt",
        &[
            "there is no planner `lacam,pibt`",
            "hint: one name at a time",
        ],
    ),
    (
        "unknown planner",
        "run --map good.map --scen good.scen --agents 2 --planner simulated-annealing",
        &[
            "there is no planner `simulated-annealing`",
            "known: ",
            "lacam",
        ],
    ),
    (
        "one of two planners",
        "compare --map good.map --scen good.scen --agents 2 --planner lacam --planner pibtt",
        &["there is no planner `pibtt`", "did you mean `pibt`?"],
    ),
    (
        "plugin nearly of that name",
        "plugins info lacan",
        &["there is no plugin `lacan`", "lacam"],
    ),
    (
        "map without rows",
        "maps generate empty --rows 0 --cols 4",
        &["--rows"],
    ),
    (
        "map with too many obstacles",
        "maps generate random --rows 4 --cols 4 --obstacle-density 2",
        &["--obstacle-density"],
    ),
    (
        "more agents than cells",
        "maps generate empty --rows 2 --cols 2 --scenario-agents 5",
        &["--scenario-agents"],
    ),
    (
        "map that is too large",
        "maps generate empty --rows 4000000000 --cols 4000000000",
        &["--rows"],
    ),
    ("unknown shell", "completions powder", &["powder"]),
];

/// Worlds that cannot be.
const WORLDS: &[(&str, &str)] = &[
    ("cells without extent", "--cell-size 0"),
    ("cells of no size", "--cell-size NaN"),
    ("steps back in time", "--step=-1"),
    ("endless steps", "--step inf"),
    ("robots wider than cells", "--radius 0.6"),
    ("robots of negative extent", "--radius=-1"),
    ("no ticks", "--ticks-hz 0"),
    ("no substeps", "--substeps 0"),
];

pub(crate) fn add(tests: &mut Tests) {
    for (name, line, texts) in WRONG {
        tests.add(&format!("command_line::{name}"), move || {
            let yard = good_files();
            let ended = yard.line(&line.replace("RUN", RUN)).expect(USAGE);
            assert_eq!(ended.stdout, "");
            says(&ended, texts);
            assert_eq!(yard.files().len(), 2, "{:?}", yard.files());
        });
    }
    for (name, world) in WORLDS {
        tests.add(&format!("worlds::{name}"), move || {
            // Before the planner has spent its budget, and whichever place finds it.
            let ended = good_files().line(&format!("{RUN} --execute {world}"));
            let refused = [INPUT, USAGE].map(Some).contains(&ended.code);
            assert!(refused && ended.stdout.is_empty(), "{ended}");
            says(&ended, &["error: "]);
        });
    }
}

//! The fuzzer, `fleetyard plugins check --fuzz`: faults of different sorts are found within few instances, are made
//! small, and fail in the same way when the commands that it prints are run; plugins that keep their promises pass.
//!
//! Numbers of instances are given in place of a time, and seeds stay the same, so that what is asked does not depend
//! on the machine.

use std::collections::BTreeSet;

use fleetyard_testkit::{
    INPUT, INVALID_PLAN, PLUGIN, SUCCESS, USAGE, Yard, faulty_library, faulty_program, have, words,
};
use serde_json::Value;

use crate::conformance::promising;
use crate::{Tests, says};

/// A plugin of `plugins/faulty/promises` and its mistake, the number of instances within which a failure of a kind
/// is found, most agents and cells of the smallest one, and the instances and the calls that it needs.
type Found = (&'static str, &'static str, u64, &'static str, [u64; 4]);

/// Instances that standard plugins failed once: name, plugin, and the probe.
const MENDED: &[(&str, &str, &str)] = &[(
    "one-way street to a dead end",
    "lacam",
    r#""seed":1,"view":"grid","map":["..",".."],"closed":[[1,3],[1,0]],
        "calls":[{"agents":[{"start":3,"goals":[2]},{"start":2,"goals":[3]}]}]"#,
)];

const FOUND: &[Found] = &[
    (
        "promising",
        "ignores-arrows",
        6,
        "invalid-plan move-not-allowed",
        [1, 2, 1, 1],
    ),
    (
        "promising",
        "unseeded",
        6,
        "not-deterministic",
        [1, 2, 1, 1],
    ),
    (
        "promising",
        "stale-cancel",
        3,
        "false-claim cancelled",
        [1, 1, 1, 2],
    ),
    (
        "promising-roads",
        "ignores-others",
        2,
        "invalid-plan head-on",
        [2, 2, 1, 1],
    ),
    (
        "promising-plane",
        "ignores-others",
        2,
        "invalid-plan agent-contact",
        [2, 2, 1, 1],
    ),
    (
        "promising-policy",
        "stands-elsewhere",
        2,
        "invalid-plan wrong-start",
        [2, 2, 1, 1],
    ),
    (
        "promising-generator",
        "blocked-goals",
        5,
        "invalid-request",
        [1, 2, 1, 1],
    ),
];

pub(crate) fn add(tests: &mut Tests) {
    for found in FOUND {
        let (id, mistake, ..) = found;
        tests.add(&format!("fuzz::found::{id}::{mistake}"), move || {
            is_found(found);
        });
    }
    for plugin in ["lacam", "epibt --kind planner"] {
        tests.add(&format!("fuzz::passes::{plugin}"), move || {
            let yard = Yard::new();
            let document = yard.line(&format!("plugins check {plugin} --fuzz 25 --format json"));
            let document = document.expect(SUCCESS).json();
            let fuzz = &document["plugins"][0]["fuzz"];
            assert_eq!(fuzz["instances"], 25, "{document}");
            assert_eq!(fuzz["findings"], Value::Array(Vec::new()), "{document}");
            assert_eq!(document["summary"]["passed"], 1, "{document}");
            assert_eq!(yard.files(), BTreeSet::new());
        });
    }
    for (name, plugin, probe) in MENDED {
        tests.add(&format!("fuzz::mended::{plugin}::{name}"), move || {
            let yard = Yard::new();
            let head = r#"{"format":"fleetyard.fuzzed/1","kind":"any","plugin":"#;
            let content = format!("{head}\"{plugin}\",\"probes\":[{{{probe}}}]}}");
            yard.write("mended.json", content);
            let line = format!("plugins check {plugin} --fuzzed mended.json");
            yard.line(&line).expect(SUCCESS);
        });
    }
    let singles: [(&str, fn()); 6] = [
        ("what is asked follows from the seed", seeds),
        ("commands that are printed fail in the same way", replays),
        ("nothing is written over", new_folders),
        ("who does not hear the clock is found", deaf),
        ("broken protocols and crashes are told apart", kinds),
        ("files that are wrong are refused", wrong_files),
    ];
    for (name, test) in singles {
        tests.add(&format!("fuzz::{name}"), test);
    }
    for (name, line, texts) in [
        (
            "no extent",
            "--fuzz soon",
            ["a number of instances, such as 200", "such as 10m"],
        ),
        ("no instance", "--fuzz 0", ["at least one instance", ""]),
        (
            "cases too",
            "--fuzz 5 --only deadline",
            ["--fuzz", "--only"],
        ),
        (
            "folder of nothing",
            "--findings x",
            ["--fuzz <N|DURATION>", ""],
        ),
        (
            "in the host",
            "--fuzz 5 --attach in-process",
            ["processes of their own", "leave out"],
        ),
        ("both", "--fuzz 5 --fuzzed x.json", ["--fuzz", "--fuzzed"]),
    ] {
        tests.add(&format!("fuzz::command line::{name}"), move || {
            let ended = Yard::new()
                .line(&format!("plugins check lacam {line}"))
                .expect(USAGE);
            says(&ended, &texts);
            assert_eq!(ended.stdout, "", "{ended}");
        });
    }
}

/// A run of the fuzzer that finds something.
fn fuzz(yard: &Yard, plugin: &str, arguments: &str) -> Value {
    let mut line = words("plugins check --format json --findings {here}/found");
    line.push(plugin.to_owned());
    line.extend(words(arguments));
    for word in &mut line {
        *word = word.replace("{here}", &yard.path("").display().to_string());
    }
    yard.run(&line).expect(PLUGIN).json()
}

fn findings(document: &Value) -> &Vec<Value> {
    let findings = document["plugins"][0]["fuzz"]["findings"].as_array();
    findings.unwrap_or_else(|| panic!("no findings in {document}"))
}

/// The finding whose kind begins in this way.
fn of_kind<'a>(document: &'a Value, kind: &str) -> &'a Value {
    let found = findings(document).iter();
    let mut found = found.filter(|finding| finding["kind"].as_str().unwrap().starts_with(kind));
    found
        .next()
        .unwrap_or_else(|| panic!("no `{kind}` in {document:#}"))
}

/// The words of a command that was printed.
fn command(finding: &Value, name: &str) -> Vec<String> {
    let line = finding[name]
        .as_str()
        .unwrap_or_else(|| panic!("no {name} in {finding:#}"));
    words(line.strip_prefix("fleetyard ").unwrap())
}

fn is_found((id, mistake, within, kind, smallest): &Found) {
    let [agents, cells, instances, calls] = smallest;
    let yard = Yard::new();
    let arguments = format!("--id {id} --option mistake={mistake} --fuzz {within}");
    let document = fuzz(&yard, promising(), &arguments);
    let finding = of_kind(&document, kind);
    let size = |name: &str| finding["after"][name].as_u64().unwrap();
    assert!(finding["is_smallest"].as_bool().unwrap(), "{finding:#}");
    assert_eq!(
        (size("instances"), size("calls")),
        (*instances, *calls),
        "{finding:#}"
    );
    assert!(size("agents") <= *agents, "{finding:#}");
    assert!(size("rows") * size("cols") <= *cells, "{finding:#}");
    let mut again = command(finding, "replay");
    again.extend(words("--format json"));
    let again = yard.run(&again).expect(PLUGIN).json();
    assert_eq!(findings(&again)[0]["kind"], finding["kind"]);
    assert_eq!(findings(&again)[0]["reason"], finding["reason"]);
}

fn seeds() {
    let ask = |arguments: &str| {
        let yard = Yard::new();
        let some = "--id promising --option mistake=ignores-others --fuzz 10";
        let document = fuzz(&yard, promising(), &format!("{some} {arguments}"));
        let finding = of_kind(&document, "invalid-plan").clone();
        let views = document["plugins"][0]["fuzz"]["by_view"].clone();
        (
            finding["seed"].clone(),
            finding["before"].clone(),
            finding["after"].clone(),
            views,
        )
    };
    let first = ask("");
    assert_eq!(first, ask(""));
    assert_ne!(first, ask("--seed 2"));
    let (again, before, ..) = ask(&format!("--reproduce {}", first.0));
    assert_eq!((&again, &before), (&first.0, &first.1));
}

fn replays() {
    let yard = Yard::new();
    let line = "--id promising --option mistake=ignores-others --fuzz 60";
    let document = fuzz(&yard, promising(), line);
    let finding = of_kind(&document, "invalid-plan vertex-conflict");
    for (name, code) in [("replay", PLUGIN), ("reproduce", PLUGIN)] {
        let mut again = command(finding, name);
        again.extend(words("--format json"));
        let again = yard.run(&again).expect(code).json();
        assert_eq!(
            of_kind(&again, "invalid-plan")["kind"],
            finding["kind"],
            "{name}"
        );
    }
    // The command that knows no fuzzer reads map and agents, and finds the same.
    let run = yard.run(&command(finding, "run")).expect(INVALID_PLAN);
    assert!(run.stdout.contains("agents 0 and 1 are both at"), "{run}");
    let text = yard.run(&command(finding, "replay")).expect(PLUGIN).stdout;
    assert!(
        text.contains("failed    invalid-plan vertex-conflict"),
        "{text}"
    );
}

fn new_folders() {
    let yard = Yard::new();
    let line = "--id promising --option mistake=ignores-others --fuzz 10";
    let file = |document: &Value| {
        of_kind(document, "invalid-plan")["file"]
            .as_str()
            .unwrap()
            .to_owned()
    };
    let first = file(&fuzz(&yard, promising(), line));
    let content = std::fs::read(&first).unwrap();
    let second = file(&fuzz(&yard, promising(), line));
    assert_ne!(first, second);
    assert_eq!(std::fs::read(&first).unwrap(), content);
    assert_eq!(std::fs::read(&second).unwrap(), content);
}

fn deaf() {
    let yard = Yard::new();
    let library = faulty_library().display().to_string();
    let line = "--option fault=never --grace 50ms --budget 100ms --fuzz 3";
    let document = fuzz(&yard, &library, line);
    let finding = of_kind(&document, "hang plan");
    assert_eq!(finding["after"]["agents"], 1, "{finding:#}");
    assert_eq!(finding["after"]["calls"], 1, "{finding:#}");
}

fn kinds() {
    let library = faulty_library().display().to_string();
    for (fault, kind) in [
        ("crash", "crash signal 11 plan"),
        ("exit-3", "crash exit 3 plan"),
        ("negative-expansions", "broken-protocol plan"),
        ("claims-solved-without-plan", "broken-protocol plan"),
        ("claims-infeasible", "false-claim infeasible"),
    ] {
        let document = fuzz(
            &Yard::new(),
            &library,
            &format!("--option fault={fault} --fuzz 10"),
        );
        let finding = of_kind(&document, kind);
        let size = &finding["after"];
        assert_eq!(
            (&size["agents"], &size["rows"], &size["cols"]),
            (&1.into(), &1.into(), &1.into())
        );
    }
    if have("python3") {
        let program = faulty_program().display().to_string();
        let document = fuzz(
            &Yard::new(),
            &program,
            "--option fault=closes-stdout --fuzz 2",
        );
        assert_eq!(findings(&document).len(), 1, "{document:#}");
    }
}

fn wrong_files() {
    let good = r#"{"format":"fleetyard.fuzzed/1","plugin":"lacam","kind":"hang plan","probes":[
        {"seed":1,"view":"grid","map":[".."],"calls":[{"agents":[{"start":0,"goals":[1]}]}]}]}"#;
    let yard = Yard::new();
    yard.write("good.json", good);
    yard.line("plugins check lacam --fuzzed good.json")
        .expect(SUCCESS);
    for (from, to, text) in [
        ("fuzzed/1", "fuzzed/2", "expected \"fleetyard.fuzzed/1\""),
        ("\"start\":0", "\"start\":2", "cell 2 is not on the map"),
        ("\"..\"", "\"..\",\".\"", "not as long as the first"),
        ("\"..\"", "\".?\"", "unknown terrain letter"),
        (
            "\"agents\":[{\"start\":0,\"goals\":[1]}]",
            "\"agents\":[]",
            "no calls, or no agents",
        ),
        ("\"seed\"", "\"sead\"", "unknown field `sead`"),
    ] {
        let bad = good.replace(from, to);
        assert_ne!(bad, good);
        yard.write("bad.json", bad);
        let ended = yard
            .line("plugins check lacam --fuzzed bad.json")
            .expect(INPUT);
        says(&ended, &["bad.json", text, "hint: "]);
    }
    let ended = yard
        .line("plugins check lacam --fuzzed none.json")
        .expect(INPUT);
    says(&ended, &["none.json"]);
}

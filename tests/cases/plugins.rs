//! Files that are no plugins, libraries that break the contract, and planners that misbehave.
//!
//! Faults that a library and a program can both have are tried through both, and in the host's own
//! process where it does not take the host down.

use std::collections::BTreeSet;
use std::fs::{self, Permissions};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use fleetyard_testkit::{
    Ended, INPUT, INVALID_PLAN, NO_PLAN, PLUGIN, SUCCESS, USAGE, Yard, c_library, faulty_library,
    faulty_program, have, instance, library, words,
};
use serde_json::Value;

use crate::files::good_files;
use crate::{Tests, says};

pub(crate) fn add(tests: &mut Tests) {
    no_plugins(tests);
    exit_codes(tests);
    libraries(tests);
    attachments(tests);
    misbehaviour(tests);
    programs(tests);
    tests.add(
        "plugins::a talkative planner does not fill the host's memory",
        talkative,
    );
    tests.add(
        "plugins::a fault does not spoil a comparison",
        in_a_comparison,
    );
    tests.add(
        "plugins::a bad file on the plugin path hides no other",
        on_the_plugin_path,
    );
}

// ---- Files that are no plugins ------------------------------------------------------

/// Scripts that do not speak the protocol.
const SCRIPTS: &[(&str, &str)] = &[
    ("no-interpreter", "#!/no/such/interpreter\n"),
    ("silent", "#!/bin/sh\nexit 0\n"),
    ("loud", "#!/bin/sh\necho 'no licence found' >&2\nexit 3\n"),
    ("echo", "#!/bin/sh\nexec cat\n"),
    ("dies", "#!/bin/sh\nkill -9 $$\n"),
];

/// A name, a plugin, and what is said of it.
const NO_PLUGINS: &[(&str, &str, &[&str])] = &[
    (
        "text",
        "./text.so",
        &[
            "text.so is no shared library that can be loaded",
            "hint: a plugin is an ELF",
        ],
    ),
    (
        "the beginning of a library",
        "./short.so",
        &["short.so is no shared library that can be loaded"],
    ),
    (
        "a name without a slash where there is such a file",
        "text.so",
        &["text.so is no shared library that can be loaded"],
    ),
    (
        "a folder",
        "{here}",
        &["has several plugins", "short.so", "name the file of one"],
    ),
    (
        "not executable",
        "./notes.txt",
        &[
            "notes.txt is neither a shared library (.so) nor executable",
            "chmod +x",
        ],
    ),
    (
        "no interpreter",
        "./no-interpreter",
        &[
            "cannot start",
            "no-interpreter",
            "is its interpreter installed?",
        ],
    ),
    (
        "silent",
        "./silent",
        &[
            "silent is no plugin that speaks the protocol",
            "exited with code 0",
        ],
    ),
    (
        "loud",
        "./loud",
        &[
            "exited with code 3",
            "its last words were: no licence found",
        ],
    ),
    (
        "echo",
        "./echo",
        &[
            "broke the protocol during `initialize`",
            "only the host asks",
        ],
    ),
    ("dies", "./dies", &["crashed with SIGKILL (signal 9)"]),
];

fn no_plugins(tests: &mut Tests) {
    for (name, planner, texts) in NO_PLUGINS {
        tests.add(&format!("no_plugins::{name}"), move || {
            let yard = good_files();
            yard.write("text.so", "This is no library.\n");
            yard.write("short.so", "\x7fELF");
            yard.write("notes.txt", "This is no program.\n");
            for (name, script) in SCRIPTS {
                fs::set_permissions(yard.write(name, script), Permissions::from_mode(0o755))
                    .unwrap();
            }
            let before = yard.files();
            let ended = yard.line(&format!(
                "run --map good.map --scen good.scen --agents 2 --planner {planner} \
                 --plan-out plan.json --trace-out trace.fyt --picture picture.svg"
            ));
            let ended = ended.expect(PLUGIN);
            assert_eq!(ended.stdout, "");
            says(&ended, texts);
            let info = yard.line(&format!("plugins info {planner}"));
            says(&info.expect(PLUGIN), texts);
            assert_eq!(yard.files(), before);
        });
    }
}

/// A missing plugin, a broken manifest and an unknown name are told apart: a script has to tell
/// who is to mend it, the one who typed, the one who put files there, or the plugin's author.
fn exit_codes(tests: &mut Tests) {
    for (name, planner, code) in [
        ("missing library", "./nothing.so", INPUT),
        ("missing folder", "nothing/", INPUT),
        ("broken manifest", "./bad.planner.toml", INPUT),
        ("unknown name", "no-such-planner", USAGE),
        ("unknown name in a library", "LIBRARY:nobody", USAGE),
        ("no library", "./text.so", PLUGIN),
    ] {
        tests.add(&format!("exit_codes::{name}"), move || {
            let yard = good_files();
            yard.write("bad.planner.toml", "format = [");
            yard.write("text.so", "This is no library.\n");
            let planner = planner.replace("LIBRARY", &faulty_library().display().to_string());
            let instance = "--map good.map --scen good.scen --agents 2";
            for line in [
                format!("run {instance} --planner {planner}"),
                format!("compare {instance} --planner {planner} --planner lacam"),
                format!("fleet --map good.map --agents 2 --duration 1s --planner {planner}"),
            ] {
                says(&yard.line(&line).expect(code), &["error: "]);
            }
            yard.line(&format!("plugins info {planner}")).expect(code);
            // Here the suite's line is wrong.
            yard.write(
                "s.toml",
                format!(
                    "name = \"s\"\n[budget]\nwall = \"1s\"\n[[planner]]\nplugin = \"{planner}\"\n\
                     [[instances]]\nscen = [\"good.scen\"]\nmap = \"good.map\"\nagents = [2]\n"
                ),
            );
            says(&yard.line("bench s.toml").expect(INPUT), &["s.toml"]);
        });
    }
}

// ---- Libraries ------------------------------------------------------------------------

/// Faults of a library before there is a planner, and the messages about them.
const LIBRARIES: &[(&str, &[&str])] = &[
    (
        "NO_SYMBOL",
        &["no_symbol.so is no Fleetyard plugin", SYMBOL, "hint: "],
    ),
    (
        "WRONG_MAJOR",
        &[
            "built for version 2.0 of the plugin ABI; this host has 1.",
            "hint: build it",
        ],
    ),
    (
        "SHORT_ENTRY",
        &[SYMBOL, "struct_size is 16, but the structure has"],
    ),
    (
        "SHORT_FACTORY",
        &["factory.struct_size is 8, but the structure has"],
    ),
    (
        "SHORT_DESCRIPTOR",
        &["descriptor.struct_size is 8, but the structure has"],
    ),
    ("NULL_DESCRIPTOR", &["descriptor is null"]),
    ("NULL_GET_FACTORY", &["get_factory is null"]),
    ("INIT_FAILS", &["init failed with code -1"]),
    ("MANY_PLUGINS", &["claims to have 4000000000 plugins"]),
    ("BAD_ID", &["`Not an identifier` is no identifier"]),
    ("BAD_SCHEMA", &["options schema of `faulty` is not JSON"]),
    (
        "SHORT_PLANNER",
        &["`create` left a structure of the wrong size"],
    ),
    (
        "NULL_PLAN",
        &["`create` left a structure of the wrong size or without functions"],
    ),
];

const SYMBOL: &str = "fleetyard_plugin_entry_v1";

/// Runs a library that leaves no file.
fn run(library: &Path, arguments: &[&str]) -> Ended {
    let yard = Yard::new();
    let ended = yard.run(&planner(&library.display().to_string(), arguments));
    assert!(yard.files().is_empty(), "{:?}", yard.files());
    ended
}

fn libraries(tests: &mut Tests) {
    let faulty = |variant| c_library("plugins/faulty/faulty.c", Some(variant));
    for attach in ["worker", "in-process"] {
        let refused = move |library: &Path, texts: &[&str]| {
            let ended = run(library, &["--attach", attach]).expect(PLUGIN);
            says(&ended, texts);
            assert!(ended.stderr.lines().count() <= 10, "{ended}");
        };
        for (variant, texts) in LIBRARIES {
            tests.add(&format!("libraries::{variant}::{attach}"), move || {
                refused(&faulty(variant), texts);
            });
        }
        tests.add(&format!("libraries::another layout::{attach}"), move || {
            let library = library("fleetyard-faulty-changed-layout");
            refused(
                &library,
                &["another layout of the contract", "hint: rebuild it"],
            );
        });
    }
    // Odd, but no fault.
    for variant in ["NEWER_MINOR", "CHATTY_LOAD", "LYING_CAPABILITIES"] {
        tests.add(&format!("libraries::{variant}"), move || {
            run(&faulty(variant), &[]).expect(SUCCESS);
        });
    }
    tests.add("libraries::CONSTRUCTOR_CRASH", move || {
        let ended = run(&faulty("CONSTRUCTOR_CRASH"), &[]).expect(PLUGIN);
        says(
            &ended,
            &["constructor_crash.so is no plugin", "crashed with SIG"],
        );
    });
}

/// A name, a plugin's file and identifier, arguments, the exit code, and what is said.
type Attachment = (
    &'static str,
    fn() -> PathBuf,
    &'static str,
    &'static [&'static str],
    i32,
    &'static [&'static str],
);

const ATTACHMENTS: &[Attachment] = &[
    (
        "a library as a program",
        faulty_library,
        "",
        &["--attach", "stdio"],
        PLUGIN,
        &["does not speak JSON", "--attach worker"],
    ),
    (
        "a program in a worker",
        faulty_program,
        "",
        &["--attach", "worker"],
        PLUGIN,
        &["cannot be loaded", "--attach stdio"],
    ),
    (
        "a program in the host",
        faulty_program,
        "",
        &["--attach", "in-process"],
        PLUGIN,
        &["cannot be loaded", "--attach stdio"],
    ),
    (
        "a library without that planner",
        faulty_library,
        ":nobody",
        &[],
        USAGE,
        &["has no planner `nobody`", "it has faulty"],
    ),
    // What a planner does not claim to support is not asked of it.
    (
        "a planner without that capability",
        faulty_library,
        "",
        &["--connectivity", "8"],
        NO_PLAN,
        &["eight-connected"],
    ),
];

fn attachments(tests: &mut Tests) {
    for (name, file, id, arguments, code, texts) in ATTACHMENTS {
        tests.add(&format!("attachments::{name}"), move || {
            let plugin = format!("{}{id}", file().display());
            let ended = Yard::new().run(&planner(&plugin, arguments));
            says(&ended.expect(*code), texts);
        });
    }
}

// ---- Planners that misbehave ----------------------------------------------------------

fn planner(name: &str, arguments: &[&str]) -> Vec<String> {
    let mut line = words("run --budget 60s --planner");
    line.push(name.to_owned());
    // Obstacles to run into, and room to move.
    line.extend(instance("random-32-32-20", 4));
    line.extend(arguments.iter().map(ToString::to_string));
    line
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum By {
    Worker,
    InProcess,
    Stdio,
}
use By::{InProcess, Stdio, Worker};

impl By {
    fn name(self) -> &'static str {
        match self {
            Worker => "worker",
            InProcess => "in-process",
            Stdio => "stdio",
        }
    }
}

/// A library or a program; for what would take the host down in its own process.
const APART: &[By] = &[Worker, Stdio];
const ALL: &[By] = &[Worker, InProcess, Stdio];
const LIBRARY: &[By] = &[Worker, InProcess];

/// Lets the faulty planner do `fault`, with further arguments, and checks the files
/// that it leaves against what the record says.
fn misbehave(fault: &str, by: By, arguments: &str) -> Ended {
    let path = match by {
        Worker | InProcess => faulty_library(),
        Stdio => faulty_program(),
    };
    let attach = by.name();
    let yard = Yard::new();
    let fault = format!("fault={fault}");
    let mut line = planner(
        &path.display().to_string(),
        &["--attach", attach, "--option", &fault, "--format", "json"],
    );
    line.extend(words(
        "--plan-out plan.json --trace-out trace.fyt --picture picture.svg",
    ));
    // The last of a repeated argument would be refused: the budget is replaced.
    let more = words(arguments);
    if more.iter().any(|word| word == "--budget") {
        let at = line.iter().position(|word| word == "--budget").unwrap();
        line.drain(at..at + 2);
    }
    line.extend(more);
    let ended = yard.run(&line);
    let record = ended.json();
    let mut files = BTreeSet::from(["picture.svg".to_owned()]);
    if arguments.contains("--annotations") {
        files.insert("annotations.json".into());
    }
    if !record["plan_digest"].is_null() {
        let plan: Value = serde_json::from_slice(&yard.read("plan.json")).unwrap();
        assert_eq!(plan["plan_digest"], record["plan_digest"]);
        files.insert("plan.json".into());
    }
    if !record["execution"].is_null() {
        files.insert("trace.fyt".into());
    }
    assert_eq!(yard.files(), files, "{ended}");
    let picture = yard.read("picture.svg");
    assert!(picture.trim_ascii_end().ends_with(b"</svg>"), "{ended}");
    ended
}

/// A fault, who can have it, and what the host says of it.
type Case = (&'static str, &'static [By], &'static [&'static str]);

/// Faults that come to the same.
struct Group {
    name: &'static str,
    arguments: &'static str,
    code: i32,
    termination: &'static str,
    cases: &'static [Case],
}

const FEW: &str = "the plan has 3 paths, but the instance has 4 agents";
const MANY: &str = "the plan has 5 paths, but the instance has 4 agents";
const NONE: &str = "it claims `solved` but submitted no plan";
const KILLED: &str = "did not answer `plan` within 300 ms and was killed";
const LATE: &str = "no plan within the budget of 300ms";

const GROUPS: &[Group] = &[
    Group {
        name: "answers that break the protocol",
        arguments: "",
        code: PLUGIN,
        termination: "protocol-error",
        cases: &[
            (
                "too-few-agents",
                ALL,
                &["broke the protocol during `plan`", FEW],
            ),
            (
                "too-many-agents",
                ALL,
                &["broke the protocol during `plan`", MANY],
            ),
            ("claims-solved-without-plan", ALL, &[NONE]),
            ("null-plan", &[Stdio], &[NONE]),
            ("null-plan", LIBRARY, &["plan is null"]),
            ("null-offsets", LIBRARY, &["plan.offsets is null"]),
            ("null-cells", LIBRARY, &["plan.cells is null"]),
            ("bad-plan-size", LIBRARY, &["plan.struct_size is 8"]),
            ("unordered-offsets", LIBRARY, &["out of order"]),
            (
                "bad-status",
                LIBRARY,
                &["it returned 99, which is no status"],
            ),
            ("bad-status", &[Stdio], &["unknown variant `brilliant`"]),
            ("two-results", &[Stdio], &["a second time"]),
            (
                "answers-early",
                &[Stdio],
                &["during `plan`", "before it was asked"],
            ),
            ("malformed", &[Stdio], &["a message is not JSON", "near"]),
            ("nan", &[Stdio], &["a message is not JSON", "NaN"]),
            (
                "negative-expansions",
                ALL,
                &["the figure `expansions` must be a whole number from 0, not -5"],
            ),
            (
                "half-node",
                ALL,
                &["the figure `nodes` must be a whole number from 0, not 0.5"],
            ),
            (
                "nan-bound",
                LIBRARY,
                &["the figure `lower_bound` must be a number from 0, not NaN"],
            ),
            (
                "keeps-too-much",
                ALL,
                &["it keeps 1048577 bytes, more than the limit of 1048576"],
            ),
            (
                "endless-call",
                &[Stdio],
                &["it claims to have worked for 1000000000s on a call of"],
            ),
            ("deep", &[Stdio], &["broke the protocol during `plan`"]),
            ("no-version", &[Stdio], &["no \"jsonrpc\":\"2.0\""]),
            ("batch", &[Stdio], &["batches are not supported"]),
            ("not-utf8", &[Stdio], &["not UTF-8"]),
            (
                "wrong-id",
                &[Stdio],
                &["it answered request", "but was asked"],
            ),
            (
                "request",
                &[Stdio],
                &["it sent a request, `plan`, but only the host asks"],
            ),
            ("no-message", &[Stdio], &["neither a method nor an id"]),
            (
                "closes-stdout",
                &[Stdio],
                &["closed its standard output and went on running"],
            ),
            (
                "bad-cells",
                &[Stdio],
                &["the paths are malformed", "expected a cell index"],
            ),
            (
                "bad-moves",
                &[Stdio],
                &["the paths are malformed", "unknown move 'O'"],
            ),
            ("huge-plan", LIBRARY, &["entries, more than the limit of"]),
        ],
    },
    Group {
        name: "too long",
        arguments: "--option size=300000000",
        code: PLUGIN,
        termination: "protocol-error",
        cases: &[(
            "huge-plan",
            &[Stdio],
            &[
                "the plan is longer than",
                "the most for 4 agents on this map",
            ],
        )],
    },
    // A gigabyte of lines that are no messages; a library's go to standard error. The budget is
    // far more than it takes, and far less than it took when the time to cut the flood into
    // lines grew with its square.
    Group {
        name: "too much",
        arguments: "--budget 20s",
        code: NO_PLAN,
        termination: "over-limit",
        cases: &[("flood", &[Stdio, Worker], &["output limit of 64.0 MiB"])],
    },
    Group {
        name: "reported failure",
        arguments: "",
        code: PLUGIN,
        termination: "failed",
        cases: &[
            (
                "fails",
                ALL,
                &["reported `internal-error` from `plan`: failed as asked"],
            ),
            ("rpc-error", &[Stdio], &["failed as asked"]),
        ],
    },
    // What is more than is kept is counted, and the plan is as good.
    Group {
        name: "more to show than is kept",
        arguments: "--annotations annotations.json",
        code: SUCCESS,
        termination: "completed",
        cases: &[
            (
                "annotation-flood",
                ALL,
                &["40000 annotations were left out: 10000 are all that is kept of a call"],
            ),
            ("none", ALL, &[]),
        ],
    },
    Group {
        name: "nonsense to show",
        arguments: "--annotations annotations.json",
        code: PLUGIN,
        termination: "protocol-error",
        cases: &[
            (
                "annotation-outside",
                ALL,
                &["an annotation of the layer `mischief`: shape 1 has place 1073741824, but there"],
            ),
            (
                "annotation-nan",
                LIBRARY,
                &["layer `mischief`: shape 1 has the point (NaN, NaN), which is not finite"],
            ),
            (
                "annotation-offsets",
                LIBRARY,
                &["annotation.offsets do not begin with 0 or are out of order"],
            ),
            (
                "annotation-count",
                LIBRARY,
                &["annotation.count is 4294967295, at most 32768 may be"],
            ),
            (
                "annotation-shape",
                LIBRARY,
                &["annotation.shape 99 is unknown"],
            ),
            (
                "annotation-shape",
                &[Stdio],
                &["the field `shape` is wrong: unknown variant `cube`"],
            ),
        ],
    },
    // Nobody wants to see it, and nobody looks at it.
    Group {
        name: "nonsense that nobody asked for",
        arguments: "",
        code: SUCCESS,
        termination: "completed",
        cases: &[
            ("annotation-flood", ALL, &[]),
            ("annotation-outside", ALL, &[]),
            ("annotation-shape", ALL, &[]),
            ("annotation-count", LIBRARY, &[]),
        ],
    },
    // A claim is passed on as a claim.
    Group {
        name: "claim",
        arguments: "",
        code: NO_PLAN,
        termination: "completed",
        cases: &[(
            "claims-infeasible",
            ALL,
            &["claims that no plan exists", "believe me"],
        )],
    },
    Group {
        name: "no answer in time",
        arguments: "--budget 300ms --prepare-budget 60s",
        code: NO_PLAN,
        termination: "timed-out",
        cases: &[
            ("never", APART, &[KILLED]),
            ("spin", APART, &[KILLED]),
            ("ignore-sigterm", APART, &[KILLED]),
            ("late", APART, &[KILLED]),
            ("partial", &[Stdio], &[KILLED]),
            // Nobody can be killed in the host's own process.
            ("late", &[InProcess], &[LATE]),
        ],
    },
    Group {
        name: "not prepared in time",
        arguments: "--prepare-budget 300ms --option during=prepare",
        code: NO_PLAN,
        termination: "timed-out",
        cases: &[(
            "never",
            APART,
            &["did not answer `prepare` within 300 ms and was killed"],
        )],
    },
    // Plans in the grace period do not count.
    Group {
        name: "in the grace period",
        arguments: "--budget 300ms --prepare-budget 60s --grace 60s",
        code: NO_PLAN,
        termination: "timed-out",
        cases: &[("late", APART, &[LATE])],
    },
    Group {
        name: "odd but no fault",
        arguments: "",
        code: SUCCESS,
        termination: "completed",
        cases: &[
            ("none", ALL, &[]),
            ("twice", ALL, &[]),
            // Started by the planner, in another session, deaf to polite signals.
            ("grandchild", APART, &[]),
            ("nan", LIBRARY, &[]),
            ("bad-request", LIBRARY, &[]),
            ("garbage", &[Worker], &[]),
            (
                "garbage",
                &[Stdio],
                &["lines to standard output that are no messages"],
            ),
        ],
    },
];

/// Planners that die, how the record calls that, and what the host says.
const DEATHS: &[(&str, &str, &str)] = &[
    ("crash", "crashed", "crashed with SIGSEGV (signal 11)"),
    ("abort", "crashed", "crashed with SIGABRT (signal 6)"),
    ("exit-0", "exited", "exited with code 0 without a result"),
    ("exit-3", "exited", "exited with code 3 without a result"),
];

/// Plans that break a rule, and which.
const BROKEN_RULES: &[(&str, &str)] = &[
    ("empty-path", "empty-path"),
    ("wrong-start", "wrong-start"),
    ("not-at-goal", "wrong-goal"),
    ("teleport", "not-adjacent"),
    ("collide", "vertex-conflict"),
    ("collide-parked", "parked-conflict"),
    ("swap", "swap-conflict"),
    ("leave-map", "out-of-bounds"),
    ("through-obstacle", "obstacle"),
];

fn misbehaviour(tests: &mut Tests) {
    for group in GROUPS {
        for (fault, ways, texts) in group.cases {
            for by in *ways {
                let name = format!("{}::{fault}::{}", group.name, by.name());
                tests.add(&format!("planners::{name}"), move || {
                    if *by == Stdio && !have("python3") {
                        return;
                    }
                    let ended = misbehave(fault, *by, group.arguments).expect(group.code);
                    assert_eq!(ended.json()["termination"], group.termination, "{ended}");
                    says(&ended, texts);
                });
            }
        }
    }
    for (fault, termination, text) in DEATHS {
        for during in ["create", "prepare", "plan"] {
            for by in APART {
                let name = format!("planners::death::{fault} during {during}::{}", by.name());
                tests.add(&name, move || {
                    if *by == Stdio && !have("python3") {
                        return;
                    }
                    let option = format!("--option during={during}");
                    let ended = misbehave(fault, *by, &option).expect(PLUGIN);
                    assert_eq!(ended.json()["termination"], *termination, "{ended}");
                    says(&ended, &[text, &format!("during `{during}`")]);
                });
            }
        }
    }
    for (fault, rule) in BROKEN_RULES {
        tests.add(&format!("planners::broken rule::{fault}"), move || {
            breaks(fault, rule);
        });
    }
}

/// The same plan by every way, which breaks one rule.
fn breaks(fault: &str, rule: &str) {
    let mut digests = BTreeSet::new();
    for by in ALL {
        if *by == Stdio && !have("python3") {
            continue;
        }
        let ended = misbehave(fault, *by, "").expect(INVALID_PLAN);
        let record = ended.json();
        assert_eq!(record["claim"], "solved", "{ended}");
        assert_eq!(record["verdict"]["valid"], false, "{ended}");
        let violations = record["verdict"]["violations"].as_array().unwrap();
        assert!(!violations.is_empty(), "{ended}");
        for violation in violations {
            assert_eq!(violation["rule"], rule, "{by:?} {ended}");
        }
        digests.insert(record["plan_digest"].to_string());
    }
    assert_eq!(digests.len(), 1, "another plan by another way");
}

/// Programs that fail before they are a plugin, or after their answer.
fn programs(tests: &mut Tests) {
    for (fault, texts) in [
        (
            "crash",
            ["is no plugin that speaks the protocol", "SIGSEGV"],
        ),
        (
            "exit-0",
            [
                "is no plugin that speaks the protocol",
                "exited with code 0",
            ],
        ),
        (
            "malformed",
            ["broke the protocol during `initialize`", "not JSON"],
        ),
        (
            "no-version",
            ["broke the protocol during `initialize`", "jsonrpc"],
        ),
        (
            "long-line",
            [
                "broke the protocol during `initialize`",
                "a message is longer than 4 MiB",
            ],
        ),
        (
            "id-of-a-path",
            ["`../../faulty` is no identifier", "initialize"],
        ),
        ("id-of-nobody", ["`` is no identifier", "initialize"]),
        ("id-of-two-lines", [r"`faulty\nverdict", "is no identifier"]),
    ] {
        tests.add(&format!("programs::at the start::{fault}"), move || {
            if have("python3") {
                let yard = Yard::new().set("FLEETYARD_FAULT", fault);
                let program = faulty_program().display().to_string();
                says(&yard.run(&planner(&program, &[])).expect(PLUGIN), &texts);
            }
        });
    }
    tests.add("programs::at the start::forged-header", || {
        if have("python3") {
            let yard = Yard::new().set("FLEETYARD_FAULT", "forged-header");
            let program = faulty_program().display().to_string();
            let ended = yard.run(&planner(&program, &[])).expect(SUCCESS);
            let verdicts = ended
                .stdout
                .lines()
                .filter(|line| line.starts_with("verdict "));
            assert_eq!(verdicts.count(), 1, "{ended}");
            assert!(!ended.stdout.contains('\u{1b}'), "{ended}");
        }
    });
    // After the answer only a breach of the protocol counts.
    for (fault, arguments, texts) in [
        (
            "crash",
            "--option during=shutdown",
            &[AFTERWARDS, "crashed with SIGSEGV"][..],
        ),
        (
            "exit-3",
            "--option during=shutdown",
            &[AFTERWARDS, "exited with code 3"],
        ),
        (
            "never",
            "--option during=shutdown",
            &[AFTERWARDS, "did not answer `shutdown`"],
        ),
        ("closes-stdin", "", &[]),
    ] {
        tests.add(&format!("programs::at the end::{fault}"), move || {
            if have("python3") {
                says(&misbehave(fault, Stdio, arguments).expect(SUCCESS), texts);
            }
        });
    }
}

const AFTERWARDS: &str = "warning: after its answer the planner";

/// The host keeps little of the output of a planner.
fn talkative() {
    if !have("python3") {
        return;
    }
    let script = r#"
import json, sys
def send(**message):
    print(json.dumps({"jsonrpc": "2.0", **message}), flush=True)
about = {"id": "talker", "kind": "planner", "capabilities": ["grid", "pebble"]}
for line in sys.stdin:
    message = json.loads(line)
    answer = {"status": "solved"}
    if message["method"] == "initialize":
        answer = {"protocol_version": 1, "plugins": [about]}
    elif message["method"] == "plan":
        text = "x" * (1 << 20)
        for number in range(400):
            send(method="log", params={"level": "info", "text": text})
            send(method="metric", params={"name": text + str(number), "value": 1})
        starts = message["params"]["instance"]["starts"]
        answer["paths"] = [[start] for start in starts]
    elif message["method"] == "exit":
        break
    if "id" in message:
        send(id=message["id"], result=answer)
"#;
    let yard = Yard::new();
    yard.write("talker.py", script);
    let ended = yard.run(&planner("./talker.py", &["--execute", "--format", "json"]));
    let record = ended.expect(INVALID_PLAN).json();
    let peak_kb = &record["execution"]["host_peak_memory_kb"];
    assert!(peak_kb.as_u64().unwrap() < 200 << 10, "{peak_kb} kB");
}

fn in_a_comparison() {
    let library = faulty_library().display().to_string();
    let yard = Yard::new();
    let mut line = words("compare --budget 2s --planner pibt --format json --planner");
    line.push(library);
    line.extend(instance("empty-8-8", 3));
    let record = yard.run(&line).expect(SUCCESS).json();
    assert_eq!(record["rows"].as_array().unwrap().len(), 2);

    // Everybody stays, which the planner does not call a plan.
    line.extend(words("--planner empty"));
    let ended = yard.run(&line).expect(NO_PLAN);
    let record = ended.json();
    let failures: Vec<&Value> = record["rows"]
        .as_array()
        .unwrap()
        .iter()
        .map(|row| &row["failures"])
        .collect();
    assert_eq!(failures[0].as_array().unwrap().len(), 0, "{ended}");
    assert_eq!(failures[2][0], "no plan: gave-up", "{ended}");
}

fn on_the_plugin_path() {
    let yard = Yard::new();
    let folder = yard.path("plugins");
    fs::create_dir(&folder).unwrap();
    fs::write(folder.join("a-text.so"), "no library").unwrap();
    fs::write(folder.join("b-notes.txt"), "no program").unwrap();
    fs::copy(
        c_library("plugins/faulty/faulty.c", Some("WRONG_MAJOR")),
        folder.join("c-major.so"),
    )
    .unwrap();
    fs::copy(faulty_library(), folder.join("d-faulty.so")).unwrap();
    let yard = yard.set("FLEETYARD_PLUGIN_PATH", &folder.display().to_string());
    let ended = yard.line("plugins list --format json").expect(SUCCESS);
    let listed = ended.json();
    let place = |name: &str| {
        let named = |file: &&Value| {
            file["path"]
                .as_str()
                .is_some_and(|path| path.ends_with(name))
        };
        listed.as_array().unwrap().iter().find(named).cloned()
    };
    let refused = |name: &str| place(name).unwrap()["refused"].as_str().unwrap().to_owned();
    assert!(
        refused("a-text.so").contains("no shared library"),
        "{ended}"
    );
    assert!(refused("c-major.so").contains("version 2.0"), "{ended}");
    assert!(place("b-notes.txt").is_none(), "{ended}");
    assert_eq!(place("d-faulty.so").unwrap()["plugins"][0]["id"], "faulty");
    let ended = yard.line("plugins list").expect(SUCCESS);
    says(&ended, &["warning: ", "version 2.0", "no shared library"]);
    assert!(
        ended.stdout.contains("(refused)") && ended.stdout.contains("lacam"),
        "{ended}"
    );
    // By identifier, from the plugin path.
    let mut line = words("run --planner faulty --budget 60s");
    line.extend(instance("empty-8-8", 2));
    yard.run(&line).expect(SUCCESS);
}

//! Command adapters end to end: solvers of every named format and a described one,
//! and solvers that misbehave. The solvers are small programs in Python, written here.

use fleetyard_core::formats::Format;
use fleetyard_runtime::adapter::Manifest;
use fleetyard_testkit::{
    INPUT, INVALID_PLAN, NO_PLAN, PLUGIN, SUCCESS, USAGE, Yard, have, instance, root, words,
};
use serde_json::Value;

/// Reads MovingAI files and plans one agent after the other in space and time. Its
/// arguments are `name=value`; `style` is how it writes its answer, or how it
/// misbehaves.
const SOLVER: &str = r##"#!/usr/bin/env python3
import json, os, signal, sys, time
from collections import deque

if "--version" in sys.argv:
    sys.exit("solver, version 7.3-test (a test)")
given = dict(word.split("=", 1) for word in sys.argv[1:])
style = given["style"]
agents = []
if "map" in given:
    rows = open(given["map"]).read().split("\nmap\n")[1].split()
    height, width = len(rows), len(rows[0])
    entries = open(given["scen"]).read().splitlines()[1:]
else:
    # An instance of libMultiRobotPlanning, which has the map in it.
    numbers = lambda line: [int(word) for word in line.split("[")[1].rstrip("]").split(",")]
    first, size, *lines = open(given["scen"]).read().splitlines()
    assert first == "map:"
    (width, height), entries, ends = numbers(size), [], []
    rows = [["."] * width for _ in range(height)]
    for line in lines:
        if line.startswith("  - ["):
            x, y = numbers(line)
            rows[y][x] = "@"
        elif "start:" in line or "goal:" in line:
            ends.append(tuple(numbers(line)[::-1]))
    agents = list(zip(ends[::2], ends[1::2]))
for line in entries:
    fields = line.split("\t")
    assert fields[1] == "map.map" and fields[2:4] == [str(width), str(height)]
    x, y, gx, gy = map(int, fields[4:8])
    if given.get("order") == "row-col":
        x, y, gx, gy = y, x, gy, gx
    agents.append(((y, x), (gy, gx)))
assert len(agents) == int(given["agents"])
assert 0 < float(given["seconds"]) < 60, given["seconds"]

STEPS = 300
taken, ends = set(), {}
paths = []
for start, goal in agents:
    last = max([t for (t, *move) in taken if move[0] == goal] + [0])
    queue, before = deque([(0, start)]), {(0, start): None}
    while queue:
        t, here = queue.popleft()
        if here == goal and t >= last:
            break
        r, c = here
        for there in (here, (r - 1, c), (r, c + 1), (r + 1, c), (r, c - 1)):
            state = (t + 1, there)
            if t == STEPS or state in before:
                continue
            if not (0 <= there[0] < height and 0 <= there[1] < width):
                continue
            if rows[there[0]][there[1]] != ".":
                continue
            if (t + 1, there) in taken or (t + 1, there, here) in taken:
                continue
            if there in ends and t + 1 >= ends[there]:
                continue
            before[state] = (t, here)
            queue.append(state)
    else:
        sys.exit("no path for an agent")
    state, path = (t, here), []
    while state:
        path.append(state[1])
        state = before[state]
    path.reverse()
    for at, cell in enumerate(path):
        taken.add((at, cell))
        if at:
            taken.add((at, path[at - 1], cell))
    ends[path[-1]] = len(path) - 1
    paths.append(path)

cost = sum(len(path) - 1 for path in paths)
print(f"a stray line\nexpanded: 12\nexpanded: {cost}")
print("progress on standard error", file=sys.stderr)
longest = max(map(len, paths))
full = [path + [path[-1]] * (longest - len(path)) for path in paths]
answer = None
if style == "lacam":
    answer = f"agents={len(paths)}\nsolved=1\nsoc={cost}\nsolution=\n"
    for t in range(longest):
        answer += f"{t}:" + "".join(f"({c},{r})," for r, c in (path[t] for path in full)) + "\n"
elif style == "paths-txt":
    answer = ""
    for agent, path in enumerate(paths):
        answer += f"Agent {agent}: " + "".join(f"({r},{c})->" for r, c in path) + "\n"
elif style == "mapf-visualizer":
    answer = ""
    for t in range(longest):
        answer += f"{t}:" + "".join(f"({c},{r},Y_PLUS)," for r, c in (path[t] for path in full)) + "\n"
elif style == "libmrp-schedule":
    answer = "schedule:\n"
    for agent, path in enumerate(paths):
        answer += f"  agent{agent}:\n"
        for t, (r, c) in enumerate(path):
            answer += f"    - x: {c}\n      y: {r}\n      t: {t}\n"
elif style == "planviz":
    letters = {(0, 0): "W", (-1, 0): "U", (1, 0): "D", (0, -1): "L", (0, 1): "R"}
    moves = lambda path: ",".join(letters[(b[0] - a[0], b[1] - a[1])] for a, b in zip(path, path[1:]))
    answer = json.dumps({
        "actionModel": "MAPF", "teamSize": len(paths),
        "start": [[*path[0], "E"] for path in paths], "actualPaths": [moves(path) for path in paths],
    })
elif style == "plan":
    answer = json.dumps({"format": "fleetyard.plan/1", "rows": height, "cols": width, "paths": paths})
elif style == "rows":
    answer = "agent,t,x,y\n"
    for agent, path in reversed(list(enumerate(paths))):
        answer += "".join(f"{agent},{t},{c},{r}\n" for t, (r, c) in enumerate(path))
elif style == "cells":
    answer = "".join(" ".join(str(r * width + c + 1) for r, c in path) + "\n" for path in paths)
    answer = f"PATHS\n{answer}DONE {cost}\n"
elif style == "stdout":
    print("BEGIN")
    for agent, path in reversed(list(enumerate(paths, 1))):
        print(f"#{agent}: [" + "; ".join(f"{r} {c}" for r, c in path) + "]")
elif style == "crossed":
    answer = ""
    for agent, path in enumerate(paths):
        answer += f"Agent {agent}: " + "".join(f"({c},{r})->" for r, c in path) + "\n"
elif style == "half":
    whole = "".join(f"Agent {agent}: " + "".join(f"({r},{c})->" for r, c in path) + "\n" for agent, path in enumerate(paths))
    answer = whole[: whole.index("->") + 6]
elif style in ("short", "jump"):
    answer = ""
    for agent, path in enumerate(paths):
        path = path[:-1] if style == "short" else path[:1] + path[3:]
        answer += f"Agent {agent}: " + "".join(f"({r},{c})->" for r, c in path) + "\n"
elif style == "empty":
    answer = ""
elif style == "unsolved":
    answer = "solved=0\nsolution=\n"
elif style == "fewer":
    answer = "Agent 0: (0,0)->\n"
elif style == "gibberish":
    answer = "Agent 0: (0,0)->(0,1)=>(0,2)\n\x00\x1b[2J"
elif style == "binary":
    open(given["output"], "wb").write(bytes(range(256)))
elif style == "code":
    sys.exit(1)
elif style == "shell":
    sys.exit(139)
elif style == "timeout-code":
    sys.exit(9)
elif style == "killed":
    os.kill(os.getpid(), signal.SIGSEGV)
elif style == "infeasible":
    print("search over: NO SOLUTION EXISTS")
elif style == "forever":
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    time.sleep(600)
elif style == "escapes":
    if os.fork() == 0:
        os.setsid()
        if os.fork() == 0:
            time.sleep(600)
        os._exit(0)
elif style == "daemon":
    if os.fork() == 0:
        time.sleep(600)
elif style == "link":
    os.symlink("/etc/passwd", given["output"])
elif style == "pipe":
    os.mkfifo(given["output"])
elif style == "flood":
    for _ in range(200_000):
        print("x" * 100)
elif style == "options":
    print(" ".join(sys.argv[1:]), os.environ["THREADS"], os.path.basename(os.getcwd()))
    sys.exit(1)
if answer is not None:
    open(given["output"], "w").write(answer)
"##;

/// A manifest for the solver: `output` is the body of `[output]`, `more` the rest.
fn manifest(style: &str, output: &str, more: &str) -> String {
    let answer = if output.contains("stdout") {
        ""
    } else {
        "\"output={output}\","
    };
    format!(
        r#"manifest = 1
id = "test-solver"
description = "Prioritized planning, for tests."
homepage = "https://example.org/solver"

[version]
args = ["--version"]
pattern = 'version (\S+)'

[program]
command = "./solver.py"
args = ["style={style}", "map={{map}}", "scen={{scen}}", "agents={{agents}}", "seconds={{seconds}}", {answer} ]

[output]
{output}

[metrics]
expanded = {{ pattern = '^expanded: (\d+)$', unit = "nodes" }}
{more}
"#
    )
}

/// A folder with the solver and its manifest.
fn yard(manifest: &str) -> Yard {
    use std::os::unix::fs::PermissionsExt;
    let yard = Yard::new();
    let solver = yard.write("solver.py", SOLVER);
    std::fs::set_permissions(solver, std::fs::Permissions::from_mode(0o755)).unwrap();
    yard.write("planner.toml", manifest);
    yard
}

fn arguments(planner: &str, more: &str) -> Vec<String> {
    let mut line = words("run --budget 30s --seed 1 --format json --planner");
    line.push(planner.to_owned());
    line.extend(instance("random-32-32-20", 20));
    line.extend(words(more));
    line
}

/// Runs the solver that a manifest describes; its record.
#[track_caller]
fn run(manifest: &str, more: &str, code: i32) -> Value {
    let yard = yard(manifest);
    yard.run(&arguments("./planner.toml", more))
        .expect(code)
        .json()
}

#[test]
fn every_format_is_read() {
    if !have("python3") {
        return;
    }
    let cells = "format = \"custom\"\nfile = \"cells.txt\"\n[output.custom]\nlayout = \"agent-major\"\n\
                 order = \"cell\"\nseparator = \" \"\ncoordinates_from = 1\nskip_lines = 1\nend = '^DONE'";
    let stdout = "format = \"custom\"\nfrom = \"stdout\"\n[output.custom]\nlayout = \"agent-major\"\n\
                  line = \"#{agent}: [{path}]\"\nposition = \"{row} {col}\"\nseparator = \";\"\n\
                  index_from = 1\nbegin = '^BEGIN$'";
    let rows =
        "format = \"custom\"\n[output.custom]\nlayout = \"rows\"\norder = \"x-y\"\nskip_lines = 1";
    let described = [("cells", cells), ("stdout", stdout), ("rows", rows)];
    // Whatever plan on a grid commands read, an adapter reads; it knows no scenario.
    let named = Format::ALL
        .iter()
        .filter(|format| format.carries_plan() && !format.needs_starts());
    let named = named.map(|format| (format.name(), format!("format = \"{format}\"")));
    let described = described.map(|(style, output)| (style, output.to_owned()));
    let mut digests = Vec::new();
    for (style, output) in named.chain(described) {
        let record = run(&manifest(style, &output, ""), "", SUCCESS);
        assert_eq!(record["verdict"]["valid"], true, "{style}");
        assert_eq!(record["claim"], "solved");
        assert_eq!(record["planner"]["id"], "test-solver");
        assert_eq!(record["planner"]["version"], "7.3-test");
        assert_eq!(record["planner"]["attach"], "command");
        assert_eq!(record["planner"]["ranked"], true);
        // The last of several figures counts.
        let figure = &record["claimed_metrics"]["expanded_nodes"];
        assert_eq!(
            figure.as_f64(),
            record["metrics"]["soc_steps"].as_f64(),
            "{style}"
        );
        digests.push(record["plan_digest"].clone());
    }
    // The same solver, so the same plan, however it is written.
    assert_eq!(digests.len(), 9);
    digests.dedup();
    assert_eq!(digests.len(), 1);
}

#[test]
fn instances_of_libmrp_on_request() {
    if !have("python3") {
        return;
    }
    let format = "format = \"libmrp-schedule\"";
    let text = manifest("libmrp-schedule", format, "[input]\nscen = \"libmrp\"");
    let text = text.replace("\"map={map}\", ", "");
    let record = run(&text, "", SUCCESS);
    let usual = run(&manifest("libmrp-schedule", format, ""), "", SUCCESS);
    assert_eq!(record["plan_digest"], usual["plan_digest"]);
}

#[test]
fn rows_before_columns_on_request() {
    if !have("python3") {
        return;
    }
    let mut text = manifest(
        "lacam",
        "format = \"lacam\"",
        "[input]\norder = \"row-col\"",
    );
    text = text.replace("\"style=lacam\"", "\"style=lacam\", \"order=row-col\"");
    run(&text, "", SUCCESS);
    // The classic mistake is told by its name.
    misbehaves(
        "crossed",
        "",
        PLUGIN,
        "protocol-error",
        "output.txt: agents do not begin at their starts; rows and columns look swapped",
    );
}

/// A plan that is wrong is the validator's to judge.
#[test]
fn wrong_plans_are_invalid_whatever_the_solver_claims() {
    if !have("python3") {
        return;
    }
    for (style, kind) in [("short", "wrong-goal"), ("jump", "not-adjacent")] {
        let text = manifest(style, "format = \"paths-txt\"", "");
        let record = run(&text, "", INVALID_PLAN);
        assert_eq!(record["claim"], "solved");
        assert_eq!(record["verdict"]["valid"], false);
        let violations = record["verdict"]["violations"].as_array().unwrap();
        let kinds: Vec<&Value> = violations.iter().map(|one| &one["rule"]).collect();
        assert!(kinds.iter().any(|one| **one == kind), "{style}: {kinds:?}");
    }
}

#[test]
fn another_version_is_refused() {
    if !have("python3") {
        return;
    }
    let text = manifest("lacam", "format = \"lacam\"", "");
    let of = |supported: &str| {
        let line = format!("pattern = 'version (\\S+)'\nsupported = '{supported}'");
        text.replace("pattern = 'version (\\S+)'", &line)
    };
    run(&of(r"7\.\d+.*"), "", SUCCESS);
    let refused = |text: &str, told: &str| {
        let ended = yard(text).run(&arguments("./planner.toml", ""));
        let ended = ended.expect(PLUGIN);
        for told in [told, "hint: get it from https://example.org/solver"] {
            assert!(ended.stderr.contains(told), "{told}: {ended}");
        }
    };
    // It must match whole.
    refused(
        &of("7"),
        "solver.py is version 7.3-test, and the manifest is for `7`",
    );
    let silent = of("7").replace("version (", "edition (");
    refused(
        &silent,
        "solver.py did not say its version, and the manifest is for `7`",
    );
}

/// Checks the record of a solver that misbehaves.
#[track_caller]
fn misbehaves(style: &str, more: &str, code: i32, termination: &str, told: &str) {
    let manifest = manifest(style, "format = \"paths-txt\"", more);
    let record = run(&manifest, "", code);
    assert_eq!(record["termination"], termination, "{style}: {record}");
    let mut texts = vec![&record["fault"], &record["message"]];
    texts.retain(|text| text.as_str().is_some_and(|text| text.contains(told)));
    assert!(!texts.is_empty(), "{style}: {record}");
    assert_eq!(record["plan_digest"], Value::Null);
}

#[test]
fn solvers_that_misbehave_are_told_apart() {
    if !have("python3") {
        return;
    }
    let broken = |style, told| misbehaves(style, "", PLUGIN, "protocol-error", told);
    let failed = |style, told| misbehaves(style, "", PLUGIN, "failed", told);
    broken(
        "gibberish",
        "output.txt:1:22: expected '->' or the end of the line, found '=>(0,2)'",
    );
    broken(
        "fewer",
        "output.txt:2: there is no path for agent 1: 1 paths for 20 agents",
    );
    broken(
        "half",
        "output.txt:1:23: expected a column, found the end of the line",
    );
    broken(
        "empty",
        "there is no path for agent 0: 0 paths for 20 agents",
    );
    broken("binary", "output.txt:1:1: expected 'Agent', found");
    broken("link", "output.txt:");
    broken("pipe", "output.txt: the answer is not a regular file");
    failed(
        "code",
        "the solver exited with code 1; its last words were: progress on",
    );
    failed("killed", "the solver was ended by SIGSEGV");
    failed("shell", "exited with code 139, which stands for SIGSEGV");
    failed("escapes", "exited with code 0 but wrote no output.txt");
    failed("nothing", "exited with code 0 but wrote no output.txt");
    failed("daemon", "exited with code 0 but wrote no output.txt");
    failed("flood", "exited with code 0 but wrote no output.txt");
}

#[test]
fn rules_say_what_an_end_means() {
    if !have("python3") {
        return;
    }
    let rules = "[exit]\ncodes = { 9 = \"timed-out\" }\n[[exit.patterns]]\npattern = 'NO SOLUTION EXISTS'\n\
                 status = \"infeasible\"\nmessage = \"it proved it\"\n";
    for (style, claim, told) in [
        (
            "infeasible",
            "infeasible",
            "it proved it (the solver wrote: search over: NO SOLUTION EXISTS)",
        ),
        ("timeout-code", "timed-out", "exited with code 9"),
    ] {
        let manifest = manifest(style, "format = \"paths-txt\"", rules);
        let record = run(&manifest, "", NO_PLAN);
        assert_eq!(record["claim"], claim, "{record}");
        assert!(
            record["message"].as_str().unwrap().contains(told),
            "{record}"
        );
    }
    let record = run(&manifest("unsolved", "format = \"lacam\"", ""), "", NO_PLAN);
    assert_eq!(record["claim"], "gave-up");
}

#[test]
fn a_solver_that_sleeps_past_the_deadline_is_killed() {
    if !have("python3") {
        return;
    }
    let yard = yard(&manifest("forever", "format = \"paths-txt\"", ""));
    let mut line = arguments("./planner.toml", "");
    for word in &mut line {
        if word == "30s" {
            *word = "2s".into();
        }
    }
    let record = yard.run(&line).expect(NO_PLAN).json();
    // On a busy machine it is asked to end before it has got round to not listening.
    let died = record["termination"] == "completed" && record["claim"] == "timed-out";
    assert!(died || record["termination"] == "timed-out", "{record}");
}

#[test]
fn options_reach_the_solver() {
    if !have("python3") {
        return;
    }
    let more = "[options.bound]\ntype = \"number\"\nminimum = 1\n[options.mode]\ntype = \"string\"\ndefault = \"a b\"\n\
                [options.greedy]\ntype = \"boolean\"\n";
    let mut text = manifest("options", "format = \"paths-txt\"", more);
    text = text.replace(
        "\"style=options\",",
        "\"style=options\", \"mode={option.mode}\", \"seed={seed}/{seed31}\",\n\
         { when = \"option.bound\", args = [\"w={option.bound}\"] },\n\
         { when = \"option.greedy\", args = [\"greedy=1\"] },\n\
         { when = \"threads\", args = [\"many=1\"] },\n\
         { when = \"one_thread\", args = [\"one=1\"] },",
    );
    text = text.replace(
        "[output]",
        "env = { THREADS = \"{threads}\" }\ncwd = \"{manifest_dir}\"\n[output]",
    );
    for (given, has, lacks) in [
        (
            "",
            vec!["mode=a b seed=1/1 one=1"],
            vec!["w=", "greedy", "many"],
        ),
        (
            "--option bound=1.5 --option greedy=true --option mode=c --threads 2",
            vec!["mode=c", " w=1.5 greedy=1 many=1"],
            vec![],
        ),
        ("--option greedy=false", vec![], vec!["greedy"]),
    ] {
        // Its log is where it shows them.
        let yard = yard(&text);
        let mut line = arguments("./planner.toml", given);
        line.push("--verbose".into());
        let ended = yard.run(&line).expect(PLUGIN);
        for wanted in has {
            assert!(ended.stderr.contains(wanted), "{wanted}: {ended}");
        }
        for unwanted in lacks {
            assert!(!ended.stderr.contains(unwanted), "{unwanted}: {ended}");
        }
    }
    let yard = yard(&text);
    let ended = yard
        .run(&arguments("./planner.toml", "--option bound=0"))
        .expect(USAGE);
    assert!(
        ended.stderr.contains("option `bound`: 0 is less than"),
        "{ended}"
    );
}

#[test]
fn adapters_are_found_and_described() {
    if !have("python3") {
        return;
    }
    let text = manifest(
        "lacam",
        "format = \"lacam\"",
        "[capabilities]\ndeterministic = true",
    );
    let yard = yard(&text);
    // By file, by folder, and by identifier on the plugin path.
    for name in ["./planner.toml", "./", "{here}/planner.toml"] {
        let ended = yard.line(&format!("plugins info {name} --format json"));
        let plugins = ended.expect(SUCCESS).json();
        assert_eq!(plugins[0]["id"], "test-solver");
        assert_eq!(
            plugins[0]["capabilities"],
            serde_json::json!(["grid", "pebble", "deterministic"])
        );
        assert_eq!(plugins[0]["version"], "7.3-test");
    }
    let folder = yard.path("").display().to_string();
    yard.write("Cargo.toml", "[package]");
    yard.write(
        "other.planner.toml",
        text.replace("test-solver", "other-solver"),
    );
    std::fs::create_dir(yard.path("third")).unwrap();
    let third = text
        .replace("test-solver", "third-solver")
        .replace("./solver.py", "../solver.py");
    yard.write("third/planner.toml", third);
    let yard = yard.set("FLEETYARD_PLUGIN_PATH", &folder);
    let listed = yard.line("plugins list").expect(SUCCESS);
    for id in ["test-solver", "other-solver", "third-solver"] {
        assert!(listed.stdout.contains(id), "{id}: {listed}");
    }
    assert!(!listed.stdout.contains("Cargo.toml"), "{listed}");
    let record = yard
        .run(&arguments("test-solver", ""))
        .expect(SUCCESS)
        .json();
    assert_eq!(record["verdict"]["valid"], true);
}

#[test]
fn a_manifest_that_cannot_be_used_says_why() {
    let text = manifest("lacam", "format = \"lacam\"", "");
    let refused = |text: &str, told: &str, hint: &str| {
        let yard = Yard::new();
        yard.write("planner.toml", text);
        let ended = yard.run(&arguments("./planner.toml", "")).expect(INPUT);
        assert!(ended.stderr.contains(told), "{ended}");
        assert!(ended.stderr.contains(hint), "{ended}");
    };
    refused(
        &text,
        "solver.py does not exist",
        "hint: get it from https://example.org/solver",
    );
    let elsewhere = text.replace(
        "\"./solver.py\"",
        "\"no-such-solver\"\nvariable = \"TEST_SOLVER\"",
    );
    refused(
        &elsewhere,
        "planner.toml:11:11: the program `no-such-solver` is not on PATH",
        "TEST_SOLVER may name the program",
    );
    // What else is in the environment is no solver's business.
    let curious = text.replace(
        "\"./solver.py\"",
        "\"./solver.py\"\nvariable = \"AWS_SECRET_ACCESS_KEY\"",
    );
    refused(
        &curious,
        "`AWS_SECRET_ACCESS_KEY` is no variable of `test-solver`",
        "call it TEST_SOLVER, or something that begins with TEST_SOLVER_",
    );
    let wrong = text.replace("{map}", "{mapp}");
    refused(
        &wrong,
        "planner.toml:12:24: unknown placeholder `{mapp}`",
        "did you mean `{map}`?",
    );
    let wrong = text.replace("(\\S+)", "(\\S+");
    refused(
        &wrong,
        "planner.toml:8:11: the pattern cannot be used: unclosed group",
        "patterns are regular expressions",
    );
    let wrong = text.replace("format = \"lacam\"", "format = \"lacan\"");
    refused(
        &wrong,
        "planner.toml:15:10: `format` cannot be \"lacan\"",
        "did you mean \"lacam\"?",
    );
}

#[test]
fn attachments_are_not_mixed_up() {
    let yard = yard(&manifest("lacam", "format = \"lacam\"", ""));
    for (planner, attach, told) in [
        ("./planner.toml", "worker", "use `--attach command`"),
        ("pibt", "command", "no planner.toml"),
    ] {
        let ended = yard.run(&arguments(planner, &format!("--attach {attach}")));
        assert!(ended.code != Some(SUCCESS), "{ended}");
        assert!(ended.stderr.contains(told), "{ended}");
    }
}

/// Manifests that users copy, in the documentation and in `plugins/adapters`.
#[test]
fn manifests_that_are_shown_can_be_read() {
    let mut shown = Vec::new();
    for file in ["docs/adapters.md", "README.md"] {
        let text = std::fs::read_to_string(root().join(file)).unwrap();
        let blocks = text.split("```toml\n").skip(1);
        let blocks = blocks.filter_map(|block| block.split("```").next());
        for block in blocks.filter(|block| block.contains("[program]")) {
            shown.push((file.to_owned(), block.to_owned()));
        }
    }
    for entry in std::fs::read_dir(root().join("plugins/adapters")).unwrap() {
        let file = entry.unwrap().path().join("planner.toml");
        // An adapter in code has none.
        if let Ok(text) = std::fs::read_to_string(&file) {
            shown.push((file.display().to_string(), text));
        }
    }
    assert!(shown.len() >= 3);
    for (file, text) in shown {
        Manifest::read(&text, &file).unwrap_or_else(|error| panic!("{error}"));
    }
}

//! `fleetyard store bundle` and `fleetyard store repeat`: a finished suite goes into one archive, and
//! somebody else makes its trials again out of it.

use std::fs;
use std::path::Path;

use fleetyard_bench::suite::load_suite;
use fleetyard_bench::{Row, Store};
use fleetyard_testkit::{INPUT, NO_PLAN, SUCCESS, USAGE, Yard, c_library, root};
use serde_json::Value;

/// A suite of scenarios of three kinds in `yard`: with the map beside it, with a map elsewhere, and
/// made ones; a fleet file executes the plans.
fn fill(yard: &Yard, planners: &str) {
    let copy = |from: &str, to: &str| {
        let to = yard.path(to);
        fs::create_dir_all(to.parent().unwrap()).unwrap();
        fs::copy(root().join("maps").join(from), to).unwrap();
    };
    copy("empty-8-8.map", "world/empty-8-8.map");
    copy("empty-8-8-random-1.scen", "world/empty-8-8-random-1.scen");
    // Another map of the same name, and another scenario.
    copy("empty-16-16.map", "other/empty-8-8.map");
    copy("empty-16-16-random-1.scen", "other/empty-8-8-random-1.scen");
    let scenario = fs::read_to_string(yard.path("other/empty-8-8-random-1.scen")).unwrap();
    let scenario = scenario.replace("empty-16-16", "empty-8-8");
    yard.write("other/empty-8-8-random-1.scen", scenario);
    copy("random-32-32-20.map", "maps/random-32-32-20.map");
    copy("random-32-32-20-random-1.scen", "scens/first.scen");
    yard.write(
        "robots.json",
        r#"{"format": "fleetyard.fleet/1", "profiles": {"a": {"footprint": {"disc": {"radius_m": 0.3}},
            "model": {"single-integrator": {"speed_m_per_s": 1.5}}}}, "agents": {"all": "a"}}"#,
    );
    yard.write(
        "s.toml",
        format!(
            r#"name = "small"
description = "says \"what\" it is" # and more

[protocol]
repeats = 2
keep_plans = true

[budget]
wall = "1m"

[execution]
fleet = "robots.json"
policy = "adg"

{planners}

[[instances]]
scen = ["world/*.scen", "other/empty-8-8-random-1.scen"]
agents = [2, 4]

[[instances]]
scen = "scens/first.scen"
map = "${{PLACE}}"
agents = 3

[[instances]]
generate = {{ kind = "room", rows = 17, cols = 17, room_size = 4, seeds = [1, 2] }}
agents = 3
"#
        ),
    );
}

const PLANNERS: &str = r#"
[[planner]]
plugin = "pibt"

[[planner]]
label = "LaCAM"
plugin = "lacam"
options = { anytime = false }
"#;

fn filled(planners: &str) -> Yard {
    let yard = Yard::new();
    let place = yard.path("maps").display().to_string();
    let yard = yard.set("PLACE", &place);
    fill(&yard, planners);
    yard
}

fn rows(path: &Path) -> Vec<Row> {
    Store::open_read_only(path).unwrap().rows().unwrap()
}

fn manifest(folder: &Path) -> Value {
    serde_json::from_slice(&fs::read(folder.join("manifest.json")).unwrap()).unwrap()
}

#[test]
fn a_bundle_is_repeated_where_nothing_else_is() {
    let yard = filled(PLANNERS);
    let made = yard.line("bench s.toml --format json").expect(SUCCESS);
    assert_eq!(made.json()["failed"], 0, "{made}");
    let written = yard.line("store bundle small.sqlite --format json");
    let written = written.expect(SUCCESS).json();
    assert_eq!(written["trials"], 28);
    assert_eq!(written["plans"]["not_kept"], 0, "{written:#}");
    let files = yard.files();
    assert!(files.contains("small.bundle.tar.gz"), "{files:?}");
    assert!(
        !files.iter().any(|name| name.contains("fleetyard-")),
        "{files:?}"
    );
    // Equal stores give equal bytes, and nothing is replaced.
    yard.line("store bundle small.sqlite -o again.tar.gz")
        .expect(SUCCESS);
    assert_eq!(yard.read("again.tar.gz"), yard.read("small.bundle.tar.gz"));
    let refused = yard.line("store bundle small.sqlite").expect(INPUT);
    assert!(refused.stderr.contains("a file of this name"), "{refused}");

    // Elsewhere, with nothing but the archive.
    let away = Yard::new();
    fs::copy(yard.path("small.bundle.tar.gz"), away.path("b.tar.gz")).unwrap();
    let recorded = rows(&yard.path("small.sqlite"));
    drop(yard);
    let repeated = away
        .line("store repeat b.tar.gz --into here --format json")
        .expect(SUCCESS)
        .json();
    assert_eq!(repeated["equal"], 28, "{repeated:#}");
    assert_eq!(repeated["differ"], Value::Array(Vec::new()));
    for planner in repeated["planners"].as_array().unwrap() {
        assert_eq!(planner["code"], "same", "{repeated:#}");
    }
    assert_eq!(away.files(), ["b.tar.gz", "here"].map(str::to_owned).into());
    let text = away.line("store repeat here --sample 3").expect(SUCCESS);
    assert!(
        text.stdout
            .contains("3 trials made again: 3 equal, 0 different"),
        "{text}"
    );
    assert!(
        text.stdout.contains("25 trials not in the sample"),
        "{text}"
    );
    // The store is the one that was, and plans are files that are judged like any other.
    let here = away.path("here");
    assert_eq!(rows(&here.join("small.sqlite")), recorded);
    let said = manifest(&here);
    assert_eq!(
        said["plans"]["kept"],
        fs::read_dir(here.join("plans")).unwrap().count()
    );
    let row = recorded
        .iter()
        .find(|row| row.map == "random-32-32-20")
        .unwrap();
    let judged = away.line(&format!(
        "validate --map here/inputs/random-32-32-20.map --scen here/inputs/first.scen --agents 3 \
         here/plans/{}.json",
        row.plan_digest.as_ref().unwrap()
    ));
    judged.expect(SUCCESS);
    // Two files of one name are two, each with its own map.
    assert!(here.join("inputs/2/empty-8-8.map").is_file());
    // Keys depend on contents and not on places: the suite as it is in there asks for the same
    // trials.
    let again = away
        .line("bench here/suite.toml --store here/small.sqlite --resume --format json")
        .expect(SUCCESS)
        .json();
    assert_eq!(
        (&again["made"], &again["superseded"]),
        (&0.into(), &0.into()),
        "{again:#}"
    );
    let suite = load_suite(here.join("suite.toml")).unwrap();
    assert_eq!(suite.description, "says \"what\" it is");
}

#[test]
fn what_is_not_as_it_was_is_refused() {
    let yard = filled(PLANNERS);
    yard.line("bench s.toml --set protocol.repeats=1 --set protocol.keep_plans=false")
        .expect(SUCCESS);
    // Values of the command line belong to the suite, and the file may be gone.
    let text = yard.read("s.toml");
    fs::remove_file(yard.path("s.toml")).unwrap();
    let told = yard
        .line("store bundle small.sqlite -o b.tar.gz")
        .expect(SUCCESS);
    assert!(told.stdout.contains("trials    14"), "{told}");
    assert!(told.stdout.contains("plans     not kept"), "{told}");
    yard.line("store repeat b.tar.gz --sample 2")
        .expect(SUCCESS);
    yard.write("s.toml", text);
    let refused = |reason: &str, place: &str| {
        let ended = yard
            .line("store bundle small.sqlite -o c.tar.gz")
            .expect(INPUT);
        assert!(ended.stderr.contains(reason), "{ended}");
        assert!(ended.stderr.contains(place), "{ended}");
        assert!(ended.stderr.contains("hint: "), "{ended}");
        assert!(!yard.files().contains("c.tar.gz"));
    };
    // A map.
    let map = yard.read("maps/random-32-32-20.map");
    let mut changed = map.clone();
    let at = changed.len() - 40;
    changed[at] = if changed[at] == b'.' { b'@' } else { b'.' };
    yard.write("maps/random-32-32-20.map", changed);
    refused(
        "changed since the trials were made",
        "maps/random-32-32-20.map",
    );
    yard.write("maps/random-32-32-20.map", map);
    // A scenario that was not there.
    fs::copy(
        yard.path("scens/first.scen"),
        yard.path("world/second.scen"),
    )
    .unwrap();
    fs::copy(
        yard.path("maps/random-32-32-20.map"),
        yard.path("world/random-32-32-20.map"),
    )
    .unwrap();
    refused("asks for 18 trials, and the store has 14", "small.sqlite");
    fs::remove_file(yard.path("world/second.scen")).unwrap();
    // The robots.
    let robots = yard.read("robots.json");
    let slower = String::from_utf8(robots.clone())
        .unwrap()
        .replace("1.5", "1.25");
    yard.write("robots.json", slower);
    refused("changed since the trials were made", "robots.json");
    yard.write("robots.json", robots);
    // A part of the suite.
    yard.line("bench s.toml --shard 1/2 --store part.sqlite")
        .expect(SUCCESS);
    let part = yard
        .line("store bundle part.sqlite -o c.tar.gz")
        .expect(INPUT);
    assert!(part.stderr.contains("of 28 trials"), "{part}");
    assert!(part.stderr.contains("store merge"), "{part}");
    // Who has no suite is told how to say where it was.
    let moved = yard.line("store bundle small.sqlite --suite nowhere/s.toml -o c.tar.gz");
    assert!(moved.expect(INPUT).stderr.contains("nowhere/"));
}

#[test]
fn a_bundle_is_told_nothing_of_the_environment() {
    let yard = filled("[[planner]]\nplugin = \"pibt\"\n").set("LOOT", "secret");
    let text = String::from_utf8(yard.read("s.toml")).unwrap();
    yard.write("s.toml", text + "\n[sandbox.env]\nTAKEN = \"${LOOT}\"\n");
    yard.line("bench s.toml --set protocol.repeats=1")
        .expect(SUCCESS);
    yard.line("store bundle small.sqlite -o b.tar.gz")
        .expect(SUCCESS);
    let ended = yard.line("store repeat b.tar.gz").expect(INPUT);
    let reason = "the suite asks for your environment variable `LOOT`";
    assert!(ended.stderr.contains(reason), "{ended}");
    assert!(ended.stderr.contains("hint: unpack"), "{ended}");
}

#[test]
fn a_plugin_comes_along_only_when_it_is_wanted() {
    let yard = filled(
        "[[planner]]\nplugin = \"pibt\"\n\n[[planner]]\nlabel = \"mine\"\nplugin = \"own/mine.so\"\n",
    );
    let library = c_library("plugins/examples/c/prioritized.c", None);
    fs::create_dir(yard.path("own")).unwrap();
    fs::copy(&library, yard.path("own/mine.so")).unwrap();
    yard.line("bench s.toml --set protocol.repeats=1")
        .expect(SUCCESS);
    let digests = yard
        .line("store bundle small.sqlite -o without.tar.gz")
        .expect(SUCCESS);
    assert!(
        digests.stdout.contains("without   the files of mine"),
        "{digests}"
    );
    yard.line("store bundle small.sqlite -o with.tar.gz --plugins")
        .expect(SUCCESS);
    yard.write("own/mine.so", "something else");
    let changed = yard.line("store bundle small.sqlite -o c.tar.gz --plugins");
    assert!(changed.expect(INPUT).stderr.contains("own/mine.so"));
    fs::remove_dir_all(yard.path("own")).unwrap();

    let with = yard
        .line("store repeat with.tar.gz --format json")
        .expect(SUCCESS)
        .json();
    assert_eq!(with["planners"][1]["code"], "same", "{with:#}");
    assert_eq!(with["equal"], 14);
    // What is missing is named with its digest, and can be put there.
    let missing = yard
        .line("store repeat without.tar.gz --into here")
        .expect(INPUT);
    assert!(missing.stderr.contains("`mine`"), "{missing}");
    assert!(missing.stderr.contains("plugins/1/mine.so"), "{missing}");
    let sha256 = manifest(&yard.path("here"))["planners"][1]["code"][0]["sha256"].clone();
    assert!(
        missing.stderr.contains(sha256.as_str().unwrap()),
        "{missing}"
    );
    fs::create_dir_all(yard.path("here/plugins/1")).unwrap();
    fs::copy(&library, yard.path("here/plugins/1/mine.so")).unwrap();
    let now = yard
        .line("store repeat here --format json")
        .expect(SUCCESS)
        .json();
    assert_eq!(now["equal"], 14, "{now:#}");
    // Another planner in its place is one that is told apart, and plans differently.
    let text = String::from_utf8(fs::read(yard.path("here/suite.toml")).unwrap()).unwrap();
    let wrong = yard.line("store repeat here --into there").expect(USAGE);
    assert!(wrong.stderr.contains("--into"), "{wrong}");
    // A bundle cannot let its plugins out of their sandbox.
    fs::create_dir(yard.path("evil")).unwrap();
    for (wish, reason) in [
        ("[sandbox]\nlevel = \"none\"\n", "without a sandbox"),
        ("[sandbox]\nnetwork = true\n", "with the network"),
        ("[sandbox]\nread = \"/etc\"\n", "with files of this machine"),
    ] {
        repacked(&yard, "here", &format!("{text}\n{wish}"));
        let refused = yard.line("store repeat here").expect(INPUT);
        assert!(refused.stderr.contains(reason), "{wish}: {refused}");
    }
    for (from, to, reason) in [
        ("plugins/1/mine.so", "/bin/sh", "the plugin /bin/sh"),
        ("inputs/first.scen", "../first.scen", "not in the bundle"),
        ("inputs/first.scen", "/etc/passwd", "not in the bundle"),
        (
            "label = \"mine\"",
            "label = \"mine\"\nattach = \"in-process\"",
            "in the host's own process",
        ),
    ] {
        assert!(text.contains(from), "{text}");
        repacked(&yard, "here", &text.replace(from, to));
        let refused = yard.line("store repeat here").expect(INPUT);
        assert!(refused.stderr.contains(reason), "{to}: {refused}");
    }
    repacked(&yard, "here", &text);
    yard.line("store repeat here --sample 1").expect(SUCCESS);
    // Nor are files taken that are not as they were unpacked.
    yard.write("here/inputs/first.scen", "version 1\n");
    let refused = yard.line("store repeat here").expect(INPUT);
    assert!(refused.stderr.contains("its SHA-256 differs"), "{refused}");
}

/// Writes another suite into a folder, and its digest into the manifest.
fn repacked(yard: &Yard, folder: &str, suite: &str) {
    use sha2::{Digest as _, Sha256};
    use std::fmt::Write as _;
    let mut sha256 = String::new();
    for byte in Sha256::digest(suite.as_bytes()) {
        write!(sha256, "{byte:02x}").unwrap();
    }
    let mut said = manifest(&yard.path(folder));
    let files = said["files"].as_array_mut().unwrap();
    let file = files
        .iter_mut()
        .find(|file| file["path"] == "suite.toml")
        .unwrap();
    file["bytes"] = suite.len().into();
    file["sha256"] = sha256.into();
    yard.write(&format!("{folder}/manifest.json"), said.to_string());
    yard.write(&format!("{folder}/suite.toml"), suite);
}

#[test]
fn a_planner_that_is_another_one_is_said_to_be() {
    let yard = filled("[[planner]]\nlabel = \"mine\"\nplugin = \"own/mine.so\"\n");
    fs::create_dir(yard.path("own")).unwrap();
    let first = c_library("plugins/examples/c/prioritized.c", None);
    fs::copy(&first, yard.path("own/mine.so")).unwrap();
    yard.line("bench s.toml --set protocol.repeats=1")
        .expect(SUCCESS);
    yard.line("store bundle small.sqlite -o b.tar.gz")
        .expect(SUCCESS);
    yard.line("store repeat b.tar.gz --into here").expect(INPUT);
    fs::create_dir_all(yard.path("here/plugins/1")).unwrap();
    let second = c_library("plugins/faulty/faulty.c", None);
    fs::copy(&second, yard.path("here/plugins/1/mine.so")).unwrap();
    // It is called otherwise, so that it is not what the suite asks for.
    let other = yard.line("store repeat here");
    assert_ne!(other.code, Some(SUCCESS), "{other}");
    let mut suite = String::from_utf8(yard.read("here/suite.toml")).unwrap();
    let at = suite.find("mine.so:").unwrap() + "mine.so".len();
    let end = at + suite[at..].find('"').unwrap();
    suite.replace_range(at..end, ":faulty");
    repacked(&yard, "here", &suite);
    let other = yard.line("store repeat here --format json");
    let said = other.json();
    assert_eq!(said["planners"][0]["code"], "other", "{other}");
    assert!(matches!(other.code, Some(SUCCESS | NO_PLAN)), "{other}");
}

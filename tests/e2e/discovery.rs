//! Discovery of plugins: the places, the precedence of one of several, and the code that may run.

use std::fs::{self, Permissions};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use fleetyard_testkit::{
    Ended, INPUT, PLUGIN, SUCCESS, USAGE, Yard, faulty_library, have, instance, root, words,
};
use serde_json::Value;

/// A command adapter; its solver is asked for nothing here.
const MANIFEST: &str = r#"manifest = 1
id = "described"
version = "3"

[program]
command = "./solver"
args = ["{map}", "{scen}", "{output}"]

[output]
format = "lacam"
"#;

const SOLVER: &str = "#!/bin/sh\nexit 1\n";

fn program(path: &Path, content: impl AsRef<[u8]>) {
    fs::write(path, content).unwrap();
    fs::set_permissions(path, Permissions::from_mode(0o755)).unwrap();
}

/// A folder with a plugin of every attachment.
fn fill(folder: &Path) {
    fs::create_dir(folder).unwrap();
    fs::copy(faulty_library(), folder.join("faulty.so")).unwrap();
    let example = root().join("plugins/examples/python/raw_protocol.py");
    program(&folder.join("raw.py"), fs::read(example).unwrap());
    fs::create_dir(folder.join("described")).unwrap();
    fs::write(folder.join("described/planner.toml"), MANIFEST).unwrap();
    program(&folder.join("described/solver"), SOLVER);
}

fn yard_with(folders: &[&str]) -> Yard {
    let yard = Yard::new();
    let paths: Vec<String> = folders
        .iter()
        .map(|name| yard.path(name).display().to_string())
        .collect();
    yard.set("FLEETYARD_PLUGIN_PATH", &paths.join(":"))
}

/// The plugins that are listed under an identifier, in order.
fn listed<'a>(files: &'a Value, id: &str) -> Vec<(&'a Value, &'a Value)> {
    let files = files.as_array().unwrap().iter();
    let plugins = files.flat_map(|file| {
        let plugins = file["plugins"].as_array().unwrap().iter();
        plugins.map(move |plugin| (file, plugin))
    });
    plugins.filter(|(_, plugin)| plugin["id"] == id).collect()
}

fn sha256(path: &Path) -> String {
    let output = std::process::Command::new("sha256sum").arg(path).output();
    let text = String::from_utf8(output.unwrap().stdout).unwrap();
    text.split_whitespace().next().unwrap().to_owned()
}

#[track_caller]
fn says(ended: &Ended, texts: &[&str]) {
    for text in texts {
        assert!(ended.stderr.contains(text), "no `{text}`: {ended}");
    }
}

#[test]
fn every_plugin_says_where_it_is_from_and_what_it_was_built_for() {
    if !have("python3") {
        return;
    }
    let yard = yard_with(&["plugins"]);
    let folder = yard.path("plugins");
    fill(&folder);
    // What is there for people is no plugin, executable or not.
    fs::write(folder.join("README.md"), "# Plugins\n").unwrap();
    program(
        &folder.join("NOTES.txt"),
        "Everything here is executable.\n",
    );
    program(&folder.join(".raw.py.swp"), SOLVER);
    let files = yard
        .line("plugins list --format json")
        .expect(SUCCESS)
        .json();
    let places: Vec<&str> = files
        .as_array()
        .unwrap()
        .iter()
        .map(|file| file["path"].as_str().unwrap_or("built-in"))
        .map(|path| path.strip_prefix(folder.to_str().unwrap()).unwrap_or(path))
        .collect();
    assert_eq!(
        places,
        [
            "/described/planner.toml",
            "/faulty.so",
            "/raw.py",
            "built-in"
        ]
    );
    for (id, attach, contract, code) in [
        ("faulty", "worker", "c-abi 1.0", &["faulty.so"][..]),
        ("raw-protocol", "stdio", "protocol 1", &["raw.py"]),
        (
            "described",
            "command",
            "manifest 1",
            &["described/planner.toml", "described/solver"],
        ),
        ("lacam", "worker", "c-abi 1.0", &[]),
    ] {
        let (file, plugin) = listed(&files, id)[0];
        assert_eq!(file["attach"], attach);
        let found = &file["contract"];
        let version = found["version"].to_string();
        let found = format!(
            "{} {}",
            found["kind"].as_str().unwrap(),
            version.replace('"', "")
        );
        assert_eq!(found, contract, "{id}");
        assert_eq!(plugin["shadowed_by"], Value::Null);
        let digests: Vec<String> = code.iter().map(|name| sha256(&folder.join(name))).collect();
        let found = file["code"].as_array().unwrap().iter();
        let found: Vec<&str> = found.map(|code| code["sha256"].as_str().unwrap()).collect();
        // Where Python is installed, and its modules, come after them.
        assert_eq!(found[..digests.len()], digests, "{id}");
        assert!(found.len() == digests.len() || attach == "stdio", "{id}");
        assert_eq!(file["digest"].as_str().map(str::len), Some(32));
    }
    let ended = yard.line("plugins list").expect(SUCCESS);
    assert!(ended.stderr.is_empty(), "{ended}");
    let info = yard.line("plugins info described").expect(SUCCESS).stdout;
    let told = format!("code: {}", sha256(&folder.join("described/solver")));
    assert!(
        info.contains("manifest 1") && info.contains(&told),
        "{info}"
    );
}

#[test]
fn a_folder_stands_for_the_plugin_in_it() {
    let yard = Yard::new();
    let run = |planner: &str| {
        let mut line = words("run --budget 60s --planner");
        line.push(planner.to_owned());
        line.extend(instance("empty-8-8", 1));
        yard.run(&line)
    };
    fs::create_dir(yard.path("mine")).unwrap();
    says(
        &run("./mine").expect(PLUGIN),
        &["mine has no plugin", "build it first"],
    );
    fs::copy(faulty_library(), yard.path("mine/faulty.so")).unwrap();
    // What is no program is there for people.
    yard.write("mine/notes.txt", "how to build it\n");
    yard.write("mine/tests.py", "# not started\n");
    let listed = yard.line("plugins info ./mine").expect(SUCCESS);
    assert!(listed.stdout.contains("faulty"), "{listed}");
    let here = yard
        .shell("cd mine && fleetyard plugins info .")
        .expect(SUCCESS);
    assert!(here.stdout.contains("faulty"), "{here}");
    fs::copy(faulty_library(), yard.path("mine/other.so")).unwrap();
    says(
        &run("./mine").expect(PLUGIN),
        &[
            "mine has several plugins",
            "faulty.so",
            "other.so",
            "name the file of one",
        ],
    );
}

#[test]
fn the_first_of_several_with_a_name_is_used() {
    let yard = yard_with(&["second", "missing", "first", "second"]);
    for name in ["first", "second"] {
        fs::create_dir(yard.path(name)).unwrap();
        fs::copy(faulty_library(), yard.path(name).join("faulty.so")).unwrap();
    }
    let used = yard.path("second/faulty.so").display().to_string();
    let other = yard.path("first/faulty.so").display().to_string();
    let ended = yard.line("plugins list --format json").expect(SUCCESS);
    says(
        &ended,
        &[
            "warning: ",
            "/missing of FLEETYARD_PLUGIN_PATH",
            "No such file",
        ],
    );
    let files = ended.json();
    let found = listed(&files, "faulty");
    assert_eq!(found.len(), 2, "a folder that is named twice counts once");
    assert_eq!(
        (&found[0].0["path"], &found[0].1["shadowed_by"]),
        (&Value::from(used.clone()), &Value::Null)
    );
    assert_eq!(
        (&found[1].0["path"], &found[1].1["shadowed_by"]),
        (&Value::from(other.clone()), &Value::from(used.clone()))
    );
    let text = yard.line("plugins list").expect(SUCCESS).stdout;
    assert!(text.contains(&format!("shadowed by {used}")), "{text}");
    let mut line = words("run --planner faulty --budget 60s --format json");
    line.extend(instance("empty-8-8", 2));
    let ended = yard.run(&line).expect(SUCCESS);
    says(
        &ended,
        &[&format!("note: `faulty` is {used}, which shadows {other}")],
    );
    assert_eq!(ended.json()["planner"]["path"], Value::from(used));
}

/// Changes to the plugins of [`fill`]: a file, the plugin's name, and content that no plugin has,
/// which would be noticed otherwise if it were started.
const PARTS: [(&str, &str); 4] = [
    ("faulty.so", "faulty"),
    ("raw.py", "raw-protocol"),
    ("described/planner.toml", "described"),
    ("described/solver", "described"),
];

#[test]
fn changed_code_is_refused_until_it_is_accepted() {
    if !have("python3") {
        return;
    }
    let yard = yard_with(&["plugins"]);
    let folder = yard.path("plugins");
    fill(&folder);
    let ended = yard
        .line("plugins pin faulty ./plugins/raw.py described")
        .expect(SUCCESS);
    assert!(
        ended
            .stdout
            .contains(&sha256(&folder.join("described/solver"))),
        "{ended}"
    );
    yard.line("plugins pin --check").expect(SUCCESS);
    for (part, id) in PARTS {
        let path: PathBuf = folder.join(part);
        let original = fs::read(&path).unwrap();
        let pinned = sha256(&path);
        let mut changed = original.clone();
        changed.extend_from_slice(b"\n# changed\n");
        program(&path, &changed);
        let found = sha256(&path);
        let hint = format!("hint: if you trust the change: `fleetyard plugins pin --update {id}`");
        let texts = ["is not what fleetyard.lock pins", &found, &pinned, &hint];
        let named = match part.split_once('/') {
            Some((folder, _)) => format!("./plugins/{folder}"),
            None => format!("./plugins/{part}"),
        };
        let run = "run --map {maps}/empty-8-8.map --scen {maps}/empty-8-8-random-1.scen --agents 1";
        for line in [
            format!("{run} --planner {id}"),
            format!("{run} --planner {named}"),
            format!("plugins info {id}"),
            format!("plugins info {named}"),
            format!("plugins check {named}"),
            "plugins pin --check".to_owned(),
            // Without --update it is not accepted by mistake.
            format!("plugins pin {id}"),
        ] {
            let ended = yard.line(&line).expect(PLUGIN);
            let told = format!("{}{}", ended.stdout, ended.stderr);
            for text in texts {
                let text = text.strip_prefix("hint: ").unwrap_or(text);
                assert!(told.contains(text), "{line}: no `{text}`: {ended}");
            }
        }
        let list = yard.line("plugins list").expect(SUCCESS);
        says(&list, &texts);
        // Others run meanwhile, and it does once it is accepted.
        let other = if id == "faulty" {
            "raw-protocol"
        } else {
            "faulty"
        };
        yard.line(&format!("plugins info {other}")).expect(SUCCESS);
        let ended = yard
            .line(&format!("plugins pin --update {id}"))
            .expect(SUCCESS);
        assert!(
            ended.stdout.contains("updated") && ended.stdout.contains(&found),
            "{ended}"
        );
        yard.line(&format!("plugins info {id}")).expect(SUCCESS);
        // Back again is a change as well.
        program(&path, &original);
        yard.line(&format!("plugins info {id}")).expect(PLUGIN);
        yard.line(&format!("plugins pin --update {named}"))
            .expect(SUCCESS);
    }
}

#[test]
fn nothing_of_changed_code_is_started() {
    if !have("python3") {
        return;
    }
    let yard = yard_with(&["plugins"]);
    let folder = yard.path("plugins");
    fill(&folder);
    yard.line("plugins pin faulty raw-protocol described")
        .expect(SUCCESS);
    // Started, it would be a crash, and the solver a version.
    program(&folder.join("raw.py"), "#!/bin/sh\nkill -SEGV $$\n");
    fs::write(folder.join("faulty.so"), "no library").unwrap();
    let files = yard
        .line("plugins list --format json")
        .expect(SUCCESS)
        .json();
    for file in files.as_array().unwrap() {
        let path = file["path"].as_str().unwrap_or_default();
        let reason = file["refused"].as_str();
        if path.ends_with("raw.py") || path.ends_with("faulty.so") {
            let reason = reason.unwrap_or_default();
            assert!(
                reason.contains("is not what fleetyard.lock pins"),
                "{reason}"
            );
        } else {
            assert_eq!(reason, None, "{file}");
        }
    }
    fs::remove_file(folder.join("described/solver")).unwrap();
    let ended = yard
        .line("plugins pin --check --format json")
        .expect(PLUGIN);
    let states: Vec<Value> = ended
        .json()
        .as_array()
        .unwrap()
        .iter()
        .map(|line| line["state"].clone())
        .collect();
    assert_eq!(states, ["changed", "changed", "changed"]);
    says(&ended, &["does not exist"]);
    yard.line("plugins pin --remove ./plugins/described raw-protocol")
        .expect(SUCCESS);
    let ended = yard
        .line("plugins pin --list --format json")
        .expect(SUCCESS);
    assert_eq!(ended.json()[0]["path"], "plugins/faulty.so");
    assert_eq!(ended.json().as_array().map(Vec::len), Some(1));
}

#[test]
fn what_is_not_in_the_lock_is_noted_or_refused() {
    let yard = yard_with(&["plugins"]);
    let folder = yard.path("plugins");
    fs::create_dir(&folder).unwrap();
    fs::copy(faulty_library(), folder.join("faulty.so")).unwrap();
    let run = "run --map {maps}/empty-8-8.map --scen {maps}/empty-8-8-random-1.scen --agents 2 \
               --budget 60s --format json --planner";
    // Without a lock nothing is said, and nothing is trusted by --locked but the host.
    let ended = yard.line(&format!("{run} faulty")).expect(SUCCESS);
    assert!(!ended.stderr.contains("lock"), "{ended}");
    assert_eq!(ended.json()["planner"]["pinned"], false);
    let ended = yard
        .line(&format!("{run} ./plugins/faulty.so --locked"))
        .expect(PLUGIN);
    says(&ended, &["is not pinned", "fleetyard plugins pin"]);
    yard.line(&format!("{run} pibt --locked")).expect(SUCCESS);

    let other = "plugins pin --lock other.lock ./plugins/faulty.so";
    yard.line(other).expect(SUCCESS);
    assert!(!yard.files().contains("fleetyard.lock"));
    let ended = yard
        .line(&format!("{run} faulty --lock other.lock --locked"))
        .expect(SUCCESS);
    let record = ended.json();
    assert_eq!(record["planner"]["pinned"], true);
    let code = &record["planner"]["code"][0]["sha256"];
    assert_eq!(*code, Value::from(sha256(&folder.join("faulty.so"))));

    // Another file of the same name is another plugin.
    fs::copy(faulty_library(), folder.join("another.so")).unwrap();
    let ended = yard
        .line(&format!("{run} ./plugins/another.so --lock other.lock"))
        .expect(SUCCESS);
    says(&ended, &["note: ", "another.so is not in other.lock"]);
    let ended = yard
        .line(&format!(
            "{run} ./plugins/another.so --lock other.lock --locked"
        ))
        .expect(PLUGIN);
    says(
        &ended,
        &["another.so is not in other.lock", "hint: if you trust it"],
    );
    // It comes first, but the name is pinned to the other.
    let ended = yard
        .line(&format!("{run} faulty --lock other.lock"))
        .expect(PLUGIN);
    says(
        &ended,
        &["`faulty` is pinned to", "but would be", "another.so"],
    );
    // Those that are locked out are not even described.
    let ended = yard
        .line(&format!("{run} faulty --lock other.lock --locked"))
        .expect(SUCCESS);
    assert_eq!(ended.json()["planner"]["pinned"], true);

    // By the environment, and out again.
    let yard = yard.set("FLEETYARD_LOCK", "other.lock");
    let ended = yard.line("plugins pin --list").expect(SUCCESS);
    assert!(ended.stdout.contains("planner faulty"), "{ended}");
    yard.line("plugins pin --remove nobody").expect(USAGE);
    yard.line("plugins pin --remove faulty").expect(SUCCESS);
    let ended = yard
        .line("plugins pin --list --format json")
        .expect(SUCCESS);
    assert_eq!(ended.json().as_array().map(Vec::len), Some(0));
}

#[test]
fn a_lock_that_cannot_be_read_stops_everything() {
    let yard = Yard::new();
    let run = "run --map {maps}/empty-8-8.map --scen {maps}/empty-8-8-random-1.scen --agents 2 \
               --budget 60s --planner pibt";
    for (text, told) in [
        ("", "fleetyard.lock:1:"),
        (
            "{\"lock\": 1,\n \"pined\": []}",
            "fleetyard.lock:2:8: unknown field `pined`",
        ),
        (
            "{\"lock\": 2, \"pinned\": []}",
            "version 2 of lock files is not known",
        ),
        (
            "{\"lock\": 1, \"pinned\": [{\"path\": \"a.so\", \"plugins\": [], \"code\": []}]}",
            "a.so is pinned without any code",
        ),
    ] {
        yard.write("fleetyard.lock", text);
        let ended = yard.line(run).expect(INPUT);
        says(&ended, &[told]);
        yard.line("plugins list").expect(INPUT);
    }
    let ended = yard
        .line(&format!("{run} --lock missing.lock"))
        .expect(INPUT);
    says(&ended, &["missing.lock: no such file"]);
    yard.write("fleetyard.lock", "{\"lock\": 1, \"pinned\": []}");
    yard.line(run).expect(SUCCESS);
    let ended = yard.line("plugins pin lacam").expect(USAGE);
    says(&ended, &["`lacam` is built in"]);
}

#[test]
fn a_changed_module_is_changed_code() {
    if !have("python3") {
        return;
    }
    let yard = Yard::new();
    let example = root().join("plugins/examples/python/raw_protocol.py");
    let example = fs::read_to_string(example).unwrap();
    fs::create_dir_all(yard.path("mine/parts")).unwrap();
    fs::create_dir_all(yard.path("mine/.git")).unwrap();
    let (first, rest) = example.split_once('\n').unwrap();
    program(
        &yard.path("mine/planner.py"),
        format!("{first}\nimport parts.helper\n{rest}"),
    );
    yard.write("mine/parts/helper.py", "answer = 42\n");
    yard.write("mine/.git/HEAD", "one");
    let ended = yard.line("plugins pin ./mine/planner.py").expect(SUCCESS);
    assert!(ended.stdout.contains("2 files"), "{ended}");
    let run = "run --map {maps}/empty-8-8.map --scen {maps}/empty-8-8-random-1.scen --agents 1 \
               --locked --planner ./mine/planner.py --budget 60s";
    yard.line(run).expect(SUCCESS);
    // What is not granted is no part of it.
    yard.write("mine/.git/HEAD", "another");
    yard.line(run).expect(SUCCESS);
    let helper = yard.write("mine/parts/helper.py", "answer = 43\n");
    for line in [run, "plugins pin --check", "plugins pin ./mine/planner.py"] {
        let ended = yard.line(line).expect(PLUGIN);
        says(
            &ended,
            &["parts/helper.py has SHA-256", &sha256(&helper), "--update"],
        );
    }
    yard.write("mine/parts/helper.py", "answer = 42\n");
    yard.line(run).expect(SUCCESS);
    let more = yard.write("mine/json.py", "");
    let ended = yard.line(run).expect(PLUGIN);
    says(
        &ended,
        &["now has", "mine/json.py, which fleetyard.lock does not pin"],
    );
    fs::remove_file(more).unwrap();
    fs::remove_file(helper).unwrap();
    let ended = yard.line(run).expect(PLUGIN);
    says(&ended, &["no longer has", "parts/helper.py"]);
}

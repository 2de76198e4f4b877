//! `fleetyard plugins new`: for every language and kind, what is written builds without
//! warnings, passes its own test and the conformance kit, and is found; planners solve an
//! instance. The commands are those that the command itself prints.

use std::collections::BTreeSet;
use std::fs;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::Path;
use std::process::Command;

use fleetyard_testkit::{
    Ended, INPUT, Package, SUCCESS, USAGE, Yard, have, packages, prepare_package, root,
    turn_of_packages,
};

const KINDS: [&str; 4] = [
    "planner",
    "fail-policy",
    "instance-generator",
    "invocation-policy",
];

/// Enough of the kit to see that a plugin does what its kind does.
const ONLY: &str = "--only handshake --only descriptor --only crossing --only failed-plan \
    --only fleet-states --only fleet-statuses --only deterministic";

/// Makes a new plugin and runs the commands that come next, `prepare` before them.
fn works(lang: &str, kind: &str, prepare: impl Fn(&Path)) {
    let yard = Yard::new()
        .with_cargo()
        .set("CFLAGS", "-Werror")
        .set("CXXFLAGS", "-Werror");
    let name = format!("my-{kind}");
    let written = yard.line(&format!("plugins new --lang {lang} --kind {kind} {name}"));
    let written = written.expect(SUCCESS);
    assert_eq!(written.stderr, "");
    let folder = yard.path(&name);
    prepare(&folder);
    let (_, next) = written.stdout.split_once("next:\n").unwrap();
    let mut asked = BTreeSet::new();
    for line in next.lines().map(str::trim) {
        let check = line.starts_with("fleetyard plugins check");
        let ended = yard.shell(&if check {
            format!("{line} {ONLY}")
        } else {
            line.to_owned()
        });
        let ended = ended.expect(SUCCESS);
        assert!(!ended.stderr.contains("warning"), "{line}: {ended}");
        if check {
            asked.insert("check");
            assert!(ended.stdout.contains(" 0 failed, 0 crashed"), "{ended}");
        } else if line.contains("plugins list") {
            asked.insert("list");
            let row = |row: &str| row.starts_with(&name) && row.contains(kind);
            assert!(ended.stdout.lines().any(row), "{ended}");
            assert!(!ended.stdout.contains("refused"), "{ended}");
        } else if line.starts_with("fleetyard run") {
            asked.insert("run");
            assert!(ended.stdout.contains("verdict           valid"), "{ended}");
        } else if line.contains("test") || line.contains("check") {
            asked.insert("test");
        }
    }
    let mut wanted = BTreeSet::from(["test", "check", "list"]);
    wanted.extend((kind == "planner").then_some("run"));
    assert_eq!(asked, wanted, "{next}");
}

/// True if all programs are there; notes the first that is not.
fn have_all(programs: &[&str]) -> bool {
    programs.iter().all(|program| have(program))
}

#[test]
fn rust() {
    let _turn = turn_of_packages();
    for kind in KINDS {
        works("rust", kind, is_formatted);
    }
    rust_planners_for_roadmaps_and_the_plane();
}

/// Gets the dependencies of a package in Rust, whose files are formatted.
fn is_formatted(folder: &Path) {
    prepare_package(folder);
    let formatted = Command::new("rustfmt")
        .args(["--check", "--edition", "2024"])
        .args([folder.join("src/lib.rs"), folder.join("tests/plugin.rs")])
        .output();
    if let Ok(output) = formatted {
        assert!(output.status.success(), "{output:?}");
    }
}

/// The same for the other maps, one after the other: builds share a folder.
fn rust_planners_for_roadmaps_and_the_plane() {
    let yard = Yard::new().with_cargo();
    for on in ["roadmap", "continuous"] {
        let name = format!("my-{on}");
        yard.line(&format!(
            "plugins new {name} --lang rust --representation {on}"
        ))
        .expect(SUCCESS);
        is_formatted(&yard.path(&name));
        let cargo = format!("--release --manifest-path {name}/Cargo.toml");
        let ran = yard.shell(&format!("cargo test {cargo} && cargo build {cargo}"));
        let ran = ran.expect(SUCCESS);
        assert!(!ran.stderr.contains("warning"), "{ran}");
        let library = format!("{name}/target/release/libmy_{on}.so");
        let checked = yard.line(&format!("plugins check {library} {ONLY}"));
        let checked = checked.expect(SUCCESS).stdout;
        assert!(checked.contains(" 0 failed, 0 crashed"), "{checked}");
    }
}

#[test]
fn c() {
    if have_all(&["make", "cc"]) {
        for kind in KINDS {
            works("c", kind, |_| ());
        }
    }
}

#[test]
fn cpp() {
    if have_all(&["make", "c++"]) {
        for kind in KINDS {
            works("cpp", kind, |_| ());
        }
    }
}

#[test]
fn python() {
    if have_all(&["python3"]) {
        for kind in KINDS {
            works("python", kind, |_| ());
        }
    }
}

/// The class was called after the template, whatever the plugin was called.
#[test]
fn a_python_plugin_and_its_test_go_by_the_plugins_name() {
    if !have_all(&["python3"]) {
        return;
    }
    let yard = Yard::new();
    for kind in KINDS {
        let name = format!("my-own_{kind}");
        yard.line(&format!("plugins new {name} --lang python --kind {kind}"))
            .expect(SUCCESS);
        let words = name.split(['-', '_']);
        let class: String = words
            .map(|word| word[..1].to_uppercase() + &word[1..])
            .collect();
        let read = |file: &str| fs::read_to_string(yard.path(&name).join(file)).unwrap();
        let module = name.replace('-', "_");
        let plugin = read(&format!("{module}.py"));
        assert!(
            plugin.contains(&format!("class {class}(fleetyard.")),
            "{plugin}"
        );
        let test = read("tests/test_plugin.py");
        assert!(test.contains(&format!("{module}.{class}(")), "{test}");
        let ran = yard.shell(&format!("python3 -m unittest discover {name}/tests"));
        let ran = ran.expect(SUCCESS);
        assert!(ran.stderr.contains("\nOK"), "{ran}");
        assert!(!ran.stderr.contains("Ran 0 tests"), "{ran}");
    }
}

#[test]
fn python_planners_for_roadmaps_and_the_plane() {
    if !have_all(&["python3"]) {
        return;
    }
    let yard = Yard::new();
    for on in ["roadmap", "continuous"] {
        let line = format!("plugins new my-{on} --lang python --representation {on}");
        let written = yard.line(&line).expect(SUCCESS);
        assert!(!written.stdout.contains("fleetyard run"), "{written}");
        let ran = yard.shell(&format!("python3 -m unittest discover my-{on}/tests"));
        let ran = ran.expect(SUCCESS);
        assert!(!ran.stderr.contains("Ran 0 tests"), "{ran}");
        let info = yard.line(&format!("plugins info my-{on}/my_{on}.py"));
        assert!(info.expect(SUCCESS).stdout.contains(on));
    }
}

#[test]
fn c_and_cpp_planners_for_roadmaps_and_the_plane() {
    if !have_all(&["make", "cc", "c++"]) {
        return;
    }
    let yard = Yard::new()
        .set("CFLAGS", "-Werror")
        .set("CXXFLAGS", "-Werror");
    for (lang, on) in [
        ("c", "roadmap"),
        ("c", "continuous"),
        ("cpp", "roadmap"),
        ("cpp", "continuous"),
    ] {
        let name = format!("my-{lang}-{on}");
        let line = format!("plugins new {name} --lang {lang} --representation {on}");
        let written = yard.line(&line).expect(SUCCESS);
        assert!(!written.stdout.contains("fleetyard run"), "{written}");
        let ran = yard.shell(&format!("make -s -C {name} check && make -s -C {name}"));
        let ran = ran.expect(SUCCESS);
        assert!(ran.stdout.ends_with("passed\n"), "{ran}");
        let library = name.replace('-', "_");
        let info = yard.line(&format!("plugins info {name}/{library}.so"));
        assert!(info.expect(SUCCESS).stdout.contains(on));
    }
}

#[test]
fn command() {
    if have_all(&["python3"]) {
        works("command", "planner", |_| ());
    }
}

#[test]
fn a_planner_can_be_written_elsewhere_and_under_an_odd_name() {
    let yard = Yard::new();
    fs::create_dir(yard.path("with a blank")).unwrap();
    let arguments = ["plugins", "new", "--lang", "c", "Odd_Name-2", "--out"];
    let out = yard.path("with a blank").display().to_string();
    let ended = yard.run(&[&arguments[..], &[&out]].concat());
    let ended = ended.expect(SUCCESS);
    let make = format!("make -C '{out}/Odd_Name-2'");
    assert!(ended.stdout.contains(&make), "{ended}");
    let plugin = yard.path("with a blank").join("Odd_Name-2/odd_name_2.c");
    let text = fs::read_to_string(plugin).unwrap();
    assert!(text.contains(r#"TEXT("odd_name-2")"#), "{text}");
    assert!(!text.contains("example"), "{text}");
}

#[test]
fn who_may_read_a_script_may_start_it() {
    let yard = Yard::new();
    yard.shell("umask 027; fleetyard plugins new --lang python mine")
        .expect(SUCCESS);
    let mode = |name: &str| fs::metadata(yard.path(name)).unwrap().permissions().mode() & 0o777;
    assert_eq!(mode("mine"), 0o750);
    assert_eq!(mode("mine/mine.py"), 0o750);
    assert_eq!(mode("mine/tests/test_plugin.py"), 0o640);
}

#[test]
fn bad_requests_are_refused_and_leave_nothing() {
    let yard = Yard::new();
    yard.write("taken", "something");
    fs::create_dir(yard.path("folder")).unwrap();
    symlink("nowhere", yard.path("dangling")).unwrap();
    let before = yard.files();
    let refused = |arguments: &str, code: i32, texts: [&str; 2]| {
        let ended: Ended = yard.line(&format!("plugins new {arguments}")).expect(code);
        for text in texts {
            assert!(ended.stderr.contains(text), "{arguments}: {ended}");
        }
        assert_eq!(ended.stdout, "");
        assert_eq!(yard.files(), before, "{arguments}");
    };
    let there = "is there already";
    refused("--lang c taken", INPUT, [there, "another name"]);
    refused("--lang c folder", INPUT, [there, "--out"]);
    refused("--lang c dangling", INPUT, [there, "--out"]);
    refused(
        "--lang c x --out no/such",
        INPUT,
        ["no/such: no such folder", "mkdir -p no/such"],
    );
    refused(
        "--lang c x --out taken",
        INPUT,
        ["taken: no such folder", "mkdir"],
    );
    refused(
        "--lang c 2nd+try",
        USAGE,
        ["begins with a letter", "`nd-try` can"],
    );
    refused(
        "--lang c -- ..",
        USAGE,
        ["begins with a letter", "`my-planner` can"],
    );
    refused(
        "--lang c ä",
        USAGE,
        ["begins with a letter", "`my-planner` can"],
    );
    refused("--lang c a/b", USAGE, ["is a path", "--out FOLDER"]);
    let long = "x".repeat(65);
    refused(
        &format!("--lang c {long}"),
        USAGE,
        ["at most 64 characters", "hint:"],
    );
    refused(
        "--lang rust Match",
        USAGE,
        ["`Match` is a keyword or crate of Rust", "`my-match`"],
    );
    refused(
        "--lang python queue",
        USAGE,
        ["`queue` is a keyword or module of Python", "`my-queue`"],
    );
    refused(
        "--lang command --kind fail-policy x",
        USAGE,
        ["can be a planner, but no fail-policy", "--lang python"],
    );
    refused(
        "--lang command --representation roadmap x",
        USAGE,
        ["that no manifest describes", "--lang rust"],
    );
    refused("--lang cobol x", USAGE, ["cobol", "python"]);
    refused("--lang c --kind robot x", USAGE, ["robot", "fail-policy"]);
    refused("x", USAGE, ["--lang", "Usage"]);
}

/// Fully qualified dependencies of a package, tests aside.
fn needs(manifest: &Path) -> BTreeSet<String> {
    let packages = packages(manifest);
    let wanted = |package: &&Package| package.name == "fleetyard-abi";
    let package = packages.iter().find(wanted).unwrap();
    let dependencies = package.dependencies.iter();
    let mut needs: BTreeSet<String> = dependencies
        .filter(|needed| !needed.is_for_tests())
        .map(|needed| {
            let (req, features) = (&needed.req, &needed.features);
            let (defaults, optional) = (needed.uses_default_features, needed.optional);
            format!("{} {req} {features:?} {defaults} {optional}", needed.name)
        })
        .collect();
    needs.insert(format!("{} {}", package.version, package.edition));
    needs.insert(format!("{:?}", package.features));
    needs
}

#[test]
fn the_rust_sdk_of_a_new_plugin_has_the_dependencies_of_the_contract() {
    let yard = Yard::new();
    yard.line("plugins new --lang rust mine").expect(SUCCESS);
    let ours = needs(&root().join("abi/Cargo.toml"));
    assert_eq!(needs(&yard.path("mine/sdk/Cargo.toml")), ours);
}

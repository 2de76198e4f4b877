//! The rules of ARCHITECTURE.md that no compiler holds: which crate may use which,
//! where heavy dependencies live, where `unsafe` may stand, and what may not be read
//! where results have to be reproducible.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use fleetyard_testkit::{Package, Target, packages, root};

/// The crates that a crate of the host may use of the others, whatever for (tests aside). A new
/// crate has to be entered here.
const MAY_USE: &[(&str, &[&str])] = &[
    ("fleetyard-testkit", &["fleetyard-abi"]),
    ("fleetyard-abi", &[]),
    ("fleetyard-core", &["fleetyard-abi"]),
    ("fleetyard-world", &["fleetyard-core"]),
    ("fleetyard-check", &["fleetyard-core", "fleetyard-world"]),
    ("fleetyard-sim", &["fleetyard-core", "fleetyard-world"]),
    (
        "fleetyard-view",
        &["fleetyard-core", "fleetyard-sim", "fleetyard-world"],
    ),
    (
        "fleetyard-views",
        &[
            "fleetyard-abi",
            "fleetyard-check",
            "fleetyard-core",
            "fleetyard-sim",
            "fleetyard-world",
        ],
    ),
    ("fleetyard-runtime", &["fleetyard-abi", "fleetyard-core"]),
    (
        "fleetyard-conformance",
        &[
            "fleetyard-abi",
            "fleetyard-check",
            "fleetyard-core",
            "fleetyard-runtime",
            "fleetyard-world",
        ],
    ),
    (
        "fleetyard-fleet",
        &[
            "fleetyard-abi",
            "fleetyard-check",
            "fleetyard-core",
            "fleetyard-runtime",
            "fleetyard-sim",
            "fleetyard-views",
            "fleetyard-world",
        ],
    ),
    (
        "fleetyard-bench",
        &[
            "fleetyard-abi",
            "fleetyard-check",
            "fleetyard-core",
            "fleetyard-fleet",
            "fleetyard-runtime",
            "fleetyard-sim",
            "fleetyard-view",
            "fleetyard-views",
            "fleetyard-world",
        ],
    ),
    (
        "fleetyard-studio",
        &[
            "fleetyard-abi",
            "fleetyard-bench",
            "fleetyard-check",
            "fleetyard-core",
            "fleetyard-runtime",
            "fleetyard-sim",
            "fleetyard-view",
            "fleetyard-views",
            "fleetyard-world",
        ],
    ),
    (
        "fleetyard",
        &[
            "fleetyard-abi",
            "fleetyard-bench",
            "fleetyard-check",
            "fleetyard-conformance",
            "fleetyard-core",
            "fleetyard-fleet",
            "fleetyard-plugins",
            "fleetyard-runtime",
            "fleetyard-sim",
            "fleetyard-studio",
            "fleetyard-view",
            "fleetyard-views",
            "fleetyard-world",
        ],
    ),
];

/// Heavy dependencies and their one home; a `*` stands for the rest of a name.
const HOMES: &[(&str, &str)] = &[
    ("abi_stable", "fleetyard-abi"),
    ("axum", "fleetyard-studio"),
    ("clap*", "fleetyard"),
    ("flate2", "fleetyard-bench"),
    ("geo", "fleetyard-world"),
    ("libloading", "fleetyard-runtime"),
    ("parquet", "fleetyard-bench"),
    ("parry2d*", "fleetyard-sim"),
    ("rapier2d*", "fleetyard-sim"),
    ("resvg", "fleetyard-view"),
    ("rusqlite", "fleetyard-bench"),
    ("tar", "fleetyard-bench"),
    ("tokio", "fleetyard-studio"),
    ("zstd", "fleetyard-sim"),
];

/// Crates of the host that may have unsafe code. Plugins may where they export
/// their entry: that is glue which the macro writes.
const MAY_BE_UNSAFE: &[&str] = &["fleetyard-abi", "fleetyard-runtime"];

/// Crates whose results are the same everywhere and every time.
const REPRODUCIBLE: &[&str] = &["core", "world", "check", "sim", "views"];

/// The packages of this repository.
fn ours() -> Vec<Package> {
    packages(&root().join("Cargo.toml"))
}

fn is_plugin(package: &Package) -> bool {
    package.folder().starts_with(root().join("plugins"))
}

/// True for libraries and programs.
fn is_product(target: &Target) -> bool {
    let product = |kind: &String| ["lib", "rlib", "cdylib", "bin"].contains(&kind.as_str());
    target.kind.iter().any(product)
}

/// Names of what a package needs, tests and benches aside.
fn needs(package: &Package) -> Vec<&str> {
    let dependencies = package.dependencies.iter();
    dependencies
        .filter(|dependency| !dependency.is_for_tests())
        .map(|dependency| dependency.name.as_str())
        .collect()
}

/// All Rust files below a folder, in order.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

/// Lines that contain one of the texts, comments aside.
fn lines_with(files: &[PathBuf], texts: &[&str]) -> Vec<String> {
    let mut found = Vec::new();
    for file in files {
        let content = fs::read_to_string(file).unwrap();
        for (number, line) in content.lines().enumerate() {
            let code = line.split("//").next().unwrap_or_default();
            if texts.iter().any(|text| code.contains(text)) {
                found.push(format!(
                    "{}:{}: {}",
                    file.display(),
                    number + 1,
                    line.trim()
                ));
            }
        }
    }
    found
}

#[test]
fn nothing_points_upwards() {
    let packages = ours();
    let ours: BTreeSet<&str> = packages
        .iter()
        .map(|package| package.name.as_str())
        .collect();
    let plugins: BTreeSet<&str> = packages
        .iter()
        .filter(|package| is_plugin(package))
        .map(|package| package.name.as_str())
        .collect();
    for package in &packages {
        let name = package.name.as_str();
        let entry = MAY_USE.iter().find(|(known, _)| *known == name);
        assert!(
            entry.is_some() != is_plugin(package),
            "{name} is neither a plugin nor in the table of this test, or both"
        );
        for needed in needs(package)
            .into_iter()
            .filter(|needed| ours.contains(needed))
        {
            let allowed = match entry {
                Some((_, allowed)) => allowed.contains(&needed),
                None => needed == "fleetyard-abi" || plugins.contains(needed),
            };
            assert!(allowed, "{name} may not depend on {needed}");
        }
    }
}

#[test]
fn plugins_do_not_use_the_host_in_tests_either() {
    for package in &ours() {
        if !is_plugin(package) {
            continue;
        }
        for dependency in &package.dependencies {
            let needed = dependency.name.as_str();
            let apart = ["fleetyard-abi", "fleetyard-testkit"];
            let of_host = MAY_USE
                .iter()
                .any(|(name, _)| *name == needed && !apart.contains(name));
            assert!(!of_host, "{} may not depend on {needed}", package.name);
        }
    }
}

#[test]
fn the_judge_knows_neither_planners_nor_the_simulator() {
    let is_check = |package: &Package| package.name == "fleetyard-check";
    for package in ours().into_iter().filter(is_check) {
        // Its tests included: an oracle must not be what it judges.
        let needed: Vec<&str> = package
            .dependencies
            .iter()
            .map(|dependency| dependency.name.as_str())
            .filter(|name| name.starts_with("fleetyard"))
            .collect();
        for name in needed {
            assert!(
                ["fleetyard-core", "fleetyard-world"].contains(&name),
                "fleetyard-check may not depend on {name}"
            );
        }
    }
}

#[test]
fn heavy_dependencies_have_one_home() {
    for package in &ours() {
        for needed in needs(package) {
            for (heavy, home) in HOMES {
                let is_it = match heavy.strip_suffix('*') {
                    Some(start) => needed.starts_with(start),
                    None => needed == *heavy,
                };
                // The fixture is built against a changed copy of the contract.
                let fixture = package.name.starts_with("fleetyard-faulty");
                assert!(
                    !is_it || package.name.as_str() == *home || fixture,
                    "{} uses {needed}, whose home is {home}",
                    package.name
                );
            }
        }
    }
}

/// Authors of plugins build what the contract needs without its features.
#[test]
fn the_contract_needs_no_heavy_crate_by_default() {
    let packages = ours();
    let contract = packages
        .iter()
        .find(|package| package.name == "fleetyard-abi");
    let contract = contract.unwrap();
    assert!(!contract.features.contains_key("default"));
    let optional = contract
        .dependencies
        .iter()
        .filter(|needed| needed.optional);
    let optional: BTreeSet<&str> = optional.map(|needed| needed.name.as_str()).collect();
    let mut needed = needs(contract);
    needed.retain(|name| !optional.contains(name));
    assert_eq!(
        needed,
        ["libc", "schemars", "serde", "serde_json", "thiserror"]
    );
}

#[test]
fn what_commands_share_knows_no_command() {
    let command = root().join("host/cli/src");
    let mut shared = sources(&command);
    shared.retain(|file| file.parent() == Some(&*command) && !file.ends_with("main.rs"));
    assert!(shared.len() > 3, "{shared:?}");
    let upwards = lines_with(&shared, &["commands::"]);
    assert!(upwards.is_empty(), "{upwards:#?}");
    let lowest = ["exit.rs", "output.rs"].map(|name| command.join(name));
    let upwards = lines_with(&lowest, &["args::", "files::", "setup::"]);
    assert!(upwards.is_empty(), "{upwards:#?}");
}

#[test]
fn every_crate_takes_the_lints_of_the_workspace() {
    for package in &ours() {
        let manifest = fs::read_to_string(&package.manifest_path).unwrap();
        assert!(
            manifest.contains("[lints]\nworkspace = true"),
            "{} does not say `lints.workspace = true`",
            package.manifest_path.display()
        );
    }
}

#[test]
fn versions_stand_in_one_table() {
    for package in &ours() {
        let manifest = fs::read_to_string(&package.manifest_path).unwrap();
        let mut in_dependencies = false;
        for line in manifest.lines() {
            if line.starts_with('[') {
                in_dependencies = line.ends_with("dependencies]");
            } else if in_dependencies && line.contains('=') {
                assert!(
                    line.contains("workspace = true"),
                    "{}: `{line}` does not take its version from the workspace",
                    package.manifest_path.display()
                );
            }
        }
    }
}

#[test]
fn unsafe_is_forbidden_elsewhere() {
    for package in &ours() {
        if MAY_BE_UNSAFE.contains(&package.name.as_str()) {
            continue;
        }
        for target in &package.targets {
            let source = fs::read_to_string(&target.src_path).unwrap();
            let glue = is_plugin(package) && is_glue(package.folder());
            assert!(
                !is_product(target) || glue || source.contains("#![forbid(unsafe_code)]"),
                "{} does not forbid unsafe code",
                target.src_path.display()
            );
        }
    }
}

/// Targets without tests are not built for them, which saves time as long as there are none.
#[test]
fn tests_that_are_switched_off_have_nothing_to_run() {
    for package in &ours() {
        let files = sources(&package.folder().join("src"));
        for target in package.targets.iter().filter(|target| is_product(target)) {
            let path = target.src_path.display();
            if !target.test {
                let tests = lines_with(&files, &["#[test]", "#[cfg(test)]", "proptest!"]);
                assert_eq!(tests, [""; 0], "{path} has `test = false`");
            }
            if !target.doctest && !target.kind.contains(&"bin".to_owned()) {
                let examples: Vec<_> = files.iter().filter(|file| has_example(file)).collect();
                assert!(
                    examples.is_empty(),
                    "{path} has `doctest = false`: {examples:?}"
                );
            }
        }
    }
}

/// True if a block of code in the documentation of a file is Rust, as those without a name are.
fn has_example(file: &Path) -> bool {
    let content = fs::read_to_string(file).unwrap();
    let lines = content.lines().map(str::trim_start);
    let fences = lines.filter_map(|line| {
        let comment = line.strip_prefix("//!").or(line.strip_prefix("///"))?;
        comment.trim_start().strip_prefix("```")
    });
    let mut beginnings = fences.step_by(2);
    beginnings.any(|language| language.is_empty() || language.starts_with("rust"))
}

/// True if a plugin's crate exports an entry symbol.
fn is_glue(folder: &Path) -> bool {
    let texts = ["fleetyard_abi::export!", "fleetyard_plugin_entry_v1"];
    !lines_with(&sources(&folder.join("src")), &texts).is_empty()
}

/// All Rust files of the project.
fn all_sources() -> Vec<PathBuf> {
    let folders = ["abi", "host", "plugins", "tests"];
    let files = folders.map(|folder| sources(&root().join(folder)));
    files.concat()
}

#[test]
fn doc_comments_open_with_their_subject() {
    const RIDDLES: [&str; 9] = [
        "How", "What", "Where", "Whether", "Which", "Who", "Whom", "Whose", "Why",
    ];
    let mut found = Vec::new();
    for file in all_sources() {
        let content = fs::read_to_string(&file).unwrap();
        let mut is_inside = false;
        for (number, line) in content.lines().enumerate() {
            let line = line.trim_start();
            let comment = ["///", "//!"]
                .iter()
                .find_map(|mark| line.strip_prefix(mark));
            let opening = comment.filter(|_| !is_inside).unwrap_or_default();
            let mut words = opening.split(|letter: char| !letter.is_alphabetic());
            if words
                .find(|word| !word.is_empty())
                .is_some_and(|word| RIDDLES.contains(&word))
            {
                found.push(format!("{}:{}: {line}", file.display(), number + 1));
            }
            is_inside = comment.is_some();
        }
    }
    assert_eq!(found, [""; 0], "say what the item is");
}

#[test]
fn nothing_is_unfinished() {
    let files = all_sources();
    // Put together here, so that this file does not contain them.
    let unfinished = ["todo", "unimplemented", "dbg"].map(|name| format!("{name}!("));
    let texts: Vec<&str> = unfinished.iter().map(String::as_str).collect();
    assert_eq!(lines_with(&files, &texts), [""; 0]);
}

#[test]
fn what_must_be_reproducible_reads_no_clock() {
    for name in REPRODUCIBLE {
        let files = sources(&root().join("host").join(name).join("src"));
        let clocks = ["std::time", "SystemTime", "Instant::", "monotonic_ns"];
        assert_eq!(lines_with(&files, &clocks), [""; 0]);
        let chance = ["RandomState", "thread_rng", "from_os_rng", "rand::rng"];
        assert_eq!(lines_with(&files, &chance), [""; 0]);
    }
}

#[test]
fn simulation_and_judgement_have_no_order_that_is_up_to_a_hash() {
    for name in ["world", "check", "sim"] {
        let files = sources(&root().join("host").join(name).join("src"));
        assert_eq!(lines_with(&files, &["HashMap", "HashSet"]), [""; 0]);
    }
}

#[test]
fn simulation_and_judgement_use_no_float_function_of_the_platform() {
    // IEEE 754 does not say what these return in the last bit, and platforms differ.
    let functions = [
        "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sin_cos", "sinh", "cosh", "tanh",
        "exp", "exp2", "exp_m1", "ln", "ln_1p", "log", "log2", "log10", "powf", "powi", "cbrt",
        "hypot",
    ];
    let texts: Vec<String> = functions.iter().map(|name| format!(".{name}(")).collect();
    let texts: Vec<&str> = texts.iter().map(String::as_str).collect();
    for name in ["world", "check", "sim"] {
        let files = sources(&root().join("host").join(name).join("src"));
        assert_eq!(lines_with(&files, &texts), [""; 0]);
    }
}

#[test]
fn links_and_anchors_of_the_documentation_lead_somewhere() {
    let root = root();
    let mut pages: Vec<PathBuf> = [
        "README.md",
        "ARCHITECTURE.md",
        "CHANGELOG.md",
        "CONTRIBUTING.md",
        "SECURITY.md",
    ]
    .map(|name| root.join(name))
    .to_vec();
    for folder in [
        "docs",
        "docs/results",
        "docs/tutorials",
        "abi",
        "plugins",
        "maps",
    ] {
        let entries = fs::read_dir(root.join(folder)).unwrap();
        let paths = entries.map(|entry| entry.unwrap().path());
        pages.extend(paths.filter(|path| path.extension().is_some_and(|end| end == "md")));
    }
    let mut dead = Vec::new();
    for page in &pages {
        for target in links(&fs::read_to_string(page).unwrap()) {
            let (path, anchor) = target.split_once('#').unwrap_or((&target, ""));
            let there = match path {
                "" => page.clone(),
                path => page.parent().unwrap().join(path),
            };
            let is_page = there.extension().is_some_and(|end| end == "md");
            let leads = there.exists()
                && (anchor.is_empty()
                    || !is_page
                    || anchors(&fs::read_to_string(&there).unwrap()).contains(anchor));
            if !leads {
                dead.push(format!("{}: {target}", page.display()));
            }
        }
    }
    assert_eq!(dead, [""; 0]);
}

/// Lines of a page that are no code.
fn prose(page: &str) -> impl Iterator<Item = &str> {
    let mut code = false;
    page.lines().filter(move |line| {
        let fence = line.trim_start().starts_with("```");
        code ^= fence;
        !code && !fence
    })
}

/// Targets of a page's links within the repository.
fn links(page: &str) -> Vec<String> {
    let mut found = Vec::new();
    for line in prose(page) {
        // Of what stands between backticks nothing is a link.
        let text: String = line.split('`').step_by(2).collect::<Vec<_>>().join("`");
        let targets = text
            .split("](")
            .skip(1)
            .filter_map(|rest| rest.split_once(')'));
        let inside = targets
            .map(|(target, _)| target)
            .filter(|target| !target.contains("://"));
        found.extend(inside.map(str::to_owned));
    }
    found
}

/// The anchors of a page's headings, as GitHub makes them.
fn anchors(page: &str) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for heading in prose(page).filter(|line| line.starts_with('#')) {
        let text = heading.trim_start_matches('#').trim().to_lowercase();
        let kept = text
            .chars()
            .filter(|c| c.is_alphanumeric() || matches!(c, '-' | '_' | ' '));
        let name: String = kept.map(|c| if c == ' ' { '-' } else { c }).collect();
        let mut number = 0;
        let mut unique = name.clone();
        while !found.insert(unique.clone()) {
            number += 1;
            unique = format!("{name}-{number}");
        }
    }
    found
}

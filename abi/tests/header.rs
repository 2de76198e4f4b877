//! `include/fleetyard.h` is what `src/c.rs` says, and compilers take it.

#![allow(missing_docs)]

use std::path::{Path, PathBuf};
use std::process::Command;

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// Names in `src/c.rs` that follow `keyword`.
fn names(source: &str, keyword: &str) -> Vec<String> {
    let lines = source.lines().filter_map(|line| line.strip_prefix(keyword));
    lines
        .map(|rest| {
            rest.chars()
                .take_while(|c| c.is_alphanumeric() || *c == '_')
                .collect()
        })
        .collect()
}

fn generate() -> String {
    let source = root().join("src/c.rs");
    let text = std::fs::read_to_string(&source).expect("src/c.rs");
    let mut config = cbindgen::Config::from_file(root().join("cbindgen.toml")).expect("config");
    for name in names(&text, "pub struct ") {
        config.export.include.push(name.clone());
        config
            .export
            .rename
            .insert(name.clone(), format!("Fleetyard{name}"));
    }
    for name in names(&text, "pub const ") {
        config
            .export
            .rename
            .insert(name.clone(), format!("FLEETYARD_{name}"));
    }
    let bindings = cbindgen::Builder::new()
        .with_config(config)
        .with_src(source)
        .generate()
        .expect("cbindgen reads src/c.rs");
    let mut header = Vec::new();
    bindings.write(&mut header);
    String::from_utf8(header).expect("UTF-8")
}

#[test]
fn header_is_current() {
    let path = root().join("include/fleetyard.h");
    let header = generate();
    if std::env::var_os("FLEETYARD_UPDATE").is_some() {
        std::fs::write(&path, &header).expect("write the header");
    }
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        committed == header,
        "include/fleetyard.h is not what src/c.rs says; run \
         `FLEETYARD_UPDATE=1 cargo test -p fleetyard-abi --test header`"
    );
}

#[test]
fn factory_identifiers_are_in_the_header() {
    let header = std::fs::read_to_string(root().join("include/fleetyard.h")).expect("the header");
    for kind in fleetyard_abi::Kind::ALL {
        let name = kind.as_str().to_uppercase().replace('-', "_");
        let line = format!(
            "#define FLEETYARD_{name}_FACTORY_ID \"{}\"",
            kind.factory_id()
        );
        assert!(header.lines().any(|found| found == line), "{line}");
    }
}

fn installed(program: &str) -> bool {
    Command::new(program)
        .arg("--version")
        .output()
        .is_ok_and(|output| output.status.success())
}

fn compile(program: &str, arguments: &[&str], extension: &str) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let source = folder.path().join("unit").with_extension(extension);
    // A unit that uses the header twice and reads a field, so that the guard and
    // the declarations both matter.
    let text = "#include \"fleetyard.h\"\n#include \"fleetyard.h\"\n\
                extern size_t size(const FleetyardPlan *plan);\n\
                size_t size(const FleetyardPlan *plan) {\n    \
                return plan->struct_size == sizeof *plan ? (size_t)plan->agents : 0u;\n}\n";
    std::fs::write(&source, text).expect("write the unit");
    let output = Command::new(program)
        .args(arguments)
        .args(["-Wall", "-Wextra", "-Wpedantic", "-Werror", "-c", "-o"])
        .arg(folder.path().join("unit.o"))
        .arg("-I")
        .arg(Path::new(&root()).join("include"))
        .arg(&source)
        .output()
        .expect("the compiler starts");
    let log = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{program} {arguments:?}:\n{log}");
}

#[test]
fn header_compiles_as_c11_and_cpp17() {
    let cases = [
        ("gcc", "-std=c11", "c"),
        ("g++", "-std=c++17", "cpp"),
        ("clang", "-std=c11", "c"),
        ("clang++", "-std=c++17", "cpp"),
    ];
    for (program, standard, extension) in cases {
        if installed(program) {
            compile(program, &[standard], extension);
        } else {
            // gcc or clang is needed for nothing else than this test.
            eprintln!("skipped: {program} is not installed");
        }
    }
    assert!(
        cases.iter().any(|(program, ..)| installed(program)),
        "no C compiler is installed"
    );
}

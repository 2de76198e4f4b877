//! `include/fleetyard.h` is what `src/c.rs` says, and compilers take it, and
//! `include/fleetyard_easy.h` and `include/fleetyard.hpp` over it.

use std::path::{Path, PathBuf};
use std::process::Command;

use fleetyard_abi::c::ANNOTATIONS_ID;

pub(crate) fn root() -> PathBuf {
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
         `FLEETYARD_UPDATE=1 cargo test -p fleetyard-abi header`"
    );
}

#[test]
fn identifiers_are_in_the_header() {
    let header = std::fs::read_to_string(root().join("include/fleetyard.h")).expect("the header");
    for kind in fleetyard_abi::Kind::ALL {
        let name = kind.as_str().to_uppercase().replace('-', "_");
        let line = format!(
            "#define FLEETYARD_{name}_FACTORY_ID \"{}\"",
            kind.factory_id()
        );
        assert!(header.lines().any(|found| found == line), "{line}");
    }
    let line = format!("#define FLEETYARD_ANNOTATIONS_ID \"{ANNOTATIONS_ID}\"");
    assert!(header.lines().any(|found| found == line), "{line}");
}

pub(crate) fn installed(program: &str) -> bool {
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

/// Compilers with their standards, and how they and files call the language.
pub(crate) const COMPILERS: [(&str, &str, &str, &str); 4] = [
    ("gcc", "-std=c11", "c", "c"),
    ("g++", "-std=c++17", "c++", "cpp"),
    ("clang", "-std=c11", "c", "c"),
    ("clang++", "-std=c++17", "c++", "cpp"),
];

#[test]
fn header_compiles_as_c11_and_cpp17() {
    for (program, standard, _, extension) in COMPILERS {
        if installed(program) {
            compile(program, &[standard], extension);
        } else {
            // gcc or clang is needed for nothing else than this test.
            eprintln!("skipped: {program} is not installed");
        }
    }
    assert!(
        COMPILERS.iter().any(|(program, ..)| installed(program)),
        "no C compiler is installed"
    );
}

/// The example in the comment at the top of `fleetyard.hpp`, as a file.
fn example() -> String {
    let header = std::fs::read_to_string(root().join("include/fleetyard.hpp")).expect("the header");
    let lines = header
        .lines()
        .skip_while(|line| !line.starts_with(" *     #include"))
        .map(|line| line.strip_prefix(" *").expect("within the comment"))
        .map(|line| line.strip_prefix("     ").unwrap_or(line));
    let mut text = String::new();
    for line in lines {
        text.extend([line, "\n"]);
        if line.starts_with("FLEETYARD_PLUGINS") {
            return text;
        }
    }
    panic!("the example has no end");
}

/// Runs a program that has to succeed; its standard output.
pub(crate) fn succeed(command: &mut Command) -> String {
    let output = command.output().expect("the program starts");
    let log = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?}:\n{log}");
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// A compiler that takes no warnings, with a folder of headers.
pub(crate) fn strict(compiler: &str, standard: &str, include: &Path) -> Command {
    let mut command = Command::new(compiler);
    command
        .arg(standard)
        .args(["-O1", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion"])
        .args(["-Wsign-conversion", "-Wshadow", "-Werror", "-I"])
        .arg(include);
    command
}

#[test]
fn the_easy_header_reads_views_and_refuses_what_it_does_not_know() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let program = folder.path().join("easy");
    for (compiler, standard, language, _) in COMPILERS {
        if installed(compiler) {
            succeed(
                strict(compiler, standard, &root().join("include"))
                    .args(["-x", language])
                    .arg(root().join("tests/it/easy.c"))
                    .arg("-o")
                    .arg(&program),
            );
            succeed(&mut Command::new(&program));
        }
    }
}

/// The C++ compilers that are here, each with the standards to try.
fn cpp() -> Vec<(&'static str, &'static str)> {
    let compilers = ["g++", "clang++"].into_iter().filter(|program| {
        let found = installed(program);
        if !found {
            eprintln!("skipped: {program} is not installed");
        }
        found
    });
    compilers
        .flat_map(|program| [(program, "-std=c++17"), (program, "-std=c++20")])
        .collect()
}

#[test]
fn the_cpp_header_makes_a_library_with_one_symbol() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let source = folder.path().join("blind.cpp");
    std::fs::write(&source, example()).expect("write the example");
    let library = folder.path().join("blind.so");
    for (compiler, standard) in cpp() {
        let mut script = std::ffi::OsString::from("-Wl,--version-script=");
        script.push(root().join("include/fleetyard.map"));
        succeed(
            strict(compiler, standard, &root().join("include"))
                .args(["-fPIC", "-shared", "-fvisibility=hidden"])
                .arg(script)
                .arg("-o")
                .args([&library, &source]),
        );
        if installed("nm") {
            let exported = succeed(
                Command::new("nm")
                    .args(["--dynamic", "--defined-only", "--format=just-symbols"])
                    .arg(&library),
            );
            assert_eq!(
                exported, "fleetyard_plugin_entry_v1\n",
                "{compiler} {standard}"
            );
        }
    }
}

#[test]
fn the_cpp_header_reads_views_and_keeps_exceptions() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let program = folder.path().join("wrapper");
    for (compiler, standard) in cpp().into_iter().step_by(2) {
        succeed(
            strict(compiler, standard, &root().join("include"))
                .arg("-o")
                .arg(&program)
                .arg(root().join("tests/it/wrapper.cpp")),
        );
        succeed(&mut Command::new(&program));
    }
}

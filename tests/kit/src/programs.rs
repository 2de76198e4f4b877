//! Plugins and packages that tests build.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, PoisonError};

use serde_json::Value;

use crate::command::have;
use crate::places::{built, kept, root};

/// Compiles a C or C++ file of the repository to a shared library, unless that was
/// done since it changed last. `variant` is the value of the macro `VARIANT`.
pub fn c_library(source: &str, variant: Option<&str>) -> PathBuf {
    // One at a time: tests of one process ask for the same library at once.
    static COMPILER: Mutex<()> = Mutex::new(());
    let _only = COMPILER.lock().unwrap_or_else(PoisonError::into_inner);
    let source = root().join(source);
    let include = root().join("abi/include");
    let cpp = source
        .extension()
        .is_some_and(|extension| extension == "cpp");
    let name = match variant {
        Some(variant) => variant.to_lowercase(),
        None => source.file_stem().unwrap().to_string_lossy().into_owned(),
    } + if cpp { "_cpp" } else { "" };
    let folder = kept("plugins");
    let library = folder.join(format!("{name}.so"));
    let modified = |path: &Path| fs::metadata(path).and_then(|meta| meta.modified()).ok();
    let compiled = modified(&library);
    // Headers beside the source are a part of it.
    let headers = [source.parent().unwrap(), &include]
        .into_iter()
        .flat_map(|folder| fs::read_dir(folder).unwrap().flatten())
        .map(|entry| entry.path())
        .filter(|path| {
            let extension = path.extension().and_then(OsStr::to_str);
            matches!(extension, Some("h" | "hpp"))
        });
    let newest = headers.chain([source.clone()]).map(|path| modified(&path));
    if compiled.is_some() && compiled > newest.max().flatten() {
        return library;
    }
    // Another test process may use the old one, and sees the new one when it is whole.
    let unfinished = folder.join(format!("{name}.so.{}", std::process::id()));
    let (variable, usual, standard) = if cpp {
        ("CXX", "c++", "-std=c++17")
    } else {
        ("CC", "cc", "-std=c11")
    };
    let compiler = std::env::var_os(variable).unwrap_or_else(|| usual.into());
    let mut command = Command::new(compiler);
    command
        .args([standard, "-O1", "-fPIC", "-shared", "-fvisibility=hidden"])
        .arg("-pthread")
        .args(variant.map(|variant| format!("-DVARIANT={variant}")))
        .arg("-I")
        .arg(&include)
        .arg("-o")
        .arg(&unfinished)
        .arg(&source)
        .arg("-lm");
    let output = command.output().expect("a compiler is needed");
    let messages = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?}: {messages}");
    fs::rename(&unfinished, &library).unwrap();
    library
}

/// The planner that misbehaves on request, as a shared library.
pub fn faulty_library() -> PathBuf {
    c_library("plugins/faulty/faulty.c", None)
}

/// Its relative that throws exceptions; nothing without a C++ compiler.
pub fn faulty_cpp_library() -> Option<PathBuf> {
    let compiler = std::env::var("CXX").unwrap_or_else(|_| "c++".into());
    have(&compiler).then(|| c_library("plugins/faulty/faulty.cpp", None))
}

/// A planner in Rust that misbehaves on request, as a shared library.
pub fn faulty_rust_library() -> PathBuf {
    library("fleetyard-faulty")
}

/// The same as a program.
pub fn faulty_program() -> PathBuf {
    root().join("plugins/faulty/faulty.py")
}

/// Gives a new package outside of the workspace the workspace's versions, which are on this
/// machine, and a build folder that stays, so that dependencies are built once.
pub fn prepare_package(folder: &Path) {
    if !folder.join("target").exists() {
        fs::copy(root().join("Cargo.lock"), folder.join("Cargo.lock")).unwrap();
        std::os::unix::fs::symlink(kept("packages"), folder.join("target")).unwrap();
    }
}

/// Waits for the build folder of [`prepare_package`], and keeps others from it as long as the file is
/// held: packages of two tests are called alike, and Cargo replaces what the other one still reads.
pub fn turn_of_packages() -> fs::File {
    let file = fs::File::create(kept("packages").join(".turn")).unwrap();
    file.lock().unwrap();
    file
}

/// Products of `cargo build` for a package: its shared library and its program.
#[derive(Debug, Clone, Default)]
pub struct Built {
    /// The shared library.
    pub library: Option<PathBuf>,
    /// The program.
    pub program: Option<PathBuf>,
}

/// The products of a package of the workspace. The command depends on it, so that its library lies beside
/// the command's tests, and so does its program where the whole workspace was built. Cargo would build the
/// package and what it needs once more, with the features that they have without the rest of the workspace.
pub fn built_package(package: &str) -> Built {
    let library = beside(package);
    let program = built().join(package);
    let made = |path: &Path| fs::metadata(path).and_then(|file| file.modified());
    match (made(&library), made(&program)) {
        (Ok(linked), Ok(made)) if made >= linked => Built {
            library: Some(library),
            program: Some(program),
        },
        _ => build(package),
    }
}

/// The shared library of a package that the tests of the command depend on: it lies beside them.
pub fn library(package: &str) -> PathBuf {
    let library = beside(package);
    assert!(library.is_file(), "no {}", library.display());
    library
}

/// The place of a package's shared library beside the tests.
fn beside(package: &str) -> PathBuf {
    let name = format!("lib{}.so", package.replace('-', "_"));
    std::env::current_exe().unwrap().with_file_name(name)
}

/// Builds a package of the workspace beside the command under test, with the same
/// profile. Cargo holds no lock while tests run.
fn build(package: &str) -> Built {
    let folder = built();
    let profile = match folder.file_name().and_then(OsStr::to_str).unwrap() {
        "debug" => "dev",
        other => other,
    };
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command
        .args(["build", "--quiet", "--message-format=json"])
        .args(["--package", package, "--profile", profile])
        .arg("--target-dir")
        .arg(folder.parent().unwrap())
        .current_dir(root());
    let output = command.output().unwrap();
    let messages = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?}: {messages}");
    let mut built = Built::default();
    let stdout = String::from_utf8_lossy(&output.stdout);
    for message in stdout.lines() {
        let Ok(message) = serde_json::from_str::<Value>(message) else {
            continue;
        };
        let identifier = message["package_id"].as_str().unwrap_or_default();
        if !identifier.contains(&format!("#{package}@")) {
            continue;
        }
        for file in message["filenames"].as_array().into_iter().flatten() {
            let file = PathBuf::from(file.as_str().unwrap());
            if file.extension().is_some_and(|extension| extension == "so") {
                built.library = Some(file);
            }
        }
        if let Some(program) = message["executable"].as_str() {
            built.program = Some(program.into());
        }
    }
    built
}

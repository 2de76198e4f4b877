//! `fleetyard plugins new`: a folder with a plugin that works, for its author to change.
//!
//! The written files are those of `templates/`: code that is built and tested as it stands, of a
//! plugin `example-plugin`, which gets the new plugin's name. The SDK goes beside it, from the same
//! sources as everywhere, so that a new plugin needs nothing but its compiler or interpreter.

use std::fmt::Write as _;
use std::fs::{self, Permissions};
use std::io;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use fleetyard_abi::Kind;
use fleetyard_core::{InputError, quoted};

use crate::args::word;
use crate::exit::{Exit, Failure, Result};
use crate::output;

/// Write a new plugin that works, for you to change.
#[derive(Debug, Args)]
pub(crate) struct New {
    /// Its name: the plugin's identifier, and the folder that is written
    name: String,
    /// Language of the plugin
    #[arg(long, value_enum)]
    lang: Lang,
    /// Its kind
    #[arg(long, value_parser = word::<Kind>(), default_value_t = Kind::Planner)]
    kind: Kind,
    /// Maps that it plans on; planners in Python alone know others than grids
    #[arg(long, value_enum, default_value_t = Representation::Grid)]
    representation: Representation,
    /// Folder in which the plugin's folder is made
    #[arg(long, value_name = "FOLDER", default_value = ".")]
    out: PathBuf,
}

/// The language of a new plugin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Lang {
    /// A shared library on the Rust SDK
    Rust,
    /// A shared library on the header alone
    C,
    /// A shared library on the C++ wrapper of the header
    Cpp,
    /// A program on the Python package
    Python,
    /// A manifest for a program that reads MovingAI files and writes paths
    Command,
}

/// The maps of a new plugin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Representation {
    /// Cells, unit time steps
    Grid,
    /// A graph embedded in the plane, continuous time
    Roadmap,
    /// The plane itself, continuous time
    Continuous,
}

/// The text of a file of `templates/`.
macro_rules! template {
    ($($path:literal),+) => {
        include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/templates/", $($path),+))
    };
}

/// The text of the template for a kind, by what stands before and after its name.
macro_rules! of_kind {
    ($kind:expr, $before:literal, $after:literal) => {
        match $kind {
            Kind::Planner => template!($before, "planner", $after),
            Kind::FailPolicy => template!($before, "fail-policy", $after),
            Kind::InstanceGenerator => template!($before, "instance-generator", $after),
            Kind::InvocationPolicy => template!($before, "invocation-policy", $after),
        }
    };
}

/// The same for the maps that a planner is for; other kinds have templates for grids alone.
macro_rules! of_map {
    ($kind:expr, $on:expr, $before:literal, $after:literal) => {
        match $on {
            Representation::Grid => of_kind!($kind, $before, $after),
            Representation::Roadmap => template!($before, "planner-roadmap", $after),
            Representation::Continuous => template!($before, "planner-continuous", $after),
        }
    };
}

/// Names and texts of files in a folder of the repository.
macro_rules! copies {
    ($folder:literal: $($name:literal)*) => {
        &[$((
            $name,
            include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../", $folder, "/", $name)),
        )),*]
    };
}

const C_SDK: &[(&str, &str)] = copies!("abi/include": "fleetyard_easy.h" "fleetyard.h");

const CPP_SDK: &[(&str, &str)] =
    copies!("abi/include": "fleetyard.hpp" "fleetyard.h" "fleetyard.map");

const RUST_SDK: &[(&str, &str)] = copies!("abi/src":
    "annotation.rs" "c.rs" "clock.rs" "convert/annotation.rs" "convert/environment.rs" "convert/instance.rs"
    "convert/memory.rs" "convert/mod.rs" "convert/options.rs" "convert/plan.rs" "convert/sink.rs" "environment.rs"
    "export.rs" "figures.rs" "layout.rs" "leftovers.rs" "lib.rs" "lists.rs" "memory.rs" "model.rs" "moves.rs" "object.rs" "paths.rs"
    "paths/motions.rs" "paths/reader.rs" "plan.rs" "sdk.rs" "serve.rs" "wire.rs");

const PYTHON_SDK: &[(&str, &str)] = copies!("abi/python/fleetyard":
    "__init__.py" "_annotations.py" "_failures.py" "_maps.py" "_memory.py" "_model.py" "_numbers.py" "_paths.py"
    "_plans.py" "_plugins.py" "_server.py" "_steps.py" "py.typed");

/// Description of the files of an SDK.
const SDK: &str = "the SDK";

/// A new plugin's folder.
struct Scaffold {
    files: Vec<File>,
    /// Commands that build it; none where nothing is to build.
    build: Option<String>,
    /// The command of its own test.
    test: String,
    /// The plugin, once it is built.
    plugin: String,
}

struct File {
    path: String,
    text: String,
    /// Description of the file; empty for one that is not worth a line.
    about: &'static str,
    executable: bool,
}

/// A name in the forms that are needed.
struct Name {
    /// The plugin's identifier, and a Rust package.
    id: String,
    /// Files, a Rust crate, a Python module.
    module: String,
    /// A class in Python.
    class: String,
}

pub(crate) fn new(arguments: &New) -> Result<Exit> {
    let New {
        name,
        lang,
        kind,
        representation,
        out,
    } = arguments;
    let (lang, kind, on) = (*lang, *kind, *representation);
    let knows_maps = lang != Lang::Command && kind == Kind::Planner;
    if on != Representation::Grid && !knows_maps {
        let reason = "maps other than grids are for planners that no manifest describes";
        return Err(Failure::new(Exit::Usage, reason).hint(
            "--kind planner with --lang rust, c, cpp or python, or leave out --representation",
        ));
    }
    let scaffold = scaffold(lang, kind, on, &Name::new(name, lang)?)?;
    // What is below `.` needs no `./` in any of the commands.
    let folder = out.join(name);
    let folder = folder.strip_prefix(".").unwrap_or(&folder);
    write(&scaffold.files, out, folder)?;
    let runs = kind == Kind::Planner && on == Representation::Grid;
    output::print(&text(&scaffold, kind, lang, runs, folder))?;
    Ok(Exit::Success)
}

/// Writes the Python package into a folder, for the plugins there.
pub(crate) fn sdk(out: &Path) -> Result<Exit> {
    let files = PYTHON_SDK.iter().map(|(name, text)| File {
        path: (*name).to_owned(),
        text: (*text).to_owned(),
        about: "",
        executable: false,
    });
    let folder = out.join("fleetyard");
    write(&files.collect::<Vec<_>>(), out, &folder)?;
    output::print(&folder.display().to_string())?;
    Ok(Exit::Success)
}

impl Name {
    fn new(name: &str, lang: Lang) -> Result<Self> {
        const LONGEST: usize = 64;
        let wrong = |reason: String| Failure::new(Exit::Usage, reason);
        let allowed = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        if name.contains('/') {
            return Err(wrong(format!("`{name}` is a path, not a name"))
                .hint("--out FOLDER says where the plugin's folder goes"));
        }
        if !name.starts_with(|c: char| c.is_ascii_alphabetic()) || !name.chars().all(allowed) {
            let words = name.split(|c| !allowed(c)).filter(|word| !word.is_empty());
            let words: Vec<&str> = words.collect();
            let near = words
                .join("-")
                .trim_start_matches(|c: char| !c.is_ascii_alphabetic())
                .trim_end_matches('-')
                .to_owned();
            let near = if near.is_empty() { "my-planner" } else { &near };
            return Err(wrong(format!(
                "`{name}` cannot be a plugin's name: a name begins with a letter (a-z), and \
                 letters, digits, `-` and `_` follow"
            ))
            .hint(format!("`{near}` can")));
        }
        if name.len() > LONGEST {
            let reason = format!("a plugin's name has at most {LONGEST} characters");
            return Err(wrong(reason).hint("the description has room for the rest"));
        }
        let id = name.to_ascii_lowercase();
        let module = id.replace('-', "_");
        let (reserved, what) = match lang {
            Lang::Rust => (template!("reserved-rust.txt"), "a keyword or crate"),
            Lang::Python => (template!("reserved-python.txt"), "a keyword or module"),
            Lang::C | Lang::Cpp | Lang::Command => ("", ""),
        };
        if reserved.split_whitespace().any(|word| word == module) {
            let lang = title(lang);
            return Err(wrong(format!(
                "`{name}` is {what} of {lang}, and cannot be a plugin's name"
            ))
            .hint(format!("for example `my-{id}`")));
        }
        let words = id.split(['-', '_']);
        let class = words.map(capitalised).collect();
        Ok(Self { id, module, class })
    }

    /// Gives a template the name, which may have the template's in it.
    fn put(&self, text: &str) -> String {
        let pieces = text.split("example-plugin");
        let pieces: Vec<String> = pieces
            .map(|piece| {
                let piece = piece.replace("example_plugin", &self.module);
                piece.replace("ExamplePlugin", &self.class)
            })
            .collect();
        pieces.join(&self.id)
    }
}

fn capitalised(word: &str) -> String {
    let (first, rest) = word.split_at(word.len().min(1));
    first.to_ascii_uppercase() + rest
}

fn title(lang: Lang) -> &'static str {
    match lang {
        Lang::Rust => "Rust",
        Lang::C => "C",
        Lang::Cpp => "C++",
        Lang::Python => "Python",
        Lang::Command => "TOML",
    }
}

/// The files to write, and the commands for their use; `{}` in commands stands for the folder.
fn scaffold(lang: Lang, kind: Kind, on: Representation, name: &Name) -> Result<Scaffold> {
    let mut files = Vec::new();
    let mut add = |path: &str, text: &str, about| {
        files.push(File {
            path: name.put(path),
            text: name.put(text),
            about,
            executable: text.starts_with("#!"),
        });
    };
    let yours = "the plugin: your code goes here";
    let (build, test, plugin) = match lang {
        Lang::Rust => {
            add("src/lib.rs", of_map!(kind, on, "rust/", ".rs"), yours);
            let test = of_map!(kind, on, "rust/tests/", ".rs");
            add("tests/plugin.rs", test, "its test");
            add("tests/host/mod.rs", template!("rust/tests/host.rs"), "");
            add(
                "Cargo.toml",
                template!("rust/Cargo.toml"),
                "how it is built",
            );
            add("sdk/Cargo.toml", template!("rust/sdk.toml"), "");
            (
                Some("cargo build --release --manifest-path {}/Cargo.toml"),
                "cargo test --release --manifest-path {}/Cargo.toml",
                "target/release/libexample_plugin.so",
            )
        }
        Lang::C => {
            add("example_plugin.c", of_map!(kind, on, "c/", ".c"), yours);
            let test = of_map!(kind, on, "c/tests/", ".c");
            add("tests/test.c", test, "its test");
            add("tests/host.h", template!("c/tests/host.h"), "");
            add("Makefile", template!("c/Makefile"), "how it is built");
            (Some("make -C {}"), "make -C {} check", "example_plugin.so")
        }
        Lang::Cpp => {
            add(
                "example_plugin.cpp",
                of_map!(kind, on, "cpp/", ".cpp"),
                yours,
            );
            let test = of_map!(kind, on, "cpp/tests/", ".cpp");
            add("tests/test.cpp", test, "its test");
            add("tests/host.hpp", template!("cpp/tests/host.hpp"), "");
            add("Makefile", template!("cpp/Makefile"), "how it is built");
            (Some("make -C {}"), "make -C {} check", "example_plugin.so")
        }
        Lang::Python => {
            let plugin = of_map!(kind, on, "python/", ".py");
            let test = of_map!(kind, on, "python/tests/", ".py");
            add("example_plugin.py", plugin, yours);
            add("tests/test_plugin.py", test, "its test");
            let test = "python3 -m unittest discover {}/tests";
            (None, test, "example_plugin.py")
        }
        Lang::Command => {
            if kind != Kind::Planner {
                let reason = format!("a command-line solver can be a planner, but no {kind}");
                return Err(Failure::new(Exit::Usage, reason)
                    .hint("--lang python has plugins of every kind in a file of their own"));
            }
            let manifest = template!("command/planner.toml");
            add("planner.toml", manifest, "how the solver is called");
            let solver = template!("command/solver/solve.py");
            add("solver/solve.py", solver, "the solver: yours goes here");
            let test = template!("command/tests/planner.py");
            add("tests/test_solver.py", test, "its test");
            let test = "python3 -m unittest discover {}/tests";
            (None, test, "planner.toml")
        }
    };
    add(".gitignore", template!("gitignore"), "");
    let (sdk, folder, about) = match lang {
        Lang::Rust => (RUST_SDK, "sdk/src/", SDK),
        Lang::C => (C_SDK, "", SDK),
        Lang::Cpp => (CPP_SDK, "", SDK),
        Lang::Python => (PYTHON_SDK, "fleetyard/", SDK),
        Lang::Command => (&[] as &[_], "", ""),
    };
    for (at, (file, text)) in sdk.iter().enumerate() {
        let about = if at == 0 { about } else { "" };
        add(&format!("{folder}{file}"), text, about);
    }
    Ok(Scaffold {
        files,
        build: build.map(str::to_owned),
        test: test.to_owned(),
        plugin: name.put(plugin),
    })
}

/// Writes the files as a folder, which appears when it is whole.
fn write(files: &[File], out: &Path, folder: &Path) -> Result<()> {
    let shown = folder.display().to_string();
    if fs::symlink_metadata(folder).is_ok() {
        let error = InputError::new(shown, "is there already, and stays as it is");
        return Err(error
            .hint("choose another name, or another folder with --out")
            .into());
    }
    if !out.is_dir() {
        let error = InputError::new(out.display().to_string(), "no such folder");
        let out = quoted(&out.display().to_string());
        return Err(error
            .hint(format!("create it first: mkdir -p {out}"))
            .into());
    }
    let failed = |error: io::Error| {
        let reason = format!("cannot be written: {}", error.kind());
        InputError::new(shown.as_str(), reason)
            .hint("may you write to its folder, and is there room?")
    };
    let unfinished = tempfile::Builder::new()
        .prefix(".fleetyard-new-")
        // As any new folder; temporary ones are private else.
        .permissions(Permissions::from_mode(0o777))
        .tempdir_in(out)
        .map_err(failed)?;
    for file in files {
        let path = unfinished.path().join(&file.path);
        let written = fs::create_dir_all(path.parent().unwrap_or(unfinished.path()))
            .and_then(|()| fs::write(&path, &file.text));
        written.map_err(failed)?;
        if file.executable {
            let mode = fs::metadata(&path).map_err(failed)?.permissions().mode();
            // Who may read it may start it.
            let mode = Permissions::from_mode(mode | (mode & 0o444) >> 2);
            fs::set_permissions(&path, mode).map_err(failed)?;
        }
    }
    fs::rename(unfinished.path(), folder).map_err(failed)?;
    // It has another name now, and is not to be removed.
    let _ = unfinished.keep();
    Ok(())
}

/// The files that were written, and the commands that come next; `runs` says if one of them plans
/// on a map.
fn text(scaffold: &Scaffold, kind: Kind, lang: Lang, runs: bool, folder: &Path) -> String {
    const MAP: &str = "random-16-16-10";
    let what = match lang {
        Lang::Command => "from a command-line solver".to_owned(),
        _ => format!("in {}", title(lang)),
    };
    let mut out = format!("{}: a new {kind} {what}\n", folder.display());
    // An SDK is one line: its folder, or its first file where it has none.
    let mut shown: Vec<(&str, &str)> = Vec::new();
    for file in scaffold.files.iter().filter(|file| !file.about.is_empty()) {
        let place = match file.path.split_once('/') {
            Some((folder, _)) if file.about == SDK => &file.path[..=folder.len()],
            _ => &file.path,
        };
        shown.push((place, file.about));
    }
    let width = shown.iter().map(|(place, _)| place.len()).max();
    for (place, about) in shown {
        // Writing to a string cannot fail.
        let _ = writeln!(out, "  {place:width$}  {about}", width = width.unwrap_or(0));
    }
    let here = quoted(&folder.display().to_string());
    let plugin = folder.join(&scaffold.plugin);
    let beside = plugin.parent().unwrap_or(folder);
    let (beside, plugin) = (
        quoted(&beside.display().to_string()),
        quoted(&plugin.display().to_string()),
    );
    let mut next: Vec<String> = Vec::new();
    next.extend(
        scaffold
            .build
            .as_ref()
            .map(|line| line.replace("{}", &here)),
    );
    next.push(scaffold.test.replace("{}", &here));
    next.push(format!("fleetyard plugins check {plugin}"));
    if runs {
        next.push(
            "fleetyard maps generate random --rows 16 --cols 16 --obstacle-density 0.1 \
             --scenario-agents 20"
                .into(),
        );
        next.push(format!(
            "fleetyard run --map {MAP}.map --scen {MAP}-random-1.scen --agents 20 --planner {plugin}"
        ));
    }
    next.push(format!(
        "FLEETYARD_PLUGIN_PATH={beside} fleetyard plugins list"
    ));
    out.push_str("next:");
    for line in next {
        let _ = write!(out, "\n  {line}");
    }
    out
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn the_sdks_are_whole() {
        for (folder, files) in [("src", RUST_SDK), ("python/fleetyard", PYTHON_SDK)] {
            let top = Path::new(env!("CARGO_MANIFEST_DIR"))
                .join("../../abi")
                .join(folder);
            let (mut there, mut folders) = (BTreeSet::new(), vec![top.clone()]);
            while let Some(folder) = folders.pop() {
                for entry in fs::read_dir(folder).unwrap() {
                    let path = entry.unwrap().path();
                    if path.ends_with("__pycache__") {
                        continue;
                    }
                    if path.is_dir() {
                        folders.push(path);
                    } else {
                        let name = path.strip_prefix(&top).unwrap();
                        there.insert(name.to_str().unwrap().to_owned());
                    }
                }
            }
            let here = files.iter().map(|(name, _)| (*name).to_owned()).collect();
            assert_eq!(there, here);
        }
    }

    #[test]
    fn names_are_given_to_files_and_code() {
        let odd = Name::new("my-example_plugin", Lang::C).unwrap();
        assert_eq!(odd.put("<example-plugin>"), "<my-example_plugin>");
        let name = Name::new("My-Planner_2", Lang::Rust).unwrap();
        assert_eq!((&*name.id, &*name.module), ("my-planner_2", "my_planner_2"));
        assert_eq!(
            name.put("class ExamplePlugin(Planner):"),
            "class MyPlanner2(Planner):"
        );
        assert_eq!(
            name.put("example_plugin.c is example-plugin"),
            "my_planner_2.c is my-planner_2"
        );
    }
}

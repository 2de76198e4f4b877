//! The viewer's modules in `web/`: as files for a server, and joined into the one script of a page
//! that loads nothing.

use std::fmt::Write as _;

const SCRIPT: &str = "text/javascript; charset=utf-8";
const STYLE: &str = "text/css; charset=utf-8";

macro_rules! files {
    ($($name:literal $kind:ident),* $(,)?) => {
        &[$(($name, include_bytes!(concat!("../web/", $name)).as_slice(), $kind)),*]
    };
}

const FILES: &[(&str, &[u8], &str)] = files![
    "annotations.js" SCRIPT,
    "base64.js" SCRIPT,
    "bodies-gl.js" SCRIPT,
    "bodies-pen.js" SCRIPT,
    "bodies.js" SCRIPT,
    "cells.js" SCRIPT,
    "clip.js" SCRIPT,
    "clock.js" SCRIPT,
    "contacts.js" SCRIPT,
    "dom.js" SCRIPT,
    "emitter.js" SCRIPT,
    "fleet.js" SCRIPT,
    "frames.js" SCRIPT,
    "heat.js" SCRIPT,
    "map.js" SCRIPT,
    "motion.js" SCRIPT,
    "overlays.js" SCRIPT,
    "recording.js" SCRIPT,
    "scene.js" SCRIPT,
    "shell.css" STYLE,
    "stage.js" SCRIPT,
    "theme.js" SCRIPT,
    "timeline.js" SCRIPT,
    "viewer.css" STYLE,
    "work.js" SCRIPT,
];

/// Name, bytes and media type of each file of the viewer. Modules import each other by `./NAME`.
pub fn web() -> &'static [(&'static str, &'static [u8], &'static str)] {
    FILES
}

/// The text of a module of the viewer.
fn module(name: &str) -> &'static str {
    let file = web().iter().find(|(known, ..)| *known == name);
    let (_, bytes, _) = file.unwrap_or_else(|| panic!("the viewer has no {name}"));
    std::str::from_utf8(bytes).expect("modules are UTF-8")
}

/// A script that needs no other file: a main module and all modules of the viewer that it imports, each as a function
/// that returns what it exports.
///
/// Modules that can be joined import by `import { a, b } from './NAME.js';` on one line, and declare what they
/// export by `export` before `const`, `class`, `function` or `async function`.
///
/// # Panics
///
/// If a module imports or exports otherwise, or imports what is no module of the viewer.
pub fn joined(main: &str) -> String {
    let mut script = String::from("'use strict';\n");
    let mut done = Vec::new();
    append(&mut script, &mut done, "main", main);
    script
}

/// Appends a module after those that it imports.
fn append(script: &mut String, done: &mut Vec<String>, name: &str, text: &str) {
    let (mut body, mut exports) = (String::new(), Vec::new());
    for line in text.lines() {
        if let Some(rest) = line.strip_prefix("import ") {
            let (names, from) = import(rest).unwrap_or_else(|| panic!("{name}: `{line}`"));
            if !done.iter().any(|known| known == from) {
                done.push(from.to_owned());
                append(script, done, from, module(from));
            }
            let _ = writeln!(body, "const {names} = {};", variable(from));
        } else if let Some(rest) = line.strip_prefix("export ") {
            exports.push(exported(rest).unwrap_or_else(|| panic!("{name}: `{line}`")));
            body.push_str(rest);
            body.push('\n');
        } else {
            body.push_str(line);
            body.push('\n');
        }
    }
    let _ = writeln!(
        script,
        "// ==== {name}\nconst {} = (() => {{\n{body}return {{ {} }};\n}})();",
        variable(name),
        exports.join(", ")
    );
}

/// The names in braces, and the file that they come from.
fn import(rest: &str) -> Option<(&str, &str)> {
    let (names, from) = rest.split_once(" from './")?;
    let from = from.strip_suffix("';")?;
    let is_plain = names.starts_with("{ ") && names.ends_with(" }") && !names.contains(" as ");
    is_plain.then_some((names, from))
}

/// The name that a declaration gives.
fn exported(rest: &str) -> Option<&str> {
    let kinds = ["const ", "class ", "async function ", "function "];
    let rest = kinds.iter().find_map(|kind| rest.strip_prefix(kind))?;
    let end = rest.find(|c: char| !c.is_ascii_alphanumeric() && c != '_' && c != '$')?;
    (end > 0).then_some(&rest[..end])
}

/// The variable that holds a module's exports.
fn variable(name: &str) -> String {
    let stem = name.strip_suffix(".js").unwrap_or(name);
    format!("$${}", stem.replace('-', "_"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_module_can_be_joined_and_is_listed() {
        let mut listed: Vec<_> = web().iter().map(|(name, ..)| (*name).to_owned()).collect();
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("web");
        let mut there: Vec<_> = std::fs::read_dir(folder)
            .unwrap()
            .map(|file| file.unwrap().file_name().into_string().unwrap())
            .filter(|name| !name.starts_with("replay."))
            .collect();
        listed.sort();
        there.sort();
        assert_eq!(listed, there);
        for (name, bytes, kind) in web() {
            if *kind != SCRIPT {
                continue;
            }
            let script = joined(std::str::from_utf8(bytes).unwrap());
            assert!(
                !script.contains("\nimport ") && !script.contains("\nexport "),
                "{name}"
            );
            assert!(
                !script.contains("</script") && !script.contains('\r'),
                "{name}"
            );
        }
    }

    /// A module that imports one that is not done yet would find nothing there.
    #[test]
    fn no_module_imports_itself_by_way_of_others() {
        fn walk(name: &str, above: &mut Vec<String>) {
            assert!(!above.iter().any(|other| other == name), "{above:?} {name}");
            above.push(name.to_owned());
            for line in module(name).lines() {
                if let Some((_, from)) = line.strip_prefix("import ").and_then(import) {
                    walk(from, above);
                }
            }
            above.pop();
        }
        for (name, _, kind) in web() {
            if *kind == SCRIPT {
                walk(name, &mut Vec::new());
            }
        }
    }

    #[test]
    fn a_module_comes_once_and_after_what_it_imports() {
        let script = joined(
            "import { $ } from './dom.js';\nimport { Stage } from './stage.js';\nnew Stage($);\n",
        );
        assert_eq!(script.matches("// ==== dom.js").count(), 1);
        let at = |what: &str| script.find(what).unwrap();
        assert!(at("// ==== emitter.js") < at("// ==== stage.js"));
        assert!(at("// ==== stage.js") < at("// ==== main"));
        assert!(script.contains("const { Stage } = $$stage;\nnew Stage($);\nreturn {  };"));
    }
}

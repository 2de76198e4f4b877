//! The tutorials of `docs/tutorials` as a reader follows them: every command is run, every
//! change is made, and what the commands print is compared with what the page says.
//!
//! In a page, a `console` block has commands after `$ ` and what they print; `? 2` is an
//! exit code other than 0, and `...` and `[..]` stand for what differs from machine to
//! machine. A `diff` block changes the file that its first line names, and a block whose
//! first line goes on with a name after the language is a new file.
//! `SNAPSHOTS=overwrite cargo test -p fleetyard --test e2e tutorials::` writes the output anew; look
//! at what becomes of the `...`.

use std::ffi::OsStr;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use fleetyard_testkit::{Yard, have, prepare_package, root, turn_of_packages};
use snapbox::data::DataFormat;
use snapbox::{Assert, Data};

/// Follows a page in a folder of its own, and compares.
fn follow(page: &str, needed: &[&str]) {
    if needed.iter().all(|program| have(program)) {
        // Where plugins are found as everybody's are; as quick to build as can be.
        let yard = Yard::new().with_cargo().set("XDG_DATA_HOME", "");
        follow_in(&yard.set("CFLAGS", "-O0").set("CXXFLAGS", "-O0"), page);
    }
}

fn follow_in(yard: &Yard, page: &str) {
    let path = root().join("docs/tutorials").join(page);
    let text = fs::read_to_string(&path).unwrap();
    let mut followed = String::new();
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        let _ = writeln!(followed, "{line}");
        let Some(info) = line.strip_prefix("```").filter(|info| !info.is_empty()) else {
            continue;
        };
        let block: Vec<&str> = lines.by_ref().take_while(|line| *line != "```").collect();
        match info.split_once(' ') {
            None if info == "console" => {
                for command in block.iter().filter_map(|line| line.strip_prefix("$ ")) {
                    let _ = writeln!(followed, "$ {command}\n{}", run(yard, command));
                    // A blank line here is the end of the output.
                    followed.truncate(followed.trim_end().len());
                    followed.push('\n');
                }
                followed.push_str("```\n");
                continue;
            }
            None if info == "diff" => change(yard, &block),
            Some((_, name)) => {
                yard.write(name, block.join("\n") + "\n");
            }
            None => {}
        }
        let _ = writeln!(followed, "{}\n```", block.join("\n"));
    }
    let expected = Data::read_from(&path, Some(DataFormat::Text));
    Assert::new()
        .action_env("SNAPSHOTS")
        .normalize_paths(false)
        .eq(followed, expected);
}

/// The output of a command, in the order in which it is printed.
fn run(yard: &Yard, command: &str) -> String {
    let ended = yard.shell(&format!("exec 2>&1\n{command}"));
    for folder in fs::read_dir(yard.path(".")).unwrap().flatten() {
        if folder.path().join("Cargo.toml").exists() {
            prepare_package(&folder.path());
        }
    }
    let code = match ended.code {
        Some(0) => String::new(),
        code => format!("? {}\n", code.unwrap_or(-1)),
    };
    code + &ended.stdout
}

/// Makes the change that a diff shows to the file that its first line names.
fn change(yard: &Yard, diff: &[&str]) {
    let name = diff[0].strip_prefix("--- ").expect("a file's name");
    let side = |left_out: char| {
        let mut text = String::new();
        for line in diff[1..].iter().filter(|line| !line.starts_with(left_out)) {
            let _ = writeln!(text, "{}", line.get(1..).unwrap_or_default());
        }
        text
    };
    let (old, new) = (side('+'), side('-'));
    let text = String::from_utf8(yard.read(name)).unwrap();
    assert_eq!(text.matches(&old).count(), 1, "{name} has once:\n{old}");
    yard.write(name, text.replace(&old, &new));
}

#[test]
fn rust() {
    let _turn = turn_of_packages();
    follow("rust.md", &["cargo"]);
}

#[test]
fn c() {
    follow("c.md", &["make", "cc"]);
}

#[test]
fn cpp() {
    follow("cpp.md", &["make", "c++"]);
}

#[test]
fn python() {
    follow("python.md", &["python3"]);
}

#[test]
fn command() {
    follow("command.md", &["python3"]);
}

/// The page's pictures are those that its commands draw.
#[test]
fn three_views() {
    let yard = Yard::new();
    std::os::unix::fs::symlink(root().join("maps"), yard.path("maps")).unwrap();
    follow_in(&yard, "three-views.md");
    for name in ["views-grid.svg", "views-roadmap.svg", "views-plane.svg"] {
        let path = root().join("docs/images").join(name);
        Assert::new().action_env("SNAPSHOTS").eq(
            Data::binary(yard.read(name)),
            Data::read_from(&path, Some(DataFormat::Binary)),
        );
    }
}

/// Lines of code of a file: neither blank nor comment, docstrings included.
fn code_lines(path: &Path) -> usize {
    let extension = path.extension().and_then(OsStr::to_str);
    let (begin, end, rest) = match extension {
        Some("py") => ("\"\"\"", "\"\"\"", "#"),
        Some("toml") => ("#", "", "#"),
        _ => ("/*", "*/", "//"),
    };
    let mut inside = false;
    let mut count = 0;
    for line in fs::read_to_string(path).unwrap().lines().map(str::trim) {
        if inside {
            inside = !line.contains(end);
        } else if let Some(comment) = line.strip_prefix(begin) {
            inside = !comment.contains(end);
        } else if !line.is_empty() && !line.starts_with(rest) {
            count += 1;
        }
    }
    count
}

#[test]
fn lines_of_code_are_as_the_table_says() {
    let templates = root().join("host/cli/templates");
    let kinds = [
        "planner",
        "fail-policy",
        "instance-generator",
        "invocation-policy",
    ];
    let mut table = String::from("| | ");
    table += &kinds.join(" | ");
    table += " |\n| --- | ---: | ---: | ---: | ---: |\n";
    for (lang, extension) in [("python", "py"), ("rust", "rs"), ("cpp", "cpp"), ("c", "c")] {
        let count = |kind| code_lines(&templates.join(lang).join(kind).with_extension(extension));
        let counts = kinds.map(|kind| count(kind).to_string());
        let _ = writeln!(table, "| [{lang}]({lang}.md) | {} |", counts.join(" | "));
    }
    let manifest = code_lines(&templates.join("command/planner.toml"));
    let _ = writeln!(
        table,
        "| [command](command.md), the manifest | {manifest} | | | |"
    );
    let page = fs::read_to_string(root().join("docs/tutorials/README.md")).unwrap();
    assert!(
        page.contains(&table),
        "docs/tutorials/README.md has not:\n{table}"
    );
}

#[test]
fn a_first_plan_takes_fewer_than_twenty_lines_of_python() {
    let page = fs::read_to_string(root().join("docs/tutorials/python.md")).unwrap();
    let (_, rest) = page
        .split_once("```python my-planner/first.py\n")
        .expect("first.py");
    let (code, _) = rest.split_once("```").unwrap();
    let yard = Yard::new();
    let lines = code_lines(&yard.write("first.py", code));
    assert!(lines < 20, "{lines} lines");
}

use std::fs::Permissions;
use std::os::unix::fs::PermissionsExt;

use super::*;
use crate::sessions::adapter::declared;

fn granted(path: &str, owner: Option<u32>) -> Grant {
    Grant {
        path: path.into(),
        owner,
        entries: false,
    }
}

#[test]
fn children_go_with_their_parents() {
    let paths = [
        "/usr/lib",
        "/usr",
        "/usr",
        "relative",
        "/does/not/exist",
        "/etc/passwd",
    ];
    let kept = tidy(paths.map(|path| granted(path, None)).to_vec());
    let kept: Vec<PathBuf> = kept.into_iter().map(|grant| grant.path).collect();
    assert_eq!(kept, ["/etc/passwd", "/usr"].map(PathBuf::from));
    // But for those whose files are shown as somebody else's.
    let kept = tidy(vec![granted("/usr", None), granted("/usr/lib", Some(7))]);
    assert_eq!(kept.len(), 2);
}

#[test]
fn a_script_names_its_interpreter() {
    let folder = tempfile::tempdir().unwrap();
    let script = folder.path().join("script");
    let sh = find_program("sh");
    for (line, expected) in [
        ("#!/bin/sh -e\n", Some((PathBuf::from("/bin/sh"), false))),
        ("#!/usr/bin/env -S sh\n", sh.map(|sh| (sh, true))),
        ("#!/usr/bin/env ./sh\n", None),
        ("#!sh\n", None),
        ("#!\n", None),
        ("\u{7f}ELF", None),
        ("", None),
    ] {
        fs::write(&script, line).unwrap();
        let found = interpreter(&script).map(|found| (found.program, found.searched));
        assert_eq!(found, expected, "{line}");
    }
}

#[test]
fn a_pipe_in_the_place_of_a_file_does_not_make_the_host_wait() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("pipe");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status();
    if !made.is_ok_and(|status| status.success()) {
        eprintln!("skipped: there is no mkfifo");
        return;
    }
    assert_eq!(interpreter(&pipe), None);
}

#[test]
fn a_home_is_never_granted_whole() {
    for folder in ["/", "/home", "/home/alice", "/tmp", "/etc", "/srv"] {
        assert!(is_too_wide(Path::new(folder)), "{folder}");
    }
    assert!(!is_too_wide(Path::new("/srv/planners")));
    let alone = Path::new("/tmp/planner.so");
    assert_eq!(own(alone), [alone]);
    let folder = own(Path::new("/srv/planners/a.so"));
    assert_eq!(folder, [Path::new("/srv/planners")]);
}

/// A folder with files of these modes.
fn folder_with(files: &[(&str, u32)]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::set_permissions(folder.path(), Permissions::from_mode(0o755)).unwrap();
    for (name, mode) in files {
        let path = folder.path().join(name);
        let parent = path.parent().unwrap();
        fs::create_dir_all(parent).unwrap();
        fs::set_permissions(parent, Permissions::from_mode(0o755)).unwrap();
        fs::write(&path, name).unwrap();
        fs::set_permissions(&path, Permissions::from_mode(*mode)).unwrap();
    }
    folder
}

fn names(grants: &Grants, folder: &Path) -> Vec<String> {
    let inside = grants
        .read
        .iter()
        .filter_map(|path| path.strip_prefix(folder).ok());
    inside.map(|path| path.display().to_string()).collect()
}

#[test]
fn what_the_host_reads_and_writes_is_left_out_wherever_it_lies() {
    let folder = folder_with(&[
        ("planner.so", 0o644),
        ("libhelp.so", 0o644),
        ("data/weights", 0o644),
        ("data/easy.scen", 0o644),
        ("results.db", 0o644),
        ("results.db-wal", 0o644),
        (".results.db.7-0.tmp", 0o644),
        (".git/config", 0o644),
    ]);
    let policy = Policy {
        hidden: vec![
            folder.path().join("results.db"),
            folder.path().join("data/../data/easy.scen"),
            folder.path().join("planner"),
        ],
        ..Policy::default()
    };
    let target = Target::Library(folder.path().join("planner.so"));
    let grants = Grants::new(&target, &policy, 1, None, declared).unwrap();
    let granted = names(&grants, folder.path());
    assert_eq!(granted, ["data/weights", "libhelp.so", "planner.so"]);
    assert_eq!(grants.list.len(), 2);
    assert!(!grants.has(&folder.path().join("data/easy.scen")));
}

#[test]
fn what_is_closed_to_others_stays_closed_beside_a_plugin_that_is_not() {
    let folder = folder_with(&[("open.so", 0o644), ("closed.so", 0o600), ("mine", 0o644)]);
    let granted = |name: &str| {
        let target = Target::Library(folder.path().join(name));
        let grants = Grants::new(&target, &Policy::default(), 1, None, declared).unwrap();
        let mut owners = grants.owners.keys();
        let owned = owners.any(|path| path.starts_with(folder.path()));
        (names(&grants, folder.path()), owned)
    };
    let open = vec!["mine".to_owned(), "open.so".to_owned()];
    assert_eq!(granted("open.so"), (open, false));
    // A plugin that is closed itself is one with what is closed beside it.
    assert_eq!(granted("closed.so"), (vec![String::new()], true));
}

#[test]
fn a_first_line_grants_nothing_but_what_others_may_read() {
    let teams = folder_with(&[
        ("a/planner", 0o755),
        ("b/secret", 0o600),
        ("b/planner", 0o755),
        ("b/notes", 0o644),
        ("closed/planner", 0o755),
        ("python/bin/python3", 0o755),
        ("python/lib/python3.9/os.py", 0o644),
        ("python/lib/python3.9/closed.py", 0o600),
        ("python/notes", 0o644),
    ]);
    let path = |name: &str| teams.path().join(name);
    fs::set_permissions(path("closed"), Permissions::from_mode(0o700)).unwrap();
    let granted = |named: &str| {
        let line = format!("#!{}\n", path(named).display());
        fs::write(path("a/planner"), line).unwrap();
        let target = Target::Program(vec![path("a/planner").display().to_string()]);
        let grants = Grants::new(&target, &Policy::default(), 1, None, declared).unwrap();
        (names(&grants, teams.path()), grants.withheld)
    };
    // No program, and so nothing at all; not its folder either.
    assert_eq!(granted("b/secret").0, ["a"]);
    assert_eq!(granted("b/notes").0, ["a"]);
    assert_eq!(granted("b/planner").0, ["a", "b/planner"]);
    let (read, withheld) = granted("closed/planner");
    assert_eq!(
        (read, withheld),
        (vec!["a".into()], vec![path("closed/planner")])
    );
    // Of an installation what belongs to it.
    let (read, _) = granted("python/bin/python3");
    assert_eq!(read, ["a", "python/bin", "python/lib/python3.9/os.py"]);
}

//! `plugins/faulty/README.md` lists what each of the faulty plugins can be asked to do wrong.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use fleetyard_testkit::{
    SUCCESS, Yard, faulty_cpp_library, faulty_library, faulty_program, faulty_rust_library, have,
    root,
};

/// Faults that the options of each plugin of a file name, with the plugin's kind.
fn faults(plugin: &Path) -> Vec<(String, Vec<String>)> {
    let line = format!("plugins info {} --format json", plugin.display());
    let plugins = Yard::new().line(&line).expect(SUCCESS).json();
    let plugins = plugins.as_array().unwrap().iter().map(|plugin| {
        let faults = &plugin["options_schema"]["properties"]["fault"]["enum"];
        let faults = faults.as_array().unwrap().iter();
        let names = faults.map(|fault| fault.as_str().unwrap().to_owned());
        let names = names.filter(|fault| fault != "none").collect();
        (plugin["kind"].as_str().unwrap().to_owned(), names)
    });
    plugins.collect()
}

/// The lists of `plugins/faulty/README.md`: faults by the groups of `mischief.h`, after the
/// letters of the plugins that have them.
fn listed_faults(cpp: &Path) -> String {
    let plugins = [
        ('c', faulty_library()),
        ('p', faulty_program()),
        ('r', faulty_rust_library()),
        ('x', cpp.to_owned()),
    ];
    let mut by: Vec<(String, String)> = Vec::new();
    for (letter, plugin) in plugins {
        for fault in faults(&plugin).remove(0).1 {
            match by.iter_mut().find(|(known, _)| *known == fault) {
                Some((_, letters)) => letters.push(letter),
                None => by.push((fault, letter.into())),
            }
        }
    }
    let header = fs::read_to_string(root().join("plugins/faulty/mischief.h")).unwrap();
    let (_, list) = header.split_once("#define MISCHIEF(F)").unwrap();
    let (list, _) = list.split_once("\n\n").unwrap();
    let mut groups = vec![("plans, answers, and of one language", Vec::new())];
    for group in list.split("/* ").skip(1) {
        let (name, faults) = group.split_once(" */").unwrap();
        groups.push((name, faults.split('"').skip(1).step_by(2).collect()));
    }
    let mut out = String::new();
    for (name, faults) in &groups {
        let listed = |fault: &str| groups.iter().any(|(_, all)| all.contains(&fault));
        let here = by.iter().filter(|(fault, _)| {
            faults.contains(&fault.as_str()) || (faults.is_empty() && !listed(fault))
        });
        let mut by_letters: Vec<(&str, Vec<String>)> = Vec::new();
        for (fault, by) in here {
            let fault = format!("`{fault}`");
            match by_letters.iter_mut().find(|(letters, _)| letters == by) {
                Some((_, faults)) => faults.push(fault),
                None => by_letters.push((by, vec![fault])),
            }
        }
        let shown = by_letters
            .iter()
            .map(|(letters, faults)| format!("{letters} {}", faults.join(", ")));
        let shown: Vec<String> = shown.collect();
        let _ = writeln!(out, "- **{name}**: {}", shown.join("; "));
    }
    let mut modules = faults(&root().join("plugins/faulty/fleet.py"));
    modules.dedup();
    for (kind, faults) in modules {
        let shown: Vec<String> = faults.iter().map(|fault| format!("`{fault}`")).collect();
        let _ = writeln!(out, "- **{kind}** of `fleet.py`: {}", shown.join(", "));
    }
    out
}

#[test]
fn the_page_of_faulty_plugins_lists_every_fault() {
    let Some(cpp) = faulty_cpp_library().filter(|_| have("python3")) else {
        return;
    };
    let path = root().join("plugins/faulty/README.md");
    let page = fs::read_to_string(&path).unwrap();
    let (begin, end) = ("<!-- generated: faults -->\n\n", "\n<!-- end -->");
    let (before, rest) = page.split_once(begin).unwrap();
    let (_, after) = rest.split_once(end).unwrap();
    let made = format!("{before}{begin}{}{end}{after}", listed_faults(&cpp));
    if std::env::var_os("FLEETYARD_UPDATE").is_some() {
        fs::write(&path, &made).unwrap();
        return;
    }
    assert!(
        page == made,
        "plugins/faulty/README.md is made anew by \
         `FLEETYARD_UPDATE=1 cargo test -p fleetyard --test e2e faulty_page::`"
    );
}

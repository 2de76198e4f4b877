//! The report as Markdown, with the numbers of the page and links to the figures.

use std::fmt::Write as _;

use fleetyard_core::is_unseen;

use super::{Figure, Table};

/// Text that Markdown and the HTML in it take for nothing else.
fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '\\' | '`' | '*' | '_' | '[' | ']' | '|' | '#' | '~' | '$' => out.extend(['\\', c]),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '&' => out.push_str("&amp;"),
            c if is_unseen(c) => out.push(' '),
            c => out.push(c),
        }
    }
    out
}

pub(super) fn paragraphs(out: &mut String, title: &str, story: &[String], caveats: &[String]) {
    let _ = writeln!(out, "# {}\n", escaped(title));
    for paragraph in story {
        let _ = writeln!(out, "{}\n", escaped(paragraph));
    }
    list(out, caveats);
}

pub(super) fn list(out: &mut String, entries: &[String]) {
    for entry in entries {
        let _ = writeln!(out, "- {}", escaped(entry));
    }
    if !entries.is_empty() {
        out.push('\n');
    }
}

pub(super) fn section(out: &mut String, title: &str) {
    let _ = writeln!(out, "## {title}\n");
}

pub(super) fn table(out: &mut String, table: &Table) {
    section(out, &escaped(&table.title));
    if !table.note.is_empty() {
        let _ = writeln!(out, "{}\n", escaped(&table.note));
    }
    let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
    let head: Vec<String> = table.head.iter().map(|cell| escaped(cell)).collect();
    let rule = table.words.iter().map(|words| match words {
        true => "---".to_owned(),
        false => "---:".to_owned(),
    });
    out.push_str(&line(&head));
    out.push_str(&line(&rule.collect::<Vec<_>>()));
    for row in &table.rows {
        let cells: Vec<String> = row.iter().map(|cell| escaped(cell)).collect();
        out.push_str(&line(&cells));
    }
    out.push('\n');
}

/// The figures, which are files in a folder.
pub(super) fn figures(out: &mut String, figures: &[Figure], folder: &str) {
    section(out, "Figures");
    // Blanks and brackets would end the link.
    let folder: String = folder
        .bytes()
        .map(|byte| match byte {
            b'0'..=b'9' | b'A'..=b'Z' | b'a'..=b'z' | b'.' | b'-' | b'_' | b'/' => {
                char::from(byte).to_string()
            }
            byte => format!("%{byte:02X}"),
        })
        .collect();
    for figure in figures {
        let title = escaped(&figure.title);
        let _ = writeln!(out, "![{title}]({folder}/{}.svg)\n", figure.id);
        let _ = writeln!(out, "{title}. {}\n", escaped(&figure.caption));
    }
}

pub(super) fn facts(out: &mut String, facts: &[(String, String)]) {
    section(out, "Origin");
    for (name, value) in facts {
        let _ = writeln!(out, "- {}: {}", escaped(name), escaped(value));
    }
    out.push('\n');
}

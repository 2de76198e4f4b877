//! Printing: data on standard output, the rest on standard error.

use std::io::{self, IsTerminal, Write};

use comfy_table::presets::NOTHING;
use comfy_table::{CellAlignment, Table};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

use crate::exit::{Result, internal};

/// Prints text and a newline. A reader that went away is not an error.
pub(crate) fn print(text: &str) -> Result<()> {
    let mut out = io::stdout().lock();
    match out
        .write_all(text.as_bytes())
        .and_then(|()| out.write_all(b"\n"))
        .and_then(|()| out.flush())
    {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(internal(error)),
        _ => Ok(()),
    }
}

/// Text that may come from a plugin or a file, safe for a terminal: control
/// characters other than line ends and tabs are shown, not obeyed.
pub(crate) fn plain(text: &str) -> String {
    let obeyed = |c: char| c.is_control() && c != '\n' && c != '\t';
    if !text.contains(obeyed) {
        return text.to_owned();
    }
    let shown = |c: char| {
        if obeyed(c) {
            c.escape_default().to_string()
        } else {
            c.to_string()
        }
    };
    text.chars().map(shown).collect()
}

/// Prints a JSON document.
pub(crate) fn print_json<T: Serialize>(value: &T) -> Result<()> {
    print(&serde_json::to_string_pretty(value).map_err(internal)?)
}

/// A note for people: on standard error, one line.
pub(crate) fn note(text: &str) {
    eprintln!("note: {}", plain(text));
}

/// What to do about an error: on standard error, one line.
pub(crate) fn hint(text: &str) {
    eprintln!("hint: {}", plain(text));
}

/// Why the command fails although it has a result to print.
pub(crate) fn error(text: &str) {
    eprintln!("error: {}", plain(text));
}

/// A warning for people.
pub(crate) fn warning(text: &str) {
    eprintln!("warning: {}", plain(text));
}

/// A plain table: readable without colour and easy to cut apart. Columns whose
/// index is in `numbers` are aligned to the right.
pub(crate) fn table(header: &[&str], rows: Vec<Vec<String>>, numbers: &[usize]) -> String {
    let mut table = Table::new();
    table.load_style(NOTHING).set_header(header.to_vec());
    table.add_rows(rows);
    for (index, column) in table.column_iter_mut().enumerate() {
        column.set_padding((0, 2));
        if numbers.contains(&index) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    let lines: Vec<String> = table
        .lines()
        .map(|line| line.trim_end().to_owned())
        .collect();
    lines.join("\n")
}

/// A progress bar of trials when standard error is a terminal.
pub(crate) fn progress(total: u64) -> ProgressBar {
    bar(
        total,
        "{bar:30} {pos}/{len} trials, {elapsed} elapsed, {eta} left  {msg}",
    )
}

/// A progress bar that looks like `template`, when standard error is a terminal.
pub(crate) fn bar(total: u64, template: &str) -> ProgressBar {
    if !io::stderr().is_terminal() || std::env::var_os("NO_COLOR").is_some() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(total);
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    bar
}

/// The same for work whose end is not known.
pub(crate) fn spinner() -> ProgressBar {
    if !io::stderr().is_terminal() || std::env::var_os("NO_COLOR").is_some() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new_spinner();
    if let Ok(style) = ProgressStyle::with_template("{spinner} {msg}, {elapsed} elapsed") {
        bar.set_style(style);
    }
    bar
}

#[cfg(test)]
mod tests {
    use super::plain;

    #[test]
    fn control_characters_are_shown() {
        assert_eq!(plain("a\tb\nc"), "a\tb\nc");
        assert_eq!(
            plain("\u{1b}[2Jgone\u{9b}1m\r"),
            "\\u{1b}[2Jgone\\u{9b}1m\\r"
        );
    }
}

//! Printing: data on standard output, the rest on standard error.

use std::fmt::{Display, Write as _};
use std::io::{self, IsTerminal, Write};
use std::time::Duration;

use comfy_table::presets::NOTHING;
use comfy_table::{CellAlignment, Table};
use fleetyard_bench::Left;
use fleetyard_core::{is_unseen, one_line};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

use crate::exit::{Result, internal};

/// Time between two moves of a spinner.
const TICK: Duration = Duration::from_millis(200);

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

/// Text that may come from a plugin or a file, safe for a terminal: characters that it would
/// obey, or that change how others look, are shown; line ends and tabs are let through.
pub(crate) fn plain(text: &str) -> String {
    let obeyed = |c: char| is_unseen(c) && c != '\n' && c != '\t';
    if !text.contains(obeyed) {
        return text.to_owned();
    }
    let shown = |c: char| match c {
        '\r' => "\\r".to_owned(),
        c if obeyed(c) => c.escape_unicode().to_string(),
        c => c.to_string(),
    };
    text.chars().map(shown).collect()
}

/// Prints a JSON document. What a terminal would obey is written by its number, which is
/// the same document.
pub(crate) fn print_json<T: Serialize>(value: &T) -> Result<()> {
    let text = serde_json::to_string_pretty(value).map_err(internal)?;
    print(&plain_json(&text))
}

/// The same as a single line.
pub(crate) fn print_json_line<T: Serialize>(value: &T) -> Result<()> {
    let text = serde_json::to_string(value).map_err(internal)?;
    print(&plain_json(&text))
}

fn plain_json(text: &str) -> String {
    let obeyed = |c: char| is_unseen(c) && c != '\n';
    if !text.contains(obeyed) {
        return text.to_owned();
    }
    let mut shown = String::with_capacity(text.len());
    for c in text.chars() {
        if obeyed(c) {
            let mut units = [0; 2];
            for unit in c.encode_utf16(&mut units) {
                // Writing to a string cannot fail.
                let _ = write!(shown, "\\u{unit:04x}");
            }
        } else {
            shown.push(c);
        }
    }
    shown
}

/// A note for people: on standard error, one line.
pub(crate) fn note(text: &str) {
    eprintln!("note: {}", plain(text));
}

/// Prints a way out of an error: on standard error, one line.
pub(crate) fn hint(text: &str) {
    eprintln!("hint: {}", plain(text));
}

/// Prints the reason why the command fails although it has a result to print.
pub(crate) fn error(text: &str) {
    eprintln!("error: {}", plain(text));
}

/// A warning for people.
pub(crate) fn warning(text: &str) {
    eprintln!("warning: {}", plain(text));
}

/// Appends a line of a label and a value, below those of other lines.
pub(crate) fn labelled(text: &mut String, label: &str, value: impl Display) {
    // Writing to a string cannot fail.
    let _ = writeln!(text, "{label:<17} {}", one_line(&value.to_string()));
}

/// A plain table: readable without colour and easy to cut apart. Columns whose
/// index is in `numbers` are aligned to the right.
pub(crate) fn table(header: &[&str], rows: Vec<Vec<String>>, numbers: &[usize]) -> String {
    let mut table = Table::new();
    table.load_style(NOTHING).set_header(header.to_vec());
    let one_lined = |row: Vec<String>| row.into_iter().map(|cell| one_line(&cell).into_owned());
    table.add_rows(
        rows.into_iter()
            .map(|row| one_lined(row).collect::<Vec<_>>()),
    );
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
pub(crate) fn trials(total: u64) -> ProgressBar {
    bar(
        total,
        "{bar:30} {pos}/{len} trials, {elapsed} elapsed  {msg}",
    )
}

/// The text beside a bar of trials: the time that the rest takes, once that is known.
pub(crate) fn with_left(left: Option<Left>, what: &str) -> String {
    match left {
        Some(left) => plain(&format!("{left}, {what}")),
        None => plain(what),
    }
}

/// A progress bar that looks like `template`, when standard error is a terminal.
pub(crate) fn bar(total: u64, template: &str) -> ProgressBar {
    shown(|| ProgressBar::new(total), template)
}

/// The same of bytes that are read.
pub(crate) fn bytes(total: u64) -> ProgressBar {
    bar(
        total,
        "{bar:30} {bytes}/{total_bytes} read, {elapsed} elapsed",
    )
}

/// The same for work whose end is not known. It moves by itself.
pub(crate) fn spinner(what: &str) -> ProgressBar {
    let bar = shown(
        ProgressBar::new_spinner,
        "{spinner} {msg}, {elapsed} elapsed",
    );
    if !bar.is_hidden() {
        bar.set_message(plain(what));
        bar.tick();
        bar.enable_steady_tick(TICK);
    }
    bar
}

fn shown(make: impl FnOnce() -> ProgressBar, template: &str) -> ProgressBar {
    if !io::stderr().is_terminal() || std::env::var_os("NO_COLOR").is_some() {
        return ProgressBar::hidden();
    }
    let bar = make();
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    bar
}

#[cfg(test)]
mod tests {
    use super::{plain, plain_json};

    #[test]
    fn control_characters_are_shown() {
        assert_eq!(plain("a\tb\nc"), "a\tb\nc");
        assert_eq!(
            plain("\u{1b}[2Jgone\u{9b}1m\r"),
            "\\u{1b}[2Jgone\\u{9b}1m\\r"
        );
    }

    #[test]
    fn text_cannot_turn_its_direction_or_hide_a_part() {
        assert_eq!(
            plain("best\u{202e}tsrow\u{2066}\u{200b}\u{2028}\u{e0041}"),
            "best\\u{202e}tsrow\\u{2066}\\u{200b}\\u{2028}\\u{e0041}"
        );
        assert_eq!(plain("Größe 中 🤖"), "Größe 中 🤖");
        let json = "{\n  \"name\": \"a\u{202e}b\u{9b}c\u{e0041}\"\n}";
        let shown = plain_json(json);
        assert!(shown.contains("a\\u202eb\\u009bc\\udb40\\udc41"), "{shown}");
        let read = |text: &str| serde_json::from_str::<serde_json::Value>(text).unwrap();
        assert_eq!(read(&shown), read(json));
    }
}

//! Arguments with placeholders: `{map}`, `{seconds}`, `{option.NAME}`.
//!
//! A template is one argument: nothing in a value can split it into two, and no
//! shell sees it. `{{` and `}}` stand for braces.

use std::ffi::OsString;

use super::document::shown;
use crate::options::nearest;

/// What a placeholder stands for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Slot {
    /// The map file.
    Map,
    /// The scenario file.
    Scen,
    /// The number of agents.
    Agents,
    /// Seconds that the solver may take.
    Seconds,
    /// The same in whole seconds, at least one.
    WholeSeconds,
    /// The same in whole milliseconds.
    Milliseconds,
    /// The seed.
    Seed,
    /// The lowest 31 bits of the seed.
    Seed31,
    /// Threads.
    Threads,
    /// The memory limit in MiB, 0 for none.
    MemoryMb,
    /// The node limit, 0 for none.
    Nodes,
    /// The file for the answer.
    Output,
    /// A folder of the call's own.
    Scratch,
    /// The manifest's folder.
    ManifestDir,
    /// An option's value.
    Option(String),
}

/// Every placeholder but those of options.
const SLOTS: [(&str, Slot); 14] = [
    ("map", Slot::Map),
    ("scen", Slot::Scen),
    ("agents", Slot::Agents),
    ("seconds", Slot::Seconds),
    ("whole_seconds", Slot::WholeSeconds),
    ("milliseconds", Slot::Milliseconds),
    ("seed", Slot::Seed),
    ("seed31", Slot::Seed31),
    ("threads", Slot::Threads),
    ("memory_mb", Slot::MemoryMb),
    ("nodes", Slot::Nodes),
    ("output", Slot::Output),
    ("scratch", Slot::Scratch),
    ("manifest_dir", Slot::ManifestDir),
];

#[derive(Debug, Clone, PartialEq, Eq)]
enum Piece {
    Text(String),
    Slot(Slot),
}

/// An argument with placeholders.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Template {
    pieces: Vec<Piece>,
}

/// Why a text is no template, and what to do about it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct TemplateError {
    pub(super) reason: String,
    pub(super) hint: String,
}

impl Template {
    /// Reads a template; `options` are the names of the planner's options.
    pub(super) fn parse(text: &str, options: &[&str]) -> Result<Self, TemplateError> {
        let pieces = pieces(text)?
            .into_iter()
            .map(|piece| match piece {
                Ok(text) => Ok(Piece::Text(text)),
                Err(name) => slot(&name, options).map(Piece::Slot),
            })
            .collect::<Result<_, _>>()?;
        Ok(Self { pieces })
    }

    /// Its placeholders.
    pub(super) fn slots(&self) -> impl Iterator<Item = &Slot> {
        self.pieces.iter().filter_map(|piece| match piece {
            Piece::Slot(slot) => Some(slot),
            Piece::Text(_) => None,
        })
    }

    /// The argument.
    pub(super) fn render(&self, mut value: impl FnMut(&Slot) -> OsString) -> OsString {
        let mut rendered = OsString::new();
        for piece in &self.pieces {
            match piece {
                Piece::Text(text) => rendered.push(text),
                Piece::Slot(slot) => rendered.push(value(slot)),
            }
        }
        rendered
    }
}

fn slot(name: &str, options: &[&str]) -> Result<Slot, TemplateError> {
    if let Some(option) = name.strip_prefix("option.") {
        if options.contains(&option) {
            return Ok(Slot::Option(option.to_owned()));
        }
        let known: Vec<String> = options.iter().map(ToString::to_string).collect();
        return Err(TemplateError {
            reason: format!("there is no option `{}`", shown(option)),
            hint: match nearest(option, known.iter(), 3) {
                Some(near) => format!("did you mean `{{option.{near}}}`?"),
                None => format!("add a table [options.{}]", shown(option)),
            },
        });
    }
    let found = SLOTS.iter().find(|(known, _)| *known == name);
    found.map(|(_, slot)| slot.clone()).ok_or_else(|| {
        let known: Vec<String> = SLOTS.iter().map(|(name, _)| (*name).to_owned()).collect();
        TemplateError {
            reason: format!("unknown placeholder `{{{}}}`", shown(name)),
            hint: match nearest(name, known.iter(), 2) {
                Some(near) => format!("did you mean `{{{near}}}`?"),
                None => format!(
                    "known placeholders: {{{}}} and {{option.NAME}}; write {{{{ for a brace",
                    known.join("}, {")
                ),
            },
        }
    })
}

/// Splits a text with placeholders: `Ok` is literal text, `Err` a name in braces.
pub(super) fn pieces(text: &str) -> Result<Vec<Result<String, String>>, TemplateError> {
    let mut pieces = Vec::new();
    let mut literal = String::new();
    let mut rest = text;
    while let Some(at) = rest.find(['{', '}']) {
        literal.push_str(&rest[..at]);
        let brace = &rest[at..=at];
        rest = &rest[at + 1..];
        if let Some(after) = rest.strip_prefix(brace) {
            literal.push_str(brace);
            rest = after;
            continue;
        }
        let end = rest
            .find(['{', '}'])
            .filter(|end| brace == "{" && rest[*end..].starts_with('}'));
        let Some(end) = end else {
            return Err(TemplateError {
                reason: format!("a single `{brace}` in \"{}\"", shown(text)),
                hint: format!("write {brace}{brace} for a brace, and {{name}} for a placeholder"),
            });
        };
        if !literal.is_empty() {
            pieces.push(Ok(std::mem::take(&mut literal)));
        }
        pieces.push(Err(rest[..end].to_owned()));
        rest = &rest[end + 1..];
    }
    literal.push_str(rest);
    if !literal.is_empty() {
        pieces.push(Ok(literal));
    }
    Ok(pieces)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn value(slot: &Slot) -> OsString {
        match slot {
            Slot::Map => "/tmp/the map.map".into(),
            Slot::Seconds => "9.5".into(),
            Slot::Option(name) => format!("<{name}>").into(),
            other => format!("{other:?}").into(),
        }
    }

    #[test]
    fn placeholders_are_filled_in() {
        let cases = [
            ("", ""),
            ("-m", "-m"),
            ("{map}", "/tmp/the map.map"),
            ("--time={seconds}s", "--time=9.5s"),
            ("{option.mode}{option.mode}", "<mode><mode>"),
            ("{{map}}", "{map}"),
            ("{{{map}}}", "{/tmp/the map.map}"),
            ("}}{{", "}{"),
            ("{seed31}/{memory_mb}", "Seed31/MemoryMb"),
        ];
        for (text, expected) in cases {
            let template = Template::parse(text, &["mode"]).expect(text);
            assert_eq!(template.render(value), OsString::from(expected), "{text}");
        }
    }

    #[test]
    fn faults_say_what_to_write() {
        let cases = [
            (
                "{mapp}",
                "unknown placeholder `{mapp}`",
                "did you mean `{map}`?",
            ),
            (
                "{colour}",
                "unknown placeholder `{colour}`",
                "known placeholders: {map}, {scen}",
            ),
            ("{}", "unknown placeholder `{}`", "known placeholders"),
            ("a{b", "a single `{` in \"a{b\"", "write {{"),
            ("a}b", "a single `}` in", "write }}"),
            ("{a{b}", "a single `{` in", "write {{"),
            (
                "{option.mod}",
                "there is no option `mod`",
                "did you mean `{option.mode}`?",
            ),
            (
                "{option.speed}",
                "there is no option `speed`",
                "add a table [options.speed]",
            ),
        ];
        for (text, reason, hint) in cases {
            let error = Template::parse(text, &["mode"]).expect_err(text);
            assert!(error.reason.contains(reason), "{text}: {}", error.reason);
            assert!(error.hint.contains(hint), "{text}: {}", error.hint);
        }
    }

    proptest! {
        /// No text panics, and text with its braces doubled stands for itself.
        #[test]
        fn any_text_is_read(text in "[{}a-z.\\PC]{0,40}") {
            let _ = Template::parse(&text, &["mode"]);
            let escaped = text.replace('{', "{{").replace('}', "}}");
            let template = Template::parse(&escaped, &[]).expect("a literal");
            prop_assert_eq!(template.render(value), OsString::from(text));
        }
    }
}

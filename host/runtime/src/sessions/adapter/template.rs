//! Arguments with placeholders: `{map}`, `{seconds}`, `{option.NAME}`.
//!
//! A template is one argument: nothing in a value can split it into two, and no
//! shell sees it. `{{` and `}}` stand for braces.

use std::ffi::OsString;

use fleetyard_core::formats::{Piece, PieceError, pieces};
use fleetyard_core::{nearest, shown};

/// The value that a placeholder stands for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Slot {
    /// The map file.
    Map,
    /// The scenario file.
    Scen,
    /// The roadmap file.
    Roadmap,
    /// The file of starts and goals on a roadmap.
    Task,
    /// The one file that says all of a problem.
    Problem,
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
const SLOTS: [(&str, Slot); 17] = [
    ("map", Slot::Map),
    ("scen", Slot::Scen),
    ("roadmap", Slot::Roadmap),
    ("task", Slot::Task),
    ("problem", Slot::Problem),
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

impl Slot {
    /// Its name between the braces.
    pub(super) fn name(&self) -> &str {
        let known = SLOTS.iter().find(|(_, slot)| slot == self);
        match (known, self) {
            (Some((name, _)), _) => name,
            (None, Self::Option(name)) => name,
            (None, _) => "",
        }
    }

    /// True for a file that says what to solve.
    pub(super) fn is_problem(&self) -> bool {
        let files = [
            Self::Map,
            Self::Scen,
            Self::Roadmap,
            Self::Task,
            Self::Problem,
        ];
        files.contains(self)
    }
}

#[derive(Debug, Clone, PartialEq, Eq)]
enum Part {
    Text(String),
    Slot(Slot),
}

/// An argument with placeholders.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Template {
    parts: Vec<Part>,
}

/// The reason why a text is no template, and a way out.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct TemplateError {
    pub(super) reason: String,
    pub(super) hint: String,
}

impl From<PieceError> for TemplateError {
    fn from(PieceError { reason, hint }: PieceError) -> Self {
        Self { reason, hint }
    }
}

impl Template {
    /// Reads a template; `options` are the names of the planner's options.
    pub(super) fn parse(text: &str, options: &[&str]) -> Result<Self, TemplateError> {
        let parts = pieces(text)?
            .into_iter()
            .map(|piece| match piece {
                Piece::Text(text) => Ok(Part::Text(text)),
                Piece::Name(name) => slot(&name, options).map(Part::Slot),
            })
            .collect::<Result<_, _>>()?;
        Ok(Self { parts })
    }

    /// Its placeholders.
    pub(super) fn slots(&self) -> impl Iterator<Item = &Slot> {
        self.parts.iter().filter_map(|part| match part {
            Part::Slot(slot) => Some(slot),
            Part::Text(_) => None,
        })
    }

    /// The argument.
    pub(super) fn render(&self, mut value: impl FnMut(&Slot) -> OsString) -> OsString {
        let mut rendered = OsString::new();
        for part in &self.parts {
            match part {
                Part::Text(text) => rendered.push(text),
                Part::Slot(slot) => rendered.push(value(slot)),
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
        return Err(TemplateError {
            reason: format!("there is no option `{}`", shown(option)),
            hint: match nearest(option, options, 3) {
                Some(near) => format!("did you mean `{{option.{near}}}`?"),
                None => format!("add a table [options.{}]", shown(option)),
            },
        });
    }
    let found = SLOTS.iter().find(|(known, _)| *known == name);
    found.map(|(_, slot)| slot.clone()).ok_or_else(|| {
        let known: Vec<&str> = SLOTS.iter().map(|(name, _)| *name).collect();
        TemplateError {
            reason: format!("unknown placeholder `{{{}}}`", shown(name)),
            hint: match nearest(name, &known, 2) {
                Some(near) => format!("did you mean `{{{near}}}`?"),
                None => format!(
                    "known placeholders: {{{}}} and {{option.NAME}}; write {{{{ for a brace",
                    known.join("}, {")
                ),
            },
        }
    })
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

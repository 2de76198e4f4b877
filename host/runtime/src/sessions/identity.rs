//! A plugin's own words about itself, as the host takes them: identifiers that can be names of files, columns
//! and rows, and texts that are one line each, so that nothing of them looks like a line of the host's.

use fleetyard_abi::Descriptor;
use fleetyard_core::{is_unseen, shown};

/// Longest identifier, in bytes.
const ID_BYTES: usize = 100;

/// Longest name, version and licence, in characters.
const LINE: usize = 200;

/// Longest description, in characters.
const PARAGRAPH: usize = 10_000;

/// True of what may name a plugin: `[a-z0-9][a-z0-9._-]*`, up to a hundred bytes.
pub(super) fn is_identifier(text: &str) -> bool {
    let first = |letter: u8| letter.is_ascii_lowercase() || letter.is_ascii_digit();
    let fits = text
        .bytes()
        .enumerate()
        .all(|(at, letter)| first(letter) || at > 0 && matches!(letter, b'.' | b'_' | b'-'));
    fits && !text.is_empty() && text.len() <= ID_BYTES
}

/// Takes a description, or says why its plugin cannot have that name.
pub(super) fn introduced(mut about: Descriptor) -> Result<Descriptor, String> {
    if !is_identifier(&about.id) {
        return Err(format!(
            "`{}` is no identifier: use a-z, 0-9, `.`, `_`, `-`, the first one a letter or digit, \
             at most {ID_BYTES} of them",
            shown(&about.id)
        ));
    }
    for text in [&mut about.name, &mut about.version, &mut about.license] {
        in_one_line(text, LINE);
    }
    in_one_line(&mut about.description, PARAGRAPH);
    Ok(about)
}

/// Ends of lines and all that nobody sees become a blank each, and a long text is cut.
fn in_one_line(text: &mut String, longest: usize) {
    let is_long = text.chars().nth(longest).is_some();
    if !is_long && !text.contains(is_unseen) {
        return;
    }
    let seen = |letter: char| if is_unseen(letter) { ' ' } else { letter };
    *text = text.chars().take(longest).map(seen).collect();
    if is_long {
        text.push('…');
    }
}

#[cfg(test)]
mod tests {
    use fleetyard_abi::{Capabilities, Kind, PathEncoding};

    use super::*;

    fn about(id: &str, version: &str) -> Descriptor {
        Descriptor {
            id: id.into(),
            kind: Kind::Planner,
            name: String::new(),
            version: version.into(),
            description: "x".repeat(PARAGRAPH + 1),
            license: String::new(),
            capabilities: Capabilities::default(),
            options_schema: serde_json::Value::Null,
            features: Vec::new(),
            path_encoding: PathEncoding::default(),
        }
    }

    #[test]
    fn identifiers_are_plain() {
        let long = "x".repeat(ID_BYTES + 1);
        for id in [
            "",
            "../../x",
            "__proto__",
            ".x",
            "-x",
            "X",
            "a\nb",
            "a b",
            "é",
            long.as_str(),
        ] {
            let refused = introduced(about(id, "1")).unwrap_err();
            assert!(
                refused.contains("is no identifier") && !refused.contains('\n'),
                "{refused}"
            );
        }
        for id in ["a", "0", "a.b_c-d", &long[1..]] {
            assert_eq!(introduced(about(id, "1")).unwrap().id, id);
        }
    }

    #[test]
    fn texts_are_one_line_each() {
        let forged = "1.0 (worker process)\nverdict           valid\u{1b}[1A";
        let about = introduced(about("forger", forged)).unwrap();
        assert_eq!(
            about.version,
            "1.0 (worker process) verdict           valid [1A"
        );
        assert_eq!(about.description.chars().count(), PARAGRAPH + 1);
        assert!(about.description.ends_with('…'));
    }
}

//! Texts with names in braces: `Agent {agent}: {path}`. `{{` and `}}` stand for
//! braces.

use crate::files::shown;

/// A part of a text with names in braces.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Piece {
    /// Text as it is, never empty.
    Text(String),
    /// A name that stood in braces.
    Name(String),
}

/// The reason why a text cannot be split into pieces.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PieceError {
    /// The reason.
    pub reason: String,
    /// A way out.
    pub hint: String,
}

/// Splits a text with names in braces.
pub fn pieces(text: &str) -> Result<Vec<Piece>, PieceError> {
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
            return Err(PieceError {
                reason: format!("a single `{brace}` in \"{}\"", shown(text)),
                hint: format!("write {brace}{brace} for a brace, and {{name}} for a placeholder"),
            });
        };
        if !literal.is_empty() {
            pieces.push(Piece::Text(std::mem::take(&mut literal)));
        }
        pieces.push(Piece::Name(rest[..end].to_owned()));
        rest = &rest[end + 1..];
    }
    literal.push_str(rest);
    if !literal.is_empty() {
        pieces.push(Piece::Text(literal));
    }
    Ok(pieces)
}

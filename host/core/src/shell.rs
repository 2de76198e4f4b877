//! Words for a POSIX shell.

/// A word as a shell must be given it: itself where it has no special character, and in
/// single quotes else.
pub fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::quoted;

    #[test]
    fn words_survive_a_shell() {
        assert_eq!(quoted("--only"), "--only");
        assert_eq!(quoted("fault=too-few-agents"), "fault=too-few-agents");
        assert_eq!(quoted("my plugin's.so"), r"'my plugin'\''s.so'");
        assert_eq!(quoted(""), "''");
    }
}

//! Messages of a plugin: one line of its standard output each.
//!
//! [`read`] is pure, and any bytes will do: they are a message, or nothing that
//! matters, or there is a reason why they break the protocol. The client knows which answer is
//! waited for, and what a notification means for the run.

use fleetyard_abi::figures::check_figure;
use fleetyard_abi::wire::{
    BUSY, KeepParams, LogParams, MetricParams, NoteParams, PlanText, READY, RpcError,
};
use serde::Deserialize;
use serde_json::value::RawValue;

/// Most characters of a plugin's text that an explanation repeats.
const QUOTED: usize = 40;

/// The longest explanation of what is wrong inside of a message.
const EXPLAINED: usize = 400;

/// A line that does not break the protocol by itself.
#[derive(Debug)]
pub enum Message<'a> {
    /// Nothing but blanks.
    Blank,
    /// No message: what a library prints that knows nothing of the protocol.
    Stray,
    /// A plan, still as text.
    Incumbent(PlanText<'a>),
    /// Bytes that it wants to have with its next call.
    Keep(KeepParams),
    /// Something to show, still as text: whoever wants it reads it.
    Annotation(&'a str),
    /// A figure.
    Metric(MetricParams),
    /// A fact about its inputs.
    Note(NoteParams),
    /// A line of the log.
    Log(LogParams),
    /// It frees memory once it has answered.
    Busy,
    /// That is done.
    Ready,
    /// Another notification. Progress is for people who watch, and what this host does
    /// not know may come from a newer plugin: neither may hold up a run.
    Ignored,
    /// The answer to a request.
    Answer {
        /// The request; absent where the plugin could not read one.
        id: Option<u64>,
        /// The result as text, which is `null` where there is none.
        result: Result<&'a str, RpcError>,
    },
}

/// The fields of any message. `null` reads as absent.
#[derive(Deserialize)]
struct Fields<'a> {
    #[serde(borrow, default)]
    jsonrpc: Option<&'a RawValue>,
    #[serde(borrow, default)]
    id: Option<&'a RawValue>,
    #[serde(borrow, default)]
    method: Option<&'a RawValue>,
    #[serde(borrow, default)]
    params: Option<&'a RawValue>,
    #[serde(borrow, default)]
    result: Option<&'a RawValue>,
    #[serde(borrow, default)]
    error: Option<&'a RawValue>,
}

/// Bytes of a line that were taken out of it, and where: columns count them.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Cut {
    pub(crate) at: usize,
    pub(crate) bytes: u64,
}

/// Reads a line, without its newline, or says how it breaks the protocol.
pub fn read(line: &[u8]) -> Result<Message<'_>, String> {
    read_without(line, Cut::default())
}

/// As [`read`], of a line from which something was taken out.
pub(crate) fn read_without(line: &[u8], cut: Cut) -> Result<Message<'_>, String> {
    let line = line.trim_ascii();
    match line {
        [] => return Ok(Message::Blank),
        [b'{', ..] => {}
        [b'[', b'{' | b'[', ..] => {
            return Err("a message is a list: batches are not supported".into());
        }
        _ => return Ok(Message::Stray),
    }
    let text =
        std::str::from_utf8(line).map_err(|error| format!("a message is not UTF-8: {error}"))?;
    let fields: Fields<'_> = serde_json::from_str(text).map_err(|error| {
        if error.is_data() {
            let reason = without_place(&error);
            format!("a message is malformed: {reason}")
        } else {
            not_json(text, &error, cut)
        }
    })?;
    let version: Option<String> = field("jsonrpc", fields.jsonrpc, "the text \"2.0\"")?;
    if version.as_deref() != Some("2.0") {
        return Err("a message has no \"jsonrpc\":\"2.0\"".into());
    }
    let id: Option<u64> = field("id", fields.id, "the number of a request")?;
    let method: Option<String> = field("method", fields.method, "a text")?;
    let Some(method) = method else {
        return answer(id, &fields);
    };
    if id.is_some() {
        let method = shortened(&method, QUOTED);
        return Err(format!(
            "it sent a request, `{method}`, but only the host asks"
        ));
    }
    let params = fields.params.map_or("null", RawValue::get);
    Ok(match method.as_str() {
        "incumbent" => {
            let plan: PlanText<'_> = payload("`incumbent`", params)?;
            if !plan.is_there() {
                return Err(
                    "`incumbent` has no plan: no `paths`, `visits` or `trajectories`".into(),
                );
            }
            Message::Incumbent(plan)
        }
        "keep" => Message::Keep(payload("`keep`", params)?),
        "annotation" => Message::Annotation(params),
        "metric" => {
            let metric: MetricParams = payload("`metric`", params)?;
            check_figure(&metric.name, metric.value)?;
            Message::Metric(metric)
        }
        "note" => Message::Note(payload("`note`", params)?),
        "log" => Message::Log(payload("`log`", params)?),
        BUSY => Message::Busy,
        READY => Message::Ready,
        _ => Message::Ignored,
    })
}

fn answer<'a>(id: Option<u64>, fields: &Fields<'a>) -> Result<Message<'a>, String> {
    let result = match fields.error {
        Some(error) => Err(payload("the `error` of a message", error.get())?),
        None if id.is_none() => return Err("a message has neither a method nor an id".into()),
        None => Ok(fields.result.map_or("null", RawValue::get)),
    };
    Ok(Message::Answer { id, result })
}

fn field<'a, T: Deserialize<'a>>(
    name: &str,
    value: Option<&'a RawValue>,
    must_be: &str,
) -> Result<Option<T>, String> {
    let Some(value) = value else {
        return Ok(None);
    };
    serde_json::from_str(value.get()).map(Some).map_err(|_| {
        let found = shortened(value.get(), QUOTED);
        format!("the field `{name}` of a message must be {must_be}, not {found}")
    })
}

/// Reads what is in a message, such as the result of a call, or says which field of it
/// is wrong.
pub fn payload<'a, T: Deserialize<'a>>(what: &str, text: &'a str) -> Result<T, String> {
    let mut reader = serde_json::Deserializer::from_str(text);
    serde_path_to_error::deserialize(&mut reader).map_err(|error| {
        let path = error.path().to_string();
        let reason = without_place(error.inner());
        let mistyped = reason
            .strip_prefix("invalid type: ")
            .and_then(|rest| rest.split_once(", expected "))
            .map(|(found, expected)| {
                let found = shortened(found, QUOTED);
                format!("must be {}, not {found}", in_words(expected))
            });
        let reason = match (path.as_str(), mistyped) {
            (".", Some(mistyped)) => format!("it {mistyped}"),
            (".", None) => reason,
            (path, Some(mistyped)) => format!("the field `{path}` {mistyped}"),
            (path, None) => format!("the field `{path}` is wrong: {reason}"),
        };
        format!("{what} is malformed: {}", shortened(&reason, EXPLAINED))
    })
}

/// JSON's name of a type of Rust.
fn in_words(expected: &str) -> &str {
    match expected {
        "f64" => "a number",
        "u8" | "u32" | "u64" | "usize" | "i64" => "a whole number",
        _ if expected.starts_with("struct ") => "an object",
        _ => expected,
    }
}

/// The reason why a line is not JSON, with the place and the text there.
fn not_json(text: &str, error: &serde_json::Error, cut: Cut) -> String {
    // The reader counts bytes, from 1.
    let at = text.floor_char_boundary(error.column().saturating_sub(1));
    let taken_out = if at >= cut.at { cut.bytes } else { 0 };
    let column = text[..at].chars().count() as u64 + 1 + taken_out;
    let mut before = text[..at].char_indices().rev();
    let from = before.nth(9).map_or(0, |(index, _)| index);
    let near: String = text[from..].chars().take(30).collect();
    let reason = without_place(error);
    format!("a message is not JSON: {reason} at column {column}, near `{near}`")
}

/// The reason alone: the place is in a part of the line that nobody sees.
fn without_place(error: &serde_json::Error) -> String {
    let text = error.to_string();
    match text.rsplit_once(" at line ") {
        Some((reason, _)) => reason.to_owned(),
        None => text,
    }
}

/// The beginning of what may be long.
fn shortened(text: &str, most: usize) -> String {
    match text.char_indices().nth(most) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn refused(line: &str) -> String {
        read(line.as_bytes()).expect_err(line)
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (line, reason) in [
            (
                r#"{"jsonrpc":"2.0","id":"3","result":null}"#,
                "the field `id` of a message must be the number of a request, not \"3\"",
            ),
            (
                r#"{"jsonrpc":"2.0","id":-3,"result":null}"#,
                "the field `id` of a message must be the number of a request, not -3",
            ),
            (
                r#"{"jsonrpc":2.0,"id":3,"result":null}"#,
                "the field `jsonrpc` of a message must be the text \"2.0\", not 2.0",
            ),
            (
                r#"{"jsonrpc":"2.0","method":["log"]}"#,
                "the field `method` of a message must be a text, not [\"log\"]",
            ),
            (
                r#"{"jsonrpc":"2.0","id":1,"error":"no"}"#,
                "the `error` of a message is malformed: it must be an object, not string \"no\"",
            ),
            (
                r#"{"jsonrpc":"2.0","id":1,"error":{"code":"7","message":""}}"#,
                "the `error` of a message is malformed: the field `code` must be a whole number, \
                 not string \"7\"",
            ),
            (
                r#"{"jsonrpc":"2.0","method":"metric","params":{"name":"n","value":"7"}}"#,
                "`metric` is malformed: the field `value` must be a number, not string \"7\"",
            ),
            (
                r#"{"jsonrpc":"2.0","method":"metric","params":{"name":"n"}}"#,
                "`metric` is malformed: missing field `value`",
            ),
            (
                r#"{"jsonrpc":"2.0","method":"metric","params":{"name":"expansions","value":-5}}"#,
                "the figure `expansions` must be a whole number from 0, not -5",
            ),
            (
                r#"{"jsonrpc":"2.0","method":"incumbent"}"#,
                "`incumbent` is malformed: it must be an object, not null",
            ),
            (
                r#"{"jsonrpc":"2.0","method":"log","params":{"level":"loud","text":""}}"#,
                "`log` is malformed: the field `level` is wrong: unknown variant `loud`",
            ),
            (
                r#"{"jsonrpc":"2.0","id":1,"id":2}"#,
                "a message is malformed: duplicate field `id`",
            ),
            (
                r#"{"jsonrpc":"2.0"}"#,
                "a message has neither a method nor an id",
            ),
        ] {
            let found = refused(line);
            assert!(found.starts_with(reason), "{line}: {found}");
        }
    }

    #[test]
    fn a_place_counts_characters() {
        let reason = refused("{\"jsonrpc\":\"2.0\",\"ä\":\"öööööööööö\",\"id\":NaN}");
        assert!(
            reason.ends_with("at column 40, near `ööö\",\"id\":NaN}`"),
            "{reason}"
        );
        assert!(refused("{").contains("at column 1, near `{`"));
    }

    #[test]
    fn a_result_may_be_null() {
        for line in [
            r#" {"jsonrpc":"2.0","id":7,"result":null} "#,
            r#"{"jsonrpc":"2.0","id":7}"#,
        ] {
            let read = read(line.as_bytes());
            assert!(
                matches!(
                    read,
                    Ok(Message::Answer {
                        id: Some(7),
                        result: Ok("null")
                    })
                ),
                "{read:?}"
            );
        }
    }

    #[test]
    fn what_is_no_message_is_left_alone() {
        for (line, blank) in [
            ("", true),
            (" \t\r", true),
            ("Solved!", false),
            ("[1]", false),
        ] {
            match read(line.as_bytes()) {
                Ok(Message::Blank) => assert!(blank, "{line}"),
                Ok(Message::Stray) => assert!(!blank, "{line}"),
                other => panic!("{line}: {other:?}"),
            }
        }
    }
}

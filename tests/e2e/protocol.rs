//! `docs/protocol.md`: its tables are what the schema and the source say, and its
//! messages are read as the host reads them.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use fleetyard_abi::annotation;
use fleetyard_abi::figures::FIGURES;
use fleetyard_abi::wire::Envelope;
use fleetyard_runtime::Limits;
use fleetyard_runtime::bounds;
use fleetyard_runtime::message::{self, Message};
use fleetyard_testkit::root;
use serde_json::Value;

fn schema() -> Value {
    let path = root().join("abi/schema/protocol.json");
    let text = std::fs::read_to_string(path).expect("the schema");
    serde_json::from_str(&text).expect("JSON")
}

fn document() -> String {
    std::fs::read_to_string(root().join("docs/protocol.md")).expect("docs/protocol.md")
}

// ---- Tables ----------------------------------------------------------------------------

/// The values of a schema: names of types, `[]` after what a list is of. `null` is a value of its
/// own only where a field must be there.
fn words(schema: &Value, may_be_absent: bool) -> String {
    if let Some(name) = schema["$ref"].as_str() {
        let name = name.trim_start_matches("#/$defs/");
        return format!("[{name}](#{})", name.to_lowercase());
    }
    let shown = |kind: &str| !(may_be_absent && kind == "null");
    let alternatives = schema["anyOf"].as_array().or(schema["oneOf"].as_array());
    if let Some(alternatives) = alternatives {
        let all = alternatives.iter().map(|one| words(one, false));
        let all: Vec<String> = all.filter(|kind| shown(kind)).collect();
        return all.join(" or ");
    }
    let of = |kind: &str| match kind {
        "array" => {
            let length = schema["maxItems"].as_u64().map(|length| length.to_string());
            let items = match &schema["items"] {
                Value::Null => "list".to_owned(),
                items => words(items, false),
            };
            match items.contains(' ') && !items.ends_with(']') {
                true => format!("({items})[{}]", length.unwrap_or_default()),
                false if schema["items"].is_null() => items,
                false => format!("{items}[{}]", length.unwrap_or_default()),
            }
        }
        "integer" if schema["minimum"] == 0 => "unsigned".to_owned(),
        "string" => match schema["const"].as_str() {
            Some(text) => format!("`\"{text}\"`"),
            None => "text".to_owned(),
        },
        other => other.to_owned(),
    };
    match &schema["type"] {
        Value::String(kind) => of(kind),
        Value::Array(kinds) => {
            let kinds = kinds.iter().filter_map(Value::as_str);
            let kinds = kinds.filter(|kind| shown(kind)).map(of);
            kinds.collect::<Vec<_>>().join(" or ")
        }
        _ => "any JSON".to_owned(),
    }
}

/// A description as one line of Markdown; what refers to Rust is for readers of Rust.
fn sentence(schema: &Value) -> String {
    let text = schema["description"].as_str().unwrap_or_default();
    let text = text.split("; see [`crate").next().unwrap_or_default();
    text.split_whitespace()
        .collect::<Vec<_>>()
        .join(" ")
        .replace('|', "\\|")
}

/// A section for every type of the schema.
fn fields(schema: &Value) -> String {
    let mut out = String::new();
    for (name, definition) in schema["$defs"].as_object().expect("definitions") {
        // Writing to a string cannot fail.
        let _ = writeln!(out, "\n#### {name}");
        let about = sentence(definition);
        // The tables of methods say whose parameters and results they are.
        let of_method = about.starts_with("Parameters of") || about.starts_with("Result of");
        if !about.is_empty() && !of_method {
            let _ = writeln!(out, "\n{about}");
        }
        let variants = definition["oneOf"]
            .as_array()
            .or(definition["anyOf"].as_array());
        if let Some(properties) = definition["properties"].as_object() {
            members(&mut out, properties, definition);
        } else if let Some(values) = definition["enum"].as_array() {
            let values: Vec<String> = values.iter().map(|value| format!("`{value}`")).collect();
            let _ = write!(out, "\nOne of {}.\n", values.join(", "));
        } else if let Some(variants) = variants {
            out.push('\n');
            for variant in variants {
                let mut what = words(variant, false);
                if let Some(properties) = variant["properties"].as_object() {
                    let tags = properties.iter();
                    let tags = tags.map(|(tag, value)| format!("`{tag}` {}", words(value, false)));
                    what = tags.collect::<Vec<_>>().join(", ");
                    if variant["$ref"].is_string() {
                        let _ = write!(what, " and the fields of {}", words(variant, false));
                    }
                }
                let _ = writeln!(out, "- {what}: {}", sentence(variant));
            }
        } else {
            let examples = definition["items"]["examples"].as_array();
            let _ = write!(out, "\n{}", words(definition, false));
            if let Some(examples) = examples {
                let examples: Vec<String> =
                    examples.iter().map(|name| format!("`{name}`")).collect();
                let _ = write!(out, ": {}", examples.join(", "));
            }
            out.push_str(".\n");
        }
    }
    out
}

fn members(out: &mut String, properties: &serde_json::Map<String, Value>, of: &Value) {
    let required: Vec<&str> = of["required"]
        .as_array()
        .into_iter()
        .flatten()
        .filter_map(Value::as_str)
        .collect();
    let optional = properties.keys().map(String::as_str);
    let optional = optional.filter(|name| !required.contains(name));
    out.push('\n');
    for name in required.iter().copied().chain(optional) {
        let property = &properties[name];
        let default = property.get("default").filter(|value| !value.is_null());
        let required = required.contains(&name);
        let (mark, default) = match default {
            Some(default) => ("", format!(", `{default}`")),
            None if required => ("", String::new()),
            None => ("?", String::new()),
        };
        let (kind, meaning) = (words(property, !required), sentence(property));
        let _ = writeln!(out, "- `{name}{mark}` ({kind}{default}): {meaning}");
    }
}

fn limits() -> String {
    let limits = Limits::default();
    let mib = |bytes: usize| format!("{} MiB", bytes >> 20);
    let mut out = String::from("\n| limit | |\n| --- | --- |\n");
    for (what, limit) in [
        (
            "longest message until `initialize` is answered",
            mib(bounds::INTRODUCTION_BYTES),
        ),
        (
            "longest message afterwards, `paths` not counted",
            mib(bounds::MESSAGE_BYTES),
        ),
        (
            "an answer to `generate` may be longer by, for every agent",
            format!("{} KiB", bounds::AGENT_BYTES >> 10),
        ),
        (
            "cells of a plan, for every agent: those of the map for each of its goals, the \
             window, and",
            bounds::HORIZON_STEPS.to_string(),
        ),
        (
            "cells of a plan, all paths together",
            bounds::PLAN_CELLS.to_string(),
        ),
        (
            "output that is no message, standard error included; `--output-limit` sets it",
            mib(limits.output_bytes as usize),
        ),
        (
            "plans of one call whose arrival is kept; the last one always is",
            bounds::INCUMBENTS.to_string(),
        ),
        (
            "memory of plans before the last one; beyond it the oldest but the first are forgotten",
            mib(bounds::OLDER_BYTES),
        ),
        ("log that is kept", mib(bounds::LOG_BYTES)),
        (
            "shapes of an annotation, and its points or places together",
            annotation::MOST_POINTS.to_string(),
        ),
        (
            "bytes of the name of a layer, and of the text of an annotation",
            format!(
                "{}, {}",
                annotation::MOST_LAYER_BYTES,
                annotation::MOST_TEXT_BYTES
            ),
        ),
        (
            "annotations of one call that are kept, and their layers",
            format!("{}, {}", bounds::ANNOTATIONS, bounds::ANNOTATION_LAYERS),
        ),
        (
            "shapes, points and places of all of them, and bytes of their texts",
            format!(
                "{}, {}",
                bounds::ANNOTATION_POINTS,
                bounds::ANNOTATION_TEXT_BYTES
            ),
        ),
    ] {
        let _ = writeln!(out, "| {what} | {limit} |");
    }
    out
}

fn figures() -> String {
    let mut out = String::from("\n| figure | is | meaning |\n| --- | --- | --- |\n");
    for figure in FIGURES {
        let (name, domain, about) = (figure.name, figure.domain.in_words(), figure.about);
        let _ = writeln!(out, "| `{name}` | {domain} | {about} |");
    }
    out
}

/// The document with its generated sections made anew.
fn generated(document: &str) -> String {
    let schema = schema();
    let mut out = document.to_owned();
    for (name, text) in [
        ("figures", figures()),
        ("limits", limits()),
        ("fields", fields(&schema)),
    ] {
        let begin = format!("<!-- generated: {name} -->\n");
        let (before, rest) = out.split_once(&begin).expect("a marker");
        let (_, after) = rest.split_once("<!-- end -->").expect("an end");
        out = format!("{before}{begin}{text}\n<!-- end -->{after}");
    }
    out
}

#[test]
fn tables_are_current() {
    let found = document();
    let current = generated(&found);
    if std::env::var_os("FLEETYARD_UPDATE").is_some() {
        std::fs::write(root().join("docs/protocol.md"), &current).expect("write the document");
        return;
    }
    assert!(
        found == current,
        "docs/protocol.md is not what the schema says; run \
         `FLEETYARD_UPDATE=1 cargo test -p fleetyard --test e2e protocol::`"
    );
}

// ---- Examples --------------------------------------------------------------------------

/// Fails unless a part of a message is as the schema says.
#[track_caller]
fn check(schema: &Value, part: &str, value: &str) {
    let definition = &schema["properties"][part];
    assert!(definition.is_object(), "the schema has no {part}");
    let whole = serde_json::json!({
        "$ref": definition["$ref"],
        "$defs": schema["$defs"],
    });
    let validator = jsonschema::validator_for(&whole).expect("a schema");
    let value: Value = serde_json::from_str(value).expect("JSON");
    if let Err(error) = validator.validate(&value) {
        panic!("{part}: {error}: {value}");
    }
}

/// Lines of the document's conversations, by conversation.
fn conversations(document: &str) -> Vec<Vec<&str>> {
    let blocks = document.split("\n```text\n").skip(1);
    let blocks = blocks.map(|rest| rest.split("\n```").next().unwrap_or_default());
    blocks.map(|block| block.lines().collect()).collect()
}

#[test]
fn every_message_is_read_as_it_is_shown() {
    let document = document();
    let schema = schema();
    let mut seen: BTreeMap<String, usize> = BTreeMap::new();
    for conversation in conversations(&document) {
        // The method of each request, for its answer.
        let mut asked: BTreeMap<u64, String> = BTreeMap::new();
        let mut lines = conversation.into_iter().peekable();
        while let Some(line) = lines.next() {
            if let Some(line) = line.strip_prefix("> ") {
                let envelope: Envelope<'_> = serde_json::from_str(line).expect(line);
                assert_eq!(envelope.jsonrpc, "2.0");
                let method = envelope.method.as_deref().expect("a method").to_owned();
                let part = format!("{}_params", method.trim_start_matches("$/"));
                match envelope.params {
                    Some(params) => check(&schema, &part, params.get()),
                    None => assert!(["shutdown", "exit"].contains(&&*method), "{line}"),
                }
                asked.extend(envelope.id.map(|id| (id, method.clone())));
                *seen.entry(method).or_default() += 1;
            } else if let Some(line) = line.strip_prefix("< ") {
                let read = message::read(line.as_bytes());
                if let Some(reason) = lines.next_if(|next| next.starts_with("! ")) {
                    assert_eq!(read.map(|_| ()), Err(reason[2..].to_owned()), "{line}");
                    continue;
                }
                let value: Value = serde_json::from_str(line).expect(line);
                match read.unwrap_or_else(|reason| panic!("{line}: {reason}")) {
                    Message::Answer { id, result } => {
                        let method = &asked[&id.expect("an id")];
                        match result {
                            Ok("null") => assert_eq!(method, "shutdown", "{line}"),
                            Ok(result) => check(&schema, &format!("{method}_result"), result),
                            Err(_) => check(&schema, "error", &value["error"].to_string()),
                        }
                    }
                    Message::Blank | Message::Stray => panic!("{line}: no message"),
                    _ => {
                        let method = value["method"].as_str().expect("a method").to_owned();
                        let params = value["params"].to_string();
                        check(&schema, &format!("{method}_params"), &params);
                        *seen.entry(method).or_default() += 1;
                    }
                }
            } else {
                let read = message::read(line.as_bytes());
                assert!(matches!(read, Ok(Message::Stray)), "{line}: {read:?}");
            }
        }
    }
    // Every method has an example.
    for part in schema["properties"].as_object().expect("parts").keys() {
        if let Some(method) = part.strip_suffix("_params") {
            let method = if method == "cancel" {
                "$/cancel"
            } else {
                method
            };
            assert!(seen.contains_key(method), "no example of `{method}`");
        }
    }
}

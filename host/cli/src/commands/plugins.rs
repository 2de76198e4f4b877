//! `fleetyard plugins`: what is there, and what it can do.

use std::fmt::Write as _;
use std::path::Path;

use fleetyard_abi::{Capability, Descriptor};
use fleetyard_runtime::{Discovered, Discovery, Origin, PluginFile, Runtime};
use serde::Serialize;
use serde_json::Value;

use crate::args::Format;
use crate::exit::{Exit, Failure, Result};
use crate::output;
use crate::trial::runtime;

#[derive(Serialize)]
struct Listed {
    origin: String,
    path: Option<String>,
    plugins: Vec<Descriptor>,
    refused: Option<String>,
    hint: Option<String>,
}

fn origin_name(origin: &Origin) -> String {
    match origin {
        Origin::BuiltIn => "built-in".into(),
        Origin::Path => "path".into(),
        Origin::Folder(folder) => folder.display().to_string(),
    }
}

impl From<Discovered> for Listed {
    fn from(found: Discovered) -> Self {
        let (plugins, refused, hint) = match found.plugins {
            Ok(plugins) => (plugins, None, None),
            Err(fault) => (
                Vec::new(),
                Some(fault.to_string()),
                fault.hint().map(str::to_owned),
            ),
        };
        let path = found.file.path().map(|path| path.display().to_string());
        Self {
            origin: origin_name(&found.origin),
            path,
            plugins,
            refused,
            hint,
        }
    }
}

pub(crate) fn list(format: Format) -> Result<Exit> {
    let runtime = runtime()?;
    let found = Discovery::from_environment().scan(&runtime);
    let listed: Vec<Listed> = found.into_iter().map(Listed::from).collect();
    if format == Format::Json {
        output::print_json(&listed)?;
        return Ok(Exit::Success);
    }
    let mut rows = Vec::new();
    for file in &listed {
        let place = file.path.clone().unwrap_or_else(|| file.origin.clone());
        for plugin in &file.plugins {
            let kind = plugin.kind.to_string();
            rows.push(vec![
                plugin.id.clone(),
                kind,
                plugin.version.clone(),
                place.clone(),
            ]);
        }
        if let Some(reason) = &file.refused {
            rows.push(vec![
                "(refused)".into(),
                String::new(),
                String::new(),
                place,
            ]);
            output::warning(reason);
            if let Some(hint) = &file.hint {
                eprintln!("hint: {}", output::plain(hint));
            }
        }
    }
    output::print(&output::table(
        &["id", "kind", "version", "from"],
        rows,
        &[],
    ))?;
    Ok(Exit::Success)
}

pub(crate) fn info(name: &str, format: Format) -> Result<Exit> {
    let runtime = runtime()?;
    let described = describe(&runtime, name)?;
    match format {
        Format::Json => output::print_json(&described)?,
        Format::Text => {
            let texts: Vec<String> = described.iter().map(text).collect();
            output::print(&output::plain(&texts.join("\n\n")))?;
        }
    }
    Ok(Exit::Success)
}

/// The plugins that a name stands for: all of a file, or all with an identifier.
fn describe(runtime: &Runtime, name: &str) -> Result<Vec<Descriptor>> {
    let path = Path::new(name);
    if name.contains('/') || path.is_file() {
        let file = PluginFile::at(path)?;
        return Ok(runtime.describe(&file)?);
    }
    let found = Discovery::from_environment().scan(runtime);
    let all: Vec<Descriptor> = found
        .into_iter()
        .filter_map(|file| file.plugins.ok())
        .flatten()
        .collect();
    let named: Vec<Descriptor> = all
        .iter()
        .filter(|plugin| plugin.id == name)
        .cloned()
        .collect();
    if named.is_empty() {
        let known: Vec<&str> = all.iter().map(|plugin| plugin.id.as_str()).collect();
        return Err(
            Failure::new(Exit::Usage, format!("there is no plugin `{name}`"))
                .hint(format!("known: {}; or name a file", known.join(", "))),
        );
    }
    Ok(named)
}

fn text(plugin: &Descriptor) -> String {
    let mut out = String::new();
    let capabilities: Vec<&str> = plugin.capabilities.iter().map(Capability::as_str).collect();
    // Writing to a string cannot fail.
    let _ = writeln!(out, "{} ({}) {}", plugin.id, plugin.kind, plugin.version);
    if !plugin.description.is_empty() {
        let _ = writeln!(out, "{}", plugin.description);
    }
    if !plugin.license.is_empty() {
        let _ = writeln!(out, "licence: {}", plugin.license);
    }
    let _ = writeln!(out, "can do: {}", capabilities.join(", "));
    let options = plugin
        .options_schema
        .get("properties")
        .and_then(Value::as_object);
    match options.filter(|options| !options.is_empty()) {
        None => out.push_str("options: none"),
        Some(options) => {
            out.push_str("options:");
            for (name, schema) in options {
                let field = |key: &str| schema.get(key).map_or(String::new(), Value::to_string);
                let about = schema
                    .get("description")
                    .and_then(Value::as_str)
                    .unwrap_or_default();
                let about = about.split_whitespace().collect::<Vec<_>>().join(" ");
                let takes = if schema.get("enum").is_some() {
                    field("enum")
                } else {
                    field("type")
                };
                let _ = write!(out, "\n  {name} = {} ({takes})", field("default"));
                let _ = write!(out, "\n      {about}");
            }
        }
    }
    out
}

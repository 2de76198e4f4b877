//! `fleetyard plugins list` and `info`: what is there, and what it can do.

use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Subcommand;
use fleetyard_abi::{Capability, Descriptor};
use fleetyard_core::Digest;
use fleetyard_runtime::{
    Attach, CodeFile, Contract, Discovered, Discovery, Found, Introduction, PluginFile, Runtime,
    Standing, by_name, by_path, first_with,
};
use serde::Serialize;
use serde_json::Value;

use super::check::{Check, check};
use super::new::{New, new, sdk};
use super::pin::{Pin, pin};
use crate::args::{Format, TrustArgs};
use crate::exit::{Exit, Failure, Result};
use crate::output;
use crate::setup::{runtime, trust, unreadable};

#[derive(Debug, Subcommand)]
pub(crate) enum Plugins {
    /// List every plugin, where it comes from, and why one was refused
    List {
        #[command(flatten)]
        trust: TrustArgs,
        #[command(flatten)]
        format: Format,
    },
    New(New),
    /// Write the Python SDK into the folder of plugins that import it
    Sdk {
        /// The folder
        folder: PathBuf,
    },
    Check(Box<Check>),
    /// Describe a plugin: what it can do and its options
    Info {
        /// A plugin's identifier, or the path of a library or program
        plugin: String,
        #[command(flatten)]
        trust: TrustArgs,
        #[command(flatten)]
        format: Format,
    },
    Pin(Pin),
}

pub(crate) fn plugins(what: &Plugins) -> Result<Exit> {
    match what {
        Plugins::List { trust, format } => list(trust, *format),
        Plugins::New(arguments) => new(arguments),
        Plugins::Sdk { folder } => sdk(folder),
        Plugins::Check(arguments) => check(arguments),
        Plugins::Info {
            plugin,
            trust,
            format,
        } => info(plugin, trust, *format),
        Plugins::Pin(arguments) => pin(arguments),
    }
}

/// A file of the plugin path, as `--format json` shows it.
#[derive(Serialize)]
struct Listed {
    origin: String,
    path: Option<String>,
    attach: Attach,
    contract: Option<Contract>,
    plugins: Vec<ListedPlugin>,
    /// Standing of the file in the lock.
    lock: Standing,
    /// Of its code; of this program, for the built-ins.
    digest: Option<Digest>,
    code: Vec<CodeFile>,
    /// The files that are started.
    #[serde(skip)]
    started: Vec<CodeFile>,
    refused: Option<String>,
    hint: Option<String>,
}

#[derive(Serialize)]
struct ListedPlugin {
    #[serde(flatten)]
    descriptor: Descriptor,
    /// The file whose plugin of this kind and name is used instead.
    shadowed_by: Option<String>,
}

fn listed(runtime: &Runtime, all: &[Discovered], found: &Discovered) -> Listed {
    let identity = runtime.identity(&found.file).ok();
    let shadowed_by = |plugin: &Descriptor| {
        let first = first_with(all, plugin).filter(|first| first.file != found.file);
        first.map(Discovered::place)
    };
    let (contract, plugins, fault) = match &found.plugins {
        Ok(introduction) => {
            let plugins = introduction.descriptors.iter().map(|plugin| ListedPlugin {
                shadowed_by: shadowed_by(plugin),
                descriptor: plugin.clone(),
            });
            let contract = introduction.contract.clone();
            (Some(contract), plugins.collect(), None)
        }
        Err(fault) => (None, Vec::new(), Some(fault)),
    };
    Listed {
        origin: found.origin.to_string(),
        path: found.file.path().map(|path| path.display().to_string()),
        attach: found.file.default_attach(),
        contract,
        plugins,
        lock: found.standing,
        digest: identity.as_ref().map(|identity| identity.digest),
        code: identity.map(|identity| identity.code).unwrap_or_default(),
        started: found.file.code().unwrap_or_default(),
        refused: fault.map(ToString::to_string),
        hint: fault.and_then(|fault| fault.hint().map(str::to_owned)),
    }
}

fn list(arguments: &TrustArgs, format: Format) -> Result<Exit> {
    let runtime = runtime(trust(arguments)?)?;
    let discovery = Discovery::from_environment();
    let all = discovery.scan(&runtime);
    for (folder, reason) in discovery.unreadable() {
        output::warning(&unreadable(&folder, &reason));
    }
    let files: Vec<Listed> = all
        .iter()
        .map(|found| listed(&runtime, &all, found))
        .collect();
    match format {
        Format::Json => output::print_json(&files)?,
        Format::Text => {
            output::print(&output::plain(&table(&files)))?;
            for file in &files {
                if let Some(reason) = &file.refused {
                    output::warning(reason);
                    if let Some(hint) = &file.hint {
                        eprintln!("hint: {}", output::plain(hint));
                    }
                }
            }
        }
    }
    Ok(Exit::Success)
}

/// A line for every plugin, and for every file that was refused.
fn table(files: &[Listed]) -> String {
    let mut rows = Vec::new();
    for file in files {
        let place = file.path.clone().unwrap_or_else(|| file.origin.clone());
        let attach = file.attach.name();
        let contract = file
            .contract
            .as_ref()
            .map_or(String::new(), ToString::to_string);
        let code: Vec<&str> = file.started.iter().map(|code| &code.sha256[..12]).collect();
        let mut row = |id: &str, kind: String, version: &str, notes: String| {
            rows.push(vec![
                id.to_owned(),
                kind,
                version.to_owned(),
                attach.to_owned(),
                contract.clone(),
                code.join(" "),
                place.clone(),
                notes,
            ]);
        };
        if file.refused.is_some() {
            row("(refused)", String::new(), "", String::new());
        }
        for ListedPlugin {
            descriptor: Descriptor {
                id, kind, version, ..
            },
            shadowed_by,
        } in &file.plugins
        {
            let shadowed = shadowed_by.as_ref().map(|by| format!("shadowed by {by}"));
            let lock = match file.lock {
                Standing::Pinned => Some("pinned".to_owned()),
                Standing::Unlisted => Some("not pinned".to_owned()),
                Standing::Free => None,
            };
            let notes: Vec<String> = lock.into_iter().chain(shadowed).collect();
            row(id, kind.to_string(), version, notes.join(", "));
        }
    }
    let header = [
        "id", "kind", "version", "attached", "contract", "sha256", "from", "",
    ];
    output::table(&header, rows, &[])
}

/// A plugin, as `plugins info` shows it.
#[derive(Serialize)]
struct Described {
    #[serde(flatten)]
    descriptor: Descriptor,
    path: Option<String>,
    attach: Attach,
    contract: Contract,
    digest: Option<Digest>,
    code: Vec<CodeFile>,
    /// Paths that it may read besides the system's files.
    reads: Vec<String>,
}

/// Most files, and most paths, that are shown as text.
const SHOWN: usize = 20;

fn info(name: &str, arguments: &TrustArgs, format: Format) -> Result<Exit> {
    let runtime = runtime(trust(arguments)?)?;
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
fn describe(runtime: &Runtime, name: &str) -> Result<Vec<Described>> {
    if let Some(found) = by_path(name) {
        let Found { file, id, .. } = found?;
        let introduction = runtime.describe(&file)?;
        let is_meant = |other: &str| id.as_deref().is_none_or(|id| id == other);
        let named = described(runtime, &file, introduction, is_meant)?;
        return match id {
            Some(id) if named.is_empty() => Err(Failure::new(
                Exit::Usage,
                format!("there is no plugin `{id}` in `{name}`"),
            )),
            _ => Ok(named),
        };
    }
    let all = Discovery::from_environment().scan(runtime);
    let mut named = Vec::new();
    for found in &all {
        if let Ok(introduction) = &found.plugins {
            let introduction = introduction.clone();
            named.extend(described(runtime, &found.file, introduction, |id| {
                id == name
            })?);
        }
    }
    if named.is_empty() {
        // Says what is known, or why the one that is meant was refused.
        by_name(runtime, &all, None, name)?;
    }
    Ok(named)
}

fn described(
    runtime: &Runtime,
    file: &PluginFile,
    introduction: Introduction,
    wanted: impl Fn(&str) -> bool,
) -> Result<Vec<Described>> {
    let Introduction {
        contract,
        descriptors,
    } = introduction;
    let mut chosen = descriptors
        .into_iter()
        .filter(|plugin| wanted(&plugin.id))
        .peekable();
    let reads = match chosen.peek() {
        Some(_) => runtime.readable(file)?,
        None => Vec::new(),
    };
    let identity = match chosen.peek() {
        Some(_) => Some(runtime.identity(file)?),
        None => None,
    };
    let reads: Vec<String> = reads
        .iter()
        .map(|path| path.display().to_string())
        .collect();
    let described = chosen
        .map(|descriptor| Described {
            reads: reads.clone(),
            descriptor,
            path: file.path().map(|path| path.display().to_string()),
            attach: file.default_attach(),
            contract: contract.clone(),
            digest: identity.as_ref().map(|identity| identity.digest),
            code: identity
                .as_ref()
                .map_or_else(Vec::new, |identity| identity.code.clone()),
        })
        .collect();
    Ok(described)
}

fn text(described: &Described) -> String {
    let plugin = &described.descriptor;
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
    let from = described.path.as_deref().unwrap_or("built-in");
    let _ = writeln!(out, "from: {from} ({})", described.contract);
    let line = |CodeFile { path, sha256 }: &CodeFile| format!("{sha256}  {}", path.display());
    let code: Vec<String> = described.code.iter().map(line).collect();
    for (what, all) in [("code", &code), ("reads", &described.reads)] {
        for one in all.iter().take(SHOWN) {
            let _ = writeln!(out, "{what}: {one}");
        }
        if let Some(more) = all.len().checked_sub(SHOWN + 1) {
            let more = more + 1;
            let _ = writeln!(out, "{what}: and {more} more, as `--format json` has them");
        }
    }
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

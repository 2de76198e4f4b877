//! `fleetyard plugins pin`: writes down whose code may run, and looks whether it is
//! still the same.

use std::path::{Path, PathBuf};

use clap::Args;
use fleetyard_runtime::{
    Discovery, LOCK_FILE, Lock, Pinned, PinnedPlugin, PluginFile, Policy, Runtime, Trust,
};
use serde::Serialize;

use crate::args::Format;
use crate::exit::{Exit, Failure, Result};
use crate::output;
use crate::setup::{runtime, runtime_with};

/// Write down the digests of plugins' code: what is pinned runs unchanged or not at all.
#[derive(Debug, Args)]
#[allow(clippy::struct_excessive_bools, reason = "what to do, one flag each")]
pub(crate) struct Pin {
    /// Plugins, by identifier or path
    #[arg(value_name = "PLUGIN", required_unless_present_any = ["list", "check"])]
    plugins: Vec<String>,
    /// Accept what has changed since a plugin was pinned
    #[arg(long, conflicts_with_all = ["list", "check", "remove"])]
    update: bool,
    /// Take plugins out of the lock
    #[arg(long, conflicts_with_all = ["list", "check"])]
    remove: bool,
    /// Show what is pinned
    #[arg(long, conflicts_with_all = ["check", "plugins"])]
    list: bool,
    /// Say whether everything that is pinned is unchanged; nothing is started
    #[arg(long, conflicts_with = "plugins")]
    check: bool,
    /// The lock file [default: fleetyard.lock in the current folder]
    #[arg(
        long,
        value_name = "FILE",
        env = "FLEETYARD_LOCK",
        hide_env_values = true
    )]
    lock: Option<PathBuf>,
    #[command(flatten)]
    format: Format,
}

/// The change of an entry of the lock.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
enum State {
    Pinned,
    Updated,
    Unchanged,
    Removed,
    /// Its code is not what is pinned, or is not there.
    Changed,
}

/// Number of a plugin's files that are shown by name; the lock has them all.
const SHOWN: usize = 6;

#[derive(Serialize)]
struct Line {
    state: Option<State>,
    #[serde(flatten)]
    entry: Pinned,
    reason: Option<String>,
    hint: Option<String>,
}

impl Line {
    fn new(state: impl Into<Option<State>>, entry: &Pinned) -> Self {
        Self {
            state: state.into(),
            entry: entry.clone(),
            reason: None,
            hint: None,
        }
    }
}

pub(crate) fn pin(arguments: &Pin) -> Result<Exit> {
    let file = arguments.lock.as_deref().unwrap_or(Path::new(LOCK_FILE));
    let writes = !(arguments.list || arguments.check || arguments.remove);
    let mut lock = if writes && !file.exists() {
        Lock::new(file)
    } else {
        Lock::read(file)?
    };
    let lines = if arguments.list {
        let all = lock.pinned().iter();
        all.map(|entry| Line::new(None, entry)).collect()
    } else if arguments.check {
        check(&lock)
    } else if arguments.remove {
        let lines = remove(&mut lock, &arguments.plugins)?;
        lock.write()?;
        lines
    } else {
        let lines = add(&mut lock, arguments)?;
        lock.write()?;
        lines
    };
    match arguments.format {
        Format::Json => output::print_json(&lines)?,
        Format::Text => output::print(&output::plain(&table(&lines)))?,
    }
    let mut exit = Exit::Success;
    for line in &lines {
        if let Some(reason) = &line.reason {
            exit = Exit::Plugin;
            output::error(reason);
            if let Some(hint) = &line.hint {
                eprintln!("hint: {}", output::plain(hint));
            }
        }
    }
    Ok(exit)
}

fn table(lines: &[Line]) -> String {
    let mut rows = Vec::new();
    for Line { state, entry, .. } in lines {
        let plugins: Vec<String> = entry
            .plugins
            .iter()
            .map(|PinnedPlugin { kind, id, version }| format!("{kind} {id} {version}"))
            .collect();
        for (index, code) in entry.code.iter().take(SHOWN).enumerate() {
            let state = match (state, index) {
                (Some(State::Pinned), 0) => "pinned",
                (Some(State::Updated), 0) => "updated",
                (Some(State::Unchanged), 0) => "unchanged",
                (Some(State::Removed), 0) => "removed",
                (Some(State::Changed), 0) => "CHANGED",
                _ => "",
            };
            let plugins = if index == 0 {
                plugins.join(", ")
            } else {
                String::new()
            };
            let path = code.path.display().to_string();
            rows.push(vec![state.to_owned(), plugins, code.sha256.clone(), path]);
        }
        let all = entry.code.len();
        let told = match all {
            1 => "this file alone".to_owned(),
            2..=SHOWN => format!("{all} files"),
            _ => format!("and {} more, {all} files", all - SHOWN),
        };
        rows.push(vec![String::new(), String::new(), String::new(), told]);
    }
    output::table(&["", "plugin", "sha256", "file"], rows, &[])
}

/// Compares everything with what is pinned, and starts nothing.
fn check(lock: &Lock) -> Vec<Line> {
    let state = |entry: &Pinned| {
        let file = PluginFile::at(&lock.locate(&entry.path));
        let checked = file.and_then(|file| lock.compare(entry, &file, &[]));
        match checked {
            Ok(()) => Line::new(State::Unchanged, entry),
            Err(fault) => Line {
                reason: Some(fault.to_string()),
                hint: fault.hint().map(str::to_owned),
                ..Line::new(State::Changed, entry)
            },
        }
    };
    lock.pinned().iter().map(state).collect()
}

/// True if a user's name for a plugin stands for an entry. The file need not be there.
fn is_meant(lock: &Lock, entry: &Pinned, name: &str) -> bool {
    let named = match PluginFile::at(Path::new(name)) {
        Ok(file) => file.path().map(Path::to_owned),
        Err(_) => std::path::absolute(name).ok(),
    };
    named.is_some_and(|named| named == lock.locate(&entry.path))
        || entry.plugins.iter().any(|plugin| plugin.id == name)
}

fn remove(lock: &mut Lock, names: &[String]) -> Result<Vec<Line>> {
    let mut lines = Vec::new();
    for name in names {
        let entries: Vec<Pinned> = lock
            .pinned()
            .iter()
            .filter(|entry| is_meant(lock, entry, name))
            .cloned()
            .collect();
        if entries.is_empty() {
            let message = format!("`{name}` is not in {}", lock.file().display());
            return Err(Failure::new(Exit::Usage, message)
                .hint("`fleetyard plugins pin --list` shows what is"));
        }
        lines.extend(entries.iter().map(|entry| Line::new(State::Removed, entry)));
        lock.remove(|entry| entries.contains(entry));
    }
    Ok(lines)
}

fn add(lock: &mut Lock, arguments: &Pin) -> Result<Vec<Line>> {
    // To describe what is being pinned, it has to be started.
    let policy = Policy {
        hidden: vec![lock.file().to_owned()],
        ..Policy::default()
    };
    let trusting = runtime_with(policy, Trust::default())?;
    let mut lines = Vec::new();
    for name in &arguments.plugins {
        let file = file_of(lock, name)?;
        let before = lock.entry(&file).cloned();
        if let Some(entry) = &before
            && !arguments.update
        {
            lock.compare(entry, &file, &[])?;
        }
        let hidden = [lock.file().to_owned()];
        let code = file.whole(&hidden)?;
        let introduction = trusting.describe(&file)?;
        if file.whole(&hidden)? != code {
            let message = format!("`{name}` was changed meanwhile");
            return Err(Failure::new(Exit::Plugin, message).hint("run the command again"));
        }
        lock.pin(&file, &introduction.descriptors, &code);
        let Some(entry) = lock.entry(&file) else {
            continue;
        };
        let state = match before {
            None => State::Pinned,
            Some(before) if before == *entry => State::Unchanged,
            Some(_) => State::Updated,
        };
        lines.push(Line::new(state, entry));
    }
    Ok(lines)
}

/// The file that is to be pinned: one of the lock, or one that is found as by any other
/// command. Nothing that is pinned and was changed is started to find it.
fn file_of(lock: &Lock, name: &str) -> Result<PluginFile> {
    let entry = lock
        .pinned()
        .iter()
        .find(|entry| is_meant(lock, entry, name));
    if let Some(entry) = entry {
        return Ok(PluginFile::at(&lock.locate(&entry.path))?);
    }
    let searching: Runtime = runtime(Trust {
        lock: Some(lock.clone()),
        locked: false,
    })?;
    let file = Discovery::from_environment()
        .find(&searching, None, name)?
        .file;
    if file == PluginFile::BuiltIn {
        let message = format!("`{name}` is built in: it changes with this program alone");
        return Err(Failure::new(Exit::Usage, message).hint("pin plugins that are files"));
    }
    Ok(file)
}

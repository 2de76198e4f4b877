//! Discovery of plugins: by path, on the plugin path, or linked in.

use std::num::NonZero;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread;

use fleetyard_abi::{Descriptor, Kind};
use fleetyard_core::nearest;

use crate::folders::{Discovery, Origin};
use crate::lock_file::Standing;
use crate::sessions::session::Introduction;
use crate::{Fault, PluginFile, Runtime};

/// One file of the plugin path and what it has, or why it was refused.
#[derive(Debug, Clone)]
pub struct Discovered {
    /// The file.
    pub file: PluginFile,
    /// The place where it was found.
    pub origin: Origin,
    /// Its standing in the lock.
    pub standing: Standing,
    /// Its plugins.
    pub plugins: Result<Introduction, Fault>,
}

impl Discovered {
    fn has(&self, kind: Option<Kind>, id: &str) -> Option<&Descriptor> {
        let plugins = self.plugins.as_ref().ok()?;
        let wanted =
            |plugin: &&Descriptor| plugin.id == id && kind.is_none_or(|kind| kind == plugin.kind);
        plugins.descriptors.iter().find(wanted)
    }

    /// The file as users know it.
    pub fn place(&self) -> String {
        match self.file.path() {
            Some(path) => path.display().to_string(),
            None => self.origin.to_string(),
        }
    }
}

/// The first of all files that have a plugin of this kind and name is used by that
/// name; the others are shadowed by it.
pub fn first_with<'a>(found: &'a [Discovered], plugin: &Descriptor) -> Option<&'a Discovered> {
    let kind = Some(plugin.kind);
    found
        .iter()
        .find(|file| file.has(kind, &plugin.id).is_some())
}

/// A plugin that was found by name or path.
#[derive(Debug, Clone)]
pub struct Found {
    /// The file.
    pub file: PluginFile,
    /// The place where it was found.
    pub origin: Origin,
    /// Identifier of the one of the file's plugins that is meant, if the user gave one.
    pub id: Option<String>,
    /// Other files that have one of this kind and name, and are not used by it.
    pub shadowed: Vec<String>,
}

impl Discovery {
    /// Every file and what it has, in order of precedence, the built-ins last. Runs
    /// each in a process of its own, several at a time, and nothing but its
    /// descriptors; what the lock does not allow is not run at all.
    pub fn scan(&self, runtime: &Runtime) -> Vec<Discovered> {
        let mut files = self.candidates();
        files.push((PluginFile::BuiltIn, Origin::BuiltIn));
        let next = AtomicUsize::new(0);
        let described = Mutex::new(Vec::new());
        let describe = || {
            while let Some((file, _)) = files.get(next.fetch_add(1, Ordering::Relaxed)) {
                let plugins = runtime.describe(file);
                let mut described = described.lock().unwrap_or_else(PoisonError::into_inner);
                described.push((file, plugins));
            }
        };
        let several = thread::available_parallelism().map_or(1, NonZero::get);
        thread::scope(|scope| {
            for _ in 1..several.min(files.len()) {
                scope.spawn(describe);
            }
            describe();
        });
        let mut described = described
            .into_inner()
            .unwrap_or_else(PoisonError::into_inner);
        let answer = |file: &PluginFile| {
            let at = described.iter().position(|(known, _)| *known == file);
            at.map(|at| described.swap_remove(at).1)
        };
        let plugins: Vec<_> = files.iter().map(|(file, _)| file).map(answer).collect();
        let trust = &runtime.limits().trust;
        let discovered = files
            .iter()
            .zip(plugins)
            .filter_map(|((file, origin), plugins)| {
                Some(Discovered {
                    file: file.clone(),
                    origin: origin.clone(),
                    standing: trust.standing(file),
                    plugins: plugins?,
                })
            });
        discovered.collect()
    }

    /// Finds a plugin by path, `PATH:ID` or identifier, of one kind or of any.
    pub fn find(&self, runtime: &Runtime, kind: Option<Kind>, name: &str) -> Result<Found, Fault> {
        by_path(name).unwrap_or_else(|| by_name(runtime, &self.scan(runtime), kind, name))
    }

    /// The same for several names, for which the folders are searched once.
    pub fn find_all<'n>(
        &self,
        runtime: &Runtime,
        kind: Option<Kind>,
        names: impl IntoIterator<Item = &'n str>,
    ) -> Vec<Result<Found, Fault>> {
        let mut scanned: Option<Vec<Discovered>> = None;
        let find = |name| {
            by_path(name).unwrap_or_else(|| {
                let all = scanned.get_or_insert_with(|| self.scan(runtime));
                by_name(runtime, all, kind, name)
            })
        };
        names.into_iter().map(find).collect()
    }
}

/// The plugin at a path; nothing if the name is an identifier.
pub fn by_path(name: &str) -> Option<Result<Found, Fault>> {
    // `path:id` picks one of several plugins of a file.
    let (path, id) = match name.rsplit_once(':') {
        Some((path, id)) if !id.contains('/') => (path, Some(id.to_owned())),
        _ => (name, None),
    };
    let is_path = name.contains('/') || matches!(path, "." | "..") || Path::new(path).is_file();
    is_path.then(|| {
        PluginFile::at(Path::new(path)).map(|file| Found {
            file,
            origin: Origin::Path,
            id,
            shadowed: Vec::new(),
        })
    })
}

/// Picks a plugin by its identifier from what a scan found.
pub fn by_name(
    runtime: &Runtime,
    all: &[Discovered],
    kind: Option<Kind>,
    name: &str,
) -> Result<Found, Fault> {
    let named = |file: &&Discovered| file.has(kind, name).is_some();
    let first = all.iter().find(named);
    // A name that is pinned to a file stands for no other.
    let lock = runtime.limits().trust.lock.as_ref();
    if let Some((lock, entry)) = lock.and_then(|lock| Some((lock, lock.with(kind, name)?))) {
        let is_pinned = |file: &&Discovered| lock.entry(&file.file) == Some(entry);
        let pinned = all.iter().find(is_pinned);
        if let Some(Err(fault)) = pinned.map(|file| &file.plugins) {
            return Err(fault.clone());
        }
        if let Some(first) = first.filter(|first| !is_pinned(first)) {
            return Err(not_the_pinned(first, name, &lock.locate(&entry.path)));
        }
    }
    let Some(first) = first else {
        return Err(unknown(all, kind, name));
    };
    let kind = first.has(kind, name).map(|plugin| plugin.kind);
    let others = all
        .iter()
        .filter(|file| file.file != first.file && file.has(kind, name).is_some());
    Ok(Found {
        file: first.file.clone(),
        origin: first.origin.clone(),
        id: Some(name.to_owned()),
        shadowed: others.map(Discovered::place).collect(),
    })
}

fn unknown(all: &[Discovered], kind: Option<Kind>, name: &str) -> Fault {
    let reason = format!(
        "there is no {} `{name}`",
        kind.map_or("plugin", Kind::as_str)
    );
    let mut known: Vec<String> = Vec::new();
    for file in all {
        let Ok(introduction) = &file.plugins else {
            continue;
        };
        for plugin in &introduction.descriptors {
            let wanted = kind.is_none_or(|kind| kind == plugin.kind);
            if wanted && !known.contains(&plugin.id) {
                known.push(plugin.id.clone());
            }
        }
    }
    // Identifiers have small letters, and papers have others: `LaCAM`.
    let small = name.to_ascii_lowercase();
    let mut hint = match nearest(&small, known.iter(), 2) {
        _ if Path::new(name).is_dir() => {
            format!("{name} is a folder here: name the plugin in it, as in ./{name}/FILE")
        }
        Some(candidate) => format!("did you mean `{candidate}`?"),
        None if name.contains(',') => {
            "one name at a time: `fleetyard compare` has a --planner for each".to_owned()
        }
        None => format!(
            "known: {}; or name a file, as in ./{name}",
            known.join(", ")
        ),
    };
    if all.iter().any(|file| file.plugins.is_err()) {
        hint.push_str("; `fleetyard plugins list` says which files were refused");
    }
    Fault::Unknown {
        reason,
        hint: Some(hint),
    }
}

fn not_the_pinned(first: &Discovered, name: &str, pinned: &Path) -> Fault {
    Fault::Refused {
        reason: format!(
            "`{name}` is pinned to {}, but would be {}",
            pinned.display(),
            first.place()
        ),
        hint: Some(
            "name the file by its path, or change the order of FLEETYARD_PLUGIN_PATH".into(),
        ),
    }
}

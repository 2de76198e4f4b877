//! Paths that no plugin may read, and grants without them.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

use crate::Fault;

/// A path that is granted.
#[derive(Debug, Clone)]
pub(super) struct Grant {
    pub(super) path: PathBuf,
    /// The user whose files are shown as the plugin's own.
    pub(super) owner: Option<u32>,
    /// True if the folder's entries are granted, and not the folder: its mode closes it to
    /// others, while the plugin's file is open to them.
    pub(super) entries: bool,
}

/// Existing paths, each once, without those inside of others that are shown alike.
pub(super) fn tidy(mut grants: Vec<Grant>) -> Vec<Grant> {
    grants.retain(|grant| grant.path.is_absolute() && grant.path.symlink_metadata().is_ok());
    // Of two for one path, the one with an owner says more.
    grants.sort_by(|a, b| a.path.cmp(&b.path).then(b.owner.cmp(&a.owner)));
    let mut kept: Vec<Grant> = Vec::new();
    for grant in grants {
        let within = kept.iter().rev().find(|other| {
            let link = || {
                other
                    .path
                    .symlink_metadata()
                    .is_ok_and(|meta| meta.is_symlink())
            };
            grant.path == other.path || grant.path.starts_with(&other.path) && !link()
        });
        let adds = |other: &Grant| {
            grant.path != other.path && grant.owner.is_some() && grant.owner != other.owner
        };
        if within.is_none_or(adds) {
            kept.push(grant);
        }
    }
    kept
}

/// Paths that are granted to nobody.
#[derive(Debug)]
pub(crate) struct Hidden {
    /// Files that the host reads and writes.
    of_the_host: BTreeSet<PathBuf>,
    left_out: BTreeSet<PathBuf>,
    /// The plugin's own files, which are never hidden for their names alone.
    needed: BTreeSet<PathBuf>,
}

impl Hidden {
    pub(crate) fn new(of_the_host: &[PathBuf], left_out: &[PathBuf], needed: &[PathBuf]) -> Self {
        // A suite may have thousands of files in a folder.
        let mut folders: BTreeMap<PathBuf, PathBuf> = BTreeMap::new();
        let mut set = |paths: &[PathBuf]| {
            let mut all = BTreeSet::new();
            for path in paths {
                let path = std::path::absolute(path).unwrap_or_else(|_| path.clone());
                let meta = path.symlink_metadata();
                let (Some(folder), Some(name)) = (path.parent(), path.file_name()) else {
                    continue;
                };
                if meta.is_ok_and(|meta| meta.is_symlink()) || path.ends_with("..") {
                    all.extend(both(&path));
                    continue;
                }
                let real = folders.entry(folder.to_owned());
                let real = real.or_insert_with_key(|folder| {
                    fs::canonicalize(folder).unwrap_or_else(|_| folder.clone())
                });
                all.insert(real.join(name));
                all.insert(path);
            }
            all
        };
        Self {
            of_the_host: set(of_the_host),
            left_out: set(left_out),
            needed: set(needed),
        }
    }

    /// True if a path is hidden, or inside of what is: by its name or as what it leads to.
    /// What stands beside a file of the host under a longer name belongs to it: a journal,
    /// a lock, a part that is being written.
    pub(crate) fn has(&self, path: &Path) -> bool {
        both(path).iter().any(|path| self.has_real(path))
    }

    /// The same for a path without links in it.
    pub(crate) fn has_real(&self, path: &Path) -> bool {
        let known = |part| self.of_the_host.contains(part) || self.left_out.contains(part);
        path.ancestors().any(known) || self.is_beside(path)
    }

    fn is_beside(&self, path: &Path) -> bool {
        let Some(name) = path.file_name().map(OsStrExt::as_bytes) else {
            return false;
        };
        if self.needed.contains(path) {
            return false;
        }
        let siblings = self
            .of_the_host
            .iter()
            .filter(|other| other.parent() == path.parent());
        let mut names = siblings.filter_map(|other| Some(other.file_name()?.as_bytes()));
        names.any(|other| {
            let plain = name.strip_prefix(b".").unwrap_or(name);
            [name, plain].iter().any(|name| {
                let rest = name.strip_prefix(other);
                rest.is_some_and(|rest| matches!(rest.first(), Some(b'-' | b'.')))
            })
        })
    }

    /// True if something hidden is in a folder.
    fn is_in(&self, folder: &Path) -> bool {
        let folders = both(folder);
        let mut hidden = self.of_the_host.iter().chain(&self.left_out);
        hidden.any(|path| folders.iter().any(|folder| path.starts_with(folder)))
    }
}

/// A path as it is called and as what it is, although it need not be there.
pub(super) fn both(path: &Path) -> Vec<PathBuf> {
    let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let real = fs::canonicalize(&path).or_else(|error| {
        let (Some(folder), Some(name)) = (path.parent(), path.file_name()) else {
            return Err(error);
        };
        Ok(fs::canonicalize(folder)?.join(name))
    });
    let real = real.ok().filter(|real| *real != path);
    [path].into_iter().chain(real).collect()
}

/// Grants of which what is hidden was taken out.
#[derive(Debug, Default)]
pub(super) struct Carved {
    pub(super) grants: Vec<Grant>,
    pub(super) list: Vec<PathBuf>,
}

impl Carved {
    /// Most paths that stand for a folder with something hidden in it.
    const MOST: usize = 4000;

    /// Adds a grant without what is hidden in it.
    pub(super) fn carve(&mut self, grant: Grant, hidden: &Hidden) -> Result<(), Fault> {
        let meta = grant.path.symlink_metadata();
        let is_folder = meta.is_ok_and(|meta| meta.is_dir());
        if hidden.has(&grant.path) {
            return Ok(());
        }
        if !is_folder || !grant.entries && !hidden.is_in(&grant.path) {
            self.grants.push(grant);
            return Ok(());
        }
        let entries = fs::read_dir(&grant.path).into_iter().flatten().flatten();
        let mut paths: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
        paths.sort();
        if self.grants.len() + paths.len() > Self::MOST {
            return Err(Fault::Refused {
                reason: format!(
                    "{} has more than {} entries beside something that is kept from plugins, as \
                     a store, a suite or a scenario is",
                    grant.path.display(),
                    Self::MOST
                ),
                hint: Some("put the plugin and the files of the run into different folders".into()),
            });
        }
        self.list.push(grant.path);
        for path in paths {
            let entry = Grant {
                path,
                owner: grant.owner,
                entries: false,
            };
            self.carve(entry, hidden)?;
        }
        Ok(())
    }
}

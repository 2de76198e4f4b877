//! Reads bundles, and finds the trials that are to be made again.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Component, Path, PathBuf};

use fleetyard_core::{InputError, open_regular, read_file, shown};
use fleetyard_runtime::{Attach, Level};

use super::SUITE;
use super::archive::{MANIFEST_LIMIT, Unpack, digest_of, unpack};
use super::manifest::{BundledFile, MANIFEST, Manifest};
use crate::experiment::Experiment;
use crate::row::Row;
use crate::suite::Suite;

type Result<T> = std::result::Result<T, InputError>;

/// A bundle in a folder, every file of which is what the manifest says.
#[derive(Debug, Clone)]
pub struct Bundle {
    /// The folder, without links.
    pub root: PathBuf,
    /// Its manifest.
    pub manifest: Manifest,
}

impl Bundle {
    /// Unpacks an archive into a new folder. What is written before an error stays there.
    pub fn unpack(archive: &Path, into: &Path) -> Result<Self> {
        let file = open_regular(archive)?;
        let mut folder = Folder { root: into };
        let source = archive.display().to_string();
        let manifest = unpack(&source, io::BufReader::new(file), &mut folder)?;
        folder
            .create(MANIFEST, false)?
            .write_all(&manifest.text())
            .map_err(|error| unwritten(into, &error))?;
        Ok(Self {
            root: real(into)?,
            manifest,
        })
    }

    /// Takes a folder that an archive was unpacked into, and looks at every file.
    pub fn open(folder: &Path) -> Result<Self> {
        let place = folder.join(MANIFEST);
        let text = read_file(&place, MANIFEST_LIMIT)?;
        let manifest = Manifest::read(&place.display().to_string(), &text)?;
        let root = real(folder)?;
        for file in &manifest.files {
            let path = root.join(&file.path);
            let fault = |reason: String| {
                InputError::new(path.display().to_string(), reason)
                    .hint("the folder is not as it was unpacked; unpack the archive anew")
            };
            let meta = path.symlink_metadata();
            let is_file = meta.map_err(|error| fault(format!("cannot be read: {error}")))?;
            if !is_file.is_file() {
                return Err(fault("this is no plain file".to_owned()));
            }
            let (bytes, sha256) = digest_of(&mut open_regular(&path)?)
                .map_err(|error| fault(format!("cannot be read: {error}")))?;
            if bytes != file.bytes || sha256 != file.sha256 {
                return Err(fault(
                    "the file is not what the manifest says: its SHA-256 differs".to_owned(),
                ));
            }
        }
        Ok(Self { root, manifest })
    }

    /// The store of the bundle.
    pub fn store(&self) -> PathBuf {
        self.root.join(format!("{}.sqlite", self.manifest.suite))
    }

    /// The suite of the bundle, which somebody else has written: it may name files of the bundle and
    /// no others, nothing of this environment is told to it, and a plugin that comes along runs in a
    /// sandbox.
    pub fn suite(&self) -> Result<Suite> {
        let place = self.root.join(SUITE);
        let source = place.display().to_string();
        let fault =
            |reason: String, hint: &str| InputError::new(source.as_str(), reason).hint(hint);
        let asked = RefCell::default();
        let variable = |name: &str| {
            asked.replace(Some(shown(name)));
            None
        };
        let suite = Suite::load_in(&place, &[], &variable);
        let inside = |path: &Path| {
            let rest = path.strip_prefix(&self.root);
            rest.is_ok_and(|rest| {
                rest.components()
                    .all(|part| matches!(part, Component::Normal(_)))
            })
        };
        let hint = "unpack the archive, look at its suite, and run it by `fleetyard bench`";
        if let Some(name) = asked.take() {
            let reason = format!("the suite asks for your environment variable `{name}`");
            return Err(fault(reason, hint));
        }
        let suite = suite?;
        if suite.name != self.manifest.suite {
            let reason = format!("the suite is `{}`, and the manifest's another", suite.name);
            return Err(fault(reason, hint));
        }
        if let Some(path) = suite.named().iter().find(|path| !inside(path)) {
            let path = shown(&path.display().to_string());
            let reason = format!("the suite names {path}, which is not in the bundle");
            return Err(fault(reason, hint));
        }
        let mut carried = Vec::new();
        for planner in &suite.planners {
            let fleet = planner.fleet.iter();
            let modules = fleet
                .flat_map(|fleet| [&fleet.generator, &fleet.invocation, &fleet.fail_policy])
                .map(|module| (module.plugin.as_str(), None));
            let own = std::iter::once((planner.plugin.as_str(), planner.attach));
            carried.extend(
                own.chain(modules)
                    .filter(|(plugin, _)| plugin.contains('/')),
            );
        }
        if let Some((plugin, _)) = carried
            .iter()
            .find(|(plugin, _)| !inside(Path::new(plugin)))
        {
            let plugin = shown(plugin);
            let reason = format!("the suite names the plugin {plugin}, which is not in the bundle");
            return Err(fault(reason, hint));
        }
        let policy = &suite.sandbox.policy;
        let wish = if policy.level == Level::None {
            "without a sandbox"
        } else if carried
            .iter()
            .any(|(_, attach)| *attach == Some(Attach::InProcess))
        {
            "in the host's own process"
        } else if policy.network {
            "with the network"
        } else if !policy.devices.is_empty() {
            "with devices of this machine"
        } else if !policy.read.is_empty() {
            "with files of this machine to read"
        } else {
            return Ok(suite);
        };
        if carried.is_empty() {
            return Ok(suite);
        }
        Err(fault(
            format!(
                "the suite wants to run plugins of the bundle {wish}, which is not for a bundle to say"
            ),
            hint,
        ))
    }
}

fn real(folder: &Path) -> Result<PathBuf> {
    fs::canonicalize(folder)
        .map_err(|error| InputError::new(folder.display().to_string(), error.to_string()))
}

fn unwritten(place: &Path, error: &io::Error) -> InputError {
    InputError::new(
        place.display().to_string(),
        format!("cannot write: {error}"),
    )
    .hint("is there room for the bundle, and may you write there?")
}

/// Takes the files of an archive into a new folder.
struct Folder<'a> {
    root: &'a Path,
}

impl Folder<'_> {
    fn create(&self, name: &str, executable: bool) -> Result<File> {
        let path = self.root.join(name);
        let folder = path.parent().map_or(Ok(()), fs::create_dir_all);
        folder
            .and_then(|()| {
                File::options()
                    .write(true)
                    // Nothing is replaced, and no link is followed.
                    .create_new(true)
                    .mode(if executable { 0o755 } else { 0o644 })
                    .open(&path)
            })
            .map_err(|error| unwritten(&path, &error))
    }
}

impl Unpack for Folder<'_> {
    fn begin(&mut self, manifest: &Manifest) -> Result<()> {
        fs::create_dir(self.root).map_err(|error| unwritten(self.root, &error))?;
        let room = rustix::fs::statvfs(self.root).map_or(u64::MAX, |found| {
            found.f_bavail.saturating_mul(found.f_frsize)
        });
        let bytes = manifest.bytes();
        if bytes > room {
            let reason = format!("the bundle has {bytes} bytes, and the disk has room for {room}");
            return Err(InputError::new(self.root.display().to_string(), reason)
                .hint("unpack it somewhere else with --into"));
        }
        Ok(())
    }

    fn file(&mut self, file: &BundledFile) -> Result<Box<dyn Write>> {
        let file = self.create(&file.path, file.executable)?;
        Ok(Box::new(BufWriter::new(file)))
    }
}

/// The recorded trials of a bundle under the keys that they have here, where the code of planners may
/// be another.
pub fn recorded(experiment: &Experiment<'_>, rows: Vec<Row>) -> Result<Vec<Row>> {
    let mut by_number: BTreeMap<u64, Row> = rows.into_iter().map(|row| (row.trial, row)).collect();
    let schedule = experiment.schedule();
    let mut found = Vec::new();
    for planned in schedule.trials() {
        let Some(mut row) = by_number.remove(&planned.number) else {
            continue;
        };
        let label = &experiment.planners()[planned.planner].label;
        let instance = &experiment.instances()[planned.instance];
        let place = || format!("trial {}", planned.number);
        if row.planner != *label || row.seed != planned.seed || row.repeat != planned.repeat {
            let reason = "the store has this trial of another planner, seed or repeat";
            return Err(
                InputError::new(place(), reason).hint("the store does not belong to the suite")
            );
        }
        let digest = instance.digest()?.to_string();
        if row.instance_digest != digest {
            let reason = format!(
                "{instance} is another instance here: its digest is {digest}, and was {}",
                shown(&row.instance_digest)
            );
            return Err(InputError::new(place(), reason)
                .hint("use the version of fleetyard that wrote the bundle"));
        }
        row.key = schedule.key(&planned);
        found.push(row);
    }
    Ok(found)
}

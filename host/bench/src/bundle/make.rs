//! Writes bundles.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io::{self, Cursor, Read};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use fleetyard_core::{Digest, InputError, open_regular, shown};
use fleetyard_runtime::{CodeFile, Fault, PluginFile};
use serde_json::Value;
use tempfile::TempDir;

use super::archive::{self, digest_of};
use super::manifest::{
    BundledFile, BundledModule, BundledPlanner, BundledPlans, Manifest, fault_of, name_fault,
};
use super::rewrite::{Names, PluginPlace, Rewritten, rewrite};
use super::{PLANS, SUITE};
use crate::experiment::key_of;
use crate::options::Robots;
use crate::row::Row;
use crate::store::{Meta, Store};
use crate::suite::{SUITE_LIMIT, Suite, SuiteInstance, to_toml};

type Result<T> = std::result::Result<T, InputError>;

/// The parts of a bundle that is to be written.
#[derive(Debug, Clone, Copy)]
pub struct Wanted<'a> {
    /// The store.
    pub store: &'a Path,
    /// The suite's file, if it is no longer where it was: what it says is taken from the store, and
    /// paths in it are relative to its folder.
    pub suite: Option<&'a Path>,
    /// The archive to write; the suite's name with `.bundle.tar.gz` in the current folder if there
    /// is none.
    pub out: Option<&'a Path>,
    /// True if the files of plugins come along.
    pub plugins: bool,
}

/// A bundle that was written.
#[derive(Debug, Clone)]
pub struct Bundled {
    /// The archive.
    pub out: PathBuf,
    /// Its manifest.
    pub manifest: Manifest,
}

/// The content of a file of a bundle.
enum Content {
    Text(Vec<u8>),
    File(PathBuf),
}

/// Writes a finished suite into one archive.
pub fn bundle(wanted: &Wanted<'_>) -> Result<Bundled> {
    let store = Store::open_read_only(wanted.store)?;
    let meta = store.meta()?;
    let rows = finished(&store, &meta)?;
    let suite = read_suite(wanted, &meta)?;
    let out = match wanted.out {
        Some(out) => out.to_owned(),
        None => PathBuf::from(format!("{}.bundle.tar.gz", suite.name)),
    };
    let place = out.display().to_string();
    if out.symlink_metadata().is_ok() {
        return Err(InputError::new(place, "there is a file of this name")
            .hint("remove it, or name another one with --out"));
    }
    let mut hidden = suite.sandbox.policy.hidden.clone();
    hidden.extend(suite.files()?);
    hidden.extend([
        out.clone(),
        wanted.store.to_owned(),
        crate::Manifest::path(wanted.store),
    ]);
    hidden.extend(wanted.suite.map(Path::to_owned));
    let (instances, sources) = suite.instances_and_sources()?;
    unchanged(&suite, &instances, &rows, &meta, wanted.store)?;
    let mut names = Names::default();
    let ids: BTreeMap<String, String> = (rows.iter())
        .map(|row| (row.planner.clone(), row.planner_id.clone()))
        .collect();
    let files = &meta.places.planners;
    let rewritten = rewrite(&suite, &sources, files, &ids, wanted.plugins, &mut names)?;
    let folder = out.parent().filter(|folder| *folder != Path::new(""));
    let folder = folder.unwrap_or(Path::new("."));
    let scratch = tempfile::Builder::new()
        .prefix(".fleetyard-bundle-")
        .tempdir_in(folder)
        .map_err(|error| InputError::new(place.as_str(), format!("cannot write: {error}")))?;
    let mut contents: BTreeMap<String, Content> = (names.files.into_iter())
        .map(|(name, file)| (name, Content::File(file)))
        .collect();
    let copy = scratch.path().join("store");
    store.copy(&copy)?;
    contents.insert(format!("{}.sqlite", suite.name), Content::File(copy));
    contents.insert(SUITE.to_owned(), Content::Text(suite_text(&rewritten)?));
    let beside = crate::Manifest::path(wanted.store);
    if beside.is_file() {
        let name = format!("{}.manifest.json", suite.name);
        contents.insert(name, Content::File(beside));
    }
    let plans = plans(&store, &rows, &scratch, &mut contents)?;
    let mut manifest = Manifest::empty();
    manifest.fleetyard.clone_from(&meta.fleetyard);
    manifest.suite.clone_from(&suite.name);
    manifest.suite_digest.clone_from(&meta.suite_digest);
    manifest.created_unix_ms = meta.created_unix_ms;
    manifest.trials = rows.len() as u64;
    manifest.machines = store
        .machines()?
        .into_iter()
        .map(|(digest, text)| (digest, serde_json::from_str(&text).unwrap_or_default()))
        .collect();
    manifest.plans = plans;
    let reads = &suite.sandbox.policy.read;
    manifest.reads = reads
        .iter()
        .map(|path| super::rewrite::whole(path))
        .collect();
    let code = store.code()?;
    manifest.planners = planners(&suite, &rows, &code, &rewritten, wanted.plugins);
    if wanted.plugins {
        for place in rewritten.planners.values() {
            add_plugin(
                place,
                &hidden,
                Some(&code),
                &mut manifest.left_out,
                &mut contents,
            )?;
        }
    }
    for place in &rewritten.modules {
        if wanted.plugins {
            add_plugin(place, &hidden, None, &mut manifest.left_out, &mut contents)?;
        }
        manifest.modules.push(BundledModule {
            file: place.name.clone(),
            bundled: wanted.plugins,
            code: plugin(place)?
                .own_code(&hidden)
                .map_err(|fault| faulty(place, &fault))?,
        });
    }
    let text = readme(&manifest).into_bytes();
    contents.insert("README.txt".to_owned(), Content::Text(text));
    manifest.files = contents
        .iter()
        .map(|(name, content)| entry(name, content))
        .collect::<Result<_>>()?;
    if let Some(reason) = fault_of(&manifest.files) {
        return Err(InputError::new(place, reason));
    }
    let draft = scratch.path().join("archive");
    let file = File::create_new(&draft)
        .map_err(|error| InputError::new(place.as_str(), format!("cannot write: {error}")))?;
    archive::write(&file, &manifest, &mut |file| match &contents[&file.path] {
        Content::Text(text) => Ok(Box::new(Cursor::new(text.clone()))),
        Content::File(path) => Ok(Box::new(open_regular(path)?)),
    })
    .map_err(|error| InputError {
        source: format!("{place}: {}", error.source),
        ..error
    })?;
    // Nothing is replaced.
    fs::hard_link(&draft, &out)
        .or_else(|_| fs::rename(&draft, &out))
        .map_err(|error| InputError::new(place, format!("cannot write: {error}")))?;
    Ok(Bundled { out, manifest })
}

/// The trials of a store that has all that its suite asks for.
fn finished(store: &Store, meta: &Meta) -> Result<Vec<Row>> {
    let rows = store.rows()?;
    let place = store.path().display().to_string();
    let asked = meta.asked.unwrap_or(rows.len() as u64);
    if rows.is_empty() || (rows.len() as u64) < asked {
        let reason = format!("the store has {} of {asked} trials", rows.len());
        return Err(InputError::new(place, reason).hint(
            "a bundle is of a suite that was run to its end: go on with `fleetyard bench SUITE \
             --resume`, or join its parts by `fleetyard store merge`",
        ));
    }
    Ok(rows)
}

/// The suite as the store has it, with paths as its file had them.
fn read_suite(wanted: &Wanted<'_>, meta: &Meta) -> Result<Suite> {
    let place = wanted.suite.or(meta.places.suite.as_deref());
    let Some(place) = place else {
        let reason = "the store does not say where its suite was";
        return Err(InputError::new(wanted.store.display().to_string(), reason)
            .hint("name the suite's file with --suite"));
    };
    let folder = place.parent().unwrap_or(Path::new(""));
    let variable = |name: &str| std::env::var(name).ok();
    let source = place.display().to_string();
    let read = Suite::read(&source, &meta.suite_text, &[], folder, &variable);
    if let Ok(suite) = &read
        && suite.normal() == meta.suite_values
    {
        return read;
    }
    // With values of a command line.
    let values: Value = serde_json::from_str(&meta.suite_values).unwrap_or_default();
    let source = format!("{source}, as the store has it");
    let again = Suite::of_values(&source, &values, folder, &variable);
    // What is wrong with both is said with its place in the file.
    again.map_err(|error| read.err().unwrap_or(error))
}

fn suite_text(rewritten: &Rewritten) -> Result<Vec<u8>> {
    let text = to_toml(&Value::Object(rewritten.values.clone()))?;
    if text.len() as u64 > SUITE_LIMIT {
        let reason = format!(
            "with the names of all its files the suite has {} bytes, and one may have {SUITE_LIMIT}",
            text.len()
        );
        return Err(InputError::new("suite", reason).hint("split the suite"));
    }
    Ok(text.into_bytes())
}

/// Refuses inputs that are no longer what the trials were made on.
fn unchanged(
    suite: &Suite,
    instances: &[SuiteInstance],
    rows: &[Row],
    meta: &Meta,
    store: &Path,
) -> Result<()> {
    let hint = "put the file back as it was, or make the trials anew by `fleetyard bench SUITE \
                --resume`";
    let rounds = suite.protocol.seeds.len() as u64 * u64::from(suite.protocol.repeats);
    let each = rounds * suite.planners.len() as u64;
    // Who planned on views of a representation does so on all of them.
    let claims: BTreeSet<(&str, Option<&str>)> = rows
        .iter()
        .map(|row| (row.planner.as_str(), row.representation.as_deref()))
        .collect();
    let planners = |instance: &SuiteInstance| {
        let Some(view) = instance.view() else {
            return suite.planners.len();
        };
        let representation = Some(view.spec.representation().name());
        let planners = suite.planners.iter();
        let asked = planners.filter(|one| claims.contains(&(one.label.as_str(), representation)));
        asked.count()
    };
    let asked = rounds * instances.iter().map(planners).sum::<usize>() as u64;
    if asked != rows.len() as u64 {
        let reason = format!(
            "the suite asks for {asked} trials, and the store has {}: files that it names are there \
             that were not, or the other way round",
            rows.len()
        );
        return Err(InputError::new(store.display().to_string(), reason).hint(hint));
    }
    let mut twins: BTreeMap<Digest, u64> = BTreeMap::new();
    let mut digests = Vec::new();
    for instance in instances {
        let digest = instance.digest()?;
        let count = twins.entry(digest).or_default();
        digests.push((digest, *count));
        *count += 1;
    }
    for row in rows {
        let at = usize::try_from(row.trial / each).unwrap_or(usize::MAX);
        let (Some(instance), Some((digest, _))) = (instances.get(at), digests.get(at)) else {
            let reason = format!("trial {} is none of the suite's", row.trial);
            return Err(InputError::new(store.display().to_string(), reason).hint(hint));
        };
        if row.instance_digest == digest.to_string() {
            continue;
        }
        let (place, others) = match instance.places().as_slice() {
            [] => (suite.name.clone(), String::new()),
            [only] => (only.display().to_string(), String::new()),
            [others @ .., named] => {
                let what = if instance.view().is_some() {
                    "a file that it names"
                } else {
                    "its map"
                };
                let others: Vec<String> = others
                    .iter()
                    .map(|other| other.display().to_string())
                    .collect();
                (
                    named.display().to_string(),
                    format!(", or {what} {},", others.join(", ")),
                )
            }
        };
        let reason = format!(
            "the file{others} changed since the trials were made: {instance} has the digest \
             {digest}, and had {}",
            shown(&row.instance_digest)
        );
        return Err(InputError::new(place, reason).hint(hint));
    }
    // Robots are a part of what is asked; of fleets the plugins would be needed to say it.
    let lifelong = suite.planners.iter().any(|planner| planner.fleet.is_some());
    let ours = meta.fleetyard == env!("CARGO_PKG_VERSION");
    if let Some(Robots::File(file, _)) = suite.robots.as_ref().filter(|_| ours && !lifelong) {
        let changed = rows.iter().find(|row| {
            let with_twins = digests[(row.trial / each) as usize];
            key_of(suite, row, with_twins).is_some_and(|key| key != row.key)
        });
        if changed.is_some() {
            let reason = "the file changed since the trials were made: their keys are others";
            return Err(InputError::new(file.as_str(), reason).hint(hint));
        }
    }
    Ok(())
}

/// Takes the plans that the store has kept, as files of their own.
fn plans(
    store: &Store,
    rows: &[Row],
    scratch: &TempDir,
    contents: &mut BTreeMap<String, Content>,
) -> Result<BundledPlans> {
    let mut asked: BTreeSet<(String, u32, u32)> = rows
        .iter()
        .filter_map(|row| {
            let [rows, cols] = [row.map_rows, row.map_cols].map(Option::unwrap_or_default);
            Some((row.plan_digest.clone()?, rows, cols))
        })
        .collect();
    let mut kept = 0;
    store.plans(&mut |plan| {
        // Those of an earlier state are in the store.
        if !asked.remove(&(plan.digest.clone(), plan.map_rows, plan.map_cols)) {
            return Ok(());
        }
        let mut name = format!("{PLANS}/{}.json", plan.digest);
        if contents.contains_key(&name) {
            let size = format!("{}x{}", plan.map_rows, plan.map_cols);
            name = format!("{PLANS}/{}-{size}.json", plan.digest);
        }
        let file = scratch.path().join(format!("plan-{kept}"));
        fs::write(&file, &plan.file).map_err(|error| {
            InputError::new(file.display().to_string(), format!("cannot write: {error}"))
        })?;
        contents.insert(name, Content::File(file));
        kept += 1;
        Ok(())
    })?;
    Ok(BundledPlans {
        kept,
        not_kept: asked.len() as u64,
    })
}

fn planners(
    suite: &Suite,
    rows: &[Row],
    code: &BTreeMap<String, Vec<CodeFile>>,
    rewritten: &Rewritten,
    plugins: bool,
) -> Vec<BundledPlanner> {
    let first: BTreeMap<&str, &Row> = (rows.iter().rev())
        .map(|row| (row.planner.as_str(), row))
        .collect();
    let rows = suite.planners.iter().filter_map(|planner| {
        let row = first.get(planner.label.as_str())?;
        let place = rewritten.planners.get(&planner.label);
        let digest = row.planner_digest.clone();
        let files = digest.as_ref().and_then(|digest| code.get(digest));
        Some(BundledPlanner {
            label: planner.label.clone(),
            id: row.planner_id.clone(),
            version: row.planner_version.clone(),
            attach: row.attach.clone(),
            options: serde_json::from_str(&row.options).unwrap_or_default(),
            built_in: row.built_in.unwrap_or(false),
            code: files.cloned().unwrap_or_default(),
            digest,
            file: place.map(|place| place.name.clone()),
            bundled: place.is_some() && plugins,
        })
    });
    rows.collect()
}

fn plugin(place: &PluginPlace) -> Result<PluginFile> {
    PluginFile::at(&place.file).map_err(|fault| faulty(place, &fault))
}

fn faulty(place: &PluginPlace, fault: &Fault) -> InputError {
    InputError::new(place.file.display().to_string(), fault.to_string())
        .hint("without --plugins a bundle has the digests of plugins and not their files")
}

/// Takes the files of a plugin that are its own, which have to be what the store has recorded.
fn add_plugin(
    place: &PluginPlace,
    hidden: &[PathBuf],
    recorded: Option<&BTreeMap<String, Vec<CodeFile>>>,
    left_out: &mut Vec<PathBuf>,
    contents: &mut BTreeMap<String, Content>,
) -> Result<()> {
    let file = plugin(place)?;
    let code = file
        .own_code(hidden)
        .map_err(|fault| faulty(place, &fault))?;
    if let Some(recorded) = recorded {
        let changed = code.iter().find(|file| {
            let same = |known: &CodeFile| known.sha256 == file.sha256;
            !recorded.values().flatten().any(same)
        });
        if let Some(changed) = changed {
            let reason = "the file changed since the trials were made: its SHA-256 is another one";
            return Err(InputError::new(changed.path.display().to_string(), reason)
                .hint("put it back as it was, make the trials anew, or leave --plugins out"));
        }
    }
    let base = place.file.parent().unwrap_or(Path::new(""));
    let started = file.code().map_err(|fault| faulty(place, &fault))?;
    for one in code {
        let is_code = started.iter().any(|code| code.path == one.path);
        let link = (one.path.symlink_metadata()).is_ok_and(|meta| meta.is_symlink());
        let inside = one.path.strip_prefix(base).ok().and_then(Path::to_str);
        let name = inside.map(|inside| format!("{}/{inside}", place.folder));
        match name.filter(|name| name_fault(name).is_none() && (is_code || !link)) {
            Some(name) => {
                contents.insert(name, Content::File(one.path));
            }
            None => left_out.push(one.path),
        }
    }
    Ok(())
}

/// The entry of a file in the manifest.
fn entry(name: &str, content: &Content) -> Result<BundledFile> {
    let mut executable = false;
    let mut reader: Box<dyn Read> = match content {
        Content::Text(text) => Box::new(text.as_slice()),
        Content::File(path) => {
            let file = open_regular(path)?;
            let program = |file: &File| -> io::Result<bool> {
                Ok(file.metadata()?.permissions().mode() & 0o100 != 0)
            };
            executable = name.starts_with("plugins/") && program(&file).unwrap_or(false);
            Box::new(file)
        }
    };
    let (bytes, sha256) = digest_of(&mut reader)
        .map_err(|error| InputError::new(name, format!("cannot be read: {error}")))?;
    Ok(BundledFile {
        path: name.to_owned(),
        bytes,
        sha256,
        executable,
    })
}

/// The README of a bundle.
fn readme(manifest: &Manifest) -> String {
    let Manifest { suite, trials, .. } = manifest;
    let plans = match (manifest.plans.kept, manifest.plans.not_kept) {
        (0, _) => "Plans were not kept; they come out of repeating.\n".to_owned(),
        (_, 0) => "plans/ has the plan of every trial, named by its digest.\n".to_owned(),
        (_, lost) => {
            format!("plans/ has the plans of the trials, named by their digests, but for {lost}.\n")
        }
    };
    let missing: String = manifest
        .planners
        .iter()
        .filter(|planner| !planner.bundled && !planner.built_in)
        .map(|planner| match &planner.file {
            Some(file) => format!(
                "The planner \"{}\" is not in here: put its files so that there is {file}.\n",
                planner.label
            ),
            None => format!(
                "The planner \"{}\" is not in here: install the plugin {}.\n",
                planner.label, planner.id
            ),
        })
        .collect();
    format!(
        "This is the suite \"{suite}\" with all that its {trials} trials were made of: maps, scenarios, \
         settings\nand results, written by fleetyard {}.\n\n\
         To make the trials again and compare plans and executions, in this folder:\n\n    \
         fleetyard store repeat .\n\n\
         {suite}.sqlite has the results (fleetyard report {suite}.sqlite), suite.toml what was asked,\n\
         manifest.json who was asked, on which machine, and the SHA-256 of every file.\n{plans}{missing}",
        manifest.fleetyard
    )
}

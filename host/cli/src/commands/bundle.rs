//! `fleetyard store bundle` and `fleetyard store repeat`: a finished suite in one archive, and its
//! trials once more out of it.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use clap::Args;
use fleetyard_abi::Kind;
use fleetyard_bench::bundle::{Bundle, BundledPlanner, BundledPlans, Wanted, bundle, recorded};
use fleetyard_bench::suite::Suite;
use fleetyard_bench::{Experiment, Plugin, Shard, Store, Verified};
use fleetyard_core::{InputError, quoted};
use fleetyard_runtime::{Discovery, on_interrupt};
use serde::Serialize;
use tempfile::TempDir;

use super::bench::{make_again, verdict, verification_text};
use crate::args::{Format, TrustArgs};
use crate::exit::{Exit, Failure, Result, internal};
use crate::output;
use crate::setup::{BUILT_IN, runtime_with, trust};

/// Write a finished suite into one archive, from which others repeat it.
#[derive(Debug, Args)]
pub(crate) struct StoreBundle {
    /// The store
    store: PathBuf,
    /// The suite's file, if it is no longer where it was: paths in it are relative to its folder
    #[arg(long, value_name = "FILE")]
    suite: Option<PathBuf>,
    /// The archive to write [default: the suite's name with .bundle.tar.gz, in the current folder]
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Take the files of plugins along, which are somebody's; their digests always are
    #[arg(long)]
    plugins: bool,
    #[command(flatten)]
    format: Format,
}

/// Make the trials of a bundle again and compare plans and executions; exit code 1 if any differs.
#[derive(Debug, Args)]
pub(crate) struct StoreRepeat {
    /// The archive, or the folder that it was unpacked into
    bundle: PathBuf,
    /// A new folder to unpack it into, which stays [default: one that is removed]
    #[arg(long, value_name = "DIR")]
    into: Option<PathBuf>,
    /// Number of trials to make again, spread evenly over planners and instances [default: all]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    sample: Option<u64>,
    #[command(flatten)]
    trust: TrustArgs,
    #[command(flatten)]
    format: Format,
}

/// The bundle that was written, as JSON.
#[derive(Serialize)]
struct Written<'a> {
    format: &'static str,
    bundle: &'a Path,
    suite: &'a str,
    trials: u64,
    files: usize,
    bytes: u64,
    plans: BundledPlans,
    /// Planners whose files are not in it.
    without: Vec<&'a str>,
    left_out: &'a [PathBuf],
    reads: &'a [PathBuf],
}

pub(super) fn bundle_store(arguments: &StoreBundle) -> Result<Exit> {
    let made = bundle(&Wanted {
        store: &arguments.store,
        suite: arguments.suite.as_deref(),
        out: arguments.out.as_deref(),
        plugins: arguments.plugins,
    })?;
    let manifest = &made.manifest;
    let away = |planner: &&BundledPlanner| !planner.built_in && !planner.bundled;
    let written = Written {
        format: "fleetyard.bundled/1",
        bundle: &made.out,
        suite: &manifest.suite,
        trials: manifest.trials,
        // The manifest itself is one more.
        files: manifest.files.len() + 1,
        bytes: manifest.bytes(),
        plans: manifest.plans,
        without: (manifest.planners.iter().filter(away))
            .map(|planner| planner.label.as_str())
            .collect(),
        left_out: &manifest.left_out,
        reads: &manifest.reads,
    };
    for file in written.left_out {
        let file = file.display();
        output::note(&format!(
            "{file} is not in the plugin's folder, or a link, and is left out"
        ));
    }
    for path in written.reads {
        let path = path.display();
        output::note(&format!("planners may read {path}, which is left out"));
    }
    match arguments.format {
        Format::Json => output::print_json(&written)?,
        Format::Text => {
            let mut text = format!(
                "bundle    {}\nsuite     {}\ntrials    {}\nfiles     {} of {:.1} MiB\nplans     ",
                written.bundle.display(),
                written.suite,
                written.trials,
                written.files,
                written.bytes as f64 / f64::from(1 << 20),
            );
            let _ = match (written.plans.kept, written.plans.not_kept) {
                (0, _) => write!(text, "not kept, so that they come out of repeating"),
                (kept, 0) => write!(text, "{kept}"),
                (kept, lost) => write!(text, "{kept}; {lost} were not kept"),
            };
            if !written.without.is_empty() {
                let names = written.without.join(", ");
                let _ = write!(text, "\nwithout   the files of {names}");
            }
            let _ = write!(
                text,
                "\nrepeat    fleetyard store repeat {}",
                quoted(&written.bundle.display().to_string())
            );
            output::print(&output::plain(&text))?;
        }
    }
    Ok(Exit::Success)
}

/// A planner's code here, beside what the trials were made with.
#[derive(Debug, Serialize)]
struct Standing<'a> {
    planner: &'a str,
    id: &'a str,
    version: &'a str,
    code: Code,
    recorded: Option<&'a str>,
    here: Option<String>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
enum Code {
    Same,
    Other,
    Missing,
}

/// Result of making a bundle's trials again, as JSON.
#[derive(Serialize)]
struct Repeated<'a> {
    format: &'static str,
    bundle: &'a Path,
    /// Folder into which it was unpacked and in which it stays.
    folder: Option<&'a Path>,
    suite: &'a str,
    planners: &'a [Standing<'a>],
    #[serde(flatten)]
    verified: &'a Verified,
}

pub(super) fn repeat(arguments: &StoreRepeat) -> Result<Exit> {
    let is_folder = arguments.bundle.is_dir();
    let (bundle, _scratch) = if is_folder {
        if arguments.into.is_some() {
            let reason = "--into says where an archive is unpacked, and this is a folder";
            return Err(Failure::new(Exit::Usage, reason).hint("leave --into out"));
        }
        (Bundle::open(&arguments.bundle)?, None)
    } else {
        unpacked(&arguments.bundle, arguments.into.as_deref())?
    };
    let mut suite = bundle.suite()?;
    let rows = Store::open_read_only(&bundle.store())?.rows()?;
    let trust = trust(&arguments.trust)?;
    let hidden = &mut suite.sandbox.policy.hidden;
    hidden.extend(
        ["suite.toml", "manifest.json", "plans", "inputs"].map(|name| bundle.root.join(name)),
    );
    hidden.extend([
        bundle.store(),
        bundle.store().with_extension("manifest.json"),
    ]);
    let runtime = runtime_with(suite.sandbox.policy.clone(), trust.clone())?;
    let names = suite.planners.iter().map(|planner| planner.plugin.as_str());
    let kind = Kind::Planner;
    let found = Discovery::from_environment().find_all(&runtime, Some(kind), names.clone());
    let here: BTreeMap<&str, std::result::Result<String, String>> = suite
        .planners
        .iter()
        .zip(found)
        .map(|(planner, found)| {
            let plugin =
                found.and_then(|found| Plugin::new(&runtime, found, kind, &planner.plugin));
            let digest = plugin.map(|plugin| plugin.digest().to_string());
            (
                planner.label.as_str(),
                digest.map_err(|fault| fault.to_string()),
            )
        })
        .collect();
    let planners = bundle.manifest.planners.iter();
    let planners: Vec<Standing<'_>> = planners
        .map(|planner| {
            let here = here.get(planner.label.as_str());
            let here = here.and_then(|here| here.as_ref().ok());
            Standing {
                planner: &planner.label,
                id: &planner.id,
                version: &planner.version,
                code: match here {
                    None => Code::Missing,
                    here if here == planner.digest.as_ref() => Code::Same,
                    Some(_) => Code::Other,
                },
                recorded: planner.digest.as_deref(),
                here: here.cloned(),
            }
        })
        .collect();
    if planners.iter().any(|planner| planner.code == Code::Missing) {
        let kept = is_folder || arguments.into.is_some();
        return Err(missing(&bundle, &suite, &here, kept));
    }
    let mut experiment = Experiment::new(&suite, BUILT_IN, trust)?;
    let rows = recorded(&experiment, rows)?;
    let verified = make_again(&mut experiment, Shard::ALL, &rows, arguments.sample)?;
    if verified.equal + verified.not_comparable + verified.differ.len() as u64 == 0 {
        let place = arguments.bundle.display().to_string();
        return Err(InputError::new(place, "the bundle has no trial of its suite").into());
    }
    match arguments.format {
        Format::Json => output::print_json(&Repeated {
            format: "fleetyard.repeat/1",
            bundle: &arguments.bundle,
            folder: arguments.into.as_deref(),
            suite: &suite.name,
            planners: &planners,
            verified: &verified,
        })?,
        Format::Text => {
            let mut text = table(&planners);
            text += "\n\n";
            text += &verification_text(&verified, 0);
            output::print(&output::plain(&text))?;
        }
    }
    Ok(verdict(&verified))
}

/// The bundle, and a folder that goes when it is dropped. An archive that is refused leaves
/// nothing.
fn unpacked(archive: &Path, into: Option<&Path>) -> Result<(Bundle, Option<TempDir>)> {
    let prefix = ".fleetyard-repeat-";
    let scratch = match into {
        None => tempfile::Builder::new().prefix(prefix).tempdir(),
        Some(into) => {
            if into.symlink_metadata().is_ok() {
                let place = into.display().to_string();
                return Err(InputError::new(place, "there is something of this name")
                    .hint("unpack into a new folder, or name the folder in place of the archive")
                    .into());
            }
            let parent = into.parent().filter(|parent| *parent != Path::new(""));
            let parent = parent.unwrap_or(Path::new("."));
            tempfile::Builder::new().prefix(prefix).tempdir_in(parent)
        }
    };
    let failed = |error: std::io::Error| {
        let place = into.unwrap_or(Path::new("scratch folder"));
        InputError::new(
            place.display().to_string(),
            format!("cannot write: {error}"),
        )
    };
    let scratch = scratch.map_err(failed)?;
    let place = scratch.path().to_owned();
    on_interrupt(move |signal| {
        // Processes that still run in there end with this one.
        let _ = fs::remove_dir_all(place);
        std::process::exit(128 + signal);
    })
    .map_err(internal)?;
    let draft = scratch.path().join("bundle");
    let bundle = Bundle::unpack(archive, &draft)?;
    let Some(into) = into else {
        return Ok((bundle, Some(scratch)));
    };
    fs::rename(&draft, into).map_err(failed)?;
    let root = fs::canonicalize(into).map_err(failed)?;
    Ok((Bundle { root, ..bundle }, None))
}

/// Planners that are not here, with what would be needed.
fn missing(
    bundle: &Bundle,
    suite: &Suite,
    here: &BTreeMap<&str, std::result::Result<String, String>>,
    kept: bool,
) -> Failure {
    let mut text = String::from("planners of the bundle are not here:");
    let mut by_path = false;
    for planner in &bundle.manifest.planners {
        let Some(Err(fault)) = here.get(planner.label.as_str()) else {
            continue;
        };
        let _ = write!(
            text,
            "\n  `{}` ({} {}): {fault}",
            planner.label, planner.id, planner.version
        );
        by_path |= planner.file.is_some();
        for file in &planner.code {
            let path = file.path.display();
            let _ = write!(text, "\n    {path} with SHA-256 {}", file.sha256);
        }
    }
    let failure = Failure::new(Exit::Input, output::plain(&text));
    let root = quoted(&bundle.root.display().to_string());
    failure.hint(match (by_path, kept) {
        (true, true) => format!(
            "put their files where {} is said to be missing, and run `fleetyard store repeat {root}`",
            if suite.planners.len() == 1 { "it" } else { "each" }
        ),
        (true, false) => {
            "unpack the bundle into a folder that stays (--into DIR), put their files there, and \
             run `fleetyard store repeat DIR`"
                .to_owned()
        }
        (false, _) => "install the plugins where `fleetyard plugins list` finds them".to_owned(),
    })
}

fn table(planners: &[Standing<'_>]) -> String {
    let lines = planners.iter().map(|planner| {
        let said = match planner.code {
            Code::Same => "the same".to_owned(),
            Code::Other => match (planner.recorded, &planner.here) {
                (Some(recorded), Some(here)) => format!("another one: {recorded} was, {here} is"),
                _ => "another one".to_owned(),
            },
            Code::Missing => "missing".to_owned(),
        };
        vec![
            planner.planner.to_owned(),
            planner.id.to_owned(),
            planner.version.to_owned(),
            said,
        ]
    });
    output::table(
        &["planner", "plugin", "version", "code"],
        lines.collect(),
        &[],
    )
}

//! What a plugin needs to read, and what its environment says.
//!
//! The system's programs and libraries, the plugin's own folder, and the place where
//! its interpreter is installed. Not the user's home, not other people's files.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs;
use std::io::Read;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

use fleetyard_core::{Digest, Hasher};
use serde::{Deserialize, Serialize};

use super::Policy;
use super::root::SCRATCH;
use crate::adapter::Adapter;
use crate::python::is_python;
use crate::state::RUN;
use crate::supervisor::Target;

/// Folders and links at the root that hold programs and libraries.
const SYSTEM: &[&str] = &[
    "/usr",
    "/bin",
    "/sbin",
    "/lib",
    "/lib32",
    "/lib64",
    "/libx32",
    "/opt",
    "/nix/store",
];

/// Whether a path is the system's, which everybody may read.
pub(super) fn is_system(path: &Path) -> bool {
    let mut known = SYSTEM.iter().chain(CONFIGURATION).chain(NETWORK);
    known.any(|system| path.starts_with(system))
}

/// What programs read when they start. No users, no passwords, no machine's secrets.
const CONFIGURATION: &[&str] = &[
    "/etc/ld.so.cache",
    "/etc/ld.so.conf",
    "/etc/ld.so.conf.d",
    "/etc/alternatives",
    "/etc/localtime",
    "/etc/nsswitch.conf",
    "/etc/ssl/openssl.cnf",
    "/etc/julia",
    "/etc/java-17-openjdk",
    "/etc/java-21-openjdk",
    "/etc/mime.types",
    "/sys/devices/system/cpu",
    "/sys/devices/system/node",
];

/// More of it for those who may use the network.
const NETWORK: &[&str] = &[
    "/etc/resolv.conf",
    "/etc/hosts",
    "/etc/host.conf",
    "/etc/services",
    "/etc/ssl",
    "/etc/ca-certificates",
];

/// Where programs are searched.
const SEARCH_PATH: &str = "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin";

/// Variables that say where software is; they are passed on, and what they name may
/// be read.
const SOFTWARE: [&str; 2] = ["PYTHONPATH", "LD_LIBRARY_PATH"];

/// Variables of ours that are none of a plugin's business.
const OF_THE_HOST: [&str; 2] = ["FLEETYARD_PLUGIN_PATH", "FLEETYARD_LOCK"];

/// What a plugin may read, and its environment.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Grants {
    /// In the order in which they are mounted; parents come before children.
    pub(crate) read: Vec<PathBuf>,
    /// The plugin's environment, whole.
    pub(crate) env: BTreeMap<String, OsString>,
    /// The program to start, found on the path of whoever started the host.
    pub(crate) program: Option<PathBuf>,
    /// The file without which nothing works.
    pub(crate) file: Option<PathBuf>,
}

impl Grants {
    /// For a plugin that is started from this environment.
    pub(crate) fn new(target: &Target, policy: &Policy, threads: u32) -> Self {
        let scratch = Path::new(SCRATCH);
        let python = target.python();
        let system = SYSTEM.iter().chain(CONFIGURATION);
        let network: &[&str] = if policy.network { NETWORK } else { &[] };
        let mut read: Vec<PathBuf> = system.chain(network).map(PathBuf::from).collect();
        let mut search = Vec::new();
        let mut program = None;
        let mut file = None;
        let mut variables: Vec<String> = Vec::new();
        let mut use_program = |found: &Path, read: &mut Vec<PathBuf>| {
            read.extend(installation(found));
            search.extend(found.parent().map(Path::to_owned));
        };
        match target {
            Target::BuiltIn | Target::Nothing | Target::Attempts(_) => {}
            Target::Library(path) => {
                read.extend(around(path));
                file = Some(path.clone());
            }
            Target::Adapter(path) => {
                read.extend(around(path));
                file = Some(path.clone());
                // A manifest that cannot be read is refused by whoever reads it next.
                if let Ok(adapter) = Adapter::open(path) {
                    if let Some(interpreter) = interpreter(adapter.program()) {
                        use_program(&interpreter, &mut read);
                    }
                    use_program(adapter.program(), &mut read);
                    read.extend(adapter.readable());
                    variables = adapter
                        .variables()
                        .iter()
                        .map(ToString::to_string)
                        .collect();
                }
            }
            Target::Program(argv) => {
                let mut found = argv.first().and_then(|name| find_program(name));
                if let (Some(found), Some(python)) = (&mut found, &python) {
                    // The real one, not a script that looks for it.
                    if is_python(found) {
                        found.clone_from(&python.executable);
                    }
                    use_program(&python.executable, &mut read);
                    read.extend(
                        python
                            .read
                            .iter()
                            .filter(|path| !is_too_wide(path))
                            .cloned(),
                    );
                } else if let Some(interpreter) = found.as_deref().and_then(interpreter) {
                    use_program(&interpreter, &mut read);
                }
                if let Some(found) = &found {
                    use_program(found, &mut read);
                }
                let scripts = argv.iter().skip(1).map(PathBuf::from);
                for script in scripts.filter(|path| path.is_absolute() && path.exists()) {
                    read.extend(around(&script));
                }
                // A missing program is reported by the attempt to start it.
                program = found.or_else(|| argv.first().map(PathBuf::from));
                file.clone_from(&program);
            }
        }
        let mut env = environment(threads, scratch);
        for name in SOFTWARE {
            if let Some(value) = std::env::var_os(name).filter(|value| !value.is_empty()) {
                let folders = std::env::split_paths(&value).filter(|path| path.is_absolute());
                read.extend(folders.filter(|folder| !is_too_wide(folder)));
                env.insert(name.into(), value);
            }
        }
        if let Some(python) = &python {
            let (name, value) = python.env();
            env.insert(name.into(), value.into());
        }
        search.retain(|folder| {
            !SEARCH_PATH
                .split(':')
                .any(|known| Path::new(known) == folder)
        });
        search.extend(SEARCH_PATH.split(':').map(PathBuf::from));
        if let Ok(path) = std::env::join_paths(search) {
            env.insert("PATH".into(), path);
        }
        for name in variables.iter().filter(|name| *name != "PATH") {
            env.extend(std::env::var_os(name).map(|value| (name.clone(), value)));
        }
        env.extend(
            policy
                .env
                .iter()
                .map(|(name, value)| (name.clone(), OsString::from(value))),
        );
        read.extend(
            policy
                .read
                .iter()
                .filter_map(|path| std::path::absolute(path).ok()),
        );
        Self {
            read: tidy(read),
            env,
            program,
            file,
        }
    }

    /// Stands for the environment, without what differs from run to run.
    pub(crate) fn environment_digest(&self) -> Digest {
        let mut hasher = Hasher::new("fleetyard environment");
        for (name, value) in self.env.iter().filter(|(name, _)| *name != RUN) {
            hasher.bytes(name.as_bytes());
            hasher.bytes(value.as_bytes());
        }
        hasher.finish()
    }
}

/// The same for every plugin and on every machine: what a trial gives should not
/// depend on who started it.
fn environment(threads: u32, scratch: &Path) -> BTreeMap<String, OsString> {
    let mut env: BTreeMap<String, OsString> = [
        ("LANG", "C.UTF-8"),
        ("LC_ALL", "C.UTF-8"),
        ("TZ", "UTC"),
        ("PYTHONHASHSEED", "0"),
        ("PYTHONDONTWRITEBYTECODE", "1"),
        ("PYTHONUNBUFFERED", "1"),
    ]
    .into_iter()
    .map(|(name, value)| (name.to_owned(), OsString::from(value)))
    .collect();
    for name in ["HOME", "TMPDIR", "TMP", "TEMP", "XDG_CACHE_HOME"] {
        env.insert(name.into(), scratch.into());
    }
    // Numerical libraries start a thread per processor unless they are told.
    let most = threads.to_string();
    for name in [
        "OMP_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "MKL_NUM_THREADS",
        "NUMEXPR_NUM_THREADS",
        "VECLIB_MAXIMUM_THREADS",
        "RAYON_NUM_THREADS",
        "JULIA_NUM_THREADS",
        "GOMAXPROCS",
        "TBB_NUM_THREADS",
    ] {
        env.insert(name.into(), most.clone().into());
    }
    // The way to tell a plugin something when nobody gives it options.
    let ours = std::env::vars_os().filter_map(|(name, value)| {
        let name = name.into_string().ok()?;
        let passed = name.starts_with("FLEETYARD_") && !OF_THE_HOST.contains(&name.as_str());
        passed.then_some((name, value))
    });
    env.extend(ours);
    env
}

/// The folder of a file, so that it finds its neighbours, and the project that the
/// folder is in; the file alone where its folder holds more than a plugin.
fn around(file: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for path in [Some(file.to_owned()), fs::canonicalize(file).ok()]
        .into_iter()
        .flatten()
    {
        match path.parent() {
            Some(folder) if !is_too_wide(folder) => {
                found.extend(project(folder));
                found.push(folder.to_owned());
            }
            _ => found.push(path),
        }
    }
    found
}

/// The nearest folder above that is a project's: what somebody cloned or unpacked as
/// one thing.
fn project(folder: &Path) -> Option<PathBuf> {
    const MARKS: [&str; 3] = [".git", "pyproject.toml", "Cargo.toml"];
    folder
        .ancestors()
        .take_while(|folder| !is_too_wide(folder))
        .find(|folder| MARKS.iter().any(|mark| folder.join(mark).exists()))
        .map(Path::to_owned)
}

/// Where a program is installed: above its `bin`, if it stands in one.
fn installation(program: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for path in [Some(program.to_owned()), fs::canonicalize(program).ok()]
        .into_iter()
        .flatten()
    {
        let folder = path.parent();
        let prefix = folder
            .filter(|folder| folder.ends_with("bin"))
            .and_then(Path::parent);
        match prefix {
            Some(prefix) if !is_too_wide(prefix) => found.push(prefix.to_owned()),
            _ => found.extend(around(&path)),
        }
    }
    found
}

/// Folders that hold other people's files, or all of a person's.
fn is_too_wide(folder: &Path) -> bool {
    const SHARED: [&str; 9] = [
        "/", "/home", "/root", "/tmp", "/var", "/var/tmp", "/etc", "/dev", "/proc",
    ];
    let home = std::env::var_os("HOME").map(PathBuf::from);
    let above_home = home.is_some_and(|home| home.starts_with(folder));
    above_home || SHARED.iter().any(|shared| Path::new(shared) == folder)
}

/// A program by path or on the path.
pub(crate) fn find_program(name: &str) -> Option<PathBuf> {
    if name.contains('/') {
        return std::path::absolute(name).ok();
    }
    let search = std::env::var_os("PATH").unwrap_or_else(|| SEARCH_PATH.into());
    std::env::split_paths(&search)
        .filter(|folder| folder.is_absolute())
        .map(|folder| folder.join(name))
        .find(|path| {
            rustix::fs::access(path, rustix::fs::Access::EXEC_OK).is_ok() && path.is_file()
        })
}

/// The program that a script names in its first line.
pub(crate) fn interpreter(script: &Path) -> Option<PathBuf> {
    let mut start = [0; 256];
    let read = fs::File::open(script).ok()?.read(&mut start).ok()?;
    let line = start[..read].strip_prefix(b"#!")?;
    let line = line.split(|byte| *byte == b'\n').next()?;
    let mut words = std::str::from_utf8(line).ok()?.split_whitespace();
    let first = words.next()?;
    if Path::new(first).ends_with("env") {
        let name = words.find(|word| !word.starts_with('-') && !word.contains('='))?;
        find_program(name)
    } else {
        Some(PathBuf::from(first))
    }
}

/// Existing paths, each once, without those inside of others.
fn tidy(mut paths: Vec<PathBuf>) -> Vec<PathBuf> {
    paths.retain(|path| path.is_absolute() && path.symlink_metadata().is_ok());
    paths.sort();
    let mut kept: Vec<PathBuf> = Vec::new();
    for path in paths {
        let inside = kept.iter().any(|other| {
            let link = other.symlink_metadata().is_ok_and(|meta| meta.is_symlink());
            path.starts_with(other) && !link
        });
        if !inside && !kept.contains(&path) {
            kept.push(path);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn children_go_with_their_parents() {
        let paths = [
            "/usr/lib",
            "/usr",
            "/usr",
            "relative",
            "/does/not/exist",
            "/etc/passwd",
        ];
        let kept = tidy(paths.map(PathBuf::from).to_vec());
        assert_eq!(kept, ["/etc/passwd", "/usr"].map(PathBuf::from));
    }

    #[test]
    fn a_script_names_its_interpreter() {
        let folder = tempfile::tempdir().unwrap();
        let script = folder.path().join("script");
        for (line, expected) in [
            ("#!/bin/sh -e\n", Some("/bin/sh")),
            (
                "#!/usr/bin/env -S sh\n",
                find_program("sh").as_ref().and_then(|p| p.to_str()),
            ),
            ("#!\n", None),
            ("\u{7f}ELF", None),
            ("", None),
        ] {
            fs::write(&script, line).unwrap();
            assert_eq!(interpreter(&script), expected.map(PathBuf::from), "{line}");
        }
    }

    #[test]
    fn a_home_is_never_granted_whole() {
        for folder in ["/", "/home", "/tmp", "/etc"] {
            assert!(is_too_wide(Path::new(folder)));
        }
        assert!(!is_too_wide(Path::new("/srv/planners")));
        assert_eq!(
            around(Path::new("/tmp/planner.so"))[0],
            Path::new("/tmp/planner.so")
        );
        assert_eq!(
            around(Path::new("/srv/planners/a.so"))[0],
            Path::new("/srv/planners")
        );
    }
}

//! The files that a plugin needs to read, and its environment.
//!
//! The system's programs and libraries, the plugin's own folder, and the place where
//! its interpreter is installed. Not the user's home, not other people's files, and never
//! what the host itself reads and writes in a run.
//!
//! Three parties name paths, and they are believed differently. The *host's user* names
//! them by options, variables and the search path: these are granted. The *place* of a
//! plugin grants its own folder. The *plugin* names them in its first line, its manifest
//! and its `pyvenv.cfg`: these are granted as far as others may read them anyway.
//!
//! This file puts grants together; `places` knows which files belong to a plugin and which
//! others may read, `programs` where programs and interpreters are, and `hidden` takes out
//! what no plugin may read.

mod hidden;
mod places;
mod programs;

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::fs;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use fleetyard_core::{Digest, Hasher};
use serde::{Deserialize, Serialize};

use super::Policy;
use crate::Fault;
use crate::confinement::state::RUN;
use crate::confinement::target::Target;
use crate::sessions::adapter::declared;

pub(crate) use hidden::Hidden;
use hidden::{Carved, Grant, both, tidy};
use places::{
    LOOKED_AT, closed_below, home, is_executable, is_open, is_open_from, is_too_wide, with_target,
};
pub(crate) use places::{aside, own};
pub use programs::out_of_reach;
pub(crate) use programs::{Interpreter, Python, find_program, python};
use programs::{
    SEARCH_PATH, SOFTWARE, USER_BASE, base, host_path, interpreter, is_on_search_path, is_python,
    modules, prefix, python_prefix, software, user_base, user_sites,
};

/// The folder where the plugin may write.
pub(super) const SCRATCH: &str = "/tmp";

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

/// True if a path is the system's, which everybody may read.
pub(super) fn is_system(path: &Path) -> bool {
    let mut known = SYSTEM.iter().chain(CONFIGURATION).chain(NETWORK);
    known.any(|system| path.starts_with(system))
}

/// Files that programs read when they start. No users, no passwords, no machine's secrets.
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

/// Variables of ours that are none of a plugin's business.
const OF_THE_HOST: [&str; 2] = ["FLEETYARD_PLUGIN_PATH", "FLEETYARD_LOCK"];

/// The files that a plugin may read, and its environment.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Grants {
    /// In the order in which they are mounted; parents come before children.
    pub(crate) read: Vec<PathBuf>,
    /// For some of these, whose files are shown as the plugin's own to a plugin that a host
    /// with the rights of root starts as somebody else.
    pub(crate) owners: BTreeMap<PathBuf, u32>,
    /// Folders of which a part is granted: what else is in them may be seen by its name.
    pub(crate) list: Vec<PathBuf>,
    /// The plugin's environment, whole.
    pub(crate) env: BTreeMap<String, OsString>,
    /// The program to start, found on the path of whoever started the host.
    pub(crate) program: Option<PathBuf>,
    /// The files without which nothing works.
    pub(crate) needed: Vec<PathBuf>,
    /// Paths that the plugin asks to read and was not granted.
    pub(crate) withheld: Vec<PathBuf>,
}

/// A solver, and what a manifest says that it needs.
#[derive(Debug)]
pub(crate) struct Declared {
    pub(crate) program: PathBuf,
    /// True if the host's user says where the program is, rather than the manifest.
    pub(crate) chosen_by_host: bool,
    /// Paths to be read, besides the program and the manifest's folder.
    pub(crate) read: Vec<PathBuf>,
    /// Environment variables.
    pub(crate) variables: Vec<String>,
}

impl Grants {
    /// For a plugin that is started from this environment; `python` is what its
    /// interpreter said of itself, and `declared` reads manifests.
    pub(crate) fn new(
        target: &Target,
        policy: &Policy,
        threads: u32,
        python: Option<&Python>,
        declared: impl Fn(&Path) -> Result<Declared, Fault>,
    ) -> Result<Self, Fault> {
        let mut gathered = Gathered::new(target, policy);
        let mut program = None;
        let mut needed: Vec<PathBuf> = target.file().into_iter().collect();
        let mut variables: Vec<String> = Vec::new();
        match target {
            Target::BuiltIn | Target::Nothing | Target::Attempts(_) | Target::Library(_) => {}
            Target::Adapter(path) => {
                let solver = declared(path)?;
                if solver.chosen_by_host {
                    gathered.place(&solver.program);
                }
                if let Some(interpreter) = interpreter(&solver.program) {
                    gathered.installed(&interpreter.program, interpreter.searched);
                }
                gathered.installed(&solver.program, solver.chosen_by_host);
                for path in &solver.read {
                    gathered.declared(path);
                }
                variables = solver.variables;
            }
            Target::Program(argv) => {
                let mut found = argv.first().and_then(|name| find_program(name));
                let named = found.as_deref().and_then(interpreter);
                if let (Some(found), Some(python)) = (&mut found, python) {
                    // The real one, not a script that looks for it.
                    if is_python(found) {
                        found.clone_from(&python.executable);
                    }
                    gathered
                        .search
                        .extend(python.executable.parent().map(Path::to_owned));
                    for path in [&python.executable].into_iter().chain(&python.read) {
                        gathered.of_the_plugin(path);
                    }
                }
                if let Some(named) = named.filter(|named| python.is_none() || !named.searched) {
                    gathered.installed(&named.program, named.searched);
                    if !named.searched {
                        needed.push(named.program);
                    }
                }
                if let Some(found) = &found {
                    let searched = argv.first().is_some_and(|name| !name.contains('/'));
                    gathered.installed(found, searched);
                    if !needed.contains(found) {
                        needed.push(found.clone());
                    }
                }
                // A missing program is reported by the attempt to start it.
                program = found.or_else(|| argv.first().map(PathBuf::from));
            }
        }
        let mut env = environment(threads, Path::new(SCRATCH));
        if python.is_some() {
            env.extend(user_base().map(|base| (USER_BASE.into(), base.into())));
        }
        let search = gathered.search_path();
        env.extend(std::env::join_paths(search).map(|path| ("PATH".into(), path)));
        for name in variables.iter().filter(|name| *name != "PATH") {
            env.extend(std::env::var_os(name).map(|value| (name.clone(), value)));
        }
        gathered.finish(policy, env, program, needed)
    }

    /// For the question that is put to a plugin's Python interpreter before the plugin is
    /// started: what the plugin is granted anyway, and the user's own modules.
    pub(crate) fn to_ask(
        interpreter: &Interpreter,
        target: &Target,
        policy: &Policy,
        threads: u32,
    ) -> Result<Self, Fault> {
        let mut gathered = Gathered::new(target, policy);
        gathered.installed(&interpreter.program, interpreter.searched);
        for folder in user_sites() {
            gathered.of_the_host(&folder);
        }
        let mut env = environment(threads, Path::new(SCRATCH));
        env.extend(user_base().map(|base| (USER_BASE.into(), base.into())));
        let mut search = gathered.search_path();
        if interpreter.searched {
            // What the user's path names may be a script that looks further along the path,
            // by what the user's home says.
            search.extend(host_path());
            if let Some(home) = home() {
                gathered.of_the_host(&home.join(".tool-versions"));
                env.insert("HOME".into(), home.into());
            }
        }
        env.extend(std::env::join_paths(search).map(|path| ("PATH".into(), path)));
        // One that the plugin names is started by that name and no other.
        let named = (!interpreter.searched).then(|| interpreter.program.clone());
        let program = Some(interpreter.program.clone());
        gathered.finish(policy, env, program, named.into_iter().collect())
    }

    /// Places that are granted for this plugin's sake besides the system's and its own folder, each once,
    /// and true for those that somebody names for it: others are what its interpreter and the programs
    /// that it is started by are installed in.
    pub(crate) fn elsewhere(
        &self,
        target: &Target,
        policy: &Policy,
    ) -> Result<Vec<(PathBuf, bool)>, Fault> {
        let own: Vec<PathBuf> = target.file().iter().flat_map(|file| own(file)).collect();
        let mut named = policy.read.clone();
        // A library path that the host's user has set for everybody is a part of the system that the user
        // chose.
        let to_all = software(&[]);
        let given = software(&policy.env).into_iter();
        named.extend(given.filter(|path| !to_all.contains(path)));
        if python(target).is_some() {
            named.extend(modules(&policy.env));
        }
        if let Target::Adapter(path) = target {
            named.extend(declared(path)?.read);
        }
        let named: Vec<PathBuf> = named.iter().flat_map(|path| both(path)).collect();
        let mut places = Vec::new();
        let mut seen = BTreeSet::new();
        let candidates = self
            .for_the_plugin()
            .into_iter()
            .chain(named.iter().cloned());
        for path in candidates.filter(|path| path.exists()) {
            let real = fs::canonicalize(&path).unwrap_or_else(|_| path.clone());
            let is_own = |own: &PathBuf| path.starts_with(own) || real.starts_with(own);
            if !is_system(&real) && !own.iter().any(is_own) && seen.insert(real) {
                let is_named = named.iter().any(|named| path.starts_with(named));
                places.push((path, is_named));
            }
        }
        Ok(places)
    }

    /// True if a path that somebody claims to need is among what was granted.
    pub(crate) fn has(&self, path: &Path) -> bool {
        let Ok(real) = fs::canonicalize(path) else {
            return false;
        };
        let mut roots = self
            .read
            .iter()
            .filter_map(|root| fs::canonicalize(root).ok());
        roots.any(|root| real.starts_with(root))
    }

    /// Paths that are granted for the plugin's sake alone: not to everybody by the system or by a
    /// variable of the host.
    pub(crate) fn for_the_plugin(&self) -> Vec<PathBuf> {
        let to_all: Vec<PathBuf> = software(&[])
            .iter()
            .flat_map(|path| with_target(path))
            .collect();
        let mut paths = self.beyond_the_system();
        paths.retain(|path| !to_all.contains(path));
        paths
    }

    /// Paths that are granted besides the system's.
    pub(crate) fn beyond_the_system(&self) -> Vec<PathBuf> {
        let beyond = self.read.iter().filter(|path| !is_system(path));
        beyond.cloned().collect()
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

/// Grants while they are being put together.
#[derive(Debug, Default)]
struct Gathered {
    grants: Vec<Grant>,
    /// Folders and files that are the plugin's own, or its solver's.
    own: Vec<PathBuf>,
    /// Folders with programs.
    search: Vec<PathBuf>,
    /// Paths that are not granted, although the folders that they are in may be.
    left_out: Vec<PathBuf>,
    withheld: Vec<PathBuf>,
    /// The folder of the plugin's file, and whose the file is.
    folder: Option<PathBuf>,
    owner: Option<u32>,
}

impl Gathered {
    /// Begins with what everybody is granted, what the host's user grants, and the plugin's own
    /// folder.
    fn new(target: &Target, policy: &Policy) -> Self {
        let mut gathered = Self::default();
        let network: &[&str] = if policy.network { NETWORK } else { &[] };
        for path in SYSTEM.iter().chain(CONFIGURATION).chain(network) {
            gathered.push(Path::new(path), None);
        }
        for path in &policy.read {
            gathered.of_the_host(path);
        }
        for folder in software(&policy.env) {
            gathered.of_the_host(&folder);
        }
        if let Some(file) = target.file() {
            let real = fs::canonicalize(&file).unwrap_or_else(|_| file.clone());
            gathered.folder = real.parent().map(Path::to_owned);
            gathered.owner = fs::metadata(&file).map(|meta| meta.uid()).ok();
            gathered.place(&file);
        }
        gathered
    }

    fn push(&mut self, path: &Path, owner: Option<u32>) {
        self.grants.push(Grant {
            path: path.to_owned(),
            owner,
            entries: false,
        });
    }

    /// Grants what the host's user names.
    fn of_the_host(&mut self, path: &Path) {
        let Ok(path) = std::path::absolute(path) else {
            return;
        };
        for path in with_target(&path) {
            let owner = fs::metadata(&path).map(|meta| meta.uid()).ok();
            self.push(&path, owner);
        }
    }

    /// Grants what belongs to the plugin.
    fn of_the_plugin(&mut self, path: &Path) {
        let owner = self.owner;
        for path in with_target(path) {
            self.push(&path, owner);
        }
    }

    /// Grants the folder that a file is alone in with what belongs to it. What is closed to
    /// others there stays closed, unless the file is closed itself.
    fn place(&mut self, file: &Path) {
        let meta = fs::metadata(file).ok();
        let closed = meta.as_ref().is_some_and(|meta| !is_open(meta));
        let owner = meta.filter(|_| closed).map(|meta| meta.uid());
        for path in own(file) {
            self.left_out.extend(aside(&path, file));
            let entries = !closed && fs::metadata(&path).is_ok_and(|meta| !is_open(&meta));
            self.grants.push(Grant {
                path: path.clone(),
                owner,
                entries: entries && path.is_dir(),
            });
            self.own.push(path);
        }
    }

    /// Grants a program that is started, and the installation that it belongs to.
    fn installed(&mut self, program: &Path, by_host: bool) {
        if !is_executable(program) {
            return;
        }
        self.search.extend(program.parent().map(Path::to_owned));
        let mut programs = with_target(program);
        // The interpreter that a virtual environment was made with.
        programs.extend(programs.clone().iter().filter_map(|path| base(path)));
        for path in programs {
            if is_system(&path) || self.own.iter().any(|own| path.starts_with(own)) {
                continue;
            }
            if by_host || is_on_search_path(&path) {
                let prefix = prefix(&path).filter(|prefix| !is_too_wide(prefix));
                self.of_the_plugin(prefix.as_deref().unwrap_or(&path));
            } else if let Some(prefix) = python_prefix(&path) {
                for part in ["bin", "lib", "lib64", "pyvenv.cfg"] {
                    let part = prefix.join(part);
                    if part.exists() {
                        self.declared(&part);
                    }
                }
            } else {
                self.declared(&path);
            }
        }
    }

    /// Grants what the plugin itself says that it reads: as far as others may read it.
    fn declared(&mut self, path: &Path) {
        for path in with_target(path) {
            let known = self
                .grants
                .iter()
                .any(|grant| path.starts_with(&grant.path));
            if known || path.symlink_metadata().is_ok_and(|meta| meta.is_symlink()) {
                // Either granted, or granted with what the link leads to.
                if !known {
                    self.push(&path, None);
                }
                continue;
            }
            let open = self.folder.as_deref();
            let open = open.is_some_and(|folder| is_open_from(folder, &path));
            let closed = closed_below(&path, LOOKED_AT);
            match closed.filter(|_| open && !is_too_wide(&path)) {
                Some(closed) => {
                    self.left_out.extend(closed);
                    self.push(&path, None);
                }
                None => self.withheld.push(path),
            }
        }
    }

    /// The folders in which programs are searched.
    fn search_path(&self) -> Vec<PathBuf> {
        let usual: Vec<PathBuf> = SEARCH_PATH.split(':').map(PathBuf::from).collect();
        let mut search: Vec<PathBuf> = Vec::new();
        for folder in self.search.iter().filter(|folder| !usual.contains(folder)) {
            if !search.contains(folder) {
                search.push(folder.clone());
            }
        }
        search.extend(usual);
        search
    }

    fn finish(
        self,
        policy: &Policy,
        mut env: BTreeMap<String, OsString>,
        program: Option<PathBuf>,
        needed: Vec<PathBuf>,
    ) -> Result<Grants, Fault> {
        for name in SOFTWARE {
            let value = std::env::var_os(name).filter(|value| !value.is_empty());
            env.extend(value.map(|value| (name.to_owned(), value)));
        }
        let given = policy.env.iter();
        env.extend(given.map(|(name, value)| (name.clone(), OsString::from(value))));
        // What the host's user names is granted although it is closed or aside.
        let named: Vec<PathBuf> = policy.read.iter().flat_map(|path| both(path)).collect();
        let mut left_out = self.left_out;
        left_out.retain(|path| {
            let paths = both(path);
            !paths
                .iter()
                .any(|path| named.iter().any(|named| path.starts_with(named)))
        });
        let hidden = Hidden::new(&policy.hidden, &left_out, &needed);
        let mut carved = Carved::default();
        for grant in tidy(self.grants) {
            carved.carve(grant, &hidden)?;
        }
        // What stands for a folder may have been granted by itself as well.
        carved.grants = tidy(carved.grants);
        let mut withheld = self.withheld;
        withheld.retain(|path| path.exists());
        Ok(Grants {
            owners: carved
                .grants
                .iter()
                .filter_map(|grant| Some((grant.path.clone(), grant.owner?)))
                .collect(),
            read: carved.grants.into_iter().map(|grant| grant.path).collect(),
            list: carved.list,
            env,
            program,
            needed,
            withheld,
        })
    }
}

#[cfg(test)]
mod tests;

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

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::fs::{self, Metadata};
use std::io::Read;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use fleetyard_core::{Digest, Hasher, open_regular};
use serde::{Deserialize, Serialize};

use super::Policy;
use super::root::SCRATCH;
use crate::Fault;
use crate::confinement::python::{Python, is_python};
use crate::confinement::state::RUN;
use crate::confinement::supervisor::Target;
use crate::discover::holds_several;
use crate::sessions::adapter::Adapter;

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

/// The folders in which programs are searched.
const SEARCH_PATH: &str = "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin";

/// Variables that say where software is; they are passed on, and what they name may
/// be read.
const SOFTWARE: [&str; 2] = ["PYTHONPATH", "LD_LIBRARY_PATH"];

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

impl Grants {
    /// For a plugin that is started from this environment; `python` is what its
    /// interpreter said of itself.
    pub(crate) fn new(
        target: &Target,
        policy: &Policy,
        threads: u32,
        python: Option<&Python>,
    ) -> Result<Self, Fault> {
        let mut gathered = Gathered::new(target, policy);
        let mut program = None;
        let mut needed: Vec<PathBuf> = target.file().into_iter().collect();
        let mut variables: Vec<String> = Vec::new();
        match target {
            Target::BuiltIn | Target::Nothing | Target::Attempts(_) | Target::Library(_) => {}
            Target::Adapter(path) => {
                let adapter = Adapter::open(path)?;
                let solver = adapter.program();
                if adapter.is_chosen_by_host() {
                    gathered.place(solver);
                }
                if let Some(interpreter) = interpreter(solver) {
                    gathered.installed(&interpreter.program, interpreter.searched);
                }
                gathered.installed(solver, adapter.is_chosen_by_host());
                for path in adapter.readable() {
                    gathered.declared(&path);
                }
                let names = adapter.variables();
                variables = names.iter().map(ToString::to_string).collect();
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
        let to_all: Vec<PathBuf> = software()
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

/// A path that is granted.
#[derive(Debug, Clone)]
struct Grant {
    path: PathBuf,
    /// Whose files are shown as the plugin's own.
    owner: Option<u32>,
    /// True if the folder's entries are granted, and not the folder: its mode closes it to
    /// others, while the plugin's file is open to them.
    entries: bool,
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
        for folder in software() {
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

/// A path, and what it leads to if it is a link or below one.
fn with_target(path: &Path) -> Vec<PathBuf> {
    let mut paths = vec![path.to_owned()];
    paths.extend(fs::canonicalize(path).ok().filter(|real| real != path));
    paths
}

/// Places that belong to a file and stand beside it: the folder that it is in, of an installed
/// program the folders beside its `bin`, of one in a virtual environment the environment.
/// The file alone where its folder holds more than one plugin's files.
pub(crate) fn own(file: &Path) -> Vec<PathBuf> {
    let mut found: Vec<PathBuf> = Vec::new();
    for path in with_target(file) {
        let folder = path.parent().filter(|folder| {
            !is_too_wide(folder) && !is_build_folder(folder) && !holds_several(folder)
        });
        let Some(folder) = folder else {
            found.push(path);
            continue;
        };
        let above = folder
            .parent()
            .filter(|above| folder.ends_with("bin") && !is_too_wide(above));
        match above {
            Some(above) if is_file(&above.join(ENVIRONMENT)) => found.push(above.to_owned()),
            _ => {
                found.push(folder.to_owned());
                let beside = ["lib", "lib64", "libexec", "share"];
                let beside = above
                    .into_iter()
                    .flat_map(|above| beside.map(|name| above.join(name)));
                found.extend(beside.filter(|folder| folder.is_dir()));
            }
        }
    }
    found.sort();
    found.dedup();
    let all = found.clone();
    found.retain(|path| {
        !all.iter()
            .any(|other| path != other && path.starts_with(other))
    });
    found
}

/// Entries of a plugin's own folder that are not the plugin's: the history of its source, what
/// tools build there, and what is closed to others if its file is not.
pub(crate) fn aside(own: &Path, file: &Path) -> Vec<PathBuf> {
    const HISTORY: [&str; 3] = [".git", ".hg", ".svn"];
    let closed = fs::metadata(file).is_ok_and(|meta| !is_open(&meta));
    let kept = with_target(file);
    let entries = fs::read_dir(own).into_iter().flatten().flatten();
    let aside = entries.filter(|entry| {
        let path = entry.path();
        if kept.iter().any(|kept| kept.starts_with(&path)) {
            return false;
        }
        let history = HISTORY.iter().any(|name| entry.file_name() == *name);
        history
            || is_build_folder_itself(&path)
            || !closed
                && entry
                    .metadata()
                    .is_ok_and(|meta| !meta.is_symlink() && !is_open(&meta))
    });
    aside.map(|entry| entry.path()).collect()
}

/// True if a folder is, or is in, one that a tool marked as its cache, as cargo does with
/// `target`: what is built there for others may be large and is nobody's plugin.
fn is_build_folder(folder: &Path) -> bool {
    folder.ancestors().any(is_build_folder_itself)
}

fn is_build_folder_itself(folder: &Path) -> bool {
    // Virtual environments are marked so too.
    is_file(&folder.join("CACHEDIR.TAG")) && !is_file(&folder.join(ENVIRONMENT))
}

/// The file that makes a folder a virtual environment.
const ENVIRONMENT: &str = "pyvenv.cfg";

fn is_file(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|meta| meta.is_file())
}

fn is_executable(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|meta| meta.is_file() && meta.mode() & 0o111 != 0)
}

/// True if others than its owner may read a file, or read and enter a folder.
fn is_open(meta: &Metadata) -> bool {
    let needed = if meta.is_dir() { 0o005 } else { 0o004 };
    meta.mode() & needed == needed
}

/// True if others may come from a folder to a path and read it: whoever closed a folder on
/// the way closed what is in it. Folders above both are not on the way.
fn is_open_from(folder: &Path, path: &Path) -> bool {
    let mut above = path
        .ancestors()
        .skip(1)
        .take_while(|part| !folder.starts_with(part));
    fs::metadata(path).is_ok_and(|meta| is_open(&meta))
        && above.all(|part| fs::metadata(part).is_ok_and(|meta| meta.mode() & 0o001 != 0))
}

/// Most files of a declared folder that are looked at.
const LOOKED_AT: usize = 20_000;

/// Paths below a path that are closed to others; `None` where there is too much to look at.
fn closed_below(path: &Path, most: usize) -> Option<Vec<PathBuf>> {
    let mut closed = Vec::new();
    let mut folders = vec![path.to_owned()];
    let mut seen = 0;
    while let Some(folder) = folders.pop() {
        // The path itself may be a file, which has no entries.
        for entry in fs::read_dir(&folder).into_iter().flatten().flatten() {
            seen += 1;
            if seen > most {
                return None;
            }
            let Ok(meta) = entry.metadata() else { continue };
            if meta.is_symlink() {
                continue;
            }
            if !is_open(&meta) {
                closed.push(entry.path());
            } else if meta.is_dir() {
                folders.push(entry.path());
            }
        }
    }
    Some(closed)
}

/// The folder in which a program is installed: above its `bin`, if that looks like an
/// installation, and
/// above the `shims` of a manager of versions.
fn prefix(program: &Path) -> Option<PathBuf> {
    let folder = program.parent()?;
    let prefix = folder.parent()?;
    let beside: &[&str] = match folder.file_name()?.to_str()? {
        "bin" => &["lib", "lib64", "libexec", ENVIRONMENT],
        "shims" => &["versions", "installs"],
        _ => return None,
    };
    let looks_like_one = beside.iter().any(|name| prefix.join(name).exists());
    looks_like_one.then(|| prefix.to_owned())
}

/// The same for an installation or environment of Python.
fn python_prefix(program: &Path) -> Option<PathBuf> {
    let prefix = prefix(program).filter(|prefix| !is_too_wide(prefix))?;
    let library = |entry: &fs::DirEntry| is_file(&entry.path().join("os.py"));
    let libraries = fs::read_dir(prefix.join("lib"))
        .into_iter()
        .flatten()
        .flatten();
    let is_python = is_file(&prefix.join(ENVIRONMENT)) || libraries.take(1000).any(|e| library(&e));
    is_python.then_some(prefix)
}

/// The interpreter that the virtual environment of a program was made with.
fn base(program: &Path) -> Option<PathBuf> {
    let environment = program.parent()?.parent()?.join(ENVIRONMENT);
    let mut text = String::new();
    let file = open_regular(&environment).ok()?;
    file.take(1 << 16).read_to_string(&mut text).ok()?;
    let home = text.lines().find_map(|line| {
        let (key, value) = line.split_once('=')?;
        (key.trim() == "home").then(|| value.trim())
    })?;
    let named = Path::new(home).join(program.file_name()?);
    let found = [named, Path::new(home).join("python3")];
    found
        .into_iter()
        .find(|path| path.is_absolute() && is_executable(path))
}

/// True if a program stands where the host's user looks for programs, or where a manager of
/// versions does whose scripts stand there.
fn is_on_search_path(program: &Path) -> bool {
    host_path().any(|folder| {
        let managed = || {
            let prefix = prefix(&folder.join("python3"))?;
            (folder.ends_with("shims") && !is_too_wide(&prefix)).then_some(prefix)
        };
        program.parent() == Some(&folder)
            || managed().is_some_and(|prefix| program.starts_with(prefix))
    })
}

/// The folders where the host's user looks for programs.
fn host_path() -> impl Iterator<Item = PathBuf> {
    let search = std::env::var_os("PATH").unwrap_or_else(|| SEARCH_PATH.into());
    let folders: Vec<PathBuf> = std::env::split_paths(&search).collect();
    folders.into_iter().filter(|folder| folder.is_absolute())
}

fn home() -> Option<PathBuf> {
    let home = std::env::var_os("HOME").filter(|home| !home.is_empty());
    home.map(PathBuf::from).filter(|home| home.is_absolute())
}

/// Says where `pip install --user` installs, because the home is another one inside.
const USER_BASE: &str = "PYTHONUSERBASE";

fn user_base() -> Option<PathBuf> {
    let set = std::env::var_os(USER_BASE).filter(|base| !base.is_empty());
    let base = set.map(PathBuf::from).filter(|base| base.is_absolute());
    base.or_else(|| home().map(|home| home.join(".local")))
}

/// The folders with modules that the host's user has installed alone.
fn user_sites() -> Vec<PathBuf> {
    let library = user_base().map(|base| base.join("lib"));
    let entries = library
        .into_iter()
        .flat_map(|library| fs::read_dir(library).into_iter().flatten());
    let sites = entries.flatten().filter(|entry| {
        let name = entry.file_name();
        name.as_bytes().starts_with(b"python")
    });
    sites.map(|entry| entry.path()).collect()
}

/// Folders that the host's variables name which say where software is.
fn software() -> Vec<PathBuf> {
    let values = SOFTWARE.iter().filter_map(std::env::var_os);
    let folders = values.flat_map(|value| std::env::split_paths(&value).collect::<Vec<_>>());
    folders
        .filter(|folder| folder.is_absolute() && !is_too_wide(folder))
        .collect()
}

/// Folders that hold other people's files, or all of a person's.
fn is_too_wide(folder: &Path) -> bool {
    const SHARED: [&str; 29] = [
        "/",
        "/home",
        "/root",
        "/tmp",
        "/var",
        "/var/tmp",
        "/etc",
        "/dev",
        "/proc",
        "/run",
        "/srv",
        "/mnt",
        "/media",
        "/sys",
        "/bin",
        "/sbin",
        "/lib",
        "/lib64",
        "/opt",
        "/usr",
        "/usr/bin",
        "/usr/sbin",
        "/usr/lib",
        "/usr/share",
        "/usr/local",
        "/usr/local/bin",
        "/usr/local/sbin",
        "/usr/local/lib",
        "/usr/local/share",
    ];
    let of_a_home = home().is_some_and(|home| {
        home.starts_with(folder) || home.join(".local") == folder || home.join(".config") == folder
    });
    of_a_home
        || folder.parent() == Some(Path::new("/home"))
        || SHARED.iter().any(|shared| Path::new(shared) == folder)
}

/// A program by path or on the path.
pub(crate) fn find_program(name: &str) -> Option<PathBuf> {
    if name.contains('/') {
        return std::path::absolute(name).ok();
    }
    host_path().map(|folder| folder.join(name)).find(|path| {
        rustix::fs::access(path, rustix::fs::Access::EXEC_OK).is_ok() && path.is_file()
    })
}

/// A program that a plugin is started by.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Interpreter {
    pub(crate) program: PathBuf,
    /// True if it was searched where the host's user looks for programs, rather than named
    /// by the plugin.
    pub(crate) searched: bool,
}

/// The program that a script names in its first line.
pub(crate) fn interpreter(script: &Path) -> Option<Interpreter> {
    let mut start = Vec::new();
    open_regular(script)
        .ok()?
        .take(256)
        .read_to_end(&mut start)
        .ok()?;
    let line = start.strip_prefix(b"#!")?;
    let line = line.split(|byte| *byte == b'\n').next()?;
    let mut words = std::str::from_utf8(line).ok()?.split_whitespace();
    let first = Path::new(words.next()?);
    if !first.ends_with("env") {
        return first.is_absolute().then(|| Interpreter {
            program: first.to_owned(),
            searched: false,
        });
    }
    let name = words.find(|word| !word.starts_with('-') && !word.contains('='))?;
    let searched = !name.contains('/');
    // A relative path would mean one in the scratch folder.
    (searched || name.starts_with('/')).then_some(())?;
    find_program(name).map(|program| Interpreter { program, searched })
}

/// The Python interpreter that a program is started by.
pub(crate) fn python(target: &Target) -> Option<Interpreter> {
    let Target::Program(argv) = target else {
        return None;
    };
    let name = argv.first()?;
    let program = find_program(name)?;
    if is_python(&program) {
        let searched = !name.contains('/');
        return Some(Interpreter { program, searched });
    }
    interpreter(&program).filter(|interpreter| is_python(&interpreter.program))
}

/// Existing paths, each once, without those inside of others that are shown alike.
fn tidy(mut grants: Vec<Grant>) -> Vec<Grant> {
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
fn both(path: &Path) -> Vec<PathBuf> {
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
struct Carved {
    grants: Vec<Grant>,
    list: Vec<PathBuf>,
}

impl Carved {
    /// Most paths that stand for a folder with something hidden in it.
    const MOST: usize = 4000;

    fn carve(&mut self, grant: Grant, hidden: &Hidden) -> Result<(), Fault> {
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

#[cfg(test)]
mod tests {
    use std::fs::Permissions;
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    fn granted(path: &str, owner: Option<u32>) -> Grant {
        Grant {
            path: path.into(),
            owner,
            entries: false,
        }
    }

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
        let kept = tidy(paths.map(|path| granted(path, None)).to_vec());
        let kept: Vec<PathBuf> = kept.into_iter().map(|grant| grant.path).collect();
        assert_eq!(kept, ["/etc/passwd", "/usr"].map(PathBuf::from));
        // But for those whose files are shown as somebody else's.
        let kept = tidy(vec![granted("/usr", None), granted("/usr/lib", Some(7))]);
        assert_eq!(kept.len(), 2);
    }

    #[test]
    fn a_script_names_its_interpreter() {
        let folder = tempfile::tempdir().unwrap();
        let script = folder.path().join("script");
        let sh = find_program("sh");
        for (line, expected) in [
            ("#!/bin/sh -e\n", Some((PathBuf::from("/bin/sh"), false))),
            ("#!/usr/bin/env -S sh\n", sh.map(|sh| (sh, true))),
            ("#!/usr/bin/env ./sh\n", None),
            ("#!sh\n", None),
            ("#!\n", None),
            ("\u{7f}ELF", None),
            ("", None),
        ] {
            fs::write(&script, line).unwrap();
            let found = interpreter(&script).map(|found| (found.program, found.searched));
            assert_eq!(found, expected, "{line}");
        }
    }

    #[test]
    fn a_pipe_in_the_place_of_a_file_does_not_make_the_host_wait() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status();
        if !made.is_ok_and(|status| status.success()) {
            eprintln!("skipped: there is no mkfifo");
            return;
        }
        assert_eq!(interpreter(&pipe), None);
    }

    #[test]
    fn a_home_is_never_granted_whole() {
        for folder in ["/", "/home", "/home/alice", "/tmp", "/etc", "/srv"] {
            assert!(is_too_wide(Path::new(folder)), "{folder}");
        }
        assert!(!is_too_wide(Path::new("/srv/planners")));
        let alone = Path::new("/tmp/planner.so");
        assert_eq!(own(alone), [alone]);
        let folder = own(Path::new("/srv/planners/a.so"));
        assert_eq!(folder, [Path::new("/srv/planners")]);
    }

    /// A folder with files of these modes.
    fn folder_with(files: &[(&str, u32)]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        fs::set_permissions(folder.path(), Permissions::from_mode(0o755)).unwrap();
        for (name, mode) in files {
            let path = folder.path().join(name);
            let parent = path.parent().unwrap();
            fs::create_dir_all(parent).unwrap();
            fs::set_permissions(parent, Permissions::from_mode(0o755)).unwrap();
            fs::write(&path, name).unwrap();
            fs::set_permissions(&path, Permissions::from_mode(*mode)).unwrap();
        }
        folder
    }

    fn names(grants: &Grants, folder: &Path) -> Vec<String> {
        let inside = grants
            .read
            .iter()
            .filter_map(|path| path.strip_prefix(folder).ok());
        inside.map(|path| path.display().to_string()).collect()
    }

    #[test]
    fn what_the_host_reads_and_writes_is_left_out_wherever_it_lies() {
        let folder = folder_with(&[
            ("planner.so", 0o644),
            ("libhelp.so", 0o644),
            ("data/weights", 0o644),
            ("data/easy.scen", 0o644),
            ("results.db", 0o644),
            ("results.db-wal", 0o644),
            (".results.db.7-0.tmp", 0o644),
            (".git/config", 0o644),
        ]);
        let policy = Policy {
            hidden: vec![
                folder.path().join("results.db"),
                folder.path().join("data/../data/easy.scen"),
                folder.path().join("planner"),
            ],
            ..Policy::default()
        };
        let target = Target::Library(folder.path().join("planner.so"));
        let grants = Grants::new(&target, &policy, 1, None).unwrap();
        let granted = names(&grants, folder.path());
        assert_eq!(granted, ["data/weights", "libhelp.so", "planner.so"]);
        assert_eq!(grants.list.len(), 2);
        assert!(!grants.has(&folder.path().join("data/easy.scen")));
    }

    #[test]
    fn what_is_closed_to_others_stays_closed_beside_a_plugin_that_is_not() {
        let folder = folder_with(&[("open.so", 0o644), ("closed.so", 0o600), ("mine", 0o644)]);
        let granted = |name: &str| {
            let target = Target::Library(folder.path().join(name));
            let grants = Grants::new(&target, &Policy::default(), 1, None).unwrap();
            let mut owners = grants.owners.keys();
            let owned = owners.any(|path| path.starts_with(folder.path()));
            (names(&grants, folder.path()), owned)
        };
        let open = vec!["mine".to_owned(), "open.so".to_owned()];
        assert_eq!(granted("open.so"), (open, false));
        // A plugin that is closed itself is one with what is closed beside it.
        assert_eq!(granted("closed.so"), (vec![String::new()], true));
    }

    #[test]
    fn a_first_line_grants_nothing_but_what_others_may_read() {
        let teams = folder_with(&[
            ("a/planner", 0o755),
            ("b/secret", 0o600),
            ("b/planner", 0o755),
            ("b/notes", 0o644),
            ("closed/planner", 0o755),
            ("python/bin/python3", 0o755),
            ("python/lib/python3.9/os.py", 0o644),
            ("python/lib/python3.9/closed.py", 0o600),
            ("python/notes", 0o644),
        ]);
        let path = |name: &str| teams.path().join(name);
        fs::set_permissions(path("closed"), Permissions::from_mode(0o700)).unwrap();
        let granted = |named: &str| {
            let line = format!("#!{}\n", path(named).display());
            fs::write(path("a/planner"), line).unwrap();
            let target = Target::Program(vec![path("a/planner").display().to_string()]);
            let grants = Grants::new(&target, &Policy::default(), 1, None).unwrap();
            (names(&grants, teams.path()), grants.withheld)
        };
        // No program, and so nothing at all; not its folder either.
        assert_eq!(granted("b/secret").0, ["a"]);
        assert_eq!(granted("b/notes").0, ["a"]);
        assert_eq!(granted("b/planner").0, ["a", "b/planner"]);
        let (read, withheld) = granted("closed/planner");
        assert_eq!(
            (read, withheld),
            (vec!["a".into()], vec![path("closed/planner")])
        );
        // Of an installation what belongs to it.
        let (read, _) = granted("python/bin/python3");
        assert_eq!(read, ["a", "python/bin", "python/lib/python3.9/os.py"]);
    }
}

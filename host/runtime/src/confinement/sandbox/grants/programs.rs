//! Programs: where the host's user looks for them, where they are installed, and which
//! interpreter starts a script.

use std::fs;
use std::io::Read;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

use fleetyard_core::open_regular;
use serde::Deserialize;

use super::places::{ENVIRONMENT, home, is_executable, is_file, is_too_wide};
use crate::confinement::target::Target;

/// The folders in which programs are searched.
pub(super) const SEARCH_PATH: &str = "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin";

/// Variables that say where software is; they are passed on, and what they name may
/// be read.
pub(super) const SOFTWARE: [&str; 2] = ["PYTHONPATH", "LD_LIBRARY_PATH"];

/// The folder in which a program is installed: above its `bin`, if that looks like an
/// installation, and above the `shims` of a manager of versions.
pub(super) fn prefix(program: &Path) -> Option<PathBuf> {
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
pub(super) fn python_prefix(program: &Path) -> Option<PathBuf> {
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
pub(super) fn base(program: &Path) -> Option<PathBuf> {
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
pub(super) fn is_on_search_path(program: &Path) -> bool {
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
pub(super) fn host_path() -> impl Iterator<Item = PathBuf> {
    let search = std::env::var_os("PATH").unwrap_or_else(|| SEARCH_PATH.into());
    let folders: Vec<PathBuf> = std::env::split_paths(&search).collect();
    folders.into_iter().filter(|folder| folder.is_absolute())
}

/// Says where `pip install --user` installs, because the home is another one inside.
pub(super) const USER_BASE: &str = "PYTHONUSERBASE";

pub(super) fn user_base() -> Option<PathBuf> {
    let set = std::env::var_os(USER_BASE).filter(|base| !base.is_empty());
    let base = set.map(PathBuf::from).filter(|base| base.is_absolute());
    base.or_else(|| home().map(|home| home.join(".local")))
}

/// The folders with modules that the host's user has installed alone.
pub(super) fn user_sites() -> Vec<PathBuf> {
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

/// Folders that variables name which say where software is: the host's, and those that its user `gives`
/// to the plugin in their place.
pub(super) fn software(gives: &[(String, String)]) -> Vec<PathBuf> {
    let variables = SOFTWARE.into_iter();
    variables.flat_map(|name| folders_of(name, gives)).collect()
}

/// The same of the variable that says where modules of Python are.
pub(super) fn modules(gives: &[(String, String)]) -> Vec<PathBuf> {
    folders_of("PYTHONPATH", gives)
}

fn folders_of(name: &str, gives: &[(String, String)]) -> Vec<PathBuf> {
    let given = gives.iter().rev().find(|(given, _)| given == name);
    let value = match given {
        Some((_, value)) => Some(value.into()),
        None => std::env::var_os(name),
    };
    let folders = value.iter().flat_map(std::env::split_paths);
    folders.filter(|folder| is_granted(folder)).collect()
}

/// True if a folder that a variable names may be read for that.
fn is_granted(folder: &Path) -> bool {
    folder.is_absolute() && !is_too_wide(folder)
}

/// The folders of a variable that says where software is that a plugin cannot read, each with the
/// reason; none of another variable.
pub fn out_of_reach(name: &str, value: &str) -> Vec<(PathBuf, &'static str)> {
    if !SOFTWARE.contains(&name) {
        return Vec::new();
    }
    let folders = std::env::split_paths(value).filter(|folder| !folder.as_os_str().is_empty());
    folders
        .filter_map(|folder| {
            let reason = if !folder.is_absolute() {
                "is relative, and a plugin runs in a scratch folder: write it from / on"
            } else if !folder.exists() {
                "does not exist"
            } else if !is_granted(&folder) {
                "holds more than software, and the sandbox hides it: name the folder of the modules, or \
                 grant it by --allow-read"
            } else {
                return None;
            };
            Some((folder, reason))
        })
        .collect()
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

/// A Python interpreter and what it needs.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
pub(crate) struct Python {
    pub(crate) executable: PathBuf,
    /// The folders where it is installed and where it looks for modules.
    pub(crate) read: Vec<PathBuf>,
}

/// True if a program is called like an interpreter: `python3`, `python3.12`.
pub(super) fn is_python(program: &Path) -> bool {
    let name = program.file_name().and_then(|name| name.to_str());
    name.and_then(|name| name.strip_prefix("python"))
        .is_some_and(|rest| rest.chars().all(|c| c.is_ascii_digit() || c == '.'))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_of_a_given_variable_are_granted_or_named_with_the_reason() {
        let here = env!("CARGO_MANIFEST_DIR");
        let given = |value: &str| vec![("PYTHONPATH".to_owned(), value.to_owned())];
        assert!(software(&given(here)).contains(&PathBuf::from(here)));
        assert!(!software(&given("/home")).contains(&PathBuf::from("/home")));
        let reason = |name: &str, value: &str| {
            let found = out_of_reach(name, value);
            found.first().map_or("", |(_, reason)| *reason)
        };
        assert_eq!(reason("PYTHONPATH", here), "");
        assert!(reason("PYTHONPATH", "abi/python").contains("relative"));
        assert!(reason("PYTHONPATH", "/no/such/folder").contains("does not exist"));
        assert!(reason("LD_LIBRARY_PATH", "/usr/lib:/tmp").contains("--allow-read"));
        assert_eq!(reason("PYTHONOPTIMIZE", "relative"), "");
    }

    #[test]
    fn interpreters_are_known_by_name() {
        for (name, expected) in [
            ("python", true),
            ("/usr/bin/python3", true),
            ("/opt/python3.12", true),
            ("pythonw.sh", false),
            ("/usr/bin/ruby", false),
            ("/", false),
        ] {
            assert_eq!(is_python(Path::new(name)), expected, "{name}");
        }
    }
}

//! Where a Python interpreter really is, and what it reads.
//!
//! `python3` on the path may be a script that looks for the interpreter (pyenv,
//! asdf), a link into a virtual environment, or the system's; and modules may be
//! installed anywhere. The interpreter itself knows: it is asked once per host, before
//! and outside of any sandbox, as the user who runs the host would.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Mutex, PoisonError};

use serde::{Deserialize, Serialize};

/// An interpreter and what it needs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Python {
    pub(crate) executable: PathBuf,
    /// Where it is installed, and where it looks for modules.
    pub(crate) read: Vec<PathBuf>,
    /// What `pip install --user` installs below.
    user_base: PathBuf,
}

impl Python {
    /// What the interpreter has to be told, because the home is another one.
    pub(crate) fn env(&self) -> (&'static str, &Path) {
        ("PYTHONUSERBASE", &self.user_base)
    }
}

const QUESTION: &str = "import json, site, sys
print(json.dumps({'executable': sys.executable, 'user_base': site.getuserbase(),
                  'read': [sys.prefix, sys.base_prefix] + [p for p in sys.path if p]}))";

/// Whether a program is called like an interpreter: `python3`, `python3.12`.
pub(crate) fn is_python(program: &Path) -> bool {
    let name = program.file_name().and_then(|name| name.to_str());
    name.and_then(|name| name.strip_prefix("python"))
        .is_some_and(|rest| rest.chars().all(|c| c.is_ascii_digit() || c == '.'))
}

/// Asks an interpreter, the first time that it is seen. `None` when it does not answer
/// like one; it is then started as it is.
pub(crate) fn ask(program: &Path) -> Option<Python> {
    static KNOWN: Mutex<BTreeMap<PathBuf, Option<Python>>> = Mutex::new(BTreeMap::new());
    let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
    known
        .entry(program.to_owned())
        .or_insert_with(|| {
            let output = Command::new(program)
                .args(["-c", QUESTION])
                // Where nobody can leave a module that it would load.
                .current_dir("/")
                .stdin(Stdio::null())
                .stderr(Stdio::null())
                .output()
                .ok()?;
            let answer: Python = serde_json::from_slice(&output.stdout).ok()?;
            answer.executable.is_absolute().then_some(answer)
        })
        .clone()
}

#[cfg(test)]
mod tests {
    use super::*;

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

    #[test]
    fn whoever_is_no_interpreter_is_left_alone() {
        assert_eq!(ask(Path::new("/bin/true")), None);
        assert_eq!(ask(Path::new("/does/not/exist")), None);
    }
}

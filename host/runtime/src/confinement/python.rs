//! The real place of a Python interpreter, and the folders that it reads.
//!
//! `python3` on the path may be a script that looks for the interpreter (pyenv,
//! asdf), a link into a virtual environment, or the system's; and modules may be
//! installed anywhere. The interpreter itself knows: it is asked once per host. As it may
//! be the plugin's own, it is asked in a sandbox like the plugin's, and what it answers is
//! believed as far as it was granted before.

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use crate::confinement::process::Process;
use crate::confinement::sandbox::launch::Launch;
use crate::confinement::sandbox::{Grants, Python};
use crate::confinement::transport::{Interest, Output, Transport};

/// The program that the interpreter runs.
pub(crate) const QUESTION: &str = "import json, sys
print(json.dumps({'executable': sys.executable,
                  'read': [sys.prefix, sys.base_prefix] + [p for p in sys.path if p]}))";

/// Longest answer.
const LONGEST: usize = 1 << 16;

/// Most time for an answer: a script that looks for the interpreter starts others.
const PATIENCE: Duration = Duration::from_secs(20);

/// Asks an interpreter, the first time that it is seen with these grants. `None` when it
/// does not answer like one; it is then started as it is. `executable` becomes the
/// supervisor.
pub(crate) fn ask(executable: &Path, launch: &Launch) -> Option<Python> {
    type Answer = Arc<OnceLock<Option<Python>>>;
    static KNOWN: Mutex<BTreeMap<(PathBuf, Vec<PathBuf>), Answer>> = Mutex::new(BTreeMap::new());
    let program = launch.grants.program.clone()?;
    let key = (program, launch.grants.read.clone());
    let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
    let answer = Arc::clone(known.entry(key).or_default());
    // Others may ask another one meanwhile.
    drop(known);
    answer
        .get_or_init(|| believe(&answer_of(executable, launch)?, &launch.grants))
        .clone()
}

/// The standard output of an interpreter.
fn answer_of(executable: &Path, launch: &Launch) -> Option<Vec<u8>> {
    let mut process = Process::start(executable, launch).ok()?;
    process.close_stdin();
    let until = Instant::now() + PATIENCE;
    let mut answer = Vec::new();
    let mut buffer = vec![0; LONGEST];
    let answers = Interest {
        stdin: false,
        stdout: true,
        stderr: false,
    };
    loop {
        let left = until.saturating_duration_since(Instant::now());
        if left.is_zero() || answer.len() > LONGEST {
            return None;
        }
        match process.read(Output::Stdout, &mut buffer) {
            Ok(0) => break,
            Ok(read) => answer.extend_from_slice(&buffer[..read]),
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) if error.kind() == ErrorKind::WouldBlock => {
                process.wait(answers, left.as_nanos() as u64);
            }
            Err(_) => return None,
        }
    }
    // Whatever it left behind ends here.
    process.end(Duration::ZERO);
    Some(answer)
}

/// The part of an answer that is believed: what was granted before it was given.
fn believe(answer: &[u8], grants: &Grants) -> Option<Python> {
    let mut answer: Python = serde_json::from_slice(answer).ok()?;
    let is_file = |path: &Path| path.metadata().is_ok_and(|meta| meta.is_file());
    let is_known = |path: &Path| path.is_absolute() && grants.has(path);
    if !is_known(&answer.executable) || !is_file(&answer.executable) {
        return None;
    }
    answer.read.retain(|path| is_known(path));
    Some(answer)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Policy;
    use crate::confinement::target::Target;
    use crate::sessions::adapter::declared;

    #[test]
    fn an_answer_grants_nothing_that_was_not_granted_before() {
        let grants = Grants::new(&Target::Nothing, &Policy::default(), 1, None, declared).unwrap();
        let claim = |executable: &str, read: &str| {
            let answer = format!("{{\"executable\": \"{executable}\", \"read\": [\"{read}\"]}}");
            believe(answer.as_bytes(), &grants).map(|python| python.read)
        };
        assert_eq!(claim("/bin/sh", "/usr/lib"), Some(vec!["/usr/lib".into()]));
        assert_eq!(claim("/bin/sh", "/usr/lib/../../etc"), Some(Vec::new()));
        assert_eq!(claim("/bin/sh", "/etc/shadow"), Some(Vec::new()));
        assert_eq!(claim("/etc/shadow", "/usr/lib"), None);
        assert_eq!(claim("/usr/bin", "/usr/lib"), None);
        assert_eq!(believe(b"Python 3", &grants), None);
    }
}

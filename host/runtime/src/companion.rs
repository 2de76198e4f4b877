//! Processes that do not outlive who started them, apart from plugins: those have a supervisor.

use std::io;
use std::os::unix::process::CommandExt;
use std::process::Command;

use rustix::io::Errno;
use rustix::process::{Signal, getpid, getppid, set_parent_process_death_signal};

/// Has the kernel kill the process once the *thread* that starts it has ended, however that
/// comes: start it from one that lives as long as the process is to. The process leads a group of
/// its own, and an interrupt does to it what it does by default, also where it is ignored here.
pub fn as_companion(command: &mut Command) -> &mut Command {
    let starter = getpid();
    command.process_group(0);
    // SAFETY: plain system calls that allocate nothing.
    unsafe {
        command.pre_exec(move || {
            set_parent_process_death_signal(Some(Signal::KILL))?;
            // It may have ended before the kernel was told.
            if getppid() != Some(starter) {
                return Err(Errno::SRCH.into());
            }
            if libc::signal(libc::SIGINT, libc::SIG_DFL) == libc::SIG_ERR {
                return Err(io::Error::last_os_error());
            }
            Ok(())
        })
    }
}

#[cfg(test)]
mod tests {
    use std::io::Read;
    use std::process::{Command, Stdio};

    use super::as_companion;

    #[test]
    fn a_companion_ends_with_the_thread_that_started_it() {
        let mut child = std::thread::spawn(|| {
            let mut command = Command::new("sleep");
            command.arg("600").stdout(Stdio::piped());
            as_companion(&mut command).spawn().unwrap()
        })
        .join()
        .unwrap();
        let mut said = Vec::new();
        // Returns when the process is gone.
        child.stdout.take().unwrap().read_to_end(&mut said).unwrap();
        assert!(!child.wait().unwrap().success());
    }
}

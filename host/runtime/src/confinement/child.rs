//! Signals, standard streams and standing of processes that a supervisor starts.

use std::os::fd::AsRawFd;
use std::path::Path;
use std::time::Duration;

use rustix::fs::{Mode, OFlags};
use rustix::io::Errno;

/// Signals that a supervisor ignores.
pub(crate) const FOR_THE_HOST: [i32; 4] =
    [libc::SIGINT, libc::SIGTERM, libc::SIGHUP, libc::SIGQUIT];

/// The most that the kernel can be told in favour of ending a process.
pub(crate) const GOES_FIRST: &[u8] = b"1000";

/// Writes it, by nothing but system calls.
pub(crate) fn goes_first(file: &std::ffi::CStr) -> Result<(), Errno> {
    let flags = OFlags::WRONLY | OFlags::CLOEXEC;
    let file = rustix::fs::open(file, flags, Mode::empty())?;
    rustix::io::write(&file, GOES_FIRST).map(|_| ())
}

/// Attempts at a process or a thread that the machine has no room for, and the time between them.
const ATTEMPTS: u32 = 10;
const BETWEEN: Duration = Duration::from_millis(20);

/// Makes a process or a thread, and again where the machine is `full` for a moment: limits of processes
/// count those of everybody, who may end any time.
pub(crate) fn patiently<T, E>(
    mut make: impl FnMut() -> Result<T, E>,
    full: impl Fn(&E) -> bool,
) -> Result<T, E> {
    let mut left = ATTEMPTS;
    loop {
        left -= 1;
        match make() {
            Err(error) if left > 0 && full(&error) => std::thread::sleep(BETWEEN),
            made => return made,
        }
    }
}

/// Runs in the plugin's process before any of its code.
pub(crate) fn child_setup() -> std::io::Result<()> {
    // SAFETY: plain system calls on this process. Ignored and blocked signals would
    // be inherited, and so would the host's terminal.
    unsafe {
        // Who may signal a group must not be in the host's.
        if libc::setsid() < 0 {
            return Err(std::io::Error::last_os_error());
        }
        for signal in FOR_THE_HOST.into_iter().chain([libc::SIGXFSZ]) {
            libc::signal(signal, libc::SIG_DFL);
        }
        let mut none: libc::sigset_t = std::mem::zeroed();
        libc::sigemptyset(&raw mut none);
        libc::sigprocmask(libc::SIG_SETMASK, &raw const none, std::ptr::null_mut());
    }
    Ok(())
}

/// The pipes belong to the plugin: without this the host would never see them
/// close.
pub(crate) fn release_stdio() {
    match std::fs::OpenOptions::new()
        .read(true)
        .write(true)
        .open(Path::new("/dev/null"))
    {
        Ok(null) => {
            for descriptor in 0..3 {
                // SAFETY: both descriptors are open.
                unsafe { libc::dup2(null.as_raw_fd(), descriptor) };
            }
        }
        Err(_) => {
            for descriptor in 0..3 {
                // SAFETY: nobody uses them from here on.
                unsafe { libc::close(descriptor) };
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_machine_that_is_full_for_a_moment_is_asked_again() {
        let tried = |fails: u32, full: bool| {
            let mut made = 0;
            let result = patiently(
                || {
                    made += 1;
                    if made > fails { Ok(made) } else { Err(full) }
                },
                |full| *full,
            );
            (result, made)
        };
        assert_eq!(tried(2, true), (Ok(3), 3));
        assert_eq!(tried(1, false), (Err(false), 1));
        assert_eq!(tried(ATTEMPTS, true), (Err(true), ATTEMPTS));
    }
}

//! What to do when somebody tells this process to end.

use std::io::{self, Read};
use std::os::fd::IntoRawFd;
use std::sync::atomic::{AtomicI32, Ordering};

use rustix::pipe::{PipeFlags, pipe_with};

/// Where the handler writes the number of the signal; never closed.
static PIPE: AtomicI32 = AtomicI32::new(-1);

/// What a terminal, a batch system and a closed terminal send.
const SIGNALS: [i32; 3] = [libc::SIGINT, libc::SIGTERM, libc::SIGHUP];

/// Has a thread of its own call `then` with the number of the first signal that tells this
/// process to end. Signals that are ignored, as a shell has it for its background jobs, stay
/// so. To be called once in a process.
pub fn on_interrupt(then: impl FnOnce(i32) + Send + 'static) -> io::Result<()> {
    let (reader, writer) = pipe_with(PipeFlags::CLOEXEC)?;
    PIPE.store(writer.into_raw_fd(), Ordering::SeqCst);
    std::thread::Builder::new()
        .name("interrupt".into())
        .spawn(move || {
            let mut number = [0];
            if std::fs::File::from(reader).read_exact(&mut number).is_ok() {
                then(i32::from(number[0]));
            }
        })?;
    for signal in SIGNALS {
        // SAFETY: the action is zeroed, which is valid, and then filled; the handler calls
        // nothing that a handler may not call.
        let failed = unsafe {
            let mut old: libc::sigaction = std::mem::zeroed();
            let mut action: libc::sigaction = std::mem::zeroed();
            action.sa_sigaction = handle as extern "C" fn(libc::c_int) as libc::sighandler_t;
            action.sa_flags = libc::SA_RESTART;
            libc::sigaction(signal, std::ptr::null(), &raw mut old) != 0
                || (old.sa_sigaction != libc::SIG_IGN
                    && libc::sigaction(signal, &raw const action, std::ptr::null_mut()) != 0)
        };
        if failed {
            return Err(io::Error::last_os_error());
        }
    }
    Ok(())
}

extern "C" fn handle(signal: libc::c_int) {
    let number = signal as u8;
    // SAFETY: `write` may be called from a handler, and the byte lives long enough. The
    // pipe holds thousands of signals, of which the first counts.
    unsafe {
        let saved = *libc::__errno_location();
        libc::write(PIPE.load(Ordering::SeqCst), (&raw const number).cast(), 1);
        *libc::__errno_location() = saved;
    }
}

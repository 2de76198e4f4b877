//! Signals by which somebody tells this process to end.
//!
//! Either [`on_interrupt`] says what, or [`interrupt_calls`] has the call end first that is
//! running. Nothing is done where neither is called: the process ends.

use std::io::{self, Read};
use std::os::fd::{BorrowedFd, IntoRawFd, OwnedFd};
use std::sync::atomic::{AtomicI32, AtomicUsize, Ordering};

use rustix::pipe::{PipeFlags, pipe_with};

/// The pipe's end to which a handler writes the number of the signal; never closed.
static WRITER: AtomicI32 = AtomicI32::new(-1);

/// The pipe's end that can be read once a call is to end, if calls are; never closed and never
/// read.
static READER: AtomicI32 = AtomicI32::new(-1);

/// Calls that are running and can be ended before the process is.
static CALLS: AtomicUsize = AtomicUsize::new(0);

/// The signal for which they are ended; 0 while there was none.
static SIGNAL: AtomicI32 = AtomicI32::new(0);

/// The signals of a terminal, a batch system and a closed terminal.
const SIGNALS: [i32; 3] = [libc::SIGINT, libc::SIGTERM, libc::SIGHUP];

type Handler = extern "C" fn(libc::c_int);

/// Has a thread of its own call `then` with the number of the first signal that tells this
/// process to end. Signals that are ignored, as a shell has it for its background jobs, stay
/// so. To be called once in a process.
pub fn on_interrupt(then: impl FnOnce(i32) + Send + 'static) -> io::Result<()> {
    let reader = pipe()?;
    std::thread::Builder::new()
        .name("interrupt".into())
        .spawn(move || {
            let mut number = [0];
            if std::fs::File::from(reader).read_exact(&mut number).is_ok() {
                then(i32::from(number[0]));
            }
        })?;
    install(tell)
}

/// From now on the first signal that tells this process to end does so for the call for a plan
/// that is running: it fails with [`Fault::Interrupted`](crate::Fault::Interrupted), and the
/// plans that came count. Without such a call, and the second time, it ends the process with
/// 128 and its number, as a shell says it. Not to be used beside [`on_interrupt`].
pub fn interrupt_calls() -> io::Result<()> {
    READER.store(pipe()?.into_raw_fd(), Ordering::SeqCst);
    install(end_call)
}

/// The signal for which a call was ended, if one was.
pub fn interrupted_by() -> Option<i32> {
    Some(SIGNAL.load(Ordering::SeqCst)).filter(|signal| *signal != 0)
}

/// Can be read once a call is to end, if calls are.
pub(crate) fn wakes() -> Option<BorrowedFd<'static>> {
    let reader = READER.load(Ordering::SeqCst);
    // SAFETY: what is stored there is open as long as the process lives.
    (reader >= 0).then(|| unsafe { BorrowedFd::borrow_raw(reader) })
}

/// A call is running that can be ended before the process is.
pub(crate) struct Interruptible(());

impl Interruptible {
    pub(crate) fn begin() -> Self {
        CALLS.fetch_add(1, Ordering::SeqCst);
        Self(())
    }
}

impl Drop for Interruptible {
    fn drop(&mut self) {
        CALLS.fetch_sub(1, Ordering::SeqCst);
    }
}

/// Makes the pipe to which handlers write; the end that can be read.
fn pipe() -> io::Result<OwnedFd> {
    let (reader, writer) = pipe_with(PipeFlags::CLOEXEC)?;
    WRITER.store(writer.into_raw_fd(), Ordering::SeqCst);
    Ok(reader)
}

/// Signals that are ignored stay so.
fn install(handler: Handler) -> io::Result<()> {
    for signal in SIGNALS {
        // SAFETY: the action is zeroed, which is valid, and then filled; the handlers call
        // nothing that a handler may not call.
        let failed = unsafe {
            let mut old: libc::sigaction = std::mem::zeroed();
            let mut action: libc::sigaction = std::mem::zeroed();
            action.sa_sigaction = handler as libc::sighandler_t;
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

extern "C" fn tell(signal: libc::c_int) {
    let number = signal as u8;
    // SAFETY: `write` may be called from a handler, and the byte lives long enough. The
    // pipe holds thousands of signals, of which the first counts.
    unsafe {
        let saved = *libc::__errno_location();
        libc::write(WRITER.load(Ordering::SeqCst), (&raw const number).cast(), 1);
        *libc::__errno_location() = saved;
    }
}

extern "C" fn end_call(signal: libc::c_int) {
    if CALLS.load(Ordering::SeqCst) == 0 || SIGNAL.swap(signal, Ordering::SeqCst) != 0 {
        // SAFETY: `_exit` may be called from a handler.
        unsafe { libc::_exit(128 + signal) };
    }
    tell(signal);
}

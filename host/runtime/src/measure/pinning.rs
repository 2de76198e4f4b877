//! Affinity masks: the CPUs that threads may run on.

use std::io;

use rustix::process::Pid;

use super::Cpus;
use super::cores::Topology;
use super::cpus::{WORD, Words, words_of};
use super::source::Source;

/// Confines a thread, by default the calling one, to these CPUs. Threads and
/// processes that it starts from then on inherit that; its other threads do not.
///
/// Allocates nothing, so it may be called between `fork` and `exec`. A mask that
/// the kernel would cut short, since a CPU is offline or not ours, is an error.
pub fn pin(thread: Option<Pid>, cpus: &Cpus) -> io::Result<()> {
    let refused = || io::Error::from_raw_os_error(libc::EINVAL);
    let mut wanted: Words = [0; _];
    for &cpu in cpus.iter() {
        let word = wanted.get_mut(cpu as usize / WORD).ok_or_else(refused)?;
        *word |= 1 << (cpu as usize % WORD);
    }
    let raw = Pid::as_raw(thread);
    // SAFETY: the kernel reads as many bytes as the array has.
    let done = unsafe { libc::sched_setaffinity(raw, size_of::<Words>(), wanted.as_ptr().cast()) };
    if done != 0 {
        return Err(io::Error::last_os_error());
    }
    if words_of(thread)? != wanted {
        return Err(refused());
    }
    Ok(())
}

/// Confines every thread of this process to these CPUs.
pub fn pin_this_process(cpus: &Cpus) -> io::Result<()> {
    // What we may use at all is to be known before there is less of it.
    let _ = Topology::of_this_process();
    let mut pinned = Vec::new();
    loop {
        let before = pinned.len();
        for thread in Source::system().numbered("proc/self/task", "") {
            let Some(pid) = Pid::from_raw(thread as i32).filter(|_| !pinned.contains(&thread))
            else {
                continue;
            };
            match pin(Some(pid), cpus) {
                Ok(()) => pinned.push(thread),
                // It has just ended.
                Err(error) if error.raw_os_error() == Some(libc::ESRCH) => {}
                Err(error) => return Err(error),
            }
        }
        // A thread that was not pinned yet may have started another meanwhile.
        if pinned.len() == before {
            return Ok(());
        }
    }
}

//! Work that several threads share.

use std::sync::{Mutex, PoisonError};

/// Does some work on every item. Each worker has a thread, and takes the next item when it is free.
pub(crate) fn share<W: Send, T>(
    workers: &mut [W],
    items: impl Iterator<Item = T> + Send,
    work: impl Fn(&mut W, T) + Sync,
) {
    let items = Mutex::new(items);
    let next = || items.lock().unwrap_or_else(PoisonError::into_inner).next();
    let run = |worker: &mut W| {
        while let Some(item) = next() {
            work(worker, item);
        }
    };
    match workers {
        [] => {}
        [worker] => run(worker),
        [first, others @ ..] => std::thread::scope(|scope| {
            for other in others {
                scope.spawn(|| run(other));
            }
            run(first);
        }),
    }
}

//! Threads of an execution.
//!
//! Parallel stages give the same bits for any number of threads: work is cut into pieces
//! that do not depend on it, and results are joined in the order of the pieces.

use rayon::ThreadPool;
use rayon::prelude::*;

use crate::error::SimError;

/// Number of threads of an execution, which uses the pool that it runs in.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Workers(usize);

impl Workers {
    pub(crate) fn new(count: usize) -> Self {
        Self(count.max(1))
    }

    pub(crate) fn count(self) -> usize {
        self.0
    }

    pub(crate) fn are_many(self) -> bool {
        self.0 > 1
    }

    /// Runs `job` in a pool of these threads, or on the caller's thread if there is one.
    pub(crate) fn run<R: Send>(
        self,
        job: impl FnOnce() -> Result<R, SimError> + Send,
    ) -> Result<R, SimError> {
        match self.pool()? {
            Some(pool) => pool.install(job),
            None => job(),
        }
    }

    /// A pool of these threads, if there is more than one.
    pub(crate) fn pool(self) -> Result<Option<ThreadPool>, SimError> {
        if !self.are_many() {
            return Ok(None);
        }
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(self.0)
            .thread_name(|index| format!("simulate-{index}"))
            .build();
        pool.map(Some).map_err(|error| SimError::Threads {
            threads: self.0,
            reason: error.to_string(),
        })
    }

    /// Calls `work` for each item independently.
    pub(crate) fn each<T: Send>(self, items: &mut [T], work: impl Fn(&mut T) + Sync + Send) {
        if self.are_many() {
            items.par_iter_mut().for_each(work);
        } else {
            items.iter_mut().for_each(work);
        }
    }
}

//! News for pages, over a WebSocket each.
//!
//! Nothing is queued for a page: what it has to be told is a set, the version of the document, numbers
//! of jobs, and the newest clip. So one that reads slowly misses what was in between, and keeps nobody
//! waiting.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use serde::Deserialize;
use serde_json::Value;
use tokio::sync::Notify;

use crate::answer::{Refused, Result};

/// Most pages at a time.
const PAGES: usize = 64;

/// Most clips per second that a page may ask for.
const MOST_HZ: f64 = 60.0;

/// Most jobs that a page watches.
const WATCHED: usize = 16;

/// A message of a page.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(tag = "type", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Message {
    /// Send clips of a live fleet, so many per second at most.
    Watch {
        /// The job.
        job: u32,
        /// Clips per second.
        #[serde(default = "usual_hz")]
        rate: f64,
    },
    /// Send no more of them.
    Unwatch {
        /// The job.
        job: u32,
    },
    /// Tell a live fleet something.
    Control {
        /// The job.
        job: u32,
        /// A command as `fleetyard fleet --live` reads it.
        #[serde(rename = "do")]
        what: Value,
    },
}

fn usual_hz() -> f64 {
    30.0
}

impl Message {
    /// Reads a message.
    pub fn read(text: &str) -> std::result::Result<Self, String> {
        let message: Self = serde_json::from_str(text).map_err(|error| error.to_string())?;
        match message {
            Self::Watch { rate, .. } if !(rate > 0.0 && rate <= MOST_HZ) => {
                Err(format!("{rate} clips per second: at most {MOST_HZ}"))
            }
            message => Ok(message),
        }
    }
}

/// Something that happened, of which there is no more to say.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Event {
    /// Somebody has looked for planners.
    Planners,
    /// A recording was opened.
    Recordings,
    /// Another page came in.
    Newcomer,
}

impl Event {
    /// The type of its message.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Planners => "planners",
            Self::Recordings => "recordings",
            Self::Newcomer => "newcomer",
        }
    }
}

/// News that a page has not been told yet.
#[derive(Debug, Default)]
pub(crate) struct News {
    pub(crate) version: Option<u64>,
    pub(crate) events: BTreeSet<Event>,
    pub(crate) jobs: BTreeSet<u32>,
    pub(crate) clip: Option<(u32, Arc<[u8]>)>,
    pub(crate) goodbye: bool,
}

/// A page that is connected.
#[derive(Debug, Default)]
pub(crate) struct Page {
    news: Mutex<News>,
    /// Jobs that it watches: the least time between clips, and when the next one is due.
    watched: Mutex<BTreeMap<u32, (Duration, Instant)>>,
    wake: Notify,
}

impl Page {
    /// Waits until there is news, and takes it.
    pub(crate) async fn news(&self) -> News {
        self.wake.notified().await;
        std::mem::take(&mut *lock(&self.news))
    }

    fn tell(&self, tell: impl FnOnce(&mut News)) {
        tell(&mut lock(&self.news));
        self.wake.notify_one();
    }

    pub(crate) fn watch(&self, job: u32, rate_hz: f64) -> Result<()> {
        let mut watched = lock(&self.watched);
        if watched.len() >= WATCHED && !watched.contains_key(&job) {
            return Err(Refused::value(format!(
                "a page watches {WATCHED} jobs at most"
            )));
        }
        watched.insert(
            job,
            (Duration::from_secs_f64(1.0 / rate_hz), Instant::now()),
        );
        Ok(())
    }

    pub(crate) fn unwatch(&self, job: u32) {
        lock(&self.watched).remove(&job);
    }

    /// True if the page watches a job, and the next clip of it is due.
    fn wants(&self, job: u32) -> bool {
        let now = Instant::now();
        let mut watched = lock(&self.watched);
        let Some((pause, due)) = watched.get_mut(&job).filter(|(_, due)| *due <= now) else {
            return false;
        };
        *due = now + *pause;
        true
    }
}

/// All pages.
#[derive(Debug, Default)]
pub(crate) struct Feed {
    pages: Mutex<(u64, BTreeMap<u64, Arc<Page>>)>,
}

impl Feed {
    /// A page joins. It leaves by its number.
    pub(crate) fn join(&self) -> Result<(u64, Arc<Page>)> {
        let mut pages = lock(&self.pages);
        let (next, pages) = &mut *pages;
        if pages.len() >= PAGES {
            let status = axum::http::StatusCode::SERVICE_UNAVAILABLE;
            return Err(
                Refused::new(status, format!("{PAGES} pages are open already"))
                    .hint("close some of them"),
            );
        }
        *next += 1;
        let page = Arc::new(Page::default());
        pages.insert(*next, Arc::clone(&page));
        Ok((*next, page))
    }

    pub(crate) fn leave(&self, number: u64) {
        lock(&self.pages).1.remove(&number);
    }

    fn all(&self, tell: impl Fn(&mut News)) {
        for page in lock(&self.pages).1.values() {
            page.tell(&tell);
        }
    }

    /// The document has another version.
    pub(crate) fn changed(&self, version: u64) {
        self.all(|news| news.version = Some(version));
    }

    /// Something happened.
    pub(crate) fn happened(&self, event: Event) {
        self.all(|news| {
            news.events.insert(event);
        });
    }

    /// A job is another than it was, or is gone.
    pub(crate) fn job(&self, id: u32) {
        self.all(|news| {
            news.jobs.insert(id);
        });
    }

    /// A clip of a live fleet; it takes the place of one that was not sent yet.
    pub(crate) fn clip(&self, job: u32, clip: &Arc<[u8]>) {
        for page in lock(&self.pages).1.values().filter(|page| page.wants(job)) {
            page.tell(|news| news.clip = Some((job, Arc::clone(clip))));
        }
    }

    /// The studio ends.
    pub(crate) fn goodbye(&self) {
        self.all(|news| news.goodbye = true);
    }
}

/// Plain values that are whole also where somebody panicked.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_that_does_not_read_holds_one_clip_and_keeps_nobody_waiting() {
        let feed = Feed::default();
        let (number, page) = feed.join().unwrap();
        page.watch(7, MOST_HZ).unwrap();
        for version in 0..100_000 {
            feed.changed(version);
            feed.job(version as u32 % 5);
            feed.clip(8, &Arc::from([0; 16]));
        }
        feed.clip(7, &Arc::from([1; 16]));
        let news = std::mem::take(&mut *lock(&page.news));
        assert_eq!(news.version, Some(99_999));
        assert_eq!(news.jobs.len(), 5);
        // Of a job that it does not watch it gets none.
        assert_eq!(news.clip, Some((7, Arc::from([1; 16]))));
        feed.leave(number);
        feed.goodbye();
        assert!(!lock(&page.news).goodbye);
    }

    #[test]
    fn pages_have_a_bound() {
        let feed = Feed::default();
        for _ in 0..PAGES {
            feed.join().unwrap();
        }
        assert_eq!(feed.join().unwrap_err().status().as_u16(), 503);
        feed.leave(1);
        assert!(feed.join().is_ok());
    }

    #[test]
    fn messages_are_read_or_refused() {
        let watch = Message::read(r#"{"type":"watch","job":3,"rate":10}"#);
        assert_eq!(watch, Ok(Message::Watch { job: 3, rate: 10.0 }));
        for wrong in [
            "",
            "[]",
            r#"{"type":"watch"}"#,
            r#"{"type":"watch","job":-1}"#,
            r#"{"type":"watch","job":1,"rate":0}"#,
            r#"{"type":"watch","job":1,"rate":1e9}"#,
            r#"{"type":"watch","job":1,"more":1}"#,
            r#"{"type":"start","job":1}"#,
        ] {
            assert!(Message::read(wrong).is_err(), "{wrong}");
        }
    }
}

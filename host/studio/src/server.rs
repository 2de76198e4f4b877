//! The server from its start to its end.

use std::env;
use std::fmt;
use std::fs::File;
use std::io::{self, Read};
use std::net::{IpAddr, SocketAddr, TcpListener};
use std::os::fd::AsFd;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use fleetyard_core::{InputError, open_regular};
use fleetyard_runtime::Runtime;
use rustix::fs::{FileType, fstat};
use serde_json::{Value, json};
use tokio::sync::Notify;

use crate::access::Access;
use crate::answer::Refused;
use crate::desk::Desk;
use crate::feed::{Event, Feed};
use crate::files::{Kind, Source};
use crate::jobs::{Jobs, News};
use crate::planners::Planners;
use crate::recordings::{Recordings, is_trace};
use crate::routes::router;
use crate::scratch::{Scratch, usual_base};
use crate::suite::{Suite, is_store, store_in};
use crate::visitors::{Reception, Visit};

/// The time that requests have to end when the studio does.
const GOODBYE: Duration = Duration::from_secs(2);

/// The beginning of a studio.
#[derive(Debug)]
pub struct Config {
    /// The document, recordings, and the store of a suite or a folder that has one.
    pub files: Vec<PathBuf>,
    /// The trial of the suite that is opened at once, by its number or key.
    pub trial: Option<String>,
    /// The address at which it listens.
    pub address: IpAddr,
    /// Its port; 0 for one that is free.
    pub port: u16,
    /// Describes planners.
    pub runtime: Runtime,
    /// Arguments of commands that say which plugins may run.
    pub trust: Vec<String>,
    /// Tells the user what happens while it serves.
    pub tell: fn(&str),
}

/// All that requests share.
pub(crate) struct Studio {
    pub(crate) access: Access,
    pub(crate) desk: Desk,
    pub(crate) feed: Arc<Feed>,
    pub(crate) planners: Planners,
    pub(crate) jobs: Jobs,
    pub(crate) recordings: Recordings,
    /// The suite whose trials can be opened.
    pub(crate) suite: Option<Suite>,
    /// The trial that was opened at the beginning, with its job.
    pub(crate) begun_with: Option<Value>,
    pub(crate) trust: Vec<String>,
    /// True once a page has come in.
    is_entered: AtomicBool,
    tell: fn(&str),
    /// Goes last: jobs work in it.
    _scratch: Scratch,
}

/// A studio that listens.
pub struct Server {
    listener: TcpListener,
    studio: Arc<Studio>,
    stopper: Stopper,
    notes: Vec<String>,
}

impl fmt::Debug for Server {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Server").finish_non_exhaustive()
    }
}

/// Ends a studio.
#[derive(Debug, Clone, Default)]
pub struct Stopper(Arc<Notify>);

impl Stopper {
    /// Has the studio end: it says goodbye to its pages, ends its jobs and removes its folder.
    pub fn stop(&self) {
        self.0.notify_one();
    }

    /// The same once standard input is closed, if that is a pipe: whoever holds the other end may be gone.
    pub fn when_input_closes(self) -> io::Result<()> {
        let stdin = io::stdin();
        let kind = FileType::from_raw_mode(fstat(stdin.as_fd())?.st_mode);
        if !matches!(kind, FileType::Fifo | FileType::Socket) {
            return Ok(());
        }
        let mut stdin = File::from(stdin.as_fd().try_clone_to_owned()?);
        thread::Builder::new().name("input".into()).spawn(move || {
            let _ = io::copy(&mut stdin, &mut io::sink());
            self.stop();
        })?;
        Ok(())
    }
}

impl Server {
    /// Opens the files, and listens.
    pub fn bind(config: Config) -> Result<Self, InputError> {
        let scratch = Scratch::below(&usual_base())?;
        let place = SocketAddr::new(config.address, config.port);
        let cannot = |error: io::Error| {
            InputError::new(
                place.to_string(),
                format!("the studio cannot listen here: {error}"),
            )
            .hint("leave out --port to take one that is free")
        };
        let listener = TcpListener::bind(place).map_err(cannot)?;
        listener.set_nonblocking(true).map_err(cannot)?;
        let port = listener.local_addr().map_err(cannot)?.port();
        let feed = Arc::new(Feed::default());
        let news = Arc::clone(&feed);
        let tell = move |job, said: News| match said {
            News::Changed => news.job(job),
            News::Clip(clip) => news.clip(job, &clip),
        };
        let jobs = Jobs::new(scratch.path(), Box::new(tell)).map_err(cannot)?;
        let (suite, files) = suite_of(&config.files)?;
        let mut studio = Studio {
            access: Access::new(config.address, port).map_err(cannot)?,
            desk: Desk::within(env::current_dir().unwrap_or_default()),
            feed,
            planners: Planners::new(config.runtime),
            jobs,
            recordings: Recordings::default(),
            suite,
            begun_with: None,
            trust: config.trust,
            is_entered: AtomicBool::new(false),
            tell: config.tell,
            _scratch: scratch,
        };
        let mut notes = studio.begin(&files)?;
        if let Some(trial) = &config.trial {
            let opened = studio.open_trial(trial);
            let opened = opened.map_err(|refused| refused.about(&format!("trial {trial}")))?;
            let said = opened["notes"].as_array().into_iter().flatten();
            notes.extend(said.filter_map(Value::as_str).map(str::to_owned));
            studio.begun_with = Some(json!({"trial": opened["trial"], "job": opened["job"]["id"]}));
        }
        Ok(Self {
            listener,
            studio: Arc::new(studio),
            stopper: Stopper::default(),
            notes,
        })
    }

    /// Remarks on what the files have that is not kept.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// The address with the token, for people and scripts.
    pub fn printed(&self) -> String {
        self.studio.access.printed()
    }

    /// The address for a browser that is started: others may read it there, and it is worth something
    /// once.
    pub fn for_browser(&self) -> String {
        self.studio.access.for_browser()
    }

    /// Ends it.
    pub fn stopper(&self) -> Stopper {
        self.stopper.clone()
    }

    /// Serves until it is stopped. Afterwards nothing of it is left.
    pub fn serve(self) -> io::Result<()> {
        let Self {
            listener,
            studio,
            stopper,
            ..
        } = self;
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(2)
            .enable_all()
            .build()?;
        let served = runtime.block_on(async {
            let listener = tokio::net::TcpListener::from_std(listener)?;
            let stopped = Arc::new(Notify::new());
            let ending = Arc::clone(&stopped);
            let router = router(Arc::clone(&studio));
            let service = router.into_make_service_with_connect_info::<Visit>();
            let serving = axum::serve(Reception::new(listener), service)
                .with_graceful_shutdown(async move { ending.notified().await });
            let serving = tokio::spawn(serving.into_future());
            stopper.0.notified().await;
            studio.feed.goodbye();
            stopped.notify_one();
            let jobs = Arc::clone(&studio);
            let _ = tokio::task::spawn_blocking(move || jobs.jobs.close()).await;
            // Those who have not read their answers by then do not want them.
            let _ = tokio::time::timeout(GOODBYE, serving).await;
            Ok(())
        });
        runtime.shutdown_timeout(GOODBYE);
        served
    }
}

impl Studio {
    /// A page came in. All are told of any but the first: it may be somebody else's.
    pub(crate) fn welcome(&self) {
        if self.is_entered.swap(true, Ordering::Relaxed) {
            self.feed.happened(Event::Newcomer);
            (self.tell)("another browser came in; if that was not you, end the studio");
        }
    }

    /// Opens files: traces, plans, and what makes a document together. Returns what is not kept of them.
    fn begin(&self, files: &[PathBuf]) -> Result<Vec<String>, InputError> {
        let (mut sources, mut plans) = (Vec::new(), Vec::new());
        for file in files {
            if is_trace(&beginning(file)?) {
                let name = file.file_name().unwrap_or_default().to_string_lossy();
                self.recordings.open(self.jobs.number(), &name, file)?;
                continue;
            }
            let source = Source::load(file)?;
            if Kind::of(&source.name, &source.bytes).is_some_and(Kind::is_plan) {
                plans.push(source);
            } else {
                sources.push(source);
            }
        }
        let notes = if sources.is_empty() {
            Vec::new()
        } else {
            self.desk.begin(&sources)?
        };
        for Source { name, bytes, .. } in plans {
            let id = self.jobs.number();
            self.open_plan(id, &name, &bytes)
                .map_err(|refused: Refused| refused.about(&name))?;
        }
        Ok(notes)
    }
}

/// The suite among what the studio is started with, and the other files.
fn suite_of(given: &[PathBuf]) -> Result<(Option<Suite>, Vec<PathBuf>), InputError> {
    let begins_so = |path: &Path| beginning(path).is_ok_and(|begin| is_store(&begin));
    let (mut suite, mut files) = (None, Vec::new());
    for path in given {
        let store = if path.is_dir() {
            store_in(path, &begins_so)?
        } else if begins_so(path) {
            path.clone()
        } else {
            files.push(path.clone());
            continue;
        };
        if suite.replace(Suite::open(&store)?).is_some() {
            let reason = "there is another suite already";
            return Err(InputError::new(path.display().to_string(), reason)
                .hint("merge stores of one suite: `fleetyard store merge ALL STORE…`"));
        }
    }
    Ok((suite, files))
}

/// The first bytes of a file.
fn beginning(path: &Path) -> Result<Vec<u8>, InputError> {
    let mut begin = Vec::new();
    let read = open_regular(path)?.take(64).read_to_end(&mut begin);
    read.map_err(|error| {
        InputError::new(path.display().to_string(), format!("cannot read: {error}"))
    })?;
    Ok(begin)
}

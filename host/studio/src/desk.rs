//! The document that is edited, with its history and what was derived and made of it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use axum::http::StatusCode;
use fleetyard_core::{Digest, InputError, read_file};
use fleetyard_views::{Judged, Representation};
use serde::Deserialize;
use serde_json::{Value, json};

use crate::answer::{Refused, Result};
use crate::artefacts::{Artefacts, KeptPlan};
use crate::document::Document;
use crate::edit::{Edit, Refusal};
use crate::files::{self, Exported, Files, Opened, Source};
use crate::history::History;
use crate::jobs::Origin;
use crate::recordings::Span;
use crate::reservations::{Reservations, reservations};

/// Most violations of a verdict that are described.
const DESCRIBED: usize = 100;

/// Largest plan file that is judged, in bytes.
const PLAN_BYTES: u64 = 1 << 28;

/// The document with its history. Requests take turns at it, and work on copies of it.
#[derive(Debug, Default)]
pub(crate) struct Desk {
    /// The folder in which documents get files that have none.
    pub(crate) folder: PathBuf,
    state: Mutex<State>,
    pub(crate) artefacts: Artefacts,
    /// Documents of which plans were made, and the plans once they were read.
    planned: Mutex<BTreeMap<u32, Planned>>,
}

#[derive(Debug)]
struct State {
    history: History,
    files: Option<Files>,
    /// The document as files have it.
    saved: Document,
    /// It has something that no file has.
    is_unsaved: bool,
}

impl Default for State {
    fn default() -> Self {
        Self {
            history: History::new(Document::default()),
            files: None,
            saved: Document::default(),
            is_unsaved: false,
        }
    }
}

impl State {
    /// Puts what was opened in the place of the document, in one step of the history. Returns what is not kept
    /// of it.
    fn put(&mut self, opened: Opened) -> std::result::Result<Vec<String>, Refusal> {
        let Opened {
            document,
            notes,
            files,
        } = opened;
        self.history.edit(&Edit::replace("open", document))?;
        self.saved = self.history.document().clone();
        self.has(files);
        Ok(notes)
    }

    /// Says which files the document has, after a change of it or of them.
    fn has(&mut self, files: Option<Files>) {
        let document = self.history.document();
        let is_nothing = files.is_none() && document.is_blank();
        self.is_unsaved = !is_nothing && *document != self.saved;
        self.files = files;
    }

    fn now(&self) -> Now {
        let history = &self.history;
        Now {
            document: history.document().clone(),
            version: history.version(),
            undo: history.undoable().map(str::to_owned),
            redo: history.redoable().map(str::to_owned),
            file: self.files.as_ref().map(|files| files.task.clone()),
            is_unsaved: self.is_unsaved,
        }
    }
}

#[derive(Debug, Clone)]
struct Planned {
    document: Document,
    plan: Option<Arc<KeptPlan>>,
}

/// A document with its place in the history.
#[derive(Debug, Clone)]
pub(crate) struct Now {
    pub(crate) document: Document,
    pub(crate) version: u64,
    undo: Option<String>,
    redo: Option<String>,
    /// The task file that it is saved to.
    file: Option<PathBuf>,
    /// It has something that no file has.
    is_unsaved: bool,
}

/// A request to save the document: as it was opened, or under a name.
#[derive(Debug, Default, Deserialize)]
#[serde(
    default,
    deny_unknown_fields,
    expecting = "an object, with a name where the document is to have another"
)]
pub(crate) struct Saving {
    name: Option<String>,
    /// Files of this name are replaced.
    replace: bool,
    /// Files outside of the document's folder are written, too.
    outside: bool,
}

/// A request to change the document.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Change {
    /// The version that the sender has seen.
    base_version: u64,
    #[serde(default)]
    op: Option<Value>,
}

/// A change of the document that was read.
#[derive(Debug)]
pub struct Changing {
    base_version: u64,
    edit: Option<Edit>,
}

impl Changing {
    /// Reads the request of an edit, or, without an operation, of a step back or forth.
    pub fn read(bytes: &[u8], has_operation: bool) -> std::result::Result<Self, Refused> {
        let Change { base_version, op } = serde_json::from_slice(bytes)
            .map_err(|error| Refused::value(error.to_string()).at("").hint(CHANGE))?;
        if op.is_some() != has_operation {
            return Err(Refused::value("the request is not what this route takes")
                .at("/op")
                .hint(CHANGE));
        }
        Ok(Self {
            base_version,
            edit: op.map(Edit::read).transpose()?,
        })
    }

    /// The edit, if it is one.
    pub fn edit(&self) -> Option<&Edit> {
        self.edit.as_ref()
    }
}

const CHANGE: &str = "an edit is an object with base_version and op; undo and redo have no op";

impl From<Refusal> for Refused {
    fn from(refusal: Refusal) -> Self {
        let Refusal { error, place, hint } = refusal;
        Self::value(error).at(place).hint(hint)
    }
}

/// A step through the history.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Step {
    Edit,
    Undo,
    Redo,
}

impl Desk {
    /// With an empty room, which is saved in a folder.
    pub(crate) fn within(folder: PathBuf) -> Self {
        Self {
            folder,
            ..Self::default()
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // An edit is made whole or not at all.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn planned(&self) -> MutexGuard<'_, BTreeMap<u32, Planned>> {
        self.planned.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The document as it is.
    pub(crate) fn now(&self) -> Now {
        self.state().now()
    }

    /// The document as a page is told it.
    pub(crate) fn tell(&self, now: &Now) -> Result<Value> {
        let whole = self.artefacts.whole(&now.document)?;
        Ok(json!({
            "version": now.version,
            "digest": whole.digest,
            "document": now.document,
            "problems": whole.problems,
            "undo": now.undo,
            "redo": now.redo,
            "file": now.file.as_ref().map(|file| file.display().to_string()),
            "unsaved": now.is_unsaved,
        }))
    }

    /// Changes the document, if nobody else has changed it since.
    pub(crate) fn change(&self, changing: &Changing, step: Step) -> Result<Now> {
        let mut state = self.state();
        let version = state.history.version();
        if changing.base_version != version {
            return Err(Refused::new(
                StatusCode::CONFLICT,
                "somebody has changed the document meanwhile",
            )
            .hint("get it again")
            .with("version", version));
        }
        let nothing = |what: &str| {
            let reason = format!("there is nothing to {what}");
            Err(Refused::new(StatusCode::CONFLICT, reason).with("version", version))
        };
        match (step, &changing.edit) {
            (Step::Edit, Some(edit)) => state.history.edit(edit)?,
            (Step::Undo, _) if !state.history.undo() => return nothing("undo"),
            (Step::Redo, _) if !state.history.redo() => return nothing("redo"),
            _ => {}
        }
        // Files are of the document that was saved, and not of one that was put in its place.
        let is_another = changing.edit().is_some_and(Edit::is_replacement);
        let files = state.files.take().filter(|_| !is_another);
        state.has(files);
        Ok(state.now())
    }

    /// Opens files that make a document together, in one step of the history.
    pub(crate) fn open(&self, sources: &[Source]) -> Result<(Now, Vec<String>)> {
        // Reading may take long, and keeps nobody waiting.
        let current = self.now().document;
        let opened = files::open(sources, &current)?;
        let mut state = self.state();
        let notes = state.put(opened)?;
        Ok((state.now(), notes))
    }

    /// Puts a document that is in no file in the place of the one that is there.
    pub(crate) fn put(&self, document: Document) -> Result<Now> {
        let mut state = self.state();
        state.put(Opened {
            document,
            notes: Vec::new(),
            files: None,
        })?;
        Ok(state.now())
    }

    /// Begins with files, before anybody has seen the document.
    pub(crate) fn begin(&self, sources: &[Source]) -> std::result::Result<Vec<String>, InputError> {
        let mut state = self.state();
        let opened = files::open(sources, state.history.document())?;
        let notes = state
            .put(opened)
            .map_err(|refusal| files::refused("", refusal))?;
        state.history = History::new(state.history.document().clone());
        Ok(notes)
    }

    /// Writes the document to the files from which it was opened, or to others in the studio's folder, which are
    /// its files from then on. Returns those that were written.
    pub(crate) fn save(&self, asked: Saving) -> Result<(Now, Vec<PathBuf>)> {
        let (mut document, files) = {
            let state = self.state();
            (state.history.document().clone(), state.files.clone())
        };
        let files = match (&asked.name, files) {
            (Some(name), _) => {
                if name.trim().is_empty() {
                    return Err(Refused::value("a document is saved under a name").at("/name"));
                }
                document.set_name(name.clone())?;
                let files = Files::within(&self.folder, &document);
                let there = [&files.task, &files.ground].into_iter();
                let is_there = |file: &&PathBuf| file.symlink_metadata().is_ok();
                let there = there.filter(|file| is_there(file) && !asked.replace).min();
                if let Some(there) = there {
                    let reason = format!("{} is there already", there.display());
                    return Err(Refused::new(StatusCode::CONFLICT, reason)
                        .hint("replace it, or take another name")
                        .with("exists", true));
                }
                files
            }
            (None, Some(files)) => files,
            (None, None) => {
                let reason = "the document was opened from no task file";
                return Err(Refused::new(StatusCode::CONFLICT, reason).hint("give it a name"));
            }
        };
        // A file that was opened may come from anybody, and name anything.
        let folder = files.task.parent().unwrap_or(Path::new(""));
        let outside = files.outside(folder);
        if !outside.is_empty() && !asked.outside {
            let outside: Vec<String> = outside
                .iter()
                .map(|file| file.display().to_string())
                .collect();
            let reason = format!(
                "{} would be written, outside of the document's folder {}",
                outside.join(" and "),
                folder.display()
            );
            return Err(Refused::new(StatusCode::CONFLICT, reason)
                .hint("say that it may, or save under another name")
                .with("outside", outside));
        }
        files.check(&document)?;
        let written = files::save(&document, &files)?;
        let mut state = self.state();
        if let Some(name) = asked.name
            && state.history.document().name() != name
        {
            state.history.edit(&Edit::rename(name))?;
        }
        state.saved = document;
        state.has(Some(files));
        Ok((state.now(), written))
    }

    /// The document in one of its forms.
    pub(crate) fn export(&self, form: &str) -> Result<Exported> {
        Ok(files::export(&self.now().document, &self.artefacts, form)?)
    }

    /// The origin of a job on a document.
    pub(crate) fn origin(&self, now: &Now) -> Result<Origin> {
        let whole = self.artefacts.whole(&now.document)?;
        let views = serde_json::to_value(now.document.views());
        Ok(Origin {
            version: now.version,
            digest: whole.digest,
            views: views.map_err(|error| Refused::machine("views cannot be written", error))?,
        })
    }

    /// True if a job of this origin and view would be another one on the document as it is.
    pub(crate) fn is_stale(&self, origin: &Origin, view: Option<Representation>) -> bool {
        let Ok(now) = self.origin(&self.now()) else {
            return true;
        };
        let changed = |view: Representation| now.views[view.name()] != origin.views[view.name()];
        now.digest != origin.digest || view.is_some_and(changed)
    }

    /// Remembers the document of which a job makes a plan.
    pub(crate) fn plans(&self, job: u32, document: Document) {
        let plan = None;
        self.planned().insert(job, Planned { document, plan });
    }

    /// Registers a job's plan.
    pub(crate) fn register(&self, job: u32, plan: Digest, problem: Digest) {
        let from = vec![("problem".to_owned(), problem)];
        self.artefacts.register(&artefact(job), plan, from);
    }

    /// Forgets a job.
    pub(crate) fn forget(&self, job: u32) {
        self.planned().remove(&job);
        self.artefacts.forget(&artefact(job));
    }

    /// The verdict on a job's plan in the document as it is.
    pub(crate) fn verdict(&self, job: u32, path: &Path) -> Result<Judged> {
        let (_, plan) = self.plan(job, path)?;
        Ok(self
            .artefacts
            .verdict(&self.now().document, &plan, DESCRIBED)?)
    }

    /// The places that a job's plan keeps for its robots in a window of time.
    pub(crate) fn reservations(&self, job: u32, path: &Path, span: Span) -> Result<Reservations> {
        let (document, plan) = self.plan(job, path)?;
        let whole = self.artefacts.whole(&document)?;
        reservations(&plan, whole.plannable()?, span)
    }

    /// The document of which a job's plan was made, and the plan.
    fn plan(&self, job: u32, path: &Path) -> Result<(Document, Arc<KeptPlan>)> {
        let planned = self.planned().get(&job).cloned();
        let Some(Planned { document, plan }) = planned else {
            return Err(Refused::unknown("plan"));
        };
        if let Some(plan) = plan {
            return Ok((document, plan));
        }
        let bytes = read_file(path, PLAN_BYTES)?;
        let plan = self.artefacts.plan(&document, path.to_owned(), bytes)?;
        let plan = Arc::new(plan);
        if let Some(planned) = self.planned().get_mut(&job) {
            planned.plan = Some(Arc::clone(&plan));
        }
        Ok((document, plan))
    }
}

/// The name of a job's plan among artefacts.
fn artefact(job: u32) -> String {
    format!("plan-{job}")
}

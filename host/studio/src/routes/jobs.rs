//! Routes of jobs.

use std::fs;
use std::os::unix::fs::DirBuilderExt;
use std::path::Path as FilePath;
use std::sync::Arc;

use axum::Router;
use axum::body::Body;
use axum::extract::{Path, State};
use axum::http::{HeaderMap, StatusCode};
use axum::response::{Json, Response};
use axum::routing::{get, post};
use fleetyard_core::Digest;
use fleetyard_core::formats::{Format, Known, grid_size};
use fleetyard_views::Representation;
use serde_json::{Value, json};

use super::sent::send_file;
use super::{Query, SMALL, Shared, apart, body};
use crate::answer::{Refused, Result};
use crate::desk::Now;
use crate::document::Ground;
use crate::files::{self, Files, Kind as FileKind};
use crate::jobs::Origin;
use crate::jobs::ask::{Asked, Given, Kind, Order, PLAN};
use crate::recordings::Span;
use crate::server::Studio;

pub(super) fn routes() -> Router<Arc<Studio>> {
    Router::new()
        .route("/api/jobs", get(all).post(add))
        .route("/api/jobs/{id}", get(one).delete(delete))
        .route("/api/jobs/{id}/stop", post(stop))
        .route("/api/jobs/{id}/cancel", post(cancel))
        .route("/api/jobs/{id}/plan", get(plan))
        .route("/api/jobs/{id}/reservations", get(reservations))
        .route("/api/jobs/{id}/doing", get(doing))
}

async fn all(State(studio): Shared) -> Result<Json<Value>> {
    apart(move || {
        let jobs = studio.jobs.all().into_iter();
        Ok(Json(jobs.map(|job| studio.with_staleness(job)).collect()))
    })
    .await
}

async fn one(State(studio): Shared, Path(id): Path<u32>) -> Result<Json<Value>> {
    apart(move || {
        let mut job = studio.with_staleness(studio.jobs.whole(id)?);
        if let Ok((path, _)) = studio.jobs.plan(id) {
            job["verdict"] = match studio.desk.verdict(id, &path) {
                Ok(judged) => {
                    let mut verdict = json!(judged);
                    verdict["valid"] = judged.is_valid().into();
                    verdict
                }
                Err(refused) => json!({"error": refused.error()}),
            };
        }
        Ok(Json(job))
    })
    .await
}

async fn add(State(studio): Shared, asked: Body) -> Result<Json<Value>> {
    let asked = body(asked, SMALL).await?;
    let asked = Asked::read(&asked).map_err(Refused::value)?;
    apart(move || studio.add(&asked).map(Json)).await
}

async fn stop(State(studio): Shared, Path(id): Path<u32>) -> Result<Json<Value>> {
    apart(move || studio.jobs.stop(id).map(Json)).await
}

async fn cancel(State(studio): Shared, Path(id): Path<u32>) -> Result<Json<Value>> {
    apart(move || studio.jobs.cancel(id).map(Json)).await
}

async fn doing(State(studio): Shared, Path(id): Path<u32>) -> Result<Json<Value>> {
    studio.jobs.doing(id).map(Json)
}

async fn delete(State(studio): Shared, Path(id): Path<u32>) -> Result<Json<Value>> {
    apart(move || {
        studio.jobs.delete(id)?;
        studio.desk.forget(id);
        studio.recordings.forget(id);
        Ok(Json(json!({})))
    })
    .await
}

async fn plan(State(studio): Shared, Path(id): Path<u32>, asked: HeaderMap) -> Result<Response> {
    let path = studio.jobs.file(id, PLAN)?;
    send_file(&path, "application/json", &asked).await
}

async fn reservations(
    State(studio): Shared,
    Path(id): Path<u32>,
    Query(span): Query<Span>,
) -> Result<Json<Value>> {
    apart(move || {
        let (path, _) = studio.jobs.plan(id)?;
        Ok(Json(json!(studio.desk.reservations(id, &path, span)?)))
    })
    .await
}

impl Studio {
    /// Says of a job whether it would be another one now.
    fn with_staleness(&self, mut job: Value) -> Value {
        let id = job["id"].as_u64().unwrap_or_default() as u32;
        if let Ok((origin, view)) = self.jobs.origin(id) {
            job["stale"] = self.desk.is_stale(&origin, view).into();
        }
        job
    }

    /// Puts a job on the document as it is into the queue.
    fn add(&self, asked: &Asked) -> Result<Value> {
        let now = self.desk.now();
        let planners = self.planners.known();
        let kind = asked.kind()?;
        let map = format!("{}.map", files::stem(&now.document));
        let views = serde_json::to_value(now.document.views());
        let views = views.map_err(|error| Refused::machine("views cannot be written", error))?;
        let order = asked.order(&Given {
            planners: &planners,
            task: &files::task_file(&now.document),
            map: &map,
            cell_m: match (kind, &now.document.ground) {
                (Kind::Fleet, Ground::World(_)) => self.desk.artefacts.grid(&now.document)?.cell_m,
                (_, Ground::Map { cell_size_m, .. }) => *cell_size_m,
                (_, Ground::World(_)) => 0.0,
            },
            is_grid: matches!(now.document.ground, Ground::World(_)),
            views: &views,
            trust: &self.trust,
            view_of: &|job| self.jobs.plan(job).map(|(_, view)| view),
        })?;
        let plan = order.plan_of.map(|job| self.jobs.plan(job)).transpose()?;
        let id = self.jobs.number();
        let folder = self.jobs.folder(id);
        let write = || {
            make_folder(&folder)?;
            if kind == Kind::Fleet {
                let map_bytes =
                    files::export(&now.document, &self.desk.artefacts, Format::Map.name())?;
                put(&folder.join(&map), &map_bytes.bytes)?;
            } else {
                self.write_task(&now, &folder)?;
            }
            if let Some((plan, _)) = &plan {
                fs::copy(plan, folder.join(PLAN))
                    .map_err(|error| Refused::machine("the plan cannot be copied", error))?;
            }
            self.desk.origin(&now)
        };
        let origin: Origin = write().inspect_err(|_| {
            let _ = fs::remove_dir_all(&folder);
        })?;
        if kind != Kind::Fleet {
            self.desk.plans(id, now.document.clone());
        }
        self.jobs.add(id, order, asked.group, origin)
    }

    /// Opens a plan: it is executed on the document as it is.
    pub(crate) fn open_plan(&self, id: u32, name: &str, bytes: &[u8]) -> Result<Value> {
        let Some(FileKind::Format(format)) = FileKind::of(name, bytes) else {
            return Err(Refused::unknown("plan"));
        };
        let view = Representation::of_plans(format);
        let now = self.desk.now();
        if view == Representation::Grid {
            let planned = self.robots_of(&now, format, name, bytes)?;
            let given = now.document.agents.len();
            if planned != given {
                let reason = format!("the plan is of {planned} robots, and here are {given}");
                let hint = if planned < given {
                    format!("keep the first {planned} (panel Robots), and open it again")
                } else {
                    "open the map with all its starts and goals first".to_owned()
                };
                return Err(Refused::new(StatusCode::CONFLICT, reason).hint(hint));
            }
        }
        let views = serde_json::to_value(now.document.views());
        let views = views.map_err(|error| Refused::machine("views cannot be written", error))?;
        let order = Asked::execution(id).order(&Given {
            planners: &[],
            task: &files::task_file(&now.document),
            map: "",
            cell_m: 0.0,
            is_grid: false,
            views: &views,
            trust: &self.trust,
            view_of: &|_| Ok(view),
        })?;
        Ok(json!({"job": self.execute(&now, id, order, name, bytes)?}))
    }

    /// Number of robots of a plan on the document's grid.
    fn robots_of(&self, now: &Now, format: Format, name: &str, bytes: &[u8]) -> Result<usize> {
        let view = self.desk.artefacts.instance(&now.document)?;
        let size = grid_size(view.instance.grid());
        Ok(format
            .read_plan(name, bytes, Known::size(Some(size)), None)?
            .plan
            .agents())
    }

    /// Executes a plan on the document as it was a moment ago, under the name that it was opened by.
    pub(crate) fn execute(
        &self,
        now: &Now,
        id: u32,
        mut order: Order,
        name: &str,
        bytes: &[u8],
    ) -> Result<Value> {
        order.plan_of = None;
        order.opened = Some(name.to_owned());
        let folder = self.jobs.folder(id);
        let write = || {
            make_folder(&folder)?;
            self.write_task(now, &folder)?;
            put(&folder.join(PLAN), bytes)?;
            self.desk.origin(now)
        };
        let origin = write().inspect_err(|_| {
            let _ = fs::remove_dir_all(&folder);
        })?;
        self.desk.plans(id, now.document.clone());
        self.jobs.add(id, order, None, origin)
    }

    /// Writes the files of a document that can be planned for.
    fn write_task(&self, now: &Now, folder: &FilePath) -> Result<()> {
        let whole = self.desk.artefacts.whole(&now.document)?;
        whole.plannable()?;
        Ok(files::write(
            &now.document,
            &Files::within(folder, &now.document),
        )?)
    }

    /// Has the plans of jobs among the artefacts.
    pub(super) fn register_plans(&self) {
        for job in self.jobs.all() {
            let id = job["id"].as_u64().unwrap_or_default() as u32;
            let (Ok(job), true) = (self.jobs.whole(id), job["has"]["plan"] == true) else {
                continue;
            };
            let digest = |value: &Value| serde_json::from_value::<Digest>(value.clone()).ok();
            let plan = digest(&job["record"]["plan_digest"]);
            if let (Some(plan), Some(problem)) = (plan, digest(&job["document"]["digest"])) {
                self.desk.register(id, plan, problem);
            }
        }
    }
}

/// Makes a folder into which nobody else looks.
pub(super) fn make_folder(folder: &FilePath) -> Result<()> {
    let made = fs::DirBuilder::new().mode(0o700).create(folder);
    made.map_err(|error| Refused::machine("there is no folder for the job", error))
}

fn put(path: &FilePath, bytes: &[u8]) -> Result<()> {
    let put = fs::write(path, bytes);
    put.map_err(|error| Refused::machine("a file of the job cannot be written", error))
}

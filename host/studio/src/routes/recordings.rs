//! Routes of recordings.

use std::path::PathBuf;
use std::sync::Arc;

use axum::Router;
use axum::extract::{Path, State};
use axum::http::HeaderMap;
use axum::http::header::CONTENT_TYPE;
use axum::response::{IntoResponse, Json, Response};
use axum::routing::get;
use serde::Deserialize;
use serde_json::{Value, json};

use super::sent::send_file;
use super::{Query, Shared, apart};
use crate::answer::{Refused, Result};
use crate::jobs::ask::{ANNOTATIONS, TRACE};
use crate::recordings::{Span, Window, clip as make_clip};
use crate::server::Studio;
use crate::waits::waits as find_waits;

pub(super) fn routes() -> Router<Arc<Studio>> {
    Router::new()
        .route("/api/recordings", get(all))
        .route("/api/recordings/{id}/meta", get(meta))
        .route("/api/recordings/{id}/clip", get(clip))
        .route("/api/recordings/{id}/waits", get(waits))
        .route("/api/recordings/{id}/trace", get(trace))
        .route("/api/recordings/{id}/annotations", get(annotations))
}

async fn all(State(studio): Shared) -> Json<Value> {
    let opened = studio.recordings.all().into_iter();
    let opened = opened.map(|(id, one)| json!({"id": id, "name": one.name}));
    Json(opened.collect())
}

#[derive(Deserialize)]
struct Quick {
    #[serde(default)]
    quick: bool,
}

async fn meta(
    State(studio): Shared,
    Path(id): Path<u32>,
    Query(Quick { quick }): Query<Quick>,
) -> Result<Response> {
    let json = [(CONTENT_TYPE, "application/json")];
    let trace = studio.trace(id);
    // A live fleet has no trace before it ends.
    if let (Err(_), Some(scene)) = (&trace, studio.jobs.scene(id)) {
        return Ok((json, scene.to_vec()).into_response());
    }
    let (path, annotations) = (trace?, studio.jobs.file(id, ANNOTATIONS).ok());
    apart(move || {
        let meta = studio
            .recordings
            .meta(id, &path, annotations.as_deref(), quick)?;
        Ok((json, meta.to_vec()).into_response())
    })
    .await
}

async fn clip(
    State(studio): Shared,
    Path(id): Path<u32>,
    Query(window): Query<Window>,
) -> Result<Response> {
    let path = studio.trace(id)?;
    apart(move || {
        let bytes = make_clip(&path, window)?;
        Ok(([(CONTENT_TYPE, "application/octet-stream")], bytes).into_response())
    })
    .await
}

async fn waits(
    State(studio): Shared,
    Path(id): Path<u32>,
    Query(span): Query<Span>,
) -> Result<Json<Value>> {
    let path = studio.trace(id)?;
    apart(move || Ok(Json(find_waits(&path, span)?))).await
}

async fn trace(State(studio): Shared, Path(id): Path<u32>, asked: HeaderMap) -> Result<Response> {
    send_file(&studio.trace(id)?, "application/octet-stream", &asked).await
}

async fn annotations(
    State(studio): Shared,
    Path(id): Path<u32>,
    asked: HeaderMap,
) -> Result<Response> {
    send_file(
        &studio.jobs.file(id, ANNOTATIONS)?,
        "application/json",
        &asked,
    )
    .await
}

impl Studio {
    /// The trace of a recording: of a file that was opened, or of a job.
    fn trace(&self, id: u32) -> Result<PathBuf> {
        let opened = self.recordings.path(id);
        let of_job = || self.jobs.file(id, TRACE);
        opened
            .map_or_else(of_job, Ok)
            .map_err(|_| Refused::unknown("recording"))
    }
}

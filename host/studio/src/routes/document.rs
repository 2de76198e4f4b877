//! Routes of the document, and of what is derived from it.

use std::sync::Arc;

use axum::Router;
use axum::body::Body;
use axum::extract::State;
use axum::http::header::{CONTENT_DISPOSITION, CONTENT_TYPE};
use axum::response::{IntoResponse, Json, Response};
use axum::routing::{get, post};
use fleetyard_core::read_file;
use serde::Deserialize;
use serde_json::{Value, json};

use super::{Query, SMALL, Shared, apart, body, header, into_file};
use crate::answer::{Refused, Result};
use crate::desk::{Changing, Now, Saving, Step};
use crate::document::runs;
use crate::feed::Event;
use crate::files::{Kind, Source, exports};
use crate::recordings::is_trace;
use crate::server::Studio;
use crate::web::media_type;

/// Most bytes of an edit, which may have a whole document in it.
const EDIT_BYTES: usize = 64 << 20;
/// Most bytes of a file that is opened, and of one that is no trace.
const TRACE_BYTES: u64 = 4 << 30;
const FILE_BYTES: u64 = 256 << 20;
/// The distance of points of a clearance field in metres, where none is asked for.
const CLEARANCE_M: f64 = 0.25;

pub(super) fn routes() -> Router<Arc<Studio>> {
    Router::new()
        .route("/api/document", get(document))
        .route("/api/edit", post(edit))
        .route("/api/undo", post(undo))
        .route("/api/redo", post(redo))
        .route("/api/open", post(open))
        .route("/api/save", post(save))
        .route("/api/export", get(export))
        .route("/api/exports", get(forms))
        .route("/api/artefacts", get(artefacts))
        .route("/api/grid", get(grid))
        .route("/api/roadmap", get(roadmap))
        .route("/api/clearance", get(clearance))
}

async fn document(State(studio): Shared) -> Result<Json<Value>> {
    apart(move || {
        let now = studio.desk.now();
        studio.desk.tell(&now).map(Json)
    })
    .await
}

async fn edit(studio: Shared, asked: Body) -> Result<Json<Value>> {
    change(studio, asked, Step::Edit).await
}

async fn undo(studio: Shared, asked: Body) -> Result<Json<Value>> {
    change(studio, asked, Step::Undo).await
}

async fn redo(studio: Shared, asked: Body) -> Result<Json<Value>> {
    change(studio, asked, Step::Redo).await
}

async fn change(State(studio): Shared, asked: Body, step: Step) -> Result<Json<Value>> {
    let most = if step == Step::Edit {
        EDIT_BYTES
    } else {
        SMALL
    };
    let asked = body(asked, most).await?;
    apart(move || {
        let changing = Changing::read(&asked, step == Step::Edit)?;
        let now = studio.desk.change(&changing, step)?;
        studio.changed(&now).map(Json)
    })
    .await
}

#[derive(Deserialize)]
struct Named {
    name: String,
}

/// Opens a file that a page sends: a recording, or what makes a document.
async fn open(
    State(studio): Shared,
    Query(Named { name }): Query<Named>,
    sent: Body,
) -> Result<Json<Value>> {
    let plain = !name.is_empty() && !name.contains(['/', '\\', '\0']) && name.len() <= 255;
    if !plain || name.starts_with('.') {
        return Err(Refused::value("this is no name of a file").at("name"));
    }
    let id = studio.jobs.number();
    let folder = studio.jobs.folder(id);
    let path = folder.join("opened");
    let received = into_file(sent, &folder, &path, TRACE_BYTES).await;
    apart(move || {
        let begin = received?;
        if is_trace(&begin) {
            studio.recordings.open(id, &name, &path)?;
            studio.feed.happened(Event::Recordings);
            return Ok(Json(json!({"recording": {"id": id, "name": name}})));
        }
        let bytes = read_file(&path, FILE_BYTES);
        let _ = std::fs::remove_dir_all(&folder);
        let bytes = bytes?;
        if Kind::of(&name, &bytes).is_some_and(Kind::is_plan) {
            return studio.open_plan(id, &name, &bytes).map(Json);
        }
        let source = Source {
            name,
            bytes,
            folder: None,
        };
        let (now, notes) = studio.desk.open(&[source])?;
        let document = studio.changed(&now)?;
        Ok(Json(json!({"document": document, "notes": notes})))
    })
    .await
}

async fn save(State(studio): Shared, asked: Body) -> Result<Json<Value>> {
    let asked = body(asked, SMALL).await?;
    apart(move || {
        let saving = if asked.is_empty() {
            Saving::default()
        } else {
            serde_json::from_slice(&asked).map_err(|error| Refused::value(error.to_string()))?
        };
        let (now, files) = studio.desk.save(saving)?;
        studio.feed.changed(now.version);
        let files = files.iter().map(|file| file.display().to_string());
        Ok(Json(json!({"files": files.collect::<Vec<_>>()})))
    })
    .await
}

#[derive(Deserialize)]
struct Form {
    #[serde(rename = "as")]
    form: String,
    /// All files that belong together, as text.
    #[serde(default)]
    all: bool,
}

async fn export(State(studio): Shared, Query(asked): Query<Form>) -> Result<Response> {
    apart(move || {
        let exported = studio.desk.export(&asked.form)?;
        if asked.all {
            let first = [(exported.name, exported.bytes)];
            let files = first.into_iter().chain(exported.others);
            let files = files.map(
                |(name, bytes)| json!({"name": name, "text": String::from_utf8_lossy(&bytes)}),
            );
            return Ok(Json(json!({"files": files.collect::<Vec<_>>()})).into_response());
        }
        // Its name has letters, digits and marks that need no quotes.
        let disposition = header(&format!("attachment; filename=\"{}\"", exported.name));
        let headers = [
            (CONTENT_TYPE, header(media_type(&exported.name))),
            (CONTENT_DISPOSITION, disposition),
        ];
        Ok((headers, exported.bytes).into_response())
    })
    .await
}

async fn forms() -> Json<Value> {
    let forms = exports().map(|(form, about)| json!({"as": form, "about": about}));
    Json(forms.collect())
}

async fn artefacts(State(studio): Shared) -> Result<Json<Value>> {
    apart(move || {
        studio.register_plans();
        let now = studio.desk.now();
        Ok(Json(json!(studio.desk.artefacts.list(&now.document))))
    })
    .await
}

async fn grid(State(studio): Shared) -> Result<Json<Value>> {
    apart(move || {
        let now = studio.desk.now();
        let cells = studio.desk.artefacts.grid(&now.document)?;
        let grid = &cells.grid;
        Ok(Json(json!({
            "version": now.version,
            "digest": grid.digest(),
            "rows": grid.rows(),
            "cols": grid.cols(),
            "cell_m": cells.cell_m,
            "corner_m": cells.corner_m,
            "blocked": runs(grid, |letter| !fleetyard_core::Grid::letter_is_passable(letter)),
        })))
    })
    .await
}

async fn roadmap(State(studio): Shared) -> Result<Json<Value>> {
    apart(move || {
        let now = studio.desk.now();
        let view = studio.desk.artefacts.roadmap(&now.document)?;
        let roadmap = &view.roadmap;
        let vertices = 0..roadmap.vertices() as u32;
        let vertices = vertices.flat_map(|vertex| {
            let (x, y) = roadmap.position_m(vertex);
            [x, y]
        });
        // An edge that is there in both directions is told once.
        let edges = roadmap.edges();
        let edges = edges.filter(|(from, to)| from < to || !roadmap.has_edge(*to, *from));
        Ok(Json(json!({
            "version": now.version,
            "digest": view.digest(),
            "vertices": vertices.collect::<Vec<_>>(),
            "edges": edges.flat_map(|(from, to)| [from, to]).collect::<Vec<_>>(),
        })))
    })
    .await
}

#[derive(Deserialize)]
struct Side {
    side: Option<f64>,
}

async fn clearance(
    State(studio): Shared,
    Query(Side { side }): Query<Side>,
) -> Result<Json<Value>> {
    apart(move || {
        let now = studio.desk.now();
        let field = studio
            .desk
            .artefacts
            .clearance(&now.document, side.unwrap_or(CLEARANCE_M))?;
        Ok(Json(json!(*field)))
    })
    .await
}

impl Studio {
    /// Tells all pages of a change, and the answer for the one that made it.
    pub(super) fn changed(&self, now: &Now) -> Result<Value> {
        self.feed.changed(now.version);
        self.desk.tell(now)
    }
}

//! Routes of the suite that the studio was started with.

use std::sync::Arc;

use axum::Router;
use axum::extract::{Path, State};
use axum::http::header::{CONTENT_SECURITY_POLICY, CONTENT_TYPE};
use axum::response::{IntoResponse, Json, Response};
use axum::routing::{get, post};
use fleetyard_bench::report::Report;
use serde_json::{Value, json};

use super::{Query, Shared, apart, header};
use crate::answer::{Refused, Result};
use crate::files;
use crate::jobs::ask::{Asked, Given};
use crate::server::Studio;
use crate::suite::{Part, Suite};

pub(super) fn routes() -> Router<Arc<Studio>> {
    Router::new()
        .route("/report", get(report))
        .route("/api/suite", get(suite))
        .route("/api/suite/trials", get(trials))
        .route("/api/suite/trials/{id}", get(trial))
        .route("/api/suite/trials/{id}/open", post(open))
}

async fn suite(State(studio): Shared) -> Result<Json<Value>> {
    apart(move || {
        let Ok(suite) = studio.suite() else {
            return Ok(Json(Value::Null));
        };
        let mut told = suite.tell()?;
        told["opened"] = json!(studio.begun_with);
        Ok(Json(told))
    })
    .await
}

async fn trials(State(studio): Shared, Query(part): Query<Part>) -> Result<Json<Value>> {
    apart(move || studio.suite()?.list(&part).map(Json)).await
}

async fn trial(State(studio): Shared, Path(id): Path<String>) -> Result<Json<Value>> {
    apart(move || studio.suite()?.trial(&id).map(Json)).await
}

async fn open(State(studio): Shared, Path(id): Path<String>) -> Result<Json<Value>> {
    apart(move || studio.open_trial(&id).map(Json)).await
}

/// The report's page, with the policy that it has as a file, too.
async fn report(State(studio): Shared) -> Result<Response> {
    apart(move || {
        let page = studio.suite()?.report()?;
        let policy = format!("{}; frame-ancestors 'none'", Report::policy());
        let headers = [
            (CONTENT_TYPE, header("text/html; charset=utf-8")),
            (CONTENT_SECURITY_POLICY, header(&policy)),
        ];
        Ok((headers, page).into_response())
    })
    .await
}

impl Studio {
    fn suite(&self) -> Result<&Suite> {
        self.suite.as_ref().ok_or_else(|| {
            Refused::unknown("suite").hint("start the studio with one: `fleetyard studio STORE`")
        })
    }

    /// Opens a trial: its question becomes the document, and its plan is executed.
    pub(crate) fn open_trial(&self, trial: &str) -> Result<Value> {
        let opened = self.suite()?.open_trial(trial)?;
        let now = self.desk.put(opened.document)?;
        let mut job = Value::Null;
        if let Some(plan) = &opened.plan {
            let map = match opened.views {
                Some(_) => String::new(),
                None => files::ground_file(&now.document),
            };
            let given = Given {
                planners: &[],
                task: &files::task_file(&now.document),
                map: &map,
                cell_m: 0.0,
                is_grid: false,
                views: &opened.views.unwrap_or_default(),
                trust: &self.trust,
                view_of: &|_| Err(Refused::unknown("plan")),
            };
            let order = Asked::kept(&given, opened.view, &opened.terms);
            job = self.execute(&now, self.jobs.number(), order, &opened.name, plan)?;
        }
        Ok(json!({
            "trial": opened.trial,
            "document": self.changed(&now)?,
            "notes": opened.notes,
            "job": job,
        }))
    }
}

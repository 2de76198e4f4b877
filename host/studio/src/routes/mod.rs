//! Routes: requests, and who answers them.

mod document;
mod jobs;
mod recordings;
mod sent;
mod suite;

use std::path::Path as FilePath;
use std::pin::Pin;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::body::{Body, Bytes, HttpBody, to_bytes};
use axum::extract::ws::{Message as Frame, WebSocket, WebSocketUpgrade};
use axum::extract::{ConnectInfo, FromRequestParts, Path, Request, State};
use axum::http::header::{ALLOW, CONTENT_TYPE};
use axum::http::request::Parts;
use axum::http::{HeaderValue, StatusCode};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Json, Response};
use axum::routing::{get, post};
use fleetyard_sim::motion::{PRESETS, Profile};
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use tokio::io::AsyncWriteExt;
use tokio::task::spawn_blocking;
use tokio::time::timeout;

use crate::PROTOCOL;
use crate::access::{Entry, HEADERS};
use crate::answer::{Refused, Result};
use crate::feed::{Event, Message, Page};
use crate::routes::jobs::make_folder;
use crate::server::Studio;
use crate::visitors::Visit;
use crate::web;

/// Most bytes of a request that is no document and no file.
pub(crate) const SMALL: usize = 1 << 16;
/// Bytes by which a file is known.
const BEGIN: usize = 64;
/// Longest message of a page.
const MESSAGE_BYTES: usize = 1 << 16;
/// The time that a request has for its work.
const DEADLINE: Duration = Duration::from_mins(1);
/// The time that a page has to take a message. One that does not is disconnected.
const PATIENCE: Duration = Duration::from_secs(30);

/// The studio, as requests have it.
pub(crate) type Shared = State<Arc<Studio>>;

/// All routes, behind the door.
pub(crate) fn router(studio: Arc<Studio>) -> Router {
    Router::new()
        .route("/", get(async || web::file("")))
        .route(
            "/{name}",
            get(async |Path(name): Path<String>| web::file(&name)),
        )
        .route("/api/studio", get(about))
        .route("/api/presets", get(presets))
        .route("/api/planners", get(planners).post(look_for_planners))
        .route("/api/ticket", post(ticket))
        .route("/api/feed", get(feed))
        .route(
            "/viewer/{name}",
            get(async |Path(name): Path<String>| web::viewer(&name)),
        )
        .merge(document::routes())
        .merge(jobs::routes())
        .merge(recordings::routes())
        .merge(suite::routes())
        .fallback(async || Refused::unknown("route"))
        .layer(from_fn_with_state(Arc::clone(&studio), door))
        .with_state(studio)
}

/// Lets in whom [`Access`](crate::access::Access) lets in, and adds the headers of every answer.
async fn door(
    State(studio): Shared,
    ConnectInfo(Visit(visitor)): ConnectInfo<Visit>,
    request: Request,
    next: Next,
) -> Response {
    let entry = if visitor.is_known() {
        let path = request.uri().path();
        studio.access.check(&request, web::is_file(path))
    } else {
        let reason = "the request comes from another user of this machine";
        Err(Refused::new(StatusCode::FORBIDDEN, reason))
    };
    if matches!(entry, Ok(Entry::Allowed | Entry::Welcome(_))) {
        visitor.let_in();
    }
    let mut response = match entry {
        Ok(Entry::Page | Entry::Allowed) => next.run(request).await,
        Ok(Entry::Welcome(key)) => {
            studio.welcome();
            Json(json!({"key": key})).into_response()
        }
        Err(refused) => refused.into_response(),
    };
    let is_json = |response: &Response| {
        let media_type = response.headers().get(CONTENT_TYPE);
        media_type.is_some_and(|name| name.as_bytes() == JSON)
    };
    if (response.status().is_client_error() || response.status().is_server_error())
        && !is_json(&response)
    {
        response = in_words(response).await;
    }
    let headers = response.headers_mut();
    for (name, value) in HEADERS {
        // A report's page has a stricter policy of its own.
        headers.entry(name).or_insert(value);
    }
    response
}

/// The media type of a refusal.
const JSON: &[u8] = b"application/json";

/// A refusal of the server's own, for its method, path or form, as all others are.
async fn in_words(refusal: Response) -> Response {
    let (parts, said) = refusal.into_parts();
    let said = to_bytes(said, SMALL).await.unwrap_or_default();
    let reason = match parts.status {
        StatusCode::METHOD_NOT_ALLOWED => "this is asked for by another method".into(),
        status if said.is_empty() => status.to_string().into(),
        _ => String::from_utf8_lossy(&said),
    };
    let mut told = Refused::new(parts.status, reason).into_response();
    if let Some(allowed) = parts.headers.get(ALLOW) {
        told.headers_mut().insert(ALLOW, allowed.clone());
    }
    told
}

/// The query of a request. One that makes no sense is refused in words, as all else is.
pub(super) struct Query<T>(pub(super) T);

impl<T: DeserializeOwned, S: Sync> FromRequestParts<S> for Query<T> {
    type Rejection = Refused;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self> {
        let read = axum::extract::Query::try_from_uri(&parts.uri);
        read.map(|axum::extract::Query(asked)| Self(asked))
            .map_err(|error| {
                let text = error.body_text();
                let reason = text.rsplit_once("query string: ");
                let reason = reason.map_or(text.as_str(), |(_, reason)| reason);
                Refused::value(format!("the query: {reason}"))
            })
    }
}

/// The body of a request, of so many bytes at most.
pub(crate) async fn body(body: Body, most: usize) -> Result<Bytes> {
    to_bytes(body, most).await.map_err(|_| {
        let reason = format!("the request has more than {most} bytes, or was broken off");
        Refused::new(StatusCode::PAYLOAD_TOO_LARGE, reason)
    })
}

/// Writes the body of a request to a file in a folder that is made for it, and gives its first bytes.
async fn into_file(
    mut sent: Body,
    folder: &FilePath,
    path: &FilePath,
    most: u64,
) -> Result<Vec<u8>> {
    let cannot = |error: std::io::Error| Refused::machine("the file cannot be kept", error);
    make_folder(folder)?;
    let received = async {
        let mut file = tokio::fs::File::create(path).await.map_err(cannot)?;
        let (mut begin, mut length) = (Vec::new(), 0);
        while let Some(frame) = std::future::poll_fn(|cx| Pin::new(&mut sent).poll_frame(cx)).await
        {
            let frame = frame
                .map_err(|error| Refused::value(format!("the file was broken off: {error}")))?;
            let Ok(data) = frame.into_data() else {
                continue;
            };
            length += data.len() as u64;
            if length > most {
                let reason = format!("the file has more than {most} bytes");
                return Err(Refused::new(StatusCode::PAYLOAD_TOO_LARGE, reason)
                    .hint("name it on the command line: `fleetyard studio FILE`"));
            }
            let missing = BEGIN.saturating_sub(begin.len()).min(data.len());
            begin.extend_from_slice(&data[..missing]);
            file.write_all(&data).await.map_err(cannot)?;
        }
        file.flush().await.map_err(cannot)?;
        Ok(begin)
    };
    let received = received.await;
    if received.is_err() {
        let _ = tokio::fs::remove_dir_all(folder).await;
    }
    received
}

/// Does work that takes a while where it keeps no other request waiting. Whoever asks has an answer in time:
/// what cannot be broken off ends by itself, and holds nothing that others need.
pub(crate) async fn apart<T: Send + 'static>(
    work: impl FnOnce() -> Result<T> + Send + 'static,
) -> Result<T> {
    let Ok(done) = timeout(DEADLINE, spawn_blocking(work)).await else {
        let seconds = DEADLINE.as_secs();
        let reason = format!("this takes longer than the {seconds} s that a request has");
        return Err(Refused::new(StatusCode::SERVICE_UNAVAILABLE, reason)
            .hint("the file may be too large for a page: use the command line"));
    };
    done.unwrap_or_else(|error| Err(Refused::machine("the studio failed at this", error)))
}

async fn about(State(studio): Shared) -> Json<Value> {
    Json(json!({
        "protocol": PROTOCOL,
        "fleetyard": env!("CARGO_PKG_VERSION"),
        "folder": studio.desk.folder.display().to_string(),
    }))
}

/// A ticket for a socket or a window of the page.
async fn ticket(State(studio): Shared) -> Result<Json<Value>> {
    let ticket = studio.access.ticket();
    let ticket = ticket.map_err(|error| Refused::machine("there are no random bits", error))?;
    Ok(Json(json!({"ticket": ticket})))
}

/// Presets of robots, with a body where they have one.
async fn presets() -> Json<Value> {
    let presets = PRESETS.iter().map(|preset| {
        let mut told = match Profile::preset(preset.name) {
            Ok(profile) => json!(profile),
            Err(_) => json!({"footprint": null, "model": preset.name}),
        };
        told["name"] = preset.name.into();
        told["about"] = preset.about.into();
        told
    });
    Json(presets.collect())
}

// ---- planners --------------------------------------------------------------------------

async fn planners(State(studio): Shared) -> Json<Value> {
    Json(json!(
        studio
            .planners
            .last()
            .as_deref()
            .map_or(&[][..], Vec::as_slice)
    ))
}

async fn look_for_planners(State(studio): Shared) -> Result<Json<Value>> {
    apart(move || {
        let found = studio.planners.look();
        studio.feed.happened(Event::Planners);
        Ok(Json(json!(*found)))
    })
    .await
}

// ---- feed ------------------------------------------------------------------------------

async fn feed(State(studio): Shared, socket: WebSocketUpgrade) -> Result<Response> {
    let (number, page) = studio.feed.join()?;
    let leaving = Leaving(Arc::clone(&studio), number);
    let socket = socket.max_message_size(MESSAGE_BYTES);
    Ok(socket.on_upgrade(async move |socket| {
        let _leaving = leaving;
        talk(&studio, &page, socket).await;
    }))
}

/// A page leaves, however its connection ends, and also where it never came to be.
struct Leaving(Arc<Studio>, u64);

impl Drop for Leaving {
    fn drop(&mut self) {
        self.0.feed.leave(self.1);
    }
}

/// Tells a page what is new, and hears what it says, until one of both ends.
async fn talk(studio: &Arc<Studio>, page: &Page, mut socket: WebSocket) {
    let hello = json!({"type": "hello", "protocol": PROTOCOL});
    if !send(&mut socket, text(&hello)).await {
        return;
    }
    loop {
        tokio::select! {
            news = page.news() => {
                let goodbye = news.goodbye;
                for frame in studio.frames(news) {
                    if !send(&mut socket, frame).await {
                        return;
                    }
                }
                if goodbye {
                    return;
                }
            }
            said = socket.recv() => {
                let refused = match said {
                    Some(Ok(Frame::Text(said))) => studio.hear(page, &said).await.err(),
                    Some(Ok(Frame::Binary(_))) => Some("messages are text".to_owned()),
                    Some(Ok(Frame::Ping(_) | Frame::Pong(_))) => None,
                    Some(Ok(Frame::Close(_)) | Err(_)) | None => return,
                };
                if let Some(error) = refused {
                    let refused = json!({"type": "refused", "error": error});
                    if !send(&mut socket, text(&refused)).await {
                        return;
                    }
                }
            }
        }
    }
}

fn text(value: &Value) -> Frame {
    Frame::Text(value.to_string().into())
}

/// False where nobody takes it.
async fn send(socket: &mut WebSocket, frame: Frame) -> bool {
    matches!(timeout(PATIENCE, socket.send(frame)).await, Ok(Ok(())))
}

impl Studio {
    /// News as a page is sent it.
    fn frames(&self, news: crate::feed::News) -> Vec<Frame> {
        let mut frames = Vec::new();
        if let Some(version) = news.version {
            frames.push(text(&json!({"type": "changed", "version": version})));
        }
        let events = news.events.iter();
        frames.extend(events.map(|event| text(&json!({"type": event.name()}))));
        for id in news.jobs {
            frames.push(text(&match self.jobs.summary(id) {
                Some(job) => json!({"type": "job", "job": job}),
                None => json!({"type": "job-gone", "id": id}),
            }));
        }
        if let Some((job, clip)) = news.clip {
            let mut bytes = job.to_le_bytes().to_vec();
            bytes.extend_from_slice(&clip);
            frames.push(Frame::Binary(bytes.into()));
        }
        if news.goodbye {
            frames.push(text(&json!({"type": "goodbye"})));
        }
        frames
    }

    /// Does what a page says, or says why not.
    async fn hear(self: &Arc<Self>, page: &Page, said: &str) -> std::result::Result<(), String> {
        let done = match Message::read(said)? {
            Message::Watch { job, rate } => page.watch(job, rate),
            Message::Unwatch { job } => {
                page.unwatch(job);
                Ok(())
            }
            Message::Control { job, what } => {
                let studio = Arc::clone(self);
                apart(move || studio.jobs.control(job, &what)).await
            }
        };
        done.map_err(|refused| refused.error().to_owned())
    }
}

/// A header value of text that may be anything.
pub(crate) fn header(text: &str) -> HeaderValue {
    HeaderValue::from_str(text).unwrap_or(HeaderValue::from_static(""))
}

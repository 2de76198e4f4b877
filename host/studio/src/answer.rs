//! Answers that say why something was not done.

use axum::Json;
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use fleetyard_core::InputError;
use serde_json::{Map, Value, json};

/// A request that is refused: by its status, and in words.
#[derive(Debug, Clone, PartialEq)]
pub struct Refused {
    status: StatusCode,
    error: String,
    place: Option<String>,
    hint: Option<String>,
    /// More that is said to programs.
    more: Map<String, Value>,
}

/// The answer to a request, or why there is none.
pub(crate) type Result<T> = std::result::Result<T, Refused>;

impl Refused {
    pub(crate) fn new(status: StatusCode, error: impl Into<String>) -> Self {
        Self {
            status,
            error: error.into(),
            place: None,
            hint: None,
            more: Map::new(),
        }
    }

    /// A value that makes no sense.
    pub(crate) fn value(error: impl Into<String>) -> Self {
        Self::new(StatusCode::UNPROCESSABLE_ENTITY, error)
    }

    /// The machine does not let the studio do it.
    pub(crate) fn machine(what: &str, error: impl std::fmt::Display) -> Self {
        Self::new(
            StatusCode::INTERNAL_SERVER_ERROR,
            format!("{what}: {error}"),
        )
    }

    /// Nothing has this number or name.
    pub(crate) fn unknown(what: &str) -> Self {
        Self::new(StatusCode::NOT_FOUND, format!("there is no such {what}"))
    }

    /// Adds where in the request it is.
    pub(crate) fn at(mut self, place: impl Into<String>) -> Self {
        self.place = Some(place.into());
        self
    }

    /// Adds a way out.
    pub(crate) fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }

    /// Adds a value for programs.
    pub(crate) fn with(mut self, key: &str, value: impl Into<Value>) -> Self {
        self.more.insert(key.to_owned(), value.into());
        self
    }

    /// The same about a file that the command was given.
    pub(crate) fn about(self, source: &str) -> InputError {
        InputError::new(source, self.error).maybe_hint(self.hint)
    }

    /// Its status.
    pub fn status(&self) -> StatusCode {
        self.status
    }

    /// The reason, in one sentence.
    pub fn error(&self) -> &str {
        &self.error
    }
}

impl From<InputError> for Refused {
    fn from(error: InputError) -> Self {
        let place = match (error.line, error.column) {
            (Some(line), Some(column)) => format!("{}:{line}:{column}", error.source),
            (Some(line), None) => format!("{}:{line}", error.source),
            _ => error.source,
        };
        Self {
            hint: error.hint,
            ..Self::value(error.reason).at(place)
        }
    }
}

impl IntoResponse for Refused {
    fn into_response(self) -> Response {
        let mut body = json!({"error": self.error});
        if let Some(place) = self.place {
            body["place"] = place.into();
        }
        if let Some(hint) = self.hint {
            body["hint"] = hint.into();
        }
        for (key, value) in self.more {
            body[key] = value;
        }
        (self.status, Json(body)).into_response()
    }
}

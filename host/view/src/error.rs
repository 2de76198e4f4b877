//! Errors of drawing.

/// The reason why something was not drawn.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{reason}")]
pub struct ViewError {
    /// The reason.
    pub reason: String,
    /// A way out.
    pub hint: &'static str,
}

impl ViewError {
    pub(crate) fn new(reason: impl Into<String>, hint: &'static str) -> Self {
        let reason = reason.into();
        Self { reason, hint }
    }
}

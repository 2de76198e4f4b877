//! Why something was not drawn.

/// Why something was not drawn.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{reason}")]
pub struct ViewError {
    /// What is wrong.
    pub reason: String,
    /// What to do about it.
    pub hint: &'static str,
}

impl ViewError {
    pub(crate) fn new(reason: impl Into<String>, hint: &'static str) -> Self {
        let reason = reason.into();
        Self { reason, hint }
    }
}

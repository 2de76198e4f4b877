//! Why the parameters of a model are refused.

/// A parameter that no body can have. The field is named as in the file.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{field} = {value} {reason}")]
pub struct MotionError {
    /// The parameter, with the names of the objects around it: `heading.p`.
    pub field: &'static str,
    /// What was given.
    pub value: String,
    /// What is wrong with it.
    pub reason: &'static str,
    /// What the user can do.
    pub hint: &'static str,
}

/// Refuses a value outside `low..=high`; not-a-number is outside.
pub(super) fn within(
    field: &'static str,
    value: f64,
    low: f64,
    high: f64,
    hint: &'static str,
) -> Result<(), MotionError> {
    if value >= low && value <= high {
        return Ok(());
    }
    Err(MotionError {
        field,
        value: value.to_string(),
        reason: "is out of range",
        hint,
    })
}

/// Speeds and accelerations.
pub(super) fn limit(field: &'static str, value: f64) -> Result<(), MotionError> {
    within(
        field,
        value,
        1e-6,
        1e6,
        "give a number between 1e-6 and 1e6; a limit is positive",
    )
}

/// How near is near enough, in metres.
pub(super) fn tolerance_m(field: &'static str, value: f64) -> Result<(), MotionError> {
    within(field, value, 1e-6, 1e3, "give metres between 1e-6 and 1000")
}

/// How near is near enough, in radians.
pub(super) fn tolerance_rad(field: &'static str, value: f64) -> Result<(), MotionError> {
    within(
        field,
        value,
        1e-6,
        3.0,
        "give radians between 1e-6 and 3; half a degree is 0.0087",
    )
}

/// How long an action of an ideal model takes.
pub(super) fn duration_s(field: &'static str, value: f64) -> Result<(), MotionError> {
    within(field, value, 1e-6, 1e6, "give seconds between 1e-6 and 1e6")
}

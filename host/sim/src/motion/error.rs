//! Errors in the parameters of a model.

/// An invalid parameter. The field is named as in the file.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{field} = {value} {reason}")]
pub struct MotionError {
    /// The parameter, with the names of the objects around it: `heading.p`.
    pub field: &'static str,
    /// The given value.
    pub value: String,
    /// The fault.
    pub reason: &'static str,
    /// Remedy for the user.
    pub hint: &'static str,
}

/// Refuses a value outside `low..=high`; NaN is outside.
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

/// Checks a speed or an acceleration.
pub(super) fn limit(field: &'static str, value: f64) -> Result<(), MotionError> {
    within(
        field,
        value,
        1e-6,
        1e6,
        "give a number between 1e-6 and 1e6; a limit is positive",
    )
}

/// Checks a tolerance in metres.
pub(super) fn tolerance_m(field: &'static str, value: f64) -> Result<(), MotionError> {
    within(field, value, 1e-6, 1e3, "give metres between 1e-6 and 1000")
}

/// Checks a tolerance in radians.
pub(super) fn tolerance_rad(field: &'static str, value: f64) -> Result<(), MotionError> {
    within(
        field,
        value,
        1e-6,
        3.0,
        "give radians between 1e-6 and 3; half a degree is 0.0087",
    )
}

/// Checks the duration of an action of an ideal model.
pub(super) fn duration_s(field: &'static str, value: f64) -> Result<(), MotionError> {
    within(field, value, 1e-6, 1e6, "give seconds between 1e-6 and 1e6")
}

//! Values as text.

use serde::{Deserialize, Serialize};

use crate::{Incumbent, Value};

/// A number as the shortest text that reads as the same number.
pub(super) fn real(value: f64) -> String {
    let plain = value == 0.0 || !value.is_finite() || (1e-5..1e16).contains(&value.abs());
    if plain {
        value.to_string()
    } else {
        format!("{value:e}")
    }
}

/// A value as a field: nothing where it is absent, 1 or 0 for yes or no.
pub(super) fn field(value: &Value) -> String {
    match value {
        Value::Null => String::new(),
        Value::Text(text) => text.clone(),
        // Every column of whole numbers is unsigned; the sign is SQLite's.
        Value::Integer(number) => number.cast_unsigned().to_string(),
        Value::Real(number) => real(*number),
        Value::Boolean(yes) => u8::from(*yes).to_string(),
    }
}

/// Plans in order of arrival, as JSON has them.
#[derive(Serialize, Deserialize)]
pub(super) struct Plan {
    pub(super) time_ms: f64,
    pub(super) soc_steps: Option<u64>,
    pub(super) valid: Option<bool>,
}

impl From<&Incumbent> for Plan {
    fn from(plan: &Incumbent) -> Self {
        Self {
            time_ms: plan.time_ms,
            soc_steps: plan.soc_steps,
            valid: plan.valid,
        }
    }
}

impl From<Plan> for Incumbent {
    fn from(plan: Plan) -> Self {
        Self {
            time_ms: plan.time_ms,
            soc_steps: plan.soc_steps,
            valid: plan.valid,
        }
    }
}

/// Name of the column of incumbents, which is no column of the store's table.
pub(super) const INCUMBENTS: &str = "incumbents";

/// All of them as JSON.
pub(super) fn plans(incumbents: &[Incumbent]) -> serde_json::Result<String> {
    serde_json::to_string(&incumbents.iter().map(Plan::from).collect::<Vec<_>>())
}

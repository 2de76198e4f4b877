//! Options of plugins, as a checked table and as text.

use serde_json::Value;

use super::{Kept, size_of, string, whole};
use crate::c;
use crate::sdk::Failure;

/// Options in their C form, with everything they point to.
pub struct COptions {
    raw: *const c::Options,
    _kept: Kept,
}

impl COptions {
    /// The C form of a JSON object; of no options, when the text is none.
    pub fn new(json: &str) -> Self {
        let mut kept = Kept::default();
        let object: serde_json::Map<String, Value> = serde_json::from_str(json).unwrap_or_default();
        let list: Vec<c::PluginOption> = object
            .into_iter()
            .map(|(name, value)| {
                let (kind, number, text) = match value {
                    Value::Number(number) => (
                        c::OPTION_NUMBER,
                        number.as_f64().unwrap_or(0.0),
                        String::new(),
                    ),
                    Value::Bool(flag) => (c::OPTION_FLAG, f64::from(u8::from(flag)), String::new()),
                    Value::String(text) => (c::OPTION_TEXT, 0.0, text),
                    other => (c::OPTION_JSON, 0.0, other.to_string()),
                };
                c::PluginOption {
                    name: kept.text(name),
                    text: kept.text(text),
                    number,
                    kind,
                    reserved: 0,
                }
            })
            .collect();
        let raw = c::Options {
            struct_size: size_of::<c::Options>(),
            count: list.len() as u32,
            list: kept.list(list),
            json: kept.text(json.to_owned()),
        };
        Self {
            raw: kept.one(raw),
            _kept: kept,
        }
    }

    /// The structure; valid as long as `self`.
    pub fn raw(&self) -> *const c::Options {
        self.raw
    }
}

/// The text of options.
///
/// # Safety
/// As [`checked`](super::checked).
pub(crate) unsafe fn options_json(pointer: *const c::Options) -> Result<String, Failure> {
    // SAFETY: by the caller's promise, here and below.
    let options = unsafe { whole("options", pointer)? };
    // SAFETY: as promised.
    Ok(unsafe { string(options.json) })
}

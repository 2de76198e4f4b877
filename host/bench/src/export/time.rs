//! Times as exports and reports show them.

use std::time::{Duration, UNIX_EPOCH};

/// A time in milliseconds since 1970, such as `2026-02-26T12:00:00Z`. A store may have any
/// number; what is beyond the year 9999 is shown as its end.
pub fn rfc3339(unix_ms: u64) -> String {
    const LAST_MS: u64 = 253_402_300_799_000;
    let time = UNIX_EPOCH + Duration::from_millis(unix_ms.min(LAST_MS));
    humantime::format_rfc3339_seconds(time).to_string()
}

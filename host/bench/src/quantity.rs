//! Quantities with their units, as suites have them.

use std::str::FromStr;
use std::time::Duration;

use bytesize::ByteSize;
use fleetyard_core::document::{Fault, text};
use fleetyard_core::shown;
use fleetyard_sim::SimError;
use serde::Deserializer;

/// Reads a duration with its unit, such as `10s`.
pub(crate) fn duration<'de, D, T>(deserializer: D) -> Result<T, D::Error>
where
    D: Deserializer<'de>,
    T: From<Duration>,
{
    let hint = "write it with its unit, such as \"500ms\", \"10s\" or \"2m\"";
    text(deserializer, hint, |text| {
        let duration = time(text, hint)?;
        if duration.is_zero() {
            return Err(Fault::new("it is zero, so nobody could do anything"));
        }
        // Deadlines are 64-bit nanoseconds; a year is plenty.
        if duration > Duration::from_hours(366 * 24) {
            return Err(Fault::new("it is longer than a year"));
        }
        Ok(duration.into())
    })
}

/// Reads simulated seconds, which may be none.
pub(crate) fn seconds<'de, D, T>(deserializer: D) -> Result<T, D::Error>
where
    D: Deserializer<'de>,
    T: From<f64>,
{
    let hint = "write it with its unit, such as \"500ms\", \"10s\" or \"10m\"";
    text(deserializer, hint, |text| {
        Ok(time(text, hint)?.as_secs_f64().into())
    })
}

fn time(text: &str, hint: &str) -> Result<Duration, Fault> {
    let is_none = |_| Fault::new(format!("it is \"{}\", which is no duration", shown(text)));
    humantime::parse_duration(text).map_err(|error| is_none(error).hint(hint))
}

/// Reads bytes with their unit, such as `4GiB`.
pub(crate) fn size<'de, D, T>(deserializer: D) -> Result<T, D::Error>
where
    D: Deserializer<'de>,
    T: From<u64>,
{
    let hint = "write it with its unit, such as \"512MiB\" or \"4GiB\"";
    text(deserializer, hint, |text| {
        let is_none = |_| Fault::new(format!("it is \"{}\", which is no size", shown(text)));
        let size: ByteSize = text.parse().map_err(|error| is_none(error).hint(hint))?;
        if size.as_u64() < 1 << 12 {
            return Err(Fault::new("it is less than 4KiB"));
        }
        Ok(size.as_u64().into())
    })
}

/// Reads what is written as on the command line.
pub(crate) fn as_argument<'de, D, N, T>(deserializer: D) -> Result<T, D::Error>
where
    D: Deserializer<'de>,
    N: FromStr<Err = SimError>,
    T: From<N>,
{
    text(deserializer, "", |text| {
        let parsed: Result<N, SimError> = text.parse();
        parsed.map(T::from).map_err(|error| {
            let fault = Fault::new(error.to_string());
            match error.hint() {
                Some(hint) => fault.hint(hint),
                None => fault,
            }
        })
    })
}

//! Files as answers: part by part, whole or one range of them.

use std::io::SeekFrom;
use std::path::Path;

use axum::body::{Body, Bytes};
use axum::http::header::{ACCEPT_RANGES, CONTENT_LENGTH, CONTENT_RANGE, CONTENT_TYPE, RANGE};
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Response};
use fleetyard_core::open_regular;
use futures_util::stream::unfold;
use tokio::fs::File;
use tokio::io::{AsyncReadExt, AsyncSeekExt};

use super::apart;
use crate::answer::{Refused, Result};

/// Bytes that are in memory at once, for each answer.
const PART: usize = 1 << 18;

/// First byte and number of bytes.
type Span = (u64, u64);

/// A file as an answer, or the range of it that the request asks for.
pub(super) async fn send_file(
    path: &Path,
    media_type: &'static str,
    asked: &HeaderMap,
) -> Result<Response> {
    let path = path.to_owned();
    let cannot = |error: std::io::Error| Refused::machine("the file cannot be read", error);
    let (file, whole) = apart(move || {
        let file = open_regular(&path)?;
        let length = file.metadata().map_err(cannot)?.len();
        Ok((file, length))
    })
    .await?;
    let range = asked.get(RANGE).and_then(|range| range.to_str().ok());
    let (status, (from, length)) = match range.and_then(|range| span(range, whole)) {
        Some((_, 0)) => {
            let reason = format!("the file has {whole} bytes, none of them in this range");
            let refused = Refused::new(StatusCode::RANGE_NOT_SATISFIABLE, reason);
            return Ok(([(CONTENT_RANGE, format!("bytes */{whole}"))], refused).into_response());
        }
        Some(span) => (StatusCode::PARTIAL_CONTENT, span),
        None => (StatusCode::OK, (0, whole)),
    };
    let mut file = File::from_std(file);
    file.seek(SeekFrom::Start(from)).await.map_err(cannot)?;
    // A file that became shorter breaks the answer off, which its length tells.
    let parts = unfold(file.take(length), async |mut file| {
        let mut part = Vec::with_capacity(PART);
        match (&mut file).take(PART as u64).read_to_end(&mut part).await {
            Ok(0) => None,
            Ok(_) => Some((Ok(Bytes::from(part)), file)),
            Err(error) => Some((Err(error), file)),
        }
    });
    let headers = [
        (CONTENT_TYPE, media_type.to_owned()),
        (CONTENT_LENGTH, length.to_string()),
        (ACCEPT_RANGES, "bytes".to_owned()),
    ];
    let mut response = (status, headers, Body::from_stream(parts)).into_response();
    if status == StatusCode::PARTIAL_CONTENT {
        let said = format!("bytes {from}-{}/{whole}", from + length - 1);
        response
            .headers_mut()
            .insert(CONTENT_RANGE, super::header(&said));
    }
    Ok(response)
}

/// The bytes that a range is of, of so many; none of them where it lies beyond, `None` where it is none
/// or several, which may be answered by the whole.
fn span(range: &str, whole: u64) -> Option<Span> {
    let (first, last) = range.strip_prefix("bytes=")?.split_once('-')?;
    let number = |text: &str| {
        let is_number = !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
        // More than fits is beyond any file.
        is_number.then(|| text.parse().unwrap_or(u64::MAX))
    };
    let (from, to) = match (first, last) {
        ("", last) => (whole.saturating_sub(number(last)?), whole),
        (first, "") => (number(first)?, whole),
        (first, last) => {
            let (from, last) = (number(first)?, number(last)?);
            if last < from {
                return None;
            }
            (from, last.saturating_add(1).min(whole))
        }
    };
    Some((from, to.saturating_sub(from)))
}

#[cfg(test)]
mod tests {
    use super::span;

    #[test]
    fn a_range_is_a_span_of_the_file() {
        for (range, expected) in [
            ("bytes=0-", Some((0, 10))),
            ("bytes=3-5", Some((3, 3))),
            ("bytes=3-3", Some((3, 1))),
            ("bytes=9-99", Some((9, 1))),
            ("bytes=-4", Some((6, 4))),
            ("bytes=-99", Some((0, 10))),
            ("bytes=10-", Some((10, 0))),
            ("bytes=-0", Some((10, 0))),
            ("bytes=99999999999999999999-", Some((u64::MAX, 0))),
            ("bytes=5-3", None),
            ("bytes=1-2,4-5", None),
            ("bytes=+1-2", None),
            ("bytes=-", None),
            ("cells=1-2", None),
            ("bytes=x-", None),
        ] {
            assert_eq!(span(range, 10), expected, "{range}");
        }
        assert_eq!(span("bytes=0-", 0), Some((0, 0)));
    }
}

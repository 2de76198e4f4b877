//! Messages of pages to the studio: edits, jobs, and those of the feed.

use fleetyard_studio::{Asked, Changing, Document, Message};
use serde_json::Value;

/// Operations whose work does not follow from the size of what is asked for.
const LARGE: [&str; 4] = ["scatter", "snap", "batch", "resize-map"];

/// Reads a request of any kind, and makes the edit if it is one.
pub fn run(data: &[u8]) {
    let refused = [
        Changing::read(data, false)
            .err()
            .map(|refused| refused.error().to_owned()),
        Asked::read(data).err(),
        std::str::from_utf8(data)
            .ok()
            .and_then(|text| Message::read(text).err()),
    ];
    assert!(
        refused
            .iter()
            .flatten()
            .all(|reason| !reason.trim().is_empty())
    );
    let changing = match Changing::read(data, true) {
        Ok(changing) => changing,
        Err(refused) => return assert!(!refused.error().trim().is_empty()),
    };
    let Some(edit) = changing.edit().filter(|edit| !LARGE.contains(&edit.name())) else {
        return;
    };
    let before = Document::default();
    let Ok(after) = before.edited(edit) else {
        return;
    };
    // A document is well-formed after every edit: it is the same again after it was told to a page.
    let told: Value = serde_json::to_value(&after).expect("a document can be told");
    let again = Document::read(told.clone(), "").expect("what a page was told it may send");
    assert_eq!(serde_json::to_value(&again).expect("the same"), told);
}

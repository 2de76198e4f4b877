//! Documents, edits, files and artefacts.

mod artefacts;
mod edits;
mod files;
mod random;

use fleetyard_core::Digest;
use fleetyard_studio::{Artefacts, Document, Edit, History, Refusal};
use serde_json::Value;

/// Reads an edit and makes it.
fn edit(history: &mut History, operation: Value) -> Result<(), Refusal> {
    history.edit(&Edit::read(operation)?)
}

/// A document after edits, none of which may be refused.
#[track_caller]
fn made(operations: &[Value]) -> Document {
    let mut history = History::new(Document::default());
    for operation in operations {
        let made = edit(&mut history, operation.clone());
        assert_eq!(made, Ok(()), "{operation}");
    }
    history.document().clone()
}

fn digest(document: &Document) -> Digest {
    let artefacts = Artefacts::default();
    artefacts.whole(document).expect("a problem").digest
}

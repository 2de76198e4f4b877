//! Annotation files: the format `fleetyard.annotations/1`, one JSON object.
//!
//! ```json
//! {
//!   "format": "fleetyard.annotations/1",
//!   "planner": "cbs 0.1.0",
//!   "plan_digest": "fedcba9876543210fedcba9876543210",
//!   "agents": 4,
//!   "left_out": 0,
//!   "annotations": [
//!     {"layer":"constraints","shape":"places","agent":3,"from_s":4,"to_s":5,"xy_m":[[[2.5,0.5]]],"places":[[17]]},
//!     {"layer":"tangents","shape":"lines","xy_m":[[[0,0],[4,1.5]]],"values":[2]}
//!   ]
//! }
//! ```
//!
//! `format`, `agents` and `annotations` are needed, the rest is optional and unknown keys are
//! refused. Keys may come in any order. An annotation is what a planner submitted, in seconds of
//! the plan and metres of the map ([`Annotation`]); places have their points as well, so that who
//! shows them need not have the map. `left_out` counts those that the host did not keep.

use std::fmt::Write as _;
use std::path::Path;

use fleetyard_abi::{Annotation, Environment, Lists, Shape};
use serde::{Deserialize, Deserializer};

use crate::files::{load_file, write_atomically};
use crate::json::{self, push_lines, read_object};
use crate::{Digest, InputError};

/// Largest annotation file that is read, in bytes.
const ANNOTATION_FILE_LIMIT: u64 = 1 << 28;

/// The value of `format`.
const ANNOTATION_FORMAT: &str = "fleetyard.annotations/1";

/// The content of an annotation file.
#[derive(Debug, Clone, PartialEq)]
pub struct AnnotationFile {
    /// The file, for error messages.
    pub source: String,
    /// The planner that made them, as free text.
    pub planner: Option<String>,
    /// Digest of the plan that came with them, if one did.
    pub plan_digest: Option<Digest>,
    /// Number of agents.
    pub agents: u32,
    /// Annotations that the host did not keep.
    pub left_out: u64,
    /// The annotations in their order. Those of places have points too.
    pub annotations: Vec<Annotation>,
}

impl AnnotationFile {
    /// Annotations on a map for so many agents, all of which [`Annotation::check`] has passed.
    pub fn new(environment: &Environment, agents: u32, annotations: &[Annotation]) -> Self {
        let located = |annotation: &Annotation| {
            let mut annotation = annotation.clone();
            if annotation.shape == Shape::Places {
                let at = |place: &u32| environment.place_m(*place).unwrap_or_default();
                let shapes = annotation.places.iter();
                annotation.xy_m = shapes.map(|places| places.iter().map(at)).collect();
            }
            annotation
        };
        Self {
            source: "annotations".to_owned(),
            planner: None,
            plan_digest: None,
            agents,
            left_out: 0,
            annotations: annotations.iter().map(located).collect(),
        }
    }
}

/// Reads and parses an annotation file.
pub fn load_annotations(path: impl AsRef<Path>) -> Result<AnnotationFile, InputError> {
    load_file(path, ANNOTATION_FILE_LIMIT, read_annotations)
}

/// Parses the content of an annotation file. `source` is named in errors.
pub fn read_annotations(source: &str, bytes: &[u8]) -> Result<AnnotationFile, InputError> {
    let hint = "an annotation file is a JSON object with format, agents and annotations; \
                `fleetyard run --annotations FILE` writes one";
    let document: Document = read_object(source, bytes, hint)?;
    let () = document.format;
    let mut annotations = Vec::with_capacity(document.annotations.len());
    for (number, Entry(annotation)) in document.annotations.into_iter().enumerate() {
        if let Err(reason) = check(&annotation, document.agents) {
            return Err(InputError::new(
                source,
                format!("annotation {number} is malformed: {reason}"),
            )
            .hint("the file was changed after it was written; run the planner again"));
        }
        annotations.push(annotation);
    }
    Ok(AnnotationFile {
        source: source.to_owned(),
        planner: document.planner,
        plan_digest: document.plan_digest,
        agents: document.agents,
        left_out: document.left_out,
        annotations,
    })
}

/// Checks an annotation that has the points of its places too.
fn check(annotation: &Annotation, agents: u32) -> Result<(), String> {
    if annotation.shape != Shape::Places {
        return annotation.check(agents as usize, 0);
    }
    if annotation.xy_m.offsets() != annotation.places.offsets() {
        return Err("its `xy_m` and its `places` have different lengths".to_owned());
    }
    let places = Annotation {
        xy_m: Lists::default(),
        ..annotation.clone()
    };
    places.check(agents as usize, usize::MAX)
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "annotations: a JSON object")]
struct Document {
    #[serde(deserialize_with = "format")]
    format: (),
    planner: Option<String>,
    plan_digest: Option<Digest>,
    agents: u32,
    #[serde(default)]
    left_out: u64,
    annotations: Vec<Entry>,
}

fn format<'de, D: Deserializer<'de>>(deserializer: D) -> Result<(), D::Error> {
    json::format(deserializer, ANNOTATION_FORMAT)
}

#[derive(Deserialize)]
struct Entry(#[serde(with = "Strict")] Annotation);

/// The fields of an annotation, and no others: messages pass over them, files do not.
#[derive(Deserialize)]
#[serde(
    remote = "Annotation",
    deny_unknown_fields,
    expecting = "an annotation: a JSON object"
)]
struct Strict {
    layer: String,
    shape: Shape,
    #[serde(default)]
    agent: Option<u32>,
    #[serde(default)]
    from_s: f64,
    #[serde(default)]
    to_s: Option<f64>,
    #[serde(default)]
    text: String,
    #[serde(default)]
    xy_m: Lists<[f64; 2]>,
    #[serde(default)]
    places: Lists<u32>,
    #[serde(default)]
    values: Vec<f64>,
}

/// The content of an annotation file, one annotation per line.
pub fn write_annotations(file: &AnnotationFile) -> Vec<u8> {
    let optional = [
        ("planner", file.planner.clone()),
        ("plan_digest", json::text(file.plan_digest)),
    ];
    let mut text = json::begin(ANNOTATION_FORMAT, &optional);
    let (agents, left_out) = (file.agents, file.left_out);
    let _ = writeln!(text, "  \"agents\": {agents},\n  \"left_out\": {left_out},");
    push_lines(
        &mut text,
        "annotations",
        &file.annotations,
        |text, annotation| {
            // Its numbers are finite, as everything that is kept.
            text.push_str(&serde_json::to_string(annotation).unwrap_or_default());
        },
    );
    text.push_str("\n}\n");
    text.into_bytes()
}

/// Writes an annotation file, replacing an old one as a whole.
pub fn save_annotations(file: &AnnotationFile, path: impl AsRef<Path>) -> Result<(), InputError> {
    write_atomically(path.as_ref(), &write_annotations(file))
}

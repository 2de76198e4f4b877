//! Trajectory files: the format `fleetyard.trajectories/1`, one JSON object.
//!
//! ```json
//! {
//!   "format": "fleetyard.trajectories/1",
//!   "planner": "db-cbs",
//!   "plan_digest": "fedcba9876543210fedcba9876543210",
//!   "paths": [
//!     [[0, 1.5, 2], [2.5, 4, 2]],
//!     [[0, 7, 7]]
//!   ]
//! }
//! ```
//!
//! `format` and `paths` are needed, the rest is optional and unknown keys are refused.
//! Keys may come in any order. `paths` has one list per agent: its knots, each
//! `[t, x, y]` or `[t, x, y, heading]`, in seconds, metres and radians. What makes a plan
//! of them, and what does not, is said at [`TrajectoryPlan`]. A file whose paths do not
//! have the digest that `plan_digest` names is refused.

use std::fmt;
use std::path::Path;

use serde::Deserialize;
use serde::de::{self, Deserializer, IgnoredAny, SeqAccess, Visitor};

use crate::files::{read_file, write_atomically};
use crate::json::{self, check_digest, push_number, read_object, with_hint};
use crate::plan_file::{PLAN_FILE_LIMIT, PLAN_MAX_AGENTS};
use crate::trajectory::Unfinished;
use crate::{Digest, InputError, Knot, TrajectoryPlan};

/// Most knots that all paths of a file may have together.
pub const TRAJECTORY_MAX_KNOTS: usize = 1 << 27;

/// The value of `format`.
pub const TRAJECTORY_FORMAT: &str = "fleetyard.trajectories/1";

/// The content of a trajectory file.
#[derive(Debug, Clone, PartialEq)]
pub struct TrajectoryFile {
    /// The file, for error messages.
    pub source: String,
    /// The author of the plan, as free text.
    pub planner: Option<String>,
    /// Digest of the paths; after reading it is known to be right.
    pub plan_digest: Option<Digest>,
    /// The paths.
    pub plan: TrajectoryPlan,
}

impl TrajectoryFile {
    /// A plan with its digest, ready to be written.
    pub fn new(plan: TrajectoryPlan) -> Self {
        Self {
            source: "plan".to_owned(),
            planner: None,
            plan_digest: Some(plan.digest()),
            plan,
        }
    }
}

/// Reads and parses a trajectory file.
pub fn load_trajectories(path: impl AsRef<Path>) -> Result<TrajectoryFile, InputError> {
    let path = path.as_ref();
    let bytes = read_file(path, PLAN_FILE_LIMIT)?;
    read_trajectories(&path.display().to_string(), &bytes)
}

/// Parses the content of a trajectory file. `source` is named in errors.
pub fn read_trajectories(source: &str, bytes: &[u8]) -> Result<TrajectoryFile, InputError> {
    let hint = "a trajectory file is a JSON object with format and paths";
    let document: Document = read_object(source, bytes, hint)?;
    let () = document.format;
    let (Paths(plan), named) = (document.paths, document.plan_digest);
    check_digest(source, "plan_digest", named, "the paths have", || {
        plan.digest()
    })?;
    Ok(TrajectoryFile {
        source: source.to_owned(),
        planner: document.planner,
        plan_digest: named,
        plan,
    })
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a plan: a JSON object")]
struct Document {
    #[serde(deserialize_with = "format")]
    format: (),
    planner: Option<String>,
    plan_digest: Option<Digest>,
    paths: Paths,
}

fn format<'de, D: Deserializer<'de>>(deserializer: D) -> Result<(), D::Error> {
    json::format(deserializer, TRAJECTORY_FORMAT)
}

struct Paths(TrajectoryPlan);

impl<'de> Deserialize<'de> for Paths {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct PathsVisitor;

        impl<'de> Visitor<'de> for PathsVisitor {
            type Value = Paths;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a list with one path per agent")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Paths, A::Error> {
                let mut plan = TrajectoryPlan::default();
                while list.next_element_seed(PathSeed(&mut plan))?.is_some() {
                    if plan.agents() > PLAN_MAX_AGENTS {
                        let reason = format!("more than {PLAN_MAX_AGENTS} paths");
                        return Err(de::Error::custom(reason));
                    }
                }
                Ok(Paths(plan))
            }
        }

        deserializer.deserialize_seq(PathsVisitor)
    }
}

/// Reads the next path into a plan.
struct PathSeed<'a>(&'a mut TrajectoryPlan);

impl<'de> de::DeserializeSeed<'de> for PathSeed<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de> Visitor<'de> for PathSeed<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a path: a list of knots [t, x, y] or [t, x, y, heading]")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<(), A::Error> {
        let plan = self.0;
        let mut path = Unfinished::default();
        while let Some(()) = list.next_element_seed(KnotSeed(plan, &mut path))? {
            if plan.knot_count() > TRAJECTORY_MAX_KNOTS {
                let reason = format!("the paths have more than {TRAJECTORY_MAX_KNOTS} knots");
                return Err(de::Error::custom(reason));
            }
        }
        let finished = plan.finish_path(&path);
        finished.map_err(|error| with_hint(&error, error.hint()))
    }
}

/// Reads the next knot into a path. It is judged here, so that an error has its place.
struct KnotSeed<'a>(&'a mut TrajectoryPlan, &'a mut Unfinished);

impl<'de> de::DeserializeSeed<'de> for KnotSeed<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de> Visitor<'de> for KnotSeed<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a knot [t, x, y] or [t, x, y, heading]")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<(), A::Error> {
        let wrong = |numbers: usize| de::Error::invalid_length(numbers, &self);
        let time_s = list.next_element()?.ok_or_else(|| wrong(0))?;
        let x_m = list.next_element()?.ok_or_else(|| wrong(1))?;
        let y_m = list.next_element()?.ok_or_else(|| wrong(2))?;
        let heading_rad = list.next_element()?;
        if heading_rad.is_some() && list.next_element::<IgnoredAny>()?.is_some() {
            return Err(wrong(5));
        }
        let knot = Knot {
            time_s,
            x_m,
            y_m,
            heading_rad,
        };
        let Self(plan, path) = self;
        let pushed = plan.push_knot(path, knot);
        pushed.map_err(|error| with_hint(&error, error.hint()))
    }
}

/// The content of a trajectory file, one path per line.
pub fn write_trajectories(file: &TrajectoryFile) -> Vec<u8> {
    let optional = [
        ("planner", file.planner.clone()),
        (
            "plan_digest",
            file.plan_digest.map(|digest| digest.to_string()),
        ),
    ];
    let mut text = json::begin(TRAJECTORY_FORMAT, &optional);
    text.reserve(24 * file.plan.knot_count());
    text.push_str("  \"paths\": [");
    for (agent, knots) in file.plan.paths().enumerate() {
        text.push_str(if agent == 0 { "\n    [" } else { ",\n    [" });
        for (at, knot) in knots.iter().enumerate() {
            text.push_str(if at == 0 { "[" } else { ",[" });
            push_number(&mut text, knot.time_s);
            for number in [Some(knot.x_m), Some(knot.y_m), knot.heading_rad] {
                let Some(number) = number else { continue };
                text.push(',');
                push_number(&mut text, number);
            }
            text.push(']');
        }
        text.push(']');
    }
    text.push_str("\n  ]\n}\n");
    text.into_bytes()
}

/// Writes a trajectory file, replacing an old one as a whole.
pub fn save_trajectories(file: &TrajectoryFile, path: impl AsRef<Path>) -> Result<(), InputError> {
    write_atomically(path.as_ref(), &write_trajectories(file))
}

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
//! of them, and what does not, is said at [`TrajectoryPlan`]. `controls` may have a list of
//! segments per agent, each `[duration, number, …]`: the control and the seconds that it is
//! held; with them a file needs no `paths` where robots and starts are known ([`read_motions`]). A
//! file whose paths and controls do not have the digest that `plan_digest` names is
//! refused.

use std::path::Path;

use serde::Deserialize;
use serde::de::{Deserializer, Error, IgnoredAny, SeqAccess};

use crate::files::{load_file, write_atomically};
use crate::json::{self, check_digest, push_lines, push_list, push_number, read_object, with_hint};
use crate::path_list::{Paths, ReadStops};
use crate::plan_file::PLAN_FILE_LIMIT;
use crate::trajectory::Unfinished;
use crate::{
    ControlPlan, Digest, InputError, Knot, TrajectoryError, TrajectoryPlan, check_controls,
};

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
    load_file(path, PLAN_FILE_LIMIT, read_trajectories)
}

/// The content of a trajectory file that may have controls alone.
#[derive(Debug, Clone, PartialEq)]
pub enum MotionFile {
    /// It has paths.
    Paths(TrajectoryFile),
    /// It has controls, and where they lead depends on robots and starts.
    Controls(ControlFile),
}

/// The content of a trajectory file that has controls alone.
#[derive(Debug, Clone, PartialEq)]
pub struct ControlFile {
    /// The file, for error messages.
    pub source: String,
    /// The author of the plan, as free text.
    pub planner: Option<String>,
    /// The controls, which [`check_controls`] lets pass.
    pub controls: ControlPlan,
}

const HINT: &str = "a trajectory file is a JSON object with format and paths";

/// Parses the content of a trajectory file. `source` is named in errors.
pub fn read_trajectories(source: &str, bytes: &[u8]) -> Result<TrajectoryFile, InputError> {
    match read_motions(source, bytes)? {
        MotionFile::Paths(file) => Ok(file),
        MotionFile::Controls(_) => {
            let reason = "the plan has controls and no paths, and nothing says of which robots";
            Err(InputError::new(source, reason)
                .hint("name their task with --task FILE: it says where controls lead"))
        }
    }
}

/// The same of a file that may have controls alone.
pub fn read_motions(source: &str, bytes: &[u8]) -> Result<MotionFile, InputError> {
    let document: Document = read_object(source, bytes, HINT)?;
    let () = document.format;
    let refused = |error: &TrajectoryError| {
        let hint = error.hint().unwrap_or(HINT);
        InputError::new(source, error.to_string()).hint(hint)
    };
    let named = document.plan_digest;
    let Some(Paths(mut plan)) = document.paths else {
        let Some(controls) = document.controls else {
            // Where they are missing.
            read_object::<WithPaths>(source, bytes, HINT)?;
            return Err(InputError::new(source, "there are no paths").hint(HINT));
        };
        if named.is_some() {
            let reason = "plan_digest is of paths, and there are none";
            return Err(InputError::new(source, reason).hint("leave it out"));
        }
        check_controls(&controls).map_err(|error| refused(&error))?;
        return Ok(MotionFile::Controls(ControlFile {
            source: source.to_owned(),
            planner: document.planner,
            controls,
        }));
    };
    if let Some(controls) = document.controls {
        plan = plan
            .with_controls(controls)
            .map_err(|error| refused(&error))?;
    }
    check_digest(source, "plan_digest", named, "the paths have", || {
        plan.digest()
    })?;
    Ok(MotionFile::Paths(TrajectoryFile {
        source: source.to_owned(),
        planner: document.planner,
        plan_digest: named,
        plan,
    }))
}

/// For the place at which paths are missing.
#[derive(Deserialize)]
struct WithPaths {
    #[serde(rename = "paths")]
    _paths: IgnoredAny,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a plan: a JSON object")]
struct Document {
    #[serde(deserialize_with = "format")]
    format: (),
    planner: Option<String>,
    plan_digest: Option<Digest>,
    paths: Option<Paths<TrajectoryPlan>>,
    controls: Option<ControlPlan>,
}

fn format<'de, D: Deserializer<'de>>(deserializer: D) -> Result<(), D::Error> {
    json::format(deserializer, TRAJECTORY_FORMAT)
}

impl ReadStops for TrajectoryPlan {
    const PATH: &'static str = "a path: a list of knots [t, x, y] or [t, x, y, heading]";
    const STOP: &'static str = "a knot [t, x, y] or [t, x, y, heading]";
    const STOPS: &'static str = "knots";
    const MOST: usize = TRAJECTORY_MAX_KNOTS;
    type Begun = Unfinished;

    fn read_stop<'de, A: SeqAccess<'de>>(
        &mut self,
        path: &mut Unfinished,
        mut numbers: A,
    ) -> Result<(), A::Error> {
        let wrong = |found: usize| A::Error::invalid_length(found, &Self::STOP);
        let time_s = numbers.next_element()?.ok_or_else(|| wrong(0))?;
        let x_m = numbers.next_element()?.ok_or_else(|| wrong(1))?;
        let y_m = numbers.next_element()?.ok_or_else(|| wrong(2))?;
        let heading_rad = numbers.next_element()?;
        if heading_rad.is_some() && numbers.next_element::<IgnoredAny>()?.is_some() {
            return Err(wrong(5));
        }
        let knot = Knot {
            time_s,
            x_m,
            y_m,
            heading_rad,
        };
        let pushed = self.push_knot(path, knot);
        pushed.map_err(|error| with_hint(&error, error.hint()))
    }

    fn finish<E: Error>(&mut self, path: &Unfinished) -> Result<(), E> {
        let finished = self.finish_path(path);
        finished.map_err(|error| with_hint(&error, error.hint()))
    }

    fn stops(&self) -> usize {
        self.knot_count()
    }

    fn agents(&self) -> usize {
        self.agents()
    }
}

/// The content of a trajectory file, one path per line.
pub fn write_trajectories(file: &TrajectoryFile) -> Vec<u8> {
    let optional = [
        ("planner", file.planner.clone()),
        ("plan_digest", json::text(file.plan_digest)),
    ];
    let mut text = json::begin(TRAJECTORY_FORMAT, &optional);
    text.reserve(24 * file.plan.knot_count());
    push_lines(&mut text, "paths", file.plan.paths(), |text, knots| {
        push_list(text, knots.iter(), |text, knot| {
            let numbers = [
                Some(knot.time_s),
                Some(knot.x_m),
                Some(knot.y_m),
                knot.heading_rad,
            ];
            push_list(text, numbers.into_iter().flatten(), push_number);
        });
    });
    if let Some(controls) = file.plan.controls() {
        let agents = (0..controls.agents()).map(|agent| controls.of(agent));
        text.push_str(",\n");
        push_lines(&mut text, "controls", agents, |text, segments| {
            push_list(text, segments, |text, segment| {
                let numbers = [segment.duration_s].into_iter();
                let numbers = numbers.chain(segment.control.iter().copied());
                push_list(text, numbers, push_number);
            });
        });
    }
    text.push_str("\n}\n");
    text.into_bytes()
}

/// Writes a trajectory file, replacing an old one as a whole.
pub fn save_trajectories(file: &TrajectoryFile, path: impl AsRef<Path>) -> Result<(), InputError> {
    write_atomically(path.as_ref(), &write_trajectories(file))
}

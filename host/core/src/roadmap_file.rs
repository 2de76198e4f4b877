//! Roadmap files, `fleetyard.roadmap/1`, and files of plans on roadmaps,
//! `fleetyard.roadmap-plan/1`: one JSON object each.
//!
//! ```json
//! {
//!   "format": "fleetyard.roadmap/1",
//!   "roadmap_digest": "0123456789abcdef0123456789abcdef",
//!   "directed": false,
//!   "vertices": [[0, 0], [3, 0], [3, 4]],
//!   "edges": [[0, 1], [1, 2]]
//! }
//! ```
//!
//! Vertices are `[x, y]` in metres. Edges are pairs of vertices, counted from 0; with
//! `"directed": false` each can be driven both ways.
//!
//! ```json
//! {
//!   "format": "fleetyard.roadmap-plan/1",
//!   "planner": "ccbs",
//!   "roadmap": "hall.roadmap.json",
//!   "roadmap_digest": "0123456789abcdef0123456789abcdef",
//!   "plan_digest": "fedcba9876543210fedcba9876543210",
//!   "paths": [
//!     [[0, 0, 1.5], [1, 4.5], [2, 8.5]],
//!     [[2, 0]]
//!   ]
//! }
//! ```
//!
//! `paths` has one list per agent: its visits, each `[vertex, arrival, departure]` in
//! seconds; `[vertex, arrival]` leaves at once. `roadmap` names the file of the roadmap,
//! from the folder of the plan.
//!
//! The keys `format`, `vertices`, `edges` and `paths` are needed, the rest is optional and
//! unknown keys are refused. Keys may come in any order. What does not have the digest
//! that is named is refused.

use std::fmt::Write as _;
use std::marker::PhantomData;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde::de::{DeserializeSeed, Deserializer, Error, IgnoredAny, SeqAccess};

use crate::files::{load_file, write_atomically};
use crate::json::{
    self, Listed, ReadList, check_digest, push_lines, push_list, push_number, read_object,
    with_hint,
};
use crate::path_list::{Paths, ReadStops};
use crate::plan_file::PLAN_FILE_LIMIT;
use crate::{Digest, InputError, Roadmap, RoadmapPlan, TrajectoryFile, Visit};

/// Largest roadmap file that is read, in bytes.
pub const ROADMAP_FILE_LIMIT: u64 = 1 << 31;

/// Most visits that all paths of a plan's file may have together.
pub const ROADMAP_PLAN_MAX_VISITS: usize = 1 << 27;

/// The value of `format` in a roadmap file.
pub const ROADMAP_FORMAT: &str = "fleetyard.roadmap/1";

/// The value of `format` in the file of a plan on a roadmap.
pub const ROADMAP_PLAN_FORMAT: &str = "fleetyard.roadmap-plan/1";

/// Reads and parses a roadmap file.
pub fn load_roadmap(path: impl AsRef<Path>) -> Result<Roadmap, InputError> {
    load_file(path, ROADMAP_FILE_LIMIT, read_roadmap)
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a roadmap: a JSON object")]
struct RoadmapDocument {
    #[serde(deserialize_with = "roadmap_format")]
    format: (),
    roadmap_digest: Option<Digest>,
    #[serde(default = "yes")]
    directed: bool,
    vertices: Pairs<f64>,
    edges: Pairs<u32>,
}

fn yes() -> bool {
    true
}

fn roadmap_format<'de, D: Deserializer<'de>>(deserializer: D) -> Result<(), D::Error> {
    json::format(deserializer, ROADMAP_FORMAT)
}

/// Parses the content of a roadmap file. `source` is named in errors.
pub fn read_roadmap(source: &str, bytes: &[u8]) -> Result<Roadmap, InputError> {
    let hint = "a roadmap file is a JSON object with format, vertices and edges";
    let document: RoadmapDocument = read_object(source, bytes, hint)?;
    let () = document.format;
    let (Pairs(x_m, y_m), Pairs(from, to)) = (document.vertices, document.edges);
    let ways = if document.directed { 1 } else { 2 };
    let edges = from
        .into_iter()
        .zip(to)
        .flat_map(|(from, to)| [(from, to), (to, from)].into_iter().take(ways));
    let roadmap = Roadmap::new(x_m, y_m, edges)
        .map_err(|error| InputError::new(source, error.to_string()))?;
    let named = document.roadmap_digest;
    check_digest(source, "roadmap_digest", named, "the roadmap has", || {
        roadmap.digest()
    })?;
    Ok(roadmap)
}

/// Numbers that a roadmap file has in pairs: the coordinates of vertices, the ends of edges.
trait Paired: for<'de> Deserialize<'de> {
    /// A pair in the words of an error.
    const PAIR: &'static str;
    /// All pairs in the words of an error.
    const PAIRS: &'static str;
    /// A list of them in the words of an error.
    const LIST: &'static str;
    /// Most pairs of a file.
    const MOST: usize;
}

impl Paired for f64 {
    const PAIR: &'static str = "a vertex [x, y]";
    const PAIRS: &'static str = "vertices";
    const LIST: &'static str = "a list of vertices";
    const MOST: usize = Roadmap::MAX_VERTICES;
}

impl Paired for u32 {
    const PAIR: &'static str = "an edge [from, to]";
    const PAIRS: &'static str = "edges";
    const LIST: &'static str = "a list of edges";
    const MOST: usize = Roadmap::MAX_EDGES;
}

/// A list of pairs in two columns.
struct Pairs<T>(Vec<T>, Vec<T>);

impl<'de, T: Paired> Deserialize<'de> for Pairs<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Listed(Pairs(Vec::new(), Vec::new())).deserialize(deserializer)
    }
}

impl<'de, T: Paired> ReadList<'de> for Pairs<T> {
    const EXPECTED: &'static str = T::LIST;
    type Value = Self;

    fn read<A: SeqAccess<'de>>(mut self, mut list: A) -> Result<Self, A::Error> {
        while let Some((first, second)) = list.next_element_seed(Listed(Pair(PhantomData)))? {
            if self.0.len() == T::MOST {
                let reason = format!("more than {} {}", T::MOST, T::PAIRS);
                return Err(A::Error::custom(reason));
            }
            self.0.push(first);
            self.1.push(second);
        }
        Ok(self)
    }
}

/// A list of exactly two numbers. Serde's own pairs do not say what they are.
struct Pair<T>(PhantomData<T>);

impl<'de, T: Paired> ReadList<'de> for Pair<T> {
    const EXPECTED: &'static str = T::PAIR;
    type Value = (T, T);

    fn read<A: SeqAccess<'de>>(self, mut list: A) -> Result<(T, T), A::Error> {
        let wrong = |numbers| A::Error::invalid_length(numbers, &T::PAIR);
        let first = list.next_element()?.ok_or_else(|| wrong(0))?;
        let second = list.next_element()?.ok_or_else(|| wrong(1))?;
        match list.next_element::<IgnoredAny>()? {
            Some(_) => Err(wrong(3)),
            None => Ok((first, second)),
        }
    }
}

/// The content of a roadmap file, with its digest.
pub fn write_roadmap(roadmap: &Roadmap) -> Vec<u8> {
    let optional = [("roadmap_digest", json::text(Some(roadmap.digest())))];
    let mut text = json::begin(ROADMAP_FORMAT, &optional);
    text.reserve(20 * roadmap.vertices() + 12 * roadmap.edge_count());
    let symmetric = roadmap.is_symmetric();
    let _ = writeln!(text, "  \"directed\": {},", !symmetric);
    let vertices = 0..roadmap.vertices() as u32;
    push_lines(&mut text, "vertices", vertices, |text, vertex| {
        let (x, y) = roadmap.position_m(vertex);
        text.push('[');
        push_number(text, x);
        text.push_str(", ");
        push_number(text, y);
        text.push(']');
    });
    text.push_str(",\n");
    let edges = roadmap.edges().filter(|(from, to)| !symmetric || from < to);
    push_lines(&mut text, "edges", edges, |text, (from, to)| {
        let _ = write!(text, "[{from}, {to}]");
    });
    text.push_str("\n}\n");
    text.into_bytes()
}

/// The content of a file of a plan on a roadmap.
#[derive(Debug, Clone, PartialEq)]
pub struct RoadmapPlanFile {
    /// The file, for error messages.
    pub source: String,
    /// The author of the plan, as free text.
    pub planner: Option<String>,
    /// The roadmap's file, from the folder of this one.
    pub roadmap: Option<String>,
    /// The roadmap that the plan is for.
    pub roadmap_digest: Option<Digest>,
    /// Digest of the visits; after reading it is known to be right.
    pub plan_digest: Option<Digest>,
    /// The visits.
    pub plan: RoadmapPlan,
}

impl RoadmapPlanFile {
    /// A plan for a roadmap, with digests, ready to be written. `file` names the roadmap.
    pub fn new(roadmap: &Roadmap, file: Option<String>, plan: RoadmapPlan) -> Self {
        Self {
            source: "plan".to_owned(),
            planner: None,
            roadmap: file,
            roadmap_digest: Some(roadmap.digest()),
            plan_digest: Some(plan.digest()),
            plan,
        }
    }

    /// The roadmap's file for a plan in a folder, if the plan names it.
    pub fn roadmap_path(&self, folder: &Path) -> Result<PathBuf, InputError> {
        let name = self.roadmap.as_ref();
        name.map(|name| folder.join(name)).ok_or_else(|| {
            InputError::new(self.source.as_str(), "the plan does not name its roadmap")
                .hint("add \"roadmap\" with the name of the roadmap's file")
        })
    }

    /// Refuses a plan that names another roadmap.
    pub fn check_for(&self, roadmap: &Roadmap) -> Result<(), InputError> {
        match self.roadmap_digest {
            Some(named) if named != roadmap.digest() => {
                let reason = format!(
                    "the plan is for roadmap {named}, but this roadmap is {}",
                    roadmap.digest()
                );
                Err(InputError::new(self.source.as_str(), reason).hint(
                    "is it the right roadmap? to use it all the same, remove roadmap_digest from \
                     the file",
                ))
            }
            _ => Ok(()),
        }
    }

    /// The plan in the plane. It is an error if the plan is for another roadmap, or uses a
    /// vertex or an edge that this one does not have.
    pub fn to_trajectories(&self, roadmap: &Roadmap) -> Result<TrajectoryFile, InputError> {
        self.check_for(roadmap)?;
        let plan = self.plan.to_trajectories(roadmap).map_err(|error| {
            InputError::new(self.source.as_str(), error.to_string()).maybe_hint(error.hint())
        })?;
        Ok(TrajectoryFile {
            source: self.source.clone(),
            planner: self.planner.clone(),
            plan_digest: None,
            plan,
        })
    }
}

/// Reads and parses the file of a plan on a roadmap, but not its roadmap.
pub fn load_roadmap_plan(path: impl AsRef<Path>) -> Result<RoadmapPlanFile, InputError> {
    load_file(path, PLAN_FILE_LIMIT, read_roadmap_plan)
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a plan: a JSON object")]
struct PlanDocument {
    #[serde(deserialize_with = "plan_format")]
    format: (),
    planner: Option<String>,
    roadmap: Option<String>,
    roadmap_digest: Option<Digest>,
    plan_digest: Option<Digest>,
    paths: Paths<RoadmapPlan>,
}

fn plan_format<'de, D: Deserializer<'de>>(deserializer: D) -> Result<(), D::Error> {
    json::format(deserializer, ROADMAP_PLAN_FORMAT)
}

/// Parses the content of the file of a plan on a roadmap. `source` is named in errors.
pub fn read_roadmap_plan(source: &str, bytes: &[u8]) -> Result<RoadmapPlanFile, InputError> {
    let hint = "a plan on a roadmap is a JSON object with format and paths";
    let document: PlanDocument = read_object(source, bytes, hint)?;
    let () = document.format;
    let (Paths(plan), named) = (document.paths, document.plan_digest);
    check_digest(source, "plan_digest", named, "the paths have", || {
        plan.digest()
    })?;
    Ok(RoadmapPlanFile {
        source: source.to_owned(),
        planner: document.planner,
        roadmap: document.roadmap,
        roadmap_digest: document.roadmap_digest,
        plan_digest: named,
        plan,
    })
}

impl ReadStops for RoadmapPlan {
    const PATH: &'static str = "a path: a list of visits [vertex, arrival, departure]";
    const STOP: &'static str = "a visit [vertex, arrival, departure] or [vertex, arrival]";
    const STOPS: &'static str = "visits";
    const MOST: usize = ROADMAP_PLAN_MAX_VISITS;
    /// Visits that were read, those that are not kept included.
    type Begun = usize;

    fn read_stop<'de, A: SeqAccess<'de>>(
        &mut self,
        read: &mut usize,
        mut numbers: A,
    ) -> Result<(), A::Error> {
        let wrong = |found: usize| A::Error::invalid_length(found, &Self::STOP);
        let vertex = numbers.next_element()?.ok_or_else(|| wrong(0))?;
        let arrival_s = numbers.next_element()?.ok_or_else(|| wrong(1))?;
        let departure_s = numbers.next_element()?;
        if departure_s.is_some() && numbers.next_element::<IgnoredAny>()?.is_some() {
            return Err(wrong(4));
        }
        let visit = Visit {
            vertex,
            arrival_s,
            departure_s: departure_s.unwrap_or(arrival_s),
        };
        let pushed = self.push_visit(*read, visit);
        *read += 1;
        pushed.map_err(|error| with_hint(&error, error.hint()))
    }

    fn finish<E: Error>(&mut self, _: &usize) -> Result<(), E> {
        let finished = self.finish_path();
        finished.map_err(|error| with_hint(&error, error.hint()))
    }

    fn stops(&self) -> usize {
        self.visit_count()
    }

    fn agents(&self) -> usize {
        self.agents()
    }
}

/// The content of the file of a plan on a roadmap, one path per line.
pub fn write_roadmap_plan(file: &RoadmapPlanFile) -> Vec<u8> {
    let optional = [
        ("planner", file.planner.clone()),
        ("roadmap", file.roadmap.clone()),
        ("roadmap_digest", json::text(file.roadmap_digest)),
        ("plan_digest", json::text(file.plan_digest)),
    ];
    let mut text = json::begin(ROADMAP_PLAN_FORMAT, &optional);
    text.reserve(24 * file.plan.visit_count());
    push_lines(&mut text, "paths", file.plan.paths(), |text, path| {
        push_list(text, path, |text, visit| {
            let _ = write!(text, "[{},", visit.vertex);
            push_number(text, visit.arrival_s);
            if visit.departure_s > visit.arrival_s {
                text.push(',');
                push_number(text, visit.departure_s);
            }
            text.push(']');
        });
    });
    text.push_str("\n}\n");
    text.into_bytes()
}

/// Writes a roadmap file, replacing an old one as a whole.
pub fn save_roadmap(roadmap: &Roadmap, path: impl AsRef<Path>) -> Result<(), InputError> {
    write_atomically(path.as_ref(), &write_roadmap(roadmap))
}

/// Writes the file of a plan on a roadmap, replacing an old one as a whole.
pub fn save_roadmap_plan(file: &RoadmapPlanFile, path: impl AsRef<Path>) -> Result<(), InputError> {
    write_atomically(path.as_ref(), &write_roadmap_plan(file))
}

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

use std::fmt;
use std::fmt::Write as _;
use std::marker::PhantomData;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde::de::{self, Deserializer, IgnoredAny, SeqAccess, Visitor};

use crate::files::{read_file, write_atomically};
use crate::json::{self, check_digest, push_number, read_object, with_hint};
use crate::plan_file::{PLAN_FILE_LIMIT, PLAN_MAX_AGENTS};
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
    let path = path.as_ref();
    let bytes = read_file(path, ROADMAP_FILE_LIMIT)?;
    read_roadmap(&path.display().to_string(), &bytes)
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a roadmap: a JSON object")]
struct RoadmapDocument {
    #[serde(deserialize_with = "roadmap_format")]
    format: (),
    roadmap_digest: Option<Digest>,
    #[serde(default = "yes")]
    directed: bool,
    vertices: Vertices,
    edges: Edges,
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
    let Vertices { x_m, y_m } = document.vertices;
    let Edges(edges) = document.edges;
    let ways = if document.directed { 1 } else { 2 };
    let edges = edges
        .into_iter()
        .flat_map(|(from, to)| [(from, to), (to, from)].into_iter().take(ways));
    let roadmap = Roadmap::new(x_m, y_m, edges)
        .map_err(|error| InputError::new(source, error.to_string()))?;
    let named = document.roadmap_digest;
    check_digest(source, "roadmap_digest", named, "the roadmap has", || {
        roadmap.digest()
    })?;
    Ok(roadmap)
}

/// A list whose entries are read into columns, one after the other.
trait Columns<'de>: Default {
    const WHAT: &'static str;
    const MOST: usize;
    type Entry: Deserialize<'de>;
    fn push(&mut self, entry: Self::Entry);
}

struct ColumnsVisitor<T>(PhantomData<T>);

impl<'de, T: Columns<'de>> Visitor<'de> for ColumnsVisitor<T> {
    type Value = T;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "a list of {}", T::WHAT)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<T, A::Error> {
        let mut columns = T::default();
        let mut number = 0;
        while let Some(entry) = list.next_element()? {
            number += 1;
            if number > T::MOST {
                let reason = format!("more than {} {}", T::MOST, T::WHAT);
                return Err(de::Error::custom(reason));
            }
            columns.push(entry);
        }
        Ok(columns)
    }
}

/// A list of exactly two numbers. Serde's own pairs do not say what they are.
macro_rules! pair {
    ($name:ident, $of:ty, $what:literal) => {
        struct $name($of, $of);

        impl<'de> Deserialize<'de> for $name {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                struct PairVisitor;

                impl<'de> Visitor<'de> for PairVisitor {
                    type Value = $name;

                    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                        f.write_str($what)
                    }

                    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<$name, A::Error> {
                        let wrong = |numbers| de::Error::invalid_length(numbers, &self);
                        let first = list.next_element()?.ok_or_else(|| wrong(0))?;
                        let second = list.next_element()?.ok_or_else(|| wrong(1))?;
                        match list.next_element::<IgnoredAny>()? {
                            Some(_) => Err(wrong(3)),
                            None => Ok($name(first, second)),
                        }
                    }
                }

                deserializer.deserialize_seq(PairVisitor)
            }
        }
    };
}

pair!(Position, f64, "a vertex [x, y]");
pair!(Edge, u32, "an edge [from, to]");

#[derive(Default)]
struct Vertices {
    x_m: Vec<f64>,
    y_m: Vec<f64>,
}

impl Columns<'_> for Vertices {
    const WHAT: &'static str = "vertices";
    const MOST: usize = Roadmap::MAX_VERTICES;
    type Entry = Position;

    fn push(&mut self, Position(x_m, y_m): Position) {
        self.x_m.push(x_m);
        self.y_m.push(y_m);
    }
}

impl<'de> Deserialize<'de> for Vertices {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_seq(ColumnsVisitor(PhantomData))
    }
}

#[derive(Default)]
struct Edges(Vec<(u32, u32)>);

impl Columns<'_> for Edges {
    const WHAT: &'static str = "edges";
    const MOST: usize = Roadmap::MAX_EDGES;
    type Entry = Edge;

    fn push(&mut self, Edge(from, to): Edge) {
        self.0.push((from, to));
    }
}

impl<'de> Deserialize<'de> for Edges {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_seq(ColumnsVisitor(PhantomData))
    }
}

/// The content of a roadmap file, with its digest.
pub fn write_roadmap(roadmap: &Roadmap) -> Vec<u8> {
    let optional = [("roadmap_digest", Some(roadmap.digest().to_string()))];
    let mut text = json::begin(ROADMAP_FORMAT, &optional);
    text.reserve(20 * roadmap.vertices() + 12 * roadmap.edge_count());
    let symmetric = roadmap.is_symmetric();
    let _ = write!(text, "  \"directed\": {},\n  \"vertices\": [", !symmetric);
    let break_after = |text: &mut String, number: usize| {
        text.push_str(if number == 0 { "\n    " } else { ",\n    " });
    };
    for vertex in 0..roadmap.vertices() {
        let (x, y) = roadmap.position_m(vertex as u32);
        break_after(&mut text, vertex);
        text.push('[');
        push_number(&mut text, x);
        text.push_str(", ");
        push_number(&mut text, y);
        text.push(']');
    }
    text.push_str("\n  ],\n  \"edges\": [");
    let edges = roadmap.edges().filter(|(from, to)| !symmetric || from < to);
    for (number, (from, to)) in edges.enumerate() {
        break_after(&mut text, number);
        let _ = write!(text, "[{from}, {to}]");
    }
    text.push_str("\n  ]\n}\n");
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

    /// The plan in the plane. It is an error if the plan is for another roadmap, or uses a
    /// vertex or an edge that this one does not have.
    pub fn to_trajectories(&self, roadmap: &Roadmap) -> Result<TrajectoryFile, InputError> {
        if let Some(named) = self.roadmap_digest
            && named != roadmap.digest()
        {
            let reason = format!(
                "the plan is for roadmap {named}, but this roadmap is {}",
                roadmap.digest()
            );
            return Err(InputError::new(self.source.as_str(), reason).hint(
                "is it the right roadmap? to use it all the same, remove roadmap_digest from the file",
            ));
        }
        let plan = self.plan.to_trajectories(roadmap).map_err(|error| {
            let input = InputError::new(self.source.as_str(), error.to_string());
            match error.hint() {
                Some(hint) => input.hint(hint),
                None => input,
            }
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
    let path = path.as_ref();
    let bytes = read_file(path, PLAN_FILE_LIMIT)?;
    read_roadmap_plan(&path.display().to_string(), &bytes)
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
    paths: Paths,
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

struct Paths(RoadmapPlan);

impl<'de> Deserialize<'de> for Paths {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct PathsVisitor;

        impl<'de> Visitor<'de> for PathsVisitor {
            type Value = Paths;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a list with one path per agent")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Paths, A::Error> {
                let mut plan = RoadmapPlan::default();
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
struct PathSeed<'a>(&'a mut RoadmapPlan);

impl<'de> de::DeserializeSeed<'de> for PathSeed<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de> Visitor<'de> for PathSeed<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a path: a list of visits [vertex, arrival, departure]")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<(), A::Error> {
        let plan = self.0;
        let mut number = 0;
        while let Some(()) = list.next_element_seed(VisitSeed(plan, number))? {
            number += 1;
            if plan.visit_count() > ROADMAP_PLAN_MAX_VISITS {
                let reason = format!("the paths have more than {ROADMAP_PLAN_MAX_VISITS} visits");
                return Err(de::Error::custom(reason));
            }
        }
        let finished = plan.finish_path();
        finished.map_err(|error| with_hint(&error, error.hint()))
    }
}

/// Reads the next visit into a path. It is judged here, so that an error has its place.
struct VisitSeed<'a>(&'a mut RoadmapPlan, usize);

impl<'de> de::DeserializeSeed<'de> for VisitSeed<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de> Visitor<'de> for VisitSeed<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a visit [vertex, arrival, departure] or [vertex, arrival]")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<(), A::Error> {
        let wrong = |numbers: usize| de::Error::invalid_length(numbers, &self);
        let vertex = list.next_element()?.ok_or_else(|| wrong(0))?;
        let arrival_s = list.next_element()?.ok_or_else(|| wrong(1))?;
        let departure_s = list.next_element()?;
        if departure_s.is_some() && list.next_element::<IgnoredAny>()?.is_some() {
            return Err(wrong(4));
        }
        let visit = Visit {
            vertex,
            arrival_s,
            departure_s: departure_s.unwrap_or(arrival_s),
        };
        let Self(plan, number) = self;
        let pushed = plan.push_visit(number, visit);
        pushed.map_err(|error| with_hint(&error, error.hint()))
    }
}

/// The content of the file of a plan on a roadmap, one path per line.
pub fn write_roadmap_plan(file: &RoadmapPlanFile) -> Vec<u8> {
    let optional = [
        ("planner", file.planner.clone()),
        ("roadmap", file.roadmap.clone()),
        (
            "roadmap_digest",
            file.roadmap_digest.map(|digest| digest.to_string()),
        ),
        (
            "plan_digest",
            file.plan_digest.map(|digest| digest.to_string()),
        ),
    ];
    let mut text = json::begin(ROADMAP_PLAN_FORMAT, &optional);
    text.reserve(24 * file.plan.visit_count());
    text.push_str("  \"paths\": [");
    for (agent, path) in file.plan.paths().enumerate() {
        text.push_str(if agent == 0 { "\n    [" } else { ",\n    [" });
        for (at, visit) in path.iter().enumerate() {
            let comma = if at == 0 { "" } else { "," };
            let _ = write!(text, "{comma}[{},", visit.vertex);
            push_number(&mut text, visit.arrival_s);
            if visit.departure_s > visit.arrival_s {
                text.push(',');
                push_number(&mut text, visit.departure_s);
            }
            text.push(']');
        }
        text.push(']');
    }
    text.push_str("\n  ]\n}\n");
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

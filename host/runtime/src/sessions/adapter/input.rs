//! The input of a solver: the problem in one of the forms that programs read, and further files.

use std::path::PathBuf;

use fleetyard_abi::{Capabilities, Capability};
use fleetyard_core::document::{Fault, Value, not_empty, text};
use fleetyard_core::formats::Format;
use fleetyard_core::json::with_hint;
use fleetyard_core::{InputError, shown};
use serde::{Deserialize, Deserializer};

use super::manifest::Options;
use super::template::{Slot, Template};

/// Names of the files of a problem in the scratch folder.
pub(super) const MAP_NAME: &str = "map.map";
pub(super) const SCEN_NAME: &str = "agents.scen";
pub(super) const ROADMAP_NAME: &str = "roadmap.xml";
pub(super) const TASK_NAME: &str = "task.xml";
pub(super) const PROBLEM_NAME: &str = "problem";

/// The input of the solver.
#[derive(Debug, Clone)]
pub(super) struct Input {
    pub(super) problem: ProblemInput,
    /// Files for the solver's settings, by their names in the scratch folder.
    pub(super) files: Vec<(String, Template)>,
}

/// The representation of problems, and their files.
#[derive(Debug, Clone)]
pub(super) enum ProblemInput {
    Grid(GridInput),
    Roadmap(RoadmapInput),
    Plane(PlaneInput),
}

/// Maps on grids.
#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct GridInput {
    #[serde(rename = "map")]
    _map: MapWritten,
    pub(super) scen: Agents,
    pub(super) letters: Letters,
    pub(super) order: Order,
}

#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
enum MapWritten {
    #[default]
    MovingAi,
}

/// Format of starts and goals.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Agents {
    /// A MovingAI scenario.
    #[default]
    MovingAi,
    /// An instance file of pibt2, which names the map and has the seed.
    Pibt2,
    /// An instance of libMultiRobotPlanning in YAML, which has the map in it.
    Libmrp,
}

/// The letters of terrain in a map that the solver reads.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Letters {
    /// `.` and `@` alone.
    #[default]
    Plain,
    All,
}

/// The order of a position's numbers in a scenario.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Order {
    #[default]
    XY,
    /// Against the format.
    RowCol,
}

/// Roadmaps, on which the solver drives at unit speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct RoadmapInput {
    pub(super) files: RoadmapFiles,
    pub(super) unit: Unit,
}

/// Files of roadmaps, starts and goals.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum RoadmapFiles {
    /// GraphML, and a task in XML.
    Ccbs,
    /// Both in one text.
    Psipp,
}

/// The solver's unit of length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Unit {
    /// A metre has so many.
    PerM(f64),
    /// Discs have a radius of so many, whatever the solver is told.
    Radius(f64),
}

/// Problems in the plane.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PlaneInput {
    /// The robots that the solver knows, at least one.
    pub(super) robots: Vec<RobotType>,
}

/// The one form of problems in the plane.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
enum PlaneFile {
    Dynobench,
}

/// A robot that a solver knows by a name: it plans for robots of exactly these numbers.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RobotType {
    #[serde(rename = "type", deserialize_with = "word")]
    pub(super) name: String,
    /// Name of its dynamics in the contract.
    #[serde(deserialize_with = "dynamics")]
    pub(super) dynamics: String,
    /// Length and width, if it is a rectangle.
    #[serde(default)]
    pub(super) rectangle_m: Option<[Size; 2]>,
    /// The radius, if it is a disc.
    #[serde(default)]
    pub(super) disc_m: Option<Size>,
    /// Limits of the numbers of a state after position and heading.
    #[serde(default)]
    pub(super) rates: Vec<Limits>,
    /// Limits of the numbers of a control.
    pub(super) controls: Vec<Limits>,
}

/// A number above 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Size(pub(super) f64);

impl<'de> Deserialize<'de> for Size {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let number = f64::deserialize(deserializer)?;
        if (1e-6..=1e6).contains(&number) {
            return Ok(Self(number));
        }
        let reason = "it is not between 1e-6 and 1e6";
        Err(with_hint(&reason, Some("give a length above 0")))
    }
}

/// Least and largest value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Limits(pub(super) [f64; 2]);

impl<'de> Deserialize<'de> for Limits {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let [least, most] = <[f64; 2]>::deserialize(deserializer)?;
        if least.is_finite() && most.is_finite() && least <= most {
            return Ok(Self([least, most]));
        }
        let reason = "it has limits that are none";
        Err(with_hint(&reason, Some("write [least, most]")))
    }
}

/// A word that needs no quotes in any format.
fn word<'de, D: Deserializer<'de>>(deserializer: D) -> Result<String, D::Error> {
    text(deserializer, "", |text| {
        let fits = |letter: u8| letter.is_ascii_alphanumeric() || matches!(letter, b'_' | b'-');
        if not_empty(text)?.bytes().all(fits) {
            return Ok(text.to_owned());
        }
        let fault = Fault::new(format!("\"{}\" is no type of robots", shown(text)));
        Err(fault.hint("a type has letters, digits, '_' and '-'"))
    })
}

fn dynamics<'de, D: Deserializer<'de>>(deserializer: D) -> Result<String, D::Error> {
    text(deserializer, "", |text| {
        let (name, revision) = not_empty(text)?.rsplit_once('/').unwrap_or_default();
        if name.contains('.') && revision.parse::<u32>().is_ok() {
            return Ok(text.to_owned());
        }
        let fault = Fault::new(format!("\"{}\" is no name of dynamics", shown(text)));
        Err(fault.hint("as in \"fleetyard.unicycle/1\""))
    })
}

impl Default for Input {
    fn default() -> Self {
        Self {
            problem: ProblemInput::Grid(GridInput::default()),
            files: Vec::new(),
        }
    }
}

/// `[input]` of a roadmap.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RoadmapTable {
    roadmap: RoadmapFiles,
    radius: Option<Size>,
    units_per_m: Option<Size>,
}

/// `[input]` of the plane.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PlaneTable {
    #[serde(rename = "plane")]
    _plane: PlaneFile,
    robots: Vec<RobotType>,
}

impl Input {
    pub(super) fn read(table: &Value<'_>, options: &Options<'_>) -> Result<Self, InputError> {
        let mut files: Vec<(String, Template)> = Vec::new();
        if let Some(named) = table.get("files") {
            for (name, value) in named.entries()? {
                let name = name.text(|text| file_name(text, "a file of the input"))?;
                files.push((name, options.template(&value, None)?));
            }
        }
        let rest = table.clone().apart(&["files"]);
        let has = |key| table.get(key).is_some();
        let problem = if has("roadmap") {
            ProblemInput::Roadmap(RoadmapInput::read(&rest)?)
        } else if has("plane") {
            ProblemInput::Plane(PlaneInput::read(&rest)?)
        } else {
            ProblemInput::Grid(GridInput::read(&rest)?)
        };
        Ok(Self { problem, files })
    }
}

impl GridInput {
    fn read(table: &Value<'_>) -> Result<Self, InputError> {
        let input: Self = table.read()?;
        match table.get("order") {
            Some(order) if input.scen != Agents::MovingAi => Err(order
                .error("the order in instances of pibt2 and libMultiRobotPlanning is fixed")
                .hint("remove `order`; it is for scenarios")),
            _ => Ok(input),
        }
    }
}

impl RoadmapInput {
    fn read(table: &Value<'_>) -> Result<Self, InputError> {
        let said: RoadmapTable = table.read()?;
        let unit = match (said.radius, said.units_per_m) {
            (Some(_), Some(_)) => {
                let reason = "`radius` and `units_per_m` both say how long the solver's unit is";
                return Err(table
                    .error_at("units_per_m", reason)
                    .hint("remove one of them"));
            }
            (Some(Size(radius)), None) => Unit::Radius(radius),
            (None, Some(Size(units))) => Unit::PerM(units),
            (None, None) => Unit::PerM(1.0),
        };
        Ok(Self {
            files: said.roadmap,
            unit,
        })
    }
}

impl PlaneInput {
    fn read(table: &Value<'_>) -> Result<Self, InputError> {
        let PlaneTable { robots, .. } = table.read()?;
        let bodies = |robot: &RobotType| {
            u8::from(robot.rectangle_m.is_some()) + u8::from(robot.disc_m.is_some())
        };
        if let Some(robot) = robots.iter().find(|robot| bodies(robot) != 1) {
            let reason = format!("the robot `{}` has no footprint or two", robot.name);
            return Err(table
                .error_at("robots", reason)
                .hint("give it `rectangle_m = [length, width]` or `disc_m = radius`"));
        }
        if robots.is_empty() {
            return Err(table.error_at("robots", "there are no robots"));
        }
        Ok(Self { robots })
    }
}

impl ProblemInput {
    /// The placeholders of its files, each with whether the solver must be told of it.
    pub(super) fn slots(&self) -> &'static [(Slot, bool)] {
        match self {
            Self::Grid(grid) if grid.scen != Agents::MovingAi => {
                &[(Slot::Map, false), (Slot::Scen, true)]
            }
            Self::Grid(_) => &[(Slot::Map, true), (Slot::Scen, true)],
            Self::Roadmap(RoadmapInput {
                files: RoadmapFiles::Ccbs,
                ..
            }) => &[(Slot::Roadmap, true), (Slot::Task, true)],
            Self::Roadmap(_) | Self::Plane(_) => &[(Slot::Problem, true)],
        }
    }

    /// True if a solver of such problems may answer in a format.
    pub(super) fn takes(&self, format: Format) -> bool {
        match self {
            Self::Grid(_) => format.carries_plan() && !format.needs_starts(),
            Self::Roadmap(_) => matches!(
                format,
                Format::RoadmapPlan | Format::Trajectories | Format::CcbsLog | Format::PsippPlan
            ),
            Self::Plane(_) => matches!(format, Format::Trajectories | Format::Dynobench),
        }
    }

    /// Capabilities of every solver of such problems.
    pub(super) fn capabilities(&self) -> Capabilities {
        match self {
            Self::Grid(_) => Capabilities::of(&[Capability::Grid, Capability::Pebble]),
            Self::Roadmap(_) => Capabilities::of(&[Capability::Roadmap, Capability::StopGo]),
            Self::Plane(plane) => {
                let base = Capabilities::of(&[Capability::Continuous, Capability::Dynamics]);
                match plane.robots.len() {
                    1 => base,
                    _ => base.with(Capabilities::of(&[Capability::Heterogeneous])),
                }
            }
        }
    }

    /// Further capabilities that a manifest may claim.
    pub(super) fn claims(&self) -> &'static [Capability] {
        const GRID: [Capability; 6] = [
            Capability::EightConnected,
            Capability::DuplicateGoals,
            Capability::CollidingPlans,
            Capability::KRobust,
            Capability::Deterministic,
            Capability::Threads,
        ];
        const OTHERS: [Capability; 3] = [
            Capability::CollidingPlans,
            Capability::Deterministic,
            Capability::Threads,
        ];
        match self {
            Self::Grid(_) => &GRID,
            Self::Roadmap(_) | Self::Plane(_) => &OTHERS,
        }
    }

    /// Features that a planner lists for the robots of the plane that it knows.
    pub(super) fn features(&self) -> Vec<String> {
        let Self::Plane(plane) = self else {
            return Vec::new();
        };
        let named = plane.robots.iter().map(|robot| &robot.dynamics);
        let mut features: Vec<String> = named.map(|name| format!("dynamics:{name}")).collect();
        features.sort_unstable();
        features.dedup();
        features
    }
}

/// A name in the scratch folder that leads nowhere else, and is none of the problem's files.
pub(super) fn file_name(text: &str, what: &str) -> Result<String, Fault> {
    let text = not_empty(text)?;
    let own = [MAP_NAME, SCEN_NAME, ROADMAP_NAME, TASK_NAME, PROBLEM_NAME];
    let leads = text.contains(['/', '\0']) || matches!(text, "." | "..");
    if !leads && !own.contains(&text) {
        return Ok(text.to_owned());
    }
    let reason = format!("\"{}\" is no name for {what}", shown(text));
    Err(Fault::new(reason).hint("it is a name without folders; the file is in `{scratch}`"))
}

/// The same for the file of the answer.
pub(super) fn answer_file<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Option<PathBuf>, D::Error> {
    text(deserializer, "", |text| {
        let name = file_name(text, "a file of the answer")?;
        Ok(Some(name.into()))
    })
}

//! Every format by its name: what a file is, what it carries, and one way to read
//! and to write them all.

use std::fmt;
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};
use std::sync::{Arc, LazyLock};

use regex::bytes::Regex;

use super::{
    AgentList, CcbsPlaces, LacamHeader, Layout, MapSize, Pibt2Settings, ccbs, dynobench, foreign,
    libmrp, lorr, lsmart, pibt2, planviz, pogema, psipp, read_grid, rhcr, tracker, write_grid,
    write_lacam, write_mapf_visualizer, write_paths_txt,
};
use crate::plan_file::{PLAN_FILE_LIMIT, read_plan_on, write_plan};
use crate::{
    Digest, Grid, GridInstance, GridPlan, InputError, MotionFile, PathEncoding, PlanFile, Roadmap,
    RoadmapPlanFile, Scenario, TrajectoryFile, TrajectoryPlan, load_roadmap, read_file, read_map,
    read_motions, read_roadmap, read_roadmap_plan, read_scen, read_trajectories, unmarked,
    write_map, write_roadmap, write_roadmap_plan, write_scen, write_trajectories,
};

/// Declares the formats in the order in which they are listed.
macro_rules! formats {
    ($($variant:ident, $name:literal, $carries:literal, $about:literal;)*) => {
        /// A file format.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        pub enum Format {
            $(#[doc = $about] $variant,)*
        }

        impl Format {
            /// Every format.
            pub const ALL: &'static [Self] = &[$(Self::$variant,)*];

            /// Its name on the command line.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $name,)*
                }
            }

            /// The format in a line.
            pub fn about(self) -> &'static str {
                match self {
                    $(Self::$variant => $about,)*
                }
            }

            fn letters(self) -> &'static str {
                match self {
                    $(Self::$variant => $carries,)*
                }
            }
        }
    };
}

// m: a map, a: starts and goals, p: a plan on a grid, r: a roadmap, t: a plan in the plane.
formats! {
    Plan, "plan", "p", "plan file of this project, fleetyard.plan/1";
    Map, "map", "m", "MovingAI map, whose cells may have roles";
    Grid, "grid", "m", "map of this project with allowed moves, fleetyard.grid/1";
    Lsmart, "lsmart", "m", "map of LSMART with endpoints and workstations (JSON)";
    Rhcr, "rhcr", "m", "map of RHCR, .map or .grid (only read)";
    Pogema, "pogema", "ma", "map of POGEMA, text or YAML, perhaps with starts and goals (only read)";
    CcbsMap, "ccbs-map", "m", "map of Continuous-CBS, XML (only read)";
    Scen, "scen", "a", "MovingAI scenario";
    CcbsTask, "ccbs-task", "a", "task of Continuous-CBS on a map, XML (only read)";
    Lacam, "lacam", "p", "result of lacam, lacam2, lacam3 and pibt2, (x,y) by time step";
    PathsTxt, "paths-txt", "p", "paths of CBSH2-RTC, EECBS, PBS and MAPF-LNS2, (row,col) by agent";
    MapfVisualizer, "mapf-visualizer", "p", "plan for mapf-visualizer, (x,y) by time step";
    Pibt2, "pibt2", "a", "instance of pibt2";
    Lorr, "lorr", "ma", "instance of the League of Robot Runners (JSON, map, agents, tasks)";
    PlanViz, "planviz", "p", "result of the League of Robot Runners, as PlanViz shows it";
    Libmrp, "libmrp", "ma", "instance of libMultiRobotPlanning, YAML";
    LibmrpSchedule, "libmrp-schedule", "p", "schedule of libMultiRobotPlanning, YAML";
    Tracker, "mapf-tracker", "p", "plans of the MAPF Tracker, CSV (only read)";
    Trajectories, "trajectories", "t", "trajectories of this project, fleetyard.trajectories/1";
    Roadmap, "roadmap", "r", "roadmap of this project, fleetyard.roadmap/1";
    RoadmapPlan, "roadmap-plan", "rt", "plan on a roadmap of this project, fleetyard.roadmap-plan/1";
    CcbsRoadmap, "ccbs-roadmap", "r", "roadmap of Continuous-CBS, GraphML";
    CcbsLog, "ccbs-log", "t", "result of Continuous-CBS, XML (only read)";
    PsippPlan, "psipp-plan", "t", "plan of PSIPP/CTC, text (only read)";
    Dynobench, "dynobench", "t", "result of db-CBS and others in dynobench's YAML (only read)";
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Bytes of a file that decide its format.
const HEAD: usize = 1 << 16;

impl Format {
    /// The format of this name.
    pub fn by_name(name: &str) -> Option<Self> {
        let mut all = Self::ALL.iter().copied();
        all.find(|format| format.name() == name)
    }

    /// True if a file has a map.
    pub fn carries_map(self) -> bool {
        self.letters().contains('m')
    }

    /// True if a file has starts and goals.
    pub fn carries_agents(self) -> bool {
        self.letters().contains('a')
    }

    /// True if a file has a plan on a grid.
    pub fn carries_plan(self) -> bool {
        self.letters().contains('p')
    }

    /// True if a file has a roadmap, or names one.
    pub fn carries_roadmap(self) -> bool {
        self.letters().contains('r')
    }

    /// True if a file has a plan in the plane.
    pub fn carries_trajectories(self) -> bool {
        self.letters().contains('t')
    }

    /// True if files of it are written, and not only read.
    pub fn is_written(self) -> bool {
        !matches!(
            self,
            Self::Rhcr
                | Self::Pogema
                | Self::CcbsMap
                | Self::CcbsTask
                | Self::Tracker
                | Self::CcbsLog
                | Self::PsippPlan
                | Self::Dynobench
        )
    }

    /// True if a file can only be read with the size of its map at hand.
    pub fn needs_map_size(self) -> bool {
        self.carries_plan() && self != Self::Plan
    }

    /// True if a file can only be read with starts at hand.
    pub fn needs_starts(self) -> bool {
        self == Self::Tracker
    }

    /// Reads a plan on a grid in this format, for commands and adapters alike: of so many
    /// agents, or of as many as there are.
    pub fn read_plan(
        self,
        source: &str,
        bytes: &[u8],
        known: Known<'_>,
        agents: Option<usize>,
    ) -> Result<PlanFile, InputError> {
        let known_size = || {
            known.size.ok_or_else(|| {
                let reason =
                    format!("a file in the format {self} does not say how large its map is");
                InputError::new(source, reason).hint("name the map with --map FILE")
            })
        };
        let lines = |layout: Layout| layout.read(source, bytes, known_size()?, agents);
        let plan = match self {
            Self::Plan => return read_plan_on(source, bytes, known.size),
            Self::Lacam => lines(Layout::lacam())?,
            Self::PathsTxt => lines(Layout::paths_txt())?,
            Self::MapfVisualizer => lines(Layout::mapf_visualizer())?,
            Self::LibmrpSchedule => libmrp::read_libmrp_schedule(source, bytes, known_size()?)?,
            Self::PlanViz => planviz::read_planviz(source, bytes, known_size()?)?,
            Self::Tracker => tracker::read_tracker(source, bytes, known, agents.or(known.team))?,
            _ => {
                let reason = format!("{self} is no format of plans on grids");
                return Err(InputError::new(source, reason)
                    .hint("`fleetyard convert --list` says what formats carry"));
            }
        };
        Ok(plan_file(source, plan, known_size()?))
    }

    /// The format of a file: the one that is given, or else what it looks like.
    fn of(path: &Path, bytes: &[u8], given: Option<Self>) -> Result<Self, InputError> {
        let source = path.display().to_string();
        if bytes.trim_ascii().is_empty() {
            return Err(InputError::new(source, "the file is empty"));
        }
        // Whichever format somebody takes it for, by its name or otherwise.
        if let Some(kind) = foreign(bytes) {
            return Err(kind.refused(&source));
        }
        given.or_else(|| Self::guess(path, bytes)).ok_or_else(|| {
            let known: Vec<&str> = Self::ALL.iter().map(|format| format.name()).collect();
            InputError::new(source, "this is in no format that is known")
                .hint(format!("formats are {}", known.join(", ")))
        })
    }

    /// The format of a file, from its content and then its name.
    pub fn guess(path: &Path, bytes: &[u8]) -> Option<Self> {
        static JSON_KEY: LazyLock<Option<Regex>> = LazyLock::new(|| {
            Regex::new(r#""(actionModel|actualPaths|agentFile|taskFile|layout|n_row|n_col)"\s*:"#)
                .ok()
        });
        static LINE: LazyLock<Option<Regex>> = LazyLock::new(|| {
            let lines = "solved=|solution=|map_file=|schedule:|statistics:|map:|agents:|result:";
            Regex::new(&format!(r"(?m)^[{{ ]*({lines})")).ok()
        });
        static STEP: LazyLock<Option<Regex>> = LazyLock::new(|| Regex::new(r"^[0-9]+ *: *\(").ok());
        static HEADER: LazyLock<Option<Regex>> =
            LazyLock::new(|| Regex::new(r"^(?i:type|height|width)[ \t]+[^\s]+\s").ok());
        static RHCR: LazyLock<Option<Regex>> = LazyLock::new(|| {
            Regex::new(r"^(Grid size|[0-9]+ *, *[0-9]+\s*\n[0-9]+\s*\n[0-9]+\s*\n[0-9]+\s*\n)").ok()
        });
        // Rows of a map below a name, or one with an obstacle and nothing else.
        static POGEMA: LazyLock<Option<Regex>> = LazyLock::new(|| {
            let row = r"[ \t]*[.#!@$a-zA-Z]+[ \t\r]*";
            let name = r#"(?:---\s*\n)?(?:#[^\n]*\n)*["']?[^"'\s:][^"':\n]*["']? *: *\|[-+0-9]*\s*\n[ \t]"#;
            let alone = format!(
                r"(?:{row}\n)*[ \t]*[.!@$a-zA-Z]*#[.#!@$a-zA-Z]*[ \t\r]*\n(?:{row}\n)*(?:{row})?$"
            );
            Regex::new(&format!(r"^(?:{name}{row}\n|{alone})")).ok()
        });
        let text = bytes.trim_ascii_start();
        let text = &text[..text.len().min(HEAD)];
        let json = text.strip_prefix(b"{").map(<[u8]>::trim_ascii_start);
        if json.is_some_and(|inside| matches!(inside.first(), Some(b'"' | b'}') | None)) {
            return Some(match (own_format(text), found(&JSON_KEY, text)) {
                (Some(b"trajectories"), _) => Self::Trajectories,
                (Some(b"grid"), _) => Self::Grid,
                (Some(b"roadmap"), _) => Self::Roadmap,
                (Some(b"roadmap-plan"), _) => Self::RoadmapPlan,
                (None, Some(b"agentFile" | b"taskFile")) => Self::Lorr,
                (None, Some(b"layout" | b"n_row" | b"n_col")) => Self::Lsmart,
                (None, Some(_)) => Self::PlanViz,
                _ => Self::Plan,
            });
        }
        if text.starts_with(b"<") {
            return Some(if contains(text, b"<graphml") {
                Self::CcbsRoadmap
            } else if contains(text, b"<grid>") {
                Self::CcbsMap
            } else if contains(text, b"<agent") && !contains(bytes, b"<log") {
                Self::CcbsTask
            } else {
                Self::CcbsLog
            });
        }
        if found(&HEADER, text).is_some() {
            return Some(Self::Map);
        }
        if found(&RHCR, text).is_some() {
            return Some(Self::Rhcr);
        }
        if tracker::is_tracker(text) {
            return Some(Self::Tracker);
        }
        if found(&POGEMA, text).is_some() {
            return Some(Self::Pogema);
        }
        if text.starts_with(b"Agent ") {
            return Some(Self::PathsTxt);
        }
        if found(&STEP, text).is_some() {
            return Some(Self::MapfVisualizer);
        }
        let of_line = match found(&LINE, text) {
            Some(b"solved=" | b"solution=") => Some(Self::Lacam),
            // Results name their map as well.
            Some(b"map_file=") if contains(text, b"\nsol") => Some(Self::Lacam),
            Some(b"map_file=") => Some(Self::Pibt2),
            Some(b"schedule:" | b"statistics:") => Some(Self::LibmrpSchedule),
            Some(b"result:") => Some(Self::Dynobench),
            Some(_) => Some(Self::Libmrp),
            None => None,
        };
        of_line.or_else(|| match path.extension()?.to_str()? {
            "map" => Some(Self::Map),
            "scen" => Some(Self::Scen),
            "json" => Some(Self::Plan),
            "yaml" | "yml" => Some(Self::Libmrp),
            _ => text.starts_with(b"version ").then_some(Self::Scen),
        })
    }
}

/// The part of a text that a pattern picks.
fn found<'a>(pattern: &LazyLock<Option<Regex>>, text: &'a [u8]) -> Option<&'a [u8]> {
    let captures = pattern.as_ref()?.captures(text)?;
    let group = captures.get(1).or_else(|| captures.get(0))?;
    Some(group.as_bytes())
}

/// The word that a JSON file of this project has in its key `format`, if that is near its begin.
pub fn own_format(bytes: &[u8]) -> Option<&[u8]> {
    static OWN: LazyLock<Option<Regex>> =
        LazyLock::new(|| Regex::new(r#""format"\s*:\s*"fleetyard\.([a-z-]+)/"#).ok());
    found(&OWN, &bytes[..bytes.len().min(HEAD)])
}

/// The content of a file with a plan or an instance, and the path by which errors name it. The path
/// `-` is standard input.
fn read_input(path: &Path) -> Result<(PathBuf, Vec<u8>), InputError> {
    if path != Path::new("-") {
        return Ok((path.to_owned(), read_file(path, PLAN_FILE_LIMIT)?));
    }
    let source = "standard input";
    let mut bytes = Vec::new();
    let limit = PLAN_FILE_LIMIT;
    let read = io::stdin().lock().take(limit + 1).read_to_end(&mut bytes);
    match read {
        Err(error) => Err(InputError::new(source, format!("cannot read: {error}"))),
        Ok(length) if length as u64 > limit => {
            let reason = format!("there are more than {limit} bytes");
            Err(InputError::new(source, reason))
        }
        Ok(_) => Ok((source.into(), bytes)),
    }
}

fn contains(text: &[u8], wanted: &[u8]) -> bool {
    text.windows(wanted.len()).any(|window| window == wanted)
}

/// Facts that are known beside a file, which some formats do not say.
#[derive(Debug, Clone, Copy, Default)]
pub struct Known<'a> {
    /// Rows and columns of the map.
    pub size: Option<MapSize>,
    /// Starts and goals.
    pub agents: Option<&'a AgentList>,
    /// The number of agents that is asked for, where a file has plans for several.
    pub team: Option<usize>,
}

impl Known<'_> {
    /// The size of the map alone, if at all.
    pub fn size(size: Option<MapSize>) -> Self {
        Self {
            size,
            ..Self::default()
        }
    }
}

/// The content of a file, in the terms of this crate.
#[derive(Debug, Clone)]
pub struct Contents {
    /// The format of the file.
    pub format: Format,
    /// The map, if it has one.
    pub grid: Option<Arc<Grid>>,
    /// The map's file, if it names one.
    pub map_file: Option<String>,
    /// Starts and goals, if it has them.
    pub agents: Option<AgentList>,
    /// The plan on a grid, if it has one.
    pub plan: Option<PlanFile>,
    /// The roadmap, if it has or names one.
    pub roadmap: Option<Arc<Roadmap>>,
    /// The plan on the roadmap, if it has one; it is among the trajectories too.
    pub roadmap_plan: Option<RoadmapPlanFile>,
    /// The plan in the plane, if it has one.
    pub trajectories: Option<TrajectoryFile>,
    /// Parts of the file that are not kept, for the user.
    pub notes: Vec<String>,
    /// Other files that were read for it.
    pub files: Vec<PathBuf>,
}

impl Contents {
    /// Reads a file, in the format that it is in if none is given.
    ///
    /// The path `-` is standard input.
    pub fn load(path: &Path, format: Option<Format>, known: Known<'_>) -> Result<Self, InputError> {
        let (path, bytes) = read_input(path)?;
        Self::read(&path, &bytes, format, known)
    }

    /// Parses the content of a file; its path is named in errors, and other files that
    /// it names are found from its folder.
    pub fn read(
        path: &Path,
        bytes: &[u8],
        format: Option<Format>,
        known: Known<'_>,
    ) -> Result<Self, InputError> {
        let source = path.display().to_string();
        let source = source.as_str();
        let bytes = unmarked(source, bytes)?;
        let format = Format::of(path, bytes, format)?;
        let mut contents = Self {
            format,
            grid: None,
            map_file: None,
            agents: None,
            plan: None,
            roadmap: None,
            roadmap_plan: None,
            trajectories: None,
            notes: Vec::new(),
            files: Vec::new(),
        };
        if format.carries_plan() {
            let file = format.read_plan(source, bytes, known, None)?;
            contents.map_file = file.map.as_ref().map(|name| format!("{name}.map"));
            contents.plan = Some(file);
            return Ok(contents);
        }
        match format {
            Format::Map => contents.grid = Some(Arc::new(read_map(source, bytes)?)),
            Format::Grid => contents.grid = Some(Arc::new(read_grid(source, bytes)?)),
            Format::Lsmart => {
                let map = lsmart::read(source, bytes)?;
                if map.weights {
                    contents.notes = vec!["costs of moves (weights_matrix) are not kept".into()];
                }
                contents.grid = Some(Arc::new(map.grid));
            }
            Format::Rhcr => {
                let map = rhcr::read(source, bytes)?;
                if map.weights {
                    contents.notes = vec!["costs of moves other than 1 are not kept".into()];
                }
                contents.grid = Some(Arc::new(map.grid));
            }
            Format::Pogema => {
                let (grid, agents) = pogema::read_pogema(source, bytes)?;
                contents.grid = Some(Arc::new(grid));
                contents.agents = agents;
            }
            Format::CcbsMap => {
                contents.grid = Some(Arc::new(ccbs::read_ccbs_map(source, bytes)?));
            }
            Format::CcbsTask => contents.agents = Some(ccbs::read_ccbs_task(source, bytes)?),
            Format::Scen => contents.agents = Some(AgentList::from(&read_scen(source, bytes)?)),
            Format::Pibt2 => contents.agents = Some(pibt2::read_pibt2(source, bytes)?),
            Format::Libmrp => {
                let (grid, agents) = libmrp::read_libmrp(source, bytes)?;
                contents.grid = Some(Arc::new(grid));
                contents.agents = Some(agents);
            }
            Format::Lorr => {
                let folder = path.parent().unwrap_or(Path::new(""));
                let league = lorr::read_lorr(source, bytes, folder)?;
                contents.notes = vec![format!(
                    "of {} tasks with {} errands, one errand is the goal of each of {} agents{}; \
                     how the League turns and delays its robots is not kept",
                    league.tasks,
                    league.errands,
                    league.agents.agents.len(),
                    match league.passed_over {
                        0 => String::new(),
                        tasks => format!(", {tasks} tasks passed over"),
                    }
                )];
                contents.grid = Some(Arc::new(league.grid));
                contents.agents = Some(league.agents);
                contents.files = league.files;
            }
            Format::Trajectories => {
                contents.trajectories = Some(read_trajectories(source, bytes)?);
            }
            Format::Roadmap => contents.roadmap = Some(Arc::new(read_roadmap(source, bytes)?)),
            Format::RoadmapPlan => {
                let file = read_roadmap_plan(source, bytes)?;
                let path = file.roadmap_path(path.parent().unwrap_or(Path::new("")))?;
                let roadmap = load_roadmap(&path)?;
                contents.trajectories = Some(file.to_trajectories(&roadmap)?);
                contents.roadmap = Some(Arc::new(roadmap));
                contents.roadmap_plan = Some(file);
                contents.files = vec![path];
            }
            Format::CcbsRoadmap => {
                contents.roadmap = Some(Arc::new(ccbs::read_ccbs_roadmap(source, bytes)?));
            }
            Format::CcbsLog => {
                let places = known.size.map_or(CcbsPlaces::Unknown, CcbsPlaces::Grid);
                let plan = ccbs::read_ccbs_log(source, bytes, places)?;
                contents.trajectories = Some(trajectory_file(source, plan));
            }
            Format::PsippPlan => {
                let plan = psipp::read_psipp_plan(source, bytes)?;
                contents.trajectories = Some(trajectory_file(source, plan));
            }
            Format::Dynobench => {
                let plan = dynobench::read_dynobench(source, bytes)?;
                contents.notes = vec![format!(
                    "states are taken to be {} s apart, as in the models of dynobench; \
                     of each, position and heading are kept",
                    1.0 / dynobench::DYNOBENCH_STATES_PER_S
                )];
                contents.trajectories = Some(trajectory_file(source, plan));
            }
            Format::Plan
            | Format::Lacam
            | Format::PathsTxt
            | Format::MapfVisualizer
            | Format::LibmrpSchedule
            | Format::PlanViz
            | Format::Tracker => {}
        }
        if contents.map_file.is_none() {
            let list = contents.agents.as_ref();
            contents.map_file = list.and_then(|list| list.map_file.clone());
        }
        Ok(contents)
    }

    /// The format that a file of this name is meant to be in, for who writes what this one says;
    /// `agents` is whether it is written with starts and goals of another file.
    pub fn format_for(&self, path: &Path, agents: bool) -> Option<Format> {
        let grid = self.plan.is_some();
        let plane = self.trajectories.is_some();
        let map_alone = self.grid.is_some() && self.agents.is_none() && !agents;
        let has_masks = self.grid.as_ref().is_some_and(|grid| grid.has_move_masks());
        match path.extension()?.to_str()? {
            "map" if has_masks => Some(Format::Grid),
            "map" => Some(Format::Map),
            "scen" => Some(Format::Scen),
            "json" if grid => Some(Format::Plan),
            "json" if self.roadmap_plan.is_some() => Some(Format::RoadmapPlan),
            "json" if plane => Some(Format::Trajectories),
            "json" if self.roadmap.is_some() => Some(Format::Roadmap),
            "json" if map_alone && has_masks => Some(Format::Grid),
            "json" if map_alone => Some(Format::Lsmart),
            "json" => Some(Format::Lorr),
            "yaml" | "yml" if grid => Some(Format::LibmrpSchedule),
            "yaml" | "yml" if !plane && self.roadmap.is_none() => Some(Format::Libmrp),
            "xml" | "graphml" if self.roadmap.is_some() => Some(Format::CcbsRoadmap),
            _ => None,
        }
    }

    /// The formats that can say what this file says, perhaps with a map or goals from others.
    pub fn formats(&self) -> impl Iterator<Item = Format> {
        let (grid, plane) = (self.plan.is_some(), self.trajectories.is_some());
        let roadmap = self.roadmap.is_some();
        let written = Format::ALL
            .iter()
            .copied()
            .filter(|format| format.is_written());
        written.filter(move |format| match format {
            Format::Trajectories => grid || plane,
            format if grid => format.carries_plan(),
            Format::RoadmapPlan => plane && roadmap,
            format if roadmap => format.carries_roadmap(),
            format => !plane && (format.carries_map() || format.carries_agents()),
        })
    }
}

fn plan_file(source: &str, plan: GridPlan, size: MapSize) -> PlanFile {
    PlanFile {
        source: source.to_owned(),
        planner: None,
        instance_digest: None,
        plan_digest: None,
        map: None,
        rows: size.rows,
        cols: size.cols,
        encoding: PathEncoding::default(),
        plan,
    }
}

fn trajectory_file(source: &str, plan: TrajectoryPlan) -> TrajectoryFile {
    TrajectoryFile {
        source: source.to_owned(),
        planner: None,
        plan_digest: None,
        plan,
    }
}

/// A plan of whatever kind.
#[derive(Debug, Clone, PartialEq)]
pub enum AnyPlan {
    /// From cell to cell.
    Grid(PlanFile),
    /// In the plane.
    Trajectories(TrajectoryFile),
}

impl AnyPlan {
    /// The plan, if it is one on a grid.
    pub fn into_grid(self) -> Result<PlanFile, InputError> {
        match self {
            Self::Grid(file) => Ok(file),
            Self::Trajectories(file) => Err(InputError::new(
                file.source,
                "this is a plan in the plane, and here one on a grid is needed",
            )
            .hint("`fleetyard convert --list` says which formats have plans on grids")),
        }
    }
}

/// Reads a plan in whatever format.
pub fn load_any_plan(
    path: &Path,
    format: Option<Format>,
    known: Known<'_>,
) -> Result<AnyPlan, InputError> {
    load_plan_and_roadmap(path, format, known).map(|(plan, _)| plan)
}

/// The same with the roadmap that the plan goes along, if its file names one.
pub fn load_plan_and_roadmap(
    path: &Path,
    format: Option<Format>,
    known: Known<'_>,
) -> Result<(AnyPlan, Option<Arc<Roadmap>>), InputError> {
    let contents = Contents::load(path, format, known)?;
    let plan = contents.plan.map(AnyPlan::Grid);
    let plan = plan.or(contents.trajectories.map(AnyPlan::Trajectories));
    let plan = plan.ok_or_else(|| no_plan(path, contents.format))?;
    Ok((plan, contents.roadmap))
}

fn no_plan(path: &Path, format: Format) -> InputError {
    let reason = format!("this is no plan but {format}: {}", format.about());
    InputError::new(path.display().to_string(), reason)
        .hint("name a file with paths; `fleetyard convert --list` lists the formats")
}

/// A file with a plan, of which it is known of what kind it is.
#[derive(Debug, Clone)]
pub struct UnreadPlan {
    path: PathBuf,
    bytes: Vec<u8>,
    format: Format,
}

impl UnreadPlan {
    /// Reads the file, in the format that it is in if none is given. The path `-` is standard input.
    pub fn load(path: &Path, format: Option<Format>) -> Result<Self, InputError> {
        let (path, bytes) = read_input(path)?;
        Self::new(path, bytes, format)
    }

    /// The content of a file that was read; its path is named in errors, and other files that it names
    /// are found from its folder.
    pub fn new(
        path: PathBuf,
        mut bytes: Vec<u8>,
        format: Option<Format>,
    ) -> Result<Self, InputError> {
        let mark = bytes.len() - unmarked(&path.display().to_string(), &bytes)?.len();
        bytes.drain(..mark);
        let format = Format::of(&path, &bytes, format)?;
        if !(format.carries_plan() || format.carries_trajectories()) {
            return Err(no_plan(&path, format));
        }
        Ok(Self {
            path,
            bytes,
            format,
        })
    }

    /// The format of the file.
    pub fn format(&self) -> Format {
        self.format
    }

    /// The file, for error messages.
    pub fn source(&self) -> String {
        self.path.display().to_string()
    }

    /// The plan on a grid of this size; an error if it is of another kind.
    pub fn grid(&self, size: MapSize) -> Result<PlanFile, InputError> {
        let format = self.format;
        format.read_plan(&self.source(), &self.bytes, Known::size(Some(size)), None)
    }

    /// The plan on a roadmap, without its roadmap; an error if it is of another kind.
    pub fn roadmap(&self) -> Result<RoadmapPlanFile, InputError> {
        read_roadmap_plan(&self.source(), &self.bytes)
    }

    /// The plan in the plane; an error if it is on a grid.
    pub fn trajectories(&self) -> Result<TrajectoryFile, InputError> {
        let contents =
            Contents::read(&self.path, &self.bytes, Some(self.format), Known::default())?;
        let trajectories = contents.trajectories;
        trajectories.ok_or_else(|| no_plan(&self.path, self.format))
    }

    /// The same of a plan that may have controls alone.
    pub fn motions(&self) -> Result<MotionFile, InputError> {
        match self.format {
            Format::Trajectories => read_motions(&self.source(), &self.bytes),
            _ => self.trajectories().map(MotionFile::Paths),
        }
    }
}

/// Size and duration of cells and steps in the plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    /// Side of a cell in metres.
    pub cell_size_m: f64,
    /// Duration of a step in seconds.
    pub step_s: f64,
}

impl Default for Scale {
    fn default() -> Self {
        Self {
            cell_size_m: 1.0,
            step_s: 1.0,
        }
    }
}

/// Parts of a file that is to be written.
#[derive(Debug, Clone, Default)]
pub struct Parts {
    /// The map.
    pub grid: Option<Arc<Grid>>,
    /// The map's file, as files are to name it.
    pub map_file: Option<String>,
    /// Map, starts and goals.
    pub instance: Option<GridInstance>,
    /// The plan on a grid.
    pub plan: Option<PlanFile>,
    /// The roadmap.
    pub roadmap: Option<Arc<Roadmap>>,
    /// The plan on the roadmap.
    pub roadmap_plan: Option<RoadmapPlanFile>,
    /// The plan in the plane.
    pub trajectories: Option<TrajectoryFile>,
    /// The scale by which a plan on a grid becomes one in the plane.
    pub scale: Scale,
    /// The lengths of shortest paths in a scenario.
    pub lengths: Lengths,
}

/// Lengths of shortest paths, which scenarios have per agent and nothing else needs.
#[derive(Debug, Clone, Default, PartialEq)]
pub enum Lengths {
    /// They are written as 0.
    #[default]
    Unknown,
    /// Those of the agents, in their order.
    Known(Vec<f64>),
    /// They are searched for, which takes a while for many agents on large maps.
    Searched,
}

/// The content of a file, and of those that belong to it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Written {
    /// The file.
    pub bytes: Vec<u8>,
    /// Files that it names, by their names in its folder.
    pub others: Vec<(String, Vec<u8>)>,
}

impl Parts {
    /// The plan in the plane, which one on a grid can become.
    fn trajectories(&self) -> Result<TrajectoryFile, InputError> {
        if let Some(file) = &self.trajectories {
            return Ok(file.clone());
        }
        let lacks = |what: &str, hint: &str| {
            let reason = format!("needs {what}, and nothing says it");
            InputError::new(Format::Trajectories.name(), reason).hint(hint)
        };
        let file = self.plan.as_ref();
        let file = file.ok_or_else(|| lacks("a plan", "convert a file with paths"))?;
        let grid = self.grid.as_ref();
        let grid = grid.ok_or_else(|| lacks("a map", "name it with --map FILE"))?;
        let Scale {
            cell_size_m,
            step_s,
        } = self.scale;
        let plan = TrajectoryPlan::from_grid(&file.plan, grid, cell_size_m, step_s)
            .map_err(|error| InputError::new(file.source.as_str(), error.to_string()))?;
        let planner = file.planner.clone();
        Ok(TrajectoryFile {
            planner,
            ..trajectory_file(&file.source, plan)
        })
    }

    /// The content of a file in a format. `name` is that of the file without its
    /// extension, after which others are named that belong to it.
    ///
    /// It is an error if something is missing that the format needs, and if the format
    /// cannot say something.
    pub fn write(&self, format: Format, name: &str) -> Result<Written, InputError> {
        let lacks = |what: &str, hint: &str| {
            let reason = format!("needs {what}, and nothing says it");
            InputError::new(format.name(), reason).hint(hint)
        };
        let instance = || {
            self.instance.as_ref().ok_or_else(|| match &self.grid {
                None => lacks(
                    "a map, starts and goals",
                    "name them with --map FILE and --scen FILE",
                ),
                Some(_) => lacks("starts and goals", "name a scenario with --scen FILE"),
            })
        };
        let plan = || {
            let plan = self.plan.as_ref();
            plan.ok_or_else(|| lacks("a plan", "convert a file with paths"))
        };
        let grid = || {
            let grid = self.grid.as_deref();
            grid.ok_or_else(|| lacks("a map", "name it with --map FILE"))
        };
        let roadmap = || {
            let roadmap = self.roadmap.as_deref();
            roadmap.ok_or_else(|| lacks("a roadmap", "convert a file with vertices and edges"))
        };
        let map_file = match (&self.map_file, &self.grid) {
            (Some(name), _) => Some(name.clone()),
            (None, Some(grid)) => Some(format!("{}.map", grid.name())),
            (None, None) => None,
        };
        let has_masks = self.grid.as_ref().is_some_and(|grid| grid.has_move_masks());
        if has_masks && format.carries_map() && format != Format::Grid {
            let reason =
                "the map allows fewer moves than its terrain, which this format cannot say";
            return Err(InputError::new(format.name(), reason).hint("write --to grid instead"));
        }
        let mut others = Vec::new();
        let bytes = match format {
            Format::Map => write_map(grid()?),
            Format::Grid => write_grid(grid()?),
            Format::Lsmart => lsmart::write_lsmart(grid()?),
            Format::Scen => {
                let instance = instance()?;
                let map_file = map_file.unwrap_or_default();
                let grid = instance.grid();
                let with = |lengths: &mut dyn Iterator<Item = f64>| {
                    Scenario::with_lengths(grid, &map_file, pairs(instance).zip(lengths))
                };
                write_scen(&match &self.lengths {
                    Lengths::Searched => Scenario::of(grid, &map_file, pairs(instance)),
                    Lengths::Known(lengths) => with(&mut lengths.iter().copied()),
                    Lengths::Unknown => with(&mut std::iter::repeat(0.0)),
                })
            }
            Format::Plan => {
                let mut file = plan()?.clone();
                file.plan_digest = Some(Digest::of_plan(&file.plan));
                if let Some(instance) = &self.instance {
                    file.check_for(instance)?;
                    file.instance_digest = Some(instance.digest());
                }
                if let Some(grid) = &self.grid {
                    file.map = Some(grid.name().to_owned());
                }
                write_plan(&file)
            }
            Format::Lacam => {
                let file = plan()?;
                let header = LacamHeader {
                    map_file: map_file.as_deref(),
                    starts: self.instance.as_ref().map(GridInstance::starts),
                    goals: self.instance.as_ref().map(GridInstance::goals),
                };
                write_lacam(&header, &file.plan, size(file))?
            }
            Format::Trajectories => {
                let mut file = self.trajectories()?;
                file.plan_digest = Some(file.plan.digest());
                write_trajectories(&file)
            }
            Format::Roadmap => write_roadmap(roadmap()?),
            Format::CcbsRoadmap => ccbs::write_ccbs_roadmap(roadmap()?),
            Format::RoadmapPlan => {
                let plan = self.roadmap_plan.as_ref();
                let plan = plan.ok_or_else(|| {
                    lacks(
                        "a plan on a roadmap",
                        "convert a file with visits to vertices",
                    )
                })?;
                let others_name = format!("{name}.roadmap.json");
                let mut file =
                    RoadmapPlanFile::new(roadmap()?, Some(others_name.clone()), plan.plan.clone());
                file.planner.clone_from(&plan.planner);
                others.push((others_name, write_roadmap(roadmap()?)));
                write_roadmap_plan(&file)
            }
            Format::Rhcr
            | Format::Pogema
            | Format::CcbsMap
            | Format::CcbsTask
            | Format::Tracker
            | Format::CcbsLog
            | Format::PsippPlan
            | Format::Dynobench => {
                let instead = match format {
                    Format::CcbsTask => Format::Scen,
                    Format::Tracker => Format::Plan,
                    format if format.carries_map() => Format::Map,
                    _ => Format::Trajectories,
                };
                let reason = "files of this format are read and not written";
                return Err(InputError::new(format.name(), reason)
                    .hint(format!("write --to {instead} instead")));
            }
            Format::PathsTxt => write_paths_txt(&plan()?.plan, size(plan()?))?,
            Format::MapfVisualizer => write_mapf_visualizer(&plan()?.plan, size(plan()?))?,
            Format::LibmrpSchedule => libmrp::write_libmrp_schedule(&plan()?.plan, size(plan()?))?,
            Format::PlanViz => {
                let file = plan()?;
                planviz::write_planviz(&file.plan, instance()?.goals(), size(file))?
            }
            Format::Pibt2 => {
                let instance = instance()?;
                pibt2::write_pibt2(
                    &map_file.unwrap_or_default(),
                    grid_size(instance.grid()),
                    instance.starts(),
                    instance.goals(),
                    &Pibt2Settings::default(),
                )
            }
            Format::Libmrp => {
                let instance = instance()?;
                libmrp::write_libmrp(instance.grid(), instance.starts(), instance.goals())
            }
            Format::Lorr => {
                let instance = instance()?;
                let (starts, goals) = (instance.starts(), instance.goals());
                let [first, rest @ ..] = lorr::write_lorr(name, instance.grid(), starts, goals);
                others.extend(rest);
                first.1
            }
        };
        Ok(Written { bytes, others })
    }
}

fn pairs(instance: &GridInstance) -> impl Iterator<Item = (u32, u32)> {
    let goals = instance.goals().iter().copied();
    instance.starts().iter().copied().zip(goals)
}

fn size(file: &PlanFile) -> MapSize {
    MapSize {
        rows: file.rows,
        cols: file.cols,
    }
}

/// Rows and columns of a map.
pub fn grid_size(grid: &Grid) -> MapSize {
    MapSize {
        rows: grid.rows(),
        cols: grid.cols(),
    }
}

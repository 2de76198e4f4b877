//! Roadmaps and results of Continuous-CBS,
//! <https://github.com/PathPlanning/Continuous-CBS>, in XML.
//!
//! A roadmap is GraphML:
//!
//! ```xml
//! <graphml>
//!   <graph edgedefault="directed">
//!     <node id="n0"><data key="key0">70,182</data></node>
//!     <node id="n1"><data key="key0">68,55</data></node>
//!     <edge source="n0" target="n1"/>
//!   </graph>
//! </graphml>
//! ```
//!
//! The first `data` of a node is its position. Edges are driven at unit speed, so that
//! the weights that some files give them mean nothing and are not kept.
//!
//! A result is the file of the task with a `log` in it, which has per agent the sections
//! of its path, each from one position to another in a duration:
//!
//! ```xml
//! <root>
//!   <agent start_id="0" goal_id="1"/>
//!   <log>
//!     <agent number="0">
//!       <path duration="2">
//!         <section number="0" start_i="0" start_j="0" goal_i="2" goal_j="0" duration="2"/>
//!       </path>
//!     </agent>
//!   </log>
//! </root>
//! ```
//!
//! On a roadmap `i` and `j` are x and y. On a grid, whose tasks name cells and not
//! vertices, they are row and column.
//!
//! A map of a grid has rows of 0 (free) and 1 (not free), and a task on it starts and goals:
//!
//! ```xml
//! <root><map><width>3</width><height>1</height><grid><row>0 1 0</row></grid></map></root>
//! <root><agent start_i="0" start_j="0" goal_i="0" goal_j="2"/></root>
//! ```

use std::collections::HashMap;
use std::fmt::Write as _;

use roxmltree::{Attribute, Document, Node};

use super::pibt2::whole_number;
use super::{AgentEntry, AgentList, MapSize};
use crate::files::{quote, stem};
use crate::json::push_number;
use crate::path_list::PLAN_MAX_AGENTS;
use crate::{Grid, InputError, Knot, Roadmap, TrajectoryPlan};

/// The largest XML file that is read, in bytes: it is held as a tree of several times its
/// size.
const XML_LIMIT: usize = 1 << 28;

/// A document with the name of its file.
struct Xml<'a> {
    source: &'a str,
    document: Document<'a>,
}

impl<'a> Xml<'a> {
    fn parse(source: &'a str, bytes: &'a [u8]) -> Result<Self, InputError> {
        if bytes.len() > XML_LIMIT {
            let reason = format!("the file is larger than the limit of {XML_LIMIT} bytes");
            return Err(InputError::new(source, reason));
        }
        let text = std::str::from_utf8(bytes).map_err(|error| {
            let before = &bytes[..error.valid_up_to()];
            let line = before.split(|byte| *byte == b'\n').count();
            InputError::new(source, "the file is not UTF-8 text").at_line(line as u64)
        })?;
        let document = Document::parse(text).map_err(|error| {
            let place = error.pos();
            let whole = error.to_string();
            let ending = format!(" at {}:{}", place.row, place.col);
            let reason = whole.strip_suffix(&ending).unwrap_or(&whole);
            let reason = reason.replace(char::is_control, " ");
            let reason: String = reason.chars().take(100).collect();
            let line = u64::from(place.row).max(1);
            InputError::new(source, format!("this is not XML: {reason}"))
                .at(line, u64::from(place.col).max(1))
        })?;
        Ok(Self { source, document })
    }

    /// An error at a byte of the text.
    fn error_at(&self, byte: usize, reason: impl Into<String>) -> InputError {
        let place = self.document.text_pos_at(byte);
        InputError::new(self.source, reason).at(u64::from(place.row), u64::from(place.col))
    }

    fn error(&self, node: Node<'_, '_>, reason: impl Into<String>) -> InputError {
        self.error_at(node.range().start, reason)
    }

    /// The root, which must have this name.
    fn root(&self, name: &str) -> Result<Node<'_, 'a>, InputError> {
        let root = self.document.root_element();
        if root.tag_name().name() == name {
            return Ok(root);
        }
        let found = quote(root.tag_name().name().as_bytes());
        Err(self.error(
            root,
            format!("expected the element '{name}', found {found}"),
        ))
    }

    fn attribute<'n>(
        &self,
        node: Node<'n, 'a>,
        name: &str,
    ) -> Result<Attribute<'n, 'a>, InputError> {
        let found = node.attribute_node(name);
        found.ok_or_else(|| {
            let element = node.tag_name().name();
            self.error(node, format!("the {element} has no {name}"))
        })
    }

    fn number(&self, node: Node<'_, 'a>, name: &str) -> Result<f64, InputError> {
        let found = self.attribute(node, name)?;
        self.parse_number(found.range_value().start, name, found.value())
    }

    fn parse_number(&self, byte: usize, what: &str, text: &str) -> Result<f64, InputError> {
        let most = TrajectoryPlan::LARGEST;
        let shown = quote(text.as_bytes());
        match text.trim().parse::<f64>() {
            Ok(value) if value.abs() <= most => Ok(value),
            Ok(_) => {
                let reason = format!("{what} is {shown}, not finite or beyond ±{most:e}");
                Err(self.error_at(byte, reason))
            }
            Err(_) => Err(self.error_at(byte, format!("{what} is {shown}, not a number"))),
        }
    }
}

/// The children of a node that are elements of this name.
fn children<'a, 'input>(
    node: Node<'a, 'input>,
    name: &'static str,
) -> impl Iterator<Item = Node<'a, 'input>> {
    node.children()
        .filter(move |child| child.tag_name().name() == name)
}

/// Parses a roadmap of Continuous-CBS. `source` is named in errors.
pub fn read_ccbs_roadmap(source: &str, bytes: &[u8]) -> Result<Roadmap, InputError> {
    const HINT: &str = "a node's first data is its position, written x,y";
    let xml = Xml::parse(source, bytes)?;
    let root = xml.root("graphml")?;
    let graph = children(root, "graph")
        .next()
        .ok_or_else(|| xml.error(root, "there is no element 'graph'"))?;
    let (mut x_m, mut y_m) = (Vec::new(), Vec::new());
    let mut vertices = HashMap::new();
    for node in children(graph, "node") {
        let name = xml.attribute(node, "id")?.value();
        if vertices.insert(name, x_m.len() as u32).is_some() {
            let reason = format!("there is another node {}", quote(name.as_bytes()));
            return Err(xml.error(node, reason));
        }
        let data = children(node, "data").next();
        let text = data.and_then(|data| data.children().find(Node::is_text));
        let place = text.or(data).unwrap_or(node).range().start;
        let written = text.and_then(|text| text.text()).unwrap_or_default();
        let Some((x, y)) = written.split_once(',') else {
            let reason = format!("the node has no position but {}", quote(written.as_bytes()));
            return Err(xml.error_at(place, reason).hint(HINT));
        };
        x_m.push(xml.parse_number(place, "x", x)?);
        y_m.push(xml.parse_number(place, "y", y)?);
        if x_m.len() > Roadmap::MAX_VERTICES {
            let reason = format!("there are more than {} nodes", Roadmap::MAX_VERTICES);
            return Err(xml.error(node, reason));
        }
    }
    let directed = graph.attribute("edgedefault") != Some("undirected");
    let mut edges = Vec::new();
    for edge in children(graph, "edge") {
        let vertex = |end: &str| {
            let name = xml.attribute(edge, end)?.value();
            vertices.get(name).copied().ok_or_else(|| {
                let reason = format!("the {end} {} is no node", quote(name.as_bytes()));
                xml.error(edge, reason)
            })
        };
        let (from, to) = (vertex("source")?, vertex("target")?);
        if from == to {
            return Err(xml.error(edge, "the edge goes from a node to itself"));
        }
        edges.push((from, to));
        let one_way = match edge.attribute("directed") {
            Some(written) => written != "false",
            None => directed,
        };
        if !one_way {
            edges.push((to, from));
        }
    }
    Roadmap::new(x_m, y_m, edges).map_err(|error| xml.error(graph, error.to_string()))
}

/// Parses a map of Continuous-CBS, which is a grid. `source` is named in errors, and its stem becomes
/// the map's name.
pub fn read_ccbs_map(source: &str, bytes: &[u8]) -> Result<Grid, InputError> {
    let xml = Xml::parse(source, bytes)?;
    let root = xml.root("root")?;
    let within = |node, name: &'static str| {
        let found = children(node, name).next();
        found.ok_or_else(|| xml.error(node, format!("there is no element '{name}'")))
    };
    let map = within(root, "map")?;
    let grid = within(map, "grid")?;
    let mut terrain = Vec::new();
    let (mut rows, mut cols) = (0, 0);
    for row in children(grid, "row") {
        let before = terrain.len();
        for word in row.text().unwrap_or_default().split_whitespace() {
            terrain.push(match word {
                "0" => b'.',
                "1" => b'@',
                other => {
                    let reason = format!("a cell is {}", quote(other.as_bytes()));
                    return Err(xml
                        .error(row, reason)
                        .hint("a cell is 0 (free) or 1 (not free)"));
                }
            });
        }
        let found = terrain.len() - before;
        if rows == 0 {
            cols = found;
        } else if found != cols {
            let reason = format!("the row has {found} cells, but the first one has {cols}");
            return Err(xml.error(row, reason));
        }
        rows += 1;
    }
    for (name, found) in [("width", cols), ("height", rows)] {
        let Some(said) = children(map, name).next() else {
            continue;
        };
        let text = said.text().unwrap_or_default().trim();
        if text.parse() != Ok(found) {
            let reason = format!(
                "the {name} is {}, but that of the grid {found}",
                quote(text.as_bytes())
            );
            return Err(xml.error(said, reason));
        }
    }
    Grid::new(stem(source), rows as u32, cols as u32, terrain)
        .map_err(|error| xml.error(grid, error.reason).maybe_hint(error.hint))
}

/// Parses a task of Continuous-CBS on a grid. `source` is named in errors. A task on a roadmap is an
/// error that says what to do.
pub fn read_ccbs_task(source: &str, bytes: &[u8]) -> Result<AgentList, InputError> {
    let xml = Xml::parse(source, bytes)?;
    let root = xml.root("root")?;
    let mut agents = Vec::new();
    for node in children(root, "agent") {
        if node.has_attribute("start_id") {
            let reason = "this is a task of Continuous-CBS on a roadmap, which is not read";
            return Err(xml.error(node, reason).hint(
                "convert its roadmap.xml to NAME.roadmap.json, and write a task file with the positions of \
                 these vertices (docs/worlds.md#task-files); `fleetyard run --task` plans it on the roadmap",
            ));
        }
        let number = |name: &str| {
            let found = xml.attribute(node, name)?;
            whole_number(found.value().trim()).ok_or_else(|| {
                let value = quote(found.value().as_bytes());
                let reason = format!("{name} is {value}, not a whole number of 0 or more");
                xml.error_at(found.range_value().start, reason)
            })
        };
        let start = (number("start_i")?, number("start_j")?);
        let goal = (number("goal_i")?, number("goal_j")?);
        let place = xml.document.text_pos_at(node.range().start);
        agents.push(AgentEntry::new(u64::from(place.row), start, goal));
        if agents.len() > PLAN_MAX_AGENTS {
            return Err(xml.error(node, format!("more than {PLAN_MAX_AGENTS} agents")));
        }
    }
    if agents.is_empty() {
        return Err(xml.error(root, "there are no agents"));
    }
    Ok(AgentList {
        source: source.to_owned(),
        map_file: None,
        agents,
    })
}

/// The content of a roadmap for Continuous-CBS. It takes the number in a node's
/// identifier for the node's place in the list, so that nodes are named after theirs.
pub fn write_ccbs_roadmap(roadmap: &Roadmap) -> Vec<u8> {
    let mut text = String::from(concat!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n",
        "<graphml xmlns=\"http://graphml.graphdrawing.org/xmlns\">\n",
        "  <key id=\"key0\" for=\"node\" attr.name=\"coords\" attr.type=\"string\"/>\n",
        "  <graph id=\"G\" edgedefault=\"directed\">\n",
    ));
    text.reserve(80 * roadmap.vertices() + 56 * roadmap.edge_count());
    for vertex in 0..roadmap.vertices() as u32 {
        let (x, y) = roadmap.position_m(vertex);
        // Writing to a string cannot fail.
        let _ = write!(text, "    <node id=\"n{vertex}\"><data key=\"key0\">");
        push_number(&mut text, x);
        text.push(',');
        push_number(&mut text, y);
        text.push_str("</data></node>\n");
    }
    for (number, (from, to)) in roadmap.edges().enumerate() {
        let _ = writeln!(
            text,
            "    <edge id=\"e{number}\" source=\"n{from}\" target=\"n{to}\"/>"
        );
    }
    text.push_str("  </graph>\n</graphml>\n");
    text.into_bytes()
}

/// The content of a task for Continuous-CBS: start and goal of every agent as vertices.
pub fn write_ccbs_task(starts: &[u32], goals: &[u32]) -> Vec<u8> {
    let mut text = String::from("<?xml version=\"1.0\" ?>\n<root>\n");
    for (start, goal) in starts.iter().zip(goals) {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "    <agent start_id=\"{start}\" goal_id=\"{goal}\"/>");
    }
    text.push_str("</root>\n");
    text.into_bytes()
}

/// The knowledge of a result's places beside the result.
#[derive(Debug, Clone, Copy, Default)]
pub enum CcbsPlaces<'a> {
    /// None: places are points of the plane, and an agent at rest is in none.
    #[default]
    Unknown,
    /// The size of the map, if the result is on a grid.
    Grid(MapSize),
    /// The roadmap that the program was given.
    Roadmap(&'a Roadmap),
}

/// The space that a result is on.
enum On<'a> {
    /// A roadmap, which may be at hand.
    Roadmap(Option<&'a Roadmap>),
    /// A grid with cells of a metre.
    Grid(MapSize),
}

/// Parses a result of Continuous-CBS. `source` is named in errors. A result on a grid does not say
/// how large the map is, and one on a roadmap not where an agent is that never moves.
///
/// A result without paths for all agents is an error; whether the paths are any good is
/// not looked at: after its time limit the program writes paths that collide.
pub fn read_ccbs_log(
    source: &str,
    bytes: &[u8],
    places: CcbsPlaces<'_>,
) -> Result<TrajectoryPlan, InputError> {
    let xml = Xml::parse(source, bytes)?;
    let root = xml.root("root")?;
    let log = children(root, "log").next().ok_or_else(|| {
        xml.error(root, "there is no element 'log'")
            .hint("this is a task; the program writes its result to NAME_log.xml")
    })?;
    let tasks: Vec<Node<'_, '_>> = children(root, "agent").collect();
    let Some(first) = tasks.first() else {
        return Err(xml.error(root, "there are no agents"));
    };
    let on = match (first.has_attribute("start_id"), places) {
        (true, CcbsPlaces::Roadmap(roadmap)) => On::Roadmap(Some(roadmap)),
        (true, _) => On::Roadmap(None),
        (false, CcbsPlaces::Grid(size)) => On::Grid(size),
        (false, _) => {
            let reason = "a result on a grid does not say how large the map is";
            return Err(xml
                .error(*first, reason)
                .hint("name the map with --map FILE"));
        }
    };
    let agents: Vec<Node<'_, '_>> = children(log, "agent").collect();
    if agents.len() != tasks.len() || agents.len() > PLAN_MAX_AGENTS {
        let reason = format!(
            "there are paths for {} of {} agents",
            agents.len(),
            tasks.len()
        );
        return Err(xml.error(log, reason).hint("the program found no plan"));
    }
    let mut plan = TrajectoryPlan::with_capacity(agents.len(), 0);
    for (agent, (node, task)) in agents.into_iter().zip(tasks).enumerate() {
        let number = xml.attribute(node, "number")?.value();
        if number.parse() != Ok(agent) {
            let found = quote(number.as_bytes());
            return Err(xml.error(node, format!("this is agent {found}, not {agent}")));
        }
        let path = children(node, "path").next();
        let path = path.ok_or_else(|| xml.error(node, "the agent has no path"))?;
        read_path(&xml, &on, task, path, &mut plan)?;
    }
    Ok(plan)
}

fn read_path<'a>(
    xml: &Xml<'a>,
    on: &On<'_>,
    task: Node<'_, 'a>,
    path: Node<'_, 'a>,
    plan: &mut TrajectoryPlan,
) -> Result<(), InputError> {
    let position = |node, i: &str, j: &str| {
        let (i, j) = (xml.number(node, i)?, xml.number(node, j)?);
        Ok(match on {
            On::Roadmap(_) => (i, j),
            On::Grid(size) => (j + 0.5, f64::from(size.rows) - i - 0.5),
        })
    };
    let mut nodes = Vec::new();
    let mut knots = Vec::new();
    let mut time_s = 0.0;
    let mut knot = |nodes: &mut Vec<_>, node, time_s, (x_m, y_m): (f64, f64)| {
        nodes.push(node);
        knots.push(Knot {
            time_s,
            x_m,
            y_m,
            heading_rad: None,
        });
    };
    for section in children(path, "section") {
        // From where the one before ended; anywhere else is a gap.
        let start = position(section, "start_i", "start_j")?;
        knot(&mut nodes, section, time_s, start);
        time_s += xml.number(section, "duration")?;
        knot(
            &mut nodes,
            section,
            time_s,
            position(section, "goal_i", "goal_j")?,
        );
    }
    if nodes.is_empty() {
        let start = match on {
            On::Grid(_) => position(task, "start_i", "start_j")?,
            On::Roadmap(roadmap) => {
                let roadmap = roadmap.ok_or_else(|| {
                    let reason =
                        "the agent rests at its start, and the result does not say where that is";
                    xml.error(path, reason)
                        .hint("leave out agents that need not move")
                })?;
                let vertex = xml.number(task, "start_id")?;
                let vertices = roadmap.vertices();
                if vertex.fract() != 0.0 || !(0.0..vertices as f64).contains(&vertex) {
                    let reason = format!("the start {vertex} is none of {vertices} vertices");
                    return Err(xml.error(task, reason));
                }
                roadmap.position_m(vertex as u32)
            }
        };
        knot(&mut nodes, path, 0.0, start);
    }
    plan.push_path(knots).map_err(|error| {
        let at = error.place().and_then(|(_, knot)| nodes.get(knot));
        xml.error(*at.unwrap_or(&path), error.to_string())
    })
}

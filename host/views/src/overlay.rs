//! Roadmap to grid: edges rasterised on an overlay of cells, with moves along them alone.
//!
//! GRACE (section IV-B) asks for "a graph-constrained grid that preserves roadmap topology". A mask of
//! moves holds no memory of where a robot came from: two edges that cross in a cell would become
//! four ways out of it, and so links that the roadmap does not have. Therefore a cell belongs either
//! to one edge or to vertices:
//!
//! - Vertices in one cell are merged where edges both ways within the cell join them. Of several
//!   such groups in a cell one is kept, that with most starts and goals, then with most vertices.
//! - An edge takes the cells through which it goes between those of its ends. Where another edge
//!   or a vertex has one of them it goes round, at most two cells from its line, or is lost. Edges that
//!   join parts come first, then short ones. Between neighbouring cells all edges that lead the
//!   same way are one move.
//!
//! So every path on the grid is one along edges, which [`OverlayView::lift`] gives back, and what the
//! overlay cannot hold is in the [`OverlayReport`]. Finer cells lose less.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap, VecDeque};
use std::sync::Arc;

use fleetyard_core::{
    Connectivity, Grid, GridInstance, GridPlan, GridSearch, InputError, OctileLength, Roadmap,
    RoadmapPlan, Visit, move_bit, opposite_move,
};
use fleetyard_world::{Vector, squared_distance};
use serde::Serialize;
use serde_json::{Value, json};

use crate::frame::Frame;
use crate::pin::{Pins, distance_m};
use crate::roadmap::root;
use crate::{GridSpec, GridView, Origin, Problem, cell_side_m};

/// Parameters of the grid of a roadmap.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OverlaySpec {
    /// Moves, and the side of a cell where `cell_m` gives none.
    pub grid: GridSpec,
    /// The side of a cell in metres. Robots that keep the rules of a grid with smaller cells than
    /// those of `grid` do not keep the distance that it names.
    pub cell_m: Option<f64>,
}

/// The part of a roadmap that a grid holds. Edges are counted once, however they are driven.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OverlayReport {
    /// Vertices of the roadmap.
    pub vertices: usize,
    /// Vertices that share a cell with another one that stands for them.
    pub vertices_merged: usize,
    /// Vertices whose cell belongs to others, from which no edge in the cell leads to them.
    pub vertices_lost: usize,
    /// Edges of the roadmap.
    pub edges: usize,
    /// Edges within a cell, and edges for whose move there is another one.
    pub edges_merged: usize,
    /// Edges with an end that is lost, or that find no way past cells of others.
    pub edges_lost: usize,
    /// Length of agents' shortest paths on the grid, as a multiple of that on the roadmap, on
    /// average; none where nobody has a way to go.
    pub stretch_mean: Option<f64>,
    /// The same of the agent with the largest.
    pub stretch_max: Option<f64>,
}

/// A task on the grid of a roadmap.
#[derive(Debug, Clone)]
pub struct OverlayView {
    /// Cells with their masks of moves, starts and goals.
    pub view: GridView,
    /// Merged, lost and longer than on the roadmap.
    pub report: OverlayReport,
    /// Start of every agent as a vertex of the roadmap.
    pub start_vertices: Vec<u32>,
    /// Goal of every agent, likewise.
    pub goal_vertices: Vec<u32>,
    /// Per vertex its cell, unless it is lost.
    pub cell_of: Vec<Option<u32>>,
    /// Edges that have cells or a move of their own.
    ways: Vec<Way>,
    /// Per move out of a cell with vertices the way that it begins, and whether backwards.
    begins: BTreeMap<(u32, u32), (usize, bool)>,
}

/// An edge on the overlay.
#[derive(Debug, Clone)]
struct Way {
    /// The vertices from which and to which it leads.
    ends: [u32; 2],
    /// Its cells, those of its ends included.
    cells: Vec<u32>,
}

/// An edge of the roadmap, once for both directions.
#[derive(Clone, Copy)]
struct Edge {
    ends: [u32; 2],
    /// True if it can be driven back.
    is_two_way: bool,
    length_m: f64,
}

/// The grid of a roadmap, with a task's starts and goals at the vertices that are nearest to them.
///
/// Refused are vertices outside of the world, starts and goals that are farther than a cell from any
/// vertex, whose vertex is lost, or that share a cell, and goals that cannot be reached on the grid.
pub fn roadmap_to_grid(
    problem: &Problem,
    roadmap: &Roadmap,
    spec: OverlaySpec,
) -> Result<OverlayView, InputError> {
    let source = problem.task.source.as_str();
    let bounds = &problem.world.bounds;
    let radius_m = problem.common_radius_m();
    let cell_m = spec
        .cell_m
        .unwrap_or_else(|| cell_side_m(spec.grid, radius_m));
    let frame = Frame::over(bounds, cell_m, source)?;
    let at_m: Vec<[f64; 2]> = (0..roadmap.vertices() as u32)
        .map(|vertex| roadmap.position_m(vertex).into())
        .collect();
    if let Some(vertex) = at_m.iter().position(|at| !bounds.contains(*at)) {
        let [x, y] = at_m[vertex];
        let reason =
            format!("vertex {vertex} of the roadmap is at ({x}, {y}), outside of the world");
        return Err(InputError::new(source, reason).hint("use a roadmap of this task's world"));
    }
    let pins = Pins::new(problem, roadmap, cell_m)?;
    let mut sketch = Sketch::new(frame, roadmap, &at_m, &pins);
    sketch.check_pins(problem, &pins)?;
    sketch.place_edges(roadmap, &at_m, spec.grid.connectivity);
    let Sketch {
        cell_of,
        masks,
        is_free,
        ways,
        begins,
        mut report,
        ..
    } = sketch;
    let letters = is_free.iter().map(|free| if *free { b'.' } else { b'@' });
    let name = problem.world.name.as_str();
    let grid = Grid::new(name, frame.rows, frame.cols, letters.collect())?;
    let grid = grid
        .with_moves(masks)
        .map_err(|error| InputError::new(source, error.to_string()))?;
    let home = |vertex: &u32| cell_of[*vertex as usize].unwrap_or_default();
    let starts: Vec<u32> = pins.starts.iter().map(home).collect();
    let goals: Vec<u32> = pins.goals.iter().map(home).collect();
    let connectivity = spec.grid.connectivity;
    let instance = GridInstance::new(Arc::new(grid), connectivity, starts, goals);
    let instance = instance.map_err(|error| {
        let reason = format!(
            "{error}; of {} edges {} are lost",
            report.edges, report.edges_lost
        );
        InputError::new(source, reason).hint(
            "use smaller cells, or a roadmap whose edges do not cross, such as that of the builder delaunay",
        )
    })?;
    report.stretch(&instance, cell_m, roadmap, &pins);
    let snapped = problem
        .task
        .agents
        .iter()
        .map(|agent| [agent.start, agent.goal].map(|state| frame.snap(state.at_m()).1));
    let parameters = json!({
        "neighbors": connectivity.degree(),
        "separation": spec.grid.separation,
        "cell_m": cell_m,
        "r_com_m": radius_m,
    });
    Ok(OverlayView {
        view: GridView {
            instance,
            spec: spec.grid,
            radius_m,
            cell_m,
            corner_m: frame.corner_m,
            snapped_m: snapped.collect(),
            origin: Origin::of_roadmap(problem, roadmap, "roadmap-to-grid", parameters),
        },
        report,
        start_vertices: pins.starts,
        goal_vertices: pins.goals,
        cell_of,
        ways,
        begins,
    })
}

impl OverlayReport {
    /// Compares the agents' shortest paths.
    fn stretch(&mut self, instance: &GridInstance, cell_m: f64, roadmap: &Roadmap, pins: &Pins) {
        let mut search = GridSearch::new(instance.grid());
        let ends = instance.starts().iter().zip(instance.goals());
        let on_grid = ends.map(|(start, goal)| match instance.connectivity() {
            Connectivity::Four => search
                .steps(*start, *goal, Connectivity::Four)
                .map(f64::from),
            Connectivity::Eight => search.octile(*start, *goal).map(OctileLength::cells),
        });
        let vertices = pins.starts.iter().zip(&pins.goals);
        let ratios: Vec<f64> = on_grid
            .zip(vertices)
            .filter_map(|(cells, (start, goal))| {
                let length_m = shortest_m(roadmap, *start, *goal)?;
                (length_m > 0.0).then_some(cells? * cell_m / length_m)
            })
            .collect();
        if ratios.is_empty() {
            return;
        }
        self.stretch_mean = Some(ratios.iter().sum::<f64>() / ratios.len() as f64);
        self.stretch_max = ratios.into_iter().reduce(f64::max);
    }
}

/// Length of a shortest path on a roadmap in metres, by Dijkstra's algorithm.
fn shortest_m(roadmap: &Roadmap, from: u32, to: u32) -> Option<f64> {
    let mut best = vec![f64::INFINITY; roadmap.vertices()];
    best[from as usize] = 0.0;
    // Lengths are not negative, so that their bits are in their order.
    let mut open = BinaryHeap::from([Reverse((0.0_f64.to_bits(), from))]);
    while let Some(Reverse((bits, vertex))) = open.pop() {
        let length = f64::from_bits(bits);
        if vertex == to {
            return Some(length);
        }
        if length > best[vertex as usize] {
            continue;
        }
        let here = roadmap.position_m(vertex).into();
        for next in roadmap.neighbors(vertex) {
            let through = length + distance_m(here, roadmap.position_m(*next).into());
            if through < best[*next as usize] {
                best[*next as usize] = through;
                open.push(Reverse((through.to_bits(), *next)));
            }
        }
    }
    None
}

/// Distance from its line at which the middle of a cell of an edge may be, in cells.
const DETOUR_CELLS: f64 = 2.0;

/// No edge and no vertex has the cell.
const NOBODY: u32 = u32::MAX;
/// Vertices have it.
const VERTICES: u32 = u32::MAX - 1;

/// The overlay while edges are placed.
struct Sketch {
    frame: Frame,
    cell_of: Vec<Option<u32>>,
    /// Parts of the overlay, of vertices that are not lost.
    parent: Vec<u32>,
    /// Per cell its edge, or `NOBODY` or `VERTICES`.
    owner: Vec<u32>,
    masks: Vec<u8>,
    is_free: Vec<bool>,
    ways: Vec<Way>,
    begins: BTreeMap<(u32, u32), (usize, bool)>,
    report: OverlayReport,
}

impl Sketch {
    /// Puts vertices into their cells.
    fn new(frame: Frame, roadmap: &Roadmap, at_m: &[[f64; 2]], pins: &Pins) -> Self {
        let vertices = at_m.len();
        let mut parent: Vec<u32> = (0..vertices as u32).collect();
        let cells: Vec<u32> = at_m.iter().map(|at| frame.snap(*at).0).collect();
        for (from, to) in roadmap.edges() {
            let is_within = cells[from as usize] == cells[to as usize];
            if is_within && from < to && roadmap.has_edge(to, from) {
                join(&mut parent, from, to);
            }
        }
        let mut pinned = vec![0; vertices];
        for vertex in pins.starts.iter().chain(&pins.goals) {
            pinned[*vertex as usize] += 1;
        }
        // Per group its starts and goals and its vertices; it is known by its first vertex.
        let mut groups: BTreeMap<u32, (u32, usize)> = BTreeMap::new();
        for vertex in 0..vertices as u32 {
            let group = groups.entry(root(&mut parent, vertex)).or_default();
            group.0 += pinned[vertex as usize];
            group.1 += 1;
        }
        let mut kept: BTreeMap<u32, u32> = BTreeMap::new();
        for (first, weight) in &groups {
            let best = kept.entry(cells[*first as usize]).or_insert(*first);
            // Among equals the first stays.
            if *weight > groups[best] {
                *best = *first;
            }
        }
        let mut cell_of = vec![None; vertices];
        for vertex in 0..vertices as u32 {
            let cell = cells[vertex as usize];
            if kept[&cell] == root(&mut parent, vertex) {
                cell_of[vertex as usize] = Some(cell);
            }
        }
        let (mut owner, mut is_free) = (vec![NOBODY; frame.cells()], vec![false; frame.cells()]);
        for cell in kept.keys() {
            owner[*cell as usize] = VERTICES;
            is_free[*cell as usize] = true;
        }
        let placed = cell_of.iter().flatten().count();
        Self {
            frame,
            cell_of,
            parent,
            owner,
            masks: vec![0; frame.cells()],
            is_free,
            ways: Vec::new(),
            begins: BTreeMap::new(),
            report: OverlayReport {
                vertices,
                vertices_merged: placed - kept.len(),
                vertices_lost: vertices - placed,
                edges: 0,
                edges_merged: 0,
                edges_lost: 0,
                stretch_mean: None,
                stretch_max: None,
            },
        }
    }

    /// Refuses starts and goals at vertices that are lost, and two of a kind in one cell.
    fn check_pins(&self, problem: &Problem, pins: &Pins) -> Result<(), InputError> {
        let fault = |reason: String| {
            let hint = "use smaller cells, or move one of them";
            Err(InputError::new(problem.task.source.as_str(), reason).hint(hint))
        };
        for (what, vertices) in [("start", &pins.starts), ("goal", &pins.goals)] {
            let mut first_in = BTreeMap::new();
            for (agent, vertex) in vertices.iter().enumerate() {
                let Some(cell) = self.cell_of[*vertex as usize] else {
                    return fault(format!(
                        "the {what} of agent {agent}, vertex {vertex}, is in the cell of other vertices, to which \
                         no edge within it leads"
                    ));
                };
                if let Some(first) = first_in.insert(cell, agent) {
                    return fault(format!(
                        "the {what}s of agents {first} and {agent} are in one cell"
                    ));
                }
            }
        }
        Ok(())
    }

    /// Places edges: first those that join parts, then the others, short ones first.
    fn place_edges(&mut self, roadmap: &Roadmap, at_m: &[[f64; 2]], connectivity: Connectivity) {
        let edges = roadmap.edges().filter_map(|(from, to)| {
            let is_two_way = roadmap.has_edge(to, from);
            (from < to || !is_two_way).then(|| Edge {
                ends: [from, to],
                is_two_way,
                length_m: distance_m(at_m[from as usize], at_m[to as usize]),
            })
        });
        let mut waiting = Vec::new();
        for edge in edges {
            self.report.edges += 1;
            match edge.ends.map(|vertex| self.cell_of[vertex as usize]) {
                [Some(a), Some(b)] if a == b => self.report.edges_merged += 1,
                [Some(_), Some(_)] => waiting.push(edge),
                _ => self.report.edges_lost += 1,
            }
        }
        waiting.sort_unstable_by(|a, b| {
            let by_length = a.length_m.total_cmp(&b.length_m);
            by_length.then(a.ends.cmp(&b.ends))
        });
        let mut later = Vec::new();
        for edge in waiting {
            let [from, to] = edge.ends;
            if root(&mut self.parent, from) == root(&mut self.parent, to) {
                later.push(edge);
            } else if self.place(edge, at_m, connectivity) {
                join(&mut self.parent, from, to);
            }
        }
        for edge in later {
            self.place(edge, at_m, connectivity);
        }
    }

    /// Gives an edge its cells and its moves. False if it is lost.
    fn place(&mut self, edge: Edge, at_m: &[[f64; 2]], connectivity: Connectivity) -> bool {
        let [from, to] = edge.ends.map(|vertex| at_m[vertex as usize]);
        let mut cells = self.frame.line(from, to);
        if connectivity == Connectivity::Eight {
            cells = self.cut_corners(&cells);
        }
        let is_taken = |cell: &u32| self.owner[*cell as usize] != NOBODY;
        if cells[1..cells.len() - 1].iter().any(is_taken) {
            let ends = [cells[0], cells[cells.len() - 1]];
            let Some(round) = self.detour([from, to], ends, connectivity) else {
                self.report.edges_lost += 1;
                return false;
            };
            cells = round;
        }
        let inner = &cells[1..cells.len() - 1];
        let way = self.ways.len();
        let mut is_new = false;
        let last = cells.len() - 1;
        let ways = [
            Some(((cells[0], cells[1]), (way, false))),
            (edge.is_two_way).then_some(((cells[last], cells[last - 1]), (way, true))),
        ];
        for (begin, way) in ways.into_iter().flatten() {
            self.begins.entry(begin).or_insert_with(|| {
                is_new = true;
                way
            });
        }
        if !is_new {
            self.report.edges_merged += 1;
            return true;
        }
        for cell in inner {
            self.owner[*cell as usize] = way as u32;
        }
        for step in cells.windows(2) {
            let [a, b] =
                [step[0], step[1]].map(|cell| (cell / self.frame.cols, cell % self.frame.cols));
            let Some(bit) = move_bit(a, b) else { continue };
            self.masks[step[0] as usize] |= 1 << bit;
            if edge.is_two_way {
                self.masks[step[1] as usize] |= 1 << opposite_move(bit);
            }
            // A diagonal move needs both cells at its side free; nobody may go there.
            for (row, col) in [a, b, (a.0, b.1), (b.0, a.1)] {
                self.is_free[(row * self.frame.cols + col) as usize] = true;
            }
        }
        self.ways.push(Way {
            ends: edge.ends,
            cells,
        });
        true
    }

    /// The fewest cells that nobody has from one end of an edge to the other, near to its line.
    fn detour(
        &self,
        line_m: [[f64; 2]; 2],
        [from, to]: [u32; 2],
        connectivity: Connectivity,
    ) -> Option<Vec<u32>> {
        let line = line_m.map(Vector::from);
        let most = DETOUR_CELLS * self.frame.cell_m;
        let is_near = |cell: u32| {
            let at = Vector::from(self.frame.center_m(cell));
            squared_distance(line, [at, at]) <= most * most
        };
        // From the end to the begin, so that the way comes out in order.
        let mut after = BTreeMap::from([(to, to)]);
        let mut open = VecDeque::from([to]);
        while let Some(cell) = open.pop_front() {
            for next in self.frame.beside(cell, connectivity) {
                if next == from {
                    let mut way = vec![from, cell];
                    let mut at = cell;
                    while at != to {
                        at = after[&at];
                        way.push(at);
                    }
                    return Some(way);
                }
                let is_open = self.owner[next as usize] == NOBODY && is_near(next);
                if is_open && !after.contains_key(&next) {
                    after.insert(next, cell);
                    open.push_back(next);
                }
            }
        }
        None
    }

    /// A line of cells with diagonal moves where it would go round a corner.
    fn cut_corners(&self, line: &[u32]) -> Vec<u32> {
        let place = |cell: u32| self.frame.row_col(cell);
        let (mut cells, mut at) = (Vec::with_capacity(line.len()), 0);
        while let Some(cell) = line.get(at) {
            cells.push(*cell);
            let after = line.get(at + 2);
            let is_corner =
                after.is_some_and(|after| move_bit(place(*cell), place(*after)) >= Some(4));
            at += if is_corner { 2 } else { 1 };
        }
        cells
    }
}

fn join(parent: &mut [u32], from: u32, to: u32) {
    let (a, b) = (root(parent, from), root(parent, to));
    parent[a.max(b) as usize] = a.min(b);
}

impl OverlayView {
    /// Origin of the view, its starts and goals, what is lost, and where vertices are.
    pub fn about(&self) -> Value {
        let mut about = self.view.about();
        about["report"] = json!(self.report);
        about["start_vertices"] = json!(self.start_vertices);
        about["goal_vertices"] = json!(self.goal_vertices);
        about["vertex_cells"] = json!(self.cell_of);
        about
    }

    /// The plan along edges of the roadmap that a plan on the grid stands for: whoever moves from cell
    /// to cell in steps of `step_s` seconds drives the edges to which those belong. Who turns back on an
    /// edge stays at the vertex meanwhile. An agent whose goal shares its last cell with another vertex
    /// drives there in one step more.
    ///
    /// `roadmap` is the one from which the view was derived. Refused are paths that do not begin at
    /// their start, and moves that are no part of an edge.
    pub fn lift(
        &self,
        roadmap: &Roadmap,
        plan: &GridPlan,
        step_s: f64,
    ) -> Result<RoadmapPlan, InputError> {
        let source = "plan";
        let mut lifted = RoadmapPlan::with_capacity(plan.agents(), plan.agents() * 8);
        for (agent, path) in plan.paths().enumerate() {
            let ends = self
                .start_vertices
                .get(agent)
                .zip(self.goal_vertices.get(agent));
            let path = ends
                .and_then(|ends| Driver::new(self, roadmap, step_s, *ends.0).drive(path, *ends.1));
            let path = path.ok_or_else(|| {
                let reason =
                    format!("the path of agent {agent} is none along edges of the roadmap");
                InputError::new(source, reason).hint("validate the plan on the grid of this view")
            })?;
            lifted
                .push_path(path)
                .map_err(|error| InputError::new(source, error.to_string()))?;
        }
        Ok(lifted)
    }

    /// The vertices on a way from one to another within their cell, without the first.
    fn within(&self, roadmap: &Roadmap, from: u32, to: u32) -> Option<Vec<u32>> {
        let cell = self.cell_of[from as usize];
        let mut before = BTreeMap::from([(to, to)]);
        let mut open = VecDeque::from([to]);
        // From the end to the begin, so that the way comes out in order. The edges of a merged
        // group go both ways.
        while let Some(vertex) = open.pop_front() {
            if vertex == from {
                let mut way = Vec::new();
                let mut at = from;
                while at != to {
                    at = before[&at];
                    way.push(at);
                }
                return Some(way);
            }
            for next in roadmap.neighbors(vertex) {
                let fits = self.cell_of[*next as usize] == cell && roadmap.has_edge(*next, vertex);
                if fits && !before.contains_key(next) {
                    before.insert(*next, vertex);
                    open.push_back(*next);
                }
            }
        }
        None
    }
}

/// One agent on its way along the roadmap.
struct Driver<'a> {
    view: &'a OverlayView,
    roadmap: &'a Roadmap,
    step_s: f64,
    visits: Vec<Visit>,
    vertex: u32,
}

impl<'a> Driver<'a> {
    fn new(view: &'a OverlayView, roadmap: &'a Roadmap, step_s: f64, vertex: u32) -> Self {
        let visits = vec![Visit {
            vertex,
            arrival_s: 0.0,
            departure_s: 0.0,
        }];
        Self {
            view,
            roadmap,
            step_s,
            visits,
            vertex,
        }
    }

    fn drive(mut self, path: &[u32], goal: u32) -> Option<Vec<Visit>> {
        let ways = &self.view.ways;
        if path.first().copied() != self.view.cell_of[self.vertex as usize] {
            return None;
        }
        // The way on which the agent is: its cells in order, where on it, and since when.
        let mut on: Option<(usize, bool, usize, usize)> = None;
        for (time, step) in path.windows(2).enumerate() {
            if step[0] == step[1] {
                continue;
            }
            let (way, back, at, since) = match on {
                None => {
                    let (way, back) = *self.view.begins.get(&(step[0], step[1]))?;
                    (way, back, 0, time)
                }
                Some(on) => on,
            };
            let cells = &ways[way].cells;
            let last = cells.len() - 1;
            let cell = |at: usize| cells[if back { last - at } else { at }];
            let at = if at < last && cell(at + 1) == step[1] {
                at + 1
            } else if at > 0 && cell(at - 1) == step[1] {
                at - 1
            } else {
                return None;
            };
            on = (at > 0 && at < last).then_some((way, back, at, since));
            if at == last {
                let [from, to] = ways[way].ends;
                let (from, to) = if back { (to, from) } else { (from, to) };
                self.pass(from, Some(to), since, time + 1)?;
            }
        }
        if self.vertex != goal && on.is_none() {
            let time = path.len() - 1;
            self.pass(goal, None, time, time + 1)?;
        }
        on.is_none().then_some(self.visits)
    }

    /// Drives within the cell to a vertex and then along an edge, from one time to another.
    fn pass(&mut self, by: u32, to: Option<u32>, begin: usize, end: usize) -> Option<()> {
        let mut way = self.view.within(self.roadmap, self.vertex, by)?;
        way.extend(to);
        let place = |vertex: u32| self.roadmap.position_m(vertex).into();
        let from = std::iter::once(&self.vertex).chain(&way);
        // Vertices at one place take a moment as well.
        let lengths: Vec<f64> = from
            .zip(&way)
            .map(|(from, to)| distance_m(place(*from), place(*to)) + 1e-6 * self.view.view.cell_m)
            .collect();
        let total: f64 = lengths.iter().sum();
        let [begin_s, end_s] = [begin, end].map(|time| time as f64 * self.step_s);
        if let Some(visit) = self.visits.last_mut() {
            visit.departure_s = begin_s;
        }
        let mut driven = 0.0;
        for (number, (vertex, length)) in way.iter().zip(&lengths).enumerate() {
            driven += length;
            let is_last = number + 1 == way.len();
            let time_s = if is_last {
                end_s
            } else {
                begin_s + (end_s - begin_s) * driven / total
            };
            self.visits.push(Visit {
                vertex: *vertex,
                arrival_s: time_s,
                departure_s: time_s,
            });
        }
        self.vertex = *way.last()?;
        Some(())
    }
}

//! The planners behind the plugin contract.
//!
//! Each takes one agent with one goal and submits one plan: the cells of its path, or
//! of an any-angle path the cells where it turns. The metric `expansions` is reported
//! with it, or without it if there is none.

use fleetyard_abi::sdk::{Failure, Options as Given, Planner, Plugin, Sink, options_schema};
use fleetyard_abi::{
    Budget, Capabilities, Capability, Descriptor, GridPlan, Instance, Kind, Motion,
    SharedEnvironment, Status, monotonic_ns,
};
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::{
    Beam, BestFirst, Bfs, BidirectionalAstar, BidirectionalBfs, Corners, Done, Fringe, Grid,
    Heuristic, IdaStar, Incremental, JumpPoint, Limit, Looks, Memory, Method, Neighbors, Order,
    Outcome, Search, Stop, ThetaStar, TieBreaking,
};

/// A planner of this crate as a plugin: the options that a user may give decide
/// which.
pub trait Variety: DeserializeOwned + JsonSchema + 'static {
    /// The identifier.
    const ID: &'static str;
    /// The name.
    const NAME: &'static str;
    /// The method in a sentence, with its source.
    const ABOUT: &'static str;
    /// The motion of its robot.
    const MOTION: Motion = Motion::Pebble;
    /// True if it knows one-way streets.
    const ONE_WAY: bool = true;
    /// The search behind the planner.
    type Search: Search;
    /// Makes that from the options, or says what is wrong with them.
    fn search(self) -> Result<Self::Search, String>;
}

/// A planner that was made with options of type `V`.
pub struct GridPlanner<V: Variety> {
    search: V::Search,
    path: Vec<u32>,
}

impl<V: Variety> Plugin for GridPlanner<V> {
    fn descriptor() -> Descriptor {
        let motion: &[Capability] = match V::MOTION {
            Motion::AnyAngle => &[Capability::AnyAngle],
            _ => &[Capability::Pebble],
        };
        let common = [
            Capability::Grid,
            Capability::EightConnected,
            Capability::Deterministic,
        ];
        let one_way = V::ONE_WAY.then_some(Capability::MoveMask);
        let all: Vec<_> = common
            .iter()
            .chain(motion)
            .copied()
            .chain(one_way)
            .collect();
        Descriptor {
            name: V::NAME.into(),
            version: env!("CARGO_PKG_VERSION").into(),
            license: env!("CARGO_PKG_LICENSE").into(),
            capabilities: Capabilities::of(&all),
            features: vec![Descriptor::ONE_AGENT.to_owned()],
            options_schema: options_schema::<V>(),
            ..Descriptor::new(Kind::Planner, V::ID, format!("{} One agent.", V::ABOUT))
        }
    }

    fn create(given: Given<'_>) -> Result<Self, Failure> {
        let search = given.parse::<V>()?.search().map_err(|reason| {
            let message = format!("options: {reason}");
            Failure::new(Status::InvalidInput, message)
        })?;
        Ok(Self {
            search,
            path: Vec::new(),
        })
    }
}

fn unsupported(reason: impl Into<String>) -> Failure {
    Failure::new(Status::Unsupported, reason)
}

impl<V: Variety> Planner for GridPlanner<V> {
    type Map = Grid;

    fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        _: &Budget,
        _: &dyn Sink,
    ) -> Result<Grid, Failure> {
        let grid = environment
            .grid()
            .ok_or_else(|| unsupported("maps other than grids are not supported"))?;
        let neighbors = match grid.connectivity {
            4 => Neighbors::Four,
            8 => Neighbors::Eight,
            other => {
                let reason = format!("grids with {other} neighbours are not supported");
                return Err(unsupported(reason));
            }
        };
        let passable: Vec<bool> = grid.passable.iter().map(|free| *free != 0).collect();
        let map = Grid::new(grid.rows, grid.cols, &passable, neighbors)
            .ok_or_else(|| unsupported("the map has more than 2^31 cells, or none"))?;
        Ok(if grid.is_plain() {
            map
        } else {
            map.with_moves(&grid.moves)
        })
    }

    fn plan(
        &mut self,
        grid: &mut Grid,
        instance: &Instance,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        let (start, goal) = ends(instance)?;
        for (what, cell) in [("start", start), ("goal", goal)] {
            if !grid.is_free(cell) {
                let reason = format!("the {what}, cell {cell}, is not a free cell of the map");
                return Err(Failure::new(Status::InvalidInput, reason));
            }
        }
        let answer_by = budget.answer_by_ns;
        let mut told = || monotonic_ns() >= answer_by || sink.cancelled();
        let nodes = (budget.nodes > 0).then_some(budget.nodes);
        let mut limit = Limit::new(nodes, &mut told);
        let answer = self
            .search
            .search(grid, start, goal, &mut limit, &mut self.path);
        sink.metric("expansions", answer.expansions as f64);
        let failed = |status, reason| Err(Failure::new(status, reason));
        match answer.outcome {
            Outcome::Found => Ok(sink.submit(&GridPlan::from_paths([&self.path]))?),
            Outcome::NoPath => failed(Status::Infeasible, "the goal cannot be reached"),
            Outcome::GaveUp => failed(
                Status::GaveUp,
                "nothing is left to search, but not everything was searched",
            ),
            Outcome::Stopped(Stop::Nodes) => failed(
                Status::GaveUp,
                "the limit of nodes was reached before a path was found",
            ),
            Outcome::Stopped(Stop::Told) => {
                failed(Status::TimedOut, "the budget ended before a path was found")
            }
        }
    }
}

/// Start and goal of the one agent.
fn ends(instance: &Instance) -> Result<(u32, u32), Failure> {
    match (instance.starts.as_slice(), instance.goals.items()) {
        ([start], [goal]) => Ok((*start, *goal)),
        (starts, _) => {
            let agents = starts.len();
            let reason = format!("this planner plans for one agent, the instance has {agents}");
            Err(unsupported(reason))
        }
    }
}

/// Options with the default beside each.
macro_rules! options {
    ($(#[doc = $doc:literal])* $name:ident { $($(#[$meta:meta])* $field:ident: $type:ty = $default:expr,)* }) => {
        $(#[doc = $doc])*
        #[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
        #[serde(default, deny_unknown_fields)]
        pub struct $name {
            $($(#[$meta])* $field: $type,)*
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($field: $default,)* }
            }
        }
    };
}

options! {
    /// Options of `astar`.
    AstarOptions {
        /// The estimate of what is left; `null` for `manhattan` with four neighbours
        /// and `octile` with eight. One that overestimates gives up shortest paths.
        heuristic: Option<Heuristic> = None,
        /// The one of several places with equal f that is expanded first.
        tie_breaking: TieBreaking = TieBreaking::LowH,
    }
}

impl Variety for AstarOptions {
    const ID: &'static str = "astar";
    const NAME: &'static str = "A*";
    const ABOUT: &'static str = "A*: expands the place with the least f = g + h; shortest paths \
         (Hart, Nilsson, Raphael, 1968).";
    type Search = BestFirst;

    fn search(self) -> Result<BestFirst, String> {
        Ok(BestFirst::astar(self.heuristic, self.tie_breaking))
    }
}

options! {
    /// Options of `dijkstra`: none.
    DijkstraOptions {}
}

impl Variety for DijkstraOptions {
    const ID: &'static str = "dijkstra";
    const NAME: &'static str = "Dijkstra";
    const ABOUT: &'static str = "Dijkstra's algorithm: expands the place nearest to the start; \
         shortest paths (Dijkstra, 1959).";
    type Search = crate::Dijkstra;

    fn search(self) -> Result<crate::Dijkstra, String> {
        Ok(crate::Dijkstra::default())
    }
}

options! {
    /// Options of `greedy-best-first`.
    GreedyOptions {
        /// The estimate of what is left; `null` for `manhattan` with four neighbours
        /// and `octile` with eight.
        heuristic: Option<Heuristic> = None,
        /// The one of several places with equal h that is expanded first.
        tie_breaking: TieBreaking = TieBreaking::Fifo,
    }
}

impl Variety for GreedyOptions {
    const ID: &'static str = "greedy-best-first";
    const NAME: &'static str = "Greedy best-first search";
    const ABOUT: &'static str = "Greedy best-first search: expands the place that seems nearest \
         to the goal; paths of any length (Doran, Michie, 1966).";
    type Search = BestFirst;

    fn search(self) -> Result<BestFirst, String> {
        Ok(BestFirst::greedy(self.heuristic, self.tie_breaking))
    }
}

/// More than this is greedy search for all that a map can be.
const MOST_WEIGHT: f64 = 1e6;

options! {
    /// Options of `weighted-astar`.
    WeightedOptions {
        /// Factor of the estimate; paths are at most so many times as long as the shortest, unless
        /// the heuristic overestimates by itself.
        #[schemars(range(min = 1.0, max = 1e6))]
        weight: f64 = 1.5,
        /// The estimate of what is left; `null` for `manhattan` with four neighbours
        /// and `octile` with eight.
        heuristic: Option<Heuristic> = None,
        /// The one of several places with equal f that is expanded first.
        tie_breaking: TieBreaking = TieBreaking::Fifo,
        /// Expand a place again when a shorter way to it is found.
        reopen: bool = true,
    }
}

impl Variety for WeightedOptions {
    const ID: &'static str = "weighted-astar";
    const NAME: &'static str = "Weighted A*";
    const ABOUT: &'static str = "Weighted A*: expands the place with the least f = g + w·h; \
         paths at most w times as long as the shortest (Pohl, 1970).";
    type Search = BestFirst;

    fn search(self) -> Result<BestFirst, String> {
        let weight = self.weight;
        if !(1.0..=MOST_WEIGHT).contains(&weight) {
            return Err(format!(
                "`weight` is {weight}, but has to be from 1 to {MOST_WEIGHT}"
            ));
        }
        Ok(BestFirst::weighted(
            self.heuristic,
            weight,
            self.tie_breaking,
            self.reopen,
            Order::RowsFirst,
        ))
    }
}

options! {
    /// Options of `bfs`: none.
    BfsOptions {}
}

impl Variety for BfsOptions {
    const ID: &'static str = "bfs";
    const NAME: &'static str = "Breadth-first search";
    const ABOUT: &'static str = "Breadth-first search: as few moves as possible (Moore, 1959).";
    type Search = Bfs;

    fn search(self) -> Result<Bfs, String> {
        Ok(Bfs::default())
    }
}

options! {
    /// Options of `bidirectional-bfs`: none.
    BidirectionalBfsOptions {}
}

impl Variety for BidirectionalBfsOptions {
    const ID: &'static str = "bidirectional-bfs";
    const NAME: &'static str = "Bidirectional breadth-first search";
    const ABOUT: &'static str = "Breadth-first search from both ends, a layer at a time: as few \
         moves as possible (Pohl, 1971).";
    type Search = BidirectionalBfs;

    fn search(self) -> Result<BidirectionalBfs, String> {
        Ok(BidirectionalBfs::default())
    }
}

options! {
    /// Options of `bidirectional-astar`.
    BidirectionalAstarOptions {
        /// The estimate of what is left; `null` for `manhattan` with four neighbours
        /// and `octile` with eight. One that overestimates gives up shortest paths.
        heuristic: Option<Heuristic> = None,
        /// The one of several places with equal f that is expanded first.
        tie_breaking: TieBreaking = TieBreaking::LowG,
        /// End of the search: when no side has anything better left, or when one has not.
        done: Done = Done::Both,
    }
}

impl Variety for BidirectionalAstarOptions {
    const ID: &'static str = "bidirectional-astar";
    const NAME: &'static str = "Bidirectional A*";
    const ABOUT: &'static str = "A* from both ends until no better meeting is possible; shortest \
         paths (Pohl, 1971).";
    type Search = BidirectionalAstar;

    fn search(self) -> Result<BidirectionalAstar, String> {
        Ok(BidirectionalAstar::new(
            self.heuristic,
            self.tie_breaking,
            self.done,
        ))
    }
}

options! {
    /// Options of `theta-star`.
    ThetaOptions {
        /// The estimate of what is left. One above `euclidean` overestimates.
        heuristic: Heuristic = Heuristic::Euclidean,
        /// The one of several places with equal f that is expanded first.
        tie_breaking: TieBreaking = TieBreaking::Fifo,
        /// The number of cells beside a corner that have to be free if a line is to pass exactly
        /// through it: one or both.
        corners: Corners = Corners::OneFree,
    }
}

impl Variety for ThetaOptions {
    const ID: &'static str = "theta-star";
    const NAME: &'static str = "Theta*";
    const ABOUT: &'static str = "Theta*: any-angle paths, short but not always shortest; looks \
         for a line of sight to every place that is found (Nash, Daniel, Koenig, Felner, 2007).";
    const MOTION: Motion = Motion::AnyAngle;
    const ONE_WAY: bool = false;
    type Search = ThetaStar;

    fn search(self) -> Result<ThetaStar, String> {
        let looks = Looks::Early;
        Ok(ThetaStar::new(
            looks,
            self.heuristic,
            self.tie_breaking,
            self.corners,
        ))
    }
}

options! {
    /// Options of `lazy-theta-star`.
    LazyThetaOptions {
        /// The estimate of what is left. One above `euclidean` overestimates.
        heuristic: Heuristic = Heuristic::Euclidean,
        /// The one of several places with equal f that is expanded first.
        tie_breaking: TieBreaking = TieBreaking::Fifo,
        /// The number of cells beside a corner that have to be free if a line is to pass exactly
        /// through it: one or both.
        corners: Corners = Corners::OneFree,
    }
}

impl Variety for LazyThetaOptions {
    const ID: &'static str = "lazy-theta-star";
    const NAME: &'static str = "Lazy Theta*";
    const ABOUT: &'static str = "Lazy Theta*: any-angle paths, short but not always shortest; \
         looks for a line of sight to places that are expanded (Nash, Koenig, Tovey, 2010).";
    const MOTION: Motion = Motion::AnyAngle;
    const ONE_WAY: bool = false;
    type Search = ThetaStar;

    fn search(self) -> Result<ThetaStar, String> {
        let looks = Looks::Late;
        Ok(ThetaStar::new(
            looks,
            self.heuristic,
            self.tie_breaking,
            self.corners,
        ))
    }
}

options! {
    /// Options of `idastar`.
    IdaOptions {
        /// The estimate of what is left; `null` for `manhattan` with four neighbours
        /// and `octile` with eight. One that overestimates gives up shortest paths.
        heuristic: Option<Heuristic> = None,
        /// The part of a round that is remembered. In mazes without loops both expand the same; in
        /// the open `path` takes exponential time.
        memory: Memory = Memory::Costs,
    }
}

impl Variety for IdaOptions {
    const ID: &'static str = "idastar";
    const NAME: &'static str = "IDA*";
    const ABOUT: &'static str = "IDA*: depth-first searches under a rising bound on f; shortest \
         paths (Korf, 1985).";
    type Search = IdaStar;

    fn search(self) -> Result<IdaStar, String> {
        Ok(IdaStar::new(self.heuristic, self.memory))
    }
}

options! {
    /// Options of `jump-point-search`.
    JumpPointOptions {
        /// The estimate of what is left; `null` for `manhattan` with four neighbours
        /// and `octile` with eight. One that overestimates gives up shortest paths.
        heuristic: Option<Heuristic> = None,
        /// The one of several places with equal f that is expanded first.
        tie_breaking: TieBreaking = TieBreaking::LowG,
    }
}

impl Variety for JumpPointOptions {
    const ID: &'static str = "jump-point-search";
    const NAME: &'static str = "Jump point search";
    const ABOUT: &'static str = "Jump point search: A* that goes straight on until there is a \
         reason to turn; shortest paths (Harabor, Grastien, 2011).";
    // What it leaves out is symmetric only where every move can be undone.
    const ONE_WAY: bool = false;
    type Search = JumpPoint;

    fn search(self) -> Result<JumpPoint, String> {
        Ok(JumpPoint::new(self.heuristic, self.tie_breaking))
    }
}

/// One of the two incremental searches, with a tree that stays from call to call if it is to.
fn incremental(method: Method, keep_tree: bool) -> Incremental {
    let search = Incremental::new(method);
    if keep_tree { search.keeping() } else { search }
}

options! {
    /// Options of `lpa-star`.
    LpaOptions {
        /// True to keep the tree from call to call, and to repair it where the map has changed.
        keep_tree: bool = false,
    }
}

impl Variety for LpaOptions {
    const ID: &'static str = "lpa-star";
    const NAME: &'static str = "LPA*";
    const ABOUT: &'static str = "Lifelong planning A*: repairs its tree where the map has changed, if it may keep it; \
         shortest paths (Koenig, Likhachev, Furcy, 2004).";
    type Search = Incremental;

    fn search(self) -> Result<Incremental, String> {
        Ok(incremental(Method::LpaStar, self.keep_tree))
    }
}

options! {
    /// Options of `d-star-lite`.
    DStarLiteOptions {
        /// True to keep the tree from call to call, and to repair it where the map has changed or the
        /// robot has moved.
        keep_tree: bool = false,
    }
}

impl Variety for DStarLiteOptions {
    const ID: &'static str = "d-star-lite";
    const NAME: &'static str = "D* Lite";
    const ABOUT: &'static str = "D* Lite: searches from the goal, and repairs its tree where the map has changed or the \
         robot has moved, if it may keep it; shortest paths (Koenig, Likhachev, 2002).";
    type Search = Incremental;

    fn search(self) -> Result<Incremental, String> {
        Ok(incremental(Method::DStarLite, self.keep_tree))
    }
}

options! {
    /// Options of `beam-search`.
    BeamOptions {
        /// Number of places of each layer that are kept.
        #[schemars(range(min = 1))]
        width: u32 = 32,
        /// The estimate of what is left; `null` for `manhattan` with four neighbours
        /// and `octile` with eight.
        heuristic: Option<Heuristic> = None,
    }
}

impl Variety for BeamOptions {
    const ID: &'static str = "beam-search";
    const NAME: &'static str = "Beam search";
    const ABOUT: &'static str = "Beam search: breadth-first search that keeps the most promising \
         places of each layer; fast, paths of any length, may find none (Bisiani, 1987).";
    type Search = Beam;

    fn search(self) -> Result<Beam, String> {
        if self.width == 0 {
            return Err("`width` is 0, but has to be at least 1".into());
        }
        Ok(Beam::new(self.heuristic, self.width as usize))
    }
}

options! {
    /// Options of `fringe-search`.
    FringeOptions {
        /// The estimate of what is left; `null` for `manhattan` with four neighbours
        /// and `octile` with eight. One that overestimates gives up shortest paths.
        heuristic: Option<Heuristic> = None,
    }
}

impl Variety for FringeOptions {
    const ID: &'static str = "fringe-search";
    const NAME: &'static str = "Fringe search";
    const ABOUT: &'static str = "Fringe search: IDA* that goes on where the last round ended; \
         shortest paths (Björnsson, Enzenberger, Holte, Schaeffer, 2005).";
    type Search = Fringe;

    fn search(self) -> Result<Fringe, String> {
        Ok(Fringe::new(self.heuristic))
    }
}

/// A*.
pub type Astar = GridPlanner<AstarOptions>;
/// Dijkstra's algorithm.
pub type Dijkstra = GridPlanner<DijkstraOptions>;
/// Greedy best-first search.
pub type GreedyBestFirst = GridPlanner<GreedyOptions>;
/// Weighted A*.
pub type WeightedAstar = GridPlanner<WeightedOptions>;
/// Breadth-first search.
pub type BreadthFirst = GridPlanner<BfsOptions>;
/// Breadth-first search from both ends.
pub type BidirectionalBreadthFirst = GridPlanner<BidirectionalBfsOptions>;
/// A* from both ends.
pub type BidirectionalAstarPlanner = GridPlanner<BidirectionalAstarOptions>;
/// Theta*.
pub type Theta = GridPlanner<ThetaOptions>;
/// Lazy Theta*.
pub type LazyTheta = GridPlanner<LazyThetaOptions>;
/// IDA*.
pub type Ida = GridPlanner<IdaOptions>;
/// Jump point search.
pub type JumpPointSearch = GridPlanner<JumpPointOptions>;
/// LPA*.
pub type LpaStar = GridPlanner<LpaOptions>;
/// D* Lite.
pub type DStarLite = GridPlanner<DStarLiteOptions>;
/// Beam search.
pub type BeamSearch = GridPlanner<BeamOptions>;
/// Fringe search.
pub type FringeSearch = GridPlanner<FringeOptions>;

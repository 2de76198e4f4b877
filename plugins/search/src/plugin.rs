//! The planners behind the plugin contract.
//!
//! Each takes one agent with one goal and submits one plan: the cells of its path, or
//! of an any-angle path the cells where it turns. The metric `expansions` is reported
//! with it, or without it if there is none.

use fleetyard_abi::sdk::{Failure, Options as Given, Planner, Plugin, Sink, options_schema};
use fleetyard_abi::{
    Budget, Capabilities, Capability, Descriptor, Instance, Kind, Motion, PlanRef,
    SharedEnvironment, Status, monotonic_ns,
};
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::{
    BestFirst, Bfs, BidirectionalBfs, Grid, Heuristic, Limit, Neighbors, Order, Outcome, Search,
    Stop, TieBreaking,
};

/// A planner of this crate as a plugin: the options that a user may give decide
/// which.
pub trait Variety: DeserializeOwned + JsonSchema + 'static {
    /// The identifier.
    const ID: &'static str;
    /// The name.
    const NAME: &'static str;
    /// What it is, with its source.
    const ABOUT: &'static str;
    /// How its robot moves.
    const MOTION: Motion = Motion::Pebble;
    /// What searches.
    type Search: Search;
    /// Makes that from the options, or says what is wrong with them.
    fn search(self) -> Result<Self::Search, String>;
}

/// A planner that was made with options of type `V`.
pub struct GridPlanner<V: Variety> {
    search: V::Search,
    grid: Option<Grid>,
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
        let all: Vec<_> = common.iter().chain(motion).copied().collect();
        Descriptor {
            name: V::NAME.into(),
            version: env!("CARGO_PKG_VERSION").into(),
            license: env!("CARGO_PKG_LICENSE").into(),
            capabilities: Capabilities::of(&all),
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
            grid: None,
            path: Vec::new(),
        })
    }
}

fn unsupported(reason: impl Into<String>) -> Failure {
    Failure::new(Status::Unsupported, reason)
}

impl<V: Variety> Planner for GridPlanner<V> {
    fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        _: &Budget,
        _: &dyn Sink,
    ) -> Result<(), Failure> {
        self.grid = None;
        let grid = environment
            .grid()
            .ok_or_else(|| unsupported("only grids are supported"))?;
        let neighbors = match grid.connectivity {
            4 => Neighbors::Four,
            8 => Neighbors::Eight,
            other => {
                let reason = format!("grids with {other} neighbours are not supported");
                return Err(unsupported(reason));
            }
        };
        let passable: Vec<bool> = grid.passable.iter().map(|free| *free != 0).collect();
        let grid = Grid::new(grid.rows, grid.cols, &passable, neighbors)
            .ok_or_else(|| unsupported("the map has more than 2^31 cells, or none"))?;
        self.grid = Some(grid);
        Ok(())
    }

    fn plan(
        &mut self,
        instance: &Instance,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        let grid = self.grid.as_ref().ok_or_else(|| {
            let reason = "there is no map: `prepare` was not called, or failed";
            Failure::new(Status::InvalidInput, reason)
        })?;
        let (start, goal) = question(instance, V::MOTION)?;
        for (what, cell) in [("start", start), ("goal", goal)] {
            if !grid.is_free(cell) {
                let reason = format!("the {what}, cell {cell}, is not a free cell of the map");
                return Err(Failure::new(Status::InvalidInput, reason));
            }
        }
        let answer_by = budget.answer_by_ns();
        let mut told = || monotonic_ns() >= answer_by || sink.cancelled();
        let nodes = (budget.nodes > 0).then_some(budget.nodes);
        let mut limit = Limit::new(nodes, &mut told);
        let answer = self
            .search
            .search(grid, start, goal, &mut limit, &mut self.path);
        sink.metric("expansions", answer.expansions as f64);
        let failed = |status, reason| Err(Failure::new(status, reason));
        match answer.outcome {
            Outcome::Found => {
                let ends = [0, self.path.len() as u64];
                let plan = PlanRef::new(&ends, &self.path)
                    .ok_or_else(|| Failure::new(Status::InternalError, "the path has no cells"))?;
                Ok(sink.submit_plan(plan)?)
            }
            Outcome::NoPath => failed(Status::Infeasible, "the goal cannot be reached"),
            Outcome::GaveUp => failed(
                Status::GaveUp,
                "nothing is left to search, but not everything was searched",
            ),
            Outcome::Stopped(Stop::Nodes) => failed(Status::TimedOut, "the node limit was reached"),
            Outcome::Stopped(Stop::Told) => {
                failed(Status::TimedOut, "the budget ended before a path was found")
            }
        }
    }
}

/// Start and goal, if the instance is one for these planners.
fn question(instance: &Instance, motion: Motion) -> Result<(u32, u32), Failure> {
    if instance.motion != motion {
        return Err(unsupported(match motion {
            Motion::AnyAngle => "only the any-angle motion model is supported",
            _ => "only the pebble motion model is supported",
        }));
    }
    let ([start], 1) = (instance.starts.as_slice(), instance.goals.len()) else {
        let agents = instance.agents();
        let reason = format!("this planner plans for one agent, the instance has {agents}");
        return Err(unsupported(reason));
    };
    match (instance.goals.get(0), instance.window_steps) {
        ([goal], 0) => Ok((*start, *goal)),
        _ => Err(unsupported(
            "only complete plans with one goal are supported",
        )),
    }
}

/// What the planners with a heuristic and a tie-breaking of their own have in common
/// is written once, their defaults differ.
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
        /// Which of several places with equal f is expanded first.
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
    type Search = BestFirst;

    fn search(self) -> Result<BestFirst, String> {
        Ok(BestFirst::dijkstra())
    }
}

options! {
    /// Options of `greedy-best-first`.
    GreedyOptions {
        /// The estimate of what is left; `null` for `manhattan` with four neighbours
        /// and `octile` with eight.
        heuristic: Option<Heuristic> = None,
        /// Which of several places with equal h is expanded first.
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
        /// What the estimate is multiplied by; paths are at most so many times as long
        /// as the shortest, unless the heuristic overestimates by itself.
        #[schemars(range(min = 1.0, max = 1e6))]
        weight: f64 = 1.5,
        /// The estimate of what is left; `null` for `manhattan` with four neighbours
        /// and `octile` with eight.
        heuristic: Option<Heuristic> = None,
        /// Which of several places with equal f is expanded first.
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

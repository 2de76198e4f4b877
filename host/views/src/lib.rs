//! One world, three views: tasks, and the operators that derive from them what planners on grids,
//! on roadmaps and in the plane are given, and one view from another. Plans of views come back into the
//! same world, where they are judged a second time ([`Judged`]).
//!
//! A [`Task`] is the file that a user edits; a [`Problem`] is a task with the files that it names.
//! Lengths are metres, times seconds, angles radians counter-clockwise; x right, y up. The same
//! problem, parameters and seed give the same bits on every machine.

#![forbid(unsafe_code)]

mod cells;
mod contract;
mod frame;
mod free;
mod grid;
mod judge;
mod lower;
mod origin;
mod overlay;
mod parameters;
mod pin;
mod plan_files;
mod representation;
mod roadmap;
mod swept;
mod task;
mod view;
mod world;

pub use cells::{CellsView, grid_to_roadmap};
pub use contract::{PlanTerms, robots_of, visits_of};
pub use free::{FREE_SLACK_M, Free};
pub use grid::{GridSpec, GridView, WorldCells, cell_side_m, world_to_grid};
pub use judge::{GridTerms, Judged, StepCosts, ViewVerdict};
pub use origin::{Origin, VIEW_FORMAT};
pub use overlay::{OverlayReport, OverlaySpec, OverlayView, roadmap_to_grid};
pub use parameters::{BuilderKind, RoadmapParameters, ViewName};
pub use representation::Representation;
pub use roadmap::{
    Builder, ROADMAP_MOST_VERTICES, RoadmapReport, RoadmapSpec, RoadmapView, Sampling,
    given_roadmap, world_to_roadmap,
};
pub use swept::{SweptEdges, SweptView, roadmap_to_world};
pub use task::{
    Agent, End, Fault, Fleets, Place, Positive, Problem, State, TASK_FILE_LIMIT, TASK_FORMAT, Task,
    load_problem, load_task, read_task, save_task, write_task,
};
pub use view::{Given, VIEW_FILE_LIMIT, View, ViewFile, ViewSpec, load_view, read_view};
pub use world::{WorldView, grid_to_world};

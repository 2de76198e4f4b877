//! Files of other tools: one reader and one writer per format.
//!
//! [`Format`] names them all, [`Contents`] is what a file says, and [`Parts`] are what
//! is written. The functions of a single format stand beside, for who knows what it
//! has. Every reader is strict: what a format does not have is an error with its
//! place. `docs/formats.md` says what each format carries and what is lost.

mod agents;
mod ccbs;
mod dynobench;
mod foreign;
mod format;
mod grid;
mod layout;
mod libmrp;
mod lorr;
mod lsmart;
mod pibt2;
mod pieces;
mod planviz;
mod pogema;
mod psipp;
mod rhcr;
mod rows;
mod tracker;
mod transposed;
mod yaml;

pub use agents::{AgentEntry, AgentList};
pub use ccbs::{
    CcbsPlaces, read_ccbs_log, read_ccbs_map, read_ccbs_roadmap, read_ccbs_task,
    write_ccbs_roadmap, write_ccbs_task,
};
pub use dynobench::{
    DYNOBENCH_STATES_PER_S, DynobenchProblem, read_dynobench, write_dynobench_problem,
};
pub(crate) use foreign::foreign;
pub use format::{
    AnyPlan, Contents, Format, Known, Lengths, Parts, Scale, UnreadPlan, Written, grid_size,
    load_any_plan, load_plan_and_roadmap, own_format,
};
pub use grid::{GRID_FORMAT, read_grid, write_grid};
pub use layout::{
    Begin, LacamHeader, Layout, LayoutError, Major, MapSize, PATHS_LIMIT, write_lacam,
    write_mapf_visualizer, write_paths_txt,
};
pub use libmrp::{read_libmrp, read_libmrp_schedule, write_libmrp, write_libmrp_schedule};
pub use lorr::{
    League, LorrInstance, TaskList, load_league, load_lorr, load_lorr_tasks, read_lorr_tasks,
    write_lorr,
};
pub(crate) use lsmart::is_json;
pub use lsmart::{read_lsmart, write_lsmart};
pub use pibt2::{Pibt2Settings, read_pibt2, write_pibt2};
pub use pieces::{Piece, PieceError, pieces};
pub use planviz::{read_planviz, write_planviz};
pub use pogema::read_pogema;
pub use psipp::{read_psipp_plan, write_psipp_problem};
pub use rhcr::read_rhcr;
pub use tracker::read_tracker;
pub use transposed::{TRANSPOSED_HINT, looks_transposed};

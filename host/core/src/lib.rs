//! The domain model: maps, instances, plans, and the files they come from.
//!
//! This crate knows no clock, no plugin and no simulator. Everything in it is
//! plain data with explicit invariants, and every reader reports bad input as
//! an [`InputError`] that names file, line and column.

#![forbid(unsafe_code)]

mod annotation_file;
mod digest;
pub mod document;
mod error;
mod files;
pub mod formats;
mod frame;
mod grid;
mod guidance_file;
mod instance;
pub mod json;
mod map_file;
mod path_list;
pub mod plan_file;
mod roadmap;
pub mod roadmap_file;
mod scenario;
mod search;
mod shell;
mod trajectory;
pub mod trajectory_file;
mod words;

pub use fleetyard_abi::moves::{self, OFF_MAP};
pub use fleetyard_abi::{
    Annotation, ControlPlan, GridPlan, Heading, PathEncoding, Robot, Segment, Shape,
};

pub use annotation_file::{
    AnnotationFile, load_annotations, read_annotations, save_annotations, write_annotations,
};
pub use digest::{Digest, Hasher};
pub use error::{InputError, nearest, short_numbers};
pub use files::{
    SQLITE_MAGIC, STORE_MARK, create_output, is_unseen, load_file, missing_hint, one_line,
    open_input, open_regular, read_file, shown, unmarked, write_all_atomically, write_atomically,
};
pub use frame::{cell_center_m, cell_of_point};
pub use grid::{
    Connectivity, Grid, MovesError, Role, Separation, move_bit, move_step, opposite_move,
};
pub use guidance_file::{
    GUIDANCE_FILE_LIMIT, load_guidance, read_guidance, save_guidance, write_guidance,
};
pub use instance::{GridInstance, InstanceError};
pub use map_file::{MAP_FILE_LIMIT, load_map, map_bytes, read_map, save_map, write_map};
pub use plan_file::{PlanFile, load_plan, read_plan, save_plan, write_plan};
pub use roadmap::{Roadmap, RoadmapError, RoadmapPlan, RoadmapPlanError, Visit};
pub use roadmap_file::{
    RoadmapPlanFile, load_roadmap, load_roadmap_plan, read_roadmap, read_roadmap_plan,
    save_roadmap, save_roadmap_plan, write_roadmap, write_roadmap_plan,
};
pub use scenario::{
    SCEN_FILE_LIMIT, Scenario, ScenarioEntry, find_map, load_scen, read_scen, save_scen, write_scen,
};
pub use search::{GridSearch, OctileLength};
pub use shell::quoted;
pub use trajectory::{Fastest, Knot, Knots, TrajectoryError, TrajectoryPlan, check_controls};
pub use trajectory_file::{
    ControlFile, MotionFile, TrajectoryFile, load_trajectories, read_motions, read_trajectories,
    save_trajectories, write_trajectories,
};
pub use words::Words;

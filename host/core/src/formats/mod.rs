//! Files of other tools.

mod agents;
mod layout;
mod libmrp;
mod lorr;
mod pibt2;
mod pieces;
mod planviz;
mod transposed;
mod yaml;

pub use agents::{AgentEntry, AgentList};
pub use layout::{
    Begin, LacamHeader, Layout, LayoutError, Major, MapSize, PATHS_LIMIT, write_lacam,
    write_mapf_visualizer, write_paths_txt,
};
pub use libmrp::{read_libmrp, read_libmrp_schedule, write_libmrp, write_libmrp_schedule};
pub use lorr::{LorrInstance, load_lorr, write_lorr};
pub use pibt2::{Pibt2Settings, read_pibt2, write_pibt2};
pub use pieces::{Piece, PieceError, pieces};
pub use planviz::{PLANVIZ_LIMIT, read_planviz, write_planviz};
pub use transposed::{TRANSPOSED_HINT, looks_transposed};

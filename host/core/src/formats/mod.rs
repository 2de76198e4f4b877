//! Files of other tools.

mod agents;
mod layout;
mod lorr;
mod pibt2;
mod pieces;
mod transposed;

pub use agents::{AgentEntry, AgentList};
pub use layout::{
    Begin, LacamHeader, Layout, LayoutError, Major, MapSize, PATHS_LIMIT, write_lacam,
    write_paths_txt,
};
pub use lorr::{LorrInstance, load_lorr, write_lorr};
pub use pibt2::{Pibt2Settings, read_pibt2, write_pibt2};
pub use pieces::{Piece, PieceError, pieces};
pub use transposed::{TRANSPOSED_HINT, looks_transposed};

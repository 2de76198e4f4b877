//! Files of other tools.

mod layout;
mod pieces;
mod transposed;

pub use layout::{
    Begin, LacamHeader, Layout, LayoutError, Major, MapSize, PATHS_LIMIT, write_lacam,
    write_paths_txt,
};
pub use pieces::{Piece, PieceError, pieces};
pub use transposed::{TRANSPOSED_HINT, looks_transposed};

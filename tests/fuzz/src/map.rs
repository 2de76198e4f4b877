//! Map files, with and without masks of moves.

use fleetyard_core::{Connectivity, Grid, map_bytes, read_map};

use super::check_error;

const SOURCE: &str = "folder/a.map";

/// Reads a map file.
pub fn run(data: &[u8]) {
    let grid = match read_map(SOURCE, data) {
        Ok(grid) => grid,
        Err(error) => {
            check_error(&error, SOURCE, data);
            // Every fault of a map but absence has a place.
            assert!(
                error.line.is_some() || data.trim_ascii().is_empty(),
                "{error:?}"
            );
            return;
        }
    };
    assert_eq!(grid.name(), "a");
    let cells = u64::from(grid.rows()) * u64::from(grid.cols());
    assert_eq!(u64::from(grid.cell_count()), cells);
    assert_eq!(grid.terrain().len() as u64, cells);
    // Every cell is a letter of the file.
    assert!(grid.terrain().len() <= data.len());
    let again = Grid::new("a", grid.rows(), grid.cols(), grid.terrain().to_vec());
    let again = again
        .expect("the same terrain")
        .with_moves(grid.move_masks(Connectivity::Eight));
    assert_eq!(again.as_ref(), Ok(&grid));
    let written = map_bytes(&grid);
    assert_eq!(read_map(SOURCE, &written).as_ref(), Ok(&grid));
    let passable = (0..grid.cell_count()).filter(|cell| grid.is_passable(*cell));
    assert_eq!(passable.count(), grid.passable_count() as usize);
    let components = grid.components(Connectivity::Four);
    let labelled = components.iter().filter(|label| **label != 0).count();
    assert_eq!(labelled, grid.passable_count() as usize);
    // Line ends are no part of a map.
    let text: Vec<u8> = written
        .iter()
        .flat_map(|byte| match byte {
            b'\n' => b"\r\n".to_vec(),
            byte => vec![*byte],
        })
        .collect();
    let other = read_map(SOURCE, &text).expect("the same map");
    assert_eq!(other, grid);
    assert_eq!(other.digest(), grid.digest());
}

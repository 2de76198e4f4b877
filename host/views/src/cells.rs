//! Grid to roadmap: free cells are vertices, moves are edges.

use fleetyard_core::{Connectivity, Grid, InputError, Roadmap, cell_center_m};
use serde_json::{Value, json};

use crate::{Origin, Representation, VIEW_FORMAT};

/// The roadmap of a map.
#[derive(Debug, Clone)]
pub struct CellsView {
    /// A vertex in the middle of every free cell, in the order of cells, and an edge for every move;
    /// its length in metres is that of the move.
    pub roadmap: Roadmap,
    /// The cell of every vertex.
    pub cells: Vec<u32>,
    /// Operator, parameters and source.
    pub origin: Origin,
}

impl CellsView {
    /// Origin of the roadmap.
    pub fn about(&self) -> Value {
        json!({
            "format": VIEW_FORMAT,
            "representation": Representation::Roadmap,
            "origin": self.origin,
            "roadmap_digest": self.roadmap.digest(),
            "vertices": self.roadmap.vertices(),
            "edges": self.roadmap.edge_count(),
        })
    }

    /// The vertex of a cell; none for cells that are not free.
    pub fn vertex(&self, cell: u32) -> Option<u32> {
        let found = self.cells.binary_search(&cell).ok();
        found.map(|vertex| vertex as u32)
    }
}

/// The roadmap of a grid whose lower left corner is at `corner_m`. Moves that masks forbid are no
/// edges, and one-way moves are edges one way. Takes time linear in the number of cells.
pub fn grid_to_roadmap(
    grid: &Grid,
    connectivity: Connectivity,
    cell_m: f64,
    corner_m: [f64; 2],
) -> Result<CellsView, InputError> {
    if !(cell_m.is_finite() && cell_m > 0.0) {
        let reason = format!("cells of {cell_m} m are no cells");
        return Err(InputError::new(grid.name(), reason).hint("give the side of a cell in metres"));
    }
    let is_free = |cell: &u32| grid.is_passable(*cell);
    let cells: Vec<u32> = (0..grid.cell_count()).filter(is_free).collect();
    let mut vertex_of = vec![0; grid.cell_count() as usize];
    for (vertex, cell) in (0..).zip(&cells) {
        vertex_of[*cell as usize] = vertex;
    }
    let (x_m, y_m) = cells
        .iter()
        .map(|cell| {
            let (x, y) = cell_center_m(grid, cell_m, *cell);
            (corner_m[0] + x, corner_m[1] + y)
        })
        .unzip();
    let vertex = |cell: u32| vertex_of[cell as usize];
    let edges = cells.iter().flat_map(|cell| {
        let to = grid.neighbors(*cell, connectivity);
        to.map(move |to| (vertex(*cell), vertex(to)))
    });
    let roadmap = Roadmap::new(x_m, y_m, edges)
        .map_err(|error| InputError::new(grid.name(), error.to_string()))?;
    let parameters = json!({
        "neighbors": connectivity.degree(),
        "cell_m": cell_m,
        "corner_m": corner_m,
    });
    Ok(CellsView {
        roadmap,
        cells,
        origin: Origin::of_map(grid, "grid-to-roadmap", parameters),
    })
}

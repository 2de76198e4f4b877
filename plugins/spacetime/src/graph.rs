//! The graph the planners walk on: the passable cells of a 4-connected grid,
//! numbered densely.
//!
//! Not a general graph. Every planner here relies on two properties of the
//! 4-connected grid: a vertex has at most four neighbours, and the graph is
//! bipartite, so that the distance to any target differs by an odd number between
//! neighbours: by exactly one where no street is one-way.
//!
//! Streets may be one-way: [`Graph::around`] is where one gets from a vertex, [`Graph::sources`] where
//! one comes from. Searches from goals go by the second.

use fleetyard_abi::Heading;

/// Dense number of a passable cell.
pub type Vertex = u32;

/// Number of directions: north, east, south, west. `d` and `(d + 2) % 4` are opposite, and
/// turning by 90° leads from one to the next or the last.
pub const DIRECTIONS: usize = 4;

/// The direction of a heading.
pub fn direction(heading: Heading) -> u8 {
    match heading {
        Heading::North => 0,
        Heading::East => 1,
        Heading::South => 2,
        Heading::West => 3,
    }
}

/// The heading of a direction.
pub fn heading(direction: u8) -> Heading {
    match usize::from(direction) % DIRECTIONS {
        0 => Heading::North,
        1 => Heading::East,
        2 => Heading::South,
        _ => Heading::West,
    }
}

/// Passable cells and their neighbours.
///
/// A missing neighbour is the sentinel [`Graph::wall`], one past the last vertex,
/// so that tables with one spare entry can be read without a branch.
#[derive(Debug, Clone)]
pub struct Graph {
    neighbors: Vec<[Vertex; DIRECTIONS]>,
    /// The vertices from which one comes, where these are not those where one gets.
    sources: Option<Vec<[Vertex; DIRECTIONS]>>,
    degrees: Vec<u8>,
    open: Vec<bool>,
    cells: Vec<u32>,
    vertices: Vec<Vertex>,
    cols: u32,
}

impl Graph {
    /// Numbers the passable cells row by row. `passable` has `rows · cols` entries.
    pub fn new(rows: usize, cols: usize, passable: &[bool]) -> Self {
        let count = passable.iter().filter(|&&p| p).count();
        let wall = count as Vertex;
        let mut vertices = vec![wall; rows * cols];
        let mut cells = Vec::with_capacity(count);
        for (cell, _) in passable.iter().enumerate().filter(|(_, p)| **p) {
            vertices[cell] = cells.len() as Vertex;
            cells.push(cell as u32);
        }
        let mut neighbors = Vec::with_capacity(count + 1);
        for &cell in &cells {
            let (row, col) = (cell as usize / cols, cell as usize % cols);
            let at = |inside: bool, cell: usize| if inside { vertices[cell] } else { wall };
            let cell = cell as usize;
            let around = [
                at(row > 0, cell.wrapping_sub(cols)),
                at(col + 1 < cols, cell + 1),
                at(row + 1 < rows, cell + cols),
                at(col > 0, cell.wrapping_sub(1)),
            ];
            neighbors.push(around);
        }
        neighbors.push([wall; DIRECTIONS]);
        Self::from_parts(neighbors, None, cells, vertices, cols)
    }

    /// The same with one-way streets: bit d of a cell's mask allows the move from there in direction d
    /// to a passable neighbour.
    pub fn with_moves(rows: usize, cols: usize, passable: &[bool], moves: &[u8]) -> Self {
        let whole = Self::new(rows, cols, passable);
        let wall = whole.wall();
        let may = |v: Vertex, d: usize| moves[whole.cell(v) as usize] >> d & 1 == 1;
        let lead = |v: Vertex, d: usize, allowed: bool| {
            let u = whole.around(v)[d];
            if u != wall && allowed { u } else { wall }
        };
        let vertices = || 0..whole.len() as Vertex;
        let mut neighbors: Vec<_> = vertices()
            .map(|v| std::array::from_fn(|d| lead(v, d, may(v, d))))
            .collect();
        let back = |v: Vertex, d: usize| {
            let u = whole.around(v)[d];
            u != wall && may(u, (d + 2) % DIRECTIONS)
        };
        let mut sources: Vec<_> = vertices()
            .map(|v| std::array::from_fn(|d| lead(v, d, back(v, d))))
            .collect();
        neighbors.push([wall; DIRECTIONS]);
        sources.push([wall; DIRECTIONS]);
        let sources = (sources != neighbors).then_some(sources);
        Self::from_parts(neighbors, sources, whole.cells, whole.vertices, cols)
    }

    fn from_parts(
        neighbors: Vec<[Vertex; DIRECTIONS]>,
        sources: Option<Vec<[Vertex; DIRECTIONS]>>,
        cells: Vec<u32>,
        vertices: Vec<Vertex>,
        cols: usize,
    ) -> Self {
        let wall = cells.len() as Vertex;
        let degree =
            |around: &[Vertex; DIRECTIONS]| around.iter().filter(|&&v| v != wall).count() as u8;
        let degrees: Vec<u8> = neighbors.iter().map(degree).collect();
        let leads_on = |v: &Vertex| degrees[*v as usize] > 1;
        let open =
            |around: &[Vertex; DIRECTIONS]| around.iter().filter(|v| leads_on(v)).count() > 2;
        let open = neighbors.iter().map(open).collect();
        Self {
            neighbors,
            sources,
            degrees,
            open,
            cells,
            vertices,
            cols: cols as u32,
        }
    }

    /// Number of vertices.
    #[inline]
    pub fn len(&self) -> usize {
        self.cells.len()
    }

    /// True if there is no passable cell.
    pub fn is_empty(&self) -> bool {
        self.cells.is_empty()
    }

    /// The sentinel that stands for "no such neighbour".
    #[inline]
    pub fn wall(&self) -> Vertex {
        self.cells.len() as Vertex
    }

    /// True if a move somewhere cannot be undone by the opposite one.
    #[inline]
    pub fn is_directed(&self) -> bool {
        self.sources.is_some()
    }

    /// By direction the neighbours from which a move leads here, [`Graph::wall`] where none does.
    #[inline]
    pub fn sources(&self, v: Vertex) -> &[Vertex; DIRECTIONS] {
        &self.sources.as_ref().unwrap_or(&self.neighbors)[v as usize]
    }

    /// The four neighbours that a move leads to, [`Graph::wall`] where there is none.
    #[inline]
    pub fn around(&self, v: Vertex) -> &[Vertex; DIRECTIONS] {
        &self.neighbors[v as usize]
    }

    /// The neighbours that exist.
    #[inline]
    pub fn neighbors(&self, v: Vertex) -> impl Iterator<Item = Vertex> + '_ {
        let wall = self.wall();
        self.around(v).iter().copied().filter(move |&u| u != wall)
    }

    /// Number of neighbours.
    #[inline]
    pub fn degree(&self, v: Vertex) -> u32 {
        u32::from(self.degrees[v as usize])
    }

    /// True if at least two ways lead on from `v` from any neighbour, dead ends of a single cell
    /// not counted.
    #[inline]
    pub fn is_open(&self, v: Vertex) -> bool {
        self.open[v as usize]
    }

    /// The grid cell of a vertex.
    #[inline]
    pub fn cell(&self, v: Vertex) -> u32 {
        self.cells[v as usize]
    }

    /// Row and column of a vertex.
    #[inline]
    pub fn place(&self, v: Vertex) -> [u32; 2] {
        let cell = self.cell(v);
        [cell / self.cols, cell % self.cols]
    }

    /// Steps between two vertices if nothing were in the way.
    #[inline]
    pub fn manhattan(&self, a: Vertex, b: Vertex) -> u32 {
        let ([row, col], [to_row, to_col]) = (self.place(a), self.place(b));
        row.abs_diff(to_row) + col.abs_diff(to_col)
    }

    /// True for the directions that would lead nearer from one vertex to another if nothing were in
    /// the way.
    #[inline]
    pub fn towards(&self, from: Vertex, to: Vertex) -> [bool; DIRECTIONS] {
        let ([row, col], [to_row, to_col]) = (self.place(from), self.place(to));
        [row > to_row, col < to_col, row < to_row, col > to_col]
    }

    /// The vertex at a row and a column, which may lie off the map.
    pub fn at(&self, [row, col]: [i64; 2]) -> Option<Vertex> {
        let cols = i64::from(self.cols);
        let inside = row >= 0 && (0..cols).contains(&col);
        let cell = u32::try_from(row * cols + col).ok().filter(|_| inside)?;
        self.vertex(cell)
    }

    /// Number of cells of the grid, obstacles among them.
    pub fn cell_count(&self) -> usize {
        self.vertices.len()
    }

    /// The vertex of a grid cell, or `None` for an obstacle or a cell off the map.
    #[inline]
    pub fn vertex(&self, cell: u32) -> Option<Vertex> {
        self.vertices
            .get(cell as usize)
            .copied()
            .filter(|&v| v != self.wall())
    }
}

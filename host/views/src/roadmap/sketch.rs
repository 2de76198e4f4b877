//! Roadmaps while they are made.

/// Vertices and undirected edges while they are made.
#[derive(Debug, Default)]
pub(super) struct Sketch {
    pub(super) at_m: Vec<[f64; 2]>,
    pub(super) edges: Vec<(u32, u32)>,
}

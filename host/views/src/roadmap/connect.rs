//! Vertices joined with the nearest that they see.

use rstar::RTree;
use rstar::primitives::GeomWithData;

use crate::Free;

/// An entry of an index: a place with its vertex.
pub(super) type Entry = GeomWithData<[f64; 2], u32>;

/// An index of places by their numbers.
pub(super) fn index(at_m: &[[f64; 2]]) -> RTree<Entry> {
    let entries = (0..).zip(at_m).map(|(vertex, at)| Entry::new(*at, vertex));
    RTree::bulk_load(entries.collect())
}

/// Joins vertices with the `neighbors` nearest to which a disc can be swept: every vertex, or the first
/// `only` if that is not 0. Of the nearest, four times as many and eight more are looked at.
pub(super) fn nearest_visible(
    at_m: &[[f64; 2]],
    only: usize,
    neighbors: usize,
    free: &Free,
    radius_m: f64,
) -> Vec<(u32, u32)> {
    let index = index(at_m);
    let most = if only == 0 { at_m.len() } else { only };
    let looks = 4 * neighbors + 8;
    let mut edges = Vec::with_capacity(most * neighbors);
    let mut near: Vec<(f64, u32)> = Vec::with_capacity(looks);
    for (vertex, at) in (0..).zip(&at_m[..most]) {
        near.clear();
        let found = index.nearest_neighbor_iter_with_distance_2(at);
        let others = found.filter(|(other, _)| other.data != vertex);
        near.extend(
            others
                .take(looks)
                .map(|(other, square)| (square, other.data)),
        );
        // The index leaves the order of what is equally far to its own shape.
        near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let seen = near
            .iter()
            .filter(|(_, other)| free.sweeps(*at, at_m[*other as usize], radius_m));
        edges.extend(seen.take(neighbors).map(|(_, other)| (vertex, *other)));
    }
    edges
}

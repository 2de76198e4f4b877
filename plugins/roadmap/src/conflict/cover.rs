//! A lower bound of what a team has to give up, from what each pair has to.
//!
//! If the agents i and j together arrive at least w(i, j) seconds later than their paths do, then the sum over all is at least
//! that of the least x ≥ 0 with x(i) + x(j) ≥ w(i, j) for all pairs: the edge-weighted vertex cover of J. Li, A. Felner,
//! E. Boyarski, H. Ma, S. Koenig ("Improved heuristics for multi-agent path finding with conflict-based search", IJCAI 2019).
//! Seconds are not whole, so that it is a linear program; its dual is half a matching of greatest weight in the bipartite graph
//! that has each agent twice, found by the Hungarian method.

/// The least sum of x ≥ 0 with x(i) + x(j) ≥ w for all edges (i, j, w), which are finite and not negative.
pub(super) fn cover(edges: &[(u32, u32, f64)]) -> f64 {
    let mut vertices: Vec<u32> = edges.iter().flat_map(|(i, j, _)| [*i, *j]).collect();
    vertices.sort_unstable();
    vertices.dedup();
    let count = vertices.len();
    if edges.len() <= 1 {
        return edges.first().map_or(0.0, |edge| edge.2);
    }
    let mut weights = vec![0.0_f64; count * count];
    for (i, j, weight) in edges {
        let [i, j] = [i, j].map(|agent| vertices.partition_point(|vertex| vertex < agent));
        for at in [i * count + j, j * count + i] {
            weights[at] = weights[at].max(*weight);
        }
    }
    matching(count, &weights) / 2.0
}

/// The greatest weight of a matching of the rows of a square matrix to its columns.
fn matching(count: usize, weights: &[f64]) -> f64 {
    // Potentials of rows and columns for costs −w, numbered from 1; column 0 is where a new row begins.
    let (mut rows, mut columns) = (vec![0.0_f64; count + 1], vec![0.0_f64; count + 1]);
    let mut row_of = vec![0_usize; count + 1];
    let mut before = vec![0_usize; count + 1];
    let cost = |row: usize, column: usize| -weights[(row - 1) * count + column - 1];
    for row in 1..=count {
        row_of[0] = row;
        let mut column = 0;
        let mut slack = vec![f64::INFINITY; count + 1];
        let mut used = vec![false; count + 1];
        while row_of[column] != 0 {
            used[column] = true;
            let (at, mut least, mut next) = (row_of[column], f64::INFINITY, 0);
            for other in (1..=count).filter(|other| !used[*other]) {
                let reduced = cost(at, other) - rows[at] - columns[other];
                if reduced < slack[other] {
                    (slack[other], before[other]) = (reduced, column);
                }
                if slack[other] < least {
                    (least, next) = (slack[other], other);
                }
            }
            for other in 0..=count {
                if used[other] {
                    rows[row_of[other]] += least;
                    columns[other] -= least;
                } else {
                    slack[other] -= least;
                }
            }
            column = next;
        }
        while column != 0 {
            row_of[column] = row_of[before[column]];
            column = before[column];
        }
    }
    (1..=count)
        .map(|column| -cost(row_of[column], column))
        .sum()
}

//! Square lattices with moves in 4, 8, 16 or 32 directions.

use super::builder::ROADMAP_MOST_VERTICES;
use super::sketch::Sketch;
use crate::Free;

/// The directions of one quadrant, from (1, 0) on and without (0, 1): 1, 2, 4 or 8 of them. Each
/// doubling puts the sum of two neighbours between them.
fn quadrant(directions: u32) -> Vec<[i64; 2]> {
    let mut fan = vec![[1, 0], [0, 1]];
    while (fan.len() - 1) * 4 < directions as usize {
        let between = fan.windows(2).flat_map(|pair| {
            let [a, b] = [pair[0], pair[1]];
            [a, [a[0] + b[0], a[1] + b[1]]]
        });
        fan = between.chain([[0, 1]]).collect();
    }
    fan.pop();
    fan
}

/// Adds the free places of a square lattice, and the edges among them.
pub(super) fn build(
    sketch: &mut Sketch,
    free: &Free,
    radius_m: f64,
    side_m: f64,
    directions: u32,
) -> Result<(), String> {
    let bounds = free.bounds();
    let count = |axis: usize| {
        let room = bounds.max[axis] - bounds.min[axis] - 2.0 * radius_m;
        (room / side_m + 1e-9).floor() + 1.0
    };
    let (cols, rows) = (count(0), count(1));
    if cols * rows > ROADMAP_MOST_VERTICES as f64 {
        return Err(format!(
            "the lattice has {cols} by {rows} places, more than {ROADMAP_MOST_VERTICES}"
        ));
    }
    let (cols, rows) = (cols.max(0.0) as i64, rows.max(0.0) as i64);
    let place = |col: i64, row: i64| {
        let along = |axis: usize, number: i64| {
            (bounds.min[axis] + radius_m + number as f64 * side_m).min(bounds.max[axis] - radius_m)
        };
        [along(0, col), along(1, row)]
    };
    let taken: std::collections::BTreeMap<[u64; 2], u32> = (0..)
        .zip(&sketch.at_m)
        .map(|(vertex, at)| (at.map(f64::to_bits), vertex))
        .collect();
    let mut vertex_of = vec![None; (cols * rows) as usize];
    for row in 0..rows {
        for col in 0..cols {
            let at = place(col, row);
            let slot = &mut vertex_of[(row * cols + col) as usize];
            *slot = taken.get(&at.map(f64::to_bits)).copied();
            if slot.is_none() && free.holds(at, radius_m) {
                *slot = Some(sketch.at_m.len() as u32);
                sketch.at_m.push(at);
            }
        }
    }
    // Half of all directions: the other half is the way back.
    let quadrant = quadrant(directions);
    let turned = quadrant.iter().map(|[x, y]| [-y, *x]);
    let half: Vec<[i64; 2]> = quadrant.iter().copied().chain(turned).collect();
    for row in 0..rows {
        for col in 0..cols {
            let Some(from) = vertex_of[(row * cols + col) as usize] else {
                continue;
            };
            for [x, y] in &half {
                let (col, row) = (col + x, row + y);
                if !(0..cols).contains(&col) || !(0..rows).contains(&row) {
                    continue;
                }
                let Some(to) = vertex_of[(row * cols + col) as usize] else {
                    continue;
                };
                let [a, b] = [from, to].map(|vertex| sketch.at_m[vertex as usize]);
                if free.sweeps(a, b, radius_m) {
                    sketch.edges.push((from, to));
                }
            }
        }
    }
    Ok(())
}

//! Pairwise symmetries: conflicts that stand for many others, and the constraints that resolve
//! them all at once (Li, Harabor, Stuckey, Ma, Gange, Koenig, "Pairwise symmetry reasoning for
//! multi-agent path finding search", AIJ 301, 2021).
//!
//! - **Targets**: an agent rests where another one passes. Either it arrives later, or nobody
//!   else comes there from then on. Sound in both motion models and with delays.
//! - **Corridors**: two agents meet in a chain of cells with two neighbours each. One of them
//!   has to be late at its far end. The times come from searches in the motion model; a robot
//!   that turns is never faster than a pebble, so that the chain's length stays a bound.
//! - **Rectangles**: two pebbles on cheapest paths that cross in open space in the same two
//!   directions. What forbids the far side to one of them is a barrier. Only where both have
//!   one goal and no delays are asked for: prefixes of cheapest paths are cheapest only there,
//!   and for robots that turn cells do not say what a move costs.

use fleetyard_plugin_spacetime::graph::{Graph, Vertex};

use crate::mdd::SEVERAL;

/// A chain of cells with two neighbours each, from one end to the other, ends included.
pub(crate) fn corridor(graph: &Graph, v: Vertex) -> Option<Vec<Vertex>> {
    if graph.degree(v) != 2 {
        return None;
    }
    let mut sides = graph.neighbors(v);
    let (one, other) = sides.next().zip(sides.next())?;
    let walk = |first: Vertex| {
        let mut chain = vec![first];
        let (mut before, mut at) = (v, first);
        while graph.degree(at) == 2 && at != v {
            let next = graph.neighbors(at).find(|&u| u != before)?;
            (before, at) = (at, next);
            chain.push(at);
        }
        // Round in a circle there is no end.
        (at != v).then_some(chain)
    };
    let mut chain = walk(one)?;
    chain.reverse();
    chain.push(v);
    chain.extend(walk(other)?);
    Some(chain)
}

/// The direction in which an agent goes through a chain around a step: the chain's ends, first
/// the one that the agent comes from.
pub(crate) fn passage(path: &[Vertex], chain: &[Vertex], time: u32) -> Option<[Vertex; 2]> {
    let (&one, &other) = chain.first().zip(chain.last())?;
    let time = (time as usize).min(path.len() - 1);
    let entered = path[..=time]
        .iter()
        .rposition(|&v| v == one || v == other)?;
    let inside = path[entered..].iter().take_while(|v| chain.contains(v));
    let left = inside.skip(1).find(|&&v| v == one || v == other)?;
    let ends = [path[entered], *left];
    (ends[0] != ends[1]).then_some(ends)
}

/// Two barriers, one for each agent, and which of them cannot be passed at the same cost.
pub(crate) struct Rectangle {
    pub(crate) barriers: [Vec<(Vertex, u32)>; 2],
    pub(crate) cardinal: [bool; 2],
    /// True if the way to the barrier begins at step 0, so that it may forbid more than what
    /// cheapest paths come through.
    pub(crate) whole: [bool; 2],
}

/// The single cells of an agent's MDD nearest to its start and its goal, before and after a
/// conflict, with nothing but the shortest ways in between.
fn segment(
    graph: &Graph,
    singletons: &[Vertex],
    v: Vertex,
    time: u32,
) -> Option<[((i64, i64), i64); 2]> {
    let place = |v: Vertex| graph.place(v).map(i64::from).into();
    let far = |a: (i64, i64), b: (i64, i64)| (a.0 - b.0).abs() + (a.1 - b.1).abs();
    let here = place(v);
    let single = |t: usize| singletons.get(t).copied().filter(|&v| v != SEVERAL);
    let start = (0..=time as usize).find_map(|t| {
        let start = place(single(t)?);
        (far(start, here) == i64::from(time) - t as i64).then_some((start, t as i64))
    })?;
    let goal = (time as usize..singletons.len()).rev().find_map(|t| {
        let goal = place(single(t)?);
        let straight = far(start.0, goal) == t as i64 - start.1
            && far(here, goal) == t as i64 - i64::from(time);
        straight.then_some((goal, t as i64))
    })?;
    Some([start, goal])
}

/// The rectangle that a conflict of two agents in a cell is part of.
pub(crate) fn rectangle(
    graph: &Graph,
    singletons: [&[Vertex]; 2],
    v: Vertex,
    time: u32,
) -> Option<Rectangle> {
    let [a, b] = singletons.map(|singletons| segment(graph, singletons, v, time));
    let (a, b) = a.zip(b)?;
    let whole = [a, b].map(|[start, _]| start.1 == 0);
    let sign = |from: i64, to: i64| (to - from).signum();
    let down = [a, b].map(|[s, g]| sign(s.0.0, g.0.0));
    let right = [a, b].map(|[s, g]| sign(s.0.1, g.0.1));
    let common = |signs: [i64; 2]| match signs {
        [x, 0] | [0, x] => Some(x),
        [x, y] if x == y => Some(x),
        _ => None,
    };
    let (down, right) = (common(down)?, common(right)?);
    if down == 0 || right == 0 {
        return None;
    }
    // Turned so that both go towards larger numbers.
    let turned = |(row, col): (i64, i64)| (row * down, col * right);
    let [sa, ga, sb, gb] = [a[0], a[1], b[0], b[1]].map(|(place, _)| turned(place));
    let near = (sa.0.max(sb.0), sa.1.max(sb.1));
    let end = (ga.0.min(gb.0), ga.1.min(gb.1));
    // The one that comes in at the near row goes along the columns, the other along the rows:
    // their ways cross if each begins on the border that it enters by.
    let first_along_rows = if sa.1 == near.1 && sb.0 == near.0 {
        true
    } else if sb.1 == near.1 && sa.0 == near.0 {
        false
    } else {
        return None;
    };
    // Every place of the rectangle has one time, at which either of them may be there. The
    // agents' own starts lie before it in both directions, or on its border.
    let here = turned(graph.place(v).map(i64::from).into());
    let when = |place: (i64, i64)| i64::from(time) + (place.0 - here.0) + (place.1 - here.1);
    let vertex = |place: (i64, i64)| graph.at([place.0 * down, place.1 * right]);
    let barrier = |places: &mut dyn Iterator<Item = (i64, i64)>| -> Vec<(Vertex, u32)> {
        places
            .filter_map(|place| Some((vertex(place)?, u32::try_from(when(place)).ok()?)))
            .collect()
    };
    let far_row = barrier(&mut (near.1..=end.1).map(|col| (end.0, col)));
    let far_col = barrier(&mut (near.0..=end.0).map(|row| (row, end.1)));
    // An agent that goes along the rows and cannot leave by the far column has to cross the
    // far row; the other way round for the other one.
    Some(if first_along_rows {
        Rectangle {
            barriers: [far_row, far_col],
            cardinal: [ga.1 == end.1, gb.0 == end.0],
            whole,
        }
    } else {
        Rectangle {
            barriers: [far_col, far_row],
            cardinal: [ga.0 == end.0, gb.1 == end.1],
            whole,
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corridors_end_where_ways_part() {
        let rows = ["...", "@.@", "@.@", "@.@", "..."];
        let passable: Vec<bool> = rows.concat().bytes().map(|b| b == b'.').collect();
        let graph = Graph::new(5, 3, &passable);
        let vertex = |cell| graph.vertex(cell).unwrap();
        let chain: Vec<_> = [1, 4, 7, 10, 13].map(vertex).into();
        let found = corridor(&graph, vertex(7)).unwrap();
        assert!(found == chain || found.iter().rev().eq(&chain), "{found:?}");
        assert_eq!(corridor(&graph, vertex(1)), None);
        let path = [0, 1, 4, 7, 10, 13, 14].map(vertex);
        assert_eq!(passage(&path, &chain, 3), Some([vertex(1), vertex(13)]));
        assert_eq!(passage(&path[..4], &chain, 3), None, "it stays inside");
        let ring = Graph::new(2, 2, &[true; 4]);
        assert_eq!(corridor(&ring, 0), None);
    }
}

//! Edge-weighted minimum vertex covers: numbers for the agents, as small as possible in sum,
//! such that the two of every edge add up to its weight (Li et al., "Improved heuristics for
//! multi-agent path finding with conflict-based search", IJCAI 2019).

use std::collections::BTreeMap;

/// Components with more agents get a bound instead of the optimum.
const MOST_EXACT: usize = 12;

/// The least sum, or a lower bound of it where that would take long. Edges are pairs of agents
/// with their weights above zero.
pub(crate) fn least_cover(edges: &[(u32, u32, u32)]) -> u32 {
    let mut of_agent: BTreeMap<u32, usize> = BTreeMap::new();
    let mut components: Vec<Vec<(u32, u32, u32)>> = Vec::new();
    for &edge in edges {
        let places = [edge.0, edge.1].map(|agent| of_agent.get(&agent).copied());
        let place = match places {
            [Some(one), Some(other)] if one != other => {
                let moved = std::mem::take(&mut components[other]);
                for edge in &moved {
                    of_agent.insert(edge.0, one);
                    of_agent.insert(edge.1, one);
                }
                components[one].extend(moved);
                one
            }
            [Some(place), _] | [None, Some(place)] => place,
            [None, None] => {
                components.push(Vec::new());
                components.len() - 1
            }
        };
        of_agent.insert(edge.0, place);
        of_agent.insert(edge.1, place);
        components[place].push(edge);
    }
    components.iter_mut().map(|edges| of_component(edges)).sum()
}

fn of_component(edges: &mut [(u32, u32, u32)]) -> u32 {
    // Heavy edges first: they decide most.
    edges.sort_by_key(|&(a, b, weight)| (std::cmp::Reverse(weight), a, b));
    let mut agents: Vec<u32> = edges.iter().flat_map(|edge| [edge.0, edge.1]).collect();
    agents.sort_unstable();
    agents.dedup();
    if agents.len() > MOST_EXACT {
        // Edges that share no agent add up.
        let mut used: Vec<u32> = Vec::new();
        let mut sum = 0;
        for &(a, b, weight) in edges.iter() {
            if !used.contains(&a) && !used.contains(&b) {
                used.extend([a, b]);
                sum += weight;
            }
        }
        return sum;
    }
    let place = |agent| agents.binary_search(&agent).unwrap_or(0);
    let edges: Vec<(usize, usize, u32)> = edges
        .iter()
        .map(|&(a, b, weight)| (place(a), place(b), weight))
        .collect();
    let mut best = edges.iter().map(|edge| edge.2).sum();
    branch(&edges, &mut vec![0; agents.len()], 0, &mut best);
    best
}

/// Covers the first edge that is not covered in every way that can be best.
fn branch(edges: &[(usize, usize, u32)], values: &mut Vec<u32>, sum: u32, best: &mut u32) {
    if sum >= *best {
        return;
    }
    let open = edges
        .iter()
        .find(|(a, b, weight)| values[*a] + values[*b] < *weight);
    let Some(&(a, b, weight)) = open else {
        *best = sum;
        return;
    };
    let missing = weight - values[a] - values[b];
    for share in 0..=missing {
        values[a] += share;
        values[b] += missing - share;
        branch(edges, values, sum + missing, best);
        values[a] -= share;
        values[b] -= missing - share;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn covers_are_least() {
        assert_eq!(least_cover(&[]), 0);
        assert_eq!(least_cover(&[(3, 9, 4)]), 4);
        // A star is covered by its middle, a triangle by two of three.
        assert_eq!(least_cover(&[(0, 1, 1), (0, 2, 1), (0, 3, 1)]), 1);
        assert_eq!(least_cover(&[(0, 1, 1), (1, 2, 1), (0, 2, 1)]), 2);
        assert_eq!(least_cover(&[(0, 1, 2), (1, 2, 2), (0, 2, 2)]), 3);
        assert_eq!(least_cover(&[(0, 1, 5), (1, 2, 3), (4, 5, 2)]), 7);
        assert_eq!(least_cover(&[(0, 1, 1), (2, 3, 1), (1, 2, 1)]), 2);
    }

    #[test]
    fn large_components_get_a_bound() {
        let path: Vec<_> = (0..40).map(|agent| (agent, agent + 1, 1)).collect();
        let bound = least_cover(&path);
        assert!((1..=20).contains(&bound), "{bound}");
    }
}

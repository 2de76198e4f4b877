//! Rounding the corners of plans with Bézier curves.
//!
//! At a knot at time t a plan changes its velocity from v to w. The smoothed plan goes from its
//! place at t − h to that at t + h along the quadratic curve with the knot as its middle control
//! point, with time as the parameter. A share u of the way to t + h it is
//!
//! ```text
//! u²·h·(w − v) for u ≤ ½,  (1 − u)²·h·(w − v) for u ≥ ½
//! ```
//!
//! away from where the plan has it at that moment: h·|w − v| / 4 at most. Its velocity goes from v
//! to w uniformly, so that it keeps every limit of speed that the plan keeps, and needs the
//! acceleration |w − v| / 2h.

use fleetyard_core::{Knot, TrajectoryError, TrajectoryPlan};

/// Straight pieces per curve. With an even number the point in the middle is one of the plan, and
/// no piece is farther from the unsmoothed plan than its ends.
const PIECES: u32 = 8;

/// Corners whose curves would gain less than this share of the allowed deviation stay as they
/// are: they are parts of curves already.
const WORTH: f64 = 0.01;

/// Replaces corners of a plan by quadratic Bézier curves (Multi-Quadruped MAPF, section 3, refines
/// its plans so). No point of a robot is ever farther than `max_deviation_m` from where the plan has
/// it at that time; 0 leaves the plan as it is. `radius_m` gives an agent's largest distance of a
/// point of the footprint from its origin, which headings turn; 0 where they do not matter.
///
/// A curve takes at most half of each action beside its corner. First and last knots stay, and so
/// do the times of all that is not on a curve. Waits are actions: a robot sets out and stops gently,
/// and stands for half of a wait or longer. Controls of the plan do not lead along curves: the
/// smoothed plan has none.
pub fn smooth(
    plan: &TrajectoryPlan,
    max_deviation_m: f64,
    radius_m: &dyn Fn(usize) -> f64,
) -> Result<TrajectoryPlan, TrajectoryError> {
    let mut smoothed = TrajectoryPlan::with_capacity(plan.agents(), plan.knot_count());
    for (agent, knots) in plan.paths().enumerate() {
        let last = knots.len() - 1;
        let mut path: Vec<Knot> = Vec::with_capacity(knots.len());
        let mut append = |knot: Knot| {
            // Two curves may meet in the middle of an action.
            if path
                .last()
                .is_none_or(|last| last.time_s + SHORTEST_S < knot.time_s)
            {
                path.push(knot);
            }
        };
        for at in 0..last {
            let corner = knots.get(at);
            let curve = at.checked_sub(1).and_then(|before| {
                let ends = [knots.get(before), knots.get(at + 1)];
                round(ends[0], corner, ends[1], max_deviation_m, radius_m(agent))
            });
            match curve {
                None => append(corner),
                Some([from, to]) => {
                    for piece in 0..=PIECES {
                        let share = f64::from(piece) / f64::from(PIECES);
                        let (one, two) = (between(from, corner, share), between(corner, to, share));
                        append(between(one, two, share));
                    }
                }
            }
        }
        // The goal stays, to the bit.
        let goal = knots.get(last);
        while path.len() > 1 && path[path.len() - 1].time_s + SHORTEST_S >= goal.time_s {
            path.pop();
        }
        path.push(goal);
        smoothed.push_path(path)?;
    }
    Ok(smoothed)
}

/// Knots nearer in time than this, in seconds, are the same but for rounding.
const SHORTEST_S: f64 = 1e-9;

/// Begin and end of a corner's curve, if it is worth one.
fn round(
    before: Knot,
    corner: Knot,
    after: Knot,
    max_deviation_m: f64,
    radius_m: f64,
) -> Option<[Knot; 2]> {
    let (first_s, second_s) = (corner.time_s - before.time_s, after.time_s - corner.time_s);
    let turn = |from: Knot, to: Knot| {
        let headings = from.heading_rad.zip(to.heading_rad);
        headings.map_or(0.0, |(from, to)| to - from)
    };
    let change = |before: f64, after: f64| after / second_s - before / first_s;
    let (x, y, heading) = (
        change(corner.x_m - before.x_m, after.x_m - corner.x_m),
        change(corner.y_m - before.y_m, after.y_m - corner.y_m),
        change(turn(before, corner), turn(corner, after)),
    );
    // Speed by which the fastest point of the body changes its velocity, at most.
    let change = (x * x + y * y).sqrt() + radius_m * heading.abs();
    let longest_s = 0.5 * first_s.min(second_s);
    if 0.25 * longest_s * change <= WORTH * max_deviation_m {
        return None;
    }
    let reach_s = (4.0 * max_deviation_m / change).min(longest_s);
    Some([
        between(corner, before, reach_s / first_s),
        between(corner, after, reach_s / second_s),
    ])
}

fn between(from: Knot, to: Knot, share: f64) -> Knot {
    let between = |from: f64, to: f64| from + (to - from) * share;
    Knot {
        time_s: between(from.time_s, to.time_s),
        x_m: between(from.x_m, to.x_m),
        y_m: between(from.y_m, to.y_m),
        heading_rad: from
            .heading_rad
            .zip(to.heading_rad)
            .map(|(from, to)| between(from, to)),
    }
}

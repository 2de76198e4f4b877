//! Routes: sequences of knots that agents drive.

use fleetyard_core::{Grid, GridPlan, TrajectoryPlan, cell_center_m};
use fleetyard_world::Pose;

/// Routes of all agents: knots 0..=K, and action k from knot k − 1 to knot k.
///
/// Poses and headings are linear in time within an action, an action between equal poses
/// is a wait, and after its last knot an agent rests. Times ascend strictly along a route
/// and are those of the plan, in seconds.
pub trait Routes: Sync {
    /// Number of agents.
    fn agents(&self) -> usize;
    /// Number of actions of an agent, one less than its knots.
    fn actions(&self, agent: usize) -> usize;
    /// Pose of the agent at a knot.
    fn pose(&self, agent: usize, knot: usize) -> Pose;
    /// Planned time of the knot, in seconds.
    fn time_s(&self, agent: usize, knot: usize) -> f64;
    /// Least stay of the agent at the knot after reaching it, in seconds. Plans express
    /// stays as waits.
    fn stay_s(&self, agent: usize, knot: usize) -> f64 {
        let _ = (agent, knot);
        0.0
    }
}

impl Routes for TrajectoryPlan {
    fn agents(&self) -> usize {
        TrajectoryPlan::agents(self)
    }

    fn actions(&self, agent: usize) -> usize {
        self.knots(agent).len() - 1
    }

    fn pose(&self, agent: usize, knot: usize) -> Pose {
        let knots = self.knots(agent);
        let heading = knots.heading_rad.map_or(0.0, |all| all[knot]);
        Pose::new(knots.x_m[knot], knots.y_m[knot], heading)
    }

    fn time_s(&self, agent: usize, knot: usize) -> f64 {
        self.knots(agent).time_s[knot]
    }
}

/// The routes of a plan on a grid: a knot in the centre of every cell of a path.
///
/// Every path must have a cell, and every cell must be on the map.
#[derive(Debug, Clone, Copy)]
pub struct GridRoutes<'a> {
    /// The map.
    pub grid: &'a Grid,
    /// The plan.
    pub plan: &'a GridPlan,
    /// Side of a cell in metres.
    pub cell_size_m: f64,
    /// Duration of a step in seconds.
    pub step_s: f64,
}

impl Routes for GridRoutes<'_> {
    fn agents(&self) -> usize {
        self.plan.agents()
    }

    fn actions(&self, agent: usize) -> usize {
        self.plan.path(agent).len().saturating_sub(1)
    }

    fn pose(&self, agent: usize, knot: usize) -> Pose {
        let cell = self.plan.path(agent)[knot];
        let (x, y) = cell_center_m(self.grid, self.cell_size_m, cell);
        Pose::at(x, y)
    }

    fn time_s(&self, _agent: usize, knot: usize) -> f64 {
        knot as f64 * self.step_s
    }
}

/// Part of an action, cut into pieces of equal duration.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Cut {
    /// The refined action that is its first piece.
    first: u32,
    pieces: u32,
    /// The action that it is a part of.
    action: u32,
    /// The part as fractions of the action. The parts of an action follow each other from
    /// 0 to 1.
    from: f64,
    to: f64,
}

/// Actions that are cut into pieces. A piece is an action of its own: a refined route has
/// more knots on the same way.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Cuts {
    /// Cuts of agent i are `cuts[offsets[i]..offsets[i + 1]]`; empty without cuts.
    offsets: Vec<u32>,
    cuts: Vec<Cut>,
}

/// A part of an action of a refined route that is to be cut into pieces of equal duration. The
/// parts of an action follow each other from 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Split {
    pub(super) agent: u32,
    pub(super) action: u32,
    pub(super) pieces: u32,
    /// The part as fractions of the action.
    pub(super) from: f64,
    pub(super) to: f64,
}

impl Split {
    /// Cuts a whole action.
    pub(super) fn whole(agent: u32, action: u32, pieces: u32) -> Self {
        Self {
            agent,
            action,
            pieces,
            from: 0.0,
            to: 1.0,
        }
    }

    /// Number of actions that it adds: pieces, of which the last of an action is no new one.
    pub(super) fn added(&self) -> u32 {
        self.pieces - u32::from(self.to >= 1.0)
    }
}

impl Cuts {
    pub(super) fn memory_bytes(&self) -> usize {
        self.offsets.capacity() * size_of::<u32>() + self.cuts.capacity() * size_of::<Cut>()
    }

    fn of(&self, agent: usize) -> &[Cut] {
        match self.offsets.get(agent..agent + 2) {
            Some(range) => &self.cuts[range[0] as usize..range[1] as usize],
            None => &[],
        }
    }

    /// Number of actions of the agent beyond those without cuts.
    fn added(&self, agent: usize) -> usize {
        let cuts = self.of(agent);
        let pieces: u32 = cuts.iter().map(|cut| cut.pieces).sum();
        let wholes = cuts.iter().filter(|cut| cut.to >= 1.0).count();
        pieces as usize - wholes
    }

    /// The action that contains a refined knot, and the fraction of it; fraction 1 is the
    /// action's own knot. Knot 0 is fraction 1 of action 0, which does not exist.
    fn place(&self, agent: usize, knot: usize) -> (usize, f64) {
        let cuts = self.of(agent);
        let after = cuts.partition_point(|cut| cut.first as usize <= knot);
        let Some(cut) = after.checked_sub(1).map(|at| cuts[at]) else {
            return (knot, 1.0);
        };
        let last = (cut.first + cut.pieces - 1) as usize;
        if knot < last {
            let share = (knot - cut.first as usize + 1) as f64 / f64::from(cut.pieces);
            return (cut.action as usize, cut.from + (cut.to - cut.from) * share);
        }
        if knot == last {
            return (cut.action as usize, cut.to);
        }
        (cut.action as usize + (knot - last), 1.0)
    }

    /// Cuts actions of the refined routes, given in order of agents, actions and parts.
    pub(super) fn refine(&self, agents: usize, splits: &[Split]) -> Self {
        let mut refined = Self {
            offsets: Vec::with_capacity(agents + 1),
            cuts: Vec::with_capacity(self.cuts.len() + splits.len()),
        };
        refined.offsets.push(0);
        let mut splits = splits
            .iter()
            .filter(|split| split.pieces > 1 || split.from > 0.0 || split.to < 1.0)
            .peekable();
        for agent in 0..agents {
            let mut old = self.of(agent).iter().copied().peekable();
            let mut added = 0;
            let push = |cuts: &mut Vec<Cut>, cut: Cut| {
                if cut.pieces > 0 {
                    cuts.push(cut);
                }
            };
            loop {
                let split = splits.next_if(|split| {
                    let next = old.peek().map_or(u32::MAX, |cut| cut.first);
                    split.agent as usize == agent && split.action < next
                });
                if let Some(split) = split {
                    // Whole actions only; pieces of cuts follow below.
                    let (action, _) = self.place(agent, split.action as usize);
                    refined.cuts.push(Cut {
                        first: split.action + added,
                        pieces: split.pieces,
                        action: action as u32,
                        from: split.from,
                        to: split.to,
                    });
                    added += split.added();
                    continue;
                }
                let Some(cut) = old.next() else { break };
                let end = cut.first + cut.pieces;
                let fraction = |piece: u32| {
                    let share = f64::from(piece - cut.first) / f64::from(cut.pieces);
                    if piece == end {
                        cut.to
                    } else {
                        cut.from + (cut.to - cut.from) * share
                    }
                };
                let mut at = cut.first;
                while let Some(split) =
                    splits.next_if(|split| split.agent as usize == agent && split.action < end)
                {
                    if split.from <= 0.0 {
                        let whole = Cut {
                            first: at + added,
                            pieces: split.action - at,
                            from: fraction(at),
                            to: fraction(split.action),
                            ..cut
                        };
                        push(&mut refined.cuts, whole);
                    }
                    let (from, to) = (fraction(split.action), fraction(split.action + 1));
                    let within = |share: f64| match share {
                        share if share >= 1.0 => to,
                        share => from + (to - from) * share,
                    };
                    let pieces = Cut {
                        first: split.action + added,
                        pieces: split.pieces,
                        from: within(split.from),
                        to: within(split.to),
                        ..cut
                    };
                    push(&mut refined.cuts, pieces);
                    added += split.added();
                    at = split.action + 1;
                }
                let rest = Cut {
                    first: at + added,
                    pieces: end - at,
                    from: fraction(at),
                    to: cut.to,
                    ..cut
                };
                push(&mut refined.cuts, rest);
            }
            refined.offsets.push(refined.cuts.len() as u32);
        }
        refined
    }
}

/// Routes with some actions cut into pieces, as the dependency graph counts them.
#[derive(Debug)]
pub struct Refined<'a, R: ?Sized> {
    pub(super) routes: &'a R,
    pub(super) cuts: &'a Cuts,
}

impl<R: Routes + ?Sized> Refined<'_, R> {
    /// The last knot of the routes without cuts that an agent has reached at a refined
    /// knot.
    pub fn whole_knot(&self, agent: usize, knot: usize) -> usize {
        match self.cuts.place(agent, knot) {
            (action, fraction) if fraction < 1.0 => action - 1,
            (action, _) => action,
        }
    }
}

impl<R: Routes + ?Sized> Routes for Refined<'_, R> {
    fn agents(&self) -> usize {
        self.routes.agents()
    }

    fn actions(&self, agent: usize) -> usize {
        self.routes.actions(agent) + self.cuts.added(agent)
    }

    fn pose(&self, agent: usize, knot: usize) -> Pose {
        let (action, fraction) = self.cuts.place(agent, knot);
        let end = self.routes.pose(agent, action);
        if fraction >= 1.0 {
            return end;
        }
        self.routes.pose(agent, action - 1).toward(end, fraction)
    }

    fn time_s(&self, agent: usize, knot: usize) -> f64 {
        let (action, fraction) = self.cuts.place(agent, knot);
        let end = self.routes.time_s(agent, action);
        if fraction >= 1.0 {
            return end;
        }
        let start = self.routes.time_s(agent, action - 1);
        start + (end - start) * fraction
    }
}

#[cfg(test)]
mod tests {
    use fleetyard_core::Knot;

    use super::*;

    /// Two agents along x, the first one by four actions of one metre and second.
    fn line() -> TrajectoryPlan {
        let knot = |time: i32| Knot {
            time_s: f64::from(time),
            x_m: f64::from(time),
            y_m: 0.0,
            heading_rad: None,
        };
        let mut plan = TrajectoryPlan::default();
        plan.push_path((0..5).map(knot)).expect("a path");
        plan.push_path([knot(0)]).expect("a path");
        plan
    }

    fn split(agent: u32, action: u32, pieces: u32) -> Split {
        Split::whole(agent, action, pieces)
    }

    fn places(cuts: &Cuts) -> Vec<f64> {
        let plan = line();
        let routes = Refined {
            routes: &plan,
            cuts,
        };
        assert_eq!(routes.actions(1), 0);
        let knots = 0..=routes.actions(0);
        knots
            .map(|knot| {
                let (pose, time_s) = (routes.pose(0, knot), routes.time_s(0, knot));
                assert!((pose.x - time_s).abs() < 1e-12);
                assert!((pose.x.floor() - routes.whole_knot(0, knot) as f64).abs() < 1e-12);
                pose.x
            })
            .collect()
    }

    #[test]
    fn pieces_are_cut_into_pieces_again() {
        let none = Cuts::default();
        assert_eq!(places(&none), [0.0, 1.0, 2.0, 3.0, 4.0]);
        let halves = none.refine(2, &[split(0, 2, 2)]);
        assert_eq!(places(&halves), [0.0, 1.0, 1.5, 2.0, 3.0, 4.0]);
        let more = halves.refine(2, &[split(0, 1, 2), split(0, 3, 2), split(0, 5, 4)]);
        assert_eq!(
            places(&more),
            [0.0, 0.5, 1.0, 1.5, 1.75, 2.0, 3.0, 3.25, 3.5, 3.75, 4.0]
        );
        let most = more.refine(2, &[split(0, 3, 2), split(0, 4, 2), split(0, 6, 2)]);
        assert_eq!(
            places(&most),
            [
                0.0, 0.5, 1.0, 1.25, 1.5, 1.625, 1.75, 2.0, 2.5, 3.0, 3.25, 3.5, 3.75, 4.0
            ]
        );
        assert_eq!(places(&most.refine(2, &[])), places(&most));
    }

    #[test]
    fn parts_of_actions_are_cut_by_themselves() {
        let part = |action, pieces, from, to| Split {
            from,
            to,
            ..split(0, action, pieces)
        };
        let uneven = [part(2, 1, 0.0, 0.25), part(2, 3, 0.25, 1.0), split(0, 3, 2)];
        let cuts = Cuts::default().refine(2, &uneven);
        assert_eq!(
            places(&cuts),
            [0.0, 1.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0, 4.0]
        );
        let again = [
            split(0, 1, 2),
            part(3, 2, 0.0, 0.5),
            part(3, 1, 0.5, 1.0),
            part(6, 1, 0.0, 0.5),
            part(6, 1, 0.5, 1.0),
        ];
        let cuts = cuts.refine(2, &again);
        assert_eq!(
            places(&cuts),
            [
                0.0, 0.5, 1.0, 1.25, 1.3125, 1.375, 1.5, 1.75, 2.0, 2.25, 2.5, 3.0, 4.0
            ]
        );
    }
}

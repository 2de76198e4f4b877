//! Batches: paths of a planner or a fail policy, judged before they may become moves.

use fleetyard_abi::{Instance, Motion};
use fleetyard_check::{Terms, Verdict, validate_terms};
use fleetyard_core::{Connectivity, Grid, GridPlan, Separation};

/// Most violations of a batch that are described.
const DESCRIBED: usize = 10;

/// A plan that is safe to execute: agents are distinct from its first cells to its last.
///
/// There is no way to one but [`judge`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Batch {
    plan: GridPlan,
    /// Most cells of a path that count.
    length: usize,
    turning: bool,
}

impl Batch {
    /// Number of agents.
    pub fn agents(&self) -> usize {
        self.plan.agents()
    }

    /// The cells of an agent at steps 0, 1, 2, … as far as they are free of collisions.
    /// When its path has ended it stays in the last one.
    pub fn path(&self, agent: usize) -> &[u32] {
        let path = self.plan.path(agent);
        &path[..path.len().min(self.length)]
    }

    /// True if turning by 90° takes a step of the plan.
    pub fn turning(&self) -> bool {
        self.turning
    }

    /// The plan as it was returned.
    pub fn plan(&self) -> &GridPlan {
        &self.plan
    }
}

/// A plan that may not be executed, and why.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Refused {
    /// The plan as it was returned.
    pub plan: GridPlan,
    /// Its violations: agents, time, cells and a sentence of the first ones, and how many
    /// there are.
    pub verdict: Verdict,
}

impl std::fmt::Display for Refused {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Verdict {
            violations,
            violation_count,
            ..
        } = &self.verdict;
        match violations.first() {
            Some(first) => write!(f, "{first} ({})", first.rule)?,
            None => f.write_str("the plan breaks rules")?,
        }
        match violation_count {
            0 | 1 => Ok(()),
            more => write!(f, ", and {} more", more - 1),
        }
    }
}

impl std::error::Error for Refused {}

/// Judges a plan for an instance whose starts are where agents end.
///
/// There is a path for every agent. It begins at its start and goes over free cells, one
/// step to an adjacent cell or none; where turning takes steps, it has them. During the
/// instance's window, or to the end of all paths if it has none, no two agents are in one
/// cell, those whose paths have ended included, or exchange cells. What is behind the
/// window is not executed. Goals are not looked at.
pub fn judge(grid: &Grid, instance: &Instance, plan: GridPlan) -> Result<Batch, Box<Refused>> {
    judge_within(grid, instance, instance.window_steps, plan)
}

/// Judges a plan of which a step at a time is executed: as [`judge`] does, or by its first step
/// alone if agents collide later in the window. Nothing behind that step is executed then.
pub fn judge_first(
    grid: &Grid,
    instance: &Instance,
    plan: GridPlan,
) -> Result<Batch, Box<Refused>> {
    let window = instance.window_steps;
    judge_within(grid, instance, window, plan).or_else(|refused| match window {
        1 => Err(refused),
        _ => judge_within(grid, instance, 1, refused.plan),
    })
}

fn judge_within(
    grid: &Grid,
    instance: &Instance,
    window: u32,
    plan: GridPlan,
) -> Result<Batch, Box<Refused>> {
    let turning = instance.motion == Motion::Rotation;
    let terms = Terms {
        grid,
        connectivity: Connectivity::Four,
        starts: &instance.starts,
        goals: None,
        headings: instance.headings.as_deref().filter(|_| turning),
        window_steps: window,
        separation: Separation::Rules,
    };
    let verdict = validate_terms(&terms, &plan, DESCRIBED);
    if !verdict.valid {
        return Err(Box::new(Refused { plan, verdict }));
    }
    let length = match window {
        0 => usize::MAX,
        window => window as usize + 1,
    };
    Ok(Batch {
        plan,
        length,
        turning,
    })
}

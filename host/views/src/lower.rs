//! Plans in the plane as plans of a view, where they are such: the way back of lifted plans.

use fleetyard_core::plan_file::PLAN_MAX_CELLS;
use fleetyard_core::{GridPlan, Knot, RoadmapPlan, RoadmapPlanError, TrajectoryPlan};

use crate::frame::Frame;
use crate::{GridView, RoadmapView};

/// Rounding of coordinates in metres and of times in seconds, which files and other tools leave.
const ROUNDING: f64 = 1e-6;

impl GridView {
    /// The plan on the grid that [`GridView::lift`] makes this one of, with steps of `step_s` seconds:
    /// after every step each agent is in the middle of a cell, and between two steps it goes straight and
    /// evenly. Headings are left out. Says at which agent and time the plan is none.
    pub fn lower(&self, plan: &TrajectoryPlan, step_s: f64) -> Result<GridPlan, String> {
        if !(step_s.is_finite() && step_s > 0.0) {
            return Err(format!("a step of {step_s} s is none"));
        }
        let grid = self.instance.grid();
        let frame = Frame {
            corner_m: self.corner_m,
            cell_m: self.cell_m,
            cols: grid.cols(),
            rows: grid.rows(),
        };
        let mut lowered = GridPlan::with_capacity(plan.agents(), 0);
        let mut cells = 0.0;
        for (agent, knots) in plan.paths().enumerate() {
            let steps = (knots.end_s() / step_s).round();
            cells += steps + 1.0;
            if cells > PLAN_MAX_CELLS as f64 {
                return Err(format!(
                    "the paths have more than {PLAN_MAX_CELLS} steps of {step_s} s"
                ));
            }
            let uneven = knots.iter().find(|knot| {
                let step = (knot.time_s / step_s).round();
                (knot.time_s - step * step_s).abs() > ROUNDING
            });
            if let Some(Knot { time_s, .. }) = uneven {
                return Err(format!(
                    "agent {agent} turns or stops at {time_s} s, which is not at the end of a step of {step_s} s"
                ));
            }
            let path = (0..=steps as u64).map(|step| {
                let Knot {
                    time_s, x_m, y_m, ..
                } = knots.at(step as f64 * step_s);
                let (cell, far_m) = frame.snap([x_m, y_m]);
                if far_m > ROUNDING {
                    return Err(format!(
                        "agent {agent} is at ({x_m}, {y_m}) at {time_s} s, {far_m:.3} m from the middle of a cell"
                    ));
                }
                Ok(cell)
            });
            lowered.push_path(path.collect::<Result<Vec<u32>, String>>()?);
        }
        Ok(lowered)
    }
}

impl RoadmapView {
    /// The plan on the roadmap that [`RoadmapView::lift`] makes this one of: it begins at the starts, and
    /// every knot is at a vertex, along edges. Headings are left out.
    pub fn lower(&self, plan: &TrajectoryPlan) -> Result<RoadmapPlan, RoadmapPlanError> {
        RoadmapPlan::of_trajectories(plan, &self.roadmap, &self.starts, ROUNDING)
    }
}

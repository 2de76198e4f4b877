//! The reference that bodies follow: the plan as timed polylines.
//!
//! Step m of the plan is the time in which agents move from their m-th cell to
//! the next one; the reference is uniform within a step. After its path has
//! ended an agent's reference rests.

use fleetyard_core::{Grid, GridPlan};

use crate::convert::cell_center_m;

/// The step of the plan that is being executed.
#[derive(Debug)]
pub(crate) struct Reference<'a> {
    grid: &'a Grid,
    plan: &'a GridPlan,
    cell_size_m: f64,
    /// Cells at the start and at the end of the step.
    pub(crate) from: Vec<u32>,
    pub(crate) to: Vec<u32>,
    /// Centres of `from` and `to`.
    pub(crate) ax: Vec<f64>,
    pub(crate) ay: Vec<f64>,
    pub(crate) bx: Vec<f64>,
    pub(crate) by: Vec<f64>,
}

impl<'a> Reference<'a> {
    /// At rest at the starts. All paths have a first cell and all cells are on
    /// the map.
    pub(crate) fn new(grid: &'a Grid, plan: &'a GridPlan, cell_size_m: f64) -> Self {
        let from: Vec<u32> = plan.paths().map(|path| path[0]).collect();
        let (ax, ay): (Vec<f64>, Vec<f64>) = from
            .iter()
            .map(|cell| cell_center_m(grid, cell_size_m, *cell))
            .unzip();
        Self {
            grid,
            plan,
            cell_size_m,
            to: from.clone(),
            from,
            bx: ax.clone(),
            by: ay.clone(),
            ax,
            ay,
        }
    }

    /// Goes to step `step`; steps are loaded in order, from 0.
    pub(crate) fn load(&mut self, step: usize) {
        self.from.copy_from_slice(&self.to);
        self.ax.copy_from_slice(&self.bx);
        self.ay.copy_from_slice(&self.by);
        let (offsets, cells) = (self.plan.offsets(), self.plan.cells());
        for (agent, range) in offsets.windows(2).enumerate() {
            let at = range[0] + step + 1;
            if at < range[1] && cells[at] != self.to[agent] {
                self.to[agent] = cells[at];
                (self.bx[agent], self.by[agent]) =
                    cell_center_m(self.grid, self.cell_size_m, cells[at]);
            }
        }
    }

    /// Where the reference is at a fraction of the step below 1.
    pub(crate) fn at(&self, fraction: f64, x: &mut [f64], y: &mut [f64]) {
        let lerp = |out: &mut [f64], a: &[f64], b: &[f64]| {
            for ((out, a), b) in out.iter_mut().zip(a).zip(b) {
                *out = a + (b - a) * fraction;
            }
        };
        lerp(x, &self.ax, &self.bx);
        lerp(y, &self.ay, &self.by);
    }
}

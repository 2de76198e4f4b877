//! `fleetyard validate` in the plane: do footprints stay clear of each other and of what
//! stands there, at all times?

use std::path::PathBuf;

use clap::Args;
use fleetyard_check::{
    ContinuousTask, ContinuousVerdict, PathRule, TrailerTask, TravelCosts, validate_trajectories,
};
use fleetyard_core::formats::AnyPlan;
use fleetyard_core::{
    Digest, Grid, GridInstance, InputError, TrajectoryFile, TrajectoryPlan, cell_center_m,
};
use fleetyard_sim::SimConfig;
use fleetyard_sim::motion::load_fleet;
use fleetyard_world::exact::Obstacles;
use fleetyard_world::{Bounds, Dynamics, Footprint, Pose, Shape, Trailer, load_workspace};
use serde::Serialize;

use super::verdict::{write_costs, write_world};
use crate::exit::Result;
use crate::setup::check_rule;

/// The plane and what is in it.
#[derive(Debug, Args)]
pub(super) struct PlaneArgs {
    /// World file with bounds and obstacles in the plane
    #[arg(long, value_name = "FILE", requires = "robots")]
    pub(super) world: Option<PathBuf>,
    /// Robots are discs of this radius in metres
    #[arg(long, value_name = "METRES", group = "robots")]
    pub(super) radius: Option<f64>,
    /// Fleet file with the robots' footprints and limits
    #[arg(long, value_name = "FILE", group = "robots")]
    pub(super) fleet: Option<PathBuf>,
    /// Side of a cell in metres
    #[arg(long, value_name = "METRES", default_value_t = SimConfig::default().cell_size_m)]
    pub(super) cell_size: f64,
    /// Duration of one step in seconds, for a plan on a grid that is judged in the plane [default: 1;
    /// for the grid of a task the time that its slowest robot needs for a cell]
    #[arg(long, value_name = "SECONDS")]
    pub(super) step: Option<f64>,
}

impl PlaneArgs {
    /// True if a plan is judged in the plane.
    pub(super) fn has_robots(&self) -> bool {
        self.radius.is_some() || self.fleet.is_some()
    }
}

#[derive(Serialize)]
pub(super) struct Report {
    verdict: ContinuousVerdict,
    metrics: TravelCosts,
    plan_digest: Digest,
}

/// Judges a plan by footprints. `instance` makes the instance with the starts and goals of
/// so many agents, if there is one.
pub(super) fn judge(
    arguments: &PlaneArgs,
    rule: PathRule,
    listed: usize,
    grid: Option<&Grid>,
    plan: AnyPlan,
    instance: impl FnOnce(usize) -> std::result::Result<Option<GridInstance>, InputError>,
) -> Result<Report> {
    let file = in_the_plane(arguments, rule, grid, plan)?;
    let (plan, agents) = (&file.plan, file.plan.agents());
    let robots = Robots::new(arguments, agents)?;
    let shapes: Vec<&Shape> = robots.shapes.iter().collect();
    check_headings(&file.source, plan, shapes.iter().copied())?;
    let workspace = arguments.world.as_deref().map(load_workspace).transpose()?;
    let cell_size_m = arguments.cell_size;
    let obstacles = match grid {
        None => Obstacles::none(),
        Some(grid) => {
            let far = [grid.cols(), grid.rows()].map(|cells| f64::from(cells) * cell_size_m);
            let cells = Obstacles::cells(grid, cell_size_m).ok_or_else(|| {
                let reason = format!("cells of {cell_size_m} m are too small or too large");
                InputError::new("--cell-size", reason).hint("give the side of a cell in metres")
            })?;
            cells.within(Bounds {
                min: [0.0, 0.0],
                max: far,
            })
        }
    };
    let obstacles = match &workspace {
        None => obstacles,
        Some(workspace) => obstacles.with_workspace(workspace),
    };
    let instance = instance(agents)?;
    let places = |pick: fn(&GridInstance) -> &[u32]| {
        instance.as_ref().map(|instance| -> Vec<Pose> {
            let center = |cell| cell_center_m(instance.grid(), cell_size_m, cell);
            let centers = pick(instance).iter().map(|cell| center(*cell));
            centers.map(|(x, y)| Pose::at(x, y)).collect()
        })
    };
    let (starts, goals) = (places(GridInstance::starts), places(GridInstance::goals));
    let task = ContinuousTask {
        starts: starts.as_deref(),
        goals: goals.as_deref(),
        limits: robots.limits.as_deref(),
        trailers: &robots.towed(plan),
        ..ContinuousTask::new(&shapes, &obstacles)
    };
    Ok(Report {
        verdict: validate_trajectories(plan, &task, listed),
        metrics: TravelCosts::of(plan),
        plan_digest: plan.digest(),
    })
}

/// Refuses a plan without headings for robots of which one is no disc.
pub(super) fn check_headings<'a>(
    source: &str,
    plan: &TrajectoryPlan,
    mut shapes: impl Iterator<Item = &'a Shape>,
) -> Result<()> {
    match shapes.position(|shape| !shape.is_disc()) {
        Some(agent) if !plan.has_headings() => {
            let reason = format!("the plan has no headings, but agent {agent} is no disc");
            Err(InputError::new(source, reason)
                .hint("give every knot a heading; discs need none")
                .into())
        }
        _ => Ok(()),
    }
}

/// The plan in the plane, which one on a grid becomes.
fn in_the_plane(
    arguments: &PlaneArgs,
    rule: PathRule,
    grid: Option<&Grid>,
    plan: AnyPlan,
) -> Result<TrajectoryFile> {
    let file = match plan {
        AnyPlan::Trajectories(file) => return Ok(file),
        AnyPlan::Grid(file) => file,
    };
    let Some(grid) = grid else {
        let reason = "this is a plan on a grid, and nothing says which";
        return Err(InputError::new(file.source, reason)
            .hint("name the map with --map FILE")
            .into());
    };
    file.check_map(grid)?;
    let cell_size_m = arguments.cell_size;
    let step_s = arguments.step.unwrap_or(SimConfig::default().step_s);
    check_rule(rule, file.plan.agents())?;
    let in_the_plane = match rule {
        PathRule::Steps => TrajectoryPlan::from_grid,
        PathRule::Bresenham | PathRule::Supercover => TrajectoryPlan::along_lines,
    };
    let plan = in_the_plane(&file.plan, grid, cell_size_m, step_s)
        .map_err(|error| InputError::new(file.source.as_str(), error.to_string()))?;
    Ok(TrajectoryFile {
        source: file.source,
        planner: file.planner,
        plan_digest: None,
        plan,
    })
}

/// Shapes and limits of the agents.
struct Robots {
    shapes: Vec<Shape>,
    limits: Option<Vec<Dynamics>>,
    trailers: Vec<Option<(Trailer, Shape)>>,
}

impl Robots {
    fn new(arguments: &PlaneArgs, agents: usize) -> Result<Self> {
        let Some(path) = &arguments.fleet else {
            let radius_m = arguments.radius.unwrap_or_default();
            let shape = Footprint::Disc { radius_m }.shape().map_err(|error| {
                InputError::new("--radius", error.to_string()).hint(error.hint())
            })?;
            return Ok(Self {
                shapes: vec![shape; agents],
                limits: None,
                trailers: Vec::new(),
            });
        };
        let fleet = load_fleet(path)?.fleet(agents).map_err(|error| {
            InputError::new(path.display().to_string(), error.to_string()).hint(error.hint())
        })?;
        let limits = (0..agents).map(|agent| fleet.model(agent).dynamics());
        Ok(Self {
            shapes: (0..agents)
                .map(|agent| fleet.shape(agent).clone())
                .collect(),
            limits: Some(limits.collect()),
            trailers: (0..agents)
                .map(|agent| {
                    let own = fleet.trailer(agent);
                    own.map(|(trailer, shape)| (trailer, shape.clone()))
                })
                .collect(),
        })
    }

    /// Trailers that begin in line with their cars.
    fn towed(&self, plan: &TrajectoryPlan) -> Vec<Option<TrailerTask<'_>>> {
        let trailers = self.trailers.iter().zip(plan.paths());
        let task = trailers.map(|(own, knots)| {
            own.as_ref().map(|(trailer, shape)| TrailerTask {
                trailer: *trailer,
                shape,
                start_rad: knots.get(0).heading_rad.unwrap_or(0.0),
                goal_rad: f64::NAN,
            })
        });
        task.collect()
    }
}

impl Report {
    pub(super) fn is_valid(&self) -> bool {
        self.verdict.valid
    }

    /// For people; `listed` is how many violations are shown at most.
    pub(super) fn text(&self, listed: usize) -> String {
        let mut out = String::new();
        write_world(&mut out, "", &self.verdict, listed);
        write_costs(&mut out, &self.metrics);
        out.truncate(out.trim_end().len());
        out
    }
}

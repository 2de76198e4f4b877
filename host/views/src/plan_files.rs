//! Files with plans of a view: which kind of view they are of, and whether they are of this one.

use fleetyard_core::formats::{Format, UnreadPlan, grid_size};
use fleetyard_core::{InputError, MotionFile, PlanFile, RoadmapPlanFile, TrajectoryFile};

use crate::{GridView, Problem, Representation, RoadmapView};

impl Representation {
    /// The kind of views that plans in a format are of.
    pub fn of_plans(format: Format) -> Self {
        if format.carries_plan() {
            Self::Grid
        } else if format.carries_roadmap() {
            Self::Roadmap
        } else {
            Self::Continuous
        }
    }
}

impl GridView {
    /// The plan of this view in a file.
    pub fn read(&self, file: &UnreadPlan) -> Result<PlanFile, InputError> {
        let file = file.grid(grid_size(self.instance.grid()))?;
        file.check_for(&self.instance).map_err(|error| {
            error.hint(
                "the cells of a view follow from --connectivity and --separation; name the file \
                 that `fleetyard world grid` wrote with --view, or remove instance_digest from the plan",
            )
        })?;
        Ok(file)
    }
}

impl RoadmapView {
    /// The plan of this view in a file.
    pub fn read(&self, file: &UnreadPlan) -> Result<RoadmapPlanFile, InputError> {
        let file = file.roadmap()?;
        file.check_for(&self.roadmap).map_err(|error| {
            error.hint(
                "a roadmap follows from --builder and its parameters; name the file that \
                 `fleetyard world roadmap` wrote with --view, or a roadmap with --roadmap, or remove \
                 roadmap_digest from the plan",
            )
        })?;
        Ok(file)
    }
}

impl Problem {
    /// The plan in the plane in a file: where it has controls alone, the motion from the task's starts.
    pub fn read(&self, file: &UnreadPlan) -> Result<TrajectoryFile, InputError> {
        match file.motions()? {
            MotionFile::Paths(file) => Ok(file),
            MotionFile::Controls(file) => {
                let plan = self.motions(&file.controls.into());
                let plan = plan.map_err(|reason| InputError::new(file.source.as_str(), reason))?;
                Ok(TrajectoryFile {
                    source: file.source,
                    planner: file.planner,
                    ..TrajectoryFile::new(plan)
                })
            }
        }
    }
}

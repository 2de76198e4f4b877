//! Questions: a map in one of the representations, and agents on it.

use fleetyard_abi::{
    Capability, FleetState, FleetStatus, Instance, Motion, Plan, Request, SharedEnvironment,
};

use crate::judge::Rules;
use crate::scene::Scene;
use crate::scene::roadmap::RoadmapScene;
use crate::scene::workspace::WorkspaceScene;
use crate::trial::Step;

/// A map and agents on it, as a plugin is asked about them.
pub(crate) trait Question {
    /// For messages.
    fn name(&self) -> &str;

    /// The map.
    fn environment(&self) -> Step<SharedEnvironment>;

    /// The agents, for a planner or a fail policy.
    fn instance(&self) -> Instance;

    /// The state of the fleet, for an instance generator.
    fn state(&self) -> FleetState {
        FleetState {
            time_s: 12.5,
            next: self.instance(),
            tasks: Vec::new(),
            parts: Vec::new(),
        }
    }

    /// The status of the fleet, for an invocation policy.
    fn status(&self) -> FleetStatus {
        let agents = self.instance().agents() as u32;
        FleetStatus {
            time_s: 12.5,
            since_last_call_s: 1.5,
            planning_limit_s: 1.0,
            action_s: 0.5,
            actions_left: (0..agents).map(|agent| agent % 5).collect(),
        }
    }

    /// The first agent alone: for planners that plan for one.
    fn first_agent(&self) -> Box<dyn Question>;

    /// Two agents at their goals, on another map: a planner that answers `unsupported` plans for
    /// one. `None` where planners for several agents may do so too.
    fn pair(&self) -> Step<Option<Box<dyn Question>>>;

    /// True if there is no plan because there are several agents.
    fn is_crowded(&self) -> bool;

    /// The least sum of costs, where it is known.
    fn best(&self) -> Option<f64> {
        None
    }

    /// Judges a plan: its sum of costs, or the reason why it is none.
    fn judge(&self, plan: &Plan, rules: Rules) -> Result<f64, String>;

    /// Judges the answer of an instance generator.
    fn judge_request(&self, request: &Request) -> Result<(), String>;

    /// The agents as a picture, if it is small enough to be of use.
    fn picture(&self) -> String;
}

/// The way in which the kit shows a scene to a plugin. All show the same scene: a plan of one is a
/// plan of each other one, since discs of [`RADIUS_M`](crate::scene::RADIUS_M) keep clear of each
/// other where they move as the rules of a grid say.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Representation {
    /// Cells.
    Grid,
    /// Cells, and agents that have to turn before they go another way.
    Turning,
    /// Cells, and the first agent alone, which goes in straight lines.
    Straight,
    /// Vertices in the middle of cells, and the motion along edges.
    Roadmap(Motion),
    /// The floor of the free cells.
    Plane,
}

impl Representation {
    /// The capability that a plugin claims for it.
    pub(crate) fn capability(self) -> Capability {
        match self {
            Self::Grid | Self::Turning | Self::Straight => Capability::Grid,
            Self::Roadmap(_) => Capability::Roadmap,
            Self::Plane => Capability::Continuous,
        }
    }

    /// The scene in this representation.
    pub(crate) fn of(self, scene: &Scene) -> Box<dyn Question> {
        match self {
            Self::Grid => Box::new(scene.clone()),
            Self::Turning => Box::new(scene.clone().turning()),
            Self::Straight => Box::new(scene.straight()),
            Self::Roadmap(motion) => Box::new(RoadmapScene::of(scene, motion)),
            Self::Plane => Box::new(WorkspaceScene::of(scene)),
        }
    }
}

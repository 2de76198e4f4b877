//! Questions: a map in one of the representations, and agents on it.

use fleetyard_abi::{FleetState, FleetStatus, Instance, Plan, Request, SharedEnvironment};

use crate::rules::Rules;
use crate::stop::Step;

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

    /// The same in which robots that move in any way have dynamics of this name; `None` where there are
    /// none.
    fn moved_by(&self, _: &'static str) -> Option<Box<dyn Question>> {
        None
    }

    /// True if planners need not know the robots and the obstacles.
    fn may_be_unknown(&self) -> bool {
        false
    }

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

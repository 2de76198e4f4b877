//! Configuration of a run: the numbers that the command and suites give.

use std::f64::consts::FRAC_PI_2;

use fleetyard_abi::{Kind, Motion};
use fleetyard_core::{Hasher, InputError, words};
use fleetyard_sim::motion::Model;
use fleetyard_sim::noise::Disturbance;
use fleetyard_sim::{Fleet, SimConfig, Tier};
use serde::{Deserialize, Serialize};

use crate::FleetError;
use crate::adg::Pace;
use crate::closures::ClosureRate;
use crate::timed::is_timed;

/// The time at which an answer takes effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Clock {
    /// Just [`FleetConfig::limit_s`] of simulated time after the call, whatever the wall
    /// clock did: a run is the same everywhere.
    #[default]
    Lockstep,
    /// The time when it arrives, while simulated time follows the wall clock.
    Realtime,
}

words!(Clock {
    Lockstep = "lockstep", "Just the limit after the call, in simulated time: runs are the same everywhere";
    Realtime = "realtime", "When it is there, while simulated time follows the wall clock";
});

/// The rules of execution.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Rules {
    /// Robots drive as their models do, in the order of passing, while the planner plans.
    #[default]
    Driven,
    /// All robots do one step of the plan at a time, just as it says, and stand while the
    /// planner plans: the rules of the League of Robot Runners.
    Synchronous,
}

words!(Rules {
    Driven = "driven", "Robots drive as their models do, in the order of passing, while the planner plans";
    Synchronous = "synchronous", "All robots do one step of the plan at a time, as it says, and stand while the planner plans (League of Robot Runners)";
});

/// Origin of the goals.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Assign {
    /// Tasks if there are some, roles if the map has them, and random cells else.
    #[default]
    Auto,
    /// Free cells at random.
    Random,
    /// Workstations and endpoints of the map in turn.
    Roles,
    /// A list of tasks that are revealed as others are done.
    Tasks,
    /// The same, of which the host gives none: the instance generator does.
    Generator,
}

words!(Assign {
    Auto = "auto", "Tasks if a file names some, roles if the map has them, random cells else";
    Random = "random", "Free cells at random";
    Roles = "roles", "Workstations and endpoints of the map in turn";
    Tasks = "tasks", "The tasks of --tasks or --instance";
    Generator = "generator", "The same tasks, given to robots by the instance generator alone";
});

/// The commitment of robots when the planner is called.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum CutBy {
    /// To what they can begin before its answer takes effect: robots that turn or wait for
    /// others to less than those that drive.
    #[default]
    Time,
    /// To the same number of actions each (Hönig et al. 2019; LSMART).
    Actions,
}

words!(CutBy {
    Time = "time", "To what they can begin before the answer takes effect: those that turn or wait to less than those that drive";
    Actions = "actions", "To the same number of actions each";
});

/// Budget of every call of a plugin beside its wall-clock time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Allowance {
    /// Wall-clock time for learning the map, in seconds.
    pub prepare_s: f64,
    /// Wall-clock time of a call of the generator, the fail policy or the invocation
    /// policy, in seconds. The planner has [`FleetConfig::limit_s`].
    pub call_s: f64,
    /// Wall-clock time for which the planner may go on after its limit, in seconds. What it answers
    /// then is dropped, but it keeps its process, and the tables that it made.
    pub grace_s: f64,
    /// Most threads at a time.
    pub threads: u32,
    /// Memory in bytes; 0 for no limit.
    pub memory_bytes: u64,
    /// Most search nodes of the planner; 0 for no limit.
    pub nodes: u64,
}

impl Default for Allowance {
    fn default() -> Self {
        Self {
            prepare_s: 60.0,
            call_s: 10.0,
            grace_s: 10.0,
            threads: 1,
            memory_bytes: 0,
            nodes: 0,
        }
    }
}

/// Everything that decides about a run but the map, the robots and the plugins.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FleetConfig {
    /// Number of robots.
    pub agents: u32,
    /// Length of the run in simulated seconds; rounded up to whole blocks.
    pub duration_s: f64,
    /// Planning window W in seconds; 0 for none.
    pub window_s: f64,
    /// Limit T of a planner's call in seconds, rounded up to whole blocks.
    pub limit_s: f64,
    /// The rules of execution.
    pub rules: Rules,
    /// The time at which an answer takes effect.
    pub clock: Clock,
    /// The commitment of robots when the planner is called.
    pub cut: CutBy,
    /// Seed of everything random: starts, goals, and the seeds of calls.
    pub seed: u64,
    /// The motion of robots as planners see it, one of [`FleetConfig::MOTIONS`].
    pub motion: Motion,
    /// Most unfinished actions that a robot has been sent.
    pub queue: u32,
    /// The time for which a robot stays where it reached a goal, in seconds.
    pub dwell_s: f64,
    /// Origin of the goals.
    pub assign: Assign,
    /// The number of tasks that are revealed at a time, as a multiple of the robots.
    pub reveal: f64,
    /// The host calls the planner by itself when for so many seconds no robot had
    /// anything left to do and the invocation policy did not call.
    pub watchdog_s: f64,
    /// Simulated seconds between two points of the series.
    pub series_s: f64,
    /// The allowance of calls.
    pub allowance: Allowance,
    /// Cells that close while robots drive, if some do.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub closing: Option<ClosureRate>,
    /// Cells, steps, blocks, disturbances. A step is also ε, the least time of an action.
    pub sim: SimConfig,
}

impl Default for FleetConfig {
    fn default() -> Self {
        Self {
            agents: 1,
            duration_s: 600.0,
            window_s: 10.0,
            limit_s: 1.0,
            rules: Rules::Driven,
            clock: Clock::Lockstep,
            cut: CutBy::Time,
            seed: 0,
            motion: Motion::Pebble,
            queue: 5,
            dwell_s: 0.0,
            assign: Assign::Auto,
            reveal: 1.5,
            watchdog_s: 10.0,
            series_s: 1.0,
            allowance: Allowance::default(),
            closing: None,
            sim: SimConfig::default(),
        }
    }
}

impl FleetConfig {
    /// Motions that planners may be asked for: in steps on the grid, or in continuous time on a roadmap of its cells.
    pub const MOTIONS: &'static [Motion] = &[
        Motion::Pebble,
        Motion::Rotation,
        Motion::StopGo,
        Motion::Slower,
    ];

    /// The motion in steps that generators and fail policies are asked for.
    pub fn motion_in_steps(&self) -> Motion {
        if is_timed(self.motion) {
            Motion::Pebble
        } else {
            self.motion
        }
    }

    /// The same by synchronous rules: a block is a step.
    #[must_use]
    pub fn synchronous(mut self) -> Self {
        self.rules = Rules::Synchronous;
        self.sim.message_period_s = self.sim.step_s;
        self
    }

    /// True if all robots do a step of the plan at a time.
    pub fn is_synchronous(&self) -> bool {
        self.rules == Rules::Synchronous
    }

    /// Refuses what synchronous rules have no place for.
    fn validate_synchronous(&self) -> Result<(), FleetError> {
        let SimConfig {
            step_s,
            ticks_hz,
            message_period_s,
            tier,
            disturbance,
            ..
        } = &self.sim;
        let ticks = step_s * f64::from(*ticks_hz);
        let disturbance = Disturbance {
            seed: 0,
            ..*disturbance
        };
        let wrong = [
            (
                self.clock != Clock::Lockstep,
                "the clock is `realtime`",
                "leave the clock out: robots stand while the planner plans",
            ),
            (
                self.dwell_s > 0.0,
                "robots dwell at goals",
                "leave the dwell out: a goal is reached at the end of a step",
            ),
            (
                *tier != Tier::Kinematic,
                "the tier is `contact`",
                "leave the tier out: robots are where the plan says",
            ),
            (
                disturbance != Disturbance::default(),
                "robots or messages are disturbed",
                "leave delays, noise and losses out: robots are where the plan says",
            ),
            (
                message_period_s.total_cmp(step_s).is_ne() || ticks.fract() > 0.0,
                "a step is no whole number of ticks",
                "give a step and ticks per second whose product is whole, such as 1 and 60",
            ),
        ];
        match wrong.into_iter().find(|(is_wrong, ..)| *is_wrong) {
            Some((_, reason, hint)) => {
                let reason = format!("{reason}, which synchronous rules do not know");
                Err(InputError::new("rules", reason).hint(hint).into())
            }
            None => Ok(()),
        }
    }

    /// Refuses what runs with cells that close have no place for.
    pub(crate) fn validate_closing(&self) -> Result<(), FleetError> {
        let wrong = [
            (
                self.is_synchronous(),
                "by synchronous rules none close",
                "leave the rules out",
            ),
            (
                is_timed(self.motion),
                "planners in continuous time learn their map once",
                "plan in steps, as with the motion `pebble`",
            ),
        ];
        match wrong.into_iter().find(|(is_wrong, ..)| *is_wrong) {
            Some((_, reason, hint)) => {
                let reason = format!("cells close while robots drive, but {reason}");
                Err(InputError::new("closures", reason).hint(hint).into())
            }
            None => Ok(()),
        }
    }

    /// Refuses numbers with which no run is possible.
    pub fn validate(&self) -> Result<(), FleetError> {
        let range = |field, value: f64, low: f64, high: f64, hint| {
            // Written so that NaN is out of range.
            if value >= low && value <= high {
                Ok(())
            } else {
                Err(FleetError::Config { field, value, hint })
            }
        };
        let day = 86_400.0;
        range(
            "agents",
            f64::from(self.agents),
            1.0,
            1e6,
            "give 1 to 1000000 robots",
        )?;
        range(
            "duration_s",
            self.duration_s,
            1e-3,
            366.0 * day,
            "give more than nothing and less than a year",
        )?;
        range(
            "window_s",
            self.window_s,
            0.0,
            day,
            "give seconds up to a day; 0 for no window",
        )?;
        range(
            "limit_s",
            self.limit_s,
            1e-3,
            self.duration_s.min(day),
            "give seconds between 0.001 and the length of the run, whose first answer is in effect \
             after the limit",
        )?;
        range(
            "queue",
            f64::from(self.queue),
            1.0,
            1e4,
            "give 1 to 10000 actions; five are usual",
        )?;
        range("dwell_s", self.dwell_s, 0.0, day, "give seconds, 0 or more")?;
        range(
            "reveal",
            self.reveal,
            1.0,
            1e6,
            "give at least one task per robot",
        )?;
        range(
            "watchdog_s",
            self.watchdog_s,
            1e-3,
            day,
            "give seconds between 0.001 and a day",
        )?;
        range(
            "series_s",
            self.series_s,
            1e-3,
            day,
            "give seconds between 0.001 and a day",
        )?;
        let Allowance {
            prepare_s,
            call_s,
            grace_s,
            ..
        } = self.allowance;
        range(
            "allowance.grace_s",
            grace_s,
            0.0,
            day,
            "give seconds up to a day; 0s for none",
        )?;
        for (field, value) in [
            ("allowance.prepare_s", prepare_s),
            ("allowance.call_s", call_s),
        ] {
            range(
                field,
                value,
                1e-3,
                day,
                "give seconds between 0.001 and a day",
            )?;
        }
        if self.is_synchronous() {
            self.validate_synchronous()?;
        }
        if let Some(ClosureRate { per_s, for_s }) = self.closing {
            range(
                "closing.per_s",
                per_s,
                1e-9,
                1e4,
                "give closures per second, above 0 and up to 10000",
            )?;
            range(
                "closing.for_s",
                for_s,
                1e-3,
                366.0 * day,
                "give seconds between 0.001 and a year",
            )?;
            self.validate_closing()?;
        }
        Ok(self.sim.validate()?)
    }

    /// The window in steps of planners; 0 for none.
    pub fn window_steps(&self) -> u32 {
        (self.window_s / self.sim.step_s).ceil() as u32
    }

    /// Number of actions that [`CutBy::Actions`] commits: the K = ⌈T / ε⌉ that a robot can do until
    /// an answer takes effect, and the cells that it has to know beyond these.
    pub fn lookahead(&self, fleet: Option<&Fleet>) -> u32 {
        let within = (self.limit_s / self.sim.step_s).ceil();
        let beyond = self.beyond_s(fleet) / self.sim.step_s;
        (within + beyond.ceil()) as u32
    }

    /// Within how many seconds of the call actions begin that are committed by
    /// [`CutBy::Time`].
    pub fn horizon_s(&self, fleet: Option<&Fleet>) -> f64 {
        self.limit_s + self.beyond_s(fleet)
    }

    /// Seconds in which robots at their top speed, before they have to brake, drive the distance
    /// that they need to stop, and hear that they need not. Without it they would brake before
    /// every answer, however much it gives them to do.
    fn beyond_s(&self, fleet: Option<&Fleet>) -> f64 {
        let stops = models(fleet).map(Model::usual_stop_m);
        let cells = stops.fold(0.0, f64::max) / self.sim.cell_size_m;
        cells * self.sim.step_s + self.sim.message_period_s
    }

    /// The least times of actions of these robots.
    pub fn pace(&self, fleet: Option<&Fleet>) -> Pace {
        let least = |time: &dyn Fn(&Model) -> f64| {
            let least = models(fleet).map(time).fold(f64::INFINITY, f64::min);
            if least.is_finite() { least } else { 0.0 }
        };
        Pace {
            move_s: self.sim.step_s,
            set_out_s: least(&|model| {
                let (top, stop_m) = (model.max_speed_m_per_s(), model.longest_stop_m());
                // Uniform acceleration takes as far to the top speed as from it to a stop.
                let (way_m, up_to_it_m) = (self.sim.cell_size_m, stop_m);
                let from_rest_s = if way_m < up_to_it_m {
                    2.0 * (way_m * up_to_it_m).sqrt() / top
                } else {
                    (way_m + up_to_it_m) / top
                };
                from_rest_s - way_m / top
            }),
            quarter_turn_s: least(&|model| FRAC_PI_2 / model.max_turn_rate_rad_per_s()),
            dwell_s: self.dwell_s,
        }
    }

    /// The seed of call number `call` of a module. A plugin needs no memory of earlier
    /// calls, so that a run which is replayed or resumed asks for the same.
    pub fn call_seed(&self, kind: Kind, call: u64) -> u64 {
        let mut hasher = Hasher::new("fleetyard.fleet-call/1");
        hasher.u64(self.seed);
        hasher.bytes(kind.as_str().as_bytes());
        hasher.u64(call);
        hasher.finish().0 as u64
    }
}

fn models(fleet: Option<&Fleet>) -> impl Iterator<Item = &Model> {
    let profiles = fleet.map_or(&[][..], Fleet::profiles);
    profiles.iter().map(|profile| &profile.model)
}

//! The instance of a trial, whichever its representation: how a planner is asked about it, and how
//! its plan is judged and executed.

use fleetyard_abi::{Capability, Descriptor, Environment, Instance, Kind, Plan, SharedEnvironment};
use fleetyard_check::{PathRule, metrics, validate_paths};
use fleetyard_core::{Digest, GridInstance, GridPlan, Hasher, InputError, TrajectoryPlan};
use fleetyard_sim::{SimConfig, Simulator, TraceSink};
use fleetyard_views::{Judged, PlanTerms, Problem, View, visits_of};

use crate::execution::execute;
use crate::options::Robots;
use crate::plugin::motion;
use crate::record::{ExecutionInfo, InstanceInfo, Metrics, VerdictInfo};
use crate::trial::Host;
use crate::trial_error::{Missing, TrialError};

/// The most violations that a record lists; all are counted.
const VIOLATIONS: usize = 20;

/// The instance of a trial.
#[derive(Debug, Clone, Copy)]
pub enum TrialInstance<'a> {
    /// On a grid, judged by a rule for the motion between two cells.
    Grid {
        /// Map, starts and goals.
        instance: &'a GridInstance,
        /// The rule.
        path_rule: PathRule,
    },
    /// A view of a task, judged by the rules of the view and by footprints in the world.
    View {
        /// The task with its world.
        problem: &'a Problem,
        /// The view.
        view: &'a View,
        /// Terms that the view leaves open.
        terms: PlanTerms,
    },
}

/// The verdicts on a plan.
pub(crate) struct Found {
    pub(crate) verdict: VerdictInfo,
    /// Both verdicts on a plan of a view.
    pub(crate) judged: Option<Judged>,
}

impl TrialInstance<'_> {
    /// Number of agents.
    pub fn agents(&self) -> usize {
        match self {
            Self::Grid { instance, .. } => instance.agents(),
            Self::View { problem, .. } => problem.task.agents.len(),
        }
    }

    /// Digest of the instance, or of the view.
    pub fn digest(&self) -> Digest {
        match self {
            Self::Grid { instance, .. } => instance.digest(),
            Self::View { problem, view, .. } => view.digest(problem),
        }
    }

    /// Digest of a plan, the same as of its file; of one that is broken, the digest of its fault.
    pub(crate) fn plan_digest(&self, plan: &Plan) -> Digest {
        let digest = match (plan, self) {
            (Plan::Cells(plan), _) => Ok(Digest::of_plan(plan)),
            (Plan::Visits(visits), _) => visits_of(visits).map(|plan| plan.digest()),
            (Plan::Trajectories(motions), Self::View { problem, .. }) => {
                problem.motions(motions).map(|plan| plan.digest())
            }
            (Plan::Trajectories(_), Self::Grid { .. }) => Err("trajectories on a grid".to_owned()),
        };
        digest.unwrap_or_else(|fault| {
            let mut hasher = Hasher::new("fleetyard.broken-plan/1");
            hasher.bytes(fault.as_bytes());
            hasher.finish()
        })
    }

    /// Refuses what no planner may be asked; `source` names the instance.
    pub(crate) fn check(&self, source: &str) -> Result<(), TrialError> {
        let Self::Grid {
            instance,
            path_rule,
        } = self
        else {
            return Ok(());
        };
        let agents = instance.agents();
        if path_rule.allows_agents(agents) {
            return Ok(());
        }
        let reason = format!("the path rule `{path_rule}` is for one agent, not for {agents}");
        Err(InputError::new(source, reason)
            .hint("plans of several agents are judged by the rule `steps`")
            .into())
    }

    /// Refuses a planner of this description that does not do what the instance needs, before it is
    /// asked; `map` is its map as planners are told it.
    pub(crate) fn check_planner(
        &self,
        host: &Host,
        descriptor: &Descriptor,
        map: &Environment,
        config: &SimConfig,
    ) -> Result<(), TrialError> {
        let missing = |descriptor: &Descriptor| self.missing(descriptor, map, config);
        missing(descriptor).map_or(Ok(()), |what| {
            Err(TrialError::Incapable {
                planner: descriptor.id.clone(),
                missing: what,
                able: host
                    .runtime
                    .able(Kind::Planner, |other| missing(other).is_none()),
            })
        })
    }

    /// The first thing that the instance needs and a planner of this description does not do.
    pub(crate) fn missing(
        &self,
        descriptor: &Descriptor,
        map: &Environment,
        config: &SimConfig,
    ) -> Option<Missing> {
        let instance = self.instance(descriptor, config);
        let claims = descriptor.capabilities;
        let needed = map.needs().with(instance.needs());
        if let Some(needed) = needed.iter().find(|needed| !claims.has(*needed)) {
            let on_a_map = matches!(self, Self::Grid { .. });
            return Some(Missing::Capability {
                needed,
                lines: on_a_map && claims.has(Capability::AnyAngle),
            });
        }
        let mut features = instance.needs_features().into_iter();
        if let Some(feature) = features.find(|feature| !descriptor.features.contains(feature)) {
            return Some(Missing::Feature(feature));
        }
        let agents = instance.agents();
        let most = descriptor.most_agents().filter(|most| *most < agents)?;
        Some(Missing::Agents { most, agents })
    }

    /// The map as planners are told it.
    pub(crate) fn environment(&self, config: &SimConfig) -> SharedEnvironment {
        match self {
            Self::Grid { instance, .. } => {
                fleetyard_runtime::environment(instance, config.cell_size_m, config.step_s)
            }
            Self::View {
                problem,
                view,
                terms,
            } => view.environment(problem, terms.step_s),
        }
    }

    /// The instance as a planner of this description is asked to solve it.
    pub(crate) fn instance(&self, descriptor: &Descriptor, config: &SimConfig) -> Instance {
        match self {
            Self::Grid {
                instance,
                path_rule,
            } => Instance {
                motion: motion(descriptor, *path_rule),
                ..fleetyard_runtime::instance(instance, config.radius_m())
            },
            Self::View {
                problem,
                view,
                terms,
            } => view.instance(problem, *terms),
        }
    }

    /// The instance as a record has it; `scenario` says where it is from.
    pub(crate) fn info(&self, scenario: &str) -> InstanceInfo {
        match self {
            Self::Grid {
                instance,
                path_rule,
            } => InstanceInfo {
                path_rule: Some(*path_rule),
                map: instance.grid().name().to_owned(),
                scenario: scenario.to_owned(),
                agents: instance.agents(),
                connectivity: Some(instance.connectivity().degree()),
                representation: None,
            },
            Self::View { problem, view, .. } => InstanceInfo {
                path_rule: None,
                map: problem.task.title().to_owned(),
                scenario: scenario.to_owned(),
                agents: self.agents(),
                connectivity: match view {
                    View::Grid(view) => Some(view.instance.connectivity().degree()),
                    View::Roadmap(_) | View::Continuous => None,
                },
                representation: Some(view.representation()),
            },
        }
    }

    /// Judges a plan.
    pub(crate) fn judge(&self, plan: &Plan) -> Found {
        match (self, plan) {
            (
                Self::Grid {
                    instance,
                    path_rule,
                },
                Plan::Cells(plan),
            ) => Found {
                verdict: validate_paths(instance, plan, *path_rule, VIOLATIONS).into(),
                judged: None,
            },
            (
                Self::View {
                    problem,
                    view,
                    terms,
                },
                plan,
            ) => match view.judge(problem, plan, *terms, VIOLATIONS) {
                Ok(judged) => Found {
                    verdict: VerdictInfo::of_view(&judged),
                    judged: Some(judged),
                },
                Err(reason) => Found {
                    verdict: VerdictInfo::none(reason),
                    judged: None,
                },
            },
            (Self::Grid { .. }, plan) => {
                let form = plan.as_ref().field();
                let reason = format!("the plan has the form `{form}`, which is none on a grid");
                Found {
                    verdict: VerdictInfo::none(reason),
                    judged: None,
                }
            }
        }
    }

    /// True if a plan is valid, without its violations.
    pub(crate) fn allows(&self, plan: &Plan) -> bool {
        match (self, plan) {
            (
                Self::Grid {
                    instance,
                    path_rule,
                },
                Plan::Cells(plan),
            ) => validate_paths(instance, plan, *path_rule, 0).valid,
            _ => self.judge(plan).verdict.valid,
        }
    }

    /// Figures of a plan, without those of the call.
    pub(crate) fn metrics(
        &self,
        plan: Option<&Plan>,
        found: Option<&Found>,
        config: &SimConfig,
    ) -> Metrics {
        let there = plan.and_then(|plan| self.at_goal(plan));
        let metrics = match self {
            Self::Grid {
                instance,
                path_rule,
            } => {
                let plan = plan.and_then(Plan::cells);
                let valid = found.is_some_and(|found| found.verdict.valid);
                of_grid(instance, *path_rule, plan, valid, config.cell_size_m)
            }
            Self::View { .. } => {
                let judged = found.and_then(|found| found.judged.as_ref());
                let costs = judged.and_then(|judged| judged.costs);
                let steps = judged.and_then(|judged| judged.steps);
                Metrics {
                    soc_steps: steps.map(|steps| steps.sum_of_costs),
                    makespan_steps: steps.map(|steps| steps.makespan),
                    length_m: costs.map(|costs| costs.length_m),
                    soc_s: costs.map(|costs| costs.sum_of_costs_s),
                    makespan_s: costs.map(|costs| costs.makespan_s),
                    ..Metrics::default()
                }
            }
        };
        Metrics {
            agents_at_goal: there,
            individual_success: there.map(|there| there as f64 / self.agents().max(1) as f64),
            ..metrics
        }
    }

    /// The agents whose paths end at their goals.
    fn at_goal(&self, plan: &Plan) -> Option<u64> {
        let count = |ends: &[Option<u32>], goals: &[u32]| {
            let pairs = ends.iter().zip(goals);
            pairs.filter(|(end, goal)| **end == Some(**goal)).count() as u64
        };
        let of_cells = |plan: &GridPlan| -> Vec<Option<u32>> {
            plan.paths().map(|path| path.last().copied()).collect()
        };
        match (self, plan) {
            (Self::Grid { instance, .. }, Plan::Cells(plan)) => {
                Some(count(&of_cells(plan), instance.goals()))
            }
            (Self::View { view, .. }, plan) => match (view, plan) {
                (View::Grid(view), Plan::Cells(plan)) => {
                    Some(count(&of_cells(plan), view.instance.goals()))
                }
                (View::Roadmap(view), Plan::Visits(visits)) => {
                    let plan = visits_of(visits).ok()?;
                    let ends = plan.paths().map(|visits| Some(visits.last()?.vertex));
                    let ends: Vec<_> = ends.collect();
                    Some(count(&ends, &view.goals))
                }
                _ => None,
            },
            _ => None,
        }
    }

    /// Executes a plan. One of a view has to have a place in the world.
    pub(crate) fn execute(
        &self,
        robots: &Robots,
        plan: &Plan,
        found: &Found,
        (config, source): (&SimConfig, &str),
        trace: &mut dyn TraceSink,
    ) -> Result<Option<ExecutionInfo>, TrialError> {
        match (self, plan) {
            (
                Self::Grid {
                    instance,
                    path_rule,
                },
                Plan::Cells(plan),
            ) => {
                let fleet = robots.fleet(instance.agents(), config)?;
                let mut simulator = Simulator::new(config).on_grid(instance.grid());
                if let Some(fleet) = &fleet {
                    simulator = simulator.with_fleet(fleet);
                }
                if *path_rule == PathRule::Steps {
                    return Ok(Some(execute(&simulator, plan, trace)?));
                }
                let (cell_m, step_s) = (config.cell_size_m, config.step_s);
                let lines = TrajectoryPlan::along_lines(plan, instance.grid(), cell_m, step_s)
                    .map_err(|error| InputError::new(source, error.to_string()))?;
                Ok(Some(execute(&simulator, &lines, trace)?))
            }
            (Self::View { problem, view, .. }, _) => {
                let judged = found.judged.as_ref();
                let Some(lifted) = judged.and_then(|judged| judged.lifted.as_ref()) else {
                    return Ok(None);
                };
                let headings = problem.start_headings();
                let trailers = problem.trailer_headings();
                let mut simulator = Simulator::new(config)
                    .in_workspace(&problem.world)
                    .with_fleet(&problem.fleet)
                    .facing(&headings)
                    .towing(&trailers);
                if let View::Roadmap(view) = view {
                    simulator = simulator.over_roadmap(&view.roadmap);
                }
                Ok(Some(execute(&simulator, lifted, trace)?))
            }
            (Self::Grid { .. }, _) => Ok(None),
        }
    }
}

fn of_grid(
    instance: &GridInstance,
    path_rule: PathRule,
    plan: Option<&GridPlan>,
    valid: bool,
    cell_size_m: f64,
) -> Metrics {
    // Lines have no times, and so no costs in steps.
    let timed = path_rule == PathRule::Steps;
    // The lower bound does not depend on the plan: an empty one will do.
    let empty = GridPlan::default();
    let of_plan = metrics(instance, plan.unwrap_or(&empty), cell_size_m);
    let bound = of_plan.lower_bound_steps;
    Metrics {
        soc_steps: plan.filter(|_| timed).map(|_| of_plan.sum_of_costs),
        makespan_steps: plan.filter(|_| timed).map(|_| of_plan.makespan),
        lower_bound_steps: bound,
        suboptimality: plan
            .filter(|_| timed && valid && bound > 0)
            .map(|_| of_plan.sum_of_costs as f64 / bound as f64),
        length_cells: plan.map(|_| of_plan.length_cells),
        length_m: plan.map(|_| of_plan.length_m),
        lower_bound_m: of_plan.lower_bound_m,
        waits: plan.filter(|_| timed).map(|_| of_plan.waits),
        ..Metrics::default()
    }
}

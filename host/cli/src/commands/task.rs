//! Plans of a task's views: which view a plan file is of, its verdicts, and its way into the world.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;
use fleetyard_bench::{Host, Plugin};
use fleetyard_check::Pace;
use fleetyard_core::formats::{
    Format as FileFormat, TRANSPOSED_HINT, UnreadPlan, grid_size, looks_transposed,
};
use fleetyard_core::{Digest, InputError, Roadmap, TrajectoryFile};
use fleetyard_views::{
    Given, GridTerms, GridView, Judged, PlanTerms, Problem, Representation, RoadmapView, StepCosts,
    View, ViewFile, ViewSpec, ViewVerdict, load_problem, load_view,
};
use serde::Serialize;

use super::validate_plane::check_headings;
use super::verdict::{Unlisted, write_costs, write_verdict, write_world};
use super::world::{GridSpecArgs, RoadmapSpecArgs};
use crate::args::{VIEW, word};
use crate::exit::{Exit, Failure, Result};
use crate::output;

/// A task, and the view of it that a plan is of.
#[derive(Debug, Args)]
pub(super) struct TaskArgs {
    /// Task file: the plan is judged by the rules of its view and by footprints in the task's world
    #[arg(long, help_heading = VIEW, value_name = "FILE", group = "cells",
          conflicts_with_all = ["cell_size", "path_rule"])]
    task: Option<PathBuf>,
    #[command(flatten)]
    pub(super) view: ViewArgs,
}

/// A view of a task. The argument that names the task is in the group `cells`.
#[derive(Debug, Args)]
pub(super) struct ViewArgs {
    /// Kind of view [default: that of the plan; for `run` the only one that the planner claims, or
    /// grid]
    #[arg(long, help_heading = VIEW, value_parser = word::<Representation>(), requires = "task")]
    pub(super) representation: Option<Representation>,
    /// View file that `fleetyard world grid` or `fleetyard world roadmap` wrote, in place of parameters
    #[arg(long, help_heading = VIEW, value_name = "FILE", requires = "task",
          conflicts_with_all = ["connectivity", "BuilderArgs", "RoadmapSpecArgs", "roadmap_seed"])]
    view: Option<PathBuf>,
    /// Roadmap file in place of a roadmap that is made: starts and goals are at its vertices
    #[arg(long, help_heading = VIEW, value_name = "FILE", requires = "task",
          conflicts_with_all = ["view", "connectivity", "BuilderArgs", "spacing", "roadmap_seed"])]
    roadmap: Option<PathBuf>,
    #[command(flatten)]
    pub(super) grid: GridSpecArgs,
    #[command(flatten)]
    made: RoadmapSpecArgs,
    /// Seed of a drawn roadmap; the task's if it is not given
    #[arg(long, help_heading = VIEW, value_name = "N", requires = "task")]
    roadmap_seed: Option<u64>,
    /// Speeds of robots on a roadmap
    #[arg(long, help_heading = VIEW, value_parser = word::<Pace>(), default_value_t, requires = "task")]
    pub(super) pace: Pace,
}

impl ViewArgs {
    /// The view that is asked for; of the kind `otherwise` where none is named.
    pub(super) fn choose(&self, otherwise: Representation) -> Result<Chosen> {
        let chosen = match (&self.view, &self.roadmap) {
            (Some(path), _) => Chosen::File(load_view(path)?),
            (None, Some(path)) => {
                let given = Given::load(path.clone(), self.made.speed())?;
                Chosen::Spec(ViewSpec::Given(given))
            }
            (None, None) => Chosen::Spec(self.spec(self.representation.unwrap_or(otherwise))),
        };
        let (is, argument) = (chosen.representation(), chosen.argument());
        match self.representation.filter(|asked| *asked != is) {
            None => Ok(chosen),
            Some(asked) => {
                let message = format!(
                    "--representation {asked} asks for another view than {argument}, which is {}",
                    place(is)
                );
                let hint = format!("leave out --representation or {argument}");
                Err(Failure::new(Exit::Usage, message).hint(hint))
            }
        }
    }

    /// True if neither a kind nor a file is named.
    pub(super) fn is_open(&self) -> bool {
        self.view.is_none() && self.roadmap.is_none() && self.representation.is_none()
    }

    /// The files that describe the view.
    pub(super) fn files(&self) -> impl Iterator<Item = &PathBuf> {
        self.view.iter().chain(&self.roadmap)
    }

    fn spec(&self, representation: Representation) -> ViewSpec {
        match representation {
            Representation::Grid => ViewSpec::Grid(self.grid.spec()),
            Representation::Roadmap => ViewSpec::Roadmap(self.made.spec(self.roadmap_seed)),
            Representation::Continuous => ViewSpec::Continuous,
        }
    }
}

/// The representations that a planner claims to plan in.
pub(super) fn claimed(host: &Host, planner: &Plugin) -> Result<Vec<Representation>> {
    let running = planner.start(&host.runtime)?;
    let claimed = Representation::claimed_in(running.descriptor.capabilities).collect();
    running.close();
    Ok(claimed)
}

/// A view that is not derived yet.
pub(super) enum Chosen {
    /// By its file.
    File(ViewFile),
    /// By parameters.
    Spec(ViewSpec),
}

impl Chosen {
    pub(super) fn representation(&self) -> Representation {
        match self {
            Self::File(file) => file.spec.representation(),
            Self::Spec(spec) => spec.representation(),
        }
    }

    /// The argument that says it.
    pub(super) fn argument(&self) -> &'static str {
        match self {
            Self::File(_) => "--view",
            Self::Spec(ViewSpec::Given(_)) => "--roadmap",
            Self::Spec(_) => "--representation",
        }
    }

    pub(super) fn derive(&self, problem: &Problem) -> Result<View> {
        Ok(match self {
            Self::File(file) => file.derive(problem)?,
            Self::Spec(spec) => spec.derive(problem)?,
        })
    }
}

/// A plan of a view with its verdicts.
pub(super) struct Judgement {
    pub(super) problem: Problem,
    view: View,
    pub(super) report: Report,
    /// The plan has the starts of its instance with rows and columns exchanged.
    looks_transposed: bool,
}

/// The verdicts as their user sees them.
#[derive(Serialize)]
pub(super) struct Report {
    representation: Representation,
    #[serde(flatten)]
    judged: Judged,
    view_digest: Digest,
    plan_digest: Digest,
}

impl TaskArgs {
    /// The task, if a plan of one of its views is asked for. A task names its world and its robots:
    /// `others` are the arguments that name them otherwise, each with whether it is given. The parser
    /// would not miss the task that a view's parameters need where an argument is in conflict with it.
    pub(super) fn task(&self, others: &[(&str, bool)]) -> Result<Option<&Path>> {
        let given = others.iter().find(|(_, is_given)| *is_given);
        match (&self.task, given) {
            (Some(_), Some((name, _))) => {
                let message = format!("{name} cannot be used with --task");
                let hint = "a task names its world and its robots";
                Err(Failure::new(Exit::Usage, message).hint(hint))
            }
            (task, _) => Ok(task.as_deref()),
        }
    }

    /// Reads a task and a plan of one of its views, derives the view, and judges the plan: at most
    /// `listed` violations by either judge. A step of a plan on a grid takes `step_s` seconds,
    /// or what the view says.
    pub(super) fn judge(
        &self,
        task: &Path,
        plan: &Path,
        format: Option<FileFormat>,
        step_s: Option<f64>,
        listed: usize,
    ) -> Result<Judgement> {
        let problem = load_problem(task)?;
        let file = UnreadPlan::load(plan, format)?;
        let of_plan = Representation::of_plans(file.format());
        let chosen = self.view.choose(of_plan)?;
        check_kind(&file, of_plan, chosen.representation(), chosen.argument())?;
        let view = chosen.derive(&problem)?;
        let mut looks_transposed = false;
        let (judged, plan_digest) = match &view {
            View::Grid(grid) => {
                let ViewArgs {
                    grid: asked, pace, ..
                } = &self.view;
                let terms = view.terms(&problem, asked.separation, *pace, step_s);
                let (judged, digest, turned) = judge_grid(&problem, grid, &file, terms, listed)?;
                looks_transposed = turned;
                (judged, digest)
            }
            View::Roadmap(view) => self.judge_roadmap(&problem, view, &file, listed)?,
            View::Continuous => {
                let TrajectoryFile { source, plan, .. } = problem.read(&file)?;
                let agents = 0..problem.fleet.agents();
                check_headings(&source, &plan, agents.map(|agent| problem.shape(agent)))?;
                (problem.judge(&plan, listed), plan.digest())
            }
        };
        let report = Report {
            representation: view.representation(),
            view_digest: view.digest(&problem),
            plan_digest,
            judged,
        };
        Ok(Judgement {
            problem,
            view,
            report,
            looks_transposed,
        })
    }

    fn judge_roadmap(
        &self,
        problem: &Problem,
        view: &RoadmapView,
        file: &UnreadPlan,
        listed: usize,
    ) -> Result<(Judged, Digest)> {
        let file = view.read(file)?;
        let judged = view.judge(problem, &file.plan, self.view.pace, listed)?;
        Ok((judged, file.plan.digest()))
    }
}

/// The verdicts on a plan on a grid, its digest, and true if it seems to have rows and columns exchanged.
fn judge_grid(
    problem: &Problem,
    view: &GridView,
    file: &UnreadPlan,
    terms: PlanTerms,
    listed: usize,
) -> Result<(Judged, Digest, bool)> {
    let instance = &view.instance;
    let file = view.read(file)?;
    let terms = GridTerms {
        separation: terms.separation,
        step_s: terms.step_s,
    };
    let judged = view.judge(problem, &file.plan, terms, listed);
    let size = grid_size(instance.grid());
    let turned = !judged.is_valid() && looks_transposed(size, instance.starts(), &file.plan);
    Ok((judged, Digest::of_plan(&file.plan), turned))
}

pub(super) fn place(representation: Representation) -> &'static str {
    match representation {
        Representation::Grid => "on a grid",
        Representation::Roadmap => "on a roadmap",
        Representation::Continuous => "in the plane",
    }
}

/// Refuses a plan of another kind of view than the one that is asked for.
fn check_kind(
    file: &UnreadPlan,
    found: Representation,
    asked: Representation,
    by: &str,
) -> Result<()> {
    if found == asked {
        return Ok(());
    }
    let (is, wanted) = (place(found), place(asked));
    let reason = format!("this is a plan {is}, and {by} asks for one {wanted}");
    Err(InputError::new(file.source(), reason)
        .hint(format!("name a plan {wanted}, or leave out {by}"))
        .into())
}

impl Judgement {
    /// The plan in the world, ready to be executed; `source` is its file.
    pub(super) fn lifted(&self, source: &Path) -> Result<TrajectoryFile> {
        let judged = &self.report.judged;
        let source = source.display().to_string();
        let plan = judged.lifted.clone().ok_or_else(|| {
            let reason = judged.no_place.clone().unwrap_or_default();
            let hint = "`fleetyard validate` says what else is wrong with the plan";
            InputError::new(source.as_str(), reason).hint(hint)
        })?;
        Ok(TrajectoryFile {
            source,
            planner: None,
            plan_digest: None,
            plan,
        })
    }

    /// The roadmap of the view, if it is one.
    pub(super) fn roadmap(&self) -> Option<Arc<Roadmap>> {
        match &self.view {
            View::Roadmap(view) => Some(Arc::new(view.roadmap.clone())),
            View::Grid(_) | View::Continuous => None,
        }
    }

    pub(super) fn is_valid(&self) -> bool {
        self.report.judged.is_valid()
    }

    /// Hints for the user that the verdicts themselves do not give.
    pub(super) fn hint(&self) {
        if self.looks_transposed {
            output::hint(TRANSPOSED_HINT);
        }
    }
}

impl Report {
    /// The verdicts for people; `listed` is how many violations of each are shown at most.
    pub(super) fn verdicts(&self, listed: usize) -> String {
        let Self {
            representation,
            judged,
            ..
        } = self;
        let mut out = String::new();
        match &judged.view {
            Some(ViewVerdict::Grid(verdict)) => {
                let found = verdict.violations.iter();
                let found = found.map(|found| (found.rule.name(), found.sentence.as_str()));
                let unlisted = Unlisted::of_all(verdict.violation_count, verdict.violations.len());
                write_verdict(&mut out, "on the grid: ", found, unlisted);
            }
            Some(ViewVerdict::Roadmap(verdict)) => {
                let found = verdict.violations.iter();
                let found = found.map(|found| (found.rule.name(), found.sentence.as_str()));
                let unlisted = Unlisted::of_some(listed, verdict.violations.len());
                write_verdict(&mut out, "on the roadmap: ", found, unlisted);
            }
            None => {}
        }
        let label = match representation {
            Representation::Continuous => "",
            _ => "in the world: ",
        };
        match (&judged.world, &judged.no_place) {
            (Some(verdict), _) => write_world(&mut out, label, verdict, listed),
            (None, reason) => {
                let reason = reason.as_deref().unwrap_or("the plan has no place there");
                // Writing to a string cannot fail.
                let _ = writeln!(out, "{label}not judged, {reason}");
            }
        }
        out
    }

    /// The verdicts in a line.
    pub(super) fn summary(&self) -> String {
        let told = |is_valid: bool| if is_valid { "valid" } else { "INVALID" };
        let Judged { view, world, .. } = &self.judged;
        let view = view.as_ref().map(ViewVerdict::is_valid).map(told);
        let view = view.map(|view| format!("{view} {}, ", place(self.representation)));
        let world = world.as_ref().is_some_and(|world| world.valid);
        format!("{}{} in the world", view.unwrap_or_default(), told(world))
    }

    /// Verdicts and costs for people.
    pub(super) fn text(&self, listed: usize) -> String {
        let mut out = self.verdicts(listed);
        let Judged { costs, steps, .. } = &self.judged;
        if let Some(costs) = costs {
            write_costs(&mut out, costs);
        }
        if let Some(steps) = steps {
            let StepCosts {
                sum_of_costs,
                makespan,
            } = steps;
            // Writing to a string cannot fail.
            let _ = writeln!(out, "in steps     {sum_of_costs}, the last at {makespan}");
        }
        out.truncate(out.trim_end().len());
        out
    }
}

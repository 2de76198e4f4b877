//! Problems in the terms of solvers: the files that say what to solve, and the way back of
//! answers. Each representation has its own.

mod grid;
mod plane;
mod roadmap;

use std::path::Path;

use fleetyard_abi::sdk::Failure;
use fleetyard_abi::{Environment, Instance, Plan, SharedEnvironment, Status};
use fleetyard_core::InputError;

use super::input::ProblemInput;
use super::manifest::Manifest;

/// A file of the scratch folder: its name and its content.
pub(super) type File = (&'static str, Vec<u8>);

/// A map as a solver was prepared with it.
pub(super) trait Problem: Send {
    /// Refuses instances for which solvers were not written: they would not notice, or crash.
    fn check(&self, manifest: &Manifest, instance: &Instance) -> Result<(), Failure>;

    /// The files of an instance, beside those of the map.
    fn files(
        &self,
        manifest: &Manifest,
        instance: &Instance,
        seed: u64,
        scratch: &Path,
    ) -> Result<Vec<File>, Failure>;

    /// Reads an answer as a plan.
    fn plan_in(
        &self,
        manifest: &Manifest,
        answer: &[u8],
        instance: &Instance,
    ) -> Result<Plan, InputError>;

    /// Number of free cells or vertices.
    fn places(&self) -> u64;

    /// The change of the problem without which the solver could not read it, if there is one.
    fn fact(&self) -> Option<String> {
        None
    }
}

/// A map in a solver's terms, and the files that say it.
pub(super) fn prepare(
    manifest: &Manifest,
    environment: &SharedEnvironment,
) -> Result<(Box<dyn Problem>, Vec<File>), Failure> {
    Ok(match &manifest.input.problem {
        ProblemInput::Grid(input) => {
            let (problem, files) = grid::OnGrid::new(manifest, *input, environment)?;
            (Box::new(problem), files)
        }
        ProblemInput::Roadmap(input) => {
            let (problem, files) = roadmap::OnRoadmap::new(manifest, *input, environment)?;
            (Box::new(problem), files)
        }
        ProblemInput::Plane(_) => {
            let problem = plane::InPlane::new(manifest, environment)?;
            (Box::new(problem), Vec::new())
        }
    })
}

/// The answer of a planner that is not made for such problems.
pub(super) fn unsupported(manifest: &Manifest, what: &str) -> Failure {
    Failure::new(Status::Unsupported, format!("{} {what}", manifest.head.id))
}

fn invalid(reason: impl Into<String>) -> Failure {
    Failure::new(Status::InvalidInput, reason)
}

/// Refuses instances that contradict themselves or the map, and agents with several goals or none.
fn check_places(
    manifest: &Manifest,
    environment: &Environment,
    instance: &Instance,
) -> Result<(), Failure> {
    instance.check(environment.places()).map_err(invalid)?;
    let mut goals = instance.goals.iter().map(<[u32]>::len);
    let mut in_plane = instance.goal_states.iter().map(<[_]>::len);
    if goals.any(|count| count != 1) || in_plane.any(|count| count != 1) {
        return Err(unsupported(manifest, "takes one goal per agent"));
    }
    Ok(())
}

/// A place that occurs more than once.
fn twice(places: &[u32]) -> Option<u32> {
    let mut sorted = places.to_vec();
    sorted.sort_unstable();
    let mut pairs = sorted.windows(2);
    pairs.find(|pair| pair[0] == pair[1]).map(|pair| pair[0])
}

//! Problems in the terms of solvers: the files that say what to solve, and the way back of
//! answers. Each representation has its own.

mod grid;
mod plane;
mod roadmap;
mod terms;

use fleetyard_abi::SharedEnvironment;
use fleetyard_abi::sdk::Failure;

use super::input::ProblemInput;
use super::manifest::Manifest;
use terms::File;
pub(super) use terms::{Problem, seed31, told, unsupported};

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

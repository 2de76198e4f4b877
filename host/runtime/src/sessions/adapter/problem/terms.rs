//! The terms in which every representation is told to solvers.

use std::path::Path;

use fleetyard_abi::sdk::Failure;
use fleetyard_abi::{Capability, Environment, Instance, Plan, Status};
use fleetyard_core::InputError;

use crate::sessions::adapter::manifest::Manifest;

/// A file of the scratch folder: its name and its content.
pub(crate) type File = (&'static str, Vec<u8>);

/// A map as a solver was prepared with it.
pub(crate) trait Problem: Send {
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

/// The answer of a planner that is not made for such problems.
pub(crate) fn unsupported(manifest: &Manifest, what: &str) -> Failure {
    Failure::new(Status::Unsupported, format!("{} {what}", manifest.head.id))
}

/// The answer to a map of another representation than the solver's, with its name.
pub(crate) fn elsewhere(manifest: &Manifest, what: &str, environment: &Environment) -> Failure {
    let other = environment
        .needs()
        .iter()
        .next()
        .map_or("", Capability::as_str);
    unsupported(manifest, &format!("{what}, not on `{other}`"))
}

pub(crate) fn invalid(reason: impl Into<String>) -> Failure {
    Failure::new(Status::InvalidInput, reason)
}

/// Refuses instances that contradict themselves or the map, and agents with several goals or none.
pub(crate) fn check_places(
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
pub(crate) fn twice(places: &[u32]) -> Option<u32> {
    let mut sorted = places.to_vec();
    sorted.sort_unstable();
    let mut pairs = sorted.windows(2);
    pairs.find(|pair| pair[0] == pair[1]).map(|pair| pair[0])
}

/// An error in one line, its hint after it.
pub(crate) fn told(error: &InputError) -> String {
    match &error.hint {
        Some(hint) => format!("{error}; {hint}"),
        None => error.to_string(),
    }
}

/// A seed for solvers that read a C `int`.
pub(crate) fn seed31(seed: u64) -> u32 {
    (seed & 0x7fff_ffff) as u32
}

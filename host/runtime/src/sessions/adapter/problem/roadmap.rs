//! Roadmaps, for solvers that drive at unit speed.
//!
//! A solver that has a radius compiled in takes discs of any other size for its own. So lengths are
//! scaled until the robots have its radius: at its unit speed, times come out longer by the same
//! factor and the robots' speed, and the answer is divided by both. What the solver finds conflicts
//! in its unit are the conflicts of the robots.

use std::path::Path;

use fleetyard_abi::sdk::Failure;
use fleetyard_abi::{Instance, Motion, Plan, RoadmapEnvironment, SharedEnvironment};
use fleetyard_core::formats::{
    CcbsPlaces, Format, read_ccbs_log, read_psipp_plan, write_ccbs_roadmap, write_ccbs_task,
    write_psipp_problem,
};
use fleetyard_core::{
    InputError, Roadmap, RoadmapPlan, TrajectoryPlan, Visit, read_roadmap_plan, read_trajectories,
};

use super::super::input::{
    PROBLEM_NAME, ROADMAP_NAME, RoadmapFiles, RoadmapInput, TASK_NAME, Unit,
};
use super::super::manifest::{Manifest, Written};
use super::terms::{File, Problem, check_places, elsewhere, invalid, twice, unsupported};

/// Distance from a vertex, in units of the solver, at which an answer is at it: many programs write six
/// decimals.
const AT_VERTEX: f64 = 1e-6;

/// Difference between the time of an edge and that of its length that is rounding, as a share of it.
const EVEN: f64 = 1e-9;

/// A roadmap.
pub(super) struct OnRoadmap {
    input: RoadmapInput,
    environment: SharedEnvironment,
    /// The roadmap in units of the solver.
    scaled: Roadmap,
    radius_m: f64,
    speed_m_per_s: f64,
    units_per_m: f64,
}

impl OnRoadmap {
    pub(super) fn new(
        manifest: &Manifest,
        input: RoadmapInput,
        environment: &SharedEnvironment,
    ) -> Result<(Self, Vec<File>), Failure> {
        let Some(given) = environment.roadmap() else {
            return Err(elsewhere(manifest, "plans on roadmaps", environment));
        };
        if let Some(edge) = uneven(given) {
            let what = format!("drives every edge straight and at one speed, unlike edge {edge}");
            return Err(unsupported(manifest, &what));
        }
        let radius_m = given.separation_m / 2.0;
        let units_per_m = match input.unit {
            Unit::PerM(units) => units,
            Unit::Radius(radius) => radius / radius_m,
        };
        let fits = |number: f64| number.is_finite() && number > 0.0;
        if !(fits(radius_m) && fits(units_per_m)) {
            let what = format!("plans for discs, not for a radius of {radius_m} m");
            return Err(unsupported(manifest, &what));
        }
        let scaled = |at_m: &[f64]| at_m.iter().map(|at_m| at_m * units_per_m).collect();
        let edges = (0..).zip(given.edges.iter());
        let edges = edges.flat_map(|(from, ends)| ends.iter().map(move |to| (from, *to)));
        let scaled = Roadmap::new(scaled(&given.x_m), scaled(&given.y_m), edges)
            .map_err(|error| invalid(error.to_string()))?;
        let files = match input.files {
            RoadmapFiles::Ccbs => vec![(ROADMAP_NAME, write_ccbs_roadmap(&scaled))],
            RoadmapFiles::Psipp => Vec::new(),
        };
        let problem = Self {
            input,
            scaled,
            radius_m,
            speed_m_per_s: given.speed_m_per_s,
            units_per_m,
            environment: environment.clone(),
        };
        Ok((problem, files))
    }

    /// Units of the solver's time in a second.
    fn units_per_s(&self) -> f64 {
        self.units_per_m * self.speed_m_per_s
    }

    /// The visits of an answer in units of the solver.
    fn visits(
        &self,
        source: &str,
        plan: &TrajectoryPlan,
        starts: &[u32],
    ) -> Result<RoadmapPlan, InputError> {
        let visits = RoadmapPlan::of_trajectories(plan, &self.scaled, starts, AT_VERTEX);
        visits.map_err(|error| {
            let hint = error.hint();
            InputError::new(source, error.to_string()).maybe_hint(hint)
        })
    }
}

/// An edge that takes another time than its straight length at the roadmap's speed, by its number.
fn uneven(roadmap: &RoadmapEnvironment) -> Option<usize> {
    let straight = RoadmapEnvironment::straight(
        roadmap.x_m.clone(),
        roadmap.y_m.clone(),
        roadmap.edges.clone(),
        roadmap.speed_m_per_s,
        roadmap.separation_m,
    );
    // Also false for what is not a number.
    let near = |(one, other): (&f64, &f64)| (one - other).abs() <= EVEN * other.abs();
    let lengths = roadmap.length_m.iter().zip(&straight.length_m);
    let times = roadmap.duration_s.iter().zip(&straight.duration_s);
    lengths
        .zip(times)
        .position(|(length, time)| !(near(length) && near(time)))
}

impl Problem for OnRoadmap {
    fn check(&self, manifest: &Manifest, instance: &Instance) -> Result<(), Failure> {
        if instance.motion != Motion::StopGo {
            return Err(unsupported(manifest, "drives edges at full speed"));
        }
        check_places(manifest, &self.environment, instance)?;
        if let Some(vertex) = twice(&instance.starts) {
            return Err(invalid(format!("two agents start at vertex {vertex}")));
        }
        if let Some(vertex) = twice(instance.goals.items()) {
            let what = format!("takes no goal twice, as vertex {vertex}");
            return Err(unsupported(manifest, &what));
        }
        Ok(())
    }

    fn files(
        &self,
        _: &Manifest,
        instance: &Instance,
        _: u64,
        _: &Path,
    ) -> Result<Vec<File>, Failure> {
        let (starts, goals) = (&instance.starts, instance.goals.items());
        Ok(match self.input.files {
            RoadmapFiles::Ccbs => vec![(TASK_NAME, write_ccbs_task(starts, goals))],
            RoadmapFiles::Psipp => {
                let radius = self.radius_m * self.units_per_m;
                let bytes = write_psipp_problem(&self.scaled, starts, goals, radius);
                vec![(PROBLEM_NAME, bytes)]
            }
        })
    }

    fn plan_in(
        &self,
        manifest: &Manifest,
        answer: &[u8],
        instance: &Instance,
    ) -> Result<Plan, InputError> {
        let source = manifest.output.source();
        let source = source.as_str();
        let starts = &instance.starts;
        let plan = match &manifest.output.written {
            Written::As(Format::CcbsLog) => {
                let places = CcbsPlaces::Roadmap(&self.scaled);
                self.visits(source, &read_ccbs_log(source, answer, places)?, starts)?
            }
            Written::As(Format::PsippPlan) => {
                self.visits(source, &read_psipp_plan(source, answer)?, starts)?
            }
            Written::As(Format::Trajectories) => {
                self.visits(source, &read_trajectories(source, answer)?.plan, starts)?
            }
            _ => read_roadmap_plan(source, answer)?.plan,
        };
        let units_per_s = self.units_per_s();
        let visits = plan.paths().map(|path| {
            let path = path.iter();
            path.map(|visit| Visit {
                vertex: visit.vertex,
                arrival_s: visit.arrival_s / units_per_s,
                departure_s: visit.departure_s / units_per_s,
            })
        });
        Ok(Plan::Visits(visits.collect()))
    }

    fn places(&self) -> u64 {
        self.scaled.vertices() as u64
    }

    fn fact(&self) -> Option<String> {
        let Self {
            units_per_m,
            radius_m,
            ..
        } = self;
        let units_per_s = self.units_per_s();
        let scaled = (units_per_m - 1.0).abs() > 0.0 || (units_per_s - 1.0).abs() > 0.0;
        scaled.then(|| {
            format!(
                "coordinates are multiplied by {units_per_m}, so that the radius of {radius_m} m is {}; times \
                 are divided by {units_per_s}",
                radius_m * units_per_m
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_that_take_another_time_are_found() {
        let edges = [vec![1], vec![0, 2], vec![]].into_iter().collect();
        let straight =
            RoadmapEnvironment::straight(vec![0.0, 3.0, 3.0], vec![0.0, 0.0, 4.0], edges, 0.7, 0.5);
        assert_eq!(uneven(&straight), None);
        let mut slow = straight.clone();
        slow.duration_s[2] *= 1.001;
        assert_eq!(uneven(&slow), Some(2));
        let mut bent = straight;
        bent.length_m[1] = f64::NAN;
        assert_eq!(uneven(&bent), Some(1));
    }
}

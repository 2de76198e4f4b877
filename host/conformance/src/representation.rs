//! Representations of scenes: as cells, as roadmaps and in the plane.

use fleetyard_abi::{Capability, Motion};

use crate::question::Question;
use crate::scene::Scene;
use crate::scene::roadmap::RoadmapScene;
use crate::scene::workspace::WorkspaceScene;

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

#[cfg(test)]
mod tests {
    use fleetyard_abi::{GridPlan, Knot, KnotPlan, Plan, Visit, VisitPlan};

    use super::*;
    use crate::rules::{Arrival, Rules};

    const STAY: Rules = Rules {
        arrival: Arrival::Stay,
        delay: 0,
        may_collide: false,
    };

    /// The same plan in each representation, a step a second.
    fn shown(scene: &Scene, plan: &GridPlan) -> Vec<Result<f64, String>> {
        let visits: VisitPlan = plan
            .paths()
            .map(|path| {
                let visit = |(time, vertex): (u32, &u32)| Visit {
                    vertex: *vertex,
                    arrival_s: time.into(),
                    departure_s: time.into(),
                };
                (0..).zip(path).map(visit).collect::<Vec<_>>()
            })
            .collect();
        let cols = scene.grid.cols();
        let top = f64::from(scene.grid.rows()) - 0.5;
        let knots: KnotPlan = plan
            .paths()
            .map(|path| {
                let knot = |(time, cell): (u32, &u32)| Knot {
                    time_s: time.into(),
                    x_m: f64::from(cell % cols) + 0.5,
                    y_m: top - f64::from(cell / cols),
                    heading_rad: f64::NAN,
                };
                (0..).zip(path).map(knot).collect::<Vec<_>>()
            })
            .collect();
        [
            (Representation::Grid, plan.clone().into()),
            (Representation::Roadmap(Motion::StopGo), visits.into()),
            (Representation::Plane, knots.into()),
        ]
        .map(|(representation, plan): (_, Plan)| representation.of(scene).judge(&plan, STAY))
        .to_vec()
    }

    fn drawn(starts: &[&str], goals: &[&str]) -> Scene {
        Scene::drawn("drawn", starts, goals).unwrap_or_else(|_| panic!("a scene"))
    }

    #[test]
    fn a_plan_of_one_representation_is_one_of_each() {
        let cycle = drawn(&["ab", "cd"], &["ca", "db"]);
        let round = GridPlan::from_paths([[0, 1], [1, 3], [2, 0], [3, 2]]);
        assert_eq!(shown(&cycle, &round), [Ok(4.0), Ok(4.0), Ok(4.0)]);
        let corner = drawn(&["ab@", "@.."], &[".a@", "@.b"]);
        let along = GridPlan::from_paths([vec![0, 0, 1], vec![1, 4, 5]]);
        assert_eq!(shown(&corner, &along), [Ok(4.0), Ok(4.0), Ok(4.0)]);
    }

    #[test]
    fn none_of_one_is_none_of_each() {
        let pair = drawn(&["ab."], &[".ba"]);
        for (paths, reason) in [
            ([vec![0, 1, 2], vec![1]], "agents 0 and 1"),
            ([vec![0], vec![1]], "agent 0"),
            ([vec![2], vec![1]], "agent 0"),
        ] {
            let judged = shown(&pair, &GridPlan::from_paths(&paths));
            for verdict in &judged[1..] {
                let found = verdict.as_ref().unwrap_err();
                assert!(found.contains(reason), "{found}");
            }
            assert!(judged[0].is_err(), "{judged:?}");
        }
    }

    #[test]
    fn a_plan_of_another_form_is_none() {
        let scene = drawn(&["a."], &[".a"]);
        let plan = GridPlan::from_paths([[0, 1]]).into();
        let judged = Representation::Plane.of(&scene).judge(&plan, STAY);
        assert_eq!(
            judged,
            Err("it is a plan of `paths`, but the map asks for `trajectories`".into())
        );
    }

    #[test]
    fn arrows_forbid_the_other_ways_on_roads_too() {
        let street = drawn(&["a."], &[".a"]);
        let street = street.one_way(&["v<"]).unwrap_or_else(|_| panic!("a map"));
        let against = GridPlan::from_paths([[0, 1]]);
        let judged = shown(&street, &against);
        assert!(judged[0].is_err() && judged[1].is_err(), "{judged:?}");
    }
}

//! Tasks on roadmaps that are given: nothing is changed, and what does not fit is refused.

use fleetyard_core::Roadmap;
use fleetyard_views::{Problem, given_roadmap};

use crate::tasks::problem_in;

const PILLAR: &str = r#"{"rectangle": {"center": [2, 2], "size": [0.4, 0.4]}}"#;

fn problem(start: [f64; 2], goal: [f64; 2]) -> Problem {
    problem_in(
        PILLAR,
        &format!(r#"{{"start": {start:?}, "goal": {goal:?}}}"#),
    )
    .unwrap()
}

/// A square round the pillar, of which one side is driven one way.
fn square(more: &[(u32, u32)]) -> Roadmap {
    let both = [(0, 1), (1, 0), (1, 2), (2, 1), (2, 3), (3, 2), (3, 0)];
    let at = [1.0, 3.0, 3.0, 1.0];
    let edges = both.into_iter().chain(more.iter().copied());
    Roadmap::new(at.to_vec(), vec![1.0, 1.0, 3.0, 3.0], edges).unwrap()
}

#[test]
fn a_roadmap_is_taken_as_it_is() {
    let problem = problem([1.0, 1.0], [1.000_000_4, 3.0]);
    let view = given_roadmap(&problem, square(&[]), None).unwrap();
    assert_eq!(view.roadmap, square(&[]));
    assert_eq!((view.starts[0], view.goals[0]), (0, 3));
    assert_eq!((view.radius_m, view.speed_m_per_s), (0.25, 1.0));
    assert_eq!((view.report.vertices, view.report.edges), (4, 4));
    let about = view.about();
    assert_eq!(about["origin"]["operator"], "task-on-roadmap");
    let slow = given_roadmap(&problem, square(&[]), Some(0.5)).unwrap();
    assert_eq!(about["speed_m_per_s"], 1.0);
    assert_eq!(slow.about()["speed_m_per_s"], 0.5);
    assert_ne!(slow.digest(), view.digest());
}

#[test]
fn what_does_not_fit_is_refused() {
    let corner = problem([1.0, 1.0], [3.0, 3.0]);
    let one_way = Roadmap::new(vec![1.0, 3.0], vec![1.0, 1.0], [(1, 0)]).unwrap();
    let cases = [
        (
            given_roadmap(&corner, square(&[(0, 2)]), None),
            "1 edges of the roadmap are not free for discs of 0.25 m, the first from vertex 0 to 2",
        ),
        (
            given_roadmap(&problem([1.1, 1.0], [3.0, 3.0]), square(&[]), None),
            "the start of agent 0 is 0.100 m from the nearest vertex",
        ),
        (
            given_roadmap(&problem([1.0, 1.0], [3.0, 1.0]), one_way, None),
            "agent 0 cannot reach its goal: no edges lead from vertex 0 to vertex 1",
        ),
        (
            given_roadmap(&corner, square(&[]), Some(0.0)),
            "robots on a roadmap need a speed, not 0 m/s",
        ),
    ];
    for (found, reason) in cases {
        let error = found.unwrap_err();
        assert!(error.reason.starts_with(reason), "{error}");
        assert!(error.hint.is_some(), "{error}");
    }
}

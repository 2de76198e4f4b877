//! View files: what they say derives the same view again, from the same task alone.

use fleetyard_core::{Connectivity, Separation};
use fleetyard_views::{
    Builder, GridSpec, RoadmapSpec, Sampling, View, ViewSpec, load_problem, read_view,
};

use crate::tasks::{TASKS, maps};

fn specs() -> Vec<ViewSpec> {
    let sampling = Sampling::Halton;
    let grids = [Connectivity::Four, Connectivity::Eight].map(|connectivity| {
        ViewSpec::Grid(GridSpec {
            connectivity,
            separation: Separation::Strict,
        })
    });
    let builders = [
        Builder::Prm {
            sampling: Sampling::Uniform,
            vertices: 300,
            neighbors: 9,
        },
        Builder::PrmStar {
            sampling,
            vertices: 300,
        },
        Builder::Delaunay {
            sampling,
            vertices: 300,
        },
        Builder::Lattice {
            side_m: 0.3,
            directions: 16,
        },
        Builder::Tangent { sides: 7 },
    ];
    let roadmaps = builders.map(|builder| {
        ViewSpec::Roadmap(RoadmapSpec {
            spacing_m: Some(0.1),
            seed: Some(3),
            ..RoadmapSpec::new(builder)
        })
    });
    grids.into_iter().chain(roadmaps).collect()
}

fn written(view: &View) -> Vec<u8> {
    let about = match view {
        View::Grid(view) => view.about(),
        View::Roadmap(view) => view.about(),
        View::Continuous => panic!("it has no file"),
    };
    serde_json::to_vec_pretty(&about).unwrap()
}

#[test]
fn a_view_is_derived_again_from_its_file() {
    let window = load_problem(maps("window.task.json")).unwrap();
    let rooms = load_problem(maps("two-rooms.task.json")).unwrap();
    for spec in specs() {
        let view = spec.derive(&window).unwrap();
        let file = read_view("v", &written(&view)).unwrap();
        let again = file.derive(&window).unwrap();
        assert_eq!(again.digest(&window), view.digest(&window), "{spec:?}");
        assert_eq!(written(&again), written(&view), "{spec:?}");
        let other = file.derive(&rooms).unwrap_err();
        assert!(
            other.reason.starts_with("the view is of problem "),
            "{other}"
        );
        assert!(other.hint.unwrap().contains("make it again with"));
    }
    for name in TASKS {
        let problem = load_problem(maps(name)).unwrap();
        let view = ViewSpec::Continuous.derive(&problem).unwrap();
        assert_eq!(view.digest(&problem), problem.digest());
    }
}

#[test]
fn what_is_wrong_with_a_view_file_has_its_place() {
    let window = load_problem(maps("window.task.json")).unwrap();
    let view = specs()[0].derive(&window).unwrap();
    let text = String::from_utf8(written(&view)).unwrap();
    let refused = |from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        let file = read_view("v", text.replace(from, to).as_bytes());
        file.and_then(|file| file.derive(&window))
            .unwrap_err()
            .to_string()
    };
    for (from, to, told) in [
        (
            "fleetyard.view/1",
            "fleetyard.view/2",
            "format is \"fleetyard.view/2\"",
        ),
        (
            "\"representation\": \"grid\"",
            "\"representation\": \"hexagons\"",
            "unknown variant `hexagons`",
        ),
        (
            "\"representation\": \"grid\"",
            "\"representation\": \"continuous\"",
            "is the task itself",
        ),
        (
            "world-to-grid",
            "roadmap-to-grid",
            "the operator \"roadmap-to-grid\" does not derive its view from a task alone",
        ),
        (
            "\"neighbors\": 4",
            "\"neighbors\": 6",
            "a cell with 6 neighbours",
        ),
        (
            "\"separation\"",
            "\"distance\"",
            "missing field `separation`",
        ),
        // What was derived is not believed.
        (
            "\"separation\": \"strict\"",
            "\"separation\": \"rules\"",
            "the view is of grid ",
        ),
    ] {
        let error = refused(from, to);
        assert!(error.contains(told), "{error}");
    }
}

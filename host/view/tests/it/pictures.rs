//! Still pictures: what they say, to the byte, and that PNG shows the same.
//!
//! When a picture changes on purpose, run with `FLEETYARD_UPDATE_EXPECTED=1`, look
//! at the files in `expected/`, and commit them.

use std::path::Path;
use std::{env, fs};

use fleetyard_core::{Annotation, AnnotationFile, Grid, GridPlan, Roadmap, TrajectoryPlan};
use fleetyard_sim::trace::{Entry, Goal, Happening};
use fleetyard_sim::{Live, SimConfig, TraceReader, TraceSink as _, TraceWriter};
use fleetyard_view::{Body, FleetPicture, Layers, Outline, Picture, Still, World, difference, png};
use fleetyard_world::{Boundary, Bounds, Polygon, Workspace};
use resvg::tiny_skia::Pixmap;
use xxhash_rust::xxh3::xxh3_128;

fn expect(name: &str, found: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/it/expected")
        .join(name);
    if env::var_os("FLEETYARD_UPDATE_EXPECTED").is_some() {
        fs::write(&path, found).unwrap();
    }
    let expected = fs::read_to_string(&path).unwrap_or_default();
    assert_eq!(found, expected, "{name} is not as expected");
}

fn grid() -> Grid {
    let rows = ["....@", ".@@..", "....."];
    Grid::new("<small & odd>", 3, 5, rows.concat().into_bytes()).unwrap()
}

fn plan() -> GridPlan {
    GridPlan::from_paths([
        vec![0, 1, 2, 3, 8, 9],
        vec![14, 13, 12, 11, 11, 10, 5],
        vec![4],
        vec![],
    ])
}

#[test]
fn a_plan_on_a_grid() {
    let grid = grid();
    let world = World::of_grid(&grid, 1.0);
    let picture = Picture::new(&world).plan(&grid, &plan());
    expect("grid.svg", &picture.svg());
    // Other goals than the paths' ends, one of them off the map.
    let goals = picture.goals(&grid, &[9, 0, 99, 3]).svg();
    assert_eq!(goals.matches("<rect x=").count(), 3);
}

#[test]
fn layers_of_a_planner_with_their_legend() {
    let grid = grid();
    let world = World::of_grid(&grid, 1.0);
    let moment = |annotation: Annotation, from_s, to_s| Annotation {
        from_s,
        to_s: Some(to_s),
        ..annotation
    };
    let mut places = Annotation::places("constraints", [vec![0], vec![2, 3]]);
    places.xy_m = [vec![[0.5, 2.5]], vec![[2.5, 2.5], [3.5, 2.5]]]
        .into_iter()
        .collect();
    places.agent = Some(1);
    places.text = "not <here>".to_owned();
    let annotations = vec![
        moment(places, 1.0, 2.0),
        Annotation {
            values: vec![0.0, 1.0],
            ..Annotation::points("Cost so far", [[0.5, 0.5], [4.5, 0.5]])
        },
        Annotation::rings(
            "corridor",
            [[[1.0, 0.0], [4.0, 0.0], [4.0, 1.0], [1.0, 1.0]]],
        ),
    ];
    let file = AnnotationFile {
        source: String::new(),
        planner: None,
        plan_digest: None,
        agents: 4,
        left_out: 0,
        annotations,
    };
    let layers = Layers::of(&file);
    let picture = |layers| {
        Picture::new(&world)
            .plan(&grid, &plan())
            .layers(layers)
            .svg()
    };
    expect("layers.svg", &picture(layers.clone()));
    assert!(picture(layers.clone().at(1.5)).contains(">1 constraints<"));
    assert!(picture(layers.at(2.5)).contains(">0 constraints<"));
}

#[test]
fn a_moment_in_a_workspace() {
    let ring = [[4.0, 1.0], [6.0, 1.0], [5.0, 3.0]];
    let workspace = Workspace {
        name: "room".to_owned(),
        bounds: Bounds {
            min: [-2.0, -1.0],
            max: [8.0, 5.0],
        },
        boundary: None,
        obstacles: vec![Polygon::new(&ring).unwrap()],
        movers: Vec::new(),
    };
    let roadmap = Roadmap::new(
        vec![0.0, 3.0, 3.0],
        vec![0.0, 0.0, 4.0],
        [(0, 1), (1, 0), (1, 2)],
    )
    .unwrap();
    let world = World::of_workspace(&workspace).roadmap(&roadmap);
    assert_eq!(world.roadmap.len(), 2);
    let mut picture = Picture::new(&world);
    picture.paths = vec![vec![[0.0, 0.0], [1.5, 0.0], [3.0, 0.0], [3.0, 4.0]]];
    picture.bodies = vec![
        Body {
            at_m: [3.0, 2.0],
            heading_rad: Some(1.5),
            outline: Outline::Polygon {
                vertices_m: vec![[0.4, 0.25], [-0.4, 0.25], [-0.4, -0.25], [0.4, -0.25]],
            },
        },
        Body {
            at_m: [3.2, 2.4],
            heading_rad: None,
            outline: Outline::Disc { radius_m: 0.3 },
        },
    ];
    picture.contacts = vec![[3.1, 2.2]];
    picture.time_s = Some(6.0);
    expect("moment.svg", &picture.svg());
}

/// The area beyond the edge is dark like obstacles, and lines of the roadmap are on the ground.
#[test]
fn the_edge_of_a_world_is_drawn() {
    let corners = [
        [0.0, 0.0],
        [4.0, 0.0],
        [4.0, 1.0],
        [1.0, 1.0],
        [1.0, 3.0],
        [0.0, 3.0],
    ];
    let boundary = Boundary::new(&corners).unwrap();
    let workspace = Workspace {
        name: "corner".to_owned(),
        bounds: boundary.polygon().bounds(),
        boundary: Some(boundary),
        obstacles: Vec::new(),
        movers: Vec::new(),
    };
    let world = World::of_workspace(&workspace);
    let svg = Picture::new(&world).svg();
    assert!(
        svg.contains("fill-rule=\"evenodd\" d=\"M0 0H4V3H0zM0 3H4V2H1V0H0z\""),
        "{svg}"
    );
    let pixels = Pixmap::decode_png(&png(&svg, Some(400)).unwrap()).unwrap();
    let red = |x, y| pixels.pixel(x, y).unwrap().red();
    assert!(red(300, 50) < 100 && red(50, 50) > 200 && red(300, 250) > 200);
}

#[test]
fn trajectories_are_drawn_like_paths() {
    let grid = grid();
    let world = World::of_grid(&grid, 1.0);
    let by_cells = Picture::new(&world).plan(&grid, &GridPlan::from_paths([[0, 1, 2]]));
    let mut plan = TrajectoryPlan::with_capacity(1, 2);
    let knot = |time_s, x_m| fleetyard_core::Knot {
        time_s,
        x_m,
        y_m: 2.5,
        heading_rad: None,
    };
    plan.push_path([knot(0.0, 0.5), knot(2.0, 2.5)]).unwrap();
    assert_eq!(
        by_cells.svg(),
        Picture::new(&world).trajectories(&plan).svg()
    );
}

#[test]
fn png_has_the_pixels_that_it_had() {
    let grid = grid();
    let world = World::of_grid(&grid, 1.0);
    let svg = Picture::new(&world).plan(&grid, &plan()).svg();
    let image = png(&svg, Some(200)).unwrap();
    assert!(image.starts_with(b"\x89PNG\r\n\x1a\n"));
    let side = |at: usize| u32::from_be_bytes(image[at..at + 4].try_into().unwrap());
    assert_eq!((side(16), side(20)), (200, 127));
    let pixels = Pixmap::decode_png(&image).unwrap();
    assert_eq!(
        format!("{:032x}", xxh3_128(pixels.data())),
        "f364c531ff810d955b34184952e9b76b",
        "the picture has changed"
    );
    let full = png(&svg, None).unwrap();
    assert_eq!(u32::from_be_bytes(full[16..20].try_into().unwrap()), 960);
}

#[test]
fn pictures_are_compared_pixel_by_pixel() {
    let grid = grid();
    let world = World::of_grid(&grid, 1.0);
    let picture = |plan: &GridPlan, width| {
        let svg = Picture::new(&world).plan(&grid, plan).svg();
        png(&svg, Some(width)).unwrap()
    };
    let (one, other) = (
        picture(&plan(), 100),
        picture(&GridPlan::from_paths([[0, 1, 2]]), 100),
    );
    let same = difference(&one, &one).unwrap();
    assert_eq!((same.pixels, same.of), (0, 100 * 64));
    let found = difference(&one, &other).unwrap();
    assert!(
        found.pixels > 100 && found.pixels < found.of,
        "{}",
        found.pixels
    );
    let marked = Pixmap::decode_png(&found.png).unwrap();
    let mark = [0xd5, 0x5e, 0x00, 0xff];
    let marks = marked.data().chunks_exact(4).filter(|pixel| *pixel == mark);
    assert_eq!(marks.count() as u64, found.pixels);
    let wider = difference(&one, &picture(&plan(), 120)).unwrap_err();
    assert!(wider.reason.contains("100 x 64"), "{}", wider.reason);
    assert!(difference(&one, b"no picture").is_err());
}

#[test]
fn what_cannot_be_drawn_is_refused() {
    assert!(
        png("no svg", None)
            .unwrap_err()
            .reason
            .contains("cannot be drawn")
    );
    let svg = Picture::new(&World::of_grid(&grid(), 1.0)).svg();
    let error = png(&svg, Some(100_000)).unwrap_err();
    assert_eq!(
        error.reason,
        "a picture of 100000 x 63542 pixels is too large"
    );
    assert!(png(&svg, Some(0)).is_ok_and(|image| image.len() > 50));
}

#[test]
fn thousands_of_agents_stay_a_moderate_file() {
    let side = 500;
    let grid = Grid::new("wide", side, side, vec![b'.'; (side * side) as usize]).unwrap();
    let world = World::of_grid(&grid, 1.0);
    let paths = (0..5000u32).map(|agent| {
        let start = agent * 7 % 400 + agent / 10 % 400 * side;
        let across = (0..50).map(move |step| start + step);
        across.chain((1..50).map(move |step| start + 49 + step * side))
    });
    let mut plan = GridPlan::with_capacity(5000, 500_000);
    paths.for_each(|path| plan.push_path(path));
    let svg = Picture::new(&world).plan(&grid, &plan).svg();
    assert!(svg.len() < 1_200_000, "{}", svg.len());
}

#[test]
fn a_run_of_a_fleet() {
    let grid = grid();
    let mut waiting_s = [0.0; 15];
    for (cell, waited) in [
        (0, 40.0),
        (1, 10.0),
        (2, 0.1),
        (3, 2.5),
        (4, 99.0),
        (14, 2.5),
    ] {
        waiting_s[cell] = waited;
    }
    let picture = FleetPicture {
        title: "<a run>".to_owned(),
        grid: &grid,
        waiting_s: &waiting_s[..],
        goals: vec![[0.0, 0.0], [10.0, 5.0], [20.0, 5.0], [30.0, 25.0]],
        recoveries: vec![[0.0, 0.0], [10.0, 1.0], [20.0, 1.0], [30.0, 4.0]],
    };
    let svg = picture.svg();
    expect("fleet.svg", &svg);
    // Obstacles keep their colour whatever is said of them, and so does the free cell where
    // nobody waited.
    assert!(svg.contains("&lt;a run&gt;"));
    assert!(svg.contains("mean: 0.8333 goals per second"));
    assert!(Pixmap::decode_png(&png(&svg, None).unwrap()).is_ok());
    // Nothing to show is shown as nothing.
    let empty = FleetPicture {
        waiting_s: &[],
        goals: Vec::new(),
        recoveries: Vec::new(),
        ..picture.clone()
    };
    png(&empty.svg(), Some(200)).unwrap();
    let broken = FleetPicture {
        waiting_s: &[f64::NAN, f64::INFINITY, -1.0],
        goals: vec![[0.0, 0.0], [f64::NAN, 3.0]],
        ..picture
    };
    assert!(!broken.svg().contains("NaN"));
}

#[test]
fn a_moment_of_a_fleet_has_the_goals_of_then() {
    let grid = Grid::new("yard", 2, 3, b"......".to_vec()).unwrap();
    let config = SimConfig::default();
    let mut live = Live::new(&config, &grid, None, &[(0, 0.0), (3, 0.0)]).unwrap();
    let mut writer = TraceWriter::new(Vec::new(), 1);
    live.begin(&mut writer).unwrap();
    let has_goal = |tick, agent, cell| Entry {
        tick,
        what: Happening::Goal(Goal {
            agent,
            number: 0,
            cell,
            errand: None,
        }),
    };
    writer.journal(&[has_goal(0, 0, 2)]).unwrap();
    for _ in 0..20 {
        live.advance(&mut writer).unwrap();
        if live.tick() == 60 {
            writer.journal(&[has_goal(60, 1, 5)]).unwrap();
        }
    }
    live.finish(&mut writer).unwrap();
    let trace = writer.into_inner();
    let squares = |at_s| {
        let reader = TraceReader::open(&trace[..], "t").unwrap();
        let header = reader.header().clone();
        let mut still = Still::new(&header, Some(at_s));
        reader.replay(&mut still).unwrap();
        let world = World::of_trace("yard", &header);
        let picture = still.picture(&world);
        picture.goals
    };
    assert_eq!(squares(0.5), [Some([2.5, 1.5]), None]);
    assert_eq!(squares(1.5), [Some([2.5, 1.5]), Some([2.5, 0.5])]);
}

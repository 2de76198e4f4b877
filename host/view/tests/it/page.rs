//! The replay page: that it is one file that needs no other, and, in a real browser,
//! that everything on it works.

use std::f64::consts::PI;
use std::fs;

use fleetyard_core::{Annotation, AnnotationFile, Grid};
use fleetyard_sim::trace::{By, Entry, Errand, Goal, Happening, Remark, States};
use fleetyard_sim::{Event, EventKind, Other, TraceSink as _};
use fleetyard_testkit::browser::{chromium, selftest, with_user};
use fleetyard_view::{Cells, Layers, Outline, Page, PageOptions, Recording, World};

const HOSTILE: &str = "<b>&\"'</script><script>globalThis.hacked = 1</script><!--";

fn states<'a>(x_m: &'a [f64], y_m: &'a [f64], heading_rad: Option<&'a [f64]>) -> States<'a> {
    States {
        x_m,
        y_m,
        heading_rad,
        progress: None,
    }
}

/// Agent 0 may not be somewhere from 2 s to 4 s, and a tree that is there all the time.
fn layers() -> Layers {
    let tree = [[[1.5, 1.5], [4.5, 2.5]], [[4.5, 2.5], [8.5, 1.5]]];
    let annotations = vec![
        Annotation {
            agent: Some(0),
            from_s: 2.0,
            to_s: Some(4.0),
            text: HOSTILE.to_owned(),
            ..Annotation::points(HOSTILE, [[5.5, 2.5]])
        },
        Annotation {
            values: vec![1.0, 3.0],
            text: "the tree".to_owned(),
            ..Annotation::lines("tree", tree)
        },
        Annotation {
            agent: Some(1),
            from_s: 5.0,
            ..Annotation::rings("tree", [[[1.0, 1.0], [2.0, 1.0], [2.0, 2.0]]])
        },
    ];
    Layers::of(&AnnotationFile {
        source: String::new(),
        planner: None,
        plan_digest: None,
        agents: 4,
        left_out: 3,
        annotations,
    })
}

/// Four agents for 10 s: 0 goes along a row, 1 turns on the spot, 2 stands by the
/// way of 0, 3 waits and then moves; one obstacle goes to and fro.
fn page(options: &PageOptions) -> String {
    let rows = [
        "@@@@@@@@@@@@@",
        "@...........@",
        "@...........@",
        "@...@@......@",
        "@@@@@@@@@@@@@",
    ];
    let grid = Grid::new(HOSTILE, 5, 13, rows.concat().into_bytes()).unwrap();
    let world = World::of_grid(&grid, 1.0);
    let recording = Recording {
        title: HOSTILE.to_owned(),
        world: world.clone(),
        columns: 13,
        endpoints: None,
        workstations: None,
        outlines: vec![
            Outline::Disc { radius_m: 0.35 },
            Outline::Polygon {
                vertices_m: vec![[0.4, 0.0], [-0.3, 0.3], [-0.3, -0.3]],
            },
        ],
        outline_of_body: vec![0, 1, 0, 1, 1],
        agents: 4,
        cars: Vec::new(),
        goals_m: vec![[11.5, 2.5], [2.5, 1.5], [6.5, 2.0], [9.5, 2.5]],
        headings: true,
        tick_s: 1.0 / 60.0,
        state_every: 1,
        facts: vec![("planner".to_owned(), HOSTILE.to_owned())],
    };
    let mut page = Page::new(recording, options).unwrap().layers(layers());
    for tick in 0..=600u32 {
        let time = f64::from(tick) / 60.0;
        let x = [1.5 + time, 2.5, 6.5, 9.5, 3.0 + (time - 5.0).abs()];
        let y = [2.5, 1.5, 2.0, 3.5 - (time - 8.0).max(0.0) * 0.5, 3.5];
        // Wrapped, as some write them.
        let turned = (time * 0.5 * PI + PI).rem_euclid(2.0 * PI) - PI;
        let heading = [0.0, turned, 1.0, -0.5 * PI, 0.0];
        page.state(tick.into(), &states(&x, &y, Some(&heading)))
            .unwrap();
    }
    let event = |time_s: f64, kind, agent, other| Event {
        substep: 0,
        time_s,
        kind,
        agent,
        other,
    };
    let events = [
        event(4.75, EventKind::Begin, 0, Other::Agent(2)),
        event(5.25, EventKind::End, 0, Other::Agent(2)),
        event(10.0, EventKind::Begin, 0, Other::Obstacle { cell: 38 }),
        event(8.0, EventKind::Arrive, 2, Other::Goal),
    ];
    page.events(&events).unwrap();
    page.finish(None).unwrap()
}

/// Two discs on a map, ten ticks a second.
fn two_discs(title: &str, grid: &Grid) -> Recording {
    Recording {
        title: title.to_owned(),
        world: World::of_grid(grid, 1.0),
        columns: grid.cols(),
        endpoints: None,
        workstations: None,
        outlines: vec![Outline::Disc { radius_m: 0.3 }],
        outline_of_body: vec![0, 0],
        agents: 2,
        cars: Vec::new(),
        goals_m: Vec::new(),
        headings: false,
        tick_s: 0.1,
        state_every: 1,
        facts: Vec::new(),
    }
}

/// Two robots of a fleet for 10 s: 0 reaches a goal and goes on to the next one of its
/// task, 1 has no goal before 4 s. The third call is left to the fail policy.
fn fleet_page(options: &PageOptions) -> String {
    let rows = ["e...w", "....."];
    let grid = Grid::new("yard", 2, 5, rows.concat().into_bytes()).unwrap();
    let recording = Recording {
        endpoints: Some(Cells::of_runs(2, 1.0, [(0, 0, 1)])),
        workstations: Some(Cells::of_runs(2, 1.0, [(0, 4, 1)])),
        ..two_discs("fleet", &grid)
    };
    let mut page = Page::new(recording, options).unwrap();
    let at = |tick, what| Entry { tick, what };
    let goal = |agent, number, cell, errand| {
        Happening::Goal(Goal {
            agent,
            number,
            cell,
            errand,
        })
    };
    let errand = |at| {
        Some(Errand {
            task: 17,
            at,
            of: 2,
        })
    };
    let asked = |call| Happening::Asked { call };
    let answered = |call, by| Happening::Answered { call, by };
    page.journal(&[
        at(0, goal(0, 0, 4, errand(0))),
        at(0, asked(0)),
        at(10, answered(0, By::Planner)),
        at(30, asked(1)),
        at(40, answered(1, By::Planner)),
        at(40, goal(1, 0, 5, None)),
        at(
            50,
            Happening::Reached {
                agent: 0,
                number: 0,
            },
        ),
        at(50, goal(0, 1, 0, errand(1))),
        at(60, asked(2)),
        at(70, answered(2, By::FailPolicy)),
        at(
            70,
            Happening::Notice {
                number: 0,
                call: 2,
                name: "planner-fault".to_owned(),
                module: HOSTILE.to_owned(),
            },
        ),
        at(90, asked(3)),
    ])
    .unwrap();
    let took = |call, planner_ms, fail_policy_ms| Remark::Took {
        call,
        planner_ms: Some(planner_ms),
        fail_policy_ms,
    };
    page.remarks(&[
        took(0, 12.3456, None),
        took(1, 13.0, None),
        took(2, 1000.0, Some(2.5)),
        Remark::Said {
            number: 0,
            message: HOSTILE.to_owned(),
        },
    ])
    .unwrap();
    for tick in 0..=100u32 {
        let time = f64::from(tick) / 10.0;
        let x = [0.5 + 4.0 * (1.0 - (time - 5.0).abs() / 5.0), 2.5];
        page.state(tick.into(), &states(&x, &[1.5, 0.5], None))
            .unwrap();
    }
    page.finish(None).unwrap()
}

#[test]
fn a_page_of_some_robots_has_their_goals_and_the_throughput_of_all() {
    let page = fleet_page(&PageOptions {
        agents: Some(vec![1]),
        ..PageOptions::default()
    });
    assert!(page.contains("\"goals\":[[[40,null,5,0,null]]]"));
    assert!(page.contains("\"reached\":[50]"));
    assert!(!page.contains("globalThis.hacked = 1</script><!--\""));
}

/// A user finds so many things right on the page, on a screen and on a phone, and nothing wrong.
#[track_caller]
fn works(text: &str, user: &str, right: usize) {
    let Some(browser) = chromium() else {
        eprintln!("skipped: there is no Chromium on this machine");
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("page.html");
    fs::write(&file, with_user(text, user)).unwrap();
    // On the phone without WebGL, which is slow by the processor and has to be asked for.
    for (size, wish) in [("1280,800", "#renderer=webgl2"), ("390,844", "")] {
        let file = format!("{}{wish}", file.display());
        let report = selftest(browser, folder.path(), file.as_ref(), size);
        assert!(!report.contains("FAILED"), "{size}: {report}");
        assert!(report.ends_with("\"errors\":[]}"), "{size}: {report}");
        assert_eq!(report.matches("\"ok\"").count(), right, "{size}: {report}");
    }
}

#[test]
fn the_replay_of_a_fleet_shows_its_work_in_a_browser() {
    works(
        &fleet_page(&PageOptions::default()),
        include_str!("fleettest.js"),
        17,
    );
}

#[test]
fn a_page_is_one_file_and_equal_for_equal_input() {
    let text = page(&PageOptions::default());
    assert!(text.starts_with("<!doctype html>"));
    assert_eq!(text, page(&PageOptions::default()));
    for needle in ["http:", "https:", "src=", "href=", "@import", "url(", "{{"] {
        assert!(!text.contains(needle), "{needle}");
    }
    assert!(text.contains("default-src 'none'"));
    // No script runs but the page's own.
    assert!(text.contains("script-src 'sha256-") && !text.contains("script-src 'unsafe"));
    assert!(!text.contains("globalThis.hacked = 1</script><!--\""));
    assert_eq!(text.matches("<script").count(), 3);
    assert_eq!(text.matches("</script").count(), 3);
}

#[test]
fn fewer_agents_and_states_make_a_smaller_page_that_says_so() {
    let all = page(&PageOptions {
        rate_hz: 60.0,
        agents: None,
    });
    let some = page(&PageOptions {
        rate_hz: 5.0,
        agents: Some(vec![2, 0, 2]),
    });
    assert!(some.len() < all.len());
    assert!(all.contains("60 of 60 recorded states per second are kept."));
    assert!(some.contains("5 of 60 recorded states per second are kept."));
    assert!(some.contains("2 of 4 agents are shown"));
    assert!(some.contains("\"agents\":2,\"all_agents\":4,\"ids\":[0,2,4]"));
}

#[test]
fn what_cannot_be_shown_is_refused() {
    let grid = Grid::new("map", 1, 2, b"..".to_vec()).unwrap();
    let recording = || two_discs("map", &grid);
    let refused = |rate_hz, agents| {
        let options = PageOptions { rate_hz, agents };
        Page::new(recording(), &options).unwrap_err().to_string()
    };
    assert_eq!(
        refused(10.0, Some(vec![2])),
        "there is no agent 2: the trace has 2"
    );
    for rate in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(refused(rate, None).contains("states per second is out of range"));
    }
    let empty = Page::new(recording(), &PageOptions::default()).unwrap();
    let error = empty.finish(None).unwrap_err();
    assert_eq!(error.to_string(), "the trace has no states, only events");
    // No time passes, nobody moves, numbers that are none: a page nevertheless.
    let mut still = Page::new(recording(), &PageOptions::default()).unwrap();
    still
        .state(0, &states(&[f64::NAN, 0.5], &[0.5], None))
        .unwrap();
    let text = still.finish(Some("it was cut off")).unwrap();
    assert!(text.contains("The recording is not complete: it was cut off."));
}

#[test]
fn everything_on_the_page_works_in_a_browser() {
    works(
        &page(&PageOptions::default()),
        include_str!("selftest.js"),
        55,
    );
}

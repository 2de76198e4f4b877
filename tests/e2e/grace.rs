//! `scripts/grace-a`: representations of the same tasks beside each other, and the page about them.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use fleetyard_testkit::{Ended, SUCCESS, USAGE, Yard, have, root};
use serde_json::Value;

const FAMILIES: [&str; 4] = ["empty", "maze", "warehouse", "window"];
const VIEWS: [&str; 6] = ["grid", "grid-strict", "S", "D", "SD", "continuous"];
/// A planner of each representation, so that the test takes no longer for planners to come.
const PLANNERS: &str = "--planner lacam --planner roadmap-pp --planner plane-pp";

fn script(yard: &Yard, arguments: &str) -> Ended {
    let script = root().join("scripts/grace-a");
    yard.shell(&format!(
        "FLEETYARD=fleetyard python3 '{}' {arguments}",
        script.display()
    ))
}

fn text(yard: &Yard, name: &str) -> String {
    String::from_utf8(yard.read(name)).unwrap()
}

/// Rows by the names of their trials.
fn rows(folder: &Path) -> BTreeMap<String, Value> {
    let files = fs::read_dir(folder.join("trials")).unwrap();
    let row = |file: fs::DirEntry| {
        let trial: Value = serde_json::from_slice(&fs::read(file.path()).unwrap()).unwrap();
        let name = file.file_name().into_string().unwrap();
        (name, trial["row"].clone())
    };
    files.map(|file| row(file.unwrap())).collect()
}

#[test]
fn representations_are_compared_and_the_page_says_so() {
    if !have("python3") {
        return;
    }
    let yard = Yard::new();
    let quick =
        format!("--quick --seeds 1 --agents 2,8 {PLANNERS} --out out --page page/grace-a.md");
    script(&yard, &quick).expect(SUCCESS);
    let found = rows(&yard.path("out"));
    // Two team sizes.
    assert_eq!(found.len(), FAMILIES.len() * 2 * VIEWS.len());
    for view in VIEWS {
        for family in FAMILIES {
            let of = |row: &&Value| row["view"] == view && row["family"] == family;
            let of: Vec<&Value> = found.values().filter(of).collect();
            assert_eq!(of.len(), 2, "{view} {family}");
            for row in of {
                assert_eq!(row["valid"], 1, "{row:#}");
                // Only in cells of 2r robots come too near to each other.
                assert!(view == "grid" || row["valid_in_world"] == 1, "{row:#}");
                assert!(row["length_m"].as_f64() > Some(1.5), "{row:#}");
                assert_eq!(row["driven_arrived"], row["agents"], "{row:#}");
                // Nothing that was planned for a robot without inertia keeps limits of acceleration.
                assert!(view != "continuous" || row["keeps_limits"] == 0, "{row:#}");
            }
        }
    }
    let near = |view: &str| {
        let of = found.values().filter(|row| row["view"] == view);
        let near = of.filter_map(|row| row["followed_nearest_m"].as_f64());
        near.fold(f64::INFINITY, f64::min)
    };
    // Round a corner it is √2·r, where the grid's rules are kept.
    assert!(
        (near("grid") - 0.08 * 2_f64.sqrt()).abs() < 2e-3,
        "{}",
        near("grid")
    );
    assert!(near("grid-strict") > 0.16 - 1e-6, "{}", near("grid-strict"));

    let page = text(&yard, "page/grace-a.md");
    for told in [
        "grid of 2r",
        "grid of 2√2·r",
        "roadmap S",
        "roadmap D",
        "roadmap SD",
        "| plane | `plane-pp` | 8/8 | 100 | 100 | 100 | 100 | 100 | 100 |",
        "**No planner for the plane knows double integrators.**",
        "8 of 8 of its plans break the task's limits",
        "keep the rules of the grid and overlap in the world",
        "`lacam` with `anytime=false`",
        "| roadmap D: ways are at most 18 % longer than in the plane | undecided | ",
        "| view | planner | empty | maze | warehouse | window | even speed, m/s |",
    ] {
        assert!(page.contains(told), "no {told:?} in\n{page}");
    }
    let figure = text(&yard, "page/grace-a/figure.svg");
    assert!(figure.starts_with("<svg "));

    // What is done is not done again, and the page is made of its rows.
    script(&yard, &quick).expect(SUCCESS);
    assert_eq!(rows(&yard.path("out")), found);
    script(&yard, "page --page page/grace-a.md").expect(SUCCESS);
    assert_eq!(text(&yard, "page/grace-a.md"), page);
    assert_eq!(text(&yard, "page/grace-a/figure.svg"), figure);

    // Sizes of roadmaps are rows of their own, and a picture.
    let study = "study --planner roadmap-pp --seeds 1 --agents 2 --retry 0 --out study --page page/grace-a.md";
    script(&yard, study).expect(SUCCESS);
    let sizes = rows(&yard.path("study"));
    assert_eq!(sizes.len(), FAMILIES.len() * 7);
    // Many vertices leave no passage out, and ways round nothing.
    for family in FAMILIES {
        let of = |size: &str| &sizes[&format!("{family}-1-2-{size}-vertices-roadmap-pp.json")];
        let (few, many) = (of("40"), of("2560"));
        assert_eq!(many["valid"], 1, "{many:#}");
        let length = |row: &Value| row["length_m"].as_f64();
        assert!(few["valid"] == 0 || length(many) < length(few), "{few:#}");
    }
    assert!(text(&yard, "page/grace-a.md").contains("by `roadmap-pp`: geometric means"));
    assert!(text(&yard, "page/grace-a/study.svg").starts_with("<svg "));

    // A planner that knows the task's robots is what others are measured by.
    let kept = text(&yard, "page/grace-a/rows.csv").replace("plane-pp,single", "plane-pp,double");
    yard.write("page/grace-a/rows.csv", kept);
    script(&yard, "page --page page/grace-a.md").expect(SUCCESS);
    let exact = text(&yard, "page/grace-a.md");
    assert!(!exact.contains("No planner for the plane"), "{exact}");
    assert!(
        exact.contains("`plane-pp` plans for the same double integrators"),
        "{exact}"
    );
}

#[test]
fn what_the_comparison_cannot_do_is_said() {
    if !have("python3") {
        return;
    }
    let yard = Yard::new();
    let cases = [
        (
            "--planner nobody",
            "error: there is no planner nobody\nhint: ",
        ),
        ("--agents 9", "error: teams have 1 to 8 robots"),
        ("--seeds 0", "error: there is at least one seed"),
        ("page --page none.md", "error: there are no rows in "),
    ];
    for (arguments, told) in cases {
        let ended = script(&yard, &format!("{arguments} --out out")).expect(USAGE);
        assert!(ended.stderr.contains(told), "{ended}");
    }
}

/// Figures on the page are those of the rows beside it.
#[test]
fn the_page_about_grace_is_what_its_rows_say() {
    let results = root().join("docs/results");
    let kept = results.join("grace-a");
    if !have("python3") || !kept.exists() {
        return;
    }
    let yard = Yard::new();
    fs::create_dir(yard.path("grace-a")).unwrap();
    for file in ["rows.csv", "planners.csv", "study.csv"] {
        fs::copy(kept.join(file), yard.path("grace-a").join(file)).unwrap();
    }
    script(&yard, "page --page grace-a.md").expect(SUCCESS);
    for file in [
        "grace-a.md",
        "grace-a/figure.svg",
        "grace-a/study.svg",
        "grace-a/by-planner.csv",
    ] {
        let there = fs::read_to_string(results.join(file)).unwrap();
        assert!(
            text(&yard, file) == there,
            "{file} is not what its rows say: `scripts/grace-a page` makes it anew"
        );
    }
}

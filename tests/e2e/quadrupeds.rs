//! `scripts/quadrupeds`: teams of quadrupeds are planned for and driven, and the page says what happened.

use std::fs;

use fleetyard_testkit::{Ended, SUCCESS, USAGE, Yard, have, root};

fn script(yard: &Yard, arguments: &str) -> Ended {
    let script = root().join("scripts/quadrupeds");
    yard.shell(&format!(
        "FLEETYARD=fleetyard python3 '{}' {arguments}",
        script.display()
    ))
}

fn text(yard: &Yard, name: &str) -> String {
    String::from_utf8(yard.read(name)).unwrap()
}

#[test]
fn teams_are_planned_for_and_driven_without_contacts() {
    if !have("python3") {
        return;
    }
    let yard = Yard::new();
    let quick =
        "--quick --trials 1 --robots 3 --planner plane-pp --out out --page page/quadrupeds.md";
    script(&yard, quick).expect(SUCCESS);
    let page = text(&yard, "page/quadrupeds.md");
    for told in [
        "# Teams of quadrupeds",
        "| `plane-pp` | 3 | 1/1 | ",
        "| `plane-pp` | 3 | kinematic | 1/1 | 0 | 0 | 0 | ",
        "| `plane-pp` | 3 | kinematic, with errors | 1/1 | 0 | 0 | 0 | ",
        "| `plane-pp` | 3 | contact | 1/1 | 0 | 0 | 0 | ",
        "| `plane-pp` | 3 | contact, with errors | 1/1 | 0 | 0 | 0 | ",
        "**No planner has planned with the robots' own limits.**",
        "![Four quadrupeds on the floor, part of the way](quadrupeds/floor.svg)",
    ] {
        assert!(page.contains(told), "no {told:?} in\n{page}");
    }
    assert!(text(&yard, "page/quadrupeds/floor.svg").starts_with("<svg "));
    for tier in ["kinematic", "contact"] {
        let replay = text(&yard, &format!("out/floor-plane-pp-{tier}-noise.html"));
        assert!(replay.contains("<html"));
    }
    let rows = text(&yard, "page/quadrupeds/rows.csv");

    // What is done is not done again, and the page is made of its rows.
    script(&yard, quick).expect(SUCCESS);
    assert_eq!(text(&yard, "page/quadrupeds/rows.csv"), rows);
    script(&yard, "page --page page/quadrupeds.md").expect(SUCCESS);
    assert_eq!(text(&yard, "page/quadrupeds.md"), page);
}

#[test]
fn what_the_experiment_cannot_do_is_said() {
    if !have("python3") {
        return;
    }
    let yard = Yard::new();
    let cases = [
        (
            "--quick --planner nobody",
            "error: there is no planner nobody\nhint: ",
        ),
        (
            "--robots 99",
            "error: the floor has room for 1 to 20 robots",
        ),
        ("--trials 0", "error: there is at least one trial"),
        ("page --page none.md", "error: there are no rows in "),
    ];
    for (arguments, told) in cases {
        let ended = script(&yard, &format!("{arguments} --out out")).expect(USAGE);
        assert!(ended.stderr.contains(told), "{ended}");
    }
}

/// Figures on the page are those of the rows beside it.
#[test]
fn the_page_about_quadrupeds_is_what_its_rows_say() {
    let results = root().join("docs/results");
    let kept = results.join("quadrupeds");
    if !have("python3") || !kept.exists() {
        return;
    }
    let yard = Yard::new();
    for folder in ["docs/results/quadrupeds", "docs/images"] {
        fs::create_dir_all(yard.path(folder)).unwrap();
    }
    for file in ["rows.csv", "planners.csv", "calibration.csv"] {
        fs::copy(
            kept.join(file),
            yard.path("docs/results/quadrupeds").join(file),
        )
        .unwrap();
    }
    let shown = "docs/images/quadrupeds.svg";
    fs::copy(root().join(shown), yard.path(shown)).unwrap();
    script(&yard, "page --page docs/results/quadrupeds.md").expect(SUCCESS);
    let there = fs::read_to_string(results.join("quadrupeds.md")).unwrap();
    assert!(
        text(&yard, "docs/results/quadrupeds.md") == there,
        "the page is not what its rows say: `scripts/quadrupeds page` makes it anew"
    );
}

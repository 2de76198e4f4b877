//! Reports: that the page is one file that needs no other, that hostile names are text
//! wherever they stand, and, in a real browser, that everything on the page works and
//! says the same as the program does.

use std::fs;
use std::process::Command;

use crate::support::{Shape, rows};
use fleetyard_bench::report::{Marks, Report, Subject, Table, svg};
use fleetyard_bench::{Row, ScenarioPlace};
use fleetyard_testkit::browser::{chromium, selftest, with_user};
use serde_json::json;

const HOSTILE: &str =
    "<b>&\"'</script><script>globalThis.hacked = 1</script><!--|[x](y)\n\u{1b}[2J";

fn subject(title: &str) -> Subject {
    Subject {
        title: title.to_owned(),
        facts: vec![("store".to_owned(), "trials.sqlite".to_owned())],
        texts: vec![("Suite".to_owned(), "name = \"suite\"".to_owned())],
        ..Subject::default()
    }
}

/// The places of maps and scenarios, in folders whose names a shell would take apart.
fn places(rows: &[Row]) -> Vec<ScenarioPlace> {
    let place = |row: &Row| ScenarioPlace {
        map: row.map.clone(),
        scenario: row.scenario.clone(),
        map_file: format!("/far away/{}.map", row.map).into(),
        scenario_file: format!("/far away/{}", row.scenario).into(),
    };
    rows.iter().map(place).collect()
}

fn usual() -> Vec<Row> {
    let shape = Shape {
        repeats: 2,
        ..Shape::default()
    };
    rows(&shape, 7)
}

/// Rows whose every word is hostile.
fn hostile() -> Vec<Row> {
    let mut rows = usual();
    for row in &mut rows {
        for word in [
            &mut row.planner,
            &mut row.planner_id,
            &mut row.planner_version,
            &mut row.map,
            &mut row.scenario,
            &mut row.contended,
            &mut row.termination,
        ] {
            *word = format!("{HOSTILE}{word}{}", "long".repeat(40));
        }
        row.message = Some(HOSTILE.to_owned());
        row.options = format!("{{\"{}\":1}}", HOSTILE.replace(['"', '\n', '\u{1b}'], ""));
    }
    rows
}

fn mazes() -> Vec<Row> {
    let shape = Shape {
        maps: &["maze"],
        agents: &[1],
        scenarios: 20,
        failures: 0.0,
        anytime: false,
        ..Shape::default()
    };
    let mut rows = rows(&shape, 3);
    for row in &mut rows {
        row.maze_width = Some(15);
        row.maze_height = Some(15);
        row.maze_algorithm = Some("backtracker".to_owned());
        row.maze_seed = Some(row.trial / 4 + 7);
        row.seed = u64::MAX;
    }
    rows
}

fn failed() -> Vec<Row> {
    let mut rows = usual();
    for row in &mut rows {
        *row = Row {
            success: false,
            valid: false,
            soc_steps: None,
            first_solution_ms: None,
            expansions: None,
            suboptimality: None,
            path_length_cells: None,
            incumbents: Vec::new(),
            ..row.clone()
        };
    }
    rows
}

/// Suites that are unlike each other, and too little to say anything.
fn suites() -> Vec<(&'static str, Vec<Row>)> {
    vec![
        ("usual", usual()),
        ("hostile", hostile()),
        ("mazes", mazes()),
        ("failed", failed()),
        ("one", usual().into_iter().take(1).collect()),
        ("views", viewed()),
        ("none", Vec::new()),
    ]
}

/// Planners on views of two tasks of one file: too few for intervals.
fn viewed() -> Vec<Row> {
    let shape = Shape {
        planners: &["cells", "plane"],
        maps: &["rooms"],
        agents: &[1, 2],
        scenarios: 1,
        failures: 0.0,
        anytime: false,
        ..Shape::default()
    };
    let view = |row: Row| {
        let on_grid = row.planner == "cells";
        let representation = if on_grid { "grid" } else { "continuous" };
        Row {
            task_digest: Some(row.instance_digest.clone()),
            instance_digest: format!("{}{representation}", row.instance_digest),
            representation: Some(representation.into()),
            view: Some(representation.into()),
            view_parameters: Some(format!("{{\"representation\":\"{representation}\"}}")),
            connectivity: on_grid.then_some(4),
            map_rows: None,
            map_cols: None,
            lower_bound_steps: None,
            suboptimality: None,
            soc_s: row.soc_steps.map(|steps| steps as f64 / 2.0),
            soc_steps: row.soc_steps.filter(|_| on_grid),
            ..row
        }
    };
    rows(&shape, 9).into_iter().map(view).collect()
}

/// A planner on a view is one planner in all tables, and its task one instance.
#[test]
fn planners_on_views_meet_on_their_tasks() {
    let rows = viewed();
    let report = Report::new(subject("views"), &rows);
    assert_eq!(report.planners(), ["cells on grid", "plane on continuous"]);
    let tables = report.tables();
    assert_eq!(tables[0].title, "Views");
    let lines: Vec<_> = tables[0]
        .rows
        .iter()
        .map(|row| row[..3].join(" "))
        .collect();
    let expected = [
        "1 grid cells",
        "1 continuous plane",
        "2 grid cells",
        "2 continuous plane",
    ];
    assert_eq!(lines, expected);
    let numbers = report.json().unwrap();
    assert_eq!(numbers["overview"]["instances"], 2);
    assert_eq!(numbers["overview"]["shared"], 2);
    assert_eq!(numbers["costs"]["metric"], "soc_s");
    assert_eq!(numbers["views"].as_array().unwrap().len(), 4);
}

/// A winner was announced whose own test said p = 1.
#[test]
fn no_headline_says_more_than_its_test() {
    let rows = usual();
    let report = Report::new(subject("s"), &rows);
    let numbers = report.json().unwrap();
    let headline = numbers["headline"].as_str().unwrap();
    let lead = &numbers["lead"];
    let rivals = lead["rivals"].as_array().unwrap();
    let shown = rivals.iter().all(|rival| rival["behind"] == true);
    let story = report.story().join(" ");
    assert!(story.contains(headline), "{story}");
    let first = lead["planner"].as_str().unwrap();
    if shown {
        assert_eq!(headline, format!("{first} ranks first"));
    } else {
        let start = format!("No planner is shown to be the best: tests do not put {first} before ");
        assert!(headline.starts_with(&start), "{headline}");
        assert!(!story.contains("ranks first"), "{story}");
    }
    // Each planner against itself under another name: no test tells them apart.
    let mut twins = rows.clone();
    twins.retain(|row| row.planner == first);
    let others: Vec<Row> = twins
        .iter()
        .map(|row| Row {
            planner: "twin".into(),
            key: format!("twin {}", row.key),
            ..row.clone()
        })
        .collect();
    twins.extend(others);
    let report = Report::new(subject("twins"), &twins);
    let [a, b] = report.planners()[..] else {
        panic!("two planners");
    };
    let (a, b) = if a < b { (a, b) } else { (b, a) };
    let expected = format!(
        "No planner is shown to be the best: tests do not put {a} before {b} \
         (instances solved: p = 1.000; times: p = 1.000)"
    );
    assert_eq!(report.json().unwrap()["headline"], expected.as_str());
}

#[test]
fn a_page_is_one_file_and_equal_for_equal_trials() {
    for (name, rows) in suites() {
        let report = Report::new(subject(HOSTILE), &rows);
        let text = report.html();
        assert!(text.starts_with("<!doctype html>"), "{name}");
        let mut turned = rows.clone();
        turned.reverse();
        assert!(
            text == Report::new(subject(HOSTILE), &turned).html(),
            "{name}"
        );
        let own = text.replace("'http://www.w3.org/2000/svg'", "");
        for needle in ["http:", "https:", "src=", "@import", "url(", "{{"] {
            assert!(!own.contains(needle), "{name}: {needle}");
        }
        assert!(text.contains("default-src 'none'"), "{name}");
        assert_eq!(text.matches("<script").count(), 2, "{name}");
        assert_eq!(text.matches("</script").count(), 2, "{name}");
        assert!(!text.contains("<b>"), "{name}");
    }
}

#[test]
fn hostile_names_are_text_in_markdown_and_svg() {
    let rows = hostile();
    let report = Report::new(subject(HOSTILE), &rows);
    let text = report.markdown(Some("the figures"), &[]);
    for needle in ["<b>", "<script", "[x]", "\u{1b}"] {
        assert!(!text.contains(needle), "{needle}");
    }
    assert!(text.contains("](the%20figures/cactus.svg)"));
    let columns = |line: &str| line.replace("\\|", "").matches('|').count();
    let table: Vec<&str> = text.lines().filter(|line| line.starts_with("| ")).collect();
    assert!(table.len() > 10);
    let ranking: Vec<usize> = table.iter().take(6).map(|line| columns(line)).collect();
    assert!(
        ranking.iter().all(|count| *count == ranking[0]),
        "{ranking:?}"
    );
    for figure in report.figures() {
        let drawn = svg(&figure);
        assert!(
            !drawn.contains("<script") && !drawn.contains("<b>"),
            "{}",
            figure.id
        );
        assert!(
            !drawn.contains("NaN") && !drawn.contains("inf"),
            "{}",
            figure.id
        );
    }
}

#[test]
fn figures_and_tables_have_the_same_numbers() {
    let rows = usual();
    let report = Report::new(subject("usual"), &rows);
    let figures = report.figures();
    let ids: Vec<&str> = figures.iter().map(|figure| figure.id.as_str()).collect();
    for id in [
        "success",
        "cactus",
        "profile",
        "times",
        "means-expansions",
        "quality",
        "targets",
    ] {
        assert!(ids.contains(&id), "{ids:?}");
    }
    let ranking = &report.tables()[0];
    let times = figures.iter().find(|figure| figure.id == "times").unwrap();
    for (series, row) in times.series.iter().zip(&ranking.rows) {
        let Marks::Box { median, .. } = &series.marks else {
            panic!("times are boxes");
        };
        assert_eq!(series.name, row[1]);
        let shown: f64 = row[6].split(' ').next().unwrap().parse().unwrap();
        assert!(
            (shown - median).abs() < 0.01 * median,
            "{} {median}",
            row[6]
        );
    }
    let markdown = report.markdown(None, &[]);
    for row in &ranking.rows {
        assert!(markdown.contains(&row[4]), "{}", row[4]);
    }
    let tables = report.tables();
    let table = |title: &str| tables.iter().find(|table| table.title == title).unwrap();
    let standings = table("Success, time and quality");
    assert_eq!(standings.rows.last().unwrap()[0], "virtual best");
    let column =
        |table: &Table, name: &str| table.head.iter().position(|head| head == name).unwrap();
    let costs = column(ranking, "SoC/LB");
    let shared = table("On what all solved");
    let same = column(shared, "SoC / lower bound");
    for (ranked, of_shared) in ranking.rows.iter().zip(&shared.rows) {
        let [ranked, of_shared]: [f64; 2] =
            [&ranked[costs], &of_shared[same]].map(|text| text.parse().unwrap());
        assert!((ranked - of_shared).abs() < 0.006, "{ranked} {of_shared}");
    }
    for (title, name) in [
        ("Paired comparison", "Success"),
        ("Paired comparison: sum of costs", "More/less"),
    ] {
        let found = table(title);
        assert_eq!(found.rows.len(), 3);
        column(found, name);
    }
    let pair = report.two_planners("PIBT", "PBS").unwrap();
    assert_eq!(pair.rows[0][0], "solve time, ms");
    assert!(report.two_planners("PIBT", "nobody").is_none());
}

#[test]
fn everything_on_the_page_works_in_a_browser() {
    let Some(browser) = chromium() else {
        eprintln!("skipped: there is no Chromium on this machine");
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    for (name, rows) in suites() {
        let mut subject = subject(name);
        if name == "usual" {
            subject.places.scenarios = places(&rows);
        }
        let report = Report::new(subject, &rows);
        let mut expected = report.json().unwrap();
        let tables = report.tables();
        let tables = tables
            .iter()
            .map(|table| json!({ "title": table.title, "head": table.head, "rows": table.rows }));
        expected["tables"] = tables.collect();
        let expected = expected.to_string().replace('<', "\\u003c");
        let user = format!(
            "const EXPECTED = {expected};\n{}",
            include_str!("selftest.js")
        );
        let file = folder.path().join(format!("{name}.html"));
        fs::write(&file, with_user(&report.html(), &user)).unwrap();
        // Windows are not as narrow as phones, frames are.
        let frame = folder.path().join(format!("{name}-phone.html"));
        let style = "width: 360px; height: 740px; border: 0";
        let text =
            format!("<!doctype html><iframe style=\"{style}\" src=\"{name}.html\"></iframe>");
        fs::write(&frame, text).unwrap();
        let mut pages = vec![("phone", &frame)];
        if name == "usual" {
            pages.push(("desktop", &file));
        }
        for (size, page) in pages {
            let found = selftest(browser, folder.path(), page, "1280,800");
            assert!(!found.contains("FAILED"), "{name} {size}: {found}");
            assert!(found.ends_with("\"errors\":[]}"), "{name} {size}: {found}");
            let least = if rows.len() > 1 { 25 } else { 10 };
            assert!(
                found.matches("\"ok\"").count() >= least,
                "{name} {size}: {found}"
            );
        }
    }
    let pdf = folder.path().join("report.pdf");
    let printed = Command::new(browser)
        .args([
            "--headless=new",
            "--no-sandbox",
            "--disable-gpu",
            "--disable-dev-shm-usage",
        ])
        .arg(format!(
            "--user-data-dir={}",
            folder.path().join("printer").display()
        ))
        .arg(format!("--print-to-pdf={}", pdf.display()))
        .arg(format!(
            "file://{}",
            folder.path().join("usual.html").display()
        ))
        .output()
        .unwrap();
    let bytes = fs::read(&pdf).unwrap_or_default();
    assert!(
        bytes.starts_with(b"%PDF") && bytes.len() > 20_000,
        "{printed:?}"
    );
}

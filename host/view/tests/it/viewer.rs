//! The viewer's modules: clips that the program writes and the page reads, and what is drawn with and
//! without WebGL, in a real browser.

use std::fmt::Write as _;
use std::fs;

use fleetyard_core::Grid;
use fleetyard_sim::TraceSink as _;
use fleetyard_sim::trace::States;
use fleetyard_testkit::browser::{chromium, selftest, with_user};
use fleetyard_view::{
    Clip, Outline, Overview, Page, PageOptions, Recording, Shell, World, base64, joined,
};

/// Three bodies on a map: a disc, a wedge, and an obstacle that moves.
fn recording() -> Recording {
    let grid = Grid::new("yard", 4, 6, b"...........@......@.....".to_vec()).unwrap();
    Recording {
        title: "yard".to_owned(),
        world: World::of_grid(&grid, 1.0),
        columns: 6,
        endpoints: None,
        workstations: None,
        outlines: vec![
            Outline::Disc { radius_m: 0.35 },
            Outline::Polygon {
                vertices_m: vec![[0.4, 0.0], [-0.3, 0.3], [-0.3, -0.3]],
            },
        ],
        outline_of_body: vec![0, 1, 0],
        agents: 2,
        cars: Vec::new(),
        goals_m: Vec::new(),
        headings: true,
        tick_s: 0.05,
        state_every: 2,
        facts: Vec::new(),
    }
}

/// Samples from a tenth of a second on, one each tenth; headings are wrapped, and one is no number.
fn clip(samples: u32) -> Clip {
    let mut clip = Clip::new(&recording(), 0.1, 0.1);
    for sample in 0..samples {
        let time = f64::from(sample + 1) / 10.0;
        let turned = (7.0 * time).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI;
        let states = States {
            x_m: &[1.0 + time, 2.5, -1e300],
            y_m: &[0.5, 2.0 - 10.0 * time, f64::NAN],
            heading_rad: Some(&[0.0, turned]),
            progress: None,
        };
        clip.push(&states).unwrap();
    }
    clip
}

#[test]
fn a_clip_has_the_bytes_that_it_had() {
    let clip = clip(5);
    assert_eq!(clip.samples(), 5);
    let mut text = String::new();
    for line in clip.finish().chunks(16) {
        for byte in line {
            write!(text, "{byte:02x}").unwrap();
        }
        text.push('\n');
    }
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/it/expected/clip.hex");
    if std::env::var_os("FLEETYARD_REGENERATE").is_some() {
        fs::write(path, &text).unwrap();
    }
    assert_eq!(text, fs::read_to_string(path).unwrap());
}

#[test]
fn a_clip_that_would_be_too_large_is_refused() {
    let recording = Recording {
        outline_of_body: vec![0; 1 << 20],
        headings: false,
        ..recording()
    };
    let mut clip = Clip::new(&recording, 0.0, 1.0);
    let far = [1e6, -1e6].map(|x| vec![x; 1 << 20]);
    let mut refused = None;
    for sample in 0..40 {
        let at = &far[sample % 2];
        let states = States {
            x_m: at,
            y_m: at,
            heading_rad: None,
            progress: None,
        };
        if let Err(error) = clip.push(&states) {
            refused = Some((sample, error));
            break;
        }
    }
    let (sample, error) = refused.unwrap();
    let expected = format!(
        "a clip of 1048576 bodies and {} samples is too large",
        sample + 1
    );
    assert_eq!(error.to_string(), expected);
    assert_eq!(clip.samples(), sample as u32);
    assert!(clip.finish().len() <= fleetyard_view::MAX_CLIP_BYTES);
}

#[test]
fn a_recording_is_told_without_its_motion() {
    let mut overview = Overview::new(recording());
    overview.ends_at(40);
    let meta = serde_json::to_value(overview.meta(Some("it was cut off"))).unwrap();
    assert_eq!(meta["duration_s"], 2.0);
    assert_eq!(meta["sample_s"], 0.1);
    assert_eq!(meta["ids"], serde_json::json!([0, 1, 2]));
    assert_eq!(meta["agents"], 2);
    assert_eq!(meta["knots"], 0);
    let notes = meta["notes"].to_string();
    assert!(notes.contains("it was cut off"), "{notes}");
}

#[test]
fn a_trailer_is_told_as_a_part_of_its_car() {
    let towing = || Recording {
        outline_of_body: vec![0, 0, 1, 1],
        agents: 3,
        cars: vec![1],
        ..recording()
    };
    let meta = serde_json::to_value(Overview::new(towing()).meta(None)).unwrap();
    assert_eq!(
        (&meta["agents"], &meta["all_agents"]),
        (&2.into(), &2.into())
    );
    assert_eq!(meta["ids"], serde_json::json!([0, 1, 2, 3]));
    assert_eq!(meta["cars"], serde_json::json!([[2, 1]]));
    // It is shown with its car alone, and cannot be asked for.
    let page = |agent| {
        let options = PageOptions {
            agents: Some(vec![agent]),
            ..PageOptions::default()
        };
        let mut page = Page::new(towing(), &options)?;
        let at = States {
            x_m: &[1.5; 4],
            y_m: &[1.5; 4],
            heading_rad: Some(&[0.0; 4]),
            progress: None,
        };
        page.state(0, &at).unwrap();
        page.finish(None)
    };
    for (agent, told) in [
        (0, "\"ids\":[0,3],\"cars\":[]"),
        (1, "\"ids\":[1,2,3],\"cars\":[[2,1]]"),
    ] {
        assert!(page(agent).unwrap().contains(told), "{agent}");
    }
    assert!(page(2).is_err());
}

#[test]
fn modules_of_the_viewer_work_in_a_browser() {
    let Some(browser) = chromium() else {
        eprintln!("skipped: there is no Chromium on this machine");
        return;
    };
    let mut overview = Overview::new(recording());
    overview.ends_at(12);
    let shell = Shell {
        title: "viewer",
        style: "",
        script: &[&joined(include_str!("viewermain.js"))],
        body: "<div id=\"stage\" style=\"width: 640px; height: 400px\"></div>\n\
               <script type=\"application/json\" id=\"meta\">{{meta}}</script>\n\
               <script type=\"text/plain\" id=\"clip\">{{clip}}</script>\n",
    };
    let page = shell.page(&[
        (
            "meta",
            &fleetyard_view::embedded(&overview.meta(None)).unwrap(),
        ),
        ("clip", &base64(&clip(12).finish())),
    ]);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("viewer.html");
    fs::write(&file, with_user(&page, include_str!("viewertest.js"))).unwrap();
    let report = selftest(browser, folder.path(), &file, "800,600");
    assert!(!report.contains("FAILED"), "{report}");
    assert!(report.ends_with("\"errors\":[]}"), "{report}");
    assert_eq!(report.matches("\"ok\"").count(), 32, "{report}");
}

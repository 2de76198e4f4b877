//! Annotation files.

use fleetyard_abi::{Environment, GridEnvironment};
use fleetyard_core::{Annotation, AnnotationFile, Digest, read_annotations, write_annotations};

fn file() -> AnnotationFile {
    let mut grid = GridEnvironment::four_connected(2, 3, vec![1; 6]);
    (grid.cell_size_m, grid.origin_m) = (0.5, [10.0, -1.0]);
    let shown = [
        Annotation {
            agent: Some(1),
            from_s: 0.5,
            to_s: Some(1.0),
            text: "\"not\" here".to_owned(),
            values: vec![2.0, 0.25],
            ..Annotation::places("constraints", [vec![0], vec![2, 5]])
        },
        Annotation::lines("tree", [[[0.1, 0.2], [1e-9, 4.0]]]),
    ];
    AnnotationFile {
        source: "x.json".to_owned(),
        planner: Some("cbs 0.1.0".to_owned()),
        plan_digest: Some(Digest(0x0123)),
        left_out: 7,
        ..AnnotationFile::new(&Environment::from(grid), 2, &shown)
    }
}

#[test]
fn a_file_is_read_as_it_was_written() {
    let file = file();
    let text = write_annotations(&file);
    assert_eq!(read_annotations("x.json", &text), Ok(file.clone()));
    // Places are where they are in the frame of the map.
    let at = &file.annotations[0].xy_m;
    assert_eq!(at[0], [[10.25, -0.25]]);
    assert_eq!(at[1], [[11.25, -0.25], [11.25, -0.75]]);
    let text = String::from_utf8(text).unwrap();
    assert_eq!(text.lines().count(), 11, "{text}");
    assert!(text.contains(r#"{"layer":"tree","shape":"lines","xy_m":[[[0.1,0.2],[1e-9,4.0]]]}"#));
}

#[test]
fn what_is_wrong_has_its_place() {
    let good = String::from_utf8(write_annotations(&file())).unwrap();
    for (from, to, message) in [
        ("annotations/1", "annotations/2", "x.json:2:37: format is"),
        (
            "\"agents\": 2",
            "\"agents\": 1",
            "annotation 0 is malformed: an annotation of the layer `constraints`: it is about agent 1",
        ),
        (
            "\"layer\":\"tree\"",
            "\"layer\":\"tree\",\"color\":1",
            "x.json:9:27: unknown field `color`",
        ),
        (
            "\"shape\":\"lines\"",
            "\"shape\":\"cubes\"",
            "x.json:9:35: unknown variant `cubes`",
        ),
        ("[11.25,-0.75]", "", "x.json:8:"),
        (
            ",[11.25,-0.75]",
            "",
            "its `xy_m` and its `places` have different lengths",
        ),
        ("1e-9", "1e999", "x.json:9:"),
        ("[2.0,0.25]", "[2.0]", "it has 1 values for 2 shapes"),
        ("\"left_out\"", "\"lost\"", "unknown field `lost`"),
        ("\n}\n", "\n", "x.json:11:1: EOF"),
    ] {
        let text = good.replacen(from, to, 1);
        assert_ne!(text, good, "{from}");
        let error = read_annotations("x.json", text.as_bytes()).unwrap_err();
        assert!(error.to_string().contains(message), "{to}: {error}");
    }
}

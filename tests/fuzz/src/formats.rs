//! Instances and plans of other tools.

use std::path::Path;

use fleetyard_core::formats::{
    Contents, Format, Known, MapSize, Parts, looks_transposed, read_libmrp, write_libmrp,
};

use super::check_error;

const SOURCE: &str = "folder/a.txt";

const SIZE: MapSize = MapSize { rows: 3, cols: 4 };

/// Larger plans and maps are not written again: that would be most of the time.
const SMALL: usize = 2000;

/// Reads a file as it looks, and in every format but those that name other files.
pub fn run(data: &[u8]) {
    let path = Path::new(SOURCE);
    let guessed = Format::guess(path, data);
    assert!(guessed.is_none_or(|format| Format::by_name(format.name()) == Some(format)));
    for format in Format::ALL.iter().copied() {
        if matches!(format, Format::Lorr | Format::RoadmapPlan) {
            continue;
        }
        match Contents::read(path, data, Some(format), Known::size(Some(SIZE))) {
            Ok(contents) => check(&contents, format),
            Err(error) => check_error(&error, SOURCE, data),
        }
        if format.needs_map_size() {
            let unknown = Contents::read(path, data, Some(format), Known::default());
            check_error(&unknown.expect_err("no size"), SOURCE, data);
        }
    }
}

fn check(contents: &Contents, format: Format) {
    assert_eq!(contents.format, format);
    assert_eq!(contents.grid.is_some(), format.carries_map());
    // Maps of POGEMA may have agents.
    assert!(contents.agents.is_none() || format.carries_agents());
    assert!(contents.agents.is_some() || !format.carries_agents() || format == Format::Pogema);
    assert_eq!(contents.plan.is_some(), format.carries_plan());
    assert_eq!(contents.roadmap.is_some(), format.carries_roadmap());
    let plane = contents.trajectories.is_some();
    assert_eq!(plane, format.carries_trajectories());
    assert!(contents.formats().all(Format::is_written));
    if let (Some(grid), Some(list)) = (&contents.grid, &contents.agents) {
        let cell = |(row, col)| grid.cell(row, col);
        let starts = list.agents.iter().map(|agent| cell(agent.start));
        let goals = list.agents.iter().map(|agent| cell(agent.goal));
        let (starts, goals): (Option<Vec<u32>>, Option<Vec<u32>>) =
            (starts.collect(), goals.collect());
        if let (Some(starts), Some(goals)) = (starts, goals)
            && (grid.cell_count() as usize) < SMALL
        {
            let text = write_libmrp(grid, &starts, &goals);
            let (again, same) = read_libmrp("a", &text).expect("the same instance");
            assert_eq!(again.digest(), grid.digest());
            assert_eq!(same.agents.len(), list.agents.len());
        }
    }
    let Some(file) = &contents.plan else { return };
    let plan = &file.plan;
    assert!(format == Format::Plan || plan.agents() > 0);
    let size = MapSize {
        rows: file.rows,
        cols: file.cols,
    };
    let starts: Vec<u32> = plan
        .paths()
        .filter_map(|path| path.first().copied())
        .collect();
    assert!(!looks_transposed(size, &starts, plan) || starts.contains(&u32::MAX));
    if plan.agents().saturating_mul(plan.horizon() + 1) > SMALL {
        return;
    }
    let parts = Parts {
        plan: Some(file.clone()),
        ..Parts::default()
    };
    for to in Format::ALL.iter().filter(|to| to.carries_plan()) {
        // PlanViz asks for goals; an empty path can only be said in a plan file.
        let Ok(written) = parts.write(*to, "a") else {
            assert!(*to != Format::Plan);
            continue;
        };
        let again = Contents::read(
            Path::new(SOURCE),
            &written.bytes,
            Some(*to),
            Known::size(Some(size)),
        );
        let again = again.expect("the same plan").plan.expect("a plan");
        assert_eq!(again.plan.trimmed(), plan.trimmed(), "{to}");
    }
}

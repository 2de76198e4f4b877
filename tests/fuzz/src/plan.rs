//! Plan files, the two readers of paths, and the judge of what they read.

use std::sync::Arc;

use fleetyard_abi::paths::{PathContext, WritePaths};
use fleetyard_check::{metrics, validate};
use fleetyard_core::{
    Connectivity, Digest, Grid, GridInstance, GridPlan, OFF_MAP, PathEncoding, PlanFile, read_plan,
    write_plan,
};
use serde::Deserialize;
use serde::de::DeserializeSeed;
use serde_json::value::RawValue;

use super::check_error;

const SOURCE: &str = "a.plan";

/// Most cells of a map that is made to judge a plan.
const LARGEST: u32 = 1 << 12;

/// Reads a plan file.
pub fn run(data: &[u8]) {
    let file = match read_plan(SOURCE, data) {
        Ok(file) => file,
        Err(error) => return check_error(&error, SOURCE, data),
    };
    let cells = u64::from(file.rows) * u64::from(file.cols);
    assert!((1..=Grid::MAX_CELLS).contains(&cells));
    // An agent is a comma or more, and a cell one byte or more.
    assert!(file.plan.agents() <= data.len() && file.plan.cells().len() <= data.len());
    let on_map = |cell: &u32| *cell == OFF_MAP || u64::from(*cell) < cells;
    assert!(file.plan.cells().iter().all(on_map));
    if let Some(digest) = file.plan_digest {
        assert_eq!(digest, Digest::of_plan(&file.plan));
    }
    round_trips(&file);
    read_as_message(&file, data);
    as_message(&file);
    judge(&file);
}

/// Writing and reading keeps everything; pairs stand in where there are no moves.
fn round_trips(file: &PlanFile) {
    for encoding in PathEncoding::ALL {
        let expected = PlanFile {
            encoding,
            ..file.clone()
        };
        let written = write_plan(&expected);
        let read = read_plan(SOURCE, &written).expect("what was written can be read");
        let stand_in = (encoding, read.encoding) == (PathEncoding::Moves, PathEncoding::Pairs);
        assert!(read.encoding == encoding || stand_in);
        assert_eq!(write_plan(&read), written);
        assert_eq!(PlanFile { encoding, ..read }, expected);
    }
}

/// Pairs and cells mean the same in a plan file and in a message.
fn read_as_message(file: &PlanFile, data: &[u8]) {
    #[derive(Deserialize)]
    struct Paths<'a> {
        #[serde(borrow)]
        paths: &'a RawValue,
    }
    if file.encoding == PathEncoding::Moves {
        return;
    }
    // Texts that are no UTF-8 are no paths, and were refused already.
    let text = std::str::from_utf8(data).expect("JSON is UTF-8");
    let Paths { paths } = serde_json::from_str(text).expect("a plan has paths");
    let context = PathContext {
        rows: file.rows,
        cols: file.cols,
        starts: &[],
        max_cells: usize::MAX,
    };
    let plan = context.deserialize(&mut serde_json::Deserializer::from_str(paths.get()));
    assert_eq!(plan.expect("the same paths"), file.plan);
}

/// A plan goes through a message of any encoding unchanged.
fn as_message(file: &PlanFile) {
    let starts: Vec<u32> = (0..file.plan.agents())
        .map(|agent| file.plan.at(agent, 0))
        .collect();
    let context = PathContext {
        rows: file.rows,
        cols: file.cols,
        starts: &starts,
        max_cells: file.plan.cells().len() + 1,
    };
    for encoding in PathEncoding::ALL {
        let paths = WritePaths {
            plan: &file.plan,
            context,
            encoding,
        };
        let text = serde_json::to_string(&paths).expect("paths can be written");
        let read = context.deserialize(&mut serde_json::Deserializer::from_str(&text));
        assert_eq!(read.expect("what was written can be read"), file.plan);
    }
}

/// Judges the plan as one from its first to its last cells, on a map with pillars.
fn judge(file: &PlanFile) {
    let (rows, cols) = (file.rows, file.cols);
    if rows.checked_mul(cols).is_none_or(|cells| cells > LARGEST) {
        return;
    }
    let pillar = |cell: u32| (cell / cols) % 2 == 1 && (cell % cols) % 3 == 1;
    let letter = |cell| if pillar(cell) { b'@' } else { b'.' };
    let terrain = (0..rows * cols).map(letter).collect();
    let grid = Arc::new(Grid::new("a", rows, cols, terrain).expect("a map"));
    let plan = &file.plan;
    let ends = |pick: fn(&[u32]) -> Option<&u32>| -> Vec<u32> {
        plan.paths()
            .map(|path| pick(path).copied().unwrap_or(OFF_MAP))
            .collect()
    };
    let (starts, goals) = (ends(<[u32]>::first), ends(<[u32]>::last));
    for connectivity in [Connectivity::Four, Connectivity::Eight] {
        let (starts, goals) = (starts.clone(), goals.clone());
        let made = GridInstance::new(Arc::clone(&grid), connectivity, starts, goals);
        // Any plan can be judged, also one that is for somebody else.
        let instance = made.unwrap_or_else(|_| {
            let last = rows * cols - 1;
            let corner = if pillar(last) { 0 } else { last };
            GridInstance::new(Arc::clone(&grid), connectivity, vec![corner], vec![corner])
                .expect("an agent that stays")
        });
        let verdict = validate(&instance, plan, 1000);
        assert_eq!(verdict.valid, verdict.violation_count == 0);
        let described = verdict.violation_count.min(1000);
        assert_eq!(verdict.violations.len() as u64, described);
        let counted = validate(&instance, plan, 0);
        assert_eq!(counted.violation_count, verdict.violation_count);
        // Waits at the end mean nothing.
        assert_eq!(validate(&instance, &plan.trimmed(), 1000), verdict);
        let figures = metrics(&instance, plan, 1.0);
        assert_eq!(figures.sum_of_costs, plan.sum_of_costs());
        assert!(figures.length_m.is_finite());
        if verdict.valid {
            assert!(figures.sum_of_costs >= figures.lower_bound_steps);
            assert!(figures.makespan >= figures.lower_bound_makespan);
        }
        if connectivity == Connectivity::Four
            && let Some(keeps) = keeps_the_rules(&instance, plan)
        {
            assert_eq!(verdict.valid, keeps, "{:?}", verdict.violations);
        }
    }
    let instance = GridInstance::new(grid, Connectivity::Four, starts, goals);
    if let Ok(instance) = instance {
        let bound = PlanFile {
            source: SOURCE.to_owned(),
            ..PlanFile::new(&instance, plan.clone())
        };
        assert_eq!(bound.check_for(&instance), Ok(()));
        let read = read_plan(SOURCE, &write_plan(&bound)).expect("a plan");
        assert_eq!(read.check_for(&instance), Ok(()));
        let named = file
            .instance_digest
            .is_none_or(|named| named == instance.digest());
        assert_eq!(file.check_for(&instance).is_ok(), named);
    }
}

/// The rules of four-connected grids, read from the definition and looked at for every
/// pair of agents; `None` if that would take too long.
fn keeps_the_rules(instance: &GridInstance, plan: &GridPlan) -> Option<bool> {
    let (agents, horizon) = (plan.agents(), plan.horizon());
    if agents * agents * (horizon + 1) > 1 << 18 {
        return None;
    }
    if agents != instance.agents() {
        return Some(false);
    }
    let grid = instance.grid();
    let each = (0..agents).all(|agent| {
        let path = plan.path(agent);
        let unit = |step: &[u32]| {
            step[0] == step[1]
                || grid
                    .neighbors(step[0], Connectivity::Four)
                    .any(|cell| cell == step[1])
        };
        path.first() == Some(&instance.starts()[agent])
            && path.last() == Some(&instance.goals()[agent])
            && path.iter().all(|cell| grid.is_passable(*cell))
            && path.windows(2).all(unit)
    });
    let pair = |one: usize, other: usize| {
        (0..=horizon).all(|time| {
            let (a, b) = (plan.at(one, time), plan.at(other, time));
            let (next_a, next_b) = (plan.at(one, time + 1), plan.at(other, time + 1));
            a != b && (a != next_b || b != next_a)
        })
    };
    Some(each && (0..agents).all(|other| (0..other).all(|one| pair(one, other))))
}

//! Plans that the MAPF Tracker publishes, <http://tracker.pathfinding.ai/>: a CSV with a line per plan,
//! whose last column, `solution_plan` or `path`, has a line of letters per agent:
//!
//! ```text
//! map_name,scen_type,type_id,agents,lower_cost,solution_cost,solution_plan
//! random-32-32-20,even,1,2,11,11,"drdr
//! uurruuu"
//! ```
//!
//! `u` adds one to the y of a scenario, which is the row: it leads to the next row, down in a picture of
//! the map. `d` leads to the row before, `l` and `r` to the column before and after, and `w` waits. Starts are those of the scenario, which the file does not
//! have. Where a file has several plans, the one with so many agents as are asked for is meant, and
//! of several such the one whose map, kind and number are in the scenario's name, as in
//! `random-32-32-20-even-1.scen`.

use super::{Known, MapSize};
use crate::files::{quote, stem};
use crate::path_list::PLAN_MAX_AGENTS;
use crate::{GridPlan, InputError, OFF_MAP};

/// The columns that may have the plan.
const PLANS: [&str; 2] = ["solution_plan", "path"];

/// True of the first line of such a file.
pub(super) fn is_tracker(text: &[u8]) -> bool {
    let line = text.split(|byte| matches!(byte, b'\n' | b'\r')).next();
    let names: Vec<&[u8]> = line
        .unwrap_or_default()
        .split(|byte| *byte == b',')
        .collect();
    let has = |name: &str| {
        let name = name.as_bytes();
        names.iter().any(|found| {
            let found = found.trim_ascii();
            found == name
                || found
                    .strip_prefix(b"\"")
                    .and_then(|rest| rest.strip_suffix(b"\""))
                    == Some(name)
        })
    };
    has("agents") && PLANS.iter().any(|name| has(name))
}

/// A line of the table: its fields, and where it begins.
struct Row {
    line: u64,
    fields: Vec<String>,
}

/// The rows of a table whose quoted fields may go over several lines.
fn table(source: &str, bytes: &[u8]) -> Result<Vec<Row>, InputError> {
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .from_reader(bytes);
    let rows = reader.records().map(|record| {
        let record = record.map_err(|error| {
            let line = error.position().map_or(1, csv::Position::line);
            InputError::new(source, format!("this is no CSV: {error}")).at_line(line)
        })?;
        Ok(Row {
            line: record.position().map_or(1, csv::Position::line),
            fields: record.iter().map(str::to_owned).collect(),
        })
    });
    rows.collect()
}

/// Parses a plan of the MAPF Tracker. `source` is named in errors. Map and starts have to be known.
pub fn read_tracker(
    source: &str,
    bytes: &[u8],
    known: Known<'_>,
    wanted: Option<usize>,
) -> Result<GridPlan, InputError> {
    let lacks = |what: &str, hint: &str| {
        let reason = format!("a plan of the MAPF Tracker does not say {what}");
        Err(InputError::new(source, reason).hint(hint))
    };
    let Some(size) = known.size else {
        return lacks("how large its map is", "name the map with --map FILE");
    };
    let Some(agents) = known.agents else {
        return lacks(
            "where its agents start",
            "name its scenario with --scen FILE, here or in `fleetyard convert PLAN plan.json`",
        );
    };
    let rows = table(source, bytes)?;
    let empty = || InputError::new(source, "the file is empty");
    let (head, rows) = rows.split_first().ok_or_else(empty)?;
    let place = |names: &[&str]| {
        head.fields
            .iter()
            .position(|name| names.contains(&name.trim()))
    };
    let (Some(count_at), Some(plan_at)) = (place(&["agents"]), place(&PLANS)) else {
        return Err(InputError::new(
            source,
            "there are no columns agents and solution_plan, or path",
        )
        .at_line(head.line));
    };
    let row = chosen(source, head, rows, count_at, wanted, &agents.source)?;
    let count = count_of(source, row, count_at)?;
    if row.fields.len() != head.fields.len() {
        let reason = format!(
            "the line has {} fields, the header {}",
            row.fields.len(),
            head.fields.len()
        );
        return Err(InputError::new(source, reason).at_line(row.line));
    }
    let mut lines: Vec<&str> = row.fields[plan_at].split('\n').map(str::trim).collect();
    // An agent that need not move has an empty line, and there may be a last one that is nobody's.
    if lines.len() == count + 1 && lines.last() == Some(&"") {
        lines.pop();
    }
    if lines.len() != count {
        let reason = format!(
            "the plan is for {count} agents, but has {} lines",
            lines.len()
        );
        return Err(InputError::new(source, reason).at_line(row.line));
    }
    let Some(starts) = agents.agents.get(..count) else {
        let reason = format!(
            "the plan is for {count} agents, but {} has {}",
            agents.source,
            agents.agents.len()
        );
        return Err(InputError::new(source, reason)
            .at_line(row.line)
            .hint("name the scenario that the plan was made for with --scen FILE"));
    };
    let mut plan = GridPlan::with_capacity(count, row.fields[plan_at].len());
    let mut path = Vec::new();
    for (agent, (letters, entry)) in lines.into_iter().zip(starts).enumerate() {
        path.clear();
        let mut at = (i64::from(entry.start.0), i64::from(entry.start.1));
        path.push(cell(at, size));
        for (step, letter) in letters.chars().enumerate() {
            let (rows, cols) = match letter.to_ascii_lowercase() {
                'u' => (1, 0),
                'd' => (-1, 0),
                'l' => (0, -1),
                'r' => (0, 1),
                'w' => (0, 0),
                other => {
                    let found = quote(other.to_string().as_bytes());
                    let reason =
                        format!("agent {agent}: unknown move {found} at step {}", step + 1);
                    return Err(InputError::new(source, reason)
                        .at_line(row.line)
                        .hint("moves are u (to the next row), d, l, r and w (wait)"));
                }
            };
            at = (at.0 + rows, at.1 + cols);
            path.push(cell(at, size));
        }
        plan.push_path(path.iter().copied());
    }
    Ok(plan)
}

fn cell((row, col): (i64, i64), size: MapSize) -> u32 {
    let inside =
        (0..i64::from(size.rows)).contains(&row) && (0..i64::from(size.cols)).contains(&col);
    if inside {
        (row * i64::from(size.cols) + col) as u32
    } else {
        OFF_MAP
    }
}

fn count_of(source: &str, row: &Row, at: usize) -> Result<usize, InputError> {
    let text = row.fields.get(at).map_or("", |field| field.trim());
    let count = text.parse().ok();
    count
        .filter(|count| (1..=PLAN_MAX_AGENTS).contains(count))
        .ok_or_else(|| {
            let reason = format!("the number of agents is {}", quote(text.as_bytes()));
            InputError::new(source, reason).at_line(row.line)
        })
}

/// The row that is meant.
fn chosen<'a>(
    source: &str,
    head: &Row,
    rows: &'a [Row],
    count_at: usize,
    wanted: Option<usize>,
    scenario: &str,
) -> Result<&'a Row, InputError> {
    let [first, others @ ..] = rows else {
        return Err(InputError::new(source, "there is no plan in the file"));
    };
    if others.is_empty() {
        return Ok(first);
    }
    let mut fits: Vec<&Row> = Vec::new();
    for row in rows {
        if wanted.is_none_or(|wanted| count_of(source, row, count_at) == Ok(wanted)) {
            fits.push(row);
        }
    }
    let named = |name: &str, row: &'a Row| {
        let at = head.fields.iter().position(|field| field.trim() == name);
        at.and_then(|at| row.fields.get(at))
            .map_or("", |field| field.trim())
    };
    if fits.len() > 1 {
        let scenario = stem(scenario);
        fits.retain(|row| {
            let [map, kind, number] =
                ["map_name", "scen_type", "type_id"].map(|name| named(name, row));
            scenario == format!("{map}-{kind}-{number}")
        });
    }
    match fits.as_slice() {
        [only] => Ok(only),
        fits => {
            let reason = format!(
                "the file has {} plans, and {} of them may be meant",
                rows.len(),
                fits.len()
            );
            Err(InputError::new(source, reason)
                .hint("say it with --agents N, and by the scenario's name, as in MAP-even-1.scen"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::{AgentEntry, AgentList};

    const SIZE: MapSize = MapSize { rows: 3, cols: 4 };

    fn team(source: &str) -> AgentList {
        AgentList {
            source: source.into(),
            map_file: None,
            agents: vec![
                AgentEntry::new(2, (0, 0), (0, 3)),
                AgentEntry::new(3, (2, 0), (2, 3)),
            ],
        }
    }

    fn read(text: &str, scen: &str, wanted: Option<usize>) -> Result<GridPlan, String> {
        let team = team(scen);
        let known = Known {
            size: Some(SIZE),
            agents: Some(&team),
            team: None,
        };
        assert!(is_tracker(text.as_bytes()), "{text}");
        read_tracker("t.csv", text.as_bytes(), known, wanted).map_err(|error| error.to_string())
    }

    const HEAD: &str = "map_name,scen_type,type_id,agents,lower_cost,solution_cost,solution_plan\n";

    #[test]
    fn plans_of_both_tables_are_read() {
        let plan = GridPlan::from_paths([&[0, 4, 5][..], &[8, 8, 4]]);
        let one = format!("{HEAD}m,even,1,2,4,4,\"ur\nwd\"\n");
        assert_eq!(read(&one, "m.scen", None), Ok(plan.clone()));
        let dated = "\"agents\",\"lower_cost\",\"lower_date\",\"solution_cost\",\"solution_date\",\"path\"\r\n\
                     \"2\",\"4\",\"2022-11-29\",\"4\",\"2022-11-29\",\"ur\r\nwd\"\r\n";
        assert_eq!(read(dated, "m.scen", None), Ok(plan.clone()));
        // The same team in two scenarios, and another team.
        let many = format!(
            "{HEAD}m,even,1,1,2,2,rr\nm,even,1,2,4,4,\"rr\nrr\"\nm,random,7,2,4,4,\"ur\nwd\"\n"
        );
        assert_eq!(read(&many, "x/m-random-7.scen", Some(2)), Ok(plan));
        let alone = GridPlan::from_paths([&[0, 1, 2]]);
        assert_eq!(read(&many, "m.scen", Some(1)), Ok(alone));
        // Nobody moves, and one leaves the map.
        let off = format!("{HEAD}m,even,1,2,4,4,\"\nl\"\n");
        let expected = GridPlan::from_paths([&[0][..], &[8, OFF_MAP]]);
        assert_eq!(read(&off, "m.scen", None), Ok(expected));
    }

    #[test]
    fn malformed_plans_are_told() {
        for (rows, wanted, expected) in [
            ("", None, "t.csv: there is no plan in the file"),
            (
                "m,even,1,x,4,4,u\n",
                None,
                "t.csv:2: the number of agents is 'x'",
            ),
            (
                "m,even,1,2,4,4,u\n",
                None,
                "t.csv:2: the plan is for 2 agents, but has 1 lines",
            ),
            (
                "m,even,1,1,4,4,uq\n",
                None,
                "t.csv:2: agent 0: unknown move 'q' at step 2",
            ),
            (
                "m,even,1,3,4,4,\"u\nu\nu\"\n",
                None,
                "t.csv:2: the plan is for 3 agents, but m.scen has 2",
            ),
            (
                "m,even,1,1,4,4\n",
                None,
                "t.csv:2: the line has 6 fields, the header 7",
            ),
            (
                "m,even,1,1,4,4,u\nm,even,2,1,4,4,r\n",
                Some(1),
                "t.csv: the file has 2 plans, and 0 of them",
            ),
        ] {
            let error = read(&format!("{HEAD}{rows}"), "m.scen", wanted).expect_err(rows);
            assert!(error.starts_with(expected), "{rows}: {error}");
        }
        let text = format!("{HEAD}m,even,1,1,4,4,u\n");
        let no_size =
            read_tracker("t", text.as_bytes(), Known::default(), None).expect_err("no map");
        assert!(no_size.hint.is_some_and(|hint| hint.contains("--map")));
        let no_starts = read_tracker("t", text.as_bytes(), Known::size(Some(SIZE)), None);
        let no_starts = no_starts.expect_err("no scenario");
        assert!(no_starts.hint.is_some_and(|hint| hint.contains("--scen")));
    }
}

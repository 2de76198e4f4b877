//! Rows of the tables in `docs/results`, made again: a page whose rows do not repeat is stale.
//!
//! Each [`Kept`] is a file of rows that scripts have measured. A seeded sample of those that take a second or
//! so is made anew by the same script, and compared by what no clock decides. `FLEETYARD_PAGES=N` tries N
//! rows of each file instead, whatever they take; CONTRIBUTING.md says what to do when one differs.

use std::fs;
use std::path::PathBuf;

use fleetyard_testkit::grid::mix;
use fleetyard_testkit::{Yard, have, root};

/// Another sample for another seed.
const SEED: u64 = 42;

/// A row by its columns.
#[derive(Debug, Clone)]
struct Row(Vec<(String, String)>);

impl Row {
    fn text(&self, column: &str) -> &str {
        let found = self.0.iter().find(|(name, _)| name == column);
        found.map_or("", |(_, value)| value)
    }

    fn number(&self, column: &str) -> f64 {
        self.text(column).parse().unwrap_or(f64::INFINITY)
    }

    /// Its values in these columns, as the scripts' `--only` takes them.
    fn values(&self, columns: &[&str]) -> String {
        let values: Vec<&str> = columns.iter().map(|column| self.text(column)).collect();
        values.join(",")
    }
}

fn parsed(text: &[u8]) -> Vec<Row> {
    let mut reader = csv::Reader::from_reader(text);
    let columns = reader.headers().unwrap().clone();
    let row = |record: csv::StringRecord| {
        let pairs = columns.iter().zip(&record);
        Row(pairs
            .map(|(name, value)| (name.to_owned(), value.to_owned()))
            .collect())
    };
    reader
        .records()
        .map(|record| row(record.unwrap()))
        .collect()
}

/// A file of rows below `docs/results`.
struct Kept {
    /// The page that shows it.
    page: &'static str,
    rows: &'static str,
    /// Columns that name a row.
    key: &'static [&'static str],
    /// Columns that repeat on any machine.
    same: &'static [&'static str],
    /// The seconds that a row took where it was measured.
    seconds: fn(&Row) -> f64,
    /// True where the clock has no part in the row.
    repeats: fn(&Row) -> bool,
    /// The command that makes the row anew: the script with its first words.
    script: &'static str,
    /// The command that measures the whole page anew.
    anew: &'static str,
    /// Rows of the sample.
    sample: usize,
}

const LSMART: Kept = Kept {
    page: "docs/results/lsmart.md",
    rows: "",
    key: &["planner", "map", "agents", "seed"],
    same: &[
        "trace_digest",
        "goals_committed",
        "planner_calls",
        "fail_policy_ratio",
        "contacts",
        "nodes",
        "limit_s",
    ],
    seconds: |row| row.number("simulated_s") / row.number("rtf"),
    repeats: |row| published(row.text("map")).is_some(),
    script: "",
    anew: "scripts/lsmart EXPERIMENT, then scripts/lsmart page",
    sample: 1,
};

const GRACE: Kept = Kept {
    page: "docs/results/grace-a.md",
    rows: "",
    key: &["family", "seed", "agents", "view", "planner"],
    same: &[
        "termination",
        "valid",
        "valid_in_world",
        "length_m",
        "soc_s",
        "makespan_s",
        "followed_nearest_m",
        "followed_makespan_s",
        "driven_nearest_m",
        "driven_makespan_s",
        "driven_pairs",
    ],
    seconds: |row| row.number("plan_ms") / 1000.0 + 0.5,
    repeats: |row| row.text("termination") == "completed" && row.text("failure").is_empty(),
    script: "scripts/grace-a",
    anew: "scripts/grace-a, scripts/grace-a study",
    sample: 1,
};

fn kept() -> Vec<Kept> {
    vec![
        Kept {
            rows: "lsmart/reduced-models.csv",
            script: "scripts/lsmart models",
            ..LSMART
        },
        Kept {
            rows: "lsmart/reduced-models-shipped.csv",
            script: "scripts/lsmart models-shipped",
            ..LSMART
        },
        Kept {
            rows: "lsmart/reduced-windows.csv",
            script: "scripts/lsmart windows",
            ..LSMART
        },
        Kept {
            rows: "lsmart/reduced-windows-shipped.csv",
            script: "scripts/lsmart windows-shipped",
            ..LSMART
        },
        Kept {
            rows: "lsmart/reduced-generators.csv",
            script: "scripts/lsmart generators",
            ..LSMART
        },
        Kept {
            rows: "lsmart/reduced-generators-shipped.csv",
            script: "scripts/lsmart generators-shipped",
            ..LSMART
        },
        Kept {
            rows: "lsmart/reduced-policies.csv",
            script: "scripts/lsmart policies",
            ..LSMART
        },
        Kept {
            rows: "lsmart/reduced-disturbances.csv",
            script: "scripts/lsmart disturbances",
            ..LSMART
        },
        Kept {
            rows: "grace-a/rows.csv",
            sample: 2,
            ..GRACE
        },
        Kept {
            rows: "grace-a/study.csv",
            ..GRACE
        },
        Kept {
            page: "docs/results/quadrupeds.md",
            rows: "quadrupeds/rows.csv",
            key: &["robots", "trial", "planner"],
            same: &[
                "kinds",
                "termination",
                "valid",
                "makespan_s",
                "length_m",
                "inflation_m",
                "kinematic_makespan_s",
                "kinematic-noise_makespan_s",
                "contact_makespan_s",
                "contact-noise_makespan_s",
                "contact-noise_off_m",
                "contact-noise_pairs",
            ],
            seconds: |row| row.number("plan_ms") / 1000.0 + 0.5,
            repeats: |row| row.text("termination") == "completed" && row.number("plan_ms") < 6000.0,
            script: "scripts/quadrupeds",
            anew: "scripts/quadrupeds",
            sample: 1,
        },
        Kept {
            page: "docs/results/maze-paper.md",
            rows: "maze-table3.csv",
            key: &["planner_id", "maze_seed"],
            same: &["path_length_cells", "expansions", "plan_digest"],
            seconds: |_| 0.1,
            repeats: |_| true,
            script: "scripts/maze-paper table",
            anew: "scripts/maze-paper table",
            sample: 2,
        },
        Kept {
            page: "docs/results/maze-paper.md",
            rows: "maze-drive.csv",
            key: &["cells", "seed", "planner", "model"],
            same: &[
                "termination",
                "solved",
                "searched",
                "length_m",
                "plan_s",
                "plan_margin_m",
                "waypoints",
                "law_time_s",
                "law_contacts",
                "law_margin_m",
                "program_time_s",
                "program_contacts",
            ],
            seconds: |row| row.number("cpu_ms") / 1000.0 + 0.5 * row.number("waypoints") / 10.0,
            // A budget of five seconds ends some; samplers of that build found other plans, as the page says.
            repeats: |row| {
                let samples = ["cbs-rrt", "rrt-star", "sst"].contains(&row.text("planner"));
                let earlier = samples && row.text("build") == "1792dc3e";
                row.text("solved") == "1" && row.number("cpu_ms") < 1000.0 && !earlier
            },
            script: "scripts/maze-paper drive",
            anew: "scripts/maze-paper drive",
            sample: 1,
        },
        Kept {
            page: "docs/results/maze-paper.md",
            rows: "maze-closures.csv",
            key: &["cells", "seed", "planner"],
            same: &[
                "goals",
                "closures",
                "calls",
                "replans",
                "waits",
                "expansions_first",
                "expansions_replan",
                "expansions_replan_max",
                "goal_s",
                "informed_s",
                "late_most_s",
            ],
            // As many calls in mazes of any size.
            seconds: |row| row.number("calls") / 500.0,
            repeats: |_| true,
            script: "scripts/maze-paper closures",
            anew: "scripts/maze-paper closures",
            sample: 1,
        },
    ]
}

/// True for maps of ours, which scripts generate; others are below `FLEETYARD_DATA`.
fn published(map: &str) -> Option<PathBuf> {
    let data = std::env::var_os("FLEETYARD_DATA").map(PathBuf::from);
    let file = |data: PathBuf| data.join(format!("movingai/{map}/{map}.map"));
    match map {
        "warehouse-33-36" | "warehouse-10-20-10-2-1" | "empty-32-32" => Some(root()),
        _ => data.map(file).filter(|file| file.exists()),
    }
}

/// The numbers of a file's rows, in the order of the seed.
fn order(of: &str, count: usize) -> Vec<usize> {
    let name = of
        .bytes()
        .fold(SEED, |hash, byte| mix(hash ^ u64::from(byte)));
    let mut numbers: Vec<usize> = (0..count).collect();
    numbers.sort_by_key(|number| mix(name ^ *number as u64));
    numbers
}

/// The row made anew; what was written to standard error where there is none.
fn anew(kept: &Kept, row: &Row) -> Result<Row, String> {
    let yard = Yard::new();
    let [script, words @ ..] = &kept.script.split(' ').collect::<Vec<_>>()[..] else {
        unreachable!("a script has a name");
    };
    let line = format!(
        "FLEETYARD=fleetyard '{}' {} --only '{}' --out \"$PWD/out\"",
        root().join(script).display(),
        words.join(" "),
        row.values(kept.key)
    );
    let ended = yard.shell(&line);
    let found = parsed(ended.stdout.as_bytes());
    match &found[..] {
        [found] => Ok(found.clone()),
        _ => Err(ended.to_string()),
    }
}

/// True where the clock took part because the machine was too busy: that says nothing of the row.
fn was_late(row: &Row, now: &Row) -> bool {
    let (took, limit) = ("planner_call_max_ms", "planner_limit_ms");
    let late = now.number(took).is_finite() && now.number(took) >= 0.95 * now.number(limit);
    let timed_out = |row: &Row| row.text("termination") == "timed-out";
    late || (timed_out(now) && !timed_out(row))
}

/// The differences, in words.
fn differences(kept: &Kept, row: &Row, now: &Row) -> Vec<String> {
    let same = |column: &&&str| {
        let (old, new) = (row.text(column), now.text(column));
        // Scripts write 20 and stores 20.0.
        old == new
            || old
                .parse::<f64>()
                .ok()
                .is_some_and(|old| new.parse() == Ok(old))
    };
    let others = kept.same.iter().filter(|column| !same(column));
    others
        .map(|column| format!("{column} {} is {} now", row.text(column), now.text(column)))
        .collect()
}

#[test]
fn rows_of_pages_repeat() {
    if !have("python3") {
        return;
    }
    let wanted = std::env::var("FLEETYARD_PAGES").ok();
    let wanted: Option<usize> =
        wanted.map(|text| text.parse().expect("FLEETYARD_PAGES is a number"));
    let mut stale = Vec::new();
    for kept in kept() {
        let file = root().join("docs/results").join(kept.rows);
        let rows = parsed(&fs::read(&file).unwrap());
        assert!(!rows.is_empty(), "{} is empty", file.display());
        let fit = |number: &usize| {
            let row = &rows[*number];
            (kept.repeats)(row) && (wanted.is_some() || (kept.seconds)(row) < 1.5)
        };
        let sample = order(kept.rows, rows.len()).into_iter().filter(fit);
        let sample: Vec<usize> = sample.take(wanted.unwrap_or(kept.sample)).collect();
        if sample.is_empty() {
            println!(
                "skipped: the maps of docs/results/{} are below FLEETYARD_DATA",
                kept.rows
            );
        }
        for number in sample {
            let row = &rows[number];
            let what = match anew(&kept, row) {
                Ok(now) if was_late(row, &now) => {
                    println!("skipped: the machine gave {} no turn", row.values(kept.key));
                    continue;
                }
                Ok(now) => differences(&kept, row, &now).join(", "),
                Err(ended) => format!("it has no row any more:\n{ended}"),
            };
            if !what.is_empty() {
                stale.push(format!(
                    "{} is stale: row {} of docs/results/{} ({}): {what}\n    measure anew: {}",
                    kept.page,
                    number + 2,
                    kept.rows,
                    row.values(kept.key),
                    kept.anew
                ));
            }
        }
    }
    assert!(stale.is_empty(), "{}", stale.join("\n"));
}

#[test]
fn a_row_that_differs_is_told() {
    let kept = Kept {
        key: &["planner"],
        same: &["trace_digest", "limit_s", "nodes"],
        ..LSMART
    };
    let row = |text: &str| {
        parsed(format!("planner,trace_digest,limit_s,nodes\n{text}").as_bytes()).remove(0)
    };
    let old = row("3,ab12,20,");
    // Scripts and stores write numbers each in their own way.
    assert_eq!(differences(&kept, &old, &row("3,ab12,20.0,")), [""; 0]);
    let told = differences(&kept, &old, &row("3,cd34,10.0,50"));
    let all = [
        "trace_digest ab12 is cd34 now",
        "limit_s 20 is 10.0 now",
        "nodes  is 50 now",
    ];
    assert_eq!(told, all);
    // The sample is that of the seed, and each file has its own.
    assert_eq!(order("a.csv", 50), order("a.csv", 50));
    assert_ne!(order("a.csv", 50), order("b.csv", 50));
}

//! Stores as the subject of a report.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use fleetyard_core::{InputError, read_file};

use super::Subject;
use crate::evaluate::Order;
use crate::export::rfc3339;
use crate::{Places, Row, Store};

/// The largest manifest that is shown, in bytes.
const MANIFEST_LIMIT: u64 = 16 << 20;

/// The trials of stores, and what they are about.
#[derive(Debug)]
pub struct Loaded {
    /// The subject of their report.
    pub subject: Subject,
    /// The trials, of which each has a key of its own.
    pub rows: Vec<Row>,
    /// Trials that are in several stores.
    pub doubled: u64,
}

impl Loaded {
    /// Reads stores; where several have a trial, the last one's is taken. `rank` goes before the order that a
    /// suite says.
    pub fn load(stores: &[PathBuf], rank: Option<Order>) -> Result<Self, InputError> {
        let mut rows: BTreeMap<String, Row> = BTreeMap::new();
        let mut subject = Subject::default();
        let (mut order, mut unit) = (None, None);
        let mut doubled = 0;
        let mut machines = BTreeMap::new();
        let mut titles: Vec<String> = Vec::new();
        let mut asked = Some(0);
        for path in stores {
            let store = Store::open_read_only(path)?;
            let meta = store.meta()?;
            let values: serde_json::Value =
                serde_json::from_str(&meta.suite_values).unwrap_or_default();
            let found = store.rows()?;
            subject.facts.push((
                "store".to_owned(),
                format!("{}, {} trials", file_name(path), found.len()),
            ));
            for row in found {
                subject.stores.insert(row.key.clone(), path.clone());
                if rows.insert(row.key.clone(), row).is_some() {
                    doubled += 1;
                }
            }
            if !titles.contains(&meta.suite) {
                titles.push(meta.suite.clone());
                asked = asked.zip(meta.asked).map(|(sum, more)| sum + more);
                let created = rfc3339(meta.created_unix_ms);
                subject.facts.extend([
                    ("suite".to_owned(), meta.suite.clone()),
                    ("suite digest".to_owned(), meta.suite_digest.clone()),
                    ("fleetyard".to_owned(), meta.fleetyard.clone()),
                    ("begun".to_owned(), created),
                ]);
                let name = format!("Suite {}", meta.suite);
                subject.texts.push((name, meta.suite_text.clone()));
                if subject.description.is_none() {
                    let text = values["description"].as_str();
                    subject.description = text.map(str::to_owned);
                }
                let Places {
                    scenarios,
                    tasks,
                    planners,
                    ..
                } = meta.places;
                subject.places.scenarios.extend(scenarios);
                subject.places.tasks.extend(tasks);
                subject.places.planners.extend(planners);
                let rule = values["protocol"]["path_rule"].as_str();
                subject.path_rule = rule.filter(|rule| *rule != "steps").map(str::to_owned);
                let ranking = &values["protocol"]["ranking"];
                order = order.or_else(|| serde_json::from_value(ranking.clone()).ok());
                let generalised = &values["protocol"]["generalise_over"];
                unit = unit.or_else(|| serde_json::from_value(generalised.clone()).ok());
            }
            machines.extend(store.machines()?);
            let manifest = path.with_extension("manifest.json");
            if let Ok(bytes) = read_file(&manifest, MANIFEST_LIMIT)
                && let Ok(text) = String::from_utf8(bytes)
            {
                let name = format!("Manifest {}", file_name(&manifest));
                subject.texts.push((name, text));
            }
        }
        let rows: Vec<Row> = rows.into_values().collect();
        subject.asked = asked;
        subject.title = titles.join(", ");
        if subject.title.is_empty() {
            "Trials".clone_into(&mut subject.title);
        }
        subject.order = rank.or(order).unwrap_or_default();
        subject.unit = unit.unwrap_or_default();
        subject.facts.extend(planners(&rows));
        for (digest, description) in machines {
            let name = format!("Machine {}", digest.get(..12).unwrap_or(&digest));
            subject.texts.push((name, description));
        }
        Ok(Self {
            subject,
            rows,
            doubled,
        })
    }
}

/// The code of each planner.
fn planners(rows: &[Row]) -> Vec<(String, String)> {
    let mut found: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    for row in rows {
        let digest = row.planner_digest.as_deref().unwrap_or("no digest");
        let options = match row.options.as_str() {
            "" | "{}" => String::new(),
            options => format!(", {options}"),
        };
        let what = format!(
            "{} {}, {}{options}, {digest}",
            row.planner_id, row.planner_version, row.attach
        );
        let known = found.entry(&row.planner).or_default();
        if !known.contains(&what) {
            known.push(what);
        }
    }
    let fact = |(label, what): (&str, Vec<String>)| (label.to_owned(), what.join("; "));
    found.into_iter().map(fact).collect()
}

fn file_name(path: &Path) -> String {
    path.file_name()
        .unwrap_or(path.as_os_str())
        .to_string_lossy()
        .into_owned()
}

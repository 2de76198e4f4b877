use std::collections::BTreeMap;

use serde::Serialize;

use crate::Row;

/// Something by which instances differ.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Dimension {
    /// Name of the map.
    Map,
    /// Origin of starts and goals.
    Scenario,
    /// Number of agents.
    Agents,
    /// Neighbours of a cell.
    Connectivity,
    /// Algorithm that carved the maze.
    MazeAlgorithm,
    /// Width and height of the maze.
    MazeSize,
    /// Wall-clock budget.
    Budget,
    /// Seed given to planners.
    Seed,
}

/// The level of an instance along a dimension.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Level {
    /// As a number, where it is one; of a maze its width.
    pub number: Option<f64>,
    /// For people.
    pub text: String,
}

impl Dimension {
    /// Every dimension.
    pub const ALL: [Self; 8] = [
        Self::Map,
        Self::Scenario,
        Self::Agents,
        Self::Connectivity,
        Self::MazeAlgorithm,
        Self::MazeSize,
        Self::Budget,
        Self::Seed,
    ];

    /// The level of a trial's instance; `None` where the dimension does not apply.
    pub fn level(self, row: &Row) -> Option<Level> {
        let count = |number: u64| Level {
            number: Some(number as f64),
            text: number.to_string(),
        };
        let name = |text: &String| Level {
            number: None,
            text: text.clone(),
        };
        Some(match self {
            Self::Map => name(&row.map),
            Self::Scenario => name(&row.scenario),
            Self::Agents => count(row.agents),
            Self::Connectivity => count(row.connectivity?.into()),
            Self::MazeAlgorithm => name(row.maze_algorithm.as_ref()?),
            Self::MazeSize => Level {
                number: Some(row.maze_width?.into()),
                text: format!("{}×{}", row.maze_width?, row.maze_height?),
            },
            Self::Budget => Level {
                number: Some(row.budget_ms),
                text: format!("{} ms", row.budget_ms),
            },
            Self::Seed => count(row.seed),
        })
    }
}

impl Eq for Level {}

impl PartialOrd for Level {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Level {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        let number = |level: &Self| level.number.unwrap_or(f64::INFINITY);
        number(self)
            .total_cmp(&number(other))
            .then_with(|| self.text.cmp(&other.text))
    }
}

/// Rows that are alike in some dimensions.
#[derive(Debug, Clone)]
pub struct Group<'a> {
    /// One per dimension that was asked for; `None` where it does not apply.
    pub levels: Vec<Option<Level>>,
    /// In the order given.
    pub rows: Vec<&'a Row>,
}

/// Rows by some dimensions, in order of their levels.
pub fn groups<'a>(rows: impl IntoIterator<Item = &'a Row>, by: &[Dimension]) -> Vec<Group<'a>> {
    let mut found: BTreeMap<Vec<Option<Level>>, Vec<&Row>> = BTreeMap::new();
    for row in rows {
        let levels = by.iter().map(|dimension| dimension.level(row)).collect();
        found.entry(levels).or_default().push(row);
    }
    let group = |(levels, rows)| Group { levels, rows };
    found.into_iter().map(group).collect()
}

/// A filter of rows. An empty list lets everything pass.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Filter {
    /// Labels of planners.
    pub planners: Vec<String>,
    /// Dimensions and the texts of the levels that pass.
    pub levels: Vec<(Dimension, Vec<String>)>,
    /// Only those that may be compared.
    pub ranked_only: bool,
    /// Only those that nobody disturbed.
    pub undisturbed_only: bool,
}

impl Filter {
    /// True if a row passes.
    pub fn keeps(&self, row: &Row) -> bool {
        let among =
            |list: &[String], text: &str| list.is_empty() || list.iter().any(|one| one == text);
        let level = |(dimension, texts): &(Dimension, Vec<String>)| {
            let level = dimension.level(row);
            texts.is_empty() || level.is_some_and(|level| among(texts, &level.text))
        };
        among(&self.planners, &row.planner)
            && self.levels.iter().all(level)
            && (row.ranked || !self.ranked_only)
            && (row.contended.is_empty() || !self.undisturbed_only)
    }
}

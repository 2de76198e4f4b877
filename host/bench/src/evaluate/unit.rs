use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use crate::Row;
use crate::suite::recipe::map_seed_of;

/// The sampling unit to which the results of a suite are generalised: resampling and tests draw and
/// count such units. Seeds and repeats of an instance, team sizes of a scenario and scenarios of a
/// map are alike, and say little more than one of them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Unit {
    /// For other instances of the same maps and scenarios.
    Instances,
    /// For other scenarios of the same maps.
    #[default]
    Scenarios,
    /// For other maps of the same kinds.
    Maps,
}

/// Numbers of instances, scenarios and maps.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Instances, whatever the seed and the budget.
    pub instances: usize,
    /// Scenarios: team sizes of one are nested.
    pub scenarios: usize,
    /// Maps.
    pub maps: usize,
}

impl Unit {
    /// Every unit, by the name that suites give it.
    pub const CHOICES: &[(&str, Self)] = &[
        ("instances", Self::Instances),
        ("scenarios", Self::Scenarios),
        ("maps", Self::Maps),
    ];

    /// As suites name it.
    pub fn name(self) -> &'static str {
        let named = Self::CHOICES.iter().find(|(_, unit)| *unit == self);
        named.map_or("", |(name, _)| name)
    }

    /// Values that rows of one cluster have in common.
    pub(super) fn of(self, row: &Row) -> Vec<&str> {
        let map = [
            row.map.as_str(),
            // Mazes and generated maps of all seeds have one name, and the scenario says which.
            match row.maze_seed {
                Some(_) => row.scenario.as_str(),
                None => map_seed_of(&row.scenario).unwrap_or_default(),
            },
        ];
        match self {
            Self::Instances => vec![row.question()],
            Self::Scenarios => [&map[..], &[&row.scenario]].concat(),
            Self::Maps => map.to_vec(),
        }
    }

    /// The seed, if rows of one cluster have it in common too: the tasks of a fleet are drawn by
    /// it.
    pub(super) fn seed_of(self, row: &Row) -> Option<u64> {
        (self != Self::Maps && row.fleet.is_some()).then_some(row.seed)
    }
}

impl Counts {
    /// Of rows.
    pub(super) fn of(rows: &[&Row]) -> Self {
        let count = |unit: Unit| {
            let clusters = rows.iter().map(|row| (unit.of(row), unit.seed_of(row)));
            clusters.collect::<BTreeSet<_>>().len()
        };
        Self {
            instances: count(Unit::Instances),
            scenarios: count(Unit::Scenarios),
            maps: count(Unit::Maps),
        }
    }
}

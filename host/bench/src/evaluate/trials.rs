use std::borrow::Cow;
use std::collections::BTreeMap;

use super::{Counts, Metric, Unit};
use crate::Row;
use crate::statistics::{Clustered, median, sorted};

/// Trials by planner and instance, repeats brought together. A planner on a view of a task is another
/// planner than on others, and a task is one instance on all of its views.
#[derive(Debug, Clone)]
pub struct Trials<'a> {
    planners: Vec<Planner<'a>>,
    instances: Vec<&'a Row>,
    unit: Unit,
    clusters: usize,
    /// By instance, the number of its map.
    maps: Vec<usize>,
}

/// A planner's cases.
#[derive(Debug, Clone)]
pub struct Planner<'a> {
    /// Its label in the suite; of a view of a task, with the label of the view.
    pub label: Cow<'a, str>,
    /// In the order of instances, at most one for each.
    pub cases: Vec<Case<'a>>,
}

/// A planner on an instance, with a seed and a budget.
#[derive(Debug, Clone)]
pub struct Case<'a> {
    /// Number of the instance in [`Trials::instances`].
    pub instance: usize,
    /// Number of the cluster that the instance is of.
    pub cluster: usize,
    /// At least one trial, in the order of repeats.
    pub repeats: Vec<&'a Row>,
}

impl<'a> Trials<'a> {
    /// Of rows in any order, to speak for other scenarios. Planners and instances are in the
    /// suite's order.
    pub fn new(rows: impl IntoIterator<Item = &'a Row>) -> Self {
        Self::speaking_for(Unit::default(), rows)
    }

    /// Of rows in any order, to speak for others of some unit.
    pub fn speaking_for(unit: Unit, rows: impl IntoIterator<Item = &'a Row>) -> Self {
        let mut rows: Vec<&Row> = rows.into_iter().collect();
        rows.sort_by_key(|row| (row.trial, row.repeat, &row.planner, &row.key));
        let mut instances = Vec::new();
        let (mut clusters, mut cluster_numbers) = (Vec::new(), BTreeMap::new());
        let (mut maps, mut map_numbers) = (Vec::new(), BTreeMap::new());
        let mut instance_numbers = BTreeMap::new();
        let mut planners: Vec<Planner<'_>> = Vec::new();
        let mut planner_numbers = BTreeMap::new();
        let mut cases: BTreeMap<(usize, usize), Vec<&Row>> = BTreeMap::new();
        for row in rows {
            let question = (row.question(), row.seed, row.budget_ms.to_bits());
            let instance = *instance_numbers.entry(question).or_insert_with(|| {
                let next = cluster_numbers.len();
                let cluster = (unit.of(row), unit.seed_of(row));
                clusters.push(*cluster_numbers.entry(cluster).or_insert(next));
                let next = map_numbers.len();
                maps.push(*map_numbers.entry(Unit::Maps.of(row)).or_insert(next));
                instances.push(row);
                instances.len() - 1
            });
            let label = row.entrant();
            let planner = *planner_numbers.entry(label.clone()).or_insert_with(|| {
                let cases = Vec::new();
                planners.push(Planner { label, cases });
                planners.len() - 1
            });
            cases.entry((planner, instance)).or_default().push(row);
        }
        for ((planner, instance), mut repeats) in cases {
            repeats.sort_by_key(|row| (row.repeat, &row.key));
            planners[planner].cases.push(Case {
                instance,
                cluster: clusters[instance],
                repeats,
            });
        }
        Self {
            planners,
            instances,
            unit,
            clusters: cluster_numbers.len(),
            maps,
        }
    }

    /// The unit to which results are generalised.
    pub fn unit(&self) -> Unit {
        self.unit
    }

    /// Number of these units.
    pub fn clusters(&self) -> usize {
        self.clusters
    }

    /// The number of an instance's map.
    pub fn map_of(&self, instance: usize) -> usize {
        self.maps[instance]
    }

    /// The numbers of its cluster and its map of every row, by its key.
    pub fn numbers_by_key(&self) -> BTreeMap<&'a str, [usize; 2]> {
        let mut numbers = BTreeMap::new();
        for case in self.planners.iter().flat_map(|planner| &planner.cases) {
            for row in &case.repeats {
                numbers.insert(row.key.as_str(), [case.cluster, self.map_of(case.instance)]);
            }
        }
        numbers
    }

    /// Numbers of instances, scenarios and maps.
    pub fn counts(&self) -> Counts {
        Counts::of(&self.instances)
    }

    /// Every planner.
    pub fn planners(&self) -> &[Planner<'a>] {
        &self.planners
    }

    /// The planner of that label.
    pub fn planner(&self, label: &str) -> Option<&Planner<'a>> {
        self.planners.iter().find(|planner| planner.label == label)
    }

    /// A row of every instance: what it says of its map, scenario, agents, seed and budget
    /// is true of the instance.
    pub fn instances(&self) -> &[&'a Row] {
        &self.instances
    }

    /// Every row.
    pub fn rows(&self) -> impl Iterator<Item = &'a Row> {
        let cases = self.planners.iter().flat_map(|planner| &planner.cases);
        cases.flat_map(|case| case.repeats.iter().copied())
    }

    /// The attempts of every planner whose trials might be made again, in words; `None` if none were.
    pub fn attempts(&self) -> Option<String> {
        let counts = self.planners.iter();
        let counts = counts.filter_map(|planner| Some((&planner.label, planner.attempts()?)));
        let again = |(_, (trials, attempts)): (_, (u64, u64))| attempts > trials;
        let each = counts
            .clone()
            .map(|(label, (trials, attempts))| format!("{label} {attempts} for {trials}"));
        counts
            .clone()
            .any(again)
            .then(|| each.collect::<Vec<_>>().join(", "))
    }

    /// The shared-success subset: numbers of the instances that every planner solved
    /// (equation 19 of the maze paper).
    pub fn shared(&self) -> Vec<usize> {
        let mut successes = vec![0; self.instances.len()];
        for planner in &self.planners {
            for case in planner.successes() {
                successes[case.instance] += 1;
            }
        }
        let all = self.planners.len();
        (0..successes.len())
            .filter(|instance| successes[*instance] == all)
            .collect()
    }
}

impl<'a> Planner<'a> {
    /// Its case of an instance.
    pub fn case(&self, instance: usize) -> Option<&Case<'a>> {
        let at = self
            .cases
            .binary_search_by_key(&instance, |case| case.instance);
        at.ok().map(|at| &self.cases[at])
    }

    /// Its cases of some instances.
    pub fn of_instances(&self, instances: &[usize]) -> impl Iterator<Item = &Case<'a>> {
        instances.iter().filter_map(|instance| self.case(*instance))
    }

    /// Cases that succeeded.
    pub fn successes(&self) -> impl Iterator<Item = &Case<'a>> {
        self.cases.iter().filter(|case| case.success())
    }

    /// Values of the cases that succeeded and have one, with their clusters.
    pub fn values(&self, metric: &Metric) -> Vec<Clustered> {
        let value = |case: &Case<'_>| Some((case.cluster, case.value(metric)?));
        self.cases.iter().filter_map(value).collect()
    }

    /// The share of repeats that succeeded, of each case with its cluster.
    pub fn shares(&self) -> Vec<Clustered> {
        let share = |case: &Case<'_>| (case.cluster, case.share());
        self.cases.iter().map(share).collect()
    }

    /// Its rows.
    pub fn rows(&self) -> impl Iterator<Item = &'a Row> {
        self.cases
            .iter()
            .flat_map(|case| case.repeats.iter().copied())
    }

    /// The numbers of its trials that might be made again, and of their attempts; `None` if there are
    /// none.
    pub fn attempts(&self) -> Option<(u64, u64)> {
        let attempts = self.rows().filter_map(|row| row.attempts);
        attempts.fold(None, |sum, attempts| {
            let (trials, all) = sum.unwrap_or_default();
            Some((trials + 1, all + u64::from(attempts)))
        })
    }
}

impl Case<'_> {
    /// True if every repeat succeeded.
    pub fn success(&self) -> bool {
        self.repeats.iter().all(|row| row.success)
    }

    /// The share of its repeats that succeeded.
    pub fn share(&self) -> f64 {
        let successes = self.repeats.iter().filter(|row| row.success).count();
        successes as f64 / self.repeats.len().max(1) as f64
    }

    /// The median over repeats, if the case succeeded and every repeat has a value.
    pub fn value(&self, metric: &Metric) -> Option<f64> {
        self.success().then(|| self.any_value(metric)).flatten()
    }

    /// The median over repeats, whether they succeeded or not.
    pub fn any_value(&self, metric: &Metric) -> Option<f64> {
        match self.repeats.as_slice() {
            [row] => metric.of(row),
            rows => {
                let values: Option<Vec<f64>> = rows.iter().map(|row| metric.of(row)).collect();
                median(&sorted(values?))
            }
        }
    }

    /// Place of the first repeat in the suite's order.
    pub fn trial(&self) -> u64 {
        self.repeats.first().map_or(0, |row| row.trial)
    }
}

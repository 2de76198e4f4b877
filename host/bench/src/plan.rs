//! The trials of a suite, and the order in which they are made.
//!
//! Every planner is asked every instance with every seed, as often as the suite repeats it; a view of a
//! task only where it claims the view's representation.
//! Trials of one instance follow each other, so that its map is learnt once. Rounds of planners are
//! the rows of a Williams design ([`in_turn`]): each is first as often as any other, and after any
//! other as often. Warm-ups of an instance come before its trials.
//!
//! A trial is known by its key: a digest of all that its result may depend on. Its number is
//! its place in the suite, by instance, then seed, repeat and planner, whatever the order in
//! which trials are made and however the suite is split.

use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;

use fleetyard_core::{Digest, Hasher};

/// Every trial of a suite.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Schedule {
    planners: Vec<Digest>,
    instances: Vec<Digest>,
    /// For each instance, the number of those before it that have the same digest, which tells
    /// equal ones apart.
    twins: Vec<u64>,
    seeds: Vec<u64>,
    repeats: u32,
    warm_ups: u32,
    /// For each instance the bits of planners that are asked it.
    kinds: Vec<u8>,
    /// By the bits of an instance, the planners that have one of them, in order.
    asked: BTreeMap<u8, Vec<usize>>,
}

/// The bits of an instance that every planner is asked, and of planners that are asked all.
const ANY: u8 = u8::MAX;

/// One trial of a schedule.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Planned {
    /// Its place in the suite.
    pub number: u64,
    /// Index of the planner.
    pub planner: usize,
    /// Index of the instance.
    pub instance: usize,
    /// Seed for the planner.
    pub seed: u64,
    /// Number of the repeat, from 0.
    pub repeat: u32,
}

/// The next thing to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// A planner is asked without being timed.
    WarmUp(Planned),
    /// A trial.
    Trial(Planned),
}

/// A part of a suite: so many of the parts that it was split into.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    /// Its number, from 1.
    index: u64,
    of: u64,
}

impl Schedule {
    /// Of planners and instances by their digests. A planner's stands for its code, its
    /// options, and all of the suite that its results depend on; no two are the same.
    pub fn new(
        planners: Vec<Digest>,
        instances: Vec<Digest>,
        seeds: Vec<u64>,
        repeats: u32,
        warm_ups: u32,
    ) -> Self {
        let mut seen: BTreeMap<Digest, u64> = BTreeMap::new();
        let twins = instances
            .iter()
            .map(|digest| {
                let count = seen.entry(*digest).or_default();
                *count += 1;
                *count - 1
            })
            .collect();
        let kinds = vec![ANY; instances.len()];
        let asked = BTreeMap::from([(ANY, (0..planners.len()).collect())]);
        Self {
            planners,
            instances,
            twins,
            seeds,
            repeats,
            warm_ups,
            kinds,
            asked,
        }
    }

    /// The same, but that an instance is for the planners alone that have one of its bits. Trials keep
    /// the numbers that they have where all are asked everything.
    #[must_use]
    pub fn only(mut self, planners: &[u8], instances: Vec<u8>) -> Self {
        let asked = |kind: u8| -> Vec<usize> {
            let of = |planner: &usize| planners[*planner] & kind != 0;
            (0..planners.len()).filter(of).collect()
        };
        self.asked = instances.iter().map(|kind| (*kind, asked(*kind))).collect();
        self.kinds = instances;
        self
    }

    /// The planners that are asked an instance.
    pub fn asked(&self, instance: usize) -> &[usize] {
        self.asked
            .get(&self.kinds[instance])
            .map_or(&[], Vec::as_slice)
    }

    /// Number of trials, warm-ups aside.
    pub fn len(&self) -> u64 {
        self.len_of(Shard::ALL)
    }

    /// True if there is nothing to do.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Number of trials of every planner on an instance.
    fn rounds(&self) -> u64 {
        self.seeds.len() as u64 * u64::from(self.repeats)
    }

    fn planned(&self, instance: usize, round: u64, planner: usize) -> Planned {
        let repeats = u64::from(self.repeats);
        Planned {
            number: (instance as u64 * self.rounds() + round) * self.planners.len() as u64
                + planner as u64,
            planner,
            instance,
            seed: self.seeds[(round / repeats) as usize],
            repeat: (round % repeats) as u32,
        }
    }

    /// The key of a trial, as 32 hexadecimal digits.
    pub fn key(&self, planned: &Planned) -> String {
        key(
            self.planners[planned.planner],
            self.instances[planned.instance],
            self.twins[planned.instance],
            planned.seed,
            planned.repeat,
        )
    }

    /// The trials of an instance in the order of their numbers.
    pub(crate) fn of_instance(&self, instance: usize) -> impl Iterator<Item = Planned> {
        (0..self.rounds()).flat_map(move |round| {
            let asked = self.asked(instance).iter();
            asked.map(move |planner| self.planned(instance, round, *planner))
        })
    }

    /// All trials in the order of their numbers.
    pub fn trials(&self) -> impl Iterator<Item = Planned> {
        self.trials_of(Shard::ALL)
    }

    /// Digest of all of it: equal suites have equal ones wherever their files are.
    pub fn digest(&self) -> Digest {
        let mut hasher = Hasher::new("fleetyard.schedule/1");
        for digests in [&self.planners, &self.instances] {
            hasher.u64(digests.len() as u64);
            for digest in digests {
                hasher.bytes(&digest.0.to_le_bytes());
            }
        }
        hasher.u64(self.seeds.len() as u64);
        for seed in &self.seeds {
            hasher.u64(*seed);
        }
        hasher.u64(u64::from(self.repeats));
        hasher.finish()
    }

    /// The instances of a shard. They are dealt out one by one: suites often grow from
    /// instance to instance, and so every shard has its share of what is hard.
    fn dealt(&self, shard: Shard) -> impl Iterator<Item = usize> {
        (shard.index - 1..self.instances.len() as u64)
            .step_by(usize::try_from(shard.of).unwrap_or(usize::MAX))
            .map(|instance| instance as usize)
    }

    /// Number of trials that a shard has.
    pub fn len_of(&self, shard: Shard) -> u64 {
        let asked = self.dealt(shard).map(|instance| self.asked(instance).len());
        asked.sum::<usize>() as u64 * self.rounds()
    }

    /// The trials of a shard in the order of their numbers.
    pub fn trials_of(&self, shard: Shard) -> impl Iterator<Item = Planned> {
        self.dealt(shard)
            .flat_map(move |instance| self.of_instance(instance))
    }

    /// The steps of a shard, in order.
    pub fn order(&self, shard: Shard) -> impl Iterator<Item = Step> {
        // Counted within the shard: the planners of a suite may be as many as its shards. Each kind of
        // instances has turns of its own, as its planners do.
        self.dealt(shard)
            .scan(BTreeMap::new(), move |turns, instance| {
                let next: &mut usize = turns.entry(self.kinds[instance]).or_default();
                *next += 1;
                Some((*next - 1, instance))
            })
            .flat_map(move |(turn, instance)| {
                let first = turn + (shard.index - 1) as usize;
                let asked = self.asked(instance);
                let round = move |round: u64, offset: usize| {
                    in_turn(first + offset, asked.len())
                        .map(move |place| self.planned(instance, round, asked[place]))
                };
                let warm_ups = (0..self.warm_ups as usize).flat_map(move |offset| round(0, offset));
                let trials = (0..self.rounds()).flat_map(move |index| round(index, index as usize));
                warm_ups.map(Step::WarmUp).chain(trials.map(Step::Trial))
            })
    }
}

/// The key of a trial; `twins` instances before have the same digest.
pub(crate) fn key(planner: Digest, instance: Digest, twins: u64, seed: u64, repeat: u32) -> String {
    let mut hasher = Hasher::new("fleetyard.trial/1");
    for digest in [planner, instance] {
        hasher.bytes(&digest.0.to_le_bytes());
    }
    hasher.u64(twins);
    hasher.u64(seed);
    hasher.u64(u64::from(repeat));
    hasher.finish().to_string()
}

/// The planners of a round in their order: the row of a Williams design with that number, after whose
/// last row comes the first. Over all rows (as many as planners where that is even, else twice
/// as many) every planner stands at every place, and comes directly after every other, equally often:
/// what a trial leaves behind (caches, clocks, heat) meets nobody more than others.
///
/// Williams, "Experimental designs balanced for the estimation of residual effects of treatments",
/// Australian Journal of Scientific Research A 2 (1949).
fn in_turn(row: usize, planners: usize) -> impl Iterator<Item = usize> {
    // With an odd number each row is needed in reverse as well.
    let reversed = planners % 2 == 1 && (row / planners.max(1)) % 2 == 1;
    (0..planners).map(move |place| {
        let place = if reversed {
            planners - 1 - place
        } else {
            place
        };
        // 0, 1, n − 1, 2, n − 2, …: neighbours differ by every amount.
        let zigzag = if place % 2 == 1 {
            place.div_ceil(2)
        } else {
            planners - place / 2
        };
        (zigzag + row) % planners
    })
}

impl Shard {
    /// The whole.
    pub const ALL: Self = Self { index: 1, of: 1 };

    /// Its number, from 1, and the number of parts.
    pub fn parts(self) -> (u64, u64) {
        (self.index, self.of)
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.of)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split_once('/');
        let parts = parts.and_then(|(index, of)| Some((index.parse().ok()?, of.parse().ok()?)));
        match parts {
            Some((index, of)) if (1..=of).contains(&index) && of <= 1_000_000 => {
                Ok(Self { index, of })
            }
            _ => Err("write I/N, such as 2/8: the second of eight parts".into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use proptest::prelude::*;

    use super::*;

    fn schedule(
        planners: u32,
        instances: u32,
        seeds: u64,
        repeats: u32,
        warm_ups: u32,
    ) -> Schedule {
        Schedule::new(
            (0..planners).map(|index| Digest(index.into())).collect(),
            // Two in a row are the same.
            (0..instances)
                .map(|index| Digest(u128::from(index / 2)))
                .collect(),
            (0..seeds).collect(),
            repeats,
            warm_ups,
        )
    }

    fn timed(schedule: &Schedule, shard: Shard) -> Vec<Planned> {
        let steps = schedule.order(shard);
        steps
            .filter_map(|step| match step {
                Step::Trial(planned) => Some(planned),
                Step::WarmUp(_) => None,
            })
            .collect()
    }

    #[test]
    fn every_planner_is_first_equally_often_and_warmed_up_before() {
        let schedule = schedule(3, 6, 2, 1, 2);
        let steps: Vec<Step> = schedule.order(Shard::ALL).collect();
        assert_eq!(steps.len(), 6 * 3 * (2 + 2));
        for (block, of_instance) in steps.chunks(3 * 4).enumerate() {
            for (index, step) in of_instance.iter().enumerate() {
                let (Step::WarmUp(planned) | Step::Trial(planned)) = step;
                assert_eq!(planned.instance, block);
                assert_eq!(matches!(step, Step::WarmUp(_)), index < 6);
            }
        }
        let trials = timed(&schedule, Shard::ALL);
        let mut first = [0; 3];
        for round in trials.chunks(3) {
            first[round[0].planner] += 1;
            let all: BTreeSet<usize> = round.iter().map(|planned| planned.planner).collect();
            assert_eq!(all.len(), 3);
        }
        assert_eq!(first, [4, 4, 4]);
    }

    /// In an order that merely rotates, a planner comes after the same one nearly always.
    #[test]
    fn every_planner_follows_every_other_equally_often() {
        for planners in 1..=13 {
            let rows = if planners % 2 == 0 {
                planners
            } else {
                2 * planners
            };
            let mut follows = BTreeMap::new();
            let mut stands = BTreeMap::new();
            for row in 0..rows {
                let round: Vec<usize> = in_turn(row, planners).collect();
                for pair in round.windows(2) {
                    *follows.entry((pair[0], pair[1])).or_insert(0) += 1;
                }
                for (place, planner) in round.into_iter().enumerate() {
                    *stands.entry((place, planner)).or_insert(0) += 1;
                }
            }
            let times = rows / planners;
            assert_eq!(stands.len(), planners * planners);
            assert!(
                stands.values().all(|count| *count == times),
                "{planners}: {stands:?}"
            );
            assert_eq!(follows.len(), planners * (planners - 1));
            assert!(
                follows.values().all(|count| *count == times),
                "{planners}: {follows:?}"
            );
        }
        assert_eq!(in_turn(3, 0).count(), 0);
    }

    #[test]
    fn the_order_of_a_shard_rotates_whatever_the_numbers() {
        for (planners, of) in [(12, 12), (12, 11), (4, 2), (3, 5)] {
            let schedule = schedule(planners, planners * of * 2, 1, 1, 0);
            for index in 1..=u64::from(of) {
                let shard = Shard {
                    index,
                    of: of.into(),
                };
                let mut first = vec![0; planners as usize];
                for round in timed(&schedule, shard).chunks(planners as usize) {
                    first[round[0].planner] += 1;
                }
                assert!(
                    first.iter().all(|count| *count == 2),
                    "{planners} {of}: {first:?}"
                );
            }
        }
    }

    #[test]
    fn instances_that_are_not_for_everybody_leave_the_others_out() {
        // The first planner is for grids, the second for both, the third for roadmaps.
        let schedule = schedule(3, 8, 1, 1, 1).only(&[1, 3, 2], [1, 2].repeat(4));
        assert_eq!(schedule.len(), 16);
        assert_eq!(
            (schedule.asked(0), schedule.asked(1)),
            (&[0, 1][..], &[1, 2][..])
        );
        let numbers: Vec<u64> = schedule.trials().map(|planned| planned.number).collect();
        assert_eq!(numbers[..6], [0, 1, 4, 5, 6, 7], "as where all are asked");
        let warm_ups = schedule.order(Shard::ALL).count() as u64 - schedule.len();
        assert_eq!(warm_ups, 16);
        let mut first = BTreeMap::new();
        for round in timed(&schedule, Shard::ALL).chunks(2) {
            assert_eq!(round[0].instance, round[1].instance);
            *first
                .entry((round[0].instance % 2, round[0].planner))
                .or_insert(0) += 1;
        }
        let each = [(0, 0), (0, 1), (1, 1), (1, 2)];
        assert_eq!(first, each.map(|key| (key, 2)).into());
        // Nobody has the kind: there is nothing to do.
        assert!(super::Schedule::only(schedule, &[1, 1, 1], vec![2; 8]).is_empty());
    }

    #[test]
    fn shards_are_read_and_refused() {
        assert_eq!("2/8".parse(), Ok(Shard { index: 2, of: 8 }));
        for wrong in [
            "0/8",
            "9/8",
            "1",
            "/",
            "1/0",
            "a/b",
            "-1/2",
            "1/2/3",
            "1/9999999",
        ] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
    }

    proptest! {
        #[test]
        fn shards_together_are_the_whole(
            planners in 1u32..5, instances in 0u32..12, seeds in 1u64..3, repeats in 1u32..3,
            of in 1u64..9,
        ) {
            let schedule = schedule(planners, instances, seeds, repeats, 1);
            let all: Vec<Planned> = schedule.trials().collect();
            prop_assert_eq!(all.len() as u64, schedule.len());
            for (number, planned) in all.iter().enumerate() {
                prop_assert_eq!(planned.number, number as u64);
            }
            let keys: BTreeSet<String> = all.iter().map(|planned| schedule.key(planned)).collect();
            prop_assert_eq!(keys.len(), all.len(), "keys are all different");
            let mut parts = Vec::new();
            for index in 1..=of {
                let shard = Shard { index, of };
                let part = timed(&schedule, shard);
                prop_assert_eq!(part.len() as u64, schedule.len_of(shard));
                parts.extend(part);
            }
            parts.sort_by_key(|planned| planned.number);
            prop_assert_eq!(parts, all);
        }
    }
}

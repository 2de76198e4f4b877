//! The statistics against published values and against SciPy.

use fleetyard_testkit::python;
use std::collections::BTreeMap;

use fleetyard_bench::statistics::{
    BOOTSTRAP_SEED, Clustered, Interval, RESAMPLES, Summary, Survival, Time, bayesian_signed_rank,
    bootstrap_clusters, cluster_means, clustered_mean_interval, clustered_share_interval, holm,
    kendall_tau_b, log_rank_test, mean_interval, median, median_interval, paired_rate_difference,
    quantile, sign_flip_test, sign_test, sorted, standard_deviation, wilson,
};
use fleetyard_world::SeededRandom;
use serde_json::{Value, json};

fn close(found: f64, wanted: f64, relative: f64) {
    let error = (found - wanted).abs();
    assert!(
        error <= relative * wanted.abs().max(f64::MIN_POSITIVE),
        "{found:e} is not {wanted:e}"
    );
}

#[test]
fn the_sign_test_gives_published_values() {
    // Arbuthnott, "An argument for divine providence" (1710): more boys than girls were
    // christened in each of 82 years; one chance in 4.836 · 10²⁴, here on two sides.
    close(sign_test(82, 0), 2.0 / 4.835_703_278_458_517e24, 1e-15);
    // The maze paper, Table IV, before correction.
    close(sign_test(50, 0), 1.776_356_839_400_250_5e-15, 1e-15);
    // 2·(1 + 50 + 1225)/2⁵⁰.
    close(sign_test(2, 48), 2.0 * 1276.0 / 2f64.powi(50), 1e-15);
    close(sign_test(2, 8), 0.109_375, 1e-15);
    close(sign_test(5, 5), 1.0, 0.0);
    close(sign_test(0, 0), 1.0, 0.0);
}

#[test]
fn the_sign_test_takes_a_million_pairs() {
    // Normal approximation with continuity correction for 3σ: z = (2·1500 − 1)/√10⁶ = 2.999.
    close(sign_test(501_500, 498_500), 0.002_708_7, 1e-3);
    close(sign_test(1_000_000, 0), 0.0, 0.0);
    let almost_even = sign_test(500_001, 500_000);
    assert!((0.998..=1.0).contains(&almost_even), "{almost_even}");
    // 2/2¹⁰⁷⁴ is twice the smallest number there is.
    close(sign_test(1074, 0), 1e-323, 0.0);
}

#[test]
fn holm_gives_published_values() {
    // The maze paper, Table IV: ten comparisons 50/0 and one 48/2.
    let mut raw = vec![sign_test(50, 0); 11];
    raw[2] = sign_test(48, 2);
    let adjusted = holm(&raw);
    for (at, p) in adjusted.iter().enumerate() {
        let wanted = if at == 2 { 2.27e-12 } else { 1.95e-14 };
        close(*p, wanted, 0.005);
    }
    // Monotone: what comes later is never smaller. R's p.adjust gives the same.
    let adjusted = holm(&[0.01, 0.04, 0.03, 0.005]);
    for (found, wanted) in adjusted.iter().zip([0.03, 0.06, 0.06, 0.02]) {
        close(*found, wanted, 1e-12);
    }
    assert_eq!(holm(&[0.9, 0.8]), [1.0, 1.0]);
    assert_eq!(holm(&[]), [0.0; 0]);
}

#[test]
fn wilson_gives_published_values() {
    // Newcombe, "Two-sided confidence intervals for the single proportion" (1998), Table I,
    // method 3.
    for (successes, trials, low, high) in [
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0, 0.1611),
        (1, 29, 0.0061, 0.1718),
    ] {
        let found = wilson(successes, trials).unwrap();
        assert!((found.low - low).abs() < 5e-5, "{found:?}");
        assert!((found.high - high).abs() < 5e-5, "{found:?}");
    }
    for trials in 1..200 {
        let (none, all) = (wilson(0, trials).unwrap(), wilson(trials, trials).unwrap());
        assert_eq!(
            (none.low.to_bits(), all.high.to_bits()),
            (0, 1.0f64.to_bits())
        );
        assert!(none.high < 1.0 && all.low > 0.0);
    }
    assert_eq!(wilson(0, 0), None);
}

#[test]
fn the_interval_of_the_mean_gives_published_values() {
    // The sleep data of Student (1908), as R's `t.test` prints them.
    let extra_sleep = [1.2, 2.4, 1.3, 1.3, 0.0, 1.0, 1.8, 0.8, 4.6, 1.4];
    let found = mean_interval(&extra_sleep).unwrap();
    assert!((found.low - 0.700_114_2).abs() < 1e-7, "{found:?}");
    assert!((found.high - 2.459_885_8).abs() < 1e-7, "{found:?}");
}

#[test]
fn quantiles_are_of_type_seven() {
    let values = sorted([15.0, 20.0, 35.0, 40.0, 50.0].into_iter().rev());
    assert_eq!(quantile(&values, 0.4), Some(29.0));
    assert_eq!(quantile(&values, 0.0), Some(15.0));
    assert_eq!(quantile(&values, 1.0), Some(50.0));
    assert_eq!(median(&sorted([4.0, 1.0, 3.0, 2.0])), Some(2.5));
}

#[test]
fn kendall_counts_ties() {
    // The example of scipy.stats.kendalltau.
    let tau = kendall_tau_b(&[12.0, 2.0, 1.0, 12.0, 2.0], &[1.0, 4.0, 7.0, 1.0, 0.0]);
    close(tau.unwrap(), -0.471_404_520_791_031_73, 1e-15);
    assert_eq!(
        kendall_tau_b(&[1.0, 2.0, 3.0], &[3.0, 2.0, 1.0]),
        Some(-1.0)
    );
    assert_eq!(kendall_tau_b(&[1.0, 2.0], &[3.0, 3.0]), None);
    assert_eq!(kendall_tau_b(&[1.0, 2.0], &[3.0]), None);
    assert_eq!(kendall_tau_b(&[], &[]), None);
}

#[test]
fn what_has_no_answer_has_none() {
    assert_eq!(Summary::of(&[]), None);
    let one = Summary::of(&[3.5]).unwrap();
    assert_eq!((one.mean, one.median, one.p95), (3.5, 3.5, 3.5));
    assert_eq!((one.standard_deviation, one.mean_interval), (None, None));
}

#[test]
fn paired_rates_give_published_values() {
    // Newcombe, "Improved confidence intervals for the difference between binomial proportions based on
    // paired data" (1998), Table II, method 10.
    let (difference, interval) = paired_rate_difference(36, 12, 2, 0).unwrap();
    close(difference, 0.2, 1e-12);
    assert!((interval.low - 0.0569).abs() < 5e-5, "{interval:?}");
    assert!((interval.high - 0.3404).abs() < 5e-5, "{interval:?}");
    // Where neither and both solve many, pairs agree more often than by chance, and are corrected for
    // continuity. The second is of Cavo et al. (2012) in Fagerland, Lydersen and Laake, "Statistical
    // analysis of contingency tables" (2017), section 8.6; and both sides are each other's mirror.
    for (counts, difference, low, high) in [
        ((20, 12, 2, 16), 0.2, 0.0562, 0.3292),
        ((59, 6, 16, 80), -0.0621, -0.1186, -0.0046),
        ((18, 14, 0, 18), 0.28, 0.1441, 0.3963),
        ((1, 1, 7, 12), -0.2857, -0.5069, -0.0256),
        ((53, 16, 0, 0), 0.2319, 0.1329, 0.3440),
    ] {
        let (both, first, second, neither) = counts;
        let found = paired_rate_difference(both, first, second, neither).unwrap();
        let mirror = paired_rate_difference(both, second, first, neither).unwrap();
        for (found, wanted) in [
            (found.0, difference),
            (found.1.low, low),
            (found.1.high, high),
            (-mirror.0, difference),
            (-mirror.1.high, low),
            (-mirror.1.low, high),
        ] {
            assert!((found - wanted).abs() < 5e-5, "{counts:?}: {found}");
        }
    }
    // Two that never agree: as far apart as the ends of Wilson's interval of 1 of 2 are, on either side.
    let (difference, interval) = paired_rate_difference(0, 1, 1, 0).unwrap();
    let half = wilson(1, 2).unwrap();
    assert!(difference.abs() < 1e-12);
    close(interval.high, half.high - half.low, 1e-12);
    close(interval.low, half.low - half.high, 1e-12);
    // Who solve the same cases differ by nothing, and by no more than their rates may be off.
    let (difference, interval) = paired_rate_difference(50, 0, 0, 0).unwrap();
    assert!(
        difference == 0.0 && interval.low < 0.0 && interval.high > 0.0,
        "{interval:?}"
    );
    assert_eq!(paired_rate_difference(0, 0, 0, 0), None);
}

#[test]
fn the_interval_of_a_median_is_exact() {
    // From binomial tails, as SciPy 1.17 has them.
    for (n, k, coverage) in [
        (6, 1, 0.968_75),
        (9, 2, 0.960_937_5),
        (20, 6, 0.958_610_534_667_968_8),
        (100, 40, 0.964_799_799_782_295_1),
    ] {
        let values: Vec<f64> = (1..=n).map(f64::from).collect();
        let (found, share) = median_interval(&values).unwrap();
        assert_eq!(
            found,
            Interval {
                low: f64::from(k),
                high: f64::from(n + 1 - k)
            }
        );
        close(share, coverage, 1e-12);
    }
    // "95 %" of so few values would cover 49 % with two of them.
    for n in 0..6 {
        assert_eq!(median_interval(&vec![1.0; n]), None);
    }
}

#[test]
fn clusters_count_and_not_what_is_in_them() {
    let clusters = [1.0, 2.0, 4.0, 8.0, 3.0, 5.0, 6.0];
    let mean_of = |copies: usize| {
        bootstrap_clusters(clusters.len(), 4_000, 1, |drawn| {
            let values = || clusters.iter().zip(drawn);
            let sum: f64 = values()
                .map(|(value, times)| value * f64::from(*times) * copies as f64)
                .sum();
            Some(sum / (drawn.iter().sum::<u32>() as usize * copies) as f64)
        })
    };
    let one = mean_of(1).unwrap();
    // Of all 7⁷ resamples.
    let (low, high) = (18.0 / 7.0, 41.0 / 7.0);
    assert!(
        (one.low - low).abs() < 0.15 && (one.high - high).abs() < 0.15,
        "{one:?}"
    );
    assert_eq!(mean_of(1), Some(one), "drawn by a seed");
    // Values that repeat within clusters say nothing more.
    let twenty = mean_of(20).unwrap();
    close(twenty.low, one.low, 1e-12);
    close(twenty.high, one.high, 1e-12);
    assert_eq!(bootstrap_clusters(5, 100, 1, |_| Some(1.0)), None);
}

#[test]
fn sign_flips_give_exact_values() {
    // scipy.stats.permutation_test (1.17), all flips.
    let differences = [0.3, -0.1, 0.25, 0.4, 0.05, 0.12, -0.02, 0.33];
    let p = |values: &[f64]| sign_flip_test(values, 1);
    close(p(&differences).unwrap(), 0.054_687_5, 1e-12);
    // Six clusters of one sign are the fewest that can be below 5 %.
    assert_eq!(p(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]), Some(2.0 / 64.0));
    assert_eq!(p(&[1.0; 5]), None);
    assert_eq!(p(&[0.0; 6]), Some(1.0));
    // Where all have one size it is the sign test, and what is zero does not count.
    let many = |size: fn(u32) -> f64| -> Vec<f64> {
        let sign = |at: u32| if at.is_multiple_of(3) { -1.0 } else { 1.0 };
        (0..24).map(|at| sign(at) * size(at)).collect()
    };
    let wanted = sign_test(16, 8);
    let mut same = many(|_| 0.3);
    same.extend([0.0; 5]);
    assert_eq!(p(&same), Some(wanted));
    // Drawn above twenty: as all flips say, to the error of drawing, and never zero.
    let uneven = many(|at| f64::from(1 + at % 5));
    let seen = uneven.iter().sum::<f64>().abs();
    let mut ways = BTreeMap::from([(0, 1.0)]);
    for size in &uneven {
        let mut next: BTreeMap<i64, f64> = BTreeMap::new();
        for (sum, count) in ways {
            for flipped in [sum + *size as i64, sum - *size as i64] {
                *next.entry(flipped).or_default() += count / 2.0;
            }
        }
        ways = next;
    }
    let far = ways.iter().filter(|(sum, _)| sum.abs() as f64 >= seen);
    let wanted: f64 = far.map(|(_, share)| share).sum();
    let found = p(&uneven).unwrap();
    assert!((found - wanted).abs() < 0.01, "{found} is not {wanted}");
    let all: Vec<f64> = (0..40).map(|at| 1.0 + f64::from(at)).collect();
    assert!(p(&all).unwrap() > 0.0 && p(&all).unwrap() < 1e-4);
    // No flip is nearer to zero than zero.
    let even: Vec<f64> = (1..=12)
        .flat_map(|at| [f64::from(at), -f64::from(at)])
        .collect();
    assert_eq!(p(&even), Some(1.0));
    // Every sign is drawn by itself: two that outweigh all others are alike in a half of the draws, and
    // the others add to them in a half of these.
    for (one, other) in [
        (0, 1),
        (0, 64),
        (63, 127),
        (64, 128),
        (64, 129),
        (65, 130),
        (1, 139),
    ] {
        let small =
            |at: usize| (1.0 + (at % 5) as f64) * if at.is_multiple_of(2) { 1e-3 } else { -1e-3 };
        let mut values: Vec<f64> = (0..140).map(small).collect();
        (values[one], values[other]) = (100.0, 100.0);
        let found = p(&values).unwrap();
        assert!((found - 0.25).abs() < 0.08, "{one} and {other}: {found}");
    }
}

#[test]
fn intervals_count_clusters() {
    let values = [3.1, 2.7, 4.4, 3.9, 2.2, 5.0, 3.3];
    let single: Vec<Clustered> = values.iter().copied().enumerate().collect();
    let student = mean_interval(&values).unwrap();
    let ends = |found: Interval, wanted: Interval| {
        close(found.low, wanted.low, 1e-12);
        close(found.high, wanted.high, 1e-12);
    };
    // With one value in each cluster they are those of values.
    ends(clustered_mean_interval(&single).unwrap(), student);
    assert_eq!(cluster_means(&single), values);
    let solved: Vec<Clustered> = (0..20)
        .map(|at| (at, f64::from(u8::from(at < 17))))
        .collect();
    ends(
        clustered_share_interval(&solved).unwrap(),
        wilson(17, 20).unwrap(),
    );
    // Copies of what is there add nothing.
    let copied = |values: &[Clustered]| -> Vec<Clustered> {
        let copies = values.iter().flat_map(|value| [*value; 9]);
        copies.collect()
    };
    ends(clustered_mean_interval(&copied(&single)).unwrap(), student);
    ends(
        clustered_share_interval(&copied(&solved)).unwrap(),
        wilson(17, 20).unwrap(),
    );
    // Seven clusters of one, one, … and four values: by hand.
    let mut uneven = single.clone();
    uneven.extend([(6, 4.3), (6, 4.1), (6, 4.7)]);
    let mean = uneven.iter().map(|one| one.1).sum::<f64>() / 10.0;
    let mut sums = values.map(|value| value - mean);
    sums[6] += 4.3 + 4.1 + 4.7 - 3.0 * mean;
    let squares: f64 = sums.iter().map(|sum| sum * sum).sum();
    let half = 2.446_911_851_144_969_7 * (7.0 / 6.0 * squares).sqrt() / 10.0;
    let wanted = Interval {
        low: mean - half,
        high: mean + half,
    };
    ends(clustered_mean_interval(&uneven).unwrap(), wanted);
    // Under six there is none.
    assert_eq!(clustered_mean_interval(&single[..5]), None);
    assert_eq!(clustered_share_interval(&solved[..5]), None);
}

/// Freireich et al., Blood 21 (1963): weeks in remission with 6-MP and with placebo, as in every
/// textbook on the subject.
fn remissions() -> [Vec<Time>; 2] {
    let treated = [
        (6, 1),
        (6, 1),
        (6, 1),
        (6, 0),
        (7, 1),
        (9, 0),
        (10, 1),
        (10, 0),
        (11, 0),
        (13, 1),
        (16, 1),
        (17, 0),
        (19, 0),
        (20, 0),
        (22, 1),
        (23, 1),
        (25, 0),
        (32, 0),
        (32, 0),
        (34, 0),
        (35, 0),
    ];
    let placebo = [
        1, 1, 2, 2, 3, 4, 4, 5, 5, 8, 8, 8, 8, 11, 11, 12, 12, 15, 17, 22, 23,
    ];
    let time = |(weeks, ended): (i32, i32)| Time {
        value: f64::from(weeks),
        ended: ended == 1,
    };
    [
        treated.into_iter().map(time).collect(),
        placebo.into_iter().map(|weeks| time((weeks, 1))).collect(),
    ]
}

#[test]
fn survival_gives_published_values() {
    let [treated, placebo] = remissions();
    let survival = Survival::of(&treated);
    let found: Vec<(f64, f64)> = survival
        .steps
        .iter()
        .map(|step| (step.time, step.survival))
        .collect();
    // lifelines 0.30.3, KaplanMeierFitter.
    let wanted = [
        (6.0, 0.857_143),
        (7.0, 0.806_723),
        (10.0, 0.752_941),
        (13.0, 0.690_196),
        (16.0, 0.627_451),
        (22.0, 0.537_815),
        (23.0, 0.448_179),
    ];
    assert_eq!(found.len(), wanted.len());
    for (found, wanted) in found.iter().zip(wanted) {
        close(found.0, wanted.0, 0.0);
        close(found.1, wanted.1, 1e-5);
    }
    // lifelines' restricted_mean_survival_time.
    close(
        survival.restricted_mean(20.0).0,
        16.116_526_610_644_254,
        1e-9,
    );
    close(
        survival.restricted_mean(30.0).0,
        21.046_498_599_439_77,
        1e-9,
    );
    // lifelines' logrank_test: χ² = 16.7929.
    close(
        log_rank_test(&treated, &placebo),
        4.168_809_109_334_511e-5,
        1e-9,
    );
    close(
        log_rank_test(&placebo, &treated),
        4.168_809_109_334_511e-5,
        1e-9,
    );
    close(log_rank_test(&placebo, &placebo), 1.0, 1e-12);
}

#[test]
fn without_censoring_the_restricted_mean_is_the_mean() {
    let [_, placebo] = remissions();
    let capped: Vec<f64> = placebo.iter().map(|time| time.value.min(20.0)).collect();
    let n = capped.len() as f64;
    let mean = capped.iter().sum::<f64>() / n;
    let variance = capped
        .iter()
        .map(|value| (value - mean).powi(2))
        .sum::<f64>()
        / n;
    let (found, interval) = Survival::of(&placebo).restricted_mean(20.0);
    close(found, mean, 1e-12);
    // Greenwood's variance is then that of the values, divided by n.
    close(
        interval.high - found,
        1.959_963_984_540_054 * (variance / n).sqrt(),
        1e-9,
    );
    // Everybody ended within the budget, as is usual: after the last end nothing is unsure.
    let ended = [3.0, 1.0, 2.0].map(|value| Time { value, ended: true });
    let (found, interval) = Survival::of(&ended).restricted_mean(10.0);
    close(found, 2.0, 1e-12);
    let half = 1.959_963_984_540_054 * (2.0f64 / 3.0 / 3.0).sqrt();
    close(interval.low, 2.0 - half, 1e-9);
    close(interval.high, 2.0 + half, 1e-9);
    // What ends at the moment itself has not ended before it.
    close(Survival::of(&ended).restricted_mean(3.0).0, 2.0, 1e-12);
    close(Survival::of(&ended).restricted_mean(0.5).0, 0.5, 1e-12);
    // Nobody ended: all that is known is the budget.
    let stopped = [Time {
        value: 5.0,
        ended: false,
    }; 3];
    let (found, interval) = Survival::of(&stopped).restricted_mean(5.0);
    assert_eq!(
        (found, interval),
        (
            5.0,
            Interval {
                low: 5.0,
                high: 5.0
            }
        )
    );
    close(log_rank_test(&stopped, &stopped), 1.0, 0.0);
}

#[test]
fn the_bayesian_signed_rank_test_gives_values_of_baycomp() {
    let differences = [0.3, -0.1, 0.25, 0.4, 0.05, 0.12, -0.02, 0.33, 0.21, 0.5];
    // baycomp 1.0.3, SignedRankTest with 200,000 draws.
    for (rope, below, equivalent, above) in [
        (0.0, 0.001, 0.0, 0.999),
        (0.1, 0.0, 0.0526, 0.9474),
        (0.2, 0.0, 0.5347, 0.4653),
    ] {
        let found = bayesian_signed_rank(&differences, rope, 50_000, 1).unwrap();
        let wanted = [below, equivalent, above];
        for (found, wanted) in [found.below, found.equivalent, found.above]
            .iter()
            .zip(wanted)
        {
            assert!(
                (found - wanted).abs() < 0.01,
                "{rope}: {found} is not {wanted}"
            );
        }
    }
    assert_eq!(bayesian_signed_rank(&[], 0.1, 100, 1), None);
    assert_eq!(bayesian_signed_rank(&differences, 0.1, 0, 1), None);
    // The other way round it is the mirror, with the same draws.
    let mirrored = differences.map(|difference| -difference);
    let found = bayesian_signed_rank(&differences, 0.2, 2000, 1).unwrap();
    let mirror = bayesian_signed_rank(&mirrored, 0.2, 2000, 1).unwrap();
    assert!(found.above > 0.4 && found.equivalent > 0.4);
    close(mirror.below, found.above, 1e-12);
    close(mirror.equivalent, found.equivalent, 1e-12);
    let sum = found.below + found.equivalent + found.above;
    close(sum, 1.0, 1e-12);
    // One difference of 1 beside the zero, with the weight v of Beta(1, ½): its mean with itself, which
    // counts v², is above 0.75 and no other, and v² is more than a half in √(1 − √½) of the draws.
    let one = bayesian_signed_rank(&[1.0], 0.75, 50_000, 1).unwrap();
    let wanted = (1.0 - 0.5f64.sqrt()).sqrt();
    assert!((one.above - wanted).abs() < 0.01, "{one:?}");
    // Its mean with the zero is on the edge, and counts half: v² + v(1 − v) is above a half in √½.
    let edge = bayesian_signed_rank(&[1.0], 0.5, 50_000, 1).unwrap();
    assert!((edge.above - 0.5f64.sqrt()).abs() < 0.01, "{edge:?}");
}

#[test]
fn scipy_says_the_same() {
    let mut random = SeededRandom::new("samples", 3);
    let mut sample = |n: usize, step: f64| -> Vec<f64> {
        let value = |x: f64| {
            if step > 0.0 {
                (x / step).round() * step
            } else {
                x
            }
        };
        (0..n).map(|_| value(-random.unit().ln() * 10.0)).collect()
    };
    // Skewed ones of several sizes, and one with many ties.
    let samples: Vec<Vec<f64>> = [
        (2, 0.0),
        (3, 0.0),
        (10, 0.0),
        (50, 0.0),
        (51, 0.0),
        (1000, 0.0),
        (40, 4.0),
    ]
    .into_iter()
    .map(|(n, step)| sample(n, step))
    .collect();
    let pairs: Vec<[Vec<f64>; 2]> = [(5, 0.0), (12, 0.0), (30, 5.0)]
        .into_iter()
        .map(|(n, step)| [sample(n, step), sample(n, step)])
        .collect();
    let counts = [
        (0u64, 1u64),
        (1, 1),
        (3, 9),
        (20, 31),
        (0, 50),
        (48, 2),
        (700, 800),
        (100, 4000),
    ];
    let questions = json!({"samples": samples, "pairs": pairs, "counts": counts});
    let script = include_str!("statistics.py");
    let Some(answers) = python::run("scipy", script, questions.to_string().as_bytes()) else {
        return;
    };
    let answers: Value = serde_json::from_slice(&answers).unwrap();
    let numbers = |value: &Value| -> Vec<f64> { serde_json::from_value(value.clone()).unwrap() };

    for (counts, answer) in counts.iter().zip(answers["counts"].as_array().unwrap()) {
        let answer = numbers(answer);
        close(sign_test(counts.0, counts.1), answer[0], 1e-11);
        let interval = wilson(counts.0, counts.0 + counts.1).unwrap();
        assert!((interval.low - answer[1]).abs() < 1e-12);
        assert!((interval.high - answer[2]).abs() < 1e-12);
    }
    for (pair, answer) in pairs.iter().zip(answers["pairs"].as_array().unwrap()) {
        close(
            kendall_tau_b(&pair[0], &pair[1]).unwrap(),
            answer.as_f64().unwrap(),
            1e-12,
        );
    }
    for (sample, answer) in samples.iter().zip(answers["samples"].as_array().unwrap()) {
        let summary = Summary::of(sample).unwrap();
        let interval = summary.mean_interval.unwrap();
        let found = [
            summary.mean,
            standard_deviation(sample).unwrap(),
            summary.q1,
            summary.median,
            summary.q3,
            summary.p95,
            interval.low,
            interval.high,
        ];
        for (found, wanted) in found.into_iter().zip(numbers(&answer["summary"])) {
            assert!(
                (found - wanted).abs() < 1e-9 * wanted.abs().max(1.0),
                "{found} {wanted}"
            );
        }
        // Two seeds differ by chance, by a few percent of the interval.
        let found = bootstrap_clusters(sample.len(), RESAMPLES, BOOTSTRAP_SEED, |drawn| {
            let terms = sample.iter().zip(drawn);
            let sum: f64 = terms.map(|(value, times)| value * f64::from(*times)).sum();
            Some(sum / sample.len() as f64)
        });
        let Some(found) = found else {
            continue;
        };
        for (end, wanted) in [found.low, found.high]
            .into_iter()
            .zip(numbers(&answer["mean"]))
        {
            assert!(
                (end - wanted).abs() <= 0.03 * (found.high - found.low),
                "{end} {wanted}"
            );
        }
    }
}

//! The sentences of a report: what was run, who is best, and what to be careful with.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use fleetyard_fleet::differ;

use super::Subject;
use super::figures::size_of;
use super::format::{digits, grouped, probability};
use super::table::{plural, share};
use crate::evaluate::{
    Evaluation, Lead, Level, Order, Overview, Planner, Ranked, Ranking, Rival, Standing, Trials,
    Unit, common_levels, rank,
};
use crate::row::Row;
use crate::statistics::{MIN_CLUSTERS, quantile, sorted};
use crate::suite::Clock;

/// The first sentences of a report.
pub(super) fn story(subject: &Subject, evaluation: &Evaluation) -> Vec<String> {
    let overview = &evaluation.overview;
    let mut story = Vec::new();
    if overview.trials == 0 {
        story.push("There are no trials.".to_owned());
        return story;
    }
    let repeats = match (overview.repeats_min, overview.repeats_max) {
        (1, 1) => "once each".to_owned(),
        (least, most) if least == most => format!("{most} times each"),
        (least, most) => format!("{least} to {most} times each"),
    };
    let ran = format!(
        "{} on {}, {repeats}: {}.",
        plural(overview.planners, "planner"),
        problems(overview),
        plural(overview.trials, "trial"),
    );
    // A ranking of a part looks like one of the whole.
    let missing = subject
        .asked
        .map_or(0, |asked| asked.saturating_sub(overview.trials as u64));
    let missing = match missing {
        0 => String::new(),
        missing => format!(
            "{} of {} trials were not run, and count for nobody. ",
            grouped(missing),
            grouped(overview.trials as u64 + missing)
        ),
    };
    story.push(format!("{missing}{ran} {}", best(evaluation)));
    let description = subject.description.as_deref().map(str::trim);
    story.extend(
        description
            .filter(|text| !text.is_empty())
            .map(str::to_owned),
    );
    if overview.planners > 1 {
        story.push(format!(
            "Ranked in {}: {}.{}",
            order_name(evaluation.ranking.order),
            evaluation
                .ranking
                .order
                .description(evaluation.ranking.by_expansions),
            if evaluation.ranking.by_expansions {
                ""
            } else {
                " Expansions are left out: those of a planner that is no part of the host are its \
                 claim."
            }
        ));
    }
    story
}

/// The name of an order.
pub(super) fn order_name(order: Order) -> &'static str {
    match order {
        Order::Text => "the order of the maze paper's text",
        Order::Appendix => "the order of the maze paper's appendix (equation 23)",
    }
}

/// Planners that are named where tests do not put the first before them.
const NAMED: usize = 3;

/// The instances, with what they are of.
fn problems(overview: &Overview) -> String {
    let counts = overview.counts;
    let mut text = plural(counts.instances, "instance");
    if overview.instances > counts.instances {
        let _ = write!(
            text,
            " ({} with seeds and budgets)",
            grouped(overview.instances as u64)
        );
    }
    let of = [(counts.scenarios, "scenario"), (counts.maps, "map")];
    for (count, word) in of {
        let _ = write!(text, ", {}", plural(count, word));
    }
    let _ = write!(
        text,
        " (intervals and tests count {})",
        overview.unit.name()
    );
    text
}

/// One of what trials are to speak for.
fn one_of(unit: Unit) -> &'static str {
    match unit {
        Unit::Instances => "instance",
        Unit::Scenarios => "scenario",
        Unit::Maps => "map",
    }
}

/// The sentence about who is best, if tests say so, and else before whom they do not put the first.
pub(super) fn headline(lead: &Lead, overview: &Overview) -> String {
    let Lead { planner, rivals } = lead;
    if overview.clusters < MIN_CLUSTERS {
        return format!(
            "No planner is shown to be the best: {} are too few to tell from chance",
            plural(overview.clusters, one_of(overview.unit))
        );
    }
    if lead.is_shown() {
        return format!("{planner} ranks first");
    }
    let p = |p: Option<f64>| match p.map(probability) {
        None => "no test".to_owned(),
        Some(tiny) if tiny.starts_with('<') => format!("p {tiny}"),
        Some(p) => format!("p = {p}"),
    };
    let open: Vec<&Rival> = rivals.iter().filter(|rival| !rival.behind).collect();
    let mut named: Vec<String> = open
        .iter()
        .take(NAMED)
        .map(|rival| {
            format!(
                "{} (instances solved: {}; times: {})",
                rival.planner,
                p(rival.solved.p),
                p(rival.p_time)
            )
        })
        .collect();
    if open.len() > NAMED {
        named.push(format!("{} more", open.len() - NAMED));
    }
    let last = named.pop().unwrap_or_default();
    let named = match named.join(", ") {
        others if others.is_empty() => last,
        others => format!("{others} and {last}"),
    };
    format!("No planner is shown to be the best: tests do not put {planner} before {named}")
}

fn best(evaluation: &Evaluation) -> String {
    let ranking = &evaluation.ranking;
    let overview = &evaluation.overview;
    let solved = |ranked: &Ranked| {
        format!(
            "{} of {} cases ({})",
            grouped(ranked.successes as u64),
            grouped(ranked.cases as u64),
            share(ranked.successes, ranked.cases)
        )
    };
    let [first, rest @ ..] = &ranking.planners[..] else {
        return String::new();
    };
    if overview.failures == overview.trials {
        return "All of them failed.".to_owned();
    }
    let (Some(second), Some(lead)) = (rest.first(), &evaluation.lead) else {
        return format!("{} solved {}.", first.planner, solved(first));
    };
    let time = |ranked: &Ranked| format!("{} ms", digits(ranked.comparable_time_ms));
    let means = if ranking.over_shared {
        format!(
            "on the {} that all planners solved {} takes {} on average, {} takes {}.",
            plural(ranking.shared, "case"),
            first.planner,
            time(first),
            second.planner,
            time(second)
        )
    } else {
        "no instance was solved by all planners.".to_owned()
    };
    let (name, next) = (&first.planner, &second.planner);
    let (solved, next_solved) = (solved(first), solved(second));
    let headline = headline(lead, overview);
    if lead.is_shown() {
        format!("{headline}: it solved {solved}; {next} is next with {next_solved}; {means}")
    } else {
        format!("{headline}. {name} solved {solved}, {next} {next_solved}; {means}")
    }
}

/// The sentences about what to be careful with.
pub(super) fn caveats(trials: &Trials<'_>, evaluation: &Evaluation) -> Vec<String> {
    let Overview {
        trials: all,
        failures,
        planners,
        descriptive,
        contended,
        unranked,
        ref machines,
        ..
    } = evaluation.overview;
    let mut caveats = Vec::new();
    if all == 0 {
        return caveats;
    }
    if descriptive {
        caveats.push(
            "Timings are descriptive: some cases ran once, so that nothing tells a planner's time \
             from the machine's noise, and p-values are exploratory."
                .to_owned(),
        );
    }
    if failures > 0 {
        caveats.push(format!(
            "{} failed. Times, lengths and costs are of cases that succeeded; a planner that gives \
             up on hard instances looks faster than it is, hence the comparable times.",
            plural(failures, "trial")
        ));
    }
    if contended > 0 {
        caveats.push(format!(
            "{} ran while others used the machine; their times are among the numbers. Long trials are \
             disturbed more often, so that leaving these out keeps what is short and easy: `bench \
             --retry-contended` makes them again where it is known to be others' doing.",
            plural(contended, "trial")
        ));
    }
    caveats.extend(attempts(trials));
    caveats.extend(crowds(trials));
    caveats.extend(transport(trials, evaluation));
    caveats.extend(attachments(trials));
    caveats.extend(learning(trials));
    let each = |of: fn(&Row) -> Option<&str>| -> Vec<&str> {
        let texts: BTreeSet<&str> = trials.rows().filter_map(of).collect();
        texts.into_iter().collect()
    };
    if unranked > 0 {
        let reasons = each(|row| row.unranked.as_deref()).join("; ");
        let reasons = match reasons.as_str() {
            "" => "in the host's process or without a sandbox",
            reasons => reasons,
        };
        caveats.push(format!(
            "{} may not be compared: {reasons}.",
            plural(unranked, "trial")
        ));
    }
    for limits in each(|row| row.limits_watched.as_deref()) {
        let watched = |row: &&Row| row.limits_watched.as_deref() == Some(limits);
        caveats.push(format!(
            "In {} the machine only watched limits and did not enforce them: {limits}.",
            plural(trials.rows().filter(watched).count(), "trial")
        ));
    }
    for devices in each(|row| row.devices.as_deref()) {
        let used = |row: &&Row| row.devices.as_deref() == Some(devices);
        caveats.push(format!(
            "In {} planners were granted devices, whose time and memory are not counted: {devices}.",
            plural(trials.rows().filter(used).count(), "trial")
        ));
    }
    if machines.len() > 1 {
        caveats.push(format!(
            "Trials ran on {} different machines: times differ by more than planners.",
            machines.len()
        ));
    }
    for summary in &evaluation.planners {
        if let Some(claim) = &summary.false_claim {
            caveats.push(format!(
                "{} claims in {} what the host found to be otherwise ({claim}). No claim ranks.",
                summary.planner,
                plural(summary.false_claims, "trial")
            ));
        }
        if summary.different_plans > 0 {
            caveats.push(format!(
                "{} gave different plans for the same seed in {}, and no limit decided: it is not \
                 deterministic.",
                summary.planner,
                plural(summary.different_plans, "case")
            ));
        }
        if summary.unsteady > 0 {
            caveats.push(format!(
                "{} succeeded in some repeats and failed in others of {}: their share counts, and no time of \
                 them.",
                summary.planner,
                plural(summary.unsteady, "case")
            ));
        }
    }
    if let Some(size) = size_of(trials) {
        let rows = trials.instances().iter();
        let all: BTreeSet<Level> = rows.filter_map(|row| size.level(row)).collect();
        let common = common_levels(trials, size).len();
        if common < all.len() {
            caveats.push(format!(
                "Curves are of the {common} of {} sizes that every map has: elsewhere they would be of \
                 other maps. `--map NAME`, or the filter of the page, shows one map with all of its sizes.",
                all.len()
            ));
        }
    }
    caveats.extend(yardstick(trials, evaluation));
    if planners > 1 {
        caveats.extend(other_orders(trials, evaluation));
    }
    caveats
}

/// The sentence about who decides what comparable means are of.
fn yardstick(trials: &Trials<'_>, evaluation: &Evaluation) -> Option<String> {
    let Ranking {
        shared, instances, ..
    } = evaluation.ranking;
    let solved = |planner: &Planner<'_>| planner.successes().count();
    let weakest = trials
        .planners()
        .iter()
        .min_by_key(|planner| solved(planner))?;
    let others = trials.rows().filter(|row| row.entrant() != weakest.label);
    let without = Trials::new(others).shared().len();
    (trials.planners().len() > 2 && shared < instances && without > shared).then(|| {
        format!(
            "Comparable means are of the {} of {instances} that every planner solved, which the weakest of \
             them decides: without {} they would be of {without}. Pairs, PAR-2 and score need no such set.",
            plural(shared, "case"),
            weakest.label
        )
    })
}

/// The sentences about rankings by other orders.
fn other_orders(trials: &Trials<'_>, evaluation: &Evaluation) -> Vec<String> {
    let here = evaluation.ranking.planners.iter();
    let here: Vec<&str> = here.map(|ranked| ranked.planner.as_str()).collect();
    let other = match evaluation.ranking.order {
        Order::Text => Order::Appendix,
        Order::Appendix => Order::Text,
    };
    let by_other = rank(trials, other).planners;
    let by_other = by_other.iter().map(|ranked| ranked.planner.as_str());
    let standings = &evaluation.standings;
    let by = |key: &dyn Fn(&Standing) -> f64| -> Vec<&str> {
        let mut ordered: Vec<&Standing> = standings.iter().collect();
        // Who are equal keep the order of their ranks.
        ordered.sort_by(|a, b| key(a).total_cmp(&key(b)));
        ordered
            .iter()
            .map(|standing| standing.planner.as_str())
            .collect()
    };
    let mut orders = vec![
        (order_name(other), by_other.collect()),
        (
            "PAR-2 (mean time, a failure as two budgets)",
            by(&|standing| standing.par_ms[1].unwrap_or(f64::INFINITY)),
        ),
    ];
    if standings.iter().any(|standing| standing.score.is_some()) {
        orders.push((
            "score (best cost over own, 0 for a failure)",
            by(&|standing| -standing.score.unwrap_or(0.0)),
        ));
    }
    let tell = |(name, there): (&str, Vec<&str>)| {
        let moved = here.iter().zip(&there).filter(|(a, b)| a != b).count();
        if moved == 0 {
            format!("By {name} the ranking is the same.")
        } else {
            let planners = here.len();
            let order = there.join(", ");
            format!("By {name} {moved} of {planners} places are others: {order}.")
        }
    };
    orders.into_iter().map(tell).collect()
}

/// The sentence about planners whose start and map are charged differently.
fn attachments(trials: &Trials<'_>) -> Option<String> {
    let of = |planner: &Planner<'_>| {
        let ways: BTreeSet<&str> = planner.rows().map(|row| row.attach.as_str()).collect();
        let total = quantile(
            &sorted(planner.rows().filter_map(|row| row.total_time_ms)),
            0.5,
        );
        let ways = Vec::from_iter(ways).join(" and ");
        (ways, format!("{} {} ms", planner.label, digits(total)))
    };
    let found: Vec<(String, String)> = trials.planners().iter().map(of).collect();
    let (first, _) = found.first()?;
    found.iter().any(|(ways, _)| ways != first).then(|| {
        let each = found.iter().map(|(ways, total)| format!("{total} ({ways})"));
        format!(
            "Planners are attached differently: a command starts and reads the map within its calls, others \
             do before. Start, map and call together (`total_time_ms`), medians: {}.",
            each.collect::<Vec<_>>().join(", ")
        )
    })
}

/// The sentence about trials that were made again, with the attempts of every planner.
fn attempts(trials: &Trials<'_>) -> Option<String> {
    let each = trials.attempts()?;
    Some(format!(
        "Trials that others disturbed were made again, and the first attempt that they did not disturb \
         counts (attempts for trials): {each}."
    ))
}

/// The sentences about planners that learn the map for longer than they plan, which no time of a plan
/// shows, and about those that ended there.
fn learning(trials: &Trials<'_>) -> Vec<String> {
    let median = |planner: &Planner<'_>, of: fn(&Row) -> Option<f64>| {
        quantile(&sorted(planner.rows().filter_map(of)), 0.5)
    };
    let planners = trials.planners().iter();
    let longer = planners.clone().filter_map(|planner| {
        let learnt = |row: &Row| row.prepare_time_ms;
        let map = median(planner, learnt)?;
        let call = median(planner, |row| {
            row.prepare_time_ms.map(|_| row.planning_time_ms)
        })?;
        let [shown_map, shown_call] = [map, call].map(|time| digits(Some(time)));
        (map > call).then(|| format!("{} {shown_map} ms beside {shown_call} ms", planner.label))
    });
    let longer = longer.collect::<Vec<_>>().join(", ");
    let longer = (!longer.is_empty()).then(|| {
        format!(
            "These planners learn the map for longer than they plan, and times are of the plan alone \
             (`prepare_time_ms` beside `planning_time_ms`, medians): {longer}."
        )
    });
    let ended = planners.filter_map(|planner| {
        let count = planner.rows().filter(|row| row.ended_while_learning());
        let count = count.count();
        (count > 0).then(|| format!("{} in {}", planner.label, plural(count, "trial")))
    });
    let ended = ended.collect::<Vec<_>>().join(", ");
    let ended = (!ended.is_empty()).then(|| {
        format!("Some ended while they learnt the map and were not asked for a plan: {ended}.")
    });
    longer.into_iter().chain(ended).collect()
}

/// A team that makes so much of the goals of a smaller one is no worse.
const AS_MANY: f64 = 0.95;

/// Goals of the runs of a team.
#[derive(Debug, Clone, Copy, Default)]
struct Team {
    agents: u64,
    goals: f64,
    time_s: f64,
    runs: usize,
}

impl Team {
    fn per_s(&self) -> f64 {
        self.goals / self.time_s
    }

    /// Goals of this team in the time of another.
    fn goals_in(&self, time_s: f64) -> f64 {
        self.goals * time_s / self.time_s
    }
}

/// The sentences about fleets in which more robots deliver less, of each planner on a map.
fn crowds(trials: &Trials<'_>) -> Vec<String> {
    let mut teams: BTreeMap<(String, &str, u64), Team> = BTreeMap::new();
    for row in trials.rows() {
        let time_s = row.budget_ms / 1e3;
        let Some(goals) = row.goals_reached.filter(|_| row.success && time_s > 0.0) else {
            continue;
        };
        let team = teams.entry((row.entrant().into_owned(), &row.map, row.agents));
        let team = team.or_default();
        team.agents = row.agents;
        team.goals += goals as f64;
        team.time_s += time_s;
        team.runs += 1;
    }
    let teams: Vec<_> = teams.into_iter().collect();
    let of_one = teams.chunk_by(|(a, _), (b, _)| (&a.0, a.1) == (&b.0, b.1));
    let tell = |teams: &[((String, &str, u64), Team)]| {
        let ((planner, map, _), _) = &teams[0];
        let best = teams.iter().map(|(_, team)| team);
        let best = best.max_by(|a, b| a.per_s().total_cmp(&b.per_s()))?;
        let less = |team: &&Team| {
            let time_s = best.time_s.min(team.time_s);
            team.agents > best.agents
                && team.per_s() < AS_MANY * best.per_s()
                && differ(best.goals_in(time_s), team.goals_in(time_s))
        };
        let says = |team: &Team| {
            format!(
                "{} of {} in {}",
                digits(Some(team.per_s())),
                grouped(team.agents),
                plural(team.runs, "run")
            )
        };
        let larger = teams.iter().map(|(_, team)| team).filter(less).map(says);
        let larger = larger.collect::<Vec<_>>().join(", ");
        (!larger.is_empty()).then(|| {
            format!(
                "More robots deliver less with {planner} on {map}: goals per second are {}, and {larger}.",
                says(best)
            )
        })
    };
    of_one.filter_map(tell).collect()
}

/// From this share on, transport is a part of what times say.
const TRANSPORT: f64 = 0.05;

/// The sentence about planners of whose times much is transport: the time that is compared less
/// what the plugin itself says that it worked, unless that is known to be false.
fn transport(trials: &Trials<'_>, evaluation: &Evaluation) -> Option<String> {
    let share = |row: &Row| {
        let by_cpu = row.clock.as_deref() == Some(Clock::Cpu.name());
        let claimed = row.call_time_ms.filter(|_| !by_cpu);
        let claimed = claimed.filter(|_| row.false_claims.is_none() && row.solve_time_ms > 0.0)?;
        Some(1.0 - claimed / row.solve_time_ms)
    };
    let of = |planner: &str| {
        let rows = trials.rows().filter(|row| row.entrant() == planner);
        quantile(&sorted(rows.filter_map(share)), 0.5)
    };
    let named: Vec<String> = (evaluation.planners.iter())
        .filter_map(|summary| Some((&summary.planner, of(&summary.planner)?)))
        .filter(|(_, share)| *share > TRANSPORT)
        .map(|(planner, share)| format!("{planner} {:.0} %", 100.0 * share))
        .collect();
    (!named.is_empty()).then(|| {
        format!(
            "Of these planners more than {:.0} % of a time is transport, by what they say that they \
             worked (medians): {}. Another `clock` leaves it out.",
            100.0 * TRANSPORT,
            named.join(", ")
        )
    })
}

/// The sentences about how numbers came about.
pub(super) fn methods() -> Vec<String> {
    [
        "A case is a planner on an instance with a seed and a budget. Its success is the share of its \
         repeats that succeeded; its values are their medians, if all did.",
        "Intervals and tests count scenarios, unless the suite generalises over instances or maps: \
         seeds of an instance and team sizes of a scenario are alike. Under six there is none.",
        "A trial succeeds when the planner ended as it should and the host's validator accepts its \
         plan, whatever the planner claims.",
        "Comparable means, and lengths and costs in the ranking, are over the instances that every \
         planner solved.",
        "Times are wall times of the call by the host's clock; where the suite asks for it, the round \
         trip less that of an empty call, or processor time; half of the range of nine of ten empty calls is \
         the uncertainty. Expansions are the planner's claim, and rank only where all planners are \
         parts of the host.",
        "Intervals of success rates are Wilson's for as many trials as there are scenarios of one size, \
         those of means have variances by scenario and Student's quantiles, those of paired medians are \
         order statistics; all of 95 %. Quantiles are interpolated linearly (type 7).",
        "Paired comparisons are exact two-sided sign tests of scenarios with Holm's correction; those \
         without a difference are left out. P(slower) and its likes are posterior probabilities of a \
         Bayesian signed-rank test, in which 5 % more or less is as fast.",
        "A planner is said to rank first where tests at 5 % put it before every other: it solved more \
         (sign flips of scenarios), or was faster on what both solved and solved no less. All of \
         these tests are corrected together. Nothing is tested of trials that are filtered on the \
         page.",
    ]
    .map(str::to_owned)
    .to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn solved(planner: &str, instance: usize, time_ms: Option<f64>) -> Row {
        Row {
            planner: planner.into(),
            key: format!("{planner} {instance}"),
            instance_digest: format!("instance {instance}"),
            scenario: format!("scenario {instance}"),
            attach: "worker".into(),
            termination: "completed".into(),
            budget_ms: 1000.0,
            solve_time_ms: time_ms.unwrap_or(1000.0),
            success: time_ms.is_some(),
            valid: time_ms.is_some(),
            ..Row::default()
        }
    }

    /// The weakest planner decided on which cases the others were compared, and nobody was told.
    #[test]
    fn who_chooses_the_yardstick_is_named() {
        let times = |planner: &str, times: [Option<f64>; 8]| -> Vec<Row> {
            let rows = times.into_iter().enumerate();
            rows.map(|(instance, time)| solved(planner, instance, time))
                .collect()
        };
        let (fast, slow, none) = (Some(1.0), Some(900.0), None);
        // `a` is faster on the two that `weak` solves, and slower on all others.
        let mut rows = times("a", [fast, fast, slow, slow, slow, slow, slow, slow]);
        rows.extend(times("b", [Some(2.0); 8]));
        rows.extend(times(
            "weak",
            [fast, fast, none, none, none, none, none, none],
        ));
        let trials = Trials::new(&rows);
        let told = caveats(&trials, &Evaluation::of(&trials, Order::Text)).join("\n");
        assert!(
            told.contains("the 2 cases of 8 that every planner solved")
                && told.contains("without weak they would be of 8"),
            "{told}"
        );
        let order =
            "By PAR-2 (mean time, a failure as two budgets) 2 of 3 places are others: b, a, weak.";
        assert!(told.contains(order), "{told}");
    }

    #[test]
    fn attempts_are_told_by_planner() {
        let made = |planner: &str, instance: usize, attempts: Option<u32>| Row {
            attempts,
            ..solved(planner, instance, Some(1.0))
        };
        let said = |rows: &[Row]| attempts(&Trials::new(rows));
        let mut rows = vec![made("a", 0, Some(1)), made("b", 0, Some(1))];
        assert_eq!(said(&rows), None);
        rows.extend([made("a", 1, Some(1)), made("b", 1, Some(6))]);
        rows.push(made("c", 0, None));
        let told = said(&rows).unwrap();
        assert!(told.ends_with(": a 2 for 2, b 7 for 2."), "{told}");
    }

    #[test]
    fn fleets_that_deliver_less_with_more_robots_are_named() {
        let fleet = |agents: u64, seed: usize, goals: u64| Row {
            map: "aisles".into(),
            agents,
            budget_ms: 600e3,
            goals_reached: Some(goals),
            ..solved("pibt", seed, Some(1.0))
        };
        let said = |rows: &[Row]| crowds(&Trials::new(rows));
        let mut rows = vec![
            fleet(200, 0, 2000),
            fleet(1000, 1, 5000),
            fleet(1000, 2, 5200),
            fleet(1500, 3, 4300),
            // Not by more than chance may be.
            fleet(1100, 4, 4900),
        ];
        assert_eq!(
            said(&rows),
            [
                "More robots deliver less with pibt on aisles: goals per second are 8.50 of 1\u{202f}000 in 2 runs, and \
              7.17 of 1\u{202f}500 in 1 run."
            ]
        );
        rows.truncate(3);
        assert!(said(&rows).is_empty());
    }

    #[test]
    fn what_attachments_charge_is_said() {
        let row = |planner: &str, attach: &str, total_ms: f64| Row {
            attach: attach.into(),
            total_time_ms: Some(total_ms),
            ..solved(planner, 0, Some(1.0))
        };
        let said = |rows: &[Row]| attachments(&Trials::new(rows));
        let same = [row("a", "worker", 363.0), row("b", "worker", 400.0)];
        assert_eq!(said(&same), None);
        let text = said(&[row("a", "worker", 363.0), row("b", "command", 1018.0)]).unwrap();
        assert!(
            text.contains("a 363 ms (worker), b 1018 ms (command)."),
            "{text}"
        );
    }

    /// A planner that learnt a map for 755 ms and planned for 3 ms looked like one of 3 ms, and one that
    /// was killed there like one that found nothing.
    #[test]
    fn learning_the_map_is_not_hidden_by_planning() {
        let row = |planner: &str, map_ms: Option<f64>, plan_ms: f64| Row {
            prepare_time_ms: map_ms,
            planning_time_ms: plan_ms,
            fault: (plan_ms == 0.0).then(|| "did not answer `prepare`".into()),
            ..solved(planner, 0, (plan_ms > 0.0).then_some(plan_ms))
        };
        let said = |rows: &[Row]| learning(&Trials::new(rows)).join("\n");
        let quick = [row("quick", Some(0.2), 3.0), row("known", None, 3.0)];
        assert_eq!(said(&quick), "");
        let text = said(&[row("quick", Some(0.2), 3.0), row("slow", Some(755.0), 3.0)]);
        assert!(
            text.contains("medians): slow 755 ms beside 3.00 ms."),
            "{text}"
        );
        assert!(!text.contains("quick"), "{text}");
        let text = said(&[row("late", Some(500.0), 0.0), row("quick", Some(0.2), 3.0)]);
        assert!(
            text.contains("not asked for a plan: late in 1 trial."),
            "{text}"
        );
    }

    #[test]
    fn who_is_charged_for_transport_is_named() {
        let row = |planner: &str, solve_time_ms: f64, call_time_ms: Option<f64>| Row {
            planner: planner.into(),
            instance_digest: "i".into(),
            clock: Some("host".into()),
            solve_time_ms,
            call_time_ms,
            success: true,
            valid: true,
            ..Row::default()
        };
        let said = |rows: &[Row]| {
            let trials = Trials::new(rows);
            transport(&trials, &Evaluation::of(&trials, Order::Text))
        };
        let mut rows = vec![
            row("quick", 0.175, Some(0.010)),
            row("quick", 0.180, Some(0.170)),
            row("quick", 0.200, Some(0.020)),
            row("slow", 100.0, Some(95.1)),
            row("silent", 100.0, None),
        ];
        let text = said(&rows).unwrap();
        assert!(text.contains("(medians): quick 90 %."), "{text}");
        // Processor time has no transport, and a claim that cannot be true says nothing.
        rows[0].clock = Some("cpu".into());
        rows[2].false_claims = Some("time of work: 0.02 ms claimed, 9 ms found".into());
        let text = said(&rows).unwrap();
        assert!(text.contains("quick 6 %."), "{text}");
        assert_eq!(said(&rows[3..]), None);
    }
}

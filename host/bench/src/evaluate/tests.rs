use super::*;
use crate::{Incumbent, Row};

/// A trial of the maze kind; times are given, all else is derived from them.
fn row(planner: &str, instance: u64, time_ms: Option<f64>) -> Row {
    Row {
        key: format!("{planner}-{instance}"),
        planner: planner.into(),
        planner_id: planner.into(),
        options: "{}".into(),
        instance_digest: format!("instance {instance}"),
        map: format!("maze-{instance}"),
        agents: 1,
        connectivity: Some(4),
        maze_index: Some(instance),
        maze_width: Some(15),
        maze_height: Some(15),
        maze_algorithm: Some("backtracker".into()),
        budget_ms: 10_000.0,
        trial: instance * 10,
        ranked: true,
        built_in: Some(true),
        termination: if time_ms.is_some() {
            "completed"
        } else {
            "timed-out"
        }
        .into(),
        success: time_ms.is_some(),
        valid: time_ms.is_some(),
        solve_time_ms: time_ms.unwrap_or(10_000.0),
        path_length_cells: time_ms.map(|_| 100.0 + instance as f64),
        expansions: time_ms.map(|_| 50.0),
        ..Row::default()
    }
}

fn rows(planner: &str, times: &[Option<f64>]) -> Vec<Row> {
    let times = times.iter().zip(0..);
    times
        .map(|(time, instance)| row(planner, instance, *time))
        .collect()
}

#[test]
fn table_four_of_the_maze_paper_comes_out() {
    // 50 mazes; ten comparators are always slower, one is faster on two.
    let best: Vec<Option<f64>> = (0..50)
        .map(|at| Some(1.0 + f64::from(at) / 100.0))
        .collect();
    let slower = |by: f64, except: usize| -> Vec<Option<f64>> {
        let times = best.iter().enumerate();
        let slower = |(at, time): (usize, &Option<f64>)| {
            time.map(|time| if at < except { time - 0.001 } else { time + by })
        };
        times.map(slower).collect()
    };
    let mut all = rows("weighted", &best);
    for number in 0..11 {
        let times = slower(
            0.05 * f64::from(number + 1),
            if number == 2 { 2 } else { 0 },
        );
        all.extend(rows(&format!("comparator-{number:02}"), &times));
    }
    let found = Evaluation::of(&Trials::new(&all), Order::Text);
    assert_eq!(found.ranking.planners[0].planner, "weighted");
    assert_eq!(found.ranking.shared, 50);
    let comparison = found.comparison.unwrap();
    assert_eq!(
        (comparison.baseline.as_str(), comparison.descriptive),
        ("weighted", true)
    );
    assert_eq!(comparison.planners.len(), 11);
    for (number, against) in comparison.planners.iter().enumerate() {
        let (planner, paired) = (&against.planner, &against.paired);
        assert_eq!(*planner, format!("comparator-{number:02}"));
        let (counts, p) = if number == 2 {
            ((48, 2), 2.27e-12)
        } else {
            ((50, 0), 1.95e-14)
        };
        assert_eq!((paired.greater, paired.smaller), counts);
        let p_holm = paired.p_holm.unwrap();
        assert!((p_holm / p - 1.0).abs() < 0.005, "{p_holm}");
        let delta = 0.05 * (number as f64 + 1.0);
        assert!((paired.median_delta.unwrap() - delta).abs() < 1e-9);
    }
}

#[test]
fn nobody_leads_whom_no_test_puts_first() {
    let lead = |all: &[Row]| {
        let lead = Evaluation::of(&Trials::new(all), Order::Text).lead;
        lead.unwrap()
    };
    let times = |count: u32, time: f64| -> Vec<Option<f64>> {
        (0..count).map(|at| Some(time + f64::from(at))).collect()
    };
    // Faster on two of three: it ranks first, and a sign test gives p = 1.
    let mut all = rows("a", &[Some(1.0), Some(1.0), Some(3.0)]);
    all.extend(rows("b", &[Some(2.0), Some(2.0), Some(2.9)]));
    let found = lead(&all);
    assert_eq!(found.planner, "a");
    assert_eq!((found.rivals[0].slower, found.rivals[0].faster), (2, 1));
    // Of three scenarios nothing is inferred.
    assert_eq!(
        (found.rivals[0].p_time, found.rivals[0].solved.p),
        (None, None)
    );
    assert!(!found.is_shown());
    // Faster on all of twenty, and both solve all.
    let mut all = rows("a", &times(20, 1.0));
    all.extend(rows("b", &times(20, 1.5)));
    let found = lead(&all);
    assert!(found.is_shown());
    // Two tests: 2 · 2 · 2⁻²⁰.
    assert!((found.rivals[0].p_time.unwrap() * 2f64.powi(20) - 4.0).abs() < 1e-9);
    // It solves eight more than one, and is told from that alone; another solves as many in
    // times that are no others.
    let mut few = times(20, 0.5);
    few[..12].fill(None);
    all.retain(|row| row.planner == "a");
    all.extend(rows("b", &few));
    all.extend(rows("c", &times(20, 1.0)));
    let found = lead(&all);
    let of = |planner: &str| found.rivals.iter().find(|rival| rival.planner == planner);
    assert!(of("b").unwrap().behind && !of("c").unwrap().behind);
    let solved = &of("b").unwrap().solved;
    assert_eq!((solved.first, solved.second, solved.both), (12, 0, 8));
    assert_eq!(solved.difference, Some(0.6));
    assert!(!found.is_shown());
    // Faster, but on those that both solved alone: it solves fewer there.
    let mut fewer = times(20, 1.0);
    fewer[0] = None;
    let mut all = rows("fast", &fewer);
    all.extend(rows("sure", &times(20, 1.5)));
    let found = lead(&all);
    assert_eq!(found.planner, "sure");
    assert!(!found.is_shown());
}

#[test]
fn both_orders_of_the_paper_rank_differently_and_failures_come_first() {
    let mut all = rows("a", &[Some(1.0), Some(3.0), Some(2.0)]);
    all.extend(rows("b", &[Some(3.0), Some(1.0), Some(2.0)]));
    all.extend(rows("c", &[Some(0.1), Some(0.1), None]));
    for row in &mut all {
        // Both take the same time; `a` expands less and has longer paths.
        match row.planner.as_str() {
            "a" => row.path_length_cells = Some(120.0),
            "b" => row.expansions = Some(60.0),
            _ => {}
        }
    }
    let names = |order| -> Vec<String> {
        let ranking = rank(&Trials::new(&all), order);
        ranking
            .planners
            .into_iter()
            .map(|ranked| ranked.planner)
            .collect()
    };
    assert_eq!(names(Order::Text), ["a", "b", "c"]);
    assert_eq!(names(Order::Appendix), ["b", "a", "c"]);
    let ranking = rank(&Trials::new(&all), Order::Text);
    let c = &ranking.planners[2];
    assert_eq!((ranking.shared, ranking.over_shared), (2, true));
    // Equation 20 over the shared ones, 22 over all, the failure's time included.
    assert!((c.comparable_time_ms.unwrap() - 0.1).abs() < 1e-12);
    assert!((c.mean_time_ms.unwrap() - 10_000.2 / 3.0).abs() < 1e-9);
}

#[test]
fn without_shared_successes_means_are_over_what_there_is() {
    let mut all = rows("a", &[Some(1.0), None]);
    all.extend(rows("b", &[None, Some(2.0)]));
    let ranking = rank(&Trials::new(&all), Order::Text);
    assert_eq!((ranking.shared, ranking.over_shared), (0, false));
    let a = &ranking.planners[0];
    assert_eq!(a.planner, "a");
    assert_eq!(a.comparable_time_ms, Some(10_001.0 / 2.0));
    assert_eq!(a.comparable_length_cells, Some(100.0));
    let comparison = compare_with(&Trials::new(&all), "a", &SOLVE_TIME).unwrap();
    let paired = &comparison.planners[0].paired;
    assert_eq!(
        (paired.pairs, paired.left_out, paired.median_delta),
        (0, 2, None)
    );
    assert_eq!(paired.p_holm, None);
}

#[test]
fn repeats_are_one_case() {
    let mut all = Vec::new();
    for (repeat, time) in [(0, 5.0), (1, 1.0), (2, 2.0)] {
        all.push(Row {
            repeat,
            trial: u64::from(repeat),
            ..row("a", 0, Some(time))
        });
        // One of three fails.
        let time = Some(time).filter(|_| repeat != 1);
        all.push(Row {
            repeat,
            trial: u64::from(repeat) + 3,
            ..row("b", 0, time)
        });
    }
    let trials = Trials::new(&all);
    let summary = PlannerSummary::of(trials.planner("a").unwrap(), &[]);
    assert_eq!(
        (summary.trials, summary.cases, summary.successes),
        (3, 1, 1)
    );
    let mean = summary.metric(&SOLVE_TIME).map(|found| found.summary.mean);
    assert_eq!(mean, Some(2.0));
    let summary = PlannerSummary::of(trials.planner("b").unwrap(), &[]);
    assert_eq!(
        (summary.successes, summary.unsteady, summary.failures),
        (0, 1, 1)
    );
    assert_eq!(summary.metric(&SOLVE_TIME), None);
    let reason = FailureCount {
        reason: "timed-out".into(),
        trials: 1,
    };
    assert_eq!(summary.reasons, [reason]);
    assert!(!Overview::of(&trials).descriptive);
}

#[test]
fn the_order_of_rows_does_not_matter() {
    let mut all = rows("a", &[Some(1.0), Some(3.3), None, Some(0.7)]);
    all.extend(rows("b", &[Some(3.0), None, Some(2.0), Some(0.1)]));
    all.extend(rows("c", &[Some(0.3), Some(0.2), Some(9.0), Some(0.7)]));
    let first = serde_json::to_string(&Evaluation::of(&Trials::new(&all), Order::Text)).unwrap();
    all.reverse();
    let second = serde_json::to_string(&Evaluation::of(&Trials::new(&all), Order::Text)).unwrap();
    assert_eq!(first, second);
}

#[test]
fn reasons_say_what_happened() {
    let failed = |termination: &str, edit: fn(&mut Row)| {
        let mut row = row("a", 0, None);
        row.termination = termination.into();
        edit(&mut row);
        row.failure().unwrap()
    };
    assert_eq!(failed("timed-out", |_| {}), "timed-out");
    assert_eq!(failed("timed-out", |row| row.violations = 2), "timed-out");
    assert_eq!(
        failed("completed", |row| row.violations = 2),
        "invalid plan"
    );
    assert_eq!(
        failed("completed", |row| row.fleet = Some("of discs".into())),
        "contacts"
    );
    assert_eq!(
        failed("completed", |row| row.claim = Some("infeasible".into())),
        "no plan: infeasible"
    );
    assert_eq!(
        failed("over-limit", |row| row.limit_exceeded =
            Some("memory".into())),
        "over limit: memory"
    );
    assert_eq!(failed("crashed", |row| row.violations = 1), "crashed");
    assert_eq!(row("a", 0, Some(1.0)).failure(), None);
}

#[test]
fn curves_count_what_they_leave_out() {
    let mut all = Vec::new();
    for (instance, agents, time) in [
        (0, 100, None),
        (1, 50, Some(2.0)),
        (2, 50, Some(4.0)),
        (3, 100, Some(8.0)),
    ] {
        all.push(Row {
            agents,
            map: "one".into(),
            scenario: format!("{instance}"),
            ..row("a", instance, time)
        });
    }
    let found = curves(&Trials::new(&all), Dimension::Agents, &SOLVE_TIME);
    let points = &found[0].points;
    assert_eq!(points[0].level.number, Some(50.0));
    assert_eq!(points[0].values.map(|values| values.mean), Some(3.0));
    assert_eq!(
        (points[1].cases, points[1].successes, points[1].left_out),
        (2, 1, 1)
    );
    assert_eq!(points[1].values.unwrap().mean_interval, None);

    let found = cactus(&Trials::new(&all), &SOLVE_TIME);
    let marks: Vec<(f64, u64)> = found[0]
        .marks
        .iter()
        .map(|mark| (mark.value, mark.trial))
        .collect();
    assert_eq!(marks, [(2.0, 10), (4.0, 20), (8.0, 30)]);
    assert_eq!(found[0].cases, 4);
}

/// A curve showed 50 % where one map was solved always and another never.
#[test]
fn curves_are_of_the_sizes_that_all_maps_have_and_maps_count_as_much() {
    let mut all = Vec::new();
    // Three scenarios of an easy map, one of a hard one, and sizes that only one of them has.
    for (instance, map, agents, time) in [
        (0, "easy", 10, Some(1.0)),
        (1, "easy", 10, Some(1.0)),
        (2, "easy", 10, Some(4.0)),
        (3, "hard", 10, None),
        (4, "easy", 90, Some(9.0)),
        (5, "hard", 5, Some(1.0)),
    ] {
        all.push(Row {
            agents,
            map: map.into(),
            scenario: format!("{instance}"),
            ..row("a", instance, time)
        });
    }
    let trials = Trials::new(&all);
    let points = &curves(&trials, Dimension::Agents, &SOLVE_TIME)[0].points;
    let [point] = &points[..] else {
        panic!("{points:?}");
    };
    assert_eq!(point.level.number, Some(10.0));
    assert_eq!(point.success_rate.to_bits(), 0.5f64.to_bits());
    // The hard map has no time.
    assert_eq!(point.values.unwrap().mean.to_bits(), 2.0f64.to_bits());
}

#[test]
fn profiles_hold_every_planner_against_the_fastest() {
    let mut all = rows("a", &[Some(1.0), Some(6.0), None, Some(0.0)]);
    all.extend(rows("b", &[Some(2.0), Some(2.0), Some(5.0), Some(0.0)]));
    let found = profiles(&Trials::new(&all), &SOLVE_TIME);
    let factors = |at: usize| -> Vec<f64> {
        let marks = found[at].marks.iter();
        marks.map(|mark| mark.value).collect()
    };
    assert_eq!((factors(0), found[0].cases), (vec![1.0, 1.0, 3.0], 4));
    assert_eq!(factors(1), [1.0, 1.0, 1.0, 2.0]);
}

#[test]
fn scatters_keep_failures() {
    let mut all = rows("a", &[Some(1.0), Some(3.0), None, None, Some(5.0)]);
    all.extend(rows("b", &[Some(2.0), None, Some(2.0), None, Some(5.0)]));
    let found = scatter(&Trials::new(&all), "a", "b", &SOLVE_TIME).unwrap();
    assert_eq!(found.points.len(), 5);
    let counts = [
        found.x_smaller,
        found.y_smaller,
        found.tied,
        found.only_x,
        found.only_y,
        found.neither,
    ];
    assert_eq!(counts, [1, 0, 1, 1, 1, 1]);
    // No two counts alike, so that none stands for another.
    let mut outcomes = vec![(Some(1.0), Some(2.0)); 6];
    outcomes.extend([(Some(2.0), Some(1.0)); 5]);
    outcomes.extend([(Some(1.0), Some(1.0)); 4]);
    outcomes.extend([(Some(1.0), None); 3]);
    outcomes.extend([(None, Some(1.0)); 2]);
    outcomes.push((None, None));
    let (x, y): (Vec<_>, Vec<_>) = outcomes.into_iter().unzip();
    let all = [rows("x", &x), rows("y", &y)].concat();
    let found = scatter(&Trials::new(&all), "x", "y", &SOLVE_TIME).unwrap();
    let smaller = [found.x_smaller, found.y_smaller, found.tied];
    assert_eq!(smaller, [6, 5, 4]);
    assert_eq!([found.only_x, found.only_y, found.neither], [3, 2, 1]);
    assert_eq!((found.x.as_str(), found.y.as_str()), ("x", "y"));
    let last = &found.points[20];
    assert_eq!(
        (last.x, last.y, last.x_trial, last.y_trial),
        (None, None, 200, 200)
    );
    assert!(scatter(&Trials::new(&all), "a", "none", &SOLVE_TIME).is_none());
}

#[test]
fn fences_are_on_the_axis_of_the_plot() {
    let times = [1.0, 2.0, 4.0, 8.0, 16.0, 1000.0, 0.001].map(Some);
    let all = rows("a", &times);
    let found = &box_plots(&Trials::new(&all), &SOLVE_TIME)[0];
    // Quartiles 1.5 and 12: fences at 1.5/8^1.5 = 0.066 and 12·8^1.5 = 271.5.
    assert_eq!((found.summary.q1, found.summary.q3), (1.5, 12.0));
    assert_eq!((found.whisker_low, found.whisker_high), (1.0, 16.0));
    let outliers: Vec<f64> = found.outliers.iter().map(|mark| mark.value).collect();
    assert_eq!(outliers, [0.001, 1000.0]);
    let same = rows("a", &[Some(3.0); 5]);
    let found = &box_plots(&Trials::new(&same), &SOLVE_TIME)[0];
    assert_eq!(
        (found.whisker_low, found.whisker_high, found.outliers.len()),
        (3.0, 3.0, 0)
    );
}

#[test]
fn quality_says_how_many_have_a_plan() {
    let plan = |time_ms, soc, valid| Incumbent {
        time_ms,
        soc_steps: Some(soc),
        valid: Some(valid),
    };
    let mut all = rows("a", &[Some(9.0), Some(9.0)]);
    all[0].incumbents = vec![
        plan(1.0, 200, true),
        plan(4.0, 150, true),
        plan(5.0, 100, false),
    ];
    all[0].soc_steps = Some(120);
    all[1].incumbents = vec![plan(3.0, 300, true)];
    for row in &mut all {
        row.lower_bound_steps = Some(100);
    }
    let times = [0.5, 2.0, 4.0, 10.0];
    let found = &quality_over_time(&Trials::new(&all), Reference::LowerBound, &times)[0];
    let points: Vec<(usize, Option<f64>)> = found
        .points
        .iter()
        .map(|point| (point.with_plan, point.mean_ratio))
        .collect();
    // The last plan, which was judged by itself, came at 5 ms.
    assert_eq!(
        points,
        [(0, None), (1, Some(2.0)), (2, Some(2.25)), (2, Some(2.1))]
    );
    let best = &quality_over_time(&Trials::new(&all), Reference::Best, &[10.0])[0];
    assert_eq!(best.points[0].mean_ratio, Some(1.0));
    // Steps of a view are of its own grid.
    for row in &mut all {
        row.view = Some("narrow".into());
    }
    let of_view = &quality_over_time(&Trials::new(&all), Reference::LowerBound, &[10.0])[0];
    assert_eq!((of_view.cases, of_view.points.len()), (2, 0));
    let times = log_spaced(1.0, 1000.0, 4);
    let wanted = [1.0, 10.0, 100.0, 1000.0];
    assert!(
        times
            .iter()
            .zip(wanted)
            .all(|(time, wanted)| (time / wanted - 1.0).abs() < 1e-12)
    );
    assert!(log_spaced(0.0, 10.0, 5).is_empty());
    assert!(log_spaced(2.0, 1.0, 5).is_empty() && log_spaced(1.0, f64::INFINITY, 5).is_empty());
    assert!(log_spaced(1.0, 2.0, 0).is_empty());
    assert_eq!(log_spaced(3.0, 3.0, 1), [3.0]);
    assert_eq!(log_spaced(3.0, 9.0, 2), [3.0, 9.0]);
}

#[test]
fn rankings_of_regimes_are_compared() {
    let mut all = Vec::new();
    for (regime, times) in [("backtracker", [1.0, 2.0, 3.0]), ("prim", [3.0, 2.0, 1.0])] {
        for (planner, time) in ["a", "b", "c"].into_iter().zip(times) {
            let mut row = row(planner, u64::from(regime == "prim"), Some(time));
            row.maze_algorithm = Some(regime.into());
            all.push(row);
        }
    }
    let found = rank_stability(
        &all,
        &[Dimension::MazeAlgorithm, Dimension::MazeSize],
        Order::Text,
    );
    assert_eq!(found.ranks, [[1, 2, 3], [3, 2, 1]]);
    assert_eq!(
        found.tau,
        [[Some(1.0), Some(-1.0)], [Some(-1.0), Some(1.0)]]
    );
    assert_eq!((found.mean_tau, found.min_tau), (Some(-1.0), Some(-1.0)));
    assert_eq!(found.regimes[0][1].as_ref().unwrap().text, "15×15");
}

#[test]
fn two_runs_of_a_suite_are_compared() {
    let mut a = rows("p", &[Some(1.0), Some(1.0), Some(1.0), None]);
    let mut b = rows("p", &[Some(2.0), Some(1.5), None, Some(1.0), Some(7.0)]);
    for row in a.iter_mut().chain(&mut b) {
        row.plan_digest = row.success.then(|| "same".into());
        row.planner_digest = Some("code".into());
        // Numbered otherwise in the second run.
        row.trial += u64::from(row.solve_time_ms > 1.0) * 100;
    }
    b[1].plan_digest = Some("other".into());
    assert_eq!(
        compare_runs(Unit::Scenarios, &a, &b).settings,
        [],
        "rows of an earlier version do not say"
    );
    for row in a.iter_mut().chain(&mut b) {
        (row.threads, row.clock) = (Some(1), Some("host".into()));
    }
    for row in &mut b {
        row.threads = Some(4);
    }
    let found = compare_runs(Unit::Scenarios, &a, &b);
    assert_eq!((found.run_delay, found.clusters), (None, 4));
    for (rows, delay) in [(&mut a, 0.0), (&mut b, 30.0)] {
        for row in rows {
            (row.run_delay_ms, row.planning_time_ms) = (Some(delay), 100.0);
        }
    }
    let found = compare_runs(Unit::Scenarios, &a, &b);
    assert_eq!(found.run_delay, Some([0.0, 0.3]));
    b[0].options = "{\"weight\":2}".into();
    let settings = compare_runs(Unit::Scenarios, &a, &b).settings;
    let options = settings.iter().find(|one| one.name == "options").unwrap();
    let said = (&*options.a[0], &*options.b[0]);
    assert_eq!(said, ("p {}", "p {\"weight\":2}"));
    let [threads] = &found.settings[..] else {
        panic!("{:?}", found.settings);
    };
    assert_eq!(
        (threads.name, &threads.a[..], &threads.b[..]),
        ("threads", &["1".to_owned()][..], &["4".to_owned()][..])
    );
    assert_eq!((found.pairs, found.only_in_a, found.only_in_b), (4, 0, 1));
    let planner = &found.planners[0];
    assert_eq!((planner.successes_a, planner.successes_b), (3, 3));
    assert_eq!((planner.lost.len(), planner.won.len()), (1, 1));
    assert_eq!((planner.plans.same, planner.plans.absent), (1, 2));
    assert_eq!(planner.plans.different, [TrialPair { a: 10, b: 110 }]);
    assert_eq!(planner.same_code, Some(true));
    let time = &planner.metrics[0];
    assert_eq!(time.metric, SOLVE_TIME);
    assert_eq!((time.paired.pairs, time.paired.left_out), (2, 2));
    assert_eq!(time.paired.median_delta, Some(0.75));
}

#[test]
fn filters_and_groups() {
    let all = [
        rows("a", &[Some(1.0), None]),
        rows("b", &[Some(2.0), Some(3.0)]),
    ]
    .concat();
    let filter = Filter {
        planners: vec!["b".into()],
        levels: vec![(Dimension::Map, vec!["maze-1".into()])],
        ..Filter::default()
    };
    let kept: Vec<&Row> = all.iter().filter(|row| filter.keeps(row)).collect();
    assert_eq!(kept, [&all[3]]);
    assert!(all.iter().all(|row| Filter::default().keeps(row)));
    // Each of both alone keeps what the other drops.
    let mut marked = rows("a", &[Some(1.0); 4]);
    (marked[1].ranked, marked[3].ranked) = (false, false);
    for row in &mut marked[2..] {
        row.contended = "others".into();
    }
    let kept = |ranked_only, undisturbed_only| -> Vec<u64> {
        let filter = Filter {
            ranked_only,
            undisturbed_only,
            ..Filter::default()
        };
        let kept = marked.iter().filter(|row| filter.keeps(row));
        kept.map(|row| row.trial).collect()
    };
    assert_eq!(kept(false, false), [0, 10, 20, 30]);
    assert_eq!(kept(true, false), [0, 20]);
    assert_eq!(kept(false, true), [0, 10]);
    assert_eq!(kept(true, true), [0]);
    // A level that does not apply is none of those that are named.
    let mazes = Filter {
        levels: vec![(Dimension::MazeAlgorithm, vec!["prim".into()])],
        ..Filter::default()
    };
    marked[0].maze_algorithm = Some("prim".into());
    marked[1].maze_algorithm = None;
    let kept: Vec<u64> = (marked.iter().filter(|row| mazes.keeps(row)))
        .map(|row| row.trial)
        .collect();
    assert_eq!(kept, [0]);
    let found = groups(&all, &[Dimension::Map, Dimension::Seed]);
    assert_eq!(found.len(), 2);
    assert_eq!(found[1].levels[0].as_ref().unwrap().text, "maze-1");
    assert_eq!(found[1].rows.len(), 2);
}

#[test]
fn levels_are_those_of_the_row_and_ascend_by_their_numbers() {
    let row = Row {
        map: "m".into(),
        scenario: "s".into(),
        agents: 7,
        connectivity: Some(8),
        maze_algorithm: Some("prim".into()),
        maze_width: Some(9),
        maze_height: Some(11),
        budget_ms: 250.0,
        seed: 3,
        ..Row::default()
    };
    let told = |dimension: Dimension| {
        let level = dimension.level(&row).unwrap();
        (level.number, level.text)
    };
    let wanted = [
        (None, "m"),
        (None, "s"),
        (Some(7.0), "7"),
        (Some(8.0), "8"),
        (None, "prim"),
        (Some(9.0), "9×11"),
        (Some(250.0), "250 ms"),
        (Some(3.0), "3"),
    ];
    for (dimension, (number, text)) in Dimension::ALL.into_iter().zip(wanted) {
        assert_eq!(told(dimension), (number, text.to_owned()));
    }
    let none = Row::default();
    for absent in [
        Dimension::Connectivity,
        Dimension::MazeAlgorithm,
        Dimension::MazeSize,
    ] {
        assert_eq!(absent.level(&none), None);
    }
    let level = |number: Option<f64>, text: &str| Level {
        number,
        text: text.into(),
    };
    let ascending = [
        level(Some(2.0), "2"),
        level(Some(10.0), "10"),
        level(None, "a"),
        level(None, "b"),
    ];
    assert!(ascending.is_sorted() && ascending[0] < ascending[1] && ascending[2] < ascending[3]);
}

#[test]
fn nothing_to_evaluate_is_no_problem() {
    let found = Evaluation::of(&Trials::new([]), Order::Appendix);
    assert!(found.planners.is_empty() && found.comparison.is_none());
    let stability = rank_stability([], &[Dimension::Map], Order::Text);
    assert_eq!(stability.mean_tau, None);
    assert_eq!(compare_runs(Unit::Scenarios, [], []).pairs, 0);
}

/// A run of a suite with two planners: one loses many successes, and one a few.
#[test]
fn successes_of_runs_are_corrected_for_all_planners() {
    let run = |lost: usize, few: usize| {
        let times = |lost: usize| -> Vec<Option<f64>> {
            (0..20).map(|at| Some(1.0).filter(|_| at >= lost)).collect()
        };
        [rows("a", &times(lost)), rows("b", &times(few))].concat()
    };
    let found = compare_runs(Unit::Scenarios, &run(0, 0), &run(12, 6));
    let p = |at: usize| found.planners[at].solved.p.unwrap();
    assert_eq!(
        (found.planners[0].lost.len(), found.planners[1].lost.len()),
        (12, 6)
    );
    // 2 · 2⁻¹², twice for two planners; 2 · 2⁻⁶, once.
    assert_eq!((p(0), p(1)), (2f64.powi(-10), 2f64.powi(-5)));
    // The other way round they are won, and differences have the other sign.
    let back = compare_runs(Unit::Scenarios, &run(12, 6), &run(0, 0));
    assert_eq!(
        (back.planners[0].won.len(), back.planners[1].won.len()),
        (12, 6)
    );
    assert_eq!(back.planners[0].lost, []);
    let sides = [&found, &back].map(|found| {
        let solved = &found.planners[0].solved;
        (solved.first, solved.second, solved.difference.unwrap())
    });
    assert_eq!(sides, [(12, 0, 0.6), (0, 12, -0.6)]);
    // Times of what both solved are corrected as well: two planners that are slower on all twenty.
    let mut slow = run(0, 0);
    for row in &mut slow {
        row.solve_time_ms *= if row.planner == "a" { 2.0 } else { 3.0 };
    }
    let found = compare_runs(Unit::Scenarios, &run(0, 0), &slow);
    for (planner, ratio) in found.planners.iter().zip([2.0, 3.0]) {
        let time = &planner.metrics[0].paired;
        assert!(time.greater == 20 && (time.median_ratio.unwrap() - ratio).abs() < 1e-12);
        assert_eq!(
            (time.p, time.p_holm),
            (Some(2f64.powi(-19)), Some(2f64.powi(-18)))
        );
    }
    // Calls of no time at all have no share of it; and other machines are told.
    let mut idle = run(0, 0);
    for row in &mut idle {
        (row.run_delay_ms, row.planning_time_ms) = (Some(0.0), 0.0);
    }
    let found = compare_runs(Unit::Scenarios, &idle, &idle);
    assert_eq!((found.run_delay, found.same_machines), (None, true));
    let mut elsewhere = run(0, 0);
    elsewhere[0].machine = "another".into();
    assert!(!compare_runs(Unit::Scenarios, &idle, &elsewhere).same_machines);
}

/// A setting counts where both runs tell it, and only what differs is told.
#[test]
fn settings_that_differ_are_told() {
    let run = |edit: &dyn Fn(&mut Row)| {
        let mut rows = rows("p", &[Some(1.0), Some(1.0)]);
        for row in &mut rows {
            row.clock = Some("host".into());
            row.attach = "worker".into();
            edit(row);
        }
        rows
    };
    let told =
        |a: &dyn Fn(&mut Row), b: &dyn Fn(&mut Row)| -> Vec<(&str, Vec<String>, Vec<String>)> {
            let found = compare_runs(Unit::Scenarios, &run(a), &run(b)).settings;
            found
                .into_iter()
                .map(|one| (one.name, one.a, one.b))
                .collect()
        };
    let text = |text: &str| vec![text.to_owned()];
    let as_is = |_: &mut Row| {};
    assert_eq!(told(&as_is, &as_is), []);
    assert_eq!(
        told(&as_is, &|row| row.clock = Some("planner".into())),
        [("clock", text("host"), text("planner"))]
    );
    assert_eq!(
        told(&|row| row.reuse = Some("planner".into()), &|row| row
            .reuse =
            Some("no".into())),
        [("reuse", text("planner"), text("no"))]
    );
    assert_eq!(
        told(&as_is, &|row| row.attach = "stdio".into()),
        [("attach", text("worker"), text("stdio"))]
    );
    assert_eq!(
        told(&|row| row.fleet = Some("one".into()), &|row| row.fleet =
            Some("two".into())),
        [("fleet", text("p one"), text("p two"))]
    );
    assert_eq!(
        told(&as_is, &|row| row.cpus = Some("3".into())),
        [("cpus", text("shared"), text("of its own"))]
    );
    // Which ones does not matter, and rows that say nothing differ from nobody.
    assert_eq!(
        told(&|row| row.cpus = Some("1".into()), &|row| row.cpus =
            Some("3".into())),
        []
    );
    assert_eq!(told(&as_is, &|row| row.threads = Some(4)), []);
    // All values of a run that has more of them stand beside the new one.
    assert_eq!(
        told(&|row| row.threads = Some(1), &|row| row.threads =
            Some(1 + (row.trial / 10) as u32)),
        [("threads", text("1"), text("2"))]
    );
}

#[test]
fn a_difference_of_rates_lies_between_one_and_minus_one() {
    let repeated = |planner: &str, solved: [u32; 7]| -> Vec<Row> {
        let of = |(instance, solved): (u64, u32)| {
            (0..2).map(move |repeat| Row {
                repeat,
                ..row(planner, instance, Some(1.0).filter(|_| repeat < solved))
            })
        };
        (0..).zip(solved).flat_map(of).collect()
    };
    let all = [
        repeated("all", [2; 7]),
        repeated("none", [0, 0, 0, 0, 0, 0, 1]),
    ]
    .concat();
    let trials = Trials::new(&all);
    let between = |first: &str, second: &str| {
        let found = Success::between(trials.planner(first)?, trials.planner(second)?);
        let interval = found.interval?;
        Some((found.difference?, interval.low, interval.high))
    };
    // 6.5 of 7, by Student more than 1.
    let (difference, low, high) = between("all", "none").unwrap();
    assert!((difference - 6.5 / 7.0).abs() < 1e-12 && high.to_bits() == 1.0f64.to_bits());
    assert!((0.5..difference).contains(&low));
    assert_eq!(between("none", "all").unwrap(), (-difference, -high, -low));
}

/// On the whole `steady` is faster, and on what everybody solved it is not, whatever is drawn.
#[test]
fn resampled_ranks_are_over_shared_successes() {
    let hard = |at: u32| at % 4 == 3;
    let times = |easy: f64, hard_ms: Option<f64>| -> Vec<Option<f64>> {
        let time = |at: u32| if hard(at) { hard_ms } else { Some(easy) };
        (0..24).map(time).collect()
    };
    let all = [
        rows("quick", &times(1.0, Some(900.0))),
        rows("steady", &times(2.0, Some(2.0))),
        rows("weak", &times(3.0, None)),
    ]
    .concat();
    let found = Evaluation::of(&Trials::new(&all), Order::Text);
    let told = |at: usize| {
        let standing = &found.standings[at];
        (standing.planner.as_str(), standing.ranks, standing.p_first)
    };
    assert_eq!(told(0), ("quick", Some([1, 1]), Some(1.0)));
    assert_eq!(told(1), ("steady", Some([2, 2]), Some(0.0)));
}

#[test]
fn everybody_at_the_goal_from_the_beginning_is_as_good_as_can_be() {
    let plan = |time_ms: f64| Incumbent {
        time_ms,
        soc_steps: Some(0),
        valid: Some(true),
    };
    let row = Row {
        budget_ms: 100.0,
        soc_steps: Some(0),
        incumbents: vec![plan(25.0), plan(50.0)],
        ..row("a", 0, Some(50.0))
    };
    let found = &Evaluation::of(&Trials::new([&row]), Order::Text).anytime[0];
    assert!((found.primal_integral - 0.25).abs() < 1e-12);
    assert_eq!(found.within.map(f64::to_bits), [1.0f64.to_bits(); 4]);
}

/// Nothing is so many times as much as nothing, on either side.
#[test]
fn ratios_are_of_positive_values_alone() {
    let times = |first: f64| -> Vec<Option<f64>> {
        (0..7)
            .map(|at| Some(if at == 0 { first } else { 1.0 }))
            .collect()
    };
    let all = [rows("idle", &times(0.0)), rows("busy", &times(1.0))].concat();
    let trials = Trials::new(&all);
    for (baseline, counts) in [("idle", (1, 0, 6)), ("busy", (0, 1, 6))] {
        let found = compare_with(&trials, baseline, &SOLVE_TIME).unwrap();
        let paired = &found.planners[0].paired;
        assert_eq!((paired.median_ratio, paired.ratio_interval), (None, None));
        assert_eq!((paired.greater, paired.smaller, paired.tied), counts);
        assert_eq!((paired.posterior, paired.median_delta), (None, Some(0.0)));
    }
}

/// Sums of costs that only one planner has are compared with nothing.
#[test]
fn costs_of_one_planner_alone_are_not_compared() {
    let mut all = rows("a", &[Some(1.0), Some(1.0)]);
    for row in &mut all {
        row.soc_steps = Some(10);
    }
    all.extend(rows("b", &[Some(2.0), Some(2.0)]));
    let found = Evaluation::of(&Trials::new(&all), Order::Text);
    assert_eq!((found.costs, found.comparison.is_some()), (None, true));
    for row in &mut all {
        row.soc_steps = Some(10);
    }
    let found = Evaluation::of(&Trials::new(&all), Order::Text);
    assert_eq!(found.costs.unwrap().planners[0].paired.pairs, 2);
}

#[test]
fn expansions_of_strangers_do_not_rank() {
    let mut all = rows("a", &[Some(1.0)]);
    all.extend(rows("b", &[Some(1.0)]));
    all[1].expansions = Some(1.0);
    let first = |all: &[Row]| {
        let ranking = rank(&Trials::new(all), Order::Text);
        (ranking.planners[0].planner.clone(), ranking.by_expansions)
    };
    assert_eq!(first(&all), ("b".to_owned(), true));
    for stranger in [Some(false), None] {
        all[1].built_in = stranger;
        assert_eq!(first(&all), ("a".to_owned(), false));
    }
}

#[test]
fn who_cannot_be_told_from_the_one_before_is_marked() {
    let mut all = Vec::new();
    for (name, time) in [("a", 1.0), ("b", 1.2), ("c", 2.0), ("d", 2.1)] {
        let mut some = rows(name, &[Some(time), Some(time)]);
        for row in &mut some {
            row.correction_uncertainty_ms = (name != "d").then_some(0.15);
        }
        all.extend(some);
    }
    let ranking = rank(&Trials::new(&all), Order::Text);
    let near: Vec<bool> = ranking.planners.iter().map(|ranked| ranked.near).collect();
    assert_eq!(near, [false, true, false, false]);
    assert_eq!(ranking.planners[0].uncertainty_ms, Some(0.15));
    assert_eq!(ranking.planners[3].uncertainty_ms, None);
}

/// One problem with twenty seeds was twenty instances: p = 0.024 for a planner that had returned one
/// plan forty times. Nor are nested team sizes of one scenario more than one.
#[test]
fn seeds_and_team_sizes_of_a_scenario_are_one() {
    let some = |planner: &str, time: f64, scenario: u64, agents: u64, seed: u64| Row {
        key: format!("{planner}-{scenario}-{agents}-{seed}"),
        instance_digest: format!("{scenario} with {agents}"),
        map: format!("map {}", scenario / 4),
        scenario: format!("scenario {scenario}"),
        maze_seed: None,
        agents,
        seed,
        ..row(planner, scenario, Some(time))
    };
    let suite = |scenarios: u64, sizes: &[u64], seeds: u64| -> Vec<Row> {
        let mut all = Vec::new();
        for scenario in 0..scenarios {
            for agents in sizes {
                for seed in 0..seeds {
                    all.push(some("a", 1.0, scenario, *agents, seed));
                    all.push(some("b", 2.0, scenario, *agents, seed));
                }
            }
        }
        all
    };
    let found = |unit: Unit, rows: &[Row]| {
        let found = Evaluation::of(&Trials::speaking_for(unit, rows), Order::Text);
        let paired = found.comparison.unwrap().planners[0].paired.clone();
        (found.overview, found.planners[0].success_interval, paired)
    };
    let seeds = suite(1, &[10], 20);
    for unit in [Unit::Instances, Unit::Scenarios, Unit::Maps] {
        let (overview, interval, paired) = found(unit, &seeds);
        assert_eq!((overview.counts.instances, overview.instances), (1, 20));
        assert_eq!((paired.pairs, paired.clusters), (20, 1));
        assert_eq!((paired.p, paired.p_holm, interval), (None, None, None));
        assert_eq!((paired.delta_interval, paired.posterior), (None, None));
    }
    let nested = suite(8, &[10, 20, 30], 2);
    let clusters = |unit| found(unit, &nested).2.clusters;
    let units = [Unit::Instances, Unit::Scenarios, Unit::Maps];
    assert_eq!(units.map(clusters), [24, 8, 2]);
    let (overview, interval, paired) = found(Unit::Scenarios, &nested);
    let counts = Counts {
        instances: 24,
        scenarios: 8,
        maps: 2,
    };
    assert_eq!((overview.counts, overview.clusters), (counts, 8));
    // Eight of eight, as if each scenario were one trial.
    let eight = crate::statistics::wilson(8, 8).unwrap();
    let low = interval.unwrap().low;
    assert!((low - eight.low).abs() < 1e-12, "{low}");
    // 2 · 2⁻⁸, by 48 instances it would be 2 · 2⁻⁴⁸.
    assert_eq!(paired.p, Some(2f64.powi(-7)));
    assert_eq!(paired.median_ratio, Some(2.0));
    assert!(paired.posterior.unwrap().above > 0.99);
}

/// A planner whose every repeat has to succeed is charged p^r for a success of p.
#[test]
fn success_is_the_mean_of_repeats_and_reliability_stands_beside_it() {
    let mut all = Vec::new();
    for instance in 0..8 {
        for repeat in 0..4 {
            let time = Some(1.0).filter(|_| repeat > 0);
            all.push(Row {
                repeat,
                ..row("shaky", instance, time)
            });
            all.push(Row {
                repeat,
                ..row("sure", instance, Some(2.0))
            });
        }
    }
    let found = Evaluation::of(&Trials::new(&all), Order::Text);
    let shaky = &found.planners[1];
    assert_eq!(shaky.planner, "shaky");
    assert_eq!((shaky.successes, shaky.unsteady), (0, 8));
    assert_eq!(shaky.success_rate.to_bits(), 0.75f64.to_bits());
    let rival = &found.lead.unwrap().rivals[0];
    assert_eq!(rival.solved.difference, Some(0.25));
    assert!(rival.behind && rival.solved.p.unwrap() < 0.05);
}

/// Anytime planners were accused because their last plan depends on when they were stopped.
#[test]
fn plans_that_time_decided_accuse_nobody() {
    let repeats = |termination: &str, claim: &str, planning_time_ms: f64| -> usize {
        let rows: Vec<Row> = (0..2u32)
            .map(|repeat| Row {
                repeat,
                termination: termination.into(),
                claim: Some(claim.into()),
                planning_time_ms,
                plan_digest: Some(format!("plan {repeat}")),
                ..row("a", 0, Some(1.0))
            })
            .collect();
        PlannerSummary::of(Trials::new(&rows).planner("a").unwrap(), &[]).different_plans
    };
    assert_eq!(repeats("completed", "solved", 1.0), 1);
    assert_eq!(repeats("timed-out", "solved", 10_000.0), 0);
    assert_eq!(repeats("completed", "solved", 9_500.0), 0);
    // A solver behind an adapter is given less than the budget, and says that it spent that.
    assert_eq!(repeats("completed", "timed-out", 8_000.0), 0);
}

#[test]
fn standings_count_failures_and_say_how_sure_ranks_are() {
    let costs = |planner: &str, time: Option<f64>, soc: u64| -> Vec<Row> {
        let of = |instance: u64| Row {
            soc_steps: time.map(|_| soc),
            ..row(planner, instance, time.map(|time| time + instance as f64))
        };
        (0..10).map(of).collect()
    };
    let mut all = costs("fast", Some(1.0), 20);
    all.extend(costs("good", Some(5.0), 10));
    all.extend(costs("worse", Some(6.0), 20));
    let mut half = costs("half", Some(0.5), 10);
    for (at, failed) in half.iter_mut().enumerate().skip(5) {
        *failed = row("half", at as u64, None);
    }
    all.extend(half);
    let found = Evaluation::of(&Trials::new(&all), Order::Text);
    let of = |planner: &str| {
        let standing = found.standings.iter().find(|one| one.planner == planner);
        standing.unwrap()
    };
    assert_eq!(of("fast").ranks, Some([1, 1]));
    // Who loses is as sure of it.
    assert_eq!(
        (of("good").ranks, of("good").p_first),
        (Some([2, 2]), Some(0.0))
    );
    assert_eq!(
        (of("worse").ranks, of("worse").p_first),
        (Some([3, 3]), Some(0.0))
    );
    assert_eq!(of("half").ranks, Some([4, 4]));
    // Unless none of the five is drawn that `half` fails: once in 1,024.
    assert!(of("fast").p_first.unwrap() > 0.99);
    assert_eq!((of("fast").score, of("good").score), (Some(0.5), Some(1.0)));
    assert_eq!(of("half").score, Some(0.5));
    assert_eq!((of("half").fastest, of("fast").fastest), (0.5, 0.5));
    // 2.5 on average where it succeeded; the others count as 10 s, 20 s or 100 s.
    let par = of("half").par_ms.map(|par| par.unwrap().round() as u64);
    assert_eq!(par, [5001, 10_001, 50_001]);
    // Without `half` five cases cost half a second more, at the next of two times; without `fast`
    // five others cost four: (5 · 0.5)/10 and (5 · 4)/10.
    let contributions =
        ["half", "fast", "good", "worse"].map(|planner| of(planner).contribution_ms);
    assert_eq!(contributions, [Some(0.25), Some(2.0), Some(0.0), Some(0.0)]);
    let best = found.virtual_best.as_ref().unwrap();
    // Half of the cases at 0.5 + i for i < 5, the others at 1 + i.
    assert_eq!((best.success_rate, best.par_ms), (1.0, [Some(5.25); 3]));
    // Stopped at 10 s with a plan, and told so at 10.4 s: min(t, budget) was longer than the budget.
    let mut stopped = costs("stopped", Some(10_400.0), 20);
    stopped.truncate(1);
    let late = Evaluation::of(&Trials::new(&stopped), Order::Text);
    assert_eq!(late.standings[0].par_ms, [Some(10_000.0); 3]);
    let undominated = ["fast", "good", "worse", "half"].map(|planner| of(planner).undominated);
    assert_eq!(undominated, [true, true, false, false]);
    // Who is the same under two names has one rank.
    let mut twins = costs("a", Some(1.0), 20);
    twins.extend(costs("b", Some(1.0), 20));
    let found = Evaluation::of(&Trials::new(&twins), Order::Text);
    let first: Vec<Option<f64>> = found.standings.iter().map(|one| one.p_first).collect();
    assert_eq!(first, [Some(1.0), Some(1.0)]);
    let ranks: Vec<usize> = found.ranking.planners.iter().map(|one| one.rank).collect();
    assert_eq!(ranks, [1, 1]);
    assert_eq!(found.standings[0].contribution_ms, Some(0.0));
    let alone = Evaluation::of(&Trials::new(&costs("a", Some(1.0), 20)), Order::Text);
    // Nobody takes its place: two budgets less 5.5 ms.
    assert_eq!(alone.standings[0].contribution_ms, Some(20_000.0 - 5.5));
}

/// Resamples rank by what each planner solved, its lengths included, where no instance is solved by all.
#[test]
fn resampled_ranks_without_shared_successes_are_of_own_lengths() {
    let half = |planner: &str, solves: usize, length: f64| -> Vec<Row> {
        let of = |instance: u64| {
            let time = Some(1.0).filter(|_| instance as usize / 10 % 2 == solves);
            Row {
                path_length_cells: time.map(|_| length),
                ..row(planner, instance, time)
            }
        };
        (0..20).map(of).collect()
    };
    // Each solves ten of twenty scenarios in equal times, but in pairs that are drawn together.
    let mut all = [half("long", 0, 120.0), half("short", 1, 100.0)].concat();
    for row in &mut all {
        row.map = format!("map {}", row.trial / 10 % 10);
    }
    let trials = Trials::speaking_for(Unit::Maps, &all);
    let found = Evaluation::of(&trials, Order::Appendix);
    assert_eq!((found.overview.shared, found.overview.clusters), (0, 10));
    let told = |at: usize| {
        let standing = &found.standings[at];
        (standing.planner.as_str(), standing.ranks, standing.p_first)
    };
    assert_eq!(told(0), ("short", Some([1, 1]), Some(1.0)));
    assert_eq!(told(1), ("long", Some([2, 2]), Some(0.0)));
}

/// Costs were of the cases that each planner solved, so that who fails on hard ones looked better.
#[test]
fn costs_and_successes_are_compared_on_the_same_cases() {
    let cases = |planner: &str, ratio: [Option<f64>; 8]| -> Vec<Row> {
        let of = |(instance, ratio): (u64, Option<f64>)| Row {
            soc_steps: ratio.map(|ratio| (1000.0 * ratio) as u64),
            suboptimality: ratio,
            path_length_cells: ratio.map(|ratio| 100.0 * ratio),
            ..row(planner, instance, ratio.map(|_| 1.0))
        };
        (0..).zip(ratio).map(of).collect()
    };
    let (easy, hard) = (Some(1.0), Some(1.5));
    let mut all = cases("sure", [easy, easy, easy, easy, hard, hard, hard, hard]);
    let (worse, none) = (Some(1.1), None);
    all.extend(cases(
        "shaky",
        [worse, worse, worse, worse, none, none, none, none],
    ));
    let found = Evaluation::of(&Trials::new(&all), Order::Text);
    let of = |planner: &str| {
        let summary = found.planners.iter().find(|one| one.planner == planner);
        let ratio = summary
            .unwrap()
            .metric(Metric::named("suboptimality").unwrap())
            .unwrap();
        (ratio.summary.mean, ratio.shared_mean)
    };
    // 1.1 looks better than 1.25, and is worse than 1.0.
    assert_eq!(of("sure"), (1.25, Some(1.0)));
    assert!((of("shaky").0 - 1.1).abs() < 1e-12 && of("shaky").1.unwrap() > 1.09);
    let costs = &found.costs.unwrap().planners[0];
    assert_eq!(costs.paired.pairs, 4);
    assert!((costs.paired.median_ratio.unwrap() - 1.1).abs() < 1e-12);
    let solved = &found.comparison.unwrap().planners[0].solved;
    // Each scenario is one trial: McNemar's exact test of 4 against 0, and Newcombe's interval.
    assert_eq!(
        (solved.first, solved.second, solved.difference),
        (4, 0, Some(0.5))
    );
    assert_eq!(solved.p, Some(crate::statistics::sign_test(4, 0)));
    let wanted = crate::statistics::paired_rate_difference(4, 4, 0, 0).unwrap();
    assert_eq!(solved.interval, Some(wanted.1));
}

#[test]
fn plans_on_the_way_are_held_against_the_best_of_all() {
    let plan = |time_ms: f64, soc: u64| Incumbent {
        time_ms,
        soc_steps: Some(soc),
        valid: Some(true),
    };
    let anytime = Row {
        budget_ms: 1000.0,
        soc_steps: Some(100),
        incumbents: vec![plan(5.0, 200), plan(500.0, 100)],
        planning_time_ms: 500.0,
        ..row("anytime", 0, Some(500.0))
    };
    let once = Row {
        budget_ms: 1000.0,
        soc_steps: Some(104),
        planning_time_ms: 250.0,
        ..row("once", 0, Some(250.0))
    };
    let never = Row {
        budget_ms: 1000.0,
        ..row("never", 0, None)
    };
    let all = [anytime, once, never];
    let found = Evaluation::of(&Trials::new(&all), Order::Text).anytime;
    let of = |planner: &str| {
        let found = found.iter().find(|found| found.planner == planner);
        found.unwrap()
    };
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
    // Nothing for 5 ms, a gap of a half until 500 ms, none after.
    near(of("anytime").primal_integral, (5.0 + 0.5 * 495.0) / 1000.0);
    near(
        of("once").primal_integral,
        0.25 + 0.75 * (1.0 - 100.0 / 104.0),
    );
    near(of("never").primal_integral, 1.0);
    // By its clock the second plan came a moment after the end, and counts there.
    let late = Row {
        budget_ms: 1000.0,
        soc_steps: Some(100),
        incumbents: vec![plan(200.0, 125), plan(1001.0, 100)],
        planning_time_ms: 1001.0,
        ..row("late", 0, Some(1001.0))
    };
    let late = Evaluation::of(&Trials::new(&[late]), Order::Text).anytime;
    near(late[0].primal_integral, 0.2 + 0.8 * 0.2);
    let per_cent = |shares: &[f64]| -> Vec<u64> {
        shares.iter().map(|share| (100.0 * share) as u64).collect()
    };
    assert_eq!(per_cent(&of("anytime").targets), [0, 0, 100]);
    assert_eq!(per_cent(&of("once").targets), [0, 0, 50]);
    assert_eq!(per_cent(&of("once").within), [0, 0, 100, 100]);
    assert_eq!(of("anytime").interval, None);
    // The first to end by itself took 250 ms.
    let at = |planner: &str| of(planner).equal_time.unwrap();
    near(at("anytime")[0], 0.5);
    near(at("anytime")[1], 0.0);
    near(at("once")[0], 1.0 - 100.0 / 104.0);
    for gap in at("never") {
        near(gap, 1.0);
    }
    let moments = [1.0, 250.0, 499.0, 500.0];
    let reached = targets_reached(&Trials::new(&all), &moments);
    let shares: Vec<&[f64]> = reached.iter().map(|found| &*found.shares).collect();
    let never: &[f64] = &[0.0; 4];
    assert_eq!(
        shares,
        [&[0.0, 0.0, 0.0, 1.0], never, &[0.0, 0.5, 0.5, 0.5]]
    );
    let once = |all: &[Row]| {
        let found = Evaluation::of(&Trials::new(all), Order::Text).anytime;
        let mut found = found.into_iter();
        found.find(|found| found.planner == "once").unwrap()
    };
    // Who is there from the beginning is as good as can be.
    let mut there = all.clone();
    for row in &mut there {
        row.soc_steps = row.soc_steps.map(|_| 0);
        row.incumbents
            .iter_mut()
            .for_each(|plan| plan.soc_steps = Some(0));
    }
    let found = once(&there);
    assert_eq!(per_cent(&found.within), [100; 4]);
    assert_eq!(per_cent(&found.targets), [0, 0, 100]);
    // What is as far from the best as a target says has reached it.
    for (number, percent) in [1, 2, 5, 10].into_iter().enumerate() {
        let mut exact = all.clone();
        exact[1].soc_steps = Some(100);
        exact[0].soc_steps = Some(100 - percent);
        exact[0].incumbents[1] = plan(500.0, 100 - percent);
        let mut wanted = [100; 4];
        wanted[..number].fill(0);
        assert_eq!(per_cent(&once(&exact).within), wanted, "{percent} %");
        let reached = targets_reached(&Trials::new(&exact), &[1000.0]);
        assert_eq!(
            per_cent(&reached[2].shares),
            [100 - 25 * number as u64],
            "{percent} %"
        );
    }
    // Who fails ends no race, however early.
    let mut fails = all.clone();
    fails[2].termination = "completed".into();
    fails[2].planning_time_ms = 1.0;
    let found = Evaluation::of(&Trials::new(&fails), Order::Text).anytime;
    near(found[0].equal_time.unwrap()[0], 0.5);
    // Nobody sends anything on the way.
    let found = Evaluation::of(&Trials::new(&all[1..]), Order::Text);
    assert_eq!(found.anytime, []);
    // Plans without a cost in steps say nothing of who was near the best.
    let elsewhere = Row {
        soc_steps: None,
        incumbents: vec![
            Incumbent {
                soc_steps: None,
                ..plan(5.0, 0)
            };
            2
        ],
        ..row("elsewhere", 0, Some(5.0))
    };
    let found = Evaluation::of(&Trials::new(&[elsewhere]), Order::Text);
    assert_eq!(found.anytime, []);
}

#[test]
fn times_beyond_the_budget_are_censored_where_cases_are_independent() {
    let times = |slow: f64| -> Vec<Option<f64>> {
        let time = |at: u32| Some(slow * f64::from(at + 1)).filter(|time| *time < 10.0);
        (0..12).map(time).collect()
    };
    let mut all = rows("a", &times(0.5));
    all.extend(rows("b", &times(2.0)));
    for row in &mut all {
        row.budget_ms = 10.0;
    }
    let found = censored(&Trials::new(&all), "a", "b").unwrap();
    // Nothing is censored before the budget: the mean of min(t, 10).
    assert!((found.first.0 - 39.0 / 12.0).abs() < 1e-12, "{found:?}");
    assert!((found.second.0 - 100.0 / 12.0).abs() < 1e-12, "{found:?}");
    assert!(found.p < 0.01);
    // Six cases are enough, and five are not.
    let is_told = |cases: usize| {
        let mut some = rows("a", &times(0.5)[..cases]);
        some.extend(rows("b", &times(2.0)[..cases]));
        censored(&Trials::new(&some), "a", "b").is_some()
    };
    assert_eq!([5, 6].map(is_told), [false, true]);
    // Two scenarios of each map are not independent of each other.
    for row in &mut all {
        row.map = format!("map {}", row.trial / 20);
    }
    let maps = Trials::speaking_for(Unit::Maps, &all);
    assert_eq!((maps.clusters(), censored(&maps, "a", "b")), (6, None));
    assert_eq!(censored(&Trials::new(&all), "a", "nobody"), None);
}

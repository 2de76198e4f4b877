//! Generated trials, for tests and measurements of what is made of them.

use fleetyard_bench::{Incumbent, Row};

/// A stream of numbers of a seed: SplitMix64 (Steele, Lea and Flood, 2014).
pub(crate) struct Stream(pub(crate) u64);

impl Stream {
    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// In [0, 1).
    pub(crate) fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// About normal, with mean 0 and deviation 1.
    pub(crate) fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.unit()).sum::<f64>() - 6.0
    }

    pub(crate) fn hex(&mut self) -> String {
        format!("{:016x}{:016x}", self.next(), self.next())
    }
}

/// The trials to make.
#[derive(Debug, Clone)]
pub(crate) struct Shape<'a> {
    pub(crate) planners: &'a [&'a str],
    pub(crate) maps: &'a [&'a str],
    pub(crate) agents: &'a [u64],
    pub(crate) scenarios: u32,
    pub(crate) repeats: u32,
    /// Chance of failure of the last planner with most agents.
    pub(crate) failures: f64,
    /// True if planners send better plans as time goes.
    pub(crate) anytime: bool,
}

impl Default for Shape<'_> {
    fn default() -> Self {
        Self {
            planners: &["PIBT", "LaCAM*", "EECBS", "PBS"],
            maps: &["random-32-32-20", "warehouse-10-20-10-2-1", "room-32-32-4"],
            agents: &[50, 100, 200, 400],
            scenarios: 5,
            repeats: 1,
            failures: 0.7,
            anytime: true,
        }
    }
}

/// Trials that look like those of a suite, always the same for a seed.
pub(crate) fn rows(shape: &Shape<'_>, seed: u64) -> Vec<Row> {
    let mut random = Stream(seed);
    let planners = shape.planners.len();
    let digests: Vec<String> = shape.planners.iter().map(|_| random.hex()).collect();
    let mut rows = Vec::new();
    for (place, map) in shape.maps.iter().enumerate() {
        for scenario in 1..=shape.scenarios {
            for (size, agents) in shape.agents.iter().enumerate() {
                let instance_digest = random.hex();
                let hard = random.normal() * 0.4 + place as f64 * 0.5;
                let lower_bound_steps = agents * 22;
                for repeat in 0..shape.repeats {
                    for (index, planner) in shape.planners.iter().enumerate() {
                        let slow = index as f64 / planners.max(2) as f64;
                        let many = (size + 1) as f64 / shape.agents.len() as f64;
                        let success = random.unit() >= shape.failures * slow * many;
                        let scale = hard + slow * 5.0 + random.normal() * 0.25;
                        let time_ns = (scale.exp() * *agents as f64 * 5e3).min(1e10).round();
                        let time_ms = time_ns / 1e6;
                        let ratio = 1.0 + (1.2 - slow) * many * (0.3 + random.unit() * 0.1);
                        let soc = (lower_bound_steps as f64 * ratio).round() as u64;
                        let plans = if shape.anytime && success { 6 } else { 0 };
                        let incumbents = (0..plans).map(|at| Incumbent {
                            time_ms: time_ms * 0.02 * 2f64.powi(at),
                            soc_steps: Some(soc + (5 - at as u64) * (soc / 40)),
                            valid: Some(true),
                        });
                        rows.push(Row {
                            key: random.hex(),
                            trial: rows.len() as u64,
                            planner: (*planner).to_owned(),
                            planner_id: planner.to_lowercase().replace('*', ""),
                            planner_version: "0.1.0".to_owned(),
                            planner_digest: Some(digests[index].clone()),
                            options: "{}".to_owned(),
                            attach: "worker".to_owned(),
                            ranked: true,
                            instance_digest: instance_digest.clone(),
                            map: (*map).to_owned(),
                            scenario: format!("{map}-random-{scenario}.scen"),
                            agents: *agents,
                            connectivity: Some(4),
                            map_rows: Some(32),
                            map_cols: Some(32),
                            budget_ms: 10_000.0,
                            repeat,
                            termination: if success { "completed" } else { "timed-out" }.to_owned(),
                            claim: success.then(|| "solved".to_owned()),
                            valid: success,
                            success,
                            solve_time_ms: time_ms,
                            planning_time_ms: time_ms,
                            call_time_ms: Some(time_ms * 0.9),
                            startup_time_ms: Some(1.0 + random.unit()),
                            first_solution_ms: success.then_some(time_ms * 0.02),
                            soc_steps: success.then_some(soc),
                            makespan_steps: success.then(|| 50 + random.next() % 40),
                            lower_bound_steps: Some(lower_bound_steps),
                            suboptimality: success.then(|| soc as f64 / lower_bound_steps as f64),
                            path_length_cells: success.then_some(soc as f64 - 7.0),
                            path_length_m: success.then_some(soc as f64 - 7.0),
                            expansions: success.then(|| (scale.exp() * 50.0).round()),
                            arrived: success.then_some(*agents),
                            simulated_s: success.then_some(54.0),
                            rtf: success.then(|| 5e3 + random.unit() * 1e3),
                            contacts: success.then_some(0),
                            nearest_approach_m: success.then_some(0.707),
                            tracking_error_max_m: success.then_some(0.0),
                            execution_makespan_s: success.then_some(54.0),
                            cpu_time_ms: Some(time_ms * 1.1),
                            peak_memory_kb: Some(14_000 + random.next() % 5000),
                            machine: "5d41402abc4b2a76b9719d911017c592".to_owned(),
                            plan_digest: success.then(|| random.hex()),
                            trace_digest: success.then(|| random.hex()),
                            started_unix_ms: 1_760_000_000_000 + rows.len() as u64 * 1000,
                            contended: if random.unit() < 0.01 {
                                "other load"
                            } else {
                                ""
                            }
                            .to_owned(),
                            incumbents: incumbents.collect(),
                            ..Row::default()
                        });
                    }
                }
            }
        }
    }
    rows
}

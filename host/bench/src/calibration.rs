//! Empty calls: calls in which nothing is done, and their time.
//!
//! The clock of rankings is the host's. Of calls of microseconds most of a round trip is
//! transport, so that a suite may rank by the round trip less the empty one: that of the
//! host's own planner `empty`, attached alike, in the same sandbox on the same processors,
//! asked as many robots as the trial. It is taken before any other plugin is started, so
//! that none can make it longer.

use std::collections::BTreeMap;

use fleetyard_check::{PathRule, metrics};
use fleetyard_core::{GridInstance, GridPlan, InputError};
use fleetyard_runtime::Attach;
use fleetyard_sim::{NoTrace, SimConfig};
use serde_json::json;

use crate::correction::{Calibration, Correction, Sample};
use crate::error::BenchError;
use crate::plugin::{GivenOptions, Plugin, Running};
use crate::statistics::{quantile, sorted};
use crate::suite::SuiteInstance;
use crate::trial::{Host, Trial};
use crate::trial_error::TrialError;
use crate::trial_instance::TrialInstance;

/// The planner that answers at once.
const PLANNER: &str = "empty";

/// Empty calls of a kind that are taken, after some that are not counted.
const CALLS: usize = 101;
const FIRST: usize = 10;

/// Most cells of their answers.
const LONGEST: u64 = 1 << 22;

/// Most numbers of agents for which they are.
const SIZES: usize = 16;

/// Makes the empty calls for these instances.
pub(crate) fn take(
    host: &Host,
    instances: &[SuiteInstance],
    config: &SimConfig,
    attachments: &[Attach],
) -> Result<Calibration, BenchError> {
    let mut sizes: BTreeMap<usize, &SuiteInstance> = BTreeMap::new();
    for instance in instances {
        sizes.entry(instance.agents()).or_insert(instance);
    }
    let all: Vec<&SuiteInstance> = sizes.into_values().collect();
    let chosen = all.len().min(SIZES);
    let mut taken = Calibration::default();
    for index in 0..chosen {
        let instance = all[index * all.len() / chosen].grid_instance()?;
        let agents = instance.agents().max(1);
        let bound = metrics(&instance, &GridPlan::default(), config.cell_size_m);
        let steps = (bound.lower_bound_steps / agents as u64).min(LONGEST / agents as u64);
        for attach in attachments {
            let sample = |steps| sample(host, &instance, config, *attach, steps);
            let samples = [sample(0)?, sample(steps)?];
            let direct = *attach == Attach::InProcess;
            taken.samples.insert((direct, agents), samples);
        }
    }
    Ok(taken)
}

/// Takes empty calls as trials are made, with answers in which everybody waits for `steps`.
fn sample(
    host: &Host,
    instance: &GridInstance,
    config: &SimConfig,
    attach: Attach,
    steps: u64,
) -> Result<Sample, BenchError> {
    let failed = |error: TrialError| BenchError::Trial {
        planner: format!("the host's planner `{PLANNER}`"),
        error: Box::new(error),
    };
    let options = json!({ "steps": steps });
    let options = GivenOptions::Values(options.as_object().cloned().unwrap_or_default());
    let planner = Plugin::built_in(&host.runtime, PLANNER)
        .map_err(|fault| failed(fault.into()))?
        .attached(Some(attach))
        .with_options(options);
    let trial = Trial {
        host,
        planner: &planner,
        instance: TrialInstance::Grid {
            instance,
            path_rule: PathRule::Steps,
        },
        scenario: "calibration",
        seed: 0,
        config,
        robots: None,
        annotations: false,
        follower: None,
    };
    let mut running: Option<Running> = None;
    let mut took_ms = Vec::with_capacity(CALLS);
    for call in 0..FIRST + CALLS {
        let outcome = trial
            .run_again(&mut running, &mut NoTrace)
            .map_err(failed)?;
        match outcome.record.metrics.round_trip_ms {
            Some(ms) if call >= FIRST => took_ms.push(ms),
            Some(_) => {}
            None => {
                let fault = outcome.record.fault.unwrap_or_default();
                let reason = format!("the empty call was not answered: {fault}");
                return Err(InputError::new("calibration", reason)
                    .hint("the budget has to be long enough for a call in which nothing is done")
                    .into());
            }
        }
    }
    if let Some(running) = running {
        running.close();
    }
    let took_ms = sorted(took_ms);
    let at = |level| quantile(&took_ms, level).unwrap_or(0.0);
    Ok(Sample {
        cells: (1 + steps) * instance.agents() as u64,
        correction: Correction {
            ms: at(0.5),
            uncertainty_ms: (at(0.95) - at(0.05)) / 2.0,
        },
    })
}

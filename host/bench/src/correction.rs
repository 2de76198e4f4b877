//! Corrections of round trips by what empty calls take.

use std::collections::BTreeMap;

use fleetyard_runtime::Attach;
use serde::Serialize;

/// The part of a round trip that is not the planner's.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Correction {
    /// The median of empty calls.
    pub ms: f64,
    /// Half of the range that holds nine of ten empty calls.
    pub uncertainty_ms: f64,
}

/// Empty calls with answers of one length.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sample {
    /// Of an answer.
    pub(crate) cells: u64,
    pub(crate) correction: Correction,
}

/// Empty calls, by attachment and number of agents, with short answers and with long ones.
#[derive(Debug, Default)]
pub(crate) struct Calibration {
    pub(crate) samples: BTreeMap<(bool, usize), [Sample; 2]>,
}

impl Calibration {
    /// Of a call with that many agents whose answer had that many cells.
    pub(crate) fn of(&self, attach: Attach, agents: usize, cells: u64) -> Option<Correction> {
        // A call with fewer agents is shorter, if anything.
        let direct = attach == Attach::InProcess;
        let known = self.samples.range((direct, 0)..=(direct, agents));
        let (_, [short, long]) = known.last()?;
        let beyond = cells.clamp(short.cells, long.cells) - short.cells;
        let share = beyond as f64 / (long.cells - short.cells).max(1) as f64;
        let rise = (long.correction.ms - short.correction.ms).max(0.0);
        Some(Correction {
            ms: short.correction.ms + share * rise,
            uncertainty_ms: short
                .correction
                .uncertainty_ms
                .max(long.correction.uncertainty_ms),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_correction_grows_with_the_answer_up_to_what_was_taken() {
        let sample = |cells: u64, ms: f64, uncertainty_ms: f64| Sample {
            cells,
            correction: Correction { ms, uncertainty_ms },
        };
        let mut taken = Calibration::default();
        assert_eq!(taken.of(Attach::Worker, 1, 9), None);
        let few = [sample(2, 1.0, 0.1), sample(102, 2.0, 0.2)];
        taken.samples.insert((false, 2), few);
        let many = [sample(50, 4.0, 0.5), sample(50, 3.0, 0.1)];
        taken.samples.insert((false, 50), many);
        let of = |attach, agents, cells| {
            let found: Option<Correction> = taken.of(attach, agents, cells);
            found.map(|found| (found.ms, found.uncertainty_ms))
        };
        assert_eq!(of(Attach::Worker, 2, 0), Some((1.0, 0.2)));
        assert_eq!(of(Attach::Stdio, 2, 52), Some((1.5, 0.2)));
        assert_eq!(of(Attach::Command, 49, 5000), Some((2.0, 0.2)));
        assert_eq!(of(Attach::Worker, 70, 5000), Some((4.0, 0.5)));
        // Nothing smaller was taken, and nothing in process.
        assert_eq!(of(Attach::Worker, 1, 9), None);
        assert_eq!(of(Attach::InProcess, 2, 9), None);
    }
}

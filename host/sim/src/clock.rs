//! The relation of steps, ticks, substeps and seconds.

use crate::config::SimConfig;
use crate::error::SimError;

/// The relation of steps, ticks and substeps. Times are in substeps.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Clock {
    pub(crate) substeps_per_s: f64,
    pub(crate) substeps_per_tick: f64,
    pub(crate) substeps_per_step: f64,
    /// Whole ticks between two exchanges of messages.
    pub(crate) ticks_per_period: u64,
}

impl Clock {
    pub(crate) fn new(config: &SimConfig) -> Self {
        let substeps_per_tick = f64::from(config.substeps);
        let substeps_per_s = f64::from(config.ticks_hz) * substeps_per_tick;
        // A step that is meant to be a whole number of substeps is one, whatever
        // the rounding of decimal fractions says.
        let exact = config.step_s * substeps_per_s;
        let whole = exact.round();
        let substeps_per_step = if whole >= 1.0 && (exact - whole).abs() <= 1e-9 * whole {
            whole
        } else {
            exact
        };
        let period = config.message_period_s * f64::from(config.ticks_hz);
        Self {
            substeps_per_s,
            substeps_per_tick,
            substeps_per_step,
            ticks_per_period: (period.round() as u64).max(1),
        }
    }

    /// Number of ticks until a moment has passed.
    pub(crate) fn ticks_until(&self, when: f64) -> Result<u64, SimError> {
        let most = (1u64 << 40) as f64;
        let ticks = (when / self.substeps_per_tick).ceil();
        if ticks > most {
            return Err(SimError::TooLong { ticks, most });
        }
        Ok(ticks as u64)
    }

    /// Duration of a tick in seconds.
    pub(crate) fn tick_s(&self) -> f64 {
        self.substeps_per_tick / self.substeps_per_s
    }

    /// Time between two exchanges of messages in seconds.
    pub(crate) fn period_s(&self) -> f64 {
        self.ticks_per_period as f64 * self.tick_s()
    }

    pub(crate) fn step_start(&self, step: u64) -> f64 {
        step as f64 * self.substeps_per_step
    }

    pub(crate) fn tick_start(&self, tick: u64) -> f64 {
        tick as f64 * self.substeps_per_tick
    }
}

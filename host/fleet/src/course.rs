//! Execution of plans: by the order of passing, or a step at a time.

use fleetyard_sim::{Fleet, Live, Order};

use crate::adg::{Adg, AdgError, Appended, Cut};
use crate::batch::Batch;
use crate::steps::Steps;
use crate::{CutBy, FleetConfig, FleetError};

/// The rest of the plans, by the rules of the run.
#[derive(Debug)]
pub(crate) enum Course {
    /// In the order of passing.
    Driven(Adg),
    /// A step at a time.
    Synchronous(Steps),
}

impl Course {
    /// Lets cuts tell what they drop.
    pub(crate) fn tell_rest(&mut self) {
        match self {
            Self::Driven(adg) => adg.tell_rest(),
            Self::Synchronous(steps) => steps.tell_rest(),
        }
    }

    /// Number of agents.
    pub(crate) fn agents(&self) -> usize {
        match self {
            Self::Driven(adg) => adg.agents(),
            Self::Synchronous(steps) => steps.agents(),
        }
    }

    /// Actions that are not done; agents that have some, a step at a time.
    pub(crate) fn pending(&self) -> usize {
        match self {
            Self::Driven(adg) => adg.pending(),
            Self::Synchronous(steps) => steps.pending(),
        }
    }

    /// Actions of an agent that are committed or planned, and not done.
    pub(crate) fn actions_left(&self, agent: usize) -> u32 {
        match self {
            Self::Driven(adg) => adg.actions_left(agent),
            Self::Synchronous(steps) => steps.steps_left(agent),
        }
    }

    /// Goes on with a plan that begins where agents end.
    pub(crate) fn append(
        &mut self,
        batch: Batch,
        goals: &mut dyn FnMut(usize, u32) -> u32,
    ) -> Result<Appended, AdgError> {
        match self {
            Self::Driven(adg) => adg.append(&batch, goals),
            Self::Synchronous(steps) => {
                steps.follow(batch);
                Ok(Appended::default())
            }
        }
    }

    /// True if what is pending has an order in which it can be done.
    pub(crate) fn is_acyclic(&self) -> bool {
        match self {
            Self::Driven(adg) => adg.is_acyclic(),
            Self::Synchronous(_) => true,
        }
    }

    /// Drops what nobody is committed to; the last plan was appended `since_s` ago.
    pub(crate) fn cut(&mut self, config: &FleetConfig, fleet: Option<&Fleet>, since_s: f64) -> Cut {
        match self {
            Self::Driven(adg) => match config.cut {
                CutBy::Time => {
                    adg.cut_within(config.horizon_s(fleet), since_s, &config.pace(fleet))
                }
                CutBy::Actions => adg.cut(config.lookahead(fleet)),
            },
            Self::Synchronous(steps) => steps.cut(),
        }
    }

    /// Sends robots but those that are held what they may do in the next block.
    pub(crate) fn send(
        &mut self,
        config: &FleetConfig,
        is_held: &dyn Fn(usize) -> bool,
        live: &mut Live<'_>,
    ) {
        match self {
            Self::Driven(adg) => adg.enqueue_but(config.queue, is_held, &mut |agent, node| {
                let dwell_s = if node.goal.is_some() {
                    config.dwell_s
                } else {
                    0.0
                };
                live.send(
                    agent,
                    Order {
                        dwell_s,
                        ..Order::to(node.cell)
                    },
                );
            }),
            Self::Synchronous(steps) => steps.send(live),
        }
    }

    /// The agent that has to go on before an agent gets more to do, and the number of the order with
    /// which it does. None where all go on at once.
    pub(crate) fn ahead(&self, agent: usize) -> Option<(u32, Option<u32>)> {
        match self {
            Self::Driven(adg) => adg.ahead(agent),
            Self::Synchronous(_) => None,
        }
    }

    /// Makes sure that a block took robots as far as it had to.
    pub(crate) fn check(&self, live: &Live<'_>) -> Result<(), FleetError> {
        let Self::Synchronous(steps) = self else {
            return Ok(());
        };
        let mut agents = 0..steps.agents();
        match agents.find(|agent| live.done(*agent) != live.sent(*agent)) {
            Some(agent) => Err(FleetError::Broken(format!(
                "agent {agent} did not do its step in {} s",
                live.period_s()
            ))),
            None => Ok(()),
        }
    }
}

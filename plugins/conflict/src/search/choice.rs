//! The choice of the conflict at which a node is split: cardinal conflicts come first (ICBS:
//! Boyarski, Felner, Stern, Sharon, Tolpin, Betzalel, Shimony, IJCAI 2015).
//!
//! A conflict is *cardinal* if both children cost more than the node, *semi-cardinal* if one
//! does, and *non-cardinal* else. An agent's child costs more if the agent's MDD has a single
//! cell where the conflict is. Among equals, symmetries that are resolved at once go before
//! (Li et al., AIJ 301, 2021).

use std::rc::Rc;

use fleetyard_plugin_spacetime::astar::Stopped;
use fleetyard_plugin_spacetime::conflict::{Conflict, Kind};

use super::Search;
use super::nodes::AgentPath;
use crate::constraint::Constraint;
use crate::mdd::SEVERAL;

/// The classes of conflicts, in the order in which they are resolved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Cardinality {
    Cardinal,
    SemiCardinal,
    NonCardinal,
}

impl Cardinality {
    /// The class of a conflict, given which of its two children cost more.
    pub(super) fn of(dearer: [bool; 2]) -> Self {
        match dearer {
            [true, true] => Self::Cardinal,
            [false, false] => Self::NonCardinal,
            _ => Self::SemiCardinal,
        }
    }
}

/// The order of conflicts: the least is resolved first. Symmetries have a 0 behind their class.
pub(super) type Urgency = (Cardinality, u8);

impl Search<'_> {
    /// Chooses a conflict of the loaded node and says how it is split.
    pub(super) fn choose(
        &mut self,
        id: u32,
        stop: &mut dyn FnMut() -> bool,
    ) -> Result<Vec<Constraint>, Stopped> {
        let mut conflicts = self.traffic.conflicts().all().to_vec();
        conflicts.sort_unstable();
        let classified = self.settings.classified.min(conflicts.len());
        let mut best: Option<(Urgency, &Conflict)> = None;
        let mut others = Vec::new();
        for conflict in &conflicts[..classified] {
            if stop() {
                return Err(Stopped);
            }
            let dearer = match &conflict.kind {
                Kind::Ring(members) => {
                    let members = members.iter().map(|(member, _)| *member as usize);
                    let dearer: Vec<bool> = members
                        .map(|agent| self.is_cardinal_for(agent, conflict))
                        .collect();
                    [dearer.iter().all(|&f| f), dearer.iter().any(|&f| f)]
                }
                _ => conflict
                    .agents
                    .map(|agent| self.is_cardinal_for(agent as usize, conflict)),
            };
            let target = self.settings.symmetry && self.target(conflict).is_some();
            let class = Cardinality::of(dearer);
            let urgency = (class, u8::from(!target));
            if best.is_none_or(|(known, _)| urgency < known) {
                best = Some((urgency, conflict));
            }
            if class > Cardinality::Cardinal && !target {
                others.push(conflict);
            }
        }
        let Some((urgency, conflict)) =
            best.or_else(|| Some(((Cardinality::NonCardinal, 1), conflicts.first()?)))
        else {
            return Ok(Vec::new());
        };
        if urgency.0 > Cardinality::Cardinal
            && let Some(split) = self.rectangles(id, &others, urgency)
        {
            return Ok(split);
        }
        self.split(id, conflict, stop)
    }

    /// True if the agent cannot avoid its part in a conflict at its least cost: its child costs
    /// more.
    fn is_cardinal_for(&mut self, agent: usize, conflict: &Conflict) -> bool {
        let single = self.with_mdd(agent);
        let levels = single.singletons.get().map_or(&[][..], Vec::as_slice);
        let at = |time: u32| levels.get(time as usize).copied().unwrap_or(SEVERAL);
        let time = conflict.time;
        match &conflict.kind {
            Kind::Cell(v) => {
                let goal = self.route(agent).stays && self.route(agent).goals.last() == Some(v);
                let steps = time..=(time + self.rules.delay).min(self.rules.until);
                goal && time + self.rules.delay >= single.bound
                    || steps.clone().any(|time| at(time) == *v)
            }
            Kind::Swap([from, to]) => {
                let [from, to] = if conflict.agents[0] as usize == agent {
                    [*from, *to]
                } else {
                    [*to, *from]
                };
                at(time) == from && at(time + 1) == to
            }
            Kind::Ring(members) => {
                let place = members
                    .iter()
                    .position(|(member, _)| *member as usize == agent);
                place.is_some_and(|place| {
                    let to = members[(place + 1) % members.len()].1;
                    at(time) == members[place].1 && at(time + 1) == to
                })
            }
        }
    }

    /// The path of an agent in the loaded node, with the single cells of its MDD known.
    pub(super) fn with_mdd(&mut self, agent: usize) -> Rc<AgentPath> {
        let single = match &self.loaded[agent] {
            Some(single) => Rc::clone(single),
            None => unreachable!("the node is loaded"),
        };
        if single.singletons.get().is_none() {
            self.fill_table(agent, single.origin.get(), None);
            let route = self.route(agent);
            let levels = self.mdd.singletons(
                self.poses,
                route,
                &self.table,
                single.bound,
                self.rules.until,
            );
            // Nobody else can have set it meanwhile.
            let _ = single.singletons.set(levels);
        }
        single
    }
}

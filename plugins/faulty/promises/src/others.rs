//! The other kinds, and planners whose description alone is wrong.

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicBool, Ordering};

use fleetyard_abi::sdk::{
    FailPolicy, Failure, InstanceGenerator, InvocationPolicy, Options, Planner, Plugin, Sink,
};
use fleetyard_abi::{
    Budget, Capabilities, Capability, Descriptor, FleetState, FleetStatus, Goals, GridPlan,
    Instance, Kind, Plan, SharedEnvironment, Status, monotonic_ns,
};
use serde_json::json;

use crate::{Choice, Mistake};

fn claims() -> Capabilities {
    Capabilities::of(&[
        Capability::Grid,
        Capability::EightConnected,
        Capability::Pebble,
        Capability::Rotation,
        Capability::Windowed,
        Capability::DuplicateGoals,
        Capability::Deterministic,
    ])
}

/// Everybody stays.
pub(crate) struct Policy(Mistake);

impl Plugin for Policy {
    fn descriptor() -> Descriptor {
        Descriptor {
            capabilities: claims(),
            ..Choice::descriptor(Kind::FailPolicy, "promising-policy")
        }
    }

    fn create(options: Options<'_>) -> Result<Self, Failure> {
        Ok(Self(Choice::read(options)?.mistake))
    }
}

impl FailPolicy for Policy {
    type Map = ();

    fn prepare(&mut self, _: &SharedEnvironment, _: &Budget, _: &dyn Sink) -> Result<(), Failure> {
        Ok(())
    }

    fn recover(
        &mut self,
        (): &mut (),
        instance: &Instance,
        failed: Option<&Plan>,
        _: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        match (self.0, failed) {
            (Mistake::ReturnsFailedPlan, Some(failed)) => sink.submit(failed)?,
            (Mistake::NeedsFailedPlan, None) => {
                return Err(Failure::new(Status::InvalidInput, "no plan has failed"));
            }
            (Mistake::StandsElsewhere, _) => {
                let last = instance.starts.iter().rev();
                sink.submit(&GridPlan::from_paths(last.map(|start| [*start])))?;
            }
            _ => {
                let stay = instance.starts.iter().map(|start| [*start]);
                sink.submit(&GridPlan::from_paths(stay))?;
            }
        }
        Ok(())
    }
}

/// An instance generator that gives agents without a goal the cell where they are.
pub(crate) struct Generator(Mistake);

impl Plugin for Generator {
    fn descriptor() -> Descriptor {
        Descriptor {
            capabilities: claims(),
            ..Choice::descriptor(Kind::InstanceGenerator, "promising-generator")
        }
    }

    fn create(options: Options<'_>) -> Result<Self, Failure> {
        Ok(Self(Choice::read(options)?.mistake))
    }
}

impl InstanceGenerator for Generator {
    /// The blocked cells.
    type Map = Vec<u32>;

    fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        _: &Budget,
        _: &dyn Sink,
    ) -> Result<Vec<u32>, Failure> {
        let passable = environment.grid().map(|grid| grid.passable.clone());
        let passable = passable.unwrap_or_default();
        let blocked = |cell: &u32| passable[*cell as usize] == 0;
        Ok((0..passable.len() as u32).filter(blocked).collect())
    }

    fn generate(
        &mut self,
        blocked: &mut Vec<u32>,
        state: &FleetState,
        _: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        if self.0 == Mistake::IdleFleetFails && state.next.goals.items().is_empty() {
            return Err(Failure::new(Status::InternalError, "nobody has a goal"));
        }
        let mut goals: Vec<Vec<u32>> = state.next.goals.iter().map(<[u32]>::to_vec).collect();
        for (cell, open) in state.next.starts.iter().zip(&mut goals) {
            if open.is_empty() {
                open.push(*cell);
            }
        }
        if let (Mistake::BlockedGoals, Some(cell)) = (self.0, blocked.first()) {
            goals[0][0] = *cell;
        }
        if self.0 == Mistake::LosesAgents {
            goals.pop();
        }
        let goals: Goals = goals.into_iter().collect();
        let mut request = state.request(goals);
        match self.0 {
            Mistake::LongerWindow => request.window_steps += 1,
            Mistake::ForgetsWindow => request.window_steps = 0,
            _ => {}
        }
        sink.submit_request(&request)?;
        Ok(())
    }
}

/// Every five seconds, and when nobody has anything to do.
pub(crate) struct Invocation(Mistake);

impl Plugin for Invocation {
    fn descriptor() -> Descriptor {
        Choice::descriptor(Kind::InvocationPolicy, "promising-invocation")
    }

    fn create(options: Options<'_>) -> Result<Self, Failure> {
        Ok(Self(Choice::read(options)?.mistake))
    }
}

impl InvocationPolicy for Invocation {
    fn should_invoke(&mut self, status: &FleetStatus, _: &dyn Sink) -> Result<bool, Failure> {
        if self.0 == Mistake::DiesOfCrowd && status.actions_left.len() > 1000 {
            std::process::abort();
        }
        let left: BTreeSet<u32> = status.actions_left.iter().copied().collect();
        let idle = left == BTreeSet::from([0]);
        Ok(self.0 != Mistake::NeverCalls && (idle || status.since_last_call_s >= 5.0))
    }
}

/// Knows every representation and every part, which it does not say before it is made.
pub(crate) struct AllKnowing;

static MADE: AtomicBool = AtomicBool::new(false);

impl Plugin for AllKnowing {
    fn descriptor() -> Descriptor {
        if !MADE.load(Ordering::Relaxed) {
            return described("all-knowing", PEBBLES);
        }
        Descriptor {
            features: vec!["part:org.example.conformance/1".into()],
            ..described("all-knowing", Capability::ALL)
        }
    }

    fn create(_: Options<'_>) -> Result<Self, Failure> {
        MADE.store(true, Ordering::Relaxed);
        Ok(Self)
    }
}

impl Planner for AllKnowing {
    type Map = ();

    fn prepare(&mut self, _: &SharedEnvironment, _: &Budget, _: &dyn Sink) -> Result<(), Failure> {
        Ok(())
    }

    fn plan(&mut self, (): &mut (), _: &Instance, _: &Budget, _: &dyn Sink) -> Result<(), Failure> {
        Err(Failure::new(Status::GaveUp, "it knows, but does not tell"))
    }
}

/// The common parts of three planners that are described wrongly and never get far.
macro_rules! described {
    ($name:ident, $about:literal, $descriptor:expr) => {
        #[doc = $about]
        pub(crate) struct $name;

        impl Plugin for $name {
            fn descriptor() -> Descriptor {
                $descriptor
            }

            fn create(_: Options<'_>) -> Result<Self, Failure> {
                Ok(Self)
            }
        }

        impl Planner for $name {
            type Map = ();

            fn prepare(
                &mut self,
                _: &SharedEnvironment,
                _: &Budget,
                _: &dyn Sink,
            ) -> Result<(), Failure> {
                Ok(())
            }

            fn plan(
                &mut self,
                (): &mut (),
                _: &Instance,
                _: &Budget,
                _: &dyn Sink,
            ) -> Result<(), Failure> {
                Err(Failure::new(Status::GaveUp, "not before it is described"))
            }
        }
    };
}

fn described(id: &str, claims: &[Capability]) -> Descriptor {
    Descriptor {
        version: env!("CARGO_PKG_VERSION").into(),
        capabilities: Capabilities::of(claims),
        ..Descriptor::new(Kind::Planner, id, "Is described wrongly.")
    }
}

const PEBBLES: &[Capability] = &[Capability::Grid, Capability::Pebble];

described! {
    TwoFaces, "Describes itself in another way each time.",
    Descriptor {
        description: format!("Made {} ns after the machine.", monotonic_ns()),
        ..described("two-faces", PEBBLES)
    }
}

described! {
    BadDefault, "Has a default that its schema forbids.",
    Descriptor {
        options_schema: json!({
            "type": "object",
            "additionalProperties": false,
            "properties": { "depth": { "type": "integer", "minimum": 1, "default": 0 } },
        }),
        ..described("bad-default", PEBBLES)
    }
}

described! {
    Contradiction, "Claims neighbours without a grid.",
    described("contradiction", &[Capability::EightConnected])
}

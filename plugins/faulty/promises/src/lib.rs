//! Plugins of all four kinds that answer as they should, except for one promise of
//! the contract, which they break: option `mistake`. A fixture for tests of the
//! conformance kit, which has to find the promise, and nothing to learn from.
//!
//! Those that break the protocol, crash or take what they are not given are in the
//! folder above.
//!
//! The planner `promising` claims whatever grids allow. With `none` it keeps all of it: everybody
//! goes at once if nobody meets anybody, else one agent after the other while all
//! others stand; who turns, takes time for it. `promising-roads` and `promising-plane` plan on
//! roadmaps and in the plane, the latter by knots and controls.

mod others;
mod places;
mod planner;

use fleetyard_abi::sdk::{Failure, Options, options_schema};
use fleetyard_abi::{Descriptor, Kind, Status};
use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::Value;

fleetyard_abi::export! {
    planners: [
        planner::Planner,
        places::Roads,
        places::Plane,
        others::TwoFaces,
        others::BadDefault,
        others::Contradiction,
        others::AllKnowing,
    ],
    fail_policies: [others::Policy],
    instance_generators: [others::Generator],
    invocation_policies: [others::Invocation],
}

/// The promise that is broken.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[schemars(inline)]
enum Mistake {
    #[default]
    None,
    // Being made, and ending.
    DiesOfUnknownOption,
    DiesOfBadOption,
    MadeOnce,
    LingersAtEnd,
    Chatters,
    // Answers of the planner.
    NoOneCell,
    OneAgentJumps,
    NothingToDoFails,
    IgnoresOthers,
    FollowsNobody,
    SwapsPlaces,
    ThroughWalls,
    NoMakespan,
    LimitedByNodesLies,
    TooFast,
    JumpsEdges,
    OtherForm,
    NanTimes,
    IgnoresMovers,
    OffControls,
    // What it claims.
    CutsCorners,
    SeesThroughWalls,
    TurnsInNoTime,
    WindowBlind,
    ParksTogether,
    WorseLater,
    LeavesNonsense,
    TooTight,
    OneThreadOnly,
    Unseeded,
    IgnoresArrows,
    IdleAgentBlocks,
    // Calls.
    OldAnswer,
    OldMap,
    DiesOfBadInput,
    Deaf,
    StaleCancel,
    SlowPrepare,
    Leaks,
    SpinsThreads,
    RefusesParts,
    RemembersCalls,
    DiesOfBytes,
    PlansForTheGallery,
    ShortSeeds,
    // Other kinds.
    ReturnsFailedPlan,
    NeedsFailedPlan,
    StandsElsewhere,
    LosesAgents,
    BlockedGoals,
    LongerWindow,
    ForgetsWindow,
    IdleFleetFails,
    DiesOfCrowd,
    NeverCalls,
}

#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct Choice {
    /// The promise that is broken.
    mistake: Mistake,
    /// Steps of delay that plans tolerate.
    #[schemars(range(max = 100))]
    k: u32,
    /// Does nothing.
    #[schemars(range(min = 1, max = 9))]
    patience: u32,
}

impl Default for Choice {
    fn default() -> Self {
        Self {
            mistake: Mistake::None,
            k: 0,
            patience: 4,
        }
    }
}

impl Choice {
    fn read(options: Options<'_>) -> Result<Self, Failure> {
        let given: Value = serde_json::from_str(options.json()).unwrap_or_default();
        let mistake = Mistake::deserialize(&given["mistake"]).unwrap_or_default();
        let object = given.as_object().cloned().unwrap_or_default();
        let known = |name: &String| ["mistake", "k", "patience"].contains(&name.as_str());
        if mistake == Mistake::DiesOfUnknownOption && !object.keys().all(known) {
            std::process::abort();
        }
        let refused = Failure::new(Status::InvalidInput, "options: refused as asked");
        let read = options.parse::<Self>();
        let fits = |choice: &Self| choice.k <= 100 && (1..=9).contains(&choice.patience);
        match read {
            Ok(choice) if fits(&choice) => Ok(choice),
            _ if mistake == Mistake::DiesOfBadOption && object.keys().all(known) => {
                std::process::abort()
            }
            Ok(_) => Err(refused),
            Err(failure) => Err(failure),
        }
    }

    fn descriptor(kind: Kind, id: &str) -> Descriptor {
        Descriptor {
            version: env!("CARGO_PKG_VERSION").into(),
            options_schema: options_schema::<Self>(),
            ..Descriptor::new(kind, id, "Breaks one promise of the contract on request.")
        }
    }
}

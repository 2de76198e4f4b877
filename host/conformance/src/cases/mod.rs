//! The table of cases.

mod answers;
mod calls;
mod claims;
mod contract;
mod places;
mod start;

use fleetyard_abi::{Capability, Kind};

use crate::stop::Step;
use crate::trial::Trial;

/// One check of a plugin.
pub struct Case {
    /// Its name, unique.
    pub name: &'static str,
    /// The kinds of plugin that it is for.
    pub kinds: &'static [Kind],
    /// Capabilities that the plugin has to claim.
    pub needs: &'static [Capability],
    /// The check, in a sentence.
    pub about: &'static str,
    pub(crate) run: fn(&mut Trial<'_>) -> Step<()>,
}

impl std::fmt::Debug for Case {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Case").field(&self.name).finish()
    }
}

/// There is no case of that name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UnknownCase {
    /// One whose name is much like it.
    pub nearest: Option<String>,
}

/// A case by its name.
pub fn find(name: &str) -> Result<&'static Case, UnknownCase> {
    let found = CASES.iter().find(|case| case.name == name);
    found.ok_or_else(|| {
        let names = CASES.iter().map(|case| case.name);
        let nearest = fleetyard_core::nearest(name, names, name.len() / 2);
        UnknownCase {
            nearest: nearest.map(ToOwned::to_owned),
        }
    })
}

const ALL: &[Kind] = &Kind::ALL;
const PLANNER: &[Kind] = &[Kind::Planner];
const POLICY: &[Kind] = &[Kind::FailPolicy];
const GENERATOR: &[Kind] = &[Kind::InstanceGenerator];
const INVOCATION: &[Kind] = &[Kind::InvocationPolicy];
/// Those who give plans.
const PLANS: &[Kind] = &[Kind::Planner, Kind::FailPolicy];
/// Those who know a map.
const MAPS: &[Kind] = &[Kind::Planner, Kind::FailPolicy, Kind::InstanceGenerator];

const NOTHING: &[Capability] = &[];
const PEBBLES: &[Capability] = &[Capability::Grid, Capability::Pebble];

macro_rules! cases {
    ($($name:literal, $kinds:expr, $needs:expr, $about:literal, $run:path;)*) => {
        /// Every case, in the order in which they are run.
        pub const CASES: &[Case] = &[$(Case {
            name: $name,
            kinds: $kinds,
            needs: $needs,
            about: $about,
            run: $run,
        },)*];
    };
}

cases! {
    "handshake", ALL, NOTHING,
    "starts, agrees on the version, and offers the plugin that it offered before",
    start::handshake;
    "descriptor", ALL, NOTHING,
    "describes itself twice in the same way, claims what belongs together, and has a schema \
     that its defaults satisfy",
    start::descriptor;
    "scan-time", ALL, NOTHING,
    "how long it takes until a plugin has described itself, which is what listing costs",
    start::scan_time;
    "default-options", ALL, NOTHING,
    "accepts every default of its schema by name, one by one and together",
    start::default_options;
    "unknown-option", ALL, NOTHING,
    "lives through an option that it does not have, and can be made afterwards",
    start::unknown_option;
    "invalid-options", ALL, NOTHING,
    "lives through values that its schema forbids, and can be made afterwards",
    start::invalid_options;
    "output", ALL, NOTHING,
    "keeps standard output to the protocol and its log to a readable length",
    start::output;
    "ending", ALL, NOTHING,
    "says nothing after its last answer and ends by itself when told to",
    start::ending;
    "host-process", ALL, NOTHING,
    "called in the host's process it leaves arithmetic, signals, files and limits as they were",
    start::host_process;

    "one-cell", PLANS, NOTHING,
    "a map of one cell and an agent that is there",
    answers::one_cell;
    "one-agent", PLANS, NOTHING,
    "one agent in an empty corridor, and one on a way round a wall",
    answers::one_agent;
    "arrived", PLANS, NOTHING,
    "everybody is at the goal: nothing to do",
    answers::arrived;
    "following", PLANS, NOTHING,
    "a row of agents moves up a corridor, each into the cell that another one leaves",
    answers::following;
    "cycle", PLANS, NOTHING,
    "four agents on four cells move round",
    answers::cycle;
    "crossing", MAPS, NOTHING,
    "two ways cross in the open: one of two has to wait or go round",
    answers::crossing;
    "passing-bay", PLANS, NOTHING,
    "two agents meet in a corridor with a bay",
    answers::passing_bay;
    "random-instances", MAPS, NOTHING,
    "instances from the seed, on empty, random, room and maze maps, each with a plan that the \
     kit knows",
    answers::random_instances;
    "no-room", PLANS, NOTHING,
    "two agents have to change places where they cannot: no plan must be claimed",
    answers::no_room;
    "unreachable-goal", PLANS, NOTHING,
    "a goal behind a wall: no plan must be claimed",
    answers::unreachable_goal;
    "makespan", PLANNER, PEBBLES,
    "the other objective: a valid plan, or `unsupported`",
    answers::makespan;
    "figures", PLANNER, PEBBLES,
    "figures that it reports of itself are what they may be, and none contradicts its plan",
    answers::figures;
    "node-limit", PLANNER, NOTHING,
    "a limit of one node: a valid plan or none, and no harm",
    answers::node_limit;
    "failed-plan", POLICY, PEBBLES,
    "recovers from what a planner left: colliding paths, of different lengths, of all agents",
    answers::failed_plan;
    "fleet-states", GENERATOR, PEBBLES,
    "fleets in which nobody has a goal, everybody has one, and some have one and there are tasks",
    answers::fleet_states;
    "fleet-statuses", INVOCATION, NOTHING,
    "answers at the edges: no time passed, much time passed, one agent, many, nothing left to \
     do; and calls the planner when nothing is left to do for long",
    answers::fleet_statuses;

    "eight-connected", MAPS, &[Capability::Grid, Capability::Pebble, Capability::EightConnected],
    "diagonal moves, none past the corner of an obstacle, none across another",
    claims::eight_connected;
    "rotation", MAPS, &[Capability::Grid, Capability::Rotation],
    "agents that have to turn before they move another way",
    claims::rotation;
    "any-angle", PLANNER, &[Capability::Grid, Capability::AnyAngle],
    "one agent that goes in straight lines between cells, judged by the cells on each line",
    claims::any_angle;
    "windowed", MAPS, &[Capability::Grid, Capability::Pebble, Capability::Windowed],
    "several goals per agent, and collisions count within the window alone",
    claims::windowed;
    "duplicate-goals", PLANS,
    &[Capability::Grid, Capability::Pebble, Capability::DuplicateGoals],
    "agents that share a goal",
    claims::duplicate_goals;
    "anytime", PLANNER, &[Capability::Grid, Capability::Pebble, Capability::Anytime],
    "each plan is valid and better than the one before it, until the budget ends",
    claims::anytime;
    "colliding-plans", PLANNER,
    &[Capability::Grid, Capability::Pebble, Capability::CollidingPlans],
    "what it leaves when it fails are paths of these agents, collisions aside",
    claims::colliding_plans;
    "k-robust", PLANNER, &[Capability::Grid, Capability::Pebble, Capability::KRobust],
    "with the option `k` at 1, nobody enters a cell in the step after somebody else",
    claims::k_robust;
    "threads", MAPS, &[Capability::Grid, Capability::Pebble, Capability::Threads],
    "two threads are allowed, and the answer is as valid",
    claims::threads;
    "move-mask", PLANS, &[Capability::Grid, Capability::Pebble, Capability::MoveMask],
    "one-way streets: round the block rather than against the arrows, and no plan where none leads",
    claims::move_mask;
    "idle-agents", PLANS, &[Capability::Idle],
    "agents without a goal, one of them in the way of another one: it makes room",
    claims::idle_agents;
    "heterogeneous", PLANNER, &[Capability::Heterogeneous],
    "discs of two sizes in one team, a gap that only the smaller one fits through, a disc beside a \
     rectangle, and two dynamics",
    claims::heterogeneous;
    "roadmap-one", PLANNER, &[Capability::Roadmap],
    "one robot on a roadmap: the shortest way by length, and edges that lead one way",
    places::roadmap_one;
    "roadmap-crossing", PLANNER, &[Capability::Roadmap],
    "two edges that cross without a vertex: one of two robots has to wait",
    places::roadmap_crossing;
    "roadmap-near", PLANNER, &[Capability::Roadmap],
    "vertices nearer than the separation: nobody passes one while somebody is at the other",
    places::roadmap_near;
    "stop-go", PLANNER, &[Capability::Roadmap, Capability::StopGo],
    "edges take the time that they take at full speed, no less and no more",
    places::stop_go;
    "slower", PLANNER, &[Capability::Roadmap, Capability::Slower],
    "edges take the time that they take at full speed, or more",
    places::slower;
    "workspace-one", PLANNER, &[Capability::Continuous],
    "one disc in the plane: straight on, round a block, and no plan through a wall",
    places::workspace_one;
    "workspace-gap", PLANNER, &[Capability::Continuous],
    "a gap that a disc just fits through, and one that a rectangle fits through lengthwise",
    places::workspace_gap;
    "workspace-mover", PLANNER, &[Capability::Continuous],
    "an obstacle that moves across the way",
    places::workspace_mover;
    "limits", PLANNER, &[Capability::Continuous, Capability::Dynamics],
    "discs that keep to their limits, of each of the dynamics that it lists",
    places::limits;
    "controls", PLANNER, &[Capability::Continuous, Capability::Dynamics],
    "controls lead to the knots and the goal, and keep to limits, straight and round a block",
    places::controls;
    "deterministic", MAPS, &[Capability::Deterministic],
    "two fresh starts, the same question and seed: the same answer",
    claims::deterministic;

    "unknown-part", MAPS, NOTHING,
    "a part that it does not know on map and input: the answer is as without it",
    contract::unknown_part;
    "critical-part", MAPS, NOTHING,
    "a critical part that it does not know: `unsupported`, with the name of the part",
    contract::critical_part;
    "memory-replayed", MAPS, NOTHING,
    "memory of the fleet, which it reads: the same answer from a fresh process and after a hundred \
     other calls",
    contract::memory_replayed;
    "kept-bytes", MAPS, NOTHING,
    "bytes that it kept come back, and it lives through bytes that it never kept",
    contract::kept_bytes;
    "annotations-off", PLANS, NOTHING,
    "asked what it wants to show, and not asked: the same plan, and annotations that are in order",
    contract::annotations_off;
    "other-representation", MAPS, NOTHING,
    "a map of a representation that it does not claim: `unsupported`",
    contract::other_representation;
    "seed-53", MAPS, NOTHING,
    "the largest seed, 2^53 - 1",
    contract::seed_53;

    "repeated-calls", ALL, NOTHING,
    "the same question again in one session, another one in between",
    calls::repeated_calls;
    "other-map", MAPS, NOTHING,
    "a smaller map, a larger one and the first again in one session",
    calls::other_map;
    "made-again", ALL, NOTHING,
    "a second object in one session, after the first has worked",
    calls::made_again;
    "bad-input", MAPS, NOTHING,
    "starts and goals on obstacles, two agents in one cell: some status, and the next question \
     is answered as if nothing had been",
    calls::bad_input;
    "deadline", MAPS, NOTHING,
    "what nobody can finish: returns when the budget ends, or within the grace",
    calls::deadline;
    "cancelled", MAPS, NOTHING,
    "a call that is cancelled when it begins returns within the grace, and the next one is \
     answered",
    calls::cancelled;
    "prepare-deadline", MAPS, NOTHING,
    "a large map and no time to learn it: returns within the grace",
    calls::prepare_deadline;
    "memory-growth", ALL, NOTHING,
    "four times as many calls need no more memory",
    calls::memory_growth;
    "large-case", PLANNER, &[Capability::Grid],
    "two agents, or one, on 1000 × 1000 open cells within 300 MB of memory",
    calls::large_case;
    "thread-limit", ALL, NOTHING,
    "allowed one thread, it uses no more CPU time than wall time",
    calls::thread_limit;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_every_capability_is_asked_for() {
        for (index, case) in CASES.iter().enumerate() {
            let name = case.name;
            assert!(
                CASES[..index].iter().all(|other| other.name != name),
                "{name}"
            );
            assert!(!case.kinds.is_empty(), "{name}");
            // A sentence is put after the name, in a table.
            assert!(!case.about.contains(['|', '\n']), "{name}");
            assert!(!case.about.ends_with('.'), "{name}");
        }
        for capability in Capability::ALL {
            let asked = CASES.iter().any(|case| case.needs.contains(capability));
            assert!(asked, "no case needs `{}`", capability.as_str());
        }
    }

    #[test]
    fn unknown_names_are_near_to_known_ones() {
        assert_eq!(
            find("deadline").map(|case| case.name).ok(),
            Some("deadline")
        );
        let nearest = |name: &str| find(name).err().and_then(|unknown| unknown.nearest);
        assert_eq!(nearest("dedline").as_deref(), Some("deadline"));
        assert_eq!(nearest("xyzzy"), None);
    }
}

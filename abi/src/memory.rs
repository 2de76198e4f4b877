//! Parts with the memory of a fleet. Modules keep none: the host keeps it, hands it over with each
//! call to those that list `part:ID` in their features, and records what runs need to repeat.

use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::c;
use crate::model::{FleetState, Instance, Part};
use crate::moves::{self, MoveError};
use crate::plan::GridPlan;

/// Averages of how a fleet moves: where robots wait, and which way they go. Two snapshots of them,
/// taken a period apart, so that a planner can turn from the one to the other bit by bit and key
/// caches by their numbers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Traffic {
    /// Simulated time from a snapshot to the next.
    pub period_s: f64,
    /// Time constant of the exponential averages.
    pub time_constant_s: f64,
    /// Simulated time since the last snapshot was taken, less than the period.
    pub since_s: f64,
    /// The unit of flows: a flow of 1 stands for so many moves per second.
    pub flow_unit_per_s: f64,
    /// The last snapshot.
    pub last: Snapshot,
    /// The one before; the same as long as there is only one.
    pub before: Snapshot,
}

impl Traffic {
    /// The snapshot to use for something with this number, such as a goal: the last one for a share
    /// of all numbers that grows from none to all in the course of a period, and the one before for
    /// the others. So what is made from snapshots changes in turn, and answers depend on the
    /// question alone.
    pub fn snapshot_of(&self, number: u64) -> &Snapshot {
        // Multiplying by the golden ratio spreads numbers that follow each other (Knuth, TAOCP 3,
        // section 6.4).
        let spread = number.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 32;
        let turn_s = spread as f64 / 4_294_967_296.0 * self.period_s;
        if turn_s < self.since_s {
            &self.last
        } else {
            &self.before
        }
    }
}

/// Averages at a moment. Everything is 0 in the first one, which is taken when a run begins.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Snapshot {
    /// Number of snapshots before it.
    pub number: u64,
    /// Per place, the share of time in which somebody stood there whose goal is elsewhere, in units
    /// of 1/255: two hexadecimal digits a place, and a letter `g` to `m` for a run of 1, 2, 4, 8,
    /// 16, 32 or 64 zeros.
    #[serde(with = "runs")]
    #[schemars(with = "String")]
    pub waiting: Vec<u8>,
    /// Per move, the flow in units of `flow_unit_per_s`, written alike: on a grid the moves from
    /// cell 0 in the order of the letters `NESW`, with 8 neighbours `NESWnesw`, then those from cell 1;
    /// on a roadmap its edges.
    #[serde(with = "runs")]
    #[schemars(with = "String")]
    pub flow: Vec<u8>,
}

/// The rest of the last plan: what of it nobody is committed to.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct RestOfPlan {
    /// A path per agent from its start on, a letter of moves per step. Where agents keep to their
    /// times, paths do not collide.
    pub paths: Vec<String>,
}

impl RestOfPlan {
    /// The rest as a plan for agents with these starts, on a grid of so many rows and columns.
    pub fn plan(&self, starts: &[u32], rows: u32, cols: u32) -> Result<GridPlan, MoveError> {
        let paths = self.paths.iter().zip(starts);
        let cells = paths.map(|(path, start)| moves::decode(*start, path, rows, cols));
        let cells = cells.collect::<Result<Vec<_>, _>>()?;
        Ok(GridPlan::from_paths(cells))
    }
}

/// The tasks that goals belong to, and since when agents have them: a column each, the goals of all
/// agents one after the other as the instance has them.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct GoalTasks {
    /// Simulated time since the run began, as in the state: the age of a goal is measured from here.
    pub time_s: f64,
    /// The task of a goal; `null` for one that is of no task, or not the agent's own.
    pub tasks: Vec<Option<u64>>,
    /// The number of a goal among the task's places, from 0; `null` as above.
    pub errands: Vec<Option<u32>>,
    /// When its task was released; for other goals as `given_s`.
    pub released_s: Vec<f64>,
    /// When its task was given to the agent. A goal without a task is given when the one before it
    /// is reached; `time_s` if that is still to come.
    pub given_s: Vec<f64>,
}

impl GoalTasks {
    /// Number of goals.
    pub fn len(&self) -> usize {
        self.tasks.len()
    }

    /// True if there are no goals.
    pub fn is_empty(&self) -> bool {
        self.tasks.is_empty()
    }

    /// Adds a goal: its task and which of the task's places it is, if it is one, when that was
    /// released, and when it was given to the agent.
    pub fn push(&mut self, errand: Option<(u64, u32)>, released_s: f64, given_s: f64) {
        let (task, at) = errand.unzip();
        self.tasks.push(task);
        self.errands.push(at);
        self.released_s.push(released_s);
        self.given_s.push(given_s);
    }

    /// Checks that columns have the same length.
    fn check(&self) -> Result<(), String> {
        let columns = [
            self.errands.len(),
            self.released_s.len(),
            self.given_s.len(),
        ];
        if columns == [self.len(); 3] {
            Ok(())
        } else {
            Err("the columns of tasks, errands and times have different lengths".into())
        }
    }
}

/// A guidance graph: factors on what moves and waits cost (Zhang, Jiang, Bhatt, Nikolaidis, Li,
/// "Guidance graph optimization for lifelong multi-agent path finding", IJCAI 2024). Where it is cheap
/// robots are to go, where it is dear they are not, and every way stays allowed.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Guidance {
    /// Per move, in the order of the snapshots' `flow`, the factor of its cost in units of 1/100, from
    /// 10 to 10000: 100 changes nothing. Moves that the map does not have have one as well.
    #[schemars(inner(range(min = 10, max = 10_000)))]
    pub moves: Vec<u16>,
    /// The same per place, for a wait there.
    #[schemars(inner(range(min = 10, max = 10_000)))]
    pub waits: Vec<u16>,
}

impl Guidance {
    /// Factors that change nothing, of so many moves and places.
    pub fn neutral(moves: usize, places: usize) -> Self {
        Self {
            moves: vec![c::GUIDANCE_NEUTRAL; moves],
            waits: vec![c::GUIDANCE_NEUTRAL; places],
        }
    }

    /// Checks that factors are within their bounds.
    ///
    /// # Errors
    ///
    /// The first one that is not, with its place.
    pub fn check(&self) -> Result<(), String> {
        let bounds = c::GUIDANCE_LEAST..=c::GUIDANCE_MOST;
        for (name, factors) in [("moves", &self.moves), ("waits", &self.waits)] {
            if let Some(at) = factors.iter().position(|factor| !bounds.contains(factor)) {
                return Err(format!(
                    "{name}[{at}] is {}, not a factor from {} to {} hundredths",
                    factors[at],
                    bounds.start(),
                    bounds.end()
                ));
            }
        }
        Ok(())
    }

    /// Checks that it is of a map with so many moves and places.
    ///
    /// # Errors
    ///
    /// Another number of factors.
    pub fn check_size(&self, moves: usize, places: usize) -> Result<(), String> {
        for (name, found, wanted) in [
            ("moves", self.moves.len(), moves),
            ("waits", self.waits.len(), places),
        ] {
            if found != wanted {
                return Err(format!(
                    "guidance has {found} factors of {name}, but the map takes {wanted}"
                ));
            }
        }
        Ok(())
    }
}

/// Bytes that a plugin kept, as it gave them last.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct Kept {
    /// The bytes, at most [`c::KEPT_LIMIT`]: two hexadecimal digits each.
    #[serde(with = "hex")]
    #[schemars(with = "String")]
    pub bytes: Vec<u8>,
}

/// Refuses more bytes than a plugin may keep.
pub fn may_be_kept(bytes: u64) -> Result<(), String> {
    if bytes <= c::KEPT_LIMIT {
        return Ok(());
    }
    Err(format!(
        "it keeps {bytes} bytes, more than the limit of {}",
        c::KEPT_LIMIT
    ))
}

/// The data of a part.
#[derive(Debug, Clone, PartialEq)]
pub enum Data {
    /// A JSON value: what this version does not know.
    Json(serde_json::Value),
    /// `fleetyard.traffic/1`
    Traffic(Arc<Traffic>),
    /// `fleetyard.rest-of-plan/1`
    RestOfPlan(Arc<RestOfPlan>),
    /// `fleetyard.goal-tasks/1`
    GoalTasks(Arc<GoalTasks>),
    /// `fleetyard.guidance/1`
    Guidance(Arc<Guidance>),
    /// `fleetyard.kept/1`
    Kept(Arc<Kept>),
}

impl Data {
    /// The data of the part with this identifier, from JSON.
    pub(crate) fn read(id: &str, value: serde_json::Value) -> Result<Self, String> {
        let read = match id {
            c::TRAFFIC_ID => {
                serde_json::from_value(value).map(|data| Self::Traffic(Arc::new(data)))
            }
            c::REST_OF_PLAN_ID => {
                serde_json::from_value(value).map(|data| Self::RestOfPlan(Arc::new(data)))
            }
            c::GOAL_TASKS_ID => {
                let data: Result<GoalTasks, _> = serde_json::from_value(value);
                if let Ok(data) = &data {
                    data.check()
                        .map_err(|reason| format!("the part `{id}` is malformed: {reason}"))?;
                }
                data.map(|data| Self::GoalTasks(Arc::new(data)))
            }
            c::GUIDANCE_ID => {
                let data: Result<Guidance, _> = serde_json::from_value(value);
                if let Ok(data) = &data {
                    data.check()
                        .map_err(|reason| format!("the part `{id}` is malformed: {reason}"))?;
                }
                data.map(|data| Self::Guidance(Arc::new(data)))
            }
            c::KEPT_ID => serde_json::from_value(value).map(|data| Self::Kept(Arc::new(data))),
            _ => Ok(Self::Json(value)),
        };
        read.map_err(|error| format!("the part `{id}` is malformed: {error}"))
    }
}

impl From<serde_json::Value> for Data {
    fn from(value: serde_json::Value) -> Self {
        Self::Json(value)
    }
}

impl Serialize for Data {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Json(value) => value.serialize(serializer),
            Self::Traffic(data) => data.serialize(serializer),
            Self::RestOfPlan(data) => data.serialize(serializer),
            Self::GoalTasks(data) => data.serialize(serializer),
            Self::Guidance(data) => data.serialize(serializer),
            Self::Kept(data) => data.serialize(serializer),
        }
    }
}

macro_rules! known {
    ($($type:ident, $id:ident, $name:ident, $about:literal;)*) => {
        $(
            impl From<Arc<$type>> for Part {
                fn from(data: Arc<$type>) -> Self {
                    Self {
                        id: c::$id.into(),
                        critical: false,
                        data: Data::$type(data),
                    }
                }
            }

            impl From<$type> for Part {
                fn from(data: $type) -> Self {
                    Arc::new(data).into()
                }
            }
        )*

        impl Instance {
            $(
                #[doc = $about]
                pub fn $name(&self) -> Option<&$type> {
                    find(&self.parts, |data| match data {
                        Data::$type(found) => Some(found.as_ref()),
                        _ => None,
                    })
                }
            )*
        }

        impl FleetState {
            $(
                #[doc = $about]
                pub fn $name(&self) -> Option<&$type> {
                    find(&self.parts, |data| match data {
                        Data::$type(found) => Some(found.as_ref()),
                        _ => None,
                    })
                }
            )*
        }
    };
}

known! {
    Traffic, TRAFFIC_ID, traffic,
    "Averages of waiting and of flows, if the host keeps them for this plugin.";
    RestOfPlan, REST_OF_PLAN_ID, rest_of_plan,
    "The rest of the last plan, if the host keeps it for this plugin.";
    GoalTasks, GOAL_TASKS_ID, goal_tasks,
    "The tasks of goals, if the host keeps them for this plugin.";
    Guidance, GUIDANCE_ID, guidance,
    "The guidance graph of the map, if the run has one and this plugin reads it.";
    Kept, KEPT_ID, kept,
    "The bytes that this plugin kept last, if the host keeps them and there are some.";
}

fn find<'a, T>(parts: &'a [Part], is: impl Fn(&'a Data) -> Option<T>) -> Option<T> {
    parts.iter().find_map(|part| is(&part.data))
}

const DIGITS: &[u8; 16] = b"0123456789abcdef";

/// No hexadecimal digit.
const NONE: u8 = 16;

/// The value of a hexadecimal digit; [`NONE`] of any other letter.
const VALUES: [u8; 256] = {
    let mut values = [NONE; 256];
    let mut value = 0;
    while value < 16 {
        values[DIGITS[value] as usize] = value as u8;
        values[DIGITS[value].to_ascii_uppercase() as usize] = value as u8;
        value += 1;
    }
    values
};

/// The two hexadecimal digits of a byte.
pub(crate) fn digits_of(byte: u8) -> [u8; 2] {
    [byte >> 4, byte & 15].map(|value| DIGITS[usize::from(value)])
}

/// The byte of two hexadecimal digits.
pub(crate) fn byte_of([high, low]: [u8; 2]) -> Option<u8> {
    let [high, low] = [VALUES[usize::from(high)], VALUES[usize::from(low)]];
    (high < NONE && low < NONE).then_some(high << 4 | low)
}

fn write<S: Serializer>(text: &[u8], serializer: S) -> Result<S::Ok, S::Error> {
    let text = std::str::from_utf8(text).map_err(serde::ser::Error::custom)?;
    serializer.serialize_str(text)
}

/// Bytes as two hexadecimal digits each.
pub mod hex {
    use serde::de::Error;

    use super::{Deserialize, Deserializer, Serializer, byte_of, digits_of, write};

    /// Writes bytes.
    pub fn serialize<S: Serializer>(bytes: &[u8], serializer: S) -> Result<S::Ok, S::Error> {
        let mut text = Vec::with_capacity(2 * bytes.len());
        text.extend(bytes.iter().copied().flat_map(digits_of));
        write(&text, serializer)
    }

    /// Reads bytes.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<u8>, D::Error> {
        let text = String::deserialize(deserializer)?;
        let (pairs, rest) = text.as_bytes().as_chunks::<2>();
        let bytes: Option<Vec<u8>> = pairs.iter().map(|pair| byte_of(*pair)).collect();
        bytes
            .filter(|_| rest.is_empty())
            .ok_or_else(|| D::Error::custom("bytes are two hexadecimal digits each"))
    }
}

/// Bytes of which many are 0: two hexadecimal digits each, and a letter for a run of zeros.
mod runs {
    use serde::de::Error;

    use super::{Deserialize, Deserializer, Serializer, byte_of, digits_of, write};

    /// Stands for one zero; each further letter for twice as many as the one before.
    const FIRST: u8 = b'g';
    const LAST: u8 = b'm';

    pub(super) fn serialize<S: Serializer>(bytes: &[u8], serializer: S) -> Result<S::Ok, S::Error> {
        let mut text = Vec::with_capacity(bytes.len() / 2);
        let mut rest = bytes;
        while let Some(byte) = rest.first() {
            if *byte != 0 {
                text.extend(digits_of(*byte));
                rest = &rest[1..];
                continue;
            }
            let run = rest.iter().position(|byte| *byte != 0);
            let mut zeros = run.unwrap_or(rest.len());
            rest = &rest[zeros..];
            while zeros > 0 {
                let letter = zeros.ilog2().min(u32::from(LAST - FIRST));
                text.push(FIRST + letter as u8);
                zeros -= 1 << letter;
            }
        }
        write(&text, serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Vec<u8>, D::Error> {
        let text = String::deserialize(deserializer)?;
        let wrong = || {
            D::Error::custom("bytes are two hexadecimal digits each, or letters g to m for zeros")
        };
        let mut bytes = Vec::with_capacity(4 * text.len());
        let mut rest = text.as_bytes();
        while let [letter, behind @ ..] = rest {
            if (FIRST..=LAST).contains(letter) {
                bytes.resize(bytes.len() + (1 << (letter - FIRST)), 0);
                rest = behind;
            } else {
                let (pair, behind) = rest.split_first_chunk::<2>().ok_or_else(wrong)?;
                bytes.push(byte_of(*pair).ok_or_else(wrong)?);
                rest = behind;
            }
        }
        Ok(bytes)
    }
}

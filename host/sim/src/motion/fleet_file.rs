//! Fleet files: the format `fleetyard.fleet/1`, one JSON object.
//!
//! ```json
//! {
//!   "format": "fleetyard.fleet/1",
//!   "profiles": {
//!     "agv": {
//!       "footprint": {"disc": {"radius_m": 0.35}},
//!       "model": {"differential-drive": {"max_speed_m_per_s": 1.5}}
//!     },
//!     "dog": "go2"
//!   },
//!   "agents": {"cycle": ["agv", "agv", "dog"]}
//! }
//! ```
//!
//! All three keys are needed, in any order. A profile is an object or the name of a
//! preset that has a body; a model likewise. `agents` is a list with one name per agent,
//! `{"cycle": [...]}`, which begins anew as often as needed, or `{"all": "agv"}`.

use std::fmt;
use std::path::Path;

use fleetyard_core::json::{self, Listed, ReadList, named, read_key, read_object, with_hint};
use fleetyard_core::{InputError, load_file, shown};
use serde::de::{
    DeserializeSeed, Deserializer, Error as _, IgnoredAny, MapAccess, SeqAccess, Visitor,
};
use serde::{Deserialize, Serialize};

use super::fleet::{Fleet, FleetError, Profile};

/// The value of `format`.
pub const FLEET_FORMAT: &str = "fleetyard.fleet/1";

/// Largest fleet file that is read, in bytes.
pub const FLEET_FILE_LIMIT: u64 = 1 << 28;

const HINT: &str = "a fleet file is a JSON object with format, profiles and agents";

/// Content of a fleet file.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FleetFile {
    /// The kinds of robots with their names, in the order of the file.
    pub profiles: Vec<(String, Profile)>,
    /// Profile of each agent.
    pub agents: Assignment,
}

/// Assignment of profiles to agents, as indices.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Assignment {
    /// One entry per agent.
    Each(Vec<u32>),
    /// Agent i has entry i modulo their number, of which there is at least one.
    Cycle(Vec<u32>),
    /// All agents have one profile.
    All(u32),
}

impl FleetFile {
    /// The fleet of an instance with this number of agents.
    pub fn fleet(&self, agents: usize) -> Result<Fleet, FleetError> {
        let profile_of = match &self.agents {
            Assignment::Each(list) if list.len() != agents => {
                return Err(FleetError::AgentCount {
                    listed: list.len(),
                    agents,
                });
            }
            Assignment::Each(list) => list.clone(),
            Assignment::Cycle(list) => list.iter().copied().cycle().take(agents).collect(),
            Assignment::All(profile) => vec![*profile; agents],
        };
        let profiles = self.profiles.iter().map(|(_, profile)| profile.clone());
        Fleet::new(profiles.collect(), profile_of)
    }
}

/// Reads and parses a fleet file.
pub fn load_fleet(path: impl AsRef<Path>) -> Result<FleetFile, InputError> {
    load_file(path, FLEET_FILE_LIMIT, read_fleet)
}

/// Parses the content of a fleet file. Errors name `source`.
pub fn read_fleet(source: &str, bytes: &[u8]) -> Result<FleetFile, InputError> {
    let hinted = |error: InputError| error.or_hint(HINT);
    let document: Document = read_object(source, bytes, HINT).map_err(hinted)?;
    let Profiles(profiles) = document.profiles;
    // Names can only be resolved when all profiles are known, and an unknown one is
    // refused at its place: so the agents are read in a second pass.
    let agents = read_key(source, bytes, "agents", Agents(&profiles)).map_err(hinted)?;
    Ok(FleetFile { profiles, agents })
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a fleet: a JSON object")]
struct Document {
    #[serde(deserialize_with = "format", rename = "format")]
    _format: (),
    profiles: Profiles,
    #[serde(rename = "agents")]
    _agents: IgnoredAny,
}

fn format<'de, D: Deserializer<'de>>(deserializer: D) -> Result<(), D::Error> {
    json::format(deserializer, FLEET_FORMAT)
}

/// At least one profile, in the order of the file.
struct Profiles(Vec<(String, Profile)>);

impl<'de> Deserialize<'de> for Profiles {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        named(deserializer, "profile", "profiles").map(Self)
    }
}

/// The value of `agents`.
struct Agents<'a>(&'a [(String, Profile)]);

impl<'de> DeserializeSeed<'de> for Agents<'_> {
    type Value = Assignment;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Assignment, D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Agents<'_> {
    type Value = Assignment;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(r#"a list of names, {"cycle": [...]} or {"all": NAME}"#)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Assignment, A::Error> {
        names(seq, self.0).map(Assignment::Each)
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Assignment, A::Error> {
        let hint = r#"use a list of names, {"cycle": [...]} or {"all": NAME}"#;
        let assignment = match map.next_key::<String>()?.as_deref() {
            Some("all") => Assignment::All(map.next_value_seed(Name(self.0))?),
            Some("cycle") => Assignment::Cycle(map.next_value_seed(Listed(Cycle(self.0)))?),
            Some(other) => {
                let reason = format!("{:?} is no way to assign profiles", shown(other));
                return Err(with_hint(&reason, Some(hint)));
            }
            None => return Err(with_hint(&"agents is empty", Some(hint))),
        };
        if map.next_key::<IgnoredAny>()?.is_some() {
            return Err(with_hint(&"agents has more than one key", Some(hint)));
        }
        Ok(assignment)
    }
}

struct Cycle<'a>(&'a [(String, Profile)]);

impl<'de> ReadList<'de> for Cycle<'_> {
    const EXPECTED: &'static str = "a list of names";
    type Value = Vec<u32>;

    fn read<A: SeqAccess<'de>>(self, list: A) -> Result<Vec<u32>, A::Error> {
        let cycle = names(list, self.0)?;
        if cycle.is_empty() {
            return Err(A::Error::custom("the cycle is empty"));
        }
        Ok(cycle)
    }
}

fn names<'de, A: SeqAccess<'de>>(
    mut seq: A,
    known: &[(String, Profile)],
) -> Result<Vec<u32>, A::Error> {
    let mut list = Vec::new();
    while let Some(profile) = seq.next_element_seed(Name(known))? {
        list.push(profile);
    }
    Ok(list)
}

/// The index of a profile by its name.
struct Name<'a>(&'a [(String, Profile)]);

impl<'de> DeserializeSeed<'de> for Name<'_> {
    type Value = u32;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<u32, D::Error> {
        deserializer.deserialize_str(self)
    }
}

impl Visitor<'_> for Name<'_> {
    type Value = u32;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the name of a profile")
    }

    fn visit_str<E: serde::de::Error>(self, name: &str) -> Result<u32, E> {
        let found = self.0.iter().position(|(known, _)| known == name);
        found.map(|at| at as u32).ok_or_else(|| {
            let reason = format!("{:?} is not one of the profiles", shown(name));
            with_hint(&reason, Some("name a profile of this file"))
        })
    }
}

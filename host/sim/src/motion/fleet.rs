//! Fleets: footprint and motion model of every robot.

use fleetyard_world::{Footprint, FootprintError, Shape, Trailer};
use serde::de::value::MapAccessDeserializer;
use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use fleetyard_core::json::with_hint;

use super::preset::find;
use super::{Model, MotionError};

/// A kind of robot.
///
/// In files either the name of a preset that has a body, or an object with `footprint` and
/// `model`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(remote = "Self", deny_unknown_fields)]
pub struct Profile {
    /// Area that it covers of the floor.
    pub footprint: Footprint,
    /// Motion model.
    pub model: Model,
}

/// Reason for which robots do not form a fleet.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages document the fields")]
#[non_exhaustive]
pub enum FleetError {
    #[error(transparent)]
    Motion(#[from] MotionError),
    #[error(transparent)]
    Footprint(#[from] FootprintError),
    #[error("agent {agent} has profile {profile}, but there are {profiles}")]
    NoProfile {
        agent: usize,
        profile: u32,
        profiles: usize,
    },
    #[error("the fleet lists {listed} agents, but there are {agents}")]
    AgentCount { listed: usize, agents: usize },
    #[error("{name:?} is a model without a body")]
    NoBody { name: String },
}

impl FleetError {
    /// Remedy for the user.
    pub fn hint(&self) -> &'static str {
        match self {
            Self::Motion(error) => error.hint,
            Self::Footprint(error) => error.hint(),
            Self::NoProfile { .. } => "profiles are counted from 0",
            Self::AgentCount { .. } => {
                "list as many as there are agents, or use {\"cycle\": [...]} or {\"all\": \"NAME\"}"
            }
            Self::NoBody { .. } => "give an object with footprint and model",
        }
    }
}

impl Profile {
    /// The profile of a preset.
    pub fn preset(name: &str) -> Result<Self, FleetError> {
        let preset = find(name)?;
        match preset.footprint {
            Some(footprint) => Ok(Self {
                footprint: footprint(),
                model: (preset.model)(),
            }),
            None => Err(FleetError::NoBody {
                name: name.to_owned(),
            }),
        }
    }

    /// Checks the profile. A profile that was read from a file is valid.
    pub fn validate(&self) -> Result<(), FleetError> {
        self.footprint.shape()?;
        Ok(self.model.validate()?)
    }
}

impl Serialize for Profile {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        Self::serialize(self, serializer)
    }
}

impl<'de> Deserialize<'de> for Profile {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Form;

        impl<'de> Visitor<'de> for Form {
            type Value = Profile;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("the name of a preset, or an object with footprint and model")
            }

            fn visit_str<E: serde::de::Error>(self, name: &str) -> Result<Profile, E> {
                Profile::preset(name).map_err(|error| with_hint(&error, Some(error.hint())))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Profile, A::Error> {
                let profile = Profile::deserialize(MapAccessDeserializer::new(map))?;
                let checked = profile.validate();
                checked.map_err(|error| with_hint(&error, Some(error.hint())))?;
                Ok(profile)
            }
        }

        deserializer.deserialize_any(Form)
    }
}

/// The robots of an execution: agent i has profile `profile_of()[i]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Fleet {
    profiles: Vec<Profile>,
    shapes: Vec<Shape>,
    /// Of the profile of a car that tows one.
    trailers: Vec<Option<(Trailer, Shape)>>,
    profile_of: Vec<u32>,
}

impl Fleet {
    /// Checks every profile and every index.
    pub fn new(profiles: Vec<Profile>, profile_of: Vec<u32>) -> Result<Self, FleetError> {
        let mut shapes = Vec::with_capacity(profiles.len());
        let mut trailers = Vec::with_capacity(profiles.len());
        for profile in &profiles {
            profile.model.validate()?;
            shapes.push(profile.footprint.shape()?);
            trailers.push(match profile.model.trailer() {
                Some(trailer) => Some((trailer, trailer.shape()?)),
                None => None,
            });
        }
        let known = profiles.len();
        let outside = |profile: &u32| *profile as usize >= known;
        if let Some(agent) = profile_of.iter().position(outside) {
            let profile = profile_of[agent];
            return Err(FleetError::NoProfile {
                agent,
                profile,
                profiles: known,
            });
        }
        Ok(Self {
            profiles,
            shapes,
            trailers,
            profile_of,
        })
    }

    /// The first robots alone.
    #[must_use]
    pub fn first(mut self, agents: usize) -> Self {
        self.profile_of.truncate(agents);
        self
    }

    /// Robots of one kind.
    pub fn uniform(profile: Profile, agents: usize) -> Result<Self, FleetError> {
        Self::new(vec![profile], vec![0; agents])
    }

    /// Number of robots.
    pub fn agents(&self) -> usize {
        self.profile_of.len()
    }

    /// The kinds of robots.
    pub fn profiles(&self) -> &[Profile] {
        &self.profiles
    }

    /// The validated footprints, one per profile.
    pub fn shapes(&self) -> &[Shape] {
        &self.shapes
    }

    /// The kind of each robot, as an index into the profiles.
    pub fn profile_of(&self) -> &[u32] {
        &self.profile_of
    }

    /// Motion model of a robot.
    pub fn model(&self, agent: usize) -> &Model {
        &self.profiles[self.profile_of[agent] as usize].model
    }

    /// Trailer of a robot that tows one, and its body.
    pub fn trailer(&self, agent: usize) -> Option<(Trailer, &Shape)> {
        let own = self.trailers[self.profile_of[agent] as usize].as_ref();
        own.map(|(trailer, shape)| (*trailer, shape))
    }

    /// True if a robot tows a trailer.
    pub fn has_trailers(&self) -> bool {
        (0..self.agents()).any(|agent| self.trailer(agent).is_some())
    }

    /// Largest distance of a point of a robot, or of what it tows, from its reference point, in metres.
    pub fn reach_m(&self, agent: usize) -> f64 {
        let own = self.shape(agent).effective_radius_m();
        let trailer = self.trailer(agent);
        trailer.map_or(own, |(trailer, _)| trailer.reach_m().max(own))
    }

    /// The disc about a robot's reference point that holds it, and what it tows, whatever the headings.
    pub fn enclosing_disc(&self, agent: usize) -> Shape {
        let radius_m = self.reach_m(agent);
        let disc = Footprint::Disc { radius_m };
        disc.shape()
            .unwrap_or_else(|_| self.shape(agent).enclosing_disc())
    }

    /// Footprint of a robot.
    pub fn shape(&self, agent: usize) -> &Shape {
        &self.shapes[self.profile_of[agent] as usize]
    }
}

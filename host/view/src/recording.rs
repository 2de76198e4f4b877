//! A recorded run as far as it is known before its first state.

use fleetyard_sim::trace::{self, Header, Outline};

use crate::world::{Cells, World};

/// A recorded run, ready for a page.
#[derive(Debug, Clone)]
pub struct Recording {
    /// Title of the page.
    pub title: String,
    /// The map.
    pub world: World,
    /// Columns of the map, of which cells are told by number; 0 if there are no cells.
    pub columns: u32,
    /// Cells that are endpoints of a warehouse.
    pub endpoints: Option<Cells>,
    /// Cells that are workstations.
    pub workstations: Option<Cells>,
    /// The outlines that agents have.
    pub outlines: Vec<Outline>,
    /// For each body its index in `outlines`: first the agents, then obstacles
    /// that move.
    pub outline_of_body: Vec<u32>,
    /// Number of agents, trailers of cars among them.
    pub agents: u32,
    /// The car of each trailer; trailers are the last agents.
    pub cars: Vec<u32>,
    /// Goal of every agent, in metres; empty if not known.
    pub goals_m: Vec<[f64; 2]>,
    /// True if headings mean anything; otherwise they are not shown.
    pub headings: bool,
    /// Duration of a tick.
    pub tick_s: f64,
    /// Ticks between the states that will be given.
    pub state_every: u32,
    /// Name and value of what else a reader may want to know.
    pub facts: Vec<(String, String)>,
}

impl Recording {
    /// Number of robots: of agents without trailers.
    pub(crate) fn robots(&self) -> u32 {
        self.agents.saturating_sub(self.cars.len() as u32)
    }

    /// A recording that begins with this header.
    pub fn of_trace(title: impl Into<String>, header: &Header) -> Self {
        let title = title.into();
        let scene = &header.scene;
        Self {
            columns: scene.cells.as_ref().map_or(0, trace::Cells::cols),
            endpoints: scene.endpoints.as_ref().map(Cells::of_trace),
            workstations: scene.workstations.as_ref().map(Cells::of_trace),
            world: World::of_trace(&title, header),
            title,
            outlines: header.profiles.iter().map(|p| p.outline.clone()).collect(),
            outline_of_body: scene.profile_of_body.clone(),
            agents: header.agents,
            cars: header.cars.clone(),
            goals_m: scene.goals_m.clone(),
            headings: header.headings,
            tick_s: 1.0 / f64::from(header.ticks_hz),
            state_every: header.state_every,
            facts: facts(header),
        }
    }
}

/// Facts of a header, as names and values for readers.
fn facts(header: &Header) -> Vec<(String, String)> {
    let rate = format!(
        "{} per second, {} substeps",
        header.ticks_hz, header.substeps
    );
    let digests = &header.digests;
    let mut facts = vec![
        ("executed by", header.program.clone()),
        ("tier", header.tier.clone()),
        ("policy", header.policy.clone()),
        ("seed", header.seed.to_string()),
        ("ticks", rate),
    ];
    for profile in &header.profiles {
        let model = match profile.model.as_str() {
            "" => "moving obstacle",
            model => model,
        };
        facts.push(("robot", format!("{}, {model}", profile.name)));
    }
    for (name, digest) in [
        ("world digest", digests.world),
        ("plan digest", digests.plan),
        ("fleet digest", digests.fleet),
    ] {
        if digest.0 != 0 {
            facts.push((name, digest.to_string()));
        }
    }
    named(facts)
}

pub(crate) fn named(facts: Vec<(&str, String)>) -> Vec<(String, String)> {
    let facts = facts.into_iter();
    facts
        .map(|(name, value)| (name.to_owned(), value))
        .collect()
}

//! Errors of contact worlds.

/// Errors of building or stepping a world.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ContactError {
    /// A number is out of range.
    #[error("{what} is {value}, which is not {must}\nhint: {hint}")]
    Number {
        /// Name of the number.
        what: &'static str,
        /// Its value.
        value: f64,
        /// Its allowed range.
        must: &'static str,
        /// Remedy for the user.
        hint: &'static str,
    },
    /// A shape that rapier cannot use, because it is too thin or too small.
    #[error(
        "{what} {index} has no area that could be pushed\nhint: give it a width of at least a micrometre"
    )]
    Flat {
        /// Kind of the body.
        what: &'static str,
        /// Its index.
        index: u32,
    },
    /// A tick with commands for another number of agents.
    #[error("{commands} commands for {agents} agents\nhint: give one velocity per agent, in order")]
    Commands {
        /// Number of commands.
        commands: usize,
        /// Number of agents.
        agents: usize,
    },
    /// The state of a body is no longer finite.
    #[error(
        "agent {agent} is nowhere after {time_s} s\nhint: masses or forces differ by too many orders of magnitude"
    )]
    Diverged {
        /// The first such agent.
        agent: u32,
        /// Time in seconds.
        time_s: f64,
    },
}

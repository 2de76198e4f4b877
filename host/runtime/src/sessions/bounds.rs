//! Bounds on the messages of a plugin that the host keeps: all of them, and their sum for one
//! session.
//!
//! The host reads a plan as its bytes come and keeps its cells alone, so its memory follows from
//! the input of the call, whatever is answered. Text that is no plan (descriptors, logs, an
//! instance) is kept until its line ends.

use fleetyard_abi::{Annotation, Instance};

/// Longest message while a plugin introduces itself.
pub const INTRODUCTION_BYTES: usize = 4 << 20;

/// Longest message afterwards; the paths of a plan are not counted.
pub const MESSAGE_BYTES: usize = 4 << 20;

/// Longest message with a plan on a roadmap or in the plane, which is text until it has ended.
pub const PLAN_TEXT_BYTES: usize = 64 << 20;

/// Bytes by which a generator's request may be longer, for every agent.
pub const AGENT_BYTES: usize = 4 << 10;

/// Most cells of any plan.
pub const PLAN_CELLS: usize = 1 << 26;

/// Most steps that a path may take besides those over every cell of the map on the way to
/// each of its goals.
pub const HORIZON_STEPS: usize = 1 << 16;

/// Most incumbents of a call whose arrival is remembered; of more, the first ones and the
/// last.
pub const INCUMBENTS: usize = 10_000;

/// Most memory of plans that were followed by better ones. Beyond it the oldest but the first keep
/// their time of arrival alone.
pub const OLDER_BYTES: usize = 64 << 20;

/// Bytes of the log that are kept.
pub const LOG_BYTES: usize = 4 << 20;

/// Bytes of the end of standard error that are kept.
pub const STDERR_BYTES: usize = 64 << 10;

/// Most figures of a call that are kept, and the longest name of one.
pub const METRICS: usize = 1000;
/// Most bytes of the text of a note; there are as many as figures.
pub const NOTE_BYTES: usize = 1 << 10;

/// See [`METRICS`].
pub const METRIC_NAME_BYTES: usize = 256;

/// Most annotations of a call that are kept.
pub const ANNOTATIONS: usize = 10_000;

/// Most layers that they may have.
pub const ANNOTATION_LAYERS: usize = 32;

/// Most points, places and shapes that they may have together.
pub const ANNOTATION_POINTS: usize = 1 << 20;

/// Most bytes of all their texts.
pub const ANNOTATION_TEXT_BYTES: usize = 1 << 20;

/// Memory that annotations may take.
const ANNOTATION_BYTES: usize = ANNOTATION_POINTS * 2 * size_of::<f64>()
    + ANNOTATION_TEXT_BYTES
    + ANNOTATIONS * (size_of::<Annotation>() + 2 * size_of::<u64>());

/// Bytes that reading a message may take in all: its text, and what is made of it.
const READING_BYTES: usize = 8 * MESSAGE_BYTES;

/// Most cells of a plan for an instance on a map of so many cells: agents × horizon. The
/// horizon lets every agent visit the whole map on the way to each of its goals and wait
/// for [`HORIZON_STEPS`] on top; in a call with a window, for that long again.
pub fn plan_cells(instance: &Instance, map_cells: usize) -> usize {
    let goals = instance.goals.iter().map(<[u32]>::len).max().unwrap_or(0);
    let horizon = map_cells
        .saturating_mul(goals)
        .saturating_add(HORIZON_STEPS)
        .saturating_add(instance.window_steps as usize);
    instance.agents().saturating_mul(horizon).min(PLAN_CELLS)
}

/// Longest message in a call about so many agents, paths not counted.
pub fn message_bytes(agents: usize) -> usize {
    MESSAGE_BYTES.saturating_add(agents.saturating_mul(AGENT_BYTES))
}

/// Memory of a plan of so many agents and cells.
pub fn plan_bytes(agents: usize, cells: usize) -> usize {
    let offsets = agents.saturating_add(1).saturating_mul(size_of::<u64>());
    cells
        .saturating_mul(size_of::<u32>())
        .saturating_add(offsets)
}

/// Most memory that the host takes for what a session's plugin sends, in a call for a plan
/// of so many agents and cells: the plan that counts, the one that is arriving, older
/// ones, annotations, and messages.
pub fn session_bytes(agents: usize, cells: usize) -> usize {
    plan_bytes(agents, cells)
        .saturating_mul(2)
        .saturating_add(OLDER_BYTES + ANNOTATION_BYTES)
        .saturating_add(READING_BYTES + LOG_BYTES + STDERR_BYTES)
}

#[cfg(test)]
mod tests {
    use fleetyard_abi::Instance;

    use super::*;

    #[test]
    fn a_plan_may_be_as_long_as_its_question_is_large() {
        let one = Instance::one_shot(vec![0], vec![5]);
        assert_eq!(plan_cells(&one, 64), HORIZON_STEPS + 64);
        let windowed = Instance {
            window_steps: 10,
            ..Instance::one_shot(vec![0; 3], vec![5; 3])
        };
        assert_eq!(plan_cells(&windowed, 64), 3 * (HORIZON_STEPS + 74));
        let many = Instance::one_shot(vec![0; 100_000], vec![5; 100_000]);
        assert_eq!(plan_cells(&many, 1 << 20), PLAN_CELLS);
        assert_eq!(plan_cells(&one, usize::MAX), PLAN_CELLS);
    }

    #[test]
    fn the_bound_of_a_session_is_the_one_that_is_stated() {
        let most = session_bytes(100_000, PLAN_CELLS);
        assert!(most < 700 << 20, "{most}");
        let small = session_bytes(10, 10 * (HORIZON_STEPS + 1024));
        assert!(small < 128 << 20, "{small}");
    }
}

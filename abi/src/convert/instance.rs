//! Instances, the states of fleets, requests, and budgets.

use std::ptr;

use super::environment::{footprint_from_c, footprint_to_c};
use super::{
    Kept, code, copied, finite, flags, invalid, lists, offsets_of, parts, reserved, size_of, slice,
    string, whole,
};
use crate::c;
use crate::lists::Lists;
use crate::model::{
    Assignment, Budget, FleetState, FleetStatus, Heading, Instance, Limit, Motion, Objective,
    Request, Robot, State, Task,
};
use crate::sdk::Failure;

impl Budget {
    /// The C form.
    pub fn to_c(&self) -> c::Budget {
        c::Budget {
            struct_size: size_of::<c::Budget>(),
            threads: self.threads,
            deadline_monotonic_ns: self.deadline_monotonic_ns,
            answer_by_ns: self.answer_by_ns,
            wall_ns: self.wall_ns,
            nodes: self.nodes,
            memory_bytes: self.memory_bytes,
            seed: self.seed,
            parts: c::Parts::NONE,
        }
    }

    /// From the C form.
    ///
    /// # Safety
    /// As [`checked`](super::checked).
    pub unsafe fn from_c(pointer: *const c::Budget) -> Result<Self, Failure> {
        // SAFETY: by the caller's promise, here and below.
        let budget = unsafe { whole("budget", pointer)? };
        // SAFETY: as promised.
        unsafe { nothing_critical(budget.parts)? };
        Ok(Self {
            deadline_monotonic_ns: budget.deadline_monotonic_ns,
            answer_by_ns: budget.answer_by_ns,
            wall_ns: budget.wall_ns,
            nodes: budget.nodes,
            memory_bytes: budget.memory_bytes,
            threads: budget.threads.max(1),
            seed: budget.seed,
        })
    }
}

/// Refuses critical parts of a structure that has none in this version.
///
/// # Safety
/// As [`parts`].
pub(super) unsafe fn nothing_critical(raw: c::Parts) -> Result<(), Failure> {
    // SAFETY: by the caller's promise.
    let parts = unsafe { parts(raw)? };
    match parts.iter().find(|part| part.critical) {
        Some(part) => Err(super::unsupported(format!(
            "the critical part `{}` is unknown",
            part.id
        ))),
        None => Ok(()),
    }
}

/// # Safety
/// `pointer` is null or has `agents` elements behind it.
unsafe fn headings_from_c(
    pointer: *const i8,
    agents: usize,
) -> Result<Option<Vec<Heading>>, Failure> {
    if pointer.is_null() {
        return Ok(None);
    }
    // SAFETY: by the caller's promise.
    let codes = unsafe { copied("start_headings", pointer, agents)? };
    let heading = |code: &i8| {
        Heading::from_code((*code).into()).ok_or_else(|| invalid(format!("heading {code} is none")))
    };
    codes
        .iter()
        .map(heading)
        .collect::<Result<_, _>>()
        .map(Some)
}

/// An instance in its C form, with everything that is not borrowed.
pub struct CInstance {
    raw: *const c::Instance,
    _kept: Kept,
}

impl CInstance {
    /// The C form of an instance; valid as long as the instance and the
    /// environment are.
    pub fn new(instance: &Instance, environment: *const c::Environment) -> Self {
        let mut kept = Kept::default();
        let raw = instance_to_c(instance, environment, &mut kept);
        Self { raw, _kept: kept }
    }

    /// The structure; valid as long as `self`.
    pub fn raw(&self) -> *const c::Instance {
        self.raw
    }
}

/// States one after the other, with their offsets; null but in the plane, where there are offsets
/// even if nobody has a goal.
fn states_to_c(states: &[State], in_plane: bool, kept: &mut Kept) -> (*const u64, *const f64) {
    if !in_plane {
        return (ptr::null(), ptr::null());
    }
    let flat: Lists<f64> = states.iter().map(|state| state.0.iter().copied()).collect();
    let offsets = kept.list(flat.offsets());
    (offsets, kept.list(flat.items()))
}

fn instance_to_c(
    instance: &Instance,
    environment: *const c::Environment,
    kept: &mut Kept,
) -> *const c::Instance {
    let robots: Vec<_> = instance
        .robots
        .iter()
        .map(|robot| robot_to_c(robot, kept))
        .collect();
    let headings = instance.headings.as_ref().map_or(ptr::null(), |headings| {
        let codes: Vec<i8> = headings
            .iter()
            .map(|heading| heading.code() as i8)
            .collect();
        kept.list(codes)
    });
    let in_plane = !instance.start_states.is_empty();
    let (start_state_offsets, start_states) = states_to_c(&instance.start_states, in_plane, kept);
    let goals = instance.goal_states.items();
    let (goal_state_offsets, goal_states) = states_to_c(goals, in_plane, kept);
    let goal_offsets = if in_plane {
        instance.goal_states.offsets().as_ptr()
    } else {
        instance.goals.offsets().as_ptr()
    };
    let unless = |empty: bool, pointer: *const u32| if empty { ptr::null() } else { pointer };
    let bit = |set: bool, bit: u32| if set { bit } else { 0 };
    let raw = c::Instance {
        struct_size: size_of::<c::Instance>(),
        agents: instance.agents() as u32,
        environment,
        robot_count: robots.len() as u32,
        robots: kept.list(robots),
        robot_of: unless(instance.robot_of.is_empty(), instance.robot_of.as_ptr()),
        motion: instance.motion.code(),
        objective: instance.objective.code(),
        flags: bit(instance.allows_cycles, c::INSTANCE_CYCLES)
            | bit(instance.strict, c::INSTANCE_STRICT),
        starts: unless(in_plane, instance.starts.as_ptr()),
        start_headings: headings,
        start_state_offsets,
        start_states,
        goal_offsets,
        goals: unless(in_plane, instance.goals.items().as_ptr()),
        goal_state_offsets,
        goal_states,
        window_steps: instance.window_steps,
        reserved: 0,
        window_s: instance.window_s,
        radius_m: instance.radius_m,
        goal_tolerance_m: instance.goal_tolerance_m,
        goal_tolerance_rad: instance.goal_tolerance_rad,
        goal_tolerance_rate: instance.goal_tolerance_rate,
        dynamics_tolerance: instance.dynamics_tolerance,
        parts: kept.parts(&instance.parts),
    };
    kept.one(raw)
}

fn robot_to_c(robot: &Robot, kept: &mut Kept) -> *const c::Robot {
    let bit = |set: bool, bit: u32| if set { bit } else { 0 };
    let mut limits = |limits: &[[Limit; 2]], end: usize, none: f64| {
        let numbers: Vec<f64> = limits
            .iter()
            .map(|limit| limit[end].unwrap_or(none))
            .collect();
        kept.list(numbers)
    };
    let [infinite, negative] = [f64::INFINITY, f64::NEG_INFINITY];
    let raw = c::Robot {
        struct_size: size_of::<c::Robot>(),
        flags: bit(robot.has_heading, c::ROBOT_HEADING)
            | bit(robot.polar_state, c::ROBOT_POLAR_STATE)
            | bit(robot.polar_control, c::ROBOT_POLAR_CONTROL),
        state_size: robot.state_limits.len() as u32,
        control_size: robot.control_limits.len() as u32,
        parameter_count: robot.parameters.len() as u32,
        reserved: 0,
        state_min: limits(&robot.state_limits, 0, negative),
        state_max: limits(&robot.state_limits, 1, infinite),
        control_min: limits(&robot.control_limits, 0, negative),
        control_max: limits(&robot.control_limits, 1, infinite),
        parameters: kept.list(robot.parameters.clone()),
        name: kept.text(robot.name.clone()),
        dynamics: kept.text(robot.dynamics.clone()),
        footprint: footprint_to_c(&robot.footprint, kept),
    };
    kept.one(raw)
}

/// # Safety
/// As [`Instance::from_c`].
unsafe fn robot_from_c(pointer: *const c::Robot) -> Result<Robot, Failure> {
    // SAFETY: by the caller's promise, here and below.
    let robot = unsafe { whole("robot", pointer)? };
    reserved("robot", robot.reserved)?;
    let known = c::ROBOT_HEADING | c::ROBOT_POLAR_STATE | c::ROBOT_POLAR_CONTROL;
    let flags = flags("robot", robot.flags, known)?;
    // SAFETY: as promised.
    let numbers = |name, pointer, len: u32| unsafe { copied(name, pointer, len as usize) };
    let limits = |name, least, most, len: u32| -> Result<Vec<[Limit; 2]>, Failure> {
        let [least, most] = [numbers(name, least, len)?, numbers(name, most, len)?];
        let limit = |number: f64| number.is_finite().then_some(number);
        Ok(least
            .into_iter()
            .zip(most)
            .map(|pair| [limit(pair.0), limit(pair.1)])
            .collect())
    };
    let (state, control) = (robot.state_size, robot.control_size);
    Ok(Robot {
        // SAFETY: as promised.
        name: unsafe { string(robot.name) },
        // SAFETY: as promised.
        footprint: unsafe { footprint_from_c(robot.footprint)? },
        // SAFETY: as promised.
        dynamics: unsafe { string(robot.dynamics) },
        has_heading: flags & c::ROBOT_HEADING != 0,
        polar_state: flags & c::ROBOT_POLAR_STATE != 0,
        polar_control: flags & c::ROBOT_POLAR_CONTROL != 0,
        state_limits: limits("robot.state_min", robot.state_min, robot.state_max, state)?,
        control_limits: limits(
            "robot.control_min",
            robot.control_min,
            robot.control_max,
            control,
        )?,
        parameters: numbers("robot.parameters", robot.parameters, robot.parameter_count)?,
    })
}

/// # Safety
/// As [`lists`].
unsafe fn states_from_c(
    names: [&str; 2],
    offsets: *const u64,
    states: *const f64,
    len: usize,
) -> Result<Vec<State>, Failure> {
    // SAFETY: by the caller's promise.
    let lists = unsafe { lists(names, offsets, states, len, usize::MAX)? };
    Ok(lists.iter().map(|state| State(state.to_vec())).collect())
}

impl Instance {
    /// Copies from the C form, without the environment, then looks at the copies.
    ///
    /// # Safety
    /// As [`checked`](super::checked), and the arrays are as long as the header says.
    pub unsafe fn from_c(pointer: *const c::Instance) -> Result<Self, Failure> {
        // SAFETY: by the caller's promise, here and below.
        let raw = unsafe { ptr::read(whole("instance", pointer)?) };
        reserved("instance", raw.reserved)?;
        let known = c::INSTANCE_CYCLES | c::INSTANCE_STRICT;
        let flags = flags("instance", raw.flags, known)?;
        let agents = raw.agents as usize;
        // SAFETY: as promised.
        let models = unsafe { copied("instance.robots", raw.robots, raw.robot_count as usize)? };
        let robots = models
            .into_iter()
            // SAFETY: as promised.
            .map(|robot| unsafe { robot_from_c(robot) })
            .collect::<Result<_, _>>()?;
        let mut instance = Self {
            // SAFETY: as promised.
            headings: unsafe { headings_from_c(raw.start_headings, agents)? },
            robots,
            robot_of: if raw.robot_of.is_null() {
                Vec::new()
            } else {
                // SAFETY: as promised.
                unsafe { copied("instance.robot_of", raw.robot_of, agents)? }
            },
            motion: code("motion", raw.motion, Motion::from_code)?,
            objective: code("objective", raw.objective, Objective::from_code)?,
            window_steps: raw.window_steps,
            window_s: raw.window_s,
            radius_m: raw.radius_m,
            allows_cycles: flags & c::INSTANCE_CYCLES != 0,
            strict: flags & c::INSTANCE_STRICT != 0,
            goal_tolerance_m: raw.goal_tolerance_m,
            goal_tolerance_rad: raw.goal_tolerance_rad,
            goal_tolerance_rate: raw.goal_tolerance_rate,
            dynamics_tolerance: raw.dynamics_tolerance,
            // SAFETY: as promised.
            parts: unsafe { parts(raw.parts)? },
            ..Self::default()
        };
        if raw.start_state_offsets.is_null() {
            // SAFETY: as promised.
            instance.starts = unsafe { copied("instance.starts", raw.starts, agents)? };
            let names = ["instance.goal_offsets", "instance.goals"];
            // SAFETY: as promised.
            instance.goals =
                unsafe { lists(names, raw.goal_offsets, raw.goals, agents, usize::MAX)? };
        } else {
            let names = ["instance.start_state_offsets", "instance.start_states"];
            // SAFETY: as promised.
            instance.start_states =
                unsafe { states_from_c(names, raw.start_state_offsets, raw.start_states, agents)? };
            let names = ["instance.goal_offsets", "instance.goal_states"];
            // SAFETY: as promised.
            let (offsets, goals) =
                unsafe { offsets_of(names, raw.goal_offsets, agents, usize::MAX)? };
            let names = ["instance.goal_state_offsets", "instance.goal_states"];
            // SAFETY: as promised.
            let states =
                unsafe { states_from_c(names, raw.goal_state_offsets, raw.goal_states, goals)? };
            instance.goal_states = Lists::from_flat(offsets, states).unwrap_or_default();
        }
        Ok(instance)
    }
}

/// A fleet's state in its C form, with everything that is not borrowed.
pub struct CFleetState {
    raw: *const c::FleetState,
    _kept: Kept,
}

impl CFleetState {
    /// The C form of a state; valid as long as the state and the environment.
    pub fn new(state: &FleetState, environment: *const c::Environment) -> Self {
        let mut kept = Kept::default();
        let ids: Vec<u64> = state.tasks.iter().map(|task| task.id).collect();
        let released: Vec<f64> = state.tasks.iter().map(|task| task.released_s).collect();
        let tasks = state.tasks.iter();
        let tasks: Lists<u32> = tasks.map(|task| task.places.iter().copied()).collect();
        let raw = c::FleetState {
            struct_size: size_of::<c::FleetState>(),
            tasks: ids.len() as u32,
            time_s: state.time_s,
            next: instance_to_c(&state.next, environment, &mut kept),
            task_ids: kept.list(ids),
            task_offsets: kept.list(tasks.offsets()),
            task_places: kept.list(tasks.items()),
            task_released_s: kept.list(released),
            parts: kept.parts(&state.parts),
        };
        Self {
            raw: kept.one(raw),
            _kept: kept,
        }
    }

    /// The structure; valid as long as `self`.
    pub fn raw(&self) -> *const c::FleetState {
        self.raw
    }
}

impl FleetState {
    /// Copies from the C form, without the environment.
    ///
    /// # Safety
    /// As [`checked`](super::checked), and the arrays are as long as the header says.
    pub unsafe fn from_c(pointer: *const c::FleetState) -> Result<Self, Failure> {
        // SAFETY: by the caller's promise, here and below.
        let state = unsafe { whole("state", pointer)? };
        let tasks = state.tasks as usize;
        // SAFETY: as promised.
        let ids = unsafe { slice("state.task_ids", state.task_ids, tasks)? };
        let names = ["state.task_offsets", "state.task_places"];
        // SAFETY: as promised.
        let places = unsafe {
            lists(
                names,
                state.task_offsets,
                state.task_places,
                tasks,
                usize::MAX,
            )?
        };
        let name = "state.task_released_s";
        // SAFETY: as promised.
        let released = unsafe { slice(name, state.task_released_s, tasks)? };
        let tasks = ids.iter().zip(places.iter()).zip(released);
        Ok(Self {
            time_s: state.time_s,
            // SAFETY: as promised.
            next: unsafe { Instance::from_c(state.next)? },
            tasks: tasks
                .map(|((id, places), released_s)| Task {
                    id: *id,
                    places: places.to_vec(),
                    released_s: *released_s,
                })
                .collect(),
            // SAFETY: as promised.
            parts: unsafe { parts(state.parts)? },
        })
    }
}

impl Request {
    /// Calls `give` with the C form, which is valid as long as the call.
    pub(super) fn with_c<T>(&self, give: impl FnOnce(*const c::Request) -> T) -> T {
        let given = self.assignments.iter();
        let assignments: Vec<c::Assignment> = given
            .map(|assignment| c::Assignment {
                task: assignment.task,
                agent: assignment.agent,
                reserved: 0,
            })
            .collect();
        let raw = c::Request {
            struct_size: size_of::<c::Request>(),
            agents: self.goals.len() as u32,
            goal_offsets: self.goals.offsets().as_ptr(),
            goals: self.goals.items().as_ptr(),
            assignments: assignments.as_ptr(),
            assignment_count: assignments.len() as u64,
            window_steps: self.window_steps,
            reserved: 0,
            window_s: self.window_s,
            parts: c::Parts::NONE,
        };
        give(&raw const raw)
    }

    /// Copies from the C form, then looks at the copies. Refuses one for another number of
    /// agents, or one with more than `most` goals or assignments, before looking at its arrays.
    ///
    /// # Safety
    /// As [`checked`](super::checked), and the arrays are as long as the header says.
    pub unsafe fn from_c(
        pointer: *const c::Request,
        agents: Option<usize>,
        most: usize,
    ) -> Result<Self, Failure> {
        // SAFETY: by the caller's promise, here and below.
        let raw = unsafe { ptr::read(whole("request", pointer)?) };
        let goal_lists = raw.agents as usize;
        if let Some(agents) = agents.filter(|agents| *agents != goal_lists) {
            return Err(invalid(Self::wrong_agents(goal_lists, agents)));
        }
        reserved("request", raw.reserved)?;
        finite("request.window_s", &[raw.window_s])?;
        // SAFETY: as promised.
        unsafe { nothing_critical(raw.parts)? };
        let count = raw.assignment_count;
        if count > most as u64 {
            return Err(invalid(format!(
                "request.assignments are {count}, more than the limit of {most}"
            )));
        }
        // SAFETY: as promised.
        let assignments =
            unsafe { copied("request.assignments", raw.assignments, count as usize)? };
        for assignment in &assignments {
            reserved("assignment", assignment.reserved)?;
        }
        let names = ["request.goal_offsets", "request.goals"];
        Ok(Self {
            // SAFETY: as promised.
            goals: unsafe { lists(names, raw.goal_offsets, raw.goals, goal_lists, most)? },
            window_steps: raw.window_steps,
            window_s: raw.window_s,
            assignments: assignments
                .iter()
                .map(|assignment| Assignment {
                    agent: assignment.agent,
                    task: assignment.task,
                })
                .collect(),
        })
    }
}

impl FleetStatus {
    /// The C form; valid as long as `self`.
    pub fn to_c(&self) -> c::FleetStatus {
        c::FleetStatus {
            struct_size: size_of::<c::FleetStatus>(),
            agents: self.actions_left.len() as u32,
            time_s: self.time_s,
            since_last_call_s: self.since_last_call_s,
            planning_limit_s: self.planning_limit_s,
            action_s: self.action_s,
            actions_left: self.actions_left.as_ptr(),
            parts: c::Parts::NONE,
        }
    }

    /// Copies from the C form.
    ///
    /// # Safety
    /// As [`checked`](super::checked), and the array is as long as the header says.
    pub unsafe fn from_c(pointer: *const c::FleetStatus) -> Result<Self, Failure> {
        // SAFETY: by the caller's promise, here and below.
        let status = unsafe { whole("status", pointer)? };
        // SAFETY: as promised.
        unsafe { nothing_critical(status.parts)? };
        let agents = status.agents as usize;
        Ok(Self {
            time_s: status.time_s,
            since_last_call_s: status.since_last_call_s,
            planning_limit_s: status.planning_limit_s,
            action_s: status.action_s,
            // SAFETY: as promised.
            actions_left: unsafe { copied("status.actions_left", status.actions_left, agents)? },
        })
    }
}

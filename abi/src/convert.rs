//! Between the C structures and the owned model, in both directions.
//!
//! Reading from C checks what can be checked (null pointers, sizes, offsets,
//! codes); that a pointer has as many elements behind it as it should is the
//! promise of the other side.

use std::ffi::c_void;
use std::ptr;

use crate::c;
use crate::figures::check_figure;
use crate::lists::Lists;
use crate::model::{
    Assignment, Budget, Environment, FleetState, FleetStatus, GridEnvironment, Heading, Instance,
    LogLevel, Motion, Objective, SharedEnvironment, Task,
};
use crate::plan::GridPlan;
use crate::sdk::{Rejected, Sink};

/// `sizeof` a C structure, for its `struct_size` field.
pub const fn size_of<T>() -> u32 {
    std::mem::size_of::<T>() as u32
}

/// Checks a pointer and the `struct_size` behind it.
///
/// # Safety
/// A pointer that is neither null nor misaligned points to a structure that begins with a `u32`
/// `struct_size`, and that is at least as long as it says, for all of `'a`.
pub unsafe fn checked<'a, T>(name: &str, pointer: *const T) -> Result<&'a T, String> {
    can_be_read(name, pointer, 1)?;
    // SAFETY: not null, and the first field is a u32 by the caller's promise.
    let size = unsafe { pointer.cast::<u32>().read() };
    if size != size_of::<T>() {
        let expected = size_of::<T>();
        return Err(format!(
            "{name}.struct_size is {size}, but the structure has {expected} bytes"
        ));
    }
    // SAFETY: the structure is whole by its size.
    Ok(unsafe { &*pointer })
}

/// Refuses a list of which no memory can have so many elements behind that pointer.
fn can_be_read<T>(name: &str, pointer: *const T, len: usize) -> Result<(), String> {
    if pointer.is_null() {
        return Err(format!("{name} is null"));
    }
    if !pointer.is_aligned() {
        return Err(format!("{name} is not aligned"));
    }
    if len > isize::MAX as usize / std::mem::size_of::<T>() {
        return Err(format!("{name} cannot have {len} elements"));
    }
    Ok(())
}

/// # Safety
/// A pointer that is neither null nor misaligned has `len` elements behind it for all of
/// `'a`.
unsafe fn slice<'a, T>(name: &str, pointer: *const T, len: usize) -> Result<&'a [T], String> {
    if len == 0 {
        return Ok(&[]);
    }
    can_be_read(name, pointer, len)?;
    // SAFETY: by the caller's promise.
    Ok(unsafe { std::slice::from_raw_parts(pointer, len) })
}

/// Copies without a look at what is copied.
///
/// # Safety
/// As [`slice`], except that somebody may be writing to the elements, of which any
/// bytes are a value.
unsafe fn copied<T: Copy>(name: &str, pointer: *const T, len: usize) -> Result<Vec<T>, String> {
    if len == 0 {
        return Ok(Vec::new());
    }
    can_be_read(name, pointer, len)?;
    let mut copy = Vec::new();
    // A plugin that is wrong about its own lists must not end the host.
    copy.try_reserve_exact(len)
        .map_err(|_| format!("{name} has {len} elements, for which there is no memory"))?;
    // SAFETY: as promised, and the copy has room for them.
    unsafe {
        std::ptr::copy_nonoverlapping(pointer, copy.as_mut_ptr(), len);
        copy.set_len(len);
    }
    Ok(copy)
}

/// Reads text; bytes that are not UTF-8 are replaced.
///
/// # Safety
/// `text` points to `len` bytes, or `len` is 0.
pub unsafe fn string(text: c::Str) -> String {
    // SAFETY: by the caller's promise.
    match unsafe { slice("text", text.ptr, text.len) } {
        Ok(bytes) => String::from_utf8_lossy(bytes).into_owned(),
        Err(_) => String::new(),
    }
}

impl Budget {
    /// The C form.
    pub fn to_c(&self) -> c::Budget {
        c::Budget {
            struct_size: size_of::<c::Budget>(),
            threads: self.threads,
            deadline_monotonic_ns: self.deadline_monotonic_ns,
            wall_ns: self.wall_ns,
            nodes: self.nodes,
            memory_bytes: self.memory_bytes,
            seed: self.seed,
        }
    }

    /// From the C form.
    ///
    /// # Safety
    /// As [`checked`].
    pub unsafe fn from_c(pointer: *const c::Budget) -> Result<Self, String> {
        // SAFETY: by the caller's promise.
        let budget = unsafe { checked("budget", pointer)? };
        Ok(Self {
            deadline_monotonic_ns: budget.deadline_monotonic_ns,
            wall_ns: budget.wall_ns,
            nodes: budget.nodes,
            memory_bytes: budget.memory_bytes,
            threads: budget.threads.max(1),
            seed: budget.seed,
        })
    }
}

/// An environment in its C form, with everything it points to.
pub struct CEnvironment {
    raw: Box<(c::Environment, c::Grid)>,
    keep: SharedEnvironment,
}

// SAFETY: the raw pointers point into `keep`, which is shared and immutable.
unsafe impl Send for CEnvironment {}

impl CEnvironment {
    /// The C form of an environment.
    pub fn new(environment: &SharedEnvironment) -> Self {
        let keep = SharedEnvironment::clone(environment);
        let Environment::Grid(grid) = keep.as_ref();
        let mut raw = Box::new((
            c::Environment {
                struct_size: size_of::<c::Environment>(),
                representation: c::REPRESENTATION_GRID,
                map_name: c::Str::new(&grid.map_name),
                view: ptr::null(),
            },
            c::Grid {
                struct_size: size_of::<c::Grid>(),
                rows: grid.rows,
                cols: grid.cols,
                connectivity: grid.connectivity,
                cell_size_m: grid.cell_size_m,
                step_s: grid.step_s,
                passable: grid.passable.as_ptr(),
                terrain: grid.terrain.as_ptr(),
            },
        ));
        raw.0.view = (&raw const raw.1).cast();
        Self { raw, keep }
    }

    /// The structure; valid as long as `self`.
    pub fn raw(&self) -> &c::Environment {
        &self.raw.0
    }

    /// The environment itself.
    pub fn environment(&self) -> &SharedEnvironment {
        &self.keep
    }
}

impl Environment {
    /// Copies from the C form.
    ///
    /// # Safety
    /// As [`checked`], and the arrays are as long as the header says.
    pub unsafe fn from_c(pointer: *const c::Environment) -> Result<Self, String> {
        // SAFETY: by the caller's promise, here and below.
        let environment = unsafe { checked("environment", pointer)? };
        if environment.representation != c::REPRESENTATION_GRID {
            return Err(format!(
                "representation {} is unknown",
                environment.representation
            ));
        }
        // SAFETY: the view of a grid environment is a grid.
        let grid = unsafe { checked("environment.view", environment.view.cast::<c::Grid>())? };
        let cells = (grid.rows as usize)
            .checked_mul(grid.cols as usize)
            .filter(|cells| *cells > 0)
            .ok_or("the grid has no cells or too many")?;
        Ok(Self::Grid(GridEnvironment {
            // SAFETY: as promised.
            map_name: unsafe { string(environment.map_name) },
            rows: grid.rows,
            cols: grid.cols,
            connectivity: grid.connectivity,
            cell_size_m: grid.cell_size_m,
            step_s: grid.step_s,
            // SAFETY: as promised.
            passable: unsafe { slice("grid.passable", grid.passable, cells)? }.to_vec(),
            // SAFETY: as promised.
            terrain: unsafe { slice("grid.terrain", grid.terrain, cells)? }.to_vec(),
        }))
    }
}

fn headings_to_c(headings: Option<&Vec<Heading>>) -> Option<Vec<i32>> {
    headings.map(|headings| headings.iter().map(|heading| heading.code()).collect())
}

fn pointer_or_null(values: Option<&Vec<i32>>) -> *const i32 {
    values.map_or(ptr::null(), Vec::as_ptr)
}

/// # Safety
/// `pointer` is null or has `agents` elements behind it.
unsafe fn headings_from_c(
    pointer: *const i32,
    agents: usize,
) -> Result<Option<Vec<Heading>>, String> {
    if pointer.is_null() {
        return Ok(None);
    }
    // SAFETY: by the caller's promise.
    let codes = unsafe { copied("headings", pointer, agents)? };
    let heading =
        |code: &i32| Heading::from_code(*code).ok_or_else(|| format!("heading {code} is unknown"));
    codes
        .iter()
        .map(heading)
        .collect::<Result<_, _>>()
        .map(Some)
}

/// Copies lists, then looks at the copy: another thread of the other side may still write to
/// its arrays. Refuses more than `max_cells` cells together before it looks at a cell.
///
/// # Safety
/// `offsets` has `len + 1` elements behind it and `cells` as many as the last of
/// them says.
unsafe fn lists_from_c(
    names: [&str; 2],
    offsets: *const u64,
    cells: *const u32,
    len: usize,
    max_cells: usize,
) -> Result<Lists<u32>, String> {
    let disordered = || format!("{} do not begin with 0 or are out of order", names[0]);
    // SAFETY: by the caller's promise.
    let offsets = unsafe { copied(names[0], offsets, len + 1)? };
    let total = offsets.last().copied().unwrap_or(0);
    if offsets.first() != Some(&0) || !offsets.is_sorted() {
        return Err(disordered());
    }
    if total > max_cells as u64 {
        return Err(format!(
            "{} are {total} cells, more than the limit of {max_cells}",
            names[1]
        ));
    }
    // SAFETY: by the caller's promise.
    let cells = unsafe { copied(names[1], cells, total as usize)? };
    Lists::from_flat(offsets, cells).ok_or_else(disordered)
}

fn motion_from_c(code: i32) -> Result<Motion, String> {
    Motion::from_code(code).ok_or_else(|| format!("motion {code} is unknown"))
}

fn objective_from_c(code: i32) -> Result<Objective, String> {
    Objective::from_code(code).ok_or_else(|| format!("objective {code} is unknown"))
}

/// An instance in its C form, with everything that is not borrowed.
pub struct CInstance {
    raw: c::Instance,
    // Kept for `raw` to point to.
    _headings: Option<Vec<i32>>,
    _assignments: Vec<c::Assignment>,
}

impl CInstance {
    /// The C form of an instance; valid as long as the instance and the
    /// environment are.
    pub fn new(instance: &Instance, environment: *const c::Environment) -> Self {
        let headings = headings_to_c(instance.headings.as_ref());
        let given = instance.assignments.iter();
        let assignments: Vec<c::Assignment> = given
            .map(|assignment| c::Assignment {
                task: assignment.task,
                agent: assignment.agent,
                reserved: 0,
            })
            .collect();
        let raw = c::Instance {
            struct_size: size_of::<c::Instance>(),
            agents: instance.agents() as u32,
            environment,
            starts: instance.starts.as_ptr(),
            headings: pointer_or_null(headings.as_ref()),
            goal_offsets: instance.goals.offsets().as_ptr(),
            goals: instance.goals.items().as_ptr(),
            motion: instance.motion.code(),
            objective: instance.objective.code(),
            window_steps: instance.window_steps,
            allows_cycles: instance.allows_cycles.into(),
            radius_m: instance.radius_m,
            assignments_count: assignments.len() as u32,
            reserved: 0,
            assignments: assignments.as_ptr(),
        };
        Self {
            raw,
            _headings: headings,
            _assignments: assignments,
        }
    }

    /// The structure.
    pub fn raw(&self) -> &c::Instance {
        &self.raw
    }
}

impl Instance {
    /// Copies from the C form, without the environment, then looks at the copies. Refuses
    /// one with more than `max_cells` cells in its goals.
    ///
    /// # Safety
    /// As [`checked`], and the arrays are as long as the header says.
    pub unsafe fn from_c(pointer: *const c::Instance, max_cells: usize) -> Result<Self, String> {
        // SAFETY: by the caller's promise, here and below.
        let instance = unsafe { std::ptr::read(checked("instance", pointer)?) };
        let agents = instance.agents as usize;
        // SAFETY: as promised.
        let assignments = unsafe {
            copied(
                "instance.assignments",
                instance.assignments,
                instance.assignments_count as usize,
            )?
        };
        Ok(Self {
            // SAFETY: as promised.
            starts: unsafe { copied("instance.starts", instance.starts, agents)? },
            // SAFETY: as promised.
            headings: unsafe { headings_from_c(instance.headings, agents)? },
            // SAFETY: as promised.
            goals: unsafe {
                lists_from_c(
                    ["instance.goal_offsets", "instance.goals"],
                    instance.goal_offsets,
                    instance.goals,
                    agents,
                    max_cells,
                )?
            },
            motion: motion_from_c(instance.motion)?,
            objective: objective_from_c(instance.objective)?,
            window_steps: instance.window_steps,
            radius_m: instance.radius_m,
            allows_cycles: instance.allows_cycles != 0,
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

impl GridPlan {
    /// The C form; valid as long as the plan is.
    pub fn to_c(&self) -> c::Plan {
        c::Plan {
            struct_size: size_of::<c::Plan>(),
            agents: self.agents() as u32,
            offsets: self.lists().offsets().as_ptr(),
            cells: self.cells().as_ptr(),
        }
    }

    /// Copies from the C form. Refuses a plan for another number of agents, or one with more
    /// than `max_cells` cells, before looking at its arrays.
    ///
    /// # Safety
    /// As [`checked`], and the arrays are as long as the header says.
    pub unsafe fn from_c(
        pointer: *const c::Plan,
        agents: Option<usize>,
        max_cells: usize,
    ) -> Result<Self, String> {
        // SAFETY: by the caller's promise, here and below.
        let plan = unsafe { std::ptr::read(checked("plan", pointer)?) };
        let paths = plan.agents as usize;
        if let Some(agents) = agents.filter(|agents| *agents != paths) {
            return Err(wrong_agents(paths, agents));
        }
        let names = ["plan.offsets", "plan.cells"];
        // SAFETY: as promised.
        let lists = unsafe { lists_from_c(names, plan.offsets, plan.cells, paths, max_cells)? };
        Ok(lists.into())
    }
}

/// The sentence for a plan with paths for too few or too many agents.
pub fn wrong_agents(paths: usize, agents: usize) -> String {
    format!("the plan has {paths} paths, but the instance has {agents} agents")
}

/// A fleet's state in its C form, with everything that is not borrowed.
pub struct CFleetState {
    raw: c::FleetState,
    _headings: Option<Vec<i32>>,
    _ids: Vec<u64>,
    _tasks: Lists<u32>,
}

impl CFleetState {
    /// The C form of a state; valid as long as the state and the environment.
    pub fn new(state: &FleetState, environment: *const c::Environment) -> Self {
        let headings = headings_to_c(state.headings.as_ref());
        let ids: Vec<u64> = state.tasks.iter().map(|task| task.id).collect();
        let tasks = state.tasks.iter();
        let tasks: Lists<u32> = tasks.map(|task| task.cells.iter().copied()).collect();
        let raw = c::FleetState {
            struct_size: size_of::<c::FleetState>(),
            agents: state.cells.len() as u32,
            environment,
            time_s: state.time_s,
            cells: state.cells.as_ptr(),
            headings: pointer_or_null(headings.as_ref()),
            goal_offsets: state.goals.offsets().as_ptr(),
            goals: state.goals.items().as_ptr(),
            tasks: ids.len() as u32,
            window_steps: state.window_steps,
            task_ids: ids.as_ptr(),
            task_offsets: tasks.offsets().as_ptr(),
            task_cells: tasks.items().as_ptr(),
            motion: state.motion.code(),
            objective: state.objective.code(),
            radius_m: state.radius_m,
            allows_cycles: state.allows_cycles.into(),
            reserved: 0,
        };
        Self {
            raw,
            _headings: headings,
            _ids: ids,
            _tasks: tasks,
        }
    }

    /// The structure.
    pub fn raw(&self) -> &c::FleetState {
        &self.raw
    }
}

impl FleetState {
    /// Copies from the C form, without the environment.
    ///
    /// # Safety
    /// As [`checked`], and the arrays are as long as the header says.
    pub unsafe fn from_c(pointer: *const c::FleetState) -> Result<Self, String> {
        // SAFETY: by the caller's promise, here and below.
        let state = unsafe { checked("state", pointer)? };
        let (agents, tasks) = (state.agents as usize, state.tasks as usize);
        // SAFETY: as promised.
        let ids = unsafe { slice("state.task_ids", state.task_ids, tasks)? };
        // SAFETY: as promised.
        let lists = unsafe {
            lists_from_c(
                ["state.task_offsets", "state.task_cells"],
                state.task_offsets,
                state.task_cells,
                tasks,
                usize::MAX,
            )?
        };
        Ok(Self {
            time_s: state.time_s,
            // SAFETY: as promised.
            cells: unsafe { slice("state.cells", state.cells, agents)? }.to_vec(),
            // SAFETY: as promised.
            headings: unsafe { headings_from_c(state.headings, agents)? },
            // SAFETY: as promised.
            goals: unsafe {
                lists_from_c(
                    ["state.goal_offsets", "state.goals"],
                    state.goal_offsets,
                    state.goals,
                    agents,
                    usize::MAX,
                )?
            },
            tasks: ids
                .iter()
                .zip(lists.iter())
                .map(|(id, cells)| Task {
                    id: *id,
                    cells: cells.to_vec(),
                })
                .collect(),
            window_steps: state.window_steps,
            motion: motion_from_c(state.motion)?,
            objective: objective_from_c(state.objective)?,
            radius_m: state.radius_m,
            allows_cycles: state.allows_cycles != 0,
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
        }
    }

    /// Copies from the C form.
    ///
    /// # Safety
    /// As [`checked`], and the array is as long as the header says.
    pub unsafe fn from_c(pointer: *const c::FleetStatus) -> Result<Self, String> {
        // SAFETY: by the caller's promise, here and below.
        let status = unsafe { checked("status", pointer)? };
        // SAFETY: as promised.
        let actions = unsafe {
            slice(
                "status.actions_left",
                status.actions_left,
                status.agents as usize,
            )?
        };
        Ok(Self {
            time_s: status.time_s,
            since_last_call_s: status.since_last_call_s,
            planning_limit_s: status.planning_limit_s,
            action_s: status.action_s,
            actions_left: actions.to_vec(),
        })
    }
}

/// Data of a C sink besides the Rust one: the bounds of its checks, and the plugin's explanation of
/// a failure.
pub struct SinkContext<'a> {
    sink: &'a dyn Sink,
    agents: Option<usize>,
    max_cells: usize,
    message: std::sync::Mutex<Option<String>>,
    fault: std::sync::Mutex<Option<String>>,
}

impl<'a> SinkContext<'a> {
    /// For a call about `agents` agents, if it is about any.
    pub fn new(sink: &'a dyn Sink, agents: Option<usize>, max_cells: usize) -> Self {
        Self {
            sink,
            agents,
            max_cells,
            message: None.into(),
            fault: None.into(),
        }
    }

    /// The C form; valid as long as `self`.
    pub fn to_c(&self) -> c::Sink {
        c::Sink {
            struct_size: size_of::<c::Sink>(),
            reserved: 0,
            context: ptr::from_ref(self).cast_mut().cast(),
            submit_plan: Some(submit_plan),
            submit_instance: Some(submit_instance),
            metric: Some(metric),
            log: Some(log),
            progress: Some(progress),
            cancelled: Some(cancelled),
            fail: Some(fail),
        }
    }

    /// The plugin's explanation of its status, if it gave one.
    pub fn take_message(&self) -> Option<String> {
        lock(&self.message).take()
    }

    /// The first thing that was submitted and broke the contract.
    pub fn take_fault(&self) -> Option<String> {
        lock(&self.fault).take()
    }

    fn broken(&self, fault: String) -> i32 {
        self.sink.log(LogLevel::Error, &fault);
        lock(&self.fault).get_or_insert(fault);
        c::REJECTED
    }
}

fn lock<T>(mutex: &std::sync::Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    // A panic while the lock was held leaves a plain value behind.
    mutex
        .lock()
        .unwrap_or_else(std::sync::PoisonError::into_inner)
}

/// # Safety
/// `pointer` came from [`SinkContext::to_c`], and the context is alive.
unsafe fn context<'a>(pointer: *mut c_void) -> &'a SinkContext<'a> {
    // SAFETY: by the caller's promise.
    unsafe { &*pointer.cast::<SinkContext<'a>>() }
}

unsafe extern "C" fn submit_plan(pointer: *mut c_void, plan: *const c::Plan) -> i32 {
    // SAFETY: the plugin passes back the context of the sink it was given.
    let context = unsafe { context(pointer) };
    // SAFETY: the plugin's promise by the header.
    match unsafe { GridPlan::from_c(plan, context.agents, context.max_cells) } {
        Ok(plan) => code(context.sink.submit_plan(&plan)),
        Err(fault) => context.broken(fault),
    }
}

unsafe extern "C" fn submit_instance(pointer: *mut c_void, instance: *const c::Instance) -> i32 {
    // SAFETY: as above.
    let context = unsafe { context(pointer) };
    // SAFETY: as above.
    match unsafe { Instance::from_c(instance, context.max_cells) } {
        Ok(instance) => code(context.sink.submit_instance(&instance)),
        Err(fault) => context.broken(fault),
    }
}

fn code(result: Result<(), Rejected>) -> i32 {
    if result.is_ok() { c::OK } else { c::REJECTED }
}

unsafe extern "C" fn metric(pointer: *mut c_void, name: c::Str, value: f64) {
    // SAFETY: as above.
    let (context, name) = unsafe { (context(pointer), string(name)) };
    match check_figure(&name, value) {
        Ok(()) => context.sink.metric(&name, value),
        Err(reason) => {
            context.broken(reason);
        }
    }
}

unsafe extern "C" fn log(pointer: *mut c_void, level: i32, text: c::Str) {
    let level = LogLevel::from_code(level).unwrap_or(LogLevel::Info);
    // SAFETY: as above.
    unsafe { context(pointer).sink.log(level, &string(text)) };
}

unsafe extern "C" fn progress(pointer: *mut c_void, done: u64, total: u64) {
    // SAFETY: as above.
    unsafe { context(pointer).sink.progress(done, total) };
}

unsafe extern "C" fn cancelled(pointer: *mut c_void) -> i32 {
    // SAFETY: as above.
    i32::from(unsafe { context(pointer).sink.cancelled() })
}

unsafe extern "C" fn fail(pointer: *mut c_void, message: c::Str) {
    // SAFETY: as above.
    let context = unsafe { context(pointer) };
    // SAFETY: as above.
    *lock(&context.message) = Some(unsafe { string(message) });
}

/// A C sink as a Rust one, for plugins written in Rust.
pub struct CSink<'a> {
    raw: &'a c::Sink,
}

// SAFETY: the functions of a sink may be called from any thread.
unsafe impl Sync for CSink<'_> {}

impl<'a> CSink<'a> {
    /// # Safety
    /// As [`checked`].
    pub unsafe fn new(pointer: *const c::Sink) -> Result<Self, String> {
        // SAFETY: by the caller's promise.
        Ok(Self {
            raw: unsafe { checked("sink", pointer)? },
        })
    }

    /// Explains the status that the call is about to return.
    pub fn fail(&self, message: &str) {
        if let Some(fail) = self.raw.fail {
            // SAFETY: the sink is the host's, and the text lives through the call.
            unsafe { fail(self.raw.context, c::Str::new(message)) };
        }
    }
}

impl Sink for CSink<'_> {
    fn submit_plan(&self, plan: &GridPlan) -> Result<(), Rejected> {
        let submit = self.raw.submit_plan.ok_or(Rejected)?;
        let raw = plan.to_c();
        // SAFETY: the plan lives through the call.
        let code = unsafe { submit(self.raw.context, &raw const raw) };
        if code == c::OK { Ok(()) } else { Err(Rejected) }
    }

    fn submit_instance(&self, instance: &Instance) -> Result<(), Rejected> {
        let submit = self.raw.submit_instance.ok_or(Rejected)?;
        let instance = CInstance::new(instance, ptr::null());
        // SAFETY: the instance lives through the call.
        let code = unsafe { submit(self.raw.context, instance.raw()) };
        if code == c::OK { Ok(()) } else { Err(Rejected) }
    }

    fn metric(&self, name: &str, value: f64) {
        if let Some(metric) = self.raw.metric {
            // SAFETY: the text lives through the call.
            unsafe { metric(self.raw.context, c::Str::new(name), value) };
        }
    }

    fn log(&self, level: LogLevel, text: &str) {
        if let Some(log) = self.raw.log {
            // SAFETY: the text lives through the call.
            unsafe { log(self.raw.context, level.code(), c::Str::new(text)) };
        }
    }

    fn progress(&self, done: u64, total: u64) {
        if let Some(progress) = self.raw.progress {
            // SAFETY: the sink is the host's.
            unsafe { progress(self.raw.context, done, total) };
        }
    }

    fn cancelled(&self) -> bool {
        // SAFETY: the sink is the host's.
        self.raw
            .cancelled
            .is_some_and(|cancelled| unsafe { cancelled(self.raw.context) } != 0)
    }
}

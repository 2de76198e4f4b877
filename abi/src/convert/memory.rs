//! Parts that this version knows.

use std::ffi::c_void;
use std::ptr;

use super::{Kept, copied, finite, invalid, lists, reserved, size_of, whole};
use crate::c;
use crate::lists::Lists;
use crate::memory::{self, Data, GoalTasks, Guidance, RestOfPlan, Snapshot, Traffic};
use crate::sdk::Failure;

/// The structure of a part's data and its flags; null for JSON, which has no structure of its own.
/// Valid as long as the data and what is kept.
pub(super) fn data_to_c(data: &Data, kept: &mut Kept) -> *const c_void {
    match data {
        Data::Json(_) => ptr::null(),
        Data::Traffic(traffic) => traffic_to_c(traffic, kept).cast(),
        Data::RestOfPlan(rest) => rest_to_c(rest, kept).cast(),
        Data::GoalTasks(tasks) => goal_tasks_to_c(tasks, kept).cast(),
        Data::Guidance(guidance) => kept.one(guidance_to_c(guidance)).cast(),
        Data::Kept(data) => kept.one(bytes_to_c(&data.bytes)).cast(),
    }
}

fn traffic_to_c(traffic: &Traffic, kept: &mut Kept) -> *const c::Traffic {
    let mut snapshot = |snapshot: &Snapshot| {
        kept.one(c::Snapshot {
            struct_size: size_of::<c::Snapshot>(),
            reserved: 0,
            number: snapshot.number,
            waiting: snapshot.waiting.as_ptr(),
            flow: snapshot.flow.as_ptr(),
        })
    };
    let [last, before] = [&traffic.last, &traffic.before].map(&mut snapshot);
    kept.one(c::Traffic {
        struct_size: size_of::<c::Traffic>(),
        places: traffic.last.waiting.len() as u32,
        flows: traffic.last.flow.len() as u64,
        period_s: traffic.period_s,
        time_constant_s: traffic.time_constant_s,
        since_s: traffic.since_s,
        flow_unit_per_s: traffic.flow_unit_per_s,
        last,
        before,
    })
}

fn rest_to_c(rest: &RestOfPlan, kept: &mut Kept) -> *const c::RestOfPlan {
    let moves: Lists<u8> = rest.paths.iter().map(|path| path.bytes()).collect();
    let raw = c::RestOfPlan {
        struct_size: size_of::<c::RestOfPlan>(),
        agents: rest.paths.len() as u32,
        offsets: kept.list(moves.offsets()),
        moves: kept.list(moves.items()),
    };
    kept.one(raw)
}

fn goal_tasks_to_c(tasks: &GoalTasks, kept: &mut Kept) -> *const c::GoalTasks {
    let ids: Vec<u64> = tasks
        .tasks
        .iter()
        .map(|id| id.unwrap_or(u64::MAX))
        .collect();
    let errands = tasks.errands.iter().map(|at| at.unwrap_or(c::NONE));
    let errands: Vec<u32> = errands.collect();
    let raw = c::GoalTasks {
        struct_size: size_of::<c::GoalTasks>(),
        reserved: 0,
        goals: ids.len() as u64,
        time_s: tasks.time_s,
        tasks: kept.list(ids),
        errands: kept.list(errands),
        released_s: tasks.released_s.as_ptr(),
        given_s: tasks.given_s.as_ptr(),
    };
    kept.one(raw)
}

fn guidance_to_c(guidance: &Guidance) -> c::Guidance {
    c::Guidance {
        struct_size: size_of::<c::Guidance>(),
        places: guidance.waits.len() as u32,
        move_count: guidance.moves.len() as u64,
        moves: guidance.moves.as_ptr(),
        waits: guidance.waits.as_ptr(),
    }
}

/// The C form of bytes; valid as long as they are.
pub(super) fn bytes_to_c(bytes: &[u8]) -> c::Bytes {
    c::Bytes {
        struct_size: size_of::<c::Bytes>(),
        reserved: 0,
        ptr: bytes.as_ptr(),
        len: bytes.len() as u64,
    }
}

/// Copies the data of a part with this identifier; `None` if it is unknown.
///
/// # Safety
/// As [`checked`](super::checked), and the arrays are as long as the header says.
pub(super) unsafe fn data_from_c(id: &str, data: *const c_void) -> Result<Option<Data>, Failure> {
    // SAFETY: by the caller's promise, and the identifier says what it is.
    Ok(Some(match id {
        c::TRAFFIC_ID => Data::Traffic(unsafe { traffic_from_c(data.cast())? }.into()),
        c::REST_OF_PLAN_ID => Data::RestOfPlan(unsafe { rest_from_c(data.cast())? }.into()),
        c::GOAL_TASKS_ID => Data::GoalTasks(unsafe { goal_tasks_from_c(data.cast())? }.into()),
        c::GUIDANCE_ID => Data::Guidance(unsafe { guidance_from_c(data.cast())? }.into()),
        c::KEPT_ID => {
            let bytes = unsafe { bytes_from_c(data.cast())? };
            Data::Kept(memory::Kept { bytes }.into())
        }
        _ => return Ok(None),
    }))
}

/// # Safety
/// As [`data_from_c`].
unsafe fn traffic_from_c(pointer: *const c::Traffic) -> Result<Traffic, Failure> {
    // SAFETY: by the caller's promise, here and below.
    let raw = unsafe { whole("traffic", pointer)? };
    let flows = usize::try_from(raw.flows).map_err(|_| invalid("traffic.flows are too many"))?;
    let snapshot = |name, pointer: *const c::Snapshot| -> Result<Snapshot, Failure> {
        // SAFETY: as promised.
        let snapshot = unsafe { whole(name, pointer)? };
        reserved(name, snapshot.reserved)?;
        Ok(Snapshot {
            number: snapshot.number,
            // SAFETY: as promised.
            waiting: unsafe { copied("traffic.waiting", snapshot.waiting, raw.places as usize)? },
            // SAFETY: as promised.
            flow: unsafe { copied("traffic.flow", snapshot.flow, flows)? },
        })
    };
    Ok(Traffic {
        period_s: raw.period_s,
        time_constant_s: raw.time_constant_s,
        since_s: raw.since_s,
        flow_unit_per_s: raw.flow_unit_per_s,
        last: snapshot("traffic.last", raw.last)?,
        before: snapshot("traffic.before", raw.before)?,
    })
}

/// # Safety
/// As [`data_from_c`].
unsafe fn rest_from_c(pointer: *const c::RestOfPlan) -> Result<RestOfPlan, Failure> {
    // SAFETY: by the caller's promise, here and below.
    let raw = unsafe { whole("rest_of_plan", pointer)? };
    let names = ["rest_of_plan.offsets", "rest_of_plan.moves"];
    let agents = raw.agents as usize;
    // SAFETY: as promised.
    let moves = unsafe { lists(names, raw.offsets, raw.moves, agents, usize::MAX)? };
    let path = |moves: &[u8]| String::from_utf8_lossy(moves).into_owned();
    Ok(RestOfPlan {
        paths: moves.iter().map(path).collect(),
    })
}

/// # Safety
/// As [`data_from_c`].
unsafe fn goal_tasks_from_c(pointer: *const c::GoalTasks) -> Result<GoalTasks, Failure> {
    // SAFETY: by the caller's promise, here and below.
    let raw = unsafe { whole("goal_tasks", pointer)? };
    reserved("goal_tasks", raw.reserved)?;
    let len = usize::try_from(raw.goals).map_err(|_| invalid("goal_tasks.goals are too many"))?;
    // SAFETY: as promised.
    let tasks = unsafe { copied("goal_tasks.tasks", raw.tasks, len)? };
    // SAFETY: as promised.
    let errands = unsafe { copied("goal_tasks.errands", raw.errands, len)? };
    // SAFETY: as promised.
    let times = |name, pointer| unsafe { copied::<f64>(name, pointer, len) };
    let released_s = times("goal_tasks.released_s", raw.released_s)?;
    let given_s = times("goal_tasks.given_s", raw.given_s)?;
    finite("goal_tasks.released_s", &released_s)?;
    finite("goal_tasks.given_s", &given_s)?;
    Ok(GoalTasks {
        time_s: raw.time_s,
        tasks: tasks
            .into_iter()
            .map(|id| (id != u64::MAX).then_some(id))
            .collect(),
        errands: errands
            .into_iter()
            .map(|at| (at != c::NONE).then_some(at))
            .collect(),
        released_s,
        given_s,
    })
}

/// # Safety
/// As [`data_from_c`].
unsafe fn guidance_from_c(pointer: *const c::Guidance) -> Result<Guidance, Failure> {
    // SAFETY: by the caller's promise, here and below.
    let raw = unsafe { whole("guidance", pointer)? };
    let moves =
        usize::try_from(raw.move_count).map_err(|_| invalid("guidance.moves are too many"))?;
    let guidance = Guidance {
        // SAFETY: as promised.
        moves: unsafe { copied("guidance.moves", raw.moves, moves)? },
        // SAFETY: as promised.
        waits: unsafe { copied("guidance.waits", raw.waits, raw.places as usize)? },
    };
    guidance
        .check()
        .map_err(|reason| invalid(format!("guidance.{reason}")))?;
    Ok(guidance)
}

/// Copies bytes; refuses more than a plugin may keep before it reads them.
///
/// # Safety
/// As [`data_from_c`].
pub(super) unsafe fn bytes_from_c(pointer: *const c::Bytes) -> Result<Vec<u8>, Failure> {
    // SAFETY: by the caller's promise, here and below.
    let raw = unsafe { whole("bytes", pointer)? };
    reserved("bytes", raw.reserved)?;
    memory::may_be_kept(raw.len).map_err(invalid)?;
    // SAFETY: as promised.
    unsafe { copied("bytes", raw.ptr, raw.len as usize) }
}

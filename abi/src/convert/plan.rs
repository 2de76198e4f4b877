//! Plans in each of their forms.

use std::ptr;

use super::instance::nothing_critical;
use super::{code, copied, finite, invalid, lists, offsets_of, reserved, size_of, whole};
use crate::c;
use crate::lists::Lists;
use crate::plan::{ControlPlan, GridPlan, Knot, MotionPlan, MotionRef, Plan, PlanRef, Visit};
use crate::sdk::Failure;

/// The sentence for a plan with paths for too few or too many agents.
pub fn wrong_agents(paths: usize, agents: usize) -> String {
    format!("the plan has {paths} paths, but the instance has {agents} agents")
}

/// One number of each entry, as a column.
fn column<E>(entries: &[E], number: impl Fn(&E) -> f64) -> Vec<f64> {
    entries.iter().map(number).collect()
}

impl PlanRef<'_> {
    /// Calls `give` with the C form, which is valid as long as the call.
    pub fn with_c<T>(self, give: impl FnOnce(*const c::Plan) -> T) -> T {
        let agents = self.agents() as u32;
        let give = |form: i32, offsets: &[u64], body: *const std::ffi::c_void| {
            let raw = c::Plan {
                struct_size: size_of::<c::Plan>(),
                agents,
                form,
                reserved: 0,
                offsets: offsets.as_ptr(),
                body,
                parts: c::Parts::NONE,
            };
            give(&raw const raw)
        };
        match self {
            Self::Cells(plan) => {
                let body = c::Cells {
                    struct_size: size_of::<c::Cells>(),
                    reserved: 0,
                    cells: plan.cells().as_ptr(),
                };
                give(
                    c::FORM_CELLS,
                    plan.lists().offsets(),
                    (&raw const body).cast(),
                )
            }
            Self::Visits(plan) => {
                let visits = plan.items();
                let vertices: Vec<u32> = visits.iter().map(|visit| visit.vertex).collect();
                let arrival_s = column(visits, |visit| visit.arrival_s);
                let departure_s = column(visits, |visit| visit.departure_s);
                let body = c::Visits {
                    struct_size: size_of::<c::Visits>(),
                    reserved: 0,
                    vertices: vertices.as_ptr(),
                    arrival_s: arrival_s.as_ptr(),
                    departure_s: departure_s.as_ptr(),
                };
                give(c::FORM_VISITS, plan.offsets(), (&raw const body).cast())
            }
            Self::Trajectories(MotionRef {
                knots: plan,
                controls,
            }) => {
                let knots = plan.items();
                let time_s = column(knots, |knot| knot.time_s);
                let x_m = column(knots, |knot| knot.x_m);
                let y_m = column(knots, |knot| knot.y_m);
                let heading_rad = column(knots, |knot| knot.heading_rad);
                let headless = heading_rad.iter().all(|heading| heading.is_nan());
                let body = c::Trajectories {
                    struct_size: size_of::<c::Trajectories>(),
                    reserved: 0,
                    time_s: time_s.as_ptr(),
                    x_m: x_m.as_ptr(),
                    y_m: y_m.as_ptr(),
                    heading_rad: if headless {
                        ptr::null()
                    } else {
                        heading_rad.as_ptr()
                    },
                    segment_offsets: controls
                        .map_or(ptr::null(), |plan| plan.durations_s().offsets().as_ptr()),
                    duration_s: controls
                        .map_or(ptr::null(), |plan| plan.durations_s().items().as_ptr()),
                    control_offsets: controls
                        .map_or(ptr::null(), |plan| plan.numbers().offsets().as_ptr()),
                    controls: controls.map_or(ptr::null(), |plan| plan.numbers().items().as_ptr()),
                };
                give(
                    c::FORM_TRAJECTORIES,
                    plan.offsets(),
                    (&raw const body).cast(),
                )
            }
        }
    }
}

impl Plan {
    /// Copies from the C form, then looks at the copies. Refuses a plan for another number of
    /// agents, or one with more than `most` entries, before looking at its arrays.
    ///
    /// # Safety
    /// As [`checked`](super::checked), and the arrays are as long as the header says.
    pub unsafe fn from_c(
        pointer: *const c::Plan,
        agents: Option<usize>,
        most: usize,
    ) -> Result<Self, Failure> {
        // SAFETY: by the caller's promise, here and below.
        let raw = unsafe { ptr::read(whole("plan", pointer)?) };
        let paths = raw.agents as usize;
        if let Some(agents) = agents.filter(|agents| *agents != paths) {
            return Err(invalid(wrong_agents(paths, agents)));
        }
        reserved("plan", raw.reserved)?;
        // SAFETY: as promised.
        unsafe { nothing_critical(raw.parts)? };
        let known = |code: i32| (1..=3).contains(&code).then_some(code);
        Ok(match code("plan.form", raw.form, known)? {
            c::FORM_CELLS => {
                // SAFETY: the form says what the body is, here and below.
                let body = unsafe { whole("plan.body", raw.body.cast::<c::Cells>())? };
                reserved("plan.body", body.reserved)?;
                let names = ["plan.offsets", "plan.cells"];
                // SAFETY: as promised.
                let cells = unsafe { lists(names, raw.offsets, body.cells, paths, most)? };
                Self::Cells(GridPlan::from(cells))
            }
            c::FORM_VISITS => {
                // SAFETY: as promised.
                let body = unsafe { whole("plan.body", raw.body.cast::<c::Visits>())? };
                reserved("plan.body", body.reserved)?;
                let names = ["plan.offsets", "plan.vertices"];
                // SAFETY: as promised.
                let (offsets, len) = unsafe { offsets_of(names, raw.offsets, paths, most)? };
                // SAFETY: as promised.
                let vertices = unsafe { copied(names[1], body.vertices, len)? };
                // SAFETY: as promised.
                let arrivals = unsafe { copied("plan.arrival_s", body.arrival_s, len)? };
                // SAFETY: as promised.
                let departures = unsafe { copied("plan.departure_s", body.departure_s, len)? };
                finite("plan.arrival_s", &arrivals)?;
                finite("plan.departure_s", &departures)?;
                let visits = vertices.into_iter().zip(arrivals).zip(departures);
                let visits = visits.map(|((vertex, arrival_s), departure_s)| Visit {
                    vertex,
                    arrival_s,
                    departure_s,
                });
                Self::Visits(Lists::from_flat(offsets, visits.collect()).unwrap_or_default())
            }
            _ => {
                // SAFETY: as promised.
                let body = unsafe { whole("plan.body", raw.body.cast::<c::Trajectories>())? };
                reserved("plan.body", body.reserved)?;
                let names = ["plan.offsets", "plan.time_s"];
                // SAFETY: as promised.
                let (offsets, len) = unsafe { offsets_of(names, raw.offsets, paths, most)? };
                // SAFETY: as promised.
                let column = |name, pointer| unsafe { copied(name, pointer, len) };
                let time_s = column(names[1], body.time_s)?;
                let x_m = column("plan.x_m", body.x_m)?;
                let y_m = column("plan.y_m", body.y_m)?;
                finite(names[1], &time_s)?;
                finite("plan.x_m", &x_m)?;
                finite("plan.y_m", &y_m)?;
                let heading_rad = if body.heading_rad.is_null() {
                    vec![f64::NAN; len]
                } else {
                    let headings = column("plan.heading_rad", body.heading_rad)?;
                    let there = headings.iter().filter(|heading| !heading.is_nan());
                    finite("plan.heading_rad", there)?;
                    headings
                };
                let knots = (0..len).map(|knot| Knot {
                    time_s: time_s[knot],
                    x_m: x_m[knot],
                    y_m: y_m[knot],
                    heading_rad: heading_rad[knot],
                });
                let knots = Lists::from_flat(offsets, knots.collect()).unwrap_or_default();
                if body.segment_offsets.is_null() {
                    return Ok(Self::from(knots));
                }
                // SAFETY: as promised.
                let controls = unsafe { controls_from_c(body, paths, most - len)? };
                MotionPlan::new(knots, controls)
                    .map(Self::Trajectories)
                    .ok_or_else(|| invalid("controls of other agents than knots"))?
            }
        })
    }
}

/// Copies the controls of a plan, then looks at the copies. Refuses more than `most` segments.
///
/// # Safety
/// The arrays are as long as the header says.
unsafe fn controls_from_c(
    body: &c::Trajectories,
    agents: usize,
    most: usize,
) -> Result<ControlPlan, Failure> {
    let names = ["plan.segment_offsets", "plan.duration_s"];
    // SAFETY: by the caller's promise, here and below.
    let durations = unsafe { lists(names, body.segment_offsets, body.duration_s, agents, most)? };
    let names = ["plan.control_offsets", "plan.controls"];
    let numbers = durations.items().len() * ControlPlan::MOST_NUMBERS;
    // SAFETY: as promised.
    let numbers = unsafe { lists(names, body.control_offsets, body.controls, agents, numbers)? };
    finite("plan.duration_s", durations.items())?;
    finite("plan.controls", numbers.items())?;
    ControlPlan::new(durations, numbers).map_err(invalid)
}

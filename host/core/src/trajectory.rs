//! Trajectory plans: per agent, where it is in the plane at which times.

use fleetyard_abi::ControlPlan;

use crate::frame::cell_center_m;
use crate::{Digest, Grid, GridPlan, Hasher};

/// The planned position of an agent at a time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Knot {
    /// Time in seconds from the beginning of the plan.
    pub time_s: f64,
    /// Position in metres, to the right.
    pub x_m: f64,
    /// Position in metres, upwards.
    pub y_m: f64,
    /// Heading in radians, counter-clockwise from +x, if the plan has headings. It is
    /// unwrapped: a turn of 270° to the left ends at a heading larger by 3π/2.
    pub heading_rad: Option<f64>,
}

/// A plan in the plane: each agent moves from knot to knot, position and heading linear
/// in time, and rests at its last.
///
/// Stored flat: path i is the knots `offsets[i]..offsets[i + 1]`. Invariants: every path
/// has a knot, its first is at time 0, times ascend strictly, all numbers are finite and
/// at most [`TrajectoryPlan::LARGEST`] in magnitude, and either every knot has a heading
/// or none has. A knot that repeats the one before it is dropped when it is added.
/// A plan may have controls beside its knots, for as many agents: durations are above 0, and none of
/// their numbers exceeds that magnitude.
/// Nothing else is promised: a plan may leave the world, be too fast or collide.
#[derive(Debug, Clone, PartialEq)]
pub struct TrajectoryPlan {
    offsets: Vec<usize>,
    time_s: Vec<f64>,
    x_m: Vec<f64>,
    y_m: Vec<f64>,
    heading_rad: Option<Vec<f64>>,
    controls: Option<ControlPlan>,
}

/// A path that is being appended.
#[derive(Default)]
pub(crate) struct Unfinished {
    /// Number of knots appended.
    knots: usize,
    last: Option<Knot>,
}

/// The reason why knots do not make a trajectory plan. Agents and their knots are counted from 0.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)]
pub enum TrajectoryError {
    #[error("{what} has {found} entries, but there are {expected} knots")]
    LengthMismatch {
        what: &'static str,
        expected: usize,
        found: usize,
    },
    #[error("offsets must begin at 0, not descend, and end at the number of knots, {knots}")]
    Offsets { knots: usize },
    #[error("agent {agent} has no knots")]
    NoKnots { agent: usize },
    #[error("knot {knot} of agent {agent} has {what} {value}, which is not finite")]
    NotFinite {
        agent: usize,
        knot: usize,
        what: &'static str,
        value: f64,
    },
    #[error("knot {knot} of agent {agent} has {what} {value:e}, beyond ±{most:e}")]
    TooLarge {
        agent: usize,
        knot: usize,
        what: &'static str,
        value: f64,
        most: f64,
    },
    #[error("agent {agent} begins at time {time_s} s, not at 0")]
    LateBegin { agent: usize, time_s: f64 },
    #[error("knot {knot} of agent {agent} goes back in time, from {before_s} s to {time_s} s")]
    BackInTime {
        agent: usize,
        knot: usize,
        before_s: f64,
        time_s: f64,
    },
    #[error(
        "there is a gap at knot {knot} of agent {agent}: at time {time_s} s it is in two places, \
         {distance_m} m apart and turned by {turn_rad} rad"
    )]
    Gap {
        agent: usize,
        knot: usize,
        time_s: f64,
        distance_m: f64,
        turn_rad: f64,
    },
    #[error("knot {knot} of agent {agent} {}, unlike the first of the plan",
        if *has { "has a heading" } else { "has no heading" })]
    MixedHeadings {
        agent: usize,
        knot: usize,
        has: bool,
    },
    #[error("the {what} is {value}, but it must be positive and finite")]
    Scale { what: &'static str, value: f64 },
    #[error("agent {agent} is not on the map at time {time}")]
    OffMap { agent: usize, time: usize },
    #[error("there are controls of {controls} agents, but paths of {paths}")]
    ControlCount { controls: usize, paths: usize },
    #[error("segment {segment} of agent {agent} has {what} {value:?}, {fault}")]
    Control {
        agent: usize,
        segment: usize,
        what: &'static str,
        value: f64,
        fault: &'static str,
    },
}

impl TrajectoryError {
    /// The agent at fault, and which of its knots, if one is.
    pub fn place(&self) -> Option<(usize, usize)> {
        match self {
            Self::LengthMismatch { .. }
            | Self::Offsets { .. }
            | Self::Scale { .. }
            | Self::ControlCount { .. }
            | Self::Control { .. } => None,
            Self::NoKnots { agent } | Self::LateBegin { agent, .. } => Some((*agent, 0)),
            Self::OffMap { agent, time } => Some((*agent, *time)),
            Self::NotFinite { agent, knot, .. }
            | Self::TooLarge { agent, knot, .. }
            | Self::BackInTime { agent, knot, .. }
            | Self::Gap { agent, knot, .. }
            | Self::MixedHeadings { agent, knot, .. } => Some((*agent, *knot)),
        }
    }

    /// Advice to the author of the plan, if there is any.
    pub fn hint(&self) -> Option<&'static str> {
        match self {
            Self::NoKnots { .. } => Some("an agent that rests has one knot, at time 0"),
            Self::LateBegin { .. } => {
                Some("begin with a knot at time 0; an agent that waits has two knots in one place")
            }
            Self::Gap { .. } => Some("give the move the time that it takes"),
            Self::MixedHeadings { .. } => {
                Some("give every knot of every agent a heading, or none; a disc's may be 0")
            }
            Self::ControlCount { .. } => {
                Some("give every agent a list of segments, empty where it has knots alone")
            }
            Self::Control { .. } => Some(
                "a segment is [duration, number, …]: seconds above 0, then the control; all of them \
                 together take at most 1e9 s",
            ),
            _ => None,
        }
    }
}

/// Refuses controls with numbers that nothing can be computed of, and durations that are none.
pub fn check_controls(controls: &ControlPlan) -> Result<(), TrajectoryError> {
    for agent in 0..controls.agents() {
        let mut end_s = 0.0;
        for (number, segment) in controls.of(agent).enumerate() {
            let wrong = |what, value, fault| TrajectoryError::Control {
                agent,
                segment: number,
                what,
                value,
                fault,
            };
            let duration_s = segment.duration_s;
            if duration_s.is_nan() || duration_s <= 0.0 {
                return Err(wrong("the duration", duration_s, "which is not above 0"));
            }
            end_s += duration_s;
            if end_s > TrajectoryPlan::LARGEST {
                return Err(wrong(
                    "the duration",
                    duration_s,
                    "beyond 1e9 s from the start",
                ));
            }
            let mut numbers = segment.control.iter();
            let small = |number: &&f64| number.abs() <= TrajectoryPlan::LARGEST;
            if let Some(value) = numbers.find(|number| !small(number)) {
                return Err(wrong("the number", *value, "beyond ±1e9"));
            }
        }
    }
    Ok(())
}

/// The fastest that an agent moves and turns between two of its knots.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Fastest {
    /// Speed in m/s.
    pub speed_m_per_s: f64,
    /// The knot at the end of the first move that has this speed; 0 if nothing moves.
    pub speed_knot: usize,
    /// Turn rate in rad/s, in magnitude.
    pub turn_rad_per_s: f64,
    /// The knot at the end of the first move that has this turn rate; 0 if nothing turns.
    pub turn_knot: usize,
}

impl Default for TrajectoryPlan {
    fn default() -> Self {
        Self::with_capacity(0, 0)
    }
}

impl TrajectoryPlan {
    /// The largest magnitude of a coordinate in metres, a time in seconds and a heading
    /// in radians: squares and differences stay finite, and a nanometre more or less
    /// matters at a thousand kilometres only.
    pub const LARGEST: f64 = 1e9;

    /// A plan without agents, ready for [`TrajectoryPlan::push_path`].
    pub fn with_capacity(agents: usize, knots: usize) -> Self {
        let mut offsets = Vec::with_capacity(agents + 1);
        offsets.push(0);
        Self {
            offsets,
            time_s: Vec::with_capacity(knots),
            x_m: Vec::with_capacity(knots),
            y_m: Vec::with_capacity(knots),
            heading_rad: None,
            controls: None,
        }
    }

    /// Checks the invariants and takes the columns over.
    ///
    /// `offsets` are prefix sums of the numbers of knots: one entry more than there are
    /// agents, the first of them 0.
    pub fn from_columns(
        mut offsets: Vec<usize>,
        mut time_s: Vec<f64>,
        mut x_m: Vec<f64>,
        mut y_m: Vec<f64>,
        mut heading_rad: Option<Vec<f64>>,
    ) -> Result<Self, TrajectoryError> {
        let expected = time_s.len();
        let columns = [
            ("x_m", Some(x_m.len())),
            ("y_m", Some(y_m.len())),
            ("heading_rad", heading_rad.as_ref().map(Vec::len)),
        ];
        for (what, found) in columns {
            if let Some(found) = found.filter(|found| *found != expected) {
                return Err(TrajectoryError::LengthMismatch {
                    what,
                    expected,
                    found,
                });
            }
        }
        let ascending = offsets.is_sorted();
        if !ascending || offsets.first() != Some(&0) || offsets.last() != Some(&expected) {
            return Err(TrajectoryError::Offsets { knots: expected });
        }
        // Repeated knots are dropped by moving what is kept to the front.
        let mut kept = 0;
        let mut begin = 0;
        for agent in 0..offsets.len() - 1 {
            let (first, end) = (begin, offsets[agent + 1]);
            begin = end;
            let mut before = None;
            for at in first..end {
                let heading = heading_rad.as_ref().map(|all| all[at]);
                let knot = knot(time_s[at], x_m[at], y_m[at], heading);
                if follows(agent, at - first, before, knot)? {
                    time_s[kept] = knot.time_s;
                    x_m[kept] = knot.x_m;
                    y_m[kept] = knot.y_m;
                    if let (Some(all), Some(heading)) = (&mut heading_rad, knot.heading_rad) {
                        all[kept] = heading;
                    }
                    kept += 1;
                    before = Some(knot);
                }
            }
            if before.is_none() {
                return Err(TrajectoryError::NoKnots { agent });
            }
            offsets[agent + 1] = kept;
        }
        for column in [&mut time_s, &mut x_m, &mut y_m] {
            column.truncate(kept);
        }
        if let Some(headings) = &mut heading_rad {
            headings.truncate(kept);
        }
        Ok(Self {
            offsets,
            time_s,
            x_m,
            y_m,
            heading_rad,
            controls: None,
        })
    }

    /// Appends the path of the next agent. A path that is refused leaves the plan as it
    /// was.
    pub fn push_path(
        &mut self,
        knots: impl IntoIterator<Item = Knot>,
    ) -> Result<(), TrajectoryError> {
        let begin = self.time_s.len();
        let mut path = Unfinished::default();
        let mut knots = knots.into_iter();
        let result = knots
            .try_for_each(|knot| self.push_knot(&mut path, knot))
            .and_then(|()| self.finish_path(&path));
        if result.is_err() {
            for column in [&mut self.time_s, &mut self.x_m, &mut self.y_m] {
                column.truncate(begin);
            }
            match &mut self.heading_rad {
                Some(_) if begin == 0 => self.heading_rad = None,
                Some(headings) => headings.truncate(begin),
                None => {}
            }
        }
        result
    }

    /// Appends a knot to the path that comes after those of [`TrajectoryPlan::agents`].
    /// After an error the plan is of no use.
    pub(crate) fn push_knot(
        &mut self,
        path: &mut Unfinished,
        given: Knot,
    ) -> Result<(), TrajectoryError> {
        let (agent, number) = (self.agents(), path.knots);
        path.knots += 1;
        let knot = knot(given.time_s, given.x_m, given.y_m, given.heading_rad);
        let has = knot.heading_rad.is_some();
        if self.time_s.is_empty() {
            self.heading_rad = has.then(|| Vec::with_capacity(self.time_s.capacity()));
        } else if has != self.heading_rad.is_some() {
            return Err(TrajectoryError::MixedHeadings {
                agent,
                knot: number,
                has,
            });
        }
        if follows(agent, number, path.last, knot)? {
            self.time_s.push(knot.time_s);
            self.x_m.push(knot.x_m);
            self.y_m.push(knot.y_m);
            if let (Some(all), Some(heading)) = (&mut self.heading_rad, knot.heading_rad) {
                all.push(heading);
            }
            path.last = Some(knot);
        }
        Ok(())
    }

    /// Makes the knots that were appended the path of the next agent.
    pub(crate) fn finish_path(&mut self, path: &Unfinished) -> Result<(), TrajectoryError> {
        if path.last.is_none() {
            let agent = self.agents();
            return Err(TrajectoryError::NoKnots { agent });
        }
        self.offsets.push(self.time_s.len());
        Ok(())
    }

    /// The same plan in the plane: a step takes `step_s` seconds, and positions are cell
    /// centres. Every move has its knot; of the knots within a wait none is kept.
    pub fn from_grid(
        plan: &GridPlan,
        grid: &Grid,
        cell_size_m: f64,
        step_s: f64,
    ) -> Result<Self, TrajectoryError> {
        check_grid(plan, grid, cell_size_m, step_s)?;
        let mut all = Self::with_capacity(plan.agents(), 0);
        for path in plan.paths() {
            let within_wait = |time: usize| {
                let around = time
                    .checked_sub(1)
                    .and_then(|from| path.get(from..time + 2));
                around.is_some_and(|cells| cells[0] == cells[1] && cells[1] == cells[2])
            };
            let times = (0..path.len()).filter(|time| !within_wait(*time));
            all.push_path(times.map(|time| {
                let (x_m, y_m) = cell_center_m(grid, cell_size_m, path[time]);
                Knot {
                    time_s: time as f64 * step_s,
                    x_m,
                    y_m,
                    heading_rad: None,
                }
            }))?;
        }
        Ok(all)
    }

    /// Paths without times, as any-angle planners return them, in the plane: from centre
    /// to centre of their cells in straight lines, a cell's side in `step_s` seconds.
    /// Only the cells at which a path turns have a knot, besides its ends.
    pub fn along_lines(
        plan: &GridPlan,
        grid: &Grid,
        cell_size_m: f64,
        step_s: f64,
    ) -> Result<Self, TrajectoryError> {
        check_grid(plan, grid, cell_size_m, step_s)?;
        let mut all = Self::with_capacity(plan.agents(), 0);
        for path in plan.paths() {
            let mut turns: Vec<u32> = Vec::new();
            for cell in path {
                if turns.last() == Some(cell) {
                    continue;
                }
                if let [.., from, by] = turns[..] {
                    let ((ar, ac), (br, bc)) = (way(grid, from, by), way(grid, by, *cell));
                    if ar * bc == ac * br && ar * br + ac * bc > 0 {
                        turns.pop();
                    }
                }
                turns.push(*cell);
            }
            let mut length = 0.0;
            let mut before = None;
            all.push_path(turns.into_iter().map(|cell| {
                if let Some(from) = before.replace(cell) {
                    let (rows, cols) = way(grid, from, cell);
                    length += ((rows * rows + cols * cols) as f64).sqrt();
                }
                let (x_m, y_m) = cell_center_m(grid, cell_size_m, cell);
                Knot {
                    time_s: length * step_s,
                    x_m,
                    y_m,
                    heading_rad: None,
                }
            }))?;
        }
        Ok(all)
    }

    /// The same with controls of its agents, one after the other from time 0 on.
    pub fn with_controls(self, controls: ControlPlan) -> Result<Self, TrajectoryError> {
        let (own, paths) = (controls.agents(), self.agents());
        if own != paths {
            return Err(TrajectoryError::ControlCount {
                controls: own,
                paths,
            });
        }
        check_controls(&controls)?;
        Ok(Self {
            controls: (controls.segments() > 0).then_some(controls),
            ..self
        })
    }

    /// The controls, if there are any. An agent without a segment has knots alone.
    pub fn controls(&self) -> Option<&ControlPlan> {
        self.controls.as_ref()
    }

    /// Number of agents.
    pub fn agents(&self) -> usize {
        self.offsets.len() - 1
    }

    /// Number of knots of all agents.
    pub fn knot_count(&self) -> usize {
        self.time_s.len()
    }

    /// True if every knot has a heading; otherwise none has.
    pub fn has_headings(&self) -> bool {
        self.heading_rad.is_some()
    }

    /// Prefix sums of the numbers of knots: `agents + 1` entries.
    pub fn offsets(&self) -> &[usize] {
        &self.offsets
    }

    /// One agent's knots.
    pub fn knots(&self, agent: usize) -> Knots<'_> {
        let range = self.offsets[agent]..self.offsets[agent + 1];
        Knots {
            time_s: &self.time_s[range.clone()],
            x_m: &self.x_m[range.clone()],
            y_m: &self.y_m[range.clone()],
            heading_rad: self.heading_rad.as_ref().map(|all| &all[range]),
        }
    }

    /// Every agent's knots, in order.
    pub fn paths(&self) -> impl ExactSizeIterator<Item = Knots<'_>> {
        (0..self.agents()).map(|agent| self.knots(agent))
    }

    /// The time of the last knot of all, in seconds.
    pub fn horizon_s(&self) -> f64 {
        let last = self.paths().map(|knots| knots.end_s());
        last.fold(0.0, f64::max)
    }

    /// The largest speed of each agent.
    pub fn fastest(&self) -> impl ExactSizeIterator<Item = Fastest> {
        self.paths().map(|knots| knots.fastest())
    }

    /// Digest of the knots, without waits at the ends of paths: an agent stays where its
    /// path ends. Controls count too.
    pub fn digest(&self) -> Digest {
        let mut hasher = Hasher::new("fleetyard.trajectory-plan/1");
        hasher.u64(self.agents() as u64);
        hasher.u64(u64::from(self.has_headings()));
        for knots in self.paths() {
            let end = knots.arrival() + 1;
            hasher.u64(end as u64);
            for knot in knots.iter().take(end) {
                hasher.f64(knot.time_s);
                hasher.f64(knot.x_m);
                hasher.f64(knot.y_m);
                if let Some(heading) = knot.heading_rad {
                    hasher.f64(heading);
                }
            }
        }
        for (agent, controls) in self.controls.iter().flat_map(each_agent) {
            hasher.u64(controls.control_size(agent) as u64);
            hasher.u64(controls.of(agent).len() as u64);
            for segment in controls.of(agent) {
                hasher.f64(segment.duration_s);
                for number in segment.control {
                    hasher.f64(number + 0.0);
                }
            }
        }
        hasher.finish()
    }
}

/// Every agent, each with the controls of all.
fn each_agent(controls: &ControlPlan) -> impl Iterator<Item = (usize, &ControlPlan)> {
    (0..controls.agents()).map(move |agent| (agent, controls))
}

/// A knot with one zero: −0 and 0 mean the same, and would have different digests.
fn knot(time_s: f64, x_m: f64, y_m: f64, heading_rad: Option<f64>) -> Knot {
    Knot {
        time_s: time_s + 0.0,
        x_m: x_m + 0.0,
        y_m: y_m + 0.0,
        heading_rad: heading_rad.map(|heading| heading + 0.0),
    }
}

/// Checks a knot against the one `before` it; true if it adds something to the path.
fn follows(
    agent: usize,
    number: usize,
    before: Option<Knot>,
    next: Knot,
) -> Result<bool, TrajectoryError> {
    let values = [
        ("time", Some(next.time_s)),
        ("x", Some(next.x_m)),
        ("y", Some(next.y_m)),
        ("heading", next.heading_rad),
    ];
    for (what, value) in values {
        let Some(value) = value else { continue };
        if !value.is_finite() {
            return Err(TrajectoryError::NotFinite {
                agent,
                knot: number,
                what,
                value,
            });
        }
        if value.abs() > TrajectoryPlan::LARGEST {
            return Err(TrajectoryError::TooLarge {
                agent,
                knot: number,
                what,
                value,
                most: TrajectoryPlan::LARGEST,
            });
        }
    }
    let Some(before) = before else {
        return if next.time_s == 0.0 {
            Ok(true)
        } else {
            let time_s = next.time_s;
            Err(TrajectoryError::LateBegin { agent, time_s })
        };
    };
    if next.time_s < before.time_s {
        return Err(TrajectoryError::BackInTime {
            agent,
            knot: number,
            before_s: before.time_s,
            time_s: next.time_s,
        });
    }
    if next.time_s <= before.time_s && next != before {
        return Err(TrajectoryError::Gap {
            agent,
            knot: number,
            time_s: next.time_s,
            distance_m: distance_m(before, next),
            turn_rad: turn_rad(before, next),
        });
    }
    Ok(next != before)
}

/// Refuses a scale that is none, and a plan that leaves the map.
fn check_grid(
    plan: &GridPlan,
    grid: &Grid,
    cell_size_m: f64,
    step_s: f64,
) -> Result<(), TrajectoryError> {
    for (what, value) in [("cell size", cell_size_m), ("time of a step", step_s)] {
        if !(value > 0.0 && value.is_finite()) {
            return Err(TrajectoryError::Scale { what, value });
        }
    }
    for (agent, path) in plan.paths().enumerate() {
        if let Some(time) = path.iter().position(|cell| *cell >= grid.cell_count()) {
            return Err(TrajectoryError::OffMap { agent, time });
        }
    }
    Ok(())
}

/// Rows and columns from one cell of a map to another.
fn way(grid: &Grid, from: u32, to: u32) -> (i64, i64) {
    let (from, to) = (grid.row_col(from), grid.row_col(to));
    (
        i64::from(to.0) - i64::from(from.0),
        i64::from(to.1) - i64::from(from.1),
    )
}

fn distance_m(from: Knot, to: Knot) -> f64 {
    let (x, y) = (to.x_m - from.x_m, to.y_m - from.y_m);
    (x * x + y * y).sqrt()
}

fn turn_rad(from: Knot, to: Knot) -> f64 {
    match (from.heading_rad, to.heading_rad) {
        (Some(from), Some(to)) => (to - from).abs(),
        _ => 0.0,
    }
}

/// One agent's knots, in columns of equal length, at least one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Knots<'a> {
    /// Times in seconds, ascending from 0.
    pub time_s: &'a [f64],
    /// Positions in metres, to the right.
    pub x_m: &'a [f64],
    /// Positions in metres, upwards.
    pub y_m: &'a [f64],
    /// Headings in radians, unwrapped.
    pub heading_rad: Option<&'a [f64]>,
}

#[allow(
    clippy::len_without_is_empty,
    reason = "every path has a knot, so that none is empty"
)]
impl<'a> Knots<'a> {
    /// Number of knots, at least 1.
    pub fn len(&self) -> usize {
        self.time_s.len()
    }

    /// One knot, counted from 0. It must exist.
    pub fn get(&self, knot: usize) -> Knot {
        Knot {
            time_s: self.time_s[knot],
            x_m: self.x_m[knot],
            y_m: self.y_m[knot],
            heading_rad: self.heading_rad.map(|all| all[knot]),
        }
    }

    /// Every knot, in order.
    pub fn iter(self) -> impl ExactSizeIterator<Item = Knot> + 'a {
        (0..self.len()).map(move |knot| self.get(knot))
    }

    /// The time of the last knot, in seconds.
    pub fn end_s(&self) -> f64 {
        self.time_s[self.len() - 1]
    }

    /// The knot from which on the agent neither moves nor turns any more.
    pub fn arrival(&self) -> usize {
        let last = self.get(self.len() - 1);
        let rests = |knot: &usize| {
            let knot = self.get(*knot);
            (knot.x_m, knot.y_m, knot.heading_rad) == (last.x_m, last.y_m, last.heading_rad)
        };
        (0..self.len() - 1)
            .rev()
            .find(|knot| !rests(knot))
            .map_or(0, |moving| moving + 1)
    }

    /// Position of the agent at a time in seconds: between two knots as far as the time between
    /// theirs, and at the last one after it. Before time 0 it is at the first.
    pub fn at(&self, time_s: f64) -> Knot {
        let next = self.time_s.partition_point(|knot_s| *knot_s <= time_s);
        let from = self.get(next.saturating_sub(1));
        if next == 0 || next == self.len() {
            return Knot { time_s, ..from };
        }
        let to = self.get(next);
        let share = (time_s - from.time_s) / (to.time_s - from.time_s);
        let between = |from: f64, to: f64| from + (to - from) * share;
        Knot {
            time_s,
            x_m: between(from.x_m, to.x_m),
            y_m: between(from.y_m, to.y_m),
            heading_rad: from
                .heading_rad
                .zip(to.heading_rad)
                .map(|(from, to)| between(from, to)),
        }
    }

    /// Length of the path in metres.
    pub fn length_m(&self) -> f64 {
        let moves = 1..self.len();
        moves
            .map(|to| distance_m(self.get(to - 1), self.get(to)))
            .sum()
    }

    /// The largest speed and turn rate of the agent.
    pub fn fastest(&self) -> Fastest {
        let mut fastest = Fastest::default();
        for at in 1..self.len() {
            let (from, to) = (self.get(at - 1), self.get(at));
            let span_s = to.time_s - from.time_s;
            let (speed, turn) = (distance_m(from, to) / span_s, turn_rad(from, to) / span_s);
            if speed > fastest.speed_m_per_s {
                (fastest.speed_m_per_s, fastest.speed_knot) = (speed, at);
            }
            if turn > fastest.turn_rad_per_s {
                (fastest.turn_rad_per_s, fastest.turn_knot) = (turn, at);
            }
        }
        fastest
    }
}

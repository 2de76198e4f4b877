//! Plans: cells per step on a grid, visits on a roadmap, knots and controls in the plane.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::lists::Lists;
use crate::moves::OFF_MAP;

/// A plan in one of its forms, one for each representation.
#[derive(Debug, Clone, PartialEq)]
pub enum Plan {
    /// On a grid.
    Cells(GridPlan),
    /// On a roadmap.
    Visits(VisitPlan),
    /// In the plane.
    Trajectories(MotionPlan),
}

impl Plan {
    /// The plan, borrowed.
    pub fn as_ref(&self) -> PlanRef<'_> {
        match self {
            Self::Cells(plan) => PlanRef::Cells(plan),
            Self::Visits(plan) => PlanRef::Visits(plan),
            Self::Trajectories(plan) => PlanRef::Trajectories(plan.into()),
        }
    }

    /// Number of agents.
    pub fn agents(&self) -> usize {
        self.as_ref().agents()
    }

    /// The plan on a grid, if it is one.
    pub fn cells(&self) -> Option<&GridPlan> {
        match self {
            Self::Cells(plan) => Some(plan),
            Self::Visits(_) | Self::Trajectories(_) => None,
        }
    }

    /// The plan on a grid, if it is one.
    pub fn into_cells(self) -> Option<GridPlan> {
        match self {
            Self::Cells(plan) => Some(plan),
            Self::Visits(_) | Self::Trajectories(_) => None,
        }
    }
}

impl From<GridPlan> for Plan {
    fn from(plan: GridPlan) -> Self {
        Self::Cells(plan)
    }
}

impl From<VisitPlan> for Plan {
    fn from(plan: VisitPlan) -> Self {
        Self::Visits(plan)
    }
}

impl From<KnotPlan> for Plan {
    fn from(plan: KnotPlan) -> Self {
        Self::Trajectories(plan.into())
    }
}

impl From<MotionPlan> for Plan {
    fn from(plan: MotionPlan) -> Self {
        Self::Trajectories(plan)
    }
}

/// A plan that is lent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PlanRef<'a> {
    /// On a grid.
    Cells(&'a GridPlan),
    /// On a roadmap.
    Visits(&'a VisitPlan),
    /// In the plane.
    Trajectories(MotionRef<'a>),
}

impl PlanRef<'_> {
    /// Number of agents.
    pub fn agents(self) -> usize {
        match self {
            Self::Cells(plan) => plan.agents(),
            Self::Visits(plan) => plan.len(),
            Self::Trajectories(plan) => plan.knots.len(),
        }
    }

    /// The field of a message that has it.
    pub fn field(self) -> &'static str {
        match self {
            Self::Cells(_) => "paths",
            Self::Visits(_) => "visits",
            Self::Trajectories(_) => "trajectories",
        }
    }

    /// Bytes of memory that it takes.
    pub fn bytes(self) -> usize {
        let entry = match self {
            Self::Cells(_) => size_of::<u32>(),
            Self::Visits(_) => size_of::<Visit>(),
            Self::Trajectories(_) => size_of::<Knot>(),
        };
        let offsets = self.agents().saturating_add(1) * size_of::<u64>();
        let (entries, controls) = match self {
            Self::Trajectories(MotionRef { knots, controls }) => {
                (knots.items().len(), controls.map_or(0, ControlPlan::bytes))
            }
            Self::Cells(_) | Self::Visits(_) => (self.entries(), 0),
        };
        entries
            .saturating_mul(entry)
            .saturating_add(offsets)
            .saturating_add(controls)
    }

    /// Number of cells, of visits, or of knots and segments.
    pub fn entries(self) -> usize {
        match self {
            Self::Cells(plan) => plan.cells().len(),
            Self::Visits(plan) => plan.items().len(),
            Self::Trajectories(MotionRef { knots, controls }) => {
                knots.items().len() + controls.map_or(0, ControlPlan::segments)
            }
        }
    }

    /// A copy.
    pub fn to_plan(self) -> Plan {
        match self {
            Self::Cells(plan) => Plan::Cells(plan.clone()),
            Self::Visits(plan) => Plan::Visits(plan.clone()),
            Self::Trajectories(plan) => Plan::Trajectories(plan.to_plan()),
        }
    }
}

impl<'a> From<&'a Plan> for PlanRef<'a> {
    fn from(plan: &'a Plan) -> Self {
        plan.as_ref()
    }
}

impl<'a> From<&'a GridPlan> for PlanRef<'a> {
    fn from(plan: &'a GridPlan) -> Self {
        Self::Cells(plan)
    }
}

impl<'a> From<&'a VisitPlan> for PlanRef<'a> {
    fn from(plan: &'a VisitPlan) -> Self {
        Self::Visits(plan)
    }
}

impl<'a> From<&'a KnotPlan> for PlanRef<'a> {
    fn from(knots: &'a KnotPlan) -> Self {
        Self::Trajectories(MotionRef {
            knots,
            controls: None,
        })
    }
}

impl<'a> From<&'a MotionPlan> for PlanRef<'a> {
    fn from(plan: &'a MotionPlan) -> Self {
        Self::Trajectories(plan.into())
    }
}

/// The time that an agent spends at a vertex of a roadmap. It drives straight and evenly to the
/// next one. On the wire `[vertex, arrival_s, departure_s]`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(from = "(i64, f64, f64)", into = "(u32, f64, f64)")]
#[schemars(with = "(u32, f64, f64)")]
pub struct Visit {
    /// The vertex.
    pub vertex: u32,
    /// When the agent arrives; 0 at its start.
    pub arrival_s: f64,
    /// When it leaves; of the last visit, no earlier than the arrival.
    pub departure_s: f64,
}

impl From<(i64, f64, f64)> for Visit {
    fn from((vertex, arrival_s, departure_s): (i64, f64, f64)) -> Self {
        Self {
            // One that is on no roadmap is a fault of the plan, not of its text.
            vertex: u32::try_from(vertex).unwrap_or(OFF_MAP),
            arrival_s,
            departure_s,
        }
    }
}

impl From<Visit> for (u32, f64, f64) {
    fn from(visit: Visit) -> Self {
        (visit.vertex, visit.arrival_s, visit.departure_s)
    }
}

impl TryFrom<Vec<f64>> for Knot {
    type Error = String;

    fn try_from(numbers: Vec<f64>) -> Result<Self, String> {
        let (time_s, x_m, y_m, heading_rad) = match numbers[..] {
            [time_s, x_m, y_m] => (time_s, x_m, y_m, f64::NAN),
            [time_s, x_m, y_m, heading_rad] => (time_s, x_m, y_m, heading_rad),
            _ => return Err(format!("a knot of {} numbers", numbers.len())),
        };
        Ok(Self {
            time_s,
            x_m,
            y_m,
            heading_rad,
        })
    }
}

impl From<Knot> for Vec<f64> {
    fn from(knot: Knot) -> Self {
        let mut numbers = vec![knot.time_s, knot.x_m, knot.y_m];
        if !knot.heading_rad.is_nan() {
            numbers.push(knot.heading_rad);
        }
        numbers
    }
}

/// A plan on a roadmap: per agent its visits, in order. It stays at the last.
///
/// Nothing else is promised: the host's validator says whether a plan is valid.
pub type VisitPlan = Lists<Visit>;

/// A moment of a path in the plane, between which position and heading are linear in time. On the
/// wire `[time_s, x_m, y_m]` or `[time_s, x_m, y_m, heading_rad]`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "Vec<f64>", into = "Vec<f64>")]
#[schemars(with = "Vec<f64>")]
pub struct Knot {
    /// Time; 0 of the first knot.
    pub time_s: f64,
    /// Position to the right.
    pub x_m: f64,
    /// Position upwards.
    pub y_m: f64,
    /// Heading, counter-clockwise and unwrapped; NaN where the robot has none.
    pub heading_rad: f64,
}

/// Knots in the plane: per agent its own, in order. It rests at the last.
///
/// Nothing else is promised: the host's validator says whether a plan is valid.
pub type KnotPlan = Lists<Knot>;

/// A plan in the plane: knots, controls, or both.
///
/// An agent with controls alone moves as they lead it from its start; one with both by its knots,
/// to which its controls have to lead. In a plan with controls, one that has neither stays at its
/// start. On the wire an entry per agent: a list of knots, or an object with `knots` and `controls`.
///
/// Nothing else is promised: the host's validator says whether a plan is valid.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MotionPlan {
    knots: KnotPlan,
    controls: Option<ControlPlan>,
}

impl From<KnotPlan> for MotionPlan {
    fn from(knots: KnotPlan) -> Self {
        Self {
            knots,
            controls: None,
        }
    }
}

impl From<ControlPlan> for MotionPlan {
    fn from(controls: ControlPlan) -> Self {
        Self {
            knots: (0..controls.agents()).map(|_| []).collect(),
            controls: Some(controls),
        }
    }
}

impl MotionPlan {
    /// Knots and controls of the same agents; `None` if there are more of one than of the other.
    /// Controls of nobody are none, unless they say that somebody stays where it is.
    pub fn new(knots: KnotPlan, controls: ControlPlan) -> Option<Self> {
        let is_said = controls.segments() > 0 || knots.iter().any(<[_]>::is_empty);
        (knots.len() == controls.agents()).then_some(Self {
            knots,
            controls: is_said.then_some(controls),
        })
    }

    /// The knots of each agent, which may have none where it has controls.
    pub fn knots(&self) -> &KnotPlan {
        &self.knots
    }

    /// The controls of each agent, if there are any.
    pub fn controls(&self) -> Option<&ControlPlan> {
        self.controls.as_ref()
    }

    /// Number of agents.
    pub fn agents(&self) -> usize {
        self.knots.len()
    }
}

/// A plan in the plane that is lent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionRef<'a> {
    /// As [`MotionPlan::knots`].
    pub knots: &'a KnotPlan,
    /// As [`MotionPlan::controls`].
    pub controls: Option<&'a ControlPlan>,
}

impl MotionRef<'_> {
    /// A copy.
    pub fn to_plan(self) -> MotionPlan {
        MotionPlan {
            knots: self.knots.clone(),
            controls: self.controls.cloned(),
        }
    }
}

impl<'a> From<&'a MotionPlan> for MotionRef<'a> {
    fn from(plan: &'a MotionPlan) -> Self {
        Self {
            knots: &plan.knots,
            controls: plan.controls.as_ref(),
        }
    }
}

/// A control that is held for a time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Segment<'a> {
    /// The time, in seconds.
    pub duration_s: f64,
    /// The numbers of the control, as the robot's dynamics say.
    pub control: &'a [f64],
}

/// Controls of agents: per agent its segments, one after the other from time 0 on. After the last
/// it rests.
///
/// ```
/// use fleetyard_abi::ControlPlan;
///
/// let mut plan = ControlPlan::default();
/// // Speeds up, rolls, and slows down; the other one stays.
/// plan.push_agent([(0.25, [2.0, 0.0]), (1.5, [0.0, 0.0]), (0.25, [-2.0, 0.0])]).unwrap();
/// plan.push_agent::<[f64; 2]>([]).unwrap();
/// assert_eq!((plan.agents(), plan.segments()), (2, 3));
/// assert_eq!(plan.of(0).nth(2).unwrap().control, [-2.0, 0.0]);
/// // All controls of an agent have as many numbers.
/// assert!(plan.push_agent([(1.0, vec![0.5]), (1.0, vec![])]).is_err());
/// ```
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ControlPlan {
    durations_s: Lists<f64>,
    /// As many for each duration of an agent.
    numbers: Lists<f64>,
}

impl ControlPlan {
    /// The most numbers that a control may have.
    pub const MOST_NUMBERS: usize = 64;

    /// From durations, and the numbers of all controls of each agent one after the other. Says of
    /// which agent durations and numbers do not fit together.
    pub fn new(durations_s: Lists<f64>, numbers: Lists<f64>) -> Result<Self, String> {
        let (agents, others) = (durations_s.len(), numbers.len());
        if agents != others {
            return Err(format!(
                "durations of {agents} agents, but controls of {others}"
            ));
        }
        for (agent, (durations, own)) in durations_s.iter().zip(numbers.iter()).enumerate() {
            let (segments, own) = (durations.len(), own.len());
            let even = own.checked_rem(segments).map_or(own == 0, |rest| rest == 0);
            if !even {
                return Err(format!(
                    "agent {agent} has {own} numbers of controls for {segments} segments"
                ));
            }
            if own
                .checked_div(segments)
                .is_some_and(|size| size > Self::MOST_NUMBERS)
            {
                let most = Self::MOST_NUMBERS;
                return Err(format!(
                    "controls of agent {agent} have more than {most} numbers"
                ));
            }
        }
        Ok(Self {
            durations_s,
            numbers,
        })
    }

    /// Appends the segments of the next agent, each a duration in seconds and a control. Refuses
    /// controls of different lengths; the plan is then as it was.
    pub fn push_agent<C: AsRef<[f64]>>(
        &mut self,
        segments: impl IntoIterator<Item = (f64, C)>,
    ) -> Result<(), String> {
        for (duration_s, control) in segments {
            if let Err(reason) = self.push(duration_s, control.as_ref()) {
                self.durations_s.drop_open_list();
                self.numbers.drop_open_list();
                return Err(reason);
            }
        }
        self.end_agent();
        Ok(())
    }

    /// Appends a segment to those of the agent that is being written.
    pub(crate) fn push(&mut self, duration_s: f64, control: &[f64]) -> Result<(), String> {
        let agent = self.agents();
        let segment = self.durations_s.open_list().len();
        let own = self.numbers.open_list().len();
        let before = own.checked_div(segment).unwrap_or(control.len());
        let numbers = control.len();
        if numbers != before || numbers > Self::MOST_NUMBERS {
            return Err(format!(
                "segment {segment} of agent {agent} has a control of {numbers} numbers{}",
                if numbers == before {
                    format!(", more than {}", Self::MOST_NUMBERS)
                } else {
                    format!(", unlike the {before} before it")
                }
            ));
        }
        self.durations_s.push_item(duration_s);
        for number in control {
            self.numbers.push_item(*number);
        }
        Ok(())
    }

    /// Ends the agent that is being written.
    pub(crate) fn end_agent(&mut self) {
        self.durations_s.end_list();
        self.numbers.end_list();
    }

    /// Number of agents.
    pub fn agents(&self) -> usize {
        self.durations_s.len()
    }

    /// Number of segments of all agents.
    pub fn segments(&self) -> usize {
        self.durations_s.items().len()
    }

    /// The segments of an agent, which must exist.
    pub fn of(&self, agent: usize) -> impl ExactSizeIterator<Item = Segment<'_>> + Clone {
        let durations = &self.durations_s[agent];
        let numbers = &self.numbers[agent];
        let size = self.control_size(agent);
        durations
            .iter()
            .enumerate()
            .map(move |(at, duration_s)| Segment {
                duration_s: *duration_s,
                control: &numbers[at * size..(at + 1) * size],
            })
    }

    /// Number of numbers of each control of an agent; 0 if it has none.
    pub fn control_size(&self, agent: usize) -> usize {
        let numbers = self.numbers[agent].len();
        numbers
            .checked_div(self.durations_s[agent].len())
            .unwrap_or(0)
    }

    /// Durations of each agent's segments, in seconds.
    pub fn durations_s(&self) -> &Lists<f64> {
        &self.durations_s
    }

    /// The numbers of each agent's controls, one after the other.
    pub fn numbers(&self) -> &Lists<f64> {
        &self.numbers
    }

    /// Bytes of memory that it takes.
    fn bytes(&self) -> usize {
        let lists = [&self.durations_s, &self.numbers];
        let words = lists.map(|list| list.offsets().len() + list.items().len());
        words.iter().sum::<usize>().saturating_mul(size_of::<f64>())
    }
}

/// A plan on a grid: a path per agent, from time 0 to its last arrival. After its last cell
/// an agent stays there.
///
/// Nothing else is promised: a plan may be empty, leave the map or collide. The host's
/// validator says whether it is valid.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct GridPlan {
    paths: Lists<u32>,
}

impl From<Lists<u32>> for GridPlan {
    fn from(paths: Lists<u32>) -> Self {
        Self { paths }
    }
}

impl GridPlan {
    /// A plan without agents, ready for [`GridPlan::push_path`].
    pub fn with_capacity(agents: usize, cells: usize) -> Self {
        Lists::with_capacity(agents, cells).into()
    }

    /// Collects one path per agent.
    pub fn from_paths<P: AsRef<[u32]>>(paths: impl IntoIterator<Item = P>) -> Self {
        let mut plan = Self::default();
        for path in paths {
            plan.push_path(path.as_ref().iter().copied());
        }
        plan
    }

    /// Appends the path of the next agent.
    pub fn push_path(&mut self, path: impl IntoIterator<Item = u32>) {
        self.paths.push(path);
    }

    /// The cells, the last ones those of the path that is being written.
    pub(crate) fn cells_mut(&mut self) -> &mut Vec<u32> {
        self.paths.items_mut()
    }

    /// Ends the path that is being written.
    pub(crate) fn end_path(&mut self) {
        self.paths.end_list();
    }

    /// Number of agents.
    pub fn agents(&self) -> usize {
        self.paths.len()
    }

    /// The cells of one agent's path. The agent must exist.
    pub fn path(&self, agent: usize) -> &[u32] {
        &self.paths[agent]
    }

    /// Every agent's path, in order.
    pub fn paths(&self) -> impl ExactSizeIterator<Item = &[u32]> {
        self.paths.iter()
    }

    /// The paths as they are stored.
    pub fn lists(&self) -> &Lists<u32> {
        &self.paths
    }

    /// All paths' cells, one after the other.
    pub fn cells(&self) -> &[u32] {
        self.paths.items()
    }

    /// The cell of an agent at a time: its last cell once its path has ended, and [`OFF_MAP`] if
    /// its path is empty.
    pub fn at(&self, agent: usize, time: usize) -> u32 {
        let path = self.path(agent);
        path.get(time).or(path.last()).copied().unwrap_or(OFF_MAP)
    }

    /// The last time at which any path still has a cell.
    pub fn horizon(&self) -> usize {
        let last = self.paths().map(|path| path.len().saturating_sub(1));
        last.max().unwrap_or(0)
    }

    /// The time at which an agent arrives at the last cell of its path to stay there.
    pub fn arrival(&self, agent: usize) -> usize {
        arrival(self.path(agent))
    }

    /// Sum over the agents of the time of last arrival.
    pub fn sum_of_costs(&self) -> u64 {
        self.paths().map(|path| arrival(path) as u64).sum()
    }

    /// The same plan with every path cut after its last move, which is what a
    /// plan means: an agent stays where its path ends.
    #[must_use]
    pub fn trimmed(&self) -> Self {
        let mut plan = Self::with_capacity(self.agents(), self.cells().len());
        for path in self.paths() {
            plan.push_path(path.iter().copied().take(arrival(path) + 1));
        }
        plan
    }
}

/// The time at which an agent arrives at the last cell of its path to stay there.
fn arrival(path: &[u32]) -> usize {
    let before = path.iter().rposition(|cell| Some(cell) != path.last());
    before.map_or(0, |time| time + 1)
}

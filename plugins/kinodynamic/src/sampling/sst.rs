//! Stable sparse trees: random controls, of which the fastest to each neighbourhood are kept.
//!
//! Y. Li, Z. Littlefield, K. E. Bekris, "Asymptotically optimal sampling-based kinodynamic planning", IJRR 35(5), 2016: SST
//! (algorithms 5 to 7), and SST\*, which lowers both radii again and again (algorithm 8).
//!
//! | paper | here |
//! | --- | --- |
//! | `V_active`, `V_inactive` | nodes that are in `active`, and others |
//! | `Best_First_Selection_SST` | `Sparse::select` |
//! | `MonteCarlo-Prop` | [`Drive::control`] |
//! | `Is_Node_Locally_the_Best_SST` | `Sparse::witness` |
//! | `Prune_Dominated_Nodes_SST` | `Sparse::retire` |

use std::collections::BTreeSet;

use fleetyard_plugin_spacetime::random::Random;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::drive::Drive;
use super::near::{Found, Near};
use crate::course::{Course, Segment};
use crate::plugin::{CLEARANCE_M, Line};
use crate::robot::State;

/// Options of `sst`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Options {
    /// Of nodes so near to a sample the fastest is driven on from (δ_BN), in metres; null: 4 % of
    /// the world's longer side.
    #[schemars(range(min = 0.000_001))]
    pub delta_bn_m: Option<f64>,
    /// Of nodes so near to a witness the fastest is kept (δ_s), in metres; null: half of δ_BN.
    #[schemars(range(min = 0.000_001))]
    pub delta_s_m: Option<f64>,
    /// Longest time that a control is held (T_prop), in seconds; null: what a tenth of the world's
    /// longer side takes at full speed, and speeding up.
    #[schemars(range(min = 0.000_001))]
    pub t_prop_s: Option<f64>,
    /// Factor of both radii in each round of SST* (ξ); 1 is SST.
    #[schemars(range(min = 0.1, max = 1.0))]
    pub xi: f64,
    /// Controls in the first round (N); later rounds have more of them.
    #[schemars(range(min = 1))]
    pub n: u64,
    /// Part of the samples that are the goal.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub goal_bias: f64,
    /// From new nodes the robot is stopped and led to its goal exactly, where nothing is in the way;
    /// the paper has no such step.
    pub connect: bool,
    /// Nodes that cannot lead to a faster plan are left out; the paper keeps them.
    pub prune: bool,
    /// Distance that the robot keeps from all others beyond touching, in metres, where there is room
    /// for it.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub clearance_m: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            delta_bn_m: None,
            delta_s_m: None,
            t_prop_s: None,
            xi: 0.8,
            n: 100_000,
            goal_bias: 0.05,
            connect: true,
            prune: true,
            clearance_m: CLEARANCE_M,
        }
    }
}

/// No node.
const NONE: u32 = u32::MAX;

/// Bytes of a node and its witness, with their entries among neighbours.
pub const NODE_BYTES: u64 = 320;

/// Both radii are shares of the world's longer side, where they are not given.
const SHARE: f64 = 0.04;

/// A state that controls lead to.
#[derive(Debug, Clone, Copy)]
struct Node {
    state: State,
    /// Seconds from the start.
    time: f64,
    /// The control from its parent.
    segment: Segment,
    parent: u32,
    children: u32,
    witness: u32,
    is_active: bool,
}

/// A sparse tree of controls.
#[derive(Debug)]
pub struct Sparse<'a> {
    drive: &'a Drive<'a>,
    options: &'a Options,
    delta_bn: f64,
    delta_s: f64,
    longest: f64,
    nodes: Vec<Node>,
    /// Numbers of nodes that are no more.
    spare: Vec<u32>,
    active: Near<6>,
    witnesses: Near<6>,
    /// The node of each witness.
    kept: Vec<u32>,
    /// The fastest course to the goal.
    best: Option<Course>,
    /// Its seconds; infinite if there is none.
    pub best_seconds: f64,
    random: Random,
    /// Controls that were tried.
    pub tried: u64,
    /// Nodes that were added.
    pub added: u64,
    round: i32,
    /// The round ends when so many controls were tried.
    round_ends: f64,
    found: Vec<Found>,
}

impl<'a> Sparse<'a> {
    /// A tree of its root alone.
    pub fn new(drive: &'a Drive<'a>, options: &'a Options, seed: u64) -> Self {
        let bounds = drive.bounds();
        let side = (bounds.max - bounds.min).max();
        let delta_bn = options.delta_bn_m.unwrap_or(side * SHARE);
        let longest = options
            .t_prop_s
            .unwrap_or_else(|| longest(drive, side / 10.0));
        let empty = || Near::new(bounds, drive.round());
        let root = Node {
            state: drive.member.start,
            time: 0.0,
            segment: Segment {
                control: [0.0; 3],
                seconds: 0.0,
            },
            parent: NONE,
            children: 0,
            witness: 0,
            is_active: true,
        };
        let mut tree = Self {
            drive,
            options,
            delta_bn,
            delta_s: options.delta_s_m.unwrap_or(delta_bn / 2.0),
            longest,
            nodes: vec![root],
            spare: Vec::new(),
            active: empty(),
            witnesses: empty(),
            kept: vec![0],
            best: None,
            best_seconds: f64::INFINITY,
            random: Random::new(seed, 0),
            tried: 0,
            added: 1,
            round: 0,
            round_ends: options.n as f64,
            found: Vec::new(),
        };
        let point = drive.point(&root.state);
        tree.active.insert(point, 0);
        tree.witnesses.insert(point, 0);
        tree.finish(0);
        tree
    }

    /// Nodes that take memory.
    pub fn nodes(&self) -> usize {
        self.nodes.len().max(self.kept.len())
    }

    /// Lines from nodes to their parents.
    pub fn lines(&self) -> impl Iterator<Item = Line> {
        let gone: BTreeSet<u32> = self.spare.iter().copied().collect();
        let nodes = (0..).zip(&self.nodes);
        nodes.filter_map(move |(number, node)| {
            let parent = self.nodes.get(node.parent as usize)?;
            let line = [parent.state.at.into(), node.state.at.into()];
            (!gone.contains(&number)).then_some(line)
        })
    }

    /// The fastest course to the goal that is known.
    pub fn course(&self) -> Option<&Course> {
        self.best.as_ref()
    }

    /// Drives on from a node by any control. True if a faster course to the goal was found.
    pub fn grow(&mut self) -> bool {
        self.tried += 1;
        if self.tried as f64 > self.round_ends && self.options.xi < 1.0 {
            self.refine();
        }
        let Some(from) = self.select() else {
            return false;
        };
        let Node { state, time, .. } = self.nodes[from as usize];
        let segment = self.drive.control(&state, self.longest, &mut self.random);
        let end = time + segment.seconds;
        let reached = self
            .drive
            .member
            .robot
            .after(&state, &segment.control, segment.seconds);
        if segment.seconds <= 0.0 || !self.may_lead(&reached, end) {
            return false;
        }
        // Whoever is slower than the node that is kept there is not looked at.
        let point = self.drive.point(&reached);
        let witness = self.witness(&point);
        if let Some(kept) = witness.map(|witness| self.kept[witness as usize])
            && kept != NONE
            && self.nodes[kept as usize].time <= end
        {
            return false;
        }
        if !self.drive.is_clear(&state, &[segment], time) {
            return false;
        }
        let node = Node {
            state: reached,
            time: end,
            segment,
            parent: from,
            children: 0,
            witness: witness.unwrap_or(self.kept.len() as u32),
            is_active: true,
        };
        self.nodes[from as usize].children += 1;
        let number = if let Some(number) = self.spare.pop() {
            self.nodes[number as usize] = node;
            number
        } else {
            self.nodes.push(node);
            self.nodes.len() as u32 - 1
        };
        self.added += 1;
        self.active.insert(point, number);
        if let Some(witness) = witness {
            let before = std::mem::replace(&mut self.kept[witness as usize], number);
            if before != NONE {
                self.retire(before);
            }
        } else {
            self.witnesses.insert(point, self.kept.len() as u32);
            self.kept.push(number);
        }
        self.finish(number)
    }

    /// A node to drive on from: of those near a sample the fastest, or else the nearest.
    fn select(&mut self) -> Option<u32> {
        let sample = if self.random.share() < self.options.goal_bias {
            self.drive.goal(&mut self.random)
        } else {
            self.drive.anywhere(&mut self.random)
        };
        let point = self.drive.point(&sample);
        self.active.within(&point, self.delta_bn, &mut self.found);
        if self.found.is_empty() {
            self.active.nearest(&point, 1, &mut self.found);
        }
        let time = |found: &Found| self.nodes[found.number as usize].time;
        let fastest = self.found.iter().min_by(|one, other| {
            let times = time(one).total_cmp(&time(other));
            times.then(one.number.cmp(&other.number))
        });
        let number = fastest?.number;
        let Node { state, time, .. } = self.nodes[number as usize];
        if self.may_lead(&state, time) {
            return Some(number);
        }
        self.retire(number);
        None
    }

    /// The witness that speaks for a point; none where there is none near enough.
    fn witness(&mut self, point: &[f64; 6]) -> Option<u32> {
        self.witnesses.nearest(point, 1, &mut self.found);
        let nearest = self.found.first()?;
        (nearest.square <= self.delta_s * self.delta_s).then_some(nearest.number)
    }

    /// A node is no longer driven on from, and is no more where it has no children.
    fn retire(&mut self, number: u32) {
        let node = &mut self.nodes[number as usize];
        if node.is_active {
            node.is_active = false;
            let kept = &mut self.kept[node.witness as usize];
            if *kept == number {
                *kept = NONE;
            }
            let point = self.drive.point(&node.state);
            self.active.remove(&point, number);
        }
        let mut leaf = number;
        loop {
            let Node {
                parent,
                children,
                is_active,
                ..
            } = self.nodes[leaf as usize];
            if children > 0 || is_active || parent == NONE {
                return;
            }
            self.spare.push(leaf);
            self.nodes[parent as usize].children -= 1;
            leaf = parent;
        }
    }

    /// A plan over a state at a time may be faster than the one that is known.
    fn may_lead(&self, state: &State, time: f64) -> bool {
        !self.options.prune
            || self.best_seconds.is_infinite()
            || time + self.drive.bound(state) < self.best_seconds
    }

    /// Remembers the course over a node if it is the fastest to the goal.
    fn finish(&mut self, number: u32) -> bool {
        let Node { state, time, .. } = self.nodes[number as usize];
        let mut faster = false;
        if time < self.best_seconds
            && self.drive.member.goal.is_reached(&state)
            && self.drive.may_rest(&state, time)
        {
            self.remember(number, Vec::new());
            faster = true;
        }
        if !self.options.connect || time + self.drive.bound(&state) >= self.best_seconds {
            return faster;
        }
        let aim = self.drive.goal(&mut self.random);
        let Some(segments) = self.drive.connection(&state, &aim) else {
            return faster;
        };
        let seconds: f64 = segments.iter().map(|segment| segment.seconds).sum();
        if time + seconds < self.best_seconds && self.drive.is_clear(&state, &segments, time) {
            let course = Course {
                start: state,
                segments,
            };
            let rest = course.end(&self.drive.member.robot);
            if self.drive.may_rest(&rest, time + seconds) {
                self.remember(number, course.segments);
                return true;
            }
        }
        faster
    }

    fn remember(&mut self, number: u32, more: Vec<Segment>) {
        let mut segments: Vec<Segment> = more.into_iter().rev().collect();
        let mut at = number;
        while self.nodes[at as usize].parent != NONE {
            segments.push(self.nodes[at as usize].segment);
            at = self.nodes[at as usize].parent;
        }
        segments.reverse();
        let course = Course {
            start: self.drive.member.start,
            segments,
        };
        self.best_seconds = course.seconds();
        self.best = Some(course);
    }

    /// Lowers the radii. Nodes that are kept are the witnesses of the next round, which begins with them.
    fn refine(&mut self) {
        self.delta_s *= self.options.xi;
        self.delta_bn *= self.options.xi;
        self.round += 1;
        // Numbers of a state and of a control.
        let robot = &self.drive.member.robot;
        let rates = robot.axes().into_iter().filter(|there| *there).count();
        let state = 2 + usize::from(robot.has_heading) + if robot.is_second { rates } else { 0 };
        let power = f64::from(-self.round) * (state + rates + 1) as f64;
        let round = f64::from(self.round);
        let more = (1.0 + libm::log(round)) * libm::pow(self.options.xi, power);
        self.round_ends += more * self.options.n as f64;
        self.witnesses = Near::new(self.drive.bounds(), self.drive.round());
        self.kept.retain(|kept| *kept != NONE);
        for (witness, number) in self.kept.iter().enumerate() {
            let node = &mut self.nodes[*number as usize];
            node.witness = witness as u32;
            let point = self.drive.point(&node.state);
            self.witnesses.insert(point, witness as u32);
        }
    }
}

/// Seconds that a robot takes for a distance, at full speed, and to speed up.
pub fn longest(drive: &Drive<'_>, metres: f64) -> f64 {
    let robot = &drive.member.robot;
    let top = |limits: &[[f64; 2]; 3]| {
        let both = limits[..2].iter().flatten();
        both.fold(0.0, |top: f64, limit| top.max(limit.abs()))
    };
    let speeding = if robot.is_second {
        top(&robot.rates) / top(&robot.changes)
    } else {
        0.0
    };
    let seconds = metres / top(&robot.rates) + speeding;
    if seconds.is_finite() { seconds } else { 1.0 }
}

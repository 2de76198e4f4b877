//! Large neighbourhood search in continuous time: paths of a few discs are planned anew at a time.
//!
//! [`repair`] is MAPF-LNS2 (J. Li, Z. Chen, D. Harabor, P. J. Stuckey, S. Koenig, "MAPF-LNS2: fast repairing for multi-agent path
//! finding via large neighborhood search", AAAI 2022): from paths that meet as few others as they can to paths that meet nobody.
//! [`improve`] is MAPF-LNS (J. Li, Z. Chen, D. Harabor, P. J. Stuckey, S. Koenig, "Anytime multi-agent path finding via large
//! neighborhood search", IJCAI 2021): from such paths to shorter ones.

pub mod fewest;
pub mod improve;
mod members;
pub mod repair;
mod weights;

use fleetyard_plugin_spacetime::random::Random;

use crate::closeness::Closeness;
use crate::crowd::Crowd;
use crate::plan::{Path, cost};
use crate::sipp::{Search, Task};
use fewest::Fewest;
use members::Members;

/// Limits of a run.
pub struct Control<'a> {
    /// True once the budget is spent; asked often.
    pub stop: &'a mut dyn FnMut() -> bool,
    /// Neighbourhoods, and searches for the path of one disc, that are left to try.
    pub nodes: u64,
    /// About how many bytes the paths of a team may take.
    pub memory: u64,
}

impl Control<'_> {
    /// Takes one from what is left. True when nothing is, or it is time to stop.
    pub(crate) fn spend(&mut self) -> bool {
        if self.nodes == 0 {
            return true;
        }
        self.nodes -= 1;
        (self.stop)()
    }
}

/// A team whose paths are repaired, and then improved.
pub struct Team<'a> {
    closeness: &'a Closeness,
    tasks: &'a [Task<'a>],
    /// Seconds that each disc would need alone.
    alone: Vec<f64>,
    crowd: Crowd<'a>,
    search: Search,
    fewest: Fewest,
    random: Random,
    members: Members,
    /// Discs that are planned anew at a time.
    size: usize,
}

impl<'a> Team<'a> {
    /// Nobody has a path yet. At most `size` discs are planned anew at a time. Tasks are whole paths to one goal each, to which a
    /// way leads.
    pub fn new(
        closeness: &'a Closeness,
        tasks: &'a [Task<'a>],
        (size, seed): (usize, u64),
    ) -> Self {
        let roadmap = closeness.roadmap();
        Self {
            closeness,
            tasks,
            alone: tasks.iter().map(|task| task.alone(roadmap)).collect(),
            crowd: Crowd::new(closeness, tasks.len(), f64::INFINITY),
            search: Search::new(roadmap),
            fewest: Fewest::new(roadmap),
            random: Random::new(seed, 0),
            members: Members::new(tasks.len(), roadmap.vertices()),
            size: size.clamp(1, tasks.len().max(1)),
        }
    }

    /// Gives everybody a path in place of the one it has.
    pub fn adopt(&mut self, paths: Vec<Path>) {
        let all: Vec<u32> = (0..self.tasks.len() as u32).collect();
        self.take_out(&all);
        for (disc, path) in paths.into_iter().enumerate() {
            self.crowd.exchange(disc as u32, path);
        }
    }

    /// The paths, empty for a disc that has none.
    pub fn paths(&self) -> &[Path] {
        self.crowd.paths()
    }

    /// Pairs of discs that meet.
    pub fn pairs(&self) -> usize {
        self.crowd.pairs()
    }

    /// Sum of the times at which paths arrive.
    pub fn cost(&self) -> f64 {
        self.crowd.cost()
    }

    /// Sum of the times at which everybody would arrive alone.
    pub fn lower_bound(&self) -> f64 {
        self.alone.iter().sum()
    }

    /// States that searches expanded.
    pub fn expanded(&self) -> u64 {
        self.search.expanded + self.fewest.expanded
    }

    /// About how many bytes it holds.
    pub fn bytes(&self) -> u64 {
        self.crowd.bytes()
    }

    /// Seconds by which a disc arrives later than it would alone.
    fn delay(&self, disc: u32) -> f64 {
        (cost(self.crowd.path(disc)) - self.alone[disc as usize]).max(0.0)
    }

    /// Takes the paths of members out.
    fn take_out(&mut self, members: &[u32]) -> Vec<(u32, Path)> {
        let crowd = &mut self.crowd;
        let each = members.iter();
        each.map(|disc| (*disc, crowd.exchange(*disc, Path::new())))
            .collect()
    }

    /// Gives members their old paths back.
    fn restore(&mut self, old: Vec<(u32, Path)>) {
        for (disc, path) in old {
            self.crowd.exchange(disc, path);
        }
    }
}

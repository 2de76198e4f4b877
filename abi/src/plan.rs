//! Plans on grids: per agent, the cells in which it is at times 0, 1, 2, …

use crate::lists::Lists;
use crate::moves::OFF_MAP;

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

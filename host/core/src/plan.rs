//! Grid plans: per agent, the cells it occupies at times 0, 1, 2, …

use crate::{Digest, Hasher, OFF_MAP};

/// A plan on a grid, stored flat.
///
/// Path `i` is `cells[offsets[i]..offsets[i + 1]]`, from time 0 to the agent's
/// last arrival; after its end an agent stays where it is. Nothing else is
/// promised: a plan may be empty, leave the map or collide. `fleetyard-check`
/// says whether it is valid.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GridPlan {
    offsets: Vec<usize>,
    cells: Vec<u32>,
}

impl Default for GridPlan {
    fn default() -> Self {
        Self {
            offsets: vec![0],
            cells: Vec::new(),
        }
    }
}

impl GridPlan {
    /// A plan without agents, ready for [`GridPlan::push_path`].
    pub fn with_capacity(agents: usize, cells: usize) -> Self {
        let mut offsets = Vec::with_capacity(agents + 1);
        offsets.push(0);
        Self {
            offsets,
            cells: Vec::with_capacity(cells),
        }
    }

    /// From flat arrays; `None` when the offsets do not begin with 0, decrease, or do not
    /// end with the number of cells.
    pub fn from_parts(offsets: Vec<usize>, cells: Vec<u32>) -> Option<Self> {
        let fit = offsets.first() == Some(&0)
            && offsets.last() == Some(&cells.len())
            && offsets.is_sorted();
        fit.then_some(Self { offsets, cells })
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
        self.cells.extend(path);
        self.offsets.push(self.cells.len());
    }

    /// Number of agents.
    pub fn agents(&self) -> usize {
        self.offsets.len() - 1
    }

    /// The cells of one agent's path.
    pub fn path(&self, agent: usize) -> &[u32] {
        &self.cells[self.offsets[agent]..self.offsets[agent + 1]]
    }

    /// Every agent's path, in order.
    pub fn paths(&self) -> impl ExactSizeIterator<Item = &[u32]> {
        self.offsets
            .windows(2)
            .map(|range| &self.cells[range[0]..range[1]])
    }

    /// The cell of an agent at a time: its last cell once its path has ended, and [`OFF_MAP`] if
    /// its path is empty.
    pub fn at(&self, agent: usize, time: usize) -> u32 {
        let path = self.path(agent);
        path.get(time).or(path.last()).copied().unwrap_or(OFF_MAP)
    }

    /// The last time at which any path still has a cell.
    pub fn horizon(&self) -> usize {
        self.paths()
            .map(|path| path.len().saturating_sub(1))
            .max()
            .unwrap_or(0)
    }

    /// Prefix sums of path lengths: `agents + 1` entries.
    pub fn offsets(&self) -> &[usize] {
        &self.offsets
    }

    /// All paths' cells, one after the other.
    pub fn cells(&self) -> &[u32] {
        &self.cells
    }

    /// The same plan with every path cut after its last move, which is what a
    /// plan means: an agent stays where its path ends.
    #[must_use]
    pub fn trimmed(&self) -> Self {
        let mut plan = Self::with_capacity(self.agents(), self.cells.len());
        for path in self.paths() {
            let end = match path.last() {
                Some(last) => path
                    .iter()
                    .rposition(|cell| cell != last)
                    .map_or(1, |at| at + 2),
                None => 0,
            };
            plan.push_path(path[..end].iter().copied());
        }
        plan
    }

    /// Digest of the trimmed paths.
    pub fn digest(&self) -> Digest {
        let plan = self.trimmed();
        let mut hasher = Hasher::new("fleetyard.grid-plan/1");
        hasher.u64(plan.agents() as u64);
        for path in plan.paths() {
            hasher.u32s(path);
        }
        hasher.finish()
    }
}

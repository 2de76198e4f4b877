//! Tasks, operators, and the tasks of the repository.

mod grids;
mod roadmaps;
mod tasks;
mod worlds;

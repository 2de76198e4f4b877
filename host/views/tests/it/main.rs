//! Tasks, operators, and the tasks of the repository.

mod grids;
mod tasks;
mod worlds;

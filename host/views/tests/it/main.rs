//! Tasks, operators, and the tasks of the repository.

mod tasks;
mod worlds;

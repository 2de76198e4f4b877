//! Tasks, operators, and the tasks of the repository.

mod grids;
mod judged;
mod roadmaps;
mod tasks;
mod view_files;
mod worlds;

//! Tasks, operators, and the tasks of the repository.

mod grids;
mod judged;
mod overlays;
mod roadmaps;
mod swept;
mod tasks;
mod view_files;
mod worlds;

//! Tasks, operators, and the tasks of the repository.

mod controls;
mod given;
mod grids;
mod judged;
mod lowered;
mod overlays;
mod roadmaps;
mod sampled;
mod swept;
mod tasks;
mod view_files;
mod worlds;

//! Files and the model, in and out.

mod annotations;
mod bad_input;
mod formats;
mod plane_files;
mod solver_files;
mod trajectories;

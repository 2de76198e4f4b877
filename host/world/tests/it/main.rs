//! Generators, mazes and the maps of the repository.

mod controls;
mod examples;
mod generators;
mod mazes;

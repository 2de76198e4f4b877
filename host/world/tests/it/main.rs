//! Generators, mazes and the maps of the repository.

mod examples;
mod generators;
mod mazes;

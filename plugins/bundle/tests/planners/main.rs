//! Rules for all standard planners: they end when they are told to, and their work is what it was.

mod limits;
mod questions;
mod work;

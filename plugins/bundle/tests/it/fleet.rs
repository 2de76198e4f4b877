//! Invocation policies, instance generators, fail policies, and the searches that they share.

mod common;
mod generate;
mod ground;
mod invocation;
mod recover;

//! Instance generators and fail policies.

mod common;
mod generate;
mod recover;

//! The validator against rules written down twice.

mod continuous;
mod controls;
mod oracle;
mod paths;
mod roadmaps;
mod rules;
mod trailers;

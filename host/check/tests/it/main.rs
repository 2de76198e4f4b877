//! The validator against rules written down twice.

mod oracle;
mod paths;
mod rules;

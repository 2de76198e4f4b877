//! The contract as a plugin and as a host meet it: header, schema, wire and paths.

mod figures;
mod header;
mod lists;
mod paths;
mod schema;
mod serve;

//! The contract as a plugin and as a host meet it: header, schema, wire and paths.

mod figures;
mod header;
mod kept;
mod lists;
mod paths;
mod refusals;
mod round_trips;
mod schema;
mod serve;

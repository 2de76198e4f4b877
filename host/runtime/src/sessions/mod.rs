//! Sessions: one plugin, from its start to its end, in one of four attachments.
//!
//! [`runtime`] starts the plugin's file and opens a [`session`], which calls the plugin
//! through the trait of [`attachment`]: [`in_process`] for a shared library that is called
//! directly, [`out_of_process`] for everything that runs under a supervisor. The latter
//! speaks over [`client`], which reads [`incoming`] lines as [`message`]s within [`bounds`].
//! At the other end, [`worker`] processes serve a shared library ([`library`]) or a
//! command-line solver ([`adapter`]). [`plan_run`] is a call for a plan and its outcome,
//! [`collector`] keeps its plans, [`annotated`] what it wants to show and [`log`] the plugin's log,
//! whichever way they come;
//! [`identity`] takes what a plugin says of itself, [`limits`] are those of all calls, and [`convert`] is between the domain model and the
//! contract's.

pub mod adapter;
pub(crate) mod annotated;
pub(crate) mod attachment;
pub mod bounds;
pub(crate) mod client;
pub(crate) mod collector;
pub(crate) mod convert;
mod identity;
mod in_process;
pub(crate) mod incoming;
pub(crate) mod library;
pub(crate) mod limits;
pub(crate) mod log;
pub mod message;
mod out_of_process;
pub(crate) mod plan_run;
#[cfg(test)]
mod played;
pub(crate) mod runtime;
pub(crate) mod session;
pub(crate) mod worker;

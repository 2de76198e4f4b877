//! Sessions: one plugin, from its start to its end, in one of four attachments.
//!
//! [`session`] opens plugins and calls them. A plugin in a process of its own is spoken to
//! by [`client`], which reads [`incoming`] lines as [`message`]s within [`bounds`]; a shared
//! library is called through [`library`], in the host's process or in a worker; [`adapter`]
//! is the worker of a command-line solver. [`collector`] keeps the plans of a call and
//! [`log`] the plugin's log, whichever way they come, and [`convert`] is between the domain
//! model and the contract's.

pub mod adapter;
pub mod bounds;
pub(crate) mod client;
pub(crate) mod collector;
pub(crate) mod convert;
pub(crate) mod incoming;
pub(crate) mod library;
pub(crate) mod log;
pub mod message;
pub(crate) mod session;

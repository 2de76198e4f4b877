//! The needs of the client of a plugin's process and of the clock.
//!
//! [`Process`](crate::confinement::process::Process) is the real one. A test plays plugin, supervisor
//! and clock by turns that a seed decides, thousands of times.

use std::io;
use std::time::Duration;

use crate::confinement::control::Report;
use crate::confinement::sandbox::SandboxReport;
use crate::usage::{CallLimits, CallUsage, Limit};

/// One of a plugin's two outputs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Output {
    /// Messages.
    Stdout,
    /// Words for people.
    Stderr,
}

/// The pipes that are waited for besides the supervisor.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Interest {
    /// The host has something to write.
    pub(crate) stdin: bool,
    /// The output is open.
    pub(crate) stdout: bool,
    pub(crate) stderr: bool,
}

/// A plugin's process under its supervisor, and a clock.
pub(crate) trait Transport {
    /// The monotonic clock.
    fn now_ns(&self) -> u64;

    /// A number that the plugin cannot guess.
    fn secret(&mut self) -> u64;

    /// Waits until something of interest can be read or written, the supervisor has said
    /// something, which is then taken in, the call is interrupted, the time is over, or for no
    /// reason.
    fn wait(&mut self, interest: Interest, most_ns: u64);

    /// True once somebody has told the host to end.
    fn interrupted(&self) -> bool;

    /// Writes what can be written now to the plugin's input.
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize>;

    /// Closes the plugin's input: there is nothing more to be written.
    fn close_stdin(&mut self);

    /// Reads what has come; 0 bytes once the output is closed.
    fn read(&mut self, output: Output, buffer: &mut [u8]) -> io::Result<usize>;

    /// A call begins: its limits count from here.
    fn begin(&mut self, limits: CallLimits, grace: Duration);

    /// A call has ended: what it used, unless the process ended by itself with it.
    fn finish(&mut self) -> Option<CallUsage>;

    /// The limit that is exceeded, once the supervisor has said so.
    fn over(&self) -> Option<Limit>;

    /// The sandbox that the plugin was started in, once the supervisor has said so.
    fn sandbox(&self) -> Option<&SandboxReport>;

    /// The host can go on no more: everybody is ended, and for this reason.
    fn give_up(&mut self, reason: String);

    /// The reason that kept the supervisor from its work, if something did.
    fn disturbed(&self) -> Option<String>;

    /// True if nothing that the plugin can do was the cause of that.
    fn is_disturbed_from_outside(&self) -> bool {
        false
    }

    /// Waits up to `patience` for the plugin to end by itself, then ends its whole tree.
    /// Nothing of it is left when this returns.
    fn end(&mut self, patience: Duration) -> Report;
}

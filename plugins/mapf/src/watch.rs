//! The clock of a call, as planners look at it.

/// A clock, and somebody who looks at it.
pub trait Watch {
    /// True when the call has to end.
    fn stop(&mut self) -> bool;
    /// A step begins, the first of so many that are left. False if the call would have to end before the
    /// step is [ready](Self::ready), should that take as long as in the step before.
    fn begin(&mut self, left: u32) -> bool;
    /// The part of a step is done that cannot be interrupted.
    fn ready(&mut self);
    /// True when the step has had its share of the time.
    fn pause(&mut self) -> bool;
}

/// Somebody who knows just whether the call has to end.
impl<F: FnMut() -> bool> Watch for F {
    fn stop(&mut self) -> bool {
        self()
    }

    fn begin(&mut self, _: u32) -> bool {
        true
    }

    fn ready(&mut self) {}

    fn pause(&mut self) -> bool {
        self()
    }
}

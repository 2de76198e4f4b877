//! Memory that a call leaves behind, to be freed when it has been answered.
//!
//! The tree of a search takes as long to take down as a good part of it took to build. A planner
//! that frees it before it returns answers too late. So its large parts that live as long as a call are
//! [`Leftover`]s: where they would be freed during the call, they are put by, and the host lets the
//! object free them once the answer is out, and before it asks the next thing.

use std::any::Any;
use std::cell::{Cell, RefCell};
use std::ops::{Deref, DerefMut};

thread_local! {
    /// True while a call runs whose host frees what it leaves.
    static CALLED: Cell<bool> = const { Cell::new(false) };
    static LEFT: RefCell<Vec<Box<dyn Any>>> = const { RefCell::new(Vec::new()) };
}

/// A value that takes long to free. Dropped during a call of a plugin, on the thread of the call, it
/// stays until the call has been answered; elsewhere it is freed at once.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Leftover<T: Default + 'static>(T);

impl<T: Default> Leftover<T> {
    /// Such a value.
    pub const fn new(value: T) -> Self {
        Self(value)
    }
}

impl<T: Default> Deref for Leftover<T> {
    type Target = T;

    #[inline]
    fn deref(&self) -> &T {
        &self.0
    }
}

impl<T: Default> DerefMut for Leftover<T> {
    #[inline]
    fn deref_mut(&mut self) -> &mut T {
        &mut self.0
    }
}

impl<T: Default> Drop for Leftover<T> {
    fn drop(&mut self) {
        // A thread that ends has no call.
        if CALLED.try_with(Cell::get).unwrap_or(false) {
            let value: Box<dyn Any> = Box::new(std::mem::take(&mut self.0));
            // Gone with its thread otherwise.
            let _ = LEFT.try_with(|left| left.borrow_mut().push(value));
        }
    }
}

/// Makes a call that may leave something.
pub(crate) fn during<R>(call: impl FnOnce() -> R) -> R {
    /// The call is over, whether it returns or panics.
    struct Called(bool);

    impl Drop for Called {
        fn drop(&mut self) {
            CALLED.set(self.0);
        }
    }

    let _called = Called(CALLED.replace(true));
    call()
}

/// True if calls on this thread have left something.
pub(crate) fn any() -> bool {
    LEFT.with_borrow(|left| !left.is_empty())
}

/// Frees what calls on this thread have left.
pub(crate) fn free() {
    // What is freed may leave something itself, if only outside of calls.
    let left = LEFT.take();
    drop(left);
}

#[cfg(test)]
mod tests {
    use std::rc::Rc;

    use super::*;

    #[test]
    fn what_a_call_leaves_is_freed_when_it_has_been_answered() {
        let kept = Rc::new(());
        let leave = || drop(Leftover::new(Some(Rc::clone(&kept))));
        leave();
        assert_eq!(Rc::strong_count(&kept), 1, "there is no call");
        during(leave);
        assert!(any());
        assert_eq!(Rc::strong_count(&kept), 2, "it waits for the answer");
        free();
        assert!(!any());
        assert_eq!(Rc::strong_count(&kept), 1);
    }

    #[test]
    fn a_call_that_panics_leaves_what_it_held() {
        let kept = Rc::new(());
        let call = std::panic::AssertUnwindSafe(|| {
            let _held = Leftover::new(Some(Rc::clone(&kept)));
            panic!("on purpose");
        });
        std::panic::catch_unwind(|| during(call)).expect_err("it panics");
        assert!(any());
        free();
        drop(Leftover::new(Some(Rc::clone(&kept))));
        assert_eq!(Rc::strong_count(&kept), 1, "the call is over");
    }
}

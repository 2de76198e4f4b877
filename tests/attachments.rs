//! The same plugin gives the same plan, whichever way it is attached.

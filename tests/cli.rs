//! The command as its users see it, on real files.

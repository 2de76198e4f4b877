//! Who goes where next: starts, and streams of goals.

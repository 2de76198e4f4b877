//! Colours and dashes of planners.

/// Okabe and Ito's set ("Color Universal Design", 2008) without black and without
/// yellow, which vanishes on white, and grey. `page.css` has them too.
pub(super) const COLORS: [&str; 7] = [
    "#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#7d7d7d",
];

/// Dashes of the first seven planners, of the next seven, and so on.
pub(super) const DASHES: [&str; 4] = ["", "5 3", "1.5 2", "6 2 1.5 2"];

//! Colours that stay apart for colour-blind readers.

/// Colours of agents, in turn: Okabe and Ito's set ("Color Universal Design",
/// 2008) without black, without yellow, which vanishes on white, and without
/// vermilion, which is [`CONTACT`]. All of them show on light and dark ground.
pub(crate) const AGENTS: [&str; 5] = ["#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9"];

/// Colours of layers of annotations, in turn: darker than those of agents, so that they stand out
/// from them in grey as well.
pub(crate) const LAYERS: [&str; 6] = [
    "#6a1b9a", "#8d6e00", "#ad1457", "#00695c", "#4e342e", "#283593",
];

/// Contacts, which have a shape of their own besides.
pub(crate) const CONTACT: &str = "#d55e00";

pub(crate) const GROUND: &str = "#fbfaf7";
pub(crate) const OBSTACLE: &str = "#3c4043";
pub(crate) const ROADMAP: &str = "#b9b4a8";
pub(crate) const INK: &str = "#202124";

/// From little to much: a single path from light to dark, so that it reads in grey as well
/// (after ColorBrewer's YlOrRd, Harrower and Brewer 2003, with steps in between).
pub(crate) const HEAT: [&str; 12] = [
    "#fff3b8", "#ffeb9c", "#fee084", "#fed16c", "#febe56", "#fda946", "#fd8d3c", "#fa6a32",
    "#ef4427", "#d91f20", "#b70726", "#800026",
];

//! Pictures and pages of maps, plans and traces.
//!
//! Everything here turns what others found out into something to look at; it
//! decides nothing. [`Picture`] is a still image (SVG, and PNG through resvg),
//! [`Page`] an animated replay as one HTML file that needs nothing else. Both
//! are functions of their input alone: equal input gives equal bytes.
//!
//! Lengths are metres in the world frame (x right, y up), angles radians
//! counter-clockwise from +x, times seconds.

#![forbid(unsafe_code)]

mod clip;
mod element;
mod error;
mod fleet;
mod glyph;
mod html;
mod layers;
mod overview;
mod palette;
mod png;
mod recording;
mod shell;
mod still;
mod svg;
mod track;
mod web;
mod work;
mod world;

pub use clip::{Clip, MAX_CLIP_BYTES};
pub use element::{BOX, Element, Short, Svg, escape, push_line};
pub use error::ViewError;
pub use fleet::FleetPicture;
pub use fleetyard_sim::trace::Outline;
pub use html::{Page, PageOptions};
pub use layers::Layers;
pub use overview::{Meta, Overview};
pub use png::{Difference, difference, png};
pub use recording::Recording;
pub use shell::{Shell, embedded, policy};
pub use still::Still;
pub use svg::{Body, Picture};
pub use track::base64;
pub use web::{joined, web};
pub use world::{Cells, World};

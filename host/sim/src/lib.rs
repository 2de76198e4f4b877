//! The deterministic 2D simulator of Fleetyard: executes what a planner
//! returned and says what happened.
//!
//! It follows the simulation core of the GRACE benchmark (section IV-C: 60 Hz
//! ticks, four substeps, kinematic tracking of reference trajectories, contact
//! events, nearest approach, tracking error), with two differences: contacts
//! are found in continuous time rather than by sampling, and a digest of the
//! whole execution is always computed, so that "the same run" can be tested.
//!
//! It is not a validator: `fleetyard-check` says whether a plan obeys the rules
//! of its representation. The simulator executes invalid plans too, as far as
//! that makes sense, and reports the contacts and the tracking error that they
//! cause. It is not a clock either: it reports simulated time, and whoever calls
//! it divides by the wall time to get a real-time factor.
//!
//! # From plan to motion
//!
//! A plan on a grid or of poses in the plane is a route per agent: knots with
//! planned times. What decides when an agent may go on is the [`Policy`]: the
//! plan's times, or the order of passing, which a [dependency graph](gate) keeps
//! under any delay. How it goes on is its [model](motion): pebbles follow the plan
//! exactly (a teleport shows as tracking error instead of as a body that
//! vanishes), all others are driven by a controller under limits. What goes wrong
//! meanwhile is [`noise`]. Agents are discs, or have the footprints of a
//! [`Fleet`].
//!
//! A fleet that never ends has no plan: in a [`Live`] execution robots drive orders
//! that are sent to them while they drive.
//!
//! # Tiers
//!
//! In [`Tier::Kinematic`] bodies go where their controllers take them, and contacts
//! are found in closed form and continuous time. In [`Tier::Contact`] they push
//! each other, on rapier2d: see [`contact`].
//!
//! # Example
//!
//! ```
//! use fleetyard_core::{Grid, GridPlan};
//! use fleetyard_sim::{Simulator, NoTrace, SimConfig};
//!
//! let grid = Grid::new("tiny", 1, 4, b"....".to_vec())?;
//! // Two agents swap places, which no valid plan does.
//! let plan = GridPlan::from_paths([vec![0, 1], vec![1, 0]]);
//! let outcome = Simulator::new(&SimConfig::default()).on_grid(&grid).run(&plan, &mut NoTrace)?;
//! assert_eq!(outcome.contacts.agent_agent, 1);
//! assert_eq!(outcome.nearest_approach_m, Some(0.0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Determinism
//!
//! All arithmetic is IEEE `f64` addition, multiplication, division and square
//! root in a fixed order, and the functions of the `libm` crate; there is no fused
//! multiply-add, no clock, and no hash map whose order could reach an output.
//! Threads work on pieces that do not depend on their number, and results are
//! joined in the order of the pieces. Golden digests in the tests hold in debug and
//! release builds, on one and many threads, and on 32-bit targets.

#![forbid(unsafe_code)]

mod ahead;
mod chunk;
mod clock;
mod config;
pub mod contact;
mod control;
mod convert;
mod engine;
mod error;
mod event;
mod execution;
mod follow;
pub mod gate;
mod kinematic;
mod live;
pub mod motion;
pub mod noise;
mod obstacles;
mod outcome;
mod pairs;
mod route;
mod setup;
mod simulator;
mod solved;
mod statics;
pub mod trace;
mod track;
mod workers;

pub use config::{Policy, SimConfig, Tier};
pub use convert::{cell_center_m, cell_of_point};
pub use error::SimError;
pub use event::{Contact, Contacts, Event, EventKind, Other};
pub use live::{Live, Order};
pub use motion::{Fleet, Profile};
pub use outcome::{Approach, Figures, Outcome};
pub use route::Plan;
pub use simulator::Simulator;
pub use trace::{NoTrace, TraceReader, TraceSink, TraceWriter};

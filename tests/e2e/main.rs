//! The command, its files and its documentation from end to end, in one binary: a module for each
//! subject. Tests that need a process of their own stand beside this folder.

mod adapters;
mod adapters_real;
mod adapters_views;
mod annotations;
mod architecture;
mod attachments;
mod bench;
mod bundle;
mod cli;
mod compare;
mod continuous;
mod controls;
mod convert;
mod discovery;
mod episodes;
mod exports;
mod faulty_page;
mod fleet;
mod fleet_live;
mod follow;
#[path = "../fuzz/src/lib.rs"]
pub mod fuzz;
mod fuzz_corpus;
mod grace;
mod guide;
mod league;
mod maze_benchmark;
mod pages;
mod protocol;
mod quadrupeds;
#[path = "../rows.rs"]
mod rows;
mod scaffold;
mod simulate;
mod slurm;
mod studio;
mod studio_document;
mod studio_page;
mod studio_pictures;
mod studio_server;
mod studio_suite;
mod trace;
mod tutorials;
mod views;
mod world;

//! `fleetyard man`: the manual, a page for each command.

use std::fs;
use std::path::Path;

use fleetyard_core::InputError;

use crate::exit::{Exit, Result};

pub(crate) fn man(folder: &Path, command: clap::Command) -> Result<Exit> {
    let written =
        fs::create_dir_all(folder).and_then(|()| clap_mangen::generate_to(command, folder));
    written.map_err(|error| {
        let reason = format!("the pages cannot be written: {error}");
        InputError::new(folder.display().to_string(), reason)
            .hint("name a folder that you may write to")
    })?;
    Ok(Exit::Success)
}

//! `fleetyard completions`: what a shell needs to know to complete this command's arguments.

use clap_complete::Shell;

use crate::exit::{Exit, Result};
use crate::output;

pub(crate) fn completions(shell: Shell, mut command: clap::Command) -> Result<Exit> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut command, "fleetyard", &mut script);
    output::print(String::from_utf8_lossy(&script).trim_end())?;
    Ok(Exit::Success)
}

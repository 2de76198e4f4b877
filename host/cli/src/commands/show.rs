//! Pictures and pages of traces, for `fleetyard trace export`.

use std::path::Path;

use fleetyard_core::{InputError, write_atomically};
use fleetyard_sim::TraceSink;
use fleetyard_sim::trace::{Header, TraceContents};
use fleetyard_view::{Page, PageOptions, Recording, Still, World};

use super::{draw_png, draw_svg, file_name, not_drawn};
use crate::args::TraceExport;
use crate::exit::Result;

/// Takes a trace and makes of it the pictures and the page that are asked for.
pub(crate) struct Shown<'a> {
    arguments: &'a TraceExport,
    still: Option<Still>,
    page: Option<Page>,
}

impl<'a> Shown<'a> {
    pub(crate) fn new(arguments: &'a TraceExport, header: &Header) -> Result<Self> {
        let pictures = arguments.svg.is_some() || arguments.png.is_some();
        let options = PageOptions {
            rate_hz: arguments.rate,
            agents: arguments.agents.as_ref().map(|list| list.0.clone()),
        };
        let page = arguments.html.as_ref().map(|path| {
            let recording = Recording::of_trace(title(&arguments.file), header);
            Page::new(recording, &options).map_err(|error| not_drawn(path, &error))
        });
        Ok(Self {
            arguments,
            still: pictures.then(|| Still::new(header, arguments.at)),
            page: page.transpose()?,
        })
    }

    /// What the trace is told to.
    pub(crate) fn sinks(&mut self) -> impl Iterator<Item = &mut dyn TraceSink> {
        let still = self.still.as_mut().map(|still| still as &mut dyn TraceSink);
        let page = self.page.as_mut().map(|page| page as &mut dyn TraceSink);
        still.into_iter().chain(page)
    }

    /// Writes what was asked for, as far as the trace was intact.
    pub(crate) fn finish(self, contents: &TraceContents) -> Result<()> {
        let arguments = self.arguments;
        if let Some(still) = self.still {
            if still.end_s().is_none() {
                return Err(no_states(&arguments.file).into());
            }
            if let (Some(at), Some(end)) = (arguments.at, still.end_s())
                && at > end
            {
                let name = arguments.file.display().to_string();
                let reason = format!("the trace has states up to {end} s, not at {at} s");
                return Err(InputError::new(name, reason)
                    .hint("give an earlier time with --at")
                    .into());
            }
            let world = World::of_trace(title(&arguments.file), &contents.header);
            let picture = still.picture(&world);
            if let Some(path) = &arguments.svg {
                draw_svg(path, &picture)?;
            }
            if let Some(path) = &arguments.png {
                draw_png(path, &picture, arguments.width)?;
            }
        }
        if let (Some(page), Some(path)) = (self.page, &arguments.html) {
            let damage = contents.damage.as_ref().map(ToString::to_string);
            if contents.states == 0 {
                return Err(no_states(&arguments.file).into());
            }
            let page = page
                .finish(damage.as_deref())
                .map_err(|error| not_drawn(path, &error))?;
            write_atomically(path, page.as_bytes())?;
        }
        Ok(())
    }
}

fn no_states(path: &Path) -> InputError {
    InputError::new(path.display().to_string(), "the trace has no states")
        .hint("execute the plan again and record states")
}

/// A trace's name without what tells programs that it is one.
fn title(path: &Path) -> String {
    path.file_stem().map_or_else(
        || file_name(path),
        |stem| stem.to_string_lossy().into_owned(),
    )
}

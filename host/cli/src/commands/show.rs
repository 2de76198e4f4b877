//! Pictures and pages of traces, for `fleetyard trace export`.

use std::io;
use std::path::Path;

use fleetyard_core::{InputError, write_atomically};
use fleetyard_sim::trace::{Entry, Header, Remark, States, Summary, TraceContents};
use fleetyard_sim::{Event, TraceSink};
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

impl TraceSink for Shown<'_> {
    fn begin(&mut self, header: &Header) -> io::Result<()> {
        self.each(|sink| sink.begin(header))
    }

    fn state(&mut self, tick: u64, states: &States<'_>) -> io::Result<()> {
        self.each(|sink| sink.state(tick, states))
    }

    fn events(&mut self, events: &[Event]) -> io::Result<()> {
        self.each(|sink| sink.events(events))
    }

    fn journal(&mut self, entries: &[Entry]) -> io::Result<()> {
        self.each(|sink| sink.journal(entries))
    }

    fn remarks(&mut self, remarks: &[Remark]) -> io::Result<()> {
        self.each(|sink| sink.remarks(remarks))
    }

    fn end(&mut self, summary: &Summary) -> io::Result<()> {
        self.each(|sink| sink.end(summary))
    }
}

impl Shown<'_> {
    fn each(&mut self, tell: impl Fn(&mut dyn TraceSink) -> io::Result<()>) -> io::Result<()> {
        if let Some(still) = &mut self.still {
            tell(still)?;
        }
        if let Some(page) = &mut self.page {
            tell(page)?;
        }
        Ok(())
    }
}

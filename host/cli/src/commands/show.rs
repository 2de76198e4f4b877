//! Pictures and pages of traces, for `fleetyard trace export`.

use std::path::{Path, PathBuf};

use clap::Args;
use fleetyard_core::{AnnotationFile, InputError, load_annotations, write_atomically};
use fleetyard_sim::TraceSink;
use fleetyard_sim::trace::{Header, TraceContents};
use fleetyard_view::{Layers, Page, PageOptions, Recording, Still, World};

use crate::args::{Written, not_negative};
use crate::exit::Result;
use crate::files::{draw_png, draw_svg, file_name, not_drawn};

/// Pictures and pages that are asked for.
#[derive(Debug, Args)]
pub(super) struct ShownArgs {
    /// Draw all ways and contacts, or a moment (--at), as SVG
    #[arg(long, value_name = "FILE", value_parser = |text: &str| Written::Svg.path(text), group = "targets")]
    svg: Option<PathBuf>,
    /// The same as PNG
    #[arg(long, value_name = "FILE", value_parser = |text: &str| Written::Png.path(text), group = "targets")]
    png: Option<PathBuf>,
    /// The moment to draw, in simulated seconds
    #[arg(long, value_name = "SECONDS", value_parser = |text: &str| not_negative(text, "time"))]
    at: Option<f64>,
    /// Width of a PNG in pixels
    #[arg(long, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(1..=16_384))]
    width: Option<u32>,
    /// Write an animated replay as one HTML page
    #[arg(long, value_name = "FILE", value_parser = |text: &str| Written::Html.path(text), group = "targets")]
    html: Option<PathBuf>,
    /// States per simulated second on the page
    #[arg(long, value_name = "HZ", default_value_t = PageOptions::default().rate_hz)]
    rate: f64,
    /// Show what a planner wanted to show, as `run --annotations` wrote it, on the pictures and the
    /// page
    #[arg(long, value_name = "FILE")]
    annotations: Option<PathBuf>,
    /// Agents to show on the page, such as 0,3,7-12 [default: all]
    #[arg(long, value_name = "LIST", value_parser = agent_list)]
    agents: Option<AgentList>,
}

impl ShownArgs {
    /// The file that is read besides the trace.
    pub(super) fn input(&self) -> Option<&Path> {
        self.annotations.as_deref()
    }

    /// The files that are written.
    pub(super) fn files(&self) -> impl Iterator<Item = &PathBuf> {
        [&self.svg, &self.png, &self.html].into_iter().flatten()
    }
}

/// Numbers of agents.
#[derive(Debug, Clone)]
struct AgentList(Vec<u32>);

/// Reads numbers and ranges of numbers, separated by commas.
fn agent_list(text: &str) -> std::result::Result<AgentList, String> {
    let mut agents = Vec::new();
    for part in text.split(',') {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        let number = |text: &str| text.trim().parse::<u32>();
        let (Ok(first), Ok(last)) = (number(first), number(last)) else {
            return Err("write numbers and ranges, such as 0,3,7-12".to_owned());
        };
        if first > last {
            return Err(format!("the range {part} ends before it begins"));
        }
        if agents.len() + (last - first) as usize >= 1 << 24 {
            return Err("these are more agents than a page can show".to_owned());
        }
        agents.extend(first..=last);
    }
    Ok(AgentList(agents))
}

/// Takes a trace and makes of it the pictures and the page that are asked for.
pub(super) struct Shown<'a> {
    arguments: &'a ShownArgs,
    trace: &'a Path,
    still: Option<Still>,
    page: Option<Page>,
    layers: Layers,
}

impl<'a> Shown<'a> {
    pub(super) fn new(arguments: &'a ShownArgs, trace: &'a Path, header: &Header) -> Result<Self> {
        let pictures = arguments.svg.is_some() || arguments.png.is_some();
        let options = PageOptions {
            rate_hz: arguments.rate,
            agents: arguments.agents.as_ref().map(|list| list.0.clone()),
        };
        let layers = match &arguments.annotations {
            Some(path) => Layers::of(&load(path, header)?),
            None => Layers::default(),
        };
        let page = arguments.html.as_ref().map(|path| {
            let recording = Recording::of_trace(title(trace), header);
            let page = Page::new(recording, &options).map_err(|error| not_drawn(path, &error))?;
            Ok::<_, InputError>(page.layers(layers.clone()))
        });
        Ok(Self {
            arguments,
            trace,
            still: pictures.then(|| Still::new(header, arguments.at)),
            page: page.transpose()?,
            layers,
        })
    }

    /// The writers that receive the trace.
    pub(super) fn sinks(&mut self) -> impl Iterator<Item = &mut dyn TraceSink> {
        let still = self.still.as_mut().map(|still| still as &mut dyn TraceSink);
        let page = self.page.as_mut().map(|page| page as &mut dyn TraceSink);
        still.into_iter().chain(page)
    }

    /// Writes what was asked for, as far as the trace was intact.
    pub(super) fn finish(self, contents: &TraceContents) -> Result<()> {
        let (arguments, trace) = (self.arguments, self.trace);
        if let Some(still) = self.still {
            if still.end_s().is_none() {
                return Err(no_states(trace).into());
            }
            if let (Some(at), Some(end)) = (arguments.at, still.end_s())
                && at > end
            {
                let name = trace.display().to_string();
                let reason = format!("the trace has states up to {end} s, not at {at} s");
                return Err(InputError::new(name, reason)
                    .hint("give an earlier time with --at")
                    .into());
            }
            let world = World::of_trace(title(trace), &contents.header);
            let layers = match arguments.at {
                Some(at) => self.layers.at(at),
                None => self.layers,
            };
            let picture = still.picture(&world).layers(layers);
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
                return Err(no_states(trace).into());
            }
            let page = page
                .finish(damage.as_deref())
                .map_err(|error| not_drawn(path, &error))?;
            write_atomically(path, page.as_bytes())?;
        }
        Ok(())
    }
}

/// Reads annotations, and refuses those of another plan.
fn load(path: &Path, header: &Header) -> Result<AnnotationFile> {
    let file = load_annotations(path)?;
    let executed = header.digests.plan;
    if let Some(plan) = file
        .plan_digest
        .filter(|plan| *plan != executed && executed.0 != 0)
    {
        let reason =
            format!("these annotations are of plan {plan}, but the trace is of {executed}");
        return Err(InputError::new(file.source, reason)
            .hint("name the file that was written in the same run")
            .into());
    }
    Ok(file)
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

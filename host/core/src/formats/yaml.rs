//! YAML read from left to right, strictly, so that every error has a place.
//!
//! Of tags those of YAML itself and Python's tuples are read, which Python's dumper writes. Anchors
//! and aliases are read of short values alone, such as a position that it writes once for two
//! agents: a small text stays small.

use std::collections::{HashMap, VecDeque};

use saphyr_parser::{Event, Marker, Parser, ScalarStyle, ScanError, StrInput};

use crate::InputError;
use crate::files::quote;

/// Most events of a value that an alias may repeat.
const MOST_REPEATED: usize = 16;

/// Tags of the schema of YAML that say nothing new, and the lists of Python that do not change.
const TAGS: [&str; 7] = ["bool", "float", "int", "map", "python/tuple", "seq", "str"];

/// Events of one document.
pub(super) struct Yaml<'a> {
    source: &'a str,
    parser: Parser<'a, StrInput<'a>>,
    /// Anchors of values that have not ended, with what came of them, and how deep it is.
    open: Vec<(usize, Vec<Event<'a>>, usize)>,
    /// Short values that had an anchor.
    kept: HashMap<usize, Vec<Event<'a>>>,
    /// Events that an alias stands for.
    repeated: VecDeque<(Event<'a>, Marker)>,
}

/// Kind of a node, once its beginning was read.
enum Node {
    Mapping,
    Sequence,
    Text(String, ScalarStyle),
    /// The end of the mapping or sequence around it.
    End,
}

impl<'a> Yaml<'a> {
    /// At the beginning of the document in `text`.
    pub(super) fn new(source: &'a str, text: &'a str) -> Result<Self, InputError> {
        let mut yaml = Self {
            source,
            parser: Parser::new_from_str(text),
            open: Vec::new(),
            kept: HashMap::new(),
            repeated: VecDeque::new(),
        };
        loop {
            match yaml.event()? {
                (Event::StreamStart | Event::Nothing, _) => {}
                (Event::DocumentStart(_), _) => return Ok(yaml),
                _ => return Err(InputError::new(source, "the file is empty")),
            }
        }
    }

    /// Refuses a second document.
    pub(super) fn finish(mut self) -> Result<(), InputError> {
        loop {
            match self.event()? {
                (Event::DocumentEnd | Event::Nothing, _) => {}
                (Event::StreamEnd, _) => return Ok(()),
                (_, place) => return Err(self.error(place, "the document goes on after its end")),
            }
        }
    }

    pub(super) fn error(&self, place: Marker, reason: impl Into<String>) -> InputError {
        let (line, column) = (place.line().max(1), place.col() + 1);
        InputError::new(self.source, reason).at(line as u64, column as u64)
    }

    fn event(&mut self) -> Result<(Event<'a>, Marker), InputError> {
        let next = match self.repeated.pop_front() {
            Some(next) => next,
            None => match self.parser.next_event() {
                Some(Ok((event, span))) => (event, span.start),
                Some(Err(error)) => return Err(self.syntax(&error)),
                None => return Err(InputError::new(self.source, "the file ends too early")),
            },
        };
        let (event, place) = next;
        if let Event::Alias(anchor) = event {
            let Some(events) = self.kept.get(&anchor) else {
                let reason = "aliases of long values are not accepted";
                return Err(self.error(place, reason).hint("write the value itself"));
            };
            let events = events.iter().map(|event| (event.clone(), place));
            self.repeated.extend(events);
            return self.event();
        }
        Ok((self.record(event), place))
    }

    /// Keeps an event for the aliases of all values that it belongs to, and leaves out its anchor.
    fn record(&mut self, event: Event<'a>) -> Event<'a> {
        let (anchor, event) = match event {
            Event::Scalar(text, style, anchor, tag) => (anchor, Event::Scalar(text, style, 0, tag)),
            Event::SequenceStart(anchor, tag) => (anchor, Event::SequenceStart(0, tag)),
            Event::MappingStart(anchor, tag) => (anchor, Event::MappingStart(0, tag)),
            event => (0, event),
        };
        if anchor != 0 {
            self.open.push((anchor, Vec::new(), 0));
        }
        for (_, events, depth) in &mut self.open {
            events.push(event.clone());
            match event {
                Event::SequenceStart(..) | Event::MappingStart(..) => *depth += 1,
                Event::SequenceEnd | Event::MappingEnd => *depth = depth.saturating_sub(1),
                _ => {}
            }
        }
        self.open
            .retain(|(_, events, _)| events.len() <= MOST_REPEATED);
        let kept = &mut self.kept;
        self.open.retain_mut(|(anchor, events, depth)| {
            if *depth == 0 {
                kept.insert(*anchor, std::mem::take(events));
            }
            *depth > 0
        });
        event
    }

    fn syntax(&self, error: &ScanError) -> InputError {
        let reason = format!("this is not YAML: {}", error.info());
        self.error(*error.marker(), reason)
    }

    fn node(&mut self) -> Result<(Node, Marker), InputError> {
        const HINT: &str = "write the value itself";
        let (event, place) = self.event()?;
        let tag = match &event {
            Event::Scalar(_, _, _, tag)
            | Event::SequenceStart(_, tag)
            | Event::MappingStart(_, tag) => tag.as_deref(),
            _ => None,
        };
        if let Some(tag) = tag
            && !(tag.is_yaml_core_schema() && TAGS.contains(&&*tag.suffix))
        {
            let reason = format!(
                "the tag {} is not accepted",
                quote(tag.to_string().as_bytes())
            );
            return Err(self.error(place, reason).hint(HINT));
        }
        let node = match event {
            Event::MappingStart(..) => Node::Mapping,
            Event::SequenceStart(..) => Node::Sequence,
            Event::Scalar(text, style, ..) => Node::Text(text.into_owned(), style),
            Event::SequenceEnd | Event::MappingEnd => Node::End,
            _ => return Err(self.error(place, "the document ends too early")),
        };
        Ok((node, place))
    }

    fn wrong(&self, (node, place): (Node, Marker), expected: &str) -> InputError {
        let found = match node {
            Node::Mapping => "a mapping".to_owned(),
            Node::Sequence => "a list".to_owned(),
            Node::Text(text, _) => quote(text.as_bytes()),
            Node::End => "the end of the list".to_owned(),
        };
        self.error(place, format!("expected {expected}, found {found}"))
    }

    /// Reads a mapping: calls `each` with every key, which reads the value.
    pub(super) fn mapping(
        &mut self,
        what: &str,
        mut each: impl FnMut(&mut Self, &str, Marker) -> Result<(), InputError>,
    ) -> Result<Marker, InputError> {
        let (node, begin) = self.node()?;
        if !matches!(node, Node::Mapping) {
            return Err(self.wrong((node, begin), what));
        }
        // In the order of the text; few enough to be searched, or many and then sorted.
        let mut keys = std::collections::HashSet::new();
        loop {
            match self.node()? {
                (Node::End, _) => return Ok(begin),
                (Node::Text(key, _), place) => {
                    if !keys.insert(key.clone()) {
                        let reason = format!("{} is given twice", quote(key.as_bytes()));
                        return Err(self.error(place, reason));
                    }
                    each(self, &key, place)?;
                }
                other => return Err(self.wrong(other, "a key")),
            }
        }
    }

    /// Reads a list: calls `each` before every entry, which reads it.
    pub(super) fn list(
        &mut self,
        what: &str,
        mut each: impl FnMut(&mut Self) -> Result<(), InputError>,
    ) -> Result<Marker, InputError> {
        let (node, begin) = self.node()?;
        if !matches!(node, Node::Sequence) {
            return Err(self.wrong((node, begin), what));
        }
        loop {
            let ends = match self.repeated.front() {
                Some((event, _)) => *event == Event::SequenceEnd,
                None => matches!(self.parser.peek(), Some(Ok((Event::SequenceEnd, _)))),
            };
            if ends {
                self.event()?;
                return Ok(begin);
            }
            each(self)?;
        }
    }

    /// A list of exactly two integers, such as `[x, y]`.
    pub(super) fn pair(&mut self, what: &str) -> Result<((i64, i64), Marker), InputError> {
        let mut values = Vec::with_capacity(2);
        let place = self.list(what, |yaml| {
            let (value, place) = yaml.integer("a coordinate")?;
            if values.len() == 2 {
                return Err(yaml.error(place, format!("expected {what}, found a third number")));
            }
            values.push(value);
            Ok(())
        })?;
        match values[..] {
            [x, y] => Ok(((x, y), place)),
            _ => Err(self.error(
                place,
                format!("expected {what}, found {} numbers", values.len()),
            )),
        }
    }

    /// A text, however it is written.
    pub(super) fn text(&mut self, what: &str) -> Result<(String, Marker), InputError> {
        match self.node()? {
            (Node::Text(text, _), place) => Ok((text, place)),
            other => Err(self.wrong(other, what)),
        }
    }

    /// A plain integer, which may be written as a float (`2.0`).
    pub(super) fn integer(&mut self, what: &str) -> Result<(i64, Marker), InputError> {
        let (node, place) = self.node()?;
        if let Node::Text(text, ScalarStyle::Plain) = &node
            && let Some(value) = whole(text)
        {
            return Ok((value, place));
        }
        Err(self.wrong((node, place), what))
    }

    /// A plain number.
    pub(super) fn number(&mut self, what: &str) -> Result<(f64, Marker), InputError> {
        let (node, place) = self.node()?;
        if let Node::Text(text, ScalarStyle::Plain) = &node
            && let Ok(value) = text.parse()
        {
            return Ok((value, place));
        }
        Err(self.wrong((node, place), what))
    }

    /// Reads a value of whatever kind and forgets it.
    pub(super) fn skip(&mut self) -> Result<(), InputError> {
        let mut depth = 0_usize;
        loop {
            match self.node()?.0 {
                Node::Mapping | Node::Sequence => depth += 1,
                Node::End => depth = depth.saturating_sub(1),
                Node::Text(..) => {}
            }
            if depth == 0 {
                return Ok(());
            }
        }
    }
}

/// A whole number of at most 15 digits.
fn whole(text: &str) -> Option<i64> {
    let text = match text.split_once('.') {
        Some((whole, zeros)) if zeros.bytes().all(|byte| byte == b'0') => whole,
        _ => text,
    };
    let digits = text.strip_prefix('-').unwrap_or(text);
    let fits = (1..=15).contains(&digits.len()) && digits.bytes().all(|byte| byte.is_ascii_digit());
    fits.then(|| text.parse().ok()).flatten()
}

//! SVG, element by element.

use std::fmt::{self, Display, Write as _};

use fleetyard_core::is_unseen;

/// A number with at most so many decimals, and none that say nothing.
#[derive(Debug, Clone, Copy)]
pub struct Short(pub f64, pub usize);

impl Display for Short {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(value, decimals) = *self;
        let text = format!("{value:.decimals$}");
        let text = match decimals {
            0 => &text,
            _ => text.trim_end_matches('0').trim_end_matches('.'),
        };
        f.write_str(if text == "-0" { "0" } else { text })
    }
}

/// The sides of a rectangle, for [`Element::numbers`].
pub const BOX: [&str; 4] = ["x", "y", "width", "height"];

/// A document, or a piece of one, in the making.
#[derive(Debug, Default)]
pub struct Svg {
    pub(crate) text: String,
}

impl Svg {
    /// The element of the whole document: its size, and the sides of what it shows.
    pub fn root(&mut self, size: [&dyn Display; 2], view: [Short; 2]) -> Element<'_> {
        self.element("svg")
            .with("xmlns", "http://www.w3.org/2000/svg")
            .with("width", size[0])
            .with("height", size[1])
            .with("viewBox", format_args!("0 0 {} {}", view[0], view[1]))
    }

    /// Begins an element.
    pub fn element(&mut self, name: &'static str) -> Element<'_> {
        let Self { text } = self;
        text.push('<');
        text.push_str(name);
        Element { text, name }
    }

    /// Ends an element that was opened.
    pub fn close(&mut self, name: &str) {
        let _ = writeln!(self.text, "</{name}>");
    }

    /// Appends another piece.
    pub fn append(&mut self, piece: &Self) {
        self.text.push_str(&piece.text);
    }

    /// White ground.
    pub fn ground(&mut self) {
        self.element("rect")
            .with("width", "100%")
            .with("height", "100%")
            .with("fill", "#fff")
            .end();
    }

    /// The whole document.
    pub fn finish(mut self) -> String {
        self.close("svg");
        self.text
    }
}

/// An element whose attributes are written, one after the other.
#[must_use = "an element has to be ended"]
pub struct Element<'a> {
    text: &'a mut String,
    name: &'static str,
}

impl Element<'_> {
    /// Adds an attribute. Its value is written as it is.
    pub fn with(self, name: &str, value: impl Display) -> Self {
        let _ = write!(self.text, " {name}=\"{value}\"");
        self
    }

    /// Adds numbers, each with its name.
    pub fn numbers<const N: usize>(self, names: [&str; N], values: [Short; N]) -> Self {
        let pairs = names.into_iter().zip(values);
        pairs.fold(self, |element, (name, value)| element.with(name, value))
    }

    /// Adds attributes, as [`Element::with`] does.
    pub fn more(self, attributes: &[(&str, &dyn Display)]) -> Self {
        let attributes = attributes.iter();
        attributes.fold(self, |element, (name, value)| element.with(name, value))
    }

    /// Ends it, with nothing in it.
    pub fn end(self) {
        self.text.push_str("/>\n");
    }

    /// Goes on with what is in it, until [`Svg::close`].
    pub fn open(self) {
        self.text.push_str(">\n");
    }

    /// Ends it, with words in it.
    pub fn words(self, words: &str) {
        let _ = writeln!(self.text, ">{}</{}>", escape(words), self.name);
    }

    /// Ends it, with a title in it if there is one.
    pub fn told(self, title: &str) {
        if title.is_empty() {
            self.end();
        } else {
            self.titled(title);
        }
    }

    /// Ends it, with a title in it.
    pub fn titled(self, title: &str) {
        let (title, name) = (escape(title), self.name);
        let _ = writeln!(self.text, "><title>{title}</title></{name}>");
    }
}

/// Appends a broken line through points to the data of a path.
pub fn push_line(data: &mut String, points: impl IntoIterator<Item = [f64; 2]>, decimals: usize) {
    let mut letter = 'M';
    for [x, y] in points {
        let _ = write!(
            data,
            "{letter}{} {}",
            Short(x, decimals),
            Short(y, decimals)
        );
        letter = 'L';
    }
}

/// Text for XML and HTML, in elements and in quoted attributes.
pub fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            // Neither XML nor HTML can hold control characters in any form, and nobody is to
            // read other text than there is.
            c if is_unseen(c) && !matches!(c, '\n' | '\t') => out.push('\u{fffd}'),
            '\u{fffe}' | '\u{ffff}' => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
    out
}

//! Figures as SVG for papers: light ground, text as text, and as wide as one or two
//! columns of a page.

use std::fmt::Write as _;

use fleetyard_view::escape;

use super::figure::{Axis, Figure, Marks, Scale, Series};
use super::format::tick;
use super::palette::{COLORS, DASHES};

/// Points, of which an inch has 72, in a millimetre.
const MM: f64 = 72.0 / 25.4;

/// One column and two columns of a page.
const WIDTHS_MM: [f64; 2] = [85.0, 180.0];

/// Planners in a figure of one column, at most.
const NARROW: usize = 4;

const INK: &str = "#202124";
const SOFT: &str = "#5b6068";
const GRID: &str = "#e4e1d8";

/// Size of letters, and roughly how wide one is.
const FONT: f64 = 7.5;
const LETTER: f64 = 4.0;

/// A number with as many decimals as a drawing needs.
struct Short(f64);

impl std::fmt::Display for Short {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let text = format!("{:.2}", self.0);
        let text = text.trim_end_matches('0').trim_end_matches('.');
        f.write_str(if text == "-0" { "0" } else { text })
    }
}

/// The figure as a document.
pub fn svg(figure: &Figure) -> String {
    let names = figure.y.names.as_deref();
    let has_legend = names.is_none() && figure.series.len() > 1;
    let wide = has_legend && figure.series.len() > NARROW;
    let width = WIDTHS_MM[usize::from(wide)] * MM;
    let left = match names {
        Some(names) => {
            let longest = names.iter().map(|name| name.chars().count()).max();
            (longest.unwrap_or(0) as f64 * LETTER + 10.0).min(width * 0.4)
        }
        None => 40.0,
    };
    // Half of the last label stands beyond the last tick.
    let (right, top) = (width - 14.0, 8.0);
    let height = match names {
        Some(names) => (names.len() as f64 * 14.0).max(40.0),
        None if figure.diagonal => right - left,
        None => 140.0,
    };
    let bottom = top + height;
    let legend = if has_legend {
        legend(&figure.series, left, right, bottom + 38.0)
    } else {
        (String::new(), bottom + 30.0)
    };
    let [xs, ys] = figure.values();
    let frame = Frame {
        x: Scale::new(&figure.x, &xs, right - left, 34.0),
        y: Scale::new(&figure.y, &ys, height, 22.0),
        left,
        right,
        top,
        bottom,
        down: names.is_some(),
    };
    let total = legend.1 + 4.0;
    let mut out = String::new();
    let _ = write!(
        out,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{}mm\" height=\"{}mm\" \
         viewBox=\"0 0 {} {}\" font-family=\"Helvetica, Arial, sans-serif\" font-size=\"{FONT}\" \
         fill=\"none\" stroke-linejoin=\"round\">\n<title>{}</title>\n<desc>{}</desc>\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n",
        Short(width / MM),
        Short(total / MM),
        Short(width),
        Short(total),
        escape(&figure.title),
        escape(&figure.caption),
    );
    frame.ground(&mut out, &figure.x, &figure.y, figure.diagonal);
    for series in &figure.series {
        frame.series(&mut out, series);
    }
    out.push_str(&legend.0);
    out.push_str("</svg>\n");
    out
}

struct Frame {
    x: Scale,
    y: Scale,
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
    /// Whether y goes down, as names do.
    down: bool,
}

fn text(out: &mut String, at: [f64; 2], anchor: &str, color: &str, rest: &str, words: &str) {
    let _ = writeln!(
        out,
        "<text x=\"{}\" y=\"{}\" text-anchor=\"{anchor}\" fill=\"{color}\"{rest}>{}</text>",
        Short(at[0]),
        Short(at[1]),
        escape(words),
    );
}

fn line(out: &mut String, from: [f64; 2], to: [f64; 2], color: &str, rest: &str) {
    let _ = writeln!(
        out,
        "<path d=\"M{} {}L{} {}\" stroke=\"{color}\"{rest}/>",
        Short(from[0]),
        Short(from[1]),
        Short(to[0]),
        Short(to[1]),
    );
}

/// No longer than `length` characters.
fn shortened(words: &str, length: usize) -> String {
    if words.chars().count() <= length {
        return words.to_owned();
    }
    let kept: String = words.chars().take(length.saturating_sub(1)).collect();
    kept + "…"
}

impl Frame {
    fn at(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let y = self.y.place(y);
        let y = if self.down {
            self.top + y
        } else {
            self.bottom - y
        };
        [self.left + self.x.place(x), y]
    }

    fn x(&self, value: f64) -> f64 {
        self.left + self.x.place(value)
    }

    fn ground(&self, out: &mut String, x: &Axis, y: &Axis, diagonal: bool) {
        let Self {
            left,
            right,
            top,
            bottom,
            ..
        } = *self;
        let thin = " stroke-width=\"0.5\"";
        for value in &self.x.ticks {
            let at = self.x(*value);
            line(out, [at, top], [at, bottom], GRID, thin);
            text(
                out,
                [at, bottom + 10.0],
                "middle",
                SOFT,
                "",
                &tick(x.percent, *value),
            );
        }
        for value in &self.y.ticks {
            let at = bottom - self.y.place(*value);
            line(out, [left, at], [right, at], GRID, thin);
            text(
                out,
                [left - 4.0, at + 2.6],
                "end",
                SOFT,
                "",
                &tick(y.percent, *value),
            );
        }
        for (index, name) in y.names.iter().flatten().enumerate() {
            let at = self.at([1.0, index as f64])[1];
            let name = shortened(name, ((left - 6.0) / LETTER) as usize);
            text(out, [left - 4.0, at + 2.6], "end", INK, "", &name);
        }
        line(out, [left, bottom], [right, bottom], SOFT, thin);
        line(out, [left, top], [left, bottom], SOFT, thin);
        let middle = f64::midpoint(left, right);
        text(out, [middle, bottom + 22.0], "middle", INK, "", &x.label);
        if !y.label.is_empty() {
            let middle = f64::midpoint(top, bottom);
            let turned = format!(" transform=\"rotate(-90 9 {})\"", Short(middle));
            text(out, [9.0, middle], "middle", INK, &turned, &y.label);
        }
        if diagonal {
            let [[x0, x1], [y0, y1]] = [self.x.ends(), self.y.ends()];
            let (low, high) = (x0.max(y0), x1.min(y1));
            if low < high {
                let dashed = " stroke-width=\"0.7\" stroke-dasharray=\"3 3\"";
                line(
                    out,
                    self.at([low, low]),
                    self.at([high, high]),
                    SOFT,
                    dashed,
                );
            }
        }
    }

    fn series(&self, out: &mut String, series: &Series) {
        let color = COLORS[series.slot % COLORS.len()];
        let dash = DASHES[series.slot / COLORS.len() % DASHES.len()];
        let place = |points: &[[f64; 2]]| -> Vec<[f64; 2]> {
            points.iter().map(|point| self.at(*point)).collect()
        };
        match &series.marks {
            Marks::Curve { points, band } => {
                if let Some(band) = band {
                    self.band(out, points, band, color);
                }
                let placed = place(points);
                stroke(out, &path(&placed), color, dash);
                if placed.len() <= 15 {
                    marks(out, series.slot, &placed, 2.0, color, "");
                }
            }
            Marks::Steps { points } => {
                let mut d = String::new();
                for (index, [x, y]) in place(points).into_iter().enumerate() {
                    let _ = match index {
                        0 => write!(d, "M{} {}V{}", Short(x), Short(self.bottom), Short(y)),
                        _ => write!(d, "H{}V{}", Short(x), Short(y)),
                    };
                }
                stroke(out, &d, color, dash);
            }
            Marks::Dots { points } => {
                let faint = " fill-opacity=\"0.6\"";
                marks(out, series.slot, &place(points), 1.4, color, faint);
            }
            Marks::Bar {
                at,
                value,
                interval,
            } => {
                let Some(value) = value else { return };
                let y = self.at([1.0, *at as f64])[1];
                let from = self.x(0.0).max(self.left);
                let length = (self.x(*value) - from).max(0.5);
                let _ = writeln!(
                    out,
                    "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"9\" fill=\"{color}\"/>",
                    Short(from),
                    Short(y - 4.5),
                    Short(length),
                );
                if let Some([low, high]) = interval {
                    line(
                        out,
                        [self.x(*low), y],
                        [self.x(*high), y],
                        INK,
                        " stroke-width=\"0.9\"",
                    );
                }
            }
            Marks::Box {
                at,
                low,
                q1,
                median,
                q3,
                high,
                mean,
                outliers,
            } => {
                let y = self.at([1.0, *at as f64])[1];
                for (from, to) in [(low, q1), (q3, high)] {
                    line(
                        out,
                        [self.x(*from), y],
                        [self.x(*to), y],
                        color,
                        " stroke-width=\"0.9\"",
                    );
                }
                let _ = writeln!(
                    out,
                    "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"9\" fill=\"{color}\" \
                     fill-opacity=\"0.25\" stroke=\"{color}\" stroke-width=\"0.8\"/>",
                    Short(self.x(*q1)),
                    Short(y - 4.5),
                    Short((self.x(*q3) - self.x(*q1)).max(0.5)),
                );
                for (value, width) in [(low, "0.9"), (high, "0.9"), (median, "1.8")] {
                    let x = self.x(*value);
                    let rest = format!(" stroke-width=\"{width}\"");
                    line(out, [x, y - 4.5], [x, y + 4.5], color, &rest);
                }
                let outliers: Vec<_> = outliers.iter().map(|value| [self.x(*value), y]).collect();
                marks(out, 0, &outliers, 0.9, color, " fill-opacity=\"0.7\"");
                let edged = format!(" stroke=\"{INK}\" stroke-width=\"0.7\"");
                marks(out, 3, &[[self.x(*mean), y]], 2.4, "#fff", &edged);
            }
        }
    }

    fn band(&self, out: &mut String, points: &[[f64; 2]], band: &[[f64; 2]], color: &str) {
        let edge = |end: usize| {
            let ends = points.iter().zip(band);
            ends.map(move |(point, band)| {
                let [x, y] = self.at([point[0], band[end]]);
                [x, y.clamp(self.top, self.bottom)]
            })
        };
        let (low, high): (Vec<_>, Vec<_>) = (edge(0).collect(), edge(1).collect());
        if let ([low], [high]) = (&low[..], &high[..]) {
            return line(out, *low, *high, color, " stroke-width=\"0.9\"");
        }
        let around: Vec<_> = high.into_iter().chain(low.into_iter().rev()).collect();
        let d = path(&around);
        let _ = writeln!(
            out,
            "<path d=\"{d}z\" fill=\"{color}\" fill-opacity=\"0.14\"/>"
        );
    }
}

fn path(points: &[[f64; 2]]) -> String {
    let mut d = String::new();
    for (index, [x, y]) in points.iter().enumerate() {
        let _ = write!(
            d,
            "{}{} {}",
            if index == 0 { 'M' } else { 'L' },
            Short(*x),
            Short(*y)
        );
    }
    d
}

fn stroke(out: &mut String, d: &str, color: &str, dash: &str) {
    if d.is_empty() {
        return;
    }
    let _ = write!(
        out,
        "<path d=\"{d}\" stroke=\"{color}\" stroke-width=\"1.3\""
    );
    if !dash.is_empty() {
        let _ = write!(out, " stroke-dasharray=\"{dash}\"");
    }
    out.push_str("/>\n");
}

/// The mark of a planner at each of these places.
fn marks(out: &mut String, slot: usize, at: &[[f64; 2]], r: f64, color: &str, rest: &str) {
    if at.is_empty() {
        return;
    }
    let mut d = String::new();
    let (half, tall) = (r * 0.9, r * 1.15);
    for [x, y] in at {
        let (x0, y0) = (Short(*x), Short(*y));
        let _ = match slot % 5 {
            0 => write!(
                d,
                "M{} {y0}a{r} {r} 0 1 0 {} 0a{r} {r} 0 1 0 {} 0z",
                Short(x - r),
                Short(2.0 * r),
                Short(-2.0 * r)
            ),
            1 => write!(
                d,
                "M{} {}h{2}v{2}h{3}z",
                Short(x - half),
                Short(y - half),
                Short(2.0 * half),
                Short(-2.0 * half)
            ),
            2 => write!(
                d,
                "M{x0} {}l{} {}h{}z",
                Short(y - tall),
                Short(tall),
                Short(1.8 * tall),
                Short(-2.0 * tall)
            ),
            3 => write!(
                d,
                "M{x0} {}l{1} {1}l{2} {1}l{2} {2}z",
                Short(y - tall),
                Short(tall),
                Short(-tall)
            ),
            _ => write!(
                d,
                "M{x0} {}l{} {}h{}z",
                Short(y + tall),
                Short(tall),
                Short(-1.8 * tall),
                Short(-2.0 * tall)
            ),
        };
    }
    let _ = writeln!(out, "<path d=\"{d}\" fill=\"{color}\"{rest}/>");
}

/// Names with their lines and marks, in rows from `top` on, and where they end.
fn legend(series: &[Series], left: f64, right: f64, top: f64) -> (String, f64) {
    let mut out = String::new();
    let (mut x, mut y) = (left, top);
    for one in series {
        let name = shortened(&one.name, 40);
        let length = 26.0 + name.chars().count() as f64 * LETTER;
        if x > left && x + length > right {
            x = left;
            y += 11.0;
        }
        let color = COLORS[one.slot % COLORS.len()];
        let dash = DASHES[one.slot / COLORS.len() % DASHES.len()];
        let mark = [x + 8.0, y - 2.5];
        if !matches!(one.marks, Marks::Dots { .. }) {
            stroke(
                &mut out,
                &path(&[[x, y - 2.5], [x + 16.0, y - 2.5]]),
                color,
                dash,
            );
        }
        if !matches!(one.marks, Marks::Steps { .. }) {
            marks(&mut out, one.slot, &[mark], 2.0, color, "");
        }
        text(&mut out, [x + 19.0, y], "start", INK, "", &name);
        x += length;
    }
    (out, y + 4.0)
}

//! Figures as SVG for papers: light ground, text as text, and as wide as one or two
//! columns of a page.

use std::fmt::{Display, Write as _};

use fleetyard_view::{BOX, Element, Short, Svg, push_line};

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

/// A coordinate.
fn short(value: f64) -> Short {
    Short(value, 2)
}

/// Attributes that an element has besides.
type More<'a> = &'a [(&'a str, &'a dyn Display)];

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
        (Svg::default(), bottom + 30.0)
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
    let mut svg = Svg::default();
    let size = [width, total].map(|side| format!("{}mm", short(side / MM)));
    svg.root([&size[0], &size[1]], [width, total].map(short))
        .with("font-family", "Helvetica, Arial, sans-serif")
        .with("font-size", FONT)
        .with("fill", "none")
        .with("stroke-linejoin", "round")
        .open();
    svg.element("title").words(&figure.title);
    svg.element("desc").words(&figure.caption);
    svg.ground();
    frame.ground(&mut svg, &figure.x, &figure.y, figure.diagonal);
    for series in &figure.series {
        frame.series(&mut svg, series);
    }
    svg.append(&legend.0);
    svg.finish()
}

struct Frame {
    x: Scale,
    y: Scale,
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
    /// True if y goes down, as names do.
    down: bool,
}

fn text(svg: &mut Svg, at: [f64; 2], anchor: &str, color: &str, more: More<'_>, words: &str) {
    svg.element("text")
        .numbers(["x", "y"], at.map(short))
        .with("text-anchor", anchor)
        .with("fill", color)
        .more(more)
        .words(words);
}

fn line(svg: &mut Svg, from: [f64; 2], to: [f64; 2], color: &str, more: More<'_>) {
    svg.element("path")
        .with("d", path(&[from, to]))
        .with("stroke", color)
        .more(more)
        .end();
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

    fn ground(&self, svg: &mut Svg, x: &Axis, y: &Axis, diagonal: bool) {
        let Self {
            left,
            right,
            top,
            bottom,
            ..
        } = *self;
        let thin: More<'_> = &[("stroke-width", &0.5)];
        for value in &self.x.ticks {
            let at = self.x(*value);
            line(svg, [at, top], [at, bottom], GRID, thin);
            text(
                svg,
                [at, bottom + 10.0],
                "middle",
                SOFT,
                &[],
                &tick(x.percent, *value),
            );
        }
        for value in &self.y.ticks {
            let at = bottom - self.y.place(*value);
            line(svg, [left, at], [right, at], GRID, thin);
            text(
                svg,
                [left - 4.0, at + 2.6],
                "end",
                SOFT,
                &[],
                &tick(y.percent, *value),
            );
        }
        for (index, name) in y.names.iter().flatten().enumerate() {
            let at = self.at([1.0, index as f64])[1];
            let name = shortened(name, ((left - 6.0) / LETTER) as usize);
            text(svg, [left - 4.0, at + 2.6], "end", INK, &[], &name);
        }
        line(svg, [left, bottom], [right, bottom], SOFT, thin);
        line(svg, [left, top], [left, bottom], SOFT, thin);
        let middle = f64::midpoint(left, right);
        text(svg, [middle, bottom + 22.0], "middle", INK, &[], &x.label);
        if !y.label.is_empty() {
            let middle = f64::midpoint(top, bottom);
            let turn = format!("rotate(-90 9 {})", short(middle));
            let turned: More<'_> = &[("transform", &turn)];
            text(svg, [9.0, middle], "middle", INK, turned, &y.label);
        }
        if diagonal {
            let [[x0, x1], [y0, y1]] = [self.x.ends(), self.y.ends()];
            let (low, high) = (x0.max(y0), x1.min(y1));
            if low < high {
                let dashed: More<'_> = &[("stroke-width", &0.7), ("stroke-dasharray", &"3 3")];
                let [from, to] = [low, high].map(|value| self.at([value, value]));
                line(svg, from, to, SOFT, dashed);
            }
        }
    }

    fn series(&self, svg: &mut Svg, series: &Series) {
        let color = COLORS[series.slot % COLORS.len()];
        let dash = DASHES[series.slot / COLORS.len() % DASHES.len()];
        let place = |points: &[[f64; 2]]| -> Vec<[f64; 2]> {
            points.iter().map(|point| self.at(*point)).collect()
        };
        match &series.marks {
            Marks::Curve { points, band } => {
                if let Some(band) = band {
                    self.band(svg, points, band, color);
                }
                let placed = place(points);
                stroke(svg, &path(&placed), color, dash);
                if placed.len() <= 15 {
                    marks(svg, series.slot, &placed, 2.0, color, &[]);
                }
            }
            Marks::Steps { points } => {
                let mut d = String::new();
                for (index, [x, y]) in place(points).into_iter().enumerate() {
                    let _ = match index {
                        0 => write!(d, "M{} {}V{}", short(x), short(self.bottom), short(y)),
                        _ => write!(d, "H{}V{}", short(x), short(y)),
                    };
                }
                stroke(svg, &d, color, dash);
            }
            Marks::Dots { points } => {
                let faint: More<'_> = &[("fill-opacity", &0.6)];
                marks(svg, series.slot, &place(points), 1.4, color, faint);
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
                bar(svg, [from, y], length, color).end();
                if let Some([low, high]) = interval {
                    let [low, high] = [*low, *high].map(|end| [self.x(end), y]);
                    line(svg, low, high, INK, &[("stroke-width", &0.9)]);
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
                    let [from, to] = [*from, *to].map(|end| [self.x(end), y]);
                    line(svg, from, to, color, &[("stroke-width", &0.9)]);
                }
                let length = (self.x(*q3) - self.x(*q1)).max(0.5);
                bar(svg, [self.x(*q1), y], length, color)
                    .with("fill-opacity", 0.25)
                    .with("stroke", color)
                    .with("stroke-width", 0.8)
                    .end();
                for (value, width) in [(low, 0.9), (high, 0.9), (median, 1.8)] {
                    let x = self.x(*value);
                    let [from, to] = [[x, y - 4.5], [x, y + 4.5]];
                    line(svg, from, to, color, &[("stroke-width", &width)]);
                }
                let outliers: Vec<_> = outliers.iter().map(|value| [self.x(*value), y]).collect();
                marks(svg, 0, &outliers, 0.9, color, &[("fill-opacity", &0.7)]);
                let edged: More<'_> = &[("stroke", &INK), ("stroke-width", &0.7)];
                marks(svg, 3, &[[self.x(*mean), y]], 2.4, "#fff", edged);
            }
        }
    }

    fn band(&self, svg: &mut Svg, points: &[[f64; 2]], band: &[[f64; 2]], color: &str) {
        let edge = |end: usize| {
            let ends = points.iter().zip(band);
            ends.map(move |(point, band)| {
                let [x, y] = self.at([point[0], band[end]]);
                [x, y.clamp(self.top, self.bottom)]
            })
        };
        let (low, high): (Vec<_>, Vec<_>) = (edge(0).collect(), edge(1).collect());
        if let ([low], [high]) = (&low[..], &high[..]) {
            return line(svg, *low, *high, color, &[("stroke-width", &0.9)]);
        }
        let around: Vec<_> = high.into_iter().chain(low.into_iter().rev()).collect();
        svg.element("path")
            .with("d", path(&around) + "z")
            .with("fill", color)
            .with("fill-opacity", 0.14)
            .end();
    }
}

/// A bar as high as letters, with a middle line from a place on.
fn bar<'a>(svg: &'a mut Svg, [x, y]: [f64; 2], length: f64, color: &str) -> Element<'a> {
    svg.element("rect")
        .numbers(BOX, [x, y - 4.5, length, 9.0].map(short))
        .with("fill", color)
}

fn path(points: &[[f64; 2]]) -> String {
    let mut d = String::new();
    push_line(&mut d, points.iter().copied(), 2);
    d
}

fn stroke(svg: &mut Svg, d: &str, color: &str, dash: &str) {
    if d.is_empty() {
        return;
    }
    let dashed: More<'_> = &[("stroke-dasharray", &dash)];
    svg.element("path")
        .with("d", d)
        .with("stroke", color)
        .with("stroke-width", 1.3)
        .more(if dash.is_empty() { &[] } else { dashed })
        .end();
}

/// The mark of a planner at each of these places.
fn marks(svg: &mut Svg, slot: usize, at: &[[f64; 2]], r: f64, color: &str, more: More<'_>) {
    if at.is_empty() {
        return;
    }
    let mut d = String::new();
    let (half, tall) = (r * 0.9, r * 1.15);
    for [x, y] in at {
        let (x0, y0) = (short(*x), short(*y));
        let _ = match slot % 5 {
            0 => write!(
                d,
                "M{} {y0}a{r} {r} 0 1 0 {} 0a{r} {r} 0 1 0 {} 0z",
                short(x - r),
                short(2.0 * r),
                short(-2.0 * r)
            ),
            1 => write!(
                d,
                "M{} {}h{2}v{2}h{3}z",
                short(x - half),
                short(y - half),
                short(2.0 * half),
                short(-2.0 * half)
            ),
            2 => write!(
                d,
                "M{x0} {}l{} {}h{}z",
                short(y - tall),
                short(tall),
                short(1.8 * tall),
                short(-2.0 * tall)
            ),
            3 => write!(
                d,
                "M{x0} {}l{1} {1}l{2} {1}l{2} {2}z",
                short(y - tall),
                short(tall),
                short(-tall)
            ),
            _ => write!(
                d,
                "M{x0} {}l{} {}h{}z",
                short(y + tall),
                short(tall),
                short(-1.8 * tall),
                short(-2.0 * tall)
            ),
        };
    }
    svg.element("path")
        .with("d", d)
        .with("fill", color)
        .more(more)
        .end();
}

/// Names with their lines and marks, in rows from `top` on, and where they end.
fn legend(series: &[Series], left: f64, right: f64, top: f64) -> (Svg, f64) {
    let mut svg = Svg::default();
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
            let sample = path(&[[x, y - 2.5], [x + 16.0, y - 2.5]]);
            stroke(&mut svg, &sample, color, dash);
        }
        if !matches!(one.marks, Marks::Steps { .. }) {
            marks(&mut svg, one.slot, &[mark], 2.0, color, &[]);
        }
        text(&mut svg, [x + 19.0, y], "start", INK, &[], &name);
        x += length;
    }
    (svg, y + 4.0)
}

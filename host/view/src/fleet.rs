//! A run of a fleet at a glance: where robots stood still, and how many goals they reached.

use std::fmt::Write as _;

use fleetyard_core::Grid;

use crate::element::{BOX, Element, Short, Svg, push_line};
use crate::glyph;
use crate::palette::{AGENTS, GROUND, HEAT, INK, OBSTACLE, ROADMAP};

/// Pixels across, of map and curve alike.
const WIDTH: f64 = 960.0;

/// Pixels around everything.
const PAD: f64 = 16.0;

/// Height of letters in pixels.
const LETTER: f64 = 9.0;

/// Pixels of the map's height at most; a higher map is narrower.
const HIGHEST: f64 = 1600.0;

/// Height of the curve.
const CURVE: f64 = 220.0;

/// Decimals of coordinates.
const DECIMALS: usize = 1;

/// Intervals in which goals are counted for the curve, at most.
const INTERVALS: usize = 60;

/// The parts of a run that are shown.
#[derive(Debug, Clone, PartialEq)]
pub struct FleetPicture<'a> {
    /// Title; shown by viewers that show titles.
    pub title: String,
    /// The map.
    pub grid: &'a Grid,
    /// Per cell, row by row, for how many seconds robots stood still there.
    pub waiting_s: &'a [f64],
    /// Simulated seconds and goals that were reached until then, in order of time.
    pub goals: Vec<[f64; 2]>,
    /// Simulated seconds and calls of the fail policy until then, in order of time.
    pub recoveries: Vec<[f64; 2]>,
}

impl FleetPicture<'_> {
    /// The picture as an SVG document, one unit per pixel: the map with its cells coloured by
    /// how long robots stood still there (the square root of it is linear in the scale of
    /// colours below), the throughput over time with its mean, and marks where the fail
    /// policy was called. [`png`](crate::png) draws it.
    pub fn svg(&self) -> String {
        let (rows, cols) = (f64::from(self.grid.rows()), f64::from(self.grid.cols()));
        let side = ((WIDTH - 2.0 * PAD) / cols).min(HIGHEST / rows);
        let map_height = side * rows;
        let scale_top = PAD + map_height + 14.0;
        let curve_top = scale_top + 62.0;
        let height = curve_top + CURVE + 46.0;
        let sides = [WIDTH, height].map(short);
        let mut svg = Svg::default();
        svg.root([&sides[0], &sides[1]], sides).open();
        svg.element("title").words(&self.title);
        svg.ground();
        self.map(&mut svg, side);
        self.scale(&mut svg, scale_top);
        self.curve(&mut svg, curve_top);
        svg.finish()
    }

    fn longest_s(&self) -> f64 {
        let finite = self.waiting_s.iter().filter(|value| value.is_finite());
        finite.fold(0.0, |most, value| most.max(*value))
    }

    fn map(&self, svg: &mut Svg, side: f64) {
        let cols = self.grid.cols() as usize;
        let left = (WIDTH - side * cols as f64) / 2.0;
        let longest = self.longest_s();
        // The ground, what is solid, and every colour that occurs.
        let mut paths = vec![String::new(); HEAT.len() + 1];
        for (row, letters) in self.grid.terrain().chunks(cols).enumerate() {
            let shade = |col: usize| {
                if !Grid::letter_is_passable(letters[col]) {
                    return Some(HEAT.len());
                }
                let waited = self.waiting_s.get(row * cols + col).copied();
                let share = waited.unwrap_or(0.0) / longest;
                (share > 0.0).then(|| level(share))
            };
            let shades: Vec<Option<usize>> = (0..cols).map(shade).collect();
            let mut col = 0;
            for run in shades.chunk_by(|a, b| a == b) {
                if let Some(path) = run[0].and_then(|shade| paths.get_mut(shade)) {
                    let length = run.len();
                    let _ = write!(path, "M{col} {row}h{length}v1h-{length}z");
                }
                col += run.len();
            }
        }
        let (x, y, scale) = (short(left), short(PAD), Short(side, 4));
        svg.element("g")
            .with(
                "transform",
                format_args!("translate({x} {y}) scale({scale})"),
            )
            .with("shape-rendering", "crispEdges")
            .open();
        svg.element("rect")
            .with("width", cols)
            .with("height", self.grid.rows())
            .with("fill", GROUND)
            .end();
        for (path, color) in paths.iter().zip(HEAT.iter().chain([&OBSTACLE])) {
            if !path.is_empty() {
                svg.element("path")
                    .with("fill", color)
                    .with("d", path)
                    .end();
            }
        }
        svg.close("g");
        frame(
            svg,
            [left, PAD],
            [side * cols as f64, side * f64::from(self.grid.rows())],
        );
    }

    /// The colours and what they stand for.
    fn scale(&self, svg: &mut Svg, top: f64) {
        let longest = self.longest_s();
        let (left, width, height) = (PAD, 320.0, 12.0);
        let step = width / HEAT.len() as f64;
        for (at, color) in HEAT.iter().enumerate() {
            let sides = [left + at as f64 * step, top, step, height];
            svg.element("rect")
                .numbers(BOX, sides.map(short))
                .with("fill", color)
                .end();
        }
        frame(svg, [left, top], [width, height]);
        let mut lines = Vec::new();
        let base = top + height + 5.0;
        for quarter in 0..5 {
            let share = f64::from(quarter) / 4.0;
            let text = short_number(share * share * longest);
            let wide = glyph::width(&text, LETTER);
            let middle = (left + share * width - wide / 2.0).max(left);
            lines.extend(glyph::lines(&text, middle, base, LETTER));
        }
        let text = "seconds that robots stood still in a cell";
        lines.extend(glyph::lines(text, left + width + 24.0, top + 1.0, LETTER));
        strokes(svg, &lines, INK, 1.1);
    }

    /// Goals per second in equal intervals of the run.
    fn throughput(&self) -> Vec<[f64; 2]> {
        let Some([end, _]) = self.goals.last().copied().filter(|[end, _]| *end > 0.0) else {
            return Vec::new();
        };
        let intervals = (self.goals.len() - 1).clamp(1, INTERVALS);
        let width = end / intervals as f64;
        // Goals until a moment: those of the last point that is not after it.
        let until = |time: f64| {
            let after = self.goals.partition_point(|[at, _]| *at <= time + 1e-9);
            after.checked_sub(1).map_or(0.0, |at| self.goals[at][1])
        };
        (0..intervals)
            .map(|interval| {
                let (from, to) = (interval as f64 * width, (interval + 1) as f64 * width);
                [f64::midpoint(from, to), (until(to) - until(from)) / width]
            })
            .collect()
    }

    fn curve(&self, svg: &mut Svg, top: f64) {
        let points = self.throughput();
        let end = self.goals.last().map_or(1.0, |[end, _]| end.max(1e-9));
        let most = points
            .iter()
            .fold(0.0_f64, |most, [_, rate]| most.max(*rate));
        let (x_step, y_step) = (round_step(end / 6.0), round_step(most / 4.0));
        let highest = (most / y_step).ceil().max(1.0) * y_step;
        let (left, right, bottom) = (PAD + 48.0, WIDTH - 2.0 * PAD, top + CURVE);
        let x = |time: f64| left + time / end * (right - left);
        let y = |rate: f64| bottom - rate / highest * CURVE;
        let mut rules = String::new();
        let mut text = Vec::new();
        for tick in 0..=(highest / y_step).round() as u32 {
            let rate = f64::from(tick) * y_step;
            let _ = write!(
                rules,
                "M{} {}H{}",
                short(left),
                short(y(rate)),
                short(right)
            );
            let label = short_number(rate);
            let at = left - 6.0 - glyph::width(&label, LETTER);
            text.extend(glyph::lines(&label, at, y(rate) - LETTER / 2.0, LETTER));
        }
        for tick in 0..=(end / x_step + 1e-9).floor() as u32 {
            let time = f64::from(tick) * x_step;
            let _ = write!(rules, "M{} {}v5", short(x(time)), short(bottom));
            let label = short_number(time);
            let at = x(time) - glyph::width(&label, LETTER) / 2.0;
            text.extend(glyph::lines(&label, at, bottom + 9.0, LETTER));
        }
        path(svg, ROADMAP).with("d", rules).end();
        text.extend(glyph::lines("goals per second", left, top - 20.0, LETTER));
        let unit = "simulated seconds";
        let at = right - glyph::width(unit, LETTER);
        text.extend(glyph::lines(unit, at, bottom + 26.0, LETTER));
        // Where the fail policy was called since the moment before.
        let calls = self
            .recoveries
            .windows(2)
            .filter(|pair| pair[1][1] > pair[0][1]);
        let mut marks = String::new();
        for pair in calls {
            let _ = write!(marks, "M{} {}v-8", short(x(pair[1][0])), short(bottom));
        }
        let [line, mark] = [AGENTS[0], AGENTS[1]];
        if !marks.is_empty() {
            let note = "calls of the fail policy";
            path(svg, mark)
                .with("stroke-width", 1.5)
                .with("d", marks)
                .titled(note);
            let at = left + glyph::width("goals per second", LETTER) + 40.0;
            let sample = format!("M{} {}v-8", short(at), short(top - 11.0));
            path(svg, mark)
                .with("stroke-width", 1.5)
                .with("d", sample)
                .end();
            text.extend(glyph::lines(note, at + 8.0, top - 20.0, LETTER));
        }
        let mean = self.goals.last().map_or(0.0, |[_, goals]| goals / end);
        let level = format!("M{} {}H{}", short(left), short(y(mean)), short(right));
        path(svg, line)
            .with("stroke-dasharray", "6 4")
            .with("d", level)
            .titled(&format!("mean: {} goals per second", Short(mean, 4)));
        let mut data = String::new();
        push_line(
            &mut data,
            points.iter().map(|[time, rate]| [x(*time), y(*rate)]),
            DECIMALS,
        );
        if !data.is_empty() {
            path(svg, line)
                .with("stroke-width", 2)
                .with("stroke-linejoin", "round")
                .with("d", data)
                .end();
        }
        strokes(svg, &text, INK, 1.1);
    }
}

/// Number of the colour for a share of the longest time.
fn level(share: f64) -> usize {
    let colors = HEAT.len();
    ((share.sqrt() * colors as f64).ceil() as usize).clamp(1, colors) - 1
}

fn frame(svg: &mut Svg, [x, y]: [f64; 2], [width, height]: [f64; 2]) {
    svg.element("rect")
        .numbers(BOX, [x, y, width, height].map(short))
        .with("fill", "none")
        .with("stroke", ROADMAP)
        .end();
}

/// A line without ground.
fn path<'a>(svg: &'a mut Svg, color: &str) -> Element<'a> {
    svg.element("path")
        .with("fill", "none")
        .with("stroke", color)
}

fn strokes(svg: &mut Svg, lines: &[Vec<[f64; 2]>], color: &str, width: f64) {
    let mut data = String::new();
    for line in lines {
        push_line(&mut data, line.iter().copied(), DECIMALS);
    }
    path(svg, color)
        .with("stroke-width", width)
        .with("stroke-linejoin", "round")
        .with("d", data)
        .end();
}

/// The smallest of 1, 2 and 5 times a power of ten that is not below a number.
fn round_step(least: f64) -> f64 {
    if !(least.is_finite() && least > 0.0) {
        return 1.0;
    }
    let power = 10f64.powf(least.log10().floor());
    let steps = [1.0, 2.0, 5.0].into_iter().map(|digit| digit * power);
    steps
        .into_iter()
        .find(|step| *step >= least * 0.999_999)
        .unwrap_or(10.0 * power)
}

/// A number for people, in three digits or as whole.
fn short_number(value: f64) -> String {
    let decimals = match value.abs() {
        size if size >= 100.0 => 0,
        size if size >= 10.0 => 1,
        _ => 2,
    };
    Short(value, decimals).to_string()
}

/// A coordinate in tenths of a pixel.
fn short(value: f64) -> Short {
    Short(value, DECIMALS)
}

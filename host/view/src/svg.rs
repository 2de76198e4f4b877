//! Still pictures as SVG: map, paths, starts, goals, and, at a moment of an
//! execution, footprints and contacts.

use std::fmt::Write as _;

use fleetyard_core::{Annotation, Grid, GridPlan, Shape, TrajectoryPlan, cell_center_m};
use fleetyard_sim::trace::Outline;

use crate::element::{BOX, Element, Short, Svg};
use crate::glyph;
use crate::layers::{Layer, Layers};
use crate::palette::{AGENTS, CONTACT, GROUND, INK, OBSTACLE, ROADMAP};
use crate::world::{World, floor_exponent};

/// The longer side of a picture in pixels, at least and at most; in between, a
/// cell gets two.
const SIDE: (f64, f64) = (960.0, 4096.0);

/// Height of the strip with the scale in pixels, and of a line of the legend below it.
const FOOTER: f64 = 34.0;
const LEGEND: f64 = 20.0;

/// The distance of an outline's farthest point from the position.
pub(crate) fn reach_m(outline: &Outline) -> f64 {
    match outline {
        Outline::Disc { radius_m } => *radius_m,
        Outline::Polygon { vertices_m } => {
            let distances = vertices_m.iter().map(|[x, y]| (x * x + y * y).sqrt());
            distances.fold(0.0, f64::max)
        }
    }
}

/// An agent at a moment.
#[derive(Debug, Clone, PartialEq)]
pub struct Body {
    /// Position.
    pub at_m: [f64; 2],
    /// Heading, if it has one.
    pub heading_rad: Option<f64>,
    /// Its outline around that.
    pub outline: Outline,
}

/// The content of a picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture<'a> {
    /// The map.
    pub world: &'a World,
    /// The ways of the agents. Where they begin is marked with a ring.
    pub paths: Vec<Vec<[f64; 2]>>,
    /// Goal of each agent, in metres, marked with a square.
    pub goals: Vec<Option<[f64; 2]>>,
    /// The agents at a moment; none if the picture is of a plan.
    pub bodies: Vec<Body>,
    /// Places to be pointed at.
    pub contacts: Vec<[f64; 2]>,
    /// The moment, which is written below.
    pub time_s: Option<f64>,
    /// Annotations by layer, with a legend below.
    pub layers: Layers,
}

impl<'a> Picture<'a> {
    /// A map and nothing else.
    pub fn new(world: &'a World) -> Self {
        Self {
            world,
            paths: Vec::new(),
            goals: Vec::new(),
            bodies: Vec::new(),
            contacts: Vec::new(),
            time_s: None,
            layers: Layers::default(),
        }
    }

    /// Adds what the planner wants to show.
    #[must_use]
    pub fn layers(self, layers: Layers) -> Self {
        Self { layers, ..self }
    }

    /// Adds the paths of a grid plan; goals are the paths' ends. Cells that are
    /// not on the map are left out.
    #[must_use]
    pub fn plan(mut self, grid: &Grid, plan: &GridPlan) -> Self {
        let cells = plan.paths().map(|path| self.centers(grid, path));
        self.paths = cells.collect();
        self.end_at_goals()
    }

    /// Adds the paths of a plan in the plane; goals are the paths' ends.
    #[must_use]
    pub fn trajectories(mut self, plan: &TrajectoryPlan) -> Self {
        let points = |path: fleetyard_core::Knots<'_>| {
            let points = path.x_m.iter().zip(path.y_m);
            points.map(|(x, y)| [*x, *y]).collect()
        };
        self.paths = plan.paths().map(points).collect();
        self.end_at_goals()
    }

    /// Sets goals that need not be the paths' ends.
    #[must_use]
    pub fn goals(mut self, grid: &Grid, goals: &[u32]) -> Self {
        let center = |goal: &u32| self.centers(grid, &[*goal]).first().copied();
        self.goals = goals.iter().map(center).collect();
        self
    }

    /// Sets starts and goals in metres, without paths between them.
    #[must_use]
    pub fn ends(mut self, ends: impl IntoIterator<Item = ([f64; 2], [f64; 2])>) -> Self {
        (self.paths, self.goals) = ends
            .into_iter()
            .map(|(start, goal)| (vec![start], Some(goal)))
            .unzip();
        self
    }

    fn end_at_goals(mut self) -> Self {
        self.goals = self.paths.iter().map(|path| path.last().copied()).collect();
        self
    }

    fn centers(&self, grid: &Grid, cells: &[u32]) -> Vec<[f64; 2]> {
        let side = self.world.cells.as_ref().map_or(1.0, |cells| cells.side_m);
        let on_map = cells.iter().filter(|cell| **cell < grid.cell_count());
        on_map
            .map(|cell| cell_center_m(grid, side, *cell).into())
            .collect()
    }

    /// The picture as an SVG document, one unit per metre.
    pub fn svg(&self) -> String {
        let mut canvas = Canvas::new(self.world, &self.bodies, &self.layers);
        canvas.open(self.world);
        canvas.beyond(&self.world.outline);
        canvas.roadmap(&self.world.roadmap);
        canvas.obstacles(self.world);
        let agents = self.paths.len().max(self.bodies.len());
        // Lines, such as those of a search tree, would hide the plan.
        let lines = |layer: &&Layer| {
            layer
                .annotations
                .iter()
                .all(|one| one.shape == Shape::Lines)
        };
        let (below, above): (Vec<_>, Vec<_>) = self.layers.all.iter().partition(lines);
        canvas.layers(&below);
        canvas.paths(&self.paths, agents, !self.bodies.is_empty());
        canvas.layers(&above);
        canvas.goals(&self.goals);
        if self.bodies.is_empty() {
            canvas.starts(&self.paths);
        }
        canvas.bodies(&self.bodies);
        canvas.contacts(&self.contacts);
        canvas.footer(self.time_s);
        canvas.legend(&self.layers);
        canvas.svg.finish()
    }
}

/// The document, and how the world lies on it: the map's upper left corner is the
/// origin, y grows down.
struct Canvas {
    svg: Svg,
    left_m: f64,
    top_m: f64,
    width_m: f64,
    height_m: f64,
    /// A pixel in metres, at the size that the document asks for.
    pixel_m: f64,
    /// Height of the strip with the scale below the map.
    footer_m: f64,
    /// A small length of the world that is at least a few pixels.
    unit_m: f64,
    /// Digits after the point that are worth writing.
    decimals: usize,
}

impl Canvas {
    fn new(world: &World, bodies: &[Body], layers: &Layers) -> Self {
        let [width_m, height_m] = world.size_m().map(|side| side.max(1e-9));
        let side = width_m.max(height_m);
        let largest = bodies.iter().map(|body| reach_m(&body.outline));
        let unit_m = match &world.cells {
            Some(cells) => cells.side_m,
            None if bodies.is_empty() => side / 100.0,
            None => 2.0 * largest.fold(0.005 * side, f64::max),
        };
        let pixels = (2.0 * side / unit_m).clamp(SIDE.0, SIDE.1);
        let pixel_m = side / pixels;
        // A tenth of a pixel can be seen when one zooms in; a hundredth cannot.
        Self {
            svg: Svg::default(),
            left_m: world.bounds.min[0],
            top_m: world.bounds.max[1],
            width_m,
            height_m,
            pixel_m,
            footer_m: (FOOTER + LEGEND * layers.all.len() as f64) * pixel_m,
            unit_m: unit_m.max(5.0 * pixel_m),
            decimals: (-floor_exponent(pixel_m / 100.0)).clamp(0, 9) as usize,
        }
    }

    fn number(&self, value: f64) -> Short {
        Short(value, self.decimals)
    }

    /// A point of the world on the document.
    fn place(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [x - self.left_m, self.top_m - y]
    }

    /// A broken line through points of the document, as path data. Points
    /// between which the direction does not change are left out.
    fn line(&self, points: impl IntoIterator<Item = [f64; 2]>) -> String {
        let mut corners: Vec<[f64; 2]> = Vec::new();
        for [x, y] in points {
            if corners.last() == Some(&[x, y]) {
                continue;
            }
            if let [.., [ax, ay], [bx, by]] = corners[..] {
                let (ux, uy, vx, vy) = (bx - ax, by - ay, x - bx, y - by);
                let size = (ux * ux + uy * uy) * (vx * vx + vy * vy);
                if (ux * vy - uy * vx).powi(2) <= 1e-12 * size && ux * vx + uy * vy > 0.0 {
                    corners.pop();
                }
            }
            corners.push([x, y]);
        }
        let mut data = String::new();
        let mut last = [String::new(), String::new()];
        for (at, point) in corners.into_iter().enumerate() {
            let [x, y] = point.map(|value| self.number(value).to_string());
            let _ = match (at, x == last[0], y == last[1]) {
                (0, ..) => write!(data, "M{x} {y}"),
                (_, true, true) => Ok(()),
                (_, true, false) => write!(data, "V{y}"),
                (_, false, true) => write!(data, "H{x}"),
                (_, false, false) => write!(data, "L{x} {y}"),
            };
            last = [x, y];
        }
        data
    }

    fn open(&mut self, world: &World) {
        let (width_m, height_m) = (self.width_m, self.height_m + self.footer_m);
        let pixels = [width_m, height_m].map(|side| Short(side / self.pixel_m, 0));
        let view = [width_m, height_m].map(|side| self.number(side));
        self.svg.root([&pixels[0], &pixels[1]], view).open();
        self.svg.element("title").words(&world.name);
        for (height_m, color) in [(height_m, "#fff"), (self.height_m, GROUND)] {
            let sides = [width_m, height_m].map(|side| self.number(side));
            let ground = self.svg.element("rect").numbers(["width", "height"], sides);
            ground.with("fill", color).end();
        }
    }

    /// Draws the area between the edge of the world and the edge of the picture.
    fn beyond(&mut self, outline: &[[f64; 2]]) {
        if outline.is_empty() {
            return;
        }
        let (width, height) = (self.number(self.width_m), self.number(self.height_m));
        let edge = self.line(outline.iter().map(|corner| self.place(*corner)));
        self.svg
            .element("path")
            .with("fill", OBSTACLE)
            .with("fill-rule", "evenodd")
            .with("d", format_args!("M0 0H{width}V{height}H0z{edge}z"))
            .end();
    }

    /// A line of a color and width.
    fn stroke(&mut self, color: &str, width: f64) -> Element<'_> {
        let width = self.number(width);
        self.svg
            .element("path")
            .with("fill", "none")
            .with("stroke", color)
            .with("stroke-width", width)
    }

    fn roadmap(&mut self, edges: &[[[f64; 2]; 2]]) {
        if edges.is_empty() {
            return;
        }
        let lines = edges.iter().map(|edge| {
            let ends = edge.map(|end| self.place(end));
            self.line(ends)
        });
        let data: String = lines.collect();
        self.stroke(ROADMAP, 1.2 * self.pixel_m)
            .with("d", data)
            .end();
    }

    fn obstacles(&mut self, world: &World) {
        if let Some(cells) = &world.cells {
            let mut data = String::new();
            for rectangle in &cells.rectangles {
                let [y, x, height, width] =
                    rectangle.map(|side| self.number(f64::from(side) * cells.side_m));
                let _ = write!(data, "M{x} {y}h{width}v{height}h-{width}z");
            }
            // Without blur, so that no seams show between rectangles.
            let cells = self.svg.element("path").with("fill", OBSTACLE);
            cells
                .with("shape-rendering", "crispEdges")
                .with("d", data)
                .end();
        }
        if !world.polygons.is_empty() {
            let mut data = String::new();
            for polygon in &world.polygons {
                data += &self.line(polygon.iter().map(|corner| self.place(*corner)));
                data.push('z');
            }
            let polygons = self.svg.element("path").with("fill", OBSTACLE);
            polygons.with("d", data).end();
        }
    }

    /// Opens a group of each colour in turn and lets `each` draw the agents that
    /// have it.
    fn by_color(
        &mut self,
        agents: usize,
        open: impl Fn(Element<'_>, &str),
        mut each: impl FnMut(&mut Self, usize),
    ) {
        for (first, color) in AGENTS.iter().enumerate().take(agents) {
            let before = self.svg.text.len();
            open(self.svg.element("g"), color);
            let opened = self.svg.text.len();
            for agent in (first..agents).step_by(AGENTS.len()) {
                each(self, agent);
            }
            if self.svg.text.len() == opened {
                self.svg.text.truncate(before);
            } else {
                self.svg.close("g");
            }
        }
    }

    fn paths(&mut self, paths: &[Vec<[f64; 2]>], agents: usize, faint: bool) {
        if paths.is_empty() {
            return;
        }
        // Crowded pictures need thin, translucent lines.
        let room = self.width_m * self.height_m / (self.unit_m * self.unit_m);
        let opacity = (0.9 - 3.0 * agents as f64 / room).clamp(0.35, 0.85);
        let opacity = if faint { 0.5 * opacity } else { opacity };
        let width = self.number(0.16 * self.unit_m);
        let open = |group: Element<'_>, color: &str| {
            group
                .with("fill", "none")
                .with("stroke", color)
                .with("stroke-width", width)
                .with("stroke-opacity", format_args!("{opacity:.2}"))
                .with("stroke-linejoin", "round")
                .with("stroke-linecap", "round")
                .open();
        };
        self.by_color(paths.len(), open, |canvas, agent| {
            let data = canvas.line(paths[agent].iter().map(|point| canvas.place(*point)));
            if data.contains(['H', 'V', 'L']) {
                canvas.path(&data);
            }
        });
    }

    /// Each layer as a group with its name, so that a program can hide it.
    fn layers(&mut self, layers: &[&Layer]) {
        for layer in layers {
            self.svg
                .element("g")
                .with("class", "layer")
                .with("stroke-linejoin", "round")
                .with("stroke-linecap", "round")
                .open();
            self.svg.element("title").words(&layer.name);
            for annotation in &layer.annotations {
                self.annotation(layer, annotation);
            }
            self.svg.close("g");
        }
    }

    fn annotation(&mut self, layer: &Layer, annotation: &Annotation) {
        let least = if annotation.shape == Shape::Lines {
            1.0
        } else {
            1.6
        };
        let width = self.number((0.1 * self.unit_m).max(least * self.pixel_m));
        let radius = 0.2 * self.unit_m;
        let words = words(annotation);
        for (number, points) in annotation.xy_m.iter().enumerate() {
            let color = layer.color_of(annotation.values.get(number).copied());
            let mut data = match annotation.shape {
                Shape::Points => String::new(),
                Shape::Places | Shape::Lines | Shape::Rings => {
                    self.line(points.iter().map(|point| self.place(*point)))
                }
            };
            let is_ring = annotation.shape == Shape::Rings && points.len() > 2;
            if is_ring {
                data.push('z');
            }
            if is_ring || data.contains(['H', 'V', 'L']) {
                self.svg
                    .element("path")
                    .with("fill", if is_ring { color } else { "none" })
                    .with("fill-opacity", 0.15)
                    .with("stroke", color)
                    .with("stroke-width", width)
                    .with("d", data)
                    .told(&words);
            }
            let marked = match annotation.shape {
                Shape::Points | Shape::Places => points,
                Shape::Lines | Shape::Rings => &[],
            };
            for point in marked {
                let [x, y] = self.place(*point);
                let mark = if annotation.shape == Shape::Points {
                    let numbers = [x, y, radius].map(|value| self.number(value));
                    let circle = self.svg.element("circle");
                    circle.numbers(["cx", "cy", "r"], numbers)
                } else {
                    let half = 0.42 * self.unit_m;
                    let sides = [x - half, y - half, 2.0 * half, 2.0 * half];
                    let sides = sides.map(|value| self.number(value));
                    self.svg.element("rect").numbers(BOX, sides)
                };
                mark.with("fill", color)
                    .with("fill-opacity", 0.3)
                    .with("stroke", color)
                    .with("stroke-width", width)
                    .told(&words);
            }
        }
    }

    /// The names of layers and how much they have, each on a line below the scale.
    fn legend(&mut self, layers: &Layers) {
        let pixel = self.pixel_m;
        let side = 11.0 * pixel;
        for (number, layer) in layers.all.iter().enumerate() {
            let top = self.height_m + (FOOTER + LEGEND * number as f64) * pixel;
            let sides = [8.0 * pixel, top, side, side].map(|value| self.number(value));
            self.svg
                .element("rect")
                .numbers(BOX, sides)
                .with("fill", layer.color)
                .end();
            let text = format!("{} {}", layer.annotations.len(), layer.name);
            let drawn = text.to_lowercase();
            let lines = glyph::lines(&drawn, 28.0 * pixel, top, side);
            let data: String = lines.into_iter().map(|line| self.line(line)).collect();
            self.stroke(INK, 1.5 * pixel)
                .with("stroke-linejoin", "round")
                .with("d", data)
                .titled(&text);
        }
    }

    fn goals(&mut self, goals: &[Option<[f64; 2]>]) {
        let side = 0.56 * self.unit_m;
        let open = |group: Element<'_>, color: &str| group.with("fill", color).open();
        self.by_color(goals.len(), open, |canvas, agent| {
            if let Some(goal) = goals[agent] {
                let [x, y] = canvas.place(goal).map(|middle| middle - side / 2.0);
                let sides = [x, y, side, side].map(|value| canvas.number(value));
                canvas.svg.element("rect").numbers(BOX, sides).end();
            }
        });
    }

    /// Above the goals, open in the middle: a start on another's goal shows both.
    fn starts(&mut self, paths: &[Vec<[f64; 2]>]) {
        let (radius, width) = (0.3 * self.unit_m, self.number(0.14 * self.unit_m));
        let open = |group: Element<'_>, color: &str| {
            let ring = group.with("fill", "#fff").with("fill-opacity", 0.75);
            ring.with("stroke", color)
                .with("stroke-width", width)
                .open();
        };
        self.by_color(paths.len(), open, |canvas, agent| {
            if let Some(start) = paths[agent].first() {
                canvas.circle(*start, radius);
            }
        });
    }

    fn path(&mut self, data: &str) {
        self.svg.element("path").with("d", data).end();
    }

    fn circle(&mut self, center: [f64; 2], radius: f64) {
        let [x, y] = self.place(center);
        let numbers = [x, y, radius].map(|value| self.number(value));
        self.svg
            .element("circle")
            .numbers(["cx", "cy", "r"], numbers)
            .end();
    }

    fn bodies(&mut self, bodies: &[Body]) {
        let large = bodies
            .iter()
            .all(|body| reach_m(&body.outline) > 4.0 * self.pixel_m);
        // Small bodies are dots; an outline would swallow them.
        let edge = self.number(if large { 1.2 * self.pixel_m } else { 0.0 });
        let open = |group: Element<'_>, color: &str| {
            let ground = group.with("fill", color).with("stroke", INK);
            ground.with("stroke-width", edge).open();
        };
        self.by_color(bodies.len(), open, |canvas, agent| {
            let body = &bodies[agent];
            match &body.outline {
                Outline::Disc { radius_m } => {
                    canvas.circle(body.at_m, radius_m.max(1.5 * canvas.pixel_m));
                }
                Outline::Polygon { vertices_m } => {
                    let (sin, cos) = libm::sincos(body.heading_rad.unwrap_or(0.0));
                    let [x, y] = body.at_m;
                    let corners = vertices_m
                        .iter()
                        .map(|[a, b]| canvas.place([x + a * cos - b * sin, y + a * sin + b * cos]));
                    let data = canvas.line(corners);
                    canvas.path(&(data + "z"));
                }
            }
        });
        if large {
            let noses = bodies.iter().filter_map(|body| {
                let (sin, cos) = libm::sincos(body.heading_rad?);
                let ([x, y], reach) = (body.at_m, reach_m(&body.outline));
                let nose = [x + reach * cos, y + reach * sin];
                Some(self.line([body.at_m, nose].map(|point| self.place(point))))
            });
            let data: String = noses.collect();
            if !data.is_empty() {
                self.stroke(INK, 1.6 * self.pixel_m).with("d", data).end();
            }
        }
    }

    /// A ring with a cross in it, on a halo of white.
    fn contacts(&mut self, contacts: &[[f64; 2]]) {
        if contacts.is_empty() {
            return;
        }
        let radius = (0.6 * self.unit_m).max(7.0 * self.pixel_m);
        let arm = radius * 0.45;
        for (color, width) in [("#fff", 5.0), (CONTACT, 2.4)] {
            let width = self.number(width * self.pixel_m);
            let group = self.svg.element("g").with("fill", "none");
            group
                .with("stroke", color)
                .with("stroke-width", width)
                .open();
            for place in contacts {
                self.circle(*place, radius);
                let [x, y] = self.place(*place);
                let cross = self.line([[x - arm, y - arm], [x + arm, y + arm]])
                    + &self.line([[x - arm, y + arm], [x + arm, y - arm]]);
                self.path(&cross);
            }
            self.svg.close("g");
        }
    }

    /// The scale, and the time if there is one.
    fn footer(&mut self, time_s: Option<f64>) {
        let length = round_length(0.2 * self.width_m);
        let text = if length < 1000.0 {
            format!("{length} m")
        } else {
            format!("{} km", length / 1000.0)
        };
        let pixel = self.pixel_m;
        let (left, base) = (8.0 * pixel, self.height_m + 20.0 * pixel);
        let (top, size) = (base - 6.0 * pixel, 11.0 * pixel);
        let letters_top = base - size;
        let mut lines = vec![
            vec![[left, top], [left, base], [left + length, base]],
            vec![[left + length, base], [left + length, top]],
        ];
        lines.extend(glyph::lines(&text, left + length + size, letters_top, size));
        if let Some(time_s) = time_s {
            let text = format!("t = {time_s:.1} s");
            let width = text.chars().count() as f64 * size * 5.5 / 6.0;
            let left = self.width_m - width - 4.0 * pixel;
            lines.extend(glyph::lines(&text, left, letters_top, size));
        }
        let data: String = lines.into_iter().map(|line| self.line(line)).collect();
        self.stroke(INK, 1.5 * pixel)
            .with("stroke-linejoin", "round")
            .with("d", data)
            .titled(&format!("scale: {text}"));
    }
}

/// An annotation in words: its agent, its time and its text.
fn words(annotation: &Annotation) -> String {
    let agent = annotation.agent.map(|agent| format!("agent {agent}"));
    let (from_s, to_s) = (annotation.from_s, annotation.to_s);
    let span = match to_s {
        Some(to_s) => Some(format!("{from_s} to {to_s} s")),
        None => (from_s > 0.0).then(|| format!("from {from_s} s on")),
    };
    let text = Some(annotation.text.clone()).filter(|text| !text.is_empty());
    let words: Vec<String> = [agent, span, text].into_iter().flatten().collect();
    words.join(", ")
}

/// The largest of 1, 2 and 5 times a power of ten that is not above a length.
fn round_length(most: f64) -> f64 {
    let power = 10f64.powi(floor_exponent(most));
    let digit = [5.0, 2.0, 1.0]
        .into_iter()
        .find(|digit| digit * power <= most);
    digit.unwrap_or(1.0) * power
}

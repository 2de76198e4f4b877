//! Pictures of plans as SVG: map, paths, starts and goals.

use std::fmt::Write as _;

use fleetyard_core::{Grid, GridPlan};

/// The longer side of a picture in pixels, at least.
const SIDE: f64 = 960.0;

/// Draws a map and, if there is one, a plan. Goals are the paths' ends unless
/// they are given. Starts are rings, goals squares, both in the agent's colour.
pub(crate) fn svg(grid: &Grid, plan: Option<&GridPlan>, goals: Option<&[u32]>) -> String {
    let (rows, cols) = (grid.rows(), grid.cols());
    let scale = (SIDE / f64::from(rows.max(cols))).max(2.0);
    let (width, height) = (f64::from(cols) * scale, f64::from(rows) * scale);
    let mut out = String::new();
    // Writing to a string cannot fail. One unit is one cell.
    let _ = writeln!(
        out,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.0}\" height=\"{height:.0}\" \
         viewBox=\"0 0 {cols} {rows}\">"
    );
    let _ = writeln!(out, "<title>{}</title>", escape(grid.name()));
    let _ = writeln!(
        out,
        "<rect width=\"{cols}\" height=\"{rows}\" fill=\"#fbfaf7\"/>"
    );
    obstacles(&mut out, grid);
    if let Some(plan) = plan {
        paths(&mut out, grid, plan, goals);
    }
    out.push_str("</svg>\n");
    out
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;")
}

/// Runs of blocked cells, row by row, as one path.
fn obstacles(out: &mut String, grid: &Grid) {
    out.push_str("<path fill=\"#3c4043\" shape-rendering=\"crispEdges\" d=\"");
    for row in 0..grid.rows() {
        let blocked = |col: u32| !grid.is_passable(row * grid.cols() + col);
        let mut col = 0;
        while col < grid.cols() {
            let start = col;
            while col < grid.cols() && blocked(col) {
                col += 1;
            }
            if col > start {
                let length = col - start;
                let _ = write!(out, "M{start} {row}h{length}v1h-{length}z");
            }
            col += 1;
        }
    }
    out.push_str("\"/>\n");
}

fn paths(out: &mut String, grid: &Grid, plan: &GridPlan, goals: Option<&[u32]>) {
    let agents = plan.agents();
    // Crowded pictures need thin, translucent lines.
    let crowd = agents as f64 / f64::from(grid.passable_count().max(1));
    let opacity = (0.9 - 3.0 * crowd).clamp(0.35, 0.85);
    let at = |cell: u32| {
        let (row, col) = grid.row_col(cell);
        (f64::from(col) + 0.5, f64::from(row) + 0.5)
    };
    let _ = writeln!(
        out,
        "<g fill=\"none\" stroke-width=\"0.16\" stroke-opacity=\"{opacity:.2}\" \
         stroke-linejoin=\"round\" stroke-linecap=\"round\">"
    );
    for (agent, path) in plan.paths().enumerate() {
        let on_map = path
            .iter()
            .copied()
            .filter(|cell| *cell < grid.cell_count());
        let mut points: Vec<(f64, f64)> = Vec::new();
        for point in on_map.map(at) {
            // Only corners matter.
            if let [.., (ax, ay), (bx, by)] = points[..]
                && ((bx - ax) * (point.1 - by) - (by - ay) * (point.0 - bx)).abs() < 1e-9
                && (bx - ax) * (point.0 - bx) + (by - ay) * (point.1 - by) >= 0.0
            {
                points.pop();
            }
            points.push(point);
        }
        if points.len() > 1 {
            let text: Vec<String> = points.iter().map(|(x, y)| format!("{x},{y}")).collect();
            let (color, points) = (color(agent), text.join(" "));
            let _ = writeln!(out, "<polyline stroke=\"{color}\" points=\"{points}\"/>");
        }
    }
    out.push_str("</g>\n");
    let on_map = |cell: &u32| *cell < grid.cell_count();
    for (agent, path) in plan.paths().enumerate() {
        let goal = goals.and_then(|goals| goals.get(agent)).or(path.last());
        if let Some((x, y)) = goal.copied().filter(on_map).map(at) {
            let (x, y, color) = (x - 0.28, y - 0.28, color(agent));
            let _ = writeln!(
                out,
                "<rect x=\"{x}\" y=\"{y}\" width=\"0.56\" height=\"0.56\" fill=\"{color}\"/>"
            );
        }
    }
    // Above the goals, open in the middle: a start on another's goal shows both.
    for (agent, path) in plan.paths().enumerate() {
        if let Some((x, y)) = path.first().copied().filter(on_map).map(at) {
            let color = color(agent);
            let _ = writeln!(
                out,
                "<circle cx=\"{x}\" cy=\"{y}\" r=\"0.3\" fill=\"#fff\" fill-opacity=\"0.75\" \
                 stroke=\"{color}\" stroke-width=\"0.14\"/>"
            );
        }
    }
}

/// Well-spread hues by the golden angle, at two lightnesses.
fn color(agent: usize) -> String {
    let hue = (agent * 1375 / 10) % 360;
    let lightness = if agent.is_multiple_of(2) { 42 } else { 55 };
    format!("hsl({hue},70%,{lightness}%)")
}

//! The shortest way of the first robot of a file of tasks in the plane: `tangent TASKS`.

#[path = "../../bundle/tests/it/plane/support.rs"]
mod support;

use std::error::Error;
use std::time::Instant;

use fleetyard_plugin_plane::obstacles::Obstacles;
use fleetyard_plugin_plane::tangent::Tangents;

fn main() -> Result<(), Box<dyn Error>> {
    let tasks = std::env::args().nth(1).ok_or("tangent TASKS")?;
    let case = support::Case::read(tasks.as_ref(), 1)?;
    let disc = case.discs.first().ok_or("no robot")?;
    let begin = Instant::now();
    let obstacles = Obstacles::new(case.polygons, case.bounds, disc.radius);
    let mut tangents = Tangents::new(&obstacles);
    let way = tangents.shortest(disc.start, disc.goal, &mut || false);
    let seconds = begin.elapsed().as_secs_f64();
    let corners = obstacles.corners().count();
    let (offered, tested, expanded) = (tangents.offered, tangents.tested, tangents.expanded);
    let length = way.map_or("no way".into(), |way| format!("{:.4} m", way.length));
    println!(
        "{length}, {corners} corners, {expanded} places, {offered} tangents, {tested} tests, {seconds:.5} s"
    );
    Ok(())
}

//! The shortest way of the first robot of a file of tasks in the plane: `tangent TASKS`.

use std::error::Error;
use std::fs;
use std::path::Path;
use std::time::Instant;

use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_plane::bins::Rectangle;
use fleetyard_plugin_plane::obstacles::Obstacles;
use fleetyard_plugin_plane::tangent::Tangents;
use serde_json::Value;

fn main() -> Result<(), Box<dyn Error>> {
    let file = std::env::args().nth(1).ok_or("tangent TASKS")?;
    let file = Path::new(&file);
    let tasks: Value = serde_json::from_str(&fs::read_to_string(file)?)?;
    let world = tasks["world"].as_str().ok_or("no world")?;
    let world = file.parent().unwrap_or(Path::new(".")).join(world);
    let world: Value = serde_json::from_str(&fs::read_to_string(world)?)?;
    let numbers = |value: &Value| -> Vec<f64> {
        value
            .as_array()
            .into_iter()
            .flatten()
            .filter_map(Value::as_f64)
            .collect()
    };
    let place = |value: &Value| {
        let numbers = numbers(value);
        Vector::new(numbers[0], numbers[1])
    };
    let bounds = numbers(&world["bounds_m"]);
    let bounds = Rectangle {
        min: Vector::new(bounds[0], bounds[1]),
        max: Vector::new(bounds[2], bounds[3]),
    };
    let polygons = world["obstacles"]
        .as_array()
        .into_iter()
        .flatten()
        .map(|obstacle| {
            let corners = obstacle
                .get("polygon_m")
                .or_else(|| obstacle.get("polygon"))
                .unwrap_or(obstacle);
            corners
                .as_array()
                .into_iter()
                .flatten()
                .map(place)
                .collect()
        });
    let robot = &tasks["robots"][0];
    let radius = robot["footprint"]["disc"]["radius_m"]
        .as_f64()
        .ok_or("no disc")?;
    let polygons: Vec<Vec<Vector>> = polygons.collect();
    let begin = Instant::now();
    let obstacles = Obstacles::new(polygons, bounds, radius);
    let mut tangents = Tangents::new(&obstacles);
    let way = tangents.shortest(place(&robot["start"]), place(&robot["goal"]), &mut || false);
    let seconds = begin.elapsed().as_secs_f64();
    let (corners, tested) = (obstacles.corners().count(), tangents.tested);
    match way {
        Some(way) => {
            let driven: f64 = way
                .places
                .windows(2)
                .map(|pair| (pair[1] - pair[0]).norm())
                .sum();
            let clear = way
                .places
                .windows(2)
                .all(|pair| obstacles.clear(pair[0], pair[1]));
            println!(
                "{:.4} m, driven {driven:.4} m, clear {clear}, {corners} corners, {tested} tests, {seconds:.5} s",
                way.length
            );
        }
        None => println!("no way, {corners} corners, {tested} tests, {seconds:.5} s"),
    }
    Ok(())
}

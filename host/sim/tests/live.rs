//! Executions without an end, in which robots drive orders as they come.

use fleetyard_core::Grid;
use fleetyard_sim::{Fleet, Profile};
use fleetyard_sim::{Live, NoTrace, Order, SimConfig};

fn open(rows: u32, cols: u32) -> Grid {
    Grid::new("open", rows, cols, vec![b'.'; (rows * cols) as usize]).expect("a valid map")
}

fn fleet(preset: &str, agents: usize) -> Fleet {
    let profile = Profile::preset(preset).expect("a preset");
    Fleet::uniform(profile, agents).expect("a fleet")
}

fn go(cell: u32) -> Order {
    Order { cell, dwell_s: 0.0 }
}

/// Seconds until the last of these orders is known to be done, sent at once to one robot
/// that looks east.
fn drive(preset: &str, grid: &Grid, orders: &[Order]) -> f64 {
    let config = SimConfig::default();
    let fleet = fleet(preset, 1);
    let mut live = Live::new(&config, grid, Some(&fleet), &[(0, 0.0)]).expect("a start");
    live.begin(&mut NoTrace).expect("a beginning");
    for order in orders {
        live.send(0, *order);
    }
    while live.done(0) < orders.len() as u32 {
        live.advance(&mut NoTrace).expect("a block");
        assert!(live.now_s() < 1000.0, "nothing happens");
    }
    live.now_s()
}

/// Measured on the program itself: one cell 2.6 s, four 6.2 to 6.5 s, eighteen 22.7 s. Its
/// robots fetch actions once a second, so a fifth of a second is not known.
#[test]
fn orders_in_a_row_take_as_long_as_they_do_in_lsmart() {
    let grid = open(3, 20);
    for (cells, measured) in [(1, 2.6), (4, 6.35), (18, 22.7)] {
        let orders: Vec<Order> = (1..=cells).map(go).collect();
        let time = drive("lsmart-effective", &grid, &orders);
        let error: f64 = time - measured;
        assert!(error.abs() <= 0.1 * measured, "{time} s for {cells} cells");
    }
}

/// A leg of n metres of the published AGV: up and down at 2 m/s² and at 2 m/s between.
#[test]
fn straight_orders_are_one_leg() {
    let grid = open(3, 20);
    for cells in [1, 2, 3, 10] {
        let orders: Vec<Order> = (1..=cells).map(go).collect();
        let time = drive("agv", &grid, &orders);
        let way = f64::from(cells);
        let ideal = if way >= 2.0 {
            way / 2.0 + 1.0
        } else {
            2.0 * (way / 2.0).sqrt()
        };
        assert!((time - ideal).abs() < 0.2, "{time} s instead of {ideal} s");
    }
}

//! Steps: the state that a control leads to, and its derivatives by state, control and time.

use fleetyard_plugin_plane::Vector;
use nalgebra::Complex;

use super::matrix::{Matrix, zeros};
use crate::robot::{Control, Robot, State, quadrature};

/// Place, heading and time come first in the numbers of a state; rates follow.
pub const HEADING: usize = 2;
/// See [`HEADING`].
pub const TIME: usize = 3;
/// See [`HEADING`].
pub const RATES: usize = 4;

/// The axes of a robot that its controls have numbers for, in order.
pub fn axes(robot: &Robot) -> Vec<usize> {
    // A robot without a heading keeps the place of one.
    let there = robot.axes().into_iter().enumerate();
    there
        .filter_map(|(axis, there)| there.then_some(axis))
        .collect()
}

/// A step of a robot: its end, and the derivatives of that by the numbers of the state and of the control, the last of which
/// is its duration.
#[derive(Debug)]
pub struct Step<const N: usize, const M: usize> {
    /// The state in the end.
    pub end: State,
    /// By the state.
    pub by_state: Matrix<N, N>,
    /// By the control and the duration.
    pub by_control: Matrix<N, M>,
}

impl<const N: usize, const M: usize> Step<N, M> {
    /// Of a control that is held for a time.
    pub fn new(
        robot: &Robot,
        axes: &[usize],
        state: &State,
        control: &Control,
        seconds: f64,
    ) -> Self {
        let (rates, changes) = if robot.is_second {
            (state.rates, *control)
        } else {
            (*control, [0.0; 3])
        };
        // ∫ tʲ exp(iφ(t)) dt, where φ is the direction of the axes.
        let mut moments = [Complex::new(0.0, 0.0); 4];
        let heading = if robot.turns_axes { state.heading } else { 0.0 };
        if robot.turns_axes && (rates[2] != 0.0 || changes[2] != 0.0) {
            quadrature(rates[2], changes[2], seconds, |time, turn, weight| {
                let mut term = unit(heading + turn) * weight;
                for moment in &mut moments {
                    *moment += term;
                    term *= time;
                }
            });
        } else {
            let mut term = unit(heading) * seconds;
            for (power, moment) in moments.iter_mut().enumerate() {
                *moment = term / (power + 1) as f64;
                term *= seconds;
            }
        }
        let along = Complex::new(rates[0], rates[1]);
        let faster = Complex::new(changes[0], changes[1]);
        let way = along * moments[0] + faster * moments[1];
        let left = Complex::new(0.0, 1.0);
        let turning = if robot.turns_axes { left } else { left * 0.0 };
        let by_rates = [
            moments[0],
            left * moments[0],
            turning * (along * moments[1] + faster * moments[2]),
        ];
        let by_changes = [
            moments[1],
            left * moments[1],
            turning * (along * moments[2] + faster * moments[3]) / 2.0,
        ];
        let later = [0, 1, 2].map(|axis| rates[axis] + changes[axis] * seconds);
        let turn = (rates[2] + changes[2] * seconds / 2.0) * seconds;
        let end = State {
            at: state.at + Vector::new(way.re, way.im),
            heading: state.heading + turn,
            rates: if robot.is_second { later } else { [0.0; 3] },
            behind: state.heading + turn,
        };

        let mut by_state = zeros::<N, N>();
        let mut by_control = zeros::<N, M>();
        for (number, row) in by_state.iter_mut().enumerate() {
            row[number] = 1.0;
        }
        let by_heading = turning * way;
        by_state[0][HEADING] = by_heading.re;
        by_state[1][HEADING] = by_heading.im;
        for (number, axis) in axes.iter().copied().enumerate() {
            let by_number = if robot.is_second {
                by_state[0][RATES + number] = by_rates[axis].re;
                by_state[1][RATES + number] = by_rates[axis].im;
                by_control[RATES + number][number] = seconds;
                by_control[RATES + number][M - 1] = changes[axis];
                if axis == 2 {
                    by_state[HEADING][RATES + number] = seconds;
                    by_control[HEADING][number] = seconds * seconds / 2.0;
                }
                by_changes[axis]
            } else {
                if axis == 2 {
                    by_control[HEADING][number] = seconds;
                }
                by_rates[axis]
            };
            by_control[0][number] = by_number.re;
            by_control[1][number] = by_number.im;
        }
        let velocity = robot.velocity(end.heading, &later);
        by_control[0][M - 1] = velocity.x;
        by_control[1][M - 1] = velocity.y;
        by_control[HEADING][M - 1] = later[2];
        by_control[TIME][M - 1] = 1.0;
        Self {
            end,
            by_state,
            by_control,
        }
    }
}

fn unit(angle: f64) -> Complex<f64> {
    let (sin, cos) = libm::sincos(angle);
    Complex::new(cos, sin)
}

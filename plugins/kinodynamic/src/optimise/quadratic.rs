//! Quadratic programs along a chain of states, by an interior point method.
//!
//! Every iteration is two solutions of a linear-quadratic control problem with the same matrices, by Riccati's recursion, which
//! is linear in the number of steps (S. Mehrotra, "On the implementation of a primal-dual interior point method", SIAM Journal
//! on Optimization 2(4), 1992; C. V. Rao, S. J. Wright, J. B. Rawlings, "Application of interior-point methods to model
//! predictive control", JOTA 99(3), 1998). An inequality may be broken at a price per unit: its multiplier is at most the
//! price, and so a program always has a solution.

use super::matrix::{
    Matrix, add, add_product_transposed, cholesky, diagonal, level, product, solved, sum, times,
    transposed_product, transposed_times, zeros,
};

/// A step: x' = A x + B u + d. States and controls are weighted by diagonals, and controls have linear costs.
#[derive(Debug, Clone)]
pub struct Stage<const N: usize, const M: usize> {
    /// A.
    pub by_state: Matrix<N, N>,
    /// B.
    pub by_control: Matrix<N, M>,
    /// d.
    pub defect: [f64; N],
    /// Half of the square of each number of the state costs so much.
    pub state_weight: [f64; N],
    /// The same of the control, above zero.
    pub control_weight: [f64; M],
    /// Each number of the control costs so much.
    pub control_cost: [f64; M],
}

/// A sum of a few numbers of a state or of a control that has to be at least something.
#[derive(Debug, Clone, Copy)]
pub struct Row {
    /// The number of the step; of a state from 1 to the number of steps.
    pub stage: usize,
    /// It is of the control.
    pub is_of_control: bool,
    terms: [(usize, f64); 4],
    /// Numbers that have a factor.
    count: usize,
    /// The bound.
    pub least: f64,
    /// Price of a unit below it; infinite if that may not be.
    pub price: f64,
}

impl Row {
    /// Of these numbers of a state or a control, four at most.
    pub fn new(
        (stage, is_of_control): (usize, bool),
        terms: &[(usize, f64)],
        least: f64,
        price: f64,
    ) -> Self {
        Self {
            count: terms.len().min(4),
            stage,
            is_of_control,
            terms: std::array::from_fn(|term| terms.get(term).copied().unwrap_or((0, 0.0))),
            least,
            price,
        }
    }

    fn of(&self, numbers: &[f64]) -> f64 {
        let mut sum = 0.0;
        for (number, factor) in self.terms() {
            sum += factor * numbers[*number];
        }
        sum
    }

    /// Numbers and their factors.
    fn terms(&self) -> &[(usize, f64)] {
        &self.terms[..self.count]
    }

    /// The sum of the factors of a solution less the bound.
    pub fn excess<const N: usize, const M: usize>(&self, at: &Solution<N, M>) -> f64 {
        let sum = if self.is_of_control {
            self.of(&at.controls[self.stage])
        } else {
            self.of(&at.states[self.stage])
        };
        sum - self.least
    }
}

/// States from the first one, which is zero, and controls.
#[derive(Debug, Clone)]
pub struct Solution<const N: usize, const M: usize> {
    /// One more than steps.
    pub states: Vec<[f64; N]>,
    /// One per step.
    pub controls: Vec<[f64; M]>,
}

/// A program.
#[derive(Debug)]
pub struct Program<const N: usize, const M: usize> {
    /// Its steps.
    pub stages: Vec<Stage<N, M>>,
    /// Weights of the last state.
    pub end_weight: [f64; N],
    /// Its inequalities.
    pub rows: Vec<Row>,
}

/// Mean complementarity at the beginning.
const BEGIN: f64 = 1e-2;

/// Most iterations of one program.
const MOST_ITERATIONS: u32 = 40;

/// The step to the border is shortened by this.
const INSIDE: f64 = 0.995;

/// A row's slack, its multiplier, and the same pair of the part that is paid for.
#[derive(Debug, Clone, Copy)]
struct Inner {
    slack: f64,
    multiplier: f64,
    paid: f64,
    rest: f64,
    /// Products of the steps of the predictor.
    corrections: [f64; 2],
    /// The weight of its square now.
    weight: f64,
    steps: [f64; 4],
}

impl Inner {
    fn new(row: &Row, excess: f64) -> Self {
        let hard = row.price.is_infinite();
        let mut slack = excess.max(BEGIN);
        let mut multiplier = BEGIN / slack;
        let (mut paid, mut rest) = (0.0, f64::INFINITY);
        if !hard {
            multiplier = multiplier.min(row.price / 2.0);
            slack = slack.max(BEGIN / multiplier);
            rest = row.price - multiplier;
            paid = BEGIN / rest;
        }
        Self {
            slack,
            multiplier,
            paid,
            rest,
            corrections: [0.0; 2],
            weight: 0.0,
            steps: [0.0; 4],
        }
    }

    /// The excess that complementarities of `target` ask for.
    fn aim(&self, target: f64) -> f64 {
        (target - self.corrections[0]) / self.multiplier
            - (target - self.corrections[1]) / self.rest
    }

    fn advance(&mut self, target: f64, excess: f64) {
        let multiplier = self.weight * (self.aim(target) - excess);
        let slack = (target - self.corrections[0]) / self.multiplier
            - self.slack
            - self.slack * multiplier / self.multiplier;
        let paid = (target - self.corrections[1]) / self.rest - self.paid
            + self.paid * multiplier / self.rest;
        self.steps = [slack, multiplier, paid, -multiplier];
    }

    fn numbers(&self) -> [f64; 4] {
        [self.slack, self.multiplier, self.paid, self.rest]
    }

    /// The part of the step that keeps all numbers at least zero.
    fn longest(&self, mut part: f64) -> f64 {
        for (number, step) in self.numbers().into_iter().zip(self.steps) {
            if number + part * step < 0.0 {
                part = -number / step;
            }
        }
        part
    }

    /// The sum of both complementarities after a part of the step.
    fn product(&self, part: f64) -> f64 {
        let at: [f64; 4] =
            std::array::from_fn(|which| self.numbers()[which] + part * self.steps[which]);
        if self.rest.is_infinite() {
            at[0] * at[1]
        } else {
            at[0] * at[1] + at[2] * at[3]
        }
    }
}

/// A stage of Riccati's recursion.
#[derive(Debug, Clone)]
struct Sweep<const N: usize, const M: usize> {
    /// Of the state's cost to go after the stage.
    later: Matrix<N, N>,
    triangle: Matrix<M, M>,
    /// Aᵀ P B.
    cross: Matrix<N, M>,
    /// Of the control, by each number of the state.
    gain: Matrix<N, M>,
    control_weight: Matrix<M, M>,
    state_weight: Matrix<N, N>,
    ahead: [f64; M],
}

impl<const N: usize, const M: usize> Program<N, M> {
    /// The solution, to a mean complementarity of `accuracy`, and the number of iterations. None if numbers overflow.
    pub fn solve(&self, accuracy: f64) -> Option<(Solution<N, M>, u32)> {
        let steps = self.stages.len();
        let mut at = Solution {
            states: vec![[0.0; N]; steps + 1],
            controls: vec![[0.0; M]; steps],
        };
        let mut inner: Vec<Inner> = self
            .rows
            .iter()
            .map(|row| Inner::new(row, -row.least))
            .collect();
        let products = inner
            .iter()
            .map(|one| 1 + usize::from(one.rest.is_finite()));
        let products = (products.sum::<usize>()).max(1) as f64;
        let mut sweeps = vec![
            Sweep {
                later: zeros(),
                triangle: zeros(),
                cross: zeros(),
                gain: zeros(),
                control_weight: zeros(),
                state_weight: zeros(),
                ahead: [0.0; M],
            };
            steps
        ];
        // The part by which equalities are still missed.
        let mut missed = 1.0;
        let mut next = at.clone();
        for iteration in 0..MOST_ITERATIONS {
            let mean = inner.iter().map(|one| one.product(0.0)).sum::<f64>() / products;
            if mean < accuracy && missed < 1e-6 {
                return Some((self.closed(at), iteration));
            }
            for one in &mut inner {
                one.corrections = [0.0; 2];
                one.weight = 1.0 / (one.slack / one.multiplier + one.paid / one.rest);
            }
            self.factor(&inner, &mut sweeps)?;
            self.step(&mut inner, &mut sweeps, 0.0, &mut next);
            let part = inner.iter().fold(1.0, |part, one| one.longest(part));
            let ahead = inner.iter().map(|one| one.product(part)).sum::<f64>() / products;
            let centring = libm::pow((ahead / mean).clamp(0.0, 1.0), 3.0);
            for one in &mut inner {
                let [slack, multiplier, paid, rest] = one.steps;
                one.corrections = [slack * multiplier, paid * rest];
            }
            let target = (centring * mean).max(accuracy / 10.0);
            self.step(&mut inner, &mut sweeps, target, &mut next);
            let part = inner
                .iter()
                .fold(1.0 / INSIDE, |part, one| one.longest(part))
                * INSIDE;
            for one in &mut inner {
                one.slack += part * one.steps[0];
                one.multiplier += part * one.steps[1];
                one.paid += part * one.steps[2];
                one.rest += part * one.steps[3];
            }
            let toward = |own: &mut [f64], next: &[f64]| {
                for (own, next) in own.iter_mut().zip(next) {
                    *own += part * (next - *own);
                }
            };
            for (own, next) in at.states.iter_mut().zip(&next.states) {
                toward(own, next);
            }
            for (own, next) in at.controls.iter_mut().zip(&next.controls) {
                toward(own, next);
            }
            missed *= 1.0 - part;
            if !part.is_finite() {
                return None;
            }
        }
        (missed < 0.1).then(|| (self.closed(at), MOST_ITERATIONS))
    }

    /// The same with states where controls lead.
    fn closed(&self, mut at: Solution<N, M>) -> Solution<N, M> {
        for (number, stage) in self.stages.iter().enumerate() {
            at.states[number + 1] = stage.end(&at.states[number], &at.controls[number]);
        }
        at
    }

    fn factor(&self, inner: &[Inner], sweeps: &mut [Sweep<N, M>]) -> Option<()> {
        let mut end = diagonal(&self.end_weight);
        for (stage, sweep) in self.stages.iter().zip(sweeps.iter_mut()) {
            sweep.state_weight = diagonal(&stage.state_weight);
            sweep.control_weight = diagonal(&stage.control_weight);
        }
        for (row, one) in self.rows.iter().zip(inner) {
            if row.is_of_control {
                square(&mut sweeps[row.stage].control_weight, row, one.weight);
            } else if row.stage == sweeps.len() {
                square(&mut end, row, one.weight);
            } else {
                square(&mut sweeps[row.stage].state_weight, row, one.weight);
            }
        }
        let mut later = end;
        for (stage, sweep) in self.stages.iter().zip(sweeps).rev() {
            sweep.later = later;
            let by_state = product(&later, &stage.by_state);
            let by_control = product(&later, &stage.by_control);
            let mut own = transposed_product(&stage.by_control, &by_control);
            add(&mut own, &sweep.control_weight);
            sweep.triangle = cholesky(&own)?;
            sweep.cross = transposed_product(&by_state, &stage.by_control);
            for (gain, cross) in sweep.gain.iter_mut().zip(&sweep.cross) {
                *gain = solved(&sweep.triangle, &cross.map(|number| -number));
            }
            later = transposed_product(&stage.by_state, &by_state);
            add(&mut later, &sweep.state_weight);
            add_product_transposed(&mut later, &sweep.cross, &sweep.gain);
            level(&mut later);
        }
        Some(())
    }

    /// The solution for complementarities of `target`, and the steps of rows towards it.
    fn step(
        &self,
        inner: &mut [Inner],
        sweeps: &mut [Sweep<N, M>],
        target: f64,
        next: &mut Solution<N, M>,
    ) {
        let steps = self.stages.len();
        // Linear costs; they stand where the solution will.
        next.states.iter_mut().for_each(|costs| *costs = [0.0; N]);
        for (costs, stage) in next.controls.iter_mut().zip(&self.stages) {
            *costs = stage.control_cost;
        }
        for (row, one) in self.rows.iter().zip(inner.iter()) {
            let force = one.multiplier + one.weight * (one.aim(target) + row.least);
            let costs: &mut [f64] = if row.is_of_control {
                &mut next.controls[row.stage]
            } else {
                &mut next.states[row.stage]
            };
            for (number, factor) in row.terms() {
                costs[*number] -= factor * force;
            }
        }
        let mut cost = next.states[steps];
        for number in (0..steps).rev() {
            let (stage, sweep) = (&self.stages[number], &mut sweeps[number]);
            let after = sum(&cost, &times(&sweep.later, &stage.defect));
            let own = sum(
                &next.controls[number],
                &transposed_times(&stage.by_control, &after),
            );
            sweep.ahead = solved(&sweep.triangle, &own.map(|number| -number));
            let of_state = sum(
                &next.states[number],
                &transposed_times(&stage.by_state, &after),
            );
            cost = sum(&of_state, &times(&sweep.cross, &sweep.ahead));
        }
        next.states[0] = [0.0; N];
        for (number, (stage, sweep)) in self.stages.iter().zip(sweeps.iter()).enumerate() {
            next.controls[number] = sum(
                &transposed_times(&sweep.gain, &next.states[number]),
                &sweep.ahead,
            );
            next.states[number + 1] = stage.end(&next.states[number], &next.controls[number]);
        }
        for (row, one) in self.rows.iter().zip(inner) {
            one.advance(target, row.excess(next));
        }
    }
}

impl<const N: usize, const M: usize> Stage<N, M> {
    fn end(&self, state: &[f64; N], control: &[f64; M]) -> [f64; N] {
        let led = sum(
            &times(&self.by_state, state),
            &times(&self.by_control, control),
        );
        sum(&led, &self.defect)
    }
}

fn square<const R: usize>(all: &mut Matrix<R, R>, row: &Row, weight: f64) {
    for (one, factor) in row.terms() {
        for (other, other_factor) in row.terms() {
            all[*one][*other] += weight * factor * other_factor;
        }
    }
}

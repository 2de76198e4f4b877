//! CMA-ES: N. Hansen, "The CMA evolution strategy: a tutorial", arXiv 1604.00772, with its default
//! parameters and positive weights.

use fleetyard_world::SeededRandom;
use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// A search for the point with the greatest value. Random numbers depend on the seed alone.
#[derive(Debug, Clone)]
pub struct Cmaes {
    mean: DVector<f64>,
    sigma: f64,
    covariance: DMatrix<f64>,
    /// Square root of the covariance, and the inverse of that.
    root: DMatrix<f64>,
    inverse_root: DMatrix<f64>,
    /// Evolution paths of the covariance and of the step size.
    path: DVector<f64>,
    path_sigma: DVector<f64>,
    /// Weights of the best points of a generation, best first; their sum is 1.
    weights: Vec<f64>,
    population: usize,
    generation: u32,
    random: SeededRandom,
}

impl Cmaes {
    /// Begins around the origin of a space of so many dimensions, with a standard deviation.
    pub fn new(dimensions: usize, sigma: f64, seed: u64) -> Self {
        let n = dimensions as f64;
        let population = 4 + (3.0 * libm::log(n)) as usize;
        let best = population / 2;
        let raw = (1..=best)
            .map(|rank| libm::log(f64::midpoint(population as f64, 1.0)) - libm::log(rank as f64));
        let raw: Vec<f64> = raw.collect();
        let sum: f64 = raw.iter().sum();
        let identity = DMatrix::identity(dimensions, dimensions);
        Self {
            mean: DVector::zeros(dimensions),
            sigma,
            covariance: identity.clone(),
            root: identity.clone(),
            inverse_root: identity,
            path: DVector::zeros(dimensions),
            path_sigma: DVector::zeros(dimensions),
            weights: raw.into_iter().map(|weight| weight / sum).collect(),
            population,
            generation: 0,
            random: SeededRandom::new("cmaes", seed),
        }
    }

    /// Number of points of a generation.
    pub fn population(&self) -> usize {
        self.population
    }

    /// The middle of the search: the best estimate where values are noisy.
    pub fn mean(&self) -> &[f64] {
        self.mean.as_slice()
    }

    /// Points to be valued.
    pub fn ask(&mut self) -> Vec<Vec<f64>> {
        let points = (0..self.population).map(|_| {
            let normal = DVector::from_fn(self.mean.len(), |_, _| normal(&mut self.random));
            let point = &self.mean + self.sigma * (&self.root * normal);
            point.as_slice().to_vec()
        });
        points.collect()
    }

    /// Goes on from the points of [`Cmaes::ask`] and their values, of which greater is better. Of equals
    /// the first counts as better.
    pub fn tell(&mut self, points: &[Vec<f64>], values: &[f64]) {
        let n = self.mean.len() as f64;
        let mut ranks: Vec<usize> = (0..points.len().min(values.len())).collect();
        ranks.sort_by(|a, b| values[*b].total_cmp(&values[*a]));
        let best = ranks.iter().zip(&self.weights);
        let steps: Vec<(f64, DVector<f64>)> = best
            .map(|(at, weight)| {
                let point = DVector::from_column_slice(&points[*at]);
                (*weight, (point - &self.mean) / self.sigma)
            })
            .collect();
        let mut step = DVector::zeros(self.mean.len());
        for (weight, each) in &steps {
            step += each * *weight;
        }
        let mu = 1.0
            / self
                .weights
                .iter()
                .map(|weight| weight * weight)
                .sum::<f64>();
        let c_sigma = (mu + 2.0) / (n + mu + 5.0);
        let damping = 1.0 + 2.0 * (((mu - 1.0) / (n + 1.0)).sqrt() - 1.0).max(0.0) + c_sigma;
        let c_path = (4.0 + mu / n) / (n + 4.0 + 2.0 * mu / n);
        let c_one = 2.0 / ((n + 1.3) * (n + 1.3) + mu);
        let c_mu = 2.0 * (mu - 2.0 + 1.0 / mu) / ((n + 2.0) * (n + 2.0) + mu);
        let c_mu = c_mu.min(1.0 - c_one);
        let length = n.sqrt() * (1.0 - 1.0 / (4.0 * n) + 1.0 / (21.0 * n * n));

        self.mean += &step * self.sigma;
        self.path_sigma = &self.path_sigma * (1.0 - c_sigma)
            + (&self.inverse_root * &step) * (c_sigma * (2.0 - c_sigma) * mu).sqrt();
        self.generation += 1;
        let norm = self.path_sigma.norm();
        let begun = 1.0 - libm::pow(1.0 - c_sigma, 2.0 * f64::from(self.generation));
        // Stalls the path while the step size grows fast.
        let is_usual = norm / begun.sqrt() < (1.4 + 2.0 / (n + 1.0)) * length;
        let usual = f64::from(u8::from(is_usual));
        self.path =
            &self.path * (1.0 - c_path) + &step * (usual * (c_path * (2.0 - c_path) * mu).sqrt());
        let missing = (1.0 - usual) * c_path * (2.0 - c_path);
        let mut covariance = &self.covariance * (1.0 - c_one - c_mu + c_one * missing);
        covariance += (&self.path * self.path.transpose()) * c_one;
        for (weight, each) in &steps {
            covariance += (each * each.transpose()) * (c_mu * weight);
        }
        self.covariance = (&covariance + covariance.transpose()) / 2.0;
        self.sigma *= libm::exp((c_sigma / damping * (norm / length - 1.0)).min(1.0));

        let eigen = SymmetricEigen::new(self.covariance.clone());
        let sides = eigen.eigenvalues.map(|value| value.max(1e-20).sqrt());
        let of = |sides: &DVector<f64>| {
            &eigen.eigenvectors * DMatrix::from_diagonal(sides) * eigen.eigenvectors.transpose()
        };
        self.root = of(&sides);
        self.inverse_root = of(&sides.map(|side| 1.0 / side));
    }
}

/// A number of the standard normal distribution (G. E. P. Box, M. E. Muller, 1958).
fn normal(random: &mut SeededRandom) -> f64 {
    let (radius, angle) = (random.unit(), random.unit());
    (-2.0 * libm::log(radius)).sqrt() * libm::cos(std::f64::consts::TAU * angle)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn search(seed: u64, generations: u32, value: impl Fn(&[f64]) -> f64) -> Cmaes {
        let mut search = Cmaes::new(8, 0.5, seed);
        for _ in 0..generations {
            let points = search.ask();
            assert_eq!(points.len(), search.population());
            let values: Vec<f64> = points.iter().map(|point| value(point)).collect();
            search.tell(&points, &values);
        }
        search
    }

    /// An ellipsoid whose axes differ by a factor of 1000.
    fn ellipsoid(point: &[f64]) -> f64 {
        let axes = point.iter().enumerate();
        -axes
            .map(|(axis, x)| libm::pow(1e6, axis as f64 / 7.0) * (x - 1.0) * (x - 1.0))
            .sum::<f64>()
    }

    #[test]
    fn it_finds_the_top_of_an_ellipsoid() {
        let found = search(1, 400, ellipsoid);
        let far = found.mean().iter().map(|x| (x - 1.0).abs());
        assert!(far.fold(0.0, f64::max) < 1e-3, "{:?}", found.mean());
    }

    #[test]
    fn it_is_the_same_for_the_same_seed() {
        let mean = |seed| search(seed, 20, ellipsoid).mean().to_vec();
        assert_eq!(mean(4), mean(4));
        assert_ne!(mean(4), mean(5));
    }

    #[test]
    fn values_that_say_nothing_break_nothing() {
        for value in [0.0, f64::NAN, f64::INFINITY] {
            let found = search(2, 30, |_| value);
            assert!(found.mean().iter().all(|x| x.is_finite()));
        }
    }
}

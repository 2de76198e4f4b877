//! The time that a rest of trials will take, from what those before took.

use std::fmt;
use std::time::Duration;

/// Learns from the first trial on how long the rest takes.
///
/// Planners differ by orders of magnitude, and so each is extrapolated by itself: the rest
/// of a planner takes as many times its mean, with the standard error of that sum. A planner
/// without two trials of its own is taken for one of the others: what all trials so far say
/// stands for it, once. The range is two of these errors wide to either side. It knows nothing
/// of instances that are harder than those before.
#[derive(Debug, Clone)]
pub struct Estimate {
    longest: Duration,
    planners: Vec<Rest>,
    all: Pace,
}

/// The trials that a planner has still to make, and its pace so far.
#[derive(Debug, Clone, Copy, Default)]
struct Rest {
    left: u64,
    own: Pace,
}

/// Of trials that ended, in seconds.
#[derive(Debug, Clone, Copy, Default)]
struct Pace {
    ended: u64,
    mean: f64,
    /// Sum of squared deviations (Welford 1962).
    squares: f64,
}

/// The time that something will take.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Left {
    /// It is hardly less.
    pub low: Duration,
    /// It is hardly more; never more than budgets allow.
    pub high: Duration,
}

impl Estimate {
    /// Of trials none of which takes longer than `longest`.
    pub fn new(longest: Duration) -> Self {
        Self {
            longest,
            planners: Vec::new(),
            all: Pace::default(),
        }
    }

    fn of(&mut self, planner: usize) -> &mut Rest {
        if planner >= self.planners.len() {
            self.planners.resize(planner + 1, Rest::default());
        }
        &mut self.planners[planner]
    }

    /// There is one more trial of a planner to be made.
    pub fn expect(&mut self, planner: usize) {
        self.of(planner).left += 1;
    }

    /// One of a planner was made before, and is none of those that are to be made.
    pub fn known(&mut self, planner: usize, took: Duration) {
        self.of(planner).own.add(took.as_secs_f64());
        self.all.add(took.as_secs_f64());
    }

    /// One was made.
    pub fn ended(&mut self, planner: usize, took: Duration) {
        let rest = self.of(planner);
        rest.left = rest.left.saturating_sub(1);
        self.known(planner, took);
    }

    /// The time that the rest takes; absent before any trial has ended.
    pub fn left(&self) -> Option<Left> {
        if self.all.ended == 0 {
            return None;
        }
        let trials: u64 = self.planners.iter().map(|rest| rest.left).sum();
        let most = self
            .longest
            .saturating_mul(u32::try_from(trials).unwrap_or(u32::MAX));
        let (mut sum, mut variance) = (0.0, 0.0);
        for rest in self.planners.iter().filter(|rest| rest.left > 0) {
            let (pace, known) = match rest.own.ended {
                0 | 1 => (self.all, 1.0),
                ended => (rest.own, ended as f64),
            };
            let left = rest.left as f64;
            sum += left * pace.mean;
            // Of the trials themselves, and of the mean that stands for them.
            variance += pace.variance() * (left + left * left / known);
        }
        let error = 2.0 * variance.sqrt();
        let duration = |seconds: f64| {
            Duration::try_from_secs_f64(seconds.max(0.0)).map_or(most, |d| d.min(most))
        };
        Some(Left {
            low: duration(sum - error),
            high: duration(sum + error),
        })
    }
}

impl Pace {
    fn add(&mut self, seconds: f64) {
        self.ended += 1;
        let deviation = seconds - self.mean;
        self.mean += deviation / self.ended as f64;
        self.squares += deviation * (seconds - self.mean);
    }

    /// Of a trial. A single one says nothing of it: it is as if times were exponential.
    fn variance(&self) -> f64 {
        match self.ended {
            0 | 1 => self.mean * self.mean,
            ended => self.squares / (ended - 1) as f64,
        }
    }
}

impl fmt::Display for Left {
    /// Such as `about 3m to 5m left`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} left", self.range())
    }
}

impl Left {
    /// Such as `about 3m to 5m`.
    pub fn range(&self) -> String {
        let (low, high) = (rough(self.low), rough(self.high));
        if high == "0s" {
            "less than 1s".to_owned()
        } else if low == "0s" {
            format!("less than {high}")
        } else if low == high {
            format!("about {high}")
        } else {
            format!("about {low} to {high}")
        }
    }
}

/// A duration in two of its units at most, and no finer than seconds.
pub fn rough(duration: Duration) -> String {
    let seconds = duration.as_secs() + u64::from(duration.subsec_millis() >= 500);
    let unit = match seconds {
        0..3600 => 1,
        3600..86_400 => 60,
        _ => 3600,
    };
    let rounded = Duration::from_secs(seconds / unit * unit);
    humantime::format_duration(rounded).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    const LONGEST: Duration = Duration::from_mins(1);

    fn estimate(planners: impl IntoIterator<Item = usize>) -> Estimate {
        let mut estimate = Estimate::new(LONGEST);
        planners.into_iter().for_each(|of| estimate.expect(of));
        estimate
    }

    fn said(estimate: &Estimate) -> String {
        estimate.left().unwrap().to_string()
    }

    #[test]
    fn a_suite_of_a_tenth_of_a_second_is_not_said_to_take_what_its_budgets_allow() {
        let mut estimate = estimate((0..36).map(|trial| trial % 3));
        assert_eq!(estimate.left(), None);
        estimate.ended(0, Duration::from_millis(3));
        assert_eq!(said(&estimate), "less than 1s left");
        for planner in [1, 2] {
            estimate.ended(planner, Duration::from_millis(3));
        }
        assert_eq!(said(&estimate), "less than 1s left");
    }

    #[test]
    fn a_planner_without_trials_of_its_own_is_taken_for_the_others() {
        let mut estimate = estimate([0, 0, 0, 1, 1]);
        estimate.ended(0, Duration::from_secs(4));
        // Four trials of 4 s, each with a variance of 16 s² like its mean.
        let Left { low, high } = estimate.left().unwrap();
        let error = 2.0 * (2.0 * 16.0 * (2.0_f64 + 4.0)).sqrt();
        assert_eq!(low, Duration::ZERO);
        assert!(
            (high.as_secs_f64() - (16.0 + error)).abs() < 1e-6,
            "{high:?}"
        );
        estimate.ended(0, Duration::from_secs(4));
        estimate.ended(0, Duration::from_secs(4));
        assert_eq!(said(&estimate), "about 8s left");
        estimate.ended(1, Duration::from_secs(10));
        // Mean 5.5 s, variance 9 s² over all four.
        assert_eq!(said(&estimate), "less than 14s left");
        estimate.ended(1, Duration::from_secs(10));
        assert_eq!(said(&estimate), "less than 1s left");
    }

    #[test]
    fn trials_that_were_made_before_say_how_long_others_take() {
        let mut estimate = estimate([0, 0, 1]);
        for _ in 0..3 {
            estimate.known(0, Duration::from_secs(2));
            estimate.known(1, Duration::from_secs(30));
        }
        assert_eq!(estimate.left().unwrap().range(), "about 34s");
    }

    #[test]
    fn each_planner_is_extrapolated_by_itself() {
        let mut estimate = estimate([0, 1].repeat(3));
        for _ in 0..2 {
            estimate.ended(0, Duration::from_secs(1));
            estimate.ended(1, Duration::from_secs(10));
        }
        assert_eq!(said(&estimate), "about 11s left");
        estimate.ended(1, Duration::from_secs(10));
        assert_eq!(said(&estimate), "about 1s left");
    }

    #[test]
    fn a_range_is_wider_when_trials_differ_and_never_beyond_the_budgets() {
        let mut long = estimate([0; 14]);
        for seconds in [1, 3, 1, 3] {
            long.ended(0, Duration::from_secs(seconds));
        }
        // Mean 2 s, variance 4/3: 20 s ± 2 √(10 · 4/3 + 100 · 4/3 / 4).
        let Left { low, high } = long.left().unwrap();
        let error = 2.0 * (40.0_f64 / 3.0 + 100.0 / 3.0).sqrt();
        assert!((low.as_secs_f64() - (20.0 - error)).abs() < 1e-6, "{low:?}");
        assert!(
            (high.as_secs_f64() - (20.0 + error)).abs() < 1e-6,
            "{high:?}"
        );
        let mut short = Estimate::new(Duration::from_secs(3));
        (0..14).for_each(|_| short.expect(0));
        for seconds in [1, 3, 1, 3] {
            short.ended(0, Duration::from_secs(seconds));
        }
        assert_eq!(short.left().unwrap().high, Duration::from_secs(30));
    }

    #[test]
    fn durations_are_no_finer_than_they_are_known() {
        for (seconds, text) in [
            (0.2, "0s"),
            (59.6, "1m"),
            (3599.0, "59m 59s"),
            (3725.0, "1h 2m"),
            (200_000.0, "2days 7h"),
        ] {
            assert_eq!(rough(Duration::from_secs_f64(seconds)), text);
        }
    }
}

//! Disturbances: delays, uneven speed, errors of velocity, late and lost messages.
//!
//! Every random value is a function of the seed, a purpose, and its subject (an agent and
//! its action, or an agent and a block of time): the value of that index in the ChaCha8
//! stream of that number. So values do not depend on threads, on the order of draws, or
//! on other draws.

use std::fmt;
use std::str::FromStr;

use fleetyard_world::SeededRandom;
use serde::{Deserialize, Serialize};

use crate::SimError;

/// All disturbances of an execution. The default disturbs nothing.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Disturbance {
    /// Seed of all streams.
    pub seed: u64,
    /// Delays of agents.
    pub delay: Delay,
    /// Unevenness of speed.
    pub velocity: VelocityNoise,
    /// Errors of the velocity beside the one that controllers ask for.
    // Executions that never had them keep their digests.
    #[serde(skip_serializing_if = "TwistNoise::is_none")]
    pub twist: TwistNoise,
    /// Latency and loss of messages between robots and server.
    pub messages: Messages,
}

/// Delays of agents.
///
/// In text: `none`, `bernoulli:P,SECONDS`, `uniform:MIN,MAX`, `gaussian:MEAN,STD`,
/// `bursts:RATE,SECONDS`, where times are like `2s`, `250ms`, or a number of
/// seconds.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Delay {
    /// No delay.
    #[default]
    None,
    /// Each action begins late with a probability, by a constant time.
    Bernoulli {
        /// Probability, 0 to 1.
        p: f64,
        /// Delay in seconds.
        seconds: f64,
    },
    /// Each action begins late by a uniformly distributed time.
    Uniform {
        /// Least delay in seconds.
        min_s: f64,
        /// Largest delay in seconds.
        max_s: f64,
    },
    /// Each action begins late by a normally distributed time; negative values become 0.
    Gaussian {
        /// Mean in seconds, before negative times become 0.
        mean_s: f64,
        /// Standard deviation in seconds.
        std_s: f64,
    },
    /// Agents stop at random times, wherever they are.
    Bursts {
        /// Rate of stops per second of simulated time, a Poisson process.
        rate_per_s: f64,
        /// Duration of a stop in seconds. A stop during a stop restarts it.
        seconds: f64,
    },
}

/// Variation of speeds. In every block an agent has 1 − std·|z| of its speed, z a
/// standard normal variate, but at least the floor.
///
/// In text: `STD,FLOOR`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct VelocityNoise {
    /// Standard deviation as a share of the speed; 0 is no noise.
    pub std: f64,
    /// The least share of the speed, above 0 so that everybody arrives.
    pub floor: f64,
}

impl Default for VelocityNoise {
    fn default() -> Self {
        Self {
            std: 0.0,
            floor: 0.1,
        }
    }
}

/// Errors with which bodies track the velocities that their controllers ask for: legs slip, and
/// wheels do. In every block the error of the velocity over ground is `std`·|v|·z along each axis, and
/// that of the turn rate (`std`·|ω| + `turn_rad_per_m`·|v|)·z, z normal variates cut at three standard
/// deviations. A body that stands does not slip.
///
/// In text: `STD,TURN`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TwistNoise {
    /// Standard deviation as a share of the speed and of the turn rate.
    pub std: f64,
    /// Standard deviation of the turn per metre, in radians.
    pub turn_rad_per_m: f64,
}

/// Latency and loss of messages, in both directions: the latency is uniform between two
/// times.
///
/// In text: `MIN,MAX,LOSS`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Messages {
    /// Least latency in seconds.
    pub delay_min_s: f64,
    /// Largest latency in seconds.
    pub delay_max_s: f64,
    /// Probability that a message is lost, below 1. The next period sends it again.
    pub loss: f64,
}

const TIMES: &str = "give seconds from 0 to 1e6";
const MOST_S: f64 = 1e6;

impl Disturbance {
    /// True if agents can be late or slow.
    pub fn moves_agents(&self) -> bool {
        !matches!(self.delay, Delay::None) || !self.velocity.is_none() || !self.twist.is_none()
    }

    /// True if nothing is disturbed.
    pub fn is_none(&self) -> bool {
        !self.moves_agents() && self.messages.is_none()
    }

    /// Checks that all parameters are in their ranges.
    pub fn validate(&self) -> Result<(), SimError> {
        self.delay.validate()?;
        self.velocity.validate()?;
        self.twist.validate()?;
        self.messages.validate()
    }
}

/// Refuses values out of a range, NaN included.
fn range(
    field: &'static str,
    value: f64,
    low: f64,
    high: f64,
    hint: &'static str,
) -> Result<(), SimError> {
    if value >= low && value <= high {
        return Ok(());
    }
    Err(SimError::Config {
        field,
        value: value.to_string(),
        reason: "is out of range",
        hint,
    })
}

impl Delay {
    /// Checks that all parameters are in their ranges.
    pub fn validate(&self) -> Result<(), SimError> {
        match *self {
            Self::None => Ok(()),
            Self::Bernoulli { p, seconds } => {
                range("delay.p", p, 0.0, 1.0, "a probability is from 0 to 1")?;
                range("delay.seconds", seconds, 0.0, MOST_S, TIMES)
            }
            Self::Uniform { min_s, max_s } => {
                range("delay.min_s", min_s, 0.0, MOST_S, TIMES)?;
                let hint = "give at least min_s and at most 1e6 seconds";
                range("delay.max_s", max_s, min_s, MOST_S, hint)
            }
            Self::Gaussian { mean_s, std_s } => {
                let hint = "give seconds from -1e6 to 1e6";
                range("delay.mean_s", mean_s, -MOST_S, MOST_S, hint)?;
                range("delay.std_s", std_s, 0.0, MOST_S, TIMES)
            }
            Self::Bursts {
                rate_per_s,
                seconds,
            } => {
                let hint = "give stops per second from 0 to 1e3";
                range("delay.rate_per_s", rate_per_s, 0.0, 1e3, hint)?;
                range("delay.seconds", seconds, 0.0, MOST_S, TIMES)?;
                // Beyond this, stops leave hardly any time to move.
                let hint = "give stops that leave time to move: rate times seconds at most 10";
                let share = rate_per_s * seconds;
                range("delay.rate_per_s * seconds", share, 0.0, 10.0, hint)
            }
        }
    }
}

impl VelocityNoise {
    /// True if speeds are even.
    pub fn is_none(&self) -> bool {
        self.std == 0.0
    }

    /// Checks that all parameters are in their ranges.
    pub fn validate(&self) -> Result<(), SimError> {
        let hint = "give a share of the speed from 0 to 10";
        range("velocity.std", self.std, 0.0, 10.0, hint)?;
        let hint = "give a share of the speed from 0.001 to 1: nobody arrives without speed";
        range("velocity.floor", self.floor, 1e-3, 1.0, hint)
    }
}

impl TwistNoise {
    /// True if bodies move as their controllers ask.
    pub fn is_none(&self) -> bool {
        self.std == 0.0 && self.turn_rad_per_m == 0.0
    }

    /// Checks that all parameters are in their ranges.
    pub fn validate(&self) -> Result<(), SimError> {
        let hint = "give a share of the speed from 0 to 0.3: with more a body may go nowhere";
        range("twist.std", self.std, 0.0, 0.3, hint)?;
        let hint = "give radians per metre from 0 to 1";
        range("twist.turn_rad_per_m", self.turn_rad_per_m, 0.0, 1.0, hint)
    }
}

impl Messages {
    /// True if messages take no time and arrive.
    pub fn is_none(&self) -> bool {
        self.delay_max_s == 0.0 && self.loss == 0.0
    }

    /// Checks that all parameters are in their ranges.
    pub fn validate(&self) -> Result<(), SimError> {
        range("messages.delay_min_s", self.delay_min_s, 0.0, MOST_S, TIMES)?;
        let hint = "give at least delay_min_s and at most 1e6 seconds";
        let most = self.delay_max_s;
        range("messages.delay_max_s", most, self.delay_min_s, MOST_S, hint)?;
        let hint = "give a probability from 0 to 0.999: some messages have to arrive";
        range("messages.loss", self.loss, 0.0, 0.999, hint)
    }
}

/// The delays and speeds drawn from a disturbance.
#[derive(Debug, Clone)]
pub struct Noise {
    delay: Delay,
    velocity: VelocityNoise,
    twist: TwistNoise,
    /// Probability that a stop begins in a block.
    stop: f64,
    delays: SeededRandom,
    stops: SeededRandom,
    speeds: SeededRandom,
    twists: SeededRandom,
}

/// Errors of a body's velocity in a block: shares of its speed and turn rate, and a turn per metre.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Slip {
    x: f64,
    y: f64,
    omega: f64,
    turn_rad_per_m: f64,
}

impl Slip {
    /// The errors of a velocity over ground, per axis, and of a turn rate.
    pub fn of(&self, vx: f64, vy: f64, omega: f64) -> [f64; 3] {
        let speed = (vx * vx + vy * vy).sqrt();
        let turn = self.omega * omega.abs() + self.turn_rad_per_m * speed;
        [self.x * speed, self.y * speed, turn]
    }
}

impl Noise {
    /// The noise of a valid disturbance, for blocks of `period_s` seconds.
    pub fn new(disturbance: &Disturbance, period_s: f64) -> Self {
        let stream = |purpose| SeededRandom::new(purpose, disturbance.seed);
        let stop = match disturbance.delay {
            Delay::Bursts { rate_per_s, .. } => -libm::expm1(-rate_per_s * period_s),
            _ => 0.0,
        };
        Self {
            delay: disturbance.delay,
            velocity: disturbance.velocity,
            twist: disturbance.twist,
            stop,
            delays: stream("action delay"),
            stops: stream("stop"),
            speeds: stream("speed"),
            twists: stream("twist"),
        }
    }

    /// Delay of an agent's action in seconds, counted from its earliest start.
    pub fn start_delay_s(&self, agent: usize, action: usize) -> f64 {
        let unit = || {
            let mut random = self.delays.clone();
            random.go_to(agent as u64, action as u64);
            random.unit()
        };
        match self.delay {
            Delay::Bernoulli { p, seconds } if unit() < p => seconds,
            Delay::None | Delay::Bursts { .. } | Delay::Bernoulli { .. } => 0.0,
            Delay::Uniform { min_s, max_s } => min_s + (max_s - min_s) * unit(),
            Delay::Gaussian { mean_s, std_s } => (mean_s + std_s * normal(unit())).max(0.0),
        }
    }

    /// True if [`Noise::start_delay_s`] can be above 0.
    pub fn delays_starts(&self) -> bool {
        !matches!(self.delay, Delay::None | Delay::Bursts { .. })
    }

    /// True if [`Noise::stops`] can report stops.
    pub fn has_stops(&self) -> bool {
        self.stop > 0.0
    }

    /// Reports every agent of `agents` with a stop at the beginning of a block, and its
    /// duration in seconds.
    pub fn stops(
        &self,
        block: u64,
        agents: std::ops::Range<usize>,
        mut tell: impl FnMut(usize, f64),
    ) {
        let Delay::Bursts { seconds, .. } = self.delay else {
            return;
        };
        let mut random = self.stops.clone();
        random.go_to(block, agents.start as u64);
        for agent in agents {
            if random.unit() < self.stop {
                tell(agent, seconds);
            }
        }
    }

    /// True if [`Noise::speed_factors`] can differ from 1.
    pub fn has_velocity(&self) -> bool {
        !self.velocity.is_none()
    }

    /// Writes the speed factors, above 0 and at most 1, of the agents from `first` on in
    /// a block.
    pub fn speed_factors(&self, block: u64, first: usize, factors: &mut [f64]) {
        if self.velocity.is_none() {
            factors.fill(1.0);
            return;
        }
        let VelocityNoise { std, floor } = self.velocity;
        let mut random = self.speeds.clone();
        random.go_to(block, first as u64);
        for factor in factors {
            *factor = (1.0 - std * normal(random.unit()).abs()).max(floor);
        }
    }
}

impl Noise {
    /// True if [`Noise::slips`] can differ from none.
    pub fn has_slips(&self) -> bool {
        !self.twist.is_none()
    }

    /// Writes the errors of velocity of the agents from `first` on in a block.
    pub fn slips(&self, block: u64, first: usize, slips: &mut [Slip]) {
        const MOST: f64 = 3.0;
        let TwistNoise {
            std,
            turn_rad_per_m,
        } = self.twist;
        let mut random = self.twists.clone();
        random.go_to(block, 3 * first as u64);
        for slip in slips {
            let [x, y, turn] = [(); 3].map(|()| normal(random.unit()).clamp(-MOST, MOST));
            *slip = Slip {
                x: std * x,
                y: std * y,
                omega: std * turn,
                turn_rad_per_m: turn_rad_per_m * turn,
            };
        }
    }
}

/// Latencies and losses of messages of one direction.
#[derive(Debug, Clone)]
pub(crate) struct MessageNoise {
    messages: Messages,
    period_s: f64,
    random: SeededRandom,
}

impl MessageNoise {
    /// `direction` keeps the values of the two directions apart.
    pub(crate) fn new(direction: &str, messages: &Messages, seed: u64, period_s: f64) -> Self {
        Self {
            messages: *messages,
            period_s,
            random: SeededRandom::new(direction, seed),
        }
    }

    /// Latency, in blocks, of an agent's message that is sent in a block; `None` if it is
    /// lost.
    pub(crate) fn travel(&mut self, block: u64, agent: u32) -> Option<u64> {
        self.random.go_to(block, u64::from(agent));
        let bits = self.random.next_u64();
        self.blocks(bits)
    }

    fn blocks(&self, bits: u64) -> Option<u64> {
        let unit = |bits: u64| (bits as f64 + 0.5) / (1u64 << 32) as f64;
        let Messages {
            delay_min_s,
            delay_max_s,
            loss,
        } = self.messages;
        if unit(bits >> 32) < loss {
            return None;
        }
        let delay_s = delay_min_s + (delay_max_s - delay_min_s) * unit(bits & 0xFFFF_FFFF);
        // Rounding must not add a block.
        Some((delay_s / self.period_s * (1.0 - 1e-12)).ceil() as u64)
    }
}

/// Quantile function of the standard normal distribution, for p between 0 and 1. Rational
/// approximations of Wichura (Algorithm AS 241, Applied Statistics 37, 1988), PPND16: to
/// about 1 part in 10¹⁶, and one variate for one random number.
fn normal(p: f64) -> f64 {
    let polynomial = |coefficients: &[f64; 8], x: f64| {
        let terms = coefficients.iter().rev();
        terms.fold(0.0, |sum, coefficient| sum * x + coefficient)
    };
    let q = p - 0.5;
    if q.abs() <= 0.425 {
        let r = 0.180_625 - q * q;
        return q * polynomial(&wichura::A, r) / polynomial(&wichura::B, r);
    }
    let tail = if q < 0.0 { p } else { 1.0 - p };
    let r = libm::sqrt(-libm::log(tail));
    let magnitude = if r <= 5.0 {
        polynomial(&wichura::C, r - 1.6) / polynomial(&wichura::D, r - 1.6)
    } else {
        polynomial(&wichura::E, r - 5.0) / polynomial(&wichura::F, r - 5.0)
    };
    magnitude.copysign(q)
}

/// The coefficients of AS 241, from the constant term on: numerators and
/// denominators near the middle, in the tails, and far out in them.
#[allow(clippy::excessive_precision, reason = "as published")]
mod wichura {
    pub(super) const A: [f64; 8] = [
        3.387_132_872_796_366_608_0,
        133.141_667_891_784_377_45,
        1_971.590_950_306_551_442_7,
        13_731.693_765_509_461_125,
        45_921.953_931_549_871_457,
        67_265.770_927_008_700_853,
        33_430.575_583_588_128_105,
        2_509.080_928_730_122_672_7,
    ];
    pub(super) const B: [f64; 8] = [
        1.0,
        42.313_330_701_600_911_252,
        687.187_007_492_057_908_30,
        5_394.196_021_424_751_107_7,
        21_213.794_301_586_595_867,
        39_307.895_800_092_710_610,
        28_729.085_735_721_942_674,
        5_226.495_278_852_854_561_0,
    ];
    pub(super) const C: [f64; 8] = [
        1.423_437_110_749_683_577_34,
        4.630_337_846_156_545_295_90,
        5.769_497_221_460_691_405_50,
        3.647_848_324_763_204_605_04,
        1.270_458_252_452_368_382_58,
        0.241_780_725_177_450_611_770,
        0.022_723_844_989_269_184_583_3,
        7.745_450_142_783_414_076_40e-4,
    ];
    pub(super) const D: [f64; 8] = [
        1.0,
        2.053_191_626_637_758_821_87,
        1.676_384_830_183_803_849_40,
        0.689_767_334_985_100_004_550,
        0.148_103_976_427_480_074_590,
        0.015_198_666_563_616_457_196_6,
        5.475_938_084_995_344_946_00e-4,
        1.050_750_071_644_416_843_24e-9,
    ];
    pub(super) const E: [f64; 8] = [
        6.657_904_643_501_103_777_20,
        5.463_784_911_164_114_369_90,
        1.784_826_539_917_291_335_80,
        0.296_560_571_828_504_891_230,
        0.026_532_189_526_576_123_093_0,
        1.242_660_947_388_078_438_60e-3,
        2.711_555_568_743_487_578_15e-5,
        2.010_334_399_292_288_132_65e-7,
    ];
    pub(super) const F: [f64; 8] = [
        1.0,
        0.599_832_206_555_887_937_690,
        0.136_929_880_922_735_805_310,
        0.014_875_361_290_850_614_852_5,
        7.868_691_311_456_132_591_00e-4,
        1.846_318_317_510_054_681_80e-5,
        1.421_511_758_316_445_888_70e-7,
        2.044_263_103_389_939_785_64e-15,
    ];
}

/// A time in text: `2s`, `250ms`, or a number of seconds.
fn seconds(text: &str) -> Option<f64> {
    let (number, unit) = match text.strip_suffix("ms") {
        Some(number) => (number, 1e-3),
        None => (text.strip_suffix('s').unwrap_or(text), 1.0),
    };
    // Without the other number words that Rust parses.
    let looks_right = number.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c));
    let number: f64 = number.parse().ok().filter(|_| looks_right)?;
    number.is_finite().then_some(number * unit)
}

/// A number in text without a unit.
fn number(text: &str) -> Option<f64> {
    let has_unit = text.ends_with('s');
    seconds(text).filter(|_| !has_unit)
}

/// Two values, separated by a comma.
fn two(text: &str) -> Option<(&str, &str)> {
    let (one, two) = text.split_once(',')?;
    Some((one.trim(), two.trim()))
}

fn unreadable(
    field: &'static str,
    text: &str,
    reason: &'static str,
    hint: &'static str,
) -> SimError {
    SimError::Config {
        field,
        value: text.to_owned(),
        reason,
        hint,
    }
}

impl FromStr for Delay {
    type Err = SimError;

    fn from_str(text: &str) -> Result<Self, SimError> {
        let (kind, values) = text.split_once(':').unwrap_or((text, ""));
        let both = |first: fn(&str) -> Option<f64>| {
            two(values).and_then(|(one, two)| first(one).zip(seconds(two)))
        };
        let (delay, hint) = match kind.trim() {
            "none" => (
                values.is_empty().then_some(Self::None),
                "none takes no values",
            ),
            "bernoulli" => (
                both(number).map(|(p, seconds)| Self::Bernoulli { p, seconds }),
                "write bernoulli:PROBABILITY,TIME, for example bernoulli:0.1,2s",
            ),
            "uniform" => (
                both(seconds).map(|(min_s, max_s)| Self::Uniform { min_s, max_s }),
                "write uniform:LEAST,MOST, for example uniform:0s,1s",
            ),
            "gaussian" => (
                both(seconds).map(|(mean_s, std_s)| Self::Gaussian { mean_s, std_s }),
                "write gaussian:MEAN,DEVIATION, for example gaussian:500ms,200ms",
            ),
            "bursts" => (
                both(number).map(|(rate_per_s, seconds)| Self::Bursts {
                    rate_per_s,
                    seconds,
                }),
                "write bursts:STOPS_PER_SECOND,TIME, for example bursts:0.01,5s",
            ),
            _ => {
                let hint = "use none, bernoulli:P,TIME, uniform:LEAST,MOST, \
                            gaussian:MEAN,DEVIATION or bursts:RATE,TIME";
                return Err(unreadable("delay", text, "is not a kind of delay", hint));
            }
        };
        let reason = "does not have the values of its kind";
        let delay = delay.ok_or_else(|| unreadable("delay", text, reason, hint))?;
        delay.validate()?;
        Ok(delay)
    }
}

impl fmt::Display for Delay {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::None => f.write_str("none"),
            Self::Bernoulli { p, seconds } => write!(f, "bernoulli:{p},{seconds}s"),
            Self::Uniform { min_s, max_s } => write!(f, "uniform:{min_s}s,{max_s}s"),
            Self::Gaussian { mean_s, std_s } => write!(f, "gaussian:{mean_s}s,{std_s}s"),
            Self::Bursts {
                rate_per_s,
                seconds,
            } => write!(f, "bursts:{rate_per_s},{seconds}s"),
        }
    }
}

impl FromStr for VelocityNoise {
    type Err = SimError;

    fn from_str(text: &str) -> Result<Self, SimError> {
        let reason = "is not two numbers";
        let hint = "write DEVIATION,FLOOR as shares of the speed, for example 0.1,0.2";
        let (std, floor) = two(text)
            .and_then(|(std, floor)| number(std).zip(number(floor)))
            .ok_or_else(|| unreadable("velocity", text, reason, hint))?;
        let noise = Self { std, floor };
        noise.validate()?;
        Ok(noise)
    }
}

impl fmt::Display for VelocityNoise {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{},{}", self.std, self.floor)
    }
}

impl FromStr for TwistNoise {
    type Err = SimError;

    fn from_str(text: &str) -> Result<Self, SimError> {
        let reason = "is not two numbers";
        let hint = "write DEVIATION,TURN: a share of the speed and radians per metre, for example 0.05,0.02";
        let (std, turn_rad_per_m) = two(text)
            .and_then(|(std, turn)| number(std).zip(number(turn)))
            .ok_or_else(|| unreadable("twist", text, reason, hint))?;
        let noise = Self {
            std,
            turn_rad_per_m,
        };
        noise.validate()?;
        Ok(noise)
    }
}

impl fmt::Display for TwistNoise {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{},{}", self.std, self.turn_rad_per_m)
    }
}

impl FromStr for Messages {
    type Err = SimError;

    fn from_str(text: &str) -> Result<Self, SimError> {
        let reason = "is not two times and a probability";
        let hint = "write LEAST,MOST,LOSS, for example 50ms,200ms,0.05";
        let messages = two(text).and_then(|(least, rest)| {
            let (most, loss) = two(rest)?;
            Some(Self {
                delay_min_s: seconds(least)?,
                delay_max_s: seconds(most)?,
                loss: number(loss)?,
            })
        });
        let messages = messages.ok_or_else(|| unreadable("messages", text, reason, hint))?;
        messages.validate()?;
        Ok(messages)
    }
}

impl fmt::Display for Messages {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            delay_min_s,
            delay_max_s,
            loss,
        } = self;
        write!(f, "{delay_min_s}s,{delay_max_s}s,{loss}")
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "values are repeated, not computed anew")]
mod tests {
    use super::*;

    fn noise(delay: &str, velocity: VelocityNoise) -> Noise {
        let disturbance = Disturbance {
            seed: 7,
            delay: delay.parse().expect("a delay"),
            velocity,
            ..Disturbance::default()
        };
        Noise::new(&disturbance, 0.1)
    }

    fn even() -> VelocityNoise {
        VelocityNoise::default()
    }

    /// Mean and standard deviation.
    fn moments(values: &[f64]) -> (f64, f64) {
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let squares = values.iter().map(|value| (value - mean) * (value - mean));
        (mean, (squares.sum::<f64>() / count).sqrt())
    }

    /// libm's error function is the oracle.
    #[test]
    fn normal_inverts_the_distribution_function() {
        let probabilities = (1..2000).map(|i| f64::from(i) / 2000.0);
        let tails = (3..=300).map(|i| libm::pow(10.0, -f64::from(i)));
        for p in probabilities.chain(tails) {
            let z = normal(p);
            let back = 0.5 * libm::erfc(-z / 2f64.sqrt());
            assert!((back / p - 1.0).abs() < 1e-12, "{p}: {z}, {back}");
            if p >= 1e-3 {
                assert!((normal(1.0 - p) + z).abs() < 1e-11, "{p}");
            }
        }
    }

    #[test]
    fn delays_have_their_distributions() {
        let delays = |text: &str| -> Vec<f64> {
            let noise = noise(text, even());
            let pairs = (0..100).flat_map(|agent| (1..=200).map(move |action| (agent, action)));
            pairs
                .map(|(agent, action)| noise.start_delay_s(agent, action))
                .collect()
        };
        assert!(delays("none").iter().all(|delay| *delay == 0.0));
        let late = delays("bernoulli:0.1,2s");
        let share = late.iter().filter(|delay| **delay == 2.0).count() as f64 / 20_000.0;
        assert!(late.iter().all(|delay| [0.0, 2.0].contains(delay)));
        assert!((share - 0.1).abs() < 0.01, "{share}");
        let uniform = delays("uniform:0.5,1500ms");
        assert!(uniform.iter().all(|delay| (0.5..=1.5).contains(delay)));
        let (mean, deviation) = moments(&uniform);
        assert!((mean - 1.0).abs() < 0.01, "{mean}");
        assert!((deviation - 1.0 / 12f64.sqrt()).abs() < 0.01, "{deviation}");
        let (mean, deviation) = moments(&delays("gaussian:5s,500ms"));
        assert!((mean - 5.0).abs() < 0.02 && (deviation - 0.5).abs() < 0.02);
        let truncated = delays("gaussian:0s,1s");
        let never = truncated.iter().filter(|delay| **delay == 0.0).count();
        assert!(truncated.iter().all(|delay| *delay >= 0.0) && (9500..10_500).contains(&never));
    }

    /// Values do not depend on the order or the partition of draws.
    #[test]
    fn values_do_not_depend_on_the_order_of_evaluation() {
        let velocity = VelocityNoise {
            std: 0.3,
            floor: 0.2,
        };
        let noise = noise("bursts:0.5,5s", velocity);
        let (mut all, mut pieces) = (vec![0.0; 200], vec![0.0; 200]);
        noise.speed_factors(9, 0, &mut all);
        for first in (0..200).step_by(40).rev() {
            noise.speed_factors(9, first, &mut pieces[first..first + 40]);
        }
        assert_eq!(all, pieces);
        let mut other = vec![0.0; 200];
        noise.speed_factors(10, 0, &mut other);
        assert_ne!(all, other, "another block");
        assert!(all.iter().all(|factor| (0.2..=1.0).contains(factor)));
        let stops = |ranges: &[std::ops::Range<usize>]| {
            let mut found = Vec::new();
            for range in ranges {
                noise.stops(9, range.clone(), |agent, seconds| {
                    found.push((agent, seconds));
                });
            }
            found.sort_by_key(|stop| stop.0);
            found
        };
        let found = stops(&[0..500, 500..1000]);
        assert_eq!(found, stops(&[640..1000, 0..64, 64..640]));
        assert!(found.iter().all(|(_, seconds)| *seconds == 5.0));
        // 1 − exp(−0.05) of a thousand agents.
        assert!((30..70).contains(&found.len()), "{}", found.len());
    }

    #[test]
    fn seeds_and_purposes_are_unrelated() {
        let of = |seed| {
            let delay = Delay::Uniform {
                min_s: 0.0,
                max_s: 1.0,
            };
            let disturbance = Disturbance {
                seed,
                delay,
                ..Disturbance::default()
            };
            Noise::new(&disturbance, 0.1)
        };
        assert_eq!(of(1).start_delay_s(3, 4), of(1).start_delay_s(3, 4));
        assert_ne!(of(1).start_delay_s(3, 4), of(2).start_delay_s(3, 4));
        assert_ne!(of(1).start_delay_s(3, 4), of(1).start_delay_s(4, 3));
        let messages: Messages = "0s,1s,0.5".parse().expect("messages");
        let sent = |direction: &str| -> Vec<Option<u64>> {
            let mut noise = MessageNoise::new(direction, &messages, 1, 0.1);
            (0..100).map(|agent| noise.travel(5, agent)).collect()
        };
        let (reports, releases) = (sent("report"), sent("release"));
        assert_ne!(reports, releases);
        assert!(reports.iter().flatten().all(|blocks| *blocks <= 10));
        let lost = reports.iter().filter(|report| report.is_none()).count();
        assert!((30..70).contains(&lost), "{lost}");
    }

    #[test]
    fn slips_are_bounded_shares_of_the_motion() {
        let disturbance = Disturbance {
            seed: 7,
            twist: "0.1,0.2".parse().expect("errors"),
            ..Disturbance::default()
        };
        let noise = Noise::new(&disturbance, 0.1);
        assert!(noise.has_slips() && disturbance.moves_agents());
        let mut all = vec![Slip::default(); 3000];
        noise.slips(4, 0, &mut all);
        // Every agent has its own, whoever is asked with it.
        let mut pieces = vec![Slip::default(); 3000];
        for first in (0..3000).step_by(60) {
            noise.slips(4, first, &mut pieces[first..first + 60]);
        }
        assert_eq!(all, pieces);
        let errors: Vec<[f64; 3]> = all.iter().map(|slip| slip.of(3.0, -4.0, 0.5)).collect();
        for (side, deviation) in [(0, 0.5), (1, 0.5), (2, 0.1 * 0.5 + 0.2 * 5.0)] {
            let values: Vec<f64> = errors.iter().map(|error| error[side]).collect();
            let (mean, std) = moments(&values);
            assert!(mean.abs() < 0.1 * deviation, "{side}: {mean}");
            assert!((std / deviation - 1.0).abs() < 0.1, "{side}: {std}");
            assert!(
                values
                    .iter()
                    .all(|value| value.abs() <= 3.0 * deviation * (1.0 + 1e-12))
            );
        }
        // Whoever stands does not slip.
        assert!(all.iter().all(|slip| slip.of(0.0, 0.0, 0.0) == [0.0; 3]));
        assert!(!Noise::new(&Disturbance::default(), 0.1).has_slips());
    }

    #[test]
    fn text_and_json_give_back_what_they_were_given() {
        for text in [
            "none",
            "bernoulli:0.1,2s",
            "uniform:0s,1.5s",
            "gaussian:0.5s,0.2s",
            "bursts:0.01,5s",
        ] {
            let delay: Delay = text.parse().expect("a delay");
            assert_eq!(delay.to_string(), text);
            let json = serde_json::to_string(&delay).expect("JSON");
            assert_eq!(
                serde_json::from_str::<Delay>(&json).expect("a delay"),
                delay
            );
        }
        let delay: Delay = "gaussian: 500ms, .2".parse().expect("a delay");
        assert_eq!(delay.to_string(), "gaussian:0.5s,0.2s");
        let velocity: VelocityNoise = "0.1,0.2".parse().expect("velocity noise");
        assert_eq!(velocity.to_string(), "0.1,0.2");
        let twist: TwistNoise = "0.05,.02".parse().expect("errors");
        assert_eq!(twist.to_string(), "0.05,0.02");
        let messages: Messages = "50ms,0.2s,0.05".parse().expect("messages");
        assert_eq!(messages.to_string(), "0.05s,0.2s,0.05");
        let empty: Disturbance = serde_json::from_str("{}").expect("nothing");
        assert!(empty.is_none() && empty.validate().is_ok());
    }

    #[test]
    fn what_makes_no_sense_is_refused() {
        let delays = [
            "",
            "poisson:1",
            "none:1",
            "bernoulli",
            "bernoulli:0.1",
            "bernoulli:1.1,2s",
            "bernoulli:0.1s,2s",
            "bernoulli:NaN,2s",
            "bernoulli:0.1,inf",
            "bernoulli:0.1,-2s",
            "uniform:2s,1s",
            "uniform:a,b",
            "gaussian:1s,-1s",
            "gaussian:1s",
            "bursts:-1,5s",
            "bursts:1e3,1e3s",
            "uniform:0,1,2",
        ];
        for text in delays {
            let error = text.parse::<Delay>().expect_err(text);
            assert!(error.hint().is_some(), "{text}: {error}");
        }
        for text in ["", "0.1", "0.1,0", "-0.1,0.5", "0.1,2", "0.1s,0.2"] {
            let error = text.parse::<VelocityNoise>().expect_err(text);
            assert!(error.hint().is_some(), "{text}: {error}");
        }
        for text in ["", "0.1", "0.4,0", "-0.1,0", "0.1,2", "0.1,0.1s", "nan,0"] {
            let error = text.parse::<TwistNoise>().expect_err(text);
            assert!(error.hint().is_some(), "{text}: {error}");
        }
        for text in [
            "",
            "1s,2s",
            "2s,1s,0",
            "0,1s,1",
            "0,1s,-0.1",
            "-1s,1s,0",
            "0,nan,0",
        ] {
            let error = text.parse::<Messages>().expect_err(text);
            assert!(error.hint().is_some(), "{text}: {error}");
        }
        let json = r#"{"kind":"uniform","min_s":0,"max_s":1,"more":2}"#;
        assert!(serde_json::from_str::<Delay>(json).is_err());
    }
}

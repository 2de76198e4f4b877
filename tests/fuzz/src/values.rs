//! Values of a line, as options and suites give them.

use std::fmt::{Debug, Display};
use std::str::FromStr;

use fleetyard_bench::Shard;
use fleetyard_core::{Words as _, shown};
use fleetyard_runtime::measure::Cpus;
use fleetyard_sim::motion::Model;
use fleetyard_sim::noise::{Delay, Messages, VelocityNoise};
use fleetyard_sim::{SimConfig, Tier};

/// Reads every line as a value of every kind.
pub fn run(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else {
        return;
    };
    for line in text.lines() {
        let cpus = same::<Cpus>(line);
        assert!(cpus.is_none_or(|cpus| cpus.is_sorted_by(|one, next| one < next)));
        if let Some(shard) = same::<Shard>(line) {
            let (index, of) = shard.parts();
            assert!((1..=of).contains(&index));
        }
        if let Some(delay) = same::<Delay>(line) {
            delay.validate().expect("what was read can be");
        }
        if let Some(noise) = same::<VelocityNoise>(line) {
            noise.validate().expect("what was read can be");
        }
        if let Some(messages) = same::<Messages>(line) {
            messages.validate().expect("what was read can be");
        }
        if let Some(tier) = Tier::from_name(line) {
            assert_eq!(tier.name(), line);
        }
        if let Ok(model) = line.parse::<Model>() {
            model.validate().expect("what was read can be");
        }
        assert!(shown(line).chars().all(|letter| !letter.is_control()));
    }
    // The numbers of a simulation, as suites and recordings hold them.
    if let Ok(config) = serde_json::from_str::<SimConfig>(text)
        && config.validate().is_ok()
    {
        let written = serde_json::to_string(&config).expect("numbers can be written");
        let again: SimConfig = serde_json::from_str(&written).expect("and read again");
        assert_eq!(again, config);
    }
}

/// A value, which is the same when it is written and read again.
fn same<T>(line: &str) -> Option<T>
where
    T: FromStr<Err: Display> + Display + PartialEq + Debug,
{
    match line.parse::<T>() {
        Ok(value) => {
            let written = value.to_string();
            let again = written.parse::<T>().ok();
            assert_eq!(again.as_ref(), Some(&value), "{line} is written {written}");
            Some(value)
        }
        Err(error) => {
            assert!(!error.to_string().is_empty());
            None
        }
    }
}

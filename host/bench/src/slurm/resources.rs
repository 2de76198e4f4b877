//! Resources that a shard asks the cluster for.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::Error;

/// Resources of every task of the array. Absent ones are the site's defaults, or those of its
/// `SBATCH_…` variables.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Resources {
    /// The partition, or several with commas.
    pub partition: Option<String>,
    /// The account that pays.
    pub account: Option<String>,
    /// The quality of service.
    pub qos: Option<String>,
    /// The time after which a task is ended, rounded up to seconds.
    pub time: Option<Duration>,
    /// CPUs of a task.
    pub cpus: Option<u32>,
    /// Memory of a task in bytes, rounded up to MiB.
    pub memory: Option<u64>,
    /// The nodes to use.
    pub nodelist: Option<String>,
    /// True if nobody else may be on the node.
    pub exclusive: bool,
    /// Most tasks that run at once.
    pub max_running: Option<u32>,
    /// More options of `sbatch`, long names without dashes: `constraint=avx512`.
    pub options: Vec<String>,
}

/// Options of `sbatch` that the run depends on.
const OURS: [&str; 14] = [
    "array",
    "chdir",
    "error",
    "help",
    "input",
    "job-name",
    "no-requeue",
    "open-mode",
    "output",
    "parsable",
    "test-only",
    "usage",
    "version",
    "wrap",
];

impl Resources {
    /// These resources, with those that `other` names in their place.
    #[must_use]
    pub fn with(&self, other: &Self) -> Self {
        let text =
            |other: &Option<String>, own: &Option<String>| other.as_ref().or(own.as_ref()).cloned();
        let mut options = self.options.clone();
        // Of an option that is given twice sbatch takes the last.
        options.extend(other.options.iter().cloned());
        Self {
            partition: text(&other.partition, &self.partition),
            account: text(&other.account, &self.account),
            qos: text(&other.qos, &self.qos),
            time: other.time.or(self.time),
            cpus: other.cpus.or(self.cpus),
            memory: other.memory.or(self.memory),
            nodelist: text(&other.nodelist, &self.nodelist),
            exclusive: other.exclusive || self.exclusive,
            max_running: other.max_running.or(self.max_running),
            options,
        }
    }

    /// The options for `sbatch`, without the array.
    pub(super) fn arguments(&self) -> Result<Vec<String>, Error> {
        let mut arguments = Vec::new();
        let texts = [
            ("partition", &self.partition),
            ("account", &self.account),
            ("qos", &self.qos),
            ("nodelist", &self.nodelist),
        ];
        for (name, value) in texts {
            if let Some(value) = value {
                if value.is_empty() || value.contains(char::is_control) {
                    return Err(Error::option(
                        format!("`--{name}` is empty or has control characters"),
                        "name what the site calls it",
                    ));
                }
                arguments.push(format!("--{name}={value}"));
            }
        }
        if let Some(time) = self.time {
            arguments.push(format!("--time={}", slurm_time(time)));
        }
        if let Some(cpus) = self.cpus {
            arguments.push(format!("--cpus-per-task={cpus}"));
        }
        if let Some(memory) = self.memory {
            arguments.push(format!("--mem={}M", memory.div_ceil(1 << 20).max(1)));
        }
        if self.exclusive {
            arguments.push("--exclusive".into());
        }
        for option in &self.options {
            arguments.push(passed_on(option)?);
        }
        Ok(arguments)
    }
}

/// `D-HH:MM:SS`, as sbatch takes it.
fn slurm_time(time: Duration) -> String {
    let seconds = time.as_secs() + u64::from(time.subsec_nanos() > 0);
    let (minutes, second) = (seconds / 60, seconds % 60);
    let (hours, minute) = (minutes / 60, minutes % 60);
    let (days, hour) = (hours / 24, hours % 24);
    format!("{days}-{hour:02}:{minute:02}:{second:02}")
}

/// An option that goes to sbatch as it is, unless the run would not work with it.
fn passed_on(option: &str) -> Result<String, Error> {
    let text = option.strip_prefix("--").unwrap_or(option);
    let name = text.split('=').next().unwrap_or_default();
    let good = |c: char| c.is_ascii_alphanumeric() || c == '-';
    if name.len() < 2
        || name.starts_with('-')
        || !name.chars().all(good)
        || text.contains(char::is_control)
    {
        return Err(Error::option(
            format!("`{}` is not an option of sbatch", option.escape_default()),
            "write NAME=VALUE or NAME with the long name, such as constraint=avx512",
        ));
    }
    // sbatch takes any beginning of a name that is clear.
    let ours = OURS.iter().find(|ours| ours.starts_with(name));
    let waits = name == "wait";
    if let Some(ours) = ours.copied().or(waits.then_some("wait")) {
        return Err(Error::option(
            format!("`--{ours}` is set by fleetyard"),
            "the options of `fleetyard bench` say where a run is and how many run at once",
        ));
    }
    Ok(format!("--{text}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_of_sbatch() {
        let resources = Resources {
            partition: Some("short,long".into()),
            account: Some("my account".into()),
            time: Some(Duration::from_millis(90_061_500)),
            cpus: Some(2),
            memory: Some((4 << 30) + 1),
            exclusive: true,
            options: vec!["constraint=avx512&ib".into(), "--nice".into()],
            ..Resources::default()
        };
        assert_eq!(
            resources.arguments().unwrap(),
            [
                "--partition=short,long",
                "--account=my account",
                "--time=1-01:01:02",
                "--cpus-per-task=2",
                "--mem=4097M",
                "--exclusive",
                "--constraint=avx512&ib",
                "--nice"
            ]
        );
        let more = Resources {
            time: Some(Duration::from_mins(1)),
            options: vec!["nice=5".into()],
            ..Resources::default()
        };
        let both = resources.with(&more);
        assert_eq!(both.time, more.time);
        assert_eq!(both.cpus, Some(2));
        assert_eq!(both.options.last().unwrap(), "nice=5");
    }

    #[test]
    fn what_would_break_the_run_is_refused() {
        for wrong in [
            "array=0-3",
            "--arr=0-3",
            "output=x",
            "outp=x",
            "wrap=rm",
            "wait",
            "job-name=x",
            "-p",
            "p=x",
            "",
            "--",
            "---x",
            "a b=c",
            "nice=5\n#SBATCH",
        ] {
            let resources = Resources {
                options: vec![wrong.into()],
                ..Resources::default()
            };
            assert!(resources.arguments().is_err(), "{wrong:?}");
        }
        let resources = Resources {
            qos: Some("a\nb".into()),
            ..Resources::default()
        };
        assert!(resources.arguments().is_err());
    }
}

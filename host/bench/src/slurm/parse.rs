//! Output of Slurm's commands, read strictly: a line that is not as documented is an error and
//! never a guess.
//!
//! The formats are those of `sbatch --parsable`, `squeue --format`, `sacct --parsable2` and
//! `scontrol --oneliner show job` (see their manual pages), from Slurm 17.11 on.

use super::Error;

/// A job that was accepted.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Submitted {
    pub(super) job: u32,
    /// With several clusters, the one that took it.
    pub(super) cluster: Option<String>,
}

/// The tasks of an array that a line is about: `3`, `4-7%2`, `1,5-9:2`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Tasks(Vec<Span>);

/// Indices from `first` to `last`, every `step`-th.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Span {
    first: u32,
    last: u32,
    step: u32,
}

impl Tasks {
    pub(super) fn has(&self, index: u32) -> bool {
        self.0.iter().any(|span| {
            (span.first..=span.last).contains(&index)
                && (index - span.first).is_multiple_of(span.step)
        })
    }

    fn parse(text: &str) -> Option<Self> {
        // How many may run at once is not a matter of which there are.
        let (indices, limit) = match text.split_once('%') {
            Some((indices, limit)) => (indices, Some(limit)),
            None => (text, None),
        };
        if limit.is_some_and(|limit| number(limit).is_none()) {
            return None;
        }
        let span = |text: &str| {
            let (range, step) = match text.split_once(':') {
                Some((range, step)) => (range, number(step).filter(|step| *step > 0)?),
                None => (text, 1),
            };
            let (first, last) = range.split_once('-').unwrap_or((range, range));
            let (first, last) = (number(first)?, number(last)?);
            (first <= last).then_some(Span { first, last, step })
        };
        indices
            .split(',')
            .map(span)
            .collect::<Option<_>>()
            .map(Self)
    }
}

/// One line about a job: some of an array's tasks and how they are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Line {
    pub(super) job: u32,
    /// `None`: the line is about the job as a whole.
    pub(super) tasks: Option<Tasks>,
    pub(super) state: State,
    /// The name of the job.
    pub(super) name: String,
    /// Exit code and the signal that ended it, where the command says so.
    pub(super) exit: Option<(u32, u32)>,
    /// The node, where there is one.
    pub(super) node: Option<String>,
    /// The reason of the state, in Slurm's word.
    pub(super) reason: Option<String>,
}

impl Line {
    /// True if the line is about this task of the array.
    pub(super) fn is_about(&self, index: u32) -> bool {
        self.tasks.as_ref().is_none_or(|tasks| tasks.has(index))
    }
}

/// The state of a job, as far as it makes a difference.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum State {
    Pending,
    Running,
    /// Its processes are being ended.
    Completing,
    Completed,
    Failed,
    Timeout,
    NodeFail,
    OutOfMemory,
    Cancelled,
    Preempted,
    /// One that this program does not know; Slurm gains states.
    Other(String),
}

impl State {
    fn parse(text: &str) -> Option<Self> {
        // sacct says who: `CANCELLED by 1000`.
        let word = text.split(' ').next().unwrap_or_default();
        Some(match word {
            "PENDING" | "REQUEUED" | "REQUEUE_HOLD" | "REQUEUE_FED" | "RESV_DEL_HOLD"
            | "SPECIAL_EXIT" => Self::Pending,
            "RUNNING" | "CONFIGURING" | "SUSPENDED" | "STOPPED" | "SIGNALING" | "RESIZING"
            | "POWER_UP_NODE" => Self::Running,
            "COMPLETING" | "STAGE_OUT" => Self::Completing,
            "COMPLETED" => Self::Completed,
            "FAILED" | "LAUNCH_FAILED" | "RECONFIG_FAIL" => Self::Failed,
            "TIMEOUT" | "DEADLINE" => Self::Timeout,
            "NODE_FAIL" | "BOOT_FAIL" => Self::NodeFail,
            "OUT_OF_MEMORY" => Self::OutOfMemory,
            "CANCELLED" | "REVOKED" => Self::Cancelled,
            "PREEMPTED" => Self::Preempted,
            _ => {
                let known = |c: char| c.is_ascii_uppercase() || c.is_ascii_digit() || c == '_';
                let is_word = !word.is_empty() && word.len() <= 40 && word.chars().all(known);
                return is_word.then(|| Self::Other(word.to_owned()));
            }
        })
    }
}

/// The output of `sbatch --parsable`: `123` or `123;cluster`. Wrappers and plugins of a site may
/// print lines of their own before.
pub(super) fn submitted(output: &str) -> Result<Submitted, Error> {
    let last = output.lines().map(str::trim).rfind(|line| !line.is_empty());
    let parsed = last.and_then(|line| {
        let (job, cluster) = match line.split_once(';') {
            Some((job, cluster)) => (job, Some(cluster)),
            None => (line, None),
        };
        let job = number(job).filter(|job| *job > 0)?;
        // Before a later command's option it must not look like one.
        let plain = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-' || c == '.';
        let good =
            |name: &str| !name.is_empty() && !name.starts_with('-') && name.chars().all(plain);
        if cluster.is_some_and(|cluster| !good(cluster)) {
            return None;
        }
        Some(Submitted {
            job,
            cluster: cluster.map(str::to_owned),
        })
    });
    parsed.ok_or_else(|| Error::output("sbatch", last.unwrap_or_default()))
}

/// The format for `squeue --format` that [`squeue`] reads. The reason, which may be any
/// text, comes last; the name of a job of ours has no such character.
pub(super) const SQUEUE_FORMAT: &str = "%i|%T|%j|%N|%r";

/// Lines of `squeue --noheader` in [`SQUEUE_FORMAT`].
pub(super) fn squeue(output: &str) -> Result<Vec<Line>, Error> {
    lines("squeue", output, |line| {
        let mut fields = line.splitn(5, '|');
        let (job, tasks) = task_id(fields.next()?)?;
        let state = State::parse(fields.next()?)?;
        let name = fields.next()?.to_owned();
        let node = known(fields.next()?);
        let reason = known(fields.next()?);
        Some(Line {
            job,
            tasks,
            state,
            name,
            exit: None,
            node,
            reason,
        })
    })
}

/// The columns for `sacct --format` that [`sacct`] reads.
pub(super) const SACCT_FORMAT: &str = "JobID,State,ExitCode,NodeList,JobName";

/// Lines of `sacct --noheader --parsable2 --allocations` in [`SACCT_FORMAT`].
pub(super) fn sacct(output: &str) -> Result<Vec<Line>, Error> {
    lines("sacct", output, |line| {
        let mut fields = line.splitn(5, '|');
        let (job, tasks) = task_id(fields.next()?)?;
        let state = State::parse(fields.next()?)?;
        let exit = exit_code(fields.next()?)?;
        let node = known(fields.next()?);
        let name = fields.next()?.to_owned();
        Some(Line {
            job,
            tasks,
            state,
            name,
            exit: Some(exit),
            node,
            reason: None,
        })
    })
}

/// Lines of `scontrol --oneliner show job`: pairs `Key=value`, values without quotes. A
/// value may have spaces and look like a pair, so the first pair of a key counts: those
/// that are read here all come before paths, comments and other text of users, but for
/// the name of the job, which has to be the expected one.
pub(super) fn scontrol(output: &str) -> Result<Vec<Line>, Error> {
    lines("scontrol", output, |line| {
        let value = |key: &str| {
            let pairs = line.split(' ').filter_map(|word| word.split_once('='));
            let mut values = pairs.filter(|(name, _)| *name == key);
            values.next().map(|(_, value)| value)
        };
        let own = number(value("JobId")?)?;
        let (job, tasks) = match (value("ArrayJobId"), value("ArrayTaskId")) {
            (Some(array), Some(tasks)) => (number(array)?, Some(Tasks::parse(tasks)?)),
            (None, None) => (own, None),
            _ => return None,
        };
        Some(Line {
            job,
            tasks,
            state: State::parse(value("JobState")?)?,
            name: value("JobName")?.to_owned(),
            exit: value("ExitCode").map_or(Some(None), |exit| exit_code(exit).map(Some))?,
            node: value("NodeList").and_then(known),
            reason: value("Reason").and_then(known),
        })
    })
}

/// Reads every line that is not empty. With `--clusters` squeue and sacct name the
/// cluster on a line of its own.
fn lines(
    command: &'static str,
    output: &str,
    parse: impl Fn(&str) -> Option<Line>,
) -> Result<Vec<Line>, Error> {
    let lines = output.lines().map(str::trim);
    lines
        .filter(|line| !line.is_empty() && !line.starts_with("CLUSTER: "))
        .map(|line| parse(line).ok_or_else(|| Error::output(command, line)))
        .collect()
}

/// `123`, `123_4`, `123_[4-7%2]`, and of a component of a heterogeneous job nothing.
fn task_id(text: &str) -> Option<(u32, Option<Tasks>)> {
    let Some((job, tasks)) = text.split_once('_') else {
        return Some((number(text)?, None));
    };
    let tasks = match tasks.strip_prefix('[') {
        Some(rest) => rest.strip_suffix(']')?,
        None => tasks,
    };
    Some((number(job)?, Some(Tasks::parse(tasks)?)))
}

/// `code:signal`.
fn exit_code(text: &str) -> Option<(u32, u32)> {
    let (code, signal) = text.split_once(':')?;
    Some((number(code)?, number(signal)?))
}

/// Digits only: the standard library would take a sign.
fn number(text: &str) -> Option<u32> {
    let digits = !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    digits.then(|| text.parse().ok())?
}

/// A value, unless it is one of Slurm's words for none.
fn known(value: &str) -> Option<String> {
    let none = ["", "None", "(null)", "N/A", "None assigned", "Unknown"];
    (!none.contains(&value)).then(|| value.to_owned())
}

/// A sorted list of indices as an array's range: `0-2,5`.
pub(super) fn ranges(indices: &[u32]) -> String {
    let mut words: Vec<String> = Vec::new();
    for chunk in indices.chunk_by(|a, b| a + 1 == *b) {
        words.push(match chunk {
            [one] => one.to_string(),
            [first, .., last] => format!("{first}-{last}"),
            [] => continue,
        });
    }
    words.join(",")
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn indices(text: &str) -> Vec<u32> {
        let tasks = Tasks::parse(text).unwrap();
        (0..40).filter(|index| tasks.has(*index)).collect()
    }

    #[test]
    fn tasks_of_an_array() {
        assert_eq!(indices("3"), [3]);
        assert_eq!(indices("4-7%2"), [4, 5, 6, 7]);
        assert_eq!(indices("1,3,5-9:2%10"), [1, 3, 5, 7, 9]);
        assert_eq!(indices("0-8:4"), [0, 4, 8]);
        for wrong in [
            "",
            "-",
            "4-",
            "-4",
            "7-4",
            "4-7%",
            "4:0",
            "4-8:0",
            "1,,2",
            "+4",
            "4 ",
            "1,2,...",
            "4294967296",
        ] {
            assert_eq!(Tasks::parse(wrong), None, "{wrong:?}");
        }
        // Nothing is allocated for what a range claims.
        assert!(Tasks::parse("0-4294967295").unwrap().has(u32::MAX));
    }

    #[test]
    fn what_sbatch_prints() {
        let plain = submitted("4711\n").unwrap();
        assert_eq!((plain.job, plain.cluster), (4711, None));
        let cluster = submitted("sbatch: lua: 12 credits left\n4711;north-2\n").unwrap();
        assert_eq!(
            (cluster.job, cluster.cluster.as_deref()),
            (4711, Some("north-2"))
        );
        for wrong in [
            "",
            "0",
            "Submitted batch job 4711",
            "-4711",
            "4711;",
            "4711;--me",
            "4711;a b",
            "99999999999",
        ] {
            assert!(submitted(wrong).is_err(), "{wrong:?}");
        }
    }

    #[test]
    fn what_squeue_prints() {
        // 22.05 and 23.11, an array of which three wait, one runs and one ends.
        let lines = squeue(
            "4711_[4-6%2]|PENDING|fleetyard-s||JobArrayTaskLimit\n\
             4711_3|RUNNING|fleetyard-s|cn17|None\n\
             4711_2|COMPLETING|fleetyard-s|cn17|None\n",
        )
        .unwrap();
        let state = |index| {
            let line = lines.iter().find(|line| line.is_about(index));
            line.map(|line| (line.state.clone(), line.node.clone(), line.reason.clone()))
        };
        assert_eq!(
            state(5),
            Some((State::Pending, None, Some("JobArrayTaskLimit".into())))
        );
        assert_eq!(state(3), Some((State::Running, Some("cn17".into()), None)));
        assert_eq!(state(2).unwrap().0, State::Completing);
        assert_eq!(state(7), None);
        assert_eq!(lines[0].name, "fleetyard-s");

        // With --clusters, and with all tasks on lines of their own (--array, 17.11).
        let lines = squeue(
            "CLUSTER: north\n88_0|PENDING|x||Resources\n88_1|CONFIGURING|x|n[1-2]|Prolog|s\n",
        )
        .unwrap();
        assert_eq!(lines.len(), 2);
        assert_eq!(lines[1].state, State::Running);
        assert_eq!(lines[1].reason.as_deref(), Some("Prolog|s"));
        assert_eq!(squeue("\n").unwrap(), []);
        // A state of tomorrow is no error, something else is.
        let tomorrow = squeue("88_0|EXPEDITING|x|n1|").unwrap();
        assert_eq!(tomorrow[0].state, State::Other("EXPEDITING".into()));
        for wrong in [
            "88_0|RUNNING",
            "88_0|running|x|n1|None",
            "88_[0-3|PENDING|x||None",
            "88_[0-3...]|PENDING|x||None",
            "|RUNNING|x|n1|None",
            "slurm_load_jobs error: Unable to contact slurm controller",
        ] {
            let Err(error) = squeue(wrong) else {
                panic!("{wrong:?} was read");
            };
            assert!(error.to_string().contains("squeue"), "{error}");
        }
    }

    #[test]
    fn what_sacct_prints() {
        // 21.08 and later.
        let lines = sacct(
            "4711_0|COMPLETED|0:0|cn17|fleetyard-s\n\
             4711_1|FAILED|3:0|cn17|fleetyard-s\n\
             4711_2|CANCELLED by 1000|0:15|cn18|fleetyard-s\n\
             4711_3|TIMEOUT|0:0|cn18|fleetyard-s\n\
             4711_4|OUT_OF_MEMORY|0:125|cn18|fleetyard-s\n\
             4711_5|NODE_FAIL|1:0|cn19|fleetyard-s\n\
             4711_[6-9%2]|PENDING|0:0|None assigned|fleetyard-s\n",
        )
        .unwrap();
        let states: Vec<State> = lines.iter().map(|line| line.state.clone()).collect();
        assert_eq!(
            states,
            [
                State::Completed,
                State::Failed,
                State::Cancelled,
                State::Timeout,
                State::OutOfMemory,
                State::NodeFail,
                State::Pending
            ]
        );
        assert_eq!(lines[1].exit, Some((3, 0)));
        assert_eq!(lines[2].exit, Some((0, 15)));
        assert!(lines[6].is_about(9) && lines[6].node.is_none());
        for wrong in [
            "4711_0|COMPLETED|0|cn17|s",
            "4711_0|COMPLETED",
            "4711.batch|FAILED|1:0|c|s",
        ] {
            assert!(sacct(wrong).is_err(), "{wrong:?}");
        }
    }

    #[test]
    fn what_scontrol_prints() {
        // 22.05: an array of which one task has ended and the others wait.
        let lines = scontrol(
            "JobId=12 ArrayJobId=11 ArrayTaskId=0 ArrayTaskThrottle=2 JobName=fleetyard-s \
             UserId=ada(1000) GroupId=ada(1000) MCS_label=N/A Priority=1 Nice=0 Account=(null) \
             QOS=(null) JobState=FAILED Reason=NonZeroExitCode Dependency=(null) Requeue=1 \
             Restarts=0 BatchFlag=1 Reboot=0 ExitCode=3:0 RunTime=00:00:01 NodeList=cn17 \
             BatchHost=cn17 Command=/home/ada/my JobState=COMPLETED ExitCode=0:0/run.sh \n\
             JobId=11 ArrayJobId=11 ArrayTaskId=1-7%2 ArrayTaskThrottle=2 JobName=fleetyard-s \
             UserId=ada(1000) JobState=PENDING Reason=JobArrayTaskLimit ExitCode=0:0 NodeList= \n",
        )
        .unwrap();
        assert_eq!(lines[0].job, 11);
        assert!(lines[0].is_about(0) && !lines[0].is_about(1));
        // A folder that looks like a pair changes nothing.
        assert_eq!(lines[0].state, State::Failed);
        assert_eq!(lines[0].exit, Some((3, 0)));
        assert_eq!(lines[0].node.as_deref(), Some("cn17"));
        assert_eq!(lines[0].reason.as_deref(), Some("NonZeroExitCode"));
        assert!(lines[1].is_about(7) && lines[1].state == State::Pending);

        // A job that is no array, and one without what has to be there.
        let alone =
            scontrol("JobId=9 JobName=x JobState=RUNNING Reason=None ExitCode=0:0").unwrap();
        assert!(alone[0].is_about(3));
        for wrong in [
            "JobId=9 JobName=x Reason=None",
            "JobId=nine JobName=x JobState=RUNNING",
            "JobId=9 ArrayJobId=9 JobName=x JobState=RUNNING",
            "JobId=9 JobName=x JobState=RUNNING ExitCode=none",
            "No jobs in the system",
        ] {
            assert!(scontrol(wrong).is_err(), "{wrong:?}");
        }
    }

    #[test]
    fn ranges_are_short_and_read_again() {
        assert_eq!(ranges(&[0, 1, 2, 5, 7, 8]), "0-2,5,7-8");
        assert_eq!(ranges(&[4]), "4");
        assert_eq!(ranges(&[]), "");
    }

    proptest! {
        #[test]
        fn any_text_is_read_or_refused(text in "\\PC{0,200}") {
            let _ = submitted(&text);
            let _ = squeue(&text);
            let _ = sacct(&text);
            let _ = scontrol(&text);
            let _ = Tasks::parse(&text);
        }

        #[test]
        fn ranges_name_what_is_in_the_list(mut list in prop::collection::vec(0u32..60, 1..30)) {
            list.sort_unstable();
            list.dedup();
            let tasks = Tasks::parse(&ranges(&list)).unwrap();
            for index in 0..60 {
                prop_assert_eq!(tasks.has(index), list.binary_search(&index).is_ok());
            }
        }
    }
}

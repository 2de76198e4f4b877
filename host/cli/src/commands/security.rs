//! `fleetyard doctor --security`: which promises about plugins hold on this machine, for
//! this user, and what would restore those that do not.
//!
//! Promises that can be tried are tried, in a sandbox and by the host itself; the rest follows from
//! the layers that were active and from who enforces the limits.

use fleetyard_runtime::sandbox::Attempt;
use fleetyard_runtime::{Layer, LayerState, Limit, SandboxReport};
use serde::Serialize;

use super::doctor::{Doctor, level};
use crate::args::Format;
use crate::exit::{Exit, Result};
use crate::output;

/// The extent to which a promise holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
enum Standing {
    /// All that should keep it is there, and nothing got past it.
    Holds,
    /// Nothing got past it, but some of what should keep it is missing.
    Weaker,
    /// It does not hold here.
    Broken,
}

impl Standing {
    fn as_str(self) -> &'static str {
        match self {
            Self::Holds => "holds",
            Self::Weaker => "weaker",
            Self::Broken => "broken",
        }
    }
}

/// A promise to users, and its standing.
#[derive(Debug, Serialize)]
struct Promise {
    name: &'static str,
    /// The promise in a sentence.
    sentence: &'static str,
    standing: Standing,
    /// The parts that are missing or were got past, one sentence each.
    why: Vec<String>,
    /// Advice that would restore it.
    restore: Vec<String>,
}

/// A promise that a sandbox keeps.
struct Kept {
    name: &'static str,
    sentence: &'static str,
    /// Attempts in which a plugin must not succeed.
    attempts: &'static [Attempt],
    /// The layers that prevent it.
    layers: &'static [Layer],
}

const KEPT: &[Kept] = &[
    Kept {
        name: "files",
        sentence: "A plugin reads the system, its own folder and its interpreter, and writes to \
                  its scratch folder alone.",
        attempts: &[Attempt::ReadFile, Attempt::WriteFile, Attempt::ListFolder],
        layers: &[Layer::MountNamespace, Layer::Landlock],
    },
    Kept {
        name: "network",
        sentence: "A plugin reaches no network and no socket of anybody else.",
        attempts: &[
            Attempt::ConnectTcp,
            Attempt::ConnectUdp,
            Attempt::ConnectUnix,
            Attempt::ConnectAbstract,
        ],
        layers: &[Layer::NetworkNamespace, Layer::Landlock, Layer::Seccomp],
    },
    Kept {
        name: "other-processes",
        sentence: "A plugin neither sees nor touches a process that is not its own.",
        attempts: &[
            Attempt::SeeProcess,
            Attempt::Signal,
            Attempt::Trace,
            Attempt::Limits,
            Attempt::Priority,
        ],
        layers: &[Layer::PidNamespace, Layer::OwnProc, Layer::Seccomp],
    },
    Kept {
        name: "rights",
        sentence: "A plugin has no rights over the machine and no way to get some.",
        attempts: &[Attempt::Capability, Attempt::Namespace],
        layers: &[Layer::Capabilities, Layer::NoNewPrivileges, Layer::Seccomp],
    },
    Kept {
        name: "kernel",
        sentence: "Rarely used parts of the kernel, and what outlives a process in it, are closed \
                  to a plugin.",
        attempts: &[Attempt::Kernel, Attempt::SystemV, Attempt::Keys],
        layers: &[Layer::Seccomp, Layer::IpcNamespace],
    },
    Kept {
        name: "first-to-go",
        sentence: "When the machine runs out of memory, the plugin goes first.",
        attempts: &[Attempt::OutOfMemory],
        layers: &[Layer::ResourceLimits],
    },
    Kept {
        name: "nothing-left",
        sentence: "When a call or the host ends, however it ends, no process of the plugin is left.",
        attempts: &[],
        layers: &[Layer::PidNamespace],
    },
];

/// Promises that no machine takes away: the host keeps them by how it works.
const ALWAYS: &[(&str, &str)] = &[
    (
        "own-code",
        "Nothing that a plugin or its folder supplies runs outside of its sandbox, its \
         interpreter included; `--attach in-process` is the exception, and unranked.",
    ),
    (
        "figures",
        "Planners are ranked by what the host measured and judged, not by what they claim.",
    ),
];

/// The promise about a limit: its name, and the sentence.
fn of_limit(limit: Limit) -> (&'static str, &'static str) {
    match limit {
        Limit::Wall => (
            "wall-time",
            "A call ends with its wall-clock budget, by the host's clock.",
        ),
        Limit::Cpu => (
            "processor-time",
            "A call ends with its limit of processor time, and all that it used is known.",
        ),
        Limit::Memory => ("memory", "A plugin has no more memory than its limit."),
        Limit::Processes => (
            "processes",
            "A plugin has no more processes and threads than its limit.",
        ),
        Limit::Output => (
            "output",
            "What a plugin writes is bounded, in the host's memory too.",
        ),
        Limit::Disk => ("disk", "A plugin writes no more than its disk limit."),
    }
}

#[derive(Serialize)]
struct Findings {
    fleetyard: &'static str,
    user: u32,
    promises: Vec<Promise>,
}

/// Prints the promises; the exit code is 1 when one is broken or, where `strict` is
/// needed, weaker.
pub(crate) fn security(arguments: &Doctor) -> Result<Exit> {
    let (report, succeeded) = level(arguments.sandbox)?.attempts()?;
    let findings = Findings {
        fleetyard: env!("CARGO_PKG_VERSION"),
        user: fleetyard_runtime::user(),
        promises: promises(&report, &succeeded),
    };
    match arguments.format {
        Format::Json => output::print_json(&findings)?,
        Format::Text => output::print(&output::plain(&text(&findings)))?,
    }
    let count = |standing| {
        let promises = findings.promises.iter();
        promises
            .filter(|promise| promise.standing == standing)
            .count()
    };
    let broken = count(Standing::Broken);
    if broken > 0 {
        let (noun, verb) = if broken == 1 {
            ("promise", "does")
        } else {
            ("promises", "do")
        };
        output::error(&format!(
            "{broken} {noun} {verb} not hold on this machine for this user"
        ));
        return Ok(Exit::NoPlan);
    }
    Ok(Exit::Success)
}

fn promises(report: &SandboxReport, succeeded: &[Attempt]) -> Vec<Promise> {
    let kept = KEPT.iter().map(|kept| {
        let through: Vec<&str> = kept
            .attempts
            .iter()
            .filter(|attempt| succeeded.contains(attempt))
            .map(|attempt| attempt.as_str())
            .collect();
        let missing: Vec<&LayerState> = report
            .layers
            .iter()
            .filter(|state| kept.layers.contains(&state.layer) && !state.active)
            .collect();
        let mut why = Vec::new();
        if !through.is_empty() {
            why.push(format!("a plugin managed to {}", through.join(", and to ")));
        }
        why.extend(missing.iter().map(|state| {
            let cost = state.layer.cost_of_missing();
            format!("without {}, {cost}", state.layer)
        }));
        Promise {
            name: kept.name,
            sentence: kept.sentence,
            standing: match (through.is_empty(), missing.is_empty()) {
                (false, _) => Standing::Broken,
                (true, false) => Standing::Weaker,
                (true, true) => Standing::Holds,
            },
            why,
            restore: restore(missing),
        }
    });
    let limits = report.limits.iter().map(|state| {
        let (name, sentence) = of_limit(state.limit);
        let reason = state.reason.as_deref().unwrap_or("nobody said why");
        let watched = || format!("it is watched, not enforced: {reason}");
        Promise {
            name,
            sentence,
            standing: if state.enforced {
                Standing::Holds
            } else {
                Standing::Weaker
            },
            why: (!state.enforced).then(watched).into_iter().collect(),
            restore: state.advice().map(str::to_owned).into_iter().collect(),
        }
    });
    let always = ALWAYS.iter().map(|(name, sentence)| Promise {
        name,
        sentence,
        standing: Standing::Holds,
        why: Vec::new(),
        restore: Vec::new(),
    });
    kept.chain(limits).chain(always).collect()
}

/// Advice about missing layers, each piece once.
fn restore(missing: Vec<&LayerState>) -> Vec<String> {
    let mut found: Vec<String> = Vec::new();
    for state in missing {
        let advice = state
            .errno
            .as_deref()
            .map(|errno| state.layer.advice(errno));
        if let Some(advice) = advice
            && !found.iter().any(|known| known == advice)
        {
            found.push(advice.to_owned());
        }
    }
    found
}

fn text(findings: &Findings) -> String {
    let mut lines = Vec::new();
    let mut advice: Vec<&str> = Vec::new();
    for promise in &findings.promises {
        let standing = promise.standing.as_str();
        lines.push(format!(
            "{standing:<7} {:<16} {}",
            promise.name, promise.sentence
        ));
        lines.extend(promise.why.iter().map(|why| format!("{:<24} {why}", "")));
        for text in &promise.restore {
            if !advice.contains(&text.as_str()) {
                advice.push(text);
            }
        }
    }
    if !advice.is_empty() {
        lines.push(format!(
            "\nWhat would restore the rest:\n  {}",
            advice.join("\n  ")
        ));
    }
    lines.join("\n")
}

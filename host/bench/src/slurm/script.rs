//! The batch script: one task of the array runs one shard and says how it ended.

use std::path::Path;

use fleetyard_core::quoted;

use super::job::Job;

/// The folder of what shards leave: stores, progress, how they ended.
pub(super) const SHARDS: &str = "shards";
/// The folder of logs.
pub(super) const LOGS: &str = "logs";
/// The copy of the suite.
pub(super) const SUITE: &str = "suite.toml";

/// Codes with which a task ends that could not begin; bench has none of them.
pub(super) const NOT_VISIBLE: u32 = 81;
/// The executable or the suite is not what was submitted.
pub(super) const CHANGED: u32 = 82;

/// The script for all shards of a run. All that varies comes from Slurm's variables; all
/// words from outside are quoted.
pub(super) fn script(job: &Job, run: &Path) -> String {
    let word = |path: &Path| quoted(&path.display().to_string());
    let mut arguments = String::new();
    for argument in &job.arguments {
        arguments.push(' ');
        arguments.push_str(&quoted(argument));
    }
    format!(
        r#"#!/bin/sh
# Runs one shard of a suite of trials. Written by fleetyard {version}; `fleetyard jobs requeue` submits
# it again for the shards that did not come to their end.

run={run}
folder={folder}
fleetyard={executable}
digest={digest}
suite={suite}
shards={count}
shard=${{SLURM_ARRAY_TASK_ID:?this runs as a task of a job array}}
job=${{SLURM_ARRAY_JOB_ID:?this runs as a task of a job array}}

# The file appears whole or not at all.
ended() {{
    printf '{{"job": %s, "code": %s, "signal": "%s", "node": "%s"}}\n' \
        "$job" "$1" "$2" "${{SLURMD_NODENAME:-}}" >"$run/{SHARDS}/.$shard.exit" &&
        mv -f -- "$run/{SHARDS}/.$shard.exit" "$run/{SHARDS}/$shard.exit"
}}
refuse() {{
    printf 'error: on node %s: %s\nhint: %s\n' "${{SLURMD_NODENAME:-}}" "$2" "$3" >&2
    ended "$1" ""
    exit "$1"
}}

cd -- "$run/{SHARDS}" ||
    refuse {NOT_VISIBLE} "the run's folder is not visible here" "put it on a file system that all nodes share"
rm -f -- "$shard.exit"
cd -- "$folder" ||
    refuse {NOT_VISIBLE} "$folder is not visible here" "submit from a folder on a file system that all nodes share"
[ -x "$fleetyard" ] ||
    refuse {NOT_VISIBLE} "$fleetyard is not visible here" "install fleetyard on a file system that all nodes share"
[ "$(sha256sum <"$fleetyard")" = "$digest  -" ] ||
    refuse {CHANGED} "$fleetyard is not what was submitted" "do not build or install over it while a run goes on; submit again"
cmp -s -- "$run/{SUITE}" "$suite" ||
    refuse {CHANGED} "$suite is not what was submitted" "put it back as in {SUITE} of the run's folder, or submit again"

# Slurm asks a task to stop before it ends it: bench gets that signal too.
signal=
trap 'signal=TERM; kill -s TERM "$bench" 2>/dev/null' TERM
trap 'signal=INT; kill -s INT "$bench" 2>/dev/null' INT
"$fleetyard" bench "$suite" --shard "$shard/$shards" --store "$run/{SHARDS}/$shard.sqlite" --resume \
    --progress-file "$run/{SHARDS}/$shard.progress"{arguments} &
bench=$!
while :; do
    wait "$bench"
    code=$?
    # A signal ends the waiting, not always bench.
    kill -s 0 "$bench" 2>/dev/null || break
done
ended "$code" "$signal"
exit "$code"
"#,
        version = env!("CARGO_PKG_VERSION"),
        run = word(run),
        folder = word(&job.folder),
        executable = word(&job.executable.path),
        digest = job.executable.sha256,
        suite = word(&job.suite.path),
        count = job.trials.len(),
    )
}

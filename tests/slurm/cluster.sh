#!/usr/bin/env bash
# A Slurm cluster of one node on this machine, for tests and for trying things out:
#
#     tests/slurm/cluster.sh FOLDER [CPUS]
#
# starts munged, slurmctld and slurmd with a key, sockets, free ports and state of their
# own in FOLDER, which must not exist yet; nothing of another Slurm on this machine is
# touched. When jobs can be submitted it prints one line,
#
#     export SLURM_CONF=FOLDER/slurm.conf
#
# and runs until its standard input ends or it is told to stop (Ctrl-C). Then it cancels
# what runs and ends its daemons; the folder with their logs stays. It needs root and
# Debian's packages slurmctld, slurmd and munge. TASK_PLUGIN=affinity lets Slurm bind
# jobs to cores, as most clusters do.
set -uo pipefail
export LC_ALL=C

say() { printf '%s\n' "$*" >&2; }
fail() {
    say "error: $1"
    [ -z "${2:-}" ] || [ ! -s "$2" ] || tail -n 5 "$2" >&2
    exit 1
}

[ $# -ge 1 ] && [ $# -le 2 ] || fail "usage: cluster.sh FOLDER [CPUS]"
PATH=$PATH:/usr/sbin:/sbin
# What this machine lacks is no failure of a test.
lack() {
    say "$1"
    exit 77
}
for program in munged slurmctld slurmd sinfo scancel squeue setpriv; do
    command -v "$program" >/dev/null || lack "$program is not installed"
done
[ "$(id -u)" = 0 ] || lack "Slurm's daemons need root"
mkdir -- "$1" || fail "the folder cannot be made"
folder=$(cd -- "$1" && pwd)
cpus=${2:-$(nproc)}
# Users' programs must reach munged's socket, whatever the caller's mask is.
chmod 755 "$folder"
umask 022
mkdir "$folder/state" "$folder/spool" "$folder/log"

# A port that nobody listens on. Somebody may take it before we do: then a daemon does
# not come up, and the whole is started again with others.
free_port() {
    local port
    while :; do
        port=$((20000 + RANDOM % 12000))
        (exec 3<>"/dev/tcp/127.0.0.1/$port") 2>/dev/null || break
    done
    printf '%s' "$port"
}

(umask 077 && head -c 1024 /dev/urandom >"$folder/munge.key")
host=$(hostname -s)
configure() {
    cat >"$folder/slurm.conf" <<CONF
ClusterName=fleetyard
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=$(free_port)
SlurmdPort=$(free_port)
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket=$folder/munge.socket
CredType=cred/munge
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
SlurmctldLogFile=$folder/log/slurmctld
SlurmdLogFile=$folder/log/slurmd
# The sizes below hold, whatever the machine has.
SlurmdParameters=config_overrides
# What a task started ends with it.
ProctrackType=proctrack/pgid
TaskPlugin=task/${TASK_PLUGIN:-none}
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
SchedulerType=sched/backfill
SchedulerParameters=batch_sched_delay=0,sched_min_interval=0,bf_interval=1
AccountingStorageType=accounting_storage/none
JobAcctGatherType=jobacct_gather/none
JobCompType=jobcomp/none
MpiDefault=none
SwitchType=switch/none
JobRequeue=1
MaxArraySize=10001
MaxJobCount=20000
KillWait=2
ReturnToService=2
NodeName=one NodeHostname=$host NodeAddr=127.0.0.1 CPUs=$cpus RealMemory=${MEMORY_MB:-4096} State=UNKNOWN
PartitionName=main Nodes=one Default=YES MaxTime=INFINITE State=UP
PartitionName=closed Nodes=one State=DOWN
CONF
}

# With the death of this script, however it comes, its daemons get a signal.
daemons=()
daemon() {
    local log=$1
    shift
    setpriv --pdeathsig TERM "$@" >>"$folder/log/$log" 2>&1 </dev/null &
    daemons+=($!)
}

stop_daemons() {
    local id
    # The node's first: it tells the controller.
    for ((id = ${#daemons[@]} - 1; id >= 0; id--)); do
        kill "${daemons[id]}" 2>/dev/null
    done
    for _ in $(seq 50); do
        kill -0 "${daemons[@]}" 2>/dev/null || break
        sleep 0.1
    done
    for id in "${daemons[@]}"; do
        kill -KILL "$id" 2>/dev/null
    done
    daemons=()
}

# Steps live on without slurmd; they are known by the configuration that they were given.
steps() {
    local process
    for process in /proc/[0-9]*; do
        tr '\0' '\n' 2>/dev/null <"$process/environ" | grep -qxF "SLURM_CONF=$folder/slurm.conf" &&
            [ "$(cat "$process/comm" 2>/dev/null)" = slurmstepd ] && printf '%s\n' "${process#/proc/}"
    done
}

stop() {
    trap '' INT TERM HUP
    trap - EXIT
    if [ ${#daemons[@]} -gt 0 ]; then
        timeout 5 scancel --me >/dev/null 2>&1 || timeout 5 scancel --user "$(id -un)" >/dev/null 2>&1
        for _ in $(seq 50); do
            [ -z "$(steps)" ] && break
            sleep 0.1
        done
        stop_daemons
        for id in $(steps); do
            kill -KILL "$id" 2>/dev/null
        done
    fi
    exit "${1:-0}"
}
trap 'stop $?' EXIT
trap 'stop 0' INT TERM HUP

export SLURM_CONF=$folder/slurm.conf
daemon munged munged --foreground --force --key-file="$folder/munge.key" --socket="$folder/munge.socket" \
    --pid-file="$folder/munged.pid" --seed-file="$folder/munged.seed" --log-file="$folder/log/munged" --num-threads=2
for _ in $(seq 100); do
    [ -S "$folder/munge.socket" ] && break
    sleep 0.05
done
[ -S "$folder/munge.socket" ] || fail "munged does not come up" "$folder/log/munged"

up=
for _ in 1 2 3; do
    configure
    daemon slurmctld slurmctld -D -f "$SLURM_CONF"
    daemon slurmd slurmd -D -f "$SLURM_CONF" -N one
    for _ in $(seq 100); do
        sleep 0.1
        kill -0 "${daemons[1]}" "${daemons[2]}" 2>/dev/null || break
        [ "$(timeout 5 sinfo --noheader --partition=main --format=%t 2>/dev/null)" = idle ] && up=yes && break
    done
    [ -n "$up" ] && break
    kill "${daemons[1]}" "${daemons[2]}" 2>/dev/null
    wait "${daemons[1]}" "${daemons[2]}" 2>/dev/null
    daemons=("${daemons[0]}")
done
[ -n "$up" ] || ! grep -q "Unable to initialize cgroup plugin" "$folder/log/slurmd" ||
    lack "Slurm's node needs control groups that this machine does not have"
[ -n "$up" ] || fail "the node does not come up" "$folder/log/slurmd"

printf 'export SLURM_CONF=%q\n' "$SLURM_CONF"
# A read that a signal interrupts lets the trap run.
while read -r _; do :; done
stop 0

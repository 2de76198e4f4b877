#!/usr/bin/env bash
# Real-time factor and peak memory of the simulator against team size.
#
#   scripts/rtf.sh [MAP] [N ...]
#
# MAP is a MovingAI map; by default the 140 x 500 warehouse of the League of
# Robot Runners from $FLEETYARD_DATA, else a generated warehouse of like size.
# Plans are PIBT's, executed by both tiers; random starts and goals, seed 1.
set -euo pipefail
cd "$(dirname "$0")/.."
fleetyard=${FLEETYARD:-target/release/fleetyard}
[ -x "$fleetyard" ] || { echo "build it first: cargo build --release" >&2; exit 2; }

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
map=${1:-}
[ $# -gt 0 ] && shift
if [ -z "$map" ]; then
    map=${FLEETYARD_DATA:-/nonexistent}/lorr/warehouse.domain/maps/warehouse_long_corridor_large.map
    if [ ! -f "$map" ]; then
        "$fleetyard" maps generate warehouse --blocks-across 30 --blocks-down 40 --block-cols 12 \
            --block-rows 2 --aisle 1 --margin 40 --out "$scratch" >/dev/null
        map=$(echo "$scratch"/*.map)
    fi
fi
[ $# -gt 0 ] || set -- 100 550 1000 2500

echo "map: $(basename "$map")"
printf '%8s %10s %12s %14s %12s %14s\n' agents simulated 'RTF kin.' 'memory kin.' 'RTF contact' 'memory contact'
for agents in "$@"; do
    scen=$("$fleetyard" maps scenario "$map" --agents "$agents" --seed 1 --out "$scratch")
    plan=$scratch/plan.json
    "$fleetyard" run --map "$map" --scen "$scen" --agents "$agents" --planner pibt --budget 5m \
        --plan-out "$plan" --plan-encoding moves --format json >"$scratch/run.json"
    row=()
    for tier in kinematic contact; do
        "$fleetyard" simulate --map "$map" "$plan" --tier "$tier" --threads 1 --format json >"$scratch/$tier.json"
        row+=("$(python3 - "$scratch/$tier.json" <<'PY'
import json, sys
execution = json.load(open(sys.argv[1]))
print(f"{execution['simulated_s']:.0f}s {execution['rtf']:.1f} {execution['host_peak_memory_kb'] / 1024:.0f}MiB")
PY
)")
    done
    read -r simulated own own_memory <<<"${row[0]}"
    read -r _ rapier rapier_memory <<<"${row[1]}"
    printf '%8s %10s %12s %14s %12s %14s\n' "$agents" "$simulated" "$own" "$own_memory" "$rapier" "$rapier_memory"
done

#!/usr/bin/env bash
# How long it takes from `fleetyard plugins new` to a plan that the host calls valid, in
# each language: the commands alone, as `plugins new` prints them, without the reading.
#
#     scripts/first_plan.sh [FLEETYARD]      by default target/release/fleetyard
set -euo pipefail

fleetyard=$(realpath "${1:-$(dirname "$0")/../target/release/fleetyard}")
PATH=$(dirname "$fleetyard"):$PATH
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
cd "$scratch"
unset CARGO_TARGET_DIR FLEETYARD_PLUGIN_PATH

for lang in python command c cpp rust; do
    began=$(date +%s.%N)
    # What comes next, but for the plugin's own test, the kit, and the list.
    next=$(fleetyard plugins new --lang "$lang" "my-$lang" | sed '1,/^next:/d' |
        grep -v -e 'cargo test' -e ' check' -e unittest -e 'plugins list')
    bash -euo pipefail -c "$next" >out.txt 2>err.txt || { cat out.txt err.txt; exit 1; }
    grep -q '^verdict *valid$' out.txt
    awk -v lang="$lang" -v began="$began" -v ended="$(date +%s.%N)" \
        'BEGIN { printf "%-8s %5.1f s\n", lang, ended - began }'
done

#!/usr/bin/env bash
# Golden digests of the simulator and of the views of tasks, in every build and on every
# target at hand: debug and release, the processor's own instructions, 32 bits, WebAssembly.
#
#   scripts/determinism.sh
#
# Targets are used if rustup has them (`rustup target add i686-unknown-linux-gnu
# wasm32-wasip1`) and what they need is there: a 32-bit C library (`gcc-multilib`),
# or wasmtime and a C compiler for WebAssembly (`WASI_SDK_PATH`). What is left out is
# said.
set -euo pipefail
cd "$(dirname "$0")/.."

failed=0
build() {
    local name=$1
    shift
    printf '%-28s' "$name"
    if output=$("$@" 2>&1); then
        echo "equal"
    else
        echo "DIFFERENT, or not built:"
        tail -15 <<<"$output"
        failed=1
    fi
}
left_out() { printf '%-28sleft out: %s\n' "$1" "$2"; }

golden=(test -p fleetyard-sim -p fleetyard-views --locked --test it golden)
targets=$(rustup target list --installed 2>/dev/null || true)

build "debug" cargo "${golden[@]}"
build "release" cargo "${golden[@]}" --release
# Flags are part of a build's identity: a folder of its own keeps the others warm.
native=${CARGO_TARGET_DIR:-target}/native
build "target-cpu=native, release" env RUSTFLAGS="-C target-cpu=native" CARGO_TARGET_DIR="$native" cargo "${golden[@]}" --release
if ! grep -q i686-unknown-linux-gnu <<<"$targets"; then
    left_out "i686" "rustup target add i686-unknown-linux-gnu"
elif ! echo 'int main(void){return 0;}' | cc -m32 -x c -o /dev/null - 2>/dev/null; then
    left_out "i686" "no 32-bit C library: install gcc-multilib"
else
    build "i686, release" cargo "${golden[@]}" --release --target i686-unknown-linux-gnu
fi
if ! grep -q wasm32-wasip1 <<<"$targets"; then
    left_out "wasm32" "rustup target add wasm32-wasip1"
elif ! command -v wasmtime >/dev/null || [ -z "${WASI_SDK_PATH:-}" ]; then
    left_out "wasm32" "needs wasmtime and WASI_SDK_PATH"
else
    build "wasm32, release" env CARGO_TARGET_WASM32_WASIP1_RUNNER=wasmtime \
        CC_wasm32_wasip1="$WASI_SDK_PATH/bin/clang" cargo "${golden[@]}" --release --target wasm32-wasip1
fi
exit $failed

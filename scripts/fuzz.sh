#!/usr/bin/env bash
# Damaged files for every reader, for so many seconds in all: scripts/fuzz.sh SECONDS [TARGET ...]
# Exit 1 when a reader panics, hangs or dies; what broke it lies in target/fuzz/artifacts.
set -euo pipefail
cd "$(dirname "$0")/.."
cargo=${CARGO:-cargo}
seconds=$1
shift
# Beside the other builds, so that `make clean` forgets it too.
target=${CARGO_TARGET_DIR:-target}
$cargo build --quiet --locked --manifest-path fuzz/Cargo.toml --target-dir "$target/fuzz"
"$target/fuzz/debug/hingecast-fuzz" --seconds "$seconds" --out "$target/fuzz/artifacts" "$@"

#!/usr/bin/env bash
# Names the tests that skipped, from the log of `cargo test -- --show-output`: they print a line "skipped: <why>".
set -euo pipefail
awk '
  /^---- .* stdout ----$/ { test = $2 }
  /^skipped: / { reason = substr($0, 10); count++; list = list "  " test ": " reason "\n" }
  END {
    if (count) printf "tests skipped: %d\n%s", count, list
    else print "no test skipped"
  }' "$1"

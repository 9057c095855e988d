#!/usr/bin/env bash
# The whole test suite under ThreadSanitizer, AddressSanitizer and UndefinedBehaviorSanitizer: passed and failed tests.
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
tools/test --keep-going tsan asan >"$ROSID_SCORE_OUT/sanitizers.log" 2>&1
status=$?
cat "$ROSID_SCORE_OUT/sanitizers.log" >&2
printf '| stage | build s | tests s | passed | failed |\n|---|---|---|---|---|\n'
sed -nE 's/^(tsan|asan) +build +([0-9]+) s, tests +([0-9]+) s: ([0-9]+) passed, ([0-9]+) failed.*/| \1 | \2 | \3 | \4 | \5 |/p' \
  "$ROSID_SCORE_OUT/sanitizers.log"
exit "$status"

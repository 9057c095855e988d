#!/usr/bin/env bash
# Decoders and I/O thread: bytes per second, load at 500 kBd, error of the stamps, damaged bytes, line coverage.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
build=build/bench
cmake --preset release -B "$build" -DROSID_BUILD_BENCH=ON >&2
cmake --build "$build" --target hal_bench io_load hal_laser_test >&2

printf 'Decoders, medians of five:\n\n| decoder | time ms | MB/s | records/s |\n|---|---|---|---|\n'
"$build/bench/hal_bench" --benchmark_repetitions=5 --benchmark_report_aggregates_only=true --benchmark_format=json |
  python3 -c '
import json, sys
for run in json.load(sys.stdin)["benchmarks"]:
    if run["aggregate_name"] == "median":
        megabytes = run.get("bytes_per_second", 0.0) / 1e6
        records = run.get("items_per_second", 0.0)
        name, time = run["run_name"], run["real_time"]
        print(f"| {name} | {time:.2f} | {megabytes:.0f} | {records:.3g} |")'

printf '\nThe I/O thread in real time:\n\n'
"$build/bench/io_load"

printf '\nBytes lost, doubled or flipped:\n\n| share | telegrams sent | intact | delivered |\n|---|---|---|---|\n'
"$build/tests/unit/hal/hal_laser_test" --gtest_filter='*LaserFaults.Intact*:*LaserFaultsAtShare*' \
  --gtest_output="json:$ROSID_SCORE_OUT/damage.json" >&2
python3 -c '
import json, sys
for suite in json.load(open(sys.argv[1]))["testsuites"]:
    for test in suite["testsuite"]:
        names = ("bytes_damaged_share", "telegrams_sent", "telegrams_intact", "telegrams_delivered")
        print("| " + " | ".join(str(test[name]) for name in names) + " |")' "$ROSID_SCORE_OUT/damage.json"

programs=(hal_codec_test hal_laser_test hal_can_test hal_turret_test)
cmake --preset coverage >&2
cmake --build --preset coverage --target "${programs[@]}" >&2
for program in "${programs[@]}"; do "build/coverage/tests/unit/hal/$program" >&2; done
printf '\nLines of the decoders that their unit tests execute:\n\n```\n'
gcovr --root . --object-directory build/coverage build/coverage --filter 'hal/(lms|can|turret|usb)/' --filter hal/front_end.cpp \
  2>>"$ROSID_SCORE_OUT/gcovr.log"
printf '```\n'

#!/usr/bin/env bash
# Segmentation of the worlds of the repository and of real scans, region by region; also into docs/segmentation.md.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
"$root/tools/score_segmentation.py" --rosi "$ROSID_BIN/tools/rosi" --jobs "$ROSID_JOBS" --keep "$ROSID_SCORE_OUT/drives" \
  --write "$root/docs/segmentation.md"

#!/usr/bin/env bash
# Accuracy of the worlds of the repository, ten seeds each.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
for world in two-rooms hall corridor; do
  "$root/tools/score_accuracy.py" "$root/config/worlds/$world.toml" --seeds 10
done

#!/usr/bin/env python3
"""Accuracy over seeds: simulates, replays and evaluates drives of a world and prints every run and the medians."""

import argparse
import json
import pathlib
import statistics
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
COLUMNS = [
    # key, heading, scale, digits
    ("position_mean_m", "mean cm", 100.0, 2),
    ("position_max_m", "max cm", 100.0, 2),
    ("heading_mean_deg", "head deg", 1.0, 3),
    ("rpe_percent", "rpe %", 1.0, 2),
    ("odometry_position_mean_m", "wheels cm", 100.0, 1),
    ("odometry_heading_mean_deg", "wheels deg", 1.0, 2),
    ("nees_mean", "nees", 1.0, 2),
    ("position_max_sigma", "max sig", 1.0, 2),
    ("views", "views", 1.0, 0),
    ("patches", "patches", 1.0, 0),
    ("map_accurate_fraction", "map %", 100.0, 1),
    ("map_accurate_fraction_fitted", "fitted %", 100.0, 1),
    ("map_coverage_fraction", "cover %", 100.0, 1),
    ("realtime_factor", "x time", 1.0, 1),
]


def run(rosi, *arguments):
    done = subprocess.run([rosi, *map(str, arguments)], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"rosi {arguments[0]} failed with {done.returncode}: {done.stderr.strip()}")
    return done.stdout


def score(rosi, world, seed, folder):
    drive, result = folder / f"drive{seed}", folder / f"run{seed}"
    run(rosi, "sim", world, "--seed", seed, "--offline", "--out", drive)
    run(rosi, "replay", drive / "drive.log", "--out", result)
    return json.loads(run(rosi, "eval", result, "--truth", drive, "--json"))


def row(name, figures):
    cells = [f"{figures[key] * scale:>10.{digits}f}" if figures.get(key) is not None else f"{'-':>10}"
             for key, _, scale, digits in COLUMNS]
    print(f"{name:>8}" + "".join(cells), flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("world", type=pathlib.Path)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--rosi", type=pathlib.Path, default=ROOT / "build/release/tools/rosi")
    parser.add_argument("--keep", type=pathlib.Path, help="keep drives and runs in this folder")
    options = parser.parse_args()
    print(f"{options.world}\n{'seed':>8}" + "".join(f"{heading:>10}" for _, heading, _, _ in COLUMNS))
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.keep or pathlib.Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        results = []
        for seed in range(options.first, options.first + options.seeds):
            results.append(score(options.rosi, options.world, seed, folder))
            row(str(seed), results[-1])
    keys = [key for key, _, _, _ in COLUMNS if all(result.get(key) is not None for result in results)]
    row("median", {key: statistics.median(result[key] for result in results) for key in keys})


if __name__ == "__main__":
    main()

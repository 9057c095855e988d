#!/usr/bin/env python3
"""Segmentation against the truth: simulates drives of worlds, scores every view, then the real scans of others there
are, and prints tables in Markdown. --write puts the same tables between the markers of a page."""

import argparse
import concurrent.futures
import json
import os
import pathlib
import statistics
import sys
import tempfile

import score_accuracy

ROOT = score_accuracy.ROOT
BEGIN, END = "<!-- score: begin -->", "<!-- score: end -->"
COUNTS = ("regions", "correct", "over_segmented", "under_segmented", "missed", "noise", "fragments")
STANDARD = 0.8
SCANS = [
    # folder and file below ROSID_DATA_DIR, further arguments of rosi segment
    ("kurt3d/scan000.3d", ()),
    ("kurt3d/scan001.3d", ()),
    ("room/room_scan1.pcd", ()),
    ("room/room_scan2.pcd", ()),
    ("synpeb/test_100.pcd", ("--truth", "intensity")),
]
REPEATS = 21


def simulate(rosi, world, seed, folder):
    drive = folder / f"{world.stem}-{seed}"
    score_accuracy.run(rosi, "sim", world, "--seed", seed, "--offline", "--out", drive)
    return drive


def score_drive(rosi, drive):
    print(f"scoring {drive.name}", file=sys.stderr, flush=True)
    return json.loads(score_accuracy.run(rosi, "segment", drive / "drive.log", "--all", "--truth", drive / "labels", "--json"))


class Sums:
    """Reports of drives, added up."""

    def __init__(self):
        self.views, self.patches, self.times_ms = 0, 0, []
        self.counts, self.normals = {}, {}
        self.cylinders = {"seen": 0, "found": 0, "round": 0, "radius_within_tenth": 0}

    def add(self, report):
        self.views += report["views"]
        self.patches += report["patches"]
        self.times_ms += report["times_ms"]
        for entry in report["score"]["tolerances"]:
            tolerance = entry["tolerance"]
            for weight in ("pixels", "area"):
                counts = self.counts.setdefault((tolerance, weight), dict.fromkeys(COUNTS, 0))
                for name in COUNTS:
                    counts[name] += entry[weight][name]
            normals = self.normals.setdefault(tolerance, {"regions": 0, "area_m2": 0.0, "deg_m2": 0.0})
            normals["regions"] += entry["normals"]["regions"]
            normals["area_m2"] += entry["normals"]["area_m2"]
            normals["deg_m2"] += entry["normals"]["error_deg"] * entry["normals"]["area_m2"]
        for name in self.cylinders:
            self.cylinders[name] += report["score"]["cylinders"][name]

    def correct(self, tolerance, weight):
        counts = self.counts[tolerance, weight]
        return f"{100.0 * counts['correct'] / max(1, counts['regions']):.1f}"

    def per_view(self, tolerance, weight, name):
        return f"{self.counts[tolerance, weight][name] / self.views:.2f}"

    def normal_deg(self, tolerance):
        normals = self.normals[tolerance]
        return f"{normals['deg_m2'] / normals['area_m2']:.2f}" if normals["area_m2"] > 0.0 else "-"

    def cylinder_text(self):
        within = self.cylinders["radius_within_tenth"]
        return f"{self.cylinders['found']} of {self.cylinders['seen']}, radius of {within}"


def table(headings, rows):
    lines = ["| " + " | ".join(headings) + " |", "|" + "---|" * len(headings)]
    return lines + ["| " + " | ".join(str(cell) for cell in row) + " |" for row in rows]


def world_table(by_world, total):
    rows = [(name, sums.views, sums.counts[STANDARD, "pixels"]["regions"], sums.correct(STANDARD, "pixels"),
             sums.correct(STANDARD, "area"), sums.per_view(STANDARD, "pixels", "noise"),
             sums.per_view(STANDARD, "pixels", "fragments"), sums.normal_deg(STANDARD), sums.cylinder_text(),
             f"{sums.patches / sums.views:.1f}", f"{statistics.median(sums.times_ms):.1f}")
            for name, sums in [*by_world.items(), ("all", total)]]
    return table(("world", "views", "regions", "correct %", "by area %", "noise/view", "fragments/view", "normal deg", "cylinders",
                  "patches/view", "ms/view"), rows)


def tolerance_table(total, weight):
    rows = []
    for tolerance in sorted(total.normals):
        counts = total.counts[tolerance, weight]
        rows.append((f"{tolerance:.2f}", counts["correct"], total.correct(tolerance, weight), counts["over_segmented"],
                     counts["under_segmented"], counts["missed"], total.per_view(tolerance, weight, "noise"),
                     total.per_view(tolerance, weight, "fragments"), total.normal_deg(tolerance)))
    return table(("tolerance", "correct", "%", "over", "under", "missed", "noise/view", "fragments/view", "normal deg"), rows)


def scan_tables(rosi, data):
    """Lines of the table of the real scans, and the reasons why some are not in it."""
    if not data:
        return [], ["skipped: the environment variable ROSID_DATA_DIR is not set"]
    rows, reasons = [], []
    for name, arguments in SCANS:
        path = pathlib.Path(data) / name
        if not path.exists():
            reasons.append(f"skipped: {name} is not in ROSID_DATA_DIR")
            continue
        report = json.loads(score_accuracy.run(rosi, "segment", path, "--repeat", REPEATS, *arguments, "--json"))
        planes = "-"
        for entry in report.get("score", {}).get("tolerances", []):
            if entry["tolerance"] == STANDARD:
                planes = f"{entry['pixels']['correct']} of {entry['pixels']['regions']}"
        rows.append((name, report["valid"], len(report["patches"]), f"{100.0 * report['coverage_fraction']:.1f}",
                     f"{report['rms_mm']:.1f}", f"{report['time_ms']:.1f}", planes))
    return table(("scan", "valid pixels", "patches", "covered %", "rms mm", "ms", "planes correct"), rows) if rows else [], reasons


def simulated(options, folder):
    jobs = [(world, seed) for world in options.worlds for seed in range(options.first, options.first + options.seeds)]
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        drives = list(pool.map(lambda job: simulate(options.rosi, *job, folder), jobs))
    by_world, total = {}, Sums()
    for (world, _), drive in zip(jobs, drives):  # one after the other: times are measured
        report = score_drive(options.rosi, drive)
        by_world.setdefault(world.stem, Sums()).add(report)
        total.add(report)
    return by_world, total


def write_between_markers(page, text):
    content = page.read_text(encoding="utf-8")
    if content.count(BEGIN) != 1 or content.count(END) != 1 or content.index(BEGIN) > content.index(END):
        sys.exit(f"{page}: expected one line '{BEGIN}' and, after it, one line '{END}'")
    head, tail = content[:content.index(BEGIN) + len(BEGIN)], content[content.index(END):]
    page.write_text(f"{head}\n{text}\n{tail}", encoding="utf-8")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("worlds", type=pathlib.Path, nargs="*", default=sorted((ROOT / "config/worlds").glob("*.toml")))
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1, help="how many drives to simulate at once")
    parser.add_argument("--rosi", type=pathlib.Path, default=ROOT / "build/release/tools/rosi")
    parser.add_argument("--data", default=os.environ.get("ROSID_DATA_DIR", ""), help="folder of the real scans")
    parser.add_argument("--keep", type=pathlib.Path, help="keep the drives in this folder")
    parser.add_argument("--write", type=pathlib.Path, help="a page with the markers")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.keep or pathlib.Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        by_world, total = simulated(options, folder)
    scans, reasons = scan_tables(options.rosi, options.data)
    text = "\n".join([
        "", f"{total.views} views of {len(by_world)} worlds, {options.seeds} drives each; at tolerance {STANDARD}:", "",
        *world_table(by_world, total), "", "By pixels:", "", *tolerance_table(total, "pixels"), "", "By area:", "",
        *tolerance_table(total, "area"), "", f"Real scans, median of {REPEATS} runs:", "", *scans, *reasons, ""])
    print(text)
    if options.write:
        write_between_markers(options.write, text)


if __name__ == "__main__":
    main()

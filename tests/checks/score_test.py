"""tools/score_segmentation.py adds drives up, prints what it leaves out and writes between the markers only."""

import os
import subprocess
import unittest

import support

# Two views a drive; the second drive of a world is twice as good.
FAKE_ROSI = """#!/usr/bin/env python3
import json, pathlib, sys
words = sys.argv[1:]
if words[0] == "sim":
    pathlib.Path(words[words.index("--out") + 1]).mkdir(parents=True)
    sys.exit(0)
good = 1 if "-1/" in words[1] else 2
counts = {"regions": 4, "correct": 2 * good, "over_segmented": 0, "under_segmented": 0, "missed": 4 - 2 * good, "noise": 3,
          "fragments": 1}
if "--all" in words:
    tolerances = [{"tolerance": t, "pixels": counts, "area": counts,
                   "normals": {"regions": 1, "area_m2": float(good), "error_deg": 0.3 * good}} for t in (0.51, 0.8)]
    print(json.dumps({"views": 2, "patches": 10, "times_ms": [1.0 * good, 5.0],
                      "score": {"tolerances": tolerances, "cylinders": {"seen": 3, "found": good, "round": good,
                                                                              "radius_within_tenth": 1}}}))
else:
    report = {"valid": 100, "patches": [{}] * 7, "coverage_fraction": 0.5, "rms_mm": 4.2, "time_ms": 9.1}
    if "--truth" in words:
        report["score"] = {"tolerances": [{"tolerance": 0.8, "pixels": counts}]}
    print(json.dumps(report))
"""


class SegmentationTest(support.TreeTest):
    def score(self, *arguments):
        rosi = self.write("rosi", FAKE_ROSI)
        rosi.chmod(0o755)
        world = self.write("hall.toml", "")
        environment = {name: value for name, value in os.environ.items() if name != "ROSID_DATA_DIR"}
        return subprocess.run([str(support.ROOT / "tools/score_segmentation.py"), str(world), "--rosi", str(rosi), "--seeds",
                               "2", *map(str, arguments)], capture_output=True, text=True, check=False, env=environment)

    def test_adds_drives_up(self):
        done = self.score()
        self.assertEqual(done.returncode, 0, done.stderr)
        # 4 views, 8 regions, 2 + 4 correct; normals (0.3 * 1 + 0.6 * 2) / 3.
        self.assertIn("| hall | 4 | 8 | 75.0 | 75.0 | 1.50 | 0.50 | 0.50 | 3 of 6, radius of 2 | 5.0 | 3.5 |", done.stdout)
        self.assertIn("| 0.51 | 6 | 75.0 | 0 | 0 | 2 | 1.50 | 0.50 | 0.50 |", done.stdout)
        self.assertIn("ROSID_DATA_DIR is not set", done.stdout)

    def test_takes_the_scans_there_are_and_names_the_others(self):
        self.write("data/kurt3d/scan000.3d", "")
        self.write("data/synpeb/test_100.pcd", "")
        done = self.score("--data", self.tree / "data")
        self.assertIn("| kurt3d/scan000.3d | 100 | 7 | 50.0 | 4.2 | 9.1 | - |", done.stdout)
        self.assertIn("| synpeb/test_100.pcd | 100 | 7 | 50.0 | 4.2 | 9.1 | 4 of 4 |", done.stdout)
        self.assertIn("skipped: room/room_scan1.pcd is not in ROSID_DATA_DIR", done.stdout)

    def test_writes_between_the_markers_only(self):
        page = self.write("page.md", "head\n<!-- score: begin -->\nold\n<!-- score: end -->\ntail\n")
        self.assertEqual(self.score("--write", page).returncode, 0)
        text = page.read_text(encoding="utf-8")
        self.assertTrue(text.startswith("head\n<!-- score: begin -->\n") and text.endswith("<!-- score: end -->\ntail\n"))
        self.assertNotIn("old", text)
        self.assertIn("| hall | 4 |", text)

    def test_a_page_without_markers_is_left_alone(self):
        page = self.write("page.md", "head\n")
        done = self.score("--write", page)
        self.assertNotEqual(done.returncode, 0)
        self.assertIn("page.md", done.stderr)
        self.assertEqual(page.read_text(encoding="utf-8"), "head\n")

    def test_a_drive_that_fails_ends_it(self):
        done = self.score("--keep", self.tree / "kept")
        self.assertEqual(done.returncode, 0, done.stderr)
        again = self.score("--keep", self.tree / "kept")  # the fake cannot make its folders twice
        self.assertNotEqual(again.returncode, 0)
        self.assertIn("rosi sim failed", again.stderr)


if __name__ == "__main__":
    unittest.main()

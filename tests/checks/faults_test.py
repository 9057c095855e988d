"""Every row of docs/faults.md has tests, and every test it names is in the file it names."""

import pathlib
import re
import unittest

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
COLUMNS = ("row", "fault", "test", "counter", "recovery", "rung")
REQUIRED = ([f"L{k}" for k in range(1, 22)] + [f"R{k}" for k in range(1, 9)] +
            [f"C{k}" for k in (*range(1, 10), 12, 13, 14)] + ["T2", "T3"])
RUNGS = {"U", "P", "guest"}
# Names in code marks, then the file they are in.
GROUP = re.compile(r"((?:`\w+\.\w+`(?:, )?)+) \(([\w./]+)\)")
NAME = re.compile(r"`(\w+)\.(\w+)`")


def rows(text):
    found = []
    for line in text.splitlines():
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        if line.startswith("|") and re.fullmatch(r"[A-Z]\d+", cells[0]):
            found.append(cells)
    return found


def tests_of(cell):
    """(suite, test, file) of everything the cell names."""
    return [(suite, test, path) for names, path in GROUP.findall(cell) for suite, test in NAME.findall(names)]


def is_there(suite, test, path, root=ROOT):
    file = root / path
    if not file.is_file():
        return False
    pattern = rf"\b(?:TEST|TEST_F|TEST_P|RC_GTEST_PROP)\(\s*{suite},\s*{test}\b"
    return re.search(pattern, file.read_text(encoding="utf-8")) is not None


class FaultsTest(unittest.TestCase):
    def setUp(self):
        self.rows = rows((ROOT / "docs" / "faults.md").read_text(encoding="utf-8"))

    def test_every_fault_has_one_row_of_six_cells(self):
        names = [cells[0] for cells in self.rows]
        self.assertEqual(len(names), len(set(names)))
        self.assertEqual(sorted(set(REQUIRED) - set(names)), [])
        for cells in self.rows:
            with self.subTest(row=cells[0]):
                self.assertEqual(len(cells), len(COLUMNS))
                self.assertTrue(all(cells))
                rungs = set(cells[5].split(", "))
                self.assertEqual(rungs - RUNGS, set())
                self.assertTrue(rungs - {"guest"} or cells[2] == "guest", "a row without a test here is for the guest")

    def test_every_test_named_is_there(self):
        for cells in self.rows:
            if cells[2] == "guest":
                continue
            named = tests_of(cells[2])
            with self.subTest(row=cells[0]):
                self.assertEqual(len(named), cells[2].count("`") // 2, "a name without its file")
                self.assertGreater(len(named), 0)
                self.assertEqual([entry for entry in named if not is_there(*entry)], [])

    def test_a_name_that_is_not_there_is_found(self):
        self.assertFalse(is_there("LaserFaults", "NoSuchTest", "tests/unit/hal/laser_faults_test.cpp"))
        self.assertFalse(is_there("LaserFaults", "AFrozenDeviceIsNotUsed", "tests/unit/hal/no_such_test.cpp"))
        self.assertTrue(is_there("LaserFaults", "AFrozenDeviceIsNotUsed", "tests/unit/hal/laser_faults_test.cpp"))


if __name__ == "__main__":
    unittest.main()

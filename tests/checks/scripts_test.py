"""tools/test counts and ends as documented, tools/score runs what it finds, tools/spy names what is missing."""

import os
import pathlib
import shutil
import subprocess
import unittest

import support

# Stands in for cmake: fails when a file says that this command is to fail.
FAKE_CMAKE = """#!/bin/sh
echo "cmake $*" >> "$FAKE_DIR/calls"
case "$*" in *--build*) [ ! -e "$FAKE_DIR/build-fails" ] || { echo "a.cpp:1: error: no"; exit 1; } ;; esac
"""
# Stands in for ctest: writes the report it finds, and fails when that has failures.
FAKE_CTEST = """#!/bin/sh
echo "ctest $*" >> "$FAKE_DIR/calls"
while [ $# -gt 1 ]; do [ "$1" = --output-junit ] && cp "$FAKE_DIR/report.xml" "$2"; shift; done
! grep -q 'failures="[1-9]' "$FAKE_DIR/report.xml"
"""
REPORT = '<?xml version="1.0"?>\n<testsuite name="x"\n\ttests="{}"\n\tfailures="{}"\n\tdisabled="0"\n\tskipped="{}"\n\t>\n'


class ScriptTest(support.TreeTest):
    def executable(self, name, text):
        path = self.write(name, text)
        path.chmod(0o755)
        return path

    def copy(self, name):
        target = self.tree / "tools" / name
        target.parent.mkdir(exist_ok=True)
        shutil.copy(support.ROOT / "tools" / name, target)
        return target

    def run_script(self, *command, **environment):
        return subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False,
                              env={**os.environ, **environment})


class TestTest(ScriptTest):
    def setUp(self):
        super().setUp()
        self.copy("test")
        self.executable("tools/deps", "#!/bin/sh\n")
        self.executable("bin/cmake", FAKE_CMAKE)
        self.executable("bin/ctest", FAKE_CTEST)

    def run_test(self, *arguments, report=(7, 0, 2)):
        self.write("report.xml", REPORT.format(*report))
        (self.tree / "calls").unlink(missing_ok=True)
        done = self.run_script(self.tree / "tools/test", *arguments, FAKE_DIR=str(self.tree),
                               PATH=f"{self.tree}/bin:{os.environ['PATH']}")
        calls = pathlib.Path(self.tree / "calls")
        return done, done.stdout.splitlines()[-1], calls.read_text(encoding="utf-8") if calls.exists() else ""

    def test_the_sanitizers_are_asked_for(self):
        done, last, calls = self.run_test()
        self.assertEqual((done.returncode, last), (0, "11 passed, 0 failed"))
        self.assertEqual([name for name in ("tsan", "asan") if name in calls], [])

    def test_sums_over_all_stages(self):
        done, last, calls = self.run_test("--all")
        # dev, fuzz, tsan and asan have 5 each; clang-tidy over everything counts as one.
        self.assertEqual((done.returncode, last), (0, "21 passed, 0 failed"))
        self.assertEqual([name for name in ("dev", "tidy", "fuzz", "tsan", "asan") if f"--preset {name}" not in calls], [])

    def test_fast_is_dev_only(self):
        done, last, calls = self.run_test("--fast")
        self.assertEqual((done.returncode, last), (0, "5 passed, 0 failed"))
        self.assertNotIn("asan", calls)

    def test_a_failed_test_ends_the_run(self):
        done, last, calls = self.run_test(report=(7, 3, 1))
        self.assertEqual((done.returncode, last), (1, "3 passed, 3 failed"))
        self.assertNotIn("tidy", calls)

    def test_keep_going(self):
        done, last, _ = self.run_test("--all", "--keep-going", report=(7, 3, 1))
        self.assertEqual((done.returncode, last), (1, "13 passed, 12 failed"))

    def test_a_build_that_fails_counts_and_shows_why(self):
        self.write("build-fails", "")
        done, last, calls = self.run_test("dev")
        self.assertEqual((done.returncode, last), (1, "0 passed, 1 failed"))
        self.assertIn("a.cpp:1: error: no", done.stdout)
        self.assertNotIn("ctest", calls)

    def test_a_run_without_tests_is_no_success(self):
        done, last, _ = self.run_test("dev", report=("", "", ""))
        self.assertEqual((done.returncode, last), (1, "0 passed, 1 failed"))

    def test_failing_packages_end_the_run(self):
        self.executable("tools/deps", "#!/bin/sh\nexit 1\n")
        done, last, calls = self.run_test()
        self.assertEqual((done.returncode, last, calls), (1, "0 passed, 1 failed", ""))

    def test_an_unknown_stage_is_a_usage_error(self):
        self.assertEqual(self.run_test("nonsense")[0].returncode, 64)


class ScoreTest(ScriptTest):
    def run_score(self, *arguments):
        return self.run_script(support.ROOT / "tools/score", "--out", self.tree / "out", *arguments,
                               ROSID_SCORE_SCRIPTS=str(self.tree / "score.d"), ROSID_BIN=str(self.tree))

    def test_runs_what_it_finds_and_keeps_the_tables(self):
        self.executable("score.d/a.sh", '#!/bin/sh\n# Measures a.\necho "| a |"; touch "$ROSID_SCORE_OUT/kept"\n')
        self.executable("score.d/b.sh", "#!/bin/sh\n# Measures b.\necho no recordings >&2; exit 77\n")
        self.write("score.d/c.sh", "exit 1")  # not executable: no measurement
        done = self.run_score()
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertIn("| a |", done.stdout)
        self.assertIn("skipped: no recordings", done.stdout)
        self.assertEqual((self.tree / "out/a.md").read_text(encoding="utf-8"), "| a |\n")
        self.assertTrue((self.tree / "out/a/kept").exists())
        self.assertEqual(self.run_score("--list").stdout.split(), ["a", "Measures", "a.", "b", "Measures", "b."])

    def test_a_measurement_that_fails_fails(self):
        self.executable("score.d/a.sh", "#!/bin/sh\necho broken >&2; exit 3\n")
        done = self.run_score()
        self.assertEqual(done.returncode, 1)
        self.assertIn("broken", done.stdout)

    def test_nothing_there_and_unknown_names(self):
        self.assertEqual(self.run_score().returncode, 69)
        self.executable("score.d/a.sh", "#!/bin/sh\n")
        self.assertEqual(self.run_score("b").returncode, 64)


class SpyTest(ScriptTest):
    def run_spy(self, *arguments):
        return self.run_script(self.copy("spy"), *arguments, ROSID_JAVA_DIR=str(self.tree / "java"),
                               PATH=f"{self.tree}/bin:{os.environ['PATH']}")

    def test_names_what_is_missing(self):
        self.executable("bin/java", "#!/bin/sh\n")
        self.assertIn("lcm.jar is missing", self.run_spy("--print").stderr)
        self.write("java/lcm.jar", "x")
        self.write("java/jchart2d.jar", "x")
        done = self.run_spy("--print")
        self.assertIn("lcmtypes_rosid.jar", done.stderr)
        self.assertEqual(done.returncode, 69)

    def test_takes_the_newest_types(self):
        self.executable("bin/java", "#!/bin/sh\n")
        for name in ("java/lcm.jar", "java/jchart2d.jar"):
            self.write(name, "x")
        for age, build in enumerate(("release", "dev", "asan")):
            jar = self.write(f"build/{build}/msgs/lcmtypes_rosid.jar", "x")
            os.utime(jar, (1000 - age, 1000 - age) if build != "dev" else (2000, 2000))
        done = self.run_spy("--print", "-l", "memq://")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("build/dev/msgs/lcmtypes_rosid.jar", done.stdout)
        self.assertTrue(done.stdout.strip().endswith("lcm.spy.Spy -l memq://"))


if __name__ == "__main__":
    unittest.main()

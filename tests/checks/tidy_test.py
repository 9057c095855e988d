"""clang-tidy runs with the checks we think it runs with, and finds what they are for. A mistyped configuration would
otherwise switch it off without a word."""

import os
import subprocess
import unittest

import support

AT_LEAST = {"base": 350, "tests": 190}
MUST_RUN = ("bugprone-use-after-move", "bugprone-unchecked-optional-access", "bugprone-unused-return-value",
            "bugprone-dangling-handle", "bugprone-exception-escape", "cppcoreguidelines-narrowing-conversions",
            "concurrency-mt-unsafe", "clang-analyzer-core.NullDereference", "readability-identifier-naming")
BAD = """#include <optional>
#include <string>
#include <utility>
namespace rosid {
std::size_t after_move(std::string text) {
  const std::string other = std::move(text);
  return text.size() + other.size();
}
int optional_value(const std::optional<int>& value) { return *value; }
int null_pointer(bool is_set) {
  int x = 0;
  int* p = is_set ? &x : nullptr;
  return is_set ? 0 : *p;
}
int badName(double wide) { int narrow = wide; return narrow; }
}  // namespace rosid
"""
FINDINGS = ("bugprone-use-after-move", "bugprone-unchecked-optional-access", "clang-analyzer-core.NullDereference",
            "cppcoreguidelines-narrowing-conversions", "readability-identifier-naming")


class TidyTest(support.TreeTest):
    def tidy(self, *arguments):
        return subprocess.run(["clang-tidy-19", "--quiet", *arguments], capture_output=True, text=True, check=False,
                              cwd=support.ROOT)

    def checks(self, folder):
        # The configuration of a folder is the one for a file in it; the file need not exist.
        done = self.tidy("--list-checks", f"{folder}/any.cpp", "--")
        return [line.strip() for line in done.stdout.splitlines() if line.startswith("    ")]

    def test_enough_checks_are_enabled(self):
        for folder, least in AT_LEAST.items():
            self.assertGreaterEqual(len(self.checks(folder)), least, folder)

    def test_checks_that_find_bugs_are_enabled(self):
        self.assertEqual([name for name in MUST_RUN if name not in self.checks("base")], [])

    def test_bugs_are_found(self):
        source = self.write("bad.cpp", BAD)
        plugin = os.environ.get("ROSID_TIDY_PLUGIN")
        load = [f"--load={plugin}"] if plugin and os.path.exists(plugin) else []
        done = self.tidy(f"--config-file={support.ROOT}/.clang-tidy", *load, str(source), "--", "-std=c++20")
        self.assertEqual([name for name in FINDINGS if name not in done.stdout], [], done.stdout + done.stderr)
        self.assertNotEqual(done.returncode, 0)

    def test_the_configuration_has_no_mistakes(self):
        done = self.tidy("--verify-config")
        self.assertIn("No config errors detected", done.stdout + done.stderr)


if __name__ == "__main__":
    unittest.main()

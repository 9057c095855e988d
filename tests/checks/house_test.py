"""The checks of length, words and format can fail, and say where."""

import unittest

import support


class LengthTest(support.TreeTest):
    def test_one_line_too_many_is_reported(self):
        self.write("base/long.cpp", "\n" * 401)
        done = self.run_tool("check_length.py", "--root", self.tree)
        self.assertIn("base/long.cpp:400: 401 lines", done.stdout)
        self.assertEqual(done.returncode, 1)

    def test_the_limit_itself_passes(self):
        self.write("base/long.cpp", "\n" * 400)
        self.write("tests/unit/base/long_test.cpp", "\n" * 600)
        done = self.run_tool("check_length.py", "--root", self.tree)
        self.assertEqual(done.returncode, 0, done.stdout)


class WordsTest(support.TreeTest):
    # Put together at run time: this file is checked too.
    WRONG = ("TO" + "DO later", "// FIX" + "ME", "see /ho" + "me/me/x", "a st" + "ub", "not imple" + "mented yet")
    RIGHT = ("todos los", "homework", "a/wor" + "k/b", "stubborn", "hacking")

    def test_wrong_words_are_reported(self):
        for text in self.WRONG:
            with self.subTest(text=text):
                self.write("docs/a.md", f"first\n{text}\n")
                done = self.run_tool("check_words.py", "--root", self.tree)
                self.assertIn("docs/a.md:2:", done.stdout)
                self.assertEqual(done.returncode, 1)

    def test_other_words_pass(self):
        self.write("docs/a.md", "\n".join(self.RIGHT))
        done = self.run_tool("check_words.py", "--root", self.tree)
        self.assertEqual(done.returncode, 0, done.stdout)


class LinksTest(support.TreeTest):
    def test_a_dead_link_and_a_dead_name_are_reported(self):
        self.write("docs/a.md", "[b](b.md#part) and\n`base/time.hpp` or [far](https://example.org/x.md)\n")
        done = self.run_tool("check_links.py", "--root", self.tree)
        self.assertIn("docs/a.md:1: docs/b.md is not there", done.stdout)
        self.assertIn("docs/a.md:2: base/time.hpp is not there", done.stdout)
        self.assertEqual(done.returncode, 1)
        self.write("docs/b.md", "[a](a.md)")
        self.write("base/time.hpp", "")
        done = self.run_tool("check_links.py", "--root", self.tree)
        self.assertEqual(done.returncode, 0, done.stdout)


class FormatTest(support.TreeTest):
    def test_wrong_spacing_is_reported_and_mended(self):
        self.write(".clang-format", "BasedOnStyle: Google\n")
        path = self.write("base/a.cpp", "int   x=1;\n")
        self.assertEqual(self.run_tool("check_format.py", "--root", self.tree).returncode, 1)
        self.assertEqual(self.run_tool("check_format.py", "--root", self.tree, "--fix").returncode, 0)
        self.assertEqual(path.read_text(encoding="utf-8"), "int x = 1;\n")


if __name__ == "__main__":
    unittest.main()

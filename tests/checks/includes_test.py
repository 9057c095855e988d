"""tools/check_includes.py reports each kind of wrong include and lets the right ones pass."""

import unittest

import support

# (file, its only line, part of the report)
WRONG = (
    ("base/a.hpp", '#include "hal/x.hpp"', 'base must not include "hal/x.hpp"'),
    ("hal/a.cpp", '#include "estimator/x.hpp"', 'hal must not include "estimator/x.hpp"'),
    ("estimator/a.cpp", '#include "mapping/x.hpp"', 'estimator must not include "mapping/x.hpp"'),
    ("mapping/a.cpp", '#include "hal/x.hpp"', 'mapping must not include "hal/x.hpp"'),
    ("mapping/a.cpp", '#include "config/x.hpp"', 'mapping must not include "config/x.hpp"'),
    ("config/a.cpp", '#include "hal/x.hpp"', 'config must not include "hal/x.hpp"'),
    ("msgs/a.cpp", '#include "daemon/x.hpp"', 'msgs must not include "daemon/x.hpp"'),
    ("daemon/a.cpp", '#include "sim/x.hpp"', 'daemon must not include "sim/x.hpp"'),
    ("sim/a.cpp", '#include "daemon/x.hpp"', 'sim must not include "daemon/x.hpp"'),
    ("hal/a.cpp", '#include "x.hpp"', "is not a path from the root"),
    ("hal/a.cpp", '#include "base/missing.hpp"', "does not exist"),
    ("hal/lms/a.cpp", "#include <sys/epoll.h>", "<sys/epoll.h> belongs to"),
    ("hal/lms/a.cpp", "#include <fcntl.h>", "<fcntl.h> belongs to"),
    ("mapping/a.cpp", "#include <linux/can.h>", "<linux/can.h> belongs to"),
    ("mapping/a.cpp", "#include <polyclipping/clipper.hpp>", "belongs to mapping/polygon"),
    ("daemon/a.cpp", "#include <toml++/toml.h>", "belongs to config/toml"),
    ("hal/a.cpp", "#include <lcm/lcm.h>", "<lcm/lcm.h> belongs to"),
    ("daemon/a.cpp", "#include <embree3/rtcore.h>", "belongs to sim/"),
    ("hal/a.cpp", "#include <gpiod.h>", "belongs to hal/io"),
    ("estimator/a.cpp", "#include <thread>", "this folder is pure"),
    ("mapping/a.cpp", "#include <mutex>", "this folder is pure"),
    ("mapping/a.cpp", "#include <iostream>", "this folder is pure"),
    ("hal/lms/a.cpp", "#include <fstream>", "this folder is pure"),
    ("estimator/a.cpp", "auto t = std::chrono::steady_clock::now();", "reads a clock"),
    ("mapping/a.cpp", "std::random_device seed;", "is random in earnest"),
    ("hal/can/a.cpp", 'std::printf("x");', "writes to a stream"),
    ("config/a.cpp", "auto t = std::chrono::system_clock::now();", "reads a clock"),
    ("elsewhere/a.cpp", "", "unknown folder 'elsewhere'"),
)
RIGHT = (
    ("hal/a.cpp", '#include "base/x.hpp"'),
    ("hal/a.cpp", '#include "hal/x.hpp"'),
    ("config/a.cpp", '#include "hal/config.hpp"'),
    ("msgs/a.cpp", '#include "mapping/x.hpp"'),
    ("daemon/a.cpp", '#include "msgs/x.hpp"'),
    ("sim/a.cpp", '#include "hal/x.hpp"'),
    ("tools/rosi/a.cpp", '#include "sim/x.hpp"'),
    ("tests/unit/a.cpp", '#include "daemon/x.hpp"'),
    ("hal/io/a.cpp", "#include <sys/epoll.h>"),
    ("hal/io/a.cpp", "auto t = std::chrono::steady_clock::now();"),
    ("daemon/a.cpp", "#include <thread>"),
    ("mapping/polygon_union.cpp", "#include <polyclipping/clipper.hpp>"),
    ("estimator/a.cpp", "// never calls ::now() itself"),
    ("estimator/a.cpp", 'fail("no ::now() here");'),
)
HEADERS = ("base/x.hpp", "hal/x.hpp", "hal/config.hpp", "estimator/x.hpp", "mapping/x.hpp", "config/x.hpp", "msgs/x.hpp",
           "daemon/x.hpp", "sim/x.hpp")


class IncludesTest(support.TreeTest):
    def check(self, name, line):
        for header in HEADERS:
            self.write(header, "#pragma once\n")
        path = self.write(name, line + "\n")
        done = self.run_tool("check_includes.py", "--root", self.tree)
        path.unlink()
        return done

    def test_wrong_lines_are_reported(self):
        for name, line, expected in WRONG:
            with self.subTest(file=name, line=line):
                done = self.check(name, line)
                self.assertIn(expected, done.stdout + done.stderr)
                self.assertEqual(done.returncode, 1)

    def test_right_lines_pass(self):
        for name, line in RIGHT:
            with self.subTest(file=name, line=line):
                done = self.check(name, line)
                self.assertEqual(done.returncode, 0, done.stdout + done.stderr)

    def test_an_empty_tree_is_no_success(self):
        self.assertEqual(self.run_tool("check_includes.py", "--root", self.tree).returncode, 1)


if __name__ == "__main__":
    unittest.main()

#!/usr/bin/env python3
"""No source file longer than 400 lines, no test longer than 600 (a test file is a list of short cases around one
fixture, which splitting would double); whoever needs more gives a reason in the table below."""

import check_common

LIMIT = 400
TEST_LIMIT = 600
# File: (its own limit, why it cannot be split sensibly).
EXCEPTIONS = {}


def main():
    options = check_common.arguments(__doc__).parse_args()
    problems = []
    files = check_common.sources(options.root) + [
        path for path in check_common.project_files(options.root) if path.suffix == ".py"]
    for path in files:
        usual = TEST_LIMIT if path.name.endswith("_test.cpp") else LIMIT
        limit, _ = EXCEPTIONS.get(path.as_posix(), (usual, ""))
        lines = len((options.root / path).read_text(encoding="utf-8").splitlines())
        if lines > limit:
            problems.append(f"{path.as_posix()}:{limit}: {lines} lines, the limit is {limit}")
    present = {path.as_posix() for path in files}
    problems += [f"{name}: has an exception for its length but is not there" for name in EXCEPTIONS if name not in present]
    check_common.finish(problems, len(files))


if __name__ == "__main__":
    main()

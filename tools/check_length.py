#!/usr/bin/env python3
"""No source file longer than 400 lines; whoever needs more gives a reason in the table below."""

import check_common

LIMIT = 400
# File: (its own limit, why it cannot be split sensibly).
EXCEPTIONS = {
    "tests/unit/sim_devices/lms_emulator_test.cpp": (600, "one short case for each telegram of the protocol, one fixture"),
}


def main():
    options = check_common.arguments(__doc__).parse_args()
    problems = []
    files = check_common.sources(options.root) + [
        path for path in check_common.project_files(options.root) if path.suffix == ".py"]
    for path in files:
        limit, _ = EXCEPTIONS.get(path.as_posix(), (LIMIT, ""))
        lines = len((options.root / path).read_text(encoding="utf-8").splitlines())
        if lines > limit:
            problems.append(f"{path.as_posix()}:{limit}: {lines} lines, the limit is {limit}")
    present = {path.as_posix() for path in files}
    problems += [f"{name}: has an exception for its length but is not there" for name in EXCEPTIONS if name not in present]
    check_common.finish(problems, len(files))


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""Every C++ file is formatted as clang-format-19 would. `--fix` formats in place."""

import subprocess
import sys

import check_common

BATCH = 50


def main():
    parser = check_common.arguments(__doc__)
    parser.add_argument("--fix", action="store_true", help="format the files instead of reporting")
    options = parser.parse_args()
    files = [str(options.root / path) for path in check_common.sources(options.root)]
    mode = ["-i"] if options.fix else ["--dry-run", "-Werror"]
    failed = False
    for start in range(0, len(files), BATCH):
        done = subprocess.run(["clang-format-19", "--style=file", *mode, *files[start:start + BATCH]], check=False)
        failed = failed or done.returncode != 0
    print(f"{len(files)} files checked" + (", run tools/check_format.py --fix" if failed else ""))
    sys.exit(1 if failed or not files else 0)


if __name__ == "__main__":
    main()

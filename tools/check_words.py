#!/usr/bin/env python3
"""Words that do not belong into a finished file: notes of unfinished work, and places that exist on one machine only."""

import re

import check_common

# The brackets keep this file from finding itself.
WORDS = {
    r"\b(TOD[O]|FIXM[E]|XX[X]|HAC[K])\b": "a note of unfinished work; finish it or write an issue",
    r"(?i)\b(not implemente[d]|placeholde[r]|stu[b])\b": "unfinished by its own words",
    r"(?<![\w.])/(wor[k]|hom[e]|roo[t]|User[s])/": "a path of one machine",
    r"(?i)\b(deb\.debia[n]|registry\.npmj[s]|pypi\.or[g]|github\.com/[^/\s]+/rosi[d])\b": "a host name",
}
PATTERNS = [(re.compile(pattern), why) for pattern, why in WORDS.items()]


def main():
    options = check_common.arguments(__doc__).parse_args()
    problems = []
    checked = 0
    for path in check_common.project_files(options.root):
        name = path.as_posix()
        data = (options.root / path).read_bytes()
        if b"\0" in data:
            continue
        checked += 1
        for number, line in enumerate(data.decode("utf-8", errors="replace").splitlines(), start=1):
            problems += [f"{name}:{number}: '{found.group(0)}': {why}"
                         for pattern, why in PATTERNS for found in [pattern.search(line)] if found]
    check_common.finish(problems, checked)


if __name__ == "__main__":
    main()

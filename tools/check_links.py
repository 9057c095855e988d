#!/usr/bin/env python3
"""Links between the documents lead to files that are there, and so do the paths of this repository they name."""

import re

import check_common

LINK = re.compile(r"\]\(([^)#\s]+)(?:#[^)]*)?\)")
# A path in code marks: `mapping/mapper.hpp`, `docs/rosi.md`. Only names with a folder of this repository and an ending.
NAMED = re.compile(r"`((?:base|hal|estimator|mapping|config|msgs|daemon|sim|tools|tests|docs|systemd|cmake)/[\w./-]+\.\w+)`")


def main():
    options = check_common.arguments(__doc__).parse_args()
    problems = []
    documents = [path for path in check_common.project_files(options.root) if path.suffix == ".md"]
    for path in documents:
        text = (options.root / path).read_text(encoding="utf-8")
        for number, line in enumerate(text.splitlines(), start=1):
            targets = [(options.root / path).parent / link for link in LINK.findall(line) if "://" not in link]
            targets += [options.root / name for name in NAMED.findall(line) if "NAME" not in name]
            problems += [f"{path.as_posix()}:{number}: {target.relative_to(options.root)} is not there"
                         for target in targets if not target.exists()]
    check_common.finish(problems, len(documents))


if __name__ == "__main__":
    main()

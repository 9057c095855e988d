#!/usr/bin/env python3
"""tools/deps names every package this build really used: each system header the compiler read, each library, program
and package description CMake found must belong to a package of the list or to one those depend on."""

import argparse
import pathlib
import re
import subprocess
import sys

# Always there on a Debian system a compiler can be installed on.
BASE_SYSTEM = {"base-files", "bash", "coreutils", "dpkg", "libc6", "libc-bin", "util-linux"}
USED_CMAKE_TOOLS = {"CMAKE_CXX_COMPILER", "CMAKE_MAKE_PROGRAM", "CMAKE_AR", "CMAKE_COMMAND"}
BATCH = 400


def run(*command, **options):
    return subprocess.run(command, capture_output=True, text=True, check=False, **options)


def used_files(build):
    """System files the build read (ninja's dependency log) and CMake found (its cache)."""
    files = set()
    for line in run("ninja", "-C", str(build), "-t", "deps").stdout.splitlines():
        name = line.strip()
        if name.startswith("/usr/"):
            files.add(name)
    for line in (build / "CMakeCache.txt").read_text(encoding="utf-8").splitlines():
        # CMake looks for many tools of its own (CMAKE_...) that nothing here uses.
        entry = re.match(r"([^:#/]+):(?:FILEPATH|PATH|INTERNAL)=(/usr/.*)$", line)
        if entry and (not entry.group(1).startswith("CMAKE_") or entry.group(1) in USED_CMAKE_TOOLS):
            files.update(name for name in entry.group(2).split(";") if name.startswith("/usr/"))
    resolved = set()
    for name in files:
        path = pathlib.Path(name).resolve()
        if path.is_file() and not path.is_relative_to("/usr/local"):
            resolved.add(str(path))
    return sorted(resolved)


def owners(files):
    """Package of each file; files of no package are left out (ccache's links, alternatives)."""
    found = {}
    for start in range(0, len(files), BATCH):
        batch = files[start:start + BATCH]
        # Debian moved /lib into /usr/lib; the database may know either name.
        names = batch + [name.removeprefix("/usr") for name in batch]
        for line in run("dpkg-query", "-S", *names).stdout.splitlines():
            packages, _, name = line.rpartition(": ")
            if not name.startswith("/usr/"):
                name = "/usr" + name
            for package in packages.split(", "):
                if not package.startswith("diversion by"):
                    found.setdefault(name, set()).add(package.split(":")[0])
    return found


def installed_dependencies():
    graph, provides = {}, {}
    listing = run("dpkg-query", "-W", "-f", "${Package}\t${Provides}\t${Pre-Depends},${Depends}\n").stdout
    for line in listing.splitlines():
        package, provided, depends = line.split("\t")
        names = [re.split(r"[ :(]", name.strip())[0] for name in re.split(r"[,|]", depends) if name.strip()]
        graph.setdefault(package, set()).update(names)
        for name in provided.split(","):
            if name.strip():
                provides.setdefault(name.split("(")[0].strip(), set()).add(package)
    return graph, provides


def closure(packages):
    graph, provides = installed_dependencies()
    seen, todo = set(), list(packages)
    while todo:
        package = todo.pop()
        if package in seen:
            continue
        seen.add(package)
        todo += graph.get(package, ())
        todo += provides.get(package, ())
    return seen


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--build", type=pathlib.Path, required=True, help="a configured and built folder")
    parser.add_argument("--deps", type=pathlib.Path, required=True, help="the script that lists the packages")
    options = parser.parse_args()
    listed = set(run(str(options.deps), "--list").stdout.split())
    optional = {"libgpiod-dev"}
    covered = closure(listed | optional) | BASE_SYSTEM
    files = used_files(options.build)
    missing = {}
    for name, packages in owners(files).items():
        if not packages & covered:
            missing.setdefault(", ".join(sorted(packages)), name)
    for package, example in sorted(missing.items()):
        print(f"{package} is used (for example {example}) but neither in tools/deps --list nor a dependency of it")
    print(f"{len(files)} system files used, {len(listed)} packages listed, {len(missing)} packages missing")
    sys.exit(1 if missing or not files or not listed else 0)


if __name__ == "__main__":
    main()
